"""The highest neck stress of the analytic model against finite elements of whole stages in three
dimensions.

    python benchmarks/solid_stress.py [--stages 8] [--seed 4111]

The reference stages and random ones of other thicknesses and Poisson's ratios, elastic links; per
cent above the finite elements per displacement in x, y and theta, of `model = "corrected"` with
every hinge formula in its range, and of plane stress and plane strain with calibrated hinges. The
finite elements are those of resolution 4 and 3 layers, moved by what resolution 8 changes with one
layer, and 6 layers at resolution 2."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from random_stages import dimensions

from flexfem.arrays import Array
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import analyse
from flexfem.paper.solutions import solve_solid
from flexfem.paper.stage import Stage, load_stage
from flexfem.refused import BadInput

GEOMETRY = Path(__file__).parent.parent / "geometry"


def stages(count: int, seed: int) -> Iterator[Stage]:
    """The reference stages, and so many random ones on the thickness chart."""
    for mobility in (3, 6):
        yield load_stage(GEOMETRY / f"mobility{mobility}.toml").replace(model="corrected")
    rng = np.random.default_rng(seed)
    while count:
        drawn = dimensions(rng) | {
            "model": "corrected",
            "thickness_mm": float(np.exp(rng.uniform(*np.log([1, 25])))),
        }
        drawn["material"]["poissons_ratio"] = float(rng.uniform(0.12, 0.44))
        stage = Stage.model_validate(drawn)
        try:
            check_feasible(stage)
            analyse(stage, None, "calibrated", True)
        except BadInput:
            continue
        count -= 1
        yield stage


def in_three_dimensions(stage: Stage) -> Array:
    """Highest stress (3,) of the nine necks, MPa per mm and rad, at vanishing triangles and layers."""

    def highest(resolution: int, layers: int) -> Array:
        response = solve_solid(stage, resolution, layers)
        found = neck_stresses(stage, response, np.linalg.inv(response.compliance))
        return np.asarray(found.highest.max(axis=(1, 2)))

    return highest(4, 3) * highest(8, 1) / highest(4, 1) * highest(2, 6) / highest(2, 3)


def described(stage: Stage) -> str:
    """What the factors depend on: over all necks."""
    neck = stage.array("neck")
    radius = stage.array("radius")
    ratio = neck / radius
    width = stage.thickness / neck
    return (
        f"t/R {ratio.min():.2f}..{ratio.max():.2f}, b/t {width.min():.1f}..{width.max():.1f}, "
        f"nu {stage.material.poissons_ratio:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=8)
    parser.add_argument("--seed", type=int, default=4111)
    arguments = parser.parse_args()
    found = defaultdict(list)
    for stage in stages(arguments.stages, arguments.seed):
        solid = in_three_dimensions(stage)
        sizes = stage.array("radius"), stage.array("neck"), stage.chain.link_width
        used = [
            ("corrected", name)
            for name, entry in FORMULAS.items()
            if np.all(entry.in_range(*sizes))
        ]
        for model, formula in [
            *used,
            ("plane_stress", "calibrated"),
            ("plane_strain", "calibrated"),
        ]:
            stress = analyse(stage.replace(model=model), None, formula, True).stress.max(
                axis=(0, 1)
            )
            found[model, formula].append(100 * (stress / solid - 1))
        x, y, theta = found["corrected", "calibrated"][-1]
        print(f"{described(stage)}: corrected {x:+.2f} {y:+.2f} {theta:+.2f} %", flush=True)
    for (model, formula), percents in found.items():
        print(
            f"{model}, {formula}: {np.min(percents):+.1f} to {np.max(percents):+.1f} % on "
            f"{len(percents)} stages"
        )


if __name__ == "__main__":
    main()
