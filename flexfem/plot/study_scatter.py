"""How the values of a study scatter, and which factor causes how much of that: histograms and Sobol indices."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from flexfem.arrays import Array
from flexfem.plot.study_labels import Caption, Quantity, name_axis
from flexfem.plot.style import DASHES, INK, NOTE_COLOUR, in_house_style, legend_beside, panels
from flexfem.plot.text import SPACE, significant
from flexfem.study.findings import Indices, Percentile

WIDTH, PANEL = 8.27, 1.97  # in, of a page, and height of a histogram with its axis
LETTERS = 8.5  # points, of the legend
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
    figure, found = panels((WIDTH, PANEL * len(scatters)), title, lines, len(scatters), doubts=doubts)
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
    legend_beside(ax, handles=entries, fontsize=LETTERS, handlelength=2.6, labelspacing=0.6)
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
ACROSS = 3  # panels in a row
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
    across = 2 if len(shares) == 4 else min(ACROSS, len(shares))
    rows = -(-len(shares) // across)
    height = LEGEND + rows * (BAR_ROW * len(factors) + AROUND)
    figure, found = panels((WIDTH, height), title, lines, rows, across, doubts)
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
