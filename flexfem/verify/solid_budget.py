"""What three dimensions change in the error of a stage's analytic model, measured on the stage."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import CALIBRATED, analyse
from flexfem.arrays import Array
from flexfem.fem.response import unit_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import SAFETY, error_matrix, levels, solve_solid
from flexfem.units import DIRECTIONS
from flexfem.verify.budget import Budget, ThreeDimensional, thick_compliance
from flexfem.verify.result import Triple

BUDGET = (4, 3)  # resolution and layers: what three dimensions change hardly depends on the mesh in the plane


def measured(stage: Stage, found: Budget) -> Budget:
    """A budget with what three dimensions change, measured on the stage. Raises ComputationFailed.

    Notes
    -----
    The error in three dimensions less that of the stage's own plane problem on the same mesh of the plane, whose own
    error so cancels. The band is `SAFETY` times what the last step of the mesh and of the layers changed, one after the
    other as in `solid_bands`.
    """
    resolution, count = BUDGET
    coarse, medium, _ = levels(resolution)
    finest = _change(stage, resolution, count)
    steps = (
        _change(stage, resolution, 1) - _change(stage, medium, 1),
        _change(stage, coarse, count) - _change(stage, coarse, levels(count)[1]),
    )
    band = SAFETY * np.diag(np.abs(steps[0]) + np.abs(steps[1]))
    of_solid = ThreeDimensional(
        resolution=resolution,
        layers=count,
        unknowns=solve_solid(stage, resolution, count).unknowns,
        points={axis: Triple.of(finest[:, k]) for k, axis in enumerate(DIRECTIONS)},
        band=dict(zip(DIRECTIONS, band.tolist(), strict=True)),
    )
    return found.model_copy(update={"three_dimensional": of_solid})


def other_thickness(stage: Stage, compliance: Array) -> dict[str, Array]:
    """Compliances (3, 3) of the extruded stage, measured and by the chart of single hinges where they are all on it.

    Parameters
    ----------
    compliance : (3, 3), of finite elements in the stage's plane, to which the change from plane to three dimensions is
        added.
    """
    response = solve_solid(stage, *BUDGET)
    plane = unit_response(response.sectors, plate_of(stage)).compliance
    found = {"finite elements in three dimensions": compliance + response.compliance - plane}
    thick = thick_compliance(stage)
    if thick is None:
        return found
    flat = analyse(stage, 21, CALIBRATED, links=True).compliance
    return found | {"three dimensions by the chart of single hinges": compliance + thick - flat}


def _change(stage: Stage, resolution: int, layers: int) -> Array:
    """Percentage points (3, 3), column j for command j, from the stage's own plane problem to three dimensions."""
    response, predicted = solve_solid(stage, resolution, layers), analyse(stage).stiffness
    plane, lever = unit_response(response.sectors, plate_of(stage)), stage.chain.link_lengths[2]
    solid, flat = (error_matrix(predicted, each.compliance, lever) for each in (response, plane))
    return np.asarray(solid - flat)
