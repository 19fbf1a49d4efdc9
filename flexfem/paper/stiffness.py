"""A stage at rest: stiffness, neck stress, range at yield, and response to a load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, is_largest
from flexfem.fem.elements import Plate
from flexfem.fem.response import Response, unit_response
from flexfem.hinges.formulas import FORMULAS
from flexfem.paper import warnings as warning
from flexfem.paper.answers import about, by_models, chosen, mesh_of, responses
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import AnalyticResult, ModelChoice, analyse
from flexfem.paper.solutions import solved_by
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import layers_of, sheet_of
from flexfem.questions.bands import SolidLevels, compliance_bands, solid_bands, stress_bands
from flexfem.questions.plates import Responses, Values, over_yield
from flexfem.questions.setup import (
    DEFAULT,
    Analytic,
    Mesh,
    MeshFields,
    ModelAnswer,
    Models,
    elements_through,
    result_of,
)
from flexfem.questions.stiffness import (
    Load,
    PartOfAnswer,
    Stiffness,
    at_rest,
    fields_under,
    joined,
    last_of,
    load_of,
)
from flexfem.results import COARSE_MESHES, SHEET, STRESS, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

HELD = "plane strain"  # label of the stiffer of the plane problems that bound three dimensions
MATRIX = ("model", "component", "direction")
NECKS = ("model", "chain", "hinge")
HINGE = ("chain", "hinge")
UNIT_POSES = dict(zip(DIRECTIONS, np.eye(3), strict=True))


class StageStiffness(Result):
    """Stiffness, stress per displacement and range at yield of a stage at rest, and its response to
    one load.
    """

    kind_name = "stiffness"
    has_mesh_fields = True
    title = "stage at rest"
    main_result = ("free", {})
    stiffness = replace(Stiffness.stiffness, gate=COARSE_MESHES)
    compliance = replace(Stiffness.compliance, gate=COARSE_MESHES)
    held = replace(Stiffness.held, gate=COARSE_MESHES, compared=True)
    free = replace(Stiffness.free, gate=COARSE_MESHES)
    stress = replace(Stiffness.stress, over=(*NECKS, "direction"), gate=STRESS)
    yield_range = replace(Stiffness.yield_range, gate=STRESS)
    free_yield_range = replace(Stiffness.free_yield_range, gate=STRESS)
    yield_force = replace(Stiffness.yield_force, gate=STRESS)
    thickness = Quantity("change of stiffness in three dimensions", "percents", ("direction",))
    force = replace(Stiffness.force, gate=COARSE_MESHES)
    pose = replace(Stiffness.pose, over=("model", "direction"), gate=COARSE_MESHES)
    reaction = Quantity(
        "reaction of the ground", "wrench", ("model", "direction"), COARSE_MESHES, "wrench"
    )
    energy = replace(Stiffness.energy, gate=COARSE_MESHES)
    neck_stress = Quantity("neck stress under the load", "mpa", NECKS, STRESS, "all")
    neck_height = Quantity(
        "distance of the highest stress from the mid-plane", "mm", NECKS, shown=False
    )
    band_plane = Quantity(
        "band of the compliance by the mesh in the plane", "compliance matrix", MATRIX, shown=False
    )
    band_thickness = Quantity(
        "band of the compliance by the layers", "compliance matrix", MATRIX, shown=False
    )
    hinge_rotation = Quantity(
        "rotational compliance of the hinges", "rad_per_n_mm", HINGE, shown=False
    )
    hinge_axial = Quantity("axial compliance of the hinges", "mm_per_n", HINGE, shown=False)
    hinge_shear = Quantity("shear compliance of the hinges", "mm_per_n", HINGE, shown=False)


class _Model(NamedTuple):
    """The analytic model of a stage, whose plane problem may differ from that of its file, and its
    solution.
    """

    chosen: ModelChoice
    result: AnalyticResult

    @property
    def responses(self) -> Responses:
        """Compliance and neck stress per load on the platform."""
        C = self.result.compliance
        return Responses(C, lambda loads: self.result.neck_stress(self.chosen.stage, loads @ C))


def stiffness(
    stage: Stage,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    force: tuple[float, float, float] | None = None,
    displacement: tuple[float, float, float] | None = None,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> StageStiffness:
    """Answer `flexfem.stiffness` for a stage; the arguments are those of that function.

    Notes
    -----
    The analytic stiffness is (18) of Yi et al., IEEE Trans. Robot. Autom. 19(4), 604-612 (2003).
    """
    mesh = mesh_of(stage, models, resolution, elements_through(solid, thickness_resolution))
    load = load_of(stage.layout, force, displacement)
    stated = warning.of_numbers(stage)
    choice = chosen(stage, analytic, stated, models)
    model = None if models == "elements" else _Model(choice, analyse(*choice))

    def of_model() -> Values:
        assert model is not None
        return _values(stage, model.responses, load)

    def on_mesh(resolution: int, layers: int) -> Values:
        response = solved_by(stage, resolution, layers)
        values = _values(stage, responses(stage, response), load)
        if "force" in values:
            values |= _of_ground(stage, response, values["force"])
        return values

    found = by_models(mesh, models, of_model, on_mesh, progress, _bands)
    if mesh is not None:
        found = _with_bounds(stage, mesh, found)
    parts = [
        PartOfAnswer(warnings=stated),
        _of_stage(stage, mesh, model),
        _under_load(stage, found),
        _of_motions(stage, found),
    ]
    fields = _fields_of(stage, mesh, last_of(found))
    return result_of(StageStiffness, about(stage), found, mesh, fields=fields, **joined(parts))


def _values(
    stage: Stage,
    response: Responses,
    load: Load,
) -> Values:
    """Return the values at rest, and those under the load if there is one."""
    C = response.compliance
    values: Values = at_rest(C)
    strength = stage.material.yield_strength
    stress = np.moveaxis(response.stress(values["stiffness"]), 0, -1)  # with the others held
    reach = strength / np.max(stress, axis=(0, 1))
    free = response.stress(np.diag(values["free"]))
    values |= {
        "stress": stress,
        "yield_range": reach,
        "yield_force": values["held"] * reach,
        "free_yield_range": strength / np.max(free, axis=(1, 2)),
    }
    force = load.of(values["stiffness"])
    if force is not None:
        pose = C @ force
        energy = force @ pose / 2
        necks = response.stress(force)
        values |= {
            "force": force,
            "pose": pose,
            "energy": energy,
            "neck_stress": necks,
        }
    return values


def _of_ground(
    stage: Stage,
    response: Response,
    force: Array,
) -> Values:
    """Return the reaction of the ground on a stage under a load (3,), and where its necks are
    stressed most.
    """
    found: Values = {"reaction": force @ response.reactions}
    if response.structure.layers is not None:
        found["neck_height"] = neck_stresses(stage, response, force[None]).height[0]
    return found


def _bands(
    sizes: Array,
    each: list[Values],
    ends: Sequence[Values],
) -> Mapping[str, Any]:
    """Return the bands of the compliance, and in the plane of numbers that depend on the stress."""
    compliances = np.array([one["compliance"] for one in each])
    if ends:
        solved = SolidLevels(compliances, *(one["compliance"] for one in ends))
        of_mesh, of_layers = solid_bands(solved, int(sizes[-1]))
        return {
            "compliance": of_mesh + of_layers,
            "band_plane": of_mesh,
            "band_thickness": of_layers,
        }
    finest = each[-1]
    bands = compliance_bands(sizes, compliances)
    stresses = np.array([one["stress"] for one in each])
    highest = np.max(stresses, axis=(1, 2))  # of each direction
    band = stress_bands(sizes, highest)
    return {
        "compliance": bands,
        "free": finest["free"] * np.diag(bands) / np.diag(compliances[-1]),
        "stress": np.where(is_largest(stresses[-1], (0, 1)), band, np.nan),
        "yield_range": finest["yield_range"] * band / highest[-1],
    }


def _with_bounds(
    stage: Stage,
    mesh: Mesh,
    found: dict[str, ModelAnswer],
) -> dict[str, ModelAnswer]:
    """Add bands that follow from that of the compliance, and the plane problems between which three
    dimensions lie.
    """
    *others, (label, (values, bands)) = found.items()
    widths = dict(bands)
    K = np.abs(values["stiffness"])
    C = bands["compliance"]
    parts = {name: widths.pop(name) for name in ("band_plane", "band_thickness") if name in widths}
    widths["stiffness"] = K @ C @ K  # dK = -K dC K
    widths["held"] = np.diag(widths["stiffness"])
    if "force" in values:
        widths["pose"] = C @ np.abs(values["force"])
    all_models = dict(others)
    if mesh.layers:
        soft, hard = bounding(stage, solved_by(stage, *mesh))
        all_models[SHEET] = ModelAnswer(dict(at_rest(soft)))
        all_models[HELD] = ModelAnswer(dict(at_rest(hard)))
    all_models[label] = ModelAnswer(values | parts, widths)
    return all_models


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Return compliances (3, 3) in plane stress and in plane strain on the plane mesh of a
    response.
    """
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft = unit_response(response.sectors, plate).compliance
    hard = unit_response(response.sectors, held).compliance
    return soft, hard


