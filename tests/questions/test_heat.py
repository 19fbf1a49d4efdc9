"""Change of temperature: literal numbers, both models, bands, three dimensions, refusals, figure
and command.
"""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import flexfem
from flexfem.commands import cli
from flexfem.paper.figures.drift import drift_figure, plot_drift
from flexfem.questions.bands import corner_bands, pose_bands
from flexfem.results import ANALYTIC, ELEMENTS, SOLID

from ..conftest import ROOT
from ..tolerances import DENSE

STAGE = ROOT / "geometry" / "mobility6.toml"
NECKS = {
    (1, "base"): {"neck": 0.61},
    (2, "elbow"): {"neck": 0.72},
    (3, "platform"): {"radius": 1.9},
}
OWN = flexfem.Analytic(formula="quadrature", links=True)


@pytest.fixture(scope="module")
def stage():
    """In plane stress in both models, to compare like with like."""
    return flexfem.load(STAGE).replace(model="plane_stress")


@pytest.fixture(scope="module")
def found(stage):
    return flexfem.drift(stage, resolution=6)


def test_a_symmetric_stage_turns_when_it_warms_and_drifts_with_gradients(found, stage):
    """Pose by 24 triangles across a neck: -22.5973 um per K/mm; edges by 16: 1.0277, 68.496 and
    76.678 MPa.
    """
    elements = found.at("pose", model=ELEMENTS)
    truth = [[0.0, 0.0, 5.506e-6], [-0.022597, 0.002977, 0.0], [-0.002977, -0.022597, 0.0]]
    np.testing.assert_allclose(elements, truth, rtol=2e-3, atol=1e-15)
    assert abs(elements[1, 0] + 22.5973e-3) < found.band("pose", model=ELEMENTS)[1, 0] < 1e-4
    np.testing.assert_allclose(
        found.at("pose", model=ANALYTIC)[0], [0.0, 0.0, 5.508e-6], rtol=1e-3, atol=1e-15
    )
    np.testing.assert_allclose(
        np.max(found.at("stress", model=ELEMENTS), axis=(1, 2)), [0.557, 13.58, 14.99], rtol=0.02
    )
    np.testing.assert_allclose(np.max(found.at("stress", model=ANALYTIC)[1]), 13.60, rtol=1e-3)
    highest = np.max(found.at("edges", model=ELEMENTS), axis=1)
    edge_bands = np.nanmax(found.band("edges", model=ELEMENTS), axis=1)
    for value, band, finer in zip(highest, edge_bands, (1.0277, 68.496, 76.678), strict=True):
        assert abs(value - finer) < band < 0.35 * finer
    assert found.about.hash != stage.hash and found.about.lever == 24.0
    assert found.unlike[0, 1] == pytest.approx(1.4919e-4, rel=1e-3), (
        "unlike chains move where alike ones only turn"
    )
    assert found.unlike[1, 0] == pytest.approx(-0.024212, rel=1e-3), (
        "of the three stages the one that moves furthest"
    )


def test_both_models_agree_on_unlike_chains(stage):
    found = flexfem.drift(stage.replace(override=NECKS), resolution=4)
    model, elements = (
        found.at("pose", model=one) * [1.0, 1.0, 24.0] for one in (ANALYTIC, ELEMENTS)
    )
    assert np.max(np.abs(model - elements) / np.max(np.abs(elements), axis=1, keepdims=True)) < 2e-3
    forces = found.at("reaction", model=ELEMENTS)
    for case in range(3):
        off = found.at("reaction", model=ANALYTIC)[case] - forces[case]
        assert np.max(np.abs(off)) < 0.02 * np.max(np.abs(forces[case]))
    bands = found.band("pose", model=ELEMENTS)
    np.testing.assert_allclose(bands[:, 0], 24.0 * bands[:, 2], err_msg="rotations count at l3")
    assert "unlike" not in found.values


