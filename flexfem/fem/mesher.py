"""The only module that imports gmsh. Run as a process of its own: it can hang or crash without taking flexfem along.

`main` reads pickled lists of requests (`Job`, `Export`, `Extruded`) from standard input and writes as many lists of
what was made to standard output; gmsh's own words go to standard error.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.bodies import Face, Segment

SAME_POINT = 1e-7  # mm; faces compute their common points each on its own


class DrawnCurve(NamedTuple):
    """A drawn curve: its label, and for an arc the centre."""

    label: str
    centre: complex | None


def draw_loops(kernel: Any, faces: list[Face]) -> tuple[dict[int, DrawnCurve], list[int]]:
    """Draw every point and curve once; returns the curves and the closed loop of each face."""
    ends = np.array([(segment.start, segment.end) for face in faces for segment in face.loop])
    first = np.argmax(np.abs(ends.ravel()[:, None] - ends.ravel()) < SAME_POINT, axis=1).reshape(ends.shape)
    drawn, loops, places = _Drawn(kernel), [], iter(first.tolist())
    for face in faces:
        pieces = zip(face.loop, face.labels, strict=True)
        tags = [drawn.curve(segment, label, *next(places)) for segment, label in pieces]
        loops.append(int(kernel.addCurveLoop([tag for tag in tags if tag])))
    return drawn.curves, loops


class _Drawn:
    """Points and curves that the kernel has, by the places of their ends among all ends."""

    def __init__(self, kernel: Any) -> None:
        self.kernel = kernel
        self.curves: dict[int, DrawnCurve] = {}
        self._points: dict[int, int] = {}
        self._between: dict[tuple[int, int], int] = {}

    def curve(self, segment: Segment, label: str, start: int, end: int) -> int:
        """Tag of a curve, negative where its face meets it backwards; 0 for an arc of a bend too slight to draw."""
        one, other = self._point(start, segment.start), self._point(end, segment.end)
        if one == other:
            return 0
        if (other, one) in self._between:
            return -self._between[other, one]
        if segment.centre is None:
            tag = int(self.kernel.addLine(one, other))
        else:
            middle = self.kernel.addPoint(segment.centre.real, segment.centre.imag, 0.0)
            tag = int(self.kernel.addCircleArc(one, middle, other))
        self._between[one, other], self.curves[tag] = tag, DrawnCurve(label, segment.centre)
        return tag

    def _point(self, place: int, at: complex) -> int:
        if place not in self._points:
            self._points[place] = self.kernel.addPoint(at.real, at.imag, 0.0)
        return self._points[place]


class Cone(NamedTuple):
    """Triangle size, mm: `least` within `radius` of a point, `most` from `reach` further on, linear between."""

    centre: complex
    radius: float
    least: float
    most: float
    reach: float


class Job(NamedTuple):
    """Faces that share curves, and how finely to mesh them.

    divisions : for the labels named, the number of equal edges along each segment.
    cones : the least of them is the size of a triangle.
    """

    faces: list[Face]
    divisions: dict[str, int]
    cones: tuple[Cone, ...]


TRIANGLE, EDGE = 2, 1  # gmsh's numbers of the linear ones
STRAIGHT = complex(np.nan)  # for a centre


def set_sizes(gmsh: Any, job: Job) -> None:
    field, tags = gmsh.model.mesh.field, []
    for cone in job.cones:
        tags.append(field.add("Ball"))
        values = (cone.centre.real, cone.centre.imag, cone.radius, cone.least, cone.most, cone.reach)
        for name, value in zip(("XCenter", "YCenter", "Radius", "VIn", "VOut", "Thickness"), values, strict=True):
            field.setNumber(tags[-1], name, value)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)


def collect(mesh: Any, surfaces: list[int], curves: dict[int, DrawnCurve]) -> dict[str, AnyArray]:
    tags, xyz, _ = mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    triangles = [place[mesh.getElementsByType(TRIANGLE, face)[1].reshape(-1, 3)] for face in surfaces]
    edges = [place[mesh.getElementsByType(EDGE, tag)[1].reshape(-1, 2)] for tag in curves]
    used, renumbered = np.unique(np.concatenate(triangles), return_inverse=True)  # centres of arcs are no nodes
    back = np.full(len(tags), -1)
    back[used] = np.arange(len(used))
    per_curve = [len(e) for e in edges]
    return {
        "nodes": xyz.reshape(-1, 3)[used, :2],
        "triangles": renumbered.reshape(-1, 3),
        "faces": np.repeat(np.arange(len(surfaces)), [len(t) for t in triangles]),
        "edges": back[np.concatenate(edges)],
        "edge_labels": np.repeat([curve.label for curve in curves.values()], per_curve),
        "edge_centres": np.repeat([STRAIGHT if c.centre is None else c.centre for c in curves.values()], per_curve),
    }


OPTIONS = {
    "General.NumThreads": 1,  # more make the order of the nodes vary from run to run
    "General.Verbosity": 2,
    "General.Terminal": 0,  # in a worker that shares its terminal
    "Mesh.Algorithm": 6,  # Frontal-Delaunay
    "Mesh.LcIntegrationPrecision": 1e-2,
    "Mesh.Smoothing": 0,  # half the time, and the compliance is no better for it
    "Mesh.MeshSizeExtendFromBoundary": 0,  # the cones hold inside as well: a tenth fewer triangles, better shaped
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


class Extruded(NamedTuple):
    """A solid to write as .step, from z = 0 up to its thickness, mm.

    outer : closed counter-clockwise loop.   holes : centre (complex) and radius of each.
    """

    path: str
    outer: list[Segment]
    holes: list[tuple[complex, float]]
    thickness: float


class Export(NamedTuple):
    """A mesh to write as .msh: nodes (n, 2), triangles (m, 6) and groups of edges (k, 3) by name."""

    path: str
    nodes: AnyArray
    triangles: AnyArray
    groups: dict[str, AnyArray]


Request: TypeAlias = Job | Export | Extruded


def require_gmsh() -> None:
    """Exit with one line that names the Debian packages of gmsh's system libraries that are missing."""
    try:
        import gmsh  # noqa: F401
    except OSError as error:
        missing = [package for library, package in LIBRARIES.items() if not _loads(library)]
        cure = f"on Debian: apt-get install {' '.join(missing)}" if missing else "a system library is missing"
        sys.exit(f"gmsh cannot be loaded ({error}); {cure}")


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """Yield gmsh, initialised the same whoever runs it, and close it in the end."""
    require_gmsh()
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        yield gmsh
    finally:
        gmsh.finalize()


