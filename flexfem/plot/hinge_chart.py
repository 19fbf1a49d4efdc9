"""One hinge: every formula against plane finite elements over t/R, and what its thickness does to both."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexfem.arrays import Array
from flexfem.plot.curves import COLOURS, DASHES, MARKERS
from flexfem.plot.style import GREY, INK, in_house_style, legend_beside, panels, wrapped
from flexfem.plot.text import SPACE
from flexfem.verify.hinges import HingeReview, ThicknessReview

FREEDOMS = ("rotation", "axial", "shear")
SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$", "shear": r"$\delta_y/F_y$"}
PALETTE = tuple(colour for colour in COLOURS if colour != "#000000")  # black are the finite elements
SAME = 1e-6  # of a ratio: two exact forms of one integral
ROOM = 0.06  # of the ratio's range, above and below
FLOOR = 0.4  # least ratio shown: below it a formula is of no use
WIDTH, HEIGHT = 8.27, 8.2  # in
MARKS = 5  # on a curve
LEGEND, LETTERS = 1.85, 8.0  # width of the legend's text, in, and its size, points
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
THICKNESSES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # ticks of b/t
LIMIT_ROOM = 0.14  # of the distance between plane stress and plane strain, above and below: for their names
HINGE_MARKS = "os^Dv"
HINGE_LOOK: Any = {"markersize": 7.0, "markerfacecolor": "white", "markeredgewidth": 1.6}


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
    figure, found = panels((WIDTH, HEIGHT), "Circular hinge: formulas against finite elements", lines, 3)
    for row, (axes, freedom) in enumerate(zip(found, FREEDOMS, strict=True)):
        axes.set_title(f"({'abc'[row]}) {freedom}, {SYMBOLS[freedom]}", loc="left", parse_math=True)
        plot_formulas(axes, review, freedom)
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
        for known in found:
            if known.valid == curve.valid and np.allclose(known.values, values, rtol=SAME, atol=0.0):
                known.names.append(curve.name)
                break
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
    ends, drawn = [1.0, float(np.max(higher))], []
    for group in merged(review, freedom):
        line = _draw_curve(ax, x, group, looks.index(group.names[0]))
        drawn.append(line)
        ends += [float(np.min(line.get_ydata())), float(np.max(line.get_ydata()))]
    low, high = max(min(ends), FLOOR), max(ends)
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(low - ROOM * (high - low), high + ROOM * (high - low)))
    ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    ax.minorticks_off()
    ax.grid()
    ax.set(xlabel="t/R", ylabel="formula / finite elements")
    legend_beside(ax, handles=[*drawn, shade], fontsize=LETTERS, handlelength=2.6, labelspacing=0.7)
    return ax


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


@in_house_style
def thickness_figure(review: ThicknessReview) -> Figure:
    """Draw the factor out of plane over b/t, a panel for rotation and one for the axial freedom.

    Notes
    -----
    Both panels have the same axis, from plane strain, 1 - nu^2, to plane stress, 1.
    """
    nu = review.poissons_ratio
    lines = [
        f"Compliance of a circular hinge of thickness b in three dimensions over that in plane stress, "
        f"ν{SPACE}={SPACE}{nu:g}, blocks as high as the notch. Below 1 the hinge is stiffer than plane stress says: "
        "a wide neck is held by its blocks from contracting out of plane, more so when bent than when pulled.",
        review.source,
    ]
    figure, found = panels((WIDTH, 6.6), "Circular hinge: what its thickness does", lines, 2)
    for row, (axes, freedom) in enumerate(zip(found, FREEDOMS, strict=False)):
        axes.set_title(f"({'ab'[row]}) {freedom}, {SYMBOLS[freedom]}", loc="left", parse_math=True)
        plot_thickness(axes, review, freedom)
        axes.label_outer()
    return figure


def plot_thickness(ax: Axes, review: ThicknessReview, freedom: str) -> Axes:
    """Draw the factor of one freedom, rotation or axial, over b/t; returns `ax`."""
    strain, x = 1 - review.poissons_ratio**2, review.width
    _draw_limit(ax, 1.0, "plane stress", "above")
    _draw_limit(ax, strain, f"plane strain, 1 − ν² = {strain:.3f}", "below")
    for index, (ratio, values) in enumerate(zip(review.ratio, getattr(review, freedom), strict=True)):
        style: dict[str, Any] = {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}
        ax.plot(x, values, label=f"t/R = {ratio:g}", linewidth=1.9, zorder=2 + index / 100, **style)
    for index, (name, (ratio, width, *found)) in enumerate(review.marked.items()):
        value = found[FREEDOMS.index(freedom)]
        sizes = f"t/R{SPACE}={SPACE}{ratio:.3g}, b/t{SPACE}={SPACE}{width:.3g}, factor{SPACE}{value:.3f}"
        text = wrapped(f"{name}: {sizes}", 1.45, 8.5)
        mark = HINGE_MARKS[index % len(HINGE_MARKS)]
        ax.plot([width], [value], mark, color=INK, label=text, zorder=4, **HINGE_LOOK)
    room = LIMIT_ROOM * (1 - strain)
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(strain - room, 1 + room))
    ax.set_xticks(THICKNESSES, [f"{tick:g}" for tick in THICKNESSES])
    ax.minorticks_off()
    ax.grid()
    ax.set(xlabel="b/t", ylabel="three dimensions / plane stress")
    legend_beside(ax, fontsize=8.5, handlelength=3.2, labelspacing=0.7)
    return ax


def _draw_limit(axes: Axes, value: float, name: str, side: Literal["above", "below"]) -> None:
    """A line across the panel with its name on the side that has no curves."""
    axes.axhline(value, color=INK, linewidth=1.4, zorder=1.5)
    align, shift = ("bottom", 2.5) if side == "above" else ("top", -3.5)
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    axes.annotate(name, (0.985, value), (0, shift), ha="right", va=align, size=8.5, color=GREY, **place)
