"""Sparse Cholesky: CHOLMOD from the cvxopt wheel when it is there, else SuperLU in symmetric mode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from flexfem.arrays import Array
from flexfem.errors import ComputationFailed

PERMUTE, FORWARD = 7, 4  # CHOLMOD's systems P b and L x = b

Solve: TypeAlias = Callable[[Array], Array]


class Factor(NamedTuple):
    """A factorised matrix K (m, m). solve : b (m, k) -> K^-1 b.   squared : b (m, k) -> b' K^-1 b (k, k)."""

    solve: Solve
    squared: Solve


def factorise(lower: sp.coo_array) -> Solve:
    """Factorise a symmetric positive definite matrix given by its lower triangle (m, m); returns b (m, k) -> x (m, k).

    Raises ComputationFailed when the matrix is singular.
    """
    return factor_of(lower).solve


def factor_of(lower: sp.coo_array) -> Factor:
    """As `factorise`, for condensing: CHOLMOD forms `squared` with its factor alone, half the work of a solution."""
    try:
        import cvxopt  # noqa: F401
    except ImportError:
        solve = superlu(lower)
        return Factor(solve, lambda b: np.asarray(b.T @ solve(b)))
    return _cholmod(lower)


def cholmod(lower: sp.coo_array) -> Solve:
    """As `factorise`, by CHOLMOD's supernodal Cholesky factorisation."""
    return _cholmod(lower).solve


def _cholmod(lower: sp.coo_array) -> Factor:
    from cvxopt import cholmod, matrix, spmatrix

    cholmod.options["supernodal"] = 2
    values, rows, columns = (matrix(part) for part in (lower.data, *(c.astype(np.int64) for c in lower.coords)))
    matrix_in = spmatrix(values, rows, columns, lower.shape)
    del values, rows, columns  # a quarter of the peak at a million unknowns
    factor = cholmod.symbolic(matrix_in)
    try:
        cholmod.numeric(matrix_in, factor)
    except ArithmeticError:
        raise _singular() from None
    return _by(factor)


def _by(factor: Any) -> Factor:
    """What a factor of CHOLMOD solves."""
    from cvxopt import cholmod, matrix

    def solve(b: Array) -> Array:
        x = matrix(np.asfortranarray(b))
        cholmod.solve(factor, x)
        return np.array(x)

    def squared(b: Array) -> Array:
        x = matrix(np.asfortranarray(b))
        for part in (PERMUTE, FORWARD):
            cholmod.solve(factor, x, part)
        half = np.array(x)
        return np.asarray(half.T @ half)

    return Factor(solve, squared)


def superlu(lower: sp.coo_array) -> Solve:
    """As `factorise`, by SuperLU without pivoting, which the symmetric ordering needs."""
    from scipy.sparse.linalg import splu

    half = lower.tocsc()
    try:
        factor = splu(
            (half + sp.tril(half, -1).T).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise _singular() from None
    return lambda b: np.asarray(factor.solve(b))


def dense(A: Array) -> Solve:
    """As `factorise`, of a dense matrix (m, m)."""
    try:
        factor = cho_factor(A)
    except np.linalg.LinAlgError:
        raise _singular() from None
    return lambda b: np.asarray(cho_solve(factor, b))


def _singular() -> ComputationFailed:
    return ComputationFailed(
        "finite-element equations singular to working precision: a part is not held, or a neck too thin"
    )
