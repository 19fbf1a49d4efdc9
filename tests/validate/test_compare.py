"""What two solvers differ by, on made-up answers; and how much of it is allowed."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.validate.compare import field_difference, neck_difference, pose_difference, thin_tolerance
from flexfem.validate.records import Check


def test_poses_differ_relative_to_the_largest_of_ours_with_rotations_at_the_lever() -> None:
    ours = np.diag([0.025, 0.020, 2e-5])
    for place, change, expected in (
        ((0, 0), 1e-6, 1e-6 / 0.025),
        ((2, 2), -1e-9, 1e-9 * 30**2 / 0.025),
        ((0, 2), 1e-8, 1e-8 * 30 / 0.025),
    ):
        theirs = ours.copy()
        theirs[place] += change
        assert pose_difference(ours, theirs, 30.0) == pytest.approx(expected, rel=1e-6)
    stiff = np.diag([1e-3, 2e-3, 2e-5])  # 0.018 at the lever is the largest
    assert pose_difference(stiff, stiff + np.diag([1e-6, 0, 0]), 30.0) == pytest.approx(1e-6 / 0.018, rel=1e-6)


def test_fields_and_neck_stresses_differ_load_by_load_relative_to_the_largest_of_each() -> None:
    ours = np.zeros((3, 5, 2))
    ours[:, 2, 1] = [2.0, 40.0, 800.0]
    theirs = ours.copy()
    theirs[1, 4, 0] = -0.1
    theirs[2, 0, 0] = 1.0
    assert field_difference(ours, theirs) == pytest.approx(0.1 / 40.0)
    stress = np.ones((3, 3, 3)) * np.array([5.0, 10.0, 200.0])[:, None, None]
    stress[0, 2, 2] = 8.0
    other = stress.copy()
    other[0, 1, 1] -= 0.4
    other[2, 0, 2] += 4.0
    assert neck_difference(stress, other) == pytest.approx(0.4 / 8.0)


def test_a_thin_sheet_may_differ_by_the_square_of_the_coarseness() -> None:
    assert thin_tolerance(1) / thin_tolerance(2) == 4.0
    assert thin_tolerance(64) == thin_tolerance(128) <= thin_tolerance(4)


def test_a_check_passes_up_to_its_limit_and_never_without_a_number() -> None:
    found = [Check("a", value, 1e-6).passed for value in (0.99e-6, 1.01e-6, float("nan"))]
    assert found == [True, False, False]
    assert Check("a", 0.5, None).passed
