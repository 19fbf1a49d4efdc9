"""Static response of a structure to loads on its rigid hub, to stack forces, and to displacements of the ground.

One factorisation serves all cases; iterative refinement uses residuals from displacement differences within elements,
and balances are checked. The force of a stack on a link is a body force over its station, and the opening of a stack
is a mean with the same weights, so that the compliance is symmetric; on the platform both act on the hub.

A structure warmed on a frame has the stress `D (e(u) - e0)` with the free thermal strain e0. A temperature linear in
space leaves a free homogeneous body without stress: `T = 1` with `u0 = r`, and `T = x_a` with
`u0 = x_a r - e_a r^2 / 2`, per expansion. The unknown is `d = u - u0`, prescribed on the clamped edges by the expansion
of the frame relative to the material; a difference of solutions would lose digits where both expand nearly equally. On
the hub, which deforms as free material, d is a rigid motion. So all results are proportional to the expansion of the
frame less that of the material. A gradient through the thickness is antisymmetric: u = v = 0 on the mid-plane, w free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Layers, Plate, integration, nodal_stress
from flexfem.fem.factor import Solve
from flexfem.fem.mesh import Sector, StageMesh, nodes_on, welded
from flexfem.fem.structure import NONE, Mass, Structure, structure
from flexfem.fem.symmetry import chain_values, factorise_stage, whole_fields
from flexfem.mechanism.actuators import HINGE_NAMES
from flexfem.mechanism.contacts import Push, Stack, body_forces
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation, turned
from flexfem.refused import ComputationFailed

BALANCE = 1e-9  # relative tolerance of reactions against loads and of energy against work
MOST_SOLVES = 12  # in iterative refinement; three suffice for necks of some um and more
REFINED = 0.1 * BALANCE  # ends refinement: energy and work differ by the error of the compliance
FORCE_QUADRATURE = 8  # degree for stack forces, whose density is not polynomial in a triangle


class StaticSolution(NamedTuple):
    """Static solution of k cases, of one of three identical sectors or of the whole.

    motion : (size, k), unknowns.   fields : (k, n, ...), displacements, mm, of all nodes.
    pads : (k, pads, 3), force and moment of the ground on each pad of the whole, about the platform centre.
    energy : (k, k), N mm, `u_i' K u_j` of the whole.
    """

    motion: Array
    fields: Array
    pads: Array
    energy: Array

    @property
    def compliance(self) -> Array:
        """The pose (3, k)."""
        return self.motion[-3:]

    @property
    def reactions(self) -> Array:
        """Resultants (k, 3) of the ground on all clamped edges."""
        return np.asarray(self.pads.sum(axis=1))

    @property
    def unknowns(self) -> int:
        return len(self.motion)


def refined_solution(
    structure: Structure,
    solve: Solve,
    loads: Array,
    prescribed: Array | None = None,
    cyclic: bool = False,
    held: Index | None = None,
) -> StaticSolution:
    """Solve and refine until forces and energy balance. Raises ComputationFailed when they do not.

    solve : inverse of the stiffness, loads (size, k) -> unknowns (size, k).
    loads : (size, k), on the unknowns; a third of those of the whole if `cyclic`.
    prescribed : (k, n, ...), displacements of clamped nodes, zero elsewhere; None for all zero.
    cyclic : the structure is one of three identical sectors, whose 3 cases rotate as the vector x, y, theta.
    held : clamped nodes, as one pad, of a structure that may be under loads without a resultant; None for a stage.
    """
    rotations = [chain_rotation(chain) for chain in range(3)] if cyclic else [np.eye(loads.shape[1])]
    scale = np.ones(3)
    points, order = structure.mesh.nodes, structure.vector_first
    scale[order[2:] if order[0] == 0 else order[:2]] = 1 / np.max(np.abs(points))  # moments
    pads = [nodes_on(structure.mesh, "ground")] if cyclic else [held] if held is not None else []
    pads = pads or clamped_nodes(structure.mesh)
    nodal = 0.0 if held is None else np.sum(np.abs(loads), axis=0)
    rigid, motion = [structure.rigid_fields(nodes).reshape(3, -1).T for nodes in pads], np.zeros_like(loads)
    offset = np.zeros((loads.shape[1], len(points), *structure.shape)) if prescribed is None else prescribed

    def of_chains(values: Array) -> list[Array]:
        """Resultants (k, 3) of every chain from those of one."""
        inverse = np.argsort(order)
        return [(R @ values[:, order] @ R.T)[:, inverse] for R in rotations] if cyclic else [values]

    def summed(values: Array) -> Array:
        """Products (k, k) of cases of the whole from those of one chain."""
        return np.asarray(np.sum([R @ values @ R.T for R in rotations], axis=0))

    applied = loads.T @ np.concatenate([structure.rigid_unknowns(structure.free), np.eye(structure.poses, 3)])
    loaded = np.sum(of_chains(applied), axis=0) * scale
    residual = loads if prescribed is None else loads - structure.loads(structure.forces(prescribed))
    for _ in range(MOST_SOLVES):
        motion = motion + solve(residual)
        fields = offset + structure.fields(motion)
        forces = structure.forces(fields)
        residual, flat = loads - structure.loads(forces), forces.reshape(len(forces), -1)
        reactions = [forces[:, n].reshape(len(forces), -1) @ unit for n, unit in zip(pads, rigid, strict=True)]
        energy = summed(fields.reshape(len(fields), -1) @ flat.T)
        solution = StaticSolution(motion, fields, np.stack([r for pad in reactions for r in of_chains(pad)], 1), energy)
        work = summed(motion.T @ loads + offset.reshape(len(offset), -1) @ flat.T)
        imbalance = _imbalance(solution, work, loaded, scale, nodal)
        if max(imbalance.values()) <= REFINED:
            break
    if prescribed is not None:  # resultants may vanish, so nodal forces count as well
        imbalance = _imbalance(solution, work, loaded, scale, nodal + np.max(np.abs(flat), axis=1))
    for name, worst in imbalance.items():
        if not worst <= BALANCE:
            raise ComputationFailed(f"solution refused: {name} differ by {worst:.2g}, expected at most {BALANCE:g}")
    return solution


def _imbalance(
    solution: StaticSolution, work: Array, loaded: Array, scale: Array, nodal: Array | float = 0.0
) -> dict[str, float]:
    """Imbalance of reactions and loads, relative to the largest of them and `nodal` (k,), N, and of energy and work."""
    tiny, size = np.finfo(float).tiny, np.sqrt(np.abs(np.diag(solution.energy)))
    pads = solution.pads * scale
    largest = np.maximum(np.maximum(np.max(np.abs(pads), axis=(1, 2)), np.max(np.abs(loaded), axis=1)), nodal)
    forces = np.max(np.abs(pads.sum(axis=1) + loaded), axis=1) / np.maximum(largest, tiny)
    energies = np.abs(solution.energy - work) / np.maximum(np.outer(size, size), tiny)
    return {"reactions and load": float(np.max(forces)), "strain energy and work": float(np.max(energies))}


def clamped_nodes(mesh: StageMesh) -> list[Index]:
    """Return the nodes on the clamped edge of the pad of each chain."""
    chain_of, ground = np.full(len(mesh.nodes), -1), nodes_on(mesh, "ground")
    for chain in range(3):
        chain_of[mesh.triangles[mesh.bodies == 4 * chain]] = chain  # body 0, the pad
    return [ground[chain_of[ground] == chain] for chain in range(3)]


@dataclass(frozen=True)
class Response:
    """Response of a stage to three cases that rotate from chain to chain as x, y, theta do: loads or temperatures.

    compliance : (3, 3), column j the pose in case j, mm and rad; per N and N mm for unit loads.
    sectors, sector_fields : one or three sectors and the displacements (3 cases, n, 2), mm, of their nodes, with
        layers (3, n, m, 3); both are in the frame of chain 1, the cases in that of the stage.
    reactions : (3, 3), row j the resultant of the ground on the clamped edges about the origin in case j, N and N mm.
    energy : (3, 3), N mm, `u_i' K u_j`.   unknowns : of the whole stage.   extrusion : None in the plane.
    """

    compliance: Array
    sectors: tuple[Sector, ...]
    sector_fields: tuple[Array, ...]
    reactions: Array
    energy: Array
    unknowns: int
    extrusion: Layers | None = None

    @property
    def layers(self) -> Layers:
        """The layers of an extruded stage."""
        assert self.extrusion is not None
        return self.extrusion

    @property
    def triangles(self) -> int:
        """Number of triangles of the whole stage."""
        return sum(len(sector.mesh.triangles) for sector in self.sectors) * 3 // len(self.sectors)

    @property
    def mesh(self) -> StageMesh:
        return self._welded[0]

    @cached_property
    def fields(self) -> Array:
        """Displacements (3 cases, n, 2), mm, of all nodes of `mesh`; with layers (3, n, m, 3)."""
        mesh, sector_nodes = self._welded
        return whole_fields(len(mesh.nodes), sector_nodes, chain_values(self.sector_fields))

    @cached_property
    def _welded(self) -> tuple[StageMesh, list[Index]]:
        return welded(self.sectors)


def unit_response(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None = None,
    degree: int | None = None,
    prescribed: Callable[[Structure], Array] | None = None,
) -> Response:
    """Solve for unit loads on the rigid hub with the ground clamped; `degree` is that of the quadrature in the plane.

    prescribed : instead of loads, displacements (3, n, ...) of the clamped nodes of a structure.
    Raises ComputationFailed as `refined_solution` and `Structure.lower`.
    """
    stage = factorise_stage(sectors, plate, layers, degree)
    loads, on_ground = _unit_loads(stage.structure) / (3 if stage.cyclic else 1), None
    if prescribed is not None:
        loads, on_ground = np.zeros_like(loads), prescribed(stage.structure)
    solution = refined_solution(stage.structure, stage.solve, loads, on_ground, stage.cyclic)
    fields = stage.sector_fields(solution.fields)
    return Response(solution.compliance, sectors, fields, solution.reactions, solution.energy, stage.unknowns, layers)


def platform_response(mesh: StageMesh, plate: Plate, degree: int | None = None) -> StaticSolution:
    """Solve as `unit_response` on a whole mesh; the compliance is the pose block of `(T' K T)^-1`, hence symmetric."""
    whole = structure(mesh, plate, degree=degree)
    return refined_solution(whole, whole.factorised(), _unit_loads(whole))


def weight_response(mass: Mass, acceleration: Array) -> StaticSolution:
    """Solve for a structure under its weight; `acceleration` (3,) along the components of the pose, mm/s^2."""
    structure = mass.structure
    loads = structure.loads(mass.forces(np.tensordot(acceleration, structure.rigid_fields(), axes=1)[None]))
    loads[-3:, 0] += mass.carried @ acceleration
    return refined_solution(structure, structure.factorised(), loads)


def _unit_loads(structure: Structure) -> Array:
    return np.eye(structure.size, 3, 3 - structure.size)


class DrivenResponse(NamedTuple):
    """Response to unit loads on the platform and to one newton of each of n stacks.

    compliance : (3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    fields : (3 + n, nodes, 2), mm, displacement of every node.
    """

    compliance: Array
    fields: Array


def driven_response(mesh: StageMesh, plate: Plate, stacks: Sequence[Stack]) -> DrivenResponse:
    """Solve for unit loads on the hub and for one newton of each stack, with the ground clamped."""
    whole = structure(mesh, plate)
    loads = stack_loads(whole, stacks)
    solution = refined_solution(whole, whole.factorised(), loads)
    compliance = loads.T @ solution.motion
    return DrivenResponse((compliance + compliance.T) / 2, solution.fields)


def stack_loads(structure: Structure, stacks: Sequence[Stack]) -> Array:
    """Return the unit loads (unknowns, 3 + n) of the three directions of the platform and of the stacks."""
    nodal, hub = np.zeros((3 + len(stacks), *structure.mesh.nodes.shape)), np.eye(3, 3 + len(stacks))
    for j, stack in enumerate(stacks, start=3):
        for push in stack.pushes:
            if push.station is not None:
                nodal[j] += push_forces(structure.mesh, stack.chain, push)
            elif push.body:
                hub[:, j] += stack.placed(push)
    loads = structure.loads(nodal)
    loads[-3:] += hub
    return loads


def push_forces(mesh: StageMesh, chain: int, push: Push) -> Array:
    """Return nodal forces (n, 2), N, of one newton of a stack on a link of a chain (from 0), with its exact wrench."""
    assert push.station is not None
    link = _body_mesh(mesh, 4 * chain + push.body)
    forces = np.zeros((3, *mesh.nodes.shape))
    for batch in integration(link, FORCE_QUADRATURE):
        at = turned(mesh.nodes[batch.triangles], -chain * CHAIN_TURN)
        points = np.einsum("eid,iq->eqd", at, batch.phi)
        density = body_forces(push.station, points.reshape(-1, 2)).reshape(3, *points.shape)
        nodal = np.einsum("keqd,eq,iq->keid", density, batch.weights, batch.phi)
        for force, values in zip(forces, nodal, strict=True):
            np.add.at(force, batch.triangles, values)
    resultants = resultants_of(turned(mesh.nodes, -chain * CHAIN_TURN), forces)
    return turned(np.tensordot(np.linalg.solve(resultants, push.wrench), forces, axes=1), chain * CHAIN_TURN)


def neck_wrenches(mesh: StageMesh, plate: Plate, fields: Array) -> Array:
    """Wrenches (3 chains, 3 hinges, 3, k) of the outboard on the base side of each neck, about the platform centre.

    N and N mm, for fields (k, n, 2), mm; they sum the nodal forces at the neck of the triangles of the base-side body.
    """
    wrenches = np.empty((3, len(HINGE_NAMES), 3, len(fields)))
    for chain in range(3):
        for hinge, name in enumerate(HINGE_NAMES):
            body = structure(_body_mesh(mesh, 4 * chain + hinge), plate, held=NONE)
            nodes = nodes_on(mesh, f"neck {chain + 1} {name}")
            wrenches[chain, hinge] = resultants_of(mesh.nodes[nodes], body.forces(fields)[:, nodes])
    return wrenches


def _body_mesh(mesh: StageMesh, body: int) -> StageMesh:
    """Return the triangles of a body, 4 * chain + body, with all nodes of the mesh."""
    in_body = mesh.bodies == body
    return mesh._replace(triangles=mesh.triangles[in_body], bodies=mesh.bodies[in_body])


def resultants_of(nodes: Array, forces: Array) -> Array:
    """Force and moment (3, k) about the origin of forces (k, n, 2) at nodes (n, 2)."""
    (x, y), (fx, fy) = nodes.T, np.moveaxis(forces, -1, 0)
    return np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y])


class HeatResponse(NamedTuple):
    """Response of a plane structure to one kelvin, and to one kelvin per mm along x and along y: three cases.

    pose : (3, 3 cases), mm and rad.   fields : (3 cases, n, 2), mm.   stress : (3 cases, n, 2, 2), MPa, at the nodes.
    reactions : (3 cases, 3 chains, 3), N and N mm, of the ground on each pad about the platform centre.
    """

    pose: Array
    fields: Array
    stress: Array
    reactions: Array


def heat_response(mesh: StageMesh, plate: Plate, stage_expansion: float, frame_expansion: float) -> HeatResponse:
    """Solve for the three cases with expansions, 1/K, in the plane. Raises ComputationFailed as `refined_solution`."""
    solution, order = thermal_solution(mesh, plate), [2, 0, 1]
    mismatch = frame_expansion - stage_expansion
    elastic = mismatch * solution.fields[order]
    fields = elastic + stage_expansion * free_displacement(mesh.nodes)[order]
    stress = nodal_stress(mesh, plate, elastic)
    return HeatResponse(mismatch * solution.compliance[:, order], fields, stress, mismatch * solution.pads[order])


def free_displacement(points: Array, layers: Layers | None = None) -> Array:
    """Displacements (3 cases of `thermal_response`, n, 2) or (3, n, m, 3), mm, per expansion, of a free body."""
    r = points if layers is None else np.stack(np.broadcast_arrays(*points.T[:, :, None], layers.heights), axis=-1)
    axes = r.shape[-1]
    along = [r[..., a, None] * r - np.eye(axes)[a] * np.sum(r**2, axis=-1, keepdims=True) / 2 for a in range(axes)]
    return np.stack([0 * r, 0 * r, along[2]] if layers and layers.fixed else [along[0], along[1], r])


def thermal_response(sectors: tuple[Sector, ...], plate: Plate, layers: Layers | None = None) -> Response:
    """Solve for temperature cases per unit of the expansion of the frame less that of the material.

    The cases are gradients along x and y, then a uniform change; with antisymmetric layers two empty ones, then a
    gradient along z, the pose being z and the rotations about x and y. Displacements are relative to free material.

    Raises ComputationFailed as `refined_solution` and `Structure.lower`.
    """
    return unit_response(sectors, plate, layers, prescribed=_prescribed)


def thermal_solution(mesh: StageMesh, plate: Plate, layers: Layers | None = None) -> StaticSolution:
    """Solve as `thermal_response` on any mesh with clamped faces and a hub."""
    whole = structure(mesh, plate, layers)
    return refined_solution(whole, whole.factorised(), np.zeros((whole.size, 3)), _prescribed(whole))


def _prescribed(structure: Structure) -> Array:
    """Displacements (3 cases, n, ...) of the clamped faces, as free expansion; zero at all other nodes."""
    ground = nodes_on(structure.mesh, "ground")
    fields = np.zeros((3, len(structure.mesh.nodes), *structure.shape))
    fields[:, ground] = free_displacement(structure.mesh.nodes[ground], structure.layers)
    return fields
