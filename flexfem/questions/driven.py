"""Driven stages by algebra on a compliance of either model: what strokes do, which strokes a pose takes, the limits.

With loads F on the platform and the forces f by which n stacks push their bodies apart, [U; d] = C [F; f]. A stack of
stiffness k with the free stroke s fills its opening: d = s - f / k. With commands x, all beyond rest:

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
NOTHING_ALLOWED: dict[Limit, str] = {  # of limits that allow nothing at all in one direction, why no strokes do
    "stroke": "some single stacks would need strokes below 0 um, their least",
    "contact": "some stacks without preload would have to pull",
    "blocking force": "some stacks preloaded to their blocking force would have to push harder",
}
SINGULAR = 1e-9  # of the largest: a direction in which no command moves the platform
BESIDE, SECTIONS = 0.7, 141  # how far beside the centre, per radius of the notch, and at how many places
SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])  # of bending and of tension
YIELDING = 1e-11  # of the yield strength: round-off
NO_MOTION = 1e-16  # of the largest size of a limit: commands so small are none to a linear program
TOGETHER = 256  # designs at a time: their programs stay in the cache of a processor
FAR = 1e7  # of rows of unit norm and ends of at most one: beyond every solution of a bounded program
FLAT, KEPT = 1e-11, 1e-12  # of such rows: pivots that are round-off; by how much of the point one may be broken
STEPS, PATIENCE = 300, 100  # of the simplex method; the first that is broken is taken after so many: no circles
TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


class Unreachable(ComputationFailed):
    """No strokes hold a pose, whatever their size; `reason` says which limit is why."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"no strokes of any size hold this pose: {reason}")
        self.reason = reason


class DriveLimits(NamedTuple):
    """Limits (..., k) of commands (m,): rows (..., k, m) @ command <= offsets + sizes; sizes of zero allow nothing."""

    rows: Array
    offsets: Array
    sizes: Array


