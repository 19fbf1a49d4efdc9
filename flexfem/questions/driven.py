"""Driven stages from a compliance of either model: motion by strokes, strokes for a pose, and limits.

With loads F on the platform and forces f of n stacks that push their bodies apart, [U; d] = C [F; f]. A stack of
stiffness k and free stroke s fills its opening: d = s - f / k. With commands x, all relative to rest:

    s = T x,   f = Y (s - C_dF F),   Y = (k^-1 + C_dd)^-1,   U = C_UF F + C_Ud f
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic.model import at_necks
from flexfem.arrays import Array, Index, inverse
from flexfem.hinges.strength import stress_raised
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.designs import Designs, Frames
from flexfem.mechanism.drives import StageDrive
from flexfem.questions.warnings import YIELD_MARGIN
from flexfem.refused import ComputationFailed

Criterion: TypeAlias = Literal["least energy", "least stroke", "within limits"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)
ROUND_OFF = 1e-9  # of the largest stroke or force
Limit: TypeAlias = Literal["stroke", "contact", "blocking force"]
LIMITS: tuple[Limit, ...] = get_args(Limit)
NOTHING_ALLOWED: dict[Limit, str] = {  # reasons why a limit of zero size in one direction excludes all strokes
    "stroke": "some single stacks would need strokes below their minimum of 0 um",
    "contact": "some stacks without preload would have to pull",
    "blocking force": "some stacks preloaded to their blocking force would have to push harder",
}
SINGULAR = 1e-9  # of the largest singular value: in such a direction no command moves the platform
HALF_LENGTH, SECTIONS = 0.7, 141  # of the checked part of a neck, per notch radius, and number of sections
SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])  # of bending and tension
YIELDING = 1e-11  # of the yield strength: round-off
NO_MOTION = 1e-16  # of the largest limit: smaller commands do not set the scale of a linear program
BATCH = 256  # designs at a time, so that their programs stay in the processor cache
FAR = 1e7  # larger than every solution of a bounded program with rows of unit norm and bounds of at most one
FLAT, TOLERANCE = 1e-11, 1e-12  # of such programs: pivots that are round-off; violation relative to the point
STEPS, PATIENCE = 300, 100  # simplex steps; after PATIENCE of them the first violated limit enters, against cycling
TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


class Unreachable(ComputationFailed):
    """No strokes of any size hold a pose; `reason` names the limit responsible."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"no strokes of any size hold this pose: {reason}")
        self.reason = reason


class DriveLimits(NamedTuple):
    """Limits (..., k) of commands (m,): rows (..., k, m) @ command <= offsets + sizes."""

    rows: Array
    offsets: Array
    sizes: Array


class Driven(NamedTuple):
    """A driven stage; leading axes are designs.

    C : (..., 3 + n, 3 + n), mm, rad per N, N mm.   Y : (..., n, n), N/mm, stack forces per stroke.
    T : (n, m), strokes per command.
    """

    C: Array
    Y: Array
    T: Array

    @property
    def poses(self) -> Array:
        """Pose (..., 3, m) per command, mm and rad per mm."""
        return np.asarray(self.C[..., :3, 3:] @ self.Y @ self.T)

    @property
    def engaged(self) -> Array:
        """Compliance (..., 3, 3) of the platform with the stacks holding their strokes."""
        return np.asarray(self.C[..., :3, :3] - self.C[..., :3, 3:] @ self.Y @ self.C[..., 3:, :3])


class Motion(NamedTuple):
    """Pose (3,), forces (n,), N, relative to rest, and strain energy, N mm, of the stage and of stacks and contacts."""

    pose: Array
    force: Array
    stage: float
    stacks: float


def driven(C: Array, drive: StageDrive) -> Driven:
    """Return a driven stage of compliance C; Y = k^1/2 (1 + k^1/2 C_dd k^1/2)^-1 k^1/2 also holds for k = 0."""
    root = np.sqrt(drive.stiffness)
    inner = inverse(np.eye(root.shape[-1]) + root[..., :, None] * C[..., 3:, 3:] * root[..., None, :])
    return Driven(C, root[..., :, None] * inner * root[..., None, :], drive.differential)


def held(C: Array) -> Driven:
    """Return a stage of compliance (..., 3 + n, 3 + n) whose openings are prescribed as commands."""
    return Driven(C, inverse(C[..., 3:, 3:]), np.eye(C.shape[-1] - 3))


