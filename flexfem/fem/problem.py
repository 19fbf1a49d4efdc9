"""Boundary value problems on structures without a hub: loads on edges, supports, solution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import Plate
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.structure import Structure, structure, tie

EDGE_POINTS = 3  # of Gauss, on a curved edge
SOLVES = 2  # the second removes what the factors rounded off

Traction: TypeAlias = Callable[[Array, Array], Array]
"""Points (..., 2), mm, and outward unit normals (..., 2) to tractions (..., 2), MPa."""


class Support(NamedTuple):
    """Nodes whose displacement along one axis (0 is x, 1 is y) is prescribed: values () or (k,), mm."""

    nodes: Index
    axis: int
    values: Array | float = 0.0


class Solution(NamedTuple):
    """Displacements (n, 2), mm, the forces of the supports (n, 2), N, and the number of equations solved."""

    field: Array
    reactions: Array
    unknowns: int


def solve(mesh: StageMesh, plate: Plate, force: Array, supports: Sequence[Support]) -> Solution:
    """Solve in the plane for nodal forces (n, 2), N, and prescribed displacements."""
    of = structure(mesh, plate, tied=tie(mesh))
    return solve_with(of, of.lower().tocsr(), force, supports)


def solve_with(of: Structure, lower: sp.csr_array, force: Array, supports: Sequence[Support]) -> Solution:
    """As `solve`, of a plane structure whose nodes are all free, with the lower triangle of its stiffness."""
    field, held = np.zeros_like(force), np.zeros(force.shape, dtype=bool)
    for nodes, axis, values in supports:
        field[nodes, axis], held[nodes, axis] = values, True
    field = field + settled(of, lower, force - of.forces(field[None])[0], held)
    reactions = np.where(held, of.forces(field[None])[0] - force, 0.0)
    return Solution(field, reactions, int(np.sum(~held)))


def settled(of: Structure, lower: sp.csr_array, force: Array, held: AnyArray) -> Array:
    """Displacements (n, ...) of a structure whose nodes are all free, under forces (n, ...), zero where held.

    Raises ComputationFailed when a part is not held.
    """
    free = np.flatnonzero(~of.gathered(held[None])[0])
    inverse, motion, field = factorise(lower[free][:, free].tocoo()), np.zeros((1, of.size)), np.zeros_like(force)
    for _ in range(SOLVES):
        left = of.gathered(force[None] - of.forces(field[None]))[0, free]
        motion[0, free] += inverse(left[:, None])[:, 0]
        field = of.spread(motion)[0]
    return field


def nodes_on(mesh: StageMesh, label: str) -> Index:
    """Nodes of the edges with this label."""
    return np.unique(mesh.edges[label])


def outward(mesh: StageMesh, edges: Index) -> Index:
    """Boundary edges (k, 3) turned so that their triangle is to the left: the outward normal is to the right."""
    t = mesh.triangles
    sides = np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])
    order = np.argsort(sides[:, 2], kind="stable")
    found = order[np.searchsorted(sides[order, 2], edges[:, 2])]
    return np.asarray(sides[found])


def edge_force(mesh: StageMesh, plate: Plate, edges: Index, traction: Traction) -> Array:
    """Nodal forces (n, 2), N, of a traction on curved quadratic boundary edges (k, 3).

    Notes
    -----
    `f_i = b int N_i t ds` with the edge's own map; normals are those of the curved edge.
    """
    s, w = np.polynomial.legendre.leggauss(EDGE_POINTS)
    N = np.array([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s**2])
    slope = np.array([s - 0.5, s + 0.5, -2 * s])
    edges = outward(mesh, edges)
    at = mesh.nodes[edges]
    points, tangents = np.einsum("kid,iq->kqd", at, N), np.einsum("kid,iq->kqd", at, slope)
    length = np.hypot(tangents[..., 0], tangents[..., 1])
    normals = np.stack([tangents[..., 1], -tangents[..., 0]], axis=-1) / length[..., None]
    found = np.einsum("kqd,kq,iq->kid", traction(points, normals), plate.thickness * length * w, N)
    return gathered_forces(mesh, edges, found)


def gathered_forces(mesh: StageMesh, where: Index, nodal: Array) -> Array:
    """Sum of nodal values (k, i, 2) that belong to the nodes (k, i)."""
    columns = [np.bincount(where.ravel(), nodal[..., axis].ravel(), minlength=len(mesh.nodes)) for axis in (0, 1)]
    return np.stack(columns, axis=-1)
