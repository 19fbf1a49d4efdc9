"""The error budget of the stage as waterfalls."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.paper.budget import CHART, MEASURED, SHARES, TOTAL, StageBudget
from flexfem.plot import style
from flexfem.plot.errors import WIDTH, WaterfallBar, plot_steps
from flexfem.plot.style import NAMES, panels, titled
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
    bars = [WaterfallBar(name, value, 0.0) for name, value in zip(SHARES, shares, strict=True)]
    bars.append(WaterfallBar("total in the plane", total, band, True))
    bars += _bars_of_thickness(budget, direction, total, band)
    places = int(max(-np.floor(np.log10(band)), 0))
    return plot_steps(ax, bars, places)


def _bars_of_thickness(
    budget: StageBudget, direction: Direction, total: float, band: float
) -> list[WaterfallBar]:
    """Return the effect of three dimensions, and the total with it, where they are known."""
    if "solid" not in budget.values:
        return []
    for source in (MEASURED, CHART):
        value = float(budget.at("solid", outside=source, direction=direction))
        width = float(budget.band("solid", outside=source, direction=direction))
        if np.isfinite(value):
            bars = [WaterfallBar("effect of three dimensions", value, float(np.nan_to_num(width)))]
            if width > 0:
                bars.append(
                    WaterfallBar("total in three dimensions", total + value, band + width, True)
                )
            return bars
    return []
