"""Equilibrium paths of a mechanism that is driven to finite displacements, and where they end.

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
from flexfem.analytic.finite import BEAMS, Beams, BeamState, FinitePlate, divided_profile
from flexfem.arrays import Array
from flexfem.mechanism.curves import CurvePoint, Line
from flexfem.mechanism.layout import Layout, Port
from flexfem.mechanism.profile import Profile
from flexfem.refused import ComputationFailed

STEPS = 6  # from rest to the displacement at which linear theory yields
GROWTH = 1.25  # of the steps beyond it
REGROWTH = 2.0  # of a step after one that had to be smaller than usual
MOST_STEPS = 400
FARTHEST = (
    1000.0  # of the displacement at which linear theory yields, beyond which none is looked for
)
# relative change of the least eigenvalue in one step, and its least value, of that at rest, to which
# it is relative: where parts buckle another path is near, to which a larger step can lead
MOST_CHANGE = 0.3
LEAST_EIGENVALUE = 0.1
MOST_OFF = 1.0  # distance of the unknowns from the tangent of the path, over the step along it
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

    unknowns : (size,), of `FinitePlate`.
    forces : (k,), on the ports, N and N mm.   motions : (k,), of the ports, mm and rad.
    stress : (h,), highest von Mises stress of every hinge, MPa; in plane stress while it is far
        from yield.
    softest : least eigenvalue of the tangent stiffness of the motions that are not prescribed;
        negative if unstable.
    """

    unknowns: Array
    forces: Array
    motions: Array
    stress: Array
    softest: float


class Placed(NamedTuple):
    """An equilibrium at a displacement x of the driven port, mm or rad."""

    x: float
    at: PathPoint


