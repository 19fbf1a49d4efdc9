"""The drawn parts of a plate mechanism: hinges in place, the boxes cut for them, and checks before
anything is meshed.

Points are complex, mm.
"""

from __future__ import annotations

import cmath
import math
import re
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
import shapely
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.edges import Curve, backwards, mapped
from flexfem.mechanism.layout import Body, Joint, Layout
from flexfem.mechanism.outlines import SHORTEST, Segment, area, polygon_points, polyline
from flexfem.mechanism.profile_shape import FIRST, LEFT
from flexfem.refused import BadInput

TOUCHING = 1e-3  # mm; parts at a smaller distance count as one, and their hinge would be lost
SMALL = 1e-4  # the same per size of a small plate
ROUGHLY = 0.01  # of the length of a hinge; an angle in radians is a rounded number
REACHED = 1e-6  # mm, between the end of a hinge and its body
STEP = np.pi / 512  # rad, of the polygons of parts: 0.5 um from an arc of 100 mm
GRID = (
    1e-6  # mm, of the coordinates of a whole plate, whose parts differ by round-off where they meet
)
ROUNDED = 1e-9  # mm, the same of two parts
SLIVER = 1e-6  # mm^2; a smaller area is round-off
ALONG = (
    np.sin(np.linspace(-np.pi / 2, np.pi / 2, 129)) / 2
)  # positions on the axis of a hinge, per length
ENDING = np.sin(
    np.linspace(np.pi / 3, np.pi / 2, 400)
)  # the same towards its end, per half the length
HEIGHTS = np.linspace(-1, 1, 9)  # across its end, per half the height
STEEP = 60.0  # degrees, slope of an edge beyond which `end_lines` leave it
# the same at a rigid body: corners held from 60 degrees on shifted a drift by 1.4e-4 of it
STEEP_AT_GROUND = 80.0
SLOPE_ROUND_OFF = 1e-6  # relative: straight flanks at 60 degrees are not steep
EDGE_ROUND_OFF = 1e-9  # relative to length or height, of points on the edge of a hinge
OVERSHOOT = 0.02  # of a line across a hinge beyond its edge, per length of the line
SIDES = (-1, 1)  # ends of a hinge at its first and second body
INSIDE = np.abs(ALONG) < 0.4  # of them, away from the ends of the hinge
# length of a part that is narrower than the least width, per this width, above which it is no tip
LONG = 20.0
# mean width of such a part, per least width, below which it is no tip, whose mean width is a half
THIN = 0.25
# of a neck, distance of a point beside a corner of a hinge that its body contains if it is wider
# there
PROBE = 0.05
BISECTIONS = 30  # of the width that a refusal states
PER_SQUARE_OF_HINGE = 17
PER_SQUARE_OF_BODY = 37  # triangles with 8 across the necks, see `triangles_needed`
PER_HINGE = 2500
PER_HOLE = 330  # the same around a hinge, and a small hole among others
MOST_TRIANGLES = 800_000  # with 8 across the necks; they take a minute to mesh


def _position(joint: Joint, z: complex) -> complex:
    """Return the position of a point given in the frame of a hinge."""
    return joint.place + z * cmath.exp(1j * joint.heading)


def _middle_point(joint: Joint, x: float) -> complex:
    """Return the middle between the edges of a profile at a position on its axis, in the frame of
    the hinge.
    """
    return complex(x, float(joint.profile.middle(np.array(x))))


def _half_height(joint: Joint, x: float) -> float:
    return float(joint.profile.height(np.array(x))) / 2


def _corners(joint: Joint, side: int) -> tuple[complex, complex]:
    """Return the left and right corner of a profile at its near (-1) or far end (1), in the frame
    of the hinge.
    """
    x = side * joint.profile.length / 2
    middle = _middle_point(joint, x)
    half_height = 1j * _half_height(joint, x)
    return middle + half_height, middle - half_height


