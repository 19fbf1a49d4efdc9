"""Our answer and another solver's, on the same mesh: how far apart, and whether that is too far."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION, StageMesh
from flexfem.fem.plane_stress import nodal_stress, von_mises
from flexfem.fem.response import Response, neck_maxima, plate_of, platform_response
from flexfem.fem.sectors import build_mesh
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import of_stage
from flexfem.refused import BadInput
from flexfem.validate import calculix, frequencies, ngsolve
from flexfem.validate.calculix import DIGITS
from flexfem.validate.frequencies import FULL
from flexfem.validate.records import Answer, Check

NGSOLVE = 1e-8  # measured with two triangles across a neck: pose 1e-12, displacement 6e-12, stress 2e-10
STRESS_DIGITS = 2e-5  # half the last of its six is up to 5e-6 of each component; measured 1.1e-5
DIFFERENCED = 1e-3  # stress of printed displacements, whose digits cancel within a triangle; measured 5e-4
THIN_PARTS = 50.0  # of the narrowest neck make the thickness of the thin sheet
THIN = 2e-5  # of its pose, on the default mesh; measured 1.4e-5
THIN_STRESS = 1e-3  # its necks feel the thickness more than the stage does; measured 3e-4


class CrossCheck(NamedTuple):
    """Our answer on a stage, of a `file` ("" without one), and another solver's; N, mm, rad in x, y, theta.

    assumed, not_stated : key paths of numbers that are assumed, and of those whose source is not stated.
    triangles, unknowns : of the mesh and of our equations.
    compliance, their_compliance : (3, 3), of the platform, mm and rad per N and N mm; CalculiX's of the thin sheet,
        scaled.
    frequencies, their_frequencies : (k,), Hz, the lowest six in the plane, and in three dimensions the lowest six out
        of it, as `kinds` say; ours with their quadrature and their hub.
    seconds : assembly, solution and balances as `flexfem solve` does them.
    their_seconds : from the mesh to their fields, all of their runs.
    """

    file: str
    name: str
    units: str
    solver: str
    version: str
    triangles: int
    unknowns: int
    compliance: Array
    their_compliance: Array
    kinds: tuple[str, ...]
    frequencies: Array
    their_frequencies: Array
    checks: tuple[Check, ...]
    seconds: float
    their_seconds: float
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]

    @property
    def passed(self) -> bool:
        """Every check that has a limit keeps it."""
        return all(check.passed for check in self.checks)


class SharedMesh(NamedTuple):
    """What both solve."""

    stage: Stage
    mesh: StageMesh
    resolution: int


class Compared(NamedTuple):
    """What another solver was compared by: our answer, theirs, the checks, and the seconds of all their runs."""

    ours: Response
    theirs: Answer
    checks: tuple[Check, ...]
    seconds: float


def about(stage: Stage, solver: str) -> dict[str, Any]:
    """What every comparison says of its stage."""
    return of_stage(stage) | {"units": "N, mm, rad; order x, y, theta; Hz", "solver": solver, "warnings": []}


def cross_check(stage: Stage, resolution: int = RESOLUTION, solver: str = "ngsolve") -> CrossCheck:
    """Solve a feasible stage here and by another solver of `SOLVERS`, on one mesh, and compare.

    Raises BadInput for an unknown solver, for one that is not installed and for a stage not plane, ComputationFailed.
    """
    if solver not in list(SOLVERS):
        raise BadInput(f"solver {solver!r}, expected one of {', '.join(SOLVERS)}")
    require, compare = SOLVERS[solver]
    require()
    plate = plate_of(stage)
    problem = SharedMesh(stage, build_mesh(stage, resolution), resolution)
    started = time.perf_counter()
    shipped = platform_response(problem.mesh, plate)
    seconds = time.perf_counter() - started
    found, (both, checks) = compare(problem, shipped), frequencies.compared(stage, problem.mesh, solver)
    return CrossCheck(
        **about(stage, solver),
        version=found.theirs.version,
        triangles=len(problem.mesh.triangles),
        unknowns=shipped.unknowns,
        compliance=found.ours.compliance,
        their_compliance=found.theirs.compliance,
        kinds=("in plane",) * frequencies.COUNT,
        frequencies=both.ours,
        their_frequencies=both.theirs,
        checks=(*found.checks, *checks),
        seconds=seconds,
        their_seconds=found.seconds + both.seconds,
    )


def pose_difference(ours: Array, theirs: Array, lever: float) -> float:
    """Largest difference of two compliances (3, 3), rotations by the lever l3, mm, over the largest of ours."""
    scale = np.outer([1.0, 1.0, lever], [1.0, 1.0, lever])
    return float(np.max(np.abs(theirs - ours) * scale) / np.max(np.abs(ours) * scale))


def field_difference(ours: Array, theirs: Array) -> float:
    """Largest difference of two displacements (3, n, 2), mm, each load's over its largest."""
    return float(np.max(np.max(np.abs(theirs - ours), axis=(1, 2)) / np.max(np.abs(ours), axis=(1, 2))))


