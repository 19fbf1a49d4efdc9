"""Loads of stacks on a stage, and stress and wrenches at its necks and clamped edges."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index, turned
from flexfem.fem.elements import Plate, highest_stress, integration, nodal_stress, von_mises
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.fem.response import Response, clamped_nodes, factorised_whole, resultants_of
from flexfem.fem.structure import NONE, Structure, structure
from flexfem.fem.symmetry import sector_values
from flexfem.paper.actuators import HINGE_NAMES
from flexfem.paper.bodies import BODIES
from flexfem.paper.contacts import Push, Stack, body_forces
from flexfem.paper.designs import stage_frames
from flexfem.paper.frames import CHAIN_TURN, chain_rotation
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of

# distances from a base hinge, per radius, between which its two bodies count as rigid
RIGID = (1.0, 2.0)
CORNER = 0.2  # share of a clamped edge excluded at both ends: stress at its corners is singular
FORCE_QUADRATURE = 8  # degree for stack forces, whose density is not polynomial in a triangle


def plane_stress(
    stage: Stage,
    mesh: PlaneMesh,
    field: Array,
) -> Array:
    """Von Mises stress (n,), MPa, at all nodes for a plane displacement field (n, 2), mm."""
    return von_mises(nodal_stress(mesh, plate_of(stage), field), stage.layout.out_of_plane)


def neck_maxima(
    stage: Stage,
    mesh: PlaneMesh,
    values: Array,
) -> Array:
    """Largest nodal value (3 chains, 3 hinges) within a notch radius of each neck's centre."""
    maxima = list[list[float]]()
    for chain in range(3):
        maxima.append([np.max(values[near]) for near in _near_necks(stage, mesh, chain)])
    return np.array(maxima)


def _near_necks(
    stage: Stage,
    mesh: PlaneMesh,
    chain: int,
) -> list[Index]:
    """Nodes within a notch radius of the centre of each neck of a chain; chains from 0."""
    centres = stage_frames(stage).centres[chain]
    found = list[Index]()
    for centre, radius in zip(centres, stage.array("radius")[chain], strict=True):
        found.append(np.flatnonzero(np.hypot(*(mesh.nodes - centre).T) <= radius))
    return found


class NeckStress(NamedTuple):
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, and mm from it to the mid-plane."""

    highest: Array
    height: Array


def neck_stresses(
    stage: Stage,
    response: Response,
    loads: Array,
) -> NeckStress:
    """Largest von Mises stress in each notch under loads (k, 3), N, N, N mm.

    Stress is averaged at the nodes, and the largest within a notch radius of the neck, at any
    height, is taken.
    """
    ratio = stage.layout.out_of_plane
    heights = response.structure.line.heights
    each = list[Array]()
    for turned_loads, stress in _notches(stage, response, loads):
        each.append(highest_stress(stress, turned_loads, ratio))
    by_height = np.reshape(each, (3, 3, len(loads), len(heights)))
    highest = by_height.max(axis=-1)
    height = heights[by_height.argmax(axis=-1)]
    return NeckStress(np.moveaxis(highest, 2, 0), np.moveaxis(height, 2, 0))


def notch_fields(
    stage: Stage, response: Response, loads: Array
) -> Iterator[tuple[tuple[int, int], Array]]:
    """Yield chain and hinge of every notch, from 0, and the stress, MPa, at its nodes.

    loads : (k, 3). The stress is (k, p, 2, 2); with layers (k, p, m, 3, 3). Its axes are those of
        chain 1 if one sector represents all.
    """
    for number, (rotation, stress) in enumerate(_notches(stage, response, loads)):
        yield divmod(number, 3), np.tensordot(rotation, stress, axes=1)


def _notches(
    stage: Stage,
    response: Response,
    loads: Array,
) -> Iterator[tuple[Array, Array]]:
    """Yield loads (k, 3) and the stresses of the cases at the nodes of each notch.

    The loads are turned to the chain that represents the notch.
    """
    cyclic = len(response.sectors) == 1
    near = list[Index]()
    for chain in range(1 if cyclic else 3):
        near += _near_necks(stage, response.structure.mesh, chain)
    stresses = replace(response, regions=tuple(near)).stresses
    for chain in range(3 if cyclic else 1):
        for stress in stresses:
            yield loads @ chain_rotation(chain), stress


def base_rotations(stage: Stage, response: Response) -> Array:
    """Rotation (3 loads, 3 chains), rad, of link 1 relative to the pad at each base hinge.

    It is that in the mid-plane, per unit load. A body rotates as the rigid motion that best fits
    its nodes from one to two notch radii from the neck centre.
    """
    mesh = response.structure.mesh
    plane = response.nodal
    if response.structure.layers is not None:
        plane = plane[:, :, 0, :2]
    rows = list[Array]()
    for chain in range(1 if len(response.sectors) == 1 else 3):
        distance = np.hypot(*(mesh.nodes - stage_frames(stage).centres[chain, 0]).T)
        distance /= stage.hinge(chain + 1, "base").radius
        is_rigid = (distance >= RIGID[0]) & (distance <= RIGID[1])
        rotations = list[Array]()
        for body in ("pad", "link 1"):
            nodes = np.unique(mesh.triangles[mesh.bodies == 4 * chain + BODIES.index(body)])
            nodes = nodes[is_rigid[nodes]]
            rotations.append(_rotation(mesh.nodes[nodes], plane[:, nodes]))
        rows.append((rotations[1] - rotations[0])[:, None])
    return np.concatenate(sector_values(rows), axis=1)


def _rotation(places: Array, displacements: Array) -> Array:
    """Return the rotation (k,), rad, that best fits displacements (k, p, 2) of places (p, 2)."""
    arm = places - places.mean(axis=0)
    turning = displacements[:, :, 1] @ arm[:, 0] - displacements[:, :, 0] @ arm[:, 1]
    return np.asarray(turning / np.sum(arm**2))


def envelope(response: Response) -> float:
    """Diameter, mm, of the circle about the platform centre that encloses the stage."""
    return 2 * float(np.max(np.hypot(*response.structure.mesh.nodes.T)))


def edge_maxima(mesh: PlaneMesh, values: Array) -> Array:
    """Largest of nodal values (n, ...) on each clamped edge (3 chains, ...), less `CORNER`."""
    maxima = []
    for nodes in clamped_nodes(mesh):
        x, y = mesh.nodes[nodes].T
        end = int(np.argmax(np.hypot(x - np.mean(x), y - np.mean(y))))
        along = np.hypot(x - x[end], y - y[end])
        maxima.append(largest_within(along / np.max(along), values[nodes], CORNER, 1 - CORNER))
    return np.array(maxima)


def largest_within(
    places: Array,
    values: Array,
    low: float,
    high: float,
) -> Array:
    """Largest value from `low` to `high` of values (n, ...) at places (n,), linear in between."""
    from scipy.interpolate import make_interp_spline

    order = np.argsort(places)
    places = places[order]
    values = values[order]
    inside = (places > low) & (places < high)
    ends = make_interp_spline(places, values, k=1)([low, high])
    return np.asarray(np.max(np.concatenate([values[inside], ends]), axis=0))


def driven_response(
    mesh: PlaneMesh,
    plate: Plate,
    stacks: Sequence[Stack],
) -> Response:
    """Solve for unit loads on the hub and for one newton of each of n stacks; ground is clamped.

    The compliance (3 + n, 3 + n) is that of the pose and of the openings of the stacks.
    """
    whole = structure(mesh, plate)
    return factorised_whole(whole, stack_loads(whole, stacks)).response()


def stack_loads(structure: Structure, stacks: Sequence[Stack]) -> Array:
    """Return the unit loads (unknowns, 3 + n) of the platform's directions and of stacks."""
    nodal = np.zeros((3 + len(stacks), *structure.mesh.nodes.shape))
    hub = np.eye(3, 3 + len(stacks))
    for j, stack in enumerate(stacks, start=3):
        for push in stack.pushes:
            if push.station is not None:
                nodal[j] += push_forces(structure.mesh, stack.chain, push)
            elif push.body:
                hub[:, j] += stack.placed(push)
    loads = structure.loads(nodal)
    loads[-3:] += hub
    return loads


