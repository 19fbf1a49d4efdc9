"""Validated tables of a mechanism file in N-mm-MPa-rad; every number may be an expression of parameters.

An expression is in the unit of its key, and names parameters without their units. Its value keeps its text, so that a
mechanism can be written, and changed by its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextvars import ContextVar
from functools import reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ModelWrapValidatorHandler,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapSerializer,
    WrapValidator,
    create_model,
    model_validator,
)

from flexfem.files import quantities
from flexfem.files.expressions import Evaluated, names_in, value_of
from flexfem.files.quantities import COUNT, OF_THE_KEY, Keywords, keywords
from flexfem.files.refusals import problem_of, refusal, shown, suggestion
from flexfem.files.toml import Label
from flexfem.mechanism import actuators
from flexfem.mechanism.actuators import StackName, StackRating, check_rating, rating_of
from flexfem.mechanism.dimensioned import Dimensioned, in_unit
from flexfem.mechanism.materials import Material
from flexfem.mechanism.plate_file import PlateFile
from flexfem.mechanism.stage_file import Frame
from flexfem.units import without_unit

MOST_PARAMETERS = 300  # which may each depend on the one before
PARTS = ("body", "hinge", "actuator", "point")  # arrays of named parts
STATED = "stated"  # context of a dump: expressions by their texts
_known: ContextVar[Mapping[str, float]] = ContextVar("values of the parameters by their names without units")


def parameter_values(stated: Mapping[str, Any]) -> dict[str, float]:
    """Return the values of parameters, in file units, by their names without units; each may use all others.

    Refuses, at its key path, what is no number, an unknown name, a cycle, or a value that is not finite.
    """
    keys = dict[str, str]()
    if len(stated) > MOST_PARAMETERS:
        raise refusal(f"at most {MOST_PARAMETERS} parameters, not {len(stated)}", "parameters")
    for key in stated:
        name = without_unit(key)
        if not (key.isidentifier() and key.isascii()) or name in keys:
            other = f"a name that differs from {keys[name]} also without its unit" if name in keys else ""
            raise refusal(other or "a name of letters, digits and _, a letter first", "parameters", key)
        keys[name] = key
    values, pending = dict[str, float](), list[str]()

    def resolve(name: str) -> None:
        key = keys[name]
        value = stated[key]
        if name in pending:
            cycle = " = ".join(["", *pending[pending.index(name) :], name])[3:]
            raise refusal(f"a value that does not depend on itself: {cycle}", "parameters", key)
        if isinstance(value, Evaluated):
            value = value.text
        if isinstance(value, str):
            pending.append(name)
            for used in _names(value, keys, "parameters", key):
                if used not in values:
                    resolve(used)
            pending.pop()
            value = float(value_of(value, values))
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
            raise refusal("a finite number, or an expression that has one", "parameters", key)
        values[name] = float(value)

    for name in keys:
        if name not in values:
            resolve(name)
    return values


def _names(text: str, known: Mapping[str, Any], *at: str) -> tuple[str, ...]:
    """Return the names in an expression. Refuses other text, and names that are not known."""
    try:
        names = names_in(text)
    except ValueError as error:
        raise refusal(f"an expression: {error}", *at) from None
    for name in names:
        if name not in known:
            close = suggestion(name, known) or (f", one of {', '.join(known)}" if known else "; there are none")
            raise refusal(f"names of parameters, not {shown(name)}{close}", *at)
    return names


def _evaluated(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """Validate a number, or the value of an expression, which keeps its text."""
    text = value.text if isinstance(value, Evaluated) else value
    if not isinstance(text, str):
        return handler(value)
    known = _known.get({})
    _names(text, known)
    number = float(value_of(text, known))
    try:
        return Evaluated(handler(Evaluated(number, text)), text)
    except ValidationError as error:
        expected = problem_of(error.errors(include_url=False)[0], {}).expected
        raise refusal(f"{expected}; its value is {number:g}") from None


def _dumped(value: Any, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> Any:
    stated = info.by_alias or info.context == STATED
    return value.text if isinstance(value, Evaluated) and stated else handler(value)


class _OrText(Keywords):
    """Annotation of a number that may be an expression: its schema also accepts text."""

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], Any]) -> dict[str, Any]:
        return {**handler(core), "type": ["number", "string"]}


EXPRESSION = (WrapValidator(_evaluated), WrapSerializer(_dumped), _OrText(dict))  # at the end of the annotations
Model = TypeVar("Model", bound=BaseModel)


def _expressed(annotation: Any) -> Any:
    """Return a type in which every number may be an expression."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return Annotated[parts[0], *parts[1:], *EXPRESSION] if parts[0] is float else annotation
    changed = tuple(map(_expressed, parts))
    return reduce(or_, changed) if origin is UnionType else origin[changed] if origin else annotation


