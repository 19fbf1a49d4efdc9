"""Static answers of a structure to loads on its rigid hub, to its stacks, and to a ground that is displaced.

One factorisation, any number of cases, iterative refinement with residuals from differences of displacements within the
elements, and checked balances. A push of a stack on a link is a body force over its station, and the opening of a stack
is read with the same weights, so that the compliance is symmetric; on the platform both act on the hub.

A structure that warms on a frame has the stress `D (e(u) - e0)` with the free thermal strain e0. Temperatures linear in
space leave a free body of one material without stress: `T = 1` with `u0 = r`, and `T = x_a` with
`u0 = x_a r - e_a r^2 / 2`, per expansion. Solved for is `d = u - u0`, which the clamped edges impose, moving as the
frame does and not as the material would: as a difference it would lose its digits where both expand nearly alike. On
the hub, which grows and bows as free material does, d is a rigid motion. So all answers are proportional to the frame's
expansion less the material's. A gradient through the thickness is antisymmetric: u = v = 0 on the mid-plane, w is free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Layers, Plate, integration, nodal_stress
from flexfem.fem.factor import Solve, factorise
from flexfem.fem.mesh import Sector, StageMesh, nodes_on, welded
from flexfem.fem.structure import NONE, Mass, Structure, structure
from flexfem.fem.symmetry import by_sectors, under_loads, whole_fields
from flexfem.mechanism.actuators import HINGE_NAMES
from flexfem.mechanism.contacts import Push, Stack, body_forces
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation, turned
from flexfem.refused import ComputationFailed

BALANCE = 1e-9  # of the load: reactions, and energy against work
MOST_SOLVES = 12  # with iterative refinement; three do for necks of some um and more
SETTLED = 0.1 * BALANCE  # refined no further: energy and work differ by the error of the compliance
PUSH_QUADRATURE = 8  # degree, for pushes, whose weights are no polynomials in a triangle


class StaticSolution(NamedTuple):
    """A structure at rest in k cases; one sector of three alike, or the whole.

    motion : (size, k), unknowns.   fields : (k, n, ...), displacements, mm, of all nodes.
    pads : (k, pads, 3), force and moment of the ground on each pad of the whole, about the platform's centre.
    energy : (k, k), N mm, of the whole, `u_i' K u_j`.
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
        """Resultants (k, 3) of the clamped edges."""
        return np.asarray(self.pads.sum(axis=1))

    @property
    def unknowns(self) -> int:
        return len(self.motion)


def settle(
    of: Structure, solve: Solve, loads: Array, given: Array | None = None, alike: bool = False
) -> StaticSolution:
    """Refine the answer to loads until its balances hold. Raises ComputationFailed when they do not.

    solve : by the stiffness, loads (size, k) -> unknowns (size, k).
    loads : (size, k), on the unknowns; where `alike`, a third of those of the whole.
    given : (k, n, ...), displacements imposed on clamped nodes, zero elsewhere; None holds them.
    alike : the structure is one of three alike sectors, which turn cases (3) as the vector x, y, theta.
    """
    turns = [chain_rotation(chain) for chain in range(3)] if alike else [np.eye(loads.shape[1])]
    scale = np.ones(3)
    scale[of.turning[2:] if of.turning[0] == 0 else of.turning[:2]] = 1 / np.max(np.abs(of.mesh.nodes))  # rotations
    pads = [nodes_on(of.mesh, "ground")] if alike else clamped_nodes(of.mesh)
    ground, motion = [of.rigid_fields(nodes).reshape(3, -1).T for nodes in pads], np.zeros_like(loads)
    imposed = np.zeros((loads.shape[1], len(of.mesh.nodes), *of.shape)) if given is None else given

    def around(values: Array) -> list[Array]:
        """Resultants (k, 3) of every chain from those of one."""
        back = np.argsort(of.turning)
        return [(turn @ values[:, of.turning] @ turn.T)[:, back] for turn in turns] if alike else [values]

    def whole(values: Array) -> Array:
        """Products (k, k) of cases of the whole from those of one chain."""
        return np.asarray(np.sum([turn @ values @ turn.T for turn in turns], axis=0))

    applied = loads.T @ np.concatenate([of.rigid_unknowns(of.free), np.eye(of.poses, 3)])
    loaded = np.sum(around(applied), axis=0) * scale
    residual = loads if given is None else loads - of.loads(of.forces(given))
    for _ in range(MOST_SOLVES):
        motion = motion + solve(residual)
        fields = imposed + of.fields(motion)
        forces = of.forces(fields)
        residual, flat = loads - of.loads(forces), forces.reshape(len(forces), -1)
        held = [forces[:, nodes].reshape(len(forces), -1) @ rigid for nodes, rigid in zip(pads, ground, strict=True)]
        energy = whole(fields.reshape(len(fields), -1) @ flat.T)
        found = StaticSolution(motion, fields, np.stack([r for each in held for r in around(each)], 1), energy)
        work = whole(motion.T @ loads + imposed.reshape(len(imposed), -1) @ flat.T)
        unbalanced = _imbalance(found, work, loaded, scale)
        if max(unbalanced.values()) <= SETTLED:
            break
    if given is not None:  # pads that carry nothing but stress of their own
        unbalanced = _imbalance(found, work, loaded, scale, np.max(np.abs(flat), axis=1))
    for name, worst in unbalanced.items():
        if not worst <= BALANCE:
            raise ComputationFailed(f"solution refused: {name} differ by {worst:.2g}, expected at most {BALANCE:g}")
    return found


