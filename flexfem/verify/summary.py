"""One stage in one table: how far it may go in each direction, what that takes, and which hinge sets the limit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import analyse, best_model
from flexfem.arrays import Array, alone, first_highest
from flexfem.fem.fields import load_case
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import Plane
from flexfem.questions import warnings as warning
from flexfem.questions.bands import levels, stress_bands
from flexfem.units import DIRECTIONS, PLANES, Direction
from flexfem.verify.answers import BandedStress
from flexfem.verify.protocol import Solve, Solved
from flexfem.verify.result import Matrix, OfStage, Record, Triple, about


class Limits(NamedTuple):
    """What one model says: stiffness (3, 3), order x, y, theta, and the highest stress at each neck,
    (3 chains, 3 hinges, 3 directions), MPa per mm and rad of the platform, the other directions held."""

    stiffness: Array
    stress: Array


class SafeRange(Record):
    """One direction, the others held: how far until the first neck yields, mm or rad on either side of rest.

    force : there, N, N, N mm.   chain, hinge : the neck.   stress : there per displacement, MPa per mm or rad.
    """

    range_at_yield: float
    force: Triple
    chain: int
    hinge: str
    stress: float


class ModelSummary(Record):
    """One model's stiffness, its limits by direction, and `free`, (3,), stiffness with the other directions free."""

    model: str
    stiffness: Matrix
    free: list[float]
    limits: dict[Direction, SafeRange]


class Summary(OfStage):
    """What `flexfem summary` says of a stage: the analytic side, and that of finite elements where they were asked.

    material : source of every number of the material, by key path of the stage file.
    model, plane : how the analytic model and the finite elements make the stage a plane problem.
    thickness : per cent by which hinges in three dimensions make the platform stiffer than in `plane`; None
        where the thickness chart does not reach.
    """

    name: str
    model: Plane
    plane: Plane
    mobility: int
    yield_strength: float
    material: dict[str, str]
    analytic: ModelSummary
    elements: ModelSummary | None
    accuracy: str
    thickness: Triple | None


def summary(stage: Stage, formula: str | None = None, solved: Solved | None = None) -> Summary:
    """Summarise a feasible stage; `solved` adds finite elements.

    Parameters
    ----------
    formula : of the hinges; None takes that of `model.best_model`.

    Raises BadInput as `model.hinge_compliance` for a formula that was asked for, ComputationFailed.
    """
    warnings = list(warning.of_numbers(stage))
    chosen = best_model(stage, warnings, formula)
    warnings += warning.of_formula(stage, chosen.formula)
    result, thickness = analyse(*chosen), warning.stiffer_by_thickness(stage)
    analytic = _side(f"analytic, {chosen.name}", stage, Limits(result.stiffness, result.stress))
    for axis, (direction, limit) in enumerate(analytic.limits.items()):
        end = limit.range_at_yield * np.eye(3)[axis]
        warnings += warning.of_motion(stage, end, f"end of the safe range in {direction}")
    sources = stage.sources
    return Summary(
        **about(stage),
        name=stage.name,
        model=chosen.stage.model,
        plane=stage.model,
        mobility=stage.mobility,
        yield_strength=stage.material.yield_strength,
        material={key: sources[key] or "not stated" for key in stage.numbers if key.startswith("material")},
        analytic=analytic,
        elements=None
        if solved is None
        else _side(f"finite elements, {PLANES[stage.model]}", stage, element_limits(stage, solved)),
        accuracy=warning.stress_accuracy(chosen.formula, plane=chosen.stage.model),
        thickness=None if thickness is None else Triple.of(thickness),
        warnings=list(dict.fromkeys(warnings)),
    )


def element_limits(stage: Stage, solved: Solved) -> Limits:
    """Limits by finite elements in the plane."""
    stiffness = np.linalg.inv(solved.response.compliance)
    cases = [load_case(stage, solved.mesh, solved.response, force) for force in stiffness.T]
    return Limits(np.asarray(stiffness), np.stack([case.neck_stress for case in cases], axis=-1))


def banded_stress(stage: Stage, resolution: int, solve: Solve) -> BandedStress:
    """The neck stress per displacement by finite elements on three meshes."""
    steps = levels(resolution)
    found = np.array([element_limits(stage, solve(stage, step)).stress for step in steps])
    highest = np.max(found, axis=(1, 2))
    return BandedStress(resolution, found[-1], stress_bands(np.array(steps, dtype=float), highest))


def _side(name: str, stage: Stage, limits: Limits) -> ModelSummary:
    found: dict[Direction, SafeRange] = {}
    for axis, direction in enumerate(DIRECTIONS):
        stress = limits.stress[..., axis]
        chain, position = first_highest(stress)
        far = stage.material.yield_strength / float(np.max(stress))
        found[direction] = SafeRange(
            range_at_yield=far,
            force=Triple.of(limits.stiffness[:, axis] * far),
            chain=chain + 1,
            hinge=HINGE_NAMES[position],
            stress=float(np.max(stress)),
        )
    K = limits.stiffness
    return ModelSummary(model=name, stiffness=K.tolist(), free=alone(K).tolist(), limits=found)
