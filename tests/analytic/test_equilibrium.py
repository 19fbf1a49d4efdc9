"""Exact equilibrium at finite displacements, and (16) as its tangent."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.equations import FREEDOMS_BY_MOBILITY, mechanism, stiffness
from flexfem.paper.equilibrium import at_pose, under_load
from flexfem.refused import ComputationFailed

from ..tolerances import DENSE

TANGENT = 1e-6  # truncation of the central difference is below 1e-7 for a step of 1e-4 of the load
COMMAND = np.array([0.31, -0.24, 0.012])  # mm, mm, rad: ten times the strokes of the paper


def loaded(stage, table):
    """A mechanism and a load that moves its platform by about COMMAND."""
    of = mechanism(*stage, table)
    return of, stiffness(of).K_uu @ COMMAND


def slope(of, load):
    """Central-difference compliance of the exact equilibrium."""
    h = 1e-4 * np.abs(load).max() * np.array([1.0, 1.0, 30.0])
    pose = under_load(of, load + np.stack([np.diag(h), -np.diag(h)])).pose
    return ((pose[0] - pose[1]) / (2 * h[:, None])).T


def test_loaded_stiffness_is_the_tangent_of_exact_equilibrium(generic, table, error) -> None:
    of, load = loaded(generic(61), table)
    at = under_load(of, load)
    tangent = stiffness(of, at.displacement, load)
    assert error(slope(of, load), tangent.C_uu) < TANGENT
    assert (
        error(stiffness(of).C_uu, tangent.C_uu) > 1e-3
    )  # the load matters: the test is not one of the rest stiffness


def test_holding_a_pose_takes_the_load_that_leads_there(generic, table) -> None:
    of, load = loaded(generic(68), table)
    at = under_load(of, load)
    held = at_pose(of, at.pose)
    np.testing.assert_allclose(held.load, load, rtol=DENSE)
    np.testing.assert_allclose(held.pose, at.pose, rtol=0, atol=DENSE)
    np.testing.assert_allclose(held.displacement, at.displacement, rtol=0, atol=DENSE)


def test_a_batch_of_designs_and_loads_is_its_members_one_by_one(generic, table) -> None:
    stage = generic(69, 4)
    of = mechanism(*stage, table)
    loads = np.einsum("dij,lj->ldi", stiffness(of).K_uu, np.array([COMMAND, -0.3 * COMMAND]))
    together = under_load(of, loads)
    assert together.pose.shape == (2, 4, 3)
    for d in range(4):
        one = mechanism(*(type(part)(*(a[d] for a in part)) for part in stage), table)
        for k in range(2):
            np.testing.assert_allclose(
                together.pose[k, d], under_load(one, loads[k, d]).pose, rtol=DENSE
            )


def test_a_load_beyond_every_equilibrium_is_an_error(generic) -> None:
    of = mechanism(*generic(71), FREEDOMS_BY_MOBILITY[3])
    with pytest.raises(ComputationFailed, match=r"holding the pose.*did not converge"):
        at_pose(of, np.array([500.0, 0.0, 0.0]))
    with pytest.raises(ComputationFailed, match=r"holding the pose, design \(1,\) the first of 1"):
        at_pose(of, np.array([[0.1, 0.0, 0.0], [500.0, 0.0, 0.0]]))


def test_a_singular_design_is_nan_and_spares_the_others(generic) -> None:
    stage = generic(72, 2)
    centres = stage.frames.centres.copy()
    centres[0, :, 1] = 2.0 * centres[0, :, 2]
    of = mechanism(
        stage.frames._replace(centres=centres), stage.compliance, FREEDOMS_BY_MOBILITY[3]
    )
    at = under_load(of, np.array([1.0, 0.5, 3.0]))
    assert np.isnan(at.pose[0]).all() and np.isfinite(at.pose[1]).all()
