"""Meshes of curved quadratic triangles, their checks, and three sectors welded into one mesh."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import Array, Index, rotation, short_repr, turned
from flexfem.refused import ComputationFailed

if TYPE_CHECKING:
    from flexfem.meshing.requests import NamedArrays

RESOLUTION = 8  # triangles across every neck
SOLID_RESOLUTION = 6
LAYERS = 3  # the same in three dimensions, and layers in half the thickness: within 0.1 %
MOST_TRIANGLES = 1_000_000
LEAST_JACOBIAN = 0.1  # smallest Jacobian determinant of a triangle over its mean
# parabolas for arcs cause up to 1.4e-4, in sectors with two triangles across a neck
AREA_ERROR = 1e-3
# mm; tolerance of nodes of two sectors on their common cut, and of centres of arcs
SAME_PLACE = 1e-6
SECTORS = 3  # identical ones of a cyclic plate
SECTOR_TURN = 2.0 * np.pi / SECTORS  # rad, from a sector to the next
BODIES_OF_SECTOR = 4  # at most, numbered from 0 in each sector
SIDES_OF_TRIANGLE = ((0, 1, 3), (1, 2, 4), (2, 0, 5))  # start, end and middle, of its nodes
SIDES_OF_SQUARE = ("left", "right", "bottom", "top")
# on the reference triangle
NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])


@cache
def quadrature(degree: int) -> tuple[Array, Array]:
    """Points (q, 2) on the reference triangle and positive weights (q,) of a quadrature rule.

    The rule is exact for polynomials of the degree.
    """
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTri

    points, weights = get_quadrature(RefTri, degree)
    assert np.all(weights > 0)
    return np.ascontiguousarray(points.T), weights


def shape_functions(points: Array) -> tuple[Array, Array]:
    """Values (6 nodes, q) and slopes (6 nodes, 2, q) of the shape functions at points (q, 2)."""
    return _shape_functions(points.tobytes())


@cache
def _shape_functions(points: bytes) -> tuple[Array, Array]:
    """As `shape_functions`, for the few sets of points that elements use."""
    from skfem import ElementTriP2

    places = np.frombuffer(points).reshape(-1, 2).T
    basis = [ElementTriP2().lbasis(places, node) for node in range(6)]
    return np.array([value for value, _ in basis]), np.array([slope for _, slope in basis])


def gradients(nodes: Array, points: Array) -> tuple[Array, Array]:
    """Gradients (e, 6 nodes, 2, q), 1/mm, of shape functions, and determinants (e, q), mm^2.

    The determinants are those of the Jacobian.

    nodes : (e, 6, 2), mm, of the triangles.   points : (q, 2), on the reference triangle.
    """
    slope = shape_functions(points)[1]
    (xa, xb), (ya, yb) = _jacobian(nodes, slope)
    determinant = xa * yb - xb * ya
    gradient = np.empty((len(nodes), 6, 2, len(points)))
    # d xi_a / dx and d xi_b / dx, then dy, times determinant
    for axis, (a, b) in enumerate([(yb, -ya), (-xb, xa)]):
        by_a = (a / determinant)[:, None] * slope[:, 0]
        by_b = (b / determinant)[:, None] * slope[:, 1]
        gradient[:, :, axis] = by_a + by_b
    return gradient, determinant


def _jacobian(nodes: Array, slope: Array) -> Array:
    """Derivatives (2 of x and y, 2 by xi, e, q), mm, of the map from the reference triangle."""
    # exact, so that small triangles far from the origin lose no digits
    relative = nodes - nodes[:, :1]
    J = relative.transpose(0, 2, 1).reshape(-1, 6) @ slope.reshape(6, -1)
    return J.reshape(-1, 2, 2, slope.shape[-1]).transpose(1, 2, 0, 3)


class TooManyTriangles(ComputationFailed):
    """A mesh has more than `MOST_TRIANGLES`, or would have them."""


class PoorTriangles(ComputationFailed):
    """Triangles whose scaled Jacobian is too small, with `corners` (n, 3, 2), mm."""

    def __init__(
        self,
        text: str,
        corners: Array,
    ) -> None:
        super().__init__(text)
        self.corners = corners


@short_repr
class PlaneMesh(NamedTuple):
    """Mesh of curved quadratic triangles.

    nodes : (n, 2), mm.
    triangles : (m, 6), corners counter-clockwise, then the middles of the sides 01, 12, 20.
    bodies : (m,), number of the body or hinge of each triangle.
    edges : {label: (k, 3)} ends then middle of the edges on `ground` or `clamped` (held), `hub`
        (rigid), and the narrowest section of every hinge.
    """

    nodes: Array
    triangles: Index
    bodies: Index
    edges: dict[str, Index]


def outer_sides(triangles: Index) -> Index:
    """Return start, end and middle (k, 3) of the sides of triangles (m, 6) that no other one has.

    The triangles are to the left of them.
    """
    sides = triangles[:, SIDES_OF_TRIANGLE].reshape(-1, 3)
    ends = np.sort(sides[:, :2], axis=1)
    _, first, counts = np.unique(
        ends,
        axis=0,
        return_index=True,
        return_counts=True,
    )
    return np.asarray(sides[first[counts == 1]])


def nodes_on(mesh: PlaneMesh, label: str) -> Index:
    """Return the nodes of the edges with a label, ascending."""
    return np.unique(mesh.edges[label])


def ordered(mesh: PlaneMesh) -> tuple[PlaneMesh, Index]:
    """Return the mesh with nodes in scikit-fem order, and the new node indices.

    This order has corners, then middles by facet.
    """
    from skfem import MeshTri1

    corners, numbers = np.unique(mesh.triangles[:, :3], return_inverse=True)
    p = np.ascontiguousarray(mesh.nodes[corners].T)
    t = np.ascontiguousarray(numbers.reshape(-1, 3).T)
    skeleton = MeshTri1(p, t, sort_t=False)
    middles = np.empty(skeleton.facets.shape[1], dtype=np.int64)
    middles[skeleton.t2f] = mesh.triangles[:, 3:].T
    order = np.concatenate([corners, middles])
    new = np.empty(len(order), dtype=np.int64)
    new[order] = np.arange(len(order))
    edges = {name: new[edge] for name, edge in mesh.edges.items()}
    return PlaneMesh(mesh.nodes[order], new[mesh.triangles], mesh.bodies, edges), new


def by_radius(nodes: Array, edges: Index) -> Index:
    """Return the nodes of edges in ascending distance from the origin."""
    on_edges = np.unique(edges)
    return np.asarray(on_edges[np.argsort(np.hypot(*nodes[on_edges].T))])


def check_count(triangles: float, subject: str) -> None:
    """Raise TooManyTriangles."""
    if triangles > MOST_TRIANGLES:
        remedy = "a coarser resolution or thicker necks are needed"
        raise TooManyTriangles(
            f"{subject} {triangles:.3g} triangles, expected at most {MOST_TRIANGLES:.2g}: {remedy}"
        )


def check_triangles(
    mesh: PlaneMesh,
    drawn: float,
    expected: int = 1,
) -> None:
    """Raise ComputationFailed unless a mesh has the drawn area, the pieces, and good triangles.

    drawn : mm^2.   expected : number of pieces.
    """
    check_count(len(mesh.triangles), "mesh of")
    if not np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.nodes))):
        raise ComputationFailed("mesh has nodes that belong to no triangle")
    pieces = _number_of_pieces(mesh)
    if pieces != expected:
        raise ComputationFailed(
            f"mesh is in {pieces} pieces, expected {expected}: a neck is severed"
        )
    determinants = jacobians(mesh)
    meshed = float(np.sum(determinants[:, -1]) / 2)
    if abs(meshed / drawn - 1) > AREA_ERROR:
        raise ComputationFailed(
            f"mesh covers {meshed:.6g} mm^2, expected {drawn:.6g} within {100 * AREA_ERROR:g} %"
        )
    quality = scaled_jacobians(determinants)
    if quality.min() < LEAST_JACOBIAN:
        x, y = mesh.nodes[mesh.triangles[np.argmin(quality), :3]].mean(axis=0)
        bad = (
            f"a scaled Jacobian of {quality.min():.3g} near ({x:.6g}, {y:.6g}) mm, expected > "
            f"{LEAST_JACOBIAN:g}"
        )
        text = f"mesh has {bad}: do two corners of an outline nearly coincide there?"
        raise PoorTriangles(text, mesh.nodes[mesh.triangles[quality < LEAST_JACOBIAN, :3]])


def _number_of_pieces(mesh: PlaneMesh) -> int:
    n = len(mesh.nodes)
    corners = mesh.triangles[:, [0, 1, 2, 0]]
    ends = (corners[:, :3].ravel(), corners[:, 1:].ravel())
    links = sp.coo_array((np.ones(3 * len(corners)), ends), shape=(n, n))
    return len(np.unique(connected_components(links, directed=False)[1][corners]))


def jacobians(mesh: PlaneMesh) -> Array:
    """Jacobian determinants (m, 7), mm^2, at the nodes of each triangle, then their mean."""
    (xa, xb), (ya, yb) = _jacobian(mesh.nodes[mesh.triangles], shape_functions(NODES)[1])
    determinants = xa * yb - xb * ya
    mean = determinants[:, 3:].mean(axis=1)  # exact for the quadratic determinant
    return np.column_stack([determinants, mean])


def scaled_jacobians(determinants: Array) -> Array:
    """Smallest ratio (m,) of a determinant of `jacobians` to the mean of its triangle.

    It is 1 for a straight triangle, 0 for a degenerate one.
    """
    return np.asarray(np.min(determinants[:, :6] / determinants[:, 6:], axis=1))


def mapped(
    columns: int,
    rows: int,
    place: Callable[[Array, Array], Array],
) -> PlaneMesh:
    """Map a grid of the unit square, with two quadratic triangles per cell.

    place : u, v (...) in 0..1 to points (..., 2), mm, with positive Jacobian determinant.
        The edges are labelled `left` (u = 0), `right` (u = 1), `bottom` (v = 0) and `top` (v = 1).
    """
    number = np.arange((2 * columns + 1) * (2 * rows + 1)).reshape(2 * rows + 1, 2 * columns + 1)
    v, u = np.meshgrid(
        np.linspace(0, 1, 2 * rows + 1), np.linspace(0, 1, 2 * columns + 1), indexing="ij"
    )
    nodes = np.asarray(place(u, v)).reshape(-1, 2)

    def at(row: int, column: int) -> Index:
        """Nodes of all cells at a local row and column in 0..2."""
        return number[row : row + 2 * rows - 1 : 2, column : column + 2 * columns - 1 : 2].ravel()

    lower = [at(0, 0), at(0, 2), at(2, 2), at(0, 1), at(1, 2), at(1, 1)]
    upper = [at(0, 0), at(2, 2), at(2, 0), at(1, 1), at(2, 1), at(1, 0)]
    triangles = np.concatenate([np.stack(lower, axis=-1), np.stack(upper, axis=-1)])
    lines = (number[:, 0], number[:, -1], number[0], number[-1])
    edges = {
        side: np.stack([n[:-1:2], n[2::2], n[1::2]], axis=-1)
        for side, n in zip(SIDES_OF_SQUARE, lines, strict=True)
    }
    return ordered(PlaneMesh(nodes, triangles, np.zeros(len(triangles), dtype=np.int64), edges))[0]


class Sector(NamedTuple):
    """Mesh of one of three sectors of a plate around a rigid hub, in the frame of the first sector.

    mesh : with edges on `ground`, `hub`, `cut ahead`, `cut behind` and, for each hinge, `neck base`
        etc.
    behind, ahead : (k,), nodes on the cuts by radius, except the hub's; ahead is behind rotated by
        120 degrees.
    """

    mesh: PlaneMesh
    behind: Index
    ahead: Index


def sector_rotation(sector: int) -> Array:
    """Matrix (3, 3) that maps x, y, theta of a sector (from 0) to the frame of the first one."""
    return rotation(sector * SECTOR_TURN)


def welded(sectors: tuple[Sector, ...]) -> tuple[PlaneMesh, list[Index]]:
    """Return the whole mesh of one or three sectors, and the indices of the nodes of each in it."""
    mesh, sector_nodes = joined(sectors)
    mesh, new = ordered(mesh)
    return mesh, [new[numbers] for numbers in sector_nodes]


def joined(sectors: tuple[Sector, ...]) -> tuple[PlaneMesh, list[Index]]:
    """Join sectors as `welded`, but keep the order of nodes.

    `cut ahead` of a sector is `cut behind` of the next. The bodies of sector s, from 0, are
    numbered from `BODIES_OF_SECTOR * s`, and its necks are labelled `neck 1 base` and so on with
    the number of the sector from 1.
    """
    if len(sectors) == 1:
        sectors = sectors * SECTORS
    parts = [sector.mesh for sector in sectors]
    kept, sector_nodes = _numbered_nodes(parts)
    turned_nodes = [turned(part.nodes, k * SECTOR_TURN) for k, part in enumerate(parts)]
    nodes = np.concatenate(turned_nodes)[kept]
    triangles = list[Index]()
    bodies = list[Index]()
    for k, (part, numbers) in enumerate(zip(parts, sector_nodes, strict=True)):
        triangles.append(numbers[part.triangles])
        bodies.append(BODIES_OF_SECTOR * k + part.bodies)
    edges = _edges_of_sectors(parts, sector_nodes)
    mesh = PlaneMesh(nodes, np.concatenate(triangles), np.concatenate(bodies), edges)
    return mesh, sector_nodes


def _edges_of_sectors(parts: list[PlaneMesh], sector_nodes: list[Index]) -> dict[str, Index]:
    """Return the labelled edges of all sectors but the cuts, each neck with its sector from 1."""
    edges: dict[str, list[Index]] = {}
    for sector, (part, numbers) in enumerate(zip(parts, sector_nodes, strict=True), start=1):
        for label, edge in part.edges.items():
            if not label.startswith("cut"):
                own_label = label.replace("neck", f"neck {sector}")
                edges.setdefault(own_label, []).append(numbers[edge])
    return {label: np.concatenate(edge) for label, edge in edges.items()}


def _numbered_nodes(parts: list[PlaneMesh]) -> tuple[Index, list[Index]]:
    """Return which nodes of all sectors are kept, and the numbers of the nodes of each among them.

    Nodes on a cut are kept once.
    """
    first = np.concatenate([[0], np.cumsum([len(part.nodes) for part in parts])])
    number = np.arange(first[-1])
    for k, part in enumerate(parts):
        ahead = by_radius(part.nodes, part.edges["cut ahead"])
        following = (k + 1) % SECTORS
        behind = by_radius(parts[following].nodes, parts[following].edges["cut behind"])
        number[first[k] + ahead] = first[following] + behind
    kept, number = np.unique(number, return_inverse=True)
    return kept, [number[first[k] : first[k + 1]] for k in range(SECTORS)]


def mesh_of(arrays: NamedArrays) -> PlaneMesh:
    """Return the mesh in arrays, as `meshing` returns it."""
    labels = arrays["edge_labels"]
    edges = {str(label): arrays["edges"][labels == label] for label in np.unique(labels)}
    return PlaneMesh(arrays["nodes"], arrays["triangles"], arrays["regions"], edges)
