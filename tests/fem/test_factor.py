"""All factorisations solve the same equations, whichever of them is installed."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
import scipy.sparse as sp

import flexfem.fem.cholmod
from flexfem.fem.factor import condense, dense, factorise, pardiso, superlu
from flexfem.refused import ComputationFailed

ROUND_OFF = 1e-10  # condition number of the sample times round-off, with room
NEEDS_CHOLMOD = pytest.mark.skipif(find_spec("cvxopt") is None, reason="cvxopt is optional")
NEEDS_PARDISO = pytest.mark.skipif(find_spec("pypardiso") is None, reason="pypardiso is optional")
ALL = [
    pytest.param(factorise, marks=NEEDS_CHOLMOD),
    superlu,
    pytest.param(pardiso, marks=NEEDS_PARDISO),
]


def sample(stiffness_of_last=1.0):
    """A chain of forty unlike springs, held at its first end, its last free end held by one more
    spring.
    """
    k = np.random.default_rng(29).uniform(0.5, 2.0, 41)
    return sp.diags_array(
        [np.append(k[:-1] + k[1:], k[-1] + stiffness_of_last), -k[1:], -k[1:]], offsets=[0, 1, -1]
    ).tocsc()


@pytest.mark.parametrize("method", ALL, ids=["cholmod", "superlu", "pardiso"])
def test_solves_a_symmetric_system_given_by_its_lower_triangle(method):
    K = sample()
    x = np.random.default_rng(3).normal(size=(K.shape[0], 3))
    np.testing.assert_allclose(method(sp.tril(K).tocsr())(K @ x), x, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("method", ALL, ids=["cholmod", "superlu", "pardiso"])
def test_a_part_that_is_not_held_is_refused(method):
    K = sample().tolil()
    K[-1, :] = 0.0
    K[:, -1] = 0.0
    with pytest.raises(ComputationFailed, match="singular"):
        method(sp.tril(K.tocsr()).tocsr())


@pytest.mark.parametrize(
    "installed", [pytest.param(True, marks=NEEDS_CHOLMOD), False], ids=["cholmod", "superlu"]
)
def test_condensed_equations_are_those_of_the_whole(installed, monkeypatch):
    if not installed:
        monkeypatch.setitem(
            sys.modules, "cvxopt", None
        )  # importing it fails, as where it is missing
    rng = np.random.default_rng(7)
    A = rng.normal(size=(41, 41)) * (rng.uniform(size=(41, 41)) < 0.1)
    K = (
        A @ A.T + np.diag(rng.uniform(1.0, 2.0, 41)) + 0.1
    )  # every unknown meets the boundary, none in its order
    inner = 34
    b = rng.normal(size=(41, 3))
    for kind in (
        flexfem.fem.cholmod.SUPERNODAL,
        (),
    ):  # the factor is read, and solved for every unknown of the boundary
        monkeypatch.setattr(flexfem.fem.cholmod, "SUPERNODAL", kind)
        found = condense(sp.csr_array(np.tril(K)), 7)
        schur = K[inner:, inner:] - K[inner:, :inner] @ np.linalg.solve(
            K[:inner, :inner], K[:inner, inner:]
        )
        np.testing.assert_allclose(found.schur, schur, rtol=0, atol=ROUND_OFF)
        inside, left = found.reduced(b)
        expected = b[inner:] - K[inner:, :inner] @ np.linalg.solve(K[:inner, :inner], b[:inner])
        np.testing.assert_allclose(left, expected, rtol=0, atol=ROUND_OFF)
        x = found.expanded(inside, np.linalg.solve(schur, left))
        np.testing.assert_allclose(K @ x, b, rtol=0, atol=ROUND_OFF)
    assert ("by_solves" in found.reduced.__qualname__) is not installed


def test_a_dense_matrix_is_solved_and_refused_alike():
    K = sample().toarray()
    x = np.random.default_rng(3).normal(size=(41, 3))
    np.testing.assert_allclose(dense(K)(K @ x), x, rtol=0, atol=ROUND_OFF)
    K[-1, :] = K[:, -1] = 0.0
    with pytest.raises(ComputationFailed, match="singular"):
        dense(K)


@NEEDS_CHOLMOD
def test_condensing_leaves_cholmods_options_as_they_were():
    """Other code in the process orders matrices by them."""
    from cvxopt import cholmod

    condense(sp.csr_array(np.tril(np.eye(5) + 1.0)), 2)
    assert "nmethods" not in cholmod.options
