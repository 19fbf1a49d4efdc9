"""Inverse of small matrices that says when it cannot be trusted."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array

SINGULAR = 1e10  # condition number of the equilibrated matrix that leaves six digits of sixteen


def inverse(A: Array) -> Array:
    """Inverse of the matrices A (..., n, n); nan where A is singular or its condition number exceeds `SINGULAR`.

    Notes
    -----
    Rows and columns are scaled to unit largest entry first, so that the condition number (1-norm) does not depend on
    units of mm and rad. One singular design in a batch leaves the others untouched.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        rows = 1.0 / np.max(np.abs(A), axis=-1, keepdims=True)
        columns = 1.0 / np.max(np.abs(rows * A), axis=-2, keepdims=True)
        scaled = rows * A * columns
        finite = np.all(np.isfinite(scaled), axis=(-2, -1), keepdims=True)
        scaled = np.where(finite, scaled, 0.0)
        regular = np.linalg.slogdet(scaled).sign[..., None, None] != 0.0
        inverted = np.linalg.inv(np.where(regular, scaled, np.eye(A.shape[-1])))
        condition = _norm(scaled) * _norm(inverted)
        trusted = np.where(regular & (condition <= SINGULAR), inverted, np.nan)
        A_inverse: Array = np.swapaxes(columns, -1, -2) * trusted * np.swapaxes(rows, -1, -2)
        return A_inverse


def _norm(A: Array) -> Array:
    largest: Array = np.max(np.sum(np.abs(A), axis=-2, keepdims=True), axis=-1, keepdims=True)
    return largest