def test_plane_strain_grows_more_in_the_plane_and_is_held_across(stage):
    """As a sheet of E/(1 - nu^2) and nu/(1 - nu) with 1 + nu times the difference; zz is E (af -
    as) where free.
    """
    nu = 0.33
    change = 11.6e-6
    strain = flexfem.drift(stage.replace(model="plane_strain"), analytic=OWN, resolution=4)
    material = {"youngs_modulus": 71.7e3 / (1 - nu**2), "poissons_ratio": nu / (1 - nu)}
    sheet = flexfem.drift(stage.replace(material=material), models="analytic", analytic=OWN)
    by_model = strain.at("pose", model=ANALYTIC)
    np.testing.assert_allclose(
        by_model, (1 + nu) * sheet.at("pose", model=ANALYTIC), rtol=1e-6, atol=1e-13
    )
    np.testing.assert_allclose(strain.at("pose", model=ELEMENTS), by_model, rtol=0.06, atol=1e-13)
    assert np.min(strain.at("stress", case="uniform")) > 0.9 * 71.7e3 * change
    same = stage.replace(model="plane_strain", frame={"expansion": 23.6e-6})
    assert np.max(np.abs(flexfem.drift(same, models="analytic", analytic=OWN).pose)) < 1e-16


def test_a_frame_that_is_not_stated_is_assumed_and_said():
    bare = flexfem.load(STAGE).replace(frame={"expansion": None})
    found = flexfem.drift(bare, models="analytic")
    assert "frame.expansion_um_per_m_k" in found.about.assumed
    assert any("frame" in text and "not stated" in text for text in found.warnings)
    assert np.max(np.abs(found.pose)) < 1e-14


@pytest.mark.parametrize("value", [-0.02, 0.02, -30.0])
def test_drift_is_linear_in_the_expansion_of_the_frame(stage, value):
    """Glass ceramics of 0 +- 0.02, and alloys that shrink."""

    def poses(expansion):
        return flexfem.drift(
            stage.replace(frame={"expansion": 1e-6 * expansion}), models="analytic"
        ).pose

    low = poses(1.0)
    high = poses(3.0)
    np.testing.assert_allclose(
        poses(value), low + (value - 1.0) / 2.0 * (high - low), rtol=DENSE, atol=1e-14
    )


def test_bands_hold_what_meshes_differ_by_and_round_off_where_symmetry_makes_zero():
    """Values 0.9, 1, 1.1 at 4, 6, 8: (8/6)^1.4 - 1 = 0.4959, and (8/4)^1.4 - (8/6)^1.4 = 1.1431."""
    steps = np.array([4.0, 6.0, 8.0])
    found = corner_bands(steps, np.array([[0.9, 0.0], [1.0, 1.0], [1.1, 1.0]]))
    np.testing.assert_allclose(found, [3 * 0.1 / 0.4959, 3 * 1.0 / 1.1431], rtol=2e-4)
    scale = np.array([1.0, 1.0, 10.0])
    fine = np.array([[3.0], [1e-12], [0.02]])
    poses = pose_bands(
        steps, fine + np.array([[1.0], [0.0], [0.0]]) * steps[:, None, None] ** -1.4, scale
    )
    assert poses[0, 0] > 8.0**-4 and poses[2, 0] == pytest.approx(poses[0, 0] / 10.0)
    assert poses[1, 0] == pytest.approx(1e-12)
    few = np.array([[1.0, 0.0], [2.0, 1e-12], [0.0, 3.0]])
    many = np.array([[1.1, 0.0], [1.7, 2e-12], [0.0, 3.2]])
    one = np.ones(3)
    layered = pose_bands(steps, np.array([many] * 3), one, (few, many)) - pose_bands(
        steps, np.array([many] * 3), one
    )
    np.testing.assert_allclose(layered[:, 0], [0.375, 0.375, 0.0])
    np.testing.assert_allclose(layered[:, 1], [0.0, 2e-12, 0.25])


