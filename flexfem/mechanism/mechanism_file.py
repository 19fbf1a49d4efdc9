"""The mechanism: the content of a mechanism file, changed mechanisms, and the layout that both
models read.
"""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
import shapely
from pydantic import BaseModel, Field, ModelWrapValidatorHandler, model_validator

from flexfem.files.expressions import Evaluated, names_in, parameter_values
from flexfem.files.quantities import KNOWN, STATED, Length, Unlimited
from flexfem.files.refusals import key_path, nearest, shown, suggestion
from flexfem.files.tables import UNCHANGEABLE, Label, Unchangeable, once
from flexfem.files.toml import PathLike
from flexfem.mechanism.content import located, read_content
from flexfem.mechanism.keys import PARAMETERS, Key
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
from flexfem.mechanism.materials import Frame, Material
from flexfem.mechanism.mechanism import Mechanism as Mechanism
from flexfem.mechanism.outlines import Outline, bar, disc, polygon_points, reverse, rounded
from flexfem.mechanism.parts import (
    BodyHole,
    Copies,
    NamedPoint,
    OutputPayload,
    OutputPoint,
    PlateActuator,
    PlateBody,
    PlateHinge,
)
from flexfem.mechanism.profiles import BadDimension, profile_of
from flexfem.mechanism.scans import with_scanned_tables
from flexfem.refused import BadInput
from flexfem.units import without_unit

Reduction: TypeAlias = Literal["three_dimensional", "plane_stress", "plane_strain"]
PARTS = ("body", "hinge", "actuator", "point")  # arrays of named parts
GROUND = "ground"  # carries actuators, also where no body has this name
CUT = 1.02  # default height of a cut relative to the bodies or the profile
CONTACT = 1 / 20  # default radius of a contact relative to the extent of its body
ABSENT = -2  # number of a body that an unfinished file does not have; -1 is the ground outside
MOST = 2000  # parts, copies included


