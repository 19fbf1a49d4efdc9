"""Accepted numbers of the stage and of cases: their questions, and meshes that are stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import flexfem
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION, PlaneMesh
from flexfem.fem.response import platform_response
from flexfem.hinges.choice import CALIBRATED, DEFAULT_FORMULA
from flexfem.paper.case import LoadedCase
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.paper.verification import run_case
from flexfem.questions.bands import levels
from flexfem.questions.stiffness import stiffness
from flexfem.questions.summary import summary
from flexfem.results import Result
from flexfem.units import DIRECTIONS

COARSE = 2  # triangles across the necks, for finite displacements
FORCE = (1.0, -2.0, 30.0)  # N, N, N mm; unequal components
AMPLITUDE = (0.05, -0.02, 5e-4)  # mm, mm, rad
POSE = (0.005, -0.002, 2e-4)  # mm, mm, rad; of the drive


ANALYTIC = partial(stiffness, models="analytic")
QUESTIONS: dict[str, Callable[[Any], Result]] = {  # those that do not apply are omitted
    "paper": partial(ANALYTIC, analytic=flexfem.Analytic(formula=DEFAULT_FORMULA)),
    "links": partial(ANALYTIC, analytic=flexfem.Analytic(21, CALIBRATED, True)),
    "stiffness": partial(stiffness, force=FORCE),
    "summary": summary,
    "drift": flexfem.drift,
    "modes": flexfem.modes,
    "life": partial(flexfem.life, amplitude=AMPLITUDE),
    "drive": partial(flexfem.drive, pose=POSE),
    "reach": flexfem.reach,
    "large": partial(flexfem.large, resolution=COARSE),
    "gravity": flexfem.gravity,
    "budget": partial(flexfem.budget, plane=True),
    "convergence": partial(flexfem.converge, resolutions=[*levels(RESOLUTION)]),
}


def accepted_questions(stage: Stage) -> dict[str, Callable[[Any], Result]]:
    """Return the questions about a stage by name."""
    return QUESTIONS


def stored_mesh(stage: Stage, resolution: int) -> PlaneMesh:
    """Return a mesh of a stage that can be stored."""
    return build_mesh(stage, resolution)


def stored_compliance(stage: Stage, mesh: PlaneMesh) -> tuple[tuple[str, ...], Array]:
    """Return the names of the ports of a stage, and the compliance (ports, ports) on a mesh."""
    return DIRECTIONS, platform_response(mesh, plate_of(stage)).compliance


def case_result(path: Path) -> Result:
    """Return the errors of a case file. Raises BadInput, ComputationFailed."""
    return run_case(LoadedCase(path))


def case_stages(path: Path) -> Iterator[tuple[str, Stage, Path]]:
    """Yield label, stage and stage file of each curve with plane finite elements of a case file."""
    loaded = LoadedCase(path)
    if loaded.case.model == "fe":
        for curve in loaded.case.curve:
            yield curve.label, loaded.stages[curve.label], loaded.stage_path(curve)
