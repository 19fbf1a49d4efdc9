"""Mesh and contours of any plate mechanism, by OpenCASCADE in the process of `mesher`.

Triangles are as small as `Profile.sizes` asks in a hinge and grow from there at the rate of `mesh`
up to a size that follows the width of each body."""

from __future__ import annotations

import cmath
import math
from collections.abc import Hashable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import shapely

from flexfem.arrays import AnyArray, Array
from flexfem.fem.mesh import (
    PoorTriangles,
    StageMesh,
    TooManyTriangles,
    check_count,
    check_triangles,
    jacobians,
    mesh_of,
    ordered,
)
from flexfem.fem.mesher import (
    DIVIDING,
    Grading,
    Line,
    MeshTimeout,
    NamedArrays,
    PlateContours,
    PlateMesh,
    Region,
    run_mesher,
)
from flexfem.fem.sizes import COARSEST, GROWTH, PER_TURN, TIME_LIMIT, first_good, smaller_at
from flexfem.mechanism.layout import Body, Layout, Move
from flexfem.mechanism.outlines import SHORTEST, Segment, circle_of, polygon_points, reverse
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
    mean_width,
    neck_line,
    section_middle,
    triangles_needed,
)
from flexfem.refused import ComputationFailed

PART_AREA = 2e-3  # relative, of a body or hinge; parabolas stand for arcs
CORNER = 4.0  # times smaller are the triangles at a sharp inner corner of an elastic body
SHARP = np.deg2rad(20.0)  # turn of the outline at a corner
AT_CONTACT = 4.0  # size of triangles at a contact, per radius, times the resolution
RAYS = 0.1  # distance between rays from a side of a body, per mean width
# triangles per full turn of holes and fillets of bodies, times the resolution: their stress follows
# it
ON_ARCS = 4.0
MOST_ARCS = (
    200  # of a plate; with more of them, such as a sieve, the mesh follows the outline alone
)
MOST_RAYS = 64  # from a side, or around one of its rays
FACING = 0.7  # cosine of the angle between two sides that face each other
DECIMALS = 9  # of coordinates, mm, of parts that are equal
BEYOND = TOUCHING / 2  # mm, of a dividing line beyond the edge of the plate
OF_GROUND = 4.0  # times larger are the triangles of a rigid body
ATTEMPTS = 8
LOCAL_ATTEMPTS = 5  # to mesh a plate, and one with its symmetry
FINER = 0.8  # size of all triangles in the next attempt
OTHER_ALGORITHM = {6: 5, 5: 6}
TIME_PER_TRIANGLE = 5e-4  # s, added to the time limit; gmsh takes 6e-5 s on an idle machine


def regions_of(layout: Layout, circles: bool = False) -> list[Region]:
    """Return the faces of the plate, bodies then hinges; with `circles`, round loops as one curve."""

    def drawn(loop: Sequence[Segment]) -> Sequence[Segment]:
        circle = circle_of(loop) if circles else None
        return [Segment(loop[0].start, loop[0].start, circle[0])] if circle else loop

    bodies = [
        Region(
            [drawn(body.outline), *(drawn(reverse(hole)) for hole in body.holes)],
            cuts_of(layout, index),
        )
        for index, body in enumerate(layout.bodies)
    ]
    return bodies + [Region([joint_loop(joint)], []) for joint in layout.joints]


