"""Checks that a plate can be made, before anything is meshed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.mechanism.hinge_place import (
    ALONG,
    OVERSHOOT,
    SIDES,
    half_height_at,
    joint_polygon,
    middle_point,
    position,
)
from flexfem.mechanism.layout import Body, Joint, Layout
from flexfem.mechanism.outlines import SHORTEST
from flexfem.mechanism.plate import (
    INSIDE,
    SLIVER,
    body_polygon,
    common_area,
    components,
    extent,
    face_area,
    key_of_part,
    mean_width,
)
from flexfem.refused import BadInput

TOUCHING = 1e-3  # mm; parts at a smaller distance count as one, and their hinge would be lost
SMALL = 1e-4  # the same per size of a small plate
ROUGHLY = 0.01  # of the length of a hinge; an angle in radians is a rounded number
REACHED = 1e-6  # mm, between the end of a hinge and its body
HEIGHTS = np.linspace(-1, 1, 9)  # across the end of a hinge, per half the height
# length of a part that is narrower than the least width, per this width, above which it is no tip
LONG = 20.0
# mean width of such a part, per least width, below which it is no tip, whose mean width is a half
THIN = 0.25
BISECTIONS = 30  # of the width that a refusal states
# triangles with 8 across the necks, see `triangles_needed`
PER_SQUARE_OF_HINGE = 17
PER_SQUARE_OF_BODY = 37
PER_HINGE = 2500  # around a hinge
PER_HOLE = 330  # around a small hole among others
MOST_TRIANGLES = 800_000  # they take a minute to mesh


def check_layout(layout: Layout) -> None:
    """Raise BadInput unless hinges alone connect the bodies, and connect each of them to ground."""
    bodies = [_checked_polygon(layout, index) for index in range(len(layout.bodies))]
    shapely.prepare(bodies)
    hinges = [joint_polygon(joint) for joint in layout.joints]
    touching = min(TOUCHING, SMALL * extent(bodies + hinges))
    for joint in layout.joints:
        _check_ends(layout, joint, bodies)
    _check_contacts(layout, bodies, hinges, touching)
    _check_grounded(layout)
    for body, polygon in zip(layout.bodies, bodies, strict=True):
        _check_widths(body, polygon, touching)
    triangles_needed(layout, refuse=True)


def _check_contacts(
    layout: Layout,
    bodies: list[Any],
    hinges: list[Any],
    touching: float,
) -> None:
    """Raise BadInput for parts nearer than `touching`, mm, but hinges with their bodies."""
    outlines = bodies + hinges
    tree = shapely.STRtree(outlines)
    near = tree.query(np.array(outlines), predicate="dwithin", distance=touching)
    for i, j in near.T[near[0] < near[1]].tolist():
        one = layout.parts[i]
        other = layout.parts[j]
        if isinstance(other, Joint) and i in other.bodies:
            if _touches_side(bodies[i], other, outlines[j], touching):
                raise BadInput(
                    f"{key_of_part(other)}: touches {one.name} along its side, expected a higher "
                    "cut_mm"
                )
            continue
        reach = shapely.buffer(outlines[i], touching)
        beside = _beside_hinge(layout, {i, j}, shapely.intersection(reach, outlines[j]))
        if beside is not None:
            raise BadInput(beside)
        shared = common_area(outlines[i], outlines[j])
        how = f"touches {other.name}"
        if shared > SLIVER:
            how = f"overlaps {other.name} by {shared:.3g} mm^2"
        expected = "expected parts that only hinges connect"
        raise BadInput(f"{key_of_part(one)}: {how}, {expected}")


def _beside_hinge(
    layout: Layout,
    bodies: set[int],
    contact: Any,
) -> str | None:
    """Return a refusal of two bodies whose contact is what the cut of their hinge leaves beside it.

    None is returned for every other contact.
    """
    points = shapely.get_coordinates(contact) @ [1, 1j]
    for joint in layout.joints:
        if not joint.cut or bodies != set(joint.bodies):
            continue
        local = (points - joint.place) * np.exp(-1j * joint.heading)
        if np.max(np.abs(local.real), initial=0) > joint.profile.length / 2:
            continue
        first, second = (layout.bodies[body].name for body in joint.bodies)
        needed = 2 * np.max(np.abs(local.imag), initial=0) * (1 + OVERSHOOT)
        return (
            f"{key_of_part(joint)}: leaves {first} and {second} connected beside it, as its cut_mm is "
            f"{joint.cut:.4g}, expected {needed:.3g} or more"
        )
    return None


def _touches_side(
    body: Any,
    joint: Joint,
    hinge: Any,
    touching: float,
) -> bool:
    """Return whether a hinge meets its body elsewhere than at its end."""
    if shapely.dwithin(body, joint_polygon(joint, ALONG[INSIDE]), touching):
        return True
    within = joint_polygon(joint, ALONG * (1 - REACHED))
    if not shapely.intersects(body, within):  # a hundred times as fast as the common area
        return False
    return common_area(body, hinge) >= SLIVER


def _check_widths(
    body: Body,
    polygon: Any,
    least: float,
) -> None:
    """Raise BadInput for material, a slit or a hole that is narrower than the least width, mm."""
    rings = np.array([polygon.exterior, *polygon.interiors])
    near = shapely.STRtree(rings).query(rings, predicate="dwithin", distance=least)
    for one, other in rings[near.T[near[0] < near[1]]]:
        line = shapely.shortest_line(one, other)
        where = "between a hole and its edge" if one is rings[0] else "between two holes"
        narrow = _Narrow(shapely.centroid(line), shapely.length(line))
        raise _too_narrow(body, "is", where, narrow, least)
    outer = shapely.Polygon(rings[0])
    around = shapely.box(*(outer.bounds + extent(outer) * np.array([-1, -1, 1, 1])))
    void = shapely.Polygon(around.exterior, [rings[0]])
    holes = [("has a hole", shapely.Polygon(ring)) for ring in rings[1:]]
    for what, face in [("is", outer), ("has a slit", void), *holes]:
        place = _narrow_place(face, least)
        if place is not None:
            raise _too_narrow(body, what, "", place, least)


class _Narrow(NamedTuple):
    """A point where a polygon is narrow, and its width there, mm."""

    place: Any
    width: float


def _too_narrow(
    body: Body,
    what: str,
    where: str,
    narrow: _Narrow,
    least: float,
) -> BadInput:
    x = narrow.place.x + 0.0
    y = narrow.place.y + 0.0  # not -0
    near = f"{where} near ({x:.6g}, {y:.6g}) mm".lstrip()
    found = f"{what} {narrow.width:.3g} mm wide {near}"
    return BadInput(f"{key_of_part(body)}: {found}, expected at least {least:.3g} mm")


def _narrow_place(face: Any, least: float) -> _Narrow | None:
    """Return where a polygon is narrower than a width, mm.

    None is returned where it is not, or has sharp tips alone.
    """
    eroded = shapely.buffer(face, -least / 2)
    pieces = shapely.get_parts(eroded)
    if len(pieces) != 1:
        place = shapely.shortest_line(pieces[0], pieces[1]) if len(pieces) else face
        return _Narrow(shapely.centroid(place), _least_width(face, least))
    opened = shapely.buffer(eroded, least / 2 * (1 + OVERSHOOT))
    if shapely.length(face) - shapely.length(opened) < LONG * least:
        return None  # without the difference, which takes longer
    lost = shapely.get_parts(shapely.difference(face, opened))
    length = shapely.length(lost) / 2
    narrow = lost[(length > LONG * least) & (shapely.area(lost) < THIN * least * length)]
    if not len(narrow):
        return None
    width = 2 * shapely.area(narrow[0]) / shapely.length(narrow[0])
    return _Narrow(shapely.point_on_surface(narrow[0]), float(width))


def _least_width(face: Any, most: float) -> float:
    """Return the width, mm, up to `most`, by which a polygon can be eroded and stays one piece."""
    low = math.log(SHORTEST)
    high = math.log(most)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if len(shapely.get_parts(shapely.buffer(face, -math.exp(middle) / 2))) == 1:
            low = middle
        else:
            high = middle
    return math.exp(high)


def triangles_needed(layout: Layout, refuse: bool = False) -> float:
    """Estimate the triangles of a mesh with 8 across every neck.

    Their size follows the height of hinges, and in bodies the mean width `w`; so there are as many
    for each square that a part could be cut into, `int dx / h` or `area / w^2`, and more at hinges
    and holes. With `refuse`, raises BadInput for too many.
    """
    needed = [(_triangles_of(part), part) for part in layout.parts]
    total = sum(count for count, _ in needed)
    if refuse and total > MOST_TRIANGLES:
        raise _too_many(total, *max(needed, key=lambda each: each[0]))
    return total


def _triangles_of(part: Body | Joint) -> float:
    """Estimate the triangles of a body or a hinge."""
    if isinstance(part, Joint):
        x, weights = part.profile.quadrature
        squares = float(np.sum(weights / part.profile.height(x)))
        return PER_HINGE + PER_SQUARE_OF_HINGE * squares
    squares = 0.0 if part.fixed else face_area(part) / (part.width or mean_width(part)) ** 2
    return PER_SQUARE_OF_BODY * squares + PER_HOLE * len(part.holes)


def _too_many(
    total: float,
    most: float,
    part: Body | Joint,
) -> BadInput:
    """Return the refusal of too many triangles, most of which are those of a part."""
    width = part.profile.neck if isinstance(part, Joint) else part.width or mean_width(part)
    has_holes = isinstance(part, Body) and part.holes
    remedy = "fewer holes and hinges"
    if not has_holes and most > 2 * PER_HINGE:
        remedy = f"{width * total / MOST_TRIANGLES:.2g} mm or a smaller length"
    return BadInput(
        f"{key_of_part(part)}: finite elements need about {total:.2g} triangles, {most:.2g} of "
        f"them for {part.name}, {width:.3g} mm wide, expected at most {MOST_TRIANGLES:.2g}, as "
        f"with {remedy}"
    )


def _checked_polygon(layout: Layout, index: int) -> Any:
    """Return the polygon of a body as `body_polygon`. Raises BadInput unless it is one piece."""
    left = body_polygon(layout, index)
    pieces = [piece for piece in shapely.get_parts(left) if piece.area > SLIVER]
    if len(pieces) == 1:
        return pieces[0]
    what = f"in {len(pieces)} pieces" if pieces else "nothing"
    remark = _largest_cut(layout, index)
    raise BadInput(
        f"{key_of_part(layout.bodies[index])}: is {what} after the cuts for its hinges{remark}, "
        "expected one piece from hinge to hinge"
    )


def _largest_cut(layout: Layout, index: int) -> str:
    """Return a remark on the cut that divides a body or removes it.

    It is the one without which fewest pieces are left.
    """
    cutting = [joint for joint in layout.joints if joint.cut and index in joint.bodies]
    if not cutting:
        return ""

    def left_without(joint: Joint) -> tuple[int, float]:
        others = tuple(each for each in layout.joints if each is not joint)
        kept = shapely.get_parts(body_polygon(layout._replace(joints=others), index))
        pieces = sum(piece.area > SLIVER for piece in kept)
        return pieces or len(layout.joints), -float(shapely.area(kept).sum())

    joint = min(cutting, key=left_without)
    return (
        f" (most by {key_of_part(joint)}, whose cut_mm is {joint.cut:g} and may be as low as "
        f"{joint.profile.least_cut:g})"
    )


def _end_points(joint: Joint, side: int) -> Any:
    """Return points across the first (`side` = -1) or second (1) end of a hinge."""
    x = side * joint.profile.length / 2
    middle = middle_point(joint, x)
    half_height = 1j * half_height_at(joint, x)
    z = np.array([position(joint, middle + share * half_height) for share in HEIGHTS])
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


def _check_ends(
    layout: Layout,
    joint: Joint,
    bodies: list[Any],
) -> None:
    """Raise BadInput unless both ends of a hinge lie on its bodies, over their whole height."""
    ends = [_end_points(joint, side) for side in SIDES]
    first, second = ([bodies[body]] for body in joint.bodies)
    if np.all(shapely.dwithin([first, second], ends, REACHED)):
        return
    key = key_of_part(joint)
    names = [layout.bodies[body].name for body in joint.bodies]
    if np.all(shapely.dwithin([second, first], ends, REACHED)):
        found = f"its axis points from {names[1]} to {names[0]}"
        raise BadInput(f"{key}: {found}, expected the opposite direction")
    gaps = shapely.distance([first, second], ends)
    for side, name, gap in zip(SIDES, names, gaps, strict=True):
        if np.min(gap) > REACHED:
            raise BadInput(
                f"{key}: ends {np.min(gap):.3g} mm before {name}, expected to reach it; "
                f"{_as_drawn(layout, joint)}"
            )
        if np.max(gap) > REACHED:
            high = 2 * half_height_at(joint, side * joint.profile.length / 2)
            expected = "expected an end that lies on this body over its whole height"
            raise BadInput(f"{key}: is {high:.6g} mm high at {name}, {expected}")


def _as_drawn(layout: Layout, joint: Joint) -> str:
    """Return length and direction of a hinge that does not reach its bodies."""
    degrees = math.degrees(joint.heading)
    drawn = f"its length is {joint.profile.length:g} mm and its direction {degrees:.6g} deg"
    if _meant_in_radians(layout, joint):
        return f"{drawn}, read in radians it would reach"
    return drawn


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
                f"{key_of_part(body)}: hinges connect it to {what}, expected a connection to ground"
            )
    return found
