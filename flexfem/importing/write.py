"""The mechanism file of a plate that was found in a drawing, as a person would write it."""

from __future__ import annotations

import cmath
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from flexfem.files.refusals import as_toml
from flexfem.importing.equal import (
    CopiedParts,
    EqualHinges,
    Images,
    PartShape,
    equal_hinges,
    find_copies,
    mirrored,
    shape_of,
    turned_round,
)
from flexfem.importing.found import FoundBody, FoundHinge, FoundPlate
from flexfem.importing.outline import (
    HingeSize,
    PlacedVertex,
    Term,
    decimal,
    hinge_ends,
    number_text,
    outline_rows,
    placed_vertices,
    row_text,
    vertices_of,
)
from flexfem.importing.roles import Roles
from flexfem.mechanism.layout import Joint, Move
from flexfem.mechanism.outlines import Segment, circle_of
from flexfem.mechanism.profiles import profile_of
from flexfem.refused import BadInput

WIDE = 110  # characters of a line of corners
SNAP = 2e-7  # mm, at the ends of a hinge, by which its direction is rounded
PLURALS = {
    "leaf": "leaves",
    "filleted": "filleted hinges",
    "circular": "circular notches",
    "elliptical": "elliptical hinges",
    "parabolic": "parabolic hinges",
    "v": "v-shaped hinges",
    "profile": "hinges by table",
}
# Other shapes are named after themselves.
SINGULARS = {"leaf": "leaf", "circular": "notch", "profile": "hinge"}
UNITS = {"angle": "deg"}  # of dimensions that are not in mm
GROUND = "ground"
STAGE = "stage"
LINK = "link"
ASSUMED_STACK = "AE0505D16"


class PartNames(NamedTuple):
    """Names of all found bodies and hinges by their index, in the written file."""

    bodies: list[str]
    hinges: list[str]


class WrittenMechanism(NamedTuple):
    """The text of a mechanism file, the names of its parts, and the hinges as it states them."""

    text: str
    names: PartNames
    joints: list[Joint]


class Heading(NamedTuple):
    """What a file states about the whole plate.

    thickness : mm.   sources : by key path.
    """

    name: str
    thickness: float
    material: str
    sources: Mapping[str, str]


def joint_of(hinge: FoundHinge, name: str = "") -> Joint:
    """Return a found hinge as a hinge of a layout, which cuts nothing from its bodies."""
    given: dict[str, Any] = {
        key: math.radians(value) if key == "angle" else value
        for key, value in hinge.dimensions.items()
    }
    if hinge.table:
        given |= {"table": hinge.table, "smooth": hinge.smooth}
    if hinge.side is not None:
        given["side"] = hinge.side
    profile = profile_of(hinge.shape, given)
    return Joint(name, hinge.bodies, hinge.place, hinge.heading, profile, 0.0)


def written(
    found: FoundPlate,
    roles: Roles,
    heading: Heading,
) -> WrittenMechanism:
    """Return the mechanism file of a plate. Raises BadInput for a clamped edge that is a fillet."""
    return _Writer(found, roles, heading).written()


class _Part(NamedTuple):
    """A "body" or a "hinge", by its number, the index among those that were found."""

    kind: str
    number: int


def _is_copied(part: _Part, copies: CopiedParts) -> bool:
    """Return whether a part is an original of copies."""
    return part.number in (copies.bodies if part.kind == "body" else copies.hinges)


def _image_of(part: _Part, images: Images) -> _Part:
    """Return the copy of a part."""
    found = images.bodies if part.kind == "body" else images.hinges
    return _Part(part.kind, found[part.number])


