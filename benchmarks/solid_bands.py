"""How often the bands in three dimensions hold the truth, over random feasible stages whose nine
notches differ.

    python benchmarks/solid_bands.py [--stages 4] [--seeds 5001 5002 5003] [--keep FILE.npz]

The truth is the answer moved by what much finer meshes with one layer, and many more layers on a
coarse mesh, change. `--keep` stores what was solved, which `tests/questions/test_bands.py` counts
again without solving."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from random_stages import unlike

from flexfem.arrays import Array
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.answers import solid_levels
from flexfem.paper.solutions import solve_solid
from flexfem.paper.stage import Stage
from flexfem.questions.bands import ORDER, SolidLevels, solid_bands
from flexfem.refused import BadInput, ComputationFailed

RESOLUTION = 4
LAYERS = 3  # of the answers
FINE = (6, 8)
MANY = (4, 6)  # resolutions with one layer; layers on the coarsest mesh of the bands, resolution 2


class Solved(NamedTuple):
    """Compliances (n, 3, 3): answers and truths; of `solid.SolidLevels` (n, levels, 3, 3), the last
    two few and many.

    stages : what their files would hold, as JSON.
    """

    answer: Array
    truth: Array
    levels: Array
    stages: list[str]


def solved(stage: Stage) -> tuple[Array, Array, Array]:
    """Answer, truth and levels of one stage."""
    answer = solve_solid(stage, RESOLUTION, LAYERS).compliance
    found = solid_levels(stage, RESOLUTION, LAYERS)
    coarse, fine = (solve_solid(stage, n, 1).compliance for n in FINE)
    few, many = (solve_solid(stage, 2, n).compliance for n in MANY)
    in_plane = fine + (fine - coarse) / ((FINE[1] / FINE[0]) ** ORDER - 1)
    layered = many + (many - few) / ((MANY[1] / MANY[0]) ** ORDER - 1)
    truth = answer + (in_plane - found.planes[-1]) + (layered - found.many)
    return answer, truth, np.concatenate([found.planes, [found.few, found.many]])


def solved_stages(seeds: list[int], number: int) -> Solved:
    """So many stages of each seed."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        left = number
        while left:
            drawn = unlike(rng)
            stage = Stage.model_validate(drawn)
            try:
                check_feasible(stage)
                found.append((*solved(stage), json.dumps(drawn)))
            except (BadInput, ComputationFailed):
                continue
            left -= 1
            print(f"{len(found)} of {number * len(seeds)}", flush=True)
    return Solved(
        *(np.array(each) for each in list(zip(*found, strict=True))[:3]),
        [each[3] for each in found],
    )


def ratios(answer: Array, truth: Array, levels: Array) -> Array:
    """Band over actual error (3, 3) of the entries of one compliance."""
    band = sum(solid_bands(SolidLevels(levels[:3], *levels[3:]), RESOLUTION))
    return band / np.abs(answer - truth)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=4)
    parser.add_argument("--seeds", type=int, nargs="+", default=[5001, 5002, 5003])
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    found = solved_stages(arguments.seeds, arguments.stages)
    over = np.array([ratios(*each) for each in zip(*found[:3], strict=True)])
    off = np.abs(np.diagonal(found.answer / found.truth, axis1=1, axis2=2) - 1)
    print(
        f"error on the diagonal: median {100 * np.median(off):.3f} %, worst "
        f"{100 * np.max(off):.3f} %"
    )
    upper = np.triu(np.ones((3, 3), dtype=bool), 1)
    for name, where in (("diagonal", np.eye(3, dtype=bool)), ("off it", upper)):
        ratio = over[:, where].ravel()
        print(
            f"{name}: {np.sum(ratio >= 1)} of {len(ratio)} bands hold; median band over error "
            f"{np.median(ratio):.1f}"
        )
    if arguments.keep:
        np.savez_compressed(arguments.keep, **found._asdict())


if __name__ == "__main__":
    main()
