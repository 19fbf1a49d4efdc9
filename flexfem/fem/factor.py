"""Sparse Cholesky and static condensation: by CHOLMOD from the cvxopt wheel when it is there, else by SuperLU.

Condensation of a symmetric positive definite matrix onto its last unknowns, the boundary: one factorisation
`P K P' = L L'` with the boundary last in the elimination order holds everything: its trailing block gives the Schur
complement `S = L_bb L_bb'`, so that no right-hand side is solved for each unknown of the boundary.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import ComputationFailed

SINGULAR = "finite-element equations singular to working precision: a part is not held, or a neck too thin"

TAKEN_APART = 12_000  # unknowns from which on a factor is made twice sooner than solved for every boundary unknown
WHOLE, FORWARD, BACKWARD, PERMUTE, RESTORE = 0, 4, 5, 7, 8  # CHOLMOD: K x = b, L x = b, L' x = b, x = P b, x = P' b

Solve: TypeAlias = Callable[[Array], Array]


def factorise(lower: sp.coo_array | sp.csc_array) -> Solve:
    """Factorise a symmetric positive definite matrix given by its lower triangle (m, m); returns b (m, k) -> x (m, k).

    Raises ComputationFailed when the matrix is singular.
    """
    if find_spec("cvxopt") is None:
        return superlu(lower)
    K = to_cvxopt(lower)
    del lower  # its memory is free for the factor, unless the caller keeps it
    return partial(_system, cholmod_factor(K), kind=WHOLE)


def to_cvxopt(lower: sp.coo_array | sp.csc_array) -> Any:
    """The matrix as cvxopt has it, entries in one place added up."""
    from cvxopt import matrix, spmatrix

    entries = lower.tocoo()
    values, rows, columns = (matrix(part) for part in (entries.data, *(c.astype(np.int64) for c in entries.coords)))
    return spmatrix(values, rows, columns, lower.shape)


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
    try:
        factor = _symmetric_lu(lower)
    except RuntimeError:
        raise ComputationFailed(SINGULAR) from None
    return lambda b: np.asarray(factor.solve(b))


def _symmetric_lu(lower: sp.coo_array | sp.csc_array, **options: bool) -> Any:
    from scipy.sparse.linalg import splu

    options["SymmetricMode"] = True
    return splu(_whole(lower), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def _whole(lower: sp.coo_array | sp.csc_array) -> sp.csc_array:
    """A symmetric matrix by its lower triangle."""
    half = lower.tocsc()
    return (half + sp.tril(half, -1).T).tocsc()


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


def condense(lower: sp.coo_array | sp.csc_array, boundary: int) -> Condensed:
    """Condense a matrix given by its lower triangle (m, m) onto its last unknowns.

    By CHOLMOD from the cvxopt wheel when it is there, else by SuperLU. Raises ComputationFailed when it is singular.
    """
    if find_spec("cvxopt") is None:
        return by_superlu(lower.tocsc(), boundary)
    K = to_cvxopt(lower)
    del lower  # its memory is free for the factor, unless the caller keeps it
    return by_cholmod(K, boundary)


def by_cholmod(K: Any, boundary: int) -> Condensed:
    """As `condense`, of what `to_cvxopt` made."""
    from cvxopt import amd

    size: int = K.size[0]
    inner, order = size - boundary, np.array(amd.order(K, "L")).ravel()
    order = np.concatenate([order[order < inner], np.arange(inner, size)])
    factor = cholmod_factor(K, order)
    last = _system(factor, np.arange(size, dtype=float)[:, None], PERMUTE)[inner:, 0]
    if not np.array_equal(last, np.arange(inner, size)):
        raise ComputationFailed(SINGULAR)  # inner unknowns that the boundary does not reach are not held
    if size < TAKEN_APART:
        L = np.linalg.inv(_system(factor, np.eye(size, boundary, -inner), FORWARD)[inner:])
    else:
        L = _trailing(factor, boundary)
        factor = cholmod_factor(K, order)  # again: taking it apart has spent it

    def reduced(loads: Array) -> tuple[Array, Array]:
        y = _system(factor, _system(factor, loads, PERMUTE), FORWARD)
        return y, L @ y[inner:]

    def expanded(y: Array, edge: Array) -> Array:
        found = _system(factor, _system(factor, np.concatenate([y[:inner], L.T @ edge]), BACKWARD), RESTORE)
        found[inner:] = edge  # without the round-off of the triangle's solution
        return found

    return Condensed(L @ L.T, reduced, expanded)


def _system(factor: Any, b: Array, kind: int) -> Array:
    """One of CHOLMOD's systems, of right-hand sides (m, k)."""
    from cvxopt import cholmod, matrix

    x = matrix(np.asfortranarray(b))
    cholmod.solve(factor, x, kind)
    return np.array(x)


