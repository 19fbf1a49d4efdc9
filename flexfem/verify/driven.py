"""What strokes do, and which strokes a pose takes: dense algebra on the compliance of a driven stage, whoever made it.

With loads F on the platform and the forces f by which n stacks push their bodies apart, [U; d] = C [F; f]. A stack of
stiffness k with the free stroke s fills its opening: d = s - f / k. Then

    f = Y (s - C_dF F),   Y = (k^-1 + C_dd)^-1,   U = C_UF F + C_Ud f,   s = T x

for the commands x. Forces, openings and strokes are those beyond rest, where the preloads are balanced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import Array, inverse
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.drives import StageDrive
from flexfem.refused import ComputationFailed

Criterion: TypeAlias = Literal["least energy", "least stroke", "within limits"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)
ROUND_OFF = 1e-9  # of the largest stroke or force
Limit: TypeAlias = Literal["stroke", "contact", "blocking"]
NOTHING_ALLOWED: dict[Limit, str] = {  # of limits that allow nothing at all in one direction, why no strokes do
    "stroke": "some single stacks would need strokes below 0 um, their least",
    "contact": "some stacks without preload would have to pull",
    "blocking": "some stacks preloaded to their blocking force would have to push harder",
}
SINGULAR = 1e-9  # of the largest: a direction in which no command moves the platform


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
    metal, stacks : strain energy, N mm, of the stage, and of stacks and contacts, beyond rest.
    """

    command: Array
    pose: Array
    force: Array
    metal: float
    stacks: float


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
    stroke = of.T @ command
    force = of.Y @ (stroke - of.C[3:, :3] @ load)
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
    least energy : of the metal, (29). Under a load the energy of the platform's work is that of the pose, whatever the
        commands, so that the forces alone are to be least: min f' C_dd f.
    least stroke : the largest of the commands, each as a share of its own limit, is least: a linear program.
    within limits : the largest share of any limit is least: of the strokes, of preloads that contacts may not lose,
        and of what blocking forces leave.
    """
    scale = np.array([1.0, 1.0, lever])
    G, wanted = scale[:, None] * of.poses, scale * (pose - of.engaged @ load)
    check_reach(G)
    solve: dict[Criterion, Callable[[], Array]] = {
        "least energy": lambda: _least_energy(of, G, wanted, load),
        "least stroke": lambda: _least_share({"stroke": limits_of_strokes(drive)}, G, wanted),
        "within limits": lambda: _least_share(limits_of(of, drive, load), G, wanted),
    }
    found = solve[criterion]()
    return np.asarray(found + np.linalg.lstsq(G, wanted - G @ found, rcond=None)[0])  # what the programs rounded off


def check_reach(G: Array) -> None:
    """Refuse a drive whose commands do not move the platform in three directions: G (3, m), comparable units."""
    values = np.linalg.svd(G, compute_uv=False)
    if len(values) < 3 or not values[2] > SINGULAR * values[0]:
        raise ComputationFailed("the drive does not move the platform in three directions: no strokes for this pose")


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


def limits_of_strokes(drive: StageDrive) -> DriveLimits:
    """Of the commands (m,), the highest, then the lowest."""
    one, sizes = np.eye(drive.lowest.shape[-1]), np.abs(np.concatenate([drive.highest, drive.lowest], axis=-1))
    return DriveLimits(np.concatenate([one, -one]), np.zeros_like(sizes), sizes)


def limits_of_forces(of: Driven, drive: StageDrive, load: Array) -> tuple[DriveLimits, DriveLimits]:
    """Of the forces (n,): no contact is lost, and none is above the blocking force."""
    per_command, at_rest = of.Y @ of.T, of.Y @ of.C[..., 3:, :3] @ load
    left = drive.blocking_force - drive.preload
    left[np.abs(left) <= BLOCKING_ROUND_OFF * drive.blocking_force] = 0.0
    return DriveLimits(-per_command, -at_rest, drive.preload), DriveLimits(per_command, at_rest, left)


def limits_of(of: Driven, drive: StageDrive, load: Array) -> dict[Limit, DriveLimits]:
    """Every limit of a drive under a load (3,), in the order in which programs have them."""
    contact, blocking = limits_of_forces(of, drive, load)
    return {"stroke": limits_of_strokes(drive), "blocking": blocking, "contact": contact}


def _least_share(limits: Mapping[Limit, DriveLimits], G: Array, wanted: Array) -> Array:
    """min t with rows x <= offsets + t sizes, of all limits together, and G x = wanted.

    Raises Unreachable, which says why, when no x does: then some of the limits allow nothing at all, whatever t.
    """
    rows, offsets, sizes = (np.concatenate(parts) for parts in zip(*limits.values(), strict=True))
    found = _program(rows, offsets, sizes, G, wanted)
    if found is not None:
        return found
    none = {name: DriveLimits(*(part[each.sizes == 0] for part in each)) for name, each in limits.items()}
    binding = {name: each for name, each in none.items() if len(each.rows)}
    alone = [name for name, each in binding.items() if _program(*each, G, wanted) is None]
    raise Unreachable(", and ".join(NOTHING_ALLOWED[name] for name in alone or binding))


def _program(rows: Array, offsets: Array, sizes: Array, G: Array, wanted: Array) -> Array | None:
    """min t with rows x <= offsets + t sizes and G x = wanted; None where there is no such x."""
    from scipy.optimize import linprog

    unit = float(np.max(np.abs(np.linalg.lstsq(G, wanted, rcond=None)[0])))
    if unit == 0:
        unit = float(np.max(sizes)) or 1.0
    reach = np.max(np.abs(G)) * unit
    norm = np.maximum(np.max(np.abs(rows), axis=1) * unit, np.finfo(float).tiny)
    found = linprog(
        np.append(np.zeros(G.shape[1]), 1.0),
        A_ub=np.column_stack([rows * unit, -sizes]) / norm[:, None],
        b_ub=offsets / norm,
        A_eq=np.column_stack([G * unit, np.zeros(3)]) / reach,
        b_eq=wanted / reach,
        bounds=[(None, None)] * G.shape[1] + [(0, None)],
        method="highs",
    )
    if found.status == 2:
        return None
    if found.status != 0:
        raise ComputationFailed(f"linear program for strokes: {found.message}")
    return np.asarray(found.x[:-1] * unit)


def shares(of: Driven, drive: StageDrive, command: Array, load: Array) -> dict[Limit, float]:
    """Largest shares of the limits that a command takes, above one when it breaks them.

    inf where nothing is allowed: the contact of a stack without preload that would have to pull.
    """
    return {name: float(np.max(each)) for name, each in shares_of_each(of, drive, command, load).items()}


def shares_of_each(of: Driven, drive: StageDrive, command: Array, load: Array) -> dict[Limit, Array]:
    """Shares that a command takes of each limit in `limits_of`: stroke (2m,), contact and blocking (n,)."""
    limits = limits_of(of, drive, load)
    return {
        name: _shares(limits[name].rows @ command - limits[name].offsets, limits[name].sizes)
        for name in get_args(Limit)
    }


def _shares(used: Array, sizes: Array) -> Array:
    """Used over sizes, where what is used beyond nothing at all by round-off alone is nothing."""
    none = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(none, 0.0, used / sizes)
