"""Equilibria of beams by strokes and dead loads, against closed forms of ideal leaf springs.

Leaves of length L and height h whose ends stay parallel: at a displacement x they carry `12 E I x /
L^3`. Where both ends keep their distance, they stretch by `3 x^2 / (5 L)` and carry `18 E A x^3 /
(25 L^3)` more, as long as x is small against h. Where they do not, their ends approach each other
by `3 x^2 / (5 L)`. S. T. Smith, Flexures, 2000, chapter 4."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.analytic.paths import DrivenPlate
from flexfem.analytic.strokes import Applied, displaced_by, linear

E = 70e3
LENGTH = 50.0
HEIGHT = 0.4
THICKNESS = 7.0
BEND = E * THICKNESS * HEIGHT**3 / LENGTH**3  # N/mm, of one leaf: 12 E I / L^3
STRETCH = 18 / 25 * E * THICKNESS * HEIGHT / LENGTH**3  # N/mm^3
SHAPE = (
    2e-3  # of the cubic term: the tension straightens the leaves at a fifth of their height; shear
)
SLOPE = 1e-4  # of linear theory: shear of the leaves, and compliance along them


def guide(both_sides, stiffness=None, material=None):
    """A stage on two leaves along y below it, and two above it; it moves along x, by a stack of a
    stiffness, N/mm.
    """
    ends = {"below": -1, "above": 1} if both_sides else {"below": -1}
    bodies = [{"name": "stage", "outline": [(-20, -3), (20, -3), (20, 3), (-20, 3)]}]
    hinges = []
    for name, side in ends.items():
        low, high = sorted((side * (3 + LENGTH), side * (9 + LENGTH)))
        bodies.append(
            {
                "name": name,
                "outline": [(-20, low), (20, low), (20, high), (-20, high)],
                "fixed": True,
            }
        )
        for x in (-15, 15):
            leaf = {"shape": "leaf", "neck": HEIGHT, "length": LENGTH, "direction": np.pi / 2}
            between = (name, "stage") if side < 0 else ("stage", name)
            hinges.append(
                {
                    "name": f"{name} {x}",
                    "between": between,
                    "at": (x, side * (3 + LENGTH / 2)),
                    **leaf,
                }
            )
    stack = {
        "name": "stack",
        "between": ("ground", "stage"),
        "at": [(-30, 0), (-20, 0)],
        "contact": 1.0,
    }
    ideal = {
        "name": "ideal",
        "youngs_modulus": E,
        "poissons_ratio": 0.29,
        "density": 2700.0,
        "yield_strength": 1e4,
    }
    return flexfem.Mechanism(
        name="guide",
        thickness=THICKNESS,
        material=material or ideal,
        model="plane_stress",
        body=bodies,
        hinge=hinges,
        output={"body": "stage", "at": (0, 0)},
        actuator=[] if stiffness is None else [{**stack, "stroke": 0.1, "stiffness": stiffness}],
    )


def applied(layout, **at):
    """Loads, strokes and springs at the first ports, x, y and theta of the output, then the stack."""
    count = len(layout.ports)
    return Applied(
        *(np.resize([*at.get(name, ()), *np.zeros(count)], count) for name in Applied._fields)
    )


def test_leaves_between_two_frames_stretch_as_they_bend():
    layout = guide(both_sides=True).layout
    for share in (0.05, 0.2):
        x = share * HEIGHT
        force = 4 * (BEND * x + STRETCH * x**3)
        found = displaced_by(DrivenPlate(layout), applied(layout, loads=[force]))
        assert linear(DrivenPlate(layout), applied(layout, loads=[force])).motions[
            0
        ] == pytest.approx(force / (4 * BEND), rel=SLOPE * 10)
        assert found.motions[0] == pytest.approx(x, rel=SHAPE)
        assert found.loads[0] == force


def test_a_parallelogram_sinks_as_it_moves():
    """Linear theory knows no motion across the command."""
    layout = guide(both_sides=False).layout
    command = applied(layout, loads=[2 * BEND * 0.5])
    found, rest = (of(DrivenPlate(layout), command) for of in (displaced_by, linear))
    assert found.motions[:2] == pytest.approx([0.5, -3 / 5 * 0.5**2 / LENGTH], rel=5 * SHAPE)
    assert abs(rest.motions[1]) < 1e-12


def test_a_stack_shares_its_stroke_with_the_guide_that_it_stretches():
    """`k (s - x)` is the force of the guide at x; a rigid stack gives all of its stroke."""
    x = 0.08
    k = 300.0
    force = 4 * (BEND * x + STRETCH * x**3)
    layout = guide(both_sides=True, stiffness=k).layout
    found = displaced_by(
        DrivenPlate(layout), applied(layout, strokes=[0, 0, 0, x + force / k], springs=[0, 0, 0, k])
    )
    assert found.motions[[0, 3]] == pytest.approx([x, x], rel=SHAPE)
    assert found.loads[3] == pytest.approx(force, rel=2 * SHAPE)
    rigid = displaced_by(
        DrivenPlate(layout), applied(layout, strokes=[0, 0, 0, x], springs=[0, 0, 0, np.inf])
    )
    assert rigid.motions[3] == pytest.approx(x, rel=1e-6)
    assert rigid.loads[3] == pytest.approx(force, rel=2 * SHAPE)


def test_the_stress_has_the_tension_of_the_leaves():
    """Bending `3 E h x / L^2` at the ends, and tension `3 E x^2 / (5 L^2)`: at a fifth of the
    height a twenty-fifth.
    """
    layout = guide(both_sides=True).layout
    x = 0.2 * HEIGHT
    force = 4 * (BEND * x + STRETCH * x**3)
    stress = displaced_by(DrivenPlate(layout), applied(layout, loads=[force])).stress
    assert stress == pytest.approx(
        np.full(4, E / LENGTH**2 * (3 * HEIGHT * x + 3 / 5 * x**2)), rel=5 * SHAPE
    )
