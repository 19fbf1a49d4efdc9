"""The poses that a drive reaches within all its limits: strokes, unilateral contacts, blocking forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x <= bounds, so the
poses form a polytope. It contains the convex hull of vertices found by linear programs, and the supporting planes of
these programs bound it. Once every plane of the hull is a supporting plane, hull and polytope are identical.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import AnyArray, Array, Index
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import actuators
from flexfem.questions import warnings as warning
from flexfem.questions.actuators import MechanismReach
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
from flexfem.questions.setup import DEFAULT, Analytic, about, for_mechanisms, mesh_of, meshed, question, usual_solid
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SOLVED, Quantity, Result
from flexfem.units import DIRECTIONS, STRESS

KINDS = (*LIMITS, "yield")  # first part of the name of a limit, before " of "
EXACT = 1e-9  # of limits and of the largest coordinate: tolerance of linear programs and of the hull
ROUND_OFF = 1e-9  # of the extent by strokes alone in a direction, and of the size of the poses
FLAT = 1e-7  # of the largest coordinate: smallest width of a set in a direction that counts as an extent
MULTIPLIER = 1e-6  # of the largest: a limit with a smaller multiplier is not binding
MOST = 300  # vertices of all poses: curved yield limits would give many thousands; shipped stages have at most 64
EXTENDS = ("are a single pose", "lie on a line", "lie in a plane")  # poses that are not solid, by dimension


class Reach(Result):
    """The poses that a drive reaches within its limits: ranges along the axes, and the polytope of all poses."""

    title = "poses that the drive reaches within all limits"
    main = ("ends", {"others": "zero"})
    labels: ClassVar = {"others": ("zero", "free"), "end": ("low", "high")}
    figure = "drive.reach_figure"
    drawn_from_fields = True
    reading = (
        "limits: stroke, contacts without tension, blocking force, and yield of the necks by the linear analytic model",
    )
    load = Quantity("load on the platform", "wrench", ("direction",), shown=False)
    ends = Quantity(
        "ends of the ranges, other directions zero or free", "motion", ("others", "end", "model", "direction"),
        FRESH, "pose", prefixed=True,
    )  # fmt: skip
    rest = Quantity("pose at zero commands", "motion", ("direction",), SOLVED, "pose", prefixed=True)
    circle = Quantity("radius of the largest circle about rest at theta 0", "um", (), SOLVED)
    ball = Quantity("radius of the largest ball about rest, theta times lever", "um", (), SOLVED)
    volume = Quantity("volume of all poses", "um2_mrad", (), SOLVED)
    vertices = Quantity("vertices of all poses", "motion", ("vertex", "direction"), SOLVED, "all", shown=False)
    commands = Quantity("actuator strokes at the vertices", "um", ("vertex", "actuator"), SOLVED, "all", shown=False)


class NothingAllowed(Exception):  # noqa: N818
    """No commands satisfy all limits."""


class LinearLimits(NamedTuple):
    """Limits (k) on commands (m,): rows @ x <= bounds, those of strokes first, and their names "kind of place" (k,)."""

    rows: Array
    bounds: Array
    names: AnyArray


class LimitNames(tuple[str, ...]):
    """Names of binding limits, each "kind of place"."""

    @property
    def by_kind(self) -> dict[str, list[str]]:
        """Places by the kind of limit, in the order of `KINDS`."""
        parts = [name.split(" of ", 1) for name in self]
        return {kind: places for kind in KINDS if (places := [place for other, place in parts if other == kind])}

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of these limits, in the order of `KINDS`."""
        return tuple(self.by_kind)

    def __str__(self) -> str:
        """Return all names in a line, grouped by kind."""
        return "; ".join(f"{kind}: {' | '.join(places)}" for kind, places in self.by_kind.items())


