"""The stage as a ring of three thirds, each condensed onto its cuts and the platform: the answer to unit loads.

With `b` the displacements of a third's two cuts and the pose of its hub, and `i` all others,

    S = K_bb - K_bi K_ii^-1 K_ib,    A = sum over the chains of T_c' S_c T_c,

where `T_c` turns the ring's unknowns - three cuts and one pose - into the frame of chain 1, in which every third is
drawn. Alike chains are one third met three times. Steps of refinement with residuals from the elements, as in
`response.platform_response`, go on until the balances of the whole stage hold far better than they must: energy and
work then differ by the error of the compliance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.assembly import blocks, lower_triangle
from flexfem.fem.factor import Factor, Solve, dense, factor_of
from flexfem.fem.plane_stress import ElementBatch, Plate, internal_forces
from flexfem.fem.response import (
    BALANCE,
    MOST_SOLVES,
    Response,
    Tied,
    check_balance,
    imbalance,
    resultants,
    rigid_motion,
)
from flexfem.fem.thirds import Third
from flexfem.fem.triangle import whole_batch
from flexfem.stage.frames import CHAIN_TURN

SETTLED = 0.1 * BALANCE  # refined no further


class Ring(NamedTuple):
    """Answer of the stage to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    compliance : (3, 3), mm and rad per N and N mm, as in `response.Response`.
    thirds, fields : one or three thirds, and the displacements (3 loads, n, 2), mm, of their nodes; the fields are in
        the frame of chain 1, as the thirds, the loads in that of the stage.
    unknowns : number of equations that the whole stage would have.
    """

    compliance: Array
    thirds: tuple[Third, ...]
    fields: tuple[Array, ...]
    unknowns: int


class _Condensed(NamedTuple):
    """A third condensed; `tied` counts `inner` degrees of freedom, those behind, those ahead, then the pose.

    factor : of K_ii.   across : K_bi.   schur : S.
    """

    batch: ElementBatch
    tied: Tied
    inner: int
    factor: Factor
    across: sp.csr_array
    schur: Array


def ring_response(thirds: tuple[Third, ...], plate: Plate) -> Ring:
    """Solve for unit loads on the rigid hub with the ground clamped.

    Raises ComputationFailed as `response.platform_response`, whose answer on the welded mesh this is.
    """
    parts = [_condense(third, plate) for third in thirds]
    turns = [_turn(len(thirds[0].ahead), chain) for chain in range(3)]
    A = np.sum([T.T @ part.schur @ T for T, part in zip(turns, _of_chains(parts), strict=True)], axis=0)
    loads, solve = np.pad(np.eye(3), [(len(A) - 3, 0), (0, 0)]), dense(A)
    size = max(float(np.max(np.abs(third.mesh.nodes))) for third in thirds)
    unknowns = sum(part.inner for part in _of_chains(parts)) + len(A)
    motions, forces = [np.zeros((part.inner + len(part.schur), 3)) for part in parts], list[Array]()
    for _ in range(MOST_SOLVES):
        steps = _step(parts, turns, solve, loads, forces)
        motions = [motion + step for motion, step in zip(motions, steps, strict=True)]
        fields = [part.tied.fields(motion) for part, motion in zip(parts, motions, strict=True)]
        forces = [internal_forces([part.batch], plate, field) for part, field in zip(parts, fields, strict=True)]
        ring = Ring(motions[0][-3:], thirds, tuple(fields), unknowns)
        whole = _whole(ring, forces)
        if max(imbalance(whole, size).values()) <= SETTLED:
            break
    check_balance(whole, size)
    return ring


def under_loads(values: Sequence[Array]) -> list[Array]:
    """Values (3 loads, ...) of three chains, each in the frame of chain 1, from those of one or three thirds.

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


def _of_chains(parts: list[_Condensed]) -> list[_Condensed]:
    return parts if len(parts) == 3 else parts * 3


def _condense(third: Third, plate: Plate) -> _Condensed:
    batch, (tied, inner) = whole_batch(third.mesh), _tie(third)
    lower = lower_triangle(blocks([batch], plate, tied.number), len(tied.free) + len(tied.hub))
    rows, columns = lower.coords
    size = lower.shape[0] - inner
    within, edge = rows < inner, columns >= inner
    across = ~within & ~edge
    held = sp.block_diag([sp.eye_array(size - tied.rigid.shape[0]), tied.rigid], format="csr")  # the hub by its pose
    K_bi = held.T @ sp.csr_array((lower.data[across], (rows[across] - inner, columns[across])), shape=(size, inner))
    below = np.zeros((size, size))
    below[rows[edge] - inner, columns[edge] - inner] = lower.data[edge]
    K_bb = held.T @ (below + np.tril(below, -1).T) @ held
    factor = factor_of(sp.coo_array((lower.data[within], (rows[within], columns[within])), shape=(inner, inner)))
    schur = K_bb - factor.squared(K_bi.T.toarray())
    return _Condensed(batch, tied, inner, factor, K_bi, (schur + schur.T) / 2)


