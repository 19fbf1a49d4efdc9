"""One hinge: its labelled sketch, every formula against finite elements over t/R, and what its thickness changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import Array
from flexfem.plot.stage import HasHinges, arrow, hinges_of
from flexfem.plot.style import (
    COLOURS,
    DASHES,
    GREY,
    INK,
    MARKERS,
    NOTE_COLOUR,
    in_house_style,
    legend_beside,
    panels,
    titled,
    wrapped,
)
from flexfem.plot.text import SPACE, significant
from flexfem.questions.errors import CurveModels
from flexfem.questions.hinges import HingeReview, ThicknessReview
from flexfem.units import LENGTH

FREEDOMS = ("rotation", "axial", "shear")
SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$", "shear": r"$\delta_y/F_y$"}
PALETTE = tuple(colour for colour in COLOURS if colour != "#000000")  # black are the finite elements
SAME = 1e-6  # of a ratio: two exact forms of one integral
ROOM = 0.06  # of the ratio's range, above and below
FLOOR = 0.4  # least ratio shown: below it a formula is of no use
WIDTH = 8.27  # in
LEGEND, LETTERS = 1.85, 8.0  # width of the legend's text, in, and its size, points
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
THICKNESSES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # ticks of b/t
NECK = 0.42  # t/R of the sketch, whatever the stage's
BLOCK = 1.5  # length of the blocks beside the notch, per R
DEPTH = np.array([0.95, 0.62])  # the direction out of plane, as drawn, per R
MOTION = "#0072B2"


@in_house_style
def hinge_chart_figure(review: HingeReview) -> Figure:
    """Draw the ratio of every formula to the finite elements, a panel for each freedom.

    Notes
    -----
    Formulas that are the same integral in different algebra share one curve. Ratios below `FLOOR` are not shown.
    """
    lines = [
        "Compliance by formula over that of plane-stress finite elements of a full notch, H = h = 2R + t, between "
        f"elastic blocks; ν{SPACE}={SPACE}{review.poissons_ratio:g}, which acts on shear alone. Below 1 the formula is "
        "too stiff. Full line between bars: the formula's range of t/R, as published or else as the registry has it; "
        f"pale: outside. Shaded: finite elements with higher blocks, to H{SPACE}={SPACE}{review.height:g}{SPACE}h. "
        "A formula has a curve for the freedoms that its source states.",
        review.source,
    ]
    figure, found = panels((WIDTH, 8.2), "Circular hinge: formulas against finite elements", lines, 3)
    for letter, axes, freedom in zip("abc", found, FREEDOMS, strict=True):
        titled(plot_formulas(axes, review, freedom), letter, f"{freedom}, {SYMBOLS[freedom]}", parse_math=True)
        axes.label_outer()
    return figure


class Merged(NamedTuple):
    """Formulas that draw one curve: their names, the range of the first, its ratios (n,)."""

    names: list[str]
    valid: tuple[float, float]
    values: Array


def merged(review: HingeReview, freedom: str) -> list[Merged]:
    """Curves of one freedom, those that coincide as one; formulas that do not state it are left out."""
    found: list[Merged] = []
    for curve in review.curves:
        values = getattr(curve, freedom)
        if values is None:
            continue
        alike = [one for one in found if one.valid == curve.valid and np.allclose(one.values, values, SAME, 0.0)]
        if alike:
            alike[0].names.append(curve.name)
        else:
            found.append(Merged([curve.name], curve.valid, values))
    return found


def plot_formulas(ax: Axes, review: HingeReview, freedom: str) -> Axes:
    """Draw the ratio of every formula to the finite elements in one freedom; returns `ax`.

    A formula looks the same in all three freedoms.
    """
    looks = list(dict.fromkeys(group.names[0] for each in FREEDOMS for group in merged(review, each)))
    x, higher = review.ratio, getattr(review.higher, freedom)
    label = f"finite elements, H = h to {review.height:g}{SPACE}h\n1 to {np.max(higher):.2f}"
    shade = ax.fill_between(x, 1.0, higher, color="#DADDE1", linewidth=0, zorder=1, label=label)
    ax.plot(x, higher, color=GREY, linewidth=0.8, zorder=1.2)
    ax.axhline(1.0, color=INK, linewidth=1.6, zorder=1.5)
    drawn = [_draw_curve(ax, x, group, looks.index(group.names[0])) for group in merged(review, freedom)]
    every = np.concatenate([[1.0], higher, *(np.asarray(line.get_ydata()) for line in drawn)])
    low, high = max(float(every.min()), FLOOR), float(every.max())
    _logarithmic(ax, x, TICKS, (low, high), ROOM)
    ax.set(xlabel="t/R", ylabel="formula / finite elements")
    legend_beside(ax, handles=[*drawn, shade], fontsize=LETTERS, handlelength=2.6, labelspacing=0.7)
    return ax


def _logarithmic(ax: Axes, x: Array, ticks: tuple[float, ...], ends: tuple[float, float], room: float) -> None:
    """A logarithmic axis with plain numbers, and room, over the height between the ends, above and below them."""
    pad = room * (ends[1] - ends[0])
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(ends[0] - pad, ends[1] + pad))
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.grid()


def _draw_curve(axes: Axes, x: Array, group: Merged, index: int) -> Line2D:
    """One curve: full with marks between the bars that end its range, thin and pale outside."""
    colour = PALETTE[index % len(PALETTE)]
    axes.plot(x, group.values, color=colour, linewidth=1.0, alpha=0.45, zorder=2 + index / 100)
    low, high = max(group.valid[0], x[0]), min(group.valid[1], x[-1])
    at = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    within = np.interp(np.log(at), np.log(x), group.values)
    names = wrapped(", ".join(group.names), LEGEND, LETTERS)
    text = f"{names}\n{np.min(within):.2f} to {np.max(within):.2f} for t/R {low:.2g} to {high:.2g}"
    style: dict[str, Any] = {"color": colour, "linewidth": 1.8, "markersize": 6.0, "markerfacecolor": "white"}
    style |= {"marker": MARKERS[index % len(MARKERS)], "markeredgewidth": 1.3, "zorder": 3 + index / 100}
    step = max(1, len(at) // 6)
    (line,) = axes.plot(at, within, markevery=(step // 2 + 2 * (index % 4), step), label=text, **style)
    bars = [k for k in (0, -1) if x[0] < at[k] < x[-1]]
    axes.plot(at[bars], within[bars], "|", color=colour, markersize=11, markeredgewidth=1.8, zorder=4)
    return line


@in_house_style
def thickness_figure(review: ThicknessReview) -> Figure:
    """Draw the factor out of plane over b/t, a panel for rotation and one for the axial freedom.

    Notes
    -----
    Both panels have the same axis, from plane strain, 1 - nu^2, to plane stress, 1.
    """
    lines = [
        f"Compliance of a circular hinge of thickness b in three dimensions over that in plane stress, "
        f"ν{SPACE}={SPACE}{review.poissons_ratio:g}, blocks as high as the notch. Below 1 the hinge is stiffer than in "
        "plane stress: the blocks keep a wide neck from contracting out of plane, more in bending than in tension.",
        review.source,
    ]
    figure, found = panels((WIDTH, 6.6), "Circular hinge: compliance over its thickness", lines, 2)
    for letter, axes, freedom in zip("ab", found, FREEDOMS, strict=False):
        titled(plot_thickness(axes, review, freedom), letter, f"{freedom}, {SYMBOLS[freedom]}", parse_math=True)
        axes.label_outer()
    return figure


def plot_thickness(ax: Axes, review: ThicknessReview, freedom: str) -> Axes:
    """Draw the factor of one freedom, rotation or axial, over b/t; returns `ax`."""
    strain, x = 1 - review.poissons_ratio**2, review.width
    for value, name, va, shift in (
        (1.0, "plane stress", "bottom", 2.5),
        (strain, f"plane strain, 1 − ν² = {strain:.3f}", "top", -3.5),
    ):
        ax.axhline(value, color=INK, linewidth=1.4, zorder=1.5)
        place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": va}
        ax.annotate(name, (0.985, value), (0, shift), ha="right", size=8.5, color=GREY, **place)
    for index, (ratio, values) in enumerate(zip(review.ratio, getattr(review, freedom), strict=True)):
        style: dict[str, Any] = {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}
        ax.plot(x, values, label=f"t/R = {ratio:g}", linewidth=1.9, zorder=2 + index / 100, **style)
    for index, (name, (ratio, width, *found)) in enumerate(review.marked.items()):
        value = found[FREEDOMS.index(freedom)]
        text = wrapped(f"{name}: t/R = {ratio:.3g}, b/t = {width:.3g}, factor {value:.3f}", 1.45, 8.5)
        look: dict[str, Any] = {"markersize": 7.0, "markerfacecolor": "white", "markeredgewidth": 1.6, "zorder": 4}
        ax.plot([width], [value], "os^Dv"[index % 5], color=INK, label=text, **look)
    _logarithmic(ax, x, THICKNESSES, (strain, 1.0), 0.14)
    ax.set(xlabel="b/t", ylabel="three dimensions / plane stress")
    legend_beside(ax, fontsize=8.5, handlelength=3.2, labelspacing=0.7)
    return ax


@in_house_style
def hinge_sketch(model: CurveModels) -> Figure:
    """Draw the labelled sketch of the circular hinge, with the dimensions of the model's hinges in a table below.

    Notes
    -----
    Fig. 2 of the paper. The drawing is not to scale: thin necks would not show. The full height is h = 2R + t.
    """
    doubts, heights = (model.assumed, model.not_stated), (3.8, 0.42 + 0.26 * len(hinge_rows(model)))
    lines = ["Circular hinge of (2) and (3), not to scale. Red: load; blue: what it causes."]
    size, title = (WIDTH, sum(heights) + 0.4), f"{model.stage}: circular hinge"
    figure, (axes, table) = panels(size, title, lines, 2, doubts=doubts, height_ratios=heights)
    plot_hinge(axes)
    plot_hinge_table(table, model)
    return figure


def hinge_rows(stage: HasHinges) -> list[tuple[str, ...]]:
    """Rows of the table of hinges: which, R, t, h in mm, t/R; hinges that are alike in one row. Raises BadInput."""
    groups: dict[tuple[float, float], list[str]] = {}
    for number, hinge in enumerate(hinges_of(stage), start=1):
        groups.setdefault((hinge.radius, hinge.neck), []).append(str(number))
    return [
        (", ".join(numbers), f"{radius:g}", f"{neck:g}", f"{2 * radius + neck:g}", significant(neck / radius, 3))
        for (radius, neck), numbers in groups.items()
    ]


def plot_hinge_table(ax: Axes, stage: HasHinges) -> Axes:
    """Write the dimensions of a stage's hinges as a table, those that are alike in one row; returns `ax`.

    `stage` may be the record of `flexfem.check`. Raises BadInput when it is no stage.
    """
    rows = hinge_rows(stage)
    ax.set_axis_off()
    head = ("hinge", f"R ({LENGTH})", f"t ({LENGTH})", f"h ({LENGTH})", "t/R")
    for line, row in enumerate([head, *rows]):
        y, weight = 1 - (line + 0.5) / (len(rows) + 1), "bold" if line == 0 else "normal"
        for x, cell in zip((0.0, 0.4, 0.55, 0.7, 0.85), row, strict=True):
            ax.text(x, y, cell, va="center", size=9, weight=weight)
    ax.axhline(1 - 1 / (len(rows) + 1), color=INK, linewidth=0.8)
    ax.set(xlim=(-0.01, 1), ylim=(0, 1))
    return ax


def plot_hinge(ax: Axes) -> Axes:
    """Draw the labelled sketch of the circular hinge, not to scale; returns `ax`."""
    ax.set(xlim=(-4.3, 4.9), ylim=(-1.75, 2.65), aspect="equal")
    ax.set_axis_off()
    _draw_solid(ax)
    _draw_dimensions(ax)
    _draw_loads(ax)
    return ax


def _draw_solid(axes: Axes) -> None:
    """The front face of the hinge for R = 1, and the sides that are seen behind it, the farthest first."""
    top, angle = 1 + NECK / 2, np.linspace(0, np.pi, 91)
    lower = np.column_stack([-np.cos(angle), -top + np.sin(angle)])
    corners = np.array([[1 + BLOCK, -top], [1 + BLOCK, top]])
    front = np.concatenate([[[-1 - BLOCK, -top]], lower, corners, -lower, [[-1 - BLOCK, top]]])
    ends = np.roll(front, -1, axis=0)
    along = (ends - front) / np.linalg.norm(ends - front, axis=1)[:, None]
    facing = np.column_stack([along[:, 1], -along[:, 0]]) @ DEPTH / np.linalg.norm(DEPTH)
    for k in np.argsort((front + ends) @ DEPTH):
        if facing[k] > 0:
            shade = (facing[k] * np.array([205, 212, 220]) + (1 - facing[k]) * np.array([238, 241, 244])) / 255
            side = np.array([front[k], ends[k], ends[k] + DEPTH, front[k] + DEPTH])
            axes.fill(*side.T, facecolor=shade, edgecolor=shade, linewidth=0.6, zorder=1)
            axes.plot(*side[2:].T, color=INK, linewidth=1.0, zorder=1)
    for corner in (*corners, -lower[0], [-1 - BLOCK, top]):
        axes.plot(*np.transpose([corner, corner + DEPTH]), color=INK, linewidth=1.0, zorder=1.5)
    axes.fill(*front.T, facecolor="#DDE3EA", edgecolor=INK, linewidth=1.4, zorder=3)


def _draw_dimensions(axes: Axes) -> None:
    top, left = 1 + NECK / 2, -1.45 - BLOCK
    corner, below = np.array([1 + BLOCK, -top]), np.array([0.12, -0.2])
    extents = [((left, -top), (left, top)), (corner + below, corner + DEPTH + below)]
    extents += [((left - 0.15, y), (left + 0.4, y)) for y in (-top, top)]
    extents += [(end + 0.25 * below, end + 1.3 * below) for end in (corner, corner + DEPTH)]
    for k, (start, end) in enumerate(extents):
        if k < 2:
            arrow(axes, start, end, "<|-|>")
        else:
            axes.plot(*np.transpose([start, end]), color=GREY, linewidth=0.7)
    axes.plot(0.0, -top, "+", color=INK, markersize=9, zorder=5)
    arrow(axes, (0.0, -top), (-np.sqrt(0.5), np.sqrt(0.5) - top))
    arrow(axes, (0.0, NECK / 2 + 0.45), (0.0, NECK / 2))
    arrow(axes, (0.0, -NECK / 2 - 0.45), (0.0, -NECK / 2))
    _label(axes, (left - 0.12, 0.0), "$h = 2R + t$", "right")
    _label(axes, corner + below + DEPTH / 2 + (0.14, -0.12), "$b$", "left")
    _label(axes, (-0.3, 0.08 - top), "$R$", "right")
    _label(axes, (0.12, -NECK / 2 - 0.33), "$t$", "left")


def _draw_loads(axes: Axes) -> None:
    """Axes, force and moment at the right end, and the motions they cause."""
    corner, right, centreline = np.array([-3.0, 1.75]), 1 + BLOCK, (0, (9, 2, 1.5, 2))
    for name, tip, beside in (
        ("$x$", (0.7, 0.0), (0.83, 0.0)),
        ("$y$", (0.0, 0.7), (0.14, 0.7)),
        ("$z$", -0.55 * DEPTH, -0.55 * DEPTH - 0.1),
    ):
        arrow(axes, corner, corner + np.array(tip))
        _label(axes, corner + np.array(beside), name, "center", 11)
    axes.plot([-0.3, right + 1.2], [0, 0], color=INK, linewidth=0.7, linestyle=centreline, zorder=4)
    axes.plot(0, 0, "o", color=INK, markersize=3.5, zorder=6)
    arrow(axes, (right, 0.0), (right + 1.75, 0.0), colour=NOTE_COLOUR, width=2.0)
    arrow(axes, (right + 1.1, -0.45), (right + 1.75, -0.45), colour=MOTION, width=2.0)
    tilted = np.array([np.cos(np.deg2rad(14)), np.sin(np.deg2rad(14))]) * (right + 1.5)
    axes.plot([0, tilted[0]], [0, tilted[1]], color=MOTION, linewidth=1.0, linestyle=centreline, zorder=4)
    turned: Any = tilted * (right + 1.2) / (right + 1.5)
    for start, end, bend, colour in (
        ((right + 1.2, 0.0), turned, 0.1, MOTION),
        ((1.55, -0.62), (1.55, 0.62), 0.55, NOTE_COLOUR),
    ):
        style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 11.0, "shrinkA": 0.0, "shrinkB": 0.0}
        bow = f"arc3,rad={bend}"
        axes.add_patch(FancyArrowPatch(start, end, connectionstyle=bow, color=colour, linewidth=1.8, zorder=6, **style))
    _label(axes, (right + 1.85, 0.0), "$F_x$", "left", colour=NOTE_COLOUR)
    _label(axes, (right + 1.85, -0.45), r"$\Delta x$", "left", colour=MOTION)
    _label(axes, (right + 1.33, 0.48), r"$\alpha_z$", "left", colour=MOTION)
    _label(axes, (1.5, -0.82), "$M_z$", "center", colour=NOTE_COLOUR)


def _label(axes: Axes, at: Any, name: str, side: Any, size: float = 13, colour: str = INK) -> None:
    axes.text(at[0], at[1], name, ha=side, va="center", size=size, color=colour, zorder=7, parse_math=True)
