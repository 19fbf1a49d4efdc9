"""What validation finds: lines of the benchmark table with their orders and limits, and answers of other solvers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array


class Finding(NamedTuple):
    """A published or exact target beside our value.

    name : the benchmark.   source : citation of the target.   quantity : what is compared, with its unit.
    allowed : the largest difference that passes, in the unit of the target.
    target_uncertainty : how well the target itself is known, in its unit; zero for exact ones.
    unknowns : equations solved for `ours`, on the finest mesh.   note : what else is worth knowing.
    """

    name: str
    source: str
    quantity: str
    target: float
    ours: float
    allowed: float
    target_uncertainty: float = 0.0
    unknowns: int = 0
    note: str = ""

    @property
    def difference(self) -> float:
        """Ours minus target."""
        return float(self.ours) - self.target

    @property
    def passed(self) -> bool:
        """Whether they differ by at most `allowed`, and never for nan."""
        return bool(abs(self.difference) <= self.allowed)


def order(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Observed order: slope of the straight line through the logarithms of errors over those of mesh sizes."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def extrapolated(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Limit of the last three values for size zero; sizes must shrink by one ratio (Richardson with observed order).

    The finest value itself when the three do not converge monotonically.
    """
    first, second, third = values[-3:]
    if not np.isclose(sizes[-3] / sizes[-2], sizes[-2] / sizes[-1], rtol=1e-6):
        raise ValueError(f"sizes {sizes} do not shrink by one ratio")
    change = (second - first) / (third - second)
    return third + (third - second) / (change - 1) if change > 1 else third


class Check(NamedTuple):
    """One comparison: the largest relative difference, and the most allowed, None where it is only stated."""

    quantity: str
    difference: float
    allowed: float | None

    @property
    def passed(self) -> bool:
        """Not too far apart; not a number is too far."""
        return self.allowed is None or self.difference <= self.allowed


class Answer(NamedTuple):
    """Another solver's answer to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    version : of the solver.
    compliance : (3, 3), mm and rad per N and N mm; column j is the pose under unit load j.
    fields : (3, n, 2), mm, displacement of every node, in the order of the mesh.
    stress : (3, n, 3), MPa, as xx, yy, xy at the nodes, averaged over the triangles around each, by the solver's own
        means.
    seconds : from the mesh to these arrays.
    """

    version: str
    compliance: Array
    fields: Array
    stress: Array
    seconds: float
