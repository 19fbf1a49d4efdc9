"""Boundaries of plane faces as lines and arcs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.outlines import Segment, area, reverse
from flexfem.meshing.requests import PlateContours
from flexfem.meshing.session import gmsh_session
from flexfem.meshing.shapes import SAME_POINT, draw_union

CURVE_ERROR = 1e-4  # mm; of arcs in place of another curve
LONGEST_TURN = 2.5  # rad, of an arc of a contour
MOST_ARCS = 1000  # in place of one curve
ON_LINE = 1e-9  # sine of the angle between two chords, below which three points are on a line


def contours_of(job: PlateContours) -> list[list[Segment]]:
    """Return the boundary of the union of regions as closed loops of lines and arcs.

    They are counter-clockwise, around holes clockwise. Those of a connected part follow each other,
    the outer first."""
    with gmsh_session() as gmsh:
        union = draw_union(gmsh.model.occ, job.regions)
        gmsh.model.occ.synchronize()
        return contours_of_faces(gmsh.model, union)


def contours_of_faces(
    model: Any, faces: Sequence[tuple[int, int]], most: float = CURVE_ERROR
) -> list[list[Segment]]:
    """Return the contours of plane faces, as `contours_of`.

    most : mm, distance of arcs from other curves in place of which they are.
    """
    contours = list[list[Segment]]()
    for _, face in faces:
        tags_of = [tags.tolist() for tags in model.occ.getCurveLoops(face)[1]]
        loops = [_closed_loop(model, tags, most) for tags in tags_of]
        loops.sort(key=lambda loop: -abs(area(loop)))
        for number, loop in enumerate(loops):
            counter_clockwise = number == 0
            contours.append(loop if (area(loop) > 0) == counter_clockwise else reverse(loop))
    return contours


def _closed_loop(
    model: Any,
    tags: Sequence[int],
    most: float,
) -> list[Segment]:
    """Return the curves with these tags as lines and arcs, each from where the one before ends."""
    ends = {tag: model.getBoundary([(1, tag)], combined=False, oriented=False) for tag in tags}
    at = ends[tags[0]][0]
    loop = list[Segment]()
    while ends:
        tag = next(tag for tag, pair in ends.items() if at in pair)
        first, *last = ends.pop(tag)
        arcs = _arcs(model, tag, most)
        if at == first:
            loop += arcs
            at = last[0] if last else first
        else:
            loop += reverse(arcs)
            at = first
    return loop


class _CurveOnModel(NamedTuple):
    """A curve of gmsh between two parameters."""

    model: Any
    tag: int
    low: float
    high: float

    def points(self, shares: AnyArray) -> AnyArray:
        """Return its points (n,), complex, mm, at shares of its parameter."""
        return self._values(self.model.getValue, shares)

    def slopes(self, shares: AnyArray) -> AnyArray:
        """Return the derivatives (n,) by the parameter, complex."""
        return self._values(self.model.getDerivative, shares)

    def _values(
        self,
        of: Any,
        shares: AnyArray,
    ) -> AnyArray:
        parameters = self.low + (self.high - self.low) * shares
        x, y, _ = np.reshape(of(1, self.tag, parameters), (-1, 3)).T
        return np.asarray(x + 1j * y)


def _arcs(
    model: Any,
    tag: int,
    most: float,
) -> list[Segment]:
    """Return a curve as lines and arcs from its start to its end."""
    (low,), (high,) = model.getParametrizationBounds(1, tag)
    curve = _CurveOnModel(model, tag, low, high)
    shares = np.linspace(0, 1, 9)
    points = curve.points(shares)
    slopes = curve.slopes(shares)
    if np.ptp(slopes.real) + np.ptp(slopes.imag) < SAME_POINT:
        return [Segment(*points[[0, -1]].tolist())]
    for spokes in (1j * slopes, -1j * slopes):  # of a circle, whose parameter is the angle
        centre = np.mean(points + spokes)
        if np.max(np.abs(points + spokes - centre)) < SAME_POINT:
            count = int(np.ceil((high - low) / LONGEST_TURN))
            ends = curve.points(np.arange(count + 1) / count).tolist()
            return [Segment(a, b, complex(centre)) for a, b in pairwise(ends)]
    count = 4
    arcs, error = _arcs_through(curve, count)
    while error > most and 2 * count < MOST_ARCS:
        count *= 2
        arcs, error = _arcs_through(curve, count)
    return arcs


def _arcs_through(curve: _CurveOnModel, count: int) -> tuple[list[Segment], float]:
    """Return arcs or lines through points of a curve, and their distance from it, mm.

    Each goes through three points, and its distance is that of two points between them.
    """
    points = curve.points(np.arange(4 * count + 1) / (4 * count))
    start = points[:-1:4]
    end = points[4::4]
    centres, straight = _centres(start, points[2::4], end)
    between = np.stack([points[1::4], points[3::4]])
    chord = end - start
    from_line = np.abs(((between - start) / chord).imag * np.abs(chord))
    from_arc = np.abs(np.abs(between - centres) - np.abs(start - centres))
    error = float(np.max(np.where(straight, from_line, from_arc)))
    arcs = list[Segment]()
    for index, (first, last) in enumerate(pairwise(points[::4].tolist())):
        centre = None if straight[index] else complex(centres[index])
        arcs.append(Segment(first, last, centre))
    return arcs, error


def _centres(
    start: AnyArray,
    middle: AnyArray,
    end: AnyArray,
) -> tuple[AnyArray, AnyArray]:
    """Return the centres of circles through three points (n,), and which three are on a line."""
    u = middle - start
    v = end - start
    turn = (np.conj(u) * v).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        centres = start + 0.5j * (u * np.abs(v) ** 2 - v * np.abs(u) ** 2) / turn
    return centres, np.abs(turn) < ON_LINE * np.abs(v) ** 2
