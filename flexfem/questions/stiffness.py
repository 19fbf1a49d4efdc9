"""A stage at rest: stiffness, stress per displacement, range at yield, and what one load or displacement does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import analyse
from flexfem.arrays import Array, alone
from flexfem.fem.elements import Plate, nodal_stress, von_mises
from flexfem.fem.export import write_vtu
from flexfem.fem.fields import LoadCase, load_case, neck_stresses
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import sheet_of
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import compliance_bands, levels, solid_bands, solid_levels, solve_solid, stress_bands
from flexfem.questions.setup import DEFAULT, Analytic, Answered, Models, answer, mesh_of, on_meshes, question, solved
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, COARSER, ELEMENTS, SHEET, SOLID, STRESS, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

HELD = "plane strain"  # label of the stiffer of the plane problems that bound three dimensions
MATRIX, NECKS = ("model", "component", "direction"), ("model", "chain", "hinge")


class Stiffness(Result):
    """Stiffness, stress per displacement and range at yield of a stage at rest, and the answer to one load."""

    title = "stage at rest"
    stiffness = Quantity("stiffness", "stiffness matrix", MATRIX, COARSER, "matrix")
    compliance = Quantity("compliance", "compliance matrix", MATRIX, COARSER, "matrix")
    free = Quantity("stiffness along each direction, the others free", "stiffness", ("model", "direction"), COARSER)
    stress = Quantity(
        "highest neck stress per displacement in each direction, the others held", "stress per motion",
        (*NECKS, "direction"), STRESS, "all", largest=("chain", "hinge"),
    )  # fmt: skip
    yield_range = Quantity(
        "displacement at which the first neck yields, the others held", "motion", ("model", "direction"), STRESS,
        prefixed=True,
    )  # fmt: skip
    yield_force = Quantity("force along the displacement there", "wrench", ("model", "direction"), STRESS)
    thickness = Quantity(
        "change of the plane stiffness by three-dimensional hinges, thickness chart", "percents", ("direction",)
    )
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


class LoadFields(NamedTuple):
    """Fields of finite elements under one load; `plane` is None in three dimensions, of which half has fields."""

    stage: Stage
    load: Array
    plane: LoadCase | None
    response: Response

    def write(self, path: Path) -> list[Path]:
        """Write displacement, mm, and von Mises stress, MPa, of all nodes as VTU; returns the paths."""
        path = path.with_suffix(".vtu")
        mesh, response = self.response.mesh, self.response
        if self.plane is not None:
            write_vtu(mesh, path, {"displacement": self.plane.field, "von_mises": self.plane.stress})
        elif response.extrusion is not None:
            field = np.tensordot(self.load, response.fields, axes=1)
            stress = nodal_stress(mesh, sheet_of(self.stage), field, layers=response.layers)
            fields = {"displacement": field, "von_mises": von_mises(stress)}
            fields["stress"] = stress.reshape(*field.shape[:2], 9)
            write_vtu(mesh, path, fields, response.layers.heights)
        return [path]


@question
def stiffness(
    stage: Stage,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    force: tuple[float, float, float] | None = None,
    displacement: tuple[float, float, float] | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Stiffness:
    """Stiffness, neck stress per displacement and range at yield of a stage, and what a load or displacement does.

    Parameters
    ----------
    force : tuple of float, optional
        Load on the platform: N, N, N mm.
    displacement : tuple of float, optional
        Instead of a load, the displacement that the platform is held at: mm, mm, rad.
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
    check_feasible(stage)
    mesh = mesh_of(models, resolution, layers)
    if force is not None and displacement is not None:
        raise BadInput("force and displacement, expected one of the two")
    load = None if force is None else arguments.forces("force", force, 1)
    held = None if displacement is None else arguments.poses("displacement", displacement, 1)
    warnings, notes, settings = list(warning.of_numbers(stage)), list[str](), dict[str, Any]()
    found, values, fields = dict[str, Answered](), dict[str, Array](), None

    def loaded(K: Array) -> Array | None:
        return load if held is None else np.asarray(K @ held)

    if models != "elements":
        chosen = analytic.chosen(stage, warnings)
        result = analyse(*chosen)
        found[ANALYTIC] = one = _at_rest(stage, result.compliance, result.stress, stiffness=result.stiffness)
        if (F := loaded(result.stiffness)) is not None:
            pose = result.compliance @ F
            one.values.update(
                force=F, pose=pose, neck_stress=result.neck_stress(chosen.stage, pose), energy=F @ pose / 2
            )
        values = {f"hinge_{name}": getattr(result.hinges, name) for name in ("rotation", "axial", "shear")}
        settings["analytic model"] = chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(chosen.stage, result)
    thickness = warning.stiffer_by_thickness(stage)
    if thickness is not None:
        values["thickness"] = thickness
    if mesh is not None and mesh.layers:
        more, fields = _in_three_dimensions(stage, mesh.resolution, mesh.layers, loaded)
        found |= more
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        found[ELEMENTS], fields = _in_plane(stage, mesh.resolution, loaded, progress)
        warnings += warning.of_thickness(stage)
    last = list(found.values())[-1].values
    if "pose" in last:
        highest = float(np.max(last["neck_stress"]))
        warnings += warning.of_yield(highest, stage.material.yield_strength, "under this load")
        warnings += warning.of_motion(stage, last["pose"], "under this load")
    for axis, direction in enumerate(DIRECTIONS):
        end = last["yield_range"][axis] * np.eye(3)[axis]
        warnings += warning.of_motion(stage, end, f"end of the range at yield in {direction}")
    return answer(Stiffness, stage, found, mesh, settings, values, warnings=warnings, notes=notes, fields=fields)


