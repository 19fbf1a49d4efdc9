"""The shipped stages, coarse; and a solver that must be there where CI runs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import Response, plate_of, platform_response
from flexfem.fem.sectors import build_mesh
from flexfem.mechanism.stage import Stage, load_stage
from flexfem.validate import compare, frequencies

GEOMETRY = Path(__file__).parents[2] / "geometry"
RESOLUTION = 2  # triangles across a neck: CalculiX takes a second a run


class Coarse(NamedTuple):
    """A shipped stage, its sheet and a coarse mesh of it."""

    stage: Stage
    plate: Plate
    mesh: StageMesh


def coarse(name: str) -> Coarse:
    stage = load_stage(GEOMETRY / f"{name}.toml")
    return Coarse(stage, plate_of(stage), build_mesh(stage, RESOLUTION))


@pytest.fixture(scope="session")
def stage_named() -> Callable[[str], Stage]:
    """A shipped stage by name."""
    return lambda name: load_stage(GEOMETRY / f"{name}.toml")


@pytest.fixture(scope="session")
def six() -> Coarse:
    """The reference stage of mobility six."""
    return coarse("mobility6")


@pytest.fixture(scope="session")
def answers() -> dict[Any, Any]:
    """What was solved of `six`, by what it depends on."""
    return {}


@pytest.fixture
def six_once(six: Coarse, answers: dict[Any, Any], monkeypatch: pytest.MonkeyPatch) -> Coarse:
    """`six`, which comparisons mesh and solve here only once; natural frequencies are left out."""

    def solve(mesh: StageMesh, plate: Plate, *degree: int) -> Response:
        if degree not in answers:
            answers[degree] = platform_response(mesh, plate, *degree)
        found: Response = answers[degree]
        return found

    monkeypatch.setattr(compare, "build_mesh", lambda *_: six.mesh)
    monkeypatch.setattr(compare, "platform_response", solve)
    monkeypatch.setattr(
        frequencies, "compared", lambda *_: (frequencies.ComparedFrequencies(*np.ones((3, 6)), 0.0), ())
    )
    return six


@pytest.fixture(scope="session")
def ccx() -> None:
    """CalculiX is Debian's, not pip's: a developer may do without it, CI may not."""
    if shutil.which("ccx") is None:
        missing = "CalculiX is missing: apt-get install calculix-ccx"
        if os.environ.get("CI"):
            pytest.fail(missing)
        pytest.skip(missing)
