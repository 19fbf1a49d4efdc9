"""Fig. 2: the circular hinge, what its dimensions are called and how it is loaded."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import Array
from flexfem.report.marks import Point, arrow
from flexfem.report.style import GREY, INK, add_axes, header, in_house_style, new_figure
from flexfem.report.units import significant
from flexfem.verify.result import Model

NECK = 0.42  # t/R of the drawing, whatever the stage's
BLOCK = 1.5  # length of the blocks beside the notch, per R
DEPTH = np.array([0.95, 0.62])  # the direction out of plane, as drawn, per R
ACTION, MOTION = "#B00000", "#0072B2"
SHADES = ("#CDD4DC", "#EEF1F4")  # darkest and lightest of the sides


@in_house_style
def hinge_sketch(model: Model) -> Figure:
    """Draw the labelled sketch of the circular hinge, with the dimensions of the model's hinges in a table below.

    Notes
    -----
    Fig. 2 of the paper. The drawing is not to scale: thin necks would not show. The full height is h = 2R + t.
    """
    rows = hinge_rows(model)
    table = 0.42 + 0.26 * len(rows)
    height = 6.3 + table
    figure = new_figure(8.27, height)
    lines = ["Circular hinge of (2) and (3), not to scale. Red: load; blue: what it causes."]
    used = header(figure, f"{model.stage}: circular hinge", lines, model.assumed)
    axes = add_axes(figure, 0.3, table + 0.25, 7.67, height - used - table - 0.3)
    axes.set_xlim(-3.9, 5.1)
    axes.set_ylim(-2.6, 3.0)
    axes.set_aspect("equal")
    axes.set_axis_off()
    _draw_solid(axes)
    _draw_dimensions(axes)
    _draw_loads(axes)
    _draw_table(add_axes(figure, 0.3, 0.15, 7.67, table), rows)
    return figure


def outline() -> Array:
    """The hinge's front face (n, 2), counter-clockwise, for R = 1."""
    top = 1 + NECK / 2
    angle = np.linspace(0, np.pi, 91)
    lower = np.column_stack([-np.cos(angle), -top + np.sin(angle)])
    corners = np.array([[1 + BLOCK, -top], [1 + BLOCK, top]])
    return np.concatenate([[[-1 - BLOCK, -top]], lower, corners, -lower, [[-1 - BLOCK, top]]])


def hinge_rows(model: Model) -> list[tuple[str, ...]]:
    """Rows of the table of hinges: which, R, t, h in mm, t/R, freedoms; hinges that are alike in one row."""
    groups: dict[tuple[float, float, tuple[str, ...]], list[str]] = {}
    for number, hinge in enumerate(model.hinges, start=1):
        groups.setdefault((hinge.radius, hinge.neck, tuple(hinge.freedoms)), []).append(str(number))
    return [
        (
            ", ".join(numbers),
            f"{radius:g}",
            f"{neck:g}",
            f"{2 * radius + neck:g}",
            significant(neck / radius, 3),
            " + ".join(freedoms),
        )
        for (radius, neck, freedoms), numbers in groups.items()
    ]


def _draw_solid(axes: Axes) -> None:
    """Back, visible sides from the farthest to the nearest, front."""
    front = outline()
    ends = np.roll(front, -1, axis=0)
    along = ends - front
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    facing = outward @ DEPTH
    order = [k for k in np.argsort((front + ends) @ DEPTH) if facing[k] > 0]
    sides = [[front[k], ends[k], ends[k] + DEPTH, front[k] + DEPTH] for k in order]
    mix = (facing[order] / np.linalg.norm(DEPTH))[:, None]
    colours = (1 - mix) * _rgb(SHADES[0]) + mix * _rgb(SHADES[1])
    axes.add_collection(PolyCollection(sides, facecolors=colours, edgecolors=colours, linewidths=0.6, zorder=1))
    for corner in np.array([[1, 1], [1, -1], [-1, 1]]) * [1 + BLOCK, 1 + NECK / 2]:
        axes.plot(*np.transpose([corner, corner + DEPTH]), color=INK, linewidth=1.0, zorder=1.5)
    top = 1 + NECK / 2
    for a, b in (((-1 - BLOCK, top), (-1, top)), ((1, top), (1 + BLOCK, top)), ((1 + BLOCK, top), (1 + BLOCK, -top))):
        axes.plot(*np.transpose([a + DEPTH, b + DEPTH]), color=INK, linewidth=1.0, zorder=1.5)
    axes.fill(*front.T, facecolor="#DDE3EA", edgecolor=INK, linewidth=1.4, zorder=2)


