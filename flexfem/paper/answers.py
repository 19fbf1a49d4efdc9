"""What the paper's own answers share: the subject, the analytic model, meshes, models and results.

The questions of `flexfem.questions` call these answers for a stage. They differ from those for
other mechanisms: a stage has one analytic model, sectors that are meshed once for equal chains, and
nine hinges that are named by chain and position."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.response import Response
from flexfem.files.provenance import Assumptions, Sourced, assumptions
from flexfem.files.tables import memoized
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import ModelChoice, choose
from flexfem.paper.solutions import solve_solid
from flexfem.paper.stage import Stage
from flexfem.questions import setup
from flexfem.questions.bands import SolidLevels, coarser, levels
from flexfem.questions.plates import Bands, Responses, Values, value_bands
from flexfem.questions.setup import Analytic, Mesh, ModelAnswer, Models, on_meshes
from flexfem.results import ANALYTIC, ELEMENTS, SOLID, About, Progress

OfModel = Callable[[], Values]  # computes the values of the analytic model
OnMesh = Callable[
    [int, int], Values
]  # values from a resolution and a number of layers, 0 in the plane


def _about(
    stage: Stage,
    digest: str,
    doubts: Assumptions,
) -> About:
    return About(
        stage.name,
        str(stage.origin),
        digest,
        tuple(doubts.assumed),
        tuple(doubts.not_stated),
        stage.lever,
    )


def about(stage: Stage, files: Mapping[str, Sourced] = setup.NOTHING) -> About:
    """Return the stage as the subject of a result, with other files by name."""
    named = [("", stage), *((f"{name}: ", file) for name, file in files.items())]
    return _about(stage, stage.hash, assumptions(named))


def about_driven(stage: Stage) -> About:
    """Return the stage with its drive as the subject of a result."""
    return _about(stage, stage.drive_hash, stage.drive_assumptions)


def about_heated(stage: Stage) -> About:
    """Return the stage with its coefficients of expansion as the subject of a result."""
    return _about(stage, stage.heat_hash, stage.heat_assumptions)


def chosen(
    stage: Stage, analytic: Analytic, warnings: list[str], models: Models = "both"
) -> ModelChoice:
    """Return the analytic model of a stage; append warnings of charts that do not cover it.

    With models "elements" there are no such warnings. Raises BadInput for a model that does not
    suit the stage.
    """
    unused = list[str]()
    return choose(stage, *analytic, unused if models == "elements" else warnings)


def mesh_of(
    stage: Stage,
    models: Models,
    resolution: int | None,
    layers: int | None = None,
    least: int = 4,
    usual: int = RESOLUTION,
    usual_solid: int | None = None,
) -> Mesh | None:
    """Return the requested mesh of a stage, by default the usual one. Raises BadInput as
    `setup.mesh_of`.
    """
    return setup.mesh_of(stage, models, resolution, layers, least, usual, usual_solid)


def responses(stage: Stage, response: Response) -> Responses:
    """Return compliance and neck stress (..., 3 chains, 3 hinges) by finite elements."""

    def stress(loads: Array) -> Array:
        highest = neck_stresses(stage, response, loads.reshape(-1, 3)).highest
        return highest.reshape(*loads.shape[:-1], 3, 3)

    return Responses(response.compliance, stress)


def element_values(
    mesh: Mesh, solve: OnMesh, progress: Progress | None = None, bands: Bands = value_bands
) -> dict[str, ModelAnswer]:
    """Return the values of finite elements in the plane or in three dimensions, and their bands.

    In three dimensions the finest mesh is solved with all layers.
    """
    steps = levels(mesh.resolution)
    sizes = np.array(steps, dtype=float)
    if mesh.layers:
        planes, ends = coarser(solve, *mesh, progress)
        return {SOLID: ModelAnswer(solve(*mesh), bands(sizes, planes, ends))}
    each = on_meshes(steps, lambda level: solve(level, 0), progress)
    return {ELEMENTS: ModelAnswer(each[-1], bands(sizes, each, ()))}


def by_models(
    mesh: Mesh | None,
    models: Models,
    of_model: OfModel,
    on_mesh: OnMesh,
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return the values of the analytic model and of finite elements, those of `models`."""
    found = dict[str, ModelAnswer]()
    if models != "elements":
        found[ANALYTIC] = ModelAnswer(of_model())
    if mesh is not None:
        found |= element_values(mesh, on_mesh, progress, bands)
    return found


@memoized
def solid_levels(
    stage: Stage,
    resolution: int,
    layers: int,
) -> SolidLevels:
    """Return compliances that bound the errors of `solve_solid`: each error is measured where the
    other is coarse.
    """

    def compliance(level: int, count: int) -> Array:
        return solve_solid(stage, level, count).compliance

    planes, (few, many) = coarser(compliance, resolution, layers)
    return SolidLevels(np.array(planes), few, many)
