"""Analytic network, with rigid and with elastic bodies, against plane finite elements on random
mechanisms.

Rings of bars, legs copied by rotation, and guides copied by a mirror image, with hinges of all
shapes and one actuator or more. The largest difference counts, per cent of the largest component,
for compliances of the root of both along.

    python benchmarks/random_mechanisms.py --mechanisms 50 --seed 1
"""

from __future__ import annotations

import argparse
import cmath
import time
import traceback
from typing import Any

import numpy as np

import flexfem
from flexfem.analytic import plates
from flexfem.arrays import Array
from flexfem.fem import ports
from flexfem.mechanism.profiles import profile_of
from flexfem.questions.plates import ElasticParts, elements, model_of, network, parts_of
from flexfem.questions.stiffness import values_of_ports

RESOLUTION = 6
LARGE = 10.0
MODELS = ("analytic", "elastic bodies")  # of elements; per cent of the latter that is named
QUANTITIES = (
    "output compliance",
    "input compliance",
    "drive to output",
    "stress",
    "weight",
    "heat",
    "first frequency",
)
Part = dict[str, Any]
Random = np.random.Generator


def hinge(rng: Random, width: float) -> tuple[Part, float]:
    """A random profile that is at most as high as a bar of this width, and its length."""
    neck = rng.uniform(0.06, 0.12) * width
    shape = rng.choice(["circular", "elliptical", "leaf", "parabolic", "v", ""])
    depth = float(rng.uniform(0.5, 0.95) * (width - neck) / 2)
    length = float(rng.uniform(1.5, 4) * depth)
    x = np.linspace(0, 1, 9)
    heights = neck + 2 * depth * np.abs(2 * x - 1) ** rng.uniform(2, 4)
    forms: dict[str, Part] = {
        "circular": {"neck": neck, "radius": depth},
        "leaf": {
            "neck": neck,
            "length": rng.uniform(5, 25) * neck,
            "fillet": rng.uniform(0.2, 1) * neck,
        },
        "v": {
            "neck": neck,
            "depth": depth,
            "angle": rng.uniform(0.7, 1.6),
            "root_radius": rng.uniform(0.5, 2) * neck,
        },
        "": {"table": np.column_stack([length * x, heights]).tolist(), "smooth": True},
    }
    form = forms.get(shape, {"neck": neck, "depth": depth, "length": length})
    return {"shape": shape or "profile", **form}, profile_of(shape or "profile", form).length


class Drawing:
    """Parts of a mechanism that are drawn in turned and shifted axes."""

    def __init__(self, rng: Random) -> None:
        self.rng, self.turn, self.shift = (
            rng,
            cmath.exp(2j * np.pi * rng.random()),
            complex(*rng.uniform(-50, 50, 2)),
        )
        self.parts: dict[str, list[Part]] = {
            name: [] for name in ("body", "hinge", "actuator", "copies")
        }

    def at(self, z: complex) -> tuple[float, float]:
        placed = self.turn * z + self.shift
        return placed.real, placed.imag

    def bar(self, name: str, points: list[complex], width: float, **others: Any) -> None:
        self.parts["body"].append(
            {"name": name, "path": list(map(self.at, points)), "width": width, **others}
        )

    def hinge(
        self, name: str, between: tuple[str, str], z: complex, direction: complex, profile: Part
    ) -> None:
        place = {"at": self.at(z), "direction": cmath.phase(direction * self.turn)}
        self.parts["hinge"].append({"name": name, "between": between, **place, **profile})

    def drive(self, name: str, between: tuple[str, str], *ends: complex) -> None:
        rating = {"stroke": 0.015, "stiffness": 3e4, "mass": 1e-5}
        self.parts["actuator"].append(
            {"name": name, "between": between, "at": list(map(self.at, ends)), **rating}
        )

    def mechanism(self, name: str, output: str, z: complex) -> flexfem.Mechanism:
        loaded = {"mass": self.rng.uniform(1e-5, 2e-4), "inertia": self.rng.uniform(0, 0.05)}
        return flexfem.Mechanism(
            name=name,
            thickness=self.rng.uniform(5, 20),
            output={"body": output, "at": self.at(z)},
            payload=loaded if self.rng.random() < 0.5 else None,
            frame={"expansion": 1.2e-5},
            material={"name": str(self.rng.choice(["al-7075-t6", "ti-6al-4v", "steel-4340"]))},
            model=str(self.rng.choice(["plane_stress", "plane_strain"])),
            **self.parts,
        )


