"""Percentiles and Sobol indices of samples, with confidence intervals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.study.records import Percentile, Share

CONFIDENCE = 0.95
MOST_BINS = 32  # of the range of a factor
FEW_LEVELS = 12  # most values of a factor that are groups by themselves


def percentiles(
    values: Array, percent: Sequence[float], draws: Index | None = None
) -> list[Percentile]:
    """Return percentiles, between 0 and 100, of a sample (n,) with their confidence intervals.

    draws : (n,), index from 0 of the independent draw to which each value belongs; None where each
    is its own draw.

    The number of draws below the true percentile is binomial, so that it lies between two order
    statistics with a probability known for every continuous distribution (H. A. David, H. N.
    Nagaraja, Order Statistics, 3rd ed., Wiley 2003, section 7.1); both tails are equal. Where
    values share a draw, the share below the percentile scatters from draw to draw (R. S. Woodruff,
    J. Am. Stat. Assoc. 47 (1952) 635)."""
    ordered = np.sort(values)
    results = []
    for p in percent:
        middle = float(np.percentile(ordered, p))
        if draws is None:
            first, last = _independent_ranks(len(values), p / 100)
        else:
            first, last = _dependent_ranks(values <= middle, draws, p / 100)
        low = -np.inf if first < 1 else float(ordered[first - 1])
        high = np.inf if last > len(values) else float(ordered[last - 1])
        results.append(Percentile(p, middle, low, high))
    return results


def _independent_ranks(n: int, share: float) -> tuple[int, int]:
    """Return the ranks, from 1, of the order statistics between which a percentile lies."""
    from scipy.stats import binom

    tail = (1 - CONFIDENCE) / 2
    return int(binom.ppf(tail, n, share)), int(binom.ppf(1 - tail, n, share)) + 1


def _dependent_ranks(
    below: AnyArray,
    draws: Index,
    share: float,
) -> tuple[int, int]:
    """Return the same for values (n,) of several draws, of which some are `below` the percentile."""
    from scipy.stats import norm

    n = len(below)
    excess = np.bincount(draws, below - share)
    m = int(np.sum(np.bincount(draws) > 0))
    width = float(n)
    if m > 1:
        width = norm.ppf((1 + CONFIDENCE) / 2) * np.sqrt(m / (m - 1) * np.sum(excess**2))
    return int(np.floor(n * share - width)), int(np.ceil(n * share + width)) + 1


def sobol_indices(values: Array, factors: int) -> Share:
    """Return first-order and total indices of values (base * (factors + 2),) in the order of
    Saltelli's scheme: A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2 (b) and
    (f)."""
    groups = values.reshape(-1, factors + 2)
    groups = groups - groups[:, [0, -1]].mean()
    A = groups[:, 0]
    AB = groups[:, 1:-1].T
    B = groups[:, -1]
    variance = np.var([A, B])
    first = np.mean(B * (AB - A), axis=1) / variance
    total = np.mean((A - AB) ** 2, axis=1) / (2 * variance)
    size = (A**2 + B**2) / 2
    first_band = _half_widths(B * (AB - A), size, first)
    total_band = _half_widths((A - AB) ** 2 / 2, size, total)
    return Share(first, first_band, total, total_band)


def first_order(factors: Iterable[Array], values: Array) -> Share:
    """Return first-order indices from any sample of values (n,); k `factors` (n,), one in memory at
    a time.

    An index is the share of the variance that a smooth curve in the factor explains (given-data
    estimation: E. Plischke, E. Borgonovo, C. L. Smith, Eur. J. Oper. Res. 226 (2013) 536; local
    polynomials: S. Da Veiga, F. Wahl, F. Gamboa, Technometrics 51 (2009) 452). The curve is a
    straight line in each of about n^(1/3) equally filled bins, or the mean for each value of a
    list. The share is `1 - s_r^2 / s^2`, both variances by their degrees of freedom, so that noise
    has no share on average. Shares of dependent factors overlap, because they include common
    effects."""
    n = len(values)
    size = (values - values.mean()) ** 2
    indices = []
    for column in factors:
        residual, parameters = _residual(column, values)
        unexplained = residual**2 * (n / (n - parameters))
        share = np.asarray(1.0 - unexplained.mean() / (size.sum() / (n - 1)))
        indices.append((float(share), float(_half_widths(size - unexplained, size, share))))
    return Share(*np.array(indices).T)


def _half_widths(
    parts: Array,
    size: Array,
    index: Array,
) -> Array:
    """Return half-widths (k,) of confidence intervals of indices (k,).

    Indices are means of parts (k, n) over that of size (n,). Normal and linearised: the variance of
    a ratio of means (W. G. Cochran, Sampling Techniques, 3rd ed., Wiley 1977)."""
    from scipy.special import ndtri

    deviation = (parts - index[..., None] * size) / size.mean()
    standard_error = deviation.std(axis=-1, ddof=1) / np.sqrt(len(size))
    return np.asarray(ndtri((1 + CONFIDENCE) / 2) * standard_error)


def _residual(column: Array, values: Array) -> tuple[Array, int]:
    """Return the residual of values (n,) about a curve in one factor (n,), and the number of its
    parameters.
    """
    levels, group = np.unique(column, return_inverse=True)
    piecewise_linear = len(levels) > FEW_LEVELS
    if piecewise_linear:
        bins = min(MOST_BINS, max(2, round(len(column) ** (1 / 3))))
        group = np.searchsorted(np.quantile(column, np.linspace(0, 1, bins + 1)[1:-1]), column)
    counts = np.maximum(np.bincount(group), 1)
    x, y = (v - (np.bincount(group, v) / counts)[group] for v in (column, values))
    if not piecewise_linear:
        return y, len(levels)
    square = np.bincount(group, x * x)
    slope = np.bincount(group, x * y) / np.where(square > 0, square, 1.0)
    return y - slope[group] * x, 2 * len(counts)
