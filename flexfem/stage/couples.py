"""Rotations of hinges, as they are read and imposed: between the bodies on either side of a notch.

A hinge turns by the mean rotation of the cross-sections directly beyond its notch, less that of those directly before
it: on a short station of pad and links, weighted as the stresses of a beam in bending are. A unit couple on the same
stations, opposite on the two bodies, is conjugate to that rotation: as a stack is to its opening. The platform, which
is read at its rigid hub, has no station.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexfem.stage.actuators import BODY_NAMES
from flexfem.stage.bodies import centrelines
from flexfem.stage.contacts import Push, Stack, Station
from flexfem.stage.tables import CHAINS, HINGE_NAMES

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

BESIDE = 0.05  # half a station per link width; as short as meshes of 4 triangles across a neck resolve
PLATFORM = len(BODY_NAMES) - 1


def hinge_couples(stage: Stage, positions: tuple[int, ...]) -> tuple[Stack, ...]:
    """Unit couples, N mm, that turn the hinges at `positions` (0 the base's) of all chains, position by position."""
    return tuple(_couple(stage, chain, position) for position in positions for chain in CHAINS)


def couple_names(positions: tuple[int, ...]) -> tuple[str, ...]:
    """What the hinges of `hinge_couples` are called, in its order."""
    return tuple(f"{HINGE_NAMES[position]}, chain {chain}" for position in positions for chain in CHAINS)


def _couple(stage: Stage, chain: int, position: int) -> Stack:
    """A couple on the body beyond a hinge of a chain (1 to 3), and its opposite on the body before."""
    unit = np.array([0.0, 0.0, 1.0])
    beyond = Push(position + 1, unit, _station(stage, chain, position + 1, beyond=True))
    return Stack(chain - 1, (beyond, Push(position, -unit, _station(stage, chain, position, beyond=False))))


def _station(stage: Stage, chain: int, body: int, beyond: bool) -> Station | None:
    """Where a pad or link meets the notch before it (`beyond` that), or the one after it."""
    if body == PLATFORM:
        return None
    path = centrelines(stage, chain)[body]
    length = sum(segment.length for segment in path)
    half = min(BESIDE * stage.chain.link_width, length / 2)
    return Station(path, stage.chain.link_width, half if beyond else length - half, half)
