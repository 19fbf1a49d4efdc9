"""Figures of a design: stage, margins with bands, history of the search, sensitivities, and the Pareto front."""

from __future__ import annotations

import tomllib

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from flexfem.arrays import Array
from flexfem.design.result import Designed, FrontDesign, Goal, Requirement
from flexfem.files.refusals import shown
from flexfem.files.toml import kind_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.plot import style
from flexfem.plot.plate import draw_plate
from flexfem.plot.stage import draw_outline, fit, fit_to_one_scale, label_axes
from flexfem.plot.style import COLOURS, INK, new_axes, panels, titled, wrapped
from flexfem.plot.text import significant
from flexfem.refused import BadInput

LABEL_WIDTH, FONT_SIZE = 2.7, 7.5  # of a requirement's name: in, points
MARKS = {"met": "o", "within the band": "s", "missed": "X"}
COLUMNS, CELL_WIDTH = 4, 2.75  # panels per row; width of a panel, in
SENSITIVITY_NOTE = (
    "Change of each quantity (%) when one dimension increases by 1 %: logarithmic derivatives of the corrected model "
    "at the design, by central differences, one-sided where only one side can be made. Dimensions are not rounded to "
    "their steps."
)
FRONT_NOTE = (
    "Designs that no other design improves in both objectives, by finite elements; each number is a file. The "
    "chosen design is the best in the first objective; the model is corrected at this design only."
)


@style.in_house_style
def design_figure(found: Designed) -> Figure:
    """Draw the stage, the margins of its requirements, the history of the search and, for two objectives, the front."""
    state = "every requirement is met" if found.feasible else "not every requirement is met"
    evaluations = ", ".join(f"{n:,} by {name}" for name, n in found.evaluations.items() if name != "drawn")
    lines = [
        "; ".join(f"{goal.label}: {goal.formatted()}, {goal.checked_by}" for goal in found.objectives) + f"; {state}.",
        "; ".join(f"{name} {value:g}" for name, value in found.design.items()) + f" (units of the {found.kind} file).",
        f"Evaluations: {evaluations}. Seed {found.seed}. Corrected model and finite elements differ by at most "
        f"{significant(found.rounds[-1].gap_percent, 2)} % in any quantity at this design.",
        *found.warnings,
    ]
    columns = 4 if found.front else 3
    size = 3.6 * columns + 0.2, max(4.6, 0.42 * len(found.requirements) + 1.6)
    figure, axes = panels(size, found.name, lines, 1, columns, found)
    fit(axes[0], _draw(axes[0], found.stage))
    label_axes(axes[0])
    titled(axes[0], "a", f"designed {found.kind}")
    titled(plot_margins(axes[1], found), "b", "margins of the requirements")
    titled(plot_history(axes[2], found), "c", "first search, by the analytic model")
    if found.front:
        titled(plot_tradeoff(axes[3], found), "d", "front")
    return figure


def _draw(ax: Axes, text: str) -> Array:
    """Draw the plate of a file; return points (n, 2) of its outline, mm."""
    content = tomllib.loads(text)
    if kind_of(content) == Mechanism.kind:
        return draw_plate(ax, Mechanism.model_validate(content))
    return draw_outline(ax, Stage.model_validate(content))