def joint_loop(joint: Joint) -> list[Curve]:
    """Return the closed counter-clockwise loop of a hinge: right edge, far end, left edge, near
    end.
    """
    left, right = joint.profile.edges()
    near_left, near_right = _corners(joint, -1)
    far_left, far_right = _corners(joint, 1)
    loop = [
        *right,
        Segment(far_right, far_left),
        *map(backwards, reversed(left)),
        Segment(near_left, near_right),
    ]
    return [mapped(curve, partial(_position, joint)) for curve in loop]


def section_middle(joint: Joint) -> complex:
    """Return the middle of the section of a hinge that edges of triangles follow, in the frame of
    the hinge.
    """
    return _middle_point(joint, joint.profile.section)


def neck_line(joint: Joint) -> Segment:
    """Return the section of a hinge that edges of triangles follow, and a little beyond its edges."""
    middle = section_middle(joint)
    high = 1j * (1 + OVERSHOOT) * _half_height(joint, joint.profile.section)
    return Segment(_position(joint, middle - high), _position(joint, middle + high))


def end_corners(joint: Joint, side: int) -> tuple[complex, complex]:
    """Return both corners of a hinge, left and right, at its first (`side` = -1) or second (1)
    body.
    """
    left, right = _corners(joint, side)
    return _position(joint, left), _position(joint, right)


def in_hinge(joint: Joint, z: AnyArray) -> NDArray[np.bool_]:
    """Return which points (...) lie in a hinge: within its length and its height, with its edges
    but not its ends.
    """
    local = (z - joint.place) * cmath.exp(-1j * joint.heading)
    within = np.abs(local.real) < joint.profile.length / 2 * (1 - EDGE_ROUND_OFF)
    half_height = joint.profile.height(local.real) / 2
    off_middle = np.abs(local.imag - joint.profile.middle(local.real))
    return np.asarray(within & (off_middle <= half_height * (1 + EDGE_ROUND_OFF)))


def end_lines(joint: Joint, side: int, rigid: bool = False) -> list[Segment]:
    """Return the lines along which the mesh divides a hinge from its first (`side` = -1) or second
    (1) body.

    They are the end of the hinge, except where the edge of the profile is steep there: a triangle
    between them would be a needle. The lines then leave the edge where it gets steeper than 60
    degrees, at a `rigid` body than 80 degrees, and the triangles of the corner beyond them are
    those of the body. The corner is still a part of the hinge: means over the body leave it out,
    see `in_hinge`."""
    profile = joint.profile
    half = joint.profile.length / 2
    breaks = side * np.array(profile.breaks)
    x = np.union1d(half * ENDING, breaks[breaks > half * ENDING[0]])
    x = x[
        np.diff(x, prepend=-np.inf) > SHORTEST
    ]  # two positions that differ by round-off have no slope between them
    half_height = profile.height(side * x) / 2
    middle = side * profile.middle(side * x)
    steepest = np.tan(np.deg2rad(STEEP_AT_GROUND if rigid else STEEP)) * (1 + SLOPE_ROUND_OFF)
    left = _from_edge(half, x, half_height + middle, half_height, steepest)
    right = [
        z.conjugate() for z in _from_edge(half, x, half_height - middle, half_height, steepest)
    ]
    return polyline(*(_position(joint, side * z) for z in (*left, *reversed(right))))


def _from_edge(
    end: float, x: Array, edge: Array, half_height: Array, steepest: float
) -> list[complex]:
    """Return the points of the end of a hinge from its left edge inwards, as in `end_lines`.

    x : (n,), positions towards the end.   edge, half_height : (n,), mm, distance of the edge from
    the axis and half the height.   steepest : slope beyond which the edge is left."""
    gentle = np.flatnonzero(np.diff(edge) <= steepest * np.diff(x))
    leave = gentle[-1] + 1 if len(gentle) else 0
    rest = end - x[leave]
    if leave == len(x) - 1 or half_height[leave] <= rest:
        return [complex(end, edge[-1])]
    start = complex(x[leave], edge[leave])
    corner = complex(end, edge[leave] - rest)
    return [start + OVERSHOOT * (start - corner), corner]


