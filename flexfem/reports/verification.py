"""Analytic model against finite elements: cases, shares of the error, bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from flexfem import arguments
from flexfem.files.refusals import checked_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.reports.given import LARGEST_AMPLITUDE, RESOLUTION, PathLike, Progress, solver
from flexfem.verify import budget as verify_budget
from flexfem.verify import converge as verify_converge
from flexfem.verify.budget import Budget
from flexfem.verify.case import Direction, LoadedCase
from flexfem.verify.converge import MeshStudy
from flexfem.verify.protocol import run_case
from flexfem.verify.result import Fields, Result
from flexfem.verify.solid_budget import measured


class Verification(NamedTuple):
    """What a case came to: the result that is stored, and the fields of its curves at full command, by label."""

    result: Result
    fields: dict[str, Fields]


def verification(path: PathLike) -> Verification:
    """Run a case file: the force of (18), or joints commanded, given to finite elements, and the errors (Figs. 5 to 7).

    By curve percentages (3,) with bands in percentage points, forces N, N, N mm and displacements mm, mm, rad.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the file cannot be used.
    """
    return Verification(*run_case(LoadedCase(checked_path(path)), solver()))


def budget(
    stage: Stage,
    amplitudes: Mapping[Direction, float] | None = None,
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
    three_dimensional: bool = True,
) -> Budget:
    """Split the error of the stage's own analytic model into named shares that add up to it.

    Parameters
    ----------
    amplitudes : commands by direction at which the share of large displacements is taken, mm, mm, rad; by default
        0.05, 0.05 and 0.001.
    resolution : of the finest of three meshes.   progress : called with a line after each mesh.
    three_dimensional : measure what three dimensions change, too.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; a hinge is not on the hinge chart.
    """
    check_feasible(stage)
    at = arguments.by_name("amplitudes", amplitudes, verify_budget.AMPLITUDES, LARGEST_AMPLITUDE)
    found = verify_budget.budget(stage, at, arguments.resolution(resolution, 4), solver(progress))
    return measured(stage, found) if three_dimensional else found


def converge(stage: Stage, resolutions: Sequence[int] | None = None, progress: Progress | None = None) -> MeshStudy:
    """Platform compliance (3, 3), N, mm, rad, on finer and finer meshes: observed order, extrapolated value, band.

    Parameters
    ----------
    resolutions : triangles across every neck, coarse to fine, three or more.   progress : called after each mesh.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the resolutions are too few or too near.

    Notes
    -----
    I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001; the band is Roache's index, with his safety factors.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.converge(flexfem.load("geometry/mobility6.toml"), [2, 3, 4])
    >>> found.uncertainty["x"].resolutions
    [2, 3, 4]
    """
    check_feasible(stage)
    levels = arguments.resolutions(verify_converge.RESOLUTIONS if resolutions is None else resolutions)
    return verify_converge.converge(stage, verify_converge.checked_resolutions(levels), solver(progress))
