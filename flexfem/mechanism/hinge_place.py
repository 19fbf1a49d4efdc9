"""A hinge in its place: its loop, its ends, and the box that it cuts from its bodies.

Points are complex, mm. In the frame of a hinge its axis is the x axis, and its centre the origin.
"""

from __future__ import annotations

import cmath
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.edges import Curve, backwards, mapped
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.outlines import SHORTEST, Segment, polyline

# positions on the axis of a hinge, per length
ALONG = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 129)) / 2
# the same towards its end, per half the length
ENDING = np.sin(np.linspace(np.pi / 3, np.pi / 2, 400))
STEEP = 60.0  # degrees, slope of an edge beyond which `end_lines` leave it
# the same at a rigid body: corners held from 60 degrees on shifted a drift by 1.4e-4 of it
STEEP_AT_GROUND = 80.0
SLOPE_ROUND_OFF = 1e-6  # relative: straight flanks at 60 degrees are not steep
EDGE_ROUND_OFF = 1e-9  # relative to length or height, of points on the edge of a hinge
OVERSHOOT = 0.02  # of a line across a hinge beyond its edge, per length of the line
SIDES = (-1, 1)  # ends of a hinge at its first and second body


def position(joint: Joint, z: complex) -> complex:
    """Return the position of a point given in the frame of a hinge."""
    return joint.place + z * cmath.exp(1j * joint.heading)


def middle_point(joint: Joint, x: float) -> complex:
    """Return the middle between the edges of a profile at a position on its axis, in the frame of
    the hinge.
    """
    return complex(x, float(joint.profile.middle(np.array(x))))


def half_height_at(joint: Joint, x: float) -> float:
    return float(joint.profile.height(np.array(x))) / 2


def corners_at(joint: Joint, side: int) -> tuple[complex, complex]:
    """Return the left and right corner of a profile at its near (-1) or far end (1), in the frame
    of the hinge.
    """
    x = side * joint.profile.length / 2
    middle = middle_point(joint, x)
    half_height = 1j * half_height_at(joint, x)
    return middle + half_height, middle - half_height


def joint_loop(joint: Joint) -> list[Curve]:
    """Return the closed counter-clockwise loop of a hinge: right edge, far end, left edge, near
    end.
    """
    left, right = joint.profile.edges()
    near_left, near_right = corners_at(joint, -1)
    far_left, far_right = corners_at(joint, 1)
    loop = [
        *right,
        Segment(far_right, far_left),
        *map(backwards, reversed(left)),
        Segment(near_left, near_right),
    ]
    return [mapped(curve, partial(position, joint)) for curve in loop]


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


def section_middle(joint: Joint) -> complex:
    """Return the middle of the section of a hinge that edges of triangles follow, in the frame of
    the hinge.
    """
    return middle_point(joint, joint.profile.section)


def neck_line(joint: Joint) -> Segment:
    """Return the section of a hinge that edges of triangles follow, and a little beyond its edges."""
    middle = section_middle(joint)
    high = 1j * (1 + OVERSHOOT) * half_height_at(joint, joint.profile.section)
    return Segment(position(joint, middle - high), position(joint, middle + high))


def end_corners(joint: Joint, side: int) -> tuple[complex, complex]:
    """Return both corners of a hinge, left and right, at its first (`side` = -1) or second (1)
    body.
    """
    left, right = corners_at(joint, side)
    return position(joint, left), position(joint, right)


def in_hinge(joint: Joint, z: AnyArray) -> NDArray[np.bool_]:
    """Return which points (...) lie in a hinge: within its length and its height, with its edges
    but not its ends.
    """
    local = (z - joint.place) * cmath.exp(-1j * joint.heading)
    within = np.abs(local.real) < joint.profile.length / 2 * (1 - EDGE_ROUND_OFF)
    half_height = joint.profile.height(local.real) / 2
    off_middle = np.abs(local.imag - joint.profile.middle(local.real))
    return np.asarray(within & (off_middle <= half_height * (1 + EDGE_ROUND_OFF)))


def end_lines(
    joint: Joint,
    side: int,
    rigid: bool = False,
) -> list[Segment]:
    """Return the lines along which the mesh divides a hinge from its first (`side` = -1) or second
    (1) body.

    They are the end of the hinge, except where the edge of the profile is steep there: a triangle
    between them would be a needle. The lines then leave the edge where it gets steeper than 60
    degrees, at a `rigid` body than 80 degrees, and the triangles of the corner beyond them are
    those of the body. The corner is still a part of the hinge: means over the body leave it out,
    see `in_hinge`.
    """
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
    return polyline(*(position(joint, side * z) for z in (*left, *reversed(right))))


def _from_edge(
    end: float, x: Array, edge: Array, half_height: Array, steepest: float
) -> list[complex]:
    """Return the points of the end of a hinge from its left edge inwards, as in `end_lines`.

    x : (n,), positions towards the end.   edge, half_height : (n,), mm, distance of the edge from
    the axis and half the height.   steepest : slope beyond which the edge is left.
    """
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
    return polyline(*(position(joint, z) for z in corners))


def cuts_of(layout: Layout, body: int) -> list[list[Segment]]:
    """Return the boxes that hinges cut from a body."""
    return [cut_box(joint) for joint in layout.joints if joint.cut and body in joint.bodies]
