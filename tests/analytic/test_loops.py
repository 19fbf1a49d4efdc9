"""The closed loops: influence coefficients of the stage and the choice of dependent joints."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.paper import (
    FREEDOMS_BY_MOBILITY,
    chain_poses,
    choose,
    chosen,
    influence,
    joints_of,
    mechanism,
    stiffness,
)
from flexfem.mechanism.designs import Frames

from .conftest import close_loops

H = 1e-4  # step of the five-point differences, rad and mm
DIFFERENCE = 3e-9  # relative; truncation H^4 and rounding eps/H are below 1e-9 where coefficients reach 1e3
ROUNDING = 1e-10  # one 6 by 6 solve with a well-chosen set of dependent joints


def moved(stage, table, seed, size=0.03):
    """A mechanism and joint displacements away from rest that close its loops."""
    of = mechanism(stage.frames, stage.compliance, table)
    phi = np.random.default_rng(seed).uniform(-size, size, of.springs.shape)
    return of, close_loops(of, phi)


def test_loops_close_at_finite_displacements(generic, table) -> None:
    of, phi = moved(generic(21), table, 1)
    pose = chain_poses(of.frames, of.joints, phi).pose
    np.testing.assert_allclose(pose, pose[:1] + np.zeros((3, 1)), rtol=0, atol=1e-12)  # rounding of a few mm
    assert np.max(np.abs(pose)) > 0.01


def slope(of, phi, function):
    """Five-point derivative of `function` of closed configurations, over each independent joint (last axis)."""
    shift = H * np.eye(len(phi))[of.choice.independent]
    near, far = (
        function(close_loops(of, phi + k * shift)) - function(close_loops(of, phi - k * shift)) for k in (1, 2)
    )
    return np.moveaxis((8.0 * near - far) / (12.0 * H), 0, -1)


def test_first_order_coefficients_are_the_slopes_of_closed_loops(generic, table) -> None:
    of, phi = moved(generic(24), table, 3)
    at = influence(of.frames, of.joints, of.choice, phi)
    G_a = slope(of, phi, lambda closed: closed)
    np.testing.assert_allclose(at.G_a, G_a, rtol=0, atol=DIFFERENCE * np.max(np.abs(at.G_a)))
    G_u = slope(of, phi, lambda closed: chain_poses(of.frames, of.joints, closed).pose[:, 0])
    np.testing.assert_allclose(at.G_u, G_u, rtol=0, atol=DIFFERENCE * np.max(np.abs(at.G_u)))


def test_second_order_coefficients_are_the_slopes_of_the_first_along_closed_loops(generic, table) -> None:
    of, phi = moved(generic(25), table, 4)
    at = influence(of.frames, of.joints, of.choice, phi)
    for name, G in (("H_p", "G_p"), ("H_u", "G_u")):
        expected = slope(of, phi, lambda closed, G=G: getattr(influence(of.frames, of.joints, of.choice, closed), G))
        found = getattr(at, name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=DIFFERENCE * np.max(np.abs(found)))
        np.testing.assert_allclose(found, np.swapaxes(found, -1, -2), rtol=0, atol=ROUNDING * np.max(np.abs(found)))


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
    slides = chosen(of.joints, ~np.isin(np.arange(len(of.joints.kind)), np.flatnonzero(of.joints.kind == 1)[:6]))
    assert np.isnan(stiffness(of._replace(choice=slides)).K_uu).all()
