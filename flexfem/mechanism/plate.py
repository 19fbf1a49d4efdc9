"""The parts of a plate as polygons: bodies less the boxes of their hinges, and hinges.

Points are complex, mm.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.csgraph import connected_components

from flexfem.mechanism.hinge_place import (
    ALONG,
    corners_at,
    cuts_of,
    joint_polygon,
    position,
)
from flexfem.mechanism.layout import Body, Joint, Layout
from flexfem.mechanism.outlines import area, polygon_points
from flexfem.mechanism.profile_shape import FIRST, LEFT
from flexfem.refused import BadInput

STEP = np.pi / 512  # rad, of the polygons of parts: 0.5 um from an arc of 100 mm
# mm, of the coordinates of a whole plate, whose parts differ by round-off where they meet
GRID = 1e-6
ROUNDED = 1e-9  # mm, the same of two parts
SLIVER = 1e-6  # mm^2; a smaller area is round-off
INSIDE = np.abs(ALONG) < 0.4  # positions on the axis of a hinge, away from its ends
# of a neck, distance of a point beside a corner of a hinge that its body contains if it is wider
# there
PROBE = 0.05


def face_area(body: Body) -> float:
    return sum(map(area, (body.outline, *body.holes)))


def mean_width(body: Body) -> float:
    """Twice the area per length of its edges, mm: the width of a long body."""
    loops = (body.outline, *body.holes)
    return 2 * face_area(body) / sum(segment.length for loop in loops for segment in loop)


def body_polygon(
    layout: Layout,
    index: int,
    refuse: bool = True,
) -> Any:
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
    key = key_of_part(body)
    outline = shapely.Polygon(drawn.exterior)
    holes = [shapely.Polygon(hole) for hole in drawn.interiors]
    loops = {key: outline, **{f"{key}.holes[{k}]": hole for k, hole in enumerate(holes)}}
    for key_of_loop, loop in loops.items():
        if not shapely.is_valid(loop):
            return f"{key_of_loop}: {_fault_of_loop(loop)}"
    for k, hole in enumerate(holes):
        place = hole.centroid
        where = f"{key}.holes[{k}]: the hole around {place.x:g}, {place.y:g}"
        if not shapely.contains_properly(outline, hole):
            side = "crosses the edge of" if shapely.intersects(outline, hole) else "is outside"
            return f"{where} {side} the body, expected a hole inside it"
        for other in range(k):
            if shapely.intersects(holes[other], hole):
                return f"{where} meets holes[{other}], expected holes that do not meet"
    reason = shapely.is_valid_reason(drawn)
    return f"{key}: {reason}, expected an outline and holes that do not meet"


def _fault_of_loop(loop: Any) -> str:
    """Return where a loop meets itself; the reason of GEOS is such as Self-intersection[1.5 8]."""
    reason, _, found = shapely.is_valid_reason(loop).rstrip("]").partition("[")
    where = ", ".join(f"{float(each):g}" for each in found.split())
    return f"{reason.lower()} at {where}, expected an outline that does not meet itself"


def _polygons(layout: Layout) -> list[Any]:
    """Return the polygons of all parts, for drawings of what encloses them where loops meet."""
    bodies = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    return [*bodies, *map(joint_polygon, layout.joints)]


def plate_polygon(layout: Layout) -> Any:
    """Return the polygons of the whole plate, also of one that cannot be made."""
    return shapely.union_all(_polygons(layout), grid_size=GRID)


def plate_mass(layout: Layout) -> float:
    """Return the mass of a whole plate, tonne."""
    areas = shapely.area(np.array(_polygons(layout)))
    densities = np.array([material.density for material in layout.materials])
    return layout.thickness * float(areas @ densities)


def size_of(layout: Layout) -> float:
    """Return the larger extent of a whole plate in x and y, mm, without joining its parts."""
    return extent(_polygons(layout))


def extent(shape: Any) -> float:
    """Return the larger extent in x and y, mm, of one or several polygons."""
    left, low, right, high = shapely.total_bounds(shape)
    return float(max(right - left, high - low))


def has_sharp_corner(layout: Layout, joint: Joint) -> bool:
    """Whether a hinge has an inner corner without a radius.

    It may be in its own edge, or where its edge meets a body. There is none where the edge goes on
    as the side of the body, or the body is at most 5 % of the neck wider.
    """
    if joint.profile.sharp:
        return True
    for corner in joint.profile.bare_corners:
        end, side = corner.split()
        is_first = end == FIRST
        towards = -1 if is_first else 1
        left, right = corners_at(joint, towards)
        at = left if side == LEFT else right
        outwards = 1 if side == LEFT else -1
        probe = at + PROBE * joint.profile.neck * complex(towards, outwards)
        beyond = position(joint, probe)
        body = body_polygon(layout, joint.bodies[0 if is_first else 1], refuse=False)
        if shapely.intersects_xy(body, beyond.real, beyond.imag):
            return True
    return False


def clashes(layout: Layout, refusal: BadInput) -> list[Any]:
    """Return the polygons of what a refusal is about.

    They are a part with it as key, else all overlaps, else the parts that it names.
    """
    outlines = np.array(_polygons(layout))
    keys = [key_of_part(part) for part in layout.parts]
    i, j = shapely.STRtree(outlines).query(outlines, predicate="intersects")
    pairs = i < j
    overlaps = shapely.intersection(outlines[i[pairs]], outlines[j[pairs]], grid_size=ROUNDED)
    shared = shapely.get_parts(overlaps)
    undrawn = outlines[[key == refusal.reason for key in keys]]
    is_named = [re.match(f"{re.escape(key)}[:.]", refusal.reason) is not None for key in keys]
    named = outlines[is_named]
    found = (undrawn, shared[shapely.area(shared) > SLIVER], named)
    return list(shapely.get_parts(next(filter(len, found), named)))


def components(layout: Layout) -> list[set[int]]:
    """Return the sets of bodies that hinges connect."""
    joined = [joint.bodies for joint in layout.joints if min(joint.bodies) >= 0]
    first, second = np.array(joined, dtype=np.int64).reshape(-1, 2).T
    links = sp.coo_array((np.ones(len(first)), (first, second)), shape=2 * (len(layout.bodies),))
    count, number = connected_components(links, directed=False)
    return [set(np.flatnonzero(number == k).tolist()) for k in range(count)]


def key_of_part(part: Body | Joint) -> str:
    """Return the key path of a body or a hinge, or its name."""
    return part.key or part.name


def common_area(one: shapely.Geometry, other: shapely.Geometry) -> float:
    """Return the common area, mm^2.

    Coordinates are rounded, else GEOS finds areas of polygons that share an edge.
    """
    return float(shapely.area(shapely.intersection(one, other, grid_size=ROUNDED)))
