"""The process that calls gmsh: one request after the other from standard input."""

from __future__ import annotations

import os
import pickle
import sys
from contextlib import suppress
from typing import Any

from flexfem.meshing.contours import contours_of
from flexfem.meshing.faces import mesh_faces
from flexfem.meshing.plates import mesh_plate
from flexfem.meshing.requests import FaceMesh, PlateContours, PlateMesh, PlateSolid, SolidSection
from flexfem.meshing.solids import section_of, write_plate


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
