"""Finite elements of the driven stage with its stacks pushing: large displacements, forces that go with their bodies.

Of a link that a stack pushes or stands on, the displacement and rotation are read over its station, with the weights of
`drive.push_forces`; of the platform, those of the hub. From them follows the opening g of the stack with its first and
second derivatives. Constant forces N have the potential `-N g`; what it adds to the sparse tangent is of low rank, and
is dense algebra beside its factor.

As a link turns by theta, its points come nearer to the middle of the station by theta^2/2 of their distance. Weights f
read that as `-v theta^2/2`, v = sum f r, as if the link had moved; it is taken out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from flexfem.arrays import Array
from flexfem.fem.drive import push_forces
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, slopes_of, stress_tensor
from flexfem.fem.tangent import (
    State,
    Undeformed,
    factoriser,
    green_lagrange,
    held_by,
    hub_at,
    model_of,
    rest,
    tangent,
)
from flexfem.mechanism.contacts import Follows, Push, Stack, middle_at
from flexfem.mechanism.designs import chain_rotation
from flexfem.refused import ComputationFailed

ITERATIONS = 25
CONVERGED = 1e-9  # root of energy of a Newton step, over that stored and that of every force alone


class Preloaded(NamedTuple):
    """Equilibrium with forces of the stacks and a load on the hub.

    pose : (3,), mm and rad.   compliance : (3 + n, 3 + n), tangent, of the platform and of the openings of the stacks
    at constant forces, as in `drive.DrivenResponse`.
    """

    pose: Array
    compliance: Array


class _End(NamedTuple):
    """One body of a stack, frame of chain 1: reference point, mm, complex, nodal loads (3, unknowns) that read x, y and
    turn there, and what v (3,) they read of its turning, mm and one."""

    middle: complex
    reads: Array
    v: Array


def preloaded(
    mesh: StageMesh, plate: Plate, stacks: tuple[Stack, ...], force: Array, load: Array, follows: Follows
) -> Preloaded:
    """Equilibrium under forces (n,) of the stacks, N, and a dead load (3,); what pushes go with: `Stack.pivot`.

    Raises ComputationFailed when Newton's method does not converge.
    """
    model, factorise = model_of(mesh, plate), factoriser()
    ends = [tuple(_end(model, mesh, stack.chain, push) for push in stack.pushes) for stack in stacks]
    reads = np.concatenate([end.reads for pair in ends for end in pair]).T
    hub = np.zeros((len(reads), 3))
    hub[-3:] = np.eye(3)
    state, motion = rest(model), np.zeros(len(reads))
    for _ in range(ITERATIONS):
        g, H = _openings(stacks, ends, reads.T @ motion, follows)
        held, columns = held_by(model, state), np.column_stack([hub, reads])
        missing = hub @ load + reads @ (g @ force) - held.forces
        Z = factorise(tangent(model, state)).solve(np.column_stack([missing, columns]))
        Q = -block_diag(*(N * each for N, each in zip(force, H, strict=True)))
        into = np.linalg.solve(np.eye(len(Q)) + Q @ (reads.T @ Z[:, 4:]), Q @ (reads.T @ Z))
        Z = Z - Z[:, 4:] @ into
        ports = np.column_stack([hub, reads @ g])
        C = ports.T @ Z[:, 1:] @ block_diag(np.eye(3), g)
        if abs(Z[:, 0] @ missing) <= CONVERGED**2 * (held.energy + force**2 @ np.abs(np.diag(C)[3:])):
            return Preloaded(state.pose + Z[-3:, 0], (C + C.T) / 2)
        motion = motion + Z[:, 0]
        state = _state(model, motion)
    raise ComputationFailed("no equilibrium with these forces of the stacks: Newton's method does not converge")


def _end(model: Undeformed, mesh: StageMesh, chain: int, push: Push) -> _End:
    """How the motion of a body at a push is read."""
    unknowns = 2 * len(model.tied.free) + 3
    if push.station is None:
        reads = np.zeros((3, unknowns))
        if push.body:
            reads[:, -3:] = chain_rotation(chain).T
        return _End(0j, reads, np.zeros(3))
    starts = push.station.starts
    at = min(int(np.searchsorted(starts, push.station.middle, side="right")) - 1, len(push.station.path) - 1)
    segment = push.station.path[at]
    c = complex(middle_at(segment, np.array((push.station.middle - starts[at]) / segment.length)))
    units = np.array([[1.0, 0.0, -c.imag], [0.0, 1.0, c.real], [0.0, 0.0, 1.0]])
    nodal = np.array([push_forces(mesh, chain, push._replace(wrench=unit)) for unit in units])
    middle = chain_rotation(chain)[:2, :2] @ (c.real, c.imag)
    return _End(c, model.tied.loads(nodal).T, np.einsum("knd,nd->k", nodal, mesh.nodes - middle))


def _openings(
    stacks: tuple[Stack, ...], ends: list[tuple[_End, ...]], read: Array, follows: Follows
) -> tuple[Array, list[Array]]:
    """First (6n, n) and second derivatives (6, 6) of the openings by what is read (6n,), pushed body and carrier."""
    first, second = np.zeros((len(read), len(stacks))), []
    for j, (stack, (pushed, carrier)) in enumerate(zip(stacks, ends, strict=True)):
        order = [3, 4, 5, 0, 1, 2] if follows == "pushed" else [0, 1, 2, 3, 4, 5]  # the body with the pivot comes first
        on, along = (carrier, pushed) if follows == "pushed" else (pushed, carrier)
        mine, v = read[6 * j : 6 * j + 6][order], np.array([on.v, along.v])
        turn = mine[[2, 5]]
        rates = np.eye(6)
        rates[:3, 2] += v[0] * turn[0]
        rates[3:, 5] += v[1] * turn[1]
        motion = mine + np.concatenate((v.T * turn**2 / 2).T)
        direction = stack.direction if follows == "pushed" else -stack.direction
        g, H = _behind(on.middle, along.middle, motion, direction, stack.pivot(follows), stack.point)
        H = rates.T @ H @ rates
        H[2, 2] += g[:3] @ v[0]
        H[5, 5] += g[3:] @ v[1]
        first[6 * j + np.array(order), j] = rates.T @ g
        second.append(H[np.ix_(order, order)])
    return first, second


def _behind(
    on: complex, along: complex, motion: Array, direction: complex, pivot: complex, contact: complex
) -> tuple[Array, Array]:
    """Derivatives (6,) and (6, 6) of how far the pivot, on one body, is behind a face of the other.

    on, along : reference points of the two bodies.   motion : (6,), of the one and of the other.

    Notes
    -----
    `g = -m (x_on(pivot) - x_along(contact))`, m being the direction, turned with the other body.
    """
    x, turn, y, spin = complex(*motion[:2]), motion[2], complex(*motion[3:5]), motion[5]
    r, s = np.exp(1j * turn) * (pivot - on), np.exp(1j * spin) * (contact - along)
    m, apart = np.exp(1j * spin) * direction, on + x + r - along - y - s
    first = np.array([-m.real, -m.imag, _dot(m, -1j * r), m.real, m.imag, _dot(m, 1j * (apart + s))])
    H = np.zeros((6, 6))
    H[2, 2], H[2, 5], H[5, 5] = _dot(m, r), -_dot(m, r), _dot(m, apart + s)
    H[0, 5], H[1, 5] = m.imag, -m.real
    H[3, 5], H[4, 5] = -m.imag, m.real
    return first, H + np.triu(H, 1).T


def _dot(a: complex, b: complex) -> float:
    return float((np.conj(a) * b).real)


def _state(model: Undeformed, motion: Array) -> State:
    """The state at displacements (unknowns,) of the free nodes and the hub."""
    field = np.zeros((len(model.tied.number), 2))
    field[model.tied.free] = motion[:-3].reshape(-1, 2)
    field[model.tied.hub] = hub_at(model.arms, motion[-3:]).motion
    strains = (green_lagrange(slopes_of(batch, field[None])[0]) for batch in model.batches)
    return State(motion[-3:], field, [stress_tensor(model.plate, strain) for strain in strains])
