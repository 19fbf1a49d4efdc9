"""The protocol of Section V: the force that (18) predicts for a command is applied to the finite elements.

With joints commanded, `imposed`, they are given rotations or strokes instead.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.large import at_pose
from flexfem.analytic.model import AnalyticResult, analyse, assemble
from flexfem.arrays import Array
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import StageMesh, mesh_sectors
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import Response, StaticSolution, unit_response
from flexfem.fem.structure import plate_of
from flexfem.files.provenance import Doubts, doubts
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import Convergence, command_errors, levels, percentages
from flexfem.refused import ComputationFailed
from flexfem.verify.case import DIRECTIONS, Case, Curve, Direction, LoadedCase
from flexfem.verify.errors import Comparison, compare
from flexfem.verify.imposed import CurveAnswer, FullCommand, answer_to_joints, peak_band
from flexfem.verify.result import CurveModels, Fields, Result, Series, Triple, Uncertainty, stamp, versions
from flexfem.verify.solid_case import answer_of_solid
from flexfem.verify.stored import fields_record, model_record


class Solved(NamedTuple):
    """The finite-element answer of one stage; mesh and fields of the whole stage are made on demand."""

    response: Response

    @property
    def mesh(self) -> StageMesh:
        """The whole stage."""
        return self.response.mesh

    @property
    def triangles(self) -> int:
        """Number of triangles of the whole stage."""
        return self.response.triangles


class OnMesh(NamedTuple):
    """A stage solved on a mesh that was stored whole."""

    mesh: StageMesh
    response: StaticSolution

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return len(self.mesh.triangles)


Solve: TypeAlias = Callable[[Stage, int], Solved]  # `solve_stage`, or what keeps its answers


def solve_stage(stage: Stage, resolution: int) -> Solved:
    """Mesh and solve a feasible stage. Raises BadInput for one whose model is not plane, ComputationFailed."""
    check_feasible(stage)
    plate = plate_of(stage)
    return Solved(unit_response(mesh_sectors(stage, resolution), plate))


def compare_exact(stage: Stage, curve: Curve, mesh: StageMesh, direction: Direction, commanded: Array) -> Comparison:
    """As `compare`, by the exact equilibrium of the pseudo-rigid stage and geometrically nonlinear finite elements.

    The loads are reached outwards from rest, on each side of it. Raises ComputationFailed when one is not reached.
    """
    axis, lever = DIRECTIONS.index(direction), stage.chain.link_lengths[2]
    command = np.zeros((len(commanded), 3))
    command[:, axis] = commanded
    force = at_pose(assemble(stage, curve.mobility, curve.formula), command).load
    pose = np.zeros_like(command)
    for side in (np.flatnonzero(commanded > 0), np.flatnonzero(commanded < 0)[::-1]):
        if len(side):
            pose[side] = equilibrium(mesh, plate_of(stage), force[side]).pose
    error = pose - command
    largest = int(np.argmax(commanded))
    return Comparison(force, error, percentages(error[largest], commanded[largest], direction, lever))


def command_warnings(
    stage: Stage, model: AnalyticResult, solved: Solved, forces: Array, where: str
) -> warning.Warnings:
    """Warnings on a model, and on the highest neck stress under the forces (3, 3) of three commands, row by row."""
    found = warning.of_result(stage, model)
    for direction, force in zip(DIRECTIONS, forces, strict=True):
        highest = float(np.max(load_case(stage, solved.mesh, solved.response, force).neck_stress))
        found += warning.of_yield(highest, stage.material.yield_strength, f"{where} in {direction}")
    return found


LARGE_BAND = 0.5  # percentage points of an error: a tenth of the errors that are to be explained
UNSETTLED = 0.05  # percentage points: smaller bands of meshes that do not converge are below what tables are read for
SOUND = ("converging", "round-off")  # verdicts on a sequence of meshes


def _of_bands(uncertainty: dict[Direction, Uncertainty], percent: Triple, where: str) -> list[str]:
    """Error percentages whose mesh bands are large, or whose meshes do not converge."""
    found = []
    for axis, each in uncertainty.items():
        error = f"the error in {axis}, {getattr(percent, axis):.4g} %"
        said = f"{where}: the mesh band of {error}, is ±{each.band:.2g} points"
        if each.band > LARGE_BAND:
            found.append(f"{said}; a higher resolution narrows it")
        elif each.verdict not in SOUND and each.band > UNSETTLED:
            found.append(f"{said}, from meshes that are not converging ({each.verdict})")
    return found


class CurveRun(NamedTuple):
    """One curve of a case, as it is stored."""

    series: Series
    percent: Triple
    uncertainty: dict[Direction, Uncertainty]
    model: CurveModels
    fields: Fields
    warnings: list[str]


def run_case(loaded: LoadedCase, solve: Solve = solve_stage) -> tuple[Result, dict[str, Fields]]:
    """Run every curve of a case; `solve` may keep stages that several cases share.

    Raises BadInput when a stage does not suit the formula, ComputationFailed.
    """
    started = time.perf_counter()
    case = loaded.case
    runs = {curve.label: _run_curve(loaded, curve, solve) for curve in case.curve}
    found = _doubts(loaded)
    result = Result(
        case=loaded.stem,
        name=case.name,
        direction=case.direction,
        analysis=case.analysis,
        drive=case.drive,
        elements=case.model,
        commanded=case.commanded.tolist(),
        curves={label: run.series for label, run in runs.items()},
        error_percent={label: run.percent for label, run in runs.items()},
        uncertainty={label: run.uncertainty for label, run in runs.items()},
        models={label: run.model for label, run in runs.items()},
        assumed=found.assumed,
        not_stated=found.not_stated,
        warnings=[text for run in runs.values() for text in run.warnings],
        versions=versions(),
        written=stamp(),
        seconds=round(time.perf_counter() - started, 3),
    )
    return result, {label: run.fields for label, run in runs.items()}


def _doubts(loaded: LoadedCase) -> Doubts:
    """What is assumed or not stated of a case and its stages, of their drives where these are used."""
    stages = loaded.stages.values()
    if loaded.case.drive != "strokes":
        return doubts([("case: ", loaded.case), *(("", stage) for stage in stages)])
    all_of_them = [doubts([("case: ", loaded.case)]), *(stage.drive_doubts for stage in stages)]
    return Doubts(*(sorted(set(chain.from_iterable(each))) for each in zip(*all_of_them, strict=True)))


def _run_curve(loaded: LoadedCase, curve: Curve, solve: Solve) -> CurveRun:
    case, stage = loaded.case, loaded.stages[curve.label]
    analytic = analyse(stage, curve.mobility, curve.formula, curve.links)
    of = _answer(loaded, curve, analytic, solve)
    percent = Triple.of(of.found.percent)
    uncertainty = _by_direction(of.bands)
    return CurveRun(
        series=Series(**dict(zip(DIRECTIONS, of.found.error.T.tolist(), strict=True))),
        percent=percent,
        uncertainty=uncertainty,
        model=model_record(loaded, curve, analytic, of),
        fields=fields_record(of),
        warnings=_warnings(case, curve, stage, analytic, of)
        + _of_bands(uncertainty, percent, f"curve {curve.label!r}"),
    )


def _answer(loaded: LoadedCase, curve: Curve, analytic: AnalyticResult, solve: Solve) -> CurveAnswer:
    """Finite elements of a curve, as its case wants them."""
    case, stage = loaded.case, loaded.stages[curve.label]
    if case.model == "three_dimensional":
        return answer_of_solid(stage, analytic, case)
    plate_of(stage)
    return (
        _answer_to_force(loaded, curve, analytic, solve)
        if case.drive == "force"
        else answer_to_joints(stage, analytic, case)
    )


def _answer_to_force(loaded: LoadedCase, curve: Curve, analytic: AnalyticResult, solve: Solve) -> CurveAnswer:
    """Finite elements under the force of a model, on three meshes."""
    case, stage = loaded.case, loaded.stages[curve.label]
    meshes = [solve(stage, resolution) for resolution in levels(case.resolution)]
    solved, axis = meshes[-1], DIRECTIONS.index(case.direction)
    found = _compared(loaded, curve, analytic, solved)
    loads = [load_case(stage, each.mesh, each.response, found.force[-1]) for each in meshes]
    full = [FullCommand(each.pose, each.field, each.stress, each.neck_stress) for each in loads]
    return CurveAnswer(
        found=found,
        full=full[-1],
        peak_band=peak_band(levels(case.resolution), [each.per_displacement(axis) for each in full]),
        bands=_bands(case, analytic.stiffness, np.array([each.response.compliance for each in meshes]), _lever(stage)),
        compliance=solved.response.compliance,
        mesh=solved.mesh,
        unknowns=solved.response.unknowns,
    )


def _compared(loaded: LoadedCase, curve: Curve, analytic: AnalyticResult, solved: Solved) -> Comparison:
    """Finite elements under the force of a curve, linear or exact as its case says."""
    case, stage = loaded.case, loaded.stages[curve.label]
    if case.analysis == "linear":
        compliance, lever = solved.response.compliance, stage.chain.link_lengths[2]
        return compare(analytic.stiffness, compliance, case.direction, case.commanded, lever)
    try:
        return compare_exact(stage, curve, solved.mesh, case.direction, case.commanded)
    except ComputationFailed as failure:
        raise ComputationFailed(f"{loaded.path}: curve {curve.label!r}: {failure}") from None


def _warnings(case: Case, curve: Curve, stage: Stage, analytic: AnalyticResult, of: CurveAnswer) -> warning.Warnings:
    """Warnings on one curve: its model, and what it does at full command."""
    of_curve = [*warning.of_result(stage, analytic), *of.warnings]
    where = f"curve {curve.label!r}, full command"
    found = warning.of_yield(float(np.max(of.full.neck_stress)), stage.material.yield_strength, where)
    if case.analysis == "linear":
        found += warning.of_motion(stage, of.full.pose, where)
    return [f"curve {curve.label!r}: {text}" for text in of_curve] + found


def _bands(case: Case, stiffness: Array, compliances: Array, lever: float) -> tuple[Convergence, ...]:
    """Grid convergence of the three percentages from the compliances (levels, 3, 3), coarse to fine."""
    return command_errors(np.array(levels(case.resolution)), compliances, stiffness, case.direction, lever)


def _by_direction(bands: tuple[Convergence, ...]) -> dict[Direction, Uncertainty]:
    return {name: Uncertainty.of(each) for name, each in zip(DIRECTIONS, bands, strict=True)}


def _lever(stage: Stage) -> float:
    return stage.chain.link_lengths[2]
