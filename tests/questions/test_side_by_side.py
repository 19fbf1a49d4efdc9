"""Mechanisms side by side: known ratios, bands judged by hand, parts that only one has, names."""

from __future__ import annotations

import csv
import json
import math
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import flexfem as api
from flexfem.questions.compare import distinct_labels
from flexfem.questions.side_by_side import change_of, compared_number, judge, matched_names
from flexfem.refused import BadInput

from ..conftest import ROOT

GUIDE = ROOT / "geometry/parallelogram.toml"
UNKNOWN = (math.nan, math.nan)


@pytest.fixture(scope="module")
def guide():
    return api.load(GUIDE)


@pytest.fixture(scope="module")
def plane(guide):
    return guide.replace(model="plane_stress")


@pytest.fixture(scope="module")
def doubled(plane):
    return api.compare(plane, plane.replace(thickness=20.0), plane, models="analytic")


def test_twice_the_thickness_is_twice_the_stiffness_and_the_mass_at_one_frequency(doubled):
    for path in ("stiffness.free.x", "stiffness.held.y", "stiffness.free.theta", "mass"):
        first, second, third = doubled.number(path).values
        assert second / first == pytest.approx(2.0, rel=1e-9) and third == first
        assert doubled.change(path)[1:] == pytest.approx([100.0, 0.0], abs=1e-6)
        assert math.isnan(doubled.change(path)[0])
    assert doubled.change("modes.frequency.1")[1] == pytest.approx(0.0, abs=1e-6)
    assert doubled.number("modes.frequency.1").judged == ("", "equal", "equal")


def test_numbers_without_bands_are_not_judged(doubled):
    assert doubled.number("stiffness.free.x").judged == ("", "no band", "equal")
    assert "no band: a number states no ±, and the difference is not judged" in doubled.sentences()


def test_bands_of_finite_elements_judge_a_thinner_leaf_and_an_equal_one(plane):
    """A leaf bends with the cube of its thickness; 1 % of it is far beyond a band of 0.1 %."""
    thin = plane.replace(parameters={"neck_mm": 0.495})
    found = api.compare(plane, thin, plane, question="stiffness", resolution=4)
    along = found.number("stiffness.free.x")
    assert along.changes_percent[1] == pytest.approx(100 * (0.99**3 - 1), rel=0.03)
    assert along.judged == ("", "beyond the bands", "within the bands")
    assert along.changes_percent[2] == 0.0
    for which in (1, 2):
        apart = abs(along.values[which] - along.values[0])
        assert (apart > along.bands[0] + along.bands[which]) == (which == 1)


def test_the_bands_of_both_numbers_count():
    assert judge((10.0, 0.3), (10.6, 0.2)) == "beyond the bands"  # 0.6 > 0.5
    assert judge((10.0, 0.4), (10.6, 0.2)) == "within the bands"
    assert judge((10.0, 0.4), (9.3, 0.2)) == "beyond the bands"
    assert judge((0.0, 0.4), (0.3, 0.0)) == "within the bands"
    assert judge((10.0, 0.4), (10.6, math.nan)) == "no band"
    assert judge((10.0, math.nan), (10.0, math.nan)) == "equal"
    assert judge((math.inf, math.nan), (math.inf, math.nan)) == "equal"
    assert judge((math.inf, 0.1), (5.0, 0.1)) == "beyond the bands"
    assert judge((10.0, 0.4), UNKNOWN) == "not comparable"
    assert judge(UNKNOWN, UNKNOWN) == ""


@pytest.mark.parametrize(
    ("first", "other", "text"),
    [
        ((-2.0, 0.1), -3.0, "+50.0 %"),  # of a range towards -x
        ((-2.0, 0.1), 3.0, "opposite sign"),
        ((0.05, 0.1), 3.0, ""),  # zero within its band
        ((0.0, math.nan), 0.0, "0 %"),
        ((2.0, math.nan), 0.0, "-100 %"),
        ((2.0, math.nan), 30.0, "15 times"),
        ((2.0, math.nan), 2.000001, "0.00 %"),
        ((math.inf, math.nan), 3.0, ""),
    ],
)
def test_changes_of_negative_numbers_zeros_and_large_ones(first, other, text):
    assert math.isnan(change_of(first, other)) == (text == "")
    number = compared_number("path", ("force", ""), "N", [first, (other, math.nan)])
    assert number.change_text(1) == text


def test_a_single_part_of_another_name_is_the_same_part_and_others_are_not():
    assert matched_names("actuator", ["drive"], ["piezo"]) == (
        {"piezo": "drive"},
        ["actuator 'piezo' is compared with 'drive' of the first"],
    )
    names, notes = matched_names("point", ["output", "tip"], ["output", "a", "b"])
    assert names == {"output": "output"}
    assert notes == [
        "has no point 'tip': their numbers are not comparable",
        "point 'a', 'b' is not in the first: not comparable",
    ]


def test_a_mechanism_without_the_actuator_says_so(guide, tmp_path):
    path = tmp_path / "hand.toml"
    guide.replace(actuator=()).save(path)
    found = api.compare(guide, path, models="analytic")
    force = found.number("drive.force.drive")
    assert force.judged == ("", "not comparable") and math.isnan(force.values[1])
    assert any("hand: has no actuator 'drive'" in text for text in found.notes)
    assert any("drive force" in text and "not comparable" in text for text in found.sentences(True))
    assert found.number("stiffness.free.x").judged[1] == "equal"


