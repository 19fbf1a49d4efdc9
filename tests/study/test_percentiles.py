"""Percentiles and how sure they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, norm

from flexfem.study.findings import percentiles


@pytest.mark.parametrize(("n", "percent"), [(59, 10.0), (400, 2.5), (401, 50.0), (2000, 97.5)])
def test_ranks_have_the_binomial_probability(n: int, percent: float) -> None:
    (found,) = percentiles(np.arange(1.0, n + 1)[::-1], [percent])  # the k-th smallest is k
    chance = binom(n, percent / 100)
    assert chance.cdf(found.high - 1) - chance.cdf(found.low - 1) >= 0.95
    assert chance.cdf(found.low - 1) <= 0.025 < chance.cdf(found.low)  # and no rank nearer does
    assert chance.sf(found.high - 1) <= 0.025 < chance.sf(found.high - 2)


def test_intervals_of_shared_draws_hold_the_true_percentile_as_often_as_they_say() -> None:
    rng = np.random.default_rng(11)
    draws, hits, repeats = np.repeat(np.arange(150), 5), [], 400
    truth = np.sqrt(1.25) * float(norm.ppf(0.9))
    for _ in range(repeats):
        values = np.repeat(rng.normal(size=150), 5) + 0.5 * rng.normal(size=750)
        (found,) = percentiles(values, [90.0], draws)
        hits.append(found.low <= truth <= found.high)
    assert abs(np.mean(hits) - 0.95) <= 4 * np.sqrt(0.05 * 0.95 / repeats)  # four standard deviations


def test_an_interval_is_open_where_the_sample_is_too_small_for_it() -> None:
    low, middle, high = percentiles(np.linspace(0.0, 1.0, 40), [2.5, 50.0, 97.5])
    assert low.low == -np.inf and high.high == np.inf
    assert 0 < middle.low < middle.value == 0.5 < middle.high < 1
    (one,) = percentiles(np.array([3.7]), [50.0], np.array([0]))
    assert (one.low, one.value, one.high) == (-np.inf, 3.7, np.inf)
