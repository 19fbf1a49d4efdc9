"""Symmetry of plates: moves that take a plate into itself, and lines that divide it for them."""

from __future__ import annotations

import cmath
from collections.abc import Hashable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.mechanism.hinge_place import ALONG, joint_polygon
from flexfem.mechanism.layout import Body, Joint, Layout, Move
from flexfem.mechanism.outlines import Segment, circle_of, polygon_points
from flexfem.mechanism.plate import body_polygon
from flexfem.mechanism.plate_checks import TOUCHING
from flexfem.meshing.requests import DIVIDING, Line, Region

SAME_HEIGHT = 1e-9  # relative difference of the heights of a hinge at both sides of its centre
DECIMALS = 9  # of coordinates, mm, of parts that are equal
BEYOND = TOUCHING / 2  # mm, of a dividing line beyond the edge of the plate


class _Mark(NamedTuple):
    """A place of a plate with a tip, mm, and what must be equal at an image of it."""

    place: complex
    tip: complex
    kind: tuple[Hashable, ...]


def symmetry_of(layout: Layout) -> list[Move]:
    """Return the rotations, else one mirror image, that take a plate into itself.

    Rigid bodies do not count.
    """
    if not layout.joints:
        return []
    marks = list[_Mark]()
    for body in layout.bodies:
        if not body.fixed:
            marks += _marks_of_body(body)
    for joint in layout.joints:
        marks += _marks_of_joint(joint)
    about = complex(np.mean([joint.place for joint in layout.joints]))
    return _rotations(marks, about, len(layout.joints)) or _mirror_images(marks, about)


def _marks_of_body(body: Body) -> list[_Mark]:
    found = list[_Mark]()
    edges = [edge for loop in (body.outline, *body.holes) for edge in loop]
    for number, edge in enumerate(edges):
        kind = (body.width, body.material, number in body.clamped)
        if edge.centre is None:
            middle = (edge.start + edge.end) / 2
            found += [_Mark(middle, end, kind) for end in (edge.start, edge.end)]
        else:  # wherever circles are divided into arcs
            radius = round(abs(edge.start - edge.centre), DECIMALS)
            found.append(_Mark(edge.centre, edge.centre, (*kind, radius)))
    return found


def _marks_of_joint(joint: Joint) -> list[_Mark]:
    ahead = cmath.exp(1j * joint.heading)
    x = np.append(ALONG * joint.profile.length, joint.profile.breaks)
    functions = (joint.profile.height, joint.profile.middle)
    is_even = all(np.allclose(of(x), of(-x), rtol=SAME_HEIGHT) for of in functions)
    profile, left = joint.sided
    ways = (ahead, -ahead) if is_even else (ahead,)
    along = (profile, joint.cut, joint.material)
    found = [_Mark(joint.place, joint.place + way, along) for way in ways]
    return [*found, _Mark(joint.place, joint.place + left, (profile, joint.cut, "left"))]


def _relative(marks: Sequence[_Mark], about: complex) -> AnyArray:
    """Places and tips (n, 2) of marks from a point."""
    return np.array([mark[:2] for mark in marks]) - about


def _seen(marks: Sequence[_Mark], moved: AnyArray) -> set[tuple[Hashable, ...]]:
    """Return what is seen of marks whose places and tips are at `moved` (n, 2)."""
    rows = np.round(np.column_stack([moved.real, moved.imag]), DECIMALS).tolist()
    return {(mark.kind, *row) for mark, row in zip(marks, rows, strict=True)}


def _rotations(
    marks: Sequence[_Mark],
    about: complex,
    count: int,
) -> list[Move]:
    """Return the rotations about a point, as many as possible; `count` is a multiple of them."""
    z = _relative(marks, about)
    for turns in range(count, 1, -1):
        turn = np.exp(2j * np.pi / turns)
        if count % turns == 0 and _seen(marks, z * turn) == _seen(marks, z):
            factors = [complex(turn**k) for k in range(1, turns)]
            return [Move(factor, about - factor * about) for factor in factors]
    return []


def _mirror_images(marks: Sequence[_Mark], about: complex) -> list[Move]:
    """Return one mirror image, if any, in a line through a point."""
    z = _relative(marks, about)
    tips = z[:, 1]
    farthest = tips[np.argmax(np.abs(tips))]
    for tip in tips[np.isclose(np.abs(tips), abs(farthest))]:
        factor = complex(tip * farthest) / abs(tip * farthest)
        if _seen(marks, factor * z.conj()) == _seen(marks, z):
            return [Move(factor, about - factor * about.conjugate(), mirrored=True)]
    return []


