"""The S-N curve of a material with the necks of a stage on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.mechanism.stage import HINGE_NAMES
from flexfem.plot.style import COLOURS, GREY, INK, PALE, in_house_style, log_ticks, panels
from flexfem.plot.text import scientific
from flexfem.questions.life import Life
from flexfem.results import ANALYTIC
from flexfem.units import STRESS

SHOWN = 1e14  # cycles; necks beyond are not drawn, but counted: no such life is ever seen
FIRST = 1e2  # cycles at the left edge
HINGES = {"base": "s", "elbow": "o", "platform": "^"}


@in_house_style
def life_figure(found: Life) -> Figure:
    """Draw the S-N curve with the necks of both models on it."""
    asked, first = found.settings, []
    for model, life, stress in zip(found.axes["model"], found.life, found.equivalent, strict=True):
        cycles = "endless" if np.isinf(life) else f"{life:.3g} cycles"
        first.append(f"By {model}: {cycles}, {_first(stress)[1]} first")
    law, *others = found.notes
    lines = [
        f"{asked['material']}; amplitude {asked['amplitude']} about {asked['about']}. {'. '.join(first)}.",
        f"{law}. {others[-1]}; notch sensitivity {asked['notch sensitivity']:g}.",
    ]
    figure, (axes,) = panels((9.0, 5.2), f"{found.about.name}: fatigue life of the necks", lines, 1, doubts=found.about)
    plot_life(axes, found)
    return figure


def _first(stress: Array) -> tuple[tuple[int, int], str]:
    """Chain and hinge of the highest of stresses (3, 3), and the name of that place."""
    chain, hinge = divmod(int(np.argmax(stress)), 3)
    return (chain, hinge), f"{HINGE_NAMES[hinge]} hinge of chain {chain + 1}"


def plot_life(ax: Axes, found: Life) -> Axes:
    """Draw Basquin's law, dashed where it is extrapolated, the yield strength, and the necks on it; returns `ax`."""
    law, wanted, strength = found.law, float(found.settings["wanted cycles"]), found.yield_strength
    low, high = law.range
    lives = np.minimum(found.cycles, SHOWN)
    right = 10.0 * max(high, wanted, float(np.max(lives)))
    left = min(FIRST, low / 3.0, 0.3 * float(np.min(lives)))
    label = "where the law was fitted" if law.range_stated else "where the law is taken to hold, assumed"
    ax.axvspan(low, high, color=PALE, linewidth=0, label=label)
    for ends, look in (((left, low), "--"), ((low, high), "-"), ((high, right), "--")):
        N = np.geomspace(*ends, 50)
        label = {"-": "Basquin's law"}.get(look, "" if ends[0] != left else "extrapolated")
        ax.plot(N, law.amplitude(N), look, color=INK, linewidth=1.6, label=label)
    ax.axhline(strength, color=COLOURS[1], linestyle=(0, (1, 1.5)), linewidth=1.6, label="yield strength")
    ax.axvline(wanted, color=GREY, linestyle=(0, (6, 2, 1, 2)), linewidth=1.1, label="wanted life")
    for k, model in enumerate(found.axes["model"]):
        _plot_necks(ax, model, found.cycles[k], found.equivalent[k])
    beyond = int(np.sum(found.cycles >= SHOWN))
    left_out = f"; {beyond} of {found.cycles.size} points beyond {scientific(SHOWN)}, not drawn" if beyond else ""
    ax.set(xscale="log", yscale="log", xlim=(left, right), xlabel=f"cycles to failure{left_out}")
    ax.xaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))
    log_ticks(ax.yaxis, ax.get_ylim())
    ax.set_ylabel(f"fully reversed stress amplitude of the same life ({STRESS})")
    ax.grid(which="major")
    ax.legend(loc="lower left", framealpha=1.0, edgecolor="none", ncols=2)
    return ax


def _plot_necks(ax: Axes, model: str, cycles: Array, stress: Array) -> None:
    """The necks of one model, and the first of them by name; those that live beyond the axis are left out."""
    hollow = model == ANALYTIC
    style: Any = {"markersize": 5.5, "zorder": 3}
    if hollow:
        style = {"markerfacecolor": "none", "markeredgecolor": INK, "markersize": 9.0, "zorder": 4}
    for hinge, name in enumerate(HINGE_NAMES):
        shown = cycles[:, hinge] < SHOWN
        if np.any(shown):
            points = cycles[shown, hinge], stress[shown, hinge]
            ax.plot(*points, linestyle="none", marker=HINGES[name], label=f"{name}, {model}", color=COLOURS[2], **style)
    place, first = _first(stress)
    if hollow and cycles[place] < SHOWN:
        look = {"arrowstyle": "-", "color": GREY}
        at = (cycles[place], stress[place])
        ax.annotate(f"first: {first}", at, (14, 30), textcoords="offset points", arrowprops=look)
