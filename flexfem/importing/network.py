"""Curves of a drawing joined at their ends: vertices and edges, without doubles, with small gaps
closed; mm.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from flexfem.arrays import AnyArray, Array
from flexfem.importing.curves import DrawnCurve, with_ends
from flexfem.mechanism.outlines import Segment
from flexfem.refused import BadInput

SNAP = 1e-4  # mm; ends at a smaller distance are one point: programs round coordinates
SAME = 5e-4  # mm; two edges between the same vertices with middles at a smaller distance are one
MOST_PAIRS = 3_000_000  # of curves or points whose boxes overlap
AT_ONCE = 256  # points or boxes that are searched together, which limits the memory
TOO_DENSE = (
    f"more than {MOST_PAIRS:,} pairs of curves over each other, expected the contours of a part"
)
ROUNDS = 3  # of closing gaps; an end that is moved to a line divides the line
NEAREST = 6  # open ends that are tried for each


class Edge(NamedTuple):
    """A line or arc between two vertices.

    curve : index of the curve that it is a part of.   times : number of curves that run along it.
    """

    segment: Segment
    start: int
    end: int
    curve: int
    times: int = 1


class CurveNetwork(NamedTuple):
    """Vertices (n,), complex, and edges between them; `gaps` that were closed, mm, and the number
    of `doubles`.
    """

    points: AnyArray
    edges: list[Edge]
    gaps: tuple[float, ...] = ()
    doubles: int = 0

    def degrees(self) -> AnyArray:
        """Number of edges (n,) at each vertex."""
        return np.bincount(
            [v for edge in self.edges for v in (edge.start, edge.end)], minlength=len(self.points)
        )


class Shapes:
    """Lines and arcs as arrays, and a search tree of their boxes."""

    def __init__(self, segments: Sequence[Segment]) -> None:
        nowhere = complex(np.nan, np.nan)
        self.start = np.array([each.start for each in segments], dtype=complex)
        self.end = np.array([each.end for each in segments], dtype=complex)
        self.centre = np.array(
            [nowhere if each.centre is None else each.centre for each in segments], dtype=complex
        )
        self.curved = ~np.isnan(self.centre.real)
        with np.errstate(invalid="ignore", divide="ignore"):
            self.turn = np.where(
                self.curved, np.angle((self.end - self.centre) / (self.start - self.centre)), 0.0
            )
        self.radius = np.abs(self.start - self.centre)
        self.length = np.where(
            self.curved, self.radius * np.abs(self.turn), np.abs(self.end - self.start)
        )
        sampled = self.at(np.arange(len(segments)), np.linspace(0, 1, 9))
        aside = np.where(
            self.curved, self.radius * (1 - np.cos(self.turn / 16)), 0.0
        )  # between two samples
        low = sampled.real.min(axis=1) - aside, sampled.imag.min(axis=1) - aside
        high = sampled.real.max(axis=1) + aside, sampled.imag.max(axis=1) + aside
        self.boxes = shapely.box(*low, *high)
        self.tree = shapely.STRtree(self.boxes)

    def at(self, which: AnyArray, shares: Array) -> AnyArray:
        """Points (n, k) of n segments at shares (k,) of their lengths."""
        start = self.start[which, None]
        end = self.end[which, None]
        centre = np.where(self.curved, self.centre, 0.0)[which, None]
        bent = centre + (start - centre) * np.exp(1j * self.turn[which, None] * shares)
        return np.asarray(np.where(self.curved[which, None], bent, start + (end - start) * shares))

    def projected(self, which: AnyArray, points: AnyArray) -> tuple[Array, Array]:
        """Shares (n,) of points (n,) projected on n segments, and distances (n,) from lines and
        circles, mm.
        """
        start = self.start[which]
        end = self.end[which]
        centre = self.centre[which]
        with np.errstate(invalid="ignore", divide="ignore"):
            ahead = (points - start) / (end - start)
            turn = self.turn[which]
            swept = np.angle((points - centre) / (start - centre) * np.exp(-0.5j * turn))
            of_arcs = 0.5 + swept / turn
            off_arcs = np.abs(np.abs(points - centre) - self.radius[which])
        curved = self.curved[which]
        off = np.where(curved, off_arcs, np.abs(ahead.imag) * np.abs(end - start))
        return np.where(curved, of_arcs, ahead.real), off

    def near(self, points: AnyArray, distance: float) -> tuple[AnyArray, AnyArray]:
        """Indices of points, and of segments whose boxes are within a distance of them."""
        at = np.array([*map(shapely.Point, points.real, points.imag)], dtype=object)
        found = [np.empty((2, 0), dtype=int)]
        number = 0
        for first in range(0, len(at), AT_ONCE):
            pairs = self.tree.query(
                at[first : first + AT_ONCE], predicate="dwithin", distance=distance
            )
            number += pairs.shape[1]
            if number > MOST_PAIRS:
                raise BadInput(TOO_DENSE)
            found.append(np.stack([pairs[0] + first, pairs[1]]))
        near = np.concatenate(found, axis=1)
        return near[0], near[1]

    def overlapping(self) -> AnyArray:
        """Pairs (2, n) of segments whose boxes overlap, each once."""
        found = [np.empty((2, 0), dtype=int)]
        number = 0
        for first in range(0, len(self.boxes), AT_ONCE):
            one, other = self.tree.query(self.boxes[first : first + AT_ONCE])
            pairs = np.stack([one + first, other])[:, one + first < other]
            number += pairs.shape[1]
            if number > MOST_PAIRS:
                raise BadInput(TOO_DENSE)
            found.append(pairs)
        return np.concatenate(found, axis=1)


def network_of(curves: Sequence[DrawnCurve], tolerance: float) -> CurveNetwork:
    """Join curves at their ends and where an end lies on another curve; gaps up to a tolerance, mm,
    are closed.
    """
    network = _without_doubles(_divided(_snapped(curves), SNAP))
    for _ in range(ROUNDS):
        before = len(network.gaps)
        network = _without_doubles(_divided(_ends_joined(network, tolerance), SNAP))
        network = _without_doubles(_ends_on_lines(network, tolerance))
        if len(network.gaps) == before:
            break
    return network


def _snapped(curves: Sequence[DrawnCurve]) -> CurveNetwork:
    """Let ends at distances below `SNAP` be one vertex; edges without length are left out."""
    segments = [segment for curve in curves for segment in curve.segments]
    owners = [k for k, curve in enumerate(curves) for _ in curve.segments]
    ends = np.array([(segment.start, segment.end) for segment in segments], dtype=complex).ravel()
    if not len(ends):
        return CurveNetwork(ends, [])
    fine = np.round(np.column_stack([ends.real, ends.imag]) / (SNAP / 4))
    _, first, index = np.unique(fine, axis=0, return_index=True, return_inverse=True)
    places = ends[first]
    pairs = cKDTree(np.column_stack([places.real, places.imag])).query_pairs(
        SNAP, output_type="ndarray"
    )
    links = coo_matrix(
        (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(places), len(places))
    )
    number, labels = connected_components(links, directed=False)
    points = np.empty(number, dtype=complex)
    points[labels[::-1]] = places[::-1]
    vertices = labels[np.ravel(index)].reshape(-1, 2).tolist()
    edges = list[Edge]()
    for segment, owner, (start, end) in zip(segments, owners, vertices, strict=True):
        if start != end:
            edges.append(
                Edge(
                    with_ends(segment, complex(points[start]), complex(points[end])),
                    start,
                    end,
                    owner,
                )
            )
    return CurveNetwork(points, edges)


def _without_doubles(network: CurveNetwork) -> CurveNetwork:
    """Let edges between the same vertices that run along each other be one, with the number of
    their curves.
    """
    between = defaultdict[tuple[int, int], list[Edge]](list)
    doubles = network.doubles
    for edge in network.edges:
        if edge.start == edge.end:
            continue
        alike = between[min(edge.start, edge.end), max(edge.start, edge.end)]
        middle = complex(edge.segment.at(0.5))
        for k, other in enumerate(alike):
            if abs(complex(other.segment.at(0.5)) - middle) < SAME:
                alike[k] = other._replace(
                    times=other.times + (edge.curve != other.curve) * edge.times
                )
                doubles += 1
                break
        else:
            alike.append(edge)
    edges = [edge for alike in between.values() for edge in alike]
    return network._replace(edges=edges, doubles=doubles)


def _divided(network: CurveNetwork, distance: float) -> CurveNetwork:
    """Divide edges at vertices that lie on them."""
    if not network.edges:
        return network
    used = np.flatnonzero(network.degrees())
    at, on = Shapes([edge.segment for edge in network.edges]).near(network.points[used], distance)
    return _divided_at(network, used[at], on, distance)


def _divided_at(
    network: CurveNetwork, vertices: AnyArray, on: AnyArray, distance: float
) -> CurveNetwork:
    """Divide edges `on` at vertices of which they are no ends, if these lie within a distance of
    them.
    """
    shapes = Shapes([edge.segment for edge in network.edges])
    points = network.points[vertices]
    shares, off = shapes.projected(on, points)
    length = shapes.length[on]
    inside = (off <= distance) & (shares * length > SNAP) & ((1 - shares) * length > SNAP)
    cuts = defaultdict[int, list[tuple[float, int]]](list)
    for edge, vertex, share in zip(
        on[inside].tolist(), vertices[inside].tolist(), shares[inside].tolist(), strict=True
    ):
        cuts[edge].append((share, vertex))
    edges = list[Edge]()
    for k, edge in enumerate(network.edges):
        if k in cuts:
            edges += _pieces(edge, [vertex for _, vertex in sorted(cuts[k])], network.points)
        else:
            edges.append(edge)
    return network._replace(edges=edges)


def _pieces(edge: Edge, between: Iterable[int], points: AnyArray) -> list[Edge]:
    """Return the parts of an edge that is divided at vertices in their order along it."""
    pieces = list[Edge]()
    start = edge.start
    for end in (*(v for v in between if v not in (edge.start, edge.end)), edge.end):
        if end != start:
            segment = Segment(complex(points[start]), complex(points[end]), edge.segment.centre)
            pieces.append(
                edge._replace(segment=with_ends(segment, *segment[:2]), start=start, end=end)
            )
            start = end
    return pieces


def _ends_joined(network: CurveNetwork, tolerance: float) -> CurveNetwork:
    """Join open ends with the nearest other open end, else with the nearest vertex, within a
    tolerance.
    """
    open_ends = np.flatnonzero(network.degrees() == 1)
    if len(open_ends) < 1:
        return network
    at = {v: edge for edge in network.edges for v in (edge.start, edge.end)}
    places = network.points.copy()
    moved = dict[int, int]()
    gaps = list(network.gaps)
    for gap, one, other in _nearest_pairs(network.points, open_ends, open_ends, tolerance):
        if (
            {one, other} & moved.keys()
            or other in moved.values()
            or one in moved.values()
            or at[one] is at[other]
        ):
            continue
        places[other] = _corner(network.points, at[one], one, at[other], other)
        moved[one] = other
        gaps.append(gap)
    used = np.flatnonzero(network.degrees() > 1)
    left = np.array(
        [v for v in open_ends.tolist() if v not in moved and v not in moved.values()], dtype=int
    )
    for gap, one, other in _nearest_pairs(network.points, left, used, tolerance):
        if one not in moved and other not in (at[one].start, at[one].end):
            moved[one] = other
            gaps.append(gap)
    return _with_vertices(network._replace(points=places, gaps=tuple(gaps)), moved)


def _nearest_pairs(
    points: AnyArray, ones: AnyArray, others: AnyArray, most: float
) -> list[tuple[float, int, int]]:
    """Distances and pairs of vertices within `most` of each other, the nearest first."""
    if not len(ones) or not len(others):
        return []
    xy = np.column_stack([points.real, points.imag])
    distances, found = cKDTree(xy[others]).query(
        xy[ones], k=min(NEAREST, len(others)), distance_upper_bound=most
    )
    pairs = list[tuple[float, int, int]]()
    near = np.reshape(distances, (len(ones), -1))
    for row, column in np.argwhere(np.isfinite(near)).tolist():
        one = int(ones[row])
        other = int(others[np.reshape(found, near.shape)[row, column]])
        if one != other:
            pairs.append((float(near[row, column]), one, other))
    return sorted(pairs)


def _corner(points: AnyArray, first: Edge, one: int, second: Edge, other: int) -> complex:
    """Point at which two edges meet: where their lines cross if that is near, else the middle of
    the gap.
    """
    a = complex(points[one])
    b = complex(points[other])
    middle = (a + b) / 2
    if first.segment.centre is None and second.segment.centre is None:
        u = first.segment.end - first.segment.start
        v = second.segment.end - second.segment.start
        area = (u.conjugate() * v).imag
        if abs(area) > 0.05 * abs(u) * abs(v):
            crossing = a + u * ((b - a).conjugate() * v).imag / area
            if abs(crossing - middle) < 2 * abs(b - a):
                return crossing
    return middle


def _with_vertices(network: CurveNetwork, moved: dict[int, int]) -> CurveNetwork:
    """Return the network with vertices replaced by others, and its edges between the places of
    their vertices.
    """
    edges = list[Edge]()
    for edge in network.edges:
        start = moved.get(edge.start, edge.start)
        end = moved.get(edge.end, edge.end)
        if start == end:
            continue
        a = complex(network.points[start])
        b = complex(network.points[end])
        same = a == edge.segment.start and b == edge.segment.end
        edges.append(
            Edge(
                edge.segment if same else with_ends(edge.segment, a, b),
                start,
                end,
                edge.curve,
                edge.times,
            )
        )
    return network._replace(edges=edges)


def _ends_on_lines(network: CurveNetwork, tolerance: float) -> CurveNetwork:
    """Move open ends onto the nearest other edge within a tolerance, and divide it there."""
    open_ends = np.flatnonzero(network.degrees() == 1)
    if not len(open_ends):
        return network
    shapes = Shapes([edge.segment for edge in network.edges])
    which, on = shapes.near(network.points[open_ends], tolerance)
    vertices = open_ends[which]
    own = np.array(
        [v in network.edges[k][1:3] for v, k in zip(vertices.tolist(), on.tolist(), strict=True)],
        dtype=bool,
    )
    vertices = vertices[~own]
    on = on[~own]
    shares, off = shapes.projected(on, network.points[vertices])
    within = (off <= tolerance) & (shares > 0) & (shares < 1)
    nearest = dict[int, tuple[float, int, float]]()
    for v, edge, share, gap in zip(
        *(part[within].tolist() for part in (vertices, on, shares, off)), strict=True
    ):
        if v not in nearest or gap < nearest[v][0]:
            nearest[v] = (gap, edge, share)
    if not nearest:
        return network
    points = network.points.copy()
    for v, (_, edge, share) in nearest.items():
        points[v] = complex(network.edges[edge].segment.at(share))
    moved = _with_vertices(network._replace(points=points), {})
    gaps = (*network.gaps, *(gap for gap, _, _ in nearest.values()))
    return _divided(moved._replace(gaps=gaps), SNAP)
