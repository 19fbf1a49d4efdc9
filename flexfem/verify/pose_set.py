"""The set of poses that limits of the commands allow: the polytope, its ranges along the axes, its section."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.drives import StageDrive
from flexfem.units import DIRECTIONS, Direction
from flexfem.verify.driven import Driven
from flexfem.verify.polytope import LinearLimits, NothingAllowed, Polytope, Programs, image
from flexfem.verify.result import Record

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


class PoseEdge(Record):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: tuple[float, float]
    end: tuple[float, float]
    by: list[str]


def poses(of: Driven, drive: StageDrive, limits: LinearLimits, load: Array, lever: float) -> Polytope:
    """The poses (x, y, theta) that limits of the commands allow under a load (3,). Raises NothingAllowed.

    Normals and supports are those of (x, y, lever theta), the volume is in mm^2 rad.
    """
    scale, rest = np.array([1.0, 1.0, lever]), of.engaged @ load
    size = _size(of, drive, lever)
    found = image(programs(limits, drive), scale[:, None] * of.poses / size)
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
    free = _extent(programs(limits, drive), along, size[axis], rest[axis])
    try:
        return Range(held=_extent(programs(limits, drive, held, at), along, size[axis], rest[axis]), free=free)
    except NothingAllowed:
        return Range(held=None, free=free)


def _extent(allowed: Programs, along: Array, size: float, rest: float) -> Extent:
    low, high = (allowed.farthest(sign * along) for sign in (-1.0, 1.0))
    ends = [rest + size * float(found_along) for found_along in (along @ low.x, along @ high.x)]
    ends = [0.0 if abs(end) < ROUND_OFF * size else end for end in ends]
    return Extent(low=ends[0], high=ends[1], low_by=list(low.by), high_by=list(high.by))


def section(of: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> list[PoseEdge]:
    """Edges of the poses at theta = 0, counter-clockwise; none where they have no area."""
    size, rest = _size(of, drive, 1.0), of.engaged @ load
    turning = float(np.abs(of.poses[2]) @ _unit(drive)) or 1.0
    held = programs(limits, drive, of.poses[2:] / turning, -rest[2:] / turning)
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
        start, *_, end = sorted(face, key=lambda k: float(corners[k] @ along))
        edges.append(PoseEdge(start=tuple(corners[start]), end=tuple(corners[end]), by=list(by)))
    return sorted(edges, key=lambda edge: float(np.arctan2(edge.end[1] - edge.start[1], edge.end[0] - edge.start[0])))


def programs(limits: LinearLimits, drive: StageDrive, fixed: Array | None = None, at: Array | None = None) -> Programs:
    return Programs(limits, _unit(drive), fixed, at)


def _unit(drive: StageDrive) -> Array:
    """Size (m,) of the commands, mm."""
    return np.maximum(drive.highest, -drive.lowest)


def _size(of: Driven, drive: StageDrive, lever: float) -> float:
    """Size of the poses, rotations times the lever, mm."""
    scale = np.array([1.0, 1.0, lever])
    return float(np.max(scale * (np.abs(of.poses) @ _unit(drive)))) or 1.0
