"""The poses that a driven stage reaches within all its limits: strokes, contacts without tension,
blocking forces and yield.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.paper import warnings as warning
from flexfem.paper.answers import about_driven, chosen, mesh_of
from flexfem.paper.commanding import Commanding, commanding, driven_elements
from flexfem.paper.designs import design_arrays
from flexfem.paper.drive import LARGEST_LOAD
from flexfem.paper.driven import StageLimits, command_limits
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.polytope import Polytope, polytope_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import setup
from flexfem.questions.driven import SINGULAR, DriveSystem
from flexfem.questions.poses import KINDS, NothingAllowed, PoseSet, Stops
from flexfem.questions.setup import DEFAULT, Analytic
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, NEW_MESH, SOLVED, Quantity, Result
from flexfem.units import STRESS

# poses that are not solid, by dimension
EXTENDS = ("are a single pose", "lie on a line", "lie in a plane")


class StageReach(Result):
    """The poses that a drive reaches within its limits: ranges along the axes, and all poses."""

    kind_name = "reach"
    title = "poses that the drive reaches within all limits"
    main_result = ("ends", {"others": "zero"})
    labels: ClassVar = {"others": ("zero", "free"), "end": ("low", "high")}
    figure = "paper.figures.reach.reach_figure"
    drawn_from_fields = True
    footnotes: ClassVar[tuple[str, ...]] = (
        "limits: stroke, contacts without tension, blocking force, and yield of the necks by the "
        "linear analytic model",
    )
    load = Quantity("load on the platform", "wrench", ("direction",), shown=False)
    ends = Quantity(
        "ends of the motion by the actuators, other directions zero or free",
        "motion",
        ("others", "end", "model", "direction"),
        NEW_MESH,
        "pose",
    )
    rest = Quantity("pose at zero commands", "motion", ("direction",), SOLVED, "pose")
    circle = Quantity("radius of the largest circle about rest at theta 0", "um", (), SOLVED)
    ball = Quantity("radius of the largest ball about rest, theta times lever", "um", (), SOLVED)
    volume = Quantity("volume of all poses", "um2_mrad", (), SOLVED)
    vertices = Quantity(
        "vertices of all poses",
        "motion",
        ("vertex", "direction"),
        SOLVED,
        "all",
        shown=False,
    )
    commands = Quantity(
        "actuator strokes at the vertices",
        "um",
        ("vertex", "actuator"),
        SOLVED,
        "all",
        shown=False,
    )


def reach(
    stage: Stage,
    *,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
) -> StageReach:
    """Return the poses that the drive of a stage reaches. Raises BadInput, ComputationFailed."""
    mesh = mesh_of(stage, models, resolution, least=2)
    F = arguments.vectors("load", load, 1, LARGEST_LOAD)
    drive = drive_of(stage)
    warnings = list(warning.of_stage(stage))
    commanded = commanding(chosen(stage, analytic, warnings))
    poses = pose_set(commanded, commanded.system, F)
    try:
        solid = polytope_of(poses, stage.lever)
    except NothingAllowed:
        raise ComputationFailed(_why_unreachable(commanded, poses, F)) from None
    ends, stops, _ = poses.ranges()
    found = {ANALYTIC: setup.ModelAnswer({"ends": ends})}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution).system
        of_elements = pose_set(commanded, elements, F).ranges().ends
        found[ELEMENTS] = setup.ModelAnswer({"ends": of_elements})
    warnings += _warnings(commanded, drive, solid)
    farthest = np.max(np.abs(ends[1]), axis=0)
    warnings += warning.of_motion(stage, farthest, "the farthest poses of the drive")
    vertices = [f"{k + 1}" for k in range(len(solid.vertices))]
    return setup.result_of(
        StageReach,
        about_driven(stage),
        found,
        mesh,
        {"analytic model": commanded.result.name},
        {"load": F} | _of_all_poses(solid, poses.rest, stage.lever),
        {"actuator": drive.names, "vertex": vertices},
        warnings=warnings,
        notes=_notes(stops, solid, commanded),
        fields=solid,
    )


def pose_set(
    model: Commanding,
    system: DriveSystem,
    load: Array,
) -> PoseSet:
    """Return the poses of a driven stage under a load (3,).

    system : the drive by one model.   model : gives the neck stress by the forces of `system`.
    """
    designs = design_arrays(model.stage)
    limits = command_limits(designs, system.at(None), model.necks[None], load)
    return PoseSet(system, limits, load, _names_of_necks())


def _names_of_necks() -> list[str]:
    return [
        f"yield of the {hinge} hinge, chain {chain}" for chain in CHAINS for hinge in HINGE_NAMES
    ]


def _of_all_poses(
    solid: Polytope,
    rest: Array,
    lever: float,
) -> dict[str, Any]:
    """Return the pose at rest, and the numbers of the polytope."""
    return {
        "rest": rest,
        "circle": solid.radius(rest * [1, 1, 0], 2),
        "ball": solid.radius(rest * [1, 1, lever], 3),
        "volume": solid.volume,
        "vertices": solid.vertices,
        "commands": solid.commands,
    }


def _notes(
    stops: Stops,
    solid: Polytope,
    commanded: Commanding,
) -> list[str]:
    """Return the limits of the ranges, the size of the polytope, and the accuracy of the model."""
    all_poses = f"all poses: {len(solid.vertices)} vertices, {len(solid.faces)} faces"
    if solid.missed:
        all_poses += (
            f"; some poses are outside these faces by up to {100 * solid.missed:.2g} % of the "
            "largest"
        )
    model = commanded.result
    return [
        "limits of the ranges; base 2+ is the longest stroke of the stack base in chain 2, base "
        "2- its shortest:",
        *(
            f"{direction}, others {others}, {end} end: {by}"
            for (others, direction, end), by in stops.items()
        ),
        all_poses,
        warning.driven_accuracy(model.formula, model.links, model.plane),
    ]


def _why_unreachable(
    commanded: Commanding,
    poses: PoseSet,
    load: Array,
) -> str:
    """Describe the limits that allow no commands.

    They are the kinds that exclude all commands together with those of strokes, or all kinds.
    """
    infeasible = [kind for kind in KINDS if _excludes_all(commanded, poses, kind)]
    kinds = " and those of ".join(infeasible)
    if not infeasible:
        kinds = "stroke, contact, blocking force and yield together"
    under = "under this load" if np.any(load) else "without load"
    stress = _preload_stress(commanded)
    preloads = ""
    if stress > 1e-3:
        preloads = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}"
    return f"the drive reaches no pose: the limits of {kinds} allow no commands {under}{preloads}"


def _excludes_all(
    commanded: Commanding,
    poses: PoseSet,
    kind: str,
) -> bool:
    """Whether limits of a kind, with those of strokes, allow no commands."""
    limits = poses.limits
    assert isinstance(limits, StageLimits)
    chosen = [name.startswith((KINDS[0], kind)) for name in poses.names[: limits.rows.shape[1]]]
    part = replace(
        limits,
        rows=limits.rows[:, chosen],
        bounds=limits.bounds[:, chosen],
        strength=limits.strength if kind == "yield" else np.array([np.inf]),
    )
    system = commanded.system
    try:
        PoseSet(system, part, np.zeros(3), poses.names).maximised(system.drive.highest[None])
    except NothingAllowed:
        return True
    return False


def _preload_stress(commanded: Commanding) -> float:
    """Return the highest neck stress by the preloads alone, MPa; those of a pair balance and cause
    none.
    """
    return float(np.max(commanded.stress(np.zeros(3), commanded.system.drive.preload)))


def _warnings(
    commanded: Commanding,
    drive: ActuatorSet,
    solid: Polytope,
) -> list[str]:
    messages = list[str]()
    unpaired = np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, unpaired]).T @ drive.preload > 0):
        messages.append(
            "single stacks have no opposite stack that balances their preload, which stresses "
            f"the necks with up to {_preload_stress(commanded):.4g} {STRESS} at zero "
            "commands (the model has no spring that carries the preload)"
        )
    scale = np.array([[1.0], [1.0], [commanded.stage.lever]])
    rank = np.linalg.matrix_rank(scale * commanded.system.poses, rtol=SINGULAR)
    if rank < 3:
        messages.append(
            f"the drive moves the platform in {rank} of three directions: its poses are not a solid"
        )
    elif solid.dimension < 3:
        messages.append(
            f"the poses within the limits are not a solid: they {EXTENDS[solid.dimension]}"
        )
    return messages
