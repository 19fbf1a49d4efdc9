"""Mesh convergence drawn: distances from each direction's own limit, and an order that is the slope it is next to."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flexfem.plot.errors import convergence_figure

DISTANCE = {  # relative, of the meshes 1/2, 1/3, 1/5, 1/8
    "X": 0.3 * np.array([2.0, 3.0, 5.0, 8.0]) ** -4,
    "Y": 0.2 * np.array([2.0, 3.0, 5.0, 8.0]) ** -3,
    "θ": np.array([0.01, 0.02, 0.003, 0.007]),
}
BAND = {"X": 1.9e-4 / 0.0271, "Y": 8.3e-4 / 0.0263, "θ": 4.1e-7 / 2.57e-5}


@pytest.fixture(scope="module")
def figure(made):
    return convergence_figure(made.mesh_study(assumed=["thickness_mm"]))


def by_label(axes):
    return {line.get_label().replace("\n", " "): line for line in axes.get_lines()}


def slope(line):
    return np.polyfit(np.log(line.get_xdata()), np.log(line.get_ydata()), 1)[0]


def test_each_curve_is_the_distance_from_its_own_limit(figure):
    (axes,) = figure.axes
    lines = by_label(axes)
    for name, distance in DISTANCE.items():
        (line,) = [line for label, line in lines.items() if label.startswith(f"{name}:")]
        np.testing.assert_allclose(line.get_xdata(), [1 / 2, 1 / 3, 1 / 5, 1 / 8])
        np.testing.assert_allclose(line.get_ydata(), distance, rtol=1e-9)
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert [text.get_text() for text in axes.get_xticklabels()] == ["1/2", "1/3", "1/5", "1/8"]
    np.testing.assert_allclose(axes.get_xticks(), [1 / 2, 1 / 3, 1 / 5, 1 / 8])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("triangle size at the necks / t", "relative mesh error")


def test_an_order_is_the_slope_of_the_line_it_names(figure):
    lines = by_label(figure.axes[0])
    said = {label: found[1] for label in lines if (found := re.search(r"\border ([\d.]+)", label))}
    assert len(said) == 3  # X, Y and the guide; theta has none
    for label, order in said.items():
        assert slope(lines[label]) == pytest.approx(float(order), abs=0.05), label
    (guide,) = [line for label, line in by_label(figure.axes[0]).items() if label.startswith("order")]
    assert np.all(guide.get_ydata()[0] > np.array([distance[0] for distance in DISTANCE.values()]))


def test_the_bar_of_the_finest_mesh_ends_at_its_band(figure):
    bars = [piece for found in figure.axes[0].collections for piece in found.get_segments()]
    for bar, (name, distance) in zip(bars, DISTANCE.items(), strict=True):
        np.testing.assert_allclose(bar[:, 0], 1 / 8)
        np.testing.assert_allclose(sorted(bar[:, 1]), [min(distance[-1], BAND[name]), BAND[name]], rtol=1e-9)
