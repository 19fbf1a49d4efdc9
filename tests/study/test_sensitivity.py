"""Sobol indices against functions whose indices are known."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.errors import BadInput
from flexfem.study.plan import LoadedStudy
from flexfem.study.sampling import sample
from flexfem.study.sensitivity import sensitivity, sobol_indices
from flexfem.study.table import StudyTable

SALTELLI = 'method = "saltelli"\nbase = {}\nseed = 5'
UNIT = 'key = "{}"\ndistribution = "uniform"\nlower = 1.0\nupper = 2.0'
KEYS = ("hinges.base.neck_mm", "hinges.elbow.neck_mm", "thickness_mm")
BANDS = 2.0  # an index may be so many half-widths of its interval off: 1 in 10,000 are


def three_factors(studies, base: int) -> LoadedStudy:
    return studies.of(SALTELLI.format(base), *(UNIT.format(key) for key in KEYS))


def table_of(loaded: LoadedStudy, value: str, answers: np.ndarray, status: dict[int, str] | None = None) -> StudyTable:
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
    a, b = 7.0, 0.1
    answers = np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1, v2, v13 = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = v1 + v2 + v13
    found = sensitivity(loaded, table_of(loaded, "kxx_n_per_mm", answers), "kxx_n_per_mm")
    first, whole = np.array([v1, v2, 0.0]) / total, np.array([v1 + v13, v2, v13]) / total
    assert (np.abs(found.first - first) <= BANDS * found.first_band).all()
    assert (np.abs(found.total - whole) <= BANDS * found.total_band).all()
    assert found.first_band.max() < 0.1 and found.total_band.max() < 0.1  # so that the lines above say something


def test_a_linear_function_shares_its_variance_by_squares_and_nothing_interacts(studies) -> None:
    loaded = three_factors(studies, 2048)
    weights = np.array([3.0, -1.0, 0.5])
    answers = 1e5 + sample(loaded, 0, loaded.count) @ weights
    found = sobol_indices(answers, 3)
    shares = weights**2 / np.sum(weights**2)
    np.testing.assert_allclose(found.first, shares, atol=0.01)  # 2048 points of a Sobol sequence
    np.testing.assert_allclose(found.total, shares, atol=0.01)


def test_the_same_answers_have_the_same_intervals() -> None:
    answers = np.random.default_rng(4).normal(size=64 * 5)
    for one, other in zip(sobol_indices(answers, 3), sobol_indices(answers, 3), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_design_without_an_answer_is_refused_with_count_and_first_reason(studies) -> None:
    loaded = three_factors(studies, 8)
    answers = np.arange(40.0)
    answers[[7, 9]] = np.nan
    table = table_of(loaded, "kxx_n_per_mm", answers, {9: "time limit", 7: "refused"})
    with pytest.raises(BadInput) as refusal:
        sensitivity(loaded, table, "kxx_n_per_mm")
    text = str(refusal.value)
    for piece in ("kxx_n_per_mm", "2 of 40 designs", "design 7", "refused", "thickness_mm = 2, expected less"):
        assert piece in text
    assert "\n" not in text


def test_designs_that_are_open_are_refused(studies) -> None:
    loaded = three_factors(studies, 8)
    with pytest.raises(BadInput, match="3 of 40 designs are not computed"):
        sensitivity(loaded, table_of(loaded, "kxx_n_per_mm", np.arange(37.0)), "kxx_n_per_mm")


def test_another_sampling_is_refused(studies) -> None:
    loaded = studies.of('method = "monte_carlo"\ndesigns = 40\nseed = 5', *(UNIT.format(key) for key in KEYS))
    with pytest.raises(BadInput, match=r'sampling.method = "monte_carlo", expected "saltelli"'):
        sensitivity(loaded, table_of(loaded, "kxx_n_per_mm", np.arange(40.0)), "kxx_n_per_mm")


@pytest.mark.parametrize(("value", "size"), [("kxx_n_per_mm", 41.0), ("coupling_xy", 0.0), ("kxt_n", 0.0)])
def test_a_value_that_varies_by_round_off_alone_is_refused(studies, value: str, size: float) -> None:
    loaded = three_factors(studies, 8)
    answers = size + 1e-14 * np.random.default_rng(1).normal(size=40)
    with pytest.raises(BadInput, match=f"sensitivity of {value}: no factor changes it"):
        sensitivity(loaded, table_of(loaded, value, answers), value)
