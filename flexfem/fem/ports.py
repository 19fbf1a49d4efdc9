"""Finite elements of any plate mechanism: unit loads on its ports, weight, heat and modes from one factorisation.

A load acts at a contact as a body force over a part of a body, and the motion of the contact is conjugate to it (see
`Patch`), so that the compliance between ports is symmetric. Bodies that are fixed are left out: their nodes are held.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index
from flexfem.fem.elements import MASS_QUADRATURE, Layers, Plate, nodal_stress, von_mises
from flexfem.fem.mesh import StageMesh, gradients, quadrature, shape_functions
from flexfem.fem.modes import Modes, modes, vibrating_structure
from flexfem.fem.response import free_displacement, refined_solution, resultants_of
from flexfem.fem.structure import NONE, Structure, mass_of, structure
from flexfem.fem.symmetry import Space, full_space
from flexfem.mechanism.layout import Joint, Layout, Patch
from flexfem.refused import ComputationFailed

SUBDIVISION = 8  # of the sides of a triangle that the edge of a patch crosses
SLIVER = 1e-9  # of a part of a body that is no more than a point: its second moment, per that about a remote point
LARGEST = 4_000_000  # stress components computed at once


def plate_of_layout(layout: Layout, layers: Layers | None = None) -> Plate:
    """Return the plate of the plane problem, or with layers the material itself."""
    E, nu, ratio = layout.youngs_modulus, layout.poissons_ratio, layout.out_of_plane
    return (
        Plate(E, nu, layout.thickness) if layers is None else Plate(E * (1 - ratio**2), ratio or nu, layout.thickness)
    )


def held_nodes(layout: Layout, mesh: StageMesh) -> Index:
    """Nodes of fixed bodies and clamped edges, ascending."""
    return np.unique(np.append(mesh.triangles[_is_fixed(layout, mesh)], mesh.edges.get("clamped", NONE)))


def _is_fixed(layout: Layout, mesh: StageMesh) -> NDArray[np.bool_]:
    """Return which triangles (m,) belong to fixed bodies."""
    return np.isin(mesh.bodies, np.flatnonzero([body.fixed for body in layout.bodies]))


def contact_forces(mesh: StageMesh, patch: Patch, lifting: bool = False) -> Array:
    """Nodal forces (3, n, 2) of a unit force along x and y, N, and a unit moment, N mm, at the point of a patch.

    If `lifting`, forces (3, n, 1) along z, of a unit force along z and unit moments about x and y. They are zero for a
    patch on the ground outside the plate. Radii below a fifth of a triangle are increased.
    Raises ComputationFailed when no part of the body is within the radius.
    """
    triangles, point = mesh.triangles[mesh.bodies == patch.body], np.array([patch.point.real, patch.point.imag])
    sums, radius, whole = np.zeros((3, len(mesh.nodes))), np.inf, quadrature(MASS_QUADRATURE)
    if patch.body < 0:
        return np.zeros((*sums.shape, 1 if lifting else 2))
    parts = [(triangles, whole)]
    if patch.radius is not None and len(triangles):
        at = mesh.nodes[triangles] - point
        middle = at.mean(axis=1)
        size, away = np.max(np.hypot(*(at - middle[:, None]).T), axis=0), np.hypot(*middle.T)
        radius = max(patch.radius, float(size[np.argmin(away)]) / 3)
        inside = np.max(np.hypot(*at.T), axis=0) <= radius
        parts = [(triangles[inside], whole), (triangles[~inside & (away < radius + size)], _subdivided())]
    for chosen, (points, weights) in parts:
        phi, determinant = shape_functions(points)[0], gradients(mesh.nodes[chosen], points)[1]
        x, y = np.einsum("eid,iq->deq", mesh.nodes[chosen] - point, phi)
        area, one = np.abs(determinant) * weights * (np.hypot(x, y) <= radius), np.ones_like(x)
        nodal = np.einsum("keq,iq->kei", np.array([one, x, y]) * area, phi)
        for total, values in zip(sums, nodal, strict=True):
            np.add.at(total, chosen, values)
    even, along_x, along_y = sums  # nodal forces of densities 1, x and y
    zero = np.zeros_like(even)
    forces = np.moveaxis(np.array([[even, zero], [zero, even], [-along_y, along_x]]), 1, 2)
    resultants = resultants_of(mesh.nodes - point, forces)
    if not np.linalg.det(resultants) > SLIVER * resultants[0, 0] ** 2 * resultants[2, 2]:
        raise ComputationFailed(f"no part of body {patch.body} within {radius:g} mm of ({point[0]:g}, {point[1]:g}) mm")
    if lifting:
        forces = np.array([even, along_y, -along_x])
        arms = np.stack([np.ones(len(mesh.nodes)), *(mesh.nodes - point).T[::-1]])
        resultants, forces = np.diag([1.0, 1.0, -1.0]) @ arms @ forces.T, forces[..., None]
    return np.tensordot(np.linalg.inv(resultants).T, forces, axes=1)


def forces_on_ports(layout: Layout, mesh: StageMesh) -> Array:
    """Nodal forces (k, n, 2), N, of unit loads on the ports, those on held nodes included."""
    contacts = {patch: contact_forces(mesh, patch) for port in layout.ports for patch, _ in port.parts}
    return np.array(
        [
            np.sum([np.tensordot(wrench, contacts[patch], axes=1) for patch, wrench in port.parts], axis=0)
            for port in layout.ports
        ]
    )


def _subdivided() -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) of the midpoint rule on a subdivided reference triangle."""
    corners = [(i, j, up) for i in range(SUBDIVISION) for j in range(SUBDIVISION - i) for up in (1, 2)]
    points = np.array([(i + up / 3, j + up / 3) for i, j, up in corners if i + j + up <= SUBDIVISION])
    return points / SUBDIVISION, np.full(len(points), 0.5 / len(points))


