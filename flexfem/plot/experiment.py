"""Fig. 11: force over displacement as read, with its slope; and which causes fit measured slopes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.plot.style import COLOURS, GREY, INK, MARKERS, NAMES, PALE, in_house_style, panels
from flexfem.plot.text import significant
from flexfem.units import COMPLIANCES, DIRECTIONS, FORCES, MICROMETRE, STIFFNESSES, Direction, Unit, unit_for
from flexfem.verify.experiment import NOT_THE_PAPERS, Experiment, Pushed
from flexfem.verify.identified import Identification

WIDTH, HEIGHT = 11.69, 6.4  # in
REGION = (8.27, 5.2)  # in
FIT: Any = {"color": INK, "linewidth": 1.3}
MODEL: Any = {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.5}
METAL: Any = {"color": COLOURS[0], "dashes": (1.5, 1.5), "linewidth": 1.7}
ENDS: Any = {"color": GREY, "linewidth": 1.1, "dashes": (7, 2, 1.5, 2)}
SHADES = (COLOURS[2], COLOURS[3], COLOURS[5], COLOURS[6])


@in_house_style
def experiment_figure(found: Experiment) -> Figure:
    """Draw load over displacement for the three pushes, and below what its line leaves."""
    title = f"{found.name}: stiffness as read"
    lines = [
        f"Simulated readings, {found.fixture}; the metal is by {found.metal}. Slopes by regression of both readings on "
        f"the commanded stroke, intervals of {found.confidence:g} % by Fieller's theorem. {NOT_THE_PAPERS}"
    ]
    size, doubts = (WIDTH, HEIGHT), (found.assumed, found.not_stated)
    figure, every = panels(size, title, lines, 2, 3, doubts, height_ratios=(1.7, 1.0))
    for k, direction in enumerate(DIRECTIONS):
        plot_push(every[k], found, direction)
        every[k].set_title(f"({'abc'[k]}) {NAMES[direction]}", loc="left")
        plot_remains(every[3 + k], found, direction)
    figure.legend(*_legend(*every[:6]), loc="outside lower center", ncols=5, frameon=False, handlelength=3.4)
    return figure


def _legend(*axes: Axes) -> tuple[list[Any], list[str]]:
    named = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    return list(named.values()), list(named)


def plot_push(ax: Axes, found: Experiment, direction: Direction) -> Axes:
    """Draw the readings of one push, their line, and those of model and metal; returns `ax`."""
    push, row = found.pushed[direction], found.table[direction]
    unit, load = _frame(ax, push, direction, "force" if direction != "theta" else "moment")
    _readings(ax, push, unit, np.array(push.load))
    far = np.array([0.0, float(np.max(push.displacement))])
    for slope, start, label, style in (
        (row.model, 0.0, f"model: {found.model}", MODEL),
        (row.metal, 0.0, found.metal, METAL),
        (push.slope, push.intercept, "line through the readings", FIT),
    ):
        ax.plot(unit.factor * far, start + slope * far, label=label, **style)
    own = STIFFNESSES[DIRECTIONS.index(direction)]
    ends = "no interval" if push.low is None or push.high is None else f"{_ends(push.low, push.high)}"
    said = f"{significant(push.slope)} {own}\n{found.confidence:g} %: {ends}"
    ax.text(0.04, 0.95, said, transform=ax.transAxes, va="top", size=9.0)
    ax.set_ylim(top=1.12 * max(row.model * far[1], float(np.max(push.load))))
    ax.set_ylabel(f"{ax.get_ylabel()} ({load})")
    return ax


def _ends(low: float, high: float) -> str:
    return f"{significant(low, 5)} to {significant(high, 5)}"


def plot_remains(ax: Axes, found: Experiment, direction: Direction) -> Axes:
    """Draw the readings of one push less their line, and the ends of the slope's interval; returns `ax`."""
    push = found.pushed[direction]
    unit, load = _frame(ax, push, direction, "load less the line")
    q = np.array(push.displacement)
    _readings(ax, push, unit, np.array(push.load) - push.intercept - push.slope * q)
    ax.axhline(0.0, **FIT)
    middle, far = float(np.mean(q)), np.array([0.0, float(np.max(q))])
    for slope in (push.low, push.high):
        if slope is not None:
            label = "ends of the interval of the slope"
            ax.plot(unit.factor * far, (slope - push.slope) * (far - middle), label=label, **ENDS)
    ax.set_ylabel(f"{ax.get_ylabel()} ({load})")
    return ax


