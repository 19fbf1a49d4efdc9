"""Percentiles of a sample, each with the interval that holds the true one, whatever the distribution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binom, norm

from flexfem.arrays import AnyArray, Array, Index

CONFIDENCE = 0.95


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
