"""Hinges in three dimensions against plane stress, and mechanisms computed by them against whole
plates.
"""

from functools import cache

import numpy as np
import pytest

import flexfem
import flexfem.fem.thickness as thickness_module
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.thickness import ThickHinge, thick_hinges
from flexfem.questions.plates import elements, factorised, thickness_of

LAYERS = 2e-3  # of a compliance, by two layers more and another mesh in the plane
# of a compliance: the tension spreads into the bodies, which are thicker than a leaf is high
SPREADING = 6e-3
THIN = 3e-3  # of the effect that remains at b/t = 1/4
SAME_MESH = 6e-4  # of the change of the compliance, on another mesh of the same refinement
OTHER_MESH = 2e-3  # the same of the highest stress
ROUND_OFF = (
    1e-7  # round-off of the condensed stiffness of a hinge: its condition number is about 1e6
)


def leaf(thickness: float, ratio: float = 0.33, from_top: bool = False) -> flexfem.Mechanism:
    """A leaf of 0.4 x 16 mm with unequal bodies at its ends, turned by 25 degrees; drawn from
    either body.
    """
    turn = np.exp(1j * np.deg2rad(25))

    def at(x: float, y: float) -> tuple[float, float]:
        z = turn * complex(x, y)
        return z.real, z.imag

    return flexfem.Mechanism(
        name="leaf",
        thickness=thickness,
        material={
            "name": "any",
            "youngs_modulus": 68000.0,
            "poissons_ratio": ratio,
            "density": 2700.0,
            "yield_strength": 300.0,
        },
        body=[
            {"name": "base", "path": [at(-19, 0), at(-7, 0)], "width": 9, "fixed": True},
            {"name": "top", "path": [at(7, 0), at(14, 0), at(21, 5)], "width": 7},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("top", "base") if from_top else ("base", "top"),
                "at": (0, 0),
                "direction": np.deg2rad(205 if from_top else 25),
                "shape": "leaf",
                "neck": 0.4,
                "length": 16.0,
                "fillet": 0.3,
            }
        ],
        output={"body": "top", "at": at(12, 1)},
    )


@cache
def solved_leaf(thickness: float, ratio: float = 0.33) -> ThickHinge:
    """The leaf alone in three dimensions."""
    layout = leaf(thickness, ratio).layout
    return thick_hinges(layout, mesh_layout(layout, 4))[0]


def changes(thickness: float, ratio: float = 0.33) -> tuple[np.ndarray, np.ndarray]:
    """Changes of axial, transverse and rotational compliance, relative to plane stress, with held
    and loose ends.
    """
    found = solved_leaf(thickness, ratio)
    beam = np.diag(
        leaf(thickness, ratio).layout.joints[0].profile.compliance(68000.0, ratio, thickness)
    )
    return np.diag(found.change) / beam, np.diag(found.loose) / beam


def test_bending_of_a_wide_leaf_is_nearly_plane_strain():
    """A leaf 100 times as wide as thick, but not much wider than long, bends as 1 - nu^2 to 1 - 0.7
    nu^2.
    """
    held, loose = changes(40.0)
    assert -(0.33**2) < held[2] < -0.7 * 0.33**2
    assert -(0.33**2) < held[1] < -0.7 * 0.33**2
    assert loose[0] == pytest.approx(
        0.0, abs=SPREADING
    )  # free to contract, a leaf is in plane stress under tension
    assert -(0.33**2) < held[0] < -0.01


def test_a_hinge_that_is_drawn_from_its_other_body_is_the_turned_one():
    """Its ends are unequal, one is fixed: a force and a moment are coupled by the thickness, with
    another sign.
    """
    layout = leaf(20.0, from_top=True).layout
    one = solved_leaf(20.0)
    other = thick_hinges(layout, mesh_layout(layout, 4))[0]
    assert abs(other.change[1, 2]) > 3 * SAME_MESH * np.sqrt(
        other.change[1, 1] * other.change[2, 2]
    )
    assert other.change[1, 2] * one.change[1, 2] < 0
    sizes = np.sqrt(np.outer(np.diag(one.change), np.diag(one.change)))
    np.testing.assert_allclose(one.turned().change / sizes, other.change / sizes, atol=SAME_MESH)
    wrenches = np.array([[210.0, -3.0, 40.0], [0.0, 5.0, 31.0], [0.0, 5.0, -31.0]])
    turned = one.turned().stress_ratio(wrenches)
    np.testing.assert_allclose(turned, other.stress_ratio(wrenches), rtol=OTHER_MESH)
    np.testing.assert_allclose(turned, one.stress_ratio(wrenches * [-1, -1, 1]))


