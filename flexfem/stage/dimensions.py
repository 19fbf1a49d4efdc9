"""What a drawing of a stage states of its size, and where it does: lengths of chain 1, notches, platform and hub."""

from __future__ import annotations

import cmath
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.stage.bodies import necks
from flexfem.stage.contacts import middle_at
from flexfem.stage.contour import Part
from flexfem.stage.designs import CHAIN_TURN
from flexfem.stage.outline import polygon_points
from flexfem.stage.schema import CHAINS, HINGE_NAMES, Stage

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
    spans = [_span(f"l{k + 1}", ends[k], ends[k + 1], width, metal) for k in range(3)]
    spans.append(_rightwards(Span("w", part.pads[0][0].start, part.pads[0][0].end, -2.5 * height)))
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
    rims = [complex(middle_at(segment, np.array(0.5))) for segment in part.outer if segment.centre == 0]
    rim = max(rims, key=lambda point: abs(point - necks(stage, 1)[2].point))
    yield f"platform R {stage.platform.radius:.6g}", rim
    yield f"hub R {part.hub.radius:.6g}", part.hub.radius * rim / abs(rim)
    for hole in part.mounting[:1]:
        yield f"3 holes R {hole.radius:.6g}", hole.centre


def _span(name: str, start: complex, end: complex, width: float, metal: shapely.Polygon) -> Span:
    """A length on the side and at the distance where its line is clear of the metal, or nearly."""
    found = [Span(name, start, end, side * reach * width) for reach in (1.0, 1.5, 2.0) for side in (1, -1)]
    return _rightwards(max(found, key=lambda span: min(metal.distance(_middle(span)), width / 3)))


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
    """The place for a text, so far to both sides of it, that is clearest of what is there; near ones first.

    Its line is to be clear of the other texts, too.
    """
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
