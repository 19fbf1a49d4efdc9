"""Elements of all drawings to scale: arrows, texts beside obstacles, axes, scale bars, windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from flexfem.arrays import Array
from flexfem.plot.style import INK, NOTE_COLOUR, wrapped
from flexfem.plot.text import round_factor
from flexfem.refused import BadInput
from flexfem.results import SPACE
from flexfem.units import LENGTH

Point = Sequence[float] | Array
DIMENSION = "#00664A"
CLASH = "#D00000"
WHITE_BOX = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"}


def arrow(
    axes: Axes,
    tail: Point,
    head: Point,
    style: str = "-|>",
    colour: str = INK,
    width: float = 1.0,
    **shape: Any,
) -> None:
    """Draw a thin arrow from `tail` to `head`, in data coordinates."""
    look: dict[str, Any] = {
        "mutation_scale": 9.0,
        "shrinkA": 0.0,
        "shrinkB": 0.0,
        "zorder": 6.0,
    }
    look |= shape
    start = (tail[0], tail[1])
    end = (head[0], head[1])
    patch = FancyArrowPatch(start, end, arrowstyle=style, color=colour, linewidth=width, **look)
    axes.add_patch(patch)


def write(
    axes: Axes, at: Point, text: str, colour: str = INK, size: float = 9.0, **style: Any
) -> Text:
    """Write a text centred at a point, in data coordinates; return it."""
    look: dict[str, Any] = {
        "ha": "center",
        "va": "center",
        "size": size,
        "color": colour,
        "zorder": 8,
    } | style
    return axes.text(float(at[0]), float(at[1]), text, **look)


def text_box(text: Text) -> Any:
    """Return the box of a text in a drawing as a polygon."""
    assert text.axes is not None
    corners = text.get_window_extent().corners()
    low, _, _, high = text.axes.transData.inverted().transform(corners)
    return shapely.box(*low, *high)


def frame_cross(
    axes: Axes,
    length: float,
    at: complex = 0j,
) -> list[Any]:
    """Draw the x and y axes of the platform or output at a point; return their lines and names."""
    look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center"}
    look |= {"color": NOTE_COLOUR, "size": 9.0, "zorder": 8}
    look["path_effects"] = [withStroke(linewidth=2.0, foreground="white")]
    directions = {"x": (1, (0.0, -9.0)), "y": (1j, (-9.0, 0.0))}
    drawn = list[Any]()
    for name, (direction, offset) in directions.items():
        tip = xy(at + length * direction)
        arrow(axes, xy(at), tip, colour=NOTE_COLOUR, width=1.2)
        drawn.append(shapely.LineString([xy(at), tip]))
        drawn.append(text_box(axes.annotate(name, tip, offset, **look)))
    return drawn


def fit(
    axes: Axes,
    points: Array,
    room: float = 0.1,
) -> float:
    """Set equal scales with room for labels around points (n, 2); return their largest extent."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    size = float(max(high - low))
    axes.set_xlim(low[0] - room * size, high[0] + room * size)
    axes.set_ylim(low[1] - room * size, high[1] + room * size)
    # with another anchor the layout engine overestimates the room for the title
    axes.set_aspect("equal", anchor="N")
    return size


def fit_to_one_scale(axes: Sequence[Axes], points: Array) -> None:
    """Set all axes to one scale for drawings through points (n, 2), with one scale bar."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    room = 0.02 * np.ptp(points)
    for ax in axes:
        ax.set_xlim(low[0] - room, high[0] + room)
        ax.set_ylim(low[1] - 5 * room, high[1] + room)
        ax.set_aspect("equal")
    _draw_bar(axes[0], low - [0.0, 3 * room], 0.4 * float(high[0] - low[0]), ", all drawings")


def scale_bar(ax: Axes) -> None:
    """Draw a scale bar of a round length below a drawing, whose limits are lowered for it."""
    low, high = ax.get_xlim()
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom - 0.03 * (top - bottom), top)
    _draw_bar(ax, np.array([low + 0.02 * (high - low), bottom]), 0.25 * (high - low))


def _draw_bar(
    ax: Axes,
    at: Array,
    longest: float,
    note: str = "",
) -> None:
    length = round_factor(longest)
    ends = [at[0], at[0] + length]
    ax.plot(
        ends,
        [at[1], at[1]],
        color=INK,
        linewidth=2.5,
        solid_capstyle="butt",
    )
    text = f"{length:g}{SPACE}{LENGTH}{note}"
    x = at[0] + length + 0.05 * longest
    ax.text(
        x,
        at[1],
        text,
        size=7.5,
        va="center",
        in_layout=False,
    )


def label_axes(ax: Axes) -> None:
    """Label both axes."""
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")


def xy(z: complex) -> tuple[float, float]:
    """Return the coordinates of a point."""
    return float(z.real), float(z.imag)


def mark_clashes(
    ax: Axes,
    refusal: BadInput | None,
    clashes: Sequence[Any],
) -> None:
    """Draw polygons at fault in red, with the refusal, if any, as title."""
    if refusal is None:
        return
    look: dict[str, Any] = {"facecolor": f"{CLASH}80", "edgecolor": CLASH, "linewidth": 2.0}
    for polygon in clashes:
        ax.add_patch(Polygon(polygon.exterior.coords, **look, zorder=7))
    text = f"{refusal}. Red: the parts at fault" if clashes else str(refusal)
    ax.set_title(wrapped(text, 7.4, 9), color=CLASH, size=9)


def show_window(draw: Callable[[Axes], object], title: str) -> bool:
    """Show a drawing in a window until it is closed; return False where none can be opened."""
    from matplotlib import pyplot

    try:
        figure, ax = pyplot.subplots(figsize=(8.27, 8.27), layout="constrained")
    except ImportError:  # the backend that the user has set is not available
        return False
    interactive = figure.canvas.required_interactive_framework is not None
    if interactive:
        ax.set_title(title, wrap=True)
        draw(ax)
        pyplot.show()
    pyplot.close(figure)
    return interactive
