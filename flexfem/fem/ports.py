"""Finite elements of a mechanism: loads on its ports, weight, heat and modes by one factorisation.

A load acts at a contact as a body force over a part of a body, and the motion of the contact is
conjugate to it (see `Patch`), so that the compliance between ports is symmetric. Bodies that are
fixed are left out: their nodes are held."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.body_stress import body_nodes
from flexfem.fem.elements import (
    MASS_QUADRATURE,
    Layers,
    Plate,
    highest_stress,
    mirrored,
    stress_tensor,
    von_mises,
)
from flexfem.fem.mesh import PlaneMesh, gradients, quadrature, shape_functions
from flexfem.fem.modes import Modes, modes, vibrating_structure
from flexfem.fem.response import HEAT_CASES, Factorised, Response, free_displacement, resultants_of
from flexfem.fem.structure import NONE, Mass, Structure, mass_of, structure
from flexfem.fem.symmetry import full_space
from flexfem.mechanism.hinge_place import in_hinge
from flexfem.mechanism.layout import Joint, Layout, Patch
from flexfem.refused import ComputationFailed

SUBDIVISION = 8  # of the sides of a triangle that the edge of a patch crosses
# the same where the end of a hinge crosses: drift is as exact as the mean of a body
SUBDIVISION_AT_HINGE = 16
# of a part of a body that is no more than a point: its second moment, per that about a remote point
SLIVER = 1e-9


def plate_of_layout(
    layout: Layout, layers: Layers | None = None, mesh: PlaneMesh | None = None
) -> Plate:
    """Return the plate of the plane problem, or with layers the material itself.

    mesh : with the parts of the layout, for elastic constants of its triangles; needed if these
        differ.
    """
    if layout.mixed and mesh is not None:
        constants = [[*one[:2], one.out_of_plane] for one in layout.materials]
        E, nu, ratio = np.array(constants)[mesh.bodies].T
    else:
        E = layout.youngs_modulus
        nu = layout.poissons_ratio
        ratio = layout.out_of_plane
    if layers is None:
        return Plate(E, nu, layout.thickness)
    own_nu = np.where(ratio, ratio, nu) if np.ndim(nu) else ratio or nu
    return Plate(E * (1 - ratio**2), own_nu, layout.thickness)


def layers_of_layout(
    layout: Layout,
    number: int,
    antisymmetric: bool = False,
) -> Layers:
    """Return layers graded for the narrowest neck, in half of the thickness.

    They are those of motion in the plane or, antisymmetric, out of it.
    """
    thickness = layout.thickness
    necks = (joint.profile.neck for joint in layout.joints)
    layers = mirrored(thickness, number, min(necks, default=thickness))
    return layers.antisymmetric if antisymmetric else layers


def density_of_layout(layout: Layout, mesh: PlaneMesh) -> float | Array:
    """Return the density, tonne/mm^3; (m,), of triangles, if parts have different materials."""
    if not layout.mixed:
        return layout.density
    return np.array([one.density for one in layout.materials])[mesh.bodies]


def held_nodes(layout: Layout, mesh: PlaneMesh) -> Index:
    """Nodes of fixed bodies and clamped edges, ascending."""
    of_fixed = mesh.triangles[_is_fixed(layout, mesh)]
    return np.unique(np.append(of_fixed, mesh.edges.get("clamped", NONE)))


def _is_fixed(layout: Layout, mesh: PlaneMesh) -> NDArray[np.bool_]:
    """Return which triangles (m,) belong to fixed bodies."""
    return np.isin(mesh.bodies, np.flatnonzero([body.fixed for body in layout.bodies]))


class _ContactArea(NamedTuple):
    """Triangles (m, 6) of a body that may be within a radius, mm, of a point."""

    triangles: Index
    radius: float


def contact_forces(
    layout: Layout,
    mesh: PlaneMesh,
    patch: Patch,
    lifting: bool = False,
) -> Array:
    """Nodal forces (3, n, 2) of unit loads at the point of a patch: forces along x and y, moment.

    If `lifting`, forces (3, n, 1) along z, of a unit force along z and unit moments about x and y.
    They are in N and N mm, and zero for a patch on the ground outside the plate. Radii below a
    fifth of a triangle are increased. The corners of hinges that the mesh counts with the body, see
    `plate.end_lines`, carry no load.

    Raises ComputationFailed when no part of the body is within the radius.
    """
    if patch.body < 0:
        return np.zeros((3, len(mesh.nodes), 1 if lifting else 2))
    area = _contact_area(mesh, patch)
    even, along_x, along_y = _forces_of_densities(layout, mesh, patch, area)
    arms = mesh.nodes - [patch.point.real, patch.point.imag]
    zero = np.zeros_like(even)
    forces = np.moveaxis(np.array([[even, zero], [zero, even], [-along_y, along_x]]), 1, 2)
    resultants = resultants_of(arms, forces)
    if not np.linalg.det(resultants) > SLIVER * resultants[0, 0] ** 2 * resultants[2, 2]:
        raise ComputationFailed(
            f"no part of body {patch.body} within {area.radius:g} mm of "
            f"({patch.point.real:g}, {patch.point.imag:g}) mm"
        )
    if lifting:
        along_z = np.array([even, along_y, -along_x])
        moments = np.stack([np.ones(len(mesh.nodes)), *arms.T[::-1]])
        resultants = np.diag([1.0, 1.0, -1.0]) @ moments @ along_z.T
        forces = along_z[..., None]
    return np.tensordot(np.linalg.inv(resultants).T, forces, axes=1)


def _contact_area(mesh: PlaneMesh, patch: Patch) -> _ContactArea:
    """Return the triangles near the point of a patch, all of its body if it has no radius."""
    triangles = mesh.triangles[mesh.bodies == patch.body]
    if patch.radius is None or not len(triangles):
        return _ContactArea(triangles, np.inf)
    at = mesh.nodes[triangles] - [patch.point.real, patch.point.imag]
    middle = at.mean(axis=1)
    size = np.max(np.hypot(*(at - middle[:, None]).T), axis=0)
    away = np.hypot(*middle.T)
    radius = max(patch.radius, float(size[np.argmin(away)]) / 3)
    return _ContactArea(triangles[away < radius + size], radius)


def _forces_of_densities(
    layout: Layout, mesh: PlaneMesh, patch: Patch, area: _ContactArea
) -> Array:
    """Nodal forces (3, n) of the densities 1, x and y from the point, over the area of a contact.

    Triangles that the edge of the area or a hinge crosses are divided.
    """
    point = np.array([patch.point.real, patch.point.imag])
    places = mesh.nodes[area.triangles]
    inside = np.max(np.hypot(*(places - point).T), axis=0, initial=0.0) <= area.radius
    crossed = _in_hinges(layout, patch.body, places @ [1, 1j]).any(axis=1)
    parts = [
        (inside & ~crossed, quadrature(MASS_QUADRATURE)),
        (~inside & ~crossed, _subdivided(SUBDIVISION)),
        (crossed, _subdivided(SUBDIVISION_AT_HINGE)),
    ]
    forces = np.zeros((3, len(mesh.nodes)))
    for which, rule in parts:
        nodal = _by_triangles(layout, patch, area.radius, places[which], rule)
        for force, values in zip(forces, nodal, strict=True):
            np.add.at(force, area.triangles[which], values)
    return forces


def _by_triangles(
    layout: Layout, patch: Patch, radius: float, places: Array, rule: tuple[Array, Array]
) -> Array:
    """Nodal forces (3, e, 6) of the densities 1, x and y over triangles at places (e, 6, 2), mm.

    Points beyond the radius and in hinges of the body do not count.

    rule : points (q, 2) on the reference triangle and weights (q,).
    """
    points, weights = rule
    phi = shape_functions(points)[0]
    x, y = np.einsum("eid,iq->deq", places - [patch.point.real, patch.point.imag], phi)
    in_hinges = _in_hinges(layout, patch.body, patch.point + x + 1j * y)
    counted = (np.hypot(x, y) <= radius) & ~in_hinges
    determinant = gradients(places, points)[1]
    densities = np.array([np.ones_like(x), x, y]) * (np.abs(determinant) * weights * counted)
    return np.asarray(np.einsum("keq,iq->kei", densities, phi))


def forces_on_ports(layout: Layout, mesh: PlaneMesh) -> Array:
    """Nodal forces (k, n, 2), N, of unit loads on the ports, those on held nodes included."""
    patches = dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts)
    contacts = {patch: contact_forces(layout, mesh, patch) for patch in patches}
    found = list[Array]()
    for port in layout.ports:
        parts = [np.tensordot(wrench, contacts[patch], axes=1) for patch, wrench in port.parts]
        found.append(np.sum(parts, axis=0))
    return np.array(found)


def _in_hinges(
    layout: Layout,
    body: int,
    z: AnyArray,
) -> NDArray[np.bool_]:
    """Return which points (...), mm, lie in the hinges of a body."""
    found = np.zeros(z.shape, dtype=np.bool_)
    for joint in layout.joints:
        if body in joint.bodies:
            found |= in_hinge(joint, z)
    return found


def _subdivided(count: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) of the midpoint rule on a divided reference triangle.

    count : of parts of each side.
    """
    corners = [(i, j, up) for i in range(count) for j in range(count - i) for up in (1, 2)]
    points = np.array([(i + up / 3, j + up / 3) for i, j, up in corners if i + j + up <= count])
    return points / count, np.full(len(points), 0.5 / len(points))