def _imbalance(
    found: StaticSolution, work: Array, loaded: Array, scale: Array, nodal: Array | float = 0.0
) -> dict[str, float]:
    """What reactions and loads differ by over the largest of them and of `nodal` (k,), N; energy and work likewise."""
    tiny, size = np.finfo(float).tiny, np.sqrt(np.abs(np.diag(found.energy)))
    pads = found.pads * scale
    largest = np.maximum(np.maximum(np.max(np.abs(pads), axis=(1, 2)), np.max(np.abs(loaded), axis=1)), nodal)
    forces = np.max(np.abs(pads.sum(axis=1) + loaded), axis=1) / np.maximum(largest, tiny)
    energies = np.abs(found.energy - work) / np.maximum(np.outer(size, size), tiny)
    return {"reactions and load": float(np.max(forces)), "strain energy and work": float(np.max(energies))}


def clamped_nodes(mesh: StageMesh) -> list[Index]:
    """Nodes of the clamped edge of each chain's pad."""
    chain_of, ground = np.full(len(mesh.nodes), -1), nodes_on(mesh, "ground")
    for chain in range(3):
        chain_of[mesh.triangles[mesh.bodies == 4 * chain]] = chain  # its pad
    return [ground[chain_of[ground] == chain] for chain in range(3)]


