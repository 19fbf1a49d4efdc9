"""Large displacements of a plane stage: total-Lagrangian plane stress, a hub that turns by finite angles, Newton.

Driven by its stacks (`preloaded`), forces go with their bodies. Of a link that a stack pushes or stands on,
displacement and rotation are read over its station, with the weights of `response.push_forces`; of the platform, those
of the hub. From them follows the opening g of the stack with its first and second derivatives. Constant forces N have
the potential `-N g`; what it adds to the sparse tangent is of low rank, and is dense algebra beside its factor. As a
link turns by theta, its points come nearer to the middle of the station by theta^2/2 of their distance. Weights f read
that as `-v theta^2/2`, v = sum f r, as if the link had moved; it is taken out.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flexfem.arrays import Array
from flexfem.fem.elements import QUADRATURE, ElementBatch, Plate, add_nodal_forces, slopes_of, stress_tensor, tied_lower
from flexfem.fem.factor import Factorise, Factorization, factoriser
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import push_forces
from flexfem.fem.structure import Structure, rigid_motion, structure
from flexfem.mechanism.contacts import Follows, Push, Stack, middle_at
from flexfem.mechanism.designs import chain_rotation
from flexfem.refused import ComputationFailed

ITERATIONS = 25  # for one load step
ALL_ITERATIONS = 1000  # for one load; a stage takes 4 to 6
SMALLEST = 1 / 1024  # of the way from one load to the next
LARGEST_TURN = 1.0  # change of a displacement gradient, about rad, in one iteration; beyond it the load is divided
LARGEST_STRAIN = 0.3  # St. Venant-Kirchhoff material loses its stiffness under compression at 1/3
CONVERGED = 1e-11  # root of energy that the next Newton step would have, over the stored energy
ROUNDING = 1e-6  # the same of a step that is no longer smaller than the one before: necks of a um and less
PRELOADED = 1e-9  # root of energy of a Newton step, over that stored and that of every force of a stack alone


def green_lagrange(slopes: Array) -> Array:
    """Green-Lagrange strain (..., 2, 2, q) of displacement gradients `H_aA = d_A u_a` (..., 2, 2, q).

    Notes
    -----
    `E = (H + H' + H'H) / 2` and not `(F'F - 1) / 2`: small strains are not differences of numbers near one.
    """
    product = np.einsum("...caq,...cbq->...abq", slopes, slopes)
    return np.asarray((slopes + np.swapaxes(slopes, -3, -2) + product) / 2)


def strain_rate(slopes: Array, changes: Array) -> Array:
    """First change (..., 2, 2, q) of the Green-Lagrange strain: the symmetric part of `F' dH`."""
    half = changes + np.einsum("...caq,...cbq->...abq", slopes, changes)
    return np.asarray((half + np.swapaxes(half, -3, -2)) / 2)


def first_piola(slopes: Array, stress: Array) -> Array:
    """First Piola-Kirchhoff stress `P = F S` (..., 2, 2, q), MPa, of gradients H and second stress S."""
    return np.asarray(stress + np.einsum("...acq,...cbq->...abq", slopes, stress))


def tangent_matrices(batch: ElementBatch, plate: Plate, slopes: Array, stress: Array) -> Array:
    """Element tangent matrices (e, 6, 2, 6, 2), N/mm, at gradients H and second Piola-Kirchhoff stress S (e, 2, 2, q).

    Notes
    -----
    With `p_ia = F_aA d_A phi_i` and `M[ia, jb] = b int p_ia p_jb dA`, the change of `b int F S : grad v dA` is

        K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu b int (F F')_ab d_A phi_i d_A phi_j dA
                    + delta_ab b int d_A phi_i S_AB d_B phi_j dA

    whose first line is the material and whose second the geometric stiffness. At rest it is `element_matrices`.
    """
    lame, mu = plate.lame
    count = len(batch.triangles)
    weight = (plate.thickness * batch.weights)[:, None, None]
    root = batch.gradients * np.sqrt(weight)  # (e, i, A, q)
    deformation = slopes + np.eye(2)[:, :, None]
    spread = deformation[:, None, :, :, None] * root[:, :, None, None]  # F_aA d_C phi_i: (e, i, a, A, C, q)
    pushed = np.trace(spread, axis1=3, axis2=4).reshape(count, 12, -1)
    flat = spread.reshape(count, 12, -1)
    m = (pushed @ pushed.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    k = lame * m + mu * m.transpose(0, 1, 4, 3, 2) + mu * (flat @ flat.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    pulled = np.einsum("eABq,eiBq->eiAq", stress * weight, batch.gradients, optimize=True).reshape(count, 6, -1)
    geometric = pulled @ batch.gradients.reshape(count, 6, -1).transpose(0, 2, 1)
    k[:, :, 0, :, 0] += geometric
    k[:, :, 1, :, 1] += geometric
    return np.asarray(k)


class Hub(NamedTuple):
    """The rigid hub at one pose, its nodes by their arms (h, 2), mm, from the platform centre at rest.

    motion : (h, 2), mm, `u = U + (R(theta) - 1) r`.
    rates : (2h, 3), change of the motion per pose.
    curvature : (h, 2), mm, second derivative of the motion by theta, `-R r`; the other second derivatives are zero.
    """

    motion: Array
    rates: Array
    curvature: Array


def hub_at(arms: Array, pose: Array) -> Hub:
    """Where the hub's nodes go at a pose (3,), mm and rad, of any size."""
    sine, less = np.sin(pose[2]), -2.0 * np.sin(pose[2] / 2) ** 2  # cos - 1 without cancellation
    turn = np.array([[less, -sine], [sine, less]])
    swung = arms @ turn.T
    return Hub(pose[:2] + swung, rigid_motion(arms + swung), -(arms + swung))


class State(NamedTuple):
    """Pose (3,), displacements (n, 2), mm, and per batch the second Piola-Kirchhoff stress (e, 2, 2, q), MPa.

    The stress is that of the tangent, and on the way to equilibrium not quite the one of the displacements.
    """

    pose: Array
    field: Array
    stress: list[Array]


class Held(NamedTuple):
    """What a state takes: forces (2f + 3,) on the unknowns, stored energy, N mm, largest strain component."""

    forces: Array
    energy: float
    strain: float


def arms_of(model: Structure) -> Array:
    """The hub's nodes (h, 2), mm, from the platform centre at rest."""
    return np.asarray(model.mesh.nodes[model.tied.hub])


def rest(model: Structure) -> State:
    """The structure without displacement and stress."""
    stress = [np.zeros((len(batch.triangles), 2, 2, batch.weights.shape[1])) for batch in model.batches]
    return State(np.zeros(3), np.zeros_like(model.mesh.nodes), stress)


def held_by(model: Structure, state: State) -> Held:
    """Forces, energy and strain of the state's displacements."""
    forces, energy, largest = np.zeros((1, *state.field.shape)), 0.0, 0.0
    for batch in model.batches:
        slopes = slopes_of(batch, state.field[None])[0]
        strain = green_lagrange(slopes)
        stress = stress_tensor(model.plate, strain)
        add_nodal_forces(forces, batch, model.plate, first_piola(slopes, stress)[None])
        energy += float(np.sum(stress * strain * batch.weights[:, None, None])) * model.plate.thickness / 2
        largest = max(largest, float(np.max(np.abs(strain))))
    on_hub = hub_at(arms_of(model), state.pose).rates.T @ forces[0, model.tied.hub].ravel()
    return Held(np.append(forces[0, model.tied.free].ravel(), on_hub), energy, largest)


def tangent(model: Structure, state: State) -> sp.coo_array:
    """Lower triangle (2f + 3, 2f + 3) of the change of the forces on the unknowns, with the state's own stress."""
    hub, forces, matrices = hub_at(arms_of(model), state.pose), np.zeros((1, *state.field.shape)), []
    for batch, stress in zip(model.batches, state.stress, strict=True):
        slopes = slopes_of(batch, state.field[None])[0]
        add_nodal_forces(forces, batch, model.plate, first_piola(slopes, stress)[None])
        matrices.append(tangent_matrices(batch, model.plate, slopes, stress))
    K = tied_lower(model.mesh.triangles, matrices, model.tied.number, hub.rates)
    swing = np.sum(forces[0, model.tied.hub] * hub.curvature)  # as the hub turns, its forces change their levers
    rows, columns = (np.append(place, K.shape[0] - 1) for place in K.coords)
    return sp.coo_array((np.append(K.data, swing), (rows, columns)), shape=K.shape)


class Equilibria(NamedTuple):
    """Equilibria of the stage at k loads or poses, reached one after the other from rest.

    load : (k, 3), on the hub, N and N mm.   pose : (k, 3), displacement of the hub, mm and rad.
    fields : (k, n, 2), mm, displacement of every node.
    energy : (k,), N mm, stored in the material.
    compliance : (k, 3, 3), tangent: change of the pose per change of the load, mm and rad per N and N mm.
    stable : (k,), whether the tangent stiffness is positive definite: the equilibrium keeps itself under the dead load.
    strain : (k,), largest magnitude of a Green-Lagrange strain component; the material law assumes it small.
    residual : (k,), root of the energy of the remaining Newton step over the stored energy.
    iterations : (k,), Newton iterations, those of load steps that failed included.
    """

    load: Array
    pose: Array
    fields: Array
    energy: Array
    compliance: Array
    stable: NDArray[np.bool_]
    strain: Array
    residual: Array
    iterations: NDArray[np.int64]


def equilibrium(mesh: StageMesh, plate: Plate, loads: Array, degree: int = QUADRATURE) -> Equilibria:
    """Equilibria under dead loads (k, 3) or (3,) on the hub, each reached from the one before, the first from rest.

    A force at the platform centre that moves with it and keeps its direction, N, and a moment conjugate to theta, N mm.

    Raises
    ------
    ComputationFailed: Newton does not converge even in the smallest load steps.

    Notes
    -----
    St. Venant-Kirchhoff material, `S = lambda* tr(E) + 2 mu E` with the Lame constants of plane stress, on the
    undeformed plate: right for small strains and rotations of any size, which is what flexures do; for large strains
    it is no material's law (it softens under compression). The thickness stays what it was.

    Newton carries displacements and stress: each tangent takes the stress that the step before predicts to first
    order, not the one of the displacements found, whose quadratic part is spurious tension of slender bodies that
    turn. Both are the same in equilibrium, so the answer and the quadratic rate stay; about half the iterations go.
    """
    return _follow(mesh, plate, np.atleast_2d(np.asarray(loads, dtype=float)), False, degree)


def imposed(mesh: StageMesh, plate: Plate, poses: Array, degree: int = QUADRATURE) -> Equilibria:
    """Equilibria with the hub held at poses (k, 3) or (3,), mm and rad: `load` is what holds it there.

    Raises ComputationFailed and continues from pose to pose as `equilibrium`. `stable` still answers for a dead load.
    """
    return _follow(mesh, plate, np.atleast_2d(np.asarray(poses, dtype=float)), True, degree)


class _Step(NamedTuple):
    """A Newton step: the state after it, its size as root of energy, the energy before it, its largest turn, the unit
    answers (2f + 3, 3) to loads on the hub, and the factor."""

    state: State
    size: float
    energy: float
    turn: float
    unit: Array
    factor: Factorization


def _follow(mesh: StageMesh, plate: Plate, targets: Array, hold: bool, degree: int) -> Equilibria:
    model, factorise = structure(mesh, plate, degree=degree), factoriser()
    state, start, scale, rows = rest(model), np.zeros(3), 0.0, []
    for target in targets:
        step, iterations, scale = _reach(model, factorise, state, start, target, hold, scale)
        state, start = step.state, target
        rows.append(_row(model, step, iterations, scale, None if hold else target))
    return Equilibria(*(np.array(column) for column in zip(*rows, strict=True)))


def _reach(
    model: Structure, factorise: Factorise, state: State, start: Array, target: Array, hold: bool, scale: float
) -> tuple[_Step, int, float]:
    """Go from a state at `start`, a load or (hold) a pose, to `target`, in steps that are halved when Newton fails."""
    done, part, iterations = 0.0, 1.0, 0
    while part >= SMALLEST and iterations <= ALL_ITERATIONS:
        goal = target if done + part >= 1.0 else start + (done + part) * (target - start)
        step, used = _newton(model, factorise, state, goal, hold, scale)
        iterations += used
        if step is None:
            part /= 2
            continue
        state, done, scale = step.state, done + part, max(scale, step.energy)
        if done >= 1.0:
            return step, iterations, scale
        part = min(2 * part, 1.0 - done)
    what = "holding the hub at" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {what} {target.tolist()}: Newton fails beyond {100 * done:.3g} % of the way, after"
        f" {iterations} iterations; that is at or beyond buckling, or the load is far too large"
    )


