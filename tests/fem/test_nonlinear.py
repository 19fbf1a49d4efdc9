"""Large displacements: exact elasticas, rotations without strain, gradients, conservation, and
refusals.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from flexfem.fem import nonlinear
from flexfem.fem.elements import Plate
from flexfem.fem.factor import Factoriser
from flexfem.fem.nonlinear import LargeStructure, equilibrium, imposed
from flexfem.fem.structure import structure
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.refused import ComputationFailed

from ..conftest import with_changes
from ..tolerances import DENSE, SOLVED
from .conftest import bar

BEAM = (
    3e-5  # a bar 400 times as long as high is a Bernoulli beam to (h/L)^2, and its mesh is as fine
)
DIFFERENCE = 3e-7  # central differences with a step of 1e-5 of the length
SMALL = 1e-6  # a displacement of a millionth of the lengths is linear to about that

PLATE = Plate(youngs_modulus=6.83e4, poissons_ratio=0.29, thickness=1.7)
LENGTH = 21.0
HEIGHT = 1.3
SLENDER = Plate(youngs_modulus=6.83e4, poissons_ratio=0.0, thickness=1.7)
SLENDER_LENGTH = 400.0
SLENDER_HEIGHT = 1.0
EI = SLENDER.youngs_modulus * SLENDER.thickness * SLENDER_HEIGHT**3 / 12
OFFSET = np.array([-1.9, 0.8])  # mm, from the bar's end to the hub's centre, off every axis
LOAD = np.array([31.0, -17.0, 740.0])  # N and N mm: bends the short bar by about 0.4 rad


@pytest.fixture(scope="module")
def eccentric():
    """A short bar whose hub turns about a point outside of it."""
    mesh = bar(LENGTH, HEIGHT, 8, 1)
    return mesh._replace(nodes=mesh.nodes + OFFSET)


def bent(mesh, pose, plate=PLATE, seed=29):
    """Any large displacement, with the hub at a pose, and the stress that belongs to it."""
    model = LargeStructure(structure(mesh, plate))
    field = 0.03 * np.random.default_rng(seed).normal(size=mesh.nodes.shape)
    field[np.unique(mesh.edges["ground"])] = 0.0
    return model, model.at(pose, field)


def moved(model, state, change):
    """The state after a change (2f + 3,) of the unknowns."""
    field = state.field.copy()
    field[model.structure.free] += change[:-3].reshape(-1, 2)
    return model.at(state.pose + change[-3:], field)


@pytest.mark.parametrize("turns", [0.25, 1.0, -1.0])
def test_an_end_moment_bends_a_cantilever_into_an_arc_and_2_pi_EI_over_L_into_a_circle(turns):
    """A bar of height h and St. Venant-Kirchhoff material bends by `(kappa h)^2 / 2` more than
    Bernoulli's beam.

    `0.3 (kappa h)^2` come from its law in stretch and compression, `0.2 (kappa h)^2` from the
    radial stress, which changes its height; its energy is larger by `0.75 (kappa h)^2`. With the
    moment given, to second order."""
    mesh = bar(SLENDER_LENGTH, SLENDER_HEIGHT, 400, 1)
    angle = 2 * np.pi * turns
    excess = (angle * SLENDER_HEIGHT / SLENDER_LENGTH) ** 2
    found = equilibrium(mesh, SLENDER, np.array([0.0, 0.0, angle * EI / SLENDER_LENGTH]))
    turn = angle * (1 + excess / 2)
    x = np.sin(turn) / turn - 1
    y = (1 - np.cos(turn)) / turn
    np.testing.assert_allclose(found.pose[0, :2] / SLENDER_LENGTH, [x, y], rtol=0, atol=BEAM)
    assert found.pose[0, 2] == pytest.approx(turn, rel=BEAM)
    assert found.energy[0] == pytest.approx(
        (1 + 0.75 * excess) * angle**2 * EI / SLENDER_LENGTH / 2, rel=BEAM
    )


@pytest.mark.parametrize(
    "pose", [np.zeros(3), np.array([0.7, -1.1, 0.9]), np.array([-9.0, 4.0, -2.6])]
)
def test_forces_are_the_gradient_of_the_energy_and_the_tangent_that_of_the_forces(eccentric, pose):
    model, state = bent(eccentric, pose)
    step = 1e-5
    size = model.structure.size
    ends = [
        [model.internal(moved(model, state, sign * step * unit)) for sign in (1.0, -1.0)]
        for unit in np.eye(size)
    ]
    gradient = np.array([ahead.energy - behind.energy for ahead, behind in ends]) / (2 * step)
    stiffness = np.array([ahead.forces - behind.forces for ahead, behind in ends]).T / (2 * step)
    forces = model.internal(state).forces
    lower = model.tangent(state)
    np.testing.assert_allclose(gradient, forces, rtol=0, atol=DIFFERENCE * np.abs(forces).max())
    whole = (lower + sp.tril(lower, -1).T).toarray()
    scale = np.abs(whole).max(axis=1, keepdims=True)
    assert np.abs((whole - stiffness) / scale).max() < DIFFERENCE


def test_small_loads_and_small_poses_find_the_linear_compliance(each):
    C = each.response.compliance
    plate = plate_of(each.stage)
    lever = np.array([1.0, 1.0, 25.0])
    for load in 1e-5 * np.diag([1.0, 1.0, 25.0]):
        found = equilibrium(each.mesh, plate, load)
        held = imposed(each.mesh, plate, C @ load)
        size = np.abs(lever * (C @ load)).max()
        np.testing.assert_allclose(
            lever * found.pose[0], lever * (C @ load), rtol=0, atol=SMALL * size
        )
        np.testing.assert_allclose(
            held.load[0] / lever, load / lever, rtol=0, atol=SMALL * np.abs(load / lever).max()
        )
        assert found.energy[0] == pytest.approx(load @ C @ load / 2, rel=SMALL)
        scale = np.outer(lever, lever)
        np.testing.assert_allclose(
            found.compliance[0] * scale, C * scale, atol=SMALL * np.abs(C * scale).max()
        )


def test_the_held_pose_and_the_load_that_holds_it_find_one_another(unlike):
    plate = plate_of(unlike.stage)
    pose = np.array([[0.21, -0.13, 4e-3], [-0.05, 0.02, 9e-3]])
    held = imposed(unlike.mesh, plate, pose)
    found = equilibrium(unlike.mesh, plate, held.load)
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=SOLVED * 0.21)
    np.testing.assert_allclose(found.energy, held.energy, rtol=SOLVED)
    np.testing.assert_allclose(found.fields, held.fields, rtol=0, atol=SOLVED * 0.21)
    assert (
        np.abs(pose - held.load @ unlike.response.compliance).max() > 1e-3
    )  # and the displacement is large


def test_thin_necks_leave_no_rounding_in_the_load_that_holds_a_pose():
    """Stiff bodies on soft necks: rounding of the bodies' stress is up to a millionth of the force
    on the stage.
    """
    stage = with_changes({f"hinges.{name}.neck_mm": 0.01 for name in ("base", "elbow", "platform")})
    mesh = build_mesh(stage, 2)
    plate = plate_of(stage)
    pose = np.array([0.04, -0.02, 1e-3])
    held = imposed(mesh, plate, pose)
    np.testing.assert_allclose(
        equilibrium(mesh, plate, held.load).pose[0], pose, rtol=0, atol=SOLVED * pose[0]
    )


def test_the_tangent_compliance_is_the_change_of_the_equilibrium(eccentric):
    found = equilibrium(eccentric, PLATE, LOAD)
    C = found.compliance[0]
    steps = np.diag([1e-3, 1e-3, 1e-2])
    for column, step in enumerate(steps):
        ahead, behind = equilibrium(eccentric, PLATE, np.array([LOAD + step, LOAD - step])).pose
        expected = (ahead - behind) / (2 * step[column])
        np.testing.assert_allclose(
            C[:, column], expected, rtol=0, atol=1e-6 * np.abs(C[:, column]).max()
        )
    np.testing.assert_allclose(C, C.T, rtol=0, atol=SOLVED * np.abs(C).max())
    at_rest = equilibrium(eccentric, PLATE, np.zeros(3)).compliance[0]
    assert np.abs(C / at_rest - 1).max() > 0.1


def test_a_straight_column_is_unstable_beyond_eulers_load():
    mesh = bar(60.0, 1.0, 60, 1)
    euler = np.pi**2 * EI / (4 * 60.0**2)
    found = equilibrium(
        mesh, SLENDER, np.array([[-0.99 * euler, 0.0, 0.0], [-1.01 * euler, 0.0, 0.0]])
    )
    assert (np.linalg.eigvalsh(found.compliance)[:, 0] > 0).tolist() == [True, False]
    np.testing.assert_allclose(found.pose[:, 1:], 0.0, atol=SOLVED)


@pytest.mark.parametrize("installed", [True, False], ids=["the one installed", "superlu"])
def test_an_indefinite_matrix_is_solved(monkeypatch, installed):
    if not installed:
        monkeypatch.setattr("flexfem.fem.cholmod.find_spec", lambda name: None)
    factorise = Factoriser()
    x = np.array([[3.0], [-1.0], [2.0]])
    for corner in (2.0, -2.0, 5.0):
        K = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, -1.0], [0.0, -1.0, corner]])
        np.testing.assert_allclose(factorise(sp.csr_array(np.tril(K)))(K @ x), x, rtol=DENSE)
    with pytest.raises(ComputationFailed, match=r"singular"):
        factorise(sp.csr_array(np.diag([2.0, 0.0, 1.0])))


def test_a_matrix_with_another_pattern_is_ordered_anew():
    factorise = Factoriser()
    size = 60
    chain = sp.diags_array([np.full(size, 4.0), np.full(size - 1, -1.0)], offsets=[0, -1]).tocsr()
    places = (np.arange(size - 1, size // 2 - 1, -1), np.arange(size // 2))
    far = sp.coo_array((np.full(size // 2, -0.9), places), shape=(size, size))
    x = np.random.default_rng(3).normal(size=(size, 1))
    for lower in (chain, sp.csr_array(chain + far), chain):
        whole = lower + sp.tril(lower.tocsc(), -1).T
        np.testing.assert_allclose(factorise(lower)(whole @ x), x, rtol=0, atol=DENSE)


def test_entries_of_a_row_are_taken_in_any_order():
    factorise = Factoriser()
    x = np.array([[1.0], [-2.0]])
    for scale in (1.0, 3.0):  # the second has the pattern of the first
        lower = sp.csr_array(
            (scale * np.array([100.0, 2.0, 1.0]), np.array([0, 1, 0]), np.array([0, 1, 3]))
        )
        np.testing.assert_allclose(
            factorise(lower)(scale * np.array([[100.0, 1.0], [1.0, 2.0]]) @ x), x, rtol=DENSE
        )


@pytest.mark.parametrize(
    "load", [1e6 * LOAD, np.array([-1e5, 0.0, 0.0]), np.array([np.nan, 0.0, 0.0])]
)
def test_an_absurd_load_is_refused(eccentric, load):
    with pytest.raises(
        ComputationFailed, match=r"no equilibrium under the load .* % of the target|strain of"
    ):
        equilibrium(eccentric, PLATE, load)


@pytest.mark.parametrize(
    ("stretch", "accepted"), [(0.264, True), (0.266, False), (-0.361, True), (-0.39, False)]
)
def test_strains_beyond_three_tenths_are_refused(stretch, accepted):
    """A bar without contraction is strained evenly, by e + e^2/2: 0.2988, 0.3014, -0.2958 and
    -0.3140.
    """
    mesh = bar(3.0, 1.0, 3, 1)
    if accepted:
        found = imposed(mesh, SLENDER, np.array([3.0 * stretch, 0.0, 0.0])).strain[0]
        assert found == pytest.approx(abs(stretch + stretch**2 / 2), rel=1e-6)
    else:
        with pytest.raises(ComputationFailed, match=r"strain of 0\.3\d?, expected at most 0\.3"):
            imposed(mesh, SLENDER, np.array([3.0 * stretch, 0.0, 0.0]))


def test_a_load_step_ends_when_its_newton_steps_no_longer_shrink(monkeypatch):
    """Steps of the size of those near a limit, which come to nothing in 25 iterations either."""
    sizes = iter([9.0, 0.35, 40.0, 13.0, 0.36, 3.7, 1.2, 4.4])
    still = nonlinear._Step(None, 0.0, 300.0, 0.02, np.zeros((3, 3)), None)
    monkeypatch.setattr(nonlinear, "_step", lambda *_: still._replace(size=next(sizes)))
    assert nonlinear._newton(None, None, np.zeros(1), [0], 0.0) == (None, 5)
