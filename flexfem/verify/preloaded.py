"""Stiffness of a driven stage with its stacks pushing."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.large import Serial, loaded, serial
from flexfem.arrays import Array
from flexfem.mechanism.contacts import FOLLOWS, Follows
from flexfem.mechanism.drives import StageDrive
from flexfem.mechanism.stage import Stage
from flexfem.refused import ComputationFailed
from flexfem.verify.driven_models import Commanding


def serials(stage: Stage, model: Commanding, drive: StageDrive) -> dict[Follows, Serial]:
    """The stage of a commanding model as joints in series, by what the pushes go with."""
    return {follows: serial(stage, model.result, drive.stacks, follows) for follows in FOLLOWS}


def stiffness(of: Serial, drive: StageDrive, force: Array, load: Array) -> list[float] | None:
    """Diagonal (3,) of the platform's stiffness with the stacks holding their strokes; None where nothing is stable.

    force : (n,), N, of the stacks, preloads included.   load : (3,), N, N, N mm.
    """
    try:
        found = loaded(of, force, load)
    except (ComputationFailed, np.linalg.LinAlgError):
        return None
    return np.diag(found.stiffness(drive.stiffness)).tolist() if found.stable(drive.stiffness) else None
