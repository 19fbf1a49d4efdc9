"""Equilibria of a mechanism of beams by strokes and dead loads, with finite rotations.

An actuator of stiffness k and stroke s pushes its contacts apart with the force `k (s - d)` at an
opening d. It acts along its line at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.finite import grown
from flexfem.analytic.paths import DrivenPlate
from flexfem.arrays import Array

STIFF = 1e7  # times the stiffness of a port: of an actuator that holds its opening
SMALL = 1e-5  # of a command, for the stress by linear theory


class Displaced(NamedTuple):
    """Motions (k,), mm and rad, of ports, loads (k,), N and N mm, and highest stress (h,), MPa.

    They are changes of these, or their possible errors, where it is stated.
    """

    motions: Array
    loads: Array
    stress: Array

    def plus(
        self,
        other: Displaced,
        share: float = 1.0,
    ) -> Displaced:
        """Add a share of another one."""
        return Displaced(*(mine + share * added for mine, added in zip(self, other, strict=True)))

    def error(self, share: float) -> Displaced:
        """Return the possible error if it is a share of every number."""
        return Displaced(*(share * np.abs(mine) for mine in self))


class Applied(NamedTuple):
    """Dead loads (k,) on the ports, N and N mm, and strokes (k,) of the actuators at ports, mm.

    springs : (k,), stiffness of the actuators, N/mm; zero at ports without one, infinite if it
        holds its opening.
    """

    loads: Array
    strokes: Array
    springs: Array


def linear(plate: DrivenPlate, command: Applied) -> Displaced:
    """Return what linear theory states at a command."""
    springs = _springs(plate, command)
    rest = plate.state(np.zeros(plate.size), np.zeros(plate.ports))
    stiffness = rest.K + (rest.P * springs) @ rest.P.T
    q = np.asarray(np.linalg.solve(stiffness, rest.P @ (command.loads + springs * command.strokes)))
    motions = rest.P.T @ q
    loads = command.loads + springs * (command.strokes - motions)
    return Displaced(motions, loads, plate.stress(SMALL * q) / SMALL)


def displaced_by(plate: DrivenPlate, command: Applied) -> Displaced | None:
    """Return the equilibrium at a command, which grows from rest in steps; None without one."""
    springs = _springs(plate, command)

    def under(q: Array, share: float) -> Array | None:
        part = Applied(share * command.loads, share * command.strokes, springs)
        return _equilibrium(plate, q, part)

    q, done = grown(np.zeros(plate.size), under)
    if done < 1.0:
        return None
    motions = plate.state(q, command.loads).motions
    loads = command.loads + springs * (command.strokes - motions)
    return Displaced(motions, loads, plate.stress(q))


def _springs(plate: DrivenPlate, command: Applied) -> Array:
    """Return the stiffness (k,) of the actuators, that of rigid ones by that of their ports."""
    if np.isfinite(command.springs).all():
        return command.springs
    rest = plate.state(np.zeros(plate.size), np.zeros(plate.ports))
    own = 1 / np.einsum("sk,sk->k", rest.P, np.linalg.solve(rest.K, rest.P))
    return np.where(np.isfinite(command.springs), command.springs, STIFF * own)


def _equilibrium(
    plate: DrivenPlate,
    q: Array,
    command: Applied,
) -> Array | None:
    """Return the unknowns (size,) at a command, from a start; None as of `converged`."""

    def step(q: Array) -> Array:
        motions = plate.state(q, command.loads).motions
        at = plate.state(q, command.loads + command.springs * (command.strokes - motions))
        tangent = at.K + (at.P * command.springs) @ at.P.T
        return np.asarray(np.linalg.solve(tangent, at.left))

    return plate.converged(q, step)
