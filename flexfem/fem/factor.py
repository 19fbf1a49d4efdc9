"""Sparse Cholesky factorisation and static condensation: CHOLMOD of the cvxopt wheel when installed, else SuperLU.

Matrices are symmetric and given by their lower triangles. A matrix is condensed onto its last unknowns, the boundary,
by one factorisation `P K P' = L L'` with the boundary last in the elimination order: the trailing block gives the Schur
complement `S = L_bb L_bb'` without a solve for each boundary unknown.
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

SINGULAR = "finite-element equations singular to working precision: a part is not supported, or a neck is too thin"
UNSTABLE = "tangent stiffness singular to working precision: a limit or bifurcation load"
FACTORISED_TWICE = 12_000  # unknowns from which a second factorisation is faster than a solve per boundary unknown
WHOLE, FORWARD, BACKWARD, PERMUTE, RESTORE = 0, 4, 5, 7, 8  # CHOLMOD: K x = b, L x = b, L' x = b, x = P b, x = P' b

Solve: TypeAlias = Callable[[Array], Array]
"""Function from right-hand sides b (m, k) to solutions x (m, k)."""


def factorise(lower: sp.csr_array) -> Solve:
    """Factorise a positive definite matrix. Raises ComputationFailed when it is singular."""
    if find_spec("cvxopt") is None:
        return superlu(lower)
    K = _to_cvxopt(lower)
    del lower  # frees its memory for the factor unless the caller holds it
    return partial(_solve, _cholmod_factor(K), kind=WHOLE)


def _to_cvxopt(lower: sp.csr_array) -> Any:
    from cvxopt import cholmod, matrix, spmatrix

    cholmod.options["supernodal"] = 2
    rows, columns = (matrix(part.astype(np.int64)) for part in lower.tocoo().coords)
    return spmatrix(matrix(lower.data), rows, columns, lower.shape)


def _cholmod_factor(K: Any, order: Index | None = None, symbolic: Any = None) -> Any:
    """Factorise with CHOLMOD, in its own order, a given one, or that of a symbolic factor. Raises ComputationFailed."""
    from cvxopt import cholmod, matrix

    if order is not None:
        cholmod.options["nmethods"] = 1  # else CHOLMOD also tries an order of its own and may prefer it
        symbolic = cholmod.symbolic(K, p=matrix(order.astype(np.int64)))
        del cholmod.options["nmethods"]  # it would disable the search for an order in later calls
    factor = symbolic or cholmod.symbolic(K)
    try:
        cholmod.numeric(K, factor)
    except ArithmeticError:
        raise ComputationFailed(SINGULAR) from None
    return factor


def _solve(factor: Any, b: Array, kind: int) -> Array:
    """Solve the CHOLMOD system `kind` for right-hand sides (m, k)."""
    from cvxopt import cholmod, matrix

    x = matrix(np.asfortranarray(b))
    cholmod.solve(factor, x, kind)
    return np.array(x)


def _symmetric(lower: sp.csr_array) -> sp.csc_array:
    return (lower + sp.tril(lower, -1).T).tocsc()


def superlu(lower: sp.csr_array) -> Solve:
    """Factorise as `factorise` with SuperLU, without pivoting, to keep the symmetric ordering."""
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        factor = splu(_symmetric(lower), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError:
        raise ComputationFailed(SINGULAR) from None
    return lambda b: np.asarray(factor.solve(b))


def dense(A: Array) -> Solve:
    """Factorise a dense matrix (m, m) as `factorise`."""
    try:
        factor = cho_factor(A)
    except np.linalg.LinAlgError:
        raise ComputationFailed(SINGULAR) from None
    return lambda b: np.asarray(cho_solve(factor, b))


class Condensed(NamedTuple):
    """A matrix (m, m) condensed onto its last b unknowns, the boundary.

    schur : (b, b), Schur complement `S = K_bb - K_bi K_ii^-1 K_ib`.
    reduced : loads (m, k) -> intermediate solution (m, k) for `expanded`, and condensed loads (b, k) on the boundary.
    expanded : intermediate solution (m, k), boundary unknowns (b, k) -> all unknowns (m, k).
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
    del lower  # frees its memory for the factor unless the caller holds it
    inner, order = size - boundary, np.array(amd.order(K, "L")).ravel()
    order = np.concatenate([order[order < inner], np.arange(inner, size)])
    factor = _cholmod_factor(K, order)
    last = _solve(factor, np.arange(size, dtype=float)[:, None], PERMUTE)[inner:, 0]
    if not np.array_equal(last, np.arange(inner, size)):
        raise ComputationFailed(SINGULAR)  # inner unknowns without connection to the boundary are not held
    if size < FACTORISED_TWICE:
        L = np.linalg.inv(_solve(factor, np.eye(size, boundary, -inner), FORWARD)[inner:])
    else:
        L = np.tril(np.array(matrix(cholmod.getfactor(factor)[inner:, inner:])))
        factor = _cholmod_factor(K, order)  # again, as getfactor invalidates it

    def reduced(loads: Array) -> tuple[Array, Array]:
        y = _solve(factor, _solve(factor, loads, PERMUTE), FORWARD)
        return y, L @ y[inner:]

    def expanded(y: Array, edge: Array) -> Array:
        x = _solve(factor, _solve(factor, np.concatenate([y[:inner], L.T @ edge]), BACKWARD), RESTORE)
        x[inner:] = edge  # without the round-off of the substitution
        return x

    return Condensed(L @ L.T, reduced, expanded)


