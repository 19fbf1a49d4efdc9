"""Figures of studies over one factor at a time: curves of one, effects of several."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from flexfem.arrays import AnyArray, Array
from flexfem.plot import style
from flexfem.plot.style import (
    COLOURS,
    DASHES,
    GREY,
    MARKERS,
    NOTE_COLOUR,
    in_house_style,
    panels,
)
from flexfem.plot.text import SUPERSCRIPTS, minus
from flexfem.results import thousands
from flexfem.study import records

WIDTH = 8.27  # in, of a page
PANEL_HEIGHT = 2.35  # in, of curves
SINGLE_HEIGHT = 3.2  # in, of one row of curves
ROW_HEIGHT = 1.75  # in, of effects
PANEL_WIDTH = 3.2  # in, of the name of a panel
ROW_WIDTH = 7.2  # in, of the name of a row of effects
LABELS_WIDTH = 6.0  # in, of the labels of all factors of effects
DECADE = 10.0
THREE_DECADES = 1e3
MOST_MARKED = 60  # designs, each of which has a marker on its curve
ROOM = 0.05  # about a constant number, relative to it
HATCHES = ("////", "xxxx", "....", "||||", "----")
ANALYTIC_MODEL = "analytic model"
HATCH_COLOUR = "#A8A8A8"
PLUS: dict[str, Any] = {
    "color": NOTE_COLOUR,
    "marker": "+",
    "markersize": 11,
    "markeredgewidth": 2.0,
    "linestyle": "none",
    "zorder": 5,
}


def rows_of(count: int) -> int:
    """Return the number of rows of panels in two columns."""
    return -(-count // 2)


def paired_panels(
    caption: records.Caption,
    count: int,
    height: float,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a header and panels in two columns, or one panel.

    height : in, of all rows.
    """
    columns = min(count, 2)
    size = (WIDTH, height + 0.5)
    return panels(size, caption.title, caption.lines, rows_of(count), columns, caption, count)


@in_house_style
def curves_figure(shown: records.Curves) -> Figure:
    """Draw the curves of several numbers over one factor, a panel for each number."""
    count = len(shown.panels)
    height = PANEL_HEIGHT * rows_of(count) if count > 2 else SINGLE_HEIGHT
    figure, axes = paired_panels(shown.caption, count, height)
    for ax, panel in zip(axes, shown.panels, strict=True):
        plot_curves(ax, shown, panel)
    style.legend_below(figure, axes, 3)
    return figure


def plot_curves(
    ax: Axes,
    shown: records.Curves,
    panel: records.CurvePanel,
) -> Axes:
    """Draw the curves of one number of a study over its factor, with their bands; return `ax`.

    Designs without a result, and those outside constraints, are hatched.
    """
    marked = len(shown.places) <= MOST_MARKED
    looks = _looks_of(shown)
    for curve in panel.curves:
        colour, dash, marker = looks[curve.model]
        low = curve.values - curve.bands
        high = curve.values + curve.bands
        ax.fill_between(
            shown.places,
            low,
            high,
            color=colour,
            alpha=0.3,
            linewidth=0.0,
        )
        ax.plot(
            shown.places,
            curve.values,
            color=colour,
            linestyle=dash,
            marker=marker if marked else "",
            markersize=3.2,
            linewidth=1.4,
            label=curve.model or None,
            zorder=3,
        )
    set_scales(ax, shown.x, panel.quantity)
    _make_room(ax, panel)
    _hatch(ax, shown)
    _mark_base(ax, shown, panel)
    name_axis(ax.xaxis, shown.x)
    set_ticks(ax.yaxis, panel.quantity.log)
    name_above(ax, panel.quantity, PANEL_WIDTH)
    ax.grid()
    return ax


def _looks_of(shown: records.Curves) -> dict[str, tuple[str, Any, str]]:
    """Return colour, dash and marker of every model, the same in all panels and studies: the first
    is that of the analytic model.
    """
    models = [curve.model for panel in shown.panels for curve in panel.curves if curve.model]
    named = dict.fromkeys([ANALYTIC_MODEL, *models])
    looks = dict(zip(named, zip(COLOURS, DASHES, MARKERS, strict=False), strict=False))
    return looks | {"": (GREY, "solid", "o")}


