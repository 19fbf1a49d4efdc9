"""Strokes, forces and poses: known answers of springs, energy, (29), and the two witnesses of driven stages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.analytic.model import assemble
from flexfem.analytic.paper import inverse_kinematics, stiffness
from flexfem.fem.response import neck_wrenches
from flexfem.fem.structure import plate_of
from flexfem.mechanism.contacts import Push, Stack
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage, load_stage
from flexfem.refused import ComputationFailed
from flexfem.verify.command import command as answer
from flexfem.verify.driven import CRITERIA, commands_for, driven, limits_of_forces, moved, shares
from flexfem.verify.driven_models import commanding, driven_metal, element_stresses, rotations, stresses
from flexfem.verify.open_loop import calibration

GEOMETRY = Path(__file__).parents[2] / "geometry"
LOAD = np.array([3.1, -1.7, 41.0])
POSE = np.array([2.3e-3, -1.1e-3, 7.0e-5])
LEVER = 24.0
NONE = np.zeros(3)
MESH = 4e-3  # four triangles across a neck and the beams of the links: 0.2 % seen, of C as of stiffness alone


@pytest.fixture(scope="module")
def stage() -> Stage:
    return load_stage(GEOMETRY / "mobility6.toml")


def spring(stiffness: float, stack: float, stroke: float = 0.0174) -> tuple[np.ndarray, StageDrive]:
    """The platform on one spring in x, pushed by one stack; y and theta go along with no one."""
    nowhere = Stack(0, (Push(3, np.array([1.0, 0, 0]), None), Push(0, np.zeros(3), None)))
    C = np.diag([1 / stiffness, 1.0, 1.0, 1 / stiffness])
    C[0, 3] = C[3, 0] = 1 / stiffness
    one = np.ones(1)
    return C, StageDrive((nowhere,), ("one",), stack * one, 0 * one, 935.0 * one, np.eye(1), 0 * one, stroke * one)


def test_ae0505d16_on_14_3_newtons_per_micrometre_travels_13_74_micrometres():
    """NEC/Tokin, Multilayer Piezoelectric Actuators vol. 6, page 22: the spring load of their example."""
    C, drive = spring(14.3e3, 935 / 0.0174)
    found = moved(driven(C, drive), drive, drive.highest, np.zeros(3))
    assert 1e3 * found.pose[0] == pytest.approx(13.74, abs=0.005)
    assert found.force[0] == pytest.approx(14.3e3 * found.pose[0])


def test_a_spring_as_stiff_as_the_stack_halves_its_stroke():
    C, drive = spring(31e3, 31e3)
    found = moved(driven(C, drive), drive, drive.highest, np.zeros(3))
    assert found.pose[0] == pytest.approx(0.0087)
    assert found.force[0] == pytest.approx(0.0087 * 31e3)
    assert found.metal == pytest.approx(found.stacks)


def test_stacks_of_no_stiffness_leave_the_passive_stage(stage):
    drive = drive_of(stage)._replace(stiffness=np.zeros(12))
    C = commanding(stage, 6, "paros-weisbord", False).model.compliance
    of = driven(C, drive)
    np.testing.assert_array_equal(of.engaged, C[:3, :3])
    np.testing.assert_array_equal(of.poses, 0.0)


def test_what_is_stored_is_the_work_done(stage):
    """Strokes and load grow together: half of stroke times force and of load times pose."""
    drive, x = drive_of(stage), 1e-3 * np.array([3.0, -2.0, 1.0, 5.0, -4.0, 2.5])
    of = commanding(stage, None, "calibrated", True).of
    found = moved(of, drive, x, LOAD)
    work = (found.force @ (drive.differential @ x) + LOAD @ found.pose) / 2
    assert found.metal + found.stacks == pytest.approx(work, rel=1e-10)
    assert found.metal > 0 < found.stacks


def test_engaged_stacks_make_the_platform_stiffer_and_a_load_moves_it_by_that(stage):
    drive, of = drive_of(stage), commanding(stage, 6, "paros-weisbord", False).of
    found = moved(of, drive, np.zeros(6), LOAD)
    np.testing.assert_allclose(found.pose, of.engaged @ LOAD, rtol=1e-9)
    passive, engaged = np.linalg.inv(of.C[:3, :3]), np.linalg.inv(of.engaged)
    assert np.all(np.linalg.eigvalsh(engaged - passive) > 0)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("load", [np.zeros(3), LOAD], ids=["free", "loaded"])
def test_pose_to_strokes_to_pose(stage, criterion, load):
    drive = drive_of(stage)
    for choice in ((3, "paros-weisbord", False), (6, "paros-weisbord", False), (None, "calibrated", True)):
        of = commanding(stage, *choice).of
        x = commands_for(of, drive, POSE, load, LEVER, criterion)
        np.testing.assert_allclose(moved(of, drive, x, load).pose, POSE, rtol=1e-12)


def test_least_energy_turns_the_joints_as_29_says(stage):
    """Six sets command the six independent joints of mobility six, whatever their stiffness."""
    drive = drive_of(stage)
    one = commanding(stage, 6, "paros-weisbord", False)
    motion = moved(one.of, drive, commands_for(one.of, drive, POSE, np.zeros(3), LEVER, "least energy"), np.zeros(3))
    of = assemble(stage, 6)
    joints = inverse_kinematics(of, stiffness(of), POSE).joints
    turning = joints[of.joints.kind == 0].reshape(3, 3)
    np.testing.assert_allclose(rotations(stage, one, motion, np.zeros(3)), turning, rtol=1e-7, atol=1e-12)
    assert motion.metal == pytest.approx(POSE @ np.linalg.inv(one.of.C[:3, :3]) @ POSE / 2, rel=1e-9)


def test_a_stroke_turns_the_base_hinge_by_stroke_over_arm():
    """One pair on link 1, 10 mm from its hinge: a stage of revolutes and stiff stacks has no other choice."""
    stage = load_stage(GEOMETRY / "mobility3.toml")
    drive = drive_of(stage)._replace(stiffness=np.full(12, 1e9))
    one = commanding(stage, 3, "paros-weisbord", False)
    of = driven(one.model.compliance, drive)
    alone = np.array([True, True, False, False, False, False, False, False, False, False, False, False])
    free = drive._replace(stiffness=np.where(alone, 1e9, 0.0))
    of = driven(one.model.compliance, free)
    found = moved(of, free, 1e-3 * np.eye(6)[0], np.zeros(3))
    turned = rotations(stage, one._replace(of=of), found, np.zeros(3))
    assert turned[0, 0] == pytest.approx(-1e-3 / 10.0, rel=1e-3)  # upwards left of the hinge: clockwise


def test_no_strokes_have_a_smaller_largest_one(stage):
    drive, of = drive_of(stage), commanding(stage, None, "calibrated", True).of
    least = commands_for(of, drive, POSE, np.zeros(3), LEVER, "least stroke")
    free = np.linalg.svd(of.poses * np.array([[1], [1], [LEVER]]))[2][3:]
    rng = np.random.default_rng(5)
    for step in 10 ** rng.uniform(-6, -3, 200):
        other = least + step * rng.normal(size=3) @ free
        np.testing.assert_allclose(moved(of, drive, other, np.zeros(3)).pose, POSE, rtol=1e-6, atol=1e-12)
        assert np.max(np.abs(other)) > np.max(np.abs(least))
    energies = [moved(of, drive, commands_for(of, drive, POSE, LOAD, LEVER, c), LOAD).metal for c in CRITERIA]
    assert energies[0] == min(energies)


def test_the_limits_of_every_stack_count(stage):
    """Strokes to half of 17.4 um on either side at base and at elbow, and contacts to their preload."""
    drive, of = drive_of(stage), commanding(stage, None, "calibrated", True).of
    for command in range(6):
        x = 8.7e-3 * np.eye(6)[command]
        assert shares(of, drive, x, np.zeros(3))["stroke"] == pytest.approx(1.0)
        force = moved(of, drive, x, LOAD).force
        found = shares(of, drive, x, LOAD)
        assert found["contact"] == pytest.approx(-np.min(force) / 50.0)
        assert found["blocking"] == pytest.approx(np.max(force) / 885.0)


def test_within_limits_uses_the_smallest_share_of_any(stage):
    light = stage.replace(actuator=[{**each.model_dump(exclude_unset=True), "preload": 2.0} for each in stage.actuator])
    drive, of = drive_of(light), commanding(light, None, "calibrated", True).of
    used = {c: max(shares(of, drive, commands_for(of, drive, POSE, LOAD, LEVER, c), LOAD).values()) for c in CRITERIA}
    assert used["within limits"] < 0.9 * used["least stroke"]
    assert used["within limits"] <= used["least energy"]


def test_a_contact_without_preload_can_only_be_pressed():
    C, drive = spring(14.3e3, 50e3)
    contact, blocking = limits_of_forces(driven(C, drive), drive, np.zeros(3))
    np.testing.assert_allclose([contact.sizes, blocking.sizes], [[0.0], [935.0]])
    assert shares(driven(C, drive), drive, np.array([-1e-3]), np.zeros(3))["contact"] == np.inf


def test_one_direction_of_pushing_does_not_hold_three(stage):
    C, drive = spring(14.3e3, 50e3)
    with pytest.raises(ComputationFailed, match="three directions"):
        commands_for(driven(C, drive), drive, POSE, np.zeros(3), LEVER, "least energy")


@pytest.fixture(scope="module")
def unlike(stage) -> Stage:
    """Unlike chains, contacts off the links' normals, on straight and bent links and on the rim of the platform."""
    rim = 17.0 * np.exp(1j * np.deg2rad(75.0))
    return stage.replace(
        override={(2, "elbow"): {"neck": 0.61}, (3, "base"): {"radius": 3.1}, (1, "platform"): {"neck": 0.43}},
        actuator=[
            stage.actuator[0].model_copy(update={"tilt": np.deg2rad(-15.0), "pair": False}),
            stage.actuator[1].model_copy(update={"arm": 7.0, "side": "right", "tilt": np.deg2rad(10.0)}),
            {
                "name": "rim",
                "between": ("link 1", "platform"),
                "point": (rim.real, rim.imag),
                "direction": np.deg2rad(260.0),
                "stroke": 0.03,
                "blocking_force": 410.0,
            },
        ],
    )


