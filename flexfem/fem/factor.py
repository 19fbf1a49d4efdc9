"""Sparse Cholesky: CHOLMOD from the cvxopt wheel when it is there, else SuperLU in symmetric mode."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from flexfem.arrays import Array, Index
from flexfem.refused import ComputationFailed

SINGULAR = "finite-element equations singular to working precision: a part is not held, or a neck too thin"

Solve: TypeAlias = Callable[[Array], Array]


def factorise(lower: sp.coo_array | sp.csc_array) -> Solve:
    """Factorise a symmetric positive definite matrix given by its lower triangle (m, m); returns b (m, k) -> x (m, k).

    Raises ComputationFailed when the matrix is singular.
    """
    if find_spec("cvxopt") is None:
        return superlu(lower)
    K = to_cvxopt(lower)
    del lower  # its memory is free for the factor, unless the caller keeps it
    return cholmod(K)


def cholmod(K: Any) -> Solve:
    """As `factorise`, by CHOLMOD's supernodal Cholesky factorisation of what `to_cvxopt` made."""
    from cvxopt import cholmod, matrix

    factor = cholmod_factor(K)

    def solve(b: Array) -> Array:
        x = matrix(np.asfortranarray(b))
        cholmod.solve(factor, x)
        return np.array(x)

    return solve


def to_cvxopt(lower: sp.coo_array | sp.csc_array) -> Any:
    """The matrix as cvxopt has it, entries in one place added up."""
    from cvxopt import matrix, spmatrix

    entries = lower.tocoo()
    values, rows, columns = (matrix(part) for part in (entries.data, *(c.astype(np.int64) for c in entries.coords)))
    return spmatrix(values, rows, columns, lower.shape)


def ordering(K: Any) -> Index:
    """Elimination order (m,) with little fill, by AMD."""
    from cvxopt import amd

    return np.array(amd.order(K, "L")).ravel()


def cholmod_factor(K: Any, order: Index | None = None) -> Any:
    """CHOLMOD's factor of a lower triangle, in its own order or one given. Raises ComputationFailed when singular."""
    from cvxopt import cholmod, matrix

    cholmod.options["supernodal"] = 2
    if order is None:
        factor = cholmod.symbolic(K)
    else:
        cholmod.options["nmethods"] = 1  # else an order of CHOLMOD's own is tried as well, and kept
        factor = cholmod.symbolic(K, p=matrix(order.astype(np.int64)))
        del cholmod.options["nmethods"]  # with it, no order of CHOLMOD's own is found
    try:
        cholmod.numeric(K, factor)
    except ArithmeticError:
        raise ComputationFailed(SINGULAR) from None
    return factor


def superlu(lower: sp.coo_array | sp.csc_array) -> Solve:
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
        raise ComputationFailed(SINGULAR) from None
    return lambda b: np.asarray(factor.solve(b))


def dense(A: Array) -> Solve:
    """As `factorise`, of a dense matrix (m, m)."""
    try:
        factor = cho_factor(A)
    except np.linalg.LinAlgError:
        raise ComputationFailed(SINGULAR) from None
    return lambda b: np.asarray(cho_solve(factor, b))
