"""Claims: read with suspicion, judged by their own expectations; and what else could explain those that fail."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.analytic.model import CALIBRATED, analyse
from flexfem.refused import BadInput
from flexfem.stage.schema import load_stage
from flexfem.verify import claims, measures
from flexfem.verify.claims import (
    ClaimsReport,
    claims_page,
    load_claims,
    markdown_claims,
    measure_claims,
    report_claims,
)
from flexfem.verify.measures import MEASURES

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "cases" / "claims.toml"
FILE = "cases/claims.toml"
ROUND_OFF = 1e-8  # per cent; 3 x 3 products of matrices whose entries differ by 1e5
EXPECTED = {
    "mobility": "holds",
    "six-commanded": "does not hold",
    "six-across": "holds",
    "three-everywhere": "does not hold",
    "six-better": "holds",
    "axial-cause": "does not hold",
    "diagonal": "holds",
    "second-order": "does not hold",
    "minimum-energy": "holds",
    "measured-stiffness": "cannot be decided",
}


def analytic_stand_in(stage, resolution):
    """Calibrated hinges and elastic links instead of finite elements: errors differ by 0.01 points, and no mesh."""
    return SimpleNamespace(
        mesh=None, response=SimpleNamespace(compliance=analyse(stage, 21, CALIBRATED, links=True).compliance)
    )


def verdicts(path, solve=analytic_stand_in):
    return {each.id: each for each in measure_claims(path, solve)}


@pytest.fixture(scope="module")
def shipped():
    return verdicts(SHIPPED)


@pytest.fixture(scope="module", params=[("mobility3", 3), ("mobility6", 6)], ids=["three", "six"])
def modelled(request):
    name, model = request.param
    return load_stage(ROOT / "geometry" / f"{name}.toml"), model


@pytest.fixture(scope="module")
def three():
    return load_stage(ROOT / "geometry/mobility3.toml")


@pytest.fixture(scope="module")
def six():
    return load_stage(ROOT / "geometry/mobility6.toml")


def test_every_shipped_claim_has_its_verdict(shipped):
    assert {name: each.verdict for name, each in shipped.items()} == EXPECTED


def test_every_measure_is_used_by_the_shipped_file():
    assert {claim.measure for claim in load_claims(SHIPPED)[0].claim} == set(MEASURES)


def test_every_verdict_says_its_numbers_and_where_dimensions_are_assumed(shipped):
    for name, each in shipped.items():
        assert re.search(r"\d", each.found) and "\n" not in each.found
        assert ("assumed dimensions" in each.found) == (name != "mobility")
    for name, form in (("six-commanded", ".3f"), ("axial-cause", ".3f"), ("second-order", ".3f")):
        for value in shipped[name].values:
            assert f"{value:{form}}" in shipped[name].found
    assert "Table II" in shipped["measured-stiffness"].found


@pytest.mark.parametrize(
    ("claim", "edits", "verdict"),
    [
        (
            "six-commanded",
            [("low_percent = 5.0", "low_percent = 12.0"), ("high_percent = 10.0", "high_percent = 13.0")],
            1,
        ),
        ("six-commanded", [("high_percent = 10.0", "high_percent = 13.0")], 1),
        ("mobility", [("[3.0, 6.0, 12.0]", "[3.0, 6.0, 11.0]")], 0),
        ("three-everywhere", [("low_percent = 10.0", "low_percent = 0.0")], 1),
        ("axial-cause", [("low_percent = 50.0", "low_percent = 0.0")], 1),
        ("second-order", [("low_percent = 3.0", "low_percent = 0.1")], 1),
        ("six-better", [("low_percent = 0.0", "low_percent = 2.0")], 0),
        ("minimum-energy", [("low_percent = 0.0", "low_percent = 1e9")], 0),
    ],
)
def test_a_claim_whose_expectation_changes_changes_its_verdict(project, claim, edits, verdict):
    found = verdicts(project.edit(FILE, *edits))
    assert found[claim].verdict == ("does not hold", "holds")[verdict]


def test_a_stage_that_is_not_symmetric_errs_across(project):
    stage = project.path("geometry/mobility6.toml")
    stage.write_text(stage.read_text() + '\n[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.55\n')
    found = verdicts(project.path(FILE))
    assert found["six-across"].verdict == found["diagonal"].verdict == "does not hold"


def test_unweighted_inverse_does_not_store_the_least_energy(monkeypatch):
    def unweighted(of, at, du):
        return SimpleNamespace(independent=np.linalg.pinv(at.influence.G_u) @ du)

    monkeypatch.setattr(measures, "inverse_kinematics", unweighted)
    assert verdicts(SHIPPED)["minimum-energy"].verdict == "does not hold"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('measure = "six-across"', 'measure = "six-acros"', "did you mean six-across?"),
        ('measure = "mobility"', 'mesure = "mobility"', "mesure"),
        ("amplitude_um = 50.0 ", "amplitude_um = -50.0 ", "amplitude_um = -50.0"),
        ("low_percent = 5.0", "low_percent = 15.0", "at most high_percent"),
        ("equals = [3.0, 6.0, 12.0]", "", "either low_percent"),
        ("equals = [3.0, 6.0, 12.0]", "equals = [3.0]\nhigh_percent = 1.0", "either low_percent"),
        ('id = "six-across"', 'id = "mobility"', "an id that no other claim has"),
        ('amplitude_um = "assumed', 'amplitude_mm = "assumed', "amplitude_mm"),
        ("geometry/mobility6.toml", "geometry/none.toml", "none.toml: no such file"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused_in_one_line(project, old, new, said):
    with pytest.raises(BadInput) as refused:
        measure_claims(project.edit(FILE, (old, new)), analytic_stand_in)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_table_has_one_row_for_each_claim(shipped):
    table = markdown_claims(list(shipped.values()))
    assert len(table.splitlines()) == 2 + len(shipped)
    assert all(line.count("|") == 5 for line in table.splitlines())


@pytest.mark.slow
def test_finite_elements_give_the_same_verdicts_and_the_report_keeps_its_alternatives():
    report = report_claims(SHIPPED)
    assert {each.id: each.verdict for each in report.verdicts} == EXPECTED
    assert ClaimsReport.model_validate_json(report.model_dump_json()) == report
    linear = [each.along.x for each in report.alternatives if each.mobility == 6 and "linear triangles, " in each.name]
    assert linear == sorted(linear) and linear[0] < 0  # finer is softer
    across = {each.name: each.across.x for each in report.alternatives}
    assert across["joints commanded instead of the platform"] > 1e-3
    assert all(each.name in claims_page(report) for each in report.alternatives)


def test_numbers_without_a_source_in_either_stage_are_said_beside_what_they_decide(project, monkeypatch):
    monkeypatch.setitem(MEASURES, "six-across", lambda evidence: measures.Measured((0.0,), "nothing across"))
    monkeypatch.setattr(claims, "errors_of_model", lambda *_: None)
    path = project.path("cases/claims.toml")
    start, _, claim = path.read_text().partition('[[claim]]\nid = "six-across"')
    path.write_text(f'{start.partition("[[claim]]")[0]}[[claim]]\nid = "six-across"{claim.partition("[[claim]]")[0]}')
    for name in ("mobility6", "mobility3"):
        stage = project.path(f"geometry/{name}.toml")
        kept = stage.read_text()
        stage.write_text(kept.partition("[provenance]")[0])
        (verdict,) = claims.measure_claims(path, analytic_stand_in)
        assert verdict.found == "nothing across, on assumed dimensions and on dimensions without a source", name
        stage.write_text(kept)
