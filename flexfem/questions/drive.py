"""Strokes and forces of the stacks for a pose of a driven stage, and the finite-element pose with
these strokes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index, inverse
from flexfem.fem.mesh import StageMesh
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.contacts import FOLLOWS, PLAUSIBLE, Stack
from flexfem.paper.designs import lower, stage_frames
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.equilibrium import Serial, loaded, serial
from flexfem.paper.fields import driven_response, neck_maxima, neck_wrenches, plane_stress
from flexfem.paper.model import (
    CALIBRATED,
    DEFAULT_FORMULA,
    AnalyticResult,
    ModelChoice,
    analyse,
    at_necks,
)
from flexfem.paper.responses import driven_model
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import actuators_of
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.questions import finite, plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.driven import (
    CRITERIA,
    LIMITS,
    ROUND_OFF,
    Criterion,
    Driven,
    DriveRanges,
    Motion,
    Unreachable,
    drive_ranges,
    sections_of,
    stress_along,
)
from flexfem.questions.plates import ON_MESHES, PEAK
from flexfem.questions.setup import (
    DEFAULT,
    Analytic,
    MeshFields,
    about,
    elements_through,
    for_mechanisms,
    mesh_of,
)
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    ANALYTIC,
    COARSER,
    ELEMENTS,
    FLOOR,
    FRESH,
    SOLID,
    SOLVED,
    STRESS,
    Gate,
    Quantity,
    Result,
)

LARGEST_POSE = (
    1e2  # of a driven stage, mm, rad; more than a thousand times the range of piezo drives
)
LARGEST_LOAD = 1e6  # on a driven stage, N, N mm
PUSHES = {
    "pushed": "preloaded, forces normal to the loaded body",
    "carrier": "preloaded, forces fixed to the carrier",
}
UNIT_POSES = (("", "", "mm_per_rad"), ("", "", "mm_per_rad"), ("rad_per_mm", "rad_per_mm", ""))


class Drive(Result):
    """Strokes and forces of the stacks of a driven stage for a pose, and the finite-element pose
    with the strokes.
    """

    title = "strokes and forces for a pose"
    main = ("share", {"criterion": "within limits"})
    labels: ClassVar = {"limit": LIMITS}
    columns = ("criterion", "direction")
    figure = "drive.command_figure"
    drawn_from_fields = True
    reading = (
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
        FRESH,
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
        COARSER,
        "all",
    )
    calibration = Quantity(
        "pose command for a unit pose",
        UNIT_POSES,
        ("component", "direction"),
        COARSER,
        "matrix",
        shown=False,
    )


class MechanismDrive(Result):
    """Motion of a mechanism by its actuators, with all of them in place: transmission, range,
    losses, coupling.
    """

    title = "drive"
    main = ("motion", {})
    reading: ClassVar[tuple[str, ...]] = (
        "all actuators are in place with their stiffness; a motion is that for the free stroke "
        "of one actuator, which acts along its line at rest",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )
    motion = Quantity(
        "motion for the full free stroke",
        "motion",
        ("actuator", "point", "model", "direction"),
        ON_MESHES,
        "all",
    )
    transmission = Quantity(
        "output motion per free stroke, at small strokes",
        ("", "", "rad_per_mm"),
        ("actuator", "model", "direction"),
        ON_MESHES,
        "all",
    )
    used = Quantity(
        "opening of the actuator over its free stroke",
        "percent",
        ("actuator", "model"),
        ON_MESHES,
        note="the rest of the stroke is lost to the elasticity of the actuator",
    )
    coupling = Quantity(
        "opening of the other actuators over the free stroke",
        "percent",
        ("actuator", "other", "model"),
        ON_MESHES,
        "all",
    )
    cross = Quantity(
        "cross motion of the output over its main translation",
        "percent",
        ("actuator", "model"),
        ON_MESHES._replace(absolute=5e-3),
        "all",
    )
    rotation = Quantity(
        "parasitic rotation of the output over its main translation",
        "rad_per_mm",
        ("actuator", "model"),
        ON_MESHES._replace(absolute=1e-6),
        "all",
    )
    force = Quantity("force of the actuator at full stroke", "n", ("actuator", "model"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress at full stroke", "mpa", ("actuator", "model", "hinge"), PEAK, "all"
    )
    engaged = Quantity(
        "stiffness of the output with all actuators, other directions held",
        "stiffness",
        ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),
        compared=False,  # it has that of bodies at small contacts
    )
    engaged_free = Quantity(
        "stiffness of the output with all actuators, other directions free",
        "stiffness",
        ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),
    )


class Commanding(NamedTuple):
    """An analytic model that computes strokes, and its stage as modelled (`model.ModelChoice`).

    necks : (3 chains, 3 hinges, 3, 3 + n) of `responses.DrivenModel`.
    across : (3 + n, r), mm and rad per N, pose and openings by tangential forces at contacts with
    stated friction."""

    stage: Stage
    result: AnalyticResult
    necks: Array
    system: Driven
    across: Array

    def carried(self, load: Array, force: Array) -> Array:
        """Return moment, axial and shear force (3, 3 chains, 3 hinges) of every notch, by a load
        and stack forces.
        """
        wrenches = self.necks @ np.concatenate([load, force])
        return np.array(at_necks(stage_frames(self.stage), wrenches[..., None]))[..., 0]

    def stress(self, load: Array, force: Array) -> Array:
        """Return the largest von Mises stress (3 chains, 3 hinges) of every notch, MPa, by a load
        and stack forces.
        """
        sections = sections_of(lower(self.stage))[:, 0]
        return np.asarray(np.max(stress_along(sections, self.carried(load, force)), axis=-1))

    def rotations(self, motion: Motion, load: Array) -> Array:
        """Return the rotation (3 chains, 3 hinges) of every hinge relative to rest, rad."""
        return np.asarray(self.result.hinges.rotation * self.carried(load, motion.force)[0])


class DrivenElements(NamedTuple):
    """Finite elements of a driven stage: displacements `fields` by unit loads; `across` as in
    `Commanding`.
    """

    stage: Stage
    mesh: StageMesh
    fields: Array
    system: Driven
    across: Array

    def stress(self, load: Array, force: Array) -> Array:
        """As `Commanding.stress`."""
        field = np.tensordot(np.concatenate([load, force]), self.fields, axes=1)
        return neck_maxima(self.stage, self.mesh, plane_stress(self.stage, self.mesh, field))


@for_mechanisms(
    Drive, MechanismDrive, not_for="pose load analytic", only_for="plane solid thickness_resolution"
)
def drive(
    stage: Mechanism,
    *,
    pose: tuple[float, float, float] | None = None,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
) -> Drive | MechanismDrive:
    """Strokes and forces of the stacks of a stage for a pose, or the motion of a mechanism by its
    actuators.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    pose : tuple of float, optional
        Pose of the platform: mm, mm, rad. Of a stage file only.
    load : tuple of float
        Load on the platform: N, N, N mm. Of a stage file only.
    models : {"both", "analytic"}
        With "both", the strokes of the analytic model are applied to finite elements.
    resolution : int, optional
        Triangles across every neck.
    solid : bool
        The whole plate of a mechanism by finite elements in three dimensions.
    analytic : Analytic
        The analytic model. Of a stage file only.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.

    Returns
    -------
    Drive | MechanismDrive
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        drive` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drive(flexfem.load("geometry/mobility6.toml"), pose=(2e-3, 1e-3, 0.0), models="analytic")
    >>> [round(float(stroke), 2) for stroke in found.at("command", criterion="least energy")]  # um, six pairs
    [0.33, 0.29, -0.75, 0.7, 0.42, -1.0]
    """
    if isinstance(stage, MechanismFile):
        mesh = plates.mesh_of(
            stage, models, resolution, elements_through(solid, thickness_resolution)
        )
        return _of_mechanism(stage, mesh, models)
    mesh = mesh_of(stage, models, resolution, None, 2)
    if pose is None:
        raise BadInput(
            "pose is missing, expected the pose of the platform (option --pose): mm, mm, rad"
        )
    target = arguments.vectors("pose", pose, 1, LARGEST_POSE)
    F = arguments.vectors("load", load, 1, LARGEST_LOAD)
    stacks = drive_of(stage)
    lever = stage.chain.link_lengths[2]
    warnings = list(warning.of_stage(stage))
    first = commanding(analytic.chosen(stage, warnings))
    commands = _commands(first.system, target, F, lever, warnings)
    X = np.array(list(commands.values()))
    motions = [first.system.moved(x, F) for x in X]
    forces = np.array([stacks.preload + motion.force for motion in motions])
    share = np.array([[np.max(used) for used in first.system.shares(x, F).values()] for x in X]).T
    values: dict[str, Any] = {
        "pose": target,
        "load": F,
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
        "rotation": np.stack([first.rotations(motion, F) for motion in motions], axis=-1),
    }
    solved: dict[str, Commanding | DrivenElements] = {ANALYTIC: first}
    axes: dict[str, tuple[str, ...]] = {"criterion": tuple(commands), "strokes by": tuple(commands)}
    axes |= {"actuator": stacks.names, "stack": stack_names(stacks)}
    if mesh is not None:
        solved[ELEMENTS] = elements = driven_elements(stage, mesh.resolution)
        values |= _open_loop(elements, first, target, F, axes)
    found = dict[str, setup.ModelAnswer]()
    for label, model in solved.items():
        by_model = [stacks.preload + model.system.moved(x, F).force for x in X]
        stress = np.stack([model.stress(F, force) for force in by_model], axis=-1)
        friction = {
            "friction": [left_open(model.system, model.across, force) for force in by_model]
        }
        found[label] = setup.ModelAnswer({"stress": stress} | (friction if stacks.rubbing else {}))
    states = _stiffness(first, dict(zip(commands, forces, strict=True)), F)
    changed = [
        100 * (K / states["engaged"] - 1) if "forces" in name else K * np.nan
        for name, K in states.items()
    ]
    values |= {"stiffness": list(states.values()), "change": changed}
    if first.result.links:
        values["push_spread"] = push_spread(first)
    warnings += [
        f"no stable equilibrium in the state {name!r}"
        for name, K in states.items()
        if np.isnan(K).any()
    ]
    warnings += [
        text for name, x in commands.items() for text in limit_warnings(first.system, x, F, name)
    ]
    for name, highest in zip(commands, np.max(stress, axis=(0, 1)), strict=True):
        warnings += warning.of_yield(
            float(highest), stage.material.yield_strength, f"strokes of {name}"
        )
    warnings += warning.of_motion(stage, target, "the pose")
    notes = [
        "contact of each stack: "
        f"{', or '.join(dict.fromkeys(a.contact for row in actuators_of(stage) for a in row))}",
        warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane),
    ]
    settings = {"strokes by": first.result.name}
    axes["state"] = tuple(states)
    return setup.answer(
        Drive,
        about(stage, drive=True),
        found,
        mesh,
        settings,
        values,
        axes,
        warnings=warnings,
        notes=notes,
        fields=stage,
    )


def _of_mechanism(
    mechanism: Mechanism, mesh: setup.Mesh | None, models: setup.Models
) -> MechanismDrive:
    """Return the motion of a mechanism by the full free stroke of each of its actuators."""
    layout = mechanism.layout
    strokes = np.diag(layout.drive.highest)
    commands = [finite.by_strokes(layout, one) for one in strokes]
    changes = finite.changes(mechanism, mesh, commands)

    def of_network(elastic: bool) -> plates.Values:
        return _at_strokes(mechanism, plates.network(mechanism, elastic), None)

    def of_size(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        return _at_strokes(
            mechanism, plates.elements(mechanism, resolution, layers, thick), changes.of(label)
        )

    def made() -> dict[str, Array]:
        assert mesh is not None
        response = plates.solved(mechanism, mesh.resolution)
        loads = Driven.of_mechanism(mechanism, response.compliance).Y * layout.drive.highest
        fields = np.tensordot(loads.T, response.fields[layout.drive_ports], 1)
        return dict(zip(layout.drive.names, fields, strict=True))

    found = plates.by_models(mechanism, mesh, models, of_network, of_size)
    found = {label: _with_errors(layout, one, changes) for label, one in found.items()}
    plane = mesh is not None and not mesh.layers
    fields = (
        MeshFields(plates.meshed(mechanism, mesh.resolution), made)
        if mesh is not None and plane
        else None
    )
    warnings = plates.over_yield(mechanism, found, "stress", "full stroke")
    warnings += changes.warnings("at full stroke", mesh)
    notes = changes.notes("at full stroke", mesh)
    axes = {"other": layout.drive.names}
    return setup.answer(
        MechanismDrive,
        mechanism,
        found,
        mesh,
        axes=axes,
        warnings=warnings,
        notes=notes,
        fields=fields,
    )


def _at_strokes(
    mechanism: Mechanism, response: plates.Responses, changes: Sequence[Displaced] | None
) -> dict[str, Any]:
    """Return the values of one model at the full stroke of each actuator: linear theory, and
    changes (a) to add.
    """
    layout = mechanism.layout
    drives = layout.drive_ports
    strokes = layout.drive.highest
    C = response.compliance
    found = Driven.of_mechanism(mechanism, C)
    forces = (found.Y * strokes).T @ np.eye(len(C))[drives]  # (a, k)
    motions = forces @ C
    stress = response.stress(forces)
    transmission = motions[:, :3] / strokes[:, None]
    if changes is not None:
        motions = motions + np.array([one.motions for one in changes])
        forces = forces + np.array([one.loads for one in changes])
        stress = stress + np.array([one.stress for one in changes])
    opening = motions[:, drives] / strokes[:, None]
    numbers = np.arange(len(strokes))
    coupled = np.where(numbers == numbers[:, None], np.nan, opening)
    main = _main_translation(motions)
    cross = main.output[numbers, 1 - main.axis] / main.along
    rotation = main.output[:, 2] / main.along
    return {
        "motion": motions[:, : 3 * len(layout.points)].reshape(len(drives), -1, 3),
        "transmission": transmission,
        "used": 100 * np.diag(opening),
        "coupling": 100 * np.where(np.abs(coupled) < ROUND_OFF, 0.0, coupled),
        "cross": 100 * np.where(np.abs(cross) < FLOOR, 0.0, cross),
        "rotation": np.where(np.abs(rotation) * layout.lever < FLOOR, 0.0, rotation),
        "force": np.diag(forces[:, drives]),
        "stress": stress,
        "engaged": found.stiffness,
        "engaged_free": 1 / np.diag(found.engaged),
    }


class _MainTranslation(NamedTuple):
    """Motions (a, 3) of the output by each actuator, the axes (a,) of their larger translations,
    and these (a,).
    """

    output: Array
    axis: Index
    along: Array


def _main_translation(motions: Array) -> _MainTranslation:
    """Return the main translations of motions (a, k) of the ports; nan where there is none."""
    output = motions[:, :3]
    axis = np.argmax(np.abs(output[:, :2]), axis=1)
    along = output[np.arange(len(output)), axis]
    moved = np.abs(along) > ROUND_OFF * np.max(np.abs(motions))
    return _MainTranslation(output, axis, np.where(moved, along, np.nan))


def _with_errors(
    layout: Layout, found: setup.ModelAnswer, changes: finite.Changes
) -> setup.ModelAnswer:
    """Add the possible errors of finite displacements to the bands of values at full stroke; no
    band without them.
    """
    if "motion" not in found.bands:
        return found
    bands = dict(found.bands)
    if changes.failure:
        linear = ("transmission", "engaged", "engaged_free")
        return found._replace(bands={name: band for name, band in bands.items() if name in linear})
    drives = layout.drive_ports
    strokes = layout.drive.highest
    motions = np.array([one.motions for one in changes.errors()])
    loads = np.array([one.loads for one in changes.errors()])
    opening = 100 * motions[:, drives] / strokes[:, None]
    main = _main_translation(found.values["motion"].reshape(len(drives), -1))
    along = np.abs(main.along)
    numbers = np.arange(len(drives))
    relative = motions[numbers, main.axis] / along
    across = motions[numbers, 1 - main.axis] / along
    added = {
        "motion": motions[:, : 3 * len(layout.points)].reshape(len(drives), -1, 3),
        "used": np.diag(opening),
        "coupling": opening,
        "cross": 100 * across + np.abs(found.values["cross"]) * relative,
        "rotation": motions[:, 2] / along + np.abs(found.values["rotation"]) * relative,
        "force": np.diag(loads[:, drives]),
        "stress": np.array([one.stress for one in changes.errors()]),
    }
    return found._replace(
        bands=bands | {name: bands[name] + error for name, error in added.items()}
    )


def commanding(chosen: ModelChoice) -> Commanding:
    """Return the analytic model of a driven stage. Raises BadInput as `model.analyse`, and without
    actuators.
    """
    result = analyse(*chosen)
    drive = drive_of(chosen.stage)
    C, necks = driven_model(chosen.stage, result, _with_friction(drive))
    n = 3 + len(drive.stacks)
    return Commanding(chosen.stage, result, necks[..., :n], Driven.of(C[:n, :n], drive), C[:n, n:])


def driven_elements(stage: Stage, resolution: int) -> DrivenElements:
    """Return finite elements of a driven stage. Raises BadInput without actuators,
    ComputationFailed.
    """
    drive = drive_of(stage)
    mesh = build_mesh(stage, resolution)
    found = driven_response(mesh, plate_of(stage), _with_friction(drive))
    n = 3 + len(drive.stacks)
    C = found.compliance
    return DrivenElements(stage, mesh, found.nodal[:n], Driven.of(C[:n, :n], drive), C[:n, n:])


def element_ranges(stage: Stage, mesh: StageMesh) -> DriveRanges:
    """Return the ranges of a drive, n = 1, by finite elements; neck stress from their wrenches as
    in the model.
    """
    drive = drive_of(stage).at(None)
    plate = plate_of(stage)
    found = driven_response(mesh, plate, drive.stacks)
    necks = neck_wrenches(mesh, plate, found.nodal)
    return drive_ranges(lower(stage), Driven.of(found.compliance[None], drive), necks[None])


def push_spread(model: Commanding) -> Array:
    """Return the largest change (3,) of the engaged stiffness if stack forces act over half or
    twice their length.
    """
    drive = model.system.drive
    stiffness = []
    for factor in PLAUSIBLE:
        spread = tuple(stack.spread_over(factor) for stack in drive.stacks)  # limited to the links
        C = driven_model(model.stage, model.result, spread).compliance
        stiffness.append(Driven.of(C, drive).stiffness)
    return np.asarray(np.max(np.abs(stiffness - model.system.stiffness), axis=0))


def _with_friction(drive: ActuatorSet) -> tuple[Stack, ...]:
    """Return the stacks of a drive, followed by tangential forces at its contacts with stated
    friction.
    """
    return (*drive.stacks, *(drive.stacks[k].across for k in drive.rubbing))


def left_open(system: Driven, across: Array, force: Array) -> Array:
    """Return the half-widths (3,) of the poses possible with friction, mm, mm, rad; force (n,) of
    all stacks, N.

    A contact under the normal force N carries any tangential force f up to mu N before it slips.
    The possible poses are `U + sum_i h_i f_i`, `|f_i| <= mu_i N_i`, where `h = C_Ut - C_Ud Y C_dt`
    is the motion per newton along contact i with the other stacks holding their strokes; the
    half-width `sum |h_i| mu_i N_i` is reached if all are about to slip. N is the force without
    friction; a contact that would have to pull is open and carries no force."""
    drive = system.drive
    rubbing = list(system.drive.rubbing)
    per_force = across[:3] - system.C[:3, 3:] @ system.Y @ across[3:]
    return np.asarray(
        np.abs(per_force) @ (drive.friction[rubbing] * np.maximum(force[rubbing], 0.0))
    )


def _commands(
    system: Driven, pose: Array, load: Array, lever: float, warnings: list[str]
) -> dict[Criterion, Array]:
    """Return the commands (m,) by criterion; a criterion that cannot be met is left out with a
    warning.
    """
    commands = dict[Criterion, Array]()
    reason = ""
    for name in CRITERIA:
        try:
            commands[name] = system.commands(pose, load, lever, name)
        except Unreachable as failure:
            warnings.append(f"{name}: {failure}")
            reason = failure.reason
    if "within limits" in commands:  # limits of strokes are among these limits
        shares = {
            name: np.max(share)
            for name, share in system.shares(commands["within limits"], load).items()
        }
        limit = max(shares, key=shares.__getitem__)
        over = shares[limit] > 1 + ROUND_OFF
        reason = f"it requires {shares[limit]:.4g} times the limit of {limit}" if over else ""
    warnings += [f"the drive does not reach this pose: {reason}"] if reason else []
    return commands


def _stiffness(
    first: Commanding, forces: Mapping[Criterion, Array], load: Array
) -> dict[str, Array]:
    """Return the platform stiffness (3,) without stacks, with stacks, and with stack forces that
    follow a body (16).
    """
    C = first.system.C[:3, :3]
    drive = first.system.drive
    joints = {way: serial(first.stage, first.result, drive.stacks, way) for way in FOLLOWS}
    states = {"disengaged": np.diag(np.linalg.inv(C)), "engaged": first.system.stiffness}
    states |= {
        PUSHES[way]: _preloaded(joints[way], drive, drive.preload, np.zeros(3)) for way in FOLLOWS
    }
    states |= {
        f"stack forces, {name}": _preloaded(joints["pushed"], drive, f, load)
        for name, f in forces.items()
    }
    free = {"disengaged": 1 / np.diag(C), "engaged": 1 / np.diag(first.system.engaged)}
    return states | {f"{name}, other directions free": K for name, K in free.items()}


def _preloaded(joints: Serial, drive: ActuatorSet, force: Array, load: Array) -> Array:
    """Return the stiffness diagonal (3,) with engaged stacks under forces (n,), N; nan if it is
    unstable.
    """
    try:
        found = loaded(joints, force, load)
    except (ComputationFailed, np.linalg.LinAlgError):
        return np.full(3, np.nan)
    return (
        np.diag(found.stiffness(drive.stiffness))
        if found.stable(drive.stiffness)
        else np.full(3, np.nan)
    )


def _open_loop(
    elements: DrivenElements,
    first: Commanding,
    pose: Array,
    load: Array,
    axes: dict[str, tuple[str, ...]],
) -> dict[str, Array]:
    """Return the errors of finite elements with least-energy strokes of several models, and of the
    calibrated first.
    """
    stage = elements.stage
    lever = elements.stage.chain.link_lengths[2]
    matrix = calibration(elements.system, first.system, lever)
    commanded = {first.result.name: (first, pose)}
    rigid = (None, DEFAULT_FORMULA, False), (21, DEFAULT_FORMULA, False), (21, CALIBRATED, False)
    for choice in ((None, CALIBRATED, True), *rigid):
        with suppress(BadInput):  # hinges off the chart
            model = commanding(ModelChoice(stage, *choice))
            commanded.setdefault(model.result.name, (model, pose))
    gains = 1 / np.diag(np.linalg.inv(matrix))
    commanded[f"{first.result.name}, three gains"] = first, gains * pose
    commanded[f"{first.result.name}, calibration matrix"] = first, matrix @ pose
    strokes = [
        model.system.commands(goal, load, lever, "least energy")
        for model, goal in commanded.values()
    ]
    axes["commanding model"] = tuple(commanded)
    poses = np.array([elements.system.moved(x, load).pose for x in strokes])
    return {"error": poses - pose, "calibration": matrix}


def calibration(elements: Driven, model: Driven, lever: float) -> Array:
    """Return the matrix (3, 3) from a pose of the finite elements to the pose that the model is to
    command, no load.
    """
    return inverse(elements.poses @ model.unit_commands(lever))


def stack_names(drive: ActuatorSet) -> tuple[str, ...]:
    """Return the names of the stacks (n) of a drive: those of its actuators, with the second of a
    pair as partner.
    """
    T = drive.differential
    return tuple(
        f"{drive.names[np.flatnonzero(row)[0]]}{', partner' if min(row) < 0 else ''}" for row in T
    )


def limit_warnings(system: Driven, x: Array, load: Array, criterion: Criterion) -> list[str]:
    """Return a warning per kind of limit that commands (m,) exceed: the number exceeded, and the
    largest excess.
    """
    drive = system.drive
    stacks = stack_names(system.drive)
    found = list[str]()
    force = drive.preload + system.moved(x, load).force
    most = drive.blocking_force
    um = 1e3 * x
    low = 1e3 * drive.lowest
    high = 1e3 * drive.highest
    kinds: dict[
        str, tuple[Sequence[str], Array, Callable[[int], str]]
    ] = {  # in the order of `LIMITS`
        "strokes": (
            drive.names,
            np.maximum(um - high, low - um),
            lambda k: f"{um[k]:.4g} um, outside {low[k]:.4g} to {high[k]:.4g} um",
        ),
        "contacts": (stacks, -force, lambda k: f"a pull of {-force[k]:.4g} N"),
        "forces": (stacks, force - most, lambda k: f"{force[k]:.4g} N, above {most[k]:.4g} N"),
    }
    for share, (kind, (names, excess, text)) in zip(
        system.shares(x, load).values(), kinds.items(), strict=True
    ):
        exceeded = np.any(np.reshape(share > 1 + ROUND_OFF, (-1, len(names))), axis=0)
        if exceeded.any():
            k = int(np.argmax(np.where(exceeded, excess, -np.inf)))
            count = np.count_nonzero(exceeded)
            beyond = f"{criterion}: {kind} beyond their limits: {count}"
            found.append(f"{beyond}, the worst at {names[k]}: {text(k)}")
    return found
