"""Where the metal goes with the strokes of a model, and the calibration that would bring it to the pose asked for."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA
from flexfem.arrays import Array
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.verify.driven import Driven, commands_for, moved
from flexfem.verify.driven_models import Commanding, DrivenMetal, commanding
from flexfem.verify.result import Record


class OpenLoop(Record):
    """Pose (3,) that finite elements take with the strokes of a model, and its error: mm, mm, rad."""

    model: str
    pose: list[float]
    error: list[float]


def open_loop(stage: Stage, metal: DrivenMetal, first: Commanding, pose: Array, load: Array) -> list[OpenLoop]:
    """Poses of the metal under the strokes of several models, then of the first after calibration."""
    models = {first.name: first}
    rigid = (None, DEFAULT_FORMULA, False), (21, DEFAULT_FORMULA, False), (21, CALIBRATED, False)
    for choice in ((None, CALIBRATED, True), *rigid):
        try:
            one = commanding(stage, *choice)
        except BadInput:  # off the chart
            continue
        models.setdefault(one.name, one)
    drive, lever = drive_of(stage), stage.chain.link_lengths[2]
    asked = [(name, model, pose) for name, model in models.items()]
    full = calibration(metal.of, first.of, drive, lever)
    gains = 1 / np.diag(np.linalg.inv(full))
    asked.append((f"{first.name}, three gains", first, gains * pose))
    asked.append((f"{first.name}, calibration matrix", first, full @ pose))
    found = []
    for name, model, wanted in asked:
        x = commands_for(model.of, drive, wanted, load, lever, "least energy")
        reached = moved(metal.of, drive, x, load).pose
        found.append(OpenLoop(model=name, pose=reached.tolist(), error=(reached - pose).tolist()))
    return found


def calibration(metal: Driven, model: Driven, drive: StageDrive, lever: float) -> Array:
    """Matrix (3, 3) of the pose to command of the model so that the metal takes a pose, both without load."""
    none, units = np.zeros(3), np.diag([1e-3, 1e-3, 1e-3 / lever])
    strokes = [commands_for(model, drive, unit, none, lever, "least energy") for unit in units]
    reached = np.array([moved(metal, drive, x, none).pose for x in strokes]).T
    return np.asarray(units @ np.linalg.inv(reached))
