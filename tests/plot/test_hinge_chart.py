"""The review figure of the hinge formulas: what shares a curve, what is full and what is pale."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.plot.hinge import FLOOR, FREEDOMS, hinge_chart_figure, merged
from flexfem.plot.text import SPACE
from flexfem.questions.hinges import FormulaCurve, HingeReview

X = np.geomspace(0.02, 1.2, 40)
FULL = 1.5  # points: curves within their range are broader than this, pale ones thinner


def review(**changes) -> HingeReview:
    exact = 1.0 - 0.2 * X
    given = {
        "ratio": X,
        "curves": [
            FormulaCurve("one", (1e-4, 2.0), exact, 0.9 * exact, None),
            FormulaCurve("same", (1e-4, 2.0), exact * (1 + 1e-9), 0.9 * exact, 0.95 * exact),
            FormulaCurve("narrower", (1e-4, 0.3), exact, None, None),
            FormulaCurve("fit", (0.05, 0.5), 1.05 - X**4, None, None),
        ],
        "height": 2.7,
        "higher": FormulaCurve("calibrated", (0.02, 1.2), 1 + 0.1 * X, 1 + 0.5 * X, 1 + 0.3 * X),
        "poissons_ratio": 0.29,
        "source": "made-up numbers",
    }
    return HingeReview(**(given | changes))


def full_curves(axes) -> list:
    return [line for line in axes.get_lines() if line.get_linewidth() > FULL and line.get_marker() not in ("None", "|")]


def test_formulas_share_a_curve_when_they_are_the_same_integral_with_the_same_range() -> None:
    assert [group.names for group in merged(review(), "rotation")] == [["one", "same"], ["narrower"], ["fit"]]
    assert [group.names for group in merged(review(), "axial")] == [["one", "same"]]


def test_a_formula_has_no_curve_for_a_freedom_that_it_does_not_state() -> None:
    assert [group.names for group in merged(review(), "shear")] == [["same"]]
    assert [len(full_curves(axes)) for axes in hinge_chart_figure(review()).axes] == [3, 1, 1]


def test_curves_are_full_within_their_range_and_pale_all_along() -> None:
    axes = hinge_chart_figure(review()).axes[0]
    fit = full_curves(axes)[2]
    assert fit.get_xdata()[[0, -1]] == pytest.approx([0.05, 0.5])
    np.testing.assert_allclose(fit.get_ydata(), 1.05 - fit.get_xdata() ** 4, atol=2e-3)  # interpolated at the ends
    pale = [line for line in axes.get_lines() if line.get_alpha() is not None]
    assert len(pale) == 3 and all(line.get_xdata()[[0, -1]] == pytest.approx([0.02, 1.2]) for line in pale)
    bars = [list(line.get_xdata()) for line in axes.get_lines() if line.get_marker() == "|"]
    assert bars == [pytest.approx([]), pytest.approx([0.3]), pytest.approx([0.05, 0.5])]


def test_a_formula_looks_the_same_in_every_panel() -> None:
    figure = hinge_chart_figure(review())
    rotation, axial = (full_curves(axes)[0] for axes in figure.axes[:2])
    assert (rotation.get_color(), rotation.get_marker()) == (axial.get_color(), axial.get_marker())
    looks = [(line.get_color(), line.get_marker()) for line in full_curves(figure.axes[0])]
    assert len({marker for _, marker in looks}) == len({colour for colour, _ in looks}) == 3


def test_panels_show_all_within_range_and_leave_out_what_is_useless() -> None:
    useless = FormulaCurve("useless", (0.02, 1.2), 1.0 - X, None, None)
    axes = hinge_chart_figure(review(curves=[useless])).axes[0]
    low, high = axes.get_ylim()
    assert 0.85 * FLOOR < low < FLOOR and high > 1 + 0.1 * 1.2
    far = FormulaCurve("pale is high", (0.02, 0.1), 1 + X**3 * 50, None, None)
    assert hinge_chart_figure(review(curves=[far])).axes[0].get_ylim()[1] < 1.5


def test_the_legend_states_range_and_deviation() -> None:
    higher = {"rotation": 1.12, "axial": 1.6, "shear": 1.36}
    first = {"rotation": "0.76 to 1.00", "axial": "0.68 to 0.90", "shear": "0.72 to 0.95"}
    for axes, freedom in zip(hinge_chart_figure(review()).axes, FREEDOMS, strict=True):
        texts = [text.get_text().replace(SPACE, " ") for text in axes.get_legend().get_texts()]
        assert texts[-1] == f"finite elements, H = h to 2.7 h\n1 to {higher[freedom]:.2f}"
        assert texts[0].endswith(f"\n{first[freedom]} for t/R 0.02 to 1.2")
        handles = [line.get_color() for line in axes.get_legend().get_lines()]
        assert handles == [line.get_color() for line in full_curves(axes)]
    assert "fit\n0.99 to 1.05 for t/R 0.05 to 0.5" in [
        text.get_text() for text in hinge_chart_figure(review()).axes[0].get_legend().get_texts()
    ]


def test_higher_blocks_are_shaded_from_the_finite_elements_at_one(made) -> None:
    for axes, slope in zip(hinge_chart_figure(review()).axes, (0.1, 0.5, 0.3), strict=True):
        (shade,) = axes.collections
        np.testing.assert_allclose(made.extent(shade), np.column_stack([X, np.ones(40), 1 + slope * X]))
        level = [line.get_ydata() for line in axes.get_lines() if len(set(line.get_ydata())) == 1]
        assert [1.0, 1.0] in [list(values) for values in level]


def test_axes_say_what_is_over_what() -> None:
    figure = hinge_chart_figure(review())
    symbols = (r"rotation, $\theta/M$", r"axial, $\delta_x/F_x$", r"shear, $\delta_y/F_y$")
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        f"({k}) {s}" for k, s in zip("abc", symbols, strict=True)
    ]
    assert [axes.get_ylabel() for axes in figure.axes] == 3 * ["formula / finite elements"]
    assert figure.axes[2].get_xlabel() == "t/R" and figure.axes[2].get_xscale() == "log"
    ticks = figure.axes[2].get_xticklabels()
    assert [float(tick.get_text()) for tick in ticks] == [tick.get_position()[0] for tick in ticks] != []
