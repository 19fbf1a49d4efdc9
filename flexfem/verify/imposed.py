"""Section V with joints commanded: the rotations or strokes that a model computes for a pose, imposed on the metal.

The model turns the commanded pose into rotations of the hinges it calls independent, or into strokes of the stage's
stacks, by least energy (29), (30). No force is on the platform: a wrong stiffness of the model is not seen, what is
seen is what else the metal does while its joints are held. `couples` says what the rotation of a hinge is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.responses import driven_model
from flexfem.arrays import Array, inverse
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.fields import neck_maxima
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import DrivenResponse, driven_response
from flexfem.fem.structure import out_of_plane_ratio_of, plate_of, tie_hub
from flexfem.mechanism.contacts import Stack, couple_names, hinge_couples
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import Convergence, command_convergence, error_matrix, levels, stress_bands
from flexfem.questions.drive import limit_warnings
from flexfem.questions.driven import Driven, commands_for, driven, held
from flexfem.verify.case import DIRECTIONS, Case, Drive
from flexfem.verify.errors import Comparison, compare

RIGID = 1e-12  # of the largest rotational compliance: rotations that a model of fewer freedoms does not allow
KEPT = 12  # answers of finite elements: three levels of two stages for two kinds of drive


class Imposed(NamedTuple):
    """What a model computed for the pose: rotations of hinges, or strokes of the drive.

    stacks : conjugate to them.   names : (m,).   given : (m, 3), per command in x, y, theta: rad or mm, per mm and rad.
    model, drive : the driven stage as the model sees it, and its stacks; None where hinges are turned.
    """

    stacks: tuple[Stack, ...]
    names: tuple[str, ...]
    given: Array
    model: Driven | None
    drive: StageDrive | None

    def on(self, compliance: Array) -> Driven:
        """The same drive on another compliance (3 + n, 3 + n), as of the metal."""
        return held(compliance) if self.drive is None else driven(compliance, self.drive)

    def poses(self, compliance: Array) -> Array:
        """Pose (3, 3) that a compliance takes, column j for a unit command in direction j."""
        return np.asarray(self.on(compliance).poses @ self.given)


class FullCommand(NamedTuple):
    """The metal at full command: pose (3,), field (n, 2) mm, stress (n,) MPa, its largest (3 chains, 3 hinges)."""

    pose: Array
    field: Array
    stress: Array
    neck_stress: Array

    def per_displacement(self, axis: int) -> Array:
        """Highest stress at each neck (3, 3) over the displacement reached in a direction, MPa per mm or rad."""
        return np.asarray(self.neck_stress / abs(self.pose[axis]))


class CurveAnswer(NamedTuple):
    """What finite elements did of one curve.

    imposed : (points, m), rotations or strokes that they were given, by `joints`; neither under a force.
    bands : of the three percentages.   compliance : (3, 3), of the platform, without drive.
    peak_band : half-width by meshes of the highest neck stress per displacement reached; None of one mesh.
    layers, of_layers : in three dimensions their number, and their share (3,) of the bands, percentage points.
    """

    found: Comparison
    full: FullCommand
    bands: tuple[Convergence, ...]
    compliance: Array
    mesh: StageMesh
    unknowns: int
    joints: tuple[str, ...] = ()
    imposed: Array = np.zeros((0, 0))
    warnings: tuple[str, ...] = ()
    peak_band: float | None = None
    layers: int = 0
    of_layers: Array = np.zeros(3)


class ImposedElements(NamedTuple):
    """Finite elements under unit loads of platform and stacks, on their mesh."""

    mesh: StageMesh
    response: DrivenResponse


def turned_hinges(mobility: int) -> tuple[int, ...]:
    """Positions of the hinges whose rotations are commanded: the independent joints of the paper."""
    return (0,) if mobility == 3 else (0, 1)


def imposed(stage: Stage, analytic: AnalyticResult, drive: Drive) -> Imposed:
    """What an analytic model of a stage has its hinges or stacks do. Raises BadInput for strokes without actuators."""
    return _rotations(stage, analytic) if drive == "joints" else _strokes(stage, analytic)


def _rotations(stage: Stage, analytic: AnalyticResult) -> Imposed:
    """Rotations a by which the model itself takes a pose u, of all such those of least energy.

    Notes
    -----
    min a' C_dd^-1 a with C_Ud C_dd^-1 a = u, so a = C_dU (C_Ud C_dd^-1 C_dU)^-1 u. Where these rotations fix all of the
    model, as with mobility three and six, that is (29), (30).
    """
    positions = turned_hinges(analytic.mobility)
    couples = hinge_couples(stage, positions)
    C = driven_model(stage, analytic, couples).compliance
    given = C[3:, :3] @ inverse(C[:3, 3:] @ np.linalg.pinv(C[3:, 3:], RIGID, hermitian=True) @ C[3:, :3])
    return Imposed(couples, couple_names(positions), given, None, None)


def _strokes(stage: Stage, analytic: AnalyticResult) -> Imposed:
    drive, lever = drive_of(stage), stage.chain.link_lengths[2]
    model = driven(driven_model(stage, analytic).compliance, drive)
    none, units = np.zeros(3), np.diag([1.0, 1.0, 1.0 / lever])
    each = [commands_for(model, drive, unit, none, lever, "least energy") for unit in units]
    return Imposed(drive.stacks, drive.names, np.array(each).T @ np.diag([1.0, 1.0, lever]), model, drive)


@lru_cache(maxsize=KEPT)
def elements(stage: Stage, resolution: int, drive: Drive, mobility: int) -> ImposedElements:
    """Finite elements of a stage with its hinges or stacks as further loads. Raises as `protocol.solve_stage`."""
    plate = plate_of(stage)
    mesh = build_mesh(stage, resolution)
    stacks = hinge_couples(stage, turned_hinges(mobility)) if drive == "joints" else drive_of(stage).stacks
    return ImposedElements(mesh, driven_response(mesh, plate, stacks))


def answer_to_joints(stage: Stage, analytic: AnalyticResult, case: Case) -> CurveAnswer:
    """Finite elements with the rotations or strokes that a model computed for the commands of a case, on three meshes.

    Raises BadInput, ComputationFailed.
    """
    given, axis, lever = imposed(stage, analytic, case.drive), DIRECTIONS.index(case.direction), _lever(stage)
    meshes = [elements(stage, n, case.drive, analytic.mobility) for n in levels(case.resolution)]
    finest = meshes[-1]
    commands = np.outer(case.commanded, given.given[:, axis])
    full = [_full(stage, given, each, commands[-1]) for each in meshes]
    return CurveAnswer(
        found=compared(given, finest.response.compliance, case, lever),
        full=full[-1],
        bands=_bands(given, np.array([each.response.compliance for each in meshes]), case, lever),
        compliance=finest.response.compliance[:3, :3],
        mesh=finest.mesh,
        unknowns=2 * len(tie_hub(finest.mesh).free) + 3,
        joints=given.names,
        imposed=commands,
        warnings=tuple(_of_strokes(given, commands)),
        peak_band=peak_band(levels(case.resolution), [each.per_displacement(axis) for each in full]),
    )


def peak_band(steps: Sequence[int], stresses: Sequence[Array]) -> float:
    """Half-width by meshes, coarse to fine, of the highest of neck stresses (3, 3) per displacement."""
    return float(stress_bands(np.array(steps, dtype=float), np.array([np.max(each) for each in stresses])))


def compared(given: Imposed, compliance: Array, case: Case, lever: float) -> Comparison:
    """Poses of a compliance (3 + n, 3 + n) with what is given it, less those commanded; no force is on the platform."""
    found = compare(np.eye(3), given.poses(compliance), case.direction, case.commanded, lever)
    return found._replace(force=np.zeros_like(found.force))


def _full(stage: Stage, given: Imposed, of: ImposedElements, command: Array) -> FullCommand:
    metal = given.on(of.response.compliance)
    force = metal.Y @ metal.T @ command
    field = np.tensordot(force, of.response.fields[3:], axes=1)
    stress = von_mises(nodal_stress(of.mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))
    return FullCommand(metal.C[:3, 3:] @ force, field, stress, neck_maxima(stage, of.mesh, stress))


def _bands(given: Imposed, compliances: Array, case: Case, lever: float) -> tuple[Convergence, ...]:
    """Grid convergence of the percentages of a case on meshes (levels, 3 + n, 3 + n), coarse to fine.

    Notes
    -----
    With the forces f = Y T x an error dC of the compliance moves the pose by r' dC f to first order, where the
    readings r = (1, -Y C_dU) are the loads of the platform with the drive holding its strokes.
    """
    axis, steps = DIRECTIONS.index(case.direction), np.array(levels(case.resolution))
    percents = np.array([error_matrix(np.eye(3), given.poses(C), lever)[:, axis] for C in compliances])
    metal = given.on(compliances[-1])
    force = np.concatenate([np.zeros(3), metal.Y @ metal.T @ given.given[:, axis]])
    readings = np.concatenate([np.eye(3), -metal.Y @ metal.C[3:, :3]])
    return command_convergence(steps, percents, axis, compliances, force, lever, readings)


def _of_strokes(given: Imposed, commands: Array) -> warning.Warnings:
    """Limits of stroke, contact and blocking force that the strokes of either end of the commands break."""
    model, drive, none = given.model, given.drive, np.zeros(3)
    if model is None or drive is None:
        return []
    found = [limit_warnings(model, drive, x, none, "least energy") for x in (commands[0], commands[-1])]
    return list(dict.fromkeys(text for each in found for text in each))


def _lever(stage: Stage) -> float:
    return stage.chain.link_lengths[2]
