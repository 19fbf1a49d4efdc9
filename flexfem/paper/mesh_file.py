"""The mesh of the stage as a file, with the groups stage, ground and hub."""

from __future__ import annotations

from pathlib import Path

from flexfem.fem.export import write_mesh
from flexfem.fem.mesh import PlaneMesh
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, plate_of


def write_mesh_of(
    stage: Stage,
    target: Path,
    resolution: int,
) -> PlaneMesh:
    """Write the mesh of a stage; return it. Raises BadInput when the stage cannot be made."""
    check_feasible(stage)
    plate = plate_of(stage)
    made = build_mesh(stage, resolution)
    write_mesh(made, plate, target)
    return made
