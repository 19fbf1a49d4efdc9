"""Figures of studies: maps, fronts, histograms and Sobol indices, with what their axes and captions are called."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
from matplotlib.colors import CenteredNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from flexfem.arrays import AnyArray, Array, Index, wide
from flexfem.files.refusals import path_of
from flexfem.plot.stage import Outline, draw_outline
from flexfem.plot.style import (
    DASHES,
    GREY,
    INK,
    NOTE_COLOUR,
    add_axes,
    header,
    in_house_style,
    inches,
    legend_beside,
    new_figure,
    panels,
    wrapped,
)
from flexfem.plot.text import SPACE, round_factor, significant
from flexfem.study.columns import LABELS, STRESSES
from flexfem.study.factors import Column
from flexfem.study.findings import Indices, Percentile
from flexfem.study.plan import Method
from flexfem.units import LENGTH, unit_of, without_unit

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy
    from flexfem.study.plan import Study

METHODS: dict[Method, str] = {
    "grid": "grid",
    "latin_hypercube": "Latin hypercube",
    "sobol": "Sobol",
    "monte_carlo": "Monte Carlo",
    "saltelli": "Saltelli",
    "table": "a table of designs",
}
WORDS = {"youngs modulus": "Young's modulus", "poissons ratio": "Poisson's ratio"}


class Quantity(NamedTuple):
    """What an axis shows: its name, its unit or nothing, the name with a symbol in it, whether it is logarithmic."""

    name: str
    unit: str = ""
    symbol: str = ""
    log: bool = False

    @property
    def label(self) -> str:
        """Name, with its symbol, and unit; mathematics where there is a symbol."""
        name = self.symbol or self.name
        return f"{name} in {self.unit}" if self.unit else name

    @property
    def after(self) -> str:
        """The unit as it follows a number, with a space that does not break."""
        return SPACE + self.unit.replace(" ", SPACE) if self.unit else ""


class Caption(NamedTuple):
    """What stands above a figure: its title, lines on how the numbers came about, the key paths in doubt."""

    title: str
    lines: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str] = ()


def output(column: str, study: Study | None = None) -> Quantity:
    """What an output column of a study is called, with the known error of a stress by finite elements."""
    name, symbol = LABELS.get(column, (column, ""))
    if column in STRESSES and study is not None and study.stress_below:
        name = f"{name} ({study.stress_below})"
    return Quantity(name, unit_of(column).name, symbol, column == "life_cycles")


def factor(column: Column) -> Quantity:
    """What a factor is called: by the label the study gives it, else in words by the keys it sets."""
    units = {unit_of(key).name for key in column.keys}
    name = column.factor.label or " = ".join(words(without_unit(key)) for key in column.keys)
    return Quantity(name, units.pop() if len(units) == 1 else "", log=column.factor.scale == "log")


def words(key: str) -> str:
    """A key path, without its unit, in words: `override.2.elbow.neck` is `neck, chain 2 elbow`."""
    *tables, last = path_of(key)
    leaf = str(last) if isinstance(last, str) else f"{str(tables.pop()).removesuffix('s')} {last + 1}"
    leaf = WORDS.get(leaf := leaf.replace("_", " "), leaf)
    match tables:
        case ["override", chain, "actuator", name]:
            return f"{leaf}, chain {chain} actuator {name}"
        case ["actuator", name]:
            return f"{leaf} of actuator {name}"
        case ["override", chain, hinge]:
            return f"{leaf}, chain {chain} {hinge}"
        case ["hinges", hinge]:
            return f"{leaf} of {hinge} hinges"
        case ["platform" | "frame" as body]:
            return f"{leaf} of the {body}"
    return leaf


def caption_of(loaded: LoadedStudy, table: StudyTable, title: str, lines: Sequence[str]) -> Caption:
    """Title, study, model, sampling and how many designs have an answer, then the lines of the figure."""
    study = loaded.study
    method, seed = METHODS[study.sampling.method], study.sampling.seed
    drawn = method if seed is None else f"{method}, seed {seed}"
    if loaded.given is not None:
        drawn = f"table {loaded.given.path.name}"
    about = f"Study: {study.name}. Base stage: {loaded.stage.name}."
    found = (
        f"{model_words(loaded)}. {thousands(loaded.count)} designs ({drawn}): {counted(table.counts, loaded.count)}."
    )
    return Caption(title, [about, found, *lines], loaded.assumed, loaded.not_stated)


def model_words(loaded: LoadedStudy) -> str:
    """What answered, in words."""
    study = loaded.study
    mobility = study.mobility or loaded.stage.mobility
    analytic = f"{study.formula}, mobility {mobility}" + (", elastic links" if study.links else "")
    meshed = f"{study.resolution} triangles across every neck"
    layers = f"{study.layers} layer{'s' * (study.layers > 1)}"
    plane = "" if loaded.stage.model == "plane_stress" else f", {loaded.stage.model.replace('_', ' ')}"
    return {
        "analytic": f"Analytic model: {analytic}{plane}",
        "fe": f"Finite elements: {meshed}{plane}",
        "three_dimensional": f"Finite elements in three dimensions: {meshed}, {layers} in half the thickness",
        "verify": f"Finite elements ({meshed}) against the analytic model ({analytic}){plane}",
    }[study.model]


def counted(counts: Mapping[str, int], wanted: int = 0) -> str:
    """How many designs have which status, and how many of those wanted are still open: `9 871 ok, 129 refused`."""
    found = dict(counts)
    missing = wanted - sum(found.values())
    if missing > 0:
        found["open"] = missing
    return ", ".join(f"{thousands(count)} {status}" for status, count in found.items())


def thousands(count: int) -> str:
    """A count with its thousands apart."""
    return f"{count:,}".replace(",", SPACE)


FEW_DECADES = 2.5  # up to which 2 and 5 have ticks between the powers of ten


def name_axis(axes: Axes, which: Literal["x", "y"], quantity: Quantity, ends: tuple[float, float]) -> None:
    """Scale, label and ticks of an axis that goes from one end to the other."""
    if quantity.log:
        axes.set(**{f"{which}scale": "log"})
    axes.set(**{f"{which}lim": ends})
    axis: Axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_label_text(quantity.label, parse_math=bool(quantity.symbol))
    if quantity.log:
        log_ticks(axis, ends)


def log_ticks(axis: Axis, ends: tuple[float, float]) -> None:
    """Ticks at powers of ten, and at multiples of them where there are few, written as plain numbers."""
    decades = float(np.log10(ends[1] / ends[0]))
    subs = range(1, 10) if decades < 1.0 else (1.0, 2.0, 5.0) if decades < FEW_DECADES else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    axis.set_minor_locator(LogLocator(subs=range(2, 10)) if decades < 2 * FEW_DECADES else NullLocator())
    axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))


def ends_of(values: Array, log: bool, room: float = 0.04) -> tuple[float, float]:
    """Where an axis begins and ends that shows finite values with some room on both sides."""
    places = np.log(values) if log else values
    low, high = float(places.min()), float(places.max())
    margin = room * (high - low) or 0.05 * (abs(high) or 1.0)
    ends = (low - margin, high + margin)
    return (float(np.exp(ends[0])), float(np.exp(ends[1]))) if log else ends


WIDTH, AXES_LEFT, AXES_WIDTH, AXES_HEIGHT, FOOT = 8.27, 0.85, 7.1, 4.0, 0.7  # in
ACROSS, LEFT, CELL, LINE, LETTERS = (
    4,
    0.4,
    1.75,
    0.155,
    7.5,
)  # drawings in a row; their left, width and text, in; points
DOTS = 5000  # more are rasterised in a PDF
MOST_DOTS = 100_000  # of more designs that many are drawn, taken at random, always the same ones
FRONT_COLOUR = "#0072B2"


class Chosen(NamedTuple):
    """A design of the front to draw: its `place` among the points, its outline, and what to write below it."""

    place: int
    outline: Outline
    lines: Sequence[str]


class ParetoFront(NamedTuple):
    """What the figure shows.

    x, y : what the axes are; x_better, y_better : "larger" or "smaller".
    points : (n, 2), values x and y of every design that has them.   front : (m,), places of the best ones, in order.
    undrawable : (k,), places of designs that would be on the front or beyond it, but cannot be drawn.
    chosen : some of the front, in order.   left_out : what is not drawn, one line each, for the legend.
    base : x and y of the base stage, where known.
    """

    caption: Caption
    x: Quantity
    y: Quantity
    x_better: str
    y_better: str
    points: Array
    front: Index
    undrawable: Index
    chosen: Sequence[Chosen]
    left_out: Sequence[str]
    base: tuple[float, float] | None = None


class RowLayout(NamedTuple):
    """How the drawings are laid out: `number` of rows `row` in high, of cells (in) that show `low` to `high` (mm)."""

    low: Array
    high: Array
    cell: tuple[float, float]
    row: float
    number: int

    @property
    def height(self) -> float:
        """Of all rows and the scale below them, in."""
        return self.number * self.row + (0.4 if self.number else 0.1)


@in_house_style
def pareto_figure(shown: ParetoFront) -> Figure:
    """Draw the front, and the chosen designs in rows below.

    The drawings are to one scale, as is the bar below them, so everything here has its place in inches.
    """
    rows = rows_for(shown.chosen)
    entries = 2 + (shown.base is not None) + bool(len(shown.undrawable)) + len(shown.left_out)
    legend = 0.19 * -(-entries // 2) + 0.2
    used = header(new_figure(WIDTH, 10.0), *shown.caption)
    figure = new_figure(WIDTH, used + legend + AXES_HEIGHT + FOOT + rows.height)
    header(figure, *shown.caption)
    axes = add_axes(figure, AXES_LEFT, rows.height + FOOT, AXES_WIDTH, AXES_HEIGHT)
    plot_front(axes, shown)
    for index, chosen in enumerate(shown.chosen):
        draw_design(figure, rows, index, chosen, letter(index))
    if rows.number:
        draw_scale(add_axes(figure, LEFT, 0.08, CELL, 0.26), float(rows.high[0] - rows.low[0]))
    return figure


def plot_front(ax: Axes, shown: ParetoFront) -> Axes:
    """Draw every design as a dot, the front as a line, and the letters of the chosen designs; returns `ax`."""
    _draw_points(ax, shown)
    _set_axes(ax, shown)
    _draw_legend(ax, shown)
    return ax


def rows_for(designs: Sequence[Chosen]) -> RowLayout:
    """RowLayout with room for the widest outline, all to one scale, and for the longest text."""
    if not designs:
        return RowLayout(np.zeros(2), np.ones(2), (CELL, CELL), 0.0, 0)
    bodies = [body for chosen in designs for body in chosen.outline.bodies]
    low, high = np.min([b.min(axis=0) for b in bodies], axis=0), np.max([b.max(axis=0) for b in bodies], axis=0)
    room = 0.02 * float(high[0] - low[0])
    low, high = low - room, high + room
    height = CELL * float((high[1] - low[1]) / (high[0] - low[0]))
    lines = max(_text(chosen, "A").count("\n") + 1 for chosen in designs)
    return RowLayout(low, high, (CELL, height), height + LINE * lines + 0.25, -(-len(designs) // ACROSS))


def letter(index: int) -> str:
    """The letter of a chosen design: A, B, C."""
    return chr(ord("A") + index)


def _draw_points(axes: Axes, shown: ParetoFront) -> None:
    dots = thinned(shown.points)
    many = len(dots) > DOTS
    look: dict[str, Any] = {"marker": "o", "linestyle": "none", "markeredgewidth": 0, "color": GREY}
    alpha = float(np.clip(600.0 / max(len(dots), 1), 0.06, 0.5))
    size = 1.6 if many else 2.8
    axes.plot(*dots.T, **look, markersize=size, alpha=alpha, rasterized=many, zorder=1)
    x, y = shown.points[shown.front].T
    if len(shown.undrawable):
        name = f"{thousands(len(shown.undrawable))} not on the front: cannot be drawn"
        across, up = shown.points[shown.undrawable].T
        axes.plot(across, up, "x", color=GREY, markersize=4, label=name, zorder=2)
    name = f"front: {thousands(len(shown.front))} designs that no other beats"
    axes.plot(
        x, y, "o-", drawstyle="steps-post", color=FRONT_COLOUR, markersize=3.0, linewidth=1.2, label=name, zorder=3
    )
    for index, chosen in enumerate(shown.chosen):
        at = shown.points[chosen.place]
        axes.plot(*at, "o", color="white", markeredgecolor=INK, markeredgewidth=1.1, markersize=12.5, zorder=4)
        axes.annotate(letter(index), at, ha="center", va="center_baseline", size=8.5, weight="bold", zorder=5)
    if shown.base is not None:
        look = {"color": NOTE_COLOUR, "markersize": 12, "markeredgewidth": 2.0, "linestyle": "none"}
        axes.plot(*shown.base, "+", **look, label="base stage", zorder=3.5)


def thinned(points: Array) -> Array:
    """Points (m, 2) to draw as dots: all, or `MOST_DOTS` of them at random; a front is drawn besides."""
    if len(points) <= MOST_DOTS:
        return points
    return points[np.random.default_rng(0).choice(len(points), MOST_DOTS, replace=False, shuffle=False)]


def _set_axes(axes: Axes, shown: ParetoFront) -> None:
    names: tuple[Literal["x", "y"], Literal["x", "y"]] = ("x", "y")
    better = (shown.x_better, shown.y_better)
    for which, quantity, values, wanted in zip(names, (shown.x, shown.y), shown.points.T, better, strict=True):
        name_axis(axes, which, quantity, ends_of(values, quantity.log))
        axis = axes.xaxis if which == "x" else axes.yaxis
        axis.set_label_text(f"{quantity.label}  ({wanted} is better)")
    axes.grid()


def _counted(designs: int) -> str:
    all_of_them = f"{thousands(designs)} designs"
    return all_of_them if designs <= MOST_DOTS else f"{thousands(MOST_DOTS)} of {all_of_them}, at random"


def _draw_legend(axes: Axes, shown: ParetoFront) -> None:
    dots: dict[str, Any] = {"marker": "o", "linestyle": "none", "markeredgewidth": 0, "color": GREY, "markersize": 4}
    axes.plot([], [], **dots, label=_counted(len(shown.points)))
    for text in shown.left_out:
        axes.plot([], [], linestyle="none", label=text)
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.01), "borderaxespad": 0.0}
    axes.legend(**place, ncols=2, frameon=False)


def draw_design(figure: Figure, rows: RowLayout, index: int, chosen: Chosen, name: str) -> None:
    """Draw a design in the cell of an index, with its name and lines below."""
    down, along = divmod(index, ACROSS)
    left, bottom = LEFT + along * (AXES_LEFT + AXES_WIDTH - LEFT) / ACROSS, rows.height - down * rows.row - rows.cell[1]
    axes = add_axes(figure, left, bottom, *rows.cell)
    axes.set(xlim=(rows.low[0], rows.high[0]), ylim=(rows.low[1], rows.high[1]))
    axes.set_axis_off()
    draw_outline(axes, chosen.outline)
    text = _text(chosen, name)
    axes.annotate(text, (0.0, 0.0), (0, -5), "axes fraction", "offset points", size=LETTERS, va="top", linespacing=1.3)


def _text(chosen: Chosen, name: str) -> str:
    first, *others = chosen.lines
    return "\n".join(wrapped(line, CELL, LETTERS) for line in (f"{name}:  {first}", *others))


def draw_scale(axes: Axes, width: float) -> None:
    """A bar of a round length for the drawings, all of one scale, in axes that are `width` mm wide."""
    length = round_factor(0.4 * width)
    axes.set(xlim=(0.0, width), ylim=(0.0, 1.0))
    axes.set_axis_off()
    axes.plot([0.0, length], [0.75, 0.75], color=INK, linewidth=2.5, solid_capstyle="butt")
    axes.text(length + 0.04 * width, 0.75, f"{length:g}{SPACE}{LENGTH}, all drawings", size=LETTERS, va="center")


MAP_WIDTH, HEIGHT = 8.27, 6.0  # in
BELOW = 0.56  # in, from the axes to the legend
ONE_HUE, TWO_HUES = "viridis", "PuOr_r"  # the first alone reads in grey; the contours' labels say the rest
HATCHES = ("////", "xxxx", "....", "||||", "----")
HATCHED = "#A8A8A8"
MAP_DOTS = 5000  # more are rasterised in a PDF


class StudyMap(NamedTuple):
    """What the figure shows.

    x, y, value : what the axes and the colours are.
    points : (n, 2), factors x and y of every design, in file units.
    values : (n,), nan without an answer.   missing : which designs, bool (n,), have none, by why.
    grid : whether the points are all pairs of the values of x and y.
    marks : contours that matter, drawn heavier.   base : x and y of the base stage.
    """

    caption: Caption
    x: Quantity
    y: Quantity
    value: Quantity
    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    marks: tuple[float, ...] = ()
    base: tuple[float, float] | None = None


@in_house_style
def map_figure(shown: StudyMap) -> Figure:
    """Draw a map on a page of its own."""
    title, lines, *doubts = shown.caption
    figure, (axes,) = panels((MAP_WIDTH, HEIGHT), title, lines, 1, doubts=doubts)
    plot_map(axes, shown)
    return figure


def plot_map(ax: Axes, shown: StudyMap) -> Axes:
    """Draw a value as colours over two factors: cells with labelled contours for a grid, else a dot per design.

    Returns `ax`; the bar that says what the colours mean is an inset of it.

    Notes
    -----
    A cell is one design, with its value, or a mean of several, as the caption says; nothing is interpolated but the
    contours. Values of both signs have two hues, and the contours of negative values are dashed.
    """
    norm = norm_of(shown.values)
    hues = TWO_HUES if isinstance(norm, CenteredNorm) else ONE_HUE
    colours: dict[str, Any] = {"norm": norm, "cmap": hues}
    entries = _draw_grid(ax, shown, colours) if shown.grid else _draw_dots(ax, shown, colours)
    _set_axes_of_map(ax, shown)
    entries += _draw_base(ax, shown)
    if np.isfinite(shown.values).any():
        _draw_bar(ax.inset_axes((1.035, 0.0, 0.04, 1.0)), ax.collections[0], shown)
    if entries:
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.0, -BELOW / inches(ax)[1])}
        ax.legend(handles=entries, **place, borderaxespad=0.0, frameon=False, ncols=3, handlelength=2.4)
    return ax


def norm_of(values: Array) -> Normalize:
    """How values become colours: symmetric about zero for both signs, logarithmic for a wide range, else linear."""
    found = values[np.isfinite(values)]
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    if low < 0 < high:
        return CenteredNorm(0.0, max(-low, high))
    if len(found) and wide(found):
        return LogNorm(low, high)
    return Normalize(low, high)


def edges(ticks: Array, log: bool) -> Array:
    """Borders (n + 1,) of the cells about the values (n,) of a factor: half way between neighbours."""
    places = np.log(ticks) if log else ticks
    if len(places) == 1:
        half = 0.05 if log else 0.05 * (abs(float(places[0])) or 1.0)
        ends = np.array([places[0] - half, places[0] + half])
    else:
        middle = (places[1:] + places[:-1]) / 2
        ends = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.asarray(np.exp(ends) if log else ends)


def _draw_grid(axes: Axes, shown: StudyMap, colours: dict[str, Any]) -> list[Any]:
    (xs, column), (ys, row) = (np.unique(shown.points[:, k], return_inverse=True) for k in (0, 1))
    across, up = edges(xs, shown.x.log), edges(ys, shown.y.log)
    cells = np.full((len(ys), len(xs)), np.nan)
    cells[row, column] = shown.values
    axes.pcolormesh(across, up, np.ma.masked_invalid(cells), **colours, rasterized=True, zorder=1)
    entries = []
    for hatch, (why, which) in zip(HATCHES, shown.missing.items(), strict=False):
        boxes = [
            [(across[i], up[j]), (across[i + 1], up[j]), (across[i + 1], up[j + 1]), (across[i], up[j + 1])]
            for i, j in zip(column[which], row[which], strict=True)
        ]
        look: dict[str, Any] = {"facecolor": "white", "edgecolor": HATCHED, "linewidth": 0.0, "hatch": hatch}
        axes.add_collection(PolyCollection(boxes, **look, zorder=1.5), autolim=False)
        entries.append(Patch(**look, label=f"{why}: {thousands(int(np.sum(which)))}"))
    if min(cells.shape) > 1 and np.isfinite(cells).sum() > 3:
        entries += draw_contours(
            axes,
            (xs, ys, np.ma.masked_invalid(cells)),
            colours["norm"],
            shown.marks,
            shown.value.after if shown.value.unit == "%" else "",
        )
    return entries


def _draw_dots(axes: Axes, shown: StudyMap, colours: dict[str, Any]) -> list[Any]:
    known = np.isfinite(shown.values)
    many = len(shown.values) > MAP_DOTS
    size = float(np.clip(4e4 / max(len(shown.values), 1), 1.5, 30.0))
    look: dict[str, Any] = {"s": size, "linewidths": 0, "rasterized": many, "zorder": 2}
    axes.scatter(shown.points[known, 0], shown.points[known, 1], c=shown.values[known], **look, **colours)
    entries = []
    for mark, (why, which) in zip("x+123", shown.missing.items(), strict=False):
        at = shown.points[which].T
        axes.plot(*at, mark, color=GREY, markersize=3.5, markeredgewidth=0.6, rasterized=many, zorder=1)
        entries.append(
            Line2D([], [], color=GREY, linestyle="none", marker=mark, label=f"{why}: {thousands(len(at[0]))}")
        )
    return entries


def _set_axes_of_map(axes: Axes, shown: StudyMap) -> None:
    names: tuple[Literal["x", "y"], Literal["x", "y"]] = ("x", "y")
    for which, quantity, values in zip(names, (shown.x, shown.y), shown.points.T, strict=True):
        ends = edges(np.unique(values), quantity.log)[[0, -1]] if shown.grid else ends_of(values, quantity.log)
        name_axis(axes, which, quantity, (float(ends[0]), float(ends[1])))


def _draw_bar(axes: Axes, drawn: Any, shown: StudyMap) -> None:
    """What the colours mean, with the contours that matter."""
    bar = axes.figure.colorbar(drawn, cax=axes)
    bar.set_label(shown.value.label, parse_math=bool(shown.value.symbol))
    low, high = axes.get_ylim()
    if isinstance(drawn.norm, LogNorm):
        log_ticks(axes.yaxis, (low, high))
    for mark in shown.marks:
        if low < mark < high:
            axes.axhline(mark, color=INK, linewidth=2.2)


def _draw_base(axes: Axes, shown: StudyMap) -> list[Any]:
    """A cross where the base stage is, if that is on the map; returns its entry in the legend."""
    if shown.base is None:
        return []
    limits = zip(shown.base, (axes.get_xlim(), axes.get_ylim()), strict=True)
    if not all(low <= value <= high for value, (low, high) in limits):
        return []
    axes.plot(*shown.base, "+", color="white", markersize=15, markeredgewidth=4.5, zorder=5)
    look: dict[str, Any] = {"color": NOTE_COLOUR, "marker": "+", "markersize": 13, "markeredgewidth": 2.2}
    axes.plot(*shown.base, linestyle="none", zorder=6, **look)
    return [Line2D([], [], linestyle="none", label="base stage", **look)]


LINES = 8  # contours, about
LONG = 0.4  # of the side of the map: shorter contours have no label


def draw_contours(
    axes: Axes, grid: tuple[Array, Array, Any], norm: Normalize, marks: tuple[float, ...], unit: str
) -> list[Any]:
    """Draw labelled contours of values on a grid (x, y, masked values), the marks heavier; returns their legend entry.

    Labels have the `unit` after the number; contours that are too short for one have none.
    """
    low, high = float(grid[2].min()), float(grid[2].max())
    heavy = np.array([mark for mark in sorted(marks) if low < mark < high])
    thin = levels(norm, marks)
    for where, width in ((thin[(thin > low) & (thin < high)], 0.7), (heavy, 2.2)):
        if len(where):
            drawn = axes.contour(*grid, levels=where, colors=INK, linewidths=width, zorder=3)
            named = [
                level
                for level, path in zip(where, drawn.get_paths(), strict=True)
                if where is heavy or length_of(axes, path) > LONG
            ]
            names = axes.clabel(drawn, levels=named, fontsize=8.5, fmt=lambda value: shortest(value) + unit)
            for name in names:
                name.set_bbox({"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.8})
    if not len(heavy):
        return []
    said = " and ".join(f"{mark:g}{unit}" for mark in heavy)
    return [Line2D([], [], color=INK, linewidth=2.2, label=f"contours of {said}")]


def levels(norm: Normalize, marks: tuple[float, ...]) -> Array:
    """Round values for thin contours between the ends of the colours, none of them a mark."""
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else MaxNLocator(LINES)
    assert norm.vmin is not None and norm.vmax is not None
    found = np.asarray(locator.tick_values(norm.vmin, norm.vmax))
    inside = (found > norm.vmin) & (found < norm.vmax)
    return np.setdiff1d(found[inside], marks)


def shortest(value: float) -> str:
    """A round number in as few digits as it has."""
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def length_of(axes: Axes, path: Path) -> float:
    """Length of a path of one or more lines, in parts of the side of the axes."""
    lines = path.transformed(axes.transData + axes.transAxes.inverted()).to_polygons(closed_only=False)
    return float(sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in lines))


SCATTER_WIDTH, PANEL = 8.27, 1.97  # in, of a page, and height of a histogram with its axis
SCATTER_LETTERS = 8.5  # points, of the legend
MOST_DECIMALS = 7
ROUND_OFF = 1e-12  # of the largest value
BARS = (10, 60)  # fewest and most in a histogram
BAR_COLOUR = "#A9C4DE"


class Scatter(NamedTuple):
    """How one value scatters.

    quantity : what it is.   values : (n,), finite, or what reads them: they are needed one after the other.
    percentiles : three of them, from low to high.
    nominal : value of the base stage, where known.
    """

    quantity: Quantity
    values: Array | Callable[[], Array]
    percentiles: Sequence[Percentile]
    nominal: float | None = None


class Distribution(NamedTuple):
    """How several values scatter."""

    scatters: Sequence[Scatter]
    caption: Caption


@in_house_style
def distribution_figure(shown: Distribution) -> Figure:
    """Draw a histogram for every value, with its percentiles, their confidence intervals and the nominal value."""
    scatters, (title, lines, *doubts) = shown
    figure, found = panels((SCATTER_WIDTH, PANEL * len(scatters)), title, lines, len(scatters), doubts=doubts)
    for axes, scatter in zip(found, scatters, strict=True):
        plot_histogram(axes, scatter)
    figure.align_ylabels()
    return figure


def plot_histogram(ax: Axes, scatter: Scatter) -> Axes:
    """Draw a histogram of one value with its percentiles and their legend; returns `ax`."""
    values = scatter.values() if callable(scatter.values) else scatter.values
    log = scatter.quantity.log and bool(values.min() > 0)
    counts, borders = histogram(np.log10(values) if log else values)
    borders = 10.0**borders if log else borders
    ax.stairs(counts, borders, fill=True, color=BAR_COLOUR, zorder=1)
    ax.stairs(counts, borders, color=INK, linewidth=0.6, zorder=2)
    entries = _draw_marks(ax, scatter, float(np.abs(values).max()))
    legend_beside(ax, handles=entries, fontsize=SCATTER_LETTERS, handlelength=2.6, labelspacing=0.6)
    ax.set_xlabel(scatter.quantity.label, parse_math=bool(scatter.quantity.symbol))
    ax.set_ylabel("designs")
    ax.set(xlim=(borders[0], borders[-1]), ylim=(0, 1.06 * max(float(counts.max()), 1.0)))
    if log:
        name_axis(ax, "x", scatter.quantity, (float(borders[0]), float(borders[-1])))
    else:
        ax.ticklabel_format(useOffset=False, axis="x")
    return ax


def _draw_marks(axes: Axes, scatter: Scatter, size: float) -> list[Any]:
    """Percentiles with their intervals, and the base stage; returns their entries in the legend.

    `size` : the largest of the values, against which round-off is measured.
    """
    entries: list[Any] = []
    width = narrowest(scatter.percentiles)
    for dash, one in zip((DASHES[1], DASHES[0], DASHES[1]), scatter.percentiles, strict=True):
        axes.axvline(one.value, color=INK, linestyle=dash, linewidth=1.5, zorder=3)
        if np.isfinite([one.low, one.high]).all():
            axes.axvspan(one.low, one.high, color=INK, alpha=0.18, linewidth=0, zorder=2.5)
        text = described(one, scatter.quantity.after, width)
        entries.append(Line2D([], [], color=INK, linestyle=dash, linewidth=1.5, label=text))
    if scatter.nominal is not None:
        axes.axvline(scatter.nominal, color=NOTE_COLOUR, linewidth=1.5, linestyle=DASHES[2], zorder=4)
        nominal = scatter.nominal if abs(scatter.nominal) > ROUND_OFF * size else 0.0
        text = f"base stage: {to_digits(nominal, width) if nominal else '0'}{scatter.quantity.after}"
        entries.append(Line2D([], [], color=NOTE_COLOUR, linestyle=DASHES[2], linewidth=1.5, label=text))
    return entries


def histogram(values: Array) -> tuple[Array, Array]:
    """Counts (k,) and borders (k + 1,) of the bars, as wide as D. Freedman, P. Diaconis (1981) say."""
    if np.ptp(values) <= ROUND_OFF * np.abs(values).max():
        counts, borders = np.histogram(values, 1)
    else:
        wanted = len(np.histogram_bin_edges(values, "fd")) - 1 if len(values) > 1 else 1
        counts, borders = np.histogram(values, int(np.clip(wanted, *BARS)))
    return counts.astype(np.float64), np.asarray(borders, dtype=np.float64)


def described(one: Percentile, after: str, width: float) -> str:
    """A percentile with its confidence interval, in words, to the second digit of a width."""
    text = f"{one.percent:g}{SPACE}%: "
    if np.isinf([one.low, one.high]).any():
        return f"{text}{to_digits(one.value, width)}{after}\n(too few designs for an interval)"
    low, value, high = (to_digits(number, width) for number in (one.low, one.value, one.high))
    return f"{text}{value}{after}\n({low}{SPACE}to{SPACE}{high})"


def narrowest(found: Sequence[Percentile]) -> float:
    """Width of the narrowest interval that there is, else zero."""
    widths = [one.high - one.low for one in found if 0 < one.high - one.low < np.inf]
    return min(widths, default=0.0)


def to_digits(value: float, width: float) -> str:
    """A number to the second digit of a width, or with four digits where that is long or there is no width."""
    decimals = 1 - math.floor(math.log10(width)) if width > 0 else MOST_DECIMALS + 1
    if decimals > MOST_DECIMALS or decimals < -2:
        return significant(value)
    return f"{round(value, decimals):z.{max(decimals, 0)}f}".replace("-", "\N{MINUS SIGN}")


BAR_ROW, AROUND, LEGEND = 0.3, 1.1, 0.35  # in, of a factor, what else a panel takes, and the legend below all
SCATTER_ACROSS = 3  # panels in a row
FIRST_COLOUR, TOTAL_COLOUR = "#0072B2", "#F0C48A"
NAME_SIZE = 8.5  # points


class Share(NamedTuple):
    """One value and the indices of every factor."""

    quantity: Quantity
    indices: Indices


class Sensitivity(NamedTuple):
    """Which factor causes how much of several values; what the factors are called, in the order of the indices."""

    shares: Sequence[Share]
    factors: Sequence[str]
    caption: Caption


@in_house_style
def sensitivity_figure(shown: Sensitivity) -> Figure:
    """Draw first-order and total indices of every factor, in the order of the study file, a panel for each value."""
    shares, factors, (title, lines, *doubts) = shown
    across = 2 if len(shares) == 4 else min(SCATTER_ACROSS, len(shares))
    rows = -(-len(shares) // across)
    height = LEGEND + rows * (BAR_ROW * len(factors) + AROUND)
    figure, found = panels((SCATTER_WIDTH, height), title, lines, rows, across, doubts)
    for axes in found[len(shares) :]:
        axes.remove()
    ends = limits([share.indices for share in shares])
    for index, (axes, share) in enumerate(zip(found, shares, strict=False)):
        plot_shares(axes, share, factors if index % across == 0 else [""] * len(factors), ends)
    entries = figure.axes[0].get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=2, frameon=False)
    return figure


def limits(indices: Sequence[Indices]) -> tuple[float, float]:
    """Ends of the axis that all panels share: zero, or less where a whisker goes there, to the longest whisker."""
    bars = [pair for i in indices for pair in ((i.first, i.first_band), (i.total, i.total_band))]
    ends = [(value - band, value + band) for value, band in bars if value is not None and band is not None]
    low, high = float(np.min([end[0] for end in ends])), float(np.max([end[1] for end in ends]))
    room = 0.03 * (high - min(low, 0.0))
    return min(low, 0.0) - room, high + room


def plot_shares(ax: Axes, share: Share, factors: Sequence[str], ends: tuple[float, float] | None = None) -> Axes:
    """Draw the Sobol indices of one value as bars, with whiskers, a row for each factor; returns `ax`.

    `ends` : of the axis, by default those that suit this value.
    """
    found, places = share.indices, np.arange(float(len(share.indices.first)))
    _draw_bars(
        ax,
        places - (0.19 if found.total is not None else 0.0),
        (found.first, found.first_band),
        FIRST_COLOUR,
        "first order: alone",
    )
    if found.total is not None and found.total_band is not None:
        _draw_bars(ax, places + 0.19, (found.total, found.total_band), TOTAL_COLOUR, "total: with its interactions")
    ax.axvline(0.0, color=INK, linewidth=0.8)
    ax.set(xlim=ends or limits([found]), ylim=(len(places) - 0.45, -0.55))
    ax.set_yticks(places, factors, size=NAME_SIZE)
    ax.set_xlabel(f"share of the variance\n(first order sums to {found.first.sum():.2f})")
    ax.set_title(share.quantity.symbol or share.quantity.name, parse_math=bool(share.quantity.symbol), loc="left")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.grid(axis="x")
    ax.tick_params(axis="y", length=0)
    return ax


def _draw_bars(axes: Axes, places: Array, values: tuple[Array, Array], colour: str, name: str) -> None:
    whiskers: dict[str, Any] = {"ecolor": INK, "elinewidth": 1.0, "capsize": 2.0}
    look: dict[str, Any] = {"color": colour, "edgecolor": INK, "linewidth": 0.5}
    axes.barh(places, values[0], 0.36, xerr=values[1], label=name, error_kw=whiskers, zorder=2, **look)


CHART_WIDTH, CHART_HEIGHT = 5.4, 4.4  # in, with its legend
CHART_ACROSS, UP, CHART_LETTERS = 4.2, 3.2, 9.5  # in, room for the names of the axes; points


@in_house_style
def chart_figure(shown: StudyMap | ParetoFront) -> matplotlib.figure.Figure:
    """Draw a map, or a front without letters: its designs are not drawn below it. The figure has one axes first."""
    figure = new_figure(CHART_WIDTH, CHART_HEIGHT)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    axes = figure.subplots()
    if isinstance(shown, StudyMap):
        plot_map(axes, shown)
    else:
        plot_front(axes, shown._replace(chosen=()))
    for axis, room in ((axes.xaxis, CHART_ACROSS), (axes.yaxis, UP)):
        if not axis.label.get_parse_math():
            axis.set_label_text(wrapped(axis.get_label_text(), room, CHART_LETTERS))
    return figure
