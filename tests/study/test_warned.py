"""What a study says of its answers: a formula out of its range, a factor that nothing requested
depends on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.studies import plot_study, run_study, status_facts, study_status
from flexfem.study.answer import answer, changed_outputs, factor_warnings
from flexfem.study.loaded import load_study, sample
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
    stage.write_text(
        symmetric.replace("neck_mm = 0.47", "neck_mm = 0.11").replace(
            "neck_mm = 0.61", "neck_mm = 0.12"
        )
    )
    loaded = studies.of(
        FEW, NECK, head=SHORT, tail=f"{KXX}\n{KXX.replace('kxx_n_per_mm', 'coupling_xy')}"
    )
    rows = answer(loaded, 0, 200)
    beyond = sample(loaded, 0, 200)[:, 0] / 3.9 > 0.1
    assert (
        100 < beyond.sum() < 190 and set(rows.status) == {"ok"} and np.isfinite(rows.values).all()
    )
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
    assert len(facts["written"]) == 5 and "study-sensitivity-2" not in "".join(facts["written"])
    assert facts["warnings"] == warnings and f"warning: {warnings[0]}" in str(facts)
    assert "\nstudy-sensitivity-2 is not drawn: " in str(facts)
    (row,) = facts["findings"]["study-sensitivity"]["rows"]
    assert "total" not in row and row["first"] == pytest.approx(1.0, abs=0.1)
    assert "no factor changes it" in facts["findings"]["study-sensitivity-2"]["refused"]


WIDTH = 'label = "w"\nkey = "chain.link_width_mm"\nfrom = 8.8\nto = 9.4'
STRENGTH = 'key = "material.yield_strength_mpa"\nfrom = 300.0\nto = 500.0'
SUM = f'[[output]]\nname = "d"\nexpression = "range_x_um + envelope_mm"\n{KXX.replace("kxx_n_per_mm", "d")}'
RANGE = '[[constraint]]\nvalue = "range_x_um"\nleast = 1'
OF_STRENGTH = (
    "factor material.yield_strength_mpa changes none of kxx_n_per_mm; it changes range_x_um, "
    "range_y_um"
)


@pytest.mark.parametrize(
    ("head", "tail", "said"),
    [
        (
            'model = "analytic"',
            KXX,
            ["factor w changes none of kxx_n_per_mm; it changes envelope_mm only", OF_STRENGTH],
        ),
        ('model = "fe"', KXX, [OF_STRENGTH]),  # wider links are stiffer
        ('model = "analytic"', "", []),  # some output depends on each
        ('model = "analytic"', SUM, []),
        (
            'model = "analytic"',
            f"{KXX}\n{RANGE}",
            ["factor w changes none of kxx_n_per_mm, range_x_um"],
        ),
        (
            'model = "analytic"',
            f'{KXX}\n[[constraint]]\nvalue = "kxx_n_per_mm / w"\nleast = 1',
            [OF_STRENGTH],
        ),
    ],
)
def test_a_factor_that_changes_no_requested_number_is_named(
    studies, head: str, tail: str, said: list[str]
) -> None:
    loaded = studies.of(FEW, NECK, WIDTH, STRENGTH, head=head, tail=tail)
    found = factor_warnings(loaded, changed_outputs(loaded))
    assert len(found) == len(said) and all(
        one.startswith(text) for text, one in zip(said, found, strict=True)
    ), found


def test_the_warning_about_a_factor_is_stored_by_a_run_and_follows_the_figures(
    studies, tmp_path
) -> None:
    loaded = studies.of(FEW, NECK, WIDTH, tail=KXX)
    assert any(
        "factor w changes none of" in text
        for text in run_study(loaded.path, tmp_path, workers=1)["warnings"]
    )
    assert any(
        "factor w changes none of" in text
        for text in study_status(loaded.path, tmp_path)["warnings"]
    )
    studies.of(FEW, NECK, WIDTH, tail=KXX.replace("kxx_n_per_mm", "envelope_mm"))
    assert not any("factor w" in text for text in study_status(loaded.path, tmp_path)["warnings"])


def test_a_factor_that_a_table_of_designs_never_varies_is_not_named(studies) -> None:
    names = "hinges.base.neck_mm,w"
    (studies.folder / "d.csv").write_text(f"{names}\n0.5,9.0\n0.55,9.0\n")
    factors = 'key = "hinges.base.neck_mm"', 'label = "w"\nkey = "chain.link_width_mm"'
    loaded = studies.of('method = "table"\nfile = "d.csv"', *factors, tail=KXX)
    assert factor_warnings(loaded, changed_outputs(loaded)) == []


def test_a_parameter_that_a_mechanism_does_not_use_is_named_in_studies_of_both_models(
    tmp_path,
) -> None:
    flexfem.new_stage(tmp_path / "guide.toml", kind="parallelogram")
    text = (
        (tmp_path / "guide.toml")
        .read_text()
        .replace("[parameters]\n", "[parameters]\nunused_mm = 3.0\n")
    )
    (tmp_path / "guide.toml").write_text(text)
    for model, label in (("analytic", "analytic"), ("fe", "three_dimensions")):
        (tmp_path / "s.toml").write_text(
            f'name = "s"\nstage = "guide.toml"\nmodel = "{model}"\nask = ["stiffness.free.{label}.x"]\n'
            '[sampling]\nmethod = "monte_carlo"\ndesigns = 5\nseed = 3\n'
            '[[factor]]\nkey = "parameters.unused_mm"\nfrom = 1.0\nto = 2.0\n'
            '[[factor]]\nkey = "parameters.neck_mm"\nfrom = 0.4\nto = 0.5\n'
        )
        loaded = load_study(tmp_path / "s.toml")
        (said,) = factor_warnings(loaded, changed_outputs(loaded))
        assert said.startswith(
            f"factor parameters.unused_mm changes none of stiffness.free.{label}.x"
        )


def test_a_study_of_numbers_at_rest_follows_no_range_and_one_of_ranges_does(
    tmp_path, monkeypatch
) -> None:
    """The range of a design takes 30 times as long as its stiffness."""
    flexfem.new_stage(tmp_path / "guide.toml", kind="parallelogram")
    text = """name = "leaves"
