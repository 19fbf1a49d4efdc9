"""The only module that imports gmsh. Run as a process of its own: it can hang or crash without taking flexfem along.

`main` reads a pickled `Job` or `Export` from standard input and writes the mesh as .npz to standard output.
"""

from __future__ import annotations

import ctypes
import io
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.layout.outline import Face

OPTIONS = {
    "General.NumThreads": 1,  # more make the order of the nodes vary from run to run
    "General.Verbosity": 2,
    "Mesh.Algorithm": 6,  # Frontal-Delaunay
    "Mesh.LcIntegrationPrecision": 1e-2,
    "Mesh.SecondOrderLinear": 0,  # middle nodes on the arcs
    "Mesh.HighOrderOptimize": 0,
}
LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libgomp.so.1": "libgomp1",
}
SAME_POINT = 1e-7  # mm; faces compute their common points each on its own


class Job(NamedTuple):
    """Faces that share curves, and how finely to mesh them.

    sizes : expressions in x and y, mm, whose least is the size of a triangle.
    curvature : triangles per full turn of an arc.
    divisions : for the labels named, the number of equal edges along each segment.
    """

    faces: list[Face]
    sizes: list[str]
    curvature: float
    divisions: dict[str, int]


class Export(NamedTuple):
    """A mesh to write as .msh: nodes (n, 2), triangles (m, 6) and groups of edges (k, 3) by name."""

    path: str
    nodes: AnyArray
    triangles: AnyArray
    groups: dict[str, AnyArray]


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
    """Mesh faces with curved quadratic triangles, conforming along the curves they share.

    Returns
    -------
    nodes (n, 2) in mm; triangles (m, 6) corners then middles, faces (m,) index of each triangle's face;
    edges (k, 3) ends then middle, edge_labels (k,) text.
    """
    with gmsh_session() as gmsh:
        curves, surfaces = _draw(gmsh.model.occ, job.faces)
        gmsh.model.occ.synchronize()
        for curve, label in curves.items():
            if label in job.divisions:
                gmsh.model.mesh.setTransfiniteCurve(curve, job.divisions[label] + 1)
        _set_sizes(gmsh, job)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        return _collect(gmsh.model.mesh, surfaces, curves)


def _draw(occ: Any, faces: list[Face]) -> tuple[dict[int, str], list[int]]:
    """Draw every point and curve once; returns the curves with their labels, and the surfaces."""
    points: list[tuple[complex, int]] = []
    curves: dict[tuple[int, int], int] = {}
    labels: dict[int, str] = {}
    surfaces = []

    def point(at: complex) -> int:
        known = next((tag for place, tag in points if abs(place - at) < SAME_POINT), None)
        if known is None:
            known = occ.addPoint(at.real, at.imag, 0.0)
            points.append((at, known))
        return known

    for face in faces:
        loop = []
        for segment, label in zip(face.loop, face.labels, strict=True):
            start, end = point(segment.start), point(segment.end)
            if start == end:  # an arc of a bend too slight to draw
                continue
            if (end, start) in curves:
                loop.append(-curves[end, start])
                continue
            if segment.centre is None:
                tag = occ.addLine(start, end)
            else:
                tag = occ.addCircleArc(start, occ.addPoint(segment.centre.real, segment.centre.imag, 0.0), end)
            curves[start, end], labels[tag] = tag, label
            loop.append(tag)
        surfaces.append(occ.addPlaneSurface([occ.addCurveLoop(loop)]))
    return labels, surfaces


def _set_sizes(gmsh: Any, job: Job) -> None:
    field = gmsh.model.mesh.field
    tags = []
    for expression in job.sizes:
        tags.append(field.add("MathEval"))
        field.setString(tags[-1], "F", expression)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", job.curvature)


def _collect(mesh: Any, surfaces: list[int], curves: dict[int, str]) -> dict[str, AnyArray]:
    tags, xyz, _ = mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    triangles = [place[mesh.getElementsByType(9, surface)[1].reshape(-1, 6)] for surface in surfaces]
    edges = [place[mesh.getElementsByType(8, curve)[1].reshape(-1, 3)] for curve in curves]
    used, renumbered = np.unique(np.concatenate(triangles), return_inverse=True)  # centres of arcs are no nodes
    back = np.full(len(tags), -1)
    back[used] = np.arange(len(used))
    return {
        "nodes": xyz.reshape(-1, 3)[used, :2],
        "triangles": renumbered.reshape(-1, 6),
        "faces": np.repeat(np.arange(len(surfaces)), [len(t) for t in triangles]),
        "edges": back[np.concatenate(edges)],
        "edge_labels": np.repeat(np.array(list(curves.values())), [len(e) for e in edges]),
    }


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
    """Serve one job."""
    job = pickle.load(sys.stdin.buffer)
    try:
        result = write_msh(job) if isinstance(job, Export) else mesh_faces(job)
    except Exception as error:  # gmsh raises bare Exception; the parent turns this into one line
        sys.exit(f"gmsh: {' '.join(str(error).split())}")
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **result)
    sys.stdout.buffer.write(buffer.getvalue())
