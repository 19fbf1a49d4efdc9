"""Driven stages from a compliance of either model: motion by strokes, strokes for a pose, and
limits.

With loads F on the platform and forces f of n stacks that push their bodies apart, [U; d] = C [F;
f]. A stack of stiffness k and free stroke s fills its opening: d = s - f / k. With commands x, all
relative to rest:

    s = T x,   f = Y (s - C_dF F),   Y = (k^-1 + C_dd)^-1,   U = C_UF F + C_Ud f
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index, inverse
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.mechanism import Mechanism
from flexfem.paper.designs import Designs
from flexfem.paper.drives import ActuatorSet
from flexfem.paper.model import at_necks, stress_raised
from flexfem.questions.warnings import YIELD_MARGIN
from flexfem.refused import BadInput, ComputationFailed

Criterion: TypeAlias = Literal["least energy", "least stroke", "within limits"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)
ROUND_OFF = 1e-9  # of the largest stroke or force
Limit: TypeAlias = Literal["stroke", "contact", "blocking force"]
LIMITS: tuple[Limit, ...] = get_args(Limit)
NOTHING_ALLOWED: dict[
    Limit, str
] = {  # reasons why a limit of zero size in one direction excludes all strokes
    "stroke": "some single stacks would need strokes below their minimum of 0 um",
    "contact": "some stacks without preload would have to pull",
    "blocking force": "some stacks preloaded to their blocking force would have to push harder",
}
SINGULAR = 1e-9  # of the largest singular value: in such a direction no command moves the platform
HALF_LENGTH = 0.7
SECTIONS = 141  # of the checked part of a neck, per notch radius, and number of sections
ENDLESS = np.full(1, np.inf)  # MPa, strength of necks that do not yield
YIELDING = 1e-11  # of the yield strength: round-off
BATCH = 256  # designs at a time, so that their programs stay in the processor cache
# larger than every solution of a bounded program with rows of unit norm and bounds of at most one
FAR = 1e7
FLAT = 1e-11
TOLERANCE = 1e-12  # of such programs: pivots that are round-off; violation relative to the point
STEPS = 300
PATIENCE = (
    100  # simplex steps; after PATIENCE of them the first violated limit enters, against cycling
)
MULTIPLIER = 1e-6  # of the largest: a limit with a smaller multiplier is not binding


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


class Motion(NamedTuple):
    """Pose (3,), forces (n,), N, relative to rest, and strain energy, N mm, of the stage and of
    stacks and contacts.
    """

    pose: Array
    force: Array
    stage: float
    stacks: float


class Driven(NamedTuple):
    """A driven stage by one model; leading axes are designs.

    C : (..., 3 + n, 3 + n), mm, rad per N, N mm.   Y : (..., n, n), N/mm, stack forces per stroke.
    """

    C: Array
    Y: Array
    drive: ActuatorSet

    @classmethod
    def of(cls, C: Array, drive: ActuatorSet) -> Driven:
        """Return a driven stage of compliance C; Y = k^1/2 (1 + k^1/2 C_dd k^1/2)^-1 k^1/2 also
        holds for k = 0.

        Stacks of infinite stiffness hold their openings.
        """
        if np.all(np.isinf(drive.stiffness)):
            return cls(C, inverse(C[..., 3:, 3:]), drive)
        root = np.sqrt(drive.stiffness)
        inner = inverse(
            np.eye(root.shape[-1]) + root[..., :, None] * C[..., 3:, 3:] * root[..., None, :]
        )
        return cls(C, root[..., :, None] * inner * root[..., None, :], drive)

    def at(self, which: Index | None) -> Driven:
        """Select designs (k,); None adds a leading axis of length one."""
        return Driven(self.C[which], self.Y[which], self.drive.at(which))

    @classmethod
    def of_mechanism(cls, mechanism: Mechanism, C: Array) -> Driven:
        """Return the output of a mechanism with all its actuators, for a compliance (k, k) of its
        ports.
        """
        layout = mechanism.layout
        if not layout.actuators:
            raise BadInput(f"{mechanism.origin}: no actuator, expected at least one [[actuator]]")
        ports = [0, 1, 2, *layout.drive_ports]
        return cls.of(C[np.ix_(ports, ports)], layout.drive)

    @property
    def per_command(self) -> Array:
        """Stack forces (..., n, m) per command, N/mm."""
        return np.asarray(self.Y @ self.drive.differential)

    @property
    def poses(self) -> Array:
        """Pose (..., 3, m) per command, mm and rad per mm."""
        return np.asarray(self.C[..., :3, 3:] @ self.per_command)

    @property
    def engaged(self) -> Array:
        """Compliance (..., 3, 3) of the platform with the stacks holding their strokes."""
        return np.asarray(self.C[..., :3, :3] - self.C[..., :3, 3:] @ self.Y @ self.C[..., 3:, :3])

    @property
    def stiffness(self) -> Array:
        """Stiffness (3,) of the platform with engaged stacks, each direction with the others held."""
        return np.asarray(np.diag(np.linalg.inv(self.engaged)))

    def moved(self, command: Array, load: Array) -> Motion:
        """Return the motion of one stage by commands (m,), mm, and a load (3,), N, N, N mm."""
        force = self.per_command @ command - self.Y @ self.C[3:, :3] @ load
        loads = np.concatenate([load, force])
        displacement = self.C @ loads
        with np.errstate(divide="ignore", invalid="ignore"):
            stacks = np.where(force == 0, 0.0, force**2 / self.drive.stiffness)
        return Motion(
            displacement[:3], force, float(loads @ displacement / 2), float(np.sum(stacks) / 2)
        )

    def limits(self, load: Array) -> dict[Limit, DriveLimits]:
        """Return the limits under a load (3,): highest then lowest commands, and stack forces both
        ways.
        """
        drive = self.drive
        at_rest = self.Y @ self.C[..., 3:, :3] @ load
        unit = np.eye(drive.lowest.shape[-1])
        sizes = np.abs(np.concatenate([drive.highest, drive.lowest], axis=-1))
        reserve = drive.blocking_force - drive.preload
        reserve[np.abs(reserve) <= BLOCKING_ROUND_OFF * drive.blocking_force] = 0.0
        return {
            "stroke": DriveLimits(np.concatenate([unit, -unit]), np.zeros_like(sizes), sizes),
            "contact": DriveLimits(-self.per_command, -at_rest, drive.preload),
            "blocking force": DriveLimits(self.per_command, at_rest, reserve),
        }

    def shares(self, command: Array, load: Array) -> dict[Limit, Array]:
        """Return the share of each limit that commands use, above one if exceeded: of strokes
        (2m,), of forces (n,).

        It is inf for a limit of zero, as at the contact of a stack without preload that would have
        to pull."""
        found = dict[Limit, Array]()
        for name, (rows, offsets, sizes) in self.limits(load).items():
            used = rows @ command - offsets
            unused = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                found[name] = np.where(unused, 0.0, used / sizes)
        return found

    def commands(self, pose: Array, load: Array, lever: float, criterion: Criterion) -> Array:
        """Return the commands (m,), mm, for a pose (3,) under a load (3,); lever, mm, scales
        rotations to lengths.

        Raises ComputationFailed if no commands of any size reach the pose.

        Notes
        -----
        least energy : of the stage, (29). Under a load the work on the platform depends on the pose
        alone, so the
            energy of the forces is minimised: min f' C_dd f.
        least stroke : minimise the largest command relative to its own limit, a linear program.
        within limits : minimise the largest share of any limit: strokes, preloads of contacts that
        must stay closed,
            and blocking forces less the preloads.
        """
        scale = np.array([1.0, 1.0, lever])
        G = scale[:, None] * self.poses
        target = scale * (pose - self.engaged @ load)
        if np.linalg.matrix_rank(G, rtol=SINGULAR) < 3:
            raise ComputationFailed(
                "the drive does not move the platform in three directions: no strokes for this pose"
            )
        if criterion == "least energy":
            commands = _least_energy(self, G, target, load)
        else:
            limits = self.limits(load)
            commands = _least_share(
                limits if criterion == "within limits" else {"stroke": limits["stroke"]}, G, target
            )
        return np.asarray(
            commands + np.linalg.lstsq(G, target - G @ commands, rcond=None)[0]
        )  # remove round-off

    def unit_commands(self, lever: float) -> Array:
        """Return the commands of least energy (m, 3) per mm in x and y and per rad, without load."""
        scale = np.array([1.0, 1.0, lever])
        commands = [
            self.commands(pose, np.zeros(3), lever, "least energy") for pose in np.diag(1 / scale)
        ]
        return np.asarray(np.transpose(commands) * scale)


def _least_energy(system: Driven, G: Array, target: Array, load: Array) -> Array:
    """Minimise f' C_dd f with f = Y (T x - C_dF F) and G x = target, in the null space of G.

    Combinations of commands without energy in a rigid model, as with six pairs on mobility three,
    keep the smallest strokes, because their energy is round-off."""
    particular = np.linalg.lstsq(G, target, rcond=None)[0]
    free = np.linalg.svd(G)[2][3:].T
    C_dd = system.C[3:, 3:]
    per_command = system.per_command
    force = per_command @ particular - system.Y @ system.C[3:, :3] @ load
    F = per_command @ free
    energy, vectors = np.linalg.eigh(F.T @ C_dd @ F)
    kept = energy > SINGULAR * np.linalg.norm(per_command.T @ C_dd @ per_command, 2)
    F = F @ vectors[:, kept]
    free = free @ vectors[:, kept]
    return np.asarray(particular - free @ (F.T @ C_dd @ force / energy[kept]))


def _least_share(limits: Mapping[Limit, DriveLimits], G: Array, target: Array) -> Array:
    """Minimise t with rows x <= offsets + t sizes, for all limits together, and G x = target.

    Raises Unreachable with the reason if no x exists; then limits of zero size exclude every t.
    """
    base = np.linalg.lstsq(G, target, rcond=None)[0]
    free = np.linalg.svd(G)[2][3:].T

    def smallest(chosen: Iterable[DriveLimits]) -> Array:
        """Return the commands, nan if there are none; the unknowns of the program are -t and x in
        the null space.
        """
        rows, offsets, sizes = map(np.concatenate, zip(*chosen, strict=True))
        positive = np.eye(1, 1 + free.shape[1])
        A = np.vstack([np.column_stack([sizes, rows @ free]), positive])
        b = np.append(offsets - rows @ base, 0.0)
        share, *at = farthest(A[None], b[None]).points[0]
        return np.full_like(base, np.nan) if np.isnan(share) else base + free @ np.array(at)

    commands = smallest(limits.values())
    if np.isnan(commands).any():
        zero = {
            name: DriveLimits(*(part[limit.sizes == 0] for part in limit))
            for name, limit in limits.items()
        }
        binding = {name: NOTHING_ALLOWED[name] for name, limit in zero.items() if len(limit.rows)}
        alone = [text for name, text in binding.items() if np.isnan(smallest([zero[name]])).any()]
        raise Unreachable(", and ".join(alone or binding.values()))
    return commands


def sections_of(designs: Designs) -> Array:
    """Return sections along the necks of n designs, (3, n, 3, 3, SECTIONS), the middle one at the
    centre.

    They are the lever of a shear force, mm, the von Mises stress of the moment, MPa per N mm, and
    that of an axial force, MPa per N: `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|` at x from
    the centre, with the height h(x)."""
    radius = designs.radius[..., None]
    neck = designs.neck[..., None]
    x = radius * np.linspace(-HALF_LENGTH, HALF_LENGTH, SECTIONS)
    height = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (factor[..., None] for factor in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * height
    return np.stack([x * shear / bending, 6 * bending / area / height, tension / area])


def stress_along(sections: Array, forces: Array) -> Array:
    """Return the stress (..., 3, 3, s), MPa, at sections (3, ..., 3, 3, s) of `sections_of`; forces
    (3, ..., 3, 3).
    """
    x, bending, tension = sections
    M, N, V = forces[..., None]
    return np.asarray(np.abs(bending * (M + V * x)) + np.abs(tension * N))


class DriveRanges(NamedTuple):
    """Reach of the drives of n designs each way (n, 2, 3), mm and rad, and stiffness (n, 3, 3) with
    the stacks engaged.

    The reach is nan if a drive does not move its design in three directions, or if preloads alone
    make a neck yield."""

    reach: Array
    engaged: Array

    @property
    def range(self) -> Array:
        """Smaller reach (n, 3) of both ways."""
        return np.asarray(np.min(self.reach, axis=1))


class CommandLimits(NamedTuple):
    """All limits of the commands (m,) of n designs, numbered: k with rows @ x <= bounds, then the
    yield of nine necks.

    rows : (n, k, m), bounds : (n, k), in the order of `LIMITS`.   sections : (3, n, 9, SECTIONS) of
    `sections_of`.
    forces : (3, n, 9, m), moment, axial and shear force of necks per command; at_rest : (3, n, 9),
    without commands.
    strength : (n,), MPa, less a margin because the model may underestimate the stress.
    """

    rows: Array
    bounds: Array
    sections: Array
    forces: Array
    at_rest: Array
    strength: Array

    def farthest(self, design: Index, Z: Array, base: Array) -> Farthest:
        """Solve p programs of designs (p,) for the largest z_0 of commands base (p, m) + Z (p, m,
        d) z.
        """
        rows = self.rows[design]
        forces = self.forces[:, design]
        at_base = self.at_rest[:, design] + np.einsum("ipkm,pm->ipk", forces, base)
        bounds = self.bounds[design] - np.einsum("pkm,pm->pk", rows, base)
        yields = partial(self.yields, design, forces @ Z, at_base) if self.sections.size else None
        return farthest(rows @ Z, bounds, yields)

    def yields(
        self, design: Index, forces: Array, at_base: Array, which: Index, z: Array
    ) -> Violation:
        """Return yield at the worst section as a `Cut`; forces (3, p, 9, d) per unknown and at_base
        (3, p, 9).
        """
        k = design[which]
        loaded = np.einsum("ipkd,pd->ipk", forces[:, which], z) + at_base[:, which]
        stress = stress_along(self.sections[:, k], loaded).reshape(len(z), -1)
        neck, section = np.divmod(np.argmax(stress, axis=1), SECTIONS)
        x, bending, tension = self.sections[:, k, neck, section]
        M, N, V = loaded[:, np.arange(len(z)), neck]
        bending = np.sign(M + V * x) * bending
        factors = np.array([bending, np.sign(N) * tension, bending * x])
        rows = np.einsum("ip,ipd->pd", factors, forces[:, which, neck])
        bounds = self.strength[k] - np.sum(factors * at_base[:, which, neck], axis=0)
        return Violation(
            np.max(stress, axis=1) > self.strength[k] * (1 + YIELDING), rows, bounds, neck
        )


def stroke_limits(system: Driven) -> CommandLimits:
    """Return the limits of one mechanism by strokes alone: its actuators also pull, and its hinges
    do not yield.
    """
    rows, _, sizes = system.limits(np.zeros(3))["stroke"]
    none = np.zeros((3, 1, 0))
    forces = np.zeros((*none.shape, rows.shape[1]))
    return CommandLimits(rows[None], sizes[None], none[..., None], forces, none, ENDLESS)


def command_limits(designs: Designs, system: Driven, necks: Array, load: Array) -> CommandLimits:
    """Return all limits of n driven designs under a load (3,); necks (n, 3 chains, 3 hinges, 3, 3 +
    stacks).

    The preloads of a pair balance each other; that of a single stack stresses the necks.
    """
    n = len(designs.thickness)
    limits = system.limits(load).values()
    force = system.drive.preload - system.Y @ system.C[..., 3:, :3] @ load
    loads = np.concatenate([np.broadcast_to(load, (n, 3)), force], axis=-1)[:, None, None, :, None]
    by_command = necks[..., 3:] @ system.per_command[:, None, None]
    return CommandLimits(
        np.concatenate(
            [np.broadcast_to(limit.rows, (n, *limit.rows.shape[-2:])) for limit in limits], axis=1
        ),
        np.concatenate([limit.offsets + limit.sizes for limit in limits], axis=-1),
        sections_of(designs).reshape(3, n, 9, -1),
        np.reshape(at_necks(designs.frames, by_command), (3, n, 9, -1)),
        np.reshape(at_necks(designs.frames, necks @ loads), (3, n, 9)),
        designs.yield_strength * (1 - YIELD_MARGIN[designs.plane]),
    )


def drive_ranges(designs: Designs, system: Driven, necks: Array) -> DriveRanges:
    """Return the ranges of the drives of n designs; necks (n, 3 chains, 3 hinges, 3, 3 + stacks) as
    of `DrivenModel`.

    Notes
    -----
    The commands for the pose t along an axis, other directions zero, are x = t u + N y, with u of
    least norm and the columns of N in the null space: the largest t is the solution of a linear
    program in t and y, limited by strokes, contacts and blocking forces. Of yield, only half-spaces
    that a solution violates are added, at the worst section."""
    n = len(designs.thickness)
    scale = np.linalg.norm(system.poses, axis=2, keepdims=True)
    with np.errstate(
        divide="ignore", invalid="ignore"
    ):  # normalised so that rotations compare with translations
        normalised = np.nan_to_num(system.poses / scale)
    reach = np.full((n, 2, 3), np.nan)
    moving = np.flatnonzero(np.linalg.matrix_rank(normalised, rtol=SINGULAR) == 3)
    for begin in range(0, len(moving), BATCH):
        batch = moving[begin : begin + BATCH]
        limits = command_limits(designs.chosen(batch), system.at(batch), necks[batch], np.zeros(3))
        least = (
            np.swapaxes(np.linalg.pinv(normalised[batch]), 1, 2) / scale[batch]
        )  # (n, 3, m): for unit poses
        free = np.swapaxes(np.linalg.svd(normalised[batch])[2][:, 3:], 1, 2)
        both = np.stack([least, -least], axis=1)[..., None]
        Z = np.concatenate(
            [both, np.broadcast_to(free[:, None, None], (*both.shape[:-1], free.shape[-1]))],
            axis=-1,
        )
        Z = Z.reshape(-1, *Z.shape[-2:])
        each = np.arange(len(batch))
        farthest = limits.farthest(np.repeat(each, 6), Z, np.zeros(Z.shape[:2])).points[:, 0]
        at_rest = limits.yields(
            each, limits.forces, limits.at_rest, each, np.zeros(limits.rows.shape[::2])
        )
        reach[batch] = np.where(at_rest.where[:, None, None], np.nan, farthest.reshape(-1, 2, 3))
    return DriveRanges(reach, inverse(system.engaged))


class Violation(NamedTuple):
    """Of q points (q, d): whether they violate a limit, and rows, bounds and number of the worst
    limit of each.
    """

    where: NDArray[np.bool_]
    rows: Array
    bounds: Array
    place: Index


Cut: TypeAlias = Callable[
    [Index, Array], Violation
]  # limits of chosen programs (q,) at points (q, d)


class Farthest(NamedTuple):
    """Points (p, d) of largest z_0, nan if infeasible, and numbers (p, d) of binding limits, -1 for
    none.

    Numbers of a `Cut` follow those of the rows.
    """

    points: Array
    binding: Index


def farthest(A: Array, b: Array, cut: Cut | None = None) -> Farthest:
    """Return the points (p, d) of largest z_0 with A z <= b, A (p, k, d), b (p, k), where z_0 is
    bounded.

    Notes
    -----
    The dual simplex method takes a step of all programs at a time: from a far corner of a box, the
    most violated limit replaces one of the d active limits, and the vertex is solved for again. For
    256 programs in four unknowns HiGHS took 19 times as long with one block-diagonal program, and
    88 times as long one by one."""
    p, count, d = A.shape
    unit = _inverse_scale(np.max(np.abs(A), axis=1))
    rows = A * unit[:, None, :]
    norm = _inverse_scale(np.linalg.norm(rows, axis=2))
    rows = rows * norm[..., None]
    bounds = b * norm
    span = _inverse_scale(np.max(np.abs(bounds), axis=1))
    bounds = bounds * span[:, None]
    active = np.tile(np.eye(d), (p, 1, 1))
    active_bounds = np.full((p, d), FAR)
    number = np.full((p, d), -1)
    found = Farthest(np.full((p, d), np.nan), np.full((p, d), -1))
    todo = np.arange(p)
    for step in range(STEPS):
        inverses = np.linalg.inv(active[todo])
        z = np.einsum("pij,pj->pi", inverses, active_bounds[todo])
        excess = np.einsum("pkd,pd->pk", rows[todo], z) - bounds[todo]
        violated = excess > TOLERANCE * (1 + np.max(np.abs(z), axis=1, keepdims=True))
        enters = np.argmax(excess if step < PATIENCE else violated, axis=1)
        unsolved = violated.any(axis=1)
        row = rows[todo, enters]
        bound = bounds[todo, enters]
        if cut is not None and not unsolved.all():
            within = np.flatnonzero(~unsolved)
            which = todo[within]
            worst = cut(which, z[within] * unit[which] / span[which, None])
            cut_norm = _inverse_scale(np.linalg.norm(worst.rows * unit[which], axis=1))
            unsolved[within] = worst.where
            enters[within] = count + worst.place
            row[within] = worst.rows * unit[which] * cut_norm[:, None]
            bound[within] = worst.bounds * span[which] * cut_norm
        multipliers = inverses[:, 0]
        done = ~unsolved & np.all((active_bounds[todo] < FAR) | (multipliers < FLAT), axis=1)
        if done.any():
            which = todo[done]
            positive = multipliers[done]
            found.points[which] = z[done] * unit[which] / span[which, None]
            binds = positive > MULTIPLIER * np.max(positive, axis=1, keepdims=True)
            found.binding[which] = np.where(binds, number[which], -1)
        pivots = np.einsum(
            "pi,pij->pj", row, inverses
        )  # the entering row in terms of the active ones
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(pivots > FLAT, np.maximum(multipliers, 0.0) / pivots, np.inf)
        least = np.min(ratio, axis=1)
        ties = ratio <= least[:, None] * (1 + FLAT)
        leaves = np.argmax(np.where(ties, pivots, -1.0) if step < PATIENCE else ties, axis=1)
        unsolved &= np.isfinite(least)
        todo, row, bound, leaves, enters = (
            part[unsolved] for part in (todo, row, bound, leaves, enters)
        )
        if not len(todo):
            break
        active[todo, leaves] = row
        active_bounds[todo, leaves] = bound
        number[todo, leaves] = enters
    return found


def _inverse_scale(size: Array) -> Array:
    """Return 1 / size, and one for a size of zero."""
    return np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)
