"""The highest neck stress per displacement by every hinge formula against finite elements, elastic
and rigid links.

    python benchmarks/stress.py [--stages 6] [--seed 77] [--resolution 6]

The reference stages, and random feasible ones; per cent above the finite elements, smallest and
largest of the three directions of all stages on which the formula is in its range. The mesh itself
is 0.3 to 0.5 % low at resolution 6."""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
from random_stages import drawn

import flexfem
from flexfem.arrays import Array
from flexfem.hinges.formulas import FORMULAS
from flexfem.paper.model import analyse
from flexfem.paper.stage import Stage, load_stage

GEOMETRY = Path(__file__).parent.parent / "geometry"


def highest(stress: Array) -> Array:
    """Highest stress (3,) of the nine necks, MPa per mm and rad."""
    return np.asarray(np.max(stress, axis=(0, 1)))


def above(stage: Stage, resolution: int) -> dict[str, Array]:
    """Per cent (3,) above the finite elements, by formula and links."""
    elements = highest(np.moveaxis(flexfem.solve(stage, resolution).neck_stress(np.eye(3)), 0, -1))
    found = {}
    for name, entry in FORMULAS.items():
        if np.all(
            entry.in_range(stage.array("radius"), stage.array("neck"), stage.chain.link_width)
        ):
            found[f"{name}, elastic links"] = highest(analyse(stage, None, name, True).stress)
            found[f"{name}, rigid links, mobility 3"] = highest(analyse(stage, 3, name).stress)
    return {name: 100 * (stress / elements - 1) for name, stress in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=6)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--resolution", type=int, default=6)
    arguments = parser.parse_args()
    stages = [load_stage(GEOMETRY / f"mobility{mobility}.toml") for mobility in (3, 6)]
    stages += drawn(arguments.stages, arguments.seed)
    found = defaultdict(list)
    for stage in stages:
        for name, percent in above(stage, arguments.resolution).items():
            found[name].append(percent)
    for name, percents in found.items():
        print(
            f"{name}: {np.min(percents):+.1f} to {np.max(percents):+.1f} % on {len(percents)} "
            "stages"
        )


if __name__ == "__main__":
    main()