def _make_room(ax: Axes, panel: records.CurvePanel) -> None:
    """Leave room above and below a number that is constant."""
    values = np.concatenate([curve.values for curve in panel.curves])
    known = values[np.isfinite(values)]
    if len(known) and np.ptp(known) <= 1e-9 * np.abs(known).max():
        middle = float(known[0])
        half = ROOM * abs(middle) or 1.0
        ax.set_ylim(middle - half, middle + half)


def set_scales(
    ax: Axes,
    x: records.AxisText,
    y: records.AxisText,
) -> None:
    """Set the scales of axes, logarithmic or linear."""
    ax.set_xscale("log" if x.log else "linear")
    ax.set_yscale("log" if y.log else "linear")


def name_axis(axis: Axis, quantity: records.AxisText) -> None:
    """Set the label and the ticks of an axis that holds all its data."""
    axis.set_label_text(style.wrapped(label_of(quantity), PANEL_WIDTH, 9.5))
    set_ticks(axis, quantity.log)


def name_above(
    ax: Axes,
    quantity: records.AxisText,
    width: float,
) -> None:
    """Write the name and unit of the numbers of a panel above it, where long names have room."""
    text = style.wrapped(label_of(quantity), width, 9.5)
    ax.set_title("\n".join(" " for _ in text.split("\n")), loc="left", size=9.5)  # room for it
    named = ax.annotate(
        text,
        (0.0, 1.0),
        (0.0, 6.0),
        xycoords="axes fraction",
        textcoords="offset points",
        va="bottom",
        size=9.5,
    )
    named.set_in_layout(False)  # a text wider than its panel would make the panel wider


def label_of(quantity: records.AxisText) -> str:
    """Return the name and unit of numbers, without a line break in the unit."""
    return f"{quantity.name} ({quantity.after.strip()})" if quantity.unit else quantity.name


def set_ticks(axis: Axis, log: bool) -> None:
    """Set the ticks of an axis that holds all its data."""
    if log:
        low, high = axis.get_view_interval()
        style.log_ticks(axis, (low, high))
    else:
        axis.set_major_formatter(lambda value, _: tick_text(value))


def tick_text(value: float) -> str:
    """Format a number beside a tick, with a power of ten where it is large or small."""
    mantissa, _, power = f"{value:.6g}".partition("e")
    return minus(mantissa) + (f"×10{str(int(power)).translate(SUPERSCRIPTS)}" if power else "")


def _hatch(ax: Axes, shown: records.Curves) -> None:
    """Hatch the parts of the factor where designs have no result or are outside constraints."""
    for hatch, (reason, mask) in zip(HATCHES, shown.missing.items(), strict=False):
        ax.broken_barh(
            runs_of(shown.places, mask, shown.x.log),
            (0.0, 1.0),
            transform=ax.get_xaxis_transform(),
            facecolor="none",
            edgecolor=HATCH_COLOUR,
            linewidth=0.0,
            hatch=hatch,
            label=f"{reason}: {thousands(shown.counts[reason])}",
            zorder=1,
        )


def runs_of(
    places: Array,
    mask: AnyArray,
    log: bool,
) -> list[tuple[float, float]]:
    """Return start and length of the stretches of ascending places (n,) that a mask (n,) marks,
    each up to the middle between a marked place and its neighbour.
    """
    scaled = np.log(places) if log else places
    middle = (scaled[1:] + scaled[:-1]) / 2
    borders = np.concatenate([scaled[:1], middle, scaled[-1:]])
    borders = np.exp(borders) if log else borders
    steps = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    starts = borders[np.flatnonzero(steps == 1)]
    ends = borders[np.flatnonzero(steps == -1)]
    return list(zip(starts.tolist(), (ends - starts).tolist(), strict=True))


