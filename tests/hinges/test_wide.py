"""Hinges between plane stress and plane strain: limits, exact cases, and finite elements in three
dimensions.
"""

import numpy as np
import pytest

import flexfem
from flexfem.analytic.plates import hinge_compliances as hinge_compliances_of
from flexfem.fem.plate_bodies import hinge_compliances
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.thickness import thick_hinges
from flexfem.hinges.wide import contraction, wide_factors
from flexfem.mechanism.profiles import profile_of

NU = 0.33
LEAF = {"length": 16.0, "neck": 0.4, "fillet": 0.3}
NOTCH = {"radius": 1.2, "neck": 0.4}
ROUND_OFF = 1e-8
LIMIT = 4e-4  # of the compliance, at a width of a hundredth of the neck or of a hundred lengths
SHEAR = (
    2e-3  # of the transverse compliance of a leaf of 40 times its height: its shear does not change
)
BENDING = 3e-3  # of the rotational compliance: the model, against the three-dimensional hinge
TRANSVERSE = 2.5e-3  # of the transverse compliance of a leaf of 40 times its height, the same
OF_THE_TABLE = 0.03  # of the compliance, %, by another mesh
DRAWN = [
    ("leaf", LEAF),
    ("leaf", {"length": 16.0, "neck": 0.4}),
    ("circular", NOTCH),
    ("elliptical", {"length": 8.0, "depth": 2.0, "neck": 0.4}),
    ("v", {"angle": 1.0, "root_radius": 0.1, "depth": 2.0, "neck": 0.4}),
    ("profile", {"table": [(0.0, 3.0), (1.0, 0.4), (5.0, 0.4), (6.0, 0.5), (9.0, 3.0)]}),
]
# Changes of rotational and transverse compliance, %, of three-dimensional hinges between a rigid
# body and a wide one,
# by finite elements with four layers in half the thickness: see
# `test_the_table_is_that_of_three_dimensional_elements`.
IN_THREE_DIMENSIONS = [
    ("leaf", LEAF, 2.0, -0.159, -0.470),
    ("leaf", LEAF, 10.0, -1.959, -4.659),
    ("leaf", LEAF, 40.0, -7.342, -9.382),
    ("leaf", LEAF | {"length": 4.0}, 10.0, -6.819, None),
    ("circular", NOTCH, 2.0, -1.235, None),
    ("circular", NOTCH, 10.0, -8.614, None),
    ("circular", NOTCH, 40.0, -10.529, None),
    ("circular", {"radius": 4.0, "neck": 0.4}, 10.0, -6.929, None),
    ("elliptical", {"length": 8.0, "depth": 2.0, "neck": 0.4}, 10.0, -5.977, None),
]


@pytest.mark.parametrize(("shape", "drawn"), DRAWN)
def test_limits_are_plane_stress_and_plane_strain(shape, drawn):
    profile = profile_of(shape, drawn)
    np.testing.assert_allclose(wide_factors(profile, NU, 0.004), 1.0, atol=LIMIT)
    axial, transverse, rotation = wide_factors(profile, NU, 100 * profile.length)
    assert rotation == pytest.approx(1 - NU**2, abs=LIMIT)
    assert 1 - NU**2 - LIMIT < transverse < 1.0
    assert 1 - NU**2 - LIMIT < axial < 1.0
    np.testing.assert_allclose(wide_factors(profile, 0.0, 7.0), 1.0, atol=ROUND_OFF)


def test_a_wide_leaf_is_a_plate_that_bends_to_a_cylinder():
    axial, transverse, rotation = wide_factors(
        profile_of("leaf", {"length": 16.0, "neck": 0.4}), NU, 4000.0
    )
    assert rotation == pytest.approx(0.8911, abs=LIMIT)
    assert transverse == pytest.approx(0.8911, abs=SHEAR)
    assert axial == pytest.approx(1 - 0.1089 * (1 - 0.8 / (1 + 10000 / 12)), abs=LIMIT)


def test_the_constraint_grows_with_the_thickness():
    for shape, drawn in DRAWN:
        profile = profile_of(shape, drawn)
        found = np.array([wide_factors(profile, NU, b) for b in (0.2, 0.8, 3.2, 12.8, 51.2)])
        assert np.all(np.diff(found, axis=0) < ROUND_OFF)


def test_ends_of_thick_plates_keep_their_thickness():
    """Half of the contraction of a thin plate where it is twelve times as thick as the ends are
    high.
    """
    np.testing.assert_allclose(contraction([0.0, 12.0, 36.0]), [0.8, 0.4, 0.2])


@pytest.mark.parametrize(("shape", "drawn", "wide", "rotation", "transverse"), IN_THREE_DIMENSIONS)
def test_bending_is_that_of_three_dimensional_hinges(shape, drawn, wide, rotation, transverse):
    found = wide_factors(profile_of(shape, drawn), NU, wide * drawn["neck"])
    assert found[2] == pytest.approx(1 + rotation / 100, abs=BENDING)
    if transverse is not None:
        assert found[1] == pytest.approx(1 + transverse / 100, abs=TRANSVERSE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "drawn", "wide", "rotation", "transverse"), IN_THREE_DIMENSIONS[1:6:2]
)
def test_the_table_is_that_of_three_dimensional_elements(shape, drawn, wide, rotation, transverse):
    layout = bar_on("three_dimensional", shape, drawn, wide * drawn["neck"]).layout
    mesh = mesh_layout(layout, 4)
    effect = (
        100
        * np.diag(thick_hinges(layout, mesh)[0].change)
        / np.diag(hinge_compliances(layout, mesh)[0])
    )
    assert effect[2] == pytest.approx(rotation, abs=OF_THE_TABLE)
    if transverse is not None:
        assert effect[1] == pytest.approx(transverse, abs=OF_THE_TABLE)


def bar_on(model: str, shape: str, drawn: dict, thickness: float) -> flexfem.Mechanism:
    """A bar on one hinge, which ends a leaf or is cut from the middle of the bar."""
    end = drawn["length"] / 2 if shape == "leaf" else 0.0
    return flexfem.Mechanism(
        name="bar on a hinge",
        thickness=thickness,
        model=model,
        material={
            "name": "any",
            "youngs_modulus": 68000.0,
            "poissons_ratio": NU,
            "density": 2700.0,
            "yield_strength": 300.0,
        },
        body=[
            {"name": "base", "path": [(-30, 0), (-end, 0)], "width": 9, "fixed": True},
            {"name": "top", "path": [(end, 0), (30, 0)], "width": 9},
        ],
        hinge=[
            {
                "name": "hinge",
                "between": ("base", "top"),
                "at": (0, 0),
                "direction": 0.0,
                "shape": shape,
            }
            | drawn
        ],
        output={"body": "top", "at": (20, 0)},
    )


def test_the_network_has_the_thickness_by_default_and_plane_models_have_none():
    solid, sheet, strain = (
        hinge_compliances_of(bar_on(model, "leaf", LEAF, 8.0).layout)[0]
        for model in ("three_dimensional", "plane_stress", "plane_strain")
    )
    beam = profile_of("leaf", LEAF).compliance(68000.0, NU, 8.0)
    np.testing.assert_allclose(sheet, beam, rtol=ROUND_OFF, atol=1e-15)
    np.testing.assert_allclose(
        np.diag(solid) / np.diag(sheet), wide_factors(profile_of("leaf", LEAF), NU, 8.0)
    )
    assert np.all(np.diag(strain) < np.diag(solid))
    assert np.all(np.diag(solid) < np.diag(sheet))
