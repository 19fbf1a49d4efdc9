"""Figures of one hinge: sketch, formulas against finite elements, and influence of thickness."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.arrays import Array
from flexfem.files.refusals import shown
from flexfem.plot import style
from flexfem.plot.drawing import arrow, write
from flexfem.plot.style import COLOURS, GREY, INK, NOTE_COLOUR, panels, wrapped
from flexfem.questions.check import FormulaCurve, HingeReview, ThicknessReview
from flexfem.refused import BadInput
from flexfem.results import SPACE

SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$", "shear": r"$\delta_y/F_y$"}
FREEDOMS = tuple(SYMBOLS)
PALETTE = tuple(colour for colour in COLOURS if colour != "#000000")  # black: finite elements
EQUAL_RATIO = 1e-6  # relative difference of two exact forms of one integral
FLOOR = 0.4  # least ratio shown
WIDTH = 8.27  # in
LEGEND_WIDTH = 1.85  # in, of the text of a legend
FONT_SIZE = 8.0  # points, of the text of a legend
NECK = 0.42  # t/R of the sketch, independent of the stage
BLOCK = 1.5  # length of the blocks beside the notch over R


@style.in_house_style
def hinge_chart_figure(review: HingeReview) -> Figure:
    """Draw the ratio of every formula to the finite elements, one panel per freedom.

    Formulas that are algebraic forms of one integral share a curve. Ratios below `FLOOR` are not
    shown.
    """
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


class Coincident(NamedTuple):
    """Formulas whose curves coincide: their names, the first curve, and its ratios (points,)."""

    names: list[str]
    first: FormulaCurve
    ratios: Array


def merged(review: HingeReview, freedom: str) -> list[Coincident]:
    """Return groups of coincident curves of one freedom."""
    groups = list[Coincident]()
    for curve in review.curves:
        values = getattr(curve, freedom)
        if values is None:  # its source does not state it
            continue
        for group in groups:
            is_equal = np.allclose(group.ratios, values, EQUAL_RATIO, 0.0)
            if is_equal and group.first.valid == curve.valid:
                group.names.append(curve.name)
                break
        else:
            groups.append(Coincident([curve.name], curve, values))
    return groups


def plot_formulas(
    ax: Axes,
    review: HingeReview,
    freedom: str,
) -> Axes:
    """Draw the ratio of every formula to the finite elements in one freedom; return `ax`.

    A formula has the same line style in all three freedoms. Raises BadInput for an unknown freedom.
    """
    _require(freedom, FREEDOMS)
    x = review.ratio
    higher = getattr(review.higher, freedom)
    label = f"finite elements, H = h to {review.height:g}{SPACE}h\n1 to {np.max(higher):.2f}"
    shade = ax.fill_between(
        x,
        1.0,
        higher,
        color="#DADDE1",
        linewidth=0,
        zorder=1,
        label=label,
    )
    ax.plot(
        x,
        higher,
        color=GREY,
        linewidth=0.8,
        zorder=1.2,
    )
    ax.axhline(
        1.0,
        color=INK,
        linewidth=1.6,
        zorder=1.5,
    )
    order = list(
        dict.fromkeys(group.names[0] for each in FREEDOMS for group in merged(review, each))
    )
    lines = [
        _draw_curve(ax, x, group, order.index(group.names[0])) for group in merged(review, freedom)
    ]
    values = np.concatenate([[1.0], higher, *(np.asarray(line.get_ydata()) for line in lines)])
    low = max(float(values.min()), FLOOR)
    _set_axes(ax, x, (0.02, 0.05, 0.1, 0.2, 0.5, 1.0), low, float(values.max()))
    ax.set(xlabel="t/R", ylabel="formula / finite elements")
    look = {"fontsize": FONT_SIZE, "handlelength": 2.6, "labelspacing": 0.7}
    style.legend_beside(ax, handles=[*lines, shade], **look)
    return ax


def _require(freedom: str, known: Sequence[str]) -> None:
    if freedom not in known:
        raise BadInput(f"freedom {shown(freedom)}, expected one of {', '.join(known)}")


def _set_axes(
    ax: Axes,
    x: Array,
    ticks: Sequence[float],
    low: float,
    high: float,
) -> None:
    """Set a logarithmic x axis with plain tick labels, and y limits around `low` to `high`."""
    room = 0.08 * (high - low)
    ax.set(
        xscale="log",
        xlim=(x[0], x[-1]),
        ylim=(low - room, high + room),
    )
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.grid()


def _draw_curve(
    axes: Axes,
    x: Array,
    group: Coincident,
    index: int,
) -> Line2D:
    """Draw a curve: full with markers within its range, which two bars delimit, else pale."""
    colour = PALETTE[index % len(PALETTE)]
    axes.plot(
        x,
        group.ratios,
        color=colour,
        linewidth=1.0,
        alpha=0.45,
        zorder=2 + index / 100,
    )
    low = max(group.first.valid[0], x[0])
    high = min(group.first.valid[1], x[-1])
    at = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    within = np.interp(np.log(at), np.log(x), group.ratios)
    text = wrapped(", ".join(group.names), LEGEND_WIDTH, FONT_SIZE)
    text += f"\n{np.min(within):.2f} to {np.max(within):.2f} for t/R {low:.2g} to {high:.2g}"
    step = max(1, len(at) // 6)
    look: dict[str, Any] = {
        "color": colour,
        "linewidth": 1.8,
        "marker": style.MARKERS[index % len(style.MARKERS)],
        "markersize": 6.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.3,
        "markevery": (step // 2 + 2 * (index % 4), step),
        "zorder": 3 + index / 100,
    }
    (line,) = axes.plot(at, within, label=text, **look)
    bars = [k for k in (0, -1) if x[0] < at[k] < x[-1]]
    bar: dict[str, Any] = {"color": colour, "markersize": 11, "markeredgewidth": 1.8}
    axes.plot(at[bars], within[bars], "|", zorder=4, **bar)
    return line


@style.in_house_style
def thickness_figure(review: ThicknessReview) -> Figure:
    """Draw the ratio of compliance in three dimensions to that in plane stress over b/t."""
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


def plot_thickness(
    ax: Axes,
    review: ThicknessReview,
    freedom: str,
) -> Axes:
    """Draw the thickness factor of rotation or the axial freedom over b/t; return `ax`.

    Raises BadInput for another freedom.
    """
    _require(freedom, FREEDOMS[:2])
    strain = 1 - review.poissons_ratio**2
    _draw_limit(ax, 1.0, "plane stress", 3)
    _draw_limit(ax, strain, f"plane strain, 1 − ν² = {strain:.3f}", -11)
    curves = zip(review.ratio, getattr(review, freedom), strict=True)
    for index, (ratio, values) in enumerate(curves):
        dashes = style.DASHES[index % len(style.DASHES)]
        look: dict[str, Any] = {"color": COLOURS[index % len(COLOURS)], "linestyle": dashes}
        look |= {"linewidth": 1.9, "zorder": 2 + index / 100}
        ax.plot(review.width, values, label=f"t/R = {ratio:g}", **look)
    ticks = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    _set_axes(ax, review.width, ticks, strain - 0.01, 1.0)
    ax.set(xlabel="b/t", ylabel="three dimensions / plane stress")
    style.legend_beside(ax, handlelength=3.2, labelspacing=0.7)
    return ax


def _draw_limit(
    ax: Axes,
    value: float,
    name: str,
    shift: float,
) -> None:
    """Draw a line at a limit, with its name at a vertical distance in points."""
    ax.axhline(
        value,
        color=INK,
        linewidth=1.4,
        zorder=1.5,
    )
    place: dict[str, Any] = {"xycoords": ax.get_yaxis_transform(), "textcoords": "offset points"}
    ax.annotate(name, (0.985, value), (0, shift), ha="right", size=8.5, color=GREY, **place)


def plot_hinge(ax: Axes) -> Axes:
    """Draw the labelled sketch of the circular hinge, not to scale; return `ax`."""
    top = 1 + NECK / 2
    right = 1 + BLOCK
    left = -right - 0.45
    _draw_outline(ax, top, right)
    load: dict[str, Any] = {"colour": NOTE_COLOUR, "width": 2.0}
    arrow(ax, (left, -top), (left, top), "<|-|>")  # h
    arrow(ax, (0.0, -top), (-np.sqrt(0.5), np.sqrt(0.5) - top))  # R
    arrow(ax, (0.0, NECK / 2 + 0.45), (0.0, NECK / 2))  # t, on both sides
    arrow(ax, (0.0, -NECK / 2 - 0.45), (0.0, -NECK / 2))
    arrow(ax, (right, 0.0), (right + 1.2, 0.0), **load)
    arrow(ax, (right, 0.0), (right, 1.0), **load)
    arrow(ax, (1.75, -0.62), (1.75, 0.62), connectionstyle="arc3,rad=0.55", **load)
    labels = (
        (left - 0.85, 0.0, "$h = 2R + t$", INK),
        (-0.42, 0.15 - top, "$R$", INK),
        (0.2, -NECK / 2 - 0.33, "$t$", INK),
        (right + 1.45, 0.0, "$F_x$", NOTE_COLOUR),
        (right + 0.3, 0.85, "$F_y$", NOTE_COLOUR),
        (1.5, -0.82, "$M_z$", NOTE_COLOUR),
    )
    for x, y, name, colour in labels:
        write(ax, (x, y), name, colour, 13, parse_math=True)
    ax.set(
        xlim=(-5.0, 5.0),
        ylim=(-1.5, 1.5),
        aspect="equal",
    )
    ax.set_axis_off()
    return ax


def _draw_outline(
    ax: Axes,
    top: float,
    right: float,
) -> None:
    """Draw a full notch between two blocks, its axis, and the centre of one arc."""
    angle = np.linspace(0, np.pi, 91)
    notch = np.column_stack([-np.cos(angle), -top + np.sin(angle)])
    below = [[-right, -top]]
    end = [[right, -top], [right, top]]
    outline = np.concatenate([below, notch, end, -notch, [[-right, top]]])
    ax.fill(
        *outline.T,
        facecolor="#DDE3EA",
        edgecolor=INK,
        linewidth=1.4,
        zorder=3,
    )
    dashes = (0, (9, 2, 1.5, 2))
    ends = [-right - 0.3, right + 1.2]
    ax.plot(
        ends,
        [0, 0],
        color=INK,
        linewidth=0.7,
        linestyle=dashes,
        zorder=4,
    )
    ax.plot(
        0.0,
        -top,
        "+",
        color=INK,
        markersize=9,
        zorder=5,
    )
    ax.hlines([-top, top], -right - 0.6, -right - 0.1, color=GREY, linewidth=0.7)
