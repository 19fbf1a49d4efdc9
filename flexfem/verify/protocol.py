"""Plane finite elements of a stage, as questions that are not moved yet take them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.arrays import Array
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import StageMesh, mesh_sectors
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.units import DIRECTIONS


class Solved(NamedTuple):
    """The finite-element answer of one stage; mesh and fields of the whole stage are made on demand."""

    response: Response

    @property
    def mesh(self) -> StageMesh:
        """The whole stage."""
        return self.response.mesh

    @property
    def triangles(self) -> int:
        """Number of triangles of the whole stage."""
        return self.response.triangles


Solve: TypeAlias = Callable[[Stage, int], Solved]  # `solve_stage`, or what keeps its answers


def solve_stage(stage: Stage, resolution: int) -> Solved:
    """Mesh and solve a feasible stage. Raises BadInput for one whose model is not plane, ComputationFailed."""
    check_feasible(stage)
    plate = plate_of(stage)
    return Solved(unit_response(mesh_sectors(stage, resolution), plate))


def command_warnings(
    stage: Stage, model: AnalyticResult, solved: Solved, forces: Array, where: str
) -> warning.Warnings:
    """Warnings on a model, and on the highest neck stress under the forces (3, 3) of three commands, row by row."""
    found = warning.of_result(stage, model)
    for direction, force in zip(DIRECTIONS, forces, strict=True):
        highest = float(np.max(load_case(stage, solved.mesh, solved.response, force).neck_stress))
        found += warning.of_yield(highest, stage.material.yield_strength, f"{where} in {direction}")
    return found
