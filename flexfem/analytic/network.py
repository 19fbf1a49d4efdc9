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

from flexfem.arrays import Array, inverse

GROUND = -1
SINGULAR = 1e-14  # of the largest eigenvalue of a joint's scaled compliance: no freedom of the joint


class SeriesSum(NamedTuple):
    """Sums over the joints of each of P paths under k loads: A (..., P, 3, 3), B (..., P, 3, k) and D (..., k, k)."""

    A: Array
    B: Array
    D: Array


class Mechanism(NamedTuple):
    """Mechanisms of one topology, leading axes (...) designs; twists and wrenches x, y, theta at the global origin.

    bodies : number of moving bodies.
    output : the one that is moved.
    joints : near and far body of each of the m joints; `GROUND` for the ground.
    compliance : (..., m, 3, 3), motion of the far body against the near one per wrench in the joint.
    coupled : joints of bodies that are elastic, body by body; a joint between two of them is named twice.
    coupling : (..., 3 c, 3 c), compliance of these bodies at their joints, added to that of the joints; None where all
        bodies are rigid.
    series : what joints that are not listed add to the paths, in the order of `topology`; None for nothing.
    """

    bodies: int
    output: int
    joints: tuple[tuple[int, int], ...]
    compliance: Array
    coupled: tuple[int, ...] = ()
    coupling: Array | None = None
    series: SeriesSum | None = None


class JointsInSeries(NamedTuple):
    """A path between two bodies kept, or one and the ground.

    joints : from its near to its far end.   signs : -1 where the path meets a joint's far body first.
    inner : the bodies between its joints.   near, far : the bodies at its ends; `GROUND` for the ground.
    """

    joints: tuple[int, ...]
    signs: tuple[int, ...]
    inner: tuple[int, ...]
    near: int
    far: int

    @property
    def steps(self) -> list[tuple[int, int]]:
        """Joints with their signs."""
        return list(zip(self.joints, self.signs, strict=True))


class Topology(NamedTuple):
    """The bodies kept (K), the output first, and the P paths between them.

    G : (P, 3, 3 K), of the paths.   signs : (P, m), of the joints on each path, zero for the others.
    """

    kept: tuple[int, ...]
    paths: tuple[JointsInSeries, ...]
    G: Array
    signs: Array

    @property
    def star(self) -> bool:
        """Whether every path leads from the ground to the output."""
        return all((path.near, path.far) == (GROUND, self.kept[0]) for path in self.paths)


class OutputStiffness(NamedTuple):
    """Stiffness `matrix` (..., 3, 3) of the output, wrenches `paths` (..., P, 3, 3) of the paths per twist of it."""

    matrix: Array
    paths: Array


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
    used, paths = set[int](), list[JointsInSeries]()
    for start in (GROUND, *kept):
        for joint in at[start]:
            body, joints_of, signs, inner = start, list[int](), list[int](), list[int]()
            while joint not in used:
                used.add(joint)
                near, far = joints[joint]
                joints_of.append(joint)
                signs.append(1 if body == near else -1)
                body = far if body == near else near
                if body == GROUND or body in kept:
                    paths.append(JointsInSeries(tuple(joints_of), tuple(signs), tuple(inner), start, body))
                    break
                inner.append(body)
                joint = next(other for other in at[body] if other != joint)
    missing = set(range(bodies)) - set(kept) - {body for path in paths for body in path.inner}
    if missing:
        raise ValueError(f"bodies {sorted(missing)} are not joined to the output or the ground")
    G, signs_of = np.zeros((len(paths), 3, len(kept), 3)), np.zeros((len(paths), len(joints)))
    for k, path in enumerate(paths):
        signs_of[k, path.joints] = path.signs
        for body, sign in ((path.near, -1), (path.far, 1)):
            if body != GROUND:
                G[k, :, kept.index(body)] += sign * np.eye(3)
    return Topology(kept, tuple(paths), G.reshape(len(paths), 3, -1), signs_of)


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


