"""How far the drives of many designs move their platforms along one axis, the others held at zero, within all limits.

Along an axis the commands for the pose t are x = t u + N y, u of least norm, N the commands that leave the platform
where it is: the farthest t is a linear program in t and y, of strokes, contacts and blocking forces. Yield is four
half-spaces for every place along a neck: only those that a solution breaks are added, the worst place of every neck,
and the program is solved again until none is broken. The preloads of single stacks stress the necks at rest; those of a
pair bear on each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index, inverse
from flexfem.hinges.strength import concentration
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.drives import StageDrive
from flexfem.questions.driven import (
    BESIDE,
    SINGULAR,
    Driven,
    NeckForces,
    NeckSections,
    limits_of,
    neck_forces,
    per_command,
    sections_of,
    stress_along,
)
from flexfem.questions.warnings import YIELD_MARGIN
from flexfem.refused import ComputationFailed

ROUNDS = 60  # of added half-spaces; three are common
ROUND_OFF = 1e-11  # of the yield strength
TOGETHER = 256  # designs at a time: their programs stay in the cache of a processor
FLAT = 1e-11  # slopes that are round-off, of rows of unit norm and slopes of at most one
KEPT = 1e-9  # by which a constraint of a unit row may be broken, relative to the point
STEPS = 100  # of the simplex method; ten are common


class DriveRanges(NamedTuple):
    """What the drives of n designs do, directions x, y, theta; nan for a design that they do not move in all three, and
    for one whose preloads alone make a neck yield.

    reach : (n, 2, 3), mm and rad, how far each way, forwards and backwards.
    engaged : (n, 3, 3), stiffness with the stacks holding their strokes.
    """

    reach: Array
    engaged: Array

    @property
    def range(self) -> Array:
        """The lesser (n, 3) of both ways."""
        return np.asarray(np.min(self.reach, axis=1))


def drive_ranges(designs: Designs, of: Driven, necks: Array, drive: StageDrive) -> DriveRanges:
    """What the drives of n designs do.

    Parameters
    ----------
    of, drive : Driven, StageDrive
        Of n designs.
    necks : array
        (n, 3 chains, 3 hinges, 3, 3 + stacks), of `DrivenModel`.
    """
    n = len(designs.thickness)
    reach, values = np.full((n, 2, 3), np.nan), _singular_values(of)
    moving = np.flatnonzero(values[:, 2] > SINGULAR * values[:, 0])  # not for nan
    carried = per_command(of, designs.frames, necks)
    at_rest = neck_forces(designs.frames, necks[..., 3:] @ drive.preload[:, None, None, :, None])
    for begin in range(0, len(moving), TOGETHER):
        here = moving[begin : begin + TOGETHER]
        some = Driven(of.C[here], of.Y[here], of.T)
        forces, rest = (NeckForces(*(e[here].reshape(len(here), 9, -1) for e in each)) for each in (carried, at_rest))
        numbers = ("stiffness", "preload", "blocking_force", "lowest", "highest")
        own = drive._replace(**{name: getattr(drive, name)[here] for name in numbers})
        reach[here] = _within_yield(_along_axes(some, own), designs.chosen(here), forces, rest)
    return DriveRanges(reach, inverse(of.engaged))


def _singular_values(of: Driven) -> Array:
    """Of what a unit command does, (n, 3), rotations by a length that makes them as large as translations."""
    poses = np.where(np.isfinite(of.poses), of.poses, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = poses / np.linalg.norm(poses, axis=2, keepdims=True)
    values = np.zeros((len(poses), 3))
    sound = np.isfinite(alike).all(axis=(1, 2))
    values[sound] = np.linalg.svd(alike[sound], compute_uv=False)
    return values


class _Programs(NamedTuple):
    """What the commands of p programs are, x = Z (t, y), (p, m, d), and the limits on these: rows z <= ends."""

    design: Index
    Z: Array
    rows: Array
    ends: Array


def _along_axes(of: Driven, drive: StageDrive) -> _Programs:
    """Six programs a design, forwards and backwards along x, y, theta."""
    scale = 1 / np.linalg.norm(of.poses, axis=2, keepdims=True)
    free = np.swapaxes(np.linalg.svd(of.poses * scale)[2][:, 3:], 1, 2)
    least = np.linalg.pinv(of.poses * scale) * np.swapaxes(scale, 1, 2)  # (n, m, 3): commands of unit poses
    n, m, d = len(least), least.shape[1], free.shape[2] + 1
    limits = limits_of(of, drive, np.zeros(3)).values()
    rows = np.concatenate([np.broadcast_to(each.rows, (n, *each.rows.shape[-2:])) for each in limits], axis=1)
    ends = np.concatenate([each.offsets + each.sizes for each in limits], axis=-1)
    Z = np.concatenate([np.moveaxis(least, 2, 1)[..., None], np.broadcast_to(free[:, None], (n, 3, m, d - 1))], axis=-1)
    Z = np.stack([Z, Z * np.append(-1.0, np.ones(d - 1))], axis=1).reshape(6 * n, m, d)
    design = np.repeat(np.arange(n), 6)
    return _Programs(design, Z, rows[design] @ Z, ends[design])


def _within_yield(of: _Programs, designs: Designs, carried: NeckForces, rest: NeckForces) -> Array:
    """How far (n, 2, 3) with the half-spaces of yield that matter.

    carried, rest : what necks carry per command, (n, 9, m), and of preloads, (n, 9, 1).
    """
    z = np.full((len(of.design), of.Z.shape[2]), np.nan)
    forces = NeckForces(*(each[of.design] @ of.Z for each in carried))
    todo = np.flatnonzero(~_worst(designs, of.design, forces, rest, 0 * np.nan_to_num(z))[0])
    rows, ends = of.rows[todo], of.ends[todo]
    for _ in range(ROUNDS):
        z[todo] = farthest(rows, ends)
        forces = NeckForces(*(each[of.design[todo]] @ of.Z[todo] for each in carried))
        broken, cut, end = _worst(designs, of.design[todo], forces, rest, z[todo])
        if not broken.any():
            return z[:, 0].reshape(-1, 2, 3)
        todo = todo[broken]
        rows = np.concatenate([rows[broken], cut[broken]], axis=1)
        ends = np.concatenate([ends[broken], end[broken]], axis=1)
    z[todo] = np.nan  # never seen
    return z[:, 0].reshape(-1, 2, 3)


def _worst(
    designs: Designs, design: Index, forces: NeckForces, rest: NeckForces, z: Array
) -> tuple[NDArray[np.bool_], Array, Array]:
    """Which programs (p,), of which designs, break yield; for each neck the half-space of its worst place.

    Half-spaces as rows (p, 9, d) and ends (p, 9). Places are looked at where the narrowest section would break it with
    the lever of the farthest.
    """
    carried = NeckForces(
        *(np.einsum("pkd,pd->pk", each, z) + own[design, :, 0] for each, own in zip(forces, rest, strict=True))
    )
    near = np.flatnonzero(np.any(_at_most(designs, design, carried) > _allowed(designs)[design, None], axis=1))
    broken, cut, ends = np.zeros(len(z), dtype=bool), np.zeros((len(z), 9, z.shape[1])), np.ones((len(z), 9))
    if not len(near):
        return broken, cut, ends
    some = designs.chosen(design[near])
    at = NeckSections(*(each.reshape(len(near), 9, -1) for each in sections_of(some)))
    M, N, V = (each[near] for each in carried)
    stress = stress_along(at, NeckForces(M, N, V))
    broken[near] = np.max(stress, axis=(1, 2)) > _allowed(some) * (1 + ROUND_OFF)
    x, bent, pulled = (np.take_along_axis(each, np.argmax(stress, axis=2)[..., None], 2) for each in at)
    one, other = np.sign(M[..., None] + V[..., None] * x), np.sign(N[..., None])
    cut[near], at_rest = (
        one * bent * (moment + shear * x) + other * pulled * normal
        for moment, normal, shear in (tuple(e[near] for e in forces), tuple(e[design[near]] for e in rest))
    )
    ends[near] = _allowed(some)[:, None] - at_rest[..., 0]
    return broken, cut, ends


def _allowed(designs: Designs) -> Array:
    """Stress (n,) that limits of yield allow: the model's may be low."""
    return np.asarray(designs.yield_strength * (1 - YIELD_MARGIN[designs.plane]))


