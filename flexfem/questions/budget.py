"""Error budget: the error of the paper's model, split into named shares that add up to it.

A sequence of models leads from the paper's model to the finite elements, each with one refinement
more. A share is the change of the error from one model to the next, so the sum of the shares is the
total error."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import respond, widened
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, analyse, corrected
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions import plates, warnings
from flexfem.questions.bands import (
    SAFETY,
    amplification_errors,
    command_errors,
    corner_bands,
    error_matrix,
    free_errors,
    held,
    levels,
    solve_solid,
)
from flexfem.questions.plates import ElasticParts
from flexfem.questions.setup import (
    about,
    answer,
    lever_of,
    on_meshes,
    options,
    require_hinges,
    solved,
)
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, FRESH, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

AMPLITUDES = (0.05, 0.05, 1e-3)  # mm, mm, rad: assumed, as in cases/
LARGEST_AMPLITUDE = (10.0, 10.0, 1.0)  # mm, mm, rad
SOLID = (
    4,
    3,
)  # resolution and layers: the effect of three dimensions hardly depends on the in-plane mesh
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
IN_PLANE = "total in the plane"
THICKNESS = "thickness"
PLANE_SHARES = ("rigid bodies", "hinge formulas", "joining of parts", IN_PLANE)
MECHANISM_SHARES = ("rigid bodies", "hinge formulas", THICKNESS, "joining of parts", IN_ALL)
POINTS = Gate(FRESH.relative, absolute=100 * FRESH.relative)  # percentage points of a command


class Budget(Result):
    """Shares of the error of a stage's own analytic model, which add up to the total."""

    title = "error budget"
    main = ("share", {"share": TOTAL})
    labels: ClassVar = {
        "share": (*SHARES, TOTAL),
        "outside": (CHART, MEASURED, IN_ALL),
        "commanded": DIRECTIONS,
    }
    figure = "paper.figures.budget.budget_figure"
    reading: ClassVar[tuple[str, ...]] = (
        "shares are % of the commanded motion; a share is the error change by one model refinement",
    )
    share = Quantity(
        "share of the error in the commanded direction",
        "percents",
        ("share", "direction"),
        POINTS,
        uneven=plates.POINTS,
    )
    solid = Quantity(
        "not in the planar total", "percents", ("outside", "direction"), POINTS, only="stage"
    )
    across = Quantity(
        "share of the error, by commanded direction",
        "percents",
        ("share", "commanded", "direction"),
        POINTS,
        shown=False,
        only="stage",
    )
    solid_across = Quantity(
        "not in the planar total, by commanded direction",
        "percents",
        ("outside", "commanded", "direction"),
        POINTS,
        shown=False,
        only="stage",
    )


class MechanismBudget(Budget, mechanism=True):
    """Shares of the errors of the network with rigid bodies, which add up to the total."""

    main = ("share", {})
    labels: ClassVar = {"share": MECHANISM_SHARES}
    figure = ""
    reading = (
        "shares are % of the commanded motion, by the single force or moment by which the "
        "network with rigid bodies moves the output as commanded, with the other directions free",
        plates.ALONG_READ,
        "rigid bodies: change by elastic bodies, from plane finite elements of each body",
        "hinge formulas: change from beam integrals to plane finite elements of each hinge",
        "thickness: change from its effect by plates as high as each hinge to that by "
        "three-dimensional finite elements of each hinge",
        "joining of parts: change from parts with rigid end sections to finite elements of the "
        "whole mechanism",
    )
    driven = Quantity(
        "share of the error of the amplification",
        "percent",
        ("share", "actuator"),
        plates.POINTS,
        note=plates.AMPLIFICATION_READ,
    )


