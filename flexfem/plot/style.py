"""One look for all figures, whatever the user's matplotlibrc says, and the same bytes every time."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.textpath import text_to_path
from matplotlib.transforms import Bbox

from flexfem.arrays import Array
from flexfem.plot.text import doubt_note

P = ParamSpec("P")

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
    "pdf.fonttype": 3,
    "text.parse_math": False,  # a label of the user may hold a dollar
    "agg.path.chunksize": 0,
}
NOTE_COLOUR = "#B00000"
INK, GREY, PALE = "#1A1A1A", "#707070", "#E4E8EC"
PLACES = 9  # decimals of places in parts of a figure: round-off is far below them, and pixels far above
MARGIN = 0.3  # in, left and right of the header
RESOLUTION = {"png": 150, "pdf": 200}  # dots per inch, in a PDF of the rasterised meshes only
_SAID: ContextVar[list[str] | None] = ContextVar("said", default=None)
METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": "flexfem", "Producer": "matplotlib"},
}


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's own defaults and STYLE on top, whatever was set before, which comes back afterwards."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def in_house_style(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Decorate a plot function so that it draws in the house style."""

    @wraps(draw)
    def styled(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with house_style():
            return draw(*args, **kwargs)

    return styled


@contextmanager
def headless() -> Iterator[list[str]]:
    """Let figures drawn meanwhile have no header; yields the lines that the last one would have had below its title."""
    lines: list[str] = []
    token = _SAID.set(lines)
    try:
        yield lines
    finally:
        _SAID.reset(token)


class SteadyLayout(ConstrainedLayoutEngine):
    """Constrained layout with the places of axes rounded: its solver adds in the order of addresses in memory."""

    def execute(self, fig: Any) -> Any:
        """As of any layout engine."""
        found = super().execute(fig)
        for axes in fig.axes:  # those of its subfigures, too
            axes._set_position(Bbox(_steady(axes.get_position(original=True))))
        for part in fig.subfigs:
            part.bbox_relative.set_points(_steady(part.bbox_relative))
        return found


def _steady(box: Any) -> Array:
    """Corners (2, 2) of a box, in parts of a figure."""
    return np.asarray(np.round(box.get_points(), PLACES))


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, in inches, outside pyplot and without a window."""
    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def rendered(figure: Figure, form: str) -> bytes:
    """The figure as the bytes of a file, `form` png or pdf; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    with house_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a box stands for it
        figure.savefig(buffer, format=form, dpi=RESOLUTION[form], metadata=METADATA[form])
    return buffer.getvalue()


@cache  # notes and captions are broken anew whenever a figure is laid out again
def text_width(text: str, size: float, weight: str = "normal") -> float:
    """Width, in inches, of a line of text at a size in points."""
    font = FontProperties(family="DejaVu Sans", size=size, weight=weight)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]) / 72.0


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> str:
    """The text broken into lines no wider than `width`, in inches; a word that is too long is broken too."""
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if _fits(longer, width, size, weight):
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, size, weight) > width:
                lines.append("")
            lines[-1] += letter
    return "\n".join(lines)


def _fits(line: str, width: float, size: float, weight: str) -> bool:
    """Whether a line is no wider: half an em is more than a blank, and words, unlike lines, were measured before."""
    at_most = sum(text_width(word, size, weight) + size / 144 for word in line.split(" "))
    return at_most <= width or text_width(line, size, weight) <= width


def header(
    figure: Figure, title: str, lines: Sequence[str], assumed: Sequence[str], not_stated: Sequence[str] = ()
) -> float:
    """Write title, lines below it and the note on numbers in doubt; returns the height used, in inches."""
    said = _SAID.get()
    if said is not None:
        said[:] = lines
        return 0.0
    width, height = figure.get_size_inches()
    note = doubt_note(assumed, not_stated)
    room = width - 2 * MARGIN
    beside = room - (text_width(note, 11, "bold") + 0.5 if note else 0.0)
    used = 0.22
    for text, size, weight, colour in [(title, 13, "bold", INK), *((line, 9, "normal", "#404040") for line in lines)]:
        shown = wrapped(text, beside if weight == "bold" else room, size, weight)
        figure.text(
            MARGIN / width, 1 - used / height, shown, size=size, weight=weight, color=colour, va="top", linespacing=1.25
        )
        used += (shown.count("\n") + 1) * size * 1.32 / 72 + 0.06
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

    `doubts` : keys that are assumed, and those without a source.   `grid` : settings of matplotlib's GridSpec.
    """
    figure = below_header(size, title, lines, doubts)
    return figure, list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid).flat)


def below_header(size: tuple[float, float], title: str, lines: Sequence[str], doubts: Any = ((), ())) -> Figure:
    """A figure with a header as `panels` has it, without panels, and a layout engine for what is below."""
    width, height = size
    used = header(new_figure(width, height), title, lines, *doubts)
    figure = new_figure(width, height + used)
    header(figure, title, lines, *doubts)
    rect = (0.0, 0.0, 1.0, height / (height + used))
    figure.set_layout_engine(SteadyLayout(rect=rect, w_pad=0.18, h_pad=0.1))
    return figure


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


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches from the lower left corner of the figure."""
    w, h = figure.get_size_inches()
    return figure.add_axes((left / w, bottom / h, width / w, height / h))
