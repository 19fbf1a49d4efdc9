"""The stage in three dimensions: plane triangles times layers through the thickness, wedges of 18 nodes.

Displacements are products of the shape functions of a curved quadratic triangle, phi, and of a quadratic segment, psi.
A block of the stiffness that belongs to two nodes of the plane is therefore a sum of four matrices of the line, each
times a 3 x 3 matrix of the plane, and all blocks come from one matrix product. scikit-fem 12 has wedges of six nodes
only, and straight ones.

Half the thickness is enough for loads in the plane: the mid-plane z = 0 stays a plane, w = 0. Integrals are over both
halves, so forces are those of the whole thickness. The hub's face is bonded to a rigid body that moves in the plane,
`u = X - theta y, v = Y + theta x, w = 0`; the face on the ground is held, `u = v = w = 0`. Motion out of the plane is
antisymmetric: u = v = 0 on the mid-plane, w is free, and the hub has the pose Z, a, b with a and b its rotations about
x and y: `u = b z, v = -a z, w = Z + a y - b x`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.layers import Layers, rigid_fields
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import CACHED, ElementBatch, Plate, integration
from flexfem.fem.problem import shape_values
from flexfem.fem.response import Tied
from flexfem.mechanism.stage import Stage

DEGREE = 4  # of the quadrature in the plane: of products of two quadratic shape functions


def sheet_of(stage: Stage) -> Plate:
    """The metal and the thickness of a stage."""
    return Plate(stage.material.youngs_modulus, stage.material.poissons_ratio, stage.thickness)


def solid_lame(plate: Plate) -> tuple[float, float]:
    """Lame constants, MPa: `lambda = E nu / ((1 + nu) (1 - 2 nu))`, `mu = E / (2 (1 + nu))`."""
    e, nu = plate.youngs_modulus, plate.poissons_ratio
    return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))


class Solid(NamedTuple):
    """What the equations of a stage, or of a sector of it, are made of.

    batches : of the triangles, at the points of quadrature whose shape functions are phi (6, q).
    tied : the nodes of the plane that are free, or tied to the hub.
    """

    batches: list[ElementBatch]
    phi: Array
    lame: tuple[float, float]
    layers: Layers
    tied: Tied

    @property
    def size(self) -> int:
        """Number of unknowns: those of the free nodes of the plane, then the pose."""
        return len(self.tied.free) * self.layers.unknowns + 3

    def fields(self, motion: Array) -> Array:
        """Displacements (k, n, m, 3), mm, of all nodes from unknowns (size, k)."""
        fields = np.zeros((motion.shape[1], len(self.tied.number), len(self.layers.heights), 3))
        free = motion[:-3].T.reshape(len(fields), len(self.tied.free), -1)
        fields[:, self.tied.free[:, None], *self.layers.kept] = free
        fields[:, self.tied.hub] = np.moveaxis(self.bonded @ motion[-3:], -1, 0)
        return fields

    def loads(self, forces: Array) -> Array:
        """Loads (size, k) on the unknowns from nodal forces (k, n, m, 3), N."""
        free = forces[:, self.tied.free[:, None], *self.layers.kept].reshape(len(forces), -1)
        hub = np.einsum("khmc,hmcp->kp", forces[:, self.tied.hub], self.bonded)
        return np.concatenate([free, hub], axis=1).T

    @property
    def bonded(self) -> Array:
        """Displacements (h, m, 3, 3) of the hub's nodes at all heights per pose."""
        return rigid_fields(self.layers, self.tied.rigid)

    def forces(self, fields: Array) -> Array:
        """Nodal forces (k, n, m, 3), N, that hold displacements (k, n, m, 3), mm.

        Notes
        -----
        From differences of displacements within a triangle and through the thickness, so that large rigid motions
        cancel before they are multiplied by Young's modulus, as in `plane_stress.internal_forces`.
        """
        total = np.zeros_like(fields)
        for piece in (piece for batch in self.batches for piece in batch.pieces(CACHED)):
            gathered = gathering(piece.triangles, fields.shape[1])
            for field, found in zip(fields, total, strict=True):
                nodal = self._held(piece, field).reshape(piece.triangles.size, -1)
                found += (gathered @ nodal).reshape(found.shape)
        return total

    def _held(self, piece: ElementBatch, field: Array) -> Array:
        """Nodal forces (e, 6, m, 3) of some triangles under one field (n, m, 3)."""
        values, slopes, weights = self.layers.values, self.layers.slopes, self.layers.weights
        at = field[piece.triangles]
        across = np.einsum("eimc,eibq,mz->ecbqz", at - at[:, :1], piece.gradients, values, optimize=True)
        lifted = np.einsum("eimc,iq,mz->ecqz", at - at[:, :, :1], self.phi, slopes, optimize=True)
        gradient = np.concatenate([across, lifted[:, :, None]], axis=2)
        stress = solid_stress(self.lame, gradient) * (piece.weights[:, :, None] * weights)[:, None, None]
        nodal = np.einsum("ecbqz,eibq,mz->eimc", stress[:, :, :2], piece.gradients, values, optimize=True)
        return np.asarray(nodal + np.einsum("ecqz,iq,mz->eimc", stress[:, :, 2], self.phi, slopes, optimize=True))

    def lower(self) -> sp.coo_array:
        """Lower triangle (size, size) of the stiffness of the unknowns.

        Notes
        -----
        The columns of the pose are the forces under the three motions of the hub alone.
        """
        free, each = len(self.tied.free), self.layers.unknowns
        motion = np.zeros((self.size, 3))
        motion[-3:] = np.eye(3)
        pose = self.loads(self.forces(self.fields(motion)))
        values, rows, columns = (np.concatenate(parts) for parts in zip(*self._blocks(), strict=True))
        below = np.nonzero(pose[:-3])
        corner = np.tril_indices(3)
        last = free * each
        data = np.concatenate([values, pose[:-3][below], pose[-3:][corner]])
        at = np.concatenate([rows, last + below[1], last + corner[0]])
        by = np.concatenate([columns, below[0], last + corner[1]])
        return sp.coo_array((data, (at.astype(np.int32), by.astype(np.int32))), shape=(self.size, self.size))

    def _blocks(self) -> Iterator[tuple[Array, AnyArray, AnyArray]]:
        """Values, rows and columns of the free nodes' stiffness, the whole lower triangle once."""
        rows, columns, plane = self._plane_pairs()
        line, k, j = self._line_pairs()
        place = np.full((len(self.layers.heights), 3), -1)  # of the unknown among those of a node
        place[self.layers.kept] = np.arange(self.layers.unknowns)
        one, other = np.broadcast_arrays(place[k][:, :, None], place[j][:, None, :])
        kept = np.flatnonzero((one.ravel() >= 0) & (other.ravel() >= 0))
        one, other = one.ravel()[kept], other.ravel()[kept]
        values = np.einsum("pfab,fy->pyab", plane, line, optimize=True).reshape(len(rows), -1)[:, kept]
        off, each = rows != columns, self.layers.unknowns
        yield values[off].ravel(), *((each * n[off, None] + at).ravel() for n, at in ((rows, one), (columns, other)))
        half = one >= other
        same = each * rows[~off, None]
        yield values[~off][:, half].ravel(), (same + one[half]).ravel(), (same + other[half]).ravel()

    def _plane_pairs(self) -> tuple[Index, Index, Array]:
        """Pairs of free nodes (p,), (p,), the first not before the second, and their coefficients (p, 4, 3, 3).

        Notes
        -----
        Of the line's `int psi_k psi_l dz`, `int psi'_k psi'_l dz`, `int psi_k psi'_l dz` and `int psi'_k psi_l dz`, in
        the weak form `int lambda e_kk(u) e_ll(v) + 2 mu e(u) : e(v) dV`.
        """
        lame, mu = self.lame
        nodes = np.concatenate([self.tied.number[batch.triangles] for batch in self.batches])
        nodes[nodes >= len(self.tied.free)] = -1
        found = []
        for batch in self.batches:
            g = np.einsum("eiaq,ejbq,eq->eijab", batch.gradients, batch.gradients, batch.weights, optimize=True)
            a = np.einsum("eiaq,jq,eq->eija", batch.gradients, self.phi, batch.weights, optimize=True)
            mass = np.einsum("iq,jq,eq->eij", self.phi, self.phi, batch.weights, optimize=True)
            laplace, back = g[..., 0, 0] + g[..., 1, 1], a.swapaxes(1, 2)
            c = np.zeros((*mass.shape, 4, 3, 3))
            c[..., 0, :2, :2] = lame * g + mu * g.swapaxes(3, 4)
            for axis in (0, 1):
                c[..., 0, axis, axis] += mu * laplace
                c[..., 1, axis, axis] = mu * mass
            c[..., 0, 2, 2], c[..., 1, 2, 2] = mu * laplace, (lame + 2 * mu) * mass
            c[..., 2, :2, 2], c[..., 2, 2, :2] = lame * a, mu * a
            c[..., 3, :2, 2], c[..., 3, 2, :2] = mu * back, lame * back
            found.append(c)
        coefficients = np.concatenate(found)
        one, other = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
        chosen = (other >= 0) & (one >= other)
        keys, pair = np.unique(one[chosen] * len(self.tied.number) + other[chosen], return_inverse=True)
        gathered = sp.csr_array((np.ones(len(pair)), (pair, np.arange(len(pair)))), shape=(len(keys), len(pair)))
        rows, columns = np.divmod(keys, len(self.tied.number))
        return rows, columns, (gathered @ coefficients[chosen].reshape(len(pair), 36)).reshape(-1, 4, 3, 3)

    def _line_pairs(self) -> tuple[Array, Index, Index]:
        """Integrals (4, y) over the line for the pairs (y,), (y,) of its nodes that share a layer."""
        values, slopes, weights = self.layers.values, self.layers.slopes, self.layers.weights
        one, two = values * weights, slopes * weights
        k, j = np.nonzero((values != 0).astype(float) @ (values != 0).T)
        integrals = np.array([one @ values.T, two @ slopes.T, one @ slopes.T, two @ values.T])
        return integrals[:, k, j], k, j


def gathering(triangles: Index, nodes: int) -> sp.csc_array:
    """Matrix (nodes, 6 e) that adds up values at the corners and middles of triangles (e, 6)."""
    every = np.arange(triangles.size + 1)
    return sp.csc_array((np.ones(triangles.size), triangles.ravel(), every), shape=(nodes, triangles.size))


def solid(mesh: StageMesh, plate: Plate, layers: Layers, tied: Tied, degree: int = DEGREE) -> Solid:
    """The equations of a mesh of the plane with layers."""
    return Solid(integration(mesh, degree), shape_values(degree), solid_lame(plate), layers, tied)


def solid_stress(lame: tuple[float, float], gradient: Array) -> Array:
    """Stress (e, 3, 3, ...), MPa, of displacement gradients `d_b u_a` (e, 3, 3, ...)."""
    stress = lame[1] * (gradient + gradient.swapaxes(1, 2))
    trace = lame[0] * (gradient[:, 0, 0] + gradient[:, 1, 1] + gradient[:, 2, 2])
    for axis in range(3):
        stress[:, axis, axis] += trace
    return np.asarray(stress)
