"""Driven stages: what strokes do, which strokes a pose takes, and the limits; algebra on a compliance of either model.

With loads F on the platform and the forces f by which n stacks push their bodies apart, [U; d] = C [F; f]. A stack of
stiffness k with the free stroke s fills its opening: d = s - f / k. Then

    f = Y (s - C_dF F),   Y = (k^-1 + C_dd)^-1,   U = C_UF F + C_Ud f,   s = T x

for the commands x. Forces, openings and strokes are those beyond rest, where the preloads are balanced.

At every place x along a neck, from its centre, the stress is `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|`, h the
height of the notch there. M, N, V are linear in the commands, so that yield is four half-spaces for every place.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import Array, inverse
from flexfem.hinges.strength import stress_raised
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.designs import Designs, Frames
from flexfem.mechanism.drives import StageDrive
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
    """What commands and a load do.

    command : (m,), mm.   pose : (3,).   force : (n,), N, beyond rest.
    stage, stacks : strain energy, N mm, of the stage, and of stacks and contacts, beyond rest.
    """

    command: Array
    pose: Array
    force: Array
    stage: float
    stacks: float


class NeckForces(NamedTuple):
    """What the necks carry, (..., 3 chains, 3 hinges): moments about their centres, forces along and across, N mm, N.

    With one more axis at the end: per load, per command.
    """

    moment: Array
    normal: Array
    shear: Array


class NeckSections(NamedTuple):
    """Levers x (..., 3 chains, 3 hinges, s) of V at places along the necks, mm, and stress there: of M + V x, and of N.

    x : distance of the place from the centre, times K_s / K_b.   Stress is von Mises'.
    bending : MPa per N mm.   tension : MPa per N.
    """

    x: Array
    bending: Array
    tension: Array


def driven(C: Array, drive: StageDrive) -> Driven:
    """A driven stage from its compliance (..., 3 + n, 3 + n).

    Notes
    -----
    `Y = k^1/2 (1 + k^1/2 C_dd k^1/2)^-1 k^1/2`, which is zero for stacks of no stiffness.
    """
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
    return Motion(command, found[:3], force, float(both @ found / 2), float(np.sum(stacks) / 2))


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
    values = np.linalg.svd(G, compute_uv=False)
    if len(values) < 3 or not values[2] > SINGULAR * values[0]:
        raise ComputationFailed("the drive does not move the platform in three directions: no strokes for this pose")
    if criterion == "least energy":
        found = _least_energy(of, G, wanted, load)
    else:
        limits = limits_of(of, drive, load)
        found = _least_share(limits if criterion == "within limits" else {"stroke": limits["stroke"]}, G, wanted)
    return np.asarray(found + np.linalg.lstsq(G, wanted - G @ found, rcond=None)[0])  # what the programs rounded off


def _least_energy(of: Driven, G: Array, wanted: Array, load: Array) -> Array:
    """min f' C_dd f with f = Y (T x - C_dF F) and G x = wanted, in the null space of G.

    Notes
    -----
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
    from scipy.optimize import linprog

    rows, offsets, sizes = of
    unit = float(np.max(np.abs(np.linalg.lstsq(G, wanted, rcond=None)[0]))) or float(np.max(sizes)) or 1.0
    size = np.max(np.abs(G)) * unit
    norm = np.maximum(np.max(np.abs(rows), axis=1) * unit, np.finfo(float).tiny)
    found = linprog(
        np.append(np.zeros(G.shape[1]), 1.0),
        A_ub=np.column_stack([rows * unit, -sizes]) / norm[:, None],
        b_ub=offsets / norm,
        A_eq=np.column_stack([G * unit, np.zeros(3)]) / size,
        b_eq=wanted / size,
        bounds=[(None, None)] * G.shape[1] + [(0, None)],
        method="highs",
    )
    if found.status == 2:
        return None
    if found.status != 0:
        raise ComputationFailed(f"linear program for strokes: {found.message}")
    return np.asarray(found.x[:-1] * unit)


def limits_of(of: Driven, drive: StageDrive, load: Array) -> dict[Limit, DriveLimits]:
    """Every limit of a drive under a load (3,): of the commands (m,) the highest, then the lowest; of the forces (n,)
    that none is above the blocking force, and that no contact is lost.
    """
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

    inf where nothing is allowed: the contact of a stack without preload that would have to pull. What is used of
    nothing at all by round-off alone is nothing.
    """
    found, limits = dict[Limit, Array](), limits_of(of, drive, load)
    for name in LIMITS:
        rows, offsets, sizes = limits[name]
        used = rows @ command - offsets
        none = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found[name] = np.where(none, 0.0, used / sizes)
    return found


def neck_forces(frames: Frames, wrenches: Array) -> NeckForces:
    """What necks carry of wrenches (..., 3 chains, 3 hinges, 3, k) at the platform centre, each (..., 3, 3, k)."""
    F_x, F_y, M = np.moveaxis(wrenches, -2, 0)
    x, y = np.moveaxis(frames.centres, -1, 0)[..., None]
    c, s = np.cos(frames.axes)[..., None], np.sin(frames.axes)[..., None]
    return NeckForces(M + y * F_x - x * F_y, c * F_x + s * F_y, c * F_y - s * F_x)


def per_command(of: Driven, frames: Frames, necks: Array) -> NeckForces:
    """What necks carry (..., 3, 3, m) per command, by the wrenches `necks` of `DrivenModel`."""
    return neck_forces(frames, necks[..., 3:] @ (of.Y @ of.T)[..., None, None, :, :])


def sections_of(designs: Designs, count: int = SECTIONS) -> NeckSections:
    """The places of n designs, (n, 3, 3, s), an odd `count` of them: one is the centre alone."""
    radius, neck = designs.radius[..., None], designs.neck[..., None]
    x = radius * (np.linspace(-BESIDE, BESIDE, count) if count > 1 else np.zeros(1))
    high = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (part[..., None] for part in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * high
    return NeckSections(x * shear / bending, 6 * bending / area / high, tension / area)


def stress_along(at: NeckSections, carried: NeckForces) -> Array:
    """Stress (..., 3, 3, s), MPa, at every place, of forces (..., 3, 3)."""
    M, N, V = (each[..., None] for each in carried)
    return np.asarray(np.abs(at.bending * (M + V * at.x)) + np.abs(at.tension * N))


def limits_of_necks(at: NeckSections, carried: NeckForces, at_rest: NeckForces, strength: float) -> DriveLimits:
    """Every half-space that yield at `strength`, MPa, sets to the commands of one design: 36 s of them.

    Parameters
    ----------
    carried : NeckForces
        Per command, (3, 3, m).
    at_rest : NeckForces
        (3, 3), of a load without commands.
    """

    def signed(of: NeckForces) -> Array:
        """Stresses (3, 3, s, 4, k) with the `SIGNS` of bending and tension, of forces (3, 3, k)."""
        moment, normal, shear = (each[:, :, None] for each in of)
        bent, pulled = at.bending[..., None] * (moment + shear * at.x[..., None]), at.tension[..., None] * normal
        return np.asarray(SIGNS[:, :1] * bent[..., None, :] + SIGNS[:, 1:] * pulled[..., None, :])

    rows = signed(carried)
    offsets = -signed(NeckForces(*(each[..., None] for each in at_rest))).ravel()
    return DriveLimits(rows.reshape(-1, rows.shape[-1]), offsets, np.full(len(offsets), strength))
