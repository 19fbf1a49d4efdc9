"""A workshop drawing as SVG."""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple
from xml.etree import ElementTree

from flexfem.cad.sheet import COLOURS, SIZES, Sheet
from flexfem.mechanism.dimensions import LETTER, Span
from flexfem.mechanism.outlines import Segment, circle_of

LINE = 0.1  # mm, line width
HEAD = 3.0  # length over width of an arrow head
MARGIN = 3.0  # around the drawing, over the height of its letters


class _Box(NamedTuple):
    """Lower left and upper right corner (complex), mm."""

    low: complex
    high: complex


def svg_text(sheet: Sheet) -> str:
    """Return the text of an SVG file, in which y points down: it is the negative of that drawn."""
    root = ElementTree.Element("svg", _page(_box_of(sheet)))
    ElementTree.SubElement(root, "title").text = sheet.title
    look = {"fill": "none", "stroke-width": str(LINE)}
    for name, loops in sheet.paths.items():
        group = ElementTree.SubElement(root, "g", {"id": name, "stroke": COLOURS[name], **look})
        for loop in loops:
            _add_loop(group, loop)
        if name == SIZES:
            _add_dimensions(group, sheet)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _page(box: _Box) -> dict[str, str]:
    """Return the attributes of the page, in mm."""
    extent = box.high - box.low
    view = [box.low.real, -box.high.imag, extent.real, extent.imag]
    return {
        "xmlns": "http://www.w3.org/2000/svg",
        "width": f"{extent.real!r}mm",
        "height": f"{extent.imag!r}mm",
        "viewBox": " ".join(map(repr, view)),
    }


def _box_of(sheet: Sheet) -> _Box:
    """Return the box of a drawing, with a margin."""
    height = sheet.dimensions.height
    points = [segment.start for paths in sheet.paths.values() for path in paths for segment in path]
    points += [end for span in sheet.dimensions.spans for end in span.line]
    for text, place, is_centred in sheet.texts:
        width = height * LETTER * len(text)
        if is_centred:
            points += [place - width / 2 - 1j * height, place + width / 2]
        else:
            points += [place, place + width]
    margin = MARGIN * height * (1 + 1j)
    x = [float(z.real) for z in points]
    y = [float(z.imag) for z in points]
    return _Box(complex(min(x), min(y)) - margin, complex(max(x), max(y)) + margin)


def _add_loop(group: Any, loop: list[Segment]) -> None:
    """Add a loop as a circle if it is one, else as a path."""
    circle = circle_of(loop)
    if circle is None:
        ElementTree.SubElement(group, "path", {"d": _path(loop)})
        return
    centre, radius = circle
    attributes = _coordinates("cx", "cy", centre) | {"r": repr(float(radius))}
    ElementTree.SubElement(group, "circle", attributes)


def _coordinates(
    x: str,
    y: str,
    z: complex,
) -> dict[str, str]:
    return dict(zip((x, y), _pair(z).split(), strict=True))


def _pair(z: complex) -> str:
    """Return both SVG coordinates in full precision."""
    return f"{float(z.real)!r} {float(-z.imag)!r}"


def _path(path: list[Segment]) -> str:
    """Return SVG path data, closed unless the path is a single line; no arc exceeds 180 degrees."""
    steps = [f"M {_pair(path[0].start)}"]
    for segment in path:
        if segment.centre is None:
            steps.append(f"L {_pair(segment.end)}")
        else:
            radius = repr(float(abs(segment.start - segment.centre)))
            sweep = int(segment.turn < 0)
            steps.append(f"A {radius} {radius} 0 0 {sweep} {_pair(segment.end)}")
    if len(path) > 1:
        steps.append("Z")
    return " ".join(steps)


def _add_dimensions(group: Any, sheet: Sheet) -> None:
    """Add the dimension lines with their arrow heads, and all texts."""
    height = sheet.dimensions.height
    for span in sheet.dimensions.spans:
        _add_span(group, span, height)
    for text, place, is_centred in sheet.texts:
        if is_centred:
            _add_text(group, text, place - 0.35j * height, height)
        else:
            _add_text(group, text, place, height, anchor="start")


def _add_span(
    group: Any,
    span: Span,
    height: float,
) -> None:
    """Add a dimension line, its extension lines, its arrow heads and its text."""
    start, end = span.line
    for line in ((span.start, start), (span.end, end), (start, end)):
        ElementTree.SubElement(group, "path", {"d": _path([Segment(*line)])})
    along = (end - start) / abs(end - start)
    for tip, inwards in ((start, along), (end, -along)):
        back = tip + height * inwards
        half = 1j * inwards * height / HEAD / 2
        corners = " ".join(map(_pair, (tip, back + half, back - half)))
        ElementTree.SubElement(group, "polygon", {"points": corners, "fill": COLOURS[SIZES]})
    _add_text(group, span.text, (start + end) / 2 + 0.4j * along * height, height, along)


def _add_text(
    group: Any, text: str, at: complex, height: float, along: complex = 1, anchor: str = "middle"
) -> None:
    """Add a line of text along a direction, with its base line through a point."""
    attributes = _coordinates("x", "y", at) | {"text-anchor": anchor}
    if along != 1:
        degrees = -math.degrees(cmath.phase(along))
        attributes["transform"] = f"rotate({degrees:.6f} {_pair(at)})"
    attributes |= {
        "fill": COLOURS[SIZES],
        "stroke": "none",
        "font-size": f"{height:.6g}",
        "font-family": "sans-serif",
    }
    ElementTree.SubElement(group, "text", attributes).text = text
