"""A part as a STEP file, by gmsh's OpenCASCADE kernel: an outline extruded, its arcs as cylinders, in mm."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.fem.drawing import draw_loops
from flexfem.mechanism.bodies import Face, Segment


class Extruded(NamedTuple):
    """A solid to write as .step, from z = 0 up to its thickness, mm.

    outer : closed counter-clockwise loop.   holes : centre (complex) and radius of each.
    """

    path: str
    outer: list[Segment]
    holes: list[tuple[complex, float]]
    thickness: float


def write_extruded(gmsh: Any, task: Extruded) -> dict[str, AnyArray]:
    """Write a solid and read it back, with the gmsh of a session.

    Returns
    -------
    volumes (n,), mm^3, of the n solids in the file, exact mass properties; box (2, 3), mm, lowest and highest corner;
    cylinders (), how many faces are cylinders.
    """
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
