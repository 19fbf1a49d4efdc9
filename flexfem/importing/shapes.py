"""Shapes of hinges fitted to the edges of a plate on both sides of a neck.

The simplest shape that reproduces the edges is taken."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.importing.necks import Neck
from flexfem.importing.strips import (
    CLOSE,
    CORNER,
    Axis,
    Strip,
    height_at,
    strip_of,
    turns_in,
    vertices,
    ways_of,
    without_flanks,
)
from flexfem.mechanism.edges import Bezier, Curve, Ellipse, mapped
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_shape import BadDimension
from flexfem.mechanism.profiles import profile_of
from flexfem.mechanism.tabulated import Tabulated

ALLOWED = 1e-3  # mm, largest distance of the edge of a shape from the drawn one
TABLE = 5e-5  # mm, the same of a table between its rows
EXACT = 1e-6  # mm; smaller differences of dimensions are round-off of coordinates
PER_CURVE = 9  # points of a drawn segment that are compared
FINE = 400  # points of an ellipse or parabola in their place
MOST_ROWS = 2000
BETWEEN = (0.05, 0.25, 0.5, 0.75, 0.95)  # positions between two rows at which a table is compared
ROUNDS = 14  # in which rows are added to a table
SHORT_LEAF = 12.0  # length per neck up to which a leaf with fillets is a filleted hinge
BENT = 1.5  # height per neck, up to which the middle of the metal must follow the axis
STEEPEST = 0.15  # slope of the middle of the metal there
LOW = 4.0  # height of the ends of a low table per neck
MOSTLY = 0.5  # of the length of a profile with flanks, above which the leaf between is the hinge
DIGITS = 10  # of headings, rad, that are alike
ALIKE = 1e-9  # rad, between directions that are one
NEARLY_UPRIGHT = math.radians(80.0)  # slope at which a table ends


class Fit(NamedTuple):
    """A profile in its frame, whose place is its centre.

    dimensions : by the key of a mechanism file without its unit; angles in degrees.
    deviation : mm, largest distance from the drawn edge.
    """

    profile: Profile
    shape: str
    dimensions: dict[str, float]
    frame: Axis
    deviation: float
    side: str | None = None


def fits_of(
    loops: Sequence[Sequence[Segment]],
    neck: Neck,
    low: bool = False,
) -> Iterator[Fit]:
    """Yield the fits of a hinge at a neck, the simplest shape first.

    Each is in the frame in which it fits best. With `low`, they are only tables that end where the
    metal is a few times as high as the neck.
    """
    whole, short = _strips(loops, neck)
    if low:
        yield from _tables(filter(None, map(_lowered, whole)))
        return
    yield from _best_shapes(whole)
    flanked = [*_tables(strip for strip in whole if _is_even(strip))]
    leaves = [*_best_shapes(short)]
    for leaf in leaves:
        if not flanked or leaf.profile.length > MOSTLY * flanked[0].profile.length:
            yield leaf
    yield from flanked
    yield from leaves
    yield from _tables([*short, *whole])


def _strips(loops: Sequence[Sequence[Segment]], neck: Neck) -> tuple[list[Strip], list[Strip]]:
    """Return the edges at a neck in all frames that they suggest: whole, and without flanks."""
    whole = list[Strip]()
    short = list[Strip]()
    roughs = _roughs(loops, neck)
    suggested = [frame for rough in roughs for frame in _suggested(loops, neck, rough)]
    frames = dict[float, Axis]()
    for frame in (*suggested, *roughs):
        frames.setdefault(round(frame.heading, DIGITS), frame)
    for frame in frames.values():
        ways = ways_of(loops, neck, frame)
        strip = strip_of(ways, frame)
        if strip is None:
            ways = ways_of(loops, neck, frame, wall=math.pi)
            strip = strip_of(ways, frame)
        if strip is None:
            continue
        whole.append(strip)
        cut = strip_of(without_flanks(ways), frame)
        if cut is not None and cut.length < strip.length - CLOSE:
            short.append(cut)
    return whole, short


def _roughs(loops: Sequence[Sequence[Segment]], neck: Neck) -> list[Axis]:
    """Return frames in the middle of a chord, along both edges and at right angles to it."""
    right = loops[neck.right.loop][neck.right.segment]
    left = loops[neck.left.loop][neck.left.segment]
    start = complex(right.at(neck.right.share))
    end = complex(left.at(neck.left.share))
    upright = -1j * ((end - start) / abs(end - start))
    tangent = complex(right.tangent(neck.right.share)) - complex(left.tangent(neck.left.share))
    directions = [upright]
    is_forward = (tangent * upright.conjugate()).real > 0.5
    if is_forward and abs(cmath.phase(tangent / upright)) > ALIKE:
        directions.insert(0, tangent)
    return [Axis((start + end) / 2, cmath.phase(direction)) for direction in directions]


def _suggested(
    loops: Sequence[Sequence[Segment]],
    neck: Neck,
    rough: Axis,
) -> Iterator[Axis]:
    """Yield frames that the edges suggest.

    They follow a line of one edge, the centres of two arcs, or the ends of both edges.
    """
    strip = strip_of(ways_of(loops, neck, rough), rough)
    if strip is None:
        return
    for edge, sign in ((strip.left, 1), (strip.right, -1)):
        line = _flattest_line(edge)
        if line is not None:
            slope = sign * cmath.phase(line.end - line.start)
            yield Axis(rough.place, rough.heading + slope)
    for left in _lowest_arcs(strip.left):
        for right in _lowest_arcs(strip.right):
            assert left.centre is not None and right.centre is not None
            across = left.centre - right.centre.conjugate()
            yield Axis(rough.place, rough.heading + cmath.phase(-1j * across))
    first = (strip.left[0].start + strip.right[0].start.conjugate()) / 2
    last = (strip.left[-1].end + strip.right[-1].end.conjugate()) / 2
    yield Axis(rough.place, rough.heading + cmath.phase(last - first))


def _flattest_line(edge: Sequence[Segment]) -> Segment | None:
    """Return the longest line of an edge that is nearly along the axis."""
    lines = [
        one for one in edge if one.centre is None and abs(cmath.phase(one.end - one.start)) < 0.2
    ]
    return max(lines, key=lambda one: one.length, default=None)


def _lowest_arcs(edge: Sequence[Segment]) -> list[Segment]:
    """Return the arcs of an edge at its lowest point."""
    lowest = min(complex(one.at(share)).imag for one in edge for share in (0.0, 0.5, 1.0))
    arcs = [one for one in edge if one.centre is not None and one.turn > 0]
    low = [one for one in arcs if min(one.start.imag, one.end.imag) < lowest + CLOSE]
    return low[:2] or arcs[:1]


def _tables(strips: Iterable[Strip]) -> Iterator[Fit]:
    """Yield the tables of the edges of strips, of those that have one."""
    for strip in strips:
        table = _table(strip)
        if table is not None:
            yield table


def _best_shapes(strips: Sequence[Strip]) -> Iterator[Fit]:
    """Yield the fits of closed shapes to a strip in several frames, each shape in the best one."""
    fits = ((order, fit) for strip in strips for order, fit in _shapes(strip))
    exact = next((fit for _, fit in fits if fit.deviation < EXACT), None)
    if exact is not None:
        yield exact
    found = dict[tuple[int, str | None], Fit]()
    for strip in strips:
        for order, fit in _shapes(strip):
            key = (order, fit.side)
            best = found.get(key)
            if fit.deviation <= ALLOWED and (best is None or fit.deviation < best.deviation):
                found[key] = fit
    for key in sorted(found, key=lambda key: key[0]):
        yield found[key]


class _Notch(NamedTuple):
    """What the dimensions of all shapes follow from; mm, rad.

    centre : of the hinge, in the frame of the strip.   side : of a hinge with one notch.
    root : radius of the arc at the neck, 0 without one.
    flank : slope of a straight edge at the ends.
    """

    centre: complex
    length: float
    neck: float
    depth: float
    root: float
    flank: float
    side: str | None


def _shapes(strip: Strip) -> Iterator[tuple[int, Fit]]:
    """Yield the closed shapes with the dimensions of a strip, in the order of their simplicity."""
    for notch in _notches(strip):
        for order, (shape, dimensions) in enumerate(_candidates(notch)):
            with suppress(BadDimension):
                yield order, _fit(strip, notch, shape, dimensions)


def _fit(
    strip: Strip,
    notch: _Notch,
    shape: str,
    dimensions: dict[str, float],
) -> Fit:
    given: dict[str, Any] = {
        key: math.radians(value) if key == "angle" else value for key, value in dimensions.items()
    }
    if notch.side:
        given["side"] = notch.side
    profile = profile_of(shape, given)
    frame = Axis(strip.frame.out(notch.centre), strip.frame.heading)
    deviation = _deviation(strip, profile, notch.centre)
    return Fit(profile, shape, dimensions, frame, deviation, notch.side)


def _candidates(notch: _Notch) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield shapes with the dimensions of a notch, by the keys of a mechanism file."""
    length = notch.length
    neck = notch.neck
    depth = notch.depth
    if depth < EXACT:
        yield "leaf", {"length": length, "neck": neck}
        return
    is_short = length < SHORT_LEAF * neck
    yield "filleted" if is_short else "leaf", {"length": length, "neck": neck, "fillet": depth}
    yield "circular", {"radius": length / 2, "neck": neck}
    if notch.root and notch.flank:
        angle = 180.0 - 2 * math.degrees(notch.flank)
        yield (
            "v",
            {
                "angle": angle,
                "root_radius": notch.root,
                "depth": depth,
                "neck": neck,
            },
        )
    yield "elliptical", {"length": length, "depth": depth, "neck": neck}
    yield "parabolic", {"length": length, "depth": depth, "neck": neck}