def mesh_layout(layout: Layout, resolution: int) -> StageMesh:
    """Return the mesh of a plate mechanism with a number of triangles across a neck, see
    `Profile.sizes`.

    Its `bodies` are indices of bodies of the layout, and of its hinges plus the number of bodies.
    Its edges are labelled `neck 0` at the centre of a hinge, `end 0 near` and `end 0 far` where it
    meets its first and second body, and `clamped` on the clamped edges of elastic bodies.

    The mesh has the symmetry of the plate, see `symmetry_of`.

    Raises BadInput for a layout that cannot be made, ComputationFailed when the mesh fails its
    checks, MeshTimeout when it takes too long."""
    check_layout(layout)
    moves = symmetry_of(layout)
    fine = max(resolution, 2)  # a single triangle across an arc would degenerate
    necks = list[Line]()
    lines = list[Line]()
    divisions = dict[str, int]()
    gradings: dict[tuple[float, float], list[complex]] = {}
    for index, joint in enumerate(layout.joints):
        x, weights = joint.profile.quadrature
        check_count(
            2 * fine**2 * float(np.sum(weights / joint.profile.height(x))),
            f"{joint.name} needs about",
        )
        necks.append(Line(f"neck {index}", neck_line(joint), len(layout.bodies) + index))
        for name, side, which in zip(("near", "far"), (-1, 1), joint.bodies, strict=True):
            ends = end_lines(joint, side, layout.bodies[which].fixed)
            lines += [Line(f"end {index} {name}", line, which) for line in ends]
            for point in (
                (ends[0].start, ends[-1].end) if len(ends) > 1 else ()
            ):  # at the needles of `end_lines`
                length = min(abs(corner - point) for corner in end_corners(joint, side))
                if length > SHORTEST:  # not at an edge that is gentle up to its end
                    gradings.setdefault((length / 2, length), []).append(point)
        sizes = joint.profile.sizes(fine)
        middle = section_middle(joint)
        at_neck = [
            size for points, size, radius in sizes if min(abs(z - middle) for z in points) <= radius
        ]
        if at_neck and joint.profile.even_section:
            across = float(joint.profile.height(np.array(middle.real)))
            divisions[f"neck {index}"] = math.ceil(across / min(at_neck) - 1e-6)
        for points, size, radius in sizes:
            at = (complex(joint.place + z * cmath.exp(1j * joint.heading)) for z in points)
            gradings.setdefault((size, radius), []).extend(at)
    largest = [
        COARSEST * (body.width or mean_width(body)) / fine * (OF_GROUND if body.fixed else 1.0)
        for body in layout.bodies
    ]
    arcs = sum(
        edge.centre is not None
        for body in layout.bodies
        for loop in (body.outline, *body.holes)
        for edge in loop
    )
    fine_arcs = max(PER_TURN, ON_ARCS * fine) if arcs <= MOST_ARCS else PER_TURN
    for number, (body, coarse) in enumerate(zip(layout.bodies, largest, strict=True)):
        for point, size, radius in _refinements(
            body, coarse, PER_TURN if body.fixed else fine_arcs
        ):
            gradings.setdefault((size, radius), []).append(point)
        lines += [Line("clamped", body.outline[k], number) for k in body.clamped if not body.fixed]
    for patch in dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts):
        if patch.radius is not None and patch.body >= 0 and not layout.bodies[patch.body].fixed:
            places = [move(patch.point) for move in (Move(), *moves)]
            gradings.setdefault((AT_CONTACT * patch.radius / fine, patch.radius), []).extend(places)
    largest += [joint.profile.end_height * COARSEST / fine for joint in layout.joints]
    coarsest = max(largest)
    growth = GROWTH / fine
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
            return _accepted(layout, symmetric, divisions, LOCAL_ATTEMPTS)
    return _accepted(layout, job, divisions, ATTEMPTS)


def _accepted(layout: Layout, job: PlateMesh, across: dict[str, int], attempts: int) -> StageMesh:
    """Return the first mesh that passes its checks.

    across : least number of triangles across each neck.
    """
    time_limit = TIME_LIMIT + TIME_PER_TRIANGLE * triangles_needed(layout)

    def mesh(job: PlateMesh) -> StageMesh:
        return _checked(layout, run_mesher(job, time_limit), across)

    return first_good(job, mesh, _next_attempt, attempts)


