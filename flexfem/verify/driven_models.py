"""Both witnesses of a driven stage: their compliances, what the necks carry, hinge rotations and neck stresses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import AnalyticResult, analyse
from flexfem.analytic.responses import DrivenModel, driven_model
from flexfem.arrays import Array
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.fields import neck_maxima
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import DrivenResponse, driven_response, neck_wrenches
from flexfem.fem.structure import out_of_plane_ratio_of, plate_of
from flexfem.mechanism.contacts import PLAUSIBLE, Stack
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.verify.drive_ranges import DriveAnswers, drive_answers
from flexfem.verify.driven import Driven, Motion, driven, moved
from flexfem.verify.neck_limits import NeckForces, NeckSections, neck_forces, sections_of, stress_along


class Commanding(NamedTuple):
    """An analytic model that computes strokes, and the driven stage as it sees it.

    stage : as it is modelled, see `model.ModelChoice`.
    """

    stage: Stage
    name: str
    result: AnalyticResult
    model: DrivenModel
    of: Driven


class DrivenMetal(NamedTuple):
    """Finite elements of a driven stage, on their mesh.

    across : (3 + n, r), mm and rad per N, pose and openings by forces along the contacts of stated friction.
    """

    mesh: StageMesh
    response: DrivenResponse
    of: Driven
    across: Array


def commanding(stage: Stage, mobility: int | None, formula: str, links: bool) -> Commanding:
    """An analytic model of a driven stage. Raises BadInput as `model.analyse`, or without actuators."""
    result = analyse(stage, mobility, formula, links)
    model = driven_model(stage, result)
    return Commanding(stage, result.name, result, model, driven(model.compliance, drive_of(stage)))


def push_spread(stage: Stage, of: Commanding) -> Array:
    """How much (3,) the engaged stiffness K_ii moves, at most, with pushes spread over half and twice the length that
    is assumed, as far as links reach; zero by rigid links, which do not tell.
    """
    drive = drive_of(stage)
    spread = (tuple(stack.spread_over(times) for stack in drive.stacks) for times in PLAUSIBLE)
    found = [engaged_stiffness(driven(driven_model(stage, of.result, each).compliance, drive)) for each in spread]
    return np.asarray(np.max(np.abs(np.array(found) - engaged_stiffness(of.of)), axis=0))


def engaged_stiffness(of: Driven) -> Array:
    """Stiffness (3,) of the platform with the stacks holding their strokes, each direction with the others held."""
    return np.asarray(np.diag(np.linalg.inv(of.engaged)))


def driven_metal(stage: Stage, resolution: int) -> DrivenMetal:
    """Finite elements of a driven stage. Raises as `protocol.solve_stage`, and BadInput without actuators."""
    drive, plate = drive_of(stage), plate_of(stage)
    mesh = build_mesh(stage, resolution)
    C, fields = driven_response(mesh, plate, with_friction(drive))
    known = 3 + len(drive.stacks)
    response = DrivenResponse(C[:known, :known], fields[:known])
    return DrivenMetal(mesh, response, driven(response.compliance, drive), C[:known, known:])


def metal_answers(stage: Stage, mesh: StageMesh) -> DriveAnswers:
    """What the drive of a stage does, n = 1, by finite elements on a mesh of it.

    Notes
    -----
    Forces, poses and what the necks carry are of the finite elements; the stress of necks is that of `neck_limits`.

    Raises as `driven_response`, and BadInput without actuators.
    """
    drive, plate = drive_of(stage), plate_of(stage)
    C, fields = driven_response(mesh, plate, drive.stacks)
    numbers = ("stiffness", "preload", "blocking_force", "lowest", "highest")
    one = drive._replace(**{name: getattr(drive, name)[None] for name in numbers})
    return drive_answers(lower(stage), driven(C[None], one), neck_wrenches(mesh, plate, fields)[None], one)


def with_friction(drive: StageDrive) -> tuple[Stack, ...]:
    """The stacks of a drive, then its contacts of stated friction pushed along their faces."""
    return (*drive.stacks, *(drive.stacks[k].across for k in drive.rubbing))


def across(stage: Stage, of: Commanding, drive: StageDrive) -> Array:
    """As `DrivenMetal.across`, by an analytic model."""
    known = 3 + len(drive.stacks)
    if not drive.rubbing:
        return np.zeros((known, 0))
    return driven_model(stage, of.result, with_friction(drive)).compliance[:known, known:]


def carried_by(stage: Stage, model: DrivenModel, motion: Motion, load: Array) -> NeckForces:
    """What the necks carry, each (3 chains, 3 hinges), under a load (3,) and the stacks of a motion."""
    wrenches = model.necks @ np.concatenate([load, motion.force])
    return NeckForces(*(each[..., 0] for each in neck_forces(stage_frames(stage), wrenches[..., None])))


def rotations(stage: Stage, of: Commanding, motion: Motion, load: Array) -> Array:
    """Rotation (3 chains, 3 hinges) of every hinge, rad."""
    return np.asarray(of.result.hinges.rotation * carried_by(stage, of.model, motion, load).moment)


def stresses(stage: Stage, of: Commanding, motion: Motion, load: Array) -> Array:
    """Largest von Mises stress (3 chains, 3 hinges) at every notch, MPa, shear included, as `neck_limits` has it."""
    sections = NeckSections(*(each[0] for each in sections_of(lower(stage))))
    return np.asarray(np.max(stress_along(sections, carried_by(stage, of.model, motion, load)), axis=-1))


def element_stresses(stage: Stage, metal: DrivenMetal, drive: StageDrive, x: Array, load: Array) -> Array:
    """As `stresses`, of finite elements with the same commands and with the preloads."""
    force = drive.preload + moved(metal.of, drive, x, load).force
    field = np.tensordot(np.concatenate([load, force]), metal.response.fields, axes=1)
    stress = von_mises(nodal_stress(metal.mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))
    return neck_maxima(stage, metal.mesh, stress)
