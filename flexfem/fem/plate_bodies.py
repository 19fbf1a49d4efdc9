"""Compliances of bodies and hinges of a plate, each alone, by plane finite elements.

They are those of the parts of the analytic network.

The end sections of hinges move rigidly, and each contact as the motion conjugate to its load. With
the loads B, the conjugate loads F of the mean motion of the body, and the stiffness K of the body
held at the end of one hinge,

    C = (B - F)' K^-1 (B - F),

as every load of B is balanced by F, and the mean motion F' u is subtracted. With clamped edges F is
left out. A hinge is held at its first body and loaded at its second, both of which leave their
section of it plane.
"""

from __future__ import annotations

from collections.abc import Hashable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.fem.ports import contact_forces, plate_of_layout
from flexfem.fem.response import factorised_whole
from flexfem.fem.structure import NONE, structure
from flexfem.mechanism.layout import ElasticBody, End, Layout, Move, Patch, interfaces

ALIKE = 1e-11  # relative to the coordinates, of points of bodies that are equal


class _Marks(NamedTuple):
    """Points (n, 2) of a body, and hashes (n,) of what is there.

    They are first its interfaces, then the ends of its edges.

    The centre of a hinge and a point on its axis; the point of a patch twice; the centre of an
    unsymmetric hinge and a point to the left; the middle of an edge and one end.
    """

    points: AnyArray
    kinds: AnyArray


def body_compliances(layout: Layout, mesh: PlaneMesh) -> tuple[ElasticBody, ...]:
    """Compliances of all bodies that are not fixed, in their order.

    Of bodies that are equal up to a rotation, shift or mirror image, the one with most patches is
    solved for all.

    mesh : of the layout, with edges `end 0 near`, `end 0 far` and so on of the hinges.
    Raises ComputationFailed for a body that no hinge or clamped edge holds.
    """
    moving = [number for number, body in enumerate(layout.bodies) if not body.fixed]
    solved = list[tuple[_Marks, ElasticBody]]()
    found = dict[int, ElasticBody]()
    for body in sorted(moving, key=lambda body: -len(interfaces(layout, body))):
        marks = _marks(layout, body)
        moved = _moved_body(layout, body, marks, solved)
        if moved is None:
            moved = _elastic_body(layout, mesh, body)
            solved.append((marks, moved))
        found[body] = moved
    return tuple(found[body] for body in moving)


def _moved_body(
    layout: Layout, body: int, marks: _Marks, solved: list[tuple[_Marks, ElasticBody]]
) -> ElasticBody | None:
    """Return a body by an equal one among those that are solved; None without one."""
    at = interfaces(layout, body)
    for others, other in solved:
        alike = _alike(others, marks)
        if alike is not None:
            move, place = alike
            T = np.kron(np.eye(len(at)), move.of_twists)
            rows = (3 * place[: len(at), None] + [0, 1, 2]).ravel()
            return ElasticBody(body, at, T @ other.compliance[np.ix_(rows, rows)] @ T.T)
    return None


def _marks(layout: Layout, number: int) -> _Marks:
    marks = list[tuple[complex, complex, Hashable]]()
    body = layout.bodies[number]
    for one in interfaces(layout, number):
        if isinstance(one, Patch):
            marks.append((one.point, one.point, ("patch", one.radius and round(one.radius, 9))))
        else:
            joint = layout.joints[one.hinge]
            tip = joint.place + joint.profile.length * np.exp(1j * joint.heading)
            marks.append((joint.place, tip, (joint.sided[0], joint.cut, one.far)))
    for joint in layout.joints:
        if number in joint.bodies and not joint.profile.symmetric:
            profile, left = joint.sided
            tip = joint.place + joint.profile.length * left
            marks.append((joint.place, tip, ("left", profile)))
    edges = [edge for loop in (body.outline, *body.holes) for edge in loop]
    for k, edge in enumerate(edges):
        kind = ("edge", k in body.clamped, body.material)
        marks += [(complex(edge.at(0.5)), end, kind) for end in (edge.start, edge.end)]
    points = np.array([mark[:2] for mark in marks])
    return _Marks(points, np.array([hash(mark[2]) for mark in marks]))


