"""Stiffness and displacement out of the plane: a leaf as a beam that bends and twists."""

import numpy as np
import pytest

import flexfem
from flexfem.questions import plates

E = 70_000.0
NU = 0.29  # MPa
NECK = 1.0
WIDTH = 4.0
LENGTH = 60.0  # mm, of a leaf; the width is the thickness of the plate
LONGER = 80.0  # mm: the difference of two leaves is free of what their ends add
# By hand, with E I = 70000 * 1 * 4^3 / 12 = 373333 N mm^2, G = 27132 MPa, J = 4 / 3 * (1 - 0.63 /
# 4) = 1.1235 mm^4
ALONG_Z = 5.1674  # N/mm: 1 / (L^3 / (3 E I) + 1.2 L / (G A)), L = 60 mm
TILT = 5.3571e-5  # rad/(N mm): 20 mm / (E I)
TWIST = 6.561e-4  # rad/(N mm): 20 mm / (G J)
BEAM = 5e-3  # relative: the mesh, and the end of the leaf in an elastic body
MESH = 2e-3  # relative, of differences


def leaf(length=LENGTH):
    return flexfem.Mechanism(
        name="leaf",
        thickness=WIDTH,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": NU,
            "density": 2700.0,
            "yield_strength": 400.0,
        },
        body=[
            {"name": "base", "path": [(-12, 0), (0, 0)], "width": 11, "fixed": True},
            {"name": "tip", "path": [(length, 0), (length + 12, 0)], "width": 10},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("base", "tip"),
                "at": (length / 2, 0),
                "direction": 0.0,
                "shape": "leaf",
                "neck": NECK,
                "length": length,
            }
        ],
        output={"body": "tip", "at": (length, 0)},
    )


def test_a_leaf_bends_and_twists_out_of_the_plane_as_a_beam():
    short, long = (plates.lifted(leaf(length)).compliance for length in (LENGTH, LONGER))
    assert 1 / short[0, 0] == pytest.approx(ALONG_Z, rel=BEAM)
    assert long[1, 1] - short[1, 1] == pytest.approx(TWIST, rel=BEAM)
    assert long[2, 2] - short[2, 2] == pytest.approx(TILT, rel=MESH)
    # a moment about y lowers the tip by M L^2 / (2 E I): from 60 to 80 mm by 3.7500e-3 mm per N mm
    assert long[0, 2] - short[0, 2] == pytest.approx(
        -3.75e-3, rel=0.03
    )  # with 0.4 mm of each end, 20 mm apart


@pytest.mark.slow
def test_stiffness_and_displacement_out_of_the_plane_follow_from_the_compliance():
    found = flexfem.stiffness(
        leaf(), models="elements", resolution=4, force_out_of_plane=(0.2, 3.0, 5.0)
    )
    C = plates.lifted(leaf()).compliance
    np.testing.assert_allclose(
        found.lifted_free, [1 / C[0, 0], 1 / C[1, 1], 1 / C[2, 2]], rtol=1e-6
    )
    alone = 1 / (C[0, 0] - C[0, 2] ** 2 / C[2, 2])  # tilt about y held; the twist is not coupled
    assert found.lifted_held[0] == pytest.approx(alone, rel=1e-6)
    tip = 0.2 * C[0, 0] + 5.0 * C[0, 2]
    assert found.at("lifted_pose", **{"out of plane": "z"}) == pytest.approx(tip, rel=1e-6)
    assert np.all(found.bands["lifted_held"] < 0.05 * found.lifted_held)


@pytest.mark.slow
def test_the_summary_has_the_stiffness_out_of_the_plane():
    found = flexfem.summary(leaf(), models="elements", resolution=4)
    assert found.at("lifted_free", **{"out of plane": "z"}) == pytest.approx(ALONG_Z, rel=BEAM)


@pytest.mark.parametrize("options", [{"plane": True}, {"models": "analytic"}])
def test_a_plane_model_has_no_stiffness_out_of_the_plane(options):
    with pytest.raises(
        flexfem.BadInput, match="out_of_plane, expected finite elements in three dimensions"
    ):
        flexfem.stiffness(leaf(), out_of_plane=True, **options)
