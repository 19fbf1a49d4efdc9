"""Mobility and the tables of joint freedoms, and finite poses of the chains."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.equations import (
    FREEDOMS_BY_MOBILITY,
    chain_poses,
    freedoms_of,
    gruebler_kutzbach,
    joints_of,
    mobility,
)
from flexfem.paper.frames import frames


@pytest.mark.parametrize("expected", [3, 6, 12, 21])
def test_the_tables_have_the_mobility_they_are_named_after(expected: int) -> None:
    assert mobility(FREEDOMS_BY_MOBILITY[expected]) == expected
    assert joints_of(freedoms_of(expected)).mobility == expected


def test_known_mechanisms_have_their_known_mobility() -> None:
    assert gruebler_kutzbach(4, [1, 1, 1, 1]) == 1  # four-bar linkage
    assert gruebler_kutzbach(5, [1, 1, 1, 1, 1]) == 2  # five-bar linkage
    assert (
        gruebler_kutzbach(14, [2] * 6 + [1] * 6 + [3] * 6, dimension=6) == 6
    )  # Stewart platform, universal below


def displaced(count, seed):
    """Joint displacements of a tenth of a radian and of a millimetre: far from rest."""
    return np.random.default_rng(seed).uniform(-0.1, 0.1, count) * 3.0


def test_pose_is_the_papers_sum_of_links(generic) -> None:
    """(19)-(21) with the prismatic joint along link 1, l1 = l10 + s."""
    lengths = np.array([29.0, 33.5, 22.7])
    angles = np.radians([171.0, -83.0, 97.0])
    joints = joints_of(FREEDOMS_BY_MOBILITY[6])
    phi = displaced(12, 5)
    found = chain_poses(frames(lengths, angles), joints, phi).pose[0]
    before = np.cumsum(angles)
    after = np.cumsum(angles + phi[[0, 2, 3]])
    stretched = lengths + np.array([phi[1], 0.0, 0.0])
    x = np.sum(stretched * np.cos(after)) - np.sum(lengths * np.cos(before))
    y = np.sum(stretched * np.sin(after)) - np.sum(lengths * np.sin(before))
    np.testing.assert_allclose(
        found, [x, y, phi[[0, 2, 3]].sum()], rtol=0, atol=1e-13
    )  # rounding of 30 mm


def test_a_hinge_slides_along_its_own_turned_axis(generic) -> None:
    joints = joints_of(FREEDOMS_BY_MOBILITY[21])
    stage = generic(8)
    phi = displaced(27, 8)
    for n in np.flatnonzero(joints.kind > 0):
        i = joints.chain[n]
        j = joints.hinge[n]
        before = (joints.chain == i) & (joints.hinge <= j) & (joints.kind == 0)
        angle = stage.frames.axes[i, j] + phi[before].sum() + 0.5 * np.pi * (joints.kind[n] == 2)
        moved = chain_poses(stage.frames, joints, phi + 0.5 * (np.arange(27) == n)).pose[i]
        still = chain_poses(stage.frames, joints, phi).pose[i]
        np.testing.assert_allclose(
            moved - still, [0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0], atol=1e-13
        )
