"""Loads, supports and error norms of plane problems with exact fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from benchmarks.hinge_charts import supported
from flexfem.arrays import Array, Index
from flexfem.fem.elements import Plate, integration, segment_functions, stress_tensor
from flexfem.fem.mesh import PlaneMesh, mesh_of, ordered
from flexfem.fem.structure import NONE, structure
from flexfem.mechanism.outlines import Face
from flexfem.meshing.process import run_mesher
from flexfem.meshing.requests import FaceMesh, Grading

DEGREE = (
    8  # polynomial degree of the quadrature of loads and errors: far above that of the solution
)
EDGE_POINTS = 3  # Gauss points on a curved edge
TIME_LIMIT = 60.0  # s, for gmsh

Function: TypeAlias = Callable[[Array], Array]
"""Points (..., 2), mm, to vectors (..., 2) or tensors (..., 2, 2)."""

Traction: TypeAlias = Callable[[Array, Array], Array]
"""Function from points (..., 2), mm, and outward unit normals (..., 2) to tractions (..., 2), MPa.
"""


class Support(NamedTuple):
    """Nodes whose displacement along one axis (0 is x, 1 is y) is prescribed: values () or (k,),
    mm.
    """

    nodes: Index
    axis: int
    values: Array | float = 0.0


class Solution(NamedTuple):
    """Displacements (n, 2), mm, the forces of the supports (n, 2), N, and the number of equations
    solved.
    """

    field: Array
    reactions: Array
    unknowns: int


def solve(mesh: PlaneMesh, plate: Plate, force: Array, supports: Sequence[Support]) -> Solution:
    """Solve in the plane for nodal forces (n, 2), N, and prescribed displacements."""
    of = structure(mesh, plate, held=NONE)
    field = np.zeros_like(force)
    held = np.zeros(force.shape, dtype=bool)
    for nodes, axis, values in supports:
        field[nodes, axis] = values
        held[nodes, axis] = True
    field = field + supported(of, of.lower(), force - of.forces(field[None])[0], held)
    reactions = np.where(held, of.forces(field[None])[0] - force, 0.0)
    return Solution(field, reactions, int(np.sum(~held)))


def meshed(face: Face, sizes: Sequence[Grading]) -> PlaneMesh:
    """Mesh one face of lines and arcs with gmsh in its own process. Raises ComputationFailed as
    `run_mesher` does.
    """
    return ordered(mesh_of(run_mesher(FaceMesh([face], {}, list(sizes)), TIME_LIMIT)))[0]


def size_of(mesh: PlaneMesh) -> float:
    """Typical size of a triangle over that of the whole: one over the root of their number."""
    return float(len(mesh.triangles) ** -0.5)


def on_chords(mesh: PlaneMesh) -> PlaneMesh:
    """The mesh with every middle node moved to the middle of its chord: straight triangles."""
    nodes = mesh.nodes.copy()
    t = mesh.triangles
    nodes[t[:, 3:]] = (nodes[t[:, :3]] + nodes[t[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)


def clamp(nodes: Index, displacement: Array | None = None) -> list[Support]:
    """Both components held on the nodes (k,): at the displacement (k, 2), mm, or at zero."""
    values = np.zeros((len(nodes), 2)) if displacement is None else displacement
    return [Support(nodes, axis, values[:, axis]) for axis in (0, 1)]


def traction_of(stress: Function) -> Traction:
    """The traction `sigma n` of a stress field (..., 2, 2), MPa."""
    return lambda points, normals: np.asarray((stress(points) @ normals[..., None])[..., 0])


def uniform(*traction: float) -> Traction:
    """The same traction everywhere, MPa, whatever the normal."""
    return lambda points, _: np.broadcast_to(np.array(traction), points.shape)


def pressure(value: float) -> Traction:
    """A uniform traction along the outward normal, MPa."""
    return lambda _, normals: value * normals


def edge_force(mesh: PlaneMesh, plate: Plate, edges: Index, traction: Traction) -> Array:
    """Nodal forces (n, 2), N, of a traction on curved quadratic boundary edges (k, 3): `f_i = b int
    N_i t ds`.
    """
    t = mesh.triangles
    sides = np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])
    order = np.argsort(sides[:, 2], kind="stable")
    edges = sides[
        order[np.searchsorted(sides[order, 2], edges[:, 2])]
    ]  # oriented with the triangle on the left
    s, w = np.polynomial.legendre.leggauss(EDGE_POINTS)
    N, slope = (part[[0, 2, 1]] for part in segment_functions(s))
    at = mesh.nodes[edges]
    points = np.einsum("kid,iq->kqd", at, N)
    tangents = np.einsum("kid,iq->kqd", at, slope)
    length = np.hypot(tangents[..., 0], tangents[..., 1])
    normals = np.stack([tangents[..., 1], -tangents[..., 0]], axis=-1) / length[..., None]
    force = np.zeros_like(mesh.nodes)
    np.add.at(
        force,
        edges,
        np.einsum("kqd,kq,iq->kid", traction(points, normals), plate.thickness * length * w, N),
    )
    return force


def body_force(mesh: PlaneMesh, plate: Plate, density: Function, degree: int = DEGREE) -> Array:
    """Nodal forces (n, 2), N, of a force per volume, N/mm^3, at the points (..., 2)."""
    total = np.zeros_like(mesh.nodes)
    for batch in integration(mesh, degree):
        triangles = batch.triangles
        weights = batch.weights
        N = batch.phi
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], N)
        nodal = np.einsum("eqd,eq,iq->eid", density(points), plate.thickness * weights, N)
        np.add.at(total, triangles, nodal)
    return total


class FieldErrors(NamedTuple):
    """Errors relative to the exact solution: displacement in L2, its gradient in L2 (H1 seminorm),
    stress in L2.
    """

    displacement: float
    gradient: float
    stress: float


def errors(
    mesh: PlaneMesh,
    plate: Plate,
    field: Array,
    exact: Function,
    gradient: Function | None,
    stress: Function,
    degree: int = DEGREE,
) -> FieldErrors:
    """Errors of a displacement field (n, 2) against the exact displacement, gradient `d_b u_a` and
    stress.

    `gradient` None leaves its error nan.
    """
    found = np.zeros(3)
    scale = np.zeros(3)
    for batch in integration(mesh, degree):
        triangles = batch.triangles
        gradients = batch.gradients
        weights = batch.weights
        N = batch.phi
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


def nearest_node(mesh: PlaneMesh, x: float, y: float) -> int:
    """The node at a point, mm; an error when there is none."""
    distance = np.hypot(*(mesh.nodes - [x, y]).T)
    node = int(np.argmin(distance))
    if distance[node] > 1e-9 * np.ptp(mesh.nodes):
        raise ValueError(f"no node at ({x:g}, {y:g})")
    return node


def _like(weights: Array, values: Array) -> Array:
    return weights.reshape(weights.shape + (1,) * (values.ndim - weights.ndim))
