"""Figures of measurements: the experiment of Fig. 11, the identification of its slopes, the fatigue
life of necks.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array, is_largest
from flexfem.paper.experiment import NOT_THE_PAPERS, Experiment
from flexfem.paper.identify import CAUSES, Identification
from flexfem.paper.stage import HINGE_NAMES
from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, MARKERS, NAMES, PALE, panels, titled
from flexfem.plot.text import scientific, significant
from flexfem.questions.life import LEFT_OUT, Life
from flexfem.questions.setup import ELASTIC
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.units import (
    COMPLIANCES,
    DIRECTIONS,
    FORCES,
    MICROMETRE,
    STIFFNESSES,
    STRESS,
    Direction,
    unit_for,
)

FIT_LINE: Any = {"color": INK, "linewidth": 1.3}
MODEL_LINE: Any = {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.5}
STAGE_LINE: Any = {"color": COLOURS[0], "dashes": (1.5, 1.5), "linewidth": 1.7}
LIMIT_LINE: Any = {"color": GREY, "linewidth": 1.1, "dashes": (7, 2, 1.5, 2)}
RUN_COLOURS = (COLOURS[2], COLOURS[3], COLOURS[5], COLOURS[6])
LONGEST_LIFE = 1e14  # cycles; necks with longer lives are counted, not drawn
REVERSAL = 0.5  # cycles; shorter lives are drawn at it
LEFT_EDGE = 1e2  # cycles
HINGE_MARKERS = {"base": "s", "elbow": "o", "platform": "^"}


@style.in_house_style
def experiment_figure(found: Experiment) -> Figure:
    """Draw load over displacement for the three directions and, below, the residuals of the
    regression lines.
    """
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


def plot_push(ax: Axes, found: Experiment, direction: Direction) -> Axes:
    """Draw the readings in one direction, their regression line, and the lines of model and stage;
    return `ax`.
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
    ends = (
        f"{significant(found.low[k], 5)} to {significant(found.high[k], 5)}"
        if found.low[k] > 0
        else "no interval"
    )
    text = f"{significant(slope)} {STIFFNESSES[k]}\n{settings['confidence']}: {ends}"
    ax.text(0.04, 0.95, text, transform=ax.transAxes, va="top", size=9.0)
    ax.set_ylim(top=1.12 * max(model * span[1], float(np.max(load))))
    return ax


def plot_remains(ax: Axes, found: Experiment, direction: Direction) -> Axes:
    """Draw the residuals of the readings in one direction, and the limits of the slope's interval;
    return `ax`.
    """
    k = DIRECTIONS.index(direction)
    displacement = found.displacement[k]
    slope = found.at("slope", direction=direction, source="simulated")
    factor = _readings(
        ax, found, direction, "residual", found.load[k] - found.intercept[k] - slope * displacement
    )
    ax.axhline(0.0, **FIT_LINE)
    span = np.array([0.0, float(np.max(displacement))])
    for limit in filter(np.isfinite, (found.low[k], found.high[k])):
        residual = (limit - slope) * (span - np.mean(displacement))
        ax.plot(factor * span, residual, label="limits of the slope's interval", **LIMIT_LINE)
    return ax


def _readings(ax: Axes, found: Experiment, direction: Direction, name: str, values: Array) -> float:
    """Draw readings in one direction, with the marks of four runs in turn; return the factor of the
    x unit.
    """
    k = DIRECTIONS.index(direction)
    unit = unit_for(direction, float(np.max(found.displacement[k])))
    for run, (at, value) in enumerate(zip(found.displacement[k], values, strict=True)):
        look: Any = {
            "marker": MARKERS[run % 4],
            "color": RUN_COLOURS[run % 4],
            "markersize": 4.5,
            "linestyle": "none",
        }
        label = f"readings, run {run + 1}" if run < 4 else None
        ax.plot(unit.factor * at, value, markerfacecolor="none", label=label, **look)
    motion = "rotation" if direction == "theta" else "displacement in"
    ax.set(xlabel=f"{motion} {NAMES[direction]} ({unit.name})", ylabel=f"{name} ({FORCES[k]})")
    ax.grid()
    return unit.factor


