"""Strokes, forces and poses: known answers of springs, energy, (29), and the two witnesses of
driven stages.
"""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.commanding import calibration, commanding, driven_elements
from flexfem.paper.contacts import Push, Stack
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.equations import inverse_kinematics, stiffness
from flexfem.paper.fields import neck_wrenches
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice, assemble
from flexfem.paper.reach import pose_set
from flexfem.paper.stage import Stage, load_stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions.driven import CRITERIA, DriveSystem
from flexfem.refused import ComputationFailed

from ..conftest import ROOT
from ..tolerances import DENSE
from .half_spaces import half_spaces

GEOMETRY = ROOT / "geometry"
LOAD = np.array([3.1, -1.7, 41.0])
POSE = np.array([2.3e-3, -1.1e-3, 7.0e-5])
LEVER = 24.0
NONE = np.zeros(3)
# four triangles across a neck and the beams of the links: 0.2 % seen, of C as of stiffness alone
MESH = 4e-3


def spring(
    stiffness: float, stack: float, stroke: float = 0.0174
) -> tuple[np.ndarray, ActuatorSet]:
    """The platform on one spring in x, pushed by one stack; y and theta go along with no one."""
    nowhere = Stack(0, (Push(3, np.array([1.0, 0, 0]), None), Push(0, np.zeros(3), None)))
    C = np.diag([1 / stiffness, 1.0, 1.0, 1 / stiffness])
    C[0, 3] = C[3, 0] = 1 / stiffness
    one = np.ones(1)
    return C, ActuatorSet(
        (nowhere,), ("one",), stack * one, 0 * one, 935.0 * one, np.eye(1), 0 * one, stroke * one
    )


def model(stage: Stage, mobility: int | None = None, formula: str = CALIBRATED, links: bool = True):
    return commanding(ModelChoice(stage, mobility, formula, links))


def test_ae0505d16_on_14_3_newtons_per_micrometre_travels_13_74_micrometres():
    """NEC/Tokin, Multilayer Piezoelectric Actuators vol. 6, page 22: the spring load of their
    example.
    """
    C, drive = spring(14.3e3, 935 / 0.0174)
    found = DriveSystem.of(C, drive).moved(drive.highest, np.zeros(3))
    assert 1e3 * found.pose[0] == pytest.approx(13.74, abs=0.005)
    assert found.force[0] == pytest.approx(14.3e3 * found.pose[0])


def test_what_is_stored_is_the_work_done(stage):
    """Strokes and load grow together: half of stroke times force and of load times pose."""
    drive = drive_of(stage)
    x = 1e-3 * np.array([3.0, -2.0, 1.0, 5.0, -4.0, 2.5])
    of = model(stage).system
    found = of.moved(x, LOAD)
    work = (found.force @ (drive.differential @ x) + LOAD @ found.pose) / 2
    assert found.stage + found.stacks == pytest.approx(work, rel=DENSE)
    assert found.stage > 0 < found.stacks


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("load", [np.zeros(3), LOAD], ids=["free", "loaded"])
def test_pose_to_strokes_to_pose(stage, criterion, load):
    for choice in (
        (3, DEFAULT_FORMULA, False),
        (6, DEFAULT_FORMULA, False),
        (None, CALIBRATED, True),
    ):
        of = model(stage, *choice).system
        for pose in (POSE, 1e-13 * POSE, 1e-28 * POSE) if load is not LOAD else (POSE,):
            x = of.commands(pose, load, LEVER, criterion)
            np.testing.assert_allclose(of.moved(x, load).pose, pose, rtol=DENSE)


def test_least_energy_turns_the_joints_as_29_says(stage):
    """Six sets command the six independent joints of mobility six, whatever their stiffness."""
    one = model(stage, 6, DEFAULT_FORMULA, False)
    motion = one.system.moved(one.system.commands(POSE, NONE, LEVER, "least energy"), NONE)
    of = assemble(stage, 6)
    joints = inverse_kinematics(of, stiffness(of), POSE).joints
    turning = joints[of.joints.kind == 0].reshape(3, 3)
    np.testing.assert_allclose(one.rotations(motion, NONE), turning, rtol=DENSE, atol=1e-12)
    assert motion.stage == pytest.approx(
        POSE @ np.linalg.inv(one.system.C[:3, :3]) @ POSE / 2, rel=DENSE
    )


def test_a_stroke_turns_the_base_hinge_by_stroke_over_arm():
    """One pair on link 1, 10 mm from its hinge: a stage of revolutes and stiff stacks has no other
    choice.
    """
    stage = load_stage(GEOMETRY / "mobility3.toml")
    one = model(stage, 3, DEFAULT_FORMULA, False)
    free = drive_of(stage)._replace(stiffness=np.where(np.arange(12) < 2, 1e9, 0.0))
    of = DriveSystem.of(one.system.C, free)
    found = of.moved(1e-3 * np.eye(6)[0], np.zeros(3))
    turned = one._replace(system=of).rotations(found, NONE)
    assert turned[0, 0] == pytest.approx(
        -1e-3 / 10.0, rel=1e-3
    )  # upwards left of the hinge: clockwise


