"""Fig. 11 and the map of causes show the numbers of their records, in the units of their labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import flexfem
from flexfem.plot.experiment import experiment_figure, identification_figure, plot_push, plot_region, plot_remains
from flexfem.verify.fixture import read_fixture
from flexfem.verify.measured import MeasuredSlopes

ROOT = Path(__file__).parents[2]
FIXTURE = read_fixture(ROOT / "cases" / "fixture.toml")


@pytest.fixture(scope="module")
def stage():
    """Chains of unequal necks, so that X and Y differ."""
    return flexfem.load(ROOT / "geometry" / "mobility6.toml").replace(
        override={(1, "elbow"): {"neck": 0.41}, (3, "platform"): {"neck": 0.62}}
    )


@pytest.fixture(scope="module")
def found(stage):
    return flexfem.experiment(stage, FIXTURE, resolution=None)


def by_label(ax):
    handles, labels = ax.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


@pytest.mark.parametrize(
    ("direction", "factor", "unit", "own"), [("y", 1e3, "µm", "N/mm"), ("theta", 1e6, "µrad", "N mm/rad")]
)
def test_readings_and_lines_are_those_of_the_record(found, direction, factor, unit, own):
    ax = plot_push(Figure().subplots(), found, direction)
    push, row, shown = found.pushed[direction], found.table[direction], by_label(ax)
    for run in range(3):
        x, y = shown[f"readings, run {run + 1}"].get_data()
        np.testing.assert_allclose(x, factor * np.array(push.displacement[run]))
        np.testing.assert_allclose(y, push.load[run])
    lines = {
        "model: paros-weisbord, mobility 6, plane stress": row.model,
        "calibrated, elastic links, plane stress": row.metal,
        "line through the readings": push.slope,
    }
    for label, slope in lines.items():
        x, y = shown[label].get_data()
        assert (y[1] - y[0]) / (x[1] - x[0]) * factor == pytest.approx(slope, rel=1e-9)
    assert shown["line through the readings"].get_ydata()[0] == pytest.approx(push.intercept)
    for label in lines:  # over what was read, no further
        np.testing.assert_allclose(shown[label].get_xdata(), [0.0, factor * np.max(push.displacement)])
    assert f"({unit})" in ax.get_xlabel() and ax.get_ylabel().endswith("(N mm)" if direction == "theta" else "(N)")
    (text,) = (each.get_text() for each in ax.texts)
    assert own in text and f"{push.low:.5g}"[:5] in text and "95 %" in text


def test_what_the_line_leaves_and_the_ends_of_its_slope(found):
    ax = plot_remains(Figure().subplots(), found, "x")
    push, shown = found.pushed["x"], by_label(ax)
    left = np.array(push.load[1]) - push.intercept - push.slope * np.array(push.displacement[1])
    np.testing.assert_allclose(shown["readings, run 2"].get_ydata(), left)
    ends = [line for line in ax.lines if line.get_label() == "ends of the interval of the slope"]
    slopes = [1e3 * np.diff(line.get_ydata())[0] / np.diff(line.get_xdata())[0] for line in ends]
    np.testing.assert_allclose(slopes, [push.low - push.slope, push.high - push.slope])


def test_the_figure_says_what_it_is_not(found):
    figure = experiment_figure(found)
    said = " ".join(text.get_text() for text in figure.texts).replace("\n", " ")
    assert "no claim holds by it" in said and "assumed" in said and found.fixture in said
    assert [ax.get_title("left") for ax in figure.axes[:3]] == ["(a) X", "(b) Y", "(c) θ"]


def test_the_region_holds_the_best_fit_and_shows_both_causes(stage):
    slopes = MeasuredSlopes(kxx=35.0, kxx_sd=0.2, kyy=36.0, kyy_sd=0.2, ktt=33e3, ktt_sd=200.0)
    one = flexfem.identify(stage, FIXTURE.model_copy(update={"measured": slopes}))
    ax = plot_region(Figure().subplots(), one)
    shown = by_label(ax)
    assert shown["best fit"].get_xdata()[0] == pytest.approx(1e3 * one.offset.value)
    assert shown["best fit"].get_ydata()[0] == pytest.approx(one.fixture["pole"].value)
    necks = next(handle for label, handle in shown.items() if label.startswith("necks alone"))
    assert (necks.get_xdata()[0], necks.get_ydata()[0]) == (pytest.approx(1e3 * one.necks_alone.numbers[0]), 0.0)
    region, x, y = np.array(one.region.above), one.region.offset, one.region.fixture
    near = np.argmin(np.abs(np.array(x) - one.offset.value)), np.argmin(np.abs(np.array(y) - one.fixture["pole"].value))
    assert region[near] < one.region.limit == pytest.approx(5.9915, rel=1e-4) and region.max() > one.region.limit
    assert ax.get_xlabel() == "offset of all necks (µm), positive wider"
    assert ax.get_ylabel() == "pole, times as soft as described"
    low, high = ax.get_xlim()
    assert low < 1e3 * min(one.necks_alone.numbers[0], 0.0) and max(1e3 * one.offset.value, 0.0) < high
    for name, unit in (("translation", "mm/N"), ("rotation", "rad/(N mm)")):
        spring = one.model_copy(update={"fixture": {name: one.fixture["pole"]}})
        assert plot_region(Figure().subplots(), spring).get_ylabel() == f"fixture in {name} ({unit})"
    said = " ".join(text.get_text() for text in identification_figure(one).texts).replace("\n", " ")
    assert one.finding in said


def test_the_legend_names_what_one_panel_alone_shows(found):
    push = found.pushed["x"].model_copy(update={"low": None, "high": None})
    figure = experiment_figure(found.model_copy(update={"pushed": found.pushed | {"x": push}}))
    assert "ends of the interval of the slope" in [text.get_text() for text in figure.legends[0].get_texts()]
