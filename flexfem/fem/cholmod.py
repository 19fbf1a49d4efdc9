"""CHOLMOD and AMD of the cvxopt wheel; the only module that imports it.

Two things are taken from the memory of cvxopt and CHOLMOD by ctypes, because no function gives
them as fast. One sector of the reference stage took, without and with this, on one core:

| step | plane, 21,600 unknowns | plane, 79,300 | extruded, 47,600 |
|---|---|---|---|
| matrix into cvxopt | 10, 0.1 ms | 24, 0.8 ms | 127, 2 ms |
| trailing block of L | 19, 0.1 ms | 423, 0.1 ms | 811, 0.1 ms |
| numerical factorisation, for comparison | 12 ms | 54 ms | 124 ms |

The fields of a factor are compared with what is known of it before they are used; where they
differ, the block is found by substitution.
"""

from __future__ import annotations

import ctypes
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import ComputationFailed

SINGULAR = (
    "finite-element equations singular to working precision: a part is not supported, or a neck "
    "is too thin"
)
# the systems that CHOLMOD solves: K x = b, L x = b, L' x = b, x = P b, x = P' b
WHOLE = 0
FORWARD = 4
BACKWARD = 5
PERMUTE = 7
RESTORE = 8
CREATE_SPARSE = 4  # place of SpMatrix_New in the table of the C interface, in cvxopt.h
SUPERNODAL = (1, 1, 2, 1, 0)  # is_ll, is_super, itype, xtype, dtype of dense blocks of numbers
REAL = 1  # kind of numbers of a sparse matrix of cvxopt
COLUMNS_AT_ONCE = 64  # of the inverse of a trailing block


def available() -> bool:
    """Return whether the wheel is installed."""
    return find_spec("cvxopt") is not None


def minimum_degree(lower: sp.csr_array) -> Index:
    """Return the order (n,) of approximate minimum degree of a symmetric matrix (n, n)."""
    from cvxopt import amd

    return np.ravel(amd.order(matrix_of(lower), "U"))


def analysed(K: Any, order: Index) -> Any:
    """Return the symbolic factor of a matrix of `matrix_of`, with its unknowns in an order."""
    from cvxopt import cholmod, matrix

    cholmod.options["supernodal"] = 2
    cholmod.options["nmethods"] = 1  # else CHOLMOD also tries an order of its own and may prefer it
    factor = cholmod.symbolic(K, p=matrix(order.astype(np.int64)), uplo="U")
    del cholmod.options["nmethods"]  # it would disable the search for an order in later calls
    return factor


def factorise(K: Any, factor: Any) -> None:
    """Compute the numbers of a factor of `analysed`: `P K P' = L L'`.

    Raises ComputationFailed when the matrix is not positive definite.
    """
    from cvxopt import cholmod

    try:
        cholmod.numeric(K, factor)
    except ArithmeticError:
        raise ComputationFailed(SINGULAR) from None


def solve(
    factor: Any,
    b: Array,
    system: int = WHOLE,
) -> Array:
    """Solve one of the systems of CHOLMOD for right-hand sides (n, k)."""
    from cvxopt import cholmod, matrix

    x = matrix(b)
    cholmod.solve(factor, x, system)
    return np.asarray(x)


def set_values(K: Any, values: Array) -> None:
    """Replace the numbers (z,) of a matrix of `matrix_of`, whose pattern stays."""
    from cvxopt import matrix

    K.V = matrix(values)


def matrix_of(lower: sp.csr_array) -> Any:
    """Return the upper triangle of a symmetric matrix, given by its lower one, in cvxopt."""
    from cvxopt import base

    size = ctypes.c_ssize_t
    table = ctypes.cast(_content(base._C_API), ctypes.POINTER(ctypes.c_void_p))
    prototype = ctypes.PYFUNCTYPE(ctypes.py_object, size, size, size, ctypes.c_int)
    made = prototype(table[CREATE_SPARSE])(*lower.shape, lower.nnz, REAL)
    # the object holds the address of a structure, which starts with values, columns and rows
    (columns,) = _view(id(made) + object.__basicsize__, size, 1)
    values, starts, rows = _view(columns, size, 3)
    _view(values, ctypes.c_double, lower.nnz)[:] = lower.data
    _view(starts, size, len(lower.indptr))[:] = lower.indptr
    _view(rows, size, lower.nnz)[:] = lower.indices
    return made


def trailing(factor: Any, count: int) -> Array:
    """Return the last rows and columns (count, count) of L.

    A function of cvxopt copies all of L at once, but spends the factor.
    """
    of = _Factor.from_address(_content(factor))
    if not of.is_as_expected(count):
        return _trailing_by_substitution(factor, of.n, count)
    first = of.n - count
    starts = _view(of.super, ctypes.c_int64, of.nsuper + 1)
    rows_at = _view(of.pi, ctypes.c_int64, of.nsuper + 1)
    values_at = _view(of.px, ctypes.c_int64, of.nsuper + 1)
    numbers = _view(of.s, ctypes.c_int64, of.ssize)
    values = _view(of.x, ctypes.c_double, of.xsize)
    L = np.zeros((count, count))
    for j in range(np.searchsorted(starts, first, side="right") - 1, of.nsuper):
        rows = numbers[rows_at[j] : rows_at[j + 1]]
        wide = starts[j + 1] - starts[j]
        skip = max(first - starts[j], 0)
        columns = slice(starts[j] + skip - first, starts[j + 1] - first)
        block = values[values_at[j] : values_at[j + 1]].reshape(wide, len(rows)).T
        L[rows[skip:] - first, columns] = block[skip:, skip:]
    return np.asarray(np.tril(L))


def _trailing_by_substitution(
    factor: Any,
    size: int,
    count: int,
) -> Array:
    """Return what `trailing` does as the inverse of the block of the inverse of L."""
    first = size - count
    inverse = np.zeros((count, count))
    for start in range(0, count, COLUMNS_AT_ONCE):
        columns = np.eye(size, min(COLUMNS_AT_ONCE, count - start), -first - start)
        inverse[:, start : start + COLUMNS_AT_ONCE] = solve(factor, columns, FORWARD)[first:]
    return np.asarray(np.linalg.inv(inverse))


class _Factor(ctypes.Structure):
    """The first fields of `cholmod_factor` in cholmod.h of CHOLMOD 3.

    A supernode is a set of columns of L with the same rows below, kept as a dense block by columns.
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

    def is_as_expected(self, count: int) -> bool:
        """Return whether the fields are those of a complete factor of dense blocks of numbers."""
        complete = self.minor == self.n >= count
        kinds = (self.is_ll, self.is_super, self.itype, self.xtype, self.dtype)
        return bool(complete and kinds == SUPERNODAL)


def _content(capsule: Any) -> Any:
    """Return the address that a capsule holds."""
    name = ctypes.pythonapi.PyCapsule_GetName
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    name.restype = ctypes.c_char_p
    name.argtypes = [ctypes.py_object]
    pointer.restype = ctypes.c_void_p
    pointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return pointer(capsule, name(capsule))


def _view(
    address: int,
    kind: Any,
    length: int,
) -> AnyArray:
    """Return an array (length,) of the values at an address."""
    return np.ctypeslib.as_array(ctypes.cast(int(address), ctypes.POINTER(kind)), (length,))
