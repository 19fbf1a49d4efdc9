"""Stiffness of the platform at rest: symmetry, energy, other routes to the same number."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.paper import (
    FREEDOMS_BY_MOBILITY,
    chosen,
    effective_load,
    influence,
    inverse_kinematics,
    mechanism,
    rank_revealing,
    stiffness,
)

from .conftest import close_loops

SERIAL = 1e-10  # seen: 1e-14 for choices by elimination, 2e-12 for the paper's while its G_p stays small


@pytest.mark.parametrize("number", [3, 6, 12, 21])
def test_stiffness_does_not_depend_on_the_dependent_joints(generic, error, number) -> None:
    of = mechanism(*generic(41), FREEDOMS_BY_MOBILITY[number])
    reference = stiffness(of).K_uu
    by_elimination = of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
    assert error(stiffness(by_elimination).K_uu, reference) < SERIAL
    rng, tried = np.random.default_rng(2), 0
    while tried < 5:
        dependent = rng.choice(len(of.joints.kind), 6, replace=False)
        K = stiffness(of._replace(choice=chosen(of.joints, ~np.isin(np.arange(len(of.joints.kind)), dependent)))).K_uu
        if np.isfinite(K).all():
            assert error(K, reference) < 1e-7  # random choices may be badly conditioned
            tried += 1


def test_joint_stiffness_is_the_slope_of_the_effective_load(generic, table, error) -> None:
    """(14), (15): K_aa = -dT_a/dphi_a at any closed configuration and load, in equilibrium or not."""
    of, load = mechanism(*generic(52), table), np.array([3.1, -2.2, 45.0])
    rng, h = np.random.default_rng(7), 1e-4
    phi = close_loops(of, rng.uniform(-0.02, 0.02, of.springs.shape))

    def T_a(shift):
        closed = close_loops(of, phi + shift)
        return effective_load(of, influence(of.frames, of.joints, of.choice, closed), closed, load)

    steps = h * np.eye(len(phi))[of.choice.independent]
    slope = (8.0 * (T_a(steps) - T_a(-steps)) - (T_a(2 * steps) - T_a(-2 * steps))).T / (12.0 * h)
    at = stiffness(of, phi, load)
    np.testing.assert_allclose(at.K_aa, -slope, rtol=0, atol=1e-7 * np.max(np.abs(at.K_aa)))  # truncation h^4
    assert error(at.K_aa, stiffness(of).K_aa) > 1e-3  # the second-order terms matter here
    scale = np.sqrt(np.abs(np.diagonal(at.K_aa)))
    np.testing.assert_allclose(scale[:, None] * at.C_aa @ at.K_aa / scale, np.eye(len(scale)), atol=1e-8)


def test_inverse_kinematics_stores_the_least_energy(generic, table) -> None:
    """Any other motion with the same pose stores more (29), and the stored energy is the work of F_u = K_uu du."""
    of, du = mechanism(*generic(49), table), np.array([0.031, -0.022, 7e-4])
    at = stiffness(of)
    best = inverse_kinematics(of, at, du)
    energy = 0.5 * np.sum(of.springs * best.joints**2)
    assert energy == pytest.approx(0.5 * du @ (at.K_uu @ du), rel=1e-8)
    free = np.linalg.svd(at.influence.G_u)[2][3:]  # motions of the independent joints that keep the pose
    for other in np.concatenate([free, -free]):
        size = 0.1 * np.linalg.norm(best.independent)
        joints = at.influence.G_a @ (best.independent + size * other)
        assert 0.5 * np.sum(of.springs * joints**2) > energy * (1.0 + 1e-9)
