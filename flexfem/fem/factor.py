"""Factorisation and static condensation of sparse symmetric matrices.

CHOLMOD of the cvxopt wheel is used when installed, else SuperLU. Extruded meshes are factorised by
PARDISO when it is installed, but condensed by CHOLMOD, which is as fast for sectors.

Matrices are given by their lower triangles, by rows in ascending order: the upper triangles by
columns. The unknowns are those of the nodes of a plane mesh, equally many for each, and any others
last. Nodes, not unknowns, are ordered for little fill: in extruded meshes this is faster and leaves
less fill.

A matrix is condensed onto its last unknowns, the boundary, by one factorisation `P K P' = L L'`
with the boundary last in the elimination order: the trailing block of L gives the Schur complement
`S = L_bb L_bb'`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias
from weakref import finalize

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem import cholmod
from flexfem.fem.cholmod import SINGULAR
from flexfem.refused import ComputationFailed

UNSTABLE = "tangent stiffness singular to working precision: a limit or bifurcation load"
PARDISO_SETTINGS = {1: 1, 2: 3}  # own settings, order of METIS
PARDISO_OWN_ORDER = 5  # the setting that says that an order is given

Solve: TypeAlias = Callable[[Array], Array]
"""Function from right-hand sides b (m, k) to solutions x (m, k)."""


def elimination_order(triangles: AnyArray, count: int) -> Index:
    """Return the order of `count` nodes for little fill.

    triangles : (e, 6), numbers of their nodes; those outside 0 to `count` are no nodes.

    The corners are in the order of approximate minimum degree in their own graph, and the middle of
    a side precedes its ends. On a million unknowns this takes half the time of minimum degree for
    all nodes, with 6 % less fill.
    """
    if not cholmod.available():
        return np.arange(count)
    nodes = np.where(triangles < count, triangles, -1)
    ends = nodes[:, :3]
    row, column = np.broadcast_arrays(ends[:, :, None], ends[:, None, :])
    met = (column >= 0) & (row >= column)
    ones = np.ones(np.count_nonzero(met))
    graph = sp.csr_array((ones, (row[met], column[met])), shape=(count, count))
    place = np.argsort(cholmod.minimum_degree(graph)).astype(float)
    place = np.append(place, count)  # the last is that of no node
    place[nodes[:, 3:]] = np.minimum(place[ends], place[np.roll(ends, -1, axis=1)]) - 0.5
    return np.argsort(place[:count], kind="stable")


def factorise(
    lower: sp.csr_array,
    order: Index | None = None,
    last: int = 0,
) -> Solve:
    """Factorise a positive definite matrix.

    order : of the nodes; None computes that of the unknowns.
    last : number of unknowns, loads on which alone need only a backward substitution.

    Raises ComputationFailed when the matrix is singular, or when a part is not connected to the
    last unknowns.
    """
    extruded = order is not None and lower.shape[0] - last > 2 * len(order)
    if extruded and find_spec("pypardiso") is not None:  # in the plane CHOLMOD is as fast
        with suppress(ImportError):  # without the library of MKL
            return pardiso(lower, order, last)
    if not cholmod.available():
        return superlu(lower)
    K = cholmod.matrix_of(lower)
    unknowns = _unknown_order(lower, order, last)
    del lower  # frees its memory for the factor unless the caller holds it
    return _Cholesky(K, unknowns, last).solve


def _unknown_order(
    lower: sp.csr_array,
    order: Index | None,
    last: int,
) -> Index:
    """Return the order of the unknowns: those of the nodes in their order, then the last ones.

    order : of the nodes, by default that of minimum degree.
    """
    size = lower.shape[0]
    inner = size - last
    if order is None:
        order = cholmod.minimum_degree(lower[:inner, :inner])
    block = inner // len(order)
    of_nodes = order[:, None] * block + np.arange(block)
    return np.concatenate([of_nodes.ravel(), np.arange(inner, size)])


def pardiso(
    lower: sp.csr_array,
    order: Index | None = None,
    last: int = 0,
) -> Solve:
    """Factorise as `factorise` with PARDISO of MKL on all processors.

    The order is that of `factorise` where cvxopt computes it, else that of METIS.
    """
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    size = lower.shape[0]
    solver = PyPardisoSolver(mtype=2, phase=12)  # definite; analysis and factor
    unread = sp.csr_array(lower.shape)

    def solve(b: Array) -> Array:
        return np.asarray(solver._call_pardiso(unread, np.asfortranarray(b)))

    finalize(solve, solver.free_memory, everything=True)
    for number, value in PARDISO_SETTINGS.items():
        solver.set_iparm(number, value)
    solver.set_iparm(PARDISO_OWN_ORDER, int(cholmod.available()))
    if cholmod.available():
        solver.perm = (_unknown_order(lower, order, last) + 1).astype(np.int32)
    try:
        solver._call_pardiso(lower.T.tocsr(), np.zeros((size, 1)))
    except PyPardisoError:
        raise ComputationFailed(SINGULAR) from None
    solver.set_phase(33)  # substitution without refinement: the matrix is not read
    return solve


def _superlu(lower: sp.csr_array, refusal: str) -> Any:
    """Return the factor of SuperLU, without pivoting, to keep the symmetric ordering.

    Raises ComputationFailed with the text `refusal`.
    """
    from scipy.sparse.linalg import splu

    whole = (lower + sp.tril(lower, -1).T).tocsc()
    options = {"SymmetricMode": True}
    try:
        return splu(
            whole,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options=options,
        )
    except RuntimeError:
        raise ComputationFailed(refusal) from None


def superlu(lower: sp.csr_array) -> Solve:
    """Factorise as `factorise` with SuperLU."""
    factor = _superlu(lower, SINGULAR)
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
    reduced : loads (m, k) -> intermediate solution (m, k) for `expanded`, and condensed loads (b,
        k) on the boundary.
    expanded : intermediate solution (m, k), boundary unknowns (b, k) -> all unknowns (m, k).
    """

    schur: Array
    reduced: Callable[[Array], tuple[Array, Array]]
    expanded: Callable[[Array, Array], Array]


