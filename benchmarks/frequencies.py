"""The three lowest frequencies by calibrated hinges, with elastic links and rigid, against finite elements.

    python benchmarks/frequencies.py [--stages 40] [--seed 2003] [--resolution 6]

Stages are those of `random_stages.py` with unlike chains. What is left out with rigid links is their bending; with
elastic ones, that inertia acts along a link as a whole, and the rotary inertia within it.
"""

from __future__ import annotations

import argparse

import numpy as np
from random_stages import unlike

from flexfem.analytic.dynamics import dynamics
from flexfem.analytic.model import analyse
from flexfem.fem.modes import modes
from flexfem.fem.sectors import build_mesh
from flexfem.refused import BadInput
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.inertia import Payload
from flexfem.stage.schema import Stage
from flexfem.verify.modes import vibration

MODELS = {"default formula, mobility 21": ("paros-weisbord", False), "calibrated": ("calibrated", False)}
MODELS |= {"calibrated, elastic links": ("calibrated", True)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", type=int, default=40)
    parser.add_argument("--seed", type=int, default=2003)
    parser.add_argument("--resolution", type=int, default=6)
    asked = parser.parse_args()
    rng, found = np.random.default_rng(asked.seed), list[list[float]]()
    while len(found) < asked.stages:
        try:
            stage = Stage.model_validate(unlike(rng))
            check_feasible(stage)
            models = [dynamics(stage, analyse(stage, 21, *how), Payload()).frequencies[:3] for how in MODELS.values()]
        except (BadInput, ValueError):
            continue
        metal = modes(vibration(stage, build_mesh(stage, asked.resolution), Payload(), "disengaged"), 3).frequencies
        found.append([float(np.max(np.abs(model / metal - 1))) * 100 for model in models])
    print("largest difference of three frequencies from finite elements, %: median, 90 %, largest")
    for name, values in zip(MODELS, np.transpose(found), strict=True):
        print(f"{name:32} {np.median(values):8.3f} {np.quantile(values, 0.9):8.3f} {values.max():8.3f}")


if __name__ == "__main__":
    main()
