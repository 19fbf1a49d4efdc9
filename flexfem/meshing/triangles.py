"""Quadratic triangles of faces that gmsh has drawn."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.meshing.requests import NamedArrays

# gmsh types of quadratic elements and their nodes
TRIANGLE = (9, 6)
EDGE = (8, 3)


class Drawn(NamedTuple):
    """Curves of gmsh with their labels, and the faces of each region, by tags."""

    curves: list[tuple[str, int]]
    faces: list[list[int]]


def add_field(field: Any, kind: str, **values: float) -> int:
    """Add a field of triangle sizes with these options, and return its tag."""
    tag = field.add(kind)
    for name, value in values.items():
        field.setNumber(tag, name, value)
    return int(tag)


def triangulated(
    mesh: Any,
    divisions: dict[str, int],
    sizes: list[int],
    drawn: Drawn,
) -> NamedArrays:
    """Mesh what is drawn, with the minimum over the fields of `sizes` as triangle size.

    Returns
    -------
    nodes (n, 2) in mm; triangles (m, 6) as in `mesh.StageMesh`, regions (m,) index of each
    triangle's region; edges (k, 3) of the curves, edge_labels (k,) text.
    """
    curves, faces = drawn
    _set_divisions(mesh, divisions, curves)
    smallest = mesh.field.add("Min")
    mesh.field.setNumbers(smallest, "FieldsList", sizes)
    mesh.field.setAsBackgroundMesh(smallest)
    mesh.generate(2)
    mesh.setOrder(2)
    of_regions = [
        np.concatenate([_elements(mesh, TRIANGLE, tag) for tag in part]) for part in faces
    ]
    of_curves = [_elements(mesh, EDGE, tag) for _, tag in curves]
    triangles = np.concatenate(of_regions)
    nodes, index = _used_nodes(mesh, triangles)
    edges = np.concatenate([np.empty((0, 3), dtype=np.int64), *of_curves])
    return {
        "nodes": nodes,
        "triangles": _counter_clockwise(nodes, index[triangles]),
        "regions": np.repeat(np.arange(len(faces)), [len(part) for part in of_regions]),
        "edges": index[edges],
        "edge_labels": np.repeat([label for label, _ in curves], [len(each) for each in of_curves]),
    }


def _set_divisions(
    mesh: Any,
    divisions: dict[str, int],
    curves: Sequence[tuple[str, int]],
) -> None:
    """Divide curves into equal edges, those with one label together into a number of them."""
    pieces = Counter(label for label, _ in curves)
    for label, tag in curves:
        if label in divisions:
            mesh.setTransfiniteCurve(tag, math.ceil(divisions[label] / pieces[label]) + 1)


def _used_nodes(mesh: Any, triangles: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the nodes (n, 2), mm, of triangles, and the numbers of all tags among them, or -1.

    Centres of arcs and points that set sizes are left out.
    """
    tags, xyz, _ = mesh.getNodes()
    used = np.isin(tags, triangles)
    index = np.full(int(tags.max()) + 1, -1)
    index[tags[used]] = np.arange(np.count_nonzero(used))
    return xyz.reshape(-1, 3)[used, :2], index


def _elements(
    mesh: Any,
    kind: tuple[int, int],
    tag: int,
) -> AnyArray:
    """Return the nodes (e, n) of the elements of a kind on a face or curve."""
    return np.reshape(mesh.getElementsByType(kind[0], tag)[1], (-1, kind[1])).astype(np.int64)


def _counter_clockwise(nodes: AnyArray, triangles: AnyArray) -> AnyArray:
    """Return the triangles (m, 6) with their corners counter-clockwise; copied ones may not be."""
    first, second, third = (nodes[triangles[:, :3]] @ [1, 1j]).T
    clockwise = ((second - first).conj() * (third - first)).imag < 0
    triangles[clockwise] = triangles[clockwise][:, [0, 2, 1, 5, 4, 3]]
    return triangles
