"""What the fields of sectors say: neck stresses, rotations of the base hinges, the envelope."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.cyclic import CyclicResponse
from flexfem.fem.mesh import NODES, gradients
from flexfem.fem.plane_stress import Plate, stress_tensor, von_mises
from flexfem.fem.response import out_of_plane_ratio_of, plate_of
from flexfem.fem.sectors import Sector
from flexfem.fem.turns import under_loads
from flexfem.mechanism.bodies import BODIES, necks
from flexfem.mechanism.designs import chain_rotation
from flexfem.mechanism.stage import HINGE_NAMES, Stage

BESIDE = (1.0, 2.0)  # distances from a base hinge, per radius, between which its two bodies are taken for rigid


class OnSectors(Protocol):
    """An answer whose cases chains turn as they turn x, y, theta."""

    @property
    def sectors(self) -> tuple[Sector, ...]:
        """One sector, or three."""

    @property
    def sector_fields(self) -> tuple[Array, ...]:
        """Displacements (3 cases, n, ...) of their nodes, as of `cyclic.CyclicResponse`."""


def neck_stresses(stage: Stage, response: CyclicResponse, loads: Array) -> Array:
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, in each notch under loads (k, 3), N, N, N mm.

    Notes
    -----
    As `response.load_case`: averaged over the triangles around a node, the largest within a notch radius of the neck.
    """
    found, pull = np.empty((len(loads), 3, 3)), out_of_plane_ratio_of(stage)
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        found[:, chain, hinge] = np.max(von_mises(stress, pull), axis=1)
    return found


def notch_fields(stage: Stage, response: CyclicResponse, loads: Array) -> Iterator[tuple[tuple[int, int], Array]]:
    """Chain and hinge of every notch, from 0, and stress (k, c, 3), MPa, as xx, yy, xy at its nodes under loads (k, 3).

    The axes are those of the first chain that the notch's sector stands for.
    """
    plate = plate_of(stage)
    for sector, field, chains in solved_sectors(response):
        near = near_necks(stage, sector, chains[0])
        chosen = np.flatnonzero(np.any(near, axis=0))
        near, stress = near[:, chosen], _stress_at(sector, plate, field, chosen)
        for chain in chains:
            turned_back = loads @ chain_rotation(chain - chains[0])
            for hinge, close in enumerate(near):
                yield (chain, hinge), np.tensordot(turned_back, stress[:, close], axes=1)


def base_rotations(stage: Stage, response: CyclicResponse) -> Array:
    """Rotation (3 loads, 3 chains), rad, of link 1 against the pad, of every base hinge under unit loads.

    Notes
    -----
    The rotation of a body is that of the rigid motion that fits the displacements of its nodes between one and two
    notch radii from the neck's centre best, by least squares: beside the notch and not in it.
    """
    rows = [
        _base_rotation(stage, sector, field, chains[0])[:, None] for sector, field, chains in solved_sectors(response)
    ]
    return np.concatenate(under_loads(rows), axis=1)


def envelope(response: CyclicResponse) -> float:
    """Diameter, mm, of the circle about the platform's centre that holds the stage."""
    return 2 * max(float(np.max(np.hypot(*sector.mesh.nodes.T))) for sector in response.sectors)


def solved_sectors(response: OnSectors) -> Iterator[tuple[Sector, Array, tuple[int, ...]]]:
    """Every sector with its fields and the chains, from 0, that it stands for."""
    if len(response.sectors) == 1:
        yield response.sectors[0], response.sector_fields[0], (0, 1, 2)
        return
    for chain, (sector, field) in enumerate(zip(response.sectors, response.sector_fields, strict=True)):
        yield sector, field, (chain,)


def near_necks(stage: Stage, sector: Sector, chain: int) -> AnyArray:
    """Which nodes are within a notch radius of each neck's centre, bool (3 hinges, n)."""
    x, y = sector.mesh.nodes.T
    places = zip(necks(stage, chain + 1), HINGE_NAMES, strict=True)
    return np.array(
        [np.hypot(x - p.point.real, y - p.point.imag) <= stage.hinge(chain + 1, name).radius for p, name in places]
    )


def _stress_at(sector: Sector, plate: Plate, fields: Array, chosen: Index) -> Array:
    """Stress (3 loads, c, 3), MPa, as xx, yy, xy at chosen nodes (c,), averaged over the triangles around each."""
    mesh, n = sector.mesh, len(sector.mesh.nodes)
    triangles = mesh.triangles[np.isin(mesh.triangles, chosen).any(axis=1)]
    gradient, _ = gradients(mesh.nodes[triangles], NODES)
    relative = fields[:, triangles] - fields[:, triangles[:, :1]]
    slopes = relative.transpose(0, 1, 3, 2) @ gradient.reshape(1, len(triangles), 6, 12)
    stress = stress_tensor(plate, slopes.reshape(*slopes.shape[:3], 2, 6))
    around, found = np.bincount(triangles.ravel(), minlength=n)[chosen], np.empty((len(fields), len(chosen), 3))
    for place, (row, column) in enumerate([(0, 0), (1, 1), (0, 1)]):
        for load, part in enumerate(stress[:, :, row, column]):
            found[load, :, place] = np.bincount(triangles.ravel(), part.ravel(), n)[chosen] / around
    return found


def _base_rotation(stage: Stage, sector: Sector, fields: Array, chain: int) -> Array:
    """Rotation (3 loads,) at the base hinge of one sector."""
    mesh, place, hinge = sector.mesh, necks(stage, chain + 1)[0].point, stage.hinge(chain + 1, "base")
    distance = np.hypot(*(mesh.nodes - [place.real, place.imag]).T) / hinge.radius
    beside = (distance >= BESIDE[0]) & (distance <= BESIDE[1])
    turns = []
    for body in ("pad", "link 1"):
        of_body = np.unique(mesh.triangles[mesh.bodies == BODIES.index(body)])
        chosen = of_body[beside[of_body]]
        arm = mesh.nodes[chosen] - mesh.nodes[chosen].mean(axis=0)
        turns.append((fields[:, chosen, 1] @ arm[:, 0] - fields[:, chosen, 0] @ arm[:, 1]) / np.sum(arm**2))
    return np.asarray(turns[1] - turns[0])
