"""Mechanisms in three dimensions by their hinges, the default, against whole plates in three
dimensions.

    python benchmarks/thickness.py [--mechanisms 12] [--seed 5] [--thickness-resolution 4]

Mechanisms as in random_mechanisms.py, with a thickness of 0.5 to 60 times the thinnest neck. A band
contains the value of the whole plate if they differ by less than both bands. Numbers below
round-off do not count."""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from random_mechanisms import guide, legs, ring

import flexfem
from flexfem.refused import ComputationFailed
from flexfem.results import SOLID

COMPARED = {
    "stiffness": ("free", "compliance", "stiffness", "stress", "yield_range", "amplification"),
    "modes": ("frequency",),
    "gravity": ("pose",),
}
LEAST = 1e-6  # of the largest value of a quantity: smaller values are not compared


def numbers(mechanism: flexfem.Mechanism, layers: int | None) -> dict[str, tuple[float, float]]:
    """Values in three dimensions by path, and their bands."""
    found = dict[str, tuple[float, float]]()
    for question, quantities in COMPARED.items():
        options = {"count": 3} if question == "modes" else {}
        if layers is not None:
            options |= {"solid": True, "thickness_resolution": layers}
        answer = getattr(flexfem, question)(mechanism, models="elements", **options)
        for entry in answer.entries():
            quantity, *labels = entry.path.split(".")
            if quantity in quantities and SOLID.replace(" ", "_") in labels:
                found[f"{question}.{entry.path}"] = (entry.value, entry.band)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=12)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--thickness-resolution", type=int, default=4)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    ratios = defaultdict[str, list[tuple[float, float, str]]](list)
    for number in range(arguments.mechanisms):
        family = (ring, legs, guide)[number % 3]
        drawn = family(rng, f"{family.__name__} {number + 1}")
        neck = min(joint.profile.neck for joint in drawn.layout.joints)
        slenderness = float(np.exp(rng.uniform(np.log(0.5), np.log(60))))
        mechanism = drawn.replace(model="three_dimensional", thickness=slenderness * neck)
        try:
            whole = numbers(mechanism, arguments.thickness_resolution)
            by_hinges = numbers(mechanism, None)
        except ComputationFailed as failure:
            print(f"{mechanism.name}: {failure}", flush=True)
            continue
        largest = defaultdict[str, float](float)
        for path, (value, _) in whole.items():
            quantity = path.split(".")[1]
            largest[quantity] = max(largest[quantity], abs(value))
        for path, (value, band) in by_hinges.items():
            quantity = path.split(".")[1]
            if path not in whole or not abs(value) > LEAST * largest[quantity] or not band > 0:
                continue
            right, its_band = whole[path]
            text = (
                f"{mechanism.name}, b/t {slenderness:.3g}, {path}: {value:.6g} ± {band:.2g}, "
                f"whole {right:.6g}"
            )
            ratio = abs(value - right) / (band + np.nan_to_num(its_band))
            ratios[quantity].append((ratio, band / abs(value), text))
        print(f"{mechanism.name}, b/t {slenderness:.3g}", flush=True)
    for quantity, each in sorted(ratios.items()):
        inside = np.mean([ratio <= 1 for ratio, _, _ in each])
        width = 100 * np.median([relative for _, relative, _ in each])
        worst, _, text = max(each)
        print(
            f"{quantity:14} {len(each):5} values, band {width:.2g} % (median), "
            f"{100 * inside:5.1f} % inside; worst {worst:.2f}: {text}"
        )


if __name__ == "__main__":
    main()
