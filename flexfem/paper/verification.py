"""Errors of finite elements under the force (18) or the joint commands of an analytic model:
Figures 5 to 7.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from flexfem.arrays import Array, is_largest
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response
from flexfem.files.provenance import assumptions
from flexfem.files.refusals import shown
from flexfem.files.toml import bad_key
from flexfem.files.writing import (
    digest,
    digest_of_arrays,
    read_arrays,
    write_atomically,
)
from flexfem.paper import warnings
from flexfem.paper.answers import solid_levels
from flexfem.paper.case import Case, Curve, LoadedCase
from flexfem.paper.commanding import limit_warnings
from flexfem.paper.designs import stage_frames
from flexfem.paper.equilibrium import at_pose, outwards
from flexfem.paper.fields import neck_maxima, plane_stress
from flexfem.paper.imposed import commanded_hinges, elements, imposed, imposed_bands
from flexfem.paper.model import AnalyticResult, analyse, assemble
from flexfem.paper.solutions import solve_solid, solved
from flexfem.paper.stage import HINGE_NAMES, Stage
from flexfem.paper.stage_mesh import plate_of, sheet_of
from flexfem.questions import bands
from flexfem.questions.bands import Convergence, Verdict, error_matrix, levels
from flexfem.questions.setup import ModelAnswer, stack_models
from flexfem.questions.warnings import of_yield
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSE_MESHES,
    ELEMENTS,
    EXACT,
    NEW_MESH,
    SOLVED,
    STRESS,
    About,
    Fields,
    Gate,
    Quantity,
    Result,
)
from flexfem.units import DIRECTIONS

LARGE_BAND = 0.5  # percentage points of an error: a tenth of the errors to be explained
# percentage points: smaller bands of meshes that do not converge do not matter in the tables
UNSETTLED = 0.05
SOUND = ("converging", "round-off")  # verdicts on a sequence of meshes
POINT = ("curve", "point", "direction")
SETTINGS = ("direction", "analysis", "drive", "model", "resolution")  # keys of a case
MATRIX = ("curve", "component", "direction")
PERCENT_GATE = Gate(
    NEW_MESH.relative, absolute=100 * NEW_MESH.relative
)  # relative to the displacement, not to its error


class HingeDrawing(BaseModel):
    """A hinge as modelled: centre, mm, direction of the neck, rad, radius and neck, mm, freedoms."""

    chain: int
    hinge: str
    centre: tuple[float, float]
    axis: float
    radius: float
    neck: float
    freedoms: list[str]

    @classmethod
    def of_stage(
        cls, stage: Stage, freedoms: Sequence[Sequence[Sequence[str]]]
    ) -> list[HingeDrawing]:
        """Return the hinges of a stage, chain by chain, with their freedoms (3 chains, 3 hinges)."""
        frames = stage_frames(stage)
        drawings = []
        for (row, k), axis in np.ndenumerate(frames.axes):
            name = HINGE_NAMES[k]
            x, y = frames.centres[row, k].tolist()
            kinds = list(freedoms[row][k])
            where: dict[str, Any] = {
                "chain": row + 1,
                "hinge": name,
                "centre": (x, y),
                "axis": float(axis),
            }
            size = stage.hinge(row + 1, name)
            drawings.append(cls(**where, radius=size.radius, neck=size.neck, freedoms=kinds))
        return drawings


class CurveModels(BaseModel):
    """The stage and the two models of a curve, as needed for figures.

    plane : the stage's own plane problem.   layers : in half the thickness, 0 for a plane mesh.
    lever : l3, mm.   verdicts : on the mesh convergence of the error in each direction.
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
    """Finite-element displacement compared with the commanded one, for each curve of a case."""

    title = "errors of the finite-element displacement"
    stored_by = "paper.page"
    main_result = ("percent", {})
    columns = ("direction",)
    footnotes = ("errors are those at the largest command; rotations are multiplied by l3",)
    percent = Quantity(
        "positioning error, % of the commanded motion",
        "percents",
        ("curve", "direction"),
        PERCENT_GATE,
    )
    along = Quantity(
        "stiffness of the platform along each direction",
        "stiffness",
        ("curve", "model", "direction"),
        NEW_MESH,
    )
    peak = Quantity(
        "highest neck stress per displacement along the command",
        "stress per motion",
        ("curve", "model", "chain", "hinge", "direction"),
        STRESS,
        "all",
        note=(
            "the analytic stress is with the other directions held; that of finite elements is "
            "divided by the resulting displacement"
        ),
    )
    neck_stress = Quantity(
        "neck stress of finite elements at the largest command",
        "mpa",
        ("curve", "chain", "hinge"),
        STRESS,
        "all",
    )
    load = Quantity(
        "load on the platform at the largest command",
        "wrench",
        ("curve", "direction"),
        SOLVED,
        "wrench",
    )
    command = Quantity(
        "commanded displacement", "motion", ("point", "direction"), EXACT, "pose", shown=False
    )
    error = Quantity(
        "finite-element minus commanded displacement",
        "motion",
        POINT,
        COARSE_MESHES,
        "pose",
        shown=False,
    )
    force = Quantity(
        "load of the model on the platform", "wrench", POINT, SOLVED, "wrench", shown=False
    )
    rotation = Quantity(
        "imposed rotation", "rad", ("curve", "point", "joint"), SOLVED, "axis", shown=False
    )
    stroke = Quantity(
        "imposed stroke", "mm", ("curve", "point", "joint"), SOLVED, "axis", shown=False
    )
    stiffness = Quantity(
        "analytic stiffness", "stiffness matrix", MATRIX, EXACT, "matrix", shown=False
    )
    compliance = Quantity(
        "compliance of finite elements",
        "compliance matrix",
        MATRIX,
        NEW_MESH,
        "matrix",
        shown=False,
    )
    on_meshes = Quantity(
        "error on each mesh, coarse to fine",
        "percents",
        ("curve", "mesh", "direction"),
        Gate(COARSE_MESHES.relative, absolute=100 * COARSE_MESHES.relative),
        shown=False,
    )
    layer_band = Quantity(
        "part of the error band due to the layers",
        "percents",
        ("curve", "direction"),
        Gate(0.05),
        shown=False,
    )
    name = property(lambda self: self.about.name, doc="Name of the case.")
    assumed = property(
        lambda self: list(self.about.assumed), doc="Key paths of numbers that are assumed."
    )
    not_stated = property(
        lambda self: list(self.about.not_stated),
        doc="Key paths of numbers without a stated source.",
    )
    case = property(
        lambda self: Path(self.about.file).stem, doc="Name of the case file without its ending."
    )
    direction = property(lambda self: self.settings["direction"], doc="Direction of the command.")
    analysis = property(lambda self: self.settings["analysis"], doc="Linear or nonlinear.")
    drive = property(lambda self: self.settings["drive"], doc="Input of the finite elements.")
    elements = property(lambda self: self.settings["model"], doc="Kind of finite elements.")
    curves = property(lambda self: self.axes["curve"], doc="Labels of the curves.")
    commanded = property(
        lambda self: self.command[:, DIRECTIONS.index(self.direction)],
        doc="Commands (n,), mm, rad.",
    )

    @property
    def models(self) -> dict[str, CurveModels]:
        """Stage and models of each curve by label."""
        return {label: CurveModels(**stored) for label, stored in self.settings["curves"].items()}

    def write(self, path: Path) -> Path:
        """Write the result as JSON and its fields as .npz in the same folder; return the path of
        the JSON file.
        """
        if self.fields is not None:
            numbered = enumerate(self.fields[label]._asdict() for label in self.curves)
            arrays = {
                f"{k}.{key}": value for k, fields in numbered for key, value in fields.items()
            }
            self.settings["stored"] = {"fields": digest_of_arrays(arrays)}
            npz = path.with_suffix(".npz")
            write_atomically(
                npz, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays)
            )
        return super().write(path)

    def read_fields(self, path: str | os.PathLike[str]) -> dict[str, Fields]:
        """Read the fields stored with this result. Raises BadInput if they are missing or of
        another result.
        """
        npz = Path(path).with_suffix(".npz")
        arrays = read_arrays(npz, f"the fields of {path}")
        if digest_of_arrays(arrays) != self.settings.get("stored", {}).get("fields"):
            raise BadInput(
                f"{npz}: not the fields that were stored with {path}; run flexfem verify again"
            )
        numbered = enumerate(self.curves)
        return {
            label: Fields(*(arrays[f"{k}.{key}"] for key in Fields._fields))
            for k, label in numbered
        }


