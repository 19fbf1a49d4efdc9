"""A plate as a single part: contours, the wire's path, and dimensions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.outlines import Segment, area, circle_of, offset, polygon_points
from flexfem.mechanism.plate import extent, plate_polygon
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

TANGENT = 1e-6  # rad; bend below which two segments join smoothly
BLUNT = (
    1e-2  # rad; bend up to which segments that approximate a curve may be joined between their ends
)
FINE = np.pi / 512  # rad of arc per vertex of the polygon that is checked for self-intersection


class Part(NamedTuple):
    """Contours of a plate, mm.

    loops : closed loops, counter-clockwise around separate pieces and clockwise around holes, the
    outer one first."""

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
    """Return the path of the wire centre that cuts a part with a kerf, mm; every neck keeps its
    exact width.

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
        if not (shared := shapely.intersection(one, other)).is_empty:
            raise _too_wide(kerf, *shapely.get_coordinates(shared)[0].tolist())
    return Part(loops)


def _too_wide(kerf: float, x: float, y: float) -> BadInput:
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
            moved[k], moved[following] = (
                moved[k]._replace(end=at),
                moved[following]._replace(start=at),
            )
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


def _crossing(a: Segment, b: Segment, near: complex) -> complex | None:
    """Intersection nearest to a point of two lines or circles on which segments lie; None without
    one.
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


LETTER = 0.6  # approximate width of a letter relative to the height of the text
TEXT = 1 / 60  # height of the text relative to the size of the stage
UPRIGHT = 1e-6  # sine of the angle to the vertical up to which a line counts as vertical
DIRECTIONS = np.exp(1j * np.arange(24) * (2 * np.pi / 24))


class Span(NamedTuple):
    """A length between two points (complex, mm); its dimension line lies `away` mm to their left."""

    name: str
    start: complex
    end: complex
    away: float

    @property
    def text(self) -> str:
        """Name and length, mm."""
        return f"{self.name} {abs(self.end - self.start):.6g}"

    @property
    def line(self) -> tuple[complex, complex]:
        """Ends of the dimension line."""
        shift = 1j * self.away * (self.end - self.start) / abs(self.end - self.start)
        return self.start + shift, self.end + shift


class Label(NamedTuple):
    """A text centred at `place`, with its half width and half height in `half`, about an anchor;
    complex, mm.
    """

    text: str
    anchor: complex
    place: complex
    half: complex

    @property
    def line(self) -> tuple[complex, complex]:
        """Leader line from the anchor to the edge of the text."""
        vector = self.place - self.anchor
        ratio = max(1.0, abs(vector.real) / self.half.real, abs(vector.imag) / self.half.imag)
        return self.anchor, self.place - vector / ratio


class Dimensions(NamedTuple):
    """Dimensioned lengths and labels of a drawing, and the height of its texts, mm."""

    spans: list[Span]
    labels: list[Label]
    height: float


def dimensions_of(plate: Mechanism, layout: Layout) -> Dimensions:
    """Return the dimensions of a plate, placed clear of each other and of its parts.

    layout : of the plate, perhaps with mounting holes in the pads of a stage.
    """
    shape = plate_polygon(layout)
    height = TEXT * extent(shape)
    spans = spans_of(plate, layout, shape)
    obstacles: list[Any] = [shape.boundary, *(_line(*span.line) for span in spans)]
    labels = list[Label]()
    reaches = height * np.array([4.0, 6.0, 8.0, 11.0])
    for text, anchor in labels_of(plate, layout):
        half = 0.5 * height * complex(LETTER * len(text) + 1, 2)
        place, box = clearest(anchor, half, reaches, obstacles, 1.5 * height)
        labels.append(Label(text, anchor, place, half))
        obstacles += [box, _line(*labels[-1].line)]
    return Dimensions(spans, labels, height)


def spans_of(plate: Mechanism, layout: Layout, shape: Any) -> list[Span]:
    """Return the lengths of chain 1 of a stage and the width of its pad, with dimension lines
    beside its polygon.

    A dimension line is the nearest one with a third of the link width as clearance, or the clearest
    one."""
    if not isinstance(plate, Stage):
        return []
    width = plate.chain.link_width
    ends = [*(joint.place for joint in layout.joints[:3]), 0j]
    spans = [Span("w", *layout.bodies[0].outline[0][:2], -2.5 * TEXT * extent(shape))]
    for k in range(3):
        distances = [side * reach * width for reach in (1.0, 1.5, 2.0) for side in (1, -1)]
        candidates = [Span(f"l{k + 1}", ends[k], ends[k + 1], away) for away in distances]
        spans.append(
            max(candidates, key=lambda span: min(shape.distance(_middle(span)), width / 3))
        )
    return list(map(_rightwards, spans))


def labels_of(plate: Mechanism, layout: Layout) -> Iterator[tuple[str, complex]]:
    """Yield the texts of the labels of a plate and their anchors.

    Hinges of a stage are labelled on chain 1 if all chains are identical, otherwise on every chain.
    """
    if not isinstance(plate, Stage):
        yield from (
            (f"{joint.name} t {joint.profile.neck:.6g}", joint.place) for joint in layout.joints
        )
        return
    for joint in layout.joints[: 3 if plate.chains_alike else 9]:
        yield f"R {joint.profile.root_radius:.6g}, t {joint.profile.neck:.6g}", joint.place
    rims = [
        complex(segment.at(0.5)) for segment in layout.bodies[-1].outline if segment.centre == 0
    ]
    rim = max(rims, key=lambda point: abs(point - layout.joints[2].place))
    yield f"platform R {plate.platform.radius:.6g}", rim
    yield f"hub R {plate.platform.hub_radius:.6g}", plate.platform.hub_radius * rim / abs(rim)
    for centre, radius in filter(None, map(circle_of, layout.bodies[0].holes)):
        yield f"3 holes R {radius:.6g}", centre


def _middle(span: Span) -> shapely.LineString:
    """Middle part of a dimension line; its ends may lie over an adjacent body."""
    start, end = span.line
    return _line(0.8 * start + 0.2 * end, 0.2 * start + 0.8 * end)


def _rightwards(span: Span) -> Span:
    """Return the same length directed to the right or upwards, so that its text is upright."""
    along = span.end - span.start
    if along.real > UPRIGHT * abs(along) or (
        abs(along.real) <= UPRIGHT * abs(along) and along.imag > 0
    ):
        return span
    return Span(span.name, span.end, span.start, -span.away)


def clearest(
    anchor: complex,
    half: complex,
    reaches: Array,
    obstacles: list[Any],
    most: float,
    window: Any = None,
) -> tuple[complex, Any]:
    """Return the clearest place of a text of a half width and half height at some reaches from an
    anchor, and its box.

    The clearance from the obstacles counts up to `most`; of equally clear places the nearest is
    chosen. All lengths in mm. window : polygon that contains the box, where one does."""
    places = np.asarray(anchor + np.outer(reaches, DIRECTIONS)).ravel()
    low = places - half
    high = places + half
    boxes = shapely.box(low.real, low.imag, high.real, high.imag)
    clearance = np.minimum(shapely.distance(boxes, shapely.GeometryCollection(obstacles)), most)
    if window is not None:
        clearance = np.where(shapely.covers(window, boxes), clearance, -1.0)
    best = int(np.argmax(np.round(clearance, 9)))
    return complex(places[best]), boxes[best]


def _line(start: complex, end: complex) -> shapely.LineString:
    return shapely.LineString([(z.real, z.imag) for z in (start, end)])
