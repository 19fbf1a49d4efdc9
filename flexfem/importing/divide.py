"""A plate divided at its hinges: the edges of its bodies follow the drawing, and cross the metal at
ends of hinges.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from flexfem.importing.found import FoundBody
from flexfem.importing.necks import Neck
from flexfem.importing.shapes import ALLOWED, Fit, corners_of
from flexfem.importing.strips import joined, part
from flexfem.mechanism.outlines import SHORTEST, Segment, area, polygon_points

STEP = np.pi / 256  # rad of arc per vertex of the polygons that contain holes
EMPTY = 1e-9  # mm^2, up to which a loop encloses nothing
NOTHING = -1  # in place of a body, at a hinge that ends at another one
APART = 1e-6  # between two positions, above which two hinges overlap
SAME = 1e-9  # between two positions
TOUCHING = 2e-3  # mm, of the corner of a hinge from the drawn edge
NEAR = 0
FAR = 1  # ends of a hinge at its first and its second body


class Stretch(NamedTuple):
    """A part of a loop between two positions, which are indices of segments plus shares of their
    lengths.
    """

    loop: int
    start: float
    end: float


class Cut(NamedTuple):
    """A hinge and the parts of the edge of the plate that it takes.

    right : from its first to its second body.   left : back.
    corners : at the start and the end of `right` and of `left`, mm.
    """

    neck: Neck
    fit: Fit
    right: Stretch
    left: Stretch
    corners: tuple[complex, complex, complex, complex]


class Edges:
    """The closed loops of a plate, with the metal to their left, and the distances of points from
    them.
    """

    def __init__(self, loops: Sequence[Sequence[Segment]]) -> None:
        self.loops = loops
        self._ends = [np.array([segment[:2] for segment in loop]) for loop in loops]
        self._arcs = [np.array([segment.centre is not None for segment in loop]) for loop in loops]

    def position(self, loop: int, z: complex) -> tuple[float, float]:
        """Return the position on a loop that is nearest to a point, and its distance, mm."""
        start, end = self._ends[loop].T
        share = np.clip(((z - start) / (end - start)).real, 0.0, 1.0)
        distance = np.abs(z - start - share * (end - start))
        chords = np.abs(end - start)
        near = np.flatnonzero(
            distance <= distance.min() + np.where(self._arcs[loop], chords, TOUCHING)
        )
        best = np.inf
        at = 0.0
        for index in near.tolist():
            segment = self.loops[loop][index]
            share_there = min(max(float(segment.shares(np.asarray(z))), 0.0), 1.0)
            away = abs(complex(segment.at(share_there)) - z)
            if away < best:
                best = away
                at = index + share_there
        return at % len(self.loops[loop]), best

    def stretch(self, loop: int, start: float, end: float) -> list[Segment]:
        """Return the segments of a loop between two positions, in its sense."""
        segments = self.loops[loop]
        count = len(self.loops[loop])
        if abs(end - start) < SAME:
            return []
        last = end if end > start else end + count
        found = list[Segment]()
        index = int(start)
        while index < last:
            low = max(start - index, 0.0)
            high = min(last - index, 1.0)
            piece = part(segments[index % count], low, high)
            if high > low and piece.length > SHORTEST:
                found.append(piece)
            index += 1
        return found


def cut_of(edges: Edges, neck: Neck, fit: Fit) -> Cut | None:
    """Return the hinge with the parts of the edge that it takes, None where they do not enclose it."""
    first, second, third, fourth = map(fit.frame.out, corners_of(fit.profile))
    corners = (first, second, third, fourth)
    on = [
        edges.position(place.loop, z)
        for place, z in zip((neck.right,) * 2 + (neck.left,) * 2, corners, strict=True)
    ]
    if max(distance for _, distance in on) > TOUCHING:
        return None
    positions = [position for position, _ in on]
    right = Stretch(neck.right.loop, positions[0], positions[1])
    left = Stretch(neck.left.loop, positions[2], positions[3])
    drawn = [
        *edges.stretch(*right),
        Segment(second, third),
        *edges.stretch(*left),
        Segment(fourth, first),
    ]
    x, weights = fit.profile.quadrature
    most = ALLOWED * 2 * fit.profile.length
    if abs(area(drawn) - float(weights @ fit.profile.height(x))) > most:
        return None
    return Cut(neck, fit, right, left, corners)


def _contains(stretch: Stretch, position: float) -> bool:
    first = stretch.start + APART
    last = stretch.end - APART
    if stretch.start <= stretch.end:
        return first < position < last
    return position > first or position < last


def overlap(cut: Cut, others: Sequence[Cut]) -> bool:
    """Return whether a hinge takes a part of the edge that another one takes."""
    own = (cut.right, cut.left)
    for one in own:
        for other in (each for cut_ in others for each in (cut_.right, cut_.left)):
            if one.loop != other.loop:
                continue
            if any(_contains(one, at) for at in (other.start, other.end)):
                return True
            if any(_contains(other, at) for at in (one.start, one.end)):
                return True
            if (one.start, one.end) == (other.start, other.end):
                return True
    return False


class Divided(NamedTuple):
    """Bodies, and the two that every hinge connects, `NOTHING` between two hinges that touch."""

    bodies: list[FoundBody]
    between: list[tuple[int, int]]


def divided(edges: Edges, cuts: Sequence[Cut]) -> Divided:
    """Return the bodies of a plate that is divided at hinges."""
    loops, at_ends = _traced(edges, cuts)
    taken = {stretch.loop for cut in cuts for stretch in (cut.right, cut.left)}
    whole = [list(loop) for k, loop in enumerate(edges.loops) if k not in taken]
    every = [*loops, *whole]
    outside = [k for k, loop in enumerate(every) if area(loop) > EMPTY]
    faces = [shapely.Polygon(polygon_points(every[k], STEP)) for k in outside]
    shapely.prepare(faces)
    body_of = {k: NOTHING for k, loop in enumerate(every) if abs(area(loop)) <= EMPTY}
    body_of |= {k: number for number, k in enumerate(outside)}
    holes: list[list[tuple[Segment, ...]]] = [[] for _ in outside]
    for k, loop in enumerate(every):
        if k in body_of:
            continue
        z = complex(loop[0].at(0.5))
        inside = [n for n, face in enumerate(faces) if shapely.contains_xy(face, z.real, z.imag)]
        if not inside:
            body_of[k] = NOTHING
            continue
        number = min(inside, key=lambda n: faces[n].area)
        body_of[k] = number
        holes[number].append(tuple(loop))
    bodies = [FoundBody(tuple(every[k]), tuple(holes[n])) for n, k in enumerate(outside)]
    between = [(body_of[at_ends[k, NEAR]], body_of[at_ends[k, FAR]]) for k in range(len(cuts))]
    return Divided(bodies, between)


def _traced(
    edges: Edges, cuts: Sequence[Cut]
) -> tuple[list[list[Segment]], dict[tuple[int, int], int]]:
    """Return the loops around bodies that hinges cut, and the loop at each end of every hinge."""
    starts: dict[int, list[tuple[float, int, int]]] = {}
    for k, cut in enumerate(cuts):
        starts.setdefault(cut.right.loop, []).append((cut.right.start, k, NEAR))
        starts.setdefault(cut.left.loop, []).append((cut.left.start, k, FAR))
    for events in starts.values():
        events.sort()
    loops = list[list[Segment]]()
    at_ends = dict[tuple[int, int], int]()
    for first in ((k, end) for k in range(len(cuts)) for end in (NEAR, FAR)):
        path = list[Segment]()
        k, end = first
        while (k, end) not in at_ends:
            at_ends[k, end] = len(loops)
            cut = cuts[k]
            leaving = cut.left if end == NEAR else cut.right
            corner = cut.corners[3] if end == NEAR else cut.corners[1]
            events = starts[leaving.loop]
            stop, k, end = next(
                (each for each in events if each[0] >= leaving.end - SAME), events[0]
            )
            arrival, across = (
                (cuts[k].corners[0], cuts[k].corners[3])
                if end == NEAR
                else (cuts[k].corners[2], cuts[k].corners[1])
            )
            path += _from_to(edges.stretch(leaving.loop, leaving.end, stop), corner, arrival)
            path.append(Segment(arrival, across))
        if path:
            loops.append(joined(path))
    return loops, at_ends


def _from_to(path: list[Segment], start: complex, end: complex) -> list[Segment]:
    """Return a path whose first and last point are moved to others near them."""
    if not path:
        return [Segment(start, end)] if abs(end - start) > SHORTEST else []
    path = [*path]
    path[0] = _moved(path[0], start, path[0].end)
    path[-1] = _moved(path[-1], path[-1].start, end)
    return path


def _moved(segment: Segment, start: complex, end: complex) -> Segment:
    """Return a segment between other ends near its own; an arc keeps the angle that it turns."""
    if segment.centre is None:
        return Segment(start, end)
    factor = (end - start) / (segment.end - segment.start)
    return Segment(start, end, start + (segment.centre - segment.start) * factor)
