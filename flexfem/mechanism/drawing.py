"""A plate as a single part: contours, mounting holes of a stage, the wire's path, and the dimensions of a stage."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.mechanism.bodies import body_sides, necks, turn
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.frames import CHAIN_TURN
from flexfem.mechanism.outlines import Segment, area, circle_of, disc, offset, polygon_points, polyline, reverse
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import CHAINS
from flexfem.refused import BadInput

TANGENT = 1e-6  # rad; bend below which two segments join smoothly
BLUNT = 1e-2  # rad; bend up to which segments that approximate a curve may be joined between their ends
FINE = np.pi / 512  # rad of arc per vertex of the polygon that is checked for self-intersection


class Part(NamedTuple):
    """Contours of a plate, mm.

    loops : closed loops, counter-clockwise around separate pieces and clockwise around holes, the outer one first. At
        every neck of a stage an arc ends and the next begins; the hole for its hub is second, mounting holes follow.
    ground : clamped regions and edges; of a stage the pads, rectangles whose first line is the clamped edge.
    """

    loops: list[list[Segment]]
    ground: list[list[Segment]]

    @property
    def area(self) -> float:
        """Exact area of the part, mm^2."""
        return float(sum(map(area, self.loops)))

    @property
    def length(self) -> float:
        """Length of all contours, mm."""
        return float(sum(segment.length for loop in self.loops for segment in loop))

    @property
    def size(self) -> float:
        """Larger extent in x and y, mm."""
        return float(np.max(np.ptp(np.concatenate([polygon_points(loop) for loop in self.loops]), axis=0)))


def part_of(stage: Stage, mounting: float | None = None) -> Part:
    """Return the contours of a stage; `mounting` is the diameter, mm, of a hole in the middle of every pad.

    Raises BadInput when the stage cannot be made or its pads have no room for the holes.
    """
    check_feasible(stage)
    width = stage.chain.link_width
    if mounting is not None and not mounting < width:
        raise BadInput(
            f"mounting holes of {mounting:g} mm, expected less than the pad width: chain.link_width_mm = {width:g}"
        )
    left, right = (  # edges of the chains, from the back of a pad to the rim of the platform
        [turn([segment for body in body_sides(stage, chain, side) for segment in body], chain) for chain in CHAINS]
        for side in (1, -1)
    )
    outer, pads, holes = list[Segment](), list[list[Segment]](), [(0j, stage.platform.hub_radius)]
    for k in range(3):
        back = Segment(left[k][0].start, right[k][0].start)
        rim = Segment(right[k][-1].end, left[(k + 1) % 3][-1].end, 0j)
        outer += [*reverse(left[k]), back, *right[k], rim]
        across = (back.start - back.end) / 2
        front = (back.start + back.end) / 2 - 1j * across / abs(across) * width
        pads.append(polyline(back.start, back.end, front - across, front + across, back.start))
        if mounting is not None:
            holes.append(((back.start + pads[k][2].start) / 2, mounting / 2))
    return Part([outer, *(reverse(disc(*hole).loop) for hole in holes)], pads)


def cut_path(part: Part, kerf: float) -> Part:
    """Return the path of the wire centre that cuts a part with a kerf, mm; every neck keeps its exact width.

    The path follows arcs about outer corners; sharp inner corners become fillets with half the kerf as radius.

    Raises BadInput for a kerf that is too wide for a hole, an inner radius or a gap of the part.
    """
    concave = [abs(s.start - s.centre) for loop in part.loops for s in loop if s.centre is not None and s.turn < 0]
    narrowest = 2 * min(concave, default=np.inf)
    if not kerf < narrowest:
        raise BadInput(f"kerf of {kerf:g} mm, expected less than the narrowest notch, fillet or hole, {narrowest:g} mm")
    loops = [_offset_outwards(loop, kerf / 2) for loop in part.loops]
    drawn = [shapely.Polygon(polygon_points(loop, FINE)) for loop in loops]
    for validity in map(shapely.is_valid_reason, drawn):
        if validity != "Valid Geometry":
            raise _too_wide(kerf, *map(float, validity.partition("[")[2].rstrip("]").split()))
    for one, other in combinations([polygon.exterior for polygon in drawn], 2):
        if not (shared := shapely.intersection(one, other)).is_empty:
            raise _too_wide(kerf, *shapely.get_coordinates(shared)[0].tolist())
    return part._replace(loops=loops)


def _too_wide(kerf: float, x: float, y: float) -> BadInput:
    gaps = f"expected less than every gap of the part: the wire would cut the part at {x:.1f}, {y:.1f}"
    return BadInput(f"kerf of {kerf:g} mm, {gaps}")


def _offset_outwards(loop: list[Segment], distance: float) -> list[Segment]:
    """Offset a closed loop to its right, out of the part, with rounded convex and trimmed concave corners.

    Raises BadInput where nothing is left of a segment.
    """
    before = offset(loop, -distance)
    moved, corners = list(before), dict[int, Segment]()
    for k, segment in enumerate(loop):
        following = (k + 1) % len(loop)
        bend = float(np.angle(complex(loop[following].tangent(0.0)) / complex(segment.tangent(1.0))))
        if bend > TANGENT:
            corners[k] = Segment(moved[k].end, moved[following].start, segment.end)
        elif bend < -TANGENT:
            middle = (moved[k].end + moved[following].start) / 2
            at = _crossing(moved[k], moved[following], middle)
            if at is None and bend < -BLUNT:
                raise _too_wide(2 * distance, segment.end.real, segment.end.imag)
            at = middle if at is None else at
            moved[k], moved[following] = moved[k]._replace(end=at), moved[following]._replace(start=at)
    for old, new in zip(before, moved, strict=True):
        if new.turn * old.turn < 0 or ((new.end - new.start) * (old.end - old.start).conjugate()).real <= 0:
            raise _too_wide(2 * distance, old.start.real, old.start.imag)
    return [piece for k, segment in enumerate(moved) for piece in (segment, corners.get(k)) if piece is not None]


def _crossing(a: Segment, b: Segment, near: complex) -> complex | None:
    """Intersection nearest to a point of two lines or circles on which segments lie; None without one."""
    a, b = (b, a) if a.centre is None else (a, b)
    if a.centre is None:
        u, v = a.end - a.start, b.end - b.start
        return a.start + u * ((b.start - a.start).conjugate() * v).imag / (u.conjugate() * v).imag
    radius, at, along = abs(a.start - a.centre), b.start, complex(b.tangent(0.0))
    if b.centre is not None:  # both circles meet the line through their common points
        apart = b.centre - a.centre
        at = a.centre + apart * (radius**2 - abs(b.start - b.centre) ** 2 + abs(apart) ** 2) / (2 * abs(apart) ** 2)
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
    """A text centred at `place`, with its half width and half height in `half`, about an anchor; complex, mm."""

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


def dimensions_of(stage: Stage, part: Part) -> Dimensions:
    """Return the dimensions of a stage, placed clear of each other and of the part where there is room.

    Hinges are labelled on chain 1 if all chains are identical, otherwise on every chain.
    """
    body, *holes = (shapely.Polygon(polygon_points(loop)) for loop in part.loops)
    height, width, spans = TEXT * part.size, stage.chain.link_width, list[Span]()
    ends = [*(pose.point for pose in necks(stage, 1)), 0j]
    for k in range(3):  # the nearest dimension line with a third of the link width as clearance, or the clearest one
        distances = [side * reach * width for reach in (1.0, 1.5, 2.0) for side in (1, -1)]
        candidates = [Span(f"l{k + 1}", ends[k], ends[k + 1], away) for away in distances]
        spans.append(max(candidates, key=lambda span: min(body.distance(_middle(span)), width / 3)))
    spans.append(Span("w", part.ground[0][0].start, part.ground[0][0].end, -2.5 * height))
    spans = [_rightwards(span) for span in spans]
    obstacles: list[Any] = [each.boundary for each in (body, *holes)] + [_line(*span.line) for span in spans]
    texts, labels = [_middle(span) for span in spans], list[Label]()
    for text, anchor in _annotations(stage, part):
        half = 0.5 * height * complex(LETTER * len(text) + 1, 2)
        labels.append(Label(text, anchor, _clear_place(anchor, half.real, height, obstacles, texts), half))
        texts.append(_line(labels[-1].place - half.real, labels[-1].place + half.real))
        obstacles += [texts[-1], _line(*labels[-1].line)]
    return Dimensions(spans, labels, height)


def _annotations(stage: Stage, part: Part) -> Iterator[tuple[str, complex]]:
    """Yield the texts of the labels and their anchors."""
    for chain in (1,) if stage.chains_alike else CHAINS:
        for pose, name in zip(necks(stage, chain), HINGE_NAMES, strict=True):
            hinge = stage.hinge(chain, name)
            yield f"R {hinge.radius:.6g}, t {hinge.neck:.6g}", pose.point * cmath.exp(1j * (chain - 1) * CHAIN_TURN)
    outer, _, *mounting = part.loops
    rims = [complex(segment.at(0.5)) for segment in outer if segment.centre == 0]
    rim = max(rims, key=lambda point: abs(point - necks(stage, 1)[2].point))
    yield f"platform R {stage.platform.radius:.6g}", rim
    yield f"hub R {stage.platform.hub_radius:.6g}", stage.platform.hub_radius * rim / abs(rim)
    if mounting and (hole := circle_of(mounting[0])):
        yield f"3 holes R {hole[1]:.6g}", hole[0]


def _middle(span: Span) -> shapely.LineString:
    """Middle part of a dimension line; its ends may lie over an adjacent body."""
    start, end = span.line
    return _line(0.8 * start + 0.2 * end, 0.2 * start + 0.8 * end)


def _rightwards(span: Span) -> Span:
    """Return the same length directed to the right or upwards, so that its text is upright."""
    along = span.end - span.start
    if along.real > UPRIGHT * abs(along) or (abs(along.real) <= UPRIGHT * abs(along) and along.imag > 0):
        return span
    return Span(span.name, span.end, span.start, -span.away)


def _clear_place(anchor: complex, half: float, height: float, obstacles: list[Any], texts: list[Any]) -> complex:
    """Return the clearest place for a text with its leader line, and the nearest of equally clear places."""
    places = np.concatenate([anchor + reach * height * DIRECTIONS for reach in (4.0, 6.0, 8.0, 11.0)])
    baselines = shapely.linestrings(np.stack([_points(places - half), _points(places + half)], axis=1))
    leaders = shapely.linestrings(np.stack([_points(np.full_like(places, anchor)), _points(places)], axis=1))
    of_text = shapely.distance(baselines, shapely.union_all(obstacles))
    of_leader = shapely.distance(leaders, shapely.union_all(texts))
    clearance = np.minimum(np.minimum(of_text, of_leader), 1.5 * height)
    return complex(places[int(np.argmax(np.round(clearance, 6)))])


def _line(start: complex, end: complex) -> shapely.LineString:
    return shapely.LineString(_points(np.array([start, end])))


def _points(z: AnyArray) -> AnyArray:
    return np.stack([z.real, z.imag], axis=-1)
