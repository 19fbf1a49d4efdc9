"""One line of the benchmark table, and what several meshes say about a limit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Finding(NamedTuple):
    """A published or exact target beside our value.

    name : the benchmark.   source : citation of the target.   quantity : what is compared, with its unit.
    target_uncertainty : how well the target itself is known, in its unit; zero for exact ones.
    difference : ours minus target.   allowed : the largest difference that passes, in the unit of the target.
    unknowns : equations solved for `ours`, on the finest mesh.   note : what else is worth knowing.
    """

    name: str
    source: str
    quantity: str
    target: float
    target_uncertainty: float
    ours: float
    difference: float
    allowed: float
    unknowns: int
    passed: bool
    note: str


def finding(
    name: str,
    source: str,
    quantity: str,
    target: float,
    ours: float,
    allowed: float,
    *,
    uncertainty: float = 0.0,
    unknowns: int = 0,
    note: str = "",
) -> Finding:
    """Compare `ours` with a target; passed when they differ by at most `allowed`, and never for nan."""
    difference = float(ours) - target
    passed = bool(abs(difference) <= allowed)
    return Finding(
        name, source, quantity, target, uncertainty, float(ours), difference, allowed, int(unknowns), passed, note
    )


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
