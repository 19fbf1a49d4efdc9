"""Sparse Cholesky factorisation and static condensation: CHOLMOD of the cvxopt wheel when
installed, else SuperLU.

Extruded meshes are factorised by PARDISO when it is installed, but condensed by CHOLMOD, which is
as fast for sectors.

Matrices are symmetric and given by their lower triangles, by rows in ascending order: the upper
triangles by columns. The unknowns are those of the nodes of a plane mesh, equally many for each,
and any others last. Nodes, not unknowns, are ordered for little fill: in extruded meshes this is
faster and leaves less fill.

A matrix is condensed onto its last unknowns, the boundary, by one factorisation `P K P' = L L'`
with the boundary last in the elimination order: the trailing block of L gives the Schur complement
`S = L_bb L_bb'`."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias
from weakref import finalize

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import ComputationFailed

SINGULAR = (
    "finite-element equations singular to working precision: a part is not supported, or a neck "
    "is too thin"
)
UNSTABLE = "tangent stiffness singular to working precision: a limit or bifurcation load"
SUPERNODAL = (
    1,
    1,
    2,
    1,
    0,
)  # is_ll, is_super, itype, xtype and dtype of a factor of dense blocks of real numbers
WHOLE = 0
FORWARD = 4
BACKWARD = 5
PERMUTE = 7
RESTORE = 8  # CHOLMOD: K x = b, L x = b, L' x = b, x = P b, x = P' b

Solve: TypeAlias = Callable[[Array], Array]
"""Function from right-hand sides b (m, k) to solutions x (m, k)."""


def elimination_order(triangles: AnyArray, count: int) -> Index:
    """Return the order of `count` nodes for little fill; other numbers in the triangles (e, 6) are
    no nodes.

    The corners are in the order of approximate minimum degree in their own graph, and the middle of
    a side precedes its ends. On a million unknowns this takes half the time of minimum degree for
    all nodes, with 6 % less fill."""
    if find_spec("cvxopt") is None:
        return np.arange(count)
    nodes = np.where(triangles < count, triangles, -1)
    ends = nodes[:, :3]
    row, column = np.broadcast_arrays(ends[:, :, None], ends[:, None, :])
    met = (column >= 0) & (row >= column)
    graph = sp.csr_array(
        (np.ones(np.count_nonzero(met)), (row[met], column[met])), shape=(count, count)
    )
    place = np.append(
        np.argsort(_minimum_degree(graph)).astype(float), count
    )  # the last is that of no node
    place[nodes[:, 3:]] = np.minimum(place[ends], place[np.roll(ends, -1, axis=1)]) - 0.5
    return np.argsort(place[:count], kind="stable")


def _minimum_degree(lower: sp.csr_array) -> Index:
    from cvxopt import amd

    return np.ravel(amd.order(_to_cvxopt(lower), "U"))


def factorise(lower: sp.csr_array, order: Index | None = None, last: int = 0) -> Solve:
    """Factorise a positive definite matrix; loads on the `last` unknowns alone need only a backward
    substitution.

    order : of the nodes; None computes that of the unknowns.
    Raises ComputationFailed when the matrix is singular, or when a part is not connected to the
    last unknowns."""
    if (
        order is not None
        and lower.shape[0] - last > 2 * len(order)
        and find_spec("pypardiso") is not None
    ):
        with suppress(ImportError):  # without the library of MKL
            return pardiso(lower, order, last)  # extruded: in the plane CHOLMOD is as fast
    if find_spec("cvxopt") is None:
        return superlu(lower)
    K = _to_cvxopt(lower)
    unknowns = _unknown_order(lower, order, last)
    del lower  # frees its memory for the factor unless the caller holds it
    return _Cholesky(K, unknowns, last).solve


def _to_cvxopt(lower: sp.csr_array) -> Any:
    """Return the upper triangle, by the C API of cvxopt: its constructor from triplets takes ten
    times as long.
    """
    from cvxopt import base

    size = ctypes.c_ssize_t
    real = 1
    create = ctypes.cast(_content(base._C_API), ctypes.POINTER(ctypes.c_void_p))[
        4
    ]  # SpMatrix_New in cvxopt.h
    made = ctypes.PYFUNCTYPE(ctypes.py_object, size, size, size, ctypes.c_int)(create)(
        *lower.shape, lower.nnz, real
    )
    (columns,) = _view(
        id(made) + object.__basicsize__, size, 1
    )  # address of its `ccs`: values, columns, rows
    values, starts, rows = _view(columns, size, 3)
    _view(values, ctypes.c_double, lower.nnz)[:] = lower.data
    _view(starts, size, len(lower.indptr))[:] = lower.indptr
    _view(rows, size, lower.nnz)[:] = lower.indices
    return made


def _content(capsule: Any) -> Any:
    """Return the address that a capsule holds."""
    name = ctypes.pythonapi.PyCapsule_GetName
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    name.restype = ctypes.c_char_p
    name.argtypes = [ctypes.py_object]
    pointer.restype = ctypes.c_void_p
    pointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return pointer(capsule, name(capsule))


def _view(address: int, kind: Any, length: int) -> AnyArray:
    """Return an array (length,) of the values at an address."""
    return np.ctypeslib.as_array(ctypes.cast(int(address), ctypes.POINTER(kind)), (length,))


def _unknown_order(lower: sp.csr_array, order: Index | None, last: int) -> Index:
    """Order the unknowns: those of the nodes in their order, by default that of minimum degree,
    then the last ones.
    """
    size = lower.shape[0]
    inner = lower.shape[0] - last
    order = _minimum_degree(lower[:inner, :inner]) if order is None else order
    block = inner // len(order)
    return np.concatenate(
        [(order[:, None] * block + np.arange(block)).ravel(), np.arange(inner, size)]
    )


def _symbolic(K: Any, order: Index) -> Any:
    from cvxopt import cholmod, matrix

    cholmod.options["supernodal"] = 2
    cholmod.options["nmethods"] = 1  # else CHOLMOD also tries an order of its own and may prefer it
    symbolic = cholmod.symbolic(K, p=matrix(order.astype(np.int64)), uplo="U")
    del cholmod.options["nmethods"]  # it would disable the search for an order in later calls
    return symbolic


def _cholmod_factor(K: Any, symbolic: Any) -> Any:
    """Factorise with CHOLMOD in the order of a symbolic factor. Raises ComputationFailed."""
    from cvxopt import cholmod

    try:
        cholmod.numeric(K, symbolic)
    except ArithmeticError:
        raise ComputationFailed(SINGULAR) from None
    return symbolic


def _solve(factor: Any, b: Array, kind: int) -> Array:
    """Solve the CHOLMOD system `kind` for right-hand sides (m, k)."""
    from cvxopt import cholmod, matrix

    x = matrix(b)
    cholmod.solve(factor, x, kind)
    return np.asarray(x)


def pardiso(lower: sp.csr_array, order: Index | None = None, last: int = 0) -> Solve:
    """Factorise as `factorise` with PARDISO of MKL on all processors, in our order, else that of
    METIS.
    """
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    size = lower.shape[0]
    ordered = find_spec("cvxopt") is not None
    solver = PyPardisoSolver(mtype=2, phase=12)
    unread = sp.csr_array(lower.shape)  # definite; analysis and factor

    def solve(b: Array) -> Array:
        return np.asarray(solver._call_pardiso(unread, np.asfortranarray(b)))

    finalize(solve, solver.free_memory, everything=True)
    for number, value in {
        1: 1,
        2: 3,
        5: int(ordered),
    }.items():  # own settings, METIS, a given order
        solver.set_iparm(number, value)
    if ordered:
        solver.perm = (_unknown_order(lower, order, last) + 1).astype(np.int32)
    try:
        solver._call_pardiso(lower.T.tocsr(), np.zeros((size, 1)))
    except PyPardisoError:
        raise ComputationFailed(SINGULAR) from None
    solver.set_phase(33)  # substitution without refinement: the matrix is not read
    return solve


def _symmetric(lower: sp.csr_array) -> sp.csc_array:
    return (lower + sp.tril(lower, -1).T).tocsc()


def superlu(lower: sp.csr_array) -> Solve:
    """Factorise as `factorise` with SuperLU, without pivoting, to keep the symmetric ordering."""
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        factor = splu(
            _symmetric(lower), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
        )
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
    reduced : loads (m, k) -> intermediate solution (m, k) for `expanded`, and condensed loads (b,
    k) on the boundary.
    expanded : intermediate solution (m, k), boundary unknowns (b, k) -> all unknowns (m, k).
    """

    schur: Array
    reduced: Callable[[Array], tuple[Array, Array]]
    expanded: Callable[[Array, Array], Array]


