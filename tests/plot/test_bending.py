"""The figures of the code's own verification at large displacements."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.plot.accuracy import elastica_figure, taylor_figure
from flexfem.validate.bending import Elastica, Remainders

LOADS = np.array([1.0, 3.0, 5.0, 10.0])
FINE = np.linspace(0.1, 10.0, 30)
NAMES = ("1", "3", "5", "P L²/EI = 10")


def elastica() -> Elastica:
    shapes = np.stack([np.column_stack([np.linspace(0, 1 - 0.05 * p, 7), np.linspace(0, 0.08 * p, 7)]) for p in LOADS])
    return Elastica(LOADS, 0.08 * LOADS, 0.05 * LOADS, shapes, FINE, 0.081 * FINE, 0.052 * FINE, 42)


def remainders() -> Remainders:
    step = 10.0 ** np.arange(0.0, -9.01, -0.5)
    return Remainders(step, step, 0.5 * step**1.93, 0.5 * step**1.1, 99)


def test_ours_and_the_exact_solution_are_both_drawn() -> None:
    found = elastica()
    load, shape = elastica_figure(found).axes
    exact, ours = load.get_lines()[0], load.get_lines()[1]
    np.testing.assert_array_equal(np.column_stack(exact.get_data()), np.column_stack([found.exact_across, FINE]))
    np.testing.assert_array_equal(np.column_stack(ours.get_data()), np.column_stack([found.across, LOADS]))
    bars = [np.column_stack(line.get_data()) for line in shape.get_lines()[1:5]]
    np.testing.assert_array_equal(bars, found.shapes)
    tips = np.column_stack(shape.get_lines()[5].get_data())
    np.testing.assert_allclose(tips, np.column_stack([1 - found.exact_along, found.exact_across]))
    (left, right), (low, high) = shape.get_xlim(), shape.get_ylim()
    assert left < 0 < 1 < right and low < 0 and high > found.shapes[..., 1].max()


def test_the_elastica_says_which_curve_is_which_and_in_what() -> None:
    load, shape = elastica_figure(elastica()).axes
    assert (load.get_xlabel(), load.get_ylabel()) == ("displacement of the tip / L", "P L² / (E I)")
    assert (shape.get_xlabel(), shape.get_ylabel()) == ("x / L", "y / L")
    lines = load.get_lines()
    for k, (name, ours, exact) in enumerate(
        (("across the beam, v/L", 0.08, 0.081), ("along the beam, u/L", 0.05, 0.052))
    ):
        np.testing.assert_allclose(lines[2 * k].get_xdata(), exact * FINE)
        np.testing.assert_allclose(lines[2 * k + 1].get_xdata(), ours * LOADS)
        assert lines[2 * k + 1].get_label() == name and lines[2 * k].get_color() == lines[2 * k + 1].get_color()
    assert [text.get_text() for text in load.get_legend().get_texts()] == [
        "across the beam, v/L",
        "along the beam, u/L",
    ]
    said = {text.get_text(): text.xy for text in shape.texts}
    assert said == {
        name: (pytest.approx(1 - 0.05 * p), pytest.approx(0.08 * p)) for name, p in zip(NAMES, LOADS, strict=True)
    }
    caption = " ".join(text.get_text().replace("\n", " ") for text in elastica_figure(elastica()).texts)
    assert "bent by up to 0.80 of its length" in caption and "42 unknowns" in caption


def test_each_remainder_has_its_observed_slope_in_the_legend() -> None:
    (axes,) = taylor_figure(remainders()).axes
    found = remainders()
    series = {"nothing taken off": found.none, "tangent without its geometric part": found.material}
    series["tangent stiffness"] = found.ours
    slopes = {"nothing taken off": "1.000", "tangent without its geometric part": "1.100", "tangent stiffness": "1.930"}
    for line, text in zip(axes.get_lines(), axes.get_legend().get_texts(), strict=True):
        name, _, said = text.get_text().partition(":\nslope ")
        np.testing.assert_array_equal(line.get_ydata(), series[name])
        np.testing.assert_array_equal(line.get_xdata(), found.step)
        slope = np.polyfit(np.log(line.get_xdata()), np.log(line.get_ydata()), 1)[0]
        assert said.split(" ")[0] == slopes[name] and float(slopes[name]) == pytest.approx(slope)
        assert said.endswith("at small steps") == (name != "tangent stiffness")
    assert len({line.get_color() for line in axes.get_lines()}) == 3
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("step over the largest", "remainder of the forces, relative")
