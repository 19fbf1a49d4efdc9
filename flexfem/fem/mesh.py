"""The curved quadratic triangle, scikit-fem's element and quadrature; meshes of it, their checks and their size.

scikit-fem maps only meshes in its own order of nodes, and takes three times as long; a test holds the gradients and
weights here to those of its own mapping.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import Array, Index
from flexfem.mechanism.bodies import area, draw_sector
from flexfem.mechanism.stage import HINGE_NAMES, Hinge, Stage
from flexfem.refused import ComputationFailed

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


RESOLUTION = 8  # triangles across every neck
SOLID_RESOLUTION, LAYERS = 6, 3  # the same in three dimensions, and layers in half the thickness: within 0.1 %
TIME_LIMIT = 60.0  # s, for meshing one sector
MOST_TRIANGLES = 1_000_000
SLOPE = 1.4  # growth of the local thickness that the triangles follow, per distance from the neck
COARSEST = 2.0  # local thickness that the triangles follow far from the necks, per link width
TRIANGLE = np.sqrt(3) / 4  # area of the equilateral triangle of side one
LEAST_JACOBIAN = 0.1  # smallest Jacobian determinant of a triangle over its mean one
AREA_ERROR = 1e-3  # parabolas instead of arcs take up to 1.4e-4, in sectors with two triangles across a neck


class StageMesh(NamedTuple):
    """Curved quadratic triangles of the whole stage.

    nodes : (n, 2), mm.
    triangles : (m, 6), corners counter-clockwise, then the middles of the sides 01, 12, 20.
    bodies : (m,), 4 * chain + body, chains from 0, bodies in the order pad, link 1, link 2, platform.
    edges : {label: (k, 3)} ends then middle of the edges on `ground` (clamped), `hub` (rigid) and, for chain 1 to 3
        and hinge, `neck 1 base` and so on: the narrowest sections.
    """

    nodes: Array
    triangles: Index
    bodies: Index
    edges: dict[str, Index]


def refuse_size(estimate: float) -> None:
    """Raise ComputationFailed for more triangles than `MOST_TRIANGLES`."""
    if estimate > MOST_TRIANGLES:
        raise ComputationFailed(
            f"mesh of about {estimate:.2g} triangles, expected at most {MOST_TRIANGLES:.2g}: "
            "a coarser resolution or thicker necks are needed"
        )


def local_thickness(distance: Array, hinge: Hinge) -> Array:
    """Thickness (...) that triangles follow at a distance (...) from the neck's centre, mm.

    Notes
    -----
    A hyperbola: the notch's own `t + d^2 / R` near the neck, a straight growth of `SLOPE` far from it.
    """
    bend = SLOPE * hinge.radius / 2
    return np.asarray(hinge.neck + SLOPE * (np.sqrt(distance**2 + bend**2) - bend))


def estimate_triangles(stage: Stage, drawn: float, resolution: float) -> float:
    """About how many triangles the mesh of the whole stage, of known area, mm^2, will have (within a factor of two)."""
    width = stage.chain.link_width
    coarse = COARSEST * width
    rim, middle = rim_of(stage)
    count = 2 * np.pi * middle * rim / min(coarse, COARSEST * rim) ** 2 + drawn / coarse**2
    for chain in (1, 2, 3):
        for name in HINGE_NAMES:
            hinge = stage.hinge(chain, name)
            x = np.geomspace(1e-3 * hinge.neck, coarse, 400)
            drop = np.sqrt(np.clip(hinge.radius**2 - x**2, 0.0, None))
            high = np.where(x < hinge.radius, hinge.neck + 2 * hinge.radius - 2 * drop, width)
            size = np.minimum(local_thickness(x, hinge), coarse)
            count += 2.0 * float(np.trapezoid(high / size**2, x))
    return float(count * resolution**2 / TRIANGLE)


def rim_of(stage: Stage) -> tuple[float, float]:
    """Width of the platform's rim around the hub, and the radius of its middle, mm."""
    disc, hub = stage.platform.radius, stage.platform.hub_radius
    return disc - hub, (disc + hub) / 2


def ordered(mesh: StageMesh) -> tuple[StageMesh, Index]:
    """The mesh in scikit-fem's order of nodes, corners, then middles as its facets; and where each node went."""
    from skfem import MeshTri1

    corners, where = np.unique(mesh.triangles[:, :3], return_inverse=True)
    at, t = np.ascontiguousarray(mesh.nodes[corners].T), np.ascontiguousarray(where.reshape(-1, 3).T)
    skeleton = MeshTri1(at, t, sort_t=False)
    middles = np.empty(skeleton.facets.shape[1], dtype=np.int64)
    middles[skeleton.t2f] = mesh.triangles[:, 3:].T
    order = np.concatenate([corners, middles])
    back = np.empty(len(order), dtype=np.int64)
    back[order] = np.arange(len(order))
    edges = {name: back[edge] for name, edge in mesh.edges.items()}
    return StageMesh(mesh.nodes[order], back[mesh.triangles], mesh.bodies, edges), back


def outwards(nodes: Array, edges: Index) -> Index:
    """The nodes of some edges by their distance from the origin."""
    found = np.unique(edges)
    return np.asarray(found[np.argsort(np.hypot(*nodes[found].T))])


def check_mesh(mesh: StageMesh, stage: Stage) -> None:
    """Refuse a mesh that is not the stage. Raises ComputationFailed and says what is wrong."""
    check_triangles(mesh, drawn_area(stage))


def drawn_area(stage: Stage) -> float:
    """Area of the stage as drawn, mm^2."""
    return sum(area(face.loop) for chain in (1, 2, 3) for face in draw_sector(stage, chain).values())


def check_triangles(mesh: StageMesh, drawn: float) -> None:
    """Refuse triangles that are not in one piece, of the drawn area, mm^2, and well shaped; as `check_mesh`."""
    n = len(mesh.nodes)
    if not np.array_equal(np.unique(mesh.triangles), np.arange(n)):
        raise ComputationFailed("mesh has nodes that belong to no triangle")
    corners = mesh.triangles[:, [0, 1, 2, 0]]
    links = sp.coo_array((np.ones(3 * len(corners)), (corners[:, :3].ravel(), corners[:, 1:].ravel())), shape=(n, n))
    pieces = len(np.unique(connected_components(links, directed=False)[1][corners]))
    if pieces != 1:
        raise ComputationFailed(f"mesh falls into {pieces} pieces, expected 1: a neck is severed")
    found = jacobians(mesh)
    meshed = float(np.sum(found[:, -1]) / 2)
    if abs(meshed / drawn - 1) > AREA_ERROR:
        raise ComputationFailed(f"mesh covers {meshed:.6g} mm^2, expected {drawn:.6g} to {AREA_ERROR:g}")
    quality = least_scaled_jacobian(found)
    if quality < LEAST_JACOBIAN:
        raise ComputationFailed(f"mesh has a scaled Jacobian of {quality:.3g}, expected > {LEAST_JACOBIAN:g}")


def jacobians(mesh: StageMesh) -> Array:
    """Jacobian determinants (m, 7), mm^2, at the six nodes of each triangle, and their mean over it."""
    found = determinants(mesh.nodes[mesh.triangles], NODES)
    mean = found[:, 3:].mean(axis=1)  # exact: the determinant is quadratic, and so is this rule
    return np.column_stack([found, mean])


def least_scaled_jacobian(found: Array) -> float:
    """Smallest Jacobian determinant over the mean one of its triangle, of `jacobians`: 1 if straight, 0 if folded."""
    return float(np.min(found[:, :6] / found[:, 6:]))
