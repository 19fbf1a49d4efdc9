"""Slopes of a stage with other necks on a soft fixture, fitted to measured ones: least squares and profiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

from flexfem.arrays import AnyArray, Array
from flexfem.verify.result import Record

SOFTEST = 10.0  # of a fixture over the stage, where it is softest
DEPENDENT = 1e4  # condition number of the sensitivities, each over its size, beyond which data do not tell two apart
AT_END = 1e-6  # of the range of a number: as near to its end as one gets


class Estimate(Record):
    """A number that was fitted, and its interval; None where the data set it no end."""

    value: float
    low: float | None
    high: float | None


class SlopeProblem(NamedTuple):
    """Slopes (m,) with standard deviations as a function of an offset, mm, and p numbers of the fixture, from 0 on.

    axes : (m,), directions.   stage : spline of the logarithm of the compliance (m,) that is read, without the fixture.
    fixture : (m, p), compliance that each number adds by 1.   ends : (1 + p, 2), of offset and numbers.
    """

    axes: AnyArray
    slope: Array
    sd: Array
    stage: CubicSpline
    fixture: Array
    ends: Array

    def slopes(self, x: Array) -> Array:
        """Slopes (..., m) for numbers (..., 1 + p)."""
        return np.asarray(1 / (np.exp(self.stage(x[..., 0])) + x[..., 1:] @ self.fixture.T))  # in series

    def left(self, x: Array) -> Array:
        """Slopes less the measured ones, over their standard deviations (..., m)."""
        return np.asarray((self.slopes(x) - self.slope) / self.sd)

    def gradient(self, x: Array) -> Array:
        """Derivatives (m, 1 + p) of `left` at numbers (1 + p,)."""
        per = -(self.slopes(x) ** 2) / self.sd
        offset = np.exp(self.stage(x[0])) * self.stage(x[0], 1)
        return np.asarray(per[:, None] * np.column_stack([offset, self.fixture]))


class Fit(NamedTuple):
    """Numbers (1 + p,) and their chi square."""

    x: Array
    chi_square: float


def fit(of: SlopeProblem, fixed: Mapping[int, float], near: Array | None = None) -> Fit:
    """The numbers of least chi square, some of them fixed; looked for `near` some (1 + p,) when these are known."""
    free = [k for k in range(len(of.ends)) if k not in fixed]
    x = np.array([fixed.get(k, 0.0) for k in range(len(of.ends))])
    if not free:
        return Fit(x, float(np.sum(of.left(x) ** 2)))
    low, high = of.ends[free].T
    size = np.where(np.array(free) == 0, np.ptp(of.ends[0]), high / SOFTEST)
    x = x.copy()

    def at(part: Array) -> Array:
        x[free] = part * size
        return x

    starts = (
        [np.where(np.array(free) == 0, 0.0, share) for share in (0.02, 0.4)] if near is None else [near[free] / size]
    )
    ends, exact = (low / size, high / size), dict.fromkeys(("xtol", "ftol", "gtol"), 1e-12)
    tried = [
        least_squares(
            lambda part: of.left(at(part)),
            np.clip(start, *ends),
            jac=lambda part: of.gradient(at(part))[:, free] * size,
            bounds=ends,
            **exact,
        )
        for start in starts
    ]
    best = min(tried, key=lambda each: float(each.cost))
    return Fit(at(best.x), 2 * float(best.cost))


def interval(of: SlopeProblem, best: Fit, k: int, level: float) -> Estimate:
    """The profile-likelihood interval of one number; None where its end, or that of the offset, is the range's."""
    least = best.chi_square + float(chi2.ppf(level, 1))

    def above(value: float) -> float:
        return fit(of, {k: value}, best.x).chi_square - least

    found: list[float | None] = []
    for end in of.ends[k]:
        if k > 0 and end == 0 and above(0.0) <= 0:
            found.append(0.0)
        elif abs(end - best.x[k]) <= AT_END * np.ptp(of.ends[k]) or above(end) <= 0:
            found.append(None)
        else:
            value = float(brentq(above, best.x[k], end, xtol=1e-8 * float(np.ptp(of.ends[k]))))
            offset = fit(of, {k: value}, best.x).x[0]
            bounded = np.min(np.abs(of.ends[0] - offset)) > AT_END * np.ptp(of.ends[0])
            found.append(value if bounded else None)
    return Estimate(value=float(best.x[k]), low=found[0], high=found[1])


def _jacobian(of: SlopeProblem, x: Array) -> Array:
    """Sensitivities (m, 1 + p) of `left`, each column over its size."""
    J = of.gradient(x)
    return np.asarray(J / np.linalg.norm(J, axis=0))


def rank_of(of: SlopeProblem, x: Array) -> int:
    """How many combinations of the numbers the data depend on."""
    return int(np.linalg.matrix_rank(_jacobian(of, x), tol=1 / DEPENDENT))


def sensitivity(of: SlopeProblem, x: Array) -> tuple[float | None, float | None]:
    """Condition number and correlation, None where the data do not depend on the numbers independently."""
    J = _jacobian(of, x)
    if rank_of(of, x) < J.shape[1]:
        return None, None
    covariance = np.linalg.inv(J.T @ J)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    return float(np.linalg.cond(J)), float(correlation)
