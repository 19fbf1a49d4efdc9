"""A figure as SVG to stand inside a page, and the places in it that tell their values."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.plot.style import house_style

SETTINGS: Any = {"svg.fonttype": "none", "svg.hashsalt": "flexfem", "svg.image_inline": True}
NO_METADATA: Any = dict.fromkeys(("Date", "Creator", "Format", "Type"))
POINTS = 72.0  # per inch


class Spot(NamedTuple):
    """A place on axes, in their data, that tells `text` when it is pointed at: a point, or a box of a size."""

    ax: Axes
    x: float
    y: float
    text: str
    width: float = 0.0
    height: float = 0.0


class PlacedSpot(NamedTuple):
    """A spot in points from the upper left corner of its figure: its middle, and half its width and height."""

    x: float
    y: float
    half_width: float
    half_height: float
    text: str


def figure_of(drawn: Figure | Axes) -> Figure:
    """The figure itself, or the one that holds the axes."""
    found = drawn.get_figure(root=True) if isinstance(drawn, Axes) else drawn
    assert isinstance(found, Figure)
    return found


def svg_bytes(drawn: Figure | Axes, dpi: int = 120) -> bytes:
    """The figure as an SVG file, its text as text; the same figure gives the same bytes.

    dpi : of what is rasterised in it.
    """
    buffer = io.BytesIO()
    with house_style(), mpl.rc_context(SETTINGS), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # the reader's machine may have it
        figure_of(drawn).savefig(buffer, format="svg", dpi=dpi, metadata=NO_METADATA)
    return buffer.getvalue()


def placed_spots(drawn: Figure | Axes, spots: Sequence[Spot]) -> list[PlacedSpot]:
    """Where spots are on a figure that has been drawn; those outside their axes are left out."""
    figure = figure_of(drawn)
    scale, height = POINTS / figure.dpi, figure.get_size_inches()[1] * POINTS
    found = []
    for spot in spots:
        half_x, half_y = spot.width / 2, spot.height / 2
        low = spot.ax.transData.transform((spot.x - half_x, spot.y - half_y))
        high = spot.ax.transData.transform((spot.x + half_x, spot.y + half_y))
        middle = (low + high) / 2
        half_width, half_height = (abs(high - low) / 2 * scale).tolist()
        if spot.ax.get_window_extent().padded(1.0).contains(*middle):
            found.append(PlacedSpot(middle[0] * scale, height - middle[1] * scale, half_width, half_height, spot.text))
    return found
