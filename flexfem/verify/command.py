"""`flexfem command`: the strokes for a pose by every criterion, and where the metal goes when it is given them."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexfem.analytic.large import Serial
from flexfem.analytic.model import choose
from flexfem.arrays import Array
from flexfem.mechanism.contacts import Follows
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import actuators_of
from flexfem.questions import warnings as warning
from flexfem.refused import ComputationFailed
from flexfem.units import MICROMETRE
from flexfem.verify import friction, preloaded
from flexfem.verify.driven import (
    CRITERIA,
    ROUND_OFF,
    Criterion,
    Driven,
    Unreachable,
    commands_for,
    moved,
    shares,
    shares_of_each,
)
from flexfem.verify.driven_models import (
    Commanding,
    DrivenMetal,
    across,
    commanding,
    driven_metal,
    element_stresses,
    engaged_stiffness,
    push_spread,
    rotations,
    stresses,
)
from flexfem.verify.open_loop import OpenLoop, calibration, open_loop
from flexfem.verify.result import Matrix, OfStage, Record, about
from flexfem.verify.stack_places import StackPlace, stack_places

MOST_NAMED = 3  # stacks beyond one kind of limit that are warned of one by one; the record has the numbers of all


class Strokes(Record):
    """What one criterion commands: command (m,), stroke beyond rest and force (n,), mm and N, by actuator and stack.

    force : with the preload.   pose : by the commanding model.   metal, stacks : strain energy beyond rest, N mm.
    rotation, stress : (3 chains, 3 hinges), rad beyond rest, and MPa with the preloads.
    share : of the limits of stroke, contact and blocking force, above one where they are broken, None where nothing is
        allowed.
    friction, element_friction : (3,), half-widths, mm, mm, rad, of the poses friction leaves open, a bound: see
        `friction.left_open`; of the model and of finite elements, None without them or without a stated friction.
    preloaded : (3,), as `Command.preloaded` of pushes that go with the pushed bodies, with these forces and the load.
    element_stress : (3, 3), MPa, by finite elements, None without them.
    """

    command: list[float]
    stroke: list[float]
    force: list[float]
    pose: list[float]
    metal: float
    stacks: float
    rotation: Matrix
    stress: Matrix
    element_stress: Matrix | None
    share: dict[str, float | None]
    preloaded: list[float] | None
    friction: list[float] | None
    element_friction: list[float] | None


class Command(OfStage):
    """What `flexfem command` answers; pose and load as asked, N, mm, rad.

    places : of the stacks (n), with their limits.   contacts : what they touch the pushed bodies with, each kind once.
    engaged, disengaged : (3,), stiffness of the platform, with the stacks holding their strokes and without them, each
        direction with the others held, K_ii; `engaged_free`, `disengaged_free` with the others free, 1 / C_ii.
    push_spread : (3,), by how much `engaged` moves, at most, where pushes spread over half and twice the length that is
        assumed, `contacts.SPREAD`; None where the links of the model are rigid.
    preloaded : (3,), the same, engaged, with the second-order terms of the preloads alone in (16), by what a push goes
        with: see `analytic.preload`; None where the preloads leave no stable stage.
    resolution : of the finite elements, None without them.
    open_loop : errors by model, of strokes of least energy; empty without finite elements.
    calibration : (3, 3), which command of the pose makes finite elements take a unit pose, without load.
    stress_accuracy : how far the model's neck stress is from finite elements, in words.
    """

    name: str
    model: str
    pose: list[float]
    load: list[float]
    actuators: list[str]
    stacks: list[str]
    places: list[StackPlace]
    contacts: list[str]
    engaged: list[float]
    disengaged: list[float]
    engaged_free: list[float]
    disengaged_free: list[float]
    push_spread: list[float] | None
    preloaded: dict[Follows, list[float] | None]
    criteria: dict[Criterion, Strokes]
    resolution: int | None
    open_loop: list[OpenLoop]
    calibration: Matrix | None
    stress_accuracy: str


def command(
    stage: Stage,
    pose: Array,
    load: Array,
    model: tuple[int | None, str, bool] | None = None,
    resolution: int | None = None,
) -> Command:
    """Strokes for a pose (3,) under a load (3,), mm, mm, rad and N, N, N mm.

    Parameters
    ----------
    model : mobility, formula, elastic links of the model that computes them; None takes `model.best_model`.
    resolution : of finite elements; None leaves them out.

    Raises BadInput for a stage without actuators, ComputationFailed when no strokes hold the pose.
    """
    drive, lever = drive_of(stage), stage.chain.link_lengths[2]
    warnings = list(warning.of_stage(stage))
    first = commanding(*choose(stage, model, warnings))
    metal = None if resolution is None else driven_metal(stage, resolution)
    found = _by_criterion(first.of, drive, pose, load, lever, warnings)
    joints = preloaded.serials(first.stage, first, drive)
    rubbing = across(first.stage, first, drive)
    criteria = {
        name: _strokes(stage, drive, first, joints["pushed"], rubbing, metal, x, load) for name, x in found.items()
    }
    at_rest = {way: preloaded.stiffness(one, drive, drive.preload, np.zeros(3)) for way, one in joints.items()}
    pushing: dict[str, list[float] | None] = {"the preloads": at_rest["pushed"]}
    pushing |= {f"the forces by {name}": one.preloaded for name, one in criteria.items()}
    warnings += warning.of_unstable(pushing)
    warnings += [text for name, x in found.items() for text in of_limits(first.of, drive, x, load, name)]
    warnings += [text for name, one in criteria.items() for text in _of_yield(stage, name, one)]
    warnings += warning.of_motion(stage, pose, "the pose")
    return Command(
        **about(stage) | {"hash": stage.drive_hash} | stage.drive_doubts._asdict(),
        name=stage.name,
        model=first.name,
        pose=pose.tolist(),
        load=load.tolist(),
        actuators=list(drive.names),
        stacks=stack_names(drive),
        places=stack_places(stage),
        contacts=list(dict.fromkeys(one.contact for chain in actuators_of(stage) for one in chain)),
        engaged=engaged_stiffness(first.of).tolist(),
        disengaged=np.diag(np.linalg.inv(first.of.C[:3, :3])).tolist(),
        engaged_free=(1 / np.diag(first.of.engaged)).tolist(),
        disengaged_free=(1 / np.diag(first.of.C[:3, :3])).tolist(),
        push_spread=push_spread(first.stage, first).tolist() if first.result.links else None,
        preloaded=at_rest,
        criteria=criteria,
        resolution=resolution,
        open_loop=[] if metal is None else open_loop(stage, metal, first, pose, load),
        calibration=None if metal is None else calibration(metal.of, first.of, drive, lever).tolist(),
        stress_accuracy=warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane),
        warnings=list(dict.fromkeys(warnings)),
    )


def _by_criterion(
    of: Driven, drive: StageDrive, pose: Array, load: Array, lever: float, warnings: list[str]
) -> dict[Criterion, Array]:
    """Commands (m,) by criterion; those that stacks which only push cannot meet are left out, which is warned of."""
    found: dict[Criterion, Array] = {CRITERIA[0]: commands_for(of, drive, pose, load, lever, CRITERIA[0])}
    for name in CRITERIA[1:]:
        try:
            found[name] = commands_for(of, drive, pose, load, lever, name)
        except ComputationFailed as failure:
            warnings.append(f"{name}: {failure}")
            if isinstance(failure, Unreachable) and name == "within limits":
                warnings.append(f"the drive does not reach this pose: {failure.reason}")
    used = shares(of, drive, found["within limits"], load) if "within limits" in found else {}
    which = max(used, key=lambda name: used[name], default=None)
    if which is not None and used[which] > 1 + ROUND_OFF:
        warnings.append(f"the drive does not reach this pose: it takes {used[which]:.4g} times its limit of {which}")
    return found


def _strokes(
    stage: Stage,
    drive: StageDrive,
    first: Commanding,
    joints: Serial,
    rubbing: Array,
    metal: DrivenMetal | None,
    x: Array,
    load: Array,
) -> Strokes:
    motion, limits = moved(first.of, drive, x, load), shares(first.of, drive, x, load)
    pushing = motion._replace(force=drive.preload + motion.force)
    held = drive.preload if metal is None else drive.preload + moved(metal.of, drive, x, load).force
    return Strokes(
        command=x.tolist(),
        stroke=(drive.differential @ x).tolist(),
        force=pushing.force.tolist(),
        pose=motion.pose.tolist(),
        metal=motion.metal,
        stacks=motion.stacks,
        rotation=rotations(first.stage, first, motion, load).tolist(),
        stress=stresses(first.stage, first, pushing, load).tolist(),
        element_stress=None if metal is None else element_stresses(stage, metal, drive, x, load).tolist(),
        share={name: used if np.isfinite(used) else None for name, used in limits.items()},
        preloaded=preloaded.stiffness(joints, drive, pushing.force, load),
        friction=friction.left_open(first.of, rubbing, drive, pushing.force),
        element_friction=None if metal is None else friction.left_open(metal.of, metal.across, drive, held),
    )


def stack_names(drive: StageDrive) -> list[str]:
    """Names of the stacks (n) of a drive: of its actuators, the second of a pair as the partner."""
    signs = {1.0: "", -1.0: ", partner"}
    rows = [int(np.flatnonzero(row)[0]) for row in drive.differential]
    return [drive.names[k] + signs[float(row[k])] for k, row in zip(rows, drive.differential, strict=True)]


def of_limits(of: Driven, drive: StageDrive, x: Array, load: Array, criterion: Criterion) -> warning.Warnings:
    """Limits that commands (m,) break: strokes by actuator, a pair as one, and forces by stack; of many the worst."""
    broken = {name: used > 1 + ROUND_OFF for name, used in shares_of_each(of, drive, x, load).items()}
    force, stacks, um = drive.preload + moved(of, drive, x, load).force, stack_names(drive), MICROMETRE
    pairs = np.count_nonzero(drive.differential, axis=0) == 2
    strokes = {
        k: f"{'the pair' if pairs[k] else 'the stack'} {drive.names[k]} would need a stroke of {um.factor * x[k]:.4g} "
        f"{um.plain}, outside {um.factor * drive.lowest[k]:.4g} to {um.factor * drive.highest[k]:.4g} {um.plain}"
        for k in np.flatnonzero(np.any(broken["stroke"].reshape(2, -1), axis=0))
    }
    pulls = {
        k: f"the stack {stacks[k]} would have to pull with {-force[k]:.4g} N, but its contact opens at 0 N"
        for k in np.flatnonzero(broken["contact"])
    }
    pushes = {
        k: f"the stack {stacks[k]} would have to push with {force[k]:.4g} N, above its blocking force of "
        f"{drive.blocking_force[k]:.4g} N"
        for k in np.flatnonzero(broken["blocking"])
    }
    kinds = (
        _summed_up(strokes, "strokes are", np.maximum(x - drive.highest, drive.lowest - x)),
        _summed_up(pulls, "contacts are", -force),
        _summed_up(pushes, "forces are", force - drive.blocking_force),
    )
    return [f"{criterion}: {said}" for kind in kinds for said in kind]


def _summed_up(sentences: dict[Any, str], what: str, beyond: Array) -> list[str]:
    """Sentences by stack, or of more than `MOST_NAMED` their number and that on the one farthest beyond its limit."""
    if len(sentences) <= MOST_NAMED:
        return list(sentences.values())
    worst = max(sentences, key=lambda k: float(beyond[k]))
    return [f"{len(sentences)} {what} beyond their limits; the worst: {sentences[worst]}"]


def _of_yield(stage: Stage, criterion: str, found: Strokes) -> warning.Warnings:
    highest = float(np.max(found.element_stress if found.element_stress is not None else found.stress))
    return warning.of_yield(highest, stage.material.yield_strength, f"strokes of {criterion}")