class DividedRegions(NamedTuple):
    """Regions with circles whose corners moves keep, and lines between sectors or halves."""

    regions: list[Region]
    lines: list[Line]


def divided(
    layout: Layout,
    regions: list[Region],
    moves: list[Move],
) -> DividedRegions:
    """Divide the regions of a plate for the moves of `symmetry_of`."""
    faces = [body_polygon(layout, index) for index in range(len(layout.bodies))]
    if moves[0].mirrored:
        return _halved(layout, regions, faces, moves[0])
    about = moves[0].shift / (1 - moves[0].factor)
    drawn = list[Region]()
    lines = list[Line]()
    for index, (body, face) in enumerate(zip(layout.bodies, faces, strict=True)):
        along = _between_hinges(layout, index, about, len(moves) + 1)
        if abs(_centroid(face) - about) < TOUCHING and not body.fixed:
            for move in (Move(), *moves):
                lines += _across(face, about, (0j, move.factor * along), index)
        loops, more = _cornered_loops(body, regions[index], along, about)
        drawn.append(regions[index]._replace(loops=loops))
        lines += more
    return DividedRegions([*drawn, *regions[len(faces) :]], lines)


def _halved(
    layout: Layout, regions: list[Region], faces: Sequence[Any], move: Move
) -> DividedRegions:
    """Divide the regions of a plate for a mirror image."""
    lines = _mirror_line(layout, faces, move)
    drawn = list[Region]()
    for body, region in zip(layout.bodies, regions, strict=False):
        loops, more = _cornered_loops(body, region, cmath.sqrt(move.factor), None)
        drawn.append(region._replace(loops=loops))
        lines += more
    return DividedRegions([*drawn, *regions[len(faces) :]], lines)


def _mirror_line(
    layout: Layout,
    faces: Sequence[Any],
    move: Move,
) -> list[Line]:
    """Return the pieces of the line of a mirror image in the plate."""
    plate = shapely.union_all([*faces, *map(joint_polygon, layout.joints)])
    along = cmath.sqrt(move.factor)
    centre = _centroid(plate)
    return list(_across(plate, (centre + move(centre)) / 2, (-along, along), None))


def _cornered_loops(
    body: Body, region: Region, along: complex, about: complex | None
) -> tuple[list[Sequence[Any]], list[Line]]:
    """Return the loops of a body, round ones with one corner that moves keep, and lines in holes.

    A line inside the hole divides it, because gmsh copies no closed circle. The lines between
    sectors already divide circles about their centre.

    along : direction of a corner of circles about the centre, and of all for a mirror image.
    about : centre of rotations, None for a mirror image.
    """
    cuts = shapely.union_all([shapely.Polygon(polygon_points(cut)) for cut in region.cuts])
    loops = list(region.loops)
    lines = list[Line]()
    for number, loop in enumerate((body.outline, *body.holes)):
        circle = circle_of(loop)
        if circle is None or shapely.LinearRing(polygon_points(loop)).intersects(cuts):
            continue
        centre, radius = circle
        centred = about is not None and abs(centre - about) < TOUCHING
        way = along
        if about is not None and not centred:
            way = (centre - about) / abs(centre - about)
        corner = centre + radius * way
        opposite = centre - radius * way
        loops[number] = [Segment(corner, corner, centre)]
        if number and not centred:
            lines.append(Line(DIVIDING, Segment(opposite, opposite + BEYOND * way), None))
    return loops, lines


def _centroid(face: Any) -> complex:
    return complex(face.centroid.x, face.centroid.y)


def _across(
    face: Any, about: complex, ways: tuple[complex, complex], region: int | None
) -> Iterator[Line]:
    """Yield the lines across a polygon between two directions from a point.

    They end a little beyond its edges.
    """
    ends = [about + face.convex_hull.length * way for way in ways]
    ray = shapely.LineString([(end.real, end.imag) for end in ends])
    pieces = shapely.get_parts(shapely.intersection(face.buffer(BEYOND), ray))
    for piece in filter(shapely.length, pieces):
        yield Line(DIVIDING, Segment(*(complex(*point) for point in piece.coords)), region)


def _between_hinges(
    layout: Layout,
    index: int,
    about: complex,
    turns: int,
) -> complex:
    """Return a direction from the centre between the hinges of a body, by the widest angle."""
    sector = 2 * np.pi / turns
    places = [joint.place - about for joint in layout.joints if index in joint.bodies]
    at = np.sort(np.angle(places or [1.0]) % sector)
    gaps = np.diff([*at, at[0] + sector])
    return cmath.exp(1j * float((at + gaps / 2)[np.argmax(gaps)]))
