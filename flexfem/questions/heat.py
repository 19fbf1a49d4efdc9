"""Effect of a change of temperature on a stage or mechanism: pose, stress and reactions per kelvin
and per K/mm.

Stage and frame have the same temperature field, linear in X and Y (in three dimensions also in Z).
The stage does not strain the frame, and all results are proportional to the difference of their
coefficients of expansion. In plane strain the faces are held at the expansion of the frame: the
plate expands in the plane by `a + nu (a - a_frame)`, and carries `E (a_frame - a)` out of the plane
besides the stress of plane strain, both per kelvin. In three dimensions the faces are free, and
displacements out of the plane are relative to the frame, which bows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.plates import warmed as warmed_network
from flexfem.arrays import Array, Index
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.mesh import nodes_on
from flexfem.fem.ports import warm_stress, warmed
from flexfem.fem.response import (
    HEAT_CASES,
    Response,
    factorised_stage,
    free_displacement,
    heat_response,
)
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import von_mises_along
from flexfem.mechanism.content import located
from flexfem.mechanism.layout import Constants
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.designs import lower, stage_frames
from flexfem.paper.fields import CORNER, edge_maxima, largest_within, neck_maxima, neck_stresses
from flexfem.paper.links import body_compliance, edge_motions
from flexfem.paper.model import ModelChoice, analyse
from flexfem.paper.responses import WarmBodies, expansion_in_plane, require_expansion
from flexfem.paper.responses import drift as analytic_drift
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.paper.stage_mesh import layers_of, plate_of, sheet_of
from flexfem.questions import plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import corner_bands, highest_band, pose_bands
from flexfem.questions.plates import ON_MESHES, ROUND_OFF, Values
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, ModelAnswer, Models
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import FRESH, SHEET, SOLID, SOLVED, STRESS, Fields, Progress, Quantity, Result
from flexfem.units import EXPANSION

CASES = ("uniform", "gradient in x", "gradient in y")
FRAME = "frame.expansion_um_per_m_k"
FRAME_ASSUMED = (
    f"{FRAME} is not stated: the frame is assumed to expand like the plate, so a uniform change "
    "causes no stress; state expansion_um_per_m_k under [frame], for example 12 for steel"
)

IN_DEPTH = "gradient in z"
# with 4 triangles across a neck, bands missed z of 2 of 4 stages, whose meshes agreed by chance
LEAST_SOLID = 6
UNLIKE = (
    10.0  # per cent by which necks of some chains are widened or narrowed to make chains differ
)
_MORE = 1 + UNLIKE / 100
_LESS = 1 - UNLIKE / 100
UNLIKE_CHAINS = (
    (_MORE, 1.0, 1.0),
    (_LESS, 1.0, 1.0),
    (_MORE, _LESS, 1.0),
)  # factors on the necks of each chain
CASE_DRIFT = FRESH._replace(absolute=1e-15)


class Drift(Result):
    """Displacement and stress of a plate per change of temperature."""

    title = "change of temperature"
    main_key = FRAME
    main = ("pose", {"case": "uniform"})
    labels: ClassVar = {"case": CASES, "out of plane": LIFTED}
    figure = "paper.figures.drift.drift_figure"
    drawn_from_fields = True
    reading: ClassVar[tuple[str, ...]] = (
        "uniform: per K; gradients: per K/mm about the platform's centre in the mid-plane, the "
        "same in stage and frame",
        "all numbers are proportional to the difference of the two coefficients of expansion",
    )
    pose = Quantity(
        "displacement per K or K/mm",
        "motion",
        ("case", "point", "model", "direction"),
        CASE_DRIFT,
        "pose",
        uneven=ON_MESHES._replace(absolute=1e-8),
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
        only="stage",
        note="excludes a fifth of each edge at both corners, where stress is singular",
    )
    tilt = Quantity(
        "displacement and rotations about x and y by a gradient of 1 K/mm in z",
        ("mm", "rad", "rad"),
        ("model", "out of plane"),
        FRESH,
        "all",
        only="stage",
    )
    unlike = Quantity(
        f"displacement per K or K/mm with the necks of some chains changed by {UNLIKE:g} %, "
        "analytic",
        "motion",
        ("case", "direction"),
        SOLVED,
        "pose",
        only="stage",
    )
    reaction = Quantity(
        "reaction of the ground about the platform's centre per K or K/mm",
        "wrench",
        ("case", "model", "chain", "direction"),
        FRESH,
        "all",
        shown=False,
        only="stage",
    )
    columns = ("direction", "out of plane")


class MechanismDrift(Drift, mechanism=True):
    """The same of a mechanism."""

    figure = ""
    reading = (
        "uniform: per K; gradients: per K/mm about the origin, the same in the plate and in the "
        "ground",
    )


class Expansion(NamedTuple):
    """Expansion of plate and frame in the plane, and stress across the unstrained plane, MPa; all
    per kelvin.

    across : of a mechanism whose parts have different materials (h,), of its hinges.
    of_parts : of these bodies, then hinges; None of others.
    """

    plate: float
    frame: float
    across: Any
    of_parts: Array | None = None

    def unlike_hinges(self, bodies: int) -> Array | float:
        """Expansion of hinges, which follow the bodies in `of_parts`, less that of the plate."""
        return 0.0 if self.of_parts is None else self.of_parts[bodies:] - self.plate


class WarmFields(NamedTuple):
    """Fields on the finest plane mesh by case, per kelvin or per K/mm.

    ground : (k, 3), edges of the mesh that are clamped to the frame.
    """

    cases: dict[str, Fields]
    ground: Index


Drawn: TypeAlias = Callable[[], WarmFields | setup.MeshFields]


@setup.options(not_for="analytic", only_for="plane")
def drift(
    stage: Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Drift:
    """Displacement and stress of a stage or mechanism per kelvin, and per kelvin per mm along X and
    Y.

    In plane strain the faces are held at the expansion of the frame. In plane stress and in three
    dimensions they are free.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4, in three dimensions from
        6.
    solid : bool
        The whole plate by finite elements in three dimensions; adds a gradient in z.
    models : {"both", "analytic", "elements"}
        The models to compute.
    analytic : Analytic
        The analytic model. Of a stage file only.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Drift
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        drift` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drift(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(1e6 * float(found.at("pose", case="uniform", direction="theta")[0]), 2)  # urad per kelvin
    5.5
    """
    layers = setup.elements_through(solid, thickness_resolution)
    least = LEAST_SOLID if layers and isinstance(stage, Stage) else 4
    mesh = plates.mesh_of(stage, models, resolution, layers, least=least)
    with located(stage):
        require_expansion(stage)
    warnings = _frame_warnings(stage)
    drawn = list[Drawn]()
    lever = setup.lever_of(stage)
    rates = _coefficients(stage)
    others = dict[str, Array]()
    settings = dict[str, Any]()
    cases: tuple[str, ...] = CASES
    expansion = expansion_of(stage)
    in_depth = _expansions_of_parts(stage, False)
    if isinstance(stage, Stage):
        warnings[:0] = [*warning.of_numbers(stage), *warning.of_stacks(stage)]
        cases = (*CASES, IN_DEPTH) if mesh is not None and mesh.layers else CASES
        chosen = analytic.chosen(stage, warnings, models)
        stage_rate, frame_rate = (
            f"{EXPANSION.factor * rate:g} {EXPANSION.plain}" for rate in rates
        )
        settings = {"expansion": stage_rate, "frame": frame_rate, "analytic model": None}
        if models != "elements":
            settings["analytic model"] = chosen.name
        if (
            models != "elements"
            and stage.chains_alike
            and (poses := _poses_of_unlike_chains(chosen))
        ):
            others["unlike"] = np.full(
                (len(cases), 3), np.nan
            )  # the analytic model has no gradient in depth
            others["unlike"][: len(CASES)] = poses
        if mesh is not None and mesh.layers:
            warnings += warning.held_faces(stage)

    def of_network(elastic: bool) -> Values:
        if isinstance(stage, Stage):
            return _by_network(chosen, expansion)
        in_plane = expansion.plate, expansion.frame
        parts = plates.joined_parts(stage, elastic)
        motions, wrenches = warmed_network(stage.layout, *in_plane, *parts, expansion.of_parts)
        places = np.array([joint.place for joint in stage.layout.joints])
        across = expansion.across * np.vstack([np.ones(len(places)), places.real, places.imag])
        stress = plates.stress_by(stage, np.moveaxis(wrenches, -1, 0), elastic, across)
        return _without_round_off(stage, motions, stress)

    @cache
    def warmed_on(resolution: int, layers: int) -> tuple[Array, Array]:
        """Motions (k, 3) of the ports and stress (3, h) in hinges by finite elements."""
        assert isinstance(stage, MechanismFile)
        of = (
            expansion._replace(plate=rates[0], frame=rates[1], of_parts=in_depth)
            if layers
            else expansion
        )
        response = warmed(
            plates.factorised(stage, resolution, layers), of.plate, of.frame, of.of_parts
        )
        return response.motions, warm_stress(
            response, of.across, of.unlike_hinges(len(stage.layout.bodies))
        )

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        if isinstance(stage, Stage):
            solve = (
                partial(_in_three_dimensions, layers=layers)
                if layers
                else partial(_in_plane, expansion=expansion)
            )
            values, *drawn[:] = solve(stage, resolution)
            return values
        motions, stress = warmed_on(resolution, layers)
        if thick is not None:
            motions = motions + thick.change(
                lambda parts: warmed_network(stage.layout, *rates, *parts, in_depth)[0]
            )
            wrenches = warmed_network(stage.layout, *rates, *thick.solid, in_depth)[1]
            stress = stress * thick.stress_ratios(np.moveaxis(wrenches, -1, 0))
        return _without_round_off(stage, motions, stress)

    def bands(sizes: Array, each: list[Values], ends: Sequence[Values]) -> Values:
        poses, poses_at_ends = (
            np.array([one["pose"].reshape(-1, 3).T for one in part]) for part in (each, ends)
        )
        pose = pose_bands(sizes, poses, np.array([1.0, 1.0, lever]), poses_at_ends)
        found = {"pose": pose.T.reshape(each[-1]["pose"].shape)}
        if isinstance(stage, MechanismFile):
            return plates.value_bands(sizes, each, ends) | found
        if not ends:
            edges = np.array([one["edges"] for one in each])
            return found | {
                "edges": np.array(
                    [highest_band(sizes, edges[:, k], corner_bands) for k in range(3)]
                )
            }
        tilts, tilts_at_ends = (
            np.array([one["tilt"][:, None] for one in part]) for part in (each, ends)
        )
        return found | {
            "tilt": pose_bands(sizes, tilts, np.array([1.0, lever, lever]), tilts_at_ends)[:, 0]
        }

    found = plates.by_models(stage, mesh, models, of_network, of_size, progress, bands)
    if isinstance(stage, Stage) and mesh is not None and mesh.layers:
        sheet = heat_response(
            plates.meshed(stage, mesh.resolution), sheet_of(stage), *rates
        ).motions.T
        extruded = found.pop(SOLID)
        found |= {SHEET: ModelAnswer({"pose": sheet}), SOLID: extruded}
    subject = stage if isinstance(stage, MechanismFile) else setup.about(stage, heat=True)
    fields = drawn[0]() if drawn else None
    return setup.answer(
        Drift,
        subject,
        found,
        mesh,
        settings,
        others,
        {"case": cases},
        warnings=warnings,
        fields=fields,
    )


def _without_round_off(mechanism: Mechanism, motions: Array, stress: Array) -> Values:
    """Return poses (cases, points, 3) and stresses (cases, hinges) without values far below those
    of held plates.
    """
    lever = mechanism.layout.lever
    points = len(mechanism.layout.points)
    largest = max(
        *_coefficients(mechanism),
        *(material.expansion or 0.0 for material in mechanism.layout.materials),
    )
    strains = largest * np.array([1.0, lever, lever])[:, None]  # free expansion by case
    pose = motions[: 3 * points].T.reshape(3, -1, 3)
    sizes = strains[:, None] * [lever, lever, 1.0]
    return {
        "pose": np.where(np.abs(pose) < ROUND_OFF * sizes, 0.0, pose),
        "stress": np.where(
            stress < ROUND_OFF * mechanism.material.youngs_modulus * strains, 0.0, stress
        ),
    }


def _frame_warnings(plate: Mechanism) -> list[str]:
    return [FRAME_ASSUMED] * (plate.frame.expansion is None)


def _coefficients(plate: Mechanism) -> tuple[float, float]:
    """Return the coefficients of plate and frame, 1/K; that of the plate for both if none is stated
    for the frame.
    """
    of_plate = float(plate.material.expansion or 0.0)
    return of_plate, of_plate if plate.frame.expansion is None else plate.frame.expansion


def expansion_of(plate: Mechanism) -> Expansion:
    """Return the expansion in the plane problem of a stage or mechanism."""
    of_plate, of_frame = _coefficients(plate)
    in_plane = expansion_in_plane(of_plate, of_frame, plate.layout.out_of_plane)
    if plate.model != "plane_strain":
        return Expansion(in_plane, of_frame, 0.0, _expansions_of_parts(plate, True))
    across: Any = plate.material.youngs_modulus * (of_frame - of_plate)
    if isinstance(plate, MechanismFile) and plate.layout.mixed:
        across = np.array(
            [
                _stress_across(plate.layout.material_of(joint), of_frame)
                for joint in plate.layout.joints
            ]
        )
    return Expansion(in_plane, of_frame, across, _expansions_of_parts(plate, True))


def _stress_across(material: Constants, frame: float) -> float:
    """Return the stress across the held plane of a material in plane strain, MPa per kelvin."""
    youngs_modulus = material.youngs_modulus * (1 - material.out_of_plane**2)
    return youngs_modulus * (frame - float(material.expansion or 0.0))


def _expansions_of_parts(plate: Mechanism, in_plane: bool) -> Array | None:
    """Return the expansions of bodies, then hinges, of the plane problem or of the material; None
    if they are alike.
    """
    if isinstance(plate, Stage) or not plate.layout.mixed:
        return None
    frame = _coefficients(plate)[1]
    found = list[float]()
    for material in plate.layout.materials:
        own = float(material.expansion or 0.0)
        found.append(expansion_in_plane(own, frame, material.out_of_plane) if in_plane else own)
    return np.array(found)


def _by_network(chosen: ModelChoice, expansion: Expansion) -> Values:
    """Return the three cases by the pseudo-rigid model."""
    stage = chosen.stage
    at_rest = analyse(*chosen)
    design = lower(stage)
    hinges = Compliance(*(part[None] for part in at_rest.hinges))
    rates = (np.array([expansion.plate]), np.array([expansion.frame]))
    bodies = (
        WarmBodies(body_compliance(stage)[None], edge_motions(stage)[None])
        if chosen.links
        else None
    )
    pose, reaction, stress = (
        np.moveaxis(part[0], -1, 0)
        for part in analytic_drift(design, hinges, at_rest.freedoms, *rates, bodies)
    )
    along = stress / von_mises_along(design.out_of_plane)[0]
    ratio = float(design.out_of_plane[0])
    temperature = np.concatenate([np.ones((3, 3, 1)), stage_frames(stage).centres], axis=-1)
    across = expansion.across * np.moveaxis(temperature, -1, 0)
    stress = np.max(
        [np.sqrt(s**2 - s * z + z**2) for s in (along, -along) for z in (ratio * s + across,)],
        axis=0,
    )
    return {"pose": pose, "stress": stress, "reaction": reaction}


def _in_plane(stage: Stage, resolution: int, expansion: Expansion) -> tuple[Values, Drawn]:
    """Return the three cases by plane finite elements, and their fields."""
    mesh = plates.meshed(stage, resolution)
    plate = plate_of(stage)
    response = heat_response(mesh, plate, expansion.plate, expansion.frame)
    temperature = np.column_stack([np.ones(len(mesh.nodes)), mesh.nodes])
    ratio = stage.layout.out_of_plane
    nodal = nodal_stress(mesh, plate, response.nodal)
    stresses = [von_mises(nodal[k], ratio, expansion.across * temperature[:, k]) for k in range(3)]
    values = {
        "pose": response.motions.T,
        "stress": np.array([neck_maxima(stage, mesh, stress) for stress in stresses]),
        "reaction": response.pads,
        "edges": np.array([edge_maxima(mesh, stress) for stress in stresses]),
    }

    def fields() -> WarmFields:
        free = expansion.plate * np.tensordot(HEAT_CASES, free_displacement(mesh.nodes), axes=1)
        cases = zip(CASES, response.nodal + free, stresses, strict=True)
        part = mesh.nodes, mesh.triangles, mesh.bodies
        return WarmFields(
            {case: Fields(*part, *field) for case, *field in cases}, mesh.edges["ground"]
        )

    return values, fields


def _in_three_dimensions(stage: Stage, resolution: int, layers: int) -> tuple[Values, Drawn]:
    """Return the four cases by wedge elements, and their fields.

    A frame of another expansion strains the clamped faces most at their corners, where stress is
    singular. Poses converge by twice the exponent (M. L. Williams, J. Appl. Mech. 19 (1952) 526),
    far slower than compliances. Bands by the order of compliances on 3, 4 and 6 triangles across a
    neck missed 2 of 16 poses (of four stages) with 9."""
    of_stage, of_frame = _coefficients(stage)
    plate = sheet_of(stage)
    sectors = setup.sectors_of(stage, resolution)
    difference = of_frame - of_stage
    even, odd = (
        factorised_stage(sectors, plate, layers_of(stage, layers, half)).warmed()
        for half in (False, True)
    )
    order = [2, 0, 1]
    loads = difference * np.eye(3)  # cases of the even half; the odd one has the last case
    columns = [(even, column) for column in order] + [(odd, 2)]
    cases = [
        (response, column, difference * response.fields[column]) for response, column in columns
    ]
    values = {
        "pose": difference * even.motions.T[order],
        "stress": np.concatenate(
            [
                neck_stresses(stage, half, part).highest
                for half, part in ((even, loads[order]), (odd, loads[2:]))
            ]
        ),
        "edges": np.array(
            [_clamped_stress(stage, response, field) for response, _, field in cases]
        ),
        "tilt": difference * odd.motions[:, 2],
    }

    def made() -> dict[str, Array]:
        arrays = dict[str, Array]()
        for case, (response, column, field) in zip((*CASES, IN_DEPTH), cases, strict=True):
            stress = von_mises(nodal_stress(response.mesh, plate, field, layers=response.layers))
            free = free_displacement(response.mesh.nodes, response.layers)[column]
            arrays |= {
                f"displacement, {case}": of_stage * free + field,
                f"von Mises stress, {case}": stress,
            }
        return arrays

    return values, lambda: setup.MeshFields(even.mesh, made, even.layers.heights)


def _clamped_stress(stage: Stage, response: Response, field: Array) -> Array:
    """Return the highest stress (3 chains,), MPa, on the clamped face of each pad; field (n, m, 3)
    excludes expansion.

    A share `CORNER` of the length and of the half thickness along the borders is left out: stress
    is singular there."""
    ground = nodes_on(response.mesh, "ground")
    heights = response.layers.heights
    stress = np.zeros(field.shape[:2])
    stress[ground] = von_mises(
        nodal_stress(response.mesh, sheet_of(stage), field, ground, response.layers)
    )
    return largest_within(
        heights / heights[-1], edge_maxima(response.mesh, stress).T, 0.0, 1 - CORNER
    )


def _poses_of_unlike_chains(chosen: ModelChoice) -> list[Array]:
    """Return, by case, the pose (3,) that moves furthest in X and Y among those of the stage with
    unlike chains.
    """
    stage = chosen.stage
    solutions = []
    for factors in UNLIKE_CHAINS:
        necks = {
            (chain, name): {"neck": factor * stage.hinge(chain, name).neck}
            for chain, factor in zip(CHAINS, factors, strict=True)
            for name in HINGE_NAMES
        }
        try:
            varied = stage.replace(override=necks)
            solutions.append(
                _by_network(chosen._replace(stage=varied), expansion_of(varied))["pose"]
            )
        except (BadInput, ComputationFailed):  # a neck as wide as its link, or off the chart
            continue
    return [
        max(poses, key=lambda pose: float(np.hypot(*pose[:2])))
        for poses in zip(*solutions, strict=True)
    ]
