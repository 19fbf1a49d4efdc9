"""Platform stiffness of many designs at once against a plain loop over designs, with the calibrated
hinges.

    python benchmarks/designs.py [--designs 100000] [--looped 300]

Both do the same: hinge compliances, frames, chains in series, chains in parallel. The loop is timed
on fewer designs and scaled; the two must agree."""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from flexfem.analytic.network import stiffness as at_output
from flexfem.hinges.formulas import FORMULAS
from flexfem.paper.equations import freedoms_of
from flexfem.paper.frames import frames
from flexfem.paper.model import network_of


def draw(count: int) -> dict[str, Any]:
    rng = np.random.default_rng(2003)
    radius = rng.uniform(1.0, 4.0, (count, 3, 3))
    neck = rng.uniform(0.05, 0.3, (count, 3, 3)) * radius
    return {
        "lengths": rng.uniform([25, 25, 20], [40, 40, 30], (count, 3)),
        "angles": np.deg2rad([180.0, -90.0, 90.0]) + rng.uniform(-0.2, 0.2, (count, 3)),
        "radius": radius,
        "neck": neck,
        "width": np.max(2 * radius + neck, axis=(1, 2)) * 1.05,
        "youngs_modulus": rng.uniform(7e4, 2.1e5, count),
        "thickness": rng.uniform(5, 20, count),
    }


def stiffness(d: dict[str, Any]) -> Any:
    spread = (..., None, None)
    hinges = FORMULAS["calibrated"].compliance(
        d["radius"],
        d["neck"],
        d["thickness"][spread],
        d["youngs_modulus"][spread],
        0.33,
        block_height=d["width"][spread],
    )
    return at_output(network_of(frames(d["lengths"], d["angles"]), hinges, freedoms_of(21))).matrix


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--designs", type=int, default=100_000)
    parser.add_argument("--looped", type=int, default=300)
    arguments = parser.parse_args()
    designs = draw(arguments.designs)
    stiffness(draw(10))
    started = time.perf_counter()
    together = np.concatenate(
        [
            stiffness({k: v[i : i + 10_000] for k, v in designs.items()})
            for i in range(0, arguments.designs, 10_000)
        ]
    )
    batch = time.perf_counter() - started
    started = time.perf_counter()
    single = np.array(
        [stiffness({k: v[i] for k, v in designs.items()}) for i in range(arguments.looped)]
    )
    loop = (time.perf_counter() - started) / arguments.looped * arguments.designs
    on_chart = np.isfinite(together[: arguments.looped, 0, 0])
    np.testing.assert_allclose(together[: arguments.looped][on_chart], single[on_chart], rtol=1e-9)
    print(
        f"{arguments.designs} designs: {batch:.2f} s together, {loop:.0f} s one by one, ratio "
        f"{loop / batch:.0f}"
    )
    on_chart = np.isfinite(together[:, 0, 0])
    print(
        f"{1e6 * batch / arguments.designs:.1f} us a design; {100 * np.mean(on_chart):.1f} % of "
        "them on the chart"
    )


if __name__ == "__main__":
    main()