def push_forces(
    mesh: PlaneMesh,
    chain: int,
    push: Push,
) -> Array:
    """Return nodal forces (n, 2), N, of one newton of a stack on a link of a chain (from 0).

    They have its exact wrench.
    """
    assert push.station is not None
    angle = chain * CHAIN_TURN
    link = _body_mesh(mesh, 4 * chain + push.body)
    forces = np.zeros((3, *mesh.nodes.shape))
    for batch in integration(link, FORCE_QUADRATURE):
        at = turned(mesh.nodes[batch.triangles], -angle)
        points = np.einsum("eid,iq->eqd", at, batch.phi)
        density = body_forces(push.station, points.reshape(-1, 2)).reshape(3, *points.shape)
        nodal = np.einsum("keqd,eq,iq->keid", density, batch.weights, batch.phi)
        for force, values in zip(forces, nodal, strict=True):
            np.add.at(force, batch.triangles, values)
    resultants = resultants_of(turned(mesh.nodes, -angle), forces)
    shares = np.linalg.solve(resultants, push.wrench)
    return turned(np.tensordot(shares, forces, axes=1), angle)


def neck_wrenches(
    mesh: PlaneMesh,
    plate: Plate,
    fields: Array,
) -> Array:
    """Wrenches (3 chains, 3 hinges, 3, k) of the outboard on the base side of each neck.

    They are in N and N mm about the platform centre, for fields (k, n, 2), mm: sums of the nodal
    forces at the neck of the triangles of the base-side body.
    """
    wrenches = np.empty((3, len(HINGE_NAMES), 3, len(fields)))
    for chain in range(3):
        for hinge, name in enumerate(HINGE_NAMES):
            body = structure(_body_mesh(mesh, 4 * chain + hinge), plate, held=NONE)
            nodes = nodes_on(mesh, f"neck {chain + 1} {name}")
            wrenches[chain, hinge] = resultants_of(mesh.nodes[nodes], body.forces(fields)[:, nodes])
    return wrenches


def _body_mesh(mesh: PlaneMesh, body: int) -> PlaneMesh:
    """Return the triangles of a body, 4 * chain + body, with all nodes of the mesh."""
    in_body = mesh.bodies == body
    return mesh._replace(triangles=mesh.triangles[in_body], bodies=mesh.bodies[in_body])
