"""Three chains of three hinges between the ground and the platform answer what is asked of stages at rest, n at once.

Twists and wrenches x, y, theta are at the platform centre at rest. With the twist V of the platform, the wrench w_i
that chain i takes from it, the gap e_i of a chain (thermal expansion), and the loads F on the platform and Q beyond
each hinge on the links of its chain,

    A_i = sum C,  B_i = sum C Q,  D = sum Q' C Q;    V - A w = B + e,    sum w_i = F

over the hinges of compliance C of each chain. Elastic pads, links and platform add to A, B and D, the platform to all
chains together, so that A is (9, 9). The motions that the loads do work on are `F' V + B' w + D`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, inverse


class ElasticBodies(NamedTuple):
    """What elastic pads, links and platform add under k loads: A (..., 9, 9), B (..., 3 chains, 3, k), D (..., k, k).

    B and D are zero without loads on elastic links.
    """

    A: Array
    B: Array = np.zeros((3, 3, 1))
    D: Array = np.zeros((1, 1))


class UnderLoads(NamedTuple):
    """What k loads and gaps do.

    platform : (..., 3, k), its twist.   wrenches : (..., 3 chains, 3 hinges, 3, k), in the hinges.
    motions : (..., k, k), what the loads (rows) do work on, by loads (columns).
    """

    platform: Array
    wrenches: Array
    motions: Array


def joint_compliance(places: Array, axes: Array, rotation: Array, axial: Array, shear: Array) -> Array:
    """Compliance (..., 3, 3) at the origin of joints at `places` (..., 2) with axes at the angles `axes` (...), rad.

    Notes
    -----
    G k^-1 G^T with the columns (y, -x, 1) for rotation, (c, s, 0) for axial and (-s, c, 0) for shear, written out.
    """
    x, y = places[..., 0], places[..., 1]
    c, s = np.cos(axes), np.sin(axes)
    xt, yt = y * rotation, -x * rotation
    xx, yy = y * xt + c * c * axial + s * s * shear, -x * yt + s * s * axial + c * c * shear
    xy = y * yt + c * s * (axial - shear)
    rows = np.stack(np.broadcast_arrays(xx, xy, xt, xy, yy, yt, xt, yt, rotation))
    return np.moveaxis(rows.reshape(3, 3, *xx.shape), (0, 1), (-2, -1))  # entry by entry in memory: faster


def stiffness(hinges: Array, bodies: Array | None = None) -> tuple[Array, Array]:
    """Stiffness (..., 3, 3) of the platform, and wrenches (..., 3 chains, 3, 3) of the chains per displacement of it.

    Parameters
    ----------
    hinges : (..., 3 chains, 3 hinges, 3, 3), compliances.
    bodies : (..., 9, 9), as A of `ElasticBodies`; None where they are rigid.

    Notes
    -----
    nan for a design with a chain that has no compliance in some direction.
    """
    A = np.sum(hinges, axis=-3)
    pulls = inverse(A) if bodies is None else _by_chain(inverse(_together(A) + bodies) @ np.tile(np.eye(3), (3, 1)))
    return np.sum(pulls, axis=-3), pulls


def solve(hinges: Array, loads: Array, gaps: Array | None = None, bodies: ElasticBodies | None = None) -> UnderLoads:
    """What loads (..., 7, 3, k) on the platform and the links, chain by chain, and gaps (..., 3 chains, 3, k) do.

    nan for a design as of `stiffness`.
    """
    first, second = np.moveaxis(loads[..., 1:, :, :].reshape(*loads.shape[:-3], 3, 2, *loads.shape[-2:]), -3, 0)
    beyond = np.stack([first + second, second, 0.0 * second], axis=-3)
    own = hinges @ beyond if beyond.any() else beyond
    A, B, D = _together(np.sum(hinges, axis=-3)), np.sum(own, axis=-3), np.einsum("...ijak,...ijal->...kl", beyond, own)
    if bodies is not None:
        A, B, D = A + bodies.A, B + bodies.B, D + bodies.D
    B, F = _column(B), loads[..., 0, :, :]
    t, W, G = B if gaps is None else B + _column(gaps), inverse(A), np.tile(np.eye(3), (3, 1))
    pulls = W @ G
    V = inverse(G.T @ pulls) @ (F + np.swapaxes(pulls, -1, -2) @ t)
    w = W @ (G @ V - t)
    motions = np.swapaxes(F, -1, -2) @ V + np.swapaxes(B, -1, -2) @ w + D
    return UnderLoads(V, _by_chain(w)[..., None, :, :] + beyond, motions)


def with_springs(motions: Array, rates: Array) -> Array:
    """Motions (..., k, k) of k loads with springs of stiffness (n,) along the lines of n more loads.

    motions : (..., k + n, k + n), of all of them without springs, as `solve` has it.
    """
    k, root = motions.shape[-1] - len(rates), np.sqrt(rates)
    across, openings = motions[..., :k, k:] * root, root[:, None] * motions[..., k:, k:] * root
    held = np.linalg.solve(np.eye(len(rates)) + openings, root[:, None] * motions[..., k:, :k])
    return np.asarray(motions[..., :k, :k] - across @ held)


def _together(A: Array) -> Array:
    """Compliance (..., 9, 9) of all chains together, of those (..., 3, 3, 3) of each."""
    return np.asarray(np.einsum("pq,...pab->...paqb", np.eye(3), A).reshape(*A.shape[:-3], 9, 9))


def _column(parts: Array) -> Array:
    return parts.reshape(*parts.shape[:-3], 9, parts.shape[-1])


def _by_chain(column: Array) -> Array:
    return column.reshape(*column.shape[:-2], 3, 3, column.shape[-1])