def cut_box(joint: Joint) -> list[Segment]:
    """Return the counter-clockwise loop of the box that a hinge cuts from its two bodies."""
    half = joint.profile.length / 2
    high = 0.5j * joint.cut
    corners = (-half - high, half - high, half + high, -half + high, -half - high)
    return polyline(*(_position(joint, z) for z in corners))


def cuts_of(layout: Layout, body: int) -> list[list[Segment]]:
    """Return the boxes that hinges cut from a body."""
    return [cut_box(joint) for joint in layout.joints if joint.cut and body in joint.bodies]


def check_layout(layout: Layout) -> None:
    """Raise BadInput unless hinges alone connect the bodies, and connect each of them to ground."""
    bodies = [_checked_polygon(layout, index) for index in range(len(layout.bodies))]
    shapely.prepare(bodies)
    outlines = bodies + [joint_polygon(joint) for joint in layout.joints]
    touching = min(TOUCHING, SMALL * extent(outlines))
    for joint in layout.joints:
        _check_ends(layout, joint, bodies)
    parts = [*layout.bodies, *layout.joints]
    ranges = (ALONG[INSIDE], ALONG * (1 - REACHED))
    inner = [[joint_polygon(joint, shares) for shares in ranges] for joint in layout.joints]
    found = shapely.STRtree(outlines).query(
        np.array(outlines), predicate="dwithin", distance=touching
    )
    for i, j in found.T[found[0] < found[1]].tolist():
        one = parts[i]
        other = parts[j]
        if isinstance(other, Joint) and i in other.bodies:
            side, within = inner[j - len(bodies)]
            apart = not shapely.intersects(
                bodies[i], within
            )  # a hundred times as fast as the common area
            if not shapely.dwithin(bodies[i], side, touching) and (
                apart or _common(bodies[i], outlines[j]) < SLIVER
            ):
                continue
            raise BadInput(
                f"{_key(other)}: touches {one.name} along its side, expected a higher cut"
            )
        shared = _common(outlines[i], outlines[j])
        how = (
            f"overlaps {other.name} by {shared:.3g} mm^2"
            if shared > SLIVER
            else f"touches {other.name}"
        )
        raise BadInput(f"{_key(one)}: {how}, expected parts that only hinges connect")
    _check_grounded(layout)
    for body, polygon in zip(layout.bodies, bodies, strict=True):
        _check_widths(body, polygon, touching)
    triangles_needed(layout, refuse=True)


def _check_widths(body: Body, polygon: Any, least: float) -> None:
    """Raise BadInput for material, a slit or a hole that is narrower than the least width, mm."""
    rings = np.array([polygon.exterior, *polygon.interiors])
    near = shapely.STRtree(rings).query(rings, predicate="dwithin", distance=least)
    for one, other in rings[near.T[near[0] < near[1]]]:
        line = shapely.shortest_line(one, other)
        where = "between a hole and its edge" if one is rings[0] else "between two holes"
        raise _too_narrow(
            body, "is", where, _Narrow(shapely.centroid(line), shapely.length(line)), least
        )
    outer = shapely.Polygon(rings[0])
    around = shapely.box(*(outer.bounds + extent(outer) * np.array([-1, -1, 1, 1])))
    void = shapely.Polygon(around.exterior, [rings[0]])
    faces = [
        ("is", outer),
        ("has a slit", void),
        *(("has a hole", shapely.Polygon(ring)) for ring in rings[1:]),
    ]
    for what, face in faces:
        if narrow := _narrow_place(face, least):
            raise _too_narrow(body, what, "", narrow, least)


