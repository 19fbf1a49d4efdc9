"""The poses that a drive reaches within all its limits: strokes, unilateral contacts, blocking
forces and yield.

Poses and limits are linear in the commands x: U = G x + C F, with the stacks engaged, and rows @ x
<= bounds, so the poses form a polytope. It contains the convex hull of vertices found by linear
programs, and the supporting planes of these programs bound it. Once every plane of the hull is a
supporting plane, hull and polytope are identical."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.designs import lower
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES
from flexfem.questions import finite, plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.drive import (
    LARGEST_LOAD,
    Commanding,
    commanding,
    driven_elements,
    stack_names,
)
from flexfem.questions.driven import (
    LIMITS,
    MULTIPLIER,
    SINGULAR,
    CommandLimits,
    Driven,
    command_limits,
    stroke_limits,
)
from flexfem.questions.setup import DEFAULT, Analytic, about, elements_through, mesh_of, options
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SOLID, SOLVED, Quantity, Result
from flexfem.units import DIRECTIONS, STRESS

KINDS = (*LIMITS, "yield")  # first part of the name of a limit, before " of "
EXACT = (
    1e-9  # of limits and of the largest coordinate: tolerance of linear programs and of the hull
)
ROUND_OFF = 1e-9  # of the extent by strokes alone in a direction, and of the size of the poses
# of the largest coordinate: smallest width of a set in a direction that counts as an extent
FLAT = 1e-7
MOST_STACKS = (
    5  # of a mechanism whose strokes are all combined: beams take 0.05 s for each combination
)
# vertices of all poses: curved yield limits would give many thousands; shipped stages have at most
# 64
MOST = 300
EXTENDS = (
    "are a single pose",
    "lie on a line",
    "lie in a plane",
)  # poses that are not solid, by dimension


class Reach(Result):
    """The poses that a drive reaches within its limits: ranges along the axes, and the polytope of
    all poses.
    """

    title = "poses that the drive reaches within all limits"
    main = ("ends", {"others": "zero"})
    labels: ClassVar = {"others": ("zero", "free"), "end": ("low", "high")}
    figure = "drive.reach_figure"
    drawn_from_fields = True
    reading: ClassVar[tuple[str, ...]] = (
        "limits: stroke, contacts without tension, blocking force, and yield of the necks by the "
        "linear analytic model",
    )
    load = Quantity("load on the platform", "wrench", ("direction",), shown=False, only="stage")
    ends = Quantity(
        "ends of the ranges, other directions zero or free",
        "motion",
        ("others", "end", "model", "direction"),
        FRESH,
        "pose",
    )
    rest = Quantity("pose at zero commands", "motion", ("direction",), SOLVED, "pose", only="stage")
    circle = Quantity(
        "radius of the largest circle about rest at theta 0", "um", (), SOLVED, only="stage"
    )
    ball = Quantity(
        "radius of the largest ball about rest, theta times lever", "um", (), SOLVED, only="stage"
    )
    volume = Quantity("volume of all poses", "um2_mrad", (), SOLVED, only="stage")
    vertices = Quantity(
        "vertices of all poses",
        "motion",
        ("vertex", "direction"),
        SOLVED,
        "all",
        shown=False,
        only="stage",
    )
    commands = Quantity(
        "actuator strokes at the vertices",
        "um",
        ("vertex", "actuator"),
        SOLVED,
        "all",
        shown=False,
        only="stage",
    )


class MechanismReach(Reach, mechanism=True):
    """Ends of the motion of the output of a mechanism by the strokes of all actuators."""

    title = "reach of the drive"
    main = ("ends", {"others": "free"})
    figure = ""
    drawn_from_fields = False
    reading = (
        "motion relative to zero strokes; others: the other two directions, free, or held at "
        "zero by at least three actuators; an actuator acts along its line at rest",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )
    ends = replace(Reach.ends, scale="all")  # all components of an end may be round-off


class NothingAllowed(Exception):  # noqa: N818
    """No commands satisfy all limits."""


class LimitNames(tuple[str, ...]):
    """Names of binding limits, each "kind of place"."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of these limits, in the order of `KINDS`."""
        return tuple(kind for kind in KINDS if any(name.startswith(f"{kind} of ") for name in self))

    def __str__(self) -> str:
        """Return all names in a line, grouped by kind; 1+ and 1- are the longest and shortest
        stroke in chain 1.
        """
        places = {
            kind: [
                name.removeprefix(f"{kind} of ") for name in self if name.startswith(f"{kind} of ")
            ]
            for kind in self.kinds
        }
        short = {", chain ": " ", ", longest": "+", ", shortest": "-"}
        found = "; ".join(f"{kind} of {', '.join(of)}" for kind, of in places.items())
        return re.sub("|".join(short), lambda match: short[match[0]], found)


