"""Curves on layers such as GROUND or OUTPUT: edges of metal, or marks of a place.

The rule: such a curve marks a place. It is an edge of metal as well where the other layers need it,
which is the case for all curves that are connected with it on such layers, if

- the other layers have no curve,
- an open end of the other layers is at one of them,
- they enclose metal of the other layers, or
- they enclose an area outside this metal that has an edge in common with it: a body that is drawn
  beside others.

Closed contours within the metal of the other layers, and those that cross its edge, only mark a
place: what is cut there is drawn on another layer. Layers such as SCREWS and HOLES hold edges of
metal and mark them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from flexfem.importing.curves import DrawnCurve
from flexfem.importing.found import DrawnMark
from flexfem.importing.layers import is_mark, is_screws
from flexfem.importing.network import SNAP, CurveNetwork, Shapes, network_of
from flexfem.importing.regions import DrawnPlate, Regions, regions_of
from flexfem.mechanism.outlines import Segment, polygon_points

STEP = np.pi / 32  # rad of arc per point of a mark
FINE = np.pi / 256  # rad of arc per vertex of polygons that are compared
INSIDE = 1e-3  # share of an area that may lie outside another, by their polygons
ROUNDS = 8  # of bodies on such layers, each beside the one before


class Sorted(NamedTuple):
    """Curves that are edges of metal, and what they enclose.

    layers : layers of marks on which some of them are.
    """

    metal: list[DrawnCurve]
    network: CurveNetwork
    regions: Regions
    layers: tuple[str, ...]


def sorted_curves(curves: Sequence[DrawnCurve], tolerance: float) -> Sorted:
    """Tell edges of metal from curves that only mark a place, by the rule of this module."""
    metal = [curve for curve in curves if not is_mark(curve.layer)]
    marking = [curve for curve in curves if is_mark(curve.layer)]
    doubtful = _connected(marking, tolerance)
    if not metal:
        metal = list(curves)
        doubtful = []
    taken = list[str]()
    network = network_of(metal, tolerance)
    regions = regions_of(network)
    for _ in range(ROUNDS):
        needed = [group for group in doubtful if _is_metal(group, regions, tolerance)]
        if not needed:
            break
        doubtful = [group for group in doubtful if group not in needed]
        metal += [curve for group in needed for curve in group]
        taken += [curve.layer for group in needed for curve in group]
        network = network_of(metal, tolerance)
        regions = regions_of(network)
    return Sorted(metal, network, regions, tuple(dict.fromkeys(taken)))


def _connected(curves: list[DrawnCurve], tolerance: float) -> list[list[DrawnCurve]]:
    """Return curves by what they are connected to."""
    network = network_of(curves, tolerance)
    group = list(range(len(curves)))

    def first(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    owner = dict[int, int]()
    for edge in network.edges:
        for vertex in (edge.start, edge.end):
            group[first(edge.curve)] = first(owner.setdefault(vertex, edge.curve))
    members = dict[int, list[DrawnCurve]]()
    for k, curve in enumerate(curves):
        members.setdefault(first(k), []).append(curve)
    return list(members.values())


def _is_metal(
    group: Sequence[DrawnCurve],
    regions: Regions,
    tolerance: float,
) -> bool:
    """Whether connected curves on layers of marks are edges of metal, by the rule above."""
    if _meets_an_open_end(group, regions, tolerance):
        return True
    enclosed = regions_of(network_of(group, tolerance)).plates
    filled = [_filled(plate) for plate in enclosed]
    metal = [_polygon(plate) for plate in regions.plates]
    return any(_encloses(one, other) or _is_beside(one, other) for one in filled for other in metal)


def _meets_an_open_end(
    group: Sequence[DrawnCurve],
    regions: Regions,
    tolerance: float,
) -> bool:
    """Whether an open end of the other layers is at one of the curves."""
    ends = np.array([end for chain in regions.open for end in chain.ends], dtype=complex)
    if not len(ends):
        return False
    shapes = Shapes([segment for curve in group for segment in curve.segments])
    at, on = shapes.near(ends, tolerance)
    shares, off = shapes.projected(on, ends[at])
    beyond = tolerance / np.maximum(shapes.length[on], tolerance)
    return bool(np.any((off <= tolerance) & (shares > -beyond) & (shares < 1 + beyond)))


def _encloses(area: shapely.Polygon, metal: shapely.Polygon) -> bool:
    """Whether an area contains metal of other layers and is larger than it."""
    around = shapely.Polygon(metal.exterior)
    outside = around.difference(area).area
    return bool(outside < INSIDE * metal.area and area.area > (1 + INSIDE) * around.area)


def _is_beside(area: shapely.Polygon, metal: shapely.Polygon) -> bool:
    """Whether an area has an edge in common with metal of other layers, and lies outside it."""
    common_edge = metal.buffer(10 * SNAP).intersection(area.boundary)
    if common_edge.length <= 100 * SNAP:
        return False
    return bool(metal.intersection(area).area < INSIDE * min(area.area, metal.area))


def _filled(plate: DrawnPlate) -> shapely.Polygon:
    """Return the polygon that the outer contour of a region of metal encloses."""
    ring = polygon_points([edge.segment for edge in plate.outside], FINE)
    return shapely.Polygon(ring).buffer(0)


def _polygon(plate: DrawnPlate) -> shapely.Polygon:
    """Return the polygon of a region of metal, with its holes."""
    loops = (plate.outside, *plate.holes)
    outside, *holes = (polygon_points([edge.segment for edge in loop], FINE) for loop in loops)
    return shapely.Polygon(outside, holes).buffer(0)


def marks_of(
    curves: Iterable[DrawnCurve], points: Sequence[DrawnMark], tolerance: float
) -> tuple[DrawnMark, ...]:
    """Return what is on layers that mark a place: points, lines and closed contours."""
    by_layer = dict[str, list[DrawnCurve]]()
    for curve in curves:
        if _marks_a_place(curve.layer):
            by_layer.setdefault(curve.layer, []).append(curve)
    marks = [mark for mark in points if _marks_a_place(mark.layer)]
    for layer, members in by_layer.items():
        regions = regions_of(network_of(members, tolerance))
        for plate in regions.plates:
            for loop in (plate.outside, *plate.holes):
                marks.append(DrawnMark(layer, _points([edge.segment for edge in loop])))
        for chain in regions.open:
            for edge in chain.edges:
                line = (*_points([edge.segment]), edge.segment.end)
                marks.append(DrawnMark(layer, line, closed=False))
    return tuple(marks)


def _marks_a_place(layer: str) -> bool:
    return is_mark(layer) or is_screws(layer)


def _points(segments: Sequence[Segment]) -> tuple[complex, ...]:
    """Points along segments, without the last end."""
    return tuple(z for segment in segments for z in segment.points(STEP).tolist())
