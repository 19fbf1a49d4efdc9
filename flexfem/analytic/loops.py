"""The two loops the three chains close: dependent joints, and the stage's influence coefficients over the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.kinematics import ROTATION, Joints, chain_poses, first_order, second_order
from flexfem.arrays import Array, Index, inverse
from flexfem.stage.designs import Frames

DEPENDENT = 6  # three equations in each of two loops


class Choice(NamedTuple):
    """Which joints are independent (..., M) and which dependent (..., 6); no leading axes: the same for all designs."""

    independent: Index
    dependent: Index


class Influence(NamedTuple):
    """Influence coefficients of the stage at one configuration; nan for a design whose loops are singular.

    pose : (..., 3), platform displacement from rest, mm and rad, seen from chain 1.
    gap : (..., 6), pose of chain 1 minus that of chain 2, then minus that of chain 3: zero when the loops are closed.
    A_inverse : (..., 6, 6).
    G_p : (..., 6, M), phi_p' = G_p phi_a' (7).
    G_a : (..., N, M), all joints in joint order over the independent ones (8).
    G_u : (..., 3, M), u' = G_u phi_a' (9).
    H_p : (..., 6, M, M), H_u : (..., 3, M, M), second order, symmetric in the last two axes.
    """

    pose: Array
    gap: Array
    A_inverse: Array
    G_p: Array
    G_a: Array
    G_u: Array
    H_p: Array
    H_u: Array


def choose(frames: Frames, joints: Joints, springs: Array) -> Choice:
    """Independent joints: the paper's where its two tables apply, else by rank-revealing elimination at rest.

    Mobility three: the base joints; mobility six with the axial freedom at the base: phi_1 and phi_2 of every chain.
    The latter makes stiff prismatic joints dependent, which costs digits of K_uu in proportion to their entries of G_p
    (2e-12 while these stay below 1e3 mm/rad, 1e-7 at 1e5); `rank_revealing` does not lose them.
    """
    turning = joints.kind == ROTATION
    others = (joints.chain[~turning].tolist(), joints.hinge[~turning].tolist(), joints.kind[~turning].tolist())
    if len(turning) == 9:
        return chosen(joints, turning & (joints.hinge == 0))
    if others == ([0, 1, 2], [0, 0, 0], [1, 1, 1]):
        return chosen(joints, turning & (joints.hinge <= 1))
    return rank_revealing(frames, joints, springs)


def chosen(joints: Joints, independent: Array | Index) -> Choice:
    """The choice given by flags (N,), true for the M independent joints."""
    flags = np.asarray(independent, dtype=bool)
    assert flags.shape == joints.kind.shape and np.count_nonzero(~flags) == DEPENDENT
    return Choice(np.flatnonzero(flags), np.flatnonzero(~flags))


def rank_revealing(frames: Frames, joints: Joints, springs: Array) -> Choice:
    """Six dependent joints for every design by pivoted modified Gram-Schmidt on the loop Jacobian at rest.

    Notes
    -----
    Columns are weighted by k^-1/2 (joint motions of equal energy), rows of rotation by the mean distance of the hinges
    from the platform centre: pivots then do not depend on units. Each pivot is the softest joint that the loops still
    hold, so stiff joints stay independent, where (16) adds their springs to the diagonal without rounding the others.
    """
    at = chain_poses(frames, joints, np.zeros(len(joints.kind)))
    W, _ = _loops(at.pose, first_order(joints, at))
    length = np.sqrt(np.mean(np.sum(frames.centres**2, axis=-1), axis=(-2, -1)))[..., None, None]
    W = W * np.where(np.arange(DEPENDENT)[:, None] % 3 == 2, length, 1.0) / np.sqrt(springs)[..., None, :]
    dependent = np.zeros((*W.shape[:-2], W.shape[-1]), dtype=bool)
    for _ in range(DEPENDENT):
        norms = np.where(dependent, -1.0, np.sum(W**2, axis=-2))
        pivot = np.argmax(norms, axis=-1)[..., None]
        np.put_along_axis(dependent, pivot, True, axis=-1)
        q = np.take_along_axis(W, pivot[..., None, :], axis=-1)
        q = q / np.maximum(np.linalg.norm(q, axis=-2, keepdims=True), np.finfo(float).tiny)
        W = W - q * (np.swapaxes(q, -1, -2) @ W)
    order = np.argsort(~dependent, axis=-1, kind="stable")
    return Choice(order[..., DEPENDENT:], order[..., :DEPENDENT])


def influence(frames: Frames, joints: Joints, choice: Choice, displacement: Array) -> Influence:
    """First- and second-order influence coefficients at the joint displacements (..., N), (5)-(9)."""
    at = chain_poses(frames, joints, displacement)
    iG = first_order(joints, at)
    iH = second_order(joints, iG)
    L, gap = _loops(at.pose, iG)
    A, B = columns(L, choice.dependent), -columns(L, choice.independent)
    A_inverse = inverse(A)
    G_p = A_inverse @ B  # (7)
    G_a = in_joint_order(G_p, np.eye(joints.mobility), choice)  # (8)
    Q1, Q2, Q3 = (_both_sides(H, G_a[..., s, :]) for s, H in zip(joints.chains, iH, strict=True))
    M = joints.mobility
    H_p = np.einsum("...kl,...lab->...kab", A_inverse, np.concatenate([Q2 - Q1, Q3 - Q1], axis=-3))
    H_a = in_joint_order(H_p.reshape(*H_p.shape[:-2], M * M), np.zeros((M, M * M)), choice)
    H_a = H_a.reshape(*H_a.shape[:-1], M, M)
    one = joints.chains[0]
    G_u = iG[0] @ G_a[..., one, :]  # (9)
    H_u = Q1 + np.einsum("...kn,...nab->...kab", iG[0], H_a[..., one, :, :])
    return Influence(at.pose[..., 0, :], gap, A_inverse, G_p, G_a, G_u, H_p, H_u)


def open_loops(frames: Frames, joints: Joints, choice: Choice, displacement: Array) -> tuple[Array, Array]:
    """Only `A_inverse` (..., 6, 6) and `gap` (..., 6) of `influence`: what Newton's method closes the loops by."""
    at = chain_poses(frames, joints, displacement)
    L, gap = _loops(at.pose, first_order(joints, at))
    return inverse(columns(L, choice.dependent)), gap


