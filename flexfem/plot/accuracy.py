"""How good numbers are: error budgets as waterfalls, and mesh errors."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.files.refusals import shown
from flexfem.plot.curves import COLOURS, NAMES, curve_style
from flexfem.plot.style import GREY, INK, in_house_style, legend_beside, panels, wrapped
from flexfem.plot.text import scientific
from flexfem.questions.budget import CHART, MEASURED, TOTAL, Budget
from flexfem.questions.convergence import MeshConvergence
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, Direction

WIDTH, NAME = 8.27, 2.1  # in, of a figure, and of the name of a share
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")
MINUS = "\N{MINUS SIGN}"
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@in_house_style
def budget_figure(budget: Budget) -> Figure:
    """Draw the shares of the error in the commanded direction, one panel a direction."""
    lines = [
        f"Error of the finite elements under the force of (18), {budget.settings['model']}, and what it is made of. "
        "The shares add up to the total; the bar there is the band of the meshes.",
        _outside(budget),
    ]
    doubts = (budget.about.assumed, budget.about.not_stated)
    figure, found = panels((WIDTH, 7.7), f"{budget.about.name}: error budget", lines, 3, doubts=doubts)
    for row, (axes, direction) in enumerate(zip(found, DIRECTIONS, strict=True)):
        axes.set_title(f"({'abc'[row]}) command in {NAMES[direction]}", loc="left")
        plot_budget(axes, budget, direction)
        if row < 2:
            axes.set_xlabel("")
    return figure


def _outside(budget: Budget) -> str:
    """What is outside the planar total, in words."""
    said = []
    for label in (CHART, MEASURED):
        values, bands = budget.at("solid", outside=label), budget.band("solid", outside=label)
        parts = [
            f"{NAMES[axis]} {value:+.2f}" + (f" ± {band:.2f}" if band > 0 else "")
            for axis, value, band in zip(DIRECTIONS, values, bands, strict=True)
        ]
        if np.all(np.isfinite(values)):
            said.append(f"{label}: {', '.join(parts).replace('-', MINUS)} percentage points")
    return f"Outside the planar total: {'; '.join(said) or 'out of plane, not known'}."


def plot_budget(ax: Axes, budget: Budget, direction: Direction) -> Axes:
    """Draw the shares of the error of the command in one direction, their total and its band; returns `ax`.

    Raises BadInput for another direction than x, y or theta.
    """
    if direction not in DIRECTIONS:
        raise BadInput(f"direction {shown(direction)}, expected one of {', '.join(DIRECTIONS)}")
    *values, total = budget.at("share", direction=direction).tolist()
    band = float(budget.band("share", share=TOTAL, direction=direction))
    ends = np.cumsum(values)
    starts = ends - values
    places = np.arange(len(values) + 1)
    for place, (start, value) in enumerate(zip(starts, values, strict=True)):
        colour, hatch = COLOURS[place % len(COLOURS)], HATCHES[place % len(HATCHES)]
        ax.barh(place, value, left=start, height=0.62, color=colour, hatch=hatch, edgecolor="white")
        ax.plot([start + value] * 2, [place - 0.31, place + 1.31], color=GREY, linewidth=0.8)
    ax.barh(places[-1], total, height=0.62, color=INK, xerr=band, ecolor=COLOURS[1], capsize=4)
    reach = float(np.max(np.abs([*starts, *ends, total])))
    for place, (end, text) in enumerate(
        [(max(s, e), f"{v:+.3f}") for s, e, v in zip(starts, ends, values, strict=True)]
        + [(max(total, 0.0) + band, f"{total:.3f} ± {band:.3f} %")]
    ):
        ax.text(end + 0.015 * reach, place, text.replace("-", MINUS), va="center", color=INK)
    names = [wrapped(name, NAME, 8.5) for name in budget.axes["share"][:-1]]
    ax.set_yticks(places, [*names, "total"])
    ax.invert_yaxis()
    low = min(0.0, float(np.min([*starts, *ends])))
    ax.set(xlim=(1.05 * low, 1.3 * reach), xlabel="error in the commanded direction (per cent of the command)")
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.grid(axis="x")
    return ax


@in_house_style
def convergence_figure(study: MeshConvergence) -> Figure:
    """Draw the relative distance of each diagonal compliance from its extrapolated value over the triangle size."""
    lines = [
        f"Platform compliance on {len(study.resolutions)} meshes, {study.unknowns[0]:.0f} to {study.unknowns[-1]:.0f} "
        "unknowns: distance from the value extrapolated to vanishing triangles. "
        "Bar: the band of the finest mesh by its grid convergence index."
    ]
    doubts = (study.about.assumed, study.about.not_stated)
    figure, (axes,) = panels((WIDTH, 4.8), f"{study.about.name}: mesh convergence", lines, 1, doubts=doubts)
    plot_convergence(axes, study)
    return figure


def plot_convergence(ax: Axes, study: MeshConvergence) -> Axes:
    """Draw the mesh error of each diagonal compliance, and its band on the finest mesh; returns `ax`."""
    size = 1 / np.array(study.resolutions, dtype=float)
    for index, axis in enumerate(DIRECTIONS):
        values, limit = study.at("along", direction=axis), abs(float(study.extrapolated[index]))
        distance, spread = np.abs(values / limit - 1), float(study.band("along", direction=axis)[-1]) / limit
        style = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
        order = "no order" if np.isnan(study.order[index]) else f"order {study.order[index]:.2f}"
        text = f"{NAMES[axis]}: {study.verdicts[index]}, {order}, band {spread:.1e}"
        ax.plot(size, distance, label=wrapped(text, 1.6, 8.5), **style)
        ax.errorbar(
            size[-1:], [spread], [[max(0.0, spread - distance[-1])], [0.0]], color=style["color"], capsize=3 + 2 * index
        )
    largest = float(np.max(np.abs(study.along[0] / study.extrapolated - 1)))
    slope = 2 * largest * (size / size[0]) ** ORDER
    ax.plot(size, slope, color=GREY, linewidth=0.9, dashes=(2, 2), label=f"order {ORDER}")
    ax.set(xscale="log", yscale="log", xlabel="triangle size at the necks / t", ylabel="relative mesh error")
    ax.set_xticks(size, [f"1/{n}" for n in study.resolutions])
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.minorticks_off()
    ax.grid()
    legend_beside(ax, handlelength=4.4)
    return ax
