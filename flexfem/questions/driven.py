"""A driven mechanism from a compliance of either model: motion by strokes, strokes for a pose, and
limits.

With loads F on the output and forces f of n stacks that push their bodies apart, [U; d] = C [F; f].
A stack of stiffness k and free stroke s fills its opening: d = s - f / k. With commands x, all
relative to rest:

    s = T x,   f = Y (s - C_dF F),   Y = (k^-1 + C_dd)^-1,   U = C_UF F + C_Ud f
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import Array, Index, inverse
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.layout import ActuatorSet
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.simplex import Maximum, WorstLimit, maximised
from flexfem.refused import BadInput, ComputationFailed

Criterion: TypeAlias = Literal["least energy", "least stroke", "within limits"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)
ROUND_OFF = 1e-9  # of the largest stroke or force
Limit: TypeAlias = Literal["stroke", "contact", "blocking force"]
LIMITS: tuple[Limit, ...] = get_args(Limit)
# reasons why a limit of zero size in one direction excludes all strokes
NOTHING_ALLOWED: dict[Limit, str] = {
    "stroke": "some single stacks would need strokes below their minimum of 0 um",
    "contact": "some stacks without preload would have to pull",
    "blocking force": "some stacks preloaded to their blocking force would have to push harder",
}
SINGULAR = 1e-9  # of the largest singular value: in such a direction no command moves the output


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
    """Motion by commands, relative to rest.

    pose : (3,), mm and rad.   force : (n,), N.
    stage, stacks : strain energy, N mm, of the plate, and of stacks and contacts.
    """

    pose: Array
    force: Array
    stage: float
    stacks: float


class DriveSystem(NamedTuple):
    """A driven mechanism by one model; leading axes are designs.

    C : (..., 3 + n, 3 + n), mm, rad per N, N mm.   Y : (..., n, n), N/mm, stack forces per stroke.
    """

    C: Array
    Y: Array
    drive: ActuatorSet

    @classmethod
    def of(
        cls,
        C: Array,
        drive: ActuatorSet,
    ) -> DriveSystem:
        """Return a driven mechanism of compliance C.

        Y = k^1/2 (1 + k^1/2 C_dd k^1/2)^-1 k^1/2 also holds for k = 0. Stacks of infinite stiffness
        hold their openings.
        """
        C_dd = C[..., 3:, 3:]
        if np.all(np.isinf(drive.stiffness)):
            return cls(C, inverse(C_dd), drive)
        root = np.sqrt(drive.stiffness)
        column = root[..., :, None]
        row = root[..., None, :]
        inner = inverse(np.eye(root.shape[-1]) + column * C_dd * row)
        return cls(C, column * inner * row, drive)

    def at(self, which: Index | None) -> DriveSystem:
        """Select designs (k,); None adds a leading axis of length one."""
        return DriveSystem(self.C[which], self.Y[which], self.drive.at(which))

    @classmethod
    def of_mechanism(
        cls,
        mechanism: Mechanism,
        C: Array,
    ) -> DriveSystem:
        """Return the output of a mechanism with all its actuators, for a compliance (k, k) of its
        ports.

        Raises BadInput for a mechanism without actuators.
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
        """Compliance (..., 3, 3) of the output with the stacks holding their strokes."""
        return np.asarray(self.C[..., :3, :3] - self.C[..., :3, 3:] @ self.Y @ self.C[..., 3:, :3])

    @property
    def stiffness(self) -> Array:
        """Stiffness (3,) of the output with engaged stacks, each direction with the others held."""
        return np.asarray(np.diag(np.linalg.inv(self.engaged)))

    def moved(
        self,
        command: Array,
        load: Array,
    ) -> Motion:
        """Return the motion of one mechanism by commands (m,), mm, and a load (3,), N, N, N mm."""
        force = self.per_command @ command - self.Y @ self.C[3:, :3] @ load
        loads = np.concatenate([load, force])
        displacement = self.C @ loads
        with np.errstate(divide="ignore", invalid="ignore"):
            stacks = np.where(force == 0, 0.0, force**2 / self.drive.stiffness)
        energy = float(loads @ displacement / 2)
        return Motion(displacement[:3], force, energy, float(np.sum(stacks) / 2))

    def limits(self, load: Array) -> dict[Limit, DriveLimits]:
        """Return the limits under a load (3,): highest and lowest commands, least and largest
        forces.
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

    def shares(
        self,
        command: Array,
        load: Array,
    ) -> dict[Limit, Array]:
        """Return the share of each limit that commands use, above one if exceeded.

        That of strokes has shape (2m,), those of forces (n,). It is inf for a limit of zero, as at
        the contact of a stack without preload that would have to pull.
        """
        found = dict[Limit, Array]()
        for name, (rows, offsets, sizes) in self.limits(load).items():
            used = rows @ command - offsets
            unused = used <= ROUND_OFF * np.max(np.abs(used), initial=0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                found[name] = np.where(unused, 0.0, used / sizes)
        return found

    def commands(
        self,
        pose: Array,
        load: Array,
        lever: float,
        criterion: Criterion,
    ) -> Array:
        """Return the commands (m,), mm, for a pose (3,) under a load (3,).

        lever : mm, scales rotations to lengths.

        Raises ComputationFailed if no commands of any size reach the pose.

        Notes
        -----
        least energy : of the mechanism, (29). Under a load the work on the output depends on the
            pose alone, so the energy of the forces is minimised: min f' C_dd f.
        least stroke : minimise the largest command relative to its own limit, a linear program.
        within limits : minimise the largest share of any limit: strokes, preloads of contacts that
            must stay closed, and blocking forces less the preloads.
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
            if criterion == "least stroke":
                limits = {"stroke": limits["stroke"]}
            commands = _least_share(limits, G, target)
        round_off = np.linalg.lstsq(G, target - G @ commands, rcond=None)[0]
        return np.asarray(commands + round_off)

    def unit_commands(self, lever: float) -> Array:
        """Return the commands of least energy (m, 3) per mm in x and y and per rad, without load."""
        scale = np.array([1.0, 1.0, lever])
        no_load = np.zeros(3)
        commands = [
            self.commands(pose, no_load, lever, "least energy") for pose in np.diag(1 / scale)
        ]
        return np.asarray(np.transpose(commands) * scale)


