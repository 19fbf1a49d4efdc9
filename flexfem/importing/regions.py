"""Metal and voids between the joined curves of a drawing: closed contours, parts, and what is wrong
with them; mm.
"""

from __future__ import annotations

import cmath
from collections import Counter, defaultdict, deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import AnyArray, Array
from flexfem.importing.network import SNAP, CurveNetwork, Edge, Shapes
from flexfem.mechanism.outlines import Segment, area
from flexfem.refused import BadInput

FLATNESS = 1e-4  # mm; of polygons in which points are looked up
DOUBLED = 1e-3  # weight of a line that two curves share, among lines that may divide metal
TIME_LIMIT = 10.0  # s, for the choice of dividing lines


class OpenChain(NamedTuple):
    """Connected curves that belong to no closed contour: their open ends, points and edges."""

    ends: tuple[complex, ...]
    edges: list[Edge]


class DrawnPlate(NamedTuple):
    """A connected region of metal.

    outside : closed counter-clockwise loop.   holes : closed clockwise loops.   size : mm^2.
    touches : points at which its contours touch themselves or each other.
    """

    outside: list[Edge]
    holes: list[list[Edge]]
    size: float
    touches: tuple[complex, ...]


class Regions(NamedTuple):
    """What a network of curves encloses.

    plates : the largest first.   open : what is not closed.   crossings : points at which curves
    cross.
    dividing : edges with metal on both sides.
    """

    plates: list[DrawnPlate]
    open: list[OpenChain]
    crossings: AnyArray
    dividing: list[Edge]


def regions_of(network: CurveNetwork) -> Regions:
    """Divide the plane into metal and voids: crossing a contour from outside changes from one to
    the other.

    Where a vertex has an odd number of edges, as at bodies that are drawn side by side, no such
    division exists. Then the edges of least total length whose removal leaves even numbers
    everywhere have the same on both sides; an edge that two curves share counts little, and another
    one at the outside is never such an edge."""
    closed, chains = _closed_part(network)
    crossings = _crossings(closed.edges)
    if len(crossings) or not closed.edges:
        return Regions(_plates(_even_part(closed)) if closed.edges else [], chains, crossings, [])
    dividing = _dividing(closed)
    removed = set(dividing)
    kept = closed._replace(edges=[edge for k, edge in enumerate(closed.edges) if k not in removed])
    return Regions(_plates(kept), chains, crossings, [closed.edges[k] for k in dividing])


def _even_part(network: CurveNetwork) -> CurveNetwork:
    """Return a network whose vertices have even numbers of edges, where curves that cross leave no
    better one.
    """
    removed = set(_dividing(network))
    return network._replace(
        edges=[edge for k, edge in enumerate(network.edges) if k not in removed]
    )


def _closed_part(network: CurveNetwork) -> tuple[CurveNetwork, list[OpenChain]]:
    """Take away edges with open ends, and those that then have open ends, and so on."""
    degrees = network.degrees()
    ends = set(np.flatnonzero(degrees == 1).tolist())
    at = defaultdict[int, list[int]](list)
    for k, edge in enumerate(network.edges):
        at[edge.start].append(k)
        at[edge.end].append(k)
    removed = set[int]()
    ahead = deque(ends)
    while ahead:
        vertex = ahead.popleft()
        for k in (k for k in at[vertex] if k not in removed):
            removed.add(k)
            edge = network.edges[k]
            other = edge.end if edge.start == vertex else edge.start
            degrees[other] -= 1
            if degrees[other] == 1:
                ahead.append(other)
    taken = [network.edges[k] for k in sorted(removed)]
    chains = list[OpenChain]()
    for members in _components(taken, len(network.points)):
        loose = {v for edge in members for v in (edge.start, edge.end) if v in ends}
        chains.append(OpenChain(tuple(complex(network.points[v]) for v in sorted(loose)), members))
    return network._replace(
        edges=[edge for k, edge in enumerate(network.edges) if k not in removed]
    ), chains


def _components(edges: Sequence[Edge], size: int) -> list[list[Edge]]:
    """Return edges by what they are connected to."""
    ends = np.array([edge[1:3] for edge in edges], dtype=int).reshape(-1, 2)
    links = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
    labels = connected_components(links, directed=False)[1]
    parts = defaultdict[int, list[Edge]](list)
    for edge in edges:
        parts[int(labels[edge.start])].append(edge)
    return list(parts.values())


