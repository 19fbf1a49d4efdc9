"""Static response of a structure: loads on a rigid hub or ports, weight, heat, moved ground.

One factorisation serves all cases; iterative refinement uses residuals from displacement
differences within elements, and balances are checked. The force of a stack on a link is a body
force over its station, and the opening of a stack is a mean with the same weights, so that the
compliance is symmetric; on the platform both act on the hub.

A structure warmed on a frame has the stress `D (e(u) - e0)` with the free thermal strain e0. A
temperature linear in space leaves a free homogeneous body without stress: `T = 1` with `u0 = r`,
and `T = x_a` with `u0 = x_a r - e_a r^2 / 2`, per expansion. The unknown is `d = u - u0`,
prescribed on the clamped edges by the expansion of the frame relative to the material; a difference
of solutions would lose digits where both expand nearly equally. On the hub, which deforms as free
material, d is a rigid motion. So all results are proportional to the expansion of the frame less
that of the material. A gradient through the thickness is antisymmetric: u = v = 0 on the mid-plane,
w free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Layers, Plate, part_stresses
from flexfem.fem.mesh import SECTORS, PlaneMesh, Sector, joined, nodes_on, sector_rotation
from flexfem.fem.structure import Mass, Structure, structure
from flexfem.fem.symmetry import Space, full_space, harmonic_spaces, sector_values, whole_fields
from flexfem.refused import ComputationFailed

BALANCE = 1e-9  # relative tolerance of reactions against loads and of energy against work
MOST_SOLVES = 12  # in iterative refinement; three suffice for necks of some um and more
REFINED = 0.1 * BALANCE  # ends refinement: energy and work differ by the error of the compliance
# one kelvin, then one per mm along x and along y, of the cases of `Factorised.warmed`
HEAT_CASES = np.eye(3)[[2, 0, 1]]


@dataclass(frozen=True)
class Factorised:
    """A factorised structure, the whole or one of three identical sectors, and its ports.

    spaces : that of the whole, or those of harmonics 0 and 1 of the sector.
    ports : (size, k), unit loads on the unknowns: of the three directions of the hub, of stacks, or
        of contacts.
    sectors : of a plate around a rigid hub that is given by them; one represents three.
    regions : nodes of each region whose stress is needed.
    ratio : of stresses in the plane, see `von_mises`.
    bodies : nodes of each moving body whose stress is needed.
    """

    structure: Structure
    spaces: tuple[Space, ...]
    ports: Array
    sectors: tuple[Sector, ...] = ()
    regions: tuple[Index, ...] = ()
    ratio: float = 0.0
    bodies: tuple[Index, ...] = ()

    @property
    def cyclic(self) -> bool:
        """Whether one sector represents three."""
        return len(self.sectors) == 1

    @property
    def pads(self) -> list[Index]:
        """Clamped nodes of each part of the ground."""
        if self.cyclic:
            return [nodes_on(self.structure.mesh, "ground")]
        mesh = self.structure.mesh
        moving = np.append(self.structure.free, self.structure.hub)
        if "hub" in mesh.edges:
            return clamped_nodes(mesh)
        return [np.setdiff1d(np.arange(len(mesh.nodes)), moving)]

    def solve(self, loads: Array) -> Array:
        """Unknowns (size, k) under loads (size, k).

        A sector takes three, which rotate by sectors as x, y, theta do.
        """
        if not self.cyclic:
            return self.spaces[0].solution(loads)
        vector = self.spaces[1].solution(loads[:, :2])
        return np.hstack([vector, self.spaces[0].solution(loads[:, 2:])])

    def response(
        self,
        loads: Array | None = None,
        prescribed: Array | None = None,
    ) -> Response:
        """Solve and refine until forces and energy balance.

        loads : (size, c), on the unknowns, a third of those of the whole if `cyclic`; None for unit
            loads on the ports.
        prescribed : (c, n, ...), displacements of clamped nodes, zero elsewhere, instead of loads.

        Raises ComputationFailed when they do not balance.
        """
        structure = self.structure
        if prescribed is not None:
            loads = np.zeros((structure.size, len(prescribed)))
            offset = prescribed
            residual = loads - structure.loads(structure.forces(prescribed))
        else:
            if loads is None:
                loads = self.ports / (SECTORS if self.cyclic else 1)
            offset = np.zeros((loads.shape[1], len(structure.mesh.nodes), *structure.shape))
            residual = loads
        balance = _Balance(self, loads, offset)
        motion = np.zeros_like(loads)
        for _ in range(MOST_SOLVES):
            motion = motion + self.solve(residual)
            nodal = offset + structure.fields(motion)
            forces = structure.forces(nodal)
            residual = loads - structure.loads(forces)
            found = balance.of(motion, nodal, forces)
            if max(balance.imbalance(found, balance.on_nodes).values()) <= REFINED:
                break
        largest = balance.on_nodes
        if prescribed is not None:  # resultants may vanish
            largest = np.max(np.abs(forces.reshape(len(forces), -1)), axis=1)
        for name, worst in balance.imbalance(found, largest).items():
            if not worst <= BALANCE:
                raise ComputationFailed(
                    f"solution refused: {name} differ by {worst:.2g}, expected at most {BALANCE:g}"
                )
        return Response(
            structure,
            self.ports.T @ motion,
            nodal,
            found.reactions,
            found.energy,
            self.sectors,
            self.regions,
            self.ratio,
            self.bodies,
        )

    def weight_response(
        self,
        mass: Mass,
        accelerations: Array,
    ) -> Response:
        """Solve for the weight in c fields.

        accelerations : (c, j), mm/s^2, along the first j components of the pose.
        """
        along = np.pad(accelerations, [(0, 0), (0, 3 - accelerations.shape[1])])
        forces = mass.forces(np.tensordot(along, self.structure.rigid_fields(), axes=1))
        carried = np.tile(along.T, (mass.at.shape[1] // 3, 1))
        return self.response(self.structure.loads(forces) + mass.at @ (mass.carried @ carried))

    def thermal_response(self) -> Response:
        """Solve for temperature cases per expansion of the frame less that of the material.

        The cases are gradients along x and y, then a uniform change; with antisymmetric layers two
        empty ones, then a gradient along z, the pose being z and the rotations about x and y.
        Displacements are relative to free material."""
        structure = self.structure
        clamped = np.concatenate(self.pads)
        fields = np.zeros((3, len(structure.mesh.nodes), *structure.shape))
        fields[:, clamped] = free_displacement(structure.mesh.nodes[clamped], structure.layers)
        return self.response(prescribed=fields)


class _Balanced(NamedTuple):
    """Sums of a solution over the whole.

    reactions : (c, pads, 3), N and N mm.
    energy, work : (c, c), N mm, of the strain and the loads.
    """

    reactions: Array
    energy: Array
    work: Array


class _Balance:
    """Balances of the loads of c cases on a structure, for `Factorised.response`.

    loads, offset : (size, c) and (c, n, ...), loads and prescribed displacements.
    on_nodes : (c,), sums of the loads on nodes; loads may have no resultant.
    """

    def __init__(
        self,
        factorised: Factorised,
        loads: Array,
        offset: Array,
    ) -> None:
        structure = factorised.structure
        nodes = structure.mesh.nodes
        self.loads = loads
        self.offset = offset
        self.cyclic = factorised.cyclic
        self.order = structure.vector_first
        self.rotations = [np.eye(loads.shape[1])]
        if self.cyclic:
            self.rotations = [sector_rotation(sector) for sector in range(SECTORS)]
        self.scale = np.ones(3)
        moments = self.order[2:] if self.order[0] == 0 else self.order[:2]
        self.scale[moments] = 1 / np.max(np.abs(nodes))
        rigid = structure.rigid_fields().reshape(3, len(nodes), -1)
        self.pads = [(pad, rigid[:, pad]) for pad in factorised.pads]
        self.resultants = np.sum(self._of_sectors(loads.T @ structure.rigid), axis=0)
        self.on_nodes = np.sum(np.abs(loads[: structure.size - structure.poses]), axis=0)

    def _of_sectors(self, values: Array) -> list[Array]:
        """Resultants (c, 3) of every sector from those of one."""
        if not self.cyclic:
            return [values]
        inverse = np.argsort(self.order)
        return [(R @ values[:, self.order] @ R.T)[:, inverse] for R in self.rotations]

    def _of_whole(self, values: Array) -> Array:
        """Products (c, c) of cases of the whole from those of one sector."""
        return np.asarray(np.sum([R @ values @ R.T for R in self.rotations], axis=0))

    def of(
        self,
        motion: Array,
        nodal: Array,
        forces: Array,
    ) -> _Balanced:
        """Return the sums of a solution: unknowns (size, c), and nodal fields (c, n, ...)."""
        count = len(nodal)
        flat = forces.reshape(count, -1)
        at_nodes = forces.reshape(count, forces.shape[1], -1)
        reactions = list[Array]()
        for pad, unit in self.pads:
            on_pad = np.tensordot(at_nodes[:, pad], unit, axes=((1, 2), (1, 2)))
            reactions += self._of_sectors(on_pad)
        energy = self._of_whole(nodal.reshape(count, -1) @ flat.T)
        work = self._of_whole(motion.T @ self.loads + self.offset.reshape(count, -1) @ flat.T)
        return _Balanced(np.stack(reactions, axis=1), energy, work)

    def imbalance(
        self,
        found: _Balanced,
        largest: Array,
    ) -> dict[str, float]:
        """Return by how much reactions and loads, and energy and work differ.

        largest : (c,), N, of nodal forces, by which forces are divided if they are larger.
        """
        tiny = np.finfo(float).tiny
        size = np.sqrt(np.abs(np.diag(found.energy)))
        pads = found.reactions * self.scale
        loaded = self.resultants * self.scale
        largest_pad = np.max(np.abs(pads), axis=(1, 2))
        largest = np.max([largest_pad, np.max(np.abs(loaded), axis=1), largest], axis=0)
        forces = np.max(np.abs(pads.sum(axis=1) + loaded), axis=1) / np.maximum(largest, tiny)
        energies = np.abs(found.energy - found.work) / np.maximum(np.outer(size, size), tiny)
        return {
            "reactions and load": float(np.max(forces)),
            "strain energy and work": float(np.max(energies)),
        }


def clamped_nodes(mesh: PlaneMesh) -> list[Index]:
    """Return the nodes on the clamped edge of each body at the ground, in the order of bodies."""
    body_of = np.full(len(mesh.nodes), -1)
    ground = nodes_on(mesh, "ground")
    on_ground = np.isin(mesh.triangles, ground).any(axis=1)
    for body in np.unique(mesh.bodies[on_ground]):
        body_of[mesh.triangles[mesh.bodies == body]] = body
    return [ground[body_of[ground] == body] for body in np.unique(body_of[ground])]


@dataclass(frozen=True)
class Response:
    """Response of a structure to c cases.

    Those of a sector are three, which rotate from sector to sector as x, y, theta do.

    motions : (k, c), of the ports in every case, mm and rad.
    nodal : (c, n, ...), displacements, mm, of the nodes of `structure`, which may be a sector in
        the frame of chain 1; less the free expansion.
    pads : (c, pads, 3), force and moment of the ground on each pad of the whole, about the origin,
        N and N mm.
    energy : (c, c), N mm, `u_i' K u_j` of the whole.
    sectors, regions, ratio, bodies : as of `Factorised`.
    """

    structure: Structure
    motions: Array
    nodal: Array
    pads: Array
    energy: Array
    sectors: tuple[Sector, ...] = ()
    regions: tuple[Index, ...] = ()
    ratio: float = 0.0
    bodies: tuple[Index, ...] = ()

    @property
    def compliance(self) -> Array:
        """The motions under unit loads on the ports, symmetric: mm and rad per N and N mm."""
        return (self.motions + self.motions.T) / 2

    @property
    def reactions(self) -> Array:
        """Resultants (c, 3) of the ground about the origin."""
        return np.asarray(self.pads.sum(axis=1))

    @property
    def layers(self) -> Layers:
        """The layers of an extruded structure."""
        assert self.structure.layers is not None
        return self.structure.layers

    @cached_property
    def whole(self) -> Response:
        """The response on the mesh of the whole."""
        if len(self.sectors) != 1:
            return self
        mesh, sector_nodes = joined(self.sectors)
        part = self.structure
        nodal = whole_fields(len(mesh.nodes), sector_nodes, sector_values([self.nodal]))
        whole = structure(mesh, part.plate, part.layers, part.degree)
        return replace(
            self,
            structure=whole,
            nodal=nodal,
            sectors=(),
        )

    @property
    def mesh(self) -> PlaneMesh:
        """The mesh of the whole."""
        return self.whole.structure.mesh

    @property
    def fields(self) -> Array:
        """Displacements (c, n, 2), mm, of all nodes of `mesh`; with layers (c, n, m, 3)."""
        return self.whole.nodal

    @property
    def triangles(self) -> int:
        """Number of triangles of the whole."""
        return len(self.structure.mesh.triangles) * (SECTORS if len(self.sectors) == 1 else 1)

    @property
    def unknowns(self) -> int:
        """Number of equations of the whole; sectors share their cuts and the pose."""
        if len(self.sectors) != 1:
            return self.structure.size
        return 3 * (self.structure.size - len(self.sectors[0].ahead) * self.structure.block) - 6

    def under(self, loads: Array) -> Response:
        """Response of the whole to combinations (n, c) of the cases."""
        whole = self.whole
        motions = whole.motions @ loads.T
        energy = loads @ whole.energy @ loads.T
        nodal, pads = (np.tensordot(loads, part, axes=1) for part in (whole.nodal, whole.pads))
        return replace(
            whole,
            motions=motions,
            nodal=nodal,
            pads=pads,
            energy=energy,
        )

    @cached_property
    def stresses(self) -> list[Array]:
        """Stress (c, p, 2, 2), MPa, at the nodes of every region; with layers (c, p, m, 3, 3)."""
        return self._stresses_at(self.regions, self.hinge_numbers)

    @cached_property
    def body_stresses(self) -> list[Array]:
        """The same at the nodes of every moving body."""
        return self._stresses_at(self.bodies, self.body_numbers)

    @property
    def hinge_numbers(self) -> list[int]:
        """Numbers of the hinges of a plate in its mesh, those of `regions`."""
        return self._numbers[len(self._numbers) - len(self.regions) :]

    @property
    def body_numbers(self) -> list[int]:
        """Numbers of the moving bodies of a plate in its mesh, those of `bodies`."""
        return self._numbers[: len(self.bodies)]

    @property
    def _numbers(self) -> list[int]:
        return list(np.unique(self.structure.mesh.bodies).tolist())

    def ratio_of(self, part: int) -> float:
        """Return the ratio of stresses in the plane of a part, by its Poisson's ratio."""
        plate = self.structure.plate
        if not plate.mixed or not self.ratio:
            return self.ratio
        # nu / (1 - nu) of the material
        nu = float(plate.poissons_ratio[self.structure.mesh.bodies == part][0])
        return nu / (1 + nu)

    def _stresses_at(
        self,
        regions: tuple[Index, ...],
        numbers: Sequence[int],
    ) -> list[Array]:
        of = self.structure
        return part_stresses(of.mesh, of.plate, self.nodal, regions, numbers, of.layers)


