"""The hinges that a figure draws, of whatever has hinges: a stage, the record of `flexfem.check`, a stored model."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.files.refusals import shown
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.errors import CurveModels, HingeDrawing
from flexfem.refused import BadInput
from flexfem.verify.stage_report import PlacedHinge, StageReport


class Placed(NamedTuple):
    """The nine hinges of a stage, chain by chain."""

    hinges: list[HingeDrawing]


HasHinges: TypeAlias = Stage | StageReport | CurveModels


def placed(given: HasHinges) -> Placed:
    """The hinges of a stage as read, or of a model. Raises BadInput for what has none, or cannot be made."""
    if isinstance(given, CurveModels):
        return Placed(given.hinges)
    if isinstance(given, Stage):
        check_feasible(given)
        return Placed([_of_stage(given, chain, position) for chain, position in np.ndindex(3, 3)])
    if not isinstance(given, StageReport):
        raise BadInput(f"{shown(given)}: expected a stage, or the record of flexfem.check")
    return Placed([_drawing(hinge) for hinge in given.hinges])


def _of_stage(stage: Stage, chain: int, position: int) -> HingeDrawing:
    name, frames = HINGE_NAMES[position], stage_frames(stage)
    hinge, (x, y) = stage.hinge(chain + 1, name), frames.centres[chain, position].tolist()
    axis = float(np.rad2deg(frames.axes[chain, position]))
    return _drawing(PlacedHinge(chain + 1, name, (x, y), axis, hinge.radius, hinge.neck, hinge.prismatic))


def _drawing(hinge: PlacedHinge) -> HingeDrawing:
    return HingeDrawing(
        chain=hinge.chain,
        hinge=hinge.hinge,
        centre=hinge.centre_mm,
        axis=float(np.deg2rad(hinge.axis_deg)),
        radius=hinge.radius_mm,
        neck=hinge.neck_mm,
        freedoms=["rotation", *(["axial"] * hinge.prismatic)],
    )
