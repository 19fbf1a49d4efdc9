"""Six natural frequencies of random stages whose chains are unlike: do the bands by mesh hold the
truth, and how far off are the analytic models?

    python benchmarks/frequencies.py [--stages 10] [--seeds 2003 2004 2005 2006] [--keep FILE.npz]

The truth is extrapolated from two much finer meshes, by order four: above the third mode, where the
order falls with the mesh, that says too little. What the model with rigid links leaves out is their
bending; the one with elastic links, that inertia acts along a link as a whole, and the rotary
inertia within it. `--keep` stores what was solved, which `tests/questions/test_modes.py` counts
again without solving."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from random_stages import unlike

from flexfem.arrays import Array
from flexfem.fem.modes import modes
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import Payload
from flexfem.paper.model import analyse
from flexfem.paper.responses import dynamics
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh
from flexfem.paper.vibration import frequency_convergence, vibrating
from flexfem.questions.bands import ORDER
from flexfem.refused import BadInput, ComputationFailed

RESOLUTIONS = (4, 6, 8)  # of the default mesh
FINE = (11, 16)
COUNT = 6
BY_MODEL = 3  # modes; those in which the platform moves as a whole
MODELS = {
    "default formula, own mobility": (None, "paros-weisbord", False),
    "calibrated": (21, "calibrated", False),
}
MODELS |= {"calibrated, elastic links": (21, "calibrated", True)}


class Solved(NamedTuple):
    """Frequencies, rad/s: `elements` (n, levels, 6) on `RESOLUTIONS` and `FINE`, `analytic` (n,
    models, 6).

    stages : what their files would hold, as JSON.
    """

    elements: Array
    analytic: Array
    stages: list[str]


def solved_stages(seeds: list[int], number: int) -> Solved:
    """So many stages of each seed."""
    elements, analytic, stages = zip(
        *(row for seed in seeds for row in _drawn(np.random.default_rng(seed), number)), strict=True
    )
    return Solved(np.array(elements), np.array(analytic), list(stages))


def _drawn(rng: np.random.Generator, number: int) -> list[tuple[Array, Array, str]]:
    found: list[tuple[Array, Array, str]] = []
    while len(found) < number:
        drawn = unlike(rng)
        try:
            stage = Stage.model_validate(drawn)
            check_feasible(stage)
            models = [
                dynamics(stage, analyse(stage, *how), Payload()).frequencies[:COUNT]
                for how in MODELS.values()
            ]
            metal = [element_values(stage, level) for level in RESOLUTIONS + FINE]
        except (BadInput, ComputationFailed, ValueError):
            continue
        found.append((np.array(metal), np.array(models), json.dumps(drawn)))
        print(f"{len(found)} of {number}", flush=True)
    return found


def element_values(stage: Stage, resolution: int) -> Array:
    """Frequencies (6,), rad/s."""
    return modes(vibrating(stage, build_mesh(stage, resolution), Payload()), COUNT).frequencies


def truth(elements: Array) -> Array:
    """Frequencies (..., 6) extrapolated from the finest two meshes of (..., levels, 6)."""
    growth = (FINE[1] / FINE[0]) ** ORDER
    return np.asarray(
        elements[..., -1, :] + (elements[..., -1, :] - elements[..., -2, :]) / (growth - 1)
    )


def ratios(elements: Array) -> Array:
    """Band over actual error (6,) of the frequencies (levels, 6) of one stage on its default mesh."""
    count = len(RESOLUTIONS)
    bands = [
        frequency_convergence(np.array(RESOLUTIONS[:count], dtype=float), values[:count]).band
        for values in elements.T
    ]
    return np.asarray(bands / np.abs(elements[count - 1] - truth(elements)))


def off(of: Solved) -> Array:
    """Per cent (models, n, 6) by which the analytic frequencies are off the true ones; inf without
    such a freedom.
    """
    return np.asarray(100 * (np.moveaxis(of.analytic, 1, 0) / truth(of.elements) - 1))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=10)
    parser.add_argument("--seeds", type=int, nargs="+", default=[2003, 2004, 2005, 2006])
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    found = solved_stages(arguments.seeds, arguments.stages)
    if arguments.keep:
        np.savez_compressed(arguments.keep, **found._asdict())
    report(found)


def report(of: Solved) -> None:
    """Print coverage, and what the models are off by."""
    ratio = np.array([ratios(each) for each in of.elements])
    band = 100 * np.abs(of.elements[:, len(RESOLUTIONS) - 1] / truth(of.elements) - 1)
    print(
        f"{np.sum(ratio >= 1)} of {ratio.size} bands hold the truth, by mode "
        f"{np.sum(ratio >= 1, axis=0)}"
    )
    print(
        f"median band over error {np.median(ratio):.1f}; error of the default mesh up to "
        f"{band.max():.2g} %"
    )
    print("analytic frequencies off by, %: modes, median, 90 %, smallest and largest")
    for name, values in zip(MODELS, off(of), strict=True):
        for what, some in (("1 to 3", values[:, :BY_MODEL]), ("4 to 6", values[:, BY_MODEL:])):
            known = some[np.isfinite(some)]
            size = np.abs(known) if known.size else np.full(1, np.nan)
            ends = f"{known.min():9.3f} {known.max():9.3f}" if known.size else "        -         -"
            print(
                f"{name:32} {what}  {np.median(size):8.3f} {np.quantile(size, 0.9):8.3f} {ends}  "
                f"of {known.size}"
            )


if __name__ == "__main__":
    main()