@dataclass(frozen=True)
class PlateModel:
    """A factorised plate with all loads that act on it.

    mesh : the whole.   structure : the bodies that are not fixed, with the nodes of the whole.
    held : nodes that do not move.
    """

    layout: Layout
    mesh: StageMesh
    structure: Structure
    held: Index
    space: Space

    @property
    def lifting(self) -> bool:
        """Whether the motion is out of the plane."""
        return bool(self.structure.line.fixed)

    @cached_property
    def port_forces(self) -> Array:
        """Nodal forces (k, n, ...), N, of unit loads on the ports, those on held nodes included.

        Out of the plane they are those of the output only: a force along z and moments about x and y.
        """
        if self.lifting:
            return self._through(contact_forces(self.mesh, self.layout.ports[0].parts[0][0], True))
        return self._through(forces_on_ports(self.layout, self.mesh))

    @cached_property
    def attached(self) -> tuple[Array, Array]:
        """Masses and moments of inertia (r,) of payloads and actuators, tonne and tonne mm^2, and forces (r, n, ...).

        Three follow each other: along x, along y, and of the rotation; out of the plane along z, and of the rotations
        about x and y, where a payload is a flat body, which has half of its moment of inertia.
        """
        bodies = [(load.contact, load.mass, load.inertia) for load in self.layout.payloads]
        bodies += [(at, each.mass / 2, 0.0) for each in self.layout.actuators for at in each.contacts]
        carried = [(patch, mass, inertia) for patch, mass, inertia in bodies if mass > 0 or inertia > 0]
        forces = [contact_forces(self.mesh, patch, self.lifting) for patch, _, _ in carried]
        plane = np.concatenate([np.zeros((0, len(self.mesh.nodes), 1 if self.lifting else 2)), *forces])
        flat = [(m, j / 2, j / 2) if self.lifting else (m, m, j) for _, m, j in carried]
        return np.ravel(np.array(flat, dtype=float)), self._through(plane)

    def _through(self, plane: Array) -> Array:
        """Spread forces (k, n, 2) in the plane, or (k, n, 1) along z, evenly through the thickness: (k, n, ...)."""
        line = self.structure.line
        if line.axes == 2:
            return plane
        share = line.values @ line.weights / line.weights.sum()
        return np.pad(plane[:, :, None] * share[:, None], [*[(0, 0)] * 3, (2, 0) if self.lifting else (0, 1)])

    def solve_twice(self, loads: Array) -> Array:
        """Unknowns (size, k) under loads (size, k), less the round-off of one solve."""
        motion = self.space.solve(loads)
        forces = self.structure.forces(self.structure.fields(motion))
        return motion + self.space.solve(loads - self.structure.loads(forces))

    def response(self, forces: Array, prescribed: Array | None = None, free: Array | None = None) -> PlateResponse:
        """Solve for forces (c, n, ...), and displacements of held nodes with a free expansion, (c, n, ...)."""
        loads = self.structure.loads(forces)
        solution = refined_solution(self.structure, self.space.solve, loads, prescribed, held=self.held)
        fields = solution.fields if free is None else solution.fields + free
        held = forces[:, self.held].reshape(len(forces), -1) @ self.structure.rigid_fields(self.held).reshape(3, -1).T
        motions = self.port_forces.reshape(len(self.port_forces), -1) @ fields.reshape(len(fields), -1).T
        return PlateResponse(self, motions, fields, solution.fields, solution.reactions - held)


