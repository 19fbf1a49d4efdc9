"""Fig. 2: the circular hinge, what its dimensions are called and how it is loaded."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import Array
from flexfem.plot.marks import Point, arrow
from flexfem.plot.placed import HasHinges, Placed, placed
from flexfem.plot.style import GREY, INK, in_house_style, panels
from flexfem.plot.text import significant
from flexfem.questions.errors import CurveModels
from flexfem.units import LENGTH

NECK = 0.42  # t/R of the drawing, whatever the stage's
BLOCK = 1.5  # length of the blocks beside the notch, per R
DEPTH = np.array([0.95, 0.62])  # the direction out of plane, as drawn, per R
SHARP = np.cos(np.deg2rad(20.0))  # of the angle at which two sides meet in a visible edge
ACTION, MOTION = "#B00000", "#0072B2"
SHADES = ("#CDD4DC", "#EEF1F4")  # darkest and lightest of the sides


@in_house_style
def hinge_sketch(model: CurveModels) -> Figure:
    """Draw the labelled sketch of the circular hinge, with the dimensions of the model's hinges in a table below.

    Notes
    -----
    Fig. 2 of the paper. The drawing is not to scale: thin necks would not show. The full height is h = 2R + t.
    """
    heights = (3.8, 0.42 + 0.26 * len(hinge_rows(model)))
    lines = ["Circular hinge of (2) and (3), not to scale. Red: load; blue: what it causes."]
    title, doubts = f"{model.stage}: circular hinge", (model.assumed, model.not_stated)
    figure, (axes, table) = panels((8.27, sum(heights) + 0.4), title, lines, 2, doubts=doubts, height_ratios=heights)
    plot_hinge(axes)
    plot_hinge_table(table, model)
    return figure


def plot_hinge(ax: Axes) -> Axes:
    """Draw the labelled sketch of the circular hinge, not to scale; returns `ax`."""
    ax.set(xlim=(-4.3, 4.9), ylim=(-1.75, 2.65), aspect="equal")
    ax.set_axis_off()
    _draw_solid(ax)
    _draw_dimensions(ax)
    _draw_loads(ax)
    return ax


def outline() -> Array:
    """The hinge's front face (n, 2), counter-clockwise, for R = 1."""
    top = 1 + NECK / 2
    angle = np.linspace(0, np.pi, 91)
    lower = np.column_stack([-np.cos(angle), -top + np.sin(angle)])
    corners = np.array([[1 + BLOCK, -top], [1 + BLOCK, top]])
    return np.concatenate([[[-1 - BLOCK, -top]], lower, corners, -lower, [[-1 - BLOCK, top]]])


def hinge_rows(model: CurveModels | Placed) -> list[tuple[str, ...]]:
    """Rows of the table of hinges: which, R, t, h in mm, t/R; hinges that are alike in one row."""
    groups: dict[tuple[float, float], list[str]] = {}
    for number, hinge in enumerate(model.hinges, start=1):
        groups.setdefault((hinge.radius, hinge.neck), []).append(str(number))
    return [
        (
            ", ".join(numbers),
            f"{radius:g}",
            f"{neck:g}",
            f"{2 * radius + neck:g}",
            significant(neck / radius, 3),
        )
        for (radius, neck), numbers in groups.items()
    ]


def _draw_solid(axes: Axes) -> None:
    """Sides that are seen, from the farthest to the nearest, then the front."""
    front = outline()
    ends = np.roll(front, -1, axis=0)
    along = (ends - front) / np.linalg.norm(ends - front, axis=1)[:, None]
    facing = np.column_stack([along[:, 1], -along[:, 0]]) @ DEPTH / np.linalg.norm(DEPTH)
    seen = facing > 0
    for rank, k in enumerate(np.argsort((front + ends) @ DEPTH)):
        if not seen[k]:
            continue
        order, shade = 1 + rank / 1000, (1 - facing[k]) * _rgb(SHADES[0]) + facing[k] * _rgb(SHADES[1])
        side = np.array([front[k], ends[k], ends[k] + DEPTH, front[k] + DEPTH])
        axes.fill(*side.T, facecolor=shade, edgecolor=shade, linewidth=0.6, zorder=order)
        axes.plot(*side[2:].T, color=INK, linewidth=1.0, zorder=order)
        for end, neighbour in ((0, k - 1), (1, (k + 1) % len(front))):
            if not seen[neighbour] or along[k] @ along[neighbour] < SHARP:
                axes.plot(*side[[end, 3 - end]].T, color=INK, linewidth=1.0, zorder=order + 1e-4)
    axes.fill(*front.T, facecolor="#DDE3EA", edgecolor=INK, linewidth=1.4, zorder=3)


