"""Outlines in the plane: lines and arcs, closed loops, their areas, and shortest paths.

Points are complex, mm.
The module imports nothing that reads a stage, so that the gmsh process loads quickly.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array

# mm; shorter segments are left out, such as the wall of a notch as deep as its link
SHORTEST = 1e-9
TIGHTEST_TURN = np.deg2rad(170.0)
LONGEST_ARC = np.deg2rad(120.0)  # turn of one segment of a longer arc
# on each line or arc of less than half a turn: exact to round-off
GAUSS = np.polynomial.legendre.leggauss(16)
TURN_ROUND_OFF = 1e-9  # rad, of the directions of two segments that join smoothly
BACK = 1e-6  # rad, of a corner from half a turn, at which an outline turns back


class Segment(NamedTuple):
    """A line from `start` to `end` or, with a centre, a circular arc of less than half a turn."""

    start: complex
    end: complex
    centre: complex | None = None

    @property
    def turn(self) -> float:
        """Angle swept about the centre, rad, counter-clockwise positive; zero for a line."""
        if self.centre is None:
            return 0.0
        return cmath.phase((self.end - self.centre) / (self.start - self.centre))

    @property
    def length(self) -> float:
        """Length, mm."""
        if self.centre is None:
            return abs(self.end - self.start)
        return abs(self.start - self.centre) * abs(self.turn)

    def at(self, share: ArrayLike) -> AnyArray:
        """Points (...), complex, at shares (...) of the length."""
        if self.centre is None:
            return np.asarray(self.start + np.multiply(share, self.end - self.start))
        return np.asarray(
            self.centre + (self.start - self.centre) * np.exp(1j * np.multiply(self.turn, share))
        )

    def tangent(self, share: ArrayLike) -> AnyArray:
        """Unit tangents (...), complex, at shares (...) of the length."""
        if self.centre is None:
            return np.full(np.shape(share), (self.end - self.start) / self.length)
        spoke = self.at(share) - self.centre
        return np.asarray(1j * np.sign(self.turn) * spoke / np.abs(spoke))

    def shares(self, points: AnyArray) -> Array:
        """Positions of points (...) projected on the curve: 0 at the start, 1 at the end."""
        if self.centre is None:
            return np.asarray(((points - self.start) / (self.end - self.start)).real)
        swept = np.angle(
            (points - self.centre) / (self.start - self.centre) * np.exp(-0.5j * self.turn)
        )
        return np.asarray(0.5 + swept / self.turn)

    def reversed(self) -> Segment:
        """Return the same curve in the opposite direction."""
        return Segment(self.end, self.start, self.centre)

    def turned(self, angle: float) -> Segment:
        """Return the curve rotated about the origin by `angle`, rad."""
        r = cmath.exp(1j * angle)
        return Segment(
            self.start * r, self.end * r, None if self.centre is None else self.centre * r
        )

    def offset(self, distance: float) -> Segment:
        """Return the curve offset to its left by `distance`, mm: a line, or an arc about the same
        centre.
        """
        start, end = (
            point + 1j * distance * complex(self.tangent(k)) for k, point in enumerate(self[:2])
        )
        return Segment(start, end, self.centre)

    def points(self, step: float) -> AnyArray:
        """Points (n,), complex, from start (included) to end (excluded), one per `step` rad of arc."""
        n = 1 if self.centre is None else max(2, int(np.ceil(abs(self.turn) / step)))
        return self.at(np.arange(n) / n)


class Face(NamedTuple):
    """A region to mesh, such as one body of a sector of the stage.

    loop : closed counter-clockwise loop of segments.
    labels : one per segment: `ground`, `hub`, `neck base` and so on, `cut ahead` and `cut behind`
    (to the adjacent
        sectors) or `free`.
    """

    loop: list[Segment]
    labels: list[str]


def reverse(path: Sequence[Segment]) -> list[Segment]:
    """Return the path in the opposite direction."""
    return [segment.reversed() for segment in reversed(path)]


def offset(path: Sequence[Segment], distance: float) -> list[Segment]:
    """Return the path offset to its left by `distance`, mm (to its right when negative)."""
    return [segment.offset(distance) for segment in path]


def polyline(*points: complex) -> list[Segment]:
    """Lines through the points, without lines of zero length."""
    return [Segment(a, b) for a, b in pairwise(points) if abs(b - a) > SHORTEST]


def bowed(
    start: complex,
    end: complex,
    bow: float,
) -> list[Segment]:
    """Circular arc from `start` to `end`, in parts of less than half a turn.

    Without a bow it is the line.

    bow : height of the arc over its chord, mm, positive to the right of the way from `start` to
    `end`, as the arc then
        turns to the left. Half the chord is a semicircle; a larger one is more than that.
    """
    if abs(bow) <= SHORTEST:
        return polyline(start, end)
    ahead = (end - start) / abs(end - start)
    half = abs(end - start) / 2
    centre = (start + end) / 2 + 1j * ahead * (half**2 - bow**2) / (2 * bow)
    turn = 4 * math.atan(bow / half)
    parts = math.ceil(abs(turn) / LONGEST_ARC)
    between = [
        centre + (start - centre) * cmath.exp(1j * turn * k / parts) for k in range(1, parts)
    ]
    return [Segment(a, b, centre) for a, b in pairwise([start, *between, end])]


class Outline(NamedTuple):
    """A closed counter-clockwise loop, and the indices of the segments on each side of the polygon,
    perhaps none.
    """

    loop: list[Segment]
    edges: list[tuple[int, ...]]


def rounded(
    corners: Sequence[complex], radii: Sequence[float], bows: Sequence[float] = ()
) -> Outline:
    """Polygon with fillets of `radii`, mm, 0 for none; the corners may go round in either sense.

    bows : mm, of the sides from each corner to the next, as `bowed`; 0 for a straight side.

    Raises ValueError with the index of a corner and the expectation that it misses.
    """
    n = len(corners)
    bows = bows or [0.0] * n
    following = [*corners[1:], corners[0]]
    for k, (corner, after) in enumerate(zip(corners, following, strict=True)):
        if abs(after - corner) <= SHORTEST:
            raise ValueError(k, "a corner that differs from the next")
    sides = [bowed(*side) for side in zip(corners, following, bows, strict=True)]
    if area([segment for side in sides for segment in side]) < 0:
        return _rounded_backwards(corners, radii, bows)
    return _with_fillets(sides, radii)


def _rounded_backwards(
    corners: Sequence[complex], radii: Sequence[float], bows: Sequence[float]
) -> Outline:
    """Return the outline of corners that go round clockwise. Raises ValueError as `rounded`."""
    n = len(corners)
    side_of = [(n - 2 - k) % n for k in range(n)]  # number of a side the other way round
    try:
        loop, edges = rounded(corners[::-1], radii[::-1], [-bows[side] for side in side_of])
    except ValueError as error:
        corner, expected = error.args
        raise ValueError(n - 1 - corner, expected) from None
    return Outline(loop, [edges[side] for side in side_of])


def _with_fillets(sides: Sequence[list[Segment]], radii: Sequence[float]) -> Outline:
    """Return the loop of sides with fillets at their starts. Raises ValueError as `rounded`."""
    tangents = _tangents(sides, radii)
    loop = list[Segment]()
    edges = list[tuple[int, ...]]()
    for k, side in enumerate(sides):
        end = (k + 1) % len(sides)
        ahead = complex(side[-1].tangent(1.0))
        start = side[0].start + tangents[k] * ahead
        stop = side[-1].end - tangents[end] * ahead
        kept = polyline(start, stop) if tangents[k] or tangents[end] else side
        edges.append(tuple(range(len(loop), len(loop) + len(kept))))
        loop += kept
        if tangents[end] > SHORTEST:
            after = complex(sides[end][0].tangent(0.0))
            centre = stop + 1j * ahead * math.copysign(radii[end], cmath.phase(after / ahead))
            beyond = sides[end][0].start + tangents[end] * after
            loop.append(Segment(stop if kept else start, beyond, centre))
    return Outline(loop, edges)


def _tangents(sides: Sequence[list[Segment]], radii: Sequence[float]) -> list[float]:
    """Return the lengths, mm, that the fillets take from the sides at each corner.

    Raises ValueError as `rounded`.
    """
    tangents = list[float]()
    for k, radius in enumerate(radii):
        before = sides[k - 1][-1]
        after = sides[k][0]
        turn = cmath.phase(complex(after.tangent(0.0)) / complex(before.tangent(1.0)))
        if abs(turn) > np.pi - BACK:
            raise ValueError(k, "a corner at which the outline does not turn back")
        if radius and (before.centre is not None or after.centre is not None):
            raise ValueError(
                k, "no fillet at the end of an arc; draw the fillet as an arc of its own"
            )
        tangents.append(radius * math.tan(abs(turn) / 2))
    for k, side in enumerate(sides):
        ends = (k, (k + 1) % len(sides))
        if sum(tangents[end] for end in ends) > side[0].length + SHORTEST:
            worst, other = sorted(ends, key=lambda end: -tangents[end])
            most = max(side[0].length - tangents[other], 0.0) * radii[worst] / tangents[worst]
            raise ValueError(
                worst, f"a fillet of at most {most:.4g} mm, together with that of the next corner"
            )
    return tangents


class _Flank(NamedTuple):
    """Corners of one side of a bar, complex, mm, and the radii of the fillets there, mm."""

    corners: list[complex]
    radii: list[float]


def bar(
    bends: Sequence[complex],
    radii: Sequence[float],
    width: float,
) -> Outline:
    """Bar of a width, mm, along a path, with `radii` of its centreline at the bends.

    The two edges of the outline are start and end.

    Raises ValueError with the index of a bend and the expectation that it misses.
    """
    n = len(bends)
    sides = [b - a for a, b in pairwise(bends)]
    for k, side in enumerate(sides):
        if abs(side) <= SHORTEST:
            raise ValueError(k, "a point apart from the next")
    ahead = [side / abs(side) for side in sides]
    right, left = _flanks(bends, radii, width, ahead)
    for k, direction in enumerate(ahead):
        for corners in (right.corners, left.corners):
            if ((corners[k + 1] - corners[k]) / direction).real <= SHORTEST:
                raise ValueError(k, "a longer distance to the next bend, or a smaller width")
    try:
        loop, edges = rounded(right.corners + left.corners[::-1], right.radii + left.radii[::-1])
    except ValueError as error:
        k = error.args[0]
        bend = k if k < n else 2 * n - 1 - k
        raise ValueError(bend, "a smaller radius, which fits between its neighbours") from None
    return Outline(loop, [edges[2 * n - 1], edges[n - 1]])


def _flanks(
    bends: Sequence[complex], radii: Sequence[float], width: float, ahead: Sequence[complex]
) -> tuple[_Flank, _Flank]:
    """Return the right and the left side of a bar. Raises ValueError for a bend that is too sharp.

    ahead : unit vectors from each bend to the next.
    """
    half = width / 2
    right = _Flank([], [])
    left = _Flank([], [])
    for k, (point, radius) in enumerate(zip(bends, radii, strict=True)):
        before = ahead[max(k - 1, 0)]
        after = ahead[min(k, len(ahead) - 1)]
        turn = cmath.phase(after / before)
        if abs(turn) > TIGHTEST_TURN:
            raise ValueError(k, "a bend of at most 170 degrees")
        aside = 1j * half * (before + after) / (1 + math.cos(turn))
        right.corners.append(point - aside)
        left.corners.append(point + aside)
        inner, outer = (left, right) if turn > 0 else (right, left)
        is_bent = radius and abs(turn) > TURN_ROUND_OFF
        inner.radii.append(max(radius - half, 0.0))
        outer.radii.append(radius + half if is_bent else 0.0)
    return right, left


def disc(centre: complex, radius: float) -> Outline:
    """Disc of four arcs."""
    rim = [centre + radius * 1j**k for k in range(5)]
    return Outline([Segment(a, b, centre) for a, b in pairwise(rim)], [])


def circle_of(loop: Sequence[Segment]) -> tuple[complex, float] | None:
    """Return centre and radius of a loop that is a circle, None of any other."""
    centre = loop[0].centre
    if centre is None or any(
        each.centre is None or abs(each.centre - centre) > SHORTEST for each in loop
    ):
        return None
    return centre, abs(loop[0].start - centre)


def area(loop: Sequence[Segment]) -> float:
    """Area enclosed by a closed counter-clockwise loop, mm^2: the polygon of the ends, and the
    circular segments.
    """
    polygon = sum((segment.start.conjugate() * segment.end).imag for segment in loop)
    arcs = ((abs(arc.start - arc.centre), arc.turn) for arc in loop if arc.centre is not None)
    return (polygon + sum(radius**2 * (turn - math.sin(turn)) for radius, turn in arcs)) / 2


def area_moments(loop: Iterable[Segment]) -> AnyArray:
    """Area integrals (5,) of 1, z, |z|^2, z^2 and |z|^2 z, mm^2 to mm^5, complex, of a closed
    counter-clockwise loop.

    By the divergence theorem, with `z = x + i y` and `w = x dy - y dx`, they equal the integrals
    along the loop times `w` over 2, 3, 4, 4 and 5.
    """
    share = (GAUSS[0] + 1) / 2
    weights = GAUSS[1] / 2
    parts = [
        (
            z := segment.at(share),
            weights * segment.length * (np.conj(z) * segment.tangent(share)).imag,
        )
        for segment in loop
    ]
    z, w = (np.concatenate(values) for values in zip(*parts, strict=True))
    return integrals(z, w / np.array([2, 3, 4, 4, 5])[:, None])


def inertia_of(moments: AnyArray, areal: Array | float) -> Array:
    """Mass matrix (..., 3, 3), tonne to tonne mm^2, of rigid bodies for a motion x, y, theta of the
    origin.

    moments : (..., 3), area integrals of 1, z and |z|^2, mm^2 to mm^4.   areal : (...), mass per
    area, tonne/mm^2.
    """
    values = np.moveaxis(moments * np.asarray(areal)[..., None], -1, 0)
    mass, x, second = values.real
    y = values[1].imag
    zero = np.zeros_like(mass)
    rows = [[mass, zero, -y], [zero, mass, x], [-y, x, second]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def integrals(z: AnyArray, weights: Array) -> AnyArray:
    """Integrals (5,) of 1, z, |z|^2, z^2 and |z|^2 z from points (n,), complex, and weights (5, n)
    or (n,).
    """
    square = np.abs(z) ** 2
    return np.asarray(
        np.sum(np.stack([np.ones_like(z), z, square, z**2, square * z]) * weights, axis=1)
    )


def polygon_points(loop: Sequence[Segment], step: float = np.pi / 64) -> AnyArray:
    """Vertices (n, 2) of a polygon that approximates the loop with one vertex per `step` rad of
    arc.
    """
    z = np.concatenate([segment.points(step) for segment in loop])
    return np.column_stack([z.real, z.imag])


class Pose(NamedTuple):
    """A point (complex, mm) and a heading (rad)."""

    point: complex
    heading: float

    def ahead(self, distance: float) -> Pose:
        """Return the pose moved along its heading by `distance`, mm."""
        return Pose(self.point + distance * cmath.exp(1j * self.heading), self.heading)


def shortest_path(
    start: Pose,
    end: Pose,
    radius: float,
) -> list[Segment] | None:
    """Shortest arc-line-arc path between two poses with arcs of one radius.

    None is returned if all such paths make a loop. L. E. Dubins, Am. J. Math. 79 (1957) 497: the
    four candidates with a straight middle piece, whose arcs turn to the left (1) or to the right
    (-1).
    """
    candidates = [
        _arc_line_arc(start, end, first * radius, last * radius)
        for first, last in product((1, -1), repeat=2)
    ]
    paths = [path for path in candidates if path is not None]
    if not paths:
        return None
    return min(paths, key=lambda path: path.length).segments


class _Path(NamedTuple):
    """A path with its length, mm."""

    length: float
    segments: list[Segment]


def _arc_line_arc(
    start: Pose,
    end: Pose,
    first: float,
    last: float,
) -> _Path | None:
    """Return the path with arcs of two radii, mm, positive to the left; None if it makes a loop."""
    c0 = start.point + 1j * first * cmath.exp(1j * start.heading)
    c1 = end.point + 1j * last * cmath.exp(1j * end.heading)
    aside = first - last
    straight_squared = abs(c1 - c0) ** 2 - aside**2
    if straight_squared < SHORTEST**2:
        return None
    straight = math.sqrt(straight_squared)
    heading = cmath.phase((c1 - c0) / complex(straight, -aside))
    leaving = _wrap(math.copysign(1, first) * (heading - start.heading))
    arriving = _wrap(math.copysign(1, last) * (end.heading - heading))
    if max(leaving, arriving) > TIGHTEST_TURN:
        return None
    leave = c0 - 1j * first * cmath.exp(1j * heading)
    arrive = c1 - 1j * last * cmath.exp(1j * heading)
    pieces = [
        Segment(start.point, leave, c0),
        Segment(leave, arrive),
        Segment(arrive, end.point, c1),
    ]
    length = abs(first) * (leaving + arriving) + straight
    return _Path(length, [piece for piece in pieces if piece.length > SHORTEST])


def _wrap(angle: float) -> float:
    """Return the angle in [0, 2 pi); a full turn within round-off becomes zero."""
    wrapped = angle % (2 * np.pi)
    return 0.0 if 2 * np.pi - wrapped < TURN_ROUND_OFF else float(wrapped)
