"""The stage as one part to cut: its contours with holes for mounting, and the path of a wire about them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from flexfem.refused import BadInput
from flexfem.stage.bodies import body_sides, necks, turn
from flexfem.stage.contacts import tangent_at
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.outline import Segment, area, offset, polygon_points, polyline, reverse
from flexfem.stage.tables import CHAINS

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

TANGENT = 1e-6  # rad; round-off of a smooth joint of two segments
FINE = np.pi / 512  # rad of arc between two points of a path that is looked at for crossings


class Hole(NamedTuple):
    """A round hole: centre (complex) and radius, mm."""

    centre: complex
    radius: float


class Part(NamedTuple):
    """Contours of a stage, mm.

    outer : closed counter-clockwise loop; at every neck an arc ends and the next begins.
    hub : the hole in the platform.   mounting : one in every pad, or none.
    pads : rectangles, closed counter-clockwise loops; the first line of each is the edge that the models clamp.
    """

    outer: list[Segment]
    hub: Hole
    mounting: list[Hole]
    pads: list[list[Segment]]

    @property
    def holes(self) -> list[Hole]:
        """All of them, that of the hub first."""
        return [self.hub, *self.mounting]

    @property
    def area(self) -> float:
        """Exact area of the metal, mm^2."""
        return float(area(self.outer) - sum(np.pi * hole.radius**2 for hole in self.holes))

    @property
    def length(self) -> float:
        """Length of all contours, mm."""
        return float(sum(s.length for s in self.outer) + sum(2 * np.pi * hole.radius for hole in self.holes))


def part_of(stage: Stage, mounting: float | None = None) -> Part:
    """The part that a stage is, `mounting` the diameter, mm, of a hole in the middle of every pad.

    Raises BadInput when the stage cannot be made or its pads have no room for the holes.
    """
    check_feasible(stage)
    width = stage.chain.link_width
    if mounting is not None and not mounting < width:
        raise BadInput(
            f"mounting holes of {mounting:g} mm, expected less than the pads: chain.link_width_mm = {width:g}"
        )
    left, right = ([_side(stage, chain, side) for chain in CHAINS] for side in (1, -1))
    outer = list[Segment]()
    for k, following in enumerate((1, 2, 0)):
        back = Segment(left[k][0].start, right[k][0].start)
        rim = Segment(right[k][-1].end, left[following][-1].end, 0j)
        outer += [*reverse(left[k]), back, *right[k], rim]
    pads = [_pad(stage, chain) for chain in CHAINS]
    drilled = [] if mounting is None else [Hole((pad[0].start + pad[2].start) / 2, mounting / 2) for pad in pads]
    return Part(outer, Hole(0j, stage.platform.hub_radius), drilled, pads)


def _side(stage: Stage, chain: int, side: int) -> list[Segment]:
    """One side (1 left, -1 right) of a chain, from the back of its pad to the platform's rim."""
    return turn([segment for body in body_sides(stage, chain, side) for segment in body], chain)


def _pad(stage: Stage, chain: int) -> list[Segment]:
    base, width = necks(stage, chain)[0], stage.chain.link_width
    depth = stage.hinge(chain, "base").radius
    across = 0.5j * (base.ahead(width).point - base.point)
    back, front = base.ahead(-depth - width).point, base.ahead(-depth).point
    return turn(polyline(back + across, back - across, front - across, front + across, back + across), chain)


def cut_path(part: Part, kerf: float) -> Part:
    """The path of the middle of a wire that cuts `kerf` mm wide and leaves the part, every neck exactly.

    It goes round outer corners on arcs about them, and leaves sharp inner corners filled with half the kerf.

    Raises BadInput for a kerf that is too wide for a hole, for an inner radius or for a gap of the part.
    """
    half = kerf / 2
    hollow = [abs(s.start - s.centre) for s in part.outer if s.centre is not None and s.turn < 0]
    narrowest = 2 * min(*hollow, *(hole.radius for hole in part.holes))
    if not kerf < narrowest:
        raise BadInput(f"kerf of {kerf:g} mm, expected less than the narrowest notch, fillet or hole, {narrowest:g} mm")
    outer = _beside(part.outer, half)
    found = shapely.is_valid_reason(shapely.Polygon(polygon_points(outer, FINE)))
    if found != "Valid Geometry":
        x, y = map(float, found.partition("[")[2].rstrip("]").split())
        raise BadInput(
            f"kerf of {kerf:g} mm, expected less than every gap of the part: the wire would cut metal at {x:.1f}, "
            f"{y:.1f}"
        )
    hub, *mounting = (hole._replace(radius=hole.radius - half) for hole in part.holes)
    return part._replace(outer=outer, hub=hub, mounting=mounting)


def _beside(loop: list[Segment], distance: float) -> list[Segment]:
    """A closed counter-clockwise loop moved outwards, its corners rounded outside and trimmed inside."""
    moved, corners = offset(loop, -distance), dict[int, Segment]()
    for k, segment in enumerate(loop):
        after = (k + 1) % len(loop)
        ahead, behind = complex(tangent_at(loop[after], np.array(0.0))), complex(tangent_at(segment, np.array(1.0)))
        bend = float(np.angle(ahead / behind))
        if bend > TANGENT:
            corners[k] = Segment(moved[k].end, moved[after].start, segment.end)
        elif bend < -TANGENT:
            cut = distance * np.tan(-bend / 2)  # off both lines; inner corners are between lines alone
            moved[k] = moved[k]._replace(end=moved[k].end - cut * behind)
            moved[after] = moved[after]._replace(start=moved[after].start + cut * ahead)
    return [piece for k, each in enumerate(moved) for piece in (each, corners.get(k)) if piece is not None]
