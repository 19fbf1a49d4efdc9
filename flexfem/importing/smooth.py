"""Contours of few segments.

Lines in a row are one line, arcs of one circle are one arc, and short chords are the arc that they
mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.importing.curves import arc, with_ends
from flexfem.mechanism.outlines import Segment

ON_ARC = 1e-3  # mm; most that the ends of chords lie off the arc that they mean
EXACT = 1e-4  # mm; the same where the first lie as near: then it ends where the next curve begins
CHORD = 5e-3  # mm; most that the middle of such a chord lies off the arc
STEP = math.radians(6.1)  # most turn from chord to chord: 60 of them or more in a circle
FEWEST = 6  # chords
LEAST_TURN = math.radians(3.0)  # of chords in place of an arc; with less they may be a line
ON_LINE = 2e-5  # mm; distance of the ends of lines in a row from the one line
ONE_CIRCLE = 1e-4  # mm; distance of arcs in a row from the one arc
LONGEST_ROW = 100  # arcs that become one
THREE = np.array([0.0, 0.5, 1.0])


class SmoothLoop(NamedTuple):
    """A closed loop.

    arcs : number of those that stand for chords.
    off : largest distance of these chords from them, mm.   joined : the same of arcs that became
    one.
    """

    loop: list[Segment]
    arcs: int = 0
    off: float = 0.0
    joined: float = 0.0


def smoothed(loop: Sequence[Segment]) -> SmoothLoop:
    """Return a closed loop with as few lines and arcs as it can have."""
    chords = _arcs_of_chords(_from_a_corner(loop))
    segments, off = _joined_arcs(_joined_lines(_from_a_corner(chords.loop)))
    return chords._replace(loop=segments, joined=off)


def _from_a_corner(loop: Sequence[Segment]) -> list[Segment]:
    """Let the loop begin where it turns most.

    Then nothing that belongs together goes past its start.
    """
    ahead = np.array([complex(each.tangent(0.0)) for each in loop])
    behind = np.array([complex(each.tangent(1.0)) for each in loop])
    turns = np.abs(np.angle(ahead / np.roll(behind, 1)))
    radius = np.array(
        [0.0 if each.centre is None else abs(each.start - each.centre) for each in loop]
    )
    other = np.abs(radius - np.roll(radius, 1)) > ONE_CIRCLE
    first = int(np.argmax(turns + (other & (turns < STEP))))
    return [*loop[first:], *loop[:first]]


# Chords


def _arcs_of_chords(loop: list[Segment]) -> SmoothLoop:
    """Return the loop with arcs in place of rows of short lines whose ends are on one circle."""
    segments = list[Segment]()
    arcs = 0
    off = 0.0
    points = np.array([*(each.start for each in loop), loop[-1].end])
    rows = _row_ends(loop, points)
    k = 0
    while k < len(loop):
        count, centre = _longest_row(points[k : rows[k] + 1])
        if centre is None:
            segments.append(loop[k])
            k += 1
            continue
        row = loop[k : k + count]
        off = max(off, _off(row, centre))
        segments += _arc_through(row, centre)
        arcs += 1
        k += count
    return SmoothLoop(segments, arcs, off)


def _row_ends(loop: Sequence[Segment], points: AnyArray) -> list[int]:
    """Return, by line, the index after the last one of a row from it.

    The lines of a row turn a little, all to one side.
    """
    straight = np.array([each.centre is None for each in loop])
    steps = np.diff(points)
    turns = np.angle(steps[1:] / steps[:-1])
    small = straight[1:] & straight[:-1] & (np.abs(turns) <= STEP)
    sides = np.where(small, np.sign(turns), 0.0).tolist()
    ends = [k + 1 if line else k for k, line in enumerate(straight.tolist())]
    for k in range(len(loop) - 2, -1, -1):
        if sides[k]:
            goes_on = k + 1 < len(sides) and sides[k + 1] == sides[k]
            ends[k] = ends[k + 1] if goes_on else k + 2
    return ends


def _longest_row(points: AnyArray) -> tuple[int, complex | None]:
    """Number of lines through points, from the first, whose ends are on one circle, and its centre.

    The centre is None where there is no such row.
    """
    first = points[: FEWEST + 1]
    if len(points) <= FEWEST:
        return 0, None
    if _centre(first, EXACT) is not None:
        tolerance = EXACT
    elif _centre(first, ON_ARC) is not None:
        tolerance = ON_ARC
    else:
        return 0, None
    good = FEWEST
    bad = len(points)
    while good < bad - 1:
        count = min(2 * good, bad - 1) if bad == len(points) else (good + bad) // 2
        if _centre(points[: count + 1], tolerance) is None:
            bad = count
        else:
            good = count
    return good, _centre(points[: good + 1], tolerance)


def _centre(points: AnyArray, tolerance: float) -> complex | None:
    """Centre of the circle that points (n,) are on within a tolerance, None without one.

    The chords between them have to be short.
    """
    is_closed = abs(points[-1] - points[0]) < ON_LINE
    centre = _fitted(points) if is_closed else _fitted_between_ends(points)
    if centre is None:
        return None
    spokes = points - centre
    radius = float(np.mean(np.abs(spokes[[0, -1]])))
    steps = np.angle(spokes[1:] / spokes[:-1])
    largest = np.max(np.abs(steps))
    is_on_circle = np.max(np.abs(np.abs(spokes) - radius)) <= tolerance
    is_short = radius * (1 - np.cos(largest / 2)) <= CHORD and largest <= STEP
    if not is_on_circle or not is_short:
        return None
    turn = abs(float(np.sum(steps)))
    height = radius * (1 - math.cos(min(turn, math.pi) / 2))
    if turn < LEAST_TURN or height <= 5 * tolerance:  # the points are as well on a line
        return None
    return centre


def _fitted(points: AnyArray) -> complex:
    """Centre of the circle of least squares of |z|^2 through points."""
    middle = complex(np.mean(points))
    z = points - middle
    matrix = np.column_stack([z.real, z.imag, np.ones(len(z))])
    found = np.linalg.lstsq(matrix, np.abs(z) ** 2, rcond=None)[0]
    return middle + complex(found[0], found[1]) / 2


def _fitted_between_ends(points: AnyArray) -> complex | None:
    """Centre of the circle through the ends of points that fits the others best, None of a line."""
    start = complex(points[0])
    end = complex(points[-1])
    middle = (start + end) / 2
    ahead = (end - start) / abs(end - start)
    half = abs(end - start) / 2
    local = (points[1:-1] - middle) / ahead
    weight = local.imag
    square = float(np.sum(weight**2))
    if square < ON_LINE**2:
        return None
    height = float(np.sum(weight * (np.abs(local) ** 2 - half**2))) / (2 * square)
    return middle + 1j * ahead * height


def _arc_through(row: Sequence[Segment], centre: complex) -> list[Segment]:
    """Arcs about a centre from the start of a row of lines or arcs to its end."""
    start = row[0].start
    end = row[-1].end
    points = np.array([start, *(each.end for each in row)])
    if abs(end - start) > 0.2 * abs(start - centre):  # else its ends do not tell the centre
        centre = with_ends(Segment(start, end, centre), start, end).centre or centre
    turn = float(np.sum(np.angle((points[1:] - centre) / (points[:-1] - centre))))
    found = arc(centre, start, turn)
    found[-1] = found[-1]._replace(end=end)
    return found


def _off(row: Sequence[Segment], centre: complex) -> float:
    """Largest distance of the lines of a row from the circle about a centre, mm.

    The circle goes through the start of the row.
    """
    radius = abs(row[0].start - centre)
    ends = max(abs(abs(each.end - centre) - radius) for each in row)
    middles = max(abs(abs((each.start + each.end) / 2 - centre) - radius) for each in row)
    return max(ends, middles)


# Lines and arcs in a row


def _joined_lines(loop: Sequence[Segment]) -> list[Segment]:
    """Join lines that follow each other on one line."""
    joined = list[Segment]()
    between = list[complex]()  # ends of the lines that the last of `joined` replaces
    for segment in loop:
        if joined and segment.centre is None and joined[-1].centre is None:
            whole = Segment(joined[-1].start, segment.end)
            ends = np.array([*between, segment.start])
            if _in_a_row(whole, ends):
                joined[-1] = whole
                between.append(segment.start)
                continue
        joined.append(segment)
        between = []
    return joined


def _in_a_row(whole: Segment, ends: AnyArray) -> bool:
    """Whether points are on a line, in their order."""
    along = whole.end - whole.start
    if abs(along) < ON_LINE:
        return False
    places = (ends - whole.start) / along
    steps = np.diff([0.0, *places.real.tolist(), 1.0])
    off = np.max(np.abs(places.imag)) * abs(along)
    return bool(np.all(steps > 0) and off <= ON_LINE)


def _joined_arcs(loop: Sequence[Segment]) -> tuple[list[Segment], float]:
    """Join arcs that follow each other on one circle, and return how far they are off it, mm."""
    rows = list[list[Segment]]()
    for segment in loop:
        row = [*rows[-1], segment] if rows else []
        if row and len(row) <= LONGEST_ROW and _off_circle(row) <= ONE_CIRCLE:
            rows[-1] = row
        else:
            rows.append([segment])
    joined = list[Segment]()
    off = 0.0
    for row in rows:
        if len(row) > 1:
            off = max(off, _off_circle(row))
            joined += _arc_through(row, _row_centre(row))
        else:
            joined += row
    return joined, off


def _row_centre(row: Sequence[Segment]) -> complex:
    """Centre of arcs of one circle: that of the longest."""
    centre = max(row, key=lambda each: each.length).centre
    assert centre is not None
    return centre


def _off_circle(row: Sequence[Segment]) -> float:
    """Largest distance of arcs from their one circle, mm.

    It is infinite for lines, and for arcs that turn to both sides.
    """
    if any(each.centre is None or each.turn * row[0].turn < 0 for each in row):
        return math.inf
    points = np.concatenate([each.at(THREE) for each in row])
    spokes = np.abs(points - _row_centre(row))
    return float(np.max(np.abs(spokes - spokes[0])))
