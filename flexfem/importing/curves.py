"""Curves of a file as lines and arcs; complex points, mm.

Circles are exact, other curves within a small deviation."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.importing.found import DrawnMark
from flexfem.mechanism.outlines import LONGEST_ARC, SHORTEST, Segment
from flexfem.refused import BadInput

CURVE_ERROR = 5e-5  # mm; of arcs in place of another curve
ROUND = 3e-4  # mm; a curve at most this far from a circular arc was drawn for this arc
STRAIGHT = 1e-6  # mm; a curve at most this far from its chord is a line
MOST_PIECES = 20_000  # arcs in place of one curve
SHORTEST_PIECE = 1e-7  # of the range of the parameter of a curve
MOST_OF_CUBIC = 1.9  # rad; most turn of one cubic that is drawn for a circular arc
LEAST_TURN = 1e-3  # rad, of an arc in place of a whole curve
SAMPLES = np.linspace(0, 1, 33)
QUARTERS = np.linspace(0, 1, 9)  # of a piece

Points: TypeAlias = Callable[[Array], AnyArray]


class DrawnCurve(NamedTuple):
    """Consecutive lines and arcs of one entity of a file.

    groups : names of the blocks, groups or solids that it is in.
    """

    segments: tuple[Segment, ...]
    layer: str
    groups: tuple[str, ...] = ()


class Approximation(NamedTuple):
    """Lines and arcs in place of a curve, and their largest distance from it, mm."""

    segments: list[Segment]
    deviation: float


class Contents(NamedTuple):
    """What a file holds, in mm.

    points : points on named layers.   left_out : number of entities by what they are.
    deviation : largest of all curves.   thickness : of a solid.
    unit : sentence about the unit of the file, "" when the file or the caller states it.
    notes : sentences about what was repaired or left out.
    """

    curves: list[DrawnCurve]
    points: list[DrawnMark]
    left_out: Counter[str]
    deviation: float = 0.0
    unit: str = ""
    thickness: float | None = None
    notes: tuple[str, ...] = ()


def arc(
    centre: complex,
    start: complex,
    turn: float,
) -> list[Segment]:
    """Circular arc from `start` in parts of less than half a turn.

    A positive `turn`, rad, is counter-clockwise.
    """
    parts = max(1, math.ceil(abs(turn) / LONGEST_ARC - 1e-9))
    points = [
        centre + (start - centre) * cmath.exp(1j * turn * k / parts) for k in range(parts + 1)
    ]
    if abs(turn) > 2 * math.pi - 1e-9:
        points[-1] = start
    return [Segment(a, b, centre) for a, b in pairwise(points)]


def with_ends(
    segment: Segment,
    start: complex,
    end: complex,
) -> Segment:
    """Return the line or arc between moved ends.

    The centre of an arc moves to the nearest point between them.
    """
    if segment.centre is None or abs(end - start) < SHORTEST:
        return Segment(start, end)
    ahead = (end - start) / abs(end - start)
    middle = (start + end) / 2
    aside = ((segment.centre - middle) * (1j * ahead).conjugate()).real
    return Segment(start, end, middle + 1j * ahead * aside)


def ellipse(
    centre: complex, major: complex, minor: complex, first: float, turn: float
) -> Approximation:
    """Arc of an ellipse with two conjugate half diameters.

    It goes from the parameter `first`, rad, over `turn`, rad.
    """
    pieces = max(2, math.ceil(abs(turn) / (math.pi / 8)))

    def at(share: Array) -> AnyArray:
        angle = first + turn * share
        return np.asarray(centre + major * np.cos(angle) + minor * np.sin(angle))

    return approximated(at, np.linspace(0, 1, pieces + 1))


def bezier(points: Sequence[complex]) -> Approximation:
    """Bezier curve of degree 2 or 3; one that programs draw for a circular arc becomes this arc.

    The largest distance of the cubic that touches an arc of `turn` at its ends and middle from this
    arc is 4/27 sin(turn/4)^6 / cos(turn/4)^2 of the radius (M. Goldapp, Comput. Aided Geom. Des. 8
    (1991) 227).
    """
    degree = len(points) - 1

    def at(share: Array) -> AnyArray:
        total = np.zeros(np.shape(share), dtype=complex)
        for k, point in enumerate(points):
            weight = math.comb(degree, k) * (1 - share) ** (degree - k) * share**k
            total = total + weight * point
        return total

    return approximated(at, np.linspace(0, 1, 3), of_circle=degree == 3)


def approximated(
    at: Points,
    breaks: AnyArray,
    of_circle: bool = False,
) -> Approximation:
    """Lines and arcs in place of a curve, each through the ends and the middle of a piece.

    Parameters
    ----------
    at : function
        Points (...), complex, mm, at shares (...) of the parameter.
    breaks : array_like
        Shares at which the curve may have corners, from 0 to 1.
    of_circle : bool
        Whether the curve may be a cubic for a circular arc.

    Raises
    ------
    BadInput
        The curve is not finite or needs too many pieces.
    """
    whole = _circular(at, of_circle)
    if whole is not None:
        return whole
    low = breaks[:-1]
    high = breaks[1:]
    kept = list[tuple[float, Segment]]()
    deviation = 0.0
    while len(low):
        if len(low) + len(kept) > MOST_PIECES:
            raise BadInput(f"a curve of more than {MOST_PIECES:,} arcs, expected a smoother one")
        points = at(low[:, None] + (high - low)[:, None] * QUARTERS)
        if not np.all(np.isfinite(points)):
            raise BadInput("a curve with points that are not finite numbers, expected finite ones")
        centres, errors = _arcs_through(points)
        good = (errors <= CURVE_ERROR) | (high - low < SHORTEST_PIECE)
        kept += zip(low[good].tolist(), _segments(points[good], centres[good]), strict=True)
        deviation = max(deviation, float(np.max(errors[good], initial=0.0)))
        middle = (low + high)[~good] / 2
        low = np.concatenate([low[~good], middle])
        high = np.concatenate([middle, high[~good]])
    kept.sort(key=lambda piece: piece[0])
    return Approximation([segment for _, segment in kept], deviation)


def _segments(points: AnyArray, centres: AnyArray) -> list[Segment]:
    """Return the line or arc between the first and the last of points (n, 9); nan of a line."""
    found = list[Segment]()
    for start, end, centre in zip(
        points[:, 0].tolist(), points[:, -1].tolist(), centres.tolist(), strict=True
    ):
        found.append(Segment(start, end, None if cmath.isnan(centre) else centre))
    return found


def _arcs_through(points: AnyArray) -> tuple[AnyArray, Array]:
    """Centres (n,) of circles through first, middle and last of points (n, 9), and distances (n,).

    Centres of lines are nan.
    """
    start = points[:, :1]
    half = points[:, 4] - points[:, 0]
    chord = points[:, -1] - points[:, 0]
    with np.errstate(
        divide="ignore",
        invalid="ignore",
        over="ignore",
    ):
        turn = (np.conj(half) * chord).imag
        squares = half * np.abs(chord) ** 2 - chord * np.abs(half) ** 2
        centres = points[:, 0] + 0.5j * squares / turn
        aside = ((points - start) / chord[:, None]).imag * np.abs(chord)[:, None]
        from_arc = _off_arcs(points - centres[:, None])
    from_chord = np.max(np.abs(aside), axis=1)
    is_short = np.abs(chord) < SHORTEST
    is_line = (from_chord < STRAIGHT) | ~np.isfinite(centres) | is_short
    errors = np.where(is_line, from_chord, from_arc)
    unknown = np.isnan(errors) | is_short
    errors[unknown] = np.max(np.abs(points - start), axis=1)[unknown]
    centres[is_line] = complex(np.nan, np.nan)
    return centres, errors


def _off_arcs(spokes: AnyArray) -> Array:
    """Distances (n,) of points from arcs, by vectors (n, 9) from their centres.

    Points that go to and fro, or too far around a centre, are on no arc.
    """
    radius = np.abs(spokes[:, :1])
    off = np.max(np.abs(np.abs(spokes) - radius), axis=1)
    steps = np.angle(spokes[:, 1:] / spokes[:, :-1])
    one_way = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1)
    too_long = np.abs(np.sum(steps, axis=1)) > LONGEST_ARC
    off[~one_way | too_long] = np.inf
    return np.asarray(off)


def _circular(at: Points, of_circle: bool) -> Approximation | None:
    """Return the circular arc that a curve lies on, None for another curve."""
    points = at(SAMPLES)
    if not np.all(np.isfinite(points)):
        return None
    closed = abs(points[-1] - points[0]) < STRAIGHT
    centre = _centre_of(*points[[0, 11, 22]]) if closed else _centre_of(*points[[0, 16, 32]])
    if centre is None:
        return None
    start = complex(points[0])
    spokes = points - centre
    radius = abs(start - centre)
    steps = np.angle(spokes[1:] / spokes[:-1])
    turn = float(np.sum(steps))
    one_way = np.all(steps > 0) or np.all(steps < 0)
    deviation = float(np.max(np.abs(np.abs(spokes) - radius)))
    most = ROUND
    if of_circle and abs(turn) < MOST_OF_CUBIC:
        most += 1.2 * radius * 4 / 27 * math.sin(abs(turn) / 4) ** 6 / math.cos(turn / 4) ** 2
    if not one_way or deviation > most or abs(turn) < LEAST_TURN:
        return None
    segments = arc(centre, start, turn)
    segments[-1] = segments[-1]._replace(end=start if closed else complex(points[-1]))
    return Approximation(segments, deviation)


def _centre_of(
    first: complex,
    second: complex,
    third: complex,
) -> complex | None:
    """Return the centre of the circle through three points, None of a line."""
    u = second - first
    v = third - first
    flat = (u.conjugate() * v).imag
    if abs(flat) < STRAIGHT * abs(v):
        return None
    return complex(first + 0.5j * (u * abs(v) ** 2 - v * abs(u) ** 2) / flat)