@options(not_for="amplitude")
def budget(
    stage: Mechanism,
    *,
    amplitude: tuple[float, float, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    plane: bool = False,
    progress: Progress | None = None,
) -> Budget:
    """Split the error of the analytic model of a stage or mechanism into named shares that add up
    to it.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : tuple of float
        Commands in x, y and theta for the share of large displacement: mm, mm, rad. Of a stage file
        only.
    plane : bool
        Neglect the effect of three dimensions.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Budget
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        budget` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.
    """
    steps = levels(arguments.resolution(resolution, 4))
    lever = lever_of(stage)
    if isinstance(stage, MechanismFile):
        require_hinges(
            stage, "which the analytic model needs whose error is split", plates.BY_ELEMENTS
        )
        return _of_mechanism(stage, resolution, progress)
    commands = np.asarray(arguments.poses("amplitude", amplitude, 1)).ravel()
    if not np.all((commands > 0) & (commands <= LARGEST_AMPLITUDE)):
        raise BadInput(
            f"amplitude {amplitude}, expected three numbers above 0 up to 10 mm, 10 mm and 1 rad"
        )
    paper = analyse(stage)
    models = [
        paper,
        *(analyse(stage, 21, *choice) for choice in ((), (CALIBRATED,), (CALIBRATED, True))),
    ]
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    K = paper.stiffness
    C = np.array([mesh.compliance for mesh in meshes])
    errors = [command_errors(np.array(steps), C, K, direction, lever) for direction in DIRECTIONS]
    parts = [
        [(curve.band, curve.extrapolated, curve.values[-1]) for curve in curves]
        for curves in errors
    ]
    half_width, limit, on_mesh = np.transpose(parts, (2, 1, 0))
    nonlinear = _nonlinear_errors(
        stage, K, meshes[-1], commands
    )  # the error of this mesh cancels in the difference
    analytic = [error_matrix(K, model.compliance, lever) for model in models]
    sequence = np.array([*analytic, limit, limit + nonlinear - on_mesh])  # column j for command j
    shares = np.concatenate([np.diff(sequence, axis=0), sequence[-1:] - sequence[:1]])
    band = np.full(shares.shape, np.nan)
    band[-1] = half_width
    outside, outside_band = np.full((2, 3, 3, 3), np.nan)
    if (C_thick := thick_compliance(stage)) is not None:
        outside[0] = error_matrix(K, C_thick, lever) - analytic[-1]
    settings: dict[str, Any] = {
        "model": f"mobility {paper.mobility}, {DEFAULT_FORMULA}",
        "resolution": resolution,
    }
    if not plane:
        outside[1], outside_band[1] = _solid_change(stage, K)
        outside[2] = shares[-1] + outside[1]
        outside_band[2] = band[-1] + outside_band[1]
        settings["three dimensions"] = f"{SOLID[0]} triangles, {SOLID[1]} layers"
    texts = warnings.of_result(stage, paper)
    highest = neck_stresses(stage, meshes[-1], K.T * commands[:, None]).highest.max(
        axis=(1, 2)
    )  # (18)
    for direction, stress in zip(DIRECTIONS, highest.tolist(), strict=True):
        texts += warnings.of_yield(stress, stage.material.yield_strength, f"command in {direction}")
    values, bands = (
        {
            name: np.diagonal(array, axis1=1, axis2=2)
            for name, array in (("share", planar), ("solid", solid))
        }
        for planar, solid in ((shares, outside), (band, outside_band))
    )
    values |= {"across": np.moveaxis(shares, 1, 2), "solid_across": np.moveaxis(outside, 1, 2)}
    return Budget(about(stage), values, bands, settings=settings, warnings=texts)


def _of_mechanism(mechanism: Mechanism, resolution: int, progress: Progress | None) -> Budget:
    """Return the shares of the errors of the network with rigid bodies of a mechanism, in its
    dimensions.
    """
    mesh = plates.mesh_of(mechanism, "both", resolution, None)
    assert mesh is not None
    layout = mechanism.layout
    finest = plates.compared(mechanism, mesh, progress)
    parts = plates.parts_of(mechanism, mesh.resolution)
    networks = [ElasticParts(), ElasticParts(parts.bodies), parts]
    if finest.label != ELEMENTS:
        assert parts.hinges is not None
        networks[2] = parts._replace(hinges=widened(layout, parts.hinges))
        networks.append(plates.joined_parts(mechanism, True))
    ladder = [respond(layout, one.bodies, hinges=one.hinges).compliance for one in networks]
    steps = levels(mesh.resolution)
    planes = np.array([plates.solved(mechanism, level).compliance for level in steps])
    rigid = ladder[0][:3, :3]
    lever = layout.lever
    of_driven = plates.amplification(layout, finest.compliance)
    unused = held(finest.compliance[:3, :3], lever)

    def along(compliance: Array) -> Array:
        """Return the errors (..., 3) of the rigid network from another compliance (..., k, k),
        along each command.
        """
        errors = free_errors(rigid, compliance[..., :3, :3], lever)
        return np.where(unused, np.nan, np.diagonal(errors, axis1=-2, axis2=-1))

    def driven(compliance: Array) -> Array:
        """Return the same (..., a), up to a constant, of the amplification."""
        return -amplification_errors(plates.amplification(layout, compliance), of_driven, lever)

    values = dict[str, Array]()
    bands = dict[str, Array]()
    totals = {
        "share": np.diagonal(finest.percent_band(rigid, lever)),
        "driven": finest.driven_band(ladder[0], layout),
    }
    for name, error in {"share": along, "driven": driven}.items():
        if name == "share" or layout.actuators:
            sequence = [error(one) for one in (*ladder, finest.compliance)]
            of_planes = corner_bands(np.array(steps, dtype=float), error(planes))
            unknown = np.full((len(ladder) - 1, len(of_planes)), np.nan)
            total = of_planes if finest.label == ELEMENTS else totals[name]
            values[name] = np.array([*np.diff(sequence, axis=0), sequence[-1] - sequence[0]])
            bands[name] = np.array([*unknown, of_planes, total])
    labels = {"share": PLANE_SHARES if finest.label == ELEMENTS else MECHANISM_SHARES}
    notes = plates.held_notes(finest.compliance[:3, :3], lever)
    return answer(Budget, mechanism, {}, mesh, {}, values, labels, bands, notes=notes)


def _nonlinear_errors(stage: Stage, K: Array, solution: Response, commands: Array) -> Array:
    """Return the error percentages (3, 3) of nonlinear finite elements under (18), column j for
    command j.
    """
    targets = np.diag(commands)
    scale = np.array([1.0, 1.0, stage.chain.link_lengths[2]])
    poses = np.array(
        [
            equilibrium(solution.mesh, plate_of(stage), (K @ target)[None]).pose[0]
            for target in targets
        ]
    )
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
    """Return the effect of three dimensions, percentage points (3, 3), column j for command j, and
    its diagonal band.

    It is the error in three dimensions less that of the plane problem on the same in-plane mesh, so
    that the error of this mesh cancels. The band is `SAFETY` times the sum of the last changes by
    the mesh and by the layers."""

    def change(resolution: int, layers: int) -> Array:
        solid = solve_solid(stage, resolution, layers)
        plane = solved(stage, resolution)
        lever = stage.chain.link_lengths[2]
        return error_matrix(K, solid.compliance, lever) - error_matrix(K, plane.compliance, lever)

    resolution, count = SOLID
    coarse, medium, _ = levels(resolution)
    of_mesh = change(resolution, 1) - change(medium, 1)
    of_layers = change(coarse, count) - change(coarse, levels(count)[1])
    band = SAFETY * (np.abs(of_mesh) + np.abs(of_layers))
    return change(resolution, count), np.where(np.eye(3, dtype=bool), band, np.nan)
