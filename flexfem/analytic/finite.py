"""Finite displacements of a plate mechanism: rigid bodies and hinges as geometrically exact chains
of beams.

Every hinge is divided into co-rotational beams with equal shares of its rotational compliance. A
beam is elastic relative to its chord: with its elongation v, the rotations a and c of its ends from
the chord, and its length l, the tension follows from the elongation of the bent axis, `v + l (2 a^2
- a c + 2 c^2) / 30` (a cubic curve), and the end moments from the integrals of the local height. M.
A. Crisfield, Non-linear Finite Element Analysis 1, 1991, chapter 7. Loads are dead: forces keep
their direction, and act at points that move with the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic.plates import beam_compliances, moving_bodies
from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout, Port
from flexfem.mechanism.profiles import SHEAR_CORRECTION, Profile
from flexfem.refused import ComputationFailed

BEAMS = 8  # of a hinge
FINE = 512  # intervals between breaks of a profile, to divide it
GAUSS = np.polynomial.legendre.leggauss(16)
LARGEST = 0.2  # rad; rotation in one iteration
CLOSE = 1e-10  # rad, and relative to the size of the mechanism; last step of Newton's method
ITERATIONS = 40
SMALLEST = 2.0**-12  # of a load step
ROUND_OFF = 1e-6  # of the largest change of the tangent; a smaller one is no buckling
# rotation, rad, or displacement per size of the mechanism, for which forces are linear in
# displacements
SMALL = 1e-6
BOW = np.array([[4.0, -1.0], [-1.0, 4.0]]) / 30  # second derivative of the shortening per length


class FiniteResponse(NamedTuple):
    """Equilibria under s loads.

    motions : (s, k), displacements and rotations of the ports, mm and rad; of an actuator along its
    line at rest.
    compliance : (s, k, k), tangent compliance between the ports.
    stable : (s,), whether the equilibrium is stable under dead loads.
    loads : (s, k), on the ports, N and N mm.
    """

    motions: Array
    compliance: Array
    stable: Array
    loads: Array


def beam_stiffness(profile: Profile, marks: Array, E: float, nu: float, thickness: float) -> Array:
    """Return the stiffness (n, 3, 3) of the parts of a profile between `marks` (n + 1,) on its
    axis, mm.

    Of elongation and of the rotations of the ends from the chord.
    """
    flexibility = np.zeros((len(marks) - 1, 3, 3))
    for part, (start, end) in zip(flexibility, pairwise(marks), strict=True):
        inside = [mark for mark in profile.breaks if start < mark < end]
        for low, high in pairwise([start, *inside, end]):
            x = low + (high - low) * (GAUSS[0] + 1) / 2
            w = GAUSS[1] * (high - low) / 2
            height = profile.height(x)
            share = (x - start) / (end - start)
            bending = 12 * w / height**3
            axial = float(np.sum(w / height))
            shear = SHEAR_CORRECTION * 2 * (1 + nu) * axial / (end - start) ** 2
            moment = np.stack(
                [profile.middle(x), share - 1, share]
            )  # of unit tension and moments at the two ends
            part += (moment * bending) @ moment.T
            part[0, 0] += axial
            part[1:, 1:] += shear
    return np.asarray(np.linalg.inv(flexibility / (E * thickness)))


def divided_profile(profile: Profile, count: int) -> Array:
    """Return the ends (count + 1,) of parts of a profile with equal shares of its rotational
    compliance, mm.
    """
    x = np.unique(
        np.concatenate([np.linspace(a, b, FINE + 1) for a, b in pairwise(profile.breaks)])
    )
    density = profile.height(x) ** -3
    turned = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) * np.diff(x))])
    return np.asarray(np.interp(np.linspace(0.0, turned[-1], count + 1), turned, x))


class BeamState(NamedTuple):
    """A mechanism under loads on its k ports, in `size` unknowns.

    motions : (k,), of the ports, and their derivatives P : (size, k).   left : (size,), loads less
    elastic forces.
    K : (size, size), tangent stiffness.
    """

    motions: Array
    P: Array
    left: Array
    K: Array


class Beams(NamedTuple):
    """The e beams of h hinges in a deformed mechanism.

    arm : (h, n), complex, mm, of nodes from the reference points of their bodies.
    length, unit : (e,), mm and complex, of the chords.   bent : (e, 2), mm, rotations of the ends
    times `BOW`.
    stress : (e, 3), tension, N, and moments at the ends, N mm.
    """

    arm: Array
    length: Array
    unit: Array
    bent: Array
    stress: Array


class FinitePlate:
    """A mechanism in its unknowns: displacement and rotation, 3 each, of bodies, then of nodes
    between beams.

    The nodes at the ends of a hinge move with its bodies; those at the ground have the three
    numbers after the last."""

    def __init__(
        self, layout: Layout, hinges: Array | None = None, ports: Sequence[Port] | None = None
    ) -> None:
        """`hinges`: compliances (h, 3, 3) at their centres, that the beams get in tension and in
        bending.

        `ports`: those where loads act, by default those of the layout.
        """
        self.strain_at_rest = (
            0.0  # of the plate without stress, relative to its drawing, but not of the ground
        )
        moving = moving_bodies(layout)
        count = len(layout.joints)
        marks = {
            profile: divided_profile(profile, BEAMS)
            for profile in {joint.profile for joint in layout.joints}
        }
        kinds = {(joint.profile, layout.material_of(joint)) for joint in layout.joints}
        stiff = {
            (profile, material): beam_stiffness(
                profile, marks[profile], *material[:2], layout.thickness
            )
            for profile, material in kinds
        }
        self.rigid = 3 * len(moving)
        self.hinges = count
        self.size = self.rigid + 3 * count * (BEAMS - 1)
        place = np.array(
            [
                joint.place + np.exp(1j * joint.heading) * marks[joint.profile]
                for joint in layout.joints
            ]
        )
        column = np.full((count, BEAMS + 1), self.size)
        bodies = {body: 3 * i for i, body in enumerate(moving)}
        column[:, 1:-1] = 3 * len(moving) + 3 * np.arange(count * (BEAMS - 1)).reshape(count, -1)
        column[:, [0, -1]] = [
            [bodies.get(body, self.size) for body in joint.bodies] for joint in layout.joints
        ]
        self.place = place  # of the nodes at rest
        self.column, self.arm = (
            column,
            np.zeros_like(place),
        )  # of the nodes, from the reference points of their bodies
        centre = np.zeros(self.size // 3 + 1, dtype=complex)
        for at in bodies.values():
            centre[at // 3] = place[column == at].mean()
            self.arm[column == at] = place[column == at] - centre[at // 3]
        self.centre = centre  # reference points of the bodies
        self.chord = np.diff(place).ravel()
        self.stiffness = np.concatenate(
            [stiff[one.profile, layout.material_of(one)] for one in layout.joints]
        )
        if hinges is not None:
            own = beam_compliances(layout)
            change = np.sqrt([own[:, row, row] / hinges[:, row, row] for row in (0, 2, 2)])
            change = np.repeat(change.T, BEAMS, axis=0)
            self.stiffness *= change[:, :, None] * change[:, None]
        self.extent = float(np.ptp(place.real) + np.ptp(place.imag))
        ports = layout.ports if ports is None else ports
        parts = [
            (j, bodies[at.body], at.point - centre[bodies[at.body] // 3], *wrench)
            for j, port in enumerate(ports)
            for at, wrench in port.parts
            if at.body in bodies
        ]
        columns = [np.array(values) for values in zip(*parts, strict=True)]
        self.port, self.loaded, self.load_arm, self.load = *columns[:3], np.array(columns[3:])
        self.ports = len(ports)

    def deformed(self, q: Array) -> Beams:
        """Beams at unknowns q (size,); a node at z of a body moves to the body's pose and turned z."""
        full = np.append(q, np.zeros(3))
        chord = self.chord
        x = full[self.column]
        y = full[self.column + 1]
        turn = full[self.column + 2]
        arm = (1 + self.strain_at_rest) * self.arm * np.exp(1j * turn)
        stretched = np.diff(x + 1j * y + arm - self.arm).ravel()
        length = np.abs(chord + stretched)
        rest = np.abs(chord)
        unit = (chord + stretched) / length
        from_chord = np.exp(1j * np.stack([turn[:, :-1].ravel(), turn[:, 1:].ravel()], axis=1))
        ends = np.angle(from_chord * (unit.conj() * chord / rest)[:, None])
        v = (2 * (chord.conj() * stretched).real + np.abs(stretched) ** 2) / (length + rest)
        bent = rest[:, None] * ends @ BOW
        v = v - self.strain_at_rest * rest
        strain = np.column_stack([v + np.sum(bent * ends, axis=1) / 2, ends])
        return Beams(arm, length, unit, bent, np.einsum("eij,ej->ei", self.stiffness, strain))

    def energy(self, q: Array, prestress: Array | float = 0.0) -> tuple[Array, Array]:
        """Gradient and Hessian of the elastic energy at unknowns q (size,).

        prestress : (e, 3), tension, N, and end moments, N mm, of the beams at rest.
        """
        arm, length, unit, bent, stress = self.deformed(q)
        stress = stress + prestress
        rest = np.abs(self.chord)
        S = np.tile(np.eye(3), (len(length), 1, 1))
        S[:, 0, 1:] = bent
        forces = np.einsum("eij,ei->ej", S, stress)
        local = S.transpose(0, 2, 1) @ self.stiffness @ S
        local[:, 1:, 1:] += (stress[:, 0] * rest)[:, None, None] * BOW
        c = unit.real
        s = unit.imag
        zero = np.zeros_like(length)
        one = np.ones_like(length)
        r = np.stack([-c, -s, zero, c, s, zero], axis=1)
        z = np.stack([s, -c, zero, -s, c, zero], axis=1)
        D = np.stack([r, -z / length[:, None], -z / length[:, None]], axis=1)
        D[:, 1, 2] = D[:, 2, 5] = one
        zz = z[:, :, None] * z[:, None]
        rz = r[:, :, None] * z[:, None]
        moment = (forces[:, 1] + forces[:, 2]) / length**2
        K = D.transpose(0, 2, 1) @ local @ D + (forces[:, 0] / length)[:, None, None] * zz
        K += moment[:, None, None] * (rz + rz.transpose(0, 2, 1))
        g = np.einsum("eij,ei->ej", D, forces)
        J = np.zeros((len(length), 6, 6))
        pairs = np.stack([arm[:, :-1].ravel(), arm[:, 1:].ravel()], axis=1)
        J[:, range(6), range(6)] = 1.0
        for node in range(2):
            at = 3 * node
            ax, ay = (pairs[:, node].real, pairs[:, node].imag)
            J[:, at, at + 2] = -ay
            J[:, at + 1, at + 2] = ax
            K[:, at + 2, at + 2] -= (
                g[:, at] * ax + g[:, at + 1] * ay
            )  # second order of the turned arm
        where = np.stack([self.column[:, :-1].ravel(), self.column[:, 1:].ravel()], axis=1)
        where = (where[:, :, None] + np.arange(3)).reshape(-1, 6)
        gradient = np.zeros(self.size + 3)
        hessian = np.zeros((self.size + 3, self.size + 3))
        np.add.at(gradient, where, np.einsum("eij,ei->ej", J, g))
        np.add.at(hessian, (where[:, :, None], where[:, None]), J.transpose(0, 2, 1) @ K @ J)
        return gradient[: self.size], hessian[: self.size, : self.size]

    def state(self, q: Array, f: Array) -> BeamState:
        """State at unknowns q (size,) with dead loads f (k,), whose second derivatives come from
        rotations of arms.
        """
        gradient, K = self.energy(q)
        fx, fy, m = self.load
        arm = self.load_arm * np.exp(1j * q[self.loaded + 2])
        swung = arm - self.load_arm
        P = np.zeros((self.size, self.ports))
        motions = np.zeros(self.ports)
        for row, values in enumerate((fx, fy, m + arm.real * fy - arm.imag * fx)):
            np.add.at(P, (self.loaded + row, self.port), values)
        parts = (
            fx * (q[self.loaded] + swung.real)
            + fy * (q[self.loaded + 1] + swung.imag)
            + m * q[self.loaded + 2]
        )
        np.add.at(motions, self.port, parts)
        np.add.at(
            K, (self.loaded + 2, self.loaded + 2), f[self.port] * (arm.real * fx + arm.imag * fy)
        )
        return BeamState(motions, P, P @ f - gradient, K)

    def equilibrium(self, q: Array, f: Array) -> Array | None:
        """Unknowns (size,) under dead loads (k,), from a start; None if Newton's method does not
        converge.
        """
        for _ in range(ITERATIONS):
            at = self.state(q, f)
            step = np.linalg.solve(at.K, at.left)
            if not np.isfinite(step).all():
                return None
            angle = np.abs(step[2::3]).max()
            shift = np.max(np.abs(step.reshape(-1, 3)[:, :2])) / self.extent
            q = q + step * min(1.0, LARGEST / max(angle, shift, CLOSE))
            if max(angle, shift) < CLOSE:
                return q
        return None


