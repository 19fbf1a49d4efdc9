"""`flexfem design` and `flexfem.run_design`: what is written, refused, resumed, printed and solved
elsewhere.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

import flexfem
from flexfem.commands.console import show
from flexfem.design import proof, run
from flexfem.design.result import is_design, read_design
from flexfem.refused import BadInput

from .conftest import HEAD, NECK, RANGE, REFERENCE, STEPPED, WANTED, best, require
from .recorded import FRONT, REQUIREMENTS, STAGE, recorded, requirement


def test_a_stage_those_of_the_front_and_the_record_are_written_and_what_was_kept_goes(
    load, tmp_path, monkeypatch
):
    path = load(NECK, *WANTED, RANGE).path
    folder = tmp_path / "out"
    seen = []

    def found(loaded, elements, timing):
        elements._keep("a question", [1.0])
        seen.append((sorted(path.name for path in folder.iterdir()), elements.workers is None))
        return recorded(seed=11)

    monkeypatch.setattr(run, "designed", found)
    assert flexfem.run_design(path, folder, workers=2).seed == 11
    assert seen == [([".wanted-design.found"], False)]
    names = [
        "wanted-design.json",
        "wanted-front-1.toml",
        "wanted-front-2.toml",
        "wanted-stage.toml",
    ]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert [(folder / name).read_text() for name in names[1:]] == [
        FRONT[0].stage,
        FRONT[1].stage,
        STAGE,
    ]
    assert is_design(folder / names[0]) and read_design(folder / names[0]) == recorded(seed=11)


def written(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_one_process_two_and_a_resumed_search_write_the_same_files_as_finite_elements_say(
    load, tmp_path, monkeypatch
):
    path = load(*STEPPED, *WANTED, RANGE).path
    found = flexfem.run_design(path, tmp_path / "one")
    assert found.feasible and found.agreed
    flexfem.run_design(path, tmp_path / "two", workers=2)
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        flexfem.run_design(path, tmp_path / "executor", executor=pool)
    assert written(tmp_path / "one") == written(tmp_path / "executor")
    original = proof.solved
    count = []

    def stopped(*task):
        count.append(1)
        if len(count) == 5:
            raise KeyboardInterrupt
        return original(*task)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(proof, "solved", stopped)
        flexfem.run_design(path, tmp_path / "again")
    flexfem.run_design(path, tmp_path / "again")
    assert written(tmp_path / "one") == written(tmp_path / "two") == written(tmp_path / "again")
    elements = flexfem.solve(flexfem.load(tmp_path / "one/wanted-stage.toml"), resolution=8)
    stiffness = found.requirements[0]
    assert stiffness.value == pytest.approx(elements.stiffness[0, 0], rel=2e-5)
    assert stiffness.value - stiffness.band >= 60.0


WITHOUT = (
    best("maximise", "9 ** 999 * range_x_um"),
    require("1 / (kxx_n_per_mm - kxx_n_per_mm)", 1.0) + RANGE,
)


@pytest.mark.parametrize("goal", WITHOUT)
def test_what_has_no_finite_value_is_refused_before_finite_elements_and_nothing_is_written(
    load, goal, tmp_path
):
    path = load(NECK, goal).path
    with pytest.raises(
        BadInput, match=r"wanted.toml: no design .* has a result: a quantity without a finite value"
    ):
        flexfem.run_design(path, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["wanted.toml"]


def test_a_design_never_replaces_its_base_stage(load, tmp_path):
    base = tmp_path / "wanted-stage.toml"
    base.write_text(STAGE)
    path = load(NECK, RANGE, head=HEAD.replace(str(REFERENCE), base.name)).path
    with pytest.raises(BadInput, match=r"wanted-stage.toml: is an input of this command"):
        flexfem.run_design(path, tmp_path)
    assert base.read_text() == STAGE and len(list(tmp_path.iterdir())) == 2


def test_stage_files_of_a_longer_front_before_are_removed_and_no_others(
    load, tmp_path, monkeypatch
):
    base = tmp_path / "wanted-front-9.toml"
    base.write_text(
        STAGE.replace("assumed: the paper does not state it", "designed: before, seed 7")
    )
    (tmp_path / "wanted-front-8.toml").write_text(
        '"hinges.elbow.neck_mm" = "designed: before, seed 7"\n'
    )
    (tmp_path / "wanted-front-7.toml").write_text("a note of somebody\n")
    (tmp_path / "wanted-front-last.toml").write_text(
        '"hinges.elbow.neck_mm" = "designed: before, seed 7"\n'
    )
    path = load(NECK, RANGE, head=HEAD.replace(str(REFERENCE), base.name)).path
    monkeypatch.setattr(run, "designed", lambda *about: recorded(front=[]))
    flexfem.run_design(path, tmp_path)
    left = {path.name for path in tmp_path.glob("*front*")}
    assert left == {base.name, "wanted-front-7.toml", "wanted-front-last.toml"}


def test_a_name_too_long_for_figures_is_refused_before_anything_is_computed(load, tmp_path):
    path = load(NECK, RANGE).path
    long = path.rename(path.with_name(f"{'x' * 230}.toml"))
    with pytest.raises(BadInput, match=r"x-design-sensitivity.p..: a name of more than 240 bytes"):
        flexfem.run_design(long, tmp_path / "out")


@pytest.mark.parametrize(
    "argument",
    [
        {"workers": 0},
        {"workers": True},
        {"workers": 2000},
        {"say": 5},
        {"executor": "dask"},
        {"workers": 2, "scheduler": "a:1"},
    ],
)
def test_an_argument_that_cannot_be_is_refused_in_one_line(load, argument):
    with pytest.raises(BadInput, match=rf"^{next(iter(argument))} .*, expected [^\n]*$"):
        flexfem.run_design(load(NECK, RANGE).path, **argument)


@pytest.mark.parametrize(
    ("feasible", "agreed", "code"), [(True, True, 0), (True, False, 1), (False, True, 1)]
)
def test_the_command_ends_with_one_where_no_design_is_found_or_proven(
    flexfem, monkeypatch, feasible, agreed, code
):
    monkeypatch.setattr(
        run, "run_design", lambda *about, timing: recorded(feasible=feasible, agreed=agreed)
    )
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    assert flexfem("design", "wanted.toml")[0] == code and os.environ["OMP_NUM_THREADS"] == "1"


def test_the_command_hands_on_its_options_and_prints_the_record_for_machines(
    flexfem, monkeypatch, tmp_path
):
    calls = []
    monkeypatch.setattr(
        run, "run_design", lambda *about, timing: calls.append(about[:3]) or recorded()
    )
    monkeypatch.setattr("flexfem.plot.write.write_design_figures", lambda found, stored: [stored])
    code, out, err = flexfem(
        "design", "wanted.toml", "-o", tmp_path / "out", "--workers", "3", "--json"
    )
    assert code == 1 and json.loads(out) == recorded().model_dump(mode="json")
    assert err.splitlines()[0] == str(tmp_path / "out/wanted-design.json")
    assert calls == [(Path("wanted.toml"), tmp_path / "out", 3)]


def test_every_number_of_a_record_is_printed(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    tight = [REQUIREMENTS[0].model_copy(update={"tightened_percent": 0.41}), *REQUIREMENTS[1:]]
    show(recorded(requirements=tight), False)
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    for line in (
        "neck 0.505 0.5042",
        "l1 31.5 31.62 at an end of its range",
        "stiffness at least 60 and at most 80 61.50 ± 0.25 N/mm met 1.88 ± 0.31 limits the "
        "objective checked by finite elements 66 -6.8",
        "coupling at most 0.0135 0.01310 ± 0.00090, of which 0.0007 by sampling within the band "
        "2.96 ± 6.7 analytic",
        "diameter with the others 153 2",
        "stiffness alone 57.4 4.33",
        "diameter alone not sufficient",
        "neck -2.43 +0.54 not known -1.31 +0.12",
        "2 0.52 30 466 0.093 469 0.094 6.4 -7.5 8.6 not met",
        "analytic 53,345",
        "2 12,345 0.066",
    ):
        assert any(text.startswith(line) for text in lines), line
    assert any(line.endswith("finite elements: stiffness by 0.41 %") for line in lines)


def test_a_quantity_that_is_best_and_required_is_decisive_once():
    again = requirement(
        "range_x_um",
        "least reach",
        value=412.0,
        uncorrected=433.0,
        at_least=400.0,
        size=400.0,
        margin=12.0,
        margin_percent=3.0,
        active=True,
    )
    found = recorded(requirements=[*REQUIREMENTS, again], front=[]).decisive
    assert [each.label for each in found] == ["reach", "mass", "stiffness", "diameter"]
