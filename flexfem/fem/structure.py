"""A structure of finite elements: a mesh of the plane of one thickness, or extruded by layers, held and tied to a hub.

Half the thickness is enough for loads in the plane: the mid-plane z = 0 stays a plane, w = 0. Integrals are over both
halves, so forces are those of the whole thickness. The ground is clamped; the face of the hub is bonded to a rigid body
that moves in the plane, `u = X - theta y, v = Y + theta x, w = 0`. Motion out of the plane is antisymmetric: u = v = 0
on the mid-plane, w is free, and the hub has the pose Z, a, b with a and b its rotations about x and y.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.elements import (
    MASS_QUADRATURE,
    QUADRATURE,
    SOLID_QUADRATURE,
    ElementBatch,
    Layers,
    Plate,
    integration,
    internal_forces,
    matrices_of,
    mirrored,
    shape_values,
    tied_lower,
    wedge_forces,
    wedge_lower,
)
from flexfem.fem.mesh import StageMesh
from flexfem.mechanism.designs import out_of_plane
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import located
from flexfem.refused import BadInput, ComputationFailed

MOST_UNKNOWNS = 600_000  # of one factorisation in three dimensions: about 6 GB


def plate_of(stage: Stage) -> Plate:
    """The plate of the plane problem of a stage. Raises BadInput for a model that is not plane."""
    with located(stage):
        if stage.model == "corrected":
            raise BadInput(
                'model = "corrected", which has hinges of three dimensions, expected "plane_stress" or "plane_strain": '
                "the finite elements are plane"
            )
    E, nu = stage.elastic
    return Plate(float(E), float(nu), stage.thickness)


def sheet_of(stage: Stage) -> Plate:
    """The material and the thickness of a stage, as three dimensions need them."""
    return Plate(stage.material.youngs_modulus, stage.material.poissons_ratio, stage.thickness)


def out_of_plane_ratio_of(stage: Stage) -> float:
    """The stress out of the plane over the sum of those in it: `pull` of `elements.von_mises`."""
    return float(out_of_plane(stage.model, stage.material.poissons_ratio))


def layers_of(stage: Stage, number: int, antisymmetric: bool = False) -> Layers:
    """Layers for a stage, graded for its narrowest neck, and for motion in the plane unless it is antisymmetric."""
    found = mirrored(stage.thickness, number, float(stage.array("neck").min()))
    return found.antisymmetric if antisymmetric else found


class Tied(NamedTuple):
    """Nodes of the plane: free ones (f,), and those of the hub (h,), which follow its pose; others are clamped.

    number : (n,), free nodes counted first, then hub nodes; -1 where clamped.
    rigid : (2h, 3), displacement of the hub's nodes per pose, `u = U + theta x r`.
    """

    number: Index
    free: Index
    hub: Index
    rigid: Array


NONE = np.empty(0, dtype=np.int64)


def tie(mesh: StageMesh, held: Index = NONE, hub: Index = NONE, last: Index = NONE) -> Tied:
    """Number the nodes of a mesh: `held` ones clamped, those of the `hub` rigid, free ones of `last` at the end."""
    inside = np.ones(len(mesh.nodes), dtype=bool)
    inside[held] = inside[hub] = inside[last] = False
    free = np.concatenate([np.flatnonzero(inside), last])
    number = np.full(len(mesh.nodes), -1)
    number[free], number[hub] = np.arange(len(free)), len(free) + np.arange(len(hub))
    return Tied(number, free, hub, rigid_motion(mesh.nodes[hub]))


def tie_hub(mesh: StageMesh, last: Index = NONE) -> Tied:
    """As `tie`, the edges on the ground clamped and those on the hub rigid."""
    return tie(mesh, mesh.edges["ground"].ravel(), np.unique(mesh.edges["hub"]), last)


def rigid_motion(nodes: Array) -> Array:
    """Displacements (2h, 3) of nodes (h, 2) per pose, `u = U + theta x r`."""
    x, y = nodes.T
    one, zero = np.ones(len(nodes)), np.zeros(len(nodes))
    return np.stack([one, zero, -y, zero, one, x], axis=-1).reshape(-1, 3)


class Structure(NamedTuple):
    """What equations are made of.

    layers : None of a plane structure; fields are (k, n, 2), of an extruded one (k, n, m, 3) at m heights.
    batches : of the triangles, at the points of quadrature whose shape functions are phi (6, q).

    Unknowns are those of the free nodes of the plane, node by node, then the pose (3) where there is a hub.
    """

    mesh: StageMesh
    plate: Plate
    tied: Tied
    layers: Layers | None
    batches: list[ElementBatch]
    phi: Array

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacement of a node of the plane."""
        return (2,) if self.layers is None else (len(self.layers.heights), 3)

    @property
    def unknowns_of_node(self) -> int:
        """Unknowns of one free node of the plane."""
        return 2 if self.layers is None else self.layers.unknowns

    @property
    def poses(self) -> int:
        """Components of the pose: none without a hub."""
        return 3 if len(self.tied.hub) else 0

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.tied.free) * self.unknowns_of_node + self.poses

    @property
    def turning(self) -> Index:
        """Two components of the pose that a turn of the structure turns as a vector, and the one that it leaves."""
        return np.array([1, 2, 0] if self.layers and self.layers.fixed else [0, 1, 2])

    def rigid_fields(self, nodes: Index) -> Array:
        """Displacements (k, *shape, 3) of nodes of the plane (k,) per pose."""
        rigid = rigid_motion(self.mesh.nodes[nodes])
        return rigid.reshape(-1, 2, 3) if self.layers is None else self.layers.rigid_fields(rigid)

    @property
    def _bonded(self) -> Array:
        """Displacements (h, *shape, 3) of the hub's nodes per pose."""
        rigid = self.tied.rigid
        return rigid.reshape(-1, 2, 3) if self.layers is None else self.layers.rigid_fields(rigid)

    def spread(self, values: Array) -> Array:
        """Fields (k, n, *shape) that are zero but at the free nodes, from their unknowns (k, free)."""
        fields = np.zeros((len(values), len(self.tied.number), *self.shape))
        free = values.reshape(len(values), len(self.tied.free), -1)
        if self.layers is None:
            fields[:, self.tied.free] = free
        else:
            fields[:, self.tied.free[:, None], *self.layers.kept] = free
        return fields

    def gathered(self, fields: Array) -> Array:
        """Values (k, free) of fields (k, n, *shape) at the unknowns of the free nodes."""
        free = self.tied.free
        found = fields[:, free] if self.layers is None else fields[:, free[:, None], *self.layers.kept]
        return found.reshape(len(fields), -1)

    def fields(self, motion: Array) -> Array:
        """Displacements (k, n, *shape), mm, of all nodes from unknowns (size, k)."""
        fields = self.spread(motion[: self.size - self.poses].T)
        if self.poses:
            fields[:, self.tied.hub] = np.moveaxis(self._bonded @ motion[-3:], -1, 0)
        return fields

    def loads(self, forces: Array) -> Array:
        """Loads (size, k) on the unknowns from nodal forces (k, n, *shape), N."""
        found = self.gathered(forces)
        if self.poses:
            on_hub = forces[:, self.tied.hub].reshape(len(forces), -1) @ self._bonded.reshape(-1, 3)
            found = np.concatenate([found, on_hub], axis=1)
        return found.T

    def forces(self, fields: Array) -> Array:
        """Nodal forces (k, n, *shape), N, that hold displacements (k, n, *shape), mm."""
        if self.layers is None:
            return internal_forces(self.batches, self.plate, fields)
        return wedge_forces(self.batches, self.phi, self.plate, self.layers, fields)

    def lower(self) -> sp.coo_array:
        """Lower triangle (size, size) of the stiffness of the unknowns, entries in one place to be added up.

        Raises ComputationFailed for more equations in three dimensions than `MOST_UNKNOWNS`.

        Notes
        -----
        With u = T q it is T' K T. Of wedges the columns of the pose are the forces under its three motions alone.
        """
        if self.layers is None:
            matrices = matrices_of(self.batches, self.plate)
            return tied_lower(self.mesh.triangles, matrices, self.tied.number, self.tied.rigid)
        if self.size > MOST_UNKNOWNS:
            raise ComputationFailed(
                f"{self.size:.2g} unknowns in three dimensions, expected at most {MOST_UNKNOWNS:.2g}: "
                "a coarser resolution or fewer layers are needed"
            )
        free = len(self.tied.free)
        parts = list(wedge_lower(self.batches, self.phi, self.plate, self.layers, self.tied.number, free))
        if self.poses:
            pose = self.loads(self.forces(self.fields(np.eye(self.size, 3, 3 - self.size))))
            below, corner, last = np.nonzero(pose[:-3]), np.tril_indices(3), self.size - 3
            parts += [(pose[:-3][below], last + below[1], below[0])]
            parts += [(pose[-3:][corner], last + corner[0], last + corner[1])]
        values, rows, columns = (np.concatenate(each) for each in zip(*parts, strict=True))
        return sp.coo_array((values, (rows.astype(np.int32), columns.astype(np.int32))), shape=(self.size, self.size))