def _said(layout: Layout, loads: Array) -> str:
    """Return loads (k,) on the ports as a text with units and directions."""
    named = zip(layout.ports, loads.tolist(), strict=True)
    parts = [
        f"{load:.3g} {'N mm' if port.rotation else 'N'} on {port.label}"
        for port, load in named
        if load
    ]
    return ", ".join(parts) or "no load"


def displaced(layout: Layout, loads: Array) -> FiniteResponse:
    """Return the equilibria under dead loads (s, k) on the ports, N and N mm, followed one from the
    other.

    Raises
    ------
    ComputationFailed: a body can move without load, or there is no equilibrium near the one before:
    the mechanism
        buckles, or a load is far too large.
    """
    plate = FinitePlate(layout)
    found = list[tuple[Array, Array, bool, Array]]()
    q = np.zeros(plate.size)
    f = np.zeros(plate.ports)
    for target in np.asarray(loads, dtype=float):
        done = 0.0
        share = 1.0
        while done < 1.0:
            reached = plate.equilibrium(q, f + min(1.0, done + share) * (target - f))
            if reached is not None:
                q = reached
                done = done + share
                share = 2 * share
            elif (share := share / 4) < SMALLEST:
                last = _said(layout, f + done * (target - f))
                asked = f"the load was to grow to {_said(layout, loads[-1])}"
                raise ComputationFailed(
                    f"no equilibrium beyond {last}: {asked}, expected a smaller one"
                )
        f = target
        at = plate.state(q, target)
        stable = bool(np.linalg.eigvalsh(at.K)[0] > 0)
        found.append((at.motions, at.P.T @ np.linalg.solve(at.K, at.P), stable, target))
    return FiniteResponse(*(np.array(values) for values in zip(*found, strict=True)))


