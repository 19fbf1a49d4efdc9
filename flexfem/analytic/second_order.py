"""What the two second-order terms of (16), `- tau_p o H_p - F_u o H_u`, are worth at poses away from rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.equilibrium import at_pose
from flexfem.analytic.inverse import inverse
from flexfem.analytic.stiffness import Mechanism, Stiffness, stiffness
from flexfem.arrays import Array

PLACES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # between two commands; more change nothing above rounding


class Tangents(NamedTuple):
    """Exact load (..., 3) at poses, and tangent stiffness (..., 3, 3) there with and without the second-order terms."""

    load: Array
    tangent: Array
    without: Array


class Missed(NamedTuple):
    """Relative values, the largest over a box of poses.

    position : distance of the linear from the exact position, rotations by the lever.
    terms : change of the diagonal of the tangent compliance by the second-order terms.
    """

    position: float
    terms: float


def without_terms(of: Mechanism, at: Stiffness) -> Array:
    """K_uu (..., 3, 3) at a configuration by (16) without `- tau_p o H_p - F_u o H_u`.

    Notes
    -----
    What stays, `K_a + G_p^T K_p G_p` with the influence coefficients of the displaced stage, is `G_a^T k G_a` over all
    springs k. Only both terms together mean something: in equilibrium their sum does not depend on which joints are
    called independent, while each alone does and may be many times the sum.
    """
    R = np.linalg.qr(np.sqrt(of.springs)[..., :, None] * at.influence.G_a).R
    half = at.influence.G_u @ inverse(R)
    return inverse(half @ np.swapaxes(half, -1, -2))


def tangents(of: Mechanism, poses: Array) -> Tangents:
    """Load and tangent stiffness of the pseudo-rigid stage held at poses (..., 3). Raises ComputationFailed."""
    exact = at_pose(of, poses)
    at = stiffness(of, exact.displacement, exact.load)
    return Tangents(exact.load, at.K_uu, without_terms(of, at))


def along(commanded: Array, axis: int) -> Array:
    """Poses (..., 3) of commands (...) along one axis."""
    return np.asarray(commanded[..., None] * np.eye(3)[axis])


def summed_loads(of: Mechanism, commanded: Array, axis: int) -> dict[str, Array]:
    """Loads (n, 3) by summing the stiffness `tangent` and `without` along the way from rest, one of the commands (n,).

    Raises ComputationFailed when a pose on the way is not reached.
    """
    half = np.diff(commanded)[:, None] / 2
    found = tangents(of, along(commanded[:-1, None] + half * (1 + PLACES), axis))
    loads = {}
    for name in ("without", "tangent"):
        steps = np.einsum("kq,kqi->ki", half * WEIGHTS, getattr(found, name)[..., axis])
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        loads[name] = total - total[np.argmin(np.abs(commanded))]
    return loads


def missed(of: Mechanism, amplitude: Array, lever: float) -> Missed:
    """What linear positions and tangents miss at corners, edges and faces of a box of poses (3,), mm and rad.

    Raises ComputationFailed when one of them is not reached.
    """
    poses = amplitude * np.array([np.subtract(place, 1.0) for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)])
    found, scale = tangents(of, poses), np.array([1.0, 1.0, lever])
    off = np.linalg.norm((found.load @ stiffness(of).C_uu - poses) * scale, axis=-1)
    with_, less = (np.diagonal(inverse(K), axis1=-2, axis2=-1) for K in (found.tangent, found.without))
    position = np.max(off / np.linalg.norm(poses * scale, axis=-1))
    return Missed(float(position), float(np.max(np.abs(with_ / less - 1))))
