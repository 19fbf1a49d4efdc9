"""Strokes and forces for a pose against their limits, and what strokes of every model leave undone, as bars."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.files.refusals import shown
from flexfem.plot.accuracy import HATCHES
from flexfem.plot.curves import COLOURS, NAMES
from flexfem.plot.drive_sketch import platform_factor, plot_drive
from flexfem.plot.style import GREY, INK, PALE, below_header, in_house_style, wrapped
from flexfem.plot.text import significant
from flexfem.questions.drive import Drive
from flexfem.questions.driven import CRITERIA
from flexfem.refused import BadInput
from flexfem.units import COMMANDS, FORCES, MICROMETRE, unit_for
from flexfem.verify.case import DIRECTIONS, Direction

WIDTH = 11.69  # in
ROW, FRAME, LEAST = 0.34, 0.75, 1.9  # in, of a row of bars, of title and axis of a panel, and the least height of one
MOST, DRAWING = 9.0, 5.8  # in, of a panel, whose rows become narrower, and the least height for the drawing
NAME = 1.6  # in, width of the names of stacks and models
ROUND_OFF = 1e-12  # of the largest number of the pose, as in the printed table


@in_house_style
def command_figure(found: Drive) -> Figure:
    """Draw a driven stage at a pose: stacks in their places, strokes and forces by criterion, open-loop errors."""
    errors = len(found.error) if "error" in found.values else 0
    rows = [len(found.command), len(found.stroke), errors]
    heights = [min(max(ROW * count + FRAME, LEAST), MOST) for count in rows if count]
    heights[1] = max(heights[1], DRAWING - heights[0])
    title, doubts = f"{found.about.name}: strokes and forces for a pose", (found.about.assumed, found.about.not_stated)
    figure = below_header((WIDTH, sum(heights) + 0.7), title, _lines(found), doubts)
    parts = figure.subfigures(len(heights) - 1, squeeze=False, height_ratios=[sum(heights[:2]), *heights[2:]])[:, 0]
    grid = {"width_ratios": [1.5, 1.0], "height_ratios": heights[:2]}
    axes = parts[0].subplot_mosaic([["stage", "strokes"], ["stage", "forces"]], gridspec_kw=grid)
    plot_strokes(axes["strokes"], found).set_title("(b) strokes by actuator", loc="left")
    plot_forces(axes["forces"], found).set_title("(c) forces by stack; right: blocking forces", loc="left")
    if errors:
        _draw_errors(list(parts[1].subplots(1, 3)), found)
    figure.draw_without_rendering()  # labels of the drawing are placed at the size that its axes have then
    plot_drive(axes["stage"], found)
    axes["stage"].set_title(f"(a) strokes beyond rest, and forces, by {CRITERIA[0]}", loc="left")
    handles: dict[str, Any] = {}
    for name in ("stage", "strokes", "forces"):
        handles |= {label: handle for handle, label in zip(*axes[name].get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_errors(panels: list[Axes], found: Drive) -> None:
    """Open-loop errors in x, y and theta, side by side."""
    for letter, axes, direction in zip("def", panels, DIRECTIONS, strict=True):
        plot_open_loop(axes, found, direction).set_title(
            f"({letter}) error of the metal in {NAMES[direction]}", loc="left"
        )
        axes.tick_params(labelleft=direction == "x")


def _lines(found: Drive) -> list[str]:
    """What the header says: pose, load, model, how the platform is drawn, and what is out of reach."""
    said = f"Pose {_numbers(found.pose, COMMANDS)}"
    if np.any(found.load):
        said += f" under a load of {_numbers(found.load, FORCES)}"
    said += f"; strokes by {found.settings['strokes by']}."
    if np.any(found.pose):
        said += f" Dashed: the platform at the pose, displacements × {significant(platform_factor(found), 1)}."
    said += " Stacks are not to scale."
    return [said, *(text for text in found.warnings if "reach this pose" in text or "hold this pose" in text)]


def _numbers(values: Any, units: Any) -> str:
    return ", ".join(f"{unit.factor * value:.5g} {unit}" for value, unit in zip(values, units, strict=True)).replace(
        "-", "\N{MINUS SIGN}"
    )


def plot_strokes(ax: Axes, found: Drive) -> Axes:
    """Draw the strokes beyond rest by actuator, a bar for each criterion, on the strokes that it has; returns `ax`."""
    rows, um = np.arange(len(found.command)), MICROMETRE
    low, high = um.factor * found.shortest, um.factor * found.longest
    ax.barh(rows, high - low, left=low, height=0.94, color=PALE, edgecolor=GREY, linewidth=0.6, label="strokes it has")
    _bars(ax, dict(zip(found.axes["criterion"], um.factor * found.command.T, strict=True)))
    numbers = [[k + 1 for k, place in enumerate(found.fields.places) if place.actuator == row] for row in rows]
    names = [f"{name} ({', '.join(map(str, own))})" for name, own in zip(found.axes["actuator"], numbers, strict=True)]
    _label_rows(ax, names)
    ax.set_xlabel(f"stroke beyond rest ({um})")
    return ax


def plot_forces(ax: Axes, found: Drive) -> Axes:
    """Draw the forces of the stacks, a bar for each criterion, with preload and blocking force; returns `ax`.

    Blocking forces are written at the right of the axes, and drawn where the axis reaches them.
    """
    rows, force = np.arange(len(found.force)), dict(zip(found.axes["criterion"], found.force.T, strict=True))
    preload, blocking = found.preload, found.blocking_force
    _bars(ax, force)
    most = 1.12 * max(*(float(np.max(each)) for each in force.values()), float(np.max(preload)), 1e-9)
    least = min(0.0, 1.12 * min(float(np.min(each)) for each in force.values()))
    mark: Any = {"linestyle": "none", "marker": "|", "markersize": 17.0, "zorder": 5}
    ax.plot(preload, rows, color=INK, markeredgewidth=1.3, label="preload", **mark)
    if np.any(blocking <= most):
        near = blocking <= most
        ax.plot(blocking[near], rows[near], color="#B00000", markeredgewidth=2.6, label="blocking force", **mark)
    for row, value in enumerate(blocking.tolist()):
        place: Any = {"transform": ax.get_yaxis_transform(), "va": "center", "size": 8.0, "color": "#404040"}
        ax.text(1.015, row, f"{value:.4g} {FORCES[0]}", **place)
    _label_rows(ax, [f"{k + 1}: {name}" for k, name in enumerate(found.axes["stack"])])
    ax.set(xlabel=f"force ({FORCES[0]}); a contact opens at zero", xlim=(least, most))
    return ax


def plot_open_loop(ax: Axes, found: Drive, direction: Direction) -> Axes:
    """Draw by how much finite elements miss the pose in one direction with the strokes of every model; returns `ax`.

    Raises BadInput for another direction than x, y or theta, and a record without finite elements.
    """
    if direction not in DIRECTIONS:
        raise BadInput(f"direction {shown(direction)}, expected one of {', '.join(DIRECTIONS)}")
    if "error" not in found.values:
        raise BadInput("this record has no open-loop errors: expected one with finite elements")
    error = found.at("error", direction=direction)
    largest = float(np.max(np.abs(error)))
    nothing = largest <= ROUND_OFF * float(np.max(np.abs(found.pose)))
    unit = unit_for(direction, 0.0 if nothing else largest)
    rows, reach = np.arange(len(error)), 1.0 if nothing else unit.factor * largest
    ax.barh(rows, unit.factor * error, height=0.6, color=COLOURS[0], edgecolor=INK, linewidth=0.5)
    for row, value in enumerate(error.tolist()):
        small = abs(value) <= ROUND_OFF * float(np.max(np.abs(found.pose)))
        text = "0" if small else significant(unit.factor * value, 3)
        at, side = unit.factor * value, "right" if value < 0 and not small else "left"
        ax.text(at + (0.03 if side == "left" else -0.03) * reach, row, text, va="center", ha=side, size=8.0)
    _label_rows(ax, [name.removeprefix(f"{found.settings['strokes by']}, ") for name in found.axes["commanding model"]])
    ax.set(xlabel=f"error ({unit})", xlim=(-1.5 * reach, 1.5 * reach))
    return ax


def _bars(ax: Axes, values: dict[Any, Any]) -> None:
    """A group of bars a row, one for each criterion that has strokes."""
    height = 0.8 / len(values)
    for k, (name, value) in enumerate(values.items()):
        index = CRITERIA.index(name)
        rows = np.arange(len(value)) + (k - (len(values) - 1) / 2) * height
        look: Any = {"color": COLOURS[index], "hatch": HATCHES[index], "edgecolor": "white", "linewidth": 0.4}
        ax.barh(rows, value, height=height, label=name, zorder=3, **look)


def _label_rows(ax: Axes, names: list[str]) -> None:
    size = 8.5 if len(names) <= 24 else 6.0
    ax.set_yticks(range(len(names)), [wrapped(name, NAME, size) for name in names], size=size)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.axvline(0.0, color=GREY, linewidth=0.9, zorder=4)
    ax.grid(axis="x")
