"""The paper's equations (1) to (33), in its own form, at any configuration and load.

Mobility (1) and the freedoms of the hinges; chains at finite joint displacements with their
influence coefficients (4), (19) to (27); the two loops of the three chains and their dependent
joints (5) to (9); stiffness of the platform from the joint springs (10) to (18) and inverse
kinematics (28) to (31). At rest `network` gives the same stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from numbers import Integral
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import Array, Index, direction, inverse
from flexfem.hinges.chart import Compliance
from flexfem.paper.frames import Frames
from flexfem.refused import BadInput

CHAINS = 3
LINKS = 8  # ground, platform, two links in each of three chains
KINDS = ("rotation", "axial", "shear")

Freedoms: TypeAlias = tuple[tuple[tuple[str, ...], ...], ...]

_R = KINDS[:1]
_RA = KINDS[:2]
_RAS = KINDS
FREEDOMS_BY_MOBILITY: dict[int, Freedoms] = {
    3: ((_R, _R, _R),) * CHAINS,
    6: ((_RA, _R, _R),) * CHAINS,
    12: ((_RA, _RA, _RA),) * CHAINS,
    21: ((_RAS, _RAS, _RAS),) * CHAINS,
}


def gruebler_kutzbach(
    links: int,
    joint_freedoms: Iterable[int],
    dimension: int = 3,
) -> int:
    """Return M = D (N - 1) + sum (f_i - D) (1) for N links, one of them the ground.

    D = 3 in the plane, 6 in space.
    """
    return dimension * (links - 1) + sum(f - dimension for f in joint_freedoms)  # (1)


def mobility(freedoms: Freedoms) -> int:
    """Return the mobility (1) of a stage whose hinges have these freedoms."""
    return gruebler_kutzbach(LINKS, (len(hinge) for chain in freedoms for hinge in chain))


def freedoms_of(mobility: int | None, prismatic: ArrayLike | None = None) -> Freedoms:
    """Return the freedoms for mobility 3, 6, 12 or 21.

    For None, the flags `prismatic` (3 chains, 3 hinges) of a stage state which hinges have an axial
    freedom. Raises BadInput for any other number.
    """
    if mobility is None and prismatic is not None:
        return tuple(
            tuple(_RA if flag else _R for flag in chain)
            for chain in np.asarray(prismatic, dtype=bool)
        )
    if not isinstance(mobility, Integral) or mobility not in FREEDOMS_BY_MOBILITY:
        known = ", ".join(map(str, FREEDOMS_BY_MOBILITY))
        raise BadInput(
            f"mobility = {mobility}, expected one of {known}, or none for the stage's own "
            "prismatic hinges"
        )
    return FREEDOMS_BY_MOBILITY[mobility]


ROTATION, AXIAL, SHEAR = range(3)
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # of the translation


class Joints(NamedTuple):
    """The N single-freedom joints of the stage, in order.

    They are in the order of chains, from base to platform, then rotation, axial, shear.

    chain, hinge : (N,), counted from 0.   kind : (N,), index into `KINDS`.
    """

    chain: Index
    hinge: Index
    kind: Index

    @property
    def slot(self) -> Index:
        """Index (N,) of each joint in the flat table of 3 chains, 3 hinges and 3 kinds."""
        return 9 * self.chain + 3 * self.hinge + self.kind

    @property
    def chains(self) -> list[slice]:
        """Slice of the joints of each chain."""
        return [
            slice(*ends) for ends in pairwise(np.searchsorted(self.chain, [0, 1, 2, 3]).tolist())
        ]

    @property
    def mobility(self) -> int:
        """M = N - 6, as two loops make six joints dependent."""
        return len(self.kind) - 6


def joints_of(freedoms: Freedoms) -> Joints:
    """Return the joints of a table of freedoms."""
    rows = [
        (i, j, KINDS.index(kind))
        for i, chain in enumerate(freedoms)
        for j, hinge in enumerate(chain)
        for kind in hinge
    ]
    chain, hinge, kind = np.array(rows, dtype=np.int64).T
    return Joints(chain, hinge, kind)


class Configuration(NamedTuple):
    """The stage at given joint displacements, by every chain.

    The poses agree when the loops are closed.

    pose : (..., 3 chains, 3), displacement (x, y, Phi) of the platform from rest, mm and rad.
    pivots : (..., 3 chains, 3 hinges, 2), neck centre of each hinge as a point of its base-side
        body, mm.
    axes : (..., 3 chains, 3 hinges), rad, direction of each neck.
    """

    pose: Array
    pivots: Array
    axes: Array


def chain_poses(
    frames: Frames,
    joints: Joints,
    displacement: Array,
) -> Configuration:
    """Return the platform pose at finite joint displacements by each chain, (19)-(21).

    Parameters
    ----------
    frames : hinge frames at rest.
    displacement : (..., N), rad and mm from rest; broadcasts against the designs of `frames`.

    Notes
    -----
    A hinge rotates first and then slides along its rotated axis (axial) or normal (shear), as l1 =
    l10 + s along cos phi_1 in (19). Links rotate by (R - 1) = -2 sin^2(psi/2) + sin psi J, which
    keeps all digits of small motions."""
    table = np.zeros((*displacement.shape[:-1], 27))
    table[..., joints.slot] = displacement
    phi, axial, shear = np.moveaxis(table.reshape(*displacement.shape[:-1], 3, 3, 3), -1, 0)
    psi = np.cumsum(phi, axis=-1)
    axes = frames.axes + psi
    links = np.diff(frames.centres, axis=-2, append=np.zeros((*frames.centres.shape[:-2], 1, 2)))
    normals = np.stack([-links[..., 1], links[..., 0]], axis=-1)
    rotation = -2.0 * np.sin(0.5 * psi[..., None]) ** 2 * links + np.sin(psi)[..., None] * normals
    sliding = axial[..., None] * direction(axes) + shear[..., None] * direction(axes + 0.5 * np.pi)
    shift = np.cumsum(rotation + sliding, axis=-2)  # (19), (20)
    pivots = frames.centres + np.concatenate(
        [np.zeros_like(shift[..., :1, :]), shift[..., :-1, :]], axis=-2
    )
    Phi = np.broadcast_to(psi[..., -1:], (*shift.shape[:-2], 1))  # (21)
    return Configuration(np.concatenate([shift[..., -1, :], Phi], axis=-1), pivots, axes)


def resting(frames: Frames, joints: Joints) -> Configuration:
    """Return the configuration of all joints at rest."""
    return chain_poses(frames, joints, np.zeros(len(joints.kind)))


def first_order(joints: Joints, at: Configuration) -> list[Array]:
    """Return the influence coefficients iG of each chain, (..., 3, N_i): u' = iG iphi' (4).

    Revolute at p: (-(y - p_y), x - p_x, 1); prismatic along d: (d_x, d_y, 0).
    """
    places = (at.pivots - at.pose[..., :, None, :2]) @ np.array([1, 1j])
    motions = freedom_motions(places, np.exp(1j * at.axes))
    table = np.moveaxis(motions, -2, -4)  # (..., row, chain, hinge, kind)
    G = table.reshape(*table.shape[:-3], 27)[..., joints.slot]
    return [G[..., own_joints] for own_joints in joints.chains]


def second_order(joints: Joints, iG: list[Array]) -> list[Array]:
    """Return the influence coefficients iH of each chain, (..., 3, N_i, N_i).

    They are those of u'' = iG iphi'' + iphi'^T iH iphi'.

    For two joints, the translation in the column of the distal one is rotated by a quarter turn if
    the proximal one is a revolute: revolute-revolute (-(x - p_nx), -(y - p_ny), 0),
    revolute-prismatic (-d_ny, d_nx, 0). It is zero if the proximal one is prismatic. Symmetric in
    the two joints.
    """
    iH = []
    for own_joints, G in zip(joints.chains, iG, strict=True):
        is_revolute = joints.kind[own_joints] == ROTATION
        m, n = np.indices((len(is_revolute), len(is_revolute)))
        iH.append(is_revolute[np.minimum(m, n)] * (QUARTER_TURN @ G)[..., np.maximum(m, n)])
    return iH


DEPENDENT = 6  # three equations in each of two loops


class Choice(NamedTuple):
    """Indices of independent (..., M) and dependent joints (..., 6), of all designs or of each."""

    independent: Index
    dependent: Index


class Influence(NamedTuple):
    """Influence coefficients at one configuration; nan for a design with singular loops.

    pose : (..., 3), platform displacement from rest by chain 1, mm and rad.
    gap : (..., 6), pose by chain 1 minus that by chain 2, then minus that by chain 3: zero when the
        loops are closed.
    A_inverse : (..., 6, 6).
    G_p : (..., 6, M), phi_p' = G_p phi_a' (7).
    G_a : (..., N, M), phi' = G_a phi_a' of all joints in joint order (8).
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


