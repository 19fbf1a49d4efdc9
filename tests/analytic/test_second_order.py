"""The second-order terms of (16): nothing at rest, a third of every first-order change, and only
together a number.
"""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.equations import FREEDOMS_BY_MOBILITY, dot, mechanism, rank_revealing, stiffness
from flexfem.paper.equilibrium import at_pose, axis_poses, linear_errors, summed_loads

POSE = np.array([0.31, -0.24, 0.012])  # mm, mm, rad
LEVER = 24.0  # mm
SUM = 1e-8  # four places of Gauss in each of ten parts of the way, and differences of loads
DIFFERENCE = 6e-10  # central differences with a step of 1e-3 of the way


def tangents(of, pose):
    """Tangent stiffness at poses, with the second-order terms and without."""
    exact = at_pose(of, pose)
    return {"tangent": exact.stiffness(), "without": exact.without_terms.stiffness()}


@pytest.fixture
def of(generic, table):
    return mechanism(*generic(81), table)


def test_the_tangent_is_the_slope_of_the_exact_load(of) -> None:
    found = tangents(of, POSE)
    steps = np.diag(1e-3 * POSE)
    for axis, (ahead, behind) in enumerate(
        zip(at_pose(of, POSE + steps).load, at_pose(of, POSE - steps).load, strict=True)
    ):
        slope = (ahead - behind) / (2e-3 * POSE[axis])
        np.testing.assert_allclose(
            found["tangent"][:, axis], slope, atol=DIFFERENCE * np.abs(slope).max()
        )
        assert np.abs(found["without"][:, axis] - slope).max() > 1e-4 * np.abs(slope).max()


@pytest.mark.parametrize("axis", range(3))
def test_the_tangent_summed_along_the_way_is_the_exact_load(of, axis) -> None:
    commanded = np.abs(POSE[axis]) * np.linspace(-1, 1, 21)
    exact = at_pose(of, axis_poses(commanded, axis)).load
    found = summed_loads(of, commanded, axis)
    scale = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(found["tangent"] / scale, exact / scale, atol=SUM)
    assert np.abs((found["without"] - exact) / scale).max() > 1e-4
    assert not found["tangent"][10].any() and not found["without"][10].any()


def test_the_terms_are_a_third_of_the_first_order_change_whatever_the_stage(of) -> None:
    """The energy of third order is `k phi_1 phi_2 u^3` with joints `phi = phi_1 u + phi_2 u^2`: its
    second derivative is 6, `(d phi/du)^2 k` alone 4 of the same."""
    rest = stiffness(of).K_uu.diagonal()
    steps = np.diag(1e-3 * POSE)
    ahead = tangents(of, steps)
    behind = tangents(of, -steps)
    axis = np.arange(3)
    tangent, without = (
        (ahead[name] - behind[name])[axis, axis, axis] / rest for name in ("tangent", "without")
    )
    assert np.all(np.abs(tangent) > 1e-7)
    np.testing.assert_allclose(without / tangent, 2 / 3, atol=5e-8)


def test_both_terms_together_do_not_depend_on_the_independent_joints_and_each_alone_does(
    generic,
) -> None:
    of = mechanism(*generic(82), FREEDOMS_BY_MOBILITY[6])
    other = of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
    assert other.choice.independent.tolist() != of.choice.independent.tolist()
    found = []
    alone = []
    for each in (of, other):
        found.append(tangents(each, POSE))
        exact = at_pose(each, POSE)
        at = stiffness(each, exact.displacement, exact.load)
        G_u = at.influence.G_u
        one = at.K_aa + dot(exact.load, at.influence.H_u)  # (16) without the load's term
        alone.append(np.linalg.inv(G_u @ np.linalg.inv(one) @ G_u.T))
    for name in ("tangent", "without"):
        one, two = (tangent[name] for tangent in found)
        np.testing.assert_allclose(one, two, atol=1e-7 * np.abs(one).max())
    assert np.abs(np.diag(alone[0]) / np.diag(alone[1]) - 1).max() > 1e-3


def test_what_a_box_misses_grows_with_it_and_vanishes_with_it(of) -> None:
    near, far = (linear_errors(of, part * np.abs(POSE), LEVER) for part in (1e-3, 1e-2))
    for small, large in zip(near, far, strict=True):
        assert large / small == pytest.approx(10.0, rel=0.005)  # what follows the first order