def _next_attempt(job: PlateMesh, failure: ComputationFailed) -> PlateMesh | None:
    """Return the drawing for another attempt after a failure, None if there is none.

    In place of poor triangles there are smaller ones, and the edges across necks are not equal, so
    that those at the ends of the necks can be smaller. After any other failure all triangles are
    smaller, by another algorithm; a mesh with symmetry then has no other attempt.
    """
    if isinstance(failure, PoorTriangles):
        smaller = smaller_at(failure.corners, max(job.largest), job.moves)
        return job._replace(divisions={}, gradings=[*job.gradings, *smaller])
    if isinstance(failure, MeshTimeout | TooManyTriangles) or job.moves:
        return None
    gradings = [
        one._replace(size=FINER * one.size, largest=FINER * one.largest) for one in job.gradings
    ]
    largest = [FINER * size for size in job.largest]
    algorithm = OTHER_ALGORITHM[job.algorithm]
    return job._replace(gradings=gradings, largest=largest, algorithm=algorithm)


def symmetry_of(layout: Layout) -> list[Move]:
    """Return the rotations, else one mirror image, that take a plate without its rigid bodies into
    itself.
    """
    marks = list[tuple[complex, complex, Hashable]]()
    for body in (body for body in layout.bodies if not body.fixed):
        for k, edge in enumerate(edge for loop in (body.outline, *body.holes) for edge in loop):
            kind = (body.width, body.material, k in body.clamped)
            centre = edge.centre
            if centre is None:
                marks += [
                    ((edge.start + edge.end) / 2, end, kind) for end in (edge.start, edge.end)
                ]
            else:  # wherever circles are divided into arcs
                marks.append((centre, centre, (*kind, round(abs(edge.start - centre), DECIMALS))))
    for one in layout.joints:
        ahead = cmath.exp(1j * one.heading)
        x = np.append(ALONG * one.profile.length, one.profile.breaks)
        is_even = all(
            np.allclose(of(x), of(-x), 1e-9) for of in (one.profile.height, one.profile.middle)
        )
        profile, left = one.sided
        ways = (ahead, -ahead) if is_even else (ahead,)
        marks += [(one.place, one.place + way, (profile, one.cut, one.material)) for way in ways]
        marks.append((one.place, one.place + left, (profile, one.cut, "left")))
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
            return [
                Move(factor := complex(turn**k), about - factor * about) for k in range(1, turns)
            ]
    tips = z[:, 1]
    farthest = tips[np.argmax(np.abs(tips))]
    for tip in tips[np.isclose(np.abs(tips), abs(farthest))]:
        factor = complex(tip * farthest) / abs(tip * farthest)
        if seen(factor * z.conj()) == seen(z):
            return [Move(factor, about - factor * about.conjugate(), mirrored=True)]
    return []


def _divided(
    layout: Layout, regions: list[Region], moves: list[Move]
) -> tuple[list[Region], list[Line]]:
    """Return the regions with circles whose corners the moves keep, and the lines between sectors
    or halves.
    """
    mirrored = moves[0].mirrored
    factor = moves[0].factor
    drawn = list[Region]()
    lines = list[Line]()
    faces = [body_polygon(layout, index) for index in range(len(layout.bodies))]
    if mirrored:
        plate = shapely.union_all([*faces, *map(joint_polygon, layout.joints)])
        along = cmath.sqrt(factor)
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
                centred = (
                    not mirrored and abs(centre - about) < TOUCHING
                )  # the lines between sectors divide it
                way = along if mirrored or centred else (centre - about) / abs(centre - about)
                corner = centre + radius * way
                opposite = centre - radius * way
                loops[k] = [Segment(corner, corner, centre)]
                if (
                    k and not centred
                ):  # gmsh copies no closed circle: a line inside the hole divides it
                    lines.append(Line(DIVIDING, Segment(opposite, opposite + BEYOND * way), None))
        drawn.append(region._replace(loops=loops))
    return [*drawn, *regions[len(faces) :]], lines


def _centroid(face: Any) -> complex:
    return complex(face.centroid.x, face.centroid.y)


