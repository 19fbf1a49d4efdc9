"""The paper's equations (1) to (33), as the paper has them: at any configuration and load of the platform.

Mobility (1) and the freedoms of the hinges; chains at finite joint displacements with their influence coefficients
(4), (19) to (27); the two loops that the three chains close, dependent joints (5) to (9); stiffness of the platform
from the joint springs (10) to (18) and inverse kinematics (28) to (31). At rest `network` gives the same stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from numbers import Integral
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import Array, Index, inverse
from flexfem.hinges.chart import Compliance
from flexfem.mechanism.designs import Frames, direction
from flexfem.refused import BadInput

CHAINS = 3
LINKS = 8  # ground, platform, two links in each of three chains
KINDS = ("rotation", "axial", "shear")

Freedoms: TypeAlias = tuple[tuple[tuple[str, ...], ...], ...]

_R, _RA, _RAS = KINDS[:1], KINDS[:2], KINDS
FREEDOMS_BY_MOBILITY: dict[int, Freedoms] = {
    3: ((_R, _R, _R),) * CHAINS,
    6: ((_RA, _R, _R),) * CHAINS,
    12: ((_RA, _RA, _RA),) * CHAINS,
    21: ((_RAS, _RAS, _RAS),) * CHAINS,
}


def gruebler_kutzbach(links: int, joint_freedoms: Iterable[int], dimension: int = 3) -> int:
    """M = D (N - 1) + sum (f_i - D) (1), N links with the ground, D = 3 in the plane and 6 in space."""
    return dimension * (links - 1) + sum(f - dimension for f in joint_freedoms)  # (1)


def mobility(freedoms: Freedoms) -> int:
    """Mobility of the stage with this table by (1)."""
    return gruebler_kutzbach(LINKS, (len(hinge) for chain in freedoms for hinge in chain))


def freedoms_of(mobility: int | None, prismatic: ArrayLike | None = None) -> Freedoms:
    """The uniform table of mobility 3, 6, 12 or 21; for None that of a stage whose flags `prismatic` (3 chains, 3
    hinges) give a hinge its axial freedom. Raises BadInput for any other number."""
    if mobility is None and prismatic is not None:
        return tuple(tuple(_RA if flag else _R for flag in chain) for chain in np.asarray(prismatic, dtype=bool))
    if not isinstance(mobility, Integral) or mobility not in FREEDOMS_BY_MOBILITY:
        known = ", ".join(map(str, FREEDOMS_BY_MOBILITY))
        raise BadInput(f"mobility = {mobility}, expected one of {known}, or none for the stage's own prismatic hinges")
    return FREEDOMS_BY_MOBILITY[mobility]


ROTATION, AXIAL, SHEAR = range(3)
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # a quarter turn of the translation


class Joints(NamedTuple):
    """The N one-freedom joints of the stage, in order: chain by chain, base to platform, rotation, axial, shear.

    chain, hinge : (N,), counted from 0.   kind : (N,), index into `KINDS`.
    """

    chain: Index
    hinge: Index
    kind: Index

    @property
    def slot(self) -> Index:
        """(N,), place of each joint in the full table of 3 chains, 3 hinges and 3 kinds, flattened."""
        return 9 * self.chain + 3 * self.hinge + self.kind

    @property
    def chains(self) -> list[slice]:
        """Where each chain's joints are."""
        return [slice(*ends) for ends in pairwise(np.searchsorted(self.chain, [0, 1, 2, 3]).tolist())]

    @property
    def mobility(self) -> int:
        """M = N - 6, six joints being dependent in two loops."""
        return len(self.kind) - 6


def joints_of(freedoms: Freedoms) -> Joints:
    """The joints of a table of freedoms."""
    rows = [
        (i, j, KINDS.index(kind)) for i, chain in enumerate(freedoms) for j, hinge in enumerate(chain) for kind in hinge
    ]
    chain, hinge, kind = np.array(rows, dtype=np.int64).T
    return Joints(chain, hinge, kind)


class Configuration(NamedTuple):
    """The stage at given joint displacements, seen from every chain (which agree when the loops are closed).

    pose : (..., 3 chains, 3), displacement (x, y, Phi) of the platform from rest, mm and rad.
    pivots : (..., 3 chains, 3 hinges, 2), mm, where each hinge's base-side body holds its neck centre.
    axes : (..., 3 chains, 3 hinges), rad, direction of each neck.
    """

    pose: Array
    pivots: Array
    axes: Array