def _newton(
    model: Structure, factorise: Factorise, state: State, goal: Array, hold: bool, scale: float
) -> tuple[_Step | None, int]:
    """Equilibrium at `goal`, None when not converged; energies below `scale` count as nothing."""
    last = 1.0
    for iteration in range(1, ITERATIONS + 1):
        step = _step(model, factorise, state, goal, hold)
        if not step.turn <= LARGEST_TURN:
            return None, iteration
        size = _relative(step.size, max(scale, step.energy, step.size**2))
        if size * min(size / last, 1.0) <= CONVERGED or last / 2 < size <= ROUNDING:
            return step, iteration
        state, last = step.state, size
    return None, ITERATIONS


def _step(model: Structure, factorise: Factorise, state: State, goal: Array, hold: bool) -> _Step:
    """One Newton step towards a load or (hold) a pose; held, the load on the hub is the one that brings it there."""
    arms, free = arms_of(model), model.size - 3
    held, factor = held_by(model, state), factorise(tangent(model, state))
    missing, ones = -held.forces, np.eye(model.size, 3, -free)
    missing[free:] = 0.0 if hold else missing[free:] + goal
    found = factor.solve(np.column_stack([missing, ones]))
    change, unit = found[:, 0], found[:, 1:]
    if hold:
        missing[free:] = np.linalg.solve(unit[free:], goal - state.pose - change[free:])
        change = change + unit @ missing[free:]
    linear = np.zeros_like(state.field)
    linear[model.tied.free] = change[:free].reshape(-1, 2)
    moved = state.field + linear
    linear[model.tied.hub] = (hub_at(arms, state.pose).rates @ change[free:]).reshape(-1, 2)
    pose = goal if hold else state.pose + change[free:]
    moved[model.tied.hub] = hub_at(arms, pose).motion
    stress, turn = _predicted(model, state.field, linear)
    size = float(np.sqrt(abs(change @ missing)))
    return _Step(State(pose, moved, stress), size, held.energy, turn, unit, factor)


