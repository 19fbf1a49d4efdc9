"""The closed-form conditions of many designs are those of each of them."""

from __future__ import annotations

import cmath
from collections.abc import Callable
from dataclasses import fields, replace
from itertools import combinations

import numpy as np
import pytest

from flexfem.paper.designs import Designs, design_arrays
from flexfem.paper.feasibility import check_closed_form, conditions
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

COUNT = 300


def together(stages: list[Stage]) -> Designs:
    """Stages as one batch of designs."""
    each = [design_arrays(stage) for stage in stages]
    names = [field.name for field in fields(Designs) if field.name not in ("plane", "prismatic")]
    return replace(
        each[0], **{name: np.concatenate([getattr(one, name) for one in each]) for name in names}
    )


def random_stages(make_stage: Callable[..., Stage]) -> list[Stage]:
    rng = np.random.default_rng(41)

    def one() -> Stage:
        return make_stage(
            {
                "chain.link_lengths_mm": [
                    rng.uniform(3, 40),
                    rng.uniform(3, 40),
                    rng.uniform(15, 30),
                ],
                "chain.joint_angles_deg": [rng.uniform(-180, 180) for _ in range(3)],
                "chain.link_width_mm": rng.uniform(4, 12),
                "hinges.base.radius_mm": rng.uniform(1, 4),
                "hinges.elbow.neck_mm": rng.uniform(0.1, 8),
                "platform.radius_mm": rng.uniform(6, 20),
                "override": [{"chain": 3, "hinge": "platform", "radius_mm": rng.uniform(1, 3)}],
            }
        )

    return [one() for _ in range(COUNT)]


def impossible(stage: Stage) -> bool:
    """By plain geometry, hinge by hinge and pair by pair, from the file's own numbers."""
    lengths = stage.chain.link_lengths
    heading = 0.0
    at = []
    for length, angle in zip(lengths, stage.chain.joint_angles, strict=True):
        heading += angle
        at.append(length * cmath.exp(1j * heading))
    first = [-(at[0] + at[1] + at[2]), -(at[1] + at[2]), -at[2]]
    hinges = [
        (centre * cmath.exp(2j * cmath.pi * chain / 3), stage.hinge(chain + 1, name))
        for chain in range(3)
        for centre, name in zip(first, ("base", "elbow", "platform"), strict=True)
    ]
    width = stage.chain.link_width
    disc = stage.platform.radius
    return (
        stage.platform.hub_radius >= disc
        or any(hinge.neck >= width or hinge.neck + 2 * hinge.radius > width for _, hinge in hinges)
        or any(abs(centre) <= disc + hinge.radius + hinge.neck / 2 for centre, hinge in hinges)
        or any(
            abs(one - two) <= a.radius + b.radius for (one, a), (two, b) in combinations(hinges, 2)
        )
    )


def refused(stage: Stage) -> bool:
    try:
        check_closed_form(stage)
    except BadInput:
        return True
    return False


def test_many_designs_break_what_plain_geometry_says_and_so_does_each_alone(
    make_stage: Callable[..., Stage],
) -> None:
    stages = random_stages(make_stage)
    where = np.any(
        [each.where for each in (one.broken for one in conditions(together(stages)))], axis=0
    )
    expected = np.array([impossible(stage) for stage in stages])
    assert np.array_equal(where, expected)
    assert [refused(stage) for stage in stages[:40]] == expected[:40].tolist()
    assert 0.1 < expected.mean() < 0.9


@pytest.mark.parametrize(
    ("reason", "key", "outside", "inside"),
    [
        ("neck as wide", "hinges.elbow.neck_mm", 8.9, 8.8999),
        (
            "notch deeper",
            "hinges.elbow.radius_mm",
            4.2151,
            (8.9 - 0.47) / 2,
        ),  # a difference of decimals
        ("hub larger", "platform.hub_radius_mm", 16.3, 16.2999),
        ("covers", "platform.radius_mm", 23.2951, 23.2949),  # 25 - 1.4 - 0.61 / 2
        (
            "closer",
            "chain.link_lengths_mm",
            [5.4999, 33.5, 25.0],
            [5.5001, 33.5, 25.0],
        ),  # 3.9 + 1.6
    ],
)
def test_a_condition_turns_at_its_limit(
    reason: str, key: str, outside: object, inside: object, make_stage: Callable[..., Stage]
) -> None:
    for value, is_broken in ((outside, True), (inside, False)):
        found = [each.broken for each in conditions(together([make_stage({key: value})]))]
        assert any(reason in each.reason and each.where[0] for each in found) is is_broken
