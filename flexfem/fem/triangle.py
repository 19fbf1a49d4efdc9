"""The curved quadratic triangle: scikit-fem's element and quadrature, mapped in any order of nodes.

scikit-fem maps only meshes in its own order of nodes, and takes three times as long; a test holds the gradients and
weights here to those of its own mapping.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from flexfem.arrays import Array

NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])  # on the reference triangle


@cache
def quadrature(degree: int) -> tuple[Array, Array]:
    """Points (q, 2) on the reference triangle and weights (q,), exact for polynomials of a degree.

    Raises ValueError for a degree whose rule has weights that are not positive.
    """
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTri

    points, weights = get_quadrature(RefTri, degree)
    if np.any(weights <= 0):
        raise ValueError(f"quadrature of degree {degree} has weights that are not positive")
    return np.ascontiguousarray(points.T), weights


def shape_functions(points: Array) -> tuple[Array, Array]:
    """Values (6 nodes, q) and slopes (6 nodes, 2, q) of the shape functions at points (q, 2)."""
    from skfem import ElementTriP2

    found = [ElementTriP2().lbasis(points.T, node) for node in range(6)]
    return np.array([value for value, _ in found]), np.array([slope for _, slope in found])


def determinants(at: Array, points: Array) -> Array:
    """Jacobian determinants (e, q), mm^2, of triangles with nodes (e, 6, 2), mm, at points (q, 2)."""
    (xa, xb), (ya, yb) = _jacobian(at, shape_functions(points)[1])
    return np.asarray(xa * yb - xb * ya)


def gradients(at: Array, points: Array) -> tuple[Array, Array]:
    """Gradients (e, 6 nodes, 2, q), 1/mm, of the shape functions, and Jacobian determinants (e, q), mm^2.

    at : (e, 6, 2), mm, nodes of the triangles.   points : (q, 2), on the reference triangle.
    """
    slope = shape_functions(points)[1]
    (xa, xb), (ya, yb) = _jacobian(at, slope)
    determinant = xa * yb - xb * ya
    found = np.empty((len(at), 6, 2, len(points)))
    for axis, (a, b) in enumerate([(yb, -ya), (-xb, xa)]):  # d xi_a / dx and d xi_b / dx, then dy, times determinant
        found[:, :, axis] = (a / determinant)[:, None] * slope[:, 0] + (b / determinant)[:, None] * slope[:, 1]
    return found, determinant


def _jacobian(at: Array, slope: Array) -> Array:
    """Derivatives (2 of x and y, 2 by xi, e, q), mm, of the map."""
    q, relative = slope.shape[-1], at - at[:, :1]  # exact, so that a small triangle far from the origin is as good
    J = (relative.transpose(0, 2, 1).reshape(-1, 6) @ slope.reshape(6, -1)).reshape(-1, 2, 2, q)
    return J.transpose(1, 2, 0, 3)