def test_equal_hinges_are_solved_once_also_where_their_ends_are_exchanged(monkeypatch):
    """Two leaves from the base to the top, one of which begins at the top, and a third that is
    thicker.
    """
    top = {"name": "top", "path": [(8, -15), (8, 25)], "width": 4}
    base = {"name": "base", "path": [(-10, -15), (-10, 25)], "width": 4, "fixed": True}
    drawn = {"shape": "leaf", "neck": 0.4, "length": 14.0, "fillet": 0.3}
    placed = [(0.0, ("base", "top"), 0.0), (12.0, ("top", "base"), np.pi)]
    hinges = [
        {"name": f"at {y:g}", "between": pair, "at": (-1, y), "direction": along} | drawn
        for y, pair, along in placed
    ]
    hinges.append(
        {"name": "thick", "between": ("base", "top"), "at": (-1, 20), "direction": 0.0} | drawn
    )
    hinges[-1]["neck"] = 0.5
    guide = leaf(5.0).replace(body=[base, top], hinge=hinges, output={"body": "top", "at": (8, 5)})
    solved = list[int]()
    any_hinge = ThickHinge(*np.random.default_rng(7).normal(size=(5, 3, 3)))

    def counted(layout, mesh, number):
        solved.append(number)
        return any_hinge

    monkeypatch.setattr(thickness_module, "_thick_hinge", counted)
    first, second, _ = thick_hinges(guide.layout, None)
    assert solved == [0, 2]
    assert second.change[1, 2] == -first.change[1, 2]
    assert second.change[0, 1] == first.change[0, 1]


def test_thin_leaves_are_in_plane_stress():
    held, loose = changes(0.1)
    np.testing.assert_allclose(held, 0.0, atol=THIN)
    np.testing.assert_allclose(loose, 0.0, atol=THIN)


def test_without_contraction_thickness_has_no_effect():
    for found in changes(10.0, ratio=0.0):
        np.testing.assert_allclose(found, 0.0, atol=ROUND_OFF)


def test_stress_ratio_is_that_of_the_wrench():
    """By bending alone, the stress in a wide leaf has xx as in plane stress and zz = nu xx: sqrt(1
    - nu + nu^2).
    """
    found = solved_leaf(40.0)
    bending = found.stress_ratio(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -7.0]]))
    np.testing.assert_allclose(bending, bending[0])
    assert (
        np.sqrt(1 - 0.33 + 0.33**2) - 0.01 < bending[0] < 1.08
    )  # 0.883; the roots at the faces have more
    assert found.stress_ratio(np.zeros(3)) == 1.0


def test_a_plane_model_has_no_effect_of_thickness():
    assert thickness_of(leaf(10.0).replace(model="plane_stress")) == ()
    assert thickness_of(leaf(10.0).replace(model="plane_strain")) == ()


@pytest.mark.slow
def test_compliance_by_hinges_is_that_of_the_whole_plate():
    """Coarse, on one mesh, with the error that the variants of the effect state."""
    mechanism = leaf(12.0)
    best, *variants = thickness_of(mechanism)
    by_hinges = elements(mechanism, 4, 0, best).compliance
    plane = elements(mechanism, 4).compliance
    whole = factorised(mechanism, 4, 5).response().compliance
    band = 1.25 * sum(
        np.abs(elements(mechanism, 4, 0, one).compliance - by_hinges) for one in variants
    )
    assert np.all(np.abs(np.diag(whole - by_hinges)) < np.diag(band))
    effect = np.diag(whole - plane) / np.diag(plane)
    assert effect[2] < -0.06  # rotation: far from plane stress
    np.testing.assert_allclose(np.diag(by_hinges)[2], np.diag(whole)[2], rtol=LAYERS)


@pytest.mark.slow
def test_stiffness_of_a_parallelogram_by_hinges_is_that_of_the_whole_plate(tmp_path):
    mechanism = leaf(25.0)
    by_hinges = flexfem.stiffness(mechanism, models="elements")
    whole = flexfem.stiffness(mechanism, models="elements", solid=True, thickness_resolution=4)
    for quantity in ("free", "held"):
        value, band = (
            part(quantity, model="three dimensions") for part in (by_hinges.at, by_hinges.band)
        )
        right, its_band = (
            part(quantity, model="three dimensions") for part in (whole.at, whole.band)
        )
        assert np.all(np.abs(value - right) <= band + its_band)
        assert np.all(band < 0.02 * value)


@pytest.mark.slow
def test_ends_of_hinges_contract_by_the_share_of_their_height():
    """The ends are 0.4 + 2 * 0.3 = 1 mm high, and the plate is twelve times as thick: 0.4 of the
    way to free ends.
    """
    best, contracting, *_ = thickness_of(leaf(12.0))
    found = solved_leaf(12.0)
    change = (best.solid.hinges - best.plane.hinges)[0]
    way = found.loose - found.change
    np.testing.assert_allclose(np.diag(change - found.change), 0.4 * np.diag(way), rtol=1e-6)
    np.testing.assert_allclose(
        np.diag((contracting.solid.hinges - best.solid.hinges)[0]), 0.3 * np.diag(way), rtol=1e-6
    )
