"""The error bar itself: on sequences whose limit is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flexfem.paper import convergence
from flexfem.paper.stage import load_stage
from flexfem.questions.bands import grid_convergence, levels, mesh_band, stress_bands
from flexfem.questions.convergence import converge

from ..conftest import ROOT


def power_law(limit, slope, order, resolutions):
    return limit + slope * np.asarray(resolutions, dtype=float) ** -order


@given(
    limit=st.floats(-20, 20),
    slope=st.floats(-50, 50),
    order=st.floats(1.2, 5.5),
    resolutions=st.sampled_from(
        [(4, 6, 8), (2, 3, 4), (9, 12, 16), (5, 7, 11), (4, 8, 16), (3, 4, 6, 8, 12)]
    ),
)
def test_a_power_law_is_seen_through(limit, slope, order, resolutions):
    values = power_law(limit, slope, order, resolutions)
    assume(abs(values[-1] - values[-2]) > 1e-5)
    found = grid_convergence(resolutions, values)
    assert found.verdict == "converging"
    assert found.order == pytest.approx(order, rel=1e-4)
    assert found.extrapolated == pytest.approx(limit, abs=1e-4 * abs(values[-1] - limit) + 1e-9)
    assert found.band == pytest.approx(1.25 * abs(values[-1] - limit), rel=1e-3)


def test_celik_2008_worked_example_of_table_1():
    """I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001, Table 1, reattachment length on 18000,
    8000, 4500 cells.
    """
    found = grid_convergence(np.sqrt([4500, 8000, 18000]), [5.863, 5.972, 6.063])
    assert found.verdict == "converging"
    assert found.order == found.observed == pytest.approx(1.53, abs=0.005)
    assert found.extrapolated == pytest.approx(6.1685, abs=5e-5)
    assert 100 * found.band / 6.063 == pytest.approx(
        2.2, abs=0.05
    )  # the fine-grid convergence index, per cent


@pytest.mark.parametrize(
    ("middle", "last", "verdict", "larger"),
    [
        (12.6, 12.5, "oscillatory", 0.6),
        (12.1, 12.3, "divergent", 0.2),
        (12.1, 12.2, "divergent", 0.1),
    ],
)
def test_a_sequence_that_swings_or_runs_away_gets_the_cautious_band(middle, last, verdict, larger):
    found = grid_convergence([4, 6, 8], [12.0, middle, last])
    assert found.verdict == verdict and found.order == 4.0
    assert found.band == pytest.approx(
        3.0 * larger * 81 / 175
    )  # of the larger difference, r^4 - 1 = 175 / 81
    assert found.extrapolated == pytest.approx(last + (last - middle) * 81 / 175)


@pytest.mark.parametrize(
    ("order", "trusted"), [(0.98, False), (1.02, True), (5.98, True), (6.02, False)]
)
def test_an_order_is_used_from_one_to_six(order, trusted):
    values = power_law(12.0, -30.0, order, [4, 8, 16])
    found = grid_convergence([4, 8, 16], values)
    assert found.verdict == ("converging" if trusted else "out of range")
    assert found.observed == pytest.approx(order, rel=1e-6)
    factor, used = (1.25, order) if trusted else (3.0, 4.0)
    assert found.order == pytest.approx(used, rel=1e-6)
    assert found.band == pytest.approx(factor * (values[2] - values[1]) / (2**used - 1), rel=1e-5)


def test_round_off_is_no_mesh_error():
    found = grid_convergence([4, 6, 8], [3e-13, -2e-12, 1e-13])
    assert found.verdict == "round-off"
    assert np.isnan(found.observed)
    assert found.band == 1e-8
    for size in (0.2, 700.0):  # relative to the value where that is more than one
        noise = 1e-8 * max(size, 1.0)
        below, above = (
            grid_convergence([4, 6, 8], size + noise * np.array([0.0, 0.4, e]))
            for e in (1.38, 1.42)
        )
        assert below.verdict == "round-off" and above.verdict != "round-off"
        assert below.band == pytest.approx(noise, rel=1e-6)


@given(st.integers(4, 64))
def test_levels_are_far_enough_apart_and_end_with_the_one_asked_for(resolution):
    coarse, middle, fine = levels(resolution)
    assert fine == resolution
    assert coarse >= 2
    assert fine / middle >= 1.3 and middle / coarse >= 1.3


PATH = ROOT / "geometry" / "mobility6.toml"
LIMIT = np.array([0.025, 0.020, 2e-5])
RATE = np.array([-0.3, -0.5, -0.9])
ORDER = np.array([2.0, 3.0, 4.0])


def solved(_, resolution):
    compliance = np.diag(LIMIT * (1 + RATE * float(resolution) ** -ORDER))
    return SimpleNamespace(
        compliance=compliance, unknowns=100 * resolution, triangles=40 * resolution
    )


def test_each_direction_has_its_own_values_order_limit_and_band(monkeypatch):
    monkeypatch.setattr(convergence, "solved", solved)
    made = converge(load_stage(PATH), resolutions=[4, 6, 8])
    expected = LIMIT * (1 + RATE * np.array([[4.0], [6], [8]]) ** -ORDER)
    np.testing.assert_allclose(made.along, expected, rtol=1e-12)
    np.testing.assert_allclose(made.order, ORDER, rtol=1e-5)
    np.testing.assert_allclose(made.extrapolated, LIMIT, rtol=1e-6)
    np.testing.assert_allclose(
        made.band("along")[-1], 1.25 * LIMIT * abs(RATE) * 8.0**-ORDER, rtol=1e-4
    )
    assert made.verdicts == ["converging"] * 3 and made.resolutions == [4, 6, 8]
    np.testing.assert_array_equal(made.unknowns, [400, 600, 800])
    assert converge(load_stage(PATH), resolutions=[10, 13, 17]).resolutions == [
        10,
        13,
        17,
    ]  # 1.3 times the one before


def test_the_band_of_a_highest_stress_holds_it_where_the_finest_two_meshes_happen_to_agree():
    """Amplitudes for a wanted life, um, of a stage that was designed; 104.935 on 32 triangles
    across a neck.
    """
    values = np.array([105.0301244, 104.9037667, 104.9011796])
    band = stress_bands(np.array([4.0, 6.0, 8.0]), values)
    assert band == pytest.approx(3 * 0.1263577 / (8**3 / 4**3 - 8**3 / 6**3), rel=1e-6)
    assert 0.034 < band < 0.1
    assert mesh_band(np.array([4.0, 6.0, 8.0]), values) < 0.006
