"""Error budget of a stage: the error of the paper's model, split into shares that add up to it."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response
from flexfem.paper import answers, warnings
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, AnalyticResult, analyse, corrected
from flexfem.paper.solutions import solve_solid, solved
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions.bands import SAFETY, command_errors, error_matrix, levels
from flexfem.questions.budget import AMPLITUDES
from flexfem.questions.setup import on_meshes
from flexfem.questions.warnings import of_yield
from flexfem.refused import BadInput
from flexfem.results import NEW_MESH, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

LARGEST_AMPLITUDE = (10.0, 10.0, 1.0)  # mm, mm, rad
# resolution and layers: the effect of three dimensions hardly depends on the in-plane mesh
SOLID = (4, 3)
SHARES = (
    "omitted hinge freedoms",
    "hinge formula",
    "rigid links, pads and platform",
    "residual",
    "large displacement",
)
TOTAL = "total"
CHART = "three-dimensional hinges"
MEASURED = "three dimensions"
IN_ALL = "total in three dimensions"
POINTS = Gate(NEW_MESH.relative, absolute=100 * NEW_MESH.relative)  # percentage points of a command


class StageBudget(Result):
    """Shares of the error of a stage's own analytic model, which add up to the total."""

    kind_name = "budget"
    title = "error budget"
    main_result = ("share", {"share": TOTAL})
    labels: ClassVar = {
        "share": (*SHARES, TOTAL),
        "outside": (CHART, MEASURED, IN_ALL),
        "commanded": DIRECTIONS,
    }
    figure = "paper.figures.budget.budget_figure"
    footnotes: ClassVar[tuple[str, ...]] = (
        "shares are % of the commanded motion; a share is the error change by one model refinement",
    )
    share = Quantity(
        "share of the error in the commanded direction",
        "percents",
        ("share", "direction"),
        POINTS,
    )
    solid = Quantity("not in the planar total", "percents", ("outside", "direction"), POINTS)
    across = Quantity(
        "share of the error, by commanded direction",
        "percents",
        ("share", "commanded", "direction"),
        POINTS,
        shown=False,
    )
    solid_across = Quantity(
        "not in the planar total, by commanded direction",
        "percents",
        ("outside", "commanded", "direction"),
        POINTS,
        shown=False,
    )


