"""The reference stage, and one on which no two chains and no two stacks are alike."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from flexfem.paper.stage import Stage, load_stage

from ..conftest import ROOT

RIM = 17.0 * np.exp(1j * np.deg2rad(75.0))  # mm


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Load one of the programs whose answers are kept beside these tests."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module


@pytest.fixture(scope="session")
def stage() -> Stage:
    """Of mobility six."""
    return load_stage(ROOT / "geometry" / "mobility6.toml")


@pytest.fixture(scope="module")
def unlike_drive(stage: Stage) -> Stage:
    """Contacts off the links' normals, on straight and bent links, a single stack, and one on the
    platform's rim.
    """
    rim = {"name": "rim", "between": ("link 1", "platform"), "point": (RIM.real, RIM.imag)}
    return stage.replace(
        override={
            (2, "elbow"): {"neck": 0.61},
            (3, "base"): {"radius": 3.1},
            (1, "platform"): {"neck": 0.43},
        },
        actuator=[
            stage.actuator[0].model_copy(update={"tilt": np.deg2rad(-15.0), "pair": False}),
            stage.actuator[1].model_copy(
                update={"arm": 7.0, "side": "right", "tilt": np.deg2rad(10.0)}
            ),
            rim | {"direction": np.deg2rad(260.0), "stroke": 0.03, "blocking_force": 410.0},
        ],
    )
