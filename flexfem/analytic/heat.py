"""Thermal drift by the pseudo-rigid model: chains that grow and bow, base hinges that the frame carries along.

A chain that warms with its hinges at rest carries the platform, as the ground does on a frame that warms. The
difference t_i the hinges and elastic links take up: with the wrenches w_i of the chains on the platform

    U = t_i + c_i w_i + sum_j B_ij w_j,    sum_i w_i = 0.

The change dT and the gradient are about the platform's centre; before it, stage and frame are taken to be alike.
The frame also strains and bows the edge that an elastic pad is clamped along (`warm_pad`): 1.1 % of the pose per
gradient of the shipped stages.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.chains import Wrench, chain_compliance, neck_stress, neck_wrenches, stress_raised
from flexfem.analytic.kinematics import Freedoms
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array, inverse
from flexfem.refused import BadInput
from flexfem.stage.designs import Designs, direction
from flexfem.stage.schema import Stage

MISSING = "is missing, expected um/(m K), the coefficient of linear thermal expansion"


class WarmModel(NamedTuple):
    """What n designs do per kelvin, per K/mm along x, per K/mm along y, the three cases of the last axis.

    pose : (n, 3, 3 cases), of the platform, mm and rad.
    reaction : (n, 3 chains, 3, 3 cases), of the ground on each chain about the platform's centre, N and N mm.
    stress : (n, 3 chains, 3 hinges, 3 cases), largest von Mises stress at each neck, MPa.
    """

    pose: Array
    reaction: Array
    stress: Array


class WarmBodies(NamedTuple):
    """What n designs' elastic bodies do: compliance (n, 9, 9) of `body_compliance`, (n, 3, 3, 3) of `edge_motions`."""

    compliance: Array
    edges: Array


class Expansions(NamedTuple):
    """In-plane coefficients (n,), 1/K."""

    stage: Array
    frame: Array


class DriftRates(NamedTuple):
    """Of n designs: pose per kelvin (n, 3), mm and rad; largest translation and rotation per K/mm (n, 2)."""

    uniform: Array
    gradient: Array


def require_expansion(stage: Stage, frame: bool = False) -> None:
    """Raise BadInput where a stage states no expansion of its own, or, where it is asked for, none of its frame."""
    if stage.material.expansion is None:
        raise BadInput(f"material.expansion_um_per_m_k {MISSING} (aluminium 23.6)")
    if frame and stage.frame.expansion is None:
        still = "one that expands as the stage does leaves the platform at rest"
        raise BadInput(f"frame.expansion_um_per_m_k {MISSING} of the frame: {still}")


def in_plane(designs: Designs) -> Expansions:
    """What the plane problem sees of the expansions of stage and frame; a frame of none is as the stage.

    Notes
    -----
    In plane strain the faces are held at the frame's strain across, and `nu (a - a_frame)` more goes into the plane.
    """
    own, frame = designs.expansion.T
    frame = np.where(np.isnan(frame), own, frame)
    return Expansions(own + designs.out_of_plane * (own - frame), frame)


def rates_of(pose: Array) -> DriftRates:
    """Rates of poses (n, 3, 3 cases), the largest over gradients of all directions.

    Notes
    -----
    The translation is the largest singular value of the matrix (2, 2) of both gradients, in closed form; each may
    have a direction of its own.
    """
    (a, b), (c, d), turn = np.moveaxis(pose[:, :, 1:], 0, -1)
    moved = (np.hypot(a + d, c - b) + np.hypot(a - d, b + c)) / 2
    return DriftRates(pose[:, :, 0], np.stack([moved, np.hypot(*turn)], axis=-1))


def drift(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    stage_expansion: Array,
    frame_expansion: Array,
    bodies: WarmBodies | None = None,
) -> WarmModel:
    """Drift of n designs by hinges of compliances (n, 3, 3).

    Parameters
    ----------
    stage_expansion, frame_expansion : (n,), 1/K, in the plane.
    bodies : None where pads, links and platform are rigid.
    """
    chains = chain_compliance(designs.frames, hinges, freedoms)
    gaps = misfits(designs, stage_expansion, frame_expansion)
    n = len(gaps)
    full = np.zeros((n, 9, 9))
    if bodies is not None:
        full += bodies.compliance
        gaps = gaps + (frame_expansion - stage_expansion)[:, None, None, None] * bodies.edges
    for chain in range(3):
        part = slice(3 * chain, 3 * chain + 3)
        full[:, part, part] += chains[:, chain]
    S, E = inverse(full), np.tile(np.eye(3), (3, 1))
    pull, t = E.T @ S, gaps.reshape(n, 9, 3)
    pose = inverse(pull @ E) @ pull @ t
    wrenches = (S @ (E @ pose - t)).reshape(n, 3, 3, 3)
    necks: Wrench = neck_wrenches(designs.frames, wrenches)
    stress = neck_stress(necks, designs.neck, designs.thickness, stress_raised(designs))
    return WarmModel(pose, -wrenches, stress)


def misfits(designs: Designs, stage_expansion: Array, frame_expansion: Array) -> Array:
    """Displacements (n, 3 chains, 3, 3 cases) of the platform on each chain alone, its hinges at rest.

    Notes
    -----
    A free body has, per expansion and by 1 K, 1 K/mm along x and along y, at z = x + iy the displacements z, `z^2/2`
    and `-i z^2/2` and the turns 0, y and -x. As rigid motions of the ground they are `(x, y, 0)`, `(r^2/2, 0, y)` and
    `(0, r^2/2, -x)` at the platform's centre, whatever the path of the chain.
    """
    centres, axes = designs.frames
    pad = designs.radius[:, :, 0] + designs.link_width[:, None]
    ground = centres[:, :, 0] - pad[..., None] * direction(axes[:, :, 0])
    x, y = np.moveaxis(ground, -1, 0)
    none, half = np.zeros_like(x), (x**2 + y**2) / 2
    grown = np.array([[x, half, none], [y, none, half], [none, y, -x]])
    further = (frame_expansion - stage_expansion)[:, None, None, None]  # zero, not round-off, where they are the same
    return np.asarray(further * np.moveaxis(grown, (0, 1), (2, 3)))
