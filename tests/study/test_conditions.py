"""Derived outputs, constraints and correlated factors: what they mean for designs and tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.stats import kstest, spearmanr, truncnorm, uniform

from flexfem.files.expressions import value_of
from flexfem.study.answer import answer, nominal
from flexfem.study.collect import collect, read_table
from flexfem.study.judge import judge
from flexfem.study.loaded import sample
from flexfem.study.run import parts_of, table_of, write_part

FEW = 'method = "monte_carlo"\ndesigns = 40\nseed = 5'
NECK = 'label = "neck of base"\nkey = "hinges.base.neck_mm"\nfrom = 0.4\nto = 0.7'
RADIUS = 'keys = ["hinges.elbow.radius_mm", "hinges.platform.radius_mm"]\nlabel = "r"\nfrom = 1.4\nto = 1.7'
OUTPUTS = """
[[output]]
name = "slenderness"
expression = "`neck of base` / hinges.base.radius_mm"
[[output]]
name = "ratio"
expression = "kxx_n_per_mm / ktt_n_mm_per_rad ** 0.5 - 3 * slenderness"
unit = "1/mm"
[[output]]
name = "other"
expression = "override.2.elbow.neck_mm + override.1.elbow.radius_mm + hinges.elbow.radius_mm"
"""


def test_an_expression_has_the_value_that_arithmetic_gives_it() -> None:
    a = np.array([4.0, 9.0])
    b = np.array([0.5, -3.0])
    given = {"k.x[1]": a, "link 1": b}
    for text, expected in (
        ("sqrt(k.x[1]) - 2*`link 1`**2", [1.5, -15.0]),
        ("-k.x[1] / (1 + .5e1)", [-2 / 3, -1.5]),
        ("max(`link 1`, 0.25, -1) * min(k.x[1], 5)", [2.0, 1.25]),
        (
            "log10(1e2 * k.x[1] / k.x[1]) - abs(`link 1`) + 2 ** 3 ** 0 * exp(0*`link 1`)",
            [3.5, 1.0],
        ),
        ("10 - k.x[1] - 1", [5.0, 0.0]),
        ("-" * 300 + "k.x[1]", [4.0, 9.0]),
    ):
        np.testing.assert_allclose(value_of(text, given), expected, rtol=1e-14, err_msg=text)
    missing = {"a": np.array([np.nan, 2.0]), "b": np.array([1.0, np.nan])}
    assert all(
        np.isnan(value_of(text, missing)).all()
        for text in ("max(a, b)", "min(a, b)", "a + b", "0 * a * b")
    )
    assert (
        np.isnan(value_of("log(`link 1`)", given)[1])
        and value_of("1 / (k.x[1] - 4)", given)[0] == np.inf
    )


def test_derived_outputs_and_constraints_are_columns_of_the_collected_table_alone(
    studies, tmp_path: Path
) -> None:
    """By hand from the columns of the table; the parts stay as they are, and so does the hash."""
    limits = '[[constraint]]\nvalue = "range_x_um"\nleast = 505.0\n[[constraint]]\nvalue = "ratio"\nmost = -0.2\n'
    plain, loaded = (studies.of(FEW, NECK, RADIUS, tail=tail) for tail in ("", OUTPUTS + limits))
    parts = parts_of(loaded, tmp_path, 40)
    assert (
        plain.hash == loaded.hash
        and parts.schema.names == parts_of(plain, tmp_path, 40).schema.names
    )
    rows = answer(loaded, 0, 40)
    rows.status[3] = "refused"
    rows.values[3] = np.nan
    parts.folder.mkdir(parents=True)
    write_part(parts, range(40), table_of(parts, range(40), rows))
    for name in ("t.parquet", "t.csv"):
        collect(parts, tmp_path / name)
    stored = pq.read_table(tmp_path / "t.parquet").to_pandas()
    assert list(stored.columns[-4:]) == ["slenderness", "ratio", "other", "feasible"]
    assert (tmp_path / "t.csv").read_text().splitlines()[0].endswith('"ratio","other","feasible"')
    slender = stored["neck of base"] / 3.9
    ratio = stored["kxx_n_per_mm"] / np.sqrt(stored["ktt_n_mm_per_rad"]) - 3 * slender
    ok = np.arange(40) != 3
    np.testing.assert_allclose(stored["slenderness"][ok], slender[ok], rtol=1e-13)
    np.testing.assert_allclose(stored["ratio"][ok], ratio[ok], rtol=1e-13)
    np.testing.assert_allclose(stored["other"][ok], 0.71 + 2 * stored["r"][ok], rtol=1e-13)
    keeps = (stored["range_x_um"] >= 505.0) & (ratio <= -0.2)
    assert 5 < keeps[ok].sum() < 34
    assert (stored["feasible"][ok] == keeps[ok]).all()
    assert stored["feasible"][3] is None and np.isnan(stored["slenderness"][3])
    table = read_table(tmp_path / "t.parquet")
    assert table.infeasible.sum() == (ok & ~keeps).sum() and not table.infeasible[3]
    np.testing.assert_array_equal(table.kept, ok & keeps)
    np.testing.assert_array_equal(table.columns["ratio"][ok], stored["ratio"][ok])
    base = nominal(loaded)
    assert base["slenderness"] == pytest.approx(0.53 / 3.9, rel=1e-13)
    assert base["other"] == pytest.approx(0.71 + 1.6 + 1.6, rel=1e-13)


@pytest.mark.parametrize("head", ['model = "analytic"', 'model = "fe"'])
def test_a_constraint_on_factors_and_keys_alone_refuses_before_anything_is_solved(
    studies, monkeypatch: pytest.MonkeyPatch, head: str
) -> None:
    limit = (
        '[[constraint]]\nlabel = "t/R"\nvalue = "slenderness / 1.0"\nleast = 0.12\nmost = 0.15\n'
    )
    loaded = studies.of(FEW, NECK, RADIUS, head=head, tail=OUTPUTS + limit)
    monkeypatch.setattr(
        "flexfem.paper.study.StageFamily.solved", lambda *_: np.zeros(len(loaded.outputs))
    )
    rows = answer(loaded, 0, 40)
    neck = sample(loaded, 0, 40)[:, 0]
    outside = (neck / 3.9 < 0.12) | (neck / 3.9 > 0.15)
    assert 5 < outside.sum() < 35
    assert list(rows.status) == ["refused" if out else "ok" for out in outside]
    first = int(np.flatnonzero(outside)[0])
    assert (
        rows.reason[first]
        == f"constraint t/R = {neck[first] / 3.9:.6g}, expected at least 0.12 and at most 0.15"
    )
    edits = {
        "0.12": "0.13",
        "0.15": "0.16",
        "/ hinges.base": "/ 1.01 / hinges.base",
        "/ 1.0": "/ 1.1",
        "t/R": "t/r",
    }
    for old, new in edits.items():
        assert old in OUTPUTS + limit
        changed = studies.of(FEW, NECK, RADIUS, head=head, tail=(OUTPUTS + limit).replace(old, new))
        assert changed.hash != loaded.hash, old


def test_correlated_factors_have_their_rank_correlation_and_keep_their_distributions(
    studies,
) -> None:
    pairs = (
        '[[correlation]]\nfactors = ["r", "b"]\ncoefficient = 0.6\n'
        '[[correlation]]\nfactors = ["neck of base", "b"]\ncoefficient = -0.3\n'
    )
    bell = 'label = "b"\nkey = "thickness_mm"\ndistribution = "normal"\nsd = 1.0\nlower = 9.0\nupper = 12.0'
    free = 'label = "E"\nkey = "material.youngs_modulus_gpa"\nfrom = 60.0\nto = 80.0'
    factors = f'{NECK}\nscale = "log"', RADIUS, free, bell
    for method in ("monte_carlo", "sobol", "latin_hypercube"):
        sampling = f'method = "{method}"\ndesigns = 8192\nseed = 3'
        loaded = studies.of(sampling, *factors, tail=pairs)
        apart = studies.of(sampling, *factors)
        found = sample(loaded, 0, 8192)
        ranks = spearmanr(found).statistic
        wanted = np.array([[1, 0, 0, -0.3], [0, 1, 0, 0.6], [0, 0, 1, 0], [-0.3, 0.6, 0, 1]])
        # four standard errors, and less than 0.6 of the normal deviates is off, 0.582 of the ranks
        np.testing.assert_allclose(
            ranks, wanted, atol=0.008 if method == "sobol" else 4 / np.sqrt(8192)
        )
        shape = truncnorm((9.0 - 9.7) / 1.0, (12.0 - 9.7) / 1.0, loc=9.7, scale=1.0)
        for values, marginal in (
            (np.log(found[:, 0] / 0.4) / np.log(0.7 / 0.4), uniform()),
            (found[:, 1], uniform(1.4, 0.3)),
            (found[:, 3], shape),
        ):
            assert kstest(values, marginal.cdf).pvalue > 1e-4
        np.testing.assert_array_equal(
            found[:, 2], sample(apart, 0, 8192)[:, 2]
        )  # who is not named stays
        np.testing.assert_array_equal(found[1000:1003], sample(loaded, 1000, 1003))
        assert loaded.hash != apart.hash


def test_a_key_has_the_number_of_the_file(studies) -> None:
    """The base stage's own, an override's, and one that a factor sets: all as the file says them."""
    stage = studies.folder / "stage.toml"
    stage.write_text(stage.read_text().replace("neck_mm = 0.71", "neck_mm = 0.71\naxis_deg = 92.5"))
    for key, expected in (
        ("material.youngs_modulus_gpa", 68.3),
        ("chain.joint_angles_deg[2]", 92.0),
        ("override.2.elbow.axis_deg", 92.5),
        ("override.2.elbow.neck_mm", 0.71),
        ("override.1.elbow.neck_mm", 0.47),
    ):
        output = f'[[output]]\nname = "own"\nexpression = "{key}"'
        loaded = studies.of(FEW, NECK, tail=output)
        columns = {"neck of base": np.array([0.5, 0.6])}
        found = judge(loaded, columns, np.array([True, True])).derived["own"]
        np.testing.assert_allclose(found, expected, rtol=1e-12, err_msg=key)
