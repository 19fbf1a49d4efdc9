"""The stage as one part to cut: its contours with holes for mounting, the path of a wire, and its dimensions."""

from __future__ import annotations

import cmath
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.mechanism.bodies import body_sides, necks, turn
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import Segment, area, offset, polygon_points, polyline, reverse
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import CHAINS
from flexfem.refused import BadInput

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
    left, right = (  # sides of the chains, from the back of a pad to the platform's rim
        [turn([segment for body in body_sides(stage, chain, side) for segment in body], chain) for chain in CHAINS]
        for side in (1, -1)
    )
    outer, pads = list[Segment](), list[list[Segment]]()
    for k in range(3):
        back = Segment(left[k][0].start, right[k][0].start)
        rim = Segment(right[k][-1].end, left[(k + 1) % 3][-1].end, 0j)
        outer += [*reverse(left[k]), back, *right[k], rim]
        across = (back.start - back.end) / 2
        front = (back.start + back.end) / 2 - 1j * across / abs(across) * width
        pads.append(polyline(back.start, back.end, front - across, front + across, back.start))
    drilled = [] if mounting is None else [Hole((pad[0].start + pad[2].start) / 2, mounting / 2) for pad in pads]
    return Part(outer, Hole(0j, stage.platform.hub_radius), drilled, pads)


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
        ahead, behind = complex(loop[after].tangent(0.0)), complex(segment.tangent(1.0))
        bend = float(np.angle(ahead / behind))
        if bend > TANGENT:
            corners[k] = Segment(moved[k].end, moved[after].start, segment.end)
        elif bend < -TANGENT:
            cut = distance * np.tan(-bend / 2)  # off both lines; inner corners are between lines alone
            moved[k] = moved[k]._replace(end=moved[k].end - cut * behind)
            moved[after] = moved[after]._replace(start=moved[after].start + cut * ahead)
    return [piece for k, each in enumerate(moved) for piece in (each, corners.get(k)) if piece is not None]


LETTER = 0.6  # width of a letter per height of the text, about
TEXT = 1 / 60  # height of the text per size of the stage
UPRIGHT = 1e-6  # sine of the slant up to which a line counts as upright
TURNS = np.exp(1j * np.arange(24) * (2 * np.pi / 24))


class Span(NamedTuple):
    """A length between two points (complex, mm), its line drawn `away` mm to the left of them."""

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
        """Ends of its line."""
        shift = 1j * self.away * (self.end - self.start) / abs(self.end - self.start)
        return self.start + shift, self.end + shift


class Label(NamedTuple):
    """A text centred at a place (complex, mm), so far to both sides of it, `half`, and up and down, about an anchor."""

    text: str
    anchor: complex
    place: complex
    half: complex

    @property
    def line(self) -> tuple[complex, complex]:
        """From the anchor to the edge of the text."""
        towards = self.place - self.anchor
        beyond = max(1.0, abs(towards.real) / self.half.real, abs(towards.imag) / self.half.imag)
        return self.anchor, self.place - towards / beyond


class Dimensions(NamedTuple):
    """Lengths and labels of a drawing, and the height of its texts, mm."""

    spans: list[Span]
    labels: list[Label]
    height: float


def dimensions_of(stage: Stage, part: Part) -> Dimensions:
    """Dimensions of a stage, clear of each other and of its metal where there is room.

    Hinges are labelled on chain 1 where all chains are alike, else on every one.
    """
    metal = shapely.Polygon(polygon_points(part.outer))
    west, south, east, north = metal.bounds
    height = TEXT * max(east - west, north - south)
    poses, width = necks(stage, 1), stage.chain.link_width
    ends = [pose.point for pose in poses] + [0j]
    spans = list[Span]()
    for k in range(3):  # on the side and at the distance where the line is clear of the metal, or nearly
        aside = [side * reach * width for reach in (1.0, 1.5, 2.0) for side in (1, -1)]
        tried = [Span(f"l{k + 1}", ends[k], ends[k + 1], away) for away in aside]
        spans.append(max(tried, key=lambda span: min(metal.distance(_middle(span)), width / 3)))
    spans.append(Span("w", part.pads[0][0].start, part.pads[0][0].end, -2.5 * height))
    spans = [_rightwards(span) for span in spans]
    rims = [shapely.Point(hole.centre.real, hole.centre.imag).buffer(hole.radius).boundary for hole in part.holes]
    taken, labels = [metal.boundary, *rims, *(_line(*span.line) for span in spans)], list[Label]()
    texts = [_middle(span) for span in spans]
    for text, anchor in _noted(stage, part):
        half = 0.5 * height * complex(LETTER * len(text) + 1, 2)
        labels.append(Label(text, anchor, _clear(anchor, half.real, height, taken, texts), half))
        texts.append(_line(labels[-1].place - half.real, labels[-1].place + half.real))
        taken += [texts[-1], _line(*labels[-1].line)]
    return Dimensions(spans, labels, height)


def _noted(stage: Stage, part: Part) -> Iterator[tuple[str, complex]]:
    """Texts, and the places that they are about."""
    for chain in (1,) if stage.chains_alike else CHAINS:
        for pose, name in zip(necks(stage, chain), HINGE_NAMES, strict=True):
            hinge = stage.hinge(chain, name)
            yield f"R {hinge.radius:.6g}, t {hinge.neck:.6g}", pose.point * cmath.exp(1j * (chain - 1) * CHAIN_TURN)
    rims = [complex(segment.at(0.5)) for segment in part.outer if segment.centre == 0]
    rim = max(rims, key=lambda point: abs(point - necks(stage, 1)[2].point))
    yield f"platform R {stage.platform.radius:.6g}", rim
    yield f"hub R {part.hub.radius:.6g}", part.hub.radius * rim / abs(rim)
    for hole in part.mounting[:1]:
        yield f"3 holes R {hole.radius:.6g}", hole.centre


def _middle(span: Span) -> shapely.LineString:
    """The line of a length without its ends, which may well lie over a neighbouring body."""
    start, end = span.line
    return _line(0.8 * start + 0.2 * end, 0.2 * start + 0.8 * end)


def _rightwards(span: Span) -> Span:
    """The same length, walked to the right, or upwards: its text is then upright."""
    along = span.end - span.start
    if along.real > UPRIGHT * abs(along) or (abs(along.real) <= UPRIGHT * abs(along) and along.imag > 0):
        return span
    return Span(span.name, span.end, span.start, -span.away)


def _clear(anchor: complex, half: float, height: float, taken: list[Any], texts: list[Any]) -> complex:
    """The place for a text that is clearest of what is there, its line clear of other texts; near ones first."""
    places = np.concatenate([anchor + reach * height * TURNS for reach in (4.0, 6.0, 8.0, 11.0)])
    found = shapely.linestrings(np.stack([_points(places - half), _points(places + half)], axis=1))
    lines = shapely.linestrings(np.stack([_points(np.full_like(places, anchor)), _points(places)], axis=1))
    clearance = shapely.distance(found, shapely.union_all(taken))
    beside = shapely.distance(lines, shapely.union_all(texts))
    clearance = np.minimum(np.minimum(clearance, beside), 1.5 * height)
    return complex(places[int(np.argmax(np.round(clearance, 6)))])


def _line(start: complex, end: complex) -> shapely.LineString:
    return shapely.LineString(_points(np.array([start, end])))


def _points(z: AnyArray) -> AnyArray:
    return np.stack([z.real, z.imag], axis=-1)