class Driven(NamedTuple):
    """A driven stage; leading axes are designs.

    C : (..., 3 + n, 3 + n), mm, rad per N, N mm.   Y : (..., n, n), N/mm, forces of the stacks per stroke.
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
    """Pose (3,), forces (n,), N, beyond rest, and strain energy, N mm, of the stage and of stacks and contacts."""

    pose: Array
    force: Array
    stage: float
    stacks: float


def driven(C: Array, drive: StageDrive) -> Driven:
    """A driven stage by its compliance (..., 3 + n, 3 + n): Y = k^1/2 (1 + k^1/2 C_dd k^1/2)^-1 k^1/2 has k = 0 too."""
    root = np.sqrt(drive.stiffness)
    inner = inverse(np.eye(root.shape[-1]) + root[..., :, None] * C[..., 3:, 3:] * root[..., None, :])
    return Driven(C, root[..., :, None] * inner * root[..., None, :], drive.differential)


def held(C: Array) -> Driven:
    """A stage (..., 3 + n, 3 + n) whose openings are the commands themselves, by whatever forces that takes."""
    return Driven(C, inverse(C[..., 3:, 3:]), np.eye(C.shape[-1] - 3))


def moved(of: Driven, drive: StageDrive, command: Array, load: Array) -> Motion:
    """What commands (m,), mm, and a load (3,), N, N, N mm, do to one stage."""
    force = of.Y @ (of.T @ command - of.C[3:, :3] @ load)
    both = np.concatenate([load, force])
    found = of.C @ both
    with np.errstate(divide="ignore", invalid="ignore"):
        stacks = np.where(force == 0, 0.0, force**2 / drive.stiffness)
    return Motion(found[:3], force, float(both @ found / 2), float(np.sum(stacks) / 2))


def commands_for(of: Driven, drive: StageDrive, pose: Array, load: Array, lever: float, criterion: Criterion) -> Array:
    """Commands (m,), mm, for a pose (3,) under a load (3,); lever, mm, makes rotations comparable.

    Raises ComputationFailed when no commands reach the pose, whatever their size.

    Notes
    -----
    least energy : of the stage, (29). Under a load the energy of the platform's work is that of the pose, whatever the
        commands, so that the forces alone are to be least: min f' C_dd f.
    least stroke : the largest of the commands, each as a share of its own limit, is least: a linear program.
    within limits : the largest share of any limit is least: of the strokes, of preloads that contacts may not lose,
        and of what blocking forces leave.
    """
    scale = np.array([1.0, 1.0, lever])
    G, wanted = scale[:, None] * of.poses, scale * (pose - of.engaged @ load)
    if np.linalg.matrix_rank(G, rtol=SINGULAR) < 3:
        raise ComputationFailed("the drive does not move the platform in three directions: no strokes for this pose")
    if criterion == "least energy":
        found = _least_energy(of, G, wanted, load)
    else:
        limits = limits_of(of, drive, load)
        found = _least_share(limits if criterion == "within limits" else {"stroke": limits["stroke"]}, G, wanted)
    return np.asarray(found + np.linalg.lstsq(G, wanted - G @ found, rcond=None)[0])  # what the programs rounded off


def unit_commands(of: Driven, drive: StageDrive, lever: float) -> Array:
    """Commands of least energy (m, 3) per mm in x and y and per rad, without load."""
    units, none = np.diag([1.0, 1.0, 1.0 / lever]), np.zeros(3)
    each = [commands_for(of, drive, unit, none, lever, "least energy") for unit in units]
    return np.array(each).T @ np.diag([1.0, 1.0, lever])


def _least_energy(of: Driven, G: Array, wanted: Array, load: Array) -> Array:
    """min f' C_dd f with f = Y (T x - C_dF F) and G x = wanted, in the null space of G.

    Commands against each other that a rigid model gives no energy, as six pairs on mobility three, are left at the
    smallest strokes: their energy is round-off.
    """
    particular = np.linalg.lstsq(G, wanted, rcond=None)[0]
    free = np.linalg.svd(G)[2][3:].T
    per_command = of.Y @ of.T
    force = per_command @ particular - of.Y @ of.C[3:, :3] @ load
    F = per_command @ free
    energy, turned = np.linalg.eigh(F.T @ of.C[3:, 3:] @ F)
    kept = energy > SINGULAR * np.linalg.norm(per_command.T @ of.C[3:, 3:] @ per_command, 2)
    F, free = F @ turned[:, kept], free @ turned[:, kept]
    return np.asarray(particular - free @ (F.T @ of.C[3:, 3:] @ force / energy[kept]))


def _least_share(limits: Mapping[Limit, DriveLimits], G: Array, wanted: Array) -> Array:
    """min t with rows x <= offsets + t sizes, of all limits together, and G x = wanted.

    Raises Unreachable, which says why, when no x does: then some of the limits allow nothing at all, whatever t.
    """
    found = _program(DriveLimits(*map(np.concatenate, zip(*limits.values(), strict=True))), G, wanted)
    if found is not None:
        return found
    none = {name: DriveLimits(*(part[each.sizes == 0] for part in each)) for name, each in limits.items()}
    binding = {name: each for name, each in none.items() if len(each.rows)}
    alone = [name for name, each in binding.items() if _program(each, G, wanted) is None]
    raise Unreachable(", and ".join(NOTHING_ALLOWED[name] for name in alone or binding))


def _program(of: DriveLimits, G: Array, wanted: Array) -> Array | None:
    """min t with rows x <= offsets + t sizes and G x = wanted; None where there is no such x."""
    rows, offsets, sizes = of
    unit, most = float(np.max(np.abs(np.linalg.lstsq(G, wanted, rcond=None)[0]))), float(np.max(sizes)) or 1.0
    unit = unit if unit > NO_MOTION * most else most
    size = np.max(np.abs(G)) * unit
    norm = np.maximum(np.max(np.abs(rows), axis=1) * unit, np.finfo(float).tiny)
    found = linear_program(
        np.append(np.zeros(G.shape[1]), 1.0),
        A_ub=np.column_stack([rows * unit, -sizes]) / norm[:, None],
        b_ub=offsets / norm,
        A_eq=np.column_stack([G * unit, np.zeros(3)]) / size,
        b_eq=wanted / size,
        bounds=[(None, None)] * G.shape[1] + [(0, None)],
    )
    return None if found is None else np.asarray(found.x[:-1] * unit)


def linear_program(cost: Array, **limits: Any) -> Any:
    """Least cost @ x by HiGHS, limits as of scipy's `linprog`; None where they allow no x. Raises ComputationFailed."""
    from scipy.optimize import linprog

    found = linprog(cost, **limits, method="highs", options=TIGHT)
    if found.status not in (0, 2):
        raise ComputationFailed(f"linear program of a drive: {found.message}")
    return found if found.status == 0 else None


