"""Every limit of a drive as one set of linear limits of its commands, with the names that users see.

The two stacks of a pair bear on each other, so that their preloads stress no neck; the preload of a single stack does.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.warnings import YIELD_MARGIN
from flexfem.verify.command import stack_names
from flexfem.verify.driven import DriveLimits, Driven, limits_of_forces, limits_of_strokes, moved
from flexfem.verify.driven_models import Commanding, stresses
from flexfem.verify.limits import KINDS
from flexfem.verify.neck_limits import (
    NeckForces,
    NeckSections,
    limits_of_necks,
    neck_forces,
    per_command,
    sections_of,
)
from flexfem.verify.polytope import LinearLimits


def limits_of_commands(stage: Stage, first: Commanding, of: Driven, drive: StageDrive, load: Array) -> LinearLimits:
    """Every limit of the commands (m,) of a driven stage under a load (3,), with the names that users see.

    first : the model whose necks carry what the stacks of `of` push with.
    """
    stacks = stack_names(drive)
    strokes, (contact, blocking) = limits_of_strokes(drive), limits_of_forces(of, drive, load)
    names = [f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names]
    names += [f"{kind} of {name}" for kind in KINDS[1:3] for name in stacks]
    yields = _yield_limits(stage, first, of, drive, load)
    every = (strokes, contact, blocking, yields)
    necks = [f"yield of the {hinge} hinge, chain {chain}" for chain in (1, 2, 3) for hinge in HINGE_NAMES]
    owner = np.concatenate([np.arange(len(names)), len(names) + np.repeat(np.arange(9), len(yields.rows) // 9)])
    return LinearLimits(
        np.concatenate([each.rows for each in every]),
        np.concatenate([each.offsets + each.sizes for each in every]),
        owner,
        (*names, *necks),
    )


def _yield_limits(stage: Stage, first: Commanding, of: Driven, drive: StageDrive, load: Array) -> DriveLimits:
    """Limits of the stress along every neck, neck by neck, with the preloads and a load; `YIELD_MARGIN` below yield."""
    at = NeckSections(*(each[0] for each in sections_of(lower(stage))))
    frames, necks = stage_frames(stage), first.model.necks
    force = drive.preload - of.Y @ of.C[3:, :3] @ load
    carried = neck_forces(frames, (necks @ np.concatenate([load, force]))[..., None])
    at_rest = NeckForces(*(each[..., 0] for each in carried))
    strength = np.array(stage.material.yield_strength * (1 - YIELD_MARGIN[stage.model]))
    return limits_of_necks(at, per_command(of, frames, necks), at_rest, strength)


def preload_stress(stage: Stage, first: Commanding, drive: StageDrive) -> float:
    """Highest stress of a neck by the preloads alone, MPa: the two of a pair bear on each other, and stress none."""
    at_rest = moved(first.of, drive, np.zeros(len(drive.names)), np.zeros(3))._replace(force=drive.preload)
    return float(np.max(stresses(stage, first, at_rest, np.zeros(3))))