def choose(
    frames: Frames,
    joints: Joints,
    springs: Array,
) -> Choice:
    """Return the paper's choice of independent joints, else that of `rank_revealing`.

    The paper states one for some mobilities.

    For mobility three the paper takes the base joints; for mobility six with the axial freedom at
    the base it takes phi_1 and phi_2 of every chain, which costs digits of K_uu (1e-7 where entries
    of G_p are 1e5 mm/rad).
    """
    for number, last in ((3, 0), (6, 1)):
        if np.array_equal(joints.slot, joints_of(FREEDOMS_BY_MOBILITY[number]).slot):
            return chosen(joints, (joints.kind == ROTATION) & (joints.hinge <= last))
    return rank_revealing(frames, joints, springs)


def chosen(joints: Joints, is_independent: Array | Index) -> Choice:
    """Return the choice given by flags (N,), true for the M independent joints."""
    flags = np.asarray(is_independent, dtype=bool)
    assert flags.shape == joints.kind.shape and np.count_nonzero(~flags) == DEPENDENT
    return Choice(np.flatnonzero(flags), np.flatnonzero(~flags))


def rank_revealing(
    frames: Frames,
    joints: Joints,
    springs: Array,
) -> Choice:
    """Choose six dependent joints for every design.

    They follow by a pivoted QR decomposition of the loop Jacobian at rest.

    Columns are weighted by k^-1/2 (joint motions of equal energy), rows of rotation by the mean
    distance of the hinges from the platform centre, so that the pivots do not depend on units. Each
    pivot is the softest joint that the loops still constrain. Stiff joints stay independent: (16)
    adds their springs to the diagonal without rounding the others.
    """
    # takes a tenth of a second to import, and only commanded joints need it
    from scipy.linalg import qr

    at = resting(frames, joints)
    W, _ = _loop_equations(at.pose, first_order(joints, at))
    squares = np.sum(frames.centres**2, axis=-1)
    length = np.sqrt(np.mean(squares, axis=(-2, -1)))[..., None, None]
    is_rotation = np.arange(DEPENDENT)[:, None] % 3 == 2
    W = W * np.where(is_rotation, length, 1.0) / np.sqrt(springs)[..., None, :]
    pivots = list[Array]()
    for w in W.reshape(-1, *W.shape[-2:]):
        pivots.append(
            qr(
                w,
                mode="r",
                pivoting=True,
                check_finite=False,
            )[1]
        )
    order = np.array(pivots).reshape(*W.shape[:-2], W.shape[-1])
    return Choice(np.sort(order[..., DEPENDENT:]), np.sort(order[..., :DEPENDENT]))