def in_series(compliance: Array, by: Topology) -> Array:
    """Sums (..., P, 3, 3) of the compliances (..., m, 3, 3) of the joints of each path."""
    return np.moveaxis(np.moveaxis(compliance, (-2, -1), (0, 1)) @ np.abs(by.signs).T, (0, 1), (-2, -1))


def stiffness(of: Mechanism) -> OutputStiffness:
    """Stiffness of the output, and what the paths carry when it moves; `joint_wrenches` makes it that of the joints.

    nan for a design with a path that is nearly, but not exactly, without compliance in some direction.
    """
    by = topology(of.bodies, of.output, of.joints)
    A, G = _path_compliance(of, by), by.G
    if of.coupling is None and by.star:  # 3 by 3 alone, for many designs
        pulls = inverse(A)
    else:
        A = _coupled(A, of, by)
        pulls = _of_paths(inverse(A) @ _column(G), by)
    K = np.sum(pulls, axis=-3) if by.star else np.einsum("pab,...pac->...bc", G, pulls)
    if len(by.kept) > 1:
        others = -inverse(K[..., 3:, 3:]) @ K[..., 3:, :3]
        held = np.concatenate([np.broadcast_to(np.eye(3), (*K.shape[:-2], 3, 3)), others], axis=-2)
        pulls, K = pulls @ held[..., None, :, :], K[..., :3, :] @ held
    if (ideal := _ideal(of, by, K)).any():
        _, across, twists = _saddle(_coupled(_path_compliance(of, by), of, by), _column(G))
        direct = inverse(twists[..., :3, :3])
        pulls = np.where(ideal[..., None, None, None], _of_paths(across[..., :3] @ direct, by), pulls)
        K = np.where(ideal[..., None, None], direct, K)
    return OutputStiffness(K, pulls)


def solve(of: Mechanism, loads: Array, openings: Array | None = None) -> MotionUnderLoads:
    """What loads (..., bodies, 3, k) on the bodies and openings (..., m, 3, k) of the joints do.

    nan for a design as of `stiffness`, and for one that moves without load.
    """
    by = topology(of.bodies, of.output, of.joints)
    beyond, kept = _loads(of, by, loads)
    own = _with_coupling(of, of.compliance @ beyond, beyond) if beyond.any() else beyond
    B, D = _along_paths(own, by), _column(beyond).swapaxes(-1, -2) @ _column(own)
    if of.series is not None:
        B, D = B + _column(of.series.B), D + of.series.D
    t = B
    if openings is not None:
        t, D = B + _along_paths(openings, by), D + _column(beyond).swapaxes(-1, -2) @ _column(openings)
    A, G = _coupled(_path_compliance(of, by), of, by), _column(by.G)
    W = inverse(A)
    pulls = W @ G
    V = inverse(G.T @ pulls) @ (kept + np.swapaxes(pulls, -1, -2) @ t)
    w = W @ (G @ V - t)
    if (ideal := _ideal(of, by, V)[..., None, None]).any():
        inner, across, twists = _saddle(A, G)
        V = np.where(ideal, twists @ kept + np.swapaxes(across, -1, -2) @ t, V)
        w = np.where(ideal, across @ kept + inner @ t, w)
    motions = np.swapaxes(kept, -1, -2) @ V + np.swapaxes(B, -1, -2) @ w + D
    return MotionUnderLoads(V[..., :3, :], joint_wrenches(of, _of_paths(w, by)) + beyond, motions)


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


def _path_compliance(of: Mechanism, by: Topology) -> Array:
    """Compliances (..., P, 3, 3) of the paths but for `coupling`."""
    A = in_series(of.compliance, by)
    return A if of.series is None else A + of.series.A


def _coupled(A: Array, of: Mechanism, by: Topology) -> Array:
    """Compliance (..., 3 P, 3 P) of all paths together, with that of the elastic body that couples them."""
    count = len(by.paths)
    full = np.einsum("pq,...pab->...paqb", np.eye(count), A)
    if of.coupling is not None:
        full = np.broadcast_to(full, (*np.broadcast_shapes(A.shape[:-3], of.coupling.shape[:-2]), *full.shape[-4:]))
        full = full.copy()
        place = {joint: (path, sign) for path in range(count) for joint, sign in by.paths[path].steps}
        where = [place[joint] for joint in of.coupled]
        parts = of.coupling.reshape(*of.coupling.shape[:-2], len(where), 3, len(where), 3)
        for i, (row, one) in enumerate(where):
            for j, (column, other) in enumerate(where):
                full[..., row, :, column, :] += one * other * parts[..., i, :, j, :]
    return np.asarray(full.reshape(*full.shape[:-4], 3 * count, 3 * count))