@style.in_house_style
def identification_figure(found: Identification) -> Figure:
    """Draw the combinations of neck offset and fixture that fit the measured slopes."""
    slopes = ", ".join(
        f"{NAMES[axis]} {significant(found.slope[k, 0])} ± {significant(found.sd[k], 2)} "
        f"{STIFFNESSES[k]}"
        for k, axis in enumerate(DIRECTIONS)
        if np.isfinite(found.sd[k])
    )
    lines = [
        f"{found.settings['measured']}: {slopes}. Model: {found.settings['analytic model']}. "
        f"{found.finding}"
    ]
    title = f"{found.about.name}: fit of the slopes"
    figure = style.page((8.27, 5.2), title, lines, partial(plot_region, found=found), found.about)
    style.legend_below(figure, figure.axes, 2)
    return figure


def plot_region(ax: Axes, found: Identification) -> Axes:
    """Draw the joint confidence region of neck offset and fixture, the best fit and the single
    causes; return `ax`.
    """
    name = found.axes["number"][0]
    limit = float(found.region_limit)
    x = found.region_offset
    y = found.region_fixture
    above = found.region_above.T
    ax.contourf(x, y, above, levels=[min(float(np.min(above)), 0.0) - 1.0, limit], colors=[PALE])
    ax.contour(x, y, above, levels=[limit], colors=[INK], linewidths=1.3)
    ax.plot(
        [], [], color=INK, linewidth=1.3, label=f"joint region of {found.settings['confidence']}"
    )
    labels = ["best fit" if np.isfinite(found.correlation) else "one of the best fits"]
    labels += [
        f"{cause}: {'allowed' if each else 'excluded'}"
        for cause, each in zip(CAUSES, found.allowed, strict=True)
    ][1:]
    offsets = [found.offset, *found.cause_offset[1:]]
    numbers = [found.fixture[0], *found.cause_fixture[1:, 0]]
    for k, (offset, number, label) in enumerate(zip(offsets, numbers, labels, strict=True)):
        ax.plot(offset, number, MARKERS[k], color=COLOURS[k], markersize=8, label=label, zorder=4)
    ax.axvline(0.0, **LIMIT_LINE)
    ylabel = f"fixture in {name} ({COMPLIANCES[0 if name == 'translation' else 2]})"
    if name == "pole":
        ax.axhline(1.0, label="necks as drawn, pole as described", **LIMIT_LINE)
        ylabel = "compliance of the pole / described one"
    ax.set(xlabel=f"offset of all necks ({MICROMETRE}), positive: wider", ylabel=ylabel)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0] - 0.02 * np.ptp(y), y[-1]))
    ax.grid()
    return ax


@style.in_house_style
def life_figure(found: Life) -> Figure:
    """Draw the S-N curve with the hinges of all models on it."""
    settings = found.settings
    first = []
    for model, life, stress in zip(found.axes["model"], found.life, found.equivalent, strict=True):
        cycles = "infinite life" if np.isinf(life) else f"{significant(life, 3)} cycles"
        first.append(
            f"{model.capitalize()}: {cycles}, first at "
            f"{_hinge_name(found, int(np.argmax(is_largest(stress))))}"
        )
    motion = f"amplitude {settings['amplitude']} about {settings['about']}".replace(
        " um", f" {MICROMETRE}"
    )
    left_out = f"{LEFT_OUT[0].upper()}{LEFT_OUT[1:]}"
    if "notch sensitivity" in settings:  # of notches of a stage
        left_out += f"; notch sensitivity {settings['notch sensitivity']:g}"
    lines = [
        f"{settings['material']}; {motion}. {'. '.join(first)}.",
        f"{found.notes[0]}. {left_out}.",
    ]
    title = f"{found.about.name}: fatigue life of the hinges"
    return style.page((10.6, 5.2), title, lines, partial(plot_life, found=found), found.about)


