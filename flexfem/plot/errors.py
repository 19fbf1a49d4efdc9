"""Figures of the errors of the analytic model: Figs. 5 to 7, error budgets as waterfalls, and mesh
convergence.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.paper.verification import Verification
from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, NAMES, panels, titled, wrapped
from flexfem.plot.text import banded, minus, scientific
from flexfem.questions.budget import CHART, MEASURED, SHARES, TOTAL, Budget
from flexfem.questions.convergence import MeshConvergence
from flexfem.questions.plates import MechanismErrors
from flexfem.results import number
from flexfem.units import DIRECTIONS, LENGTH, Direction, unit_for

ROUND_OFF = (
    1e-7  # per cent of the command: above the round-off of 1e5 equations, below any real error
)
THINNEST = 1.4
THICKEST = 3.4  # points: earlier curves are thicker, and so visible below later ones
WIDTH = 8.27  # in
LEGEND_WIDTH = 1.65
NAME_WIDTH = 2.1  # in, of a legend's text, and of the name of a share
DRIVES = {
    "force": "under the force of the analytic model, (18)",
    "joints": "with the joint rotations of the analytic model, (29)",
    "strokes": "with the strokes of the analytic model, (29)",
}
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@style.in_house_style
def error_figure(result: Verification, displacement: bool = False) -> Figure:
    """Draw a verification as one page with a panel for every direction: Figs. 5 to 7 of the paper.

    `displacement` : in the commanded direction draw the displacement, as the captions of Figs. 5(a)
    and 7(c) state, not its error. Below the panels, a line names the cross directions without
    error, which have no panel."""
    quantity = (
        "in the commanded direction, its error across"
        if displacement
        else "minus commanded displacement"
    )
    drive = (
        "large displacements in both models"
        if result.analysis == "nonlinear"
        else DRIVES[result.drive]
    )
    solid = result.elements == "three_dimensional"
    where, band = (
        (" in three dimensions", "band of mesh and layers") if solid else ("", "mesh band")
    )
    zero = [
        each
        for each in DIRECTIONS
        if each != result.direction and not np.any(percentages(result, each))
    ]
    shown = [each for each in DIRECTIONS if each not in zero]
    levers = ", ".join(
        f"{lever:g}" for lever in sorted({model.lever for model in result.models.values()})
    )
    rotations = (
        f" Rotations are multiplied by l₃ = {levers} {LENGTH}."
        if "theta" in (result.direction, *shown)
        else ""
    )
    lines = [
        f"Finite-element displacement{where} {quantity}, {drive}.",
        f"100 %: largest commanded motion.{rotations} ±, shaded: {band}.",
    ]
    figure, axes = panels(
        (WIDTH, 2.6 * len(shown) + 0.8), result.name, lines, len(shown), assumptions=result
    )
    for letter, ax, freedom in zip("abc", axes, shown, strict=False):
        along = freedom == result.direction
        titled(ax, letter, f"{NAMES[freedom]}, {'commanded' if along else 'cross'} direction")
        plot_errors(ax, result, freedom, along and displacement)
        ax.label_outer()
    if zero:
        names = " and ".join(NAMES[each] for each in zero)
        plural = "s" * (len(zero) - 1)
        text = f"Cross direction{plural} {names}: zero error (below 10⁻⁹ of the commanded motion)."
        figure.supxlabel(text, x=style.MARGIN / WIDTH, ha="left", size=9.5, color=INK)
    figure.align_ylabels()
    return figure


@style.in_house_style
def mechanism_figure(result: MechanismErrors) -> Figure:
    """Draw the errors of the analytic networks of a mechanism, a panel for every direction that is
    not held.
    """
    lines = [
        "Motion of finite elements minus that of the analytic network, by the force or moment "
        "along the command alone.",
        f"100 %: commanded motion. Rotations are multiplied by {float(result.lever):.4g} "
        f"{LENGTH}. ±: band.",
    ]
    title = f"{result.about.name}: positioning errors"
    moved = [axis for axis in DIRECTIONS if np.isfinite(result.at("percent", commanded=axis)).any()]
    figure, axes = panels(
        (WIDTH, 1.2 + 2.0 * len(moved)), title, lines, len(moved), assumptions=result.about
    )
    for letter, ax, commanded in zip("abc", axes, moved, strict=False):
        plot_mechanism_errors(ax, result, commanded)
        titled(ax, letter, f"command in {NAMES[commanded]}")
        ax.label_outer()
    style.share_x(axes)
    style.legend_below(figure, axes, 2)
    return figure


def plot_mechanism_errors(ax: Axes, result: MechanismErrors, commanded: Direction) -> Axes:
    """Draw the errors along and across a commanded direction, a bar for every analytic model;
    return `ax`.
    """
    models = result.axes["model"]
    height = 0.8 / len(models)
    ends = [0.0]
    for index, model in enumerate(models):
        values, bands = (
            read("percent", model=model, commanded=commanded) for read in (result.at, result.band)
        )
        rows = np.arange(len(DIRECTIONS)) + (index - (len(models) - 1) / 2) * height
        ax.barh(
            rows,
            values,
            height=height,
            color=COLOURS[index],
            xerr=bands,
            ecolor=GREY,
            capsize=3,
            label=model,
        )
        for row, value, band in zip(rows, values.tolist(), bands.tolist(), strict=True):
            ax.text(
                max(0.0, value) + band,
                row,
                f"  {minus(number(value, band))}",
                va="center",
                color=INK,
                size=8,
            )
        ends += [*(values - bands), *(values + bands)]
    style.name_rows(ax, [f"error in {NAMES[each]}" for each in DIRECTIONS], NAME_WIDTH)
    room = max(ends) - min(ends)
    ax.set(
        xlim=(min(ends) - 0.05 * room, max(ends) + 0.25 * room),
        xlabel="error, % of the commanded motion",
    )
    return ax


def percentages(result: Verification, freedom: Direction) -> Array:
    """Return the errors (curves, points) in one direction in per cent of the largest command,
    round-off as zero.
    """
    levers = np.array([result.models[label].lever for label in result.curves])
    comparable = levers ** (
        (freedom == "theta") - float(result.direction == "theta")
    )  # rotations as lengths
    errors = (
        100
        * result.at("error", direction=freedom)
        * comparable[:, None]
        / np.max(np.abs(result.commanded))
    )
    return np.where(np.abs(errors).max(axis=1, keepdims=True) < ROUND_OFF, 0.0, errors)


def plot_errors(
    ax: Axes, result: Verification, freedom: Direction, displacement: bool = False
) -> Axes:
    """Draw the errors of every curve in one direction over the command, with their mesh bands;
    return `ax`.

    The legend beside the axes states the percentages at the largest command. `displacement` : draw
    the displacement in the commanded direction instead, and the command in grey."""
    x = np.array(result.commanded)
    errors = percentages(result, freedom)
    amplitude = float(np.max(np.abs(x)))
    unit = unit_for(result.direction, amplitude)
    per_cent = unit.factor * amplitude / 100 if displacement else 1.0
    base = unit.factor * x if displacement else 0.0 * x
    x = unit.factor * x
    ax.plot(x, base, color=GREY, linewidth=0.8, zorder=1, label="_command")
    size = 9.0 if len(errors) < 5 else 6.5 if len(errors) < 9 else 5.0
    count = len(errors)
    lines = []
    texts = []
    for index, label in enumerate(result.curves):
        percent, band = (
            float(read("percent", curve=label, direction=freedom))
            for read in (result.at, result.band)
        )
        y = base + per_cent * errors[index]
        lines += ax.plot(x, y, label=f"{label} ", **curve_style(index, count, len(x)))
        if np.any(errors[index]):
            half_band = per_cent * band * np.abs(x) / np.max(np.abs(x))
            look: dict[str, Any] = {
                "color": lines[-1].get_color(),
                "alpha": 0.3,
                "linewidth": 0,
                "zorder": 1.5,
            }
            ax.fill_between(x, y - half_band, y + half_band, **look)
        text = wrapped(
            f"{label}: {'error ' if displacement else ''}{banded(percent, band)}",
            LEGEND_WIDTH,
            size,
        )
        texts.append(
            f" {text}" if text.startswith("_") else text
        )  # matplotlib hides labels that begin with _
    ax.margins(x=0.03)
    ax.grid()
    ax.set_xlabel(f"commanded {NAMES[result.direction]} ({unit})")
    ax.set_ylabel("Positioning error,\n% of the commanded motion")
    style.legend_beside(
        ax, handles=lines, labels=texts, fontsize=size, handlelength=4.4, labelspacing=0.6
    )
    if displacement:
        ax.set_ylabel(f"displacement in {NAMES[freedom]} ({unit})")
        ax.text(
            0.99,
            0.04,
            "grey: displacement = command",
            transform=ax.transAxes,
            ha="right",
            color=INK,
            size=9,
        )
        return ax
    half = 1.1 * float(np.max(np.abs(errors))) or 1.0
    ax.set_ylim(-half, half)
    ax.locator_params(axis="y", nbins=7)
    return ax


def curve_style(index: int, curves: int, points: int) -> dict[str, Any]:
    """Line and marker properties of a curve; markers are staggered so that they do not hide each
    other.
    """
    step = max(1, points // 7)
    kinds = {"color": COLOURS, "linestyle": style.DASHES, "marker": style.MARKERS}
    return {key: values[index % len(values)] for key, values in kinds.items()} | {
        "markevery": (index * max(1, step // 2) % step, step),
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.2,
        "linewidth": THINNEST
        + min(1.0, (THICKEST - THINNEST) / max(1, curves - 1)) * (curves - 1 - index),
        "zorder": 2 + index / 100,
    }


@style.in_house_style
def budget_figure(budget: Budget) -> Figure:
    """Draw the error budget of the commanded direction, one panel per direction."""
    lines = [
        "Error of the finite elements under the force of the analytic model, (18): "
        f"{budget.settings['model']}. Each bar begins where the previous one ends. Blue increases "
        "the error, orange decreases it. ±: mesh bands."
    ]
    figure, axes = panels(
        (WIDTH, 8.6), f"{budget.about.name}: error budget", lines, 3, assumptions=budget.about
    )
    for letter, ax, direction in zip("abc", axes, DIRECTIONS, strict=True):
        plot_budget(ax, budget, direction)
        titled(ax, letter, f"command in {NAMES[direction]}")
        ax.label_outer()
    style.share_x(axes)
    return figure


def plot_budget(ax: Axes, budget: Budget, direction: Direction) -> Axes:
    """Draw the shares of the error of the command in one direction, their sums and the bands of
    these; return `ax`.

    The effect of three dimensions follows the total in the plane where it is known: by finite
    elements, or else by the hinge chart. Raises BadInput for a direction other than x, y or theta.
    """
    shares = budget.at("share", direction=direction)[:-1]
    total = budget.at("share", direction=direction)[-1]
    band = float(budget.band("share", share=TOTAL, direction=direction))
    rows = [(name, value, 0.0) for name, value in zip(SHARES, shares.tolist(), strict=True)]
    rows.append(("total in the plane", float(total), band))
    for label in (MEASURED, CHART) if "solid" in budget.values else ():
        value, width = (
            float(read("solid", outside=label, direction=direction))
            for read in (budget.at, budget.band)
        )
        if np.isfinite(value):
            rows.append(("effect of three dimensions", value, float(np.nan_to_num(width))))
            rows += (
                [("total in three dimensions", float(total) + value, band + width)]
                if width > 0
                else []
            )
            break
    start = 0.0
    ends = [0.0]
    places = int(max(-np.floor(np.log10(band)), 0))
    for row, (name, value, width) in enumerate(rows):
        whole = name.startswith("total")
        start = 0.0 if whole else start
        colour = INK if whole else COLOURS[int(value < 0)]
        ax.barh(
            row,
            value,
            left=start,
            height=0.62,
            color=colour,
            xerr=width or None,
            ecolor=GREY,
            capsize=4,
        )
        text = minus(number(value, width) if width else f"{value:+.{places}f}")
        ax.text(max(start, start + value) + width, row, f"  {text}", va="center", color=INK)
        start += value
        ends.append(start)
        if row < len(rows) - 1:
            ax.plot([start] * 2, [row - 0.31, row + 1.31], color=GREY, linewidth=0.8)
    style.name_rows(ax, [name for name, *_ in rows], NAME_WIDTH)
    low = min(ends)
    high = max(ends)
    ax.set(
        xlim=(low - 0.05 * (high - low), high + 0.3 * (high - low)),
        xlabel="error, % of the commanded motion",
    )
    return ax


@style.in_house_style
def convergence_figure(study: MeshConvergence) -> Figure:
    """Draw the error of each diagonal compliance relative to its extrapolated value over the
    triangle size.
    """
    lines = [
        f"Compliance on {len(study.resolutions)} meshes, {study.unknowns[0]:.0f} to "
        f"{study.unknowns[-1]:.0f} unknowns: relative difference from the value extrapolated to "
        "zero triangle size. Error bar: band of the finest mesh by its grid convergence index."
    ]
    title = f"{study.about.name}: mesh convergence"
    return style.page(
        (WIDTH, 4.8), title, lines, partial(plot_convergence, study=study), study.about
    )


def plot_convergence(ax: Axes, study: MeshConvergence) -> Axes:
    """Draw the mesh error of each diagonal compliance, and its band on the finest mesh; return
    `ax`.
    """
    resolutions = study.resolutions
    size = 1 / np.array(resolutions, dtype=float)
    largest = 0.0
    for index, axis in enumerate(DIRECTIONS):
        limit = abs(float(study.extrapolated[index]))
        order = float(study.order[index])
        error = np.abs(study.at("along", direction=axis) / limit - 1)
        band = float(study.band("along", direction=axis)[-1]) / limit
        largest = max(largest, float(error[0]))
        look = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
        order_text = "no order" if np.isnan(order) else f"order {order:.2f}"
        text = f"{NAMES[axis]}: {study.verdicts[index]}, {order_text}, band {scientific(band, 2)}"
        ax.plot(size, error, label=wrapped(text, LEGEND_WIDTH, 8.5), **look)
        bar = [[max(0.0, band - error[-1])], [0.0]]
        ax.errorbar(size[-1:], [band], bar, color=look["color"], capsize=3 + 2 * index)
    slope = 2 * largest * (size / size[0]) ** ORDER
    ax.plot(size, slope, color=GREY, linewidth=0.9, dashes=(2, 2), label=f"order {ORDER}")
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="triangle size / neck width",
        ylabel="relative error of the compliance",
    )
    ax.set_xticks(size, [f"1/{n}" for n in resolutions])
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.minorticks_off()
    ax.grid()
    style.legend_beside(ax, handlelength=4.4)
    return ax