def _tie(third: Third) -> tuple[Tied, int]:
    """Unknowns of a third, and how many of them are neither on its cuts nor the pose."""
    nodes, edges = third.mesh.nodes, third.mesh.edges
    hub, cuts = np.unique(edges["hub"]), np.concatenate([third.behind, third.ahead])
    held = np.zeros(len(nodes), dtype=bool)
    held[hub] = held[cuts] = held[edges["ground"]] = True
    free = np.concatenate([np.flatnonzero(~held), cuts])
    number = np.full(len(nodes), -1)
    number[free], number[hub] = np.arange(len(free)), len(free) + np.arange(len(hub))
    return Tied(number, free, hub, rigid_motion(nodes[hub])), 2 * (len(free) - len(cuts))


def _turn(cut: int, chain: int) -> Array:
    """T_c (4 cut + 3, 6 cut + 3), chains from 0; a cut moves in the frame of the chain behind which it is."""
    T = np.zeros((4 * cut + 3, 6 * cut + 3))
    behind, ahead = (2 * cut * ((chain + k) % 3) for k in (0, 1))
    T[: 2 * cut, behind : behind + 2 * cut] = np.eye(2 * cut)
    T[2 * cut : 4 * cut, ahead : ahead + 2 * cut] = np.kron(np.eye(cut), rotation(1)[:2, :2])
    T[-3:, -3:] = rotation(chain).T
    return T


def _step(parts: list[_Condensed], turns: list[Array], solve: Solve, loads: Array, forces: list[Array]) -> list[Array]:
    """What the thirds must still move, (unknowns, 3 loads) each, to answer the loads; no forces: from rest."""
    inners, edge = [np.zeros((part.inner, 3)) for part in parts], loads
    if forces:
        residuals = [-part.tied.loads(force) for part, force in zip(parts, forces, strict=True)]
        inners = [part.factor.solve(residual[: part.inner]) for part, residual in zip(parts, residuals, strict=True)]
        left = [r[p.inner :] - p.across @ inner for p, r, inner in zip(parts, residuals, inners, strict=True)]
        chains = under_loads([each.T for each in left])
        edge = loads + np.sum([T.T @ each.T for T, each in zip(turns, chains, strict=True)], axis=0)
    edge = solve(edge) if len(parts) == 3 else _alike(solve(edge))
    steps = []
    for part, T, inner in zip(parts, turns, inners, strict=False):  # one third, or three
        moved = T @ edge
        steps.append(np.concatenate([inner - part.factor.solve(part.across.T @ moved), moved]))
    return steps


def _alike(edge: Array) -> Array:
    """The ring's unknowns (6 cut + 3, 3 loads) made those of alike chains, so that round-off opens no cut.

    Only the first third is met, which must move its cut ahead as the next chain does the cut behind it.
    """
    cuts, pose = edge[:-3].reshape(3, -1, 3), edge[-3:]
    turns = [rotation(chain) for chain in range(3)]
    first = np.mean([cut @ turn for cut, turn in zip(cuts, turns, strict=True)], axis=0)
    pose = np.mean([turn.T @ pose @ turn for turn in turns], axis=0)
    return np.concatenate([*(first @ turn.T for turn in turns), pose])


def _whole(ring: Ring, forces: list[Array]) -> Response:
    """The answer of the whole stage, with the field of chain 1 alone, from what its chains say."""
    rows = under_loads([resultants(third.mesh, force) for third, force in zip(ring.thirds, forces, strict=True)])
    reactions = np.sum([row @ rotation(chain).T for chain, row in enumerate(rows)], axis=0)
    works = [np.einsum("ind,jnd->ij", field, force) for field, force in zip(ring.fields, forces, strict=True)]
    if len(works) == 1:
        works = [rotation(chain) @ works[0] @ rotation(chain).T for chain in range(3)]
    return Response(ring.compliance, ring.fields[0], reactions, np.sum(works, axis=0), ring.unknowns)
