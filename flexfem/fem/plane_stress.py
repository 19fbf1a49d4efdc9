"""Plane stress on curved quadratic triangles: element and assembled stiffness, nodal forces and stresses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.mesh import NODES, StageMesh, gradients, quadrature

if TYPE_CHECKING:
    import skfem


QUADRATURE = 2  # three points: exact on straight triangles; on the default mesh 2e-6 from many points, mesh error 6e-5
CHUNK = 20_000  # triangles assembled at once


class Plate(NamedTuple):
    """A homogeneous isotropic plate: Young's modulus (MPa), Poisson's ratio, thickness (mm)."""

    youngs_modulus: float
    poissons_ratio: float
    thickness: float

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants of plane stress, MPa: `lambda* = E nu / (1 - nu^2)` and `mu = E / (2 (1 + nu))`."""
        e, nu = self.youngs_modulus, self.poissons_ratio
        return e * nu / (1 - nu**2), e / (2 * (1 + nu))


def skfem_mesh(mesh: StageMesh) -> skfem.MeshTri2:
    """The mesh for scikit-fem: same nodes, same order, so that node k carries the degrees of freedom 2k and 2k + 1."""
    from skfem import MeshTri2

    return MeshTri2(np.ascontiguousarray(mesh.nodes.T), np.ascontiguousarray(mesh.triangles[:, :3].T))


class ElementBatch(NamedTuple):
    """Some of the triangles with what integration over them needs.

    triangles : (e, 6) nodes.
    gradients : (e, 6 nodes, 2, q points), 1/mm, of the shape functions.
    weights : (e, q), mm^2, quadrature weights times Jacobian determinant.
    """

    triangles: Index
    gradients: Array
    weights: Array

    def where(self, chosen: AnyArray) -> ElementBatch:
        """The triangles for which `chosen` (e,) holds."""
        return ElementBatch(self.triangles[chosen], self.gradients[chosen], self.weights[chosen])

    def pieces(self, size: int) -> Iterator[ElementBatch]:
        """The batch in pieces of at most `size` triangles."""
        for start in range(0, len(self.triangles), size):
            part = slice(start, start + size)
            yield ElementBatch(self.triangles[part], self.gradients[part], self.weights[part])


def integration(mesh: StageMesh, degree: int = QUADRATURE) -> list[ElementBatch]:
    """Gradients and weights of all triangles in batches of `CHUNK`.

    Raises ValueError for a degree whose rule has weights that are not positive.
    """
    points, rule = quadrature(degree)
    batches = []
    for start in range(0, len(mesh.triangles), CHUNK):
        part = mesh.triangles[start : start + CHUNK]
        found, determinant = gradients(mesh.nodes[part], points)
        batches.append(ElementBatch(part, found, np.abs(determinant) * rule))
    return batches