def moved(system: Driven, drive: StageDrive, command: Array, load: Array) -> Motion:
    """Return the motion of one stage by commands (m,), mm, and a load (3,), N, N, N mm."""
    force = system.Y @ (system.T @ command - system.C[3:, :3] @ load)
    loads = np.concatenate([load, force])
    displacement = system.C @ loads
    with np.errstate(divide="ignore", invalid="ignore"):
        stacks = np.where(force == 0, 0.0, force**2 / drive.stiffness)
    return Motion(displacement[:3], force, float(loads @ displacement / 2), float(np.sum(stacks) / 2))


def commands_for(
    system: Driven, drive: StageDrive, pose: Array, load: Array, lever: float, criterion: Criterion
) -> Array:
    """Return the commands (m,), mm, for a pose (3,) under a load (3,); lever, mm, scales rotations to lengths.

    Raises ComputationFailed if no commands of any size reach the pose.

    Notes
    -----
    least energy : of the stage, (29). Under a load the work on the platform depends on the pose alone, so the energy of
        the forces is minimised: min f' C_dd f.
    least stroke : minimise the largest command relative to its own limit, a linear program.
    within limits : minimise the largest share of any limit: strokes, preloads of contacts that must stay closed, and
        blocking forces less the preloads.
    """
    scale = np.array([1.0, 1.0, lever])
    G, target = scale[:, None] * system.poses, scale * (pose - system.engaged @ load)
    if np.linalg.matrix_rank(G, rtol=SINGULAR) < 3:
        raise ComputationFailed("the drive does not move the platform in three directions: no strokes for this pose")
    if criterion == "least energy":
        commands = _least_energy(system, G, target, load)
    else:
        limits = limits_of(system, drive, load)
        commands = _least_share(limits if criterion == "within limits" else {"stroke": limits["stroke"]}, G, target)
    return np.asarray(commands + np.linalg.lstsq(G, target - G @ commands, rcond=None)[0])  # remove round-off


def unit_commands(system: Driven, drive: StageDrive, lever: float) -> Array:
    """Return the commands of least energy (m, 3) per mm in x and y and per rad, without load."""
    poses, no_load = np.diag([1.0, 1.0, 1.0 / lever]), np.zeros(3)
    commands = [commands_for(system, drive, pose, no_load, lever, "least energy") for pose in poses]
    return np.array(commands).T @ np.diag([1.0, 1.0, lever])


def _least_energy(system: Driven, G: Array, target: Array, load: Array) -> Array:
    """Minimise f' C_dd f with f = Y (T x - C_dF F) and G x = target, in the null space of G.

    Combinations of commands without energy in a rigid model, as with six pairs on mobility three, keep the smallest
    strokes, because their energy is round-off.
    """
    particular = np.linalg.lstsq(G, target, rcond=None)[0]
    free = np.linalg.svd(G)[2][3:].T
    C_dd, per_command = system.C[3:, 3:], system.Y @ system.T
    force = per_command @ particular - system.Y @ system.C[3:, :3] @ load
    F = per_command @ free
    energy, vectors = np.linalg.eigh(F.T @ C_dd @ F)
    kept = energy > SINGULAR * np.linalg.norm(per_command.T @ C_dd @ per_command, 2)
    F, free = F @ vectors[:, kept], free @ vectors[:, kept]
    return np.asarray(particular - free @ (F.T @ C_dd @ force / energy[kept]))


def _least_share(limits: Mapping[Limit, DriveLimits], G: Array, target: Array) -> Array:
    """Minimise t with rows x <= offsets + t sizes, for all limits together, and G x = target.

    Raises Unreachable with the reason if no x exists; then limits of zero size exclude every t.
    """
    commands = _program(DriveLimits(*map(np.concatenate, zip(*limits.values(), strict=True))), G, target)
    if commands is not None:
        return commands
    zero = {name: DriveLimits(*(part[limit.sizes == 0] for part in limit)) for name, limit in limits.items()}
    binding = {name: limit for name, limit in zero.items() if len(limit.rows)}
    alone = [name for name, limit in binding.items() if _program(limit, G, target) is None]
    raise Unreachable(", and ".join(NOTHING_ALLOWED[name] for name in alone or binding))


def _program(limits: DriveLimits, G: Array, target: Array) -> Array | None:
    """Minimise t with rows x <= offsets + t sizes and G x = target; None if there is no such x."""
    rows, offsets, sizes = limits
    unit, most = float(np.max(np.abs(np.linalg.lstsq(G, target, rcond=None)[0]))), float(np.max(sizes)) or 1.0
    unit = unit if unit > NO_MOTION * most else most
    size = np.max(np.abs(G)) * unit
    norm = np.maximum(np.max(np.abs(rows), axis=1) * unit, np.finfo(float).tiny)
    solution = linear_program(
        np.append(np.zeros(G.shape[1]), 1.0),
        A_ub=np.column_stack([rows * unit, -sizes]) / norm[:, None],
        b_ub=offsets / norm,
        A_eq=np.column_stack([G * unit, np.zeros(3)]) / size,
        b_eq=target / size,
        bounds=[(None, None)] * G.shape[1] + [(0, None)],
    )
    return None if solution is None else np.asarray(solution.x[:-1] * unit)