@dataclass(frozen=True)
class Response:
    """Answer of a stage to three cases that its chains turn as they turn x, y, theta: loads, or gradients of warmth.

    compliance : (3, 3), column j the pose by case j, mm and rad; of unit loads per N and N mm.
    sectors, sector_fields : one or three sectors, and the displacements (3 cases, n, 2), mm, of their nodes, with
        layers (3, n, m, 3); both are in the frame of chain 1, the cases in that of the stage.
    reactions : (3, 3), row j the resultant of the clamped edges about the origin by case j, N and N mm.
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
        """Of an extruded stage."""
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
        mesh, places = self._welded
        return whole_fields(len(mesh.nodes), places, under_loads(self.sector_fields))

    @cached_property
    def _welded(self) -> tuple[StageMesh, list[Index]]:
        return welded(self.sectors)


def unit_response(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None = None,
    degree: int | None = None,
    imposed: Callable[[Structure], Array] | None = None,
) -> Response:
    """Solve for unit loads on the rigid hub with the ground clamped; `degree` is that of the quadrature in the plane.

    imposed : instead of loads, displacements (3, n, ...) of the clamped nodes of a structure.
    Raises ComputationFailed as `settle` and `Structure.lower`.
    """
    stage = by_sectors(sectors, plate, layers, degree)
    loads, given = _unit_loads(stage.of) / (3 if stage.alike else 1), None
    if imposed is not None:
        loads, given = np.zeros_like(loads), imposed(stage.of)
    found = settle(stage.of, stage.solve, loads, given, stage.alike)
    fields = stage.sector_fields(found.fields)
    return Response(found.compliance, sectors, fields, found.reactions, found.energy, stage.unknowns, layers)


def platform_response(mesh: StageMesh, plate: Plate, degree: int | None = None) -> StaticSolution:
    """As `unit_response`, of a whole mesh: the compliance is the pose block of `(T' K T)^-1`, hence symmetric."""
    of = structure(mesh, plate, degree=degree)
    return settle(of, factorise(of.lower()), _unit_loads(of))


def weight_response(mass: Mass, acceleration: Array) -> StaticSolution:
    """What a structure does under its weight; `acceleration` (3,) along the components of its pose, mm/s^2."""
    of = mass.of
    loads = of.loads(mass.forces(np.tensordot(acceleration, of.rigid_fields(), axes=1)[None]))
    loads[-3:, 0] += mass.carried @ acceleration
    return settle(of, factorise(of.lower()), loads)


def _unit_loads(of: Structure) -> Array:
    return np.eye(of.size, 3, 3 - of.size)


class DrivenResponse(NamedTuple):
    """Finite-element answer to the loads of the platform and one newton of each of n stacks.

    compliance : (3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    fields : (3 + n, nodes, 2), mm, displacement of every node.
    """

    compliance: Array
    fields: Array


def driven_response(mesh: StageMesh, plate: Plate, stacks: Sequence[Stack]) -> DrivenResponse:
    """Solve for unit loads on the hub and for one newton of each stack, with the ground clamped."""
    of = structure(mesh, plate)
    loads = stack_loads(of, stacks)
    found = settle(of, factorise(of.lower()), loads)
    compliance = loads.T @ found.motion
    return DrivenResponse((compliance + compliance.T) / 2, found.fields)


def stack_loads(of: Structure, stacks: Sequence[Stack]) -> Array:
    """Loads (unknowns, 3 + n) of the platform's three directions and of the stacks."""
    nodal, hub = np.zeros((3 + len(stacks), *of.mesh.nodes.shape)), np.eye(3, 3 + len(stacks))
    for j, stack in enumerate(stacks, start=3):
        for push in stack.pushes:
            if push.station is not None:
                nodal[j] += push_forces(of.mesh, stack.chain, push)
            elif push.body:
                hub[:, j] += stack.placed(push)
    loads = of.loads(nodal)
    loads[-3:] += hub
    return loads


def push_forces(mesh: StageMesh, chain: int, push: Push) -> Array:
    """Nodal forces (n, 2), N, of one newton of a push on a link of a chain (from 0), its wrench met exactly."""
    assert push.station is not None
    part = _part(mesh, 4 * chain + push.body)  # the numbers of the links are the same
    found = np.zeros((3, *mesh.nodes.shape))
    for batch in integration(part, PUSH_QUADRATURE):
        at = turned(mesh.nodes[batch.triangles], -chain * CHAIN_TURN)
        points = np.einsum("eid,iq->eqd", at, batch.phi)
        density = body_forces(push.station, points.reshape(-1, 2)).reshape(3, *points.shape)
        nodal = np.einsum("keqd,eq,iq->keid", density, batch.weights, batch.phi)
        for force, each in zip(found, nodal, strict=True):
            np.add.at(force, batch.triangles, each)
    resultants = _resultants(turned(mesh.nodes, -chain * CHAIN_TURN), found)
    return turned(np.tensordot(np.linalg.solve(resultants, push.wrench), found, axes=1), chain * CHAIN_TURN)


def neck_wrenches(mesh: StageMesh, plate: Plate, fields: Array) -> Array:
    """Wrench (3 chains, 3 hinges, 3, k) of the bodies beyond each neck on those before, about the platform centre.

    Of fields (k, n, 2), mm; N and N mm, by nodal forces of one body's triangles: those of its pushes are inside it.
    """
    found = np.empty((3, len(HINGE_NAMES), 3, len(fields)))
    for chain in range(3):
        for hinge, name in enumerate(HINGE_NAMES):
            part = structure(_part(mesh, 4 * chain + hinge), plate, held=NONE)
            nodes = nodes_on(mesh, f"neck {chain + 1} {name}")
            found[chain, hinge] = _resultants(mesh.nodes[nodes], part.forces(fields)[:, nodes])
    return found


def _part(mesh: StageMesh, body: int) -> StageMesh:
    """Triangles of a body, 4 * chain + body, of a mesh, with the nodes of all."""
    mine = mesh.bodies == body
    return mesh._replace(triangles=mesh.triangles[mine], bodies=mesh.bodies[mine])


def _resultants(nodes: Array, forces: Array) -> Array:
    """Force and moment about the origin (3, k) of forces (k, n, 2) at nodes (n, 2)."""
    (x, y), (fx, fy) = nodes.T, np.moveaxis(forces, -1, 0)
    return np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y])


