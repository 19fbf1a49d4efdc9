"""Mobility by Gruebler-Kutzbach and the tables of joint freedoms."""

from __future__ import annotations

import pytest

from flexfem.analytic.paper import (
    FREEDOMS_BY_MOBILITY,
    freedoms_of,
    gruebler_kutzbach,
    joints_of,
    mobility,
)


@pytest.mark.parametrize("expected", [3, 6, 12, 21])
def test_the_tables_have_the_mobility_they_are_named_after(expected: int) -> None:
    assert mobility(FREEDOMS_BY_MOBILITY[expected]) == expected
    assert joints_of(freedoms_of(expected)).mobility == expected


def test_known_mechanisms_have_their_known_mobility() -> None:
    assert gruebler_kutzbach(4, [1, 1, 1, 1]) == 1  # four-bar linkage
    assert gruebler_kutzbach(5, [1, 1, 1, 1, 1]) == 2  # five-bar linkage
    assert gruebler_kutzbach(14, [2] * 6 + [1] * 6 + [3] * 6, dimension=6) == 6  # Stewart platform, universal below
