"""Mobility (1), the freedoms of the nine hinges, and chains at finite joint displacements.

The pose of a chain comes with its first- and second-order influence coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array, Index
from flexfem.refused import BadInput
from flexfem.stage.designs import Frames, direction

CHAINS = 3
HINGES = 3
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
    """Mobility of the stage with this table by (1); raises BadInput as `checked` does."""
    return gruebler_kutzbach(LINKS, (len(hinge) for chain in checked(freedoms) for hinge in chain))


def stage_freedoms(prismatic: ArrayLike) -> Freedoms:
    """Table of a stage whose flags `prismatic` (3 chains, 3 hinges) give a hinge its axial freedom."""
    flags = np.asarray(prismatic, dtype=bool)
    if flags.shape != (CHAINS, HINGES):
        raise BadInput(f"prismatic flags have the shape {flags.shape}, expected 3 chains by 3 hinges")
    return tuple(tuple(_RA if flag else _R for flag in chain) for chain in flags)


def freedoms_of(mobility: int) -> Freedoms:
    """The uniform table of mobility 3, 6, 12 or 21; raises BadInput for any other number."""
    if not isinstance(mobility, Integral) or mobility not in FREEDOMS_BY_MOBILITY:
        known = ", ".join(map(str, FREEDOMS_BY_MOBILITY))
        raise BadInput(f"mobility = {mobility}, expected one of {known}, or none for the stage's own prismatic hinges")
    return FREEDOMS_BY_MOBILITY[mobility]


def checked(freedoms: Sequence[Sequence[Sequence[str]]]) -> Freedoms:
    """The table as tuples, every hinge's freedoms in the order of `KINDS`.

    Raises
    ------
    BadInput: not 3 by 3, a freedom unknown or given twice, or a hinge without rotation. With rotation everywhere
    the mobility cannot fall below three, which the six loop equations need.
    """
    if len(freedoms) != CHAINS or any(len(chain) != HINGES for chain in freedoms):
        raise BadInput("joint freedoms are not a table of 3 chains by 3 hinges")
    for i, chain in enumerate(freedoms, start=1):
        for j, hinge in enumerate(chain, start=1):
            place = f"joint freedoms of chain {i}, hinge {j} = {tuple(hinge)}"
            if len(set(hinge)) != len(hinge) or not set(hinge) <= set(KINDS):
                raise BadInput(f"{place}, expected each of {', '.join(KINDS)} at most once")
            if "rotation" not in hinge:
                raise BadInput(f"{place}, expected rotation among them: a hinge that cannot turn is no joint")
    return tuple(tuple(tuple(k for k in KINDS if k in hinge) for hinge in chain) for chain in freedoms)


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
    def chains(self) -> tuple[slice, slice, slice]:
        """Where each chain's joints are."""
        ends = np.searchsorted(self.chain, [0, 1, 2, 3])
        return slice(ends[0], ends[1]), slice(ends[1], ends[2]), slice(ends[2], ends[3])

    @property
    def mobility(self) -> int:
        """M = N - 6, six joints being dependent in two loops."""
        return len(self.kind) - 6


def joints_of(freedoms: Freedoms) -> Joints:
    """The joints of a table of freedoms; raises BadInput as `mobility.checked` does."""
    rows = [
        (i, j, KINDS.index(kind))
        for i, chain in enumerate(checked(freedoms))
        for j, hinge in enumerate(chain)
        for kind in hinge
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


def first_order(joints: Joints, at: Configuration) -> tuple[Array, Array, Array]:
    """Influence coefficients iG of each chain, (..., 3, N_i): u' = iG iphi' (4).

    Notes
    -----
    Revolute at p: (-(y - p_y), x - p_x, 1); prismatic along d: (d_x, d_y, 0).
    """
    r = at.pose[..., :, None, :2] - at.pivots
    zero, one = np.zeros(r.shape[:-1]), np.ones(r.shape[:-1])
    c, s = np.cos(at.axes), np.sin(at.axes)
    rotation = np.stack([-r[..., 1], r[..., 0], one], axis=-1)
    axial, shear = np.stack([c, s, zero], axis=-1), np.stack([-s, c, zero], axis=-1)
    columns = np.stack([rotation, axial, shear], axis=-2)  # (..., chain, hinge, kind, row)
    G = np.swapaxes(columns.reshape(*columns.shape[:-4], 27, 3)[..., joints.slot, :], -1, -2)
    one_, two_, three_ = joints.chains
    return G[..., one_], G[..., two_], G[..., three_]


def second_order(joints: Joints, iG: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """Influence coefficients iH of each chain, (..., 3, N_i, N_i): u'' = iG iphi'' + iphi'^T iH iphi'.

    Notes
    -----
    A revolute nearer the base, or the joint itself, turns the translation of the distal joint's column by a quarter:
    revolute-revolute (-(x - p_nx), -(y - p_ny), 0), revolute-prismatic (-d_ny, d_nx, 0); a proximal prismatic
    joint turns nothing: 0. Symmetric in its two joints.
    """
    return (_second(joints, iG, 0), _second(joints, iG, 1), _second(joints, iG, 2))


def _second(joints: Joints, iG: tuple[Array, Array, Array], i: int) -> Array:
    turns = joints.kind[joints.chains[i]] == ROTATION
    m, n = np.indices((len(turns), len(turns)))
    proximal, distal = np.minimum(m, n), np.maximum(m, n)
    H: Array = turns[proximal] * (QUARTER @ iG[i])[..., distal]
    return H
