"""Sparse Cholesky and static condensation: by CHOLMOD from the cvxopt wheel when it is there, else by SuperLU.

Matrices are symmetric and given by their lower triangles. One is condensed onto its last unknowns, the boundary, by one
factorisation `P K P' = L L'` with the boundary last in the elimination order: its trailing block gives the Schur
complement `S = L_bb L_bb'`, so that no right-hand side is solved for each unknown of the boundary.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from flexfem.arrays import Array, Index
from flexfem.refused import ComputationFailed

SINGULAR = "finite-element equations singular to working precision: a part is not held, or a neck too thin"
UNSTABLE = "tangent stiffness singular to working precision: a limit or bifurcation load"
TAKEN_APART = 12_000  # unknowns from which on a factor is made twice sooner than solved for every boundary unknown
WHOLE, FORWARD, BACKWARD, PERMUTE, RESTORE = 0, 4, 5, 7, 8  # CHOLMOD: K x = b, L x = b, L' x = b, x = P b, x = P' b

Solve: TypeAlias = Callable[[Array], Array]
"""Right-hand sides b (m, k) to solutions x (m, k)."""


def factorise(lower: sp.csr_array) -> Solve:
    """Factorise a positive definite matrix. Raises ComputationFailed when it is singular."""
    if find_spec("cvxopt") is None:
        return superlu(lower)
    K = _to_cvxopt(lower)
    del lower  # its memory is free for the factor, unless the caller keeps it
    return partial(_system, _cholmod(K), kind=WHOLE)


def _to_cvxopt(lower: sp.csr_array) -> Any:
    from cvxopt import cholmod, matrix, spmatrix

    cholmod.options["supernodal"] = 2
    rows, columns = (matrix(part.astype(np.int64)) for part in lower.tocoo().coords)
    return spmatrix(matrix(lower.data), rows, columns, lower.shape)


def _cholmod(K: Any, order: Index | None = None, symbolic: Any = None) -> Any:
    """CHOLMOD's factor, in its own order or one given, or with a symbolic factor. Raises ComputationFailed."""
    from cvxopt import cholmod, matrix

    if order is not None:
        cholmod.options["nmethods"] = 1  # else an order of CHOLMOD's own is tried as well, and kept
        symbolic = cholmod.symbolic(K, p=matrix(order.astype(np.int64)))
        del cholmod.options["nmethods"]  # with it, no order of CHOLMOD's own is found
    factor = symbolic or cholmod.symbolic(K)
    try:
        cholmod.numeric(K, factor)
    except ArithmeticError:
        raise ComputationFailed(SINGULAR) from None
    return factor


def _system(factor: Any, b: Array, kind: int) -> Array:
    """One of CHOLMOD's systems, of right-hand sides (m, k)."""
    from cvxopt import cholmod, matrix

    x = matrix(np.asfortranarray(b))
    cholmod.solve(factor, x, kind)
    return np.array(x)


def _whole(lower: sp.csr_array) -> sp.csc_array:
    return (lower + sp.tril(lower, -1).T).tocsc()


def superlu(lower: sp.csr_array) -> Solve:
    """As `factorise`, by SuperLU without pivoting, which the symmetric ordering needs."""
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        factor = splu(_whole(lower), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
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


class Condensed(NamedTuple):
    """A matrix (m, m) whose last b unknowns are the boundary.

    schur : (b, b), Schur complement `S = K_bb - K_bi K_ii^-1 K_ib`.
    reduced : loads (m, k) -> what `expanded` needs of them (m, k), and the loads (b, k) they leave on the boundary.
    expanded : what `reduced` gave (m, k), boundary unknowns (b, k) -> all unknowns (m, k).
    """

    schur: Array
    reduced: Callable[[Array], tuple[Array, Array]]
    expanded: Callable[[Array, Array], Array]


def condense(lower: sp.csr_array, boundary: int) -> Condensed:
    """Condense a positive definite matrix onto its last unknowns. Raises ComputationFailed when it is singular."""
    if find_spec("cvxopt") is None:
        return _by_superlu(lower, boundary)
    from cvxopt import amd, cholmod, matrix

    K, size = _to_cvxopt(lower), lower.shape[0]
    del lower  # as in `factorise`
    inner, order = size - boundary, np.array(amd.order(K, "L")).ravel()
    order = np.concatenate([order[order < inner], np.arange(inner, size)])
    factor = _cholmod(K, order)
    last = _system(factor, np.arange(size, dtype=float)[:, None], PERMUTE)[inner:, 0]
    if not np.array_equal(last, np.arange(inner, size)):
        raise ComputationFailed(SINGULAR)  # inner unknowns that the boundary does not reach are not held
    if size < TAKEN_APART:
        L = np.linalg.inv(_system(factor, np.eye(size, boundary, -inner), FORWARD)[inner:])
    else:
        L = np.tril(np.array(matrix(cholmod.getfactor(factor)[inner:, inner:])))
        factor = _cholmod(K, order)  # again: taking it apart has spent it

    def reduced(loads: Array) -> tuple[Array, Array]:
        y = _system(factor, _system(factor, loads, PERMUTE), FORWARD)
        return y, L @ y[inner:]

    def expanded(y: Array, edge: Array) -> Array:
        found = _system(factor, _system(factor, np.concatenate([y[:inner], L.T @ edge]), BACKWARD), RESTORE)
        found[inner:] = edge  # without the round-off of the triangle's solution
        return found

    return Condensed(L @ L.T, reduced, expanded)


def _by_superlu(lower: sp.csr_array, boundary: int) -> Condensed:
    """The inner unknowns alone are factorised."""
    inner = lower.shape[0] - boundary
    across, below = lower[inner:, :inner], lower[inner:, inner:].toarray()
    solve = superlu(lower[:inner, :inner])
    schur = below + np.tril(below, -1).T - across @ solve(across.T.toarray())

    def reduced(loads: Array) -> tuple[Array, Array]:
        x = solve(loads[:inner])
        return np.concatenate([x, np.zeros((boundary, loads.shape[1]))]), loads[inner:] - across @ x

    def expanded(x: Array, edge: Array) -> Array:
        return np.concatenate([x[:inner] - solve(across.T @ edge), edge])

    return Condensed((schur + schur.T) / 2, reduced, expanded)


class Factoriser:
    """Factorises matrices, definite or not; those with the pattern of the one before share its order (CHOLMOD)."""

    _pattern: tuple[Index, Index] | None = None
    _matrix: Any
    _symbolic: Any

    def __call__(self, lower: sp.csr_array) -> Solve:
        """How a factor solves, until the next one is made. Raises ComputationFailed for a singular matrix."""
        from scipy.sparse.linalg import splu

        if find_spec("cvxopt") is not None:
            with suppress(ComputationFailed):  # not definite
                return self._by_cholmod(lower)
        try:
            factor = splu(_whole(lower))
        except RuntimeError:
            raise ComputationFailed(UNSTABLE) from None
        return lambda b: np.asarray(factor.solve(b))

    def _by_cholmod(self, lower: sp.csr_array) -> Solve:
        from cvxopt import cholmod, matrix

        ordered = lower.tocsc()  # as cvxopt has its entries
        pattern = ordered.indptr, ordered.indices
        if self._pattern and all(map(np.array_equal, self._pattern, pattern)):
            self._matrix.V = matrix(ordered.data)
        else:
            self._pattern, self._matrix = pattern, _to_cvxopt(lower)
            self._symbolic = cholmod.symbolic(self._matrix)
        return partial(_system, _cholmod(self._matrix, symbolic=self._symbolic), kind=WHOLE)
