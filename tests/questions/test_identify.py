"""Neck offset and soft fixture from measured slopes: recovered where the data can, and said where
they cannot.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexfem
from flexfem.paper.fixture import MeasuredSlopes, Measurement, fixture_of, pushes_of
from flexfem.paper.identify import identify
from flexfem.refused import BadInput

from ..conftest import ROOT

FIXTURE = fixture_of(ROOT / "cases" / "fixture.toml")
NAMES = ("kxx", "kyy", "ktt")


@cache
def reference():
    return flexfem.load(ROOT / "geometry" / "mobility6.toml").replace(model="plane_stress")


def unlike():
    """Chains of unequal necks and radii."""
    return reference().replace(
        override={
            (1, "elbow"): {"neck": 0.41},
            (2, "base"): {"radius": 3.4},
            (3, "platform"): {"neck": 0.62},
        }
    )


@cache
def made(stage, offset, softer):
    """Slopes (3,) of the stage with other necks, all nine, on the shipped set-up with a softer
    pole.
    """
    necks = {
        (chain, name): {"neck": stage.hinge(chain, name).neck + offset}
        for chain in (1, 2, 3)
        for name in ("base", "elbow", "platform")
    }
    C = flexfem.analyse(stage.replace(override=necks), links=True, formula="calibrated").compliance
    own, pole, bar = pushes_of(FIXTURE).shares(C)
    return 1 / (own + softer * pole + bar)


def measured(slopes, share=0.005, axes=(0, 1, 2)):
    """The shipped set-up with these slopes and standard deviations of this share of them."""
    given = {NAMES[k]: float(slopes[k]) for k in axes} | {
        f"{NAMES[k]}_sd": share * float(slopes[k]) for k in axes
    }
    return FIXTURE.model_copy(update={"measured": MeasuredSlopes(**given)})


@pytest.mark.parametrize("stage", [reference, unlike])
def test_exact_slopes_give_the_offset_and_the_pole_they_were_made_with(stage):
    """Necks 10 um too thin and a pole four times as soft; of other chains too, where X and Y
    differ.
    """
    found = identify(stage(), measured(made(stage(), -0.010, 4.0)))
    assert found.offset == pytest.approx(-10.0, abs=2e-3)
    assert found.fixture[0] == pytest.approx(4.0, rel=1e-4)
    assert (
        found.offset_low < -10 < found.offset_high
        and found.fixture_low[0] < 4 < found.fixture_high[0]
    )
    assert found.chi_square < 1e-6 and found.dof == 1 and found.distinct
    assert found.stiffness[2] == pytest.approx(796514.57 / 4, rel=1e-3)
    assert "Both are needed" in found.finding
    assert found.slope[0, 1] > found.slope[0, 2] == pytest.approx(found.slope[0, 0])


def test_the_width_of_an_interval_is_that_of_the_normal_distribution_where_it_is_narrow():
    """1.96 standard deviations of the linearised covariance, on either side."""
    slopes = made(reference(), -0.010, 4.0)
    found = identify(reference(), measured(slopes, 1e-5))
    steps = np.array([[made(reference(), -0.010 + d, 4.0 + e) for d, e in ((1e-5, 0), (0, 1e-3))]])[
        0
    ]
    J = ((steps - slopes) / [[1e-5], [1e-3]]).T / (1e-5 * slopes[:, None])
    sd = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert found.offset_high - found.offset_low == pytest.approx(2e3 * 1.96 * sd[0], rel=0.01)
    assert found.fixture_high[0] - found.fixture_low[0] == pytest.approx(2 * 1.96 * sd[1], rel=0.01)


@pytest.mark.parametrize("axes", [(0,), (2,), (0, 1)])
def test_one_direction_alone_cannot_tell_necks_from_fixture(axes):
    """Nor can two that are alike by symmetry."""
    found = identify(reference(), measured(made(reference(), -0.010, 4.0), axes=axes))
    assert not found.distinct and found.finding.startswith(
        "These data cannot distinguish the causes."
    )
    assert np.isnan(found.condition) and np.isnan(found.correlation)
    assert found.allowed[1] and found.allowed[2] and not found.allowed[0]
    assert np.isinf(found.offset_high) and found.offset_low < -10
    assert found.fixture_low[0] == 0.0 and np.isinf(found.fixture_high[0])
    assert found.dof == len(axes) - 1


def test_x_and_theta_together_tell_them_apart():
    found = identify(reference(), measured(made(reference(), -0.010, 4.0), axes=(0, 2)))
    assert found.distinct and found.dof == 0 and found.offset == pytest.approx(-10.0, abs=1e-3)
    assert not found.allowed[1] and not found.allowed[2]
    wide = identify(reference(), measured(made(reference(), -0.010, 4.0), 0.2, axes=(0, 2)))
    assert not wide.distinct and wide.allowed[0] and "Neither is necessary" in wide.finding


@pytest.mark.parametrize(
    ("offset", "softer", "said"),
    [
        (0.015, 0.0, "necks 15 um wider"),
        (-0.015, 0.0, "necks 15 um thinner"),
        (0.0, 5.0, "A soft fixture explains"),
    ],
)
def test_one_cause_alone_is_named(offset, softer, said):
    found = identify(reference(), measured(made(reference(), offset, softer), 0.001))
    assert said in found.finding and found.distinct
    assert found.allowed[1] != found.allowed[2]


def test_two_springs_of_their_own_take_all_that_slopes_can_say():
    """Three unknowns, two of them in theta alone or in X and Y alone."""
    slopes = made(reference(), -0.010, 4.0)
    alone = Measurement(name="slopes", measured=measured(slopes).measured)
    for found in (
        identify(reference(), alone),
        identify(reference(), measured(slopes), unknown="springs"),
    ):
        assert found.axes["number"] == ("translation", "rotation")
        assert not found.distinct and found.allowed[2] and not found.allowed[1]
        assert "A soft fixture alone agrees" in found.finding
        x, rotation = found.cause_fixture[2]
        bare = 1 / np.array([found.slope[0, 1], found.slope[2, 1]])
        assert 1 / (x + bare[0]) == pytest.approx(slopes[0], rel=1e-4)
        assert 1 / (rotation + bare[1]) == pytest.approx(slopes[2], rel=1e-6)


def test_slopes_that_nothing_explains_are_said_to_be_so():
    """X and Y of a symmetric stage differ by 10 %; stiffer in theta alone, which no pole makes; no
    freedom is left.
    """
    for factors, axes in (([1.05, 0.95, 1.0], (0, 1, 2)), ([1.0, 1.0, 1.1], (0, 2))):
        found = identify(reference(), measured(made(reference(), 0.0, 1.0) * factors, axes=axes))
        assert (
            found.finding.startswith("Necks and fixture together do not explain the data")
            and found.chi_square > 20
        )
        assert not found.distinct


def test_a_difference_between_alike_directions_is_no_ground_to_stand_on():
    """X and Y of unlike chains differ in how they depend on necks, a little; two springs take all
    else.
    """
    found = identify(unlike(), measured(made(unlike(), -0.010, 4.0)), unknown="springs")
    assert abs(found.correlation) > 0.98
    assert any("small differences between the directions" in text for text in found.warnings)
    assert identify(unlike(), measured(made(unlike(), -0.010, 4.0))).warnings == []


def test_what_has_no_interval_is_refused():
    bare = FIXTURE.model_copy(
        update={"measured": MeasuredSlopes(kxx=37.0, kxx_sd=0.1, ktt=41000.0)}
    )
    with pytest.raises(BadInput, match=r"measured\.ktt_sd_n_mm_per_rad: expected"):
        identify(reference(), bare)
    with pytest.raises(BadInput, match=r"no \[measured\] slopes"):
        identify(reference(), FIXTURE)
    ground = measured(np.array([37.0, 37.0, 4e4])).model_copy(
        update={"lvdt": FIXTURE.lvdt.model_copy(update={"at": "platform"})}
    )
    with pytest.raises(BadInput, match="these readings include no pole"):
        identify(reference(), ground, unknown="pole")
    assert identify(reference(), ground).axes["number"][0] == "translation"


def test_confidence_and_dropped_numbers_set_what_a_cause_alone_is_allowed():
    """Chi square without both numbers: 4.605 at 90 %, 5.991 at 95 %; the map's limit likewise."""
    slopes = made(reference(), 0.0, 0.0)
    factor = 1 - 0.0113  # rigid pole; 2.3 standard deviations of theta
    one = measured(slopes * np.array([1.0, 1.0, factor]), axes=(0, 2))
    wide = identify(reference(), one)
    narrow = identify(reference(), one, confidence=90.0)
    assert 4.605 < wide.cause_chi_square[0] - wide.chi_square < 5.991
    assert wide.allowed[0] and not narrow.allowed[0]
    assert [wide.region_limit, narrow.region_limit] == pytest.approx([5.9915, 4.6052], rel=1e-4)
