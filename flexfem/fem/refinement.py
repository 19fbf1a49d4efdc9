"""Where triangles of a plate must be smaller: necks, arcs, corners, narrow places and contacts."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.sizes import GROWTH, PER_TURN
from flexfem.mechanism.hinge_place import end_corners, end_lines
from flexfem.mechanism.layout import Body, Joint, Layout, Move
from flexfem.mechanism.outlines import SHORTEST, polygon_points
from flexfem.mechanism.plate import mean_width
from flexfem.meshing.requests import Grading

CORNER = 4.0  # times smaller are the triangles at a sharp inner corner of an elastic body
SHARP = np.deg2rad(20.0)  # turn of the outline at a corner
AT_CONTACT = 4.0  # size of triangles at a contact, per radius, times the resolution
RAYS = 0.1  # distance between rays from a side of a body, per mean width
# triangles per full turn of holes and fillets of bodies, times the resolution
ON_ARCS = 4.0
# of a plate; with more of them, such as a sieve, the mesh follows the outline alone
MOST_ARCS = 200
MOST_RAYS = 64  # from a side, or around one of its rays
FACING = 0.7  # cosine of the angle between two sides that face each other


class _Place(NamedTuple):
    """Size of triangles, mm, within a radius of a point."""

    point: complex
    size: float
    radius: float


def refinements(
    layout: Layout, resolution: int, largest: Sequence[float], moves: Sequence[Move]
) -> list[Grading]:
    """Return the sizes of small triangles of a plate, which grow from there.

    largest : mm, size of triangles far from these places in bodies, then in hinges.
    moves : of the symmetry of the plate.
    """
    points = dict[tuple[float, float], list[complex]]()
    for place in _places(layout, resolution, largest, moves):
        points.setdefault((place.size, place.radius), []).append(place.point)
    coarsest = max(largest)
    growth = GROWTH / resolution
    return [
        Grading(places, radius, size, coarsest, (coarsest - size) / growth)
        for (size, radius), places in points.items()
        if size < coarsest
    ]


def _places(
    layout: Layout, resolution: int, largest: Sequence[float], moves: Sequence[Move]
) -> Iterator[_Place]:
    for joint in layout.joints:
        yield from _needles(layout, joint)
        turn = cmath.exp(1j * joint.heading)
        for points, size, radius in joint.profile.sizes(resolution):
            for z in points:
                yield _Place(complex(joint.place + z * turn), size, radius)
    on_arcs = PER_TURN
    if _number_of_arcs(layout.bodies) <= MOST_ARCS:
        on_arcs = max(PER_TURN, ON_ARCS * resolution)
    for body, coarse in zip(layout.bodies, largest, strict=False):
        yield from _places_of_body(body, coarse, PER_TURN if body.fixed else on_arcs)
    for patch in dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts):
        if patch.radius is not None and patch.body >= 0 and not layout.bodies[patch.body].fixed:
            for move in (Move(), *moves):
                size = AT_CONTACT * patch.radius / resolution
                yield _Place(move(patch.point), size, patch.radius)


def _needles(layout: Layout, joint: Joint) -> Iterator[_Place]:
    """Yield the tips of the needles between a hinge and its bodies, see `end_lines`."""
    for side, body in zip((-1, 1), joint.bodies, strict=True):
        ends = end_lines(joint, side, layout.bodies[body].fixed)
        if len(ends) == 1:
            continue
        for point in (ends[0].start, ends[-1].end):
            length = min(abs(corner - point) for corner in end_corners(joint, side))
            if length > SHORTEST:  # not at an edge that is gentle up to its end
                yield _Place(point, length / 2, length)


def _number_of_arcs(bodies: Iterable[Body]) -> int:
    edges = (edge for body in bodies for loop in (body.outline, *body.holes) for edge in loop)
    return sum(edge.centre is not None for edge in edges)


def _places_of_body(
    body: Body,
    coarse: float,
    per_turn: float,
) -> Iterator[_Place]:
    """Yield the places of arcs, of sharp inner corners of elastic bodies, and of narrow places.

    coarse : mm, size far from them.   per_turn : triangles per full turn of an arc.
    """
    for loop in (body.outline, *body.holes):
        for before, after in zip((loop[-1], *loop[:-1]), loop, strict=True):
            if after.centre is not None:
                radius = abs(after.start - after.centre)
                yield _Place(after.centre, radius * 2 * math.pi / per_turn, radius)
            turn = cmath.phase(complex(after.tangent(0.0)) / complex(before.tangent(1.0)))
            if turn < -SHARP and not body.fixed:
                yield _Place(after.start, coarse / CORNER, 0.0)
    width = body.width or mean_width(body)
    for point, gap in _narrow_places(body, width):
        yield _Place(point, coarse * gap / width, gap)


class _Sides(NamedTuple):
    """The n straight sides of the polygons of a body, metal to their left, and a tree of them.

    starts, along : (n,), complex, mm, their first points, and their vectors.
    """

    starts: AnyArray
    along: AnyArray
    tree: Any

    @property
    def directions(self) -> AnyArray:
        return np.asarray(self.along / np.abs(self.along))


class _Rays(NamedTuple):
    """Points (m,), complex, mm, on sides `of` (m,), from which rays go at right angles."""

    origins: AnyArray
    of: Index


def _narrow_places(body: Body, width: float) -> Iterator[tuple[complex, float]]:
    """Yield points in the middle of places narrower than half the width of a body, and their width.

    The widths, mm, are in steps of a factor of two. The points are the middles of the shortest
    lines between two of its loops, and of rays at right angles to its outlines that meet a side
    that faces them.
    """
    rings = [polygon_points(loop) for loop in (body.outline, *body.holes)]
    places = [*_between_loops(rings, width / 2), *_across_rays(rings, width)]
    for point, gap in places:
        if gap > SHORTEST:
            yield point, width * 2 ** -math.ceil(math.log2(width / gap))


def _between_loops(rings: Sequence[AnyArray], most: float) -> Iterator[tuple[complex, float]]:
    """Yield middles and lengths, mm, of the shortest lines between loops at most so far apart."""
    loops = np.array([shapely.LinearRing(ring) for ring in rings])
    near = shapely.STRtree(loops).query(loops, predicate="dwithin", distance=most).T
    between = near[near[:, 0] < near[:, 1]]
    ends = shapely.get_coordinates(shapely.shortest_line(*loops[between].T)).reshape(-1, 2, 2)
    lines = ends @ [1, 1j]
    lengths = np.abs(np.diff(lines)).ravel()
    yield from zip(lines.mean(axis=1).tolist(), lengths.tolist(), strict=True)


def _across_rays(rings: Sequence[AnyArray], width: float) -> Iterator[tuple[complex, float]]:
    """Yield middles and lengths, mm, of rays across places narrower than half a width."""
    ends = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    tree = shapely.STRtree(np.asarray(shapely.linestrings(ends)))
    sides = _Sides(ends[:, 0] @ [1, 1j], (ends[:, 1] - ends[:, 0]) @ [1, 1j], tree)
    rays = _spread(sides.starts, sides.along, np.full(len(ends), RAYS * width))
    for _ in range(2):  # the second time where places are narrower than the rays are apart
        gaps = _gaps(sides, rays, width / 2)
        found = gaps < width / 2
        inwards = 1j * sides.directions[rays.of[found]]
        middles = rays.origins[found] + inwards * gaps[found] / 2
        yield from zip(middles.tolist(), gaps[found].tolist(), strict=True)
        apart = np.minimum(RAYS * width, np.abs(sides.along[rays.of]))
        thin = found & (gaps < apart)
        of = rays.of[thin]
        around = apart[thin] * sides.directions[of]
        more = _spread(rays.origins[thin] - around / 2, around, gaps[thin])
        rays = _Rays(more.origins, of[more.of])


def _spread(
    starts: AnyArray,
    along: AnyArray,
    spacing: Array,
) -> _Rays:
    """Return points on lines from `starts` (n,) by vectors `along` (n,), at most so far apart."""
    counts = np.clip(np.ceil(np.abs(along) / spacing), 1, MOST_RAYS).astype(np.int64)
    of = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    return _Rays(starts[of] + along[of] * (place + 0.5) / counts[of], of)


def _gaps(
    sides: _Sides,
    rays: _Rays,
    longest: float,
) -> Array:
    """Return the lengths (m,), mm, of rays to the next side that faces theirs; else infinity."""
    directions = sides.directions[rays.of]
    ends = np.stack([rays.origins, rays.origins + longest * 1j * directions], axis=1)
    lines = shapely.linestrings(np.stack([ends.real, ends.imag], axis=2))
    ray, wall = sides.tree.query(lines, predicate="intersects")
    # the ray is the positive imaginary axis
    u = (sides.starts[wall] - rays.origins[ray]) / directions[ray]
    v = sides.along[wall] / directions[ray]
    with np.errstate(divide="ignore", invalid="ignore"):
        away = u.imag - u.real / v.real * v.imag
    away[~(away > SHORTEST) | (v.real > -FACING * np.abs(v))] = np.inf
    gaps = np.full(len(rays.origins), np.inf)
    np.minimum.at(gaps, ray, away)
    return gaps