def chain_poses(frames: Frames, joints: Joints, displacement: Array) -> Configuration:
    """Finite displacement pose of the platform seen from each chain, (19)-(21).

    Parameters
    ----------
    frames : hinge frames at rest.
    displacement : (..., N), rad and mm from rest; broadcasts against the designs of `frames`.

    Notes
    -----
    A hinge turns first and slides then along its turned axis (axial) or normal (shear), as l1 = l10 + s along cos phi_1
    in (19). Links turn by (R - 1) = -2 sin^2(psi/2) + sin psi J: small motions keep all their digits.
    """
    table = np.zeros((*displacement.shape[:-1], 27))
    table[..., joints.slot] = displacement
    phi, axial, shear = np.moveaxis(table.reshape(*displacement.shape[:-1], 3, 3, 3), -1, 0)
    psi = np.cumsum(phi, axis=-1)
    axes = frames.axes + psi
    links = np.diff(frames.centres, axis=-2, append=np.zeros((*frames.centres.shape[:-2], 1, 2)))
    normals = np.stack([-links[..., 1], links[..., 0]], axis=-1)
    turn = -2.0 * np.sin(0.5 * psi[..., None]) ** 2 * links + np.sin(psi)[..., None] * normals
    along = axial[..., None] * direction(axes) + shear[..., None] * direction(axes + 0.5 * np.pi)
    moved = np.cumsum(turn + along, axis=-2)  # (19), (20)
    pivots = frames.centres + np.concatenate([np.zeros_like(moved[..., :1, :]), moved[..., :-1, :]], axis=-2)
    Phi = np.broadcast_to(psi[..., -1:], (*moved.shape[:-2], 1))  # (21)
    return Configuration(np.concatenate([moved[..., -1, :], Phi], axis=-1), pivots, axes)


def resting(frames: Frames, joints: Joints) -> Configuration:
    """The configuration of all joints at rest."""
    return chain_poses(frames, joints, np.zeros(len(joints.kind)))


def first_order(joints: Joints, at: Configuration) -> list[Array]:
    """Influence coefficients iG of each chain, (..., 3, N_i): u' = iG iphi' (4).

    Revolute at p: (-(y - p_y), x - p_x, 1); prismatic along d: (d_x, d_y, 0).
    """
    there = (at.pivots - at.pose[..., :, None, :2]) @ np.array([1, 1j])
    columns = np.moveaxis(freedom_motions(there, np.exp(1j * at.axes)), -2, -4)  # (..., row, chain, hinge, kind)
    G = columns.reshape(*columns.shape[:-3], 27)[..., joints.slot]
    return [G[..., mine] for mine in joints.chains]


