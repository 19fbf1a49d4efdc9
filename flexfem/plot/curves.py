"""Figs. 5 to 7: finite-element minus commanded displacement against the commanded displacement."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.driven_text import BANDS, BRIEF, OF_STAGE
from flexfem.plot.style import GREY, INK, in_house_style, inches, legend_beside, panels, wrapped
from flexfem.plot.text import banded, scientific
from flexfem.questions.errors import Verification
from flexfem.units import DIRECTIONS, LENGTH, Direction, Unit, unit_for

ROUND_OFF = 1e-9  # of the commanded amplitude: solving 1e5 equations leaves less, any real error more
HONEST = 1e-6  # of the commanded amplitude: half the axis of a panel that has nothing but round-off to show
EXACT = "large displacements in both models"
NAMES: dict[Direction, str] = {"x": "X", "y": "Y", "theta": "\N{GREEK SMALL LETTER THETA}"}
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#9B4F96", "#000000", "#56B4E9", "#E69F00", "#7F7F7F")  # Okabe and Ito
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">", "h")
DASHES: tuple[Any, ...] = (
    "solid",
    (0, (5, 2)),
    (0, (1.2, 1.2)),
    (0, (7, 2, 1.2, 2)),
    (0, (3, 1.2, 1.2, 1.2, 1.2, 1.2)),
    (0, (10, 3)),
    (0, (2.5, 2.5)),
)
THINNEST, SPREAD = 1.4, 1.0  # points: earlier curves are broader and show below later ones
THICKEST = 3.4  # points
WIDTH, HEIGHT = 8.27, 8.6  # in
LEGEND = 1.65  # in, width of a legend's text


class Panel(NamedTuple):
    """What one panel shows.

    unit : of the errors.  half : half the height of the axis, in that unit.
    largest : largest |error|, in that unit.  round_off : whether all of it is round-off.
    """

    unit: Unit
    half: float
    largest: float
    round_off: bool


def panel_of(result: Verification, freedom: Direction) -> Panel:
    """Unit and axis of the panel of one freedom, and whether it has anything but round-off to show."""
    amplitude = max(map(abs, result.commanded))
    largest, relative, honest = 0.0, 0.0, 0.0
    for label, model in result.models.items():
        lever = model.lever
        comparable = (lever if result.direction == "theta" else 1.0) / (lever if freedom == "theta" else 1.0)
        error = float(np.max(np.abs(result.at("error", curve=label, direction=freedom))))
        largest = max(largest, error)
        relative = max(relative, error / (amplitude * comparable))
        honest = max(honest, HONEST * amplitude * comparable)
    round_off = relative < ROUND_OFF
    half = honest if round_off else 1.1 * largest
    unit = unit_for(freedom, honest if round_off else largest)
    return Panel(unit, half * unit.factor, largest * unit.factor, round_off)


def mesh_band(result: Verification, label: str, freedom: Direction) -> Array:
    """Half-width (points,), mm or rad, of the mesh uncertainty of one curve: its percentage of every command."""
    lever = result.models[label].lever
    comparable = (lever if result.direction == "theta" else 1.0) / (lever if freedom == "theta" else 1.0)
    return np.abs(result.commanded) * comparable * result.band("percent", curve=label, direction=freedom) / 100.0


def driven_by(result: Verification) -> str:
    """What the finite elements were given, in words."""
    return EXACT if result.analysis == "nonlinear" else BRIEF[result.drive]


def normalisation(result: Verification) -> str:
    """How the percentages of the figure are normalised, in words."""
    levers = sorted({model.lever for model in result.models.values()})
    l3 = "l₃ = " + ", ".join(f"{lever:g}" for lever in levers) + f" {LENGTH}"
    command = NAMES[result.direction]
    if result.direction == "theta":
        cross = f"X and Y relative to the commanded rotation times {l3}"
    else:
        other = "Y" if command == "X" else "X"
        cross = f"{other} relative to the commanded translation; {NAMES['theta']} times {l3} likewise"
    return f"Percentages at the largest command. {command}: relative to the command; cross directions: {cross}."


@in_house_style
def error_figure(result: Verification, displacement: bool = False) -> Figure:
    """Draw a verification as one page of three panels, X, Y and theta.

    Parameters
    ----------
    result : a stored verification; mm and rad, shown with the SI prefix that suits the numbers.
    displacement : draw the displacement itself in the commanded direction, as the captions of the paper's Figs. 5(a)
        and 7(c) have it, instead of its error.

    Notes
    -----
    Figs. 5 to 7 of the paper. A panel with nothing but round-off says so on an axis of 1e-6 of the command.
    """
    shown = "in the commanded direction, its error across" if displacement else "minus commanded displacement"
    where = OF_STAGE[result.elements].replace(",", "")
    lines = [
        f"Finite-element displacement{where} {shown}, {driven_by(result)}. ±, shaded: {BANDS[result.elements]}.",
        normalisation(result),
    ]
    figure, found = panels((WIDTH, HEIGHT), result.name, lines, 3, doubts=(result.assumed, result.not_stated))
    for row, (axes, freedom) in enumerate(zip(found, DIRECTIONS, strict=True)):
        along = freedom == result.direction
        kind = "commanded direction" if along else "cross direction"
        axes.set_title(f"({'abc'[row]}) {NAMES[freedom]}, {kind}", loc="left")
        if along and displacement:
            plot_displaced(axes, result)
        else:
            plot_errors(axes, result, freedom)
        axes.label_outer()
    figure.align_ylabels()
    return figure


def plot_displaced(ax: Axes, result: Verification) -> Axes:
    """Draw displacement over command of every curve in the commanded direction; returns `ax`.

    The grey line is the command itself, where an exact model has every curve. Mesh bands are drawn, and errors stated,
    as by `plot_errors`.
    """
    freedom = result.direction
    command = unit_for(freedom, max(map(abs, result.commanded)))
    x = np.array(result.commanded) * command.factor
    ax.plot(x, x, color=GREY, linewidth=0.8, zorder=1, label="_command")
    for index, label in enumerate(result.curves):
        y = x + result.at("error", curve=label, direction=freedom) * command.factor
        style = curve_style(index, len(result.curves), len(x))
        ax.plot(x, y, label=f"{label} ", **style)
        band = mesh_band(result, label, freedom) * command.factor
        ax.fill_between(x, y - band, y + band, color=style["color"], alpha=0.3, linewidth=0, zorder=1.5)
    ax.text(0.99, 0.04, "grey: displacement = command", transform=ax.transAxes, ha="right", color=INK, size=9)
    ax.margins(x=0.03)
    ax.grid()
    ax.set_ylabel(f"displacement in {NAMES[freedom]} ({command.name})")
    ax.set_xlabel(f"commanded {NAMES[freedom]} ({command.name})")
    _draw_legend(ax, result, freedom, "error ")
    return ax


def plot_errors(ax: Axes, result: Verification, freedom: Direction) -> Axes:
    """Draw the errors of every curve in one direction over the command, with their mesh bands; returns `ax`.

    The legend beside states the percentages at the largest command.
    """
    panel = panel_of(result, freedom)
    command = unit_for(result.direction, max(map(abs, result.commanded)))
    x = np.array(result.commanded) * command.factor
    ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
    for index, label in enumerate(result.curves):
        y = result.at("error", curve=label, direction=freedom) * panel.unit.factor
        style = curve_style(index, len(result.curves), len(x))
        ax.plot(x, y, label=f"{label} ", **style)
        band = mesh_band(result, label, freedom) * panel.unit.factor
        if not panel.round_off:
            ax.fill_between(x, y - band, y + band, color=style["color"], alpha=0.3, linewidth=0, zorder=1.5)
    if panel.half > 0:
        ax.set_ylim(-panel.half, panel.half)
    ax.margins(x=0.03)
    ax.grid()
    ax.locator_params(axis="y", nbins=7)
    ax.set_ylabel(f"error in {NAMES[freedom]} ({panel.unit.name})")
    ax.set_xlabel(f"commanded {NAMES[result.direction]} ({command.name})")
    if panel.round_off:
        text = f"round-off only: largest {scientific(panel.largest)} {panel.unit.name}"
        box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.7}
        ax.text(0.5, 0.8, text, transform=ax.transAxes, ha="center", va="center", color=INK, size=10, bbox=box)
    _draw_legend(ax, result, freedom)
    return ax


def error_text(result: Verification, label: str, freedom: Direction) -> str:
    """Error percentage of one curve in one direction, with the band of its meshes."""
    where = {"curve": label, "direction": freedom}
    return banded(float(result.at("percent", **where)), float(result.band("percent", **where)))


def curve_style(index: int, curves: int, points: int) -> dict[str, Any]:
    """Colour, dashes, marker and breadth of one of so many curves; markers are staggered where curves coincide."""
    step = max(1, points // 7)
    return {
        "color": COLOURS[index % len(COLOURS)],
        "linestyle": DASHES[index % len(DASHES)],
        "marker": MARKERS[index % len(MARKERS)],
        "markevery": (index * max(1, step // 2) % step, step),
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.2,
        "linewidth": THINNEST + min(SPREAD, (THICKEST - THINNEST) / max(1, curves - 1)) * (curves - 1 - index),
        "zorder": 2 + index / 100,
        "clip_on": True,
    }


def _draw_legend(ax: Axes, result: Verification, freedom: Direction, said: str = "") -> None:
    """Legend beside the panel, in the largest letters with which it is no higher than the panel."""
    height = inches(ax)[1]
    entries = {label: error_text(result, label, freedom) for label in result.curves}
    for size in np.arange(9.0, 4.0, -0.5):
        texts = [wrapped(f"{label}: {said}{value}", LEGEND, size) for label, value in entries.items()]
        if sum((text.count("\n") + 1) * 1.25 + 0.6 for text in texts) * size / 72 <= height:
            break
    shown = [text.replace("_", " _", 1) if text.startswith("_") else text for text in texts]  # matplotlib hides "_..."
    lines = ax.get_lines()[-len(shown) :]
    legend_beside(ax, handles=lines, labels=shown, fontsize=size, handlelength=4.4, labelspacing=0.6)
