"""Both witnesses of a driven stage: their compliances, what the necks carry, hinge rotations and neck stresses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.chains import concentration, von_mises_along
from flexfem.analytic.drive import DrivenModel, driven_model
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, AnalyticResult, analyse, hinge_compliance
from flexfem.arrays import Array
from flexfem.fem.drive import DrivenResponse, driven_response
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import nodal_stress, von_mises
from flexfem.fem.response import neck_maxima, out_of_plane_ratio_of, plate_of
from flexfem.fem.sectors import build_mesh
from flexfem.refused import BadInput
from flexfem.stage.designs import lower, stage_frames
from flexfem.stage.drives import StageDrive, drive_of
from flexfem.stage.schema import Stage
from flexfem.verify.driven import Driven, Motion, driven, moved

BESIDE, SECTIONS = 0.7, 141  # how far beside a neck stress is looked for, per radius of the notch, and where


class Commanding(NamedTuple):
    """An analytic model that computes strokes, and the driven stage as it sees it."""

    name: str
    result: AnalyticResult
    model: DrivenModel
    of: Driven


class DrivenMetal(NamedTuple):
    """Finite elements of a driven stage, on their mesh."""

    mesh: StageMesh
    response: DrivenResponse
    of: Driven


def best_model(stage: Stage, warnings: list[str]) -> tuple[int | None, str, bool]:
    """Calibrated hinges and elastic links, or what is there where a hinge is not on the chart, which is warned of."""
    try:
        hinge_compliance(stage, CALIBRATED)
    except BadInput as refusal:
        warnings.append(f"{refusal.reason}; strokes are of {DEFAULT_FORMULA} instead")
        return None, DEFAULT_FORMULA, True
    return None, CALIBRATED, True


def commanding(stage: Stage, mobility: int | None, formula: str, links: bool) -> Commanding:
    """An analytic model of a driven stage. Raises BadInput as `model.analyse`, or without actuators."""
    result = analyse(stage, mobility, formula, links)
    model = driven_model(stage, result)
    name = f"{formula}, elastic links" if links else f"{formula}, mobility {result.mobility}"
    return Commanding(name, result, model, driven(model.compliance, drive_of(stage)))


def driven_metal(stage: Stage, resolution: int) -> DrivenMetal:
    """Finite elements of a driven stage. Raises as `protocol.solve_stage`, and BadInput without actuators."""
    drive, plate = drive_of(stage), plate_of(stage)
    mesh = build_mesh(stage, resolution)
    response = driven_response(mesh, plate, drive.stacks)
    return DrivenMetal(mesh, response, driven(response.compliance, drive))


class NeckForces(NamedTuple):
    """What the necks carry, (3 chains, 3 hinges): moments about their centres, forces along and across, N mm and N."""

    moment: Array
    normal: Array
    shear: Array


def neck_forces(stage: Stage, model: DrivenModel, motion: Motion, load: Array) -> NeckForces:
    """What the necks carry under a load (3,) and the stacks of a motion."""
    F_x, F_y, M = np.moveaxis(model.necks @ np.concatenate([load, motion.force]), -1, 0)
    placed = stage_frames(stage)
    x, y = np.moveaxis(placed.centres, -1, 0)
    c, s = np.cos(placed.axes), np.sin(placed.axes)
    return NeckForces(M + y * F_x - x * F_y, c * F_x + s * F_y, c * F_y - s * F_x)


def rotations(stage: Stage, of: Commanding, motion: Motion, load: Array) -> Array:
    """Rotation (3 chains, 3 hinges) of every hinge, rad."""
    return np.asarray(of.result.hinges.rotation * neck_forces(stage, of.model, motion, load).moment)


def stresses(stage: Stage, of: Commanding, motion: Motion, load: Array) -> Array:
    """Largest von Mises stress (3 chains, 3 hinges) at every notch, MPa.

    Notes
    -----
    As `chains.neck_stress`, but stacks that work against each other shear necks, and beside the centre of a neck a
    shear force bends: the largest over x of `|6 (M + V x) K_b / (b h^2)| + |N K_t / (b h)|`, h the height of the notch
    at x, whose concentrations are taken to be those of its centre.
    """
    design = lower(stage)
    radius, neck = design.radius[0, ..., None], design.neck[0, ..., None]
    M, N, V = (each[..., None] for each in neck_forces(stage, of.model, motion, load))
    x = radius * np.linspace(-BESIDE, BESIDE, SECTIONS)
    high = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    K = concentration(neck / radius)
    along = np.abs(6 * (M + V * x) * K.bending / high**2) + np.abs(N * K.tension / high)
    return np.asarray(np.max(along, axis=-1) / stage.thickness * von_mises_along(design.out_of_plane[0]))


def element_stresses(stage: Stage, metal: DrivenMetal, drive: StageDrive, x: Array, load: Array) -> Array:
    """As `stresses`, of finite elements with the same commands."""
    force = moved(metal.of, drive, x, load).force
    field = np.tensordot(np.concatenate([load, force]), metal.response.fields, axes=1)
    stress = von_mises(nodal_stress(metal.mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))
    return neck_maxima(stage, metal.mesh, stress)
