"""How often bands of drives, drift and highest stresses hold the truth, over random driven stages.

    python benchmarks/corner_bands.py [--stages 4] [--seeds 4001 4002] [--keep FILE.npz]

Chains alike and unlike, notches of mobility three and six, in turn. The bands are those of `flexfem
design`, and of poses those of `flexfem drift`. The truth is extrapolated from meshes 1.5 and 2.5
times as fine, by the order of the kind. A truth whose last step is more than half the band is not
settled: whether the band holds it is printed, and not counted. `--keep` stores what was solved,
which `tests/questions/test_corner_bands.py` counts again. Exits with 1 where less than 95 % of the
numbers of a kind whose truth is settled are held."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from random_drives import with_drive
from random_stages import dimensions, scattered

from flexfem.arrays import Array
from flexfem.design.proof import CORNER_COLUMNS, column_band
from flexfem.fem.response import heat_response
from flexfem.mechanism.expansion import expansion_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.meshing.process import Limit
from flexfem.paper.commanding import element_ranges
from flexfem.paper.outputs import values_of
from flexfem.paper.responses import rates_of
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.paper.study import Requests, elements, solved_design
from flexfem.questions.bands import CORNER_ORDER, STRESS_ORDER, pose_bands
from flexfem.questions.life import cyclic_motion
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.columns import (
    DRIFTS,
    DRIVE_RANGES,
    ENGAGED,
    GRADIENTS,
    RANGES,
    STRESSES,
    outputs_of,
)

RESOLUTIONS = (4, 6, 8)
FINE = (12, 20)  # of the default mesh, and of the truth
LEAST = 0.95  # of the numbers of a kind
SETTLED = 0.5  # of a band, which extrapolation adds to the truth at most
ROUND_OFF = 1e-8  # of the largest number of the kind: zero by symmetry
ALONG_X = (True, False, False)
REPEATED = cyclic_motion(np.array([0.05, 0.0, 0.0]), None, -1.0, 1e6)
COLUMNS = outputs_of("drive", "life", "drift", moved=ALONG_X)
KINDS = {
    "drive range": DRIVE_RANGES,
    "engaged stiffness": ENGAGED,
    "uniform drift": DRIFTS,
    "drift by gradients": GRADIENTS,
    "highest stress": STRESSES,
    "range at yield": RANGES,
    "life": tuple(name for name in COLUMNS if name.startswith(("life_", "safety_"))),
}
POSES = "poses of drift"


class Solved(NamedTuple):
    """On `RESOLUTIONS` and `FINE`: columns (n, levels, k), poses (n, levels, 3, 3 cases), mm, rad;
    lever (n,), mm.

    stages : their files.
    """

    columns: Array
    poses: Array
    lever: Array
    stages: list[str]


class Judged(NamedTuple):
    """Of numbers of one kind: error over band (k,), and what extrapolation adds to the truth, over
    the band (k,).
    """

    ratios: Array
    doubts: Array

    @property
    def settled(self) -> Array:
        """Whether the truth (k,) is known well enough to judge the band."""
        return self.doubts <= SETTLED

    @property
    def held(self) -> bool:
        return float(np.mean(self.ratios[self.settled] <= 1)) >= LEAST


def solved_stages(seeds: list[int], number: int) -> Solved:
    """So many stages of each seed; one that finite elements refuse on some mesh is told of and left
    out.
    """
    found = []
    for seed in seeds:
        stages = _drawn(np.random.default_rng(seed))
        made = 0
        while made < number:
            stage = next(stages)
            try:
                each = [_answered(stage, n) for n in RESOLUTIONS + FINE]
            except ComputationFailed as failure:
                print(f"left out: {failure}", flush=True)
                continue
            made += 1
            found.append((*zip(*each, strict=True), stage.chain.link_lengths[2], stage.to_toml()))
            print(f"{len(found)} of {number * len(seeds)}", flush=True)
    columns, poses, lever, files = zip(*found, strict=True)
    return Solved(np.array(columns), np.array(poses), np.array(lever), list(files))


def _drawn(rng: np.random.Generator) -> Iterator[Stage]:
    """Stages that can be made, and that their drives move in all three directions."""
    made = 0
    while True:
        try:
            stage = Stage.model_validate(_dimensions(rng, made))
            check_feasible(stage)
            stage = with_drive(stage, rng, 0.3)
            if np.isnan(_answered(stage, RESOLUTIONS[0])[0]).any():
                continue
        except (BadInput, ComputationFailed):
            continue
        made += 1
        yield stage


def _dimensions(rng: np.random.Generator, number: int) -> dict[str, Any]:
    """Of mobility three (equal notches) and six (base notches of their own) in turn, two alike and
    two unlike.
    """
    drawn = dimensions(rng)
    if number % 2:
        drawn["hinges"]["base"]["prismatic"] = True
    else:
        drawn["hinges"] = dict.fromkeys(drawn["hinges"], drawn["hinges"]["elbow"])
    law = {
        "fatigue_strength_coefficient_mpa": 1200.0,
        "fatigue_strength_exponent": float(rng.uniform(-0.14, -0.08)),
    }
    drawn["material"] |= law | {"expansion_um_per_m_k": float(rng.uniform(8, 24))}
    drawn["frame"] = {"expansion_um_per_m_k": float(rng.uniform(8, 24))}
    return drawn if number % 4 < 2 else scattered(drawn, rng)


def _answered(stage: Stage, resolution: int) -> tuple[Array, Array]:
    """Columns (k,) and poses (3, 3) of one mesh."""
    limit = Limit(600.0)
    found = solved_design(stage, resolution, limit, Requests(repeated=REPEATED))
    mesh = elements(stage, resolution, limit).mesh
    alpha = expansion_of(stage)
    poses = heat_response(mesh, plate_of(stage), alpha.plate, alpha.frame).motions
    found = found._replace(drives=element_ranges(stage, mesh), drift=rates_of(poses[None]))
    return values_of(found, COLUMNS, None)[0], poses


def judged(found: Solved) -> dict[str, Judged]:
    """By kind."""
    kinds = {kind: _of_columns(found, names) for kind, names in KINDS.items()}
    levels = np.array(RESOLUTIONS, dtype=float)
    bands = [
        pose_bands(levels, each[:3], np.array([1.0, 1.0, lever]))
        for each, lever in zip(found.poses, found.lever, strict=True)
    ]
    scale = np.array([np.ones_like(found.lever), np.ones_like(found.lever), found.lever]).T[
        :, :, None
    ]
    sizes = np.max(np.abs(found.poses[:, -1] * scale), axis=1, keepdims=True) / scale
    return kinds | {POSES: _over(found.poses, np.array(bands), sizes, CORNER_ORDER)}


def _of_columns(found: Solved, names: tuple[str, ...]) -> Judged:
    values = found.columns[:, :, [COLUMNS.index(name) for name in names]]
    bands = [
        [
            column_band(name, np.array(RESOLUTIONS, dtype=float), each[:3, k])
            for k, name in enumerate(names)
        ]
        for each in values
    ]
    order = CORNER_ORDER if names[0] in CORNER_COLUMNS else STRESS_ORDER
    sizes = (
        np.max(np.abs(values[:, -1]), axis=1, keepdims=True)
        if names == DRIFTS
        else np.abs(values[:, -1])
    )
    return _over(values, np.array(bands), sizes, order)


def _over(values: Array, bands: Array, sizes: Array, order: float) -> Judged:
    """Of values (n, levels, ...) with bands and sizes (n, ...)."""
    coarse = values[:, -2]
    fine = values[:, -1]
    truth = fine + (fine - coarse) / ((FINE[1] / FINE[0]) ** order - 1)
    known = np.abs(values[:, 2]) > ROUND_OFF * sizes
    error = np.abs(values[:, 2] - truth)[known]
    left = np.abs(fine - truth)[known]
    return Judged(error / bands[known], left / bands[known])


def report(kinds: dict[str, Judged]) -> bool:
    """Print a line for every kind; whether all are held."""
    print(
        f"{'numbers':20} outside  nearest and worst error/band  median band/error  truth's last "
        "step/band"
    )
    for kind, each in kinds.items():
        ratios, doubts = each
        inside = ratios[ratios <= 1]
        nearest = np.max(inside) if len(inside) else np.nan
        outside = f"{len(ratios) - len(inside)} of {len(ratios)}"
        wide = 1 / np.median(ratios)
        print(
            f"{kind:20} {outside:>9} {nearest:14.2f} {np.max(ratios):6.2f} {wide:17.1f} "
            f"{np.median(doubts):19.3f}"
        )
        for ratio, doubt in zip(ratios[~each.settled], doubts[~each.settled], strict=True):
            print(
                f"  not settled: a truth whose last step is {doubt:.2f} of the band, at "
                f"{ratio:.2f} of it"
            )
    failed = [kind for kind, each in kinds.items() if not each.held]
    if failed:
        print(f"less than {LEAST:.0%} held: {', '.join(failed)}")
    return not failed


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=4)
    parser.add_argument("--seeds", type=int, nargs="+", default=[4001, 4002])
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    found = solved_stages(arguments.seeds, arguments.stages)
    if arguments.keep:
        np.savez_compressed(arguments.keep, **found._asdict())
    if not report(judged(found)):
        sys.exit(1)


if __name__ == "__main__":
    main()
