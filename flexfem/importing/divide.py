"""A plate divided at its hinges.

The edges of its bodies follow the drawing, and cross the metal at ends of hinges."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
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
    """A part of a loop between two positions.

    Positions are indices of segments plus shares of their lengths.
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

    @property
    def stretches(self) -> tuple[Stretch, Stretch]:
        """Both parts of the edge."""
        return self.right, self.left


class Edges:
    """The closed loops of a plate, with the metal to their left."""

    def __init__(self, loops: Sequence[Sequence[Segment]]) -> None:
        self.loops = loops
        self._ends = [np.array([segment[:2] for segment in loop]) for loop in loops]
        self._arcs = [np.array([segment.centre is not None for segment in loop]) for loop in loops]

    def position(
        self,
        loop: int,
        z: complex,
    ) -> tuple[float, float]:
        """Return the position on a loop that is nearest to a point, and its distance, mm."""
        start, end = self._ends[loop].T
        chords = np.abs(end - start)
        share = np.clip(((z - start) / (end - start)).real, 0.0, 1.0)
        distance = np.abs(z - start - share * (end - start))
        slack = np.where(self._arcs[loop], chords, TOUCHING)
        best = np.inf
        at = 0.0
        for index in np.flatnonzero(distance <= distance.min() + slack).tolist():
            segment = self.loops[loop][index]
            nearest = min(max(float(segment.shares(np.asarray(z))), 0.0), 1.0)
            away = abs(complex(segment.at(nearest)) - z)
            if away < best:
                best = away
                at = index + nearest
        return at % len(self.loops[loop]), best

    def stretch(self, stretch: Stretch) -> list[Segment]:
        """Return the segments of a part of a loop, in its sense."""
        segments = self.loops[stretch.loop]
        count = len(segments)
        if abs(stretch.end - stretch.start) < SAME:
            return []
        last = stretch.end if stretch.end > stretch.start else stretch.end + count
        found = list[Segment]()
        index = int(stretch.start)
        while index < last:
            low = max(stretch.start - index, 0.0)
            high = min(last - index, 1.0)
            piece = part(segments[index % count], low, high)
            if high > low and piece.length > SHORTEST:
                found.append(piece)
            index += 1
        return found


def cut_of(
    edges: Edges,
    neck: Neck,
    fit: Fit,
) -> Cut | None:
    """Return the hinge with the parts of the edge that it takes.

    None where they do not enclose it.
    """
    first, second, third, fourth = map(fit.frame.out, corners_of(fit.profile))
    right = _stretch_at(edges, neck.right.loop, first, second)
    left = _stretch_at(edges, neck.left.loop, third, fourth)
    if right is None or left is None:
        return None
    drawn = [
        *edges.stretch(right),
        Segment(second, third),
        *edges.stretch(left),
        Segment(fourth, first),
    ]
    x, weights = fit.profile.quadrature
    fitted = float(weights @ fit.profile.height(x))
    if abs(area(drawn) - fitted) > 2 * ALLOWED * fit.profile.length:
        return None
    return Cut(neck, fit, right, left, (first, second, third, fourth))


def _stretch_at(
    edges: Edges,
    loop: int,
    start: complex,
    end: complex,
) -> Stretch | None:
    """Return the part of a loop between two points, None where one of them is off the loop."""
    first, first_distance = edges.position(loop, start)
    last, last_distance = edges.position(loop, end)
    if max(first_distance, last_distance) > TOUCHING:
        return None
    return Stretch(loop, first, last)


def _contains(stretch: Stretch, position: float) -> bool:
    first = stretch.start + APART
    last = stretch.end - APART
    if stretch.start <= stretch.end:
        return first < position < last
    return position > first or position < last


def overlap(cut: Cut, others: Sequence[Cut]) -> bool:
    """Return whether a hinge takes a part of the edge that another one takes."""
    taken = [stretch for other in others for stretch in other.stretches]
    return any(_overlap(one, other) for one in cut.stretches for other in taken)


class Divided(NamedTuple):
    """Bodies, and the two that every hinge connects, `NOTHING` between two hinges that touch."""

    bodies: list[FoundBody]
    between: list[tuple[int, int]]


def _overlap(one: Stretch, other: Stretch) -> bool:
    if one.loop != other.loop:
        return False
    return (
        one == other
        or _contains(one, other.start)
        or _contains(one, other.end)
        or _contains(other, one.start)
        or _contains(other, one.end)
    )


