"""What drives do at finite displacement, where linear theory does not hold to its band.

A stage on two leaf springs of length L, which a stack pushes: across the push it approaches the
frame by `3 x^2 / (5 L)`, of which linear theory knows nothing. S. T. Smith, Flexures, 2000, chapter
4."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.questions.finite import by_weight
from flexfem.results import ELEMENTS, SOLID

from ..analytic.test_strokes import BEND, HEIGHT, STRETCH, guide

LENGTH = 40.0
CORNERS = 0.15  # of the tension: corners concentrate it more than the bending
SHORTER = 0.04  # of the length of a leaf: its root fillets bend less
PUSH = {"name": "stack", "between": ("ground", "stage"), "at": [(-30, 2), (-20, 2)], "contact": 1.0}


def parallelogram(stroke, stiffness=2000.0):
    leaf = {"shape": "leaf", "neck": 0.5, "length": LENGTH, "fillet": 0.3, "direction": np.pi / 2}
    return flexfem.Mechanism(
        name="parallelogram",
        thickness=8.0,
        material={"name": "al-7075-t6"},
        body=[
            {"name": "stage", "outline": [(-20, -3), (20, -3), (20, 3), (-20, 3)]},
            {
                "name": "base",
                "outline": [(-20, -53), (20, -53), (20, -43), (-20, -43)],
                "fixed": True,
            },
        ],
        hinge=[
            {"name": f"leaf {x}", "between": ("base", "stage"), "at": (x, -23), **leaf}
            for x in (-15, 15)
        ],
        output={"body": "stage", "at": (0, 0)},
        actuator=[{**PUSH, "stroke": stroke, "stiffness": stiffness}],
    )


@pytest.mark.slow
def test_a_driven_parallelogram_sinks_within_its_band():
    found = flexfem.drive(parallelogram(0.2), resolution=4)
    x, y, _ = found.internal.values["motion"][0, 0, -1]
    width = found.internal.bands["motion"][0, 0, -1]
    assert x == pytest.approx(0.2, rel=0.02)
    assert y == pytest.approx(-3 / 5 * x**2 / LENGTH, rel=SHORTER)
    assert 0 < width[1] < 0.1 * abs(y)
    assert found.at("cross", model=SOLID)[0] == pytest.approx(100 * y / x, rel=1e-6)
    opening = found.at("used", model=SOLID)[0] / 100 * 0.2
    assert found.at("force", model=SOLID)[0] == pytest.approx(2000.0 * (0.2 - opening), rel=1e-6)
    ends = flexfem.reach(parallelogram(0.2), resolution=4).internal.values["ends"][1, :, -1]
    np.testing.assert_allclose(ends[:, :2], [[0.0, y], [x, 0.0]], rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_small_strokes_are_linear_and_say_so():
    found = flexfem.drive(parallelogram(1e-3), resolution=4)
    assert any("linear theory holds" in note for note in found.notes)
    assert found.at("motion", model=SOLID, point="output")[0, 0] == pytest.approx(
        1e-3 * found.at("transmission", model=SOLID)[0, 0], rel=1e-9
    )


def test_the_analytic_model_warns_of_strokes_beyond_linear_theory():
    """At a displacement of two leaf thicknesses the drop across it is 1.5 % of it."""
    found = flexfem.drive(parallelogram(1.0), models="analytic")
    assert [text for text in found.warnings if "linear theory" in text and "1.5 %" in text]
    assert not flexfem.drive(parallelogram(0.1), models="analytic").warnings


def stress_factor(x):
    """Highest stress of stretched leaves over that of bent ones: a tension steepens the bending at
    the ends.

    With `u^2 = N L^2 / (4 E I)` and `t = tanh(u) / u` the moment there is `u^2 t / (3 (1 - t))`
    times as large."""
    u = np.sqrt(1.8) * x / HEIGHT
    t = np.tanh(u) / u
    return u**2 * t / (3 * (1 - t)) + x / (5 * HEIGHT)


def percent(texts):
    """The change of the motion and that of the stress, per cent, in the only warning on linear
    theory.
    """
    (text,) = [text for text in texts if "linear theory" in text]
    motion, _, stress = text.rpartition("changes ")[2].partition(" %")
    return float(motion.split()[-1]), float(stress.rpartition("by ")[2].removesuffix(" %"))


def test_a_load_that_stretches_leaves_is_told_by_how_much_linear_theory_is_off():
    """At half of the height of the leaves they carry `1 + 0.72 / 4` times as much."""
    x = 0.5 * HEIGHT
    force = 4 * (BEND * x + STRETCH * x**3)
    found = flexfem.stiffness(guide(both_sides=True), models="analytic", force=(force, 0, 0))
    motion, stress = percent(found.warnings)
    assert motion == pytest.approx(100 * (1 - 1 / 1.18), abs=1.0)
    assert stress == pytest.approx(100 * (stress_factor(x) / 1.18 - 1), abs=1.0)
    held = flexfem.stiffness(guide(both_sides=True), models="analytic", displacement=(x, 0, 0))
    motion, stress = percent(held.warnings)
    assert motion == pytest.approx(0.0, abs=0.01)
    assert stress == pytest.approx(100 * (stress_factor(x) - 1), abs=1.0)
    small = flexfem.stiffness(
        guide(both_sides=True), models="analytic", displacement=(x / 50, 0, 0)
    )
    assert not [text for text in small.warnings if "linear theory" in text]


def test_a_heavy_stage_hangs_on_stretched_leaves():
    """The weight is that of the stage and of half of each leaf, along the displacement."""
    mechanism = guide(both_sides=True)
    mass = 2.7e-9 * 7.0 * (40 * 6 + 4 * 25 * HEIGHT)
    x = 0.5 * HEIGHT
    acceleration = 4 * (BEND * x + STRETCH * x**3) / mass
    (change,) = by_weight(mechanism, np.array([acceleration, 0.0])).each
    assert change.motion == pytest.approx(1 - 1 / 1.18, abs=0.01)
    assert not [
        text
        for text in flexfem.gravity(mechanism, models="analytic").warnings
        if "linear theory" in text
    ]


@pytest.mark.slow
def test_the_tension_of_stretched_leaves_counts_in_their_life():
    """What finite displacement adds to the stress has the same sign at both ends of the motion."""
    mechanism = guide(both_sides=True, material={"name": "al-2024-t4"})
    found = flexfem.life(mechanism, amplitude=(0.3 * HEIGHT, 0, 0), models="elements", resolution=4)
    at = {"model": ELEMENTS}
    highest = {name: float(found.at(name, **at).max()) for name in ("peak", "amplitude", "mean")}
    assert highest["mean"] == pytest.approx(
        (stress_factor(0.3 * HEIGHT) - 1) * highest["amplitude"], rel=CORNERS
    )
    assert highest["peak"] == pytest.approx(highest["amplitude"] + highest["mean"], rel=1e-6)
    assert any("as if the stress were proportional" in text for text in found.warnings)