def _of_stage(
    stage: Stage,
    mesh: Mesh | None,
    model: _Model | None,
) -> PartOfAnswer:
    """Return the formula, the compliance of the hinges, and the effect of the thickness."""
    values = dict[str, Array]()
    settings = dict[str, Any]()
    warnings = list[str]()
    notes = list[str]()
    if model is not None:
        result = model.result
        values |= {f"hinge_{name}": part for name, part in result.hinges._asdict().items()}
        settings["analytic model"] = model.chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(model.chosen.stage, result)
    thickness = warning.stiffer_by_thickness(stage)
    if thickness is not None:
        values["thickness"] = thickness
    if mesh is not None:
        warnings += warning.held_faces(stage) if mesh.layers else warning.of_thickness(stage)
    return PartOfAnswer(
        values,
        settings=settings,
        warnings=warnings,
        notes=notes,
    )


def _under_load(stage: Stage, found: Mapping[str, ModelAnswer]) -> PartOfAnswer:
    """Warn of neck stress beyond the yield strength under the load."""
    if "force" not in last_of(found):
        return PartOfAnswer()
    return PartOfAnswer(warnings=over_yield(stage, found, "neck_stress", "under this load"))


def _of_motions(stage: Stage, found: Mapping[str, ModelAnswer]) -> PartOfAnswer:
    """Warn of stages that leave small displacements, under the load or at the ends of the ranges at
    yield.
    """
    last = last_of(found)
    poses = {"under this load": last["pose"]} if "pose" in last else {}
    for axis, unit in UNIT_POSES.items():
        poses[f"end of the range at yield in {axis}"] = last["yield_range"] * unit
    warnings = list[str]()
    for where, pose in poses.items():
        warnings += warning.of_motion(stage, pose, where)
    return PartOfAnswer(warnings=warnings)


def _fields_of(
    stage: Stage,
    mesh: Mesh | None,
    last: Values,
) -> MeshFields | None:
    """Return the fields of finite elements under the load; none without either."""
    if mesh is None or "force" not in last:
        return None

    whole = solved_by(stage, *mesh).whole

    def made() -> dict[str, Array]:
        return fields_under(whole, last["pose"], last["force"], stage.layout.out_of_plane)

    heights = layers_of(stage, mesh.layers).heights if mesh.layers else None
    return MeshFields(whole.mesh, made, heights)
