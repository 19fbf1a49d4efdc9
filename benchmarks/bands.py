"""How often the bands of error percentages hold the truth, over random feasible stages whose chains
are unlike.

    python benchmarks/bands.py [--stages 30] [--seeds 2026 2027] [--keep FILE.npz]

The truth is the compliance extrapolated from two much finer meshes. `--keep` stores what was
solved, which `tests/questions/test_bands.py` counts again without solving."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from random_stages import unlike

from flexfem.arrays import Array
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.model import analyse
from flexfem.paper.solutions import solved as solve_stage
from flexfem.paper.stage import Stage
from flexfem.questions.bands import ORDER, command_convergence, error_matrix
from flexfem.refused import BadInput, ComputationFailed

RESOLUTIONS = (4, 6, 8)  # of the default mesh
FINE = (11, 16)


class Solved(NamedTuple):
    """Compliances (n, levels, 3, 3) on `RESOLUTIONS` and `FINE`, analytic stiffness (n, 3, 3),
    lever (n,).

    stages : what their files would hold, as JSON.
    """

    compliance: Array
    stiffness: Array
    lever: Array
    stages: list[str]


def solved_stages(seeds: list[int], number: int) -> Solved:
    """So many stages of each seed."""
    found = [row for seed in seeds for row in _drawn(np.random.default_rng(seed), number)]
    compliance, stiffness, lever, stages = zip(*found, strict=True)
    return Solved(np.array(compliance), np.array(stiffness), np.array(lever), list(stages))


def _drawn(rng: np.random.Generator, number: int) -> list[tuple[Array, Array, float, str]]:
    found: list[tuple[Array, Array, float, str]] = []
    while len(found) < number:
        drawn = unlike(rng)
        stage = Stage.model_validate(drawn)
        try:
            check_feasible(stage)
            compliance = np.array([solve_stage(stage, n).compliance for n in RESOLUTIONS + FINE])
        except (BadInput, ComputationFailed):
            continue
        found.append(
            (compliance, analyse(stage).stiffness, stage.chain.link_lengths[2], json.dumps(drawn))
        )
        print(f"{len(found)} of {number}", flush=True)
    return found


def ratios(compliance: Array, stiffness: Array, lever: float) -> Array:
    """Band over actual error (3, 3) of the error percentages of one stage, column j for command j."""
    growth = (FINE[1] / FINE[0]) ** ORDER
    percents = np.array([error_matrix(stiffness, each, lever) for each in compliance])
    truth = percents[-1] + (percents[-1] - percents[-2]) / (growth - 1)
    number = len(RESOLUTIONS)
    bands = [
        [
            each.band
            for each in command_convergence(
                np.array(RESOLUTIONS),
                percents[:number, :, j],
                j,
                compliance[:number],
                stiffness[:, j],
                lever,
            )
        ]
        for j in range(3)
    ]
    return np.transpose(bands) / np.abs(percents[number - 1] - truth)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=30)
    parser.add_argument("--seeds", type=int, nargs="+", default=[2026, 2027])
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    found = solved_stages(arguments.seeds, arguments.stages)
    over = np.array([ratios(*each) for each in zip(*found[:3], strict=True)])
    along = np.eye(3, dtype=bool)
    for name, where in (("along", along), ("across", ~along)):
        ratio = over[:, where].ravel()
        held = f"{np.sum(ratio >= 1)} of {len(ratio)} bands hold the truth"
        print(
            f"{name}: {held} ({np.mean(ratio >= 1):.1%}); median band over error "
            f"{np.median(ratio):.1f}"
        )
    if arguments.keep:
        np.savez_compressed(arguments.keep, **found._asdict())


if __name__ == "__main__":
    main()
