"""The drawings of compared mechanisms in one figure."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.importing.departure import fine_polygon
from flexfem.mechanism.plate import extent, plate_polygon
from flexfem.plot.drawing import fit, label_axes, scale_bar, xy
from flexfem.plot.style import (
    COLOURS,
    DASHES,
    INK,
    in_house_style,
    legend_below,
    new_axes,
    panels,
    titled,
)
from flexfem.questions.comparison import EQUAL_EDGES, Comparison, Labelled
from flexfem.questions.departed import ComparedPlate
from flexfem.results import SPACE
from flexfem.units import unit_for

WIDTH = 8.27  # in, of a page
LOWEST = 2.6  # in, of the drawings
HIGHEST = 7.5
LEGEND = 0.3  # in, of the names below the drawings
COLUMNS = 4  # of the names, at most
REFERENCE = "#9AA2AB"
# distance of edges per size of a plate, below which it is not seen in a drawing of the plate
UNSEEN = 0.01
WINDOW = 12.0  # width of the magnified part, per distance of the edges
SIDE = 0.55  # width of the magnified part, per width of the whole drawing


class Look(NamedTuple):
    """Label, colour, line and width, points, of one mechanism."""

    label: str
    colour: str
    dashes: Any
    width: float


def plot_overlay(ax: Axes | None, found: Comparison) -> Axes:
    """Draw the compared mechanisms over each other, to scale, mm; return `ax`, or new axes.

    The first is a wide grey outline, the others are in colours. A ring is an output, a cross is a
    point, and a line with two dots is an actuator.

    Parameters
    ----------
    ax : axes, or None.
    found : Comparison
        What `flexfem.compare` returns.
    """
    ax = ax or new_axes()
    points = [
        _draw(ax, each, look) for each, look in zip(found.subjects, looks(found), strict=True)
    ]
    fit(ax, np.vstack(points), 0.05)
    scale_bar(ax)
    label_axes(ax)
    return ax


def looks(found: Comparison) -> list[Look]:
    """Return how each mechanism is drawn: the first in grey, the others in colours."""
    first, *others = found.labels
    drawn = [Look(f"{first} (reference)", REFERENCE, "solid", 3.0)]
    for number, label in enumerate(others):
        colour = COLOURS[number % len(COLOURS)]
        dashes = DASHES[number % len(DASHES)]
        drawn.append(Look(label, colour, dashes, 1.1))
    return drawn


def _draw(
    ax: Axes,
    subject: Labelled,
    look: Look,
) -> Array:
    """Draw the edges and ports of a mechanism; return points (n, 2)."""
    shape = plate_polygon(subject.layout)
    _draw_edges(ax, shape, look)
    _draw_ports(ax, subject, look)
    return np.asarray(shapely.get_coordinates(shape))


def _draw_edges(
    ax: Axes,
    shape: Any,
    look: Look,
) -> None:
    """Draw the edges of a polygon; one of them has the label of the mechanism."""
    label = look.label
    for ring in shapely.get_rings(shapely.get_parts(shape)):
        ax.plot(
            *shapely.get_coordinates(ring).T,
            color=look.colour,
            linestyle=look.dashes,
            linewidth=look.width,
            label=label,
        )
        label = "_"  # no further entry of the legend


def _draw_ports(
    ax: Axes,
    subject: Labelled,
    look: Look,
) -> None:
    """Mark output, points and actuators of a mechanism."""
    colour = INK if look.colour == REFERENCE else look.colour
    size = 9.0 if look.colour == REFERENCE else 6.0
    for number, (_, contact) in enumerate(subject.layout.points):
        marker = "+" if number else "o"
        ax.plot(
            *xy(contact.point),
            marker,
            color=colour,
            markersize=size,
            markerfacecolor="none",
            zorder=6,
        )
    for actuator in subject.layout.actuators:
        ends = np.array([xy(each.point) for each in actuator.contacts])
        ax.plot(
            *ends.T,
            ".-",
            color=colour,
            linewidth=look.width,
            markersize=size,
            zorder=5,
        )


@in_house_style
def overlay_figure(found: Comparison) -> Figure:
    """Draw the compared mechanisms over each other, and where edges differ too little to be seen."""
    magnified = _magnified(found)
    count = 1 if magnified is None else 2
    title = f"{', '.join(found.labels[1:])} over {found.labels[0]}"
    lines = ["To scale, in the axes of the first. Ring: output; cross: point; dots: actuator."]
    grid = {"width_ratios": (1.0, SIDE)} if count == 2 else {}
    size = (WIDTH, _height(found, count) + LEGEND)
    figure, axes = panels(size, title, lines, 1, count, found, None, **grid)
    plot_overlay(axes[0], found)
    if magnified is not None:
        _plot_magnified(axes[1], found, magnified)
        titled(axes[0], "a", "the whole plates")
    legend_below(figure, axes[:1], COLUMNS)
    return figure


def _height(found: Comparison, count: int) -> float:
    """Return the height of the drawings on a page, in."""
    shapes = [plate_polygon(each.layout) for each in found.subjects]
    bounds = np.reshape(shapely.total_bounds(shapes), (2, 2))
    wide, high = np.ptp(bounds, axis=0)
    width = (WIDTH - 0.6) / (1 + SIDE * (count - 1))
    return float(np.clip(width * high / wide, LOWEST, HIGHEST)) + 0.5


def _magnified(found: Comparison) -> ComparedPlate | None:
    """Return the plate whose edges depart most, where no departure is seen in the whole drawing."""
    alike = [each for each in found.plates if not each.other_design]
    largest = max(alike, key=lambda each: each.edge_off_um, default=None)
    if largest is None or largest.edge_off_um < EQUAL_EDGES:
        return None
    size = extent(plate_polygon(found.subjects[0].layout))
    return largest if largest.edge_off_um < 1e3 * UNSEEN * size else None


def _plot_magnified(
    ax: Axes,
    found: Comparison,
    plate: ComparedPlate,
) -> None:
    """Draw the edges around the largest departure, which a mark of its size measures."""
    for each, look in zip(found.subjects, looks(found), strict=True):
        _draw_edges(ax, fine_polygon(each.layout), look)
    x, y = plate.edge_off_at_mm
    half = WINDOW / 2 * plate.edge_off_um / 1e3
    ax.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
    ax.set_aspect("equal")
    ax.ticklabel_format(useOffset=False)
    ax.tick_params(axis="x", labelrotation=45)
    label_axes(ax)
    unit = unit_for("x", plate.edge_off_um / 1e3)
    off = plate.edge_off_um / 1e3 * unit.factor
    titled(ax, "b", f"largest distance: {off:.3g}{SPACE}{unit}")