class _Cholesky:
    """Factorisation by CHOLMOD with the last unknowns last, for which L is read."""

    def __init__(
        self,
        K: Any,
        order: Index,
        last: int,
    ) -> None:
        size = len(order)
        self.inner = size - last
        self.factor = cholmod.analysed(K, order)
        cholmod.factorise(K, self.factor)
        numbers = np.arange(size, dtype=float)[:, None]
        places = cholmod.solve(self.factor, numbers, cholmod.PERMUTE)[self.inner :, 0]
        if not np.array_equal(places, np.arange(self.inner, size)):
            # inner unknowns without connection to the last are not held
            raise ComputationFailed(SINGULAR)
        self.L = cholmod.trailing(self.factor, last)

    def solve(self, b: Array) -> Array:
        """Return the solution of K x = b."""
        if b[: self.inner].any():
            return cholmod.solve(self.factor, b)
        return self.backward(self.forward(b))

    def forward(self, b: Array) -> Array:
        """Return the solution of L y = P b, from the last rows of L if only they are loaded."""
        if b[: self.inner].any():
            permuted = cholmod.solve(self.factor, b, cholmod.PERMUTE)
            return cholmod.solve(self.factor, permuted, cholmod.FORWARD)
        edge = solve_triangular(self.L, b[self.inner :], lower=True)
        return np.concatenate([b[: self.inner], edge])

    def backward(self, y: Array) -> Array:
        """Return the solution of L' P x = y."""
        permuted = cholmod.solve(self.factor, y, cholmod.BACKWARD)
        return cholmod.solve(self.factor, permuted, cholmod.RESTORE)


