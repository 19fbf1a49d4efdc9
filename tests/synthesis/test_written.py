"""Which files `flexfem.design` writes, what it hands to the search, and which changes of a file change its hash."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.refused import BadInput
from flexfem.study.loaded import LoadedStudy
from flexfem.synthesis import outcome
from flexfem.synthesis.front import best_of, proven
from flexfem.synthesis.mapping import Mapped, Proof
from flexfem.synthesis.model import Model
from flexfem.synthesis.requirements import load_requirements
from flexfem.synthesis.stored import read_design

from .conftest import HEAD, LINK, NECK, RADIUS, best, require
from .recorded import FRONT, STAGE, recorded

DRIVE, DRIFT = "[drive]\nactuators = true\n", "[drift]\n"
WANTED = require("kxx_n_per_mm", 60.0), best("maximise", "range_x_um"), best("maximise", "ktt_n_mm_per_rad")


def test_a_stage_those_of_the_front_and_the_record_are_written_and_what_was_kept_goes(tmp_path, monkeypatch):
    wanted, folder, handed = tmp_path / "wanted.toml", tmp_path / "out", []
    wanted.write_text("\n".join([HEAD, NECK, RADIUS, *WANTED]))

    def found(loaded, elements, say):
        elements.store.keep("a question", 1.0)
        handed.append((sorted(path.name for path in folder.iterdir()), elements.pool and elements.pool.width))
        return recorded(seed=11)

    monkeypatch.setattr(outcome, "designed", found)
    assert flexfem.design(wanted, folder, workers=2).seed == 11
    assert handed == [([".wanted-design.found"], 2)]
    names = ["wanted-design.json", "wanted-front-1.toml", "wanted-front-2.toml", "wanted-stage.toml"]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert [(folder / name).read_text() for name in names[1:]] == [FRONT[0].stage, FRONT[1].stage, STAGE]
    assert read_design(folder / names[0]) == recorded(seed=11)


def test_workers_and_a_scheduler_together_are_refused(tmp_path):
    wanted = tmp_path / "wanted.toml"
    wanted.write_text("\n".join([HEAD, NECK, RADIUS, *WANTED]))
    with pytest.raises(BadInput, match="workers with a scheduler, expected one of them"):
        flexfem.design(wanted, None, 2, "tcp://nowhere:1")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ('name = "a test"', 'name = "another"', True),
        ("seed = 7", "seed = 7\naccuracy_percent = 0.2", True),
        ("seed = 7", "seed = 8", False),
        ("seed = 7", "seed = 7\nfront = 5", False),
        ("seed = 7", "seed = 7\nresolution = 12", False),
        ("at_least = 60.0", "at_least = 60.1", False),
        ("at_least", "at_most", False),
        ('maximise = "range_x_um"', 'minimise = "range_x_um"', False),
        ("to = 0.7", "to = 0.71", False),
        ("to = 0.7", "to = 0.7\nstep = 0.1", False),
        ("to = 0.7", 'to = 0.7\nscale = "log"', False),
        ("mobility6.toml", "mobility3.toml", False),
    ],
)
def test_a_hash_is_of_all_that_a_design_depends_on_and_of_nothing_else(tmp_path, old, new, same):
    text, path = "\n".join([HEAD, NECK, RADIUS, *WANTED]), tmp_path / "wanted.toml"
    hashes = []
    for each in (text, text.replace(old, new)):
        path.write_text(each)
        hashes.append(load_requirements(path).hash)
    assert (hashes[0] == hashes[1]) is same and text != text.replace(old, new)


def test_what_is_not_said_is_as_the_reference_page_says_and_what_is_said_is_asked(load):
    of = load(NECK, "[tolerance]\nneck_um = 5.0\n", best("minimise", "coupling_95")).requirements
    assert (of.formula, of.paper_formula, of.mobility, of.links) == ("calibrated", "paros-weisbord", 21, False)
    assert (of.accuracy_percent, of.resolution, of.front) == (0.1, 8, 7)
    assert (of.tolerance.stages, of.tolerance.checked) == (4000, 0)
    said = HEAD + 'formula = "lobontiu"\nmobility = 6\n'
    asked = "[drive]\nstroke_um = 12.0\nlever_arm_mm = 9.0\n", "[frequencies]\npayload_kg = 0.3\n", "[drift]\n"
    loaded: LoadedStudy = load(NECK, *asked, best("minimise", "drift_theta_urad_per_k"), head=said).study
    study = loaded.study
    assert (study.formula, study.mobility, study.links, study.model) == ("lobontiu", 6, False, "analytic")
    assert (study.drive.stroke_um, study.drive.lever_arm_mm, study.frequencies.payload_kg) == (12.0, 9.0, 0.3)
    assert study.drift is not None and loaded.stage.hinges.elbow.neck == 0.5
    assert load(NECK, best("maximise", "range_x_um"), head=HEAD + "links = true\n").study.study.links


def test_a_search_begins_at_the_base_stage_or_at_the_end_next_to_it(load):
    """Its necks are 0.5 mm, those of base hinges too, its link 1 is 30 mm."""
    free = NECK.replace("0.3", "0.2"), LINK.replace("26.0", "32.0"), RADIUS.replace("to = 4.0", "to = 1.4").replace(
        "from = 1.5", "from = 1.0"
    )  # fmt: skip
    assert load(*free, best("maximise", "range_x_um")).own_values.tolist() == [0.5, 32.0, 1.4]


def test_designs_of_a_front_are_those_that_no_other_beats_from_the_best_in_the_first_objective(load):
    both = best("maximise", "hinges.elbow.neck_mm") + best("minimise", "hinges.elbow.radius_mm")
    model = Model(load(NECK, RADIUS, both))
    designs = [np.array(each) for each in ([0.4, 1.6], [0.6, 3.0], [0.5, 2.0], [0.5, 2.5], [0.6, 3.0], [0.3, 1.6])]
    assert [each.tolist() for each in best_of(model, designs)] == [[0.6, 3.0], [0.5, 2.0], [0.4, 1.6]]


@pytest.mark.parametrize(("stiffness", "met"), [(60.1, True), (59.9, True), (59.7, False)])
def test_a_design_of_a_front_keeps_an_end_within_its_band_whatever_the_guard_of_the_search(
    load, monkeypatch, stiffness, met
):
    said = {"elements": np.array([400.0, 9.0, stiffness]), "predicted": np.array([401.0, 8.0, 58.0])}
    of = Proof(**(dict.fromkeys(Proof._fields) | said | {"bands": np.array([1.0, 1.0, 0.2])}))
    monkeypatch.setattr("flexfem.synthesis.front.proof", lambda *asked: of)
    model = Model(load(NECK, RADIUS, *WANTED), guard=np.array([0.1]))
    (one,) = proven(model, None, [np.array([0.5, 2.0])], print)
    assert one.met is met and one.margins == pytest.approx([(stiffness - 60) / 60])
    assert (one.elements.tolist(), one.predicted.tolist()) == ([400.0, 9.0], [401.0, 8.0])


def test_members_of_one_array_that_are_designed_are_named_together(load):
    free = (LINK, LINK.replace("[0]", "[1]").replace('"l1"', '"l2"'))
    sources = outcome.made(load(*free, best("maximise", "range_x_um")), np.array([33.0, 34.0])).provenance
    said = sources["chain.link_lengths_mm"]
    assert said.startswith("assumed in part: [0, 1] designed: a test, seed 7; the others assumed")


@pytest.mark.parametrize(("asked", "own"), [("", set()), (DRIVE, {"actuator"}), (DRIFT, {"frame"})])
def test_what_is_assumed_of_stage_drive_frame_and_requirements_is_listed(load, asked, own):
    source = '[provenance]\n"require[0]" = "assumed: a wish"\n"free[0]" = "measured"\n'
    loaded = load(NECK, asked, *WANTED, source)
    said = outcome._doubts(loaded, outcome.made(loaded, np.array([0.6])))
    assert "requirements: require[0]" in said["assumed"] and "requirements: free[0]" not in said["assumed"]
    stage = [key.removeprefix("stage: ") for key in said["assumed"] if key.startswith("stage: ")]
    assert len(stage) == len({*stage}) and "hinges.elbow.neck_mm" not in stage and "chain.link_lengths_mm" in stage
    assert {key.partition(".")[0].partition("[")[0] for key in stage} & {"actuator", "frame"} == own


def test_a_record_warns_where_the_loop_ends_apart_and_where_no_stage_was_checked(load):
    loaded = load(NECK, "[tolerance]\nneck_um = 5.0\n", best("minimise", "coupling_95"))
    columns, _ = Model(loaded).columns(np.array([[0.5]]))
    said = {"values": np.array([0.5]), "gap": 0.0123, "columns": {name: float(x[0]) for name, x in columns.items()}}
    last = Proof(**(dict.fromkeys(Proof._fields) | said))
    warned = outcome._warnings(loaded, Mapped(Model(loaded), [last], [], False), last)
    assert warned == [
        "after 1 rounds model and finite elements still differ by 1.23 %",
        "coupling under tolerance is of the analytic model: tolerance.checked is 0",
    ]
