"""Imposed joints: finite elements driven by the rotations or strokes that a model computes for a
pose.

The model converts the commanded pose into rotations of its independent hinges, or into strokes of
the stage's stacks, by minimum energy (29), (30). The platform is free of load, so an error of the
model's stiffness has no effect; only the motion of the finite elements with held joints counts.
`hinge_couples` defines the rotation of a hinge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, inverse
from flexfem.fem.response import Response
from flexfem.files.tables import memoized
from flexfem.paper.case import Case, Drive
from flexfem.paper.contacts import hinge_couples
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.fields import driven_response
from flexfem.paper.model import AnalyticResult
from flexfem.paper.responses import driven_model
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.questions.bands import Convergence, command_convergence, error_matrix, levels
from flexfem.questions.driven import DriveSystem
from flexfem.units import DIRECTIONS

# of the largest rotational compliance: below it a model of fewer freedoms excludes the rotation
RIGID = 1e-12


class Imposed(NamedTuple):
    """Rotations of hinges, or strokes of the drive, that a model computed for commanded poses.

    drive : of the stage, or one that holds the hinges.   per_command : (m, 3), rad or mm, per
    command in mm and rad.
    model : the driven stage of the model; None if hinge rotations are imposed.
    """

    drive: ActuatorSet
    per_command: Array
    model: DriveSystem | None

    def on(self, compliance: Array) -> DriveSystem:
        """The same drive with another compliance (3 + n, 3 + n), as of finite elements."""
        return DriveSystem.of(compliance, self.drive)

    def poses(self, compliance: Array) -> Array:
        """Pose (3, 3) with another compliance, column j for a unit command in direction j."""
        return np.asarray(self.on(compliance).poses @ self.per_command)


def commanded_hinges(mobility: int) -> tuple[int, ...]:
    """Return the positions of the hinges whose rotations are commanded, the independent joints of
    the paper.
    """
    return (0,) if mobility == 3 else (0, 1)


def imposed(
    stage: Stage,
    model: AnalyticResult,
    inputs: Drive,
) -> Imposed:
    """Return the joint motions of an analytic model per command. Raises BadInput for strokes
    without actuators.

    Rotations a: min a' C_dd^-1 a with C_Ud C_dd^-1 a = u, so a = C_dU (C_Ud C_dd^-1 C_dU)^-1 u. If
    these rotations determine the whole model, as with mobility three and six, this is (29), (30).
    """
    if inputs == "joints":
        couples = hinge_couples(stage, commanded_hinges(model.mobility))
        C = driven_model(stage, model, tuple(couples.values())).compliance
        per_command = C[3:, :3] @ inverse(
            C[:3, 3:] @ np.linalg.pinv(C[3:, 3:], RIGID, hermitian=True) @ C[3:, :3]
        )
        endless = np.full(len(couples), np.inf)
        none = np.zeros(len(couples))
        limits = {
            "lowest": -endless,
            "highest": endless,
            "blocking_force": endless,
            "preload": none,
        }
        names = tuple(couples)
        rigid = np.eye(len(couples))
        drive = ActuatorSet(
            tuple(couples.values()), names, stiffness=endless, differential=rigid, **limits
        )
        return Imposed(drive, per_command, None)
    stacks = drive_of(stage)
    lever = stage.chain.link_lengths[2]
    driven = DriveSystem.of(driven_model(stage, model).compliance, stacks)
    return Imposed(stacks, driven.unit_commands(lever), driven)


@memoized
def elements(
    stage: Stage,
    resolution: int,
    hinges: tuple[int, ...],
) -> Response:
    """Return finite elements loaded at the platform and at the hinges of given positions, or at the
    stacks if none.

    Raises BadInput, ComputationFailed.
    """
    stacks = tuple(hinge_couples(stage, hinges).values()) if hinges else drive_of(stage).stacks
    return driven_response(build_mesh(stage, resolution), plate_of(stage), stacks)


def imposed_bands(
    joints: Imposed, compliances: Array, case: Case, lever: float
) -> tuple[Convergence, ...]:
    """Return the grid convergence of the percentages of a case; compliances (levels, 3 + n, 3 + n),
    coarse to fine.

    With the forces f = Y T x, an error dC of the compliance changes the pose by r' dC f to first
    order. The rows r = (1, -Y C_dU) are unit loads of the platform and the reactions of the drive,
    which holds its strokes."""
    axis = DIRECTIONS.index(case.direction)
    steps = np.array(levels(case.resolution))
    percents = np.array(
        [error_matrix(np.eye(3), joints.poses(C), lever)[:, axis] for C in compliances]
    )
    finest = joints.on(compliances[-1])
    force = np.concatenate([np.zeros(3), finest.per_command @ joints.per_command[:, axis]])
    readings = np.concatenate([np.eye(3), -finest.Y @ finest.C[3:, :3]])
    return command_convergence(steps, percents, axis, compliances, force, lever, readings)
