"""Effect of a change of temperature on the nine-hinge stage.

The temperature field is linear in x and y, in three dimensions also in z. In three dimensions
displacements out of the plane are relative to the frame, which bows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.mesh import nodes_on
from flexfem.fem.response import (
    HEAT_CASES,
    Response,
    factorised_sectors,
    free_displacement,
    heat_response,
)
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import von_mises_along
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.expansion import Expansion, coefficients, expansion_of, require_expansion
from flexfem.paper import answers
from flexfem.paper import warnings as warning
from flexfem.paper.designs import design_arrays, stage_frames
from flexfem.paper.fields import CORNER, edge_maxima, largest_within, neck_maxima, neck_stresses
from flexfem.paper.links import body_compliance, edge_motions
from flexfem.paper.model import ModelChoice, analyse
from flexfem.paper.responses import WarmBodies
from flexfem.paper.responses import drift as analytic_drift
from flexfem.paper.solutions import meshed, sectors_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.paper.stage_mesh import layers_of, plate_of, sheet_of
from flexfem.questions import setup
from flexfem.questions.bands import corner_bands, highest_band, pose_bands
from flexfem.questions.heat import (
    CASES,
    PROPORTIONAL,
    MechanismDrift,
    warnings_of_frame,
)
from flexfem.questions.plates import Values
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, Mesh, MeshFields, ModelAnswer, Models
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import NEW_MESH, SHEET, SOLID, SOLVED, STRESS, Fields, Progress, Quantity
from flexfem.units import EXPANSION

IN_DEPTH = "gradient in z"
# with 4 triangles across a neck, bands missed z of 2 of 4 stages, whose meshes agreed by chance
LEAST_SOLID = 6
# per cent by which necks of some chains are widened or narrowed to make chains differ
UNLIKE = 10.0
MORE = 1 + UNLIKE / 100
LESS = 1 - UNLIKE / 100
# factors on the necks of each chain
UNLIKE_CHAINS = (
    (MORE, 1.0, 1.0),
    (LESS, 1.0, 1.0),
    (MORE, LESS, 1.0),
)
# columns of the unit cases of `Factorised.warmed`, gradients first, in the order of `CASES`
ORDER = [2, 0, 1]


class Drift(MechanismDrift):
    """Displacement and stress of a stage per change of temperature."""

    labels: ClassVar = {"case": CASES, "out of plane": LIFTED}
    figure = "paper.figures.drift.drift_figure"
    has_mesh_fields = True
    drawn_from_fields = True
    footnotes = (
        "uniform: per K; gradients: per K/mm about the platform's centre in the mid-plane, the "
        "same in stage and frame",
        PROPORTIONAL,
    )
    pose = Quantity(
        "displacement per K or K/mm",
        "motion",
        ("case", "model", "direction"),
        NEW_MESH._replace(absolute=1e-15),
        "pose",
    )
    stress = Quantity(
        "highest hinge stress per K or K/mm",
        "mpa",
        ("case", "model", "chain", "hinge"),
        STRESS,
        "all",
    )
    edges = Quantity(
        "highest stress at clamped edges per K or K/mm",
        "mpa",
        ("case", "model", "chain"),
        STRESS,
        "all",
        note="excludes a fifth of each edge at both corners, where stress is singular",
    )
    tilt = Quantity(
        "displacement and rotations about x and y by a gradient of 1 K/mm in z",
        ("mm", "rad", "rad"),
        ("model", "out of plane"),
        NEW_MESH,
        "all",
    )
    unlike = Quantity(
        f"displacement per K or K/mm with the necks of some chains changed by {UNLIKE:g} %, "
        "analytic",
        "motion",
        ("case", "direction"),
        SOLVED,
        "pose",
    )
    reaction = Quantity(
        "reaction of the ground about the platform's centre per K or K/mm",
        "wrench",
        ("case", "model", "chain", "direction"),
        NEW_MESH,
        "all",
        shown=False,
    )
    columns = ("direction", "out of plane")


class WarmFields(NamedTuple):
    """Fields on the finest plane mesh by case, per kelvin or per K/mm.

    ground : (k, 3), edges of the mesh that are clamped to the frame.
    """

    cases: dict[str, Fields]
    ground: Index


class Solution(NamedTuple):
    """Values on one mesh, and a function that makes their fields."""

    values: Values
    fields: Callable[[], WarmFields | MeshFields]


def drift(
    stage: Stage,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> Drift:
    """Displacement and stress of a stage per kelvin, and per kelvin per mm along x, y and z."""
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = answers.mesh_of(stage, models, resolution, layers, LEAST_SOLID if layers else 4)
    with naming_place(stage):
        require_expansion(stage)
    in_depth = mesh is not None and mesh.layers > 0
    cases = (*CASES, IN_DEPTH) if in_depth else CASES
    warnings = [
        *warning.of_numbers(stage),
        *warning.of_stacks(stage),
        *warnings_of_frame(stage),
    ]
    chosen = answers.chosen(stage, analytic, warnings, models)
    if in_depth:
        warnings += warning.held_faces(stage)
    finest = list[Solution]()

    def by_pivots() -> Values:
        return _by_pivots(chosen, expansion_of(stage))

    def by_mesh(resolution: int, layers: int) -> Values:
        solve = _in_depth if layers else _in_plane
        finest[:] = [solve(stage, resolution, layers)]
        return finest[0].values

    bands = partial(_bands, stage.lever)
    found = answers.by_models(mesh, models, by_pivots, by_mesh, progress, bands)
    if mesh is not None and mesh.layers:
        found = _with_sheet(stage, mesh, found)
    return setup.result_of(
        Drift,
        answers.about_heated(stage),
        found,
        mesh,
        _settings(stage, None if models == "elements" else chosen.name),
        {} if models == "elements" else _of_unlike_chains(chosen, len(cases)),
        {"case": cases},
        warnings=warnings,
        fields=finest[0].fields() if finest else None,
    )


def _settings(stage: Stage, model: str | None) -> dict[str, Any]:
    """Return the settings of the result: both coefficients of expansion and the analytic model."""
    of_stage, of_frame = (
        f"{EXPANSION.factor * rate:g} {EXPANSION.plain}" for rate in coefficients(stage)
    )
    return {"expansion": of_stage, "frame": of_frame, "analytic model": model}


def _with_sheet(
    stage: Stage,
    mesh: Mesh,
    found: dict[str, ModelAnswer],
) -> dict[str, ModelAnswer]:
    """Return the values of models with those in plane stress before those in three dimensions."""
    response = heat_response(meshed(stage, mesh.resolution), sheet_of(stage), *coefficients(stage))
    sheet = ModelAnswer({"pose": response.motions.T})
    others = {label: answer for label, answer in found.items() if label != SOLID}
    return {**others, SHEET: sheet, SOLID: found[SOLID]}


def _bands(
    lever: float, sizes: Array, each: list[Values], ends: Sequence[Values]
) -> dict[str, Array]:
    """Return the bands of the values on three meshes, in three dimensions with those by layers."""
    on_meshes = np.array([one["pose"].T for one in each])
    at_ends = np.array([one["pose"].T for one in ends])
    found = {"pose": pose_bands(sizes, on_meshes, np.array([1.0, 1.0, lever]), at_ends).T}
    if ends:
        tilts = np.array([one["tilt"][:, None] for one in each])
        tilts_at_ends = np.array([one["tilt"][:, None] for one in ends])
        levers = np.array([1.0, lever, lever])
        found["tilt"] = pose_bands(sizes, tilts, levers, tilts_at_ends)[:, 0]
        return found
    edges = np.array([one["edges"] for one in each])
    of_cases = [highest_band(sizes, edges[:, k], corner_bands) for k in range(len(CASES))]
    found["edges"] = np.array(of_cases)
    return found


def _by_pivots(chosen: ModelChoice, expansion: Expansion) -> Values:
    """Return the three cases by the pseudo-rigid model."""
    stage = chosen.stage
    at_rest = analyse(*chosen)
    hinges = Compliance(*(part[None] for part in at_rest.hinges))
    rates = (np.array([expansion.plate]), np.array([expansion.frame]))
    bodies = None
    if chosen.links:
        bodies = WarmBodies(body_compliance(stage)[None], edge_motions(stage)[None])
    parts = analytic_drift(design_arrays(stage), hinges, at_rest.freedoms, *rates, bodies)
    pose, reaction, stress = (np.moveaxis(part[0], -1, 0) for part in parts)
    highest = _with_stress_across(stage, stress, expansion)
    return {"pose": pose, "stress": highest, "reaction": reaction}


def _with_stress_across(
    stage: Stage,
    stress: Array,
    expansion: Expansion,
) -> Array:
    """Return von Mises stresses (3 cases, 3 chains, 3 hinges) with the stress across the plane."""
    ratio = design_arrays(stage).out_of_plane
    along = stress / von_mises_along(ratio)[0]
    temperature = np.concatenate([np.ones((3, 3, 1)), stage_frames(stage).centres], axis=-1)
    by_heat = expansion.across * np.moveaxis(temperature, -1, 0)
    highest: Array = np.zeros_like(along)
    for side in (along, -along):
        across = float(ratio[0]) * side + by_heat
        highest = np.maximum(highest, np.sqrt(side**2 - side * across + across**2))
    return highest


def _of_unlike_chains(chosen: ModelChoice, cases: int) -> dict[str, Array]:
    """Return the pose (cases, 3) that moves furthest in x and y of a stage with unlike chains.

    Nothing for a stage whose chains differ, or whose necks cannot be changed. The analytic model
    has no gradient in depth, whose pose is nan.
    """
    stage = chosen.stage
    if not stage.chains_alike:
        return {}
    solutions = list[Array]()
    for factors in UNLIKE_CHAINS:
        necks = {
            (chain, name): {"neck": factor * stage.hinge(chain, name).neck}
            for chain, factor in zip(CHAINS, factors, strict=True)
            for name in HINGE_NAMES
        }
        try:
            varied = stage.replace(override=necks)
            found = _by_pivots(chosen._replace(stage=varied), expansion_of(varied))
        except (BadInput, ComputationFailed):  # a neck as wide as its link, or off the chart
            continue
        solutions.append(found["pose"])
    if not solutions:
        return {}
    poses = np.array(solutions)
    furthest = np.argmax(np.hypot(poses[..., 0], poses[..., 1]), axis=0)
    unlike = np.full((cases, 3), np.nan)
    unlike[: len(CASES)] = poses[furthest, range(len(CASES))]
    return {"unlike": unlike}


def _in_plane(
    stage: Stage,
    resolution: int,
    _: int,
) -> Solution:
    """Return the three cases by plane finite elements."""
    mesh = meshed(stage, resolution)
    plate = plate_of(stage)
    expansion = expansion_of(stage)
    response = heat_response(mesh, plate, expansion.plate, expansion.frame)
    temperatures = np.vstack([np.ones(len(mesh.nodes)), *mesh.nodes.T])
    ratio = stage.layout.out_of_plane
    nodal = nodal_stress(mesh, plate, response.nodal)
    stresses = [
        von_mises(part, ratio, expansion.across * temperature)
        for part, temperature in zip(nodal, temperatures, strict=True)
    ]
    values = {
        "pose": response.motions.T,
        "stress": np.array([neck_maxima(stage, mesh, stress) for stress in stresses]),
        "reaction": response.pads,
        "edges": np.array([edge_maxima(mesh, stress) for stress in stresses]),
    }

    def fields() -> WarmFields:
        free = expansion.plate * np.tensordot(HEAT_CASES, free_displacement(mesh.nodes), axes=1)
        part = mesh.nodes, mesh.triangles, mesh.bodies
        by_case = {
            case: Fields(*part, displacement, stress)
            for case, displacement, stress in zip(
                CASES, response.nodal + free, stresses, strict=True
            )
        }
        return WarmFields(by_case, mesh.edges["ground"])

    return Solution(values, fields)


class Warmed(NamedTuple):
    """A case in three dimensions.

    half : response of the symmetric or antisymmetric half of the thickness.   column : its case.
    field : (n, m, 3), displacement besides that of free expansion.
    """

    half: Response
    column: int
    field: Array


def _in_depth(
    stage: Stage,
    resolution: int,
    layers: int,
) -> Solution:
    """Return the four cases by wedge elements.

    A frame of another expansion strains the clamped faces most at their corners, where stress is
    singular. Poses converge by twice the exponent (M. L. Williams, J. Appl. Mech. 19 (1952) 526),
    far slower than compliances. Bands by the order of compliances on 3, 4 and 6 triangles across a
    neck missed 2 of 16 poses (of four stages) with 9.
    """
    of_stage, of_frame = coefficients(stage)
    difference = of_frame - of_stage
    sectors = sectors_of(stage, resolution)
    even, odd = (
        factorised_sectors(
            sectors, sheet_of(stage), layers_of(stage, layers, half)
        ).thermal_response()
        for half in (False, True)
    )
    loads = difference * np.eye(3)
    in_plane = neck_stresses(stage, even, loads[ORDER]).highest
    in_depth = neck_stresses(stage, odd, loads[2:]).highest
    halves = [(even, column) for column in ORDER] + [(odd, 2)]
    cases = [Warmed(half, column, difference * half.fields[column]) for half, column in halves]
    values = {
        "pose": difference * even.motions.T[ORDER],
        "stress": np.concatenate([in_plane, in_depth]),
        "edges": np.array([_clamped_stress(stage, case) for case in cases]),
        "tilt": difference * odd.motions[:, 2],
    }
    arrays = partial(_arrays, stage, cases)
    return Solution(values, lambda: MeshFields(even.mesh, arrays, even.layers.heights))


def _arrays(stage: Stage, cases: list[Warmed]) -> dict[str, Array]:
    """Return displacement and stress of the cases in three dimensions by name."""
    of_stage = coefficients(stage)[0]
    plate = sheet_of(stage)
    arrays = dict[str, Array]()
    for name, case in zip((*CASES, IN_DEPTH), cases, strict=True):
        mesh = case.half.mesh
        layers = case.half.layers
        free = free_displacement(mesh.nodes, layers)[case.column]
        stress = nodal_stress(mesh, plate, case.field, layers=layers)
        arrays[f"displacement, {name}"] = of_stage * free + case.field
        arrays[f"von Mises stress, {name}"] = von_mises(stress)
    return arrays


def _clamped_stress(stage: Stage, case: Warmed) -> Array:
    """Return the highest stress (3 chains,), MPa, on the clamped face of each pad.

    A share `CORNER` of the length and of the half thickness along the borders is left out: stress
    is singular there.
    """
    mesh = case.half.mesh
    layers = case.half.layers
    heights = layers.heights
    ground = nodes_on(mesh, "ground")
    stress = np.zeros(case.field.shape[:2])
    stress[ground] = von_mises(nodal_stress(mesh, sheet_of(stage), case.field, ground, layers))
    return largest_within(heights / heights[-1], edge_maxima(mesh, stress).T, 0.0, 1 - CORNER)