def _mark_base(
    ax: Axes,
    shown: records.Curves,
    panel: records.CurvePanel,
) -> None:
    base = shown.base
    if base is None or not shown.places[0] <= base <= shown.places[-1]:
        return
    for curve in panel.curves:
        if curve.base is not None:
            ax.plot(base, curve.base, label="base design", **PLUS)


# effects


@in_house_style
def effects_figure(shown: records.Effects) -> Figure:
    """Draw numbers over each of several factors: a row for each number, a column for each factor."""
    rows = len(shown.numbers)
    columns = len(shown.factors)
    caption = shown.caption
    size = (WIDTH, 0.7 + ROW_HEIGHT * rows)
    figure, axes = panels(
        size,
        caption.title,
        caption.lines,
        rows,
        columns,
        caption,
    )
    for index, ax in enumerate(axes):
        row, column = divmod(index, columns)
        plot_effect(ax, shown, row, column)
        if column:
            ax.set_yticklabels([])
        else:
            name_above(ax, shown.numbers[row], ROW_WIDTH)
        if row < rows - 1:
            ax.set_xlabel("")
            ax.set_xticklabels([])
    for row in range(rows):
        _share_y(axes[row * columns : (row + 1) * columns])
    style.legend_below(figure, axes, 4)
    return figure


def plot_effect(
    ax: Axes,
    shown: records.Effects,
    number: int,
    factor: int,
) -> Axes:
    """Draw one number over one factor: designs, their median and nine of ten of them; return `ax`."""
    trend = shown.trends[number][factor]
    quantity = shown.numbers[number]
    x = shown.factors[factor]
    ax.plot(
        shown.points[:, factor],
        shown.values[:, number],
        ".",
        color=GREY,
        markersize=1.8,
        alpha=0.6,
        rasterized=True,
        label="design",
        zorder=2,
    )
    ax.fill_between(
        trend.places,
        trend.low,
        trend.high,
        color=COLOURS[0],
        alpha=0.22,
        linewidth=0.0,
        label="nine of ten designs",
    )
    ax.plot(
        trend.places,
        trend.medians,
        color=COLOURS[0],
        linewidth=1.6,
        label="median",
        zorder=3,
    )
    set_scales(ax, x, quantity)
    base = shown.base[0][factor], shown.base[1][number]
    if np.isfinite(base).all() and trend.places[0] <= base[0] <= trend.places[-1]:
        ax.plot(*base, label="base design", **PLUS)
    width = LABELS_WIDTH / len(shown.factors)
    _name_narrow(ax.xaxis, x, width)
    _name_narrow(ax.yaxis, quantity, width)
    ax.set_ylabel("")
    ax.grid()
    return ax


def _share_y(axes: list[Axes]) -> None:
    """Give the panels of a row one range of numbers."""
    limits = np.array([ax.get_ylim() for ax in axes])
    for ax in axes:
        ax.set_ylim(float(limits[:, 0].min()), float(limits[:, 1].max()))


def _name_narrow(
    axis: Axis,
    quantity: records.AxisText,
    width: float,
) -> None:
    """Set the label and a few ticks of an axis of a narrow panel that holds all its data."""
    axis.set_label_text(style.wrapped(label_of(quantity), width, 8.5), size=8.5)
    axis.set_tick_params(labelsize=7.5)
    if quantity.log:
        set_few_ticks(axis)
        return
    axis.set_major_locator(MaxNLocator(3))
    axis.set_major_formatter(lambda value, _: tick_text(value))


def set_few_ticks(axis: Axis) -> None:
    """Set a few ticks of a logarithmic axis that holds all its data."""
    low, high = axis.get_view_interval()
    if high > 3 * low:
        subs: tuple[float, ...] = (1.0, 2.0, 5.0) if high < THREE_DECADES * low else (1.0,)
        subs = (1.0, 2.0, 3.0, 5.0) if high < DECADE * low else subs
        axis.set_major_locator(LogLocator(subs=subs))
    else:
        axis.set_major_locator(MaxNLocator(4))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, _: tick_text(value))
