"""A structure that warms on a frame that carries its pads, in the plane or extruded.

The stress is `D (e(u) - e0)` with the free thermal strain e0. Temperatures linear in space leave a free body of one
material without stress: `T = 1` with `u0 = r`, and `T = x_a` with `u0 = x_a r - e_a r^2 / 2`, per expansion, r = (x, y)
in plane stress and (x, y, z) in three dimensions. The strain of their interpolation is taken for e0, so that this is so
in curved elements too. What is solved for is `d = u - u0`, which the clamped edges impose, moving as the frame does and
not as the material would: formed as a difference it would lose its digits where both expand nearly alike. On the hub,
which grows and bows as free material does, d is a rigid motion. All answers are therefore proportional to the frame's
expansion less the material's. Even changes and gradients in the plane are mirror-symmetric, one through the thickness
is antisymmetric: u = v = 0 on the mid-plane, w is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Layers, Plate, nodal_stress
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import Sector, StageMesh, joined
from flexfem.fem.response import StaticSolution, settle
from flexfem.fem.structure import Structure, structure
from flexfem.fem.symmetry import cyclic, turned_fields, under_loads, whole_fields


class HeatResponse(NamedTuple):
    """Answer of a plane structure to one kelvin, and to one kelvin per mm along x and along y: three cases.

    pose : (3, 3 cases), mm and rad.   fields : (3 cases, n, 2), mm, displacement of every node.
    stress : (3 cases, n, 3), MPa, as xx, yy, xy at the nodes.
    reactions : (3 cases, 3 chains, 3), N and N mm, of the ground on each pad about the platform's centre.
    """

    pose: Array
    fields: Array
    stress: Array
    reactions: Array


def heat_response(mesh: StageMesh, plate: Plate, stage_expansion: float, frame_expansion: float) -> HeatResponse:
    """Solve for the three cases; the expansions, 1/K, are those in the plane.

    Raises ComputationFailed as `response.settle`.
    """
    found, order = warm_whole(mesh, plate), [2, 0, 1]
    beyond = frame_expansion - stage_expansion
    elastic = beyond * found.fields[order]
    fields = elastic + stage_expansion * free_displacement(mesh.nodes)[order]
    stress = nodal_stress(mesh, plate, elastic)
    return HeatResponse(beyond * found.compliance[:, order], fields, stress, beyond * found.pads[order])


class WarmHalf(NamedTuple):
    """Answer to cases of temperature per unit of the frame's expansion beyond the material's, of one mirror half.

    The cases are a gradient along x and along y, then an even change, or antisymmetric: none, none, a gradient along z.
    Chains turn them as they turn x, y, theta.

    pose : (3, 3 cases), mm and rad per K or K/mm; x, y, theta, or antisymmetric z and the rotations about x and y.
    work : (3 cases,), N mm, twice the strain energy.
    sector_fields : (3 cases, n, m, 3), mm, of one or three sectors, displacements beyond those of the free material.
    places : where the nodes of each chain's sector are in `mesh`, the whole stage.
    unknowns : number of equations that the whole stage has.
    """

    pose: Array
    work: Array
    sectors: tuple[Sector, ...]
    sector_fields: tuple[Array, ...]
    extrusion: Layers | None
    mesh: StageMesh
    places: list[Index]
    unknowns: int

    @property
    def layers(self) -> Layers:
        """Of an extruded stage."""
        assert self.extrusion is not None
        return self.extrusion

    @property
    def fields(self) -> Array:
        """As `sector_fields`, of all nodes of `mesh`."""
        return whole_fields(len(self.mesh.nodes), self.places, under_loads(self.sector_fields))


def free_displacement(points: Array, layers: Layers | None = None) -> Array:
    """Displacements (3 cases, n, 2), or (3, n, m, 3), mm, per expansion, of free material at points (n, 2), mm.

    Cases as of `WarmHalf`.
    """
    r = points if layers is None else np.stack(np.broadcast_arrays(*points.T[:, :, None], layers.heights), axis=-1)
    axes = r.shape[-1]
    along = [r[..., a, None] * r - np.eye(axes)[a] * np.sum(r**2, axis=-1, keepdims=True) / 2 for a in range(axes)]
    return np.stack([0 * r, 0 * r, along[2]] if layers and layers.fixed else [along[0], along[1], r])


def warm_half(sectors: tuple[Sector, ...], plate: Plate, layers: Layers | None = None) -> WarmHalf:
    """Solve for the cases of one half: of the antisymmetric one where the layers are.

    Raises ComputationFailed as `response.settle` and `Structure.lower`.
    """
    mesh, places = joined(sectors)
    if len(sectors) == 1:
        one = cyclic(sectors[0], plate, layers)
        found = settle(one.sector, one.solve, np.zeros((one.sector.size, 3)), _imposed(one.sector), alike=True)
        fields: tuple[Array, ...] = (found.fields,)
        unknowns = one.unknowns
    else:
        found = warm_whole(mesh, plate, layers)
        fields = tuple(turned_fields(found.fields[:, place], -chain) for chain, place in enumerate(places))
        unknowns = found.unknowns
    return WarmHalf(found.compliance, np.diag(found.energy), sectors, fields, layers, mesh, places, unknowns)


def warm_whole(mesh: StageMesh, plate: Plate, layers: Layers | None = None) -> StaticSolution:
    """As `warm_half`, of any mesh with clamped faces and a hub."""
    of = structure(mesh, plate, layers)
    return settle(of, factorise(of.lower()), np.zeros((of.size, 3)), _imposed(of))


def _imposed(of: Structure) -> Array:
    """Displacements (3 cases, n, ...): of the clamped faces as the frame beyond the material, zero elsewhere."""
    ground = np.unique(of.mesh.edges["ground"])
    given = np.zeros((3, len(of.mesh.nodes), *of.shape))
    given[:, ground] = free_displacement(of.mesh.nodes[ground], of.layers)
    return given
