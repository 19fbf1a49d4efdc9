"""The error of a compliance relative to itself, in the energy product."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array

DEPENDENT = 1e-6  # share of the largest: combinations of loads with less energy are one load twice, but for round-off


class RelativeError(NamedTuple):
    """Of the finest compliance C, dC = m C + D: largest |m|, and half the spread of the eigenvalues of dC x = e C x."""

    common: float
    spread: float


def relative_error(steps: Array, compliances: Array, loads: Array | None = None) -> RelativeError:
    """Error of the last of three or more compliances (levels, n, n), coarse to fine.

    Parameters
    ----------
    steps : (levels,), resolutions to the power of the theoretical order.
    loads : (n, k), whose combinations alone count; None takes all.

    Notes
    -----
    Both differences between the finest three are taken to the finest by the theoretical order; the larger counts.
    """
    W = orthonormal(compliances[-1], np.eye(len(compliances[-1])) if loads is None else loads)
    C3, C2, C1 = (W.T @ C @ W for C in compliances[-3:])
    n3, n2, n1 = steps[-3:]
    errors = (C1 - C2) / (n1 / n2 - 1), (C2 - C3) / (n1 / n3 - n1 / n2)
    ends = np.array([np.linalg.eigvalsh(error)[[0, -1]] for error in errors])
    return RelativeError(float(np.max(np.abs(ends))), float(np.max(ends[:, 1] - ends[:, 0]) / 2))


def orthonormal(compliance: Array, loads: Array) -> Array:
    """Combinations W (n, k') of loads (n, k) with W' C W = 1; loads that are combinations of others add none."""
    size = np.sqrt(np.einsum("ik,ij,jk->k", loads, compliance, loads))
    B = loads[:, size > 0] / size[size > 0]
    values, vectors = np.linalg.eigh(B.T @ compliance @ B)
    kept = values > DEPENDENT * values[-1]
    return np.asarray(B @ vectors[:, kept] / np.sqrt(values[kept]))