def _rgb(colour: str) -> Array:
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def _draw_dimensions(axes: Axes) -> None:
    top, left = 1 + NECK / 2, -1 - BLOCK
    _extent(axes, (left - 0.45, -top), (left - 0.45, top), "$h = 2R + t$", (-0.12, 0.0), "right")
    for y in (-top, top):
        axes.plot([left - 0.6, left - 0.05], [y, y], color=GREY, linewidth=0.7)
    corner = np.array([1 + BLOCK, -top])
    _extent(axes, corner + [0.12, -0.2], corner + DEPTH + [0.12, -0.2], "$b$", (0.14, -0.12), "left")
    for end in (corner, corner + DEPTH):
        axes.plot(*np.transpose([end + [0.03, -0.05], end + [0.16, -0.26]]), color=GREY, linewidth=0.7)
    middle = np.array([0.0, -top])
    axes.plot(*middle, "+", color=INK, markersize=9, zorder=5)
    arrow(axes, middle, middle + np.array([-np.sqrt(0.5), np.sqrt(0.5)]))
    _label(axes, middle + [-0.3, 0.08], "$R$", "right")
    arrow(axes, (0.0, NECK / 2 + 0.45), (0.0, NECK / 2))
    arrow(axes, (0.0, -NECK / 2 - 0.45), (0.0, -NECK / 2))
    _label(axes, (0.12, -NECK / 2 - 0.33), "$t$", "left")


def _draw_loads(axes: Axes) -> None:
    """Axes at the neck's centre, force and moment at the right end, and the motions they cause."""
    for tip, name, at in (((0.85, 0.0), "$x$", (0.98, 0.13)), ((0.0, 1.75), "$y$", (0.16, 1.72))):
        arrow(axes, (0.0, 0.0), tip, width=0.8)
        _label(axes, at, name, "center", 11)
    axes.plot(0, 0, "o", color=INK, markersize=4, zorder=6)
    axes.plot(0, 0, "o", color=INK, markersize=10, markerfacecolor="none", zorder=6)
    _label(axes, (-0.25, 0.02), "$z$", "center", 11)
    right = 1 + BLOCK
    arrow(axes, (right, 0.0), (right + 1.75, 0.0), colour=ACTION, width=2.0)
    _label(axes, (right + 1.8, -0.22), "$F_x$", "right", 13, ACTION)
    arrow(axes, (right + 1.05, -0.85), (right + 1.65, -0.85), colour=MOTION, width=2.0)
    _label(axes, (right + 1.35, -1.08), r"$\Delta x$", "center", 13, MOTION)
    _turning(axes, (1.75, 0.0), 0.62, ACTION, "$M_z$", (1.75, 0.3))
    tilt = np.deg2rad(14)
    reach = np.array([np.cos(tilt), np.sin(tilt)]) * (right + 1.5)
    axes.plot([0, reach[0]], [0, reach[1]], color=MOTION, linewidth=1.0, linestyle=(0, (7, 2, 1.2, 2)), zorder=4)
    bow = {"arrowstyle": "-|>", "mutation_scale": 10.0, "shrinkA": 0.0, "shrinkB": 0.0, "zorder": 6.0}
    start, end = (right + 1.2, 0.0), tuple(reach * (right + 1.2) / (right + 1.5))
    axes.add_patch(FancyArrowPatch(start, end, connectionstyle="arc3,rad=0.1", color=MOTION, linewidth=1.6, **bow))
    _label(axes, (right + 1.32, 0.42), r"$\alpha_z$", "left", 13, MOTION)


def _turning(axes: Axes, middle: Point, radius: float, colour: str, name: str, at: Point) -> None:
    """A moment, counter-clockwise about the axis towards the viewer."""
    angle = np.deg2rad(np.linspace(-60, 60, 40))
    x, y = middle[0] - 0.3 + radius * np.cos(angle), middle[1] + radius * np.sin(angle)
    axes.plot(x, y, color=colour, linewidth=2.0, zorder=5)
    arrow(axes, (x[-3], y[-3]), (x[-1] - 0.07, y[-1] + 0.06), colour=colour, width=2.0)
    _label(axes, at, name, "center", 13, colour)


def _extent(axes: Axes, start: Point, end: Point, name: str, shift: Point, side: str) -> None:
    arrow(axes, start, end, "<|-|>")
    _label(axes, (np.asarray(start) + np.asarray(end)) / 2 + np.asarray(shift), name, side)


def _label(axes: Axes, at: Point, name: str, side: str, size: float = 13, colour: str = INK) -> None:
    axes.text(at[0], at[1], name, ha=side, va="center", size=size, color=colour, zorder=7, parse_math=True)


def _draw_table(axes: Axes, rows: list[tuple[str, ...]]) -> None:
    axes.set_axis_off()
    head = ("hinge", "R (mm)", "t (mm)", "h (mm)", "t/R", "freedoms of the model")
    across = (0.0, 0.3, 0.41, 0.52, 0.63, 0.74)
    for line, row in enumerate([head, *rows]):
        y = 1 - (line + 0.5) / (len(rows) + 1)
        for x, cell in zip(across, row, strict=True):
            axes.text(x, y, cell, va="center", size=9, weight="bold" if line == 0 else "normal")
    axes.axhline(1 - 1 / (len(rows) + 1), color=INK, linewidth=0.8)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
