"""The two edges of a plate on both sides of a neck, up to where they leave a hinge.

The frame has its x axis along the hinge and its y axis to the left of it. Both edges are given as
left ones: the right edge is mirrored.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.importing.necks import Neck, Place
from flexfem.mechanism.edges import mapped
from flexfem.mechanism.layout import PointOrPoints
from flexfem.mechanism.outlines import SHORTEST, Segment

# Decrease of the slope at which an edge leaves a hinge; arcs that stand for curves have less.
CONVEX = math.radians(2.0)
CORNER = math.radians(2.0)  # increase of the slope that is a corner
WALL = math.radians(75.0)  # slope after a corner of an edge that is a side of a body
UPRIGHT = math.pi / 2
SLIGHT = 1e-5  # rad, of a slope: round-off of coordinates
CLOSE = 1e-3  # mm, up to which two ends are one
ONE_CENTRE = 1e-7  # mm, between the centres of arcs that are one
LONGEST_JOINED = 2.2  # rad, turn of an arc that is joined of others
STEEP_FLANK = math.radians(30.0)  # slope of a long straight edge that may be a side of a body


class Axis(NamedTuple):
    """Origin (complex, mm) and direction (rad) of the axis of a hinge."""

    place: complex
    heading: float

    def into(self, z: PointOrPoints) -> PointOrPoints:
        """Return a point in this frame."""
        return (z - self.place) * cmath.exp(-1j * self.heading)

    def out(self, z: PointOrPoints) -> PointOrPoints:
        """Return a point of this frame in the plate."""
        return self.place + z * cmath.exp(1j * self.heading)


class Way(NamedTuple):
    """An edge from a neck outwards, as the left edge in the direction of the way.

    segments : in the frame, turned and mirrored.   indices : of the segments of the loop.
    flank : number of segments before a long, steep and straight one.
    """

    segments: list[Segment]
    indices: list[int]
    flank: int

    @property
    def reach(self) -> float:
        """Distance, mm, of its end along the axis."""
        return self.segments[-1].end.real if self.segments else 0.0


class Strip(NamedTuple):
    """Both edges of a hinge between two positions on its axis, from the first to the second body.

    left, right : in the frame, the right one mirrored.   low, high : positions of the ends, mm.
    """

    frame: Axis
    left: list[Segment]
    right: list[Segment]
    low: float
    high: float

    @property
    def length(self) -> float:
        """Length along the axis, mm."""
        return self.high - self.low


def part(
    segment: Segment,
    first: float,
    last: float,
) -> Segment:
    """Return a part of a segment between two shares of its length."""
    start = segment.start if first == 0 else complex(segment.at(first))
    end = segment.end if last == 1 else complex(segment.at(last))
    return Segment(start, end, segment.centre)


def from_place(
    loop: Sequence[Segment],
    place: Place,
    sense: int,
) -> Iterator[tuple[Segment, int]]:
    """Yield the segments of a loop from a place on, with their indices.

    sense : 1 for that of the loop, -1 for the opposite one.
    """
    before = part(loop[place.segment], 0.0, place.share)
    after = part(loop[place.segment], place.share, 1.0)
    first, last = (after, before) if sense > 0 else (before.reversed(), after.reversed())
    yield first, place.segment
    for step in range(1, len(loop)):
        index = (place.segment + sense * step) % len(loop)
        yield (loop[index] if sense > 0 else loop[index].reversed()), index
    yield last, place.segment


def _slope(segment: Segment, share: float) -> float:
    return cmath.phase(complex(segment.tangent(share)))


def way_of(
    pieces: Iterator[tuple[Segment, int]], move: Callable[[complex], complex], wall: float
) -> Way:
    """Return the edge from a neck outwards, up to where it leaves the hinge.

    It does so where its slope decreases, at a corner beyond which it is steeper than `wall`, rad,
    and where it is upright.
    """
    segments = list[Segment]()
    indices = list[int]()
    steepest = -math.inf
    flank: int | None = None
    for piece, index in pieces:
        if piece.length <= SHORTEST:
            continue
        segment = mapped(piece, move)
        assert isinstance(segment, Segment)
        start = _slope(segment, 0.0)
        end = start + segment.turn
        is_wall = bool(segments) and start > max(wall, steepest + CORNER)
        is_convex = min(start, end) < steepest - CONVEX
        if is_convex or is_wall or start > UPRIGHT - SLIGHT:
            break
        if flank is None and _is_steep_flank(segment, start):
            flank = len(segments)
        indices.append(index)
        if end > UPRIGHT + SLIGHT:  # an arc that leaves the hinge where it is upright
            segments.append(part(segment, 0.0, (UPRIGHT - start) / segment.turn))
            break
        segments.append(segment)
        steepest = max(steepest, start, end)
    return Way(segments, indices, len(segments) if flank is None else flank)


class Ways(NamedTuple):
    """The four edges from a neck outwards: right and left, each forwards and backwards."""

    right_ahead: Way
    right_back: Way
    left_ahead: Way
    left_back: Way


def ways_of(
    loops: Sequence[Sequence[Segment]], neck: Neck, frame: Axis, wall: float = WALL
) -> Ways:
    """Return the edges from a neck outwards in a frame."""

    def move(
        along: int,
        across: int,
        z: complex,
    ) -> complex:
        w = frame.into(z)
        return complex(along * w.real, across * w.imag)

    found = list[Way]()
    for place, across in ((neck.right, -1), (neck.left, 1)):
        for along in (1, -1):
            pieces = from_place(loops[place.loop], place, -along * across)
            found.append(way_of(pieces, partial(move, along, across), wall))
    return Ways(*found)


def without_flanks(ways: Ways) -> Ways:
    """Return the edges up to long, steep and straight ones."""
    return Ways(*(way._replace(segments=way.segments[: way.flank]) for way in ways))


def strip_of(ways: Ways, frame: Axis) -> Strip | None:
    """Return both edges between the positions that both reach, None where these are one."""
    high = min(ways.right_ahead.reach, ways.left_ahead.reach)
    low = -min(ways.right_back.reach, ways.left_back.reach)
    if high - low <= CLOSE:
        return None
    left = clipped(_whole(ways.left_back, ways.left_ahead), low, high)
    right = clipped(_whole(ways.right_back, ways.right_ahead), low, high)
    return Strip(frame, left, right, low, high) if left and right else None


def _whole(back: Way, ahead: Way) -> list[Segment]:
    """Return an edge from its first to its last end; the segment with the neck is one."""
    first = [_mirrored(segment).reversed() for segment in reversed(back.segments)]
    return joined([*first, *ahead.segments])


def _mirrored(segment: Segment) -> Segment:
    centre = None if segment.centre is None else -segment.centre.conjugate()
    return Segment(-segment.start.conjugate(), -segment.end.conjugate(), centre)


def _is_steep_flank(segment: Segment, slope: float) -> bool:
    """Whether a segment is straight, steep and longer than its distance from the axis."""
    is_steep = segment.centre is None and slope > STEEP_FLANK
    return is_steep and segment.length > segment.start.imag


def joined(segments: Sequence[Segment]) -> list[Segment]:
    """Return a path in which segments that continue each other are one.

    They are lines, and short arcs about one centre.
    """
    found = list[Segment]()
    for segment in segments:
        last = found[-1] if found else None
        if last is not None and _continues(last, segment):
            found[-1] = Segment(last.start, segment.end, last.centre)
        else:
            found.append(segment)
    return found


def _continues(one: Segment, other: Segment) -> bool:
    if one.centre is not None and other.centre is not None:
        is_one_circle = abs(one.centre - other.centre) < ONE_CENTRE and one.turn * other.turn > 0
        return is_one_circle and abs(one.turn + other.turn) < LONGEST_JOINED
    if one.centre is not None or other.centre is not None:
        return False
    ahead = one.end - one.start
    along = other.end - one.start
    aside = (ahead * along.conjugate()).imag / abs(along)
    is_forward = (ahead * (other.end - other.start).conjugate()).real > 0
    return is_forward and abs(aside) < SHORTEST * 10


def clipped(
    edge: Sequence[Segment],
    low: float,
    high: float,
) -> list[Segment]:
    """Return the part of an edge between two positions on the axis.

    Ends nearly there are moved to them.
    """
    found = list[Segment]()
    for segment in edge:
        start = segment.start.real
        end = segment.end.real
        first = share_at(segment, low) if start < low - CLOSE else 0.0
        last = share_at(segment, high) if end > high + CLOSE else 1.0
        if last > first and end > low + SHORTEST and start < high - SHORTEST:
            found.append(part(segment, first, last))
    return found


def share_at(segment: Segment, x: float) -> float:
    """Return the share of the length of a segment at which it passes a position on the axis."""
    if segment.centre is None:
        return (x - segment.start.real) / (segment.end.real - segment.start.real)
    radius = abs(segment.start - segment.centre)
    aside = x - segment.centre.real
    high = math.sqrt(max(radius**2 - aside**2, 0.0))
    places = [segment.centre + complex(aside, side * high) for side in (-1, 1)]
    shares = [float(segment.shares(np.asarray(place))) for place in places]
    return min(max(min(shares, key=lambda share: abs(share - 0.5)), 0.0), 1.0)


def height_at(edge: Sequence[Segment], x: Array) -> Array:
    """Return the distances (...) of an edge from the axis at positions (...) on it, mm."""
    found = np.full(np.shape(x), np.nan)
    for segment in edge:
        low = segment.start.real
        high = segment.end.real
        inside = (x >= low - CLOSE) & (x <= high + CLOSE) & np.isnan(found)
        if not inside.any():
            continue
        nearest = np.clip(x[inside], low, high)
        if segment.centre is None:
            rise = (segment.end.imag - segment.start.imag) / (high - low) if high > low else 0.0
            found[inside] = segment.start.imag + rise * (nearest - low)
        else:
            radius = abs(segment.start - segment.centre)
            aside = nearest - segment.centre.real
            side = -math.copysign(1.0, segment.turn)
            upwards = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
            found[inside] = segment.centre.imag + side * upwards
    return found


def vertices(edge: Sequence[Segment]) -> list[complex]:
    """Return the ends of the segments of an edge."""
    return [edge[0].start, *(segment.end for segment in edge)] if edge else []


def turns_in(edge: Sequence[Segment]) -> list[float]:
    """Return the turns, rad, between the segments of an edge."""
    return [_slope(after, 0.0) - _slope(before, 1.0) for before, after in pairwise(edge)]