class _Writer:
    """The parts of a file and the text of it."""

    def __init__(
        self,
        found: FoundPlate,
        roles: Roles,
        heading: Heading,
    ) -> None:
        self.found = found
        self.roles = roles
        self.heading = heading
        depths = _depths(found, roles)
        hinges = [_outwards(hinge, depths) for hinge in found.hinges]
        self.groups = equal_hinges(hinges)
        self.roots = _roots(self.groups)
        self.prefixes = _prefixes(self.groups, self.roots)
        self.group_of = {k: n for n, group in enumerate(self.groups) for k in group.members}
        shapes = [_shape(body, k, roles) for k, body in enumerate(found.bodies)]
        self.copies = find_copies(hinges, self.groups, shapes, _rounded_point)
        self.hinges = self._placed(hinges)
        self.joints = [joint_of(hinge) for hinge in self.hinges]
        images = [step for copies in self.copies for step in copies.images]
        copied_bodies = {k for step in images for k in step.bodies.values()}
        copied_hinges = {k for step in images for k in step.hinges.values()}
        kept = [k for k in range(len(found.bodies)) if k not in copied_bodies]
        self.bodies = sorted(kept, key=lambda k: (k not in roles.fixed, k != roles.output))
        self.originals = [k for k in range(len(hinges)) if k not in copied_hinges]
        self.names = self._named()

    def _placed(self, hinges: Sequence[FoundHinge]) -> list[FoundHinge]:
        """Return the hinges as the file states them: rounded, and copies as moved ones."""
        placed = [_rounded(hinge, self.groups[self.group_of[k]]) for k, hinge in enumerate(hinges)]
        for copies in self.copies:
            for move, images in zip(copies.moves, copies.images, strict=True):
                for original, copy in images.hinges.items():
                    placed[copy] = _moved(placed[original], move, images.bodies)
        return placed

    def _named(self) -> PartNames:
        """Return the names of all parts, those of copies as `[[copy]]` gives them."""
        names = dict[_Part, str]()
        for k, name in zip(self.bodies, self._body_names(), strict=True):
            names[_Part("body", k)] = name
        for k, name in zip(self.originals, self._hinge_names(), strict=True):
            names[_Part("hinge", k)] = name
        roots = dict(names)
        counts = Counter(dict.fromkeys(names.values(), 1))
        for copies in self.copies:
            copied = [part for part in names if _is_copied(part, copies)]
            for images in copies.images:
                for part in copied:
                    image = _image_of(part, images)
                    root = roots[part]
                    counts[root] += 1
                    roots[image] = root
                    names[image] = f"{root} {counts[root]}"
        return PartNames(
            [names[_Part("body", k)] for k in range(len(self.found.bodies))],
            [names[_Part("hinge", k)] for k in range(len(self.found.hinges))],
        )

    def _body_names(self) -> list[str]:
        """Return the names of the bodies that the file describes."""
        fixed = [k for k in self.bodies if k in self.roles.fixed]
        links = [k for k in self.bodies if k not in self.roles.fixed and k != self.roles.output]
        named = dict(zip(fixed, _lettered(GROUND, len(fixed)), strict=True))
        named |= dict(zip(links, _lettered(LINK, len(links)), strict=True))
        named[self.roles.output] = STAGE
        return [named[k] for k in self.bodies]

    def _hinge_names(self) -> list[str]:
        """Return the names of the hinges that the file describes."""
        named = dict[int, str]()
        for group, root in zip(self.groups, self.roots, strict=True):
            members = [k for k in self.originals if k in group.members]
            named |= dict(zip(members, _lettered(root, len(members)), strict=True))
        return [named[k] for k in self.originals]

    def written(self) -> WrittenMechanism:
        """Return the file."""
        parts = [
            self._start(),
            self._parameters(),
            *map(self._body, self.bodies),
            *map(self._hinge, self.originals),
        ]
        parts += [
            *map(self._copy, self.copies),
            *self._actuators(),
            self._output(),
            self._provenance(),
        ]
        text = "\n\n".join(part for part in parts if part) + "\n"
        return WrittenMechanism(text, self.names, self.joints)

    def _start(self) -> str:
        drawing = self.found.drawing.path.name
        bodies = len(self.found.bodies)
        hinges = len(self.found.hinges)
        lines = [
            f"# Read from {drawing}: {_counted(bodies, 'body', 'bodies')}, "
            f"{_counted(hinges, 'hinge', 'hinges')}."
        ]
        lines.append(
            "# Points are x, y in mm as in the drawing. `flexfem schema mechanism` explains "
            "every key."
        )
        if self._has_parameters():
            lines.append(
                "# Equal hinges share their dimensions in [parameters]: a change there changes "
                "all of them, and the"
            )
            lines.append(
                "# edges of bodies follow, because their corners are expressions of the "
                "parameters (without units)."
            )
        lines += ["", f"name = {as_toml(self.heading.name)}"]
        lines.append(f"thickness_mm = {number_text(decimal(self.heading.thickness))}")
        lines += ["", "[material]", f"name = {as_toml(self.heading.material)}"]
        return "\n".join(lines)

    def _has_parameters(self) -> bool:
        return any(group.dimensions for group in self.groups)

    def _parameters(self) -> str:
        if not self._has_parameters():
            return ""
        lines = ["[parameters]"]
        for group, prefix in zip(self.groups, self.prefixes, strict=True):
            count = len(group.members)
            whose = f"of {_counted(count, _singular(group.shape), PLURALS[group.shape])}"
            for k, (key, value) in enumerate(_stated(group).items()):
                line = f"{prefix}{key}_{UNITS.get(key, 'mm')} = {number_text(value)}"
                lines.append(f"{line:<41} # {whose}" if k == 0 else line)
        return "\n".join(lines)

    def _body(self, index: int) -> str:
        body = self.found.bodies[index]
        lines = ["[[body]]", f"name = {as_toml(self.names.bodies[index])}"]
        if index in self.roles.fixed:
            lines.append("fixed = true")
        circle = circle_of(body.outside)
        if circle is not None:
            lines += _disc(*circle)
        else:
            vertices = self._vertices(body.outside, index)
            lines += _corners(outline_rows(vertices))
            if index in self.roles.clamped:
                lines.append(f"clamped_edges = {self._clamped(vertices, index)}")
        for hole in body.holes:
            lines += ["", "[[body.holes]]"]
            circle = circle_of(hole)
            if circle is not None:
                lines += _disc(*circle)
            else:
                lines += _corners(outline_rows(self._vertices(hole, index)))
        return "\n".join(lines)

    def _vertices(
        self,
        loop: Sequence[Segment],
        body: int,
    ) -> list[PlacedVertex]:
        return placed_vertices(vertices_of(loop, hinge_ends(self.joints, body)), self._sizes())

    def _clamped(
        self,
        vertices: Sequence[PlacedVertex],
        body: int,
    ) -> list[int]:
        """Return the edges of the written outline on which the clamped segments lie."""
        segments = self.roles.clamped[body]
        edges = list[int]()
        for number, placed in enumerate(vertices, 1):
            if not set(segments).isdisjoint(placed.vertex.after.segments):
                edges.append(number)
        if not edges:
            place = complex(self.found.bodies[body].outside[segments[0]].at(0.5))
            raise BadInput(
                f"ground {place.real:.6g},{place.imag:.6g}: this is a fillet, expected a point on "
                "an edge, or in a body"
            )
        return edges

    def _sizes(self) -> list[HingeSize]:
        """Return length and height of the ends of all hinges as sums of parameters."""
        found = list[HingeSize]()
        for k, hinge in enumerate(self.hinges):
            group = self.group_of[k]
            found.append(_size(self.groups[group], self.prefixes[group], hinge.side))
        return found

    def _hinge(self, index: int) -> str:
        hinge = self.hinges[index]
        group = self.groups[self.group_of[index]]
        prefix = self.prefixes[self.group_of[index]]
        between = [self.names.bodies[body] for body in hinge.bodies]
        lines = [
            "[[hinge]]",
            f"name = {as_toml(self.names.hinges[index])}",
            f"between = {as_toml(between)}",
        ]
        lines.append(f"at_mm = {row_text([hinge.place.real, hinge.place.imag])}")
        lines.append(f"direction_deg = {number_text(_degrees(hinge.heading))}")
        lines.append(f'shape = "{hinge.shape}"')
        lines += [f'{key}_{UNITS.get(key, "mm")} = "{prefix}{key}"' for key in group.dimensions]
        if hinge.side is not None:
            lines.append(f'side = "{hinge.side}"')
        if hinge.table:
            lines.append(f"table_mm = {_rows(hinge.table)}")
        if hinge.smooth:
            lines.append("smooth = true")
        return "\n".join(lines)

    def _copy(self, copies: CopiedParts) -> str:
        names = sorted((self.names.bodies[k] for k in copies.bodies), key=in_order)
        names += sorted((self.names.hinges[k] for k in copies.hinges), key=in_order)
        lines = ["[[copy]]", f"parts = {as_toml(names)}"]
        if copies.mirror is not None:
            first, second = (row_text([decimal(z.real), decimal(z.imag)]) for z in copies.mirror)
            lines.append(f"mirror_mm = [{first}, {second}]")
        else:
            lines.append(f"count = {copies.times}")
            lines.append(f"about_mm = {row_text([copies.about.real, copies.about.imag])}")
        return "\n".join(lines)

    def _actuators(self) -> Iterator[str]:
        names = _lettered("drive", len(self.roles.actuators))
        for pushed, name in zip(self.roles.actuators, names, strict=True):
            between = [GROUND if body < 0 else self.names.bodies[body] for body in pushed.bodies]
            points = ", ".join(row_text([decimal(z.real), decimal(z.imag)]) for z in pushed.points)
            lines = [
                "[[actuator]]",
                f'name = "{name}"',
                f"between = {as_toml(between)}",
                f"at_mm = [{points}]",
                f"stack = {as_toml(pushed.stack or ASSUMED_STACK)}",
            ]
            yield "\n".join(lines)

    def _output(self) -> str:
        at = row_text([decimal(self.roles.at.real), decimal(self.roles.at.imag)])
        lines = ["[output]", f"body = {as_toml(STAGE)}", f"at_mm = {at}"]
        if self.roles.contact is not None:
            lines.append(f"contact_mm = {number_text(self.roles.contact)}")
        return "\n".join(lines)

    def _provenance(self) -> str:
        read = f"read from {self.found.drawing.path.name}"
        sources = {**self.heading.sources, "body": read}
        if self._has_parameters():
            sources["parameters"] = read
        if self.found.hinges:
            sources["hinge"] = read
        if self.copies:
            sources["copy"] = read
        sources |= self._sources_of_ground()
        sources["output"] = self.roles.sources["output"]
        if self.roles.contact is not None:
            sources["output.contact_mm"] = (
                "assumed: half of the edge at the output, or a twentieth of the body"
            )
        sources |= self._sources_of_actuators()
        lines = [f"{as_toml(key)} = {as_toml(text)}" for key, text in sources.items()]
        return "\n".join(["[provenance]", *lines])

    def _sources_of_ground(self) -> dict[str, str]:
        """Return why bodies are fixed or clamped, by key path."""
        sources = dict[str, str]()
        for number, index in enumerate(self.bodies):
            path = _key_path("body", self.names.bodies[index], number)
            if index in self.roles.fixed:
                sources[f"{path}.fixed"] = self.roles.sources["ground"]
            elif index in self.roles.clamped:
                sources[f"{path}.clamped_edges"] = self.roles.sources["ground"]
        return sources

    def _sources_of_actuators(self) -> dict[str, str]:
        """Return where actuators and stacks are stated, by key path."""
        sources = dict[str, str]()
        names = _lettered("drive", len(self.roles.actuators))
        for number, (pushed, name) in enumerate(zip(self.roles.actuators, names, strict=True)):
            path = _key_path("actuator", name, number)
            sources[path] = "stated with the import"
            if not pushed.stack:
                sources[f"{path}.stack"] = "assumed: no stack was stated"
        return sources


