"""The error budget of a stage as waterfalls: from the paper's model to the finite elements, share by share."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.plot.curves import COLOURS, NAMES
from flexfem.plot.style import GREY, INK, add_axes, header, in_house_style, new_figure, wrapped
from flexfem.verify.budget import Budget, Split
from flexfem.verify.case import DIRECTIONS, Direction

WIDTH, HEIGHT, LEFT, GAP = 8.27, 8.6, 2.55, 0.62  # in
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "+++", "ooo")


@in_house_style
def budget_figure(budget: Budget) -> Figure:
    """Draw the shares of the error in the commanded direction, one panel a direction."""
    figure = new_figure(WIDTH, HEIGHT)
    lines = [
        f"Error of the finite elements under the force of (18), mobility {budget.mobility}, {budget.formula}, and what "
        "it is made of. The shares add up to the total; the bar there is the band of the meshes.",
        _outside(budget),
    ]
    top = HEIGHT - header(figure, f"{budget.stage}: error budget", lines, budget.assumed, budget.not_stated) - 0.3
    height = (top - 0.6 - 2 * GAP) / 3
    for row, direction in enumerate(DIRECTIONS):
        axes = add_axes(figure, LEFT, 0.6 + (2 - row) * (height + GAP), WIDTH - LEFT - 0.5, height)
        split = budget.split[direction]
        axes.set_title(f"({'abc'[row]}) command in {NAMES[direction]}", loc="left")
        _waterfall(axes, split, direction)
        if row == 2:
            axes.set_xlabel("error in the commanded direction (per cent of the command)")
    return figure


def _outside(budget: Budget) -> str:
    """What is outside the planar total, in words."""
    shares = [(NAMES[axis], split.out_of_plane, axis) for axis, split in budget.split.items()]
    if any(share is None for _, share, _ in shares):
        return "Outside the planar total: out of plane, not known, a hinge is not on the thickness chart."
    said = ", ".join(f"{name} {getattr(share, axis):+.2f}" for name, share, axis in shares)
    plane = budget.plane.replace("_", " ")
    return f"Outside the planar total, three-dimensional necks against {plane}: {said} percentage points."


def _waterfall(axes: Axes, split: Split, direction: Direction) -> None:
    values = np.array([getattr(share.points, direction) for share in split.shares])
    total = float(getattr(split.total, direction))
    ends = np.cumsum(values)
    starts = ends - values
    places = np.arange(len(values) + 1)
    for place, (start, value) in enumerate(zip(starts, values, strict=True)):
        colour, hatch = COLOURS[place % len(COLOURS)], HATCHES[place % len(HATCHES)]
        axes.barh(place, value, left=start, height=0.62, color=colour, hatch=hatch, edgecolor="white")
        axes.plot([start + value] * 2, [place - 0.31, place + 1.31], color=GREY, linewidth=0.8)
    axes.barh(places[-1], total, height=0.62, color=INK, xerr=split.band, ecolor=COLOURS[1], capsize=4)
    reach = float(np.max(np.abs([*starts, *ends, total])))
    for place, (end, text) in enumerate(
        [(max(s, e), f"{v:+.3f}") for s, e, v in zip(starts, ends, values, strict=True)]
        + [(max(total, 0.0), f"{total:.3f} ± {split.band:.3f} %")]
    ):
        axes.text(end + 0.015 * reach, place, text.replace("-", "\N{MINUS SIGN}"), va="center", color=INK)
    names = [wrapped(share.name, LEFT - 0.45, 8.5) for share in split.shares]
    axes.set_yticks(places, [*names, "total"])
    axes.invert_yaxis()
    low = min(0.0, float(np.min([*starts, *ends])))
    axes.set_xlim(1.05 * low, 1.3 * reach)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.grid(axis="x", color="#D5D5D5", linewidth=0.5)
    axes.set_axisbelow(True)