class Polytope(NamedTuple):
    """All poses y = (x, y, lever theta), mm, within the limits; without vertices and faces if they are not a solid.

    vertices : (v, 3), mm, mm, rad.   commands : (v, m), of the vertices.   volume : mm^2 rad.
    normals, supports : (f, 3), (f,), mm: normal @ y <= support on every face.
    faces : vertices of each face, counter-clockwise seen from outside.   by : limits that bound each face.
    missed : largest distance of a pose outside the faces over the largest coordinate; 0 below `MOST` vertices.
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
    """Bounds of the poses: faces of the solid, edges of the section, and limits at the ends of the ranges."""

    solid: Polytope
    section: list[PoseEdge]
    stops: Stops


@for_mechanisms(Reach, MechanismReach, not_for="load analytic", only_for="layers")
@question
def reach(
    stage: Stage | Mechanism,
    *,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    layers: int | None = None,
) -> Reach | MechanismReach:
    """Poses that the drive of a stage reaches within all limits, or that a mechanism reaches within its strokes.

    Parameters
    ----------
    load : tuple of float
        Load on the platform: N, N, N mm.
    models : {"both", "analytic"}
        "both" adds the ranges along the axes by finite elements.
    resolution : int, optional
        Triangles across every neck.
    layers : int, optional
        Three-dimensional model of a mechanism with this number of layers in half the thickness, from 3.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> [round(1e3 * float(x), 1) for x in found.at("ends", end="high", model="analytic", direction="x")]  # um
    [24.0, 28.6]
    """
    if isinstance(stage, Mechanism):
        mesh = mesh_of(models, resolution, layers, usual_solid=usual_solid(stage))
        return actuators.reach(stage, mesh, models)
    mesh, F = mesh_of(models, resolution, None, 2), arguments.vectors("load", load, 1, LARGEST_LOAD)
    drive, lever, warnings = drive_of(stage), stage.chain.link_lengths[2], list(warning.of_stage(stage))
    commanded = commanding(analytic.chosen(stage, warnings))
    limits = limits_of_commands(commanded, commanded.system, drive, F)
    poses = PoseSet(commanded.system, drive, limits, F)
    try:
        solid = poses.solid(lever)
    except NothingAllowed:
        raise ComputationFailed(_why_unreachable(commanded, limits, drive, F)) from None
    ends, stops = poses.ranges()
    ranges = {ANALYTIC: ends}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution).system
        ranges[ELEMENTS] = PoseSet(elements, drive, limits_of_commands(commanded, elements, drive, F), F).ranges()[0]
    values: dict[str, Any] = {
        "load": F,
        "ends": np.stack(list(ranges.values()), axis=2),
        "rest": poses.rest,
        "circle": _radius(solid, poses.rest * [1, 1, 0], 2),
        "ball": _radius(solid, poses.rest * [1, 1, lever], 3),
        "volume": solid.volume,
        "vertices": solid.vertices,
        "commands": solid.commands,
    }
    warnings += _warnings(commanded, drive, solid, lever)
    warnings += warning.of_motion(stage, np.max(np.abs(ends[1]), axis=0), "the farthest poses of the drive")
    notes = [
        f"{direction}, others {others}: "
        + "; ".join(f"{end} end limited by {stops[others, direction, end]}" for end in ("low", "high"))
        for others in ("zero", "free")
        for direction in DIRECTIONS
        if (others, direction, "low") in stops
    ]
    notes.append(f"all poses: {len(solid.vertices)} vertices, {len(solid.faces)} faces")
    if solid.missed:
        notes[-1] += f"; some poses are outside these faces by up to {100 * solid.missed:.2g} % of the largest"
    notes.append(warning.driven_accuracy(commanded.result.formula, commanded.result.links, commanded.result.plane))
    axes = {"model": tuple(ranges), "actuator": drive.names, "vertex": [f"{k + 1}" for k in range(len(solid.vertices))]}
    settings = {"analytic model": commanded.result.name} | meshed(mesh)
    return Reach(
        about(stage, drive=True), values, None, axes, settings, warnings, notes,
        ReachedPoses(solid, section_of(solid), stops),
    )  # fmt: skip


def limits_of_commands(commanded: Commanding, driven: Driven, drive: StageDrive, load: Array) -> LinearLimits:
    """Return all limits of the commands (m,) of a driven stage under a load (3,), with the names that users see.

    commanded : gives the neck stress by the stack forces of `driven`; necks are limited to the yield strength less
        `YIELD_MARGIN`. The preloads of a pair balance each other; that of a single stack stresses the necks.
    """
    stage, frames = commanded.stage, stage_frames(commanded.stage)
    carried = commanded.carried(load, drive.preload - driven.Y @ driven.C[3:, :3] @ load)
    strength = stage.material.yield_strength * (1 - warning.YIELD_MARGIN[stage.model])
    wrenches, sections = per_command(driven, frames, commanded.model.necks), sections_of(lower(stage))[:, 0]
    yield_limits = limits_of_necks(sections, wrenches, carried, strength)
    by_kind = limits_of(driven, drive, load)
    limits = [*(by_kind[kind] for kind in LIMITS), yield_limits]
    names = [f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names]
    names += [f"{kind} of {name}" for kind in LIMITS[1:] for name in stack_names(drive)]
    places = [f"yield of the {hinge} hinge, chain {chain}" for chain in CHAINS for hinge in HINGE_NAMES]
    return LinearLimits(
        np.concatenate([limit.rows for limit in limits]),
        np.concatenate([limit.offsets + limit.sizes for limit in limits]),
        np.array([*names, *np.repeat(places, len(yield_limits.rows) // 9)]),
    )


class PoseSet:
    """The poses G x + rest (3,) of the commands x within limits under a load (3,).

    A limit enters the linear programs once it is violated, and stays; few of the many stress limits ever are.
    """

    def __init__(self, driven: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> None:
        self.G, self.names, self.rest = driven.poses, limits.names, np.asarray(driven.engaged @ load)
        self.unit = np.maximum(drive.highest, -drive.lowest)  # (m,), mm, size of the commands
        self.extent = np.abs(self.G) @ self.unit  # (3,), extent by strokes alone
        self.size = np.where(self.extent > 0, self.extent, 1.0)
        rows = limits.rows * self.unit
        size = np.max(np.abs(rows), axis=1)
        size[size == 0] = np.maximum(np.abs(limits.bounds[size == 0]), 1.0)
        self.rows, self.bounds = rows / size[:, None], limits.bounds / size
        self.active = np.arange(len(rows)) < 2 * len(self.unit)  # stroke limits, which keep every program bounded

    def farthest(self, c: Array, zero: tuple[int, ...] = ()) -> tuple[Array, LimitNames]:
        """Return the commands x that maximize c (m,) @ x, with directions `zero` of the pose at 0, and binding limits.

        Raises NothingAllowed.
        """
        cost, axes = c * self.unit, list(zero)
        cost = cost / (np.max(np.abs(cost)) or 1.0)
        equality = self.G[axes] * self.unit / self.size[axes, None], -self.rest[axes] / self.size[axes]
        while True:
            limits = {"A_ub": self.rows[self.active], "b_ub": self.bounds[self.active], "bounds": (None, None)}
            solution = linear_program(-cost, **limits, A_eq=equality[0], b_eq=equality[1])
            if solution is None:
                raise NothingAllowed
            excess = np.where(self.active, 0.0, self.rows @ solution.x - self.bounds)
            worst = np.argsort(excess)[-2 * len(cost) :]
            if excess[worst[-1]] <= EXACT:
                break
            self.active[worst[excess[worst] > EXACT]] = True
        multipliers = -solution.ineqlin.marginals
        binding = np.flatnonzero(self.active)[multipliers > MULTIPLIER * max(np.max(multipliers), MULTIPLIER)]
        return solution.x * self.unit, LimitNames(dict.fromkeys(self.names[binding].tolist()))

    def ranges(self) -> tuple[Array, Stops]:
        """Return ends (2 others zero or free, 2 low and high, 3), nan if no pose is reached, and their limits.

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
        """Return the polytope of all poses. Raises NothingAllowed."""
        scale = np.array([1.0, 1.0, lever])
        size = float(np.max(scale * self.extent)) or 1.0
        G = scale[:, None] * self.G / size
        commands, dimension = self._spanning(G)
        if dimension < 3:
            return Polytope(dimension, np.zeros((0, 3)), commands[:0], np.zeros((0, 3)), np.zeros(0), [], [], 0.0)
        commands, missed = self._refined(G, commands)
        poses = commands @ self.G.T + self.rest
        commands = commands[np.lexsort(np.round(poses / np.max(np.abs(poses), axis=0), 6).T)]  # order free of round-off
        corners, vertex_sets, volume = _corners_and_faces(commands @ G.T)
        commands = commands[corners]
        Z, faces, normals = commands @ G.T, [], []
        for face in vertex_sets:
            arms = Z[face] - np.mean(Z[face], axis=0)
            normal = np.linalg.svd(arms)[2][-1]
            normal *= np.sign(normal @ np.mean(Z[face] - np.mean(Z, axis=0), axis=0))
            angles = np.arctan2(arms @ np.cross(normal, arms[0]), arms @ arms[0])
            faces.append([face[k] for k in np.argsort(angles)])
            normals.append(normal)
        by = [self.farthest(normal @ G)[1] for normal in normals]
        supports = np.max(np.array(normals) @ Z.T, axis=1) * size + normals @ (scale * self.rest)
        poses, volume = commands @ self.G.T + self.rest, volume * size**3 / lever
        return Polytope(3, poses, commands, np.array(normals), supports, faces, by, volume, missed)

    def _spanning(self, G: Array) -> tuple[Array, int]:
        """Return commands whose images under G (3, m) span the set, and its dimension."""
        X, dimension = self.farthest(G[0])[0][None], -1
        while True:
            _, values, axes = np.linalg.svd((X - X[0]) @ G.T)
            previous, dimension = dimension, int(np.count_nonzero(values > FLAT))
            if dimension in (previous, 3):
                return X, dimension
            added = [self.farthest(sign * w @ G)[0] for w in axes[dimension:] for sign in (1.0, -1.0)]
            X = np.concatenate([X, added])

    def _refined(self, G: Array, commands: Array) -> tuple[Array, float]:
        """Add commands until the hull of their images is the set; return them and the relative distance left out."""
        from scipy.spatial import ConvexHull

        supports = dict[tuple[float, ...], float]()  # support of the set by the normal of a plane of the hull
        while True:
            planes = {tuple(np.round(plane[:3], 10) + 0.0): plane for plane in ConvexHull(commands @ G.T).equations}
            new = list[tuple[float, Array]]()
            for key, plane in planes.items():
                if key not in supports:
                    x = self.farthest(plane[:3] @ G)[0]
                    supports[key] = float(plane[:3] @ G @ x)
                    new.append((supports[key] + plane[3], x))
            farthest = [x for excess, x in sorted(new, key=lambda item: -item[0]) if excess > EXACT]
            if not farthest or len(commands) >= MOST:
                missed = float(max(supports[key] + plane[3] for key, plane in planes.items()))
                return commands, missed / float(np.max(np.abs(commands @ G.T))) if missed > EXACT else 0.0
            commands = np.concatenate([commands, farthest[: MOST - len(commands)]])