def _notches(strip: Strip) -> Iterator[_Notch]:
    """Yield the notch of an even strip, or that of a strip with one straight edge."""
    edges = (strip.left, strip.right)
    corners = np.array([(edge[0].start, edge[-1].end) for edge in edges])
    if np.ptp(corners.real, axis=0).max() > CLOSE:
        return
    low, high = corners.real.mean(axis=0).tolist()
    middle = (low + high) / 2
    lowest = np.array([height_at(edge, np.array([middle]))[0] for edge in edges])
    rises = corners.imag
    depths = rises - lowest[:, None]
    neck = float(lowest.sum())
    if neck <= 0 or np.ptp(depths, axis=1).max() > 2 * ALLOWED:
        return
    outline = _Outline(middle, high - low, neck)
    if abs(depths[0].mean() - depths[1].mean()) < 2 * ALLOWED:
        aside = float(rises[0].mean() - rises[1].mean()) / 2
        yield _notch(outline, strip.left, aside, max(float(depths.mean()), 0.0), None)
    notched = _notched_edge(depths)
    if notched is not None:
        aside = float(lowest[0] - lowest[1]) / 2
        depth = float(depths[notched].mean())
        yield _notch(outline, edges[notched], aside, depth, ("left", "right")[notched])


def _notched_edge(depths: Array) -> int | None:
    """Return which edge alone has a notch: 0 for the left, 1 for the right, None without one.

    depths : (2, 2), mm, of the edges below their two ends.
    """
    for notched, other in ((0, 1), (1, 0)):
        if np.abs(depths[other]).max() < ALLOWED < depths[notched].min():
            return notched
    return None


