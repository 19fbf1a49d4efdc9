"""Strokes and forces of the stacks for a pose of a driven stage, and the pose of finite elements by
these strokes.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.paper import warnings as warning
from flexfem.paper.answers import about_driven, chosen, mesh_of
from flexfem.paper.commanding import (
    Commanding,
    DrivenElements,
    calibration,
    commanding,
    driven_elements,
    half_widths_by_friction,
    limit_warnings,
    push_spread,
)
from flexfem.paper.contacts import FOLLOWS
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.equilibrium import Serial, loaded, serial
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import actuators_of
from flexfem.questions import setup
from flexfem.questions.driven import (
    CRITERIA,
    LIMITS,
    ROUND_OFF,
    Criterion,
    DriveSystem,
    Unreachable,
    stack_names,
)
from flexfem.questions.setup import DEFAULT, Analytic
from flexfem.questions.warnings import of_yield
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSE_MESHES,
    ELEMENTS,
    NEW_MESH,
    SOLVED,
    STRESS,
    Gate,
    Quantity,
    Result,
)

# mm, rad; more than a thousand times the range of piezo drives
LARGEST_POSE = 1e2
LARGEST_LOAD = 1e6  # N, N mm
PUSHES = {
    "pushed": "preloaded, forces normal to the loaded body",
    "carrier": "preloaded, forces fixed to the carrier",
}
UNIT_POSES = (("", "", "mm_per_rad"), ("", "", "mm_per_rad"), ("rad_per_mm", "rad_per_mm", ""))
# models that command a pose beside the chosen one
OTHER_MODELS = (
    (None, CALIBRATED, True),
    (None, DEFAULT_FORMULA, False),
    (21, DEFAULT_FORMULA, False),
    (21, CALIBRATED, False),
)


class StageDrive(Result):
    """Strokes and forces of the stacks of a driven stage for a pose, and errors of finite elements."""

    kind_name = "drive"
    title = "strokes and forces for a pose"
    main_result = ("share", {"criterion": "within limits"})
    labels: ClassVar = {"limit": LIMITS}
    columns = ("criterion", "direction")
    figure = "paper.figures.drive.command_figure"
    drawn_from_fields = True
    footnotes = (
        "strokes and rotations are relative to rest; forces and stress include the preloads; the "
        "other directions are held unless a stiffness states otherwise",
    )
    pose = Quantity("pose of the platform", "motion", ("direction",))
    load = Quantity("load on the platform", "wrench", ("direction",))
    stroke = Quantity("stroke", "um", ("stack", "criterion"), SOLVED, "all")
    force = Quantity("force", "n", ("stack", "criterion"), SOLVED, "all")
    command = Quantity(
        "stroke of the actuator", "um", ("actuator", "criterion"), SOLVED, "all", shown=False
    )
    shortest = Quantity("least stroke of the actuator", "um", ("actuator",), shown=False)
    longest = Quantity("largest stroke of the actuator", "um", ("actuator",), shown=False)
    preload = Quantity("preload", "n", ("stack",), shown=False)
    blocking_force = Quantity("blocking force", "n", ("stack",), shown=False)
    share = Quantity("share of the limit", "percent", ("limit", "criterion"), SOLVED)
    energy = Quantity("strain energy of the stage", "n_mm", ("criterion",), SOLVED, "all")
    stack_energy = Quantity(
        "strain energy of stacks and contacts", "n_mm", ("criterion",), SOLVED, "all"
    )
    rotation = Quantity(
        "largest hinge rotation", "mrad", ("chain", "hinge", "criterion"), SOLVED, "all"
    )
    stress = Quantity(
        "highest neck stress", "mpa", ("model", "chain", "hinge", "criterion"), STRESS, "all"
    )
    friction = Quantity(
        "largest pose uncertainty by friction (±)",
        "motion",
        ("strokes by", "model", "direction"),
        NEW_MESH,
        "pose",
    )
    stiffness = Quantity("stiffness", "stiffness", ("state", "direction"), SOLVED)
    change = Quantity(
        "change of engaged stiffness by stack forces",
        "percents",
        ("state", "direction"),
        Gate(1e-9, absolute=1e-8),
        "all",
    )
    push_spread = Quantity(
        "spread of the engaged stiffness (±)", "stiffness", ("direction",), SOLVED
    )
    error = Quantity(
        "error of finite elements with the strokes",
        "motion",
        ("commanding model", "direction"),
        COARSE_MESHES,
        "all",
    )
    calibration = Quantity(
        "pose command for a unit pose",
        UNIT_POSES,
        ("component", "direction"),
        COARSE_MESHES,
        "matrix",
        shown=False,
    )


class _Asked(NamedTuple):
    """What is asked for: pose and load (3,) of the platform, and the lever, mm."""

    pose: Array
    load: Array
    lever: float


def drive(
    stage: Stage,
    *,
    pose: tuple[float, float, float] | None = None,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
) -> StageDrive:
    """Return strokes and forces of the stacks of a stage for a pose.

    Raises BadInput, ComputationFailed.
    """
    mesh = mesh_of(stage, models, resolution, least=2)
    if pose is None:
        raise BadInput(
            "pose is missing, expected the pose of the platform (option --pose): mm, mm, rad"
        )
    asked = _Asked(
        arguments.vectors("pose", pose, 1, LARGEST_POSE),
        arguments.vectors("load", load, 1, LARGEST_LOAD),
        stage.lever,
    )
    stacks = drive_of(stage)
    warnings = list(warning.of_stage(stage))
    first = commanding(chosen(stage, analytic, warnings))
    commands = _commands(first.system, asked, warnings)
    X = np.array(list(commands.values()))
    values = _of_strokes(first, X, asked)
    states = _stiffness(first, commands, asked)
    values |= _of_states(states, first)
    axes = _labels(stacks, commands, states)
    found = {ANALYTIC: _of_model(first, X, asked)}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution)
        found[ELEMENTS] = _of_model(elements, X, asked)
        errors = _open_loop(elements, first, asked)
        values |= {"error": errors.error, "calibration": errors.calibration}
        axes["commanding model"] = errors.models
    warnings += [
        f"no stable equilibrium in the state {name!r}"
        for name, K in states.items()
        if np.isnan(K).any()
    ]
    for name, x in commands.items():
        warnings += limit_warnings(first.system, x, asked.load, name)
    warnings += _over_yield(stage, commands, list(found.values())[-1])
    warnings += warning.of_motion(stage, asked.pose, "the pose")
    return setup.result_of(
        StageDrive,
        about_driven(stage),
        found,
        mesh,
        {"strokes by": first.result.name},
        values,
        axes,
        warnings=warnings,
        notes=_notes(stage, first),
        fields=stage,
    )


def _commands(
    system: DriveSystem,
    asked: _Asked,
    warnings: list[str],
) -> dict[Criterion, Array]:
    """Return the commands (m,) by criterion; one that cannot be met is left out with a warning."""
    commands = dict[Criterion, Array]()
    reason = ""
    for name in CRITERIA:
        try:
            commands[name] = system.commands(asked.pose, asked.load, asked.lever, name)
        except Unreachable as failure:
            warnings.append(f"{name}: {failure}")
            reason = failure.reason
    if "within limits" in commands:  # limits of strokes are among these limits
        reason = _beyond_limits(system, commands["within limits"], asked.load)
    if reason:
        warnings.append(f"the drive does not reach this pose: {reason}")
    return commands


def _labels(
    stacks: ActuatorSet, commands: Mapping[Criterion, Array], states: Mapping[str, Array]
) -> dict[str, tuple[str, ...]]:
    return {
        "criterion": tuple(commands),
        "strokes by": tuple(commands),
        "actuator": stacks.names,
        "stack": stack_names(stacks),
        "state": tuple(states),
    }


def _beyond_limits(
    system: DriveSystem,
    command: Array,
    load: Array,
) -> str:
    """Describe the most exceeded limit, "" within all of them."""
    shares = {name: np.max(share) for name, share in system.shares(command, load).items()}
    limit = max(shares, key=shares.__getitem__)
    if shares[limit] <= 1 + ROUND_OFF:
        return ""
    return f"it requires {shares[limit]:.4g} times the limit of {limit}"


def _of_strokes(
    first: Commanding,
    X: Array,
    asked: _Asked,
) -> dict[str, Any]:
    """Return what follows from the model that computes the commands X (c, m)."""
    system = first.system
    stacks = system.drive
    motions = [system.moved(x, asked.load) for x in X]
    forces = np.array([stacks.preload + motion.force for motion in motions])
    each = [system.shares(x, asked.load).values() for x in X]
    share = np.array([[np.max(used) for used in by_limit] for by_limit in each]).T
    rotations = [first.rotations(motion, asked.load) for motion in motions]
    return {
        "pose": asked.pose,
        "load": asked.load,
        "command": X.T,
        "stroke": stacks.differential @ X.T,
        "force": forces.T,
        "shortest": stacks.lowest,
        "longest": stacks.highest,
        "preload": stacks.preload,
        "blocking_force": stacks.blocking_force,
        "share": np.where(np.isfinite(share), 100 * share, np.nan),
        "energy": [motion.stage for motion in motions],
        "stack_energy": [motion.stacks for motion in motions],
        "rotation": np.stack(rotations, axis=-1),
    }


def _of_model(
    model: Commanding | DrivenElements,
    X: Array,
    asked: _Asked,
) -> setup.ModelAnswer:
    """Return neck stress, and what friction leaves open, of one model with the commands X (c, m)."""
    stacks = model.system.drive
    forces = [stacks.preload + model.system.moved(x, asked.load).force for x in X]
    stress = np.stack([model.stress(asked.load, force) for force in forces], axis=-1)
    values: dict[str, Any] = {"stress": stress}
    if stacks.rubbing:
        values["friction"] = [
            half_widths_by_friction(model.system, model.across, force) for force in forces
        ]
    return setup.ModelAnswer(values)


def _stiffness(
    first: Commanding, commands: Mapping[Criterion, Array], asked: _Asked
) -> dict[str, Array]:
    """Return the platform stiffness (3,) by state.

    The states are those without stacks, with stacks, and with stack forces that follow a body (16).
    """
    system = first.system
    drive = system.drive
    C = system.C[:3, :3]
    no_load = np.zeros(3)
    joints = {way: serial(first.stage, first.result, drive.stacks, way) for way in FOLLOWS}
    states = {"disengaged": np.diag(np.linalg.inv(C)), "engaged": system.stiffness}
    for way in FOLLOWS:
        states[PUSHES[way]] = _preloaded(joints[way], drive, drive.preload, no_load)
    for name, x in commands.items():
        force = drive.preload + system.moved(x, asked.load).force
        states[f"stack forces, {name}"] = _preloaded(joints["pushed"], drive, force, asked.load)
    states["disengaged, other directions free"] = 1 / np.diag(C)
    states["engaged, other directions free"] = 1 / np.diag(system.engaged)
    return states


def _preloaded(
    joints: Serial,
    drive: ActuatorSet,
    force: Array,
    load: Array,
) -> Array:
    """Return the stiffness diagonal (3,) with engaged stacks under forces (n,), N; nan if it is
    unstable.
    """
    unstable = np.full(3, np.nan)
    try:
        found = loaded(joints, force, load)
    except (ComputationFailed, np.linalg.LinAlgError):
        return unstable
    return np.diag(found.stiffness(drive.stiffness)) if found.stable(drive.stiffness) else unstable


def _of_states(states: Mapping[str, Array], first: Commanding) -> dict[str, Any]:
    """Return the stiffness of all states, and its changes by stack forces, in per cent."""
    engaged = states["engaged"]
    changes = [
        100 * (K / engaged - 1) if "forces" in name else np.full(3, np.nan)
        for name, K in states.items()
    ]
    values: dict[str, Any] = {"stiffness": list(states.values()), "change": changes}
    if first.result.links:
        values["push_spread"] = push_spread(first)
    return values


class _OpenLoop(NamedTuple):
    """Errors (models, 3) of finite elements with the strokes of several models, and the
    calibration (3, 3)."""

    models: tuple[str, ...]
    error: Array
    calibration: Array


def _open_loop(
    elements: DrivenElements,
    first: Commanding,
    asked: _Asked,
) -> _OpenLoop:
    """Return the errors of finite elements with least-energy strokes of several models, and of the
    calibrated first.
    """
    pose = asked.pose
    matrix = calibration(elements.system, first.system, asked.lever)
    commanded = {first.result.name: (first, pose)}
    for choice in OTHER_MODELS:
        with suppress(BadInput):  # hinges off the chart
            model = commanding(ModelChoice(elements.stage, *choice))
            commanded.setdefault(model.result.name, (model, pose))
    gains = 1 / np.diag(np.linalg.inv(matrix))
    commanded[f"{first.result.name}, three gains"] = (first, gains * pose)
    commanded[f"{first.result.name}, calibration matrix"] = (first, matrix @ pose)
    poses = list[Array]()
    for model, goal in commanded.values():
        strokes = model.system.commands(goal, asked.load, asked.lever, "least energy")
        poses.append(elements.system.moved(strokes, asked.load).pose)
    return _OpenLoop(tuple(commanded), np.array(poses) - pose, matrix)


def _over_yield(
    stage: Stage, commands: Mapping[Criterion, Array], last: setup.ModelAnswer
) -> list[str]:
    """Warn of commands by which the last model exceeds the yield strength."""
    found = list[str]()
    highest = np.max(last.values["stress"], axis=(0, 1))
    for name, stress in zip(commands, highest.tolist(), strict=True):
        found += of_yield(stress, stage.material.yield_strength, f"strokes of {name}")
    return found


def _notes(stage: Stage, first: Commanding) -> list[str]:
    """Return the contacts of the stacks, and the accuracy of the model."""
    contacts = dict.fromkeys(one.contact for row in actuators_of(stage) for one in row)
    model = first.result
    return [
        f"contact of each stack: {', or '.join(contacts)}",
        warning.driven_accuracy(model.formula, model.links, model.plane),
    ]