class PathEnd(NamedTuple):
    """End of a path: displacement of the driven port, mm or rad, and force on it, N or N mm.

    kind : `YIELD`, `BODY_YIELD`, `BUCKLING`, `CONTACT`, `STROKE` or `NO_LIMIT`.
    at : the equilibrium.
    exponents : (2,), of the force and of the highest stress as powers of the displacement near the
        end.
    linear : (2,), force and highest stress per displacement at rest.
    parts : what touches or drives, and where; empty for the other kinds.
    touching : numbers of the two parts.
    softest, softest_at : least eigenvalue on the path over that at rest, and its displacement.
    """

    displacement: float
    force: float
    kind: str
    at: PathPoint
    exponents: Array
    linear: Array
    parts: str = ""
    touching: tuple[int, int] | None = None
    softest: float = 1.0
    softest_at: float = 0.0


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
    """A mechanism of beams whose ports are driven to prescribed motions.

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

    @cached_property
    def rest(self) -> tuple[Array, Array]:
        """Unknowns (size,) and forces on the ports (k,) at rest, all zero."""
        return np.zeros(self.size), np.zeros(self.ports)

    def wrenches(self, beams: Beams) -> Array:
        """Tension, transverse force and moment (h, beams, 3) as of `Profile.stress`.

        They are taken at the centre of the hinge.
        """
        found = np.zeros((self.hinges, BEAMS, 3))
        tension, near, far = beams.stress.reshape(-1, BEAMS, 3).transpose(2, 0, 1)
        # moments of the tension of a bent beam
        bowed = tension[:, :, None] * beams.bent.reshape(-1, BEAMS, 2)
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
        """Highest von Mises stress (h,), MPa, in plane stress by wrenches (h, beams, 3).

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

    def driven(
        self,
        q: Array,
        f: Array,
        ports: Sequence[int],
        targets: Array,
    ) -> PathPoint | None:
        """Return the equilibrium with motions (p,) of ports; None as of `converged`.

        q, f : unknowns (size,) and forces on the ports (k,) to start from.
        """
        forces = f.copy()
        held = list(ports)

        def step(x: Array) -> Array:
            forces[held] = x[self.size :]
            at = self.state(x[: self.size], forces)
            return self._step(at, at.P[:, held], targets - at.motions[held])

        found = self.converged(np.concatenate([q, f[held]]), step)
        if found is None:
            return None
        forces[held] = found[self.size :]
        return self.described(found[: self.size], forces, held)

    def tangent(self, at: PathPoint, ports: Sequence[int]) -> Array:
        """Return the changes of the unknowns (size,) per motion of the first of several ports."""
        state = self.state(at.unknowns, at.forces)
        first = np.eye(len(ports))[0]
        found = self._step(state._replace(left=np.zeros(self.size)), state.P[:, list(ports)], first)
        return found[: self.size]

    def described(
        self,
        q: Array,
        f: Array,
        ports: Sequence[int],
    ) -> PathPoint:
        """Return the equilibrium at unknowns (size,) under forces (k,).

        ports : those at which forces hold the motions.
        """
        at = self.state(q, f)
        inner, reduced = self._reduced(at.K)
        free = np.linalg.qr(at.P[: self.rigid, list(ports)], mode="complete")[0][:, len(ports) :]
        softest = float(np.linalg.eigvalsh(inner)[:, 0].min())
        if free.shape[1]:
            softest = min(softest, float(np.linalg.eigvalsh(free.T @ reduced @ free)[0]))
        wrenches = self.wrenches(self.deformed(q))
        stress = self.plane_stress(wrenches)
        if stress.max() > NEAR * self.layout.yield_strength:
            stress = stress * self.stress_ratios(_at_centre(wrenches))
        return PathPoint(q, f, at.motions, stress, softest)

    def curve_point(
        self,
        q: Array,
        f: Array,
    ) -> CurvePoint:
        """Return the equilibrium at unknowns q (size,) under dead loads (k,)."""
        at = self.state(q, f)
        compliance = at.P.T @ np.linalg.solve(at.K, at.P)
        return CurvePoint(at.motions, f, compliance, self._negative_pivots(at.K), np.nan, q)

    def on_line(
        self,
        near: CurvePoint,
        port: int,
        line: Line,
    ) -> CurvePoint | None:
        """Return the equilibrium at which motion u and load f of a port are on a line.

        near : an equilibrium to start from.   line : a, b and c of `a u + b f = c`.
        """
        forces = near.loads.copy()
        a, b, c = line

        def step(x: Array) -> Array:
            forces[port] = x[self.size]
            at = self.state(x[: self.size], forces)
            goal = c - a * at.motions[port] - b * forces[port]
            return self._step(at, at.P[:, [port]], np.array([goal]), (a, b))

        found = self.converged(np.append(near.state, forces[port]), step)
        if found is None:
            return None
        forces[port] = found[self.size]
        return self.curve_point(found[: self.size], forces)

    def _negative_pivots(self, K: Array) -> int:
        """Return the number of negative eigenvalues of a tangent (size, size)."""
        return sum(int(np.sum(np.linalg.eigvalsh(part) < 0)) for part in self._reduced(K))

    def _reduced(self, K: Array) -> tuple[Array, Array]:
        """Tangent (h, i, i) of the nodes inside every hinge, and that of the bodies (r, r).

        The nodes inside hinges are eliminated from the latter.
        """
        inner, joined = self._by_hinges(K)
        inside = np.einsum("hia,hib->ab", joined, np.linalg.solve(inner, joined), optimize=True)
        return inner, K[: self.rigid, : self.rigid] - inside

    def _by_hinges(self, K: Array) -> tuple[Array, Array]:
        """Tangent (h, i, i) of nodes inside every hinge, and columns (h, i, r) for bodies."""
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
    ) -> Array:
        """Return the changes (size + p,) of the unknowns and of the forces on p ports.

        loads : (size, p), of unit forces on the ports.
        motion : (p,), change of the sum of motions and forces of the ports with two `weights`: by
            default of the motions alone.
        """
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
        return np.concatenate([found[:n], inside.ravel(), found[n:]])

    def end(
        self, port: int, held: Sequence[int], scale: float, body_stress: float = 0.0
    ) -> PathEnd:
        """Follow a path from rest to its end: the first limit of those of `PathEnd`.

        port : the driven one.   held : ports whose motions stay zero.
        scale : its displacement, mm or rad, with a sign, at which linear theory expects a hinge to
            yield.
        body_stress : as of `PathLimits`.
        """
        path = _Path(self, [port, *held])
        limits = PathLimits(path.rest, port, body_stress)
        linear = self.slopes(port, held, scale)
        usual = scale / STEPS
        step = usual
        for _ in range(MOST_STEPS):
            before = path.last.x
            following, touching = path.before_contact(before + step)
            if following is None:
                step /= 4
                if abs(step) < SMALLEST_STEP * abs(before + step):
                    return path.ended(path.last, BUCKLING, linear)
                continue
            limits = limits._replace(contact=touching)
            if self.least_margin(following.at, limits).value <= 0:
                return path.limit_before(following, limits, linear)
            path.extend(following)
            if abs(following.x) > FARTHEST * abs(scale):
                break
            if abs(following.x) > abs(scale):
                usual *= GROWTH
            regrown = REGROWTH * (following.x - before)
            step = min(usual, regrown, key=abs)
        return path.ended(path.last, NO_LIMIT, linear)

    def slopes(
        self,
        port: int,
        held: Sequence[int],
        scale: float,
    ) -> Array:
        """Return the force and the highest stress (2,) per displacement of a port at rest."""
        x = SMALL_STEP * scale
        at = _Path(self, [port, *held]).continued(x)
        if at is None:
            raise ComputationFailed("no equilibrium near rest: a hinge is far stiffer than others")
        return np.array([at.forces[port] / x, np.max(self.stress(at.unknowns)) / abs(x)])

    def reached(
        self,
        port: int,
        held: Sequence[int],
        x: float,
    ) -> PathPoint | None:
        """Return the equilibrium at a displacement of a port, in steps from rest; else None."""
        path = _Path(self, [port, *held])
        done = 0.0
        share = 1 / STEPS
        for _ in range(MOST_STEPS):
            after = done + share
            if after > 1 - SMALLEST_STEP * share:  # also by round-off of the sum
                after = 1.0
            found = path.followed(after * x)
            if found is None:
                share /= 4
                if share < SMALLEST_STEP * after:
                    return None
                continue
            if after == 1.0:
                return found
            share = min(1 / STEPS, REGROWTH * (after - done))
            done = after
            path.extend(Placed(done * x, found))
        return None

    def least_margin(
        self,
        at: PathPoint,
        limits: PathLimits,
    ) -> Margin:
        """Return the limit nearest to an equilibrium: about 1 from it at rest and 0 at it."""
        strength = self.layout.yield_strength
        of_body = limits.body_stress * abs(float(at.forces[limits.port]))
        found = [
            Margin(1 - float(at.stress.max()) / strength, YIELD),
            Margin(at.softest / limits.rest.softest, BUCKLING),
            Margin(1 - of_body / strength, BODY_YIELD),
        ]
        if limits.contact:
            found.append(Margin(self.clearance.smallest(at.unknowns)[0], CONTACT))
        if len(self.strokes):
            unused = 1 - at.motions[self.openings] / self.strokes
            found.append(Margin(float(np.min(unused)), STROKE))
        return min(found, key=lambda margin: margin.value)


