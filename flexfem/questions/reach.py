"""The poses that a drive reaches within all its limits: strokes, contacts that only push, blocking forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x <= bounds; so the
poses are a polytope. The convex hull of points that linear programs found lies within it, and the planes that programs
found hold it in: once every plane of the hull is one of these, both are the same.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import AnyArray, Array, Index
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import warnings as warning
from flexfem.questions.drive import LARGEST_LOAD, Commanding, commanding, driven_elements, stack_names
from flexfem.questions.driven import (
    LIMITS,
    SINGULAR,
    Driven,
    limits_of,
    limits_of_necks,
    linear_program,
    per_command,
    sections_of,
)
from flexfem.questions.setup import DEFAULT, Analytic, about, mesh_of, meshed, question
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SOLVED, Quantity, Result
from flexfem.units import DIRECTIONS, STRESS

KINDS = (*LIMITS, "yield")  # what the name of a limit begins with, before " of "
EXACT = 1e-9  # of limits and of the largest coordinate: what programs may break them by, and hulls may miss
ROUND_OFF = 1e-9  # of how far strokes alone go in a direction, and of the size of the poses
FLAT = 1e-7  # of the largest coordinate: a set no wider in some direction has no extent in it
MULTIPLIER = 1e-6  # of the largest: a limit with a smaller multiplier does not bind
MOST = 300  # vertices of all poses: curved limits of yield would have many thousands; shipped stages have at most 64
EXTENDS = ("are a single one", "lie on a line", "lie in a plane")  # poses that are no solid, by dimension


class Reach(Result):
    """The poses that a drive reaches within its limits: ranges along the axes, and the polytope of all poses."""

    title = "poses that the drive reaches within all limits"
    labels: ClassVar = {"others": ("zero", "free"), "end": ("low", "high")}
    figure = "drive.reach_figure"
    drawn_from_fields = True
    reading = (
        "limits: stroke, contacts that only push, blocking force, yield at the necks of the analytic model; linear",
    )
    load = Quantity("load on the platform", "wrench", ("direction",), shown=False)
    ends = Quantity(
        "ends of the ranges, the other directions zero or free", "motion", ("others", "end", "model", "direction"),
        FRESH, "pose", prefixed=True,
    )  # fmt: skip
    rest = Quantity("pose of zero commands", "motion", ("direction",), SOLVED, "pose", prefixed=True)
    circle = Quantity("radius about rest in X and Y at theta 0", "um", (), SOLVED)
    ball = Quantity("radius about rest, rotations times the lever", "um", (), SOLVED)
    volume = Quantity("volume of all poses", "um2_mrad", (), SOLVED)
    vertices = Quantity("vertices of all poses", "motion", ("vertex", "direction"), SOLVED, "all", shown=False)
    commands = Quantity("strokes of the actuators there", "um", ("vertex", "actuator"), SOLVED, "all", shown=False)


class NothingAllowed(Exception):  # noqa: N818
    """No commands keep all limits."""


class LinearLimits(NamedTuple):
    """Limits (k) on commands (m,): rows @ x <= bounds, those of strokes first, and their names "kind of place" (k,)."""

    rows: Array
    bounds: Array
    names: AnyArray


class LimitNames(tuple[str, ...]):
    """Names of the limits that bound something, each "kind of place"."""

    @property
    def by_kind(self) -> dict[str, list[str]]:
        """Places by the kind of limit, in the order of `KINDS`."""
        split = [name.split(" of ", 1) for name in self]
        return {kind: places for kind in KINDS if (places := [place for own, place in split if own == kind])}

    @property
    def kinds(self) -> tuple[str, ...]:
        """What kinds of limits these are, in the order of `KINDS`."""
        return tuple(self.by_kind)

    def __str__(self) -> str:
        """All in a line, kind by kind."""
        return "; ".join(f"{kind}: {' | '.join(places)}" for kind, places in self.by_kind.items())


class Polytope(NamedTuple):
    """All poses y = (x, y, lever theta), mm, that limits allow; without vertices and faces where they are no solid.

    vertices : (v, 3), mm, mm, rad.   commands : (v, m), that lead there.   volume : mm^2 rad.
    normals, supports : (f, 3), (f,), mm: normal @ y <= support on every face.
    faces : of each its vertices, counter-clockwise seen from outside.   by : of each the limits.
    missed : how far beyond the faces poses are reached at most, of the largest coordinate; 0 but with `MOST` vertices.
    """

    dimension: int
    vertices: Array
    commands: Array
    normals: Array
    supports: Array
    faces: list[list[int]]
    by: list[LimitNames]
    volume: float
    missed: float = 0.0


class PoseEdge(NamedTuple):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: Array
    end: Array
    by: LimitNames


Stops = dict[tuple[str, str, str], LimitNames]  # by ("zero" or "free", direction, "low" or "high")


class ReachedPoses(NamedTuple):
    """What bounds the poses: faces of all, edges of the section, and each end of the ranges that any pose is in."""

    solid: Polytope
    section: list[PoseEdge]
    stops: Stops


@question
def reach(
    stage: Stage,
    *,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
) -> Reach:
    """The poses that a drive reaches within its limits: strokes, contacts that only push, blocking forces, yield.

    Parameters
    ----------
    load : tuple of float
        Load on the platform: N, N, N mm.
    models : {"both", "analytic"}
        Whether finite elements have the ranges along the axes, too.
    resolution : int, optional
        Triangles across every neck.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> [round(1e3 * float(x), 1) for x in found.at("ends", end="high", model="analytic", direction="x")]  # um
    [24.0, 28.6]
    """
    check_feasible(stage)
    mesh, F = mesh_of(models, resolution, None, 2), arguments.vectors("load", load, 1, LARGEST_LOAD)
    drive, lever, warnings = drive_of(stage), stage.chain.link_lengths[2], list(warning.of_stage(stage))
    first = commanding(analytic.chosen(stage, warnings))
    limits = limits_of_commands(first, first.system, drive, F)
    poses = PoseSet(first.system, drive, limits, F)
    try:
        solid = poses.solid(lever)
    except NothingAllowed:
        raise ComputationFailed(_why_nothing(first, limits, drive, F)) from None
    ends, stops = poses.ranges()
    found = {ANALYTIC: ends}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution).system
        found[ELEMENTS] = PoseSet(elements, drive, limits_of_commands(first, elements, drive, F), F).ranges()[0]
    values: dict[str, Any] = {
        "load": F,
        "ends": np.stack(list(found.values()), axis=2),
        "rest": poses.rest,
        "circle": _radius(solid, poses.rest * [1, 1, 0], 2),
        "ball": _radius(solid, poses.rest * [1, 1, lever], 3),
        "volume": solid.volume,
        "vertices": solid.vertices,
        "commands": solid.commands,
    }
    warnings += _warnings(first, drive, solid, lever)
    warnings += warning.of_motion(stage, np.max(np.abs(ends[1]), axis=0), "the farthest poses of the drive")
    notes = [
        f"{direction}, others {others}: "
        + "; ".join(f"{end} end stopped by {stops[others, direction, end]}" for end in ("low", "high"))
        for others in ("zero", "free")
        for direction in DIRECTIONS
        if (others, direction, "low") in stops
    ]
    notes.append(f"all poses: {len(solid.vertices)} vertices, {len(solid.faces)} faces")
    if solid.missed:
        notes[-1] += f"; some poses are up to {100 * solid.missed:.2g} % of the largest beyond these faces"
    notes.append(warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane))
    axes = {"model": tuple(found), "actuator": drive.names, "vertex": [f"{k + 1}" for k in range(len(solid.vertices))]}
    settings = {"analytic model": first.result.name} | meshed(mesh)
    return Reach(
        about(stage, drive=True), values, None, axes, settings, warnings, notes,
        ReachedPoses(solid, section_of(solid), stops),
    )  # fmt: skip


def limits_of_commands(first: Commanding, of: Driven, drive: StageDrive, load: Array) -> LinearLimits:
    """Every limit of the commands (m,) of a driven stage under a load (3,), with the names that users see.

    first : the model whose necks carry what the stacks of `of` push with; they bear `YIELD_MARGIN` less than the yield
        strength. The preloads of a pair bear on each other; that of a single stack stresses the necks.
    """
    stage, frames = first.stage, stage_frames(first.stage)
    force = drive.preload - of.Y @ of.C[3:, :3] @ load
    strength = stage.material.yield_strength * (1 - warning.YIELD_MARGIN[stage.model])
    at = sections_of(lower(stage))[:, 0]
    yields = limits_of_necks(at, per_command(of, frames, first.model.necks), first.carried(load, force), strength)
    own = limits_of(of, drive, load)
    every = [*(own[kind] for kind in LIMITS), yields]
    names = [f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names]
    names += [f"{kind} of {name}" for kind in LIMITS[1:] for name in stack_names(drive)]
    places = [f"yield of the {hinge} hinge, chain {chain}" for chain in CHAINS for hinge in HINGE_NAMES]
    return LinearLimits(
        np.concatenate([each.rows for each in every]),
        np.concatenate([each.offsets + each.sizes for each in every]),
        np.array([*names, *np.repeat(places, len(yields.rows) // 9)]),
    )


class PoseSet:
    """The poses G x + rest (3,) of the commands x that limits allow under a load (3,).

    Limits are taken into the linear programs once they are broken, and stay: of the many on stresses, few ever are.
    """

    def __init__(self, of: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> None:
        self.G, self.names, self.rest = of.poses, limits.names, np.asarray(of.engaged @ load)
        self.unit = np.maximum(drive.highest, -drive.lowest)  # (m,), mm, size of the commands
        self.far = np.abs(self.G) @ self.unit  # (3,), how far strokes alone go
        self.size = np.where(self.far > 0, self.far, 1.0)
        rows = limits.rows * self.unit
        size = np.max(np.abs(rows), axis=1)
        size[size == 0] = np.maximum(np.abs(limits.bounds[size == 0]), 1.0)
        self.rows, self.bounds = rows / size[:, None], limits.bounds / size
        self.taken = np.arange(len(rows)) < 2 * len(self.unit)  # limits of strokes: every program is bounded

    def farthest(self, c: Array, zero: tuple[int, ...] = ()) -> tuple[Array, LimitNames]:
        """The commands x with the largest c (m,) @ x, some directions of the pose at zero, and the limits there.

        Raises NothingAllowed.
        """
        cost, at = c * self.unit, list(zero)
        cost = cost / (np.max(np.abs(cost)) or 1.0)
        equal = self.G[at] * self.unit / self.size[at, None], -self.rest[at] / self.size[at]
        while True:
            limits = {"A_ub": self.rows[self.taken], "b_ub": self.bounds[self.taken], "bounds": (None, None)}
            found = linear_program(-cost, **limits, A_eq=equal[0], b_eq=equal[1])
            if found is None:
                raise NothingAllowed
            beyond = np.where(self.taken, 0.0, self.rows @ found.x - self.bounds)
            worst = np.argsort(beyond)[-2 * len(cost) :]
            if beyond[worst[-1]] <= EXACT:
                break
            self.taken[worst[beyond[worst] > EXACT]] = True
        multipliers = -found.ineqlin.marginals
        binding = np.flatnonzero(self.taken)[multipliers > MULTIPLIER * max(np.max(multipliers), MULTIPLIER)]
        return found.x * self.unit, LimitNames(dict.fromkeys(self.names[binding].tolist()))

    def ranges(self) -> tuple[Array, Stops]:
        """Ends (2 others zero or free, 2 low and high, 3), nan where no pose is reached, and what stops them.

        Raises NothingAllowed.
        """
        ends, stops = np.full((2, 2, 3), np.nan), Stops()
        for axis, direction in enumerate(DIRECTIONS):
            others_of = {"zero": tuple(k for k in range(3) if k != axis), "free": ()}
            for row, (others, zero) in enumerate(others_of.items()):
                for column, (end, sign) in enumerate({"low": -1.0, "high": 1.0}.items()):
                    try:
                        x, by = self.farthest(sign * self.G[axis], zero)
                    except NothingAllowed:
                        if others == "free":
                            raise
                        continue
                    value = float(self.rest[axis] + self.G[axis] @ x)
                    ends[row, column, axis] = 0.0 if abs(value) < ROUND_OFF * self.size[axis] else value
                    stops[others, direction, end] = by
        return ends, stops

    def solid(self, lever: float) -> Polytope:
        """All poses. Raises NothingAllowed."""
        scale = np.array([1.0, 1.0, lever])
        size = float(np.max(scale * self.far)) or 1.0
        G = scale[:, None] * self.G / size
        commands, dimension = self._spanning(G)
        if dimension < 3:
            return Polytope(dimension, np.zeros((0, 3)), commands[:0], np.zeros((0, 3)), np.zeros(0), [], [], 0.0)
        commands, missed = self._refined(G, commands)
        poses = commands @ self.G.T + self.rest
        commands = commands[np.lexsort(np.round(poses / np.max(np.abs(poses), axis=0), 6).T)]  # whatever round-off does
        corners, sets, volume = _corners_and_faces(commands @ G.T)
        commands = commands[corners]
        Z, faces, normals = commands @ G.T, [], []
        for face in sets:
            arms = Z[face] - np.mean(Z[face], axis=0)
            normal = np.linalg.svd(arms)[2][-1]
            normal *= np.sign(normal @ np.mean(Z[face] - np.mean(Z, axis=0), axis=0))
            around = np.arctan2(arms @ np.cross(normal, arms[0]), arms @ arms[0])
            faces.append([face[k] for k in np.argsort(around)])
            normals.append(normal)
        by = [self.farthest(normal @ G)[1] for normal in normals]
        supports = np.max(np.array(normals) @ Z.T, axis=1) * size + normals @ (scale * self.rest)
        poses, volume = commands @ self.G.T + self.rest, volume * size**3 / lever
        return Polytope(3, poses, commands, np.array(normals), supports, faces, by, volume, missed)

    def _spanning(self, G: Array) -> tuple[Array, int]:
        """Commands whose images under G (3, m) span the set, and its dimension."""
        X, dimension = self.farthest(G[0])[0][None], -1
        while True:
            _, values, axes = np.linalg.svd((X - X[0]) @ G.T)
            before, dimension = dimension, int(np.count_nonzero(values > FLAT))
            if dimension in (before, 3):
                return X, dimension
            new = [self.farthest(sign * w @ G)[0] for w in axes[dimension:] for sign in (1.0, -1.0)]
            X = np.concatenate([X, new])

    def _refined(self, G: Array, commands: Array) -> tuple[Array, float]:
        """Commands whose images' convex hull is the set, farthest ones along its planes, and how far it misses some."""
        from scipy.spatial import ConvexHull

        supports = dict[tuple[float, ...], float]()  # of the set, by the normal of a plane of the hull
        while True:
            planes = {tuple(np.round(plane[:3], 10) + 0.0): plane for plane in ConvexHull(commands @ G.T).equations}
            fresh = list[tuple[float, Array]]()
            for key, plane in planes.items():
                if key not in supports:
                    x = self.farthest(plane[:3] @ G)[0]
                    supports[key] = float(plane[:3] @ G @ x)
                    fresh.append((supports[key] + plane[3], x))
            farthest = [x for far, x in sorted(fresh, key=lambda each: -each[0]) if far > EXACT]
            if not farthest or len(commands) >= MOST:
                missed = float(max(supports[key] + plane[3] for key, plane in planes.items()))
                return commands, missed / float(np.max(np.abs(commands @ G.T))) if missed > EXACT else 0.0
            commands = np.concatenate([commands, farthest[: MOST - len(commands)]])