def second_order(joints: Joints, iG: list[Array]) -> list[Array]:
    """Influence coefficients iH of each chain, (..., 3, N_i, N_i): u'' = iG iphi'' + iphi'^T iH iphi'.

    A revolute nearer the base, or the joint itself, turns the translation of the distal joint's column by a quarter:
    revolute-revolute (-(x - p_nx), -(y - p_ny), 0), revolute-prismatic (-d_ny, d_nx, 0); a proximal prismatic
    joint turns nothing: 0. Symmetric in its two joints.
    """
    found = []
    for mine, G in zip(joints.chains, iG, strict=True):
        turns = joints.kind[mine] == ROTATION
        m, n = np.indices((len(turns), len(turns)))
        found.append(turns[np.minimum(m, n)] * (QUARTER @ G)[..., np.maximum(m, n)])
    return found


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

    Mobility three: the base joints; mobility six with the axial freedom at the base: phi_1 and phi_2 of every chain,
    which costs digits of K_uu (1e-7 where entries of G_p are 1e5 mm/rad); `rank_revealing` does not lose them.
    """
    for number, last in ((3, 0), (6, 1)):
        if np.array_equal(joints.slot, joints_of(FREEDOMS_BY_MOBILITY[number]).slot):
            return chosen(joints, (joints.kind == ROTATION) & (joints.hinge <= last))
    return rank_revealing(frames, joints, springs)


def chosen(joints: Joints, independent: Array | Index) -> Choice:
    """The choice given by flags (N,), true for the M independent joints."""
    flags = np.asarray(independent, dtype=bool)
    assert flags.shape == joints.kind.shape and np.count_nonzero(~flags) == DEPENDENT
    return Choice(np.flatnonzero(flags), np.flatnonzero(~flags))


def rank_revealing(frames: Frames, joints: Joints, springs: Array) -> Choice:
    """Six dependent joints for every design by a pivoted QR decomposition of the loop Jacobian at rest.

    Columns are weighted by k^-1/2 (joint motions of equal energy), rows of rotation by the mean distance of the hinges
    from the platform centre: pivots then do not depend on units. Each pivot is the softest joint that the loops still
    hold, so stiff joints stay independent, where (16) adds their springs to the diagonal without rounding the others.
    """
    from scipy.linalg import qr  # a tenth of a second: for commanded joints alone

    at = resting(frames, joints)
    W, _ = _loops(at.pose, first_order(joints, at))
    length = np.sqrt(np.mean(np.sum(frames.centres**2, axis=-1), axis=(-2, -1)))[..., None, None]
    W = W * np.where(np.arange(DEPENDENT)[:, None] % 3 == 2, length, 1.0) / np.sqrt(springs)[..., None, :]
    order = np.array(
        [qr(each, mode="r", pivoting=True, check_finite=False)[1] for each in W.reshape(-1, *W.shape[-2:])]
    )
    order = order.reshape(*W.shape[:-2], W.shape[-1])
    return Choice(np.sort(order[..., DEPENDENT:]), np.sort(order[..., :DEPENDENT]))


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


def _both_sides(H: Array, G: Array) -> Array:
    G = G[..., None, :, :]
    return np.swapaxes(G, -1, -2) @ H @ G


def _loops(poses: Array, iG: list[Array]) -> tuple[Array, Array]:
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


class PaperModel(NamedTuple):
    """A stage as the analytic model sees it; leading axes are designs, the joints are shared by all of them.

    springs : (..., N), stiffness of every joint, N mm/rad or N/mm.
    """

    frames: Frames
    joints: Joints
    choice: Choice
    springs: Array


class JointStiffness(NamedTuple):
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


def mechanism(frames: Frames, compliance: Compliance, freedoms: Freedoms, choice: Choice | None = None) -> PaperModel:
    """Put springs on the joints that `freedoms` allows, inverses of compliances (..., 3, 3); None takes `choose`."""
    joints = joints_of(freedoms)
    table = np.stack(np.broadcast_arrays(*compliance), axis=-1)
    springs = 1.0 / table.reshape(*table.shape[:-3], 27)[..., joints.slot]  # (10)
    return PaperModel(frames, joints, choose(frames, joints, springs) if choice is None else choice, springs)


def stiffness(of: PaperModel, displacement: Array | None = None, load: Array | None = None) -> JointStiffness:
    """K_aa (16), C_uu (17) and K_uu (18) at joint displacements (..., N) from rest and platform load (..., 3).

    The load is dead: a force at the platform centre, moving with it, and a moment. None is rest and no load. The
    displacements must close the loops; at equilibrium K_uu is the tangent stiffness.
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
    return JointStiffness(K_aa, C_aa, C_uu, inverse(C_uu), first)  # (18)


def _joint_compliance(K_a: Array, K_p: Array, G_p: Array, S: Array) -> Array:
    """K_aa^-1 from the factors of (16), S being its second-order terms.

    Stiff dependent springs would round the soft ones off in the sum K_aa. With K_a + G_p^T K_p G_p = R^T R from the QR
    factors of the weighted rows, K_aa = R^T (1 - R^-T S R^-1) R keeps them.
    """
    soft = diagonal(np.broadcast_to(np.sqrt(K_a), (*G_p.shape[:-2], G_p.shape[-1])))
    R_inverse = inverse(np.linalg.qr(np.concatenate([soft, np.sqrt(K_p)[..., None] * G_p], axis=-2)).R)
    R_inverseT = np.swapaxes(R_inverse, -1, -2)
    return R_inverse @ inverse(np.eye(G_p.shape[-1]) - R_inverseT @ S @ R_inverse) @ R_inverseT


def effective_load(of: PaperModel, first: Influence, displacement: Array, load: Array) -> Array:
    """T_a (..., M) on the independent joints (13): zero at equilibrium."""
    tau_a, tau_p = split(-of.springs * displacement, of.choice)
    return tau_a + transposed(first.G_p, tau_p) + transposed(first.G_u, load)  # (13)


def inverse_kinematics(of: PaperModel, at: JointStiffness, du: Array) -> JointMotion:
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
