"""Figs. 5 to 7: what is drawn is what is stored, and round-off is called so."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from flexfem.plot.errors import HONEST, error_figure
from flexfem.units import DIRECTIONS

ERRORS = {"mobility three": (0.1407, 0.0311, -0.0523), "mobility six": (-0.0712, 3e-5, 0.0411)}
BANDS = {"mobility three": (0.0173, 0.0273, 0.0373), "mobility six": (0.1173, 0.1273, 0.1373)}  # per cent
NAMES = {"x": "X", "y": "Y", "theta": "θ"}
LEVER = 21.0


@pytest.fixture(scope="module")
def drawn(made):
    """A result for each direction and its figure."""
    results = {axis: made.result(ERRORS, direction=axis, commanded=[-0.05, 0.0, 0.02, 0.05]) for axis in DIRECTIONS}
    return {axis: (result, error_figure(result)) for axis, result in results.items()}


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_curves_and_their_bands_are_the_stored_numbers_in_the_units_of_the_axes(made, drawn, direction):
    result, figure = drawn[direction]
    command = np.array([-0.05, 0.0, 0.02, 0.05])
    for k, (freedom, axes) in enumerate(zip(DIRECTIONS, figure.axes, strict=True)):
        assert axes.get_ylabel().startswith(f"error in {NAMES[freedom]} (")
        along = "commanded" if freedom == direction else "cross"
        assert axes.get_title(loc="left") == f"({'abc'[k]}) {NAMES[freedom]}, {along} direction"
        across, up = made.size_in(figure.axes[2].get_xlabel()), made.size_in(axes.get_ylabel())
        comparable = (LEVER if direction == "theta" else 1.0) / (LEVER if freedom == "theta" else 1.0)
        lines = axes.get_lines()[1:]
        for line, fill, label in zip(lines, axes.collections, ERRORS, strict=True):
            assert line.get_label().strip() == label
            np.testing.assert_allclose(across * line.get_xdata(), command, rtol=1e-12)
            error = ERRORS[label][k] * command * comparable
            np.testing.assert_allclose(up * line.get_ydata(), error, rtol=1e-12, atol=1e-18)
            band = BANDS[label][k] / 100 * np.abs(command) * comparable
            expected = np.column_stack([command / across, (error - band) / up, (error + band) / up])
            np.testing.assert_allclose(made.extent(fill), expected, rtol=1e-9, atol=1e-12)
            assert tuple(fill.get_facecolor()[0][:3]) == to_rgb(line.get_color())
    assert figure.axes[2].get_xlabel().startswith(f"commanded {NAMES[direction]} (")
    assert result.case == "fig"


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_round_off_is_not_drawn_to_full_scale(made, direction):
    tiny = (3e-13, -2e-14, 8e-10)
    result = made.result({"one": tiny, "two": tiny[::-1]}, direction=direction)
    figure = error_figure(result)
    for freedom, axes in zip(DIRECTIONS, figure.axes, strict=True):
        assert not axes.collections
        comparable = (21.0 if direction == "theta" else 1.0) / (21.0 if freedom == "theta" else 1.0)
        half = HONEST * 0.05 * comparable / made.size_in(axes.get_ylabel())
        assert axes.get_ylim() == pytest.approx((-half, half))
        (said,) = [text.get_text() for text in axes.texts]
        number, unit = said.removeprefix("round-off only: largest ").split(" ")
        largest = max(np.max(np.abs(line.get_ydata())) for line in axes.get_lines())
        power = int(number.split("×10")[1].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))
        assert float(number.split("×10")[0]) * 10.0**power == pytest.approx(largest, rel=0.1)
        assert f"({unit})" in axes.get_ylabel()


def test_each_panel_has_its_own_percentages_and_bands_beside_their_lines(made, drawn):
    _, figure = drawn["y"]
    expected = [
        ["mobility three: 14.070 ± 0.017 %", "mobility six: −7.12 ± 0.12 %"],
        ["mobility three: 3.110 ± 0.027 %", "mobility six: 0.00 ± 0.13 %"],
        ["mobility three: −5.230 ± 0.037 %", "mobility six: 4.11 ± 0.14 %"],
    ]
    for axes, said in zip(figure.axes, expected, strict=True):
        legend = axes.get_legend()
        assert [text.get_text().replace("\n", " ").replace("\xa0", " ") for text in legend.get_texts()] == said
        looks = [(line.get_color(), line.get_marker()) for line in legend.get_lines()]
        assert looks == [(line.get_color(), line.get_marker()) for line in axes.get_lines()[1:]]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_commanded_direction_may_show_displacement_over_command(made, direction):
    command = np.array([-0.05, 0.0, 0.02, 0.05])
    result = made.result(ERRORS, direction=direction, commanded=command.tolist(), drive="joints")
    figure = error_figure(result, displacement=True)
    k = DIRECTIONS.index(direction)
    for row, axes in enumerate(figure.axes):
        assert axes.get_ylabel().startswith(f"{'displacement' if row == k else 'error'} in {NAMES[DIRECTIONS[row]]} (")
    axes = figure.axes[k]
    across, up = made.size_in(figure.axes[2].get_xlabel()), made.size_in(axes.get_ylabel())
    model, *curves = axes.get_lines()
    np.testing.assert_allclose(up * model.get_ydata(), command, rtol=1e-12)
    for line, fill, (label, error) in zip(curves, axes.collections, ERRORS.items(), strict=True):
        np.testing.assert_allclose(across * line.get_xdata(), command, rtol=1e-12)
        np.testing.assert_allclose(up * line.get_ydata(), (1 + error[k]) * command, rtol=1e-12, atol=1e-18)
        band, moved = BANDS[label][k] / 100 * np.abs(command), (1 + error[k]) * command
        expected = np.column_stack([command / across, (moved - band) / up, (moved + band) / up])
        np.testing.assert_allclose(made.extent(fill), expected, rtol=1e-9, atol=1e-12)
    shown = [text.get_text().replace("\n", " ") for text in axes.get_legend().get_texts()]
    assert len(shown) == 2 and all(": error " in text for text in shown)
    assert "in the commanded direction, its error across, joints imposed" in " ".join(made.texts(figure))


def test_labels_of_any_kind_and_what_is_assumed_are_said(made, drawn):
    labels = ["_under", "a $dollar_{ label", "long " * 30]
    for assumed, note in ((["thickness_mm", "case: points"], "assumed dimensions"), (["case: points"], "assumed comm")):
        figure = error_figure(made.result({label: (0.1, 0.2, 0.3) for label in labels}, assumed=assumed))
        assert [text[: len(note)] for text in made.texts(figure) if "assumed" in text] == [note]
    shown = [text.get_text().replace("\n", " ") for text in figure.axes[0].get_legend().get_texts()]
    assert "_under" in shown[0]
    assert "a $dollar_{ label" in shown[1]
    assert len(shown) == 3
    assert not any("assumed" in text for text in made.texts(drawn["x"][1]))
