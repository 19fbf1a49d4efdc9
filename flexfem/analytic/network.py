"""Statics of networks of rigid bodies and elastic joints at rest, for n designs at once.

With the twists U of the bodies, the wrenches w in the joints, both at the global origin, the
openings e of the joints (strokes, commanded joints, thermal expansion) and the loads F on the
bodies,

    G U - C w = e,    G' w = F,

where G subtracts the twist of a joint's near body from that of its far one. C of a joint may be
singular, as for an ideal pivot; the sum over the joints of a path may not.

Each body that is not the output and has exactly two joints lies on a path. Joints in series along a
path add their compliances, so the paths between the other bodies, which are kept, are reduced
first. A joint then carries the wrench of its path and Q, the loads on the path's bodies distal to
it:

    A = sum C,  B = sum C Q,  D = sum Q' C Q,    G V - A w = B + sum e,    G' w = F,

with V the twists of the kept bodies and w the wrenches of the paths. The displacements conjugate to
the loads are then `F' V + B' w + D`."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array, inverse

GROUND = -1
STILL = 1e-13  # relative to the largest compliance of a mode; smaller ones are round-off


class Network(NamedTuple):
    """Mechanisms of one topology; leading axes (...) are designs.

    Twists and wrenches x, y, theta are at the global origin.

    bodies : number of moving bodies.   output : the body whose stiffness is computed.
    joints : near and far body of each of the m joints; `GROUND` for the ground.
    compliance : (..., m, 3, 3), motion of the far body relative to the near one per wrench in the
        joint.
    coupled : c joints of elastic bodies, body by body; a joint between two such bodies is listed
        twice.
    coupling : (..., 3 c, 3 c), compliance of these bodies at their joints, added to that of the
        joints; None where all bodies are rigid.
    """

    bodies: int
    output: int
    joints: tuple[tuple[int, int], ...]
    compliance: Array
    coupled: tuple[int, ...] = ()
    coupling: Array | None = None


class InternalMotions(NamedTuple):
    """Motions of elastic bodies under k loads while the joints carry no wrench.

    openings : (..., m, 3, k), of the joints.   motions : (..., k, k), conjugate to the loads.
    """

    openings: Array
    motions: Array


class Topology(NamedTuple):
    """The K kept bodies, the output first, and the P paths of joints in series between them.

    paths : joints of each path.
    signs : (P, m), -1 where a path meets a joint's far body first, zero off the path.
    G : (3 P, 3 K), of the paths.
    kept_loads : (K, bodies), loads on bodies that act on the kept ones.
    joint_loads : (m, bodies), loads on bodies that joints carry in addition to the wrench of their
        path.
    """

    kept: tuple[int, ...]
    paths: tuple[tuple[int, ...], ...]
    signs: Array
    G: Array
    kept_loads: Array
    joint_loads: Array


class OutputStiffness(NamedTuple):
    """Stiffness (..., 3, 3) of the output, and wrenches (..., m, 3, 3) per twist of it."""

    matrix: Array
    wrenches: Array


class MotionUnderLoads(NamedTuple):
    """Response to k loads and openings.

    output : (..., 3, k), twist of the output.   wrenches : (..., m, 3, k), in the joints.
    motions : (..., k, k), displacements conjugate to the loads (rows) under the loads and openings
        (columns).
    """

    output: Array
    wrenches: Array
    motions: Array


@cache
def topology(
    bodies: int,
    output: int,
    joints: tuple[tuple[int, int], ...],
) -> Topology:
    """Return the paths between the output, the ground, and bodies with other than two joints.

    Raises ValueError for a body that no path leads to.
    """
    joints_at = _joints_at(bodies, joints)
    branching = [body for body in range(bodies) if body != output and len(joints_at[body]) != 2]
    kept = (output, *branching)
    kept_loads = np.zeros((len(kept), bodies))
    kept_loads[range(len(kept)), kept] = 1.0
    joint_loads = np.zeros((len(joints), bodies))
    paths = _paths(kept, joints, joints_at)
    for path in paths:
        for number, body in enumerate(path.between, start=1):
            before = list(path.joints[:number])
            joint_loads[before, body] = path.signs[:number]
            if path.start != GROUND:
                kept_loads[kept.index(path.start), body] = 1.0
    reached = {*kept, *(body for path in paths for body in path.between)}
    missing = {*range(bodies)} - reached
    if missing:
        raise ValueError(f"bodies {sorted(missing)} are not joined to the output or the ground")
    signs = np.zeros((len(paths), len(joints)))
    for row, path in enumerate(paths):
        signs[row, list(path.joints)] = path.signs
    G = np.asarray(np.kron(_incidence(kept, paths), np.eye(3)), dtype=np.float64)
    return Topology(kept, tuple(path.joints for path in paths), signs, G, kept_loads, joint_loads)


def _joints_at(bodies: int, joints: tuple[tuple[int, int], ...]) -> dict[int, list[int]]:
    """Return the joints at the ground and at each body."""
    found: dict[int, list[int]] = {body: [] for body in (GROUND, *range(bodies))}
    for joint, ends in enumerate(joints):
        for body in ends:
            found[body].append(joint)
    return found


def _incidence(kept: tuple[int, ...], paths: list[_Path]) -> Array:
    """Return a matrix (P, K) with -1 at the kept body where a path starts, 1 where it ends."""
    found = np.zeros((len(paths), len(kept)))
    for row, path in enumerate(paths):
        for body, sign in ((path.start, -1.0), (path.end, 1.0)):
            if body != GROUND:
                found[row, kept.index(body)] += sign
    return found


class _Path(NamedTuple):
    """Joints in series from a kept body or the ground to another one.

    signs : 1 or -1 for each joint, which meets its near or its far body first.
    between : the bodies between the joints.
    """

    start: int
    end: int
    joints: tuple[int, ...]
    signs: tuple[float, ...]
    between: tuple[int, ...]


def _paths(
    kept: tuple[int, ...], joints: tuple[tuple[int, int], ...], joints_at: dict[int, list[int]]
) -> list[_Path]:
    """Return the paths from the ground, then from the kept bodies, each path once."""
    found = list[_Path]()
    used = set[int]()
    for start in (GROUND, *kept):
        for joint in joints_at[start]:
            if joint not in used:
                found.append(_path_from(start, joint, kept, joints, joints_at))
                used.update(found[-1].joints)
    return found


def _path_from(
    start: int,
    joint: int,
    kept: tuple[int, ...],
    joints: tuple[tuple[int, int], ...],
    joints_at: dict[int, list[int]],
) -> _Path:
    """Return the path that leaves a body by a joint."""
    on_path = list[int]()
    signs = list[float]()
    between = list[int]()
    body = start
    while True:
        near, far = joints[joint]
        signs.append(1.0 if body == near else -1.0)
        body = far if body == near else near
        on_path.append(joint)
        if body == GROUND or body in kept:
            return _Path(start, body, tuple(on_path), tuple(signs), tuple(between))
        between.append(body)
        joint = next(other for other in joints_at[body] if other != joint)


def freedom_motions(places: AnyArray, axes: AnyArray) -> Array:
    """Return the motions (..., 3, 3) of the origin, x, y, theta, by three motions of joints.

    These are rotation, axial and shear motion.

    places, axes : (...), complex, mm, and unit vectors along the axes.
    """
    zero = np.zeros(places.shape)
    rotation = np.stack([places.imag, -places.real, zero + 1], axis=-1)
    axial = np.stack([axes.real, axes.imag, zero], axis=-1)
    shear = np.stack([-axes.imag, axes.real, zero], axis=-1)
    return np.stack([rotation, axial, shear], axis=-1)


def ground_motions(places: ArrayLike) -> Array:
    """Return rigid motions (..., 3, 3 cases) of the origin by which ground follows a free plate.

    places : (...), complex, mm, of the ground. The expansion of the plate is one.

    Notes
    -----
    In the cases 1 K, 1 K/mm along x and along y a free body has per expansion at z = x + iy the
    displacements z, `z^2/2` and `-i z^2/2` and the rotations 0, y and -x. At the origin they are
    `(x, y, 0)`, `(r^2/2, 0, y)` and `(0, r^2/2, -x)`."""
    x = np.real(places)
    y = np.imag(places)
    zero = np.zeros_like(x)
    half = (x**2 + y**2) / 2
    return np.moveaxis(
        np.array([[x, half, zero], [y, zero, half], [zero, y, -x]]), (0, 1), (-2, -1)
    )


def joint_compliance(
    places: Array, axes: Array, rotation: Array, axial: Array, shear: Array
) -> Array:
    """Return the compliance (..., 3, 3) at the origin of joints.

    places : (..., 2), mm.   axes : (...), rad.   rotation, axial, shear : (...), compliances.

    Notes
    -----
    It is G k^-1 G^T, expanded, with the columns (y, -x, 1) for rotation, (c, s, 0) for axial and
    (-s, c, 0) for shear."""
    x = places[..., 0]
    y = places[..., 1]
    c = np.cos(axes)
    s = np.sin(axes)
    xt = y * rotation
    yt = -x * rotation
    xx = y * xt + c * c * axial + s * s * shear
    yy = -x * yt + s * s * axial + c * c * shear
    xy = y * yt + c * s * (axial - shear)
    rows = np.stack(np.broadcast_arrays(xx, xy, xt, xy, yy, yt, xt, yt, rotation))
    # designs stay contiguous in memory: faster
    return np.moveaxis(rows.reshape(3, 3, *xx.shape), (0, 1), (-2, -1))


def in_series(mechanism: Network) -> Array:
    """Return the sums (..., P, 3, 3) of the compliances of the joints of each path."""
    signs = topology(*mechanism[:3]).signs
    by_entry = np.moveaxis(mechanism.compliance, (-2, -1), (0, 1))
    return np.moveaxis(by_entry @ np.abs(signs).T, (0, 1), (-2, -1))


def stiffness(mechanism: Network) -> OutputStiffness:
    """Return the stiffness of the output, and the wrenches in the joints per twist of it.

    nan for a design with a path that has no, or nearly no, compliance in some direction.
    """
    graph = topology(*mechanism[:3])
    to_output = np.tile(np.eye(3), (len(graph.paths), 1))
    if mechanism.coupling is None and np.array_equal(graph.G, to_output):
        # every path leads from the ground to the output: matrices of 3 by 3 suffice, for many
        # designs
        wrenches = inverse(in_series(mechanism))
        K = np.sum(wrenches, axis=-3)
    else:
        column = _path_stiffness(mechanism, graph) @ graph.G
        wrenches = _by_path(column, graph)
        K = graph.G.T @ column
    if len(graph.kept) > 1:
        others = -inverse(K[..., 3:, 3:]) @ K[..., 3:, :3]
        twists = np.concatenate(
            [np.broadcast_to(np.eye(3), (*K.shape[:-2], 3, 3)), others], axis=-2
        )
        wrenches = wrenches @ twists[..., None, :, :]
        K = K[..., :3, :] @ twists
    return OutputStiffness(K, _by_joint(wrenches, graph))


def solve(
    mechanism: Network,
    loads: Array,
    openings: Array | None = None,
    internal: InternalMotions | None = None,
) -> MotionUnderLoads:
    """Return the response to loads on the bodies and openings of the joints.

    loads : (..., bodies, 3, k).   openings : (..., m, 3, k).

    nan for a design as in `stiffness`, and for one that can move without load.
    """
    graph = topology(*mechanism[:3])
    Q, F = (
        np.einsum("ib,...bak->...iak", shares, loads)
        for shares in (graph.joint_loads, graph.kept_loads)
    )
    opened = _opened(mechanism, Q)
    F = _column(F)
    B = _path_openings(opened, graph)
    D = _column(Q).swapaxes(-1, -2) @ _column(opened)
    if internal is not None:
        by_Q = _column(Q).swapaxes(-1, -2) @ _column(internal.openings)
        B = B + _path_openings(internal.openings, graph)
        D = D + internal.motions + by_Q + by_Q.swapaxes(-1, -2)
    t = B
    if openings is not None:
        t = B + _path_openings(openings, graph)
        D = D + _column(Q).swapaxes(-1, -2) @ _column(openings)
    W = _path_stiffness(mechanism, graph)
    G = graph.G
    WG = W @ G
    V = inverse(G.T @ WG) @ (F + np.swapaxes(WG, -1, -2) @ t)
    w = W @ (G @ V - t)
    motions = np.swapaxes(F, -1, -2) @ V + np.swapaxes(B, -1, -2) @ w + D
    return MotionUnderLoads(V[..., :3, :], _by_joint(_by_path(w, graph), graph) + Q, motions)


class NetworkModes(NamedTuple):
    """Natural frequencies (k,), rad/s, ascending, and modes (n, k) of unit modal mass.

    mass : (n, n), of the motions, tonne and mm; `motions.T @ mass @ motions` is 1.
    """

    frequencies: Array
    motions: Array
    mass: Array


class Dynamics(NamedTuple):
    """Dynamics of n motions of a network, of designs (...).

    compliance, mass : (..., n, n), of the motions: mm, rad, N, tonne.
    rank : of the compliance, the mobility; its other eigenvalues are round-off.
    """

    compliance: Array
    mass: Array
    rank: int

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (..., n), rad/s, ascending.

        They are infinite for freedoms that the joints do not have, and nan for a design without a
        solution.
        """
        L = np.linalg.cholesky(self.mass)
        A = np.swapaxes(L, -1, -2) @ self.compliance @ L
        is_singular = ~np.all(np.isfinite(A), axis=(-2, -1), keepdims=True)
        values = np.linalg.eigvalsh(np.where(is_singular, 0.0, (A + np.swapaxes(A, -1, -2)) / 2))[
            ..., ::-1
        ]
        is_rigid = (np.arange(values.shape[-1]) >= self.rank) | (values <= STILL * values[..., :1])
        frequencies = np.where(is_rigid, np.inf, 1 / np.sqrt(np.where(is_rigid, 1.0, values)))
        return np.where(is_singular[..., 0], np.nan, frequencies)

    @property
    def modes(self) -> NetworkModes:
        """The modes of one design with their frequencies; freedoms without one are left out."""
        L = np.linalg.cholesky(self.mass)
        A = L.T @ self.compliance @ L
        vectors = np.linalg.eigh((A + A.T) / 2)[1][:, ::-1]
        has_frequency = np.isfinite(self.frequencies)
        motions = np.linalg.solve(L.T, vectors[:, has_frequency])
        return NetworkModes(self.frequencies[has_frequency], motions, self.mass)


