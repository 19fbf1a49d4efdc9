"""One network of rigid bodies and elastic joints answers what is asked of a mechanism at rest, n designs at once.

With the twists U of the bodies, the wrenches w in the joints, both at the global origin, the openings e of the joints
(strokes, commanded joints, thermal expansion) and the loads F on the bodies,

    G U - C w = e,    G' w = F,

where G takes the twist of a joint's near body from that of its far one. C may be singular: an ideal pivot has rank one.

A body that is neither the output nor joined to other than two joints lies on a path. Joints in series along a path add
their compliances, so the paths between the bodies that are kept are reduced first; a joint then carries the wrench of
its path and the loads on the path's bodies beyond it, Q:

    A = sum C,  B = sum C Q,  D = sum Q' C Q,    G V - A w = B + sum e,    G' w = F,

with V the twists of the bodies kept and w the wrenches of the paths. The motions that the loads do work on are then
`F' V + B' w + D`.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array, inverse

GROUND = -1
SINGULAR = 1e-14  # of the largest eigenvalue of a joint's scaled compliance: no freedom of the joint


class Mechanism(NamedTuple):
    """Mechanisms of one topology, leading axes (...) designs; twists and wrenches x, y, theta at the global origin.

    bodies : number of moving bodies.   output : the one that is moved.
    joints : near and far body of each of the m joints; `GROUND` for the ground.
    compliance : (..., m, 3, 3), motion of the far body against the near one per wrench in the joint.
    coupled : joints of bodies that are elastic, body by body; a joint between two of them is named twice.
    coupling : (..., 3 c, 3 c), compliance of these bodies at their joints, added to that of the joints; None where all
        bodies are rigid.
    """

    bodies: int
    output: int
    joints: tuple[tuple[int, int], ...]
    compliance: Array
    coupled: tuple[int, ...] = ()
    coupling: Array | None = None


class LoadedWithin(NamedTuple):
    """What k loads do within elastic bodies: openings (..., m, 3, k) of joints, and motions (..., k, k) of the loads
    while the joints bear nothing."""

    openings: Array
    motions: Array


class Topology(NamedTuple):
    """The K bodies kept, the output first, and the P paths of joints in series between them.

    paths : joints of each.   signs : (P, m), -1 where a path meets a joint's far body first, zero off it.
    G : (3 P, 3 K), of the paths.   borne : (K, bodies), loads on bodies that those kept bear, directly or by paths.
    beyond : (m, bodies), loads that joints carry beside the wrench of their path.
    star : every path leads from the ground to the output, the only body kept.
    """

    kept: tuple[int, ...]
    paths: tuple[tuple[int, ...], ...]
    signs: Array
    G: Array
    borne: Array
    beyond: Array
    star: bool


class OutputStiffness(NamedTuple):
    """Stiffness `matrix` (..., 3, 3) of the output, and wrenches (..., m, 3, 3) in the joints per twist of it."""

    matrix: Array
    wrenches: Array


class MotionUnderLoads(NamedTuple):
    """What k loads and openings do.

    output : (..., 3, k), twist of the output.   wrenches : (..., m, 3, k), in the joints.
    motions : (..., k, k), what the loads (rows) do work on, by loads and openings (columns).
    """

    output: Array
    wrenches: Array
    motions: Array


@cache
def topology(bodies: int, output: int, joints: tuple[tuple[int, int], ...]) -> Topology:
    """The paths between the output, the ground, and bodies with other than two joints.

    Raises ValueError for a body that no path leads to.
    """
    at: dict[int, list[int]] = {body: [] for body in (GROUND, *range(bodies))}
    for joint, ends in enumerate(joints):
        for body in ends:
            at[body].append(joint)
    kept = (output, *(body for body in range(bodies) if body != output and len(at[body]) != 2))
    borne, beyond = np.zeros((len(kept), bodies)), np.zeros((len(joints), bodies))
    borne[range(len(kept)), kept] = 1.0
    paths, signs, incidence, reached = list[tuple[int, ...]](), list[Array](), list[Array](), {*kept}
    for start in (GROUND, *kept):
        for joint in at[start]:
            if any(joint in path for path in paths):
                continue
            body, path, sign, side = start, list[int](), np.zeros(len(joints)), np.zeros(len(kept))
            while True:
                near, far = joints[joint]
                path.append(joint)
                sign[joint], body = (1.0, far) if body == near else (-1.0, near)
                if body == GROUND or body in kept:
                    break
                reached.add(body)
                beyond[path, body] = sign[path]
                if start != GROUND:
                    borne[kept.index(start), body] = 1.0
                joint = next(other for other in at[body] if other != joint)
            if start != GROUND:
                side[kept.index(start)] -= 1.0
            if body != GROUND:
                side[kept.index(body)] += 1.0
            paths.append(tuple(path))
            signs.append(sign)
            incidence.append(side)
    if missing := {*range(bodies)} - reached:
        raise ValueError(f"bodies {sorted(missing)} are not joined to the output or the ground")
    G = np.asarray(np.kron(np.array(incidence), np.eye(3)), dtype=np.float64)
    star = len(kept) == 1 and all(side == 1 for side in incidence)
    return Topology(kept, tuple(paths), np.array(signs), G, borne, beyond, star)


def freedom_motions(at: AnyArray, along: AnyArray) -> Array:
    """Motions (..., 3, 3) of the origin, x, y, theta, for rotation, axial, shear of joints at complex places along
    complex unit vectors (...)."""
    zero = np.zeros(at.shape)
    rotation = np.stack([at.imag, -at.real, zero + 1], axis=-1)
    axial = np.stack([along.real, along.imag, zero], axis=-1)
    shear = np.stack([-along.imag, along.real, zero], axis=-1)
    return np.stack([rotation, axial, shear], axis=-1)


def joint_compliance(places: Array, axes: Array, rotation: Array, axial: Array, shear: Array) -> Array:
    """Compliance (..., 3, 3) at the origin of joints at `places` (..., 2) with axes at the angles `axes` (...), rad.

    Notes
    -----
    G k^-1 G^T with the columns (y, -x, 1) for rotation, (c, s, 0) for axial and (-s, c, 0) for shear, written out.
    """
    x, y = places[..., 0], places[..., 1]
    c, s = np.cos(axes), np.sin(axes)
    xt, yt = y * rotation, -x * rotation
    xx, yy = y * xt + c * c * axial + s * s * shear, -x * yt + s * s * axial + c * c * shear
    xy = y * yt + c * s * (axial - shear)
    rows = np.stack(np.broadcast_arrays(xx, xy, xt, xy, yy, yt, xt, yt, rotation))
    return np.moveaxis(rows.reshape(3, 3, *xx.shape), (0, 1), (-2, -1))  # entry by entry in memory: faster


def in_series(of: Mechanism) -> Array:
    """Sums (..., P, 3, 3) of the compliances of the joints of each path."""
    signs = topology(*of[:3]).signs
    return np.moveaxis(np.moveaxis(of.compliance, (-2, -1), (0, 1)) @ np.abs(signs).T, (0, 1), (-2, -1))


def stiffness(of: Mechanism) -> OutputStiffness:
    """Stiffness of the output, and what the joints carry when it moves.

    nan for a design with a path that is nearly, but not exactly, without compliance in some direction.
    """
    by = topology(*of[:3])
    if by.star and of.coupling is None:  # 3 by 3 alone, for many designs
        pulls = inverse(in_series(of))
        K = np.sum(pulls, axis=-3)
    else:
        column = _path_stiffness(of, by) @ by.G
        pulls, K = _of_paths(column, by), by.G.T @ column
    if len(by.kept) > 1:
        others = -inverse(K[..., 3:, 3:]) @ K[..., 3:, :3]
        held = np.concatenate([np.broadcast_to(np.eye(3), (*K.shape[:-2], 3, 3)), others], axis=-2)
        pulls, K = pulls @ held[..., None, :, :], K[..., :3, :] @ held
    if (ideal := _ideal(of, by, K)).any():
        _, across, twists = _saddle(_coupled(in_series(of), of, by), by.G)
        direct = inverse(twists[..., :3, :3])
        pulls = np.where(ideal[..., None], _of_paths(across[..., :3] @ direct, by), pulls)
        K = np.where(ideal, direct, K)
    return OutputStiffness(K, _in_joints(pulls, by))


def solve(
    of: Mechanism, loads: Array, openings: Array | None = None, within: LoadedWithin | None = None
) -> MotionUnderLoads:
    """What loads (..., bodies, 3, k) on the bodies and openings (..., m, 3, k) of the joints do.

    within : what the loads do within elastic bodies.

    nan for a design as of `stiffness`, and for one that moves without load.
    """
    by = topology(*of[:3])
    beyond, kept = (np.einsum("ib,...bak->...iak", taken, loads) for taken in (by.beyond, by.borne))
    own, kept = _opened(of, beyond), _column(kept)
    B, D = _along_paths(own, by), _column(beyond).swapaxes(-1, -2) @ _column(own)
    if within is not None:
        B, D = B + _along_paths(within.openings, by), D + within.motions
    t = B
    if openings is not None:
        t, D = B + _along_paths(openings, by), D + _column(beyond).swapaxes(-1, -2) @ _column(openings)
    W, G = _path_stiffness(of, by), by.G
    pulls = W @ G
    V = inverse(G.T @ pulls) @ (kept + np.swapaxes(pulls, -1, -2) @ t)
    w = W @ (G @ V - t)
    if (ideal := _ideal(of, by, V)).any():
        inner, across, twists = _saddle(_coupled(in_series(of), of, by), G)
        V = np.where(ideal, twists @ kept + np.swapaxes(across, -1, -2) @ t, V)
        w = np.where(ideal, across @ kept + inner @ t, w)
    motions = np.swapaxes(kept, -1, -2) @ V + np.swapaxes(B, -1, -2) @ w + D
    return MotionUnderLoads(V[..., :3, :], _in_joints(_of_paths(w, by), by) + beyond, motions)


def with_springs(motions: Array, rates: Array) -> Array:
    """Motions (..., k, k) of k loads with springs along the lines of n more.

    Parameters
    ----------
    motions : (..., k + n, k + n), of all of them without springs, as `solve` has it.
    rates : (n,), stiffness of the springs.
    """
    k, root = motions.shape[-1] - len(rates), np.sqrt(rates)
    across, openings = motions[..., :k, k:] * root, root[:, None] * motions[..., k:, k:] * root
    held = np.linalg.solve(np.eye(len(rates)) + openings, root[:, None] * motions[..., k:, :k])
    return np.asarray(motions[..., :k, :k] - across @ held)


def _column(parts: Array) -> Array:
    """Parts (..., n, 3, k) one below the other, (..., 3 n, k)."""
    return parts.reshape(*parts.shape[:-3], 3 * parts.shape[-3], parts.shape[-1])


def _along_paths(openings: Array, by: Topology) -> Array:
    """Openings (..., 3 P, k) of the paths by those (..., m, 3, k) of their joints."""
    flat = by.signs @ openings.reshape(*openings.shape[:-2], -1)
    return _column(flat.reshape(*flat.shape[:-1], 3, -1))


def _of_paths(w: Array, by: Topology) -> Array:
    """Wrenches (..., P, 3, k) of the paths by one column (..., 3 P, k) of them."""
    return w.reshape(*w.shape[:-2], len(by.paths), 3, w.shape[-1])


def _in_joints(paths: Array, by: Topology) -> Array:
    """Wrenches (..., m, 3, k) in the joints by those (..., P, 3, k) of their paths."""
    owner, signs = np.argmax(np.abs(by.signs), axis=0), np.sum(by.signs, axis=0)
    found = np.moveaxis(np.take(np.moveaxis(paths, (-2, -1), (0, 1)), owner, axis=-1), (0, 1), (-2, -1))
    return np.asarray(found if np.all(signs == 1) else signs[:, None, None] * found)


def _on_diagonal(A: Array) -> Array:
    """Matrices (..., P, 3, 3) on the diagonal of one, (..., 3 P, 3 P)."""
    count = A.shape[-3]
    full = np.zeros((*A.shape[:-3], count, 3, count, 3))
    full[..., np.arange(count), :, np.arange(count), :] = np.moveaxis(A, -3, 0)
    return full.reshape(*A.shape[:-3], 3 * count, 3 * count)


def _coupled(A: Array, of: Mechanism, by: Topology) -> Array:
    """Compliance (..., 3 P, 3 P) of all paths together, by that of their joints and of the bodies that couple them."""
    if of.coupling is None:
        return _on_diagonal(A)
    S = np.kron(by.signs[:, of.coupled], np.eye(3))
    return _on_diagonal(A) + S @ of.coupling @ S.T


def _path_stiffness(of: Mechanism, by: Topology) -> Array:
    """Inverse (..., 3 P, 3 P) of that, path by path where nothing couples them; nan as of `stiffness`."""
    A = in_series(of)
    return _on_diagonal(inverse(A)) if of.coupling is None else inverse(_coupled(A, of, by))


def _opened(of: Mechanism, wrenches: Array) -> Array:
    """Openings (..., m, 3, k) of joints, and of elastic bodies at them, that bear wrenches (..., m, 3, k)."""
    found = of.compliance @ wrenches
    if of.coupling is None:
        return found
    at = np.eye(len(of.joints))[:, of.coupled]
    own = of.coupling @ _column(wrenches[..., of.coupled, :, :])
    return np.asarray(found + np.einsum("mc,...cak->...mak", at, own.reshape(*own.shape[:-2], len(of.coupled), 3, -1)))


def _ideal(of: Mechanism, by: Topology, found: Array) -> NDArray[np.bool_]:
    """Which designs (..., 1, 1), without an answer (..., 3 K, j), have a path of joints with fewer than three freedoms.

    A path that a coupled body is on counts as elastic.
    """
    ideal = np.asarray(np.isnan(found[..., 0, 0]))
    if ideal.any():
        C = np.broadcast_to(of.compliance, (*ideal.shape, *of.compliance.shape[-3:]))
        ideal[ideal] = np.isfinite(C[ideal]).all(axis=(-3, -2, -1))
        size = np.sqrt(np.diagonal(C[ideal], axis1=-2, axis2=-1))
        square = size[..., :, None] * size[..., None, :]
        values = np.linalg.eigvalsh(C[ideal] / np.where(square > 0, square, 1.0))
        freedoms = np.sum(values > SINGULAR * values[..., -1:], axis=-1) @ np.abs(by.signs).T
        elastic = np.any(by.signs[:, of.coupled if of.coupling is not None else ()], axis=1)
        ideal[ideal] = np.any((freedoms < 3) & ~elastic, axis=-1)
    return ideal[..., None, None]


def _saddle(A: Array, G: Array) -> tuple[Array, Array, Array]:
    """Wrenches of the paths by openings (..., 3 P, 3 P) and by loads (..., 3 P, 3 K), twists by loads (..., 3 K, 3 K).

    Of `G V - A w = t` and `G' w = F` with G (3 P, 3 K), whether A (..., 3 P, 3 P) is singular or not.
    """
    rows, size = G.shape
    scale = np.max(np.abs(A), axis=(-2, -1), keepdims=True)
    M = np.zeros((*A.shape[:-2], rows + size, rows + size))
    M[..., :rows, :rows], M[..., :rows, rows:], M[..., rows:, :rows] = -A / scale, G, G.T
    found = inverse(M)
    return found[..., :rows, :rows] / scale, found[..., :rows, rows:], found[..., rows:, rows:] * scale
