"""The regression gate: what moves a number is seen, and what does not is not."""

from __future__ import annotations

import json

import pytest

from flexfem.errors import BadInput
from flexfem.verify.baseline import Metric, Move, accept, baseline_folder, check
from flexfem.verify.case import LoadedCase
from flexfem.verify.protocol import run_case


def moved(case):
    loaded = LoadedCase(case)
    return [move.metric for move in check(loaded, run_case(loaded)[0], baseline_folder(loaded))]


@pytest.mark.parametrize("case", ["fig5", "fig6", "fig7"])
def test_shipped_numbers_stand(project, case):
    assert moved(project.path(f"cases/{case}.toml")) == []


@pytest.mark.parametrize(
    ("edit", "seen"),
    [
        (("youngs_modulus_gpa = 71.7", "youngs_modulus_gpa = 71.7717"), ("analytic stiffness", "committed mesh")),
        (("neck_mm = 0.5", "neck_mm = 0.5005"), ("analytic stiffness", "displacement")),
        (("poissons_ratio = 0.33", "poissons_ratio = 0.35"), ("committed mesh",)),
    ],
    ids=["Young's modulus by 0.1 %", "necks by 0.1 %", "Poisson's ratio"],
)
def test_a_small_change_of_the_stage_is_seen(project, edit, seen):
    project.edit("geometry/mobility6.toml", edit)
    names = moved(project.path("cases/fig5.toml"))
    for kind in seen:
        assert any(f"mobility six: {kind}" in name for name in names), kind
    assert not any("mobility three" in name for name in names)


def test_another_command_moves_displacements_but_no_percentage(project):
    names = moved(project.edit("cases/fig5.toml", ("amplitude_um = 50.0", "amplitude_um = 50.1")))
    assert {name.split(": ")[1] for name in names} == {"displacement x"}


def test_curves_that_come_and_go_are_seen(project):
    names = moved(project.edit("cases/fig5.toml", ('label = "mobility six"', 'label = "mobility 6"')))
    assert {name.split(":")[0] for name in names} == {"mobility six", "mobility 6"}


def test_a_line_says_was_is_and_allowed():
    was = Metric(value=14.0, allowed=0.006, unit="percentage points")
    line = str(Move("fig5", "mobility six: error x", was, was.model_copy(update={"value": 14.25})))
    assert line == ("fig5: mobility six: error x was 14, is 14.25, moved +0.25, allowed 0.006 percentage points")


def test_not_a_number_is_no_number_that_stands():
    was = Metric(value=1.0, allowed=1.0, unit="mm")
    assert not abs(float("nan") - was.value) <= was.allowed  # the comparison that `check` makes


def test_a_baseline_keeps_the_history_of_reasons(project):
    loaded = LoadedCase(project.path("cases/fig7.toml"))
    folder = baseline_folder(loaded)
    before = json.loads((folder / "fig7.json").read_text())["history"]
    accept(loaded, run_case(loaded)[0], folder, "  thicker necks wanted ")
    after = json.loads((folder / "fig7.json").read_text())["history"]
    assert after[:-1] == before
    assert after[-1]["reason"] == "thicker necks wanted"
    with pytest.raises(BadInput, match="reason"):
        accept(loaded, run_case(loaded)[0], folder, " ")


@pytest.mark.parametrize("text", ["", "{", '{"case": "fig5"}', "[]", "\x00"])
def test_a_damaged_baseline_is_refused_in_one_line(project, text):
    project.path("tests/baselines/fig5.json").write_text(text)
    with pytest.raises(BadInput, match="not a baseline") as refusal:
        moved(project.path("cases/fig5.toml"))
    assert "\n" not in str(refusal.value)


def test_a_damaged_committed_mesh_is_refused(project):
    for mesh in project.path("tests/baselines").glob("*.npz"):
        mesh.write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(BadInput, match="expected a committed mesh"):
        moved(project.path("cases/fig5.toml"))
