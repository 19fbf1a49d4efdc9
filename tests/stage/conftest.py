"""A generic stage, with any of its file keys changed."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import pytest

from flexfem.stage.schema import Stage

GENERIC: dict[str, Any] = {
    "name": "generic stage",
    "thickness_mm": 9.7,
    "material": {
        "name": "generic metal",
        "youngs_modulus_gpa": 68.3,
        "poissons_ratio": 0.29,
        "density_kg_m3": 2739.0,
        "yield_strength_mpa": 411.0,
    },
    "chain": {
        "link_lengths_mm": [31.0, 33.5, 25.0],
        "joint_angles_deg": [175.0, -85.0, 92.0],
        "link_width_mm": 8.9,
    },
    "hinges": {
        "base": {"radius_mm": 3.9, "neck_mm": 0.53, "prismatic": True},
        "elbow": {"radius_mm": 1.6, "neck_mm": 0.47},
        "platform": {"radius_mm": 1.4, "neck_mm": 0.61},
    },
    "platform": {"radius_mm": 16.3, "hub_radius_mm": 7.7},
}

UNLIKE: list[dict[str, Any]] = [
    {"chain": 1, "hinge": "base", "radius_mm": 2.3, "axis_deg": 183.0},
    {"chain": 2, "hinge": "elbow", "neck_mm": 0.83},
    {"chain": 3, "hinge": "platform", "radius_mm": 1.9, "neck_mm": 0.39, "axis_deg": 101.0},
]

StageMaker = Callable[..., Stage]


def with_changes(changes: Mapping[str, Any] = MappingProxyType({})) -> Stage:
    """The generic stage with the values of some key paths, such as `hinges.base.neck_mm`, replaced."""
    content = copy.deepcopy(GENERIC)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = content
        for name in tables:
            table = table[name]
        table[key] = value
    return Stage.model_validate(content)


@pytest.fixture(scope="session")
def make_stage() -> StageMaker:
    """`with_changes`."""
    return with_changes


@pytest.fixture(scope="session", params=["alike", "unlike"])
def stage(request: pytest.FixtureRequest) -> Stage:
    """The generic stage, and one with three hinges of different chains overridden."""
    return with_changes({} if request.param == "alike" else {"override": UNLIKE})