@dataclass(frozen=True)
class PlateResponse:
    """Response of a plate to c cases.

    motions : (k, c), displacements conjugate to the ports, mm and rad; the compliance, if the cases are unit loads on
        the ports.
    fields : (c, n, 2), mm, displacements of all nodes of the mesh; with layers (c, n, m, 3).
    elastic : as `fields`, less the free expansion.
    reactions : (c, 3), resultant that holds fixed bodies and clamped edges, about the origin, N and N mm.
    """

    model: PlateModel
    motions: Array
    fields: Array
    elastic: Array
    reactions: Array

    @property
    def compliance(self) -> Array:
        """The motions under unit loads on the ports, symmetric."""
        return (self.motions + self.motions.T) / 2

    @property
    def unknowns(self) -> int:
        return self.model.structure.size

    @cached_property
    def _at_hinges(self) -> tuple[Array, Index]:
        """Stresses (c, p, d, d), MPa, at the nodes of the triangles of all hinges, and the first node of each hinge."""
        whole, layout = self.model.structure, self.model.layout
        regions = (
            whole.mesh.triangles[whole.mesh.bodies == part + len(layout.bodies)] for part in range(len(layout.joints))
        )
        nodes = [np.unique(region) for region in regions]
        pairs = zip(nodes, layout.joints, strict=True)
        nodes = [at[~_at_fixed_end(layout, joint, whole.mesh.nodes[at])] for at, joint in pairs]
        depth = 1 if whole.layers is None else len(whole.layers.heights)
        used, at = np.unique(np.concatenate([NONE, *nodes]), return_inverse=True)
        stress = nodal_stress(whole.mesh, whole.plate, self.elastic, used, whole.layers)
        stress = stress.reshape(len(stress), len(used), depth, *stress.shape[-2:])[:, at]
        starts = depth * np.cumsum([0, *map(len, nodes)])[:-1]
        return stress.reshape(len(stress), -1, *stress.shape[-2:]), starts


def _at_fixed_end(layout: Layout, joint: Joint, nodes: Array) -> NDArray[np.bool_]:
    """Return which nodes (n, 2) of a hinge are near a fixed body, higher than a quarter of the way from neck to end.

    A fixed body is rigid. The stress at the corners of such an end is therefore singular, in heat most of all.
    """
    x = ((nodes @ [1, 1j] - joint.place) * np.exp(-1j * joint.heading)).real
    high = joint.profile.height(x) > 0.75 * joint.profile.neck + 0.25 * joint.profile.end_height
    fixed = [layout.bodies[body].fixed for body in joint.bodies]
    return np.asarray(high & np.where(x < 0, *fixed))


