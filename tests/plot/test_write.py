"""Files: whole, byte-identical, each under its own name; and the page of text."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import flexfem
from flexfem.paper.figures.stored import plans, write_figures

from ..conftest import ROOT
from ..design.recorded import recorded

ERRORS = {"one": (0.14071, 2e-4, 3e-14), "two": (0.0712, -0.031, 2.5)}

DRAW = """
import sys, pathlib
from flexfem.paper.figures.stored import write_figures
from flexfem.paper.verification import Verification
result = Verification.read(pathlib.Path(sys.argv[1]))
write_figures([(result, result.read_fields(pathlib.Path(sys.argv[1])))], pathlib.Path(sys.argv[2]))
"""


def stored(made, **changes):
    result = made.result(ERRORS, **changes)
    return result, {label: made.fields() for label in result.curves}


@pytest.mark.slow
def test_another_process_gives_the_same_bytes(made, tmp_path):
    drawn = write_figures([stored(made)], tmp_path / "here")
    found, fields = stored(made)
    found.fields = fields
    path = found.write(tmp_path / "fig.json")
    variables = os.environ | {"PYTHONHASHSEED": "1", "SOURCE_DATE_EPOCH": "1000000000"}
    subprocess.run(
        [sys.executable, "-c", DRAW, path, tmp_path / "again"], check=True, env=variables
    )
    again = {file.name: file.read_bytes() for file in (tmp_path / "again").iterdir()}
    assert again == {file.name: file.read_bytes() for file in drawn}
    assert len(again) == 2 * 6 + 1  # six figures in two forms, one page


@pytest.mark.usefixtures("unrendered")
def test_files_are_named_after_case_and_stage(made, tmp_path):
    drawn = write_figures([stored(made)], tmp_path / "drawn")
    assert sorted(path.name for path in drawn) == sorted(
        file.name for file in drawn[0].parent.iterdir()
    )
    stems = {
        "fig",
        "fig-deformed",
        "stage-one",
        "neck-one",
        "hinge-one",
        "model-one-mobility6",
        "verification",
    }
    assert {path.stem for path in drawn} == stems


def test_a_stage_is_drawn_once_and_its_model_once_for_each_mobility(made):
    three = made.model(mobility=3, hinges=made.hinges(3))
    result = stored(made, models={"one": made.model(), "two": three})
    found = list(plans([result, stored(made, case="fig-b")]))
    assert found.count("stage-one") == 1
    assert [name for name in found if name.startswith("model")] == [
        "model-one-mobility6",
        "model-one-mobility3",
    ]


def test_two_stages_or_designs_of_one_file_name_do_not_clash(made):
    other = made.model(hash="fedcba" * 10, file="elsewhere/One.toml")
    designs = [("fig", recorded()), ("Fig", recorded())]
    found = list(plans([stored(made, models={"one": made.model(), "two": other})], designs=designs))
    assert {"stage-one", "stage-One-2", "fig", "fig-2", "Fig-3", "fig-front", "Fig-front-2"} < set(
        found
    )
    assert len({name.casefold() for name in found}) == len(found) == 2 + 2 * 4 + 2 * 3


def test_no_file_is_refused(tmp_path):
    with pytest.raises(flexfem.BadInput, match="no file, expected results of flexfem verify"):
        flexfem.plot_results(output=tmp_path, displacement=True)


def test_a_result_that_plot_does_not_draw_is_refused_by_its_title(tmp_path):
    found = flexfem.stiffness(flexfem.load(ROOT / "geometry/mobility6.toml"), models="analytic")
    path = found.write(tmp_path / "six.json")
    with pytest.raises(
        flexfem.BadInput,
        match=r"six.json: .*, expected results of verify of a case, or of design; other",
    ):
        flexfem.plot_results(path, output=tmp_path)


@pytest.mark.parametrize("case", ["../escape", "/root", "..", "a b"])
def test_figures_stay_in_their_folder(made, case):
    assert not any("/" in name or name.startswith(".") for name in plans([stored(made, case=case)]))
