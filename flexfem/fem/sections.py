"""Forces and moments through sections of a plate, and its highest strains, by finite elements.

A section follows the sides of triangles. The forces of the elements on one side, at its nodes, are
in exact balance with what acts on this side. A section along a line is therefore that of the
triangles whose middles are beside it; it differs from the line by what loads act between both."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from flexfem.arrays import Array, Index
from flexfem.fem.body_stress import body_loads_apart
from flexfem.fem.elements import Plate, nodal_stress
from flexfem.fem.mesh import nodes_on
from flexfem.fem.response import Response
from flexfem.mechanism.layout import Layout


class Strains(NamedTuple):
    """Largest size of a principal strain (p,) of hinges, then moving bodies, and places (p, 2)."""

    highest: Array
    place: Array


def hinge_wrenches(
    response: Response,
    layout: Layout,
    field: Array,
) -> Array:
    """Return tension N, transverse force V and moment M (h, 3) at the centres of hinges.

    They are in N and N mm, and act on the end of a hinge at its second body, in its axes.

    field : displacements of the nodes, mm.
    """
    bodies = response.structure.mesh.bodies
    found = np.zeros((len(layout.joints), 3))
    for number, joint in enumerate(layout.joints):
        chosen = bodies == len(layout.bodies) + number
        nodes = nodes_on(response.structure.mesh, f"end {number} far")
        found[number] = _resultant(response, field, chosen, nodes, joint.place, joint.heading)
    return found


def section_wrench(
    response: Response,
    field: Array,
    start: complex,
    end: complex,
) -> Array:
    """Return axial force, shear force and moment (3,), N and N mm, through a section.

    start, end : ends of the section, complex, mm.

    They act on the material at the left of the line: the axial force is along the normal to the
    right, so that tension is positive, the shear force along the line, and the moment about the
    middle of the line. A piece of material counts as a whole, from edge to edge, if its middle is
    between the ends, which may therefore be on its edges.

    Raises ValueError without material at the line.
    """
    mesh = response.structure.mesh
    length = abs(end - start)
    along = (end - start) / length
    middles = mesh.nodes[mesh.triangles[:, :3]].mean(axis=1) @ [1, 1j]
    left = ((middles - start) * along.conjugate()).imag > 0
    at = ((mesh.nodes @ [1, 1j] - start) * along.conjugate()).real
    both = np.intersect1d(mesh.triangles[left], mesh.triangles[~left])
    pieces = _pieces(mesh.triangles[left], both)
    middle = [(at[piece].min() + at[piece].max()) / 2 for piece in pieces]
    within = [piece for piece, x in zip(pieces, middle, strict=True) if 0 < x < length]
    nodes = np.concatenate([both[:0], *within])
    if not len(nodes):
        raise ValueError("no material")
    touching = left & np.isin(mesh.triangles, nodes).any(axis=1)
    heading = float(np.angle(-1j * along))
    return _resultant(response, field, touching, nodes, (start + end) / 2, heading)


def _pieces(triangles: Index, nodes: Index) -> list[Index]:
    """Return nodes by pieces of material: those of one triangle (n, 6) are in one piece."""
    shared = np.isin(triangles, nodes)
    triangle, corner = np.nonzero(shared)
    node = np.searchsorted(nodes, triangles[triangle, corner])
    ones = np.ones(len(node))
    incident = coo_matrix((ones, (node, triangle)), shape=(len(nodes), len(triangles))).tocsr()
    count, piece = connected_components(incident @ incident.T, directed=False)
    return [nodes[piece == number] for number in range(count)]


def _resultant(
    response: Response,
    field: Array,
    chosen: NDArray[np.bool_],
    nodes: Index,
    point: complex,
    heading: float,
) -> Array:
    """Return force and moment (3,) about a point on chosen triangles at nodes.

    They are in axes turned by `heading`.
    """
    structure = response.structure
    mesh = structure.mesh
    triangles = mesh._replace(triangles=mesh.triangles[chosen], bodies=mesh.bodies[chosen])
    part = replace(structure, mesh=triangles)
    forces = part.forces(field[None])[0].reshape(len(mesh.nodes), -1, structure.line.axes)
    fx, fy = forces[nodes].sum(axis=1)[:, :2].T
    x, y = (mesh.nodes[nodes] - [point.real, point.imag]).T
    force = complex(fx.sum(), fy.sum()) * np.exp(-1j * heading)
    return np.array([force.real, force.imag, np.sum(x * fy - y * fx)])


def part_strains(
    response: Response,
    layout: Layout,
    load: Array,
) -> Strains:
    """Return the highest strains in the plane by a load (k,) on the ports.

    They are taken at the nodes at which stress is stated. A strain is the stress in a material of
    unit modulus without Poisson's ratio.
    """
    mesh = response.structure.mesh
    layers = response.structure.layers
    field = np.tensordot(load, response.nodal, axes=1)
    parts = [*response.regions]
    for number, nodes in enumerate(response.bodies):
        parts.append(nodes[body_loads_apart(layout, mesh.nodes[nodes], number, load)])
    unit = Plate(1.0, 0.0, layout.thickness)
    highest = np.zeros(len(parts))
    places = np.zeros((len(parts), 2))
    for number, nodes in enumerate(parts):
        order = np.argsort(nodes)
        strain = nodal_stress(mesh, unit, field, nodes[order], layers)
        values = np.abs(np.linalg.eigvalsh(strain)).reshape(len(nodes), -1).max(axis=1)
        worst = int(np.argmax(values))
        highest[number] = values[worst]
        places[number] = mesh.nodes[nodes[order][worst]]
    return Strains(highest, places)
