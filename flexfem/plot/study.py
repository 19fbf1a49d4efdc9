"""Figures of studies from their records: maps, fronts, histograms and Sobol indices."""

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

from flexfem.arrays import Array, is_wide
from flexfem.plot import style
from flexfem.plot.stage import draw_to_one_scale
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, below_header, in_house_style, panels
from flexfem.plot.text import minus, significant
from flexfem.plot.write import write_each
from flexfem.results import SPACE, thousands
from flexfem.study import findings
from flexfem.study.findings import (
    AxisText,
    Chosen,
    Distribution,
    ParetoFront,
    Percentile,
    Scatter,
    Sensitivity,
    StudyMap,
)

WIDTH, LETTERS = 8.27, 7.5  # in, of a page; points, below a drawing
FIRST_COLOUR, BAR_COLOUR, TOTAL_COLOUR, HATCHED = "#0072B2", "#A9C4DE", "#F0C48A", "#A8A8A8"
DOTS, MOST_DOTS = 5000, 100_000  # more are rasterised in a PDF; of more that many are drawn, taken at random
HATCHES = ("////", "xxxx", "....", "||||", "----")
CONTOURS = 8  # about
BARS = (10, 60)  # fewest and most in a histogram
DIGITS, NONE = 5, "too few designs for an interval"  # of a percentile
ROUND_OFF = 1e-12  # of the largest value
ACROSS, CELL, WRITTEN = 4, 1.5, 6  # drawings in a row, their width in in, factors below each
NAMED = "ABCDEFGHIJKL"
PLUS: dict[str, Any] = {"color": NOTE_COLOUR, "marker": "+", "markersize": 13, "markeredgewidth": 2.2}


def write_study_figures(found: Mapping[str, findings.Record | findings.Refused], folder: Path) -> list[Path]:
    """Draw every figure of a study file that is not refused as PNG and PDF, under its name in a folder.

    Returns the paths written. Raises BadInput when the folder does not take a file.
    """
    drawn = {name: record for name, record in found.items() if not isinstance(record, findings.Refused)}
    return write_each({folder / f"{name}.png": partial(page_of, record) for name, record in drawn.items()})


def page_of(record: findings.Record) -> Figure:
    """The page of one record."""
    draw: dict[type, Callable[[Any], Figure]] = {
        StudyMap: map_figure, Distribution: distribution_figure, Sensitivity: sensitivity_figure
    }  # fmt: skip
    return draw.get(type(record), pareto_figure)(record)


def name_axes(axes: Axes, x: AxisText, y: AxisText | None = None, better: Sequence[str] = ("", "")) -> None:
    """Scales, labels and ticks of axes on which all is drawn."""
    for which, quantity, wanted in zip("xy", (x, y), better, strict=True):
        if quantity is not None:
            axis = axes.xaxis if which == "x" else axes.yaxis
            axes.set(**{f"{which}scale": "log" if quantity.log else "linear"})
            after = f"  ({wanted} is better)" if wanted else ""
            axis.set_label_text(quantity.label + after)
            if quantity.log:
                low, high = axis.get_view_interval()
                style.log_ticks(axis, (low, high))


# maps


@in_house_style
def map_figure(shown: StudyMap) -> Figure:
    """Draw a map on a page of its own."""
    figure, (axes,) = panels((WIDTH, 6.0), shown.caption.title, shown.caption.lines, 1, assumptions=shown.caption)
    plot_map(axes, shown)
    return figure


def plot_map(ax: Axes, shown: StudyMap) -> Axes:
    """Draw a value as colours over two factors: cells with labelled contours for a grid, else a dot per design.

    Returns `ax`; the bar that says what the colours mean is an inset of it. Nothing is interpolated but the contours.
    Values of both signs have two hues, and the contours of negative values are dashed.
    """
    norm = norm_of(shown.cells.values)
    colours: dict[str, Any] = {"norm": norm, "cmap": "PuOr_r" if isinstance(norm, CenteredNorm) else "viridis"}
    entries = (_draw_grid if shown.cells.grid else _draw_dots)(ax, shown, colours)
    name_axes(ax, shown.x, shown.y)
    ends = ax.get_xlim(), ax.get_ylim()
    if shown.base is not None and all(low <= at <= high for at, (low, high) in zip(shown.base, ends, strict=True)):
        ax.plot(*shown.base, "+", color="white", markersize=15, markeredgewidth=4.5, zorder=5)
        ax.plot(*shown.base, linestyle="none", zorder=6, **PLUS)
        entries.append(Line2D([], [], linestyle="none", label="base stage", **PLUS))
    if np.isfinite(shown.cells.values).any():
        _draw_bar(ax.inset_axes((1.035, 0.0, 0.04, 1.0)), ax.collections[0], shown)
    if entries:
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.0, 0.0), "borderaxespad": 4.6}
        ax.legend(handles=entries, **place, frameon=False, ncols=3, handlelength=2.4)
    return ax


