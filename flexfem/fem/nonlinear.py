"""Large displacements of the stage: total-Lagrangian plane stress, a hub that turns by finite angles, Newton."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.fem.elements import QUADRATURE, Plate, slopes_of, stress_tensor
from flexfem.fem.mesh import StageMesh
from flexfem.fem.tangent import (
    Factorise,
    Factorization,
    State,
    Undeformed,
    factoriser,
    green_lagrange,
    held_by,
    hub_at,
    model_of,
    rest,
    strain_rate,
    tangent,
)
from flexfem.refused import ComputationFailed

ITERATIONS = 25  # for one load step
ALL_ITERATIONS = 1000  # for one load; a stage takes 4 to 6
SMALLEST = 1 / 1024  # of the way from one load to the next
LARGEST_TURN = 1.0  # change of a displacement gradient, about rad, in one iteration; beyond it the load is divided
LARGEST_STRAIN = 0.3  # St. Venant-Kirchhoff material loses its stiffness under compression at 1/3
CONVERGED = 1e-11  # root of energy that the next Newton step would have, over the stored energy
ROUNDING = 1e-6  # the same of a step that is no longer smaller than the one before: necks of a um and less


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
    model, factorise = model_of(mesh, plate, degree), factoriser()
    state, start, scale, rows = rest(model), np.zeros(3), 0.0, []
    for target in targets:
        step, iterations, scale = _reach(model, factorise, state, start, target, hold, scale)
        state, start = step.state, target
        rows.append(_row(model, step, iterations, scale, None if hold else target))
    return Equilibria(*(np.array(column) for column in zip(*rows, strict=True)))


def _reach(
    model: Undeformed, factorise: Factorise, state: State, start: Array, target: Array, hold: bool, scale: float
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
    model: Undeformed, factorise: Factorise, state: State, goal: Array, hold: bool, scale: float
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


def _step(model: Undeformed, factorise: Factorise, state: State, goal: Array, hold: bool) -> _Step:
    """One Newton step towards a load or (hold) a pose; held, the load on the hub is the one that brings it there."""
    hub, free = hub_at(model.arms, state.pose), 2 * len(model.tied.free)
    held, factor = held_by(model, state), factorise(tangent(model, state))
    missing, ones = -held.forces, np.zeros((free + 3, 3))
    missing[free:] = 0.0 if hold else missing[free:] + goal
    ones[free:] = np.eye(3)
    found = factor.solve(np.column_stack([missing, ones]))
    change, unit = found[:, 0], found[:, 1:]
    if hold:
        missing[free:] = np.linalg.solve(unit[free:], goal - state.pose - change[free:])
        change = change + unit @ missing[free:]
    linear = np.zeros_like(state.field)
    linear[model.tied.free] = change[:free].reshape(-1, 2)
    moved = state.field + linear
    linear[model.tied.hub] = (hub.rates @ change[free:]).reshape(-1, 2)
    pose = goal if hold else state.pose + change[free:]
    moved[model.tied.hub] = hub_at(model.arms, pose).motion
    stress, turn = _predicted(model, state.field, linear)
    size = float(np.sqrt(abs(change @ missing)))
    return _Step(State(pose, moved, stress), size, held.energy, turn, unit, factor)


def _predicted(model: Undeformed, field: Array, change: Array) -> tuple[list[Array], float]:
    """Second Piola-Kirchhoff stress after a change of the displacements, to first order in it; and the largest turn."""
    stress, turn = [], 0.0
    for batch in model.batches:
        slopes, changes = slopes_of(batch, np.stack([field, change]))
        turn = np.maximum(turn, np.max(np.abs(changes)))  # nan stays nan
        stress.append(stress_tensor(model.plate, green_lagrange(slopes) + strain_rate(slopes, changes)))
    return stress, float(turn)


def _row(model: Undeformed, step: _Step, iterations: int, scale: float, load: Array | None) -> tuple[Any, ...]:
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