@pytest.mark.slow
def test_three_dimensions_drift_as_the_plane_says_and_rise_with_a_gradient_through_the_thickness():
    """Resolution 6, three layers; on 9 triangles across a neck, one layer, x goes -0.022993 and z
    rises 0.0012457.
    """
    found = flexfem.drift(flexfem.load(STAGE), solid=True)
    pose = found.at("pose", model=SOLID)
    band = found.band("pose", model=SOLID)
    truth = [[0.0, 0.0, 5.474e-6], [-0.022996, 0.0029614, 0.0], [-0.0029614, -0.022996, 0.0]]
    np.testing.assert_allclose(pose[:3], truth, rtol=1e-3, atol=1e-15)
    assert abs(pose[1, 0] + 0.022993) < band[1, 0] < 2e-4
    assert np.all(np.isnan(found.at("unlike", case="gradient in z"))), (
        "of which the analytic model knows nothing"
    )
    tilt = found.at("tilt", model=SOLID)
    tilt_band = found.band("tilt", model=SOLID)
    np.testing.assert_allclose(tilt, [0.001226, 0.0, 0.0], rtol=2e-3, atol=1e-15)
    assert abs(tilt[0] - 0.0012457) < tilt_band[0] < 1.2e-4
    sheet = found.at("pose", model="plane stress")
    np.testing.assert_allclose(sheet[1], [-0.022614, 0.0029776, 0.0], rtol=1e-3, atol=1e-15)
    stress = np.max(found.at("stress", model=SOLID), axis=(1, 2))
    np.testing.assert_allclose(stress[[1, 3]], [13.68, 37.67], rtol=0.02)
    edges = np.max(found.at("edges", model=SOLID), axis=1)
    assert edges[1] == pytest.approx(118.9, rel=0.03), (
        "held across too: far more than the 68.5 of plane stress"
    )


@pytest.mark.slow
def test_unlike_chains_tilt_in_three_dimensions_and_fields_of_every_case_are_written(
    monkeypatch, tmp_path
):
    monkeypatch.setattr("flexfem.paper.drift.LEAST_SOLID", 4)
    unlike = flexfem.load(STAGE).replace(override=NECKS, thickness=4.0)
    found = flexfem.drift(unlike, models="elements", resolution=4, solid=True)
    tilt = found.at("tilt", model=SOLID)
    sheet = found.at("pose", model="plane stress")
    assert min(abs(tilt[1:])) * 24.0 > 1e-3 * abs(tilt[0]) > 0.0
    for solid, plane in zip(found.at("pose", model=SOLID)[:3], sheet[:3], strict=True):
        np.testing.assert_allclose(solid, plane, atol=0.03 * np.max(np.abs(plane)))
    assert b"displacement, gradient in z" in found.fields.write(tmp_path / "warm")[0].read_bytes()


def test_the_figure_has_the_numbers_of_every_case_and_says_where_it_is_warmer(found):
    figure = drift_figure(found)
    for bar, said in zip(
        figure.axes[3:],
        ("θ 5.506 µrad", "x −22.61 µm, y 2.978", "x −2.978 µm, y −22.61"),
        strict=True,
    ):
        assert said in bar.get_xlabel()
    ax = plot_drift(Figure().subplots(), found, "gradient in y")
    (arrow,) = [each for each in ax.texts if isinstance(each, Annotation)]
    np.testing.assert_allclose(np.subtract(arrow.xyann, arrow.xy), [0.0, -0.1])
    with pytest.raises(flexfem.BadInput, match="expected one of: uniform"):
        plot_drift(None, found, "warm")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--models", "analytic", "--solid"], "solid with models 'analytic'"),
        (["--solid", "--resolution", "5"], "resolution 5, expected an integer from 6"),
        (["--links", "--mobility", "6"], "links with mobility 6, expected 21 or None"),
        (["--models", "elements", "--formula", "beam"], "beam"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options, said):
    with pytest.raises(flexfem.BadInput, match=said):
        cli.app(["drift", str(STAGE), *options], standalone_mode=False)


def test_a_neck_too_thin_beside_the_others_is_refused(stage):
    with pytest.raises(
        flexfem.BadInput, match=r"hinges\.base\.neck_mm = 0\.0001: this neck is so much thinner"
    ):
        flexfem.drift(stage.replace(neck={"base": 1e-4}), models="analytic")
