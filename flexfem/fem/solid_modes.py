"""Natural frequencies of the extruded stage: wedges of 18 nodes, consistent mass, rigid hub; half of the thickness.

Modes in the plane and modes out of it are those of two halves, `Layers.antisymmetric`. The mass of a wedge is an
integral over its triangle times one over its layer, so the mass matrix of the free nodes is a Kronecker product and is
never made: it is applied to fields. Of three alike chains one sector is condensed onto its cuts, and the modes are
those of harmonic 0, the same in all chains, and of harmonic 1, `u_c = e^(2 pi i c / 3) u_0` in the frame of chain c,
whose real and imaginary parts are two modes of one frequency. Chains that differ are welded and solved at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.cyclic import tie_sector
from flexfem.fem.factor import condense, factorise
from flexfem.fem.harmonics import Space, harmonic_space
from flexfem.fem.layers import Layers, rigid_fields
from flexfem.fem.mesh import StageMesh, quadrature, shape_functions
from flexfem.fem.modes import DEGREE, aligned, check_settled, lowest, signs
from flexfem.fem.plane_stress import Plate, integration
from flexfem.fem.response import rigid_motion, tie_hub
from flexfem.fem.sectors import Sector, joined
from flexfem.fem.solid import DEGREE as STIFFNESS
from flexfem.fem.solid import Solid, solid
from flexfem.fem.solid_response import refuse_unknowns, spin_of, whole_fields
from flexfem.mechanism.designs import CHAIN_TURN


class SolidMass(NamedTuple):
    """Consistent mass of wedges: that of two nodes at two heights is a product of two numbers.

    areal : (n, n), tonne/mm, `rho int phi_i phi_j dA`.   line : (m, m), mm, `int psi_k psi_l dz`.
    carried : (3, 3), mass matrix of what moves as the pose of the hub.
    """

    areal: sp.csr_array
    line: Array
    carried: Array

    def forces(self, fields: Array) -> Array:
        """Nodal forces (k, n, m, 3), N, of accelerations (k, n, m, 3), mm/s^2, without what the pose carries."""
        found = np.empty_like(fields)
        for force, field in zip(found, fields, strict=True):
            force[:] = self.line @ (self.areal @ field.reshape(len(field), -1)).reshape(field.shape)
        return found

    def loads(self, equations: Solid, motion: Array) -> Array:
        """The mass matrix times accelerations (size, k) of the unknowns."""
        loads = equations.loads(self.forces(equations.fields(motion)))
        loads[-3:] += self.carried @ motion[-3:]
        return loads


class SolidModes(NamedTuple):
    """Natural frequencies (k,), rad/s, rising, and modes of unit modal mass, mm and rad per root of a tonne mm^2.

    shapes : (1, m, k), unknowns of the whole; or (3, m, k), of a sector as it moves in each chain, in its own frame.
    participation : (k, 3), of base motions as the pose of the hub: squares are the effective modal masses.
    total : (3, 3), tonne, tonne mm, tonne mm^2, mass matrix of the whole as one rigid body, the clamped faces too.
    mesh, places : the whole stage, and where the nodes of each chain's sector are in it.
    """

    frequencies: Array
    shapes: Array
    participation: Array
    total: Array
    equations: Solid
    mesh: StageMesh
    places: list[Index]

    @property
    def unknowns(self) -> int:
        """Number of equations that the whole stage has."""
        return len(tie_hub(self.mesh).free) * self.equations.layers.unknowns + 3

    def field(self, number: int) -> Array:
        """Displacements (n, m, 3) of all nodes of `mesh` at all heights in one mode, counted from 0."""
        parts = self.equations.fields(self.shapes[..., number].T)
        return np.asarray(parts[0]) if len(parts) == 1 else whole_fields(len(self.mesh.nodes), self.places, parts)


def solid_modes(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers,
    density: float,
    carried: Array,
    count: int,
    degree: int = STIFFNESS,
) -> SolidModes:
    """The lowest `count` modes in the plane, or out of it where the layers are antisymmetric.

    Parameters
    ----------
    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload for the pose of the hub: x, y, theta, or
        out of the plane z and the rotations about x and y; tonne, tonne mm^2.
    degree : of the quadrature of the stiffness in the plane.

    Raises ComputationFailed as `solid_response`, and as `modes.modes`.
    """
    mesh, places = joined(sectors)
    if len(sectors) == 3:
        return whole_modes(mesh, plate, layers, density, carried, count, degree)
    equations = solid(sectors[0].mesh, plate, layers, tie_sector(sectors[0]), degree)
    own = solid_mass(sectors[0].mesh, layers, density, carried / 3)
    squares, shapes = _of_alike(equations, own, len(sectors[0].ahead), count)
    order = np.argsort(squares)  # all: of a pair of one frequency the one left out is needed to turn the other into x
    found = SolidModes(np.sqrt(squares[order]), shapes[..., order], np.empty((0, 3)), carried, equations, mesh, places)
    return _aligned(found, solid_mass(mesh, layers, density, carried), count)


def whole_modes(
    mesh: StageMesh,
    plate: Plate,
    layers: Layers,
    density: float,
    carried: Array,
    count: int,
    degree: int = STIFFNESS,
) -> SolidModes:
    """As `solid_modes`, of any mesh with a hub."""
    equations, mass = solid(mesh, plate, layers, tie_hub(mesh), degree), solid_mass(mesh, layers, density, carried)
    refuse_unknowns(equations)
    space = Space(equations.size, float, np.asarray, np.asarray, factorise(equations.lower()))
    squares, motion = _ritz(space, equations, mass, count)
    order = np.argsort(squares)
    found = SolidModes(np.sqrt(squares[order]), motion[None, :, order], np.empty((0, 3)), carried, equations, mesh, [])
    return _aligned(found, mass, count)


def solid_mass(mesh: StageMesh, layers: Layers, density: float, carried: Array, degree: int = DEGREE) -> SolidMass:
    """Consistent mass of a mesh of the plane with layers, by default exact on curved triangles."""
    N, number = shape_functions(quadrature(degree)[0])[0], len(mesh.nodes)
    areal = sp.csr_array((number, number))
    for batch in integration(mesh, degree):
        values = density * np.einsum("iq,jq,eq->eij", N, N, batch.weights, optimize=True)
        places = (np.repeat(batch.triangles, 6, axis=1).ravel(), np.tile(batch.triangles, (1, 6)).ravel())
        areal = areal + sp.coo_array((values.ravel(), places), shape=(number, number)).tocsr()
    return SolidMass(areal, (layers.values * layers.weights) @ layers.values.T, carried)


def _of_alike(equations: Solid, mass: SolidMass, cut: int, count: int) -> tuple[Array, Array]:
    """Squared frequencies (k,) of the whole, in no order, and shapes (3, m, k) of a sector whose cuts come last."""
    refuse_unknowns(equations)
    spin = spin_of(equations.layers, cut)
    condensed = condense(equations.lower(), 2 * len(spin) + 3)
    constant, motion = _ritz(harmonic_space(equations, condensed, spin, 0), equations, mass, count)
    turning, pair = _ritz(harmonic_space(equations, condensed, spin, 1), equations, mass, -(-count // 2))
    real, imaginary = np.split(pair * np.sqrt(2 / 3), 2, axis=1)
    shapes = [
        np.concatenate([motion / np.sqrt(3), c * real - s * imaginary, s * real + c * imaginary], axis=1)
        for c, s in ((np.cos(chain * CHAIN_TURN), np.sin(chain * CHAIN_TURN)) for chain in range(3))
    ]
    return np.concatenate([constant, turning, turning]), np.array(shapes)


def _ritz(of: Space, equations: Solid, mass: SolidMass, count: int) -> tuple[Array, Array]:
    """Squared frequencies (k,) and unknowns (m, k), or (m, 2 k) of complex coordinates, of unit modal mass."""

    def inertia(coordinates: AnyArray) -> AnyArray:
        return of.gathered(mass.loads(equations, of.spread(coordinates.reshape(-1, 1))))[:, 0]

    from scipy.sparse.linalg import LinearOperator

    M = LinearOperator((of.size, of.size), matvec=inertia, dtype=of.kind)
    values, shapes = lowest(of.solve, M, count)
    motion = of.spread(shapes)
    fields = equations.fields(motion)
    found = (
        np.einsum("knmd,knmd->k", fields, equations.forces(fields)),
        np.einsum("mk,mk->k", motion, mass.loads(equations, motion)),
    )
    stiff, massive = (np.sum(each.reshape(-1, count), axis=0) for each in found)
    squares = stiff / massive
    check_settled(values, squares)
    return squares, motion / np.sqrt(np.tile(massive, motion.shape[1] // count))


def _aligned(found: SolidModes, mass: SolidMass, count: int) -> SolidModes:
    """The first so many, pairs of one frequency turned into x and y, signs chosen; participation, mass of the whole."""
    layers, carried = found.equations.layers, mass.carried
    rigid = np.moveaxis(rigid_fields(layers, rigid_motion(found.mesh.nodes)), -1, 0)
    base = mass.forces(rigid)
    pushed = np.array([np.einsum("inmd,nmd->i", base, found.field(k)) for k in range(len(found.frequencies))])
    participation = pushed + found.shapes[0, -3:].T @ carried
    turning = np.roll(participation, -1 if layers.fixed else 0, axis=1)  # x and y first
    Q = aligned(found.frequencies**2, turning)
    shapes = found.shapes @ Q
    chosen = signs(shapes.reshape(-1, shapes.shape[-1]))
    total = np.einsum("inmd,jnmd->ij", rigid, base) + carried
    turned = ((Q.T @ participation) * chosen[:, None])[:count]
    return found._replace(
        frequencies=found.frequencies[:count],
        shapes=(shapes * chosen)[..., :count],
        participation=turned,
        total=total,
    )
