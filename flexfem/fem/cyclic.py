"""The stage by cyclic symmetry and static condensation: the answer to unit loads, sector by sector.

With `b` the displacements of a sector's two cuts and the pose of its hub, and `i` all others,

    S = K_bb - K_bi K_ii^-1 K_ib,    A = sum over the chains of T_c' S_c T_c,

where `T_c` turns the common unknowns - three cuts and one pose - into the frame of chain 1, in which every sector is
drawn. Of alike chains one sector is condensed and met three times. Steps of refinement with residuals from the
elements, as in `response.platform_response`, go on until the balances of the whole stage hold far better than they
must: energy and work then differ by the error of the compliance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.assembly import matrices_of, tied_lower
from flexfem.fem.condensation import Condensed, condense
from flexfem.fem.factor import Solve, dense
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import ElementBatch, Plate, integration, internal_forces
from flexfem.fem.response import (
    BALANCE,
    MOST_SOLVES,
    Tied,
    check_balance,
    imbalance,
    resultants,
    rigid_motion,
)
from flexfem.fem.sectors import Sector, welded
from flexfem.stage.designs import CHAIN_TURN, turned

SETTLED = 0.1 * BALANCE  # refined no further


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


class _Part(NamedTuple):
    """A sector; `tied` counts the unknowns inside, those behind, those ahead, then the pose."""

    batches: list[ElementBatch]
    tied: Tied
    condensed: Condensed

    @property
    def boundary(self) -> int:
        """Unknowns on the cuts, and the pose."""
        return len(self.condensed.schur)

    @property
    def inner(self) -> int:
        """All other unknowns."""
        return 2 * len(self.tied.free) + 3 - self.boundary


def cyclic_response(sectors: tuple[Sector, ...], plate: Plate) -> CyclicResponse:
    """Solve for unit loads on the rigid hub with the ground clamped.

    Raises ComputationFailed as `response.platform_response`, whose answer on the welded mesh this is.
    """
    parts = [_condensed(sector, plate) for sector in sectors]
    turns = [_turn(len(sectors[0].ahead), chain) for chain in range(3)]
    A = np.sum([T.T @ part.condensed.schur @ T for T, part in zip(turns, _of_chains(parts), strict=True)], axis=0)
    loads, solve = np.pad(np.eye(3), [(len(A) - 3, 0), (0, 0)]), dense(A)
    size = max(float(np.max(np.abs(sector.mesh.nodes))) for sector in sectors)
    unknowns = sum(part.inner for part in _of_chains(parts)) + len(A)
    motions, forces = [np.zeros((part.inner + part.boundary, 3)) for part in parts], list[Array]()
    for _ in range(MOST_SOLVES):
        steps = _step(parts, turns, solve, loads, forces)
        motions = [motion + step for motion, step in zip(motions, steps, strict=True)]
        fields = [part.tied.fields(motion) for part, motion in zip(parts, motions, strict=True)]
        forces = [internal_forces(part.batches, plate, field) for part, field in zip(parts, fields, strict=True)]
        sums = _sums(sectors, fields, forces)
        response = CyclicResponse(motions[0][-3:], sectors, tuple(fields), *sums, unknowns)
        if max(imbalance(response, size).values()) <= SETTLED:
            break
    check_balance(response, size)
    return response


def under_loads(values: Sequence[Array]) -> list[Array]:
    """Values (3 loads, ...) of three chains, each in the frame of chain 1, from those of one or three sectors.

    Notes
    -----
    Chain c of three alike answers a load as chain 1 does the load turned back by c turns.
    """
    if len(values) == 3:
        return list(values)
    return [np.tensordot(rotation(chain), values[0], axes=1) for chain in range(3)]


def rotation(chain: int) -> Array:
    """Matrix (3, 3) that turns x, y, theta from the frame of chain 1 into its place, chains from 0."""
    c, s = np.cos(chain * CHAIN_TURN), np.sin(chain * CHAIN_TURN)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _of_chains(parts: list[_Part]) -> list[_Part]:
    return parts if len(parts) == 3 else parts * 3


def _condensed(sector: Sector, plate: Plate) -> _Part:
    batches, tied = integration(sector.mesh), _tie(sector)
    lower = tied_lower(sector.mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid)
    return _Part(batches, tied, condense(lower, 2 * (len(sector.behind) + len(sector.ahead)) + 3))


def _tie(sector: Sector) -> Tied:
    """Unknowns of a sector, those on its cuts and the pose last."""
    nodes, edges = sector.mesh.nodes, sector.mesh.edges
    hub, cuts = np.unique(edges["hub"]), np.concatenate([sector.behind, sector.ahead])
    held = np.zeros(len(nodes), dtype=bool)
    held[hub] = held[cuts] = held[edges["ground"]] = True
    free = np.concatenate([np.flatnonzero(~held), cuts])
    number = np.full(len(nodes), -1)
    number[free], number[hub] = np.arange(len(free)), len(free) + np.arange(len(hub))
    return Tied(number, free, hub, rigid_motion(nodes[hub]))


def _turn(cut: int, chain: int) -> Array:
    """T_c (4 cut + 3, 6 cut + 3), chains from 0; a cut moves in the frame of the chain behind which it is."""
    T = np.zeros((4 * cut + 3, 6 * cut + 3))
    behind, ahead = (2 * cut * ((chain + k) % 3) for k in (0, 1))
    T[: 2 * cut, behind : behind + 2 * cut] = np.eye(2 * cut)
    T[2 * cut : 4 * cut, ahead : ahead + 2 * cut] = np.kron(np.eye(cut), rotation(1)[:2, :2])
    T[-3:, -3:] = rotation(chain).T
    return T


def _step(parts: list[_Part], turns: list[Array], solve: Solve, loads: Array, forces: list[Array]) -> list[Array]:
    """What the sectors must still move, (unknowns, 3 loads) each, to answer the loads; no forces: from rest."""
    left, edge = [np.zeros((part.inner + part.boundary, 3)) for part in parts], loads
    if forces:
        residuals = [-part.tied.loads(force) for part, force in zip(parts, forces, strict=True)]
        reduced = [part.condensed.reduced(residual) for part, residual in zip(parts, residuals, strict=True)]
        left = [inside for inside, _ in reduced]
        chains = under_loads([boundary.T for _, boundary in reduced])
        edge = loads + np.sum([T.T @ each.T for T, each in zip(turns, chains, strict=True)], axis=0)
    edge = solve(edge) if len(parts) == 3 else _alike(solve(edge))
    return [
        part.condensed.expanded(inside, T @ edge)
        for part, T, inside in zip(parts, turns, left, strict=False)  # one sector, or three
    ]


def _alike(edge: Array) -> Array:
    """The response's unknowns (6 cut + 3, 3 loads) made those of alike chains, so that round-off opens no cut.

    Only the first sector is met, which must move its cut ahead as the next chain does the cut behind it.
    """
    cuts, pose = edge[:-3].reshape(3, -1, 3), edge[-3:]
    turns = [rotation(chain) for chain in range(3)]
    first = np.mean([cut @ turn for cut, turn in zip(cuts, turns, strict=True)], axis=0)
    pose = np.mean([turn.T @ pose @ turn for turn in turns], axis=0)
    return np.concatenate([*(first @ turn.T for turn in turns), pose])


def _sums(sectors: tuple[Sector, ...], fields: list[Array], forces: list[Array]) -> tuple[Array, Array]:
    """Reactions and energy (3, 3) of the whole stage from what its sectors say."""
    rows = under_loads([resultants(sector.mesh, force) for sector, force in zip(sectors, forces, strict=True)])
    reactions = np.sum([row @ rotation(chain).T for chain, row in enumerate(rows)], axis=0)
    works = [np.einsum("ind,jnd->ij", field, force) for field, force in zip(fields, forces, strict=True)]
    if len(works) == 1:
        works = [rotation(chain) @ works[0] @ rotation(chain).T for chain in range(3)]
    return reactions, np.sum(works, axis=0)
