"""Which finite elements are asked of a proposed design, by how many meshes and workers; what answers is a stand-in."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from flexfem.refused import ComputationFailed
from flexfem.study.columns import Rows
from flexfem.study.workers import Failure
from flexfem.synthesis import elements
from flexfem.synthesis.elements import ProposedElements

from .conftest import HEAD, NECK, RADIUS, ROOT, best, require

STIFFEST = best("maximise", "kxx_n_per_mm")
OWN = np.array([0.55, 2.0])


def row_of(study, design, status="ok", reason=""):
    """Whatever is asked, the resolution of the mesh and the number of the design."""
    said = study.study.resolution + 100.0 * design
    return Rows(np.array([status]), np.array([reason], dtype=object), np.full((1, len(study.outputs)), said))


@pytest.fixture
def asked(monkeypatch):
    """Studies that are answered, in this process."""
    found = []

    def answer(study, start, stop):
        assert stop == start + 1
        found.append(study)
        return row_of(study, start)

    monkeypatch.setattr(elements, "answer", answer)
    return found


def test_a_design_is_solved_on_three_meshes_up_to_the_resolution_coarse_to_fine(load, asked):
    loaded = load(NECK, RADIUS, require("error_x_percent", None, 20), STIFFEST, head=HEAD + "resolution = 13\n")
    found = ProposedElements(loaded, Counter()).of(OWN)
    assert found.resolutions == (7, 10, 13)
    assert [columns["kxx_n_per_mm"] for columns in found.columns] == [7.0, 10.0, 13.0]
    for study in asked:
        stage = study.stage
        assert (stage.hinges.elbow.neck, stage.hinges.platform.radius, stage.hinges.base.radius) == (0.55, 2.0, 4.0)
        assert (study.study.model, study.study.formula, study.study.mobility) == ("verify", "paros-weisbord", None)


def test_a_stage_corrected_for_its_thickness_is_solved_as_it_is_on_two_meshes(load, asked, tmp_path):
    base = (ROOT / "geometry/mobility6.toml").read_text()
    (tmp_path / "base.toml").write_text(base.replace("thickness_mm", 'model = "corrected"\nthickness_mm', 1))
    head = HEAD.replace(str(ROOT / "geometry/mobility6.toml"), "base.toml")
    counts = Counter()
    found = ProposedElements(load(NECK, RADIUS, STIFFEST, head=head), counts).of(OWN)
    assert [(each.study.model, each.study.resolution, each.study.layers) for each in asked] == [
        ("three_dimensional", 4, 2), ("three_dimensional", 6, 3)
    ]  # fmt: skip
    assert {each.stage.model for each in asked} == {"plane_stress"} and found.resolutions == (4, 6)
    assert counts == {"finite elements in three dimensions": 2}


def test_without_errors_of_a_formula_no_formula_is_asked_and_what_is_known_is_neither_solved_nor_counted_again(
    load, asked
):
    counts = Counter()
    proposed = ProposedElements(load(NECK, RADIUS, STIFFEST), counts)
    first, again = proposed.of(OWN), proposed.of(OWN)
    assert [study.study.model for study in asked] == ["fe"] * 3 and first == again
    assert counts == {"finite elements": 3}
    proposed.of(OWN + 0.01)
    assert len(asked) == 6 and counts == {"finite elements": 6}


def test_an_answer_is_kept_for_the_versions_that_gave_it(load, asked, monkeypatch):
    proposed = ProposedElements(load(NECK, RADIUS, STIFFEST), Counter())
    proposed.of(OWN)
    monkeypatch.setattr(elements, "versions_of", lambda meshed: {"flexfem": "another"})
    proposed.of(OWN)
    assert len(asked) == 6


def test_scattered_stages_are_each_a_design_of_their_own(load, asked):
    loaded = load(
        NECK, RADIUS, "[tolerance]\nneck_um = 5.0\nstages = 72\nchecked = 8\n", best("minimise", "coupling_95")
    )
    coarse, fine = ProposedElements(loaded, Counter()).scattered(OWN)
    assert np.array_equal(coarse, [[4.0 + 100 * k for k in range(8)]] * 3)
    assert np.array_equal(fine, [[6.0 + 100 * k for k in range(8)]] * 3)


def test_couplings_of_scattered_stages_are_xy_xt_yt(load, monkeypatch):
    loaded = load(
        NECK, RADIUS, "[tolerance]\nneck_um = 5.0\nstages = 72\nchecked = 8\n", best("minimise", "coupling_95")
    )
    said = {"coupling_xy": 1.0, "coupling_xt": 2.0, "coupling_yt": 3.0}
    row = lambda study: [said.get(name, 0.0) for name in study.outputs]  # noqa: E731
    monkeypatch.setattr(
        elements, "answer", lambda study, start, stop: row_of(study, start)._replace(values=np.array([row(study)]))
    )
    assert [each[:, 0].tolist() for each in ProposedElements(loaded, Counter()).scattered(OWN)] == [[1.0, 2.0, 3.0]] * 2


def test_a_solution_that_fails_says_why_and_is_not_kept(load, monkeypatch):
    proposed = ProposedElements(load(NECK, RADIUS, STIFFEST), Counter())
    monkeypatch.setattr(elements, "answer", lambda study, *pair: row_of(study, 0, "failed", "the mesh folds"))
    with pytest.raises(ComputationFailed, match="finite elements of a proposed design: the mesh folds"):
        proposed.of(OWN)
    monkeypatch.setattr(elements, "answer", lambda study, *pair: row_of(study, 0))
    assert proposed.of(OWN).columns[0]["kxx_n_per_mm"] == 4.0


class Dying:
    """Workers, which die over the mesh of 6 triangles across a neck."""

    def results(self, function, next_task, limit):
        while (task := next_task()) is not None:
            died = task[1].study.study.resolution == 6
            yield task, Failure("crashed", "the worker died") if died else function(*task)


def test_a_mesh_that_kills_its_worker_fails_in_one_line(load, asked):
    with pytest.raises(ComputationFailed, match="finite elements of a proposed design: the worker died"):
        ProposedElements(load(NECK, RADIUS, STIFFEST), Counter(), Dying()).of(OWN)
