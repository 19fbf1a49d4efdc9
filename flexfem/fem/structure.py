"""Finite-element structures: plane or extruded by layers, clamped and tied to rigid bodies.

Loads in the plane need half of the thickness: the mid-plane z = 0 stays plane, w = 0. Integrals
cover both halves, so forces are those of the whole thickness. The ground is clamped; the face of
the hub is bonded to a rigid body that moves in the plane, `u = X - theta y, v = Y + theta x, w =
0`. Motion out of the plane is antisymmetric: u = v = 0 on the mid-plane, w is free, and the pose of
the hub is Z, a, b with its rotations a and b about x and y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import (
    CACHED,
    CHUNK,
    MASS_QUADRATURE,
    QUADRATURE,
    SOLID_QUADRATURE,
    ElementBatch,
    Layers,
    Pairs,
    Plate,
    assembled,
    integration,
    sheet,
    stress_tensor,
)
from flexfem.fem.factor import Solve, elimination_order, factorise
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.refused import ComputationFailed

MOST_UNKNOWNS = 600_000  # in one factorisation in three dimensions: about 6 GB
NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Structure:
    """A finite-element model.

    The unknowns are those of the free nodes, node by node, then the pose (3) of the hub.

    layers : None for a plane structure, with fields (k, n, 2); an extruded one has fields (k, n, m,
        3) at m heights.
    degree : of the quadrature in the plane.
    free, hub : free nodes of the plane (f,), and those of rigid bodies (h,); all others are
        clamped.
    body : (h,), number of the rigid body of each of these, the hub or one of several sections.
    """

    mesh: PlaneMesh
    plate: Plate
    layers: Layers | None
    degree: int
    free: Index
    hub: Index
    body: Index

    @cached_property
    def batches(self) -> list[ElementBatch]:
        """All triangles, prepared for integration."""
        return integration(self.mesh, self.degree)

    @cached_property
    def line(self) -> Layers:
        """The layers, or the single node through the thickness of a plane structure."""
        return self.layers or sheet(self.plate.thickness)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacement of a node of the plane."""
        return (2,) if self.layers is None else (len(self.layers.heights), 3)

    @property
    def poses(self) -> int:
        """Number of components of the poses: 3 for every rigid body."""
        return 3 * len(np.unique(self.body))

    @property
    def size(self) -> int:
        return len(self.free) * self.block + self.poses

    @property
    def block(self) -> int:
        """Number of unknowns of a free node of the plane."""
        return len(self.line.free_components)

    @property
    def vector_first(self) -> Index:
        """Indices of the pose components that rotate as a vector about z, then of the third."""
        return np.array([1, 2, 0] if self.line.fixed else [0, 1, 2])

    def rigid_fields(self, nodes: Index | slice = slice(None)) -> Array:
        """Displacements (3, k, *shape) of nodes of the plane (k,) per unit pose."""
        rigid = np.moveaxis(self.line.rigid(self.mesh.nodes[nodes]), -1, 0)
        return rigid.reshape(*rigid.shape[:2], *self.shape)

    def rigid_unknowns(self, nodes: Index) -> Array:
        """Unknowns (k times those of a node, 3), per unit pose, of nodes (k,) taken as free."""
        components = len(self.line.heights) * self.line.axes
        rigid = self.line.rigid(self.mesh.nodes[nodes]).reshape(len(nodes), components, 3)
        return rigid[:, self.line.free_components].reshape(-1, 3)

    @property
    def rigid(self) -> Array:
        """Unknowns (size, 3) of a motion of the whole as a rigid body, per unit pose."""
        of_bodies = np.tile(np.eye(3), (self.poses // 3, 1))
        return np.concatenate([self.rigid_unknowns(self.free), of_bodies])

    @cached_property
    def T(self) -> sp.csr_array:
        """Matrix from the unknowns to the displacements of all nodes."""
        line = self.line
        components = len(self.line.heights) * self.line.axes
        rows = (self.free[:, None] * components + line.free_components).ravel()
        columns = np.arange(len(rows))
        values = np.ones(len(rows))
        if self.poses:
            tied = self.hub[:, None] * components + np.arange(components)
            rows = np.concatenate([rows, np.repeat(tied.ravel(), 3)])
            poses = len(columns) + 3 * np.repeat(self.body, components)[:, None] + np.arange(3)
            columns = np.concatenate([columns, poses.ravel()])
            values = np.concatenate([values, line.rigid(self.mesh.nodes[self.hub]).ravel()])
        shape = (len(self.mesh.nodes) * components, self.size)
        return sp.csr_array((values, (rows, columns)), shape=shape)

    def fields(self, motion: Array) -> Array:
        """Displacements (k, n, *shape), mm, of all nodes from unknowns (size, k)."""
        return np.reshape((self.T @ motion).T, (motion.shape[1], len(self.mesh.nodes), *self.shape))

    def loads(self, forces: Array) -> Array:
        """Loads (size, k) on the unknowns from nodal forces (k, n, *shape), N."""
        return np.asarray(self.T.T @ forces.reshape(len(forces), -1).T)

    def forces(self, fields: Array) -> Array:
        """Internal forces (k, n, *shape), N, of displacements (k, n, *shape), mm.

        They have less round-off than K u.
        """
        total = np.zeros_like(fields, order="C")
        most = CHUNK if self.layers is None else CACHED
        for piece in (piece for batch in self.batches for piece in batch.pieces(most)):
            slopes = piece.slopes(self.line, fields)
            stress = stress_tensor(self.plate.of(piece.numbers), slopes)
            piece.add_forces(total, self.line, stress)
        return total

    @property
    def numbers(self) -> AnyArray:
        """Numbers (e, 6) of the nodes of triangles: free ones, those of rigid bodies; others -1."""
        moving = np.concatenate([self.free, self.hub])
        number = np.full(len(self.mesh.nodes), -1, dtype=np.int32)
        number[moving] = np.arange(len(moving))
        return number[self.mesh.triangles]

    def order(self, last: int = 0) -> Index:
        """Order of elimination of the free nodes but for the last."""
        return elimination_order(self.numbers, len(self.free) - last)

    @property
    def pairs(self) -> Pairs:
        """Pairs of free and hub nodes, numbered in this order."""
        nodes = self.numbers
        count = len(self.free) + len(self.hub)
        row, column = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
        chosen = (column >= 0) & (row >= column)
        row = row[chosen]
        column = column[chosen]
        ones = np.ones(len(row), dtype=np.int8)
        joint = sp.csr_array((ones, (row, column)), shape=(count, count))
        joint.data = np.arange(joint.nnz)
        return Pairs(joint.indices, joint.indptr, chosen, joint[row, column])

    def tie_hub(
        self,
        lower: sp.csr_array,
        rigid: Array,
    ) -> sp.csr_array:
        """Lower triangle (size, size) of T' K T from that of K of free and hub nodes.

        rigid : motion of the hub per pose.
        """
        first = lower.shape[0] - len(rigid)
        if not len(rigid):
            return lower
        rows = lower.indptr[: first + 1]
        entries = (lower.data[: rows[-1]], lower.indices[: rows[-1]], rows)
        free = sp.csr_array(entries, shape=(first, first + rigid.shape[1]))
        corner = lower[first:, first:].toarray()
        corner = np.tril(rigid.T @ (corner + np.tril(corner, -1).T) @ rigid)
        coupling = sp.csr_array(rigid.T) @ lower[first:, :first]
        pose = sp.hstack([coupling, sp.csr_array(corner)], format="csr")
        pose.sort_indices()  # a product leaves them unsorted
        return sp.vstack([free, pose], format="csr")

    @property
    def _rigid_hub(self) -> Array:
        """Unknowns of the nodes of rigid bodies, taken as free, per unit pose of each body."""
        own = np.repeat(np.eye(self.poses // 3)[self.body], self.block, axis=0)
        of_bodies = own[:, :, None] * self.rigid_unknowns(self.hub)[:, None]
        return np.reshape(of_bodies, (len(own), self.poses))

    def lower(self) -> sp.csr_array:
        """Lower triangle (size, size) of the stiffness of the unknowns.

        Raises ComputationFailed for more equations in three dimensions than `MOST_UNKNOWNS`.
        """
        if self.layers is not None and self.size > MOST_UNKNOWNS:
            raise ComputationFailed(
                f"{self.size:.2g} unknowns in three dimensions, expected at most "
                f"{MOST_UNKNOWNS:.2g}: a coarser resolution or fewer layers are needed"
            )
        pieces = (piece for batch in self.batches for piece in batch.pieces())
        axes = self.line.axes
        blocks = (piece.stiffness(self.plate.of(piece.numbers), axes) for piece in pieces)
        return self.tie_hub(assembled(self.pairs, blocks, self.line), self._rigid_hub)

    def factorised(self) -> Solve:
        """Inverse of the stiffness.

        Raises ComputationFailed as `design_arrays`, or when a part is not held.
        """
        return factorise(self.lower(), self.order(), self.poses)


def structure(
    mesh: PlaneMesh,
    plate: Plate,
    layers: Layers | None = None,
    degree: int | None = None,
    held: Index | None = None,
    last: Index = NONE,
    sections: Sequence[Index] = (),
) -> Structure:
    """Return the structure of a mesh, plane without layers.

    degree : of the quadrature in the plane.

    held : clamped nodes of a structure without hub; None clamps the edges on the ground and ties
        those on the hub.
    last : free nodes that are numbered last.
    sections : nodes of each part that moves as a rigid body, with `held`.
    """
    body = np.full(len(mesh.nodes), -1)
    for number, nodes in enumerate([nodes_on(mesh, "hub")] if held is None else sections):
        body[nodes] = number
    hub = np.flatnonzero(body >= 0)
    inner = body < 0
    inner[mesh.edges["ground"].ravel() if held is None else held] = False
    inner[last] = False
    free = np.concatenate([np.flatnonzero(inner), last])
    degree = degree or (QUADRATURE if layers is None else SOLID_QUADRATURE)
    return Structure(mesh, plate, layers, degree, free, hub, body[hub])


class Mass(NamedTuple):
    """Consistent mass matrix of a structure.

    It is a Kronecker product of a plane factor and one through the thickness.

    areal : (n, n), tonne/mm^2, `rho int phi_i phi_j dA`.   line : (m, m), mm, `int psi_k psi_l dz`.
    carried : (r, r), mass matrix of rigid bodies on the structure, of three freedoms each.
    at : (size, r), loads conjugate to the motions of these freedoms; those of the hub are its pose.
    """

    structure: Structure
    areal: sp.csr_array
    line: Array
    carried: Array
    at: Array

    def forces(self, fields: Array) -> Array:
        """Inertial forces (k, n, *shape), N, of accelerations, mm/s^2.

        The mass of rigid bodies is left out.
        """
        forces = np.empty_like(fields)
        for force, field in zip(forces, fields, strict=True):
            plane = self.areal @ field.reshape(len(field), -1)
            plane = plane.reshape(len(field), len(self.line), -1)
            force[:] = (self.line @ plane).reshape(field.shape)
        return forces

    def loads(self, motion: Array) -> Array:
        """Product of the mass matrix and accelerations (size, k) of the unknowns."""
        loads = self.structure.loads(self.forces(self.structure.fields(motion)))
        return np.asarray(loads + self.at @ (self.carried @ (self.at.T @ motion)))


def mass_of(
    structure: Structure,
    density: float | Array,
    carried: Array | None = None,
    degree: int = MASS_QUADRATURE,
    at: Array | None = None,
) -> Mass:
    """Return the consistent mass of a structure, by default exact on curved triangles.

    density : tonne/mm^3, of the plate, or (m,) of its triangles.
    carried, at : as of `Mass`, by default of the hub, without mass.
    """
    areal = _areal_mass(structure.mesh, density, degree)
    line = (structure.line.values * structure.line.weights) @ structure.line.values.T
    if at is None:
        at = np.eye(structure.size, structure.poses, structure.poses - structure.size)
    if carried is None:
        carried = np.zeros((at.shape[1], at.shape[1]))
    return Mass(structure, areal, line, carried, at)


def _areal_mass(
    mesh: PlaneMesh,
    density: float | Array,
    degree: int,
) -> sp.csr_array:
    """Return the plane factor (n, n) of a mass matrix, tonne/mm^2."""
    number = len(mesh.nodes)
    areal = sp.csr_array((number, number))
    for batch in integration(mesh, degree):
        own = density
        if isinstance(density, np.ndarray):
            own = np.reshape(density[batch.numbers], (-1, 1, 1))
        phi = batch.phi
        values = own * np.einsum("iq,jq,eq->eij", phi, phi, batch.weights, optimize=True)
        rows = np.repeat(batch.triangles, 6, axis=1).ravel()
        columns = np.tile(batch.triangles, (1, 6)).ravel()
        part = sp.coo_array((values.ravel(), (rows, columns)), shape=(number, number))
        areal = areal + part.tocsr()
    return areal
