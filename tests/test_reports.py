"""What the command line prints, a person in a notebook gets as the same record."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import flexfem as public
from flexfem.commands.plain import plain

ROOT = Path(__file__).parents[1]
STAGE = ROOT / "geometry" / "mobility6.toml"
ASKED = {
    ("check", STAGE): lambda stage: public.check(stage),
    ("stiffness", STAGE, "--mobility", 21, "--formula", "koster"): lambda stage: public.stiffness(stage, 21, "koster"),
    ("stiffness", STAGE, "--links"): lambda stage: public.stiffness(stage, links=True),
    ("summary", STAGE, "--resolution", 2): lambda stage: public.summary(stage, elements=True, resolution=2),
    ("solve", STAGE, "--resolution", 2, "--displacement", 0.01, 0, 1e-4): lambda stage: public.under_load(
        stage, displacement=[0.01, 0.0, 1e-4], resolution=2
    ),
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
