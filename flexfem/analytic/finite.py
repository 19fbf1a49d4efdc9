"""Finite displacements of a mechanism: rigid bodies, and hinges as geometrically exact beams.

Every hinge is divided into co-rotational beams with equal shares of its rotational compliance. A
beam is elastic relative to its chord: with its elongation v, the rotations a and c of its ends from
the chord, and its length l, the tension follows from the elongation of the bent axis, `v + l (2 a^2
- a c + 2 c^2) / 30` (a cubic curve), and the end moments from the integrals of the local height. M.
A. Crisfield, Non-linear Finite Element Analysis 1, 1991, chapter 7. Loads are dead: forces keep
their direction, and act at points that move with the bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic.plates import beam_compliances, moving_bodies
from flexfem.arrays import AnyArray, Array, Index
from flexfem.mechanism.layout import Layout, Port
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_beam import SHEAR_CORRECTION
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


def beam_stiffness(
    profile: Profile,
    marks: Array,
    E: float,
    nu: float,
    thickness: float,
) -> Array:
    """Return the stiffness (n, 3, 3) of parts of a profile: elongation, rotations from the chord.

    marks : (n + 1,), mm, ends of the parts on the axis of the profile.
    """
    flexibility = np.array(
        [_beam_flexibility(profile, start, end, nu) for start, end in pairwise(marks)]
    )
    return np.asarray(np.linalg.inv(flexibility / (E * thickness)))


def _beam_flexibility(
    profile: Profile,
    start: float,
    end: float,
    nu: float,
) -> Array:
    """Return the flexibility (3, 3) of one part of a profile, times E and the thickness."""
    flexibility = np.zeros((3, 3))
    inside = [mark for mark in profile.breaks if start < mark < end]
    for low, high in pairwise([start, *inside, end]):
        x = low + (high - low) * (GAUSS[0] + 1) / 2
        w = GAUSS[1] * (high - low) / 2
        height = profile.height(x)
        share = (x - start) / (end - start)
        axial = float(np.sum(w / height))
        # moments of a unit tension and of unit moments at the two ends
        moment = np.stack([profile.middle(x), share - 1, share])
        flexibility += (moment * (12 * w / height**3)) @ moment.T
        flexibility[0, 0] += axial
        flexibility[1:, 1:] += SHEAR_CORRECTION * 2 * (1 + nu) * axial / (end - start) ** 2
    return flexibility


def divided_profile(profile: Profile, count: int) -> Array:
    """Return the ends (count + 1,), mm, of parts of a profile with equal rotational compliance."""
    pieces = [np.linspace(a, b, FINE + 1) for a, b in pairwise(profile.breaks)]
    x = np.unique(np.concatenate(pieces))
    density = profile.height(x) ** -3
    rotation = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) * np.diff(x))])
    return np.asarray(np.interp(np.linspace(0.0, rotation[-1], count + 1), rotation, x))


class BeamState(NamedTuple):
    """A mechanism under loads on its k ports, in `size` unknowns.

    motions : (k,), of the ports.   P : (size, k), their derivatives.
    left : (size,), loads less elastic forces.   K : (size, size), tangent stiffness.
    """

    motions: Array
    P: Array
    left: Array
    K: Array


class Beams(NamedTuple):
    """The e beams of h hinges in a deformed mechanism.

    arm : (h, n), complex, mm, of nodes from the reference points of their bodies.
    length : (e,), mm, and unit : (e,), complex, of the chords.
    bent : (e, 2), mm, rotations of the ends times `BOW`.
    stress : (e, 3), tension, N, and moments at the ends, N mm.
    """

    arm: Array
    length: Array
    unit: Array
    bent: Array
    stress: Array


class BeamNodes(NamedTuple):
    """The n nodes of the beams of each of h hinges at rest.

    place : (h, n), complex, mm.   column : (h, n), the first of the three unknowns of each.
    arm : (h, n), complex, mm, from the reference points of their bodies; zero for other nodes.
    centre : complex, mm, reference points of the bodies, by their first unknown over three.
    """

    place: AnyArray
    column: Index
    arm: AnyArray
    centre: AnyArray


class LoadedPoints(NamedTuple):
    """The c points of moving bodies at which unit loads on ports act.

    port : (c,), index of the port.   column : (c,), the first unknown of the body.
    arm : (c,), complex, mm, from the reference point of the body at rest.
    wrench : (3, c), force along x and y and moment about the point, per unit load.
    """

    port: Index
    column: Index
    arm: AnyArray
    wrench: Array


def _nodes_at_rest(layout: Layout, marks: dict[Profile, Array]) -> BeamNodes:
    """Return the nodes at `marks` on the axes of the hinges; those at the ground come last."""
    moving = moving_bodies(layout)
    bodies = {body: 3 * number for number, body in enumerate(moving)}
    hinges = len(layout.joints)
    inner = 3 * np.arange(hinges * (BEAMS - 1)).reshape(hinges, -1)
    size = 3 * len(moving) + inner.size * 3
    column = np.full((hinges, BEAMS + 1), size)
    column[:, 1:-1] = 3 * len(moving) + inner
    place = np.zeros(column.shape, dtype=complex)
    for number, joint in enumerate(layout.joints):
        column[number, [0, -1]] = [bodies.get(body, size) for body in joint.bodies]
        place[number] = joint.place + np.exp(1j * joint.heading) * marks[joint.profile]
    arm = np.zeros_like(place)
    centre = np.zeros(size // 3 + 1, dtype=complex)
    for first in bodies.values():
        own = column == first
        centre[first // 3] = place[own].mean()
        arm[own] = place[own] - centre[first // 3]
    return BeamNodes(place, column, arm, centre)


def _loaded_points(
    layout: Layout,
    ports: Sequence[Port],
    centre: AnyArray,
) -> LoadedPoints:
    """Return the points of moving bodies where unit loads on ports act."""
    number = {body: k for k, body in enumerate(moving_bodies(layout))}
    port = list[int]()
    column = list[int]()
    arm = list[complex]()
    wrenches = list[tuple[float, float, float]]()
    for index, one in enumerate(ports):
        for patch, wrench in one.parts:
            if patch.body in number:
                port.append(index)
                column.append(3 * number[patch.body])
                arm.append(patch.point - centre[number[patch.body]])
                wrenches.append(wrench)
    return LoadedPoints(np.array(port), np.array(column), np.array(arm), np.array(wrenches).T)


def _stiffness_at_rest(
    layout: Layout,
    marks: dict[Profile, Array],
    hinges: Array | None,
) -> Array:
    """Return the stiffness (e, 3, 3) of all beams as `beam_stiffness`.

    hinges : compliances (h, 3, 3) that the beams get in tension and in bending.
    """
    known = dict[tuple[Profile, object], Array]()
    found = list[Array]()
    for joint in layout.joints:
        material = layout.material_of(joint)
        key = (joint.profile, material)
        if key not in known:
            own = marks[joint.profile]
            known[key] = beam_stiffness(joint.profile, own, *material[:2], layout.thickness)
        found.append(known[key])
    stiffness = np.concatenate(found)
    if hinges is not None:
        own = beam_compliances(layout)
        change = np.sqrt([own[:, row, row] / hinges[:, row, row] for row in (0, 2, 2)])
        change = np.repeat(change.T, BEAMS, axis=0)
        stiffness *= change[:, :, None] * change[:, None]
    return stiffness


class FinitePlate:
    """A mechanism in its unknowns: motions of bodies, then of nodes between beams.

    There are three unknowns for each. The nodes at the ends of a hinge move with its bodies; those
    at the ground have the three numbers after the last.

    Attributes
    ----------
    size, ports : numbers of unknowns and of ports.
    rigid : number of unknowns of bodies, which come first.   hinges : number of hinges.
    nodes : those of the beams at rest.   loaded : the points where loads on ports act.
    extent : mm, size of the mechanism, by which displacements are compared with rotations.
    strain_at_rest : of the plate without stress relative to its drawing, but not of the ground.
    """

    def __init__(
        self, layout: Layout, hinges: Array | None = None, ports: Sequence[Port] | None = None
    ) -> None:
        """Divide the hinges of a layout into beams.

        hinges : compliances (h, 3, 3) at their centres, that the beams get in tension and bending.
        ports : those where loads act, by default those of the layout.
        """
        profiles = {joint.profile for joint in layout.joints}
        marks = {profile: divided_profile(profile, BEAMS) for profile in profiles}
        ports = layout.ports if ports is None else ports
        self.strain_at_rest = 0.0
        self.rigid = 3 * len(moving_bodies(layout))
        self.hinges = len(layout.joints)
        self.size = self.rigid + 3 * self.hinges * (BEAMS - 1)
        self.ports = len(ports)
        self.nodes = _nodes_at_rest(layout, marks)
        self.loaded = _loaded_points(layout, ports, self.nodes.centre)
        place = self.nodes.place
        self.chord = np.diff(place).ravel()
        self.extent = float(np.ptp(place.real) + np.ptp(place.imag))
        self.stiffness = _stiffness_at_rest(layout, marks, hinges)

    def deformed(self, q: Array) -> Beams:
        """Beams at unknowns q (size,); nodes of bodies move and turn with them."""
        full = np.append(q, np.zeros(3))
        column = self.nodes.column
        chord = self.chord
        turn = full[column + 2]
        arm = (1 + self.strain_at_rest) * self.nodes.arm * np.exp(1j * turn)
        displacement = full[column] + 1j * full[column + 1] + arm - self.nodes.arm
        stretched = np.diff(displacement).ravel()
        length = np.abs(chord + stretched)
        rest = np.abs(chord)
        unit = (chord + stretched) / length
        from_chord = np.exp(1j * self._at_both_ends(turn))
        ends = np.angle(from_chord * (unit.conj() * chord / rest)[:, None])
        v = (2 * (chord.conj() * stretched).real + np.abs(stretched) ** 2) / (length + rest)
        bent = rest[:, None] * ends @ BOW
        v = v - self.strain_at_rest * rest
        strain = np.column_stack([v + np.sum(bent * ends, axis=1) / 2, ends])
        return Beams(arm, length, unit, bent, np.einsum("eij,ej->ei", self.stiffness, strain))

    def energy(
        self,
        q: Array,
        prestress: Array | float = 0.0,
    ) -> tuple[Array, Array]:
        """Gradient and Hessian of the elastic energy at unknowns q (size,).

        prestress : (e, 3), tension, N, and end moments, N mm, of the beams at rest.
        """
        beams = self.deformed(q)
        g, K = self._at_ends(beams, beams.stress + prestress)
        J = np.zeros((len(g), 6, 6))
        J[:, range(6), range(6)] = 1.0
        arms = self._at_both_ends(beams.arm)
        for node in range(2):
            at = 3 * node
            ax = arms[:, node].real
            ay = arms[:, node].imag
            J[:, at, at + 2] = -ay
            J[:, at + 1, at + 2] = ax
            # second order of the turned arm
            K[:, at + 2, at + 2] -= g[:, at] * ax + g[:, at + 1] * ay
        column = self.nodes.column
        where = self._at_both_ends(column)
        where = (where[:, :, None] + np.arange(3)).reshape(-1, 6)
        gradient = np.zeros(self.size + 3)
        hessian = np.zeros((self.size + 3, self.size + 3))
        np.add.at(gradient, where, np.einsum("eij,ei->ej", J, g))
        np.add.at(hessian, (where[:, :, None], where[:, None]), J.transpose(0, 2, 1) @ K @ J)
        return gradient[: self.size], hessian[: self.size, : self.size]

    @staticmethod
    def _at_both_ends(of_nodes: AnyArray) -> AnyArray:
        """Return values (h, beams + 1) of nodes at the start and end (e, 2) of each beam."""
        return np.stack([of_nodes[:, :-1].ravel(), of_nodes[:, 1:].ravel()], axis=1)

    def _at_ends(
        self,
        beams: Beams,
        stress: Array,
    ) -> tuple[Array, Array]:
        """Gradient (e, 6) and Hessian (e, 6, 6) of the energy of beams by motions of both ends.

        stress : (e, 3), tension, N, and end moments, N mm.
        """
        length = beams.length
        S = np.tile(np.eye(3), (len(length), 1, 1))
        S[:, 0, 1:] = beams.bent
        forces = np.einsum("eij,ei->ej", S, stress)
        local = S.transpose(0, 2, 1) @ self.stiffness @ S
        local[:, 1:, 1:] += (stress[:, 0] * np.abs(self.chord))[:, None, None] * BOW
        c = beams.unit.real
        s = beams.unit.imag
        zero = np.zeros_like(length)
        r = np.stack([-c, -s, zero, c, s, zero], axis=1)
        z = np.stack([s, -c, zero, -s, c, zero], axis=1)
        turning = -z / length[:, None]
        D = np.stack([r, turning, turning], axis=1)
        D[:, 1, 2] = 1.0
        D[:, 2, 5] = 1.0
        zz = z[:, :, None] * z[:, None]
        rz = r[:, :, None] * z[:, None]
        moment = (forces[:, 1] + forces[:, 2]) / length**2
        K = D.transpose(0, 2, 1) @ local @ D + (forces[:, 0] / length)[:, None, None] * zz
        K += moment[:, None, None] * (rz + rz.transpose(0, 2, 1))
        return np.einsum("eij,ei->ej", D, forces), K

    def state(
        self,
        q: Array,
        f: Array,
    ) -> BeamState:
        """State at unknowns q (size,) under dead loads f (k,).

        The second derivatives of the loads come from rotations of arms.
        """
        gradient, K = self.energy(q)
        loaded = self.loaded
        rotations = loaded.column + 2
        arm = loaded.arm * np.exp(1j * q[rotations])
        fx, fy, _ = loaded.wrench
        turning = f[loaded.port] * (arm.real * fx + arm.imag * fy)
        np.add.at(K, (rotations, rotations), turning)
        P = self._unit_loads(arm)
        return BeamState(self._motions(q, arm), P, P @ f - gradient, K)

    def _unit_loads(self, arm: AnyArray) -> Array:
        """Return the loads (size, k) on the unknowns by unit loads on ports; arm (c,), turned."""
        port, column, _, (fx, fy, moment) = self.loaded
        loads = np.zeros((self.size, self.ports))
        np.add.at(loads, (column, port), fx)
        np.add.at(loads, (column + 1, port), fy)
        np.add.at(loads, (column + 2, port), moment + arm.real * fy - arm.imag * fx)
        return loads

    def _motions(
        self,
        q: Array,
        arm: AnyArray,
    ) -> Array:
        """Return the motions (k,) of the ports at unknowns q (size,); arm (c,), turned."""
        port, column, rest_arm, (fx, fy, moment) = self.loaded
        swung = arm - rest_arm
        along_x = fx * (q[column] + swung.real)
        along_y = fy * (q[column + 1] + swung.imag)
        motions = np.zeros(self.ports)
        np.add.at(motions, port, along_x + along_y + moment * q[column + 2])
        return motions

    def largest_change(self, step: Array) -> float:
        """Return the largest rotation, rad, or displacement per extent, of changes (size,) of q."""
        shift = np.abs(step.reshape(-1, 3)[:, :2]).max() / self.extent
        return max(float(np.abs(step[2::3]).max()), float(shift))

    def converged(
        self,
        x: Array,
        step: Callable[[Array], Array],
    ) -> Array | None:
        """Return where Newton's method ends, None if it does not converge.

        x : (size + n,), unknowns q and n other numbers, at the start.
        step : change (size + n,) of x that solves the linear equations at x. It is shortened to a
            change of the unknowns of `LARGEST`.
        """
        for _ in range(ITERATIONS):
            change = step(x)
            if not np.isfinite(change).all():
                return None
            largest = self.largest_change(change[: self.size])
            x = x + change * min(1.0, LARGEST / max(largest, CLOSE))
            if largest < CLOSE:
                return x
        return None

    def equilibrium(
        self,
        q: Array,
        f: Array,
    ) -> Array | None:
        """Unknowns (size,) under dead loads f (k,), from a start q; None as of `converged`."""

        def step(q: Array) -> Array:
            at = self.state(q, f)
            return np.asarray(np.linalg.solve(at.K, at.left))

        return self.converged(q, step)


class Grown(NamedTuple):
    """Unknowns q (size,) at a share of a command, 1 for all of it."""

    q: Array
    share: float


def grown(
    q: Array, equilibrium: Callable[[Array, float], Array | None], smallest: float = SMALLEST
) -> Grown:
    """Follow an equilibrium while a command grows from nothing, as far as there is one.

    A step is twice as long after a success, and a quarter after a failure.

    q : (size,), unknowns at the start.
    equilibrium : unknowns (size,) near others at a share of the command; None without one.
    smallest : step, as a share.
    """
    done = 0.0
    step = 1.0
    while done < 1.0:
        after = min(1.0, done + step)
        reached = equilibrium(q, after)
        if reached is not None:
            q = reached
            done = after
            step = 2 * step
            continue
        step /= 4
        if step < smallest:
            break
    return Grown(q, done)


def _said(layout: Layout, loads: Array) -> str:
    """Return loads (k,) on the ports as a text with units and directions."""
    parts = list[str]()
    for port, load in zip(layout.ports, loads.tolist(), strict=True):
        if load:
            unit = "N mm" if port.rotation else "N"
            parts.append(f"{load:.3g} {unit} on {port.label}")
    return ", ".join(parts) or "no load"


def _under_share(
    plate: FinitePlate, start: Array, change: Array, q: Array, share: float
) -> Array | None:
    """Return the unknowns (size,) under a load (k,) and a share of its change."""
    return plate.equilibrium(q, start + share * change)


def displaced(layout: Layout, loads: Array) -> FiniteResponse:
    """Return the equilibria under dead loads (s, k) on the ports, one followed from the other.

    Raises
    ------
    ComputationFailed: a body can move without load, or there is no equilibrium near the one before:
    the mechanism
        buckles, or a load is far too large.
    """
    plate = FinitePlate(layout)
    found = list[tuple[Array, Array, bool, Array]]()
    q = np.zeros(plate.size)
    before = np.zeros(plate.ports)
    for target in np.asarray(loads, dtype=float):
        change = target - before

        q, done = grown(q, partial(_under_share, plate, before, change))
        if done < 1.0:
            last = _said(layout, before + done * change)
            asked = f"the load was to grow to {_said(layout, loads[-1])}"
            raise ComputationFailed(
                f"no equilibrium beyond {last}: {asked}, expected a smaller one"
            )
        before = target
        at = plate.state(q, target)
        stable = bool(np.linalg.eigvalsh(at.K)[0] > 0)
        found.append((at.motions, at.P.T @ np.linalg.solve(at.K, at.P), stable, target))
    return FiniteResponse(*(np.array(values) for values in zip(*found, strict=True)))


def buckling_factors(
    layout: Layout,
    loads: Array,
    held: Sequence[Sequence[int]],
) -> Array:
    """Return the least positive multiples (s,) of loads (s, k) that buckle it; infinite if none.

    held : (s), ports whose displacements stay zero under each load, so that they cannot take part
        in buckling. Raises ComputationFailed when a body can move without load.
    """
    plate = FinitePlate(layout)
    pairs = zip(np.asarray(loads, dtype=float), held, strict=True)
    return np.array([load_factors(plate, load, ports, 1)[0] for load, ports in pairs])


def load_factors(
    plate: FinitePlate,
    load: Array,
    held: Sequence[int],
    count: int,
) -> Array:
    """Return the least positive multiples (count,) of a load (k,) at which a mechanism buckles.

    There are infinities in place of those that do not exist.

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
    by_forces = plate.energy(still, forces)[1] - plate.energy(still)[1]
    by_load = plate.state(still, load).K - rest.K
    change = free.T @ (by_forces + by_load) @ free
    softening = eigh(-change, stiffness, eigvals_only=True)[::-1]
    found = softening[softening > ROUND_OFF * np.abs(softening).max()][:count]
    factors[: len(found)] = 1 / found
    return factors