class PoseEdge(NamedTuple):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: Array
    end: Array
    by: LimitNames


class Polytope(NamedTuple):
    """All poses y = (x, y, lever theta), mm, within the limits; without vertices and faces if they
    are not a solid.

    vertices : (v, 3), mm, mm, rad.   commands : (v, m), of the vertices.   volume : mm^2 rad.
    normals, supports : (f, 3), (f,), mm: normal @ y <= support on every face.
    faces : vertices of each face, counter-clockwise seen from outside.   by : limits that bound
    each face.
    missed : largest distance of a pose outside the faces over the largest coordinate; 0 below
    `MOST` vertices."""

    dimension: int
    vertices: Array
    commands: Array
    normals: Array
    supports: Array
    faces: list[list[int]]
    by: list[LimitNames]
    volume: float
    missed: float = 0.0

    @property
    def section(self) -> list[PoseEdge]:
        """Edges of the poses at theta = 0, counter-clockwise: the line of each face clipped by all
        other faces.
        """
        size = np.max(np.abs(self.supports), initial=0.0)
        edges = []
        normals = self.normals[:, :2]
        supports = self.supports
        for normal, support, by in zip(normals, supports, self.by, strict=True):
            length = np.linalg.norm(normal)
            if length < FLAT:
                continue
            along = np.array([-normal[1], normal[0]]) / length
            foot = support * normal / length**2
            rate = normals @ along
            slack = supports - normals @ foot  # rate t <= slack on the line foot + t along
            start = np.max(slack[rate <= -FLAT] / rate[rate <= -FLAT], initial=-np.inf)
            end = np.min(slack[rate >= FLAT] / rate[rate >= FLAT], initial=np.inf)
            if (
                np.all(slack[np.abs(rate) < FLAT] >= -EXACT * size)
                and end - start > ROUND_OFF * size
            ):
                edges.append(PoseEdge(foot + start * along, foot + end * along, by))
        return sorted(edges, key=lambda edge: float(np.arctan2(*(edge.end - edge.start)[::-1])))


Stops = dict[tuple[str, str, str], LimitNames]  # by ("zero" or "free", direction, "low" or "high")


class PoseRanges(NamedTuple):
    """Ends of the ranges along the axes (2 others zero or free, 2 low and high, 3), nan if no pose
    is reached.

    stops : the limits that they reach.   commands : (2, 2, 3, m), of these ends.
    """

    ends: Array
    stops: Stops
    commands: Array


