"""The figure of the factors out of plane: curves and limits."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.plot.hinge import thickness_figure
from flexfem.questions.check import ThicknessReview

X = np.geomspace(0.5, 50.0, 30)
NU = 0.29
STRAIN = 1 - NU**2


def review(**changes) -> ThicknessReview:
    position = X**2 / (X**2 + np.array([[400.0], [90.0], [9.0]]))
    given = {
        "width": X,
        "ratio": np.array([0.02, 0.1, 0.8]),
        "poissons_ratio": NU,
        "rotation": 1 - NU**2 * position,
        "axial": 1 - 0.4 * NU**2 * position,
        "source": "made-up numbers",
    }
    return ThicknessReview(**(given | changes))


def test_each_panel_has_a_curve_for_each_neck_and_both_limits() -> None:
    shown = review()
    for axes, freedom in zip(thickness_figure(shown).axes, ("rotation", "axial"), strict=True):
        lines = axes.get_lines()
        assert [lines[k].get_ydata()[0] for k in (0, 1)] == [1.0, pytest.approx(STRAIN)]
        for line, values in zip(lines[2:5], getattr(shown, freedom), strict=True):
            np.testing.assert_array_equal(line.get_ydata(), values)
            np.testing.assert_array_equal(line.get_xdata(), X)
        low, high = axes.get_ylim()
        assert low < STRAIN and high > 1
        assert {text.get_text() for text in axes.texts} == {"plane stress", f"plane strain, 1 − ν² = {STRAIN:.3f}"}
