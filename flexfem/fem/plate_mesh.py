"""Mesh and contours of any plate mechanism, by OpenCASCADE in the process of `meshing`.

Triangles are as small as `Profile.sizes` asks in a hinge and grow from there at the rate of `sizes`
up to a size that follows the width of each body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import (
    PlaneMesh,
    PoorTriangles,
    TooManyTriangles,
    check_count,
    check_triangles,
    jacobians,
    mesh_of,
    ordered,
)
from flexfem.fem.plate_symmetry import divided, symmetry_of
from flexfem.fem.refinement import refinements
from flexfem.fem.sizes import COARSEST, TIME_LIMIT, first_good, smaller_at
from flexfem.mechanism.hinge_place import cuts_of, end_lines, joint_loop, neck_line, section_middle
from flexfem.mechanism.layout import Joint, Layout, Move
from flexfem.mechanism.outlines import Segment, circle_of, reverse
from flexfem.mechanism.plate import components, mean_width
from flexfem.mechanism.plate_checks import check_layout, triangles_needed
from flexfem.meshing.process import MeshTimeout, run_mesher
from flexfem.meshing.requests import Line, NamedArrays, PlateContours, PlateMesh, Region
from flexfem.refused import ComputationFailed

PART_AREA = 2e-3  # relative, of a body or hinge; parabolas stand for arcs
OF_GROUND = 4.0  # times larger are the triangles of a rigid body
ATTEMPTS = 8
LOCAL_ATTEMPTS = 5  # to mesh a plate, and one with its symmetry
FINER = 0.8  # size of all triangles in the next attempt
OTHER_ALGORITHM = {6: 5, 5: 6}
TIME_PER_TRIANGLE = 5e-4  # s, added to the time limit; gmsh takes 6e-5 s on an idle machine
ROUND_UP = 1e-6  # of a number of triangles, which round-off may have increased


def regions_of(layout: Layout, circles: bool = False) -> list[Region]:
    """Return the faces of the plate, bodies then hinges.

    circles : whether round loops are one curve.
    """

    def drawn(loop: Sequence[Segment]) -> Sequence[Segment]:
        circle = circle_of(loop) if circles else None
        return [Segment(loop[0].start, loop[0].start, circle[0])] if circle else loop

    found = list[Region]()
    for index, body in enumerate(layout.bodies):
        holes = [drawn(reverse(hole)) for hole in body.holes]
        found.append(Region([drawn(body.outline), *holes], cuts_of(layout, index)))
    return found + [Region([joint_loop(joint)], []) for joint in layout.joints]


def mesh_layout(layout: Layout, resolution: int) -> PlaneMesh:
    """Return the mesh of a plate mechanism with a number of triangles across a neck.

    Its `bodies` are indices of bodies of the layout, and of its hinges plus the number of bodies.
    Its edges are labelled `neck 0` at the centre of a hinge, `end 0 near` and `end 0 far` where it
    meets its first and second body, and `clamped` on the clamped edges of elastic bodies.

    The mesh has the symmetry of the plate, see `symmetry_of`. For the number across a neck see
    `Profile.sizes`.

    Raises BadInput for a layout that cannot be made, ComputationFailed when the mesh fails its
    checks, MeshTimeout when it takes too long.
    """
    check_layout(layout)
    moves = symmetry_of(layout)
    drawing = _drawing(layout, max(resolution, 2), moves)  # one across an arc would degenerate
    if moves:
        regions, dividing = divided(layout, drawing.regions, moves)
        lines = [*drawing.lines, *dividing]
        symmetric = drawing._replace(
            regions=regions,
            lines=lines,
            moves=moves,
        )
        with suppress(ComputationFailed):  # gmsh cannot draw it: a mesh without symmetry, then
            return _accepted(layout, symmetric, drawing.divisions, LOCAL_ATTEMPTS)
    return _accepted(layout, drawing, drawing.divisions, ATTEMPTS)


def _drawing(
    layout: Layout,
    resolution: int,
    moves: Sequence[Move],
) -> PlateMesh:
    """Return the drawing of a plate without its symmetry, and the sizes of triangles."""
    bodies = len(layout.bodies)
    necks = list[Line]()
    ends = list[Line]()
    divisions = dict[str, int]()
    for index, joint in enumerate(layout.joints):
        _check_number(joint, resolution)
        necks.append(Line(f"neck {index}", neck_line(joint), bodies + index))
        ends += _end_lines(layout, index)
        across = _edges_across(joint, resolution)
        if across is not None:
            divisions[f"neck {index}"] = across
    clamped = [
        Line("clamped", body.outline[edge], number)
        for number, body in enumerate(layout.bodies)
        for edge in body.clamped
        if not body.fixed
    ]
    largest = _largest_sizes(layout, resolution)
    gradings = refinements(layout, resolution, largest, moves)
    lines = necks + ends + clamped
    return PlateMesh(regions_of(layout), lines, divisions, gradings, largest)


def _check_number(joint: Joint, resolution: int) -> None:
    """Raise TooManyTriangles for a hinge that alone would need too many."""
    x, weights = joint.profile.quadrature
    needed = 2 * resolution**2 * float(np.sum(weights / joint.profile.height(x)))
    check_count(needed, f"{joint.name} needs about")


def _end_lines(layout: Layout, index: int) -> list[Line]:
    """Return the lines where a hinge meets its two bodies."""
    joint = layout.joints[index]
    found = list[Line]()
    for name, side, body in zip(("near", "far"), (-1, 1), joint.bodies, strict=True):
        ends = end_lines(joint, side, layout.bodies[body].fixed)
        found += [Line(f"end {index} {name}", line, body) for line in ends]
    return found


def _edges_across(joint: Joint, resolution: int) -> int | None:
    """Return the number of equal edges across a neck, None where they need not be equal."""
    middle = section_middle(joint)
    at_neck = [
        size
        for points, size, radius in joint.profile.sizes(resolution)
        if min(abs(z - middle) for z in points) <= radius
    ]
    if not at_neck or not joint.profile.even_section:
        return None
    height = float(joint.profile.height(np.array(middle.real)))
    return math.ceil(height / min(at_neck) - ROUND_UP)


def _largest_sizes(layout: Layout, resolution: int) -> list[float]:
    """Return the sizes of triangles, mm, far from small ones, in bodies, then in hinges."""
    found = list[float]()
    for body in layout.bodies:
        size = COARSEST * (body.width or mean_width(body)) / resolution
        found.append(size * OF_GROUND if body.fixed else size)
    return found + [joint.profile.end_height * COARSEST / resolution for joint in layout.joints]


def _accepted(
    layout: Layout,
    job: PlateMesh,
    across: dict[str, int],
    attempts: int,
) -> PlaneMesh:
    """Return the first mesh that passes its checks.

    across : least number of triangles across each neck.
    """
    time_limit = TIME_LIMIT + TIME_PER_TRIANGLE * triangles_needed(layout)

    def mesh(job: PlateMesh) -> PlaneMesh:
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
    return job._replace(
        gradings=gradings,
        largest=largest,
        algorithm=algorithm,
    )


def _checked(
    layout: Layout,
    arrays: NamedArrays,
    divisions: dict[str, int],
) -> PlaneMesh:
    """Return the mesh of a plate.

    Raises ComputationFailed unless it is the drawn plate, with all hinges and clamped edges.
    """
    mesh = mesh_of(arrays)
    check_triangles(mesh, float(arrays["areas"].sum()), len(components(layout)))
    names = [body.name for body in layout.bodies] + [joint.name for joint in layout.joints]
    _check_areas(mesh, arrays["areas"], names)
    elastic = [body for body in layout.bodies if not body.fixed]
    if any(body.clamped for body in elastic) and "clamped" not in mesh.edges:
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
            end = mesh.edges.get(f"end {index} {name}", np.array([-1]))
            joined = (nodes_of[body], nodes_of[len(layout.bodies) + index])
            if not all(np.isin(end, nodes).all() for nodes in joined):
                raise ComputationFailed(
                    f"mesh does not connect {joint.name} to {layout.bodies[body].name}"
                )
    return ordered(mesh)[0]


def _check_areas(
    mesh: PlaneMesh,
    drawn: Array,
    names: Sequence[str],
) -> None:
    """Raise ComputationFailed unless every part has its drawn area (parts,), mm^2."""
    meshed = np.bincount(mesh.bodies, jacobians(mesh)[:, -1] / 2, minlength=len(drawn))
    worst = int(np.argmax(np.abs(meshed / drawn - 1)))
    if abs(meshed[worst] / drawn[worst] - 1) > PART_AREA:
        raise ComputationFailed(
            f"mesh of {names[worst]} covers {meshed[worst]:.6g} mm^2, expected {drawn[worst]:.6g}"
        )


def plate_contours(layout: Layout) -> list[list[Segment]]:
    """Return the contours of the plate: closed loops of lines and arcs.

    They are counter-clockwise, around holes clockwise.

    Lines and circular arcs are exact; arcs in place of other curves are within 1e-4 mm of them. The
    loops of one connected part follow each other, the outer one first."""
    check_layout(layout)
    contours: list[list[Segment]] = run_mesher(PlateContours(regions_of(layout)), TIME_LIMIT)
    return contours
