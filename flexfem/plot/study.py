"""Figures of studies from their records: maps, Pareto fronts, histograms and Sobol indices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import CenteredNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator
from matplotlib.tri import Triangulation
from scipy.spatial import Delaunay, QhullError

from flexfem.arrays import AnyArray, Array, is_wide
from flexfem.plot import style
from flexfem.plot.curves import (
    curves_figure,
    effects_figure,
    name_above,
    paired_panels,
    rows_of,
    set_few_ticks,
)
from flexfem.plot.front import front_page
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, in_house_style, panels
from flexfem.plot.text import minus, significant
from flexfem.plot.write import write_each
from flexfem.results import SPACE, thousands
from flexfem.study import records

WIDTH = 8.27
MAP_HEIGHT = 3.0  # in, of one of several maps
SINGLE_MAP_HEIGHT = 5.5  # in
PANEL_LABEL = 2.2  # in, of an axis of one of several maps
LABEL_WIDTH = 4.4  # in, of a page and of the label of an axis
FIRST_COLOUR = "#0072B2"
BAR_COLOUR = "#A9C4DE"
TOTAL_COLOUR = "#F0C48A"
HATCH_COLOUR = "#A8A8A8"
VECTOR_DOTS = 5000
MOST_MESHED = 3000  # designs between which contours are drawn
LEAST_MESHED = 12
SHARES_WIDTH = 6.6  # in, of the names of all panels of a row of indices
LABELLED = 0.5  # least share of a map with values, whose contours have room for labels
CONTOURED = 150  # points along a side of a grid whose contours are drawn
GRID = 3  # arrays of a grid: x, y, values
MOST_DOTS = 100_000  # most dots drawn as vectors; most drawn, else a random sample
HATCHES = ("////", "xxxx", "....", "||||", "----")
CONTOURS = 8  # approximate number
BARS = (10, 60)  # fewest and most in a histogram
DIGITS = 5
NO_INTERVAL = "too few designs for an interval"  # of a percentile
ROUND_OFF = 1e-12  # of the largest value
MOST_FACTORS = 6  # in the table of a front
LETTERS = "ABCDEFGHIJKL"
PLUS: dict[str, Any] = {
    "color": NOTE_COLOUR,
    "marker": "+",
    "markersize": 13,
    "markeredgewidth": 2.2,
}


def write_study_figures(
    found: Mapping[str, records.Record | records.Refused], folder: Path
) -> list[Path]:
    """Draw every figure of a study file that is not refused as PNG and PDF, under its name in a
    folder.

    Returns the paths written. Raises BadInput when a file cannot be written.
    """
    pages = {
        folder / f"{name}.png": partial(page_of, record)
        for name, record in found.items()
        if not isinstance(record, records.Refused)
    }
    return write_each(pages)


def page_of(record: records.Record) -> Figure:
    """Draw the page of one record."""
    kinds: dict[type, Callable[[Any], Figure]] = {
        records.StudyMap: map_figure,
        records.ParetoFront: pareto_figure,
    }
    kinds |= {records.Sensitivity: sensitivity_figure, records.Distribution: distribution_figure}
    kinds |= {records.StudyMaps: maps_figure, records.Curves: curves_figure}
    kinds |= {records.Effects: effects_figure}
    return kinds[type(record)](record)


def name_axes(
    axes: Axes,
    x: records.AxisText,
    y: records.AxisText | None = None,
    better: Sequence[str] = ("", ""),
) -> None:
    """Set scales, labels and ticks of axes that hold all their data."""
    both = (axes.xaxis, axes.set_xscale), (axes.yaxis, axes.set_yscale)
    for (axis, set_scale), quantity, sense in zip(both, (x, y), better, strict=True):
        if quantity is not None:
            set_scale("log" if quantity.log else "linear")
            text = quantity.label + (f", {sense} is better" if sense else "")
            axis.set_label_text(style.wrapped(text, LABEL_WIDTH, 9.5))
            if quantity.log:
                low, high = axis.get_view_interval()
                style.log_ticks(axis, (low, high))


# maps


@in_house_style
def map_figure(shown: records.StudyMap) -> Figure:
    """Draw a map on a page."""
    plot = partial(plot_map, shown=shown)
    caption = shown.caption
    return style.page((WIDTH, 6.0), caption.title, caption.lines, plot, caption)


def plot_map(ax: Axes, shown: records.StudyMap) -> Axes:
    """Draw a value as colours over two factors: cells with labelled contours for a grid, else a dot
    per design.

    Returns `ax`, which holds the colour bar as an inset. Only the contours are interpolated. Values
    of both signs have two hues, and the contours of negative values are dashed."""
    entries = draw_map(ax, shown)
    if entries:
        place: dict[str, Any] = {
            "loc": "upper left",
            "bbox_to_anchor": (0.0, 0.0),
            "borderaxespad": 4.6,
        }
        ax.legend(handles=entries, **place, frameon=False, ncols=3, handlelength=2.4)
    return ax


@in_house_style
def maps_figure(shown: records.StudyMaps) -> Figure:
    """Draw maps of several numbers over the same factors, a panel for each number."""
    count = len(shown.maps)
    height = MAP_HEIGHT * rows_of(count) if count > 1 else SINGLE_MAP_HEIGHT
    figure, axes = paired_panels(shown.caption, count, height)
    figure.draw_without_rendering()  # determines the sizes that labels of contours need
    entries = dict[str, Any]()
    for ax, each in zip(axes, shown.maps, strict=True):
        entries |= {entry.get_label(): entry for entry in draw_map(ax, each, False)}
        name_above(ax, each.value, PANEL_LABEL + 0.6)
        ax.xaxis.label.set_text(style.wrapped(each.x.label, PANEL_LABEL, 9.5))
        ax.yaxis.label.set_text(style.wrapped(each.y.label, PANEL_LABEL, 9.5))
        for axis, quantity in ((ax.xaxis, each.x), (ax.yaxis, each.y)):
            if quantity.log:
                set_few_ticks(axis)
    if entries:
        look: dict[str, Any] = {"loc": "outside lower center", "frameon": False, "ncols": 3}
        figure.legend(handles=[*entries.values()], **look)
    return figure


def draw_map(
    ax: Axes,
    shown: records.StudyMap,
    named: bool = True,
) -> list[Any]:
    """Draw a map with its colour bar, which is `named` or not; return the entries of its legend."""
    norm = norm_of(shown.cells.values)
    colours: dict[str, Any] = {
        "norm": norm,
        "cmap": "PuOr_r" if isinstance(norm, CenteredNorm) else "viridis",
    }
    entries = (_draw_grid if shown.cells.grid else _draw_dots)(ax, shown, colours)
    name_axes(ax, shown.x, shown.y)
    ends = ax.get_xlim(), ax.get_ylim()
    if shown.base is not None and all(
        low <= at <= high for at, (low, high) in zip(shown.base, ends, strict=True)
    ):
        ax.plot(
            *shown.base,
            "+",
            color="white",
            markersize=15,
            markeredgewidth=4.5,
            zorder=5,
        )
        ax.plot(*shown.base, linestyle="none", zorder=6, **PLUS)
        entries.append(Line2D([], [], linestyle="none", label="base design", **PLUS))
    if np.isfinite(shown.cells.values).any():
        bar = ax.inset_axes((1.035, 0.0, 0.04, 1.0))
        label = style.wrapped(shown.value.label, LABEL_WIDTH, 9.5) if named else ""
        _draw_bar(bar, ax.collections[0], shown, label)
    return entries


def norm_of(values: Array) -> Normalize:
    """Colour scale of values: symmetric about zero for both signs, logarithmic for a wide range,
    else linear.
    """
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    if low < 0 < high:
        return CenteredNorm(0.0, max(-low, high))
    return LogNorm(low, high) if len(finite) and is_wide(finite) else Normalize(low, high)


def edges(ticks: Array, log: bool) -> Array:
    """Borders (n + 1,) of the cells around the values (n,) of a factor, midway between neighbours."""
    places = np.log(ticks) if log else ticks
    if len(places) == 1:
        half = 0.05 if log else 0.05 * (abs(float(places[0])) or 1.0)
        ends = np.array([places[0] - half, places[0] + half])
    else:
        middle = (places[1:] + places[:-1]) / 2
        ends = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.asarray(np.exp(ends) if log else ends)


def _draw_grid(
    axes: Axes,
    shown: records.StudyMap,
    colours: dict[str, Any],
) -> list[Any]:
    """Draw a map as cells; return entries of the legend."""
    (xs, column), (ys, row) = (np.unique(v, return_inverse=True) for v in shown.cells.points.T)
    x_edges = edges(xs, shown.x.log)
    y_edges = edges(ys, shown.y.log)
    values = np.full((len(ys), len(xs)), np.nan)
    values[row, column] = shown.cells.values
    masked = np.ma.masked_invalid(values)
    axes.pcolormesh(x_edges, y_edges, masked, **colours, rasterized=True, zorder=1)
    entries: list[Any] = []
    for hatch, (reason, mask) in zip(HATCHES, shown.cells.missing.items(), strict=False):
        marked = np.zeros(values.shape, dtype=bool)
        marked[row[mask], column[mask]] = True
        boxes = _boxes_of(marked, x_edges, y_edges)
        look: dict[str, Any] = {
            "facecolor": "white",
            "edgecolor": HATCH_COLOUR,
            "linewidth": 0.0,
            "hatch": hatch,
        }
        axes.add_collection(PolyCollection([*boxes], **look, zorder=1.5), autolim=False)
        entries.append(Patch(**look, label=f"{reason}: {thousands(int(mask.sum()))}"))
    if min(values.shape) > 1 and masked.count() > 3:
        down, across = (slice(None, None, -(-count // CONTOURED)) for count in masked.shape)
        grid = (xs[across], ys[down], masked[down, across])
        _draw_contours(axes, grid, colours["norm"], shown, entries)
    return entries


def _boxes_of(
    marked: AnyArray,
    x_edges: Array,
    y_edges: Array,
) -> Array:
    """Return the corners (k, 4, 2) of rectangles that cover the marked cells, bool (rows, columns),
    one for each stretch of cells in a row.
    """
    steps = np.diff(np.pad(marked, ((0, 0), (1, 1))).astype(int), axis=1)
    rows, starts = np.nonzero(steps == 1)
    ends = np.nonzero(steps == -1)[1]
    left = x_edges[starts]
    right = x_edges[ends]
    bottom = y_edges[rows]
    top = y_edges[rows + 1]
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return np.asarray(np.stack([np.stack(corner, axis=1) for corner in corners], axis=1))


def _draw_dots(
    axes: Axes,
    shown: records.StudyMap,
    colours: dict[str, Any],
) -> list[Any]:
    """Draw a map as one dot per design; return entries of the legend."""
    count = len(shown.cells.values)
    drawn = np.unique(np.linspace(0, count - 1, min(count, MOST_DOTS)).round().astype(int))
    points = shown.cells.points[drawn]
    values = shown.cells.values[drawn]
    known = np.isfinite(values)
    many = len(values) > VECTOR_DOTS
    size = float(np.clip(4e4 / max(len(values), 1), 1.5, 30.0))
    look: dict[str, Any] = {
        "s": size,
        "linewidths": 0,
        "rasterized": True,
        "zorder": 2,
    }
    axes.scatter(points[known, 0], points[known, 1], c=values[known], **look, **colours)
    mesh = _mesh_of(shown)
    entries = list[Any]()
    if mesh is not None:
        ends = axes.get_xlim(), axes.get_ylim()
        _draw_contours(axes, mesh, colours["norm"], shown, entries)
        axes.set(xlim=ends[0], ylim=ends[1])  # contours would cut dots at the border
    if len(drawn) < count:
        label = f"{thousands(len(drawn))} of {thousands(count)} designs drawn"
        entries.append(Line2D([], [], linestyle="none", label=label))
    for mark, (reason, mask) in zip("x+123", shown.cells.missing.items(), strict=False):
        axes.plot(
            *points[mask[drawn]].T,
            mark,
            color=GREY,
            markersize=3.5,
            markeredgewidth=0.6,
            rasterized=many,
            zorder=1,
        )
        label = f"{reason}: {thousands(int(mask.sum()))}"
        entries.append(
            Line2D(
                [],
                [],
                color=GREY,
                linestyle="none",
                marker=mark,
                label=label,
            )
        )
    return entries


def _mesh_of(shown: records.StudyMap) -> tuple[Triangulation, Array] | None:
    """Return triangles between the designs of a map and their values, for contours; None where the
    designs are too few or on one line. Triangles at designs without a value are left out.
    """
    points = shown.cells.points[:MOST_MESHED]
    values = shown.cells.values[:MOST_MESHED]
    logs = (shown.x.log, shown.y.log)
    places = np.where(logs, np.log(np.where(logs, points, 1.0)), points)
    spans = np.ptp(places, axis=0)
    if np.isfinite(values).sum() < LEAST_MESHED or not spans.all():
        return None
    try:
        corners = Delaunay((places - places.min(axis=0)) / spans).simplices
    except QhullError:
        return None
    left_out = np.isnan(values)[corners].any(axis=1)
    if left_out.all():
        return None
    mesh = Triangulation(points[:, 0], points[:, 1], corners, left_out)
    return mesh, np.nan_to_num(values)


def _draw_contours(
    axes: Axes,
    grid: tuple[Any, ...],
    norm: Normalize,
    shown: records.StudyMap,
    entries: list[Any],
) -> None:
    """Draw labelled contours of values on a grid (x, y, masked values) or on a mesh (triangles,
    values), those at the marks heavier.
    """
    known = shown.cells.values[np.isfinite(shown.cells.values)]
    low = float(known.min())
    high = float(known.max())
    draw: Any = axes.contour if len(grid) == GRID else axes.tricontour
    unit = shown.value.after if shown.value.unit == "%" else ""
    heavy = [mark for mark in sorted(shown.marks) if low < mark < high]
    thin = [level for level in levels(norm, shown.marks) if low < level < high]
    labelled = np.isfinite(shown.cells.values).mean() >= LABELLED
    for where, width in ((thin, 0.7), (heavy, 2.2)):
        if where:
            lines = draw(
                *grid,
                levels=where,
                colors=INK,
                linewidths=width,
                zorder=3,
            )
            texts = {level: minus(f"{level:.6g}") + unit for level in lines.levels}
            for label in axes.clabel(lines, fontsize=8.0, fmt=texts) if labelled else ():
                label.set_bbox(
                    {
                        "boxstyle": "round,pad=0.12",
                        "facecolor": "white",
                        "edgecolor": "none",
                        "alpha": 0.8,
                    }
                )
    if heavy:
        marks = minus(", ".join(f"{mark:g}{unit}" for mark in heavy))
        entries.append(
            Line2D(
                [],
                [],
                color=INK,
                linewidth=2.2,
                label=f"contours of {marks}",
            )
        )


def levels(norm: Normalize, marks: Sequence[float]) -> Array:
    """Round values for thin contours within the colour scale, without the marks."""
    locator = (
        LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else MaxNLocator(CONTOURS)
    )
    assert norm.vmin is not None and norm.vmax is not None
    return np.setdiff1d(np.asarray(locator.tick_values(norm.vmin, norm.vmax)), marks)


def _draw_bar(
    axes: Axes,
    mappable: Any,
    shown: records.StudyMap,
    label: str,
) -> None:
    """Draw the colour bar with the marks."""
    axes.figure.colorbar(mappable, cax=axes).set_label(label)
    low, high = axes.get_ylim()
    if isinstance(mappable.norm, LogNorm):
        style.log_ticks(axes.yaxis, (low, high))
    for mark in shown.marks:
        if low < mark < high:
            axes.axhline(mark, color=INK, linewidth=2.2)


# fronts


@in_house_style
def pareto_figure(shown: records.ParetoFront) -> Figure:
    """Draw the Pareto front and, below it to one scale, the chosen designs."""
    columns = (
        [quantity for quantity, _ in shown.chosen[0].numbers[: 2 + MOST_FACTORS]]
        if shown.chosen
        else []
    )
    numbers = [
        [significant(value, 3) for _, value in design.numbers[: len(columns)]]
        for design in shown.chosen
    ]
    rows = [["design", *(quantity.label for quantity in columns)]]
    rows += [[letter, *row] for letter, row in zip(LETTERS, numbers, strict=False)]
    return front_page(
        shown.caption, partial(plot_front, shown=shown), [one.stage for one in shown.chosen], rows
    )


def plot_front(ax: Axes, shown: records.ParetoFront) -> Axes:
    """Draw every design as a dot, the Pareto front as a line, and the letters of the chosen
    designs; return `ax`.
    """
    dots = shown.points
    n = len(shown.points)
    if n > MOST_DOTS:
        dots = dots[np.random.default_rng(0).choice(n, MOST_DOTS, replace=False, shuffle=False)]
    count = (
        f"{thousands(n)} designs"
        if n <= MOST_DOTS
        else f"{thousands(MOST_DOTS)} of {thousands(n)} designs"
    )
    size = 1.6 if n > VECTOR_DOTS else 2.8
    alpha = float(np.clip(600.0 / max(len(dots), 1), 0.06, 0.5))
    look: dict[str, Any] = {
        "linestyle": "none",
        "markeredgewidth": 0,
        "color": GREY,
        "marker": "o",
    }
    ax.plot(*dots.T, **look, markersize=size, alpha=alpha, rasterized=n > VECTOR_DOTS, zorder=1)
    if len(shown.undrawable):
        name = f"{thousands(len(shown.undrawable))} off the front cannot be drawn"
        ax.plot(
            *shown.points[shown.undrawable].T, "x", color=GREY, markersize=4, label=name, zorder=2
        )
    name = f"front: {thousands(len(shown.front))} non-dominated designs"
    line: dict[str, Any] = {
        "drawstyle": "steps-post",
        "color": FIRST_COLOUR,
        "markersize": 3.0,
        "linewidth": 1.2,
    }
    ax.plot(*shown.points[shown.front].T, "o-", **line, label=name, zorder=3)
    for letter, design in zip(LETTERS, shown.chosen, strict=False):
        style.ring(ax, shown.points[design.place], letter)
    if shown.base is not None:
        ax.plot(*shown.base, linestyle="none", label="base design", zorder=3.5, **PLUS)
    name_axes(ax, shown.x, shown.y, shown.better)
    ax.grid()
    ax.plot([], [], **look, markersize=4, label=count)
    for text in shown.left_out:
        ax.plot([], [], linestyle="none", label=text)
    ax.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.01), borderaxespad=0.0, ncols=2, frameon=False
    )
    return ax


# distributions


@in_house_style
def distribution_figure(shown: records.Distribution) -> Figure:
    """Draw a histogram for every value, with its percentiles, their confidence intervals and the
    nominal value.
    """
    count = len(shown.scatters)
    caption = shown.caption
    figure, axes = panels(
        (WIDTH, 1.97 * count), caption.title, caption.lines, count, assumptions=caption
    )
    for ax, scatter in zip(axes, shown.scatters, strict=True):
        plot_histogram(ax, scatter)
    figure.align_ylabels()
    return figure


def plot_histogram(ax: Axes, scatter: records.Scatter) -> Axes:
    """Draw a histogram of one value with its percentiles and their legend; return `ax`."""
    values = scatter.values
    quantity = scatter.quantity._replace(log=scatter.quantity.log and bool(values.min() > 0))
    counts, borders = histogram(np.log10(values) if quantity.log else values)
    borders = 10.0**borders if quantity.log else borders
    ax.stairs(
        counts,
        borders,
        fill=True,
        color=BAR_COLOUR,
        zorder=1,
    )
    ax.stairs(
        counts,
        borders,
        color=INK,
        linewidth=0.6,
        zorder=2,
    )
    entries = list[Any]()
    for dash, percentile in zip(("dashed", "solid", "dashed"), scatter.percentiles, strict=True):
        if np.isfinite([percentile.low, percentile.high]).all():
            ax.axvspan(
                percentile.low, percentile.high, color=INK, alpha=0.18, linewidth=0, zorder=2.5
            )
        entries.append(
            ax.axvline(
                percentile.value,
                color=INK,
                linestyle=dash,
                linewidth=1.5,
                zorder=3,
            )
        )
        entries[-1].set_label(_percentile_text(percentile, quantity.after))
    if scatter.nominal is not None:
        entries.append(
            ax.axvline(
                scatter.nominal, color=NOTE_COLOUR, linewidth=1.5, linestyle="dotted", zorder=4
            )
        )
        entries[-1].set_label(
            f"base design: {significant(scatter.nominal, DIGITS)}{quantity.after}"
        )
    style.legend_beside(
        ax,
        handles=entries,
        fontsize=8.5,
        handlelength=2.6,
        labelspacing=0.6,
    )
    ax.set(
        ylabel="designs",
        ylim=(0, 1.06 * max(float(counts.max()), 1.0)),
        xlim=(borders[0], borders[-1]),
    )
    name_axes(ax, quantity)
    if not quantity.log:
        ax.ticklabel_format(useOffset=False, axis="x")
    return ax


def histogram(values: Array) -> tuple[Array, Array]:
    """Counts (k,) and borders (k + 1,) of bars with the width by D. Freedman, P. Diaconis (1981)."""
    flat = np.ptp(values) <= ROUND_OFF * np.abs(values).max()
    width = 2.0 * np.subtract(*np.percentile(values, [75, 25])) / np.cbrt(len(values))
    bars = BARS[0] if width == 0 else int(np.clip(np.ceil(np.ptp(values) / width), *BARS))
    counts, borders = np.histogram(values, 1 if flat else bars)
    return counts.astype(np.float64), np.asarray(borders, dtype=np.float64)


def _percentile_text(percentile: records.Percentile, after: str) -> str:
    """Format a percentile with its confidence interval."""
    low, high = (
        significant(end, DIGITS) if np.isfinite(end) else ""
        for end in (percentile.low, percentile.high)
    )
    interval = f"{low}{SPACE}to{SPACE}{high}" if low and high else NO_INTERVAL
    return (
        f"{percentile.percent:g}{SPACE}%: {significant(percentile.value, DIGITS)}{after}\n"
        f"({interval})"
    )


# sensitivities


@in_house_style
def sensitivity_figure(shown: records.Sensitivity) -> Figure:
    """Draw first-order and total Sobol indices of every factor, in the order of the study file, one
    panel per value.
    """
    shares = shown.shares
    factors = shown.factors
    columns = 2 if len(shares) == 4 else min(3, len(shares))
    rows = -(-len(shares) // columns)
    size = (WIDTH, 0.35 + rows * (0.3 * len(factors) + 1.1))
    caption = shown.caption
    figure, axes = panels(size, caption.title, caption.lines, rows, columns, caption, len(shares))
    for index, (ax, share) in enumerate(zip(axes, shares, strict=True)):
        plot_shares(ax, share, factors)
        name = style.wrapped(share.quantity.name, SHARES_WIDTH / columns, 10.0)
        ax.set_title(name, loc="left")
        if index % columns:
            ax.set_yticklabels([])
    style.share_x(axes)
    style.legend_below(figure, axes, 2)
    return figure


def plot_shares(
    ax: Axes,
    share: records.Share,
    factors: Sequence[str],
) -> Axes:
    """Draw the Sobol indices of one value as bars with error bars, one row per factor; return `ax`."""
    rows = np.arange(float(len(share.first)))
    look: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.5, "zorder": 2}
    look["error_kw"] = {"ecolor": INK, "elinewidth": 1.0, "capsize": 2.0}
    bars = [(-0.19, share.first, share.first_band, FIRST_COLOUR, "first order: factor alone")]
    if share.total is not None and share.total_band is not None:
        bars.append((0.19, share.total, share.total_band, TOTAL_COLOUR, "total: with interactions"))
    for shift, values, band, colour, name in bars:
        ax.barh(
            rows + shift * (len(bars) - 1),
            values,
            0.36,
            xerr=band,
            color=colour,
            label=name,
            **look,
        )
    style.name_rows(ax, factors, 3.0)
    ax.set_xlabel(f"share of the variance\n(sum of first order: {share.first.sum():.2f})")
    ax.set_title(share.quantity.name, loc="left")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.tick_params(axis="y", length=0)
    return ax
