"""Claims: read with suspicion, judged by their own expectations; and what else could explain those that fail."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.analytic.model import CALIBRATED, analyse
from flexfem.refused import BadInput
from flexfem.verdicts import second_order, verdict
from flexfem.verdicts.claims import load_claims
from flexfem.verdicts.measures import MEASURES, Measure
from flexfem.verdicts.page import claims_page, markdown_claims
from flexfem.verdicts.records import ClaimsReport
from flexfem.verdicts.verdict import measure_claims, report_claims

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "cases" / "claims.toml"
FILE = "cases/claims.toml"
EXPECTED = {
    "mobility": "holds",
    "six-commanded": "does not hold",
    "six-across": "holds",
    "three-along": "holds",
    "three-across": "does not hold",
    "six-better": "holds",
    "axial-cause": "does not hold",
    "larger-radius": "does not hold",
    "rotation-more": "holds",  # a tie; by the stand-in
    "diagonal": "holds",
    "second-order": "does not hold",
    "second-order-error": "does not hold",
    "minimum-energy": "holds",
    "temperature-gradient": "holds",
    "measured-stiffness": "cannot be decided",
    "stiffer-simulated": "cannot be decided",
}
DEPEND = ("six-commanded", "three-along", "six-better", "rotation-more", "second-order")


def analytic_stand_in(stage, resolution):
    """Calibrated hinges and elastic links instead of finite elements: errors differ by 0.01 points, and no mesh."""
    return SimpleNamespace(
        mesh=None, response=SimpleNamespace(compliance=analyse(stage, 21, CALIBRATED, links=True).compliance)
    )


def no_ensemble(loaded):
    return None


def verdicts(path, solve=analytic_stand_in):
    """Verdicts on the stages of the file alone."""
    return {each.id: each for each in measure_claims(path, solve, no_ensemble)}


@pytest.fixture(scope="module")
def shipped():
    return verdicts(SHIPPED)


def test_every_shipped_claim_has_its_verdict(shipped):
    assert {name: each.verdict for name, each in shipped.items()} == EXPECTED


def test_every_measure_is_used_by_the_shipped_file():
    assert {claim.measure for claim in load_claims(SHIPPED).claims.claim} == set(MEASURES) - {"three-everywhere"}


def test_every_verdict_says_its_numbers_and_where_dimensions_are_assumed(shipped):
    for name, each in shipped.items():
        assert re.search(r"\d", each.found) and "\n" not in each.found
        assert ("assumed dimensions" in each.found) == (name != "mobility")
        decided = name != "mobility" and each.missing is None
        assert ("on these dimensions alone" in each.found) == decided
        assert each.ensemble is None and each.shares == [] and each.depends is None
    for name, form in (("six-commanded", ".3f"), ("axial-cause", ".3f"), ("second-order", ".3f")):
        for value in shipped[name].values:
            assert f"{value:{form}}" in shipped[name].found
    assert "Table II" in shipped["measured-stiffness"].found


ALONG = 'for every command; the text gives no number"\n'
ACROSS = 'in the six error curves across a command; the text gives no number"\n'
OF_ERROR = 'changes the commanded error by 3 to 5 % of it, for every command"\n'
LEAST = 'reading = "no other joint motion with the same pose stores less energy"\n'
BETTER = 'the commanded error is smaller for every command"\n'


CHANGED = [
    (
        "six-commanded",
        [("low_percent = 5.0", "low_percent = 12.0"), ("high_percent = 10.0", "high_percent = 13.0")],
        1,
    ),
    ("mobility", [("[3.0, 6.0, 12.0]", "[3.0, 6.0, 11.0]")], 0),
    ("three-along", [(ALONG + "low_percent = 10.0", f"{ALONG}low_percent = 20.0")], 0),
    ("three-across", [(ACROSS + "low_percent = 10.0", f"{ACROSS}low_percent = 0.0")], 1),
    ("axial-cause", [("low_percent = 50.0", "low_percent = 0.0")], 1),
    ("second-order-error", [(OF_ERROR + "low_percent = 3.0", f"{OF_ERROR}low_percent = 0.1")], 1),
    ("second-order", [("low_percent = 3.0", "low_percent = 0.1")], 1),
    ("six-better", [(BETTER + "low_percent = 0.0", f"{BETTER}low_percent = 2.0")], 0),
    ("larger-radius", [("low_percent = 100.0", "low_percent = 14.0")], 1),
    ("minimum-energy", [(LEAST + "low_percent = 0.0", f"{LEAST}low_percent = 1e9")], 0),
]


def test_claims_whose_expectations_change_change_their_verdicts(project):
    """All in one file: no expectation is that of another claim."""
    found = verdicts(project.edit(FILE, *(edit for _, edits, _ in CHANGED for edit in edits)))
    for claim, _, expected in CHANGED:
        assert found[claim].verdict == ("does not hold", "holds")[expected], claim


def test_a_wider_end_alone_changes_a_verdict(project):
    found = verdicts(project.edit(FILE, ("high_percent = 10.0", "high_percent = 13.0")))
    assert found["six-commanded"].verdict == "holds"


def test_a_stage_that_is_not_symmetric_errs_across(project):
    stage = project.path("geometry/mobility6.toml")
    stage.write_text(stage.read_text() + '\n[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.55\n')
    found = verdicts(project.path(FILE))
    assert found["six-across"].verdict == found["diagonal"].verdict == "does not hold"
    assert found["six-across"].argument is None  # it is of symmetric stages


def test_arguments_that_no_dimension_enters_stand_beside_their_verdicts(shipped):
    argued = {name for name, each in shipped.items() if each.argument}
    assert argued == {"mobility", "six-across", "three-across", "diagonal", "minimum-energy"}
    page = markdown_claims(list(shipped.values()))
    assert page.count("zero under any linear protocol") == 2


def test_unweighted_inverse_does_not_store_the_least_energy(monkeypatch):
    def unweighted(of, at, du):
        return SimpleNamespace(independent=np.linalg.pinv(at.influence.G_u) @ du)

    monkeypatch.setattr(second_order, "inverse_kinematics", unweighted)
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
        measure_claims(project.edit(FILE, (old, new)), analytic_stand_in, no_ensemble)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_table_has_one_row_for_each_claim(shipped):
    table = markdown_claims(list(shipped.values()))
    assert len(table.splitlines()) == 2 + len(shipped)
    assert all(line.count("|") == 5 for line in table.splitlines())


@pytest.mark.slow
def test_finite_elements_give_the_same_verdicts_and_the_report_keeps_its_alternatives():
    report = report_claims(SHIPPED)
    depend = dict.fromkeys(DEPEND, "depends on the dimensions")
    assert {each.id: each.verdict for each in report.verdicts} == EXPECTED | depend
    assert report.ensemble.metal_off < 0.02
    assert (report.ensemble.drawn, report.ensemble.judged + report.ensemble.infeasible) == (1200, 1200)
    assert ClaimsReport.model_validate_json(report.model_dump_json()) == report
    linear = [each.along.x for each in report.alternatives if each.mobility == 6 and "linear triangles, " in each.name]
    assert linear == sorted(linear) and linear[0] < 0  # finer is softer
    across = {each.name: each.across.x for each in report.alternatives}
    assert across["joints commanded instead of the platform"] > 1e-3
    assert all(each.name in claims_page(report) for each in report.alternatives)


def test_numbers_without_a_source_in_either_stage_are_said_beside_what_they_decide(project, monkeypatch):
    nothing = Measure(lambda on: np.zeros((1, 1)), lambda on, values: "nothing across")
    monkeypatch.setitem(MEASURES, "six-across", nothing)
    monkeypatch.setattr(verdict, "errors_of_model", lambda *_: None)
    monkeypatch.setattr(verdict, "Evidence", lambda *_: SimpleNamespace(alike=True))
    path = project.path("cases/claims.toml")
    start, _, claim = path.read_text().partition('[[claim]]\nid = "six-across"')
    path.write_text(f'{start.partition("[[claim]]")[0]}[[claim]]\nid = "six-across"{claim.partition("[[claim]]")[0]}')
    for name in ("mobility6", "mobility3"):
        stage = project.path(f"geometry/{name}.toml")
        kept = stage.read_text()
        stage.write_text(kept.partition("[provenance]")[0])
        (found,) = measure_claims(path, analytic_stand_in, no_ensemble)
        said = "nothing across, on assumed dimensions and on dimensions without a source"
        assert found.found == f"{said}; on these dimensions alone, with no ensemble of stages", name
        stage.write_text(kept)
