"""A design: its stage, margins with bands, the history of the search, sensitivities, and the front."""

from __future__ import annotations

import tomllib

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from flexfem.design.result import Designed, FrontDesign, Goal, Requirement
from flexfem.files.refusals import shown
from flexfem.mechanism.stage import Stage
from flexfem.plot.stage import Outline, draw_outline, outline_of
from flexfem.plot.style import COLOURS, GREY, INK, in_house_style, new_axes, panels, wrapped
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.units import LENGTH

WIDTH, HEIGHT, ROW = 11.0, 4.6, 0.42  # in
LABEL = 2.7  # in, of a requirement's name
LETTERS = 7.5  # points
MARKS = {"met": "o", "within the band": "s", "missed": "X"}
ACROSS = 4  # panels beside each other
BAR_WIDTH, NAMES, BAR = 2.9, 2.2, 0.34  # in, of a panel of sensitivities, of the dimensions' names, of a bar
BESIDE = 1.55  # of the longest bar, for its number
SENSITIVITY = (
    "Change of each quantity in per cent for 1 % more of one dimension, the others kept: logarithmic derivatives of "
    "the corrected model at the design, by central differences, or one-sided ones where only one side can be made; "
    "steps that can be made are left aside."
)
FRONT = "Designs that no other beats in both objectives, by finite elements; each is a stage file, by its number."
CELL = 2.75  # in, of a panel of the front


@in_house_style
def design_figure(found: Designed) -> Figure:
    """Draw the stage, the margins of its requirements, the history of the search and, of two objectives, the front."""
    state = "every requirement is met" if found.feasible else "not every requirement is met"
    counted = ", ".join(f"{n:,} by {name}" for name, n in found.evaluations.items() if name != "drawn")
    lines = [
        "; ".join(f"{goal.label}: {goal.said()}, {goal.checked_by}" for goal in found.objectives) + f"; {state}.",
        "; ".join(f"{name} {value:g}" for name, value in found.design.items()) + " (units of the stage file).",
        f"Evaluations: {counted}. Seed {found.seed}. Corrected model and finite elements differ by at most "
        f"{significant(found.rounds[-1].gap_percent, 2)} % of a quantity at this design.",
        *found.warnings,
    ]
    if found.front:
        lines.insert(3, f"The design is the best in {found.objectives[0].label} alone, an end of the front; the model "
                     "is corrected at the design and differs from finite elements along the front.")  # fmt: skip
    columns = 4 if found.front else 3
    size = WIDTH + 3.6 * (columns - 3), max(HEIGHT, ROW * len(found.requirements) + 1.6)
    doubts = (found.assumed, found.not_stated)
    ratios = [1.05, 1.0, 1.0, 1.0][:columns]
    figure, axes = panels(size, found.name, lines, 1, columns, doubts, width_ratios=ratios)
    outline = _outline(found.stage)
    _draw_outlines([axes[0]], [outline])
    axes[0].set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    plot_margins(axes[1], found)
    plot_history(axes[2], found)
    if found.front:
        plot_tradeoff(axes[3], found)
    titles = "designed stage", "margins of the requirements", "first search, by the model", "front"
    for letter, ax, title in zip("abcd", axes, titles, strict=False):
        ax.set_title(f"({letter}) {title}", loc="left")
    return figure


def _outline(stage: str) -> Outline:
    return outline_of(Stage.model_validate(tomllib.loads(stage)))


def _draw_outlines(axes: list[Axes], outlines: list[Outline]) -> None:
    """Draw stages, each in axes of its own, to one scale."""
    every = np.vstack([body for outline in outlines for body in outline.bodies])
    low, high = every.min(axis=0), every.max(axis=0)
    room = 0.03 * (high - low)
    for ax, outline in zip(axes, outlines, strict=True):
        draw_outline(ax, outline)
        ax.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]), aspect="equal")


