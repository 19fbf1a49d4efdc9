"""The poses that a drive reaches within limits of its commands.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x
<= bounds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.questions.driven import (
    LIMITS,
    SINGULAR,
    CommandLimits,
    DriveSystem,
    stack_names,
)
from flexfem.questions.simplex import MULTIPLIER
from flexfem.units import DIRECTIONS

KINDS = (*LIMITS, "yield")  # first part of the name of a limit, before " of "
EXACT = 1e-9  # of limits and of the largest coordinate: tolerance of programs and of the hull
ROUND_OFF = 1e-9  # of the extent by strokes alone in a direction, and of the size of the poses
SHORT = {", chain ": " ", ", longest": "+", ", shortest": "-"}  # in texts with many limits


class NothingAllowed(Exception):  # noqa: N818
    """No commands satisfy all limits."""


class LimitNames(tuple[str, ...]):
    """Names of binding limits, each "kind of place"."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of these limits, in the order of `KINDS`."""
        return tuple(kind for kind in KINDS if self._places(kind))

    def _places(self, kind: str) -> list[str]:
        start = f"{kind} of "
        return [name.removeprefix(start) for name in self if name.startswith(start)]

    def __str__(self) -> str:
        """Return all names in a line, grouped by kind.

        1+ and 1- are the longest and shortest stroke in chain 1.
        """
        found = "; ".join(f"{kind} of {', '.join(self._places(kind))}" for kind in self.kinds)
        return re.sub("|".join(SHORT), lambda match: SHORT[match[0]], found)


Stops = dict[tuple[str, str, str], LimitNames]  # by ("zero" or "free", direction, "low" or "high")


class PoseRanges(NamedTuple):
    """Ends of the ranges along the axes.

    ends : (2 others zero or free, 2 low and high, 3), nan if no pose is reached.
    stops : the limits that they reach.   commands : (2, 2, 3, m), of these ends.
    """

    ends: Array
    stops: Stops
    commands: Array


class PoseSet:
    """The poses G x + rest that a drive reaches.

    Parameters
    ----------
    system : the drive with the compliance of one model.
    limits : of its commands x (m,), n = 1.
    load : (3,), on the output.
    others : names of the limits that follow those of strokes, contacts and blocking forces.
    """

    def __init__(
        self, system: DriveSystem, limits: CommandLimits, load: Array, others: Sequence[str] = ()
    ) -> None:
        self.G = system.poses
        self.rest = np.asarray(system.engaged @ load)
        self.limits = limits
        self.names = [*_names_of_limits(system), *others]
        drive = system.drive
        unit = np.maximum(drive.highest, -drive.lowest)  # (m,), mm, size of the commands
        self.extent = np.abs(self.G) @ unit  # (3,), by strokes alone
        self.size = np.where(self.extent > 0, self.extent, 1.0)
        norm = np.max(np.abs(limits.rows[0]) * unit, axis=1)
        self.norm = np.where(norm > 0, norm, np.maximum(np.abs(limits.bounds[0]), 1.0))

    def maximised(
        self,
        C: Array,
        zero: tuple[int, ...] = (),
    ) -> tuple[Array, list[LimitNames]]:
        """Return the commands x (p, m) that maximise C (p, m) @ x, and the binding limits of each.

        zero : directions of the pose that are held at 0. Raises NothingAllowed.
        """
        axes = list(zero)
        p = len(C)
        held = self.G[axes] / self.size[axes, None]
        target = -self.rest[axes] / self.size[axes]
        base = np.linalg.pinv(held, SINGULAR) @ target
        if np.any(np.abs(held @ base - target) > EXACT):
            raise NothingAllowed
        free = np.linalg.svd(held)[2][np.linalg.matrix_rank(held, rtol=SINGULAR) if zero else 0 :].T
        along = C @ free
        along[np.linalg.norm(along, axis=1) <= SINGULAR * np.linalg.norm(C, axis=1)] = 0.0
        Z = free @ _turned(along)
        found = self.limits.maximised(np.zeros(p, dtype=np.int64), Z, np.tile(base, (p, 1)))
        if np.isnan(found.points).any():
            raise NothingAllowed
        X = base + np.einsum("pmd,pd->pm", Z, found.points)
        return X, [self._binding(free, *each) for each in zip(X, along, found.binding, strict=True)]

    def _binding(
        self,
        free: Array,
        x: Array,
        along: Array,
        found: Index,
    ) -> LimitNames:
        """Return the limits with positive multipliers at commands x.

        They are of least norm if they are not unique, so that symmetry makes all alike.

        found : numbers of binding limits, as in `CommandLimits`, which are returned if one of them
        is no row.
        """
        rows = self.limits.rows[0] / self.norm[:, None]
        touching = np.flatnonzero(self.limits.bounds[0] / self.norm - rows @ x < EXACT)
        multipliers = np.linalg.lstsq((rows[touching] @ free).T, along)[0]
        negative = -EXACT * np.max(np.abs(along))
        if np.all(found < len(rows)) and np.min(multipliers, initial=0.0) > negative:
            found = touching[multipliers > MULTIPLIER * np.max(multipliers, initial=0.0)]
        return LimitNames(self.names[k] for k in sorted(set(found.tolist()) - {-1}))

    def ranges(self) -> PoseRanges:
        """Return the ends of the ranges along the axes.

        Fewer than three commands do not hold the others at zero. Raises NothingAllowed.
        """
        count = self.G.shape[1]
        found = PoseRanges(np.full((2, 2, 3), np.nan), Stops(), np.full((2, 2, 3, count), np.nan))
        for axis in range(3):
            if count >= 3:
                with suppress(NothingAllowed):  # no pose has the others at zero
                    self._add_range(found, axis, "zero")
            self._add_range(found, axis, "free")
        return found

    def _add_range(
        self,
        found: PoseRanges,
        axis: int,
        others: str,
    ) -> None:
        """Add both ends of the range along an axis. Raises NothingAllowed."""
        held = others == "zero"
        zero = tuple(k for k in range(3) if k != axis) if held else ()
        x, by = self.maximised(np.outer([-1.0, 1.0], self.G[axis]), zero)
        value = self.rest[axis] + x @ self.G[axis]
        row = 0 if held else 1
        found.commands[row, :, axis] = x
        round_off = np.abs(value) < ROUND_OFF * self.size[axis]
        found.ends[row, :, axis] = np.where(round_off, 0.0, value)
        for end, limits in zip(("low", "high"), by, strict=True):
            found.stops[others, DIRECTIONS[axis], end] = limits


def _names_of_limits(system: DriveSystem) -> list[str]:
    """Return the names of the limits of `Driven.limits`, in their order."""
    drive = system.drive
    names = [f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names]
    return names + [f"{kind} of {name}" for kind in LIMITS[1:] for name in stack_names(drive)]


def _turned(along: Array) -> Array:
    """Return orthonormal axes (p, d, d) of which the first one is parallel to vectors (p, d)."""
    axes = np.linalg.svd(along[..., None])[0]
    opposite = np.sum(along * axes[..., 0], axis=1, keepdims=True) < 0
    axes[..., 0] *= np.where(opposite, -1.0, 1.0)
    return np.asarray(axes)
