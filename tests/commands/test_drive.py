"""`flexfem command` and `flexfem.command`: what they answer, print and refuse."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import flexfem as package
from flexfem.commands.drive import print_command
from flexfem.commands.reach import print_reach
from flexfem.fem.drive import driven_response
from flexfem.fem.response import plate_of
from flexfem.fem.sectors import build_mesh
from flexfem.mechanism.drives import drive_of
from flexfem.terminal import people
from flexfem.verify.driven import driven
from flexfem.verify.driven_models import engaged_stiffness

POSE = ("0.003", "-0.001", "5e-5")


def test_command_answers_strokes_by_three_criteria_and_where_the_metal_goes(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    code, out, err = flexfem("command", path, "--pose", *POSE, "--resolution", 3, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    pose, lever = np.array(found["pose"]), np.array([1, 1, 24.0])
    assert list(found["criteria"]) == ["least energy", "least stroke", "within limits"]
    for one in found["criteria"].values():
        np.testing.assert_allclose(one["pose"], pose, rtol=1e-12)
        assert len(one["command"]) == 6 and len(one["stroke"]) == len(one["force"]) == len(found["stacks"]) == 12
        np.testing.assert_allclose(one["stroke"][::2], one["command"])
        np.testing.assert_allclose(one["stroke"][1::2], -np.array(one["command"]))
        assert np.mean(one["force"]) == pytest.approx(50.0, rel=1e-3)  # a pair takes from one what it gives the other
        assert np.shape(one["rotation"]) == np.shape(one["stress"]) == np.shape(one["element_stress"]) == (3, 3)
        assert max(one["share"].values()) < 1
    assert np.shape(found["calibration"]) == (3, 3)
    best = "calibrated, elastic links, corrected for thickness"
    missed = {each["model"]: np.linalg.norm(np.array(each["error"]) * lever) for each in found["open_loop"]}
    assert missed[best] < 2e-3 * np.linalg.norm(pose * lever) < missed["paros-weisbord, mobility 6, plane stress"] * 2
    assert missed[f"{best}, calibration matrix"] < 1e-9 * np.linalg.norm(pose * lever)
    assert "actuator.base.preload_n" in found["assumed"]
    assert found["engaged"][0] > 100 * found["disengaged"][0]


def test_what_is_printed_are_the_numbers_of_the_json(flexfem, project):
    path = project.path("geometry/mobility3.toml")
    arguments = ("command", path, "--pose", *POSE, "--load", 1, -2, 30, "--analytic")
    found = json.loads(flexfem(*arguments, "--json")[1])
    out = flexfem(*arguments)[1]
    least = found["criteria"]["least energy"]
    for name, stroke, force in zip(found["stacks"], least["stroke"], least["force"], strict=True):
        (line,) = (line for line in out.splitlines() if line.startswith(f"{name}  "))
        assert f"{1e3 * stroke:+.4f}" in line and f"{force:.3f}" in line
    assert "pose 3 um, -1 um, 0.05 mrad under 1 N, -2 N, 30 N mm; strokes" in out
    assert f"{found['engaged'][0]:.5g} N/mm" in out
    assert "by finite elements" not in out and "error of the metal" not in out
    assert f"{least['metal']:.4g}" in out


def test_the_stiffness_is_that_without_stacks_with_them_and_with_their_preloads(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    arguments = ("command", path, "--pose", *POSE, "--analytic")
    found = json.loads(flexfem(*arguments, "--json")[1])
    changed = {way: np.array(K) / found["engaged"] - 1 for way, K in found["preloaded"].items()}
    np.testing.assert_allclose(changed["pushed"], [4.80e-4, 4.80e-4, 5.26e-4], rtol=3e-3)
    np.testing.assert_allclose(changed["carrier"], [-3.33e-4, -3.33e-4, -3.64e-4], rtol=3e-3)
    own = np.array(found["criteria"]["least energy"]["preloaded"]) / found["engaged"] - 1
    assert np.all(np.abs(own - changed["pushed"]) < 1e-4) and not np.array_equal(own, changed["pushed"])
    out = flexfem(*arguments)[1]
    for start, K in (("disengaged", found["disengaged"]), ("engaged", found["engaged"])):
        (line,) = (line for line in out.splitlines() if line.startswith(start))
        assert all(f"{value:.5g} N" in line for value in K)
    (line,) = (line for line in out.splitlines() if line.startswith("preloaded, pushes normal"))
    assert "+0.048, +0.048, +0.053" in line and f"{found['preloaded']['pushed'][2]:.5g} N mm/rad" in line


def test_how_pushes_spread_over_links_is_beside_the_engaged_stiffness(flexfem, project):
    """By half the length that is assumed 2.8 %, by finite elements of the same pushes 2.5 %; twice does not fit."""
    path = project.path("geometry/mobility6.toml")
    asked = ("command", path, "--pose", *POSE, "--analytic")
    found = json.loads(flexfem(*asked, "--json")[1])
    moved = np.array(found["push_spread"]) / found["engaged"]
    np.testing.assert_allclose(moved, [0.0280, 0.0280, 0.0256], atol=1e-4)
    stage = package.load(path)
    drive, mesh = drive_of(stage), build_mesh(stage, 3)
    half, twice = (tuple(stack.spread_over(times) for stack in drive.stacks) for times in (0.5, 2.0))
    whole, shorter = (
        engaged_stiffness(driven(driven_response(mesh, plate_of(stage), stacks).compliance, drive))
        for stacks in (drive.stacks, half)
    )
    np.testing.assert_allclose(1 - shorter / whole, moved, rtol=0.12)
    lengths = [[round(push.station.half, 9) for stack in stacks for push in stack.pushes if push.station is not None]
               for stacks in (half, drive.stacks, twice)]  # fmt: skip
    assert [{*each} for each in lengths] == [{3.375}, {6.75}, {6.75, 8.5}]  # 24.5 mm of link 1, contact at 16
    (line,) = (line for line in flexfem(*asked)[1].splitlines() if line.startswith("±, by the spread of the pushes"))
    assert f"± {found['push_spread'][0]:.3g} N/mm" in line and line.split()[-4:] == ["±", "2.8,", "2.8,", "2.6"]
    assert json.loads(flexfem(*asked, "--mobility", 6, "--json")[1])["push_spread"] is None


@pytest.mark.parametrize(
    ("key", "stiffness", "said"),
    [
        ("\nball_loose = true", 6.79, "its loose ball, two contacts"),
        ("\nball_loose = false", 10.36, "its ball fixed to the stack, one contact"),
        ("", 10.36, "its ball fixed to the stack, one contact, assumed"),
    ],
)
def test_what_a_stack_pushes_with_is_said(flexfem, project, key, stiffness, said):
    path = project.edit("geometry/mobility6.toml", ("ball_radius_mm = 2.0", f"ball_radius_mm = 2.0{key}"))
    assert f"each stack pushes by {said}\n" in flexfem("command", path, "--pose", *POSE, "--analytic")[1]
    found = re.findall(rf"([\d.]+) with {said}, preload 50 N", flexfem("check", path)[1])
    assert [float(each) for each in found] == pytest.approx([stiffness] * 2, abs=0.01)


def test_preloads_that_no_equilibrium_stands_are_said(flexfem, project):
    weak = (
        ('stack = "AE0505D16"', "stroke_um = 9000.0\nblocking_force_n = 9e4"),
        ("preload_n = 50.0", "preload_n = 8e4"),
        ('base.stack"', 'base.stroke_um"'),
        ('elbow.stack"', 'elbow.stroke_um"'),
    )
    path = project.edit("geometry/mobility6.toml", *weak)
    found = json.loads(flexfem("command", path, "--pose", *POSE, "--analytic", "--json")[1])
    assert found["preloaded"]["carrier"] is None
    out = flexfem("command", path, "--pose", *POSE, "--analytic")[1]
    (line,) = (line for line in out.splitlines() if line.startswith("preloaded, pushes kept"))
    assert line.split()[-1] == "unstable"


def test_what_friction_leaves_open_is_said_where_it_is_stated(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    arguments = ("command", path, "--pose", *POSE)
    assert "friction" not in flexfem(*arguments, "--analytic")[1]
    plane = ("thickness_mm = 10.0", 'thickness_mm = 10.0\nmodel = "plane_stress"')  # as the finite elements
    project.edit("geometry/mobility6.toml", ("preload_n = 50.0", "preload_n = 50.0\nfriction = 0.2"), plane)
    found = json.loads(flexfem(*arguments, "--resolution", 3, "--json")[1])
    assert "actuator.base.friction" in found["not_stated"]
    one = found["criteria"]["least energy"]
    np.testing.assert_allclose(one["friction"], [2.49e-3, 2.58e-3, 9.88e-5], rtol=2e-3)
    np.testing.assert_allclose(one["element_friction"], one["friction"], rtol=5e-3)
    out = flexfem(*arguments, "--analytic")[1]
    (line,) = (line for line in out.splitlines() if line.startswith("left open by friction"))
    assert "2.49 um, 2.58 um, 98.8 urad" in line


def test_a_pose_out_of_reach_is_said(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    found = json.loads(flexfem("command", path, "--pose", "0.1", 0, 0, "--analytic", "--json")[1])
    least = found["criteria"]["least stroke"]["share"]["stroke"]
    assert least > 1
    assert f"it takes {least:.4g} times its limit of stroke" in " ".join(found["warnings"])


def test_stacks_without_preload_cannot_pull(flexfem, project, tmp_path):
    """Three single stacks turn the platform one way; the other way all would have to pull."""
    stage = package.load(project.path("geometry/mobility6.toml"))
    single = stage.actuator[0].model_copy(update={"pair": False, "preload": 0.0, "ball_radius": None})
    stage.replace(actuator=[single]).save(tmp_path / "single.toml")
    code, out, _ = flexfem("command", tmp_path / "single.toml", "--pose", 0, 0, "5e-5", "--analytic")
    assert (code, "would have to pull" in out, "none allowed" in out) == (0, False, False)
    code, out, _ = flexfem("command", tmp_path / "single.toml", "--pose", 0, 0, "-5e-5", "--analytic")
    assert (code, "would have to pull" in out, out.count("none allowed")) == (0, True, 2)  # of stroke and contact


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--pose", "nan", "0", "0"], "--pose nan 0.0 0.0"),
        (["--pose", "1e9", "0", "0"], "within"),
        (["--pose", *POSE, "--links", "--mobility", "6"], "--links --mobility 6"),
        (["--pose", *POSE, "--mobility", "7"], "mobility = 7"),
        (["--pose", *POSE, "--formula", "calibrate"], "calibrate"),
        (["--pose", *POSE, "--analytic", "--resolution", "4"], "--analytic"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(flexfem, project, arguments, said):
    code, out, err = flexfem("command", project.path("geometry/mobility6.toml"), *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


def test_a_stage_without_a_drive_is_refused(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    text = path.read_text()
    kept = text[: text.index("[[actuator]]")] + text[text.index("[provenance]") :]
    path.write_text("".join(line for line in kept.splitlines(True) if not line.startswith('"actuator.')))
    code, out, err = flexfem("command", path, "--pose", *POSE)
    assert (code, out) == (2, "")
    assert "no [[actuator]]" in err and str(path) in err


def highest(stress):
    """The cell of a highest neck stress (3, 3), with hinge and chain."""
    chain, hinge = np.argwhere(stress == np.max(stress))[0]
    return f"{np.max(stress):.4g} ({('base', 'elbow', 'platform')[hinge]}, chain {chain + 1})"


def test_rows_are_what_they_say_and_the_metal_bears_the_load(project, capsys):
    """Rotations in mrad, bands of the model and of finite elements each in its row; errors with the load on both."""
    stage = package.load(project.path("geometry/mobility6.toml"))
    rough = stage.replace(actuator=[one.model_copy(update={"friction": 0.2}) for one in stage.actuator])
    found = package.command(rough, [2e-3, -1e-3, 5e-5], [30.0, -20.0, 500.0], resolution=2)
    print_command(found)
    rows = [line.split("  ") for line in capsys.readouterr().out.splitlines()]
    said = {row[0]: [cell.strip() for cell in row[1:] if cell.strip()] for row in rows}
    criteria = list(found.criteria.values())
    assert said["largest hinge rotation (mrad)"] == [f"{1e3 * np.max(np.abs(each.rotation)):.4g}" for each in criteria]
    assert said["highest neck stress (MPa)"] == [highest(each.stress) for each in criteria]
    assert said["by finite elements, up to 4 % low"] == [highest(each.element_stress) for each in criteria]
    for row, bands in (
        ("left open by friction, at most (+-)", [each.friction for each in criteria]),
        ("the same by finite elements", [each.element_friction for each in criteria]),
    ):
        wanted = [f"{1e3 * b[0]:.3g} um, {1e3 * b[1]:.3g} um, {1e6 * b[2]:.3g} urad" for b in map(np.array, bands)]
        assert [cell.replace("0.1 mrad", "100 urad") for cell in said[row]] == wanted
    assert criteria[0].friction != criteria[0].element_friction
    missed = np.abs(found.open_loop[0].error) * [1, 1, 24.0]
    assert np.max(missed) < 0.05 * 30.0 / found.engaged[0]  # of 6 um by the load


def test_check_and_summary_know_the_actuators_that_differ_on_a_chain(flexfem, project):
    """Overrides are said and counted, and what an actuator is on one chain is not mixed with what it is on others."""
    path = project.path("geometry/mobility6.toml")
    head, _, sources = path.read_text().partition("[provenance]")
    own = '[[override]]\nchain = 1\nactuator = "base"\narm_mm = 14.0\nside = "right"\nstack = "AE0203D08"\n'
    own += '[[override]]\nchain = 3\nactuator = "elbow"\npreload_n = 20.0\n[provenance]'
    path.write_text(head + own + sources.replace('"actuator.elbow.arm_mm"', '#"actuator.elbow.arm_mm"'))
    drive = json.loads(flexfem("check", path, "--json")[1])["drive"]["actuators"]
    assert [(each["name"], each["chains"]) for each in drive] == [
        ("base", [1]), ("base", [2, 3]), ("elbow", [1, 2]), ("elbow", [3]),
    ]  # fmt: skip
    np.testing.assert_allclose(drive[0]["contacts_mm"], [(40.0, -27.5), (40.0, -36.5)], atol=1e-6)
    np.testing.assert_allclose(drive[1]["contacts_mm"], [(44.0, -36.5), (44.0, -27.5)], atol=1e-6)
    assert [round(each["blocking_force"], 6) for each in drive] == [235.0, 935.0, 935.0, 935.0]
    assert [each["preload"] for each in drive] == [50.0, 50.0, 50.0, 20.0]
    out = flexfem("check", path)[1]
    assert "drive base, chain 1: a pair of stacks AE0203D08 on frame pushing link 1, 9.1 um, 235 N" in out
    assert "drive base, chain 2 and 3: a pair of stacks AE0505D16 on frame pushing link 1, 17.4 um, 935 N" in out
    unstated = ("override.1.actuator.base.arm_mm", "override.3.actuator.elbow.preload_n", "actuator.elbow.arm_mm")
    assert all(f"  {key}: not stated" in out for key in unstated)
    plain = flexfem("summary", project.path("geometry/mobility3.toml"))[1]
    of_drive = int(plain[: plain.index(" numbers of the drive are assumed")].split()[-1])
    doubted = int((out := flexfem("summary", path)[1])[: out.index(" numbers of the drive are assumed")].split()[-1])
    assert doubted == of_drive + 2  # arm and preload of the overrides; that of the elbow is assumed, or not stated


def test_in_python_the_same(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    printed = json.loads(flexfem("command", path, "--pose", *POSE, "--mobility", 6, "--analytic", "--json")[1])
    found = package.command(package.load(path), [3e-3, -1e-3, 5e-5], mobility=6, resolution=None)
    assert found.criteria["within limits"].command == printed["criteria"]["within limits"]["command"]
    assert found.model == printed["model"] == "paros-weisbord, mobility 6, plane stress"
    with pytest.raises(package.BadInput, match="shape"):
        package.command(package.load(path), [3e-3, -1e-3])


def test_the_poses_that_a_drive_reaches_are_printed_in_the_units_they_name(project, capsys):
    """Of the record itself: ranges, by finite elements too, the limits that stop them, and what a load moves."""
    stage = package.load(project.path("geometry/mobility6.toml"))
    found = package.reach(stage, [0.7, -0.4, 7.0], resolution=2)
    print_reach(people(), found)
    out = capsys.readouterr().out
    x = found.ranges["x"]
    assert x.held is not None and found.elements is not None
    metal = found.elements["x"].held
    assert metal is not None and metal.high != x.held.high
    assert "poses that the drive reaches within all limits under 0.7 N, -0.4 N, 7 N mm, by calibrated, elastic" in out
    (line,) = (line for line in out.splitlines() if line.startswith("x, others zero"))
    for each in (x.held, metal):
        assert f"{1e3 * each.low:.4g} to {1e3 * each.high:.4g} um" in line
    assert line.index("elbow, chain 3, longest") < line.index("base, chain 3, longest")  # low end, high end
    assert "theta, others free  -1.076 to 1.079 mrad" in out
    assert f"{len(found.faces)} faces, {1e9 * found.volume:.5g} um^2 mrad; about rest a circle of" in out
    assert f"{1e3 * found.circle:.4g} um in X and Y at theta 0, and a ball of {1e3 * found.ball:.4g} um" in out
    assert "of these numbers are assumed" in out


def test_what_a_workspace_says_of_a_stage_with_and_without_a_drive(project, monkeypatch):
    """The rest of the workspace takes minutes and is not asked."""
    stage, asked = package.load(project.path("geometry/mobility3.toml")), []
    monkeypatch.setattr("flexfem.verify.workspace.workspace", lambda *given: Answer())

    class Answer:
        def model_copy(self, update):
            asked.append(update)

    package.workspace(stage, resolution=2, load=[1.0, 0.0, 0.0])
    (reached,) = (update["reach"] for update in asked)
    assert reached.load == [1.0, 0.0, 0.0] and reached.resolution == 2
    assert reached.rest[0] == pytest.approx(1 / 4694, rel=0.2)  # the engaged stage, N/mm
    package.workspace(stage.replace(actuator=[]), resolution=2)
    package.workspace(stage, resolution=2, load=[4000.0, 0.0, 0.0])
    assert asked[1] == {"no_reach": "no [[actuator]]: which poses a drive reaches is not known"}
    assert asked[2]["no_reach"].startswith("the drive reaches no pose: the limits of contact")
