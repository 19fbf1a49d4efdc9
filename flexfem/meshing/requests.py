"""Requests to gmsh and their results; records that a process sends to another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from flexfem.arrays import AnyArray
from flexfem.mechanism.edges import Curve
from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import Face, Segment

# label of lines between sectors, or halves, of parts that a symmetry takes into themselves
DIVIDING = "dividing"


class Grading(NamedTuple):
    """Triangle size, mm, near points.

    It is `size` within `radius` of them, and grows linearly up to `largest` at `radius + reach`.
    """

    points: Sequence[complex]
    radius: float
    size: float
    largest: float
    reach: float


class FaceMesh(NamedTuple):
    """Faces that share curves, and the triangle sizes of their mesh.

    divisions : number of equal edges along each segment with a label, shared by its pieces.
    gradings : the triangle size is the minimum over them.
    """

    faces: list[Face]
    divisions: dict[str, int]
    gradings: list[Grading]


class Region(NamedTuple):
    """A face of a plate: closed loops, the outer one first, less the closed loops `cuts`.

    A loop of one arc that ends at its start is a circle, whose only corner is there.
    """

    loops: Sequence[Sequence[Curve]]
    cuts: Sequence[Sequence[Segment]]


class Line(NamedTuple):
    """A line or arc to be followed by triangle edges.

    It is inside or on the boundary of the union of regions.

    region : index of the region at it: of both sides, or of the side that no line before belongs
        to; None for a line through regions that other lines belong to.
    """

    label: str
    curve: Segment
    region: int | None


class PlateMesh(NamedTuple):
    """Regions, the lines that separate them, and triangle sizes as in `FaceMesh`.

    largest : triangle size, mm, in each region, far from the points of `gradings`.
    moves : rotations, or a mirror image, that take faces and curves into each other; the mesh of
        one is moved to the others.
    algorithm : of gmsh, 6 for Frontal-Delaunay, 5 for Delaunay.
    """

    regions: list[Region]
    lines: list[Line]
    divisions: dict[str, int]
    gradings: list[Grading]
    largest: list[float]
    moves: Sequence[Move] = ()
    algorithm: int = 6


class PlateContours(NamedTuple):
    """A request for the boundary of the union of regions."""

    regions: list[Region]


class PlateSolid(NamedTuple):
    """The union of regions to write as .step, extruded from z = 0 to the thickness, mm."""

    path: str
    regions: list[Region]
    thickness: float


class SolidSection(NamedTuple):
    """A request for the section of one solid of a STEP file half way through its thickness.

    part : number of the solid, 1 for the largest, or its name.
    """

    path: str
    part: int | str


class FoundSection(NamedTuple):
    """A solid as a plate; mm.

    contours : closed loops, as of `contours_of`.
    names : of all solids of the file, the largest first.
    chosen : index of the solid in `names`, -1 when none has the name or number; then there are no
        contours.
    solid, plate : volumes, mm^3, of the solid and of the contours times the thickness.
    other : by kind, number and total area, mm^2, of faces that are not perpendicular to the plate
        and not on its sides.
    exact : whether every curve is a line or a circular arc.
    """

    contours: list[list[Segment]]
    names: list[str]
    chosen: int
    thickness: float = 0.0
    solid: float = 0.0
    plate: float = 0.0
    other: dict[str, tuple[int, float]] = {}  # noqa: RUF012  never changed
    exact: bool = True


Request: TypeAlias = FaceMesh | PlateMesh | PlateContours | PlateSolid | SolidSection
NamedArrays: TypeAlias = dict[str, AnyArray]
