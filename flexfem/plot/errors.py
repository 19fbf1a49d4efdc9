"""Figures of the errors of the analytic models of a mechanism, and of mesh convergence."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.plot import style
from flexfem.plot.style import COLOURS, GREY, INK, MODEL_COLOURS, NAMES, panels, titled, wrapped
from flexfem.plot.text import minus, scientific, typeset
from flexfem.questions.budget import Budget
from flexfem.questions.convergence import MeshConvergence
from flexfem.questions.errors import MechanismErrors
from flexfem.results import number
from flexfem.results.render import SMALLEST_PERCENTAGE
from flexfem.units import DIRECTIONS, LENGTH, Direction

THINNEST = 1.4  # points, of curves
THICKEST = 3.4  # points: earlier curves are thicker, and so visible below later ones
WIDTH = 8.27  # in
LEGEND_WIDTH = 1.65  # in, of the text of a legend
NAME_WIDTH = 2.1  # in, of the name of a row
BESIDE = 7  # points, from the end of a bar to its number
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@style.in_house_style
def mechanism_figure(result: MechanismErrors) -> Figure:
    """Draw the errors of the analytic networks, a panel for every direction that is not held."""
    lines = [
        "Motion of finite elements minus that of the analytic network, by the force or moment "
        "along the command alone.",
        f"100 %: commanded motion. Rotations are multiplied by {float(result.lever):.4g} "
        f"{LENGTH}. ±: band.",
    ]
    title = f"{result.about.name}: positioning errors"
    moved = [axis for axis in DIRECTIONS if np.isfinite(result.at("percent", commanded=axis)).any()]
    size = (WIDTH, 1.2 + 2.0 * len(moved))
    figure, axes = panels(size, title, lines, len(moved), assumptions=result.about)
    for letter, ax, commanded in zip("abc", axes, moved, strict=False):
        plot_mechanism_errors(ax, result, commanded)
        titled(ax, letter, f"command in {NAMES[commanded]}")
        ax.label_outer()
    style.share_x(axes)
    style.legend_below(figure, axes, 2)
    return figure


def plot_mechanism_errors(
    ax: Axes,
    result: MechanismErrors,
    commanded: Direction,
) -> Axes:
    """Draw the errors along and across a command, a bar for every analytic model; return `ax`."""
    models = result.axes["model"]
    height = 0.8 / len(models)
    ends = [0.0]
    for index, model in enumerate(models):
        values = result.at("percent", model=model, commanded=commanded)
        bands = result.band("percent", model=model, commanded=commanded)
        rows = np.arange(len(DIRECTIONS)) + (index - (len(models) - 1) / 2) * height
        bars: dict[str, Any] = {"height": 0.9 * height, "label": model}
        bars["color"] = MODEL_COLOURS.get(model, COLOURS[-1 - index])
        ax.barh(rows, values, xerr=bands, ecolor=GREY, capsize=3, **bars)
        for row, value, band in zip(rows, values.tolist(), bands.tolist(), strict=True):
            _write_beside(ax, max(0.0, value) + band, row, percentage(value, band))
        ends += [*(values - bands), *(values + bands)]
    style.name_rows(ax, [f"error in {NAMES[each]}" for each in DIRECTIONS], NAME_WIDTH)
    room = max(ends) - min(ends)
    ax.set_xlim(min(ends) - 0.05 * room, max(ends) + 0.25 * room)
    ax.set_xlabel("error, % of the commanded motion")
    return ax


def percentage(value: float, band: float) -> str:
    """Return the text of a percentage with its band, "0" where both are round-off as in tables."""
    if abs(value) + np.nan_to_num(band) < SMALLEST_PERCENTAGE:
        return "0"
    return typeset(number(value, band))


def _write_beside(
    ax: Axes,
    end: float,
    row: float,
    text: str,
) -> None:
    """Write a number to the right of the end of a bar and of its error bar."""
    place: dict[str, Any] = {"textcoords": "offset points", "va": "center", "color": INK, "size": 8}
    ax.annotate(text, (end, row), (BESIDE, 0), **place)


class WaterfallBar(NamedTuple):
    """A bar of a waterfall: its name, its value and its band, in per cent.

    band : 0 where it is unknown.
    is_total : whether it begins at zero, not at the end of the previous bar.
    """

    name: str
    value: float
    band: float
    is_total: bool = False


def plot_steps(
    ax: Axes,
    steps: Sequence[WaterfallBar],
    places: int,
) -> Axes:
    """Draw a waterfall of shares and their sums, with decimal places without a band; return `ax`."""
    ends = [0.0]
    for row, step in enumerate(steps):
        start = 0.0 if step.is_total else ends[-1]
        end = start + step.value
        ends.append(end)
        look: dict[str, Any] = {"height": 0.62, "ecolor": GREY, "capsize": 4}
        look["color"] = INK if step.is_total else COLOURS[int(step.value < 0)]
        ax.barh(row, step.value, left=start, xerr=step.band or None, **look)
        text = percentage(step.value, step.band)
        if not step.band and text != "0":
            text = minus(f"{step.value:+.{places}f}")
        _write_beside(ax, max(start, end) + step.band, row, text)
        if row < len(steps) - 1:
            ax.plot([end] * 2, [row - 0.31, row + 1.31], color=GREY, linewidth=0.8)
    style.name_rows(ax, [step.name for step in steps], NAME_WIDTH)
    room = max(ends) - min(ends)
    ax.set_xlim(min(ends) - 0.05 * room, max(ends) + 0.3 * room)
    ax.set_xlabel("error, % of the commanded motion")
    return ax


@style.in_house_style
def budget_figure(found: Budget) -> Figure:
    """Draw the error budget of a mechanism, a panel for every direction that is not held."""
    lines = [
        "Shares of the error of the network with rigid bodies against finite elements of the "
        "whole mechanism. Each bar begins where the previous one ends. Blue increases the error, "
        "orange decreases it. ±: band."
    ]
    title = f"{found.about.name}: error budget"
    moved = [axis for axis in DIRECTIONS if np.isfinite(found.at("share", direction=axis)).all()]
    size = (WIDTH, 0.6 + len(moved) * (0.3 * len(found.axes["share"]) + 0.6))
    figure, axes = panels(size, title, lines, len(moved), assumptions=found.about)
    for letter, ax, commanded in zip("abc", axes, moved, strict=False):
        plot_shares_of_error(ax, found, commanded)
        titled(ax, letter, f"command in {NAMES[commanded]}")
    return figure


def plot_shares_of_error(
    ax: Axes,
    found: Budget,
    commanded: Direction,
) -> Axes:
    """Draw the shares of the error of a mechanism along a command, and their sum; return `ax`."""
    names = found.axes["share"]
    values = found.at("share", direction=commanded).tolist()
    bands = np.nan_to_num(found.band("share", direction=commanded)).tolist()
    steps = [
        WaterfallBar(name, value, band, name == names[-1])
        for name, value, band in zip(names, values, bands, strict=True)
    ]
    largest = float(np.max(np.abs(values)))
    return plot_steps(ax, steps, int(np.clip(2 - np.floor(np.log10(largest or 1.0)), 0, 3)))


def curve_style(
    index: int,
    curves: int,
    points: int,
) -> dict[str, Any]:
    """Return line and marker properties of a curve.

    Markers are staggered so that they do not hide each other.
    """
    step = max(1, points // 7)
    first = index * max(1, step // 2) % step
    step_of_width = min(1.0, (THICKEST - THINNEST) / max(1, curves - 1))
    return {
        "color": COLOURS[index % len(COLOURS)],
        "linestyle": style.DASHES[index % len(style.DASHES)],
        "linewidth": THINNEST + step_of_width * (curves - 1 - index),
        "marker": style.MARKERS[index % len(style.MARKERS)],
        "markevery": (first, step),
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.2,
        "zorder": 2 + index / 100,
    }


@style.in_house_style
def convergence_figure(study: MeshConvergence) -> Figure:
    """Draw the relative error of each diagonal compliance over the triangle size.

    It is relative to the extrapolated value.
    """
    lines = [
        f"Compliance on {len(study.resolutions)} meshes, {study.unknowns[0]:.0f} to "
        f"{study.unknowns[-1]:.0f} unknowns: relative difference from the value extrapolated to "
        "zero triangle size. Error bar: band of the finest mesh by its grid convergence index."
    ]
    title = f"{study.about.name}: mesh convergence"
    plot = partial(plot_convergence, study=study)
    return style.page((WIDTH, 4.8), title, lines, plot, study.about)


def plot_convergence(ax: Axes, study: MeshConvergence) -> Axes:
    """Draw the mesh error of each diagonal compliance, and its band on the finest mesh.

    Returns `ax`.
    """
    size = 1 / np.array(study.resolutions, dtype=float)
    largest = 0.0
    for index in range(len(DIRECTIONS)):
        first_error = _plot_direction(ax, study, index, size)
        largest = max(largest, first_error)
    slope = 2 * largest * (size / size[0]) ** ORDER
    ax.plot(
        size,
        slope,
        color=GREY,
        linewidth=0.9,
        dashes=(2, 2),
        label=f"order {ORDER}",
    )
    ax.set(xscale="log", yscale="log")
    ax.set(xlabel="triangle size / neck width", ylabel="relative error of the compliance")
    ax.set_xticks(size, [f"1/{n}" for n in study.resolutions])
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))
    ax.minorticks_off()
    ax.grid()
    style.legend_beside(ax, handlelength=4.4)
    return ax


def _plot_direction(
    ax: Axes,
    study: MeshConvergence,
    index: int,
    size: Any,
) -> float:
    """Draw the errors of one diagonal compliance; return that on the coarsest mesh."""
    axis = DIRECTIONS[index]
    limit = abs(float(study.extrapolated[index]))
    order = float(study.order[index])
    error = np.abs(study.at("along", direction=axis) / limit - 1)
    band = float(study.band("along", direction=axis)[-1]) / limit
    order_text = "no order" if np.isnan(order) else f"order {order:.2f}"
    text = f"{NAMES[axis]}: {study.verdicts[index]}, {order_text}, band {scientific(band, 2)}"
    look = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
    ax.plot(size, error, label=wrapped(text, LEGEND_WIDTH, 8.5), **look)
    bar = [[max(0.0, band - error[-1])], [0.0]]
    ax.errorbar(size[-1:], [band], bar, color=look["color"], capsize=3 + 2 * index)
    return float(error[0])
