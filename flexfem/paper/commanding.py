"""Driven stages by both models: the analytic model that computes strokes, and finite elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import PlaneMesh
from flexfem.paper.contacts import PLAUSIBLE, Stack
from flexfem.paper.designs import design_arrays, stage_frames
from flexfem.paper.driven import DriveRanges, drive_ranges, sections_of, stress_along
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.fields import driven_response, neck_maxima, neck_wrenches, plane_stress
from flexfem.paper.model import AnalyticResult, ModelChoice, analyse, at_necks
from flexfem.paper.responses import driven_model
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.questions.driven import ROUND_OFF, Criterion, DriveSystem, Motion, stack_names


class Commanding(NamedTuple):
    """An analytic model that computes strokes, and its stage as modelled (`model.ModelChoice`).

    necks : (3 chains, 3 hinges, 3, 3 + n), of `responses.DrivenModel`.
    across : (3 + n, r), mm and rad per N, pose and openings by tangential forces at contacts with
    stated friction.
    """

    stage: Stage
    result: AnalyticResult
    necks: Array
    system: DriveSystem
    across: Array

    def carried(
        self,
        load: Array,
        force: Array,
    ) -> Array:
        """Return moment, axial and shear force (3, 3 chains, 3 hinges) of every notch.

        load : (3,), on the platform.   force : (n,), of the stacks.
        """
        wrenches = self.necks @ np.concatenate([load, force])
        return np.array(at_necks(stage_frames(self.stage), wrenches[..., None]))[..., 0]

    def stress(
        self,
        load: Array,
        force: Array,
    ) -> Array:
        """Return the largest von Mises stress (3 chains, 3 hinges) of every notch, MPa.

        load : (3,), on the platform.   force : (n,), of the stacks.
        """
        sections = sections_of(design_arrays(self.stage))[:, 0]
        return np.asarray(np.max(stress_along(sections, self.carried(load, force)), axis=-1))

    def rotations(
        self,
        motion: Motion,
        load: Array,
    ) -> Array:
        """Return the rotation (3 chains, 3 hinges) of every hinge relative to rest, rad."""
        return np.asarray(self.result.hinges.rotation * self.carried(load, motion.force)[0])


class DrivenElements(NamedTuple):
    """Finite elements of a driven stage.

    fields : displacements by unit loads.   across : as in `Commanding`.
    """

    stage: Stage
    mesh: PlaneMesh
    fields: Array
    system: DriveSystem
    across: Array

    def stress(
        self,
        load: Array,
        force: Array,
    ) -> Array:
        """As `Commanding.stress`."""
        field = np.tensordot(np.concatenate([load, force]), self.fields, axes=1)
        return neck_maxima(self.stage, self.mesh, plane_stress(self.stage, self.mesh, field))


def commanding(chosen: ModelChoice) -> Commanding:
    """Return the analytic model of a driven stage.

    Raises BadInput as `model.analyse`, and without actuators.
    """
    result = analyse(*chosen)
    drive = drive_of(chosen.stage)
    C, necks = driven_model(chosen.stage, result, _with_friction(drive))
    n = 3 + len(drive.stacks)
    return Commanding(
        chosen.stage, result, necks[..., :n], DriveSystem.of(C[:n, :n], drive), C[:n, n:]
    )


def driven_elements(stage: Stage, resolution: int) -> DrivenElements:
    """Return finite elements of a driven stage. Raises BadInput, ComputationFailed."""
    drive = drive_of(stage)
    mesh = build_mesh(stage, resolution)
    found = driven_response(mesh, plate_of(stage), _with_friction(drive))
    n = 3 + len(drive.stacks)
    C = found.compliance
    return DrivenElements(stage, mesh, found.nodal[:n], DriveSystem.of(C[:n, :n], drive), C[:n, n:])


def element_ranges(stage: Stage, mesh: PlaneMesh) -> DriveRanges:
    """Return the ranges of a drive, n = 1, by finite elements.

    The neck stress follows from their wrenches as in the analytic model.
    """
    drive = drive_of(stage).at(None)
    plate = plate_of(stage)
    found = driven_response(mesh, plate, drive.stacks)
    necks = neck_wrenches(mesh, plate, found.nodal)
    return drive_ranges(
        design_arrays(stage), DriveSystem.of(found.compliance[None], drive), necks[None]
    )


def push_spread(model: Commanding) -> Array:
    """Return the largest change (3,) of the engaged stiffness by the length of the contacts.

    The forces of the stacks act over half of their assumed length, or over twice of it.
    """
    drive = model.system.drive
    stiffness = []
    for factor in PLAUSIBLE:
        spread = tuple(stack.spread_over(factor) for stack in drive.stacks)  # limited to the links
        C = driven_model(model.stage, model.result, spread).compliance
        stiffness.append(DriveSystem.of(C, drive).stiffness)
    return np.asarray(np.max(np.abs(stiffness - model.system.stiffness), axis=0))


def _with_friction(drive: ActuatorSet) -> tuple[Stack, ...]:
    """Return the stacks of a drive, followed by tangential forces at its contacts with stated
    friction.
    """
    return (*drive.stacks, *(drive.stacks[k].across for k in drive.rubbing))


def half_widths_by_friction(
    system: DriveSystem,
    across: Array,
    force: Array,
) -> Array:
    """Return the half-widths (3,) of the poses possible with friction, mm, mm, rad.

    force : (n,), of all stacks, N.

    Notes
    -----
    A contact under the normal force N carries any tangential force f up to mu N before it slips.
    The possible poses are `U + sum_i h_i f_i`, `|f_i| <= mu_i N_i`, where `h = C_Ut - C_Ud Y C_dt`
    is the motion per newton along contact i with the other stacks holding their strokes; the
    half-width `sum |h_i| mu_i N_i` is reached if all are about to slip. N is the force without
    friction; a contact that would have to pull is open and carries no force."""
    drive = system.drive
    rubbing = list(drive.rubbing)
    per_force = across[:3] - system.C[:3, 3:] @ system.Y @ across[3:]
    tangential = drive.friction[rubbing] * np.maximum(force[rubbing], 0.0)
    return np.asarray(np.abs(per_force) @ tangential)


def calibration(
    elements: DriveSystem,
    model: DriveSystem,
    lever: float,
) -> Array:
    """Return the matrix (3, 3) from a pose of finite elements to the pose to be commanded.

    The model then computes the strokes, without load, by which finite elements have the pose.
    """
    return inverse(elements.poses @ model.unit_commands(lever))


class _Exceeded(NamedTuple):
    """A kind of limit: names of its members, how far each is exceeded, and their texts."""

    names: Sequence[str]
    excess: Array
    texts: Sequence[str]


def limit_warnings(
    system: DriveSystem,
    x: Array,
    load: Array,
    criterion: Criterion,
) -> list[str]:
    """Return a warning per kind of limit that commands (m,) exceed: the number exceeded, and the
    largest excess.
    """
    kinds = _exceeded(system, x, load)
    found = list[str]()
    for share, (kind, of) in zip(system.shares(x, load).values(), kinds.items(), strict=True):
        beyond = np.any(np.reshape(share > 1 + ROUND_OFF, (-1, len(of.names))), axis=0)
        if beyond.any():
            worst = int(np.argmax(np.where(beyond, of.excess, -np.inf)))
            found.append(
                f"{criterion}: {kind} beyond their limits: {np.count_nonzero(beyond)}, the worst "
                f"at {of.names[worst]}: {of.texts[worst]}"
            )
    return found


def _exceeded(
    system: DriveSystem,
    x: Array,
    load: Array,
) -> dict[str, _Exceeded]:
    """Return the kinds of limits in the order of `LIMITS`."""
    drive = system.drive
    stacks = stack_names(drive)
    um = 1e3 * x
    low = 1e3 * drive.lowest
    high = 1e3 * drive.highest
    strokes = [
        f"{stroke:.4g} um, outside {least:.4g} to {most:.4g} um"
        for stroke, least, most in zip(um, low, high, strict=True)
    ]
    force = drive.preload + system.moved(x, load).force
    blocking = drive.blocking_force
    pulls = [f"a pull of {-each:.4g} N" for each in force]
    forces = [
        f"{each:.4g} N, above {most:.4g} N" for each, most in zip(force, blocking, strict=True)
    ]
    return {
        "strokes": _Exceeded(drive.names, np.maximum(um - high, low - um), strokes),
        "contacts": _Exceeded(stacks, -force, pulls),
        "forces": _Exceeded(stacks, force - blocking, forces),
    }
