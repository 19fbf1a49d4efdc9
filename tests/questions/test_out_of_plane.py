"""The first natural frequency out of the plane, and frequencies of leaves that vibrate alone."""

import numpy as np
import pytest

import flexfem
from flexfem.questions.modes import ratios_by_thickness

E = 70_000.0
DENSITY = 2700.0
FREE = 60.0
WIDTH = 4.0
THICKNESS = 3.0  # MPa, kg/m^3, mm
# relative: shear of a strip 20 times as long as thick, and its clamped end, which does not contract
CLAMPED = 0.01


def strip(thickness):
    """A straight strip of one width, whose middle is described as a hinge, clamped at its left end."""
    return flexfem.Mechanism(
        name="strip",
        thickness=thickness,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.3,
            "density": DENSITY,
            "yield_strength": 300.0,
        },
        body=[
            {"name": "base", "path": [(-10, 0), (0, 0)], "width": WIDTH, "fixed": True},
            {"name": "tip", "path": [(20, 0), (FREE, 0)], "width": WIDTH},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("base", "tip"),
                "at": (10, 0),
                "direction": 0.0,
                "shape": "leaf",
                "neck": WIDTH,
                "length": 20.0,
            }
        ],
        output={"body": "tip", "at": (50, 0)},
    )


def cantilever(height):
    """First frequency, Hz, of a clamped strip that bends over a height, mm: Euler and Bernoulli."""
    slenderness = height / 1e3 * np.sqrt(E * 1e6 / (12 * DENSITY))  # m^2/s
    return 1.875104**2 / (2 * np.pi) * slenderness / (FREE / 1e3) ** 2


@pytest.mark.parametrize("thickness", [2.0, 6.0])
def test_the_first_frequency_out_of_the_plane_is_that_of_a_strip(thickness):
    found = flexfem.modes(strip(thickness), count=1, models="elements", resolution=4)
    assert float(found.first_out_of_plane) == pytest.approx(cantilever(thickness), rel=CLAMPED)
    assert float(found.frequency[0, -1]) == pytest.approx(
        cantilever(min(WIDTH, thickness)), rel=CLAMPED
    )
    below = [
        text
        for text in found.warnings
        if "the lowest natural frequency is out of the plane" in text
    ]
    assert len(below) == (thickness < WIDTH)


def test_a_plane_model_has_no_frequency_out_of_the_plane():
    found = flexfem.modes(strip(2.0), count=1, models="elements", resolution=4, plane=True)
    assert "first_out_of_plane" not in found.values


def test_ratios_by_thickness_belong_to_the_mode_of_the_same_frequency():
    """The second mode, of a leaf alone, is not one of the network; the third is the second of the
    network.
    """
    ratios = ratios_by_thickness(
        np.array([50.0, 1050.0, 4700.0]), np.array([51.0, 4800.0]), np.array([52.02, 4944.0])
    )
    np.testing.assert_allclose(ratios, [1.02, np.nan, 1.03])


@pytest.mark.slow
def test_frequencies_by_hinges_are_those_of_the_whole_plate():
    mechanism = flexfem.load("geometry/parallelogram.toml")
    by_hinges = flexfem.modes(mechanism, count=3, models="elements")
    whole = flexfem.modes(mechanism, count=6, models="elements", solid=True, thickness_resolution=4)
    in_plane = np.isnan(whole.tilt).all(axis=1)
    names = {"model": "three dimensions"}
    value = by_hinges.at("frequency", **names)
    band = by_hinges.band("frequency", **names)
    right = whole.at("frequency", **names)[in_plane][:3]
    its_band = whole.band("frequency", **names)[in_plane][:3]
    assert np.all(np.abs(value - right) <= band + its_band)
    assert band[0] < 1e-3 * value[0]  # the guide; then leaves vibrate alone
    lifted = whole.at("frequency", **names)[~in_plane][0]
    assert abs(float(by_hinges.first_out_of_plane) - lifted) <= float(
        by_hinges.band("first_out_of_plane")
    )
