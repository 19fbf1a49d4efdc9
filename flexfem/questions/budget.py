"""Why the curves differ: the error of the paper's model, split into named shares that add up to it.

From the paper's model to the finite elements in steps, each of which adds one thing; a share is what a step moves the
error by, so the shares telescope: their sum is the total, whatever they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import (
    CALIBRATED,
    DEFAULT_FORMULA,
    analyse,
    at_rest,
    hinge_compliances,
    on_thickness_chart,
)
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import Array, inverse
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.designs import lower
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings
from flexfem.questions.bands import SAFETY, command_errors, error_matrix, levels, solve_solid
from flexfem.questions.setup import about, solved
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
PERCENT = ("percent",) * 3
POINTS = Gate(FRESH.relative, absolute=100 * FRESH.relative)  # percentage points of a command


class Budget(Result):
    """Shares of the error of a stage's own analytic model; they add up to the total."""

    title = "error budget"
    labels: ClassVar = {"share": (*SHARES, TOTAL), "outside": (CHART, MEASURED, IN_ALL), "commanded": DIRECTIONS}
    figure = "errors.budget_figure"
    reading = ("per cent of the command, along it; a share is what one step from the model to the elements changes",)
    share = Quantity("share of the error in the commanded direction", PERCENT, ("share", "direction"), POINTS)
    solid = Quantity("outside the planar total", PERCENT, ("outside", "direction"), POINTS)
    across = Quantity(
        "share of the error, by commanded direction", PERCENT, ("share", "commanded", "direction"), POINTS, shown=False
    )
    solid_across = Quantity(
        "outside the planar total, by commanded direction", PERCENT, ("outside", "commanded", "direction"), POINTS,
        shown=False,
    )  # fmt: skip


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
    stage : Stage
        The stage.
    amplitude : tuple of float
        Commands in x, y and theta at which the share of large displacement is taken: mm, mm, rad.
    resolution : int
        Triangles across every neck on the finest of three meshes, from 4.
    plane : bool
        Leave out what three dimensions change.
    progress : callable, optional
        Called with a line after each mesh.

    Returns
    -------
    Budget

    Raises
    ------
    BadInput
        The stage cannot be made, or a hinge is not on the hinge chart.
    ComputationFailed
        A mesh or a solution does not pass its checks.
    """
    check_feasible(stage)
    commands = np.asarray(arguments.poses("amplitude", amplitude, 1)).ravel()
    if not np.all((commands > 0) & (commands <= LARGEST_AMPLITUDE)):
        raise BadInput(f"amplitude {amplitude}, expected three numbers above 0 up to 10 mm, 10 mm and 1 rad")
    steps, lever = levels(arguments.resolution(resolution, 4)), stage.chain.link_lengths[2]
    paper = analyse(stage)
    models = [paper, *(analyse(stage, 21, *more) for more in ((), (CALIBRATED,), (CALIBRATED, True)))]
    meshes = []
    for level in steps:
        meshes.append(solved(stage, level))
        if progress is not None:
            progress(f"{meshes[-1].unknowns} unknowns")
    K, C = paper.stiffness, np.array([each.compliance for each in meshes])
    errors = [command_errors(np.array(steps), C, K, direction, lever) for direction in DIRECTIONS]
    finest = np.array([[each.band for each in one] for one in errors]).T
    limit = np.array([[each.extrapolated for each in one] for one in errors]).T
    on_mesh = np.array([[each.values[-1] for each in one] for one in errors]).T
    bent = _bent(stage, K, meshes[-1], commands)  # on one mesh: its own error drops out
    ladder = [error_matrix(K, each.compliance, lever) for each in models]
    rungs = np.array([*ladder, limit, limit + bent - on_mesh])  # column j for command j
    shares = np.concatenate([np.diff(rungs, axis=0), rungs[-1:] - rungs[:1]])
    band = np.full(shares.shape, np.nan)
    band[-1] = finest
    outside, outside_band = np.full((3, 3, 3), np.nan), np.full((3, 3, 3), np.nan)
    if (thick := thick_compliance(stage)) is not None:
        outside[0] = error_matrix(K, thick, lever) - ladder[-1]
    settings: dict[str, Any] = {"model": f"mobility {paper.mobility}, {DEFAULT_FORMULA}", "resolution": resolution}
    if not plane:
        outside[1], outside_band[1] = measured(stage)
        outside[2], outside_band[2] = shares[-1] + outside[1], band[-1] + outside_band[1]
        settings["three dimensions"] = f"{SOLID[0]} triangles, {SOLID[1]} layers"
    found = command_warnings(stage, meshes[-1], K.T * commands[:, None], "command")  # (18)
    return Budget(
        about(stage),
        {"share": _along(shares), "solid": _along(outside)} | {"across": _rows(shares), "solid_across": _rows(outside)},
        {"share": _along(band), "solid": _along(outside_band)},
        settings=settings,
        warnings=[*warnings.of_result(stage, paper), *found],
    )


def _along(values: Array) -> Array:
    """Of matrices (k, 3, 3), column j for command j, the diagonals (k, 3): along the command."""
    return np.asarray(np.diagonal(values, axis1=1, axis2=2))


def _rows(values: Array) -> Array:
    return np.asarray(np.moveaxis(values, 1, 2))


def command_warnings(stage: Stage, solution: Response, forces: Array, where: str) -> list[str]:
    """Warnings on the highest neck stress under the forces (3, 3) of three commands, row by row."""
    found = []
    for direction, force in zip(DIRECTIONS, forces, strict=True):
        highest = float(np.max(load_case(stage, solution.mesh, solution, force).neck_stress))
        found += warnings.of_yield(highest, stage.material.yield_strength, f"{where} in {direction}")
    return found


def _bent(stage: Stage, K: Array, solution: Response, commands: Array) -> Array:
    """Error percentages (3, 3) of nonlinear finite elements under the forces of (18), column j for command j."""
    wanted, scale = np.diag(commands), np.array([1.0, 1.0, stage.chain.link_lengths[2]])
    pose = np.array([equilibrium(solution.mesh, plate_of(stage), (K @ one)[None]).pose[0] for one in wanted])
    return np.asarray(100 * (pose - wanted).T * scale[:, None] / (commands * scale))


def thick_compliance(stage: Stage) -> Array | None:
    """Platform compliance (3, 3) of calibrated hinges as three-dimensional bodies between elastic links.

    None when one is not on the thickness chart.
    """
    design = replace(lower(stage), plane="corrected")
    if not np.all(on_thickness_chart(design)):
        return None
    hinges, bodies = hinge_compliances(design, CALIBRATED), body_compliance(stage, design.plane)
    return inverse(at_rest(design, hinges, freedoms_of(21), bodies[None]).stiffness[0])


def measured(stage: Stage) -> tuple[Array, Array]:
    """What three dimensions change, percentage points (3, 3), column j for command j, and its band along the command.

    Notes
    -----
    The error in three dimensions less that of the stage's own plane problem on the same mesh of the plane, whose own
    error so cancels. The band is `SAFETY` times what the last step of the mesh and of the layers changed, one after the
    other.
    """
    resolution, count = SOLID
    coarse, medium, _ = levels(resolution)
    of_mesh = change(stage, resolution, 1) - change(stage, medium, 1)
    of_layers = change(stage, coarse, count) - change(stage, coarse, levels(count)[1])
    band = SAFETY * (np.abs(of_mesh) + np.abs(of_layers))
    return change(stage, resolution, count), np.where(np.eye(3, dtype=bool), band, np.nan)


def change(stage: Stage, resolution: int, layers: int) -> Array:
    """Percentage points (3, 3), column j for command j, from the stage's own plane problem to three dimensions."""
    response, predicted = solve_solid(stage, resolution, layers), analyse(stage).stiffness
    plane, lever = unit_response(response.sectors, plate_of(stage)), stage.chain.link_lengths[2]
    solid, flat = (error_matrix(predicted, each.compliance, lever) for each in (response, plane))
    return np.asarray(solid - flat)


def other_thickness(stage: Stage, compliance: Array) -> dict[str, Array]:
    """Compliances (3, 3) of the extruded stage, measured and by the chart of single hinges where they are all on it.

    Parameters
    ----------
    compliance : (3, 3), of finite elements in the stage's plane, to which the change from plane to three dimensions is
        added.
    """
    response = solve_solid(stage, *SOLID)
    plane = unit_response(response.sectors, plate_of(stage)).compliance
    found = {"finite elements in three dimensions": compliance + response.compliance - plane}
    thick = thick_compliance(stage)
    if thick is None:
        return found
    flat = analyse(stage, 21, CALIBRATED, links=True).compliance
    return found | {"three dimensions by the chart of single hinges": compliance + thick - flat}
