"""Meshes and solutions of a stage, which are computed once and kept with it."""

from __future__ import annotations

from flexfem.fem.mesh import LAYERS, SOLID_RESOLUTION, PlaneMesh, Sector, welded
from flexfem.fem.response import Response, unit_response
from flexfem.files.tables import memoized
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import layers_of, mesh_sectors, plate_of, sheet_of


@memoized
def sectors_of(stage: Stage, resolution: int) -> tuple[Sector, ...]:
    """Return the meshed sectors of a feasible stage."""
    return mesh_sectors(stage, resolution)


@memoized
def meshed(stage: Stage, resolution: int) -> PlaneMesh:
    """Return the mesh of the whole stage."""
    return welded(sectors_of(stage, resolution))[0]


@memoized
def solved(stage: Stage, resolution: int) -> Response:
    """Solve a feasible stage with plane finite elements.

    Raises BadInput for a model that is not plane.
    """
    return unit_response(sectors_of(stage, resolution), plate_of(stage))


@memoized
def solve_solid(
    stage: Stage,
    resolution: int = SOLID_RESOLUTION,
    layers: int = LAYERS,
) -> Response:
    """Mesh and solve a stage in three dimensions. Raises BadInput, ComputationFailed."""
    check_feasible(stage)
    return unit_response(sectors_of(stage, resolution), sheet_of(stage), layers_of(stage, layers))


def solved_by(
    stage: Stage,
    resolution: int,
    layers: int = 0,
) -> Response:
    """Solve a stage with layers in half of its thickness, or in the plane without layers."""
    if layers:
        return solve_solid(stage, resolution, layers)
    return solved(stage, resolution)
