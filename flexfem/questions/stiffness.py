"""A stage at rest: stiffness, stress per displacement, range at yield, and what one load or displacement does."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import AnalyticResult, ModelChoice, analyse
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
from flexfem.questions.setup import DEFAULT, Analytic, Mesh, Models, about, mesh_of, meshed, solved
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, COARSER, ELEMENTS, SOLID, STRESS, Progress, Quantity, Result

SHEET, HELD = "plane stress", "plane strain"  # labels of the plane problems that bound three dimensions
STIFFNESSES = (("n_per_mm", "n_per_mm", "n"), ("n_per_mm", "n_per_mm", "n"), ("n", "n", "n_mm_per_rad"))
COMPLIANCES = (("mm_per_n", "mm_per_n", "per_n"), ("mm_per_n", "mm_per_n", "per_n"), ("per_n", "per_n", "rad_per_n_mm"))
OWN_STIFFNESS = ("n_per_mm", "n_per_mm", "n_mm_per_rad")
MOTION = ("mm", "mm", "rad")
WRENCH = ("n", "n", "n_mm")
PER_MOTION = ("mpa_per_um", "mpa_per_um", "mpa_per_mrad")


class Stiffness(Result):
    """Stiffness, stress per displacement and range at yield of a stage at rest, and the answer to one load."""

    title = "stage at rest"
    stiffness = Quantity("stiffness", STIFFNESSES, ("model", "component", "direction"), COARSER, "matrix")
    compliance = Quantity("compliance", COMPLIANCES, ("model", "component", "direction"), COARSER, "matrix")
    free = Quantity("stiffness along each direction, the others free", OWN_STIFFNESS, ("model", "direction"), COARSER)
    stress = Quantity(
        "highest neck stress per displacement in each direction, the others held",
        PER_MOTION,
        ("model", "chain", "hinge", "direction"),
        STRESS,
        "all",
        largest=("chain", "hinge"),
    )
    yield_range = Quantity(
        "displacement at which the first neck yields, the others held", MOTION, ("model", "direction"), STRESS,
        prefixed=True,
    )  # fmt: skip
    yield_force = Quantity("force along the displacement there", WRENCH, ("model", "direction"), STRESS)
    thickness = Quantity(
        "change of the plane stiffness by three-dimensional hinges, thickness chart", ("percent",) * 3, ("direction",)
    )
    force = Quantity("load on the platform", WRENCH, ("model", "direction"), COARSER, "wrench")
    pose = Quantity(
        "displacement of the platform under the load", MOTION, ("model", "direction"), COARSER, "pose", prefixed=True
    )
    reaction = Quantity("reaction of the ground", WRENCH, ("model", "direction"), COARSER, "wrench")
    energy = Quantity("strain energy", "n_mm", ("model",), COARSER)
    neck_stress = Quantity(
        "neck stress under the load", "mpa", ("model", "chain", "hinge"), STRESS, "all", largest=("chain", "hinge")
    )
    neck_height = Quantity(
        "distance of the highest stress from the mid-plane", "mm", ("model", "chain", "hinge"), shown=False
    )
    band_plane = Quantity(
        "band of the compliance by the mesh in the plane", COMPLIANCES, ("model", "component", "direction"), shown=False
    )
    band_thickness = Quantity(
        "band of the compliance by the layers", COMPLIANCES, ("model", "component", "direction"), shown=False
    )
    hinge_rotation = Quantity("rotational compliance of the hinges", "rad_per_n_mm", ("chain", "hinge"), shown=False)
    hinge_axial = Quantity("axial compliance of the hinges", "mm_per_n", ("chain", "hinge"), shown=False)
    hinge_shear = Quantity("shear compliance of the hinges", "mm_per_n", ("chain", "hinge"), shown=False)


class LoadFields(NamedTuple):
    """Fields of finite elements under one load; `solid` has half of the thickness."""

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


class AtRest:
    """One model of a stage: compliance, stress per displacement, and what a load does; parts by quantity and band."""

    def __init__(self, stage: Stage, compliance: Array, stiffness: Array | None = None) -> None:
        self.values: dict[str, Any] = {"compliance": compliance}
        self.bands: dict[str, Any] = {}
        self.values["stiffness"] = K = np.asarray(np.linalg.inv(compliance) if stiffness is None else stiffness)
        self.values["free"] = alone(K)
        self.stage = stage

    def strained(self, stress: Array, band: Array | None = None) -> None:
        """Add the stress (3 chains, 3 hinges, 3 directions) per displacement, MPa per mm and rad, and its band (3,)."""
        highest = np.max(stress, axis=(0, 1))
        self.values["stress"] = stress
        self.values["yield_range"] = far = self.stage.material.yield_strength / highest
        self.values["yield_force"] = np.diag(self.values["stiffness"]) * far
        if band is not None:
            self.bands["stress"] = np.where(stress == highest, band, np.nan)
            self.bands["yield_range"] = far * band / highest

    def loaded(self, force: Array, necks: Array, **others: Any) -> None:
        """Add what a load does."""
        self.values |= {"force": force, "pose": self.values["compliance"] @ force, "neck_stress": necks, **others}


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
    stage : Stage
        The stage.
    models : {"both", "analytic", "elements"}
        The models that answer.
    analytic : Analytic
        The analytic model.
    force : tuple of float, optional
        Load on the platform: N, N, N mm.
    displacement : tuple of float, optional
        Instead of a load, the displacement that the platform is held at: mm, mm, rad.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    layers : int, optional
        Three dimensions with so many layers in half the thickness, from 3.
    progress : callable, optional
        Called with a line whenever a part is done.

    Returns
    -------
    Stiffness

    Raises
    ------
    BadInput
        The stage cannot be made, or the analytic model does not suit it; both a force and a displacement are given.
    ComputationFailed
        The stage is at a singular configuration, or a mesh or a solution does not pass its checks.

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
    warnings, settings = list(warning.of_numbers(stage)), dict[str, Any]()
    found: dict[str, AtRest] = {}
    extra: dict[str, Array] = {}
    fields, notes = None, list[str]()
    if models != "elements":
        chosen = analytic.chosen(stage, warnings)
        result = analyse(*chosen)
        found[ANALYTIC] = _analytic(chosen, result, load, held)
        extra = {f"hinge_{name}": getattr(result.hinges, name) for name in ("rotation", "axial", "shear")}
        settings["analytic model"] = chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(chosen.stage, result)
    thickness = warning.stiffer_by_thickness(stage)
    if thickness is not None:
        extra["thickness"] = thickness
    if mesh is not None and mesh.layers:
        more, fields = _in_three_dimensions(stage, mesh, load, held)
        found |= more
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        found[ELEMENTS], fields = _in_plane(stage, mesh.resolution, load, held, progress)
        warnings += warning.of_thickness(stage)
    last = list(found.values())[-1].values
    if "pose" in last:
        warnings += warning.of_yield(
            float(np.max(last["neck_stress"])), stage.material.yield_strength, "under this load"
        )
        warnings += warning.of_motion(stage, last["pose"], "under this load")
    for axis, direction in enumerate(("x", "y", "theta")):
        end = last["yield_range"][axis] * np.eye(3)[axis] if "yield_range" in last else np.zeros(3)
        warnings += warning.of_motion(stage, end, f"end of the range at yield in {direction}")
    return Stiffness(
        about(stage),
        _stacked([one.values for one in found.values()]) | extra,
        _stacked([one.bands for one in found.values()]),
        {"model": tuple(found)},
        settings | meshed(mesh),
        list(dict.fromkeys(warnings)),
        notes,
        fields if load is not None or held is not None else None,
    )


def _stacked(models: list[dict[str, Any]]) -> dict[str, Array]:
    """Quantities of all models beside one another, nan where a model has none."""
    shapes = {name: np.shape(part) for parts in models for name, part in parts.items()}
    return {
        name: np.stack([np.asarray(parts.get(name, np.full(shape, np.nan))) for parts in models])
        for name, shape in shapes.items()
    }


def _analytic(chosen: ModelChoice, result: AnalyticResult, load: Array | None, held: Array | None) -> AtRest:
    found = AtRest(chosen.stage, result.compliance, result.stiffness)
    found.strained(result.stress)
    force = load if held is None else result.stiffness @ held
    if force is not None:
        necks = result.neck_stress(chosen.stage, result.compliance @ force)
        found.loaded(force, necks, energy=float(force @ result.compliance @ force) / 2)
    return found


def element_stress(stage: Stage, response: Response) -> Array:
    """Highest stress (3 chains, 3 hinges, 3 directions) at each neck per displacement, by plane finite elements."""
    K = np.linalg.inv(response.compliance)
    cases = [load_case(stage, response.mesh, response, force) for force in K.T]
    return np.stack([case.neck_stress for case in cases], axis=-1)


def _in_plane(
    stage: Stage, resolution: int, load: Array | None, held: Array | None, progress: Progress | None
) -> tuple[AtRest, LoadFields | None]:
    """Plane finite elements on three meshes."""
    steps, responses = levels(resolution), []
    for level in steps:
        responses.append(solved(stage, level))
        if progress is not None:
            progress(f"{responses[-1].unknowns} unknowns")
    finest, sizes = responses[-1], np.array(steps, dtype=float)
    found = AtRest(stage, finest.compliance)
    found.bands["compliance"] = bands = compliance_bands(sizes, np.array([each.compliance for each in responses]))
    K = found.values["stiffness"]
    found.bands["stiffness"] = np.abs(K) @ bands @ np.abs(K)  # dK = -K dC K
    found.bands["free"] = found.values["free"] * np.diag(bands) / np.diag(finest.compliance)
    stresses = np.array([element_stress(stage, each) for each in responses])
    found.strained(stresses[-1], stress_bands(sizes, np.max(stresses, axis=(1, 2))))
    force = load if held is None else K @ held
    if force is None:
        return found, None
    case = load_case(stage, finest.mesh, finest, force)
    found.loaded(force, case.neck_stress, reaction=case.reaction, energy=case.energy)
    found.bands["pose"] = bands @ np.abs(force)
    return found, LoadFields(stage, force, case, finest)


def _in_three_dimensions(
    stage: Stage, mesh: Mesh, load: Array | None, held: Array | None
) -> tuple[dict[str, AtRest], LoadFields | None]:
    """Three dimensions, and plane stress and plane strain on the same mesh of the plane, which bound it."""
    response = solve_solid(stage, mesh.resolution, mesh.layers)
    plane, thickness = solid_bands(solid_levels(stage, mesh.resolution, mesh.layers), mesh.resolution)
    total = plane + thickness
    soft, hard = bounding(stage, response)
    found = AtRest(stage, response.compliance)
    found.bands["compliance"] = total
    found.values |= {"band_plane": plane, "band_thickness": thickness}
    K = found.values["stiffness"]
    found.bands["stiffness"] = np.abs(K) @ total @ np.abs(K)
    found.strained(np.moveaxis(neck_stresses(stage, response, K.T).highest, 0, -1))
    force = load if held is None else K @ held
    models = {SHEET: AtRest(stage, soft), HELD: AtRest(stage, hard), SOLID: found}
    if force is None:
        return models, None
    necks = neck_stresses(stage, response, force[None])
    energy = float(force @ response.energy @ force / 2)
    found.loaded(force, necks.highest[0], reaction=force @ response.reactions, energy=energy)
    found.values["neck_height"] = necks.height[0]
    found.bands["pose"] = total @ np.abs(force)
    return models, LoadFields(stage, force, None, response)


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Compliances (3, 3) of plane stress and of plane strain on the mesh of the plane of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (unit_response(response.sectors, each).compliance for each in (plate, held))
    return soft, hard