def test_the_two_witnesses_agree_on_a_driven_stage_with_unlike_chains(unlike):
    model, metal = commanding(unlike, None, "calibrated", True), driven_metal(unlike, 4)
    C, F = model.of.C, metal.of.C
    size = np.sqrt(np.diag(F))
    assert np.max(np.abs(C - F) / np.outer(size, size)) < MESH
    drive, lever = drive_of(unlike), unlike.chain.link_lengths[2]
    x = commands_for(model.of, drive, POSE, np.zeros(3), lever, "least energy")
    reached = moved(metal.of, drive, x, np.zeros(3)).pose
    scale = np.array([1.0, 1.0, lever])
    assert np.linalg.norm((reached - POSE) * scale) < 1e-3 * np.linalg.norm(POSE * scale)
    rigid = commanding(unlike, 21, "calibrated", False)
    stiff = moved(metal.of, drive, commands_for(rigid.of, drive, POSE, np.zeros(3), lever, "least energy"), np.zeros(3))
    assert np.linalg.norm((stiff.pose - POSE) * scale) > 3 * np.linalg.norm((reached - POSE) * scale)
    full = calibration(metal.of, model.of, drive, lever)
    x = commands_for(model.of, drive, full @ POSE, np.zeros(3), lever, "least energy")
    np.testing.assert_allclose(moved(metal.of, drive, x, np.zeros(3)).pose, POSE, rtol=1e-9)


