"""From nothing to a part: new files, drawings and solids, as a new user asks for them in an empty folder."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from flexfem.mechanism.stage import load_feasible
from flexfem.study.loaded import load_study
from flexfem.questions.case import LoadedCase

ROOT = Path(__file__).parents[2]
HOSTILE = 'a "b" <i>&amp; $HOME #1.toml'


def test_a_new_stage_is_the_reference_stage_with_every_number_assumed(flexfem):
    code, out, err = flexfem("new", "mine.toml")
    assert (code, err) == (0, "") and out.startswith("written: mine.toml\nwarning: all numbers are those of")
    assert "next: flexfem check mine.toml\n" in out and os.listdir() == ["mine.toml"]
    made, shipped = (load_feasible(path) for path in ("mine.toml", ROOT / "geometry/mobility6.toml"))
    assert made.hash == shipped.hash and made.drive_hash == shipped.drive_hash and made.heat_hash == shipped.heat_hash
    assert made.name == "my stage" and made.not_stated == () and set(made.assumed) >= set(shipped.assumed)
    assert made.drive_doubts.not_stated == made.heat_doubts.not_stated == []
    assert flexfem("check", "mine.toml")[0] == 0


def test_a_new_case_and_study_are_of_the_new_stage_whatever_it_is_called(flexfem):
    code, out, _ = flexfem("new", HOSTILE, "--case", "--study", "--json")
    stem = HOSTILE.removesuffix(".toml")
    said = json.loads(out)
    assert code == 0 and said["written"] == [HOSTILE, f"{stem}-case.toml", f"{stem}-study.toml"]
    case, study = LoadedCase(Path(said["written"][1])), load_study(Path(said["written"][2]))
    stage = load_feasible(HOSTILE)
    assert [each.hash for each in case.stages.values()] == [stage.hash] * 2
    assert study.stage.hash == stage.hash and len(study.study.factor) == 2
    assert case.case.not_stated == () and study.study.not_stated == ()
    assert said["commands"][-1] == f"flexfem study run '{stem}-study.toml'"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["new", "there.toml"], "there.toml: exists, expected the name of a new file; nothing is written"),
        (["new", "there", "--case"], "there: expected a file name that ends in .toml"),
        (["new", "fresh.toml", "--study"], "fresh-study.toml: exists"),
        (["new", "link.toml"], "link.toml: exists"),
        (["new", "none/mine.toml"], "no folder none, expected one that is there"),
        (["new", "there.toml/mine.toml"], "no folder there.toml"),
        (["new", "two\nlines.toml"], r"two\nlines.toml: expected a plain file name"),
        (["new", "two\nlines/mine.toml"], r"two\nlines/mine.toml: no folder two\nlines, expected"),
        (["new", ".hidden.toml"], ".hidden.toml: expected a plain file name"),
        (["new", ".toml"], ".toml: expected a file name"),
        (["new", f"{234 * 'x'}.toml", "--case"], "x-case.toml: a name of more than 240 bytes"),
        (["new", f"{300 * 'x'}.toml"], "cannot be written: File name too long"),
        (["schema", "stage", "-o", 300 * "x"], "cannot be written: File name too long"),
        (["new"], "missing argument 'FILE'"),
        (["export", "there.toml"], "missing option '--output'"),
        (["export", "there.toml", "-o", "part.dwg"], "part.dwg: extension '.dwg', expected"),
        (["export", "there.toml", "-o", "there.toml"], "there.toml: extension '.toml', expected"),
        (["export", "there.toml", "-o", "none/part.dxf"], "no folder none"),
        (["export", "there.toml", "-o", "folder.svg"], "folder.svg: is a folder"),
        (["export", "there.toml", "-o", "part.dxf", "--kerf", "nan"], "kerf nan, expected a number from 0.01"),
        (
            ["export", "there.toml", "-o", "part.dxf", "--holes", "-3"],
            "mounting holes -3.0, expected a number from 0.01",
        ),
        (["export", "none.toml", "-o", "part.dxf"], "none.toml: no such file"),
        (["view", "none.toml"], "none.toml: no such file"),
        (["view", "fresh-study.toml"], "fresh-study.toml: nothing to draw"),
        (["view", "there.toml", "-o", "there.toml"], "there.toml is a file, expected a folder"),
        (["export", "fresh-study.toml", "-o", "part.dxf"], "fresh-study.toml"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line_and_nothing_is_written(flexfem, arguments, said):
    Path("there.toml").write_text((ROOT / "geometry/mobility6.toml").read_text())
    Path("fresh-study.toml").write_text("")
    Path("link.toml").symlink_to("nowhere")
    Path("folder.svg").mkdir()
    before = sorted(os.listdir())
    code, out, err = flexfem(*arguments)
    assert (code, out) == (2, "") and err.count("\n") == 1 and said in err, err
    assert sorted(os.listdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_takes_no_file_is_named(flexfem):
    Path("shut").mkdir(mode=0o500)
    assert "no permission to write in shut" in flexfem("new", "shut/mine.toml")[2]


def test_export_prints_what_it_wrote_with_units(flexfem):
    flexfem("new", "mine.toml")
    code, out, err = flexfem("export", "mine.toml", "-o", "part.svg", "--kerf", 0.3, "--holes", 4.5)
    assert (code, err) == (0, "")
    rows = dict(line.split(": ", 1) for line in out.splitlines() if not line.startswith("warning"))
    assert rows["written"] == "part.svg" and rows["thickness"] == "10 mm" and rows["kerf"] == "0.3 mm"
    assert rows["area"] == "2925.6008 mm^2" and rows["volume"] == "29256.008 mm^3"
    assert rows["length of the contours"] == "882.38017 mm" and rows["length of the wire's path"] == "879.55274 mm"
    assert rows["mounting holes"] == "4.5 mm" and "METAL, HUB_HOLE, MOUNTING_HOLES" in rows["layers"]
    assert "warning: the mounting holes are in no model" in out and "18 of these numbers are assumed" in out
    record = json.loads(flexfem("export", "mine.toml", "-o", "part.svg", "--json")[1])
    assert record["area"] == pytest.approx(2973.3138, abs=1e-4) and record["kerf"] is None


def test_view_says_where_the_picture_is_and_what_is_missing(flexfem, monkeypatch):
    monkeypatch.setattr("flexfem.plot.write.rendered", lambda figure, form: form.encode())
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    flexfem("new", "mine.toml")
    text = Path("mine.toml").read_text()
    Path("half.toml").write_text(text.replace("thickness_mm = 10.0", "").replace('"thickness_mm" =', '"name" ='))
    code, out, err = flexfem("view", "half.toml")
    assert (code, err) == (0, "") and "written: half-drawing.png\n" in out and Path("half-drawing.pdf").stat().st_size
    assert "warning: thickness_mm: missing, and what needs it is not drawn\n" in out
    assert "18 of these numbers are assumed" in out
