"""The closed loops, influence coefficients and the choice of dependent joints; stiffness at rest by
other routes.
"""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.equations import (
    FREEDOMS_BY_MOBILITY,
    chain_poses,
    choose,
    chosen,
    effective_load,
    influence,
    inverse_kinematics,
    joints_of,
    mechanism,
    rank_revealing,
    stiffness,
)
from flexfem.paper.frames import Frames

from ..tolerances import DENSE
from .conftest import close_loops

H = 1e-4  # step of the five-point differences, rad and mm
DIFFERENCE = (
    3e-9  # relative; truncation H^4 and rounding eps/H are below 1e-9 where coefficients reach 1e3
)
ROUNDING = DENSE  # one 6 by 6 solve with a well-chosen set of dependent joints
# seen: 1e-14 for choices by elimination, 2e-12 for the paper\'s while its G_p stays small
SERIAL = DENSE


def moved(stage, table, seed, size=0.03):
    """A mechanism and joint displacements away from rest that close its loops."""
    of = mechanism(stage.frames, stage.compliance, table)
    phi = np.random.default_rng(seed).uniform(-size, size, of.springs.shape)
    return of, close_loops(of, phi)


def test_loops_close_at_finite_displacements(generic, table) -> None:
    of, phi = moved(generic(21), table, 1)
    pose = chain_poses(of.frames, of.joints, phi).pose
    np.testing.assert_allclose(
        pose, pose[:1] + np.zeros((3, 1)), rtol=0, atol=1e-12
    )  # rounding of a few mm
    assert np.max(np.abs(pose)) > 0.01


def slope(of, phi, function):
    """Five-point derivative of `function` of closed configurations, over each independent joint
    (last axis).
    """
    shift = H * np.eye(len(phi))[of.choice.independent]
    near, far = (
        function(close_loops(of, phi + k * shift)) - function(close_loops(of, phi - k * shift))
        for k in (1, 2)
    )
    return np.moveaxis((8.0 * near - far) / (12.0 * H), 0, -1)


def test_first_order_coefficients_are_the_slopes_of_closed_loops(generic, table) -> None:
    of, phi = moved(generic(24), table, 3)
    at = influence(of.frames, of.joints, of.choice, phi)
    G_a = slope(of, phi, lambda closed: closed)
    np.testing.assert_allclose(at.G_a, G_a, rtol=0, atol=DIFFERENCE * np.max(np.abs(at.G_a)))
    G_u = slope(of, phi, lambda closed: chain_poses(of.frames, of.joints, closed).pose[:, 0])
    np.testing.assert_allclose(at.G_u, G_u, rtol=0, atol=DIFFERENCE * np.max(np.abs(at.G_u)))


def test_second_order_coefficients_are_the_slopes_of_the_first_along_closed_loops(
    generic, table
) -> None:
    of, phi = moved(generic(25), table, 4)
    at = influence(of.frames, of.joints, of.choice, phi)
    for name, G in (("H_p", "G_p"), ("H_u", "G_u")):
        expected = slope(
            of,
            phi,
            lambda closed, G=G: getattr(influence(of.frames, of.joints, of.choice, closed), G),
        )
        found = getattr(at, name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=DIFFERENCE * np.max(np.abs(found)))
        np.testing.assert_allclose(
            found, np.swapaxes(found, -1, -2), rtol=0, atol=ROUNDING * np.max(np.abs(found))
        )


def test_the_papers_independent_joints_are_taken_where_it_names_them(generic) -> None:
    stage = generic(26)
    for number, hinges in ((3, {0}), (6, {0, 1})):
        joints = joints_of(FREEDOMS_BY_MOBILITY[number])
        independent = choose(stage.frames, joints, np.ones(len(joints.kind))).independent
        assert len(independent) == number and set(joints.kind[independent]) == {0}
        assert set(joints.hinge[independent]) == hinges