def _at_most(designs: Designs, design: Index, carried: NeckForces) -> Array:
    """A stress (p, 9) that none along the necks of programs' designs exceeds."""
    bending, tension = (each[design].reshape(-1, 9) for each in sections_of(designs, 1)[1:])
    K = concentration(designs.neck[design] / designs.radius[design])
    lever = (BESIDE * designs.radius[design] * K.shear / K.bending).reshape(-1, 9)
    M, N, V = (np.abs(each) for each in carried)
    return np.asarray(bending * (M + lever * V) + tension * N)


def farthest(A: Array, b: Array) -> Array:
    """Points (p, d) of the largest z_0 with A z <= b: A (p, k, d), b (p, k) not negative, bounded.

    Notes
    -----
    The simplex method on one tableau for each program, all a step at a time: from z = 0 the coordinates z enter the
    basis, and slacks that leave it hold the point. The point is then solved for anew from the constraints that hold it
    and checked; a program that fails the check is left to HiGHS. A batch of such programs took HiGHS 30 times as long.
    """
    d = A.shape[2]
    unit = _scale(np.max(np.abs(A), axis=1))
    rows = A * unit[:, None, :]
    norm = _scale(np.linalg.norm(rows, axis=2))
    rows, ends = rows * norm[..., None], b * norm
    span = _scale(np.max(np.abs(ends), axis=1))[:, None]
    ends = ends * span
    held, sure = _held(rows, ends)
    active = np.take_along_axis(rows, np.maximum(held, 0)[..., None], axis=1)
    active = np.where((held < 0)[..., None], np.eye(d)[np.maximum(-1 - held, 0)], active)
    at = np.where(held < 0, 0.0, np.take_along_axis(ends, np.maximum(held, 0), axis=1))
    z = np.einsum("pij,pj->pi", inverse(active), at)
    slack = ends - np.einsum("pkd,pd->pk", rows, z)
    sure &= np.min(slack, axis=1) >= -KEPT * (1 + np.max(np.abs(z), axis=1))  # not for nan
    for place in np.flatnonzero(~sure):
        z[place] = _by_highs(rows[place], ends[place])
    return np.asarray(z * unit / span)


