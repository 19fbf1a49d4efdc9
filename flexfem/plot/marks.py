"""What drawings share: arrows, hatched ground, frames, places for labels, and curved quadratic triangles to draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import FancyArrowPatch

from flexfem.arrays import AnyArray, Array, Index
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


SIDES = ((0, 1, 3), (1, 2, 4), (2, 0, 5))  # ends and middle of the sides of a triangle
QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
STRAIGHT = 1e-6  # distance of a middle from the chord, per length of the chord, below which a side is straight


class Edges(NamedTuple):
    """Sides of triangles: ends and middle, (k, 3), walked with their triangle on the left.

    every : each side once.  boundary : those of one triangle only.
    """

    every: Index
    boundary: Index


def edges_of(triangles: AnyArray) -> Edges:
    """Sides of the triangles (m, 6)."""
    sides = np.concatenate([triangles[:, list(side)] for side in SIDES])
    _, first, count = np.unique(sides[:, 2], return_index=True, return_counts=True)
    return Edges(sides[first], sides[first[count == 1]])


def loops_of(boundary: Index) -> list[Index]:
    """Boundary edges (k, 3) as closed loops, each (n, 3) in the order walked; the longest first."""
    follow: dict[int, list[int]] = {}
    for number, (start, _, _) in enumerate(boundary.tolist()):
        follow.setdefault(start, []).append(number)
    loops = []
    while follow:
        at, loop = next(iter(follow)), []
        while at in follow:
            number = follow[at].pop()
            if not follow[at]:
                del follow[at]
            loop.append(number)
            at = int(boundary[number, 1])
        loops.append(boundary[loop])
    return sorted(loops, key=len, reverse=True)


def curves(nodes: Array, edges: Index, pieces: int) -> Array:
    """Points (k, pieces + 1, 2) along quadratic edges (k, 3)."""
    s = np.linspace(0.0, 1.0, pieces + 1)
    shapes = np.array([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
    return np.asarray(np.einsum("sp,ksi->kpi", shapes, nodes[edges]))


def drawn_edges(nodes: Array, edges: Index, pieces: int) -> list[Array]:
    """Polylines along the edges (k, 3), straight ones with two points."""
    bent = bending(nodes, edges)
    return [*nodes[edges[~bent][:, :2]], *curves(nodes, edges[bent], pieces)]


def bending(nodes: Array, edges: Index) -> AnyArray:
    """Whether each of the edges (k, 3) is curved."""
    ends = nodes[edges[:, :2]]
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    bow = np.linalg.norm(nodes[edges[:, 2]] - ends.mean(axis=1), axis=1)
    return np.asarray(bow > STRAIGHT * chord)


def polygon(nodes: Array, loop: Index, pieces: int = 4) -> Array:
    """Closed polygon (n, 2) along a loop of edges."""
    points = curves(nodes, loop, pieces)[:, :-1].reshape(-1, 2)
    return np.vstack([points, points[:1]])


def quarters(triangles: AnyArray) -> Index:
    """Linear triangles (4 m, 3) on the nodes of quadratic ones (m, 6)."""
    return np.concatenate([triangles[:, list(quarter)] for quarter in QUARTERS])


def clamped_edges(boundary: Index, displacement: Array) -> Index:
    """Boundary edges (k, 3) whose nodes do not move at all under load: those held by the ground."""
    held = ~np.any(displacement != 0.0, axis=1)
    return np.asarray(boundary[held[boundary].all(axis=1)])
