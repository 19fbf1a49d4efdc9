"""`flexfem experiment`, `identify` and `stiffness --necks`: what they print, write and refuse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ..conftest import stored

ROOT = Path(__file__).parents[2]
STAGE, FIXTURE = ROOT / "geometry" / "mobility6.toml", ROOT / "cases" / "fixture.toml"
SLOPES = """name = "slopes"
[measured]
kxx_n_per_mm = 35.4
kxx_sd_n_per_mm = 0.18
ktt_n_mm_per_rad = 3.28e4
ktt_sd_n_mm_per_rad = 160.0
"""


@pytest.fixture
def slopes(tmp_path):
    (tmp_path / "slopes.toml").write_text(SLOPES)
    return tmp_path / "slopes.toml"


@pytest.mark.usefixtures("unrendered")
def test_an_experiment_prints_table_ii_and_writes_figure_11(flexfem, slopes, tmp_path):
    asked = ("experiment", STAGE, FIXTURE, "--measured", slopes, "--resolution", 3)
    code, out, err = flexfem(*asked, "--output", tmp_path / "out")
    assert (code, err) == (0, "")
    found = stored(tmp_path / "out/mobility6-experiment.json")
    assert found == json.loads(flexfem(*asked, "--json")[1])
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".json", ".png", ".pdf"}
    for axis in ("x", "y", "theta"):
        row, push = found["table"][axis], found["pushed"][axis]
        (line,) = (line for line in out.splitlines() if line.startswith(f"{axis} ("))
        said = f"{row['simulated']:.5g} ({push['low']:.5g} to {push['high']:.5g})"
        assert f"{row['model']:.5g}" in line and f"{row['metal']:.5g}" in line and said in line
    assert "x (N/mm)" in out and "theta (N mm/rad)" in out and "35.4 ± 0.18" in out and "finite elements" in out
    assert f"{found['table']['theta']['deviation']['measured']:+.2f} %" in out
    assert "no number here is one of them, and no claim holds by it" in out
    assert "measured: measured.kxx_n_per_mm" in found["not_stated"] and "fixture: pole.height_mm" in found["assumed"]


def test_without_measured_slopes_the_papers_deviations_are_explained(flexfem):
    code, out, _ = flexfem("experiment", STAGE, FIXTURE, "--analytic")
    assert code == 0 and "2.23 times as stiff as the stage" in out and "37.5 times" in out
    assert "after the paper's text" in out and "measured" not in out.split("deviation")[0]


@pytest.mark.usefixtures("unrendered")
def test_identify_prints_what_it_stores(flexfem, slopes, tmp_path):
    code, out, err = flexfem("identify", STAGE, slopes, "--output", tmp_path / "out")
    assert (code, err) == (0, "")
    found = stored(tmp_path / "out/mobility6-identify.json")
    assert found == json.loads(flexfem("identify", STAGE, slopes, "--json")[1])
    assert found["finding"] in out and "These data cannot tell them apart." in out
    assert f"offset of all nine necks: {1e3 * found['offset']['value']:.4g} um" in out
    assert "no upper end" in out and "mm/N" in out and "rad/(N mm)" in out
    narrow = json.loads(flexfem("identify", STAGE, slopes, "--confidence", 68.27, "--json")[1])
    assert found["offset"]["low"] < narrow["offset"]["low"]


def test_measured_necks_print_the_stage_as_made(flexfem, tmp_path):
    rows = [f"{c},{h},{490 + 5 * c},2" for c in (1, 2, 3) for h in ("base", "elbow", "platform")]
    path = tmp_path / "necks.csv"
    path.write_text("\n".join(["chain,hinge,neck_um,sd_um", *rows]))
    asked = ("stiffness", STAGE, "--necks", path, "--links", "--formula", "calibrated")
    code, out, err = flexfem(*asked)
    found = json.loads(flexfem(*asked, "--json")[1])
    assert (code, err) == (0, "") and "495 to 505 um" in out
    for k, axis in enumerate(("x", "y", "theta")):
        (line,) = (line for line in out.splitlines() if line.startswith(f"{axis} ("))
        assert f"{found['stiffness'][k][k]:.5g}" in line and f"{found['low'][k]:.5g} to" in line
    path.write_text("\n".join(["chain,hinge,neck_um,sd_um", *rows[:-1]]))
    code, out, err = flexfem(*asked)
    assert (code, out) == (2, "") and "platform of chain 3 is missing" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("experiment", STAGE, STAGE), "this is a stage file, expected a fixture file"),
        (("experiment", STAGE, "none.toml"), "none.toml: no such file"),
        (("experiment", STAGE, FIXTURE, "--analytic", "--resolution", 4), "expected one of the two"),
        (("experiment", STAGE, FIXTURE, "--measured", FIXTURE, "--formula", "none"), "'none' is not known"),
        (("identify", STAGE, FIXTURE), "no [measured] slopes"),
        (("identify", STAGE, STAGE), "this is a stage file, expected a measured file"),
        (("identify", STAGE, FIXTURE, "--unknown", "bar"), "--unknown bar, expected pole or springs"),
        (("identify", STAGE, FIXTURE, "--confidence", "nan"), "--confidence"),
    ],
)
def test_bad_input_is_refused_in_one_line_and_nothing_is_written(flexfem, tmp_path, command, said):
    output = () if command[0] == "stiffness" else ("--output", tmp_path / "out")
    code, out, err = flexfem(*command, *output)
    assert (code, out) == (2, "") and said in err and "Traceback" not in err
    assert not (tmp_path / "out").exists()