def _predicted(model: Structure, field: Array, change: Array) -> tuple[list[Array], float]:
    """Second Piola-Kirchhoff stress after a change of the displacements, to first order in it; and the largest turn."""
    stress, turn = [], 0.0
    for batch in model.batches:
        slopes, changes = slopes_of(batch, np.stack([field, change]))
        turn = np.maximum(turn, np.max(np.abs(changes)))  # nan stays nan
        stress.append(stress_tensor(model.plate, green_lagrange(slopes) + strain_rate(slopes, changes)))
    return stress, float(turn)


def _row(model: Structure, step: _Step, iterations: int, scale: float, load: Array | None) -> tuple[Any, ...]:
    """The entries of `Equilibria`, in their order; `load` None takes what the hub needs to stay where it is."""
    held = held_by(model, step.state)
    if held.strain > LARGEST_STRAIN:
        raise ComputationFailed(
            f"equilibrium refused: strain of {held.strain:.2g}, expected at most {LARGEST_STRAIN:g}, beyond which the"
            " material law means nothing"
        )
    missing, compliance = -held.forces, step.unit[-3:]
    applied = held.forces[-3:] if load is None else load
    missing[-3:] += applied
    change = step.factor.solve(missing[:, None])[:, 0]
    if load is None:  # the forces on the hub alone carry the rounding of stiff bodies; this takes it out
        missing[-3:] = np.linalg.solve(compliance, -change[-3:])
        change, applied = change + step.unit @ missing[-3:], applied + missing[-3:]
    residual = _relative(float(np.sqrt(abs(change @ missing))), max(scale, held.energy))
    at, stable = step.state, step.factor.definite
    return applied, at.pose, at.field, held.energy, compliance, stable, held.strain, residual, iterations