def hinge_stress(response: PlateResponse, loads: Array) -> Array:
    """Highest von Mises stress (..., h), MPa, at every hinge under loads (..., c), multiples of the cases.

    It is the highest at the nodes of the triangles of the hinge, without those of `_at_fixed_end`. At a sharp root,
    without a fillet, the stress is singular: it grows without limit as the mesh is refined.
    """
    if not response.model.layout.joints:
        return np.zeros((*np.shape(loads)[:-1], 0))
    (stress, starts), flat = response._at_hinges, np.reshape(loads, (-1, len(response.elastic)))
    ratio, size = response.model.layout.out_of_plane, max(1, LARGEST // max(1, stress[0].size))
    parts = [
        np.maximum.reduceat(von_mises(np.tensordot(flat[start : start + size], stress, axes=1), ratio), starts, axis=1)
        for start in range(0, len(flat), size)
    ]
    return np.concatenate([np.zeros((0, len(starts))), *parts]).reshape(*np.shape(loads)[:-1], len(starts))


def together(*responses: PlateResponse) -> PlateResponse:
    """Return the response of one model to the cases of several, so that loads and stresses can combine them."""
    parts = zip(*((each.motions.T, each.fields, each.elastic, each.reactions) for each in responses), strict=True)
    motions, fields, elastic, reactions = (np.concatenate(part) for part in parts)
    return PlateResponse(responses[0].model, motions.T, fields, elastic, reactions)


def plate_model(layout: Layout, mesh: StageMesh, layers: Layers | None = None) -> PlateModel:
    """Factorise a plate, plane or extruded.

    Raises ComputationFailed when a part is not held, or for too many unknowns.
    """
    held, moving = held_nodes(layout, mesh), ~_is_fixed(layout, mesh)
    part = mesh._replace(triangles=mesh.triangles[moving], bodies=mesh.bodies[moving])
    whole = structure(part, plate_of_layout(layout, layers), layers, held=held)
    return PlateModel(layout, mesh, whole, held, full_space(whole))


def plate_response(layout: Layout, mesh: StageMesh, layers: Layers | None = None) -> PlateResponse:
    """Solve for unit loads on the ports of a layout, in their order.

    Parameters
    ----------
    mesh : of the layout: `bodies` are those of the layout, then its hinges; held are fixed bodies and edges `clamped`.
    layers : through the thickness, for three dimensions.

    Raises ComputationFailed as `plate_model`, `contact_forces`, and when forces or energy do not balance.
    """
    model = plate_model(layout, mesh, layers)
    return model.response(model.port_forces)


def weight_of(model: PlateModel, accelerations: Array) -> PlateResponse:
    """Solve for the weight of bodies, payloads and actuators in fields (c, 2), mm/s^2, or (c, 1) out of the plane."""
    axes, (inertia, attached) = accelerations.shape[1], model.attached
    unit = mass_of(model.structure, model.layout.density).forces(model.structure.rigid_fields()[:axes])
    for axis in range(axes):
        unit[axis] += np.tensordot(inertia[axis::3], attached[axis::3], axes=1)
    return model.response(np.tensordot(accelerations, unit, axes=1))


def warmed(model: PlateModel, expansion: float, ground_expansion: float) -> PlateResponse:
    """Solve for one kelvin, and one kelvin per mm along x and along y, with expansions of plate and ground, 1/K.

    The ground expands about the origin as a free body of its own material; motions include this.
    """
    free = free_displacement(model.mesh.nodes, model.structure.layers)[[2, 0, 1]]
    prescribed = np.zeros_like(free)
    prescribed[:, model.held] = (ground_expansion - expansion) * free[:, model.held]
    response = model.response(np.zeros_like(free), prescribed, expansion * free)
    parts = [
        (k, patch.point, wrench)
        for k, port in enumerate(model.layout.ports)
        for patch, wrench in port.parts
        if patch.body < 0
    ]
    for port, at, wrench in parts:  # on the ground outside the plate
        moved = free_displacement(np.array([[at.real, at.imag]]))[[2, 0, 1], 0]
        response.motions[port] += ground_expansion * np.column_stack([moved, [0.0, at.imag, -at.real]]) @ wrench
    return response


class VibratingPlate(NamedTuple):
    """Modes of a plate, and the displacements (count, k) of its ports in the modes of unit modal mass."""

    modes: Modes
    ports: Array


def plate_modes(model: PlateModel, count: int, engaged: bool = False) -> VibratingPlate:
    """Return the lowest `count` modes with payloads and the masses of actuators, whose stiffness acts if `engaged`.

    With antisymmetric layers they are out of the plane, where the stiffness of actuators does not act.
    Raises ComputationFailed when they do not converge.
    """
    inertia, attached = model.attached
    loads, springs = model.structure.loads(model.port_forces), model.layout.stiffness_of_actuators * engaged
    springs = springs[:0] if model.lifting else springs
    stacks = loads[:, loads.shape[1] - len(springs) :]
    at = (inertia[inertia > 0], model.structure.loads(attached[inertia > 0])) if len(inertia) else None

    def found(space: Space) -> Modes:
        density = model.layout.density
        return modes(
            vibrating_structure(model.structure, density, None, stacks, springs, MASS_QUADRATURE, space, at), count
        )

    try:
        lowest = found(model.space)
    except ComputationFailed:  # round-off of necks of some hundredths of a millimetre
        lowest = found(model.space._replace(solve=model.solve_twice))
    return VibratingPlate(lowest, lowest.shapes[0].T @ loads)
