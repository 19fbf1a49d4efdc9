"""Contours of few segments: lines in a row are one line, arcs of one circle one arc, short chords
the arc they mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.importing.curves import arc, with_ends
from flexfem.mechanism.outlines import Segment

ON_ARC = 1e-3  # mm; most that the ends of chords lie off the arc that they mean
# mm; the same where the first of them lie as near: then it ends where the next curve begins
EXACT = 1e-4
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

    arcs : number of those that stand for chords.   off : largest distance of these chords from
    them, mm.
    joined : the same of arcs that became one.
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
    """Let the loop begin where it turns most, so that nothing that belongs together goes past its
    start.
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
    """Return, by line, the index after the last one of a row from it that turns a little, all to
    one side.
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
    """Number of lines through points, from the first, whose ends are on one circle, and its centre
    or None.
    """
    if len(points) <= FEWEST:
        return 0, None
    for tolerance in (EXACT, ON_ARC):
        if _centre(points[: FEWEST + 1], tolerance) is not None:
            break
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
    """Centre of the circle that points (n,) are on within a tolerance, with short chords between
    them, or None.
    """
    closed = abs(points[-1] - points[0]) < ON_LINE
    start = complex(points[0])
    end = complex(points[-1])
    if closed:
        centre = _fitted(points)
    else:
        ahead = (end - start) / abs(end - start)
        local = (points[1:-1] - (start + end) / 2) / ahead
        half = abs(end - start) / 2
        weight = local.imag
        square = float(np.sum(weight**2))
        if square < ON_LINE**2:
            return None
        height = float(np.sum(weight * (np.abs(local) ** 2 - half**2))) / (2 * square)
        centre = (start + end) / 2 + 1j * ahead * height
    spokes = points - centre
    radius = float(np.mean(np.abs(spokes[[0, -1]])))
    steps = np.angle(spokes[1:] / spokes[:-1])
    chords = radius * (1 - np.cos(np.max(np.abs(steps)) / 2))
    turn = abs(float(np.sum(steps)))
    fits = (
        np.max(np.abs(np.abs(spokes) - radius)) <= tolerance
        and chords <= CHORD
        and np.max(np.abs(steps)) <= STEP
    )
    height = radius * (
        1 - math.cos(min(turn, math.pi) / 2)
    )  # with less than this the points are as well on a line
    return centre if fits and turn >= LEAST_TURN and height > 5 * tolerance else None


def _fitted(points: AnyArray) -> complex:
    """Centre of the circle of least squares of |z|^2 through points."""
    middle = complex(np.mean(points))
    z = points - middle
    matrix = np.column_stack([z.real, z.imag, np.ones(len(z))])
    found = np.linalg.lstsq(matrix, np.abs(z) ** 2, rcond=None)[0]
    return middle + complex(found[0], found[1]) / 2


def _arc_through(row: Sequence[Segment], centre: complex) -> list[Segment]:
    """Arcs about a centre from the start of a row of lines or arcs to its end."""
    points = np.array([row[0].start, *(each.end for each in row)])
    if abs(points[-1] - points[0]) > 0.2 * abs(
        points[0] - centre
    ):  # else its ends do not tell the centre
        centre = (
            with_ends(Segment(row[0].start, row[-1].end, centre), row[0].start, row[-1].end).centre
            or centre
        )
    turn = float(np.sum(np.angle((points[1:] - centre) / (points[:-1] - centre))))
    found = arc(centre, row[0].start, turn)
    found[-1] = found[-1]._replace(end=row[-1].end)
    return found


def _off(row: Sequence[Segment], centre: complex) -> float:
    """Largest distance of the lines of a row from the circle about a centre through their ends, mm."""
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
    if abs(whole.end - whole.start) < ON_LINE:
        return False
    places = (ends - whole.start) / (whole.end - whole.start)
    steps = np.diff([0.0, *places.real.tolist(), 1.0])
    return bool(
        np.all(steps > 0) and np.max(np.abs(places.imag)) * abs(whole.end - whole.start) <= ON_LINE
    )


def _joined_arcs(loop: Sequence[Segment]) -> tuple[list[Segment], float]:
    """Join arcs that follow each other on one circle; also return how far the joined ones are off
    it, mm.
    """
    joined = list[Segment]()
    row = list[Segment]()
    off = 0.0
    for segment in [*loop, None]:
        if (
            row
            and segment is not None
            and len(row) < LONGEST_ROW
            and _off_circle([*row, segment]) <= ONE_CIRCLE
        ):
            row.append(segment)
            continue
        if len(row) > 1:
            off = max(off, _off_circle(row))
            joined += _arc_through(row, _row_centre(row))
        else:
            joined += row
        row = [] if segment is None else [segment]
    return joined, off


def _row_centre(row: Sequence[Segment]) -> complex:
    """Centre of arcs of one circle: that of the longest."""
    centre = max(row, key=lambda each: each.length).centre
    assert centre is not None
    return centre


def _off_circle(row: Sequence[Segment]) -> float:
    """Largest distance of arcs that turn to one side from their one circle, mm; infinite for
    others.
    """
    if any(each.centre is None or each.turn * row[0].turn < 0 for each in row):
        return math.inf
    points = np.concatenate([each.at(THREE) for each in row])
    spokes = np.abs(points - _row_centre(row))
    return float(np.max(np.abs(spokes - spokes[0])))