def _key_path(
    table: str,
    name: str,
    number: int,
) -> str:
    """Return the key path of an element: by its name, or by its number where that is no word."""
    return f"{table}.{name}" if name.isidentifier() else f"{table}[{number}]"


def _depths(found: FoundPlate, roles: Roles) -> list[int]:
    """Return the number of hinges between the ground and each body."""
    depths = [
        0 if k in roles.fixed or k in roles.clamped else len(found.bodies)
        for k in range(len(found.bodies))
    ]
    for _ in found.bodies:
        for hinge in found.hinges:
            first, second = hinge.bodies
            depths[first] = min(depths[first], depths[second] + 1)
            depths[second] = min(depths[second], depths[first] + 1)
    return depths


def _outwards(hinge: FoundHinge, depths: Sequence[int]) -> FoundHinge:
    """Return a hinge whose first body is the one nearer to the ground."""
    first, second = hinge.bodies
    return hinge if (depths[first], first) <= (depths[second], second) else turned_round(hinge)


def _shape(
    body: FoundBody,
    index: int,
    roles: Roles,
) -> PartShape:
    """Return what decides whether a body is a copy of another."""
    role: str | None = "fixed" if index in roles.fixed else "moves"
    if index == roles.output:
        role = None
    clamped_segments = set(roles.clamped.get(index, ()))
    sides = list[Segment]()
    clamped = list[int]()
    for loop in (body.outside, *body.holes):
        for vertex in vertices_of(loop, ()):
            after = vertex.after
            if loop is body.outside and not clamped_segments.isdisjoint(after.segments):
                clamped.append(len(sides))
            sides.append(Segment(after.start, after.end, after.centre))
    return shape_of(sides, clamped, role)


