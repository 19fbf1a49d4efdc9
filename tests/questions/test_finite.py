"""What drives do at finite displacement, where linear theory does not hold to its band.

A stage on two leaf springs of length L, which a stack pushes: across the push it approaches the frame by
`3 x^2 / (5 L)`, of which linear theory knows nothing. S. T. Smith, Flexures, 2000, chapter 4.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.results import SOLID

LENGTH = 40.0
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
            {"name": "base", "outline": [(-20, -53), (20, -53), (20, -43), (-20, -43)], "fixed": True},
        ],
        hinge=[{"name": f"leaf {x}", "between": ("base", "stage"), "at": (x, -23), **leaf} for x in (-15, 15)],
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
