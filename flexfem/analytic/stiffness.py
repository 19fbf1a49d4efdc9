"""Stiffness of the platform from the joint springs at any configuration and load, (10)-(18), (28)-(31)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.kinematics import Freedoms, Joints, joints_of
from flexfem.analytic.loops import Choice, Influence, choose, columns, in_joint_order, influence
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array, Index, inverse
from flexfem.stage.designs import Frames


class Mechanism(NamedTuple):
    """A stage as the analytic model sees it; leading axes are designs, the joints are shared by all of them.

    springs : (..., N), stiffness of every joint, N mm/rad or N/mm.
    """

    frames: Frames
    joints: Joints
    choice: Choice
    springs: Array


class Stiffness(NamedTuple):
    """Stiffness at one configuration and load; nan for a design with singular loops or a singular K_aa.

    K_aa, C_aa : (..., M, M), stiffness of the independent joints (16) and its inverse.
    C_uu, K_uu : (..., 3, 3), compliance (17) and stiffness (18) of the platform in x, y, Phi: mm, N, rad.
    influence : the influence coefficients it was made from.
    """

    K_aa: Array
    C_aa: Array
    C_uu: Array
    K_uu: Array
    influence: Influence


class JointMotion(NamedTuple):
    """Joint displacements, rad and mm: independent (..., M), dependent (..., 6), all in joint order (..., N)."""

    independent: Array
    dependent: Array
    joints: Array


def mechanism(frames: Frames, compliance: Compliance, freedoms: Freedoms, choice: Choice | None = None) -> Mechanism:
    """Put springs on the joints that `freedoms` allows, each the inverse of its compliance (..., 3, 3).

    `choice` None takes `loops.choose`. Raises BadInput as `mobility.checked` does.
    """
    joints = joints_of(freedoms)
    table = np.stack(np.broadcast_arrays(*compliance), axis=-1)
    springs = 1.0 / table.reshape(*table.shape[:-3], 27)[..., joints.slot]  # (10)
    return Mechanism(frames, joints, choose(frames, joints, springs) if choice is None else choice, springs)


def stiffness(of: Mechanism, displacement: Array | None = None, load: Array | None = None) -> Stiffness:
    """K_aa (16), C_uu (17) and K_uu (18) at joint displacements (..., N) from rest and platform load (..., 3).

    The load is dead: a force at the platform centre, moving with it, and a moment. None is rest and no load. The
    displacements must close the loops (`equilibrium.close_loops`); at equilibrium K_uu is the tangent stiffness.
    """
    at = np.zeros(len(of.joints.kind)) if displacement is None else displacement
    F_u = np.zeros(3) if load is None else load
    first = influence(of.frames, of.joints, of.choice, at)
    K_a, K_p = split(of.springs, of.choice)
    _, tau_p = split(-of.springs * at, of.choice)
    G_p, G_pT = first.G_p, np.swapaxes(first.G_p, -1, -2)
    S = dot(tau_p, first.H_p) + dot(F_u, first.H_u)
    K_aa = diagonal(K_a) + G_pT @ diagonal(K_p) @ G_p - S  # (16)
    C_aa = _joint_compliance(K_a, K_p, G_p, S)
    C_uu = first.G_u @ C_aa @ np.swapaxes(first.G_u, -1, -2)  # (17)
    C_uu = 0.5 * (C_uu + np.swapaxes(C_uu, -1, -2))
    return Stiffness(K_aa, C_aa, C_uu, inverse(C_uu), first)  # (18)


def _joint_compliance(K_a: Array, K_p: Array, G_p: Array, S: Array) -> Array:
    """K_aa^-1 from the factors of (16), S being its second-order terms.

    Notes
    -----
    Stiff dependent springs (the paper's prismatic joints) would round the soft ones off in the sum K_aa. With
    K_a + G_p^T K_p G_p = R^T R from the QR factors of the weighted rows, K_aa = R^T (1 - R^-T S R^-1) R keeps them.
    """
    rows = np.concatenate(
        [diagonal(np.broadcast_to(np.sqrt(K_a), (*G_p.shape[:-2], G_p.shape[-1]))), np.sqrt(K_p)[..., None] * G_p],
        axis=-2,
    )
    R_inverse = inverse(np.linalg.qr(rows).R)
    R_inverseT = np.swapaxes(R_inverse, -1, -2)
    return R_inverse @ inverse(np.eye(G_p.shape[-1]) - R_inverseT @ S @ R_inverse) @ R_inverseT


def effective_load(of: Mechanism, first: Influence, displacement: Array, load: Array) -> Array:
    """T_a (..., M) on the independent joints (13): zero at equilibrium."""
    tau_a, tau_p = split(-of.springs * displacement, of.choice)
    return tau_a + transposed(first.G_p, tau_p) + transposed(first.G_u, load)  # (13)


def inverse_kinematics(of: Mechanism, at: Stiffness, du: Array) -> JointMotion:
    """Joint motion of least potential energy for the platform displacement du (..., 3), (29)-(31)."""
    G_u, G_p = at.influence.G_u, at.influence.G_p
    dphi_a = apply(at.C_aa, transposed(G_u, apply(at.K_uu, du)))  # (29)
    dphi_p = apply(G_p, dphi_a)  # (31)
    return JointMotion(dphi_a, dphi_p, in_joint_order(dphi_p[..., None], dphi_a[..., None], of.choice)[..., 0])


def split(values: Array, choice: Choice) -> tuple[Array, Array]:
    """Values of the independent (..., M) and the dependent (..., 6) joints out of all (..., N)."""
    return _pick(values, choice.independent), _pick(values, choice.dependent)


def dot(v: Array, H: Array) -> Array:
    """(v o H)_ab = sum_k v_k H_kab."""
    product: Array = np.einsum("...k,...kab->...ab", v, H)
    return product


def apply(A: Array, v: Array) -> Array:
    """A v over leading axes."""
    return (A @ v[..., None])[..., 0]


def transposed(A: Array, v: Array) -> Array:
    """A^T v over leading axes."""
    return apply(np.swapaxes(A, -1, -2), v)


def diagonal(values: Array) -> Array:
    """Diagonal matrices (..., n, n) of (..., n)."""
    return values[..., None] * np.eye(values.shape[-1])


def _pick(values: Array, index: Index) -> Array:
    return columns(values[..., None, :], index)[..., 0, :]