def test_necks_of_finite_elements_carry_what_balances_and_what_the_model_says(unlike):
    """Platform hinges together hold the load; base hinges, pushed from the frame alone, with the stacks there."""
    drive, one, metal = drive_of(unlike), commanding(unlike, None, "calibrated", True), driven_metal(unlike, 4)
    found = neck_wrenches(metal.mesh, plate_of(unlike), metal.response.fields)
    np.testing.assert_allclose(found[:, 2, :, :3].sum(axis=0), np.eye(3), atol=1e-7)
    np.testing.assert_allclose(found[:, 0, :, :3].sum(axis=0), np.eye(3), atol=1e-7)
    lever = np.array([1.0, 1.0, unlike.chain.link_lengths[2]])[:, None]
    size = np.max(np.abs(one.model.necks / lever), axis=(0, 1, 2))
    assert found.shape == (3, 3, 3, 3 + len(drive.stacks))
    assert np.max(np.abs(found - one.model.necks) / lever / size) < MESH


def test_neck_stresses_of_shear_are_those_of_finite_elements(stage):
    """Strokes of least size set stacks against each other; before, of least energy, necks bend alone."""
    drive, one, metal = drive_of(stage), commanding(stage, None, "calibrated", True), driven_metal(stage, 6)
    for criterion, allowed in (("least energy", 0.006), ("least stroke", 0.012)):
        x = commands_for(one.of, drive, POSE, np.zeros(3), LEVER, criterion)
        found = stresses(stage, one, moved(one.of, drive, x, np.zeros(3)), np.zeros(3))
        assert np.max(found) == pytest.approx(
            np.max(element_stresses(stage, metal, drive, x, np.zeros(3))), rel=allowed
        )


