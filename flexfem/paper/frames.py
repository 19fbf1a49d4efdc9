"""Frames of the hinges of a stage at rest, and rotations of its chains.

Leading axes are designs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, direction, rotation, turned

OPPOSITE = 1e-9  # cosine of two directions at a right angle, which round-off may make negative
CHAIN_TURN = 2.0 * np.pi / 3.0  # rad, from a chain to the next


class Frames(NamedTuple):
    """Hinge frames of the stage at rest; leading axes are designs.

    centres : (..., 3 chains, 3 hinges, 2), mm, the platform centre at the origin.
    axes : (..., 3, 3), rad, direction of each neck from its base-side body to its platform-side
    body.
    """

    centres: Array
    axes: Array


def frames(
    link_lengths: Array,
    joint_angles: Array,
    axes: Array | None = None,
) -> Frames:
    """Place the hinges of three chains, 120 degrees apart, around a platform centred at the origin.

    link_lengths : (..., 3), mm: base to elbow, elbow to platform hinge, platform hinge to platform
    centre.
    joint_angles : (..., 3), rad: relative angles at rest, as in (19).
    axes : (..., 3, 3), rad, in the frame of chain 1, rotated with each chain; nan for the default:
    base and elbow along
        link 1, platform along link 2. The sense of an axis is immaterial: opposite axes give the
        same neck.

    With (19) and (20) and the platform centre at the origin, `x_B = -(l1 e1 + l2 e2 + l3 e3)`.
    """
    heading = np.cumsum(np.asarray(joint_angles, dtype=float), axis=-1)
    outward = direction(heading)
    links = np.asarray(link_lengths, dtype=float)[..., None] * outward
    centres = -np.flip(np.cumsum(np.flip(links, axis=-2), axis=-2), axis=-2)  # (19), (20)
    # sum of the directions of both links at a hinge
    outward[..., 1:, :] += direction(heading[..., :-1])
    default = heading[..., None, [0, 0, 1]]
    given = np.full(3, np.nan) if axes is None else np.asarray(axes, dtype=float)
    axis = np.where(np.isnan(given), default, given) + np.zeros((3, 3))
    backwards = np.sum(direction(axis) * outward[..., None, :, :], axis=-1) < -OPPOSITE
    turns = CHAIN_TURN * np.arange(3.0)
    axis = axis + np.where(backwards, np.pi, 0.0) + turns[:, None]
    return Frames(turned(centres[..., None, :, :], turns[:, None]), axis)


def chain_rotation(chain: int) -> Array:
    """Matrix (3, 3) that maps x, y, theta of a chain (from 0) to the frame of the stage."""
    return rotation(chain * CHAIN_TURN)