def influence(
    frames: Frames,
    joints: Joints,
    choice: Choice,
    displacement: Array,
) -> Influence:
    """Return the influence coefficients of first and second order, (5) to (9).

    displacement : (..., N), of the joints.
    """
    at = chain_poses(frames, joints, displacement)
    iG = first_order(joints, at)
    L, gap = _loop_equations(at.pose, iG)
    A_inverse = inverse(columns(L, choice.dependent))
    G_p = A_inverse @ -columns(L, choice.independent)  # (7)
    G_a = in_joint_order(G_p, np.eye(joints.mobility), choice)  # (8)
    Q1, of_loops = _second_by_independent(joints, iG, G_a)
    H_p = np.einsum("...kl,...lab->...kab", A_inverse, of_loops)
    chain1 = joints.chains[0]
    G_u = iG[0] @ G_a[..., chain1, :]  # (9)
    H_1 = _second_in_joint_order(H_p, choice)[..., chain1, :, :]
    H_u = Q1 + np.einsum("...kn,...nab->...kab", iG[0], H_1)
    return Influence(at.pose[..., 0, :], gap, A_inverse, G_p, G_a, G_u, H_p, H_u)


def _second_by_independent(
    joints: Joints,
    iG: list[Array],
    G_a: Array,
) -> tuple[Array, Array]:
    """Return second derivatives by the independent joints, as of `second_order`.

    They are those of the first chain (..., 3, M, M), and of both loops (..., 6, M, M).

    G_a : (..., N, M), motions of all joints by the independent ones.
    """
    pairs = zip(joints.chains, second_order(joints, iG), strict=True)
    Q1, Q2, Q3 = (_congruence(G_a[..., own_joints, :], iH) for own_joints, iH in pairs)
    return Q1, np.concatenate([Q2 - Q1, Q3 - Q1], axis=-3)