def _across(
    face: Any, about: complex, ways: tuple[complex, complex], region: int | None
) -> Iterator[Line]:
    """Yield the lines across a polygon between two directions from a point, and a little beyond its
    edges.
    """
    ends = [about + face.convex_hull.length * way for way in ways]
    ray = shapely.LineString([(end.real, end.imag) for end in ends])
    for piece in filter(
        shapely.length, shapely.get_parts(shapely.intersection(face.buffer(BEYOND), ray))
    ):
        yield Line(DIVIDING, Segment(*(complex(*point) for point in piece.coords)), region)


def _between(layout: Layout, index: int, about: complex, turns: int) -> complex:
    """Return a direction from the centre between the hinges of a body, by the widest angle."""
    sector = 2 * np.pi / turns
    at = np.sort(
        np.angle([one.place - about for one in layout.joints if index in one.bodies] or [1.0])
        % sector
    )
    gaps = np.diff([*at, at[0] + sector])
    return cmath.exp(1j * float((at + gaps / 2)[np.argmax(gaps)]))


def _refinements(
    body: Body, coarse: float, per_turn: float
) -> Iterator[tuple[complex, float, float]]:
    """Yield points, the triangle sizes at them and radii, mm: of arcs, and of sharp inner corners
    of elastic bodies.
    """
    for loop in (body.outline, *body.holes):
        for before, after in zip((loop[-1], *loop[:-1]), loop, strict=True):
            if after.centre is not None:
                radius = abs(after.start - after.centre)
                yield after.centre, radius * 2 * math.pi / per_turn, radius
            turn = cmath.phase(complex(after.tangent(0.0)) / complex(before.tangent(1.0)))
            if turn < -SHARP and not body.fixed:
                yield after.start, coarse / CORNER, 0.0
    width = body.width or mean_width(body)
    for point, gap in _narrow_places(body, width):
        yield point, coarse * gap / width, gap


def _narrow_places(body: Body, width: float) -> Iterator[tuple[complex, float]]:
    """Yield points in the middle of places narrower than half the width of a body, and their width
    in steps, mm.

    They are the middles of the shortest lines between two of its loops, and of rays at right angles
    to its outlines that meet a side that faces them."""
    rings = [polygon_points(loop) for loop in (body.outline, *body.holes)]
    loops = np.array([shapely.LinearRing(ring) for ring in rings])
    near = shapely.STRtree(loops).query(loops, predicate="dwithin", distance=width / 2).T
    between = near[near[:, 0] < near[:, 1]]
    lines = shapely.get_coordinates(shapely.shortest_line(*loops[between].T)).reshape(-1, 2, 2) @ [
        1,
        1j,
    ]
    places = [
        *zip(lines.mean(axis=1).tolist(), np.abs(np.diff(lines)).ravel().tolist(), strict=True)
    ]
    sides = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    walls = shapely.STRtree(np.asarray(shapely.linestrings(sides)))
    starts = sides[:, 0] @ [1, 1j]
    along = (sides[:, 1] - sides[:, 0]) @ [1, 1j]
    spacing = np.full(len(sides), RAYS * width)
    origins, of = _spread(starts, along, spacing)
    for _ in range(2):  # the second time where places are narrower than the rays are apart
        gaps = _gaps(origins, of, starts, along, walls, width / 2)
        found = gaps < width / 2
        inwards = 1j * along[of[found]] / np.abs(along[of[found]])
        places += zip(
            (origins[found] + inwards * gaps[found] / 2).tolist(), gaps[found].tolist(), strict=True
        )
        thin = found & (gaps < np.minimum(RAYS * width, np.abs(along[of])))
        step = np.minimum(RAYS * width, np.abs(along[of]))[thin]
        direction = along[of][thin] / np.abs(along[of][thin])
        origins, more = _spread(origins[thin] - step / 2 * direction, step * direction, gaps[thin])
        of = of[thin][more]
    for point, gap in places:
        if gap > SHORTEST:
            yield point, width * 2 ** -math.ceil(math.log2(width / gap))