class _Cholesky:
    """Factorisation of a matrix by CHOLMOD with the last unknowns last, whose rows and columns of L
    are read.
    """

    def __init__(self, K: Any, order: Index, last: int) -> None:
        size = len(order)
        self.inner = len(order) - last
        self.factor = _cholmod_factor(K, _symbolic(K, order))
        places = _solve(self.factor, np.arange(size, dtype=float)[:, None], PERMUTE)[
            self.inner :, 0
        ]
        if not np.array_equal(places, np.arange(self.inner, size)):
            raise ComputationFailed(
                SINGULAR
            )  # inner unknowns without connection to the last are not held
        self.L = _trailing(self.factor, size, last)

    def solve(self, b: Array) -> Array:
        """Solution of K x = b; loads on the last unknowns alone need only these rows of L and a
        substitution back.
        """
        return (
            _solve(self.factor, b, WHOLE)
            if b[: self.inner].any()
            else self.backward(self.forward(b))
        )

    def forward(self, b: Array) -> Array:
        """Solution of L y = P b."""
        if b[: self.inner].any():
            return _solve(self.factor, _solve(self.factor, b, PERMUTE), FORWARD)
        return np.concatenate(
            [b[: self.inner], solve_triangular(self.L, b[self.inner :], lower=True)]
        )

    def backward(self, y: Array) -> Array:
        """Solution of L' P x = y."""
        return _solve(self.factor, _solve(self.factor, y, BACKWARD), RESTORE)