def _second_in_joint_order(H_p: Array, choice: Choice) -> Array:
    """Return second derivatives (..., N, M, M) of all joints; those of independent ones are zero.

    H_p : (..., 6, M, M), of the dependent joints.
    """
    *lead, M, _ = H_p.shape
    flat = H_p.reshape(*lead, M * M)
    H_a = in_joint_order(flat, np.zeros((M, M * M)), choice)
    return H_a.reshape(*H_a.shape[:-1], M, M)


def _congruence(G: Array, H: Array) -> Array:
    """G^T H G for every row of H (..., 3, N_i, N_i)."""
    G = G[..., None, :, :]
    return np.swapaxes(G, -1, -2) @ H @ G


def _loop_equations(poses: Array, iG: list[Array]) -> tuple[Array, Array]:
    """Return the loop Jacobian L (..., 6, N), L phi' = 0, and the gap (..., 6) of chain poses.

    poses : (..., 3, 3).
    """
    G1, G2, G3 = iG
    O2 = np.zeros_like(G2)
    O3 = np.zeros_like(G3)
    upper = np.concatenate([G1, -G2, O3], axis=-1)  # (5)
    lower = np.concatenate([G1, O2, -G3], axis=-1)  # (6)
    first, second, third = np.moveaxis(poses, -2, 0)
    return np.concatenate([upper, lower], axis=-2), np.concatenate(
        [first - second, first - third], axis=-1
    )


def columns(L: Array, index: Index) -> Array:
    """Return the columns `index` (..., K) of L (..., n, N), which may differ between designs."""
    index = index.reshape((1,) * (L.ndim - 1 - index.ndim) + index.shape)
    return np.take_along_axis(L, index[..., None, :], axis=-1)


def in_joint_order(
    dependent: Array,
    independent: Array,
    choice: Choice,
) -> Array:
    """Merge rows of the dependent and the independent joints in joint order (..., N, K).

    dependent : (..., 6, K).   independent : (..., M, K).
    """
    lead = dependent.shape[:-2]
    rows = np.concatenate(
        [dependent, np.broadcast_to(independent, lead + independent.shape[-2:])], axis=-2
    )
    order = np.argsort(np.concatenate([choice.dependent, choice.independent], axis=-1), axis=-1)
    order = order.reshape((1,) * (rows.ndim - 1 - order.ndim) + order.shape)
    return np.take_along_axis(rows, order[..., None], axis=-2)


class PaperModel(NamedTuple):
    """Analytic model of a stage; leading axes are designs, the joints are shared by all of them.

    springs : (..., N), stiffness of every joint, N mm/rad or N/mm.
    """

    frames: Frames
    joints: Joints
    choice: Choice
    springs: Array


class JointStiffness(NamedTuple):
    """Stiffness at one configuration and load; nan with singular loops or a singular K_aa.

    K_aa, C_aa : (..., M, M), stiffness of the independent joints (16) and its inverse.
    C_uu, K_uu : (..., 3, 3), compliance (17) and stiffness (18) of the platform in x, y, Phi: mm,
        N, rad.
    influence : the influence coefficients of the configuration.
    """

    K_aa: Array
    C_aa: Array
    C_uu: Array
    K_uu: Array
    influence: Influence


class JointMotion(NamedTuple):
    """Joint displacements, rad and mm.

    They are independent (..., M), dependent (..., 6), and all in joint order (..., N).
    """

    independent: Array
    dependent: Array
    joints: Array


def mechanism(
    frames: Frames, compliance: Compliance, freedoms: Freedoms, choice: Choice | None = None
) -> PaperModel:
    """Return the model of hinges with compliances (..., 3, 3) in their `freedoms`.

    choice : None takes that of `choose`.
    """
    joints = joints_of(freedoms)
    table = np.stack(np.broadcast_arrays(*compliance), axis=-1)
    springs = 1.0 / table.reshape(*table.shape[:-3], 27)[..., joints.slot]  # (10)
    return PaperModel(
        frames, joints, choose(frames, joints, springs) if choice is None else choice, springs
    )


