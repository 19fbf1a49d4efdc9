"""Many linear programs at once, against HiGHS one by one: generic, degenerate, without a point, without an end."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from flexfem.verify import programs
from flexfem.verify.programs import maximise

SAME = 1e-9  # of the value: both are vertices, to round-off


def by_highs(c, A, b) -> float:
    found = linprog(-c, A_ub=A, b_ub=b, bounds=(None, None), method="highs")
    if found.status == 4:  # one or the other: is there a point at all?
        found = linprog(0 * c, A_ub=A, b_ub=b, bounds=(None, None), method="highs")
        return np.nan if found.status == 2 else np.inf
    return {0: -(found.fun or 0.0), 2: np.nan, 3: np.inf}[found.status]


def agree(c, A, b) -> None:
    found = maximise(c, A, b)
    for k in range(len(c)):
        wanted = by_highs(c[k], A[k], b[k])
        assert found.value[k] == pytest.approx(wanted, rel=SAME, abs=SAME, nan_ok=True)
        if np.isfinite(wanted):
            assert np.max(A[k] @ found.at[k] - b[k]) <= SAME * (1 + np.max(np.abs(found.at[k])))
            assert c[k] @ found.at[k] == pytest.approx(found.value[k])


KINDS = ("from inside", "anywhere", "small integers", "through one point", "repeated and opposite")


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), d=st.integers(1, 6), k=st.integers(1, 30), kind=st.sampled_from(KINDS))
def test_many_programs_answer_as_highs_does_one_by_one(seed, d, k, kind):
    rng = np.random.default_rng(seed)
    A, b, c = rng.normal(size=(3, k, d)), rng.normal(size=(3, k)), rng.normal(size=(3, d))
    if kind == "from inside":
        b = np.abs(b)
    elif kind == "small integers":
        A, b, c = (rng.integers(-2, 3, size=each.shape).astype(float) for each in (A, b, c))
    elif kind == "through one point":
        b[:] = 0.0
    elif kind == "repeated and opposite":
        A = np.concatenate([A, A[:, ::-1], -A], axis=1)
        b = np.concatenate([np.abs(b), np.abs(b[:, ::-1]), np.abs(b) * (rng.random(b.shape) > 0.3)], axis=1)
    with patch.object(programs, "_by_highs", side_effect=AssertionError("left to HiGHS")):
        agree(c, A, b)


def test_a_program_by_hand():
    """x + y <= 4, x <= 3, y <= 2, both above zero: 3 x + 2 y is 11 at (3, 1)."""
    A = np.array([[[1.0, 1], [1, 0], [0, 1], [-1, 0], [0, -1]]])
    found = maximise(np.array([[3.0, 2.0]]), A, np.array([[4.0, 3, 2, 0, 0]]))
    np.testing.assert_allclose([found.value[0], *found.at[0]], [11.0, 3.0, 1.0])
    worse = maximise(np.array([[3.0, 2.0]]), A, np.array([[4.0, 3, 2, 0, -2.5]]))  # y >= 2.5 and y <= 2
    assert np.isnan(worse.value[0])
    endless = maximise(np.array([[-1.0, 0.0]]), A[:, [0, 1, 2]], np.array([[4.0, 3, 2]]))
    assert endless.value[0] == np.inf


def test_beales_program_which_cycles_by_the_usual_rule_ends():
    c = np.array([[0.75, -20.0, 0.5, -6.0]])
    rows = [[0.25, -8, -1, 9], [0.5, -12, -0.5, 3], [0, 0, 1, 0], *(-np.eye(4)).tolist()]
    A, b = np.array([rows]), np.array([[0.0, 0, 1, 0, 0, 0, 0]])
    found = maximise(c, A, b)
    assert found.value[0] == pytest.approx(1.25)  # E. M. L. Beale, 1955
    agree(c, A, b)


def test_units_of_columns_and_rows_change_nothing():
    rng = np.random.default_rng(4)
    A, b, c = rng.normal(size=(20, 30, 4)), np.abs(rng.normal(size=(20, 30))), rng.normal(size=(20, 4))
    unit, size = 10 ** rng.uniform(-6, 6, (20, 4)), 10 ** rng.uniform(-6, 6, (20, 30))
    found = maximise(c / unit, A * size[..., None] / unit[:, None, :], b * size)
    wanted = maximise(c, A, b)
    np.testing.assert_allclose(found.value, wanted.value, rtol=SAME)
    np.testing.assert_allclose(found.at / unit, wanted.at, rtol=1e-7, atol=1e-9)


def test_what_fails_the_check_is_left_to_highs():
    rng = np.random.default_rng(5)
    A, b, c = rng.normal(size=(4, 20, 3)), np.abs(rng.normal(size=(4, 20))), rng.normal(size=(4, 3))
    wanted = maximise(c, A, b).value
    wrong = lambda c, A, b, start: (0 * start, np.zeros(len(c), bool), np.zeros(len(c), bool))  # noqa: E731
    with patch.object(programs, "_ascend", side_effect=wrong):
        np.testing.assert_allclose(maximise(c, A, b).value, wanted, rtol=SAME)