def with_springs(motions: Array, rates: Array) -> Array:
    """Return the motions (..., k, k) of k loads with springs along the lines of n more loads.

    Parameters
    ----------
    motions : (..., k + n, k + n), of all loads without springs, as from `solve`.
    rates : (n,), stiffness of the springs.
    """
    k = motions.shape[-1] - len(rates)
    root = np.sqrt(rates)
    coupling = motions[..., :k, k:] * root
    openings = root[:, None] * motions[..., k:, k:] * root
    forces = np.linalg.solve(np.eye(len(rates)) + openings, root[:, None] * motions[..., k:, :k])
    return np.asarray(motions[..., :k, :k] - coupling @ forces)


def _column(parts: Array) -> Array:
    """Stack parts (..., n, 3, k) in one column (..., 3 n, k)."""
    return parts.reshape(*parts.shape[:-3], 3 * parts.shape[-3], parts.shape[-1])


def _path_openings(openings: Array, graph: Topology) -> Array:
    """Openings (..., 3 P, k) of the paths from those (..., m, 3, k) of their joints."""
    flat = graph.signs @ openings.reshape(*openings.shape[:-2], -1)
    return _column(flat.reshape(*flat.shape[:-1], 3, -1))


def _by_path(w: Array, graph: Topology) -> Array:
    """Split one column (..., 3 P, k) of path wrenches into (..., P, 3, k)."""
    return w.reshape(*w.shape[:-2], len(graph.paths), 3, w.shape[-1])


