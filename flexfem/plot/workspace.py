"""What large displacements do over the workspace, and what the second-order terms of (16) are worth."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.curves import COLOURS, NAMES, ROUND_OFF
from flexfem.plot.style import GREY, INK, in_house_style, panels
from flexfem.plot.text import scientific
from flexfem.units import COMMANDS, DIRECTIONS, Direction, Unit, unit_for
from flexfem.verify.workspace import Travel, Workspace

WIDTH, HEIGHT = 11.69, 8.5  # in
COLUMNS = ("tangent stiffness", "error of linear theory along", "error of linear theory across")
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "without": ("(16) without its second-order terms", {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.9}),
    "tangent": ("(16)", {"color": COLOURS[0], "linewidth": 2.6}),
    "exact": (
        "exact equilibrium",
        {"color": INK, "linestyle": "none", "marker": ".", "markersize": 5.0, "markevery": 4},
    ),
}
ELEMENTS: Any = {"linestyle": "none", "markerfacecolor": "none", "markersize": 7.5, "markeredgewidth": 1.4, "zorder": 4}
HELD: Any = ELEMENTS | {"marker": "s", "color": COLOURS[2]}
LOADED: Any = ELEMENTS | {"marker": "v", "color": COLOURS[3]}
AT_POSE, UNDER_LOAD = "finite elements held at the command", "finite elements under the load of exact equilibrium"
HONEST = 1e-4  # per cent: half the axis of a panel that has nothing but round-off to show


@in_house_style
def workspace_figure(found: Workspace) -> Figure:
    """Draw tangent stiffness and errors of linear theory over the command, one row a direction.

    Notes
    -----
    Every model is shown against its own linear answer, so that all curves leave rest at zero.
    """
    title = f"{found.stage}: large displacements and the second-order terms of (16)"
    doubts = (found.assumed, found.not_stated)
    figure, every = panels((WIDTH, HEIGHT), title, _lines(found), 3, 3, doubts)
    kinds = [(direction, draw) for direction in DIRECTIONS for draw in (plot_tangents, plot_along, plot_across)]
    for index, (axes, (direction, draw)) in enumerate(zip(every, kinds, strict=True)):
        draw(axes, found, direction)
        axes.set_title(f"({'abcdefghi'[index]}) {NAMES[direction]}: {COLUMNS[index % 3]}", loc="left")
    shown = figure.axes[1].get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=3, frameon=False, fontsize=9.5, handlelength=3.6)
    return figure


def _lines(found: Workspace) -> list[str]:
    near, far = (" and ".join(_size(found, axis, point) for axis in ("x", "theta")) for point in (2, 3))
    return [
        f"Pseudo-rigid stage of mobility {found.mobility}, {found.formula}, and nonlinear finite elements "
        f"({found.unknowns} unknowns), each against its own linear answer: linear theory (18) is the line at zero. "
        "Errors are the linear position under the load that holds the stage at the command, minus the command; along "
        "it this is by how much the load deviates from (18). Rotations are made displacements by l₃.",
        f"Anywhere within {near} linear theory misses the position by up to "
        f"{found.small.position:.2f} %, within {far} by {found.box.position:.2f} %; "
        f"the two terms change the tangent compliance there by up to {found.small.terms:.2f} and "
        f"{found.box.terms:.2f} %.",
    ]


def _size(found: Workspace, axis: Direction, point: int) -> str:
    """The command of a point, to both sides."""
    unit = COMMANDS[DIRECTIONS.index(axis)]
    return f"±{unit.factor * abs(found.travel[axis].points[point].commanded):g} {unit}"


def plot_tangents(ax: Axes, found: Workspace, direction: Direction) -> Axes:
    """Draw the change of the tangent stiffness along the way in one direction, by every model; returns `ax`."""
    travel = found.travel[direction]
    unit = _frame(ax, travel, direction, "change from rest (%)")
    _draw_models(ax, travel, unit, {name: np.array(values) for name, values in travel.stiffness.items()})
    _draw_held(ax, travel, unit, travel.elements.stiffness)
    _say_worth(ax, [point.stiffness for point in travel.points])
    return ax


def plot_along(ax: Axes, found: Workspace, direction: Direction) -> Axes:
    """Draw the error of linear theory along the command, by every model; returns `ax`."""
    travel = found.travel[direction]
    unit, axis = _frame(ax, travel, direction, "error (% of the command)"), DIRECTIONS.index(direction)
    _draw_models(ax, travel, unit, {name: np.array(values)[:, axis] for name, values in travel.position.items()})
    _draw_held(ax, travel, unit, np.array(travel.elements.position)[:, axis])
    loads = unit.factor * np.array([point.commanded for point in travel.points])
    ax.plot(loads, np.array(travel.elements.loaded_position)[:, axis], label=UNDER_LOAD, **LOADED)
    _say_worth(ax, [point.position for point in travel.points])
    return ax


def plot_across(ax: Axes, found: Workspace, direction: Direction) -> Axes:
    """Draw the errors of linear theory across the command, by every model; returns `ax`."""
    travel = found.travel[direction]
    unit, axis = _frame(ax, travel, direction, "error (% of the command)"), DIRECTIONS.index(direction)
    largest, others = 0.0, [k for k in range(3) if k != axis]
    for other in others:
        curves = {name: np.array(values)[:, other] for name, values in travel.position.items()}
        largest = max(largest, float(np.max(np.abs(curves["exact"]))))
        _draw_models(ax, travel, unit, curves)
        _draw_held(ax, travel, unit, np.array(travel.elements.position)[:, other])
        if largest > ROUND_OFF:
            place = (unit.factor * travel.commanded[-1], curves["exact"][-1])
            name = "in " + NAMES[DIRECTIONS[other]]
            ax.annotate(name, place, (7, 0), textcoords="offset points", va="center", size=9.5)
            ax.set_xlim(right=1.4 * place[0])
    if largest < ROUND_OFF:
        _say_round_off(ax)
    return ax


def _frame(ax: Axes, travel: Travel, direction: Direction, label: str) -> Unit:
    """Labels, grid and the line of linear theory; returns the unit of the command."""
    unit = unit_for(direction, max(travel.commanded))
    ax.set(xlabel=f"commanded {NAMES[direction]} ({unit.name})", ylabel=label)
    ax.axhline(0.0, color=GREY, linewidth=1.1, zorder=1, label="linear theory, (18)")
    ax.grid()
    return unit


def _say_round_off(axes: Axes) -> None:
    axes.set_ylim(-HONEST, HONEST)
    axes.set_yticks([0.0])
    box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.7}
    place: Any = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.75, f"round-off only, axis ±{scientific(HONEST)} %", **place, size=10, bbox=box)


def _draw_models(axes: Axes, travel: Travel, unit: Unit, curves: dict[str, Array]) -> None:
    for name, (label, style) in MODELS.items():
        axes.plot(unit.factor * np.array(travel.commanded), curves[name], label=label, **style)


def _draw_held(axes: Axes, travel: Travel, unit: Unit, values: Array | list[float]) -> None:
    axes.plot(unit.factor * np.array(travel.elements.commanded), values, label=AT_POSE, **HELD)


def _say_worth(axes: Axes, points: list[dict[str, float]]) -> None:
    """What the terms are worth at both ends, in the corner that the curves leave free."""
    ends = [point["tangent"] - point["without"] for point in (points[0], points[-1])]
    text = "the two terms at the ends:\n" + ", ".join(f"{end:+.2f}" for end in ends)
    rising = ends[1] > ends[0]
    axes.text(
        0.96,
        0.06 if rising else 0.94,
        text.replace("-", "\N{MINUS SIGN}"),
        transform=axes.transAxes,
        ha="right",
        va="bottom" if rising else "top",
        color=INK,
        size=8.5,
    )