def _least_energy(
    system: DriveSystem,
    G: Array,
    target: Array,
    load: Array,
) -> Array:
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


def _least_share(
    limits: Mapping[Limit, DriveLimits],
    G: Array,
    target: Array,
) -> Array:
    """Minimise t with rows x <= offsets + t sizes, for all limits together, and G x = target.

    Raises Unreachable with the reason if no x exists; then limits of zero size exclude every t.
    """
    particular: Array = np.asarray(np.linalg.lstsq(G, target, rcond=None)[0], dtype=float)
    free = np.linalg.svd(G)[2][3:].T
    commands = _smallest_share(limits.values(), particular, free)
    if commands is not None:
        return commands
    binding = list[str]()
    alone = list[str]()
    for name, limit in limits.items():
        of_no_size = DriveLimits(*(part[limit.sizes == 0] for part in limit))
        if len(of_no_size.rows):
            binding.append(NOTHING_ALLOWED[name])
            if _smallest_share([of_no_size], particular, free) is None:
                alone.append(NOTHING_ALLOWED[name])
    raise Unreachable(", and ".join(alone or binding))


def _smallest_share(
    limits: Iterable[DriveLimits],
    particular: Array,
    free: Array,
) -> Array | None:
    """Return the commands particular + free @ y of the smallest share of limits; None if there are
    none.

    The unknowns of the program are minus the share, and y.
    """
    rows, offsets, sizes = map(np.concatenate, zip(*limits, strict=True))
    not_negative = np.eye(1, 1 + free.shape[1])
    A = np.vstack([np.column_stack([sizes, rows @ free]), not_negative])
    b = np.append(offsets - rows @ particular, 0.0)
    share, *at = maximised(A[None], b[None]).points[0]
    if np.isnan(share):
        return None
    return np.asarray(particular + free @ np.array(at))


@dataclass(frozen=True)
class CommandLimits:
    """Limits of the commands (m,) of n designs, numbered: k with rows @ x <= bounds.

    rows : (n, k, m), bounds : (n, k), in the order of `LIMITS`.
    """

    rows: Array
    bounds: Array

    def maximised(
        self,
        design: Index,
        Z: Array,
        base: Array,
    ) -> Maximum:
        """Solve p programs of designs (p,) for the largest z_0 of commands base (p, m) + Z (p, m,
        d) z.
        """
        rows = self.rows[design]
        bounds = self.bounds[design] - np.einsum("pkm,pm->pk", rows, base)
        return maximised(rows @ Z, bounds, self.further(design, Z, base))

    def further(
        self,
        design: Index,
        Z: Array,
        base: Array,
    ) -> WorstLimit | None:
        """Return the limits of the same programs that are no rows; here there are none."""
        return None


def stroke_limits(system: DriveSystem) -> CommandLimits:
    """Return the limits of one mechanism by the strokes of its actuators, which also pull."""
    rows, _, sizes = system.limits(np.zeros(3))["stroke"]
    return CommandLimits(rows[None], sizes[None])


def stack_names(drive: ActuatorSet) -> tuple[str, ...]:
    """Return the names of the stacks (n) of a drive: those of its actuators, with the second of a
    pair as partner.
    """
    names = list[str]()
    for row in drive.differential:
        name = drive.names[np.flatnonzero(row)[0]]
        names.append(f"{name}, partner" if min(row) < 0 else name)
    return tuple(names)
