"""A stage or mechanism at rest: stiffness, stress, range at yield, response to a load, and its summary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import analyse
from flexfem.arrays import Array, free_stiffness, is_largest
from flexfem.fem.elements import Layers, Plate, nodal_stress, von_mises
from flexfem.fem.fields import neck_stresses
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import Response, unit_response
from flexfem.fem.stage_mesh import out_of_plane_ratio_of, sheet_of
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
    solve_solid,
    stress_bands,
)
from flexfem.questions.modes import modes
from flexfem.questions.plates import ON_MESHES, PEAK, Responses, Values
from flexfem.questions.reach import reach
from flexfem.questions.setup import DEFAULT, Analytic, Mesh, MeshFields, ModelAnswer, Models
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSER,
    FRESH,
    SHEET,
    SOLVED,
    STRESS,
    Gate,
    Progress,
    Quantity,
    Result,
)
from flexfem.units import DIRECTIONS, PLANES, without_unit

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
        C = result.compliance
        response = Responses(C, lambda loads: result.neck_stress(chosen.stage, loads @ C))
        results[ANALYTIC] = ModelAnswer(_values(stage, response, load_for))
        values = {f"hinge_{name}": getattr(result.hinges, name) for name in ("rotation", "axial", "shear")}
        settings["analytic model"] = chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(chosen.stage, result)
    if (thickness := warning.stiffer_by_thickness(stage)) is not None:
        values["thickness"] = thickness
    if mesh is not None:
        results |= _by_elements(stage, load_for, mesh, progress)
        warnings += (warning.held_faces if mesh.layers else warning.of_thickness)(stage)
    reference = list(results.values())[-1].values
    if "pose" in reference:
        if mesh is not None:
            solution = _solved(stage, *mesh)
            layers_used, ratio = solution.structure.layers, out_of_plane_ratio_of(stage)
            fields = _fields(solution.mesh, layers_used, lambda: solution, reference["force"], ratio)
        highest = float(np.max(reference["neck_stress"]))
        warnings += warning.of_yield(highest, stage.material.yield_strength, "under this load")
        warnings += warning.of_motion(stage, reference["pose"], "under this load")
    for displaced, direction in zip(np.diag(reference["yield_range"]), DIRECTIONS, strict=True):
        warnings += warning.of_motion(stage, displaced, f"end of the range at yield in {direction}")
    return setup.answer(
        Stiffness, stage, results, mesh, settings, values, warnings=warnings, notes=notes, fields=fields
    )


def at_rest(compliance: Array) -> dict[str, Array]:
    """Return the stiffness of the output from its compliance (3, 3)."""
    K = np.asarray(np.linalg.inv(compliance))
    K = (K + K.T) / 2
    return {"compliance": compliance, "stiffness": K, "free": free_stiffness(K)}


def of_ports(plate: Stage | Mechanism, response: Responses) -> dict[str, Any]:
    """Return the values at rest, for a mechanism with the inputs seen from its drives.

    The amplification is the motion of the output, which is free, per opening of one actuator.
    """
    C = response.compliance
    values: dict[str, Any] = at_rest(C[:3, :3])
    stress = np.moveaxis(response.stress(values["stiffness"] @ np.eye(3, len(C))), 0, -1)
    reach = plate.material.yield_strength / np.max(stress.reshape(-1, 3), axis=0)
    values |= {"stress": stress, "yield_range": reach, "yield_force": np.diag(values["stiffness"]) * reach}
    if isinstance(plate, Mechanism) and (drives := plate.layout.drive_ports):
        opening = np.diag(C)[drives]
        values |= {"input_stiffness": 1 / opening, "amplification": (C[:3, drives] / opening).T}
    return values


def _values(plate: Stage | Mechanism, response: Responses, load_for: Loads) -> dict[str, Any]:
    """Return the values at rest, and those under the load if there is one."""
    values, C = of_ports(plate, response), response.compliance
    if (F := load_for(values["stiffness"])) is not None:
        loads, motions = F @ np.eye(3, len(C)), C[:, :3] @ F
        values |= {"force": F, "pose": motions, "energy": F @ motions[:3] / 2}
        stress = "neck_stress"
        if isinstance(plate, Mechanism):
            values["pose"], stress = motions[: 3 * len(plate.layout.points)].reshape(-1, 3), "hinge_stress"
        values[stress] = response.stress(loads)
    return values


def _compliance_bands(
    sizes: Array, each: list[Values], ends: Sequence[Values]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the bands of the compliance and of its diagonal, and in three dimensions both parts of the former."""
    solutions, parts = np.array([one["compliance"] for one in each]), dict[str, Array]()
    if ends:
        levels_solved = SolidLevels(solutions, *(one["compliance"] for one in ends))
        parts = dict(zip(("band_plane", "band_thickness"), solid_bands(levels_solved, int(sizes[-1])), strict=True))
    bands = sum(parts.values()) if ends else compliance_bands(sizes, solutions)
    return {"compliance": bands, "free": each[-1]["free"] * np.diag(bands) / np.diag(solutions[-1])}, parts


