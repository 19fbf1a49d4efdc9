"""What a study says of its answers: a formula out of its range."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.studies import plot_study, status_facts
from flexfem.study.answer import answer
from flexfem.study.loaded import sample
from flexfem.study.run import parts_of, table_of, write_part

FEW = 'method = "monte_carlo"\ndesigns = 200\nseed = 5'
NECK = 'key = "hinges.base.neck_mm"\nfrom = 0.3\nto = 0.7'
KXX = '[[figure]]\nkind = "sensitivity"\nvalues = ["kxx_n_per_mm"]'
SHORT = 'model = "analytic"\nformula = "paros-weisbord-short"'


def test_designs_beyond_the_range_of_a_formula_are_answered_and_counted(studies) -> None:
    """The other hinges of the stage are at t/R 0.29 and more: with them in range, the base decides."""
    loaded = studies.of(FEW, NECK, head='model = "analytic"\nformula = "koster"')
    assert set(answer(loaded, 0, 200).reason) == {""}
    stage = studies.folder / "stage.toml"
    symmetric = stage.read_text().split("[[override]]")[0]
    stage.write_text(symmetric.replace("neck_mm = 0.47", "neck_mm = 0.11").replace("neck_mm = 0.61", "neck_mm = 0.12"))
    loaded = studies.of(FEW, NECK, head=SHORT, tail=f"{KXX}\n{KXX.replace('kxx_n_per_mm', 'coupling_xy')}")
    rows, beyond = answer(loaded, 0, 200), sample(loaded, 0, 200)[:, 0] / 3.9 > 0.1
    assert 100 < beyond.sum() < 190 and set(rows.status) == {"ok"} and np.isfinite(rows.values).all()
    said = "hinge formula paros-weisbord-short outside its range of t/R"
    assert list(rows.reason) == [said if out else "" for out in beyond]
    parts = parts_of(loaded, studies.folder / "out")
    parts.folder.mkdir(parents=True)
    (chunk,) = parts.chunks()
    write_part(parts, chunk, table_of(parts, chunk, rows))
    warnings = [f"{beyond.sum()} of 200 designs with a result: {said}"]
    facts = status_facts(parts)
    assert facts["warnings"] == warnings and facts["reasons"] == {} and facts["ok"] == 200
    facts = plot_study(loaded.path, studies.folder / "out")
    assert facts.failed  # by the figure that is refused; the other is drawn
    assert len(facts["written"]) == 3 and "study-sensitivity-2" not in "".join(facts["written"])
    assert facts["warnings"] == warnings and f"warning: {warnings[0]}\nstudy-sensitivity-2 is not drawn" in str(facts)
    (row,) = facts["findings"]["study-sensitivity"]["rows"]
    assert "total" not in row and row["first"] == pytest.approx(1.0, abs=0.1)
    assert "no factor changes it" in facts["findings"]["study-sensitivity-2"]["refused"]
