"""Meshes of curved quadratic triangles: a sector per chain, one for three identical chains, welded on demand.

Element size grows linearly with the distance from a neck, outside the length over which a notch bends, about
`sqrt(t R)`: four triangles across a neck then keep the platform stiffness within 0.1 % from t/R = 1e-4 to more than 1
(see `benchmarks/study.py`; PLATEAU and GROWTH were chosen for that on other stages).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import Array, Index, brief
from flexfem.fem.mesher import FaceMesh, Grading, Limit, NamedArrays, run_jobs
from flexfem.mechanism.actuators import HINGE_NAMES
from flexfem.mechanism.bodies import draw_sector, necks
from flexfem.mechanism.designs import CHAIN_TURN, turned
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import Face, area
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import Hinge
from flexfem.refused import ComputationFailed

RESOLUTION = 8  # triangles across every neck
SOLID_RESOLUTION, LAYERS = 6, 3  # the same in three dimensions, and layers in half the thickness: within 0.1 %
TIME_LIMIT = 60.0  # s, for meshing one sector
MOST_TRIANGLES = 1_000_000
COARSEST = 2.0  # local thickness that sets the triangle size far from the necks, per link width
LEAST_JACOBIAN = 0.1  # smallest Jacobian determinant of a triangle over its mean
AREA_ERROR = 1e-3  # parabolas for arcs cause up to 1.4e-4, in sectors with two triangles across a neck
PLATEAU = 0.9  # distance from a neck up to which triangles are smallest, per sqrt(t R), where a notch bends
GROWTH = 1.6  # of the triangle size with the distance from a neck, times the triangles across it
SLENDER = 0.3  # distance, per notch radius, up to which the thickness `t + d^2/R` grows slower than a cone
STUBBY = 0.5  # t/R above which the notch radius, not the neck, sets the triangle size
PER_TURN = 9.0  # triangles per full turn of a bend; an arc of a notch follows the cone of its neck
SAME_PLACE = 1e-6  # mm; tolerance of nodes of two sectors on their common cut, and of centres of arcs
SIDES = ("left", "right", "bottom", "top")
NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])  # on the reference triangle


@cache
def quadrature(degree: int) -> tuple[Array, Array]:
    """Points (q, 2) on the reference triangle and positive weights (q,) of a rule exact for polynomials of a degree."""
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

    basis = [ElementTriP2().lbasis(np.frombuffer(points).reshape(-1, 2).T, node) for node in range(6)]
    return np.array([value for value, _ in basis]), np.array([slope for _, slope in basis])


def gradients(nodes: Array, points: Array) -> tuple[Array, Array]:
    """Gradients (e, 6 nodes, 2, q), 1/mm, of the shape functions, and Jacobian determinants (e, q), mm^2.

    nodes : (e, 6, 2), mm, of the triangles.   points : (q, 2), on the reference triangle.
    """
    slope = shape_functions(points)[1]
    (xa, xb), (ya, yb) = _jacobian(nodes, slope)
    determinant = xa * yb - xb * ya
    gradient = np.empty((len(nodes), 6, 2, len(points)))
    for axis, (a, b) in enumerate([(yb, -ya), (-xb, xa)]):  # d xi_a / dx and d xi_b / dx, then dy, times determinant
        gradient[:, :, axis] = (a / determinant)[:, None] * slope[:, 0] + (b / determinant)[:, None] * slope[:, 1]
    return gradient, determinant


def _jacobian(nodes: Array, slope: Array) -> Array:
    """Derivatives (2 of x and y, 2 by xi, e, q), mm, of the map from the reference triangle."""
    relative = nodes - nodes[:, :1]  # exact, so that small triangles far from the origin lose no digits
    J = (relative.transpose(0, 2, 1).reshape(-1, 6) @ slope.reshape(6, -1)).reshape(-1, 2, 2, slope.shape[-1])
    return J.transpose(1, 2, 0, 3)


@brief
class StageMesh(NamedTuple):
    """Mesh of curved quadratic triangles.

    nodes : (n, 2), mm.
    triangles : (m, 6), corners counter-clockwise, then the middles of the sides 01, 12, 20.
    bodies : (m,), 4 * chain + body, chains from 0, bodies in the order pad, link 1, link 2, platform.
    edges : {label: (k, 3)} ends then middle of the edges on `ground` (clamped), `hub` (rigid) and the narrowest
        section of every hinge, labelled `neck 1 base` and so on.
    """

    nodes: Array
    triangles: Index
    bodies: Index
    edges: dict[str, Index]


def nodes_on(mesh: StageMesh, label: str) -> Index:
    """Return the nodes of the edges with a label, ascending."""
    return np.unique(mesh.edges[label])


def ordered(mesh: StageMesh) -> tuple[StageMesh, Index]:
    """Return the mesh with nodes in scikit-fem order, corners, then middles by facet, and the new node indices."""
    from skfem import MeshTri1

    corners, numbers = np.unique(mesh.triangles[:, :3], return_inverse=True)
    p, t = np.ascontiguousarray(mesh.nodes[corners].T), np.ascontiguousarray(numbers.reshape(-1, 3).T)
    skeleton = MeshTri1(p, t, sort_t=False)
    middles = np.empty(skeleton.facets.shape[1], dtype=np.int64)
    middles[skeleton.t2f] = mesh.triangles[:, 3:].T
    order = np.concatenate([corners, middles])
    new = np.empty(len(order), dtype=np.int64)
    new[order] = np.arange(len(order))
    edges = {name: new[edge] for name, edge in mesh.edges.items()}
    return StageMesh(mesh.nodes[order], new[mesh.triangles], mesh.bodies, edges), new


def by_radius(nodes: Array, edges: Index) -> Index:
    """Return the nodes of edges in ascending distance from the origin."""
    on_edges = np.unique(edges)
    return np.asarray(on_edges[np.argsort(np.hypot(*nodes[on_edges].T))])


def drawn_area(stage: Stage) -> float:
    """Area of the drawn stage, mm^2."""
    return sum(area(face.loop) for chain in (1, 2, 3) for face in draw_sector(stage, chain).values())


def check_triangles(mesh: StageMesh, drawn: float, expected: int = 1) -> None:
    """Raise ComputationFailed unless the mesh has the drawn area, mm^2, the expected pieces, and good triangles."""
    n = len(mesh.nodes)
    if len(mesh.triangles) > MOST_TRIANGLES:
        raise ComputationFailed(
            f"mesh of {len(mesh.triangles)} triangles, expected at most {MOST_TRIANGLES:.2g}: "
            "a coarser resolution or thicker necks are needed"
        )
    if not np.array_equal(np.unique(mesh.triangles), np.arange(n)):
        raise ComputationFailed("mesh has nodes that belong to no triangle")
    corners = mesh.triangles[:, [0, 1, 2, 0]]
    links = sp.coo_array((np.ones(3 * len(corners)), (corners[:, :3].ravel(), corners[:, 1:].ravel())), shape=(n, n))
    pieces = len(np.unique(connected_components(links, directed=False)[1][corners]))
    if pieces != expected:
        raise ComputationFailed(f"mesh is in {pieces} pieces, expected {expected}: a neck is severed")
    determinants = jacobians(mesh)
    meshed = float(np.sum(determinants[:, -1]) / 2)
    if abs(meshed / drawn - 1) > AREA_ERROR:
        raise ComputationFailed(f"mesh covers {meshed:.6g} mm^2, expected {drawn:.6g} within {100 * AREA_ERROR:g} %")
    quality = least_scaled_jacobian(determinants)
    if quality < LEAST_JACOBIAN:
        raise ComputationFailed(f"mesh has a scaled Jacobian of {quality:.3g}, expected > {LEAST_JACOBIAN:g}")


def jacobians(mesh: StageMesh) -> Array:
    """Jacobian determinants (m, 7), mm^2, at the six nodes of each triangle, then their mean over it."""
    (xa, xb), (ya, yb) = _jacobian(mesh.nodes[mesh.triangles], shape_functions(NODES)[1])
    determinants = xa * yb - xb * ya
    mean = determinants[:, 3:].mean(axis=1)  # exact for the quadratic determinant
    return np.column_stack([determinants, mean])


def least_scaled_jacobian(determinants: Array) -> float:
    """Smallest ratio of a determinant of `jacobians` to the mean of its triangle: 1 if straight, 0 if degenerate."""
    return float(np.min(determinants[:, :6] / determinants[:, 6:]))


def mapped(columns: int, rows: int, place: Callable[[Array, Array], Array]) -> StageMesh:
    """Map a grid of the unit square, with two quadratic triangles per cell, including the middle nodes.

    place : u, v (...) in 0..1 to points (..., 2), mm, with positive Jacobian determinant.
        The edges are labelled `left` (u = 0), `right` (u = 1), `bottom` (v = 0) and `top` (v = 1).
    """
    number = np.arange((2 * columns + 1) * (2 * rows + 1)).reshape(2 * rows + 1, 2 * columns + 1)
    v, u = np.meshgrid(np.linspace(0, 1, 2 * rows + 1), np.linspace(0, 1, 2 * columns + 1), indexing="ij")
    nodes = np.asarray(place(u, v)).reshape(-1, 2)

    def at(row: int, column: int) -> Index:
        """Nodes of all cells at a local row and column in 0..2."""
        return number[row : row + 2 * rows - 1 : 2, column : column + 2 * columns - 1 : 2].ravel()

    lower = [at(0, 0), at(0, 2), at(2, 2), at(0, 1), at(1, 2), at(1, 1)]
    upper = [at(0, 0), at(2, 2), at(2, 0), at(1, 1), at(2, 1), at(1, 0)]
    triangles = np.concatenate([np.stack(lower, axis=-1), np.stack(upper, axis=-1)])
    lines = (number[:, 0], number[:, -1], number[0], number[-1])
    edges = {side: np.stack([n[:-1:2], n[2::2], n[1::2]], axis=-1) for side, n in zip(SIDES, lines, strict=True)}
    return ordered(StageMesh(nodes, triangles, np.zeros(len(triangles), dtype=np.int64), edges))[0]


class Sector(NamedTuple):
    """Mesh of one chain and its sector of the platform, in the frame of chain 1.

    mesh : bodies 0 to 3; edges on `ground`, `hub`, `cut ahead`, `cut behind` and, for each hinge, `neck base` etc.
    behind, ahead : (k,), nodes on the cuts by radius, except the hub's; ahead is behind rotated by 120 degrees.
    """

    mesh: StageMesh
    behind: Index
    ahead: Index


def mesh_sectors(
    stage: Stage, resolution: int | tuple[int, int, int], time_limit: float | Limit = TIME_LIMIT
) -> tuple[Sector, ...]:
    """Mesh a feasible stage: three sectors, or one that represents three identical chains.

    Parameters
    ----------
    resolution : least number of triangles across every neck, or one per chain; the finest applies to the cuts.
    time_limit : s, for gmsh on all sectors.

    Raises BadInput for a stage that cannot be made, ComputationFailed when the mesh fails its checks, MeshTimeout when
    it takes too long.
    """
    check_feasible(stage)
    across = (resolution,) * 3 if isinstance(resolution, int) else resolution
    chains = (1,) if stage.chains_alike and len(set(across)) == 1 else (1, 2, 3)
    keys = [(across[chain - 1], *(stage.hinge(chain, name) for name in HINGE_NAMES)) for chain in chains]
    distinct = [keys.index(key) for key in dict.fromkeys(keys)]
    jobs = [sector_drawing(stage, chains[k], across[chains[k] - 1], max(across)) for k in distinct]
    meshed = list(map(_sector, jobs, run_jobs(jobs, time_limit)))
    sectors = tuple(meshed[distinct.index(keys.index(key))] for key in keys)
    for sector, following in zip(sectors, (*sectors[1:], sectors[0]), strict=True):
        ahead, behind = sector.mesh.nodes[sector.ahead], turned(following.mesh.nodes[following.behind], CHAIN_TURN)
        if ahead.shape != behind.shape or np.max(np.abs(ahead - behind)) > SAME_PLACE:
            raise ComputationFailed("meshes of two sectors do not have the same nodes on their cut")
    return sectors


def build_mesh(stage: Stage, resolution: int = RESOLUTION) -> StageMesh:
    """Mesh the whole stage with `mesh_sectors`; with identical chains the mesh is exactly symmetric."""
    return welded(mesh_sectors(stage, resolution))[0]


def welded(sectors: tuple[Sector, ...]) -> tuple[StageMesh, list[Index]]:
    """Return the whole mesh of one or three sectors and, for each chain, the indices of its sector nodes in it."""
    mesh, sector_nodes = joined(sectors)
    mesh, new = ordered(mesh)
    return mesh, [new[numbers] for numbers in sector_nodes]


def joined(sectors: tuple[Sector, ...]) -> tuple[StageMesh, list[Index]]:
    """Join sectors as `welded`, but keep the order of nodes; `cut ahead` of a chain is `cut behind` of the next."""
    parts = [sector.mesh for sector in (sectors if len(sectors) == 3 else sectors * 3)]
    first = np.concatenate([[0], np.cumsum([len(part.nodes) for part in parts])])
    number = np.arange(first[-1])
    for chain, part in enumerate(parts):
        ahead, following = by_radius(part.nodes, part.edges["cut ahead"]), parts[(chain + 1) % 3]
        behind = by_radius(following.nodes, following.edges["cut behind"])
        number[first[chain] + ahead] = first[(chain + 1) % 3] + behind
    kept, number = np.unique(number, return_inverse=True)
    sector_nodes = [number[first[chain] : first[chain + 1]] for chain in range(3)]
    nodes = np.concatenate([turned(part.nodes, chain * CHAIN_TURN) for chain, part in enumerate(parts)])[kept]
    edges: dict[str, list[Index]] = {}
    for chain, (part, numbers) in enumerate(zip(parts, sector_nodes, strict=True)):
        for label, edge in part.edges.items():
            if not label.startswith("cut"):
                edges.setdefault(label.replace("neck", f"neck {chain + 1}"), []).append(numbers[edge])
    triangles = np.concatenate([numbers[part.triangles] for part, numbers in zip(parts, sector_nodes, strict=True)])
    bodies = np.concatenate([4 * chain + part.bodies for chain, part in enumerate(parts)])
    return StageMesh(nodes, triangles, bodies, {name: np.concatenate(e) for name, e in edges.items()}), sector_nodes


def sector_drawing(stage: Stage, chain: int, resolution: int, finest: int) -> FaceMesh:
    """Return drawing and sizes of the sector of a chain; `finest`, the highest resolution of all, sets the cuts."""
    fine = max(resolution, 2)  # a single triangle across an arc would degenerate
    faces, coarse = list(draw_sector(stage, chain).values()), COARSEST * stage.chain.link_width / fine
    points = _refinement_points(stage, chain, faces, fine)
    rim = stage.platform.radius - stage.platform.hub_radius
    cuts = max(2, math.ceil(rim / (COARSEST * stage.chain.link_width / max(finest, 2))))
    divisions = {f"neck {name}": _across(stage.hinge(chain, name), resolution) for name in HINGE_NAMES}
    divisions |= {"cut behind": cuts, "cut ahead": cuts}
    return FaceMesh(faces, divisions, [grading(*point, coarse, fine) for point in points if point[-1] < coarse])


def grading(centre: complex, radius: float, size: float, coarse: float, across: float) -> Grading:
    """Return sizes, mm, that grow outside a radius at the rate of a neck with `across` triangles."""
    return Grading((centre,), radius, size, coarse, (coarse - size) * across / GROWTH)


def notch_sizes(neck: float, radius: float, across: float, resolution: float) -> Iterator[tuple[float, float]]:
    """Yield distances from a neck and sizes within them, mm, as the thickness of a notch grows slower than a cone."""
    distance = PLATEAU * math.sqrt(neck * radius)
    yield distance, neck / across
    while distance < SLENDER * radius:
        yield 2 * distance, (neck + 2 * distance**2 / radius) / resolution
        distance *= 2


def _across(hinge: Hinge, resolution: int) -> int:
    """Return the triangles across a neck: more in a stubby hinge, whose notch must be resolved."""
    return math.ceil(resolution * max(1.0, hinge.neck / (STUBBY * hinge.radius)))


def _refinement_points(
    stage: Stage, chain: int, faces: list[Face], resolution: int
) -> Iterator[tuple[complex, float, float]]:
    """Yield centres, radii and the triangle sizes within, mm: of necks, the platform and rounded bends."""
    notches = []
    for neck, name in zip(necks(stage, chain), HINGE_NAMES, strict=True):
        hinge = stage.hinge(chain, name)
        sizes = notch_sizes(hinge.neck, hinge.radius, _across(hinge, resolution), resolution)
        yield from ((neck.point, *size) for size in sizes)
        across = (hinge.neck / 2 + hinge.radius) * 1j * cmath.exp(1j * neck.heading)
        notches += [neck.point + across, neck.point - across]
    disc, hub = stage.platform.radius, stage.platform.hub_radius
    yield 0j, disc, COARSEST * (disc - hub) / resolution
    for arc in dict.fromkeys(segment for face in faces for segment in face.loop):
        if arc.centre in (None, 0j) or any(abs(arc.centre - notch) < SAME_PLACE for notch in notches):
            continue  # hub, rim and notches have cones of their own
        radius = abs(arc.start - arc.centre)
        yield arc.centre, radius, radius * 2 * math.pi / PER_TURN


def mesh_of(arrays: NamedArrays) -> StageMesh:
    """Return the mesh in arrays of the mesher."""
    labels = arrays["edge_labels"]
    edges = {str(label): arrays["edges"][labels == label] for label in np.unique(labels)}
    return StageMesh(arrays["nodes"], arrays["triangles"], arrays["regions"], edges)


def _sector(job: FaceMesh, arrays: NamedArrays) -> Sector:
    check_triangles(mesh := mesh_of(arrays), sum(area(face.loop) for face in job.faces))
    hub = nodes_on(mesh, "hub")
    behind, ahead = (by_radius(mesh.nodes, mesh.edges[f"cut {side}"]) for side in ("behind", "ahead"))
    return Sector(mesh, behind[~np.isin(behind, hub)], ahead[~np.isin(ahead, hub)])
