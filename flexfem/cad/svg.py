"""A drawing as SVG: true lines and arcs in groups by layer, one unit of the picture a millimetre."""

from __future__ import annotations

import cmath
import math
from typing import Any
from xml.etree import ElementTree

from flexfem.cad.sheet import COLOURS, MARKS, SIZES, Sheet
from flexfem.mechanism.bodies import Segment
from flexfem.mechanism.drawing import LETTER

LINE = 0.1  # mm, width of the lines
HEAD = 3.0  # length of an arrow per half of its width


def svg_text(sheet: Sheet) -> str:
    """The text of an SVG file; its y axis points down, so that every y is the negative of the drawing's."""
    low, high = _corners(sheet)
    box = (low.real, -high.imag, (high - low).real, (high - low).imag)
    size = {"width": f"{_number(box[2])}mm", "height": f"{_number(box[3])}mm", "viewBox": " ".join(map(_number, box))}
    root = ElementTree.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size})
    ElementTree.SubElement(root, "title").text = sheet.notes[0]
    look = {"fill": "none", "stroke-width": str(LINE)}
    groups = {
        name: ElementTree.SubElement(root, "g", {"id": name, "stroke": COLOURS[name], **look}) for name in sheet.layers
    }
    for name, loops in sheet.loops.items():
        for loop in loops:
            ElementTree.SubElement(groups[name], "path", {"d": _path(loop)})
    for name, holes in sheet.holes.items():
        for hole in holes:
            round_about = {"cx": _number(hole.centre.real), "cy": _number(-hole.centre.imag), "r": _number(hole.radius)}
            ElementTree.SubElement(groups[name], "circle", round_about)
    arm = sheet.dimensions.height / 2
    for centre in sheet.marks:
        for way in (arm, 1j * arm):
            _line(groups[MARKS], centre - way, centre + way)
    _draw_dimensions(groups[SIZES], sheet)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _corners(sheet: Sheet) -> tuple[complex, complex]:
    """Lower left and upper right corner of all that is drawn."""
    sizes = sheet.dimensions
    points = [each.start for loops in sheet.loops.values() for loop in loops for each in loop]
    points += [end for span in sizes.spans for end in span.line]
    for label in sizes.labels:
        points += [label.place - label.half, label.place + label.half]
    for line, note in enumerate(sheet.notes):
        points += [sheet.foot + sizes.height * (step - 1.6j * line) for step in (0.0, LETTER * len(note))]
    margin = 3 * sizes.height * (1 + 1j)
    x, y = [z.real for z in points], [z.imag for z in points]
    return complex(min(x), min(y)) - margin, complex(max(x), max(y)) + margin


def _number(value: float) -> str:
    """All digits of a number."""
    return repr(float(value))


def _pair(z: complex) -> str:
    return f"{_number(z.real)} {_number(-z.imag)}"


def _path(loop: list[Segment]) -> str:
    """A closed path; no arc is longer than half a turn, and counter-clockwise is no positive sense where y is down."""
    steps = [f"M {_pair(loop[0].start)}"]
    for segment in loop:
        if segment.centre is None:
            steps.append(f"L {_pair(segment.end)}")
        else:
            radius = _number(abs(segment.start - segment.centre))
            steps.append(f"A {radius} {radius} 0 0 {int(segment.turn < 0)} {_pair(segment.end)}")
    return " ".join([*steps, "Z"])


def _line(group: Any, start: complex, end: complex) -> None:
    ends = {"x1": start.real, "y1": -start.imag, "x2": end.real, "y2": -end.imag}
    ElementTree.SubElement(group, "line", {name: _number(value) for name, value in ends.items()})


def _draw_dimensions(group: Any, sheet: Sheet) -> None:
    sizes = sheet.dimensions
    for span in sizes.spans:
        start, end = span.line
        for foot, head in ((span.start, start), (span.end, end)):
            _line(group, foot, head)
        _line(group, start, end)
        along = (end - start) / abs(end - start)
        for tip, way in ((start, along), (end, -along)):
            back = tip + sizes.height * way
            half = 1j * way * sizes.height / HEAD / 2
            corners = " ".join(map(_pair, (tip, back + half, back - half)))
            ElementTree.SubElement(group, "polygon", {"points": corners, "fill": COLOURS[SIZES]})
        _text(group, span.text, (start + end) / 2 + 0.4j * along * sizes.height, sizes.height, along)
    for label in sizes.labels:
        _line(group, *label.line)
        _text(group, label.text, label.place - 0.35j * sizes.height, sizes.height)
    for line, note in enumerate(sheet.notes):
        _text(group, note, sheet.foot - 1.6j * line * sizes.height, sizes.height, anchor="start")


def _text(group: Any, text: str, at: complex, height: float, along: complex = 1, anchor: str = "middle") -> None:
    """A line of text along a direction, its base line through a place."""
    turned = {"transform": f"rotate({-math.degrees(cmath.phase(along)):.6f} {_pair(at)})"} if along != 1 else {}
    place = {"x": _number(at.real), "y": _number(-at.imag), "text-anchor": anchor, **turned}
    look = {"fill": COLOURS[SIZES], "stroke": "none", "font-size": f"{height:.6g}", "font-family": "sans-serif"}
    ElementTree.SubElement(group, "text", place | look).text = text
