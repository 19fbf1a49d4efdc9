"""Both factorisations solve the same equations, whichever of them is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import pytest
import scipy.sparse as sp

from flexfem.errors import ComputationFailed
from flexfem.fem.factor import Solve, cholmod, dense, factor_of, factorise, superlu

ROUND_OFF = 1e-10  # condition number of the sample times round-off, with room
NEEDS_CHOLMOD = pytest.mark.skipif(find_spec("cvxopt") is None, reason="cvxopt is optional")
BOTH = [pytest.param(cholmod, marks=NEEDS_CHOLMOD), superlu, factorise]


def sample(stiffness_of_last: float = 1.0) -> sp.csc_array:
    """A chain of forty unlike springs, held at its first end, its last free end held by one more spring."""
    k = np.random.default_rng(29).uniform(0.5, 2.0, 41)
    return sp.diags_array(
        [np.append(k[:-1] + k[1:], k[-1] + stiffness_of_last), -k[1:], -k[1:]], offsets=[0, 1, -1]
    ).tocsc()


@pytest.mark.parametrize("method", BOTH, ids=["cholmod", "superlu", "the one installed"])
def test_solves_a_symmetric_system_given_by_its_lower_triangle(method: Callable[[sp.coo_array], Solve]) -> None:
    K = sample()
    x = np.random.default_rng(3).normal(size=(K.shape[0], 3))
    np.testing.assert_allclose(method(sp.tril(K).tocoo())(K @ x), x, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("method", BOTH, ids=["cholmod", "superlu", "the one installed"])
def test_a_part_that_is_not_held_is_refused(method: Callable[[sp.coo_array], Solve]) -> None:
    K = sample().tolil()
    K[-1, :] = 0.0
    K[:, -1] = 0.0
    with pytest.raises(ComputationFailed, match="singular"):
        method(sp.tril(K.tocsc()).tocoo())


@pytest.mark.parametrize("installed", [pytest.param(True, marks=NEEDS_CHOLMOD), False], ids=["cholmod", "superlu"])
def test_condensing_squares_the_inverse_whichever_is_installed(installed: bool, monkeypatch) -> None:
    if not installed:
        monkeypatch.setitem(sys.modules, "cvxopt", None)  # importing it fails, as where it is missing
    K, b = sample(), np.random.default_rng(7).normal(size=(41, 3))
    factor = factor_of(sp.tril(K).tocoo())
    np.testing.assert_allclose(factor.squared(b), b.T @ np.linalg.solve(K.toarray(), b), rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(K @ factor.solve(b), b, rtol=0, atol=ROUND_OFF)
    assert ("superlu" in factor.solve.__qualname__) is not installed


def test_a_dense_matrix_is_solved_and_refused_alike() -> None:
    K, x = sample().toarray(), np.random.default_rng(3).normal(size=(41, 3))
    np.testing.assert_allclose(dense(K)(K @ x), x, rtol=0, atol=ROUND_OFF)
    K[-1, :] = K[:, -1] = 0.0
    with pytest.raises(ComputationFailed, match="singular"):
        dense(K)
