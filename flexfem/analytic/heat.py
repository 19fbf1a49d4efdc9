"""Thermal drift by the pseudo-rigid model: links that grow and bow, base hinges that the frame carries along.

A straight piece of length L along e, from a to b, at the temperature dT + g . r grows by `alpha T_m L`, T_m that of
its middle, and bows by `theta = -alpha L g . n`, n at right angles to its left: the warmer side gets longer. Chain by
chain the pieces frame, pad, link 1, link 2 and platform close a loop from the platform's centre over ground and hinges
back to it. What does not fit, t_i, the hinges and elastic links take up: with the wrenches w_i of the chains on the
platform

    U = t_i + c_i w_i + sum_j B_ij w_j,    sum_i w_i = 0.

The change dT and the gradient are about the platform's centre; before it, stage and frame are taken to be alike.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic.chains import Wrench, chain_compliance, neck_stress, neck_wrenches
from flexfem.analytic.kinematics import Freedoms
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array, inverse
from flexfem.stage.designs import Designs, direction


class WarmModel(NamedTuple):
    """What n designs do per kelvin, per K/mm along x, per K/mm along y, the three cases of the last axis.

    pose : (n, 3, 3 cases), of the platform, mm and rad.
    reaction : (n, 3 chains, 3, 3 cases), of the ground on each chain about the platform's centre, N and N mm.
    stress : (n, 3 chains, 3 hinges, 3 cases), largest von Mises stress at each neck, MPa.
    """

    pose: Array
    reaction: Array
    stress: Array


def drift(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    stage_expansion: Array,
    frame_expansion: Array,
    bodies: Array | None = None,
) -> WarmModel:
    """Drift of n designs by hinges of compliances (n, 3, 3).

    Parameters
    ----------
    stage_expansion, frame_expansion : (n,), 1/K, in the plane.
    bodies : (n, 9, 9), of `links.body_compliance`; None where pads, links and platform are rigid.
    """
    chains = chain_compliance(designs.frames, hinges, freedoms)
    gaps = misfits(designs, stage_expansion, frame_expansion)
    n = len(gaps)
    full = np.zeros((n, 9, 9)) if bodies is None else np.array(np.broadcast_to(bodies, (n, 9, 9)))
    for chain in range(3):
        part = slice(3 * chain, 3 * chain + 3)
        full[:, part, part] += chains[:, chain]
    S, E = inverse(full), np.tile(np.eye(3), (3, 1))
    pull, t = E.T @ S, gaps.reshape(n, 9, 3)
    pose = inverse(pull @ E) @ pull @ t
    wrenches = (S @ (E @ pose - t)).reshape(n, 3, 3, 3)
    necks: Wrench = neck_wrenches(designs.frames, wrenches)
    stress = neck_stress(necks, designs.radius, designs.neck, designs.thickness, designs.out_of_plane)
    return WarmModel(pose, -wrenches, stress)


def misfits(designs: Designs, stage_expansion: Array, frame_expansion: Array) -> Array:
    """Displacements (n, 3 chains, 3, 3 cases) of the platform on each chain alone, its hinges at rest."""
    centres, axes = designs.frames
    pad = designs.radius[:, :, 0] + designs.link_width[:, None]
    ground = centres[:, :, 0] - pad[..., None] * direction(axes[:, :, 0])
    origin = np.zeros_like(ground)
    points = [ground, *np.moveaxis(centres, 2, 0), origin]
    found = frame_expansion[:, None, None, None] * growth(origin, ground, origin)
    for start, end in pairwise(points):
        found = found + stage_expansion[:, None, None, None] * growth(start, end, origin)
    return np.asarray(found)


def growth(start: Array, end: Array, at: Array) -> Array:
    """Displacements (..., 3, 3 cases) of a body about `at` by a straight piece that it hangs on, per expansion, K mm.

    Parameters
    ----------
    start, end : (..., 2), mm, of the piece; its start stays.   at : (..., 2), mm.
    """
    along = end - start
    left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    middle = (start + end) / 2
    warm = np.concatenate([np.ones((*middle.shape[:-1], 1)), middle], axis=-1)  # temperature of the middle, by case
    across = np.concatenate([np.zeros((*left.shape[:-1], 1)), left], axis=-1)  # gradient along left, times L, by case
    turn = -across
    moved = along[..., None] * warm[..., None, :] + left[..., None] * turn[..., None, :] / 2
    arm = at - end
    moved[..., 0, :] -= arm[..., 1, None] * turn
    moved[..., 1, :] += arm[..., 0, None] * turn
    return np.concatenate([moved, turn[..., None, :]], axis=-2)
