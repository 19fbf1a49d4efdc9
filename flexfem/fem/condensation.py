"""Static condensation of a symmetric positive definite matrix onto its last unknowns, the boundary.

One factorisation `P K P' = L L'` with the boundary last in the elimination order holds everything: its trailing block
gives the Schur complement `S = L_bb L_bb'`, so that no right-hand side is solved for each unknown of the boundary.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.factor import SINGULAR, cholmod_factor, ordering, superlu, to_cvxopt
from flexfem.refused import ComputationFailed

FORWARD, BACKWARD, PERMUTE, RESTORE = 4, 5, 7, 8  # CHOLMOD's systems L x = b, L' x = b, x = P b, x = P' b


TAKEN_APART = 12_000  # unknowns from which on a factor is made twice sooner than solved for every boundary unknown


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
    from cvxopt import cholmod, matrix

    size: int = K.size[0]
    inner, order = size - boundary, ordering(K)
    order = np.concatenate([order[order < inner], np.arange(inner, size)])
    factor = cholmod_factor(K, order)

    def system(b: Array, kind: int) -> Array:
        x = matrix(np.asfortranarray(b))
        cholmod.solve(factor, x, kind)
        return np.array(x)

    last = system(np.arange(size, dtype=float)[:, None], PERMUTE)[inner:, 0]
    if not np.array_equal(last, np.arange(inner, size)):
        raise ComputationFailed(SINGULAR)  # inner unknowns that the boundary does not reach are not held
    if size < TAKEN_APART:
        L = np.linalg.inv(system(np.eye(size, boundary, -inner), FORWARD)[inner:])
    else:
        L = _trailing(factor, boundary)
        factor = cholmod_factor(K, order)  # again: taking it apart has spent it
    del K

    def reduced(loads: Array) -> tuple[Array, Array]:
        y = system(system(loads, PERMUTE), FORWARD)
        return y, L @ y[inner:]

    def expanded(y: Array, edge: Array) -> Array:
        found = system(system(np.concatenate([y[:inner], L.T @ edge]), BACKWARD), RESTORE)
        found[inner:] = edge  # without the round-off of the triangle's solution
        return found

    return Condensed(L @ L.T, reduced, expanded)


def _trailing(factor: Any, boundary: int) -> Array:
    """The last block (b, b) of the triangle L."""
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
