"""Strokes for a pose: numbers of both models, warnings on limits, refusals, the figure and the
command.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.quiver import Quiver

import flexfem
from flexfem.commands import cli
from flexfem.paper.drive import StageDrive
from flexfem.paper.drives import drive_of
from flexfem.paper.fields import driven_response
from flexfem.paper.figures.drive import plot_drive, plot_forces, plot_strokes, stack_ends
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.questions.driven import CRITERIA, DriveSystem

from ..conftest import ROOT
from ..tolerances import DENSE

STAGE = ROOT / "geometry" / "mobility6.toml"
POSE = (3e-3, -1e-3, 5e-5)
LEVER = np.array([1.0, 1.0, 24.0])
OWN = flexfem.Analytic(formula="calibrated", mobility=21, links=True)
RIM = 17.0 * np.exp(1j * np.deg2rad(100.0))  # mm


@pytest.fixture(scope="module")
def found(stage) -> StageDrive:
    return flexfem.drive(stage, pose=POSE, resolution=3)


def single(stage: Stage, **changes: object) -> Stage:
    """The stage with a stack and no pair on link 1 of every chain, which together only turn the
    platform one way.
    """
    return stage.replace(actuator=[stage.actuator[0].model_copy(update={"pair": False} | changes)])


def said_of(
    stage: Stage, pose: tuple[float, ...], load: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> list[str]:
    """Warnings on limits, not on yield or buckling: the preload of a single stack alone is too much
    for the necks.
    """
    said = flexfem.drive(stage, pose=pose, load=load, models="analytic", analytic=OWN).warnings
    return [
        text
        for text in said
        if "yield strength" not in text and "no stable equilibrium" not in text
    ]


def test_strokes_by_three_criteria_and_where_finite_elements_go(found):
    command = found.command
    stroke = found.stroke
    force = found.force
    assert (
        found.axes["criterion"] == CRITERIA
        and command.shape == (6, 3)
        and stroke.shape == force.shape == (12, 3)
    )
    np.testing.assert_allclose(stroke[::2], command)
    np.testing.assert_allclose(stroke[1::2], -command)
    np.testing.assert_allclose(
        np.mean(force, axis=0), 50.0, rtol=1e-3
    )  # a pair takes from one what it gives the other
    assert np.max(found.share) < 100.0
    size = np.linalg.norm(POSE * LEVER)
    missed = dict(
        zip(
            found.axes["commanding model"], np.linalg.norm(found.error * LEVER, axis=1), strict=True
        )
    )
    best = "calibrated, elastic links, corrected for thickness"
    assert missed[best] < 2e-3 * size < missed["paros-weisbord, mobility 6, plane stress"] * 2
    assert missed[f"{best}, calibration matrix"] < DENSE * size
    assert (
        "actuator.base.preload_n" in found.about.assumed
        and found.about.hash == flexfem.load(STAGE).drive_hash
    )


def test_stiffness_without_stacks_with_them_and_with_their_preloads(found):
    changed = {state: found.at("change", state=state) / 100 for state in found.axes["state"]}
    pushed = changed["preloaded, forces normal to the loaded body"]
    np.testing.assert_allclose(pushed, [4.80e-4, 4.80e-4, 5.26e-4], rtol=3e-3)
    carried = changed["preloaded, forces fixed to the carrier"]
    np.testing.assert_allclose(carried, [-3.33e-4, -3.33e-4, -3.64e-4], rtol=3e-3)
    own = changed["stack forces, least energy"]
    assert np.all(np.abs(own - pushed) < 1e-4) and not np.array_equal(own, pushed)
    engaged, bare = (found.at("stiffness", state=state) for state in ("engaged", "disengaged"))
    assert engaged[0] > 100 * bare[0]


def test_stiffness_with_the_other_directions_held_is_not_that_with_them_free(stage):
    """Of unlike chains: a push one way alone meets 10 to 27 % less."""
    wide = stage.replace(override={(2, "elbow"): {"neck": 1.1}})
    found = flexfem.drive(wide, pose=POSE, models="analytic")
    free = found.at("stiffness", state="disengaged, other directions free")
    np.testing.assert_allclose(
        free / found.at("stiffness", state="disengaged"), [0.902, 0.7333, 0.7656], atol=5e-4
    )
    np.testing.assert_allclose(free, flexfem.stiffness(wide, models="analytic").free[0], rtol=DENSE)


def test_how_pushes_spread_over_links_moves_the_engaged_stiffness(stage, found):
    """By half the length that is assumed 2.8 %, by finite elements of the same pushes 2.5 %."""
    moved = found.push_spread / found.at("stiffness", state="engaged")
    np.testing.assert_allclose(moved, [0.0280, 0.0280, 0.0256], atol=1e-4)
    drive = drive_of(stage)
    mesh = build_mesh(stage, 3)
    half = tuple(stack.spread_over(0.5) for stack in drive.stacks)
    whole, shorter = (
        DriveSystem.of(driven_response(mesh, plate_of(stage), stacks).compliance, drive).stiffness
        for stacks in (drive.stacks, half)
    )
    np.testing.assert_allclose(1 - shorter / whole, moved, rtol=0.12)
    twice = [
        push.station
        for stack in drive.stacks
        for push in stack.spread_over(2.0).pushes
        if push.station
    ]
    assert {round(station.half, 9) for station in twice} == {
        6.75,
        8.5,
    }  # 24.5 mm of link 1, contact at 16
    rigid = flexfem.drive(
        stage, pose=POSE, models="analytic", analytic=flexfem.Analytic(mobility=6)
    )
    assert "push_spread" not in rigid.values


def test_preloads_that_no_equilibrium_stands_are_said(stage):
    weak = {"stack": None, "stroke": 9.0, "blocking_force": 9e4, "preload": 8e4}
    strong = stage.replace(actuator=[each.model_copy(update=weak) for each in stage.actuator])
    found = flexfem.drive(strong, pose=POSE, models="analytic")
    state = "preloaded, forces fixed to the carrier"
    assert np.isnan(found.at("stiffness", state=state)).all()
    assert f"no stable equilibrium in the state {state!r}" in found.warnings


def test_both_models_agree_on_friction_and_stress_under_a_load(stage):
    """A pair bears its preload itself; errors of finite elements are with the load on both."""
    rough = stage.replace(
        model="plane_stress",
        actuator=[one.model_copy(update={"friction": 0.2}) for one in stage.actuator],
    )
    found = flexfem.drive(rough, pose=(2e-3, -1e-3, 5e-5), load=(30.0, -20.0, 500.0), resolution=3)
    friction = found.at("friction", **{"strokes by": "least energy"})
    np.testing.assert_allclose(friction[1], friction[0], rtol=6e-3)
    np.testing.assert_allclose(friction[0], [2.5e-3, 2.6e-3, 1e-4], rtol=0.05)
    highest = np.max(found.stress, axis=(1, 2))
    np.testing.assert_allclose(highest[0], highest[1], rtol=0.03)
    assert (
        np.max(np.abs(found.error[0]) * LEVER)
        < 0.05 * 30.0 / found.at("stiffness", state="engaged")[0]
    )
    assert "friction" not in flexfem.drive(stage, pose=POSE, models="analytic").values


def test_neck_stresses_of_shear_are_those_of_finite_elements(stage):
    """Strokes of least size set stacks against each other; before, of least energy, necks bend
    alone.
    """
    found = flexfem.drive(stage, pose=(2.3e-3, -1.1e-3, 7.0e-5), analytic=OWN, resolution=6)
    highest = np.max(found.stress, axis=(1, 2))
    np.testing.assert_allclose(highest[0, 0], highest[1, 0], rtol=0.006)
    np.testing.assert_allclose(highest[0, 1], highest[1, 1], rtol=0.012)


BELOW = "some single stacks would need strokes below their minimum of 0 um"
PULL = "some stacks without preload would have to pull"
PUSH = "some stacks preloaded to their blocking force would have to push harder"


def test_strokes_and_forces_beyond_their_limits_are_warned_of(stage):
    """3 N in X turn links 1 to both sides: no strokes without one below zero hold them, though no
    contact is lost.
    """
    (*_, strokes) = said_of(single(stage), (0.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    assert (
        "strokes beyond their limits: 1, the worst at base, chain 3: -1.059 um, outside 0 to 17.4"
        in strokes
    )
    assert said_of(single(stage), (0.0, 0.0, 1e-4)) == []
    assert "it requires 1.296 times the limit of stroke" in said_of(stage, (0.03, -0.0011, 7e-5))[0]
    found = said_of(
        stage, (0.3, 0.0, 0.0), (0.0, 3000.0, 0.0)
    )  # six pairs far out of reach under 3 kN
    expected = ("elbow, chain 1: 317.2 um", ": a pull of 1190 N", "1290 N, above 935 N")
    for count, kind, said in zip(
        (6, 5, 3), ("strokes", "contacts", "forces"), expected, strict=True
    ):
        assert any(
            f"least energy: {kind} beyond their limits: {count}, the worst" in text and said in text
            for text in found
        )


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
    found = said_of(
        single(stage, preload=preload, ball_radius=None), (0.0, 0.0, pose), (0.0, 0.0, load)
    )
    assert f"within limits: no strokes of any size hold this pose: {why}" in found
    assert f"the drive does not reach this pose: {why}" in found


@pytest.mark.usefixtures("unrendered")
def test_the_command_prints_and_keeps_what_the_function_gives(tmp_path, capsys, found):
    options = ["--pose", *map(str, POSE), "--models", "analytic", "--json", "-o", str(tmp_path)]
    cli.app(["drive", str(STAGE), *options], standalone_mode=False)
    printed = json.loads(capsys.readouterr().out)["quantities"]
    np.testing.assert_allclose(printed["stroke"]["values"], found.stroke)
    named = ("stroke", "contact", "blocking force")
    assert [found.answer().count(each) for each in named] == [1, 1, 1]
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".json", ".pdf", ".png"]


@pytest.fixture(scope="module")
def drawn(stage) -> StageDrive:
    """Unlike chains; a pair on the frame, a weak single stack that link 2 carries, one on the
    platform.
    """
    first, second = stage.actuator
    weak = second.model_copy(update={"pair": False, "stack": "AE0203D16", "preload": 213.0})
    rim = {
        "name": "rim",
        "between": ("frame", "platform"),
        "point": (RIM.real, RIM.imag),
        "preload": 30.0,
    }
    rim |= {"direction": np.deg2rad(310.0), "stroke": 0.012, "stiffness": 20e3}
    made = stage.replace(override={(2, "elbow"): {"neck": 0.62}}, actuator=[first, weak, rim])
    return flexfem.drive(made, pose=(3e-3, -1e-3, 2e-4), models="analytic")


def test_stacks_are_where_they_push(drawn):
    """The known place of the first pair; of all, that the moment of the push is that of its line of
    action.
    """
    contact, push = stack_ends(drawn.fields)
    np.testing.assert_allclose(contact[:2], [(44.0, -36.5), (44.0, -27.5)], atol=1e-9)
    np.testing.assert_allclose(
        contact[4], (9.6099, 56.3551), atol=1e-4
    )  # of chain 2: by 120 degrees
    for (x, y), (u, v), stack in zip(contact, push, drive_of(drawn.fields).stacks, strict=True):
        np.testing.assert_allclose(stack.placed(stack.pushes[0]), [u, v, x * v - y * u], atol=1e-9)


def test_the_figure_draws_the_numbers_of_the_result(drawn):
    _, (strokes, forces, sketch) = pyplot.subplots(3)
    plot_strokes(strokes, drawn)
    for k, bars in enumerate(strokes.containers[1:]):
        np.testing.assert_allclose(
            [bar.get_width() for bar in bars], drawn.command[:, k], atol=1e-12
        )
    plot_forces(forces, drawn)
    np.testing.assert_allclose([bar.get_width() for bar in forces.containers[0]], drawn.force[:, 0])
    plot_drive(sketch, drawn)
    (arrows,) = (part for part in sketch.collections if isinstance(part, Quiver))
    push = drawn.force[:, :1] * stack_ends(drawn.fields)[1]
    along = np.column_stack([arrows.U, arrows.V])
    np.testing.assert_allclose(along / np.abs(along).max(), push / np.abs(push).max(), atol=1e-9)
    with pytest.raises(flexfem.BadInput, match="expected one of: least energy"):
        plot_drive(sketch, drawn, "least force")
    pyplot.close("all")
