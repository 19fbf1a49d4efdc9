"""The poses that a drive reaches within all its limits: strokes, contacts that only push, blocking forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x <= bounds; so the
poses are a polytope, which linear programs find exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexfem.arrays import Array
from flexfem.refused import ComputationFailed
from flexfem.stage.drives import StageDrive, drive_of
from flexfem.stage.schema import Stage
from flexfem.units import DIRECTIONS, STRESS, Direction
from flexfem.verify import warning
from flexfem.verify.drive_limits import limits_of_commands, preload_stress
from flexfem.verify.driven import SINGULAR, Driven
from flexfem.verify.driven_models import Commanding, best_model, commanding, driven_metal
from flexfem.verify.limits import KINDS
from flexfem.verify.polytope import LinearLimits, NothingAllowed, Polytope, Programs, image
from flexfem.verify.result import Matrix, OfStage, Record, about

ROUND_OFF = 1e-9  # of how far strokes alone go in a direction, and of the size of the poses


class Extent(Record):
    """How far the platform goes in one direction, mm or rad, and by name the limits that stop it at either end."""

    low: float
    high: float
    low_by: list[str]
    high_by: list[str]


class Range(Record):
    """One direction: with the other two held at zero, None where no such pose is reached, and with them free."""

    held: Extent | None
    free: Extent


class PoseFace(Record):
    """One face: `normal` (3,) @ (x, y, lever theta) <= `support`, mm; its vertices, around it; limits that bound it."""

    normal: list[float]
    support: float
    vertices: list[int]
    by: list[str]


class PoseEdge(Record):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: tuple[float, float]
    end: tuple[float, float]
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
    first = commanding(stage, *(model or best_model(stage, warnings)))
    limits = limits_of_commands(stage, first, first.of, drive, load)
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
        else ranges(metal, drive, limits_of_commands(stage, first, metal, drive, load), load),
        warnings=list(dict.fromkeys(warnings + _warnings(stage, first, drive, solid, lever))),
    )


def poses(of: Driven, drive: StageDrive, limits: LinearLimits, load: Array, lever: float) -> Polytope:
    """The poses (x, y, theta) that limits of the commands allow under a load (3,). Raises NothingAllowed.

    Normals and supports are those of (x, y, lever theta), the volume is in mm^2 rad.
    """
    scale, rest = np.array([1.0, 1.0, lever]), of.engaged @ load
    size = _size(of, drive, lever)
    found = image(_programs(limits, drive), scale[:, None] * of.poses / size)
    return found._replace(
        vertices=found.vertices * size / scale + rest,
        supports=found.supports * size + found.normals @ (scale * rest),
        volume=found.volume * size**3 / lever,
    )


def ranges(of: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> dict[Direction, Range]:
    """How far the platform goes in every direction, the others held at zero, and free. Raises NothingAllowed."""
    return {direction: _range(of, drive, limits, of.engaged @ load, axis) for axis, direction in enumerate(DIRECTIONS)}


def _range(of: Driven, drive: StageDrive, limits: LinearLimits, rest: Array, axis: int) -> Range:
    others = [k for k in range(3) if k != axis]
    size = np.abs(of.poses) @ _unit(drive)
    size[size == 0] = 1.0
    along = of.poses[axis] / size[axis]
    held, at = of.poses[others] / size[others, None], -rest[others] / size[others]
    free = _extent(_programs(limits, drive), along, size[axis], rest[axis])
    try:
        return Range(held=_extent(_programs(limits, drive, held, at), along, size[axis], rest[axis]), free=free)
    except NothingAllowed:
        return Range(held=None, free=free)


def _extent(programs: Programs, along: Array, size: float, rest: float) -> Extent:
    low, high = (programs.farthest(sign * along) for sign in (-1.0, 1.0))
    ends = [rest + size * float(found_along) for found_along in (along @ low.x, along @ high.x)]
    ends = [0.0 if abs(end) < ROUND_OFF * size else end for end in ends]
    return Extent(low=ends[0], high=ends[1], low_by=list(low.by), high_by=list(high.by))


def section(of: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> list[PoseEdge]:
    """Edges of the poses at theta = 0, counter-clockwise; none where they have no area."""
    size, rest = _size(of, drive, 1.0), of.engaged @ load
    turning = float(np.abs(of.poses[2]) @ _unit(drive)) or 1.0
    held = _programs(limits, drive, of.poses[2:] / turning, -rest[2:] / turning)
    try:
        found = image(held, of.poses[:2] / size)
    except NothingAllowed:
        return []
    if found.dimension < 2:
        return []
    corners = found.vertices * size + rest[:2]
    edges = []
    for face, normal, by in zip(found.faces, found.normals, found.by, strict=True):
        along = np.array([-normal[1], normal[0]])
        start, end = sorted(face, key=lambda k: float(corners[k] @ along))
        edges.append(PoseEdge(start=tuple(corners[start]), end=tuple(corners[end]), by=list(by)))
    return sorted(edges, key=lambda edge: float(np.arctan2(edge.end[1] - edge.start[1], edge.end[0] - edge.start[0])))


def _programs(limits: LinearLimits, drive: StageDrive, fixed: Array | None = None, at: Array | None = None) -> Programs:
    return Programs(limits, _unit(drive), fixed, at)


def _unit(drive: StageDrive) -> Array:
    """Size (m,) of the commands, mm."""
    return np.maximum(drive.highest, -drive.lowest)


def _size(of: Driven, drive: StageDrive, lever: float) -> float:
    """Size of the poses, rotations times the lever, mm."""
    scale = np.array([1.0, 1.0, lever])
    return float(np.max(scale * (np.abs(of.poses) @ _unit(drive)))) or 1.0


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
            _programs(part, drive).farthest(np.ones(len(drive.names)))
        except NothingAllowed:
            alone.append(kind)
    which = " and those of ".join(alone) if alone else "stroke, contact, blocking force and yield together"
    stress = preload_stress(stage, first, drive)
    under = "under this load" if np.any(load) else "without load"
    loaded = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}" if stress > 1e-3 else ""
    return f"the drive reaches no pose: the limits of {which} allow no commands {under}{loaded}"


def _warnings(stage: Stage, first: Commanding, drive: StageDrive, solid: Polytope, lever: float) -> warning.Warnings:
    found, stress = list[str](), preload_stress(stage, first, drive)
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