def plot_margins(ax: Axes | None, found: Designed) -> Axes:
    """Draw the margin of every requirement, in per cent of its limit, with its band; return `ax`, or new axes."""
    ax, last = new_axes() if ax is None else ax, len(found.requirements) - 1
    margins = [requirement.margin_percent for requirement in found.requirements]
    ax.axvline(0.0, color=INK, linewidth=1.2)
    for k, (margin, requirement) in enumerate(zip(margins, found.requirements, strict=True)):
        row, colour = last - k, COLOURS[1] if requirement.verdict == "missed" else COLOURS[0]
        ax.plot([0, margin], [row, row], color=colour, linewidth=4, alpha=0.45, solid_capstyle="butt")
        ax.errorbar(
            margin, row, xerr=requirement.band_percent or 0.0, fmt=MARKS[requirement.verdict], color=colour, capsize=4,
            markersize=6, markerfacecolor=colour if requirement.checked_by.startswith("finite") else "white",
        )  # fmt: skip
        active = ", limits the objective" if requirement.active else ""
        text = wrapped(f"{requirement.label}: {requirement.verdict}{active}", LABEL_WIDTH, FONT_SIZE)
        ax.annotate(text, (0.02, row + 0.12), xycoords=("axes fraction", "data"), size=FONT_SIZE, va="bottom",
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    ax.set_xscale("symlog", linthresh=1.0)
    limits = 2.0 * min([0.0, *margins]) - 1.0, 2.0 * max([1.0, *map(abs, margins)])
    ax.set(xlim=limits, ylim=(-0.5, max(last + 0.8, 0.8)), yticks=[])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("margin to the limit (%), linear scale below 1 %;\nbars: uncertainty; hollow: analytic model")
    ax.grid(axis="x")
    return ax


def plot_history(ax: Axes | None, found: Designed) -> Axes:
    """Draw the best objective over evaluations, or the violation if no design is feasible; return `ax`, or new axes."""
    ax, goal = new_axes() if ax is None else ax, found.objectives[0]
    best = [(step.evaluations, step.objective) for step in found.history if step.objective is not None]
    if best:
        ax.step(*np.array(best, dtype=float).T, where="post", color=COLOURS[0], label="best feasible design")
        ax.plot(found.history[-1].evaluations, goal.value, "D", color=INK, label="final design, finite elements")
        ax.set_ylabel(wrapped(goal.label_with_unit(), 3.2, 9.0))
        ax.legend(framealpha=0.8, edgecolor="none")
    else:
        missed = [(step.evaluations, 100 * step.missed) for step in found.history]
        ax.step(*np.array(missed).T, where="post", color=COLOURS[1])
        ax.set_ylabel("total violation, % of the limits")
    ax.xaxis.set_major_locator(MaxNLocator(5))
    ax.set_xlabel("evaluations of the analytic model")
    ax.grid()
    return ax


def plot_tradeoff(ax: Axes | None, found: Designed) -> Axes:
    """Draw both objectives of every numbered design on the front, and of the chosen design; return `ax`, or new axes.

    Raises BadInput for a design without a front.
    """
    if not found.front:
        raise BadInput(f"{found.file}: a design without a front, expected two objectives and all requirements met")
    ax = new_axes() if ax is None else ax
    values, predicted = np.array([(point.values, point.predicted) for point in found.front]).swapaxes(0, 1)
    ax.plot(*values.T, color=COLOURS[0], linewidth=1.2, label="by finite elements")
    ax.plot(*predicted.T, "+", color=INK, markersize=9, label="corrected model")
    for number, (value, point) in enumerate(zip(values, found.front, strict=True), 1):
        style.ring(ax, value, str(number), INK if point.met else COLOURS[1])
    ax.plot(*(goal.value for goal in found.objectives), "o", color="none", markeredgecolor=INK, markersize=17,
            label="chosen design")  # fmt: skip
    first, second = (f"{goal.label_with_unit()}, {goal.better} is better" for goal in found.objectives)
    ax.set(xlabel=wrapped(first, 3.0, 9.5), ylabel=wrapped(second, 3.2, 9.5))
    ax.margins(0.1)
    ax.grid()
    ax.legend(loc="best", framealpha=1.0, edgecolor="none")
    return ax


@style.in_house_style
def front_figure(found: Designed) -> Figure:
    """Draw the front and, to one scale, every design on it."""
    count = len(found.front) + 1
    rows = -(-count // COLUMNS)
    size, title = (CELL_WIDTH * COLUMNS, (CELL_WIDTH + 0.9) * rows), f"{found.name}: front"
    figure, (plane, *drawings) = panels(size, title, [FRONT_NOTE], rows, COLUMNS, found, count)
    plot_tradeoff(plane, found)
    outlines = [_draw(ax, point.stage) for ax, point in zip(drawings, found.front, strict=True)]
    fit_to_one_scale(drawings, np.vstack(outlines))
    for number, (ax, point) in enumerate(zip(drawings, found.front, strict=True), 1):
        ax.set_title(f"{number}:  {_objectives(found, point)}", loc="left", size=FONT_SIZE)
        ax.set(xticks=[], yticks=[])
        ax.set_xlabel("\n".join(f"{name} {value:.5g}" for name, value in point.design.items()), size=FONT_SIZE)
    return figure


def _objectives(found: Designed, point: FrontDesign) -> str:
    values = zip(found.objectives, point.values, strict=True)
    lines = [f"{goal.label} {significant(value, 4)} {goal.unit}".rstrip() for goal, value in values]
    return "\n".join(lines if point.met else [*lines, "a requirement is not met"])


@style.in_house_style
def sensitivity_figure(found: Designed) -> Figure:
    """Draw the sensitivity of objectives and active requirements to each dimension."""
    quantities, title = found.decisive, f"{found.name}: sensitivity to each dimension"
    columns = min(COLUMNS, len(quantities))
    rows = -(-len(quantities) // columns)
    size = (2.2 + 2.9 * columns, rows * (0.34 * len(found.design) + 1.15))
    figure, axes = panels(size, title, [SENSITIVITY_NOTE], rows, columns, found, len(quantities))
    for k, (ax, quantity) in enumerate(zip(axes, quantities, strict=True)):
        plot_sensitivity(ax, found, quantity.name)
        target = [f"{quantity.better} is better"] if isinstance(quantity, Goal) else []
        target += [f"{quantity.limits} {quantity.unit}".rstrip()] if isinstance(quantity, Requirement) else []
        ax.set_title(wrapped(", ".join([quantity.label, *target]), 2.7, 9.5), loc="left", size=9.5)
        if k % columns:
            ax.set_yticklabels([])
    style.share_x(axes)
    return figure


def plot_sensitivity(ax: Axes | None, found: Designed, name: str | None = None) -> Axes:
    """Draw the change of a quantity, in per cent, for 1 % of each dimension; return `ax`, or new axes.

    `name` : name of the quantity in the requirements file; default: the first objective. Raises BadInput when the
    design has no such quantity.
    """
    known = [quantity.name for quantity in (*found.objectives, *found.requirements)]
    name = known[0] if name is None else name
    if name not in known:
        raise BadInput(f"quantity {shown(name)}, expected one of {', '.join(known)}")
    ax = new_axes() if ax is None else ax
    values = [found.sensitivities[dimension][name] for dimension in found.design]
    lengths = np.array([value or 0.0 for value in values])
    bars = ax.barh(np.arange(len(values)), lengths, height=0.62, color=COLOURS[0])
    texts = ["not known" if x is None else ("+" if x > 0 else "") + significant(x, 2) for x in values]
    ax.bar_label(bars, texts, padding=4, size=8.5, color=INK)
    style.name_rows(ax, list(found.design), 2.0)
    reach = 1.55 * float(np.max(np.abs(lengths), initial=0.0)) or 1.0  # with room for the numbers
    ax.set(xlim=(-reach, reach), xlabel="change (%) per 1 %")
    return ax