def norm_of(values: Array) -> Normalize:
    """How values become colours: symmetric about zero for both signs, logarithmic for a wide range, else linear."""
    found = values[np.isfinite(values)]
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    if low < 0 < high:
        return CenteredNorm(0.0, max(-low, high))
    return LogNorm(low, high) if len(found) and is_wide(found) else Normalize(low, high)


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
    """Draw cells; returns entries of the legend, as `_draw_dots`."""
    (xs, column), (ys, row) = (np.unique(v, return_inverse=True) for v in shown.cells.points.T)
    across, up = edges(xs, shown.x.log), edges(ys, shown.y.log)
    values = np.full((len(ys), len(xs)), np.nan)
    values[row, column] = shown.cells.values
    masked = np.ma.masked_invalid(values)
    axes.pcolormesh(across, up, masked, **colours, rasterized=True, zorder=1)
    entries: list[Any] = []
    for hatch, (why, which) in zip(HATCHES, shown.cells.missing.items(), strict=False):
        corners = ((0, 0), (1, 0), (1, 1), (0, 1))
        places = list(zip(column[which], row[which], strict=True))
        boxes = [[(across[i + a], up[j + b]) for a, b in corners] for i, j in places]
        look: dict[str, Any] = {"facecolor": "white", "edgecolor": HATCHED, "linewidth": 0.0, "hatch": hatch}
        axes.add_collection(PolyCollection(boxes, **look, zorder=1.5), autolim=False)
        entries.append(Patch(**look, label=f"{why}: {thousands(len(boxes))}"))
    if min(values.shape) > 1 and masked.count() > 3:
        _draw_contours(axes, (xs, ys, masked), colours["norm"], shown, entries)
    return entries


def _draw_dots(axes: Axes, shown: StudyMap, colours: dict[str, Any]) -> list[Any]:
    points, values, missing, *_ = shown.cells
    known, many = np.isfinite(values), len(values) > DOTS
    size = float(np.clip(4e4 / max(len(values), 1), 1.5, 30.0))
    look: dict[str, Any] = {"s": size, "linewidths": 0, "rasterized": many, "zorder": 2}
    axes.scatter(points[known, 0], points[known, 1], c=values[known], **look, **colours)
    entries = []
    for mark, (why, which) in zip("x+123", missing.items(), strict=False):
        axes.plot(*points[which].T, mark, color=GREY, markersize=3.5, markeredgewidth=0.6, rasterized=many, zorder=1)
        label = f"{why}: {thousands(int(which.sum()))}"
        entries.append(Line2D([], [], color=GREY, linestyle="none", marker=mark, label=label))
    return entries


