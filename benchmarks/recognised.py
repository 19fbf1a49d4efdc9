"""Random mechanisms whose bodies and hinges are found again in their plates, counted.

    python benchmarks/recognised.py --mechanisms 100 --seed 1

The contour of the plate is all that is known of a mechanism. It is found again when it has as many
bodies, with the same areas, and when every hinge has its shape, place, direction and dimensions
within 1 um. A table has its length and heights, as its rows may lie elsewhere. The mechanisms are
those of `random_mechanisms.py`, and chains of bars 3 to 30 mm wide with necks of 0.2 to 1 mm and
holes, also with notches on one side."""

from __future__ import annotations

import argparse
import cmath
import math
import time
import traceback
from pathlib import Path

import numpy as np
from random_mechanisms import Drawing as Drafting
from random_mechanisms import Part, Random, guide, legs, ring

import flexfem
from flexfem.fem.plate_mesh import plate_contours
from flexfem.importing.found import Drawing, FoundHinge, FoundPlate
from flexfem.importing.recognise import recognise
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.outlines import area
from flexfem.mechanism.plate import body_polygon
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profiles import profile_of
from flexfem.mechanism.tabulated import Tabulated
from flexfem.refused import BadInput, ComputationFailed

MICROMETRE = 1e-3  # mm
PARALLEL = 1e-4  # rad
OF_BODIES = 2e-3  # relative, of areas of bodies: their polygons approximate arcs
SIDES = (None, None, "left", "right")


def slender_hinge(rng: Random, width: float) -> tuple[Part, float]:
    """A random profile of any shape with a neck of 0.2 to 1 mm for a bar of a width, mm, and its
    length.
    """
    neck = float(rng.uniform(0.2, 1.0))
    depth = float(rng.uniform(0.6, 0.95)) * (width - neck) / 2
    length = float(rng.uniform(1.5, 4.0)) * depth
    fillet = min(depth, float(rng.uniform(0.2, 2.0)))
    x = np.linspace(-0.5, 0.5, 33)
    rise = depth * (1 - np.cos(np.pi * x))
    one = rng.uniform(0.5, 1.0)
    rows = np.column_stack([x * length, neck / 2 + rise, neck / 2 + one * rise])
    straight = [
        [0, neck + 2 * depth],
        [0.4 * length, neck],
        [0.6 * length, neck],
        [length, neck + 2 * depth],
    ]
    forms: list[tuple[str, Part]] = [
        ("circular", {"neck": neck, "radius": depth}),
        ("elliptical", {"neck": neck, "depth": depth, "length": length}),
        ("parabolic", {"neck": neck, "depth": depth, "length": length}),
        (
            "filleted",
            {"neck": neck, "length": 2 * fillet + rng.uniform(0.5, 4.0), "fillet": fillet},
        ),
        ("leaf", {"neck": neck, "length": rng.uniform(6.0, 50.0), "fillet": min(fillet, 1.0)}),
        ("leaf", {"neck": neck, "length": rng.uniform(6.0, 50.0)}),
        (
            "v",
            {
                "neck": neck,
                "depth": depth,
                "angle": rng.uniform(0.5, 2.0),
                "root_radius": 0.3 * depth,
            },
        ),
        ("profile", {"table": rows.tolist(), "smooth": True}),
        ("profile", {"table": straight}),
    ]
    shape, form = forms[int(rng.integers(len(forms)))]
    side = SIDES[int(rng.integers(len(SIDES)))]
    if side is not None and shape != "profile" and ("fillet" in form or shape != "leaf"):
        form = form | {"side": side}
    return {"shape": shape, **form}, profile_of(shape, form).length


def chain(rng: Random, name: str) -> flexfem.Mechanism:
    """Bars one behind the other, the first one fixed, the last one with a hole."""
    draw = Drafting(rng)
    width = float(rng.uniform(3.0, 30.0))
    count = int(rng.integers(2, 7))
    place = 0j
    ahead = 1 + 0j
    bends = [-2 * width - 10 + 0j]
    for k in range(count):
        profile, length = slender_hinge(rng, width)
        bends.append(place)
        draw.bar(f"bar {k}", bends, width, fixed=k == 0)
        draw.hinge(f"hinge {k}", (f"bar {k}", f"bar {k + 1}"), place, ahead, profile)
        stub = length / 2 + 0.6 * width + 26.0
        knee = place + ahead * stub
        bends = [place, knee]
        ahead *= cmath.exp(1j * rng.uniform(-0.7, 0.7))
        place = knee + ahead * (stub + rng.uniform(0.0, 20.0))
    hole = {"centre": draw.at(bends[1] + 0.2 * width * ahead), "radius": 0.2 * width}
    draw.bar(f"bar {count}", [*bends, place], width, holes=[hole])
    return draw.mechanism(name, f"bar {count}", place - width * ahead)


