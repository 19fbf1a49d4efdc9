"""The figures of the code's own verification at large displacements."""

from __future__ import annotations

import numpy as np

from flexfem.benchmark.elastica import Elastica
from flexfem.benchmark.taylor import Remainders
from flexfem.report.bending import elastica_figure, taylor_figure

LOADS = np.array([1.0, 3.0, 5.0, 10.0])
FINE = np.linspace(0.1, 10.0, 30)


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


def test_the_observed_slopes_are_in_the_legend() -> None:
    axes = taylor_figure(remainders()).axes[0]
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert [text.split("slope ")[1].split()[0] for text in texts] == ["1.000", "1.100", "1.930"]
    assert axes.get_xscale() == axes.get_yscale() == "log"
