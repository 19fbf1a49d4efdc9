"""Figures of a design: what each axis, curve, mark and label says of a record of which every number
is another.
"""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot

import flexfem
from flexfem.design.result import Step
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure

from ..design.recorded import OTHER, STAGE, recorded

PLAIN = str.maketrans("\N{NO-BREAK SPACE}\N{MINUS SIGN}\N{MICRO SIGN}", " -u")
BLUE = "#0072B2"
ORANGE = "#D55E00"
BLACK = "#1A1A1A"


def words(text):
    return " ".join((text if isinstance(text, str) else text.get_text()).translate(PLAIN).split())


def axes_of(figure):
    return [
        (*(label.translate(PLAIN) for label in (ax.get_xlabel(), ax.get_ylabel())), ax)
        for ax in figure.axes
    ]


@pytest.fixture(autouse=True)
def _closed():
    yield
    pyplot.close("all")


def test_a_design_is_headed_by_its_numbers_and_each_panel_says_what_it_shows():
    figure = design_figure(recorded())
    assert (
        "reach: 412.0 ± 1.2 um, checked by finite elements, difference -4.8 % from the analytic "
        "model; mass: 0.0893 kg, exact; not every"
    ) in words(figure.texts[1])
    assert words(figure.texts[-1]) == "assumed dimensions"
    assert "; every requirement is met." in words(design_figure(recorded(feasible=True)).texts[1])
    drawn, margins, history, front = figure.axes
    assert [each[:2] for each in axes_of(figure)] == [
        ("x (mm)", "y (mm)"),
        (
            "margin to limit (%); bars: uncertainty\nhollow: analytic model, not checked by finite elements",
            "",
        ),
        ("evaluations of the analytic model", "reach (um)"),
        ("reach (um), larger is better", "mass (kg), smaller is better"),
    ]
    assert drawn.get_aspect() == 1.0 and margins.get_xscale() == "symlog"
    assert front.lines[0].get_xydata().tolist() == [[405.0, 0.081], [466.0, 0.093]]
    assert front.lines[1].get_xydata().tolist() == [[407.0, 0.082], [469.0, 0.094]]
    assert front.lines[-1].get_xydata().tolist() == [[412.0, 0.0893]]
    assert history.lines[0].get_xydata().tolist() == [[3000.0, 390.0], [7000.0, 410.0]]


def test_the_designed_stage_is_drawn_and_no_other():
    """Its link 1 6 mm longer, a stage reaches farther from its centre."""
    widths = [
        np.ptp(design_figure(recorded(stage=text)).axes[0].get_xlim()) for text in (STAGE, OTHER)
    ]
    assert widths[0] == pytest.approx(158.53, abs=0.01) and widths[1] > widths[0] + 5


def test_margins_are_in_per_cent_with_bands_marks_and_prices():
    ax = flexfem.plot.plot_margins(None, recorded())
    points = [line for line in ax.lines if line.get_marker() in ("o", "s", "X")]
    assert [line.get_xydata()[0].tolist() for line in points] == [
        [1.875, 0.0],
        [-2.0, 1.0],
        [2.963, 2.0],
    ]
    assert [
        (line.get_marker(), line.get_color(), line.get_markerfacecolor()) for line in points
    ] == [("o", BLUE, BLUE), ("X", ORANGE, "white"), ("s", BLUE, "white")]
    bars = [collection.get_paths()[0].vertices[:, 0] for collection in ax.collections]
    assert np.array(bars) == pytest.approx(
        np.array([[1.5625, 2.1875], [-2.0, -2.0], [-3.704, 9.63]])
    )
    assert ax.yaxis_inverted()
    assert [words(text) for text in ax.get_yticklabels()] == [
        "stiffness, at least 60 and at most 80 N/mm: met, limits the objective",
        "diameter, at most 150 mm: missed, limits the objective",
        "coupling, at most 0.0135: within the band",
    ]


@pytest.mark.parametrize(
    ("better", "steps", "said"),
    [
        ("larger", (390.0, 410.0, 405.0), ["drop: rounding to workshop steps"]),
        ("larger", (390.0, 410.0), []),
        ("smaller", (410.0, 390.0, 395.0), ["rise: rounding to workshop steps"]),
        ("smaller", (410.0, 390.0), []),
    ],
)
def test_a_loss_by_steps_is_named_and_no_gain(better, steps, said):
    history = [
        Step(evaluations=1000 * k, objective=objective, missed=0.0)
        for k, objective in enumerate(steps, 1)
    ]
    goals = [goal.model_copy(update={"better": better}) for goal in recorded().objectives]
    ax = flexfem.plot.plot_history(None, recorded(history=history, objectives=goals))
    assert [words(text) for text in ax.texts] == said