@options(not_for="load analytic", only_for="plane solid thickness_resolution")
def reach(
    stage: Mechanism,
    *,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
) -> Reach:
    """Poses that the drive of a stage reaches within all limits, or that a mechanism reaches within
    its strokes.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    load : tuple of float
        Load on the platform: N, N, N mm. Of a stage file only.
    models : {"both", "analytic"}
        "both" adds the ranges along the axes by finite elements.
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
    Reach
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        reach` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> [round(1e3 * float(x), 1) for x in found.at("ends", end="high", model="analytic", direction="x")]  # um
    [24.0, 28.6]
    """
    if isinstance(stage, MechanismFile):
        layers = elements_through(solid, thickness_resolution)
        return of_mechanism(stage, plates.mesh_of(stage, models, resolution, layers), models)
    mesh = mesh_of(stage, models, resolution, None, 2)
    F = arguments.vectors("load", load, 1, LARGEST_LOAD)
    drive = drive_of(stage)
    lever = stage.chain.link_lengths[2]
    warnings = list(warning.of_stage(stage))
    commanded = commanding(analytic.chosen(stage, warnings))
    poses = pose_set(commanded, commanded.system, F)
    try:
        reachable = poses.solid(lever)
    except NothingAllowed:
        raise ComputationFailed(_why_unreachable(commanded, poses, F)) from None
    ends, stops, _ = poses.ranges()
    found = {ANALYTIC: setup.ModelAnswer({"ends": ends})}
    if mesh is not None:
        elements = driven_elements(stage, mesh.resolution).system
        found[ELEMENTS] = setup.ModelAnswer(
            {"ends": pose_set(commanded, elements, F).ranges().ends}
        )
    values: dict[str, Any] = {
        "load": F,
        "rest": poses.rest,
        "circle": _radius(reachable, poses.rest * [1, 1, 0], 2),
        "ball": _radius(reachable, poses.rest * [1, 1, lever], 3),
        "volume": reachable.volume,
        "vertices": reachable.vertices,
        "commands": reachable.commands,
    }
    warnings += _warnings(commanded, drive, reachable, lever)
    warnings += warning.of_motion(
        stage, np.max(np.abs(ends[1]), axis=0), "the farthest poses of the drive"
    )
    notes = [
        "limits of the ranges; base 2+ is the longest stroke of the stack base in chain 2, base "
        "2- its shortest:"
    ]
    notes += [
        f"{direction}, others {others}, {end} end: {by}"
        for (others, direction, end), by in stops.items()
    ]
    notes.append(f"all poses: {len(reachable.vertices)} vertices, {len(reachable.faces)} faces")
    if reachable.missed:
        notes[-1] += (
            f"; some poses are outside these faces by up to {100 * reachable.missed:.2g} % of the "
            "largest"
        )
    model = commanded.result
    notes.append(warning.driven_accuracy(model.formula, model.links, model.plane))
    axes = {"actuator": drive.names, "vertex": [f"{k + 1}" for k in range(len(reachable.vertices))]}
    return setup.answer(
        Reach,
        about(stage, drive=True),
        found,
        mesh,
        {"analytic model": model.name},
        values,
        axes,
        warnings=warnings,
        notes=notes,
        fields=reachable,
    )


