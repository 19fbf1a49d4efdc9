"""What a sample says of its values: percentiles with their intervals, and Sobol indices of the factors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import binom, norm

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import BadInput
from flexfem.study.outputs import CROSS, DRIFTS, PARTS, STIFFNESSES, round_off_of

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy

CONFIDENCE = 0.95
LEAST = 100  # designs, for indices from one plain sample; of 60, an interval of 95 % held in 86 %
MOST_BINS = 32  # of a factor's range
FEW_LEVELS = 12  # values of a factor that are groups by themselves
FLAT = 1e-9  # spread over size: round-off of a value that no factor changes


class Percentile(NamedTuple):
    """A percentile of a sample and its confidence interval; an end is infinite where the sample is too small for it."""

    percent: float
    value: float
    low: float
    high: float


def percentiles(
    values: Array, percent: Sequence[float], draws: Index | None = None, confidence: float = CONFIDENCE
) -> list[Percentile]:
    """Percentiles of a sample and their distribution-free confidence intervals.

    Parameters
    ----------
    values : (n,), at least one, finite, in any order.
    percent : between 0 and 100, both excluded.
    draws : (n,), number of the independent draw that each value belongs to, from 0; None when each is its own.
    confidence : least probability that an interval holds the true percentile; about that with `draws`.

    Notes
    -----
    Of n draws, the number below the true percentile is binomial, so that the true percentile lies between two order
    statistics with a probability known for every continuous distribution (H. A. David, H. N. Nagaraja, Order
    Statistics, 3rd ed., Wiley 2003, section 7.1). Half of what is left is allowed on each side. Where values share a
    draw, the share below the percentile scatters from draw to draw (R. S. Woodruff, J. Am. Stat. Assoc. 47 (1952) 635).
    """
    ordered = np.sort(values)
    found = []
    for p in percent:
        middle = float(np.percentile(ordered, p))
        if draws is None:
            first, last = _binomial_ranks(len(values), p / 100, confidence)
        else:
            first, last = _shared_ranks(values <= middle, p / 100, draws, confidence)
        found.append(Percentile(p, middle, _ranked(ordered, first), _ranked(ordered, last)))
    return found


def _ranked(ordered: Array, rank: int) -> float:
    """The value of a rank from 1 to n; infinite below and above."""
    return -np.inf if rank < 1 else np.inf if rank > len(ordered) else float(ordered[rank - 1])


def _binomial_ranks(n: int, share: float, confidence: float) -> tuple[int, int]:
    tail = (1 - confidence) / 2
    return int(binom.ppf(tail, n, share)), int(binom.ppf(1 - tail, n, share)) + 1


def _shared_ranks(below: AnyArray, share: float, draws: Index, confidence: float) -> tuple[int, int]:
    n, excess = len(below), np.bincount(draws, below - share)
    m = int(np.sum(np.bincount(draws) > 0))
    if m < 2:
        return 0, n + 1
    spread = float(norm.ppf((1 + confidence) / 2) * np.sqrt(m / (m - 1) * np.sum(excess**2)))
    return max(int(np.floor(n * share - spread)), 0), min(int(np.ceil(n * share + spread)) + 1, n + 1)


class Indices(NamedTuple):
    """Sobol indices of one value, (k,) in the order of the factors, and half-widths of their confidence intervals.

    `total` and `total_band` are None where the sample does not tell them.
    """

    first: Array
    first_band: Array
    total: Array | None = None
    total_band: Array | None = None


def sensitivity(loaded: LoadedStudy, table: StudyTable, value: str) -> Indices:
    """Sobol indices of an output column: first order, and total where Saltelli's scheme was sampled.

    Raises
    ------
    BadInput
        The study is not sampled for it; a design of Saltelli's scheme has no answer (each belongs to as many
        differences as there are factors, so that none can be left out); too few have one; or the value does not vary.
    """
    where = f"{loaded.path}: sensitivity of {value}"
    method = loaded.study.sampling.method
    if method == "grid":
        raise BadInput(f'{where}: sampling.method = "grid", expected "saltelli", or a random sample')
    if method == "saltelli":
        _require_whole(loaded, table, where)
    (answers,) = table.answered(value)
    if len(answers) < LEAST and method != "saltelli":
        raise BadInput(f"{where}: {len(answers)} designs have an answer, expected at least {LEAST}")
    if np.ptp(answers) <= FLAT * scale_of(table, value):
        raise BadInput(f"{where}: no factor changes it, expected a value that varies")
    if method == "saltelli":
        return sobol_indices(answers, len(loaded.columns))
    return first_order((table.answered(column.name)[0] for column in loaded.columns), answers)


def _require_whole(loaded: LoadedStudy, table: StudyTable, where: str) -> None:
    if missing := loaded.count - len(table.design):
        raise BadInput(f"{where}: {missing} of {loaded.count} designs are not computed, expected all")
    bad = np.flatnonzero(~table.ok)
    if len(bad):
        first = bad[0]
        raise BadInput(
            f"{where}: {len(bad)} of {loaded.count} designs have no answer, expected all to have one; the first is "
            f"design {table.design[first]}: {table.status[first]}: {table.reason[first]}"
        )


def sobol_indices(answers: Array, factors: int) -> Indices:
    """First-order and total indices of answers (base * (factors + 2),) in the order of `sampling`'s Saltelli scheme.

    Notes
    -----
    A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2 (b) and (f); intervals as `_half_widths`.
    """
    from scipy.stats import sobol_indices as estimated

    groups = answers.reshape(-1, factors + 2)
    groups = groups - groups[:, [0, -1]].mean()
    A, AB, B = groups[:, 0], groups[:, 1:-1].T, groups[:, -1]
    padded = np.concatenate([AB, A[None]])[:, None]  # one that changes nothing: scipy asks for two factors
    found = estimated(func={"f_A": A[None], "f_B": B[None], "f_AB": padded}, n=len(A))
    size = (A**2 + B**2) / 2
    first, total = found.first_order[:factors], found.total_order[:factors]
    return Indices(first, _half_widths(B * (AB - A), size, first), total, _half_widths((A - AB) ** 2 / 2, size, total))


def first_order(factors: Iterable[Array], answers: Array) -> Indices:
    """First-order indices from any sample: k `factors` (n,), of which one is held at a time, and answers (n,).

    Notes
    -----
    What a smooth curve in one factor alone explains of the variance (given-data estimation: E. Plischke, E. Borgonovo,
    C. L. Smith, Eur. J. Oper. Res. 226 (2013) 536; local polynomials: S. Da Veiga, F. Wahl, F. Gamboa, Technometrics 51
    (2009) 452). The curve is a straight line in each of about n^(1/3) equally filled bins, or the mean of each value of
    a list; `1 - s_r^2 / s^2`, both variances by their degrees of freedom, so that noise explains nothing on average.
    Of factors that depend on one another the shares overlap: what a factor explains through the others counts too.
    """
    size = (answers - answers.mean()) ** 2
    found = [_explained(column, answers, size) for column in factors]
    return Indices(*(np.array(part) for part in zip(*found, strict=True)))


def _explained(column: Array, answers: Array, size: Array) -> tuple[float, float]:
    """Share of the variance, squares `size` (n,), that a curve in one factor explains, and its half-width."""
    residual, numbers = _residual(column, answers)
    n = len(answers)
    left = residual**2 * (n / (n - numbers))
    share = np.asarray(1.0 - left.mean() / (size.sum() / (n - 1)))
    return float(share), float(_half_widths(size - left, size, share))


def _half_widths(parts: Array, size: Array, index: Array) -> Array:
    """Half-widths (k,) of confidence intervals of indices (k,): means of parts (k, n) over that of size (n,).

    Notes
    -----
    Normal, linearised: the variance of a ratio of means (W. G. Cochran, Sampling Techniques, 3rd ed., Wiley 1977).
    """
    off = (parts - index[..., None] * size) / size.mean()
    return np.asarray(norm.ppf((1 + CONFIDENCE) / 2) * off.std(axis=-1, ddof=1) / np.sqrt(len(size)))


def _residual(column: Array, answers: Array) -> tuple[Array, int]:
    """What a curve in one factor (n,) leaves of the answers (n,), and how many numbers the curve has."""
    n = len(column)
    levels, group = np.unique(column, return_inverse=True)
    lines = len(levels) > FEW_LEVELS
    if lines:
        bins = min(MOST_BINS, max(2, round(n ** (1 / 3))))
        group = np.searchsorted(np.quantile(column, np.linspace(0, 1, bins + 1)[1:-1]), column)
    counts = np.maximum(np.bincount(group), 1)
    x, y = (v - (np.bincount(group, v) / counts)[group] for v in (column, answers))
    if not lines:
        return y, len(levels)
    spread = np.bincount(group, x * x)
    slope = np.bincount(group, x * y) / np.where(spread > 0, spread, 1.0)
    return y - slope[group] * x, 2 * len(counts)


def round_off_in(table: StudyTable, value: str) -> float:
    """Up to which size numbers of a column are round-off of what symmetry makes zero, beside medians of the others."""
    if value not in {*CROSS, *PARTS, *DRIFTS[:2]} or not table.ok.any():
        return 0.0
    beside = [name for name in (*STIFFNESSES[:3], *DRIFTS) if name in table.columns]
    medians = {n: np.median(np.abs(v), keepdims=True) for n, v in zip(beside, table.answered(*beside), strict=True)}
    return float(round_off_of(medians)[value].max())


def scale_of(table: StudyTable, value: str) -> float:
    """Size against which a change of an output is round-off or not.

    A stiffness between two directions and a coupling are zero by symmetry where they do not vary; what they are
    measured by is the stiffness along the two.
    """
    if value.startswith("coupling_"):
        return 1.0
    if value in CROSS:
        one, other = CROSS[value]
        return float(np.sqrt(np.median(table.columns[one] * table.columns[other])))
    return float(np.abs(table.columns[value]).max())
