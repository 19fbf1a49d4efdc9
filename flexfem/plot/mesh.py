"""Meshes of quadratic triangles in drawings: their outlines, and filled triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.path import Path

from flexfem.arrays import AnyArray, Array, Index
from flexfem.plot.style import INK, PALE

MESH_COLOUR = "#5B7FA6"
SIDES = np.array(((0, 1, 3), (1, 2, 4), (2, 0, 5)))  # ends and middle of the sides of a triangle
# linear triangles on the nodes of a quadratic one
QUARTERS = np.array(((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)))


def boundary_of(triangles: AnyArray) -> Index:
    """Return the boundary edges (k, 3) of triangles (m, 6): end nodes and middle node."""
    sides = triangles[:, SIDES].reshape(-1, 3)
    _, first, count = np.unique(sides[:, 2], return_index=True, return_counts=True)
    return np.asarray(sides[first[count == 1]])


def draw_boundary(
    axes: Axes, nodes: Array, edges: Index, colour: str, width: float, zorder: float = 3
) -> None:
    """Draw quadratic edges (k, 3) through their middle nodes.

    They are one path, which keeps vector files small.
    """
    points = nodes[edges[:, [0, 2, 1]]].reshape(-1, 2)
    path = Path(points, np.tile([Path.MOVETO, Path.LINETO, Path.LINETO], len(edges)))
    look: dict[str, Any] = {"facecolors": "none", "edgecolors": colour, "linewidths": width}
    axes.add_collection(PathCollection([path], **look, zorder=zorder), autolim=False)


def draw_mesh(
    axes: Axes,
    nodes: Array,
    triangles: AnyArray,
    width: float,
) -> None:
    """Draw filled triangles (m, 6), and their boundary as a thicker line."""
    look: dict[str, Any] = {"facecolors": PALE, "edgecolors": MESH_COLOUR, "linewidths": width}
    outlines = list(nodes[triangles[:, [0, 3, 1, 4, 2, 5]]])
    filled = PolyCollection(outlines, rasterized=True, **look, zorder=2)
    axes.add_collection(filled, autolim=False)
    draw_boundary(axes, nodes, boundary_of(triangles), INK, max(0.8, 2 * width))
