"""Plane finite elements of a stage that warms on a frame that carries the pads, with one factorisation.

The stress is `D (e(u) - e0)` with the free thermal strain e0. Uniform changes and linear gradients of temperature leave
a free body of one metal without stress: `u0 = alpha (x, y)` per kelvin, `alpha ((x^2 - y^2)/2, x y)` and
`alpha (x y, (y^2 - x^2)/2)` per K/mm along x and y. The strain of their interpolation is taken for e0, so that this is
so on curved triangles too. What is solved for is `u - u0`, which the clamped edges impose, moving as the frame does and
not as the metal would: formed as a difference it would lose its digits where both expand nearly alike. The hub, rigid
otherwise, grows as the metal does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import (
    Plate,
    integration,
    internal_forces,
    matrices_of,
    nodal_stress,
    tied_lower,
)
from flexfem.fem.response import BALANCE, MOST_SOLVES, SETTLED, tie_hub
from flexfem.refused import ComputationFailed

CORNER = 0.2  # of a clamped edge, left out at both ends: stress at its corners has no bound, and grows with the mesh


class HeatResponse(NamedTuple):
    """Answer to one kelvin, and to one kelvin per mm along x and along y, about the platform's centre: three cases.

    pose : (3, 3 cases), mm and rad.   fields : (3 cases, n, 2), mm, displacement of every node.
    stress : (3 cases, n, 3), MPa, as xx, yy, xy at the nodes.
    reactions : (3 cases, 3 chains, 3), N and N mm, of the ground on each pad about the platform's centre.
    """

    pose: Array
    fields: Array
    stress: Array
    reactions: Array


def free_displacement(points: Array) -> Array:
    """Displacements (3 cases, ..., 2), mm, of a free body at points (..., 2), mm, per expansion."""
    x, y = points[..., 0], points[..., 1]
    half = (x**2 - y**2) / 2
    return np.stack([points, np.stack([half, x * y], axis=-1), np.stack([x * y, -half], axis=-1)])


def heat_response(mesh: StageMesh, plate: Plate, stage_expansion: float, frame_expansion: float) -> HeatResponse:
    """Solve for the three cases; the expansions, 1/K, are those in the plane.

    Raises ComputationFailed when the reactions do not balance, or energy and work differ, beyond `response.BALANCE`.
    """
    batches, tied, shape = integration(mesh), tie_hub(mesh), free_displacement(mesh.nodes)
    solve = factorise(tied_lower(mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid))
    ground, given = np.unique(mesh.edges["ground"]), np.zeros_like(shape)
    given[:, ground] = (frame_expansion - stage_expansion) * shape[:, ground]
    motion = np.zeros((2 * len(tied.free) + 3, 3))
    for _ in range(MOST_SOLVES):
        elastic = given + tied.fields(motion)
        forces = internal_forces(batches, plate, elastic)
        unbalanced = _imbalance(mesh, ground, elastic, forces)
        if unbalanced <= SETTLED:
            break
        motion = motion - solve(tied.loads(forces))
    if not unbalanced <= BALANCE:
        raise ComputationFailed(
            f"solution refused: reactions, or strain energy and work, of the warm stage differ by {unbalanced:.3g}, "
            f"expected at most {BALANCE:g}"
        )
    stress = np.stack([nodal_stress(mesh, plate, each) for each in elastic])
    return HeatResponse(motion[-3:], elastic + stage_expansion * shape, stress, _reactions(mesh, forces))


def _imbalance(mesh: StageMesh, ground: Index, elastic: Array, forces: Array) -> float:
    """Sum of the reactions over the largest, and work of the ground less energy over it; zero of a stage at rest."""
    lever = np.array([1.0, 1.0, np.max(np.abs(mesh.nodes))])
    reactions = _reactions(mesh, forces) / lever
    energy = np.einsum("knd,knd->k", elastic, forces)
    work = np.einsum("knd,knd->k", elastic[:, ground], forces[:, ground])
    differences = np.max(np.abs(np.sum(reactions, axis=1)), axis=-1), np.abs(energy - work)
    sizes = np.max(np.abs(reactions), axis=(1, 2)), np.abs(energy)
    tiny = np.finfo(float).tiny
    return float(max(np.max(one / np.maximum(size, tiny)) for one, size in zip(differences, sizes, strict=True)))


def _reactions(mesh: StageMesh, forces: Array) -> Array:
    """Forces of the ground on each pad (k, 3 chains, 3), about the platform's centre."""
    found = np.zeros((len(forces), 3, 3))
    for chain, mine in enumerate(clamped_nodes(mesh)):
        x, y = mesh.nodes[mine].T
        fx, fy = np.moveaxis(forces[:, mine], -1, 0)
        found[:, chain] = np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y], axis=1)
    return found


def clamped_nodes(mesh: StageMesh) -> list[Index]:
    """Nodes of the clamped edge of each chain's pad."""
    chain_of = np.full(len(mesh.nodes), -1)
    for body in range(0, 12, 4):  # pads
        chain_of[mesh.triangles[mesh.bodies == body]] = body // 4
    ground = np.unique(mesh.edges["ground"])
    return [ground[chain_of[ground] == chain] for chain in range(3)]


def edge_maxima(mesh: StageMesh, values: Array) -> Array:
    """Largest of values (n, ...) at the nodes of each clamped edge, (3 chains, ...), but for `CORNER` at both ends."""
    found = []
    for nodes in clamped_nodes(mesh):
        x, y = mesh.nodes[nodes].T
        end = int(np.argmax(np.hypot(x - np.mean(x), y - np.mean(y))))
        along = np.hypot(x - x[end], y - y[end])
        found.append(largest_within(along / np.max(along), values[nodes], CORNER, 1 - CORNER))
    return np.array(found)


def largest_within(places: Array, values: Array, low: float, high: float) -> Array:
    """Largest of values (n, ...) at places (n,) from `low` to `high`, linear in between."""
    order = np.argsort(places)
    places, values = places[order], values[order]
    inside = (places > low) & (places < high)
    k = np.clip(np.searchsorted(places, [low, high]), 1, len(places) - 1)
    share = ([low, high] - places[k - 1]) / (places[k] - places[k - 1])
    share = share.reshape(2, *[1] * (values.ndim - 1))
    ends = (1 - share) * values[k - 1] + share * values[k]
    return np.asarray(np.max(np.concatenate([values[inside], ends]), axis=0))
