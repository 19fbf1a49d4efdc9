"""The shipped stages."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexfem.mechanism.stage import load_stage

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module", params=[("mobility3", 3), ("mobility6", 6)], ids=["three", "six"])
def modelled(request):
    name, model = request.param
    return load_stage(ROOT / "geometry" / f"{name}.toml"), model


@pytest.fixture(scope="module")
def three():
    return load_stage(ROOT / "geometry/mobility3.toml")


@pytest.fixture(scope="module")
def six():
    return load_stage(ROOT / "geometry/mobility6.toml")