class _Narrow(NamedTuple):
    """A point where a polygon is narrow, and its width there, mm."""

    place: Any
    width: float


def _too_narrow(body: Body, what: str, where: str, narrow: _Narrow, least: float) -> BadInput:
    x = narrow.place.x + 0.0
    y = narrow.place.y + 0.0  # not -0
    near = f"{where} near ({x:.6g}, {y:.6g}) mm".lstrip()
    return BadInput(
        f"{_key(body)}: {what} {narrow.width:.3g} mm wide {near}, expected at least {least:.3g} mm"
    )


def _narrow_place(face: Any, least: float) -> _Narrow | None:
    """Return where a polygon is narrower than a width, mm; None where it is not, or has sharp tips
    alone.
    """
    pieces = shapely.get_parts(eroded := shapely.buffer(face, -least / 2))
    if len(pieces) != 1:
        low = math.log(SHORTEST)
        high = math.log(least)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            is_whole = len(shapely.get_parts(shapely.buffer(face, -math.exp(middle) / 2))) == 1
            low, high = (middle, high) if is_whole else (low, middle)
        place = shapely.shortest_line(pieces[0], pieces[1]) if len(pieces) else face
        return _Narrow(shapely.centroid(place), math.exp(high))
    opened = shapely.buffer(eroded, least / 2 * (1 + OVERSHOOT))
    if (
        shapely.length(face) - shapely.length(opened) < LONG * least
    ):  # without the difference, which takes longer
        return None
    lost = shapely.get_parts(shapely.difference(face, opened))
    length = shapely.length(lost) / 2
    narrow = lost[(length > LONG * least) & (shapely.area(lost) < THIN * least * length)]
    if not len(narrow):
        return None
    return _Narrow(
        shapely.point_on_surface(narrow[0]),
        float(2 * shapely.area(narrow[0]) / shapely.length(narrow[0])),
    )


def triangles_needed(layout: Layout, refuse: bool = False) -> float:
    """Estimate the triangles of a mesh with 8 across every neck.

    Their size follows the height of hinges, and in bodies the mean width `w`; so there are as many
    for each square that a part could be cut into, `int dx / h` or `area / w^2`, and more at hinges
    and holes. With `refuse`, raises BadInput for too many."""
    needed = list[tuple[float, Body | Joint]]()
    for body in layout.bodies:
        squares = 0.0 if body.fixed else _face_area(body) / (body.width or mean_width(body)) ** 2
        needed.append((PER_SQUARE_OF_BODY * squares + PER_HOLE * len(body.holes), body))
    for joint in layout.joints:
        x, weights = joint.profile.quadrature
        needed.append(
            (
                PER_HINGE + PER_SQUARE_OF_HINGE * float(np.sum(weights / joint.profile.height(x))),
                joint,
            )
        )
    total = sum(count for count, _ in needed)
    if refuse and total > MOST_TRIANGLES:
        most, part = max(needed, key=lambda each: each[0])
        width = part.profile.neck if isinstance(part, Joint) else part.width or mean_width(part)
        is_slender = not (isinstance(part, Body) and part.holes) and most > 2 * PER_HINGE
        remedy = (
            f"{width * total / MOST_TRIANGLES:.2g} mm or a smaller length"
            if is_slender
            else "fewer holes and hinges"
        )
        raise BadInput(
            f"{_key(part)}: finite elements need about {total:.2g} triangles, {most:.2g} of them "
            f"for {part.name}, {width:.3g} mm wide, expected at most {MOST_TRIANGLES:.2g}, as "
            f"with {remedy}"
        )
    return total


def _face_area(body: Body) -> float:
    return sum(map(area, (body.outline, *body.holes)))


def mean_width(body: Body) -> float:
    """Twice the area per length of its edges, mm: the width of a long body."""
    loops = (body.outline, *body.holes)
    return 2 * _face_area(body) / sum(segment.length for loop in loops for segment in loop)


