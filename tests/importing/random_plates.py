"""Random mechanisms of all shapes of hinges: chains of bars, guides, and legs in copies, with
holes.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

import flexfem as api
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.profiles import profile_of
from flexfem.refused import BadInput

SHAPES = ("leaf", "circular", "elliptical", "parabolic", "v", "profile")
UNITS = {"angle": "deg"}
NECKS = (0.25, 0.8)  # mm
TRIES = 200  # designs per mechanism: many random ones overlap


def hinge_sizes(rng, shape):
    """Random dimensions of a hinge, mm and degrees, by the keys of a file without units, rounded to
    10 um.
    """

    def one(low, high):
        return round(float(rng.uniform(low, high)), 2)

    neck = one(*NECKS)
    match shape:
        case "leaf":
            return {"length": one(9, 24), "neck": neck, "fillet": one(0.3, 1.2)}
        case "circular":
            return {"radius": one(1.5, 4.0), "neck": neck}
        case "elliptical" | "parabolic":
            return {"length": one(6.0, 12.0), "depth": one(1.5, 3.0), "neck": neck}
        case "v":
            return {
                "angle": one(50, 90),
                "root_radius": one(0.4, 1.0),
                "depth": one(2.0, 3.5),
                "neck": neck,
            }
    rows = 9
    places = np.linspace(-4.0, 4.0, 9)
    heights = neck + 0.35 * np.abs(places) ** 1.5 + 0.05 * rng.random(rows)
    return {"table": [[float(x), round(float(h), 3)] for x, h in zip(places, heights, strict=True)]}


def profile(shape, sizes):
    values = {key: math.radians(value) if key == "angle" else value for key, value in sizes.items()}
    return profile_of(shape, values)


def hinge(name, between, place, heading, shape, sizes):
    stated = {f"{key}_{UNITS.get(key, 'mm')}": value for key, value in sizes.items()}
    made = {
        "name": name,
        "between": list(between),
        "at_mm": xy(place),
        "direction_deg": math.degrees(heading),
    }
    return made | {"shape": shape} | stated


def xy(z):
    return [float(z.real), float(z.imag)]


def chain(rng, turn):
    """Bars with bends, one after another, from a block with screw holes; every hinge is of another
    kind.
    """
    at = complex(*rng.uniform(-20, 20, 2))
    heading = turn
    count = int(rng.integers(2, 6))
    width = round(float(rng.uniform(9.0, 12.0)), 1)
    ahead = cmath.exp(1j * heading)
    holes = [{"centre_mm": xy(at - 6 * ahead), "radius_mm": round(float(rng.uniform(1, 2.2)), 2)}]
    bodies = [
        {
            "name": "base",
            "fixed": True,
            "path_mm": [xy(at - 16 * ahead), xy(at)],
            "width_mm": width,
            "holes": holes,
        }
    ]
    hinges = list[dict]()
    for k in range(count):
        shape = SHAPES[int(rng.integers(len(SHAPES)))]
        sizes = hinge_sizes(rng, shape)
        made = profile(shape, sizes)
        if made.end_height > width:
            sizes = {"radius": 1.7, "neck": 0.4}
            shape = "circular"
            made = profile("circular", {"radius": 1.7, "neck": 0.4})
        previous = "base" if k == 0 else f"bar {k}"
        hinges.append(
            hinge(
                f"h{k}",
                (previous, f"bar {k + 1}"),
                at + made.length / 2 * ahead,
                heading,
                shape,
                sizes,
            )
        )
        start = at + made.length * ahead
        corner = start + float(rng.uniform(14, 26)) * ahead
        bend = float(rng.choice([0.0, 30.0, -45.0, 90.0, -90.0, 60.0]))
        heading += math.radians(bend)
        ahead = cmath.exp(1j * heading)
        at = corner + float(rng.uniform(12, 22)) * ahead
        points = [xy(start), [*xy(corner), width], xy(at)] if bend else [xy(start), xy(at)]
        bodies.append({"name": f"bar {k + 1}", "path_mm": points, "width_mm": width})
    return bodies, hinges, [], (f"bar {count}", at - 3 * ahead)


def guide(rng, turn):
    """Two blocks with fillets and holes, joined by equal leaves or notches; half of them mirrored."""
    shape = SHAPES[int(rng.integers(len(SHAPES)))]
    sizes = hinge_sizes(rng, shape)
    made = profile(shape, sizes)
    pairs = int(rng.integers(1, 5))
    pitch = made.end_height + round(float(rng.uniform(2.0, 8.0)), 1)
    half = pitch * (pairs + 0.5)
    high = round(float(rng.uniform(9, 16)), 1)
    about = complex(*rng.uniform(-30, 30, 2))
    r = cmath.exp(1j * turn)
    radius = round(float(rng.uniform(1.0, 4.0)), 1)

    def point(x, y, *more):
        return [*xy(about + r * complex(x, y)), *more]

    top = made.length
    holes = [
        {"centre_mm": point(side * half / 2, -high / 2), "radius_mm": 1.25} for side in (-1, 1)
    ]
    bow = round(float(rng.uniform(1.0, 3.0)), 2)
    bodies = [
        {"name": "base", "fixed": True, "holes": holes}
        | {
            "outline_mm": [
                point(-half, -high),
                point(half, -high, radius),
                point(half, 0),
                point(-half, 0),
            ]
        },
        {"name": "table"}
        | {
            "outline_mm": [
                point(-half, top),
                point(half, top),
                point(half, top + high, 0, bow),
                point(-half, top + high),
            ]
        },
    ]
    hinges = [
        hinge(
            f"h{k}",
            ("base", "table"),
            about + r * complex(pitch * (k + 0.5), top / 2),
            turn + math.pi / 2,
            shape,
            sizes,
        )
        for k in range(pairs)
    ]
    mirror = [xy(about), xy(about + r * 1j)]
    return (
        bodies,
        hinges,
        [{"parts": [f"h{k}" for k in range(pairs)], "mirror_mm": mirror}],
        (
            "table",
            about + r * complex(0, top + high / 2),
        ),
    )


def star(rng, turn):
    """A hub with equal legs of two hinges and a bar around it, to pads that are fixed."""
    count = int(rng.integers(3, 7))
    first = SHAPES[int(rng.integers(len(SHAPES)))]
    sizes = [hinge_sizes(rng, first), hinge_sizes(rng, "circular")]
    made = [profile(first, sizes[0]), profile("circular", sizes[1])]
    width = round(max(each.end_height for each in made) + 1.0, 1)
    about = complex(*rng.uniform(-30, 30, 2))
    r = cmath.exp(1j * turn)
    radius = width / 2 / math.sin(math.pi / count) + 2.0
    corners = [radius * cmath.exp(2j * math.pi * (k + 0.5) / count) for k in range(count)]
    inner = radius * math.cos(math.pi / count)
    ends = np.cumsum(
        [inner, made[0].length, round(float(rng.uniform(10, 20)), 1), made[1].length, 9.0]
    )

    def along(x):
        return xy(about + r * x)

    bodies = [
        {"name": "hub", "outline_mm": [along(corner) for corner in corners]}
        | {"holes": [{"centre_mm": xy(about), "radius_mm": round(inner / 3, 2)}]},
        {"name": "bar", "path_mm": [along(ends[1]), along(ends[2])], "width_mm": width},
        {
            "name": "pad",
            "fixed": True,
            "path_mm": [along(ends[3]), along(ends[4])],
            "width_mm": width,
        },
    ]
    hinges = [
        hinge("inner", ("hub", "bar"), about + r * (ends[0] + ends[1]) / 2, turn, first, sizes[0]),
        hinge(
            "outer", ("bar", "pad"), about + r * (ends[2] + ends[3]) / 2, turn, "circular", sizes[1]
        ),
    ]
    copies = [{"parts": ["bar", "pad", "inner", "outer"], "count": count, "about_mm": xy(about)}]
    return bodies, hinges, copies, ("hub", about + r * inner * 0.6)


def random_mechanism(seed: int) -> Mechanism:
    """Return a mechanism that can be made; equal seeds give equal ones."""
    rng = np.random.default_rng(seed)
    for _ in range(TRIES):
        kind = (chain, guide, star)[seed % 3]
        turn = math.radians(
            float(rng.choice([0.0, 90.0, 30.0, round(float(rng.uniform(0, 360)), 3)]))
        )
        bodies, hinges, copies, (body, at) = kind(rng, turn)
        content = {
            "name": f"random {seed}",
            "thickness_mm": 8.0,
            "material": {"name": "al-7075-t6"},
        }
        content |= {"body": bodies, "hinge": hinges, "output": {"body": body, "at_mm": xy(at)}}
        try:
            made = api.MechanismFile.model_validate(content | ({"copy": copies} if copies else {}))
            check_feasible(made)
        except BadInput:
            continue
        return made
    raise AssertionError(f"no mechanism with seed {seed}")
