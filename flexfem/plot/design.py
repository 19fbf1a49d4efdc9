"""A design drawn over its base stage, its margins with bands, the history of the search, and the front."""

from __future__ import annotations

import tomllib

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from flexfem.mechanism.stage import Stage
from flexfem.plot.stage import Outline, draw_outline, outline_of
from flexfem.plot.style import COLOURS, GREY, INK, in_house_style, new_axes, panels, wrapped
from flexfem.plot.text import significant
from flexfem.synthesis.result import Designed, Stated
from flexfem.units import LENGTH

WIDTH, HEIGHT, ROW = 11.0, 4.6, 0.42  # in
LABEL = 2.7  # in, of a requirement's name
LETTERS = 7.5  # points
MARKS = {"met": "o", "within the band": "s", "missed": "X"}


@in_house_style
def design_figure(found: Designed) -> Figure:
    """Draw the stage, the margins of its requirements, the history of the search and, of two objectives, the front."""
    state = "every requirement is met" if found.feasible else "not every requirement is met"
    counted = ", ".join(f"{n:,} by {name}" for name, n in found.evaluations.items() if name != "drawn")
    lines = [
        "; ".join(f"{goal.label}: {_said(goal)}" for goal in found.objectives) + f"; {state}.",
        "; ".join(f"{name} {value:g}" for name, value in found.design.items()) + " (units of the stage file).",
        f"Evaluations: {counted}. Seed {found.seed}. Corrected model and finite elements differ by at most "
        f"{significant(found.rounds[-1].gap_percent, 2)} % of a quantity at this design.",
        *_of_front(found),
        *found.warnings,
    ]
    plane = bool(found.front) and len(found.objectives) == 2
    columns = 4 if plane else 3
    height = max(HEIGHT, ROW * len(found.requirements) + 1.6)
    width = WIDTH + 3.6 * (columns - 3)
    ratios = [1.05, 1.0, 1.0, 1.0][:columns]
    doubts = (found.assumed, found.not_stated)
    figure, axes = panels((width, height), found.name, lines, 1, columns, doubts, width_ratios=ratios)
    plot_designed(axes[0], found)
    plot_margins(axes[1], found)
    plot_history(axes[2], found)
    if plane:
        plot_tradeoff(axes[3], found)
    titles = (
        "designed stage",
        "margins of the requirements",
        "first search, by the model",
        "front, by finite elements",
    )
    for letter, ax, title in zip("abcd", axes, titles, strict=False):
        ax.set_title(f"({letter}) {title}", loc="left")
    return figure


def _of_front(found: Designed) -> list[str]:
    """Which design of its front it is, and why the model and finite elements part along it."""
    best = f"The design is the best in {found.objectives[0].label} alone, an end of the front"
    corrected = "the model is corrected at the design and differs from finite elements along the front."
    return [f"{best}; {corrected}"] if found.front else []


def _said(of: Stated) -> str:
    band = "" if of.band is None else f" ± {significant(of.band, 2)}"
    if of.push_spread is not None:
        band += f" (mesh) ± {significant(of.push_spread, 2)} (spread of the pushes)"
    by = ", exact" if of.checked_by == "exact" else f" by {of.checked_by}"
    return f"{significant(of.shown(of.value), 5)}{band} {of.unit}".rstrip() + by


def outline_in(found: Designed) -> Outline:
    """The outline of the stage of a design."""
    return outline_of(Stage.model_validate(tomllib.loads(found.stage)))


def plot_designed(ax: Axes, found: Designed) -> Axes:
    """Draw the stage to scale, in mm; returns `ax`."""
    outline = outline_in(found)
    draw_outline(ax, outline)
    every = np.vstack(outline.bodies)
    low, high = every.min(axis=0), every.max(axis=0)
    room = 0.03 * (high - low)
    ax.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]), aspect="equal")
    ax.set_xlabel(f"x ({LENGTH})")
    ax.set_ylabel(f"y ({LENGTH})")
    return ax


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
        price = "" if each.price_percent is None else f"; 1 % more costs {significant(each.price_percent, 2)} %"
        said = wrapped(f"{each.label}: {each.verdict}{price}", LABEL, LETTERS)
        ax.annotate(said, (0.02, place + 0.12), xycoords=("axes fraction", "data"), size=LETTERS, va="bottom",
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
    """Draw the front of two objectives, the design itself marked; returns `ax`, or new axes."""
    ax = new_axes() if ax is None else ax
    values = np.array([one.values for one in found.front]).reshape(-1, 2)
    ax.plot(*values.T, "o-", color=COLOURS[0], label="by finite elements")
    ax.plot(*np.array([one.predicted for one in found.front]).T, "+", color=INK, markersize=9, label="corrected model")
    ax.plot(*(goal.value for goal in found.objectives), "o", color="none", markeredgecolor=INK, markersize=13,
            label="the design")  # fmt: skip
    first, second = found.objectives
    ax.set_xlabel(wrapped(first.sought, 3.0, 9.5))
    ax.set_ylabel(wrapped(second.sought, 3.2, 9.5))
    ax.grid()
    ax.legend(loc="best", framealpha=1.0, edgecolor="none")
    return ax
