"""The designs of a study that no other beats in two values, and a few of them drawn to scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array, Index
from flexfem.plot.stage import Outline, draw_outline
from flexfem.plot.study_labels import Caption, Quantity, ends_of, name_axis, thousands
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, add_axes, header, in_house_style, new_figure, wrapped
from flexfem.plot.text import SPACE, round_factor
from flexfem.units import LENGTH

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
