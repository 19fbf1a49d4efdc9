"""Types of arrays, and the inverse of small matrices that says when it cannot be trusted."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.int64]
AnyArray: TypeAlias = NDArray[Any]


ROUND_OFF = 1e-12  # of what a number is small against: less is printed as 0; records keep it
SINGULAR = 1e10  # condition number of the equilibrated matrix that leaves six digits of sixteen


def inverse(A: Array) -> Array:
    """Inverse of the matrices A (..., n, n); nan where A is singular or its condition number exceeds `SINGULAR`.

    Notes
    -----
    Rows and columns are scaled to unit largest entry first, so that the condition number (1-norm) does not depend on
    units of mm and rad. One singular design in a batch leaves the others untouched.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a = np.ascontiguousarray(np.moveaxis(A, (-2, -1), (0, 1)))  # entry by entry: many designs at full speed
        rows = 1.0 / np.max(np.abs(a), axis=1, keepdims=True)
        columns = 1.0 / np.max(np.abs(rows * a), axis=0, keepdims=True)
        scaled = rows * a * columns
        scaled = np.where(np.all(np.isfinite(scaled), axis=(0, 1)), scaled, 0.0)
        inverted = _by_parts(scaled) if len(a) == 3 else _by_elimination(scaled)
        trusted = _norm(scaled) * _norm(inverted) <= SINGULAR  # not for nan
        inverted = np.swapaxes(columns, 0, 1) * np.where(trusted, inverted, np.nan) * np.swapaxes(rows, 0, 1)
        A_inverse: Array = np.moveaxis(inverted, (0, 1), (-2, -1))
        return A_inverse


def alone(stiffness: Array) -> Array:
    """Stiffness (n,) along each direction with the others free, `1 / C_ii`; with the others held it is `K_ii`."""
    return np.asarray(1 / np.diag(np.linalg.inv(stiffness)))


def _by_parts(a: Array) -> Array:
    """Inverse of (3, 3, ...), by the last row and column first; not finite where singular.

    Notes
    -----
    Cofactors of all three would lose the square of the condition number: a compliance at a far point is nearly that of
    its rotation alone.
    """
    (a00, a01, a02), (a10, a11, a12), (a20, a21, a22) = a
    u, v, x, y = a02 / a22, a12 / a22, a20 / a22, a21 / a22
    p, q, r, s = a00 - u * a20, a01 - u * a21, a10 - v * a20, a11 - v * a21
    size = p * s - q * r
    p, q, r, s = s / size, -q / size, -r / size, p / size
    g, h = -(p * u + q * v), -(r * u + s * v)
    found = np.empty_like(a)
    found[0], found[1] = (p, q, g), (r, s, h)
    found[2] = -(x * p + y * r), -(x * q + y * s), 1 / a22 - x * g - y * h
    return found


def _by_elimination(a: Array) -> Array:
    """Inverse of (n, n, ...), nan where singular."""
    matrices = np.moveaxis(a, (0, 1), (-2, -1))
    regular = np.linalg.slogdet(matrices).sign[..., None, None] != 0.0
    inverted = np.where(regular, np.linalg.inv(np.where(regular, matrices, np.eye(len(a)))), np.nan)
    return np.moveaxis(inverted, (-2, -1), (0, 1))


def _norm(a: Array) -> Array:
    largest: Array = np.max(np.sum(np.abs(a), axis=0), axis=0)
    return largest


ALIKE = 1e-9  # relative: numbers that symmetry makes equal


def is_largest(values: Array, axis: int | tuple[int, ...] | None = None) -> NDArray[np.bool_]:
    """Where values are the largest along some axes or of all, those that symmetry makes equal too."""
    return np.asarray(values >= (1 - ALIKE) * np.max(values, axis=axis, keepdims=True))


WIDE = 30.0  # largest over smallest value, from which on an axis or colours are logarithmic


def wide(values: Array) -> bool:
    """Whether values (n,) are all positive and so far apart that they are best seen as logarithms."""
    return bool(0 < WIDE * values.min() < values.max())