def factorised_whole(structure: Structure, ports: Array | None = None, **others: Any) -> Factorised:
    """Factorise a whole structure with loads on its ports, by default those on its hub.

    Raises ComputationFailed as `Structure.lower`, or when a part is not held.
    """
    ports = np.eye(structure.size, 3, 3 - structure.size) if ports is None else ports
    return Factorised(structure, (full_space(structure),), ports, **others)


def factorised_sectors(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None = None,
    degree: int | None = None,
) -> Factorised:
    """Factorise a plate around a rigid hub, given by one sector or three.

    degree : of the quadrature in the plane.

    Raises ComputationFailed as `factorised_whole`.
    """
    if len(sectors) == 3:
        return factorised_whole(
            structure(joined(sectors)[0], plate, layers, degree), sectors=sectors
        )
    (sector,) = sectors
    part = structure(
        sector.mesh, plate, layers, degree, last=np.concatenate([sector.behind, sector.ahead])
    )
    return Factorised(
        part, harmonic_spaces(part, len(sector.ahead)), np.eye(part.size, 3, 3 - part.size), sectors
    )


def unit_response(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None = None,
    degree: int | None = None,
) -> Response:
    """Solve a plate of sectors for unit loads on its rigid hub, with the ground clamped.

    Raises ComputationFailed.
    """
    return factorised_sectors(sectors, plate, layers, degree).response()


