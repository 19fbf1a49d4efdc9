"""Figs. 5 to 7: what is drawn is what is stored, and round-off is called so."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from flexfem.report.curves import HONEST, error_figure, normalisation, panel_of
from flexfem.units import unit_for
from flexfem.verify.case import DIRECTIONS

ERRORS = {"mobility three": (0.1407, 3e-5, -2e-4), "mobility six": (0.0712, 1e-15, 4e-4)}


def texts(figure):
    found = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        found += [text.get_text() for text in axes.texts]
        found += [text.get_text() for text in axes.get_legend().get_texts()]
    return found


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_curves_are_the_stored_numbers(made, direction):
    result = made.result(ERRORS, direction=direction)
    for freedom, axes in zip(DIRECTIONS, error_figure(result).axes, strict=True):
        lines = [line for line in axes.get_lines() if len(line.get_xdata()) == len(result.commanded)]
        unit = panel_of(result, freedom).unit
        command = unit_for(direction, max(result.commanded))
        assert unit.name in axes.get_ylabel()
        for line, (label, series) in zip(lines, result.curves.items(), strict=True):
            assert line.get_label().strip() == label
            np.testing.assert_array_equal(line.get_xdata(), np.array(result.commanded) * command.factor)
            np.testing.assert_array_equal(line.get_ydata(), np.array(getattr(series, freedom)) * unit.factor)


def test_every_curve_is_seen_whole(made):
    for axes in error_figure(made.result(ERRORS)).axes:
        low, high = axes.get_ylim()
        for line in axes.get_lines()[1:]:
            assert low < np.min(line.get_ydata())
            assert np.max(line.get_ydata()) < high


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_round_off_is_not_drawn_to_full_scale(made, direction):
    tiny = (3e-13, -2e-14, 8e-10)
    result = made.result({"one": tiny, "two": tiny[::-1]}, direction=direction)
    figure = error_figure(result)
    for freedom, axes in zip(DIRECTIONS, figure.axes, strict=True):
        panel = panel_of(result, freedom)
        assert panel.round_off
        comparable = (21.0 if direction == "theta" else 1.0) / (21.0 if freedom == "theta" else 1.0)
        assert panel.half / panel.unit.factor == pytest.approx(HONEST * 0.05 * comparable)
        assert axes.get_ylim() == pytest.approx((-panel.half, panel.half))
        assert any("round-off only: largest" in text.get_text() for text in axes.texts)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_an_error_just_above_round_off_is_drawn(made, direction):
    result = made.result({"one": (1e-15, 1e-15, 1e-15), "two": (2e-9, 2e-9, 2e-9)}, direction=direction)
    assert not any(panel_of(result, freedom).round_off for freedom in DIRECTIONS)
    assert not any("round-off" in text for text in texts(error_figure(result)))


def test_percentages_are_in_the_legend_of_their_panel(made):
    figure = error_figure(made.result(ERRORS))
    shown = [" ".join(text.get_text() for text in axes.get_legend().get_texts()) for axes in figure.axes]
    for axes_text, number in zip(shown, ("14.070 ± 0.017 %", "0.003 ± 0.017 %", "−0.020 ± 0.017 %"), strict=True):
        assert number in axes_text.replace("\n", " ").replace("\N{NO-BREAK SPACE}", " ")


def test_curves_differ_by_more_than_colour(made):
    many = {f"curve {k}": (0.1, 0.1, 0.1) for k in range(8)}
    lines = error_figure(made.result(many)).axes[0].get_lines()[1:]
    assert len({line.get_color() for line in lines}) == len({line.get_marker() for line in lines}) == 8
    widths = [line.get_linewidth() for line in lines]
    assert all(before > after for before, after in pairwise(widths))


@pytest.mark.parametrize(
    ("assumed", "note"),
    [([], None), (["thickness_mm", "case: points"], "assumed dimensions"), (["case: points"], "assumed commands")],
)
def test_assumed_numbers_are_announced_exactly_when_there_are_some(made, assumed, note):
    found = [text for text in texts(error_figure(made.result(ERRORS, assumed=assumed))) if "assumed" in text]
    assert found == ([note] if note else [])


def test_normalisation_names_lever_and_directions(made):
    assert "Y relative to the commanded translation; θ times l₃ = 21 mm" in normalisation(made.result(ERRORS))
    assert "commanded rotation times l₃ = 21 mm" in normalisation(made.result(ERRORS, direction="theta"))


def test_labels_of_any_kind_are_drawn_as_they_are(made):
    labels = ["_under", "a $dollar_{ label", "long " * 30]
    figure = error_figure(made.result({label: (0.1, 0.2, 0.3) for label in labels}))
    shown = [text.get_text().replace("\n", " ") for text in figure.axes[0].get_legend().get_texts()]
    assert "_under" in shown[0]
    assert "a $dollar_{ label" in shown[1]
    assert len(shown) == 3