def test_no_strokes_have_a_smaller_largest_one(stage):
    of = model(stage).system
    least = of.commands(POSE, np.zeros(3), LEVER, "least stroke")
    free = np.linalg.svd(of.poses * np.array([[1], [1], [LEVER]]))[2][3:]
    rng = np.random.default_rng(5)
    for step in 10 ** rng.uniform(-6, -3, 200):
        other = least + step * rng.normal(size=3) @ free
        np.testing.assert_allclose(
            of.moved(other, np.zeros(3)).pose, POSE, rtol=100 * DENSE, atol=1e-12
        )
        assert np.max(np.abs(other)) > np.max(np.abs(least))
    energies = [of.moved(of.commands(POSE, LOAD, LEVER, c), LOAD).stage for c in CRITERIA]
    assert energies[0] == min(energies)


def test_the_limits_of_every_stack_count(stage):
    """Strokes to half of 17.4 um on either side at base and at elbow, and contacts to their
    preload.
    """
    of = model(stage).system
    for command in range(6):
        x = 8.7e-3 * np.eye(6)[command]
        assert max(of.shares(x, np.zeros(3))["stroke"]) == pytest.approx(1.0)
        force = of.moved(x, LOAD).force
        found = of.shares(x, LOAD)
        assert max(found["contact"]) == pytest.approx(-np.min(force) / 50.0)
        assert max(found["blocking force"]) == pytest.approx(np.max(force) / 885.0)


def test_a_contact_without_preload_can_only_be_pressed():
    C, drive = spring(14.3e3, 50e3)
    of = DriveSystem.of(C, drive).limits(np.zeros(3))
    contact = of["contact"]
    blocking = of["blocking force"]
    np.testing.assert_allclose([contact.sizes, blocking.sizes], [[0.0], [935.0]])
    assert max(DriveSystem.of(C, drive).shares(np.array([-1e-3]), np.zeros(3))["contact"]) == np.inf


def test_one_direction_of_pushing_does_not_hold_three(stage):
    C, drive = spring(14.3e3, 50e3)
    with pytest.raises(ComputationFailed, match="three directions"):
        DriveSystem.of(C, drive).commands(POSE, np.zeros(3), LEVER, "least energy")


def test_the_two_witnesses_agree_on_a_driven_stage_with_unlike_chains(unlike_drive):
    best = model(unlike_drive)
    metal = driven_elements(unlike_drive, 4)
    C = best.system.C
    F = metal.system.C
    size = np.sqrt(np.diag(F))
    assert np.max(np.abs(C - F) / np.outer(size, size)) < MESH
    lever = unlike_drive.chain.link_lengths[2]
    x = best.system.commands(POSE, np.zeros(3), lever, "least energy")
    reached = metal.system.moved(x, np.zeros(3)).pose
    scale = np.array([1.0, 1.0, lever])
    assert np.linalg.norm((reached - POSE) * scale) < 1e-3 * np.linalg.norm(POSE * scale)
    full = calibration(metal.system, best.system, lever)
    x = best.system.commands(full @ POSE, np.zeros(3), lever, "least energy")
    np.testing.assert_allclose(metal.system.moved(x, np.zeros(3)).pose, POSE, rtol=DENSE)


def test_necks_of_finite_elements_carry_what_balances_and_what_the_model_says(unlike_drive):
    """Platform hinges together hold the load; base hinges, pushed from the frame alone, with the
    stacks there.
    """
    drive = drive_of(unlike_drive)
    one = model(unlike_drive)
    metal = driven_elements(unlike_drive, 4)
    found = neck_wrenches(metal.mesh, plate_of(unlike_drive), metal.fields)
    np.testing.assert_allclose(found[:, 2, :, :3].sum(axis=0), np.eye(3), atol=1e-7)
    np.testing.assert_allclose(found[:, 0, :, :3].sum(axis=0), np.eye(3), atol=1e-7)
    lever = np.array([1.0, 1.0, unlike_drive.chain.link_lengths[2]])[:, None]
    size = np.max(np.abs(one.necks / lever), axis=(0, 1, 2))
    assert found.shape == (3, 3, 3, 3 + len(drive.stacks))
    assert np.max(np.abs(found - one.necks) / lever / size) < MESH


def test_the_half_spaces_of_yield_are_the_stresses_of_the_necks(stage):
    stage = stage.replace(
        override={(2, "elbow"): {"neck": 0.41}, (3, "platform"): {"radius": 1.9}},
        model="plane_strain",
    )
    drive = drive_of(stage)
    one = model(stage)
    rows, bounds = (
        part[-9 * 141 * 4 :] for part in half_spaces(pose_set(one, one.system, LOAD).limits)
    )
    for command in 1e-3 * np.random.default_rng(3).normal(size=(5, 6)):
        found = rows @ command - bounds + 0.99 * 503.0
        force = drive.preload + one.system.moved(command, LOAD).force
        wanted = one.stress(LOAD, force)
        np.testing.assert_allclose(
            np.max(found.reshape(4, 9, 141), axis=(0, 2)), np.ravel(wanted), rtol=DENSE
        )
