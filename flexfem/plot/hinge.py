"""Figures of one hinge: labelled sketch, formulas against finite elements over t/R, and influence
of thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.arrays import Array
from flexfem.files.refusals import shown
from flexfem.paper.stage import Stage
from flexfem.paper.verification import CurveModels
from flexfem.plot import style
from flexfem.plot.stage import arrow, hinges_of, write
from flexfem.plot.style import COLOURS, GREY, INK, NOTE_COLOUR, panels, wrapped
from flexfem.plot.text import significant
from flexfem.questions.check import FormulaCurve, HingeReview, ThicknessReview
from flexfem.refused import BadInput
from flexfem.results import SPACE
from flexfem.units import LENGTH

SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$", "shear": r"$\delta_y/F_y$"}
FREEDOMS = tuple(SYMBOLS)
PALETTE = tuple(colour for colour in COLOURS if colour != "#000000")  # black: finite elements
EQUAL_RATIO = 1e-6  # relative difference of two exact forms of one integral
FLOOR = 0.4  # least ratio shown
WIDTH = 8.27  # in
LEGEND_WIDTH = 1.85
FONT_SIZE = 8.0  # of the legend's text: in, points
NECK = 0.42  # t/R of the sketch, independent of the stage
BLOCK = 1.5  # length of the blocks beside the notch over R


@style.in_house_style
def hinge_chart_figure(review: HingeReview) -> Figure:
    """Draw the ratio of every formula to the finite elements, one panel per freedom.

    Formulas that are algebraic forms of one integral share a curve. Ratios below `FLOOR` are not
    shown."""
    lines = [
        "Compliance by formula over that of plane-stress finite elements of a full notch, H = h "
        f"= 2R + t, between elastic blocks; ν{SPACE}={SPACE}{review.poissons_ratio:g}, which "
        "affects shear only. Below 1 the formula is too stiff. Full line between bars: the "
        "formula's range of t/R, as published or else as in the registry; pale: outside. Shaded: "
        f"finite elements with higher blocks, up to H{SPACE}={SPACE}{review.height:g}{SPACE}h. "
        "Each formula is drawn for the freedoms that its source gives.",
        review.source,
    ]
    figure, axes = panels(
        (WIDTH, 8.2), "Circular hinge: formulas against finite elements", lines, 3
    )
    for letter, ax, freedom in zip("abc", axes, FREEDOMS, strict=True):
        plot_formulas(ax, review, freedom)
        style.titled(ax, letter, f"{freedom}, {SYMBOLS[freedom]}", parse_math=True)
        ax.label_outer()
    return figure


def merged(review: HingeReview, freedom: str) -> list[tuple[list[str], FormulaCurve, Array]]:
    """Groups of coincident curves of one freedom: the names, the first curve and its ratios."""
    groups: list[tuple[list[str], FormulaCurve, Array]] = []
    for curve in review.curves:
        values = getattr(curve, freedom)
        if values is None:  # its source does not state it
            continue
        for names, first, ratios in groups:
            if first.valid == curve.valid and np.allclose(ratios, values, EQUAL_RATIO, 0.0):
                names.append(curve.name)
                break
        else:
            groups.append(([curve.name], curve, values))
    return groups


def plot_formulas(ax: Axes, review: HingeReview, freedom: str) -> Axes:
    """Draw the ratio of every formula to the finite elements in one freedom; return `ax`.

    A formula has the same line style in all three freedoms. Raises BadInput for an unknown freedom.
    """
    _require(freedom, FREEDOMS)
    order = list(dict.fromkeys(names[0] for each in FREEDOMS for names, *_ in merged(review, each)))
    x = review.ratio
    higher = getattr(review.higher, freedom)
    label = f"finite elements, H = h to {review.height:g}{SPACE}h\n1 to {np.max(higher):.2f}"
    shade = ax.fill_between(x, 1.0, higher, color="#DADDE1", linewidth=0, zorder=1, label=label)
    ax.plot(x, higher, color=GREY, linewidth=0.8, zorder=1.2)
    ax.axhline(1.0, color=INK, linewidth=1.6, zorder=1.5)
    curves = merged(review, freedom)
    lines = [
        _draw_curve(ax, x, names, first.valid, y, order.index(names[0]))
        for names, first, y in curves
    ]
    values = np.concatenate([[1.0], higher, *(np.asarray(line.get_ydata()) for line in lines)])
    low = max(float(values.min()), FLOOR)
    high = float(values.max())
    _set_axes(ax, x, (0.02, 0.05, 0.1, 0.2, 0.5, 1.0), low, high)
    ax.set(xlabel="t/R", ylabel="formula / finite elements")
    style.legend_beside(
        ax, handles=[*lines, shade], fontsize=FONT_SIZE, handlelength=2.6, labelspacing=0.7
    )
    return ax


def _require(freedom: str, known: Sequence[str]) -> None:
    if freedom not in known:
        raise BadInput(f"freedom {shown(freedom)}, expected one of {', '.join(known)}")


def _set_axes(ax: Axes, x: Array, ticks: Sequence[float], low: float, high: float) -> None:
    """Set a logarithmic x axis with plain tick labels, and y limits with a margin around `low` to
    `high`.
    """
    room = 0.08 * (high - low)
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(low - room, high + room))
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.grid()


def _draw_curve(
    axes: Axes, x: Array, names: list[str], valid: tuple[float, float], y: Array, index: int
) -> Line2D:
    """Draw a curve: full with markers within its range, which two bars delimit, thin and pale
    outside.
    """
    colour = PALETTE[index % len(PALETTE)]
    axes.plot(x, y, color=colour, linewidth=1.0, alpha=0.45, zorder=2 + index / 100)
    low = max(valid[0], x[0])
    high = min(valid[1], x[-1])
    at = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    within = np.interp(np.log(at), np.log(x), y)
    text = wrapped(", ".join(names), LEGEND_WIDTH, FONT_SIZE)
    text += f"\n{np.min(within):.2f} to {np.max(within):.2f} for t/R {low:.2g} to {high:.2g}"
    look: dict[str, Any] = {
        "color": colour,
        "linewidth": 1.8,
        "markersize": 6.0,
        "markerfacecolor": "white",
    }
    look |= {
        "marker": style.MARKERS[index % len(style.MARKERS)],
        "markeredgewidth": 1.3,
        "zorder": 3 + index / 100,
    }
    step = max(1, len(at) // 6)
    (line,) = axes.plot(
        at, within, markevery=(step // 2 + 2 * (index % 4), step), label=text, **look
    )
    bars = [k for k in (0, -1) if x[0] < at[k] < x[-1]]
    axes.plot(
        at[bars], within[bars], "|", color=colour, markersize=11, markeredgewidth=1.8, zorder=4
    )
    return line


@style.in_house_style
def thickness_figure(review: ThicknessReview) -> Figure:
    """Draw the ratio of three-dimensional to plane-stress compliance over b/t for rotation and
    axial elongation.
    """
    lines = [
        "Compliance of a circular hinge of thickness b in three dimensions over that in plane "
        f"stress, ν{SPACE}={SPACE}{review.poissons_ratio:g}, blocks as high as the notch. Below 1 "
        "the hinge is stiffer than in plane stress: the blocks restrain out-of-plane contraction "
        "of a wide neck, more in bending than in tension.",
        review.source,
    ]
    figure, axes = panels((WIDTH, 6.6), "Circular hinge: compliance over its thickness", lines, 2)
    for letter, ax, freedom in zip("ab", axes, FREEDOMS[:2], strict=True):
        plot_thickness(ax, review, freedom)
        style.titled(ax, letter, f"{freedom}, {SYMBOLS[freedom]}", parse_math=True)
        ax.label_outer()
    return figure


def plot_thickness(ax: Axes, review: ThicknessReview, freedom: str) -> Axes:
    """Draw the thickness factor of rotation or the axial freedom over b/t; return `ax`. Raises
    BadInput for another.
    """
    _require(freedom, FREEDOMS[:2])
    strain = 1 - review.poissons_ratio**2
    x = review.width
    place: dict[str, Any] = {
        "xycoords": ax.get_yaxis_transform(),
        "textcoords": "offset points",
        "ha": "right",
    }
    for value, name, shift in (
        (1.0, "plane stress", 3),
        (strain, f"plane strain, 1 − ν² = {strain:.3f}", -11),
    ):
        ax.axhline(value, color=INK, linewidth=1.4, zorder=1.5)
        ax.annotate(name, (0.985, value), (0, shift), size=8.5, color=GREY, **place)
    for index, (ratio, values) in enumerate(
        zip(review.ratio, getattr(review, freedom), strict=True)
    ):
        look: dict[str, Any] = {
            "color": COLOURS[index % len(COLOURS)],
            "linestyle": style.DASHES[index % 7],
        }
        ax.plot(x, values, label=f"t/R = {ratio:g}", linewidth=1.9, zorder=2 + index / 100, **look)
    _set_axes(ax, x, (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0), strain - 0.01, 1.0)
    ax.set(xlabel="b/t", ylabel="three dimensions / plane stress")
    style.legend_beside(ax, handlelength=3.2, labelspacing=0.7)
    return ax


@style.in_house_style
def hinge_sketch(model: CurveModels) -> Figure:
    """Draw the labelled sketch of the circular hinge, Fig. 2 of the paper, and the model's hinges
    in a table below.
    """
    heights = (3.4, 0.22 * (1 + len(hinge_rows(model))))
    lines = [
        "Circular hinge of (2) and (3), not to scale; its thickness b is out of the plane. Red: "
        "loads."
    ]
    size = (WIDTH, sum(heights) + 0.4)
    title = f"{model.stage}: circular hinge"
    figure, (axes, table) = panels(size, title, lines, 2, assumptions=model, height_ratios=heights)
    plot_hinge(axes)
    plot_hinge_table(table, model)
    return figure


def hinge_rows(stage: Stage | CurveModels) -> list[tuple[str, ...]]:
    """Rows of the table of hinges: numbers; R, t, h, mm; t/R. Identical hinges share a row. Raises
    BadInput.
    """
    groups: dict[tuple[float, float], list[str]] = {}
    for number, hinge in enumerate(hinges_of(stage), start=1):
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


def plot_hinge_table(ax: Axes, stage: Stage | CurveModels) -> Axes:
    """Write the dimensions of a stage's hinges as a table, identical hinges in one row; return
    `ax`.

    Raises BadInput when `stage` is not a stage.
    """
    rows = hinge_rows(stage)
    head = ("hinge", f"R ({LENGTH})", f"t ({LENGTH})", f"h ({LENGTH})", "t/R")
    return style.table(ax, [head, *rows], [1.5] * 5)


def plot_hinge(ax: Axes) -> Axes:
    """Draw the labelled sketch of the circular hinge, not to scale; return `ax`."""
    top = 1 + NECK / 2
    right = 1 + BLOCK
    angle = np.linspace(0, np.pi, 91)
    notch = np.column_stack([-np.cos(angle), -top + np.sin(angle)])
    outline = np.concatenate(
        [[[-right, -top]], notch, [[right, -top], [right, top]], -notch, [[-right, top]]]
    )
    ax.fill(*outline.T, facecolor="#DDE3EA", edgecolor=INK, linewidth=1.4, zorder=3)
    ax.plot(
        [-right - 0.3, right + 1.2],
        [0, 0],
        color=INK,
        linewidth=0.7,
        linestyle=(0, (9, 2, 1.5, 2)),
        zorder=4,
    )
    ax.plot(0.0, -top, "+", color=INK, markersize=9, zorder=5)
    ax.hlines([-top, top], -right - 0.6, -right - 0.1, color=GREY, linewidth=0.7)
    left = -right - 0.45
    load = {"colour": NOTE_COLOUR, "width": 2.0}
    for tail, head, look in (
        ((left, -top), (left, top), {"style": "<|-|>"}),
        ((0.0, -top), (-np.sqrt(0.5), np.sqrt(0.5) - top), {}),
        ((0.0, NECK / 2 + 0.45), (0.0, NECK / 2), {}),
        ((0.0, -NECK / 2 - 0.45), (0.0, -NECK / 2), {}),
        ((right, 0.0), (right + 1.2, 0.0), load),
        ((right, 0.0), (right, 1.0), load),
        ((1.75, -0.62), (1.75, 0.62), load | {"connectionstyle": "arc3,rad=0.55"}),
    ):
        arrow(ax, tail, head, **look)
    for x, y, name, colour in (
        (left - 0.85, 0.0, "$h = 2R + t$", INK),
        (-0.42, 0.15 - top, "$R$", INK),
        (0.2, -NECK / 2 - 0.33, "$t$", INK),
        (right + 1.45, 0.0, "$F_x$", NOTE_COLOUR),
        (right + 0.3, 0.85, "$F_y$", NOTE_COLOUR),
        (1.5, -0.82, "$M_z$", NOTE_COLOUR),
    ):
        write(ax, (x, y), name, colour, 13, parse_math=True)
    ax.set(xlim=(-5.0, 5.0), ylim=(-1.5, 1.5), aspect="equal")
    ax.set_axis_off()
    return ax
