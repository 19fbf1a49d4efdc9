"""What the thickness of a hinge out of plane does to its compliance, between plane stress and plane strain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.curves import COLOURS, DASHES
from flexfem.plot.numbers import SPACE
from flexfem.plot.style import GREY, INK, add_axes, header, in_house_style, new_figure, wrapped

FREEDOMS = ("rotation", "axial")
SYMBOLS = {"rotation": r"$\theta/M$", "axial": r"$\delta_x/F_x$"}
WIDTH, HEIGHT, AXES_LEFT, AXES_WIDTH, PANEL_GAP, FOOT = 8.27, 7.6, 0.85, 5.2, 0.5, 0.62  # in
TICKS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
LEGEND, LETTERS = 1.45, 8.5  # width of the legend's text, in, and its size, points
ROOM = 0.14  # of the distance between the limits, above and below: for their names
MARKS = "os^Dv"
MARK: Any = {"markersize": 7.0, "markerfacecolor": "white", "markeredgewidth": 1.6}


class ThicknessReview(NamedTuple):
    """What the figure shows.

    width : (n,), b/t, ascending.   ratio : (k,), t/R, one curve each.   poissons_ratio : of the material.
    rotation, axial : (k, n), compliances in three dimensions over those in plane stress.
    marked : hinges of a stage, what they are called to their t/R, b/t and factors in rotation and axially.
    source : of the factors, one line.
    """

    width: Array
    ratio: Array
    poissons_ratio: float
    rotation: Array
    axial: Array
    marked: Mapping[str, tuple[float, float, float, float]]
    source: str


@in_house_style
def thickness_figure(review: ThicknessReview) -> Figure:
    """Draw the factor out of plane over b/t, a panel for rotation and one for the axial freedom.

    Notes
    -----
    Both panels have the same axis, from plane strain, 1 - nu^2, to plane stress, 1.
    """
    figure = new_figure(WIDTH, HEIGHT)
    nu = review.poissons_ratio
    lines = [
        f"Compliance of a circular hinge of thickness b in three dimensions over that in plane stress, "
        f"ν{SPACE}={SPACE}{nu:g}, blocks as high as the notch. Below 1 the hinge is stiffer than plane stress says: "
        "a wide neck is held by its blocks from contracting out of plane, more so when bent than when pulled.",
        review.source,
    ]
    top = HEIGHT - header(figure, "Circular hinge: what its thickness does", lines, ()) - 0.32
    height = (top - FOOT - PANEL_GAP) / 2
    for row, freedom in enumerate(FREEDOMS):
        axes = add_axes(figure, AXES_LEFT, FOOT + (1 - row) * (height + PANEL_GAP), AXES_WIDTH, height)
        axes.set_title(f"({'ab'[row]}) {freedom}, {SYMBOLS[freedom]}", loc="left", parse_math=True)
        _draw_panel(axes, review, freedom)
        axes.tick_params(labelbottom=row == 1)
    axes.set_xlabel("b/t")
    figure.align_ylabels()
    return figure


def _draw_panel(axes: Axes, review: ThicknessReview, freedom: str) -> None:
    strain, x = 1 - review.poissons_ratio**2, review.width
    _draw_limit(axes, 1.0, "plane stress", "above")
    _draw_limit(axes, strain, f"plane strain, 1 − ν² = {strain:.3f}", "below")
    for index, (ratio, values) in enumerate(zip(review.ratio, getattr(review, freedom), strict=True)):
        style: dict[str, Any] = {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}
        axes.plot(x, values, label=f"t/R = {ratio:g}", linewidth=1.9, zorder=2 + index / 100, **style)
    for index, (name, (ratio, width, *found)) in enumerate(review.marked.items()):
        value = found[FREEDOMS.index(freedom)]
        text = wrapped(
            f"{name}: t/R{SPACE}={SPACE}{ratio:.3g}, b/t{SPACE}={SPACE}{width:.3g}, factor{SPACE}{value:.3f}",
            LEGEND,
            LETTERS,
        )
        axes.plot([width], [value], MARKS[index % len(MARKS)], color=INK, label=text, zorder=4, **MARK)
    room = ROOM * (1 - strain)
    axes.set(xscale="log", xlim=(x[0], x[-1]), ylim=(strain - room, 1 + room))
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.minorticks_off()
    axes.grid(color="#D5D5D5", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.set_ylabel("three dimensions / plane stress")
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "borderaxespad": 0.0}
    axes.legend(**place, frameon=False, fontsize=LETTERS, handlelength=3.2, labelspacing=0.7)


def _draw_limit(axes: Axes, value: float, name: str, side: Literal["above", "below"]) -> None:
    """A line across the panel with its name on the side that has no curves."""
    axes.axhline(value, color=INK, linewidth=1.4, zorder=1.5)
    align, shift = ("bottom", 2.5) if side == "above" else ("top", -3.5)
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    axes.annotate(name, (0.985, value), (0, shift), ha="right", va=align, size=8.5, color=GREY, **place)
