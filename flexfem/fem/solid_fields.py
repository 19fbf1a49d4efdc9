"""What the fields of a stage in three dimensions say: stress at the nodes, the highest in every neck and where."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.cyclic import CyclicResponse
from flexfem.fem.cyclic_fields import OnSectors, near_necks, solved_sectors
from flexfem.fem.layers import Layers
from flexfem.fem.mesh import NODES, StageMesh, gradients
from flexfem.fem.plane_stress import CACHED, Plate
from flexfem.fem.solid import gathering, solid_lame, solid_stress
from flexfem.fem.solid_response import SolidResponse
from flexfem.mechanism.designs import chain_rotation
from flexfem.mechanism.stage import Stage


class OnLayers(OnSectors, Protocol):
    """As `OnSectors`, with fields (3 cases, n, m, 3) at the heights of layers."""

    @property
    def layers(self) -> Layers:
        """Of half the thickness."""


class NeckStress(NamedTuple):
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, and its distances from the mid-plane, mm."""

    highest: Array
    height: Array


def slopes_at_nodes(layers: Layers) -> Array:
    """Matrix (m, m), 1/mm, from values at the nodes of the line to their slopes there, the mean of two layers'."""
    found, around = np.zeros((len(layers.heights),) * 2), np.zeros(len(layers.heights))
    for layer in range(layers.number):
        at = np.arange(2 * layer, 2 * layer + 3)
        high = layers.heights[at[2]] - layers.heights[at[0]]
        found[np.ix_(at, at)] += np.array([[-3.0, 4.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -4.0, 3.0]]) / high
        around[at] += 1.0
    return np.asarray(found / around[:, None])


def solid_nodal_stress(mesh: StageMesh, plate: Plate, layers: Layers, field: Array, chosen: Index) -> Array:
    """Stress (c, m, 3, 3), MPa, of a field (n, m, 3), mm, at chosen nodes of the plane (c,), at all heights.

    Notes
    -----
    Averaged over the wedges around a node.
    """
    triangles = mesh.triangles[np.isin(mesh.triangles, chosen).any(axis=1)]
    slopes, lame = slopes_at_nodes(layers), solid_lame(plate)
    total = np.zeros((len(mesh.nodes), len(layers.heights) * 9))
    for start in range(0, len(triangles), CACHED):
        part = triangles[start : start + CACHED]
        at, found = field[part], gradients(mesh.nodes[part], NODES)[0]
        across = np.einsum("eimc,eibq->ecbqm", at - at[:, :1], found, optimize=True)
        lifted = np.einsum("eqmc,km->ecqk", at - at[:, :, :1], slopes, optimize=True)
        stress = solid_stress(lame, np.concatenate([across, lifted[:, :, None]], axis=2))
        total += gathering(part, len(total)) @ stress.transpose(0, 3, 4, 1, 2).reshape(part.size, -1)
    around = np.bincount(triangles.ravel(), minlength=len(total))[chosen]
    return np.asarray(total[chosen] / around[:, None]).reshape(len(chosen), -1, 3, 3)


def solid_von_mises(stress: Array) -> Array:
    """Von Mises stress (...), MPa, of stresses (..., 3, 3)."""
    trace = np.trace(stress, axis1=-2, axis2=-1)
    deviator = stress - trace[..., None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1))))


def in_mid_plane(response: SolidResponse) -> CyclicResponse:
    """The displacements u, v of the mid-plane alone, as of a stage in the plane."""
    fields = tuple(field[:, :, 0, :2] for field in response.sector_fields)
    sums = (response.reactions, response.energy, response.unknowns)
    return CyclicResponse(response.compliance, response.sectors, fields, *sums)


def solid_neck_stresses(stage: Stage, plate: Plate, response: OnLayers, loads: Array) -> NeckStress:
    """The highest stress of each notch under loads (k, 3), N, N, N mm: within a notch radius of the neck's centre."""
    highest, height = np.empty((2, len(loads), 3, 3))
    for sector, fields, chains in solved_sectors(response):
        near = near_necks(stage, sector, chains[0])
        chosen = np.flatnonzero(np.any(near, axis=0))
        units = [solid_nodal_stress(sector.mesh, plate, response.layers, field, chosen) for field in fields]
        for chain in chains:
            back = loads @ chain_rotation(chain - chains[0])
            values = solid_von_mises(np.tensordot(back, np.array(units), axes=1))
            for hinge, close in enumerate(near[:, chosen]):
                found = values[:, close].max(axis=1)
                highest[:, chain, hinge] = found.max(axis=1)
                height[:, chain, hinge] = response.layers.heights[found.argmax(axis=1)]
    return NeckStress(highest, height)