def _by_joint(w: Array, graph: Topology) -> Array:
    """Wrenches (..., m, 3, k) in the joints from those (..., P, 3, k) of their paths."""
    path = np.argmax(np.abs(graph.signs), axis=0)
    signs = np.sum(graph.signs, axis=0)
    wrenches = np.moveaxis(
        np.take(np.moveaxis(w, (-2, -1), (0, 1)), path, axis=-1), (0, 1), (-2, -1)
    )
    return np.asarray(wrenches if np.all(signs == 1) else signs[:, None, None] * wrenches)


def block_diagonal(A: Array) -> Array:
    """Return the block diagonal matrix (..., 3 P, 3 P) of matrices (..., P, 3, 3)."""
    count = A.shape[-3]
    full = np.zeros((*A.shape[:-3], count, 3, count, 3))
    full[..., np.arange(count), :, np.arange(count), :] = np.moveaxis(A, -3, 0)
    return full.reshape(*A.shape[:-3], 3 * count, 3 * count)


def _path_stiffness(mechanism: Network, graph: Topology) -> Array:
    """Stiffness (..., 3 P, 3 P) of all paths; nan as in `stiffness`.

    It is found path by path where nothing couples them.
    """
    A = in_series(mechanism)
    if mechanism.coupling is None:
        return block_diagonal(inverse(A))
    S = np.kron(graph.signs[:, mechanism.coupled], np.eye(3))
    return inverse(block_diagonal(A) + S @ mechanism.coupling @ S.T)


def _opened(mechanism: Network, wrenches: Array) -> Array:
    """Openings (..., m, 3, k) of joints, and of elastic bodies at them, under wrenches.

    wrenches : (..., m, 3, k).
    """
    openings = mechanism.compliance @ wrenches
    if mechanism.coupling is None:
        return openings
    at = np.eye(len(mechanism.joints))[:, mechanism.coupled]
    of_bodies = mechanism.coupling @ _column(wrenches[..., mechanism.coupled, :, :])
    of_bodies = of_bodies.reshape(*of_bodies.shape[:-2], len(mechanism.coupled), 3, -1)
    return np.asarray(openings + np.einsum("mc,...cak->...mak", at, of_bodies))