def _of_mechanism(
    mechanism: Mechanism, load_for: Loads, mesh: Mesh | None, models: Models, progress: Progress | None
) -> MechanismStiffness:
    def bands(sizes: Array, each: list[Values], ends: Sequence[Values]) -> dict[str, Any]:
        return plates.value_bands(sizes, each, ends) | _compliance_bands(sizes, each, ends)[0]

    def values(response: Responses) -> Values:
        return _values(mechanism, response, load_for)

    found, fields, warnings = plates.of_models(mechanism, mesh, models, values, progress, bands), None, list[str]()
    force = list(found.values())[-1].values.get("force")
    if force is not None:
        warnings = plates.over_yield(mechanism, found, "hinge_stress", "this load")
        if mesh is not None:  # in three dimensions those of the coarsest mesh
            size = (levels(mesh.resolution)[0] if mesh.layers else mesh.resolution), mesh.layers
            plate, ratio = plates.meshed(mechanism, size[0]), mechanism.layout.out_of_plane
            solve = partial(plates.solved, mechanism, *size)
            fields = _fields(plate, plates.layers_of(mechanism, mesh.layers), solve, force, ratio)
    return setup.answer(MechanismStiffness, mechanism, found, mesh, fields=fields, warnings=warnings)


def element_responses(stage: Stage, response: Response) -> Responses:
    """Return the response of finite elements to loads on the platform; the stress is that of (3 chains, 3 hinges)."""
    return Responses(
        response.compliance,
        lambda loads: neck_stresses(stage, response, loads.reshape(-1, 3)).highest.reshape(*loads.shape[:-1], 3, 3),
    )


def _solved(stage: Stage, resolution: int, layers: int) -> Response:
    return solve_solid(stage, resolution, layers) if layers else setup.solved(stage, resolution)


def _by_elements(stage: Stage, load_for: Loads, mesh: Mesh, progress: Progress | None) -> dict[str, ModelAnswer]:
    """Return values and bands by finite elements; three dimensions lie between plane stress and plane strain."""
    parts = dict[str, Array]()

    def of_size(resolution: int, layers: int) -> Values:
        response = _solved(stage, resolution, layers)
        values = _values(stage, element_responses(stage, response), load_for)
        if "force" in values:
            values["reaction"] = values["force"] @ response.reactions
        if "force" in values and layers:
            values["neck_height"] = neck_stresses(stage, response, values["force"][None]).height[0]
        return values

    def bands(sizes: Array, each: list[Values], ends: Sequence[Values]) -> dict[str, Any]:
        found, in_depth = _compliance_bands(sizes, each, ends)
        parts.update(in_depth)
        if ends:
            return {"compliance": found["compliance"]}
        stresses = np.array([one["stress"] for one in each])
        highest = np.max(stresses, axis=(1, 2))  # of each direction
        band = stress_bands(sizes, highest)
        return found | {
            "stress": np.where(is_largest(stresses[-1], (0, 1)), band, np.nan),
            "yield_range": each[-1]["yield_range"] * band / highest[-1],
        }

    ((label, (values, widths)),) = plates.by_elements(mesh, of_size, progress, bands, whole=True).items()
    K, C = np.abs(values["stiffness"]), widths["compliance"]
    widths = {**widths, "stiffness": K @ C @ K}  # dK = -K dC K
    if "force" in values:
        widths["pose"] = C @ np.abs(values["force"])
    sheets = zip((SHEET, HELD), bounding(stage, _solved(stage, *mesh)), strict=True) if mesh.layers else ()
    bounds = {name: ModelAnswer(dict(at_rest(compliance))) for name, compliance in sheets}
    return bounds | {label: ModelAnswer(values | parts, widths)}


def _fields(
    mesh: StageMesh, layers: Layers | None, solve: Callable[[], Response], force: Array, ratio: float
) -> MeshFields:
    """Return displacement, mm, and stress, MPa, at all nodes under a load (3,) on the output; none in fixed bodies."""

    def made() -> dict[str, Array]:
        whole = solve().whole
        part, field = whole.structure, np.tensordot(force, whole.nodal[:3], axes=1)
        moving, highest = np.unique(part.mesh.triangles), np.zeros(field.shape[:-1])
        stress = nodal_stress(part.mesh, part.plate, field, moving, part.layers)
        highest[moving] = von_mises(stress, ratio).reshape(highest[moving].shape)
        found = {"displacement": field, "von_mises": highest}
        if part.layers is not None:
            found["stress"] = np.zeros((*highest.shape, 9))
            found["stress"][moving] = stress.reshape(*highest[moving].shape, 9)
        return found

    return MeshFields(mesh, made, layers.heights if layers else None)


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
        name = without_unit(key.partition(".")[2]).replace("_", " ")
        by_source.setdefault(plate.sources[key] or "not stated", []).append(name)
    settings = {"plane problem": PLANES[plate.model], "yield strength": f"{plate.material.yield_strength:g} MPa"}
    return settings, [f"material ({', '.join(names)}): {source}" for source, names in by_source.items()]


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
            notes.append(f"drive min, max: with all actuators ({model}); first frequency: without the actuators")
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
