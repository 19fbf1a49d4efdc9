"""Do the numbers that a person reads hold in the part: stiffness, first natural frequency and range
of mechanisms.

    pip install ngsolve
    python benchmarks/numbers_in_the_part.py [--mechanisms 30] [--seed 37] [--order 3] [--fine 10]

Mechanisms are drawn at random, as in random_mechanisms.py and ngsolve_mechanisms.py: rings, legs,
guides, and guides with leaves on both sides, with hinges of all shapes, 2 to 8 of them, and 0.5 to
40 times as thick as their thinnest neck. A number counts as held if its band contains the
reference:

- stiffness of the output, other directions free, and the first natural frequency of all, in or out
  of the plane, by NGSolve on the extruded drawing with curved elements of the stated order;
- range of the output, driven in one direction with the others free, by nonlinear finite elements on
  a finer mesh, in plane stress, until a hinge or a body reaches the yield strength. A range that
  ends otherwise is named, and does not count.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import ngsolve as ng
import numpy as np
from ngsolve_mechanisms import (
    CURVED,
    SLENDERNESS,
    Drawn,
    Fields,
    Shape,
    double_guide,
    first_frequency,
    heights,
    values_of_ports,
)
from random_mechanisms import Random, guide, legs, ring

import flexfem
from flexfem.arrays import Array
from flexfem.fem.nonlinear import driven, stress_in_parts
from flexfem.questions.plates import model_of
from flexfem.results import SOLID
from flexfem.units import DIRECTIONS

FAMILIES = (ring, legs, guide, double_guide)
LARGEST = 650_000  # unknowns in three dimensions
STROKE = 10.0  # mm, of actuators that do not end a range
MODES = 4  # of a plate solved in three dimensions, whose first modes may all be out of the plane
FROM_THE_LIMIT = (
    0.02  # of a displacement: the second equilibrium from which the place of the limit follows
)


class Number(NamedTuple):
    """A printed number with its band, and the reference."""

    quantity: str
    text: str
    value: float
    band: float
    reference: float

    @property
    def ratio(self) -> float:
        """Difference from the reference over the band."""
        return abs(self.value - self.reference) / self.band


class Lifted(Fields):
    """Displacements of half of a plate that is antisymmetric about its mid-plane, which moves along
    z alone.
    """

    def __init__(self, layout: flexfem.mechanism.layout.Layout, drawn: Drawn, order: int) -> None:
        super().__init__(layout, drawn, order)
        self.space = ng.VectorH1(
            self.mesh,
            order=order,
            dirichletx="ground|middle",
            dirichlety="ground|middle",
            dirichletz="ground",
        )

    def inertia(self, mass: float, moment: float) -> tuple[float, float, float]:
        """Mass and moments of inertia of a flat body."""
        return mass, moment / 2, moment / 2

    def _basis(self, patch: flexfem.mechanism.layout.Patch) -> tuple[Shape, list[Shape], Array]:
        """Motion along z, and tilts about x and y, of a contact."""
        region = self.mesh.Materials(self.parts[patch])
        x = ng.x - patch.point.real
        y = ng.y - patch.point.imag
        rigid = [ng.CF((0, 0, 1)), ng.CF((0, 0, y)), ng.CF((0, 0, -x))]
        M = [
            [ng.Integrate(a * b, self.mesh, definedon=region, order=8) for a in rigid]
            for b in rigid
        ]
        return region, rigid, np.linalg.inv(np.array(M))


def shapes_named(mechanism: flexfem.Mechanism) -> flexfem.Mechanism:
    """The mechanism with the other name of leaves with fillets, for every second one."""
    names = {
        hinge.name: {"shape": "filleted"} for hinge in mechanism.hinge[::2] if hinge.shape == "leaf"
    }
    return mechanism.replace(hinge=names) if names else mechanism


def drawn_at_random(rng: Random, count: int) -> Iterator[flexfem.Mechanism]:
    for k in range(count):
        family = FAMILIES[k % 4]
        drawn = shapes_named(family(rng, f"{family.__name__} {k + 1}"))
        neck = min(joint.profile.neck for joint in drawn.layout.joints)
        slenderness = float(np.exp(rng.uniform(*np.log(SLENDERNESS))))
        name = f"{drawn.name}, b/t {slenderness:.2g},"
        yield drawn.replace(name=name, model="three_dimensional", thickness=slenderness * neck)


def solved(mechanism: flexfem.Mechanism, order: int) -> dict[str, Array]:
    """Stiffness with the others free (3,), and the first natural frequency, Hz, in and out of the
    plane.
    """
    layout = mechanism.layout
    drawn = Drawn(layout, min(order, CURVED), heights(layout))
    E = layout.youngs_modulus
    nu = layout.poissons_ratio
    frequencies = list[float]()
    stiff = np.zeros(3)
    for kind in (Fields, Lifted):
        fields = kind(layout, drawn, order)
        if fields.space.ndof > LARGEST:
            raise MemoryError(f"more than {LARGEST} unknowns: {fields.space.ndof}")
        _, inverse = fields.factorised(E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu))
        if kind is Fields:
            stiff = values_of_ports(layout, fields.compliance(inverse) / 2)["free"]
        frequencies.append(float(first_frequency(fields, inverse)[0]))
    return {"free": stiff, "frequency": np.array(frequencies)}


def in_three_dimensions(mechanism: flexfem.Mechanism, order: int) -> list[Number]:
    """Stiffness and first natural frequency by one default command each, and by NGSolve."""
    wanted = solved(mechanism, order)
    stiff = flexfem.stiffness(mechanism, models="elements")
    found = list[Number]()
    for axis, direction in enumerate(DIRECTIONS):
        at = {"model": SOLID, "direction": direction}
        value = float(stiff.at("free", **at))
        band = float(stiff.band("free", **at))
        found.append(Number("stiffness", direction, value, band, float(wanted["free"][axis])))
    vibrating = flexfem.modes(mechanism, models="elements", count=MODES)
    (place, *_) = [k for k, name in enumerate(vibrating.axes["mode"]) if "out of" not in name]
    first, width = (
        float(of("frequency", model=SOLID)[place]) for of in (vibrating.at, vibrating.band)
    )
    lifted = vibrating.values.get("first_out_of_plane")
    out = np.inf
    out_width = 0.0
    if lifted is not None:
        out = float(lifted)
        out_width = float(vibrating.bands["first_out_of_plane"])
    found.append(Number("in-plane frequency", "", first, width, float(wanted["frequency"][0])))
    if np.isfinite(out):
        found.append(
            Number("out-of-plane frequency", "", out, out_width, float(wanted["frequency"][1]))
        )
    low, low_width = (first, width) if first < out else (out, out_width)
    found.append(Number("first frequency", "", low, low_width, float(np.min(wanted["frequency"]))))
    return found


def limits_of(notes: Sequence[str]) -> dict[str, str]:
    """Limits by "+x (free)" and the like, from the sentences of an answer."""
    found = dict[str, str]()
    for text in notes:
        if text.startswith("range along "):
            places, _, limit = text.removeprefix("range along ").partition(": ")
            found |= dict.fromkeys(places.split(", "), limit)
    return found


def of_ranges(mechanism: flexfem.Mechanism, fine: int) -> list[Number]:
    """Ranges in plane stress, others free, and those by nonlinear finite elements on a finer mesh."""
    endless = {actuator.name: {"stroke": STROKE} for actuator in mechanism.actuator}
    plane = mechanism.replace(model="plane_stress", **({"actuator": endless} if endless else {}))
    answer = flexfem.stiffness(plane, models="elements")
    limits = limits_of(answer.notes)
    model = model_of(plane, fine)
    strength = plane.layout.yield_strength
    found = list[Number]()
    for axis, direction in enumerate(DIRECTIONS):
        at = {"others": "free", "sense": "positive", "direction": direction}
        x = float(answer.internal.values["range"][1, 0, axis])
        band = float(answer.internal.bands["range"][1, 0, axis])
        limit = limits.get(f"+{direction} (free)", "none")
        if not (limit.startswith("yield of") and band > 0):
            print(
                f"    range {direction}: {answer.at('range', **at)} ± "
                f"{answer.band('range', **at)}, {limit}",
                flush=True,
            )
            continue
        places = np.array([x * (1 - FROM_THE_LIMIT), x])
        fields = driven(model, [axis], places[:, None]).fields
        stress = np.array(
            [np.max(np.concatenate(stress_in_parts(model, field))) for field in fields]
        )
        exponent = np.log(stress[1] / stress[0]) / np.log(places[1] / places[0])
        found.append(
            Number(
                "range", direction, x, band, x * float(strength / stress[1]) ** float(1 / exponent)
            )
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=30)
    parser.add_argument("--seed", type=int, default=37)
    parser.add_argument("--order", type=int, default=3)
    parser.add_argument("--fine", type=int, default=10)
    parser.add_argument("--only", choices=("solid", "ranges"))
    parser.add_argument(
        "--numbers",
        type=int,
        nargs="+",
        help="of the mechanisms to compare, from 1; by default all",
    )
    arguments = parser.parse_args()
    found = defaultdict[str, list[tuple[float, float, str]]](list)
    drawn = drawn_at_random(np.random.default_rng(arguments.seed), arguments.mechanisms)
    for number, mechanism in enumerate(drawn, start=1):
        if arguments.numbers and number not in arguments.numbers:
            continue
        shapes = ", ".join(sorted({hinge.shape for hinge in mechanism.hinge}))
        start = time.perf_counter()
        numbers = list[Number]()
        if arguments.only != "ranges":
            try:
                numbers += in_three_dimensions(mechanism, arguments.order)
            except Exception as error:
                print(
                    f"    {mechanism.name} not compared in three dimensions: {error!r:.300}",
                    flush=True,
                )
        if arguments.only != "solid":
            try:
                numbers += of_ranges(mechanism, arguments.fine)
            except Exception as error:
                print(f"    {mechanism.name} ranges not compared: {error!r:.300}", flush=True)
        print(f"{mechanism.name} {shapes}: {time.perf_counter() - start:.0f} s", flush=True)
        for one in numbers:
            value = f"{one.value:.6g} ± {one.band:.2g}, {one.reference:.6g}"
            text = f"{mechanism.name} {one.quantity} {one.text}: {value}"
            found[one.quantity].append((one.ratio, one.band / abs(one.value), text))
            if one.ratio > 1:
                print(f"    outside, {one.ratio:.2f}: {text}", flush=True)
    for name, ratios in found.items():
        outside = [text for ratio, _, text in ratios if ratio > 1]
        width = 100 * np.median([width for _, width, _ in ratios])
        worst, _, where = max(ratios)
        print(
            f"{name}: {len(ratios) - len(outside)} of {len(ratios)} held, median band {width:.2g} "
            f"%, largest error / band {worst:.2f}: {where}"
        )


if __name__ == "__main__":
    main()
