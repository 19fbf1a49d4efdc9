"""The calibrated hinge: its chart against direct finite elements, its ends, and what it makes of a
stage.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hinge_charts import RATIOS, SingleHinge, sample

from flexfem.hinges.chart import beam_integrals, hinge_chart
from flexfem.hinges.formulas import FORMULAS, formula
from flexfem.paper.model import analyse
from flexfem.paper.stage import load_stage
from flexfem.questions.check import hinge_review
from flexfem.refused import BadInput

ROOT = Path(__file__).parents[2]
E = 68.9e3
NU = 0.29
B = 9.3
R = 1.7
INTERPOLATION = 1e-4  # a tenth of what is promised; measured at random points: 3e-6
CALIBRATED = formula("calibrated")


def random_hinges(number: int, seed: int) -> list[SingleHinge]:
    rng = np.random.default_rng(seed)
    ratios = np.exp(rng.uniform(*np.log(RATIOS), number))
    return [
        SingleHinge(float(t), float(1 / s))
        for t, s in zip(ratios, rng.uniform(0.02, 1.0, number), strict=True)
    ]


def worst_against_finite_elements(
    hinges: list[SingleHinge], levels: tuple[int, ...], nu: float
) -> float:
    """Largest relative difference of the formula from direct finite elements, in physical units."""
    direct = np.array(
        [sample(hinge._replace(poissons_ratio=nu), levels).values for hinge in hinges]
    ).T
    direct /= [[E * B * R**2], [E * B], [E * B]]
    neck = R * np.array([h.ratio for h in hinges])
    high = R * np.array([h.block[0] for h in hinges])
    return float(
        np.max(np.abs(np.array(CALIBRATED.compliance(R, neck, B, E, nu, high)) / direct - 1))
    )


@pytest.fixture
def edited(tmp_path):
    def make(*changes: tuple[str, str]):
        text = (ROOT / "geometry" / "mobility6.toml").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "stage.toml").write_text(text)
        return load_stage(tmp_path / "stage.toml")

    return make


def test_calibrated_hinges_are_those_of_direct_finite_elements() -> None:
    assert worst_against_finite_elements(random_hinges(6, seed=4), (2, 3, 4), NU) < INTERPOLATION


@pytest.mark.slow
def test_calibrated_hinges_are_those_of_fine_finite_elements_everywhere() -> None:
    assert worst_against_finite_elements(random_hinges(40, seed=5), (4, 6, 8), 0.37) < INTERPOLATION


def test_the_chart_goes_through_its_samples() -> None:
    chart = hinge_chart()
    made = sample(
        SingleHinge(0.48032431, 1.2765077), (4, 6, 8)
    ).values  # the sixth and the third of its points
    found = np.array(chart.factors(0.48032431, 1.2765077)) * beam_integrals(np.array(0.48032431))
    np.testing.assert_allclose(found, made, rtol=1e-7)  # digits kept in the file, and round-off
    assert chart.low.ends[0] == RATIOS == (0.02, 1.2)


def test_blocks_of_any_height_are_on_the_chart() -> None:
    """Direct finite elements of H/h = 1000 and t/R = 0.3 (411,298 unknowns, our own) say 13.14244
    and 48.19857.
    """
    ratio = 0.3
    height = 1000.0
    found = CALIBRATED.compliance(1.0, ratio, 1.0, 1.0, 0.0, height * (2 + ratio))
    assert (found.axial, found.shear) == (
        pytest.approx(13.14244, rel=1e-5),
        pytest.approx(48.19857, rel=3e-5),
    )
    further = CALIBRATED.compliance(1.0, ratio, 1.0, 1.0, 0.0, 1e9 * (2 + ratio))
    assert further.rotation == pytest.approx(found.rotation, rel=1e-6)
    grown = np.array(further)[1:] - np.array(found)[1:]
    np.testing.assert_allclose(
        grown, 4 / np.pi * np.log(1e6), rtol=2e-3
    )  # two half-planes under a force


@pytest.mark.parametrize(
    ("tau", "height"), [(0.0199, 1.5), (1.21, 50), (0.3, 0.99), (0.3, np.inf), (np.nan, 1.5)]
)
def test_beyond_the_chart_there_is_nothing(tau: float, height: float) -> None:
    t = np.array([0.3, tau]) * R
    high = np.array([1.5, height]) * (2 * R + t)
    assert CALIBRATED.in_range(R, t, high).tolist() == [True, False]
    found = np.array(CALIBRATED.compliance(R, t, B, E, NU, high))
    assert np.isfinite(found[:, 0]).all() and np.isnan(found[:, 1]).all()


def test_the_edge_of_the_chart_is_on_it_whatever_the_round_off() -> None:
    t = np.array(RATIOS) * R
    high = 2 * (R + t / 2) * (1 - 1e-15)
    assert np.isfinite(np.array(CALIBRATED.compliance(R, t, B, E, NU, high))).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "neck_mm = 0.5\nprismatic",
            "neck_mm = 0.07\nprismatic",
            r"hinges\.base\.neck_mm = 0\.07: t/R = 0\.0175 .*'calibrated', expected 0\.02 to 1\.2$",
        ),
        (
            "link_width_mm = 9.0",
            "link_width_mm = 8.1",
            r"hinges\.base\.radius_mm = 4, notch deeper than the link",
        ),
    ],
    ids=["t/R", "H/h"],
)
def test_a_stage_with_a_hinge_off_the_chart_is_refused_by_name(edited, old, new, said) -> None:
    stage = edited((old, new))
    with pytest.raises(BadInput, match=said):
        analyse(stage, formula="calibrated")


@pytest.mark.parametrize(
    ("notch", "finite_elements"),
    [((1.4, 0.4), (0.0389336207, 3.562312437e-5)), ((0.7, 0.3), (0.0511527655, 4.649735755e-5))],
    ids=["H/h = 3.06", "H/h = 5.76"],
)
def test_links_far_higher_than_their_notches_are_those_of_finite_elements(
    edited, notch, finite_elements
) -> None:
    """Links of 9.8 mm: whole stages in extrapolated finite elements, our own; they differ by 6e-5
    at most.
    """
    small = f"radius_mm = {notch[0]}\nneck_mm = {notch[1]}"
    stage = edited(
        ("link_width_mm = 9.0", "link_width_mm = 9.8"), ("radius_mm = 1.5\nneck_mm = 0.5", small)
    )
    found = np.diag(analyse(stage, 21, "calibrated", links=True).compliance)[[0, 2]]
    np.testing.assert_allclose(found, finite_elements, rtol=2e-4)


def test_formulas_are_set_against_calibrated_full_notches() -> None:
    found = hinge_review(2.3, NU)
    height = 2.3
    curves = {curve.name: curve for curve in found.curves}
    necks = found.ratio * R
    assert {*curves, "calibrated"} == {*FORMULAS}
    full = CALIBRATED.compliance(R, necks, B, E, NU)
    own = formula("koster").compliance(R, necks, B, E, NU)
    np.testing.assert_allclose(curves["koster"].rotation, own.rotation / full.rotation, rtol=1e-12)
    slotted = CALIBRATED.compliance(R, necks, B, E, NU, height * (2 * R + necks))
    higher = [getattr(found.higher, name) for name in ("rotation", "axial", "shear")]
    np.testing.assert_allclose(higher, np.array(slotted) / np.array(full), rtol=1e-12)
