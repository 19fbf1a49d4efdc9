"""gmsh in separate processes, which can hang or crash alone; the only module that imports it.

A process serves one request after the other, since starting it takes longer than most meshes:
`main` reads pickled requests from standard input and writes pickled results to standard output.
"""

from __future__ import annotations

import atexit
import ctypes
import math
import os
import pickle
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from subprocess import PIPE, Popen
from tempfile import TemporaryFile
from threading import Thread
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.edges import Bezier, Curve
from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import Face, Segment, area, reverse
from flexfem.refused import ComputationFailed
from flexfem.sources import child_command

SAME_POINT = 1e-7  # mm; each face computes the points that it shares with others
# gmsh types of quadratic elements and their nodes
TRIANGLE = (9, 6)
EDGE = (8, 3)
CURVE_ERROR = 1e-4  # mm; of arcs in place of another curve
SECTION_ERROR = 2e-5  # mm; the same for a solid that another program wrote
LONGEST_TURN = 2.5  # rad, of an arc of a contour
# label of lines between sectors, or halves, of parts that a symmetry takes into themselves
DIVIDING = "dividing"
SAME_PART = 1e-5  # mm; two faces with middles at a smaller distance are the same
SAME_SIZE = 1e-6  # relative, of their areas or lengths
PERPENDICULAR = 1e-5  # most cosine between the normals of a plate and of a face perpendicular to it
SOLID_NAME = re.compile(rb"MANIFOLD_SOLID_BREP\s*\(\s*'((?:[^']|'')*)'")
ON_SIDE = 1e-4  # mm; a plane face at a smaller distance from a side of a plate is a part of it
ALREADY_FLAT = 1e-12  # sine of the angle between the normal of a plate and z; round-off
PARALLEL = 1 - 1e-9  # least cosine between the normals of parallel faces
MOST_ARCS = 1000  # in place of one curve
ON_LINE = 1e-9  # sine of the angle between two chords, below which three points are on a line
MOST_DIRECTIONS = 30  # of plane faces that may be the sides of a plate
POLL = 0.25  # s between two polls of a process
# s between two polls; a longer gap means that this process or the machine was suspended
LONGEST_GAP = 1.0
MOST_MEMORY = 6_000_000_000  # bytes, while a solid of another program is read
MOST_KEPT = 10_000_000  # bytes of meshes; after a larger result the process ends to free its memory
OPTIONS = {
    "General.NumThreads": 1,  # more threads make the node order vary between runs
    "General.Verbosity": 2,
    "General.Terminal": 0,  # a worker shares the terminal
    "Mesh.Algorithm": 6,  # Frontal-Delaunay
    # mm; ends of hinges may lie this far from their bodies, by rounded coordinates
    "Geometry.ToleranceBoolean": 1e-6,
    "Mesh.LcIntegrationPrecision": 1e-2,
    "Mesh.Smoothing": 0,  # it takes half the time without improving the compliance
    "Mesh.MeshSizeExtendFromBoundary": 0,  # cones alone: a tenth fewer triangles, better shaped
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeFromPoints": 0,
}
LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libgomp.so.1": "libgomp1",
}


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


def require_gmsh() -> None:
    """Exit with a line that names the Debian packages of missing system libraries of gmsh."""
    try:
        import gmsh  # noqa: F401
    except OSError as error:
        missing = [package for library, package in LIBRARIES.items() if not _loads(library)]
        remedy = (
            f"on Debian: apt-get install {' '.join(missing)}"
            if missing
            else "a system library is missing"
        )
        sys.exit(f"gmsh cannot be loaded ({error}); {remedy}")


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """Yield gmsh, initialised independently of user settings, and finalise it afterwards."""
    require_gmsh()
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        yield gmsh
    finally:
        gmsh.finalize()


class _Drawn(NamedTuple):
    """Curves of gmsh with their labels, and the faces of each region, by tags."""

    curves: list[tuple[str, int]]
    faces: list[list[int]]


def _draw_faces(kernel: Any, faces: list[Face]) -> _Drawn:
    """Draw every point and curve once; curves with the label `free` are left out of the result.

    A segment with coincident ends is omitted; a curve that a face traverses backwards has a
    negative tag in its loop.
    """
    indices = iter(_ends_at_same_point(faces))
    points = dict[int, int]()
    drawn = dict[tuple[int, int], int]()
    labelled = list[tuple[str, int]]()
    loops = list[int]()
    for face in faces:
        tags = list[int]()
        for segment, label in zip(face.loop, face.labels, strict=True):
            start, end = next(indices)
            if start == end:
                continue
            if (end, start) in drawn:
                tags.append(-drawn[end, start])
                continue
            if start not in points:
                points[start] = _point(kernel, segment.start)
            if end not in points:
                points[end] = _point(kernel, segment.end)
            drawn[start, end] = _draw_curve(kernel, segment, points[start], points[end])
            tags.append(drawn[start, end])
            if label != "free":
                labelled.append((label, tags[-1]))
        loops.append(kernel.addCurveLoop(tags))
    return _Drawn(labelled, [[int(kernel.addPlaneSurface([loop]))] for loop in loops])