def neck_difference(ours: Array, theirs: Array) -> float:
    """Largest difference of two sets (3 loads, 3 chains, 3 hinges) of neck stresses, each load's over its largest."""
    return float(np.max(np.max(np.abs(theirs - ours), axis=(1, 2)) / np.max(ours, axis=(1, 2))))


def neck_stress(problem: SharedMesh, fields: Array) -> Array:
    """Largest von Mises stress (3 loads, 3 chains, 3 hinges), MPa, in the notches, of displacements (3, n, 2), mm."""
    plate = plate_of(problem.stage)
    return largest(problem, [nodal_stress(problem.mesh, plate, field) for field in fields])


def largest(problem: SharedMesh, stress: Iterable[Array]) -> Array:
    """Largest von Mises stress (loads, 3 chains, 3 hinges), MPa, in the notches, of nodal stresses (n, 3), MPa."""
    return np.array([neck_maxima(problem.stage, problem.mesh, von_mises(nodal)) for nodal in stress])


def thin_tolerance(resolution: int) -> float:
    """Most allowed of the thin sheet's pose: what comes from W being continuous falls faster than h^2."""
    return THIN * max(1.0, (RESOLUTION / resolution) ** 2)


def _pose_and_field(problem: SharedMesh, ours: Response, theirs: Answer, what: str, allowed: float) -> list[Check]:
    lever = problem.stage.chain.link_lengths[2]
    return [
        Check(f"pose{what}", pose_difference(ours.compliance, theirs.compliance, lever), allowed),
        Check(f"displacement{what}", field_difference(ours.fields, theirs.fields), allowed),
    ]


def _ngsolve(problem: SharedMesh, shipped: Response) -> Compared:
    plate = plate_of(problem.stage)
    ours, theirs = platform_response(problem.mesh, plate, FULL), ngsolve.solve(problem.mesh, plate)
    stress = neck_stress(problem, ours.fields)
    quadrature = pose_difference(theirs.compliance, shipped.compliance, problem.stage.chain.link_lengths[2])
    again = neck_difference(stress, neck_stress(problem, theirs.fields))
    checks = (
        *_pose_and_field(problem, ours, theirs, "", NGSOLVE),
        Check("neck stress, from its displacements", again, NGSOLVE),
        Check("neck stress, its own", neck_difference(stress, largest(problem, theirs.stress)), NGSOLVE),
        Check("pose, ours by default quadrature", quadrature, None),
    )
    return Compared(ours, theirs, checks, theirs.seconds)


def _calculix(problem: SharedMesh, shipped: Response) -> Compared:
    plate = plate_of(problem.stage)
    ours = platform_response(problem.mesh, plate, calculix.INTEGRATION)
    own = largest(problem, [calculix.extrapolated_stress(problem.mesh, plate, field) for field in ours.fields])
    stress, seconds = neck_stress(problem, ours.fields), 0.0
    checks: list[Check] = []
    thin = float(problem.stage.array("neck").min()) / THIN_PARTS
    for what, thickness, uncoupled, pose, stresses in (
        (", uncoupled sheet", plate.thickness, True, DIGITS, STRESS_DIGITS),
        (", thin sheet", min(thin, plate.thickness), False, thin_tolerance(problem.resolution), THIN_STRESS),
    ):
        theirs = calculix.solve(problem.mesh, plate, thickness, uncoupled)
        again = neck_difference(stress, neck_stress(problem, theirs.fields))
        checks += [
            *_pose_and_field(problem, ours, theirs, what, pose),
            Check(f"neck stress, from its displacements{what}", again, DIFFERENCED + stresses),
            Check(f"neck stress, its own{what}", neck_difference(own, largest(problem, theirs.stress)), stresses),
        ]
        seconds += theirs.seconds
    return Compared(ours, theirs, tuple(checks), seconds)


SOLVERS: dict[str, tuple[Callable[[], object], Callable[[SharedMesh, Response], Compared]]] = {
    "ngsolve": (ngsolve.import_ngsolve, _ngsolve),
    "calculix": (calculix.find_program, _calculix),
}