def _both_sides(H: Array, G: Array) -> Array:
    G = G[..., None, :, :]
    return np.swapaxes(G, -1, -2) @ H @ G


def _loops(poses: Array, iG: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Loop Jacobian (..., 6, N), L phi' = 0, and gap (..., 6), by poses (..., 3, 3) and coefficients of the chains."""
    G1, G2, G3 = iG
    O2, O3 = np.zeros_like(G2), np.zeros_like(G3)
    upper = np.concatenate([G1, -G2, O3], axis=-1)  # (5)
    lower = np.concatenate([G1, O2, -G3], axis=-1)  # (6)
    first, second, third = np.moveaxis(poses, -2, 0)
    return np.concatenate([upper, lower], axis=-2), np.concatenate([first - second, first - third], axis=-1)


def columns(L: Array, index: Index) -> Array:
    """Columns `index` (..., K) of L (..., n, N), each design its own."""
    index = index.reshape((1,) * (L.ndim - 1 - index.ndim) + index.shape)
    return np.take_along_axis(L, index[..., None, :], axis=-1)


def in_joint_order(dependent: Array, independent: Array, choice: Choice) -> Array:
    """Rows of the dependent (..., 6, K) and the independent (..., M, K) joints, put back in joint order (..., N, K)."""
    lead = dependent.shape[:-2]
    rows = np.concatenate([dependent, np.broadcast_to(independent, lead + independent.shape[-2:])], axis=-2)
    back = np.argsort(np.concatenate([choice.dependent, choice.independent], axis=-1), axis=-1)
    back = back.reshape((1,) * (rows.ndim - 1 - back.ndim) + back.shape)
    return np.take_along_axis(rows, back[..., None], axis=-2)