def linear_program(cost: Array, **limits: Any) -> Any:
    """Minimise cost @ x by HiGHS with limits of scipy's `linprog`; None if infeasible. Raises ComputationFailed."""
    from scipy.optimize import linprog

    solution = linprog(cost, **limits, method="highs", options=TIGHT)
    if solution.status not in (0, 2):
        raise ComputationFailed(f"linear program of a drive: {solution.message}")
    return solution if solution.status == 0 else None


def limits_of(system: Driven, drive: StageDrive, load: Array) -> dict[Limit, DriveLimits]:
    """Return the limits of a drive under a load (3,): highest then lowest commands, and stack forces both ways."""
    unit, sizes = np.eye(drive.lowest.shape[-1]), np.abs(np.concatenate([drive.highest, drive.lowest], axis=-1))
    per_command, at_rest = system.Y @ system.T, system.Y @ system.C[..., 3:, :3] @ load
    reserve = drive.blocking_force - drive.preload
    reserve[np.abs(reserve) <= BLOCKING_ROUND_OFF * drive.blocking_force] = 0.0
    return {
        "stroke": DriveLimits(np.concatenate([unit, -unit]), np.zeros_like(sizes), sizes),
        "blocking force": DriveLimits(per_command, at_rest, reserve),
        "contact": DriveLimits(-per_command, -at_rest, drive.preload),
    }


def shares(system: Driven, drive: StageDrive, command: Array, load: Array) -> dict[Limit, Array]:
    """Return the share of each limit that commands use, above one if exceeded: of strokes (2m,), of forces (n,).

    It is inf for a limit of zero, as at the contact of a stack without preload that would have to pull.
    """
    found, limits = dict[Limit, Array](), limits_of(system, drive, load)
    for name in LIMITS:
        rows, offsets, sizes = limits[name]
        used = rows @ command - offsets
        unused = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found[name] = np.where(unused, 0.0, used / sizes)
    return found


def neck_forces(frames: Frames, wrenches: Array) -> Array:
    """Return moments, axial and shear forces (3, ..., 3 chains, 3 hinges, k) of necks by wrenches (..., 3, 3, 3, k)."""
    return np.array(at_necks(frames, wrenches))


def per_command(system: Driven, frames: Frames, necks: Array) -> Array:
    """Return the neck forces (3, ..., 3, 3, m) per command, from the wrenches `necks` of `DrivenModel`."""
    return neck_forces(frames, necks[..., 3:] @ (system.Y @ system.T)[..., None, None, :, :])


