"""Mesh and contours of any plate mechanism, by OpenCASCADE in the process of `mesher`.

Triangles are as small as `Profile.sizes` asks in a hinge and grow from there at the rate of `mesh` up to a size that
follows the width of each body.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Hashable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import shapely

from flexfem.arrays import AnyArray
from flexfem.fem.mesh import StageMesh, check_count, check_triangles, jacobians, mesh_of, ordered
from flexfem.fem.mesher import DIVIDING, Grading, Line, NamedArrays, PlateContours, PlateMesh, Region, run_mesher
from flexfem.fem.stage_mesh import COARSEST, GROWTH, PER_TURN, TIME_LIMIT
from flexfem.mechanism.layout import Body, Layout, Move
from flexfem.mechanism.outlines import SHORTEST, Segment, area, circle_of, polygon_points, reverse
from flexfem.mechanism.plate import (
    ALONG,
    TOUCHING,
    body_polygon,
    check_layout,
    components,
    cuts_of,
    end_corners,
    end_lines,
    joint_loop,
    joint_polygon,
    neck_line,
)
from flexfem.refused import ComputationFailed

PART_AREA = 2e-3  # relative, of a body or hinge; parabolas stand for arcs
CORNER = 4.0  # times smaller are the triangles at a sharp inner corner of an elastic body
SHARP = np.deg2rad(20.0)  # turn of the outline at a corner
AT_CONTACT = 4.0  # size of triangles at a contact, per radius, times the resolution
NARROWEST = 0.1  # width of a place in a body, per mean width, below which it sets no triangle size
MOST_RAYS = 64  # from a side of a body
FACING = 0.7  # cosine of the angle between two sides that face each other
DECIMALS = 9  # of coordinates, mm, of parts that are equal
BEYOND = TOUCHING / 2  # mm, of a dividing line beyond the edge of the plate
OF_GROUND = 4.0  # times larger are the triangles of a rigid body


def regions_of(layout: Layout, circles: bool = False) -> list[Region]:
    """Return the faces of the plate, bodies then hinges; with `circles`, round loops as one curve."""

    def drawn(loop: Sequence[Segment]) -> Sequence[Segment]:
        circle = circle_of(loop) if circles else None
        return [Segment(loop[0].start, loop[0].start, circle[0])] if circle else loop

    bodies = [
        Region([drawn(body.outline), *(drawn(reverse(hole)) for hole in body.holes)], cuts_of(layout, index))
        for index, body in enumerate(layout.bodies)
    ]
    return bodies + [Region([joint_loop(joint)], []) for joint in layout.joints]


def mesh_layout(layout: Layout, resolution: int) -> StageMesh:
    """Return the mesh of a plate mechanism with a number of triangles across a neck, see `Profile.sizes`.

    Its `bodies` are indices of bodies of the layout, and of its hinges plus the number of bodies. Its edges are
    labelled `neck 0` at the centre of a hinge, `end 0 near` and `end 0 far` where it meets its first and second body,
    and `clamped` on the clamped edges of elastic bodies.

    The mesh has the symmetry of the plate, see `symmetry_of`.

    Raises BadInput for a layout that cannot be made, ComputationFailed when the mesh fails its checks, MeshTimeout when
    it takes too long.
    """
    check_layout(layout)
    moves = symmetry_of(layout)
    fine = max(resolution, 2)  # a single triangle across an arc would degenerate
    necks, lines, divisions = list[Line](), list[Line](), dict[str, int]()
    gradings: dict[tuple[float, float], list[complex]] = {}
    for index, joint in enumerate(layout.joints):
        x, weights = joint.profile.quadrature
        check_count(2 * fine**2 * float(np.sum(weights / joint.profile.height(x))), f"{joint.name} needs about")
        necks.append(Line(f"neck {index}", neck_line(joint), len(layout.bodies) + index))
        for name, side, which in zip(("near", "far"), (-1, 1), joint.bodies, strict=True):
            ends = end_lines(joint, side, layout.bodies[which].fixed)
            lines += [Line(f"end {index} {name}", line, which) for line in ends]
            for point in (ends[0].start, ends[-1].end) if len(ends) > 1 else ():  # at the needles of `end_lines`
                length = min(abs(corner - point) for corner in end_corners(joint, side))
                gradings.setdefault((length / 2, length), []).append(point)
        sizes = joint.profile.sizes(fine)
        middle = joint.profile.section
        at_neck = [size for points, size, radius in sizes if min(abs(z - middle) for z in points) <= radius]
        if at_neck:
            divisions[f"neck {index}"] = math.ceil(float(joint.profile.height(np.array(middle))) / min(at_neck) - 1e-6)
        for points, size, radius in sizes:
            at = (complex(joint.place + z * cmath.exp(1j * joint.heading)) for z in points)
            gradings.setdefault((size, radius), []).extend(at)
    largest = [COARSEST * _width(body) / fine * (OF_GROUND if body.fixed else 1.0) for body in layout.bodies]
    for number, (body, coarse) in enumerate(zip(layout.bodies, largest, strict=True)):
        for point, size, radius in _refinements(body, coarse):
            gradings.setdefault((size, radius), []).append(point)
        lines += [Line("clamped", body.outline[k], number) for k in body.clamped if not body.fixed]
    for patch in dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts):
        if patch.radius is not None and patch.body >= 0 and not layout.bodies[patch.body].fixed:
            places = [move(patch.point) for move in (Move(), *moves)]
            gradings.setdefault((AT_CONTACT * patch.radius / fine, patch.radius), []).extend(places)
    largest += [joint.profile.end_height * COARSEST / fine for joint in layout.joints]
    coarsest, growth = max(largest), GROWTH / fine
    graded = [
        Grading(points, radius, size, coarsest, (coarsest - size) / growth)
        for (size, radius), points in gradings.items()
        if size < coarsest
    ]
    job = PlateMesh(regions_of(layout), necks + lines, divisions, graded, largest)
    if moves:
        regions, dividing = _divided(layout, job.regions, moves)
        symmetric = job._replace(regions=regions, lines=[*job.lines, *dividing], moves=moves)
        with suppress(ComputationFailed):  # gmsh cannot draw it: a mesh without symmetry, then
            return _checked(layout, run_mesher(symmetric, TIME_LIMIT), divisions)
    return _checked(layout, run_mesher(job, TIME_LIMIT), divisions)


def symmetry_of(layout: Layout) -> list[Move]:
    """Return the rotations, else one mirror image, that take a plate without its rigid bodies into itself."""
    marks = list[tuple[complex, complex, Hashable]]()
    for body in (body for body in layout.bodies if not body.fixed):
        for k, edge in enumerate(edge for loop in (body.outline, *body.holes) for edge in loop):
            kind, centre = (body.width, k in body.clamped), edge.centre
            if centre is None:
                marks += [((edge.start + edge.end) / 2, end, kind) for end in (edge.start, edge.end)]
            else:  # wherever circles are divided into arcs
                marks.append((centre, centre, (*kind, round(abs(edge.start - centre), DECIMALS))))
    for one in layout.joints:
        ahead, x = cmath.exp(1j * one.heading), np.append(ALONG * one.profile.length, one.profile.breaks)
        ways = (ahead, -ahead) if np.allclose(one.profile.height(x), one.profile.height(-x), 1e-9) else (ahead,)
        marks += [(one.place, one.place + way, (one.profile, one.cut)) for way in ways]
    count = len(layout.joints)
    if not count:
        return []
    about = complex(np.mean([joint.place for joint in layout.joints]))
    z = np.array([mark[:2] for mark in marks]) - about

    def seen(moved: AnyArray) -> set[tuple[Hashable, ...]]:
        rows = np.round(np.column_stack([moved.real, moved.imag]), DECIMALS).tolist()
        return {(mark[2], *row) for mark, row in zip(marks, rows, strict=True)}

    for turns in (turns for turns in range(count, 1, -1) if count % turns == 0):
        turn = np.exp(2j * np.pi / turns)
        if seen(z * turn) == seen(z):
            return [Move(factor := complex(turn**k), about - factor * about) for k in range(1, turns)]
    tips = z[:, 1]
    farthest = tips[np.argmax(np.abs(tips))]
    for tip in tips[np.isclose(np.abs(tips), abs(farthest))]:
        factor = complex(tip * farthest) / abs(tip * farthest)
        if seen(factor * z.conj()) == seen(z):
            return [Move(factor, about - factor * about.conjugate(), mirrored=True)]
    return []


def _divided(layout: Layout, regions: list[Region], moves: list[Move]) -> tuple[list[Region], list[Line]]:
    """Return the regions with circles whose corners the moves keep, and the lines between sectors or halves."""
    mirrored, factor, drawn, lines = moves[0].mirrored, moves[0].factor, list[Region](), list[Line]()
    faces = [body_polygon(layout, index) for index in range(len(layout.bodies))]
    if mirrored:
        plate, along = shapely.union_all([*faces, *map(joint_polygon, layout.joints)]), cmath.sqrt(factor)
        centre = _centroid(plate)
        lines += _across(plate, (centre + moves[0](centre)) / 2, (-along, along), None)
    about = 0j if mirrored else moves[0].shift / (1 - factor)
    for index, (body, face, region) in enumerate(zip(layout.bodies, faces, regions, strict=False)):
        if not mirrored:
            along = _between(layout, index, about, len(moves) + 1)
            if abs(_centroid(face) - about) < TOUCHING and not body.fixed:
                for move in (Move(), *moves):
                    lines += _across(face, about, (0j, move.factor * along), index)
        cuts = shapely.union_all([shapely.Polygon(polygon_points(cut)) for cut in region.cuts])
        loops = list(region.loops)
        for k, loop in enumerate((body.outline, *body.holes)):
            circle = circle_of(loop)
            if circle and not shapely.LinearRing(polygon_points(loop)).intersects(cuts):
                centre, radius = circle
                centred = not mirrored and abs(centre - about) < TOUCHING  # the lines between sectors divide it
                way = along if mirrored or centred else (centre - about) / abs(centre - about)
                corner, opposite = centre + radius * way, centre - radius * way
                loops[k] = [Segment(corner, corner, centre)]
                if k and not centred:  # gmsh copies no closed circle: a line inside the hole divides it
                    lines.append(Line(DIVIDING, Segment(opposite, opposite + BEYOND * way), None))
        drawn.append(region._replace(loops=loops))
    return [*drawn, *regions[len(faces) :]], lines


def _centroid(face: Any) -> complex:
    return complex(face.centroid.x, face.centroid.y)


def _across(face: Any, about: complex, ways: tuple[complex, complex], region: int | None) -> Iterator[Line]:
    """Yield the lines across a polygon between two directions from a point, and a little beyond its edges."""
    ends = [about + face.convex_hull.length * way for way in ways]
    ray = shapely.LineString([(end.real, end.imag) for end in ends])
    for piece in filter(shapely.length, shapely.get_parts(shapely.intersection(face.buffer(BEYOND), ray))):
        yield Line(DIVIDING, Segment(*(complex(*point) for point in piece.coords)), region)


def _between(layout: Layout, index: int, about: complex, turns: int) -> complex:
    """Return a direction from the centre between the hinges of a body, by the widest angle."""
    sector = 2 * np.pi / turns
    at = np.sort(np.angle([one.place - about for one in layout.joints if index in one.bodies] or [1.0]) % sector)
    gaps = np.diff([*at, at[0] + sector])
    return cmath.exp(1j * float((at + gaps / 2)[np.argmax(gaps)]))


def _width(body: Body) -> float:
    """Width of a bar, or the mean width of another body, mm."""
    loops = (body.outline, *body.holes)
    perimeter = sum(segment.length for loop in loops for segment in loop)
    return body.width or 2 * sum(area(loop) for loop in loops) / perimeter


def _refinements(body: Body, coarse: float) -> Iterator[tuple[complex, float, float]]:
    """Yield points, the triangle sizes at them and radii, mm: of arcs, and of sharp inner corners of elastic bodies."""
    for loop in (body.outline, *body.holes):
        for before, after in zip((loop[-1], *loop[:-1]), loop, strict=True):
            if after.centre is not None:
                radius = abs(after.start - after.centre)
                yield after.centre, radius * 2 * math.pi / PER_TURN, radius
            turn = cmath.phase(complex(after.tangent(0.0)) / complex(before.tangent(1.0)))
            if turn < -SHARP and not body.fixed:
                yield after.start, coarse / CORNER, 0.0
    if body.width is None and not body.fixed:
        for point, width in _narrow_places(body, _width(body)):
            yield point, coarse * width / _width(body), width


def _narrow_places(body: Body, width: float) -> Iterator[tuple[complex, float]]:
    """Yield points in the middle of places narrower than the mean width of a body, and their width in steps, mm.

    From points of the outlines, rays at right angles meet a side of the body that faces them.
    """
    rings = [polygon_points(loop) @ [1, 1j] for loop in (body.outline, *body.holes)]
    starts, sides = np.concatenate(rings), np.concatenate([np.roll(ring, -1) - ring for ring in rings])
    for start, side in zip(starts, sides, strict=True):
        along, count = side / abs(side), min(MOST_RAYS, math.ceil(abs(side) / (NARROWEST * width)))
        at = start + side * (np.arange(count)[:, None] + 0.5) / count
        u, v = (starts - at) / along, sides / along  # the ray is the positive imaginary axis
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -u.real / v.real
            away = np.where((share >= 0) & (share <= 1), u.imag + share * v.imag, np.inf)
        away[(away < SHORTEST) | (v.real > -FACING * np.abs(v))] = np.inf
        for point, gap in zip(at[:, 0], away.min(axis=1), strict=True):
            if NARROWEST * width < gap < width / 2:
                step = width * 2 ** -math.ceil(math.log2(width / gap))
                yield complex(point + 0.5j * along * gap), step


def _checked(layout: Layout, arrays: NamedArrays, divisions: dict[str, int]) -> StageMesh:
    """Return the mesh. Raises ComputationFailed unless it is the drawn plate, with all hinges and clamped edges."""
    mesh = mesh_of(arrays)
    check_triangles(mesh, float(arrays["areas"].sum()), len(components(layout)))
    meshed = np.bincount(mesh.bodies, jacobians(mesh)[:, -1] / 2, minlength=len(arrays["areas"]))
    count, names = len(layout.bodies), [part[0] for part in (*layout.bodies, *layout.joints)]
    worst = int(np.argmax(np.abs(meshed / arrays["areas"] - 1)))
    if abs(meshed[worst] / arrays["areas"][worst] - 1) > PART_AREA:
        raise ComputationFailed(
            f"mesh of {names[worst]} covers {meshed[worst]:.6g} mm^2, expected {arrays['areas'][worst]:.6g}"
        )
    if any(body.clamped and not body.fixed for body in layout.bodies) and "clamped" not in mesh.edges:
        raise ComputationFailed("mesh has no clamped edges")
    nodes_of = [np.unique(mesh.triangles[mesh.bodies == part]) for part in range(len(names))]
    for index, joint in enumerate(layout.joints):
        across, expected = len(mesh.edges.get(f"neck {index}", ())), divisions.get(f"neck {index}", 1)
        if across < expected:
            raise ComputationFailed(f"mesh has {across} triangles across {joint.name}, expected {expected}")
        for name, body in zip(("near", "far"), joint.bodies, strict=True):
            end = mesh.edges.get(f"end {index} {name}")
            if end is None or not all(np.isin(end, nodes_of[part]).all() for part in (body, count + index)):
                raise ComputationFailed(f"mesh does not connect {joint.name} to {layout.bodies[body].name}")
    return ordered(mesh)[0]


def plate_contours(layout: Layout) -> list[list[Segment]]:
    """Return the contours of the plate: closed loops of lines and arcs, counter-clockwise, around holes clockwise.

    Lines and circular arcs are exact; arcs in place of other curves are within 1e-4 mm of them. The loops of one
    connected part follow each other, the outer one first.
    """
    check_layout(layout)
    contours: list[list[Segment]] = run_mesher(PlateContours(regions_of(layout)), TIME_LIMIT)
    return contours