class CurveElements(NamedTuple):
    """Finite elements of a curve: displacement error and force (points, 3); pose (3,), stress,
    fields at full command.

    bands : of the three percentages; of_layers (3,) is the share of the layers.   compliance : (3,
    3), of the platform.
    peak_band : half-width of the highest neck stress per displacement, nan if there is one mesh.
    joints, imposed : names (m,), and imposed rotations or strokes (points, m).
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


class VerifiableCase(NamedTuple):
    """A case file, as `flexfem verify` compares it."""

    loaded: LoadedCase

    def errors(self, layers: int | None) -> Verification:
        """Return the errors of all curves; a case states its layers itself."""
        return run_case(self.loaded)


def load_comparison(path: Path, solid: bool) -> VerifiableCase:
    """Read a case. Raises BadInput, also for the option `solid`, which is not for cases."""
    loaded = LoadedCase(path)
    if solid:
        raise BadInput(
            f'{path}: solid is for mechanisms, expected model = "three_dimensional" in a case'
        )
    return VerifiableCase(loaded)


class CurveRun(NamedTuple):
    """A curve of a case with its stage, analytic model and finite elements."""

    curve: Curve
    stage: Stage
    model: AnalyticResult
    elements: CurveElements


def run_case(loaded: LoadedCase) -> Verification:
    """Run every curve of a case.

    Raises BadInput if a stage does not suit its formula, ComputationFailed.
    """
    case = loaded.case
    runs = _runs(loaded)
    joints = tuple(dict.fromkeys(name for run in runs for name in run.elements.joints))
    curves = {run.curve.label: _curve_models(case, run) for run in runs}
    labels = {
        "curve": tuple(curves),
        "model": (ANALYTIC, ELEMENTS),
        "point": [str(k) for k in range(case.points)],
        "mesh": [f"{n} triangles" for n in levels(case.resolution)],
        "joint": joints,
    }
    quantities = {run.curve.label: _quantities(case, run, joints) for run in runs}
    values, widths = stack_models(Verification, quantities, labels, "curve")
    settings = {key: getattr(case, key) for key in SETTINGS}
    settings["curves"] = {label: curve.model_dump() for label, curve in curves.items()}
    return Verification(
        _about(loaded, curves),
        values | {"command": case.commands},
        widths,
        labels,
        settings,
        [text for run in runs for text in _warnings(case, run)],
        [_summary(label, curve) for label, curve in curves.items()],
        {run.curve.label: run.elements.fields for run in runs},
    )


def _runs(loaded: LoadedCase) -> list[CurveRun]:
    """Analyse and solve every curve. Raises BadInput before the first finite elements."""
    case = loaded.case
    models = dict[Curve, AnalyticResult]()
    for curve in case.curve:
        stage = loaded.stages[curve.label]
        with _named(loaded, curve):
            models[curve] = analyse(stage, curve.mobility, curve.formula, curve.links)
    solve = _solve_force if case.drive == "force" else _solve_imposed
    if case.model == "three_dimensional":
        solve = _solve_solid
    runs = list[CurveRun]()
    for curve, model in models.items():
        stage = loaded.stages[curve.label]
        with _named(loaded, curve):
            runs.append(CurveRun(curve, stage, model, solve(stage, curve, model, case)))
    return runs


def _about(loaded: LoadedCase, curves: Mapping[str, CurveModels]) -> About:
    """Return a case, with the doubtful numbers of its stages, as the subject of a result."""
    own = assumptions([("case: ", loaded.case)])
    assumed = {key for curve in curves.values() for key in curve.assumed}
    not_stated = {key for curve in curves.values() for key in curve.not_stated}
    return About(
        loaded.case.name,
        str(loaded.path),
        digest({label: curve.hash for label, curve in curves.items()}),
        sorted({*own.assumed, *assumed}),
        sorted({*own.not_stated, *not_stated}),
        loaded.stages[loaded.case.curve[0].label].lever,
    )


def _quantities(
    case: Case,
    run: CurveRun,
    joints: Sequence[str],
) -> ModelAnswer:
    """Return the quantities of one curve."""
    model = run.model
    fe = run.elements
    axis = case.axis
    peak, peak_band = np.full((2, 2, 3, 3, 3), np.nan)
    if not fe.joints:
        peak[0, ..., axis] = model.stress[..., axis]
    peak[1, ..., axis] = per_displacement = fe.neck_stress / abs(fe.pose[axis])
    peak_band[1, ..., axis] = np.where(is_largest(per_displacement), fe.peak_band, np.nan)
    lever = run.stage.chain.link_lengths[2]
    values: dict[str, Any] = {
        "percent": bands.percentages(fe.error[-1], case.commanded[-1], case.direction, lever),
        "along": [np.diag(model.stiffness), np.diag(np.linalg.inv(fe.compliance))],
        "peak": peak,
        "neck_stress": fe.neck_stress,
        "error": fe.error,
        "stiffness": model.stiffness,
        "compliance": fe.compliance,
        "on_meshes": np.transpose([convergence.values for convergence in fe.bands]),
    }
    if fe.joints:  # nan for a joint that the curve does not have
        imposed = np.full((case.points, len(joints)), np.nan)
        imposed[:, [joints.index(name) for name in fe.joints]] = fe.imposed
        values["rotation" if case.drive == "joints" else "stroke"] = imposed
    else:
        values |= {"force": fe.force, "load": fe.force[-1]}
    if case.model == "three_dimensional":
        values["layer_band"] = fe.of_layers
    return ModelAnswer(
        values, {"percent": [convergence.band for convergence in fe.bands], "peak": peak_band}
    )


def _summary(label: str, curve: CurveModels) -> str:
    """Describe the stage and the models of a curve in a line."""
    formula = f"{curve.formula}{', elastic links' * curve.links}"
    layers = f", {curve.layers} layers" if curve.layers else ""
    mesh = f"{curve.resolution} triangles across every neck{layers}, {curve.unknowns} unknowns"
    model = f"{curve.stage}, {curve.plane.replace('_', ' ')}, mobility {curve.mobility}, {formula}"
    return f"{label}: {model}; {mesh}; meshes: {', '.join(curve.verdicts)}"


def _curve_models(case: Case, run: CurveRun) -> CurveModels:
    """Return the description of a curve that is stored with its numbers."""
    curve, stage, model, elements = run
    strokes = case.drive == "strokes"
    doubts = stage.drive_assumptions if strokes else stage
    return CurveModels(
        stage=stage.name,
        file=curve.stage,
        hash=stage.drive_hash if strokes else stage.hash,
        plane=stage.model,
        mobility=model.mobility,
        formula=model.formula,
        links=curve.links,
        assumed=list(doubts.assumed),
        not_stated=list(doubts.not_stated),
        lever=stage.chain.link_lengths[2],
        hub_radius=stage.platform.hub_radius,
        hinges=HingeDrawing.of_stage(stage, model.freedoms),
        resolution=case.resolution,
        layers=case.layers if case.model == "three_dimensional" else 0,
        triangles=len(elements.fields.triangles),
        unknowns=elements.unknowns,
        verdicts=[convergence.verdict for convergence in elements.bands],
    )


def _warnings(case: Case, run: CurveRun) -> list[str]:
    """Return the warnings on one curve: on its model, its stress and motion at full command, and
    its bands.
    """
    curve, stage, model, elements = run
    where = f"curve {curve.label!r}"
    found = [f"{where}: {text}" for text in (*warnings.of_result(stage, model), *elements.warnings)]
    highest = float(np.max(elements.neck_stress))
    full = f"{where}, full command"
    found += of_yield(highest, stage.material.yield_strength, full)
    if case.analysis == "linear":
        found += warnings.of_motion(stage, elements.pose, full)
    for direction, (values, verdict, *_, band) in zip(DIRECTIONS, elements.bands, strict=True):
        text = (
            f"{where}: the mesh band of the error in {direction}, {values[-1]:.4g} %, is "
            f"±{band:.2g} points"
        )
        if band > LARGE_BAND:
            found.append(f"{text}; a higher resolution reduces it")
        elif verdict not in SOUND and band > UNSETTLED:
            found.append(f"{text}, from meshes that do not converge ({verdict})")
    return found


@contextmanager
def _named(loaded: LoadedCase, curve: Curve) -> Iterator[None]:
    """Name the case file and the curve in refusals and failures of a curve."""
    try:
        yield
    except BadInput as error:
        index = loaded.case.curve.index(curve)
        raise bad_key(
            loaded.path, ("curve", index), f"curve[{index}], {shown(curve.label)}: {error}"
        ) from None
    except ComputationFailed as failure:
        raise ComputationFailed(f"{loaded.path}: curve {curve.label!r}: {failure}") from None


def _solve_force(
    stage: Stage,
    curve: Curve,
    model: AnalyticResult,
    case: Case,
) -> CurveElements:
    """Solve three meshes under the force of a model; in a nonlinear case, under the force of exact
    equilibrium.
    """
    steps = levels(case.resolution)
    command = case.commands
    lever = stage.chain.link_lengths[2]
    meshes = [solved(stage, level) for level in steps]
    finest = meshes[-1]
    compliances = np.array([mesh.compliance for mesh in meshes])
    force = command @ model.stiffness.T  # (18)
    pose = force @ finest.compliance.T
    if case.analysis == "nonlinear":
        force = at_pose(assemble(stage, curve.mobility, curve.formula), command).load
        for side in outwards(np.sum(command, axis=1)):  # continuation from rest, on each side of it
            pose[side] = equilibrium(finest.mesh, plate_of(stage), force[side]).pose
    full = force[-1]
    return _in_plane(
        stage,
        case,
        [(fe.mesh, fe.compliance @ full, np.tensordot(full, fe.fields, axes=1)) for fe in meshes],
        error=pose - command,
        force=force,
        bands=bands.command_errors(
            np.array(steps), compliances, model.stiffness, case.direction, lever
        ),
        compliance=finest.compliance,
        unknowns=finest.unknowns,
    )


def _in_plane(
    stage: Stage, case: Case, at_full: Sequence[tuple[PlaneMesh, Array, Array]], **others: Any
) -> CurveElements:
    """Collect plane finite elements; at_full: meshes, coarse to fine, with pose (3,) and
    displacement field.
    """
    stresses = [plane_stress(stage, mesh, field) for mesh, _, field in at_full]
    steps = np.array(levels(case.resolution), dtype=float)
    necks = [
        neck_maxima(stage, mesh, stress)
        for (mesh, *_), stress in zip(at_full, stresses, strict=True)
    ]
    peaks = [
        np.max(neck) / abs(pose[case.axis])
        for (_, pose, _), neck in zip(at_full, necks, strict=True)
    ]
    mesh, pose, field = at_full[-1]
    return CurveElements(
        pose=pose,
        neck_stress=necks[-1],
        fields=Fields(mesh.nodes, mesh.triangles, mesh.bodies, field, stresses[-1]),
        peak_band=float(bands.stress_bands(steps, np.array(peaks))),
        **others,
    )


def _solve_solid(
    stage: Stage,
    _: Curve,
    model: AnalyticResult,
    case: Case,
) -> CurveElements:
    """Solve three-dimensional finite elements under the force of a model: mid-plane, and stress
    over the thickness.

    The in-plane mesh error is assumed equal with one layer and with more. The error of the layers
    is bounded by `RelativeError.of_readings` with the change from few layers to more, and is zero
    where symmetry leaves round-off."""
    response = solve_solid(stage, case.resolution, case.layers)
    force = case.commands @ model.stiffness.T  # (18)
    mesh = response.mesh
    field = np.tensordot(force[-1], response.fields, axes=1)
    stress = von_mises(nodal_stress(mesh, sheet_of(stage), field, layers=response.layers))
    highest = stress.max(axis=1)
    bands_of_errors, of_layers = _solid_bands(stage, model.stiffness, response, case)
    return CurveElements(
        error=force @ response.compliance.T - case.commands,
        force=force,
        pose=response.compliance @ force[-1],
        neck_stress=neck_maxima(stage, mesh, highest),
        fields=Fields(mesh.nodes, mesh.triangles, mesh.bodies, field[:, 0, :2], highest),
        bands=bands_of_errors,
        compliance=response.compliance,
        unknowns=response.unknowns,
        of_layers=of_layers,
        warnings=tuple(warnings.held_faces(stage)),
    )


def _solid_bands(
    stage: Stage, K: Array, response: Response, case: Case
) -> tuple[tuple[Convergence, ...], Array]:
    """Return the bands of the errors in three dimensions, and their share (3,) by the layers.

    K : (3, 3), stiffness of the analytic model.
    """
    steps = np.array(levels(case.resolution))
    bounds = solid_levels(stage, case.resolution, case.layers)
    many = bounds.planes + (response.compliance - bounds.planes[-1])
    errors = bands.command_errors(steps, many, K, case.direction, stage.lever)
    few, more = (error_matrix(K, C, stage.lever)[:, case.axis] for C in (bounds.few, bounds.many))
    changes = bounds.of_layers.of_readings(bounds.many, K[:, case.axis], np.eye(3))
    percent = bands.percentages(changes, 1.0, case.direction, stage.lever)
    zero = np.maximum(np.abs(few), np.abs(more)) <= bands.ROUND_OFF
    of_layers = np.where(zero, 0.0, percent)
    found = list[Convergence]()
    for error, layer_band in zip(errors, of_layers.tolist(), strict=True):
        in_plane = max(error.band, bands.mesh_band(steps, error.values))
        found.append(error._replace(band=in_plane + layer_band))
    return tuple(found), of_layers


def _solve_imposed(
    stage: Stage,
    _: Curve,
    model: AnalyticResult,
    case: Case,
) -> CurveElements:
    """Solve three meshes with the rotations or strokes that a model computes for the commands."""
    joints = imposed(stage, model, case.drive)
    lever = stage.chain.link_lengths[2]
    hinges = commanded_hinges(model.mobility) if case.drive == "joints" else ()
    responses = [elements(stage, n, hinges) for n in levels(case.resolution)]
    commands = np.outer(case.commanded, joints.per_command[:, case.axis])
    at_full = []
    for response in responses:
        driven = joints.on(response.compliance)
        force = driven.per_command @ commands[-1]
        at_full.append(
            (
                response.mesh,
                driven.C[:3, 3:] @ force,
                np.tensordot(force, response.fields[3:], axes=1),
            )
        )
    C = np.array([response.compliance for response in responses])
    limits = list[str]()
    if joints.model is not None:  # the limits at both ends of the commands
        for x in (commands[0], commands[-1]):
            limits += limit_warnings(joints.model, x, np.zeros(3), "least energy")
    return _in_plane(
        stage,
        case,
        at_full,
        error=case.commands @ joints.poses(C[-1]).T - case.commands,
        force=np.zeros((case.points, 3)),
        bands=imposed_bands(joints, C, case, lever),
        compliance=C[-1, :3, :3],
        unknowns=responses[-1].structure.size,
        joints=joints.drive.names,
        imposed=commands,
        warnings=tuple(dict.fromkeys(limits)),
    )
