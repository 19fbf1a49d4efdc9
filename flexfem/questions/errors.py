"""Errors of an analytic model against finite elements under its force (18) or its joints: Figures 5 to 7."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from flexfem.analytic.large import at_pose, outwards
from flexfem.analytic.model import AnalyticResult, analyse, assemble
from flexfem.arrays import Array, is_largest
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.fields import neck_maxima, plane_stress
from flexfem.fem.mesh import StageMesh
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.structure import plate_of, sheet_of, structure
from flexfem.files.provenance import Assumptions, assumptions
from flexfem.files.refusals import checked_path
from flexfem.files.writing import check_folder, check_name, digest, digest_of_arrays, read_arrays, write_atomically
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.stage import HINGE_NAMES, Stage, load_feasible
from flexfem.questions import bands, warnings
from flexfem.questions.bands import Convergence, Verdict, error_matrix, levels
from flexfem.questions.case import Case, Curve, LoadedCase
from flexfem.questions.drive import limit_warnings
from flexfem.questions.imposed import elements, imposed, imposed_bands, turned_hinges
from flexfem.questions.setup import ModelAnswer, question, solved, stack_models
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSER,
    ELEMENTS,
    EXACT,
    FRESH,
    SOLVED,
    STRESS,
    About,
    Fields,
    Gate,
    Progress,
    Quantity,
    Result,
)
from flexfem.units import DIRECTIONS

LARGE_BAND = 0.5  # percentage points of an error: a tenth of the errors that are to be explained
UNSETTLED = 0.05  # percentage points: smaller bands of meshes that do not converge are below what tables are read for
SOUND = ("converging", "round-off")  # verdicts on a sequence of meshes
POINT, MATRIX = ("curve", "point", "direction"), ("curve", "component", "direction")
OF_HUNDRED = Gate(FRESH.relative, absolute=100 * FRESH.relative)  # a change of the mesh is one of the displacement


class HingeDrawing(BaseModel):
    """One hinge as modelled: centre, mm, direction of the neck, rad, radius and neck, mm, freedoms."""

    chain: int
    hinge: str
    centre: tuple[float, float]
    axis: float
    radius: float
    neck: float
    freedoms: list[str]

    @classmethod
    def of_stage(cls, stage: Stage, freedoms: Sequence[Sequence[Sequence[str]]]) -> list[HingeDrawing]:
        """The hinges of a stage, chain by chain, with their freedoms (3 chains, 3 hinges)."""
        frames, found = stage_frames(stage), []
        for (row, k), axis in np.ndenumerate(frames.axes):
            chain, name, (x, y) = row + 1, HINGE_NAMES[k], frames.centres[row, k].tolist()
            own = stage.hinge(chain, name)
            where = {"chain": chain, "hinge": name, "centre": (x, y), "axis": float(axis)}
            found.append(cls(**where, radius=own.radius, neck=own.neck, freedoms=list(freedoms[row][k])))
        return found


class CurveModels(BaseModel):
    """The stage and the two models of a curve, as figures name and draw them.

    plane : the stage's own choice of plane problem.   layers : in half the thickness, 0 in the plane.
    lever : l3, mm.   verdicts : on the meshes of the error in each direction.
    """

    stage: str
    file: str
    hash: str
    plane: str
    mobility: int
    formula: str
    links: bool
    assumed: list[str]
    not_stated: list[str]
    lever: float
    hub_radius: float
    hinges: list[HingeDrawing]
    resolution: int
    layers: int
    triangles: int
    unknowns: int
    verdicts: list[Verdict]


class Verification(Result):
    """Finite-element displacement against the commanded one, curve by curve of a case."""

    title = "errors of the finite-element displacement"
    columns = ("direction",)
    reading = (
        "errors at the largest command, per cent: along the command relative to it; across it translations relative to "
        "a commanded translation, rotations times l3, a commanded rotation counts times l3",
    )
    percent = Quantity("error, per cent of the command", "percents", ("curve", "direction"), OF_HUNDRED)
    along = Quantity(
        "stiffness of the platform along each direction", "stiffness", ("curve", "model", "direction"), FRESH
    )
    peak = Quantity(
        "highest neck stress per displacement along the command", "stress per motion",
        ("curve", "model", "chain", "hinge", "direction"), STRESS, "all", largest=("chain", "hinge"),
        note="by the model with the other directions held; by finite elements over the displacement that they reach",
    )  # fmt: skip
    neck_stress = Quantity(
        "neck stress of finite elements at the largest command", "mpa", ("curve", "chain", "hinge"), STRESS, "all",
        largest=("chain", "hinge"),
    )  # fmt: skip
    load = Quantity("load on the platform at the largest command", "wrench", ("curve", "direction"), SOLVED, "wrench")
    command = Quantity("commanded displacement", "motion", ("point", "direction"), EXACT, "pose", shown=False)
    error = Quantity("finite-element less commanded displacement", "motion", POINT, COARSER, "pose", shown=False)
    force = Quantity("load of the model on the platform", "wrench", POINT, SOLVED, "wrench", shown=False)
    rotation = Quantity("imposed rotation", "rad", ("curve", "point", "joint"), SOLVED, "axis", shown=False)
    stroke = Quantity("imposed stroke", "mm", ("curve", "point", "joint"), SOLVED, "axis", shown=False)
    stiffness = Quantity("analytic stiffness", "stiffness matrix", MATRIX, EXACT, "matrix", shown=False)
    compliance = Quantity("compliance of finite elements", "compliance matrix", MATRIX, FRESH, "matrix", shown=False)
    on_meshes = Quantity(
        "error on each mesh, coarse to fine", "percents", ("curve", "mesh", "direction"),
        Gate(COARSER.relative, absolute=100 * COARSER.relative), shown=False,
    )  # fmt: skip
    layer_band = Quantity(
        "share of the layers in the band of the error", "percents", ("curve", "direction"), Gate(0.05), shown=False
    )
    name = property(lambda of: of.about.name, doc="Name of the case.")
    assumed = property(lambda of: list(of.about.assumed), doc="Key paths of numbers that are assumed.")
    not_stated = property(lambda of: list(of.about.not_stated), doc="Key paths of numbers without a stated source.")
    case = property(lambda of: Path(of.about.file).stem, doc="Name of the case file without its ending.")
    direction = property(lambda of: of.settings["direction"], doc="Direction of the command.")
    analysis = property(lambda of: of.settings["analysis"], doc="Linear or nonlinear.")
    drive = property(lambda of: of.settings["drive"], doc="What the finite elements were given.")
    elements = property(lambda of: of.settings["model"], doc="Which finite elements.")
    curves = property(lambda of: of.axes["curve"], doc="Labels of the curves.")
    commanded = property(lambda of: of.command[:, DIRECTIONS.index(of.direction)], doc="Commands (points,), mm or rad.")

    @property
    def models(self) -> dict[str, CurveModels]:
        """Stage and models of each curve."""
        return {label: CurveModels(**each) for label, each in self.settings["curves"].items()}

    def write(self, path: Path) -> Path:
        """Store the document as JSON and its fields beside it as .npz; returns the path of the former."""
        if self.fields is not None:
            named = ((k, self.fields[label]._asdict()) for k, label in enumerate(self.curves))
            arrays = {f"{k}.{key}": value for k, each in named for key, value in each.items()}
            self.settings["stored"] = {"fields": digest_of_arrays(arrays)}
            npz = path.with_suffix(".npz")
            write_atomically(npz, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
        return super().write(path)

    def read_fields(self, path: str | os.PathLike[str]) -> dict[str, Fields]:
        """The fields stored beside this result. Raises BadInput when they are missing or of another result."""
        beside = Path(path).with_suffix(".npz")
        arrays = read_arrays(beside, f"the fields of {path}")
        if digest_of_arrays(arrays) != self.settings.get("stored", {}).get("fields"):
            raise BadInput(f"{beside}: not the fields that were stored with {path}: flexfem verify makes both again")
        each = [[arrays[f"{k}.{key}"] for key in Fields._fields] for k in range(len(self.curves))]
        return {label: Fields(*own) for label, own in zip(self.curves, each, strict=True)}


class CurveElements(NamedTuple):
    """Finite elements of a curve: force, error less the command (points, 3); pose (3,), stress and fields at the last.

    bands : of the three percentages, of_layers (3,) their share.   compliance : (3, 3), of the platform.
    peak_band : half-width of the highest neck stress per displacement, nan of one mesh.
    joints, imposed : names (m,), and rotations or strokes (points, m) that they were given.
    """

    error: Array
    force: Array
    pose: Array
    neck_stress: Array
    fields: Fields
    bands: tuple[Convergence, ...]
    compliance: Array
    unknowns: int
    peak_band: float = np.nan
    joints: tuple[str, ...] = ()
    imposed: Array = np.zeros((0, 0))
    of_layers: Array = np.zeros(3)
    warnings: tuple[str, ...] = ()


@question
def verification(
    *cases: Path, output: Path | None = Path("reports"), progress: Progress | None = None
) -> list[Verification]:
    """Apply the analytic force of (18), or joint commands, to the finite elements: the errors of Figures 5 to 7.

    Parameters
    ----------
    *cases : Path
        Case files, see flexfem schema case.
    output : Path, optional
        Folder for the results, which `flexfem plot` draws; none are stored with None.
    {shared}
    """
    folder = None if output is None else checked_path(output)
    if folder is not None:
        check_folder(folder)
    loaded, load, seen = list[LoadedCase](), cache(load_feasible), dict[str, Path]()
    for path in map(checked_path, cases):  # all are read before any is run
        loaded.append(LoadedCase(path, load))
        if (other := seen.setdefault(path.stem, path)) != path:
            raise BadInput(f"{path}: its results would overwrite those of {other}, expected another name")
        if folder is not None:
            check_name(folder / f"{path.stem}.json")
            check_name(folder / f"{path.stem}.npz")
    found = []
    for case in loaded:
        found.append(run_case(case))
        if folder is not None:
            found[-1].write(folder / f"{case.stem}.json")
        if progress is not None:
            progress(f"{case.stem}: {len(case.case.curve)} curves")
    return found


class CurveRun(NamedTuple):
    """A curve of a case, its stage, the analytic model that commands it, and finite elements."""

    curve: Curve
    stage: Stage
    model: AnalyticResult
    elements: CurveElements


def run_case(loaded: LoadedCase) -> Verification:
    """Run every curve of a case. Raises BadInput when a stage does not suit the formula, ComputationFailed."""
    case, stages, found = loaded.case, loaded.stages, _assumptions(loaded)
    models = {one: analyse(stages[one.label], one.mobility, one.formula, one.links) for one in case.curve}
    runs = [CurveRun(one, stages[one.label], model, _answer(loaded, one, model)) for one, model in models.items()]
    joints = tuple(dict.fromkeys(name for each in runs for name in each.elements.joints))
    described = {each.curve.label: _described(case, each) for each in runs}
    labels = {
        "curve": tuple(described),
        "model": (ANALYTIC, ELEMENTS),
        "point": [str(k) for k in range(case.points)],
        "mesh": [f"{n} triangles" for n in levels(case.resolution)],
        "joint": joints,
    }
    answers = {each.curve.label: _quantities(case, each, joints) for each in runs}
    values, widths = stack_models(Verification, answers, labels, "curve")
    own = digest({label: each.hash for label, each in described.items()})
    settings = {key: getattr(case, key) for key in ("direction", "analysis", "drive", "model", "resolution")}
    return Verification(
        About(case.name, str(loaded.path), own, found.assumed, found.not_stated, runs[0].stage.chain.link_lengths[2]),
        values | {"command": case.commands},
        widths,
        labels,
        settings | {"curves": {label: each.model_dump() for label, each in described.items()}},
        [text for each in runs for text in _warnings(case, each)],
        [_said(label, each) for label, each in described.items()],
        {each.curve.label: each.elements.fields for each in runs},
    )


def _quantities(case: Case, run: CurveRun, joints: Sequence[str]) -> ModelAnswer:
    """The quantities of one curve."""
    model, of, axis = run.model, run.elements, case.axis
    peak, peak_band = np.full((2, 2, 3, 3, 3), np.nan)
    if not of.joints:
        peak[0, ..., axis] = model.stress[..., axis]
    peak[1, ..., axis] = reached = of.neck_stress / abs(of.pose[axis])
    peak_band[1, ..., axis] = np.where(is_largest(reached), of.peak_band, np.nan)
    lever = run.stage.chain.link_lengths[2]
    values: dict[str, Any] = {
        "percent": bands.percentages(of.error[-1], case.commanded[-1], case.direction, lever),
        "along": [np.diag(model.stiffness), np.diag(np.linalg.inv(of.compliance))],
        "peak": peak,
        "neck_stress": of.neck_stress,
        "error": of.error,
        "stiffness": model.stiffness,
        "compliance": of.compliance,
        "on_meshes": np.transpose([each.values for each in of.bands]),
    }
    if of.joints:  # nan where a curve has no such joint
        imposed = np.full((case.points, len(joints)), np.nan)
        imposed[:, [joints.index(name) for name in of.joints]] = of.imposed
        values["rotation" if case.drive == "joints" else "stroke"] = imposed
    else:
        values |= {"force": of.force, "load": of.force[-1]}
    if case.model == "three_dimensional":
        values["layer_band"] = of.of_layers
    return ModelAnswer(values, {"percent": [each.band for each in of.bands], "peak": peak_band})


def _said(label: str, of: CurveModels) -> str:
    """The stage and the models of a curve in a line."""
    formula = f"{of.formula}{', elastic links' * of.links}"
    layers = f", {of.layers} layers" if of.layers else ""
    return (
        f"{label}: {of.stage}, {of.plane.replace('_', ' ')}, mobility {of.mobility}, {formula}; {of.resolution} "
        f"triangles across every neck{layers}, {of.unknowns} unknowns; meshes: {', '.join(of.verdicts)}"
    )


def _assumptions(loaded: LoadedCase) -> Assumptions:
    """What is assumed or not stated of a case and its stages, of their drives where these are used."""
    strokes = loaded.case.drive == "strokes"
    every = [stage.drive_assumptions if strokes else assumptions([("", stage)]) for stage in loaded.stages.values()]
    every.append(assumptions([("case: ", loaded.case)]))
    return Assumptions(*(sorted(set(chain.from_iterable(each))) for each in zip(*every, strict=True)))


def _described(case: Case, run: CurveRun) -> CurveModels:
    """What is stored of a curve beside its numbers."""
    (curve, stage, model, elements), strokes = run, case.drive == "strokes"
    own = stage.drive_assumptions if strokes else stage
    return CurveModels(
        stage=stage.name,
        file=curve.stage,
        hash=stage.drive_hash if strokes else stage.hash,
        plane=stage.model,
        mobility=model.mobility,
        formula=model.formula,
        links=curve.links,
        assumed=list(own.assumed),
        not_stated=list(own.not_stated),
        lever=stage.chain.link_lengths[2],
        hub_radius=stage.platform.hub_radius,
        hinges=HingeDrawing.of_stage(stage, model.freedoms),
        resolution=case.resolution,
        layers=case.layers if case.model == "three_dimensional" else 0,
        triangles=len(elements.fields.triangles),
        unknowns=elements.unknowns,
        verdicts=[each.verdict for each in elements.bands],
    )


def _warnings(case: Case, run: CurveRun) -> list[str]:
    """Warnings on one curve: its model, what it does at full command, and its bands."""
    curve, stage, model, elements = run
    where = f"curve {curve.label!r}"
    found = [f"{where}: {text}" for text in (*warnings.of_result(stage, model), *elements.warnings)]
    highest, full = float(np.max(elements.neck_stress)), f"{where}, full command"
    found += warnings.of_yield(highest, stage.material.yield_strength, full)
    if case.analysis == "linear":
        found += warnings.of_motion(stage, elements.pose, full)
    for direction, each in zip(DIRECTIONS, elements.bands, strict=True):
        error = f"{where}: the mesh band of the error in {direction}, {each.values[-1]:.4g} %,"
        said = f"{error} is ±{each.band:.2g} points"
        if each.band > LARGE_BAND:
            found.append(f"{said}; a higher resolution narrows it")
        elif each.verdict not in SOUND and each.band > UNSETTLED:
            found.append(f"{said}, from meshes that are not converging ({each.verdict})")
    return found


def _answer(loaded: LoadedCase, curve: Curve, model: AnalyticResult) -> CurveElements:
    """Finite elements of a curve, as its case wants them. Raises BadInput, ComputationFailed."""
    case, stage = loaded.case, loaded.stages[curve.label]
    try:
        if case.model == "three_dimensional":
            return _of_solid(stage, model, case)
        return _of_force(stage, curve, model, case) if case.drive == "force" else _of_imposed(stage, model, case)
    except ComputationFailed as failure:
        raise ComputationFailed(f"{loaded.path}: curve {curve.label!r}: {failure}") from None


def _of_force(stage: Stage, curve: Curve, model: AnalyticResult, case: Case) -> CurveElements:
    """Finite elements under the force of a model, on three meshes; in a nonlinear case under that of equilibrium."""
    steps, command, lever = levels(case.resolution), case.commands, stage.chain.link_lengths[2]
    meshes = [solved(stage, level) for level in steps]
    finest, compliances = meshes[-1], np.array([each.compliance for each in meshes])
    force = command @ model.stiffness.T  # (18)
    pose = force @ finest.compliance.T
    if case.analysis == "nonlinear":
        force = at_pose(assemble(stage, curve.mobility, curve.formula), command).load
        for side in outwards(np.sum(command, axis=1)):  # from rest, on each side of it
            pose[side] = equilibrium(finest.mesh, plate_of(stage), force[side]).pose
    at_full = [
        (each.mesh, each.compliance @ force[-1], np.tensordot(force[-1], each.fields, axes=1)) for each in meshes
    ]
    return _in_plane(
        stage,
        case,
        at_full,
        error=pose - command,
        force=force,
        bands=bands.command_errors(np.array(steps), compliances, model.stiffness, case.direction, lever),
        compliance=finest.compliance,
        unknowns=finest.unknowns,
    )


def _in_plane(
    stage: Stage, case: Case, at_full: Sequence[tuple[StageMesh, Array, Array]], **others: Any
) -> CurveElements:
    """Finite elements by meshes, coarse to fine, with poses (3,) and displacements at full command."""
    stresses = [plane_stress(stage, mesh, field) for mesh, _, field in at_full]
    steps = np.array(levels(case.resolution), dtype=float)
    necks = [neck_maxima(stage, mesh, stress) for (mesh, *_), stress in zip(at_full, stresses, strict=True)]
    reached = [np.max(neck) / abs(pose[case.axis]) for (_, pose, _), neck in zip(at_full, necks, strict=True)]
    mesh, pose, field = at_full[-1]
    return CurveElements(
        pose=pose,
        neck_stress=necks[-1],
        fields=Fields(mesh.nodes, mesh.triangles, mesh.bodies, field, stresses[-1]),
        peak_band=float(bands.stress_bands(steps, np.array(reached))),
        **others,
    )


def _of_solid(stage: Stage, model: AnalyticResult, case: Case) -> CurveElements:
    """Finite elements in three dimensions under the force of a model; the mid-plane, and stress through the thickness.

    The mesh in the plane errs alike with one layer and with more. What the layers leave out is bounded by
    `bands.pose_bounds` with the change from few layers to more; nothing where symmetry leaves round-off.
    """
    response, K = bands.solve_solid(stage, case.resolution, case.layers), model.stiffness
    bounds, lever = bands.solid_levels(stage, case.resolution, case.layers), stage.chain.link_lengths[2]
    many = bounds.planes + (response.compliance - bounds.planes[-1])
    steps, axis, command = np.array(levels(case.resolution)), case.axis, case.commands
    moved = bands.pose_bounds(bounds.of_layers, bounds.many, K[:, axis], np.eye(3))
    few, more = (error_matrix(K, each, lever)[:, axis] for each in (bounds.few, bounds.many))
    silent = np.maximum(np.abs(few), np.abs(more)) <= bands.ROUND_OFF
    of_layers = np.where(silent, 0.0, bands.percentages(moved, 1.0, case.direction, lever))
    force = command @ K.T  # (18)
    mesh, field = response.mesh, np.tensordot(force[-1], response.fields, axes=1)
    highest = von_mises(nodal_stress(mesh, sheet_of(stage), field, layers=response.layers)).max(axis=1)
    found = bands.command_errors(steps, many, K, case.direction, lever)
    return CurveElements(
        error=force @ response.compliance.T - command,
        force=force,
        pose=response.compliance @ force[-1],
        neck_stress=neck_maxima(stage, mesh, highest),
        fields=Fields(mesh.nodes, mesh.triangles, mesh.bodies, field[:, 0, :2], highest),
        bands=tuple(
            each._replace(band=max(each.band, bands.mesh_band(steps, each.values)) + of)
            for each, of in zip(found, of_layers.tolist(), strict=True)
        ),
        compliance=response.compliance,
        unknowns=response.unknowns,
        of_layers=of_layers,
        warnings=tuple(warnings.held_faces(stage)),
    )


def _of_imposed(stage: Stage, model: AnalyticResult, case: Case) -> CurveElements:
    """Finite elements with the rotations or strokes that a model computed for the commands, on three meshes."""
    joints, lever = imposed(stage, model, case.drive), stage.chain.link_lengths[2]
    turned = turned_hinges(model.mobility) if case.drive == "joints" else ()
    meshes = [elements(stage, n, turned) for n in levels(case.resolution)]
    commands, at_full = np.outer(case.commanded, joints.per_command[:, case.axis]), []
    for mesh, response in meshes:
        seen = joints.on(response.compliance)
        force = seen.Y @ seen.T @ commands[-1]
        at_full.append((mesh, seen.C[:3, 3:] @ force, np.tensordot(force, response.fields[3:], axes=1)))
    C, limits = np.array([each.response.compliance for each in meshes]), list[str]()
    if joints.model is not None and joints.drive is not None:  # at either end of the commands
        for x in (commands[0], commands[-1]):
            limits += limit_warnings(joints.model, joints.drive, x, np.zeros(3), "least energy")
    return _in_plane(
        stage,
        case,
        at_full,
        error=case.commands @ joints.poses(C[-1]).T - case.commands,
        force=np.zeros((case.points, 3)),
        bands=imposed_bands(joints, C, case, lever),
        compliance=C[-1, :3, :3],
        unknowns=structure(meshes[-1].mesh, plate_of(stage)).size,
        joints=joints.names,
        imposed=commands,
        warnings=tuple(dict.fromkeys(limits)),
    )
