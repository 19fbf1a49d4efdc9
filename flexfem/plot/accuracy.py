"""How good numbers are: error budgets as waterfalls, and mesh errors."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.files.refusals import shown
from flexfem.plot.curves import COLOURS, NAMES, curve_style
from flexfem.plot.style import GREY, INK, in_house_style, legend_beside, panels, wrapped
from flexfem.plot.text import scientific
from flexfem.refused import BadInput
from flexfem.verify.budget import Budget
from flexfem.verify.case import DIRECTIONS, Direction
from flexfem.verify.converge import MeshStudy

WIDTH, NAME = 8.27, 2.1  # in, of a figure, and of the name of a share
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")
MINUS = "\N{MINUS SIGN}"
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@in_house_style
def budget_figure(budget: Budget) -> Figure:
    """Draw the shares of the error in the commanded direction, one panel a direction."""
    lines = [
        f"Error of the finite elements under the force of (18), mobility {budget.mobility}, {budget.formula}, and what "
        "it is made of. The shares add up to the total; the bar there is the band of the meshes.",
        _outside(budget),
    ]
    doubts = (budget.assumed, budget.not_stated)
    figure, found = panels((WIDTH, 7.7), f"{budget.stage}: error budget", lines, 3, doubts=doubts)
    for row, (axes, direction) in enumerate(zip(found, DIRECTIONS, strict=True)):
        axes.set_title(f"({'abc'[row]}) command in {NAMES[direction]}", loc="left")
        plot_budget(axes, budget, direction)
        if row < 2:
            axes.set_xlabel("")
    return figure


def _outside(budget: Budget) -> str:
    """What is outside the planar total, in words."""
    charted = {axis: split.out_of_plane for axis, split in budget.split.items()}
    plane, solid = budget.plane.replace("_", " "), budget.three_dimensional
    said = "Outside the planar total, three-dimensional necks"
    by_chart = ", ".join(f"{NAMES[axis]} {getattr(share, axis):+.2f}" for axis, share in charted.items() if share)
    by_chart = by_chart.replace("-", MINUS) + " percentage points"
    known = all(share is not None for share in charted.values())
    if solid is None:
        unknown = "Outside the planar total: out of plane, not known, a hinge is not on the thickness chart."
        return f"{said} against {plane}: {by_chart}." if known else unknown
    found = ", ".join(
        f"{NAMES[axis]} {getattr(solid.points[axis], axis):+.2f} ± {solid.band[axis]:.2f}" for axis in budget.split
    ).replace("-", MINUS)
    if known:
        return f"{said} against {plane}: {by_chart} by the chart; measured on the stage: {found}."
    return f"Outside the planar total, three dimensions against {plane}, measured: {found} percentage points."


def plot_budget(ax: Axes, budget: Budget, direction: Direction) -> Axes:
    """Draw the shares of the error of the command in one direction, their total and its band; returns `ax`.

    Raises BadInput for another direction than x, y or theta.
    """
    if direction not in DIRECTIONS:
        raise BadInput(f"direction {shown(direction)}, expected one of {', '.join(DIRECTIONS)}")
    split = budget.split[direction]
    values = np.array([getattr(share.points, direction) for share in split.shares])
    total = float(getattr(split.total, direction))
    ends = np.cumsum(values)
    starts = ends - values
    places = np.arange(len(values) + 1)
    for place, (start, value) in enumerate(zip(starts, values, strict=True)):
        colour, hatch = COLOURS[place % len(COLOURS)], HATCHES[place % len(HATCHES)]
        ax.barh(place, value, left=start, height=0.62, color=colour, hatch=hatch, edgecolor="white")
        ax.plot([start + value] * 2, [place - 0.31, place + 1.31], color=GREY, linewidth=0.8)
    ax.barh(places[-1], total, height=0.62, color=INK, xerr=split.band, ecolor=COLOURS[1], capsize=4)
    reach = float(np.max(np.abs([*starts, *ends, total])))
    for place, (end, text) in enumerate(
        [(max(s, e), f"{v:+.3f}") for s, e, v in zip(starts, ends, values, strict=True)]
        + [(max(total, 0.0) + split.band, f"{total:.3f} ± {split.band:.3f} %")]
    ):
        ax.text(end + 0.015 * reach, place, text.replace("-", MINUS), va="center", color=INK)
    names = [wrapped(share.name, NAME, 8.5) for share in split.shares]
    ax.set_yticks(places, [*names, "total"])
    ax.invert_yaxis()
    low = min(0.0, float(np.min([*starts, *ends])))
    ax.set(xlim=(1.05 * low, 1.3 * reach), xlabel="error in the commanded direction (per cent of the command)")
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.grid(axis="x")
    return ax


@in_house_style
def convergence_figure(study: MeshStudy) -> Figure:
    """Draw the relative distance of each diagonal compliance from its extrapolated value over the triangle size."""
    lines = [
        f"Platform compliance on {len(study.resolutions)} meshes, {study.unknowns[0]} to {study.unknowns[-1]} "
        "unknowns: distance from the value extrapolated to vanishing triangles. "
        "Bar: the band of the finest mesh by its grid convergence index."
    ]
    doubts = (study.assumed, study.not_stated)
    figure, (axes,) = panels((WIDTH, 4.8), f"{study.stage}: mesh convergence", lines, 1, doubts=doubts)
    plot_convergence(axes, study)
    return figure


def plot_convergence(ax: Axes, study: MeshStudy) -> Axes:
    """Draw the mesh error of each diagonal compliance, and its band on the finest mesh; returns `ax`."""
    size = 1 / np.array(study.resolutions, dtype=float)
    for index, axis in enumerate(DIRECTIONS):
        found = study.uncertainty[axis]
        distance = np.abs(np.array(found.values) / found.extrapolated - 1)
        style = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
        order = "no order" if found.observed is None else f"order {found.observed:.2f}"
        text = f"{NAMES[axis]}: {found.verdict}, {order}, band {found.band / abs(found.extrapolated):.1e}"
        ax.plot(size, distance, label=wrapped(text, 1.6, 8.5), **style)
        spread = found.band / abs(found.extrapolated)
        ax.errorbar(
            size[-1:], [spread], [[max(0.0, spread - distance[-1])], [0.0]], color=style["color"], capsize=3 + 2 * index
        )
    largest = max(np.abs(u.values[0] / u.extrapolated - 1) for u in study.uncertainty.values())
    slope = 2 * largest * (size / size[0]) ** ORDER
    ax.plot(size, slope, color=GREY, linewidth=0.9, dashes=(2, 2), label=f"order {ORDER}")
    ax.set(xscale="log", yscale="log", xlabel="triangle size at the necks / t", ylabel="relative mesh error")
    ax.set_xticks(size, [f"1/{n}" for n in study.resolutions])
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.minorticks_off()
    ax.grid()
    legend_beside(ax, handlelength=4.4)
    return ax