def _rounded(hinge: FoundHinge, group: EqualHinges) -> FoundHinge:
    """Return a hinge as it is written, with the dimensions of its group."""
    profile = joint_of(hinge).profile
    reach = max(abs(profile.length), profile.end_height) / 2
    degrees = math.degrees(hinge.heading)
    fewer = round(degrees, 4)
    if math.radians(abs(fewer - degrees)) * reach <= SNAP:
        degrees = fewer
    return hinge._replace(
        place=_rounded_point(hinge.place),
        heading=math.radians(_degrees(math.radians(degrees))),
        dimensions=_stated(group),
        table=tuple(tuple(map(decimal, row)) for row in hinge.table),
    )


def _rounded_point(point: complex) -> complex:
    return complex(decimal(point.real), decimal(point.imag))


def _degrees(heading: float) -> float:
    """Return a direction in degrees, above -180 up to 180, as it is written."""
    degrees = round(math.degrees(cmath.phase(cmath.exp(1j * heading))), 9)
    return 180.0 if degrees == -180 else degrees + 0.0


def _stated(group: EqualHinges) -> dict[str, float]:
    return {key: decimal(value) for key, value in group.dimensions.items()}


def _moved(
    hinge: FoundHinge,
    move: Move,
    bodies: Mapping[int, int],
) -> FoundHinge:
    first, second = hinge.bodies
    ends = (bodies.get(first, first), bodies.get(second, second))
    image = mirrored(hinge) if move.mirrored else hinge
    return image._replace(
        bodies=ends,
        place=move(hinge.place),
        heading=move.heading(hinge.heading),
    )


