"""Points, curves and regions of a plate in the geometry kernels of gmsh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexfem.mechanism.edges import Bezier, Curve
from flexfem.mechanism.outlines import Segment
from flexfem.meshing.requests import Region

SAME_POINT = 1e-7  # mm; each face computes the points that it shares with others


def draw_point(kernel: Any, z: complex) -> int:
    """Draw a point, mm, and return its tag."""
    return int(kernel.addPoint(z.real, z.imag, 0.0))


def draw_curve(
    kernel: Any,
    curve: Curve,
    start: int,
    end: int,
) -> int:
    """Draw a curve between points that are drawn, given by their tags, and return its tag."""
    if isinstance(curve, Bezier):
        between = [draw_point(kernel, z) for z in curve.points[1:-1]]
        return int(kernel.addBezier([start, *between, end]))
    if curve.centre is None:
        return int(kernel.addLine(start, end))
    centre = draw_point(kernel, curve.centre)
    if isinstance(curve, Segment):
        return int(kernel.addCircleArc(start, centre, end))
    on_major_axis = draw_point(kernel, curve.centre + curve.major)
    return int(kernel.addEllipseArc(start, centre, on_major_axis, end))


def _draw_circle(
    kernel: Any,
    start: complex,
    centre: complex,
) -> int:
    """Draw the circle through a point and return its tag."""
    spoke = start - centre
    axes = {"zAxis": [0.0, 0.0, 1.0], "xAxis": [spoke.real, spoke.imag, 0.0]}
    return int(kernel.addCircle(centre.real, centre.imag, 0.0, abs(spoke), **axes))


def _draw_loop(kernel: Any, loop: Sequence[Curve]) -> int:
    """Draw a closed loop of curves, each of which begins where the one before it ends."""
    if len(loop) == 1 and isinstance(loop[0], Segment) and loop[0].centre is not None:
        return int(kernel.addCurveLoop([_draw_circle(kernel, loop[0].start, loop[0].centre)]))
    curves = [curve for curve in loop if abs(np.subtract(*_ends(curve))) > SAME_POINT]
    corners = [draw_point(kernel, _ends(curve)[0]) for curve in curves]
    following = [*corners[1:], corners[0]]
    tags = [draw_curve(kernel, *each) for each in zip(curves, corners, following, strict=True)]
    return int(kernel.addCurveLoop(tags))


def _ends(curve: Curve) -> tuple[complex, complex]:
    if isinstance(curve, Bezier):
        return curve.points[0], curve.points[-1]
    return curve.start, curve.end


def draw_region(kernel: Any, region: Region) -> list[tuple[int, int]]:
    """Draw a region and return its faces: a cut can divide it."""
    face = (2, kernel.addPlaneSurface([_draw_loop(kernel, loop) for loop in region.loops]))
    boxes = [(2, kernel.addPlaneSurface([_draw_loop(kernel, cut)])) for cut in region.cuts]
    return list(kernel.cut([face], boxes)[0]) if boxes else [face]


def draw_union(kernel: Any, regions: list[Region]) -> list[tuple[int, int]]:
    """Draw the union of regions and return its faces, one for each connected part."""
    first, *others = (face for region in regions for face in draw_region(kernel, region))
    return list(kernel.fuse([first], others)[0]) if others else [first]
