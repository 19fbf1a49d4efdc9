"""Which factor causes how much of a value's variance: bars of Sobol indices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from flexfem.arrays import Array
from flexfem.plot.study_labels import Caption, Quantity
from flexfem.plot.style import INK, add_axes, header, in_house_style, new_figure, text_width
from flexfem.study.sensitivity import Indices

WIDTH, BAR_ROW, PANEL_GAP, FOOT, LEGEND = 8.27, 0.3, 0.22, 0.72, 0.32  # in
ACROSS = 3  # panels in a row
FIRST_COLOUR, TOTAL_COLOUR = "#0072B2", "#F0C48A"
NAME_SIZE = 8.5  # points


class Share(NamedTuple):
    """One value and the indices of every factor."""

    quantity: Quantity
    indices: Indices


@in_house_style
def sensitivity_figure(shares: Sequence[Share], factors: Sequence[str], caption: Caption) -> Figure:
    """Draw first-order and total indices of every factor, in the order of the study file, a panel for each value."""
    across = 2 if len(shares) == 4 else min(ACROSS, len(shares))
    rows = -(-len(shares) // across)
    panel = BAR_ROW * len(factors) + 0.15
    left = 0.25 + max(text_width(name, NAME_SIZE) for name in factors)
    width = (WIDTH - left - 0.25 - PANEL_GAP * (across - 1)) / across
    used = header(new_figure(WIDTH, 10.0), *caption)
    row_height = panel + 0.32 + FOOT
    figure = new_figure(WIDTH, used + LEGEND + rows * row_height)
    header(figure, *caption)
    ends = limits([share.indices for share in shares])
    for index, share in enumerate(shares):
        row, column = divmod(index, across)
        bottom = (rows - 1 - row) * row_height + FOOT
        axes = add_axes(figure, left + column * (width + PANEL_GAP), bottom, width, panel)
        _draw_panel(axes, share, ends)
        axes.set_yticks(np.arange(len(factors)), factors if column == 0 else [""] * len(factors), size=NAME_SIZE)
        axes.set_xlabel(f"share of the variance\n(first order sums to {share.indices.first.sum():.2f})")
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (left / WIDTH, 1 - used / figure.get_figheight())}
    figure.legend(*figure.axes[0].get_legend_handles_labels(), **place, ncols=2, frameon=False, borderaxespad=0.0)
    return figure


def limits(indices: Sequence[Indices]) -> tuple[float, float]:
    """Ends of the axis that all panels share: nought, or less where a whisker goes there, to the longest whisker."""
    bars = [pair for i in indices for pair in ((i.first, i.first_band), (i.total, i.total_band))]
    ends = [(value - band, value + band) for value, band in bars if value is not None and band is not None]
    low, high = float(np.min([end[0] for end in ends])), float(np.max([end[1] for end in ends]))
    room = 0.03 * (high - min(low, 0.0))
    return min(low, 0.0) - room, high + room


def _draw_panel(axes: Axes, share: Share, ends: tuple[float, float]) -> None:
    found, places = share.indices, np.arange(float(len(share.indices.first)))
    _draw_bars(
        axes,
        places - (0.19 if found.total is not None else 0.0),
        (found.first, found.first_band),
        FIRST_COLOUR,
        "first order: alone",
    )
    if found.total is not None and found.total_band is not None:
        _draw_bars(axes, places + 0.19, (found.total, found.total_band), TOTAL_COLOUR, "total: with its interactions")
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.set(xlim=ends, ylim=(len(places) - 0.45, -0.55))
    axes.set_title(share.quantity.symbol or share.quantity.name, parse_math=bool(share.quantity.symbol), loc="left")
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(axis="x", color="#D5D5D5", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)


def _draw_bars(axes: Axes, places: Array, values: tuple[Array, Array], colour: str, name: str) -> None:
    whiskers: dict[str, Any] = {"ecolor": INK, "elinewidth": 1.0, "capsize": 2.0}
    look: dict[str, Any] = {"color": colour, "edgecolor": INK, "linewidth": 0.5}
    axes.barh(places, values[0], 0.36, xerr=values[1], label=name, error_kw=whiskers, zorder=2, **look)
