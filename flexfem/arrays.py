"""Array types, rotations, and the inverse of small matrices with a check of their condition."""

from __future__ import annotations

from textwrap import shorten
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.int64]
AnyArray: TypeAlias = NDArray[Any]
Kind = TypeVar("Kind", bound=type)

LONGEST = 300  # characters of `repr`
ROUND_OFF = (
    1e-12  # relative to the reference value; smaller numbers are printed as 0, records keep them
)
SINGULAR = 1e10  # condition number of the equilibrated matrix that leaves six digits of sixteen


def short_repr(kind: Kind) -> Kind:
    """Decorate a named tuple: `repr` has its numbers and texts, and only the sizes of arrays and
    collections.
    """

    def text(value: Any) -> str:
        if isinstance(value, np.ndarray):
            return f"array {value.shape}"
        if (
            hasattr(value, "__len__")
            and not isinstance(value, str)
            and not hasattr(value, "_fields")
        ):
            return f"{len(value)} entries"
        plain = value is None or isinstance(value, str | bool | int | float)
        return (
            shorten(repr(value), LONGEST // 4, placeholder="...") if plain else type(value).__name__
        )

    def of(record: Any) -> str:
        parts = ", ".join(f"{name}={text(value)}" for name, value in record._asdict().items())
        return shorten(f"{type(record).__name__}({parts})", LONGEST, placeholder=" ...)")

    kind.__repr__ = of  # type: ignore[method-assign, assignment]
    return kind


def inverse(A: Array) -> Array:
    """Return the inverse of the matrices A (..., n, n); nan where the condition number exceeds
    `SINGULAR`.

    Notes
    -----
    Rows and columns are first scaled to unit largest entry, so that the condition number (1-norm)
    does not depend on the units mm and rad. One singular design in a batch leaves the others
    untouched."""
    with np.errstate(
        divide="ignore",
        invalid="ignore",
        over="ignore",
    ):
        a = np.ascontiguousarray(
            np.moveaxis(A, (-2, -1), (0, 1))
        )  # designs last: contiguous vector operations
        row_scale = 1.0 / np.max(np.abs(a), axis=1, keepdims=True)
        column_scale = 1.0 / np.max(np.abs(row_scale * a), axis=0, keepdims=True)
        scaled = row_scale * a * column_scale
        scaled = np.where(np.all(np.isfinite(scaled), axis=(0, 1)), scaled, 0.0)
        inverted = _inverse_3x3(scaled) if len(a) == 3 else _inverse_nxn(scaled)
        trusted = _norm(scaled) * _norm(inverted) <= SINGULAR  # False for nan
        inverted = np.where(trusted, inverted, np.nan)
        inverted = np.swapaxes(column_scale, 0, 1) * inverted * np.swapaxes(row_scale, 0, 1)
        return np.asarray(np.moveaxis(inverted, (0, 1), (-2, -1)))


def rotation(angle: float) -> Array:
    """Return the matrix (3, 3) that turns x, y, theta by an angle, rad, about the origin."""
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(points: Array, angle: Array | float) -> Array:
    """Return points (..., 2) turned about the origin by `angle` (...), rad."""
    c = np.cos(angle)
    s = np.sin(angle)
    x = points[..., 0]
    y = points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def free_stiffness(stiffness: Array) -> Array:
    """Return `1 / C_ii` (..., n), the stiffness in each direction with the others free, of
    stiffnesses (..., n, n).

    `K_ii` is that with them held.
    """
    return np.asarray(1 / np.diagonal(np.linalg.inv(stiffness), axis1=-2, axis2=-1))


def _inverse_3x3(a: Array) -> Array:
    """Inverse of (3, 3, ...) by elimination of the last row and column; not finite where singular.

    Notes
    -----
    Cofactors would lose digits with the square of the condition number: the compliance at a remote
    point is nearly that of its rotation alone, which has rank one."""
    (a00, a01, a02), (a10, a11, a12), (a20, a21, a22) = a
    u = a02 / a22
    v = a12 / a22
    x = a20 / a22
    y = a21 / a22
    p = a00 - u * a20
    q = a01 - u * a21
    r = a10 - v * a20
    s = a11 - v * a21
    determinant = p * s - q * r
    p, q, r, s = s / determinant, -q / determinant, -r / determinant, p / determinant
    g = -(p * u + q * v)
    h = -(r * u + s * v)
    inverted = np.empty_like(a)
    inverted[0] = (p, q, g)
    inverted[1] = (r, s, h)
    inverted[2] = -(x * p + y * r), -(x * q + y * s), 1 / a22 - x * g - y * h
    return inverted


def _inverse_nxn(a: Array) -> Array:
    """Inverse of (n, n, ...) by LAPACK; nan where singular."""
    matrices = np.moveaxis(a, (0, 1), (-2, -1))
    regular = np.linalg.slogdet(matrices).sign[..., None, None] != 0.0
    inverted = np.where(regular, np.linalg.inv(np.where(regular, matrices, np.eye(len(a)))), np.nan)
    return np.moveaxis(inverted, (-2, -1), (0, 1))


def _norm(a: Array) -> Array:
    """1-norm (...) of (n, n, ...)."""
    return np.asarray(np.max(np.sum(np.abs(a), axis=0), axis=0))


TIE_TOLERANCE = (
    1e-7  # relative; values that symmetry makes equal, also of finite elements, differ by less
)


def direction(angle: Array) -> Array:
    """Unit vectors (..., 2) at the angles (...), rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def is_largest(values: Array, axis: int | tuple[int, ...] | None = None) -> NDArray[np.bool_]:
    """Return where values equal their maximum over the axes (None: over all), up to round-off."""
    return np.asarray(values >= (1 - TIE_TOLERANCE) * np.max(values, axis=axis, keepdims=True))


LOG_SCALE_RATIO = (
    30.0  # largest over smallest value above which an axis or a colour scale is logarithmic
)


def is_wide(values: Array) -> bool:
    """Return whether values (n,) are all positive and spread enough for a logarithmic scale."""
    return bool(0 < LOG_SCALE_RATIO * values.min() < values.max())