def _rgb(colour: str) -> Array:
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def _draw_dimensions(axes: Axes) -> None:
    top, left = 1 + NECK / 2, -1 - BLOCK
    _extent(axes, (left - 0.45, -top), (left - 0.45, top), "$h = 2R + t$", (-0.12, 0.0), "right")
    for y in (-top, top):
        axes.plot([left - 0.6, left - 0.05], [y, y], color=GREY, linewidth=0.7)
    corner, below = np.array([1 + BLOCK, -top]), np.array([0.12, -0.2])
    _extent(axes, corner + below, corner + DEPTH + below, "$b$", (0.14, -0.12), "left")
    for end in (corner, corner + DEPTH):
        axes.plot(*np.transpose([end + 0.25 * below, end + 1.3 * below]), color=GREY, linewidth=0.7)
    middle = np.array([0.0, -top])
    axes.plot(*middle, "+", color=INK, markersize=9, zorder=5)
    arrow(axes, middle, middle + np.array([-np.sqrt(0.5), np.sqrt(0.5)]))
    _label(axes, (-0.3, 0.08 - top), "$R$", "right")
    arrow(axes, (0.0, NECK / 2 + 0.45), (0.0, NECK / 2))
    arrow(axes, (0.0, -NECK / 2 - 0.45), (0.0, -NECK / 2))
    _label(axes, (0.12, -NECK / 2 - 0.33), "$t$", "left")


def _draw_loads(axes: Axes) -> None:
    """Axes, force and moment at the right end, and the motions they cause."""
    corner, out = np.array([-3.0, 1.75]), -0.55 * DEPTH
    for tip, shift, name in (
        ((0.7, 0.0), (0.13, 0.0), "$x$"),
        ((0.0, 0.7), (0.14, 0.0), "$y$"),
        (out, (-0.1, -0.1), "$z$"),
    ):
        arrow(axes, corner, corner + tip, width=1.0)
        _label(axes, corner + tip + shift, name, "center", 11)
    right, centreline = 1 + BLOCK, (0, (9, 2, 1.5, 2))
    axes.plot([-0.3, right + 1.2], [0, 0], color=INK, linewidth=0.7, linestyle=centreline, zorder=4)
    axes.plot(0, 0, "o", color=INK, markersize=3.5, zorder=6)
    arrow(axes, (right, 0.0), (right + 1.75, 0.0), colour=ACTION, width=2.0)
    _label(axes, (right + 1.85, 0.0), "$F_x$", "left", 13, ACTION)
    arrow(axes, (right + 1.1, -0.45), (right + 1.75, -0.45), colour=MOTION, width=2.0)
    _label(axes, (right + 1.85, -0.45), r"$\Delta x$", "left", 13, MOTION)
    tilt = np.deg2rad(14)
    reach = np.array([np.cos(tilt), np.sin(tilt)]) * (right + 1.5)
    axes.plot([0, reach[0]], [0, reach[1]], color=MOTION, linewidth=1.0, linestyle=centreline, zorder=4)
    _bow(axes, (right + 1.2, 0.0), reach * (right + 1.2) / (right + 1.5), 0.1, MOTION)
    _label(axes, (right + 1.33, 0.48), r"$\alpha_z$", "left", 13, MOTION)
    _bow(axes, (1.55, -0.62), (1.55, 0.62), 0.55, ACTION)
    _label(axes, (1.5, -0.82), "$M_z$", "center", 13, ACTION)


def _bow(axes: Axes, start: Point, end: Point, curvature: float, colour: str) -> None:
    """A bent arrow, counter-clockwise."""
    ends: Any = [(float(point[0]), float(point[1])) for point in (start, end)]
    shape: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 11.0, "shrinkA": 0.0, "shrinkB": 0.0, "zorder": 6.0}
    style = f"arc3,rad={curvature}"
    axes.add_patch(FancyArrowPatch(*ends, connectionstyle=style, color=colour, linewidth=1.8, **shape))


def _extent(axes: Axes, start: Point, end: Point, name: str, shift: Point, side: str) -> None:
    arrow(axes, start, end, "<|-|>")
    _label(axes, (np.asarray(start) + np.asarray(end)) / 2 + np.asarray(shift), name, side)


def _label(axes: Axes, at: Point, name: str, side: str, size: float = 13, colour: str = INK) -> None:
    axes.text(at[0], at[1], name, ha=side, va="center", size=size, color=colour, zorder=7, parse_math=True)


def plot_hinge_table(ax: Axes, stage: HasHinges) -> Axes:
    """Write the dimensions of a stage's hinges as a table, those that are alike in one row; returns `ax`.

    `stage` may be the record of `flexfem.check`. Raises BadInput when it is no stage.
    """
    rows = hinge_rows(placed(stage))
    ax.set_axis_off()
    head = ("hinge", f"R ({LENGTH})", f"t ({LENGTH})", f"h ({LENGTH})", "t/R")
    across = (0.0, 0.4, 0.55, 0.7, 0.85)
    for line, row in enumerate([head, *rows]):
        y = 1 - (line + 0.5) / (len(rows) + 1)
        for x, cell in zip(across, row, strict=True):
            ax.text(x, y, cell, va="center", size=9, weight="bold" if line == 0 else "normal")
    ax.axhline(1 - 1 / (len(rows) + 1), color=INK, linewidth=0.8)
    ax.set(xlim=(-0.01, 1), ylim=(0, 1))
    return ax
