"""The poses that a drive reaches within all its limits: strokes, contacts that only push, blocking forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x <= bounds; so the
poses are a polytope. The convex hull of points that linear programs found lies within it, and the planes that programs
found hold it in: once every plane of the hull is one of these, both are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array, Index
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import warnings as warning
from flexfem.questions.drive import (
    LARGEST_LOAD,
    MOTION,
    Commanding,
    commanding,
    driven_elements,
    neck_stresses,
    stack_names,
)
from flexfem.questions.driven import (
    LIMITS,
    SINGULAR,
    Driven,
    limits_of,
    limits_of_necks,
    neck_forces,
    per_command,
    sections_of,
)
from flexfem.questions.setup import DEFAULT, Analytic, about, mesh_of, meshed
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SOLVED, Quantity, Result
from flexfem.units import DIRECTIONS, STRESS

KINDS = (*LIMITS, "yield")  # what the name of a limit begins with, before " of "
EXACT = 1e-9  # of limits and of the largest coordinate: what programs may break them by, and hulls may miss
ROUND_OFF = 1e-9  # of how far strokes alone go in a direction, and of the size of the poses
FLAT = 1e-7  # of the largest coordinate: a set no wider in some direction has no extent in it
MULTIPLIER = 1e-6  # of the largest: a limit with a smaller multiplier does not bind
ASKED = 12  # decimals of a direction, largest part one, by which it is known when it is asked for again
MOST = 200  # rounds of refinement; the shipped stages take six
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
    load = Quantity("load on the platform", ("n", "n", "n_mm"), ("direction",), shown=False)
    ends = Quantity(
        "ends of the ranges, the other directions zero or free", MOTION, ("others", "end", "model", "direction"), FRESH,
        "pose", prefixed=True,
    )  # fmt: skip
    rest = Quantity("pose of zero commands", MOTION, ("direction",), SOLVED, "pose", prefixed=True)
    circle = Quantity("radius about rest in X and Y at theta 0", "um", (), SOLVED)
    ball = Quantity("radius about rest, rotations times the lever", "um", (), SOLVED)
    volume = Quantity("volume of all poses", "um2_mrad", (), SOLVED)
    vertices = Quantity("vertices of all poses", MOTION, ("vertex", "direction"), SOLVED, "all", shown=False)
    commands = Quantity("strokes of the actuators there", "um", ("vertex", "actuator"), SOLVED, "all", shown=False)


class NothingAllowed(Exception):  # noqa: N818
    """No x keeps all limits."""


class LinearLimits(NamedTuple):
    """Limits (k) on x (m,): rows @ x <= bounds, each by the index (k,) of its name; those on x alone come first."""

    rows: Array
    bounds: Array
    owner: Index
    names: tuple[str, ...]


class LimitNames(tuple[str, ...]):
    """Names of the limits that bound something, each "kind of place"."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """What kinds of limits these are, in the order of `KINDS`."""
        return tuple(kind for kind in KINDS if any(name.startswith(f"{kind} of ") for name in self))

    def __str__(self) -> str:
        """All in a line, kind by kind."""
        found = {
            kind: [n.removeprefix(f"{kind} of ") for n in self if n.startswith(f"{kind} of ")] for kind in self.kinds
        }
        return "; ".join(f"{kind}: {' | '.join(names)}" for kind, names in found.items())


class Extreme(NamedTuple):
    """The x (m,) that goes farthest in a direction, and the names of the limits that stop it."""

    x: Array
    by: LimitNames


class Polytope(NamedTuple):
    """All y = G x (d,) that limits allow; without vertices and faces where they are no solid.

    dimension : of the set.   vertices : (v, d).   commands : (v, m), an x for each.
    normals, supports : (f, d), (f,): normal @ y <= support on every face.
    faces : of each its vertices, in 3-D around it, counter-clockwise seen from outside.   by : of each the limits.
    """

    dimension: int
    vertices: Array
    commands: Array
    normals: Array
    supports: Array
    faces: tuple[tuple[int, ...], ...]
    by: tuple[LimitNames, ...]
    volume: float


class PoseEdge(NamedTuple):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: tuple[float, float]
    end: tuple[float, float]
    by: LimitNames


class ReachedPoses(NamedTuple):
    """What bounds the poses: faces of all, in (x, y, lever theta), edges of the section, and each end of the ranges.

    stops : limits by ("zero" or "free", direction, "low" or "high"); without ranges that no pose is in.
    """

    solid: Polytope
    section: list[PoseEdge]
    stops: dict[tuple[str, str, str], LimitNames]


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
    stage : Stage
        The stage, with actuators.
    load : tuple of float
        Load on the platform: N, N, N mm.
    models : {"both", "analytic"}
        Whether finite elements have the ranges along the axes, too.
    analytic : Analytic
        The analytic model.
    resolution : int, optional
        Triangles across every neck.

    Returns
    -------
    Reach

    Raises
    ------
    BadInput
        The stage has no actuators, cannot be made, or the analytic model does not suit it.
    ComputationFailed
        The limits allow no pose at all, or a mesh does not pass its checks.

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
    limits = limits_of_commands(first, first.of, drive, F)
    poses = PoseSet(first.of, drive, limits, F)
    try:
        solid = poses.solid(lever)
    except NothingAllowed:
        raise ComputationFailed(_why_nothing(first, limits, drive, F)) from None
    section, (ends, stops) = poses.section(), poses.ranges()
    found = {ANALYTIC: ends}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution).of
        found[ELEMENTS] = PoseSet(elements, drive, limits_of_commands(first, elements, drive, F), F).ranges()[0]
    size = np.max(np.abs(solid.vertices), axis=0, initial=np.finfo(float).tiny)
    order = np.lexsort(np.round(solid.vertices / size, 6).T)  # whatever round-off does
    values: dict[str, Any] = {
        "load": F,
        "ends": np.stack(list(found.values()), axis=2),
        "rest": poses.rest,
        "circle": _radius(section, poses.rest[:2]),
        "ball": _radius(solid, np.array([1.0, 1.0, lever]) * poses.rest),
        "volume": solid.volume,
        "vertices": solid.vertices[order],
        "commands": solid.commands[order],
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
    notes.append(warning.driven_accuracy(first.result.formula, first.result.links, first.result.plane))
    axes = {"model": tuple(found), "actuator": drive.names, "vertex": [f"{k + 1}" for k in range(len(solid.vertices))]}
    settings = {"analytic model": first.result.name} | meshed(mesh)
    fields = ReachedPoses(solid, edges_of(section), stops)
    return Reach(about(stage, drive=True), values, None, axes, settings, list(dict.fromkeys(warnings)), notes, fields)


def limits_of_commands(first: Commanding, of: Driven, drive: StageDrive, load: Array) -> LinearLimits:
    """Every limit of the commands (m,) of a driven stage under a load (3,), with the names that users see.

    first : the model whose necks carry what the stacks of `of` push with; they bear `YIELD_MARGIN` less than the yield
        strength. The preloads of a pair bear on each other; that of a single stack stresses the necks.
    """
    stage, frames, necks = first.stage, stage_frames(first.stage), first.model.necks
    force = drive.preload - of.Y @ of.C[3:, :3] @ load
    carried = neck_forces(frames, (necks @ np.concatenate([load, force]))[..., None])
    strength = stage.material.yield_strength * (1 - warning.YIELD_MARGIN[stage.model])
    at = sections_of(lower(stage))[:, 0]
    yields = limits_of_necks(at, per_command(of, frames, necks), carried[..., 0], strength)
    own = limits_of(of, drive, load)
    every = [*(own[kind] for kind in LIMITS), yields]
    names = [f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names]
    names += [f"{kind} of {name}" for kind in LIMITS[1:] for name in stack_names(drive)]
    places = [f"yield of the {hinge} hinge, chain {chain}" for chain in CHAINS for hinge in HINGE_NAMES]
    owner = np.concatenate([np.arange(len(names)), len(names) + np.repeat(np.arange(9), len(yields.rows) // 9)])
    return LinearLimits(
        np.concatenate([each.rows for each in every]),
        np.concatenate([each.offsets + each.sizes for each in every]),
        owner,
        (*names, *places),
    )


class PoseSet:
    """The poses that limits of the commands allow under a load (3,).

    rest : (3,), pose of zero commands.
    """

    def __init__(self, of: Driven, drive: StageDrive, limits: LinearLimits, load: Array) -> None:
        self.G, self.limits, self.rest = of.poses, limits, np.asarray(of.engaged @ load)
        self.unit = np.maximum(drive.highest, -drive.lowest)  # (m,), mm, size of the commands
        self.far = np.abs(self.G) @ self.unit  # (3,), how far strokes alone go
        self.size = np.where(self.far > 0, self.far, 1.0)

    def programs(self, zero: Sequence[int] = ()) -> Programs:
        """Linear programs with some directions of the pose at zero."""
        at = list(zero)
        return Programs(self.limits, self.unit, self.G[at] / self.size[at, None], -self.rest[at] / self.size[at])

    def ranges(self) -> tuple[Array, dict[tuple[str, str, str], LimitNames]]:
        """Ends (2 others zero or free, 2 low and high, 3), nan where no pose is reached, and what stops them.

        Raises NothingAllowed.
        """
        ends, stops = np.full((2, 2, 3), np.nan), dict[tuple[str, str, str], LimitNames]()
        free = self.programs()
        for axis, direction in enumerate(DIRECTIONS):
            for row, others in enumerate(("zero", "free")):
                allowed = free if row else self.programs([k for k in range(3) if k != axis])
                try:
                    extremes = [allowed.farthest(sign * self.G[axis] / self.size[axis]) for sign in (-1.0, 1.0)]
                except NothingAllowed:
                    if row:
                        raise
                    continue
                for column, (end, found) in enumerate(zip(("low", "high"), extremes, strict=True)):
                    value = float(self.rest[axis] + self.G[axis] @ found.x)
                    ends[row, column, axis] = 0.0 if abs(value) < ROUND_OFF * self.size[axis] else value
                    stops[others, direction, end] = found.by
        return ends, stops

    def solid(self, lever: float) -> Polytope:
        """All poses: normals and supports are those of (x, y, lever theta). Raises NothingAllowed."""
        scale = np.array([1.0, 1.0, lever])
        size = float(np.max(scale * self.far)) or 1.0
        found = image(self.programs(), scale[:, None] * self.G / size)
        return found._replace(
            vertices=found.vertices * size / scale + self.rest,
            supports=found.supports * size + found.normals @ (scale * self.rest),
            volume=found.volume * size**3 / lever,
        )

    def section(self) -> Polytope:
        """The poses (x, y) at theta = 0."""
        size = float(np.max(self.far[:2])) or 1.0
        try:
            found = image(self.programs([2]), self.G[:2] / size)
        except NothingAllowed:
            return _without_faces(0, self.G[:2])
        supports = found.supports * size + found.normals @ self.rest[:2]
        return found._replace(vertices=found.vertices * size + self.rest[:2], supports=supports)


def edges_of(section: Polytope) -> list[PoseEdge]:
    """Edges of a section, counter-clockwise."""
    edges = []
    for face, normal, by in zip(section.faces, section.normals, section.by, strict=True):
        ends = sorted(section.vertices[list(face)].tolist(), key=lambda at: at[1] * normal[0] - at[0] * normal[1])
        edges.append(PoseEdge(tuple(ends[0]), tuple(ends[-1]), by))
    return sorted(edges, key=lambda edge: float(np.arctan2(*np.subtract(edge.end, edge.start)[::-1])))


class Programs:
    """max c @ x under limits, with `fixed @ x = at`, for one c after another.

    Limits are taken in once they are broken, and stay: of the many on stresses, few ever are.
    """

    def __init__(self, limits: LinearLimits, unit: Array, fixed: Array, at: Array) -> None:
        """`unit` (m,): size of x; the limits on x alone are the first 2 m; fixed @ x of the order of one."""
        rows = limits.rows * unit
        size = np.max(np.abs(rows), axis=1)
        size[size == 0] = np.maximum(np.abs(limits.bounds[size == 0]), 1.0)
        self.limits, self.unit = limits, unit
        self.rows, self.bounds = rows / size[:, None], limits.bounds / size
        self.taken = np.arange(len(rows)) < 2 * len(unit)
        self.equal = {"A_eq": fixed * unit, "b_eq": at} if len(fixed) else {}
        self._known: dict[tuple[float, ...], Extreme] = {}

    def farthest(self, c: Array) -> Extreme:
        """The x that makes c (m,) @ x largest. Raises NothingAllowed."""
        cost = c * self.unit
        cost = cost / (np.max(np.abs(cost)) or 1.0)
        asked = tuple(np.round(cost, ASKED) + 0.0)
        if asked not in self._known:
            self._known[asked] = self._extreme(cost)
        return self._known[asked]

    def _extreme(self, cost: Array) -> Extreme:
        while True:
            found = self._solve(-cost)
            broken = self.rows @ found.x - self.bounds
            broken[self.taken] = 0.0
            if not np.any(broken > EXACT):
                break
            worst = np.argsort(broken)[-2 * len(cost) :]
            self.taken[worst[broken[worst] > EXACT]] = True
        multipliers = -found.ineqlin.marginals
        binding = np.flatnonzero(self.taken)[multipliers > MULTIPLIER * max(np.max(multipliers), MULTIPLIER)]
        owners = sorted(set(self.limits.owner[binding].tolist()))
        return Extreme(found.x * self.unit, LimitNames(self.limits.names[k] for k in owners))

    def _solve(self, cost: Array) -> Any:
        from scipy.optimize import linprog

        tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        rows, bounds = self.rows[self.taken], self.bounds[self.taken]
        found = linprog(cost, rows, bounds, **self.equal, bounds=(None, None), method="highs", options=tight)
        if found.status == 2:
            raise NothingAllowed
        if found.status != 0:
            raise ComputationFailed(f"linear program for the poses of a drive: {found.message}")
        return found


def image(programs: Programs, G: Array) -> Polytope:
    """The set of all G x, G (d, m), d two or three and G x of the order of one. Raises NothingAllowed."""
    commands, dimension = _first(programs, G)
    if dimension < len(G):
        return _without_faces(dimension, G)
    commands = _refined(programs, G, commands)
    index, faces, volume = _combinatorics(commands @ G.T)
    commands = commands[index]
    Z = commands @ G.T
    normals = np.array([_normal(Z[list(face)], np.mean(Z, axis=0)) for face in faces])
    by = tuple(programs.farthest(n @ G).by for n in normals)
    around = [_around(Z, face, n) if dimension == 3 else face for face, n in zip(faces, normals, strict=True)]
    return Polytope(dimension, Z, commands, normals, np.max(normals @ Z.T, axis=1), tuple(around), by, volume)


def _without_faces(dimension: int, G: Array) -> Polytope:
    none = np.zeros((0, len(G)))
    return Polytope(dimension, none, np.zeros((0, G.shape[1])), none, np.zeros(0), (), (), 0.0)


def _first(programs: Programs, G: Array) -> tuple[Array, int]:
    """Commands whose images span the set, and its dimension."""
    found, dimension, left = list[Array](), 0, np.eye(len(G))
    while left.shape[1]:
        w = left[:, 0]
        far, near = (programs.farthest(sign * w @ G).x for sign in (1.0, -1.0))
        found += [far, near]
        along = left @ left.T @ G @ (far - near)
        wide = bool(w @ along > FLAT)
        new = along / np.linalg.norm(along) if wide else w
        dimension += wide
        left = np.linalg.svd((np.eye(len(G)) - np.outer(new, new)) @ left, full_matrices=False)[0][:, :-1]
    return np.array(found), dimension


def _refined(programs: Programs, G: Array, commands: Array) -> Array:
    """Commands whose images' convex hull is the set: farthest ones along the hull's planes, until none is farther."""
    from scipy.spatial import ConvexHull

    known = set[tuple[float, ...]]()
    for _ in range(MOST):
        planes = {tuple(np.round(plane[:-1], 10) + 0.0): plane for plane in ConvexHull(commands @ G.T).equations}
        fresh = [plane for key, plane in planes.items() if key not in known]
        known |= planes.keys()
        farthest = [programs.farthest(plane[:-1] @ G).x for plane in fresh]
        beyond = [x for x, plane in zip(farthest, fresh, strict=True) if plane[:-1] @ G @ x + plane[-1] > EXACT]
        if not beyond:
            return commands
        commands = np.concatenate([commands, beyond])
    raise ComputationFailed(f"the poses of the drive have not been enclosed after {MOST} rounds of linear programs")


def _combinatorics(Z: Array) -> tuple[Index, list[tuple[int, ...]], float]:
    """Of the hull of points (p, k): the indices of its vertices, which of these each face has, and its volume."""
    from scipy.spatial import ConvexHull

    hull, k = ConvexHull(Z), Z.shape[1]
    touches = np.abs(Z @ hull.equations[:, :-1].T + hull.equations[:, -1]) < 10 * EXACT
    index = np.flatnonzero([_rank(hull.equations[row, :-1]) == k for row in touches])
    index = index[[not np.any(np.max(np.abs(Z[index[:i]] - Z[j]), axis=1) < 10 * EXACT) for i, j in enumerate(index)]]
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in touches[index].T}
    full = [s for s in sets if len(s) >= k and _rank(Z[index[list(s)]] - np.mean(Z[index[list(s)]], axis=0)) == k - 1]
    faces = [tuple(sorted(s)) for s in full if not any(s < other for other in full)]
    return index, sorted(faces), float(hull.volume)


def _rank(vectors: Array) -> int:
    """Of vectors (n, k), less what round-off makes of them."""
    return int(np.linalg.matrix_rank(vectors, tol=FLAT)) if len(vectors) else 0


def _normal(points: Array, inside: Array) -> Array:
    """Outward unit normal (k,) of the plane through points (n, k)."""
    middle = np.mean(points, axis=0)
    normal = np.linalg.svd(points - middle)[2][-1]
    return np.asarray(normal * np.sign(normal @ (middle - inside)))


def _around(Z: Array, face: tuple[int, ...], normal: Array) -> tuple[int, ...]:
    """The vertices of a face, counter-clockwise about its outward normal (3,)."""
    points = Z[list(face)] - np.mean(Z[list(face)], axis=0)
    first = points[0] / np.linalg.norm(points[0])
    angles = np.arctan2(points @ np.cross(normal, first), points @ first)
    return tuple(face[i] for i in np.argsort(angles))


def _radius(of: Polytope, centre: Array) -> float:
    """Least distance of the faces of a polytope from a point, 0 where it is not inside."""
    distance = float(np.min(of.supports - of.normals @ centre, initial=np.inf)) if of.faces else 0.0
    return distance if distance > ROUND_OFF * np.max(np.abs(of.supports), initial=0.0) else 0.0


def _preload_stress(first: Commanding, drive: StageDrive) -> float:
    """Highest stress of a neck by the preloads alone, MPa: the two of a pair bear on each other, and stress none."""
    return float(np.max(neck_stresses(first, np.concatenate([np.zeros(3), drive.preload]))))


def _why_nothing(first: Commanding, limits: LinearLimits, drive: StageDrive, load: Array) -> str:
    """Which limits allow no commands, each by itself with those of strokes, or only together."""
    alone = []
    for kind in KINDS:
        chosen = np.array([limits.names[k].startswith((KINDS[0], kind)) for k in limits.owner])
        part = LinearLimits(limits.rows[chosen], limits.bounds[chosen], limits.owner[chosen], limits.names)
        try:
            PoseSet(first.of, drive, part, load).programs().farthest(np.ones(len(drive.names)))
        except NothingAllowed:
            alone.append(kind)
    which = " and those of ".join(alone) if alone else "stroke, contact, blocking force and yield together"
    stress, under = _preload_stress(first, drive), "under this load" if np.any(load) else "without load"
    loaded = f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}" if stress > 1e-3 else ""
    return f"the drive reaches no pose: the limits of {which} allow no commands {under}{loaded}"


def _warnings(first: Commanding, drive: StageDrive, solid: Polytope, lever: float) -> list[str]:
    found, single = list[str](), np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, single]).T @ drive.preload > 0):
        found.append(
            "single stacks have no partner to bear their preload: the necks do, with up to "
            f"{_preload_stress(first, drive):.4g} {STRESS} at zero commands (no spring that would bear it is in the "
            "model)"
        )
    values = np.linalg.svd(np.array([[1.0], [1.0], [lever]]) * first.of.poses, compute_uv=False)
    moves = int(np.count_nonzero(values > SINGULAR * values[0])) if values[0] > 0 else 0
    if moves < 3:
        found.append(f"the drive moves the platform in {moves} of three directions: its poses are no solid")
    elif solid.dimension < 3:
        found.append(f"the limits leave no solid: the poses that the drive reaches {EXTENDS[solid.dimension]}")
    return found