def _at_rest(
    stage: Stage,
    compliance: Array,
    stress: Array | None = None,
    bands: Array | None = None,
    stiffness: Array | None = None,
    **others: Array,
) -> Answered:
    """A stage at rest by its compliance, with bands, and stress (3 chains, 3 hinges, 3 directions) per displacement."""
    K = np.asarray(np.linalg.inv(compliance) if stiffness is None else stiffness)
    found = Answered({"compliance": compliance, "stiffness": K, "free": alone(K), **others}, {})
    if bands is not None:
        found.bands["compliance"] = bands
        found.bands["stiffness"] = np.abs(K) @ bands @ np.abs(K)  # dK = -K dC K
    if stress is not None:
        far = stage.material.yield_strength / np.max(stress, axis=(0, 1))
        found.values.update(stress=stress, yield_range=far, yield_force=np.diag(K) * far)
    return found


def _in_plane(
    stage: Stage, resolution: int, loaded: Callable[[Array], Array | None], progress: Progress | None
) -> tuple[Answered, LoadFields | None]:
    """Plane finite elements on three meshes."""
    sizes = np.array(levels(resolution), dtype=float)
    responses = on_meshes(levels(resolution), lambda level: solved(stage, level), progress)
    finest, stresses = responses[-1], np.array([element_stress(stage, each) for each in responses])
    bands = compliance_bands(sizes, np.array([each.compliance for each in responses]))
    found = _at_rest(stage, finest.compliance, stresses[-1], bands)
    highest = np.max(stresses, axis=(1, 2))
    band = stress_bands(sizes, highest)
    found.bands["free"] = found.values["free"] * np.diag(bands) / np.diag(finest.compliance)
    found.bands["stress"] = np.where(stresses[-1] == highest[-1], band, np.nan)
    found.bands["yield_range"] = found.values["yield_range"] * band / highest[-1]
    force = loaded(found.values["stiffness"])
    if force is None:
        return found, None
    case = load_case(stage, finest.mesh, finest, force)
    found.values.update(force=force, pose=finest.compliance @ force, neck_stress=case.neck_stress)
    found.values.update(reaction=case.reaction, energy=case.energy)
    found.bands["pose"] = bands @ np.abs(force)
    return found, LoadFields(stage, force, case, finest)


def element_stress(stage: Stage, response: Response) -> Array:
    """Highest stress (3 chains, 3 hinges, 3 directions) at each neck per displacement, by plane finite elements."""
    K = np.linalg.inv(response.compliance)
    cases = [load_case(stage, response.mesh, response, force) for force in K.T]
    return np.stack([case.neck_stress for case in cases], axis=-1)


def _in_three_dimensions(
    stage: Stage, resolution: int, layers: int, loaded: Callable[[Array], Array | None]
) -> tuple[dict[str, Answered], LoadFields | None]:
    """Three dimensions, and plane stress and plane strain on the same mesh of the plane, which bound it."""
    response = solve_solid(stage, resolution, layers)
    plane, thickness = solid_bands(solid_levels(stage, resolution, layers), resolution)
    K, total = np.asarray(np.linalg.inv(response.compliance)), plane + thickness
    stress = np.moveaxis(neck_stresses(stage, response, K.T).highest, 0, -1)
    found = _at_rest(stage, response.compliance, stress, total, band_plane=plane, band_thickness=thickness)
    models = {label: _at_rest(stage, C) for label, C in zip((SHEET, HELD), bounding(stage, response), strict=True)}
    models[SOLID] = found
    force = loaded(K)
    if force is None:
        return models, None
    necks = neck_stresses(stage, response, force[None])
    found.values.update(force=force, pose=response.compliance @ force, reaction=force @ response.reactions)
    found.values.update(
        neck_stress=necks.highest[0], neck_height=necks.height[0], energy=force @ response.energy @ force / 2
    )
    found.bands["pose"] = total @ np.abs(force)
    return models, LoadFields(stage, force, None, response)


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Compliances (3, 3) of plane stress and of plane strain on the mesh of the plane of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (unit_response(response.sectors, each).compliance for each in (plate, held))
    return soft, hard
