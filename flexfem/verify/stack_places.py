"""Every stack of a drive in its place, with its limits: what a figure of strokes and forces is drawn from."""

from __future__ import annotations

import numpy as np

from flexfem.mechanism.actuators import Body
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.mechanism.drives import contacts, drive_of
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.verify.result import Record


class StackPlace(Record):
    """A stack in its place, frame of the stage.

    chain : 1 to 3.   between : the body that carries it, and the one that it pushes.
    actuator : index of what commands it; the two stacks of a pair have the same.
    contact, push : (2,), mm, where it pushes, and the unit vector in which it pushes the second body.
    lowest, highest : mm, of its stroke beyond rest.   preload, blocking_force : N.
    """

    chain: int
    between: tuple[Body, Body]
    actuator: int
    contact: tuple[float, float]
    push: tuple[float, float]
    lowest: float
    highest: float
    preload: float
    blocking_force: float


def stack_places(stage: Stage) -> list[StackPlace]:
    """The stacks (n) of a stage in the order of `StageDrive`. Raises BadInput for a stage without actuators."""
    drive, found = drive_of(stage), list[StackPlace]()
    placed = [(chain, each) for chain in CHAINS for each in range(len(stage.actuator))]
    for command, (chain, index) in enumerate(placed):
        turn = np.exp(1j * (chain - 1) * CHAIN_TURN)
        for point, direction in contacts(stage, chain, index):
            k = len(found)
            at, push = turn * point, turn * np.exp(1j * direction)
            limits = drive.differential[k, command] * np.array([drive.lowest[command], drive.highest[command]])
            found.append(
                StackPlace(
                    chain=chain,
                    between=stage.actuator[index].between,
                    actuator=command,
                    contact=(float(at.real), float(at.imag)),
                    push=(float(push.real), float(push.imag)),
                    lowest=float(np.min(limits)),
                    highest=float(np.max(limits)),
                    preload=float(drive.preload[k]),
                    blocking_force=float(drive.blocking_force[k]),
                )
            )
    return found