def _draw_contours(
    axes: Axes, grid: tuple[Array, Array, Any], norm: Normalize, shown: StudyMap, entries: list[Any]
) -> None:
    """Draw labelled contours of values on a grid (x, y, masked values), those that matter heavier."""
    low, high, unit = float(grid[2].min()), float(grid[2].max()), shown.value.after if shown.value.unit == "%" else ""
    heavy = [mark for mark in sorted(shown.marks) if low < mark < high]
    thin = [level for level in levels(norm, shown.marks) if low < level < high]
    for where, width in ((thin, 0.7), (heavy, 2.2)):
        if where:
            drawn = axes.contour(*grid, levels=where, colors=INK, linewidths=width, zorder=3)
            for name in axes.clabel(drawn, fontsize=8.5, fmt=lambda value: minus(f"{value:g}") + unit):
                name.set_bbox({"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.8})
    if heavy:
        said = " and ".join(f"{mark:g}{unit}" for mark in heavy)
        entries.append(Line2D([], [], color=INK, linewidth=2.2, label=f"contours of {said}"))


def levels(norm: Normalize, marks: Sequence[float]) -> Array:
    """Round values for thin contours between the ends of the colours, none of them a mark."""
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else MaxNLocator(CONTOURS)
    assert norm.vmin is not None and norm.vmax is not None
    return np.setdiff1d(np.asarray(locator.tick_values(norm.vmin, norm.vmax)), marks)


def _draw_bar(axes: Axes, drawn: Any, shown: StudyMap) -> None:
    """What the colours mean, with the contours that matter."""
    axes.figure.colorbar(drawn, cax=axes).set_label(shown.value.label)
    low, high = axes.get_ylim()
    if isinstance(drawn.norm, LogNorm):
        style.log_ticks(axes.yaxis, (low, high))
    for mark in shown.marks:
        if low < mark < high:
            axes.axhline(mark, color=INK, linewidth=2.2)


# fronts


@in_house_style
def pareto_figure(shown: ParetoFront) -> Figure:
    """Draw the front, and the chosen designs below, all to one scale."""
    rows, caption, names = -(-len(shown.chosen) // ACROSS), shown.caption, NAMED[: len(shown.chosen)]
    texts = [_texts(letter, one) for letter, one in zip(names, shown.chosen, strict=True)]
    cell = CELL + 0.155 * max((text.count("\n") + 1 for text in texts), default=0)
    figure = below_header((WIDTH, 5.2 + rows * cell), caption.title, caption.lines, caption)
    places = [["front"] * ACROSS, *np.reshape([*names.ljust(rows * ACROSS, ".")], (rows, ACROSS)).tolist()]
    axes = figure.subplot_mosaic(places, height_ratios=[5.2] + rows * [cell])
    plot_front(axes["front"], shown)
    for letter, text in zip(names, texts, strict=True):
        axes[letter].set_axis_off()
        axes[letter].set_title(text, loc="left", size=LETTERS, y=0.0, pad=-2, va="top", linespacing=1.3)
    if names:
        draw_to_one_scale([axes[letter] for letter in names], [one.stage for one in shown.chosen])
    return figure


def _texts(letter: str, chosen: Chosen) -> str:
    """What to write below a drawn design: x and y, and its factors."""
    shown = chosen.numbers[: 2 + WRITTEN]
    lines = [f"{quantity.name}: {significant(value, 3)}{quantity.after}" for quantity, value in shown]
    more = len(chosen.numbers) - len(shown)
    lines += [f"and {more} factors more"] if more else []
    return "\n".join(style.wrapped(line, CELL, LETTERS) for line in (f"{letter}:  {lines[0]}", *lines[1:]))


def plot_front(ax: Axes, shown: ParetoFront) -> Axes:
    """Draw every design as a dot, the front as a line, and the letters of the chosen designs; returns `ax`."""
    dots, n = shown.points, len(shown.points)
    if n > MOST_DOTS:
        dots = dots[np.random.default_rng(0).choice(n, MOST_DOTS, replace=False, shuffle=False)]
    said = f"{thousands(n)} designs" if n <= MOST_DOTS else f"{thousands(MOST_DOTS)} of {thousands(n)} designs"
    size, alpha = (1.6 if n > DOTS else 2.8), float(np.clip(600.0 / max(len(dots), 1), 0.06, 0.5))
    look: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0, "color": GREY, "marker": "o"}
    ax.plot(*dots.T, **look, markersize=size, alpha=alpha, rasterized=n > DOTS, zorder=1)
    if len(shown.undrawable):
        name = f"{thousands(len(shown.undrawable))} not on the front: cannot be drawn"
        ax.plot(*shown.points[shown.undrawable].T, "x", color=GREY, markersize=4, label=name, zorder=2)
    name = f"front: {thousands(len(shown.front))} designs that no other beats"
    line: dict[str, Any] = {"drawstyle": "steps-post", "color": FIRST_COLOUR, "markersize": 3.0, "linewidth": 1.2}
    ax.plot(*shown.points[shown.front].T, "o-", **line, label=name, zorder=3)
    for letter, chosen in zip(NAMED, shown.chosen, strict=False):
        style.ring(ax, shown.points[chosen.place], letter)
    if shown.base is not None:
        ax.plot(*shown.base, linestyle="none", label="base stage", zorder=3.5, **PLUS)
    name_axes(ax, shown.x, shown.y, shown.better)
    ax.grid()
    ax.plot([], [], **look, markersize=4, label=said)
    for text in shown.left_out:
        ax.plot([], [], linestyle="none", label=text)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.01), borderaxespad=0.0, ncols=2, frameon=False)
    return ax


# distributions


@in_house_style
def distribution_figure(shown: Distribution) -> Figure:
    """Draw a histogram for every value, with its percentiles, their confidence intervals and the nominal value."""
    count, caption = len(shown.scatters), shown.caption
    figure, found = panels((WIDTH, 1.97 * count), caption.title, caption.lines, count, assumptions=caption)
    for axes, scatter in zip(found, shown.scatters, strict=True):
        plot_histogram(axes, scatter)
    figure.align_ylabels()
    return figure