class HeatResponse(NamedTuple):
    """Answer of a plane structure to one kelvin, and to one kelvin per mm along x and along y: three cases.

    pose : (3, 3 cases), mm and rad.   fields : (3 cases, n, 2), mm.   stress : (3 cases, n, 2, 2), MPa, at the nodes.
    reactions : (3 cases, 3 chains, 3), N and N mm, of the ground on each pad about the platform's centre.
    """

    pose: Array
    fields: Array
    stress: Array
    reactions: Array


def heat_response(mesh: StageMesh, plate: Plate, stage_expansion: float, frame_expansion: float) -> HeatResponse:
    """Solve for the three cases; the expansions, 1/K, are those in the plane. Raises ComputationFailed as `settle`."""
    found, order = warm_whole(mesh, plate), [2, 0, 1]
    beyond = frame_expansion - stage_expansion
    elastic = beyond * found.fields[order]
    fields = elastic + stage_expansion * free_displacement(mesh.nodes)[order]
    stress = nodal_stress(mesh, plate, elastic)
    return HeatResponse(beyond * found.compliance[:, order], fields, stress, beyond * found.pads[order])


def free_displacement(points: Array, layers: Layers | None = None) -> Array:
    """Displacements (3 cases as of `warm_half`, n, 2) or (3, n, m, 3), mm, per expansion, of free points (n, 2), mm."""
    r = points if layers is None else np.stack(np.broadcast_arrays(*points.T[:, :, None], layers.heights), axis=-1)
    axes = r.shape[-1]
    along = [r[..., a, None] * r - np.eye(axes)[a] * np.sum(r**2, axis=-1, keepdims=True) / 2 for a in range(axes)]
    return np.stack([0 * r, 0 * r, along[2]] if layers and layers.fixed else [along[0], along[1], r])


def warm_half(sectors: tuple[Sector, ...], plate: Plate, layers: Layers | None = None) -> Response:
    """Solve for the cases of one mirror half per unit of the frame's expansion beyond the material's.

    The cases are a gradient along x and along y, then an even change; with antisymmetric layers none, none, a gradient
    along z, the pose being z and the rotations about x and y. Displacements are those beyond free material's.

    Raises ComputationFailed as `settle` and `Structure.lower`.
    """
    return unit_response(sectors, plate, layers, imposed=_imposed)


def warm_whole(mesh: StageMesh, plate: Plate, layers: Layers | None = None) -> StaticSolution:
    """As `warm_half`, of any mesh with clamped faces and a hub."""
    of = structure(mesh, plate, layers)
    return settle(of, factorise(of.lower()), np.zeros((of.size, 3)), _imposed(of))


def _imposed(of: Structure) -> Array:
    """Displacements (3 cases, n, ...): of the clamped faces as the frame beyond the material, zero elsewhere."""
    ground = nodes_on(of.mesh, "ground")
    given = np.zeros((3, len(of.mesh.nodes), *of.shape))
    given[:, ground] = free_displacement(of.mesh.nodes[ground], of.layers)
    return given
