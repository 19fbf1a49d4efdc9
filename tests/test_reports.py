"""What the command line prints, a person in a notebook gets as the same record."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import flexfem as public
from flexfem.commands import cli
from flexfem.commands.plain import plain

ROOT = Path(__file__).parents[1]
STAGE = ROOT / "geometry" / "mobility6.toml"
ANSWERED_BY = {  # commands whose names Python cannot have, or has for something else
    "solve": "under_load",
    "formulas": "known_formulas",
    "verify": "verification",
    "new": "new_stage",
    "schema": "schema_of",
    "study run": "run_study",
    "study status": "study_status",
    "study clean": "clean_study",
    "study collect": "collect_study",
    "study plot": "study_findings",
}


def commands():
    """Every command by its name, those of studies with `study` before it."""
    groups = [("", group.typer_instance) for group in cli.app.registered_groups if not group.name]
    groups += [(f"{group.name} ", group.typer_instance) for group in cli.app.registered_groups if group.name]
    return {f"{prefix}{one.name or one.callback.__name__}" for prefix, app in groups for one in app.registered_commands}


def test_every_command_has_a_function_of_its_name_or_one_that_is_listed():
    found = commands()
    assert {"check", "study run", "budget", "regression", "baseline"} <= found and set(ANSWERED_BY) <= found
    for name in found:
        assert hasattr(public, ANSWERED_BY.get(name, name)), name


ASKED = {
    ("check", STAGE): lambda stage: public.check(stage),
    ("stiffness", STAGE, "--mobility", 21, "--formula", "koster"): lambda stage: public.stiffness(stage, 21, "koster"),
    ("stiffness", STAGE, "--links"): lambda stage: public.stiffness(stage, links=True),
    ("summary", STAGE, "--resolution", 2): lambda stage: public.summary(stage, elements=True, resolution=2),
    ("solve", STAGE, "--resolution", 2, "--displacement", 0.01, 0, 1e-4): lambda stage: public.under_load(
        stage, displacement=[0.01, 0.0, 1e-4], resolution=2
    ),
    ("converge", STAGE, *(f"--level={n}" for n in (2, 3, 4))): lambda stage: public.converge(stage, [2, 3, 4]),
    ("modes", STAGE, "--count", 2, "--payload", 0.1, 20, "--resolution", 4): lambda stage: public.modes(
        stage, 2, (0.1, 20.0), resolution=4
    ),
    ("formulas",): lambda stage: public.known_formulas(),
}


def test_a_record_from_python_is_what_the_command_prints(flexfem):
    stage = public.load(STAGE)
    for command, ask in ASKED.items():
        code, out, _ = flexfem(*command, "--json")
        assert code == 0 and json.loads(out) == plain(ask(stage)), command
    assert isinstance(public.stiffness(stage).compliance, np.ndarray)


def test_amplitudes_and_meshes_are_passed_on(flexfem, monkeypatch):
    """In mm and rad; a mesh is said when it is solved, and solved once for all that is asked of a stage."""
    asked = []

    def answered(stage, amplitudes, resolution, solve):
        asked.append((amplitudes, resolution, solve(stage, 2).response.unknowns))
        raise public.BadInput("seen")

    monkeypatch.setattr("flexfem.verify.budget.budget", answered)
    code, _, err = flexfem("budget", STAGE, "--amplitude-um", 70, "--amplitude-mrad", 3)
    assert code == 2 and "meshing and solving 1/3: " in err
    stage, said = public.load(STAGE), []
    with pytest.raises(public.BadInput, match="seen"):
        public.budget(stage, {"x": 0.07, "y": 0.07, "theta": 0.003}, progress=said.append)
    assert asked[0][0] == pytest.approx(asked[1][0]) and asked[0][1:] == asked[1][1:]
    assert said == [f"{asked[1][2]} unknowns"]
    assert public.solve(stage, 2).solved is public.solve(stage, 2).solved


def test_stages_that_cannot_be_made_are_refused_by_every_question():
    """Replaced without a check, the hinges are wider than the links."""
    stage = public.load(STAGE)
    bad = stage.model_copy(update={"chain": stage.chain.model_copy(update={"link_width": 0.3})})
    for ask in (public.check, public.stiffness, public.summary, public.budget, public.workspace, public.reach):
        with pytest.raises(public.BadInput, match="expected"):
            ask(bad)


STUDY = f"""
name = "necks"
stage = "{STAGE}"
model = "analytic"
[sampling]
method = "grid"
[[factor]]
key = "hinges.elbow.neck_mm"
from = 0.4
to = 0.6
points = 3
[[factor]]
key = "chain.link_width_mm"
from = 8.5
to = 9.5
points = 2
[[figure]]
kind = "map"
x = "hinges.elbow.neck_mm"
y = "chain.link_width_mm"
value = "kxx_n_per_mm"
"""


def test_a_study_is_run_collected_and_drawn_from_python(tmp_path):
    path = tmp_path / "necks.toml"
    path.write_text(STUDY)
    assert public.study_status(path, tmp_path)["open"] == 6
    with pytest.raises(public.BadInput, match="6 of 6 designs are open"):
        public.collect_study(path, tmp_path)
    assert public.run_study(path, tmp_path, workers=1)["ok"] == 6
    made = public.collect_study(path, tmp_path, to=tmp_path / "necks.csv")
    table = public.study.table(made.path, as_arrow=True)
    ((name, shown),) = public.study_records(path, tmp_path).items()
    assert (made.designs, made.open, name) == (6, 0, "necks-map-kxx_n_per_mm")
    ax = public.plot.plot_map(Figure().subplots(), shown)
    cells = ax.collections[0].get_array()
    assert sorted(cells.ravel()) == pytest.approx(sorted(table["kxx_n_per_mm"].to_pylist()), rel=1e-12)
    assert public.clean_study(path, tmp_path, dry_run=True) == {"stale": [], "removed": False}
