"""Figs. 5 to 7, budgets and convergence: what is drawn is what is stored, and round-off is called
so.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from flexfem.paper.figures.budget import budget_figure
from flexfem.paper.figures.errors import error_figure
from flexfem.plot import errors
from flexfem.plot.errors import convergence_figure
from flexfem.units import DIRECTIONS

from .conftest import guide_budget

ERRORS = {"mobility three": (0.1407, 0.0311, -0.0523), "mobility six": (-0.0712, 3e-5, 0.0411)}
BANDS = {
    "mobility three": (0.0173, 0.0273, 0.0373),
    "mobility six": (0.1173, 0.1273, 0.1373),
}  # per cent
NAMES = {"x": "x", "y": "y", "theta": "θ"}
LEVER = 21.0


@pytest.fixture(scope="module")
def drawn(made):
    """A result for each direction and its figure."""
    results = {
        axis: made.result(ERRORS, direction=axis, commanded=[-0.05, 0.0, 0.02, 0.05])
        for axis in DIRECTIONS
    }
    return {axis: (result, error_figure(result)) for axis, result in results.items()}


LABEL = "Positioning error,\n% of the commanded motion"


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_curves_and_their_bands_are_the_stored_numbers_in_per_cent_of_the_largest_command(
    made, drawn, direction
):
    result, figure = drawn[direction]
    command = np.array([-0.05, 0.0, 0.02, 0.05])
    for k, (freedom, axes) in enumerate(zip(DIRECTIONS, figure.axes, strict=True)):
        assert axes.get_ylabel() == LABEL
        along = "commanded" if freedom == direction else "cross"
        assert axes.get_title(loc="left") == f"({'abc'[k]}) {NAMES[freedom]}, {along} direction"
        across = made.size_in(figure.axes[2].get_xlabel())
        lines = axes.get_lines()[1:]
        for line, fill, label in zip(lines, axes.collections, ERRORS, strict=True):
            assert line.get_label().strip() == label
            np.testing.assert_allclose(across * line.get_xdata(), command, rtol=1e-12)
            error = 100 * ERRORS[label][k] * command / 0.05
            np.testing.assert_allclose(line.get_ydata(), error, rtol=1e-12, atol=1e-15)
            band = BANDS[label][k] * np.abs(command) / 0.05
            expected = np.column_stack([command / across, error - band, error + band])
            np.testing.assert_allclose(made.extent(fill), expected, rtol=1e-9, atol=1e-12)
            assert tuple(fill.get_facecolor()[0][:3]) == to_rgb(line.get_color())
    assert figure.axes[2].get_xlabel().startswith(f"commanded {NAMES[direction]} (")
    assert result.case == "fig" and not any("zero error" in text for text in made.texts(figure))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_cross_directions_with_round_off_have_a_line_of_text_instead_of_panels(made, direction):
    k = DIRECTIONS.index(direction)
    tiny = 8e-10
    real = 2e-9
    for others, shown in (((tiny, -tiny), 1), ((tiny, real), 2)):
        values = np.insert(others, k, 0.1)
        figure = error_figure(made.result({"one": values, "two": values}, direction=direction))
        cross = [NAMES[each] for each in DIRECTIONS if each != direction][: 3 - shown]
        assert len(figure.axes) == shown
        assert any(
            f"{' and '.join(cross)}: zero error (below 10⁻⁹ of" in text
            for text in made.texts(figure)
        )
        assert not any(name in axes.get_title(loc="left") for name in cross for axes in figure.axes)
    figure = error_figure(made.result({"one": (tiny, tiny, tiny)}, direction=direction))
    (axes,) = figure.axes
    assert (
        not axes.collections
        and not np.any(axes.get_lines()[1].get_ydata())
        and axes.get_ylim() == (-1.0, 1.0)
    )
    assert axes.get_legend().get_texts()[0].get_text().replace("\xa0", " ") == "one: 0 %"


def test_each_panel_has_its_own_percentages_and_bands_beside_their_lines(made, drawn):
    _, figure = drawn["y"]
    expected = [
        ["mobility three: 14.070 ± 0.017 %", "mobility six: −7.12 ± 0.12 %"],
        ["mobility three: 3.110 ± 0.027 %", "mobility six: 0 ± 0.13 %"],
        ["mobility three: −5.230 ± 0.037 %", "mobility six: 4.11 ± 0.14 %"],
    ]
    for axes, said in zip(figure.axes, expected, strict=True):
        legend = axes.get_legend()
        assert [
            text.get_text().replace("\n", " ").replace("\xa0", " ") for text in legend.get_texts()
        ] == said
        looks = [(line.get_color(), line.get_marker()) for line in legend.get_lines()]
        assert looks == [(line.get_color(), line.get_marker()) for line in axes.get_lines()[1:]]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_commanded_direction_may_show_displacement_over_command(made, direction):
    command = np.array([-0.05, 0.0, 0.02, 0.05])
    result = made.result(ERRORS, direction=direction, commanded=command.tolist(), drive="joints")
    figure = error_figure(result, displacement=True)
    k = DIRECTIONS.index(direction)
    for row, axes in enumerate(figure.axes):
        assert axes.get_ylabel().startswith(
            f"displacement in {NAMES[direction]} (" if row == k else LABEL
        )
    axes = figure.axes[k]
    across = made.size_in(figure.axes[2].get_xlabel())
    up = made.size_in(axes.get_ylabel())
    model, *curves = axes.get_lines()
    np.testing.assert_allclose(up * model.get_ydata(), command, rtol=1e-12)
    for line, fill, (label, error) in zip(curves, axes.collections, ERRORS.items(), strict=True):
        np.testing.assert_allclose(across * line.get_xdata(), command, rtol=1e-12)
        np.testing.assert_allclose(
            up * line.get_ydata(), (1 + error[k]) * command, rtol=1e-12, atol=1e-18
        )
        band = BANDS[label][k] / 100 * np.abs(command)
        moved = (1 + error[k]) * command
        expected = np.column_stack([command / across, (moved - band) / up, (moved + band) / up])
        np.testing.assert_allclose(made.extent(fill), expected, rtol=1e-9, atol=1e-12)
    shown = [text.get_text().replace("\n", " ") for text in axes.get_legend().get_texts()]
    assert len(shown) == 2 and all(": error " in text for text in shown)
    assert (
        "in the commanded direction, its error across, with the joint rotations of the"
        in " ".join(made.texts(figure))
    )


def test_labels_of_any_kind_and_what_is_assumed_are_said(made, drawn):
    labels = ["_under", "a $dollar_{ label", "long " * 30]
    for assumed, note in (
        (["thickness_mm", "case: points"], "assumed dimensions"),
        (["case: points"], "assumed comm"),
    ):
        figure = error_figure(
            made.result({label: (0.1, 0.2, 0.3) for label in labels}, assumed=assumed)
        )
        assert [text[: len(note)] for text in made.texts(figure) if "assumed" in text] == [note]
    shown = [text.get_text().replace("\n", " ") for text in figure.axes[0].get_legend().get_texts()]
    assert "_under" in shown[0]
    assert "a $dollar_{ label" in shown[1]
    assert len(shown) == 3
    assert not any("assumed" in text for text in made.texts(drawn["x"][1]))


@pytest.mark.filterwarnings("ignore:Glyph")
def test_a_title_of_wide_letters_ends_before_the_note_beside_it(made):
    for name in ("MOBILITY STUDY OF WIDE MW STAGES", "Case 1 \u4e2d\u6587 <b>&amp; @@ %% | pipe"):
        figure = error_figure(
            made.result({"one": (0.1, 0.2, 0.3)}, name=name, assumed=["t"], not_stated=["t"])
        )
        title, note = (figure.texts[k].get_window_extent() for k in (0, -1))
        assert title.x1 < note.x0


SHARES = {  # along the command, percentage points; the total and its band
    "x": ([0.216, 11.796, 0.526, -0.308, -0.139], 12.091, 0.013),
    "y": ([-0.411, 8.523, 0.731, 0.092, 0.253], 9.188, 0.127),
    "θ": ([0.137, 9.685, -0.722, 0.051, 0.326], 9.477, 0.245),
}
SOLID = (
    (-10.673, 0.121),
    (5.217, 0.234),
    (-7.461, 0.345),
)  # effect of three dimensions and its band


@pytest.fixture(scope="module")
def waterfall(made):
    return budget_figure(made.budget())


def test_every_bar_is_a_share_along_its_own_command_and_begins_where_the_last_ends(waterfall):
    for axes, (name, (shares, total, band)), (solid, width) in zip(
        waterfall.axes, SHARES.items(), SOLID, strict=True
    ):
        assert axes.get_title(loc="left").endswith(f") command in {name}")
        bars = [(bar.get_x(), bar.get_width()) for bar in axes.patches]
        ends = np.cumsum(shares)
        np.testing.assert_allclose(bars[:5], np.column_stack([ends - shares, shares]), atol=1e-12)
        np.testing.assert_allclose(
            bars[5:], [(0.0, total), (total, solid), (0.0, total + solid)], atol=1e-12
        )
        assert [round(bar.get_y() + bar.get_height() / 2, 9) for bar in axes.patches] == list(
            range(8)
        )
        assert axes.yaxis_inverted()
        whiskers = [piece for found in axes.collections for piece in found.get_segments()]
        for row, end, half, found in zip(
            (5, 6, 7),
            (total, total + solid, total + solid),
            (band, width, band + width),
            whiskers,
            strict=True,
        ):
            np.testing.assert_allclose(found, [(end - half, row), (end + half, row)], atol=1e-12)
        joints = [
            line.get_xdata()[0] for line in axes.get_lines() if np.ptp(line.get_ydata()) > 1.5
        ]
        np.testing.assert_allclose(joints, [*ends, total, total + solid], atol=1e-12)
        low, high = axes.get_xlim()
        assert low <= min(0.0, *(ends - shares), *ends) and high > 1.2 * max(*ends, total)


def test_numbers_have_the_digits_of_their_bands_and_three_dimensions_are_shown_where_known(
    waterfall, made
):
    said = [text.get_text().strip() for text in waterfall.axes[0].texts]
    shares = ["+0.22", "+11.80", "+0.53", "−0.31", "−0.14"]
    assert said == [*shares, "12.091 ± 0.013", "−10.67 ± 0.12", "1.42 ± 0.13"]
    text = " ".join(made.texts(waterfall))
    assert (
        "mobility 6, paros-weisbord" in text
        and "a stage $x_1$: error budget" in text
        and "assumed" not in text
    )
    chart = made.budget()
    chart.values["solid"] = np.where(np.arange(3)[:, None] == 0, chart.values["solid"], np.nan)
    ax = budget_figure(chart).axes[0]  # a chart has no band, and then no total
    assert [text.get_text().strip() for text in ax.texts][5:] == ["12.091 ± 0.013", "−10.53"]
    plain = budget_figure(made.budget(outside=False, assumed=("thickness_mm",)))
    assert [label.get_text() for label in plain.axes[0].get_yticklabels()][-2:] == [
        "large displacement",
        "total in the plane",
    ]
    assert "assumed dimensions" in " ".join(made.texts(plain))


DISTANCE = {  # relative, of the meshes 1/2, 1/3, 1/5, 1/8
    "x": 0.3 * np.array([2.0, 3.0, 5.0, 8.0]) ** -4,
    "y": 0.2 * np.array([2.0, 3.0, 5.0, 8.0]) ** -3,
    "θ": np.array([0.01, 0.02, 0.003, 0.007]),
}
SPREAD = {"x": 1.9e-4 / 0.0271, "y": 8.3e-4 / 0.0263, "θ": 4.1e-7 / 2.57e-5}


@pytest.fixture(scope="module")
def study(made):
    return convergence_figure(made.mesh_study(assumed=["thickness_mm"]))


def by_label(axes):
    return {line.get_label().replace("\n", " "): line for line in axes.get_lines()}


def slope(line):
    return np.polyfit(np.log(line.get_xdata()), np.log(line.get_ydata()), 1)[0]


def test_each_curve_is_the_distance_from_its_own_limit(study):
    (axes,) = study.axes
    lines = by_label(axes)
    for name, distance in DISTANCE.items():
        (line,) = [line for label, line in lines.items() if label.startswith(f"{name}:")]
        np.testing.assert_allclose(line.get_xdata(), [1 / 2, 1 / 3, 1 / 5, 1 / 8])
        np.testing.assert_allclose(line.get_ydata(), distance, rtol=1e-9)
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert [text.get_text() for text in axes.get_xticklabels()] == ["1/2", "1/3", "1/5", "1/8"]
    np.testing.assert_allclose(axes.get_xticks(), [1 / 2, 1 / 3, 1 / 5, 1 / 8])
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "triangle size / neck width",
        "relative error of the compliance",
    )


def test_an_order_is_the_slope_of_the_line_it_names(study):
    lines = by_label(study.axes[0])
    said = {label: found[1] for label in lines if (found := re.search(r"\border ([\d.]+)", label))}
    assert len(said) == 3  # X, Y and the guide; theta has none
    for label, order in said.items():
        assert slope(lines[label]) == pytest.approx(float(order), abs=0.05), label
    (guide,) = [
        line for label, line in by_label(study.axes[0]).items() if label.startswith("order")
    ]
    assert np.all(guide.get_ydata()[0] > np.array([distance[0] for distance in DISTANCE.values()]))


def test_the_bar_of_the_finest_mesh_ends_at_its_band(study):
    bars = [piece for found in study.axes[0].collections for piece in found.get_segments()]
    for bar, (name, distance) in zip(bars, DISTANCE.items(), strict=True):
        np.testing.assert_allclose(bar[:, 0], 1 / 8)
        np.testing.assert_allclose(
            sorted(bar[:, 1]), [min(distance[-1], SPREAD[name]), SPREAD[name]], rtol=1e-9
        )


def test_a_budget_of_a_mechanism_is_a_waterfall_without_round_off_or_held_directions():
    figure = errors.budget_figure(guide_budget())
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "(a) command in y",
        "(b) command in θ",
    ]
    bars = [bar for container in figure.axes[0].containers for bar in container.get_children()]
    drawn = [(bar.get_x(), bar.get_width()) for bar in bars if hasattr(bar, "get_width")]
    np.testing.assert_allclose(drawn, [(0, 3), (3, -1), (2, 0), (0, 2)], atol=1e-9)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["+3.00", "−1.00", "0", "2.00 ± 0.25"]