def divided(edges: Edges, cuts: Sequence[Cut]) -> Divided:
    """Return the bodies of a plate that is divided at hinges."""
    loops, at_ends = _traced(edges, cuts)
    taken = {stretch.loop for cut in cuts for stretch in cut.stretches}
    loops += [list(loop) for k, loop in enumerate(edges.loops) if k not in taken]
    bodies, body_of = _bodies(loops)
    between = [(body_of[at_ends[k, NEAR]], body_of[at_ends[k, FAR]]) for k in range(len(cuts))]
    return Divided(bodies, between)


def _bodies(loops: Sequence[Sequence[Segment]]) -> tuple[list[FoundBody], list[int]]:
    """Return the bodies that loops enclose, and the body of each loop, `NOTHING` without one."""
    sizes = [area(loop) for loop in loops]
    outside = [loop for loop, size in zip(loops, sizes, strict=True) if size > EMPTY]
    faces = [shapely.Polygon(polygon_points(loop, STEP)) for loop in outside]
    shapely.prepare(faces)
    holes: list[list[tuple[Segment, ...]]] = [[] for _ in outside]
    body_of = list[int]()
    number = 0
    for loop, size in zip(loops, sizes, strict=True):
        if size > EMPTY:
            body_of.append(number)
            number += 1
        elif size >= -EMPTY:
            body_of.append(NOTHING)
        else:
            body = _body_around(complex(loop[0].at(0.5)), faces)
            body_of.append(body)
            if body != NOTHING:
                holes[body].append(tuple(loop))
    bodies = [
        FoundBody(tuple(loop), tuple(inside)) for loop, inside in zip(outside, holes, strict=True)
    ]
    return bodies, body_of


def _body_around(z: complex, faces: Sequence[shapely.Polygon]) -> int:
    """Return the smallest face around a point, `NOTHING` without one."""
    inside = [n for n, face in enumerate(faces) if shapely.contains_xy(face, z.real, z.imag)]
    return min(inside, key=lambda n: faces[n].area, default=NOTHING)


class _Event(NamedTuple):
    """Position on a loop at which it comes to an end of a hinge."""

    position: float
    hinge: int
    end: int


def _traced(
    edges: Edges, cuts: Sequence[Cut]
) -> tuple[list[list[Segment]], dict[tuple[int, int], int]]:
    """Return the loops around bodies that hinges cut, and the loop at each end of every hinge."""
    events = defaultdict[int, list[_Event]](list)
    for k, cut in enumerate(cuts):
        events[cut.right.loop].append(_Event(cut.right.start, k, NEAR))
        events[cut.left.loop].append(_Event(cut.left.start, k, FAR))
    for on_loop in events.values():
        on_loop.sort()
    loops = list[list[Segment]]()
    at_ends = dict[tuple[int, int], int]()
    for first in range(len(cuts)):
        for first_end in (NEAR, FAR):
            path = list[Segment]()
            k = first
            end = first_end
            while (k, end) not in at_ends:
                at_ends[k, end] = len(loops)
                piece, k, end = _to_next_hinge(edges, cuts, events, k, end)
                path += piece
            if path:
                loops.append(joined(path))
    return loops, at_ends


def _to_next_hinge(
    edges: Edges, cuts: Sequence[Cut], events: Mapping[int, list[_Event]], k: int, end: int
) -> tuple[list[Segment], int, int]:
    """Follow the edge of a body from an end of a hinge to the next one, and across that.

    Returns the path, and the hinge and the end at which it comes.
    """
    leaving = cuts[k].left if end == NEAR else cuts[k].right
    corner = cuts[k].corners[3] if end == NEAR else cuts[k].corners[1]
    ahead = events[leaving.loop]
    following = next((each for each in ahead if each.position >= leaving.end - SAME), ahead[0])
    first, second, third, fourth = cuts[following.hinge].corners
    arrival, across = (first, fourth) if following.end == NEAR else (third, second)
    drawn = edges.stretch(Stretch(leaving.loop, leaving.end, following.position))
    path = [*_from_to(drawn, corner, arrival), Segment(arrival, across)]
    return path, following.hinge, following.end


def _from_to(
    path: list[Segment],
    start: complex,
    end: complex,
) -> list[Segment]:
    """Return a path whose first and last point are moved to others near them."""
    if not path:
        return [Segment(start, end)] if abs(end - start) > SHORTEST else []
    path = [*path]
    path[0] = _moved(path[0], start, path[0].end)
    path[-1] = _moved(path[-1], path[-1].start, end)
    return path


def _moved(
    segment: Segment,
    start: complex,
    end: complex,
) -> Segment:
    """Return a segment between other ends near its own; an arc keeps the angle that it turns."""
    if segment.centre is None:
        return Segment(start, end)
    factor = (end - start) / (segment.end - segment.start)
    return Segment(start, end, start + (segment.centre - segment.start) * factor)
