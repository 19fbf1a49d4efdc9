"""What is answered of one stage where nothing is stored: records of the table, the JSON and the Python API alike.

Every record has the file of the stage ("" for one made in Python) and its name, the `warnings` that the answer earns,
one plain sentence each, and key paths of numbers that are `assumed` or `not_stated`. Arrays are in N, mm and rad; order
x, y, theta.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.arrays import Array
from flexfem.hinges.formulas import FORMULAS, Compliance
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import Plane, of_stage
from flexfem.questions import warnings as warning

if TYPE_CHECKING:
    from flexfem.fem.fields import LoadCase
    from flexfem.fem.mesh import StageMesh
    from flexfem.verify.protocol import Solved

UNITS = "N, mm, rad; order x, y, theta"


class BandedStress(NamedTuple):
    """Finite elements of a resolution: stress (3 chains, 3 hinges, 3 directions) per displacement, MPa per mm and
    rad, and half-widths (3,) by meshes of the highest."""

    resolution: int
    stress: Array
    band: Array


class StiffnessReport(NamedTuple):
    """The analytic model at rest: stiffness and compliance (3, 3) of the platform, compliances of the hinges (3, 3).

    neck_stress : (3 chains, 3 hinges, 3 directions), largest von Mises stress per displacement, the others held: MPa
        per mm, mm, rad.   stress_accuracy : how far that is from finite elements, in words.
    elements : the stress by finite elements, with bands, None where they were not asked.
    """

    file: str
    name: str
    units: str
    model: Plane
    mobility: int
    links: bool
    formula: str
    formula_source: str
    formula_in_range: bool
    stiffness: Array
    compliance: Array
    hinge_compliance: Compliance
    neck_stress: Array
    stress_accuracy: str
    elements: BandedStress | None
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class MeshReport(NamedTuple):
    """A mesh and the file it was written to."""

    file: str
    name: str
    written: str
    resolution: int
    nodes: int
    triangles: int
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class LoadReport(NamedTuple):
    """Finite elements at rest and under one load (3,).

    stiffness, compliance : (3, 3), of the platform.   displacement : (3,), of the platform.   reaction : (3,), of the
    ground.   energy : N mm.   neck_stress : (3 chains, 3 hinges), largest von Mises stress, MPa.
    """

    file: str
    name: str
    units: str
    model: Plane
    resolution: int
    triangles: int
    unknowns: int
    stiffness: Array
    compliance: Array
    force: Array
    displacement: Array
    reaction: Array
    energy: float
    neck_stress: Array
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def report_stiffness(
    stage: Stage, result: AnalyticResult, elements: BandedStress | None = None, warnings: Sequence[str] = ()
) -> StiffnessReport:
    """An analytic model with what is to be known of it, `warnings` on its choice, and the neck stress by elements."""
    return StiffnessReport(
        **of_stage(stage),
        units=UNITS,
        model=result.plane,
        mobility=result.mobility,
        formula=result.formula,
        links=result.links,
        formula_source=FORMULAS[result.formula].source,
        formula_in_range=bool(np.all(result.in_range)),
        stiffness=result.stiffness,
        compliance=result.compliance,
        hinge_compliance=result.hinges,
        neck_stress=result.stress,
        stress_accuracy=warning.stress_accuracy(result.formula, result.links, result.plane),
        elements=elements,
        warnings=[*warnings, *warning.of_result(stage, result)],
    )


def report_mesh(stage: Stage, mesh: StageMesh, resolution: int, written: str) -> MeshReport:
    """A mesh of a stage, and where it was written."""
    return MeshReport(
        **of_stage(stage),
        written=written,
        resolution=resolution,
        nodes=len(mesh.nodes),
        triangles=len(mesh.triangles),
        warnings=warning.of_numbers(stage),
    )


def report_load(stage: Stage, solved: Solved, case: LoadCase, resolution: int) -> LoadReport:
    """Finite elements of a stage under one load, with what is to be known of that."""
    highest, where = float(np.max(case.neck_stress)), "under this load"
    doubts = warning.of_yield(highest, stage.material.yield_strength, where)
    return LoadReport(
        **of_stage(stage),
        units=f"{UNITS}; stress MPa",
        model=stage.model,
        resolution=resolution,
        triangles=solved.triangles,
        unknowns=solved.response.unknowns,
        stiffness=np.asarray(np.linalg.inv(solved.response.compliance)),
        compliance=solved.response.compliance,
        force=case.force,
        displacement=case.pose,
        reaction=case.reaction,
        energy=case.energy,
        neck_stress=case.neck_stress,
        warnings=[
            *warning.of_numbers(stage),
            *warning.of_thickness(stage),
            *doubts,
            *warning.of_motion(stage, case.pose, where),
        ],
    )
