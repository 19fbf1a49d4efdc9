"""What `flexfem drift` answers: literal numbers, both models, bands, planes, refusals."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.fem.heat import largest_within
from flexfem.verify.corners import corner_bands, pose_bands
from flexfem.verify.drift import CASES

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
NECKS = {(1, "base"): {"neck": 0.61}, (2, "elbow"): {"neck": 0.72}, (3, "platform"): {"radius": 1.9}}


@pytest.fixture(scope="module")
def stage():
    """In plane stress in both models, to compare like with like."""
    return flexfem.load(STAGE).replace(model="plane_stress")


def poses(found, by="analytic"):
    """Pose by case (3, 3 cases)."""
    return np.array([getattr(found.cases[name], by).pose for name in CASES]).T


def test_a_symmetric_stage_turns_when_it_warms_and_drifts_with_gradients(stage):
    found = flexfem.drift(stage, resolution=4)
    uniform, x, y = (found.cases[name] for name in CASES)
    assert uniform.elements.pose == pytest.approx([0.0, 0.0, 5.506e-6], rel=1e-3, abs=1e-15)
    assert uniform.analytic.pose == pytest.approx([0.0, 0.0, 5.508e-6], rel=1e-3, abs=1e-15)
    assert x.elements.pose == pytest.approx([-0.02261, 0.002978, 0.0], rel=2e-3, abs=1e-15)
    assert y.elements.pose == pytest.approx([-0.002978, -0.02261, 0.0], rel=2e-3, abs=1e-15)
    assert np.max(uniform.elements.stress) == pytest.approx(0.557, rel=0.02)
    assert np.max(x.elements.stress) == pytest.approx(13.58, rel=0.02)
    assert np.max(x.analytic.stress) == pytest.approx(13.60, rel=1e-3)
    assert abs(x.elements.pose[0] + 0.0226097) < 3 * x.band[0] < 6e-4
    assert found.hash != stage.hash and found.lever == 24.0
    assert uniform.unlike[1] == pytest.approx(1.4919e-4, rel=1e-3), "chains unlike move where alike ones only turn"
    assert x.unlike[0] == pytest.approx(-0.024212, rel=1e-3), "of the family that which moves furthest"


def test_clamped_edges_carry_more_than_the_necks_and_are_said_without_their_corners(stage):
    """On 16 triangles across a neck a fifth of the edge beside the corner has 1.028, 68.5 and 76.7 MPa."""
    found = flexfem.drift(stage, resolution=6)
    for name, finer in zip(CASES, (1.0277, 68.496, 76.678), strict=True):
        of = found.cases[name]
        assert abs(max(of.elements.edges) - finer) < of.edge_band < 0.35 * finer
        assert max(of.elements.edges) > 1.8 * np.max(of.elements.stress) and of.analytic.edges is None
    np.testing.assert_allclose(found.cases["uniform"].elements.edges, max(found.cases["uniform"].elements.edges), 1e-6)


def test_the_largest_within_a_part_of_an_edge_is_taken_between_its_nodes():
    """Nodes in any order; at 0.2 of 0 to 1 the line from 9 at 0 to 4 at 0.5 has 7, that of the other column 3."""
    places, values = np.array([0.5, 1.0, 0.0]), np.array([[4.0, 5.0], [5.0, -90.0], [9.0, 5.0 / 3]])
    np.testing.assert_allclose(largest_within(places, values, 0.2, 0.8), [7.0, 5.0])


def test_both_models_agree_on_unlike_chains(stage):
    other = stage.replace(override=NECKS)
    found = flexfem.drift(other, resolution=4)
    metal = poses(found, "elements") * np.array([[1.0], [1.0], [24.0]])
    model = poses(found) * np.array([[1.0], [1.0], [24.0]])
    assert np.max(np.abs(model - metal) / np.max(np.abs(metal), axis=0)) < 2e-3, "1.1 % without edges that bow"
    for name in CASES:
        one = found.cases[name]
        assert np.array(one.analytic.reaction) == pytest.approx(
            np.array(one.elements.reaction), abs=0.02 * np.max(np.abs(one.elements.reaction))
        )
        assert one.unlike is None
        assert one.band[0] == one.band[1] == pytest.approx(24.0 * one.band[2]), "rotations count at l3"


def test_plane_strain_grows_more_in_the_plane_and_is_held_across(stage):
    """As a sheet of E/(1 - nu^2) and nu/(1 - nu) with 1 + nu times the difference; zz is E (af - as) where free."""
    nu, change = 0.33, 11.6e-6
    strain = flexfem.drift(stage.replace(model="plane_strain"), formula="quadrature", links=True, resolution=4)
    metal = {"youngs_modulus": 71.7e3 / (1 - nu**2), "poissons_ratio": nu / (1 - nu)}
    sheet = flexfem.drift(stage.replace(material=metal), formula="quadrature", links=True, resolution=None)
    assert poses(strain) == pytest.approx((1 + nu) * poses(sheet), rel=1e-6, abs=1e-13)
    assert poses(strain, "elements") == pytest.approx(poses(strain), rel=0.06, abs=1e-13)
    across = 71.7e3 * change
    least = min(np.min(strain.cases["uniform"].elements.stress), np.min(strain.cases["uniform"].analytic.stress))
    assert least > 0.9 * across
    x = strain.cases["gradient in x"]  # the model takes the neck's centre, the metal all of its notch
    assert np.max(x.elements.stress) == pytest.approx(np.max(x.analytic.stress), rel=0.1), "across by the temperature"
    same = stage.replace(model="plane_strain", frame={"expansion": 23.6e-6})
    assert np.max(np.abs(poses(flexfem.drift(same, formula="quadrature", resolution=None)))) < 1e-16


def test_a_frame_that_is_not_stated_is_assumed_and_said(stage):
    content = STAGE.read_text().replace("\n[frame]", "\n[xframe]")
    lines = [line for line in content.splitlines() if "xframe" not in line and '"frame.' not in line]
    bare = flexfem.load(STAGE).replace(frame={"expansion": None})
    assert "expansion_um_per_m_k = 12.0" in lines, "the file says it"
    found = flexfem.drift(bare, resolution=None)
    assert "frame.expansion_um_per_m_k" in found.assumed
    assert any("frame" in text and "not stated" in text for text in found.warnings)
    assert found.frame_expansion == found.expansion == pytest.approx(23.6e-6)
    assert np.max(np.abs(poses(found))) < 1e-14


def test_hashes_and_doubts_of_other_answers_do_not_follow_expansion(stage):
    warm = stage.replace(material={"expansion": 20e-6}, frame={"expansion": 1e-6})
    assert warm.hash == stage.hash == "24fed7d518c264d8" + stage.hash[16:] and warm.heat_hash != stage.heat_hash
    assert not any("expansion" in key for key in (*stage.assumed, *stage.numbers, *stage.not_stated))
    sources = flexfem.drift(warm, resolution=None).sources
    assert set(sources.values()) == {"replaced in Python"}


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("23.6e-6", "unit mistake"),
        ("2.36e-3", "unit mistake"),
        ("2360.0", "expected <= 300"),
        ("-1.0", "expected >= 0"),
        ("nan", "expected a finite number"),
    ],
)
def test_expansion_in_another_unit_is_refused_in_one_line(value, said, tmp_path):
    path = tmp_path / "stage.toml"
    path.write_text(STAGE.read_text().replace("expansion_um_per_m_k = 23.6 ", f"expansion_um_per_m_k = {value} "))
    with pytest.raises(flexfem.BadInput, match=rf"line 13: material.expansion_um_per_m_k = .*{said}") as refused:
        flexfem.load(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("value", [-0.02, 0.0, 0.02, 0.007, -30.0])
def test_a_frame_may_shrink_or_hardly_expand(value):
    """Glass ceramics of 0 +- 0.02, and alloys that shrink: drift is linear in the frame's coefficient."""
    stage = flexfem.load(STAGE)

    def drift(expansion):
        frame = {"expansion_um_per_m_k": expansion}
        warm = type(stage).model_validate(tomllib.loads(STAGE.read_text()) | {"frame": frame})
        return np.array([case.analytic.pose for case in flexfem.drift(warm, resolution=None).cases.values()])

    low, high = drift(1.0), drift(3.0)
    np.testing.assert_allclose(drift(value), low + (value - 1.0) / 2.0 * (high - low), rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize(
    ("value", "said"), [("12e-6", "unit mistake"), ("-2e-8", "unit mistake"), ("-51.0", "expected >= -50")]
)
def test_a_frame_of_an_impossible_expansion_is_refused(value, said, tmp_path):
    path = tmp_path / "stage.toml"
    path.write_text(STAGE.read_text().replace("expansion_um_per_m_k = 12.0", f"expansion_um_per_m_k = {value}"))
    with pytest.raises(flexfem.BadInput, match=rf"frame.expansion_um_per_m_k = .*{said}"):
        flexfem.load(path)


def test_a_stage_without_expansion_is_refused_and_its_name_may_bring_it(stage):
    bare = stage.replace(material={"name": "own", "expansion": None})
    with pytest.raises(flexfem.BadInput, match=r"material.expansion_um_per_m_k is missing"):
        flexfem.drift(bare)
    named = stage.replace(material="ti-6al-4v")
    assert flexfem.drift(named, resolution=None).expansion == pytest.approx(8.6e-6, rel=1e-12)
    known = {name: one.expansion for name, one in flexfem.materials().items() if one.expansion is not None}
    expected = {"al-7075-t6": 23.6e-6, "al-6061-t6": 23.6e-6, "ti-6al-4v": 8.6e-6, "al-2024-t4": 22.9e-6}
    expected |= {"ti-6al-4v-sta": 8.6e-6, "steel-4340": 12.3e-6, "steel-304": 17.2e-6, "invar-36": 1.6e-6}
    assert known == pytest.approx(expected), "301 has none with a source"


def test_bands_hold_what_meshes_differ_by_and_round_off_where_symmetry_makes_zero():
    steps = np.array([4.0, 6.0, 8.0])
    fine = np.array([[3.0], [1e-12], [0.02]])
    found = pose_bands(steps, fine + np.array([[1.0], [0.0], [0.0]]) * steps[:, None, None] ** -1.4, 10.0)
    assert found[0, 0] > 8.0**-4 and found[2, 0] == pytest.approx(found[0, 0] / 10.0)
    assert found[1, 0] == pytest.approx(1e-12)


def test_a_band_by_corners_is_the_larger_error_of_two_differences_times_three():
    """Values 0.9, 1, 1.1 at 4, 6, 8: (8/6)^1.4 - 1 = 0.4959, and (8/4)^1.4 - (8/6)^1.4 = 1.1431."""
    found = corner_bands(np.array([4.0, 6.0, 8.0]), np.array([[0.9, 0.0], [1.0, 1.0], [1.1, 1.0]]))
    np.testing.assert_allclose(found, [3 * 0.1 / 0.4959, 3 * 1.0 / 1.1431], rtol=2e-4)


@pytest.mark.usefixtures("unrendered")
def test_the_command_prints_and_keeps_what_the_function_gives(stage, tmp_path, capsys):
    from flexfem.commands import cli

    assert cli.app(["drift", str(STAGE), "--analytic", "--json", "-o", str(tmp_path)], standalone_mode=False) in (
        0,
        None,
    )
    printed = json.loads(capsys.readouterr().out)
    assert printed["cases"] == flexfem.drift(flexfem.load(STAGE), resolution=None).model_dump(mode="json")["cases"]
    assert printed["cases"] != flexfem.drift(stage, resolution=None).model_dump(mode="json")["cases"]
    assert json.loads((tmp_path / "mobility6-drift.json").read_text())["cases"] == printed["cases"]
    cli.app(["drift", str(STAGE), "--analytic"], standalone_mode=False)
    said = capsys.readouterr().out
    assert "expansion 23.6 um/(m K), frame 12 um/(m K)" in said and "5.499 urad" in said and "-22.6 um" in said
    assert "stacks, their preloads and their own expansion are left out" in said


def test_bands_hold_what_finer_meshes_say():
    cases = flexfem.drift(flexfem.load(STAGE), resolution=6).cases  # 24 triangles across a neck: -22.5973 um per K/mm
    found = cases["gradient in x"]
    assert 1e-5 < abs(found.elements.pose[0] + 22.5973e-3) < found.band[0] < 1e-4
