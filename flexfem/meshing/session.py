"""gmsh with fixed options; the only module that imports it."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

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