def _ends_at_same_point(faces: list[Face]) -> list[tuple[int, int]]:
    """Return for the start and end of every segment the index of the first end at this point."""
    ends = np.array([(segment.start, segment.end) for face in faces for segment in face.loop])
    apart = np.abs(ends.ravel()[:, None] - ends.ravel())
    first = np.argmax(apart < SAME_POINT, axis=1)
    return [(start, end) for start, end in first.reshape(ends.shape).tolist()]


def mesh_faces(job: FaceMesh) -> NamedArrays:
    """Mesh faces with quadratic triangles, conforming along the curves they share.

    Returns arrays as `_meshed`.
    """
    with gmsh_session() as gmsh:
        drawn = _draw_faces(gmsh.model.geo, job.faces)
        gmsh.model.geo.synchronize()
        field = gmsh.model.mesh.field
        balls = list[int]()
        for grading in job.gradings:
            sizes = {"VIn": grading.size, "VOut": grading.largest, "Thickness": grading.reach}
            for z in grading.points:
                place = {"XCenter": z.real, "YCenter": z.imag, "Radius": grading.radius}
                balls.append(_field(field, "Ball", **place, **sizes))
        return _meshed(gmsh.model.mesh, job.divisions, balls, drawn)


def _field(field: Any, kind: str, **values: float) -> int:
    tag = field.add(kind)
    for name, value in values.items():
        field.setNumber(tag, name, value)
    return int(tag)


def _meshed(
    mesh: Any,
    divisions: dict[str, int],
    sizes: list[int],
    drawn: _Drawn,
) -> NamedArrays:
    """Mesh what is drawn, with the minimum over the fields of `sizes` as triangle size.

    Returns
    -------
    nodes (n, 2) in mm; triangles (m, 6) as in `mesh.StageMesh`, regions (m,) index of each
    triangle's region; edges (k, 3) of the curves, edge_labels (k,) text.
    """
    curves, faces = drawn
    _set_divisions(mesh, divisions, curves)
    smallest = mesh.field.add("Min")
    mesh.field.setNumbers(smallest, "FieldsList", sizes)
    mesh.field.setAsBackgroundMesh(smallest)
    mesh.generate(2)
    mesh.setOrder(2)
    of_regions = [
        np.concatenate([_elements(mesh, TRIANGLE, tag) for tag in part]) for part in faces
    ]
    of_curves = [_elements(mesh, EDGE, tag) for _, tag in curves]
    triangles = np.concatenate(of_regions)
    nodes, index = _used_nodes(mesh, triangles)
    edges = np.concatenate([np.empty((0, 3), dtype=np.int64), *of_curves])
    return {
        "nodes": nodes,
        "triangles": _counter_clockwise(nodes, index[triangles]),
        "regions": np.repeat(np.arange(len(faces)), [len(part) for part in of_regions]),
        "edges": index[edges],
        "edge_labels": np.repeat([label for label, _ in curves], [len(each) for each in of_curves]),
    }


def _set_divisions(
    mesh: Any,
    divisions: dict[str, int],
    curves: Sequence[tuple[str, int]],
) -> None:
    """Divide curves into equal edges, those with one label together into a number of them."""
    pieces = Counter(label for label, _ in curves)
    for label, tag in curves:
        if label in divisions:
            mesh.setTransfiniteCurve(tag, math.ceil(divisions[label] / pieces[label]) + 1)