def _trailing(factor: Any, boundary: int) -> Array:
    """The last block (b, b) of the triangle L; spends the factor."""
    from cvxopt import cholmod, matrix

    L = cholmod.getfactor(factor)
    inner = L.size[0] - boundary
    return np.tril(np.array(matrix(L[inner:, inner:])))


def by_superlu(lower: sp.csc_array, boundary: int) -> Condensed:
    """As `condense`: the inner unknowns alone are factorised."""
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


class Factorization(NamedTuple):
    """A factorised symmetric matrix: `solve`, and whether the matrix is positive definite."""

    solve: Solve
    definite: bool


Factorise: TypeAlias = Callable[[sp.coo_array], Factorization]


def factoriser() -> Factorise:
    """A function that factorises symmetric matrices given by their lower triangles, definite or not.

    Matrices with the pattern of the one before share its ordering and symbolic factorisation (CHOLMOD). A matrix that
    is not positive definite is factorised by SuperLU with pivoting. Raises ComputationFailed for a singular one.
    A factor is good until the next one is made.
    """
    if find_spec("cvxopt") is None:
        return _definite_or_not
    from cvxopt import cholmod, matrix

    cholmod.options["supernodal"] = 2
    known: list[tuple[tuple[AnyArray, ...], Any, object]] = []
    places: list[Index] = []

    def factorise(lower: sp.coo_array) -> Factorization:
        if known and all(np.array_equal(old, new) for old, new in zip(known[0][0], lower.coords, strict=True)):
            places[:] = places or [_places(lower)]
            known[0][1].V = matrix(np.bincount(places[0], lower.data))
        else:
            matrix_in, places[:] = to_cvxopt(lower), []
            known[:] = [(lower.coords, matrix_in, cholmod.symbolic(matrix_in))]
        _, matrix_in, symbolic = known[0]
        try:
            cholmod.numeric(matrix_in, symbolic)
        except ArithmeticError:
            return _pivoted(lower)
        return Factorization(partial(_system, symbolic, kind=WHOLE), True)

    return factorise


def _places(lower: sp.coo_array) -> Index:
    """Of each entry its place among all that differ, column by column, as cvxopt keeps them."""
    rows, columns = lower.coords
    return np.unique(columns.astype(np.int64) * lower.shape[0] + rows, return_inverse=True)[1]


def _definite_or_not(lower: sp.coo_array) -> Factorization:
    """By SuperLU: LU without pivoting has a positive diagonal of U if and only if the matrix is definite."""
    try:
        factor = _symmetric_lu(lower, Equil=False)
    except RuntimeError:
        return _pivoted(lower)
    if not (np.array_equal(factor.perm_r, factor.perm_c) and np.all(factor.U.diagonal() > 0)):
        return _pivoted(lower)
    return Factorization(lambda b: np.asarray(factor.solve(b)), True)


def _pivoted(lower: sp.coo_array) -> Factorization:
    from scipy.sparse.linalg import splu

    try:
        factor = splu(_whole(lower))
    except RuntimeError:
        raise ComputationFailed(
            "tangent stiffness singular to working precision: a limit or bifurcation load"
        ) from None
    return Factorization(lambda b: np.asarray(factor.solve(b)), False)
