"""Gaps between parts of a plate: their widths and places at rest, and overlaps of parts that move.

Parts are numbered: the bodies, then the hinges, as in a mesh, then the middles of the hinges. A
hinge is joined to its two bodies, from which only its middle may be apart.
"""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import Array, Index
from flexfem.mechanism.hinge_place import ALONG, joint_polygon
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.plate import INSIDE, body_polygon
from flexfem.mechanism.plate_checks import TOUCHING

MIDDLE = ALONG[INSIDE]
BESIDE = 100.0  # height of the strip beside a hinge, per length


class Gap(NamedTuple):
    """A gap between two parts, mm, and its place.

    A negative width is the mean thickness of their overlap.
    """

    width: float
    place: complex
    parts: tuple[int, int]


def names_of_parts(layout: Layout) -> list[str]:
    """Return the names of all parts; the middle of a hinge has the name of the hinge."""
    hinges = [joint.name for joint in layout.joints]
    return [*(body.name for body in layout.bodies), *hinges, *hinges]


def pairs_of_parts(layout: Layout) -> tuple[Index, Index]:
    """Return the first and second parts (n,) of all pairs that may be apart and may move relative
    to each other.
    """
    bodies = len(layout.bodies)
    hinges = len(layout.joints)
    one, other = np.triu_indices(bodies + hinges, 1)
    joined = np.zeros((bodies + hinges, bodies + hinges), dtype=np.bool_)
    middles = list[tuple[int, int]]()
    for number, joint in enumerate(layout.joints):
        for body in joint.bodies:
            if body >= 0:
                joined[body, bodies + number] = True
                middles.append((body, bodies + hinges + number))
    fixed = np.array([body.fixed for body in layout.bodies] + [False] * hinges)
    kept = ~joined[one, other] & ~(fixed[one] & fixed[other])
    near, far = np.reshape(middles, (-1, 2)).T.astype(np.int64)
    return np.append(one[kept], near), np.append(other[kept], far)


def box_distances(
    boxes: Array,
    one: Index,
    other: Index,
) -> Array:
    """Return the distances (n,) of the boxes (parts, 4) of pairs of parts, which no distance of
    parts is below.
    """
    low = boxes[:, :2]
    high = boxes[:, 2:]
    apart = np.maximum(low[other] - high[one], low[one] - high[other])
    return np.asarray(np.hypot(*np.maximum(apart, 0.0).T))


def gap_between(
    parts: tuple[int, int],
    first: Any,
    second: Any,
) -> Gap:
    """Return the gap between the polygons of two parts."""
    if shapely.intersects(first, second):
        shared = shapely.intersection(first, second)
        centre = shapely.centroid(shared)
        length = max(shapely.length(shared), TOUCHING)
        return Gap(-2 * shapely.area(shared) / length, complex(centre.x, centre.y), parts)
    line = shapely.shortest_line(first, second)
    middle = shapely.centroid(line)
    return Gap(shapely.length(line), complex(middle.x, middle.y), parts)


def smallest_gaps(layout: Layout, count: int) -> list[Gap]:
    """Return the smallest gaps of a plate at rest, the smallest first, at most one for every pair
    of parts.
    """
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    parts = np.array([*bodies, *map(joint_polygon, layout.joints)])
    found = [
        gap for number in range(len(layout.joints)) for gap in _gaps_beside(layout, bodies, number)
    ]
    one, other = pairs_of_parts(layout)
    whole = other < len(parts)
    one = one[whole]
    other = other[whole]
    least = box_distances(shapely.bounds(parts), one, other)
    for number in np.argsort(least, kind="stable"):
        found = sorted(found, key=_width)[:count]
        if len(found) == count and least[number] > found[-1].width:
            break
        pair = int(one[number]), int(other[number])
        found.append(gap_between(pair, parts[pair[0]], parts[pair[1]]))
    return sorted(found, key=_width)[:count]


def _width(gap: Gap) -> float:
    return gap.width


def _gaps_beside(
    layout: Layout,
    bodies: list[Any],
    number: int,
) -> list[Gap]:
    """Return the gaps between a hinge and its own bodies where these lie beside its middle."""
    joint = layout.joints[number]
    strip = _strip(joint)
    found = list[Gap]()
    for body in joint.bodies:
        if body < 0:
            continue
        beside = shapely.intersection(bodies[body], strip)
        if shapely.area(beside) > 0:
            pair = body, len(bodies) + number
            found.append(gap_between(pair, beside, joint_polygon(joint, MIDDLE)))
    return found


def _strip(joint: Joint) -> Any:
    """Return the strip beside the middle of a hinge."""
    length = joint.profile.length
    half = MIDDLE[-1] * length
    high = BESIDE * length
    corners = np.array(
        [complex(-half, -high), complex(half, -high), complex(half, high), complex(-half, high)]
    )
    z = joint.place + corners * cmath.exp(1j * joint.heading)
    return shapely.Polygon(np.column_stack([z.real, z.imag]))
