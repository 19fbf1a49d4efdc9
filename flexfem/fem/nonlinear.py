"""Large displacements of a plane stage: total-Lagrangian plane stress, a hub that turns by finite angles, Newton."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.elements import ElementBatch, Plate, assembled, stress_tensor
from flexfem.fem.factor import Factoriser, Solve
from flexfem.fem.mesh import StageMesh
from flexfem.fem.structure import Structure, structure
from flexfem.refused import ComputationFailed

ITERATIONS = 25  # for one load step
ALL_ITERATIONS = 1000  # for one load; a stage takes 4 to 6
SMALLEST = 1 / 1024  # of the way from one load to the next
LARGEST_TURN = 1.0  # change of a displacement gradient, about rad, in one iteration; beyond it the load is divided
LARGEST_STRAIN = 0.3  # St. Venant-Kirchhoff material loses its stiffness under compression at 1/3
CONVERGED = 1e-11  # root of energy that the next Newton step would have, over the stored energy
ROUNDING = 1e-6  # the same of a step that is no longer smaller than the one before: necks of a um and less


def green_lagrange(slopes: Array) -> Array:
    """Green-Lagrange strain (..., 2, 2, q) of displacement gradients `H_aA = d_A u_a`: `E = (H + H' + H'H) / 2`.

    Not `(F'F - 1) / 2`: small strains are not differences of numbers near one.
    """
    product = np.einsum("...caq,...cbq->...abq", slopes, slopes)
    return np.asarray((slopes + np.swapaxes(slopes, -3, -2) + product) / 2)


def tangent_blocks(batch: ElementBatch, plate: Plate, slopes: Array, stress: Array) -> Array:
    """Tangent (e, 6, 6, 1, 2, 2) per thickness at gradients H and second Piola-Kirchhoff stress S (e, 2, 2, q).

    Notes
    -----
    With `p_ia = F_aA d_A phi_i` and `M[ia, jb] = int p_ia p_jb dA`, the change of `int F S : grad v dA` is

        K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu int (F F')_ab d_A phi_i d_A phi_j dA
                    + delta_ab int d_A phi_i S_AB d_B phi_j dA

    whose first line is the material and whose second the geometric stiffness. At rest it is `ElementBatch.stiffness`.
    """
    (lame, mu), count, weight = plate.lame(2), len(batch.triangles), batch.weights[:, None, None]
    root = batch.gradients * np.sqrt(weight)  # (e, i, A, q)
    deformation = slopes + np.eye(2)[:, :, None]
    spread = deformation[:, None, :, :, None] * root[:, :, None, None]  # F_aA d_C phi_i: (e, i, a, A, C, q)
    pushed, flat = np.trace(spread, axis1=3, axis2=4).reshape(count, 12, -1), spread.reshape(count, 12, -1)
    m, f = ((part @ part.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2) for part in (pushed, flat))
    k = (lame * m + mu * (m.transpose(0, 1, 4, 3, 2) + f)).transpose(0, 1, 3, 2, 4)
    pulled = np.einsum("eABq,eiBq->eiAq", stress * weight, batch.gradients, optimize=True).reshape(count, 6, -1)
    k[..., range(2), range(2)] += (pulled @ batch.gradients.reshape(count, 6, -1).transpose(0, 2, 1))[..., None]
    return k[:, :, :, None]


class State(NamedTuple):
    """Pose (3,), displacements (n, 2), mm, and per batch the second Piola-Kirchhoff stress (e, 2, 2, q), MPa, of the
    tangent: on the way to equilibrium not quite the one of the displacements."""

    pose: Array
    field: Array
    stress: list[Array]


class Held(NamedTuple):
    """What a state takes: forces (2f + 3,) on the unknowns, stored energy, N mm, largest strain component."""

    forces: Array
    energy: float
    strain: float


class LargeStructure:
    """A plane structure whose hub turns by any angle: `u = U + (R(theta) - 1) r`."""

    def __init__(self, of: Structure) -> None:
        self.of, self.pairs, self.factorise = of, of.pairs, Factoriser()

    def turned(self, pose: Array) -> tuple[Array, Array]:
        """Motion (h, 2), mm, of the hub's nodes at a pose (3,), mm and rad, and their arms (h, 2), mm, turned."""
        arms, sine, less = self.of.mesh.nodes[self.of.hub], np.sin(pose[2]), -2.0 * np.sin(pose[2] / 2) ** 2  # cos - 1
        swung = arms @ np.array([[less, -sine], [sine, less]]).T
        return pose[:2] + swung, arms + swung

    def rates(self, pose: Array) -> Array:
        """Change (2h, 3) of the motion of the hub's nodes per pose."""
        return np.reshape(self.of.line.rigid(self.turned(pose)[1]), (-1, 3))

    def at(self, pose: Array, field: Array) -> State:
        """The state of displacements (n, 2), mm, the hub's replaced by those of the pose."""
        field = field.copy()
        field[self.of.hub] = self.turned(pose)[0]
        return State(pose, field, [stress_tensor(self.of.plate, green_lagrange(H)) for H in self._slopes(field)])

    def _slopes(self, field: Array) -> list[Array]:
        return [batch.slopes(self.of.line, field[None])[0] for batch in self.of.batches]

    def nodal(self, state: State, slopes: list[Array]) -> Array:
        """Nodal forces (n, 2), N, that balance the stress of a state with displacement gradients by batch."""
        forces = np.zeros((1, *state.field.shape))
        for batch, H, stress in zip(self.of.batches, slopes, state.stress, strict=True):
            first = stress + np.einsum("eacq,ecbq->eabq", H, stress)  # P = F S
            batch.add_forces(forces, self.of.line, first[None])
        return np.asarray(forces[0])

    def held(self, state: State) -> Held:
        """Forces, energy and strain of the state's displacements, whatever its stress."""
        of, slopes = self.of, self._slopes(state.field)
        strains = [green_lagrange(H) for H in slopes]
        own = state._replace(stress=[stress_tensor(of.plate, strain) for strain in strains])
        forces = self.nodal(own, slopes)
        on_hub = forces[of.hub].ravel() @ self.rates(state.pose)
        parts = zip(strains, own.stress, of.batches, strict=True)
        energy = sum(float(np.sum(e * s * batch.weights[:, None, None])) for e, s, batch in parts) * of.plate.thickness
        largest = max(float(np.max(np.abs(strain))) for strain in strains)
        return Held(np.append(forces[of.free].ravel(), on_hub), energy / 2, largest)

    def tangent(self, state: State) -> sp.csr_array:
        """Lower triangle (2f + 3, 2f + 3) of the change of the forces on the unknowns, with the state's own stress."""
        of, slopes = self.of, self._slopes(state.field)
        parts = zip(of.batches, slopes, state.stress, strict=True)
        blocks = (tangent_blocks(batch, of.plate, H, stress) for batch, H, stress in parts)
        K = of.tied(assembled(self.pairs, blocks, of.line), self.rates(state.pose))
        hub_forces, levers = self.nodal(state, slopes)[of.hub], self.turned(state.pose)[1]
        K.data[-1] -= np.sum(hub_forces * levers)
        return K


class Equilibria(NamedTuple):
    """Equilibria of the stage at k loads or poses, reached one after the other from rest.

    load : (k, 3), on the hub, N and N mm.   pose : (k, 3), displacement of the hub, mm and rad.
    fields : (k, n, 2), mm, displacement of every node.
    energy : (k,), N mm, stored in the material.
    compliance : (k, 3, 3), tangent: change of the pose per change of the load, mm and rad per N and N mm.
    strain : (k,), largest magnitude of a Green-Lagrange strain component; the material law assumes it small.
    """

    load: Array
    pose: Array
    fields: Array
    energy: Array
    compliance: Array
    strain: Array


def equilibrium(mesh: StageMesh, plate: Plate, loads: Array) -> Equilibria:
    """Equilibria under dead loads (k, 3) or (3,) on the hub, each reached from the one before, the first from rest.

    A force at the platform centre that moves with it and keeps its direction, N, and a moment conjugate to theta, N mm.

    Raises ComputationFailed when Newton does not converge even in the smallest load steps.

    Notes
    -----
    St. Venant-Kirchhoff material, `S = lambda* tr(E) + 2 mu E` with the Lame constants of plane stress, on the
    undeformed plate of constant thickness: right for small strains and rotations of any size, which is what flexures
    do. Newton carries displacements and stress: each tangent takes the stress that the step before predicts to first
    order, not the one of the displacements found, whose quadratic part is spurious tension of slender bodies that
    turn. Both are the same in equilibrium; about half the iterations go.
    """
    return _follow(mesh, plate, loads, False)


def imposed(mesh: StageMesh, plate: Plate, poses: Array) -> Equilibria:
    """As `equilibrium`, the hub held at poses (k, 3) or (3,), mm and rad, by `load`."""
    return _follow(mesh, plate, poses, True)


class _Step(NamedTuple):
    """A Newton step: the state after it, its size as root of energy, the energy before it, its largest turn, the unit
    answers (2f + 3, 3) to loads on the hub, and how the tangent solves."""

    state: State
    size: float
    energy: float
    turn: float
    unit: Array
    solve: Solve


def _follow(mesh: StageMesh, plate: Plate, targets: Array, hold: bool) -> Equilibria:
    model, start, scale, rows = LargeStructure(structure(mesh, plate)), np.zeros(3), 0.0, []
    state = model.at(start, np.zeros_like(mesh.nodes))
    for target in np.atleast_2d(np.asarray(targets, dtype=float)):
        step, scale = _reach(model, state, start, target, hold, scale)
        state, start = step.state, target
        rows.append(_row(model, step, None if hold else target))
    return Equilibria(*(np.array(column) for column in zip(*rows, strict=True)))


def _reach(
    model: LargeStructure, state: State, start: Array, target: Array, hold: bool, scale: float
) -> tuple[_Step, float]:
    """Go from a state at `start`, a load or (hold) a pose, to `target`, in steps that are halved when Newton fails."""
    done, part, iterations = 0.0, 1.0, 0
    while part >= SMALLEST and iterations <= ALL_ITERATIONS:
        goal = target if done + part >= 1.0 else start + (done + part) * (target - start)
        step, used = _newton(model, state, goal, hold, scale)
        iterations += used
        if step is None:
            part /= 2
            continue
        state, done, scale = step.state, done + part, max(scale, step.energy)
        if done >= 1.0:
            return step, scale
        part = min(2 * part, 1.0 - done)
    what = "holding the hub at" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {what} {target.tolist()}: Newton fails beyond {100 * done:.3g} % of the way, after"
        f" {iterations} iterations; that is at or beyond buckling, or the load is far too large"
    )