def single(stage: Stage, **changes: float | None) -> Stage:
    """The stage with a stack and no pair on link 1 of every chain, which together only turn the platform one way."""
    return stage.replace(actuator=[stage.actuator[0].model_copy(update={"pair": False} | changes)])


def said_of(stage: Stage, pose: list[float], load: list[float]) -> list[str]:
    """Warnings on limits, not on yield or buckling: the preload of a single stack alone is too much for the necks."""
    said = answer(stage, np.array(pose), np.array(load), (None, "calibrated", True)).warnings
    return [text for text in said if "yield strength" not in text and "no stable equilibrium" not in text]


def test_a_preload_without_a_partner_stresses_the_necks(stage):
    """50 N at 10 mm from the base hinge turn the platform and bend every neck; in pairs they cancel."""
    alone = single(stage)
    found = answer(alone, NONE, NONE, (None, "calibrated", True), 6).criteria["least energy"]
    assert np.max(found.stress) == pytest.approx(502.42, rel=1e-4)
    assert found.element_stress is not None
    np.testing.assert_allclose(found.element_stress, found.stress, rtol=0.03)
    both = answer(stage, NONE, NONE, (None, "calibrated", True), 3).criteria["least energy"]
    assert both.element_stress is not None and np.max(both.stress) < 1e-9 > np.max(both.element_stress) / 503.0


BELOW = "some single stacks would need strokes below 0 um, their least"


def test_strokes_that_a_single_stack_cannot_do_are_warned_of(stage):
    """3 N in X turn links 1 to both sides: no strokes without one below zero hold them, though no contact is lost."""
    assert said_of(single(stage), [0.0, 0.0, 0.0], [3.0, 0.0, 0.0]) == [
        f"least stroke: no strokes of any size hold this pose: {BELOW}",
        f"within limits: no strokes of any size hold this pose: {BELOW}",
        f"the drive does not reach this pose: {BELOW}",
        "least energy: the stack base, chain 3 would need a stroke of -1.059 um, outside 0 to 17.4 um",
    ]
    assert said_of(single(stage), [0.0, 0.0, 1e-4], [0.0, 0.0, 0.0]) == []
    both = stage.replace(actuator=[each.model_copy(update={"pair": False}) for each in stage.actuator])
    assert said_of(both, [0.0023, -0.0011, 7e-5], [0.0, 0.0, 0.0]) == [  # other criteria find strokes above zero
        "least energy: the stack elbow, chain 2 would need a stroke of -0.7424 um, outside 0 to 17.4 um",
        "least energy: the stack elbow, chain 3 would need a stroke of -1.482 um, outside 0 to 17.4 um",
    ]


def test_strokes_that_a_pair_cannot_do_are_warned_of(stage):
    assert said_of(stage, [0.03, -0.0011, 7e-5], [0.0, 0.0, 0.0])[:4] == [
        "the drive does not reach this pose: it takes 1.296 times its limit of stroke",
        "least energy: the pair elbow, chain 1 would need a stroke of 9.21 um, outside -8.7 to 8.7 um",
        "least energy: the pair base, chain 3 would need a stroke of 9.535 um, outside -8.7 to 8.7 um",
        "least energy: the pair elbow, chain 3 would need a stroke of -13.84 um, outside -8.7 to 8.7 um",
    ]


