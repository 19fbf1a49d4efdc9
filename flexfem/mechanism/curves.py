"""Curves of force against displacement of a driven port, for any model that finds an equilibrium on
a line.

The line `a u + b f = c` in the plane of the displacement u and the force f prescribes the
displacement (b = 0) wherever the curve can be passed by this, and otherwise is normal to the curve:
control of the arc length. The tangent compliance of the port and the number of negative pivots of
the tangent stiffness show where the curve has a limit, where it branches, and which equilibria are
stable. E. Riks, Int. J. Solids Structures 15 (1979) 529; M. A. Crisfield, Non-linear Finite Element
Analysis 1, 1991, chapter 9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import Array

FIRST_STEP = 1 / 16
LARGEST_STEP = 1 / 5
LEAST_STEP = 1e-5  # of the displacement asked for, or of the largest force
# of the force by linear theory at the displacement asked for: the first guess of the largest force
FIRST_FORCE = 0.1
GROWTH = 1.5  # of a step after one that is accepted
# displacement of a step, per displacement asked for, below which the force is no longer its result
STEEP = 0.1
# cosine of the angle between tangents before and after a step; a step that turns more is divided
TURN = 0.5
MOST_POINTS = 400
REFINED = 6  # equilibria that locate a limit at most
LEAST_SHARE = 0.02  # of an interval, at which a limit is sought near its ends
FOUND = 1e-6  # of the tangent, or of the largest force, at a limit
HALVED = 7  # times that an interval with a bifurcation is halved
AMPLIFIED = 10.0  # growth of a compliance at a bifurcation from which its port takes part
LONGEST_JUMP = 4  # points of a curve that another model passes at once
# distance of the equilibria of two models, as shares, up to which they are on one branch
NEAR = 0.15
HIGHEST = "limit of the force"
FURTHEST = "limit of the displacement"
WITHOUT_FORCE = "no force"
BIFURCATION = "branch"


class CurvePoint(NamedTuple):
    """An equilibrium under a load on one port, of a mechanism with k ports.

    motions, loads : (k,), mm and rad, N and N mm.   compliance : (k, k), tangent, between the
    ports.
    unstable : number of negative pivots of the tangent stiffness under the dead load.   strain :
    the largest, or nan.
    state : unknowns of the model.
    """

    motions: Array
    loads: Array
    compliance: Array
    unstable: int
    strain: float
    state: Any


Line: TypeAlias = tuple[float, float, float]  # a, b and c of `a u + b f = c`
UNLOADED: Line = (0.0, 1.0, 0.0)
Reach: TypeAlias = Callable[[CurvePoint, Line], CurvePoint | None]
"""Function that returns the equilibrium on a line near another equilibrium, or None without one."""


class Event(NamedTuple):
    """A point of a curve where its stability changes, or that needs no force.

    kind : `HIGHEST` or `FURTHEST`, where force or displacement has an extremum; `WITHOUT_FORCE`;
    `BIFURCATION`.
    port : at a bifurcation, the one that takes part; -1 if none does.
    bend : at an extremum, change of the slope from the point before, per displacement or, of
    `FURTHEST`, per force.
    """

    kind: str
    at: CurvePoint
    port: int = -1
    bend: float = np.nan


class ForceCurve(NamedTuple):
    """Equilibria along a curve from rest, and its events in their order, each after the point of a
    number.

    lines : across the curve at every point.   complete : whether it reaches the displacement asked
    for.
    scale : (2,), largest displacement and force.
    """

    points: list[CurvePoint]
    events: list[tuple[int, Event]]
    lines: list[Line]
    complete: bool
    scale: Array


class _Placed(NamedTuple):
    """A point of a curve, its place (2,) and tangent (2,) as shares of the largest displacement and
    force.
    """

    at: CurvePoint
    place: Array
    tangent: Array


class Followed:
    """A curve of one port that is followed from rest to a displacement, mm or rad, with a sign."""

    def __init__(
        self,
        reach: Reach,
        port: int,
        displacement: float,
    ) -> None:
        self.reach = reach
        self.port = port
        self.end = displacement
        self.sign = 1.0 if displacement > 0 else -1.0
        self.scale = np.array([abs(displacement), 0.0])

    def curve(self, rest: CurvePoint) -> ForceCurve:
        """Follow the curve from rest, and find its events."""
        self.scale[1] = FIRST_FORCE * abs(self.end) / abs(rest.compliance[self.port, self.port])
        points = [self._placed(rest, np.array([self.sign, 0.0]))]
        step = FIRST_STEP
        while len(points) < MOST_POINTS and step > LEAST_STEP and not self._is_at_end(points[-1]):
            after = self._after(points[-1], step)
            if after is None:
                step /= 2
                continue
            points.append(after)
            self.scale[1] = max(self.scale[1], abs(float(after.at.loads[self.port])))
            step = min(GROWTH * step, LARGEST_STEP)
            points[-1] = self._placed(after.at, after.tangent)
            if self.sign * after.at.motions[self.port] < -abs(self.end):
                break  # it turned back, and went as far on the other side
        points = [self._placed(point.at, point.tangent) for point in points]  # by the final scale
        events = list[tuple[int, Event]]()
        for number, (one, other) in enumerate(pairwise(points)):
            events += [(number, event) for event in self._events(one, other, rest)]
        lines = [self._across(point.tangent, point.place) for point in points]
        return ForceCurve(
            [point.at for point in points], events, lines, self._is_at_end(points[-1]), self.scale
        )

    def _values(self, at: CurvePoint) -> Array:
        """Displacement and force (2,) of the port."""
        return np.array([at.motions[self.port], at.loads[self.port]])

    def _placed(
        self,
        at: CurvePoint,
        along: Array,
    ) -> _Placed:
        """Return a point with its tangent, which points to the same side as `along` (2,)."""
        tangent = np.array([at.compliance[self.port, self.port], 1.0]) / self.scale
        tangent /= np.hypot(*tangent)
        return _Placed(
            at, self._values(at) / self.scale, tangent * (1.0 if tangent @ along >= 0 else -1.0)
        )

    def _is_at_end(self, point: _Placed) -> bool:
        return bool(self.sign * point.at.motions[self.port] >= abs(self.end) * (1 - LEAST_STEP))

    def _after(
        self,
        before: _Placed,
        step: float,
    ) -> _Placed | None:
        """Return the next point.

        None if there is none, or if the curve turns too far on the way.
        """
        goal = before.place + step * before.tangent
        if abs(before.tangent[0]) > STEEP:
            u = goal[0] * self.scale[0]
            line = (1.0, 0.0, self.sign * min(self.sign * u, abs(self.end)))
        else:
            line = self._across(before.tangent, goal)
        at = self.reach(before.at, line)
        if at is None:
            return None
        way = self._values(at) / self.scale - before.place
        after = self._placed(at, way)
        if (
            self.held_unstable(at) == self.held_unstable(before.at)
            and before.tangent[0] * after.tangent[0] < 0
        ):
            # the displacement has no limit in between
            after = after._replace(tangent=-after.tangent)
        chord = way / np.hypot(*way)
        turned = float(
            min(before.tangent @ after.tangent, before.tangent @ chord, after.tangent @ chord)
        )
        jumped = abs(at.unstable - before.at.unstable) > 1
        if (turned < TURN or jumped) and step > LARGEST_STEP * LEAST_STEP**0.5:
            return None
        return after

    def _across(
        self,
        tangent: Array,
        goal: Array,
    ) -> Line:
        """Return the line through a goal (2,) across a tangent (2,), both in shares."""
        a, b = tangent / self.scale
        return float(a), float(b), float(tangent @ goal)

    def _events(
        self,
        one: _Placed,
        other: _Placed,
        rest: CurvePoint,
    ) -> list[Event]:
        """Return the events between two points."""
        found = list[Event]()
        turned = one.tangent[0] * other.tangent[0] < 0
        if one.tangent[1] * other.tangent[1] < 0:
            at = self._located(one, other, lambda point: point.tangent[1])
            slopes = [1 / point.compliance[self.port, self.port] for point in (one.at, at)]
            bend = (slopes[1] - slopes[0]) / (self._values(at) - self._values(one.at))[0]
            found.append(Event(HIGHEST, at, bend=float(bend)))
        if turned:
            at = self._located(one, other, lambda point: point.tangent[0])
            slopes = [point.compliance[self.port, self.port] for point in (one.at, at)]
            bend = (slopes[1] - slopes[0]) / (self._values(at) - self._values(one.at))[1]
            found.append(Event(FURTHEST, at, bend=float(bend)))
        if one.place[1] * other.place[1] < 0:
            at = self._located(one, other, lambda point: point.place[1])
            found.append(Event(WITHOUT_FORCE, self.reach(at, UNLOADED) or at))
        if abs(self.held_unstable(one.at) - self.held_unstable(other.at)) > int(turned):
            at = self._halved(one, other)
            found.append(Event(BIFURCATION, at, self._taking_part(at, rest)))
        return sorted(
            found,
            key=lambda event: float(np.hypot(*(self._values(event.at) / self.scale - one.place))),
        )

    def held_unstable(self, at: CurvePoint) -> int:
        """Return the number of negative pivots with the displacement of the port prescribed."""
        return at.unstable - int(at.compliance[self.port, self.port] < 0)

    def _between(
        self,
        one: _Placed,
        other: _Placed,
        share: float,
    ) -> _Placed | None:
        """Return the point at a share of the way between two, on the line across a cubic curve
        through both.
        """
        chord = float(np.hypot(*(other.place - one.place)))
        s = share
        place = one.place * (1 + 2 * s) * (1 - s) ** 2 + other.place * s**2 * (3 - 2 * s)
        place = place + chord * (one.tangent * s * (1 - s) ** 2 - other.tangent * s**2 * (1 - s))
        slope = 6 * s * (1 - s) * (other.place - one.place)
        slope = slope + chord * (
            one.tangent * (1 - s) * (1 - 3 * s) - other.tangent * s * (2 - 3 * s)
        )
        slope /= np.hypot(*slope)
        at = self.reach(one.at, self._across(slope, place))
        return None if at is None else self._placed(at, slope)

    def _located(
        self, one: _Placed, other: _Placed, value: Callable[[_Placed], float]
    ) -> CurvePoint:
        """Return the point between two at which a value is zero, by the Illinois method."""
        best = min(one, other, key=lambda point: abs(value(point)))
        first = value(one)
        second = value(other)
        kept = 0  # side on which the last point was replaced: the value on the other is then halved
        for _ in range(REFINED):
            share = first / (first - second)
            middle = self._between(one, other, min(max(share, LEAST_SHARE), 1 - LEAST_SHARE))
            if middle is None:
                break
            best = middle
            found = value(middle)
            if abs(found) < FOUND:
                break
            if found * first > 0:
                second = second / 2 if kept == 1 else second
                one = middle
                first = found
                kept = 1
            else:
                first = first / 2 if kept == 2 else first
                other = middle
                second = found
                kept = 2
        return best.at

    def _halved(
        self,
        one: _Placed,
        other: _Placed,
    ) -> CurvePoint:
        """Return the point between two from which the number of negative pivots is that of the
        second one.
        """
        for _ in range(HALVED):
            middle = self._between(one, other, 0.5)
            if middle is None:
                break
            if self.held_unstable(middle.at) == self.held_unstable(one.at):
                one = middle
            else:
                other = middle
        return other.at

    def _taking_part(
        self,
        at: CurvePoint,
        rest: CurvePoint,
    ) -> int:
        """Return the port of the output whose compliance, with the driven one held, grows most
        towards a branch.
        """
        others = [port for port in range(3) if port != self.port]
        growth = [
            abs(_held_compliance(at, self.port, port) / _held_compliance(rest, self.port, port))
            for port in others
        ]
        most = int(np.argmax(growth))
        return others[most] if growth[most] > AMPLIFIED else -1


def _held_compliance(
    at: CurvePoint,
    driven: int,
    port: int,
) -> float:
    """Return the compliance of a port with the driven one held."""
    C = at.compliance
    return float(C[port, port] - C[port, driven] ** 2 / C[driven, driven])


def at_extremum(
    event: Event,
    near: CurvePoint,
    port: int,
) -> CurvePoint:
    """Return the extremum of the curve of another model, from its equilibrium at the place of an
    event.

    To second order in the distance, by the change of the slope of the first model.
    """
    C = float(near.compliance[port, port])
    motions = near.motions.copy()
    loads = near.loads.copy()
    if event.kind == HIGHEST:
        step = -1 / (C * event.bend)
        motions[port] += step
        loads[port] += step / (2 * C)
    if event.kind == FURTHEST:
        step = -C / event.bend
        loads[port] += step
        motions[port] += C * step / 2
    return near._replace(motions=motions, loads=loads)


class Waypoint(NamedTuple):
    """A point of a curve, and the line on which another model finds its own: by displacement or
    force alone if wanted.

    event : that of the point; None of other points.   wanted : whether it is part of the answer.
    """

    at: CurvePoint
    line: Line
    wanted: bool = False
    event: Event | None = None


def way_along(
    curve: ForceCurve, reach: Reach, port: int, displacements: Sequence[float]
) -> list[Waypoint]:
    """Return the points of a curve in their order: its own, its events, and those first at
    displacements, mm or rad.
    """
    placed = [
        _Stop(number, 0.0, Waypoint(point, line))
        for number, (point, line) in enumerate(zip(curve.points, curve.lines, strict=True))
    ]
    placed += [_at_event(curve, port, number, event) for number, event in curve.events]
    driven = np.array([point.motions[port] for point in curve.points])
    for displacement in displacements:
        along = np.sign(displacement) * driven
        beyond = np.flatnonzero(along >= abs(displacement) * (1 - LEAST_STEP))
        if not len(beyond):
            break
        number = max(0, int(beyond[0]) - 1)
        line = (1.0, 0.0, displacement)
        at = reach(curve.points[number], line)
        if at is None:
            break
        distance = _distance(curve, port, number, displacement, float(at.loads[port]))
        placed.append(_Stop(number, distance, Waypoint(at, line, True)))
    return [stop.waypoint for stop in sorted(placed, key=lambda stop: stop[:2])]


class _Stop(NamedTuple):
    """A point on the way along a curve: the number of the point before it, and its distance."""

    number: int
    distance: float
    waypoint: Waypoint


def _at_event(
    curve: ForceCurve,
    port: int,
    number: int,
    event: Event,
) -> _Stop:
    """Return an event that follows a point of a curve."""
    displacement = float(event.at.motions[port])
    force = float(event.at.loads[port])
    line: Line = (0.0, 1.0, force)
    if event.kind in (HIGHEST, BIFURCATION):
        line = (1.0, 0.0, displacement)
    elif event.kind == WITHOUT_FORCE:
        line = UNLOADED
    distance = _distance(curve, port, number, displacement, force)
    return _Stop(number, distance, Waypoint(event.at, line, True, event))


def _distance(
    curve: ForceCurve, port: int, number: int, displacement: float, force: float
) -> float:
    """Return the distance from a point of a curve, in shares of its scale."""
    point = curve.points[number]
    way = np.array([displacement - point.motions[port], force - point.loads[port]])
    return float(np.hypot(*(way / curve.scale)))


def replayed(
    reach: Reach, rest: CurvePoint, way: Sequence[Waypoint], port: int, scale: Array
) -> list[CurvePoint | None]:
    """Return the equilibria of another model at the wanted points of a curve.

    It is None for one that is not found.

    A jump that does not end near the point of the curve is divided at a point in between.
    """

    def advanced(
        at: CurvePoint,
        start: int,
        goal: int,
    ) -> CurvePoint | None:
        if goal - start <= LONGEST_JUMP:
            after = reach(at, way[goal].line)
            if after is not None:
                apart = [
                    after.motions[port] - way[goal].at.motions[port],
                    after.loads[port] - way[goal].at.loads[port],
                ]
                if np.hypot(*(np.array(apart) / scale)) < NEAR:
                    return after
            if goal == start + 1:
                return None
        middle = (start + goal) // 2
        at_middle = advanced(at, start, middle)
        return None if at_middle is None else advanced(at_middle, middle, goal)

    found = list[CurvePoint | None]()
    at: CurvePoint | None = rest
    start = 0
    for number, waypoint in enumerate(way):
        if not waypoint.wanted:
            continue
        at = None if at is None else advanced(at, start, number)
        found.append(at)
        start = number
    return found