def buckling_factors(layout: Layout, loads: Array, held: Sequence[Sequence[int]]) -> Array:
    """Return the least positive multiples (s,) of loads (s, k) at which a mechanism buckles;
    infinite if it does not.

    held : (s), ports whose displacements stay zero under each load, so that they cannot take part
    in buckling. Raises ComputationFailed when a body can move without load."""
    plate = FinitePlate(layout)
    pairs = zip(np.asarray(loads, dtype=float), held, strict=True)
    return np.array([load_factors(plate, load, ports, 1)[0] for load, ports in pairs])


def load_factors(plate: FinitePlate, load: Array, held: Sequence[int], count: int) -> Array:
    """Return the least positive multiples (count,) of a load (k,) at which a mechanism buckles,
    then infinity.

    held : ports whose displacements stay zero.

    Notes
    -----
    The tangent stiffness `K_0 + a K_s` is singular at the factor a. K_s is the change of the
    tangent by the forces in the hinges and the loads, both of the linear solution, in the shape at
    rest: displacements before buckling are neglected, as in the theory of Euler.

    Raises ComputationFailed when a body can move without load.
    """
    from scipy.linalg import eigh, null_space

    still = np.zeros(plate.size)
    rest = plate.state(still, np.zeros(plate.ports))
    free = null_space(rest.P[:, list(held)].T) if len(held) else np.eye(plate.size)
    stiffness = free.T @ rest.K @ free
    q = free @ np.linalg.solve(stiffness, free.T @ rest.P @ load)
    factors = np.full(count, np.inf)
    largest = max(np.abs(q[2::3]).max(), np.abs(q).max() / plate.extent)
    if largest == 0:
        return factors
    small = SMALL / largest  # the forces are proportional to the load up to this size
    forces = plate.deformed(small * q).stress / small
    loaded = plate.state(still, load).K - rest.K
    change = free.T @ (plate.energy(still, forces)[1] - plate.energy(still)[1] + loaded) @ free
    softening = eigh(-change, stiffness, eigvals_only=True)[::-1]
    found = softening[softening > ROUND_OFF * np.abs(softening).max()][:count]
    factors[: len(found)] = 1 / found
    return factors