def drawing_of(layout: Layout) -> Drawing:
    """Drawing of the largest piece of a plate."""
    outside, *holes = plate_contours(layout)
    return Drawing(Path("part.dxf"), tuple(outside), tuple(map(tuple, holes)), None, (), 0.0, ())


def profile_found(hinge: FoundHinge) -> Profile:
    """Profile of a found hinge."""
    values = {
        key: math.radians(value) if key == "angle" else value
        for key, value in hinge.dimensions.items()
    }
    if hinge.table:
        return profile_of("profile", {"table": hinge.table, "smooth": hinge.smooth})
    return profile_of(hinge.shape, values | ({"side": hinge.side} if hinge.side else {}))


def departures(layout: Layout, found: FoundPlate) -> list[str]:
    """What is not as in a mechanism."""
    if (len(found.hinges), len(found.bodies)) != (len(layout.joints), len(layout.bodies)):
        counts = f"{len(found.hinges)} of {len(layout.joints)} hinges"
        return [f"{counts} and {len(found.bodies)} of {len(layout.bodies)} bodies"]
    texts = [text for joint in layout.joints for text in hinge_departures(joint, found)]
    drawn = sorted(body_polygon(layout, k).area for k in range(len(layout.bodies)))
    areas = sorted(sum(map(area, (body.outside, *body.holes))) for body in found.bodies)
    if not texts and not np.allclose(drawn, areas, rtol=OF_BODIES, atol=0.0):
        texts.append(f"bodies of {areas} mm^2 instead of {drawn}")
    return texts


def hinge_departures(joint: Joint, found: FoundPlate) -> list[str]:
    """What of a hinge is not as in a mechanism."""
    hinge = min(found.hinges, key=lambda each: abs(each.place - joint.place))
    drawn = joint.profile
    profile = profile_found(hinge)
    backwards = math.cos(hinge.heading - joint.heading) < 0
    what = f"{joint.name}, {type(drawn).__name__} {drawn.side or ''}"
    if type(profile) is not type(drawn):
        return [
            f"{what}: {hinge.shape} {hinge.side or ''} {hinge.dimensions} instead of {drawn}"[:300]
        ]
    if not isinstance(drawn, Tabulated):
        side = {"left": "right", "right": "left"}.get(drawn.side or "") if backwards else drawn.side
        values = {key: value for key, value in vars(drawn).items() if isinstance(value, float)}
        off = {key: value - getattr(profile, key) for key, value in values.items()}
        wrong = {key: value for key, value in off.items() if abs(value) > MICROMETRE}
        if profile.side != side or wrong:
            return [f"{what}: {wrong}, side {profile.side} instead of {side}"]
    if (
        abs(hinge.place - joint.place) > MICROMETRE
        or abs(math.sin(hinge.heading - joint.heading)) > PARALLEL
    ):
        aside = (hinge.place - joint.place) * cmath.exp(-1j * joint.heading)
        return [f"{what}: {aside:.4f} off, lengths {profile.length:.4f} and {drawn.length:.4f}"]
    if not isinstance(drawn, Tabulated):
        return []
    x = np.linspace(-0.5, 0.5, 101) * min(profile.length, drawn.length) * (1 - 1e-9)
    heights = np.abs(profile.height(-x if backwards else x) - drawn.height(x)).max()
    if heights > 2 * MICROMETRE or abs(profile.length - drawn.length) > MICROMETRE:
        return [f"{what}: height {heights:.2g}, length {profile.length - drawn.length:.4f} off"]
    return []


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    found = 0
    hinges = 0
    longest = 0.0
    number = 0
    while number < arguments.mechanisms:
        rng = np.random.default_rng([arguments.seed, number])
        family = (chain, ring, legs, guide)[number % 4]
        name = f"{family.__name__} {number + 1}"
        number += 1
        try:
            mechanism = family(rng, name)
            drawing = drawing_of(mechanism.layout)
        except (BadInput, ComputationFailed) as refused:
            print(f"{name:10} cannot be drawn: {str(refused)[:100]}")
            continue
        start = time.perf_counter()
        try:
            texts = departures(mechanism.layout, recognise(drawing))
        except Exception:
            texts = [traceback.format_exc(limit=-4)]
        took = time.perf_counter() - start
        longest = max(longest, took)
        found += not texts
        hinges += len(mechanism.layout.joints)
        if texts:
            print(f"{name:10} {took:5.2f} s", *texts, sep="\n     ", flush=True)
    print(
        f"{found} of {number} mechanisms with {hinges} hinges are found again; at most "
        f"{longest:.2f} s for one"
    )


if __name__ == "__main__":
    main()
