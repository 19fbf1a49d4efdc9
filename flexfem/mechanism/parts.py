"""Validated tables of a mechanism file in N-mm-MPa-rad; every number may be an expression.

An expression is in the unit of its key, and names parameters without their units. Its value keeps
its text, so that a mechanism can be written, and changed by its parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import AfterValidator, Field, ModelWrapValidatorHandler, model_validator

from flexfem.files.expressions import parameter_values
from flexfem.files.quantities import (
    KNOWN,
    Coordinate,
    Count,
    ForceOrZero,
    Grams,
    Inertia,
    Length,
    LengthOrZero,
    Turn,
    Unlimited,
)
from flexfem.files.refusals import refusal
from flexfem.files.tables import UNCHANGEABLE, Label, Table, Unchangeable, one_form
from flexfem.mechanism.actuators import RatedActuator
from flexfem.mechanism.materials import Frame, Material, PartMaterial
from flexfem.mechanism.mechanism import Mechanism

Reduction: TypeAlias = Literal["three_dimensional", "plane_stress", "plane_strain"]
MOST = 5000  # corners of one outline


def _corner(corner: tuple[float, ...]) -> tuple[float, ...]:
    if corner[2:] and corner[2] < 0:
        raise refusal("a radius of at least 0 as the third number")
    return corner


def _enclosing(corners: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(corners) == 2 and not any(any(corner[3:]) for corner in corners):
        raise refusal("at least 3 corners, or 2 with an arc between them")
    return corners


Point: TypeAlias = tuple[Coordinate, Coordinate]
Corner: TypeAlias = Annotated[
    tuple[Coordinate, ...], Field(min_length=2, max_length=4), AfterValidator(_corner)
]
Corners: TypeAlias = Annotated[
    tuple[Corner, ...], Field(min_length=2, max_length=MOST), AfterValidator(_enclosing)
]
Bend: TypeAlias = Annotated[
    tuple[Coordinate, ...], Field(min_length=2, max_length=3), AfterValidator(_corner)
]
Bends: TypeAlias = Annotated[tuple[Bend, ...], Field(min_length=2, max_length=MOST)]
Row: TypeAlias = Annotated[tuple[Coordinate, ...], Field(min_length=2, max_length=3)]
Shape: TypeAlias = Literal[
    "circular", "elliptical", "filleted", "leaf", "parabolic", "v", "profile"
]


class BodyHole(Table):
    """A hole in a body, inside its outline: a polygon with fillets, or a disc."""

    outline: Corners | None = Field(
        default=None, alias="outline_mm", examples=[[[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]]
    )
    """Corners x, y of a polygon, as those of a body"""
    centre: Point | None = Field(
        default=None,
        alias="centre_mm",
        examples=[[0.0, 0.0]],
    )
    """Instead of `outline_mm`, with `radius_mm`: centre of a disc"""
    radius: Length | None = Field(
        default=None,
        alias="radius_mm",
        examples=[2.0],
    )
    """Radius of a disc"""
    count: Count | None = Field(default=None, examples=[6])
    """Number of equal holes on a circle, such as those of screws; by default one"""
    about: Point | None = Field(
        default=None,
        alias="about_mm",
        examples=[[0.0, 0.0]],
    )
    """With `count`: centre of the circle; by default the origin"""
    angle: Turn | None = Field(
        default=None,
        alias="angle_deg",
        examples=[30.0],
    )
    """With `count`: angle from one hole to the next, counter-clockwise; by default 360 degrees over
    `count`"""

    @model_validator(mode="after")
    def _has_one_form(self) -> BodyHole:
        one_form(self, ("outline",), ("centre", "radius"))
        for name in ("about", "angle"):
            if self.count is None and getattr(self, name) is not None:
                key = type(self).model_fields[name].alias or name
                raise refusal("count, the number of holes, besides it", key)
        return self


class PlateBody(Table):
    """A body of the mechanism: a polygon with fillets, a bar along a path, or a disc."""

    name: Label = Field(examples=["stage"])
    """Unique name of the body"""
    outline: Corners | None = Field(
        default=None, alias="outline_mm", examples=[[[0.0, 0.0], [9.0, 0.0], [9.0, 8.0, 2.0]]]
    )
    """Corners x, y of a polygon, in either sense; an optional third number is the radius of a
    fillet at the corner. An optional fourth number makes the side to the next corner a circular
    arc: its height over the chord, positive to the right on the way to the next corner, which is
    outwards where the corners go round counter-clockwise """
    path: Bends | None = Field(
        default=None, alias="path_mm", examples=[[[0.0, 0.0], [30.0, 0.0, 10.0], [30.0, 20.0]]]
    )
    """Instead of `outline_mm`, with `width_mm`: points x, y of the centreline of a bar with square
    ends; an optional third number is the radius of the centreline at a bend, which is sharp without
    it """
    width: Length | None = Field(
        default=None,
        alias="width_mm",
        examples=[8.0],
    )
    """Width of a bar"""
    centre: Point | None = Field(
        default=None,
        alias="centre_mm",
        examples=[[0.0, 0.0]],
    )
    """Instead of `outline_mm`, with `radius_mm`: centre of a disc"""
    radius: Length | None = Field(
        default=None,
        alias="radius_mm",
        examples=[15.0],
    )
    """Radius of a disc"""
    holes: tuple[BodyHole, ...] = ()
    """Holes in the body"""
    fixed: bool = False
    """Whether the body is rigid ground"""
    material: PartMaterial | None = Field(default=None, examples=["ti-6al-4v"])
    """Material of the body, the name of a registered one or a table as `[material]`; by default
    that of the plate
    """
    clamped_edges: tuple[Annotated[int, Field(ge=1)], ...] = Field(default=(), examples=[[1]])
    """Edges at which an elastic body is clamped. Edge 1 goes from the first corner to the second,
    and so on; edge 1 of a bar is its start, edge 2 its end """

    @model_validator(mode="after")
    def _has_one_form(self) -> PlateBody:
        one_form(self, ("outline",), ("path", "width"), ("centre", "radius"))
        for index, corner in enumerate(self.path or ()):
            if any(corner[2:]) and index in (0, len(self.path or ()) - 1):
                raise refusal(
                    "two numbers at an end of the path: it has no bend there", "path_mm", index
                )
        edges = len(self.outline or ()) or 2 * (self.path is not None)
        for index, edge in enumerate(self.clamped_edges):
            if edge > edges or edge in self.clamped_edges[:index]:
                raise refusal(
                    f"each edge once, of {edges} edges" if edges else "no edge of a disc",
                    "clamped_edges",
                    index,
                )
        if self.fixed and self.clamped_edges:
            raise refusal("either a fixed body or clamped edges of an elastic one", "clamped_edges")
        return self


class PlateHinge(Table):
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
    neck: Length | None = Field(
        default=None,
        alias="neck_mm",
        examples=[0.5],
    )
    """Smallest height of the profile, except of a `profile`"""
    length: Length | None = Field(
        default=None,
        alias="length_mm",
        examples=[50.0],
    )
    """Length along its axis, fillets included, of an elliptical, filleted or parabolic hinge or a
    leaf
    """
    radius: Length | None = Field(
        default=None,
        alias="radius_mm",
        examples=[2.0],
    )
    """Radius of the notches of a circular hinge"""
    depth: Length | None = Field(
        default=None,
        alias="depth_mm",
        examples=[2.0],
    )
    """Depth of each notch of an elliptical, parabolic or v-shaped hinge"""
    fillet: LengthOrZero | None = Field(
        default=None,
        alias="fillet_mm",
        examples=[0.5],
    )
    """Radius of the fillets of a filleted hinge or a leaf"""
    flush: (
        tuple[Literal["first left", "first right", "second left", "second right"], ...] | None
    ) = Field(default=None, examples=[["first right"]])
    """Corners of a filleted hinge or a leaf that have no fillet, because the edge goes on as the
    side of the body: at the first or the second body, seen along the direction """
    angle: Turn | None = Field(
        default=None,
        alias="angle_deg",
        examples=[60.0],
    )
    """Opening angle of the notches of a v-shaped hinge"""
    root_radius: Length | None = Field(
        default=None,
        alias="root_radius_mm",
        examples=[0.5],
    )
    """Radius of the root of the notches of a v-shaped hinge"""
    side: Literal["left", "right"] | None = Field(default=None, examples=["left"])
    """Side of the only notch, or of the only fillets of a leaf, seen along the direction, except of
    a `profile`. The other edge is straight, at half a neck from the axis; by default both edges are
    equal """
    table: Annotated[tuple[Row, ...], Field(max_length=MOST)] | None = Field(
        default=None, alias="table_mm", examples=[[[0.0, 4.0], [2.0, 0.5], [4.0, 4.0]]]
    )
    """Rows of ascending position along the axis and height of a `profile`, or of position and
    distances of the left and the right edge from the axis; at least three, joined by straight
    lines. Their middle is the centre. Instead, `table_csv` names a CSV file with measured points of
    both edges: columns edge (left or right), x_mm and y_mm """
    smooth: bool | None = Field(default=None, examples=[True])
    """Whether smooth curves, monotone cubics, join the rows of `table_mm` instead of straight lines
    """
    cut: Length | None = Field(
        default=None,
        alias="cut_mm",
        examples=[12.0],
    )
    """Height over which both bodies are cut away along the profile; by default 2 % more than the
    larger of the height of the ends of the profile and the widths of those bodies that are bars """

    material: PartMaterial | None = Field(default=None, examples=["ti-6al-4v"])
    """Material of the hinge, as that of a body"""

    @property
    def dimensions(self) -> dict[str, Any]:
        """Stated dimensions of the profile, mm, by their names."""
        return {
            name: getattr(self, name) for name in OF_PROFILES if getattr(self, name) is not None
        }


OF_PROFILES = (
    "neck",
    "length",
    "radius",
    "depth",
    "fillet",
    "flush",
    "angle",
    "root_radius",
    "side",
    "table",
    "smooth",
)


class Copies(Table):
    """Copies of parts, rotated about a point or mirrored about a line; they are named "leg 2", "leg
    3" and so on.
    """

    parts: tuple[Label, ...] = Field(min_length=1, examples=[["leg", "root", "tip"]])
    """Names of bodies, hinges, actuators and points, also of earlier copies. A copied hinge or
    actuator connects the copies of its bodies where these are copied, otherwise the same bodies """
    count: Count | None = Field(default=None, examples=[4])
    """Number of parts in total, the original included, of a rotation"""
    about: Point | None = Field(
        default=None,
        alias="about_mm",
        examples=[[0.0, 0.0]],
    )
    """Centre of the rotation; by default the origin"""
    angle: Turn | None = Field(
        default=None,
        alias="angle_deg",
        examples=[90.0],
    )
    """Angle from one copy to the next, counter-clockwise; by default 360 degrees over `count`"""
    mirror: tuple[Point, Point] | None = Field(
        default=None, alias="mirror_mm", examples=[[[0.0, 0.0], [0.0, 1.0]]]
    )
    """Instead of `count`: two points x, y of the line about which the parts are mirrored"""

    @model_validator(mode="after")
    def _has_one_form(self) -> Copies:
        one_form(self, ("count",), ("mirror",))
        for name in ("about", "angle"):
            if self.mirror is not None and getattr(self, name) is not None:
                raise refusal(
                    "no rotation besides mirror_mm", type(self).model_fields[name].alias or name
                )
        if self.mirror is not None and self.mirror[0] == self.mirror[1]:
            raise refusal("two different points", "mirror_mm")
        return self


class PlateActuator(RatedActuator):
    """A linear actuator that pushes two bodies apart along the line between its two contacts."""

    between: tuple[Label, Label] = Field(examples=[["ground", "lever"]])
    """Names of the carrying and the driven body; "ground", without a body of this name, is the
    ground outside
    """
    at: tuple[Point, Point] = Field(alias="at_mm", examples=[[[0.0, 0.0], [20.0, 0.0]]])
    """Contact x, y on each of the two bodies"""
    contact: Length | None = Field(
        default=None,
        alias="contact_mm",
        examples=[2.0],
    )
    """Radius of the area around a contact that takes the load; by default a twentieth of the extent
    of the body
    """
    mass: Grams = Field(
        default=0.0,
        alias="mass_g",
        examples=[8.0],
    )
    """Mass of the actuator, half of it at each contact"""
    preload: ForceOrZero | None = Field(
        default=None,
        alias="preload_n",
        examples=[50.0],
    )
    """Force with which the actuator pushes the two bodies apart at rest. It keeps its direction.
    `modes` and `stiffness` take it into account """

    @model_validator(mode="after")
    def _preload_is_possible(self) -> PlateActuator:
        if self.preload is not None and not self.preload <= self.rating.blocking_force:
            raise refusal(
                f"at most the blocking force, {self.rating.blocking_force:g}", "preload_n"
            )
        return self

    @model_validator(mode="after")
    def _points_differ(self) -> PlateActuator:
        if self.at[0] == self.at[1]:
            raise refusal("two different points, which give the direction of the force", "at_mm")
        return self


class OutputPoint(Table):
    """The output: the body whose pose is read, and on which loads act."""

    body: Label = Field(examples=["stage"])
    """Name of the body"""
    at: Point = Field(alias="at_mm", examples=[[0.0, 50.0]])
    """Point x, y to which pose and loads refer"""
    contact: Length | None = Field(
        default=None,
        alias="contact_mm",
        examples=[5.0],
    )
    """Radius of the area around the point that takes loads, and whose mean motion is read; by
    default the whole body
    """


class NamedPoint(OutputPoint):
    """Another point whose motion is read."""

    name: Label = Field(examples=["corner"])
    """Unique name of the point"""


class OutputPayload(Table):
    """A rigid payload at the output."""

    mass: Grams = Field(alias="mass_g", examples=[100.0])
    """Mass of the payload"""
    inertia: Inertia = Field(
        default=0.0,
        alias="inertia_kg_mm2",
        examples=[20.0],
    )
    """Moment of inertia about the normal of the plate through the output"""


class MechanismTables(Mechanism):
    """The tables of a mechanism file."""

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
    def _with_parameters(
        cls,
        data: Any,
        handler: ModelWrapValidatorHandler[Self],
    ) -> Self:
        stated = data.get("parameters", {}) if isinstance(data, dict) else {}
        token = KNOWN.set(parameter_values(stated) if isinstance(stated, Mapping) else {})
        try:
            return handler(data)
        finally:
            KNOWN.reset(token)
