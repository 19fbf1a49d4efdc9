"""Why the curves differ: the error of the paper's model, split into named shares that add up to it.

From the paper's model to the finite elements in steps, each of which adds one thing; a share is what a step moves the
error by, so the shares telescope: their sum is the total, whatever they are.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, analyse, corrected
from flexfem.arrays import Array
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings
from flexfem.questions.bands import SAFETY, command_errors, error_matrix, levels, solve_solid
from flexfem.questions.setup import about, on_meshes, question, solved
from flexfem.refused import BadInput
from flexfem.results import FRESH, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

AMPLITUDES = (0.05, 0.05, 1e-3)  # mm, mm, rad: assumed, as in cases/
LARGEST_AMPLITUDE = (10.0, 10.0, 1.0)  # mm, mm, rad
SOLID = (4, 3)  # resolution and layers: what three dimensions change hardly depends on the mesh in the plane
SHARES = (
    "freedoms left out of the model",
    "hinge formula",
    "links, pads and platform as rigid",
    "what the chart and the links leave",
    "large displacement",
)
TOTAL = "total"
CHART, MEASURED, IN_ALL = "hinges of three dimensions, by the chart", "three dimensions", "total in three dimensions"
POINTS = Gate(FRESH.relative, absolute=100 * FRESH.relative)  # percentage points of a command


class Budget(Result):
    """Shares of the error of a stage's own analytic model; they add up to the total."""

    title = "error budget"
    labels: ClassVar = {"share": (*SHARES, TOTAL), "outside": (CHART, MEASURED, IN_ALL), "commanded": DIRECTIONS}
    figure = "errors.budget_figure"
    reading = ("per cent of the command, along it; a share is what one step from the model to the elements changes",)
    share = Quantity("share of the error in the commanded direction", "percents", ("share", "direction"), POINTS)
    solid = Quantity("outside the planar total", "percents", ("outside", "direction"), POINTS)
    across = Quantity(
        "share of the error, by commanded direction",
        "percents",
        ("share", "commanded", "direction"),
        POINTS,
        shown=False,
    )
    solid_across = Quantity(
        "outside the planar total, by commanded direction", "percents", ("outside", "commanded", "direction"), POINTS,
        shown=False,
    )  # fmt: skip


@question
def budget(
    stage: Stage,
    *,
    amplitude: tuple[float, float, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    plane: bool = False,
    progress: Progress | None = None,
) -> Budget:
    """Split the error of the stage's own analytic model into named shares that add up to it.

    Parameters
    ----------
    amplitude : tuple of float
        Commands in x, y and theta at which the share of large displacement is taken: mm, mm, rad.
    plane : bool
        Leave out what three dimensions change.
    {shared}
    """
    check_feasible(stage)
    commands = np.asarray(arguments.poses("amplitude", amplitude, 1)).ravel()
    if not np.all((commands > 0) & (commands <= LARGEST_AMPLITUDE)):
        raise BadInput(f"amplitude {amplitude}, expected three numbers above 0 up to 10 mm, 10 mm and 1 rad")
    steps, lever = levels(arguments.resolution(resolution, 4)), stage.chain.link_lengths[2]
    paper = analyse(stage)
    models = [paper, *(analyse(stage, 21, *more) for more in ((), (CALIBRATED,), (CALIBRATED, True)))]
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    K, C = paper.stiffness, np.array([each.compliance for each in meshes])
    errors = [command_errors(np.array(steps), C, K, direction, lever) for direction in DIRECTIONS]
    read = [[(each.band, each.extrapolated, each.values[-1]) for each in one] for one in errors]
    finest, limit, on_mesh = np.transpose(read, (2, 1, 0))
    bent = _bent(stage, K, meshes[-1], commands)  # on one mesh: its own error drops out
    ladder = [error_matrix(K, each.compliance, lever) for each in models]
    rungs = np.array([*ladder, limit, limit + bent - on_mesh])  # column j for command j
    shares = np.concatenate([np.diff(rungs, axis=0), rungs[-1:] - rungs[:1]])
    band = np.full(shares.shape, np.nan)
    band[-1] = finest
    outside, outside_band = np.full((2, 3, 3, 3), np.nan)
    if (thicker := thick_compliance(stage)) is not None:
        outside[0] = error_matrix(K, thicker, lever) - ladder[-1]
    settings: dict[str, Any] = {"model": f"mobility {paper.mobility}, {DEFAULT_FORMULA}", "resolution": resolution}
    if not plane:
        outside[1], outside_band[1] = _measured(stage, K)
        outside[2], outside_band[2] = shares[-1] + outside[1], band[-1] + outside_band[1]
        settings["three dimensions"] = f"{SOLID[0]} triangles, {SOLID[1]} layers"
    texts = warnings.of_result(stage, paper)
    for direction, force in zip(DIRECTIONS, K.T * commands[:, None], strict=True):  # (18)
        highest = float(np.max(load_case(stage, meshes[-1].mesh, meshes[-1], force).neck_stress))
        texts += warnings.of_yield(highest, stage.material.yield_strength, f"command in {direction}")
    values, bands = (
        {name: np.diagonal(each, axis1=1, axis2=2) for name, each in (("share", planar), ("solid", solid))}
        for planar, solid in ((shares, outside), (band, outside_band))
    )
    values |= {"across": np.moveaxis(shares, 1, 2), "solid_across": np.moveaxis(outside, 1, 2)}
    return Budget(about(stage), values, bands, settings=settings, warnings=texts)


def _bent(stage: Stage, K: Array, solution: Response, commands: Array) -> Array:
    """Error percentages (3, 3) of nonlinear finite elements under the forces of (18), column j for command j."""
    wanted, scale = np.diag(commands), np.array([1.0, 1.0, stage.chain.link_lengths[2]])
    pose = np.array([equilibrium(solution.mesh, plate_of(stage), (K @ one)[None]).pose[0] for one in wanted])
    return np.asarray(100 * (pose - wanted).T * scale[:, None] / (commands * scale))


def thick_compliance(stage: Stage) -> Array | None:
    """Platform compliance (3, 3) of calibrated hinges as three-dimensional bodies between elastic links.

    None when one is not on the thickness chart.
    """
    try:
        return analyse(corrected(stage), 21, CALIBRATED, True).compliance
    except BadInput:
        return None


def _measured(stage: Stage, K: Array) -> tuple[Array, Array]:
    """What three dimensions change, percentage points (3, 3), column j for command j, and its band along the command.

    The error in three dimensions less that of the stage's own plane problem on the same mesh of the plane, whose own
    error so cancels. The band is `SAFETY` times what the last step of the mesh and of the layers changed, one after the
    other.
    """

    def change(resolution: int, layers: int) -> Array:
        solid = solve_solid(stage, resolution, layers)
        flat = solved(stage, resolution).compliance
        lever = stage.chain.link_lengths[2]
        return error_matrix(K, solid.compliance, lever) - error_matrix(K, flat, lever)

    resolution, count = SOLID
    coarse, medium, _ = levels(resolution)
    of_mesh = change(resolution, 1) - change(medium, 1)
    of_layers = change(coarse, count) - change(coarse, levels(count)[1])
    band = SAFETY * (np.abs(of_mesh) + np.abs(of_layers))
    return change(resolution, count), np.where(np.eye(3, dtype=bool), band, np.nan)