def _hinge_name(found: Life, number: int) -> str:
    """Return the name of a hinge by its number, chain by chain."""
    hinges = found.axes["hinge"]
    if "chain" not in found.axes:
        return f"hinge {hinges[number]}"
    chain, hinge = divmod(number, len(hinges))
    return f"the {hinges[hinge]} hinge of {found.axes['chain'][chain]}"


def plot_life(ax: Axes, found: Life) -> Axes:
    """Draw Basquin's law, dashed where extrapolated, the yield strength and the hinges of every
    model; return `ax`.
    """
    law = found.law
    target = float(found.settings["wanted cycles"])
    strength = found.yield_strength
    low, high = law.range
    lives = np.clip(found.cycles, REVERSAL, LONGEST_LIFE)
    right = 10.0 * max(high, target, float(np.max(lives)))
    left = min(LEFT_EDGE, low / 3.0, 0.3 * float(np.min(lives)))
    label = "range of the fit" if law.range_stated else "range of the fit, assumed"
    ax.axvspan(low, high, color=PALE, linewidth=0, label=label)
    for ends, look in (((left, low), "--"), ((low, high), "-"), ((high, right), "--")):
        N = np.geomspace(*ends, 50)
        label = {"-": "Basquin's law"}.get(look, "" if ends[0] != left else "extrapolated")
        ax.plot(N, law.amplitude(N), look, color=INK, linewidth=1.6, label=label)
    ax.axhline(
        strength, color=COLOURS[1], linestyle=(0, (1, 1.5)), linewidth=1.6, label="yield strength"
    )
    ax.axvline(
        target, color=GREY, linestyle=(0, (6, 2, 1, 2)), linewidth=1.1, label="required life"
    )
    for k, model in enumerate(found.axes["model"]):
        if "chain" not in found.axes:
            _plot_hinges(ax, model, lives[k], found.equivalent[k], "o", f"hinges, {model}")
            continue
        for hinge, name in enumerate(HINGE_NAMES):
            parts = lives[k, :, hinge], found.equivalent[k, :, hinge]
            _plot_hinges(ax, model, *parts, HINGE_MARKERS[name], f"{name}, {model}")
    beyond = int(np.sum(found.cycles >= LONGEST_LIFE))
    left_out = (
        f"; {beyond} of {lives.size} points beyond {scientific(LONGEST_LIFE)}, not drawn"
        if beyond
        else ""
    )
    ax.set(xscale="log", yscale="log", xlim=(left, right), xlabel=f"cycles to failure{left_out}")
    ax.xaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))
    style.log_ticks(ax.yaxis, ax.get_ylim())
    ax.set_ylabel(f"equivalent fully reversed stress amplitude ({STRESS})")
    ax.grid(which="major")
    style.legend_beside(ax)
    return ax


def _plot_hinges(
    ax: Axes, model: str, lives: Array, stresses: Array, marker: str, label: str
) -> None:
    """Draw the lives (n,) of hinges by a model at their stresses (n,), MPa, without those beyond
    the figure.
    """
    looks: dict[str, Any] = {
        ANALYTIC: {
            "markerfacecolor": "none",
            "markeredgecolor": INK,
            "markersize": 9.0,
            "zorder": 4,
        },
        ELASTIC: {"color": COLOURS[0], "markerfacecolor": "none", "markersize": 6.5, "zorder": 3.5},
        ELEMENTS: {"color": COLOURS[2], "markersize": 5.5, "zorder": 3},
    }
    shown = lives < LONGEST_LIFE
    if np.any(shown):
        ax.plot(
            lives[shown],
            stresses[shown],
            linestyle="none",
            marker=marker,
            label=label,
            **looks[model],
        )
