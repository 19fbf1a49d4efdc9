"""The review figure of the hinge formulas: what shares a curve, what is full and what is pale."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.plot.hinge import hinge_chart_figure, merged, thickness_figure
from flexfem.questions.check import FormulaCurve, HingeReview, ThicknessReview

X = np.geomspace(0.02, 1.2, 40)
FULL = 1.5  # points: curves within their range are broader than this, pale ones thinner


def review() -> HingeReview:
    exact = 1.0 - 0.2 * X
    curves = [
        FormulaCurve("one", (1e-4, 2.0), exact, 0.9 * exact, None),
        FormulaCurve("same", (1e-4, 2.0), exact * (1 + 1e-9), 0.9 * exact, 0.95 * exact),
        FormulaCurve("narrower", (1e-4, 0.3), exact, None, None),
        FormulaCurve("fit", (0.05, 0.5), 1.05 - X**4, None, None),
    ]
    higher = FormulaCurve("calibrated", (0.02, 1.2), 1 + 0.1 * X, 1 + 0.5 * X, 1 + 0.3 * X)
    return HingeReview(
        ratio=X,
        curves=curves,
        height=2.7,
        higher=higher,
        poissons_ratio=0.29,
        source="made-up numbers",
    )


def full_curves(axes) -> list:
    return [
        line
        for line in axes.get_lines()
        if line.get_linewidth() > FULL and line.get_marker() not in ("None", "|")
    ]


def test_formulas_share_a_curve_when_they_are_the_same_integral_with_the_same_range() -> None:
    assert [names for names, *_ in merged(review(), "rotation")] == [
        ["one", "same"],
        ["narrower"],
        ["fit"],
    ]
    assert [names for names, *_ in merged(review(), "axial")] == [["one", "same"]]


def test_curves_are_full_within_their_range_and_pale_all_along() -> None:
    axes = hinge_chart_figure(review()).axes[0]
    fit = full_curves(axes)[2]
    assert fit.get_xdata()[[0, -1]] == pytest.approx([0.05, 0.5])
    np.testing.assert_allclose(
        fit.get_ydata(), 1.05 - fit.get_xdata() ** 4, atol=2e-3
    )  # interpolated at the ends
    pale = [line for line in axes.get_lines() if line.get_alpha() is not None]
    assert len(pale) == 3 and all(
        line.get_xdata()[[0, -1]] == pytest.approx([0.02, 1.2]) for line in pale
    )
    bars = [list(line.get_xdata()) for line in axes.get_lines() if line.get_marker() == "|"]
    assert bars == [pytest.approx([]), pytest.approx([0.3]), pytest.approx([0.05, 0.5])]


def test_higher_blocks_are_shaded_from_the_finite_elements_at_one(made) -> None:
    for axes, slope in zip(hinge_chart_figure(review()).axes, (0.1, 0.5, 0.3), strict=True):
        (shade,) = axes.collections
        np.testing.assert_allclose(
            made.extent(shade), np.column_stack([X, np.ones(40), 1 + slope * X])
        )
        level = [line.get_ydata() for line in axes.get_lines() if len(set(line.get_ydata())) == 1]
        assert [1.0, 1.0] in [list(values) for values in level]


# over the thickness

WIDTH = np.geomspace(0.5, 50.0, 30)
NU = 0.29
STRAIN = 1 - NU**2


def test_each_panel_has_a_curve_for_each_neck_and_both_limits() -> None:
    position = WIDTH**2 / (WIDTH**2 + np.array([[400.0], [90.0], [9.0]]))
    rotation = 1 - NU**2 * position
    axial = 1 - 0.4 * NU**2 * position
    shown = ThicknessReview(
        WIDTH, np.array([0.02, 0.1, 0.8]), NU, rotation, axial, "made-up numbers"
    )
    for axes, freedom in zip(thickness_figure(shown).axes, ("rotation", "axial"), strict=True):
        lines = axes.get_lines()
        assert [lines[k].get_ydata()[0] for k in (0, 1)] == [1.0, pytest.approx(STRAIN)]
        for line, values in zip(lines[2:5], getattr(shown, freedom), strict=True):
            np.testing.assert_array_equal(line.get_ydata(), values)
            np.testing.assert_array_equal(line.get_xdata(), WIDTH)
        low, high = axes.get_ylim()
        assert low < STRAIN and high > 1
        assert {text.get_text() for text in axes.texts} == {
            "plane stress",
            f"plane strain, 1 − ν² = {STRAIN:.3f}",
        }
