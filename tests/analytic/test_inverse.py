"""The inverse of small matrices, and when it is not to be trusted."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.arrays import inverse


def conditioned(number: int, condition: float) -> np.ndarray:
    """A matrix of ones and one smaller part, whose condition number in the 1-norm is near the one asked for."""
    made = np.eye(number)
    made[0, 1] = made[1, 0] = 1.0 - 2.0 / condition
    return made


@pytest.mark.parametrize("number", [3, 6])
def test_six_digits_of_sixteen_are_trusted_and_less_is_not_a_number(number: int) -> None:
    good, bad = conditioned(number, 0.7e10), conditioned(number, 1.5e10)
    assert np.linalg.cond(good, 1) < 1e10 < np.linalg.cond(bad, 1)
    found = inverse(np.array([good, bad, np.eye(number), np.zeros((number, number))]))
    assert np.isfinite(found).all(axis=(1, 2)).tolist() == [True, False, True, False]
    np.testing.assert_allclose(found[0] @ good, np.eye(number), atol=1e-5)


def test_units_of_rows_and_columns_do_not_count() -> None:
    matrix = np.array([[2.0, 0.3, -0.5], [0.1, 1.5, 0.4], [-0.2, 0.7, 3.0]])
    units = np.diag([1e-9, 1.0, 1e12])
    back = np.linalg.inv(units)
    np.testing.assert_allclose(inverse(units @ matrix @ units), back @ np.linalg.inv(matrix) @ back, rtol=1e-12)
    unequal = np.diag([1e7, 1e-8, 3.0]) @ matrix  # rows alone
    np.testing.assert_allclose(inverse(unequal), np.linalg.inv(unequal), rtol=1e-9)