def _key(part: Body | Joint) -> str:
    return part.key or part.name


def _common(one: shapely.Geometry, other: shapely.Geometry) -> float:
    """Return the common area, mm^2, with rounded coordinates: else GEOS finds areas of polygons
    that share an edge.
    """
    return float(shapely.area(shapely.intersection(one, other, grid_size=ROUNDED)))


def has_sharp_corner(layout: Layout, joint: Joint) -> bool:
    """Whether a hinge has an inner corner without a radius, in its own edge or where its edge meets
    a body.

    There is none where the edge goes on as the side of the body, or the body is at most 5 % of the
    neck wider."""
    if joint.profile.sharp:
        return True
    for corner in joint.profile.bare_corners:
        end, side = corner.split()
        towards = -1 if end == FIRST else 1
        outwards = 1 if side == LEFT else -1
        left, right = _corners(joint, towards)
        near = PROBE * joint.profile.neck * complex(towards, outwards)
        beyond = _position(joint, (left if side == LEFT else right) + near)
        body = joint.bodies[0 if end == FIRST else 1]
        if shapely.intersects_xy(
            body_polygon(layout, body, refuse=False), beyond.real, beyond.imag
        ):
            return True
    return False


def joint_polygon(joint: Joint, shares: Array = ALONG) -> Any:
    """Return the polygon of a hinge between positions on its axis, per length."""
    x = shares * joint.profile.length
    breaks = np.array(joint.profile.breaks)
    x = np.union1d(x, breaks[(breaks > x[0]) & (breaks < x[-1])])
    middle = x + 1j * joint.profile.middle(x)
    half_height = 0.5j * joint.profile.height(x)
    edges = np.concatenate([middle + half_height, (middle - half_height)[::-1]])
    z = joint.place + edges * cmath.exp(1j * joint.heading)
    return shapely.Polygon(np.column_stack([z.real, z.imag]))


def clashes(layout: Layout, refusal: BadInput) -> list[Any]:
    """Return the polygons of what a refusal is about: a part with it as key, all overlaps, or parts
    that it names.
    """
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    outlines = np.array([*bodies, *map(joint_polygon, layout.joints)])
    keys = [*map(_key, layout.bodies), *map(_key, layout.joints)]
    i, j = shapely.STRtree(outlines).query(outlines, predicate="intersects")
    shared = shapely.get_parts(
        shapely.intersection(outlines[i[i < j]], outlines[j[i < j]], grid_size=ROUNDED)
    )
    undrawn = outlines[[key == refusal.reason for key in keys]]
    named = outlines[
        [re.match(f"{re.escape(key)}[:.]", refusal.reason) is not None for key in keys]
    ]
    found = (undrawn, shared[shapely.area(shared) > SLIVER], named)
    return list(shapely.get_parts(next(filter(len, found), named)))


def body_polygon(layout: Layout, index: int, refuse: bool = True) -> Any:
    """Return the polygon of a body less the boxes of its hinges.

    Raises BadInput for loops that meet; without `refuse`, for drawings, returns what they enclose.
    """
    body = layout.bodies[index]
    drawn: Any = shapely.Polygon(
        polygon_points(body.outline, STEP), [polygon_points(hole, STEP) for hole in body.holes]
    )
    if not shapely.is_valid(drawn) and not refuse:
        drawn = shapely.make_valid(drawn, method="structure", keep_collapsed=False)
    elif not shapely.is_valid(drawn):
        raise BadInput(_fault_of_loops(body, drawn))
    boxes = [shapely.Polygon(polygon_points(cut)) for cut in cuts_of(layout, index)]
    left = shapely.difference(drawn, shapely.union_all(boxes))
    return left if refuse or left.area else drawn


