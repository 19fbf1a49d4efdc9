"""The experiment of Fig. 11: readings, regression lines and residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.paper.experiment import NOT_THE_PAPERS, Experiment
from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, MARKERS, NAMES, panels, titled
from flexfem.plot.text import significant
from flexfem.units import DIRECTIONS, FORCES, STIFFNESSES, Direction, unit_for

FIT_LINE: Any = {"color": INK, "linewidth": 1.3}
MODEL_LINE: Any = {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.5}
STAGE_LINE: Any = {"color": COLOURS[0], "dashes": (1.5, 1.5), "linewidth": 1.7}
LIMIT_LINE: Any = {"color": GREY, "linewidth": 1.1, "dashes": (7, 2, 1.5, 2)}
RUN_COLOURS = (COLOURS[2], COLOURS[3], COLOURS[5], COLOURS[6])


@style.in_house_style
def experiment_figure(found: Experiment) -> Figure:
    """Draw load over displacement for the three directions and, below, the residuals of the fits."""
    lines = [
        f"Simulated readings, {found.settings['fixture']}; stage by {found.settings['stage']}. "
        "Slopes by regression of both readings on the commanded stroke, intervals of "
        f"{found.settings['confidence']} by Fieller's theorem. {NOT_THE_PAPERS}"
    ]
    title = f"{found.about.name}: stiffness from readings"
    figure, axes = panels((11.69, 6.4), title, lines, 2, 3, found.about, height_ratios=(1.7, 1.0))
    for k, direction in enumerate(DIRECTIONS):
        titled(plot_push(axes[k], found, direction), "abc"[k], NAMES[direction])
        plot_remains(axes[3 + k], found, direction)
    style.legend_below(figure, axes, 5, handlelength=3.4)
    return figure


def plot_push(
    ax: Axes,
    found: Experiment,
    direction: Direction,
) -> Axes:
    """Draw the readings in one direction, their regression line, and the lines of model and stage.

    Returns `ax`.
    """
    k = DIRECTIONS.index(direction)
    model, stage, slope, _ = found.slope[k]
    load = found.load[k]
    settings = found.settings
    span = np.array([0.0, float(np.max(found.displacement[k]))])
    factor = _readings(ax, found, direction, "force" if direction != "theta" else "moment", load)
    ax.plot(factor * span, model * span, label=f"model: {settings['model']}", **MODEL_LINE)
    ax.plot(factor * span, stage * span, label=settings["stage"], **STAGE_LINE)
    ax.plot(factor * span, found.intercept[k] + slope * span, label="regression line", **FIT_LINE)
    ends = "no interval"
    if found.low[k] > 0:
        ends = f"{significant(found.low[k], 5)} to {significant(found.high[k], 5)}"
    text = f"{significant(slope)} {STIFFNESSES[k]}\n{settings['confidence']}: {ends}"
    ax.text(
        0.04,
        0.95,
        text,
        transform=ax.transAxes,
        va="top",
        size=9.0,
    )
    ax.set_ylim(top=1.12 * max(model * span[1], float(np.max(load))))
    return ax


def plot_remains(
    ax: Axes,
    found: Experiment,
    direction: Direction,
) -> Axes:
    """Draw the residuals of the readings in one direction, and the limits of the slope's interval.

    Returns `ax`.
    """
    k = DIRECTIONS.index(direction)
    displacement = found.displacement[k]
    slope = found.at("slope", direction=direction, source="simulated")
    residuals = found.load[k] - found.intercept[k] - slope * displacement
    factor = _readings(ax, found, direction, "residual", residuals)
    ax.axhline(0.0, **FIT_LINE)
    span = np.array([0.0, float(np.max(displacement))])
    for limit in filter(np.isfinite, (found.low[k], found.high[k])):
        residual = (limit - slope) * (span - np.mean(displacement))
        ax.plot(factor * span, residual, label="limits of the slope's interval", **LIMIT_LINE)
    return ax


def _readings(
    ax: Axes,
    found: Experiment,
    direction: Direction,
    name: str,
    values: Array,
) -> float:
    """Draw readings in one direction, with the marks of four runs in turn.

    Returns the factor of the unit of x.
    """
    k = DIRECTIONS.index(direction)
    unit = unit_for(direction, float(np.max(found.displacement[k])))
    for run, (at, value) in enumerate(zip(found.displacement[k], values, strict=True)):
        look: Any = {"marker": MARKERS[run % 4], "color": RUN_COLOURS[run % 4], "markersize": 4.5}
        look |= {"linestyle": "none", "markerfacecolor": "none"}
        label = f"readings, run {run + 1}" if run < 4 else None
        ax.plot(unit.factor * at, value, label=label, **look)
    motion = "rotation" if direction == "theta" else "displacement in"
    ax.set(xlabel=f"{motion} {NAMES[direction]} ({unit.name})", ylabel=f"{name} ({FORCES[k]})")
    ax.grid()
    return unit.factor
