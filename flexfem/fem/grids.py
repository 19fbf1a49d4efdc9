"""Meshes of plain regions: mapped grids with every node on the exact geometry, and gmsh's for lines and arcs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.drawing import Job
from flexfem.fem.gmsh_process import run_mesher
from flexfem.fem.mesh import StageMesh, ordered
from flexfem.stage.outline import Face

TIME_LIMIT = 60.0  # s, for gmsh
SIDES = ("left", "right", "bottom", "top")


def mapped(columns: int, rows: int, place: Callable[[Array, Array], Array]) -> StageMesh:
    """A grid of the unit square, every cell cut into two quadratic triangles, put in its place by a map.

    Parameters
    ----------
    place : u, v (...) in 0..1 to points (..., 2), mm, without turning the square over. Middle nodes are mapped too.

    The edges are labelled `left` (u = 0), `right` (u = 1), `bottom` (v = 0) and `top` (v = 1).
    """
    number = np.arange((2 * columns + 1) * (2 * rows + 1)).reshape(2 * rows + 1, 2 * columns + 1)
    v, u = np.meshgrid(np.linspace(0, 1, 2 * rows + 1), np.linspace(0, 1, 2 * columns + 1), indexing="ij")
    nodes = np.asarray(place(u, v)).reshape(-1, 2)

    def at(row: int, column: int) -> Index:
        """Nodes of all cells at a place in 0..2 by 0..2 of the cell."""
        return number[row : row + 2 * rows - 1 : 2, column : column + 2 * columns - 1 : 2].ravel()

    lower = [at(0, 0), at(0, 2), at(2, 2), at(0, 1), at(1, 2), at(1, 1)]
    upper = [at(0, 0), at(2, 2), at(2, 0), at(1, 1), at(2, 1), at(1, 0)]
    triangles = np.concatenate([np.stack(lower, axis=-1), np.stack(upper, axis=-1)])
    lines = (number[:, 0], number[:, -1], number[0], number[-1])
    edges = {side: np.stack([n[:-1:2], n[2::2], n[1::2]], axis=-1) for side, n in zip(SIDES, lines, strict=True)}
    return ordered(StageMesh(nodes, triangles, np.zeros(len(triangles), dtype=np.int64), edges))[0]


def meshed(face: Face, sizes: Sequence[str], curvature: float) -> StageMesh:
    """Mesh one face of lines and arcs with gmsh in its own process; `sizes` and `curvature` as in `drawing.Job`.

    Raises ComputationFailed as `run_mesher` does.
    """
    found = run_mesher(Job([face], list(sizes), curvature, {}), TIME_LIMIT)
    edges = {str(label): found["edges"][found["edge_labels"] == label] for label in np.unique(found["edge_labels"])}
    return ordered(StageMesh(found["nodes"], found["triangles"], found["faces"], edges))[0]


def size_of(mesh: StageMesh) -> float:
    """Typical size of a triangle over that of the whole: one over the root of their number."""
    return float(len(mesh.triangles) ** -0.5)


def on_chords(mesh: StageMesh) -> StageMesh:
    """The mesh with every middle node moved to the middle of its chord: straight triangles."""
    nodes = mesh.nodes.copy()
    t = mesh.triangles
    nodes[t[:, 3:]] = (nodes[t[:, :3]] + nodes[t[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)
