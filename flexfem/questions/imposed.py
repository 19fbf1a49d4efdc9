"""Joints imposed: the rotations or strokes that a model computes for a pose, given to finite elements.

The model turns the commanded pose into rotations of the hinges that it calls independent, or into strokes of the
stage's stacks, by least energy (29), (30). No force is on the platform: a wrong stiffness of the model is not seen,
only what else the finite elements do while their joints are held. `couples` says what the rotation of a hinge is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.responses import driven_model
from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import DrivenResponse, driven_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.contacts import Stack, couple_names, hinge_couples
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import Convergence, command_convergence, error_matrix, levels
from flexfem.questions.case import Case, Drive
from flexfem.questions.driven import Driven, driven, held, unit_commands
from flexfem.units import DIRECTIONS

RIGID = 1e-12  # of the largest rotational compliance: rotations that a model of fewer freedoms does not allow


class Imposed(NamedTuple):
    """What a model computed for the pose: rotations of hinges, or strokes of the drive.

    stacks : conjugate to them.   per_command : (m, 3), per command in x, y, theta: rad or mm, per mm and rad.
    model, drive : the driven stage as the model sees it, and its stacks; None where hinges are turned.
    """

    stacks: tuple[Stack, ...]
    names: tuple[str, ...]
    per_command: Array
    model: Driven | None
    drive: StageDrive | None

    def on(self, compliance: Array) -> Driven:
        """The same drive on another compliance (3 + n, 3 + n), as of finite elements."""
        return held(compliance) if self.drive is None else driven(compliance, self.drive)

    def poses(self, compliance: Array) -> Array:
        """Pose (3, 3) that a compliance takes, column j for a unit command in direction j."""
        return np.asarray(self.on(compliance).poses @ self.per_command)


class ImposedElements(NamedTuple):
    """Finite elements under unit loads of platform and stacks, on their mesh."""

    mesh: StageMesh
    response: DrivenResponse


def turned_hinges(mobility: int) -> tuple[int, ...]:
    """Positions of the hinges whose rotations are commanded: the independent joints of the paper."""
    return (0,) if mobility == 3 else (0, 1)


def imposed(stage: Stage, model: AnalyticResult, drive: Drive) -> Imposed:
    """What an analytic model has its hinges or stacks do. Raises BadInput for strokes without actuators.

    Rotations a: min a' C_dd^-1 a with C_Ud C_dd^-1 a = u, so a = C_dU (C_Ud C_dd^-1 C_dU)^-1 u. Where these rotations
    fix all of the model, as with mobility three and six, that is (29), (30).
    """
    if drive == "joints":
        positions = turned_hinges(model.mobility)
        couples = hinge_couples(stage, positions)
        C = driven_model(stage, model, couples).compliance
        given = C[3:, :3] @ inverse(C[:3, 3:] @ np.linalg.pinv(C[3:, 3:], RIGID, hermitian=True) @ C[3:, :3])
        return Imposed(couples, couple_names(positions), given, None, None)
    stacks, lever = drive_of(stage), stage.chain.link_lengths[2]
    seen = driven(driven_model(stage, model).compliance, stacks)
    return Imposed(stacks.stacks, stacks.names, unit_commands(seen, stacks, lever), seen, stacks)


@once
def elements(stage: Stage, resolution: int, turned: tuple[int, ...]) -> ImposedElements:
    """Finite elements with hinges at positions, or where there are none the stacks, as further loads.

    Raises BadInput, ComputationFailed.
    """
    plate, mesh = plate_of(stage), build_mesh(stage, resolution)
    stacks = hinge_couples(stage, turned) if turned else drive_of(stage).stacks
    return ImposedElements(mesh, driven_response(mesh, plate, stacks))


def imposed_bands(given: Imposed, compliances: Array, case: Case, lever: float) -> tuple[Convergence, ...]:
    """Grid convergence of the percentages of a case on meshes (levels, 3 + n, 3 + n), coarse to fine.

    With the forces f = Y T x an error dC of the compliance moves the pose by r' dC f to first order, where the
    readings r = (1, -Y C_dU) are the loads of the platform with the drive holding its strokes.
    """
    axis, steps = DIRECTIONS.index(case.direction), np.array(levels(case.resolution))
    percents = np.array([error_matrix(np.eye(3), given.poses(C), lever)[:, axis] for C in compliances])
    seen = given.on(compliances[-1])
    force = np.concatenate([np.zeros(3), seen.Y @ seen.T @ given.per_command[:, axis]])
    readings = np.concatenate([np.eye(3), -seen.Y @ seen.C[3:, :3]])
    return command_convergence(steps, percents, axis, compliances, force, lever, readings)