def with_expressions(model: type[Model]) -> type[Model]:
    """Return a model of the same fields, whose numbers may be expressions."""
    hints, fields = get_type_hints(model, include_extras=True), dict[str, Any]()
    for name, field in model.model_fields.items():
        kept = {key: getattr(field, key) for key in ("default", "alias", "description", "examples")}
        fields[name] = (_expressed(hints[name]), Field(**kept, json_schema_extra=field.json_schema_extra))
    return create_model(model.__name__, __base__=model, __doc__=model.__doc__, __module__=model.__module__, **fields)


@with_expressions
class PlateMaterial(Material):
    """Material of the plate, isotropic."""


@with_expressions
class PlateFrame(Frame):
    """Frame to which the plate is fixed."""


MOST = 5000  # corners of one outline


def _corner(corner: tuple[float, ...]) -> tuple[float, ...]:
    if corner[2:] and corner[2] < 0:
        raise refusal("a radius of at least 0 as the third number")
    return corner


def _one_form(table: Dimensioned, *forms: tuple[str, ...]) -> None:
    """Refuse a table that has not all keys of one form, and none of the others."""
    fields = type(table).model_fields
    keys = [[fields[name].alias or name for name in form] for form in forms]
    stated = [[key for key, name in zip(of, form, strict=True) if getattr(table, name) is not None]
              for of, form in zip(keys, forms, strict=True)]  # fmt: skip
    if sum(map(bool, stated)) != 1 or not any(of == found for of, found in zip(keys, stated, strict=True)):
        raise refusal(f"one of {', or '.join(' with '.join(of) for of in keys)}")


def _whole(value: float) -> float:
    if value != int(value):
        raise refusal("a whole number")
    return value


Parameter: TypeAlias = Annotated[float, keywords(**OF_THE_KEY), *EXPRESSION]
Size: TypeAlias = Annotated[float, *quantities.above_zero(quantities.LENGTH), *EXPRESSION]
FilletRadius: TypeAlias = Annotated[float, *quantities.from_zero(quantities.LENGTH), *EXPRESSION]
Place: TypeAlias = Annotated[float, Field(ge=-1e4, le=1e4), *EXPRESSION]
Turn: TypeAlias = Annotated[float, Field(ge=-3600, le=3600), *in_unit("deg"), *EXPRESSION]
Count: TypeAlias = Annotated[
    float, Field(ge=2, le=1000), AfterValidator(_whole), keywords(multipleOf=1, **COUNT), *EXPRESSION
]
Mass: TypeAlias = Annotated[float, *quantities.from_zero(quantities.GRAMS), *in_unit("g"), *EXPRESSION]
Inertia: TypeAlias = Annotated[float, *quantities.from_zero(quantities.INERTIA), *in_unit("kg_mm2"), *EXPRESSION]
Point: TypeAlias = tuple[Place, Place]
Corner: TypeAlias = Annotated[tuple[Place, ...], Field(min_length=2, max_length=3), AfterValidator(_corner)]
Corners: TypeAlias = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=MOST)]
Bends: TypeAlias = Annotated[tuple[Corner, ...], Field(min_length=2, max_length=MOST)]
Shape: TypeAlias = Literal["circular", "elliptical", "filleted", "leaf", "parabolic", "v", "profile"]


