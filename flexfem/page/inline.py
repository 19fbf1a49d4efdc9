"""Figures as SVG elements of a page: ids of their own, no rule or name that reaches outside, text as text."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from markupsafe import Markup

from flexfem.plot.vector import PlacedSpot, Spot, placed_spots, svg_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawn

SVG = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"
NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
FONTS = "'DejaVu Sans', Verdana, sans-serif"  # Verdana's letters are as wide
LEAST = 5.0  # points, half the size of the smallest spot


def inline_svg(drawn: Drawn | Axes, name: str = "", spots: Sequence[Spot] = (), dpi: int = 120) -> Markup:
    """A matplotlib figure as an SVG element of a page, as wide as its column and at most as wide as it was drawn.

    Parameters
    ----------
    name : begins all ids inside, once on a page; by default made from the content.
    spots : places that tell a value when they are pointed at.
    dpi : of what is rasterised in it.
    """
    content = svg_bytes(drawn, dpi)
    prefix = name or f"f{hashlib.sha256(content).hexdigest()[:10]}"
    root = ElementTree.fromstring(NOT_XML.sub("\ufffd", content.decode()))
    _detach(root, prefix)
    width = float(root.attrib.pop("width").removesuffix("pt"))
    root.attrib.pop("height")
    root.attrib.pop("version", None)
    root.set("class", "drawn")
    root.set("style", f"max-width: {width * 4 / 3:.0f}px")  # 96 px and 72 points an inch
    if spots:
        root.append(_told(placed_spots(drawn, spots)))
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _detach(root: ElementTree.Element, prefix: str) -> None:
    """Take what reaches outside the element out of it: names of other elements, rules, metadata."""
    for part in root.iter():
        for child in [each for each in part if each.tag in (f"{SVG}style", f"{SVG}metadata")]:
            part.remove(child)
        for empty in [each for each in part if each.tag == f"{SVG}defs" and not len(each)]:
            part.remove(empty)
        part.tag = part.tag.removeprefix(SVG)
        if LINK in part.attrib:
            part.set("href", part.attrib.pop(LINK))
        for key, value in part.attrib.items():
            if key == "id":
                part.set(key, f"{prefix}-{value}")
            elif key == "href" and value.startswith("#"):
                part.set(key, f"#{prefix}-{value[1:]}")
            elif key in ("style", "clip-path"):
                part.set(key, value.replace("url(#", f"url(#{prefix}-").replace("'DejaVu Sans'", FONTS))


def _told(spots: Sequence[PlacedSpot]) -> ElementTree.Element:
    group = ElementTree.Element("g", {"class": "spots"})
    for spot in spots:
        half = [max(spot.half_width, LEAST), max(spot.half_height, LEAST)]
        place = {"x": spot.x - half[0], "y": spot.y - half[1], "width": 2 * half[0], "height": 2 * half[1]}
        box = ElementTree.SubElement(group, "rect", {key: f"{value:.2f}" for key, value in place.items()})
        ElementTree.SubElement(box, "title").text = spot.text
    return group
