"""The only module that imports gmsh. Run as a process of its own: it can hang or crash without taking flexfem along.

`main` reads pickled lists of `Job` and `Export` from standard input and writes as many lists of meshes to standard
output; gmsh's own words go to standard error.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.fem.drawing import LINEAR, QUADRATIC, Curve, Job, collect, draw, set_cones, set_sizes

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
    edges (k, 3) ends then middle, edge_labels (k,) text, edge_centres (k,) complex, nan unless on an arc. With cones
    the triangles (m, 3) and edges (k, 2) have no middles yet: `sectors.curved` adds them faster than gmsh.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.geo if job.cones else gmsh.model.occ
        curves, surfaces = draw(kernel, job.faces)
        kernel.synchronize()
        for tag, curve in curves.items():
            if curve.label in job.divisions:
                gmsh.model.mesh.setTransfiniteCurve(tag, job.divisions[curve.label] + 1)
        (set_cones if job.cones else set_sizes)(gmsh, job)
        gmsh.model.mesh.generate(2)
        if not job.cones:
            gmsh.model.mesh.setOrder(2)
            return collect(gmsh.model.mesh, surfaces, curves, QUADRATIC)
        told = {tag: curve for tag, curve in curves.items() if curve != Curve("free", None)}
        return collect(gmsh.model.mesh, surfaces, told, LINEAR)


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


def _served(jobs: list[Job | Export]) -> list[dict[str, AnyArray]]:
    try:
        return [write_msh(job) if isinstance(job, Export) else mesh_faces(job) for job in jobs]
    except Exception as error:  # gmsh raises bare Exception; the parent turns this into one line
        sys.exit(f"gmsh: {' '.join(str(error).split())}")
