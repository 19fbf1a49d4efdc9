"""Which modes are the lowest, how they are called, and how the output moves in them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.questions.setup import ModelAnswer
from flexfem.results import SOLID

# relative difference of frequencies of modes that symmetry makes equal, on a mesh without symmetry
EQUAL = 1e-4
# motion of the output in a mode, relative to the largest of all modes, that counts as none
STILL = 1e-3


def lowest_modes(found: Mapping[str, ModelAnswer], count: int) -> Index:
    """Return which modes are the lowest (count,); those from `count` on are out of the plane."""
    if SOLID not in found:
        return np.arange(count)
    frequencies = found[SOLID].values["frequency"]
    return np.argsort(frequencies, kind="stable")[:count]


def in_order(
    found: Mapping[str, ModelAnswer],
    order: Index,
    count: int,
) -> dict[str, ModelAnswer]:
    """Return the frequencies in an order; models of the plane have none out of it."""
    planar = np.flatnonzero(order < count)

    def placed(label: str, part: Mapping[str, Array]) -> dict[str, Array]:
        """Place frequencies, in order, at their modes; freedoms without a frequency have nan."""
        if "frequency" not in part:
            return {}
        if label == SOLID:
            return {"frequency": part["frequency"][order]}
        column = np.full(count, np.nan)
        kept = part["frequency"][: len(planar)]
        column[planar[: len(kept)]] = np.where(np.isfinite(kept), kept, np.nan)
        return {"frequency": column}

    return {
        label: ModelAnswer(placed(label, one.values), placed(label, one.bands))
        for label, one in found.items()
    }


def shares_of_motion(frequencies: Array, motion: Array) -> Array:
    """Return the shares (modes, 3), %, of directions in squared motions (modes, 3) of the output;
    nan without motion.

    Modes of equal frequency are combined to those of which the first alone moves along x, or else
    along y.
    """
    motion = motion.copy()
    starts = np.flatnonzero(np.diff(frequencies) > EQUAL * frequencies[1:]) + 1
    for group in np.split(motion, starts):
        sizes = np.linalg.norm(group, axis=0)
        order = np.argsort(sizes < STILL * sizes.max(), kind="stable")
        group[:, order] = np.linalg.qr(group[:, order], mode="complete")[1]
    squares = motion**2
    whole = squares.sum(axis=1, keepdims=True)
    moving = whole > STILL**2 * whole.max()
    return 100 * squares / np.where(moving, whole, np.nan)