def element_matrices(batch: ElementBatch, plate: Plate) -> Array:
    """Element stiffness matrices (e, 6, 2, 6, 2), N/mm: node, direction, node, direction.

    Notes
    -----
    With `M[ia, jb] = b int d_a phi_i d_b phi_j dA`, the weak form `b int sigma(u) : eps(v) dA` has the element matrix
    `K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu delta_ab sum_c M[ic, jc]`.
    """
    lame, mu = plate.lame
    root = batch.gradients * np.sqrt(plate.thickness * batch.weights)[:, None, None]
    flat = root.reshape(len(root), 12, -1)
    m = (flat @ flat.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    k = lame * m + mu * m.transpose(0, 1, 4, 3, 2)
    trace = mu * (m[:, :, 0, :, 0] + m[:, :, 1, :, 1])
    k[:, :, 0, :, 0] += trace
    k[:, :, 1, :, 1] += trace
    return np.asarray(k)


def internal_forces(batches: list[ElementBatch], plate: Plate, fields: Array) -> Array:
    """Nodal forces (k, n, 2), N, that hold the displacements (k, n, 2), mm: the stiffness matrix times them.

    Notes
    -----
    Formed from differences of displacements within a triangle, so the stage's large rigid motions cancel before they
    are multiplied by Young's modulus: far more accurate than the matrix product, which is what refinement needs.
    """
    forces = np.zeros_like(fields)
    for batch in batches:
        add_nodal_forces(forces, batch, plate, stress_tensor(plate, slopes_of(batch, fields)))
    return forces


def slopes_of(batch: ElementBatch, fields: Array) -> Array:
    """Displacement gradients `d_b u_a` (k, e, 2, 2, q) of fields (k, n, 2), mm, from differences within a triangle."""
    relative = fields[:, batch.triangles] - fields[:, batch.triangles[:, :1]]
    return np.asarray(np.einsum("keia,eibq->keabq", relative, batch.gradients, optimize=True))


def add_nodal_forces(forces: Array, batch: ElementBatch, plate: Plate, stress: Array) -> None:
    """Add to forces (k, n, 2), N, those that balance stresses (k, e, 2, 2, q): `f_ia = b int s_ab d_b phi_i dA`."""
    weighted = stress * (plate.thickness * batch.weights)[:, None, None]
    nodal = np.einsum("keabq,eibq->keia", weighted, batch.gradients, optimize=True)
    for force, values in zip(forces, nodal, strict=True):
        for axis in (0, 1):
            force[:, axis] += np.bincount(batch.triangles.ravel(), values[..., axis].ravel(), minlength=len(force))


def stress_tensor(plate: Plate, slopes: Array) -> Array:
    """Stress (..., 2, 2, q), MPa, of displacement gradients `d_b u_a` (..., 2, 2, q)."""
    lame, mu = plate.lame
    trace = lame * (slopes[..., 0, 0, :] + slopes[..., 1, 1, :])
    stress = mu * (slopes + np.swapaxes(slopes, -3, -2))
    stress[..., 0, 0, :] += trace
    stress[..., 1, 1, :] += trace
    return np.asarray(stress)


def nodal_stress(mesh: StageMesh, plate: Plate, field: Array) -> Array:
    """Stress (n, 3), MPa, as xx, yy, xy at the nodes, averaged over the triangles around each.

    field : (n, 2) displacements, mm.
    """
    relative = field[mesh.triangles] - field[mesh.triangles[:, :1]]
    found, _ = gradients(mesh.nodes[mesh.triangles], NODES)
    stress = stress_tensor(plate, np.einsum("eia,eibq->eabq", relative, found, optimize=True))
    around = np.bincount(mesh.triangles.ravel())
    parts = (stress[:, 0, 0], stress[:, 1, 1], stress[:, 0, 1])
    return np.stack([np.bincount(mesh.triangles.ravel(), part.ravel()) / around for part in parts], axis=-1)


def von_mises(stress: Array, pull: float = 0.0, across: Array | float = 0.0) -> Array:
    """Von Mises stress (...) from xx, yy, xy (..., 3), MPa; zz = `pull` (xx + yy) + `across`, nu as pull in strain."""
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    zz = pull * (xx + yy) + across
    return np.asarray(np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2))


CACHED = 400  # triangles whose matrices are made at once: they fit a processor's cache, and memory is used again
FREE = np.tril_indices(12)  # the 78 pairs of a triangle's degrees of freedom
TIED = np.tril_indices(15)  # the 120 pairs of these and of the pose


def matrices_of(batches: list[ElementBatch], plate: Plate) -> Iterator[Array]:
    """Element stiffness matrices (e, 6, 2, 6, 2), N/mm, some triangles at a time."""
    return (element_matrices(piece, plate) for batch in batches for piece in batch.pieces(CACHED))


