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
from flexfem.questions.large import EXACT, HELD, LOADED, STATED, STEPS, TANGENT, WITHOUT, Large
from flexfem.units import COMMANDS, unit_for
from flexfem.verify.case import DIRECTIONS, Direction

WIDTH, HEIGHT = 11.69, 8.5  # in
COLUMNS = ("tangent stiffness", "error of linear theory along", "error of linear theory across")
MODELS: dict[int, tuple[str, dict[str, Any]]] = {
    WITHOUT: ("(16) without its second-order terms", {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.9}),
    TANGENT: ("(16)", {"color": COLOURS[0], "linewidth": 2.6}),
    EXACT: (
        "exact equilibrium",
        {"color": INK, "linestyle": "none", "marker": ".", "markersize": 5.0, "markevery": 4},
    ),
}
ELEMENTS: Any = {"linestyle": "none", "markerfacecolor": "none", "markersize": 7.5, "markeredgewidth": 1.4, "zorder": 4}
HELD_MARKS: Any = ELEMENTS | {"marker": "s", "color": COLOURS[2]}
LOADED_MARKS: Any = ELEMENTS | {"marker": "v", "color": COLOURS[3]}
AT_POSE, UNDER_LOAD = "finite elements held at the command", "finite elements under the load of exact equilibrium"
HONEST = 1e-4  # per cent: half the axis of a panel that has nothing but round-off to show


@in_house_style
def workspace_figure(found: Large) -> Figure:
    """Draw tangent stiffness and errors of linear theory over the command, one row a direction.

    Notes
    -----
    Every model is shown against its own linear answer, so that all curves leave rest at zero.
    """
    title = f"{found.about.name}: large displacements and the second-order terms of (16)"
    doubts = (found.about.assumed, found.about.not_stated)
    figure, every = panels((WIDTH, HEIGHT), title, _lines(found), 3, 3, doubts)
    kinds = [(direction, draw) for direction in DIRECTIONS for draw in (plot_tangents, plot_along, plot_across)]
    for index, (axes, (direction, draw)) in enumerate(zip(every, kinds, strict=True)):
        draw(axes, found, direction)
        axes.set_title(f"({'abcdefghi'[index]}) {NAMES[direction]}: {COLUMNS[index % 3]}", loc="left")
    shown = figure.axes[1].get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=3, frameon=False, fontsize=9.5, handlelength=3.6)
    return figure


def _lines(found: Large) -> list[str]:
    near, far = (" and ".join(_size(found, axis, share) for axis in ("x", "theta")) for share in (0.1, 1.0))
    mesh = f", and nonlinear finite elements ({found.settings['unknowns']} unknowns)" if _meshed(found) else ""
    return [
        f"Pseudo-rigid stage of mobility {found.settings['mobility']}, {found.settings['formula']}{mesh}, each against "
        "its own linear answer: linear theory (18) is the line at zero. Errors are the linear position under the load "
        "that holds the stage at the command, minus the command; along it this is by how much the load deviates from "
        "(18). Rotations are made displacements by l₃.",
        f"Anywhere within {near} linear theory misses the position by up to "
        f"{found.position[0]:.2f} %, within {far} by {found.position[1]:.2f} %; the two terms change the tangent "
        f"compliance there by up to {found.terms[0]:.2f} and {found.terms[1]:.2f} %.",
    ]


def _meshed(found: Large) -> bool:
    return "unknowns" in found.settings


def _size(found: Large, axis: Direction, share: float) -> str:
    """The command of a share of the amplitude, to both sides."""
    unit = COMMANDS[DIRECTIONS.index(axis)]
    return f"±{unit.factor * share * float(found.at('amplitude', direction=axis)):g} {unit}"


def plot_tangents(ax: Axes, found: Large, direction: Direction) -> Axes:
    """Draw the change of the tangent stiffness along the way in one direction, by every model; returns `ax`."""
    commanded = _frame(ax, found, direction, "change from rest (%)")
    curves = found.at("tangent", direction=direction)
    _draw(ax, commanded, curves)
    _say_worth(ax, curves)
    return ax


def plot_along(ax: Axes, found: Large, direction: Direction) -> Axes:
    """Draw the error of linear theory along the command, by every model; returns `ax`."""
    commanded = _frame(ax, found, direction, "error (% of the command)")
    curves = found.at("errors", direction=direction, component=direction)
    _draw(ax, commanded, curves)
    _say_worth(ax, curves)
    return ax


def plot_across(ax: Axes, found: Large, direction: Direction) -> Axes:
    """Draw the errors of linear theory across the command, by every model; returns `ax`."""
    commanded, largest = _frame(ax, found, direction, "error (% of the command)"), 0.0
    for other in (each for each in DIRECTIONS if each != direction):
        curves = found.at("errors", direction=direction, component=other)
        largest = max(largest, float(np.max(np.abs(curves[:, EXACT]))))
        _draw(ax, commanded, curves[:, :LOADED])
        if largest > ROUND_OFF:
            place = (float(commanded[-1]), float(curves[-1, EXACT]))
            ax.annotate(f"in {NAMES[other]}", place, (7, 0), textcoords="offset points", va="center", size=9.5)
            ax.set_xlim(right=1.4 * place[0])
    if largest < ROUND_OFF:
        _say_round_off(ax)
    return ax


def _frame(ax: Axes, found: Large, direction: Direction, label: str) -> Array:
    """Labels, grid and the line of linear theory; returns the commands in the unit of the axis."""
    far = float(found.at("amplitude", direction=direction))
    unit = unit_for(direction, far)
    ax.set(xlabel=f"commanded {NAMES[direction]} ({unit.name})", ylabel=label)
    ax.axhline(0.0, color=GREY, linewidth=1.1, zorder=1, label="linear theory, (18)")
    ax.grid()
    return unit.factor * far * np.arange(-STEPS, STEPS + 1) / STEPS


def _say_round_off(axes: Axes) -> None:
    axes.set_ylim(-HONEST, HONEST)
    axes.set_yticks([0.0])
    box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.7}
    place: Any = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.75, f"round-off only, axis ±{scientific(HONEST)} %", **place, size=10, bbox=box)


def _draw(axes: Axes, commanded: Array, curves: Array) -> None:
    """Draw curves (shares, theories), those of finite elements as marks where they were solved."""
    for theory, (label, style) in MODELS.items():
        axes.plot(commanded, curves[:, theory], label=label, **style)
    for theory, label, style in ((HELD, AT_POSE, HELD_MARKS), (LOADED, UNDER_LOAD, LOADED_MARKS)):
        solved = np.isfinite(curves[:, theory]) if theory < curves.shape[1] else np.zeros(len(curves), dtype=bool)
        if solved.any():
            axes.plot(commanded[solved], curves[solved, theory], label=label, **style)


def _say_worth(axes: Axes, curves: Array) -> None:
    """What the terms are worth at both ends, in the corner that the curves leave free."""
    ends = [float(curves[k, TANGENT] - curves[k, WITHOUT]) for k in STEPS + STATED[[0, -1]]]
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