def _by_superlu(lower: sp.csr_array, boundary: int) -> Condensed:
    """Condense with SuperLU, which factorises the inner unknowns alone."""
    inner = lower.shape[0] - boundary
    coupling, K_bb = lower[inner:, :inner], lower[inner:, inner:].toarray()
    solve = superlu(lower[:inner, :inner])
    schur = K_bb + np.tril(K_bb, -1).T - coupling @ solve(coupling.T.toarray())

    def reduced(loads: Array) -> tuple[Array, Array]:
        x = solve(loads[:inner])
        return np.concatenate([x, np.zeros((boundary, loads.shape[1]))]), loads[inner:] - coupling @ x

    def expanded(x: Array, edge: Array) -> Array:
        return np.concatenate([x[:inner] - solve(coupling.T @ edge), edge])

    return Condensed((schur + schur.T) / 2, reduced, expanded)


class Factoriser:
    """Factorise matrices, definite or not; successive matrices of one pattern share an elimination order (CHOLMOD)."""

    _pattern: tuple[Index, Index] | None = None
    _matrix: Any
    _symbolic: Any

    def __call__(self, lower: sp.csr_array) -> Solve:
        """Return the solver of a matrix, valid until the next call. Raises ComputationFailed for a singular matrix."""
        from scipy.sparse.linalg import splu

        if find_spec("cvxopt") is not None:
            with suppress(ComputationFailed):  # indefinite
                return self._by_cholmod(lower)
        try:
            factor = splu(_symmetric(lower))
        except RuntimeError:
            raise ComputationFailed(UNSTABLE) from None
        return lambda b: np.asarray(factor.solve(b))

    def _by_cholmod(self, lower: sp.csr_array) -> Solve:
        from cvxopt import cholmod, matrix

        ordered = lower.tocsc()  # the order of entries in cvxopt
        pattern = ordered.indptr, ordered.indices
        if self._pattern and all(map(np.array_equal, self._pattern, pattern)):
            self._matrix.V = matrix(ordered.data)
        else:
            self._pattern, self._matrix = pattern, _to_cvxopt(lower)
            self._symbolic = cholmod.symbolic(self._matrix)
        return partial(_solve, _cholmod_factor(self._matrix, symbolic=self._symbolic), kind=WHOLE)
