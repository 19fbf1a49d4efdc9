"""Highest stress of the moving bodies of a plate, and the places near which it is left out.

At a re-entrant corner without radius and at the ends of a clamped edge the stress of linear
elasticity is singular: it grows without limit as the mesh is refined. Where a load acts, the stress
follows from its idealisation as a body force over a disc. Nodes near such corners and loads are
therefore left out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.mesh import PlaneMesh, outer_sides, shape_functions
from flexfem.fem.response import Response
from flexfem.mechanism.layout import Body, Layout, Patch
from flexfem.mechanism.plate import mean_width

SHARP = np.deg2rad(20.0)  # turn of the edge of the plate at a corner without radius
# Distance from such a corner, per mean width of the body, within which nodes are left out: two
# triangles of the coarsest mesh. Farther away the stress at the corner of a bar is within a few per
# cent of that of a beam.
NEAR = 0.25
# distance from a contact, per radius, within which nodes are left out: a load is idealised there
AT_LOAD = 3.0


class BodyStress(NamedTuple):
    """Highest von Mises stress (..., b), MPa, of moving bodies, and its places (..., b, 2), mm."""

    highest: Array
    place: Array


def moving_bodies(layout: Layout) -> list[int]:
    """Return the indices of the bodies that are elastic: all that are not fixed."""
    return [index for index, body in enumerate(layout.bodies) if not body.fixed]


def sharp_corners(mesh: PlaneMesh, held: Index) -> Index:
    """Return the nodes at re-entrant corners of a mesh without radius, and at ends of held edges.

    held : nodes that do not move.
    """
    start, end, middle = outer_sides(mesh.triangles).T
    corners = np.intersect1d(start, end)
    z = mesh.nodes @ [1, 1j]
    leaving, arriving = np.zeros((2, len(z)), dtype=complex)
    leaving[start] = -3 * z[start] + 4 * z[middle] - z[end]
    arriving[end] = z[start] - 4 * z[middle] + 3 * z[end]
    turns = np.angle(leaving[corners] * arriving[corners].conjugate())
    is_held = np.isin(np.arange(len(z)), held)
    held_side = is_held[start] & is_held[middle] & is_held[end]
    held_sides = np.bincount(start, held_side, len(z)) + np.bincount(end, held_side, len(z))
    re_entrant = (held_sides[corners] == 0) & (turns < -SHARP)
    return np.asarray(corners[re_entrant | (held_sides[corners] == 1)])


def left_out_within(body: Body) -> float:
    """Return the distance, mm, from a sharp corner of a body within which its stress is left out.

    It is zero for a body without an outline, of which only the mesh is known.
    """
    if not body.outline:
        return 0.0
    return NEAR * (body.width or mean_width(body))


def corners_of_bodies(
    layout: Layout,
    mesh: PlaneMesh,
    held: Index,
) -> list[Index]:
    """Return the sharp corners of every moving body, those at the ends of its hinges included.

    mesh : of the bodies that are not fixed and of the hinges.   held : nodes that do not move.
    """
    corners = sharp_corners(mesh, held)
    return [
        np.intersect1d(corners, mesh.triangles[mesh.bodies == index])
        for index in moving_bodies(layout)
    ]


def body_nodes(
    layout: Layout,
    mesh: PlaneMesh,
    held: Index,
) -> tuple[Index, ...]:
    """Return the nodes of every moving body that are not near its sharp corners and loads.

    There is at least the farthest one.

    mesh, held : as of `corners_of_bodies`.
    """
    found = list[Index]()
    corners = corners_of_bodies(layout, mesh, held)
    for index, sharp in zip(moving_bodies(layout), corners, strict=True):
        nodes = np.unique(mesh.triangles[mesh.bodies == index])
        points = mesh.nodes[nodes]
        centres = [(mesh.nodes[corner], left_out_within(layout.bodies[index])) for corner in sharp]
        for patch in loaded_patches(layout, index):
            place = np.array([patch.point.real, patch.point.imag])
            centres.append((place, AT_LOAD * (patch.radius or 0.0)))
        away = np.full(len(nodes), np.inf)  # distances from all centres, each per its radius
        for centre, radius in centres:
            if radius:
                away = np.minimum(away, np.hypot(*(points - centre).T) / radius)
        found.append(nodes[away >= min(1.0, away.max())])
    return tuple(found)


def loaded_patches(layout: Layout, body: int) -> list[Patch]:
    """Return the contacts of a body with a radius at which the output or an actuator loads it."""
    contacts = [
        layout.points[0][1],
        *(patch for actuator in layout.actuators for patch in actuator.contacts),
    ]
    return [patch for patch in contacts if patch.body == body and patch.radius is not None]


def body_stress(
    response: Response,
    layout: Layout,
    loads: Array,
) -> BodyStress:
    """Return the highest stress of every body, at the nodes of `body_nodes`, under loads.

    loads : (..., c), multiples of the cases.

    The cases are unit loads on the ports. Nodes near loaded points are left out, too. With layers
    it is the highest over the thickness."""
    flat = np.reshape(loads, (-1, len(response.nodal)))
    bodies = moving_bodies(layout)
    highest = np.zeros((len(flat), len(bodies)))
    place = np.zeros((len(flat), len(bodies), 2))
    for number, body in enumerate(bodies):
        places = response.structure.mesh.nodes[response.bodies[number]]
        stress = response.body_stresses[number]
        ratio = response.ratio_of(body)
        for row, load in enumerate(flat):
            by_node = _highest_by_node(np.tensordot(load, stress, axes=1), ratio)
            by_node[~body_loads_apart(layout, places, number, load)] = 0.0
            worst = int(np.argmax(by_node))
            highest[row, number] = by_node[worst]
            place[row, number] = places[worst]
    shape = (*np.shape(loads)[:-1], len(bodies))
    return BodyStress(highest.reshape(shape), place.reshape(*shape, 2))


def _highest_by_node(stress: Array, ratio: float) -> Array:
    """Return the von Mises stress (n,) of nodes, with layers the highest over the thickness.

    stress : of the n nodes, as of `nodal_stress` for one load.   ratio : Poisson's ratio.
    """
    values = von_mises(stress, ratio)
    return np.asarray(values.reshape(len(values), -1).max(axis=1))


def body_loads_apart(
    layout: Layout,
    places: Array,
    number: int,
    load: Array,
) -> NDArray[np.bool_]:
    """Return which places (n, 2), mm, of a moving body are not near loaded points.

    load : (c,), on the ports.

    All of them where no place is left.
    """
    away = np.ones(len(places), dtype=np.bool_)
    for patch in _loaded_points(layout, moving_bodies(layout)[number], load):
        centre = [patch.point.real, patch.point.imag]
        near = np.hypot(*(places - centre).T) < AT_LOAD * (patch.radius or 0.0)
        if not near.all():
            away &= ~near
    return away if away.any() else np.ones_like(away)


def _loaded_points(
    layout: Layout,
    body: int,
    load: Array,
) -> list[Patch]:
    """Return the points of a body, besides the output, that a load (c,) on the ports loads."""
    found = list[Patch]()
    for number, (_, patch) in enumerate(layout.points[1:], start=1):
        if patch.body == body and np.any(load[3 * number : 3 * number + 3]):
            found.append(patch)
    return found


def point_stress(
    response: Response,
    layout: Layout,
    loads: Array,
) -> Array:
    """Return the von Mises stress (..., p), MPa, at the points of a layout under loads.

    loads : (..., c), multiples of the cases.

    It is that of the nearest place of the body of the point; with layers, the highest over the
    thickness. It is nan at the output, where it follows from the idealised load, and on fixed
    bodies."""
    flat = np.reshape(loads, (-1, len(response.nodal)))
    found = np.full((len(flat), len(layout.points)), np.nan)
    mesh = response.structure.mesh
    plate = response.structure.plate
    layers = response.structure.layers
    for number, (_, patch) in enumerate(layout.points[1:], start=1):
        triangles = mesh.triangles[mesh.bodies == patch.body]
        if not len(triangles):
            continue
        nodes, weights = _interpolation(mesh.nodes, triangles, patch.point)
        of_nodes = nodal_stress(
            mesh, plate, response.nodal, np.sort(nodes), layers, part=patch.body
        )
        stress = of_nodes[:, np.argsort(np.argsort(nodes))]
        at_point = np.tensordot(weights, stress, axes=(0, 1))
        values = von_mises(np.tensordot(flat, at_point, axes=1), response.ratio_of(patch.body))
        found[:, number] = values.reshape(len(flat), -1).max(axis=1)
    return found.reshape(*np.shape(loads)[:-1], len(layout.points))


def _interpolation(
    places: Array,
    triangles: Index,
    point: complex,
) -> tuple[Index, Array]:
    """Return the nodes (6,) of the triangle nearest to a point or around it, and their weights."""
    corners = places[triangles[:, :3]] @ [1, 1j]
    a, b, c = corners.T
    area = ((b - a).conjugate() * (c - a)).imag
    opposite = ((b, c), (c, a), (a, b))
    areas = [((end - start).conjugate() * (point - start)).imag for start, end in opposite]
    shares = np.array(areas) / area
    nearest = int(np.argmax(shares.min(axis=0)))
    inside = np.clip(shares[:, nearest], 0.0, None)
    inside = inside / inside.sum()
    return triangles[nearest], shape_functions(inside[None, 1:])[0][:, 0]