def condense(lower: sp.csr_array, boundary: int, order: Index | None = None) -> Condensed:
    """Condense a positive definite matrix onto its last unknowns, with an order of the nodes as in
    `factorise`.

    Raises ComputationFailed when it is singular.
    """
    if find_spec("cvxopt") is None:
        return _by_solves(lower, boundary)
    inner = lower.shape[0] - boundary
    K = _to_cvxopt(lower)
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


class _Factor(ctypes.Structure):
    """The first fields of `cholmod_factor` in cholmod.h of CHOLMOD 3; they are checked before their
    use.
    """

    _sizes = (
        "n minor Perm ColCount IPerm nzmax p i x z nz next prev nsuper ssize xsize maxcsize "
        "maxesize super pi px s"
    )
    _kinds = "ordering is_ll is_super is_monotonic itype xtype dtype"
    _fields_ = (
        *((name, ctypes.c_size_t) for name in _sizes.split()),
        *((name, ctypes.c_int) for name in _kinds.split()),
    )


def _trailing(factor: Any, size: int, count: int) -> Array:
    """Return the last rows and columns (count, count) of L, read where CHOLMOD keeps them.

    cvxopt copies all of L at once and spends the factor. Where the fields of a factor are not the
    expected ones, the inverse of the block is found by substitution, which for many unknowns takes
    longer than the factorisation."""
    of = _Factor.from_address(_content(factor))
    first = size - count
    L = np.zeros((count, count))
    if (of.n, of.minor, of.is_ll, of.is_super, of.itype, of.xtype, of.dtype) != (
        size,
        size,
        *SUPERNODAL,
    ):
        for start in range(0, count, 64):
            columns = np.eye(size, min(64, count - start), -first - start)
            L[:, start : start + 64] = _solve(factor, columns, FORWARD)[first:]
        return np.asarray(np.linalg.inv(L))
    at, rows_at, values_at = (
        _view(part, ctypes.c_int64, of.nsuper + 1) for part in (of.super, of.pi, of.px)
    )
    numbers = _view(of.s, ctypes.c_int64, of.ssize)
    values = _view(of.x, ctypes.c_double, of.xsize)
    for j in range(
        np.searchsorted(at, first, side="right") - 1, of.nsuper
    ):  # supernodes, dense by columns
        rows = numbers[rows_at[j] : rows_at[j + 1]]
        wide = at[j + 1] - at[j]
        skip = max(first - at[j], 0)
        dense = values[values_at[j] : values_at[j + 1]].reshape(wide, len(rows)).T
        L[rows[skip:] - first, at[j] + skip - first : at[j + 1] - first] = dense[skip:, skip:]
    return np.asarray(np.tril(L))


