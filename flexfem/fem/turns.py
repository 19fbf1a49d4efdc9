"""Three alike chains by one: its answers turned into the frames of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.designs import chain_rotation


def under_loads(values: Sequence[Array]) -> list[Array]:
    """Values (3 loads, ...) of three chains, each in the frame of chain 1, from those of one or three sectors.

    Notes
    -----
    Chain c of three alike answers a load as chain 1 does the load turned back by c turns.
    """
    if len(values) == 3:
        return list(values)
    return [np.tensordot(chain_rotation(chain), values[0], axes=1) for chain in range(3)]


def turn_of_points(number: int) -> Array:
    """Matrix (2n, 2n) that turns x, y of n points by 120 degrees."""
    return np.asarray(np.kron(np.eye(number), chain_rotation(1)[:2, :2]), dtype=np.float64)


def chain_turn(spin: Array, chain: int) -> Array:
    """T_c (2 c + 3, 3 c + 3), chains from 0; a cut moves in the frame of the chain behind which it is."""
    c = len(spin)
    T = np.zeros((2 * c + 3, 3 * c + 3))
    behind, ahead = (c * ((chain + k) % 3) for k in (0, 1))
    T[:c, behind : behind + c] = np.eye(c)
    T[c : 2 * c, ahead : ahead + c] = spin
    T[-3:, -3:] = chain_rotation(chain).T
    return T


def made_alike(edge: Array) -> Array:
    """The response's unknowns (3 c + 3, 3 loads) made those of alike chains, so that round-off opens no cut.

    Only the first sector is met, which must move its cut ahead as the next chain does the cut behind it.
    """
    cuts, pose = edge[:-3].reshape(3, -1, 3), edge[-3:]
    turns = [chain_rotation(chain) for chain in range(3)]
    first = np.mean([cut @ turn for cut, turn in zip(cuts, turns, strict=True)], axis=0)
    pose = np.mean([turn.T @ pose @ turn for turn in turns], axis=0)
    return np.concatenate([*(first @ turn.T for turn in turns), pose])
