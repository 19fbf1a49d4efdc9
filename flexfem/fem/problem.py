"""Boundary value problems on structures without a hub: loads on edges, solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import Plate
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.structure import Structure

EDGE_POINTS = 3  # of Gauss, on a curved edge
SOLVES = 2  # the second removes what the factors rounded off

Traction: TypeAlias = Callable[[Array, Array], Array]
"""Points (..., 2), mm, and outward unit normals (..., 2) to tractions (..., 2), MPa."""


def settled(of: Structure, lower: sp.csr_array, force: Array, held: AnyArray) -> Array:
    """Displacements (n, ...) of a structure whose nodes are all free, under forces (n, ...), zero where held.

    lower : of its stiffness. Raises ComputationFailed when a part is not held.
    """
    free = np.flatnonzero(of.loads(held[None].astype(float))[:, 0] == 0)
    inverse, motion = factorise(lower[free][:, free]), np.zeros((of.size, 1))
    for _ in range(SOLVES):
        motion[free] += inverse(of.loads(force[None] - of.forces(of.fields(motion)))[free])
    return np.asarray(of.fields(motion)[0])


def nodes_on(mesh: StageMesh, label: str) -> Index:
    """Nodes of the edges with this label."""
    return np.unique(mesh.edges[label])


def _outward(mesh: StageMesh, edges: Index) -> Index:
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
    edges = _outward(mesh, edges)
    at = mesh.nodes[edges]
    points, tangents = np.einsum("kid,iq->kqd", at, N), np.einsum("kid,iq->kqd", at, slope)
    length = np.hypot(tangents[..., 0], tangents[..., 1])
    normals = np.stack([tangents[..., 1], -tangents[..., 0]], axis=-1) / length[..., None]
    found = np.einsum("kqd,kq,iq->kid", traction(points, normals), plate.thickness * length * w, N)
    force = np.zeros_like(mesh.nodes)
    np.add.at(force, edges, found)
    return force
