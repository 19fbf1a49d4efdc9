"""Why the curves differ: the error of the paper's model, split into named shares that add up to it.

From the paper's model to the finite elements in steps, each of which adds one thing; a share is what a step moves the
error by, so the shares telescope: their sum is the total, whatever they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from flexfem.analytic.inverse import inverse
from flexfem.analytic.links import body_compliance
from flexfem.analytic.mobility import freedoms_of
from flexfem.analytic.model import (
    DEFAULT_FORMULA,
    AnalyticResult,
    analyse,
    at_rest,
    hinge_compliances,
    on_thickness_chart,
)
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.response import load_case, plate_of
from flexfem.stage.designs import lower
from flexfem.stage.schema import Stage
from flexfem.verify import warning
from flexfem.verify.case import DIRECTIONS, Direction
from flexfem.verify.comparison import compare, percentages
from flexfem.verify.convergence import command_convergence, levels
from flexfem.verify.protocol import Solved, solve_stage
from flexfem.verify.result import Record, Triple, versions

CALIBRATED = "calibrated"
AMPLITUDES: dict[Direction, float] = {"x": 0.05, "y": 0.05, "theta": 1e-3}  # mm, mm, rad: assumed, as in cases/
SHARES = (
    "freedoms left out of the model",
    "hinge formula",
    "links, pads and platform as rigid",
    "what the chart and the links leave",
    "large displacement",
)


class Share(Record):
    """One share of an error, in percentage points: x, y, theta as error percentages are normalised."""

    name: str
    points: Triple


class Split(Record):
    """The shares of one command, their total, and the mesh band of the total in the commanded direction.

    amplitude : mm or rad, of the command at which the large-displacement share is taken.
    out_of_plane : outside the planar total: what hinges of three dimensions change, against the stage's own plane
        model; None when a hinge is not on the thickness chart.
    """

    amplitude: float
    shares: list[Share]
    total: Triple
    band: float
    out_of_plane: Triple | None


class Budget(Record):
    """The error budget of a stage's own analytic model; `split` by commanded direction."""

    stage: str
    file: str
    hash: str
    plane: str
    mobility: int
    formula: str
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    split: dict[Direction, Split]
    versions: dict[str, str]


def budget(
    path: Path,
    stage: Stage,
    amplitudes: dict[Direction, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    solve: Callable[[Stage, int], Solved] = solve_stage,
) -> Budget:
    """Split the error of the paper's model of a feasible stage, in all three directions.

    Raises BadInput when a hinge is not on the hinge chart, ComputationFailed.
    """
    paper = analyse(stage)
    ladder = [
        paper.compliance,
        analyse(stage, 21).compliance,
        analyse(stage, 21, CALIBRATED).compliance,
        analyse(stage, 21, CALIBRATED, links=True).compliance,
    ]
    thick = thick_compliance(stage)
    solved = [solve(stage, level) for level in levels(resolution)]
    return Budget(
        stage=stage.name,
        file=str(path),
        hash=stage.hash,
        plane=stage.model,
        mobility=paper.mobility,
        formula=DEFAULT_FORMULA,
        assumed=list(stage.assumed),
        not_stated=list(stage.not_stated),
        warnings=_warnings(stage, paper, solved[-1], amplitudes),
        split={
            direction: _split(
                stage, paper.stiffness, ladder, thick, solved, direction, amplitudes[direction], resolution
            )
            for direction in DIRECTIONS
        },
        versions=versions(),
    )


def _warnings(
    stage: Stage, paper: AnalyticResult, solved: Solved, amplitudes: dict[Direction, float]
) -> warning.Warnings:
    """Warnings on the stage's own model, and on its stresses at the three commands."""
    found = [*warning.of_formula(stage, paper.formula), *warning.of_model(stage, paper)]
    for axis, direction in enumerate(DIRECTIONS):
        force = paper.stiffness[:, axis] * amplitudes[direction]  # (18)
        highest = float(np.max(load_case(stage, solved.mesh, solved.response, force).neck_stress))
        found += warning.of_yield(highest, stage.material.yield_strength, f"command in {direction}")
    return found


def thick_compliance(stage: Stage) -> Array | None:
    """Platform compliance (3, 3) of calibrated hinges as three-dimensional bodies between elastic links.

    None when one is not on the thickness chart.
    """
    design = replace(lower(stage), plane="corrected")
    if not np.all(on_thickness_chart(design)):
        return None
    hinges, bodies = hinge_compliances(design, CALIBRATED), body_compliance(stage, design.plane)
    return inverse(at_rest(design, hinges, freedoms_of(21), bodies[None]).stiffness[0])


def _split(
    stage: Stage,
    stiffness: Array,
    ladder: list[Array],
    thick: Array | None,
    solved: list[Solved],
    direction: Direction,
    amplitude: float,
    resolution: int,
) -> Split:
    """The shares of one command: differences of the error from rung to rung."""
    lever, axis = stage.chain.link_lengths[2], DIRECTIONS.index(direction)
    command = np.array([-amplitude, amplitude])

    def percent(compliance: Array) -> Array:
        return compare(stiffness, compliance, direction, command, lever).percent

    compliances = np.array([each.response.compliance for each in solved])
    meshes, resolutions = np.array([percent(compliance) for compliance in compliances]), np.array(levels(resolution))
    found = command_convergence(resolutions, meshes, axis, compliances, stiffness[:, axis], lever)
    force = stiffness[:, axis] * amplitude  # (18)
    bent = equilibrium(solved[-1].mesh, plate_of(stage), force[None]).pose[0] - amplitude * np.eye(3)[axis]
    nonlinear = percentages(bent, amplitude, direction, lever)
    rungs = [percent(compliance) for compliance in ladder] + [np.array([each.extrapolated for each in found])]
    rungs.append(rungs[-1] + nonlinear - meshes[-1])  # on one mesh, so that its own error drops out
    shares = [
        Share(name=name, points=_triple(after - before))
        for name, (before, after) in zip(SHARES, pairwise(rungs), strict=True)
    ]
    return Split(
        amplitude=amplitude,
        shares=shares,
        total=_triple(rungs[-1] - rungs[0]),
        band=found[axis].band,
        out_of_plane=None if thick is None else _triple(percent(thick) - percent(ladder[-1])),
    )


def _triple(values: Array) -> Triple:
    return Triple(**dict(zip(DIRECTIONS, values.tolist(), strict=True)))