@dataclass(frozen=True)
class PlateModel(Factorised):
    """A factorised plate with all loads that act on it.

    `structure` has the bodies that are not fixed.

    layout : the mechanism.   mesh : the whole, whose nodes are those of `structure`.
    port_forces : nodal forces (k, n, ...), N, of unit loads on the ports, those on held nodes
        included.
    """

    layout: Layout = field(kw_only=True)
    mesh: PlaneMesh = field(kw_only=True)
    port_forces: Array = field(kw_only=True)

    @cached_property
    def mass(self) -> Mass:
        """Mass of the plate, its payloads and actuators.

        A body on the plate moves along x and y and rotates; out of the plane it moves along z and
        rotates about x and y, where a payload is a flat body, which has half of its moment of
        inertia."""
        structure = self.structure
        lifting = bool(structure.line.fixed)
        inertia = list[float]()
        loads = [np.zeros((structure.size, 0))]
        for patch, mass, moment in self._bodies_on_plate():
            inertia += [mass, moment / 2, moment / 2] if lifting else [mass, mass, moment]
            plane = contact_forces(self.layout, self.mesh, patch, lifting)
            loads.append(structure.loads(through_thickness(structure, plane)))
        density = density_of_layout(self.layout, structure.mesh)
        return mass_of(structure, density, np.diag(inertia), at=np.hstack(loads))

    def _bodies_on_plate(self) -> list[tuple[Patch, float, float]]:
        """Points, masses, tonne, and moments of inertia, tonne mm^2, of payloads and actuators."""
        found = [(load.contact, load.mass, load.inertia) for load in self.layout.payloads]
        for actuator in self.layout.actuators:
            found += [(contact, actuator.mass / 2, 0.0) for contact in actuator.contacts]
        return [body for body in found if body[1] or body[2]]