stage = "guide.toml"
model = "analytic"
ask = ["stiffness.free.analytic.x"ASKED]
[sampling]
method = "monte_carlo"
designs = 2
seed = 4
[[factor]]
key = "parameters.neck_mm"
from = 0.4
to = 0.6
"""
    found = dict[str, np.ndarray]()
    for name, asked in (("rest", ""), ("range", ', "stiffness.range.free.negative.x"')):
        (tmp_path / f"{name}.toml").write_text(text.replace("ASKED", asked))
        found[name] = answer(load_study(tmp_path / f"{name}.toml"), 0, 2).values
    assert found["range"].shape[1] > found["rest"].shape[1]
    np.testing.assert_allclose(
        found["range"][:, : found["rest"].shape[1]], found["rest"], rtol=1e-9
    )  # one after the other, and as arrays
    monkeypatch.setattr("flexfem.questions.ranges.DrivenPlate", None)
    np.testing.assert_array_equal(
        answer(load_study(tmp_path / "rest.toml"), 0, 2).values, found["rest"]
    )


def test_numbers_without_the_residual_stress_of_the_base_say_so(tmp_path: Path) -> None:
    base = flexfem.load(Path(__file__).parents[2] / "geometry" / "parallelogram.toml")
    base.replace(material={"residual_stress": 5.0}).save(tmp_path / "base.toml")
    path = tmp_path / "study.toml"
    for ask, said in (
        ("drift.pose.uniform.output.analytic.x", "without the residual stress"),
        ("stiffness.free.analytic.x", ""),
    ):
        path.write_text(
            f'name = "tried"\nstage = "base.toml"\nmodel = "analytic"\nask = ["{ask}"]\n'
            '[sampling]\nmethod = "grid"\n[[factor]]\nkey = "parameters.neck_mm"\nvalues = [0.5]\n'
        )
        rows = answer(load_study(path), 0, 1)
        assert rows.status.tolist() == ["ok"]
        assert said in rows.reason[0] if said else rows.reason[0] == ""
