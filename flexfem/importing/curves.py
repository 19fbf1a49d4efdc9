"""Curves of a file as lines and arcs: circles exactly, other curves within a small deviation;
complex points, mm.
"""

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

    points : points on named layers.   thickness : of a solid.   solids : names of the solids, the
    largest first.
    unit : sentence about the unit of the file, "" when the file or the caller states it.
    left_out : number of entities by what they are.   deviation : largest of all curves.
    """

    curves: list[DrawnCurve]
    points: list[DrawnMark]
    left_out: Counter[str]
    deviation: float = 0.0
    unit: str = ""
    thickness: float | None = None
    notes: tuple[str, ...] = ()


def arc(centre: complex, start: complex, turn: float) -> list[Segment]:
    """Circular arc from `start`, counter-clockwise for a positive `turn`, rad, in parts of less
    than half a turn.
    """
    parts = max(1, math.ceil(abs(turn) / LONGEST_ARC - 1e-9))
    points = [
        centre + (start - centre) * cmath.exp(1j * turn * k / parts) for k in range(parts + 1)
    ]
    if abs(turn) > 2 * math.pi - 1e-9:
        points[-1] = start
    return [Segment(a, b, centre) for a, b in pairwise(points)]


def with_ends(segment: Segment, start: complex, end: complex) -> Segment:
    """Return the line or arc between moved ends; the centre of the arc moves to the nearest point
    between them.
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
    """Arc of an ellipse with two conjugate half diameters, from the parameter `first` over `turn`,
    rad.
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
    (1991) 227)."""
    weights = [math.comb(len(points) - 1, k) for k in range(len(points))]

    def at(share: Array) -> AnyArray:
        terms = (w * (1 - share) ** (len(points) - 1 - k) * share**k for k, w in enumerate(weights))
        return np.asarray(sum(term * z for term, z in zip(terms, points, strict=True)))

    return approximated(at, np.linspace(0, 1, 3), of_circle=len(points) == 4)


def approximated(at: Points, breaks: AnyArray, of_circle: bool = False) -> Approximation:
    """Lines and arcs in place of a curve, each through the ends and the middle of a piece.

    Parameters
    ----------
    at : function
        Points (...), complex, mm, at shares (...) of the parameter.
    breaks : array_like
        Shares at which the curve may have corners, from 0 to 1.
    of_circle : whether the curve may be a cubic for a circular arc.

    Raises BadInput for a curve that is not finite or needs too many pieces.
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
        good = (errors <= CURVE_ERROR) | (high - low < 1e-7)
        for k in np.flatnonzero(good):
            start = complex(points[k, 0])
            end = complex(points[k, -1])
            centre = None if np.isnan(centres[k]) else complex(centres[k])
            kept.append((float(low[k]), Segment(start, end, centre)))
        deviation = max(deviation, float(np.max(errors[good], initial=0.0)))
        middle = (low + high)[~good] / 2
        low = np.concatenate([low[~good], middle])
        high = np.concatenate([middle, high[~good]])
    kept.sort(key=lambda piece: piece[0])
    return Approximation([segment for _, segment in kept], deviation)


def _arcs_through(points: AnyArray) -> tuple[AnyArray, Array]:
    """Centres (n,) of circles through first, middle and last of points (n, 9), nan of lines, and
    distances (n,).
    """
    a = points[:, 0]
    u = points[:, 4] - points[:, 0]
    v = points[:, -1] - points[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = (np.conj(u) * v).imag
        centres = a + 0.5j * (u * np.abs(v) ** 2 - v * np.abs(u) ** 2) / turn
        from_chord = np.max(
            np.abs(((points - a[:, None]) / v[:, None]).imag * np.abs(v)[:, None]), axis=1
        )
        spokes = points - centres[:, None]
        from_arc = np.max(np.abs(np.abs(spokes) - np.abs(spokes[:, :1])), axis=1)
        steps = np.angle(spokes[:, 1:] / spokes[:, :-1])
        one_way = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1)
        too_long = np.abs(np.sum(steps, axis=1)) > LONGEST_ARC
    short = np.abs(v) < SHORTEST
    straight = (from_chord < STRAIGHT) | ~np.isfinite(centres) | short
    errors = np.where(straight, from_chord, from_arc)
    errors[~straight & (~one_way | too_long)] = np.inf
    errors[np.isnan(errors) | short] = np.max(np.abs(points - a[:, None]), axis=1)[
        np.isnan(errors) | short
    ]
    centres[straight] = complex(np.nan, np.nan)
    return centres, errors


def _circular(at: Points, of_circle: bool) -> Approximation | None:
    """Return the circular arc that a curve lies on, None for another curve."""
    points = at(SAMPLES)
    if not np.all(np.isfinite(points)):
        return None
    closed = abs(points[-1] - points[0]) < STRAIGHT
    a, b, c = points[[0, 11, 22]] if closed else points[[0, 16, 32]]
    flat = ((b - a).conjugate() * (c - a)).imag
    if abs(flat) < STRAIGHT * abs(c - a):
        return None
    centre = complex(a + 0.5j * ((b - a) * abs(c - a) ** 2 - (c - a) * abs(b - a) ** 2) / flat)
    spokes = points - centre
    radius = abs(complex(a) - centre)
    steps = np.angle(spokes[1:] / spokes[:-1])
    turn = float(np.sum(steps))
    one_way = np.all(steps > 0) or np.all(steps < 0)
    deviation = float(np.max(np.abs(np.abs(spokes) - radius)))
    most = ROUND
    if of_circle and abs(turn) < 1.9:
        most += 1.2 * radius * 4 / 27 * math.sin(abs(turn) / 4) ** 6 / math.cos(turn / 4) ** 2
    if not one_way or deviation > most or abs(turn) < 1e-3:
        return None
    segments = arc(centre, complex(a), turn)
    segments[-1] = segments[-1]._replace(end=complex(points[0] if closed else points[-1]))
    return Approximation(segments, deviation)
