"""Figures of the errors of the analytic model: Figs. 5 to 7, error budgets as waterfalls, and mesh convergence."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, NAMES, panels, titled, wrapped
from flexfem.plot.text import banded, minus, scientific
from flexfem.questions.budget import CHART, MEASURED, TOTAL, Budget
from flexfem.questions.convergence import MeshConvergence
from flexfem.questions.errors import Verification
from flexfem.units import DIRECTIONS, LENGTH, Direction, unit_for

ROUND_OFF = 1e-9  # of the commanded amplitude: above the round-off of 1e5 equations, below any real error
ROUND_OFF_AXIS = 1e-6  # of the commanded amplitude: half the range of the axis where there is only round-off
THINNEST, THICKEST = 1.4, 3.4  # points: earlier curves are thicker, and so visible below later ones
WIDTH = 8.27  # in
LEGEND_WIDTH, NAME_WIDTH = 1.65, 2.1  # in, of a legend's text, and of the name of a share
DRIVES = {"force": "force by (18)", "joints": "joints imposed by (29)", "strokes": "strokes commanded by (29)"}
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@style.in_house_style
def error_figure(result: Verification, displacement: bool = False) -> Figure:
    """Draw a verification as one page of three panels, X, Y and theta: Figs. 5 to 7 of the paper.

    `displacement` : in the commanded direction draw the displacement, as the captions of Figs. 5(a) and 7(c) state,
    not its error. A panel with nothing but round-off says so; its axis ends at 1e-6 of the command.
    """
    quantity = "in the commanded direction, its error across" if displacement else "minus commanded displacement"
    drive = "large displacements in both models" if result.analysis == "nonlinear" else DRIVES[result.drive]
    solid = result.elements == "three_dimensional"
    where, band = (" in three dimensions", "band of mesh and layers") if solid else ("", "mesh band")
    levers = ", ".join(f"{lever:g}" for lever in sorted({model.lever for model in result.models.values()}))
    lines = [
        f"Finite-element displacement{where} {quantity}, {drive}. ±, shaded: {band}.",
        f"Percentages at the largest command, relative to it; rotations are multiplied by l₃ = {levers} {LENGTH}.",
    ]
    figure, axes = panels((WIDTH, 8.6), result.name, lines, 3, assumptions=result)
    for letter, ax, freedom in zip("abc", axes, DIRECTIONS, strict=True):
        along = freedom == result.direction
        titled(ax, letter, f"{NAMES[freedom]}, {'commanded' if along else 'cross'} direction")
        plot_errors(ax, result, freedom, along and displacement)
        ax.label_outer()
    figure.align_ylabels()
    return figure


def plot_errors(ax: Axes, result: Verification, freedom: Direction, displacement: bool = False) -> Axes:
    """Draw the errors of every curve in one direction over the command, with their mesh bands; return `ax`.

    The legend beside the axes states the percentages at the largest command. `displacement` : draw the displacement in
    the commanded direction instead, and the command in grey.
    """
    x, errors = np.array(result.commanded), result.at("error", direction=freedom)
    levers = {"theta": [result.models[label].lever for label in result.curves]}  # scale rotations to lengths
    scale = np.divide(levers.get(result.direction, 1.0), levers.get(freedom, 1.0)) * np.ones(len(result.curves))
    amplitude, largest = float(np.max(np.abs(x))), float(np.max(np.abs(errors)))
    round_off = bool(np.all(np.abs(errors).max(axis=-1) < ROUND_OFF * amplitude * scale))
    half = ROUND_OFF_AXIS * amplitude * float(scale.max()) if round_off else 1.1 * largest
    command = unit_for(result.direction, amplitude)
    unit = command if displacement else unit_for(freedom, half if round_off else largest)
    base, quantity = (unit.factor * x, "displacement") if displacement else (0.0 * x, "error")
    ax.plot(command.factor * x, base, color=GREY, linewidth=0.8, zorder=1, label="_command")
    size, count = 9.0 if len(errors) < 5 else 6.5 if len(errors) < 9 else 5.0, len(errors)
    lines, texts = [], []
    for index, label in enumerate(result.curves):
        percent, band = (float(read("percent", curve=label, direction=freedom)) for read in (result.at, result.band))
        y = base + unit.factor * errors[index]
        lines += ax.plot(command.factor * x, y, label=f"{label} ", **curve_style(index, count, len(x)))
        if not round_off:
            half_band = unit.factor * np.abs(x) * scale[index] * band / 100.0
            look: dict[str, Any] = {"color": lines[-1].get_color(), "alpha": 0.3, "linewidth": 0, "zorder": 1.5}
            ax.fill_between(command.factor * x, y - half_band, y + half_band, **look)
        text = wrapped(f"{label}: {'error ' if displacement else ''}{banded(percent, band)}", LEGEND_WIDTH, size)
        texts.append(f" {text}" if text.startswith("_") else text)  # matplotlib hides labels that begin with _
    ax.margins(x=0.03)
    ax.grid()
    ax.set(ylabel=f"{quantity} in {NAMES[freedom]} ({unit})", xlabel=f"commanded {NAMES[result.direction]} ({command})")
    style.legend_beside(ax, handles=lines, labels=texts, fontsize=size, handlelength=4.4, labelspacing=0.6)
    if displacement:
        ax.text(0.99, 0.04, "grey: displacement = command", transform=ax.transAxes, ha="right", color=INK, size=9)
        return ax
    if half > 0:
        ax.set_ylim(-half * unit.factor, half * unit.factor)
    ax.locator_params(axis="y", nbins=7)
    if round_off:
        style.boxed(ax, 0.8, f"round-off only: largest {scientific(largest * unit.factor)} {unit}")
    return ax


def curve_style(index: int, curves: int, points: int) -> dict[str, Any]:
    """Line and marker properties of a curve; markers are staggered so that they do not hide each other."""
    step = max(1, points // 7)
    kinds = {"color": COLOURS, "linestyle": style.DASHES, "marker": style.MARKERS}
    return {key: values[index % len(values)] for key, values in kinds.items()} | {
        "markevery": (index * max(1, step // 2) % step, step),
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.2,
        "linewidth": THINNEST + min(1.0, (THICKEST - THINNEST) / max(1, curves - 1)) * (curves - 1 - index),
        "zorder": 2 + index / 100,
    }


@style.in_house_style
def budget_figure(budget: Budget) -> Figure:
    """Draw the error budget of the commanded direction, one panel per direction."""
    lines = [
        f"Error of the finite elements under the force by (18), {budget.settings['model']}, and its contributions, "
        "which add up to the total. Error bar: mesh band of the total.",
        _outside(budget),
    ]
    figure, axes = panels((WIDTH, 7.7), f"{budget.about.name}: error budget", lines, 3, assumptions=budget.about)
    for letter, ax, direction in zip("abc", axes, DIRECTIONS, strict=True):
        plot_budget(ax, budget, direction)
        titled(ax, letter, f"command in {NAMES[direction]}")
        ax.label_outer()
    return figure


def _outside(budget: Budget) -> str:
    """Sentence on the contributions that the planar total does not contain."""
    contributions = []
    for label in (CHART, MEASURED) if "solid" in budget.values else ():
        values, bands = budget.at("solid", outside=label), budget.band("solid", outside=label)
        parts = [
            f"{NAMES[axis]} {value:+.2f}" + (f" ± {band:.2f}" if band > 0 else "")
            for axis, value, band in zip(DIRECTIONS, values, bands, strict=True)
        ]
        if np.all(np.isfinite(values)):
            contributions.append(f"{label}: {minus(', '.join(parts))} percentage points")
    return f"Outside the planar total: {'; '.join(contributions) or 'out of plane, not known'}."


def plot_budget(ax: Axes, budget: Budget, direction: Direction) -> Axes:
    """Draw the shares of the error of the command in one direction, their total and its band; return `ax`.

    Raises BadInput for a direction other than x, y or theta.
    """
    values, names = budget.at("share", direction=direction), [*budget.axes["share"][:-1], "total"]
    band, total = float(budget.band("share", share=TOTAL, direction=direction)), float(values[-1])
    ends = np.concatenate([[0.0], np.cumsum(values[:-1])])
    reach = float(np.max(np.abs([*ends, total])))
    for row, value in enumerate(values[:-1]):
        look: dict[str, Any] = {"color": COLOURS[row % len(COLOURS)], "hatch": style.HATCHES[row % 7]}
        ax.barh(row, value, left=ends[row], height=0.62, edgecolor="white", **look)
        ax.plot([ends[row + 1]] * 2, [row - 0.31, row + 1.31], color=GREY, linewidth=0.8)
        ax.text(max(ends[row : row + 2]) + 0.015 * reach, row, minus(f"{value:+.3f}"), va="center", color=INK)
    bar = ax.barh(len(values) - 1, total, height=0.62, color=INK, xerr=band, ecolor=COLOURS[1], capsize=4)
    ax.bar_label(bar, [minus(f"{total:.3f} ± {band:.3f} %")], padding=3, color=INK)
    style.name_rows(ax, names, NAME_WIDTH)
    ax.set(xlim=(1.05 * min(0.0, *ends), 1.3 * reach), xlabel="error in the commanded direction (% of the command)")
    return ax


@style.in_house_style
def convergence_figure(study: MeshConvergence) -> Figure:
    """Draw the error of each diagonal compliance relative to its extrapolated value over the triangle size."""
    lines = [
        f"Platform compliance on {len(study.resolutions)} meshes, {study.unknowns[0]:.0f} to {study.unknowns[-1]:.0f} "
        "unknowns: relative difference from the value extrapolated to zero triangle size. "
        "Error bar: band of the finest mesh by its grid convergence index."
    ]
    title = f"{study.about.name}: mesh convergence"
    figure, (ax,) = panels((WIDTH, 4.8), title, lines, 1, assumptions=study.about)
    plot_convergence(ax, study)
    return figure


def plot_convergence(ax: Axes, study: MeshConvergence) -> Axes:
    """Draw the mesh error of each diagonal compliance, and its band on the finest mesh; return `ax`."""
    resolutions = study.resolutions
    size, largest = 1 / np.array(resolutions, dtype=float), 0.0
    for index, axis in enumerate(DIRECTIONS):
        limit, order = abs(float(study.extrapolated[index])), float(study.order[index])
        error = np.abs(study.at("along", direction=axis) / limit - 1)
        band = float(study.band("along", direction=axis)[-1]) / limit
        largest = max(largest, float(error[0]))
        look = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
        order_text = "no order" if np.isnan(order) else f"order {order:.2f}"
        text = f"{NAMES[axis]}: {study.verdicts[index]}, {order_text}, band {band:.1e}"
        ax.plot(size, error, label=wrapped(text, LEGEND_WIDTH, 8.5), **look)
        bar = [[max(0.0, band - error[-1])], [0.0]]
        ax.errorbar(size[-1:], [band], bar, color=look["color"], capsize=3 + 2 * index)
    slope = 2 * largest * (size / size[0]) ** ORDER
    ax.plot(size, slope, color=GREY, linewidth=0.9, dashes=(2, 2), label=f"order {ORDER}")
    ax.set(xscale="log", yscale="log", xlabel="triangle size at the necks / t", ylabel="relative mesh error")
    ax.set_xticks(size, [f"1/{n}" for n in resolutions])
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.minorticks_off()
    ax.grid()
    style.legend_beside(ax, handlelength=4.4)
    return ax
