"""Curved quadratic triangles as things to draw: edges, curves, boundary loops. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

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