def of_mechanism(
    mechanism: Mechanism, mesh: setup.Mesh | None, models: setup.Models
) -> MechanismReach:
    """Return the ends of the motion of the output of a mechanism by the strokes of all actuators."""
    layout = mechanism.layout
    corners = _corners(mechanism)
    changes = finite.changes(
        mechanism, mesh, [finite.by_strokes(layout, x) for x in corners.commands]
    )

    def of_network(elastic: bool) -> plates.Values:
        return {"poses": _poses(mechanism, plates.network(mechanism, elastic), corners, None)}

    def of_size(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        response = plates.elements(mechanism, resolution, layers, thick)
        return {"poses": _poses(mechanism, response, corners, changes.of(label))}

    found = plates.by_models(mechanism, mesh, models, of_network, of_size)
    found = {label: _ends(one, corners, changes) for label, one in found.items()}
    warnings = changes.warnings("at the ends", mesh)
    notes = changes.notes("at the ends", mesh)
    return setup.answer(MechanismReach, mechanism, found, mesh, warnings=warnings, notes=notes)


class _Corners(NamedTuple):
    """Commands (c, m) of a mechanism at the ends of its ranges by linear theory, and their numbers.

    numbers : (2 others zero or free, 2 low and high, 3), -1 where no commands hold the others at
    zero."""

    commands: Array
    numbers: Index


def _corners(mechanism: Mechanism) -> _Corners:
    """Return the commands at the ends of the ranges, by the network or, without hinges, by coarse
    finite elements.

    With the others free they are those of few actuators that beams with finite rotations move
    farthest."""
    layout = mechanism.layout
    response = (
        plates.network(mechanism)
        if layout.joints
        else plates.elements(mechanism, plates.PART_RESOLUTION)
    )
    system = Driven.of_mechanism(mechanism, response.compliance)
    commands = PoseSet(system, stroke_limits(system), np.zeros(3)).ranges().commands
    if layout.joints and len(layout.actuators) <= MOST_STACKS:
        corners = np.array(
            list(product(*zip(layout.drive.lowest, layout.drive.highest, strict=True)))
        )
        changes = finite.changes(
            mechanism, None, [finite.by_strokes(layout, x) for x in corners]
        ).of(ANALYTIC)
        if changes is not None:
            poses = corners @ system.poses.T + np.array([one.motions[:3] for one in changes])
            commands[1] = corners[[np.argmin(poses, axis=0), np.argmax(poses, axis=0)]]
    whole = commands.reshape(-1, commands.shape[-1])
    known = ~np.isnan(whole).any(axis=1)
    unique, numbers = np.unique(whole[known], axis=0, return_inverse=True)
    found = np.full(len(whole), -1)
    found[known] = numbers.ravel()
    return _Corners(unique, found.reshape(commands.shape[:-1]))


def _poses(
    mechanism: Mechanism,
    response: plates.Responses,
    corners: _Corners,
    changes: Sequence[Displaced] | None,
) -> Array:
    """Return the poses (c, 3) at commands by one model: linear theory, and changes (c) to add."""
    poses = corners.commands @ Driven.of_mechanism(mechanism, response.compliance).poses.T
    return poses if changes is None else poses + np.array([one.motions[:3] for one in changes])


def _ends(
    found: setup.ModelAnswer, corners: _Corners, changes: finite.Changes
) -> setup.ModelAnswer:
    """Return the ends of the ranges from the poses at commands, and their bands with the errors of
    the changes.

    With the others free an end is that of the poses at all commands, since a finite displacement
    also moves the output along directions in which linear theory does not."""
    poses = found.values["poses"]
    widths = np.full(poses.shape, np.nan)
    if "poses" in found.bands and not changes.failure:
        widths = found.bands["poses"] + np.array([one.motions[:3] for one in changes.errors()])
    poses, widths = (np.vstack([rows, np.zeros(3)]) for rows in (poses, widths))  # at rest, too
    ends, bands = (np.full((2, 2, 3), np.nan) for _ in range(2))
    for at in np.ndindex(2, 2, 3):
        others, end, axis = at
        number = int(corners.numbers[at])
        if others == 1:
            number = int((np.argmin, np.argmax)[end](poses[:, axis]))
        if number >= 0:
            ends[at] = poses[number, axis]
            bands[at] = widths[number, axis]
    return setup.ModelAnswer({"ends": ends}, {"ends": bands} if found.bands else {})


class PoseSet:
    """The poses G x + rest (3,) that a drive reaches, with commands x within limits (n = 1) under a
    load (3,).
    """

    def __init__(self, system: Driven, limits: CommandLimits, load: Array) -> None:
        drive = system.drive
        self.G, self.rest, self.limits = system.poses, np.asarray(system.engaged @ load), limits
        names = [
            f"stroke of {name}, {end}" for end in ("longest", "shortest") for name in drive.names
        ]
        names += [f"{kind} of {name}" for kind in LIMITS[1:] for name in stack_names(drive)]
        self.names = names + [
            f"yield of the {hinge} hinge, chain {chain}"
            for chain in CHAINS
            for hinge in HINGE_NAMES
        ]
        unit = np.maximum(drive.highest, -drive.lowest)  # (m,), mm, size of the commands
        self.extent = np.abs(self.G) @ unit  # (3,), by strokes alone
        self.size, norm = (
            np.where(self.extent > 0, self.extent, 1.0),
            np.max(np.abs(limits.rows[0]) * unit, axis=1),
        )
        self.norm = np.where(norm > 0, norm, np.maximum(np.abs(limits.bounds[0]), 1.0))

    def farthest(self, C: Array, zero: tuple[int, ...] = ()) -> tuple[Array, list[LimitNames]]:
        """Return the commands x (p, m) that maximise C (p, m) @ x, with directions `zero` of the
        pose at 0, and the binding limits of each.

        Raises NothingAllowed.
        """
        axes = list(zero)
        p = len(C)
        held = self.G[axes] / self.size[axes, None]
        target = -self.rest[axes] / self.size[axes]
        base = np.linalg.pinv(held, SINGULAR) @ target
        if np.any(np.abs(held @ base - target) > EXACT):
            raise NothingAllowed
        free = np.linalg.svd(held)[2][np.linalg.matrix_rank(held, rtol=SINGULAR) if zero else 0 :].T
        along = C @ free
        along[np.linalg.norm(along, axis=1) <= SINGULAR * np.linalg.norm(C, axis=1)] = 0.0
        turned = np.linalg.svd(along[..., None])[0]  # the first axis is parallel to the objective
        turned[..., 0] *= np.where(
            np.sum(along * turned[..., 0], axis=1, keepdims=True) < 0, -1.0, 1.0
        )
        Z = free @ turned
        found = self.limits.farthest(np.zeros(p, dtype=np.int64), Z, np.tile(base, (p, 1)))
        if np.isnan(found.points).any():
            raise NothingAllowed
        X = base + np.einsum("pmd,pd->pm", Z, found.points)
        return X, [self._binding(free, *each) for each in zip(X, along, found.binding, strict=True)]

    def _binding(self, free: Array, x: Array, along: Array, found: Index) -> LimitNames:
        """Return the limits with positive multipliers, of least norm if they are not unique: by
        symmetry all are alike.

        found : numbers of binding limits, as in `CommandLimits`, which are returned if a neck
        yields."""
        rows = self.limits.rows[0] / self.norm[:, None]
        touching = np.flatnonzero(self.limits.bounds[0] / self.norm - rows @ x < EXACT)
        multipliers = np.linalg.lstsq((rows[touching] @ free).T, along)[0]
        if np.all(found < len(rows)) and np.min(multipliers, initial=0.0) > -EXACT * np.max(
            np.abs(along)
        ):
            found = touching[multipliers > MULTIPLIER * np.max(multipliers, initial=0.0)]
        return LimitNames(self.names[k] for k in sorted(set(found.tolist()) - {-1}))

    def ranges(self) -> PoseRanges:
        """Return the ends of the ranges along the axes.

        Fewer than three commands do not hold the others at zero. Raises NothingAllowed.
        """
        ends = np.full((2, 2, 3), np.nan)
        stops = Stops()
        commands = np.full((2, 2, 3, self.G.shape[1]), np.nan)
        for axis, direction in enumerate(DIRECTIONS):
            others_of = {"zero": tuple(k for k in range(3) if k != axis), "free": ()}
            for row, (others, zero) in enumerate(others_of.items()):
                if zero and self.G.shape[1] < 3:
                    continue
                try:
                    x, by = self.farthest(np.outer([-1.0, 1.0], self.G[axis]), zero)
                except NothingAllowed:
                    if others == "free":
                        raise
                    continue
                value = self.rest[axis] + x @ self.G[axis]
                commands[row, :, axis] = x
                ends[row, :, axis] = np.where(
                    np.abs(value) < ROUND_OFF * self.size[axis], 0.0, value
                )
                stops |= {
                    (others, direction, end): limits
                    for end, limits in zip(("low", "high"), by, strict=True)
                }
        return PoseRanges(ends, stops, commands)

    def solid(self, lever: float) -> Polytope:
        """Return the polytope of all poses. Raises NothingAllowed."""
        scale = np.array([1.0, 1.0, lever])
        size = float(np.max(scale * self.extent)) or 1.0
        G = scale[:, None] * self.G / size
        commands, dimension = self._spanning(G)
        if dimension < 3:
            return Polytope(
                dimension,
                np.zeros((0, 3)),
                commands[:0],
                np.zeros((0, 3)),
                np.zeros(0),
                [],
                [],
                0.0,
            )
        commands, missed = self._refined(G, commands)
        poses = commands @ self.G.T + self.rest
        commands = commands[
            np.lexsort(np.round(poses / np.max(np.abs(poses), axis=0), 6).T)
        ]  # order free of round-off
        corners, vertex_sets, volume = _corners_and_faces(commands @ G.T)
        commands = commands[corners]
        Z = commands @ G.T
        faces = []
        normals = []
        for face in vertex_sets:
            arms = Z[face] - np.mean(Z[face], axis=0)
            normal = np.linalg.svd(arms)[2][-1]
            normal *= np.sign(normal @ np.mean(Z[face] - np.mean(Z, axis=0), axis=0))
            angles = np.arctan2(arms @ np.cross(normal, arms[0]), arms @ arms[0])
            faces.append([face[k] for k in np.argsort(angles)])
            normals.append(normal)
        by = self.farthest(np.array(normals) @ G)[1]
        supports = np.max(np.array(normals) @ Z.T, axis=1) * size + normals @ (scale * self.rest)
        poses = commands @ self.G.T + self.rest
        volume = volume * size**3 / lever
        return Polytope(3, poses, commands, np.array(normals), supports, faces, by, volume, missed)

    def _spanning(self, G: Array) -> tuple[Array, int]:
        """Return commands whose images under G (3, m) span the set, and its dimension."""
        X = self.farthest(G[:1])[0]
        dimension = -1
        while True:
            _, values, axes = np.linalg.svd((X - X[0]) @ G.T)
            previous = dimension
            dimension = int(np.count_nonzero(values > FLAT))
            if dimension in (previous, 3):
                return X, dimension
            X = np.concatenate(
                [X, self.farthest(np.concatenate([axes[dimension:], -axes[dimension:]]) @ G)[0]]
            )

    def _refined(self, G: Array, commands: Array) -> tuple[Array, float]:
        """Add commands until the hull of their images is the set; return them and the relative
        distance left out.
        """
        from scipy.spatial import ConvexHull

        while True:
            planes = ConvexHull(commands @ G.T).equations
            planes = planes[
                np.unique(np.round(planes, 10), axis=0, return_index=True)[1]
            ]  # one of coplanar triangles
            X = self.farthest(planes[:, :3] @ G)[0]
            excess = np.sum(planes[:, :3] * (X @ G.T), axis=1) + planes[:, 3]
            if np.max(excess) <= EXACT or len(commands) >= MOST:
                missed = float(np.max(excess) / np.max(np.abs(commands @ G.T)))
                return commands, missed if np.max(excess) > EXACT else 0.0
            added = X[np.argsort(-excess, kind="stable")[: np.count_nonzero(excess > EXACT)]]
            commands = np.concatenate([commands, added[: MOST - len(commands)]])


def pose_set(model: Commanding, system: Driven, load: Array) -> PoseSet:
    """Return the poses of a driven stage under a load (3,); `model` gives the neck stress by the
    forces of `system`.
    """
    return PoseSet(
        system, command_limits(lower(model.stage), system.at(None), model.necks[None], load), load
    )


def _corners_and_faces(Z: Array) -> tuple[Index, list[list[int]], float]:
    """Return the vertices (indices) of the hull of points (p, 3), positions of each face in them,
    and the volume.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(Z)
    normals = hull.equations[:, :3]
    on_face = np.abs(Z @ normals.T + hull.equations[:, 3]) < 10 * EXACT
    corners = np.flatnonzero(
        [np.linalg.matrix_rank(normals[row], tol=FLAT) == 3 for row in on_face]
    )
    coincident = np.max(np.abs(Z[corners][:, None] - Z[corners]), axis=2) < 10 * EXACT
    corners = corners[~np.any(np.tril(coincident, -1), axis=1)]  # without duplicates
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in on_face[corners].T}
    faces = sorted(sorted(face) for face in sets if not any(face < other for other in sets))
    return corners, faces, float(hull.volume)


def _radius(solid: Polytope, centre: Array, directions: int) -> float:
    """Return the distance of a point (3,) from the faces in the first directions, mm; 0 if it is
    not inside.
    """
    tilt = np.maximum(np.linalg.norm(solid.normals[:, :directions], axis=1), FLAT)
    distance = (
        float(np.min((solid.supports - solid.normals @ centre) / tilt, initial=np.inf))
        if solid.faces
        else 0.0
    )
    return distance if distance > ROUND_OFF * np.max(np.abs(solid.supports), initial=0.0) else 0.0


def _why_unreachable(commanded: Commanding, poses: PoseSet, load: Array) -> str:
    """Describe the limits that allow no commands: kinds that exclude all with those of strokes, or
    all together.
    """
    infeasible = []
    limits = poses.limits
    drive = commanded.system.drive
    for kind in KINDS:
        chosen = [name.startswith((KINDS[0], kind)) for name in poses.names[: limits.rows.shape[1]]]
        strength = limits.strength if kind == "yield" else np.array([np.inf])
        part = limits._replace(
            rows=limits.rows[:, chosen], bounds=limits.bounds[:, chosen], strength=strength
        )
        try:
            PoseSet(commanded.system, part, load).farthest(drive.highest[None])
        except NothingAllowed:
            infeasible.append(kind)
    kinds = (
        " and those of ".join(infeasible)
        if infeasible
        else "stroke, contact, blocking force and yield together"
    )
    stress = _preload_stress(commanded, drive)
    under = "under this load" if np.any(load) else "without load"
    preloads = (
        f"; preloads alone stress the necks with up to {stress:.4g} {STRESS}"
        if stress > 1e-3
        else ""
    )
    return f"the drive reaches no pose: the limits of {kinds} allow no commands {under}{preloads}"


def _preload_stress(commanded: Commanding, drive: ActuatorSet) -> float:
    """Return the highest neck stress by the preloads alone, MPa; those of a pair balance and cause
    none.
    """
    return float(np.max(commanded.stress(np.zeros(3), drive.preload)))


def _warnings(
    commanded: Commanding, drive: ActuatorSet, solid: Polytope, lever: float
) -> list[str]:
    messages = list[str]()
    unpaired = np.count_nonzero(drive.differential, axis=0) == 1
    if np.any(np.abs(drive.differential[:, unpaired]).T @ drive.preload > 0):
        messages.append(
            "single stacks have no opposite stack that balances their preload, which stresses "
            f"the necks with up to {_preload_stress(commanded, drive):.4g} {STRESS} at zero "
            "commands (the model has no spring that carries the preload)"
        )
    rank = np.linalg.matrix_rank(
        np.array([[1.0], [1.0], [lever]]) * commanded.system.poses, rtol=SINGULAR
    )
    if rank < 3:
        messages.append(
            f"the drive moves the platform in {rank} of three directions: its poses are not a solid"
        )
    elif solid.dimension < 3:
        messages.append(
            f"the poses within the limits are not a solid: they {EXTENDS[solid.dimension]}"
        )
    return messages