def through_thickness(structure: Structure, plane: Array) -> Array:
    """Spread forces (k, n, 2) in the plane, or (k, n, 1) along z, evenly through the thickness.

    The result is (k, n, *shape) as of `Structure`.
    """
    line = structure.line
    if line.axes == 2:
        return plane
    share = line.values @ line.weights / line.weights.sum()
    missing = (0, 1) if plane.shape[2] == 2 else (2, 0)
    return np.pad(plane[:, :, None] * share[:, None], [(0, 0), (0, 0), (0, 0), missing])


def _hinge_nodes(layout: Layout, mesh: PlaneMesh) -> tuple[Index, ...]:
    """Nodes of the triangles of every hinge, without those of `_at_fixed_end`."""
    parts = [
        np.unique(mesh.triangles[mesh.bodies == part + len(layout.bodies)])
        for part in range(len(layout.joints))
    ]
    pairs = zip(parts, layout.joints, strict=True)
    return tuple(nodes[~_at_fixed_end(layout, joint, mesh.nodes[nodes])] for nodes, joint in pairs)


def _at_fixed_end(
    layout: Layout,
    joint: Joint,
    nodes: Array,
) -> NDArray[np.bool_]:
    """Return which nodes (n, 2) of a hinge are near a fixed body.

    There the hinge is higher than a quarter of the way from neck to end. A fixed body is rigid. The
    stress at the corners of such an end is therefore singular, in heat
    most of all."""
    x = ((nodes @ [1, 1j] - joint.place) * np.exp(-1j * joint.heading)).real
    high = joint.profile.height(x) > 0.75 * joint.profile.neck + 0.25 * joint.profile.end_height
    fixed = [layout.bodies[body].fixed for body in joint.bodies]
    return np.asarray(high & np.where(x < 0, *fixed))


