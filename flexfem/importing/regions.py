"""Metal and voids between the joined curves of a drawing, and what is wrong with them; mm."""

from __future__ import annotations

import cmath
from collections import Counter, defaultdict, deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix, csr_matrix

from flexfem.arrays import AnyArray, Array
from flexfem.importing.network import SNAP, CurveNetwork, Edge, Shapes, connected
from flexfem.mechanism.outlines import Segment, area
from flexfem.refused import BadInput

FLATNESS = 1e-4  # mm; of polygons in which points are looked up
DOUBLED = 1e-3  # weight of a line that two curves share, among lines that may divide metal
TIME_LIMIT = 10.0  # s, for the choice of dividing lines
AT_ONCE = 200_000  # pairs of curves whose crossings are computed together


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

    plates : the largest first.   open : what is not closed.
    crossings : points at which curves cross.   dividing : edges with metal on both sides.
    """

    plates: list[DrawnPlate]
    open: list[OpenChain]
    crossings: AnyArray
    dividing: list[Edge]


def regions_of(network: CurveNetwork) -> Regions:
    """Divide the plane into metal and voids.

    Crossing a contour from outside changes from one to the other. Where a vertex has an odd number
    of edges, as at bodies that are drawn side by side, no such division exists. Then the edges of
    least total length whose removal leaves even numbers everywhere have the same on both sides; an
    edge that two curves share counts little, and another one at the outside is never such an edge.
    """
    closed, chains = _closed_part(network)
    crossings = _crossings(closed)
    if not closed.edges:
        return Regions([], chains, crossings, [])
    dividing = _dividing(closed)
    plates = _plates(closed.without(dividing))
    if len(crossings):  # the lines that divide such a drawing say nothing
        return Regions(plates, chains, crossings, [])
    return Regions(plates, chains, crossings, [closed.edges[k] for k in dividing])


def _closed_part(network: CurveNetwork) -> tuple[CurveNetwork, list[OpenChain]]:
    """Take away edges with open ends, and those that then have open ends, and so on."""
    ends = set(np.flatnonzero(network.degrees() == 1).tolist())
    removed = _edges_to_open_ends(network, ends)
    taken = [network.edges[k] for k in sorted(removed)]
    parts = defaultdict[int, list[Edge]](list)
    labels = connected(taken, len(network.points))
    for edge in taken:
        parts[int(labels[edge.start])].append(edge)
    chains = list[OpenChain]()
    for members in parts.values():
        loose = ends & {vertex for edge in members for vertex in (edge.start, edge.end)}
        places = network.points[sorted(loose)].tolist()
        chains.append(OpenChain(tuple(places), members))
    return network.without(removed), chains


# Crossings


def _edges_to_open_ends(network: CurveNetwork, ends: set[int]) -> set[int]:
    """Return indices of the edges with open ends, of those that then have open ends, and so on."""
    degrees = network.degrees()
    edges_at = network.edges_at()
    removed = set[int]()
    ahead = deque(ends)
    while ahead:
        vertex = ahead.popleft()
        for k in edges_at[vertex]:
            if k in removed:
                continue
            removed.add(k)
            other = network.edges[k].other_end(vertex)
            degrees[other] -= 1
            if degrees[other] == 1:
                ahead.append(other)
    return removed


def _crossings(network: CurveNetwork) -> AnyArray:
    """Points (n,) at which edges cross away from their ends; curves that only touch do not cross.

    A point counts when its distances from the four ends, times the sine of the angle of crossing,
    exceed twice `SNAP`: this is how far the curves reach beyond each other.
    """
    shapes = network.shapes
    pairs = shapes.overlapping()
    found = [np.empty(0, dtype=complex)]
    for k in range(0, pairs.shape[1], AT_ONCE):
        one, other = pairs[:, k : k + AT_ONCE]
        for points in _common_points(shapes, one, other):
            found.append(points[_beyond(shapes, one, other, points) > 2 * SNAP])
    return np.concatenate(found)


def _common_points(
    shapes: Shapes,
    one: AnyArray,
    other: AnyArray,
) -> tuple[AnyArray, AnyArray]:
    """Two common points (n,) of the lines and circles of pairs of segments, nan for none."""
    lines_second = shapes.curved[one] & ~shapes.curved[other]
    first = np.where(lines_second, other, one)
    second = np.where(lines_second, one, other)
    with np.errstate(invalid="ignore", divide="ignore"):
        start, ahead = _common_lines(shapes, first, second)
        middle, half = _chords(shapes, second, start, ahead)
        crossing = _crossings_of_lines(shapes, second, start, ahead)
    straight = ~shapes.curved[second]
    nowhere = complex(np.nan, np.nan)
    return (
        np.where(straight, crossing, middle + half),
        np.where(straight, nowhere, middle - half),
    )


def _common_lines(
    shapes: Shapes,
    first: AnyArray,
    second: AnyArray,
) -> tuple[AnyArray, AnyArray]:
    """Points and directions (n,) of lines through the common points of pairs of segments.

    They are the first segments themselves, or the lines through the common points of two circles.
    """
    apart = shapes.centre[second] - shapes.centre[first]
    squares = shapes.radius[first] ** 2 - shapes.radius[second] ** 2 + np.abs(apart) ** 2
    along = squares / (2 * np.abs(apart) ** 2)
    both = shapes.curved[first]
    start = np.where(both, shapes.centre[first] + apart * along, shapes.start[first])
    return start, np.where(both, 1j * apart, shapes.end[first] - shapes.start[first])


def _chords(
    shapes: Shapes, round_: AnyArray, start: AnyArray, ahead: AnyArray
) -> tuple[AnyArray, AnyArray]:
    """Middles (n,) of the chords that lines cut from circles, and vectors (n,) to one end."""
    unit = ahead / np.abs(ahead)
    centre = shapes.centre[round_]
    foot = start + unit * ((centre - start) * np.conj(unit)).real
    return foot, unit * np.sqrt(shapes.radius[round_] ** 2 - np.abs(foot - centre) ** 2)


def _crossings_of_lines(
    shapes: Shapes, second: AnyArray, start: AnyArray, ahead: AnyArray
) -> AnyArray:
    """Points (n,) at which lines cross second ones."""
    vectors = shapes.end[second] - shapes.start[second]
    offset = np.conj(shapes.start[second] - start) * vectors
    share = offset.imag / (np.conj(ahead) * vectors).imag
    return np.asarray(start + ahead * share)


def _beyond(
    shapes: Shapes,
    one: AnyArray,
    other: AnyArray,
    points: AnyArray,
) -> Array:
    """Return how far (n,) pairs of segments reach beyond each other at their common points, mm.

    It is 0 where they do not cross.
    """
    reach = np.full(len(points), np.inf)
    directions = list[AnyArray]()
    with np.errstate(invalid="ignore", divide="ignore"):
        for which in (one, other):
            start = shapes.start[which]
            end = shapes.end[which]
            shares, _ = shapes.projected(which, points)
            nearest = np.minimum(np.abs(points - start), np.abs(points - end))
            inside = (shares > 0) & (shares < 1)
            reach = np.where(inside, np.minimum(reach, nearest), 0.0)
            tangent = 1j * (points - shapes.centre[which])
            ahead = np.where(shapes.curved[which], tangent, end - start)
            directions.append(ahead / np.abs(ahead))
        sine = np.abs((np.conj(directions[0]) * directions[1]).imag)
        return np.asarray(np.nan_to_num(reach * sine, nan=0.0, posinf=0.0))


# Lines that divide metal


def _dividing(network: CurveNetwork) -> list[int]:
    """Return indices of the edges of least weight without which all numbers of edges are even."""
    odd = np.flatnonzero(network.degrees() % 2)
    if not len(odd):
        return []
    outer = _at_outside(network)
    paths = [path for path in _paths(network) if path.vertices[0] != path.vertices[1]]
    is_kept = [not outer.isdisjoint(path.edges) for path in paths]
    removed = _least_paths(paths, is_kept, odd)
    if removed is None:
        place = complex(network.points[odd[0]])
        raise BadInput(
            f"metal and voids cannot be told apart at {place.real:.4g}, {place.imag:.4g}, where "
            "an odd number of lines meet, expected closed contours"
        )
    return sorted(k for path in removed for k in path.edges)


class _Path(NamedTuple):
    """Edges between two vertices with other numbers of edges than two."""

    vertices: tuple[int, int]
    edges: list[int]
    weight: float


def _least_paths(
    paths: Sequence[_Path], is_kept: Sequence[bool], odd: AnyArray
) -> list[_Path] | None:
    """Return the paths of least weight whose removal changes the parity of the odd vertices alone.

    is_kept : whether a path cannot be removed.   odd : vertices with odd numbers of edges.

    At each vertex, the number of removed paths is twice an integer, plus 1 at an odd one: a linear
    program in integers. None where it has no solution.
    """
    vertices = sorted({vertex for path in paths for vertex in path.vertices})
    equations = _parity_equations(paths, vertices)
    parity = np.isin(vertices, odd).astype(float)
    weights = [path.weight for path in paths] + [0.0] * len(vertices)
    most_of_paths = [0.0 if each else 1.0 for each in is_kept]
    most = most_of_paths + [float(len(paths))] * len(vertices)
    answer = milp(
        np.array(weights),
        integrality=np.ones(len(weights)),
        bounds=Bounds(0, np.array(most)),
        constraints=LinearConstraint(equations, parity, parity),
        options={"time_limit": TIME_LIMIT},
    )
    if answer.x is None:
        return None
    return [path for path, share in zip(paths, answer.x, strict=False) if share > 0.5]


def _parity_equations(paths: Sequence[_Path], vertices: Sequence[int]) -> csr_matrix:
    """Coefficients of the numbers of removed paths, and of an integer for each vertex.

    An equation for each vertex has 1 for a path that ends there, and -2 for the integer.
    """
    row_of = {vertex: row for row, vertex in enumerate(vertices)}
    rows = [row_of[vertex] for path in paths for vertex in path.vertices]
    columns = np.repeat(np.arange(len(paths)), 2)
    ends = np.ones(2 * len(paths))
    own_rows = np.arange(len(vertices))
    shape = (len(vertices), len(paths) + len(vertices))
    entries = np.concatenate([ends, np.full(len(vertices), -2.0)])
    places = (
        np.concatenate([np.array(rows, dtype=int), own_rows]),
        np.concatenate([columns, len(paths) + own_rows]),
    )
    return coo_matrix((entries, places), shape=shape).tocsr()


def _paths(network: CurveNetwork) -> list[_Path]:
    """Return the paths between vertices at which more than two edges meet.

    Those of plain loops are left out.
    """
    edges_at = network.edges_at()
    paths = list[_Path]()
    done = set[int]()
    for vertex in np.flatnonzero(network.degrees() > 2).tolist():
        for k in edges_at[vertex]:
            if k not in done:
                path = _path_from(network, edges_at, vertex, k)
                done.update(path.edges)
                paths.append(path)
    return paths


def _path_from(
    network: CurveNetwork, edges_at: Mapping[int, list[int]], start: int, first: int
) -> _Path:
    """Follow edges from a vertex, a first edge on, up to one at which more than two edges meet."""
    taken = [first]
    vertex = network.edges[first].other_end(start)
    while len(edges_at[vertex]) == 2:
        one, other = edges_at[vertex]
        taken.append(other if one == taken[-1] else one)
        vertex = network.edges[taken[-1]].other_end(vertex)
    weight = 0.0
    for k in taken:
        edge = network.edges[k]
        weight += edge.segment.length * (DOUBLED if edge.times > 1 else 1.0)
    return _Path((start, vertex), taken, weight)


def _at_outside(network: CurveNetwork) -> set[int]:
    """Indices of edges with the outside of their connected part on one side only.

    Edges that several curves share are left out.
    """
    outer = set[int]()
    for orbit in _orbits(network):
        if area([half.segment for half in orbit]) >= 0:
            continue
        times = Counter(half.place for half in orbit)
        outer |= {k for k, number in times.items() if number == network.edges[k].times == 1}
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
    # by the half that arrives: the one that leaves with the same face
    following = dict[tuple[int, bool], _Half]()
    for halves in leaving.values():
        ordered = _in_order(halves)
        for half, before in zip(ordered[1:] + ordered[:1], ordered, strict=True):
            following[half.place, not half.forwards] = before
    orbits = list[list[_Half]]()
    while following:
        key = next(iter(following))
        orbit = list[_Half]()
        while key in following:
            half = following.pop(key)
            orbit.append(half)
            key = (half.place, half.forwards)
        orbits.append(orbit)
    return orbits


def _in_order(halves: list[_Half]) -> list[_Half]:
    """Sort what leaves a vertex counter-clockwise.

    The order is that of points so near that curves which touch at the vertex are apart.
    """
    if len(halves) < 3:
        return halves
    segments = [half.segment for half in halves]
    near = min(each.length / 2 for each in segments)
    for each in segments:
        if each.centre is not None:
            near = min(near, 0.2 * abs(each.start - each.centre))
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
            step = np.sqrt(8 * FLATNESS / max(radius, 1.0))
            n = int(np.ceil(abs(segment.turn) / step)) + 1
            points += segment.at(np.arange(1, n) / n).tolist()
    z = np.array(points)
    return shapely.Polygon(np.column_stack([z.real, z.imag]))


def _plates(network: CurveNetwork) -> list[DrawnPlate]:
    """Return the metal, the largest region first.

    It is the faces with an odd number of contours between them and the outside.
    """
    orbits = _orbits(network)
    areas = [area([half.segment for half in orbit]) for orbit in orbits]
    around = _around(network, orbits, areas)
    is_metal = _metal(orbits, areas, around)
    holes = defaultdict[int | None, list[int]](list)
    for k, face in around.items():
        holes[face].append(k)
    plates = list[DrawnPlate]()
    degrees = network.degrees()
    for k, size in enumerate(areas):
        if size > 0 and is_metal[k]:
            loops = [orbits[each] for each in (k, *holes[k])]
            metal = size + sum(areas[each] for each in holes[k])
            plates.append(_plate(network, degrees, loops, metal))
    return sorted(plates, key=lambda plate: -plate.size)


def _plate(
    network: CurveNetwork, degrees: AnyArray, loops: list[list[_Half]], size: float
) -> DrawnPlate:
    """Return the metal inside the first of several loops and outside the others, of an area."""
    outside, *holes = [[_directed(half) for half in loop] for loop in loops]
    crowded = {half.start for loop in loops for half in loop if degrees[half.start] > 2}
    touches = [complex(network.points[vertex]) for vertex in sorted(crowded)]
    return DrawnPlate(outside, holes, size, tuple(touches))


def _metal(
    orbits: list[list[_Half]], areas: list[float], around: Mapping[int, int | None]
) -> dict[int, bool]:
    """Return whether the face of each orbit is metal.

    around : by the outer orbit of each connected part, the face that it lies in.
    """
    orbit_of = {(half.place, half.forwards): k for k, orbit in enumerate(orbits) for half in orbit}
    is_metal = dict[int, bool]()
    for k in sorted(around, key=lambda k: areas[k]):  # the largest first: what is around another
        face_around = around[k]
        is_metal[k] = face_around is not None and is_metal.get(face_around, False)
        ahead = deque([k])
        while ahead:
            face = ahead.popleft()
            for half in orbits[face]:
                beside = orbit_of[half.place, not half.forwards]
                if beside not in is_metal:
                    is_metal[beside] = not is_metal[face]
                    ahead.append(beside)
    return is_metal


def _directed(half: _Half) -> Edge:
    return half.edge._replace(
        segment=half.segment,
        start=half.start,
        end=half.end,
    )


def _around(
    network: CurveNetwork, orbits: list[list[_Half]], areas: list[float]
) -> dict[int, int | None]:
    """Return the face of another part in which each connected part lies, the smallest such face.

    Keys are the outer orbits of the parts. None is the outside of all.
    """
    inner = [k for k, size in enumerate(areas) if size > 0]
    outer = [k for k, size in enumerate(areas) if size <= 0]
    around: dict[int, int | None] = dict.fromkeys(outer)
    if not inner:
        return around
    part_of = connected(network.edges, len(network.points))
    starts = np.array([orbits[k][0].segment.start for k in outer])
    tree = shapely.STRtree([_polygon(orbits[k]) for k in inner])
    pairs = tree.query(shapely.points(starts.real, starts.imag), predicate="within")
    for i, j in pairs.T.tolist():
        k = outer[i]
        face = inner[j]
        smallest = around[k]
        if part_of[orbits[face][0].start] == part_of[orbits[k][0].start]:
            continue
        if smallest is None or areas[face] < areas[smallest]:
            around[k] = face
    return around
