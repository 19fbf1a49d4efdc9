"""What forces of the stacks add to the stiffness of the platform: elastic joints against nonlinear finite elements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.analytic.large import loaded, serial
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice
from flexfem.fem.nonlinear import preloaded
from flexfem.fem.structure import plate_of
from flexfem.mechanism.contacts import FOLLOWS
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.stage import load_stage
from flexfem.questions.drive import commanding, driven_elements
from flexfem.questions.driven import driven, neck_forces

GEOMETRY = Path(__file__).parents[2] / "geometry"
NONE = np.zeros(3)
UNLIKE = [
    (
        "[provenance]",
        '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.7\n'
        '[[override]]\nchain = 3\nhinge = "base"\nneck_mm = 0.4\nradius_mm = 3.0\n'
        '[[override]]\nchain = 1\nhinge = "platform"\nneck_mm = 0.6\n'
        '[[actuator]]\nname = "single"\nbetween = ["link 1", "link 2"]\nhinge = "platform"\narm_mm = 12.0\n'
        'side = "right"\nstack = "AE0203D16"\npreload_n = 1.5\ntilt_deg = 12.0\n\n[provenance]',
    ),
]


def changes(stage, forces, follows, resolution):
    """Relative changes (forces, disengaged and engaged, 3) of stiffness, by finite elements and by elastic joints."""
    drive, model, metal = (
        drive_of(stage),
        commanding(ModelChoice(stage, None, CALIBRATED, True)),
        driven_elements(stage, resolution),
    )
    joints = serial(stage, model.result, drive.stacks, follows)
    found = np.zeros((2, len(forces), 2, 3))
    for i, force in enumerate(forces):
        C = preloaded(metal.mesh, plate_of(stage), drive.stacks, force, NONE, follows).compliance
        of = loaded(joints, force, NONE)
        for j, stiff in enumerate((0 * drive.stiffness, drive.stiffness)):
            engaged = drive._replace(stiffness=stiff)
            K, K_rest = (np.diag(np.linalg.inv(driven(each, engaged).engaged)) for each in (C, metal.of.C))
            found[0, i, j] = K / K_rest - 1
            rest = np.diag(np.linalg.inv(driven(model.of.C, engaged).engaged))
            found[1, i, j] = np.diag(of.stiffness(stiff)) / rest - 1
    return found


@pytest.mark.parametrize("follows", [FOLLOWS[0], pytest.param(FOLLOWS[1], marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["mobility6", pytest.param("mobility3", marks=pytest.mark.slow)])
def test_preloads_of_pairs_by_nonlinear_finite_elements(name, follows):
    """Of forces that stay, +7 to -6 per cent; of stacks that hold their strokes, below 0.06 per cent."""
    stage = load_stage(GEOMETRY / f"{name}.toml")
    elements, joints = changes(stage, [drive_of(stage).preload], follows, 3)
    np.testing.assert_allclose(joints[0, 0], elements[0, 0], rtol=5e-3)
    np.testing.assert_allclose(joints[0, 1], elements[0, 1], atol=5e-6)
    assert np.min(np.abs(elements[0, 0])) > 0.03
    assert np.all(np.sign(elements) == (1 if follows == "pushed" else -1))


@pytest.mark.slow
@pytest.mark.parametrize("follows", FOLLOWS)
def test_unlike_chains_and_unequal_forces_by_nonlinear_finite_elements(project, follows):
    """The necks are loaded and the stage has moved by 40 um: what hinges of finite length do is not in the joints."""
    stage = load_stage(project.edit("geometry/mobility6.toml", *UNLIKE))
    preload = drive_of(stage).preload
    forces = [preload, preload + np.random.default_rng(3).uniform(-2, 2, len(preload))]
    elements, joints = changes(stage, forces, follows, 4)
    np.testing.assert_allclose(joints[:, 0], elements[:, 0], rtol=3e-3)
    np.testing.assert_allclose(joints[:, 1], elements[:, 1], atol=2e-4)


@pytest.mark.slow
def test_ten_newtons_in_the_base_hinges_by_both_witnesses():
    """Pairs that work against each other: 10 N in the base hinges, 320 N mm at their contacts, and nothing turns."""
    stage = load_stage(GEOMETRY / "mobility6.toml")
    model, units = (
        commanding(ModelChoice(stage, None, CALIBRATED, True)),
        np.kron(np.ones(3), np.array([[1, -1, 0, 0], [0, 0, 1, -1]])),
    )
    normal = neck_forces(stage_frames(stage), model.model.necks[..., 3:] @ units.T)[1, 0, 0]
    rows = [[normal[k], model.of.C[2, 3:] @ unit] for k, unit in enumerate(units)]
    force = np.linalg.solve(np.transpose(rows), [10.0, 0.0]) @ units
    assert np.max(np.abs(force)) == pytest.approx(16.0, abs=0.2)
    elements, joints = changes(stage, [force, -force], "pushed", 4)
    np.testing.assert_allclose(joints[:, 0], elements[:, 0], rtol=0.04)
    np.testing.assert_allclose(elements[:, 0, 0], [0.0127, -0.0127], atol=1e-4)


def test_the_stiffness_by_the_forces_of_a_command_is_that_under_its_load():
    """A load of 40 N, which the stacks mostly take: with it, not only with the forces that it gives the stacks."""
    stage, load = load_stage(GEOMETRY / "mobility6.toml"), np.array([40.0, -25.0, 300.0])
    model, drive = commanding(ModelChoice(stage, 6, DEFAULT_FORMULA, False)), drive_of(stage)
    joints = serial(stage, model.result, drive.stacks, "pushed")
    own = flexfem.Analytic(mobility=6)
    found = flexfem.drive(stage, pose=(2e-3, 1e-3, 5e-5), load=tuple(load), models="analytic", analytic=own)
    force = found.at("force", criterion="least energy")
    with_load, without = (np.diag(loaded(joints, force, each).stiffness(drive.stiffness)) for each in (load, NONE))
    state = "pushed with the forces by least energy"
    np.testing.assert_allclose(found.at("stiffness", state=state), with_load, rtol=1e-9)
    assert np.max(np.abs(with_load / without - 1)) > 1e-6