def _held(A: Array, b: Array) -> tuple[Index, NDArray[np.bool_]]:
    """What holds the best point of each program (p, d), rows or -1 - j for z_j = 0, and which are optimal (p,)."""
    p, k, d = A.shape
    found, sure = np.zeros((p, d), dtype=np.int64), np.zeros(p, dtype=bool)
    slope = np.broadcast_to(np.eye(d + 1)[:1], (p, 1, d + 1))
    T = np.concatenate([np.concatenate([A, b[..., None]], axis=2), slope], axis=1)  # last row: slopes, last column: b
    outside, inside = np.tile(-1 - np.arange(d), (p, 1)), np.tile(np.arange(k), (p, 1))
    todo = np.arange(p)
    for _ in range(STEPS):
        gain = np.where(outside < 0, np.abs(T[:, -1, :-1]), T[:, -1, :-1])
        on = np.max(gain, axis=1) > FLAT
        found[todo[~on]], sure[todo[~on]] = outside[~on], np.isfinite(gain[~on]).all(axis=1)
        T, outside, inside, gain, todo = T[on], outside[on], inside[on], gain[on], todo[on]
        if not len(todo):
            break
        each, enters = np.arange(len(todo)), np.argmax(gain, axis=1)
        way = T[each, :, enters]
        way = way * np.where(way[:, -1:] < 0, -1.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = (way[:, :-1] > FLAT) & (inside >= 0)
            ratio = np.where(ahead, np.maximum(T[:, :-1, -1], 0.0) / way[:, :-1], np.inf)
        step = np.min(ratio, axis=1)
        leaves = np.argmax(np.where(ratio <= step[:, None] * (1 + FLAT), way[:, :-1] * ahead, -1.0), axis=1)
        pivot = T[each, leaves] / T[each, leaves, enters][:, None]
        column = T[each, :, enters]
        T -= column[:, :, None] * pivot[:, None, :]
        T[each, leaves] = pivot
        T[each, :, enters] = -column * (1 / column[each, leaves])[:, None]
        T[each, leaves, enters] = 1 / column[each, leaves]
        outside[each, enters], inside[each, leaves] = inside[each, leaves], outside[each, enters]
    return found, sure


def _scale(size: Array) -> Array:
    return np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)


def _by_highs(A: Array, b: Array) -> Array:
    from scipy.optimize import linprog

    found = linprog(-np.eye(A.shape[1])[0], A_ub=A, b_ub=b, bounds=(None, None), method="highs")
    if found.status != 0:
        raise ComputationFailed(f"linear program: {found.message}")
    return np.asarray(found.x)
