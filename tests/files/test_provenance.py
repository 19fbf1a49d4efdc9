"""Where numbers come from: every number of a file is sourced, assumed or not stated, and every
answer says so.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from flexfem.paper.case import LoadedCase
from flexfem.paper.figures.stored import markdown_report
from flexfem.paper.stage import load_stage
from flexfem.paper.verification import run_case
from flexfem.plot.text import assumption_note
from flexfem.study.loaded import load_study

ROOT = Path(__file__).parents[2]
# of the shipped stages: thickness, 4 of the material, 3 of the chain, 6 of the hinges, 2 of the
# platform
NUMBERS = 16


def without(project, name, *keys):
    """A file of the project without these lines of its provenance, or without any of it."""
    head, _, lines = project.path(name).read_text().partition("[provenance]")
    kept = [line for line in lines.splitlines() if keys and not any(key in line for key in keys)]
    project.path(name).write_text("\n".join([head + ("[provenance]" if keys else ""), *kept]))
    return project.path(name)


def test_every_number_is_sourced_assumed_or_not_stated(project):
    path = without(project, "geometry/mobility6.toml", "hinges.elbow.neck_mm", "thickness_mm")
    stage = project.edit(
        "geometry/mobility6.toml",
        ('"assumed: Table I of the paper is not available"', '"measured"'),
    )
    read = load_stage(stage)
    assert read.not_stated == ("thickness_mm", "hinges.elbow.neck_mm")
    assert len(read.numbers) == NUMBERS
    assert sorted(set(read.numbers) & set(read.assumed)) == [
        f"material.{key}"
        for key in ("density_kg_m3", "poissons_ratio", "yield_strength_mpa", "youngs_modulus_gpa")
    ]
    bare = load_stage(without(project, path.relative_to(project.folder)))
    assert bare.not_stated == bare.numbers and bare.assumed == ()


def test_check_lists_and_every_table_counts_what_has_no_source(flexfem, project):
    path = without(project, "geometry/mobility6.toml")
    facts = json.loads(flexfem("check", path, "--json")[1])
    assert len(facts["not_stated"]) == NUMBERS and facts["assumed"] == []
    assert f"{NUMBERS} of these numbers have no stated source" in flexfem("check", path)[1]
    out = flexfem("stiffness", path)[1]
    assert f"{NUMBERS} of these numbers have no stated source" in out and "assumed" not in out


def test_a_verification_without_provenance_is_not_reported_as_sourced(project):
    project.edit("cases/fig5.toml", ("points = 21", "points = 3\nresolution = 4"))
    for name in ("cases/fig5.toml", "geometry/mobility3.toml", "geometry/mobility6.toml"):
        without(project, name)
    case = LoadedCase(project.path("cases/fig5.toml"))
    assert case.case.not_stated == ("amplitude_um", "points") and case.case.assumed == ()
    result = run_case(case)
    assert len(result.not_stated) == NUMBERS + 2
    page = markdown_report([result])
    assert "every number has a source" not in page and "**dimensions without a source**" in page
    for key in ("case: points", "chain.link_lengths_mm"):
        assert re.search(rf"{key}.*source not stated.*fig5", page), key


def test_a_study_without_provenance_says_so(project):
    path = without(project, "cases/study-reach.toml", "factor[3]", "drive.stroke_um")
    loaded = load_study(path)
    assert {"study: drive.stroke_um", "study: factor[3].from", "study: factor[3].to"} == set(
        loaded.assumptions.not_stated
    )
    for shipped in sorted((ROOT / "cases").glob("study-*.toml")):
        assert load_study(shipped).assumptions.not_stated == [], shipped


@pytest.mark.parametrize(
    ("assumed", "not_stated", "note"),
    [
        ([], [], ""),
        (["case: points"], [], "assumed commands"),
        ([], ["case: points"], "commands without a source"),
        (["thickness_mm"], ["case: points"], "assumed dimensions; commands without a source"),
        ([], ["case: points", "thickness_mm"], "dimensions without a source"),
        (["output.body", "body.frame.fixed"], [], "assumed ground or output"),
        (["output.at_mm", "hinge.leaf.neck_mm"], [], "assumed dimensions"),
    ],
)
def test_figures_say_what_is_in_doubt(assumed, not_stated, note):
    assert assumption_note(assumed, not_stated) == note