def hinge_stress(response: Response, loads: Array) -> Array:
    """Highest von Mises stress (..., h), MPa, at every hinge under loads.

    loads : (..., c), multiples of the cases.

    It is the highest at the nodes of the triangles of the hinge, without those of `_at_fixed_end`.
    At a sharp root, without a fillet, the stress is singular: it grows without limit as the mesh is
    refined."""
    flat = np.reshape(loads, (-1, len(response.nodal)))
    highest = [
        highest_stress(stress, flat, response.ratio_of(part)).max(axis=1)
        for stress, part in zip(response.stresses, response.hinge_numbers, strict=True)
    ]
    return np.reshape(np.transpose(highest), (*np.shape(loads)[:-1], len(highest)))


def warm_stress(
    response: Response,
    across: ArrayLike = 0.0,
    unlike: ArrayLike = 0.0,
) -> Array:
    """Highest von Mises stress (3 cases, h), MPa, at hinges, as `hinge_stress`, after
    `thermal_response`.

    across : () or (h,), MPa, stress out of the plane per kelvin besides that of plane strain.
    unlike : () or (h,), 1/K, expansion of the hinges less that of the plate.
    """
    numbers = response.hinge_numbers
    across_of = np.broadcast_to(across, len(numbers))
    unlike_of = np.broadcast_to(unlike, len(numbers))
    highest = [np.zeros((len(HEAT_CASES), 0))]
    for k, (nodes, stress) in enumerate(zip(response.regions, response.stresses, strict=True)):
        places = response.structure.mesh.nodes[nodes]
        temperature = np.vstack([np.ones(len(nodes)), places.T])
        own = stress - _held_back(response, numbers[k], unlike_of[k] * temperature, stress)
        values = von_mises(own, response.ratio_of(numbers[k]), across_of[k] * temperature)
        highest.append(values.reshape(len(values), -1).max(axis=1)[:, None])
    return np.hstack(highest)


def _held_back(
    response: Response,
    part: int,
    strain: Array,
    stress: Array,
) -> Array:
    """Return the stress, MPa, in the shape of `stress`, that holds a part back by a free strain.

    strain : (3 cases, p), the same in all directions, at p nodes.
    """
    structure = response.structure
    axes = stress.shape[-1]
    first = np.flatnonzero(structure.mesh.bodies == part)[:1]
    lame, mu = structure.plate.of(first).lame(axes)
    held = np.ravel((axes * lame + 2 * mu) * strain).reshape(strain.shape)
    held = held[:, :, None, None] * np.eye(axes)
    return held if axes == 2 else held[:, :, None]


def plate_model(
    layout: Layout,
    mesh: PlaneMesh,
    layers: Layers | None = None,
) -> PlateModel:
    """Factorise a plate, plane or extruded.

    With antisymmetric layers, the only port is the output out of the plane.

    Raises ComputationFailed when a part is not held, or for too many unknowns.
    """
    moving = ~_is_fixed(layout, mesh)
    part = mesh._replace(triangles=mesh.triangles[moving], bodies=mesh.bodies[moving])
    held = held_nodes(layout, mesh)
    whole = structure(part, plate_of_layout(layout, layers, part), layers, held=held)
    lifting = whole.line.fixed
    output = layout.points[0][1]
    plane = contact_forces(layout, mesh, output, True) if lifting else forces_on_ports(layout, mesh)
    forces = through_thickness(whole, plane)
    return PlateModel(
        whole,
        (full_space(whole),),
        whole.loads(forces),
        regions=_hinge_nodes(layout, part),
        bodies=body_nodes(layout, part, held),
        ratio=layout.out_of_plane,
        layout=layout,
        mesh=mesh,
        port_forces=forces,
    )


def plate_response(
    layout: Layout,
    mesh: PlaneMesh,
    layers: Layers | None = None,
) -> Response:
    """Solve for unit loads on the ports of a layout, in their order.

    Parameters
    ----------
    mesh : of the layout: `bodies` are those of the layout, then its hinges; held are fixed bodies
        and edges `clamped`.
    layers : through the thickness, for three dimensions.

    Raises ComputationFailed as `plate_model`, `contact_forces`, and when forces or energy do not
    balance."""
    return plate_model(layout, mesh, layers).response()


