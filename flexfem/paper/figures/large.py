"""Large displacements of the stage: tangent stiffness, and errors of linear theory."""

from __future__ import annotations

from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.paper.large import EXACT, HELD, LOADED, STEPS, TANGENT, WITHOUT, StageLarge
from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, NAMES, titled
from flexfem.refused import BadInput, printed
from flexfem.units import COMMANDS, DIRECTIONS, Direction, unit_for

Column: TypeAlias = Literal["tangent", "along", "across"]

WIDTH = 11.69  # in
ROUND_OFF = 1e-9  # of the command, in per cent
COLUMNS: dict[Any, str] = {
    "tangent": "tangent stiffness",
    "along": "error of (18) along the command",
    "across": "error of (18) across the command",
}
MARKS: Any = {
    "linestyle": "none",
    "markerfacecolor": "none",
    "markersize": 7.5,
    "markeredgewidth": 1.4,
    "zorder": 4,
}
THEORIES: dict[int, tuple[str, dict[str, Any]]] = {  # labels and looks of the curves
    WITHOUT: (
        "(16) without its second-order terms",
        {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.9},
    ),
    TANGENT: ("(16)", {"color": COLOURS[0], "linewidth": 2.6}),
    EXACT: (
        "exact equilibrium",
        {
            "color": INK,
            "linestyle": "none",
            "marker": ".",
            "markevery": 4,
        },
    ),
    HELD: ("finite elements held at the command", MARKS | {"marker": "s", "color": COLOURS[2]}),
    LOADED: (
        "finite elements under the load of exact equilibrium",
        MARKS | {"marker": "v", "color": COLOURS[3]},
    ),
}


@style.in_house_style
def large_figure(found: StageLarge) -> Figure:
    """Draw tangent stiffness and errors of linear theory over the command, a row per direction.

    Every model is compared with its own linear solution, so that all curves pass through zero at
    rest.
    """
    settings = found.settings
    near = _command_limits(found, 0.1)
    far = _command_limits(found, 1.0)
    mesh = ""
    if "unknowns" in settings:
        mesh = f", and nonlinear finite elements ({settings['unknowns']} unknowns)"
    lines = [
        f"Pseudo-rigid stage of mobility {settings['mobility']}, {settings['formula']}{mesh}; "
        "each model is compared with its own linear solution, (18). Error: displacement by (18) "
        "under the load that holds the stage at the command, minus the command. Rotations are "
        "multiplied by l₃.",
        f"Largest error of (18) within {near}: {found.position[0]:.2f} %, within {far}: "
        f"{found.position[1]:.2f} %. The second-order terms change the tangent compliance there "
        f"by up to {found.terms[0]:.2f} and {found.terms[1]:.2f} %.",
    ]
    title = f"{found.about.name}: large displacements and the second-order terms of (16)"
    figure, axes = style.panels((WIDTH, 8.5), title, lines, 3, 3, found.about)
    panels = product(DIRECTIONS, COLUMNS)
    for ax, letter, (direction, column) in zip(axes, "abcdefghi", panels, strict=True):
        plot_large(ax, found, direction, column)
        titled(ax, letter, f"{NAMES[direction]}: {COLUMNS[column]}")
    style.legend_below(figure, axes[1:2], 3, fontsize=9.5, handlelength=3.6)
    return figure


def _command_limits(found: StageLarge, share: float) -> str:
    """Return the limits of the commands in x and theta, times a share."""
    limits = [
        f"±{COMMANDS[k].factor * share * float(found.amplitude[k]):g} {COMMANDS[k]}" for k in (0, 2)
    ]
    return " and ".join(limits)


def plot_large(
    ax: Axes, found: StageLarge, direction: Direction, column: Column = "tangent"
) -> Axes:
    """Draw one quantity of every model over the command in one direction; return `ax`.

    column : the change of the tangent stiffness, or the error of linear theory along or across the
    command.
    """
    if column not in COLUMNS:
        raise BadInput(f"column {printed(column)}, expected one of: {', '.join(COLUMNS)}")
    amplitude = float(found.at("amplitude", direction=direction))
    unit = unit_for(direction, amplitude)
    commanded = unit.factor * amplitude * np.arange(-STEPS, STEPS + 1) / STEPS
    ax.set_xlabel(f"commanded {NAMES[direction]} ({unit})")
    ax.set_ylabel("change from rest (%)" if column == "tangent" else "error (% of the command)")
    ax.axhline(
        0.0,
        color=GREY,
        linewidth=1.1,
        zorder=1,
        label="linear theory, (18)",
    )
    ax.grid()
    curves = _curves(found, direction, column)
    for values, (theory, (label, look)) in product(curves.values(), THEORIES.items()):
        known = np.isfinite(values[:, theory])
        if known.any() and not (column == "across" and theory == LOADED):
            ax.plot(commanded[known], values[known, theory], label=label, **look)
    if column == "across":
        _name_components(ax, curves, float(commanded[-1]))
    return ax


def _curves(
    found: StageLarge,
    direction: Direction,
    column: Column,
) -> dict[Direction, Array]:
    """Return the values (commands, theories) of a column, %, by component of the pose."""
    if column == "tangent":
        return {direction: found.at("tangent", direction=direction)}
    components = [each for each in DIRECTIONS if (each != direction) == (column == "across")]
    return {
        component: found.at("errors", direction=direction, component=component)
        for component in components
    }


def _name_components(
    ax: Axes,
    curves: dict[Direction, Array],
    end: float,
) -> None:
    """Name the components at the ends of their curves, or say that they are zero."""
    if max(np.max(np.abs(values[:, EXACT])) for values in curves.values()) < ROUND_OFF:
        ax.clear()
        ax.set_axis_off()
        look: dict[str, Any] = {"transform": ax.transAxes, "ha": "center", "va": "center"}
        ax.text(0.5, 0.5, "zero (round-off)", color=INK, size=10, **look)
        return
    last = np.array([values[-1, EXACT] for values in curves.values()])
    close = np.ptp(last) < 0.1 * np.ptp(ax.get_ylim())
    text: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": 9.5}
    for component, height in zip(curves, last.tolist(), strict=True):
        up = 6.0 * np.sign(height - last.mean()) if close else 0.0
        ax.annotate(f"in {NAMES[component]}", (end, height), (7, up), **text)
    ax.set_xlim(right=1.4 * end)