def _corners_and_faces(Z: Array) -> tuple[Index, list[list[int]], float]:
    """Return the vertices (indices) of the hull of points (p, 3), positions of each face in them, and the volume."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(Z)
    normals = hull.equations[:, :3]
    on_face = np.abs(Z @ normals.T + hull.equations[:, 3]) < 10 * EXACT
    corners = np.flatnonzero([np.linalg.matrix_rank(normals[row], tol=FLAT) == 3 for row in on_face])
    coincident = np.max(np.abs(Z[corners][:, None] - Z[corners]), axis=2) < 10 * EXACT
    corners = corners[~np.any(np.tril(coincident, -1), axis=1)]  # without duplicates
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in on_face[corners].T}
    faces = sorted(sorted(face) for face in sets if not any(face < other for other in sets))
    return corners, faces, float(hull.volume)


def section_of(solid: Polytope) -> list[PoseEdge]:
    """Return edges of the poses at theta = 0, counter-clockwise: the line of each face clipped by all other faces."""
    size, edges = np.max(np.abs(solid.supports), initial=0.0), []
    normals, supports = solid.normals[:, :2], solid.supports
    for normal, support, by in zip(normals, supports, solid.by, strict=True):
        length = np.linalg.norm(normal)
        if length < FLAT:
            continue
        along, foot = np.array([-normal[1], normal[0]]) / length, support * normal / length**2
        rate, slack = normals @ along, supports - normals @ foot  # rate t <= slack on the line foot + t along
        parallel = np.abs(rate) < FLAT
        start = np.max(slack[rate <= -FLAT] / rate[rate <= -FLAT], initial=-np.inf)
        end = np.min(slack[rate >= FLAT] / rate[rate >= FLAT], initial=np.inf)
        if np.all(slack[parallel] >= -EXACT * size) and end - start > ROUND_OFF * size:
            edges.append(PoseEdge(foot + start * along, foot + end * along, by))
    return sorted(edges, key=lambda edge: float(np.arctan2(*(edge.end - edge.start)[::-1])))


def _radius(solid: Polytope, centre: Array, directions: int) -> float:
    """Return the distance of a point (3,) from the faces in the first directions, mm; 0 if it is not inside."""
    tilt = np.maximum(np.linalg.norm(solid.normals[:, :directions], axis=1), FLAT)
    distance = float(np.min((solid.supports - solid.normals @ centre) / tilt, initial=np.inf)) if solid.faces else 0.0
    return distance if distance > ROUND_OFF * np.max(np.abs(solid.supports), initial=0.0) else 0.0


def _why_unreachable(commanded: Commanding, limits: LinearLimits, drive: StageDrive, load: Array) -> str:
    """Describe the limits that allow no commands: kinds that exclude all with those of strokes, or all together."""
    infeasible = []
    for kind in KINDS:
        chosen = np.array([name.startswith((KINDS[0], kind)) for name in limits.names])
        subset = LinearLimits(*(part[chosen] for part in limits))
        try:
            PoseSet(commanded.system, drive, subset, load).farthest(drive.highest)
        except NothingAllowed:
            infeasible.append(kind)
    kinds = " and those of ".join(infeasible) if infeasible else "stroke, contact, blocking force and yield together"
    stress, under = _preload_stress(commanded, drive), "under this load" if np.any(load) else "without load"
    preloads = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}" if stress > 1e-3 else ""
    return f"the drive reaches no pose: the limits of {kinds} allow no commands {under}{preloads}"


def _preload_stress(commanded: Commanding, drive: StageDrive) -> float:
    """Return the highest neck stress by the preloads alone, MPa; those of a pair balance and cause none."""
    return float(np.max(commanded.stress(np.zeros(3), drive.preload)))


def _warnings(commanded: Commanding, drive: StageDrive, solid: Polytope, lever: float) -> list[str]:
    messages, unpaired = list[str](), np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, unpaired]).T @ drive.preload > 0):
        messages.append(
            "single stacks have no opposite stack that balances their preload, which stresses the necks with up to "
            f"{_preload_stress(commanded, drive):.4g} {STRESS} at zero commands (the model has no spring that carries "
            "the preload)"
        )
    rank = np.linalg.matrix_rank(np.array([[1.0], [1.0], [lever]]) * commanded.system.poses, rtol=SINGULAR)
    if rank < 3:
        messages.append(f"the drive moves the platform in {rank} of three directions: its poses are not a solid")
    elif solid.dimension < 3:
        messages.append(f"the poses within the limits are not a solid: they {EXTENDS[solid.dimension]}")
    return messages
