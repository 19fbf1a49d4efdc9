"""What cannot be made is refused before any meshing, and told apart."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
import shapely

from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.plate import clashes, plate_polygon
from flexfem.paper.stage import Stage
from flexfem.paper.stage_layout import stage_layout
from flexfem.refused import BadInput


def override(chain: int, hinge: str, **changes: float) -> dict[str, Any]:
    return {"chain": chain, "hinge": hinge, **changes}


HARMLESS = override(1, "base", neck_mm=0.51)
IMPOSSIBLE = {  # changes of the generic stage, and what the refusal must say
    "override alone cuts too deep": (
        {"override": [HARMLESS, override(2, "elbow", radius_mm=4.25)]},
        ["override.2.elbow.radius_mm = 4.25", "notch deeper than the link"],
    ),
    "hinges of different chains in one place": (
        {
            "chain.link_lengths_mm": [70.0, 24.0, 27.0],
            "chain.joint_angles_deg": [353.0, 166.0, 81.0],
            "platform.radius_mm": 11.0,
        },
        [
            "hinges closer than their radii",
            "base hinge of chain 1",
            "elbow hinge of chain 2",
            "2.845 mm apart",
        ],
    ),
    "no room for link 1": (
        {"chain.link_lengths_mm": [7.2, 33.5, 25.0]},
        ["chain.link_lengths_mm", "room for link 1 of chain 1", "8.9 mm"],
    ),
    "no room for link 1 of the chain with an axis of its own": (
        {
            "chain.link_lengths_mm": [12.0, 21.0, 31.0],
            "chain.joint_angles_deg": [48.0, -29.0, -73.0],
            "override": [override(3, "elbow", axis_deg=288.0)],
        },
        ["room for link 1 of chain 3"],
    ),
    "platform covers a lug": (
        {"platform.radius_mm": 22.9},
        ["platform.radius_mm = 22.9", "covers the platform hinge", "link_lengths_mm[2]"],
    ),
    "hinge pointing past the platform": (
        {"hinges.platform.axis_deg": 60.0},
        [
            "hinges.platform.axis_deg = 60: the neck",
            "points past the platform",
            "neck of chain 1",
            "mm ahead",
        ],
    ),
    "joint angle that points the hinge past the platform": (
        {"chain.joint_angles_deg": [180.0, -90.0, 120.0]},
        ["chain.joint_angles_deg = [180, -90, 120]: the neck", "points past the platform"],
    ),
    "lugs crowd the platform": (
        {
            "chain.link_lengths_mm": [40.0, 46.0, 31.0],
            "chain.joint_angles_deg": [155.0, 132.0, 48.0],
            "platform.radius_mm": 9.0,
        },
        ["platform.radius_mm = 9", "large enough for its three lugs", "of 120 degrees"],
    ),
    "a link runs into its platform": (
        {
            "chain.link_lengths_mm": [29.0, 32.0, 22.0],
            "chain.joint_angles_deg": [145.0, -85.0, 103.0],
            "platform.radius_mm": 16.6,
        },
        ["link 2 of chain 1: overlaps platform by"],
    ),
    "chains overlap": (
        {
            "chain.link_lengths_mm": [86.0, 41.0, 23.0],
            "chain.joint_angles_deg": [224.0, 146.0, 90.0],
        },
        ["link 1 of chain 1: overlaps link 1 of chain 2 by"],
    ),
    "a link wider than the stage": ({"chain.link_width_mm": 1e4}, ["expected", "10000"]),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_an_impossible_stage_is_refused_with_its_reason(
    name: str, make_stage: Callable[..., Stage]
) -> None:
    changes, says = IMPOSSIBLE[name]
    stage = make_stage(changes)
    with pytest.raises(BadInput) as refusal:
        check_feasible(stage)
    said = str(refusal.value)
    assert "\n" not in said and "expected" in said
    assert all(word in said for word in says), said
    layout = stage_layout(stage, refuse=False)  # what a drawing shows
    red = shapely.union_all(clashes(layout, refusal.value))
    assert 0 < red.area < shapely.union_all([plate_polygon(layout), red]).area


@pytest.mark.parametrize(
    ("key", "value", "says", "changes"),
    [
        (
            "chain.link_width_mm",
            9.5,
            r"only with chain\.link_width_mm < (\S+)$",
            {"chain.link_lengths_mm": [31.0, 20, 25]},
        ),
        ("platform.radius_mm", 22.9, r"^platform.* expected <= (\S+), or", {}),
        ("platform.radius_mm", 8.0, r"^chain\.joint.* platform.radius_mm >= (\S+)$", {}),
    ],
)
def test_a_refusal_states_the_limit(
    key: str, value: float, says: str, changes: dict[str, Any], make_stage: Callable[..., Stage]
) -> None:
    """The stage is refused for this reason 0.2 % beyond the limit of the message, and not 0.2 %
    within it.
    """

    def refused(value: float) -> re.Match[str] | None:
        try:
            check_feasible(make_stage(changes | {key: value}))
        except BadInput as refusal:
            return re.search(says, str(refusal))
        return None

    found = refused(value)
    assert found is not None
    limit = float(found[1])
    assert [
        refused(limit * (1 + sign * math.copysign(2e-3, value - limit))) is None for sign in (-1, 1)
    ] == [
        True,
        False,
    ]


def test_bodies_that_meet_at_a_neck_do_not_overlap(make_stage: Callable[..., Stage]) -> None:
    """GEOS 3.14 finds a common area of 10.8 mm^2 of link 2 and platform, halves of the notch
    included, without grid.
    """
    lengths = [76.0, 46.0, 24.0]
    angles = [311.0, -26.0, -16.0]
    changes = {
        "chain.link_lengths_mm": lengths,
        "chain.joint_angles_deg": angles,
        "platform.radius_mm": 11.0,
    }
    check_feasible(make_stage(changes))


@pytest.mark.parametrize("scale", [1e-2, 7.3, 100.0])
def test_a_stage_of_any_size_can_be_made(scale: float, make_stage: Callable[..., Stage]) -> None:
    lengths = {
        "chain.link_lengths_mm": [31.0 * scale, 33.5 * scale, 25.0 * scale],
        "chain.link_width_mm": 8.9 * scale,
        "platform.radius_mm": 16.3 * scale,
        "platform.hub_radius_mm": 7.7 * scale,
    }
    for name, radius, neck in (("base", 3.9, 0.53), ("elbow", 1.6, 0.47), ("platform", 1.4, 0.61)):
        lengths |= {
            f"hinges.{name}.radius_mm": radius * scale,
            f"hinges.{name}.neck_mm": neck * scale,
        }
    check_feasible(make_stage(lengths))
