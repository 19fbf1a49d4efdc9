"""A link's body: a strip of constant width along a path of lines and arcs from one neck to the next."""

from __future__ import annotations

import cmath
from typing import NamedTuple

import numpy as np

from flexfem.stage.outline import SHORTEST, Segment

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


def offset(path: list[Segment], distance: float) -> list[Segment]:
    """The path moved to its left by `distance`, mm (to its right when negative); lines and arcs stay lines and arcs."""
    return [_offset_segment(segment, distance) for segment in path]


def _offset_segment(segment: Segment, distance: float) -> Segment:
    if segment.centre is None:
        shift = 1j * distance * (segment.end - segment.start) / segment.length
        return Segment(segment.start + shift, segment.end + shift)
    scale = 1 - distance * np.sign(segment.turn) / abs(segment.start - segment.centre)
    ends = [segment.centre + scale * (p - segment.centre) for p in (segment.start, segment.end)]
    return Segment(ends[0], ends[1], segment.centre)
