"""The fatigue life of hinges: the S-N curve with the hinges of all models on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array, Index, is_largest
from flexfem.plot import style
from flexfem.plot.style import GREY, INK, MODEL_COLOURS, NAMES, PALE
from flexfem.plot.text import scientific, sentence, significant, typeset
from flexfem.questions.life import LEFT_OUT, Life
from flexfem.questions.setup import ELASTIC
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.units import MICROMETRE, STRESS

LONGEST_LIFE = 1e14  # cycles; necks with longer lives are counted, not drawn
REVERSAL = 0.5  # cycles; shorter lives are drawn at it
LEFT_EDGE = 1e2  # cycles
HINGE_MARKERS = ("s", "o", "^")  # by place in a chain
REQUIRED: dict[str, Any] = {"color": GREY, "linestyle": (0, (6, 2, 1, 2)), "linewidth": 1.1}
WIDTH = 7.0  # in
CURVE = 2.9  # in, height of the curve
ROW = 0.22  # in, height of a hinge
RIGHT_END = 0.985  # of the axes, where lives beyond them are
MOST_ROWS = 24  # hinges that are drawn one by one
MODEL_LOOKS: dict[str, dict[str, Any]] = {
    ANALYTIC: {
        "markerfacecolor": "none",
        "markeredgecolor": MODEL_COLOURS[ANALYTIC],
        "markeredgewidth": 1.4,
        "markersize": 9.0,
        "zorder": 4,
    },
    ELASTIC: {
        "markerfacecolor": "none",
        "markeredgecolor": MODEL_COLOURS[ELASTIC],
        "markersize": 6.5,
        "zorder": 3.5,
    },
    ELEMENTS: {"color": MODEL_COLOURS[ELEMENTS], "markersize": 5.5, "zorder": 3},
}


@style.in_house_style
def life_figure(found: Life) -> Figure:
    """Draw the S-N curve with the hinges of all models on it, and the life of every hinge below."""
    rows = len(_shortest(found))
    heights = [CURVE, ROW * rows + 0.3]
    size = (WIDTH, sum(heights) + 1.5)
    title = f"{found.about.name}: fatigue life of the hinges"
    figure, axes = style.panels(
        size,
        title,
        _header(found),
        2,
        assumptions=found.about,
        height_ratios=heights,
    )
    style.titled(plot_life(axes[0], found), "a", "law of fatigue, and the hinges on it")
    style.titled(plot_lives(axes[1], found), "b", _title_of_lives(found))
    axes[1].set_xlim(axes[0].get_xlim())
    axes[0].set_xlabel("")
    style.legend_below(figure, axes, 3)
    return figure


def _header(found: Life) -> list[str]:
    """Return the lines on material, motion and first hinges, and on the law."""
    settings = found.settings
    lives = list[str]()
    for model, life, stress in zip(found.axes["model"], found.life, found.equivalent, strict=True):
        cycles = "infinite life" if np.isinf(life) else f"{significant(life, 3)} cycles"
        first = _hinge_name(found, int(np.argmax(is_largest(stress))))
        lives.append(f"{model.capitalize()}: {cycles}, first at {first}")
    motion = f"amplitude {_motion(settings['amplitude'])}, {_mean(settings['about'])}"
    left_out = LEFT_OUT
    if "notch sensitivity" in settings:
        left_out += f"; notch sensitivity {settings['notch sensitivity']:g}"
    return [
        f"{settings['material']}; {motion}. {'. '.join(lives)}.",
        f"{typeset(found.notes[0])}. {sentence(left_out)}",
    ]


def _motion(text: str) -> str:
    """Return a pose with the names of its directions, without those that are zero."""
    parts = zip(NAMES.values(), text.replace(" um", f" {MICROMETRE}").split(", "), strict=True)
    moved = [f"{name} {part}" for name, part in parts if not part.startswith("0 ")]
    return typeset(", ".join(moved)) or "0"


def _mean(text: str) -> str:
    """Return about which pose the output moves."""
    mean = _motion(text)
    return "about rest" if mean == "0" else f"about {mean}"


def _hinge_name(found: Life, number: int) -> str:
    """Return the name of a hinge by its number, chain by chain where there are chains."""
    hinges = found.axes["hinge"]
    if "chain" not in found.axes:
        return f"hinge {hinges[number]}"
    chain, hinge = divmod(number, len(hinges))
    return f"the {hinges[hinge]} hinge of {found.axes['chain'][chain]}"


def _shortest(found: Life) -> Index:
    """Return the numbers of the hinges with the shortest lives by the last model, in this order."""
    last = np.ravel(found.cycles[-1])
    return np.argsort(last, kind="stable")[:MOST_ROWS]


def _title_of_lives(found: Life) -> str:
    """Return which hinges are drawn one by one."""
    count = found.cycles[-1].size
    shown = len(_shortest(found))
    return "life of every hinge" if shown == count else f"the {shown} shortest lives of {count}"


def plot_lives(ax: Axes, found: Life) -> Axes:
    """Draw the cycles to failure of every hinge, shortest lives first, by all models; return `ax`.

    Of very many hinges those with the shortest lives are drawn. Lives beyond the axes are arrows at
    their right end.
    """
    numbers = _shortest(found)
    label = "cycles to failure"
    rows = np.arange(len(numbers))
    for model, cycles in zip(found.axes["model"], found.cycles, strict=True):
        lives = np.ravel(cycles)[numbers]
        drawn = lives < LONGEST_LIFE
        # the curve has a label for every kind of hinge of a chain
        label_of_model = model if "chain" not in found.axes else None
        look = MODEL_LOOKS[model] | {"linestyle": "none", "label": label_of_model}
        ax.plot(np.maximum(lives[drawn], REVERSAL), rows[drawn], marker="o", **look)
        if not drawn.all():
            at_end = {"transform": ax.get_yaxis_transform(), "marker": ">", "label": None}
            ax.plot(np.full(np.sum(~drawn), RIGHT_END), rows[~drawn], **look | at_end)
            label = f"cycles to failure; arrows: beyond {scientific(LONGEST_LIFE)}"
    target = float(found.settings["wanted cycles"])
    ax.axvline(target, **REQUIRED)
    ax.set(xscale="log", xlabel=label)
    _power_ticks(ax)
    names = [_hinge_name(found, number) for number in numbers.tolist()]
    ax.set_yticks(
        range(len(names)), [name.removeprefix("the ").removeprefix("hinge ") for name in names]
    )
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(which="major")
    return ax


def _power_ticks(ax: Axes) -> None:
    """Label cycles as powers of ten."""
    ax.xaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))


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
    _power_ticks(ax)
    style.log_ticks(ax.yaxis, ax.get_ylim())
    ax.set_ylabel(f"equivalent fully reversed\nstress amplitude ({STRESS})")
    ax.grid(which="major")
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
    dotted: dict[str, Any] = {"color": INK, "linestyle": (0, (1, 1.5)), "linewidth": 1.6}
    ax.axhline(found.yield_strength, label="yield strength", **dotted)
    ax.axvline(target, label="required life", **REQUIRED)
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
        _plot_hinges(ax, model, lives, stresses, "o", model)
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
