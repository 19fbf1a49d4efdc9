"""What else could have produced the paper's error curves: other models, other finite elements, other stages.

Each alternative is put in the place of the model or of the metal in the comparison of Section V, and its errors are
measured on the same two stages. That one of them looks like the paper's curves does not show that it was their cause.
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import DEFAULT_FORMULA, analyse
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.files.writing import markdown_table
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import error_matrix
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.other_elements import other_elements
from flexfem.verify.other_stages import (
    driven_joints,
    joint_command,
    loaded,
    off_centre,
    other_formulas,
    other_necks,
    with_necks,
)
from flexfem.verify.protocol import Solve
from flexfem.verify.result import Record, Triple
from flexfem.verify.solid_budget import other_thickness

STUBBY = (3.0, 1.0)  # R/t of all nine hinges
INFERENCE = (
    "Measured: the numbers. Inference: that any of these was at work in the paper. Its meshes, elements, dimensions and"
    " curves are not available, so an alternative that resembles its statements is a possible cause and no more."
)


class Alternative(Record):
    """Errors of one alternative, per cent.

    mobility : of the model.   along : error in the commanded direction for commands in x, y, theta.
    across : largest magnitude in the two other directions for each of them.
    """

    name: str
    mobility: int
    along: Triple
    across: Triple


def alternatives(three: Stage, six: Stage, solve: Solve) -> list[Alternative]:
    """Every alternative for the stages modelled with mobility three and six. Raises BadInput, ComputationFailed."""
    found = [row for stage, mobility in ((three, 3), (six, 6)) for row in _of_stage(stage, mobility, solve)]
    metal = {stage: solve(stage, RESOLUTION).response.compliance for stage in (three, six)}
    lever = six.chain.link_lengths[2]
    without = error_matrix(analyse(six, 3).stiffness, metal[six], lever)
    found.append(_row("axial freedom left out, on the mobility-six stage", 3, without))
    for own, mobility, other, name in ((three, 3, six, "six"), (six, 6, three, "three")):
        percent = error_matrix(analyse(own, mobility).stiffness, metal[other], other.chain.link_lengths[2])
        found.append(_row(f"stiffness of its own stage on the metal of the mobility-{name} stage", mobility, percent))
    for ratio in STUBBY:
        stage = with_necks(six, ratio)
        real = analyse(stage, 21).compliance
        for mobility in (3, 6):
            name = f"R/t = {ratio:g} in the mobility-six stage, all freedoms as metal"
            found.append(_row(name, mobility, error_matrix(analyse(stage, mobility).stiffness, real, lever)))
            found.append(_row(f"{name}, joints commanded", mobility, joint_command(stage, mobility, DEFAULT_FORMULA)))
    return found


def _of_stage(stage: Stage, mobility: int, solve: Solve) -> list[Alternative]:
    """The alternatives that take one of the two stages."""
    K, lever = analyse(stage, mobility).stiffness, stage.chain.link_lengths[2]
    metal = solve(stage, RESOLUTION).response.compliance
    metals = other_elements(stage, solve) | other_thickness(stage, metal)
    percent = {name: error_matrix(K, C, lever) for name, C in metals.items()}
    percent |= other_formulas(stage, mobility, metal) | other_necks(stage, mobility, solve)
    percent |= off_centre(stage, mobility, metal) | loaded(stage, mobility, metal) | driven_joints(stage, mobility)
    return [_row(name, mobility, each) for name, each in percent.items()]


def _row(name: str, mobility: int, percent: Array) -> Alternative:
    """`percent` (3, 3), column j for command j."""
    across = np.max(np.abs(percent - np.diag(np.diag(percent))), axis=0)
    return Alternative(name=name, mobility=mobility, along=Triple.of(np.diag(percent)), across=Triple.of(across))


def markdown_alternatives(found: list[Alternative]) -> str:
    """The alternatives as a Markdown table, per cent: along the command, and the largest across it."""
    head = ("alternative", "model", "X along", "across", "Y along", "across", "theta along", "across")
    rows = [
        (
            each.name,
            f"{each.mobility}",
            *(f"{getattr(p, axis):.3f}" for axis in DIRECTIONS for p in (each.along, each.across)),
        )
        for each in found
    ]
    return f"{markdown_table(head, rows, 'lrrrrrrr')}\n\n{INFERENCE}\n"