def _by_solves(lower: sp.csr_array, boundary: int) -> Condensed:
    """Condense by a solve for every boundary unknown, with a factor of the inner unknowns alone."""
    inner = lower.shape[0] - boundary
    coupling = lower[inner:, :inner]
    K_bb = lower[inner:, inner:].toarray()
    solve = factorise(lower[:inner, :inner])
    schur = K_bb + np.tril(K_bb, -1).T - coupling @ solve(coupling.T.toarray())

    def reduced(loads: Array) -> tuple[Array, Array]:
        x = solve(loads[:inner])
        return np.concatenate([x, np.zeros((boundary, loads.shape[1]))]), loads[
            inner:
        ] - coupling @ x

    def expanded(x: Array, edge: Array) -> Array:
        return np.concatenate([x[:inner] - solve(coupling.T @ edge), edge])

    return Condensed((schur + schur.T) / 2, reduced, expanded)


class Factoriser:
    """Factorise matrices, definite or not; successive matrices of one pattern share an elimination
    order (CHOLMOD).

    Indefinite ones are factorised as `L D L'`, without exchange of rows.
    """

    negative: int = (
        0  # number of negative pivots of the last matrix, which is that of its negative eigenvalues
    )
    _pattern: tuple[Index, Index] | None = None
    _matrix: Any
    _symbolic: Any

    def __init__(self, order: Index | None = None, last: int = 0) -> None:
        self._order = order
        self._last = last

    def __call__(self, lower: sp.csr_array) -> Solve:
        """Return the solver of a matrix, valid until the next call. Raises ComputationFailed for a
        singular matrix.
        """
        from scipy.sparse.linalg import splu

        if find_spec("cvxopt") is not None:
            with suppress(ComputationFailed):  # indefinite
                solve = self._by_cholmod(lower)
                self.negative = 0
                return solve
        options = {"SymmetricMode": True}
        try:
            factor = splu(
                _symmetric(lower),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options=options,
            )
        except RuntimeError:
            raise ComputationFailed(UNSTABLE) from None
        self.negative = int(np.sum(factor.U.diagonal() < 0))
        return lambda b: np.asarray(factor.solve(b))

    def _by_cholmod(self, lower: sp.csr_array) -> Solve:
        from cvxopt import matrix

        lower.sort_indices()
        pattern = lower.indptr, lower.indices
        if self._pattern and all(map(np.array_equal, self._pattern, pattern)):
            self._matrix.V = matrix(lower.data)
        else:
            self._pattern, self._matrix = pattern, _to_cvxopt(lower)
            self._symbolic = _symbolic(self._matrix, _unknown_order(lower, self._order, self._last))
        return partial(_solve, _cholmod_factor(self._matrix, self._symbolic), kind=WHOLE)