def platform_response(
    mesh: PlaneMesh,
    plate: Plate,
    degree: int | None = None,
) -> Response:
    """Solve as `unit_response` on a whole mesh.

    The compliance is the pose block of `(T' K T)^-1`, hence symmetric.
    """
    return factorised_whole(structure(mesh, plate, degree=degree)).response()


def heat_response(
    mesh: PlaneMesh, plate: Plate, expansion: float, frame_expansion: float
) -> Response:
    """Solve a plate with a rigid hub for `HEAT_CASES` with expansions, 1/K, in the plane.

    Raises ComputationFailed.
    """
    warm = factorised_whole(structure(mesh, plate)).thermal_response()
    return warm.under((frame_expansion - expansion) * HEAT_CASES)


def resultants_of(nodes: Array, forces: Array) -> Array:
    """Force and moment (3, k) about the origin of forces (k, n, 2) at nodes (n, 2)."""
    x, y = nodes.T
    fx, fy = np.moveaxis(forces, -1, 0)
    return np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y])


def free_displacement(points: Array, layers: Layers | None = None) -> Array:
    """Displacements (3 cases, n, 2) or (3, n, m, 3), mm, per expansion, of a free body.

    The cases are those of `Factorised.warmed`.
    """
    r = points
    if layers is not None:
        r = np.stack(np.broadcast_arrays(*points.T[:, :, None], layers.heights), axis=-1)
    half = np.sum(r**2, axis=-1, keepdims=True) / 2
    along = [r[..., a, None] * r - unit * half for a, unit in enumerate(np.eye(r.shape[-1]))]
    if layers and layers.fixed:
        return np.stack([0 * r, 0 * r, along[2]])
    return np.stack([along[0], along[1], r])
