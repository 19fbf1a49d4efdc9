"""Mobility by Gruebler-Kutzbach and the tables of joint freedoms."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.paper import (
    FREEDOMS_BY_MOBILITY,
    freedoms_of,
    gruebler_kutzbach,
    joints_of,
    mobility,
    stage_freedoms,
)
from flexfem.refused import BadInput


@pytest.mark.parametrize("expected", [3, 6, 12, 21])
def test_the_tables_have_the_mobility_they_are_named_after(expected: int) -> None:
    assert mobility(FREEDOMS_BY_MOBILITY[expected]) == expected
    assert joints_of(freedoms_of(expected)).mobility == expected


def test_known_mechanisms_have_their_known_mobility() -> None:
    assert gruebler_kutzbach(4, [1, 1, 1, 1]) == 1  # four-bar linkage
    assert gruebler_kutzbach(5, [1, 1, 1, 1, 1]) == 2  # five-bar linkage
    assert gruebler_kutzbach(14, [2] * 6 + [1] * 6 + [3] * 6, dimension=6) == 6  # Stewart platform, universal below


def test_every_prismatic_hinge_adds_one() -> None:
    flags = np.zeros((3, 3), dtype=bool)
    for n, place in enumerate(np.ndindex(3, 3), start=1):
        flags[place] = True
        assert mobility(stage_freedoms(flags)) == 3 + n


def test_prismatic_base_hinges_are_the_mobility_six_of_the_paper() -> None:
    assert stage_freedoms(np.array([[True, False, False]] * 3)) == FREEDOMS_BY_MOBILITY[6]


def test_joints_run_from_base_to_platform() -> None:
    joints = joints_of(FREEDOMS_BY_MOBILITY[6])
    assert joints.chain.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert joints.hinge[:4].tolist() == [0, 0, 1, 2] and joints.kind[:4].tolist() == [0, 1, 0, 0]  # phi_1 s phi_2 phi_3


R = ("rotation",)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (((R, R), (R, R), (R, R)), "3 chains by 3 hinges"),
        (((R, R, R),) * 2, "3 chains by 3 hinges"),
        (((R, R, R), (R, ("axial",), R), (R, R, R)), "chain 2, hinge 2 .*expected rotation"),
        (((R, R, R), (R, R, R), (R, R, ())), "chain 3, hinge 3 .*expected rotation"),
        (((R, R, R), (R, R, R), (R, R, ("rotation", "twist"))), "rotation, axial, shear at most once"),
        (((R, R, R), (R, R, R), (R, R, ("rotation", "rotation"))), "at most once"),
    ],
)
def test_tables_that_are_no_mechanism_are_refused(table: tuple, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        joints_of(table)


@pytest.mark.parametrize("number", [0, 2, 4, 27])
def test_a_mobility_without_a_uniform_table_is_refused(number: int) -> None:
    with pytest.raises(BadInput, match=f"mobility = {number}, expected one of 3, 6, 12, 21"):
        freedoms_of(number)


def test_prismatic_flags_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(BadInput, match="3 chains by 3 hinges"):
        stage_freedoms(np.zeros((3, 2), dtype=bool))
