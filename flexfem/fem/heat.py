"""A structure that warms on a frame that carries its pads, in the plane or extruded.

The stress is `D (e(u) - e0)` with the free thermal strain e0. Temperatures linear in space leave a free body of one
material without stress: `T = 1` with `u0 = r`, and `T = x_a` with `u0 = x_a r - e_a r^2 / 2`, per expansion. Solved for
is `d = u - u0`, which the clamped edges impose, moving as the frame does and not as the material would: as a difference
it would lose its digits where both expand nearly alike. On the hub, which grows and bows as free material does, d is a
rigid motion. So all answers are proportional to the frame's expansion less the material's. A gradient through the
thickness is antisymmetric: u = v = 0 on the mid-plane, w is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import Layers, Plate, nodal_stress
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import Sector, StageMesh
from flexfem.fem.response import Response, StaticSolution, settle, unit_response
from flexfem.fem.structure import Structure, structure


class HeatResponse(NamedTuple):
    """Answer of a plane structure to one kelvin, and to one kelvin per mm along x and along y: three cases.

    pose : (3, 3 cases), mm and rad.   fields : (3 cases, n, 2), mm.   stress : (3 cases, n, 2, 2), MPa, at the nodes.
    reactions : (3 cases, 3 chains, 3), N and N mm, of the ground on each pad about the platform's centre.
    """

    pose: Array
    fields: Array
    stress: Array
    reactions: Array


def heat_response(mesh: StageMesh, plate: Plate, stage_expansion: float, frame_expansion: float) -> HeatResponse:
    """Solve for the three cases; the expansions, 1/K, are those in the plane. Raises ComputationFailed as `settle`."""
    found, order = warm_whole(mesh, plate), [2, 0, 1]
    beyond = frame_expansion - stage_expansion
    elastic = beyond * found.fields[order]
    fields = elastic + stage_expansion * free_displacement(mesh.nodes)[order]
    stress = nodal_stress(mesh, plate, elastic)
    return HeatResponse(beyond * found.compliance[:, order], fields, stress, beyond * found.pads[order])


def free_displacement(points: Array, layers: Layers | None = None) -> Array:
    """Displacements (3 cases as of `warm_half`, n, 2) or (3, n, m, 3), mm, per expansion, of free points (n, 2), mm."""
    r = points if layers is None else np.stack(np.broadcast_arrays(*points.T[:, :, None], layers.heights), axis=-1)
    axes = r.shape[-1]
    along = [r[..., a, None] * r - np.eye(axes)[a] * np.sum(r**2, axis=-1, keepdims=True) / 2 for a in range(axes)]
    return np.stack([0 * r, 0 * r, along[2]] if layers and layers.fixed else [along[0], along[1], r])


def warm_half(sectors: tuple[Sector, ...], plate: Plate, layers: Layers | None = None) -> Response:
    """Solve for the cases of one mirror half per unit of the frame's expansion beyond the material's.

    The cases are a gradient along x and along y, then an even change; with antisymmetric layers none, none, a gradient
    along z, the pose being z and the rotations about x and y. Displacements are those beyond free material's.

    Raises ComputationFailed as `settle` and `Structure.lower`.
    """
    return unit_response(sectors, plate, layers, imposed=_imposed)


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
