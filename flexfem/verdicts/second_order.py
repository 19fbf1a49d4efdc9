"""Measures on the stage as springs and joints: what its second-order terms change, and the least energy of (29)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexfem.analytic.large import Missed, at_every, at_pose, missed
from flexfem.analytic.model import hinge_compliances
from flexfem.analytic.paper import PaperModel, apply, freedoms_of, inverse_kinematics, mechanism, stiffness
from flexfem.arrays import Array
from flexfem.refused import ComputationFailed
from flexfem.units import COMMANDS
from flexfem.verdicts.evidence import Evidence, ModelErrors, along, listed

MOTIONS, SEED, STRAY = 1000, 29, 0.1  # other joint motions; root of their energy over that of (29)
CHUNK = 20  # stages together


def _mechanism(of: ModelErrors) -> PaperModel:
    return mechanism(of.designs.frames, hinge_compliances(of.designs, of.formula), freedoms_of(of.mobility))


def _each(of: ModelErrors, ask: Callable[[ModelErrors], Array]) -> Array:
    """What is asked of n stages, (n, k), some together: one that is hard to reach slows those beside it.

    Where some fail they are asked one by one, nan of those that fail. Raises ComputationFailed for n = 1.
    """
    count = len(of.percent)
    if count <= CHUNK:
        try:
            return ask(of)
        except ComputationFailed:
            if count == 1:
                raise
    step, found = (CHUNK if count > CHUNK else 1), []
    for start in range(0, count, step):
        try:
            found.append(_each(of.of_rows(np.arange(start, min(start + step, count))), ask))
        except ComputationFailed:
            found.append(np.full((1, 1), np.nan))
    width = max(part.shape[1] for part in found)
    return np.concatenate([np.broadcast_to(part, (len(part), width)) for part in found])


def _missed(of: ModelErrors, amplitude: Array) -> Missed:
    return missed(_mechanism(of), amplitude, of.lever)


def second_order(on: Evidence) -> Array:
    """Largest difference of exact and linear position over the workspace, per cent (n, 1), mobility six."""
    return _each(on.six, lambda of: 100 * _missed(of, on.amplitude).position[:, None])


def said_second_order(on: Evidence, values: Array) -> str:
    """What `second_order` found on one stage."""
    terms = 100 * float(_missed(on.six, on.amplitude).terms[0])
    far = 100 * float(_missed(on.six, 10 * on.amplitude).position[0])
    return (
        f"exact and linear position differ by up to {values[0]:.3f} % within {_workspace(on)}, the two terms"
        f" change the tangent compliance by up to {terms:.3f} %; at ten times these commands the positions differ by up"
        f" to {far:.2f} %"
    )


def _workspace(on: Evidence) -> str:
    return " and ".join(f"{COMMANDS[k].factor * on.amplitude[k]:g} {COMMANDS[k].plain}" for k in (0, 2))


def second_order_of_error(on: Evidence) -> Array:
    """Change of the error along each command by the exact load in place of (18), per cent of that error, (n, 3)."""

    def ask(of: ModelErrors) -> Array:
        poses = np.concatenate([np.diag(on.amplitude), -np.diag(on.amplitude)])
        more = at_pose(at_every(_mechanism(of)), poses).load - apply(of.stiffness[:, None], poses)
        moved = apply(of.compliance[:, None], more)[..., np.arange(6), np.arange(6) % 3] / np.sum(poses, axis=-1)
        worst = np.max(np.abs(moved).reshape(-1, 2, 3), axis=1)
        return np.asarray(100 * worst / np.abs(along(of) / 100))

    return _each(on.six, ask)


def said_second_order_of_error(on: Evidence, values: Array) -> str:
    """What `second_order_of_error` found on one stage."""
    return (
        f"at {_workspace(on)} the exact load changes the errors of {listed(along(on.six)[0])} % by"
        f" {listed(values, '.2f')} % of them at most"
    )


def minimum_energy(on: Evidence) -> Array:
    """Least that random other joint motions to one pose store more than (29), per cent (n, 1), mobility six."""
    return np.concatenate([_energy_more(on, row) for row in range(len(on.six.percent))])


def _energy_more(on: Evidence, row: int) -> Array:
    """Least that random other joint motions of one stage store more than (29), per cent, (1, 1)."""
    of = _mechanism(on.six.of_rows(np.array([row])))
    of = of._replace(frames=type(of.frames)(*(part[0] for part in of.frames)), springs=of.springs[0])
    at, random = stiffness(of), np.random.default_rng(SEED)
    best = inverse_kinematics(of, at, on.amplitude).independent  # (29)
    internal = np.linalg.svd(at.influence.G_u)[2][3:]  # joint motions that leave the platform where it is
    assert np.max(np.abs(internal @ at.influence.G_u.T)) < 1e-9 * np.max(np.abs(at.influence.G_u))  # rounding
    stray = random.normal(size=(MOTIONS, len(internal))) @ internal
    least = best @ at.K_aa @ best
    stray *= STRAY * np.sqrt(least / np.einsum("ka,ab,kb->k", stray, at.K_aa, stray))[:, None]
    energy = np.einsum("ka,ab,kb->k", best + stray, at.K_aa, best + stray)
    return np.array([[100 * (np.min(energy) / least - 1)]])


def said_minimum_energy(_: Evidence, values: Array) -> str:
    """What `minimum_energy` found on one stage."""
    return (
        f"{MOTIONS} random other joint motions to one pose, each with {STRAY**2:.0%} of the energy in what differs,"
        f" store at least {values[0]:.3f} % more than (29)"
    )
