"""Figures of a design: stage, margins with bands, history of the search, sensitivities, and the
Pareto front.
"""

from __future__ import annotations

import tomllib
from functools import partial
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from flexfem.design.result import SOURCES, Designed, Goal, Requirement
from flexfem.files.refusals import shown
from flexfem.mechanism.loading import mechanism_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.plot import style
from flexfem.plot.drawing import fit, label_axes
from flexfem.plot.front import front_page
from flexfem.plot.plate import draw_plate
from flexfem.plot.style import COLOURS, INK, new_axes, panels, titled, wrapped
from flexfem.plot.text import percent, significant
from flexfem.refused import BadInput
from flexfem.study.records import Caption

LABEL_WIDTH = 1.5
FONT_SIZE = 8.5  # of a requirement's name: in, points
MARKS = {"met": "o", "within the band": "s", "missed": "X"}
COLUMNS = 4  # panels per row
SENSITIVITY_NOTE = (
    "Change of each quantity when one dimension increases by 1 %: derivatives of the corrected "
    "model at the design. Dimensions are not rounded to workshop steps."
)
FRONT_NOTE = (
    "By finite elements, no design is better in both objectives than one of these. The chosen "
    "design is the best in the first objective; the model is corrected at this design only."
)


@style.in_house_style
def design_figure(found: Designed) -> Figure:
    """Draw the stage, the margins of its requirements, the history of the search and, for two
    objectives, the front.
    """
    state = "every requirement is met" if found.feasible else "not every requirement is met"
    lines = [
        "; ".join(f"{goal.label}: {goal.formatted()}, {goal.source}" for goal in found.objectives)
        + f"; {state}.",
        "; ".join(
            f"{name} {x:g} {found.units.get(name, '')}".rstrip() for name, x in found.design.items()
        )
        + ".",
        "Corrected model and finite elements differ by at most "
        f"{percent(found.rounds[-1].gap_percent)} in any quantity at this design.",
        *(f"Warning: {warning}." for warning in found.warnings),
    ]
    layout = ((10.6, 8.2), 2, 2) if found.front else ((14.0, 4.9), 1, 3)
    figure, axes = panels(layout[0], found.name, lines, *layout[1:], found)
    fit(axes[0], draw_plate(axes[0], _drawn(found.stage)))
    label_axes(axes[0])
    titled(axes[0], "a", f"designed {found.kind}")
    titled(plot_margins(axes[1], found), "b", "requirements")
    titled(plot_history(axes[2], found), "c", "search with the analytic model")
    if found.front:
        titled(plot_tradeoff(axes[3], found), "d", "best designs in both objectives")
    return figure


def _drawn(text: str) -> Mechanism:
    """Return the mechanism that the text of a file describes."""
    return mechanism_of(tomllib.loads(text))


def plot_margins(ax: Axes | None, found: Designed) -> Axes:
    """Draw the margin of every requirement, in per cent of its limit, with its band; return `ax`,
    or new axes.
    """
    ax = new_axes() if ax is None else ax
    margins = [requirement.margin_percent for requirement in found.requirements]
    names = []
    hollow = False
    for row, (margin, requirement) in enumerate(zip(margins, found.requirements, strict=True)):
        colour = COLOURS[1] if requirement.verdict == "missed" else COLOURS[0]
        solid = requirement.checked_by != "analytic model alone"
        hollow |= not solid
        ax.plot(
            [0, margin], [row, row], color=colour, linewidth=4, alpha=0.45, solid_capstyle="butt"
        )
        ax.errorbar(
            margin,
            row,
            xerr=requirement.band_percent or 0.0,
            fmt=MARKS[requirement.verdict],
            color=colour,
            capsize=4,
            markersize=6,
            markerfacecolor=colour if solid else "white",
        )
        active = ", limits the objective" if requirement.active else ""
        limits = f"{requirement.limits} {requirement.unit}".rstrip()
        names.append(f"{requirement.label}, {limits}: {requirement.verdict}{active}")
    ax.set_xscale("symlog", linthresh=1.0)
    style.name_rows(ax, names, LABEL_WIDTH, FONT_SIZE)
    ax.set_xlim(2.0 * min([0.0, *margins]) - 1.0, 2.0 * max([1.0, *map(abs, margins)]))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel(
        "margin to limit (%); bars: uncertainty"
        + "\nhollow: analytic model, not checked by finite elements" * hollow
    )
    return ax


def plot_history(ax: Axes | None, found: Designed) -> Axes:
    """Draw the best objective over evaluations, or the violation if no design is feasible; return
    `ax`, or new axes.
    """
    ax = new_axes() if ax is None else ax
    goal = found.objectives[0]
    best = [
        (step.evaluations, step.objective) for step in found.history if step.objective is not None
    ]
    if best:
        met = "best design that meets all requirements"
        final = f"final design, {SOURCES[goal.checked_by]}"
        ax.step(
            *np.array(best, dtype=float).T,
            where="post",
            color=COLOURS[0],
            label=met,
        )
        ax.plot(found.history[-1].evaluations, goal.value, "D", color=INK, label=final)
        ax.set_ylabel(wrapped(goal.label_with_unit(), 3.2, 9.0))
        sign, word = (1.0, "drop") if goal.better == "larger" else (-1.0, "rise")
        for (_, before), (count, after) in pairwise(best):
            if sign * after < sign * before:
                at = (count, (before + after) / 2)
                text = f"{word}: rounding to\nworkshop steps"
                arrow = {"arrowstyle": "-|>", "color": INK}
                place = (-30, -18 * sign)
                ax.annotate(
                    text,
                    at,
                    place,
                    textcoords="offset points",
                    ha="right",
                    va="center",
                    arrowprops=arrow,
                )
        ax.legend(
            loc="best",
            framealpha=0.8,
            edgecolor="none",
        )
    else:
        missed = [(step.evaluations, 100 * step.missed) for step in found.history]
        ax.step(*np.array(missed).T, where="post", color=COLOURS[1])
        ax.set_ylabel("total violation, % of the limits")
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_xlabel("evaluations of the analytic model")
    ax.grid()
    return ax