def test_stage_files_are_compared_with_each_other_and_with_mechanisms(guide):
    three = api.load(ROOT / "geometry/mobility3.toml")
    six = api.load(ROOT / "geometry/mobility6.toml")
    found = api.compare(six, three, guide, models="analytic")
    at_rest = [api.stiffness(each, models="analytic") for each in (six, three)]
    stiff = [float(each.at("free", direction="theta")[-1]) for each in at_rest]
    assert found.number("stiffness.free.theta").values[:2] == pytest.approx(stiff)
    change = found.change("stiffness.free.theta")[1]
    assert change == pytest.approx(100 * (stiff[1] / stiff[0] - 1))
    assert found.inputs[0].key == "material.name"
    # both have plane stress then: a difference of models would be one of the mechanisms
    assert found.subjects[2].mechanism.model == "plane_stress"
    assert [each.other_design for each in found.plates] == [False, True]


@pytest.mark.slow
def test_a_stage_is_within_the_bands_of_its_replica(tmp_path):
    stage = ROOT / "geometry/mobility6.toml"
    api.export(api.load(stage), tmp_path / "replica.dxf")
    found = api.compare(stage, tmp_path / "replica.dxf")
    for axis in ("x", "y", "theta"):
        assert found.number(f"stiffness.free.{axis}").judged[1] == "within the bands"
    assert found.number("mass").changes_percent[1] < -5  # the drawing has a hole for the hub
    assert found.number("modes.frequency.1").judged[1] == "beyond the bands"


def test_labels_differ_where_files_have_one_name(guide):
    same = [Path("/a/v1/guide.toml"), Path("/a/v2/guide.toml")]
    assert distinct_labels(same) == ["v1/guide", "v2/guide"]
    assert distinct_labels([same[0], same[0]]) == ["guide", "guide (2)"]
    assert distinct_labels([Path("part.toml"), Path("part.dxf")]) == ["part.toml", "part.dxf"]
    assert distinct_labels([Path("a.toml"), Path("b.toml")]) == ["a", "b"]
    assert distinct_labels([guide, guide]) == ["parallelogram", "parallelogram (2)"]


def test_tables_fit_a_terminal_and_files_have_all_numbers(doubled, flexfem, tmp_path):
    rows = list(csv.DictReader(StringIO(doubled.to_csv())))
    assert {row["path"] for row in rows} == {each.path for each in doubled.numbers}
    free = next(row for row in rows if row["path"] == "stiffness.free.x")
    assert free["parallelogram (2) change (%)"] == "100" and free["unit"] == "N/mm"
    frame = doubled.to_frame()
    assert frame.loc["stiffness, others free, x (N/mm)", "parallelogram (2) change (%)"] == (
        pytest.approx(100.0)
    )
    assert len(doubled.to_frame(long=True)) == 3 * len(doubled.numbers)
    stored = json.loads(doubled.write(tmp_path / "found.json").read_text())
    assert stored["numbers"][0]["values"] == list(doubled.numbers[0].values)
    five = [str(GUIDE)] * 5
    code, out, err = flexfem("compare", *five, "--models", "analytic")
    assert code == 0, err
    table = out.split("inputs that differ")[0].splitlines()
    numbers = table[table.index("numbers, and changes from parallelogram:") :]
    assert max(len(line) for line in numbers[: numbers.index("")] or numbers) <= 80


def test_a_page_is_one_file_with_numbers_drawing_and_sources(guide):
    from flexfem.page.compare import comparison_page

    odd = guide.replace(name="<b>odd</b> & co")
    found = api.compare(guide, odd, question="modes", models="analytic")
    for text in (comparison_page(found), found._repr_html_()):
        assert "&lt;b&gt;odd&lt;/b&gt; &amp; co" in text and "<b>odd" not in text
    page = comparison_page(found)
    assert page.count("<svg") == 1 and "natural frequency, mode 1 (Hz)" in page
    assert "Sources of the numbers" in page and "http://" not in page.replace("http://www.w3", "")
    assert "flexfem compare" in page and "--question modes --models analytic" in page


def test_an_unknown_number_is_named(doubled):
    with pytest.raises(BadInput, match=r"did you mean stiffness\.free\.x\?"):
        doubled.change("stiffnes.free.x")


def test_the_overlay_draws_every_plate_in_its_place(guide):
    """Edges of the second plate are those of its layout, and of the first only where both agree."""
    from flexfem.plot.compare import overlay_figure

    wide = guide.replace(parameters={"distance_mm": 44.0})
    figure = overlay_figure(api.compare(guide, wide, question="modes", models="analytic"))
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    right = [
        max(np.max(line.get_xdata()) for line in figure.axes[0].lines if line.get_color() == colour)
        for colour in (
            lines["parallelogram (reference)"].get_color(),
            lines["parallelogram (2)"].get_color(),
        )
    ]
    assert right == pytest.approx([25.0, 27.0])  # half of the distance, and 5 mm
