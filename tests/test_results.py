"""Results: what follows from a declaration of quantities."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

import flexfem
from flexfem.questions.check import known_formulas
from flexfem.questions.reach import Reach
from flexfem.questions.summary import Summary
from flexfem.refused import BadInput
from flexfem.results import About, Gate, Quantity, Result, number, record_parts


class Trial(Result):
    """A result with every kind of quantity."""

    title = "a trial"
    main_result = ("pose", {})
    labels: ClassVar = {"case": ("cold", "very hot"), "model": ("analytic", "finite elements")}
    mass = Quantity("mass", "kg")
    pose = Quantity(
        "displacement", ("mm", "mm", "rad"), ("case", "model", "direction"), Gate(1e-3), "pose"
    )
    stress = Quantity("stress", "mpa", ("case", "model", "hinge"), Gate(0.1))


POSE = [[[0.01, 0.02, 4e-10], [0.0125, 0.02, 1e-8]], [[0.0, 0.0, 2e-3], [np.nan, 0.0, 1e-3]]]
STRESS = [[[1.0, 5.0, 2.0], [4.0, 3.0, 2.0]], [[1.0, 1.0, 3.0], [0.5, 2.0, 1.0]]]
BANDS = {"pose": [[[np.nan] * 3, [0.0003, np.nan, np.nan]], [[np.nan] * 3] * 2]}


@pytest.fixture
def found() -> Trial:
    about = About("a stage", "a.toml", "abc", ["thickness_mm"], [], 20.0)
    return Trial(
        about, {"mass": 2e-3, "pose": POSE, "stress": STRESS}, BANDS, settings={"resolution": 8}
    )


def test_a_table_has_units_bands_differences_and_where_the_largest_is(found: Trial) -> None:
    single, table, stress = found.tables()
    assert single.rows == [["mass", "2 kg"]]
    assert table.head == ["case", "model", "x", "y", "theta"] and table.caption == "displacement"
    assert table.rows == [
        ["cold", "analytic", "10 um", "20 um", "0"],
        ["", "finite elements", "12.50 ± 0.30 um", "20 um", "10 nrad"],
        ["", "difference (%)", "-20.00", "+0.00", "-96.00"],
        ["very hot", "analytic", "0", "0", "2 mrad"],
        ["", "finite elements", "", "0", "1 mrad"],
        ["", "difference (%)", "", "", "+100.00"],
    ]
    cold = "cold x 12.50 ± 0.30 um, y 20 um, theta 10 nrad"
    hot = "very hot y 0, theta 1 mrad"
    assert found.answer() == f"displacement (finite elements): {cold}; {hot}"
    assert stress.head == ["case", "model", "stress (MPa)"]
    assert stress.rows[:3] == [
        ["cold", "analytic", "5\nelbow"],
        ["", "finite elements", "4\nbase"],
        ["", "difference (%)", "+25.00"],
    ]


def test_a_number_within_its_band_has_the_prefix_of_the_band(found: Trial) -> None:
    """40 pm in a band of 55 nm was printed as `0 ± 55000 pm`."""
    pose = np.array(POSE)
    bands = np.array(BANDS["pose"])
    pose[0, 1, 0] = 4e-8
    bands[0, 1, 0] = 5.5e-5
    near_zero = Trial(found.about, {**found.internal.values, "pose": pose}, {"pose": bands})
    assert near_zero.tables()[1].rows[1][2] == "0 ± 55 nm"


class Share(Result):
    title = "a share"
    part = Quantity("part", "percent", ("model", "direction"))


def test_a_table_has_no_empty_columns_and_no_percentage_of_round_off() -> None:
    parts = [[0.5, 0.0, np.nan], [2.0, 1e-9, np.nan]]
    bands = [[0.1, 1e-8, np.nan], [0.1, 4e-3, np.nan]]
    (table,) = Share(
        About("s"), {"part": parts}, {"part": bands}, {"model": ("one", "other")}
    ).tables()
    assert table.head == ["model", "x (%)", "y (%)"]
    assert [row[1:] for row in table.rows[:2]] == [
        ["0.50 ± 0.10", "0"],
        ["2.00 ± 0.10", "0 ± 0.0040"],
    ]


def test_a_document_has_declared_units_and_reads_back(found: Trial, tmp_path: Path) -> None:
    path = found.write(tmp_path / "trial.json")
    data = json.loads(path.read_text())
    jsonschema.validate(data, Trial.schema())
    assert data["quantities"]["mass"]["values"] == pytest.approx(2.0)  # kg, of tonne inside
    assert data["quantities"]["pose"]["values"][1][1] == [None, 0.0, 0.001]
    again = Result.read(path)
    assert (
        isinstance(again, Trial)
        and again.settings == {"resolution": 8}
        and again.about.lever == 20.0
    )
    np.testing.assert_allclose(again.pose, found.pose)
    np.testing.assert_allclose(again.band("pose"), found.band("pose"))
    assert float(again.mass) == pytest.approx(2.0)
    path.write_text(path.read_text().replace("12", "13"))
    with pytest.raises(BadInput, match="changed since it was stored"):
        Result.read(path)


def test_a_gate_is_relative_to_the_pose_with_rotations_times_the_lever(found: Trial) -> None:
    by_path = {each.path: each for each in found.entries()}
    assert by_path["pose.cold.analytic.theta"].accepted == pytest.approx(1e-3 * 0.02 / 20.0)
    assert by_path["pose.very_hot.analytic.x"].accepted == pytest.approx(1e-3 * 2e-3 * 20.0)
    assert by_path["stress.cold.analytic.elbow"].accepted == pytest.approx(0.5)
    assert by_path["pose.cold.finite_elements.x"].accepted_band == pytest.approx(0.05 * 0.0003)


def test_labels_choose_parts_and_unknown_ones_are_refused(found: Trial) -> None:
    np.testing.assert_array_equal(found.at("stress", case="very hot", hinge="platform"), [3.0, 1.0])
    with pytest.raises(BadInput, match="case 'warm', expected one of: cold, very hot"):
        found.at("stress", case="warm")
    with pytest.raises(
        BadInput, match=r"trial\.stres is not in this result, expected one of: mass, pose, stress"
    ):
        found.band("stres")


def test_markdown_and_the_frame_have_the_same_numbers(found: Trial) -> None:
    assert "| cold | analytic | 10 µm |" in found.to_markdown()
    frame = found.to_frame(long=True).set_index("path")
    assert frame.loc["mass", "value"] == pytest.approx(2.0) and frame.loc["mass", "unit"] == "kg"


NUMBERS = [
    (12.50638, 0.0092, "12.5064 ± 0.0092"),
    (-1e-12, 0.1, "0 ± 0.10"),
    (3.14159265, np.nan, "3.1416"),
    (7181.54, 3.9, "7181.5 ± 3.9"),
    (2107906.0, 1437.0, "2107900 ± 1400"),
    (2107906.0, np.nan, "2107900"),
    (np.nan, 1.0, ""),
    (np.inf, np.nan, "unlimited"),
    (2.0, np.inf, "2 ± inf"),
    (291.674613, 5.8e-7, "291.6746"),
    (-30.0, 410.0, "0 ± 410"),
    (3e-9, 6.1e-6, "0 ± 6.1e-6"),
    (50.0, 410.0, "50 ± 410"),
    (1.357e10, np.nan, "1.357e10"),
    (2.4e-5, np.nan, "2.4e-5"),
    (1.1043e-5, 3.5e-8, "1.1043e-5 ± 3.5e-8"),
    (-0.0, np.nan, "0"),
]


@pytest.mark.parametrize(("value", "band", "text"), NUMBERS)
def test_a_number_has_as_many_digits_as_its_band_carries(
    value: float, band: float, text: str
) -> None:
    assert number(value, band) == text


def test_a_notebook_shows_heading_main_result_tables_and_warnings_escaped(found: Trial) -> None:
    about = found.about._replace(name="<b>& stage")
    shown = Trial(about, *found.internal, found.axes, found.settings, ["t/R < 0.1"])._repr_html_()
    root = ElementTree.fromstring(
        f"<div>{shown.replace('<br>', '<br/>')}</div>"
    )  # XML: every element is closed
    texts = ["".join(each.itertext()) for each in root.iter()]
    assert f"<b>& stage: {found.title}; resolution 8" in texts and "Warning: t/R < 0.1" in texts
    cells = [[cell.text for cell in row] for row in root.iter("tr")]
    assert any(row[:3] == ["cold", "analytic", "10 µm"] for row in cells), cells


def test_a_dataset_of_xarray_has_labels_declared_units_and_bands(found: Trial) -> None:
    pytest.importorskip("xarray")
    data = found.to_xarray()
    assert float(data["mass"]) == pytest.approx(2.0) and data["mass"].attrs == {
        "meaning": "mass",
        "unit": "kg",
    }
    here = {"case": "cold", "model": "finite elements", "direction": "x"}
    assert float(data["pose"].sel(here)) == 0.0125 and float(data["pose_band"].sel(here)) == 0.0003
    assert data["pose"].attrs["unit"] == "mm, mm, rad" and "stress_band" not in data
    assert data["stress"].sel(case="cold", model="analytic", hinge="elbow").item() == 5.0
    with (
        pytest.MonkeyPatch.context() as patched,
        pytest.raises(ImportError, match=r"^[^\n]*xarray[^\n]*$"),
    ):
        patched.setitem(sys.modules, "xarray", None)
        found.to_xarray()


class Bent(Result):
    """A result whose largest stress is in one of several hinges."""

    title = "bending"
    stress = Quantity("stress", "mpa", ("point", "hinge"), Gate(3e-4), "all")
    input = Quantity("input", "n", gate=Gate(1e-9))


class NamedBent(Bent):
    """The same under another name in documents."""

    kind_name = "bent_bar"
    mass = Quantity("mass", "kg")


def test_a_subclass_adds_quantities_to_its_own_kind_alone_and_may_have_a_name_of_its_own():
    assert [*Bent.quantities] == ["stress", "input"]
    assert [*NamedBent.quantities] == ["stress", "input", "mass"]
    assert Result.kinds["bent_bar"] is NamedBent
    assert Result.kinds["bent"] is Bent
    axes = {"point": ("output", "tip"), "hinge": ("left", "right")}
    values = {"stress": [[1.0, 2.0], [3.0, 1.0]], "input": 4.0}
    found = NamedBent(About("m"), values, axes=axes)
    assert found.at("stress", point="tip", hinge="left") == 3.0
    assert found.tables()[0].rows[1] == ["tip", "3\nleft"]
    accepted = {entry.path: entry.accepted for entry in found.entries()}
    assert accepted["stress.tip.left"] == pytest.approx(3e-4 * 3.0)
    assert accepted["input"] == pytest.approx(4e-9)
    jsonschema.validate(found.to_dict() | {"digest": ""}, NamedBent.schema())


def test_texts_are_those_of_the_stated_label_of_a_column_too():
    axes = {"point": ("output", "tip"), "hinge": ("left", "right")}

    class BentByPoint(Bent):
        columns = ("point",)

    found = BentByPoint(About("m"), {"stress": [[1.0, 2.0], [3.0, 1.0]]}, axes=axes)
    assert found.texts("stress", point="tip", hinge="right") == ["1 MPa (right)"]
    assert found.texts("stress", hinge="right", point="tip") == ["1 MPa (right)"]


def test_a_range_is_printed_with_both_ends() -> None:
    record = known_formulas()["smith-chetwynd"]
    assert record.t_over_R == (0.2, 1.0) and ("t over R", "0.2 to 1") in record_parts(record)[0]


def test_a_value_below_a_millionth_of_what_matters_is_zero_whatever_its_band():
    """30 +- 230 prad beside 17 um: at a lever of 36 mm the rotation is 1 pm. 130 nrad, or 5 nm, is
    no round-off.
    """
    ends = np.array([[[[0.0, 0, 0]], [[17e-3, 0.02e-6, 30e-12]]]] * 2)
    band = np.array([[[[0.0, 0, 0]], [[1e-6, 0.4e-9, 230e-12]]]] * 2)
    about = About("one", lever=36.0)
    found = Reach(about, {"ends": ends}, {"ends": band}, {"model": ("finite elements",)})
    assert found.texts("ends", others="free", end="high", model="finite elements")[2] == "0"
    turned = ends + np.array([0, 0, 130e-9])
    found = Reach(about, {"ends": turned}, {"ends": band}, {"model": ("finite elements",)})
    assert found.texts("ends", others="free", end="high", model="finite elements")[2].startswith(
        "130.03 ±"
    )
    far = Reach(
        about._replace(lever=3.6e5), {"ends": ends}, {"ends": band}, {"model": ("finite elements",)}
    )
    assert far.texts("ends", others="free", end="high", model="finite elements")[2].startswith(
        "30 ±"
    )


def test_the_end_of_a_range_is_compared_with_the_other_end():
    """The lower end is round-off in x and theta; the upper one is 17 um along x."""
    values = {"free_low": [0.0, 0.0, -30e-12], "free_high": [17e-3, 2e-9, 0.0]}
    found = Summary(About("one", lever=36.0), values, {"free_low": [0.0, 0.0, 230e-12]})
    assert found.texts("free_low") == ["0", "0", "0"] and found.texts("free_high")[1:] == ["0", "0"]


def test_a_wide_frame_has_a_row_for_each_model_and_units_in_its_columns():
    pytest.importorskip("pandas")
    axes = {"point": ("output", "tip"), "hinge": ("left", "right")}
    values = {"stress": [[1.0, 2.0], [3.0, 1.0]], "input": 4.0}
    found = Bent(About("m"), values, {"input": 0.5}, axes)
    frame = found.to_frame()
    assert frame["stress tip left (MPa)"].tolist() == [3.0]
    assert frame["input (N)"].tolist() == [4.0]
    assert frame["input band (N)"].tolist() == [0.5]
    assert "stress tip left band (MPa)" not in frame
    assert [*found.to_frame("input")] == ["input (N)", "input band (N)"]
    with pytest.raises(BadInput, match="mass is not in this result"):
        found.to_frame("mass")
    stiffness = flexfem.stiffness("geometry/parallelogram.toml", models="analytic", no_limits=True)
    by_model = stiffness.to_frame("free", "held")
    assert by_model.index.tolist() == ["analytic"]
    assert by_model.loc["analytic", "free theta (N mm/rad)"] == stiffness.at("free")[0, 2]


class Detailed(Result):
    """A result with a detail and two motions."""

    kind_name = "detailed_for_a_test"
    main_result = ("motion", {})
    motion = Quantity("motion", "motion", ("case", "direction"))
    limit = Quantity("limit", "", ("case", "limit", "direction"), note="1 where it governs")
    matrix = Quantity("matrix", "", ("case",), detail=True, note="of the detail")


def test_brief_tables_leave_out_details_and_state_units_in_headings():
    values = {
        "motion": [[1e-3, 2.0, 0.0], [1e-6, 4.0, 0.0]],
        "limit": [[[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]] * 2,
        "matrix": [7.0, 8.0],
    }
    axes = {"case": ("a", "b"), "limit": ("yield", "stroke")}
    found = Detailed(About("part"), values, axes=axes)
    motion, limit = found.tables(brief=True)
    assert motion.head == ["case", "x (um)", "y (mm)", "theta"]
    assert motion.rows == [["a", "1", "2", "0"], ["b", "0.001", "4", "0"]]
    assert limit.rows[0] == ["a", "yield", "stroke", "stroke"]
    assert found.left_out() == ["matrix"] and found.sentences(brief=True) == []
    assert len(found.tables()) == 3 and "matrix: of the detail" in found.sentences()