def _corners_and_faces(Z: Array) -> tuple[Index, list[list[int]], float]:
    """Of the hull of points (p, 3): the indices of its vertices, which of these each face has, and its volume."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(Z)
    normals = hull.equations[:, :3]
    touches = np.abs(Z @ normals.T + hull.equations[:, 3]) < 10 * EXACT
    corners = np.flatnonzero([np.linalg.matrix_rank(normals[row], tol=FLAT) == 3 for row in touches])
    near = np.max(np.abs(Z[corners][:, None] - Z[corners]), axis=2) < 10 * EXACT
    corners = corners[~np.any(np.tril(near, -1), axis=1)]  # each once
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in touches[corners].T}
    return corners, sorted(sorted(one) for one in sets if not any(one < other for other in sets)), float(hull.volume)


def section_of(solid: Polytope) -> list[PoseEdge]:
    """Edges of the poses at theta = 0, counter-clockwise: what all other faces leave of the line of each face."""
    size, edges = np.max(np.abs(solid.supports), initial=0.0), []
    normals, supports = solid.normals[:, :2], solid.supports
    for normal, support, by in zip(normals, supports, solid.by, strict=True):
        length = np.linalg.norm(normal)
        if length < FLAT:
            continue
        along, foot = np.array([-normal[1], normal[0]]) / length, support * normal / length**2
        rate, left = normals @ along, supports - normals @ foot  # rate t <= left on the line foot + t along
        parallel = np.abs(rate) < FLAT
        start = np.max(left[rate <= -FLAT] / rate[rate <= -FLAT], initial=-np.inf)
        end = np.min(left[rate >= FLAT] / rate[rate >= FLAT], initial=np.inf)
        if np.all(left[parallel] >= -EXACT * size) and end - start > ROUND_OFF * size:
            edges.append(PoseEdge(foot + start * along, foot + end * along, by))
    return sorted(edges, key=lambda edge: float(np.arctan2(*(edge.end - edge.start)[::-1])))


def _radius(solid: Polytope, centre: Array, directions: int) -> float:
    """Distance of the faces, in the first directions alone, from a point (3,), mm; 0 where it is not inside."""
    tilt = np.maximum(np.linalg.norm(solid.normals[:, :directions], axis=1), FLAT)
    distance = float(np.min((solid.supports - solid.normals @ centre) / tilt, initial=np.inf)) if solid.faces else 0.0
    return distance if distance > ROUND_OFF * np.max(np.abs(solid.supports), initial=0.0) else 0.0


def _why_nothing(first: Commanding, limits: LinearLimits, drive: StageDrive, load: Array) -> str:
    """Which limits allow no commands, each by itself with those of strokes, or only together."""
    alone = []
    for kind in KINDS:
        chosen = np.array([name.startswith((KINDS[0], kind)) for name in limits.names])
        try:
            PoseSet(first.system, drive, LinearLimits(*(part[chosen] for part in limits)), load).farthest(drive.highest)
        except NothingAllowed:
            alone.append(kind)
    which = " and those of ".join(alone) if alone else "stroke, contact, blocking force and yield together"
    stress, under = _preload_stress(first, drive), "under this load" if np.any(load) else "without load"
    loaded = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}" if stress > 1e-3 else ""
    return f"the drive reaches no pose: the limits of {which} allow no commands {under}{loaded}"


def _preload_stress(first: Commanding, drive: StageDrive) -> float:
    """Highest stress of a neck by the preloads alone, MPa: the two of a pair bear on each other, and stress none."""
    return float(np.max(first.stress(np.zeros(3), drive.preload)))


def _warnings(first: Commanding, drive: StageDrive, solid: Polytope, lever: float) -> list[str]:
    found, single = list[str](), np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, single]).T @ drive.preload > 0):
        found.append(
            "single stacks have no partner to bear their preload: the necks do, with up to "
            f"{_preload_stress(first, drive):.4g} {STRESS} at zero commands (no spring that would bear it is in the "
            "model)"
        )
    moves = np.linalg.matrix_rank(np.array([[1.0], [1.0], [lever]]) * first.system.poses, rtol=SINGULAR)
    if moves < 3:
        found.append(f"the drive moves the platform in {moves} of three directions: its poses are no solid")
    elif solid.dimension < 3:
        found.append(f"the limits leave no solid: the poses that the drive reaches {EXTENDS[solid.dimension]}")
    return found