@pytest.mark.parametrize("number", [12, 21])
def test_parallel_neck_axes_do_not_make_the_choice_singular(generic, number) -> None:
    stage = generic(28)
    parallel = Frames(stage.frames.centres, np.full((3, 3), 0.4))
    of = mechanism(parallel, stage.compliance, FREEDOMS_BY_MOBILITY[number])
    assert np.all(np.isfinite(stiffness(of).K_uu))
    slides = chosen(
        of.joints, ~np.isin(np.arange(len(of.joints.kind)), np.flatnonzero(of.joints.kind == 1)[:6])
    )
    assert np.isnan(stiffness(of._replace(choice=slides)).K_uu).all()


@pytest.mark.parametrize("number", [3, 6, 12, 21])
def test_stiffness_does_not_depend_on_the_dependent_joints(generic, error, number) -> None:
    of = mechanism(*generic(41), FREEDOMS_BY_MOBILITY[number])
    reference = stiffness(of).K_uu
    by_elimination = of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
    assert error(stiffness(by_elimination).K_uu, reference) < SERIAL
    rng = np.random.default_rng(2)
    tried = 0
    while tried < 5:
        dependent = rng.choice(len(of.joints.kind), 6, replace=False)
        K = stiffness(
            of._replace(
                choice=chosen(of.joints, ~np.isin(np.arange(len(of.joints.kind)), dependent))
            )
        ).K_uu
        if np.isfinite(K).all():
            assert error(K, reference) < 1e-7  # random choices may be badly conditioned
            tried += 1


def test_joint_stiffness_is_the_slope_of_the_effective_load(generic, table, error) -> None:
    """(14), (15): K_aa = -dT_a/dphi_a at any closed configuration and load, in equilibrium or not."""
    of = mechanism(*generic(52), table)
    load = np.array([3.1, -2.2, 45.0])
    rng = np.random.default_rng(7)
    h = 1e-4
    phi = close_loops(of, rng.uniform(-0.02, 0.02, of.springs.shape))

    def T_a(shift):
        closed = close_loops(of, phi + shift)
        return effective_load(of, influence(of.frames, of.joints, of.choice, closed), closed, load)

    steps = h * np.eye(len(phi))[of.choice.independent]
    slope = (8.0 * (T_a(steps) - T_a(-steps)) - (T_a(2 * steps) - T_a(-2 * steps))).T / (12.0 * h)
    at = stiffness(of, phi, load)
    np.testing.assert_allclose(
        at.K_aa, -slope, rtol=0, atol=1e-7 * np.max(np.abs(at.K_aa))
    )  # truncation h^4
    assert error(at.K_aa, stiffness(of).K_aa) > 1e-3  # the second-order terms matter here
    scale = np.sqrt(np.abs(np.diagonal(at.K_aa)))
    np.testing.assert_allclose(
        scale[:, None] * at.C_aa @ at.K_aa / scale, np.eye(len(scale)), atol=1e-8
    )


def test_inverse_kinematics_stores_the_least_energy(generic, table) -> None:
    """Any other motion with the same pose stores more (29), and the stored energy is the work of
    F_u = K_uu du.
    """
    of = mechanism(*generic(49), table)
    du = np.array([0.031, -0.022, 7e-4])
    at = stiffness(of)
    best = inverse_kinematics(of, at, du)
    energy = 0.5 * np.sum(of.springs * best.joints**2)
    assert energy == pytest.approx(0.5 * du @ (at.K_uu @ du), rel=DENSE)
    free = np.linalg.svd(at.influence.G_u)[2][
        3:
    ]  # motions of the independent joints that keep the pose
    for other in np.concatenate([free, -free]):
        size = 0.1 * np.linalg.norm(best.independent)
        joints = at.influence.G_a @ (best.independent + size * other)
        assert 0.5 * np.sum(of.springs * joints**2) > energy * (1.0 + 1e-9)
