"""Curves of a drawing joined at their ends to a network of vertices and edges; mm.

Edges that are drawn more than once are one, and small gaps are closed."""

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
TOO_DENSE = (
    f"more than {MOST_PAIRS:,} pairs of curves over each other, expected the contours of a part"
)
AT_ONCE = 256  # points or boxes that are searched together, which limits the memory
ROUNDS = 3  # of closing gaps; an end that is moved to a line divides the line
NEAREST = 6  # open ends that are tried for each
LEAST_SINE = 0.05  # of the angle between two lines that may meet where they cross
BOX_POINTS = 9  # along a curve, for the box around it


class Edge(NamedTuple):
    """A line or arc between two vertices.

    curve : index of the curve that it is a part of.   times : number of curves that run along it.
    """

    segment: Segment
    start: int
    end: int
    curve: int
    times: int = 1

    def other_end(self, vertex: int) -> int:
        """Return the vertex at the other end."""
        return self.end if self.start == vertex else self.start


class CurveNetwork(NamedTuple):
    """Vertices (n,), complex, and edges between them.

    gaps : those that were closed, mm.   doubles : number of edges that were drawn again.
    """

    points: AnyArray
    edges: list[Edge]
    gaps: tuple[float, ...] = ()
    doubles: int = 0

    @property
    def shapes(self) -> Shapes:
        """Lines and arcs of the edges."""
        return Shapes([edge.segment for edge in self.edges])

    def degrees(self) -> AnyArray:
        """Number of edges (n,) at each vertex."""
        ends = [vertex for edge in self.edges for vertex in (edge.start, edge.end)]
        return np.bincount(ends, minlength=len(self.points))

    def edges_at(self) -> defaultdict[int, list[int]]:
        """Indices of the edges at each vertex."""
        found = defaultdict[int, list[int]](list)
        for k, edge in enumerate(self.edges):
            found[edge.start].append(k)
            found[edge.end].append(k)
        return found

    def without(self, removed: Iterable[int]) -> CurveNetwork:
        """Return the network without edges of some indices."""
        left_out = set(removed)
        kept = [edge for k, edge in enumerate(self.edges) if k not in left_out]
        return self._replace(edges=kept)


def connected(edges: Sequence[Edge], size: int) -> AnyArray:
    """Return the number (size,) of the connected part that each vertex is in."""
    return _parts(np.array([edge[1:3] for edge in edges], dtype=int).reshape(-1, 2), size)


def _parts(pairs: AnyArray, size: int) -> AnyArray:
    """Return the number (size,) of the part of each of `size` things that pairs (n, 2) connect."""
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    return np.asarray(connected_components(links, directed=False)[1])


