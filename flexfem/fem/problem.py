"""Boundary value problems of plane stress on flexfem's own kernels: loads, supports, solution and error norms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Plate, integration, stiffness_matrix, stress_tensor
from flexfem.fem.factor import factorise
from flexfem.fem.gmsh_process import run_mesher
from flexfem.fem.mesh import StageMesh, curved, ordered, quadrature, shape_functions
from flexfem.fem.mesher import Cone, Job
from flexfem.mechanism.bodies import Face

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


def meshed(face: Face, cones: Sequence[Cone]) -> StageMesh:
    """Mesh one face of lines and arcs with gmsh in its own process. Raises ComputationFailed as `run_mesher` does."""
    return ordered(curved(run_mesher(Job([face], {}, tuple(cones)), TIME_LIMIT)))[0]


def size_of(mesh: StageMesh) -> float:
    """Typical size of a triangle over that of the whole: one over the root of their number."""
    return float(len(mesh.triangles) ** -0.5)


def on_chords(mesh: StageMesh) -> StageMesh:
    """The mesh with every middle node moved to the middle of its chord: straight triangles."""
    nodes = mesh.nodes.copy()
    t = mesh.triangles
    nodes[t[:, 3:]] = (nodes[t[:, :3]] + nodes[t[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)


DEGREE = 8  # polynomial degree of the quadrature of loads and errors: far above that of the solution
EDGE_POINTS = 3  # of Gauss, on a curved edge
SOLVES = 2  # the second removes what the factors rounded off

Function: TypeAlias = Callable[[Array], Array]
"""Points (..., 2), mm, to vectors (..., 2) or tensors (..., 2, 2)."""
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
    """Solve for nodal forces (n, 2), N, and prescribed displacements, with the stiffness as the stage's."""
    return solve_with(stiffness_matrix(integration(mesh), plate, len(mesh.nodes)).tocsr(), force, supports)


def solve_with(K: sp.csr_array, force: Array, supports: Sequence[Support]) -> Solution:
    """As `solve`, with the stiffness matrix (2n, 2n) of a mesh."""
    u, held = np.zeros(K.shape[0]), np.zeros(K.shape[0], dtype=bool)
    for nodes, axis, values in supports:
        u[2 * nodes + axis] = values
        held[2 * nodes + axis] = True
    free = np.flatnonzero(~held)
    inverse = factorise(sp.tril(K[free][:, free]).tocoo())
    for _ in range(SOLVES):
        u[free] += inverse((force.ravel() - K @ u)[free, None])[:, 0]
    reactions = np.where(held, K @ u - force.ravel(), 0.0)
    return Solution(u.reshape(-1, 2), reactions.reshape(-1, 2), len(free))


def clamp(nodes: Index, displacement: Array | None = None) -> list[Support]:
    """Both components held on the nodes (k,): at the displacement (k, 2), mm, or at zero."""
    values = np.zeros((len(nodes), 2)) if displacement is None else displacement
    return [Support(nodes, axis, values[:, axis]) for axis in (0, 1)]


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


def traction_of(stress: Function) -> Traction:
    """The traction `sigma n` of a stress field (..., 2, 2), MPa."""
    return lambda points, normals: np.asarray((stress(points) @ normals[..., None])[..., 0])


def uniform(*traction: float) -> Traction:
    """The same traction everywhere, MPa, whatever the normal."""
    return lambda points, _: np.broadcast_to(np.array(traction), points.shape)


def pressure(value: float) -> Traction:
    """A uniform traction along the outward normal, MPa."""
    return lambda _, normals: value * normals


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
    return _gathered(mesh, edges, found)


def body_force(mesh: StageMesh, plate: Plate, density: Function, degree: int = DEGREE) -> Array:
    """Nodal forces (n, 2), N, of a force per volume, N/mm^3, at the points (..., 2)."""
    N, total = shape_values(degree), np.zeros_like(mesh.nodes)
    for triangles, _, weights in integration(mesh, degree):
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], N)
        nodal = np.einsum("eqd,eq,iq->eid", density(points), plate.thickness * weights, N)
        total += _gathered(mesh, triangles, nodal)
    return total


def shape_values(degree: int) -> Array:
    """Shape functions (6 nodes, q points) at the quadrature points of `plane_stress.integration`."""
    return shape_functions(quadrature(degree)[0])[0]


class FieldErrors(NamedTuple):
    """Errors relative to the exact solution: displacement in L2, its gradient in L2 (H1 seminorm), stress in L2."""

    displacement: float
    gradient: float
    stress: float


def errors(
    mesh: StageMesh,
    plate: Plate,
    field: Array,
    exact: Function,
    gradient: Function | None,
    stress: Function,
    degree: int = DEGREE,
) -> FieldErrors:
    """Errors of a displacement field (n, 2) against the exact displacement, gradient `d_b u_a` and stress.

    `gradient` None leaves its error nan.
    """
    N = shape_values(degree)
    found, scale = np.zeros(3), np.zeros(3)
    for triangles, gradients, weights in integration(mesh, degree):
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], N)
        slopes = np.einsum("eia,eibq->eabq", field[triangles], gradients, optimize=True)
        ours = [np.einsum("eia,iq->eqa", field[triangles], N), slopes, stress_tensor(plate, slopes)]
        ours[1:] = [np.moveaxis(tensor, -1, 1) for tensor in ours[1:]]
        for k, (value, function) in enumerate(zip(ours, (exact, gradient, stress), strict=True)):
            if function is not None:
                wanted = function(points)
                found[k] += np.sum((value - wanted) ** 2 * _like(weights, wanted))
                scale[k] += np.sum(wanted**2 * _like(weights, wanted))
    with np.errstate(invalid="ignore"):
        return FieldErrors(*map(float, np.sqrt(found / scale)))


def nearest_node(mesh: StageMesh, x: float, y: float) -> int:
    """The node at a point, mm; an error when there is none."""
    distance = np.hypot(*(mesh.nodes - [x, y]).T)
    node = int(np.argmin(distance))
    if distance[node] > 1e-9 * np.ptp(mesh.nodes):
        raise ValueError(f"no node at ({x:g}, {y:g})")
    return node


def _like(weights: Array, values: Array) -> Array:
    return weights.reshape(weights.shape + (1,) * (values.ndim - weights.ndim))


def _gathered(mesh: StageMesh, where: Index, nodal: Array) -> Array:
    """Sum of nodal values (k, i, 2) that belong to the nodes (k, i)."""
    columns = [np.bincount(where.ravel(), nodal[..., axis].ravel(), minlength=len(mesh.nodes)) for axis in (0, 1)]
    return np.stack(columns, axis=-1)
