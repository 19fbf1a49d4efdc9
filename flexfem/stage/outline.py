"""Outlines of lines and circular arcs: exact area, polygons, strips along a path. Points are complex numbers, in mm."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray

SHORTEST = 1e-9  # mm; a wall of a notch as deep as its link has no length and is left out


class Segment(NamedTuple):
    """A line, or with a centre the circular arc (less than half a turn) from `start` to `end`."""

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

    def reversed(self) -> Segment:
        """The same curve walked the other way."""
        return Segment(self.end, self.start, self.centre)

    def turned(self, angle: float) -> Segment:
        """The same curve turned about the origin by `angle`, rad."""
        r = cmath.exp(1j * angle)
        return Segment(self.start * r, self.end * r, None if self.centre is None else self.centre * r)

    def points(self, step: float) -> AnyArray:
        """Points (n,), complex, from start (included) to end (excluded), one per `step` rad of arc."""
        if self.centre is None:
            return np.array([self.start])
        n = max(2, int(np.ceil(abs(self.turn) / step)))
        turned: AnyArray = np.exp(1j * self.turn * np.arange(n) / n)
        return self.centre + (self.start - self.centre) * turned


class Face(NamedTuple):
    """A region to mesh, such as one body of a sector of the stage.

    loop : closed counter-clockwise loop of segments.
    labels : for each of them `ground`, `hub`, `neck base` and so on, `cut ahead` and `cut behind`
        (to the next sectors) or `free`.
    """

    loop: list[Segment]
    labels: list[str]


def reverse(path: Sequence[Segment]) -> list[Segment]:
    """The path walked the other way."""
    return [segment.reversed() for segment in reversed(path)]


def polyline(*points: complex) -> list[Segment]:
    """Lines through the points, without those of no length."""
    return [Segment(a, b) for a, b in pairwise(points) if abs(b - a) > SHORTEST]


def area(loop: Sequence[Segment]) -> float:
    """Exact area enclosed by a closed counter-clockwise loop, mm^2.

    Notes
    -----
    Green's theorem: the polygon of the end points, and for each arc its circular segment `r^2 (turn - sin turn) / 2`.
    """
    total = 0.0
    for s in loop:
        total += (s.start.conjugate() * s.end).imag / 2.0
        if s.centre is not None:
            total += abs(s.start - s.centre) ** 2 * (s.turn - np.sin(s.turn)) / 2.0
    return total


def polygon_points(loop: Sequence[Segment], step: float = np.pi / 64) -> AnyArray:
    """Vertices (n, 2) of a polygon that follows the loop with one vertex per `step` rad of arc."""
    z = np.concatenate([segment.points(step) for segment in loop])
    return np.column_stack([z.real, z.imag])


TIGHTEST_TURN = np.deg2rad(170.0)


class Pose(NamedTuple):
    """A point (complex, mm) and a heading (rad)."""

    point: complex
    heading: float

    def ahead(self, distance: float) -> Pose:
        """The pose moved straight along its heading."""
        return Pose(self.point + distance * cmath.exp(1j * self.heading), self.heading)


def shortest_path(start: Pose, end: Pose, radius: float) -> list[Segment] | None:
    """Shortest arc-line-arc path between two poses with arcs of one radius; None when every one makes a loop.

    Notes
    -----
    L. E. Dubins, Am. J. Math. 79 (1957) 497: of its candidates the four with a straight middle piece.
    """
    found = [(length, path) for a in (1, -1) for b in (1, -1) for length, path in _candidate(start, end, radius, a, b)]
    return min(found, key=lambda item: item[0])[1] if found else None


def _candidate(start: Pose, end: Pose, radius: float, first: int, last: int) -> list[tuple[float, list[Segment]]]:
    """Path that turns to the side `first`, goes straight, turns to `last` (1 left, -1 right), with its length."""
    c0 = start.point + 1j * first * radius * cmath.exp(1j * start.heading)
    c1 = end.point + 1j * last * radius * cmath.exp(1j * end.heading)
    offset = radius * (first - last)
    straight_squared = abs(c1 - c0) ** 2 - offset**2
    if straight_squared < SHORTEST**2:
        return []
    straight = float(np.sqrt(straight_squared))
    heading = cmath.phase((c1 - c0) / complex(straight, -offset))
    turns = [_wrap(first * (heading - start.heading)), _wrap(last * (end.heading - heading))]
    if max(turns) > TIGHTEST_TURN:
        return []
    leave = c0 - 1j * first * radius * cmath.exp(1j * heading)
    arrive = c1 - 1j * last * radius * cmath.exp(1j * heading)
    pieces = [Segment(start.point, leave, c0), Segment(leave, arrive), Segment(arrive, end.point, c1)]
    return [(radius * sum(turns) + straight, [s for s in pieces if s.length > SHORTEST])]


def _wrap(angle: float) -> float:
    """The angle in [0, 2 pi), a full turn less round-off counted as none."""
    wrapped = angle % (2 * np.pi)
    return 0.0 if 2 * np.pi - wrapped < 1e-9 else float(wrapped)


def offset(path: Sequence[Segment], distance: float) -> list[Segment]:
    """The path moved to its left by `distance`, mm (to its right when negative); lines and arcs stay lines and arcs."""
    return [_offset_segment(segment, distance) for segment in path]


def _offset_segment(segment: Segment, distance: float) -> Segment:
    if segment.centre is None:
        shift = 1j * distance * (segment.end - segment.start) / segment.length
        return Segment(segment.start + shift, segment.end + shift)
    scale = 1 - distance * np.sign(segment.turn) / abs(segment.start - segment.centre)
    ends = [segment.centre + scale * (p - segment.centre) for p in (segment.start, segment.end)]
    return Segment(ends[0], ends[1], segment.centre)
