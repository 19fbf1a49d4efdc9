"""Outlines of found bodies as corners of a mechanism file, tied to the ends of hinges.

By expressions, a side at which hinges end follows their length, and a corner at the end of a hinge
its height, so that the plate stays closed when a parameter changes. Complex points, mm.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from flexfem.files.refusals import as_toml
from flexfem.mechanism.hinge_place import SIDES, end_corners
from flexfem.mechanism.layout import Joint
from flexfem.mechanism.outlines import SHORTEST, Segment

SLIVER = 1e-6  # mm; shorter segments are round-off
STRAIGHT = 1e-6  # mm, of corners from a straight side, or of centres of arcs on one circle
AT_HINGE = 5e-4  # the same of a side at which a hinge ends, which is fitted
REACHED = 2e-3  # mm, between an end of a hinge and the side of a body
SHORT = 1e-4  # mm, side beside a fillet
TANGENT = 1e-5  # rad, of a fillet and its sides
SHALLOW = 1e-2  # rad, least turn of an arc that is written as a fillet
BLUNT = math.radians(170.0)  # the most
LONGEST_ARC = math.radians(300.0)  # turn of an arc between two corners
PARALLEL = 1e-6  # sine of the angle between sides without a common corner
DECIMALS = 9
FEWER = 4  # of numbers of mm
SNAP = 2e-7  # mm, between a number and one with fewer decimals that is written instead
FLAT = 1e-9  # factor of a parameter that is round-off
LARGEST_INTEGER = 1e15  # that is written without a fraction


class Term(NamedTuple):
    """A parameter, or an expression of parameters, and how many times it counts.

    value : mm.
    """

    times: float
    text: str
    value: float


class HingeSize(NamedTuple):
    """Length of a hinge, and distances of its edges from the axis at its ends.

    They are sums of parameters, empty where these are plain numbers.
    """

    length: tuple[Term, ...] = ()
    left: tuple[Term, ...] = ()
    right: tuple[Term, ...] = ()


class HingeEnd(NamedTuple):
    """End of a hinge on a body.

    middle : of the end.   outwards : unit vector of the axis towards this end.
    left : unit vector to the left of the hinge.   corners : both corners, the left one first.
    """

    hinge: int
    middle: complex
    outwards: complex
    left: complex
    corners: tuple[complex, complex]


class Side(NamedTuple):
    """A side of an outline: a line, or an arc with a turn, rad.

    ends, segments : ends of hinges, and drawn segments on it.
    """

    start: complex
    end: complex
    centre: complex | None
    turn: float
    ends: tuple[HingeEnd, ...]
    segments: tuple[int, ...]


class Vertex(NamedTuple):
    """A corner with its fillet, mm, 0 for none; the side before it and that after it."""

    point: complex
    fillet: float
    before: Side
    after: Side


def hinge_ends(joints: Sequence[Joint], body: int) -> list[HingeEnd]:
    """Return the ends of hinges on a body."""
    found = list[HingeEnd]()
    for index, joint in enumerate(joints):
        for side, own in zip(SIDES, joint.bodies, strict=True):
            if own == body:
                corners = end_corners(joint, side)
                ahead = cmath.exp(1j * joint.heading)
                found.append(HingeEnd(index, sum(corners) / 2, side * ahead, 1j * ahead, corners))
    return found


def vertices_of(loop: Sequence[Segment], ends: Sequence[HingeEnd]) -> list[Vertex]:
    """Return the corners of a closed loop.

    Lines and arcs are joined where they continue, and fillets are written as such.
    """
    sides = _sides(loop, ends)
    following = [*sides[1:], sides[0]]
    is_fillet = [
        _is_fillet(sides[k - 1], side, after)
        for k, (side, after) in enumerate(zip(sides, following, strict=True))
    ]
    found = list[Vertex]()
    for k, side in enumerate(sides):
        if is_fillet[k]:
            found.append(_rounded_corner(sides[k - 1], side, following[k]))
        elif not is_fillet[k - 1]:
            found.append(Vertex(side.start, 0.0, sides[k - 1], side))
    return found


def _rounded_corner(
    before: Side,
    fillet: Side,
    after: Side,
) -> Vertex:
    """Return the corner at which the sides beside a fillet would meet."""
    assert fillet.centre is not None
    corner = _crossing(
        before.start, before.end - before.start, after.start, after.end - after.start
    )
    assert corner is not None
    return Vertex(corner, abs(fillet.start - fillet.centre), before, after)


def _sides(loop: Sequence[Segment], ends: Sequence[HingeEnd]) -> list[Side]:
    """Return the sides of a closed loop, joined where they continue."""
    drawn = [(index, segment) for index, segment in enumerate(loop) if segment.length > SLIVER]
    joined = list[Side]()
    start = drawn[-1][1].end
    for index, segment in drawn:
        side = _side(segment._replace(start=start), index, ends)
        start = segment.end
        longer = _joined(joined[-1], side) if joined else None
        if longer is None:
            joined.append(side)
        else:
            joined[-1] = longer
    if len(joined) > 2:
        longer = _joined(joined[-1], joined[0])
        if longer is not None:
            return [longer, *joined[1:-1]]
    return joined


def _side(
    segment: Segment,
    index: int,
    ends: Sequence[HingeEnd],
) -> Side:
    on = list[HingeEnd]()
    if segment.centre is None:
        on = [end for end in ends if _ends_on(end, segment.start, segment.end)]
    return Side(segment.start, segment.end, segment.centre, segment.turn, tuple(on), (index,))


def _ends_on(
    end: HingeEnd,
    start: complex,
    stop: complex,
) -> bool:
    """Whether the middle of the end of a hinge lies on a line at right angles to its axis."""
    along = stop - start
    place = (end.middle - start) / along
    upright = abs((along * end.outwards.conjugate()).real) < REACHED
    return upright and 0 < place.real < 1 and abs(place.imag) * abs(along) < REACHED


def _joined(one: Side, other: Side) -> Side | None:
    """Return two sides as one, None where there is a corner between them."""
    ends = one.ends + other.ends
    segments = one.segments + other.segments
    if one.centre is None and other.centre is None:
        if _is_straight(one, other, AT_HINGE if ends else STRAIGHT):
            return Side(one.start, other.end, None, 0.0, ends, segments)
    elif one.centre is not None and other.centre is not None:
        turn = one.turn + other.turn
        one_circle = abs(one.centre - other.centre) <= STRAIGHT and one.turn * other.turn > 0
        if one_circle and abs(turn) < LONGEST_ARC:
            return Side(one.start, other.end, one.centre, turn, ends, segments)
    return None


def _is_fillet(
    before: Side,
    side: Side,
    after: Side,
) -> bool:
    """Whether an arc between two lines can be written as a corner with a radius."""
    if side.centre is None or before.centre is not None or after.centre is not None:
        return False
    if not SHALLOW < abs(side.turn) < BLUNT:
        return False
    along = before.end - before.start
    beyond = after.end - after.start
    if min(abs(along), abs(beyond)) < SHORT:
        return False
    quarter = 1j * math.copysign(1.0, side.turn)
    bends = (
        quarter * (side.start - side.centre) / along,
        quarter * (side.end - side.centre) / beyond,
    )
    return all(abs(cmath.phase(bend)) < TANGENT for bend in bends)


def _crossing(
    a: complex,
    u: complex,
    b: complex,
    v: complex,
) -> complex | None:
    """Return the common point of two lines through points along vectors; None for parallel ones."""
    across = (u.conjugate() * v).imag
    if abs(across) <= PARALLEL * abs(u) * abs(v):
        return None
    return a + u * ((b - a).conjugate() * v).imag / across


class PlacedVertex(NamedTuple):
    """A corner as it is written: its place, and its displacement by each of the terms."""

    vertex: Vertex
    point: complex
    terms: list[tuple[complex, Term]]


def placed_vertices(vertices: Sequence[Vertex], sizes: Sequence[HingeSize]) -> list[PlacedVertex]:
    """Return corners where the hinges end, without those that then fall on the next one.

    sizes : of all hinges, by their index.
    """
    placed = [PlacedVertex(vertex, *_placed(vertex, sizes)) for vertex in vertices]
    following = [*placed[1:], placed[0]]
    return [
        one
        for one, other in zip(placed, following, strict=True)
        if abs(one.point - other.point) > SLIVER
    ]


def outline_rows(placed: Sequence[PlacedVertex]) -> list[list[float | str]]:
    """Return the corners of an outline as a file states them.

    They are x, y, and perhaps a radius and the height of an arc.
    """
    rows = list[list[float | str]]()
    following = [*placed[1:], placed[0]]
    for one, other in zip(placed, following, strict=True):
        row = [
            _coordinate(one.point.real, one.terms, 1.0),
            _coordinate(one.point.imag, one.terms, -1j),
        ]
        if one.vertex.fillet:
            row.append(decimal(one.vertex.fillet))
        if one.vertex.after.centre is not None:
            bow = abs(other.point - one.point) / 2 * math.tan(one.vertex.after.turn / 4)
            row += [0] * (3 - len(row)) + [decimal(bow)]
        rows.append(row)
    return rows


def _is_straight(
    one: Side,
    other: Side,
    most: float,
) -> bool:
    """Whether two lines go on in one direction, with their common point at most so far off it."""
    along = one.end - one.start
    chord = other.end - one.start
    if ((other.end - other.start) * along.conjugate()).real <= 0 or abs(chord) <= SHORTEST:
        return False
    return abs((along / chord).imag) * abs(chord) <= most


def _placed(
    vertex: Vertex, sizes: Sequence[HingeSize]
) -> tuple[complex, list[tuple[complex, Term]]]:
    """Return a corner where the hinges end, and its displacement by each of the terms."""
    before = vertex.before
    after = vertex.after
    if not vertex.fillet:
        at_hinge = _placed_at_hinge(vertex, sizes)
        if at_hinge is not None:
            return at_hinge
    point = _corner_of(vertex.point, [_line(before), _line(after)])
    terms = list[tuple[complex, Term]]()
    for side, other in ((before, after), (after, before)):
        if side.ends:
            way = _way(side, other)
            length = sizes[side.ends[0].hinge].length
            terms += [(way / 2 * term.times, term) for term in length]
    if terms:
        return point, terms
    return complex(decimal(point.real), decimal(point.imag)), terms


def _placed_at_hinge(
    vertex: Vertex, sizes: Sequence[HingeSize]
) -> tuple[complex, list[tuple[complex, Term]]] | None:
    """Return the same for a corner that is a corner of a hinge, None for another one."""
    for end in (*vertex.before.ends, *vertex.after.ends):
        size = sizes[end.hinge]
        along = [(end.outwards / 2 * term.times, term) for term in size.length]
        left, right = end.corners
        if abs(left - vertex.point) < REACHED:
            return left, along + [(end.left * term.times, term) for term in size.left]
        if abs(right - vertex.point) < REACHED:
            return right, along + [(-end.left * term.times, term) for term in size.right]
    return None


def _line(side: Side) -> tuple[complex, complex] | None:
    """Return a point and the direction of a straight side, None of an arc.

    The point is at the ends of its hinges where it has some.
    """
    if side.centre is not None:
        return None
    if not side.ends:
        return side.start, side.end - side.start
    first = side.ends[0]
    towards = first.outwards.conjugate()
    corners = [corner for end in side.ends for corner in end.corners]
    level = min((corner * towards).real for corner in corners)  # reaches all; hinges cut the rest
    foot = first.outwards * complex(level, (first.middle * towards).imag)
    return foot, 1j * first.outwards


def _corner_of(point: complex, lines: Sequence[tuple[complex, complex] | None]) -> complex:
    """Return the common point of two lines, or a point near them moved to the only line."""
    one, other = lines
    if one is not None and other is not None:
        crossing = _crossing(*one, *other)
        if crossing is not None:
            return crossing
    for line in lines:
        if line is not None:
            return line[0] + line[1] * ((point - line[0]) / line[1]).real
    return point


def _way(side: Side, other: Side) -> complex:
    """Return the displacement of a corner when the side moves outwards of its hinges by one.

    The other side stays.
    """
    outwards = side.ends[0].outwards
    if other.centre is not None:
        return outwards
    along = 1j * other.ends[0].outwards if other.ends else other.end - other.start
    along /= abs(along)
    share = (along * outwards.conjugate()).real
    return along / share if abs(share) > PARALLEL else outwards


def _coordinate(
    value: float,
    terms: Sequence[tuple[complex, Term]],
    part: complex,
) -> float | str:
    """Return a coordinate as a number, or as an expression with the parameters that move it."""
    shares = dict[str, float]()
    values = dict[str, float]()
    for way, term in terms:
        shares[term.text] = shares.get(term.text, 0.0) + (way * part).real
        values[term.text] = term.value
    moving = {text: share for text, share in shares.items() if abs(share) > FLAT}
    if not moving:
        return decimal(value)
    moved = sum(share * values[text] for text, share in moving.items())
    return expression(decimal(value - moved), moving)


def expression(rest: float, shares: Mapping[str, float]) -> str:
    """Return the text of a number plus shares of parameters."""
    text = "" if rest == 0 else number_text(rest)
    for name, share in shares.items():
        size = abs(share)
        if abs(size - 1) < FLAT:
            part = name
        elif abs(1 / size - round(1 / size)) < FLAT:
            part = f"{name} / {round(1 / size)}"
        else:
            part = f"{number_text(round(size, 12))} * {name}"
        if text:
            text += f" {'+' if share > 0 else '-'} {part}"
        else:
            text = part if share > 0 else f"-{part}"
    return text


def decimal(value: float) -> float:
    """Return a length as it is written.

    It has few decimals where that is exact to `SNAP`, else many.
    """
    fewer = round(value, FEWER)
    found = fewer if abs(fewer - value) <= SNAP else round(value, DECIMALS)
    return found + 0.0  # no -0


def number_text(value: float) -> str:
    """Return a number as TOML and expressions write it, without a needless fraction."""
    if float(value).is_integer() and abs(value) < LARGEST_INTEGER:
        return str(int(value))
    return repr(float(value))


def row_text(row: Sequence[float | str]) -> str:
    """Return a corner as TOML."""
    parts = [as_toml(part) if isinstance(part, str) else number_text(part) for part in row]
    return f"[{', '.join(parts)}]"