def structure(
    mesh: StageMesh, plate: Plate, layers: Layers | None = None, tied: Tied | None = None, degree: int | None = None
) -> Structure:
    """A mesh as a structure, plane without layers; `tied` as by `tie_hub`; `degree` of the quadrature in the plane."""
    degree = degree or (QUADRATURE if layers is None else SOLID_QUADRATURE)
    return Structure(mesh, plate, tied or tie_hub(mesh), layers, integration(mesh, degree), shape_values(degree))


class Mass(NamedTuple):
    """Consistent mass: that of two nodes at two heights is a product of two numbers.

    areal : (n, n), tonne/mm, `rho int phi_i phi_j dA`; of a plane structure times the thickness.
    line : (m, m), mm, `int psi_k psi_l dz`; None of a plane structure.
    carried : (3, 3), mass matrix of what moves as the pose of the hub.
    """

    areal: sp.csr_array
    line: Array | None
    carried: Array

    def forces(self, fields: Array) -> Array:
        """Nodal forces (k, n, *shape), N, of accelerations, mm/s^2, without what the pose carries."""
        found = np.empty_like(fields)
        for force, field in zip(found, fields, strict=True):
            moved = (self.areal @ field.reshape(len(field), -1)).reshape(field.shape)
            force[:] = moved if self.line is None else self.line @ moved
        return found

    def total(self, of: Structure) -> Array:
        """Mass matrix (3, 3) of the whole as one rigid body, the clamped faces too."""
        rigid = np.moveaxis(of.rigid_fields(np.arange(len(of.mesh.nodes))), -1, 0)
        return np.asarray(rigid.reshape(3, -1) @ self.forces(rigid).reshape(3, -1).T + self.carried)

    def loads(self, of: Structure, motion: Array) -> Array:
        """The mass matrix times accelerations (size, k) of the unknowns."""
        loads = of.loads(self.forces(of.fields(motion)))
        if of.poses:
            loads[-3:] += self.carried @ motion[-3:]
        return loads


def mass_of(of: Structure, density: float, carried: Array | None = None, degree: int = MASS_QUADRATURE) -> Mass:
    """Consistent mass of a structure, by default exact on curved triangles; density in tonne/mm^3."""
    N, number = shape_values(degree), len(of.mesh.nodes)
    areal = sp.csr_array((number, number))
    for batch in integration(of.mesh, degree):
        values = density * np.einsum("iq,jq,eq->eij", N, N, batch.weights, optimize=True)
        places = (np.repeat(batch.triangles, 6, axis=1).ravel(), np.tile(batch.triangles, (1, 6)).ravel())
        areal = areal + sp.coo_array((values.ravel(), places), shape=(number, number)).tocsr()
    carried = np.zeros((3, 3)) if carried is None else carried
    if of.layers is None:
        return Mass(areal * of.plate.thickness, None, carried)
    return Mass(areal, (of.layers.values * of.layers.weights) @ of.layers.values.T, carried)
