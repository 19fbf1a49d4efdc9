"""Every hinge formula against plane-stress finite elements over t/R: which one to trust, where, for which freedom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.arrays import Array
from flexfem.plot.curves import COLOURS, MARKERS
from flexfem.plot.numbers import SPACE
from flexfem.plot.style import GREY, INK, add_axes, header, in_house_style, new_figure, wrapped

FREEDOMS = ("rotation", "axial", "shear")
SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$", "shear": r"$\delta_y/F_y$"}
PALETTE = tuple(colour for colour in COLOURS if colour != "#000000")  # black are the finite elements
SAME = 1e-6  # of a ratio: two exact forms of one integral
ROOM = 0.06  # of the ratio's range, above and below
FLOOR = 0.4  # least ratio shown: below it a formula is of no use
WIDTH, HEIGHT, AXES_LEFT, AXES_WIDTH, PANEL_GAP, FOOT = 8.27, 9.6, 0.75, 4.85, 0.42, 0.62  # in
MARKS = 5  # on a curve
LEGEND, LETTERS = 1.85, 8.0  # width of the legend's text, in, and its size, points
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class FormulaCurve(NamedTuple):
    """A formula over finite elements of a full notch, H = h.

    name : in the registry.   valid : smallest and largest t/R it is meant for.
    rotation, axial, shear : (n,), ratios of compliances; None for a freedom that its source does not state.
    """

    name: str
    valid: tuple[float, float]
    rotation: Array | None
    axial: Array | None
    shear: Array | None


class HingeReview(NamedTuple):
    """What the figure shows.

    ratio : (n,), t/R, ascending.   curves : the formulas.
    height : H/h of the higher blocks.   higher : finite elements with those over finite elements with H = h.
    poissons_ratio : for the shear compliances.   source : of the finite elements, one line.
    """

    ratio: Array
    curves: Sequence[FormulaCurve]
    height: float
    higher: FormulaCurve
    poissons_ratio: float
    source: str


@in_house_style
def hinge_chart_figure(review: HingeReview) -> Figure:
    """Draw the ratio of every formula to the finite elements, a panel for each freedom.

    Notes
    -----
    Formulas that are the same integral in different algebra share one curve. Ratios below `FLOOR` are not shown.
    """
    figure = new_figure(WIDTH, HEIGHT)
    lines = [
        "Compliance by formula over that of plane-stress finite elements of a full notch, H = h = 2R + t, between "
        f"elastic blocks; ν{SPACE}={SPACE}{review.poissons_ratio:g}, which acts on shear alone. Below 1 the formula is "
        "too stiff. Full line between bars: the formula's range of t/R, as published or else as the registry has it; "
        f"pale: outside. Shaded: finite elements with higher blocks, to H{SPACE}={SPACE}{review.height:g}{SPACE}h. "
        "A formula has a curve for the freedoms that its source states.",
        review.source,
    ]
    top = HEIGHT - header(figure, "Circular hinge: formulas against finite elements", lines, ()) - 0.32
    height = (top - FOOT - 2 * PANEL_GAP) / 3
    leading = dict.fromkeys(group.names[0] for freedom in FREEDOMS for group in merged(review, freedom))
    styles = {name: index for index, name in enumerate(leading)}
    for row, freedom in enumerate(FREEDOMS):
        axes = add_axes(figure, AXES_LEFT, FOOT + (2 - row) * (height + PANEL_GAP), AXES_WIDTH, height)
        axes.set_title(f"({'abc'[row]}) {freedom}, {SYMBOLS[freedom]}", loc="left", parse_math=True)
        _draw_panel(axes, review, freedom, styles)
        axes.tick_params(labelbottom=row == 2)
    axes.set_xlabel("t/R")
    figure.align_ylabels()
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
        for known in found:
            if known.valid == curve.valid and np.allclose(known.values, values, rtol=SAME, atol=0.0):
                known.names.append(curve.name)
                break
        else:
            found.append(Merged([curve.name], curve.valid, values))
    return found


def _draw_panel(axes: Axes, review: HingeReview, freedom: str, styles: dict[str, int]) -> None:
    x, higher = review.ratio, getattr(review.higher, freedom)
    label = f"finite elements, H = h to {review.height:g}{SPACE}h\n1 to {np.max(higher):.2f}"
    shade = axes.fill_between(x, 1.0, higher, color="#DADDE1", linewidth=0, zorder=1, label=label)
    axes.plot(x, higher, color=GREY, linewidth=0.8, zorder=1.2)
    axes.axhline(1.0, color=INK, linewidth=1.6, zorder=1.5)
    ends, drawn = [1.0, float(np.max(higher))], []
    for group in merged(review, freedom):
        line = _draw_curve(axes, x, group, styles[group.names[0]])
        drawn.append(line)
        ends += [float(np.min(line.get_ydata())), float(np.max(line.get_ydata()))]
    low, high = max(min(ends), FLOOR), max(ends)
    axes.set(xscale="log", xlim=(x[0], x[-1]), ylim=(low - ROOM * (high - low), high + ROOM * (high - low)))
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.minorticks_off()
    axes.grid(color="#C9CDD2", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.set_ylabel("formula / finite elements")
    axes.legend(
        handles=[*drawn, shade],
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        borderaxespad=0.0,
        frameon=False,
        fontsize=LETTERS,
        handlelength=2.6,
        labelspacing=0.7,
    )


def _draw_curve(axes: Axes, x: Array, group: Merged, index: int) -> Line2D:
    """One curve: full with marks between the bars that end its range, thin and pale outside."""
    colour = PALETTE[index % len(PALETTE)]
    axes.plot(x, group.values, color=colour, linewidth=1.0, alpha=0.45, zorder=2 + index / 100)
    low, high = max(group.valid[0], x[0]), min(group.valid[1], x[-1])
    at = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    within = np.interp(np.log(at), np.log(x), group.values)
    names = wrapped(", ".join(group.names), LEGEND, LETTERS)
    text = f"{names}\n{np.min(within):.2f} to {np.max(within):.2f} for t/R {low:.2g} to {high:.2g}"
    marks = np.linspace(0, len(at) - 1, MARKS + 2).astype(int)[1:-1] + 2 * (index % 4)
    style: dict[str, Any] = {"color": colour, "linewidth": 1.8, "markersize": 6.0, "markerfacecolor": "white"}
    style |= {"marker": MARKERS[index % len(MARKERS)], "markeredgewidth": 1.3, "zorder": 3 + index / 100}
    (line,) = axes.plot(at, within, markevery=[int(k) for k in marks if k < len(at)], label=text, **style)
    bars = [k for k in (0, -1) if x[0] < at[k] < x[-1]]
    axes.plot(at[bars], within[bars], "|", color=colour, markersize=11, markeredgewidth=1.8, zorder=4)
    return line