def limits_of(of: Driven, drive: StageDrive, load: Array) -> dict[Limit, DriveLimits]:
    """Limits of a drive under a load (3,): of commands the highest, then the lowest; of forces both ways."""
    one, sizes = np.eye(drive.lowest.shape[-1]), np.abs(np.concatenate([drive.highest, drive.lowest], axis=-1))
    per_command, at_rest = of.Y @ of.T, of.Y @ of.C[..., 3:, :3] @ load
    left = drive.blocking_force - drive.preload
    left[np.abs(left) <= BLOCKING_ROUND_OFF * drive.blocking_force] = 0.0
    return {
        "stroke": DriveLimits(np.concatenate([one, -one]), np.zeros_like(sizes), sizes),
        "blocking force": DriveLimits(per_command, at_rest, left),
        "contact": DriveLimits(-per_command, -at_rest, drive.preload),
    }


def shares(of: Driven, drive: StageDrive, command: Array, load: Array) -> dict[Limit, Array]:
    """Shares that commands take of each limit, above one where they break it: of strokes (2m,), of forces (n,).

    inf where nothing is allowed: the contact of a stack without preload that would have to pull.
    """
    found, limits = dict[Limit, Array](), limits_of(of, drive, load)
    for name in LIMITS:
        rows, offsets, sizes = limits[name]
        used = rows @ command - offsets
        none = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found[name] = np.where(none, 0.0, used / sizes)
    return found


def neck_forces(frames: Frames, wrenches: Array) -> Array:
    """Moments, forces along and across (3, ..., 3 chains, 3 hinges, k) of necks, by wrenches (..., 3, 3, 3, k)."""
    return np.array(at_necks(frames, wrenches))


def per_command(of: Driven, frames: Frames, necks: Array) -> Array:
    """What necks carry (3, ..., 3, 3, m) per command, by the wrenches `necks` of `DrivenModel`."""
    return neck_forces(frames, necks[..., 3:] @ (of.Y @ of.T)[..., None, None, :, :])


