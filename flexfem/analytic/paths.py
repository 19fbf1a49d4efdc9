"""Equilibrium paths of a mechanism whose output is driven to finite displacements, and where they
end.

The motions of chosen ports are prescribed, and the forces that hold them follow: Newton's method on
the tangent stiffness bordered by these ports. The nodes between the beams of a hinge are eliminated
hinge by hinge. A path ends where a hinge yields, or where the tangent stiffness of the motions that
are not prescribed is no longer positive definite: there the mechanism buckles. J. M. T. Thompson
and G. W. Hunt, A General Theory of Elastic Stability, 1973. It also ends where a body yields, where
two parts of the plate touch, and at the stroke of an actuator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.contact import Clearance
from flexfem.analytic.finite import (
    BEAMS,
    CLOSE,
    ITERATIONS,
    LARGEST,
    Beams,
    BeamState,
    FinitePlate,
    divided_profile,
)
from flexfem.arrays import Array
from flexfem.mechanism.curves import CurvePoint, Line
from flexfem.mechanism.layout import Layout, Port
from flexfem.mechanism.profiles import Profile
from flexfem.refused import ComputationFailed

STEPS = 6  # from rest to the displacement at which linear theory yields
GROWTH = 1.25  # of the steps beyond it
MOST_STEPS = 40
SMALLEST_STEP = 1e-4  # of the displacement reached, beyond which no equilibrium is found
SMALL_STEP = 1e-4  # of the displacement at which linear theory yields, for slopes at rest
FINEST = 1e-7  # of the margin at the end of a path, and relative error of its displacement
APART = 1e-3  # least relative distance of two displacements from which slopes are taken
# of the yield strength: stress in plane stress from which that in three dimensions is computed
NEAR = 0.7
YIELD = "yield"
BUCKLING = "buckling"
NO_LIMIT = "no limit"
BODY_YIELD = "yield of a body"
CONTACT = "contact"
STROKE = "stroke"
StressRatios: TypeAlias = Callable[[Array], Array]  # of wrenches (h, 3), to plane stress


class PathPoint(NamedTuple):
    """Equilibrium at prescribed motions of some ports.

    unknowns : (size,), of `FinitePlate`.   forces : (k,), on the ports, N and N mm.   motions :
    (k,), mm and rad.
    stress : (h,), highest von Mises stress of every hinge, MPa; in plane stress while it is far
    from yield.
    softest : least eigenvalue of the tangent stiffness of the motions that are not prescribed;
    negative if unstable."""

    unknowns: Array
    forces: Array
    motions: Array
    stress: Array
    softest: float


Placed: TypeAlias = tuple[float, PathPoint]  # at a displacement of the driven port


class PathEnd(NamedTuple):
    """End of a path: the displacement of the driven port, mm or rad, and the force on it, N or N
    mm.

    kind : `YIELD`, `BODY_YIELD`, `BUCKLING`, `CONTACT`, `STROKE` or `NO_LIMIT`.   at : the
    equilibrium.
    exponents : (2,), of the force and of the highest stress as powers of the displacement near the
    end.
    linear : (2,), force and highest stress per displacement at rest.
    parts : what touches or drives, and where; empty for the other kinds.   touching : numbers of
    the two parts."""

    displacement: float
    force: float
    kind: str
    at: PathPoint
    exponents: Array
    linear: Array
    parts: str = ""
    touching: tuple[int, int] | None = None


class PathLimits(NamedTuple):
    """What ends a path besides the yield of hinges and buckling.

    rest : the equilibrium at rest.   port : the driven one.
    body_stress : highest stress of bodies per force on it, MPa per N or N mm, zero if it is not
    known.
    contact : whether parts touch near the end.
    """

    rest: PathPoint
    port: int
    body_stress: float
    contact: bool = False


class DrivenPlate(FinitePlate):
    """A mechanism of beams whose ports are driven to prescribed motions, with the stress in its
    hinges.

    hinges : compliances (h, 3, 3) at the centres of the hinges, by default those of their profiles.
    stress_ratios : of the highest stress of the hinges to that in plane stress, by default one.
    """

    def __init__(
        self,
        layout: Layout,
        hinges: Array | None = None,
        stress_ratios: StressRatios | None = None,
        ports: Sequence[Port] | None = None,
    ) -> None:
        super().__init__(layout, hinges, ports)
        self.layout = layout
        self.stress_ratios = stress_ratios or (lambda wrenches: np.ones(len(wrenches)))
        self.alike = dict[Profile, list[int]]()
        for number, joint in enumerate(layout.joints):
            self.alike.setdefault(joint.profile, []).append(number)
        self.marks = {profile: divided_profile(profile, BEAMS) for profile in self.alike}
        self.out_of_plane = np.array(
            [layout.material_of(joint).out_of_plane for joint in layout.joints]
        )
        self.shares = layout.hinge_shares
        self.openings = np.array(layout.drive_ports, dtype=np.int64)
        self.strokes = np.array([actuator.stroke for actuator in layout.actuators])

    @cached_property
    def clearance(self) -> Clearance:
        """The gaps between the parts."""
        marks = np.array([self.marks[joint.profile] for joint in self.layout.joints])
        return Clearance(self.layout, self, marks)

    def wrenches(self, beams: Beams) -> Array:
        """Tension, transverse force and moment (h, beams, 3) at the centre of the hinge, as of
        `Profile.stress`.
        """
        found = np.zeros((self.hinges, BEAMS, 3))
        tension, near, far = beams.stress.reshape(-1, BEAMS, 3).transpose(2, 0, 1)
        bowed = tension[:, :, None] * beams.bent.reshape(
            -1, BEAMS, 2
        )  # moments of the tension of a bent beam
        near = near + bowed[:, :, 0]
        far = far + bowed[:, :, 1]
        for profile, numbers in self.alike.items():
            ends = self.marks[profile]
            shear = -(near[numbers] + far[numbers]) / np.diff(ends)
            found[numbers, :, 0] = tension[numbers]
            found[numbers, :, 1] = shear
            found[numbers, :, 2] = far[numbers] + shear * ends[1:]
        return found

    def plane_stress(self, wrenches: Array) -> Array:
        """Highest von Mises stress (h,), MPa, in plane stress, of hinges under wrenches (h, beams,
        3) of beams.

        That of a hinge of another material is multiplied by `Layout.hinge_shares`.
        """
        found = np.zeros(self.hinges)
        for profile, numbers in self.alike.items():
            x = profile.sections
            beam = np.clip(np.searchsorted(self.marks[profile], x, side="right") - 1, 0, BEAMS - 1)
            ratio = self.out_of_plane[numbers][:, None]
            stress = profile.section_stress(
                x, wrenches[numbers][:, beam], self.layout.thickness, ratio
            )
            found[numbers] = stress.max(axis=-1)
        return found * self.shares

    def stress(self, q: Array) -> Array:
        """Highest von Mises stress (h,), MPa, of every hinge at unknowns q (size,)."""
        wrenches = self.wrenches(self.deformed(q))
        return self.plane_stress(wrenches) * self.stress_ratios(_at_centre(wrenches))

    def driven(self, q: Array, f: Array, ports: Sequence[int], targets: Array) -> PathPoint | None:
        """Return the equilibrium with motions (p,) of ports; None if Newton's method does not
        converge.

        q, f : unknowns (size,) and forces on the ports (k,) to start from.
        """
        f = f.copy()
        held = list(ports)
        for _ in range(ITERATIONS):
            at = self.state(q, f)
            step, more = self._step(at, at.P[:, held], targets - at.motions[held])
            if not np.isfinite(step).all():
                return None
            size = self._size(step)
            share = min(1.0, LARGEST / max(size, CLOSE))
            q = q + share * step
            f[held] += share * more
            if size < CLOSE:
                return self.described(q, f, held)
        return None

    def described(self, q: Array, f: Array, ports: Sequence[int]) -> PathPoint:
        """Return the equilibrium at unknowns (size,) under forces (k,), of which those on some
        ports hold them.
        """
        at = self.state(q, f)
        inner, joined = self._by_hinges(at.K)
        inside = np.einsum("hia,hib->ab", joined, np.linalg.solve(inner, joined), optimize=True)
        reduced = at.K[: self.rigid, : self.rigid] - inside
        free = np.linalg.qr(at.P[: self.rigid, list(ports)], mode="complete")[0][:, len(ports) :]
        softest = float(np.linalg.eigvalsh(inner)[:, 0].min())
        if free.shape[1]:
            softest = min(softest, float(np.linalg.eigvalsh(free.T @ reduced @ free)[0]))
        wrenches = self.wrenches(self.deformed(q))
        stress = self.plane_stress(wrenches)
        if stress.max() > NEAR * self.layout.yield_strength:
            stress = stress * self.stress_ratios(_at_centre(wrenches))
        return PathPoint(q, f, at.motions, stress, softest)

    def curve_point(self, q: Array, f: Array) -> CurvePoint:
        """Return the equilibrium at unknowns q (size,) under dead loads (k,)."""
        at = self.state(q, f)
        compliance = at.P.T @ np.linalg.solve(at.K, at.P)
        return CurvePoint(at.motions, f, compliance, self._negative_pivots(at.K), np.nan, q)

    def on_line(self, near: CurvePoint, port: int, line: Line) -> CurvePoint | None:
        """Return the equilibrium under a load on a port at which its motion u and the load f are on
        a line.

        near : an equilibrium to start from.   line : a, b and c of `a u + b f = c`.
        """
        q = near.state
        f = near.loads.copy()
        a, b, c = line
        for _ in range(ITERATIONS):
            at = self.state(q, f)
            goal = c - a * at.motions[port] - b * f[port]
            step, more = self._step(at, at.P[:, [port]], np.array([goal]), (a, b))
            if not (np.isfinite(step).all() and np.isfinite(more).all()):
                return None
            size = self._size(step)
            share = min(1.0, LARGEST / max(size, CLOSE))
            q = q + share * step
            f[port] += share * more[0]
            if size < CLOSE:
                return self.curve_point(q, f)
        return None

    def _size(self, step: Array) -> float:
        """Return the largest rotation, rad, or displacement per size of the mechanism, of a change
        (size,).
        """
        shift = np.abs(step.reshape(-1, 3)[:, :2]).max() / self.extent
        return max(float(np.abs(step[2::3]).max()), float(shift))

    def _negative_pivots(self, K: Array) -> int:
        """Return the number of negative eigenvalues of a tangent, with the nodes inside hinges
        eliminated first.
        """
        inner, joined = self._by_hinges(K)
        inside = np.einsum("hia,hib->ab", joined, np.linalg.solve(inner, joined), optimize=True)
        reduced = K[: self.rigid, : self.rigid] - inside
        return int(np.sum(np.linalg.eigvalsh(inner) < 0) + np.sum(np.linalg.eigvalsh(reduced) < 0))

    def _by_hinges(self, K: Array) -> tuple[Array, Array]:
        """Tangent (h, i, i) of the nodes inside every hinge, and its columns (h, i, r) for the
        bodies.
        """
        n = self.rigid
        each = np.arange(self.hinges)
        inner = K[n:, n:].reshape(self.hinges, 3 * (BEAMS - 1), self.hinges, -1)
        return inner[each, :, each], K[n:, :n].reshape(self.hinges, -1, n)

    def _step(
        self,
        at: BeamState,
        loads: Array,
        motion: Array,
        weights: tuple[float, float] = (1.0, 0.0),
    ) -> tuple[Array, Array]:
        """Return the changes of the unknowns (size,) and of the forces (p,) on ports by which a sum
        changes by (p,).

        The sum is that of the motions and the forces of the ports with two weights: by default the
        motions alone."""
        n = self.rigid
        p = len(motion)
        inner, joined = self._by_hinges(at.K)
        left = at.left[n:].reshape(self.hinges, -1, 1)
        solved = np.linalg.solve(inner, np.concatenate([joined, left], axis=2))
        onto = np.einsum("hia,hib->ab", joined, solved, optimize=True)
        bordered = np.zeros((n + p, n + p))
        bordered[:n, :n] = at.K[:n, :n] - onto[:, :n]
        bordered[:n, n:] = -loads[:n]
        bordered[n:, :n] = weights[0] * loads[:n].T
        bordered[n:, n:] = weights[1] * np.eye(p)
        found = np.linalg.solve(bordered, np.concatenate([at.left[:n] - onto[:, n], motion]))
        inside = solved[:, :, n] - solved[:, :, :n] @ found[:n]
        return np.concatenate([found[:n], inside.ravel()]), found[n:]

    def end(
        self, port: int, held: Sequence[int], scale: float, body_stress: float = 0.0
    ) -> PathEnd:
        """Follow a path from rest to its end: the first limit of those of `PathEnd`.

        port : the driven one.   held : ports whose motions stay zero.
        scale : its displacement, mm or rad, with a sign, at which linear theory expects a hinge to
        yield.
        body_stress : as of `PathLimits`.
        """
        ports = [port, *held]
        rest = self.described(np.zeros(self.size), np.zeros(self.ports), ports)
        limits = PathLimits(rest, port, body_stress)
        path = [(0.0, rest)]
        step = scale / STEPS
        linear = self.slopes(port, held, scale)
        for _ in range(MOST_STEPS):
            before = path[-1][0]
            after, touching = self._before_contact(path, ports, before + step)
            if after is None:
                step /= 4
                if abs(step) < SMALLEST_STEP * abs(before + step):
                    return _ended(path, path[-1], port, BUCKLING, linear)
                continue
            limits = limits._replace(contact=touching)
            if min(self._margins(after[1], limits).values()) <= 0:
                return self._between(path, after, ports, limits, linear)
            step = (after[0] - before) * (GROWTH if abs(after[0]) > abs(scale) else 1.0)
            path = [*path[-2:], after]
        return _ended(path, path[-1], port, NO_LIMIT, linear)

    def _before_contact(
        self, path: Sequence[Placed], ports: Sequence[int], x: float
    ) -> tuple[Placed | None, bool]:
        """Return the equilibrium at a displacement x, or at a smaller one where parts already
        touch, and if they do.
        """
        at = self._continued(path, ports, x)
        if at is None:
            return None, False
        before, last = path[-1]
        share = self.clearance.share_to_contact(last.unknowns, at.unknowns)
        if share is None:
            return (x, at), False
        x = before + share * (x - before)
        at = self._continued(path, ports, x)
        return (None if at is None else (x, at)), True

    def slopes(self, port: int, held: Sequence[int], scale: float) -> Array:
        """Return the force and the highest stress (2,) per displacement of a port at rest."""
        ports = [port, *held]
        x = SMALL_STEP * scale
        rest = self.described(np.zeros(self.size), np.zeros(self.ports), ports)
        at = self._continued([(0.0, rest)], ports, x)
        if at is None:
            raise ComputationFailed("no equilibrium near rest: a hinge is far stiffer than others")
        return np.array([at.forces[port] / x, np.max(self.stress(at.unknowns)) / abs(x)])

    def reached(self, port: int, held: Sequence[int], x: float) -> PathPoint | None:
        """Return the equilibrium at a displacement of a port, reached in steps from rest; None
        without one.
        """
        ports = [port, *held]
        path = [(0.0, self.described(np.zeros(self.size), np.zeros(self.ports), ports))]
        done = 0.0
        share = 1 / STEPS
        for _ in range(MOST_STEPS):
            after = done + share
            if after > 1 - SMALLEST_STEP * share:  # also by round-off of the sum
                after = 1.0
            found = self._continued(path, ports, after * x)
            if found is None:
                share /= 4
                continue
            if after == 1.0:
                return found
            done = after
            path = [*path[-2:], (done * x, found)]
        return None

    def _margins(self, at: PathPoint, limits: PathLimits) -> dict[str, float]:
        """Distances from the limits, about 1 at rest and 0 at a limit."""
        strength = self.layout.yield_strength
        found = {
            YIELD: 1 - float(at.stress.max()) / strength,
            BUCKLING: at.softest / limits.rest.softest,
            BODY_YIELD: 1 - limits.body_stress * abs(float(at.forces[limits.port])) / strength,
        }
        if limits.contact:
            found[CONTACT] = self.clearance.smallest(at.unknowns)[0]
        if len(self.strokes):
            found[STROKE] = float(np.min(1 - at.motions[self.openings] / self.strokes))
        return found

    def _continued(
        self, path: Sequence[Placed], ports: Sequence[int], x: float
    ) -> PathPoint | None:
        """Return the equilibrium at a displacement x, from the polynomial through others."""
        places = np.array([place for place, _ in path])
        weights = list[float]()
        for number, place in enumerate(places):
            others = np.delete(places, number)
            weights.append(float(np.prod((x - others) / (place - others))))
        q = np.tensordot(weights, [at.unknowns for _, at in path], axes=1)
        f = np.tensordot(weights, [at.forces for _, at in path], axes=1)
        return self.driven(q, f, ports, np.eye(len(ports))[0] * x)

    def _between(
        self,
        path: Sequence[Placed],
        beyond: Placed,
        ports: Sequence[int],
        limits: PathLimits,
        linear: Array,
    ) -> PathEnd:
        """Return the limit between the last equilibrium of a path and one beyond it, by the
        Illinois method.
        """
        inside = list(path)
        low = path[-1][0]
        high = beyond[0]
        below = min(self._margins(path[-1][1], limits).values())
        above = min(self._margins(beyond[1], limits).values())
        x, at = beyond
        for _ in range(MOST_STEPS):
            last = x
            x = low + (high - low) * below / (below - above)
            if abs(x - low) < FINEST * abs(
                x
            ):  # two points at one place have no polynomial through them
                x, at = inside[-1]
                break
            found = self._continued(inside[-3:], ports, x)
            if found is None:
                x = last
                break
            at = found
            margin = min(self._margins(at, limits).values())
            if abs(margin) < FINEST or abs(x - last) < FINEST * abs(x):
                break
            if margin > 0:
                low = x
                below = margin
                above = above / 2
                inside.append((x, found))
            else:
                high = x
                above = margin
                below = below / 2
        margins = self._margins(at, limits)
        kind = min(margins, key=lambda name: margins[name])
        end = _ended(path, (x, at), ports[0], kind, linear)
        gap = self.clearance.smallest(at.unknowns)[1] if kind == CONTACT else None
        if gap is not None:
            end = end._replace(parts=self.clearance.said(gap), touching=gap.parts)
        if kind == STROKE:
            end = end._replace(parts=drive_at_stroke(self.layout, at.motions))
        return end


def drive_at_stroke(layout: Layout, motions: Array) -> str:
    """Return the name of the actuator that is nearest to its stroke, at motions (k,) of the ports."""
    shares = [
        motions[port] / each.stroke
        for port, each in zip(layout.drive_ports, layout.actuators, strict=True)
    ]
    return repr(layout.actuators[int(np.argmax(shares))].name)


def _at_centre(wrenches: Array) -> Array:
    """Return the wrenches (h, 3) in the middle of hinges from those (h, beams, 3) of their beams."""
    return np.asarray(wrenches[:, BEAMS // 2 - 1 : BEAMS // 2 + 1].mean(axis=1))


def _ended(path: Sequence[Placed], last: Placed, port: int, kind: str, linear: Array) -> PathEnd:
    """Return the end of a path; near it the force and the stress are powers of the displacement."""
    x, at = last
    earlier = [one for one in path if 0 < abs(one[0]) < (1 - APART) * abs(x)]
    exponents = np.ones(2)
    if earlier:
        place, before = earlier[-1]
        changes = [at.forces[port] / before.forces[port], at.stress.max() / before.stress.max()]
        exponents = np.log(np.abs(changes)) / np.log(x / place)
    return PathEnd(x, float(at.forces[port]), kind, at, exponents, linear)
