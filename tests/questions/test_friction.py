"""The band that friction leaves of a pose: by hand, by all corners of the box, by its zeros, and by
both witnesses.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flexfem
from flexfem.paper.commanding import commanding, driven_elements, half_widths_by_friction
from flexfem.paper.drives import drive_of
from flexfem.paper.equations import stiffness
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice, assemble
from flexfem.paper.responses import driven_model
from flexfem.paper.stage import load_stage
from flexfem.questions.driven import DriveSystem
from flexfem.refused import BadInput

from ..conftest import ROOT
from ..tolerances import DENSE

GEOMETRY = ROOT / "geometry"
POSE = (2e-3, -1e-3, 5e-5)
LOAD = (1.5, -0.8, 30.0)
MODEL = (6, DEFAULT_FORMULA, False)


def rough(stage, *changes):
    """The stage with its actuators changed, contacts by stiffness, so that preloads do not change
    them.
    """
    bare = [one.model_dump(exclude_unset=True) | {"ball_radius": None} for one in stage.actuator]
    return stage.replace(
        actuator=[one | change for one, change in zip(bare, changes, strict=False)]
    )


def at_rest(stage, *model, stiff=1.0):
    drive = drive_of(stage)
    drive = drive._replace(stiffness=stiff * drive.stiffness)
    one = commanding(ModelChoice(stage, *model))
    return half_widths_by_friction(DriveSystem.of(one.system.C, drive), one.across, drive.preload)


def test_forces_along_link_1_turn_its_hinge_by_half_its_width_by_hand():
    """Mobility three, base pairs alone, stacks of no stiffness: 2 x 0.3 x 40 N, 4.5 mm off the
    middle.
    """
    stage = rough(load_stage(GEOMETRY / "mobility3.toml"), {"friction": 0.3, "preload": 40.0})
    of = assemble(stage, 3)
    at = stiffness(of)
    per_couple = at.influence.G_u @ at.C_aa
    expected = 2 * 0.3 * 40.0 * 4.5 * np.sum(np.abs(per_couple), axis=1)
    np.testing.assert_allclose(
        at_rest(stage, 3, DEFAULT_FORMULA, False, stiff=0.0), expected, rtol=DENSE
    )


def test_no_band_where_the_face_of_a_contact_leads_through_the_hinge():
    """The push is tilted until its face meets the hinge: 10 mm along the link, 4.5 mm beside its
    middle.
    """
    for tilt, none in ((np.arctan(0.45), True), (-np.arctan(0.45), False), (0.0, False)):
        alone = {"friction": 0.3, "pair": False, "tilt": tilt}
        stage = rough(load_stage(GEOMETRY / "mobility3.toml"), alone)
        found = at_rest(stage, 3, DEFAULT_FORMULA, False, stiff=0.0)
        assert none == (np.max(np.array(found) * [1, 1, 24.0]) < 1e-12), tilt


def test_no_friction_within_its_limits_moves_the_platform_further_and_some_does_as_far(stage):
    """All corners of the box, with single stacks and a load: forces are those of the command, not
    the preloads.
    """
    single = [
        {"pair": False, "friction": 0.25, "preload": 30.0},
        {"pair": False, "friction": 0.15, "preload": 12.0},
    ]
    stage = rough(stage, *single)
    drive = drive_of(stage)
    one = commanding(ModelChoice(stage, *MODEL))
    answer = flexfem.drive(
        stage, pose=POSE, load=LOAD, models="analytic", analytic=flexfem.Analytic(mobility=6)
    )
    force = np.maximum(answer.at("force", criterion="least energy"), 0.0)
    assert np.max(np.abs(force - drive.preload)) > 1.0
    C = driven_model(
        stage, one.result, (*drive.stacks, *(each.across for each in drive.stacks))
    ).compliance
    corners = np.array(list(product([-1, 1], repeat=6))) * drive.friction * force
    poses = corners @ np.array([held_pose(C, drive, k) for k in range(6)])
    np.testing.assert_allclose(np.max(poses, axis=0), answer.friction[0, 0], rtol=DENSE)


def held_pose(C, drive, k):
    """Pose by a newton along contact k: springs of the stacks and forces as one linear system of
    all ends.
    """
    n = len(drive.stacks)
    given = np.zeros(2 * n)
    given[n + k] = 1.0
    opened = np.linalg.solve(
        np.eye(n) + C[3 : 3 + n, 3 : 3 + n] * drive.stiffness, C[3 : 3 + n, 3:] @ given
    )
    return C[:3, 3:] @ given - C[:3, 3 : 3 + n] @ (drive.stiffness * opened)


def test_bands_by_both_witnesses(stage):
    """Elastic links and calibrated hinges: within 0.5 per cent of a coarse mesh."""
    stage = rough(stage, {"friction": 0.1, "pair": False}, {"friction": 0.3, "arm": 7.0})
    drive = drive_of(stage)
    metal = driven_elements(stage, 3)
    assert metal.across.shape == (3 + 9, 9)
    elements = half_widths_by_friction(metal.system, metal.across, drive.preload)
    np.testing.assert_allclose(at_rest(stage, None, CALIBRATED, True), elements, rtol=6e-3)


def test_a_contact_that_would_have_to_pull_holds_nothing(stage):
    stage = rough(stage, {"friction": 0.2, "pair": False, "preload": 1.0})
    one = commanding(ModelChoice(stage, *MODEL))
    pulled = half_widths_by_friction(one.system, one.across, np.array([2.0, -3.0, -1.0]))
    only = half_widths_by_friction(one.system, one.across, np.array([2.0, 0.0, 0.0]))
    np.testing.assert_array_equal(pulled, only)
    assert min(only) > 0


def test_a_stated_friction_is_part_of_the_hash_of_the_drive_and_none_is_not(stage):
    hashes = {
        rough(stage, *2 * [change]).drive_hash
        for change in ({}, {"friction": 0.2}, {"friction": 0.3})
    }
    assert len(hashes) == 3
    assert rough(stage, *2 * [{"friction": 0.2}]).hash == stage.hash


@pytest.mark.parametrize("value", ["-0.1", "2.5", "nan", '"much"'])
def test_a_friction_out_of_range_is_refused(project, value):
    path = project.edit(
        "geometry/mobility6.toml", ("preload_n = 50.0", f"preload_n = 50.0\nfriction = {value}")
    )
    with pytest.raises(BadInput, match="friction"):
        load_stage(path)


def test_a_contact_of_one_chain_may_be_rougher(project):
    rougher = '[[override]]\nchain = 2\nactuator = "elbow"\nfriction = 0.4\n\n[provenance]'
    stage = load_stage(project.edit("geometry/mobility6.toml", ("[provenance]", rougher)))
    np.testing.assert_array_equal(
        drive_of(stage).friction, [np.nan] * 6 + [0.4, 0.4] + [np.nan] * 4
    )
    assert drive_of(stage).rubbing == (6, 7)
