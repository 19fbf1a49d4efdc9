"""How far two plates depart from each other, by their areas and their edges."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.importing.found import Drawing
from flexfem.mechanism.edges import Bezier, Curve, Ellipse
from flexfem.mechanism.hinge_place import SIDES, cuts_of, end_corners, joint_loop
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.plate import GRID

CHORD = 4e-6  # mm, of a polygon from the curve that it follows
MOST = 4000  # corners along one curve
SPACING = 0.5  # mm, at most, between compared points of an edge
SEAM = 1e-5  # mm, half the width of a strip that joins a hinge and its body


class Departure(NamedTuple):
    """How far a plate departs from another.

    area : of which only one of them consists, per area of the first.
    largest, place : largest distance of edges, mm, and its place.
    inside : whether the second plate lacks material there.
    """

    area: float
    largest: float
    place: complex
    inside: bool


def departure(one: Any, other: Any) -> Departure:
    """Return the departure of the second of two polygons from the first."""
    area = float(shapely.area(shapely.symmetric_difference(one, other)) / shapely.area(one))
    found = [_farthest(one, other), _farthest(other, one)]
    largest, place = max(found, key=lambda each: each[0])
    point = shapely.Point(place.real, place.imag)
    to_missing = _distance(shapely.difference(one, other), point)
    to_extra = _distance(shapely.difference(other, one), point)
    return Departure(area, largest, place, to_missing < to_extra)


def _distance(shape: Any, point: Any) -> float:
    """Return the distance of a point from a shape, infinite from an empty one."""
    return math.inf if shape.is_empty else float(shapely.distance(shape, point))


def _farthest(one: Any, other: Any) -> tuple[float, complex]:
    """Return the largest distance of the edge of a polygon from that of another, and the place."""
    points = shapely.get_coordinates(shapely.segmentize(shapely.boundary(one), SPACING))
    sides = np.asarray(_sides(other))
    tree = shapely.STRtree(sides)
    dots = shapely.points(points)
    gaps = shapely.distance(dots, sides[tree.nearest(dots)])
    worst = int(np.argmax(gaps))
    return float(gaps[worst]), complex(*points[worst])


def _sides(shape: Any) -> list[Any]:
    """Return the edge of a polygon in short pieces, which are found quickly."""
    found = list[Any]()
    for ring in shapely.get_parts(shapely.get_rings(shapely.get_parts(shape))):
        corners = shapely.get_coordinates(ring)
        found.append(shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1)))
    return list(np.concatenate(found))


def drawn_polygon(drawing: Drawing) -> Any:
    """Return the polygon of a drawing."""
    return shapely.Polygon(_ring(drawing.outside), [_ring(hole) for hole in drawing.holes])


def fine_polygon(layout: Layout) -> Any:
    """Return the polygons of a whole plate whose corners follow its curves within `CHORD`."""
    parts = list[Any]()
    for index, body in enumerate(layout.bodies):
        drawn = shapely.Polygon(_ring(body.outline), [_ring(hole) for hole in body.holes])
        boxes = [shapely.Polygon(_ring(box)) for box in cuts_of(layout, index)]
        parts.append(shapely.difference(drawn, shapely.union_all(boxes)))
    for joint in layout.joints:
        parts.append(shapely.Polygon(_ring(joint_loop(joint))))
        parts += [_seam(joint, side) for side in SIDES]
    return shapely.union_all(parts, grid_size=GRID)


def _seam(joint: Joint, side: int) -> Any:
    """Return a thin strip over the end of a hinge.

    It closes gaps of round-off between the hinge and its body.
    """
    upper, lower = end_corners(joint, side)
    ahead = SEAM * cmath.exp(1j * joint.heading)
    corners = np.array([upper - ahead, lower - ahead, lower + ahead, upper + ahead])
    return shapely.Polygon(np.column_stack([corners.real, corners.imag]))


def _ring(loop: Sequence[Curve]) -> AnyArray:
    points = np.concatenate([curve_points(curve)[:-1] for curve in loop])
    return np.column_stack([points.real, points.imag])


def curve_points(curve: Curve) -> AnyArray:
    """Return points (n,), complex, along a curve, its ends included."""
    if isinstance(curve, Segment):
        if curve.centre is None:
            return np.array([curve.start, curve.end])
        return curve.at(np.linspace(0, 1, _count(abs(curve.start - curve.centre), curve.turn)))
    if isinstance(curve, Ellipse):
        return _ellipse(curve)
    return _bezier(curve)


def _ellipse(curve: Ellipse) -> AnyArray:
    axis, minor = _half_axes(curve)
    angles = list[float]()
    for z in (curve.start, curve.end):
        local = (z - curve.centre) / axis
        angles.append(math.atan2(local.imag * abs(axis) / minor, local.real))
    turn = (angles[1] - angles[0] + math.pi) % (2 * math.pi) - math.pi
    t = angles[0] + np.linspace(0, 1, _count(abs(axis) ** 2 / minor, turn)) * turn
    aside = 1j * axis / abs(axis) * minor
    return np.asarray(curve.centre + axis * np.cos(t) + aside * np.sin(t))


def _half_axes(curve: Ellipse) -> tuple[complex, float]:
    """Return the major half-axis and the length of the minor one."""
    z = (curve.start - curve.centre) / curve.major
    w = (curve.end - curve.centre) / curve.major
    off = max(z, w, key=lambda each: abs(each.imag))
    return curve.major, abs(off.imag) / math.sqrt(max(1 - off.real**2, 1e-300)) * abs(curve.major)


def _bezier(curve: Bezier) -> AnyArray:
    control = np.array(curve.points)
    length = float(np.sum(np.abs(np.diff(control))))
    share = np.linspace(0, 1, _count(length, math.pi / 2))
    points = np.repeat(control[:, None], len(share), axis=1)
    while len(points) > 1:
        points = points[:-1] + share * (points[1:] - points[:-1])
    return np.asarray(points[0])


def _count(radius: float, turn: float) -> int:
    """Return the number of points along an arc."""
    step = math.sqrt(8 * CHORD / radius) if radius > CHORD else math.pi
    return min(max(3, math.ceil(abs(turn) / step) + 1), MOST)
