"""Quantities of stage fields: stress at necks and clamped edges, rotations of base hinges, envelope."""

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
from flexfem.fem.symmetry import chain_values
from flexfem.mechanism.bodies import BODIES
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation, stage_frames, turned
from flexfem.mechanism.stage import Stage

RIGID = (1.0, 2.0)  # distances from a base hinge, per radius, between which its two bodies count as rigid
CORNER = 0.2  # share of a clamped edge excluded at both ends: stress at its corners is singular


class LoadCase(NamedTuple):
    """Response to a load on the platform: pose (3,) mm, mm, rad; field (n, 2) mm; reaction (3,) N, N, N mm; energy
    N mm; stress (n,) von Mises, MPa; neck_stress (3 chains, 3 hinges), largest in each notch, MPa."""

    pose: Array
    field: Array
    reaction: Array
    energy: float
    stress: Array
    neck_stress: Array


def plane_stress(stage: Stage, mesh: StageMesh, field: Array) -> Array:
    """Von Mises stress (n,), MPa, at all nodes for a plane displacement field (n, 2), mm."""
    return von_mises(nodal_stress(mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))


def load_case(stage: Stage, mesh: StageMesh, response: Response | StaticSolution, force: Array) -> LoadCase:
    """Superpose the plane unit responses for a load (3,), N, N and N mm, at the platform centre."""
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
    """Mask (n,) of the nodes within a notch radius of the centre of each neck of a chain; chains from 0.

    frame : chain in whose frame the nodes are given.
    """
    centres = turned(stage_frames(stage).centres[chain], -frame * CHAIN_TURN)
    notches = zip(centres, stage.array("radius")[chain], strict=True)
    return [np.hypot(*(mesh.nodes - centre).T) <= radius for centre, radius in notches]


class NeckStress(NamedTuple):
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, and its distances from the mid-plane, mm."""

    highest: Array
    height: Array


def neck_stresses(stage: Stage, response: Response, loads: Array) -> NeckStress:
    """Largest von Mises stress in each notch under loads (k, 3), N, N, N mm; also over the thickness when extruded.

    As in `load_case`, stress is averaged at the nodes, and the largest within a notch radius of the neck is taken.
    """
    highest, height = np.zeros((2, len(loads), 3, 3))
    ratio, layers = out_of_plane_ratio_of(stage), response.extrusion
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        largest = von_mises(stress, ratio).max(axis=1)
        if layers is not None:
            height[:, chain, hinge] = layers.heights[largest.argmax(axis=1)]
            largest = largest.max(axis=1)
        highest[:, chain, hinge] = largest
    return NeckStress(highest, height)


def notch_fields(stage: Stage, response: Response, loads: Array) -> Iterator[tuple[tuple[int, int], Array]]:
    """Yield chain and hinge of every notch, from 0, and the stress, MPa, at its nodes under loads (k, 3).

    The stress is (k, c, 2, 2); with layers (k, c, m, 3, 3). Its axes are those of the first chain that the sector of
    the notch represents.
    """
    plate = plate_of(stage) if response.extrusion is None else sheet_of(stage)
    for first, (sector, fields) in enumerate(zip(response.sectors, response.sector_fields, strict=True)):
        near = np.array(_near_necks(stage, sector.mesh, first, first))
        chosen = np.flatnonzero(np.any(near, axis=0))
        units = nodal_stress(sector.mesh, plate, fields, chosen, response.extrusion)
        for chain in range(first, 3, len(response.sectors)):
            rotated = loads @ chain_rotation(chain - first)  # into the frame of the first chain
            for hinge, close in enumerate(near[:, chosen]):
                yield (chain, hinge), np.tensordot(rotated, units[:, close], axes=1)


def base_rotations(stage: Stage, response: Response) -> Array:
    """Rotation (3 loads, 3 chains), rad, of link 1 relative to the pad at each base hinge, mid-plane, per unit load.

    A body rotates as the rigid motion that best fits its nodes from one to two notch radii from the neck centre.
    """
    rows = []
    for chain, (sector, fields) in enumerate(zip(response.sectors, response.sector_fields, strict=True)):
        mesh, plane = sector.mesh, fields if response.extrusion is None else fields[:, :, 0, :2]
        centre = turned(stage_frames(stage).centres[chain, 0], -chain * CHAIN_TURN)
        distance = np.hypot(*(mesh.nodes - centre).T) / stage.hinge(chain + 1, "base").radius
        rotations = []
        for body in ("pad", "link 1"):
            chosen = np.unique(mesh.triangles[mesh.bodies == BODIES.index(body)])
            chosen = chosen[(distance[chosen] >= RIGID[0]) & (distance[chosen] <= RIGID[1])]
            arm = mesh.nodes[chosen] - mesh.nodes[chosen].mean(axis=0)
            rotations.append((plane[:, chosen, 1] @ arm[:, 0] - plane[:, chosen, 0] @ arm[:, 1]) / np.sum(arm**2))
        rows.append((rotations[1] - rotations[0])[:, None])
    return np.concatenate(chain_values(rows), axis=1)


def envelope(response: Response) -> float:
    """Diameter, mm, of the circle about the platform centre that encloses the stage."""
    return 2 * max(float(np.max(np.hypot(*sector.mesh.nodes.T))) for sector in response.sectors)


def edge_maxima(mesh: StageMesh, values: Array) -> Array:
    """Largest values (3 chains, ...) on each clamped edge of nodal values (n, ...), without `CORNER` at both ends."""
    maxima = []
    for nodes in clamped_nodes(mesh):
        x, y = mesh.nodes[nodes].T
        end = int(np.argmax(np.hypot(x - np.mean(x), y - np.mean(y))))
        along = np.hypot(x - x[end], y - y[end])
        maxima.append(largest_within(along / np.max(along), values[nodes], CORNER, 1 - CORNER))
    return np.array(maxima)


def largest_within(places: Array, values: Array, low: float, high: float) -> Array:
    """Largest of values (n, ...), given at `places` (n,) and linear in between, from `low` to `high`."""
    from scipy.interpolate import make_interp_spline

    order = np.argsort(places)
    places, values = places[order], values[order]
    inside = (places > low) & (places < high)
    ends = make_interp_spline(places, values, k=1)([low, high])
    return np.asarray(np.max(np.concatenate([values[inside], ends]), axis=0))