def plot_tradeoff(ax: Axes | None, found: Designed) -> Axes:
    """Draw both objectives of every numbered design on the front, and of the chosen design; return
    `ax`, or new axes.

    Raises BadInput for a design without a front.
    """
    if not found.front:
        raise BadInput(
            f"{found.file}: a design without a front, expected two objectives and all "
            "requirements met"
        )
    ax = new_axes() if ax is None else ax
    values, predicted = np.array(
        [(point.values, point.predicted) for point in found.front]
    ).swapaxes(0, 1)
    ax.plot(
        *values.T,
        color=COLOURS[0],
        linewidth=1.2,
        label="by finite elements",
    )
    ax.plot(
        *predicted.T,
        "+",
        color=INK,
        markersize=9,
        label="corrected model",
    )
    for number, (value, point) in enumerate(zip(values, found.front, strict=True), 1):
        style.ring(ax, value, str(number), INK if point.met else COLOURS[1])
    ax.plot(
        *(goal.value for goal in found.objectives),
        "o",
        color="none",
        markeredgecolor=INK,
        markersize=17,
        label="chosen design",
    )
    first, second = (
        f"{goal.label_with_unit()}, {goal.better} is better" for goal in found.objectives
    )
    ax.set(xlabel=wrapped(first, 3.0, 9.5), ylabel=wrapped(second, 3.2, 9.5))
    ax.margins(0.1)
    ax.grid()
    ax.legend(
        loc="best",
        framealpha=1.0,
        edgecolor="none",
    )
    return ax


@style.in_house_style
def front_figure(found: Designed) -> Figure:
    """Draw the front, every design on it to one scale, and a table of their numbers."""
    sizes = [
        f"{name} ({found.units[name]})" if found.units.get(name) else name for name in found.design
    ]
    rows = [["design", *(goal.label_with_unit() for goal in found.objectives), *sizes]]
    for number, point in enumerate(found.front, 1):
        values = [
            *(significant(x, 4) for x in point.values),
            *(f"{x:.5g}" for x in point.design.values()),
        ]
        rows.append([f"{number}" if point.met else f"{number}, missed", *values])
    caption = Caption(f"{found.name}: best designs", [FRONT_NOTE], found.assumed, found.not_stated)
    return front_page(
        caption,
        partial(plot_tradeoff, found=found),
        [_drawn(each.stage) for each in found.front],
        rows,
    )


@style.in_house_style
def sensitivity_figure(found: Designed) -> Figure:
    """Draw the sensitivity of objectives and active requirements to each dimension."""
    quantities = found.decisive
    title = f"{found.name}: sensitivity to each dimension"
    columns = min(COLUMNS, len(quantities))
    rows = -(-len(quantities) // columns)
    size = (2.2 + 2.9 * columns, rows * (0.34 * len(found.design) + 1.15))
    figure, axes = panels(size, title, [SENSITIVITY_NOTE], rows, columns, found, len(quantities))
    for k, (ax, quantity) in enumerate(zip(axes, quantities, strict=True)):
        plot_sensitivity(ax, found, quantity.name)
        target = [f"{quantity.better} is better"] if isinstance(quantity, Goal) else []
        target += (
            [f"{quantity.limits} {quantity.unit}".rstrip()]
            if isinstance(quantity, Requirement)
            else []
        )
        ax.set_title(wrapped(", ".join([quantity.label, *target]), 2.7, 9.5), loc="left", size=9.5)
        if k % columns:
            ax.set_yticklabels([])
    style.share_x(axes)
    return figure


def plot_sensitivity(
    ax: Axes | None,
    found: Designed,
    name: str | None = None,
) -> Axes:
    """Draw the change of a quantity, in per cent, for 1 % of each dimension; return `ax`, or new
    axes.

    `name` : name of the quantity in the requirements file; default: the first objective. Raises
    BadInput when the design has no such quantity."""
    known = [quantity.name for quantity in (*found.objectives, *found.requirements)]
    name = known[0] if name is None else name
    if name not in known:
        raise BadInput(f"quantity {shown(name)}, expected one of {', '.join(known)}")
    ax = new_axes() if ax is None else ax
    values = [found.sensitivities[dimension][name] for dimension in found.design]
    lengths = np.array([value or 0.0 for value in values])
    bars = ax.barh(np.arange(len(values)), lengths, height=0.62, color=COLOURS[0])
    texts = [
        "not known" if x is None else ("+" if x > 0 else "") + significant(x, 2) for x in values
    ]
    ax.bar_label(
        bars,
        texts,
        padding=4,
        size=8.5,
        color=INK,
    )
    style.name_rows(ax, list(found.design), 2.0)
    reach = 1.55 * float(np.max(np.abs(lengths), initial=0.0)) or 1.0  # with room for the numbers
    ax.set(xlim=(-reach, reach), xlabel="change (%) per 1 %")
    return ax
