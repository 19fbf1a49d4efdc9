"""Neck stresses of driven random stages by the analytic model over those of finite elements, with
the same strokes.

    python benchmarks/drive_stress.py [--stages 12] [--seed 2003] [--resolution 8]

Stages as in random_drives.py, moved along x, y and theta by strokes of least energy, and by least
strokes, which set stacks against each other so that necks are sheared. Ratios of the highest
stress, and of every neck that has 30 % of it or more, smallest and largest. The finite elements are
`warning.stress_below` low."""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from random_drives import with_drive
from random_stages import drawn

from flexfem.paper.commanding import commanding, driven_elements
from flexfem.paper.drives import drive_of
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

CRITERIA = ("least energy", "least stroke")
MODELS = {
    "calibrated, elastic links": (None, CALIBRATED, True),
    "calibrated, rigid links": (21, CALIBRATED, False),
    "paros-weisbord, elastic links": (None, DEFAULT_FORMULA, True),
    "paros-weisbord, rigid links, mobility 6": (6, DEFAULT_FORMULA, False),
}
HIGH = 0.3  # of the highest stress: a neck that carries less is not compared
NONE = np.zeros(3)


def ratios(stage: Stage, resolution: int) -> dict[tuple[str, str], list[float]]:
    """By model and criterion: of the highest stress, then of every neck of high stress, of all
    three poses.
    """
    drive = drive_of(stage)
    metal = driven_elements(stage, resolution)
    lever = stage.chain.link_lengths[2]
    best = commanding(ModelChoice(stage, *MODELS["calibrated, elastic links"]))
    found = defaultdict(list)
    for criterion in CRITERIA:
        for pose in np.diag(1e-3 / np.array([1, 1, lever])):
            x = best.system.commands(pose, NONE, lever, criterion)
            elements = metal.stress(NONE, drive.preload + metal.system.moved(x, NONE).force)
            for name, model in MODELS.items():
                one = commanding(ModelChoice(stage, *model))
                stress = one.stress(NONE, one.system.moved(x, NONE).force)
                high = elements > HIGH * np.max(elements)
                found[name, f"{criterion}, highest"].append(np.max(stress) / np.max(elements))
                found[name, f"{criterion}, each neck"] += (stress / elements)[high].tolist()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=12)
    parser.add_argument("--seed", type=int, default=2003)
    parser.add_argument("--resolution", type=int, default=8)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    found = defaultdict(list)
    used = 0
    for stage in drawn(arguments.stages, arguments.seed):
        try:
            for key, each in ratios(with_drive(stage, rng), arguments.resolution).items():
                found[key] += each
            used += 1
        except BadInput:  # a formula that is not positive, or a drive that does not move the stage
            continue
    for (model, which), each in found.items():
        print(f"{model}, {which}: {np.min(each):.3f} to {np.max(each):.3f} on {used} stages")


if __name__ == "__main__":
    main()