class Margin(NamedTuple):
    """Distance of an equilibrium from a limit of a kind of `PathEnd`."""

    value: float
    kind: str


class _Bracket(NamedTuple):
    """Two displacements of the driven port between which a margin changes its sign.

    low, high : mm or rad.   below, above : margins there, halved as by the Illinois method.
    """

    low: float
    high: float
    below: float
    above: float

    @property
    def middle(self) -> float:
        """Where the line through both margins is zero."""
        return self.low + (self.high - self.low) * self.below / (self.below - self.above)

    def narrowed(
        self,
        x: float,
        margin: float,
    ) -> _Bracket:
        """Return the part of the bracket with a change of sign, from the margin at x.

        The least eigenvalue has a pole where the inside of a hinge is singular: a margin far below
        zero counts as twice that on the other side.
        """
        if margin > 0:
            return _Bracket(x, self.high, margin, self.above / 2)
        return _Bracket(self.low, x, self.below / 2, max(margin, -2 * self.below))


class _Path:
    """Equilibria of a driven plate at growing displacements of the first of several ports.

    The motions of the other ports stay zero. The last three equilibria are kept.
    """

    def __init__(
        self,
        plate: DrivenPlate,
        ports: Sequence[int],
    ) -> None:
        self.plate = plate
        self.ports = list(ports)
        self.rest = plate.described(*plate.rest, self.ports)
        self.placed = [Placed(0.0, self.rest)]
        self.softest = self.placed[0]

    @property
    def last(self) -> Placed:
        return self.placed[-1]

    def extend(self, following: Placed) -> None:
        """Add an equilibrium beyond the last one."""
        self.placed = [*self.placed[-2:], following]
        if following.at.softest < self.softest.at.softest:
            self.softest = following

    def continued(self, x: float) -> PathPoint | None:
        """Return the equilibrium at a displacement x, from the polynomial through others.

        None as of `FinitePlate.converged`.
        """
        places = np.array([one.x for one in self.placed])
        weights = list[float]()
        for number, place in enumerate(places):
            others = np.delete(places, number)
            weights.append(float(np.prod((x - others) / (place - others))))
        q = np.tensordot(weights, [one.at.unknowns for one in self.placed], axes=1)
        f = np.tensordot(weights, [one.at.forces for one in self.placed], axes=1)
        return self.plate.driven(q, f, self.ports, np.eye(len(self.ports))[0] * x)

    def followed(self, x: float) -> PathPoint | None:
        """Return the equilibrium at a displacement x, None if there is none or it may be on another
        path: the step is too large then.
        """
        at = self.continued(x)
        if at is None:
            return None
        before = self.last.at
        largest = MOST_CHANGE * max(before.softest, LEAST_EIGENVALUE * self.rest.softest)
        if abs(at.softest - before.softest) > largest:
            return None
        along = self.plate.tangent(before, self.ports) * (x - self.last.x)
        off = np.linalg.norm(at.unknowns - before.unknowns - along)
        return at if off <= MOST_OFF * np.linalg.norm(along) else None

    def before_contact(self, x: float) -> tuple[Placed | None, bool]:
        """Return the equilibrium at a displacement x, or at a smaller one where parts touch.

        The second value states whether parts touch.
        """
        at = self.followed(x)
        if at is None:
            return None, False
        last = self.last
        share = self.plate.clearance.share_to_contact(last.at.unknowns, at.unknowns)
        if share is None:
            return Placed(x, at), False
        x = last.x + share * (x - last.x)
        at = self.continued(x)
        return None if at is None else Placed(x, at), True

    def limit_before(
        self,
        beyond: Placed,
        limits: PathLimits,
        linear: Array,
    ) -> PathEnd:
        """Return the limit between the last equilibrium and one beyond, by the Illinois method."""
        plate = self.plate
        inside = _Path(plate, self.ports)
        inside.placed = self.placed
        bracket = _Bracket(
            self.last.x,
            beyond.x,
            plate.least_margin(self.last.at, limits).value,
            plate.least_margin(beyond.at, limits).value,
        )
        found = beyond
        for _ in range(MOST_STEPS):
            x = bracket.middle
            if abs(x - bracket.low) < FINEST * abs(x):
                found = inside.last  # two points at one place have no polynomial through them
                break
            at = inside.continued(x)
            if at is None:  # next to a bifurcation, where the tangent is singular
                bracket = bracket._replace(high=x)
                continue
            change = abs(x - found.x)
            found = Placed(x, at)
            margin = plate.least_margin(at, limits).value
            if abs(margin) < FINEST or change < FINEST * abs(x):
                break
            bracket = bracket.narrowed(x, margin)
            if margin > 0:
                inside.extend(found)
        return self._with_parts(
            self.ended(found, plate.least_margin(found.at, limits).kind, linear)
        )

    def _with_parts(self, end: PathEnd) -> PathEnd:
        """Return the end of a path with the parts that touch, or the actuator at its stroke."""
        if end.kind == CONTACT:
            gap = self.plate.clearance.smallest(end.at.unknowns)[1]
            if gap is not None:
                return end._replace(parts=self.plate.clearance.said(gap), touching=gap.parts)
        if end.kind == STROKE:
            return end._replace(parts=drive_at_stroke(self.plate.layout, end.at.motions))
        return end

    def ended(
        self,
        last: Placed,
        kind: str,
        linear: Array,
    ) -> PathEnd:
        """Return the end of the path; near it force and stress are powers of the displacement."""
        x, at = last
        port = self.ports[0]
        earlier = [one for one in self.placed if 0 < abs(one.x) < (1 - APART) * abs(x)]
        exponents = np.ones(2)
        if earlier:
            place, before = earlier[-1]
            changes = [at.forces[port] / before.forces[port], at.stress.max() / before.stress.max()]
            exponents = np.log(np.abs(changes)) / np.log(x / place)
        return PathEnd(
            x,
            float(at.forces[port]),
            kind,
            at,
            exponents,
            linear,
            softest=self.softest.at.softest / self.rest.softest,
            softest_at=self.softest.x,
        )


def drive_at_stroke(layout: Layout, motions: Array) -> str:
    """Return the name of the actuator nearest to its stroke, at motions (k,) of the ports."""
    strokes = np.array([actuator.stroke for actuator in layout.actuators])
    nearest = int(np.argmax(motions[list(layout.drive_ports)] / strokes))
    return repr(layout.actuators[nearest].name)


def _at_centre(wrenches: Array) -> Array:
    """Return the wrenches (h, 3) in the middle of hinges from those (h, beams, 3) of beams."""
    return np.asarray(wrenches[:, BEAMS // 2 - 1 : BEAMS // 2 + 1].mean(axis=1))
