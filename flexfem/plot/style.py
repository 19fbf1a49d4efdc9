"""House style of all figures, independent of the user's matplotlibrc: colours, headers, panels,
legends, rendering.
"""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from matplotlib.transforms import Bbox

from flexfem.arrays import Array
from flexfem.plot.text import assumption_note, significant
from flexfem.questions.setup import ELASTIC
from flexfem.results import ANALYTIC, ELEMENTS, SOLID
from flexfem.units import Direction

STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.labelsize": 9.5,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "grid.color": "#D5D5D5",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "hatch.linewidth": 0.7,
    "path.simplify": False,
    "text.parse_math": False,  # a label from the user may contain a dollar sign
    "svg.fonttype": "none",
    "svg.hashsalt": "flexfem",
}
NOTE_COLOUR = "#B00000"
INK = "#1A1A1A"
GREY = "#707070"
PALE = "#E4E8EC"
COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#9B4F96",
    "#000000",
    "#56B4E9",
    "#E69F00",
    "#7F7F7F",
)  # Okabe and Ito
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">", "h")
DASHES: tuple[Any, ...] = (
    "solid",
    "dashed",
    "dotted",
    "dashdot",
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (8, 2)),
    (0, (2, 2)),
)
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")
# of a model in every figure: one colour, its marker and its line
MODEL_COLOURS = {
    ANALYTIC: "#0072B2",
    ELASTIC: "#9B4F96",
    ELEMENTS: "#D55E00",
    SOLID: "#D55E00",
}
VISIBLE_BAND = 5e-4  # of a value; smaller bands are left out of figures
NAMES: dict[Direction, str] = {"x": "x", "y": "y", "theta": "\N{GREEK SMALL LETTER THETA}"}
LETTER = {"normal": 0.51, "bold": 0.58}  # mean width of a letter over the font size
TABLE_SIZE = 8.0  # points
MARGIN = 0.3  # in, left and right of the header
RESOLUTION = {
    "png": 150,
    "pdf": 200,
    "svg": 120,
}  # dots per inch; in vector files of rasterised meshes
DATES = {
    "png": "Software",
    "pdf": "CreationDate",
    "svg": "Date",
}  # omitted: equal figures give equal files
MISSING = r"Glyph (\d+) .*missing"  # of matplotlib: a box is drawn instead
_HEADER: ContextVar[list[str] | None] = ContextVar("header", default=None)


@contextmanager
def house_style() -> Iterator[None]:
    """Apply matplotlib's defaults and STYLE within the context, and restore the user's settings
    afterwards.
    """
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=MISSING)  # `rendered` says it once
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


in_house_style = house_style()  # decorator of functions that draw a figure


@contextmanager
def headless() -> Iterator[list[str]]:
    """Draw figures without headers within the context; the yielded list holds the header lines of
    the last figure.
    """
    lines: list[str] = []
    token = _HEADER.set(lines)
    try:
        yield lines
    finally:
        _HEADER.reset(token)


