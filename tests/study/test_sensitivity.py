"""Sobol indices against functions whose indices are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexfem.refused import BadInput
from flexfem.study.collect import StudyTable
from flexfem.study.findings import sensitivity
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.source import Source
from flexfem.study.statistics import first_order

SALTELLI = 'method = "saltelli"\nbase = {}\nseed = 5'
UNIT = 'key = "{}"\ndistribution = "uniform"\nlower = 1.0\nupper = 2.0'
KEYS = ("hinges.base.neck_mm", "hinges.elbow.neck_mm", "thickness_mm")
BANDS = 2.0  # an index may be so many half-widths of its interval off: 1 in 10,000 are


def three_factors(studies, base: int) -> LoadedStudy:
    return studies.of(SALTELLI.format(base), *(UNIT.format(key) for key in KEYS))


def table_of(
    loaded: LoadedStudy, value: str, answers: np.ndarray, status: dict[int, str] | None = None
) -> StudyTable:
    n = len(answers)
    states = np.full(n, "ok", dtype=object)
    for place, state in (status or {}).items():
        states[place] = state
    reason = np.where(states == "ok", "", "thickness_mm = 2, expected less").astype(object)
    columns = {name: np.full(n, 1.0) for name in loaded.outputs} | {value: answers}
    return StudyTable(np.arange(n), states, reason, columns)


def test_ishigami_has_its_published_indices(studies) -> None:
    """T. Ishigami, T. Homma, ISUMA 1990, with a = 7, b = 0.1: variance by hand."""
    loaded = three_factors(studies, 4096)
    x = np.pi * (2 * (sample(loaded, 0, loaded.count) - 1) - 1)
    a = 7.0
    b = 0.1
    answers = np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1 = 0.5 * (1 + b * np.pi**4 / 5) ** 2
    v2 = a**2 / 8
    v13 = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = v1 + v2 + v13
    found = sensitivity(
        Source(loaded, table_of(loaded, "kxx_n_per_mm", answers), {}), "kxx_n_per_mm"
    )
    first = np.array([v1, v2, 0.0]) / total
    whole = np.array([v1 + v13, v2, v13]) / total
    assert (np.abs(found.first - first) <= BANDS * found.first_band).all()
    assert (np.abs(found.total - whole) <= BANDS * found.total_band).all()
    assert (
        found.first_band.max() < 0.1 and found.total_band.max() < 0.1
    )  # so that the lines above say something


def exact_shares() -> tuple[np.ndarray, np.ndarray]:
    """First-order indices of the function above, and of the same with a list of three values for c."""
    a = 16 / 12
    b = 4 / 45
    ac = 4 / 144
    spread = np.var([0.0, 0.5, 1.0])
    listed = np.array([a, b, spread])
    return np.array([a, b, 1 / 12]) / (a + b + 1 / 12 + ac), listed / (
        listed.sum() + 4 * spread / 12
    )


@pytest.mark.parametrize("n", [100, 500])
def test_one_plain_sample_tells_first_order_indices_with_intervals_that_hold(n: int) -> None:
    rng = np.random.default_rng(8)
    for listed, shares in zip((False, True), exact_shares(), strict=True):
        found = []
        held = []
        for _ in range(150):
            x = rng.random((n, 3))
            x[:, 2] = rng.integers(0, 3, n) / 2 if listed else x[:, 2]
            one = first_order(x.T, 5e4 + 3 * x[:, 0] + x[:, 1] ** 2 + 2 * x[:, 0] * x[:, 2])
            assert one.total is None and one.total_band is None
            found.append(one.first)
            held.append(np.abs(one.first - shares) <= one.first_band)
        off = np.abs(np.mean(found, axis=0) - shares) / (np.std(found, axis=0) / np.sqrt(150))
        assert (off < 4).all(), off  # standard errors: noise explains nothing on average
        assert (np.mean(held, axis=0) > 0.87).all(), np.mean(held, axis=0)
    spread = np.std([one[0] for one in found])
    assert one.first_band[0] == pytest.approx(
        1.96 * spread, rel=0.6
    )  # and says no more than it must


def test_a_plain_sample_of_a_study_is_taken_factor_by_factor(studies) -> None:
    loaded = studies.of(
        'method = "monte_carlo"\ndesigns = 400\nseed = 5', *(UNIT.format(key) for key in KEYS)
    )
    values = sample(loaded, 0, 400)
    answers = values @ [3.0, 0.0, -1.0]
    table = table_of(
        loaded, "kxx_n_per_mm", np.where(np.arange(400) == 7, np.nan, answers), {7: "refused"}
    )
    columns = table.columns | {column.name: values[:, k] for k, column in enumerate(loaded.columns)}
    found = sensitivity(Source(loaded, replace(table, columns=columns), {}), "kxx_n_per_mm")
    np.testing.assert_allclose(
        found.first, [0.9, 0.0, 0.1], atol=0.05
    )  # squares of the weights, 399 designs


LACKING = np.where(np.isin(np.arange(40), [7, 9]), np.nan, np.arange(40.0))
ROUND_OFF = 1e-14 * np.random.default_rng(1).normal(size=40)


@pytest.mark.parametrize(
    ("value", "answers", "said"),
    [
        (
            "kxx_n_per_mm",
            LACKING,
            "kxx.* 2 of 40 designs.*design 7: refused: thickness_mm = 2, expected less",
        ),
        ("kxx_n_per_mm", np.arange(37.0), "3 of 40 designs are not computed"),
        ("kxx_n_per_mm", 41.0 + ROUND_OFF, "sensitivity of kxx_n_per_mm: no factor changes it"),
        ("coupling_xy", ROUND_OFF, "sensitivity of coupling_xy: no factor changes it"),
        ("kxt_n", ROUND_OFF, "sensitivity of kxt_n: no factor changes it"),
    ],
)
def test_what_has_no_sensitivity_is_refused_in_one_line(
    studies, value: str, answers: np.ndarray, said: str
) -> None:
    loaded = three_factors(studies, 8)
    status = {9: "time limit", 7: "refused"} if answers is LACKING else None
    with pytest.raises(BadInput, match=rf"^[^\n]*{said}[^\n]*$"):
        sensitivity(Source(loaded, table_of(loaded, value, answers, status), {}), value)
