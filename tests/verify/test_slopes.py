"""The slope of force over displacement: its value, and an interval that holds it as often as it says."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.verify.slopes import slope_of

STROKE = np.array([0.0, 1.0, 2.0, 3.5, 5.0])


def noisy(seed, command, force_sd, displacement_sd, slope=7.0):
    noise = np.random.default_rng(seed).normal(size=(2, len(command)))
    return 3.0 + slope * 0.4 * command + force_sd * noise[0], 0.2 + 0.4 * command + displacement_sd * noise[1]


def test_a_line_without_errors_has_its_slope_and_intercept():
    """Also when the command bends: it is only the instrument."""
    for command in (STROKE, STROKE**1.7):
        found = slope_of(STROKE, 2.0 + 7.0 * 0.4 * command, 0.4 * command, 0.95)
        assert found.slope == pytest.approx(7.0, rel=1e-12) and found.intercept == pytest.approx(2.0, rel=1e-10)
        assert found.low == pytest.approx(7.0, rel=1e-6) and found.high == pytest.approx(7.0, rel=1e-6)
        assert found.dof == 3


def test_the_interval_of_five_readings_holds_the_slope_in_95_per_cent_of_seeds():
    """Three degrees of freedom: with 1.96 for Student's 3.18 it would be 85 per cent, 850 of these."""
    held = 0
    for seed in range(1000):
        found = slope_of(STROKE, *noisy(seed, STROKE, 0.5, 0.07), 0.95)
        held += found.low <= 7.0 <= found.high
    assert 932 <= held <= 968


def test_errors_of_the_displacement_do_not_flatten_the_slope():
    """Its variance is a quarter of that of the displacements: a regression on it would be 20 % low."""
    command = np.linspace(0.0, 5.0, 40)
    sd = 0.5 * np.std(0.4 * command)
    found = [slope_of(command, *noisy(seed, command, 0.1, sd), 0.95).slope for seed in range(300)]
    assert np.median(found) == pytest.approx(7.0, rel=0.02)


def test_a_tenth_of_the_confidence_is_worth_its_share_of_the_width():
    """Student's quantiles of 18 degrees of freedom: 1.734 and 2.101."""
    command = np.linspace(0.0, 5.0, 20)
    wide, narrow = (slope_of(command, *noisy(3, command, 0.05, 0.0), level) for level in (0.95, 0.9))
    assert (wide.high - wide.low) / (narrow.high - narrow.low) == pytest.approx(2.101 / 1.734, rel=1e-3)


def test_readings_that_do_not_follow_the_command_bound_no_slope():
    found = slope_of(STROKE, *noisy(4, STROKE, 0.5, 20.0), 0.95)
    assert np.isnan([found.low, found.high]).all() and np.isfinite(found.slope)
    assert np.isnan(slope_of(STROKE, STROKE, np.zeros(5), 0.95).slope)
