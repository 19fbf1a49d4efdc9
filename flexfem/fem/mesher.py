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
from flexfem.fem.drawing import DrawnCurve, draw_loops
from flexfem.fem.step import Extruded, write_extruded
from flexfem.mechanism.bodies import Face


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


def main() -> None:
    """Serve one list of jobs after the other until standard input ends, or one fails."""
    made = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no part of the mesh
    with suppress(EOFError):
        while True:
            pickle.dump(_served(pickle.load(sys.stdin.buffer)), made)
            made.flush()


def write_step(task: Extruded) -> dict[str, AnyArray]:
    """Write a solid as `write_extruded`."""
    with gmsh_session() as gmsh:
        return write_extruded(gmsh, task)


def _served(jobs: list[Request]) -> list[dict[str, AnyArray]]:
    serve: dict[type, Any] = {Job: mesh_faces, Export: write_msh, Extruded: write_step}
    try:
        return [serve[type(job)](job) for job in jobs]
    except Exception as error:  # gmsh raises bare Exception; the parent turns this into one line
        sys.exit(f"gmsh: {' '.join(str(error).split())}")
