"""Calibrated hinges with elastic links and platform against extrapolated finite elements, on random
feasible stages.

    python benchmarks/random_stages.py [--stages 40] [--seed 2003]

All dimensions are drawn, notches differ by position, and what cannot be made or is off the hinge
chart is drawn again."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.model import analyse
from flexfem.paper.solutions import solved as solve_stage
from flexfem.paper.stage import HINGE_NAMES, Stage
from flexfem.questions.bands import grid_convergence
from flexfem.refused import BadInput

RESOLUTIONS = (4, 6, 8)


def draw(rng: np.random.Generator) -> Stage:
    """A stage with all dimensions drawn, its chains alike."""
    return Stage.model_validate(dimensions(rng))


def unlike(rng: np.random.Generator) -> dict[str, Any]:
    """As `dimensions`, with nine notches that scatter: by 0.5 to 30 % from stage to stage, evenly
    in its logarithm.
    """
    return scattered(dimensions(rng), rng)


def scattered(drawn: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Dimensions with nine notches that scatter, as of `unlike`."""
    scatter = 10 ** rng.uniform(np.log10(0.005), np.log10(0.3))
    notches = []
    for chain in (1, 2, 3):
        for name in HINGE_NAMES:
            factors = np.exp(scatter * rng.uniform(-1, 1, 2))
            sizes = zip(("radius_mm", "neck_mm"), factors, strict=True)
            notch = {key: drawn["hinges"][name][key] * float(factor) for key, factor in sizes}
            notches.append({"chain": chain, "hinge": name, **notch})
    return {**drawn, "override": notches}


def dimensions(rng: np.random.Generator) -> dict[str, Any]:
    """What a stage file would hold."""

    def number(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    width = number(7, 12)

    def hinge() -> dict[str, float]:
        radius = number(0.9, min(4.5, 0.45 * width))
        return {
            "radius_mm": radius,
            "neck_mm": min(number(0.06, 0.6) * radius, width - 2 * radius - 1e-3),
        }

    sheet = {
        "name": "random",
        "thickness_mm": number(4, 20),
        "material": {
            "name": "random",
            "youngs_modulus_gpa": number(60, 210),
            "poissons_ratio": number(0.22, 0.38),
            "density_kg_m3": 2700.0,
            "yield_strength_mpa": 400.0,
        },
    }
    chain = {
        "link_lengths_mm": [number(22, 45), number(24, 45), number(18, 34)],
        "joint_angles_deg": [180 + number(-25, 25), -90 + number(-25, 25), 90 + number(-25, 25)],
        "link_width_mm": width,
    }
    hinges = {name: hinge() for name in ("base", "elbow", "platform")}
    platform = {"radius_mm": number(11, 24), "hub_radius_mm": number(4, 10)}
    return {**sheet, "chain": chain, "hinges": hinges, "platform": platform}


def drawn(count: int, seed: int) -> Iterator[Stage]:
    """So many stages that can be made and are on the hinge chart, one after the other."""
    rng = np.random.default_rng(seed)
    found = 0
    while found < count:
        stage = draw(rng)
        try:
            check_feasible(stage)
            analyse(stage, 21, "calibrated", links=True)
        except BadInput:
            continue
        found += 1
        yield stage


def deviation(stage: Stage) -> Array:
    """Per cent (3,) by which the analytic compliance is off the extrapolated one, in x, y, theta."""
    analytic = np.diag(analyse(stage, 21, "calibrated", links=True).compliance)
    solved = np.array([np.diag(solve_stage(stage, n).compliance) for n in RESOLUTIONS])
    limits = [
        grid_convergence(np.array(RESOLUTIONS), solved[:, k], 0.0).extrapolated for k in range(3)
    ]
    return 100 * (analytic / np.array(limits) - 1)


def described(stage: Stage) -> str:
    """The geometry of a stage in one line."""
    chain = stage.chain
    platform = stage.platform
    lengths = ", ".join(f"{length:.1f}" for length in chain.link_lengths)
    angles = ", ".join(f"{angle:.0f}" for angle in np.rad2deg(chain.joint_angles))
    hinges = [(name, stage.hinge(1, name)) for name in HINGE_NAMES]
    notches = ", ".join(
        f"{name} R {hinge.radius:.2f} t {hinge.neck:.2f} H/h "
        f"{chain.link_width / (2 * hinge.radius + hinge.neck):.2f}"
        for name, hinge in hinges
    )
    return (
        f"links {lengths} mm, {chain.link_width:.1f} mm wide, {stage.thickness:.1f} mm thick; "
        f"angles {angles} deg; {notches}; disc {platform.radius:.1f} mm, hub "
        f"{platform.hub_radius:.1f} mm"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=40)
    parser.add_argument("--seed", type=int, default=2003)
    arguments = parser.parse_args()
    stages = []
    found = []
    for stage in drawn(arguments.stages, arguments.seed):
        stages.append(stage)
        found.append(deviation(stage))
        print(f"{len(found):3}  {found[-1].round(3)}", flush=True)
    off = np.abs(found)
    print("median", np.median(off, axis=0).round(3), "% in x, y, theta")
    print("worst ", np.max(off, axis=0).round(3), "% in x, y, theta")
    worst = int(np.argmax(np.max(off, axis=1)))
    print(f"worst stage: {worst + 1}, {described(stages[worst])}")


if __name__ == "__main__":
    main()
