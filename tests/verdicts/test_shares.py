"""In what share of an ensemble a claim holds: counted by hand, and no verdict on too few stages."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexfem.verdicts.claims import Claim
from flexfem.verdicts.measures import Measure
from flexfem.verdicts.shares import Own, binomial_interval, dependence_of, ruling, said_of, share_of

OWN = Own("paros-weisbord", np.array([7.0, 8.0]), True)


def claim(**limits):
    return Claim.model_validate({"id": "a", "statement": "b", "where": "c", "measure": "mobility", **limits})


def measure(slack=0.0):
    return Measure(lambda on: np.zeros((1, 1)), lambda on, values: "", slack=slack)


WINDOW = claim(low_percent=5.0, high_percent=10.0)


def share(values, slack=0.0, of=WINDOW, own=OWN):
    return share_of(of, measure(slack), np.array(values, dtype=float), own)


def test_every_value_of_a_stage_counts_and_a_stage_without_values_counts_for_nothing():
    found = share([[6.0, 9.0], [6.0, 11.0], [4.0, 9.0], [np.nan, 7.0], [5.0, 10.0], [3.0, 3.0]])
    assert (found.stages, found.holding, found.share) == (5, 2, 0.4)
    assert found.reference == [7.0, 8.0] and found.reference_holds
    assert share([[np.nan, 6.0]]) is None


def test_stages_nearer_to_a_limit_than_the_metal_is_known_widen_the_interval_only():
    values = [[5.02], [4.98], [9.0], [20.0]]
    exact, vague = share(values), share(values, slack=0.05)
    assert (exact.surely, exact.holding, exact.perhaps) == (2, 2, 2)
    assert (vague.surely, vague.holding, vague.perhaps) == (1, 2, 3)
    assert vague.low < exact.low and vague.high > exact.high


def test_intervals_are_those_of_clopper_and_pearson():
    """Newcombe, Statist. Med. 17 (1998) 857, table I: 81 of 263, 15 of 148 and 0 of 20, 95 % exact."""
    for holding, stages, low, high in ((81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0, 0.1684)):
        assert binomial_interval(holding, holding, stages) == pytest.approx((low, high), abs=5e-5)
    assert binomial_interval(15, 81, 263)[0] == pytest.approx(binomial_interval(15, 15, 263)[0])
    assert binomial_interval(15, 81, 263)[1] == pytest.approx(binomial_interval(81, 81, 263)[1])


@pytest.mark.parametrize(
    ("holding", "stages", "expected"),
    [
        (20, 20, "cannot be decided"),
        (0, 20, "cannot be decided"),
        (72, 72, "holds"),  # 0.025^(1/72) = 0.950
        (71, 71, "cannot be decided"),
        (0, 72, "does not hold"),
        (10, 20, "depends on the dimensions"),
        (1, 20, "depends on the dimensions"),
        (290, 300, "depends on the dimensions"),
        (294, 300, "holds"),  # 0.957 at the low end
        (6, 300, "does not hold"),
        (10, 300, "depends on the dimensions"),
    ],
)
def test_a_verdict_is_by_the_whole_interval(holding, stages, expected):
    assert ruling(share([[7.0]] * holding + [[30.0]] * (stages - holding))) == expected


def test_what_holds_or_fails_by_less_than_the_metal_is_known_decides_nothing():
    near = [[5.01]] * 50 + [[4.99]] * 50
    assert ruling(share(near)) == "depends on the dimensions"
    assert ruling(share(near, slack=0.02)) == "cannot be decided"
    assert ruling(share([*near, [8.0], [2.0]], slack=0.02)) == "depends on the dimensions"


@given(st.integers(1, 200).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_claim_and_its_opposite_have_opposite_verdicts(case):
    holding, stages = case
    values = [[7.0]] * holding + [[30.0]] * (stages - holding)
    one, other = (ruling(share(values, of=each)) for each in (WINDOW, claim(low_percent=20.0)))
    opposite = {"holds": "does not hold", "does not hold": "holds"}
    assert other == opposite.get(one, one)


def test_the_number_that_tells_where_a_claim_holds_is_found_though_it_holds_between_two_ends():
    ratio, other = np.linspace(0.0, 1.0, 101), np.modf(np.arange(101) * 0.6180339887)[0]
    found = dependence_of(WINDOW, 20.0 * ratio[:, None], {"other": other, "t/R": ratio})
    assert found.name == "t/R" and found.drawn == (0.0, 1.0)
    assert found.holding == pytest.approx((0.2625, 0.4875)) and found.distance > 0.45  # of 0.25 to 0.50
    assert found.failing == pytest.approx((0.0375, 0.9625), abs=0.01)
    assert dependence_of(WINDOW, np.full((101, 1), 7.0), {"t/R": ratio}) is None
    assert dependence_of(WINDOW, np.full((101, 1), 70.0), {"t/R": ratio}) is None


def test_what_only_the_first_stages_are_measured_for_is_told_by_their_numbers():
    ratio = np.linspace(0.0, 1.0, 101)
    found = dependence_of(WINDOW, 20.0 * ratio[:51, None], {"t/R": ratio})
    assert found.drawn == (0.0, 0.5)


def test_the_sentence_says_share_interval_formula_and_other_formulas():
    first, other = share([[7.0], [30.0]]), share([[30.0], [30.0]], own=OWN._replace(formula="koster", in_range=False))
    same = other.model_copy(update={"formula": "lobontiu", "reference": [1.0, 2.0], "reference_holds": False})
    ratio = {"t/R": np.array([0.1, 0.9])}
    found = said_of(
        [first, other, same],
        dependence_of(WINDOW, np.array([[7.0], [30.0]]), ratio),
        np.array([[7.0], [30.0]]),
        by_formula=True,
    )
    assert found == (
        "holds in 50.0 % of 2 stages (95 % interval 1.3 to 98.7 %) with hinge formula paros-weisbord, values 8.15 to"
        " 28.8 % in nine of ten; t/R decides most: 0.1 to 0.1 where it holds, 0.9 to 0.9 where not; with other formulas"
        " in 0.0 % of 2 (koster, lobontiu); on the stages of the file it fails with lobontiu (1 to 2 %, t/R outside its"
        " range)"
    )
    zero = said_of([first], None, np.array([[1e-12], [-2e-13]]), by_formula=False)
    assert zero.endswith("(95 % interval 1.3 to 98.7 %), every value below 1e-05 %")
