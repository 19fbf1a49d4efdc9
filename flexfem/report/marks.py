"""Marks that drawings share: arrows, hatched ground, frames, and places where a label is clear of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import Array, Index
from flexfem.report.style import INK

Point = Sequence[float] | Array


def arrow(axes: Axes, tail: Point, head: Point, style: str = "-|>", colour: str = INK, width: float = 1.0) -> None:
    """A slim arrow from `tail` to `head`, in data coordinates."""
    points: Any = [(float(p[0]), float(p[1])) for p in (tail, head)]
    shape = {"arrowstyle": style, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0, "zorder": 6.0}
    axes.add_patch(FancyArrowPatch(*points, color=colour, linewidth=width, **shape))


def frame_cross(axes: Axes, length: float) -> None:
    """The platform's frame at the origin: X, Y."""
    for direction, name in (((1.0, 0.0), "X"), ((0.0, 1.0), "Y")):
        head = length * np.array(direction)
        arrow(axes, (0.0, 0.0), head, colour="#B00000", width=1.2)
        axes.text(*(1.14 * head), name, color="#B00000", size=9, ha="center", va="center", zorder=7)


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
