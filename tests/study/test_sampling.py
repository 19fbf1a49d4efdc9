"""Samples: the same whatever range is asked, and of the distributions they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import stats

from flexfem.study.loaded import sample

METHODS = {
    "grid": 'method = "grid"',
    "latin hypercube": 'method = "latin_hypercube"\ndesigns = 2500\nseed = 3',
    "sobol": 'method = "sobol"\ndesigns = 2500\nseed = 3',
    "monte carlo": 'method = "monte_carlo"\ndesigns = 2500\nseed = 3',
    "saltelli": 'method = "saltelli"\nbase = 512\nseed = 3',
}
RANDOM = [name for name in METHODS if name != "grid"]
LOG = 'key = "hinges.base.neck_mm"\nfrom = 0.1\nto = 0.9\nscale = "log"'
LIST = 'key = "thickness_mm"\nvalues = [5.0, 6.5, 11.0]'
BELL = 'key = "material.youngs_modulus_gpa"\ndistribution = "normal"\nsd = 2.0\nlower = 67.0\nupper = 71.5'
P_VALUE = 1e-4  # of a Kolmogorov-Smirnov test with a fixed seed


def of_method(studies: Any, name: str) -> Any:
    points = "\npoints = 61" if name == "grid" else ""
    third = 'key = "platform.radius_mm"\nfrom = 15.0\nto = 17.0'
    return studies.of(METHODS[name], LOG + points, third + points)


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ends=st.lists(st.integers(0, 2500), min_size=3, max_size=3).map(sorted))
def test_a_range_is_the_same_however_it_is_cut(name: str, ends: list[int], studies: Any) -> None:
    loaded = of_method(studies, name)
    a, b, c = (min(end, loaded.count) for end in ends)
    whole = sample(loaded, a, c)
    np.testing.assert_array_equal(
        whole, np.concatenate([sample(loaded, a, b), sample(loaded, b, c)])
    )
    assert whole.shape == (c - a, 2)


@pytest.mark.parametrize("name", RANDOM)
def test_the_seed_decides_and_nothing_else(name: str, studies: Any) -> None:
    one = sample(of_method(studies, name), 0, 300)
    again = sample(of_method(studies, name), 0, 300)
    other = sample(studies.of(METHODS[name].replace("seed = 3", "seed = 4"), LOG, LIST), 0, 300)
    np.testing.assert_array_equal(one, again)
    assert not np.any(one[:, 0] == other[:, 0])


def test_each_stratum_of_a_latin_hypercube_is_hit_once_per_factor(studies: Any) -> None:
    loaded = studies.of('method = "latin_hypercube"\ndesigns = 250\nseed = 3', LOG, BELL)
    found = sample(loaded, 0, 250)
    share = stats.truncnorm.cdf(
        found[:, 1], (67.0 - 68.3) / 2, (71.5 - 68.3) / 2, loc=68.3, scale=2.0
    )
    for quantile in (np.log(found[:, 0] / 0.1) / np.log(9.0), share):
        assert sorted((250 * quantile).astype(int)) == list(range(250))


@pytest.mark.parametrize(
    ("distribution", "expected"),
    [
        ('"normal"\nmean = 16.0\nsd = 0.5', stats.norm(16.0, 0.5)),
        ('"normal"\nmean = 16.0\nsd = 0.5\nlower = 15.7', stats.truncnorm(-0.6, np.inf, 16.0, 0.5)),
        (
            '"normal"\nmean = 16.0\nsd = 0.5\nlower = 15.7\nupper = 16.8',
            stats.truncnorm(-0.6, 1.6, 16.0, 0.5),
        ),
        ('"uniform"\nlower = 15.0\nupper = 17.0', stats.uniform(15.0, 2.0)),
    ],
)
def test_a_sample_has_the_distribution_that_is_asked(
    distribution: str, expected: Any, studies: Any
) -> None:
    radius = f'key = "platform.radius_mm"\ndistribution = {distribution}'
    found = sample(
        studies.of('method = "monte_carlo"\ndesigns = 40000\nseed = 11', LIST, radius), 0, 40_000
    )
    counts = [np.sum(found[:, 0] == value) for value in (5.0, 6.5, 11.0)]
    assert sum(counts) == 40_000 and stats.chisquare(counts).pvalue > P_VALUE
    assert stats.kstest(found[:, 1], expected.cdf).pvalue > P_VALUE


def test_saltelli_rows_are_in_the_order_that_the_analysis_expects(studies: Any) -> None:
    """A, then A with one column of B at a time, then B: A and B are the halves of one Sobol point."""
    loaded = studies.of(
        'method = "saltelli"\nbase = 16\nseed = 3',
        LOG,
        LIST.replace("[5.0, 6.5, 11.0]", "[5.0, 6.0]"),
        'key = "platform.radius_mm"\nfrom = 15.0\nto = 17.0',
    )
    groups = sample(loaded, 0, loaded.count).reshape(16, 5, 3)
    A = groups[:, 0]
    B = groups[:, 4]
    for column in range(3):
        mixed = A.copy()
        mixed[:, column] = B[:, column]
        np.testing.assert_array_equal(groups[:, 1 + column], mixed)
    points = stats.qmc.Sobol(6, scramble=True, rng=np.random.default_rng(3)).random(16)
    np.testing.assert_allclose(
        np.column_stack([A[:, 2], B[:, 2]]), 15.0 + 2.0 * points[:, [2, 5]], rtol=1e-15
    )


@pytest.mark.parametrize("name", ["sobol", "monte carlo", "saltelli"])
def test_a_larger_sample_begins_with_the_smaller_one(name: str, studies: Any) -> None:
    small = of_method(studies, name)
    text = METHODS[name].replace("2500", "5003").replace("512", "1024")
    large = studies.of(text, LOG, 'key = "platform.radius_mm"\nfrom = 15.0\nto = 17.0')
    assert large.count > small.count
    np.testing.assert_array_equal(sample(large, 0, small.count), sample(small, 0, small.count))


def test_no_quantile_is_infinite_whatever_the_seed_draws(
    studies: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A generator may return exactly zero, where a normal distribution has its end."""
    loaded = studies.of('method = "sobol"\ndesigns = 8\nseed = 3', BELL.split("\nlower")[0])
    monkeypatch.setattr(
        "flexfem.study.sampling._sobol", lambda *_: np.array([[0.0], [1.0 - 2.0**-54]])
    )
    assert np.all(np.isfinite(sample(loaded, 0, 2)))


def test_a_grid_counts_its_last_factor_fastest(studies) -> None:
    """As the schema says of `grid`; 2 x 3 points, so that no other order looks alike."""
    neck = 'key = "hinges.base.neck_mm"\nvalues = [0.5, 0.4]'
    thickness = 'key = "thickness_mm"\nfrom = 8.0\nto = 18.0\npoints = 3\nscale = "log"'
    loaded = studies.of('method = "grid"', neck, thickness)
    rows = [[0.5, 8.0], [0.5, 12.0], [0.5, 18.0], [0.4, 8.0], [0.4, 12.0], [0.4, 18.0]]
    np.testing.assert_allclose(sample(loaded, 0, 6), rows, rtol=1e-12)
