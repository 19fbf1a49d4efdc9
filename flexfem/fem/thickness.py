"""Effect of the thickness on hinges: finite elements in three dimensions against plane stress.

A hinge is solved alone, with the material of its bodies near its ends, on one mesh in the plane.
Bodies are wide in the plane, so that plane stress holds for them; hinges are not, and bend between
plane stress and plane strain. The change of the compliance of a plate is therefore that of its
network of parts when the compliance of its hinges changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index
from flexfem.fem.elements import SOLID_QUADRATURE, Layers, Plate, mirrored, nodal_stress, sheet
from flexfem.fem.factor import condense, dense
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.fem.plate_bodies import part_mesh
from flexfem.fem.ports import plate_of_layout
from flexfem.fem.structure import NONE, Structure, structure
from flexfem.mechanism.layout import Layout

# of the height of an end: distance into a body over which the stress of the hinge spreads
REACH = 0.5
FEW_LAYERS = 2  # in half the thickness, for the band
TURNED = (-1.0, -1.0, 1.0)  # signs of twists and wrenches after half a turn
# compliances of leaves and notches are within 0.1 % of those with 8 layers for b/t up to 80
MANY_LAYERS = 4


class ThickHinge(NamedTuple):
    """A hinge in three dimensions, against plane stress.

    Compliances are those of `Profile.compliance`.

    change : (3, 3), of the compliance at the centre of the hinge, in its axes, with ends that keep
        their thickness.
    coarser : (3, 3), the same with few layers.
    loose : (3, 3), the same as `change` with ends that are free to contract along z.
    plane : (p, 3, 3), squares of the von Mises stress, MPa^2, in plane stress at p nodes of the
        hinge: quadratic forms of the loads N, V, M at its centre.
    solid : (p m, 3, 3), the same in three dimensions at m heights.
    """

    change: Array
    coarser: Array
    loose: Array
    plane: Array
    solid: Array

    def stress_ratio(self, wrenches: Array) -> Array:
        """Ratio (...) of the highest stress in three dimensions to that in plane stress.

        wrenches : (..., 3), N, V and M.
        """
        flat = wrenches.reshape(-1, 3)
        products = (flat[:, :, None] * flat[:, None]).reshape(-1, 9)
        plane = np.max(self.plane.reshape(-1, 9) @ products.T, axis=0)
        solid = np.max(self.solid.reshape(-1, 9) @ products.T, axis=0)
        loaded = plane > 0
        ratio = np.ones(len(flat))
        ratio[loaded] = np.sqrt(solid[loaded] / plane[loaded])
        return ratio.reshape(wrenches.shape[:-1])

    def turned(self) -> ThickHinge:
        """Return the hinge turned by half a turn, so that its near end is the far one.

        Forces and displacements in the plane change their sign, moments and rotations do not.
        """
        signs = np.outer(TURNED, TURNED)
        return ThickHinge(*(part * signs for part in self))


def thick_hinges(layout: Layout, mesh: PlaneMesh) -> tuple[ThickHinge, ...]:
    """Solve every hinge of a layout in three dimensions.

    Hinges of equal profile, also turned, are solved once.

    mesh : of the layout, as for `plate_bodies.body_compliances`.
    """
    found = dict[tuple[object, ...], ThickHinge]()
    hinges = list[ThickHinge]()
    for number, joint in enumerate(layout.joints):
        ends = [(layout.bodies[body].fixed, layout.bodies[body].material) for body in joint.bodies]
        key = (joint.profile, joint.cut, joint.material, *ends)
        if key not in found:
            found[key] = _thick_hinge(layout, mesh, number)
        if joint.profile.even and joint.profile.symmetric:
            turned = (joint.profile, joint.cut, joint.material, *reversed(ends))
            found.setdefault(turned, found[key].turned())
        hinges.append(found[key])
    return tuple(hinges)


def _thick_hinge(
    layout: Layout,
    mesh: PlaneMesh,
    number: int,
) -> ThickHinge:
    joint = layout.joints[number]
    alone = _hinge_alone(layout, mesh, number)
    part = alone.mesh
    own = len(layout.bodies) + number
    of_hinge = np.unique(part.triangles[part.bodies == own])
    flat = plate_of_layout(layout, mesh=part)
    plate = plate_of_layout(layout, sheet(layout.thickness), part)
    few = mirrored(layout.thickness, FEW_LAYERS, joint.profile.neck)
    many = mirrored(layout.thickness, MANY_LAYERS, joint.profile.neck)
    plane = _between_sections(alone, flat, None)
    coarser = _between_sections(alone, plate, few)
    solid = _between_sections(alone, plate, many)
    symmetric = joint.profile.symmetric
    return ThickHinge(
        _change(plane.compliance, solid.compliance, symmetric),
        _change(plane.compliance, coarser.compliance, symmetric),
        _change(plane.compliance, solid.loose, symmetric),
        _von_mises_forms(nodal_stress(part, flat, plane.fields, of_hinge, part=own)),
        _von_mises_forms(nodal_stress(part, plate, solid.fields, of_hinge, many, part=own)),
    )


class _HingeAlone(NamedTuple):
    """Mesh of a hinge and its bodies near it, in its axes, and nodes on its end sections."""

    mesh: PlaneMesh
    near: Index
    far: Index


def _hinge_alone(
    layout: Layout,
    mesh: PlaneMesh,
    number: int,
) -> _HingeAlone:
    joint = layout.joints[number]
    chosen, near, far = _surroundings(layout, mesh, number)
    part, numbers = part_mesh(mesh, chosen)
    z = (part.nodes @ [1, 1j] - joint.place) * np.exp(-1j * joint.heading)
    part = part._replace(nodes=np.column_stack([z.real, z.imag]))
    return _HingeAlone(part, numbers[near], numbers[far])


def _von_mises_forms(stress: Array) -> Array:
    """Quadratic forms (n, 3, 3) of the square of the von Mises stress in three loads.

    stress : (3, ..., d, d), MPa, of each of them.
    """
    axes = stress.shape[-1]
    tensors = np.zeros((3, stress[0, ..., 0, 0].size, 3, 3))
    tensors[..., :axes, :axes] = stress.reshape(3, -1, axes, axes)
    pressure = np.trace(tensors, axis1=2, axis2=3) / 3
    deviators = tensors - pressure[..., None, None] * np.eye(3)
    return np.asarray(1.5 * np.einsum("inab,jnab->nij", deviators, deviators, optimize=True))


def _change(
    plane: Array,
    solid: Array,
    symmetric: bool,
) -> Array:
    """Change (3, 3) of the compliance of a hinge, whose profile may be symmetric about its axis."""
    change = solid - plane
    if symmetric:
        change[0, 1:] = 0.0
        change[1:, 0] = 0.0
    return change


class _Part(NamedTuple):
    """Compliances (3, 3) of a part between two sections, and displacements (3, n, ...), mm.

    The displacements are those by unit loads.

    loose : with sections that are free to contract along z.
    """

    compliance: Array
    loose: Array
    fields: Array


def _between_sections(
    alone: _HingeAlone,
    plate: Plate,
    layers: Layers | None,
) -> _Part:
    """Solve a part for unit loads on its far section; the near one is held.

    Sections are rigid in the plane.

    Notes
    -----
    The part is condensed onto the pose of its far section and the motions of both sections along
    z. These are zero in sections that keep their thickness.
    """
    ends = np.concatenate([alone.near, alone.far])
    whole = structure(alone.mesh, plate, layers, SOLID_QUADRATURE, NONE, ends)
    of_edge = _motions_of_sections(whole, ends, len(alone.near))
    motions = of_edge.shape[1]
    lower = whole.tie_hub(whole.lower(), of_edge)
    condensed = condense(lower, motions, whole.order(len(ends)))
    schur = condensed.schur
    held = _motion_under_wrenches(schur, np.eye(motions)[:, -3:])
    loose = _motion_under_wrenches(schur, np.eye(motions))
    unloaded = condensed.reduced(np.zeros((lower.shape[0], 3)))[0]
    inner = condensed.expanded(unloaded, held)[:-motions]
    fields = whole.fields(np.concatenate([inner, of_edge @ held]))
    return _Part(held.T @ schur @ held, loose.T @ schur @ loose, fields)


def _motions_of_sections(
    whole: Structure,
    ends: Index,
    near: int,
) -> Array:
    """Return the unknowns (edge, m + 3) of the nodes on both sections by their possible motions.

    These are m along z, of single unknowns, and the pose of the far section; the first of these
    nodes, `near` in number, are held in the plane.
    """
    of_pose = whole.rigid_unknowns(ends)
    of_pose[: near * whole.block] = 0.0
    along_z = np.tile(whole.line.free_components % whole.line.axes == 2, len(ends))
    return np.column_stack([np.eye(len(of_pose))[:, along_z], of_pose])


def _motion_under_wrenches(schur: Array, T: Array) -> Array:
    """Return the motions (b, 3) of a boundary under unit wrenches.

    T : (b, m), motions that are possible, the last three by the pose of the far section.
    """
    loads = np.eye(T.shape[1], 3, 3 - T.shape[1])
    return np.asarray(T @ dense(T.T @ schur @ T)(loads))


def _surroundings(
    layout: Layout, mesh: PlaneMesh, number: int
) -> tuple[NDArray[np.bool_], Index, Index]:
    """Return the triangles of a hinge and its bodies near it, and the nodes on both end sections.

    A fixed body is rigid, and one that lies wholly near the hinge has no section: the end of the
    hinge is taken."""
    joint = layout.joints[number]
    chosen = mesh.bodies == len(layout.bodies) + number
    middles = mesh.nodes[mesh.triangles[:, :3]].mean(axis=1)
    sections = list[Index]()
    for side, body in zip(("near", "far"), joint.bodies, strict=True):
        end = nodes_on(mesh, f"end {number} {side}")
        centre = mesh.nodes[end].mean(axis=0)
        height = 2 * np.hypot(*(mesh.nodes[end] - centre).T).max()
        of_body = mesh.bodies == body
        close = of_body & (np.hypot(*(middles - centre).T) < (0.5 + REACH) * height)
        section = np.intersect1d(mesh.triangles[close], mesh.triangles[of_body & ~close])
        if layout.bodies[body].fixed or not len(section):
            section = end
        else:
            chosen = chosen | close
        sections.append(section)
    return chosen, sections[0], sections[1]
