"""The slope of force over displacement when both are read with errors, and its confidence interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats

from flexfem.arrays import Array


class Slope(NamedTuple):
    """A slope with its confidence interval, nan where the readings bound none.

    intercept : of the force at no displacement.   dof : degrees of freedom of the interval.
    """

    slope: float
    low: float
    high: float
    intercept: float
    dof: int


def slope_of(command: Array, force: Array, displacement: Array, confidence: float) -> Slope:
    """Slope of force (n,) over displacement (n,), both read with errors, at known commands (n,).

    Parameters
    ----------
    command : of the actuator, any unit; it need not be linear in force or displacement.
    confidence : of the interval, 0 to 1.

    Notes
    -----
    A regression of one reading on the other is biased by the errors of the latter. The command has none, so it is the
    instrument: K is the ratio of the slopes of both readings over the command, `K = b_F / b_q`. The interval is
    Fieller's: all K for which `F - K q` has, by Student's t with n - 2 degrees of freedom, no slope over the command,
    `(b_F - K b_q)^2 <= t^2 (S_FF - 2 K S_Fq + K^2 S_qq) / ((n - 2) S_ss)`, S the sums of squares and products of what
    the regressions on the command leave. It is exact for normal errors, independent from one command to the next, of
    unknown variances. E. C. Fieller, J. Roy. Statist. Soc. B 16, 175-185 (1954).
    """
    s = command - np.mean(command)
    readings = np.stack([force, displacement])
    b = readings @ s / (s @ s)
    left = readings - np.mean(readings, axis=1, keepdims=True) - np.outer(b, s)
    S, dof = left @ left.T, len(command) - 2
    g = stats.t.ppf((1 + confidence) / 2, dof) ** 2 / (dof * (s @ s))
    a, half, c = b[1] ** 2 - g * S[1, 1], b[0] * b[1] - g * S[0, 1], b[0] ** 2 - g * S[0, 0]
    slope = float(b[0] / b[1]) if b[1] else float("nan")
    root = np.sqrt(max(half**2 - a * c, 0.0))
    low, high = ((half - root) / a, (half + root) / a) if a > 0 else (np.nan, np.nan)
    return Slope(slope, float(low), float(high), float(np.mean(force) - slope * np.mean(displacement)), dof)
