"""The poses that a drive reaches within all its limits: strokes, contacts that only push, blocking forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x <= bounds; so the
poses are a polytope, which linear programs find exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexfem.analytic.model import choose
from flexfem.arrays import Array
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.refused import ComputationFailed
from flexfem.units import STRESS, Direction
from flexfem.verify.drive_limits import limits_of_commands, preload_stress
from flexfem.verify.driven import SINGULAR
from flexfem.verify.driven_models import Commanding, commanding, driven_metal
from flexfem.verify.limits import KINDS
from flexfem.verify.polytope import LinearLimits, NothingAllowed, Polytope
from flexfem.verify.pose_set import ROUND_OFF, PoseEdge, Range, poses, programs, ranges, section
from flexfem.verify.result import Matrix, OfStage, Record, about


class PoseFace(Record):
    """One face: `normal` (3,) @ (x, y, lever theta) <= `support`, mm; its vertices, around it; limits that bound it."""

    normal: list[float]
    support: float
    vertices: list[int]
    by: list[str]


class Reach(OfStage):
    """All poses that a drive reaches within its limits under a load, N, N, N mm; mm and rad.

    lever : l3, mm, by which rotations are made comparable with translations.
    rest : (3,), pose of zero commands.   ranges : by direction.
    dimension : of the set of poses, 3 of a solid.   vertices : (v, 3), poses.   commands : (v, m), mm, one for each.
    faces : of a solid.   volume : of a solid, mm^2 rad.
    section : edges of its section at theta = 0, counter-clockwise, empty where that has no area.
    circle, ball : radius about `rest`, mm, of the largest circle of translations, and of the largest ball of all poses
        with rotations times the lever, that are reached.
    elements : ranges by finite elements, of `resolution`; neck stresses there by the model's necks.
    stress_accuracy : how far that neck stress is from finite elements, and where limits of yield are, in words.
    """

    name: str
    model: str
    load: list[float]
    actuators: list[str]
    lever: float
    rest: list[float]
    ranges: dict[Direction, Range]
    dimension: int
    vertices: Matrix
    commands: Matrix
    faces: list[PoseFace]
    volume: float
    section: list[PoseEdge]
    circle: float
    ball: float
    resolution: int | None
    elements: dict[Direction, Range] | None
    stress_accuracy: str


def reach(
    stage: Stage,
    load: Array,
    model: tuple[int | None, str, bool] | None = None,
    resolution: int | None = None,
) -> Reach:
    """The poses that the drive of a stage reaches under a load (3,), N, N, N mm; other arguments as of `command`.

    Raises BadInput for a stage without actuators, ComputationFailed when its limits allow no pose at all.
    """
    drive, lever = drive_of(stage), stage.chain.link_lengths[2]
    warnings = list(warning.of_stage(stage))
    first = commanding(*choose(stage, model, warnings))
    limits = limits_of_commands(first.stage, first, first.of, drive, load)
    try:
        solid = poses(first.of, drive, limits, load, lever)
    except NothingAllowed:
        raise ComputationFailed(_why_nothing(stage, first, limits, drive, load)) from None
    rest, edges = first.of.engaged @ load, section(first.of, drive, limits, load)
    metal = None if resolution is None else driven_metal(stage, resolution).of
    return Reach(
        **about(stage) | {"hash": stage.drive_hash} | stage.drive_doubts._asdict(),
        name=stage.name,
        model=first.name,
        load=load.tolist(),
        actuators=list(drive.names),
        lever=lever,
        rest=rest.tolist(),
        ranges=ranges(first.of, drive, limits, load),
        dimension=solid.dimension,
        vertices=solid.vertices.tolist(),
        commands=solid.commands.tolist(),
        faces=[] if solid.dimension < 3 else _faces(solid),
        volume=solid.volume if solid.dimension == 3 else 0.0,
        section=edges,
        circle=_circle(edges, rest),
        ball=_ball(solid, rest, lever),
        resolution=resolution,
        elements=None
        if metal is None
        else ranges(metal, drive, limits_of_commands(first.stage, first, metal, drive, load), load),
        stress_accuracy=warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane),
        warnings=list(dict.fromkeys(warnings + _warnings(stage, first, drive, solid, lever))),
    )


def _faces(of: Polytope) -> list[PoseFace]:
    return [
        PoseFace(normal=normal.tolist(), support=float(support), vertices=list(vertices), by=list(by))
        for normal, support, vertices, by in zip(of.normals, of.supports, of.faces, of.by, strict=True)
    ]


def _circle(edges: Sequence[PoseEdge], rest: Array) -> float:
    """Least distance of the edges of a section from `rest` (3,), 0 where it is not inside."""
    start, end = (np.array([getattr(edge, name) for edge in edges]).reshape(-1, 2) for name in ("start", "end"))
    along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    to_rest = rest[:2] - start
    distance = along[:, 0] * to_rest[:, 1] - along[:, 1] * to_rest[:, 0]
    size = float(np.max(np.abs(start), initial=0.0))
    return _inside(float(np.min(distance, initial=np.inf)), size) if edges else 0.0


def _ball(of: Polytope, rest: Array, lever: float) -> float:
    """Least distance of the faces of a solid from `rest` (3,), 0 where it is not inside."""
    if of.dimension < 3:
        return 0.0
    size = float(np.max(np.abs(of.supports)))
    return _inside(float(np.min(of.supports - of.normals @ (np.array([1.0, 1.0, lever]) * rest))), size)


def _inside(distance: float, size: float) -> float:
    """A distance from edges or faces; 0 outside, and where it is round-off of poses of a size."""
    return distance if distance > ROUND_OFF * size else 0.0


def _why_nothing(stage: Stage, first: Commanding, limits: LinearLimits, drive: StageDrive, load: Array) -> str:
    """Which limits allow no commands, each by itself with those of strokes, or only together."""
    alone = []
    for kind in KINDS:
        chosen = np.array([limits.names[k].startswith((KINDS[0], kind)) for k in limits.owner])
        part = LinearLimits(limits.rows[chosen], limits.bounds[chosen], limits.owner[chosen], limits.names)
        try:
            programs(part, drive).farthest(np.ones(len(drive.names)))
        except NothingAllowed:
            alone.append(kind)
    which = " and those of ".join(alone) if alone else "stroke, contact, blocking force and yield together"
    stress = preload_stress(first.stage, first, drive)
    under = "under this load" if np.any(load) else "without load"
    loaded = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}" if stress > 1e-3 else ""
    return f"the drive reaches no pose: the limits of {which} allow no commands {under}{loaded}"


def _warnings(stage: Stage, first: Commanding, drive: StageDrive, solid: Polytope, lever: float) -> warning.Warnings:
    found, stress = list[str](), preload_stress(first.stage, first, drive)
    single = np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, single]).T @ drive.preload > 0):
        found.append(
            f"single stacks have no partner to bear their preload: the necks do, with up to {stress:.4g} {STRESS} at "
            "zero commands (no spring that would bear it instead is in the model)"
        )
    values = np.linalg.svd(np.array([[1.0], [1.0], [lever]]) * first.of.poses, compute_uv=False)
    moves = int(np.count_nonzero(values > SINGULAR * values[0])) if values[0] > 0 else 0
    if moves < 3:
        found.append(f"the drive moves the platform in {moves} of three directions: its poses are no solid")
    elif solid.dimension < 3:
        extends = ("are a single one", "lie on a line", "lie in a plane")[solid.dimension]
        found.append(f"the limits leave no solid: the poses that the drive reaches {extends}")
    far = np.max(np.abs(solid.vertices), axis=0)
    return found + warning.of_motion(stage, far, "the farthest poses of the drive")