def _alike(one: _Marks, other: _Marks) -> tuple[Move, Index] | None:
    """Return the move from a body to an equal one, and the mark of the first at each of the other.

    It is None without one.

    The other body can have fewer patches.
    """
    is_patch, of_other = (marks.points[:, 0] == marks.points[:, 1] for marks in (one, other))
    fixed_kinds = np.sort(one.kinds[~is_patch])
    if is_patch[0] or not np.array_equal(fixed_kinds, np.sort(other.kinds[~of_other])):
        return None
    same = one.kinds[:, None] == other.kinds
    tolerance = ALIKE * np.abs(one.points).max()
    for (start, tip), mirrored in product(other.points[same[0]], (False, True)):
        first, second = Move(mirrored=mirrored)(one.points[0])
        factor = np.exp(1j * np.angle((tip - start) / (second - first)))
        move = Move(factor, start - factor * first, mirrored)
        fits = same & (np.abs(move(one.points)[:, None] - other.points).max(axis=2) < tolerance)
        if fits.any(axis=0).all() and (fits.any(axis=1) | is_patch).all():
            return move, fits.argmax(axis=0)
    return None


def hinge_compliances(layout: Layout, mesh: PlaneMesh) -> Array:
    """Compliances (h, 3, 3) of all hinges as `Profile.compliance`.

    mesh : as for `body_compliances`.

    Hinges are alike if they have one profile and end at rigid bodies on the same sides, see
    `plate.end_lines`.
    """
    kinds = [
        (joint.profile, joint.material, *(layout.bodies[body].fixed for body in joint.bodies))
        for joint in layout.joints
    ]
    found = {kind: _hinge(layout, mesh, kinds.index(kind)) for kind in dict.fromkeys(kinds)}
    return np.array([found[kind] for kind in kinds]).reshape(-1, 3, 3)


def _hinge(
    layout: Layout,
    mesh: PlaneMesh,
    number: int,
) -> Array:
    joint = layout.joints[number]
    part = body_mesh(mesh, len(layout.bodies) + number)
    z = (part.nodes @ [1, 1j] - joint.place) * np.exp(-1j * joint.heading)
    part = part._replace(nodes=np.column_stack([z.real, z.imag]))
    near, far = (nodes_on(part, f"end {number} {side}") for side in ("near", "far"))
    plate = plate_of_layout(layout, mesh=part)
    C = factorised_whole(structure(part, plate, held=near, sections=[far])).response().compliance
    if joint.profile.symmetric:
        C[0, 1:] = 0.0
        C[1:, 0] = 0.0
    return C


def body_mesh(mesh: PlaneMesh, body: int) -> PlaneMesh:
    """Return the triangles of a body with their nodes and the edges on it."""
    return part_mesh(mesh, mesh.bodies == body)[0]


def part_mesh(mesh: PlaneMesh, chosen: NDArray[np.bool_]) -> tuple[PlaneMesh, Index]:
    """Return chosen triangles (m,) with their nodes and edges, and the numbers of all nodes there.

    The numbers (n,) are -1 for nodes that are not there.
    """
    used = np.unique(mesh.triangles[chosen])
    number = np.full(len(mesh.nodes), -1)
    number[used] = np.arange(len(used))
    edges = {
        name: number[edge[np.all(number[edge] >= 0, axis=1)]] for name, edge in mesh.edges.items()
    }
    return PlaneMesh(
        mesh.nodes[used], number[mesh.triangles[chosen]], mesh.bodies[chosen], edges
    ), number


def _elastic_body(
    layout: Layout,
    mesh: PlaneMesh,
    body: int,
) -> ElasticBody:
    at = interfaces(layout, body)
    part = body_mesh(mesh, body)
    clamped = bool(layout.bodies[body].clamped)
    sections = [
        nodes_on(part, f"end {one.hinge} {'far' if one.far else 'near'}")
        for one in at
        if isinstance(one, End)
    ]
    held = np.unique(part.edges["clamped"]) if clamped else np.concatenate([NONE, *sections[:1]])
    moving = sections if clamped else sections[1:]
    whole = structure(part, plate_of_layout(layout, mesh=part), held=held, sections=moving)

    def loads(patch: Patch) -> Array:
        return whole.loads(contact_forces(layout, part, patch))

    on_sections = np.eye(whole.size, whole.poses, whole.poses - whole.size)
    none_on_held = np.zeros((whole.size, 3 * len(sections) - whole.poses))
    B = [
        none_on_held,
        on_sections,
        *(loads(one) @ _at(one.point) for one in at if isinstance(one, Patch)),
    ]
    balanced = np.hstack(B)
    if not clamped:
        balanced = balanced - np.tile(loads(Patch(body, 0j)), len(at))
    return ElasticBody(body, at, factorised_whole(whole, balanced).response().compliance)


def _at(point: complex) -> Array:
    """Wrench (3, 3) at a point per unit wrench at the origin."""
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [point.imag, -point.real, 1.0]])
