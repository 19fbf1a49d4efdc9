"""The layout of a mechanism file: its parts and their copies as bodies, hinges and actuators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from flexfem.files.refusals import nearest, shown
from flexfem.mechanism.copies import PARTS, PlacedPart, placed_parts, rotations
from flexfem.mechanism.layout import (
    Body,
    Constants,
    Joint,
    Layout,
    LinearActuator,
    Move,
    Patch,
    PayloadMass,
)
from flexfem.mechanism.outlines import Outline, bar, disc, polygon_points, reverse, rounded
from flexfem.mechanism.parts import BodyHole, MechanismTables, PlateBody, PlateHinge
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_shape import BadDimension
from flexfem.mechanism.profiles import profile_of
from flexfem.refused import BadInput

GROUND = "ground"  # carries actuators, also where no body has this name
CUT = 1.02  # default height of a cut relative to the bodies or the profile
CONTACT = 1 / 20  # default radius of a contact relative to the extent of its body
OUTSIDE = -1  # number of the ground outside the plate, as in `Patch`
ABSENT = -2  # number of a body that an unfinished file does not have


def layout_of(mechanism: MechanismTables, missing: list[str] | None = None) -> Layout:
    """Return the layout of a mechanism. Raises BadInput for parts that do not fit together.

    Parameters
    ----------
    missing : list of str, optional
        For drawings of an unfinished file: to this list the bodies are added that parts name and
        that are not there, instead of a refusal. A hinge is then without this body, and other parts
        on it are left out.
    """
    return _Assembly(mechanism, missing).layout()


class _Assembly:
    """A mechanism file whose parts are joined, with its bodies by name."""

    def __init__(
        self,
        mechanism: MechanismTables,
        missing: list[str] | None,
    ) -> None:
        self.mechanism = mechanism
        self.missing = missing
        self.parts: dict[str, list[PlacedPart]] = {kind: [] for kind in PARTS}
        for part in placed_parts(mechanism):
            self.parts[part.kind].append(part)
        self.index = {part.name: k for k, part in enumerate(self.parts["body"])}
        self.bodies = [_body(part, mechanism) for part in self.parts["body"]]

    def layout(self) -> Layout:
        """Return the layout, with the parts in the order in which the file may be refused."""
        joints = [self.joint(part) for part in self.parts["hinge"]]
        points = self.points()
        fixed = (k for k, body in enumerate(self.bodies) if body.fixed)
        self.index.setdefault(GROUND, next(fixed, OUTSIDE))
        actuators = [self.actuator(part) for part in self.parts["actuator"]]
        return Layout(
            bodies=tuple(self.bodies),
            joints=tuple(joints),
            points=tuple(points),
            actuators=tuple(actuator for actuator in actuators if actuator is not None),
            payloads=tuple(self.payloads(points)),
            wide=self.mechanism.model == "three_dimensional",
            **self.mechanism.plane_problem,
        )

    def number_of(
        self,
        name: str,
        key: str,
    ) -> int:
        """Return the number of a body that a key names. Raises BadInput where it is not there."""
        if name in self.index:
            return self.index[name]
        near = nearest(name, self.index)
        text = f"{key} = {shown(name)}, expected the name of a body{near}"
        if self.missing is None:
            raise BadInput(text)
        self.missing.append(text)
        return ABSENT

    def joint(self, part: PlacedPart) -> Joint:
        """Return a hinge. Raises BadInput for a profile that is impossible."""
        first, second = self.ends(part)
        if part.bodies[0] == part.bodies[1]:
            raise BadInput(f"{part.key}.between = {shown(list(part.bodies))}, expected two bodies")
        table: PlateHinge = part.table
        profile = _profile(part)
        widths = [self.bodies[k].width or 0.0 for k in (first, second) if k != ABSENT]
        return Joint(
            part.name,
            (first, second),
            part.move(complex(*table.at)),
            part.move.heading(table.direction),
            profile,
            _cut(part, profile, widths),
            part.key,
            _material(part, self.mechanism),
        )

    def ends(self, part: PlacedPart) -> list[int]:
        """Return the numbers of the two bodies of a hinge or an actuator."""
        return [
            self.number_of(name, f"{part.key}.between[{side}]")
            for side, name in enumerate(part.bodies)
        ]

    def points(self) -> list[tuple[str, Patch]]:
        """Return the named points, the output first.

        Raises BadInput for an output that is fixed.
        """
        output = self.mechanism.output
        first = PlacedPart("output", "point", output, (output.body,), "output", "output")
        points = list[tuple[str, Patch]]()
        for part in (first, *self.parts["point"]):
            body = self.number_of(part.bodies[0], f"{part.key}.body")
            if body == ABSENT:
                continue
            point = Patch(body, part.move(complex(*part.table.at)), part.table.contact)
            if part.table.contact:
                point = _contact(point, self.bodies, f"{part.key}.at_mm")
            points.append((part.name, point))
        if points and self.bodies[points[0][1].body].fixed:
            raise BadInput(f"output.body = {shown(output.body)}, expected a body that can move")
        return points

    def actuator(self, part: PlacedPart) -> LinearActuator | None:
        """Return an actuator, None without its bodies. Raises BadInput for contacts off them."""
        ends = self.ends(part)
        if ABSENT in ends:
            return None
        near, far = (part.move(complex(*point)) for point in part.table.at)
        radius = part.table.contact
        contacts = (
            _contact(Patch(ends[0], near, radius), self.bodies, f"{part.key}.at_mm[0]"),
            _contact(Patch(ends[1], far, radius), self.bodies, f"{part.key}.at_mm[1]"),
        )
        return LinearActuator(
            part.name,
            contacts,
            (far - near) / abs(far - near),
            mass=part.table.mass,
            key=part.key,
            preload=float(part.table.preload or 0.0),
            **part.table.rating._asdict(),
        )

    def payloads(self, points: Sequence[tuple[str, Patch]]) -> list[PayloadMass]:
        """Return the payload at the output, if there is one."""
        load = self.mechanism.payload
        if load is None:
            return []
        outputs = [point for name, point in points if name == "output"]
        return [PayloadMass(output, load.mass, load.inertia) for output in outputs]


def _material(part: PlacedPart, mechanism: MechanismTables) -> Constants | None:
    """Return the constants of a part with a material of its own."""
    material = part.table.material
    if material is None or material == mechanism.material:
        return None
    if material.residual_stress or mechanism.material.residual_stress:
        why = "a residual stress is one of all parts"
        raise BadInput(f"{part.key}.material, expected that of the plate: {why}")
    return mechanism.constants_of(material)._replace(name=material.name)


def _body(part: PlacedPart, mechanism: MechanismTables) -> Body:
    """Return a body. Raises BadInput for an outline that is impossible."""
    table: PlateBody = part.table
    outline = _outline(table, part.move, part.key)
    holes = list[Outline]()
    for k, hole in enumerate(table.holes):
        for turn in (Move(), *rotations(hole)):
            holes.append(_outline(hole, part.move.after(turn), f"{part.key}.holes[{k}]"))
    return Body(
        part.name,
        tuple(outline.loop),
        tuple(tuple(reverse(hole.loop)) for hole in holes),
        table.fixed,
        _clamped(table, outline, part.key),
        None if table.width is None else float(table.width),
        part.key,
        _material(part, mechanism),
    )


def _clamped(
    table: PlateBody,
    outline: Outline,
    key: str,
) -> tuple[int, ...]:
    """Return the clamped segments of an outline. Raises BadInput for an edge that has none."""
    clamped = list[int]()
    for k, edge in enumerate(table.clamped_edges):
        segments = outline.edges[edge - 1]
        if not segments:
            expected = "expected an edge that its fillets leave straight"
            raise BadInput(f"{key}.clamped_edges[{k}] = {edge}, {expected}")
        clamped += segments
    return tuple(sorted(clamped))


def _outline(
    table: PlateBody | BodyHole,
    move: Move,
    key: str,
) -> Outline:
    """Return the outline of a body or a hole. Raises BadInput for one that is impossible."""
    if table.centre is not None and table.radius is not None:
        return disc(move(complex(*table.centre)), table.radius)
    path = table.path if isinstance(table, PlateBody) else None
    corners: Sequence[tuple[float, ...]] = path or table.outline or ()
    points = [move(complex(*corner[:2])) for corner in corners]
    radii = [corner[2] if len(corner) > 2 else 0.0 for corner in corners]
    side = -1.0 if move.mirrored else 1.0
    bows = [side * corner[3] if len(corner) > 3 else 0.0 for corner in corners]
    try:
        if isinstance(table, PlateBody) and table.width is not None:
            return bar(points, radii, table.width)
        return rounded(points, radii, bows)
    except ValueError as error:
        k, expected = error.args
        name = "outline_mm" if path is None else "path_mm"
        value = shown(list(corners[k]))
        raise BadInput(f"{key}.{name}[{k}] = {value}, expected {expected}") from None


def _profile(part: PlacedPart) -> Profile:
    """Return the profile of a hinge. Raises BadInput for dimensions that are impossible."""
    table: PlateHinge = part.table
    try:
        profile = profile_of(table.shape, table.dimensions)
    except BadDimension as error:
        value: Any = getattr(table, error.key)
        if error.key == "angle" and value is not None:
            value = math.degrees(value)
        key = f"{part.key}.{PlateHinge.model_fields[error.key].alias or error.key}"
        stated = "" if value is None else f" = {shown(value)}"
        raise BadInput(f"{key}{stated}, expected {error.expected}") from None
    return profile.mirrored if part.move.mirrored else profile


def _cut(
    part: PlacedPart,
    profile: Profile,
    widths: Sequence[float],
) -> float:
    """Return the height over which bodies of some widths are cut away along a profile, mm.

    Raises BadInput for a stated height that the profile does not fit into.
    """
    stated = part.table.cut
    if stated is None:
        ends = np.array([-0.5, 0.5]) * profile.length
        off_axis = float(2 * np.abs(profile.middle(ends)).max())
        return CUT * max([profile.least_cut, *(off_axis + width for width in widths)])
    if stated < profile.least_cut:
        what = "the height of the profile at its ends"
        if not profile.symmetric:
            what = "twice the largest distance of its ends from the axis"
        least = f"{profile.least_cut:g}, {what}"
        raise BadInput(f"{part.key}.cut_mm = {stated:g}, expected at least {least}")
    return float(stated)


def _contact(
    patch: Patch,
    bodies: Sequence[Body],
    key: str,
) -> Patch:
    """Return a contact with its radius.

    Raises BadInput for one that is not on its body, unless this is fixed.
    """
    if patch.body < 0:
        return patch
    body = bodies[patch.body]
    if body.fixed and patch.radius is None:
        return patch
    outline, *holes = map(polygon_points, (body.outline, *body.holes))
    face = shapely.Polygon(outline, holes)
    left, low, right, high = face.bounds
    radius = CONTACT * math.hypot(right - left, high - low)
    if patch.radius is not None:
        radius = float(patch.radius)
    at = patch.point
    if face.distance(shapely.Point(at.real, at.imag)) < radius:
        return patch._replace(radius=radius)
    if body.fixed:
        return patch._replace(body=OUTSIDE, radius=radius)
    place = f"[{at.real:g}, {at.imag:g}]"
    raise BadInput(f"{key} = {place}, expected a point of {shown(body.name)}")
