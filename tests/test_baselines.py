"""Accepted numbers: what moved is named with by how much, and what they were made from is named key
by key.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from flexfem import baselines
from flexfem.analytic.plates import hinge_compliance_of
from flexfem.baselines import baseline, check, inputs_of, kept, kind_of, read, regression
from flexfem.fem.ports import plate_of_layout
from flexfem.paper.stage import load_feasible
from flexfem.questions.stiffness import stiffness
from flexfem.refused import BadInput

from .tolerances import DENSE


@pytest.fixture
def accepted(project, monkeypatch, tmp_path):
    """The baseline of a stage for one quick question."""
    only = {"paper": lambda stage: stiffness(stage, models="analytic")}
    monkeypatch.setattr("flexfem.paper.baseline.QUESTIONS", only)
    path = project.path("geometry/mobility6.toml")
    (made,) = baseline(path, reason="first", baselines=tmp_path / "kept")
    return path, made


KEY = "stiffness.analytic.x.x"


def edited(made, change):
    """Change the stored numbers of the one question."""
    data = json.loads(made.read_text())
    change(data["numbers"]["paper"])
    made.write_text(json.dumps(data))


def test_what_was_accepted_stands_within_its_gate(accepted):
    path, made = accepted
    assert regression(made) == ([path.stem], [])
    assert len(read(made)["numbers"]["paper"]) > 40 and "mesh" in read(made)["numbers"]
    edited(made, lambda numbers: numbers[KEY].insert(0, numbers[KEY].pop(0) * (1 + 1e-13)))
    assert check(made) == []


BASELINE = '{"kind": "stage", "file": "x", "history": %s, "inputs": %s, "numbers": %s}'


@pytest.mark.parametrize(
    "content",
    [
        100_000 * "[" + 100_000 * "]",
        BASELINE % ("[{}]", '{"x": [["k", 1]]}', "{}"),
        BASELINE % ("[{}]", "{}", '{"q": {"k": [1, []]}}'),
        BASELINE % ("[{}]", "{}", f'{{"q": {{"k": [1{400 * "0"}]}}}}'),
        BASELINE % ("[]", "{}", "{}"),
    ],
    ids=["nested", "pairs", "lists", "huge", "no history"],
)
def test_what_is_no_baseline_is_refused_in_one_line(content, tmp_path):
    (tmp_path / "odd.json").write_text(content)
    with pytest.raises(BadInput, match=r"odd\.json: not a baseline of this version of flexfem$"):
        read(tmp_path / "odd.json")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda numbers: numbers.update({KEY: [numbers[KEY][0] * (1 + 1e-3)]}),
            [f"paper.{KEY} was ", "moved -0.0"],
        ),
        (lambda numbers: numbers.update(of_old=[1.0]), ["paper.of_old is gone, was 1"]),
        (lambda numbers: numbers.pop(KEY), [f"paper.{KEY} is new: "]),
        (
            lambda numbers: numbers[KEY].append(0.5),
            ["paper.stiffness: its bands appeared or disappeared"],
        ),
    ],
)
def test_what_moved_came_or_went_is_named(accepted, change, said):
    _, made = accepted
    edited(made, change)
    (line,) = check(made)
    assert line.startswith("mobility6: paper.") and all(each in line for each in said)


def test_a_changed_input_is_named_key_by_key_with_how_far_the_numbers_moved(accepted, project):
    path, made = accepted
    before = sorted(made.parent.iterdir())
    project.edit("geometry/mobility6.toml", ("thickness_mm = 10.0", "thickness_mm = 11.0"))
    said, moved = check(made)
    assert moved.startswith("mobility6: paper: ") and "numbers moved, most " in moved
    assert " %)" in moved and sorted(made.parent.iterdir()) == before
    assert regression(path, baselines=made.parent).findings == [said, moved]
    assert "thickness_mm was 10.0, is 11.0" in said and "the input changed" in said
    found = inputs_of(project.path("cases/fig5.toml"))
    assert (
        "../geometry/mobility3.toml" in found
        and "thickness_mm" in found["../geometry/mobility3.toml"]
    )
    named = project.edit(
        "geometry/mobility6.toml", ('name = "mobility six, reference"', 'name = "mobility6.toml"')
    )
    assert list(inputs_of(named)) == ["mobility6.toml"]


def test_a_kept_mesh_that_is_not_of_the_stage_is_refused(accepted):
    path, made = accepted
    stage = load_feasible(path)
    (mesh,) = made.parent.glob("*.npz")
    with np.load(mesh) as held:
        arrays = dict(held)
    np.savez(mesh, **arrays | {"nodes": arrays["nodes"] * 1.01})
    with pytest.raises(BadInput, match="not a mesh of"):
        kept(stage, path, made.parent)


def test_a_thousandth_in_a_hinge_or_in_the_modulus_moves_the_numbers_of_a_mechanism(
    project, monkeypatch, tmp_path
):
    monkeypatch.setattr(
        baselines, "QUESTIONS", {"rest": lambda plate: stiffness(plate, models="analytic")}
    )

    (made,) = baseline(
        project.path("geometry/parallelogram.toml"), reason="first", baselines=tmp_path / "kept"
    )
    assert (
        check(made) == []
        and read(made)["kind"] == "mechanism"
        and list(made.parent.glob("parallelogram-*.npz"))
    )

    def softer(*profile_and_plate):
        return 1.001 * hinge_compliance_of(*profile_and_plate)

    def stiffer(layout, layers=None, mesh=None):
        return plate_of_layout(
            layout._replace(youngs_modulus=1.001 * layout.youngs_modulus), layers, mesh
        )

    with monkeypatch.context() as planted:
        planted.setattr("flexfem.analytic.plates.hinge_compliance_of", softer)
        said = check(made)
    (line,) = (each for each in said if "rest.stiffness.analytic.theta.theta was" in each)
    before, after = (
        float(line.split(word)[1].replace(",", "").split()[0]) for word in ("was ", "is ")
    )
    assert after / before == pytest.approx(1 / 1.001, rel=DENSE) and all(
        ": rest." in each for each in said
    )
    with monkeypatch.context() as planted:
        planted.setattr("flexfem.fem.ports.plate_of_layout", stiffer)
        said = check(made)
    assert said[0].startswith("parallelogram: mesh.compliance.output_x.output_x was ")
    assert all(": mesh." in each for each in said)


def test_a_file_without_a_baseline_beside_others_is_named(accepted, project):
    _, made = accepted
    (said,) = regression(made.parent).findings
    assert "mobility3.toml: no baseline in" in said and project


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda made: made.write_text("{}"), "not a baseline of this version"),
        (lambda made: made.write_text(made.read_text()[:-40]), "not a baseline of this version"),
    ],
)
def test_a_damaged_baseline_is_a_finding(accepted, change, said):
    _, made = accepted
    change(made)
    assert said in regression(made.parent).findings[0]
    made.parent.joinpath("none").mkdir()
    for named in (made, made.with_suffix(".gone"), made.parent / "none"):
        with pytest.raises(BadInput):
            regression(named)


def test_a_reason_is_asked_for_and_kept(accepted):
    path, made = accepted
    with pytest.raises(BadInput, match="reason is empty"):
        baseline(path, reason=" ", baselines=made.parent)
    baseline(path, reason="second", baselines=made.parent)
    assert [each["reason"] for each in read(made)["history"]] == ["first", "second"]


def test_files_that_have_no_numbers_are_refused(project):
    other = project.path("geometry/mobility6.toml").with_name("other.toml")
    other.write_text("a = 1\n")
    with pytest.raises(BadInput, match="expected a stage, a mechanism, a case or a study"):
        kind_of(other)


def test_the_command_ends_with_one_where_a_number_moved(accepted, flexfem):
    _, made = accepted
    edited(made, lambda numbers: numbers.update({KEY: [1.0]}))
    code, out, _ = flexfem("regression", made)
    assert code == 1 and "paper.stiffness.analytic.x.x was 1" in out
