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
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.text import doubt_note
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
    "agg.path.chunksize": 0,
    "svg.fonttype": "none",
    "svg.hashsalt": "flexfem",
}
NOTE_COLOUR = "#B00000"
INK, GREY, PALE = "#1A1A1A", "#707070", "#E4E8EC"
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#9B4F96", "#000000", "#56B4E9", "#E69F00", "#7F7F7F")  # Okabe and Ito
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">", "h")
DASHES: tuple[Any, ...] = (
    "solid",
    (0, (5, 2)),
    (0, (1.2, 1.2)),
    (0, (7, 2, 1.2, 2)),
    (0, (3, 1.2, 1.2, 1.2, 1.2, 1.2)),
    (0, (10, 3)),
    (0, (2.5, 2.5)),
)
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")
NAMES: dict[Direction, str] = {"x": "X", "y": "Y", "theta": "\N{GREEK SMALL LETTER THETA}"}
LETTER = {"normal": 0.51, "bold": 0.58}  # mean width of a letter, over the size of the text
MARGIN = 0.3  # in, left and right of the header
RESOLUTION = {"png": 150, "pdf": 200, "svg": 120}  # dots per inch, in vector files of rasterised meshes only
METADATA: dict[str, dict[str, Any]] = {  # without dates, so that equal figures are equal files
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
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


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, in inches, outside pyplot and without a window."""
    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def rendered(figure: Figure, form: str) -> bytes:
    """The figure as the bytes of a file, `form` png, pdf or svg."""
    buffer = io.BytesIO()
    with house_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a box stands for it
        figure.savefig(buffer, format=form, dpi=RESOLUTION[form], metadata=METADATA[form])
    return buffer.getvalue()


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> str:
    """The text broken into lines about as wide as `width`, in inches, in letters of a size in points."""
    return textwrap.fill(text, max(int(72 * width / (LETTER[weight] * size)), 4), break_on_hyphens=False)


def header(
    figure: Figure, title: str, lines: Sequence[str], assumed: Sequence[str], not_stated: Sequence[str] = ()
) -> float:
    """Write title, lines below it and the note on numbers in doubt; returns the height used, in inches."""
    hidden = _HIDDEN.get()
    if hidden is not None:
        hidden[:] = lines
        return 0.0
    width, height = figure.get_size_inches()
    note, room = doubt_note(assumed, not_stated), width - 2 * MARGIN
    beside = room - (LETTER["bold"] * 11 / 72 * len(note) + 0.4 if note else 0.0)
    texts = [(wrapped(title, beside, 13, "bold"), 13, "bold", INK)]
    texts += [(wrapped(line, room, 9), 9, "normal", "#404040") for line in lines]
    used = 0.22
    for text, size, weight, colour in texts:
        style: dict[str, Any] = {"size": size, "weight": weight, "color": colour, "va": "top", "linespacing": 1.25}
        figure.text(MARGIN / width, 1 - used / height, text, **style)
        used += (text.count("\n") + 1) * size * 1.32 / 72 + 0.06
    if note:
        box = {"boxstyle": "round,pad=0.35", "facecolor": "#FFF3E0", "edgecolor": NOTE_COLOUR, "linewidth": 1.2}
        at = (1 - (MARGIN + 0.08) / width, 1 - 0.25 / height)
        figure.text(*at, note, size=11, weight="bold", color=NOTE_COLOUR, ha="right", va="top", bbox=box)
    return used


def panels(
    size: tuple[float, float],
    title: str,
    lines: Sequence[str],
    rows: int,
    columns: int = 1,
    doubts: Any = ((), ()),
    **grid: Any,
) -> tuple[Figure, list[Axes]]:
    """A figure of panels below a header, row by row, laid out by matplotlib, so wide and the panels so high in inches.

    `doubts` : keys that are assumed and those without a source, or what has both.   `grid` : of matplotlib's GridSpec.
    """
    figure = below_header(size, title, lines, doubts)
    return figure, list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid).flat)


def below_header(size: tuple[float, float], title: str, lines: Sequence[str], doubts: Any = ((), ())) -> Figure:
    """A figure with a header as `panels` has it, without panels, and a layout engine for what is below."""
    width, height = size
    doubts = (doubts.assumed, doubts.not_stated) if hasattr(doubts, "assumed") else doubts
    used = header(new_figure(width, height), title, lines, *doubts)
    figure = new_figure(width, height + used)
    header(figure, title, lines, *doubts)
    rect = (0.0, 0.0, 1.0, height / (height + used))
    figure.set_layout_engine("constrained", rect=rect, w_pad=0.18, h_pad=0.1)
    return figure


def titled(axes: Axes, letter: str, text: str, **style: Any) -> None:
    """A title at the left of a panel: (a) and its text."""
    axes.set_title(f"({letter}) {text}", loc="left", **style)


def inches(ax: Axes) -> Array:
    """Width and height (2,) of axes at this moment, in inches; a layout engine may change them later."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return np.array(ax.get_window_extent().size) / figure.dpi


def new_axes() -> Axes:
    """Axes of a new figure of pyplot's, which notebooks show."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def legend_beside(axes: Axes, **look: Any) -> None:
    """The legend to the right of the axes, without a frame."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, frameon=False, **look)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int, **look: Any) -> None:
    """One legend below the panels, each label once."""
    named = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=columns, frameon=False, **look)


def boxed(axes: Axes, y: float, text: str) -> None:
    """A remark in a box, in the middle of a panel at a share of its height."""
    box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.7}
    axes.text(0.5, y, text, transform=axes.transAxes, ha="center", va="center", color=INK, size=10, bbox=box)


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches from the lower left corner of the figure."""
    w, h = figure.get_size_inches()
    return figure.add_axes((left / w, bottom / h, width / w, height / h))
