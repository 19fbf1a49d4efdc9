"""The factors out of plane: their chart against direct finite elements, its limits and its ends."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest
from hinge_charts import RATIOS, THICK, SingleHinge, thick_sample
from hinge_charts import sample as plane_sample

from flexfem.hinges.chart import thickness_chart
from flexfem.hinges.chart import thickness_factors as factors

R = 1.7
NU = 0.29
WIDTHS = THICK.ends["b/t"]
POISSONS = THICK.ends["nu"]
# of the compliance; measured: 8e-5 in the median of random points, 8e-4 at the worst corner
INTERPOLATION = 1e-3
LEVELS = (1, 2, 3)


def random_hinges(number: int, seed: int) -> list[SingleHinge]:
    rng = np.random.default_rng(seed)
    ratio, width = (np.exp(rng.uniform(*np.log(ends), number)) for ends in (RATIOS, WIDTHS))
    return [
        SingleHinge(float(t), 1.0, float(b), nu)
        for t, b, nu in zip(ratio, width, rng.uniform(*POISSONS, number), strict=True)
    ]


def charted(hinge: SingleHinge) -> np.ndarray:
    t = hinge.ratio * R
    return np.array(factors(R, t, hinge.width * t, hinge.poissons_ratio)[:2])


def worst_against_finite_elements(hinges: list[SingleHinge], levels: tuple[int, ...]) -> float:
    direct = [
        1 - hinge.poissons_ratio**2 * thick_sample(hinge, levels)[0].values for hinge in hinges
    ]
    return float(np.max(np.abs(np.array([charted(hinge) for hinge in hinges]) / direct - 1)))


def test_charted_factors_are_those_of_direct_finite_elements() -> None:
    assert worst_against_finite_elements(random_hinges(2, seed=7), LEVELS) < INTERPOLATION


@pytest.mark.slow
def test_charted_factors_are_those_of_direct_finite_elements_everywhere() -> None:
    corners = [
        SingleHinge(ratio, 1.0, width, nu)
        for ratio in RATIOS
        for width in WIDTHS
        for nu in POISSONS
    ]
    assert (
        worst_against_finite_elements([*corners, *random_hinges(20, seed=5)], LEVELS)
        < INTERPOLATION
    )


def test_the_charts_are_those_that_were_made() -> None:
    """A position changed by 1 % can be less than finite elements differ by; charts that are made
    anew are others.
    """
    folder = THICK.path.parent
    found = {
        path.stem: hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        for path in folder.glob("*_chart*.json")
    }
    assert found == {
        "hinge_chart": "cec67337e23a5874",
        "hinge_chart_high": "2c8dce7a06dd734e",
        "thickness_chart": "99e46a59299e3eaf",
    }


def test_the_chart_goes_through_its_samples() -> None:
    chart = thickness_chart()
    found = json.loads(THICK.path.read_text())
    axes = [np.array(found[name]) for name in ("t/R", "b/t", "nu")]
    for values, name in zip(
        chart.at(*np.meshgrid(*axes, indexing="ij"))[:2], ("rotation", "axial"), strict=True
    ):
        np.testing.assert_allclose(values, found[name], atol=1e-12)
    assert chart.ends == (RATIOS, WIDTHS, POISSONS)


def test_between_its_samples_the_chart_is_what_finite_elements_are() -> None:
    """By `hinge_charts.thick_sample` with refinements 1, 2, 3, once; on other scales of t/R or b/t
    up to 10^4 off.
    """
    points = np.array(
        [
            (0.035, 30.0, 0.29),
            (0.09, 3.3, 0.29),
            (0.6, 17.0, 0.17),
            (0.9, 45.0, 0.4),
            (0.025, 48.0, 0.3),
        ]
    )
    rotation, axial = thickness_chart().at(*points.T)[:2]
    INTERPOLATED = 0.005  # of a position, 4e-4 of the compliance; seen: 0.0036
    np.testing.assert_allclose(
        rotation, [0.8230, 0.1322, 0.8443, 0.8785, 0.8742], rtol=0, atol=INTERPOLATED
    )
    np.testing.assert_allclose(
        axial, [0.1222, 0.0013, 0.3926, 0.4664, 0.1934], rtol=0, atol=INTERPOLATED
    )


@pytest.mark.parametrize("ratio", [0.07, 0.8])
def test_shear_at_the_position_of_plane_strain_is_that_of_plane_strain_finite_elements(
    ratio: float,
) -> None:
    """Plane strain is plane stress with E/(1 - nu^2) and nu/(1 - nu)."""
    stress, strain = (
        plane_sample(SingleHinge(ratio, poissons_ratio=nu), (2, 3, 4)).values[2]
        for nu in (NU, NU / (1 - NU))
    )
    exact = 1 - (1 - NU**2) * strain / stress
    found = factors(R, ratio * R, 15 * ratio * R, NU)
    CHARTS = 1e-4  # relative, of what plane strain takes away: the interpolation of the hinge chart
    assert (1 - found.shear) / (1 - found.rotation) * NU**2 == pytest.approx(exact, rel=CHARTS)


@pytest.mark.parametrize(
    ("ratio", "width", "nu"),
    [
        (0.0199, 9.0, NU),
        (1.21, 9.0, NU),
        (0.3, 0.49, NU),
        (0.3, 50.5, NU),
        (0.3, 9.0, 0.09),
        (0.3, 9.0, 0.46),
        (np.nan, 9.0, NU),
        (0.3, np.nan, NU),
    ],
)
def test_beyond_the_chart_there_is_nothing(ratio: float, width: float, nu: float) -> None:
    t = np.array([0.3, ratio]) * R
    b = np.array([9.0, width]) * t
    nus = np.array([NU, nu])
    assert thickness_chart().covers(t / R, b / t, nus).tolist() == [True, False]
    found = np.array(factors(R, t, b, nus))
    assert np.isfinite(found[:, 0]).all() and np.isnan(found[:, 1]).all()


def test_the_edge_of_the_chart_is_on_it_whatever_the_round_off() -> None:
    t = np.array(RATIOS) * R
    assert np.isfinite(
        np.array(factors(R, t, np.array(WIDTHS) * t * (1 - 1e-15), np.array(POISSONS)))
    ).all()
