"""How often the bands of random mechanisms contain the values of finite elements on a much finer
mesh.

    python benchmarks/mechanism_bands.py [--mechanisms 24] [--seed 7] [--fine 20]

Mechanisms as in random_mechanisms.py. Numbers without a band, or below round-off, do not count.
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from random_mechanisms import guide, legs, ring

import flexfem
from flexfem.results import ELEMENTS

QUESTIONS = ("stiffness", "drive", "modes", "drift", "gravity")


def numbers(mechanism: flexfem.Mechanism, resolution: int | None) -> dict[str, tuple[float, float]]:
    """Values of finite elements by path, and their bands."""
    answers = {name: getattr(flexfem, name)(mechanism, resolution=resolution) for name in QUESTIONS}
    entries = (
        (f"{name}.{entry.path}", entry)
        for name, found in answers.items()
        for entry in found.entries()
    )
    return {
        path: (entry.value, entry.band)
        for path, entry in entries
        if ELEMENTS.replace(" ", "_") in path.split(".")
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=24)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--fine", type=int, default=20)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    found = defaultdict[str, list[tuple[float, str]]](list)
    for number in range(arguments.mechanisms):
        family = (ring, legs, guide)[int(rng.integers(3))]
        mechanism = family(rng, f"{family.__name__} {number + 1}")
        fine = numbers(mechanism, arguments.fine)
        for path, (value, band) in numbers(mechanism, None).items():
            if band > 0 and value:
                question, quantity, *_ = path.split(".")
                text = (
                    f"{mechanism.name}, {path}: {value:.6g} ± {band:.2g}, fine {fine[path][0]:.6g}"
                )
                found[f"{question} {quantity}"].append((abs(value - fine[path][0]) / band, text))
        print(mechanism.name, flush=True)
    for quantity, ratios in sorted(found.items()):
        inside = np.mean([ratio <= 1 for ratio, _ in ratios])
        worst, text = max(ratios)
        print(
            f"{quantity:28} {len(ratios):5} bands, {100 * inside:5.1f} % contain it; worst "
            f"{worst:.2f}: {text}"
        )


if __name__ == "__main__":
    main()