def _fault_of_loops(body: Body, drawn: Any) -> str:
    """Return what is wrong with a body whose outline and holes are not those of one polygon."""
    outline = shapely.Polygon(drawn.exterior)
    holes = [shapely.Polygon(hole) for hole in drawn.interiors]
    loops = {_key(body): outline} | {
        f"{_key(body)}.holes[{k}]": hole for k, hole in enumerate(holes)
    }
    for key, loop in loops.items():
        if not shapely.is_valid(loop):  # the reason is such as Self-intersection[1.5 8]
            reason, _, found = shapely.is_valid_reason(loop).rstrip("]").partition("[")
            where = ", ".join(f"{float(each):g}" for each in found.split())
            return (
                f"{key}: {reason.lower()} at {where}, expected an outline that does not meet itself"
            )
    for k, hole in enumerate(holes):
        place = hole.centroid
        where = f"{_key(body)}.holes[{k}]: the hole around {place.x:g}, {place.y:g}"
        if not shapely.contains_properly(outline, hole):
            side = "crosses the edge of" if shapely.intersects(outline, hole) else "is outside"
            return f"{where} {side} the body, expected a hole inside it"
        for other in range(k):
            if shapely.intersects(holes[other], hole):
                return f"{where} meets holes[{other}], expected holes that do not meet"
    return (
        f"{_key(body)}: {shapely.is_valid_reason(drawn)}, expected an outline and holes that do "
        "not meet"
    )


def plate_polygon(layout: Layout) -> Any:
    """Return the polygons of the whole plate, for drawings of what encloses them where loops meet."""
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    return shapely.union_all([*bodies, *map(joint_polygon, layout.joints)], grid_size=GRID)


def plate_mass(layout: Layout) -> float:
    """Return the mass of a whole plate, tonne."""
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    areas = shapely.area(np.array([*bodies, *map(joint_polygon, layout.joints)]))
    return layout.thickness * float(
        areas @ np.array([material.density for material in layout.materials])
    )


def size_of(layout: Layout) -> float:
    """Return the larger extent of a whole plate in x and y, mm, without joining its parts."""
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    return extent([*bodies, *map(joint_polygon, layout.joints)])


def extent(shape: Any) -> float:
    """Return the larger extent in x and y, mm, of one or several polygons."""
    left, low, right, high = shapely.total_bounds(shape)
    return float(max(right - left, high - low))


def _checked_polygon(layout: Layout, index: int) -> Any:
    """Return the polygon of a body as `body_polygon`. Raises BadInput unless it is one piece."""
    body = layout.bodies[index]
    left = body_polygon(layout, index)
    pieces = [piece for piece in shapely.get_parts(left) if piece.area > SLIVER]
    if len(pieces) != 1:
        what = f"in {len(pieces)} pieces" if pieces else "nothing"
        found = (
            f"{_key(body)}: is {what} after the cuts for its "
            f"hinges{_largest_cut(layout, index, left)}"
        )
        raise BadInput(f"{found}, expected one piece from hinge to hinge")
    return pieces[0]


def _largest_cut(layout: Layout, index: int, left: Any) -> str:
    """Return a remark on the cut that divides a body or removes it: the one without which fewest
    pieces are left.
    """
    cutting = [joint for joint in layout.joints if joint.cut and index in joint.bodies]
    if not cutting:
        return ""

    def left_without(joint: Joint) -> tuple[int, float]:
        others = tuple(each for each in layout.joints if each is not joint)
        kept = shapely.get_parts(body_polygon(layout._replace(joints=others), index))
        return sum(piece.area > SLIVER for piece in kept) or len(layout.joints), -float(
            shapely.area(kept).sum()
        )

    joint = min(cutting, key=left_without)
    return (
        f" (most by {_key(joint)}, whose cut_mm is {joint.cut:g} and may be as low as "
        f"{joint.profile.least_cut:g})"
    )


