"""Finite-element designs of a study, one after the other: seconds of processor time per design, and where they go.

    python benchmarks/study_fe.py [--designs 500] [--extrapolated 10] [--resolution 4]

Random feasible stages, with chains alike and with nine hinges that differ, each checked, meshed inside the process,
solved and asked for every output. The accuracy is that of the platform stiffness against meshes extrapolated from
resolutions 6, 8 and 11. One thread.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from random_stages import draw

from flexfem.arrays import Array
from flexfem.fem import cyclic, response, sectors
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import Override
from flexfem.refused import BadInput
from flexfem.study.answer import solved_values
from flexfem.study.loaded import LoadedStudy
from flexfem.study.plan import Study
from flexfem.verify.errors import grid_convergence
from flexfem.verify.protocol import solve_stage

LEVELS = (6, 8, 11)
SCATTER = 0.03  # of the necks, relative, where chains differ
SEED = 2003
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


class Clock:
    """Seconds of processor time by name, children included; what runs inside another counts for both."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def watching(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*given: Any, **named: Any) -> Any:
            started = now()
            result = work(*given, **named)
            self.seconds[name] = self.seconds.get(name, 0.0) + now() - started
            return result

        return watched


def now() -> float:
    child = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + child.ru_utime + child.ru_stime


def feasible(rng: np.random.Generator, alike: bool) -> Stage:
    """The next random stage that can be made."""
    while True:
        stage = draw(rng)
        if not alike:
            places = [(chain, hinge) for chain in CHAINS for hinge in HINGE_NAMES]
            necks = [stage.hinge(*place).neck * (1 + SCATTER * rng.normal()) for place in places]
            overrides = [
                Override.model_validate({"chain": chain, "hinge": hinge, "neck_mm": neck})
                for (chain, hinge), neck in zip(places, necks, strict=True)
            ]
            stage = stage.model_copy(update={"override": tuple(overrides)})
        try:
            check_feasible(stage)
        except BadInput:
            continue
        return stage


def study(resolution: int) -> LoadedStudy:
    content = {
        "name": "benchmark",
        "stage": "none",
        "model": "fe",
        "resolution": resolution,
        "sampling": {"method": "grid"},
        "factor": [{"key": "thickness_mm", "values": [9.7]}],
        "drive": {"stroke_um": 17.4, "lever_arm_mm": 10.0},
    }
    stage = draw(np.random.default_rng(SEED))
    return LoadedStudy(Path("none"), Study.model_validate(content), stage, (), "benchmark")


def watched(stage: Stage, loaded: LoadedStudy) -> tuple[dict[str, float], Array]:
    """Seconds by part and the outputs of one design."""
    clock = Clock()
    timed = [(sectors, "mesh_sectors", "mesh"), (cyclic, "condense", "factor"), (response, "factorise", "factor")]
    timed += [(module, "tied_lower", "assembly") for module in (cyclic, response)]
    kept = [getattr(module, name) for module, name, _ in timed]
    for module, name, part in timed:
        setattr(module, name, clock.watching(part, getattr(module, name)))
    try:
        clock.watching("check", check_feasible)(stage)
        values = clock.watching("solve", solved_values)(stage, loaded, True)
    finally:
        for (module, name, _), was in zip(timed, kept, strict=True):
            setattr(module, name, was)
    s = clock.seconds
    parts = {
        "feasibility": s["check"],
        "mesh": s["mesh"],
        "assembly": s["assembly"],
        "factor": s["factor"],
        "rest": s["solve"] - s["mesh"] - s["assembly"] - s["factor"],
        "all": s["check"] + s["solve"],
    }
    return parts, values


def error(stage: Stage, values: Array) -> float:
    """Per cent by which stiffnesses in x, y, theta are off the extrapolated ones, the largest."""
    solved = np.array([np.diag(np.linalg.inv(solve_stage(stage, n).response.compliance)) for n in LEVELS])
    limits = [grid_convergence(np.array(LEVELS), solved[:, k], 0.0).extrapolated for k in range(3)]
    return float(np.max(np.abs(100 * (values[:3] / np.array(limits) - 1))))


def measure(alike: bool, arguments: argparse.Namespace) -> None:
    rng, loaded, runs, errors = np.random.default_rng(SEED), study(arguments.resolution), [], []
    watched(feasible(rng, alike), loaded)  # imports
    for count in range(arguments.designs):
        stage = feasible(rng, alike)
        parts, values = watched(stage.model_copy(), loaded)  # of which nothing is remembered yet
        runs.append(parts)
        if count < arguments.extrapolated:
            errors.append(error(stage, values))
    print(f"\nchains {'alike' if alike else 'different'}, {len(runs)} designs at resolution {arguments.resolution}")
    for name in runs[0]:
        seconds = np.array([run[name] for run in runs])
        print(f"{name:12} median {np.median(seconds):7.4f} s, 95 % below {np.quantile(seconds, 0.95):7.4f} s")
    if errors:
        print(f"stiffness    off by {np.median(errors):.3f} % median, {np.max(errors):.3f} % worst of {len(errors)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=500)
    parser.add_argument("--extrapolated", type=int, default=10)
    parser.add_argument("--resolution", type=int, default=4)
    arguments = parser.parse_args()
    if not ONE_THREAD.items() <= os.environ.items():  # too late for libraries that are loaded
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_THREAD})
    for alike in (True, False):
        measure(alike, arguments)


if __name__ == "__main__":
    main()
