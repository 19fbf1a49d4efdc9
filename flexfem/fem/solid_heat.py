"""The extruded stage that warms: evenly, by gradients in its plane, and by a gradient through its thickness.

A free body of one metal is left without stress by `T = 1`, `u0 = r`, and by a gradient along a, `T = x_a`,
`u0 = x_a r - e_a r^2 / 2`, r = (x, y, z), per expansion. Its interpolation is taken for what the metal does freely, as
in `heat`; what is solved for is the rest, d = u - u0. On the clamped faces d is what the frame does beyond the metal,
on the hub, which grows and bows as free metal does, it is a rigid motion. All answers are therefore proportional to
the frame's expansion less the metal's. Even changes and gradients in the plane are mirror-symmetric, one through the
thickness is antisymmetric: u = v = 0 on the mid-plane, w is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.cyclic import tie_sector
from flexfem.fem.factor import condense, factorise
from flexfem.fem.harmonics import Space, harmonic_space
from flexfem.fem.layers import Layers
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import BALANCE, MOST_SOLVES, SETTLED, tie_hub
from flexfem.fem.sectors import Sector, joined
from flexfem.fem.solid import Solid, solid
from flexfem.fem.solid_response import refuse_unknowns, spin_of, turned_solid, whole_fields
from flexfem.fem.turns import under_loads
from flexfem.mechanism.designs import chain_rotation
from flexfem.refused import ComputationFailed


class WarmHalf(NamedTuple):
    """Answer to cases of temperature per unit of the frame's expansion beyond the metal's, of one mirror half.

    The cases are a gradient along x and along y, then an even change, or antisymmetric: none, none, a gradient along z.
    Chains turn them as they turn x, y, theta.

    pose : (3, 3 cases), mm and rad per K or K/mm; x, y, theta, or antisymmetric z and the rotations about x and y.
    compliance : (3,), of each of these under its own load; zero where alike chains leave it out.
    work : (3 cases,), N mm, twice the strain energy.
    sector_fields : (3 cases, n, m, 3), mm, of one or three sectors, displacements beyond those of the free metal.
    places : where the nodes of each chain's sector are in `mesh`, the whole stage.
    unknowns : number of equations that the whole stage has.
    """

    pose: Array
    compliance: Array
    work: Array
    sectors: tuple[Sector, ...]
    sector_fields: tuple[Array, ...]
    layers: Layers
    mesh: StageMesh
    places: list[Index]
    unknowns: int

    @property
    def fields(self) -> Array:
        """As `sector_fields`, of all nodes of `mesh`."""
        return whole_fields(len(self.mesh.nodes), self.places, under_loads(self.sector_fields))


def free_solid(points: Array, layers: Layers) -> Array:
    """Displacements (3 cases, n, m, 3), mm, per expansion, of the free metal at points (n, 2), mm, at all heights.

    Cases as of `WarmHalf`.
    """
    x, y, z = np.broadcast_arrays(*points.T[:, :, None], layers.heights)
    r = np.stack([x, y, z], axis=-1)
    along = [r[..., a, None] * r - np.eye(3)[a] * np.sum(r**2, axis=-1, keepdims=True) / 2 for a in range(3)]
    return np.stack([0 * r, 0 * r, along[2]] if layers.fixed else [along[0], along[1], r])


def warm_half(sectors: tuple[Sector, ...], plate: Plate, layers: Layers) -> WarmHalf:
    """Solve for the cases of one half: of the antisymmetric one where the layers are.

    Raises ComputationFailed for more equations than `solid_response.MOST_UNKNOWNS`, or when energy and work differ by
    more than `response.BALANCE`.
    """
    mesh, places = joined(sectors)
    unknowns = len(tie_hub(mesh).free) * layers.unknowns + 3
    if len(sectors) == 1:
        found = _of_alike(sectors[0], plate, layers)
        return WarmHalf(*found[:3], sectors, (found.fields,), layers, mesh, places, unknowns)
    found = warm_whole(mesh, plate, layers)
    parts = tuple(turned_solid(found.fields[:, place], -chain) for chain, place in enumerate(places))
    return WarmHalf(*found[:3], sectors, parts, layers, mesh, places, unknowns)


class Warm(NamedTuple):
    """As of `WarmHalf`, with fields (3 cases, n, m, 3), mm, of a whole mesh or of a sector."""

    pose: Array
    compliance: Array
    work: Array
    fields: Array


def warm_whole(mesh: StageMesh, plate: Plate, layers: Layers) -> Warm:
    """Of any mesh with clamped faces and a hub."""
    equations = solid(mesh, plate, layers, tie_hub(mesh))
    refuse_unknowns(equations)
    space = Space(equations.size, float, np.asarray, np.asarray, factorise(equations.lower()))
    pose, fields, energy = _settled(equations, space, _imposed(mesh, layers))
    return Warm(pose, np.diag(_under_unit_loads(equations, space, np.eye(3))), np.diag(energy), fields)


def _of_alike(sector: Sector, plate: Plate, layers: Layers) -> Warm:
    """Pose, compliance and work of the stage, and fields of one of three alike sectors."""
    equations = solid(sector.mesh, plate, layers, tie_sector(sector))
    refuse_unknowns(equations)
    spin, given = spin_of(layers, len(sector.ahead)), _imposed(sector.mesh, layers)
    condensed = condense(equations.lower(), 2 * len(spin) + 3)
    pose, compliance, work, fields = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros_like(given)
    constant = 0 if layers.fixed else 2
    for harmonic, cases in ((0, [2]),) if layers.fixed else ((0, [2]), (1, [0, 1])):
        space = harmonic_space(equations, condensed, spin, harmonic)
        pose[:, cases], fields[cases], work[np.ix_(cases, cases)] = _settled(equations, space, given[cases])
        directions = cases if harmonic else [constant]
        compliance[:, directions] = _under_unit_loads(equations, space, np.eye(3)[:, directions]) / 3
    turns = [chain_rotation(chain) for chain in range(3)]
    return Warm(pose, np.diag(compliance), np.diag(np.sum([R @ work @ R.T for R in turns], axis=0)), fields)


def _under_unit_loads(equations: Solid, space: Space, loads: Array) -> Array:
    """Pose (3, k) under loads (3, k) on it, not refined."""
    every = np.pad(loads, [(equations.size - 3, 0), (0, 0)])
    return space.spread(space.solve(space.gathered(every)))[-3:]


def _imposed(mesh: StageMesh, layers: Layers) -> Array:
    """Displacements (3 cases, n, m, 3): of the clamped faces as the frame beyond the metal, zero elsewhere."""
    ground = np.unique(mesh.edges["ground"])
    given = np.zeros((3, len(mesh.nodes), len(layers.heights), 3))
    given[:, ground] = free_solid(mesh.nodes[ground], layers)
    return given


def _settled(equations: Solid, space: Space, given: Array) -> tuple[Array, Array, Array]:
    """Pose (3, k), fields (k, n, m, 3) and work (k, k) at rest with `given` (k, n, m, 3) imposed on clamped faces."""
    coordinates: AnyArray = np.zeros((space.size, 1), dtype=space.kind)
    left = space.gathered(equations.loads(equations.forces(given)))
    for _ in range(MOST_SOLVES):
        coordinates = coordinates - space.solve(left)
        motion = space.spread(coordinates)
        fields = given + equations.fields(motion)
        forces = equations.forces(fields)
        left = space.gathered(equations.loads(forces))
        work = np.einsum("inmd,jnmd->ij", fields, forces)
        unbalanced = max(
            float(np.max(np.abs(left)) / np.max(np.abs(forces))),
            float(abs(np.vdot(coordinates, left)) / np.trace(work)),
        )
        if unbalanced <= SETTLED:
            break
    if not unbalanced <= BALANCE:
        raise ComputationFailed(
            f"solution refused: forces, or strain energy and work, of the warm stage differ by {unbalanced:.2g}, "
            f"expected at most {BALANCE:g}"
        )
    return motion[-3:], fields, work