def _size(
    group: EqualHinges,
    prefix: str,
    side: str | None,
) -> HingeSize:
    """Return length and edges of a hinge as sums of the parameters of its group."""
    sizes = _stated(group)
    if "neck" not in sizes:
        return HingeSize()

    def term(times: float, key: str) -> Term:
        return Term(times, f"{prefix}{key}", sizes[key])

    match group.shape:
        case "leaf" | "filleted":
            length = [term(1, "length")]
            notch = [term(1, "fillet")] if "fillet" in sizes else []
        case "circular":
            length = [term(2, "radius")]
            notch = [term(1, "radius")]
        case "elliptical" | "parabolic":
            length = [term(1, "length")]
            notch = [term(1, "depth")]
        case "v":
            length = _length_of_v(prefix, sizes)
            notch = [term(1, "depth")]
        case _:
            return HingeSize()
    neck = term(0.5, "neck")
    left = (neck,) if side == "right" else (neck, *notch)
    right = (neck,) if side == "left" else (neck, *notch)
    return HingeSize(tuple(length), left, right)


def _length_of_v(prefix: str, sizes: Mapping[str, float]) -> list[Term]:
    """Return the length of a v-shaped hinge: both flanks, and the arc of the root between them."""
    half = math.radians(sizes["angle"]) / 2
    depth = f"{prefix}depth"
    root = f"{prefix}root_radius"
    angle = f"{prefix}angle / 2"
    return [
        Term(2, f"{depth} * tan({angle})", math.tan(half) * sizes["depth"]),
        Term(2, f"{root} / cos({angle})", 1 / math.cos(half) * sizes["root_radius"]),
        Term(-2, f"{root} * tan({angle})", math.tan(half) * sizes["root_radius"]),
    ]


