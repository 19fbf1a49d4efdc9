"""Combinations of neck offset and fixture that fit measured slopes."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.paper.figures.experiment import LIMIT_LINE
from flexfem.paper.identify import CAUSES, Identification
from flexfem.plot import style
from flexfem.plot.style import COLOURS, INK, MARKERS, NAMES, PALE
from flexfem.plot.text import significant
from flexfem.units import COMPLIANCES, DIRECTIONS, MICROMETRE, STIFFNESSES


@style.in_house_style
def identification_figure(found: Identification) -> Figure:
    """Draw the combinations of neck offset and fixture that fit the measured slopes."""
    slopes = list[str]()
    for k, axis in enumerate(DIRECTIONS):
        if np.isfinite(found.sd[k]):
            slope = f"{significant(found.slope[k, 0])} ± {significant(found.sd[k], 2)}"
            slopes.append(f"{NAMES[axis]} {slope} {STIFFNESSES[k]}")
    settings = found.settings
    lines = [
        f"{settings['measured']}: {', '.join(slopes)}. Model: {settings['analytic model']}. "
        f"{found.finding}"
    ]
    title = f"{found.about.name}: fit of the slopes"
    figure = style.page((8.27, 5.2), title, lines, partial(plot_region, found=found), found.about)
    style.legend_below(figure, figure.axes, 2)
    return figure


def plot_region(ax: Axes, found: Identification) -> Axes:
    """Draw the joint confidence region of neck offset and fixture, the best fit and single causes.

    Returns `ax`.
    """
    limit = float(found.region_limit)
    x = found.region_offset
    y = found.region_fixture
    above = found.region_above.T
    lowest = min(float(np.min(above)), 0.0) - 1.0
    ax.contourf(x, y, above, levels=[lowest, limit], colors=[PALE])
    ax.contour(
        x,
        y,
        above,
        levels=[limit],
        colors=[INK],
        linewidths=1.3,
    )
    label = f"joint region of {found.settings['confidence']}"
    ax.plot(
        [],
        [],
        color=INK,
        linewidth=1.3,
        label=label,
    )
    _plot_fits(ax, found)
    ax.axvline(0.0, **LIMIT_LINE)
    name = found.axes["number"][0]
    ylabel = f"fixture in {name} ({COMPLIANCES[0 if name == 'translation' else 2]})"
    if name == "pole":
        ax.axhline(1.0, label="necks as drawn, pole as described", **LIMIT_LINE)
        ylabel = "compliance of the pole / described one"
    ax.set(xlabel=f"offset of all necks ({MICROMETRE}), positive: wider", ylabel=ylabel)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0] - 0.02 * np.ptp(y), y[-1]))
    ax.grid()
    return ax


def _plot_fits(ax: Axes, found: Identification) -> None:
    """Draw the best fit, and the fits of single causes with the verdicts on them."""
    labels = ["best fit" if np.isfinite(found.correlation) else "one of the best fits"]
    for cause, is_allowed in zip(CAUSES[1:], found.allowed[1:], strict=True):
        labels.append(f"{cause}: {'allowed' if is_allowed else 'excluded'}")
    offsets = [found.offset, *found.cause_offset[1:]]
    fixtures = [found.fixture[0], *found.cause_fixture[1:, 0]]
    for k, (offset, fixture, label) in enumerate(zip(offsets, fixtures, labels, strict=True)):
        ax.plot(
            offset,
            fixture,
            MARKERS[k],
            color=COLOURS[k],
            markersize=8,
            label=label,
            zorder=4,
        )
