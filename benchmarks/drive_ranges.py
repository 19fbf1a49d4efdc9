"""Axis ranges of the drive over many analytic designs: processor time a design, with the drive
asked about and without.

One process, rigid links, calibrated hinges; eight factors on mobility six: arms, preloads, necks,
radii and lengths.

    python benchmarks/drive_ranges.py --designs 100000
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from flexfem.study.answer import answer
from flexfem.study.loaded import load_study

STAGE = Path(__file__).parents[1] / "geometry" / "mobility6.toml"
HEAD = """name = "drive ranges"
stage = "{stage}"
model = "analytic"
formula = "calibrated"
mobility = 21
[sampling]
method = "monte_carlo"
designs = {designs}
seed = 1
"""
PASSIVE = {
    "hinges.base.radius_mm": (2.5, 3.9),
    "hinges.elbow.neck_mm": (0.35, 0.7),
    "override.2.platform.neck_mm": (0.35, 0.7),
    "chain.link_lengths_mm[0]": (28.0, 33.0),
}
DRIVEN = PASSIVE | {
    "actuator.base.arm_mm": (5.0, 20.0),
    "actuator.elbow.arm_mm": (5.0, 18.0),
    "actuator.base.preload_n": (5.0, 80.0),
    "override.2.actuator.elbow.preload_n": (5.0, 80.0),
}


def seconds(
    designs: int, factors: dict[str, tuple[float, float]], tail: str
) -> tuple[float, float]:
    """Processor time of all designs, and the share of them that has an answer."""
    body = "".join(
        f'[[factor]]\nkey = "{key}"\nfrom = {low}\nto = {high}\n'
        for key, (low, high) in factors.items()
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(HEAD.format(stage=STAGE, designs=designs) + body + tail)
        loaded = load_study(path)
        begun = time.process_time()
        rows = answer(loaded, 0, designs)
        return time.process_time() - begun, float(np.mean(rows.status == "ok"))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=100_000)
    designs = parser.parse_args().designs
    passive = seconds(designs, PASSIVE, "")
    driven = seconds(designs, DRIVEN, "[drive]\nactuators = true\n")
    for name, (cost, share) in (("without the drive", passive), ("with it", driven)):
        print(
            f"{name:18} {cost:8.1f} s {1e6 * cost / designs:8.1f} us a design, {100 * share:.0f} "
            "% answered"
        )
    print(f"ratio {driven[0] / passive[0]:.0f}")


if __name__ == "__main__":
    main()
