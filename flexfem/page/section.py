"""Sections, tables and figures of a page, combined into one self-contained HTML file.

The parts of a section are the macros of `templates/parts.html`: `table`, `facts`, `notes`, `folded`
and others."""

from __future__ import annotations

import base64
import colorsys
import hashlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from flexfem.arrays import AnyArray, Array
from flexfem.plot.mesh import boundary_of
from flexfem.plot.style import drawn_box, headless, rendered
from flexfem.plot.text import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEMPLATES = Path(__file__).with_name("templates")
NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
FONTS = "'DejaVu Sans', Verdana, sans-serif"  # both have the same letter widths
POINTS = 72.0  # per inch
PAD = 4.0  # points around a figure
COLOUR = re.compile(
    r"(?<=fill: |roke: )#((?!440154)[0-9a-f]{6})"
)  # in a style of SVG, but for the lowest stress
HATCHED = re.compile(r'fill="(#[0-9a-f]{6})"')  # ground of a hatch
THEMED = re.compile(r"var\(--c([0-9a-f]{6})")
DRAWN = 0.07
WIDE = 560.0
STEP = 1.0  # largest drawn displacement over the size of a plate; its width, steps of lines
TARGET = 5.0  # points, half the side of a pointer target on a marker
MARKERS = 300  # largest number on a curve with pointer targets
HANDLED = '<div class="handle">'  # in a section with a drawing that a hand moves


class PageSection(NamedTuple):
    """A part of a page under a heading; `id` is the anchor of the heading, unique on a page."""

    id: str
    title: str
    html: Markup


Part: TypeAlias = tuple[str, Callable[[], PageSection]]  # a name, and what makes the section


def sentence(text: str) -> str:
    """Return the text with an initial capital and a final full stop."""
    text = text.strip()
    return (
        f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) or not text else '.'}"
    )


ENVIRONMENT = Environment(
    loader=FileSystemLoader(TEMPLATES),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.filters["sentence"] = sentence
parts: Any = ENVIRONMENT.get_template("parts.html").module
table = parts.table
facts = parts.facts
notes = parts.notes
folded = parts.folded


def section(name: str, title: str, *html: Markup) -> PageSection:
    """Return a section of some parts."""
    return PageSection(name, title, Markup("").join(html))


def html_of(sections: list[PageSection], **page: Any) -> str:
    """Return the text of an HTML file.

    `page` : title, subtitle, notice of assumptions, command that makes the page again, time and
    versions."""
    handled = any(HANDLED in section.html for section in sections)
    names = ("page", "handle") if handled else ("page",)
    scripts = [(TEMPLATES / f"{name}.js").read_text() for name in names]
    style = "".join((TEMPLATES / f"{name}.css").read_text() for name in reversed(names))
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src {' '.join(map(_digest, scripts))}; base-uri 'none'; form-action 'none'"
    )
    used = sorted({colour for section in sections for colour in THEMED.findall(section.html)})
    dark = "".join(f"--c{colour}: {dark_of(colour)}; " for colour in used)
    style += f"@media screen and (prefers-color-scheme: dark) {{ svg.drawn {{ {dark}}} }}\n"
    code = {"policy": policy, "scripts": [*map(Markup, scripts)], "style": Markup(style)}
    return ENVIRONMENT.get_template("page.html").render(sections=sections, **page, **code)