def _with_coupling(of: Mechanism, moved: Array, wrenches: Array) -> Array:
    """Openings (..., m, 3, k) of the joints with those of the elastic body under the wrenches in its joints."""
    if of.coupling is None:
        return moved
    at = list(of.coupled)
    carried = wrenches[..., at, :, :].reshape(*wrenches.shape[:-3], 3 * len(at), wrenches.shape[-1])
    own = of.coupling @ carried
    found = np.broadcast_to(moved, (*own.shape[:-2], *moved.shape[-3:])).copy()
    for place, joint in enumerate(at):
        found[..., joint, :, :] += own[..., 3 * place : 3 * place + 3, :]
    return found


def _loads(of: Mechanism, by: Topology, loads: Array) -> tuple[Array, Array]:
    """Wrench (..., m, 3, k) in each joint by loads on the bodies of its path beyond it; loads (..., 3 K, k) on those
    kept, with what the paths that start there bear."""
    lead, k = loads.shape[:-3], loads.shape[-1]
    beyond, kept = np.zeros((*lead, len(of.joints), 3, k)), loads[..., list(by.kept), :, :].copy()
    for path in by.paths:
        total = np.zeros((*lead, 3, k))
        for (joint, sign), body in zip(path.steps[-2::-1], reversed(path.inner), strict=True):
            total = total + loads[..., body, :, :]
            beyond[..., joint, :, :] = sign * total
        if path.near != GROUND:
            kept[..., by.kept.index(path.near), :, :] += total
    return beyond, kept.reshape(*lead, 3 * len(by.kept), k)


def _of_paths(w: Array, by: Topology) -> Array:
    """Wrenches (..., P, 3, k) of the paths, from one column (..., 3 P, k) of them."""
    return w.reshape(*w.shape[:-2], len(by.paths), 3, w.shape[-1])


def joint_wrenches(of: Mechanism, paths: Array) -> Array:
    """Wrenches (..., m, 3, k) in the joints by those (..., P, 3, k) of their paths, the loads on these aside."""
    by = topology(of.bodies, of.output, of.joints)
    owner, signs = np.argmax(np.abs(by.signs), axis=0), np.sum(by.signs, axis=0)
    found = np.moveaxis(np.take(np.moveaxis(paths, (-2, -1), (0, 1)), owner, axis=-1), (0, 1), (-2, -1))
    return np.asarray(found if np.all(signs == 1) else signs[:, None, None] * found)


def _ideal(of: Mechanism, by: Topology, found: Array) -> NDArray[np.bool_]:
    """Which designs (...) without an answer (..., 3 K, j) have a path of joints with fewer than three freedoms."""
    ideal = np.asarray(np.isnan(found[..., 0, 0]))
    if not ideal.any():
        return ideal
    C = np.broadcast_to(of.compliance, (*ideal.shape, *of.compliance.shape[-3:]))
    ideal[ideal] = np.isfinite(C[ideal]).all(axis=(-3, -2, -1))
    size = np.sqrt(np.diagonal(C[ideal], axis1=-2, axis2=-1))
    square = size[..., :, None] * size[..., None, :]
    values = np.linalg.eigvalsh(C[ideal] / np.where(square > 0, square, 1.0))
    freedoms = np.sum(values > SINGULAR * values[..., -1:], axis=-1)
    few = np.zeros(len(freedoms), dtype=bool)
    for path in by.paths:
        if of.series is None and (of.coupling is None or not set(of.coupled) & set(path.joints)):
            few |= np.sum(freedoms[:, list(path.joints)], axis=-1) < 3
    ideal[ideal] = few
    return ideal


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
