"""Large displacements in the plane: total-Lagrangian finite elements, finite rotations, Newton's
method.

Loads are dead: forces keep their direction and act at points that move with the bodies, moments do
work on rotations. They act on the rigid hub of a stage, or on the ports of a plate, where bodies
move by their `Contacts`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from flexfem.arrays import AnyArray, Array
from flexfem.fem.body_stress import SIDES, moving_bodies
from flexfem.fem.elements import (
    ElementBatch,
    Plate,
    assembled,
    part_stresses,
    stress_tensor,
    von_mises,
)
from flexfem.fem.factor import Factoriser, Solve
from flexfem.fem.mesh import StageMesh
from flexfem.fem.ports import PlateModel, contact_forces, through_thickness
from flexfem.fem.structure import Structure, structure
from flexfem.mechanism.curves import CurvePoint, Line
from flexfem.refused import ComputationFailed

ITERATIONS = 25  # of one load step
# iterations after the smallest one, from which the load step is halved: no equilibrium is near
STALLED = 3
ALL_ITERATIONS = 1000  # of one load; a stage takes 4 to 6
ALL = (0, 1, 2)  # ports of a hub that is held
SMALLEST = 1 / 1024  # load step, as a share of the way from one load to the next
LARGEST_CHANGE = (
    1.0  # of a displacement gradient, about rad, in one iteration; above it the load step is halved
)
LARGEST_STRAIN = 0.3  # St. Venant-Kirchhoff material loses its stiffness under compression at 1/3
CONVERGED = 1e-11  # root of the predicted energy of the next Newton step over the stored energy
EXACTLY = 1e-12  # relative: smaller eigenvalues of a matrix are zero
ROUNDING = 1e-6  # same for the last step, when steps no longer decrease: necks of a um and less


def green_lagrange(slopes: Array) -> Array:
    """Green-Lagrange strain (..., 2, 2, q) of displacement gradients `H_aA = d_A u_a`: `E = (H + H'
    + H'H) / 2`.

    Unlike `(F'F - 1) / 2`, this does not subtract numbers near one for small strains.
    """
    product = np.einsum("...caq,...cbq->...abq", slopes, slopes)
    return np.asarray((slopes + np.swapaxes(slopes, -3, -2) + product) / 2)


def tangent_blocks(batch: ElementBatch, plate: Plate, slopes: Array, stress: Array) -> Array:
    """Tangent (e, 6, 6, 1, 2, 2) per thickness at gradients H and second Piola-Kirchhoff stress S
    (e, 2, 2, q).

    Notes
    -----
    With `p_ia = F_aA d_A phi_i` and `M[ia, jb] = int p_ia p_jb dA`, the change of `int F S : grad v
    dA` is

        K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu int (F F')_ab d_A phi_i d_A phi_j dA
                    + delta_ab int d_A phi_i S_AB d_B phi_j dA

    with the material stiffness in line 1 and the geometric stiffness in line 2. At rest it is
    `ElementBatch.stiffness`."""
    count = len(batch.triangles)
    weight = batch.weights[:, None, None]
    lame, mu = plate.of(batch.numbers).lame(2, 5)
    root = batch.gradients * np.sqrt(weight)  # (e, i, A, q)
    deformation = slopes + np.eye(2)[:, :, None]
    products = (
        deformation[:, None, :, :, None] * root[:, :, None, None]
    )  # F_aA d_C phi_i: (e, i, a, A, C, q)
    p = np.trace(products, axis1=3, axis2=4).reshape(count, 12, -1)
    flat = products.reshape(count, 12, -1)
    m, f = ((part @ part.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2) for part in (p, flat))
    k = (lame * m + mu * (m.transpose(0, 1, 4, 3, 2) + f)).transpose(0, 1, 3, 2, 4)
    stressed = np.einsum(
        "eABq,eiBq->eiAq", stress * weight, batch.gradients, optimize=True
    ).reshape(count, 6, -1)
    k[..., range(2), range(2)] += (
        stressed @ batch.gradients.reshape(count, 6, -1).transpose(0, 2, 1)
    )[..., None]
    return np.asarray(k[:, :, :, None])


class State(NamedTuple):
    """Pose (3,), displacements (n, 2), mm, and per batch the second Piola-Kirchhoff stress (e, 2,
    2, q), MPa, for the tangent: before convergence it differs from the stress of the displacements.
    Load (k,), N and N mm. Turn of every contact (c,), rad, which continues beyond half a turn."""

    pose: Array
    field: Array
    stress: list[Array]
    load: Array
    turn: Array


class InternalForces(NamedTuple):
    """Internal forces (2f + 3,) on the unknowns of a state, stored energy, N mm, largest strain
    component.
    """

    forces: Array
    energy: float
    strain: float


class Contacts(NamedTuple):
    """Contacts of a plate with c parts of bodies, whose motion is the rigid motion nearest to that
    of the part.

    The motion of the part is linear in four numbers: displacements x and y of the point and
    rotation of small motions, and stretch. With the rotation b and the stretch s, the nearest
    rotation is `theta = arg(1 + s + i b)`: the polar decomposition of `int (r + u) r' dA` in the
    plane, r from the centroid of the part.

    gather : (4 c, size), rows of these numbers, from the unknowns.
    arm : (c,), mm, from the centroid of the part to the point, complex.
    wrenches : (k, c, 3), on the contacts by a unit load on every port.
    """

    gather: sp.csr_array
    arm: AnyArray
    wrenches: Array

    def _motion(self, unknowns: Array) -> tuple[Array, AnyArray, AnyArray, Array]:
        """Numbers (c, 4), turned part `1 + s + i b` and turned arm (c,), and the rates (c, 2) of
        theta by b and s.
        """
        numbers = np.reshape(self.gather @ unknowns, (-1, 4))
        turned = 1 + numbers[:, 3] + 1j * numbers[:, 2]
        rates = 1 / turned
        return (
            numbers,
            turned,
            self.arm * turned / np.abs(turned),
            np.stack([rates.real, rates.imag], axis=1),
        )

    def motions(self, unknowns: Array, near: Array) -> Array:
        """Displacements and rotations (k,) of the ports, mm and rad; the rotations as those of
        `turns`.
        """
        numbers, _, arm, _ = self._motion(unknowns)
        moved = numbers[:, 0] + 1j * numbers[:, 1] + arm - self.arm * (1 + 1j * numbers[:, 2])
        motion = np.stack([moved.real, moved.imag, self.turns(unknowns, near)], axis=1)
        return np.asarray(np.einsum("kca,ca->k", self.wrenches, motion))

    def turns(self, unknowns: Array, near: Array) -> Array:
        """Rotations (c,) of the parts, rad, that are nearest to given ones."""
        angle = np.angle(self._motion(unknowns)[1])
        return np.asarray(angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi)))

    def loads(self, unknowns: Array) -> Array:
        """Loads (size, k) of unit loads on the ports: derivatives of the motions."""
        _, _, arm, rates = self._motion(unknowns)
        slopes = np.zeros((len(arm), 3, 4))  # of the motion by the numbers
        slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0
        swing = np.stack([-arm.imag, arm.real, np.ones_like(arm.real)], axis=1)
        slopes[:, :, 2:] = swing[:, :, None] * rates[:, None]
        slopes[:, 0, 2] += self.arm.imag
        slopes[:, 1, 2] -= self.arm.real
        onto = np.einsum("kca,can->cnk", self.wrenches, slopes)
        return np.asarray(self.gather.T @ onto.reshape(-1, len(self.wrenches)))

    def change_of_loads(self, unknowns: Array, load: Array) -> tuple[Array, Array]:
        """Derivative `Y H Y'` of the loads of (k,) by the unknowns: Y (size, 2 c), and H (2 c, 2
        c).
        """
        _, _, arm, rates = self._motion(unknowns)
        fx, fy, moment = np.einsum("k,kca->ac", load, self.wrenches)
        first = moment - fx * arm.imag + fy * arm.real
        second = -fx * arm.real - fy * arm.imag
        squared = (
            rates[:, 0] + 1j * rates[:, 1]
        ) ** 2  # theta'' = Im(-dz dz / z^2), z' = i db + ds
        bb = squared.imag
        bs = -squared.real
        H = first[:, None, None] * np.stack([np.stack([bb, bs], 1), np.stack([bs, -bb], 1)], 1)
        H += second[:, None, None] * rates[:, :, None] * rates[:, None]
        at = (4 * np.arange(len(arm))[:, None] + [2, 3]).ravel()
        return self.gather[at].T.toarray(), block_diag(*H)

    def softened(self, solve: Solve, unknowns: Array, load: Array) -> tuple[Solve, int]:
        """Solver of a tangent less the derivative of the loads (k,) by the unknowns, a matrix of
        rank 2 c.

        And the number of negative pivots that this adds: by Haynsworth's sum of the inertias of the
        tangent bordered by Y, with the inverse of -H."""
        Y, whole = self.change_of_loads(unknowns, load)
        soft = solve(Y)
        inner = np.eye(len(whole)) - whole @ (Y.T @ soft)

        def solved(b: Array) -> Array:
            x = solve(b)
            return x + soft @ np.linalg.solve(inner, whole @ (Y.T @ x))

        values, vectors = np.linalg.eigh(whole)
        used = np.abs(values) > EXACTLY * np.abs(values).max(initial=0.0)
        within = vectors[:, used]
        rest = np.diag(1 / values[used]) - within.T @ (Y.T @ soft) @ within
        more = np.sum(np.linalg.eigvalsh(rest) < 0) - np.sum(values[used] < 0)
        return solved, int(more)


def contacts(model: PlateModel) -> Contacts:
    """Return the contacts of the ports of a plate, less those with ground that does not move."""
    layout = model.layout
    structure = model.structure
    parts = [patch for port in layout.ports for patch, _ in port.parts]
    moving = [
        at for at in dict.fromkeys(parts) if at.body >= 0 and not layout.bodies[at.body].fixed
    ]
    rows = list[Array]()
    arms = list[complex]()
    wrenches = np.zeros((len(layout.ports), len(moving), 3))
    for patch in moving:
        along_x, along_y, moment = contact_forces(model.layout, model.mesh, patch)
        x, y = moment.T
        arms.append(arm_of(along_x, along_y, moment))
        numbers = np.stack([along_x, along_y, moment, np.column_stack([y, -x])])
        rows.append(structure.loads(through_thickness(structure, numbers)).T)
    for k, port in enumerate(layout.ports):
        for patch, wrench in port.parts:
            if patch in moving:
                wrenches[k, moving.index(patch)] += wrench
    return Contacts(sp.csr_array(np.concatenate(rows)), np.array(arms), wrenches)


def arm_of(along_x: Array, along_y: Array, moment: Array) -> complex:
    """Return the arm, mm, from the centroid of a contact to its point, from nodal forces (n, 2) of
    `contact_forces`.

    A force at the point is one at the centroid with a moment.
    """
    x, y = moment.T
    return complex(along_y[:, 0] @ x / (x @ x), -along_x[:, 1] @ y / (y @ y))


class LargeStructure:
    """A plane structure, and the contacts where it is loaded or a hub that rotates: `u = U +
    (R(theta) - 1) r`.
    """

    def __init__(
        self, structure: Structure, contacts: Contacts | None = None, residual: float = 0.0
    ) -> None:
        """`residual`: stress, MPa, in all directions of the plane, of the plate before it can
        deform.
        """
        self.structure = structure
        self.pairs = structure.pairs
        self.factorise = Factoriser(structure.order(), structure.poses)
        self.contacts, self.free = contacts, 2 * len(structure.free)
        plate = structure.plate
        self.initial = np.zeros((2, 2, 1))
        if residual:  # of a plate of one material
            self.initial = (
                residual * (1 - plate.poissons_ratio) / plate.youngs_modulus * np.eye(2)[:, :, None]
            )
        self.negative = 0  # number of negative pivots of the last derivative that was inverted

    def motions(self, state: State) -> Array:
        """Displacements and rotations (k,) where loads act, mm and rad: the pose of the hub or
        those of the ports.
        """
        return (
            self.contacts.motions(self._unknowns(state), state.turn)
            if self.contacts
            else state.pose
        )

    def loads(self, state: State) -> Array:
        """Loads (size, k) on the unknowns by unit loads."""
        size = self.structure.size
        return (
            self.contacts.loads(self._unknowns(state))
            if self.contacts
            else np.eye(size, 3, 3 - size)
        )

    def solver(self, state: State, load: Array) -> Solve:
        """Inverse of the derivative of internal forces less loads (k,)."""
        solve = self.factorise(self.tangent(state))
        self.negative = self.factorise.negative
        if self.contacts is None:
            return solve
        solve, more = self.contacts.softened(solve, self._unknowns(state), load)
        self.negative += more
        return solve

    def _unknowns(self, state: State) -> Array:
        return state.field[self.structure.free].ravel()

    def hub_motion(self, pose: Array) -> tuple[Array, Array]:
        """Displacements (h, 2), mm, and rotated moment arms (h, 2), mm, of the hub nodes at a pose
        (3,), mm and rad.
        """
        s = np.sin(pose[2])
        c = -2.0 * np.sin(pose[2] / 2) ** 2  # c = cosine - 1
        arms = self.structure.mesh.nodes[self.structure.hub]
        change = arms @ np.array([[c, -s], [s, c]]).T
        return pose[:2] + change, arms + change

    def hub_jacobian(self, pose: Array) -> Array:
        """Derivative (2h, 3) of the displacements of the hub nodes with respect to the pose."""
        return np.reshape(self.structure.line.rigid(self.hub_motion(pose)[1]), (-1, 3))

    def at(self, pose: Array, field: Array) -> State:
        """Return the state of displacements (n, 2), mm, with those of the hub replaced by the
        motion of the pose.
        """
        field = field.copy()
        field[self.structure.hub] = self.hub_motion(pose)[0]
        parts = zip(self.structure.batches, self._slopes(field), strict=True)
        stress = [self.stress_of(batch, green_lagrange(slopes)) for batch, slopes in parts]
        ports = len(self.contacts.wrenches) if self.contacts else 3
        return State(
            pose,
            field,
            stress,
            np.zeros(ports),
            np.zeros(len(self.contacts.arm) if self.contacts else 0),
        )

    def _slopes(self, field: Array) -> list[Array]:
        return [
            batch.slopes(self.structure.line, field[None])[0] for batch in self.structure.batches
        ]

    def stress_of(self, batch: ElementBatch, strain: Array) -> Array:
        """Second Piola-Kirchhoff stress (e, 2, 2, q), MPa, of strains of a batch, with the residual
        stress.
        """
        return stress_tensor(self.structure.plate.of(batch.numbers), strain + self.initial)

    def nodal(self, state: State, slopes: list[Array]) -> Array:
        """Nodal forces (n, 2), N, that balance the stress of a state with displacement gradients by
        batch.
        """
        forces = np.zeros((1, *state.field.shape))
        for batch, H, stress in zip(self.structure.batches, slopes, state.stress, strict=True):
            P = stress + np.einsum("eacq,ecbq->eabq", H, stress)  # first Piola-Kirchhoff stress F S
            batch.add_forces(forces, self.structure.line, P[None])
        return np.asarray(forces[0])

    def internal(self, state: State) -> InternalForces:
        """Return forces, energy and strain of the displacements of a state; its stress is not used."""
        structure = self.structure
        slopes = self._slopes(state.field)
        strains = [green_lagrange(H) for H in slopes]
        stress = [
            self.stress_of(batch, strain)
            for batch, strain in zip(structure.batches, strains, strict=True)
        ]
        consistent = state._replace(stress=stress)
        forces = self.nodal(consistent, slopes)
        on_hub = forces[structure.hub].ravel() @ self.hub_jacobian(state.pose)
        parts = zip(strains, consistent.stress, structure.batches, strict=True)
        products = [
            float(np.sum((e + self.initial) * s * b.weights[:, None, None])) for e, s, b in parts
        ]
        energy = sum(products) * structure.plate.thickness
        largest = max(float(np.max(np.abs(strain))) for strain in strains)
        on_free = forces[structure.free].ravel()
        return InternalForces(np.append(on_free, on_hub[: structure.poses]), energy / 2, largest)

    def tangent(self, state: State) -> sp.csr_array:
        """Lower triangle (2f + 3, 2f + 3) of the derivative of the internal forces, with the stress
        of the state.
        """
        structure = self.structure
        slopes = self._slopes(state.field)
        parts = zip(structure.batches, slopes, state.stress, strict=True)
        blocks = (tangent_blocks(batch, structure.plate, H, stress) for batch, H, stress in parts)
        K = structure.tie_hub(
            assembled(self.pairs, blocks, structure.line), self.hub_jacobian(state.pose)
        )
        if structure.poses:
            hub_forces = self.nodal(state, slopes)[structure.hub]
            arms = self.hub_motion(state.pose)[1]
            K.data[-1] -= np.sum(hub_forces * arms)
        return K


class Equilibria(NamedTuple):
    """Equilibria at s loads or poses, computed one after the other from rest, with k = 3 for a hub,
    or k ports.

    load : (s, k), on the hub or the ports, N and N mm.   pose : (s, k), displacement of these, mm
    and rad.
    fields : (s, n, 2), mm, displacement of every node.
    energy : (s,), N mm, stored in the material.
    compliance : (s, k, k), tangent: derivative of the pose by the load, mm and rad per N and N mm.
    strain : (s,), largest magnitude of a Green-Lagrange strain component; the material law assumes
    it small."""

    load: Array
    pose: Array
    fields: Array
    energy: Array
    compliance: Array
    strain: Array


def equilibrium(mesh: StageMesh, plate: Plate, loads: Array) -> Equilibria:
    """Compute equilibria under dead loads (k, 3) or (3,) on the hub, each from the one before, the
    first from rest.

    A load is a force, N, of fixed direction at the moving platform centre and a moment, N mm,
    conjugate to theta.

    Raises ComputationFailed when Newton's method fails even with the smallest load steps.

    Notes
    -----
    St. Venant-Kirchhoff material, `S = lambda* tr(E) + 2 mu E` with the Lame constants of plane
    stress, on the undeformed plate of constant thickness: valid for small strains and rotations of
    any size, as in flexures. Newton's method carries displacements and stress: each tangent uses
    the stress that the previous step predicts to first order, instead of the stress of its
    displacements, whose quadratic part is a spurious tension in rotating slender bodies. Both agree
    in equilibrium; this saves about half of the iterations."""
    return _equilibria(LargeStructure(structure(mesh, plate)), loads)


def equilibria(model: PlateModel, loads: Array) -> Equilibria:
    """Compute equilibria of a plane plate under dead loads (s, k) on its ports, N and N mm, as
    `equilibrium`.
    """
    return _equilibria(LargeStructure(model.structure, contacts(model)), loads)


def imposed(mesh: StageMesh, plate: Plate, poses: Array) -> Equilibria:
    """Compute equilibria with the hub held at poses (k, 3) or (3,), mm and rad, by `load`, as
    `equilibrium`.
    """
    return _equilibria(LargeStructure(structure(mesh, plate)), poses, ALL)


def driven(model: PlateModel, ports: Sequence[int], motions: Array) -> Equilibria:
    """Compute equilibria of a plane plate whose ports (p,) are held at motions (s, p), mm and rad,
    as `equilibrium`.

    The other ports are free of load; the loads are those that hold the ports.
    """
    return _equilibria(LargeStructure(model.structure, contacts(model)), motions, ports)


class PlateTangent(NamedTuple):
    """Tangent of a plane plate at an equilibrium.

    compliance : (k, k), of the ports.   solve : inverse of the tangent stiffness.   field : (n, 2),
    mm.
    strain : largest magnitude of a component of the strain by displacements.
    """

    compliance: Array
    solve: Solve
    field: Array
    strain: float


def tangent_at(model: PlateModel, load: Array) -> PlateTangent:
    """Return the tangent at the equilibrium under a dead load (k,) on the ports and the residual
    stress of a plate.

    Raises ComputationFailed when Newton's method fails even with the smallest load steps.
    """
    large = LargeStructure(model.structure, contacts(model), model.layout.residual_stress)
    state = large.at(np.zeros(3), np.zeros_like(model.structure.mesh.nodes))
    step, _ = _advance(large, state, np.zeros_like(load), load, (), 0.0)
    return PlateTangent(
        step.compliance, step.solve, step.state.field, large.internal(step.state).strain
    )


class PulledElements:
    """Finite elements of a plane plate under a load on one port, at points of a curve."""

    def __init__(self, model: PlateModel, port: int) -> None:
        self.port = port
        self.large = LargeStructure(model.structure, contacts(model))

    def rest(self) -> CurvePoint:
        """Return the equilibrium at rest."""
        large = self.large
        state = large.at(np.zeros(3), np.zeros_like(large.structure.mesh.nodes))
        loads = large.loads(state)
        compliance = loads.T @ large.solver(state, state.load)(loads)
        return CurvePoint(large.motions(state), state.load, compliance, 0, 0.0, state)

    def on_line(self, near: CurvePoint, line: Line) -> CurvePoint | None:
        """Return the equilibrium at which the motion u of the port and the load f on it are on a
        line.

        near : an equilibrium to start from.   line : a, b and c of `a u + b f = c`.
        None without one near, and where the strain is too large for the material law.
        """
        a, b, c = line
        large = self.large
        try:
            step, _ = _newton(large, near.state, np.array([c]), [self.port], 0.0, (a, b))
        except (ComputationFailed, np.linalg.LinAlgError):
            return None
        if step is None:
            return None
        state = step.state
        internal = large.internal(state)
        if internal.strain > LARGEST_STRAIN:
            return None
        loads = large.loads(state)
        moved = (
            loads.T[self.port] @ step.solve((loads @ state.load - internal.forces)[:, None])[:, 0]
        )
        load = state.load.copy()
        load[self.port] -= a * moved / (a * step.compliance[self.port, self.port] + b)
        state = state._replace(load=load)
        return CurvePoint(
            large.motions(state), load, step.compliance, large.negative, internal.strain, state
        )


def stress_in_parts(model: PlateModel, field: Array) -> tuple[Array, Array]:
    """Return the highest von Mises stress of hinges (h,) and moving bodies (b,), MPa, for
    displacements (n, 2), mm.

    It is that of the second Piola-Kirchhoff stress, whose axes turn with the material; strains are
    small. The nodes are those of `ports.hinge_stress` and of `body_stress.body_nodes`."""
    mesh = model.structure.mesh
    plate = model.structure.plate
    layout = model.layout
    bodies = moving_bodies(layout)
    hinges = len(model.regions)
    numbers = [*(len(layout.bodies) + np.arange(hinges)).tolist(), *bodies]
    stresses = part_stresses(
        mesh, plate, field, [*model.regions, *model.bodies], numbers, strain=green_lagrange
    )
    materials = layout.materials
    highest = np.zeros(len(numbers))
    for k, (stress, part) in enumerate(zip(stresses, numbers, strict=True)):
        highest[k] = von_mises(stress, materials[part].out_of_plane).max()
    return highest[:hinges], highest[hinges:]


def gap_of_parts(model: PlateModel, field: Array, parts: tuple[int, int]) -> float:
    """Return the distance, mm, of the edges of two parts for displacements (n, 2), mm; zero where
    they overlap.

    parts : numbers of bodies, or of hinges after them, as in the mesh.
    """
    import shapely

    mesh = model.mesh
    places = mesh.nodes + field
    edges = list[Any]()
    for part in parts:
        sides = mesh.triangles[mesh.bodies == part][:, SIDES].reshape(-1, 3)
        _, first, count = np.unique(
            np.sort(sides[:, :2], axis=1), axis=0, return_index=True, return_counts=True
        )
        outer = sides[first[count == 1]][:, [0, 2, 1]]
        edges.append(shapely.multilinestrings(shapely.linestrings(places[outer])))
    return float(shapely.distance(*edges))


class _Step(NamedTuple):
    """A Newton step: the state after it, its size as root of energy, the energy before it, the
    largest change of a displacement gradient, the compliance (k, k), and the solver."""

    state: State
    size: float
    energy: float
    change: float
    compliance: Array
    solve: Solve


def _equilibria(model: LargeStructure, targets: Array, held: Sequence[int] = ()) -> Equilibria:
    """Return the equilibria at loads (s, k) or (k,), or at motions (s, p) or (p,) of the p held
    ports.
    """
    targets = np.atleast_2d(np.asarray(targets, dtype=float))
    state = model.at(np.zeros(3), np.zeros_like(model.structure.mesh.nodes))
    start = np.zeros_like(targets[0])
    scale = 0.0
    rows = []
    for target in targets:
        step, scale = _advance(model, state, start, target, held, scale)
        state = step.state
        start = target
        rows.append(_entries(model, step, held))
    return Equilibria(*(np.array(column) for column in zip(*rows, strict=True)))


def _advance(
    model: LargeStructure,
    state: State,
    start: Array,
    target: Array,
    held: Sequence[int],
    scale: float,
) -> tuple[_Step, float]:
    """Advance from `start`, a load or motions of held ports, to `target`, in smaller steps where
    one fails.
    """
    done = 0.0
    part = 1.0
    iterations = 0
    while part >= SMALLEST and iterations <= ALL_ITERATIONS:
        goal = target if done + part >= 1.0 else start + (done + part) * (target - start)
        step, used = _newton(model, state, goal, held, scale)
        iterations += used
        if step is None:
            part /= 2
            continue
        state = step.state
        done = done + part
        scale = max(scale, step.energy)
        if done >= 1.0:
            return step, scale
        part = min(2 * part, 1.0 - done)
    condition = "with the output held at" if held else "under the load"
    raise ComputationFailed(
        f"no equilibrium {condition} {target.tolist()}: Newton's method fails after {iterations} "
        f"iterations, at more than {100 * done:.3g} % of the target: the structure buckles, or "
        "the load is far too large"
    )


def _newton(
    model: LargeStructure,
    state: State,
    goal: Array,
    held: Sequence[int],
    scale: float,
    weights: tuple[float, float] = (1.0, 0.0),
) -> tuple[_Step | None, int]:
    """Return the step to equilibrium at `goal`, or None; its size is relative to an energy of at
    least `scale`.

    weights : of the motions and of the loads of the held ports, whose weighted sums are the goal.
    """
    last = 1.0
    smallest = np.inf
    smallest_at = 0
    for iteration in range(1, ITERATIONS + 1):
        step = _step(model, state, goal, held, weights)
        if step.size < smallest:
            smallest = step.size
            smallest_at = iteration
        if not step.change <= LARGEST_CHANGE or iteration - smallest_at >= STALLED:
            return None, iteration
        energy = max(scale, step.energy, step.size**2)
        size = step.size / float(np.sqrt(energy)) if step.size > 0.0 else 0.0
        if size * min(size / last, 1.0) <= CONVERGED or last / 2 < size <= ROUNDING:
            return step, iteration
        state = step.state
        last = size
    return None, ITERATIONS


def _step(
    model: LargeStructure,
    state: State,
    goal: Array,
    held: Sequence[int],
    weights: tuple[float, float] = (1.0, 0.0),
) -> _Step:
    """Take a Newton step towards a load, or weighted sums of motions and loads of held ports, whose
    load is found.
    """
    structure = model.structure
    internal = model.internal(state)
    load = state.load if held else goal
    loads = model.loads(state)
    solve = model.solver(state, load)
    residual = -internal.forces
    solution = solve(np.column_stack([residual, loads]))
    change = solution[:, 0]
    unit = solution[:, 1:]
    if held:
        ports = list(held)
        remaining = goal - weights[0] * (model.motions(state)[ports] + loads.T[ports] @ change)
        load = np.zeros_like(load)
        onto = weights[0] * loads.T[ports] @ unit[:, ports] + weights[1] * np.eye(len(ports))
        load[ports] = np.linalg.solve(onto, remaining)
    change = change + unit @ load
    residual = residual + loads @ load
    linear = np.zeros_like(state.field)
    linear[structure.free] = change[: model.free].reshape(-1, 2)
    moved = state.field + linear
    turned = change[model.free :] if structure.poses else np.zeros(3)
    linear[structure.hub] = (model.hub_jacobian(state.pose) @ turned).reshape(-1, 2)
    pose = goal if held and structure.poses else state.pose + turned
    moved[structure.hub] = model.hub_motion(pose)[0]
    stress = []
    largest = 0.0  # stress to first order in the change
    for batch in structure.batches:
        slopes, changes = batch.slopes(structure.line, np.stack([state.field, linear]))
        largest = np.maximum(largest, np.max(np.abs(changes)))  # propagates nan
        half = changes + np.einsum("...caq,...cbq->...abq", slopes, changes)  # F' dH
        rate = (half + np.swapaxes(half, -3, -2)) / 2
        stress.append(model.stress_of(batch, green_lagrange(slopes) + rate))
    size = float(np.sqrt(abs(change @ residual)))
    turn = (
        model.contacts.turns(moved[structure.free].ravel(), state.turn)
        if model.contacts
        else state.turn
    )
    state = State(pose, moved, stress, load, turn)
    return _Step(state, size, internal.energy, float(largest), loads.T @ unit, solve)


def _entries(model: LargeStructure, step: _Step, held: Sequence[int]) -> tuple[Any, ...]:
    """Return a row of `Equilibria` in the order of its fields."""
    internal = model.internal(step.state)
    state = step.state
    compliance = step.compliance
    if internal.strain > LARGEST_STRAIN:
        raise ComputationFailed(
            f"equilibrium refused: strain of {internal.strain:.2g}, expected at most "
            f"{LARGEST_STRAIN:g}, above which the material law is not valid"
        )
    load = state.load
    if (
        held
    ):  # the residual corrects the load that holds the ports for the round-off of stiff bodies
        ports = list(held)
        loads = model.loads(state)
        residual = loads @ load - internal.forces
        moved = loads.T[ports] @ step.solve(residual[:, None])[:, 0]
        load = load.copy()
        load[ports] -= np.linalg.solve(compliance[np.ix_(ports, ports)], moved)
    return load, model.motions(state), state.field, internal.energy, compliance, internal.strain
