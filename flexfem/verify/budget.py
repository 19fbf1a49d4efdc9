"""Why the curves differ: the error of the paper's model, split into named shares that add up to it.

From the paper's model to the finite elements in steps, each of which adds one thing; a share is what a step moves the
error by, so the shares telescope: their sum is the total, whatever they are.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import (
    CALIBRATED,
    DEFAULT_FORMULA,
    analyse,
    at_rest,
    hinge_compliances,
    on_thickness_chart,
)
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.structure import plate_of
from flexfem.mechanism.designs import lower
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import command_errors, error_matrix, levels, percentages
from flexfem.verify.case import DIRECTIONS, Direction
from flexfem.verify.protocol import Solve, Solved, command_warnings, solve_stage
from flexfem.verify.result import OfStage, Record, Triple, about

AMPLITUDES: dict[Direction, float] = {"x": 0.05, "y": 0.05, "theta": 1e-3}  # mm, mm, rad: assumed, as in cases/
SHARES = (
    "freedoms left out of the model",
    "hinge formula",
    "links, pads and platform as rigid",
    "what the chart and the links leave",
    "large displacement",
)


class BudgetShare(Record):
    """One share of an error, in percentage points: x, y, theta as error percentages are normalised."""

    name: str
    points: Triple


class Split(Record):
    """The shares of one command, their total, and the mesh band of the total in the commanded direction.

    amplitude : mm or rad, of the command at which the large-displacement share is taken.
    out_of_plane : outside the planar total: what charted single hinges of three dimensions change, against the stage's
        own plane model; None when a hinge is not on the thickness chart.
    """

    amplitude: float
    shares: list[BudgetShare]
    total: Triple
    band: float
    out_of_plane: Triple | None


class ThreeDimensional(Record):
    """What three dimensions change, measured on the stage (`solid_budget.measured`), in percentage points.

    points : by commanded direction, against the stage's own plane model.   band : of these in that direction.
    """

    resolution: int
    layers: int
    unknowns: int
    points: dict[Direction, Triple]
    band: dict[Direction, float]


class Budget(OfStage):
    """The error budget of a stage's own analytic model; `split` by commanded direction.

    three_dimensional : outside the planar total; None where it was not asked.
    """

    stage: str
    plane: str
    mobility: int
    formula: str
    split: dict[Direction, Split]
    three_dimensional: ThreeDimensional | None = None


def budget(
    stage: Stage,
    amplitudes: dict[Direction, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    solve: Solve = solve_stage,
) -> Budget:
    """Split the error of the paper's model of a feasible stage, in all three directions.

    Raises BadInput when a hinge is not on the hinge chart, ComputationFailed.
    """
    paper = analyse(stage)
    models = [paper, *(analyse(stage, 21, *more) for more in ((), (CALIBRATED,), (CALIBRATED, True)))]
    solved = [solve(stage, level) for level in levels(resolution)]
    steps = _Steps(
        stage,
        paper.stiffness,
        [model.compliance for model in models],
        thick_compliance(stage),
        np.array(levels(resolution)),
        np.array([each.response.compliance for each in solved]),
        solved[-1],
    )
    forces = paper.stiffness.T * [[amplitudes[direction]] for direction in DIRECTIONS]  # (18)
    return Budget(
        **about(stage),
        stage=stage.name,
        plane=stage.model,
        mobility=paper.mobility,
        formula=DEFAULT_FORMULA,
        warnings=command_warnings(stage, paper, solved[-1], forces, "command"),
        split={direction: _split(steps, direction, amplitudes[direction]) for direction in DIRECTIONS},
    )


def thick_compliance(stage: Stage) -> Array | None:
    """Platform compliance (3, 3) of calibrated hinges as three-dimensional bodies between elastic links.

    None when one is not on the thickness chart.
    """
    design = replace(lower(stage), plane="corrected")
    if not np.all(on_thickness_chart(design)):
        return None
    hinges, bodies = hinge_compliances(design, CALIBRATED), body_compliance(stage, design.plane)
    return inverse(at_rest(design, hinges, freedoms_of(21), bodies[None]).stiffness[0])


class _Steps(NamedTuple):
    """What the shares of every command are taken from.

    stiffness : (3, 3), of the paper's model.   ladder : compliances (3, 3) from that model to elastic links.
    thick : (3, 3), of `thick_compliance`.   compliances : (levels, 3, 3), of finite elements on `resolutions`.
    """

    stage: Stage
    stiffness: Array
    ladder: list[Array]
    thick: Array | None
    resolutions: Array
    compliances: Array
    finest: Solved

    def percent(self, direction: Direction, compliance: Array) -> Array:
        """Error percentages (3,) of one command on a compliance (3, 3)."""
        lever, axis = self.stage.chain.link_lengths[2], DIRECTIONS.index(direction)
        return np.asarray(error_matrix(self.stiffness, compliance, lever)[:, axis])


def _split(steps: _Steps, direction: Direction, amplitude: float) -> Split:
    """The shares of one command: differences of the error from rung to rung."""
    axis, lever = DIRECTIONS.index(direction), steps.stage.chain.link_lengths[2]
    found = command_errors(steps.resolutions, steps.compliances, steps.stiffness, direction, lever)
    rungs = [steps.percent(direction, each) for each in steps.ladder]
    rungs.append(np.array([each.extrapolated for each in found]))
    on_mesh = np.array([each.values[-1] for each in found])
    rungs.append(rungs[-1] + _bent(steps, direction, amplitude) - on_mesh)  # on one mesh: its own error drops out
    shares = [
        BudgetShare(name=name, points=Triple.of(after - before))
        for name, (before, after) in zip(SHARES, pairwise(rungs), strict=True)
    ]
    thick = None if steps.thick is None else steps.percent(direction, steps.thick) - rungs[len(steps.ladder) - 1]
    return Split(
        amplitude=amplitude,
        shares=shares,
        total=Triple.of(rungs[-1] - rungs[0]),
        band=found[axis].band,
        out_of_plane=None if thick is None else Triple.of(thick),
    )


def _bent(steps: _Steps, direction: Direction, amplitude: float) -> Array:
    """Error percentages (3,) of nonlinear finite elements on the finest mesh under the force of (18)."""
    command = amplitude * np.eye(3)[DIRECTIONS.index(direction)]
    pose = equilibrium(steps.finest.mesh, plate_of(steps.stage), (steps.stiffness @ command)[None]).pose[0]
    return percentages(pose - command, amplitude, direction, steps.stage.chain.link_lengths[2])
