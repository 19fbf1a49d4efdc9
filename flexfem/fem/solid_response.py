"""The stage in three dimensions under unit loads in its plane: as `cyclic`, with layers through the thickness.

Of three alike chains one sector is solved, condensed onto its cuts; chains that differ are welded and solved at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from flexfem.arrays import Array, Index
from flexfem.fem.cyclic import CyclicResponse, condense_alike, settle, sums, tie_sector
from flexfem.fem.factor import factorise
from flexfem.fem.layers import Layers
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import resultants, tie_hub
from flexfem.fem.sectors import Sector, joined
from flexfem.fem.solid import DEGREE, Solid, solid
from flexfem.fem.turns import turn_of_points, under_loads
from flexfem.mechanism.designs import chain_rotation
from flexfem.refused import ComputationFailed

MOST_UNKNOWNS = 600_000  # of one factorisation: about 6 GB


@dataclass(frozen=True)
class SolidResponse(CyclicResponse):
    """Answer of the stage to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    As `cyclic.CyclicResponse`, with sector_fields and `fields` (3 loads, n, m, 3), mm: displacement u, v, w of every
    node of the plane at every height of `layers`.
    """

    layers: Layers

    @cached_property
    def fields(self) -> Array:
        """Displacements (3 loads, n, m, 3), mm, of all nodes of `mesh` at all heights."""
        mesh, places = self._welded
        return whole_fields(len(mesh.nodes), places, under_loads(self.sector_fields))


def whole_fields(nodes: int, places: list[Index], parts: Sequence[Array] | Array) -> Array:
    """Vectors (..., nodes, m, 3) of a whole mesh, by those of each chain's sector in its own frame."""
    *before, _, heights, axes = parts[0].shape
    found = np.empty((*before, nodes, heights, axes))
    for chain, (place, part) in enumerate(zip(places, parts, strict=True)):
        found[..., place, :, :] = turned_solid(part, chain)
    return found


def turned_solid(values: Array, chain: int) -> Array:
    """Vectors (..., 3) of the frame of chain 1 turned to a chain, counted from 0; a negative one turns back."""
    return values @ chain_rotation(chain).T


def solid_response(sectors: tuple[Sector, ...], plate: Plate, layers: Layers, degree: int = DEGREE) -> SolidResponse:
    """Solve for unit loads on the rigid hub with the ground held.

    Raises ComputationFailed for more equations than `MOST_UNKNOWNS`, or as `response.platform_response`.
    """
    if len(sectors) == 1:
        return _of_alike(sectors[0], plate, layers, degree)
    mesh, places = joined(sectors)
    equations = solid(mesh, plate, layers, tie_hub(mesh), degree)
    refuse_unknowns(equations)
    factor, load = factorise(equations.lower()), np.pad(np.eye(3), [(equations.size - 3, 0), (0, 0)])

    def response(motion: Array, field: Array, force: Array) -> SolidResponse:
        flat, energy = _in_plane(force), np.einsum("inmd,jnmd->ij", field, force)
        fields = tuple(turned_solid(field[:, place], -chain) for chain, place in enumerate(places))
        reactions = resultants(mesh, flat)
        return SolidResponse(motion[-3:], sectors, fields, reactions, energy, equations.size, layers)

    def step(force: Array | None) -> Array:
        return factor(load if force is None else load - equations.loads(force))

    return settle(step, equations, response, _size(mesh))


def _of_alike(sector: Sector, plate: Plate, layers: Layers, degree: int) -> SolidResponse:
    equations = solid(sector.mesh, plate, layers, tie_sector(sector), degree)
    refuse_unknowns(equations)
    part = condense_alike(equations, spin_of(layers, len(sector.ahead)))

    def response(motion: Array, field: Array, force: Array) -> SolidResponse:
        flat, whole = field.reshape(3, -1, 3), force.reshape(3, -1, 3)
        reactions, energy = sums(sector, flat, whole, _in_plane(force))
        return SolidResponse(motion[-3:], (sector,), (field,), reactions, energy, part.unknowns, layers)

    return settle(part.step, equations, response, _size(sector.mesh))


def spin_of(layers: Layers, nodes: int) -> Array:
    """Matrix that turns the unknowns of so many nodes of the plane by 120 degrees."""
    return np.asarray(block_diag(*[turn_of_points(len(layers.moving)), np.eye(len(layers.lifted))] * nodes))


def _in_plane(force: Array) -> Array:
    """Resultants (k, n, 2) through the thickness of nodal forces (k, n, m, 3), N."""
    return np.asarray(force[..., :2].sum(axis=2))


def _size(mesh: StageMesh) -> float:
    return float(np.max(np.abs(mesh.nodes)))


def refuse_unknowns(equations: Solid) -> None:
    """Raise ComputationFailed for more equations than `MOST_UNKNOWNS`."""
    if equations.size > MOST_UNKNOWNS:
        raise ComputationFailed(
            f"{equations.size:.2g} unknowns in three dimensions, expected at most {MOST_UNKNOWNS:.2g}: "
            "a coarser resolution or fewer layers are needed"
        )
