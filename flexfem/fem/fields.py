"""What fields of a stage say: stress at its necks and clamped edges, rotations of its base hinges, its envelope."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import Response, StaticSolution, clamped_nodes
from flexfem.fem.structure import out_of_plane_ratio_of, plate_of, sheet_of
from flexfem.fem.symmetry import under_loads
from flexfem.mechanism.bodies import BODIES
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation, stage_frames, turned
from flexfem.mechanism.stage import Stage

BESIDE = (1.0, 2.0)  # distances from a base hinge, per radius, between which its two bodies are taken for rigid
CORNER = 0.2  # of a clamped edge, left out at both ends: stress at its corners has no bound, and grows with the mesh


class LoadCase(NamedTuple):
    """One load on the platform: pose (3,) mm, mm, rad; field (n, 2) mm; reaction (3,) N, N, N mm; energy N mm;
    stress (n,) von Mises, MPa; neck_stress (3 chains, 3 hinges), the largest in each notch, MPa."""

    pose: Array
    field: Array
    reaction: Array
    energy: float
    stress: Array
    neck_stress: Array


def plane_stress(stage: Stage, mesh: StageMesh, field: Array) -> Array:
    """Von Mises stress (n,), MPa, at all nodes of a plane displacement (n, 2), mm."""
    return von_mises(nodal_stress(mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))


def load_case(stage: Stage, mesh: StageMesh, response: Response | StaticSolution, force: Array) -> LoadCase:
    """Combine the unit responses in the plane to one load (3,), N, N and N mm, at the platform centre."""
    field = np.tensordot(force, response.fields, axes=1)
    stress = plane_stress(stage, mesh, field)
    return LoadCase(
        pose=response.compliance @ force,
        field=field,
        reaction=force @ response.reactions,
        energy=float(force @ response.energy @ force / 2),
        stress=stress,
        neck_stress=neck_maxima(stage, mesh, stress),
    )


def neck_maxima(stage: Stage, mesh: StageMesh, values: Array) -> Array:
    """Largest nodal value (3 chains, 3 hinges) within a notch radius of each neck's centre."""
    return np.array([[np.max(values[near]) for near in _near_necks(stage, mesh, chain)] for chain in range(3)])


def _near_necks(stage: Stage, mesh: StageMesh, chain: int, frame: int = 0) -> list[NDArray[np.bool_]]:
    """Which nodes (n,) are within a notch radius of each neck's centre of a chain; chains from 0.

    frame : the chain in whose frame the nodes are.
    """
    centres = turned(stage_frames(stage).centres[chain], -frame * CHAIN_TURN)
    places = zip(centres, stage.array("radius")[chain], strict=True)
    return [np.hypot(*(mesh.nodes - centre).T) <= radius for centre, radius in places]


class NeckStress(NamedTuple):
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, and its distances from the mid-plane, mm."""

    highest: Array
    height: Array


def neck_stresses(stage: Stage, response: Response, loads: Array) -> NeckStress:
    """Largest von Mises stress in each notch under loads (k, 3), N, N, N mm; of an extruded stage over the thickness.

    As `load_case`: averaged over the elements around a node, the largest within a notch radius of the neck.
    """
    highest, height = np.zeros((2, len(loads), 3, 3))
    pull, layers = out_of_plane_ratio_of(stage), response.extrusion
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        found = von_mises(stress, pull).max(axis=1)
        if layers is not None:
            height[:, chain, hinge] = layers.heights[found.argmax(axis=1)]
            found = found.max(axis=1)
        highest[:, chain, hinge] = found
    return NeckStress(highest, height)


def notch_fields(stage: Stage, response: Response, loads: Array) -> Iterator[tuple[tuple[int, int], Array]]:
    """Chain and hinge of every notch, from 0, and the stress, MPa, at its nodes under loads (k, 3).

    The stress is (k, c, 2, 2); with layers (k, c, m, 3, 3). The axes are those of the first chain that the notch's
    sector stands for.
    """
    plate = plate_of(stage) if response.extrusion is None else sheet_of(stage)
    for first, (sector, fields) in enumerate(zip(response.sectors, response.sector_fields, strict=True)):
        near = np.array(_near_necks(stage, sector.mesh, first, first))
        chosen = np.flatnonzero(np.any(near, axis=0))
        units = nodal_stress(sector.mesh, plate, fields, chosen, response.extrusion)
        for chain in range(first, 3, len(response.sectors)):
            turned_back = loads @ chain_rotation(chain - first)
            for hinge, close in enumerate(near[:, chosen]):
                yield (chain, hinge), np.tensordot(turned_back, units[:, close], axes=1)


def base_rotations(stage: Stage, response: Response) -> Array:
    """Rotation (3 loads, 3 chains), rad, of link 1 against the pad of every base hinge in the mid-plane, by unit loads.

    Bodies rotate as the rigid motion that fits their nodes between one and two notch radii from the neck's centre best.
    """
    rows = []
    for chain, (sector, fields) in enumerate(zip(response.sectors, response.sector_fields, strict=True)):
        mesh, flat = sector.mesh, fields if response.extrusion is None else fields[:, :, 0, :2]
        centre = turned(stage_frames(stage).centres[chain, 0], -chain * CHAIN_TURN)
        distance = np.hypot(*(mesh.nodes - centre).T) / stage.hinge(chain + 1, "base").radius
        turns = []
        for body in ("pad", "link 1"):
            chosen = np.unique(mesh.triangles[mesh.bodies == BODIES.index(body)])
            chosen = chosen[(distance[chosen] >= BESIDE[0]) & (distance[chosen] <= BESIDE[1])]
            arm = mesh.nodes[chosen] - mesh.nodes[chosen].mean(axis=0)
            turns.append((flat[:, chosen, 1] @ arm[:, 0] - flat[:, chosen, 0] @ arm[:, 1]) / np.sum(arm**2))
        rows.append((turns[1] - turns[0])[:, None])
    return np.concatenate(under_loads(rows), axis=1)


def envelope(response: Response) -> float:
    """Diameter, mm, of the circle about the platform's centre that holds the stage."""
    return 2 * max(float(np.max(np.hypot(*sector.mesh.nodes.T))) for sector in response.sectors)


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
    from scipy.interpolate import make_interp_spline

    order = np.argsort(places)
    places, values = places[order], values[order]
    inside = (places > low) & (places < high)
    ends = make_interp_spline(places, values, k=1)([low, high])
    return np.asarray(np.max(np.concatenate([values[inside], ends]), axis=0))
