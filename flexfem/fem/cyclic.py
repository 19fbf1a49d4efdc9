"""The answer of the stage to unit loads, sector by sector: of three alike chains by cyclic symmetry, one is solved.

With `b` the displacements of its two cuts and the pose of its hub, and `i` all others,

    S = K_bb - K_bi K_ii^-1 K_ib,    A = sum over the chains of T_c' S T_c,

where `T_c` turns the common unknowns - three cuts and one pose - into the frame of chain 1. Steps of refinement with
residuals from the elements, as in `response.platform_response`, go on until the balances of the whole stage hold far
better than they must. Chains that differ are welded and solved at once: condensing each takes longer, because its
factor must be made a second time once the part that belongs to the boundary has been taken out of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.factor import Condensed, Solve, condense, dense
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import ElementBatch, Plate, integration, internal_forces, matrices_of, tied_lower
from flexfem.fem.response import (
    MOST_SOLVES,
    SETTLED,
    Tied,
    UnitResponse,
    check_balance,
    imbalance,
    platform_response,
    resultants,
    rigid_motion,
)
from flexfem.fem.sectors import Sector, joined, welded
from flexfem.fem.turns import chain_turn, made_alike, turn_of_points, under_loads
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation, turned


@dataclass(frozen=True)
class CyclicResponse:
    """Answer of the stage to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    As `response.Response`; `mesh` and `fields` of the whole stage are made when they are asked for.

    sectors, sector_fields : one or three sectors, and the displacements (3 loads, n, 2), mm, of their nodes; both are
        in the frame of chain 1, the loads in that of the stage.
    unknowns : number of equations that the whole stage would have.
    """

    compliance: Array
    sectors: tuple[Sector, ...]
    sector_fields: tuple[Array, ...]
    reactions: Array
    energy: Array
    unknowns: int

    @property
    def triangles(self) -> int:
        """Number of triangles of the whole stage."""
        return sum(len(sector.mesh.triangles) for sector in self.sectors) * 3 // len(self.sectors)

    @property
    def mesh(self) -> StageMesh:
        """The whole stage."""
        return self._welded[0]

    @cached_property
    def fields(self) -> Array:
        """Displacements (3 loads, n, 2), mm, of all nodes of `mesh`."""
        mesh, places = self._welded
        fields = np.empty((3, *mesh.nodes.shape))
        for chain, (place, field) in enumerate(zip(places, under_loads(self.sector_fields), strict=True)):
            fields[:, place] = turned(field, chain * CHAIN_TURN)
        return fields

    @cached_property
    def _welded(self) -> tuple[StageMesh, list[Index]]:
        return welded(self.sectors)


def cyclic_response(sectors: tuple[Sector, ...], plate: Plate) -> CyclicResponse:
    """Solve for unit loads on the rigid hub with the ground clamped.

    Raises ComputationFailed as `response.platform_response`, whose answer on the welded mesh this is.
    """
    if len(sectors) == 1:
        return _of_alike(sectors[0], plate)
    mesh, places = joined(sectors)
    found = platform_response(mesh, plate)
    fields = (turned(found.fields[:, place], -chain * CHAIN_TURN) for chain, place in enumerate(places))
    return CyclicResponse(found.compliance, sectors, tuple(fields), found.reactions, found.energy, found.unknowns)


class Equations(Protocol):
    """Of a sector whose unknowns are counted inside first, then behind, ahead, and the pose."""

    @property
    def size(self) -> int:
        """Number of unknowns."""

    def fields(self, motion: Array) -> Array:
        """Displacements (k, n, ...) of all nodes from unknowns (size, k)."""

    def forces(self, fields: Array) -> Array:
        """Nodal forces (k, n, ...) that hold displacements."""

    def loads(self, forces: Array) -> Array:
        """Loads (size, k) on the unknowns from nodal forces."""

    def lower(self) -> sp.coo_array:
        """Lower triangle (size, size) of the stiffness."""


class _Sheet(NamedTuple):
    """The equations of a sector in plane stress."""

    sector: Sector
    batches: list[ElementBatch]
    plate: Plate
    tied: Tied

    @property
    def size(self) -> int:
        return 2 * len(self.tied.free) + 3

    def fields(self, motion: Array) -> Array:
        return self.tied.fields(motion)

    def forces(self, fields: Array) -> Array:
        return internal_forces(self.batches, self.plate, fields)

    def loads(self, forces: Array) -> Array:
        return self.tied.loads(forces)

    def lower(self) -> sp.coo_array:
        matrices = matrices_of(self.batches, self.plate)
        return tied_lower(self.sector.mesh.triangles, matrices, self.tied.number, self.tied.rigid)


class Alike(NamedTuple):
    """Three alike chains, of which one is met.

    turns : T_c (2 c + 3, 3 c + 3) of the three chains, c unknowns on every cut.   solve : of A.
    """

    equations: Equations
    condensed: Condensed
    turns: list[Array]
    solve: Solve

    @property
    def unknowns(self) -> int:
        """Number of equations that the whole stage would have."""
        boundary, whole = self.turns[0].shape
        return int(3 * (self.equations.size - boundary) + whole)

    def step(self, force: Array | None) -> Array:
        """What the first sector must still move (size, 3 loads) to answer the loads; without forces, from rest."""
        T = self.turns
        edge, inside = np.pad(np.eye(3), [(T[0].shape[1] - 3, 0), (0, 0)]), np.zeros((self.equations.size, 3))
        if force is not None:
            inside, boundary = self.condensed.reduced(-self.equations.loads(force))
            edge += np.sum([turn.T @ each.T for turn, each in zip(T, under_loads([boundary.T]), strict=True)], axis=0)
        return self.condensed.expanded(inside, T[0] @ made_alike(self.solve(edge)))


def _of_alike(sector: Sector, plate: Plate) -> CyclicResponse:
    sheet = _Sheet(sector, integration(sector.mesh), plate, tie_sector(sector))
    part, size = condense_alike(sheet, turn_of_points(len(sector.ahead))), float(np.max(np.abs(sector.mesh.nodes)))

    def response(motion: Array, field: Array, force: Array) -> CyclicResponse:
        return CyclicResponse(motion[-3:], (sector,), (field,), *sums(sector, field, force, force), part.unknowns)

    return settle(part.step, sheet, response, size)


Answered = TypeVar("Answered", bound=UnitResponse)


def settle(
    step: Callable[[Array | None], Array],
    equations: Equations,
    response: Callable[[Array, Array, Array], Answered],
    size: float,
) -> Answered:
    """Refine the answer to unit loads until its balances hold. Raises ComputationFailed when they do not.

    Parameters
    ----------
    step : what must still move (size, 3) to answer the loads, given nodal forces, or None from rest.
    response : of unknowns (size, 3), fields and nodal forces.   size : mm, makes moments comparable.
    """
    motion = step(None)
    for solves in range(1, MOST_SOLVES + 1):
        field = equations.fields(motion)
        force = equations.forces(field)
        found = response(motion, field, force)
        if solves == MOST_SOLVES or max(imbalance(found, size).values()) <= SETTLED:
            break
        motion = motion + step(force)
    check_balance(found, size)
    return found


def condense_alike(equations: Equations, spin: Array) -> Alike:
    """Condense a sector onto its cuts and the pose; `spin` (c, c) turns the unknowns of a cut by 120 degrees."""
    turns = [chain_turn(spin, chain) for chain in range(3)]
    condensed = condense(equations.lower(), len(turns[0]))
    A = np.sum([T.T @ condensed.schur @ T for T in turns], axis=0)
    return Alike(equations, condensed, turns, dense(A))


def tie_sector(sector: Sector) -> Tied:
    """Unknowns of a sector, those on its cuts and the pose last."""
    nodes, edges = sector.mesh.nodes, sector.mesh.edges
    hub, cuts = np.unique(edges["hub"]), np.concatenate([sector.behind, sector.ahead])
    held = np.zeros(len(nodes), dtype=bool)
    held[hub] = held[cuts] = held[edges["ground"]] = True
    free = np.concatenate([np.flatnonzero(~held), cuts])
    number = np.full(len(nodes), -1)
    number[free], number[hub] = np.arange(len(free)), len(free) + np.arange(len(hub))
    return Tied(number, free, hub, rigid_motion(nodes[hub]))


def sums(sector: Sector, field: Array, force: Array, planar: Array) -> tuple[Array, Array]:
    """Reactions and energy (3, 3) of the whole stage from those of its first sector; `planar` are forces (3, n, 2)."""
    turns = [chain_rotation(chain) for chain in range(3)]
    rows, work = resultants(sector.mesh, planar), np.einsum("ind,jnd->ij", field, force)
    return tuple(np.sum([R @ each @ R.T for R in turns], axis=0) for each in (rows, work))
