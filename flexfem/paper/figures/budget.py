"""The error budget of the stage as waterfalls."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.paper.budget import CHART, MEASURED, SHARES, TOTAL, StageBudget
from flexfem.plot import style
from flexfem.plot.errors import NAME_WIDTH, WIDTH
from flexfem.plot.style import COLOURS, GREY, INK, NAMES, panels, titled
from flexfem.plot.text import minus
from flexfem.results import number
from flexfem.units import DIRECTIONS, Direction


@style.in_house_style
def budget_figure(budget: StageBudget) -> Figure:
    """Draw the error budget of the commanded direction, one panel per direction."""
    lines = [
        "Error of the finite elements under the force of the analytic model, (18): "
        f"{budget.settings['model']}. Each bar begins where the previous one ends. Blue increases "
        "the error, orange decreases it. ±: mesh bands."
    ]
    title = f"{budget.about.name}: error budget"
    figure, axes = panels((WIDTH, 8.6), title, lines, 3, assumptions=budget.about)
    for letter, ax, direction in zip("abc", axes, DIRECTIONS, strict=True):
        plot_budget(ax, budget, direction)
        titled(ax, letter, f"command in {NAMES[direction]}")
        ax.label_outer()
    style.share_x(axes)
    return figure


class _Bar(NamedTuple):
    """A bar of a waterfall: its name, its value and its band, in per cent.

    is_total : whether it begins at zero, not at the end of the previous bar.
    """

    name: str
    value: float
    band: float
    is_total: bool = False


def plot_budget(
    ax: Axes,
    budget: StageBudget,
    direction: Direction,
) -> Axes:
    """Draw the shares of the error of the command in one direction and their sums; return `ax`.

    The effect of three dimensions follows the total in the plane where it is known: by finite
    elements, or else by the hinge chart. Raises BadInput for a direction other than x, y or theta.
    """
    *shares, total = budget.at("share", direction=direction).tolist()
    band = float(budget.band("share", share=TOTAL, direction=direction))
    bars = [_Bar(name, value, 0.0) for name, value in zip(SHARES, shares, strict=True)]
    bars.append(_Bar("total in the plane", total, band, True))
    bars += _bars_of_thickness(budget, direction, total, band)
    places = int(max(-np.floor(np.log10(band)), 0))
    ends = [0.0]
    for row, bar in enumerate(bars):
        start = 0.0 if bar.is_total else ends[-1]
        end = start + bar.value
        ends.append(end)
        colour = INK if bar.is_total else COLOURS[int(bar.value < 0)]
        look: dict[str, Any] = {
            "height": 0.62,
            "color": colour,
            "ecolor": GREY,
            "capsize": 4,
        }
        ax.barh(row, bar.value, left=start, xerr=bar.band or None, **look)
        text = number(bar.value, bar.band) if bar.band else f"{bar.value:+.{places}f}"
        right = max(start, end) + bar.band
        ax.text(right, row, f"  {minus(text)}", va="center", color=INK)
        if row < len(bars) - 1:
            ax.plot([end] * 2, [row - 0.31, row + 1.31], color=GREY, linewidth=0.8)
    style.name_rows(ax, [bar.name for bar in bars], NAME_WIDTH)
    room = max(ends) - min(ends)
    ax.set_xlim(min(ends) - 0.05 * room, max(ends) + 0.3 * room)
    ax.set_xlabel("error, % of the commanded motion")
    return ax


def _bars_of_thickness(
    budget: StageBudget, direction: Direction, total: float, band: float
) -> list[_Bar]:
    """Return the effect of three dimensions, and the total with it, where they are known."""
    if "solid" not in budget.values:
        return []
    for source in (MEASURED, CHART):
        value = float(budget.at("solid", outside=source, direction=direction))
        width = float(budget.band("solid", outside=source, direction=direction))
        if np.isfinite(value):
            bars = [_Bar("effect of three dimensions", value, float(np.nan_to_num(width)))]
            if width > 0:
                bars.append(_Bar("total in three dimensions", total + value, band + width, True))
            return bars
    return []
