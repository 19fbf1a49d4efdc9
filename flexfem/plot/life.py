"""The fatigue life of hinges: the S-N curve with the hinges of all models on it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array, is_largest
from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, PALE
from flexfem.plot.text import scientific, significant
from flexfem.questions.life import LEFT_OUT, Life
from flexfem.questions.setup import ELASTIC
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.units import MICROMETRE, STRESS

LONGEST_LIFE = 1e14  # cycles; necks with longer lives are counted, not drawn
REVERSAL = 0.5  # cycles; shorter lives are drawn at it
LEFT_EDGE = 1e2  # cycles
HINGE_MARKERS = ("s", "o", "^")  # by place in a chain
MODEL_LOOKS: dict[str, dict[str, Any]] = {
    ANALYTIC: {
        "markerfacecolor": "none",
        "markeredgecolor": INK,
        "markersize": 9.0,
        "zorder": 4,
    },
    ELASTIC: {
        "color": COLOURS[0],
        "markerfacecolor": "none",
        "markersize": 6.5,
        "zorder": 3.5,
    },
    ELEMENTS: {"color": COLOURS[2], "markersize": 5.5, "zorder": 3},
}


@style.in_house_style
def life_figure(found: Life) -> Figure:
    """Draw the S-N curve with the hinges of all models on it."""
    settings = found.settings
    lives = list[str]()
    for model, life, stress in zip(found.axes["model"], found.life, found.equivalent, strict=True):
        cycles = "infinite life" if np.isinf(life) else f"{significant(life, 3)} cycles"
        first = _hinge_name(found, int(np.argmax(is_largest(stress))))
        lives.append(f"{model.capitalize()}: {cycles}, first at {first}")
    motion = f"amplitude {settings['amplitude']} about {settings['about']}"
    left_out = f"{LEFT_OUT[0].upper()}{LEFT_OUT[1:]}"
    if "notch sensitivity" in settings:
        left_out += f"; notch sensitivity {settings['notch sensitivity']:g}"
    lines = [
        f"{settings['material']}; {motion.replace(' um', f' {MICROMETRE}')}. {'. '.join(lives)}.",
        f"{found.notes[0]}. {left_out}.",
    ]
    title = f"{found.about.name}: fatigue life of the hinges"
    return style.page((10.6, 5.2), title, lines, partial(plot_life, found=found), found.about)


def _hinge_name(found: Life, number: int) -> str:
    """Return the name of a hinge by its number, chain by chain where there are chains."""
    hinges = found.axes["hinge"]
    if "chain" not in found.axes:
        return f"hinge {hinges[number]}"
    chain, hinge = divmod(number, len(hinges))
    return f"the {hinges[hinge]} hinge of {found.axes['chain'][chain]}"


def plot_life(ax: Axes, found: Life) -> Axes:
    """Draw Basquin's law, the yield strength and the hinges of every model; return `ax`.

    The law is dashed where it is extrapolated.
    """
    lives = np.clip(found.cycles, REVERSAL, LONGEST_LIFE)
    _plot_law(ax, found, lives)
    for k, model in enumerate(found.axes["model"]):
        _plot_model(ax, found, model, lives[k], found.equivalent[k])
    beyond = int(np.sum(found.cycles >= LONGEST_LIFE))
    label = "cycles to failure"
    if beyond:
        label += f"; {beyond} of {lives.size} points beyond {scientific(LONGEST_LIFE)}, not drawn"
    ax.set(
        xscale="log",
        yscale="log",
        xlabel=label,
    )
    ax.xaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))
    style.log_ticks(ax.yaxis, ax.get_ylim())
    ax.set_ylabel(f"equivalent fully reversed stress amplitude ({STRESS})")
    ax.grid(which="major")
    style.legend_beside(ax)
    return ax


def _plot_law(
    ax: Axes,
    found: Life,
    lives: Array,
) -> None:
    """Draw the law with its range, the yield strength and the required life; set the x range."""
    law = found.law
    low, high = law.range
    target = float(found.settings["wanted cycles"])
    right = 10.0 * max(high, target, float(np.max(lives)))
    left = min(LEFT_EDGE, low / 3.0, 0.3 * float(np.min(lives)))
    label = "range of the fit" if law.range_stated else "range of the fit, assumed"
    ax.axvspan(
        low,
        high,
        color=PALE,
        linewidth=0,
        label=label,
    )
    parts = (
        (left, low, "--", "extrapolated"),
        (low, high, "-", "Basquin's law"),
        (high, right, "--", ""),
    )
    for start, end, dashes, label in parts:
        N = np.geomspace(start, end, 50)
        ax.plot(
            N,
            law.amplitude(N),
            dashes,
            color=INK,
            linewidth=1.6,
            label=label,
        )
    dotted: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (1, 1.5)), "linewidth": 1.6}
    ax.axhline(found.yield_strength, label="yield strength", **dotted)
    dashed: dict[str, Any] = {"color": GREY, "linestyle": (0, (6, 2, 1, 2)), "linewidth": 1.1}
    ax.axvline(target, label="required life", **dashed)
    ax.set_xlim(left, right)


def _plot_model(
    ax: Axes,
    found: Life,
    model: str,
    lives: Array,
    stresses: Array,
) -> None:
    """Draw the hinges by a model at their lives and stresses, MPa, each kind with its marker."""
    if "chain" not in found.axes:
        _plot_hinges(ax, model, lives, stresses, "o", f"hinges, {model}")
        return
    for hinge, name in enumerate(found.axes["hinge"]):
        marker = HINGE_MARKERS[hinge]
        _plot_hinges(ax, model, lives[:, hinge], stresses[:, hinge], marker, f"{name}, {model}")


def _plot_hinges(
    ax: Axes, model: str, lives: Array, stresses: Array, marker: str, label: str
) -> None:
    """Draw hinges (n,) by a model, without those beyond the figure."""
    shown = lives < LONGEST_LIFE
    if np.any(shown):
        look = MODEL_LOOKS[model] | {"linestyle": "none", "marker": marker}
        ax.plot(lives[shown], stresses[shown], label=label, **look)