def plot_histogram(ax: Axes, scatter: Scatter) -> Axes:
    """Draw a histogram of one value with its percentiles and their legend; returns `ax`."""
    values = scatter.values
    quantity = scatter.quantity._replace(log=scatter.quantity.log and bool(values.min() > 0))
    counts, borders = histogram(np.log10(values) if quantity.log else values)
    borders = 10.0**borders if quantity.log else borders
    ax.stairs(counts, borders, fill=True, color=BAR_COLOUR, zorder=1)
    ax.stairs(counts, borders, color=INK, linewidth=0.6, zorder=2)
    entries = list[Any]()
    for dash, one in zip(("dashed", "solid", "dashed"), scatter.percentiles, strict=True):
        if np.isfinite([one.low, one.high]).all():
            ax.axvspan(one.low, one.high, color=INK, alpha=0.18, linewidth=0, zorder=2.5)
        entries.append(ax.axvline(one.value, color=INK, linestyle=dash, linewidth=1.5, zorder=3))
        entries[-1].set_label(_described(one, quantity.after))
    if scatter.nominal is not None:
        entries.append(ax.axvline(scatter.nominal, color=NOTE_COLOUR, linewidth=1.5, linestyle="dotted", zorder=4))
        entries[-1].set_label(f"base stage: {significant(scatter.nominal, DIGITS)}{quantity.after}")
    style.legend_beside(ax, handles=entries, fontsize=8.5, handlelength=2.6, labelspacing=0.6)
    ax.set(ylabel="designs", ylim=(0, 1.06 * max(float(counts.max()), 1.0)), xlim=(borders[0], borders[-1]))
    name_axes(ax, quantity)
    if not quantity.log:
        ax.ticklabel_format(useOffset=False, axis="x")
    return ax


def histogram(values: Array) -> tuple[Array, Array]:
    """Counts (k,) and borders (k + 1,) of the bars, as wide as D. Freedman, P. Diaconis (1981) say."""
    flat = np.ptp(values) <= ROUND_OFF * np.abs(values).max()
    width = 2.0 * np.subtract(*np.percentile(values, [75, 25])) / np.cbrt(len(values))
    bars = BARS[0] if width == 0 else int(np.clip(np.ceil(np.ptp(values) / width), *BARS))
    counts, borders = np.histogram(values, 1 if flat else bars)
    return counts.astype(np.float64), np.asarray(borders, dtype=np.float64)


def _described(one: Percentile, after: str) -> str:
    """A percentile with its confidence interval, in words."""
    known = bool(np.isfinite([one.low, one.high]).all())
    interval = f"{significant(one.low, DIGITS)}{SPACE}to{SPACE}{significant(one.high, DIGITS)}" if known else NONE
    return f"{one.percent:g}{SPACE}%: {significant(one.value, DIGITS)}{after}\n({interval})"


# sensitivities


@in_house_style
def sensitivity_figure(shown: Sensitivity) -> Figure:
    """Draw first-order and total indices of every factor, in the order of the study file, a panel for each value."""
    shares, factors = shown.shares, shown.factors
    across = 2 if len(shares) == 4 else min(3, len(shares))
    rows = -(-len(shares) // across)
    size, caption = (WIDTH, 0.35 + rows * (0.3 * len(factors) + 1.1)), shown.caption
    figure, found = panels(size, caption.title, caption.lines, rows, across, caption, len(shares))
    for index, (axes, share) in enumerate(zip(found, shares, strict=True)):
        plot_shares(axes, share, factors)
        if index % across:
            axes.set_yticklabels([])
    style.share_x(found)
    style.legend_below(figure, found, 2)
    return figure


def plot_shares(ax: Axes, share: findings.Share, factors: Sequence[str]) -> Axes:
    """Draw the Sobol indices of one value as bars, with whiskers, a row for each factor; returns `ax`."""
    found, places = share.indices, np.arange(float(len(share.indices.first)))
    look: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.5, "zorder": 2}
    look["error_kw"] = {"ecolor": INK, "elinewidth": 1.0, "capsize": 2.0}
    bars = [(-0.19, found.first, found.first_band, FIRST_COLOUR, "first order: alone")]
    if found.total is not None and found.total_band is not None:
        bars.append((0.19, found.total, found.total_band, TOTAL_COLOUR, "total: with its interactions"))
    for shift, values, band, colour, name in bars:
        ax.barh(places + shift * (len(bars) - 1), values, 0.36, xerr=band, color=colour, label=name, **look)
    style.name_rows(ax, factors, 3.0)
    ax.set_xlabel(f"share of the variance\n(first order sums to {found.first.sum():.2f})")
    ax.set_title(share.quantity.name, loc="left")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.tick_params(axis="y", length=0)
    return ax
