"""Many linear programs at once, against HiGHS one by one: generic and degenerate."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from flexfem.questions.simplex import maximised

from ..tolerances import DENSE

SAME = DENSE  # of the value: both are vertices


def bounded(rng, k, d, kind):
    """Three programs whose points are within a box."""
    A = rng.normal(size=(3, k, d))
    b = np.abs(rng.normal(size=(3, k)))
    if kind == "small integers":
        A = rng.integers(-2, 3, size=A.shape).astype(float)
        b = rng.integers(0, 3, size=b.shape).astype(float)
    elif kind == "through one point":
        b[:] = 0.0
    elif kind == "repeated and opposite":
        A = np.concatenate([A, A[:, ::-1], -A], axis=1)
        b = np.concatenate([b, b[:, ::-1], b * (rng.random(b.shape) > 0.3)], axis=1)
    box = np.broadcast_to(np.concatenate([np.eye(d), -np.eye(d)]), (3, 2 * d, d))
    return np.concatenate([A, box], axis=1), np.concatenate([b, np.full((3, 2 * d), 3.0)], axis=1)


KINDS = ("generic", "small integers", "through one point", "repeated and opposite")


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    d=st.integers(1, 7),
    k=st.integers(1, 30),
    kind=st.sampled_from(KINDS),
)
def test_many_programs_answer_as_highs_does_one_by_one(seed, d, k, kind):
    A, b = bounded(np.random.default_rng(seed), k, d, kind)
    z = maximised(A, b).points
    for one, rows, ends in zip(z, A, b, strict=True):
        found = linprog(-np.eye(d)[0], A_ub=rows, b_ub=ends, bounds=(None, None), method="highs")
        assert one[0] == pytest.approx(-found.fun, rel=SAME, abs=SAME)
        assert np.max(rows @ one - ends) <= SAME * (1 + np.max(np.abs(one)))


def test_a_program_by_hand():
    """x + 2 y <= 4, y >= -1/2, x <= 6, x - y <= 5 and -x <= 1: x is 14/3 at y = -1/3, by both
    slopes.
    """
    A = np.array([[[1.0, 2.0], [0.0, -1.0], [1.0, 0.0], [1.0, -1.0], [-1.0, 0.0], [0.0, 1.0]]])
    np.testing.assert_allclose(
        maximised(A, np.array([[4.0, 0.5, 6.0, 5.0, 1.0, 9.0]])).points, [[14 / 3, -1 / 3]]
    )


def test_units_of_columns_and_rows_change_nothing():
    rng = np.random.default_rng(4)
    A, b = bounded(rng, 30, 4, "generic")
    unit = 10 ** rng.uniform(-6, 6, (3, 4))
    size = 10 ** rng.uniform(-6, 6, b.shape)
    found = maximised(A * size[..., None] / unit[:, None, :], b * size).points
    np.testing.assert_allclose(found / unit, maximised(A, b).points, rtol=1e-7, atol=1e-9)
