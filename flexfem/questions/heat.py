"""Effect of a change of temperature on a stage or mechanism: pose, stress and reactions per kelvin and per K/mm.

Stage and frame have the same temperature field, linear in X and Y (in three dimensions also in Z). The stage does not
strain the frame, and all results are proportional to the difference of their coefficients of expansion. In plane strain
the faces are held at the expansion of the frame. In three dimensions they are free, and displacements out of the plane
are relative to the frame, which bows.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.model import ModelChoice, analyse
from flexfem.analytic.plates import warmed as warmed_network
from flexfem.analytic.responses import WarmBodies, in_plane, require_expansion
from flexfem.analytic.responses import drift as analytic_drift
from flexfem.arrays import Array, Index
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.fields import CORNER, edge_maxima, largest_within, neck_maxima, neck_stresses
from flexfem.fem.mesh import StageMesh, nodes_on
from flexfem.fem.ports import hinge_stress, warmed
from flexfem.fem.response import HEAT_CASES, Response, factorised_stage, free_displacement, heat_response
from flexfem.fem.stage_mesh import build_mesh, layers_of, out_of_plane_ratio_of, plate_of, sheet_of
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import von_mises_along
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate_file import located
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import corner_bands, highest_band, levels, pose_bands, solid_pose_bands
from flexfem.questions.plates import ON_MESHES, ROUND_OFF
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, Mesh, ModelAnswer, Models, on_meshes
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SHEET, SOLID, SOLVED, STRESS, Fields, Progress, Quantity, Result
from flexfem.units import EXPANSION

CASES = ("uniform", "gradient in x", "gradient in y")
FRAME = "frame.expansion_um_per_m_k"
FRAME_ASSUMED = (
    f"{FRAME} is not stated: the frame is assumed to expand like the plate, so a uniform change causes no stress; "
    "state expansion_um_per_m_k under [frame], for example 12 for steel"
)

IN_DEPTH = "gradient in z"
LEAST_SOLID = 6  # with 4 triangles across a neck, bands missed z of 2 of 4 stages, whose meshes agreed by chance
UNLIKE = 10.0  # per cent by which necks of some chains are widened or narrowed to make chains differ
_MORE, _LESS = 1 + UNLIKE / 100, 1 - UNLIKE / 100
UNLIKE_CHAINS = ((_MORE, 1.0, 1.0), (_LESS, 1.0, 1.0), (_MORE, _LESS, 1.0))  # factors on the necks of each chain
CASE_DRIFT = FRESH._replace(absolute=1e-15)


class Drift(Result):
    """Displacement and stress of a plate per change of temperature."""

    title = "change of temperature"
    main_key = FRAME
    main = ("pose", {"case": "uniform"})
    labels: ClassVar = {"case": CASES, "out of plane": LIFTED}
    figure = "fields.drift_figure"
    drawn_from_fields = True
    reading: ClassVar[tuple[str, ...]] = (
        "uniform: per K; gradients: per K/mm about the platform's centre in the mid-plane, the same in stage and frame",
        "all numbers are proportional to the difference of the two coefficients of expansion",
    )
    pose = Quantity(
        "displacement", "motion", ("case", "point", "model", "direction"), CASE_DRIFT, "pose", prefixed=True,
        uneven=ON_MESHES._replace(absolute=1e-8),
    )  # fmt: skip
    stress = Quantity(
        "highest hinge stress", "mpa", ("case", "model", "chain", "hinge"), STRESS, "all", largest=("chain", "hinge")
    )
    edges = Quantity(
        "highest stress at clamped edges", "mpa", ("case", "model", "chain"), STRESS, "all", largest=("chain",),
        only="stage",
        note="excludes a fifth of each edge at both corners, where stress is singular",
    )  # fmt: skip
    tilt = Quantity(
        "displacement and rotations about x and y by a gradient in z", ("mm", "rad", "rad"), ("model", "out of plane"),
        FRESH, "all", prefixed=True, only="stage",
    )  # fmt: skip
    unlike = Quantity(
        f"displacement with the necks of some chains changed by {UNLIKE:g} %, analytic", "motion",
        ("case", "direction"), SOLVED, "pose", prefixed=True, only="stage",
    )  # fmt: skip
    reaction = Quantity(
        "reaction of the ground about the platform's centre", "wrench",
        ("case", "model", "chain", "direction"), FRESH, "all", shown=False, only="stage",
    )  # fmt: skip
    columns = ("direction", "out of plane")


class MechanismDrift(Drift, mechanism=True):
    """The same of a mechanism."""

    figure = ""
    reading = ("uniform: per K; gradients: per K/mm about the origin, the same in the plate and in the ground",)


class Expansion(NamedTuple):
    """In-plane expansion of stage and frame, and stress across the unstrained plane, MPa; all per kelvin."""

    stage: float
    frame: float
    across: float


class WarmFields(NamedTuple):
    """Fields on the finest plane mesh by case, per kelvin or per K/mm.

    ground : (k, 3), edges of the mesh that are clamped to the frame.
    """

    cases: dict[str, Fields]
    ground: Index


@setup.options(not_for="analytic")
def drift(
    stage: Stage | Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Drift:
    """Displacement and stress of a stage or mechanism per kelvin, and per kelvin per mm along X and Y.

    Parameters
    ----------
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4, in three dimensions from 6.
    layers : int, optional
        Three-dimensional model with this number of layers in half the thickness, from 3; adds a gradient in z.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drift(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(1e6 * float(found.at("pose", case="uniform", direction="theta")[0]), 2)  # urad per kelvin
    5.5
    """
    if isinstance(stage, Mechanism):
        mesh = setup.mesh_of(models, resolution, layers, usual_solid=setup.usual_solid(stage))
        found = _of_mechanism(stage, mesh, models, progress)
        return setup.answer(Drift, stage, found, mesh, warnings=_frame_warnings(stage))
    mesh = setup.mesh_of(models, resolution, layers, LEAST_SOLID if layers else 4)
    expansion, warnings = expansion_of(stage), [*warning.of_numbers(stage), *warning.of_stacks(stage)]
    warnings += _frame_warnings(stage)
    results, values, analytic_name = dict[str, ModelAnswer](), dict[str, Array](), None
    fields: WarmFields | setup.MeshFields | None = None
    cases = (*CASES, IN_DEPTH) if mesh is not None and mesh.layers else CASES
    chosen = analytic.chosen(stage, warnings, models)
    if models != "elements":
        results[ANALYTIC], analytic_name = _by_network(chosen, expansion), chosen.name
        if stage.chains_alike and (poses := _poses_of_unlike_chains(chosen)):
            values["unlike"] = np.full((len(cases), 3), np.nan)  # the analytic model has no gradient in depth
            values["unlike"][: len(CASES)] = poses
    if mesh is not None and mesh.layers:
        results[SHEET], results[SOLID], fields = _in_three_dimensions(stage, mesh, progress)
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        results[ELEMENTS], fields = _in_plane(stage, expansion, mesh.resolution, progress)
    stage_rate, frame_rate = (f"{EXPANSION.factor * rate:g} {EXPANSION.plain}" for rate in _coefficients(stage))
    settings = {"expansion": stage_rate, "frame": frame_rate, "analytic model": analytic_name}
    subject, axes = setup.about(stage, heat=True), {"case": cases}
    return setup.answer(Drift, subject, results, mesh, settings, values, axes, warnings=warnings, fields=fields)


def _of_mechanism(
    mechanism: Mechanism, mesh: Mesh | None, models: Models, progress: Progress | None
) -> dict[str, ModelAnswer]:
    """Return the three cases by all models of a mechanism. Raises BadInput if no coefficient is stated."""
    layout, material = mechanism.layout, mechanism.material
    with located(mechanism):
        require_expansion(mechanism)
    lever, rates = layout.lever, _coefficients(mechanism)
    strains = max(rates) * np.array([1.0, lever, lever])[:, None]  # free expansion by case

    def cleared(motions: Array, stress: Array) -> dict[str, Array]:
        """Return poses (cases, points, 3) and stresses (cases, hinges) without round-off."""
        pose, sizes = motions[: 3 * len(layout.points)].T.reshape(3, -1, 3), strains[:, None] * [lever, lever, 1.0]
        return {
            "pose": np.where(np.abs(pose) < ROUND_OFF * sizes, 0.0, pose),
            "stress": np.where(stress < ROUND_OFF * material.youngs_modulus * strains, 0.0, stress),
        }

    def of_network(elastic: bool) -> dict[str, Array]:
        motions, wrenches = warmed_network(layout, *rates, *plates.joined_parts(mechanism, elastic))
        return cleared(motions, plates.stress_by(mechanism, np.moveaxis(wrenches, -1, 0)))

    def of_size(resolution: int, layers: int) -> dict[str, Array]:
        response = warmed(plates.factorised(mechanism, resolution, layers), *rates)
        return cleared(response.motions, hinge_stress(response, np.eye(3)))

    return plates.by_models(mechanism, mesh, models, of_network, of_size, progress)


def _frame_warnings(plate: Stage | Mechanism) -> list[str]:
    return [FRAME_ASSUMED] * (plate.frame.expansion is None)


def _coefficients(plate: Stage | Mechanism) -> tuple[float, float]:
    """Return the coefficients of plate and frame, 1/K; that of the plate for both if none is stated for the frame."""
    of_plate = float(plate.material.expansion or 0.0)
    return of_plate, of_plate if plate.frame.expansion is None else plate.frame.expansion


def expansion_of(stage: Stage) -> Expansion:
    """Return the expansion in the plane problem of a stage. Raises BadInput if no coefficient is stated."""
    with located(stage):
        require_expansion(stage)
    (plane,), (frame,) = in_plane(lower(stage))
    free = float(frame) - _coefficients(stage)[0]
    across = stage.material.youngs_modulus * free if stage.model == "plane_strain" else 0.0  # held at the frame's
    return Expansion(float(plane), float(frame), across)


def _by_network(chosen: ModelChoice, expansion: Expansion) -> ModelAnswer:
    """Return the three cases by the pseudo-rigid model."""
    stage, at_rest = chosen.stage, analyse(*chosen)
    design = lower(stage)
    hinges = Compliance(*(part[None] for part in at_rest.hinges))
    rates = (np.array([expansion.stage]), np.array([expansion.frame]))
    bodies = WarmBodies(body_compliance(stage)[None], edge_motions(stage)[None]) if chosen.links else None
    pose, reaction, stress = (
        np.moveaxis(part[0], -1, 0) for part in analytic_drift(design, hinges, at_rest.freedoms, *rates, bodies)
    )
    along, ratio = stress / von_mises_along(design.out_of_plane)[0], float(design.out_of_plane[0])
    temperature = np.concatenate([np.ones((3, 3, 1)), stage_frames(stage).centres], axis=-1)
    across = expansion.across * np.moveaxis(temperature, -1, 0)
    stress = np.max([np.sqrt(s**2 - s * z + z**2) for s in (along, -along) for z in (ratio * s + across,)], axis=0)
    return ModelAnswer({"pose": pose, "stress": stress, "reaction": reaction})


def _in_plane(
    stage: Stage, expansion: Expansion, resolution: int, progress: Progress | None
) -> tuple[ModelAnswer, WarmFields]:
    """Return the three cases by plane finite elements on three meshes."""

    def solve(level: int) -> tuple[StageMesh, Response, list[Array], list[Array]]:
        mesh = build_mesh(stage, level)
        response = heat_response(mesh, plate_of(stage), expansion.stage, expansion.frame)
        temperature = np.column_stack([np.ones(len(mesh.nodes)), mesh.nodes])
        ratio, nodal = out_of_plane_ratio_of(stage), nodal_stress(mesh, plate_of(stage), response.nodal)
        stresses = [von_mises(nodal[k], ratio, expansion.across * temperature[:, k]) for k in range(3)]
        return mesh, response, stresses, [edge_maxima(mesh, stress) for stress in stresses]

    steps, meshes = np.array(levels(resolution), dtype=float), on_meshes(levels(resolution), solve, progress)
    (mesh, finest, stresses, _), edges = meshes[-1], np.array([solution[-1] for solution in meshes])
    poses = np.array([solution[1].motions for solution in meshes])
    values = {
        "pose": finest.motions.T,
        "stress": np.array([neck_maxima(stage, mesh, stress) for stress in stresses]),
        "reaction": finest.pads,
        "edges": edges[-1],
    }
    bands = {
        "pose": pose_bands(steps, poses, stage.chain.link_lengths[2]).T,
        "edges": np.array([highest_band(steps, edges[:, k], corner_bands) for k in range(3)]),
    }
    free = expansion.stage * np.tensordot(HEAT_CASES, free_displacement(mesh.nodes), axes=1)
    drawn = {
        case: Fields(mesh.nodes, mesh.triangles, mesh.bodies, finest.nodal[k] + free[k], stresses[k])
        for k, case in enumerate(CASES)
    }
    return ModelAnswer(values, bands), WarmFields(drawn, mesh.edges["ground"])


def _in_three_dimensions(
    stage: Stage, mesh: Mesh, progress: Progress | None
) -> tuple[ModelAnswer, ModelAnswer, setup.MeshFields]:
    """Return the four cases by wedge elements, in plane stress on the same mesh and in three dimensions.

    A frame of another expansion strains the clamped faces most at their corners, where stress is singular. Poses
    converge by twice the exponent (M. L. Williams, J. Appl. Mech. 19 (1952) 526), far slower than compliances. Bands by
    the order of compliances on 3, 4 and 6 triangles across a neck missed 2 of 16 poses (of four stages) with 9.
    """
    of_stage, of_frame = _coefficients(stage)
    difference, lever, plate = of_frame - of_stage, stage.chain.link_lengths[2], sheet_of(stage)

    def solve_half(antisymmetric: bool) -> tuple[Response, Array]:
        scale = np.array([1.0, lever if antisymmetric else 1.0, lever])[:, None]

        def solve(level: int, number: int) -> Response:
            return factorised_stage(
                setup.sectors_of(stage, level), plate, layers_of(stage, number, antisymmetric)
            ).warmed()

        band = solid_pose_bands(lambda *sizes: scale * solve(*sizes).motions, *mesh)
        return solve(*mesh), abs(difference) * band / scale

    (even, pose_band), (odd, tilt_band) = on_meshes((False, True), solve_half, progress)
    order = [2, 0, 1]  # cases of the even half; the odd one has the last case
    columns = [(even, column) for column in order] + [(odd, 2)]
    cases = [(response, column, difference * response.fields[column]) for response, column in columns]
    loads = difference * np.eye(3)
    solid = ModelAnswer(
        {
            "pose": difference * even.motions.T[order],
            "stress": [
                *neck_stresses(stage, even, loads[order]).highest,
                *neck_stresses(stage, odd, loads[2:]).highest,
            ],
            "edges": [_clamped_stress(stage, response, field) for response, _, field in cases],
            "tilt": difference * odd.motions[:, 2],
        },
        {"pose": pose_band.T[order], "tilt": tilt_band[:, 2]},
    )
    sheet = ModelAnswer({"pose": heat_response(even.mesh, plate, of_stage, of_frame).motions.T})

    def fields() -> dict[str, Array]:
        arrays = dict[str, Array]()
        for case, (response, column, field) in zip((*CASES, IN_DEPTH), cases, strict=True):
            stress = von_mises(nodal_stress(response.mesh, plate, field, layers=response.layers))
            free = free_displacement(response.mesh.nodes, response.layers)[column]
            arrays |= {f"displacement, {case}": of_stage * free + field, f"von Mises stress, {case}": stress}
        return arrays

    return sheet, solid, setup.MeshFields(even.mesh, fields, even.layers.heights)


def _clamped_stress(stage: Stage, response: Response, field: Array) -> Array:
    """Return the highest stress (3 chains,), MPa, on the clamped face of each pad; field (n, m, 3) excludes expansion.

    A share `CORNER` of the length and of the half thickness along the borders is left out: stress is singular there.
    """
    ground, heights = nodes_on(response.mesh, "ground"), response.layers.heights
    stress = np.zeros(field.shape[:2])
    stress[ground] = von_mises(nodal_stress(response.mesh, sheet_of(stage), field, ground, response.layers))
    return largest_within(heights / heights[-1], edge_maxima(response.mesh, stress).T, 0.0, 1 - CORNER)


def _poses_of_unlike_chains(chosen: ModelChoice) -> list[Array]:
    """Return, by case, the pose (3,) that moves furthest in X and Y among those of the stage with unlike chains."""
    stage, solutions = chosen.stage, []
    for factors in UNLIKE_CHAINS:
        necks = {
            (chain, name): {"neck": factor * stage.hinge(chain, name).neck}
            for chain, factor in zip(CHAINS, factors, strict=True)
            for name in HINGE_NAMES
        }
        try:
            varied = stage.replace(override=necks)
            solutions.append(_by_network(chosen._replace(stage=varied), expansion_of(varied)).values["pose"])
        except (BadInput, ComputationFailed):  # a neck as wide as its link, or off the chart
            continue
    return [max(poses, key=lambda pose: float(np.hypot(*pose[:2]))) for poses in zip(*solutions, strict=True)]