def _newton(model: LargeStructure, state: State, goal: Array, hold: bool, scale: float) -> tuple[_Step | None, int]:
    """Equilibrium at `goal`, None when not converged; energies below `scale` count as nothing."""
    last = 1.0
    for iteration in range(1, ITERATIONS + 1):
        step = _step(model, state, goal, hold)
        if not step.turn <= LARGEST_TURN:
            return None, iteration
        size = _relative(step.size, max(scale, step.energy, step.size**2))
        if size * min(size / last, 1.0) <= CONVERGED or last / 2 < size <= ROUNDING:
            return step, iteration
        state, last = step.state, size
    return None, ITERATIONS


def _step(model: LargeStructure, state: State, goal: Array, hold: bool) -> _Step:
    """One Newton step towards a load or (hold) a pose; held, the load on the hub is the one that brings it there."""
    of, held, solve = model.of, model.held(state), model.factorise(model.tangent(state))
    missing = -held.forces
    missing[-3:] = 0.0 if hold else missing[-3:] + goal
    found = solve(np.column_stack([missing, np.eye(of.size, 3, 3 - of.size)]))
    change, unit = found[:, 0], found[:, 1:]
    if hold:
        missing[-3:] = np.linalg.solve(unit[-3:], goal - state.pose - change[-3:])
        change = change + unit @ missing[-3:]
    linear = np.zeros_like(state.field)
    linear[of.free] = change[:-3].reshape(-1, 2)
    moved = state.field + linear
    linear[of.hub] = (model.rates(state.pose) @ change[-3:]).reshape(-1, 2)
    pose = goal if hold else state.pose + change[-3:]
    moved[of.hub] = model.turned(pose)[0]
    stress, turn = [], 0.0  # the stress after the change, to first order in it
    for batch in of.batches:
        slopes, changes = batch.slopes(of.line, np.stack([state.field, linear]))
        turn = np.maximum(turn, np.max(np.abs(changes)))  # nan stays nan
        half = changes + np.einsum("...caq,...cbq->...abq", slopes, changes)  # F' dH
        rate = (half + np.swapaxes(half, -3, -2)) / 2
        stress.append(stress_tensor(of.plate, green_lagrange(slopes) + rate))
    size = float(np.sqrt(abs(change @ missing)))
    return _Step(State(pose, moved, stress), size, held.energy, float(turn), unit, solve)


def _row(model: LargeStructure, step: _Step, load: Array | None) -> tuple[Any, ...]:
    """The entries of `Equilibria`, in their order; `load` None takes what the hub needs to stay where it is."""
    held, at, compliance = model.held(step.state), step.state, step.unit[-3:]
    if held.strain > LARGEST_STRAIN:
        raise ComputationFailed(
            f"equilibrium refused: strain of {held.strain:.2g}, expected at most {LARGEST_STRAIN:g}, beyond which the"
            " material law means nothing"
        )
    if load is None:  # forces on the hub alone carry the rounding of stiff bodies, which those left on the nodes undo
        left = np.append(-held.forces[:-3], np.zeros(3))
        load = held.forces[-3:] - np.linalg.solve(compliance, step.solve(left[:, None])[-3:, 0])
    return load, at.pose, at.field, held.energy, compliance, held.strain


def _relative(size: float, energy: float) -> float:
    return float(size / np.sqrt(energy)) if size > 0.0 else 0.0