def _frame(ax: Axes, push: Pushed, direction: Direction, what: str) -> tuple[Unit, Unit]:
    unit, load = unit_for(direction, float(np.max(push.displacement))), FORCES[DIRECTIONS.index(direction)]
    moved = "rotation" if direction == "theta" else "displacement in"
    ax.set(xlabel=f"{moved} {NAMES[direction]} ({unit.name})", ylabel=what)
    ax.grid()
    return unit, load


def _readings(ax: Axes, push: Pushed, unit: Unit, values: Any) -> None:
    """Readings, each repeat by its own mark up to the fourth."""
    for k, (at, value) in enumerate(zip(push.displacement, values, strict=True)):
        look: Any = {"marker": MARKERS[k % 4], "color": SHADES[k % 4], "markersize": 4.5, "linestyle": "none"}
        named = f"readings, run {k + 1}" if k < 4 else None
        ax.plot(unit.factor * np.array(at), value, markerfacecolor="none", label=named, **look)


@in_house_style
def identification_figure(found: Identification) -> Figure:
    """Draw which neck offsets and fixtures fit the measured slopes."""
    title = f"{found.name}: what fits the slopes"
    stated = ", ".join(
        f"{NAMES[axis]} {significant(value)} ± {significant(found.sd[axis], 2)} {STIFFNESSES[DIRECTIONS.index(axis)]}"
        for axis, value in found.measured.items()
    )
    lines = [f"{found.source}: {stated}. Model: {found.model}. {found.finding}"]
    figure, (ax,) = panels(REGION, title, lines, 1, 1, (found.assumed, found.not_stated))
    plot_region(ax, found)
    figure.legend(*_legend(ax), loc="outside lower center", ncols=2, frameon=False)
    return figure


def plot_region(ax: Axes, found: Identification) -> Axes:
    """Draw the joint confidence region of neck offset and fixture, the best fit and the causes alone; returns `ax`."""
    region, (name, first) = found.region, next(iter(found.fixture.items()))
    x, y, above = MICROMETRE.factor * np.array(region.offset), np.array(region.fixture), np.array(region.above).T
    ax.contourf(x, y, above, levels=[min(float(np.min(above)), 0.0) - 1.0, region.limit], colors=[PALE])
    ax.contour(x, y, above, levels=[region.limit], colors=[INK], linewidths=1.3)
    ax.plot([], [], color=INK, linewidth=1.3, label=f"joint region of {found.confidence:g} %")
    causes = ((found.necks_alone, "necks alone", MARKERS[1], 1), (found.fixture_alone, "fixture alone", MARKERS[2], 2))
    places = [
        (
            found.offset.value,
            first.value,
            "best fit" if found.correlation is not None else "one of the best fits",
            MARKERS[0],
            0,
        )
    ]
    places += [(one.numbers[0], one.numbers[1], _allowed(label, one.allowed), m, c) for one, label, m, c in causes]
    for offset, number, label, marker, colour in places:
        ax.plot(MICROMETRE.factor * offset, number, marker, color=COLOURS[colour], markersize=8, label=label, zorder=4)
    ax.axvline(0.0, **ENDS)
    if name == "pole":
        ax.axhline(1.0, **ENDS)
        ax.add_line(Line2D([], [], label="as drawn, as described", **ENDS))
    units = {"translation": COMPLIANCES[0], "rotation": COMPLIANCES[2]}
    said = "pole, times as soft as described" if name == "pole" else f"fixture in {name} ({units[name]})"
    ax.set(xlabel=f"offset of all necks ({MICROMETRE}), positive wider", ylabel=said)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0] - 0.02 * np.ptp(y), y[-1]))
    ax.grid()
    return ax


def _allowed(label: str, allowed: bool) -> str:
    return f"{label}: allowed" if allowed else f"{label}: excluded"
