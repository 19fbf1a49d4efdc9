"""Narrow places between wide parts of a plate, by Delaunay triangles of points on its edge.

A side of a triangle that crosses the metal is a chord: half its length is the radius of a disc that
just passes there. The metal is flooded from the widest chords on. Where two parts meet at a chord
that is several times narrower than the widest chords of both, they are two bodies and the chord
lies in a hinge. Otherwise they become one part. Every hinge is so compared with what it connects,
whatever the size of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from flexfem.arrays import AnyArray, Array, Index
from flexfem.mechanism.outlines import Segment

NARROWER = 1.5  # width of the narrower of two parts per chord between them, for a hinge
ROUNDS = 14  # in which points are added, each time in the middle between two
PER_WIDTH = 1.0  # distance of points on the edge per width of the metal there
FEW = 2e-4  # points per point from which it is too far to the next, that are left as they are
AROUND = 3.0  # way along the edge between two points per distance, below which they face no metal
PER_EXTENT = 1 / 60  # distance of the first points, per extent of the plate
FIRST_TURN = np.pi / 12  # of an arc between two of the first points
AUXILIARY = 4  # points around the plate
BEYOND = 2.0  # their distance, per extent


class Place(NamedTuple):
    """A point of the edge of a plate: `share` of the length of segment `segment` of loop `loop`."""

    loop: int
    segment: int
    share: float


class Neck(NamedTuple):
    """A chord in a narrow part of the metal: two places of the edge, and its length, mm.

    beyond : mm, longest chord of the narrower of the two parts that it connects.
    chord : its index.
    """

    right: Place
    left: Place
    width: float
    beyond: float
    chord: int


class Triangles(NamedTuple):
    """Triangles of the metal between points of its edge.

    points : (n,), complex, mm.   corners : (t, 3), counter-clockwise.
    chords : (c, 2), the two points of every side that crosses the metal.
    beside : (c, 2), the triangles at it.   lengths : (c,), mm, of the chords.
    loop, segment, share : (n,), the place of every point.
    """

    points: AnyArray
    corners: Index
    chords: Index
    beside: Index
    lengths: Array
    loop: Index
    segment: Index
    share: Array

    def place(self, point: int) -> Place:
        """Return the place of a point."""
        return Place(int(self.loop[point]), int(self.segment[point]), float(self.share[point]))


class _Edge:
    """The segments of all loops as arrays, and points on them in the order of the loops."""

    def __init__(self, loops: Sequence[Sequence[Segment]]) -> None:
        segments = [segment for loop in loops for segment in loop]
        self.start = np.array([segment.start for segment in segments])
        self.end = np.array([segment.end for segment in segments])
        self.is_arc = np.array([segment.centre is not None for segment in segments])
        self.centre = np.array([segment.centre or 0j for segment in segments])
        self.turn = np.array([segment.turn for segment in segments])
        self.length = np.array([segment.length for segment in segments])
        self.loop = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
        self.first = np.cumsum([0, *(len(loop) for loop in loops)])[:-1]
        self.extent = float(max(np.ptp(self.start.real), np.ptp(self.start.imag)))
        counts = np.ceil(self.length / (PER_EXTENT * self.extent))
        counts = np.maximum(counts, np.ceil(np.abs(self.turn) / FIRST_TURN)).astype(np.int64)
        self.segment = np.repeat(np.arange(len(segments)), counts)
        within = np.arange(len(self.segment)) - np.repeat(np.cumsum(counts) - counts, counts)
        self.share = within / counts[self.segment]

    @property
    def points(self) -> AnyArray:
        """Points (n,), complex, mm."""
        k = self.segment
        share = self.share
        line = self.start[k] + share * (self.end[k] - self.start[k])
        arc = self.centre[k] + (self.start[k] - self.centre[k]) * np.exp(1j * share * self.turn[k])
        return np.asarray(np.where(self.is_arc[k], arc, line))

    @property
    def following(self) -> Index:
        """Index (n,) of the point after each on its loop."""
        loop = self.loop[self.segment]
        first = np.searchsorted(loop, np.arange(len(self.first)))
        after = np.arange(1, len(loop) + 1)
        is_last = np.append(loop[1:] != loop[:-1], True)
        after[is_last] = first
        return after

    @property
    def steps(self) -> Array:
        """Length (n,), mm, of the edge from each point to the next."""
        following = np.append(self.share[1:], 0.0)
        following[np.append(self.segment[1:] != self.segment[:-1], True)] = 1.0
        return np.asarray((following - self.share) * self.length[self.segment])

    def halve(self, which: AnyArray) -> None:
        """Add the middle of the edge between each point of a selection (n,) and the next."""
        middle = self.share + self.steps / self.length[self.segment] / 2
        at = np.flatnonzero(which)
        self.share = np.insert(self.share, at + 1, middle[at])
        self.segment = np.insert(self.segment, at + 1, self.segment[at])


def triangles_of(loops: Sequence[Sequence[Segment]]) -> Triangles:
    """Return the triangles of the metal inside closed loops.

    Their points are as close as the metal is narrow.
    """
    edge = _Edge(loops)
    found, missing = _triangles(edge)
    for _ in range(ROUNDS - 1):
        coarse = missing | _too_coarse(edge, found)
        if not missing.any() and np.count_nonzero(coarse) <= FEW * len(coarse):
            break
        edge.halve(coarse)
        found, missing = _triangles(edge)
    return found


class _Sides(NamedTuple):
    """The sides (t, 3) of triangles, each opposite to a corner.

    start, end : points.
    ahead, behind : whether a side follows the edge of the plate in its sense, or against it.
    """

    start: Index
    end: Index
    ahead: AnyArray
    behind: AnyArray


def _sides(corners: Index, following: Index) -> _Sides:
    """Return the sides of triangles; the edge goes from each point (n,) to the following one."""
    start = corners[:, [1, 2, 0]]
    end = corners[:, [2, 0, 1]]
    after = np.append(following, [-1] * AUXILIARY)
    return _Sides(start, end, after[start] == end, after[end] == start)


def _triangles(edge: _Edge) -> tuple[Triangles, AnyArray]:
    """Return the triangles of the metal, and the points (n,) that none connects with the next."""
    points = edge.points
    around = np.mean(points) + BEYOND * edge.extent * 1j ** np.arange(AUXILIARY)
    z = np.append(points, around)
    delaunay = Delaunay(np.column_stack([z.real, z.imag]) - [z[0].real, z[0].imag])
    corners = delaunay.simplices.astype(np.int64)
    sides = _sides(corners, edge.following)
    missing = np.ones(len(points), dtype=bool)
    missing[sides.start[sides.ahead]] = False
    is_metal = _inside(delaunay.neighbors, sides) & np.all(corners < len(points), axis=1)
    beside, chords = _chords(delaunay.neighbors, sides, is_metal)
    loop = edge.loop[edge.segment]
    found = Triangles(
        points,
        corners[is_metal],
        chords,
        beside,
        np.abs(z[chords[:, 0]] - z[chords[:, 1]]),
        loop,
        edge.segment - edge.first[loop],
        edge.share,
    )
    return found, missing


def _too_coarse(edge: _Edge, found: Triangles) -> AnyArray:
    """Return the points (n,) from which it is too far to the next, for the width of the metal."""
    steps = edge.steps
    way = np.cumsum(steps) - steps
    total = np.bincount(found.loop, steps)
    first, second = found.chords.T
    apart = np.abs(way[first] - way[second])
    along = np.minimum(apart, total[found.loop[first]] - apart)
    facing = (found.loop[first] != found.loop[second]) | (along > AROUND * found.lengths)
    width = np.full(len(steps), np.inf)
    for ends in (first, second):
        np.minimum.at(width, ends[facing], found.lengths[facing])
    width = np.minimum(width, width[edge.following])
    return np.asarray(steps > PER_WIDTH * width)


class _Parts:
    """Sets of triangles that grow together, each with the length of its longest chord."""

    def __init__(self, widest: list[float]) -> None:
        self.of = list(range(len(widest)))
        self.widest = widest

    def find(self, triangle: int) -> int:
        """Return the number of the part of a triangle."""
        while self.of[triangle] != triangle:
            self.of[triangle] = self.of[self.of[triangle]]
            triangle = self.of[triangle]
        return triangle

    def join(
        self,
        one: int,
        other: int,
    ) -> None:
        """Make one part of two."""
        if self.widest[one] >= self.widest[other]:
            self.of[other] = one
        else:
            self.of[one] = other


def _chords(
    neighbours: Index,
    sides: _Sides,
    is_metal: AnyArray,
) -> tuple[Index, Index]:
    """Return the numbers (c, 2) of the triangles of metal at every chord, and its points (c, 2)."""
    index = np.arange(len(is_metal))[:, None]
    inside = is_metal[:, None] & is_metal[neighbours]
    triangle, side = np.nonzero(inside & ~sides.ahead & (index < neighbours))
    number = np.cumsum(is_metal) - 1
    beside = number[np.column_stack([triangle, neighbours[triangle, side]])]
    chords = np.column_stack([sides.start[triangle, side], sides.end[triangle, side]])
    return beside, chords


def _inside(neighbours: Index, sides: _Sides) -> AnyArray:
    """Return which triangles (t,) are metal.

    They are those to the left of the edge, and what they reach without crossing it.

    neighbours : (t, 3), indices of the triangles beside each one.
    """
    count = len(neighbours)
    on_edge = sides.ahead | sides.behind
    triangle, side = np.nonzero(~on_edge & (neighbours >= 0))
    links = sp.coo_array(
        (np.ones(len(triangle)), (triangle, neighbours[triangle, side])), shape=(count, count)
    )
    parts, part = connected_components(links, directed=False)
    votes = np.sum(sides.ahead, axis=1, dtype=float) - np.sum(sides.behind, axis=1)
    return np.asarray(np.bincount(part, votes, minlength=parts)[part] > 0)


def necks_of(found: Triangles, narrower: float = NARROWER) -> tuple[list[Neck], list[Neck]]:
    """Return the chords in hinges between two bodies, and in narrow places of one body.

    narrower : width of the narrower of two parts per width of the chord between them, from which
    they are two bodies.
    """
    widest = np.zeros(len(found.corners))
    for side in found.beside.T:
        np.maximum.at(widest, side, found.lengths)
    parts = _Parts(widest.tolist())
    closing = list[Neck]()
    between = list[Neck]()
    beside = found.beside.tolist()
    lengths = found.lengths.tolist()
    for chord in np.argsort(-found.lengths).tolist():
        one, other = map(parts.find, beside[chord])
        beyond = min(parts.widest[one], parts.widest[other])
        if beyond > narrower * lengths[chord]:
            kind = closing if one == other else between
            kind.append(_neck(found, chord, beyond))
        elif one != other:
            parts.join(one, other)
    separate = list[Neck]()
    for neck in between:
        one, other = map(parts.find, beside[neck.chord])
        if one != other:
            separate.append(neck)
    return separate, closing


def _neck(
    found: Triangles,
    chord: int,
    beyond: float,
) -> Neck:
    first, second = found.chords[chord].tolist()
    return Neck(found.place(first), found.place(second), float(found.lengths[chord]), beyond, chord)
