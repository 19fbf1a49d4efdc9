"""Elastic links by boundary elements against finite elements: seconds of processor time a design, in one run.

    OMP_NUM_THREADS=1 python benchmarks/links.py [--designs 7]

The reference stages with platforms and thicknesses that differ a little, chains alike and nine different necks; the
finite elements are those of a study at its default resolution.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flexfem.analytic.model import analyse
from flexfem.clock import Limit
from flexfem.fem.mesh import mesh_sectors
from flexfem.fem.response import unit_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage, load_stage
from flexfem.mechanism.stage_file import Override

ROOT = Path(__file__).parents[1]
MODELS: dict[str, Callable[[Stage], object]] = {
    "rigid links": lambda stage: analyse(stage, 21, "calibrated"),
    "elastic links": lambda stage: analyse(stage, 21, "calibrated", links=True),
    "finite elements": lambda stage: unit_response(mesh_sectors(stage, 4, Limit(60.0), True), plate_of(stage)),
}


def design(base: Stage, number: int, alike: bool) -> Stage:
    """A stage that differs from all others, so that nothing of it is known before."""
    platform = base.platform.model_copy(update={"radius": base.platform.radius + 0.01 * number})
    stage = base.model_copy(update={"thickness": base.thickness + 0.01 * number, "platform": platform})
    if alike:
        return stage
    places = [(chain, name) for chain in CHAINS for name in HINGE_NAMES]
    necks = [stage.hinge(*place).neck * (1 + 0.01 * k) for k, place in enumerate(places)]
    given = [{"chain": c, "hinge": h, "neck_mm": t} for (c, h), t in zip(places, necks, strict=True)]
    return stage.model_copy(update={"override": tuple(map(Override.model_validate, given))})


def seconds(work: Callable[[Stage], object], stage: Stage) -> float:
    started = time.process_time()
    work(stage)
    return time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=7)
    count = parser.parse_args().designs
    print(f"| stage | chains | {' | '.join(f'{name}, s' for name in MODELS)} |")
    print("|---|---|" + "---:|" * len(MODELS))
    for name in ("mobility3", "mobility6"):
        base = load_stage(ROOT / "geometry" / f"{name}.toml")
        for alike in (True, False):
            stages = [design(base, number, alike) for number in range(count + 1)]
            found = [[seconds(work, stage) for work in MODELS.values()] for stage in stages][1:]  # the first imports
            cells = " | ".join(f"{each:.4f}" for each in np.median(found, axis=0))
            print(f"| {name} | {'alike' if alike else 'different'} | {cells} |")


if __name__ == "__main__":
    main()