def test_a_search_that_meets_nothing_is_drawn_by_what_it_misses_in_per_cent():
    missed = [
        Step(evaluations=1000, objective=None, missed=0.21),
        Step(evaluations=2000, objective=None, missed=0.15),
    ]
    ax = flexfem.plot.plot_history(None, recorded(history=missed))
    assert ax.lines[0].get_xydata() == pytest.approx(np.array([[1000, 21], [2000, 15]]))
    assert ax.get_ylabel() == "total violation, % of the limits"


def test_sensitivities_are_each_of_the_quantity_in_their_title():
    figure = sensitivity_figure(recorded())
    titles = [
        "reach, larger",
        "mass, smaller",
        "stiffness, at least 60 and at most 80",
        "diameter, at",
    ]
    assert all(
        words(ax.get_title(loc="left")).startswith(title)
        for ax, title in zip(figure.axes, titles, strict=True)
    )
    assert [[bar.get_width() for bar in ax.patches] for ax in figure.axes] == [
        [-1.31, 0.65],
        [0.12, 0.76],
        [-2.43, 1.87],
        [0.54, 0.98],
    ]
    assert [words(text) for text in figure.axes[2].texts] == ["-2.4", "+1.9"]
    assert [words(label) for label in figure.axes[0].get_yticklabels()] == ["neck", "l1"]
    assert all(ax.yaxis_inverted() for ax in figure.axes)
    assert {ax.get_xlabel() for ax in figure.axes} == {"change (%) per 1 %"}
    assert {ax.get_xlim() for ax in figure.axes} == {(-1.55 * 2.43, 1.55 * 2.43)}
    assert [words(text) for text in figure.texts if "assumed" in text.get_text()] == [
        "assumed dimensions"
    ]


def test_a_front_is_of_finite_elements_and_its_designs_are_drawn_by_their_numbers_to_one_scale():
    figure = front_figure(recorded(units={"neck": "mm"}))
    plane, one, two, listed = figure.axes
    assert axes_of(figure)[0][:2] == (
        "reach (um), larger is better",
        "mass (kg), smaller is better",
    )
    assert plane.lines[0].get_xydata().tolist() == [[405.0, 0.081], [466.0, 0.093]]
    assert [line.get_markeredgecolor() for line in plane.lines[2:4]] == [BLACK, ORANGE]
    assert [(words(text), tuple(text.xy)) for text in plane.texts] == [
        ("1", (405.0, 0.081)),
        ("2", (466.0, 0.093)),
    ]
    assert [ax.get_title() for ax in (one, two)] == ["1", "2, missed"]
    assert [words(cell.get_text()) for _, cell in sorted(listed.tables[0].get_celld().items())] == [
        "design",
        "reach (um)",
        "mass (kg)",
        "neck (mm)",
        "l1",
        "1",
        "405.0",
        "0.08100",
        "0.43",
        "36",
        "2, missed",
        "466.0",
        "0.09300",
        "0.52",
        "30",
    ]
    assert one.get_xlim() == two.get_xlim()
    reaches = [
        max(np.abs(path.vertices).max() for path in ax.collections[0].get_paths())
        for ax in (one, two)
    ]
    assert reaches[0] > reaches[1] + 3  # link 1 is 6 mm longer


def test_a_sensitivity_that_is_not_known_has_no_bar_and_another_quantity_or_front_is_refused():
    ax = flexfem.plot.plot_sensitivity(None, recorded(), "coupling_95")
    assert [words(text) for text in ax.texts] == ["not known", "+1.1"] and ax.patches[
        0
    ].get_width() == 0.0
    with pytest.raises(
        flexfem.BadInput,
        match='quantity "kyy_n_per_mm", expected one of range_x_um, mass_kg, kxx_n',
    ):
        flexfem.plot.plot_sensitivity(None, recorded(), "kyy_n_per_mm")
    with pytest.raises(
        flexfem.BadInput, match=r"wanted.toml: a design without a front, expected two"
    ):
        flexfem.plot.plot_tradeoff(None, recorded(front=[]))
