"""Where linear limits on x let G x go, exactly: a polytope in up to three dimensions, found by linear programs alone.

The convex hull of points that programs found lies within the polytope, and the planes that programs found hold it in:
once every plane of the hull is one of these, both are the same. Each plane's multipliers say which limits bound it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.refused import ComputationFailed

EXACT = 1e-9  # of limits and of the largest coordinate: what programs may break them by, and hulls may miss
FLAT = 1e-7  # of the largest coordinate: a set no wider in some direction has no extent in it
MULTIPLIER = 1e-6  # of the largest: a limit with a smaller multiplier does not bind
ASKED = 12  # decimals of a direction, largest part one, by which it is known when it is asked for again
MOST = 200  # rounds of refinement; the shipped stages take six


class NothingAllowed(Exception):  # noqa: N818
    """No x keeps all limits."""


class LinearLimits(NamedTuple):
    """Limits (k) on x (m,): rows @ x <= bounds, each by the index (k,) of its name; those on x alone come first."""

    rows: Array
    bounds: Array
    owner: Index
    names: tuple[str, ...]


class Extreme(NamedTuple):
    """The x (m,) that goes farthest in a direction, and the names of the limits that stop it."""

    x: Array
    by: tuple[str, ...]


class Programs:
    """max c @ x under limits, with `fixed @ x = at`, for one c after another.

    LinearLimits are taken in once they are broken, and stay: of the many on stresses, few ever are.
    """

    def __init__(self, limits: LinearLimits, unit: Array, fixed: Array | None = None, at: Array | None = None) -> None:
        """`unit` (m,): size of x; the limits on x alone are the first 2 m; fixed @ x of the order of one."""
        rows = limits.rows * unit
        size = np.max(np.abs(rows), axis=1)
        size[size == 0] = np.maximum(np.abs(limits.bounds[size == 0]), 1.0)
        self.limits, self.unit = limits, unit
        self.rows, self.bounds = rows / size[:, None], limits.bounds / size
        self.taken = np.arange(len(rows)) < 2 * len(unit)
        self.equal: dict[str, Array] = {}
        self._known: dict[tuple[float, ...], Extreme] = {}
        if fixed is not None and at is not None and len(fixed):
            self.equal = {"A_eq": fixed * unit, "b_eq": at}

    def farthest(self, c: Array) -> Extreme:
        """The x that makes c (m,) @ x largest. Raises NothingAllowed."""
        cost = c * self.unit
        cost = cost / (np.max(np.abs(cost)) or 1.0)
        asked = tuple(np.round(cost, ASKED) + 0.0)
        if asked not in self._known:
            self._known[asked] = self._extreme(cost)
        return self._known[asked]

    def _extreme(self, cost: Array) -> Extreme:
        while True:
            found = self._solve(-cost)
            broken = self.rows @ found.x - self.bounds
            broken[self.taken] = 0.0
            if not np.any(broken > EXACT):
                break
            worst = np.argsort(broken)[-2 * len(cost) :]
            self.taken[worst[broken[worst] > EXACT]] = True
        multipliers = -found.ineqlin.marginals
        binding = np.flatnonzero(self.taken)[multipliers > MULTIPLIER * max(np.max(multipliers), MULTIPLIER)]
        owners = dict.fromkeys(self.limits.owner[binding].tolist())
        return Extreme(found.x * self.unit, tuple(self.limits.names[k] for k in sorted(owners)))

    def _solve(self, cost: Array) -> Any:
        from scipy.optimize import linprog

        found = linprog(
            cost,
            A_ub=self.rows[self.taken],
            b_ub=self.bounds[self.taken],
            **self.equal,
            bounds=(None, None),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if found.status == 2:
            raise NothingAllowed
        if found.status != 0:
            raise ComputationFailed(f"linear program for the poses of a drive: {found.message}")
        return found


class Polytope(NamedTuple):
    """All y = G x (d,) that limits allow; coordinates comparable in size.

    dimension : of the set, 0 a point to 3 a solid.   vertices : (v, d).   commands : (v, m), an x for each.
    normals, supports : (f, d), (f,): normal @ y <= support on every face, normals within the set's own space.
    faces : of each its vertices, in 3-D around it, counter-clockwise seen from outside.   by : of each the limits.
    volume : of the set in its own dimension: volume, area, length, 1.
    """

    dimension: int
    vertices: Array
    commands: Array
    normals: Array
    supports: Array
    faces: tuple[tuple[int, ...], ...]
    by: tuple[tuple[str, ...], ...]
    volume: float


def image(programs: Programs, G: Array) -> Polytope:
    """The set of all G x, G (d, m), d up to 3 and G x of the order of one. Raises NothingAllowed."""
    commands, span = _spanned(programs, G)
    k = span.shape[1]
    if k == 0:
        none = np.zeros((0, len(G)))
        return Polytope(0, commands[:1] @ G.T, commands[:1], none, np.zeros(0), (), (), 1.0)
    if k > 1:
        commands = _refined(programs, span.T @ G, commands)
    vertices, faces, volume = _combinatorics(commands @ G.T @ span)
    commands = commands[vertices]
    Z = commands @ G.T @ span
    normals = np.array([_normal(Z[list(face)], np.mean(Z, axis=0)) for face in faces])
    by = tuple(programs.farthest(n @ span.T @ G).by for n in normals)
    around = tuple(_around(Z, face, n) if k == 3 else face for face, n in zip(faces, normals, strict=True))
    Y = commands @ G.T
    supports = np.array([np.max(Y @ span @ n) for n in normals])
    return Polytope(k, Y, commands, normals @ span.T, supports, around, by, volume)


def _spanned(programs: Programs, G: Array) -> tuple[Array, Array]:
    """Commands whose images span the set, and an orthonormal basis (d, k) of the directions in which it extends."""
    found, span, left = list[Array](), np.zeros((len(G), 0)), np.eye(len(G))
    while left.shape[1]:
        w = left[:, 0]
        far, near = (programs.farthest(sign * w @ G).x for sign in (1.0, -1.0))
        found += [far, near]
        along = left @ left.T @ G @ (far - near)
        wide = w @ along > FLAT
        new = along / np.linalg.norm(along) if wide else w
        span = np.column_stack([span, new]) if wide else span
        left = np.linalg.svd((np.eye(len(G)) - np.outer(new, new)) @ left, full_matrices=False)[0][:, :-1]
    return np.array(found), span


def _refined(programs: Programs, G: Array, commands: Array) -> Array:
    """Commands whose images' convex hull is the set: farthest ones along the hull's planes, until none is farther."""
    from scipy.spatial import ConvexHull

    known = set[tuple[float, ...]]()
    for _ in range(MOST):
        Z = commands @ G.T
        planes = {tuple(np.round(plane[:-1], 10) + 0.0): plane for plane in ConvexHull(Z).equations}
        fresh = [plane for key, plane in planes.items() if key not in known]
        known |= planes.keys()
        farthest = [programs.farthest(plane[:-1] @ G).x for plane in fresh]
        beyond = [x for x, plane in zip(farthest, fresh, strict=True) if plane[:-1] @ G @ x + plane[-1] > EXACT]
        if not beyond:
            return commands
        commands = np.concatenate([commands, beyond])
    raise ComputationFailed(f"the poses of the drive have not been enclosed after {MOST} rounds of linear programs")


def _combinatorics(Z: Array) -> tuple[Index, list[tuple[int, ...]], float]:
    """Of the hull of points (p, k): the indices of its vertices, which of these each face has, and its volume."""
    from scipy.spatial import ConvexHull

    if Z.shape[1] == 1:
        ends = np.array([np.argmin(Z), np.argmax(Z)])
        return ends, [(0,), (1,)], float(np.ptp(Z))
    hull, k = ConvexHull(Z), Z.shape[1]
    touches = np.abs(Z @ hull.equations[:, :-1].T + hull.equations[:, -1]) < 10 * EXACT
    corner = np.array([_rank(hull.equations[row, :-1]) == k for row in touches])
    index = np.flatnonzero(corner)
    index = index[[not np.any(np.max(np.abs(Z[index[:i]] - Z[j]), axis=1) < 10 * EXACT) for i, j in enumerate(index)]]
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in touches[index].T}
    full = [s for s in sets if len(s) >= k and _rank(Z[index[list(s)]] - np.mean(Z[index[list(s)]], axis=0)) == k - 1]
    faces = [tuple(sorted(s)) for s in full if not any(s < other for other in full)]
    return index, sorted(faces), float(hull.volume)


def _rank(vectors: Array) -> int:
    """Of vectors (n, k), less what round-off makes of them."""
    return int(np.linalg.matrix_rank(vectors, tol=FLAT)) if len(vectors) else 0


def _normal(points: Array, inside: Array) -> Array:
    """Outward unit normal (k,) of the plane through points (n, k)."""
    middle = np.mean(points, axis=0)
    normal = np.linalg.svd(points - middle)[2][-1]
    return np.asarray(normal * np.sign(normal @ (middle - inside)))


def _around(Z: Array, face: tuple[int, ...], normal: Array) -> tuple[int, ...]:
    """The vertices of a face, counter-clockwise about its outward normal (3,)."""
    points = Z[list(face)] - np.mean(Z[list(face)], axis=0)
    first = points[0] / np.linalg.norm(points[0])
    angles = np.arctan2(points @ np.cross(normal, first), points @ first)
    return tuple(face[i] for i in np.argsort(angles))