def ring(rng: Random, name: str) -> flexfem.Mechanism:
    """Bars from hinge to hinge around a ring, one of them fixed; without one hinge it is an open
    chain.
    """
    draw = Drawing(rng)
    count = int(rng.integers(4, 7))
    width = float(rng.uniform(6, 10))
    p = (
        (1 + rng.uniform(-0.15, 0.15, count))
        * 11
        * count
        * np.exp(2j * np.pi * np.arange(count) / count)
    )
    d = 1j * p / abs(p) * np.exp(1j * rng.uniform(-0.5, 0.5, count))
    profiles, lengths = zip(*(hinge(rng, width) for _ in p), strict=True)
    stub = d * (np.array(lengths) / 2 + 0.8 * width)
    missing = -1 if rng.random() < 0.6 else int(rng.integers(count))
    for k, after in enumerate(np.roll(range(count), -1)):
        ends = [p[k], p[k] + stub[k], p[after] - stub[after], p[after]]
        draw.bar(f"bar {k}", ends[k == missing : 4 - (after == missing)], width, fixed=k == 0)
        if k != missing:
            draw.hinge(
                f"hinge {k}", (f"bar {(k - 1) % count}", f"bar {k}"), p[k], d[k], profiles[k]
            )
    middle = (p + stub + np.roll(p - stub, -1)) / 2
    out, *driven = 1 + rng.permutation(count - 1)
    for k in driven[: int(rng.integers(1, 3))]:
        carrier, start = [("ground", middle[k] * 1.4), (f"bar {out}", middle[out])][
            int(rng.random() < 0.3)
        ]
        draw.drive(f"drive {k}", (carrier, f"bar {k}"), start, middle[k])
    return draw.mechanism(name, f"bar {out}", middle[out] * rng.uniform(0, 1))


def legs(rng: Random, name: str) -> flexfem.Mechanism:
    """A stage, a polygon with a hole, on legs of two hinges; the pads are fixed, or clamped at
    their ends.
    """
    draw = Drawing(rng)
    count = int(rng.integers(2, 5))
    width = float(rng.uniform(6, 10))
    side = rng.uniform(9, 13)
    corners = (
        side / np.cos(np.pi / 2 / count) * np.exp(1j * np.pi * (np.arange(2 * count) + 0.5) / count)
    )
    whole: Part = {
        "outline": list(map(draw.at, corners)),
        "holes": [{"centre": draw.at(0j), "radius": 0.45 * side}],
    }
    draw.parts["body"].append({"name": "stage", **whole})
    inner, near = hinge(rng, min(width, 1.6 * side * np.tan(np.pi / 2 / count)))
    outer, far = hinge(rng, width)
    bend = cmath.exp(1j * rng.uniform(-1, 1))
    first = side + near / 2 + 0j
    knee = first + near / 2 + width
    second = knee + bend * (rng.uniform(10, 35) + width + far / 2)
    draw.bar("leg", [first, knee, second], width)
    held: Part = {"fixed": True} if rng.random() < 0.5 else {"clamped_edges": [2]}
    draw.bar(
        "pad",
        [second, second + bend * (far / 2 + 1.5 * width)],
        width * rng.uniform(1, 1.5),
        **held,
    )
    draw.hinge("inner", ("stage", "leg"), first, 1 + 0j, inner)
    draw.hinge("outer", ("leg", "pad"), second, bend, outer)
    draw.drive("drive", ("ground", "leg"), knee + bend * (width + 25j), knee + bend * width)
    copied = ["leg", "pad", "inner", "outer", "drive"][: 5 if count == 2 else 4]
    draw.parts["copies"] = [{"parts": copied, "count": count, "about": draw.at(0j)}]
    return draw.mechanism(name, "stage", complex(*rng.uniform(-5, 5, 2)))


def guide(rng: Random, name: str) -> flexfem.Mechanism:
    """A bar on two legs, the second a mirror image, above a fixed bar."""
    draw = Drawing(rng)
    width = float(rng.uniform(6, 10))
    half = rng.uniform(15, 30)
    upper, high = hinge(rng, width)
    lower, deep = hinge(rng, width)
    top = half - 0.5j * (width + high)
    low = top - 1j * (high / 2 + rng.uniform(8, 30) + deep / 2)
    span = half + width + 0j
    base = low.imag * 1j - 0.5j * (deep + width)
    pushes = int(rng.integers(3))
    draw.bar("stage", [-span, span], width)
    draw.bar("leg", [top, low], width)
    draw.bar("base", [base - span, base + span], width, fixed=True)
    draw.hinge("upper", ("stage", "leg"), top, -1j, upper)
    draw.hinge("lower", ("leg", "base"), low, -1j, lower)
    if pushes:
        draw.drive("push", ("ground", "leg"), (top + low) / 2 + 20, (top + low) / 2)
    if pushes < 2:
        draw.drive("drive", ("ground", "stage"), -span - 20, 1 - span)
    copied = ["leg", "upper", "lower", "push"][: 4 if pushes == 2 else 3]
    draw.parts["copies"] = [{"parts": copied, "mirror": [draw.at(0j), draw.at(1j)]}]
    return draw.mechanism(name, "stage", complex(rng.uniform(-half, half), -rng.uniform(0, 5)))