# Crossings


def _crossings(edges: Sequence[Edge]) -> AnyArray:
    """Points (n,) at which edges cross away from their ends; curves that only touch do not cross.

    A point counts when its distances from the four ends, times the sine of the angle of crossing,
    exceed twice `SNAP`: this is how far the curves reach beyond each other."""
    shapes = Shapes([edge.segment for edge in edges])
    pairs = shapes.overlapping()
    found = [np.empty(0, dtype=complex)]
    for k in range(0, pairs.shape[1], 200_000):
        one, other = pairs[:, k : k + 200_000]
        for points in _common_points(shapes, one, other):
            found.append(points[_beyond(shapes, one, other, points) > 2 * SNAP])
    return np.concatenate(found)


def _common_points(shapes: Shapes, one: AnyArray, other: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Two common points (n,) of lines and circles of pairs of segments, nan where there are none."""
    swapped = shapes.curved[one] & ~shapes.curved[other]
    line = np.where(swapped, other, one)
    round_ = np.where(swapped, one, other)  # lines first
    start = shapes.start[line]
    ahead = shapes.end[line] - shapes.start[line]
    centre = shapes.centre[round_]
    radius = shapes.radius[round_]
    with np.errstate(invalid="ignore", divide="ignore"):
        both = shapes.curved[line]
        apart = shapes.centre[round_] - shapes.centre[line]
        along = (shapes.radius[line] ** 2 - radius**2 + np.abs(apart) ** 2) / (
            2 * np.abs(apart) ** 2
        )
        start = np.where(both, shapes.centre[line] + apart * along, start)
        ahead = np.where(both, 1j * apart, ahead)
        unit = ahead / np.abs(ahead)
        foot = start + unit * ((centre - start) * np.conj(unit)).real
        half = unit * np.sqrt(radius**2 - np.abs(foot - centre) ** 2)
        of_lines = shapes.end[round_] - shapes.start[round_]
        share = (np.conj(shapes.start[round_] - start) * of_lines).imag / (
            np.conj(ahead) * of_lines
        ).imag
        straight = ~shapes.curved[round_]
        crossing = start + ahead * share
    nowhere = complex(np.nan, np.nan)
    return np.where(straight, crossing, foot + half), np.where(straight, nowhere, foot - half)


def _beyond(shapes: Shapes, one: AnyArray, other: AnyArray, points: AnyArray) -> Array:
    """Return how far (n,) pairs of segments reach beyond each other at their common points, mm, 0
    elsewhere.
    """
    reach = np.full(len(points), np.inf)
    directions = list[AnyArray]()
    with np.errstate(invalid="ignore", divide="ignore"):
        for which in (one, other):
            shares, _ = shapes.projected(which, points)
            ends = np.minimum(
                np.abs(points - shapes.start[which]), np.abs(points - shapes.end[which])
            )
            reach = np.where((shares > 0) & (shares < 1), np.minimum(reach, ends), 0.0)
            spoke = 1j * (points - shapes.centre[which])
            ahead = np.where(shapes.curved[which], spoke, shapes.end[which] - shapes.start[which])
            directions.append(ahead / np.abs(ahead))
        sine = np.abs((np.conj(directions[0]) * directions[1]).imag)
        return np.asarray(np.nan_to_num(reach * sine, nan=0.0, posinf=0.0))


# Lines that divide metal


def _dividing(network: CurveNetwork) -> list[int]:
    """Return indices of the edges of least weight without which every vertex has an even number of
    edges.
    """
    odd = np.flatnonzero(network.degrees() % 2)
    if not len(odd):
        return []
    outer = _at_outside(network)
    paths = [path for path in _paths(network) if path.vertices[0] != path.vertices[1]]
    vertices = sorted({v for path in paths for v in path.vertices})
    row = {v: k for k, v in enumerate(vertices)}
    parity = np.isin(vertices, odd).astype(float)
    weights = np.array([path.weight for path in paths] + [0.0] * len(vertices))
    rows = np.array([row[v] for path in paths for v in path.vertices] + list(range(len(vertices))))
    of_paths = np.repeat(np.arange(len(paths)), 2)
    columns = np.concatenate([of_paths, len(paths) + np.arange(len(vertices))])
    values = np.array([1.0] * (2 * len(paths)) + [-2.0] * len(vertices))
    matrix = coo_matrix((values, (rows, columns)), shape=(len(vertices), len(weights))).tocsr()
    most = np.array(
        [0.0 if outer & set(path.edges) else 1.0 for path in paths]
        + [float(len(paths))] * len(vertices)
    )
    answer = milp(
        weights,
        integrality=np.ones(len(weights)),
        bounds=Bounds(0, most),
        constraints=LinearConstraint(matrix, parity, parity),
        options={"time_limit": TIME_LIMIT},
    )
    if answer.x is None:
        place = complex(network.points[odd[0]])
        raise BadInput(
            f"metal and voids cannot be told apart at {place.real:.4g}, {place.imag:.4g}, where "
            "an odd number of lines meet, expected closed contours"
        )
    return sorted(
        k for path, taken in zip(paths, answer.x, strict=False) if taken > 0.5 for k in path.edges
    )


class _Path(NamedTuple):
    """Edges between two vertices with other numbers of edges than two."""

    vertices: tuple[int, int]
    edges: list[int]
    weight: float


def _paths(network: CurveNetwork) -> list[_Path]:
    """Return the paths between vertices at which more than two edges meet; those of plain loops are
    left out.
    """
    degrees = network.degrees()
    at = defaultdict[int, list[int]](list)
    for k, edge in enumerate(network.edges):
        at[edge.start].append(k)
        at[edge.end].append(k)
    paths = list[_Path]()
    done = set[int]()
    for first in np.flatnonzero(degrees > 2).tolist():
        for k in at[first]:
            if k in done:
                continue
            taken = list[int]()
            vertex = first
            following: int | None = k
            while following is not None:
                done.add(following)
                taken.append(following)
                edge = network.edges[following]
                vertex = edge.end if edge.start == vertex else edge.start
                ahead = (
                    [each for each in at[vertex] if each not in done]
                    if degrees[vertex] == 2
                    else []
                )
                following = ahead[0] if ahead else None
            lengths = ((network.edges[e].segment.length, network.edges[e].times) for e in taken)
            weight = sum(length * (DOUBLED if count > 1 else 1.0) for length, count in lengths)
            paths.append(_Path((first, vertex), taken, weight))
    return paths


def _at_outside(network: CurveNetwork) -> set[int]:
    """Indices of edges of one curve that have the outside of their connected part on one side only."""
    outer = set[int]()
    for orbit in _orbits(network):
        if area([half.segment for half in orbit]) < 0:
            times = Counter(half.place for half in orbit)
            outer |= {
                k for k, number in times.items() if number == 1 and network.edges[k].times == 1
            }
    return outer


# Faces


class _Half(NamedTuple):
    """An edge of a network, with its place in the list, that is followed forwards or backwards."""

    place: int
    edge: Edge
    forwards: bool

    @property
    def segment(self) -> Segment:
        return self.edge.segment if self.forwards else self.edge.segment.reversed()

    @property
    def start(self) -> int:
        return self.edge.start if self.forwards else self.edge.end

    @property
    def end(self) -> int:
        return self.edge.end if self.forwards else self.edge.start


def _orbits(network: CurveNetwork) -> list[list[_Half]]:
    """Return the closed walks along edges that have one face on their left."""
    leaving = defaultdict[int, list[_Half]](list)
    for k, edge in enumerate(network.edges):
        leaving[edge.start].append(_Half(k, edge, True))
        leaving[edge.end].append(_Half(k, edge, False))
    before = dict[
        tuple[int, bool], _Half
    ]()  # by the half that arrives: the one that leaves with the same face
    for halves in leaving.values():
        ordered = _in_order(halves)
        for half, following in zip(ordered[1:] + ordered[:1], ordered, strict=True):
            before[half.place, not half.forwards] = following
    orbits = list[list[_Half]]()
    while before:
        key = next(iter(before))
        orbit = list[_Half]()
        while key in before:
            half = before.pop(key)
            orbit.append(half)
            key = (half.place, half.forwards)
        orbits.append(orbit)
    return orbits


def _in_order(halves: list[_Half]) -> list[_Half]:
    """Sort what leaves a vertex counter-clockwise, by a point so near that curves which touch there
    are apart.
    """
    if len(halves) < 3:
        return halves
    segments = [half.segment for half in halves]
    near = min(each.length / 2 for each in segments)
    near = min(
        [
            near,
            *(0.2 * abs(each.start - each.centre) for each in segments if each.centre is not None),
        ]
    )
    angles = [cmath.phase(complex(each.at(near / each.length)) - each.start) for each in segments]
    return [halves[k] for k in np.argsort(angles)]


def _polygon(orbit: Sequence[_Half]) -> shapely.Polygon:
    """Return a polygon of points on the orbit."""
    points = list[complex]()
    for half in orbit:
        segment = half.segment
        points.append(segment.start)
        if segment.centre is not None:
            radius = abs(segment.start - segment.centre)
            n = int(np.ceil(abs(segment.turn) / np.sqrt(8 * FLATNESS / max(radius, 1.0)))) + 1
            points += segment.at(np.arange(1, n) / n).tolist()
    z = np.array(points)
    return shapely.Polygon(np.column_stack([z.real, z.imag]))


def _plates(network: CurveNetwork) -> list[DrawnPlate]:
    """Return the metal: faces with an odd number of contours between them and the outside, the
    largest first.
    """
    orbits = _orbits(network)
    areas = [area([half.segment for half in orbit]) for orbit in orbits]
    orbit_of = {(half.place, half.forwards): k for k, orbit in enumerate(orbits) for half in orbit}
    inner = [k for k, size in enumerate(areas) if size > 0]
    around = _around(network, orbits, areas, inner)
    metal = dict[int, bool]()
    for k in sorted(around, key=lambda k: areas[k]):  # the largest first: what is around another
        enclosing = around[k]
        metal[k] = enclosing is not None and metal.get(enclosing, False)
        ahead = deque([k])
        while ahead:
            face = ahead.popleft()
            for half in orbits[face]:
                beside = orbit_of[half.place, not half.forwards]
                if beside not in metal:
                    metal[beside] = not metal[face]
                    ahead.append(beside)
    holes = defaultdict[int | None, list[int]](list)
    for k, enclosing in around.items():
        holes[enclosing].append(k)
    degrees = network.degrees()
    plates = list[DrawnPlate]()
    for k in inner:
        if metal[k]:
            loops = [orbits[k], *(orbits[each] for each in holes[k])]
            at = {half.start for loop in loops for half in loop if degrees[half.start] > 2}
            touches = tuple(complex(network.points[v]) for v in sorted(at))
            outside, *inside = [[_directed(half) for half in loop] for loop in loops]
            plates.append(
                DrawnPlate(
                    outside, inside, areas[k] + sum(areas[each] for each in holes[k]), touches
                )
            )
    return sorted(plates, key=lambda plate: -plate.size)


def _directed(half: _Half) -> Edge:
    return half.edge._replace(segment=half.segment, start=half.start, end=half.end)


def _around(
    network: CurveNetwork, orbits: list[list[_Half]], areas: list[float], inner: list[int]
) -> dict[int, int | None]:
    """Return, by the outer orbit of each connected part, the smallest face of another part that it
    lies in.
    """
    outer = [k for k, size in enumerate(areas) if size <= 0]
    around: dict[int, int | None] = dict.fromkeys(outer)
    if not inner:
        return around
    ends = np.array([edge[1:3] for edge in network.edges])
    size = len(network.points)
    links = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
    part = connected_components(links, directed=False)[1]
    starts = [orbits[k][0].segment.start for k in outer]
    places = shapely.points([z.real for z in starts], [z.imag for z in starts])
    tree = shapely.STRtree([_polygon(orbits[k]) for k in inner])
    for i, j in tree.query(places, predicate="within").T.tolist():
        k = outer[i]
        face = inner[j]
        current = around[k]
        other = part[orbits[face][0].start] != part[orbits[k][0].start]
        if other and (current is None or areas[face] < areas[current]):
            around[k] = face
    return around