def tied_lower(triangles: Index, matrices: Iterable[Array], number: Index, rigid: Array) -> sp.coo_array:
    """Lower triangle (2 free + 3, 2 free + 3), entries in one place to be added up, of T' K T.

    Parameters
    ----------
    triangles : (m, 6) nodes.   matrices : (e, 6, 2, 6, 2), symmetric, of the triangles in their order.
    number : (n,), free nodes counted first, then those tied to the pose; -1 for a node left out (held at zero).
    rigid : (2 tied, 3), displacement of the tied nodes per pose, so that u = T q. With none, the pose is left out.
    """
    free = int(number.max()) + 1 - len(rigid) // 2
    nodes = number[triangles].astype(np.int32)
    beside = np.flatnonzero(np.any(nodes >= free, axis=1))
    plain = len(FREE[0]) * len(nodes)
    values = np.empty(plain + len(TIED[0]) * len(beside))
    tied = _gather(matrices, values[:plain].reshape(len(nodes), -1), beside)
    values[plain:] = _tied_values(tied, nodes[beside], free, rigid)
    rows, columns = _rows_and_columns(nodes, beside, free)
    out = columns < 0
    values[out] = rows[out] = columns[out] = 0
    size = 2 * free + (3 if len(rigid) else 0)
    return sp.coo_array((values, (rows, columns)), shape=(size, size))


def _gather(matrices: Iterable[Array], values: Array, beside: Index) -> Array:
    """Put the lower triangles of all matrices into values (m, 78); those of the triangles beside a tied node, whole."""
    whole, first = np.empty((len(beside), 6, 2, 6, 2)), 0
    for part in matrices:
        last = first + len(part)
        np.take(part.reshape(-1, 144), 12 * FREE[0] + FREE[1], axis=1, out=values[first:last], mode="clip")
        here = slice(*np.searchsorted(beside, [first, last]))
        whole[here], first = part[beside[here] - first], last
    return whole


def _tied_values(matrices: Array, nodes: AnyArray, free: int, rigid: Array) -> Array:
    """Values (120 e,) of triangles (e, 6) with tied nodes, by the lower triangle of their unknowns and the pose."""
    T, tied = np.zeros((len(nodes), 6, 2, 15)), nodes >= free
    T.reshape(-1, 12, 15)[:, np.arange(12), np.arange(12)] = np.repeat(~tied, 2, axis=1)
    T[tied, :, 12:] = rigid.reshape(-1, 2, 3)[nodes[tied] - free]
    found = np.einsum("eiap,eiajb,ejbq->epq", T, matrices, T, optimize=True)
    return np.asarray(found[:, TIED[0], TIED[1]].ravel())


def _rows_and_columns(nodes: AnyArray, beside: Index, free: int) -> tuple[AnyArray, AnyArray]:
    """Places of all entries, rows >= columns; a negative column of those left out, and of those that are tied."""
    tied = nodes[beside]
    pose = np.broadcast_to(2 * free + np.arange(3, dtype=np.int32), (len(tied), 3))
    nodes[beside] = -1
    kinds = [(_dofs(nodes), FREE), (np.hstack([_dofs(np.where(tied < free, tied, -1)), pose]), TIED)]
    one, other = (np.concatenate([dofs[:, pairs[k]].ravel() for dofs, pairs in kinds]) for k in (0, 1))
    return np.maximum(one, other), np.minimum(one, other, out=other)


def _dofs(nodes: AnyArray) -> AnyArray:
    """Degrees of freedom (e, 12) of triangles (e, 6)."""
    return (2 * nodes[:, :, None] + np.arange(2, dtype=np.int32)).reshape(-1, 12)


def stiffness_matrix(batches: list[ElementBatch], plate: Plate, nodes: int) -> sp.csc_array:
    """Stiffness matrix (2n, 2n), N/mm, of all nodes, degrees of freedom x, y node by node."""
    triangles = np.concatenate([batch.triangles for batch in batches])
    lower = tied_lower(triangles, matrices_of(batches, plate), np.arange(nodes), np.empty((0, 3))).tocsc()
    return (lower + sp.tril(lower, -1).T).tocsc()
