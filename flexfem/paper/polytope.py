"""The polytope of all poses that a driven stage reaches within its limits.

It contains the convex hull of vertices found by linear programs, and the supporting planes of these
programs bound it. Once every plane of the hull is a supporting plane, hull and polytope are
identical."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.questions.poses import EXACT, ROUND_OFF, LimitNames, PoseSet

# of the largest coordinate: smallest width of a set in a direction that counts as an extent
FLAT = 1e-7
# vertices: curved yield limits would give many thousands; shipped stages have at most 64
MOST = 300


class PoseEdge(NamedTuple):
    """An edge of the section at theta = 0, from (x, y) to (x, y), mm, and the limits that bound it."""

    start: Array
    end: Array
    by: LimitNames


class Polytope(NamedTuple):
    """All poses y = (x, y, lever theta), mm, within the limits.

    A set that is no solid has no vertices and faces.

    dimension : 0 to 3.   vertices : (v, 3), mm, mm, rad.   commands : (v, m), of the vertices.
    normals, supports : (f, 3), (f,), mm: normal @ y <= support on every face.
    faces : vertices of each face, counter-clockwise seen from outside.
    by : limits that bound each face.   volume : mm^2 rad.
    missed : largest distance of a pose outside the faces over the largest coordinate; 0 below
    `MOST` vertices.
    """

    dimension: int
    vertices: Array
    commands: Array
    normals: Array
    supports: Array
    faces: list[list[int]]
    by: list[LimitNames]
    volume: float
    missed: float = 0.0

    @property
    def section(self) -> list[PoseEdge]:
        """Edges of the poses at theta = 0, counter-clockwise."""
        edges = list[PoseEdge]()
        for normal, support, by in zip(self.normals, self.supports, self.by, strict=True):
            ends = self._clipped(normal[:2], support)
            if ends is not None:
                edges.append(PoseEdge(*ends, by))
        return sorted(edges, key=lambda edge: float(np.arctan2(*(edge.end - edge.start)[::-1])))

    def _clipped(
        self,
        normal: Array,
        support: float,
    ) -> tuple[Array, Array] | None:
        """Return both ends of the line normal @ (x, y) = support within all faces, None outside."""
        length = np.linalg.norm(normal)
        if length < FLAT:
            return None
        size = np.max(np.abs(self.supports), initial=0.0)
        along = np.array([-normal[1], normal[0]]) / length
        foot = support * normal / length**2
        rate = self.normals[:, :2] @ along
        slack = self.supports - self.normals[:, :2] @ foot  # rate t <= slack at foot + t along
        falling = rate <= -FLAT
        rising = rate >= FLAT
        start = np.max(slack[falling] / rate[falling], initial=-np.inf)
        end = np.min(slack[rising] / rate[rising], initial=np.inf)
        inside = np.all(slack[np.abs(rate) < FLAT] >= -EXACT * size)
        if not inside or end - start <= ROUND_OFF * size:
            return None
        return foot + start * along, foot + end * along

    def radius(
        self,
        centre: Array,
        directions: int,
    ) -> float:
        """Return the distance of a point (3,) from the faces in the first directions, mm.

        It is 0 for a point that is not inside.
        """
        if not self.faces:
            return 0.0
        tilt = np.maximum(np.linalg.norm(self.normals[:, :directions], axis=1), FLAT)
        distance = float(np.min((self.supports - self.normals @ centre) / tilt))
        return distance if distance > ROUND_OFF * np.max(np.abs(self.supports)) else 0.0


def polytope_of(poses: PoseSet, lever: float) -> Polytope:
    """Return the polytope of all poses. Raises NothingAllowed."""
    scale = np.array([1.0, 1.0, lever])
    size = float(np.max(scale * poses.extent)) or 1.0
    G = scale[:, None] * poses.G / size
    commands, dimension = _spanning(poses, G)
    if dimension < 3:
        nothing = np.zeros((0, 3))
        return Polytope(dimension, nothing, commands[:0], nothing, np.zeros(0), [], [], 0.0)
    commands, missed = _refined(poses, G, commands)
    rounded = np.round(_relative(commands @ poses.G.T + poses.rest), 6)
    commands = commands[np.lexsort(rounded.T)]  # an order that does not depend on round-off
    hull = _hull(commands @ G.T)
    commands = commands[hull.corners]
    Z = commands @ G.T
    normals = np.array([_outward_normal(Z, face) for face in hull.faces])
    faces = [_in_order(Z, face, normal) for face, normal in zip(hull.faces, normals, strict=True)]
    supports = np.max(normals @ Z.T, axis=1) * size + normals @ (scale * poses.rest)
    return Polytope(
        3,
        commands @ poses.G.T + poses.rest,
        commands,
        normals,
        supports,
        faces,
        poses.maximised(normals @ G)[1],
        hull.volume * size**3 / lever,
        missed,
    )


def _relative(vertices: Array) -> Array:
    return np.asarray(vertices / np.max(np.abs(vertices), axis=0))


def _outward_normal(Z: Array, face: list[int]) -> Array:
    """Return the unit normal (3,) of a face of points (v, 3)."""
    middle = np.mean(Z[face], axis=0)
    normal = np.linalg.svd(Z[face] - middle)[2][-1]
    return np.asarray(normal * np.sign(normal @ np.mean(Z[face] - np.mean(Z, axis=0), axis=0)))


def _in_order(
    Z: Array,
    face: list[int],
    normal: Array,
) -> list[int]:
    """Return the vertices of a face counter-clockwise, seen from outside."""
    arms = Z[face] - np.mean(Z[face], axis=0)
    angles = np.arctan2(arms @ np.cross(normal, arms[0]), arms @ arms[0])
    return [face[k] for k in np.argsort(angles)]


def _spanning(poses: PoseSet, G: Array) -> tuple[Array, int]:
    """Return commands whose images under G (3, m) span the set, and its dimension."""
    X = poses.maximised(G[:1])[0]
    dimension = -1
    while True:
        _, values, axes = np.linalg.svd((X - X[0]) @ G.T)
        previous = dimension
        dimension = int(np.count_nonzero(values > FLAT))
        if dimension in (previous, 3):
            return X, dimension
        missing = np.concatenate([axes[dimension:], -axes[dimension:]])
        X = np.concatenate([X, poses.maximised(missing @ G)[0]])


def _refined(
    poses: PoseSet,
    G: Array,
    commands: Array,
) -> tuple[Array, float]:
    """Add commands until the hull of their images is the set.

    Returns them and the largest distance of a pose outside, over the largest coordinate.
    """
    from scipy.spatial import ConvexHull

    while True:
        planes = ConvexHull(commands @ G.T).equations
        distinct = np.unique(np.round(planes, 10), axis=0, return_index=True)[1]
        planes = planes[distinct]  # one of coplanar triangles
        X = poses.maximised(planes[:, :3] @ G)[0]
        excess = np.sum(planes[:, :3] * (X @ G.T), axis=1) + planes[:, 3]
        if np.max(excess) <= EXACT:
            return commands, 0.0
        if len(commands) >= MOST:
            return commands, float(np.max(excess) / np.max(np.abs(commands @ G.T)))
        outside = np.argsort(-excess, kind="stable")[: np.count_nonzero(excess > EXACT)]
        commands = np.concatenate([commands, X[outside][: MOST - len(commands)]])


class _Hull(NamedTuple):
    """The convex hull of points: numbers of its vertices, positions of each face in them, volume."""

    corners: Index
    faces: list[list[int]]
    volume: float


def _hull(Z: Array) -> _Hull:
    """Return the hull of points (p, 3), without coplanar triangles and coincident vertices."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(Z)
    normals = hull.equations[:, :3]
    on_face = np.abs(Z @ normals.T + hull.equations[:, 3]) < 10 * EXACT
    ranks = np.array([np.linalg.matrix_rank(normals[row], tol=FLAT) for row in on_face])
    corners = np.flatnonzero(ranks == 3)
    coincident = np.max(np.abs(Z[corners][:, None] - Z[corners]), axis=2) < 10 * EXACT
    corners = corners[~np.any(np.tril(coincident, -1), axis=1)]
    sets = {frozenset(np.flatnonzero(column).tolist()) for column in on_face[corners].T}
    whole = [face for face in sets if not any(face < other for other in sets)]
    return _Hull(corners, sorted(sorted(face) for face in whole), float(hull.volume))