class BodyHole(Dimensioned):
    """A hole in a body, inside its outline: a polygon with fillets, or a disc."""

    outline: Corners | None = Field(default=None, alias="outline_mm", examples=[[[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]])
    """Corners x, y of a polygon; an optional third number is the radius of a fillet at the corner"""
    centre: Point | None = Field(default=None, alias="centre_mm", examples=[[0.0, 0.0]])
    """Instead of `outline_mm`, with `radius_mm`: centre of a disc"""
    radius: Size | None = Field(default=None, alias="radius_mm", examples=[2.0])
    """Radius of a disc"""

    @model_validator(mode="after")
    def _has_one_form(self) -> BodyHole:
        _one_form(self, ("outline",), ("centre", "radius"))
        return self


class PlateBody(Dimensioned):
    """A body of the mechanism: a polygon with fillets, a bar along a path, or a disc."""

    name: Label = Field(examples=["stage"])
    """Unique name of the body"""
    outline: Corners | None = Field(
        default=None, alias="outline_mm", examples=[[[0.0, 0.0], [9.0, 0.0], [9.0, 8.0, 2.0]]]
    )
    """Corners x, y of a polygon, in either sense; an optional third number is the radius of a fillet at the corner"""
    path: Bends | None = Field(default=None, alias="path_mm", examples=[[[0.0, 0.0], [30.0, 0.0, 10.0], [30.0, 20.0]]])
    """Instead of `outline_mm`, with `width_mm`: points x, y of the centreline of a bar with square ends; an optional
    third number is the radius of the centreline at a bend, which is sharp without it"""
    width: Size | None = Field(default=None, alias="width_mm", examples=[8.0])
    """Width of a bar"""
    centre: Point | None = Field(default=None, alias="centre_mm", examples=[[0.0, 0.0]])
    """Instead of `outline_mm`, with `radius_mm`: centre of a disc"""
    radius: Size | None = Field(default=None, alias="radius_mm", examples=[15.0])
    """Radius of a disc"""
    holes: tuple[BodyHole, ...] = ()
    """Holes in the body"""
    fixed: bool = False
    """Whether the body is rigid ground"""
    clamped_edges: tuple[Annotated[int, Field(ge=1)], ...] = Field(default=(), examples=[[1]], json_schema_extra=COUNT)
    """Edges at which an elastic body is clamped. Edge 1 goes from the first corner to the second, and so on; edge 1 of
    a bar is its start, edge 2 its end"""

    @model_validator(mode="after")
    def _has_one_form(self) -> PlateBody:
        _one_form(self, ("outline",), ("path", "width"), ("centre", "radius"))
        for index, corner in enumerate(self.path or ()):
            if any(corner[2:]) and index in (0, len(self.path or ()) - 1):
                raise refusal("two numbers at an end of the path: it has no bend there", "path_mm", index)
        edges = len(self.outline or ()) or 2 * (self.path is not None)
        for index, edge in enumerate(self.clamped_edges):
            if edge > edges or edge in self.clamped_edges[:index]:
                raise refusal(
                    f"each edge once, of {edges} edges" if edges else "no edge of a disc", "clamped_edges", index
                )
        if self.fixed and self.clamped_edges:
            raise refusal("either a fixed body or clamped edges of an elastic one", "clamped_edges")
        return self


class PlateHinge(Dimensioned):
    """A hinge: its length and shape replace the material of its two bodies."""

    name: Label = Field(examples=["left"])
    """Unique name of the hinge"""
    between: tuple[Label, Label] = Field(examples=[["ground", "stage"]])
    """Names of the two bodies"""
    at: Point = Field(alias="at_mm", examples=[[0.0, 25.0]])
    """Centre of the hinge, x, y"""
    direction: Turn = Field(alias="direction_deg", examples=[90.0])
    """Direction of the axis from the first body to the second, counter-clockwise from the x axis"""
    shape: Shape = Field(examples=["leaf"])
    """Shape of the profile, which determines the keys that it needs"""
    neck: Size | None = Field(default=None, alias="neck_mm", examples=[0.5])
    """Smallest height of the profile, except of a `profile`"""
    length: Size | None = Field(default=None, alias="length_mm", examples=[50.0])
    """Length along its axis, fillets included, of an elliptical, filleted or parabolic hinge or a leaf"""
    radius: Size | None = Field(default=None, alias="radius_mm", examples=[2.0])
    """Radius of the notches of a circular hinge"""
    depth: Size | None = Field(default=None, alias="depth_mm", examples=[2.0])
    """Depth of each of the two notches of an elliptical, parabolic or v-shaped hinge"""
    fillet: FilletRadius | None = Field(default=None, alias="fillet_mm", examples=[0.5])
    """Radius of the fillets of a filleted hinge or a leaf"""
    angle: Turn | None = Field(default=None, alias="angle_deg", examples=[60.0])
    """Opening angle of the notches of a v-shaped hinge"""
    root_radius: Size | None = Field(default=None, alias="root_radius_mm", examples=[0.5])
    """Radius of the root of the notches of a v-shaped hinge"""
    table: Annotated[tuple[Point, ...], Field(max_length=MOST)] | None = Field(
        default=None, alias="table_mm", examples=[[[0.0, 4.0], [2.0, 0.5], [4.0, 4.0]]]
    )
    """Rows of ascending position along the axis and height of a `profile`, at least three; its middle is the centre"""
    cut: Size | None = Field(default=None, alias="cut_mm", examples=[12.0])
    """Height over which both bodies are cut away along the profile; by default 2 % more than the larger of the height
    of the ends of the profile and the widths of those bodies that are bars"""

    @property
    def dimensions(self) -> dict[str, Any]:
        """Stated dimensions of the profile, mm, by their names."""
        return {name: getattr(self, name) for name in OF_PROFILES if getattr(self, name) is not None}


OF_PROFILES = ("neck", "length", "radius", "depth", "fillet", "angle", "root_radius", "table")


class Copies(Dimensioned):
    """Copies of parts, rotated about a point or mirrored about a line; they are named "leg 2", "leg 3" and so on."""

    parts: tuple[Label, ...] = Field(min_length=1, examples=[["leg", "root", "tip"]])
    """Names of bodies, hinges, actuators and points, also of earlier copies. A copied hinge or actuator connects the
    copies of its bodies where these are copied, otherwise the same bodies"""
    count: Count | None = Field(default=None, examples=[4])
    """Number of parts in total, the original included, of a rotation"""
    about: Point | None = Field(default=None, alias="about_mm", examples=[[0.0, 0.0]])
    """Centre of the rotation; by default the origin"""
    angle: Turn | None = Field(default=None, alias="angle_deg", examples=[90.0])
    """Angle from one copy to the next, counter-clockwise; by default 360 degrees over `count`"""
    mirror: tuple[Point, Point] | None = Field(default=None, alias="mirror_mm", examples=[[[0.0, 0.0], [0.0, 1.0]]])
    """Instead of `count`: two points x, y of the line about which the parts are mirrored"""

    @model_validator(mode="after")
    def _has_one_form(self) -> Copies:
        _one_form(self, ("count",), ("mirror",))
        for name in ("about", "angle"):
            if self.mirror is not None and getattr(self, name) is not None:
                raise refusal("no rotation besides mirror_mm", type(self).model_fields[name].alias or name)
        if self.mirror is not None and self.mirror[0] == self.mirror[1]:
            raise refusal("two different points", "mirror_mm")
        return self


class PlateActuator(Dimensioned):
    """A linear actuator that pushes two bodies apart along the line between its two contacts."""

    name: Label = Field(examples=["drive"])
    """Unique name of the actuator"""
    between: tuple[Label, Label] = Field(examples=[["ground", "lever"]])
    """Names of the carrying and the driven body; "ground", without a body of this name, is the ground outside"""
    at: tuple[Point, Point] = Field(alias="at_mm", examples=[[[0.0, 0.0], [20.0, 0.0]]])
    """Contact x, y on each of the two bodies"""
    contact: Size | None = Field(default=None, alias="contact_mm", examples=[2.0])
    """Radius of the area around a contact that takes the load; by default a twentieth of the extent of the body"""
    stack: StackName | None = Field(default=None, examples=["AE0505D16"])
    """Name of a stack of the catalogue"""
    stroke: Annotated[actuators.Stroke, *EXPRESSION] | None = Field(default=None, alias="stroke_um", examples=[17.4])
    """Free stroke; instead of `stack`, with `stiffness_n_per_um` or `blocking_force_n`"""
    stiffness: Annotated[actuators.Rate, *EXPRESSION] | None = Field(
        default=None, alias="stiffness_n_per_um", examples=[53.7]
    )
    """Stiffness of the actuator: blocking force over stroke"""
    blocking_force: Annotated[actuators.Force, *EXPRESSION] | None = Field(
        default=None, alias="blocking_force_n", examples=[935.0]
    )
    """Blocking force of the actuator at its full stroke"""
    mass: Mass = Field(default=0.0, alias="mass_g", examples=[8.0])
    """Mass of the actuator, half of it at each contact"""

    @model_validator(mode="after")
    def _rating_is_stated(self) -> PlateActuator:
        check_rating(
            [field.alias or n for n, field in PlateActuator.model_fields.items() if getattr(self, n) is not None]
        )
        if self.at[0] == self.at[1]:
            raise refusal("two different points, which give the direction of the force", "at_mm")
        return self

    @property
    def rating(self) -> StackRating:
        """Stroke, stiffness and blocking force."""
        return rating_of(self.stack, self.stroke, self.stiffness, self.blocking_force)


class OutputPoint(Dimensioned):
    """The output: the body whose pose is read, and on which loads act."""

    body: Label = Field(examples=["stage"])
    """Name of the body"""
    at: Point = Field(alias="at_mm", examples=[[0.0, 50.0]])
    """Point x, y to which pose and loads refer"""
    contact: Size | None = Field(default=None, alias="contact_mm", examples=[5.0])
    """Radius of the area around the point that takes loads, and whose mean motion is read; by default the whole body"""


class NamedPoint(OutputPoint):
    """Another point whose motion is read."""

    name: Label = Field(examples=["corner"])
    """Unique name of the point"""


class OutputPayload(Dimensioned):
    """A rigid payload at the output."""

    mass: Mass = Field(alias="mass_g", examples=[100.0])
    """Mass of the payload"""
    inertia: Inertia = Field(default=0.0, alias="inertia_kg_mm2", examples=[20.0])
    """Moment of inertia about the normal of the plate through the output"""


class MechanismContent(PlateFile):
    """The content of a mechanism file, from which `Mechanism` derives its layout."""

    kind: ClassVar[str] = "mechanism file"

    name: Label = Field(examples=["parallelogram"])
    """Name of the mechanism in tables and figures"""
    model: Literal["plane_stress", "plane_strain"] = "plane_stress"
    """Plane model: `plane_stress`, for a plate that is thin compared with its bodies, or `plane_strain`"""
    thickness: Size = Field(alias="thickness_mm", examples=[10.0])
    """Thickness of the plate"""
    material: PlateMaterial
    """Material of the plate, isotropic"""
    parameters: Mapping[str, Parameter] = Field(
        default_factory=dict, examples=[{"length_mm": 50.0, "gap_mm": "length / 2"}]
    )
    """Numbers by name, which other numbers of the file may use. A name ends in its unit, such as _mm or _deg, or has
    none; expressions use it without the unit. Every number of the file may be an expression in quotes, in the unit of
    its key: numbers, names, + - * / **, brackets, abs, sqrt, exp, log, log10, min, max, and sin, cos, tan, atan in
    degrees"""
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
    frame: PlateFrame = Field(default_factory=PlateFrame)
    """Frame to which the plate is fixed. Only thermal drift uses it"""
    payload: OutputPayload | None = None
    """Rigid payload at the output"""
    point: tuple[NamedPoint, ...] = ()
    """Another point whose motion is read"""

    @model_validator(mode="wrap")
    @classmethod
    def _with_parameters(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        stated = data.get("parameters", {}) if isinstance(data, dict) else {}
        token = _known.set(parameter_values(stated) if isinstance(stated, Mapping) else {})
        try:
            return handler(data)
        finally:
            _known.reset(token)

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        for array in PARTS:
            names = [part.name for part in getattr(self, array)]
            for index, name in enumerate(names):
                if name in names[:index] or (array == "point" and name == "output"):
                    raise refusal(f"a name that no other {array} has", array, index, "name")
        return self
