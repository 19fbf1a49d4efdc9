"""The curved quadratic triangle on its own, for meshes in any order of nodes: gradients of its shape functions.

`plane_stress.integration` takes them from scikit-fem, whose mesh must be in its own order; here is the same element
for the meshes of studies, at a third of the time.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import ElementBatch

NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
POINTS = np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]) / 6  # exact for quadratic integrands, weights 1/6


def slopes(points: Array) -> Array:
    """Slopes (6 nodes, 2, q) of the shape functions at points (q, 2) of the reference triangle."""
    a, b = points.T
    zero = np.zeros(len(points))
    by_a = [4 * a + 4 * b - 3, 4 * a - 1, zero, 4 - 8 * a - 4 * b, 4 * b, -4 * b]
    by_b = [4 * a + 4 * b - 3, zero, 4 * b - 1, -4 * a, 4 * a, 4 - 4 * a - 8 * b]
    return np.stack([by_a, by_b], axis=1)


def gradients(at: Array, points: Array) -> tuple[Array, Array]:
    """Gradients (e, 6 nodes, 2, q), 1/mm, of the shape functions, and Jacobian determinants (e, q), mm^2.

    at : (e, 6, 2), mm, nodes of the triangles.   points : (q, 2), on the reference triangle.
    """
    slope, q = slopes(points), len(points)
    J = (at.transpose(0, 2, 1).reshape(-1, 6) @ slope.reshape(6, -1)).reshape(-1, 2, 2, q)
    (xa, xb), (ya, yb) = J.transpose(1, 2, 0, 3)
    determinant = xa * yb - xb * ya
    found = np.empty((len(at), 6, 2, q))
    for axis, (a, b) in enumerate(
        [(yb, -ya), (-xb, xa)]
    ):  # d xi_a / dx and d xi_b / dx, then dy, times the determinant
        found[:, :, axis] = (a / determinant)[:, None] * slope[:, 0] + (b / determinant)[:, None] * slope[:, 1]
    return found, determinant


def whole_batch(mesh: StageMesh) -> ElementBatch:
    """All triangles with gradients and weights at the points of `plane_stress.QUADRATURE`."""
    found, determinant = gradients(mesh.nodes[mesh.triangles], POINTS)
    return ElementBatch(mesh.triangles, found, np.abs(determinant) / 6)
