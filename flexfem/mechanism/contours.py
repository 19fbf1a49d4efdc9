"""A plate as a single part: its contours, and the path of the wire that cuts it."""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely

from flexfem.mechanism.outlines import Segment, area, offset, polygon_points
from flexfem.refused import BadInput

LARGEST_KERF = 10.0  # mm, some 30 times a common kerf
TANGENT = 1e-6  # rad; bend below which two segments join smoothly
# rad; bend up to which segments that approximate a curve may be joined between their ends
BLUNT = 1e-2
FINE = np.pi / 512  # rad of arc per vertex of the polygon that is checked for self-intersection


class Part(NamedTuple):
    """Contours of a plate, mm.

    loops : closed loops, counter-clockwise around separate pieces and clockwise around holes, the
    outer one first.
    """

    loops: list[list[Segment]]

    @property
    def area(self) -> float:
        """Exact area of the part, mm^2."""
        return float(sum(map(area, self.loops)))

    @property
    def length(self) -> float:
        """Length of all contours, mm."""
        return float(sum(segment.length for loop in self.loops for segment in loop))


def cut_path(part: Part, kerf: float) -> Part:
    """Return the path of the wire centre that cuts a part with a kerf, mm.

    Every neck keeps its exact width.

    The path follows arcs about outer corners; sharp inner corners become fillets with half the kerf
    as radius.

    Raises BadInput for a kerf that is too wide for a hole, an inner radius or a gap of the part.
    """
    concave = [
        abs(s.start - s.centre)
        for loop in part.loops
        for s in loop
        if s.centre is not None and s.turn < 0
    ]
    narrowest = 2 * min(concave, default=np.inf)
    if not kerf < narrowest:
        raise BadInput(
            f"kerf of {kerf:g} mm, expected less than the narrowest notch, fillet or hole, "
            f"{narrowest:g} mm"
        )
    loops = [_offset_outwards(loop, kerf / 2) for loop in part.loops]
    drawn = [shapely.Polygon(polygon_points(loop, FINE)) for loop in loops]
    for validity in map(shapely.is_valid_reason, drawn):
        if validity != "Valid Geometry":
            raise _too_wide(kerf, *map(float, validity.partition("[")[2].rstrip("]").split()))
    for one, other in combinations([polygon.exterior for polygon in drawn], 2):
        shared = shapely.intersection(one, other)
        if not shared.is_empty:
            raise _too_wide(kerf, *shapely.get_coordinates(shared)[0].tolist())
    return Part(loops)


def _too_wide(
    kerf: float,
    x: float,
    y: float,
) -> BadInput:
    gaps = (
        f"expected less than every gap of the part: the wire would cut the part at {x:.1f}, {y:.1f}"
    )
    return BadInput(f"kerf of {kerf:g} mm, {gaps}")


def _offset_outwards(loop: list[Segment], distance: float) -> list[Segment]:
    """Offset a closed loop to its right, out of the part, with rounded convex and trimmed concave
    corners.

    Raises BadInput where nothing is left of a segment.
    """
    before = offset(loop, -distance)
    moved = list(before)
    corners = dict[int, Segment]()
    for k, segment in enumerate(loop):
        following = (k + 1) % len(loop)
        bend = float(
            np.angle(complex(loop[following].tangent(0.0)) / complex(segment.tangent(1.0)))
        )
        if bend > TANGENT:
            corners[k] = Segment(moved[k].end, moved[following].start, segment.end)
        elif bend < -TANGENT:
            middle = (moved[k].end + moved[following].start) / 2
            at = _crossing(moved[k], moved[following], middle)
            if at is None and bend < -BLUNT:
                raise _too_wide(2 * distance, segment.end.real, segment.end.imag)
            at = middle if at is None else at
            moved[k] = moved[k]._replace(end=at)
            moved[following] = moved[following]._replace(start=at)
    for old, new in zip(before, moved, strict=True):
        if (
            new.turn * old.turn < 0
            or ((new.end - new.start) * (old.end - old.start).conjugate()).real <= 0
        ):
            raise _too_wide(2 * distance, old.start.real, old.start.imag)
    return [
        piece
        for k, segment in enumerate(moved)
        for piece in (segment, corners.get(k))
        if piece is not None
    ]


def _crossing(
    a: Segment,
    b: Segment,
    near: complex,
) -> complex | None:
    """Intersection nearest to a point of two lines or circles on which segments lie.

    It is None without one.
    """
    a, b = (b, a) if a.centre is None else (a, b)
    if a.centre is None:
        u = a.end - a.start
        v = b.end - b.start
        return a.start + u * ((b.start - a.start).conjugate() * v).imag / (u.conjugate() * v).imag
    radius = abs(a.start - a.centre)
    at = b.start
    along = complex(b.tangent(0.0))
    if b.centre is not None:  # both circles meet the line through their common points
        apart = b.centre - a.centre
        at = a.centre + apart * (radius**2 - abs(b.start - b.centre) ** 2 + abs(apart) ** 2) / (
            2 * abs(apart) ** 2
        )
        along = 1j * apart / abs(apart)
    foot = at + along * ((a.centre - at) * along.conjugate()).real
    half_squared = radius**2 - abs(foot - a.centre) ** 2
    if half_squared < 0:
        return None
    half = along * math.sqrt(half_squared)
    return min(foot + half, foot - half, key=lambda z: abs(z - near))