def condense(
    lower: sp.csr_array,
    boundary: int,
    order: Index | None = None,
) -> Condensed:
    """Condense a positive definite matrix onto its last unknowns.

    order : of the nodes, as in `factorise`. Raises ComputationFailed when the matrix is singular.
    """
    if not cholmod.available():
        return _condensed_by_solves(lower, boundary)
    inner = lower.shape[0] - boundary
    K = cholmod.matrix_of(lower)
    unknowns = _unknown_order(lower, order, boundary)
    del lower  # frees its memory for the factor unless the caller holds it
    of = _Cholesky(K, unknowns, boundary)
    del K

    def reduced(loads: Array) -> tuple[Array, Array]:
        y = of.forward(loads)
        return y, of.L @ y[inner:]

    def expanded(y: Array, edge: Array) -> Array:
        x = of.backward(np.concatenate([y[:inner], of.L.T @ edge]))
        x[inner:] = edge  # without the round-off of the substitution
        return x

    return Condensed(of.L @ of.L.T, reduced, expanded)


def _condensed_by_solves(lower: sp.csr_array, boundary: int) -> Condensed:
    """Condense by a solve for every boundary unknown, with a factor of the inner unknowns alone."""
    inner = lower.shape[0] - boundary
    coupling = lower[inner:, :inner]
    K_bb = lower[inner:, inner:].toarray()
    K_bb = K_bb + np.tril(K_bb, -1).T
    solve = factorise(lower[:inner, :inner])
    schur = K_bb - coupling @ solve(coupling.T.toarray())

    def reduced(loads: Array) -> tuple[Array, Array]:
        x = solve(loads[:inner])
        edge = np.zeros((boundary, loads.shape[1]))
        return np.concatenate([x, edge]), loads[inner:] - coupling @ x

    def expanded(x: Array, edge: Array) -> Array:
        return np.concatenate([x[:inner] - solve(coupling.T @ edge), edge])

    return Condensed((schur + schur.T) / 2, reduced, expanded)


class _Analysed(NamedTuple):
    """A matrix in cvxopt with its symbolic factor and the pattern of its rows."""

    starts: Index
    columns: Index
    matrix: Any
    factor: Any

    def has_pattern_of(self, lower: sp.csr_array) -> bool:
        same_starts = np.array_equal(self.starts, lower.indptr)
        return same_starts and np.array_equal(self.columns, lower.indices)


class Factoriser:
    """Factorise matrices, definite or not; successive ones of one pattern share an order (CHOLMOD).

    Indefinite ones are factorised as `L D L'`, without exchange of rows.

    Attributes
    ----------
    negative : number of negative pivots of the last matrix, which is that of its negative
        eigenvalues.
    """

    def __init__(
        self,
        order: Index | None = None,
        last: int = 0,
    ) -> None:
        """`order` and `last` as of `factorise`."""
        self.negative = 0
        self._order = order
        self._last = last
        self._analysed: _Analysed | None = None

    def __call__(self, lower: sp.csr_array) -> Solve:
        """Return the solver of a matrix, valid until the next call.

        Raises ComputationFailed for a singular matrix.
        """
        if cholmod.available():
            with suppress(ComputationFailed):  # indefinite
                solve = self._by_cholmod(lower)
                self.negative = 0
                return solve
        factor = _superlu(lower, UNSTABLE)
        self.negative = int(np.sum(factor.U.diagonal() < 0))
        return lambda b: np.asarray(factor.solve(b))

    def _by_cholmod(self, lower: sp.csr_array) -> Solve:
        lower.sort_indices()
        analysed = self._analysed
        if analysed is not None and analysed.has_pattern_of(lower):
            cholmod.set_values(analysed.matrix, lower.data)
        else:
            K = cholmod.matrix_of(lower)
            factor = cholmod.analysed(K, _unknown_order(lower, self._order, self._last))
            analysed = _Analysed(lower.indptr, lower.indices, K, factor)
            self._analysed = analysed
        factor = analysed.factor
        cholmod.factorise(analysed.matrix, factor)
        return lambda b: cholmod.solve(factor, b)
