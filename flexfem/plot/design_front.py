"""The front of a design's objectives, every design on it drawn to one scale."""

from __future__ import annotations

import tomllib
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import wide
from flexfem.mechanism.stage import Stage
from flexfem.plot.stage import outline_of
from flexfem.plot.study_labels import log_ticks
from flexfem.plot.study_pareto import (
    AXES_LEFT,
    AXES_WIDTH,
    CELL,
    FOOT,
    LEFT,
    WIDTH,
    Chosen,
    draw_design,
    draw_scale,
    rows_for,
)
from flexfem.plot.style import COLOURS, INK, add_axes, header, in_house_style, new_axes, new_figure, wrapped
from flexfem.plot.text import significant
from flexfem.synthesis.result import Designed, FrontDesign

ACROSS, APART, TOP = 2, 0.95, 0.25  # pairs of objectives in a row; what is left between them, and above, in
SAID = "Designs that no other beats in all objectives, by finite elements; each is a stage file, by its number."


@in_house_style
def front_figure(found: Designed) -> Figure:
    """Draw the front, a panel for each pair of objectives, and below it the designs, all to one scale."""
    pairs = list(combinations(range(len(found.objectives)), 2))
    drawings = [_drawing(found, place, one) for place, one in enumerate(found.front)]
    rows = rows_for(drawings)
    across = min(ACROSS, len(pairs))
    width = (AXES_WIDTH - APART * (across - 1)) / across
    high = 0.55 * AXES_WIDTH if across == 1 else width
    down = -(-len(pairs) // across)
    height = rows.height + down * (high + FOOT) + TOP
    title, doubts = f"{found.name}: front", (found.assumed, found.not_stated)
    used = header(new_figure(WIDTH, 10.0), title, [SAID], *doubts)
    figure = new_figure(WIDTH, used + height)
    header(figure, title, [SAID], *doubts)
    for place, pair in enumerate(pairs):
        row, column = divmod(place, across)
        bottom = rows.height + (down - 1 - row) * (high + FOOT) + FOOT
        plot_objectives(add_axes(figure, AXES_LEFT + column * (width + APART), bottom, width, high), found, *pair)
    for place, each in enumerate(drawings):
        draw_design(figure, rows, place, each, str(place + 1))
    draw_scale(add_axes(figure, LEFT, 0.08, CELL, 0.26), float(rows.high[0] - rows.low[0]))
    return figure


def plot_objectives(ax: Axes | None, found: Designed, first: int = 0, second: int = 1) -> Axes:
    """Draw two objectives of every design on the front, by its number; returns `ax`, or new axes."""
    ax = new_axes() if ax is None else ax
    values = np.array([(one.values[first], one.values[second]) for one in found.front])
    style = "-" if len(found.objectives) == 2 else "none"
    ax.plot(*values.T, linestyle=style, color=COLOURS[0], linewidth=1.2)
    for place, (at, one) in enumerate(zip(values, found.front, strict=True)):
        edge = INK if one.met else COLOURS[1]
        ax.plot(*at, "o", color="white", markeredgecolor=edge, markeredgewidth=1.1, markersize=12.5, zorder=4)
        ax.annotate(str(place + 1), at, ha="center", va="center_baseline", size=8.5, weight="bold", zorder=5)
    for of, each in zip((ax.set_xscale, ax.set_yscale), values.T, strict=True):
        of("log" if wide(each) else "linear")
    ax.set_xlabel(wrapped(found.objectives[first].sought, 3.2, 9.5))
    ax.set_ylabel(wrapped(found.objectives[second].sought, 3.2, 9.5))
    ax.margins(0.08)
    for axis, ends in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        if axis.get_scale() == "log":
            log_ticks(axis, ends)
    ax.grid()
    return ax


def _drawing(found: Designed, place: int, one: FrontDesign) -> Chosen:
    """The outline of a design, with its objectives and dimensions, and what it misses."""
    values = zip(found.objectives, one.values, strict=True)
    lines = [f"{goal.label} {significant(value, 4)} {goal.unit}".rstrip() for goal, value in values]
    lines += [f"{name} {value:.5g}" for name, value in one.design.items()]
    lines += [] if one.met else ["a requirement is missed"]
    return Chosen(place, outline_of(Stage.model_validate(tomllib.loads(one.stage))), lines)
