"""The page of a study by its command: what is collected is shown, what is not there is said in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flexfem.page import report as page
from flexfem.studies import run_study

from .test_study import FRONT, GRID


def test_a_study_that_was_not_run_is_refused_in_one_line_and_nothing_is_written(flexfem):
    Path("small.toml").write_text(GRID + FRONT)
    code, out, err = flexfem("report", "small.toml", "--folder", "kept", "-o", "page.html")
    assert code == 2 and out == "" and err.count("\n") == 1
    assert (
        err.startswith("flexfem: ")
        and "12 of 12 designs are open in kept/small/parts, expected all done by" in err
        and "--partial" not in err
    )
    assert not Path("page.html").exists() and not Path("kept").exists()


def test_sections_of_a_stage_are_refused_for_a_study(flexfem):
    Path("small.toml").write_text(GRID + FRONT)
    code, out, err = flexfem("report", "small.toml", "--sections", "modes", "-o", "page.html")
    assert (code, out) == (2, "") and err.endswith("they are of a stage, and this is a study\n")
    assert not Path("page.html").exists()


def test_the_line_that_makes_the_page_again_names_the_parts_of_the_study():
    line = page.command_line([Path("a b.toml")], Path("x.html"), kept=Path("far away"))
    assert line == "flexfem report 'a b.toml' -o x.html --folder 'far away'"
    assert page.command_line([Path("a.toml")], Path("x.html")) == "flexfem report a.toml -o x.html"


@pytest.mark.slow
def test_a_study_that_was_run_becomes_a_page(flexfem):
    Path("small.toml").write_text(GRID + FRONT)
    run_study("small.toml", "kept", workers=1)
    code, out, err = flexfem("report", "small.toml", "--folder", "kept", "-o", "page.html", "--json")
    assert code == 0
    said, html = json.loads(out), Path("page.html").read_text()
    assert said["bytes"] == len(html.encode()) < 1e6 and said["written"] == "page.html"
    assert said["sections"] == ["What the study asks", "Stiffness XX against range in X at yield", said["sections"][2]]
    assert "report: what the study asks" in err and "report: sources" in err
    assert "flexfem report small.toml -o page.html --folder kept" in html
