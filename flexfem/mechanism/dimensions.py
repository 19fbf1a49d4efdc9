"""Dimensions of a workshop drawing, placed clear of each other and of the parts of the plate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.plate import extent, plate_polygon

LETTER = 0.6  # approximate width of a letter relative to the height of the text
TEXT = 1 / 60  # height of the text relative to the size of the plate
UPRIGHT = 1e-6  # sine of the angle to the vertical up to which a line counts as vertical
DIRECTIONS = np.exp(1j * np.arange(24) * (2 * np.pi / 24))
REACHES = np.array([4.0, 6.0, 8.0, 11.0])  # of labels from their anchors, in heights of the text
CLEARANCE = 1.5  # that a label needs, in heights of the text


class Span(NamedTuple):
    """A length between two points (complex, mm).

    Its dimension line lies `away` mm to their left.
    """

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

    @property
    def middle(self) -> shapely.LineString:
        """Middle part of the dimension line; its ends may lie over an adjacent body."""
        start, end = self.line
        return line_between(0.8 * start + 0.2 * end, 0.2 * start + 0.8 * end)

    @property
    def rightwards(self) -> Span:
        """The same length directed to the right or upwards, so that its text is upright."""
        along = self.end - self.start
        limit = UPRIGHT * abs(along)
        upwards = abs(along.real) <= limit and along.imag > 0
        if along.real > limit or upwards:
            return self
        return Span(self.name, self.end, self.start, -self.away)


class Callout(NamedTuple):
    """A text about a point, complex, mm, of a drawing."""

    text: str
    anchor: complex


class Label(NamedTuple):
    """A text centred at `place`, with its half width and half height in `half`, about an anchor.

    Places and sizes are complex, mm.
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


class Disc(NamedTuple):
    """A rigid disc in a hole: its centre (complex) and its radius, mm."""

    centre: complex
    radius: float


class DrawingFacts(NamedTuple):
    """What a drawing shows and states of a mechanism beside the outlines and sizes of its parts.

    discs : rigid discs that fill holes.
    facts : further data for the header.
    copies : which parts are copies of others, "" where there are none.
    unlabelled : why only some of the parts have labels, "" where all have.
    named : whether a picture labels the parts with their names, instead of the sizes.
    unmade : what the drawing of parts that do not fit together shows, where that is not obvious.
    """

    discs: Sequence[Disc] = ()
    facts: Sequence[str] = ()
    copies: str = ""
    unlabelled: str = ""
    named: bool = True
    unmade: str = ""


class Dimensions(NamedTuple):
    """Dimensioned lengths and labels of a drawing, and the height of its texts, mm."""

    spans: list[Span]
    labels: list[Label]
    height: float


def placed(
    layout: Layout,
    spans: list[Span],
    callouts: Iterable[Callout],
) -> Dimensions:
    """Return the dimensions of a drawing, with labels clear of each other and of the parts."""
    shape = plate_polygon(layout)
    height = TEXT * extent(shape)
    obstacles: list[Any] = [shape.boundary, *(line_between(*span.line) for span in spans)]
    labels = list[Label]()
    for text, anchor in callouts:
        half = 0.5 * height * complex(LETTER * len(text) + 1, 2)
        place, box = clearest(anchor, half, height * REACHES, obstacles, CLEARANCE * height)
        label = Label(text, anchor, place, half)
        labels.append(label)
        obstacles += [box, line_between(*label.line)]
    return Dimensions(spans, labels, height)


def hinge_callouts(layout: Layout) -> list[Callout]:
    """Return name and neck of every hinge."""
    joints = layout.joints
    return [Callout(f"{joint.name} t {joint.profile.neck:.6g}", joint.place) for joint in joints]


def clearest(
    anchor: complex,
    half: complex,
    reaches: Array,
    obstacles: list[Any],
    most: float,
) -> tuple[complex, Any]:
    """Return the clearest place of a text about an anchor, and the box of the text there.

    Of equally clear places the nearest is chosen.

    Parameters
    ----------
    anchor : complex, mm.
    half : complex
        Half width and half height of the text, mm.
    reaches : (r,) distances from the anchor, mm, at which the text may be.
    obstacles : list of shapely geometries
    most : float
        Distance from the obstacles, mm, beyond which a place is no clearer.
    """
    places = np.asarray(anchor + np.outer(reaches, DIRECTIONS)).ravel()
    low = places - half
    high = places + half
    boxes = shapely.box(low.real, low.imag, high.real, high.imag)
    clearance = np.minimum(shapely.distance(boxes, shapely.GeometryCollection(obstacles)), most)
    best = int(np.argmax(np.round(clearance, 9)))
    return complex(places[best]), boxes[best]


def line_between(start: complex, end: complex) -> shapely.LineString:
    """Return the straight line between two points."""
    return shapely.LineString([(start.real, start.imag), (end.real, end.imag)])
