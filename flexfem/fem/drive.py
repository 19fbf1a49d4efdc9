"""The driven stage by finite elements: the pushes of its stacks as further right-hand sides of one factorisation.

A push on a link is a body force over its station, and the opening of a stack is read with the same weights, so that
the compliance is symmetric and conjugate to the forces; on the platform both act on the hub.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, integration, internal_forces, matrices_of, tied_lower
from flexfem.fem.problem import shape_values
from flexfem.fem.response import BALANCE, MOST_SOLVES, SETTLED, Tied, tie_hub
from flexfem.mechanism.contacts import Push, Stack, spread
from flexfem.mechanism.designs import CHAIN_TURN, turned
from flexfem.mechanism.stage_file import HINGE_NAMES
from flexfem.refused import ComputationFailed

DEGREE = 8  # of the quadrature of pushes, whose weights are no polynomials in a triangle


class DrivenResponse(NamedTuple):
    """Finite-element answer to the loads of the platform and one newton of each of n stacks.

    compliance : (3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    fields : (3 + n, nodes, 2), mm, displacement of every node.
    """

    compliance: Array
    fields: Array


def driven_response(mesh: StageMesh, plate: Plate, stacks: tuple[Stack, ...]) -> DrivenResponse:
    """Solve for unit loads on the hub and for one newton of each stack, with the ground clamped.

    Raises ComputationFailed when strain energy and work differ beyond `response.BALANCE`.
    """
    batches, tied = integration(mesh), tie_hub(mesh)
    solve = factorise(tied_lower(mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid))
    loads = stack_loads(mesh, tied, stacks)
    motion, residual = np.zeros_like(loads), loads
    for _ in range(MOST_SOLVES):
        motion = motion + solve(residual)
        fields = tied.fields(motion)
        forces = internal_forces(batches, plate, fields)
        residual = loads - tied.loads(forces)
        compliance, energy = loads.T @ motion, np.einsum("ind,jnd->ij", fields, forces)
        size = np.sqrt(np.diag(compliance))
        unbalanced = float(np.max(np.abs(energy - compliance) / np.outer(size, size)))
        if unbalanced <= SETTLED:
            break
    if not unbalanced <= BALANCE:
        raise ComputationFailed(
            f"solution refused: strain energy and work differ by {unbalanced:.2g}, expected at most {BALANCE:g}"
        )
    return DrivenResponse((compliance + compliance.T) / 2, fields)


def stack_loads(mesh: StageMesh, tied: Tied, stacks: tuple[Stack, ...]) -> Array:
    """Loads (unknowns, 3 + n) of the platform's three directions and of the stacks."""
    nodal, hub = np.zeros((3 + len(stacks), *mesh.nodes.shape)), np.eye(3, 3 + len(stacks))
    for j, stack in enumerate(stacks, start=3):
        for push in stack.pushes:
            if push.station is not None:
                nodal[j] += push_forces(mesh, stack.chain, push)
            elif push.body:
                hub[:, j] += stack.placed(push)
    loads = tied.loads(nodal)
    loads[-3:] += hub
    return loads


def neck_wrenches(mesh: StageMesh, plate: Plate, fields: Array) -> Array:
    """Wrench (3 chains, 3 hinges, 3, k) that each neck carries, at the platform centre, N and N mm, of fields
    (k, n, 2), mm: that of the bodies beyond it on those before.

    Notes
    -----
    The nodal forces of the triangles of one body on the nodes of its neck: those of its pushes are in the body.
    """
    found = np.empty((3, len(HINGE_NAMES), 3, len(fields)))
    for chain in range(3):
        for hinge, name in enumerate(HINGE_NAMES):
            before = mesh.bodies == 4 * chain + hinge
            part = mesh._replace(triangles=mesh.triangles[before], bodies=mesh.bodies[before])
            nodes = np.unique(mesh.edges[f"neck {chain + 1} {name}"])
            x, y = mesh.nodes[nodes].T
            fx, fy = np.moveaxis(internal_forces(integration(part), plate, fields)[:, nodes], -1, 0)
            found[chain, hinge] = np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y])
    return found


def push_forces(mesh: StageMesh, chain: int, push: Push) -> Array:
    """Nodal forces (n, 2), N, of one newton of a push on a link of a chain (from 0), its wrench met exactly."""
    assert push.station is not None
    mine = mesh.bodies == 4 * chain + push.body  # the numbers of the links are the same
    part = mesh._replace(triangles=mesh.triangles[mine], bodies=mesh.bodies[mine])
    N, found = shape_values(DEGREE), np.zeros((3, *mesh.nodes.shape))
    for triangles, _, weights in integration(part, DEGREE):
        points = np.einsum("eid,iq->eqd", turned(mesh.nodes[triangles], -chain * CHAIN_TURN), N)
        density = spread(push.station, points.reshape(-1, 2)).reshape(3, *points.shape)
        nodal = np.einsum("keqd,eq,iq->keid", density, weights, N)
        for force, each in zip(found, nodal, strict=True):
            np.add.at(force, triangles, each)
    x, y = turned(mesh.nodes, -chain * CHAIN_TURN).T
    fx, fy = np.moveaxis(found, -1, 0)
    resultants = np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y])
    return turned(np.tensordot(np.linalg.solve(resultants, push.wrench), found, axes=1), chain * CHAIN_TURN)