def _used_nodes(mesh: Any, triangles: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the nodes (n, 2), mm, of triangles, and the numbers of all tags among them, or -1.

    Centres of arcs and points that set sizes are left out.
    """
    tags, xyz, _ = mesh.getNodes()
    used = np.isin(tags, triangles)
    index = np.full(int(tags.max()) + 1, -1)
    index[tags[used]] = np.arange(np.count_nonzero(used))
    return xyz.reshape(-1, 3)[used, :2], index


def _elements(
    mesh: Any,
    kind: tuple[int, int],
    tag: int,
) -> AnyArray:
    """Return the nodes (e, n) of the elements of a kind on a face or curve."""
    return np.reshape(mesh.getElementsByType(kind[0], tag)[1], (-1, kind[1])).astype(np.int64)


def _counter_clockwise(nodes: AnyArray, triangles: AnyArray) -> AnyArray:
    """Return the triangles (m, 6) with their corners counter-clockwise; copied ones may not be."""
    first, second, third = (nodes[triangles[:, :3]] @ [1, 1j]).T
    clockwise = ((second - first).conj() * (third - first)).imag < 0
    triangles[clockwise] = triangles[clockwise][:, [0, 2, 1, 5, 4, 3]]
    return triangles


def write_plate(solid: PlateSolid) -> NamedArrays:
    """Write a plate as a STEP file, its arcs as cylinders, in mm, and read it back.

    Returns
    -------
    volumes (n,), mm^3, of the n solids in the file, exact mass properties; box (2, 3), mm, lowest
    and highest corner."""
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        kernel.extrude(_union(kernel, solid.regions), 0.0, 0.0, solid.thickness)
        kernel.synchronize()
        corners = gmsh.model.getBoundary(gmsh.model.getEntities(3), False, False, True)
        centres_of_arcs = [point for point in kernel.getEntities(0) if point not in corners]
        kernel.remove(centres_of_arcs)
        kernel.synchronize()
        gmsh.write(solid.path)
        gmsh.clear()
        solids = [tag for dim, tag in kernel.importShapes(solid.path) if dim == 3]
        kernel.synchronize()
        return {
            "volumes": np.array([kernel.getMass(3, tag) for tag in solids]),
            "box": np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)),
        }


def _draw_region(kernel: Any, region: Region) -> list[tuple[int, int]]:
    """Draw a region and return its faces: a cut can divide it."""
    face = (2, kernel.addPlaneSurface([_draw_loop(kernel, loop) for loop in region.loops]))
    boxes = [(2, kernel.addPlaneSurface([_draw_loop(kernel, cut)])) for cut in region.cuts]
    return list(kernel.cut([face], boxes)[0]) if boxes else [face]


def _draw_loop(kernel: Any, loop: Sequence[Curve]) -> int:
    """Draw a closed loop of curves, each of which begins where the one before it ends."""
    if len(loop) == 1 and isinstance(loop[0], Segment) and loop[0].centre is not None:
        return int(kernel.addCurveLoop([_draw_circle(kernel, loop[0].start, loop[0].centre)]))
    curves = [curve for curve in loop if abs(np.subtract(*_ends(curve))) > SAME_POINT]
    corners = [_point(kernel, _ends(curve)[0]) for curve in curves]
    following = [*corners[1:], corners[0]]
    tags = [_draw_curve(kernel, *each) for each in zip(curves, corners, following, strict=True)]
    return int(kernel.addCurveLoop(tags))


def _ends(curve: Curve) -> tuple[complex, complex]:
    if isinstance(curve, Bezier):
        return curve.points[0], curve.points[-1]
    return curve.start, curve.end


def _draw_circle(
    kernel: Any,
    start: complex,
    centre: complex,
) -> int:
    spoke = start - centre
    axes = {"zAxis": [0.0, 0.0, 1.0], "xAxis": [spoke.real, spoke.imag, 0.0]}
    return int(kernel.addCircle(centre.real, centre.imag, 0.0, abs(spoke), **axes))


def _draw_curve(
    kernel: Any,
    curve: Curve,
    start: int,
    end: int,
) -> int:
    if isinstance(curve, Bezier):
        return int(kernel.addBezier([start, *(_point(kernel, z) for z in curve.points[1:-1]), end]))
    if curve.centre is None:
        return int(kernel.addLine(start, end))
    centre = _point(kernel, curve.centre)
    if isinstance(curve, Segment):
        return int(kernel.addCircleArc(start, centre, end))
    return int(kernel.addEllipseArc(start, centre, _point(kernel, curve.centre + curve.major), end))


def _point(kernel: Any, z: complex) -> int:
    return int(kernel.addPoint(z.real, z.imag, 0.0))


def _union(kernel: Any, regions: list[Region]) -> list[tuple[int, int]]:
    """Draw the union of regions and return its faces, one for each connected part."""
    first, *others = (face for region in regions for face in _draw_region(kernel, region))
    return list(kernel.fuse([first], others)[0]) if others else [first]


def mesh_plate(job: PlateMesh) -> NamedArrays:
    """Mesh regions with quadratic triangles, conforming along the curves they share.

    Returns arrays as `_meshed`, and areas (regions,), mm^2, exact.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        gmsh.option.setNumber("Mesh.Algorithm", job.algorithm)
        drawn = _divide(gmsh.model, job)
        points = [[_point(kernel, z) for z in grading.points] for grading in job.gradings]
        kernel.synchronize()
        sizes = _sizes_near(gmsh.model.mesh.field, job.gradings, points)
        sizes += _sizes_in(gmsh.model.mesh.field, job.largest, drawn.faces)
        if job.moves:
            _repeat(gmsh.model, job.moves)
        areas = np.array([sum(kernel.getMass(2, tag) for tag in part) for part in drawn.faces])
        return {**_meshed(gmsh.model.mesh, job.divisions, sizes, drawn), "areas": areas}


def _sizes_near(
    field: Any, gradings: Sequence[Grading], points: Sequence[Sequence[int]]
) -> list[int]:
    """Return fields with the sizes of gradings near their points, given by tags."""
    found = list[int]()
    for grading, near in zip(gradings, points, strict=True):
        distance = field.add("Distance")
        field.setNumbers(distance, "PointsList", near)
        limits = {"SizeMin": grading.size, "SizeMax": grading.largest}
        limits |= {"DistMin": grading.radius, "DistMax": grading.radius + grading.reach}
        found.append(_field(field, "Threshold", InField=distance, **limits))
    return found


def _sizes_in(
    field: Any,
    largest: Sequence[float],
    faces: Sequence[Sequence[int]],
) -> list[int]:
    """Return fields with the largest sizes, mm, in the faces of each region."""
    found = list[int]()
    for size, part in zip(largest, faces, strict=True):
        found.append(_field(field, "Constant", VIn=size, VOut=max(largest)))
        field.setNumbers(found[-1], "SurfacesList", part)
    return found


def _divide(model: Any, job: PlateMesh) -> _Drawn:
    """Divide the union of the regions along the lines.

    Regions are united first, since a hinge may be tangent to the side at which it meets a body: no
    triangle edge follows this side.
    """
    kernel = model.occ
    drawn = _draw_regions(kernel, job)
    pieces = kernel.fragment(drawn.faces, [_draw_line(kernel, line) for line in job.lines])[1]
    kernel.synchronize()
    owner = dict[int, int]()
    for region, found in zip(drawn.regions, pieces, strict=False):  # pieces of lines follow
        if region is not None:
            owner.update((tag, region) for _, tag in found)
    curves = _owned_curves(model, job.lines, pieces[len(drawn.faces) :], owner)
    if len(owner) != len(model.getEntities(2)):
        raise ValueError("a part of the plate is connected to nothing")
    faces: list[list[int]] = [[] for _ in job.regions]
    for tag, region in owner.items():
        faces[region].append(tag)
    return _Drawn(curves, faces)


class _DrawnRegions(NamedTuple):
    """Faces of gmsh, and the region of each, None for faces of several regions that are united."""

    faces: list[tuple[int, int]]
    regions: list[int | None]


def _draw_regions(kernel: Any, job: PlateMesh) -> _DrawnRegions:
    """Draw the union of the regions with lines, and every other region by itself."""
    with_lines = {line.region for line in job.lines}
    united = [region for index, region in enumerate(job.regions) if index in with_lines]
    faces = _union(kernel, united) if with_lines else []
    regions: list[int | None] = [None] * len(faces)
    for index, region in enumerate(job.regions):
        if index not in with_lines:
            own_faces = _draw_region(kernel, region)
            faces += own_faces
            regions += [index] * len(own_faces)
    return _DrawnRegions(faces, regions)


def _draw_line(kernel: Any, line: Line) -> tuple[int, int]:
    start = _point(kernel, line.curve.start)
    end = _point(kernel, line.curve.end)
    return (1, _draw_curve(kernel, line.curve, start, end))


def _owned_curves(
    model: Any, lines: Sequence[Line], pieces: Sequence[Any], owner: dict[int, int]
) -> list[tuple[str, int]]:
    """Return the pieces of lines in the plate with their labels, and let them give faces an owner.

    owner : region of each face, by its tag.
    """
    curves = list[tuple[str, int]]()
    for line, found in zip(lines, pieces, strict=True):
        for _, tag in found:
            beside = model.getAdjacencies(1, tag)[0].tolist()
            region = line.region
            if region is None:
                region = next((owner[face] for face in beside if face in owner), -1)
            if region >= 0:
                for face in beside:
                    owner.setdefault(face, region)
            if region in [owner.get(face) for face in beside]:
                curves.append((line.label, tag))
            elif beside:  # else it is beyond an edge
                raise ValueError("two parts of the plate are joined without a hinge")
    return curves


def _repeat(model: Any, moves: Sequence[Move]) -> None:
    """Let meshes of faces and curves be copied from those that the moves take to them.

    Each curve but one of those alike is a copy of this one, which is a copy of nothing: as a side
    of a copied face it could be one of its own copies.
    """
    for dim in (2, 1):
        tags = [tag for _, tag in model.getEntities(dim)]
        middles = {tag: complex(*model.occ.getCenterOfMass(dim, tag)[:2]) for tag in tags}
        sizes = {tag: float(model.occ.getMass(dim, tag)) for tag in tags}
        own_moves = (Move(), *moves) if dim == 1 else tuple(moves)
        while middles:
            first, middle = next(iter(middles.items()))
            done = {first}
            for move in own_moves:
                image = _image(middles, sizes, first, move(middle))
                if image not in done or move == Move():
                    model.mesh.setPeriodic(dim, [image], [first], _affine(move))
                    done.add(image)
            middles = {tag: at for tag, at in middles.items() if tag not in done}


def _image(
    middles: dict[int, complex],
    sizes: dict[int, float],
    first: int,
    place: complex,
) -> int:
    """Return the face or curve like the first one whose middle is at a place, else itself."""
    for tag, middle in middles.items():
        alike = math.isclose(sizes[tag], sizes[first], rel_tol=SAME_SIZE)
        if alike and abs(middle - place) < SAME_PART:
            return tag
    return first


def _affine(move: Move) -> AnyArray:
    """Return the matrix (16,) of gmsh of a move."""
    affine = np.eye(4)
    affine[:2, :2] = move.of_twists[:2, :2]
    affine[:2, 3] = (move.shift.real, move.shift.imag)
    return affine.ravel()


def contours_of(job: PlateContours) -> list[list[Segment]]:
    """Return the boundary of the union of regions as closed loops of lines and arcs.

    They are counter-clockwise, around holes clockwise. Those of a connected part follow each other,
    the outer first."""
    with gmsh_session() as gmsh:
        union = _union(gmsh.model.occ, job.regions)
        gmsh.model.occ.synchronize()
        return _contours(gmsh.model, union)


def _contours(
    model: Any, faces: Sequence[tuple[int, int]], most: float = CURVE_ERROR
) -> list[list[Segment]]:
    """Return the contours of plane faces, as `contours_of`.

    most : mm, distance of arcs from other curves in place of which they are.
    """
    contours = list[list[Segment]]()
    for _, face in faces:
        tags_of = [tags.tolist() for tags in model.occ.getCurveLoops(face)[1]]
        loops = [_closed_loop(model, tags, most) for tags in tags_of]
        loops.sort(key=lambda loop: -abs(area(loop)))
        for number, loop in enumerate(loops):
            counter_clockwise = number == 0
            contours.append(loop if (area(loop) > 0) == counter_clockwise else reverse(loop))
    return contours


def _closed_loop(
    model: Any,
    tags: Sequence[int],
    most: float,
) -> list[Segment]:
    """Return the curves with these tags as lines and arcs, each from where the one before ends."""
    ends = {tag: model.getBoundary([(1, tag)], combined=False, oriented=False) for tag in tags}
    at = ends[tags[0]][0]
    loop = list[Segment]()
    while ends:
        tag = next(tag for tag, pair in ends.items() if at in pair)
        first, *last = ends.pop(tag)
        arcs = _arcs(model, tag, most)
        if at == first:
            loop += arcs
            at = last[0] if last else first
        else:
            loop += reverse(arcs)
            at = first
    return loop


class _CurveOnModel(NamedTuple):
    """A curve of gmsh between two parameters."""

    model: Any
    tag: int
    low: float
    high: float

    def points(self, shares: AnyArray) -> AnyArray:
        """Return its points (n,), complex, mm, at shares of its parameter."""
        return self._values(self.model.getValue, shares)

    def slopes(self, shares: AnyArray) -> AnyArray:
        """Return the derivatives (n,) by the parameter, complex."""
        return self._values(self.model.getDerivative, shares)

    def _values(
        self,
        of: Any,
        shares: AnyArray,
    ) -> AnyArray:
        parameters = self.low + (self.high - self.low) * shares
        x, y, _ = np.reshape(of(1, self.tag, parameters), (-1, 3)).T
        return np.asarray(x + 1j * y)


def _arcs(
    model: Any,
    tag: int,
    most: float,
) -> list[Segment]:
    """Return a curve as lines and arcs from its start to its end."""
    (low,), (high,) = model.getParametrizationBounds(1, tag)
    curve = _CurveOnModel(model, tag, low, high)
    shares = np.linspace(0, 1, 9)
    points = curve.points(shares)
    slopes = curve.slopes(shares)
    if np.ptp(slopes.real) + np.ptp(slopes.imag) < SAME_POINT:
        return [Segment(*points[[0, -1]].tolist())]
    for spokes in (1j * slopes, -1j * slopes):  # of a circle, whose parameter is the angle
        centre = np.mean(points + spokes)
        if np.max(np.abs(points + spokes - centre)) < SAME_POINT:
            count = int(np.ceil((high - low) / LONGEST_TURN))
            ends = curve.points(np.arange(count + 1) / count).tolist()
            return [Segment(a, b, complex(centre)) for a, b in pairwise(ends)]
    count = 4
    arcs, error = _arcs_through(curve, count)
    while error > most and 2 * count < MOST_ARCS:
        count *= 2
        arcs, error = _arcs_through(curve, count)
    return arcs


def _arcs_through(curve: _CurveOnModel, count: int) -> tuple[list[Segment], float]:
    """Return arcs or lines through points of a curve, and their distance from it, mm.

    Each goes through three points, and its distance is that of two points between them.
    """
    points = curve.points(np.arange(4 * count + 1) / (4 * count))
    start = points[:-1:4]
    end = points[4::4]
    centres, straight = _centres(start, points[2::4], end)
    between = np.stack([points[1::4], points[3::4]])
    chord = end - start
    from_line = np.abs(((between - start) / chord).imag * np.abs(chord))
    from_arc = np.abs(np.abs(between - centres) - np.abs(start - centres))
    error = float(np.max(np.where(straight, from_line, from_arc)))
    arcs = list[Segment]()
    for index, (first, last) in enumerate(pairwise(points[::4].tolist())):
        centre = None if straight[index] else complex(centres[index])
        arcs.append(Segment(first, last, centre))
    return arcs, error


def _centres(
    start: AnyArray,
    middle: AnyArray,
    end: AnyArray,
) -> tuple[AnyArray, AnyArray]:
    """Return the centres of circles through three points (n,), and which three are on a line."""
    u = middle - start
    v = end - start
    turn = (np.conj(u) * v).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        centres = start + 0.5j * (u * np.abs(v) ** 2 - v * np.abs(u) ** 2) / turn
    return centres, np.abs(turn) < ON_LINE * np.abs(v) ** 2


def section_of(job: SolidSection) -> FoundSection:
    """Cut one solid of a STEP file half way between its two sides.

    The plate is perpendicular to the direction along which most of the surface is parallel or
    perpendicular to it, of equal ones the direction of the smallest thickness. Its two sides are
    the plane faces across it with most area.
    """
    with _limited_memory(), gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
        kernel = gmsh.model.occ
        solids, names = _imported_solids(gmsh.model, job.path)
        chosen = _chosen(job.part, names)
        if chosen < 0:
            return FoundSection([], names, -1)
        solid = (3, solids[chosen])
        kernel.remove([(3, tag) for tag in solids if tag != solid[1]], recursive=True)
        kernel.synchronize()
        boundary = gmsh.model.getBoundary([solid], oriented=False)
        faces = [_SolidFace.of(gmsh.model, tag) for _, tag in boundary]
        sides = _sides(faces)
        volume = kernel.getMass(*solid)
        if sides is None:
            return FoundSection([], names, chosen, solid=volume, other=_counted_faces(faces))
        _lay_flat(kernel, solid, sides)
        contours = _contours(gmsh.model, _cut_in_middle(kernel, solid), SECTION_ERROR)
        return FoundSection(
            contours,
            names,
            chosen,
            sides.high - sides.low,
            volume,
            (sides.high - sides.low) * sum(map(area, contours)),
            _counted_faces([face for face in faces if not _fits(face, sides)]),
            _only_lines_and_circles(gmsh.model),
        )


def _imported_solids(model: Any, path: str) -> tuple[list[int], list[str]]:
    """Return the tags of the solids of a file and their names, the largest solid first."""
    solids = [tag for dim, tag in model.occ.importShapes(path) if dim == 3]
    model.occ.synchronize()
    names = dict(zip(solids, _names_of_solids(model, solids, path), strict=True))
    solids.sort(key=lambda tag: -model.occ.getMass(3, tag))
    return solids, [names[tag] for tag in solids]


def _cut_in_middle(kernel: Any, solid: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the faces of the section of a solid by the plane z = 0, in place of the solid."""
    low, high = np.reshape(kernel.getBoundingBox(*solid), (2, 3))
    box = kernel.addRectangle(low[0] - 1, low[1] - 1, 0.0, *(high - low + 2)[:2])
    section = kernel.intersect([(2, box)], [solid])[0]
    kernel.synchronize()
    return [each for each in section if each[0] == 2]


def _only_lines_and_circles(model: Any) -> bool:
    """Return whether every curve of a model is a line or a circular arc."""
    return all(model.getType(1, tag) in ("Line", "Circle") for _, tag in model.getEntities(1))


@contextmanager
def _limited_memory() -> Iterator[None]:
    """Limit the memory of this process to `MOST_MEMORY`, where the system can.

    Files of others may ask for any.
    """
    try:
        import resource
    except ImportError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    within = MOST_MEMORY if before[1] == resource.RLIM_INFINITY else min(MOST_MEMORY, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (within, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _names_of_solids(
    model: Any,
    solids: Sequence[int],
    path: str,
) -> list[str]:
    """Return the names of solids in the order of the file: of their products, else their own."""
    names = [model.getEntityName(3, tag).rpartition("/")[2] for tag in solids]
    if not any(names):
        found = SOLID_NAME.findall(Path(path).read_bytes())
        if len(found) == len(solids):
            names = [name.decode(errors="replace").replace("''", "'") for name in found]
    return names


def _chosen(part: int | str, names: Sequence[str]) -> int:
    """Return the index of the solid with a number or a name, -1 without one."""
    text = str(part).strip().lower()
    if text.isdecimal():
        return int(text) - 1 if 1 <= int(text) <= len(names) else -1
    return next((k for k, name in enumerate(names) if name.lower() == text), -1)


class _SolidFace(NamedTuple):
    """A face of a solid: kind, area, mm^2, unit normals (n, 3) at points, one point (3,), mm."""

    kind: str
    area: float
    normals: AnyArray
    point: AnyArray

    @classmethod
    def of(
        cls,
        model: Any,
        tag: int,
    ) -> _SolidFace:
        """Return the face of a tag."""
        low, high = model.getParametrizationBounds(2, tag)
        shares = np.linspace(0.03, 0.97, 5)
        parameters = np.array([(u, v) for u in shares for v in shares]) * (high - low) + low
        normals = np.reshape(model.getNormal(tag, parameters.ravel()), (-1, 3))
        point = np.array(model.getValue(2, tag, parameters[len(parameters) // 2]))
        return cls(model.getType(2, tag), float(model.occ.getMass(2, tag)), normals, point)


class _Sides(NamedTuple):
    """Unit normal (3,) of a plate, and positions, mm, of its two sides along it."""

    normal: AnyArray
    low: float
    high: float


def _fits(face: _SolidFace, sides: _Sides) -> bool:
    """Whether a face is perpendicular to a plate, or on one of its two sides."""
    along = np.abs(face.normals @ sides.normal)
    if np.all(along < PERPENDICULAR):
        return True
    if face.kind != "Plane":
        return False
    at = float(face.point @ sides.normal)
    return min(abs(at - sides.low), abs(at - sides.high)) < ON_SIDE


def _sides(faces: Sequence[_SolidFace]) -> _Sides | None:
    """Return the two sides of a plate, None for a solid without two parallel plane faces."""
    planes = sorted((face for face in faces if face.kind == "Plane"), key=lambda face: -face.area)
    whole = sum(face.area for face in faces)
    best = None
    best_score = (-1.0, 0.0)
    for normal in _directions(planes):
        sides = _sides_across(planes, normal)
        if sides is None:
            continue
        share = sum(face.area for face in faces if _fits(face, sides)) / whole
        score = (round(share, 6), sides.low - sides.high)
        if score > best_score:
            best = sides
            best_score = score
    return best


def _directions(planes: Sequence[_SolidFace]) -> list[AnyArray]:
    """Return the distinct normals (3,) of the first plane faces, their largest part positive."""
    found = list[AnyArray]()
    for face in planes:
        normal = face.normals[0]
        normal = normal * math.copysign(1.0, normal[np.argmax(np.abs(normal))])
        if len(found) < MOST_DIRECTIONS and all(abs(normal @ other) < PARALLEL for other in found):
            found.append(normal)
    return found


def _sides_across(planes: Sequence[_SolidFace], normal: AnyArray) -> _Sides | None:
    """Return the two planes across a normal with most area, None if there is one or none."""
    areas = dict[float, float]()
    for face in planes:
        if abs(face.normals[0] @ normal) > PARALLEL:
            place = round(float(face.point @ normal), 5)
            areas[place] = areas.get(place, 0.0) + face.area
    if len(areas) < 2:
        return None
    one, other = sorted(areas, key=lambda place: -areas[place])[:2]
    return _Sides(normal, min(one, other), max(one, other))


def _lay_flat(
    kernel: Any,
    solid: tuple[int, int],
    sides: _Sides,
) -> None:
    """Turn a plate by the smallest angle so that its normal is along z, and its middle at z = 0."""
    axis = np.cross(sides.normal, (0.0, 0.0, 1.0))
    sine = float(np.linalg.norm(axis))
    cosine = float(sides.normal[2])
    if sine > ALREADY_FLAT:
        kernel.rotate([solid], 0, 0, 0, *(axis / sine), math.atan2(sine, cosine))
    kernel.translate([solid], 0, 0, -(sides.low + sides.high) / 2)
    kernel.synchronize()


def _counted_faces(faces: Sequence[_SolidFace]) -> dict[str, tuple[int, float]]:
    """Return number and total area of faces by kind."""
    counted = dict[str, tuple[int, float]]()
    for face in faces:
        number, size = counted.get(face.kind, (0, 0.0))
        counted[face.kind] = (number + 1, size + face.area)
    return counted


def main() -> None:
    """Serve lists of requests until standard input ends or a request fails."""
    serve: dict[type, Any] = {
        FaceMesh: mesh_faces,
        PlateMesh: mesh_plate,
        PlateContours: contours_of,
        PlateSolid: write_plate,
        SolidSection: section_of,
    }
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # keeps the output of libraries out of the results
    with suppress(EOFError):
        while True:
            request = pickle.load(sys.stdin.buffer)
            try:
                result = serve[type(request)](request)
            except Exception as error:
                # gmsh raises bare Exception; the parent turns this into one line
                sys.exit(f"gmsh: {' '.join(str(error).split())}")
            pickle.dump(result, output)
            output.flush()


class Limit:
    """Seconds `left` for a sequence of tasks.

    Of a gap between two polls at most `LONGEST_GAP` counts.
    """

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def start(self) -> None:
        """Start the clock."""
        self._last = time.monotonic()

    def update(self) -> None:
        """Subtract the time since the last poll."""
        before = self._last
        self._last = time.monotonic()
        self.left -= min(self._last - before, LONGEST_GAP)


class MeshTimeout(ComputationFailed):
    """gmsh exceeded its time limit and was stopped."""


def run_mesher(request: Request, time_limit: float | Limit) -> Any:
    """Serve a request in a process and return its result.

    Raises ComputationFailed when it fails, MeshTimeout when it takes more than `time_limit` s.
    """
    while _idle and not _idle[-1].alive:
        _idle.pop().end()
    process = _idle.pop() if _idle else _Process()
    try:
        limit = time_limit if isinstance(time_limit, Limit) else Limit(time_limit)
        result = process.run(request, limit)
    except BaseException:  # Ctrl-C too: a late result would be taken for that of the next request
        process.end()
        raise
    size = sum(array.nbytes for array in result.values()) if isinstance(result, dict) else 0
    if size > MOST_KEPT:
        process.end()
    else:
        _idle.append(process)
    return result


class _Process:
    """A process that runs `main`."""

    def __init__(self) -> None:
        self._stderr = TemporaryFile()  # noqa: SIM115  open as long as the process
        self._child = Popen(
            child_command("flexfem.fem.mesher"), stdin=PIPE, stdout=PIPE, stderr=self._stderr
        )

    @property
    def alive(self) -> bool:
        return self._child.poll() is None

    def run(
        self,
        request: Request,
        limit: Limit,
    ) -> Any:
        """Serve a request as `run_mesher`; time while flexfem is suspended does not count."""
        self._request = pickle.dumps(request)
        received = list[Any]()
        exchange = Thread(
            target=self._exchange,
            args=(received,),
            daemon=True,
        )
        allowed = limit.left
        exchange.start()
        limit.start()
        while exchange.is_alive():
            exchange.join(min(POLL, max(limit.left, 0.0)))
            limit.update()
            if exchange.is_alive() and limit.left <= 0:
                raise MeshTimeout(f"gmsh was stopped: not done within {allowed:g} s")
        if not received:
            raise self._failure()
        return received[0]

    def _exchange(self, received: list[Any]) -> None:
        """Send the request and append the result, or nothing if the process ends early."""
        assert self._child.stdin and self._child.stdout
        with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            self._child.stdin.write(self._request)
            self._child.stdin.flush()
            self._request = b""
            received.append(pickle.load(self._child.stdout))

    def _failure(self) -> ComputationFailed:
        """Return the error of the ended process, with the last line of its standard error."""
        code = self._child.wait()
        self._stderr.seek(0)
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        return ComputationFailed(lines[-1] if lines else f"gmsh ended with exit code {code}")

    def end(self) -> None:
        self._child.kill()
        with self._child, self._stderr:
            pass


_idle: list[_Process] = []


@atexit.register
def end_processes() -> None:
    """End the idle processes."""
    while _idle:
        _idle.pop().end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # they belong to the parent