class MechanismFile(Mechanism):
    """A planar flexure mechanism that is cut from one plate; lengths in mm, `provenance` by key
    path of the file.

    Parts are given as dicts by the keys of the file, without their units: `body=[{"name": "ground",
    "path": [(0, 0), (9, 0)], "width": 5.0, "fixed": True}]`; numbers are in mm, N, rad and tonne,
    expressions in the unit of the file."""

    kind: ClassVar[str] = "mechanism file"

    name: Label = Field(examples=["parallelogram"])
    """Name of the mechanism in tables and figures"""
    model: Reduction = "three_dimensional"
    """Model of finite elements: `three_dimensional`, or plane ones: `plane_stress`, for a plate
    that is thin compared with its necks, or `plane_strain`, for a plate whose faces are held """
    thickness: Length = Field(alias="thickness_mm", examples=[10.0])
    """Thickness of the plate"""
    material: Material
    """Material of the plate, isotropic; bodies and hinges may have one of their own"""
    parameters: Annotated[Mapping[str, Unlimited], UNCHANGEABLE] = Field(
        default_factory=Unchangeable, examples=[{"length_mm": 50.0, "gap_mm": "length / 2"}]
    )
    """Numbers by name, which other numbers of the file may use. A name ends in its unit, such as
    _mm or _deg, or has none; expressions use it without the unit. Every number of the file may be
    an expression in quotes, in the unit of its key: numbers, names, `+ - * / **`, brackets, abs,
    sqrt, exp, log, log10, min, max, and sin, cos, tan, atan in degrees """
    body: tuple[PlateBody, ...] = Field(min_length=1)
    """A body; bodies may be drawn as far as the centres of hinges, which cut them"""
    hinge: tuple[PlateHinge, ...] = ()
    """A hinge between two bodies"""
    copies: tuple[Copies, ...] = Field(default=(), alias="copy")
    """Copies of parts, rotated or mirrored; several of them apply in their order"""
    actuator: tuple[PlateActuator, ...] = ()
    """A linear actuator between two bodies, or between the ground and a body"""
    output: OutputPoint
    """Point at which the mechanism is loaded and its pose is read"""
    frame: Frame = Field(default_factory=Frame)
    """Frame to which the plate is fixed. Only thermal drift uses it"""
    payload: OutputPayload | None = None
    """Rigid payload at the output"""
    point: tuple[NamedPoint, ...] = ()
    """Another point whose motion is read"""

    @model_validator(mode="wrap")
    @classmethod
    def _with_parameters(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        stated = data.get("parameters", {}) if isinstance(data, dict) else {}
        token = KNOWN.set(parameter_values(stated) if isinstance(stated, Mapping) else {})
        try:
            return handler(data)
        finally:
            KNOWN.reset(token)

    def replace(self, **changes: Any) -> Self:
        """Return a changed mechanism, validated; expressions are computed again from the
        parameters.

        Parameters
        ----------
        **changes : by attribute name, in mm, N, MPa and rad: `thickness=12.0`,
        `material="ti-6al-4v"`,
            `parameters={"length_mm": 60.0}` in the unit of the name, `hinge={"left": {"neck":
            0.4}}` for named parts. A sequence replaces all parts.

        Raises
        ------
        BadInput
            A name is not known, a value is not possible, or the mechanism cannot be made. A new
            parameter must be used by an expression.
        """
        changed = self._replaced(changes)
        for key in changed.parameters:
            if key not in self.parameters and key in changed.unused_parameters:
                near = nearest(key, self.parameters) or "; there are none"
                raise BadInput(
                    f"{key_path(('parameters', key))} is an unknown parameter{near}",
                    str(changed.origin),
                )
        changed.check()
        return changed

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content, expressions evaluated; its name, parameters and
        provenance are excluded.
        """
        return self._digest({"parameters"}, exclude_none=True)

    @property
    def stated_hash(self) -> str:
        """SHA-256 of the physical content with parameters and texts of expressions, on which its
        designs depend.
        """
        return self._digest(set(), exclude_none=True, context=STATED)

    @property
    def numbers_by_parameter(self) -> Mapping[str, float]:
        """Values of the parameters by key, in the units of their names."""
        return self.parameters

    def expected_of(self, key: Key) -> str | None:
        """Return what a study is expected to set instead of a key; None for a key of this file."""
        if key.places_in(self):
            return None
        known = ", ".join(key_path((*PARAMETERS, name)) for name in self.parameters)
        return f"a parameter of the mechanism ({known or 'it has none'})"

    @property
    def unused_parameters(self) -> tuple[str, ...]:
        """Keys of the parameters on which no number of the mechanism depends."""
        keys = {without_unit(key): key for key in self.parameters}
        texts = [text for name, value in self if name != "parameters" for text in _texts(value)]
        used = set[str]()
        while texts:
            found = {keys[name] for name in names_in(texts.pop())} - used
            used |= found
            texts += [text for key in found for text in _texts(self.parameters[key])]
        return tuple(key for key in self.parameters if key not in used)

    @property
    @once
    def layout(self) -> Layout:
        """The mechanism with parameters, copies and outlines resolved, as both models read it.

        Raises BadInput, naming file, line and key, for parts that do not fit together.
        """
        with located(self):
            return layout_of(self)


Mechanism.usual = MechanismFile


def _texts(value: Any) -> Iterator[str]:
    """Yield the texts of all expressions in a value of a table."""
    if isinstance(value, Evaluated):
        yield value.text
    elif isinstance(value, BaseModel):
        yield from (text for _, inner in value for text in _texts(inner))
    elif isinstance(value, tuple):
        yield from (text for inner in value for text in _texts(inner))


def read_mechanism(path: PathLike) -> MechanismFile:
    """Read a mechanism file whose bodies and hinges need not fit together. Raises BadInput as
    `load_mechanism`.
    """
    mechanism = read_content(MechanismFile, path, partial(with_scanned_tables, path))
    _ = mechanism.layout
    return mechanism


def load_mechanism(path: PathLike) -> MechanismFile:
    """Read a mechanism file. Raises BadInput, naming file, line, key, value and expectation, for
    invalid content.
    """
    mechanism = read_mechanism(path)
    mechanism.check()
    return mechanism


class PlacedPart(NamedTuple):
    """A part or a copy of one: its table, the names of its bodies, its place, and the name of the
    part it copies.
    """

    name: str
    kind: str
    table: Any
    bodies: tuple[str, ...]
    key: str
    original: str
    move: Move = Move()


def layout_of(mechanism: MechanismFile, missing: list[str] | None = None) -> Layout:
    """Return the layout of a mechanism. Raises BadInput for parts that do not fit together.

    missing : for drawings of an unfinished file, a list to which the bodies are added that parts
    name and that are not
        there, instead of a refusal. A hinge is then without this body, and other parts on it are
        left out.
    """
    placed = _parts(mechanism)
    parts = {kind: [part for part in placed if part.kind == kind] for kind in PARTS}
    index = {part.name: k for k, part in enumerate(parts["body"])}
    bodies = tuple(_body(part, mechanism) for part in parts["body"])

    def body_of(name: str, key: str) -> int:
        if name in index:
            return index[name]
        text = f"{key} = {shown(name)}, expected the name of a body{nearest(name, index)}"
        if missing is None:
            raise BadInput(text)
        missing.append(text)
        return ABSENT

    joints = list[Joint]()
    for part in parts["hinge"]:
        first, second = (
            body_of(name, f"{part.key}.between[{side}]") for side, name in enumerate(part.bodies)
        )
        joints.append(
            _joint(part, (first, second), bodies)._replace(material=_material(part, mechanism))
        )
    output = mechanism.output
    points = list[tuple[str, Patch]]()
    for part in (
        PlacedPart("output", "point", output, (output.body,), "output", "output"),
        *parts["point"],
    ):
        place = part.move(complex(*part.table.at))
        body = body_of(part.bodies[0], f"{part.key}.body")
        if body == ABSENT:
            continue
        found = Patch(body, place, part.table.contact)
        points.append(
            (
                part.name,
                _contact(found, bodies, f"{part.key}.at_mm") if part.table.contact else found,
            )
        )
    if points and bodies[points[0][1].body].fixed:
        raise BadInput(f"output.body = {shown(output.body)}, expected a body that can move")
    index.setdefault(GROUND, next((k for k, body in enumerate(bodies) if body.fixed), -1))
    actuators = list[LinearActuator]()
    for part in parts["actuator"]:
        places = [part.move(complex(*point)) for point in part.table.at]
        ends = [
            body_of(name, f"{part.key}.between[{side}]") for side, name in enumerate(part.bodies)
        ]
        if ABSENT in ends:
            continue
        patches = map(Patch, ends, places, [part.table.contact] * 2)
        near, far = (
            _contact(patch, bodies, f"{part.key}.at_mm[{side}]")
            for side, patch in enumerate(patches)
        )
        direction = (places[1] - places[0]) / abs(places[1] - places[0])
        rating = part.table.rating._asdict()
        actuators.append(
            LinearActuator(
                part.name,
                (near, far),
                direction,
                mass=part.table.mass,
                key=part.key,
                preload=float(part.table.preload or 0.0),
                **rating,
            )
        )
    load = mechanism.payload
    return Layout(
        bodies=bodies,
        joints=tuple(joints),
        points=tuple(points),
        actuators=tuple(actuators),
        payloads=tuple(
            PayloadMass(at, load.mass, load.inertia)
            for name, at in points
            if load and name == "output"
        ),
        wide=mechanism.model == "three_dimensional",
        **mechanism.plane_problem,
    )


def _parts(mechanism: MechanismFile) -> list[PlacedPart]:
    """Return all parts and their copies."""
    found = list[PlacedPart]()
    for kind in PARTS:
        for index, table in enumerate(getattr(mechanism, kind)):
            bodies = () if kind == "body" else (table.body,) if kind == "point" else table.between
            found.append(
                PlacedPart(
                    table.name, kind, table, bodies, key_path((kind, index), mechanism), table.name
                )
            )
    counts = Counter((part.kind, part.original) for part in found)
    for index, copies in enumerate(mechanism.copies):
        names = {part.name for part in found}
        for place, name in enumerate(copies.parts):
            if name not in names or name in copies.parts[:place]:
                expected = (
                    f"the name of a part{suggestion(name, names)}"
                    if name not in names
                    else "each part once"
                )
                raise BadInput(f"copy[{index}].parts[{place}] = {shown(name)}, expected {expected}")
        originals = [part for part in found if part.name in copies.parts]
        taken = {(part.kind, part.name) for part in found}
        if len(found) + len(originals) * (int(copies.count or 2) - 1) > MOST:
            raise BadInput(
                f"copy[{index}].parts, expected at most {MOST} parts in all, copies included"
            )
        for move in _moves(copies):
            new = dict[tuple[str, str], str]()
            for part in originals:
                counts[part.kind, part.original] += 1
                name = f"{part.original} {counts[part.kind, part.original]}"
                if (part.kind, name) in taken:
                    raise BadInput(
                        f"copy[{index}].parts, expected no other {part.kind} {shown(name)}, a "
                        "copy's name"
                    )
                new[part.kind, part.name] = name
            for part in originals:
                bodies = tuple(new.get(("body", name), name) for name in part.bodies)
                moved = part._replace(
                    name=new[part.kind, part.name], bodies=bodies, move=move.after(part.move)
                )
                found.append(moved)
    return found


def _moves(copies: Copies) -> Iterator[Move]:
    if copies.mirror is not None:
        first, second = (complex(*point) for point in copies.mirror)
        turn = (second - first) / (second - first).conjugate()
        yield Move(turn, first - turn * first.conjugate(), mirrored=True)
        return
    count = int(copies.count or 1)
    about = complex(*(copies.about or (0.0, 0.0)))
    for k in range(1, count):
        turn = cmath.exp(1j * k * (2 * np.pi / count if copies.angle is None else copies.angle))
        yield Move(turn, about - turn * about)


def _material(part: PlacedPart, mechanism: MechanismFile) -> Constants | None:
    """Return the constants of a part with a material of its own."""
    material = part.table.material
    if material is None or material == mechanism.material:
        return None
    if material.residual_stress or mechanism.material.residual_stress:
        raise BadInput(
            f"{part.key}.material, expected that of the plate: a residual stress is one of all "
            "parts"
        )
    return mechanism.constants_of(material)._replace(name=material.name)


def _body(part: PlacedPart, mechanism: MechanismFile) -> Body:
    table: PlateBody = part.table
    outline = _outline(table, part.move, part.key)
    holes = [
        _outline(hole, part.move, f"{part.key}.holes[{k}]").loop
        for k, hole in enumerate(table.holes)
    ]
    clamped = list[int]()
    for k, edge in enumerate(table.clamped_edges):
        segments = outline.edges[edge - 1]
        if not segments:
            raise BadInput(
                f"{part.key}.clamped_edges[{k}] = {edge}, expected an edge that its fillets leave "
                "straight"
            )
        clamped += segments
    loops = tuple(tuple(reverse(hole)) for hole in holes)
    width = None if table.width is None else float(table.width)
    edges = tuple(sorted(clamped))
    material = _material(part, mechanism)
    return Body(
        part.name, tuple(outline.loop), loops, table.fixed, edges, width, part.key, material
    )


def _outline(table: PlateBody | BodyHole, move: Move, key: str) -> Outline:
    if table.centre is not None and table.radius is not None:
        return disc(move(complex(*table.centre)), table.radius)
    path = table.path if isinstance(table, PlateBody) else None
    corners = path or table.outline or ()
    points = [move(complex(*corner[:2])) for corner in corners]
    radii = [(*corner, 0.0)[2] for corner in corners]
    side = -1.0 if move.mirrored else 1.0
    bows = [side * (*corner, 0.0, 0.0)[3] for corner in corners]
    try:
        if isinstance(table, PlateBody) and table.width is not None:
            return bar(points, radii, table.width)
        return rounded(points, radii, bows)
    except ValueError as error:
        k, expected = error.args
        name = "outline_mm" if path is None else "path_mm"
        raise BadInput(
            f"{key}.{name}[{k}] = {shown(list(corners[k]))}, expected {expected}"
        ) from None


def _joint(part: PlacedPart, ends: tuple[int, int], bodies: Sequence[Body]) -> Joint:
    table: PlateHinge = part.table
    if part.bodies[0] == part.bodies[1]:
        raise BadInput(f"{part.key}.between = {shown(list(part.bodies))}, expected two bodies")
    try:
        profile = profile_of(table.shape, table.dimensions)
        if part.move.mirrored:
            profile = profile.mirrored
    except BadDimension as error:
        key = f"{part.key}.{PlateHinge.model_fields[error.key].alias or error.key}"
        value = getattr(table, error.key)
        value = math.degrees(value) if error.key == "angle" and value is not None else value
        raise BadInput(
            f"{key}{'' if value is None else f' = {shown(value)}'}, expected {error.expected}"
        ) from None
    off_axis = float(2 * np.abs(profile.middle(np.array([-0.5, 0.5]) * profile.length)).max())
    widest = max(
        profile.least_cut, *(off_axis + (bodies[k].width or 0.0) for k in ends if k != ABSENT)
    )
    cut = CUT * widest if table.cut is None else float(table.cut)
    if cut < profile.least_cut:
        least = f"{profile.least_cut:g}, the height of the profile at its ends"
        if not profile.symmetric:
            least = f"{profile.least_cut:g}, twice the largest distance of its ends from the axis"
        raise BadInput(f"{part.key}.cut_mm = {cut:g}, expected at least {least}")
    place = part.move(complex(*table.at))
    heading = part.move.heading(table.direction)
    return Joint(part.name, ends, place, heading, profile, cut, part.key)


def _contact(patch: Patch, bodies: Sequence[Body], key: str) -> Patch:
    """Return a contact with its radius. Refuses one that is not on its body, unless this is fixed."""
    if patch.body < 0 or (bodies[patch.body].fixed and patch.radius is None):
        return patch
    outline, *holes = map(polygon_points, (bodies[patch.body].outline, *bodies[patch.body].holes))
    face = shapely.Polygon(outline, holes)
    left, low, right, high = face.bounds
    radius = (
        CONTACT * math.hypot(right - left, high - low)
        if patch.radius is None
        else float(patch.radius)
    )
    if face.distance(shapely.Point(patch.point.real, patch.point.imag)) >= radius:
        if bodies[patch.body].fixed:
            return patch._replace(body=-1, radius=radius)
        at = f"[{patch.point.real:g}, {patch.point.imag:g}]"
        raise BadInput(f"{key} = {at}, expected a point of {shown(bodies[patch.body].name)}")
    return patch._replace(radius=radius)