def _roots(groups: Sequence[EqualHinges]) -> list[str]:
    """Return what the names of the hinges of each group begin with.

    It is a word such as "leaf", or "leaf 1" of several groups.
    """
    counts = Counter(group.shape for group in groups)
    seen = Counter[str]()
    found = list[str]()
    for group in groups:
        seen[group.shape] += 1
        number = f" {seen[group.shape]}" if counts[group.shape] > 1 else ""
        found.append(f"{_singular(group.shape)}{number}")
    return found


def _prefixes(groups: Sequence[EqualHinges], roots: Sequence[str]) -> list[str]:
    """Return what the names of the parameters of each group begin with.

    It is nothing where there is one group alone.
    """
    if sum(bool(group.dimensions) for group in groups) < 2:
        return [""] * len(groups)
    return [f"{root.replace(' ', '_')}_" for root in roots]


def in_order(name: str) -> list[tuple[bool, int, str]]:
    """Return a key that sorts names with numbers as people do."""
    parts = re.split(r"(\d+)", name)
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


def _singular(shape: str) -> str:
    return SINGULARS.get(shape, shape)


def _lettered(root: str, count: int) -> list[str]:
    """Return names for parts of a kind: one keeps the name, of several each has a letter."""
    if count == 1:
        return [root]
    joint = "" if root[-1].isdigit() else " "
    return [f"{root}{joint}{_letters(k)}" for k in range(count)]


def _letters(index: int) -> str:
    """Return a, b, ... z, aa, ab, ..."""
    text = chr(ord("a") + index % 26)
    return text if index < 26 else _letters(index // 26 - 1) + text


def _counted(
    count: int,
    one: str,
    many: str,
) -> str:
    return f"{count} {one if count == 1 else many}"


def _disc(centre: complex, radius: float) -> list[str]:
    at = row_text([decimal(centre.real), decimal(centre.imag)])
    return [f"centre_mm = {at}", f"radius_mm = {number_text(decimal(radius))}"]


def _corners(rows: Sequence[Sequence[float | str]]) -> list[str]:
    return [f"outline_mm = {_rows(rows)}"]


def _rows(rows: Sequence[Sequence[float | str]]) -> str:
    texts = [row_text(row) for row in rows]
    if sum(len(text) + 2 for text in texts) < WIDE:
        return f"[{', '.join(texts)}]"
    return "\n".join(["[", *(f"    {text}," for text in texts), "]"])
