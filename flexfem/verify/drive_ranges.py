"""How far the drives of many designs move their platforms along one axis, the others held at zero, within all limits.

Along an axis e the commands for the pose t e are x = t u + N y, u of least norm, N the commands that leave the platform
where it is: the farthest t is a linear program in t and y, of strokes, contacts and blocking forces. Yield is 36
half-spaces for every place along a neck: only those that an answer breaks are added, the worst place of every neck, and
the program is solved again, until none is broken. It is then the answer with all of them. The preloads of single stacks
stress the necks at rest; those of a pair bear on each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index, inverse
from flexfem.hinges.strength import concentration
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.drives import StageDrive
from flexfem.questions.warnings import YIELD_MARGIN
from flexfem.verify.driven import SINGULAR, Driven, limits_of
from flexfem.verify.neck_limits import (
    BESIDE,
    NeckForces,
    NeckSections,
    neck_forces,
    per_command,
    sections_of,
    stress_along,
)
from flexfem.verify.programs import maximise

ROUNDS = 60  # of added half-spaces; three are common
ROUND_OFF = 1e-11  # of the yield strength
TOGETHER = 256  # designs at a time: their programs stay in the cache of a processor


class DriveAnswers(NamedTuple):
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


class _Programs(NamedTuple):
    """What the commands of p programs are, x = Z (t, y), (p, m, d), and the limits on these: rows z <= ends."""

    design: Index
    slope: Array
    Z: Array
    rows: Array
    ends: Array


def drive_answers(designs: Designs, of: Driven, necks: Array, drive: StageDrive) -> DriveAnswers:
    """What the drives of n designs do.

    Parameters
    ----------
    of, drive : of n designs.   necks : (n, 3 chains, 3 hinges, 3, 3 + stacks), of `DrivenModel`.
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
        reach[here] = _within_yield(_along_axes(some, _of(drive, here)), designs.chosen(here), forces, rest)
    return DriveAnswers(reach, inverse(of.engaged))


def _singular_values(of: Driven) -> Array:
    """Of what a unit command does, (n, 3), rotations by a length that makes them as large as translations."""
    poses = np.where(np.isfinite(of.poses), of.poses, np.nan)
    size = np.linalg.norm(poses, axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = poses / size[..., None]
    values = np.zeros((len(poses), 3))
    sound = np.isfinite(alike).all(axis=(1, 2))
    values[sound] = np.linalg.svd(alike[sound], compute_uv=False)
    return values


def _of(drive: StageDrive, here: Index) -> StageDrive:
    numbers = ("stiffness", "preload", "blocking_force", "lowest", "highest")
    return drive._replace(**{name: getattr(drive, name)[here] for name in numbers})


def _along_axes(of: Driven, drive: StageDrive) -> _Programs:
    """Six programs a design, forwards and backwards along x, y, theta."""
    scale = 1 / np.linalg.norm(of.poses, axis=2, keepdims=True)
    turn = np.linalg.svd(of.poses * scale)[2]
    free = np.swapaxes(turn[:, 3:], 1, 2)
    least = np.linalg.pinv(of.poses * scale) * np.swapaxes(scale, 1, 2)  # (n, m, 3): commands of unit poses
    n, m, d = len(least), least.shape[1], free.shape[2] + 1
    limits = limits_of(of, drive, np.zeros(3)).values()
    rows = np.concatenate([np.broadcast_to(each.rows, (n, *each.rows.shape[-2:])) for each in limits], axis=1)
    ends = np.concatenate([each.offsets + each.sizes for each in limits], axis=-1)
    Z = np.concatenate([np.moveaxis(least, 2, 1)[..., None], np.broadcast_to(free[:, None], (n, 3, m, d - 1))], axis=-1)
    Z = np.stack([Z, Z * np.append(-1.0, np.ones(d - 1))], axis=1).reshape(6 * n, m, d)
    design = np.repeat(np.arange(n), 6)
    slope = np.broadcast_to(np.eye(d)[0], (6 * n, d))
    return _Programs(design, slope, Z, rows[design] @ Z, ends[design])


def _within_yield(of: _Programs, designs: Designs, carried: NeckForces, rest: NeckForces) -> Array:
    """How far (n, 2, 3) with the half-spaces of yield that matter.

    carried, rest : what necks carry per command, (n, 9, m), and of preloads, (n, 9, 1).
    """
    value, z = maximise(of.slope, of.rows, of.ends)
    yielding = _worst(designs, of.design, NeckForces(*(0 * (each[of.design] @ of.Z) for each in carried)), rest, z)[0]
    value[yielding] = np.nan
    todo, rows, ends = np.arange(len(value)), of.rows, of.ends
    for _ in range(ROUNDS):
        design = of.design[todo]
        forces = NeckForces(*(each[design] @ of.Z[todo] for each in carried))
        broken, cut, end = _worst(designs, design, forces, rest, z[todo])
        broken &= np.isfinite(value[todo])
        if not broken.any():
            return value.reshape(-1, 2, 3)
        todo = todo[broken]
        rows = np.concatenate([rows[broken], cut[broken]], axis=1)
        ends = np.concatenate([ends[broken], end[broken]], axis=1)
        value[todo], z[todo] = maximise(of.slope[todo], rows, ends)
    value[todo] = np.nan  # never seen
    return value.reshape(-1, 2, 3)


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
    signed = [
        one * bent * (moment + shear * x) + other * pulled * normal
        for moment, normal, shear in (
            tuple(each[near] for each in forces),
            tuple(each[design[near]] for each in rest),
        )
    ]
    cut[near], ends[near] = signed[0], _allowed(some)[:, None] - signed[1][..., 0]
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
