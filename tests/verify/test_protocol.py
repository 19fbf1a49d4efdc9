"""Section V: the comparison itself, apart from the two models that it compares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flexfem.units import DIRECTIONS
from flexfem.verify.errors import compare

ROUND_OFF = 1e-9  # per cent; products of 3 x 3 matrices with entries of order one

UNIT = st.floats(-1, 1, allow_subnormal=False)


def definite(entries: np.ndarray) -> np.ndarray:
    return entries @ entries.T + np.eye(3)


@pytest.mark.parametrize("direction", DIRECTIONS)
@given(arrays(float, (3, 3), elements=UNIT))
def test_two_models_that_agree_show_no_error(direction, entries):
    stiffness = definite(entries)
    found = compare(stiffness, np.linalg.inv(stiffness), direction, np.linspace(-0.3, 0.3, 7), 24.0)
    assert np.max(np.abs(found.percent)) < ROUND_OFF
    assert np.max(np.abs(found.error)) < ROUND_OFF


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_finite_elements_softer_by_a_tenth_move_ten_per_cent_further_and_not_across(direction):
    stiffness = np.diag([40.0, 50.0, 46000.0])
    found = compare(stiffness, 1.1 * np.linalg.inv(stiffness), direction, np.linspace(-1e-3, 1e-3, 5), 24.0)
    expected = 10.0 * np.eye(3)[DIRECTIONS.index(direction)]
    np.testing.assert_allclose(found.percent, expected, atol=ROUND_OFF)


def test_force_is_stiffness_times_command():
    stiffness = np.array([[41.0, 3.0, 5.0], [3.0, 52.0, 7.0], [5.0, 7.0, 46000.0]])
    found = compare(stiffness, np.eye(3), "y", np.array([-2.0, 0.0, 2.0]), 24.0)
    np.testing.assert_allclose(found.force, [[-6.0, -104.0, -14.0], [0.0] * 3, [6.0, 104.0, 14.0]])  # (18)


def test_error_is_finite_element_displacement_minus_commanded():
    found = compare(np.diag([1.0, 1.0, 1.0]), np.diag([1.25, 1.0, 1.0]), "x", np.array([-0.4, 0.0, 0.4]), 24.0)
    np.testing.assert_allclose(found.error[:, 0], [-0.1, 0.0, 0.1])


def test_cross_errors_are_made_comparable_by_the_lever():
    lever, command = 24.0, 2e-3
    compliance = np.eye(3)
    compliance[0, 2] = compliance[2, 0] = 0.06
    turned_by_push = compare(np.eye(3), compliance, "x", np.array([0.0, command]), lever)
    pushed_by_turn = compare(np.eye(3), compliance, "theta", np.array([0.0, command]), lever)
    assert turned_by_push.percent[2] == pytest.approx(100 * 0.06 * lever)  # rotation times l3 over translation
    assert pushed_by_turn.percent[0] == pytest.approx(100 * 0.06 / lever)  # translation over rotation times l3


def test_percentage_does_not_depend_on_the_amplitude():
    stiffness, compliance = np.diag([2.0, 3.0, 5.0]), np.diag([0.6, 0.3, 0.2])
    small, large = (compare(stiffness, compliance, "x", np.linspace(-a, a, 3), 24.0).percent for a in (1e-9, 1e3))
    np.testing.assert_allclose(small, large, rtol=1e-12)