def _digest(script: str) -> str:
    """Return the source of a policy that allows one script; no other may run."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return f"'sha256-{digest}'"


def dark_of(colour: str) -> str:
    """Return the colour of the dark theme in place of six hexadecimal digits: the hue stays, light
    becomes dark.
    """
    hue, light, saturation = colorsys.rgb_to_hls(*(part / 255 for part in bytes.fromhex(colour)))
    return f"#{bytes(round(255 * x) for x in colorsys.hls_to_rgb(hue, 0.92 - 0.83 * light, saturation)).hex()}"  # noqa: E501


def shown_figure(
    name: str, draw: Callable[[], Figure], description: str, data: Markup | None = None
) -> Markup:
    """Return a figure of the package as a part of a section, with the lines of its header as the
    caption.

    `name` : id, unique on a page.   `description` : for a screen reader.   `data` : table of its
    numbers."""
    with headless() as lines:
        figure = draw()
    svg = inline_svg(figure, name)
    return Markup(parts.framed(name, svg, " ".join(map(sentence, lines)), description, data))


def moving_svg(
    nodes: Array,
    triangles: AnyArray,
    field: Array,
    swings: bool = True,
) -> Markup:
    """Return a mesh (n, 2) that moves by a field (n, 2), exaggerated, in front of its outline at
    rest.

    swings : to both sides of the position at rest, as a mode; otherwise from rest to the field and
    back."""
    low = nodes.min(axis=0)
    size = np.ptp(nodes, axis=0)
    largest = float(np.linalg.norm(field, axis=1).max()) or 1.0
    room = (DRAWN + 0.01) * size.max()
    scale = WIDE / (size[0] + 2 * room)
    width = size + 2 * room
    following = {
        int(first): (int(middle), int(last)) for first, last, middle in boundary_of(triangles)
    }
    loops = list[list[int]]()
    while following:
        at = next(iter(following))
        loops.append([at])
        while at in following:
            middle, last = following.pop(at)
            for node in (middle, last):
                if scale * np.linalg.norm(nodes[node] - nodes[loops[-1][-1]]) >= STEP:
                    loops[-1].append(node)
            at = last

    def path(share: float) -> str:
        moved = (nodes + share * DRAWN * float(size.max()) / largest * field - low + room) * scale
        moved[:, 1] = width[1] * scale - moved[:, 1]
        return "".join(
            "M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in moved[loop].tolist()) + "Z"
            for loop in loops
        )

    rest = path(0.0)
    ends = (path(1.0), path(-1.0)) if swings else (path(0.0), path(1.0))
    return Markup(parts.moving(WIDE, float(width[1] * scale), rest, ends))


def inline_svg(figure: Figure, name: str) -> Markup:
    """Return a figure as an SVG element, as wide as its column but at most as wide as it was drawn.

    Its ids begin with `name`; markers of curves and bars show their values under the pointer.
    """
    text = NOT_XML.sub("\ufffd", rendered(figure, "svg").decode())
    text = re.sub(
        r"(?s)<metadata>.*?</metadata>|<defs>\s*<style.*?</defs>", "", text[text.index("<svg") :]
    )
    text = re.sub(r'\b(id="|href="#)', rf"\1{name}-", text.replace("url(#", f"url(#{name}-"))
    text = re.sub(
        r' d="[^"]*"', lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), text
    )  # hundredths of a point
    text = HATCHED.sub(r'style="fill: \1"', text.replace("'DejaVu Sans'", FONTS))
    text = COLOUR.sub(r"var(--c\1, #\1)", text)
    (left, low), (right, high) = drawn_box(figure) * POINTS
    box = (
        left - PAD,
        figure.get_figheight() * POINTS - high - PAD,
        right - left + 2 * PAD,
        high - low + 2 * PAD,
    )
    opening = f'<svg class="drawn" style="--wide: {box[2] / 0.75:.0f}px" viewBox="{" ".join(f"{x:.1f}" for x in box)}"'  # noqa: E501
    text = re.sub(
        r'<svg\b|\s(width|height|viewBox)="[^"]*"', lambda m: "" if m[1] else opening, text, count=4
    )
    rect = Markup(
        '<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}"><title>{}</title></rect>'
    ).format
    targets = [
        rect(*low, *(high - low), text)
        for low, high, text in _targets(figure)
        if np.isfinite(high + low).all()
    ]
    return Markup(
        text.replace(
            "</svg>", f'<g class="spots">{"".join(targets)}</g></svg>' if targets else "</svg>"
        )
    )


def _targets(figure: Figure) -> Iterator[tuple[Array, Array, str]]:
    """Yield two corners in points from the upper left one of the figure, and text, of all markers
    and bars.
    """
    for ax in figure.axes:
        x_name = ax.get_xlabel() or figure.axes[-1].get_xlabel()
        y_name = ax.get_ylabel().replace("\n", " ")
        for line in ax.lines:
            xy = np.asarray(line.get_xydata(), dtype=float)
            name = str(line.get_label()).strip()
            if (
                line.get_marker() in ("None", "", None)
                or line.get_transform() != ax.transData
                or len(xy) > MARKERS
            ):
                continue
            for (x, y), at in zip(xy.tolist(), places_on(ax, xy), strict=True):
                text = f"{x_name}: {significant(x)}\n{y_name}: {significant(y)}"
                yield at - TARGET, at + TARGET, text if name.startswith("_") else f"{name}\n{text}"
        rows = {
            round(at): name.get_text()
            for at, name in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
        }
        for bars in ax.containers:
            name = "" if str(bars.get_label()).startswith("_") else f", {bars.get_label()}"
            for bar in getattr(bars, "patches", ()):
                corners = places_on(ax, bar.get_corners()[[0, 2]])
                row = rows.get(round(bar.get_y() + bar.get_height() / 2), "").replace("\n", " ")
                text = f"{row}{name}\n{x_name}: {significant(bar.get_width())}"
                yield corners.min(axis=0), corners.max(axis=0), text


def places_on(ax: Axes, points: Array) -> Array:
    """Map data points (n, 2) of axes to points from the upper left corner of the figure; nan
    outside the axes.
    """
    figure = ax.get_figure(root=True)
    assert figure is not None
    places = ax.transData.transform(points)
    low, high = ax.get_window_extent().get_points()
    inside = ((places >= low - 1.0) & (places <= high + 1.0)).all(axis=1)
    shown = np.where(inside[:, None], places * POINTS / figure.dpi, np.nan)
    return np.asarray(np.abs([0.0, figure.get_figheight() * POINTS] - shown))