def _end_points(joint: Joint, side: int) -> Any:
    """Return points across the first (`side` = -1) or second (1) end of a hinge."""
    x = side * joint.profile.length / 2
    middle = _middle_point(joint, x)
    half_height = 1j * _half_height(joint, x)
    z = np.array([_position(joint, middle + share * half_height) for share in HEIGHTS])
    return shapely.points(z.real, z.imag)


def _meant_in_radians(layout: Layout, joint: Joint) -> bool:
    """Return whether a hinge reaches its bodies if its direction in degrees is read in radians."""
    degrees = math.degrees(joint.heading)
    if abs(degrees) > 2 * math.pi:
        return False
    turned = joint._replace(heading=degrees)
    others = [each for each in layout.joints if each is not joint]
    drawn = layout._replace(joints=(turned, *others))
    bodies = [body_polygon(drawn, body, refuse=False) for body in joint.bodies]
    near = [
        shapely.distance(body, _end_points(turned, side))
        for body, side in zip(bodies, SIDES, strict=True)
    ]
    return bool(np.max(near) <= ROUGHLY * joint.profile.length)


def _check_ends(layout: Layout, joint: Joint, bodies: list[Any]) -> None:
    """Raise BadInput unless both ends of a hinge lie on its bodies, over their whole height."""

    ends = [_end_points(joint, side) for side in SIDES]
    first, second = ([bodies[body]] for body in joint.bodies)
    if np.all(shapely.dwithin([first, second], ends, REACHED)):
        return
    names = [layout.bodies[body].name for body in joint.bodies]
    if np.all(shapely.dwithin([second, first], ends, REACHED)):
        raise BadInput(
            f"{_key(joint)}: its axis points from {names[1]} to {names[0]}, expected the opposite "
            "direction"
        )
    gaps = shapely.distance([first, second], ends)
    for side, name, gap in zip(SIDES, names, gaps, strict=True):
        if np.min(gap) > REACHED:
            degrees = math.degrees(joint.heading)
            drawn = f"its length is {joint.profile.length:g} mm and its direction {degrees:.6g} deg"
            turned = (
                f"{drawn}, read in radians it would reach"
                if _meant_in_radians(layout, joint)
                else drawn
            )
            raise BadInput(
                f"{_key(joint)}: ends {np.min(gap):.3g} mm before {name}, expected to reach it; "
                f"{turned}"
            )
        if np.max(gap) > REACHED:
            where = (
                f"is {2 * _half_height(joint, side * joint.profile.length / 2):.6g} mm high at "
                f"{name}"
            )
            raise BadInput(
                f"{_key(joint)}: {where}, expected an end that lies on this body over its whole "
                "height"
            )


def _check_grounded(layout: Layout) -> None:
    """Raise BadInput unless hinges connect every body to one that is fixed or clamped."""
    for text in ungrounded(layout):
        raise BadInput(text)


def ungrounded(layout: Layout) -> list[str]:
    """Return what is missing between bodies and the ground: a fixed body, or hinges that lead to
    one.
    """
    held = {index for index, body in enumerate(layout.bodies) if body.fixed or body.clamped}
    if not held:
        return ["no body is fixed, expected fixed = true or clamped_edges in a body"]
    found = list[str]()
    for component in components(layout):
        if not component & held:
            body = layout.bodies[min(component)]
            what = "no fixed or clamped body" if len(component) > 1 else "no other body"
            found.append(
                f"{_key(body)}: hinges connect it to {what}, expected a connection to ground"
            )
    return found


def components(layout: Layout) -> list[set[int]]:
    """Return the sets of bodies that hinges connect."""
    joined = [joint.bodies for joint in layout.joints if min(joint.bodies) >= 0]
    first, second = np.array(joined, dtype=np.int64).reshape(-1, 2).T
    links = sp.coo_array((np.ones(len(first)), (first, second)), shape=2 * (len(layout.bodies),))
    count, number = connected_components(links, directed=False)
    return [set(np.flatnonzero(number == k).tolist()) for k in range(count)]
