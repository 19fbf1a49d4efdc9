"""Curves with limits: a von Mises truss in closed form, the extensible elastica, and columns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import flexfem
from flexfem.analytic.paths import DrivenPlate
from flexfem.mechanism.curves import (
    BIFURCATION,
    FURTHEST,
    HIGHEST,
    WITHOUT_FORCE,
    CurvePoint,
    Followed,
)
from flexfem.questions.curve import by_beams

LOCATED = 1e-5  # relative: events are located to 1e-6 of the slope
ELASTICA = 2e-3  # relative to the highest force: a leaf is divided into eight beams
# relative: beyond the second position leaves are pulled, and bend in short layers at their ends
STRETCHED = 0.015
HALVED = 0.01  # relative: a branch is found by halving a step seven times

HALF_SPAN = 30.0
HEIGHT = 9.0
BAR = 800.0  # mm, mm and N/mm, of one bar of the truss
LENGTH = np.hypot(HALF_SPAN, HEIGHT)


class Truss:
    """Two bars to a common top, pushed down by v through a spring: the force is `2 k (H - v) (L0 /
    L - 1)`.
    """

    def __init__(self, spring: float) -> None:
        self.spring = spring

    def point(self, v: float) -> CurvePoint:
        height = HEIGHT - v
        length = np.hypot(HALF_SPAN, height)
        force = 2 * BAR * height * (LENGTH / length - 1)
        slope = 2 * BAR * (1 - LENGTH * HALF_SPAN**2 / length**3)
        compliance = np.diag([1 / slope + 1 / self.spring, 1.0, 1.0])
        return CurvePoint(
            np.array([v + force / self.spring, 0, 0]),
            np.array([force, 0, 0]),
            compliance,
            int(slope < 0),
            np.nan,
            v,
        )

    def reach(self, near: CurvePoint, line: tuple[float, float, float]) -> CurvePoint | None:
        a, b, c = line
        at = near
        for _ in range(30):
            slope = 1 / (at.compliance[0, 0] - 1 / self.spring)
            rate = a * (1 + slope / self.spring) + b * slope
            change = (c - a * at.motions[0] - b * at.loads[0]) / rate
            if abs(change) > HEIGHT:
                return None
            at = self.point(at.state + change)
            if abs(change) < 1e-13:
                return at
        return None


@pytest.mark.parametrize(("spring", "snaps_back"), [(5000.0, False), (110.0, False), (30.0, True)])
def test_a_von_mises_truss_is_followed_through_limits_of_force_and_displacement(spring, snaps_back):
    """The force is highest where `L^3 = L0 a^2`: `2 k (L0^(2/3) - a^(2/3))^(3/2)`. Snap-back: a
    soft spring.
    """
    truss = Truss(spring)
    curve = Followed(truss.reach, 0, 2.3 * HEIGHT).curve(truss.point(0.0))
    assert curve.complete
    events = [event for _, event in curve.events]
    kinds = [event.kind for event in events if event.kind != FURTHEST]
    assert kinds == [HIGHEST, WITHOUT_FORCE, HIGHEST, WITHOUT_FORCE]
    first, unloaded, second, snapped = (event.at for event in events if event.kind != FURTHEST)
    highest = 2 * BAR * (LENGTH ** (2 / 3) - HALF_SPAN ** (2 / 3)) ** 1.5
    assert first.loads[0] == pytest.approx(highest, rel=LOCATED)
    assert second.loads[0] == pytest.approx(-highest, rel=LOCATED)
    assert unloaded.motions[0] == pytest.approx(HEIGHT, rel=LOCATED)
    assert snapped.motions[0] == pytest.approx(2 * HEIGHT, rel=LOCATED)
    assert (unloaded.unstable, snapped.unstable) == (1, 0)
    turned = [event.at for event in events if event.kind == FURTHEST]
    assert len(turned) == 2 * snaps_back
    for at in turned:  # where the slope of the truss is the opposite of the spring's
        assert 1 / (at.compliance[0, 0] - 1 / spring) == pytest.approx(-spring, rel=LOCATED)
        assert at.motions[0] != pytest.approx(at.state, rel=0.1)


E = 3000.0
B = 6.0
T = 0.8
SPAN = 30.0
RISE = 4.2  # MPa, mm
EA = E * B * T
EI = E * B * T**3 / 12


def bistable(model="plane_stress"):
    """A shuttle that four inclined leaves, in two rows of mirror images, clamp to two walls: it
    does not turn.
    """
    slant = float(np.arctan2(RISE, SPAN))
    length = float(np.hypot(SPAN, RISE))
    hinges = []
    for row in (8.0, -8.0):
        for side, wall, heading in ((1, "wall", np.pi - slant), (-1, "wall 2", slant)):
            hinges.append(
                {
                    "name": f"leaf {side} {row:g}",
                    "between": (wall, "shuttle"),
                    "at": (side * (5 + SPAN / 2), row - RISE / 2),
                    "direction": heading,
                    "length": length,
                    "shape": "leaf",
                    "neck": T,
                    "cut": 3.0,
                }
            )
    return flexfem.Mechanism(
        name="bistable",
        model=model,
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.35,
            "density": 1240.0,
            "yield_strength": 50.0,
        },
        body=[
            {"name": "shuttle", "outline": [(-6, -14), (6, -14), (6, 14), (-6, 14)]},
            {"name": "wall", "outline": [(34, -24), (42, -24), (42, 16), (34, 16)], "fixed": True},
            {
                "name": "wall 2",
                "outline": [(-42, -24), (-34, -24), (-34, 16), (-42, 16)],
                "fixed": True,
            },
        ],
        hinge=hinges,
        output={"body": "shuttle", "at": (0.0, 0.0)},
    )


def elastica_forces(lowered):
    """Forces that lower the shuttle by given distances, in their order, by shooting along a leaf
    from the wall.

    The leaf is extensible, its sections shear (6/5 of the mean shear stress over G), and both ends
    keep their slope."""
    slant = np.arctan2(RISE, SPAN)
    length = np.hypot(SPAN, RISE)
    shear_compliance = 6 / 5 * 2 * (1 + 0.35) / EA
    unknowns = np.zeros(3)
    found = []

    def missed(unknowns, distance):
        along, across, moment = unknowns

        def rates(_, state):
            turn, bent = state[2:]
            pull = along * np.cos(turn) + across * np.sin(turn)
            shear = across * np.cos(turn) - along * np.sin(turn)
            stretch = 1 + pull / EA
            slide = shear_compliance * shear
            x = stretch * np.cos(turn) - slide * np.sin(turn)
            y = stretch * np.sin(turn) + slide * np.cos(turn)
            return [x, y, bent / EI, slide * pull - stretch * shear]

        end = solve_ivp(rates, (0, length), [0, 0, slant, moment], rtol=1e-8, atol=1e-8)
        return end.y[:3, -1] - [SPAN, RISE - distance, slant]

    for distance in lowered:
        unknowns = fsolve(missed, unknowns, args=(distance,), xtol=1e-9)
        found.append(-4 * unknowns[1])
    return np.array(found)


@pytest.mark.slow
def test_inclined_leaves_snap_at_the_force_of_the_elastica_and_follow_it_to_the_second_position():
    found = by_beams(bistable().layout, 1, -2.2 * RISE * np.array([0.25, 0.5, 0.75, 1.0]))
    first = found.events["limit of the force 1"]
    peak = -first.motions[1]
    way = np.array([*np.linspace(0.0, 0.97, 9)[1:], 0.98, 1.0, 1.02]) * peak
    before, at, beyond = elastica_forces(way)[-3:]
    assert at > max(before, beyond)
    assert first.loads[1] == pytest.approx(-at, rel=ELASTICA)
    shares = np.array([[-point.motions[1], -point.loads[1]] for point in found.shares])
    steps = np.linspace(0.0, shares[-1, 0], 41)
    forces = elastica_forces(steps[1:])[[9, 19, 29, 39]]
    np.testing.assert_allclose(shares[:, 1], forces, rtol=STRETCHED, atol=ELASTICA * at)


def test_a_pushed_leaf_branches_at_eulers_load_where_its_end_sways():
    """Driven towards its root and free at the other end, it has no limit of the force: the curve
    goes on, unstable.
    """
    column = flexfem.Mechanism(
        name="leaf",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.35,
            "density": 1240.0,
            "yield_strength": 50.0,
        },
        body=[
            {"name": "base", "outline": [(-12, -6), (0, -6), (0, 6), (-12, 6)], "fixed": True},
            {"name": "top", "outline": [(40, -6), (50, -6), (50, 6), (40, 6)]},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("base", "top"),
                "at": (20, 0),
                "direction": 0.0,
                "shape": "leaf",
                "neck": T,
                "length": 40.0,
            }
        ],
        output={"body": "top", "at": (40.0, 0.0)},
    )
    euler = np.pi**2 * EI / (4 * 40.0**2)
    plate = DrivenPlate(column.layout)
    rest = plate.curve_point(np.zeros(plate.size), np.zeros(plate.ports))
    curve = Followed(
        lambda near, line: plate.on_line(near, 0, line), 0, -4 * euler * 40.0 / EA
    ).curve(rest)
    first = curve.events[0][1]
    assert first.kind == BIFURCATION and first.port in (1, 2)
    assert first.at.loads[0] == pytest.approx(-euler, rel=HALVED)
    assert curve.points[-1].unstable == 1 and curve.points[0].unstable == 0


def strutted():
    """A shuttle that four struts between leaves hold in two rows, mirror images of each other, at
    different heights.
    """
    bodies = [{"name": "shuttle", "outline": [(-5, -12), (5, -12), (5, 14), (-5, 14)]}]
    hinges = []
    for side in (1, -1):
        wall = [(24, -25), (29, -25), (29, 20), (24, 20)]
        outline = [(side * x, y) for x, y in wall][::side]
        bodies.append({"name": f"wall {side}", "outline": outline, "fixed": True})
        for row in (9.0, -5.0):
            strut = f"strut {side} {row:g}"
            low = row - 3.6
            bodies.append(
                {
                    "name": strut,
                    "path": [(side * 9.6, row + 0.25), (side * 19.4, low - 0.25)],
                    "width": 2.6,
                }
            )
            leaf = {"shape": "leaf", "neck": 0.7, "length": 5.2, "cut": 1.3, "fillet": 0.2}
            heading = 0.0 if side == 1 else np.pi
            hinges += [
                {
                    **leaf,
                    "name": f"inner {side} {row:g}",
                    "between": ("shuttle", strut),
                    "at": (side * 7.6, row),
                    "direction": heading,
                },
                {
                    **leaf,
                    "name": f"outer {side} {row:g}",
                    "between": (strut, f"wall {side}"),
                    "at": (side * 21.4, low),
                    "direction": heading,
                },
            ]
    return flexfem.Mechanism(
        name="strutted",
        model="plane_stress",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.35,
            "density": 1240.0,
            "yield_strength": 50.0,
        },
        body=bodies,
        hinge=hinges,
        output={"body": "shuttle", "at": (0.0, 0.0)},
    )


def test_steps_do_not_turn_back_beyond_a_limit():
    """A step over the limit of the force at 7.1 mm reaches a point beyond it, where the tangent has
    two senses.
    """
    found = by_beams(strutted().layout, 1, -8.4 * np.array([0.5, 1.0]))
    assert found.curve.complete and len(found.shares) == 2
    assert np.all(np.diff([point.motions[1] for point in found.curve.points]) < 0)
    assert list(found.events) == [
        "limit of the force 1",
        "unstable position without force 1",
        "limit of the force 2",
        "stable position without force 1",
    ]
