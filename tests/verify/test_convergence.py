"""The error bar itself: on sequences whose limit is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flexfem.verify.convergence import CAUTIOUS, COARSER, ORDER, SAFETY, TRUSTED, grid_convergence, levels


def power_law(limit, slope, order, resolutions):
    return limit + slope * np.asarray(resolutions, dtype=float) ** -order


@given(
    limit=st.floats(-20, 20),
    slope=st.floats(-50, 50),
    order=st.floats(1.2, 5.5),
    resolutions=st.sampled_from([(4, 6, 8), (2, 3, 4), (9, 12, 16), (5, 7, 11), (4, 8, 16), (3, 4, 6, 8, 12)]),
)
def test_a_power_law_is_seen_through(limit, slope, order, resolutions):
    values = power_law(limit, slope, order, resolutions)
    assume(abs(values[-1] - values[-2]) > 1e-5)
    found = grid_convergence(resolutions, values)
    assert found.verdict == "converging"
    assert found.order == pytest.approx(order, rel=1e-4)
    assert found.extrapolated == pytest.approx(limit, abs=1e-4 * abs(values[-1] - limit) + 1e-9)
    assert found.band == pytest.approx(SAFETY * abs(values[-1] - limit), rel=1e-3)


def test_a_sequence_that_swings_gets_the_cautious_band():
    found = grid_convergence([4, 6, 8], [12.0, 12.6, 12.5])
    assert found.verdict == "oscillatory"
    assert found.band == pytest.approx(CAUTIOUS * 0.6 / ((8 / 6) ** ORDER - 1))
    assert found.band > abs(12.6 - 12.5)


@pytest.mark.parametrize("values", [[12.0, 12.1, 12.3], [12.0, 12.1, 12.2]])
def test_a_sequence_that_runs_away_is_called_divergent(values):
    found = grid_convergence([4, 6, 8], values)
    assert found.verdict == "divergent"
    assert found.band == pytest.approx(CAUTIOUS * abs(values[2] - values[1]) / ((8 / 6) ** ORDER - 1))


def test_an_order_too_good_to_be_true_is_not_used():
    found = grid_convergence([4, 6, 8], power_law(12.0, 4000.0, 9.0, [4, 6, 8]))
    assert found.verdict == "out of range"
    assert found.observed > TRUSTED[1] and found.order == ORDER


def test_round_off_is_no_mesh_error():
    found = grid_convergence([4, 6, 8], [3e-13, -2e-12, 1e-13])
    assert found.verdict == "round-off"
    assert np.isnan(found.observed)
    assert 0 < found.band <= 1e-8


@given(st.integers(4, 64))
def test_levels_are_far_enough_apart_and_end_with_the_one_asked_for(resolution):
    coarse, middle, fine = levels(resolution)
    assert fine == resolution
    assert coarse >= 2
    assert fine / middle >= COARSER and middle / coarse >= COARSER
