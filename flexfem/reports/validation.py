"""Finite elements against other programs and published problems."""

from __future__ import annotations

from collections.abc import Sequence

from flexfem import arguments
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.reports.given import RESOLUTION, Progress
from flexfem.validate import compare, compare_solid
from flexfem.validate.compare import CrossCheck
from flexfem.validate.registry import BenchmarkTable, run_benchmarks


def cross_check(
    stage: Stage, solver: str = "ngsolve", resolution: int | None = None, three_dimensional: bool = False
) -> CrossCheck:
    """Solve the same mesh by another program, ngsolve or calculix, and compare, natural frequencies too.

    Parameters
    ----------
    resolution : triangles across every neck; by default 8, or 2 in three dimensions, with two layers.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the solver is not known or not installed.
    """
    check_feasible(stage)
    if three_dimensional:
        coarse = compare_solid.RESOLUTION if resolution is None else resolution
        return compare_solid.cross_check_solid(stage, arguments.resolution(coarse), solver)
    return compare.cross_check(stage, arguments.resolution(RESOLUTION if resolution is None else resolution), solver)


def benchmark(names: Sequence[str] | None = None, progress: Progress | None = None) -> BenchmarkTable:
    """Solve published problems with known answers, each with its source.

    Parameters
    ----------
    names : of `BenchmarkTable.seconds`; None takes all.   progress : called with a line after each.

    Raises
    ------
    BadInput
        A name is not known.
    ComputationFailed
        As `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.benchmark(["patch-test"]).passed
    True
    """
    if names is not None and not isinstance(names, Sequence):
        raise BadInput(f"names {names!r}, expected names of benchmarks")
    return run_benchmarks(names, progress)
