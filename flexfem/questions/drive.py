"""Strokes and forces of the stacks for a pose of a driven stage, and where finite elements go with these strokes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.large import Serial, loaded, serial
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, AnalyticResult, ModelChoice, analyse
from flexfem.analytic.responses import DrivenModel, driven_model
from flexfem.arrays import Array, inverse
from flexfem.fem.fields import neck_maxima, plane_stress
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import DrivenResponse, driven_response, neck_wrenches
from flexfem.fem.structure import plate_of
from flexfem.mechanism.contacts import FOLLOWS, PLAUSIBLE, Stack
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import actuators_of
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
    commands_for,
    drive_ranges,
    driven,
    moved,
    neck_forces,
    sections_of,
    shares,
    stress_along,
    unit_commands,
)
from flexfem.questions.setup import DEFAULT, Analytic, about, mesh_of, meshed, question
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, COARSER, ELEMENTS, FRESH, SOLVED, STRESS, Gate, Quantity, Result

LARGEST_POSE = 1e2  # of a driven stage, mm, rad; no piezo drive goes a thousandth of it
LARGEST_LOAD = 1e6  # on a driven stage, N, N mm
PUSHES = {
    "pushed": "preloaded, pushes normal to the pushed body",
    "carrier": "preloaded, pushes kept by the carrier",
}
FREE = ("disengaged, other directions free", "engaged, other directions free")
UNIT_POSES = (("", "", "mm_per_rad"), ("", "", "mm_per_rad"), ("rad_per_mm", "rad_per_mm", ""))


class Drive(Result):
    """Strokes and forces of the stacks of a driven stage for a pose, and what finite elements do with the strokes."""

    title = "strokes and forces for a pose"
    labels: ClassVar = {"limit": LIMITS}
    columns = ("criterion", "direction")
    figure = "drive.command_figure"
    drawn_from_fields = True
    reading = (
        "strokes and rotations beyond rest, forces and stress with the preloads; stiffness with the other directions "
        "held unless said otherwise",
    )
    pose = Quantity("pose of the platform", "motion", ("direction",), prefixed=True)
    load = Quantity("load on the platform", "wrench", ("direction",))
    stroke = Quantity("stroke", "um", ("stack", "criterion"), SOLVED, "all")
    force = Quantity("force", "n", ("stack", "criterion"), SOLVED, "all")
    command = Quantity("stroke of the actuator", "um", ("actuator", "criterion"), SOLVED, "all", shown=False)
    shortest = Quantity("least stroke of the actuator", "um", ("actuator",), shown=False)
    longest = Quantity("largest stroke of the actuator", "um", ("actuator",), shown=False)
    preload = Quantity("preload", "n", ("stack",), shown=False)
    blocking_force = Quantity("blocking force", "n", ("stack",), shown=False)
    share = Quantity("share of the limit", "percent", ("limit", "criterion"), SOLVED)
    energy = Quantity("strain energy of the stage", "n_mm", ("criterion",), SOLVED, "all")
    stack_energy = Quantity("strain energy of stacks and contacts", "n_mm", ("criterion",), SOLVED, "all")
    rotation = Quantity(
        "largest hinge rotation", "mrad", ("chain", "hinge", "criterion"), SOLVED, "all", largest=("chain", "hinge")
    )
    stress = Quantity(
        "highest neck stress", "mpa", ("model", "chain", "hinge", "criterion"), STRESS, "all",
        largest=("chain", "hinge"),
    )  # fmt: skip
    friction = Quantity(
        "pose that friction leaves open, at most ±", "motion", ("strokes by", "model", "direction"), FRESH, "pose",
        prefixed=True,
    )  # fmt: skip
    stiffness = Quantity("stiffness", "stiffness", ("state", "direction"), SOLVED)
    change = Quantity(
        "change of the engaged stiffness by the pushes (%)", "", ("state", "direction"), Gate(1e-9, absolute=1e-8),
        "all",
    )  # fmt: skip
    push_spread = Quantity("spread of the engaged stiffness (±)", "stiffness", ("direction",), SOLVED)
    error = Quantity(
        "error of finite elements with strokes by", "motion", ("commanding model", "direction"), COARSER, "all",
        prefixed=True,
    )  # fmt: skip
    calibration = Quantity(
        "pose to command for a unit pose", UNIT_POSES, ("component", "direction"), COARSER, "matrix", shown=False
    )


class Commanding(NamedTuple):
    """An analytic model that computes strokes, of a stage as it is modelled (`model.ModelChoice`).

    across : (3 + n, r), mm and rad per N, pose and openings by forces along the contacts of stated friction.
    """

    stage: Stage
    result: AnalyticResult
    model: DrivenModel
    of: Driven
    across: Array

    def carried(self, load: Array, force: Array) -> Array:
        """Moment, forces along and across (3, 3 chains, 3 hinges) at every notch, of a load and forces of stacks."""
        wrenches = self.model.necks @ np.concatenate([load, force])
        return neck_forces(stage_frames(self.stage), wrenches[..., None])[..., 0]

    def stress(self, load: Array, force: Array) -> Array:
        """Largest von Mises stress (3 chains, 3 hinges) at every notch, MPa, of a load and forces of stacks (n,)."""
        at = sections_of(lower(self.stage))[:, 0]
        return np.asarray(np.max(stress_along(at, self.carried(load, force)), axis=-1))

    def rotations(self, motion: Motion, load: Array) -> Array:
        """Rotation (3 chains, 3 hinges) of every hinge beyond rest, rad."""
        return np.asarray(self.result.hinges.rotation * self.carried(load, motion.force)[0])


class DrivenElements(NamedTuple):
    """Finite elements of a driven stage, on their mesh; across as of `Commanding`."""

    stage: Stage
    mesh: StageMesh
    response: DrivenResponse
    of: Driven
    across: Array

    def stress(self, load: Array, force: Array) -> Array:
        """As of `Commanding`."""
        field = np.tensordot(np.concatenate([load, force]), self.response.fields, axes=1)
        return neck_maxima(self.stage, self.mesh, plane_stress(self.stage, self.mesh, field))


@question
def drive(
    stage: Stage,
    *,
    pose: tuple[float, float, float],
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
) -> Drive:
    """Strokes and forces of every stack for a pose, by every criterion, and where finite elements go with the strokes.

    Parameters
    ----------
    pose : tuple of float
        Pose of the platform: mm, mm, rad.
    load : tuple of float
        Load on the platform: N, N, N mm.
    models : {"both", "analytic"}
        Whether finite elements are given the strokes of the analytic model.
    resolution : int, optional
        Triangles across every neck.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drive(flexfem.load("geometry/mobility6.toml"), pose=(2e-3, 1e-3, 0.0), models="analytic")
    >>> [round(1e3 * float(stroke), 2) for stroke in found.at("command", criterion="least energy")]  # um, six pairs
    [0.33, 0.29, -0.75, 0.7, 0.42, -1.0]
    """
    check_feasible(stage)
    mesh = mesh_of(models, resolution, None, 2)
    wanted = arguments.vectors("pose", pose, 1, LARGEST_POSE)
    F = arguments.vectors("load", load, 1, LARGEST_LOAD)
    own, lever, warnings = drive_of(stage), stage.chain.link_lengths[2], list(warning.of_stage(stage))
    chosen = analytic.chosen(stage, warnings)
    first = commanding(chosen)
    commands = _commands(first.of, own, wanted, F, lever, warnings)
    motions = [moved(first.of, own, x, F) for x in commands.values()]
    forces, x = np.array([own.preload + each.force for each in motions]), np.array(list(commands.values()))
    used = [shares(first.of, own, each, F) for each in x]
    share = np.array([[np.max(each[limit]) for each in used] for limit in LIMITS])
    values: dict[str, Any] = {
        "pose": wanted,
        "load": F,
        "command": x.T,
        "stroke": (x @ own.differential.T).T,
        "force": forces.T,
        "shortest": own.lowest,
        "longest": own.highest,
        "preload": own.preload,
        "blocking_force": own.blocking_force,
        "share": np.where(np.isfinite(share), 100 * share, np.nan),
        "energy": [each.stage for each in motions],
        "stack_energy": [each.stacks for each in motions],
        "rotation": np.stack([first.rotations(each, F) for each in motions], axis=-1),
    }
    answering: dict[str, Commanding | DrivenElements] = {ANALYTIC: first}
    axes: dict[str, tuple[str, ...]] = {"criterion": tuple(commands), "strokes by": tuple(commands)}
    axes |= {"actuator": own.names, "stack": stack_names(own)}
    if mesh is not None:
        answering[ELEMENTS] = elements = driven_elements(stage, mesh.resolution)
        values |= _open_loop(stage, elements, first, wanted, F, axes)
    stress, friction = [], []
    for model in answering.values():
        pushed = [own.preload + moved(model.of, own, each, F).force for each in x]
        stress.append(np.stack([model.stress(F, force) for force in pushed], axis=-1))
        friction.append([left_open(model.of, model.across, own, force) for force in pushed])
    values["stress"] = stress
    if own.rubbing:
        values["friction"] = np.swapaxes(friction, 0, 1)
    values |= _stiffness(first, own, dict(zip(commands, forces, strict=True)), F, axes, warnings)
    warnings += [text for name, each in commands.items() for text in limit_warnings(first.of, own, each, F, name)]
    for name, highest in zip(commands, np.max(stress[-1], axis=(0, 1)), strict=True):
        warnings += warning.of_yield(float(highest), stage.material.yield_strength, f"strokes of {name}")
    warnings += warning.of_motion(stage, wanted, "the pose")
    notes = [
        f"each stack pushes by {', or by '.join(dict.fromkeys(one.contact for c in actuators_of(stage) for one in c))}",
        warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane),
    ]
    settings = {"strokes by": first.result.name} | meshed(mesh)
    axes["model"] = tuple(answering)
    return Drive(about(stage, drive=True), values, None, axes, settings, warnings, notes, stage)


def commanding(chosen: ModelChoice) -> Commanding:
    """An analytic model of a driven stage. Raises BadInput as `model.analyse`, or without actuators."""
    result, of = analyse(*chosen), drive_of(chosen.stage)
    C, necks = driven_model(chosen.stage, result, _with_friction(of))
    known = 3 + len(of.stacks)
    model = DrivenModel(C[:known, :known], necks[..., :known])
    return Commanding(chosen.stage, result, model, driven(model.compliance, of), C[:known, known:])


def driven_elements(stage: Stage, resolution: int) -> DrivenElements:
    """Finite elements of a driven stage. Raises BadInput without actuators, ComputationFailed."""
    of, mesh = drive_of(stage), build_mesh(stage, resolution)
    C, fields = driven_response(mesh, plate_of(stage), _with_friction(of))
    known = 3 + len(of.stacks)
    response = DrivenResponse(C[:known, :known], fields[:known])
    return DrivenElements(stage, mesh, response, driven(response.compliance, of), C[:known, known:])


def element_ranges(stage: Stage, mesh: StageMesh) -> DriveRanges:
    """What the drive of a stage does, n = 1, by finite elements; neck stress as of the analytic model."""
    of, plate = drive_of(stage).at(None), plate_of(stage)
    C, fields = driven_response(mesh, plate, of.stacks)
    return drive_ranges(lower(stage), driven(C[None], of), neck_wrenches(mesh, plate, fields)[None], of)


def engaged_stiffness(of: Driven) -> Array:
    """Stiffness (3,) of the platform with the stacks holding their strokes, each direction with the others held."""
    return np.asarray(np.diag(np.linalg.inv(of.engaged)))


def push_spread(of: Commanding) -> Array:
    """How much (3,) the engaged stiffness moves, at most, with pushes spread over half and twice the assumed length."""
    own, found = drive_of(of.stage), []
    for times in PLAUSIBLE:
        spread = tuple(stack.spread_over(times) for stack in own.stacks)  # as far as links reach
        found.append(engaged_stiffness(driven(driven_model(of.stage, of.result, spread).compliance, own)))
    return np.asarray(np.max(np.abs(found - engaged_stiffness(of.of)), axis=0))


def _with_friction(of: StageDrive) -> tuple[Stack, ...]:
    """The stacks of a drive, then its contacts of stated friction pushed along their faces."""
    return (*of.stacks, *(of.stacks[k].across for k in of.rubbing))


def left_open(of: Driven, across: Array, own: StageDrive, force: Array) -> Array:
    """Half-widths (3,) of the poses that friction leaves open, mm, mm, rad, with forces (n,) of all stacks, N.

    A contact that its stack presses with N carries along its face any force f up to mu N before it slips. Every pose
    that the stage may rest in is `U + sum_i h_i f_i`, `|f_i| <= mu_i N_i`, `h = C_Ut - C_Ud Y C_dt` the motion by a
    newton along contact i, the other stacks holding their strokes; at most `sum |h_i| mu_i N_i`, where all are about
    to slip. N is the force without friction; contacts that would have to pull are open and hold nothing.
    """
    rubbing = list(own.rubbing)
    per_force = across[:3] - of.C[:3, 3:] @ of.Y @ across[3:]
    return np.asarray(np.abs(per_force) @ (own.friction[rubbing] * np.maximum(force[rubbing], 0.0)))


def _commands(
    of: Driven, own: StageDrive, pose: Array, load: Array, lever: float, warnings: list[str]
) -> dict[Criterion, Array]:
    """Commands (m,) by criterion; those that stacks which only push cannot meet are left out, which is warned of."""
    found, reason = dict[Criterion, Array](), ""
    for name in CRITERIA:
        try:
            found[name] = commands_for(of, own, pose, load, lever, name)
        except ComputationFailed as failure:
            if name == CRITERIA[0]:
                raise
            warnings.append(f"{name}: {failure}")
            reason = failure.reason if isinstance(failure, Unreachable) and name == "within limits" else ""
    if "within limits" in found:
        used = {name: float(np.max(each)) for name, each in shares(of, own, found["within limits"], load).items()}
        which = max(used, key=lambda name: used[name])
        reason = f"it takes {used[which]:.4g} times its limit of {which}" if used[which] > 1 + ROUND_OFF else ""
    warnings += [f"the drive does not reach this pose: {reason}"] if reason else []
    return found


def _stiffness(
    first: Commanding,
    own: StageDrive,
    forces: Mapping[Criterion, Array],
    load: Array,
    axes: dict[str, tuple[str, ...]],
    warnings: list[str],
) -> dict[str, Array]:
    """Stiffness of the platform without stacks, with them, and with their pushes, by what these go with in (16)."""
    of, engaged = first.of, engaged_stiffness(first.of)
    ways = {way: serial(first.stage, first.result, own.stacks, way) for way in FOLLOWS}
    pushed = {PUSHES[way]: _preloaded(one, own, own.preload, np.zeros(3)) for way, one in ways.items()}
    for name, force in forces.items():
        pushed[f"pushed with the forces by {name}"] = _preloaded(ways["pushed"], own, force, load)
    warnings += [f"no stable equilibrium of the stacks {name}" for name, K in pushed.items() if np.isnan(K).any()]
    C = of.C[:3, :3]
    free = zip(FREE, (1 / np.diag(C), 1 / np.diag(of.engaged)), strict=True)
    states = {"disengaged": np.diag(np.linalg.inv(C)), "engaged": engaged} | pushed | dict(free)
    axes["state"] = tuple(states)
    change = [100 * (K / engaged - 1) if name in pushed else np.full(3, np.nan) for name, K in states.items()]
    found = {"stiffness": np.array(list(states.values())), "change": np.array(change)}
    return found | ({"push_spread": push_spread(first)} if first.result.links else {})


def _preloaded(of: Serial, own: StageDrive, force: Array, load: Array) -> Array:
    """Diagonal (3,) of the stiffness with stacks of forces (n,), N, holding their strokes; nan where it is unstable."""
    try:
        found = loaded(of, force, load)
    except (ComputationFailed, np.linalg.LinAlgError):
        return np.full(3, np.nan)
    return np.diag(found.stiffness(own.stiffness)) if found.stable(own.stiffness) else np.full(3, np.nan)


def _open_loop(
    stage: Stage,
    elements: DrivenElements,
    first: Commanding,
    pose: Array,
    load: Array,
    axes: dict[str, tuple[str, ...]],
) -> dict[str, Array]:
    """Errors of finite elements with strokes of least energy by several models, then by the first after calibration."""
    own, lever = drive_of(stage), stage.chain.link_lengths[2]
    full = calibration(elements.of, first.of, own, lever)
    commanded = {first.result.name: (first, pose)}
    rigid = (None, DEFAULT_FORMULA, False), (21, DEFAULT_FORMULA, False), (21, CALIBRATED, False)
    for choice in ((None, CALIBRATED, True), *rigid):
        with suppress(BadInput):  # off the chart
            one = commanding(ModelChoice(stage, *choice))
            commanded.setdefault(one.result.name, (one, pose))
    gains = 1 / np.diag(np.linalg.inv(full))
    commanded[f"{first.result.name}, three gains"] = first, gains * pose
    commanded[f"{first.result.name}, calibration matrix"] = first, full @ pose
    strokes = [commands_for(model.of, own, to, load, lever, "least energy") for model, to in commanded.values()]
    axes["commanding model"] = tuple(commanded)
    return {"error": np.array([moved(elements.of, own, x, load).pose - pose for x in strokes]), "calibration": full}


def calibration(elements: Driven, model: Driven, own: StageDrive, lever: float) -> Array:
    """Matrix (3, 3) of the pose to command of a model so that finite elements take a pose, both without load."""
    return inverse(elements.poses @ unit_commands(model, own, lever))


def stack_names(of: StageDrive) -> tuple[str, ...]:
    """Names of the stacks (n) of a drive: of its actuators, the second of a pair as the partner."""
    return tuple(f"{of.names[np.flatnonzero(row)[0]]}{', partner' if min(row) < 0 else ''}" for row in of.differential)


def limit_warnings(of: Driven, own: StageDrive, x: Array, load: Array, criterion: Criterion) -> list[str]:
    """Limits that commands (m,) break, a sentence for each kind: how many, and the one farthest beyond."""
    force, stacks, found = own.preload + moved(of, own, x, load).force, stack_names(own), list[str]()
    um, low, high = 1e3 * x, 1e3 * own.lowest, 1e3 * own.highest
    kinds: tuple[tuple[str, Array, tuple[str, ...], Callable[[int], str]], ...] = (  # in the order of `LIMITS`
        (
            "strokes", np.maximum(um - high, low - um), own.names,
            lambda k: f"need {um[k]:.4g} um, outside {low[k]:.4g} to {high[k]:.4g} um",
        ),
        ("contacts", -force, stacks, lambda k: f"have to pull with {-force[k]:.4g} N"),
        (
            "forces", force - own.blocking_force, stacks,
            lambda k: f"have to push with {force[k]:.4g} N, above {own.blocking_force[k]:.4g} N",
        ),
    )  # fmt: skip
    for used, (kind, beyond, names, said) in zip(shares(of, own, x, load).values(), kinds, strict=True):
        broken = np.any(np.reshape(used > 1 + ROUND_OFF, (-1, len(names))), axis=0)
        if broken.any():
            k, count = int(np.argmax(np.where(broken, beyond, -np.inf))), np.count_nonzero(broken)
            found.append(f"{criterion}: {count} {kind} beyond their limits, farthest {names[k]} would {said(k)}")
    return found