def stiffness(
    model: PaperModel, displacement: Array | None = None, load: Array | None = None
) -> JointStiffness:
    """Return K_aa (16), C_uu (17) and K_uu (18) at joint displacements and a load.

    The displacements (..., N) are from rest, and the load (..., 3) is on the platform.

    The load is dead: a force at the platform centre, moving with it, and a moment. None means rest
    and no load. The displacements must close the loops; at equilibrium K_uu is the tangent
    stiffness.
    """
    phi = np.zeros(len(model.joints.kind)) if displacement is None else displacement
    F_u = np.zeros(3) if load is None else load
    coefficients = influence(model.frames, model.joints, model.choice, phi)
    K_a, K_p = split(model.springs, model.choice)
    _, tau_p = split(-model.springs * phi, model.choice)
    G_p = coefficients.G_p
    G_pT = np.swapaxes(coefficients.G_p, -1, -2)
    G_u = coefficients.G_u
    S = dot(tau_p, coefficients.H_p) + dot(F_u, coefficients.H_u)
    K_aa = diagonal(K_a) + G_pT @ diagonal(K_p) @ G_p - S  # (16)
    C_aa = _joint_compliance(K_a, K_p, G_p, S)
    C_uu = G_u @ C_aa @ np.swapaxes(G_u, -1, -2)  # (17)
    C_uu = 0.5 * (C_uu + np.swapaxes(C_uu, -1, -2))
    return JointStiffness(K_aa, C_aa, C_uu, inverse(C_uu), coefficients)  # (18)


def _joint_compliance(
    K_a: Array,
    K_p: Array,
    G_p: Array,
    S: Array,
) -> Array:
    """K_aa^-1 from the factors of (16); S is its second-order terms.

    In the sum K_aa stiff dependent springs would round off the soft ones. With K_a + G_p^T K_p G_p
    = R^T R from the QR factors of the weighted rows, K_aa = R^T (1 - R^-T S R^-1) R keeps them."""
    root = diagonal(np.broadcast_to(np.sqrt(K_a), (*G_p.shape[:-2], G_p.shape[-1])))
    R_inverse = inverse(
        np.linalg.qr(np.concatenate([root, np.sqrt(K_p)[..., None] * G_p], axis=-2)).R
    )
    R_inverseT = np.swapaxes(R_inverse, -1, -2)
    return R_inverse @ inverse(np.eye(G_p.shape[-1]) - R_inverseT @ S @ R_inverse) @ R_inverseT


def effective_load(
    model: PaperModel, coefficients: Influence, displacement: Array, load: Array
) -> Array:
    """Return T_a (..., M) on the independent joints (13): zero at equilibrium."""
    tau_a, tau_p = split(-model.springs * displacement, model.choice)
    return tau_a + transposed(coefficients.G_p, tau_p) + transposed(coefficients.G_u, load)  # (13)


def inverse_kinematics(
    model: PaperModel,
    at: JointStiffness,
    du: Array,
) -> JointMotion:
    """Return the joint motion of least potential energy for a motion of the platform, (29)-(31).

    du : (..., 3), displacement of the platform.
    """
    G_u = at.influence.G_u
    G_p = at.influence.G_p
    dphi_a = apply(at.C_aa, transposed(G_u, apply(at.K_uu, du)))  # (29)
    dphi_p = apply(G_p, dphi_a)  # (31)
    return JointMotion(
        dphi_a, dphi_p, in_joint_order(dphi_p[..., None], dphi_a[..., None], model.choice)[..., 0]
    )


def split(values: Array, choice: Choice) -> tuple[Array, Array]:
    """Split values (..., N) of all joints into those of independent and dependent joints.

    They are (..., M) and (..., 6).
    """
    independent, dependent = (columns(values[..., None, :], index)[..., 0, :] for index in choice)
    return independent, dependent


def dot(v: Array, H: Array) -> Array:
    """(v o H)_ab = sum_k v_k H_kab."""
    return np.asarray(np.einsum("...k,...kab->...ab", v, H))


def apply(A: Array, v: Array) -> Array:
    """Return A v over leading axes."""
    return (A @ v[..., None])[..., 0]


def transposed(A: Array, v: Array) -> Array:
    """Return A^T v over leading axes."""
    return apply(np.swapaxes(A, -1, -2), v)


def diagonal(values: Array) -> Array:
    """Return the diagonal matrices (..., n, n) of (..., n)."""
    return values[..., None] * np.eye(values.shape[-1])