def mesh_faces(job: Job) -> dict[str, AnyArray]:
    """Mesh faces with triangles, conforming along the curves they share.

    Returns
    -------
    nodes (n, 2) in mm; triangles (m, 3), faces (m,) index of each triangle's face; edges (k, 2) of the curves that are
    labelled or bent, edge_labels (k,) text, edge_centres (k,) complex, nan unless on an arc. The middles of the sides
    are added by `sectors.curved`, faster than by gmsh.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.geo
        curves, loops = draw_loops(kernel, job.faces)
        surfaces = [kernel.addPlaneSurface([loop]) for loop in loops]
        kernel.synchronize()
        for tag, curve in curves.items():
            if curve.label in job.divisions:
                gmsh.model.mesh.setTransfiniteCurve(tag, job.divisions[curve.label] + 1)
        set_sizes(gmsh, job)
        gmsh.model.mesh.generate(2)
        told = {tag: curve for tag, curve in curves.items() if curve != DrawnCurve("free", None)}
        return collect(gmsh.model.mesh, surfaces, told)


def write_msh(export: Export) -> dict[str, AnyArray]:
    """Write a mesh with the physical groups `stage` and those of the edges; returns nothing of interest."""
    with gmsh_session() as gmsh:
        mesh = gmsh.model.mesh
        gmsh.model.addDiscreteEntity(2, 1)
        tags = np.arange(1, len(export.nodes) + 1)
        mesh.addNodes(2, 1, tags, np.pad(export.nodes, [(0, 0), (0, 1)]).ravel())
        mesh.addElementsByType(1, 9, [], tags[export.triangles].ravel())
        gmsh.model.addPhysicalGroup(2, [1], name="stage")
        for curve, (name, edges) in enumerate(export.groups.items(), start=1):
            gmsh.model.addDiscreteEntity(1, curve)
            mesh.addElementsByType(curve, 8, [], tags[edges].ravel())
            gmsh.model.addPhysicalGroup(1, [curve], name=name)
        gmsh.write(export.path)
    return {}


def write_extruded(task: Extruded) -> dict[str, AnyArray]:
    """Write a solid as a STEP file, its arcs as cylinders, in mm, and read it back.

    Returns
    -------
    volumes (n,), mm^3, of the n solids in the file, exact mass properties; box (2, 3), mm, lowest and highest corner;
    cylinders (), how many faces are cylinders.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        _, loops = draw_loops(kernel, [Face(task.outer, ["free"] * len(task.outer))])
        for centre, radius in task.holes:
            loops.append(kernel.addCurveLoop([kernel.addCircle(centre.real, centre.imag, 0.0, radius)]))
        kernel.extrude([(2, kernel.addPlaneSurface(loops))], 0.0, 0.0, task.thickness)
        kernel.synchronize()
        of_solid = {tag for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(3), False, False, True)}
        kernel.remove([(0, tag) for _, tag in kernel.getEntities(0) if tag not in of_solid])  # centres of the arcs
        kernel.synchronize()
        gmsh.write(task.path)
        gmsh.clear()
        solids = [tag for dim, tag in kernel.importShapes(task.path) if dim == 3]
        kernel.synchronize()
        faces = [gmsh.model.getType(*face) for face in gmsh.model.getEntities(2)]
        return {
            "volumes": np.array([kernel.getMass(3, tag) for tag in solids]),
            "box": np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)),
            "cylinders": np.array(faces.count("Cylinder")),
        }


def main() -> None:
    """Serve one list of jobs after the other until standard input ends, or one fails."""
    made = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no part of the mesh
    with suppress(EOFError):
        while True:
            pickle.dump(_served(pickle.load(sys.stdin.buffer)), made)
            made.flush()


def _served(jobs: list[Request]) -> list[dict[str, AnyArray]]:
    serve: dict[type, Any] = {Job: mesh_faces, Export: write_msh, Extruded: write_extruded}
    try:
        return [serve[type(job)](job) for job in jobs]
    except Exception as error:  # gmsh raises bare Exception; the parent turns this into one line
        sys.exit(f"gmsh: {' '.join(str(error).split())}")