def _spread(starts: AnyArray, along: AnyArray, spacing: Array) -> tuple[AnyArray, AnyArray]:
    """Return points (m,) on lines from `starts` (n,) by vectors `along` (n,), at most so far apart,
    and their lines.
    """
    counts = np.clip(np.ceil(np.abs(along) / spacing), 1, MOST_RAYS).astype(np.int64)
    of = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    return starts[of] + along[of] * (place + 0.5) / counts[of], of


def _gaps(
    origins: AnyArray, of: AnyArray, starts: AnyArray, along: AnyArray, walls: Any, longest: float
) -> Array:
    """Return the lengths (m,), mm, of rays at right angles to sides, to the next side that faces
    them; else infinity.

    origins : (m,), on the sides `of` (m,), which go from `starts` (n,) by `along` (n,).   walls :
    tree of the sides."""
    inwards = 1j * along[of] / np.abs(along[of])
    ends = np.stack([origins, origins + longest * inwards], axis=1)
    ray, wall = walls.query(
        shapely.linestrings(np.stack([ends.real, ends.imag], axis=2)), predicate="intersects"
    )
    direction = along[of][ray] / np.abs(along[of][ray])
    u = (starts[wall] - origins[ray]) / direction
    v = along[wall] / direction  # the ray is the positive imaginary axis
    with np.errstate(divide="ignore", invalid="ignore"):
        away = u.imag - u.real / v.real * v.imag
    away[~(away > SHORTEST) | (v.real > -FACING * np.abs(v))] = np.inf
    gaps = np.full(len(origins), np.inf)
    np.minimum.at(gaps, ray, away)
    return gaps


def _checked(layout: Layout, arrays: NamedArrays, divisions: dict[str, int]) -> StageMesh:
    """Return the mesh. Raises ComputationFailed unless it is the drawn plate, with all hinges and
    clamped edges.
    """
    mesh = mesh_of(arrays)
    check_triangles(mesh, float(arrays["areas"].sum()), len(components(layout)))
    meshed = np.bincount(mesh.bodies, jacobians(mesh)[:, -1] / 2, minlength=len(arrays["areas"]))
    count = len(layout.bodies)
    names = [part[0] for part in (*layout.bodies, *layout.joints)]
    worst = int(np.argmax(np.abs(meshed / arrays["areas"] - 1)))
    if abs(meshed[worst] / arrays["areas"][worst] - 1) > PART_AREA:
        raise ComputationFailed(
            f"mesh of {names[worst]} covers {meshed[worst]:.6g} mm^2, expected "
            f"{arrays['areas'][worst]:.6g}"
        )
    if (
        any(body.clamped and not body.fixed for body in layout.bodies)
        and "clamped" not in mesh.edges
    ):
        raise ComputationFailed("mesh has no clamped edges")
    nodes_of = [np.unique(mesh.triangles[mesh.bodies == part]) for part in range(len(names))]
    for index, joint in enumerate(layout.joints):
        across = len(mesh.edges.get(f"neck {index}", ()))
        expected = divisions.get(f"neck {index}", 1)
        if across < expected:
            raise ComputationFailed(
                f"mesh has {across} triangles across {joint.name}, expected {expected}"
            )
        for name, body in zip(("near", "far"), joint.bodies, strict=True):
            end = mesh.edges.get(f"end {index} {name}")
            if end is None or not all(
                np.isin(end, nodes_of[part]).all() for part in (body, count + index)
            ):
                raise ComputationFailed(
                    f"mesh does not connect {joint.name} to {layout.bodies[body].name}"
                )
    return ordered(mesh)[0]


def plate_contours(layout: Layout) -> list[list[Segment]]:
    """Return the contours of the plate: closed loops of lines and arcs, counter-clockwise, around
    holes clockwise.

    Lines and circular arcs are exact; arcs in place of other curves are within 1e-4 mm of them. The
    loops of one connected part follow each other, the outer one first."""
    check_layout(layout)
    contours: list[list[Segment]] = run_mesher(PlateContours(regions_of(layout)), TIME_LIMIT)
    return contours