def quantities(mechanism: flexfem.Mechanism, label: str) -> list[Array]:
    """Values of one model in the order of QUANTITIES; a row for each load, but in the compliance of
    the ports.
    """
    layout = mechanism.layout
    pull = np.array([[0.0, -9806.65], [9806.65, 0.0]])
    heat = float(mechanism.material.expansion or 0.0), float(mechanism.frame.expansion or 0.0)
    if label in MODELS:
        parts = parts_of(mechanism) if label == "elastic bodies" else ElasticParts()
        response = network(mechanism, label == "elastic bodies")
        weight, _ = plates.weight_response(layout, pull, parts.bodies, hinges=parts.hinges)
        warm, _ = plates.thermal_response(layout, *heat, parts.bodies, hinges=parts.hinges)
        lowest = plates.modes(layout, parts.bodies, hinges=parts.hinges)[:1]
    else:
        model = model_of(mechanism, RESOLUTION)
        response = elements(mechanism, RESOLUTION)
        weight = model.weight_response(model.mass, pull).motions
        warm = ports.thermal_response(model, *heat).motions
        lowest = ports.plate_modes(model, 1).frequencies[:1]
    C = response.compliance
    lever = np.array([1.0, 1.0, layout.lever])
    if (
        np.max(np.abs(C - C.T)) > 1e-9 * np.max(np.abs(C))
        or np.linalg.eigvalsh(C).min() < -1e-9 * np.abs(C).max()
    ):
        raise ArithmeticError(f"the compliance of {label} is not symmetric and positive")
    stress = np.max(values_of_ports(mechanism, response)["stress"], axis=0)
    return [C, stress[:, None], weight[:3].T * lever, warm[:3].T * lever, lowest[:, None]]


def differences(values: list[Array], reference: list[Array], drives: list[int]) -> list[float]:
    """Per cent by which each quantity differs from the reference."""
    sizes = [np.max(np.abs(of), axis=1, keepdims=True) for of in reference]
    sizes[0] = np.sqrt(np.outer(*2 * [np.diag(reference[0])]))
    C, *others = (
        np.abs(one - of) / size for one, of, size in zip(values, reference, sizes, strict=True)
    )
    return [
        100 * float(np.max(block))
        for block in (C[:3, :3], np.diag(C)[drives], C[:3, drives], *others)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    found = []
    named = list[str]()
    for number in range(arguments.mechanisms):
        family = (ring, legs, guide)[int(rng.integers(3))]
        start = time.perf_counter()
        about = ""
        name = f"{family.__name__} {number + 1}"
        try:
            mechanism = family(rng, name)
            about = f", {mechanism.model}, " + " ".join(
                sorted({one.shape for one in mechanism.hinge})
            )
            reference = quantities(mechanism, "finite elements")
            drives = mechanism.layout.drive_ports
            found.append(
                [differences(quantities(mechanism, label), reference, drives) for label in MODELS]
            )
            off = dict(zip(QUANTITIES, found[-1][1], strict=True))
            large = [f"{quantity} {one:.1f} %" for quantity, one in off.items() if not one < LARGE]
        except Exception:
            large = [traceback.format_exc(limit=-3)]
        named += [f"{name}{about}: {', '.join(large)}"] if large else []
        print(f"{name:10} {time.perf_counter() - start:5.1f} s", *large, flush=True)
    print("median and worst, %", *(f"{label:>22}" for label in MODELS))
    for name, one in zip(QUANTITIES, np.transpose(found, (2, 1, 0)), strict=True):
        print(f"{name:20}", *(f"{np.median(off):11.2f}{np.max(off):11.2f}" for off in one))
    print("\n".join([f"failed, or more than {LARGE:g} % off with elastic bodies:", *named]))


if __name__ == "__main__":
    main()
