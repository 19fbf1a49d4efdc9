"""The S-N curve of a material with the necks of a stage on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from flexfem.hinges.strength import Basquin
from flexfem.plot.curves import COLOURS
from flexfem.plot.style import GREY, INK, PALE, in_house_style, panels
from flexfem.plot.text import scientific, significant
from flexfem.units import COMMANDS, STRESS
from flexfem.verify.life import Life, Witness
from flexfem.verify.result import Triple

WIDTH, HEIGHT = 9.0, 5.2  # in
SHOWN = 1e14  # cycles; necks beyond are not drawn, but counted: no such life is ever seen
FIRST = 1e2  # cycles at the left edge
HINGES = {"base": "s", "elbow": "o", "platform": "^"}


@in_house_style
def life_figure(found: Life) -> Figure:
    """Draw the S-N curve with the necks of both models on it."""
    title = f"{found.name}: fatigue life of the necks"
    figure, (axes,) = panels((WIDTH, HEIGHT), title, _lines(found), 1, 1, (found.assumed, found.not_stated))
    plot_life(axes, found)
    return figure


def _lines(found: Life) -> list[str]:
    law = found.law
    first = [_said(each) for each in (found.analytic, found.elements) if each is not None]
    return [
        f"{found.material}; amplitude {_pose(found.amplitude)} about {_pose(found.mean)}. {'. '.join(first)}.",
        f"Basquin's law: {law.coefficient:g} {STRESS}, exponent {significant(law.exponent, 3)}, mean stress by "
        f"Walker's equation with {law.walker:g}; {law.source}. It is {found.left_out}; notch "
        f"sensitivity {found.notch_sensitivity:g}.",
    ]


def _said(of: Witness) -> str:
    neck = of.necks[of.first]
    life = "endless" if of.cycles is None else f"{of.cycles:.3g} cycles"
    return f"By {of.model}: {life}, {neck.hinge} hinge of chain {neck.chain} first"


def _pose(of: Triple) -> str:
    values = zip((of.x, of.y, of.theta), COMMANDS, strict=True)
    return ", ".join(f"{significant(unit.factor * value, 4)} {unit}" for value, unit in values)


def plot_life(ax: Axes, found: Life) -> Axes:
    """Draw Basquin's law, dashed where it is extrapolated, the yield strength, and the necks on it; returns `ax`."""
    law = Basquin(found.law.coefficient, found.law.exponent)
    low, high = found.law.range
    witnesses = [each for each in (found.analytic, found.elements) if each is not None]
    lives = [min(neck.cycles, SHOWN) for each in witnesses for neck in each.necks if neck.cycles]
    right = 10.0 * max([high, found.wanted, *lives])
    left = min([FIRST, low / 3.0, *(0.3 * life for life in lives)])
    ax.axvspan(low, high, color=PALE, linewidth=0, label="where the law was fitted" if found.law.range_stated else
               "where the law is taken to hold, assumed")  # fmt: skip
    for ends, look in (((left, low), "--"), ((low, high), "-"), ((high, right), "--")):
        N = np.geomspace(*ends, 50)
        label = {"-": "Basquin's law"}.get(look, "" if ends[0] != left else "extrapolated")
        ax.plot(N, law.amplitude(N), look, color=INK, linewidth=1.6, label=label)
    ax.axhline(found.yield_strength, color=COLOURS[1], linestyle=(0, (1, 1.5)), linewidth=1.6, label="yield strength")
    ax.axvline(found.wanted, color=GREY, linestyle=(0, (6, 2, 1, 2)), linewidth=1.1, label="wanted life")
    for which, each in enumerate(witnesses):
        _plot_necks(ax, each, hollow=which == 0)
    beyond = sum(not neck.cycles or neck.cycles >= SHOWN for each in witnesses for neck in each.necks)
    left_out = f"; {beyond} of {9 * len(witnesses)} points beyond {scientific(SHOWN)}, not drawn" if beyond else ""
    ax.set(xscale="log", yscale="log", xlim=(left, right), xlabel=f"cycles to failure{left_out}")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: scientific(value).removeprefix("1×")))
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylabel(f"fully reversed stress amplitude of the same life ({STRESS})")
    ax.grid(which="major")
    ax.legend(loc="lower left", framealpha=1.0, edgecolor="none", ncols=2)
    return ax


def _plot_necks(ax: Axes, of: Witness, hollow: bool) -> None:
    """The necks of one model, and the first of them by name; those that live beyond the axis are left out."""
    style: Any = {"markersize": 5.5, "zorder": 3}
    if hollow:
        style = {"markerfacecolor": "none", "markeredgecolor": INK, "markersize": 9.0, "zorder": 4}
    for hinge, marker in HINGES.items():
        shown = [(n.cycles, n.equivalent) for n in of.necks if n.hinge == hinge and n.cycles and n.cycles < SHOWN]
        if not shown:
            continue
        name = f"{hinge}, {'analytic' if hollow else 'finite elements'}"
        cycles, stress = np.array(shown, dtype=float).reshape(-1, 2).T
        ax.plot(cycles, stress, linestyle="none", marker=marker, label=name, color=COLOURS[2], **style)
    first = of.necks[of.first]
    if hollow and first.cycles and first.cycles < SHOWN:
        text = f"first: {first.hinge}, chain {first.chain}"
        ax.annotate(text, (first.cycles, first.equivalent), (14, 30), textcoords="offset points",
                    arrowprops={"arrowstyle": "-", "color": GREY})  # fmt: skip