class _Outline(NamedTuple):
    """Middle of a strip on its axis, its length and its neck, mm."""

    middle: float
    length: float
    neck: float


def _notch(
    outline: _Outline, edge: Sequence[Segment], aside: float, depth: float, side: str | None
) -> _Notch:
    """Return a notch with the edge of a strip, and its centre so far to the left of the axis."""
    middle, length, neck = outline
    centre = complex(middle, aside)
    return _Notch(centre, length, neck, depth, _root(edge, middle), _flank(edge), side)


def _root(edge: Sequence[Segment], middle: float) -> float:
    """Return the radius of the arc of an edge at the middle, 0 without one."""
    for segment in edge:
        low = segment.start.real - CLOSE
        high = segment.end.real + CLOSE
        if segment.centre is not None and low <= middle <= high:
            return abs(segment.start - segment.centre)
    return 0.0


def _flank(edge: Sequence[Segment]) -> float:
    """Return the slope of a line at the last end of an edge, rad, 0 of an arc."""
    return 0.0 if edge[-1].centre is not None else cmath.phase(edge[-1].end - edge[-1].start)


def _drawn(edge: Sequence[Segment], count: int = PER_CURVE) -> AnyArray:
    """Return points (n,) of an edge, several of each segment."""
    return np.concatenate([segment.at(np.linspace(0, 1, count)) for segment in edge])


