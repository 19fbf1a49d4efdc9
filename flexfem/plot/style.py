"""One look for all figures, whatever the user's matplotlibrc says: colours, panels, headers, and files of figures."""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from flexfem.plot.text import assumption_note, significant
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
    "text.parse_math": False,  # a label of the user may hold a dollar
    "svg.fonttype": "none",
    "svg.hashsalt": "flexfem",
}
NOTE_COLOUR, INK, GREY, PALE = "#B00000", "#1A1A1A", "#707070", "#E4E8EC"
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#9B4F96", "#000000", "#56B4E9", "#E69F00", "#7F7F7F")  # Okabe and Ito
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">", "h")
DASHES: tuple[Any, ...] = ("solid", "dashed", "dotted", "dashdot", (0, (3, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (2, 2)))
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")
NAMES: dict[Direction, str] = {"x": "X", "y": "Y", "theta": "\N{GREEK SMALL LETTER THETA}"}
LETTER = {"normal": 0.51, "bold": 0.58}  # mean width of a letter, over the size of the text
MARGIN = 0.3  # in, left and right of the header
RESOLUTION = {"png": 150, "pdf": 200, "svg": 120}  # dots per inch, in vector files of rasterised meshes only
DATES = {"png": "Software", "pdf": "CreationDate", "svg": "Date"}  # left out, so that equal figures are equal files
_HIDDEN: ContextVar[list[str] | None] = ContextVar("hidden", default=None)


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's own defaults and STYLE on top, whatever was set before, which comes back afterwards."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


in_house_style = house_style()  # decorates what draws a figure


@contextmanager
def headless() -> Iterator[list[str]]:
    """Let figures drawn meanwhile have no header; yields the lines that the last one would have had below its title."""
    lines: list[str] = []
    token = _HIDDEN.set(lines)
    try:
        yield lines
    finally:
        _HIDDEN.reset(token)


def rendered(figure: Figure, form: str) -> bytes:
    """The figure as the bytes of a file, `form` png, pdf or svg."""
    buffer = io.BytesIO()
    with house_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a box stands for it
        figure.savefig(buffer, format=form, dpi=RESOLUTION[form], metadata={DATES[form]: None})
    return buffer.getvalue()


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> str:
    """The text broken into lines about as wide as `width`, in inches, in letters of a size in points."""
    return textwrap.fill(text, max(int(72 * width / (LETTER[weight] * size)), 4), break_on_hyphens=False)


def _width(text: str, size: float, weight: str) -> float:
    """Width in inches of a text on one line."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure = Figure()
        return float(figure.text(0, 0, text, size=size, weight=weight).get_window_extent().width / figure.dpi)


def below_header(size: tuple[float, float], title: str, lines: Sequence[str], assumptions: Any = None) -> Figure:
    """A figure with a header, and so much room below it, in inches, which matplotlib lays out.

    The header is a title, lines, and a note on keys that are `assumed` or `not_stated`, attributes of `assumptions`.
    """
    (width, height), note = size, assumption_note(assumptions.assumed, assumptions.not_stated) if assumptions else ""
    texts, ends, hidden = list[tuple[str, float, str, str]](), [0.0], _HIDDEN.get()
    if hidden is not None:
        hidden[:], note = lines, ""
    else:
        room = width - 2 * MARGIN
        beside = room - (LETTER["bold"] * 11 / 72 * len(note) + 0.4 if note else 0.0)
        average = LETTER["bold"] * 13 / 72 * max(len(title), 1)
        wide = _width(title, 13, "bold") / average
        texts = [(wrapped(title, beside / max(wide, 1.0), 13, "bold"), 13, "bold", INK)]
        texts += [(wrapped(line, 0.92 * room, 9), 9, "normal", "#404040") for line in lines]
        heights = [(text.count("\n") + 1) * points * 1.32 / 72 + 0.06 for text, points, *_ in texts]
        ends = np.cumsum([0.22, *heights]).tolist()
    whole = height + ends[-1]
    figure = Figure(figsize=(width, whole))
    for (text, points, weight, colour), down in zip(texts, ends, strict=False):
        style: dict[str, Any] = {"size": points, "weight": weight, "color": colour, "va": "top", "linespacing": 1.25}
        figure.text(MARGIN / width, 1 - down / whole, text, **style)
    if note:
        box = {"boxstyle": "round,pad=0.35", "facecolor": "#FFF3E0", "edgecolor": NOTE_COLOUR, "linewidth": 1.2}
        at = (1 - (MARGIN + 0.08) / width, 1 - 0.25 / whole)
        figure.text(*at, note, size=11, weight="bold", color=NOTE_COLOUR, ha="right", va="top", bbox=box)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, height / whole), w_pad=0.18, h_pad=0.1)
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
    """A figure as `below_header`, with so many panels below it, row by row, by default all of the grid."""
    figure = below_header(size, title, lines, assumptions)
    axes = list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid).flat)
    for spare in axes[count:] if count is not None else ():
        spare.remove()
    return figure, axes[:count]


def titled(axes: Axes, letter: str, text: str, **style: Any) -> None:
    """A title at the left of a panel: (a) and its text."""
    axes.set_title(f"({letter}) {text}", loc="left", **style)


def new_axes() -> Axes:
    """Axes of a new figure of pyplot's, which notebooks show."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def legend_beside(axes: Axes, **look: Any) -> None:
    """The legend to the right of the axes, without a frame."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, frameon=False, **look)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int, **look: Any) -> None:
    """One legend below the panels, each label once, in so many columns, or fewer where these are too wide."""
    named = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    look |= {"loc": "outside lower center", "frameon": False}
    for count in range(columns, 0, -1):
        legend = figure.legend(named.values(), named.keys(), ncols=count, **look)
        if count == 1 or legend.get_window_extent().width < figure.bbox.width:
            return
        legend.remove()


def boxed(axes: Axes, y: float, text: str) -> None:
    """A remark in a box, in the middle of a panel at a share of its height."""
    box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.7}
    axes.text(0.5, y, text, transform=axes.transAxes, ha="center", va="center", color=INK, size=10, bbox=box)


def name_rows(axes: Axes, names: Sequence[str], width: float, size: float = 8.5) -> None:
    """Names beside rows of bars, the first on top, in lines so wide in inches; and a line at zero."""
    axes.set_yticks(range(len(names)), [wrapped(name, width, size) for name in names], size=size)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.9, zorder=4)
    axes.grid(axis="x")


def share_x(every: Sequence[Axes]) -> None:
    """One scale along x for panels, from the least to the largest end."""
    ends = np.array([axes.get_xlim() for axes in every])
    for axes in every:
        axes.set_xlim(float(ends[:, 0].min()), float(ends[:, 1].max()))


def ring(axes: Axes, at: Any, text: str, colour: str = INK) -> None:
    """A place marked by a letter or number in a circle."""
    axes.plot(*at, "o", color="white", markeredgecolor=colour, markeredgewidth=1.1, markersize=12.5, zorder=4)
    axes.annotate(text, (at[0], at[1]), ha="center", va="center_baseline", size=8.5, weight="bold", zorder=5)


def log_ticks(axis: Axis, ends: Sequence[float]) -> None:
    """Ticks between the ends at powers of ten, and at multiples of them where there are few, as plain numbers."""
    decades = np.log10(ends[1] / ends[0])
    subs = range(1, 10) if decades < 1.0 else (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(lambda value, _: significant(value, 1))
    axis.set_minor_locator(NullLocator())
