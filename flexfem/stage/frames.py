"""Where the nine hinges are and how their necks point: the skeleton that both models share."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.stage.cache import once

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

CHAIN_TURN = 2.0 * np.pi / 3.0


class Frames(NamedTuple):
    """Hinge frames of the stage at rest; leading axes are designs.

    centres : (..., 3 chains, 3 hinges, 2), mm, the platform centre at the origin.
    axes : (..., 3, 3), rad, direction of each neck from its base-side body to its platform-side body.
    """

    centres: Array
    axes: Array


def frames(link_lengths: Array, joint_angles: Array, axes: Array | None = None) -> Frames:
    """Place the hinges of three chains, 120 degrees apart, around a platform centred at the origin.

    Parameters
    ----------
    link_lengths : (..., 3), mm: base to elbow, elbow to platform hinge, platform hinge to platform centre.
    joint_angles : (..., 3), rad: relative angles at rest, as in (19).
    axes : (..., 3, 3), rad, in the frame of chain 1 and turned with each chain; nan where the default holds: base
        and elbow along link 1, platform along link 2. A neck has no arrow, so an axis and its opposite are the same.

    Notes
    -----
    With (19) and (20) and the platform centre at the origin, `x_B = -(l1 e1 + l2 e2 + l3 e3)`.
    """
    heading = np.cumsum(np.asarray(joint_angles, dtype=float), axis=-1)
    links = np.asarray(link_lengths, dtype=float)[..., None] * direction(heading)
    centres = -np.flip(np.cumsum(np.flip(links, axis=-2), axis=-2), axis=-2)  # (19), (20)
    towards = direction(heading)
    towards = np.stack(
        [towards[..., 0, :], towards[..., 0, :] + towards[..., 1, :], towards[..., 1, :] + towards[..., 2, :]], axis=-2
    )
    default = np.stack([heading[..., 0], heading[..., 0], heading[..., 1]], axis=-1)[..., None, :]
    given = np.full(3, np.nan) if axes is None else np.asarray(axes, dtype=float)
    axis = np.where(np.isnan(given), default, given) + np.zeros((3, 3))
    backwards = np.sum(direction(axis) * towards[..., None, :, :], axis=-1) < -1e-9
    turns = CHAIN_TURN * np.arange(3.0)
    return Frames(
        turned(centres[..., None, :, :], turns[:, None]),
        axis + np.where(backwards, np.pi, 0.0) + turns[:, None],
    )


@once
def stage_frames(stage: Stage) -> Frames:
    """Hinge frames of one stage: centres (3, 3, 2) in mm, axes (3, 3) in rad, read-only."""
    hinges = [[stage.hinge(chain, name).axis for name in ("base", "elbow", "platform")] for chain in (1, 2, 3)]
    axes = np.array([[np.nan if axis is None else axis for axis in row] for row in hinges])
    return frames(np.array(stage.chain.link_lengths), np.array(stage.chain.joint_angles), axes)


def direction(angle: Array) -> Array:
    """Unit vectors (..., 2) at the angles (...), rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turned(points: Array, angle: Array | float) -> Array:
    """Points (..., 2) turned about the origin by `angle` (...), rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * points[..., 0] - s * points[..., 1], s * points[..., 0] + c * points[..., 1]], axis=-1)
