"""Outlines of lines and circular arcs: exact area, and polygons for the checks. Points are complex numbers, in mm."""

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
    """A region to mesh, such as one body of a third of the stage.

    loop : closed counter-clockwise loop of segments.
    labels : for each of them `ground`, `hub`, `neck base` and so on, `cut ahead` and `cut behind`
        (to the next thirds) or `free`.
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
