"""A stage or mechanism at rest: stiffness, stress, range at yield, response to a load, and its summary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import analyse
from flexfem.arrays import Array, free_stiffness, is_largest
from flexfem.fem.elements import Plate, nodal_stress, von_mises
from flexfem.fem.fields import neck_stresses, plane_stress
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import sheet_of
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.questions import actuators, plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import (
    SolidLevels,
    compliance_bands,
    levels,
    solid_bands,
    solid_levels,
    solve_solid,
    stress_bands,
)
from flexfem.questions.modes import modes
from flexfem.questions.plates import ON_MESHES, PEAK, Responses, Values
from flexfem.questions.reach import reach
from flexfem.questions.setup import DEFAULT, Analytic, Mesh, MeshFields, ModelAnswer, Models, on_meshes
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSER,
    ELEMENTS,
    FRESH,
    SHEET,
    SOLID,
    SOLVED,
    STRESS,
    Gate,
    Progress,
    Quantity,
    Result,
)
from flexfem.units import DIRECTIONS, PLANES

HELD = "plane strain"  # label of the stiffer of the plane problems that bound three dimensions
MATRIX, NECKS, BY_DIRECTION = ("model", "component", "direction"), ("model", "chain", "hinge"), ("direction", "model")
Loads: TypeAlias = Callable[[Array], Array | None]  # returns the requested load for a stiffness


class Stiffness(Result):
    """Stiffness, stress per displacement and range at yield of a stage at rest, and its response to one load."""

    title = "stage at rest"
    main = ("free", {})
    stiffness = Quantity("stiffness", "stiffness matrix", MATRIX, COARSER, "matrix")
    compliance = Quantity("compliance", "compliance matrix", MATRIX, COARSER, "matrix")
    free = Quantity("stiffness, other directions free", "stiffness", ("model", "direction"), COARSER)
    stress = Quantity(
        "highest neck stress per displacement, other directions held", "stress per motion",
        (*NECKS, "direction"), STRESS, "all", largest=("chain", "hinge"),
    )  # fmt: skip
    yield_range = Quantity(
        "displacement at which the first neck yields, other directions held", "motion", ("model", "direction"), STRESS,
        prefixed=True,
    )  # fmt: skip
    yield_force = Quantity("force along the displacement at yield", "wrench", ("model", "direction"), STRESS)
    thickness = Quantity("change of stiffness in three dimensions", "percents", ("direction",))
    force = Quantity("load on the platform", "wrench", ("model", "direction"), COARSER, "wrench")
    pose = Quantity(
        "displacement of the platform under the load", "motion", ("model", "direction"), COARSER, "pose", prefixed=True
    )
    reaction = Quantity("reaction of the ground", "wrench", ("model", "direction"), COARSER, "wrench")
    energy = Quantity("strain energy", "n_mm", ("model",), COARSER)
    neck_stress = Quantity("neck stress under the load", "mpa", NECKS, STRESS, "all", largest=("chain", "hinge"))
    neck_height = Quantity("distance of the highest stress from the mid-plane", "mm", NECKS, shown=False)
    band_plane = Quantity("band of the compliance by the mesh in the plane", "compliance matrix", MATRIX, shown=False)
    band_thickness = Quantity("band of the compliance by the layers", "compliance matrix", MATRIX, shown=False)
    hinge_rotation = Quantity("rotational compliance of the hinges", "rad_per_n_mm", ("chain", "hinge"), shown=False)
    hinge_axial = Quantity("axial compliance of the hinges", "mm_per_n", ("chain", "hinge"), shown=False)
    hinge_shear = Quantity("shear compliance of the hinges", "mm_per_n", ("chain", "hinge"), shown=False)


class MechanismStiffness(Result):
    """Stiffness, stress per displacement, range at yield and inputs of a mechanism at rest; response to one load."""

    title = "mechanism at rest"
    main = ("free", {})
    figure, drawn_from_fields = "plate.load_figure", True
    stiffness = Quantity(
        "stiffness matrix", "stiffness matrix", ("model", "component", "direction"), ON_MESHES, "matrix"
    )
    compliance = Quantity(
        "compliance matrix", "compliance matrix", ("model", "component", "direction"), ON_MESHES, "matrix", shown=False
    )
    free = Quantity("stiffness, other directions free", "stiffness", ("model", "direction"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress per displacement, other directions held", "stress per motion",
        ("model", "hinge", "direction"), PEAK, "all", largest=("hinge",),
    )  # fmt: skip
    yield_range = Quantity(
        "displacement at which the first hinge yields, other directions held", "motion", ("model", "direction"),
        PEAK, prefixed=True,
    )  # fmt: skip
    yield_force = Quantity("force along the displacement at yield", "wrench", ("model", "direction"), PEAK)
    input_stiffness = Quantity("stiffness at the actuator, output free", "n_per_um", ("actuator", "model"), ON_MESHES)
    amplification = Quantity(
        "output motion per actuator opening, output free", ("", "", "rad_per_mm"), ("actuator", "model", "direction"),
        ON_MESHES, "all",
    )  # fmt: skip
    force = Quantity("load on the output", "wrench", ("model", "direction"), ON_MESHES, "wrench")
    pose = Quantity("displacement under the load", "motion", ("model", "point", "direction"), ON_MESHES, "pose",
                    prefixed=True)  # fmt: skip
    energy = Quantity("strain energy", "n_mm", ("model",), ON_MESHES)
    hinge_stress = Quantity("hinge stress under the load", "mpa", ("model", "hinge"), PEAK, "all",
                            largest=("hinge",))  # fmt: skip


class Summary(Result):
    """Stiffness, range at yield, force and stress by direction, and the ranges of the drive."""

    title = "summary"
    main = ("free", {})
    reading = (
        "range at yield: displacement at which the first neck yields, others held; force at yield: force along it",
        "others: the other two directions, held at zero or free; drive min, max: range of the drive",
    )
    stiffness = Quantity("stiffness, others held", "stiffness", BY_DIRECTION, COARSER)
    free = Quantity("stiffness, others free", "stiffness", BY_DIRECTION, COARSER)
    yield_range = Quantity("range at yield, ±", "motion", BY_DIRECTION, STRESS, prefixed=True)
    yield_force = Quantity("force at yield", "wrench", BY_DIRECTION, STRESS)
    stress = Quantity(
        "neck stress per displacement", "stress per motion", (*BY_DIRECTION, "chain", "hinge"), STRESS, "all",
        largest=("chain", "hinge"),
    )  # fmt: skip
    thickness = Quantity("change of stiffness in 3D", "percent", ("direction",))
    held_low = Quantity("drive min, others held", "motion", ("direction",), SOLVED, prefixed=True)
    held_high = Quantity("drive max, others held", "motion", ("direction",), SOLVED, prefixed=True)
    free_low = Quantity("drive min, others free", "motion", ("direction",), SOLVED, prefixed=True)
    free_high = Quantity("drive max, others free", "motion", ("direction",), SOLVED, prefixed=True)


class MechanismSummary(Summary):
    """Stiffness, range at yield, force, stress, first frequency, input and ranges of the actuators of a mechanism."""

    stress = Quantity(
        "hinge stress per displacement", "stress per motion", (*BY_DIRECTION, "hinge"), STRESS, "all",
        largest=("hinge",),
    )  # fmt: skip
    amplification = Quantity("output motion per actuator opening", ("", "", "rad_per_mm"), BY_DIRECTION, COARSER, "all")
    frequency = Quantity("first natural frequency", "hz", ("model",), Gate(FRESH.relative, 0.2))
    input_stiffness = Quantity("stiffness at the actuator, output free", "n_per_um", ("model",), COARSER)


@setup.for_mechanisms(Stiffness, MechanismStiffness, not_for="analytic")
def stiffness(
    stage: Stage | Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    force: tuple[float, float, float] | None = None,
    displacement: tuple[float, float, float] | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Stiffness | MechanismStiffness:
    """Stiffness, stress and range at yield of a stage or mechanism, and response to a load or displacement.

    Parameters
    ----------
    force : tuple of float, optional
        Load on the platform: N, N, N mm.
    displacement : tuple of float, optional
        Displacement at which the platform is held, instead of a load: mm, mm, rad.
    {shared}

    Notes
    -----
    The analytic stiffness is (18) of Yi et al., IEEE Trans. Robot. Autom. 19(4), 604-612 (2003).

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.stiffness(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("yield_range", direction="x")[0]), 3)  # mm
    0.641
    """
    mesh = setup.mesh_of(models, resolution, layers, usual_solid=setup.usual_solid(stage))
    if force is not None and displacement is not None:
        raise BadInput("force and displacement, expected one of the two")
    load = None if force is None else arguments.forces("force", force, 1)
    held = None if displacement is None else arguments.poses("displacement", displacement, 1)

    def load_for(K: Array) -> Array | None:
        return load if held is None else np.asarray(K @ held)

    if isinstance(stage, Mechanism):
        return _of_mechanism(stage, load_for, mesh, models, progress)
    warnings, notes, settings = list(warning.of_numbers(stage)), list[str](), dict[str, Any]()
    results, values, fields = dict[str, ModelAnswer](), dict[str, Array](), None
    chosen = analytic.chosen(stage, warnings, models)
    if models != "elements":
        result = analyse(*chosen)
        results[ANALYTIC] = ModelAnswer(at_rest(stage, result.compliance, result.stress))
        if (F := load_for(result.stiffness)) is not None:
            pose = result.compliance @ F
            stress = result.neck_stress(chosen.stage, pose)
            results[ANALYTIC].values.update(force=F, pose=pose, neck_stress=stress, energy=F @ pose / 2)
        values = {f"hinge_{name}": getattr(result.hinges, name) for name in ("rotation", "axial", "shear")}
        settings["analytic model"] = chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(chosen.stage, result)
    if (thickness := warning.stiffer_by_thickness(stage)) is not None:
        values["thickness"] = thickness
    if mesh is not None and mesh.layers:
        solid, fields = _in_three_dimensions(stage, mesh, load_for)
        results |= solid
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        results[ELEMENTS], fields = _in_plane(stage, mesh.resolution, load_for, progress)
        warnings += warning.of_thickness(stage)
    reference = list(results.values())[-1].values
    if "pose" in reference:
        highest = float(np.max(reference["neck_stress"]))
        warnings += warning.of_yield(highest, stage.material.yield_strength, "under this load")
        warnings += warning.of_motion(stage, reference["pose"], "under this load")
    for displaced, direction in zip(np.diag(reference["yield_range"]), DIRECTIONS, strict=True):
        warnings += warning.of_motion(stage, displaced, f"end of the range at yield in {direction}")
    return setup.answer(
        Stiffness, stage, results, mesh, settings, values, warnings=warnings, notes=notes, fields=fields
    )


def at_rest(plate: Stage | Mechanism, compliance: Array, stress: Array | None = None) -> dict[str, Array]:
    """Return values at rest from the compliance (3, 3) and the stress (..., 3), MPa, per displacement."""
    K = np.asarray(np.linalg.inv(compliance))
    K = (K + K.T) / 2
    values = {"compliance": compliance, "stiffness": K, "free": free_stiffness(K)}
    if stress is not None:
        range_at_yield = plate.material.yield_strength / np.max(stress.reshape(-1, 3), axis=0)
        values |= {"stress": stress, "yield_range": range_at_yield, "yield_force": np.diag(K) * range_at_yield}
    return values


def of_ports(mechanism: Mechanism, response: Responses) -> dict[str, Array]:
    """Return the values at rest of a mechanism, and the inputs seen from its drives.

    The amplification is the motion of the output, which is free, per opening of one actuator.
    """
    C, drives = response.compliance, mechanism.layout.drive_ports
    loads = np.linalg.inv(C[:3, :3]) @ np.eye(3, len(C))
    values = at_rest(mechanism, C[:3, :3], response.stress(loads).T)
    if drives:
        opening = np.diag(C)[drives]
        values |= {"input_stiffness": 1 / opening, "amplification": (C[:3, drives] / opening).T}
    return values


def _of_mechanism(
    mechanism: Mechanism, load_for: Loads, mesh: Mesh | None, models: Models, progress: Progress | None
) -> MechanismStiffness:
    def values(response: Responses) -> dict[str, Any]:
        found: dict[str, Any] = of_ports(mechanism, response)
        F, C = load_for(found["stiffness"]), response.compliance
        if F is not None:
            poses = (C[:, :3] @ F)[: 3 * len(mechanism.layout.points)].reshape(-1, 3)
            stress = response.stress(F @ np.eye(3, len(C)))
            found |= {"force": F, "pose": poses, "energy": F @ poses[0] / 2, "hinge_stress": stress}
        return found

    def bands(sizes: Array, each: list[Values], ends: Sequence[Values]) -> dict[str, Any]:
        found, solutions = plates.value_bands(sizes, each, ends), np.array([one["compliance"] for one in each])
        C = compliance_bands(sizes, solutions)
        if ends:
            plane, through = solid_bands(SolidLevels(solutions, *(one["compliance"] for one in ends)), int(sizes[-1]))
            C = plane + through
        return found | {"compliance": C, "free": each[-1]["free"] * np.diag(C) / np.diag(each[-1]["compliance"])}

    found, fields, warnings = plates.of_models(mechanism, mesh, models, values, progress, bands), None, list[str]()
    force = list(found.values())[-1].values.get("force")
    if force is not None:
        warnings = plates.over_yield(mechanism, found, "hinge_stress", "this load")
        fields = None if mesh is None else _fields_of_mechanism(mechanism, mesh, force)
    return setup.answer(MechanismStiffness, mechanism, found, mesh, fields=fields, warnings=warnings)


def _fields_of_mechanism(mechanism: Mechanism, mesh: Mesh, force: Array) -> MeshFields:
    """Return displacement and stress under a load (3,) on the output; in three dimensions on the coarsest mesh."""
    layers = plates.layers_of(mechanism, mesh.layers)
    level = levels(mesh.resolution)[0] if layers else mesh.resolution

    def made() -> dict[str, Array]:
        solid = layers and plates.solid_response(mechanism, level, mesh.layers)
        response = solid or plates.solved(mechanism, level)
        field, whole = np.tensordot(force, response.fields[:3], axes=1), response.structure
        moving, stress = np.unique(whole.mesh.triangles), np.zeros(field.shape[:-1])  # fixed bodies have none
        found = nodal_stress(whole.mesh, whole.plate, field, moving, whole.layers)
        stress[moving] = von_mises(found, mechanism.layout.out_of_plane).reshape(stress[moving].shape)
        return {"displacement": field, "von_mises": stress}

    return MeshFields(plates.meshed(mechanism, level), made, layers.heights if layers else None)


def _stiffness_bands(K: Array, bands: Array) -> dict[str, Array]:
    """Return the bands of compliance and stiffness from those of the compliance: `dK = -K dC K`."""
    return {"compliance": bands, "stiffness": np.abs(K) @ bands @ np.abs(K)}


def _in_plane(
    stage: Stage, resolution: int, load_for: Loads, progress: Progress | None
) -> tuple[ModelAnswer, MeshFields | None]:
    """Return values and bands by plane finite elements on three meshes, and fields under the load."""
    sizes = np.array(levels(resolution), dtype=float)
    responses = on_meshes(levels(resolution), lambda level: setup.solved(stage, level), progress)
    C, stresses = responses[-1].compliance, np.array([element_stress(stage, response) for response in responses])
    bands = compliance_bands(sizes, np.array([response.compliance for response in responses]))
    values: dict[str, Any] = at_rest(stage, C, stresses[-1])
    highest = np.max(stresses, axis=(1, 2))  # of each direction
    band = stress_bands(sizes, highest)
    value_bands = _stiffness_bands(values["stiffness"], bands) | {
        "free": values["free"] * np.diag(bands) / np.diag(C),
        "stress": np.where(is_largest(stresses[-1], (0, 1)), band, np.nan),
        "yield_range": values["yield_range"] * band / highest[-1],
    }
    force, fields = load_for(values["stiffness"]), None
    if force is not None:
        finest, case = responses[-1], responses[-1].under(force[None])
        values.update(force=force, pose=C @ force, energy=case.energy[0, 0] / 2)
        values.update(reaction=case.reactions[0], neck_stress=neck_stresses(stage, finest, force[None]).highest[0])
        value_bands["pose"] = bands @ np.abs(force)
        field, mesh = case.nodal[0], finest.mesh
        fields = MeshFields(mesh, lambda: {"displacement": field, "von_mises": plane_stress(stage, mesh, field)})
    return ModelAnswer(values, value_bands), fields


def element_stress(stage: Stage, response: Response) -> Array:
    """Return the highest stress (3 chains, 3 hinges, 3 directions) at necks per displacement by finite elements."""
    K = np.asarray(np.linalg.inv(response.compliance))
    return np.moveaxis(neck_stresses(stage, response, K.T).highest, 0, -1)


def _in_three_dimensions(stage: Stage, mesh: Mesh, load_for: Loads) -> tuple[dict[str, ModelAnswer], MeshFields | None]:
    """Return values in three dimensions and, on the same plane mesh, in plane stress and strain, which bound them."""
    response = solve_solid(stage, *mesh)
    plane, thickness = solid_bands(solid_levels(stage, *mesh), mesh.resolution)
    C, total = response.compliance, plane + thickness
    values: dict[str, Any] = at_rest(stage, C, element_stress(stage, response))
    bands = _stiffness_bands(values["stiffness"], total)
    values |= {"band_plane": plane, "band_thickness": thickness}
    sheet, held = (ModelAnswer(dict(at_rest(stage, compliance))) for compliance in bounding(stage, response))
    force, fields = load_for(values["stiffness"]), None
    if force is not None:
        necks = neck_stresses(stage, response, force[None])
        values.update(force=force, pose=C @ force, reaction=force @ response.reactions)
        values.update(neck_stress=necks.highest[0], neck_height=necks.height[0])
        values["energy"] = force @ response.energy @ force / 2
        bands["pose"] = total @ np.abs(force)
        fields = MeshFields(response.mesh, lambda: _solid_fields(stage, response, force), response.layers.heights)
    return {SHEET: sheet, HELD: held, SOLID: ModelAnswer(values, bands)}, fields


def _solid_fields(stage: Stage, response: Response, force: Array) -> dict[str, Array]:
    """Return displacement, mm, and stress, MPa, at all nodes in three dimensions under a load (3,)."""
    field = np.tensordot(force, response.fields, axes=1)
    stress = nodal_stress(response.mesh, sheet_of(stage), field, layers=response.layers)
    return {"displacement": field, "von_mises": von_mises(stress), "stress": stress.reshape(*field.shape[:2], 9)}


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Return compliances (3, 3) in plane stress and in plane strain on the plane mesh of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (unit_response(response.sectors, bound).compliance for bound in (plate, held))
    return soft, hard


def _ends(part: Callable[..., Array], model: str) -> dict[str, Array]:
    """Return the ranges of the drive by one model; `part` returns the values or bands of an answer of `reach`."""
    return {
        f"{name}_{end}": np.where(np.abs(one := part("ends", others=others, end=end, model=model)) < 1e-12, 0.0, one)
        for name, others in (("held", "zero"), ("free", "free"))
        for end in ("low", "high")
    }


def _material(plate: Stage | Mechanism) -> tuple[dict[str, Any], list[str]]:
    """Return the plane problem and the yield strength as settings, and the sources of the material as notes."""
    by_source = dict[str, list[str]]()
    for key in (key for key in plate.numbers if key.startswith("material")):
        by_source.setdefault(plate.sources[key] or "not stated", []).append(key)
    settings = {"plane problem": PLANES[plate.model], "yield strength": f"{plate.material.yield_strength:g} MPa"}
    return settings, [f"{', '.join(keys)}: {source}" for source, keys in by_source.items()]


@setup.for_mechanisms(Summary, MechanismSummary, not_for="analytic")
def summary(
    stage: Stage | Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Summary | MechanismSummary:
    """Stiffness of a stage or mechanism, range and force at which the first neck yields, and range of its drive.

    Parameters
    ----------
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.summary(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> float(found.at("yield_range", direction="x", model="analytic").round(3))  # mm
    0.641
    """
    mesh: dict[str, Any] = {"models": models, "resolution": resolution, "layers": layers}
    found = stiffness(stage, analytic=analytic, **mesh, progress=progress)
    settings, notes = _material(stage)
    settings, notes, warnings = settings | found.settings, [*found.notes, *notes], list(found.warnings)
    parts = dict[str, Array](), dict[str, Array]()
    values, bands = parts
    for target, source in zip(parts, (found.values, found.bands), strict=True):
        for name in source.keys() & {"free", "yield_range", "yield_force", "stress"}:
            target[name] = np.moveaxis(source[name], -1, 0)
        if "stiffness" in source:
            target["stiffness"] = np.diagonal(source["stiffness"], axis1=1, axis2=2).T
    if isinstance(stage, Mechanism):
        first = modes(stage, count=1, **mesh)
        sources = (found.values, found.bands), (first.values, first.bands)
        for target, source, lowest in zip(parts, *sources, strict=True):
            if "frequency" in lowest:
                target["frequency"] = lowest["frequency"][0]
            if len(stage.layout.actuators) == 1 and "amplification" in source:
                target["amplification"] = source["amplification"][0].T
                target["input_stiffness"] = source["input_stiffness"][0]
        if stage.layout.actuators:
            driven = actuators.reach(stage, setup.mesh_of(**mesh, usual_solid=setup.usual_solid(stage)), models)
            model = driven.axes["model"][-1]
            values |= _ends(driven.at, model)
            bands |= _ends(driven.band, model)
            notes.append(f"drive min, max: {model} model with all actuators; first frequency: without the actuators")
        return MechanismSummary(found.about, values, bands, found.axes, settings, warnings, notes)
    if "thickness" in found.values:
        values["thickness"] = found.values["thickness"]
    if stage.actuator:
        try:
            reached = reach(stage, models="analytic", analytic=analytic)
        except ComputationFailed as failure:
            warnings.append(str(failure))
        else:
            values |= _ends(reached.at, ANALYTIC)
            warnings += reached.warnings
    return Summary(found.about, values, bands, found.axes, {"mobility": stage.mobility} | settings, warnings, notes)