def thermal_response(
    model: PlateModel, expansion: float, ground_expansion: float, of_parts: Array | None = None
) -> Response:
    """Solve for `HEAT_CASES` with expansions of plate and ground, 1/K, in the plane or with layers.

    The ground expands about the origin as a free body of its own material; motions include this,
    and are relative to its mean over the thickness, which bows by a gradient.
    of_parts : expansions of all bodies, then of all hinges, if they differ from that of the plate.
    """
    response = model.thermal_response().under((ground_expansion - expansion) * HEAT_CASES)
    if of_parts is not None:
        unlike = (of_parts - expansion)[model.structure.mesh.bodies]
        strained = model.response(_loads_of_expansion(model.structure, unlike))
        response = replace(response, nodal=response.nodal + strained.nodal)
    of_free_body = free_displacement(model.mesh.nodes, model.structure.layers)
    free = expansion * np.tensordot(HEAT_CASES, of_free_body, axes=1)
    displacement = response.nodal + free
    layers = model.structure.layers
    if layers is not None and not layers.fixed:
        bowed = ground_expansion * HEAT_CASES @ _mean_of_free_body(layers)
        displacement = displacement - bowed[:, None, None]
    forces = model.port_forces.reshape(len(model.port_forces), -1)
    motions = forces @ displacement.reshape(len(free), -1).T
    for k, port in enumerate(model.layout.ports):
        for patch, wrench in port.parts:
            if patch.body < 0:
                motions[k] += ground_expansion * _motion_outside(patch.point) @ wrench
    return replace(response, motions=motions)


def _mean_of_free_body(layers: Layers) -> Array:
    """Return the displacements (3 cases, 3) of `free_displacement` at the origin, averaged over the
    thickness.
    """
    half = layers.heights[-1]
    return np.vstack([-(half**2) / 6 * np.eye(3)[:2], np.zeros(3)])


def _motion_outside(point: complex) -> Array:
    """Return the motion (3 cases, 3) of a point of the ground outside the plate per expansion."""
    at = np.array([[point.real, point.imag]])
    displacement = HEAT_CASES @ free_displacement(at)[:, 0]
    return np.column_stack([displacement, [0.0, point.imag, -point.real]])


def _loads_of_expansion(structure: Structure, expansion: Array) -> Array:
    """Loads (size, 3) that balance the free expansions (e,), 1/K, of triangles in `HEAT_CASES`."""
    line = structure.line
    nodes = structure.mesh.nodes
    forces = np.zeros((3, len(nodes), *structure.shape))
    for piece in (piece for batch in structure.batches for piece in batch.pieces()):
        x, y = np.einsum("iq,eid->deq", piece.phi, nodes[piece.triangles])
        strain = expansion[piece.numbers][:, None] * np.stack([np.ones_like(x), x, y])
        strain = np.repeat(strain, len(line.weights), axis=-1)
        free = strain[:, :, None, None] * np.eye(line.axes)[:, :, None]
        piece.add_forces(forces, line, stress_tensor(structure.plate.of(piece.numbers), free))
    return structure.loads(forces)


def plate_modes(
    model: PlateModel,
    count: int,
    engaged: bool = False,
) -> Modes:
    """Return the lowest `count` modes with payloads and the masses of actuators.

    engaged : whether the stiffness of actuators acts.

    With antisymmetric layers they are out of the plane, where the stiffness of actuators does not
    act. Raises ComputationFailed when they do not converge."""
    springs = model.layout.drive.stiffness * engaged
    structure = model.structure
    space = model.spaces[0]
    springs = springs[:0] if structure.line.fixed else springs
    stacks = model.ports[:, model.ports.shape[1] - len(springs) :]

    def twice(loads: Array) -> Array:
        motion = space.solve(loads)
        held = structure.loads(structure.forces(structure.fields(motion)))
        return motion + space.solve(loads - held)

    try:
        return modes(vibrating_structure(model.mass, stacks, springs, space), count)
    except ComputationFailed:  # round-off of necks of some hundredths of a millimetre
        refined = space._replace(solve=twice)
        return modes(vibrating_structure(model.mass, stacks, springs, refined), count)
