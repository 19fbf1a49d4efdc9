"""A stage under its own weight: both models, reciprocity, three dimensions, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.results import ANALYTIC, ELEMENTS, SOLID

from ..conftest import ROOT
from ..tolerances import DENSE

STAGE = ROOT / "geometry" / "mobility6.toml"
NECKS = {
    (1, "base"): {"neck": 0.61},
    (2, "elbow"): {"neck": 0.72},
    (3, "platform"): {"radius": 1.9},
}
G = 9.80665  # m/s^2


@pytest.fixture(scope="module")
def unlike():
    """Unlike chains, in plane stress in both models."""
    return flexfem.load(STAGE).replace(override=NECKS, model="plane_stress")


def test_both_models_agree_on_unlike_chains_and_gravity_turns_with_its_angle(unlike):
    down = flexfem.gravity(unlike, payload=0.2, resolution=4)
    scale = np.array([1.0, 1.0, 24.0])
    model, elements = (down.at("pose", model=one) * scale for one in (ANALYTIC, ELEMENTS))
    assert np.max(np.abs(model - elements)) < 2e-3 * np.max(np.abs(elements))
    stress = down.at("stress", model=ANALYTIC), down.at("stress", model=ELEMENTS)
    np.testing.assert_allclose(stress[0], stress[1], atol=0.03 * np.max(stress[1]))
    side = flexfem.gravity(unlike, payload=0.2, angle=0.0, models="analytic").pose[0]
    slope = flexfem.gravity(unlike, payload=0.2, angle=-30.0, models="analytic").pose[0]
    c = np.cos(np.deg2rad(30))
    s = np.sin(np.deg2rad(30))
    np.testing.assert_allclose(
        slope, c * side + s * down.at("pose", model=ANALYTIC), rtol=DENSE, atol=1e-12
    )


def test_a_heavy_payload_hangs_on_the_compliance_of_the_platform(unlike):
    """500 kg: m g times the compliance, beside which the stage of 0.09 kg weighs nothing."""
    heavy, light = (
        flexfem.gravity(unlike, payload=mass, models="analytic").pose[0] for mass in (500.0, 0.0)
    )
    C = flexfem.analyse(unlike).compliance
    np.testing.assert_allclose(heavy - light, C @ [0.0, -500.0 * G, 0.0], rtol=DENSE, atol=1e-9)
    assert 0 < -light[1] < 1e-3 * -heavy[1]


def test_the_links_weigh_on_the_platform_by_their_share(unlike):
    """By reciprocity: the work of the weights on the field of a unit load in y is the pose in y
    under the weights.
    """
    solved = flexfem.solve(unlike, 4)
    field = solved.displacement([0.0, 1.0, 0.0])
    corners = solved.mesh.nodes[solved.mesh.triangles[:, :3]]
    first = corners[:, 1] - corners[:, 0]
    second = corners[:, 2] - corners[:, 0]
    areas = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    middle = field[solved.mesh.triangles[:, 3:], 1].mean(
        axis=1
    )  # exact for quadratic fields on straight triangles
    weight = 2810e-12 * 10.0 * 1e3 * G
    hub = np.pi * 8.0**2 * solved.compliance[1, 1]
    expected = -weight * (np.sum(areas * middle) + hub)
    found = flexfem.gravity(unlike, models="elements", resolution=4)
    assert found.pose[0, 1] == pytest.approx(expected, rel=5e-3)


@pytest.mark.slow
def test_a_horizontal_plate_sags_and_its_band_holds_a_finer_mesh():
    stage = flexfem.load(STAGE)
    coarse = flexfem.gravity(stage, payload=0.1, resolution=4, solid=True)
    fine = flexfem.gravity(stage, payload=0.1, resolution=6, solid=True, thickness_resolution=4)
    sag = coarse.at("sag", model=SOLID)[0]
    band = coarse.band("sag", model=SOLID)[0]
    assert sag < 0 and abs(sag - fine.at("sag", model=SOLID)[0]) < band < 0.05 * abs(sag)
    np.testing.assert_allclose(coarse.at("sag", model=SOLID)[1:] * 24.0, 0.0, atol=1e-6 * abs(sag))
    first = 2 * np.pi * 693.03  # rad/s, the first mode out of the plane without a payload
    bare = flexfem.gravity(stage, resolution=4, solid=True).at("sag", model=SOLID)[0]
    assert abs(bare) == pytest.approx(1e3 * G / first**2, rel=0.25), (
        "g over the squared frequency, nearly"
    )