def _relative(size: float, energy: float) -> float:
    return float(size / np.sqrt(energy)) if size > 0.0 else 0.0


class Preloaded(NamedTuple):
    """Equilibrium with forces of the stacks and a load on the hub.

    pose : (3,), mm and rad.   compliance : (3 + n, 3 + n), tangent, of the platform and of the openings of the stacks
    at constant forces, as in `response.DrivenResponse`.
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
    model, factorise = structure(mesh, plate), factoriser()
    ends = [tuple(_end(model, stack.chain, push) for push in stack.pushes) for stack in stacks]
    reads = np.concatenate([end.reads for pair in ends for end in pair]).T
    hub = np.eye(model.size, 3, 3 - model.size)
    state, motion = rest(model), np.zeros(model.size)
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
        if abs(Z[:, 0] @ missing) <= PRELOADED**2 * (held.energy + force**2 @ np.abs(np.diag(C)[3:])):
            return Preloaded(state.pose + Z[-3:, 0], (C + C.T) / 2)
        motion = motion + Z[:, 0]
        state = _state(model, motion)
    raise ComputationFailed("no equilibrium with these forces of the stacks: Newton's method does not converge")


def _end(model: Structure, chain: int, push: Push) -> _End:
    """How the motion of a body at a push is read."""
    if push.station is None:
        reads = np.zeros((3, model.size))
        if push.body:
            reads[:, -3:] = chain_rotation(chain).T
        return _End(0j, reads, np.zeros(3))
    starts, mesh = push.station.starts, model.mesh
    at = min(int(np.searchsorted(starts, push.station.middle, side="right")) - 1, len(push.station.path) - 1)
    segment = push.station.path[at]
    c = complex(middle_at(segment, np.array((push.station.middle - starts[at]) / segment.length)))
    units = np.array([[1.0, 0.0, -c.imag], [0.0, 1.0, c.real], [0.0, 0.0, 1.0]])
    nodal = np.array([push_forces(mesh, chain, push._replace(wrench=unit)) for unit in units])
    middle = chain_rotation(chain)[:2, :2] @ (c.real, c.imag)
    return _End(c, model.loads(nodal).T, np.einsum("knd,nd->k", nodal, mesh.nodes - middle))


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


def _state(model: Structure, motion: Array) -> State:
    """The state at displacements (size,) of the free nodes and the hub."""
    field = np.zeros_like(model.mesh.nodes)
    field[model.tied.free] = motion[:-3].reshape(-1, 2)
    field[model.tied.hub] = hub_at(arms_of(model), motion[-3:]).motion
    strains = (green_lagrange(slopes_of(batch, field[None])[0]) for batch in model.batches)
    return State(motion[-3:], field, [stress_tensor(model.plate, strain) for strain in strains])