def edges_of(profile: Profile) -> tuple[list[Curve], list[Curve]]:
    """Return the left edge of a profile and its right one, mirrored."""
    left, right = profile.edges()
    return left, [mapped(curve, lambda z: z.conjugate()) for curve in right]


def corners_of(profile: Profile) -> tuple[complex, complex, complex, complex]:
    """Return the corners of a profile.

    They are the right ones at the first and the second end, then the left ones at the second and
    the first.
    """
    half = profile.length / 2
    positions = edge_positions(profile, np.array([-half, half]))
    (near_left, far_left), (near_right, far_right) = positions.tolist()
    return (
        complex(-half, -near_right),
        complex(half, -far_right),
        complex(half, far_left),
        complex(-half, near_left),
    )


def _deviation(
    strip: Strip,
    profile: Profile,
    centre: complex,
) -> float:
    """Return the largest distance, mm, of drawn edges from those of a profile about a centre."""
    left, right = edges_of(profile)
    of_left = distances(_drawn(strip.left) - centre, left)
    of_right = distances(_drawn(strip.right) - centre.conjugate(), right)
    return max(float(np.max(of_left)), float(np.max(of_right)))


def distances(points: AnyArray, curves: Sequence[Curve]) -> Array:
    """Return the distances (n,), mm, of points (n,) from the nearest of several curves."""
    found = np.full(len(points), np.inf)
    for curve in curves:
        if isinstance(curve, Segment):
            nearest = curve.at(np.clip(curve.shares(points), 0.0, 1.0))
            found = np.minimum(found, np.abs(points - nearest))
        else:
            z = _points_of(curve)
            step = np.diff(z)
            ahead = points[:, None] - z[:-1]
            share = np.clip((ahead / step).real, 0.0, 1.0)
            found = np.minimum(found, np.abs(ahead - share * step).min(axis=1))
    return found


def _points_of(curve: Bezier | Ellipse) -> AnyArray:
    """Return points (FINE,) of a Bezier curve, or of a quarter of an ellipse."""
    t = np.linspace(0, 1, FINE)
    if isinstance(curve, Ellipse):
        start = curve.start - curve.centre
        end = curve.end - curve.centre
        angle = t * np.pi / 2
        return np.asarray(curve.centre + start * np.cos(angle) + end * np.sin(angle))
    degree = len(curve.points) - 1
    points = np.zeros(FINE, dtype=complex)
    for k, point in enumerate(curve.points):
        points = points + math.comb(degree, k) * t**k * (1 - t) ** (degree - k) * point
    return points


def _is_even(strip: Strip) -> bool:
    """Return whether both edges of a strip end at the same places beside its axis."""
    corners = np.array([(edge[0].start, edge[-1].end) for edge in (strip.left, strip.right)])
    heights = corners.imag - corners.imag.mean(axis=1, keepdims=True)
    return bool(
        np.ptp(corners.real, axis=0).max() < CLOSE and np.ptp(heights, axis=0).max() < CLOSE
    )


def _lowered(strip: Strip) -> Strip | None:
    """Return the part of a strip around its neck that is low; None where there is none."""
    x = np.linspace(strip.low, strip.high, FINE)
    height = height_at(strip.left, x) + height_at(strip.right, x)
    lowest = int(np.nanargmin(height))
    high = np.flatnonzero(~(height < LOW * height[lowest]))
    before = high[high < lowest]
    after = high[high > lowest]
    low = x[before[-1]] if len(before) else strip.low
    end = x[after[0]] if len(after) else strip.high
    return strip._replace(low=float(low), high=float(end)) if end - low > CLOSE else None


def _is_curved(strip: Strip) -> bool:
    """Return whether the middle of the metal bends away from the axis where it is low.

    Its sections are not upright then.
    """
    x = np.linspace(strip.low, strip.high, FINE)
    left = height_at(strip.left, x)
    right = height_at(strip.right, x)
    slope = np.abs(np.diff(left - right)) / 2 / np.diff(x)
    is_low = (left + right < BENT * np.nanmin(left + right))[1:]
    return bool(np.any(slope[is_low] > STEEPEST))