def sections_of(designs: Designs) -> Array:
    """Places along the necks of n designs, (3, n, 3, 3, SECTIONS), the middle one at the centre.

    Lever of a force across the neck, mm; von Mises stress of the moment there, MPa per N mm, and of a force along the
    neck, MPa per N: `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|` at x from the centre, h the height there.
    """
    radius, neck = designs.radius[..., None], designs.neck[..., None]
    x = radius * np.linspace(-BESIDE, BESIDE, SECTIONS)
    high = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (part[..., None] for part in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * high
    return np.stack([x * shear / bending, 6 * bending / area / high, tension / area])


def stress_along(at: Array, carried: Array) -> Array:
    """Stress (..., 3, 3, s), MPa, at places (3, ..., 3, 3, s) of `sections_of`, of forces (3, ..., 3, 3)."""
    (x, bending, tension), (M, N, V) = at, carried[..., None]
    return np.asarray(np.abs(bending * (M + V * x)) + np.abs(tension * N))


def limits_of_necks(at: Array, carried: Array, at_rest: Array, strength: float) -> DriveLimits:
    """Every half-space that yield at `strength`, MPa, sets to the commands of one design: 36 s of them.

    carried : (3, 3, 3, m), per command.   at_rest : (3, 3, 3), of a load without commands.
    """
    (x, bending, tension), (M, N, V) = (
        at[..., None],
        np.concatenate([carried, at_rest[..., None]], axis=-1)[..., None, :],
    )
    bent, pulled = bending * (M + V * x), tension * N
    stress = SIGNS[:, :1] * bent[..., None, :] + SIGNS[:, 1:] * pulled[..., None, :]
    rows = stress.reshape(-1, stress.shape[-1])
    return DriveLimits(rows[:, :-1], -rows[:, -1], np.full(len(rows), strength))


class DriveRanges(NamedTuple):
    """How far drives of n designs reach each way (n, 2, 3), mm and rad, and their stiffness (n, 3, 3) with the stacks.

    nan for a design that they do not move in three directions, and for one whose preloads alone make a neck yield.
    """

    reach: Array
    engaged: Array

    @property
    def range(self) -> Array:
        """The lesser (n, 3) of both ways."""
        return np.asarray(np.min(self.reach, axis=1))


def drive_ranges(designs: Designs, of: Driven, necks: Array, drive: StageDrive) -> DriveRanges:
    """What the drives of n designs do; necks (n, 3 chains, 3 hinges, 3, 3 + stacks) as of `DrivenModel`.

    Notes
    -----
    Along an axis the commands for the pose t, the others zero, are x = t u + N y, u of least norm, N the commands that
    leave the platform where it is: the farthest t is a linear program in t and y, of strokes, contacts and blocking
    forces. Of yield only the half-spaces are looked at that a solution breaks, at the worst place of all necks.
    """
    n = len(designs.thickness)
    with np.errstate(divide="ignore", invalid="ignore"):  # rotations by a length that makes them as large
        alike = np.nan_to_num(of.poses / np.linalg.norm(of.poses, axis=2, keepdims=True))
    reach, moving = np.full((n, 2, 3), np.nan), np.flatnonzero(np.linalg.matrix_rank(alike, rtol=SINGULAR) == 3)
    carried = per_command(of, designs.frames, necks).reshape(3, n, 9, -1)
    rest = neck_forces(designs.frames, necks[..., 3:] @ drive.preload[:, None, None, :, None]).reshape(3, n, 9)
    for begin in range(0, len(moving), TOGETHER):
        here = moving[begin : begin + TOGETHER]
        Z, rows, ends = _along_axes(Driven(of.C[here], of.Y[here], of.T), drive.at(here))
        design = np.repeat(np.arange(len(here)), 6)  # of each program
        cut = _yield_of(designs.chosen(here), design, carried[:, here][:, design] @ Z, rest[:, here][:, design])
        at_rest, *_ = cut(np.arange(len(Z)), np.zeros_like(Z[:, 0]))
        far = np.where(at_rest, np.nan, farthest(rows, ends, cut)[:, 0])
        reach[here] = far.reshape(-1, 2, 3)
    return DriveRanges(reach, inverse(of.engaged))


def _along_axes(of: Driven, drive: StageDrive) -> tuple[Array, Array, Array]:
    """Six programs a design, forwards and backwards along x, y, theta: commands x = Z (t, y), (p, m, d), and the limits
    on these, rows (p, k, d) and ends (p, k).
    """
    scale = 1 / np.linalg.norm(of.poses, axis=2, keepdims=True)
    free = np.swapaxes(np.linalg.svd(of.poses * scale)[2][:, 3:], 1, 2)
    least = np.linalg.pinv(of.poses * scale) * np.swapaxes(scale, 1, 2)  # (n, m, 3): commands of unit poses
    n, m, d = len(least), least.shape[1], free.shape[2] + 1
    limits = limits_of(of, drive, np.zeros(3)).values()
    rows = np.concatenate([np.broadcast_to(each.rows, (n, *each.rows.shape[-2:])) for each in limits], axis=1)
    ends = np.concatenate([each.offsets + each.sizes for each in limits], axis=-1)
    Z = np.concatenate([np.moveaxis(least, 2, 1)[..., None], np.broadcast_to(free[:, None], (n, 3, m, d - 1))], axis=-1)
    Z = np.stack([Z, Z * np.append(-1.0, np.ones(d - 1))], axis=1).reshape(6 * n, m, d)
    return Z, np.repeat(rows, 6, axis=0) @ Z, np.repeat(ends, 6, axis=0)


# whether points (q, d) of some programs break further limits, and rows (q, d) and ends (q,) of those at the worst place
Cut: TypeAlias = Callable[[Index, Array], tuple[NDArray[np.bool_], Array, Array]]


def _yield_of(designs: Designs, design: Index, forces: Array, rest: Array) -> Cut:
    """Yield as a `Cut` of p programs, by their designs (p,), forces (3, p, 9, d) of the necks and at rest (3, p, 9)."""
    at = sections_of(designs).reshape(3, len(designs.thickness), 9, -1)
    lever, bending_most, tension_most = np.max(np.abs(at), axis=-1)  # of all places: an upper bound of the stress
    strength = designs.yield_strength * (1 - YIELD_MARGIN[designs.plane])  # the model's stress may be low

    def cut(which: Index, z: Array) -> tuple[NDArray[np.bool_], Array, Array]:
        own, allowed = design[which], strength[design[which]]
        broken, rows, ends = np.zeros(len(z), dtype=bool), np.zeros(z.shape), np.zeros(len(z))
        carried = np.einsum("ipkd,pd->ipk", forces[:, which], z) + rest[:, which]
        M, N, V = np.abs(carried)
        most = bending_most[own] * (M + lever[own] * V) + tension_most[own] * N
        near = np.flatnonzero(np.any(most > allowed[:, None], axis=1))
        if not len(near):
            return broken, rows, ends
        stress = stress_along(at[:, own[near]], carried[:, near])
        neck, place = np.divmod(np.argmax(stress.reshape(len(near), -1), axis=1), SECTIONS)
        broken[near] = stress[np.arange(len(near)), neck, place] > allowed[near] * (1 + YIELDING)
        x, bending, tension = at[:, own[near], neck, place]
        M, N, V = carried[:, near, neck]
        bent, pulled = np.sign(M + V * x) * bending, np.sign(N) * tension
        moment, normal, shear = forces[:, which[near], neck]
        rows[near] = (bent * (moment + shear * x[:, None]).T + pulled * normal.T).T
        M, N, V = rest[:, which[near], neck]
        ends[near] = allowed[near] - bent * (M + V * x) - pulled * N
        return broken, rows, ends

    return cut


def farthest(A: Array, b: Array, cut: Cut | None = None) -> Array:
    """Points (p, d) of the largest z_0 with A z <= b, A (p, k, d), b (p, k), bounded; nan where there is none.

    Notes
    -----
    The dual simplex method, a step of all programs at a time: from a far corner of a box, the limit that is broken most
    takes the place of one of the d that hold the point, which is solved for anew. For 256 programs in four unknowns
    HiGHS took 19 times as long with one block-diagonal program, and 88 times as long one by one.
    """
    p, _, d = A.shape
    unit = _scale(np.max(np.abs(A), axis=1))
    rows = A * unit[:, None, :]
    norm = _scale(np.linalg.norm(rows, axis=2))
    rows, ends = rows * norm[..., None], b * norm
    span = _scale(np.max(np.abs(ends), axis=1))
    ends = ends * span[:, None]
    holding, at, found = np.tile(np.eye(d), (p, 1, 1)), np.full((p, d), FAR), np.full((p, d), np.nan)
    todo = np.arange(p)
    for step in range(STEPS):
        held = np.linalg.inv(holding[todo])
        z = np.einsum("pij,pj->pi", held, at[todo])
        beyond = np.einsum("pkd,pd->pk", rows[todo], z) - ends[todo]
        broken = beyond > KEPT * (1 + np.max(np.abs(z), axis=1, keepdims=True))
        enters, on = np.argmax(beyond if step < PATIENCE else broken, axis=1), broken.any(axis=1)
        row, end = rows[todo, enters], ends[todo, enters]
        if cut is not None and not on.all():
            off = np.flatnonzero(~on)
            which = todo[off]
            on[off], further, size = cut(which, z[off] * unit[which] / span[which, None])
            own = _scale(np.linalg.norm(further * unit[which], axis=1))
            row[off], end[off] = further * unit[which] * own[:, None], size * span[which] * own
        done = ~on & np.all(at[todo] < FAR, axis=1)
        found[todo[done]] = z[done] * unit[todo[done]] / span[todo[done], None]
        share = np.einsum("pi,pij->pj", row, held)  # of the limits that hold the point in the new one
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(share > FLAT, np.maximum(held[:, 0], 0.0) / share, np.inf)
        least = np.min(ratio, axis=1)
        ties = ratio <= least[:, None] * (1 + FLAT)
        leaves = np.argmax(np.where(ties, share, -1.0) if step < PATIENCE else ties, axis=1)
        on &= np.isfinite(least)
        todo, row, end, leaves = todo[on], row[on], end[on], leaves[on]
        if not len(todo):
            break
        holding[todo, leaves], at[todo, leaves] = row, end
    return found


def _scale(size: Array) -> Array:
    return np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)
