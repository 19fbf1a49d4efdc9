"""Limits of the drives of stages, yield of the necks among them, and the ranges of many designs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index, inverse
from flexfem.paper.designs import Designs
from flexfem.paper.model import at_necks, stress_raised
from flexfem.paper.warnings import YIELD_MARGIN
from flexfem.questions.driven import SINGULAR, CommandLimits, DriveSystem
from flexfem.questions.simplex import Violation, WorstLimit

HALF_LENGTH = 0.7  # of the checked part of a neck, per notch radius
SECTIONS = 141  # of that part
YIELDING = 1e-11  # of the yield strength: round-off
BATCH = 256  # designs at a time, so that their programs stay in the processor cache


def sections_of(designs: Designs) -> Array:
    """Return sections along the necks of n designs, (3, n, 3, 3, SECTIONS), the middle one at the
    centre.

    They are the lever of a shear force, mm, the von Mises stress of the moment, MPa per N mm, and
    that of an axial force, MPa per N: `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|` at x from
    the centre, with the height h(x)."""
    radius = designs.radius[..., None]
    neck = designs.neck[..., None]
    x = radius * np.linspace(-HALF_LENGTH, HALF_LENGTH, SECTIONS)
    height = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (factor[..., None] for factor in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * height
    return np.stack([x * shear / bending, 6 * bending / area / height, tension / area])


def stress_along(sections: Array, forces: Array) -> Array:
    """Return the stress (..., 3, 3, s), MPa, at sections (3, ..., 3, 3, s) of `sections_of`.

    forces : (3, ..., 3, 3), moment, axial and shear force of every neck.
    """
    x, bending, tension = sections
    M, N, V = forces[..., None]
    return np.asarray(np.abs(bending * (M + V * x)) + np.abs(tension * N))


@dataclass(frozen=True)
class StageLimits(CommandLimits):
    """All limits of the commands (m,) of n stages: rows, then the yield of nine necks.

    sections : (3, n, 9, SECTIONS) of `sections_of`.
    forces : (3, n, 9, m), moment, axial and shear force of necks per command.
    at_rest : (3, n, 9), the same without commands.
    strength : (n,), MPa, less a margin because the model may underestimate the stress.
    """

    sections: Array
    forces: Array
    at_rest: Array
    strength: Array

    def further(
        self,
        design: Index,
        Z: Array,
        base: Array,
    ) -> WorstLimit:
        """Return yield, at the worst section of each neck."""
        forces = self.forces[:, design]
        at_base = self.at_rest[:, design] + np.einsum("ipkm,pm->ipk", forces, base)
        return partial(self.yields, design, forces @ Z, at_base)

    def yields(
        self, design: Index, forces: Array, at_base: Array, which: Index, z: Array
    ) -> Violation:
        """Return yield at the worst section.

        forces : (3, p, 9, d), per unknown.   at_base : (3, p, 9).   which : programs (q,).
        z : (q, d), their unknowns.
        """
        k = design[which]
        loaded = np.einsum("ipkd,pd->ipk", forces[:, which], z) + at_base[:, which]
        stress = stress_along(self.sections[:, k], loaded).reshape(len(z), -1)
        neck, section = np.divmod(np.argmax(stress, axis=1), SECTIONS)
        x, bending, tension = self.sections[:, k, neck, section]
        M, N, V = loaded[:, np.arange(len(z)), neck]
        bending = np.sign(M + V * x) * bending
        factors = np.array([bending, np.sign(N) * tension, bending * x])
        rows = np.einsum("ip,ipd->pd", factors, forces[:, which, neck])
        bounds = self.strength[k] - np.sum(factors * at_base[:, which, neck], axis=0)
        above = np.max(stress, axis=1) > self.strength[k] * (1 + YIELDING)
        return Violation(above, rows, bounds, neck)

    def yields_at_rest(self) -> NDArray[np.bool_]:
        """Return whether preloads and load alone make a neck of each design yield (n,)."""
        each = np.arange(len(self.rows))
        no_commands = np.zeros(self.rows.shape[::2])
        return self.yields(each, self.forces, self.at_rest, each, no_commands).where


def command_limits(
    designs: Designs,
    system: DriveSystem,
    necks: Array,
    load: Array,
) -> StageLimits:
    """Return all limits of n driven designs under a load (3,).

    The preloads of a pair balance each other; that of a single stack stresses the necks.

    necks : (n, 3 chains, 3 hinges, 3, 3 + stacks), as of `DrivenModel`.
    """
    n = len(designs.thickness)
    limits = system.limits(load).values()
    rows = [np.broadcast_to(limit.rows, (n, *limit.rows.shape[-2:])) for limit in limits]
    bounds = [limit.offsets + limit.sizes for limit in limits]
    force = system.drive.preload - system.Y @ system.C[..., 3:, :3] @ load
    loads = np.concatenate([np.broadcast_to(load, (n, 3)), force], axis=-1)[:, None, None, :, None]
    by_command = necks[..., 3:] @ system.per_command[:, None, None]
    return StageLimits(
        np.concatenate(rows, axis=1),
        np.concatenate(bounds, axis=-1),
        sections_of(designs).reshape(3, n, 9, -1),
        np.reshape(at_necks(designs.frames, by_command), (3, n, 9, -1)),
        np.reshape(at_necks(designs.frames, necks @ loads), (3, n, 9)),
        designs.yield_strength * (1 - YIELD_MARGIN[designs.plane]),
    )


class DriveRanges(NamedTuple):
    """Reach of the drives of n designs each way (n, 2, 3), mm and rad, and stiffness (n, 3, 3) with
    the stacks engaged.

    The reach is nan if a drive does not move its design in three directions, or if preloads alone
    make a neck yield."""

    reach: Array
    engaged: Array

    @property
    def range(self) -> Array:
        """Smaller reach (n, 3) of both ways."""
        return np.asarray(np.min(self.reach, axis=1))


def drive_ranges(
    designs: Designs,
    system: DriveSystem,
    necks: Array,
) -> DriveRanges:
    """Return the ranges of the drives of n designs.

    Parameters
    ----------
    necks : (n, 3 chains, 3 hinges, 3, 3 + stacks), as of `DrivenModel`.

    Notes
    -----
    The commands for the pose t along an axis, other directions zero, are x = t u + N y, with u of
    least norm and the columns of N in the null space: the largest t is the solution of a linear
    program in t and y, limited by strokes, contacts and blocking forces. Of yield, only half-spaces
    that a solution violates are added, at the worst section."""
    n = len(designs.thickness)
    scale = np.linalg.norm(system.poses, axis=2, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        # normalised so that rotations compare with translations
        normalised = np.nan_to_num(system.poses / scale)
    reach = np.full((n, 2, 3), np.nan)
    moving = np.flatnonzero(np.linalg.matrix_rank(normalised, rtol=SINGULAR) == 3)
    for begin in range(0, len(moving), BATCH):
        batch = moving[begin : begin + BATCH]
        limits = command_limits(designs.chosen(batch), system.at(batch), necks[batch], np.zeros(3))
        Z = _along_axes(normalised[batch], scale[batch])
        each = np.repeat(np.arange(len(batch)), 6)
        farthest = limits.maximised(each, Z, np.zeros(Z.shape[:2])).points[:, 0]
        at_rest = limits.yields_at_rest()[:, None, None]
        reach[batch] = np.where(at_rest, np.nan, farthest.reshape(-1, 2, 3))
    return DriveRanges(reach, inverse(system.engaged))


def _along_axes(normalised: Array, scale: Array) -> Array:
    """Return commands (q 2 3, m, d) by the unknowns of the programs of q designs, both ways.

    The first unknown is the pose along an axis, the others do not move the platform.

    normalised, scale : (q, 3, m) and (q, 3, 1), the poses per command as their product.
    """
    least = np.swapaxes(np.linalg.pinv(normalised), 1, 2) / scale  # (q, 3, m), for unit poses
    free = np.swapaxes(np.linalg.svd(normalised)[2][:, 3:], 1, 2)
    both = np.stack([least, -least], axis=1)[..., None]
    free = np.broadcast_to(free[:, None, None], (*both.shape[:-1], free.shape[-1]))
    Z = np.concatenate([both, free], axis=-1)
    return np.asarray(Z.reshape(-1, *Z.shape[-2:]))
