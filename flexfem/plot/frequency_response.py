"""Frequency response of the platform: magnitude and phase of each pose under loads and strokes."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from flexfem.plot.curves import NAMES
from flexfem.plot.style import in_house_style, legend_beside, new_axes, panels
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, UNITS, Direction
from flexfem.verify.dynamic_model import DynamicModel
from flexfem.verify.modes import NaturalModes

POINTS = 1500
LOWEST, HIGHEST = 0.05, 1.2  # of the drawn frequencies, over the first and the last natural one
LINES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)))
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#56B4E9", "#CC79A7", "#1A1A1A")
Part = Literal["magnitude", "phase"]
Kind = Literal["load", "stroke"]


@in_house_style
def response_figure(model: DynamicModel, of: NaturalModes) -> Figure:
    """Draw magnitude and phase of all three poses, each under its own load and under every stroke."""
    kinds: tuple[Kind, ...] = ("load", "stroke") if any(_strokes(model)) else ("load",)
    lines = [
        f"Plane finite elements, {len(model.frequencies)} modes and what the others do at rest; drives {of.drives}. "
        f"Damping of every mode {100 * model.damping:g} % of critical, assumed. Motion in the plane only."
    ]
    size, doubts = (12.6, 5.0 * len(kinds)), (of.assumed, of.not_stated)
    figure, axes = panels(size, f"{of.name}: frequency response", lines, 2 * len(kinds), 3, doubts)
    places = iter(axes)
    for kind in kinds:
        for part in ("magnitude", "phase"):
            for name in DIRECTIONS:
                ax = plot_response(next(places), model, name, kind, part)
                if part == "magnitude":
                    ax.set_title(
                        f"{NAMES[name]} under {'its load' if kind == 'load' else 'strokes'}", loc="left", size=11
                    )
                if kind == "stroke" and part == "magnitude" and name == "theta":
                    legend_beside(ax, fontsize=8)
    return figure


def plot_response(
    ax: Axes | None, model: DynamicModel, direction: Direction, kind: Kind = "load", part: Part = "magnitude"
) -> Axes:
    """Draw the response of one direction of the pose under its own load, or under every stroke; returns `ax`.

    Raises BadInput for a direction, kind or part that is not there.
    """
    if direction not in DIRECTIONS or part not in ("magnitude", "phase"):
        raise BadInput(f"response {direction!r}, {part!r}, expected x, y or theta, and magnitude or phase")
    row = DIRECTIONS.index(direction)
    inputs = [row] if kind == "load" else _strokes(model)
    if not inputs:
        raise BadInput("no strokes: the drives are not engaged")
    ax = ax or new_axes()
    w = np.geomspace(LOWEST * model.frequencies[0], HIGHEST * model.frequencies[-1], POINTS)
    w = np.unique(np.concatenate([w, *(each * np.linspace(0.9, 1.1, 201) for each in model.frequencies)]))
    found = model.response(w)[:, row]
    for k, column in enumerate(inputs):
        values = found[:, column]
        drawn = np.abs(values) if part == "magnitude" else np.rad2deg(np.unwrap(np.angle(values)))
        look = {"color": COLOURS[k % len(COLOURS)], "linestyle": LINES[k % len(LINES)], "linewidth": 1.2}
        ax.semilogx(w / (2 * math.pi), drawn, label=model.inputs.names[column], **look)
    ax.set_xlabel(f"frequency ({UNITS['hz']})")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    if part == "magnitude":
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0e}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        unit = f"{model.outputs.units[row]}/{_bracketed(model.inputs.units[inputs[0]])}"
        ax.set_ylabel(f"magnitude ({unit})")
    else:
        ax.set_ylabel(f"phase ({UNITS['deg']})")
    ax.grid(True, which="major", color="#D8D8D8", linewidth=0.6)
    return ax


def _strokes(model: DynamicModel) -> list[int]:
    """Which inputs are strokes."""
    return [k for k, name in enumerate(model.inputs.names) if name.startswith("stroke")]


def _bracketed(unit: str) -> str:
    return f"({unit})" if " " in unit else unit
