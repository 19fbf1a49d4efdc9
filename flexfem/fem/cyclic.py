"""The answer of the stage to unit loads, sector by sector: of three alike chains by cyclic symmetry, one is solved.

With `b` the displacements of its two cuts and the pose of its hub, and `i` all others,

    S = K_bb - K_bi K_ii^-1 K_ib,    A = sum over the chains of T_c' S T_c,

where `T_c` turns the common unknowns - three cuts and one pose - into the frame of chain 1. Steps of refinement with
residuals from the elements, as in `response.platform_response`, go on until the balances of the whole stage hold far
better than they must. Chains that differ are welded and solved at once: condensing each takes longer, because its
factor must be made a second time once the part that belongs to the boundary has been taken out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.factor import Condensed, Solve, condense, dense
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import ElementBatch, Plate, integration, internal_forces, matrices_of, tied_lower
from flexfem.fem.response import (
    MOST_SOLVES,
    SETTLED,
    Tied,
    check_balance,
    imbalance,
    platform_response,
    resultants,
    rigid_motion,
)
from flexfem.fem.sectors import Sector, joined, welded
from flexfem.stage.designs import CHAIN_TURN, turned


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


class _Condensed(NamedTuple):
    """A sector whose unknowns are counted inside first, then behind, ahead, and the pose.

    turns : T_c (4 cut + 3, 6 cut + 3) of the three chains.   solve : of A.
    """

    batches: list[ElementBatch]
    tied: Tied
    condensed: Condensed
    turns: list[Array]
    solve: Solve


def _of_alike(sector: Sector, plate: Plate) -> CyclicResponse:
    part = _condense(sector, plate)
    size, boundary = float(np.max(np.abs(sector.mesh.nodes))), part.turns[0].shape[0]
    unknowns = 3 * (2 * len(part.tied.free) + 3 - boundary) + part.turns[0].shape[1]
    motion, force = _step(part, None), np.empty(0)
    for _ in range(MOST_SOLVES):
        field = part.tied.fields(motion)
        force = internal_forces(part.batches, plate, field)
        response = CyclicResponse(motion[-3:], (sector,), (field,), *_sums(sector, field, force), unknowns)
        if max(imbalance(response, size).values()) <= SETTLED:
            break
        motion = motion + _step(part, force)
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


def _condense(sector: Sector, plate: Plate) -> _Condensed:
    batches, tied, cut = integration(sector.mesh), _tie(sector), len(sector.ahead)
    condensed = condense(
        tied_lower(sector.mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid), 4 * cut + 3
    )
    turns = [_turn(cut, chain) for chain in range(3)]
    A = np.sum([T.T @ condensed.schur @ T for T in turns], axis=0)
    return _Condensed(batches, tied, condensed, turns, dense(A))


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


def _step(part: _Condensed, force: Array | None) -> Array:
    """What the first sector must still move (unknowns, 3 loads) to answer the loads; without forces, from rest."""
    T, unknowns = part.turns, 2 * len(part.tied.free) + 3
    edge, inside = np.pad(np.eye(3), [(T[0].shape[1] - 3, 0), (0, 0)]), np.zeros((unknowns, 3))
    if force is not None:
        inside, boundary = part.condensed.reduced(-part.tied.loads(force))
        edge += np.sum([turn.T @ each.T for turn, each in zip(T, under_loads([boundary.T]), strict=True)], axis=0)
    return part.condensed.expanded(inside, T[0] @ _alike(part.solve(edge)))


def _alike(edge: Array) -> Array:
    """The response's unknowns (6 cut + 3, 3 loads) made those of alike chains, so that round-off opens no cut.

    Only the first sector is met, which must move its cut ahead as the next chain does the cut behind it.
    """
    cuts, pose = edge[:-3].reshape(3, -1, 3), edge[-3:]
    turns = [rotation(chain) for chain in range(3)]
    first = np.mean([cut @ turn for cut, turn in zip(cuts, turns, strict=True)], axis=0)
    pose = np.mean([turn.T @ pose @ turn for turn in turns], axis=0)
    return np.concatenate([*(first @ turn.T for turn in turns), pose])


def _sums(sector: Sector, field: Array, force: Array) -> tuple[Array, Array]:
    """Reactions and energy (3, 3) of the whole stage from those of its first sector."""
    turns = [rotation(chain) for chain in range(3)]
    rows, work = resultants(sector.mesh, force), np.einsum("ind,jnd->ij", field, force)
    return tuple(np.sum([R @ each @ R.T for R in turns], axis=0) for each in (rows, work))