def budget(
    stage: Stage,
    *,
    amplitude: tuple[float, float, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    plane: bool = False,
    progress: Progress | None = None,
) -> StageBudget:
    """Return the shares of the error of the paper's model. Raises BadInput, ComputationFailed."""
    steps = levels(arguments.resolution(resolution, 4))
    commands = _commands(amplitude)
    models = _models(stage)
    K = models[0].stiffness
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    errors = _errors_of(meshes, steps, K, stage.lever)
    analytic = [error_matrix(K, model.compliance, stage.lever) for model in models]
    # the error of the finest mesh cancels in the difference
    bent = _nonlinear_errors(stage, K, meshes[-1], commands) - errors.on_mesh
    sequence = np.array([*analytic, errors.limit, errors.limit + bent])  # column j for command j
    shares = np.concatenate([np.diff(sequence, axis=0), sequence[-1:] - sequence[:1]])
    band = np.full(shares.shape, np.nan)
    band[-1] = errors.band
    settings: dict[str, Any] = {
        "model": f"mobility {models[0].mobility}, {DEFAULT_FORMULA}",
        "resolution": resolution,
    }
    outside = _outside(stage, K, analytic[-1])
    if not plane:
        outside.measure(stage, K, shares[-1], band[-1])
        settings["three dimensions"] = f"{SOLID[0]} triangles, {SOLID[1]} layers"
    return StageBudget(
        answers.about(stage),
        {
            "share": _along(shares),
            "solid": _along(outside.values),
            "across": np.moveaxis(shares, 1, 2),
            "solid_across": np.moveaxis(outside.values, 1, 2),
        },
        {"share": _along(band), "solid": _along(outside.bands)},
        settings=settings,
        warnings=_warnings(stage, models[0], meshes[-1], commands),
    )


def _commands(amplitude: tuple[float, float, float]) -> Array:
    """Return the commands (3,), mm, mm and rad. Raises BadInput."""
    commands = np.ravel(arguments.poses("amplitude", amplitude, 1))
    if not np.all((commands > 0) & (commands <= LARGEST_AMPLITUDE)):
        raise BadInput(
            f"amplitude {amplitude}, expected three numbers above 0 up to 10 mm, 10 mm and 1 rad"
        )
    return commands


def _models(stage: Stage) -> list[AnalyticResult]:
    """Return the paper's model, and the analytic ones with one refinement more each."""
    return [
        analyse(stage),
        analyse(stage, 21),
        analyse(stage, 21, CALIBRATED),
        analyse(stage, 21, CALIBRATED, True),
    ]


class _Errors(NamedTuple):
    """Errors (3, 3) of finite elements, per cent, column j for command j.

    limit : extrapolated, with its band.   on_mesh : on the finest mesh.
    """

    band: Array
    limit: Array
    on_mesh: Array


def _errors_of(
    meshes: list[Response],
    steps: tuple[int, ...],
    K: Array,
    lever: float,
) -> _Errors:
    """Return the errors of finite elements under the force of a model with the stiffness K (3, 3)."""
    C = np.array([mesh.compliance for mesh in meshes])
    parts = [
        [(error.band, error.extrapolated, error.values[-1]) for error in errors]
        for errors in (command_errors(np.array(steps), C, K, way, lever) for way in DIRECTIONS)
    ]
    return _Errors(*np.transpose(parts, (2, 1, 0)))


def _along(errors: Array) -> Array:
    """Return the errors (n, 3) along the commands from all (n, 3, 3)."""
    return np.diagonal(errors, axis1=1, axis2=2)


class _Outside(NamedTuple):
    """Errors (3, 3, 3), per cent, that are not in the planar total, and their bands.

    They are the effect of three-dimensional hinges, that of three dimensions, and the total with
    the latter; nan where they are not known.
    """

    values: Array
    bands: Array

    def measure(
        self,
        stage: Stage,
        K: Array,
        total: Array,
        band: Array,
    ) -> None:
        """Add what finite elements in three dimensions change of a total (3, 3) in the plane."""
        self.values[1], self.bands[1] = _solid_change(stage, K)
        self.values[2] = total + self.values[1]
        self.bands[2] = band + self.bands[1]


def _outside(
    stage: Stage,
    K: Array,
    elastic: Array,
) -> _Outside:
    """Return the effect of three-dimensional hinges on the errors (3, 3) of the elastic model."""
    found = _Outside(np.full((3, 3, 3), np.nan), np.full((3, 3, 3), np.nan))
    C = thick_compliance(stage)
    if C is not None:
        found.values[0] = error_matrix(K, C, stage.lever) - elastic
    return found


def _warnings(
    stage: Stage,
    paper: AnalyticResult,
    finest: Response,
    commands: Array,
) -> list[str]:
    """Warn of the model, and of commands (3,) at which finite elements are beyond yield."""
    texts = warnings.of_result(stage, paper)
    loads = paper.stiffness.T * commands[:, None]  # (18)
    highest = neck_stresses(stage, finest, loads).highest.max(axis=(1, 2))
    for direction, stress in zip(DIRECTIONS, highest.tolist(), strict=True):
        texts += of_yield(stress, stage.material.yield_strength, f"command in {direction}")
    return texts


def _nonlinear_errors(
    stage: Stage,
    K: Array,
    solution: Response,
    commands: Array,
) -> Array:
    """Return the error percentages (3, 3) of nonlinear finite elements under (18), column j for
    command j.
    """
    targets = np.diag(commands)
    scale = np.array([1.0, 1.0, stage.lever])
    plate = plate_of(stage)
    loads = [(K @ target)[None] for target in targets]
    poses = np.array([equilibrium(solution.mesh, plate, load).pose[0] for load in loads])
    return np.asarray(100 * (poses - targets).T * scale[:, None] / (commands * scale))


def thick_compliance(stage: Stage) -> Array | None:
    """Return the compliance (3, 3) of calibrated three-dimensional hinges and elastic links; None
    off the chart.
    """
    try:
        return analyse(corrected(stage), 21, CALIBRATED, True).compliance
    except BadInput:
        return None


def _solid_change(stage: Stage, K: Array) -> tuple[Array, Array]:
    """Return the effect of three dimensions, percentage points (3, 3), column j for command j.

    It is the error in three dimensions less that of the plane problem on the same in-plane mesh, so
    that the error of this mesh cancels. The second array has the band of its diagonal: `SAFETY`
    times the sum of the last changes by the mesh and by the layers.
    """

    def change(resolution: int, layers: int) -> Array:
        solid = solve_solid(stage, resolution, layers).compliance
        plane = solved(stage, resolution).compliance
        return error_matrix(K, solid, stage.lever) - error_matrix(K, plane, stage.lever)

    resolution, count = SOLID
    coarse, medium, _ = levels(resolution)
    of_mesh = change(resolution, 1) - change(medium, 1)
    of_layers = change(coarse, count) - change(coarse, levels(count)[1])
    band = SAFETY * (np.abs(of_mesh) + np.abs(of_layers))
    return change(resolution, count), np.where(np.eye(3, dtype=bool), band, np.nan)
