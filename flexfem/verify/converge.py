"""A stage on finer and finer meshes: where its platform compliance goes, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import COARSER, grid_convergence
from flexfem.refused import BadInput
from flexfem.verify.case import DIRECTIONS, Direction
from flexfem.verify.protocol import Solve, solve_stage
from flexfem.verify.result import Matrix, OfStage, Uncertainty, about

RESOLUTIONS = (3, 4, 6, 8, 11, 15)


class MeshStudy(OfStage):
    """Platform compliance (3, 3) of a stage, order x, y, theta, on meshes of growing resolution.

    uncertainty : of the diagonal terms, mm/N, mm/N, rad/(N mm), their bands in the same units.
    """

    stage: str
    resolutions: list[int]
    triangles: list[int]
    unknowns: list[int]
    compliance: list[Matrix]
    uncertainty: dict[Direction, Uncertainty]


def checked_resolutions(resolutions: Sequence[int]) -> tuple[int, ...]:
    """The resolutions, when there are three or more, each `COARSER` times the one before. Raises BadInput."""
    ratios = [fine / coarse for coarse, fine in pairwise(resolutions)]
    if len(resolutions) < 3 or min(resolutions) < 2 or min(ratios) < COARSER:
        raise BadInput(
            f"resolutions {', '.join(map(str, resolutions))}, expected three or more from 2 upwards, "
            f"each at least {COARSER:g} times the one before"
        )
    return tuple(resolutions)


def converge(stage: Stage, resolutions: Sequence[int], solve: Solve = solve_stage) -> MeshStudy:
    """Solve a feasible stage on every resolution, coarse to fine. Raises BadInput, ComputationFailed."""
    solved = [solve(stage, resolution) for resolution in checked_resolutions(resolutions)]
    compliance = np.array([each.response.compliance for each in solved])
    uncertainty = {
        axis: Uncertainty.of(grid_convergence(np.array(resolutions), compliance[:, k, k], round_off=0.0))
        for k, axis in enumerate(DIRECTIONS)
    }
    return MeshStudy(
        **about(stage),
        stage=stage.name,
        warnings=[
            *warning.of_numbers(stage),
            *(
                f"the mesh band of the compliance in {axis} is ±{100 * each.band / abs(each.extrapolated):.2g} % "
                f"({each.verdict}); finer meshes narrow it"
                for axis, each in uncertainty.items()
                if each.band > 1e-3 * abs(each.extrapolated)
            ),
        ],
        resolutions=list(resolutions),
        triangles=[each.triangles for each in solved],
        unknowns=[each.response.unknowns for each in solved],
        compliance=compliance.tolist(),
        uncertainty=uncertainty,
    )
