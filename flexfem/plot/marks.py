"""Marks that drawings share: arrows, hatched ground, frames, and places where a label is clear of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import Array, Index
from flexfem.plot.style import INK

Point = Sequence[float] | Array


def arrow(axes: Axes, tail: Point, head: Point, style: str = "-|>", colour: str = INK, width: float = 1.0) -> None:
    """A slim arrow from `tail` to `head`, in data coordinates."""
    points: Any = [(float(p[0]), float(p[1])) for p in (tail, head)]
    shape: dict[str, Any] = {"arrowstyle": style, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0, "zorder": 6.0}
    axes.add_patch(FancyArrowPatch(*points, color=colour, linewidth=width, **shape))


def write(axes: Axes, at: Point, text: str, colour: str = INK, size: float = 9.0, **style: Any) -> None:
    """A text centred at a place, in data coordinates."""
    axes.text(float(at[0]), float(at[1]), text, ha="center", va="center", size=size, color=colour, zorder=8, **style)


def frame_cross(axes: Axes, length: float) -> None:
    """The platform's frame at the origin: X, Y."""
    for head, beside, name in (((1.0, 0.0), (0.9, -0.3), "X"), ((0.0, 1.0), (-0.3, 0.9), "Y")):
        arrow(axes, (0.0, 0.0), length * np.array(head), colour="#B00000", width=1.2)
        write(axes, length * np.array(beside), name, "#B00000")


def show_window(axes: Axes, low: Array, high: Array) -> None:
    """Show at least the window from corner `low` to `high`, with equal scales, in the whole of the axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    inches = np.array(axes.get_position().size) * figure.get_size_inches()
    half = float(np.max((high - low) / inches)) * inches / 2
    middle = (low + high) / 2
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    axes.set_aspect("equal")


def hatch_ground(axes: Axes, nodes: Array, edges: Index, depth: float) -> None:
    """Hatch a strip of ground so deep, in mm, outside the edges (k, 3) that are walked with the body on the left."""
    ends = nodes[edges[:, :2]]
    along = ends[:, 1] - ends[:, 0]
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    strips = np.concatenate([ends, (ends + depth * outward[:, None])[:, ::-1]], axis=1)
    axes.add_collection(
        PolyCollection(list(strips), facecolors="none", edgecolors=INK, linewidths=0.0, hatch="//////", zorder=4),
        autolim=False,
    )
    axes.add_collection(LineCollection(list(ends), colors=INK, linewidths=2.2, zorder=4), autolim=False)


def clear_spot(anchor: Array, distance: float, taken: Array, enough: float, half: float = 0.0) -> Array:
    """The place (2,) around an anchor, at 1 to 2 times the distance, that is clearest of the points taken (n, 2).

    A clearance of `enough` or more counts as enough: the nearer place is then better. The label reaches `half` to the
    left and right of its place.
    """
    angles = np.arange(24) * (2 * np.pi / 24)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    spots = np.concatenate([anchor + reach * distance * ring for reach in (1.0, 1.35, 1.7, 2.0)])
    near = taken[np.linalg.norm(taken - anchor, axis=1) < 2.0 * distance + 2.0 * enough + half]
    label = spots[:, None] + half * np.array([[-1.0, 0.0], [-0.5, 0.0], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    clearance = np.linalg.norm(label[:, :, None] - near, axis=-1).min(axis=(1, 2), initial=np.inf)
    return np.asarray(spots[int(np.argmax(np.round(np.minimum(clearance, enough), 9)))])