class Shapes:
    """Lines and arcs as arrays, and a search tree of their boxes."""

    def __init__(self, segments: Sequence[Segment]) -> None:
        nowhere = complex(np.nan, np.nan)
        centres = [nowhere if each.centre is None else each.centre for each in segments]
        self.start = np.array([each.start for each in segments], dtype=complex)
        self.end = np.array([each.end for each in segments], dtype=complex)
        self.centre = np.array(centres, dtype=complex)
        self.curved = ~np.isnan(self.centre.real)
        with np.errstate(invalid="ignore", divide="ignore"):
            turn = np.angle((self.end - self.centre) / (self.start - self.centre))
        self.turn = np.where(self.curved, turn, 0.0)
        self.radius = np.abs(self.start - self.centre)
        chord = np.abs(self.end - self.start)
        self.length = np.where(self.curved, self.radius * np.abs(self.turn), chord)
        self.boxes = self._boxes()
        self.tree = shapely.STRtree(self.boxes)

    def _boxes(self) -> AnyArray:
        """Return a box around each line and arc."""
        sampled = self.at(np.arange(len(self.start)), np.linspace(0, 1, BOX_POINTS))
        rise = self.radius * (1 - np.cos(self.turn / (2 * BOX_POINTS - 2)))
        aside = np.where(self.curved, rise, 0.0)  # between two samples
        return np.asarray(
            shapely.box(
                sampled.real.min(axis=1) - aside,
                sampled.imag.min(axis=1) - aside,
                sampled.real.max(axis=1) + aside,
                sampled.imag.max(axis=1) + aside,
            )
        )

    def at(
        self,
        which: AnyArray,
        shares: Array,
    ) -> AnyArray:
        """Points (n, k) of n segments at shares (k,) of their lengths."""
        start = self.start[which, None]
        end = self.end[which, None]
        centre = np.where(self.curved, self.centre, 0.0)[which, None]
        bent = centre + (start - centre) * np.exp(1j * self.turn[which, None] * shares)
        straight = start + (end - start) * shares
        return np.asarray(np.where(self.curved[which, None], bent, straight))

    def projected(
        self,
        which: AnyArray,
        points: AnyArray,
    ) -> tuple[Array, Array]:
        """Shares (n,) of points (n,) projected on n segments, and distances (n,), mm.

        The distances are those from whole lines and circles.
        """
        start = self.start[which]
        end = self.end[which]
        centre = self.centre[which]
        turn = self.turn[which]
        curved = self.curved[which]
        with np.errstate(invalid="ignore", divide="ignore"):
            ahead = (points - start) / (end - start)
            swept = np.angle((points - centre) / (start - centre) * np.exp(-0.5j * turn))
            of_arcs = 0.5 + swept / turn
            off_arcs = np.abs(np.abs(points - centre) - self.radius[which])
        off_lines = np.abs(ahead.imag) * np.abs(end - start)
        return np.where(curved, of_arcs, ahead.real), np.where(curved, off_arcs, off_lines)

    def near(
        self,
        points: AnyArray,
        distance: float,
    ) -> tuple[AnyArray, AnyArray]:
        """Indices of points, and of segments whose boxes are within a distance of them."""
        dots = np.array([*map(shapely.Point, points.real, points.imag)], dtype=object)
        found = [np.empty((2, 0), dtype=int)]
        number = 0
        for first in range(0, len(dots), AT_ONCE):
            some = dots[first : first + AT_ONCE]
            pairs = self.tree.query(some, predicate="dwithin", distance=distance)
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
    """Join curves at their ends, and where an end lies on another curve.

    Gaps up to a tolerance, mm, are closed.
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
    drawn = [(owner, segment) for owner, curve in enumerate(curves) for segment in curve.segments]
    ends = np.array([(each.start, each.end) for _, each in drawn], dtype=complex).ravel()
    if not len(ends):
        return CurveNetwork(ends, [])
    points, vertices = _merged(ends)
    edges = list[Edge]()
    for (owner, segment), (start, end) in zip(drawn, vertices.reshape(-1, 2).tolist(), strict=True):
        if start != end:
            moved = with_ends(segment, complex(points[start]), complex(points[end]))
            edges.append(Edge(moved, start, end, owner))
    return CurveNetwork(points, edges)


def _merged(ends: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return places at which ends (n,) nearer than `SNAP` are one, and the place (n,) of each."""
    fine = np.round(_columns(ends) / (SNAP / 4))
    _, first, index = np.unique(
        fine,
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    places = ends[first]
    pairs = cKDTree(_columns(places)).query_pairs(SNAP, output_type="ndarray")
    labels = _parts(pairs, len(places))
    points = np.empty(int(labels.max()) + 1, dtype=complex)
    points[labels[::-1]] = places[::-1]  # the first of each part
    return points, labels[np.ravel(index)]


def _columns(points: AnyArray) -> Array:
    return np.column_stack([points.real, points.imag])


def _without_doubles(network: CurveNetwork) -> CurveNetwork:
    """Let edges between the same vertices that run along each other be one.

    It has the number of their curves.
    """
    between = defaultdict[tuple[int, int], list[Edge]](list)
    doubles = network.doubles
    for edge in network.edges:
        if edge.start == edge.end:
            continue
        alike = between[min(edge.start, edge.end), max(edge.start, edge.end)]
        double = _index_of_double(edge, alike)
        if double is None:
            alike.append(edge)
            continue
        other = alike[double]
        if edge.curve != other.curve:
            alike[double] = other._replace(times=other.times + edge.times)
        doubles += 1
    edges = [edge for alike in between.values() for edge in alike]
    return network._replace(edges=edges, doubles=doubles)


def _index_of_double(edge: Edge, alike: Sequence[Edge]) -> int | None:
    """Return which of the edges between the same vertices an edge runs along, None for none."""
    middle = complex(edge.segment.at(0.5))
    for k, other in enumerate(alike):
        if abs(complex(other.segment.at(0.5)) - middle) < SAME:
            return k
    return None


def _divided(network: CurveNetwork, distance: float) -> CurveNetwork:
    """Divide edges at vertices that lie within a distance of them."""
    if not network.edges:
        return network
    used = np.flatnonzero(network.degrees())
    shapes = network.shapes
    at, on = shapes.near(network.points[used], distance)
    vertices = used[at]
    shares, off = shapes.projected(on, network.points[vertices])
    length = shapes.length[on]
    inside = (off <= distance) & (shares * length > SNAP) & ((1 - shares) * length > SNAP)
    cuts = defaultdict[int, list[tuple[float, int]]](list)
    for k in np.flatnonzero(inside).tolist():
        cuts[int(on[k])].append((float(shares[k]), int(vertices[k])))
    edges = list[Edge]()
    for k, edge in enumerate(network.edges):
        if k in cuts:
            edges += _pieces(edge, [vertex for _, vertex in sorted(cuts[k])], network.points)
        else:
            edges.append(edge)
    return network._replace(edges=edges)


def _pieces(
    edge: Edge,
    between: Iterable[int],
    points: AnyArray,
) -> list[Edge]:
    """Return the parts of an edge that is divided at vertices in their order along it."""
    pieces = list[Edge]()
    start = edge.start
    inner = [vertex for vertex in between if vertex not in (edge.start, edge.end)]
    for end in (*inner, edge.end):
        if end != start:
            low = complex(points[start])
            high = complex(points[end])
            segment = with_ends(Segment(low, high, edge.segment.centre), low, high)
            pieces.append(
                edge._replace(
                    segment=segment,
                    start=start,
                    end=end,
                )
            )
            start = end
    return pieces


def _ends_joined(network: CurveNetwork, tolerance: float) -> CurveNetwork:
    """Join open ends with the nearest other open end, else with the nearest vertex.

    Only what is within a tolerance, mm, is joined.
    """
    degrees = network.degrees()
    open_ends = np.flatnonzero(degrees == 1)
    if not len(open_ends):
        return network
    edge_of = {vertex: edge for edge in network.edges for vertex in (edge.start, edge.end)}
    places = network.points.copy()
    moved = dict[int, int]()
    joined = set[int]()
    gaps = list(network.gaps)
    for gap, one, other in _nearest_pairs(network.points, open_ends, open_ends, tolerance):
        if one in joined or other in joined or edge_of[one] is edge_of[other]:
            continue
        places[other] = _corner(network.points, edge_of[one], one, edge_of[other], other)
        moved[one] = other
        joined |= {one, other}
        gaps.append(gap)
    left = np.array([vertex for vertex in open_ends.tolist() if vertex not in joined], dtype=int)
    used = np.flatnonzero(degrees > 1)
    for gap, one, other in _nearest_pairs(network.points, left, used, tolerance):
        if one not in moved and other not in (edge_of[one].start, edge_of[one].end):
            moved[one] = other
            gaps.append(gap)
    return _with_vertices(network._replace(points=places, gaps=tuple(gaps)), moved)


def _nearest_pairs(
    points: AnyArray, ones: AnyArray, others: AnyArray, most: float
) -> list[tuple[float, int, int]]:
    """Distances and pairs of vertices within `most` of each other, the nearest first."""
    if not len(ones) or not len(others):
        return []
    places = _columns(points)
    number = min(NEAREST, len(others))
    distances, found = cKDTree(places[others]).query(
        places[ones], k=number, distance_upper_bound=most
    )
    near = np.reshape(distances, (len(ones), -1))
    nearest = np.reshape(found, near.shape)
    pairs = list[tuple[float, int, int]]()
    for row, column in np.argwhere(np.isfinite(near)).tolist():
        one = int(ones[row])
        other = int(others[nearest[row, column]])
        if one != other:
            pairs.append((float(near[row, column]), one, other))
    return sorted(pairs)


def _corner(
    points: AnyArray,
    first: Edge,
    one: int,
    second: Edge,
    other: int,
) -> complex:
    """Point at which two edges meet, near the gap between their ends.

    It is where their lines cross if that is near, else the middle of the gap.
    """
    a = complex(points[one])
    b = complex(points[other])
    middle = (a + b) / 2
    if first.segment.centre is not None or second.segment.centre is not None:
        return middle
    u = first.segment.end - first.segment.start
    v = second.segment.end - second.segment.start
    area = (u.conjugate() * v).imag
    if abs(area) <= LEAST_SINE * abs(u) * abs(v):
        return middle
    crossing = a + u * ((b - a).conjugate() * v).imag / area
    return crossing if abs(crossing - middle) < 2 * abs(b - a) else middle


def _with_vertices(network: CurveNetwork, moved: dict[int, int]) -> CurveNetwork:
    """Return the network with vertices replaced by others.

    Its edges are between the places of their vertices.
    """
    edges = list[Edge]()
    for edge in network.edges:
        start = moved.get(edge.start, edge.start)
        end = moved.get(edge.end, edge.end)
        if start == end:
            continue
        segment = edge.segment
        a = complex(network.points[start])
        b = complex(network.points[end])
        if a != segment.start or b != segment.end:
            segment = with_ends(segment, a, b)
        edges.append(Edge(segment, start, end, edge.curve, edge.times))
    return network._replace(edges=edges)


class _Foot(NamedTuple):
    """Where an open end lies beside an edge: its distance, mm, the edge and the share of it."""

    gap: float
    edge: int
    share: float


def _ends_on_lines(network: CurveNetwork, tolerance: float) -> CurveNetwork:
    """Move open ends onto the nearest other edge within a tolerance, and divide it there."""
    feet = _feet_of_ends(network, tolerance)
    if not feet:
        return network
    points = network.points.copy()
    for vertex, foot in feet.items():
        points[vertex] = complex(network.edges[foot.edge].segment.at(foot.share))
    moved = _with_vertices(network._replace(points=points), {})
    gaps = (*network.gaps, *(foot.gap for foot in feet.values()))
    return _divided(moved._replace(gaps=gaps), SNAP)


def _feet_of_ends(network: CurveNetwork, tolerance: float) -> dict[int, _Foot]:
    """Return, by open end, the nearest place on another edge within a tolerance."""
    open_ends = np.flatnonzero(network.degrees() == 1)
    if not len(open_ends):
        return {}
    shapes = network.shapes
    which, on = shapes.near(network.points[open_ends], tolerance)
    vertices = open_ends[which]
    ends = np.array([edge[1:3] for edge in network.edges])
    is_other = np.all(ends[on] != vertices[:, None], axis=1)
    vertices = vertices[is_other]
    on = on[is_other]
    shares, off = shapes.projected(on, network.points[vertices])
    feet = dict[int, _Foot]()
    for k in np.flatnonzero((off <= tolerance) & (shares > 0) & (shares < 1)).tolist():
        vertex = int(vertices[k])
        foot = _Foot(float(off[k]), int(on[k]), float(shares[k]))
        if vertex not in feet or foot.gap < feet[vertex].gap:
            feet[vertex] = foot
    return feet
