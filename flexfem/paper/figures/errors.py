"""Figs. 5 to 7 of the paper: the positioning errors of the analytic model over the command."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.arrays import Array
from flexfem.paper.verification import Verification
from flexfem.plot import style
from flexfem.plot.errors import LEGEND_WIDTH, WIDTH, curve_style
from flexfem.plot.style import GREY, INK, NAMES, panels, titled, wrapped
from flexfem.plot.text import banded
from flexfem.units import DIRECTIONS, LENGTH, Direction, Unit, unit_for

# per cent of the command: above the round-off of 1e5 equations, below any real error
ROUND_OFF = 1e-7
DRIVES = {
    "force": "under the force of the analytic model, (18)",
    "joints": "with the joint rotations of the analytic model, (29)",
    "strokes": "with the strokes of the analytic model, (29)",
}


@style.in_house_style
def error_figure(result: Verification, displacement: bool = False) -> Figure:
    """Draw a verification as one page with a panel for every direction: Figs. 5 to 7 of the paper.

    Below the panels, a line names the cross directions without error, which have no panel.

    displacement : in the commanded direction draw the displacement, as the captions of Figs. 5(a)
    and 7(c) state, not its error.
    """
    shown = [axis for axis in DIRECTIONS if _has_panel(result, axis)]
    size = (WIDTH, 2.6 * len(shown) + 0.8)
    lines = _header(result, shown, displacement)
    figure, axes = panels(size, result.name, lines, len(shown), assumptions=result)
    for letter, ax, freedom in zip("abc", axes, shown, strict=False):
        along = freedom == result.direction
        titled(ax, letter, f"{NAMES[freedom]}, {'commanded' if along else 'cross'} direction")
        plot_errors(ax, result, freedom, along and displacement)
        ax.label_outer()
    zero = [NAMES[axis] for axis in DIRECTIONS if axis not in shown]
    if zero:
        plural = "s" * (len(zero) - 1)
        names = " and ".join(zero)
        text = f"Cross direction{plural} {names}: zero error (below 10⁻⁹ of the commanded motion)."
        figure.supxlabel(
            text,
            x=style.MARGIN / WIDTH,
            ha="left",
            size=9.5,
            color=INK,
        )
    figure.align_ylabels()
    return figure


def _has_panel(result: Verification, freedom: Direction) -> bool:
    return freedom == result.direction or bool(np.any(percentages(result, freedom)))


def _header(
    result: Verification,
    shown: list[Direction],
    displacement: bool,
) -> list[str]:
    """Return the lines on what is drawn, and on what its percentages and bands mean."""
    quantity = "minus commanded displacement"
    if displacement:
        quantity = "in the commanded direction, its error across"
    drive = DRIVES[result.drive]
    if result.analysis == "nonlinear":
        drive = "large displacements in both models"
    where = ""
    band = "mesh band"
    if result.elements == "three_dimensional":
        where = " in three dimensions"
        band = "band of mesh and layers"
    rotations = ""
    if "theta" in (result.direction, *shown):
        levers = sorted({model.lever for model in result.models.values()})
        texts = ", ".join(f"{lever:g}" for lever in levers)
        rotations = f" Rotations are multiplied by l₃ = {texts} {LENGTH}."
    return [
        f"Finite-element displacement{where} {quantity}, {drive}.",
        f"100 %: largest commanded motion.{rotations} ±, shaded: {band}.",
    ]


def percentages(result: Verification, freedom: Direction) -> Array:
    """Return the errors (curves, points) in one direction in per cent of the largest command.

    Rotations are compared as lengths; round-off is zero.
    """
    levers = np.array([result.models[label].lever for label in result.curves])
    power = (freedom == "theta") - float(result.direction == "theta")
    comparable = result.at("error", direction=freedom) * (levers**power)[:, None]
    errors = 100 * comparable / np.max(np.abs(result.commanded))
    is_zero = np.abs(errors).max(axis=1, keepdims=True) < ROUND_OFF
    return np.where(is_zero, 0.0, errors)


class _Scales(NamedTuple):
    """How errors in per cent are drawn: over x (points,), from a base (points,), in a unit."""

    x: Array
    base: Array
    per_cent: float  # in the drawn unit
    unit: Unit  # of the command


def _scales(result: Verification, displacement: bool) -> _Scales:
    commanded = np.array(result.commanded)
    amplitude = float(np.max(np.abs(commanded)))
    unit = unit_for(result.direction, amplitude)
    x = unit.factor * commanded
    if displacement:
        return _Scales(x, x, unit.factor * amplitude / 100, unit)
    return _Scales(x, 0.0 * x, 1.0, unit)


def plot_errors(
    ax: Axes, result: Verification, freedom: Direction, displacement: bool = False
) -> Axes:
    """Draw the errors of every curve in one direction over the command; return `ax`.

    Mesh bands are shaded; the legend beside the axes states the percentages at the largest command.

    displacement : draw the displacement in the commanded direction instead, and the command in
    grey."""
    errors = percentages(result, freedom)
    scales = _scales(result, displacement)
    ax.plot(
        scales.x,
        scales.base,
        color=GREY,
        linewidth=0.8,
        zorder=1,
        label="_command",
    )
    size = 9.0 if len(errors) < 5 else 6.5 if len(errors) < 9 else 5.0
    lines = list[Line2D]()
    texts = list[str]()
    for index, label in enumerate(result.curves):
        percent = float(result.at("percent", curve=label, direction=freedom))
        band = float(result.band("percent", curve=label, direction=freedom))
        y = scales.base + scales.per_cent * errors[index]
        look = curve_style(index, len(errors), len(scales.x))
        lines += ax.plot(scales.x, y, label=f"{label} ", **look)
        if np.any(errors[index]):
            _shade_band(ax, scales, y, band, look["color"])
        named = f"{label}: {'error ' if displacement else ''}{banded(percent, band)}"
        text = wrapped(named, LEGEND_WIDTH, size)
        # matplotlib hides labels that begin with _
        texts.append(f" {text}" if text.startswith("_") else text)
    ax.margins(x=0.03)
    ax.grid()
    ax.set_xlabel(f"commanded {NAMES[result.direction]} ({scales.unit})")
    look = {"fontsize": size, "handlelength": 4.4, "labelspacing": 0.6}
    style.legend_beside(ax, handles=lines, labels=texts, **look)
    if displacement:
        ax.set_ylabel(f"displacement in {NAMES[freedom]} ({scales.unit})")
        note = "grey: displacement = command"
        ax.text(
            0.99,
            0.04,
            note,
            transform=ax.transAxes,
            ha="right",
            color=INK,
            size=9,
        )
        return ax
    ax.set_ylabel("Positioning error,\n% of the commanded motion")
    half = 1.1 * float(np.max(np.abs(errors))) or 1.0
    ax.set_ylim(-half, half)
    ax.locator_params(axis="y", nbins=7)
    return ax


def _shade_band(
    ax: Axes,
    scales: _Scales,
    y: Array,
    band: float,
    colour: Any,
) -> None:
    """Shade the mesh band of a curve, which grows with the command to a percentage."""
    share = np.abs(scales.x) / np.max(np.abs(scales.x))
    half = scales.per_cent * band * share
    look: dict[str, Any] = {
        "color": colour,
        "alpha": 0.3,
        "linewidth": 0,
        "zorder": 1.5,
    }
    ax.fill_between(scales.x, y - half, y + half, **look)