def sections_of(designs: Designs) -> Array:
    """Return sections along the necks of n designs, (3, n, 3, 3, SECTIONS), the middle one at the centre.

    They are the lever of a shear force, mm, the von Mises stress of the moment, MPa per N mm, and that of an axial
    force, MPa per N: `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|` at x from the centre, with the height h(x).
    """
    radius, neck = designs.radius[..., None], designs.neck[..., None]
    x = radius * np.linspace(-HALF_LENGTH, HALF_LENGTH, SECTIONS)
    height = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (factor[..., None] for factor in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * height
    return np.stack([x * shear / bending, 6 * bending / area / height, tension / area])


def stress_along(sections: Array, forces: Array) -> Array:
    """Return the stress (..., 3, 3, s), MPa, at sections (3, ..., 3, 3, s) of `sections_of`; forces (3, ..., 3, 3)."""
    (x, bending, tension), (M, N, V) = sections, forces[..., None]
    return np.asarray(np.abs(bending * (M + V * x)) + np.abs(tension * N))


def limits_of_necks(sections: Array, forces: Array, at_rest: Array, strength: float) -> DriveLimits:
    """Return all 36 s half-spaces of the commands of one design within which no section yields at `strength`, MPa.

    forces : (3, 3, 3, m), per command.   at_rest : (3, 3, 3), of a load without commands.
    """
    x, bending, tension = sections[..., None]
    M, N, V = np.concatenate([forces, at_rest[..., None]], axis=-1)[..., None, :]
    bending_stress, axial_stress = bending * (M + V * x), tension * N
    stress = SIGNS[:, :1] * bending_stress[..., None, :] + SIGNS[:, 1:] * axial_stress[..., None, :]
    rows = stress.reshape(-1, stress.shape[-1])
    return DriveLimits(rows[:, :-1], -rows[:, -1], np.full(len(rows), strength))


class DriveRanges(NamedTuple):
    """Reach of the drives of n designs each way (n, 2, 3), mm and rad, and stiffness (n, 3, 3) with the stacks engaged.

    The reach is nan if a drive does not move its design in three directions, or if preloads alone make a neck yield.
    """

    reach: Array
    engaged: Array

    @property
    def range(self) -> Array:
        """Smaller reach (n, 3) of both ways."""
        return np.asarray(np.min(self.reach, axis=1))


def drive_ranges(designs: Designs, system: Driven, necks: Array, drive: StageDrive) -> DriveRanges:
    """Return the ranges of the drives of n designs; necks (n, 3 chains, 3 hinges, 3, 3 + stacks) as of `DrivenModel`.

    Notes
    -----
    The commands for the pose t along an axis, other directions zero, are x = t u + N y, with u of least norm and the
    columns of N in the null space: the largest t is the solution of a linear program in t and y, limited by strokes,
    contacts and blocking forces. Of yield, only half-spaces that a solution violates are added, at the worst section.
    """
    n = len(designs.thickness)
    with np.errstate(divide="ignore", invalid="ignore"):  # normalised so that rotations compare with translations
        normalised = np.nan_to_num(system.poses / np.linalg.norm(system.poses, axis=2, keepdims=True))
    reach, moving = np.full((n, 2, 3), np.nan), np.flatnonzero(np.linalg.matrix_rank(normalised, rtol=SINGULAR) == 3)
    forces = per_command(system, designs.frames, necks).reshape(3, n, 9, -1)
    rest = neck_forces(designs.frames, necks[..., 3:] @ drive.preload[:, None, None, :, None]).reshape(3, n, 9)
    for begin in range(0, len(moving), BATCH):
        batch = moving[begin : begin + BATCH]
        Z, rows, bounds = _along_axes(Driven(system.C[batch], system.Y[batch], system.T), drive.at(batch))
        design = np.repeat(np.arange(len(batch)), 6)  # of each program
        cut = _yield_of(designs.chosen(batch), design, forces[:, batch][:, design] @ Z, rest[:, batch][:, design])
        yields_at_rest, *_ = cut(np.arange(len(Z)), np.zeros_like(Z[:, 0]))
        reach[batch] = np.where(yields_at_rest, np.nan, farthest(rows, bounds, cut)[:, 0]).reshape(-1, 2, 3)
    return DriveRanges(reach, inverse(system.engaged))


def _along_axes(system: Driven, drive: StageDrive) -> tuple[Array, Array, Array]:
    """Return six programs per design, both ways along x, y, theta: commands x = Z (t, y), Z (p, m, d), and limits on
    (t, y) with rows (p, k, d) and bounds (p, k).
    """
    scale = 1 / np.linalg.norm(system.poses, axis=2, keepdims=True)
    free = np.swapaxes(np.linalg.svd(system.poses * scale)[2][:, 3:], 1, 2)
    least = np.linalg.pinv(system.poses * scale) * np.swapaxes(scale, 1, 2)  # (n, m, 3): commands of unit poses
    n, m, d = len(least), least.shape[1], free.shape[2] + 1
    limits = limits_of(system, drive, np.zeros(3)).values()
    rows = np.concatenate([np.broadcast_to(limit.rows, (n, *limit.rows.shape[-2:])) for limit in limits], axis=1)
    bounds = np.concatenate([limit.offsets + limit.sizes for limit in limits], axis=-1)
    Z = np.concatenate([np.moveaxis(least, 2, 1)[..., None], np.broadcast_to(free[:, None], (n, 3, m, d - 1))], axis=-1)
    Z = np.stack([Z, Z * np.append(-1.0, np.ones(d - 1))], axis=1).reshape(6 * n, m, d)
    return Z, np.repeat(rows, 6, axis=0) @ Z, np.repeat(bounds, 6, axis=0)


# of points (q, d) of chosen programs: whether a limit is violated, and the rows (q, d) and bounds (q,) of the worst one
Cut: TypeAlias = Callable[[Index, Array], tuple[NDArray[np.bool_], Array, Array]]


def _yield_of(designs: Designs, design: Index, forces: Array, rest: Array) -> Cut:
    """Return yield as a `Cut` of p programs with designs (p,), neck forces (3, p, 9, d) and those at rest (3, p, 9)."""
    sections = sections_of(designs).reshape(3, len(designs.thickness), 9, -1)
    lever, most_bending, most_tension = np.max(np.abs(sections), axis=-1)  # for an upper bound of the stress
    strength = designs.yield_strength * (1 - YIELD_MARGIN[designs.plane])  # the model may underestimate the stress

    def cut(which: Index, z: Array) -> tuple[NDArray[np.bool_], Array, Array]:
        k, allowed = design[which], strength[design[which]]
        violated, rows, bounds = np.zeros(len(z), dtype=bool), np.zeros(z.shape), np.zeros(len(z))
        loaded = np.einsum("ipkd,pd->ipk", forces[:, which], z) + rest[:, which]
        M, N, V = np.abs(loaded)
        most = most_bending[k] * (M + lever[k] * V) + most_tension[k] * N
        near = np.flatnonzero(np.any(most > allowed[:, None], axis=1))
        if not len(near):
            return violated, rows, bounds
        stress = stress_along(sections[:, k[near]], loaded[:, near])
        neck, section = np.divmod(np.argmax(stress.reshape(len(near), -1), axis=1), SECTIONS)
        violated[near] = stress[np.arange(len(near)), neck, section] > allowed[near] * (1 + YIELDING)
        x, bending, tension = sections[:, k[near], neck, section]
        M, N, V = loaded[:, near, neck]
        bending, tension = np.sign(M + V * x) * bending, np.sign(N) * tension
        moment, axial, shear = forces[:, which[near], neck]
        rows[near] = (bending * (moment + shear * x[:, None]).T + tension * axial.T).T
        M, N, V = rest[:, which[near], neck]
        bounds[near] = allowed[near] - bending * (M + V * x) - tension * N
        return violated, rows, bounds

    return cut


def farthest(A: Array, b: Array, cut: Cut | None = None) -> Array:
    """Return the points (p, d) of largest z_0 with A z <= b, A (p, k, d), b (p, k), bounded; nan if infeasible.

    Notes
    -----
    The dual simplex method takes a step of all programs at a time: from a far corner of a box, the most violated limit
    replaces one of the d active limits, and the vertex is solved for again. For 256 programs in four unknowns HiGHS
    took 19 times as long with one block-diagonal program, and 88 times as long one by one.
    """
    p, _, d = A.shape
    unit = _inverse_scale(np.max(np.abs(A), axis=1))
    rows = A * unit[:, None, :]
    norm = _inverse_scale(np.linalg.norm(rows, axis=2))
    rows, bounds = rows * norm[..., None], b * norm
    span = _inverse_scale(np.max(np.abs(bounds), axis=1))
    bounds = bounds * span[:, None]
    active, active_bounds, found = np.tile(np.eye(d), (p, 1, 1)), np.full((p, d), FAR), np.full((p, d), np.nan)
    todo = np.arange(p)
    for step in range(STEPS):
        inverses = np.linalg.inv(active[todo])
        z = np.einsum("pij,pj->pi", inverses, active_bounds[todo])
        excess = np.einsum("pkd,pd->pk", rows[todo], z) - bounds[todo]
        violated = excess > TOLERANCE * (1 + np.max(np.abs(z), axis=1, keepdims=True))
        enters, unsolved = np.argmax(excess if step < PATIENCE else violated, axis=1), violated.any(axis=1)
        row, bound = rows[todo, enters], bounds[todo, enters]
        if cut is not None and not unsolved.all():
            within = np.flatnonzero(~unsolved)
            which = todo[within]
            unsolved[within], cut_rows, cut_bounds = cut(which, z[within] * unit[which] / span[which, None])
            cut_norm = _inverse_scale(np.linalg.norm(cut_rows * unit[which], axis=1))
            row[within] = cut_rows * unit[which] * cut_norm[:, None]
            bound[within] = cut_bounds * span[which] * cut_norm
        done = ~unsolved & np.all(active_bounds[todo] < FAR, axis=1)
        found[todo[done]] = z[done] * unit[todo[done]] / span[todo[done], None]
        pivots = np.einsum("pi,pij->pj", row, inverses)  # the entering row in terms of the active ones
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(pivots > FLAT, np.maximum(inverses[:, 0], 0.0) / pivots, np.inf)
        least = np.min(ratio, axis=1)
        ties = ratio <= least[:, None] * (1 + FLAT)
        leaves = np.argmax(np.where(ties, pivots, -1.0) if step < PATIENCE else ties, axis=1)
        unsolved &= np.isfinite(least)
        todo, row, bound, leaves = todo[unsolved], row[unsolved], bound[unsolved], leaves[unsolved]
        if not len(todo):
            break
        active[todo, leaves], active_bounds[todo, leaves] = row, bound
    return found


def _inverse_scale(size: Array) -> Array:
    """Return 1 / size, and one for a size of zero."""
    return np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)
