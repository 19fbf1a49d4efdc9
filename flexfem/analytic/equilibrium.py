"""Exact equilibrium under a load or at a pose, with closed loops at finite joint displacements.

What the two second-order terms of (16), `- tau_p o H_p - F_u o H_u`, are worth away from rest follows from it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic.kinematics import ROTATION, chain_poses
from flexfem.analytic.loops import in_joint_order, open_loops
from flexfem.analytic.stiffness import Mechanism, Stiffness, apply, effective_load, stiffness, transposed
from flexfem.arrays import Array, inverse
from flexfem.refused import ComputationFailed
from flexfem.stage.designs import Frames

STEP = 1e-9  # relative size of the last Newton step; the error it leaves is of second order, that is rounding
ITERATIONS = 25
LOAD_STEPS = (1, 4, 16, 64)
LARGEST_TURN = 0.5  # rad in one iteration; beyond it Newton may land on another branch, so the load is divided


class Equilibrium(NamedTuple):
    """Exact equilibrium reached from rest; nan for a design whose loops are singular at rest.

    pose : (..., 3), platform displacement, mm and rad.   load : (..., 3), on the platform, N and N mm.
    displacement : (..., N), joint displacements, rad and mm.
    residual : (...), sqrt of the energy of the remaining Newton step over the stored energy.
    iterations : Newton iterations in all load steps together.
    """

    pose: Array
    load: Array
    displacement: Array
    residual: Array
    iterations: int


def close_loops(of: Mechanism, displacement: Array) -> Array:
    """All joint displacements (..., N) with the independent ones as given and the dependent ones closing the loops.

    The dependent entries given are the start of Newton's method on the six gaps. nan where the loops cannot be
    closed (a singular configuration, or independent displacements out of reach).
    """
    shape = np.broadcast_shapes(displacement.shape[:-1], of.springs.shape[:-1], of.frames.axes.shape[:-2])
    phi = np.broadcast_to(displacement, (*shape, displacement.shape[-1]))
    small = np.zeros(shape, dtype=bool)
    for _ in range(ITERATIONS):
        A_inverse, gap = open_loops(of.frames, of.joints, of.choice, phi)
        step = -apply(A_inverse, gap)
        change = in_joint_order(step[..., None], np.zeros((of.joints.mobility, 1)), of.choice)[..., 0]
        phi = phi + change
        small = _size(of, change) <= STEP * _size(of, phi)
        if np.all(small | np.isnan(step).any(axis=-1)):
            break
    return np.where(small[..., None], phi, np.nan)


def under_load(of: Mechanism, load: Array) -> Equilibrium:
    """Equilibrium under a dead platform load (..., 3): force at the platform centre, moving with it, and moment.

    Raises
    ------
    ComputationFailed: Newton on (13) with (16) as tangent does not converge even in the smallest load steps.
    """
    return _reach(of, np.asarray(load, dtype=float), hold=False)


def at_pose(of: Mechanism, pose: Array) -> Equilibrium:
    """Load that holds the platform exactly at the displacement `pose` (..., 3), mm and rad, and the joints there.

    Raises
    ------
    ComputationFailed: as `under_load`; also when the pose is out of reach.
    """
    return _reach(of, np.asarray(pose, dtype=float), hold=True)


def _reach(of: Mechanism, target: Array, hold: bool) -> Equilibrium:
    shape = np.broadcast_shapes(target.shape[:-1], of.springs.shape[:-1], of.frames.axes.shape[:-2])
    rest = np.zeros((*shape, of.springs.shape[-1]))
    singular = np.isnan(np.broadcast_to(stiffness(of).K_uu, (*shape, 3, 3))).any(axis=(-2, -1))
    iterations = 0
    for steps in LOAD_STEPS:
        phi, load = rest, np.zeros((*shape, 3))
        for k in range(1, steps + 1):
            goal = np.broadcast_to(target * (k / steps), (*shape, 3))
            phi, load, used = _newton(of, phi, load, goal, hold)
            iterations += used
        done = ~np.isnan(phi).any(axis=-1)
        if np.all(done | singular):
            return _result(of, phi, load, iterations)
    failed = np.argwhere(~(done | singular))
    where = f", design {tuple(failed[0].tolist())} the first of {len(failed)}" if shape else ""
    what = "holding the pose" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {what}{where}: Newton on (13) did not converge in {LOAD_STEPS[-1]} load steps; the target is"
        " beyond a singular configuration or beyond buckling"
    )


def _newton(of: Mechanism, phi: Array, load: Array, goal: Array, hold: bool) -> tuple[Array, Array, int]:
    """Joint displacements and load at `goal`, which is a load or (hold) a pose; nan where not converged."""
    load = load if hold else goal
    small: NDArray[np.bool_] = np.zeros(phi.shape[:-1], dtype=bool)
    iterations = 0
    for _ in range(ITERATIONS):
        iterations += 1
        change, dF = _step(of, phi, load, goal if hold else None)
        load = load + dF
        turn = np.max(np.abs(change) * (of.joints.kind == ROTATION), axis=-1, keepdims=True)
        moved = close_loops(of, np.where(turn <= LARGEST_TURN, phi + change, np.nan))
        small = _energy(of, change) <= STEP**2 * _energy(of, moved)
        phi = moved
        if np.all(small | np.isnan(phi).any(axis=-1)):
            break
    return np.where(small[..., None], phi, np.nan), load, iterations


def _step(of: Mechanism, phi: Array, load: Array, pose: Array | None) -> tuple[Array, Array]:
    """Change of all joints (..., N) and of the load: K_aa dphi_a = T_a + G_u^T dF, and G_u dphi_a = du if held."""
    at = stiffness(of, phi, load)
    first, C_aa = at.influence, at.C_aa
    T_a = effective_load(of, first, phi, load)
    dF = np.zeros_like(load)
    if pose is not None:
        dF = apply(at.K_uu, pose - first.pose - apply(first.G_u, apply(C_aa, T_a)))
    dphi_a = apply(C_aa, T_a + transposed(first.G_u, dF))
    return apply(first.G_a, dphi_a), dF


def _result(of: Mechanism, phi: Array, load: Array, iterations: int) -> Equilibrium:
    pose = chain_poses(of.frames, of.joints, phi).pose[..., 0, :]
    change, _ = _step(of, phi, load, None)
    stored = _energy(of, phi)
    residual = np.sqrt(_energy(of, change) / np.where(stored > 0.0, stored, 1.0))
    return Equilibrium(pose, load, phi, residual, iterations)


def _energy(of: Mechanism, phi: Array) -> Array:
    """Twice the energy in the joint springs (...), N mm."""
    energy: Array = np.sum(of.springs * phi**2, axis=-1)
    return energy


def _size(of: Mechanism, phi: Array) -> Array:
    """Largest joint displacement (...), rad, prismatic ones over the mean distance of the hinges from the centre."""
    length = np.sqrt(np.mean(np.sum(of.frames.centres**2, axis=-1), axis=(-2, -1)))[..., None]
    size: Array = np.max(np.abs(phi) / np.where(of.joints.kind == ROTATION, 1.0, length), axis=-1)
    return size


PLACES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # between two commands; more change nothing above rounding


class Tangents(NamedTuple):
    """Exact load (..., 3) at poses, and tangent stiffness (..., 3, 3) there with and without the second-order terms."""

    load: Array
    tangent: Array
    without: Array


class Missed(NamedTuple):
    """Relative values (...), the largest over a box of poses.

    position : distance of the linear from the exact position, rotations by the lever.
    terms : change of the diagonal of the tangent compliance by the second-order terms.
    """

    position: Array
    terms: Array


def without_terms(of: Mechanism, at: Stiffness) -> Array:
    """K_uu (..., 3, 3) at a configuration by (16) without `- tau_p o H_p - F_u o H_u`.

    Notes
    -----
    What stays, `K_a + G_p^T K_p G_p` with the influence coefficients of the displaced stage, is `G_a^T k G_a` over all
    springs k. Only both terms together mean something: in equilibrium their sum does not depend on which joints are
    called independent, while each alone does and may be many times the sum.
    """
    R = np.linalg.qr(np.sqrt(of.springs)[..., :, None] * at.influence.G_a).R
    half = at.influence.G_u @ inverse(R)
    return inverse(half @ np.swapaxes(half, -1, -2))


def tangents(of: Mechanism, poses: Array) -> Tangents:
    """Load and tangent stiffness of the pseudo-rigid stage held at poses (..., 3). Raises ComputationFailed."""
    exact = at_pose(of, poses)
    at = stiffness(of, exact.displacement, exact.load)
    return Tangents(exact.load, at.K_uu, without_terms(of, at))


def along(commanded: Array, axis: int) -> Array:
    """Poses (..., 3) of commands (...) along one axis."""
    return np.asarray(commanded[..., None] * np.eye(3)[axis])


def summed_loads(of: Mechanism, commanded: Array, axis: int) -> dict[str, Array]:
    """Loads (n, 3) by summing the stiffness `tangent` and `without` along the way from rest, one of the commands (n,).

    Raises ComputationFailed when a pose on the way is not reached.
    """
    half = np.diff(commanded)[:, None] / 2
    found = tangents(of, along(commanded[:-1, None] + half * (1 + PLACES), axis))
    loads = {}
    for name in ("without", "tangent"):
        steps = np.einsum("kq,kqi->ki", half * WEIGHTS, getattr(found, name)[..., axis])
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        loads[name] = total - total[np.argmin(np.abs(commanded))]
    return loads


def at_every(of: Mechanism) -> Mechanism:
    """The mechanism with one more leading axis, for poses: each of its designs at each of them."""
    frames = Frames(of.frames.centres[..., None, :, :, :], of.frames.axes[..., None, :, :])
    return of._replace(frames=frames, springs=of.springs[..., None, :])


def missed(of: Mechanism, amplitude: Array, lever: ArrayLike) -> Missed:
    """What linear positions and tangents miss at corners, edges and faces of a box of poses (3,), mm and rad.

    Parameters
    ----------
    of : with leading axes (...) of designs, or none.   lever : (...), mm.

    Raises ComputationFailed when one of the poses is not reached.
    """
    far = np.asarray(lever, dtype=float)
    poses = amplitude * np.array([np.subtract(place, 1.0) for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)])
    each, scale = at_every(of), np.stack([np.ones_like(far), np.ones_like(far), far], axis=-1)[..., None, :]
    found = tangents(each, poses)
    off = np.linalg.norm((apply(stiffness(each).C_uu, found.load) - poses) * scale, axis=-1)
    with_, less = (np.diagonal(inverse(K), axis1=-2, axis2=-1) for K in (found.tangent, found.without))
    position = np.max(off / np.linalg.norm(poses * scale, axis=-1), axis=-1)
    return Missed(position, np.max(np.abs(with_ / less - 1), axis=(-2, -1)))