def _table(strip: Strip) -> Fit | None:
    """Return the profile with rows of the drawn edges of a strip, None where there is none."""
    if _is_curved(strip):
        return None
    x = _first_positions(strip)
    is_curved = any(segment.centre is not None for segment in (*strip.left, *strip.right))
    turns = [abs(turn) for turn in turns_in(strip.left) + turns_in(strip.right)]
    is_smooth = is_curved and max(turns, default=0.0) < CORNER
    with suppress(BadDimension):
        x, deviation = _refined(strip, x, is_smooth)
        frame = Axis(strip.frame.out(complex((x[0] + x[-1]) / 2)), strip.frame.heading)
        return Fit(_tabulated(strip, x, is_smooth), "profile", {}, frame, deviation)
    return None


def _first_positions(strip: Strip) -> Array:
    """Return the positions (n,) of the ends of a table and of the corners between them."""
    low, high = _gentle(strip)
    corners = np.array([z.real for edge in (strip.left, strip.right) for z in vertices(edge)])
    between = corners[(corners > low + CLOSE) & (corners < high - CLOSE)]
    x = np.unique(np.round([low, high, *between], 9))
    x = x[np.append(True, np.diff(x) > CLOSE / 2)]
    return x if len(x) >= 3 else np.linspace(low, high, 3)


def _tabulated(
    strip: Strip,
    x: Array,
    is_smooth: bool,
) -> Tabulated:
    """Return the profile with rows at positions (n,), of two columns where both edges are alike."""
    left = height_at(strip.left, x)
    right = height_at(strip.right, x)
    if np.max(np.abs(left - right)) < ALLOWED / 2:
        heights = left + right
        return Tabulated(tuple(zip(x.tolist(), heights.tolist(), strict=True)), smooth=is_smooth)
    rows = zip(x.tolist(), left.tolist(), right.tolist(), strict=True)
    return Tabulated(tuple(rows), smooth=is_smooth)


def _refined(
    strip: Strip,
    x: Array,
    is_smooth: bool,
) -> tuple[Array, float]:
    """Return positions at which a table follows the drawn edges, and its largest deviation, mm.

    Rows are added between positions (n,) where it does not.
    """
    for _ in range(ROUNDS):
        steps = np.diff(x)
        between = x[:-1] + np.array(BETWEEN)[:, None] * steps
        table = _tabulated(strip, x, is_smooth)
        off = np.abs(_heights(strip, between) - edge_positions(table, between - (x[0] + x[-1]) / 2))
        slope = np.diff(_heights(strip, x), axis=1) / steps
        worst = (off / np.hypot(1, slope)[:, None]).max(axis=(0, 1))
        coarse = (worst > TABLE) & (steps > 2 * CLOSE)
        if not coarse.any() or len(x) > MOST_ROWS:
            break
        x = np.sort(np.append(x, (x[:-1] + steps / 2)[coarse]))
    return x, float(worst.max())


def _heights(strip: Strip, x: Array) -> Array:
    """Return the distances (2, ...) of the left and the right drawn edge from the axis, mm."""
    return np.stack([height_at(edge, x) for edge in (strip.left, strip.right)])


def edge_positions(profile: Profile, x: Array) -> Array:
    """Return the distances (2, n) of the left and the right edge from the axis, mm."""
    half = profile.height(x) / 2
    middle = profile.middle(x)
    return np.stack([half + middle, half - middle])


def _gentle(strip: Strip) -> tuple[float, float]:
    """Return the positions between which both edges are not nearly upright."""
    low = strip.low
    high = strip.high
    for edge in (strip.left, strip.right):
        for segment in edge:
            if segment.centre is None or segment.turn == 0:
                continue
            start = cmath.phase(complex(segment.tangent(0.0)))
            if start < -NEARLY_UPRIGHT:
                low = max(low, complex(segment.at((-NEARLY_UPRIGHT - start) / segment.turn)).real)
            if start + segment.turn > NEARLY_UPRIGHT:
                high = min(high, complex(segment.at((NEARLY_UPRIGHT - start) / segment.turn)).real)
    return low, high
