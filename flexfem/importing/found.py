"""What is read from a drawing, and what is found in the plate that it draws; complex points, mm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from shapely import Polygon

from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import Segment, reverse


class DrawnMark(NamedTuple):
    """A point, line or closed contour on a layer that says what a part is for, such as GROUND.

    points : one point, the corners of an open line from end to end, or those of a closed contour;
    arcs and circles are polygons of points on them.
    closed : whether the last point is joined with the first.
    """

    layer: str
    points: tuple[complex, ...]
    closed: bool = True


class Drawing(NamedTuple):
    """One plate as it is drawn.

    outside : closed counter-clockwise loop.   holes : closed clockwise loops inside it.
    thickness : mm, None where the file does not state it.
    deviation : mm, largest distance of the loops from the curves of the file (splines, ellipses).
    notes : complete sentences about what was closed, merged or left out.
    """

    path: Path
    outside: tuple[Segment, ...]
    holes: tuple[tuple[Segment, ...], ...]
    thickness: float | None
    marks: tuple[DrawnMark, ...]
    deviation: float
    notes: tuple[str, ...]

    def moved(self, move: Move) -> Drawing:
        """Return the plate after a move; loops keep their sense, also in a mirror image."""
        marks = [mark._replace(points=tuple(move(z) for z in mark.points)) for mark in self.marks]
        return self._replace(
            outside=_moved_loop(self.outside, move),
            holes=tuple(_moved_loop(hole, move) for hole in self.holes),
            marks=tuple(marks),
        )


def _moved_loop(loop: Sequence[Segment], move: Move) -> tuple[Segment, ...]:
    moved = [
        Segment(
            move(each.start),
            move(each.end),
            None if each.centre is None else move(each.centre),
        )
        for each in loop
    ]
    return tuple(reverse(moved)) if move.mirrored else tuple(moved)


class FoundBody(NamedTuple):
    """A body up to the ends of its hinges.

    outside : closed counter-clockwise loop.   holes : closed clockwise loops inside it.
    clamped : indices of segments of `outside` that lie on a mark of the ground.
    """

    outside: tuple[Segment, ...]
    holes: tuple[tuple[Segment, ...], ...]
    clamped: tuple[int, ...] = ()


class FoundHinge(NamedTuple):
    """A hinge between two bodies.

    bodies : indices of its first and second body.   place : its centre.
    heading : rad, from the first to the second.   shape : as in a mechanism file.
    dimensions : mm (angles in degrees) by the key of a mechanism file without its unit, such as
    `neck`.
    table : rows of a profile, mm, empty for other shapes.   smooth : whether a smooth curve joins
    them.
    side : "left" or "right" of a hinge with a notch on this side only.
    deviation : mm, largest distance of the edge from the drawn one.
    """

    bodies: tuple[int, int]
    place: complex
    heading: float
    shape: str
    dimensions: dict[str, float]
    table: tuple[tuple[float, ...], ...]
    deviation: float
    smooth: bool = False
    side: str | None = None


class FoundPlate(NamedTuple):
    """A plate divided into bodies and hinges.

    slender : thin parts of bodies that were not taken as hinges.
    """

    drawing: Drawing
    bodies: tuple[FoundBody, ...]
    hinges: tuple[FoundHinge, ...]
    slender: tuple[Polygon, ...]