def rendered(figure: Figure, form: str) -> bytes:
    """Return the bytes of a figure file; `form` is png, pdf or svg."""
    buffer = io.BytesIO()
    with house_style(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure.draw_without_rendering()  # the layout of drawings to scale needs two passes
        figure.savefig(
            buffer,
            format=form,
            dpi=RESOLUTION[form],
            metadata={DATES[form]: None},
        )
    missing = set[str]()
    for each in caught:
        if found := re.match(MISSING, str(each.message)):
            missing |= {character for character in chr(int(found[1])) if character.isprintable()}
        else:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
    if missing:
        _warn_of_missing("".join(sorted(missing)))
    return buffer.getvalue()


@cache
def _warn_of_missing(characters: str) -> None:
    """Warn once of characters that the font of the figures lacks."""
    warnings.warn(f"the font of figures has no {characters}: boxes are drawn instead", stacklevel=3)


def drawn_box(figure: Figure) -> Array:
    """Return the corners (2, 2), in, from the lower left one of the figure, of all that is drawn."""
    with house_style():
        return np.asarray(figure.get_tightbbox().get_points())


def wrapped(
    text: str,
    width: float,
    size: float,
    weight: str = "normal",
) -> str:
    """Return a text broken into lines of about `width` inches at a font size in points.

    No word is broken; a path or a name that is longer than a line is, after a point or an
    underscore.
    """
    letters = max(int(72 * width / (LETTER[weight] * size)), 4)
    lines = list[str]()
    for line in textwrap.wrap(text, letters, break_on_hyphens=False, break_long_words=False):
        lines += _divided(line, letters)
    return "\n".join(lines)


def _divided(line: str, letters: int) -> list[str]:
    """Return a line, where it is too long in several, each ending at a joint of its name."""
    found = [""]
    for part in re.split(r"(?<=[._])", line) if len(line) > letters else [line]:
        if found[-1] and len(found[-1]) + len(part) > letters:
            found.append("")
        found[-1] += part
    return found


def _width(
    text: str,
    size: float,
    weight: str,
) -> float:
    """Width, in, of a text on one line."""
    figure = Figure()
    return float(
        figure.text(0, 0, text, size=size, weight=weight).get_window_extent().width / figure.dpi
    )


def below_header(
    size: tuple[float, float], title: str, lines: Sequence[str], assumptions: Any = None
) -> Figure:
    """Return a figure with a header and, below it, an area of `size` inches for constrained layout.

    The header has a title, lines, and a note on the keys `assumed` and `not_stated`, two attributes
    of `assumptions`."""
    width, height = size
    note = assumption_note(assumptions.assumed, assumptions.not_stated) if assumptions else ""
    texts = list[tuple[str, float, str, str]]()
    offsets = [0.0]
    header = _HEADER.get()
    if header is not None:
        header[:] = lines
        note = ""
    else:
        room = width - 2 * MARGIN
        title_room = room - (LETTER["bold"] * 11 / 72 * len(note) + 0.4 if note else 0.0)
        stretch = _width(title, 13, "bold") / (LETTER["bold"] * 13 / 72 * max(len(title), 1))
        texts = [(wrapped(title, title_room / max(stretch, 1.0), 13, "bold"), 13, "bold", INK)]
        texts += [(wrapped(line, 0.92 * room, 9), 9, "normal", "#404040") for line in lines]
        heights = [(text.count("\n") + 1) * points * 1.32 / 72 + 0.06 for text, points, *_ in texts]
        offsets = np.cumsum([0.22, *heights]).tolist()
    total = height + offsets[-1]
    figure = Figure(figsize=(width, total))
    for (text, points, weight, colour), offset in zip(texts, offsets, strict=False):
        style: dict[str, Any] = {
            "size": points,
            "weight": weight,
            "color": colour,
            "va": "top",
            "linespacing": 1.25,
        }
        figure.text(MARGIN / width, 1 - offset / total, text, **style)
    if note:
        box = {
            "boxstyle": "round,pad=0.35",
            "facecolor": "#FFF3E0",
            "edgecolor": NOTE_COLOUR,
            "linewidth": 1.2,
        }
        at = (1 - (MARGIN + 0.08) / width, 1 - 0.25 / total)
        figure.text(
            *at, note, size=11, weight="bold", color=NOTE_COLOUR, ha="right", va="top", bbox=box
        )
    figure.set_layout_engine(
        "constrained", rect=(0.0, 0.0, 1.0, height / total), w_pad=0.18, h_pad=0.1
    )
    return figure


def panels(
    size: tuple[float, float],
    title: str,
    lines: Sequence[str],
    rows: int,
    columns: int = 1,
    assumptions: Any = None,
    count: int | None = None,
    **grid: Any,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a header and, row by row, the first `count` panels (default: all) of a
    grid below it.
    """
    figure = below_header(size, title, lines, assumptions)
    axes = list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid).flat)
    for spare in axes[count:] if count is not None else ():
        spare.remove()
    return figure, axes[:count]


def page(
    size: tuple[float, float],
    title: str,
    lines: Sequence[str],
    plot: Callable[[Axes], object],
    assumptions: Any,
) -> Figure:
    """Return a figure with a header and one panel, which `plot` draws when the size of the panel is
    known.
    """
    figure, (ax,) = panels(size, title, lines, 1, assumptions=assumptions)
    # determines the size of the axes, which the placement of labels needs
    figure.draw_without_rendering()
    plot(ax)
    return figure


def titled(axes: Axes, letter: str, text: str, **style: Any) -> None:
    """Set the left title of a panel: its letter in brackets and a text."""
    axes.set_title(f"({letter}) {text}", loc="left", **style)


def new_axes() -> Axes:
    """Axes of a new pyplot figure, which notebooks display."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def legend_beside(axes: Axes, **look: Any) -> None:
    """Place a legend without a frame to the right of the axes."""
    axes.legend(
        loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, frameon=False, **look
    )


def handles_of(axes: Sequence[Axes]) -> dict[str, Any]:
    """Handles of the legend of panels by label, each label once."""
    return {
        label: handle
        for ax in axes
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int, **look: Any) -> None:
    """Place one legend below the panels, each label once, in at most `columns` columns that fit the
    page.
    """
    handles = handles_of(axes)
    look |= {"loc": "outside lower center", "frameon": False}
    for count in range(columns, 0, -1):
        legend = figure.legend(handles.values(), handles.keys(), ncols=count, **look)
        if count == 1 or legend.get_window_extent().width < figure.bbox.width:
            return
        legend.remove()


def fitted(
    rows: Sequence[Sequence[str]], widths: Sequence[float]
) -> tuple[list[list[str]], list[float]]:
    """Texts of a table, its head first, wrapped to columns of some widths, and the heights of its
    rows; all in in.
    """
    made = [
        [
            wrapped(text, width - 0.12, TABLE_SIZE, weight)
            for text, width in zip(row, widths, strict=True)
        ]
        for row, weight in zip(rows, ["bold", *["normal"] * (len(rows) - 1)], strict=True)
    ]
    return made, [0.14 * max(text.count("\n") + 1 for text in row) + 0.08 for row in made]


def table(
    axes: Axes,
    rows: Sequence[Sequence[str]],
    widths: Sequence[float],
) -> Axes:
    """Write a table, its head first, that fills a panel, with columns in proportion to some widths;
    return `axes`.
    """
    axes.set_axis_off()
    texts, heights = fitted(rows, widths)
    shares = [width / sum(widths) for width in widths]
    made = axes.table(
        texts,
        colWidths=shares,
        cellLoc="left",
        edges="horizontal",
        bbox=Bbox.unit(),
    )
    made.auto_set_font_size(False)
    for (row, column), cell in made.get_celld().items():
        cell.PAD = 0.06 / widths[column]
        cell.set(height=heights[row], linewidth=0.6)
        cell.set_text_props(
            size=TABLE_SIZE,
            weight="normal" if row else "bold",
            linespacing=1.15,
        )
    return axes


def name_rows(
    axes: Axes,
    names: Sequence[str],
    width: float,
    size: float = 8.5,
) -> None:
    """Label rows of bars, the first on top, with names wrapped to `width` inches, and draw a line
    at zero.
    """
    axes.set_yticks(range(len(names)), [wrapped(name, width, size) for name in names], size=size)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.axvline(
        0.0,
        color=GREY,
        linewidth=0.9,
        zorder=4,
    )
    axes.grid(axis="x")


def share_x(axes: Sequence[Axes]) -> None:
    """Give panels one x range, which contains the range of each."""
    limits = np.array([ax.get_xlim() for ax in axes])
    for ax in axes:
        ax.set_xlim(float(limits[:, 0].min()), float(limits[:, 1].max()))


def ring(
    axes: Axes,
    at: Any,
    text: str,
    colour: str = INK,
) -> None:
    """Mark a point by a letter or number in a circle."""
    axes.plot(
        *at,
        "o",
        color="white",
        markeredgecolor=colour,
        markeredgewidth=1.1,
        markersize=12.5,
        zorder=4,
    )
    axes.annotate(
        text, (at[0], at[1]), ha="center", va="center_baseline", size=8.5, weight="bold", zorder=5
    )


def log_ticks(axis: Axis, ends: Sequence[float]) -> None:
    """Set plain-number ticks at powers of ten, and at multiples of these where the range `ends`
    spans few decades.
    """
    decades = np.log10(ends[1] / ends[0])
    subs = range(1, 10) if decades < 1.0 else (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(lambda value, _: significant(value, 1))
    axis.set_minor_locator(NullLocator())