def test_forces_that_a_stack_cannot_do_are_warned_of(stage):
    load = [40.0, 0.0, 0.0]
    assert said_of(single(stage), [0.0, 0.0, 1e-4], load)[3:] == [
        "least energy: the stack base, chain 3 would need a stroke of -13.28 um, outside 0 to 17.4 um",
        "least energy: the stack base, chain 3 would have to pull with 18.97 N, but its contact opens at 0 N",
    ]
    assert said_of(single(stage, preload=900.0), [0.0, 0.0, 1e-4], load)[4:] == [
        "least energy: the stack base, chain 2 would have to push with 969.1 N, above its blocking force of 935 N"
    ]
    light = stage.replace(actuator=[each.model_copy(update={"preload": 10.0}) for each in stage.actuator])
    found = said_of(light, [0.0, 0.0, 0.0], [60.0, 0.0, 0.0])
    assert found[0] == "the drive does not reach this pose: it takes 2.186 times its limit of contact"
    (said,) = (text for text in found if text.startswith("within limits: "))
    assert said.startswith("within limits: 4 contacts are beyond their limits; the worst: the stack ")
    assert said.endswith(" would have to pull with 11.86 N, but its contact opens at 0 N")


def test_many_limits_are_said_by_their_number_and_the_worst(stage):
    """Six pairs far out of reach under 3 kN, by least energy: three stacks of a kind are named, of more the worst."""
    found = said_of(stage, [0.3, 0.0, 0.0], [0.0, 3000.0, 0.0])
    assert [text.removeprefix("least energy: ") for text in found if text.startswith("least energy: ")] == [
        "6 strokes are beyond their limits; the worst: the pair elbow, chain 1 would need a stroke of 317.2 um, "
        "outside -8.7 to 8.7 um",
        "5 contacts are beyond their limits; the worst: the stack elbow, chain 2 would have to pull with 1190 N, but "
        "its contact opens at 0 N",
        "the stack base, chain 1, partner would have to push with 1161 N, above its blocking force of 935 N",
        "the stack elbow, chain 1 would have to push with 1249 N, above its blocking force of 935 N",
        "the stack elbow, chain 2, partner would have to push with 1290 N, above its blocking force of 935 N",
    ]
    single_stacks = [each.model_copy(update={"pair": False, "preload": 900.0}) for each in stage.actuator]
    found = said_of(stage.replace(actuator=single_stacks), [0.02, 0.03, -3e-3], [0.0, 3000.0, 0.0])
    first, *_, last = [text.removeprefix("least energy: ") for text in found if text.startswith("least energy: ")]
    assert first == (  # by 230.1 um; another, that would need 243.7 um, by 226.3
        "6 strokes are beyond their limits; the worst: the stack base, chain 1 would need a stroke of -230.1 um, "
        "outside 0 to 17.4 um"
    )
    assert last == (
        "4 forces are beyond their limits; the worst: the stack elbow, chain 1 would have to push with 3294 N, above "
        "its blocking force of 935 N"
    )


PULL = "some stacks without preload would have to pull"
PUSH = "some stacks preloaded to their blocking force would have to push harder"


@pytest.mark.parametrize(
    ("preload", "pose", "load", "why"),
    [
        (50.0, -1e-4, 0.0, BELOW),
        (0.0, 1e-3, 1000.0, PULL),
        (0.0, 1e-4, 1000.0, f"{BELOW}, and {PULL}"),
        (935.0, 1e-3, -1000.0, PUSH),
    ],
)
def test_which_limit_leaves_no_strokes_for_a_pose_is_said(stage, preload, pose, load, why):
    bare = single(stage, preload=preload, ball_radius=None)
    found = said_of(bare, [0.0, 0.0, pose], [0.0, 0.0, load])
    assert f"within limits: no strokes of any size hold this pose: {why}" in found
    assert f"the drive does not reach this pose: {why}" in found