def plot_margins(ax: Axes | None, found: Designed) -> Axes:
    """Draw the margin of every requirement, in per cent of its end, with the band; returns `ax`, or new axes."""
    ax = new_axes() if ax is None else ax
    places = np.arange(len(found.requirements))[::-1]
    ax.axvline(0.0, color=INK, linewidth=1.2)
    for place, each in zip(places, found.requirements, strict=True):
        colour = COLOURS[1] if each.verdict == "missed" else COLOURS[0]
        ax.plot([0, each.margin_percent], [place, place], color=colour, linewidth=4, alpha=0.45, solid_capstyle="butt")
        ax.errorbar(
            each.margin_percent, place, xerr=each.band_percent or 0.0, fmt=MARKS[each.verdict], color=colour, capsize=4,
            markersize=6, markerfacecolor=colour if each.checked_by.startswith("finite") else "white",
        )  # fmt: skip
        limits = ", limits the objective" if each.active else ""
        text = wrapped(f"{each.label}: {each.verdict}{limits}", LABEL, LETTERS)
        ax.annotate(text, (0.02, place + 0.12), xycoords=("axes fraction", "data"), size=LETTERS, va="bottom",
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    ax.set_yticks([])
    reach = max([1.0, *(abs(each.margin_percent) for each in found.requirements)])
    ax.set_xscale("symlog", linthresh=1.0)
    lowest = min([0.0, *(each.margin_percent for each in found.requirements)])
    ax.set(xlim=(2.0 * lowest - 1.0, 2.0 * reach), ylim=(-0.5, max(len(places) - 0.2, 0.8)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("margin over the end that is wanted (%);\nlinear to 1 %; bars: band; hollow: model alone")
    ax.grid(axis="x")
    return ax


def plot_history(ax: Axes | None, found: Designed) -> Axes:
    """Draw the best objective, or what is missed before one is found, over evaluations; returns `ax`, or new axes."""
    ax = new_axes() if ax is None else ax
    ends = [(step.evaluations, step.objective) for step in found.history if step.objective is not None]
    goal = found.objectives[0]
    if ends:
        rising = np.diff([value for _, value in ends]) * (1 if goal.better == "larger" else -1)
        label = "best that meets all" + (";\nsteps begin where it falls" if np.any(rising < 0) else "")
        ax.step(*np.array(ends, dtype=float).T, where="post", color=COLOURS[0], label=label)
        ax.plot(found.history[-1].evaluations, goal.value, "D", color=INK, label="finite elements, in the end")
        ax.set_ylabel(wrapped(goal.headed(), 3.2, 9.0))
        early = [step.evaluations for step in found.history if step.objective is None]
        if early:
            ax.axvspan(0, max(early), color=GREY, alpha=0.25, linewidth=0, label="none meets all yet")
        ax.legend(loc="center right", framealpha=1.0, edgecolor="none")
    else:
        missed = [(step.evaluations, 100 * step.missed) for step in found.history]
        ax.step(*np.array(missed).T, where="post", color=COLOURS[1])
        ax.set_ylabel("missed in all, % of the ends")
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_xlabel("evaluations of the analytic model")
    ax.grid()
    return ax


def plot_tradeoff(ax: Axes | None, found: Designed) -> Axes:
    """Draw both objectives of every design on the front, by its number, and the design itself; returns the axes."""
    ax = new_axes() if ax is None else ax
    values = np.array([one.values for one in found.front]).reshape(-1, 2)
    ax.plot(*values.T, color=COLOURS[0], linewidth=1.2, label="by finite elements")
    ax.plot(*np.array([one.predicted for one in found.front]).T, "+", color=INK, markersize=9, label="corrected model")
    for place, (at, one) in enumerate(zip(values, found.front, strict=True), 1):
        edge = INK if one.met else COLOURS[1]
        ax.plot(*at, "o", color="white", markeredgecolor=edge, markeredgewidth=1.1, markersize=12.5, zorder=4)
        ax.annotate(str(place), (at[0], at[1]), ha="center", va="center_baseline", size=8.5, weight="bold", zorder=5)
    ax.plot(*(goal.value for goal in found.objectives), "o", color="none", markeredgecolor=INK, markersize=17,
            label="the design")  # fmt: skip
    first, second = (f"{goal.headed()}, the {goal.better} the better" for goal in found.objectives)
    ax.set_xlabel(wrapped(first, 3.0, 9.5))
    ax.set_ylabel(wrapped(second, 3.2, 9.5))
    ax.margins(0.1)
    ax.grid()
    ax.legend(loc="best", framealpha=1.0, edgecolor="none")
    return ax


@in_house_style
def front_figure(found: Designed) -> Figure:
    """Draw the front, and every design on it to one scale."""
    rows = -(-(len(found.front) + 1) // ACROSS)
    size, doubts = (CELL * ACROSS, (CELL + 0.9) * rows), (found.assumed, found.not_stated)
    figure, axes = panels(size, f"{found.name}: front", [FRONT], rows, ACROSS, doubts)
    plot_tradeoff(axes[0], found)
    drawings = list(axes[1 : 1 + len(found.front)])
    _draw_outlines(drawings, [_outline(one.stage) for one in found.front])
    for place, (ax, one) in enumerate(zip(drawings, found.front, strict=True), 1):
        ax.set_title("\n".join([f"{place}:  {_objectives(found, one)[0]}", *_objectives(found, one)[1:]]),
                     loc="left", size=LETTERS)  # fmt: skip
        ax.set(xlabel="\n".join(f"{name} {value:.5g}" for name, value in one.design.items()), xticks=[], yticks=[])
        ax.xaxis.label.set_fontsize(LETTERS)
    for ax in axes[1 + len(found.front) :]:
        ax.remove()
    return figure


def _objectives(found: Designed, one: FrontDesign) -> list[str]:
    values = zip(found.objectives, one.values, strict=True)
    lines = [f"{goal.label} {significant(value, 4)} {goal.unit}".rstrip() for goal, value in values]
    return lines if one.met else [*lines, "a requirement is missed"]


@in_house_style
def sensitivity_figure(found: Designed) -> Figure:
    """Draw how objectives and active requirements follow each dimension."""
    quantities = found.decisive
    across = min(ACROSS, len(quantities))
    rows = -(-len(quantities) // across)
    size = (NAMES + BAR_WIDTH * across, rows * (BAR * len(found.design) + 1.15))
    doubts = (found.assumed, found.not_stated)
    figure, axes = panels(size, f"{found.name}: sensitivity to each dimension", [SENSITIVITY], rows, across, doubts)
    known = [abs(row[each.name] or 0.0) for row in found.sensitivities.values() for each in quantities]
    reach = BESIDE * max(known, default=0.0) or 1.0
    for place, (ax, each) in enumerate(zip(axes, quantities, strict=False)):
        plot_sensitivity(ax, found, each.name)
        ends = [f"the {each.better} the better"] if isinstance(each, Goal) else []
        ends += [f"{each.wanted} {each.unit}".rstrip()] if isinstance(each, Requirement) else []
        ax.set(xlim=(-reach, reach))
        ax.set_title(wrapped(", ".join([each.label, *ends]), BAR_WIDTH - 0.2, 9.5), loc="left", size=9.5)
        if place % across:
            ax.set_yticklabels([])
    for ax in axes[len(quantities) :]:
        ax.remove()
    return figure


def plot_sensitivity(ax: Axes | None, found: Designed, name: str | None = None) -> Axes:
    """Draw by how many per cent a quantity changes for 1 % of each dimension; returns `ax`, or new axes.

    Parameters
    ----------
    name : str, optional
        Of the quantity as the requirements file has it, by default the first objective.

    Raises
    ------
    BadInput
        The design has no such quantity.
    """
    every = [each.name for each in (*found.objectives, *found.requirements)]
    name = every[0] if name is None else name
    if name not in every:
        raise BadInput(f"quantity {shown(name)}, expected one of {', '.join(every)}")
    ax = new_axes() if ax is None else ax
    values = [found.sensitivities[dimension][name] for dimension in found.design]
    places = np.arange(len(values))
    lengths = np.array([value or 0.0 for value in values])
    ax.barh(places, lengths, height=0.62, color=COLOURS[0])
    reach = BESIDE * float(np.max(np.abs(lengths), initial=0.0)) or 1.0
    for place, value in zip(places, values, strict=True):
        text = "not known" if value is None else ("+" if value > 0 else "") + significant(value, 2)
        left = (value or 0.0) < 0
        ax.annotate(
            text, (value or 0.0, place), xytext=(-4 if left else 4, 0), textcoords="offset points",
            ha="right" if left else "left", va="center", size=8.5, color=INK,
        )  # fmt: skip
    ax.set_yticks(places, [wrapped(key, NAMES - 0.2, 8.5) for key in found.design], size=8.5)
    ax.set_ylim(len(values) - 0.5, -0.5)
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.set(xlim=(-reach, reach), xlabel="change (%) for 1 %")
    ax.set_axisbelow(True)
    ax.grid(axis="x")
    return ax
