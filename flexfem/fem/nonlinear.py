"""Large displacements in the plane: total-Lagrangian finite elements and Newton's method.

Loads are dead: forces keep their direction and act at points that move with the bodies, moments do
work on rotations. They act on a rigid hub, or on the ports of a plate, where bodies move by their
`Contacts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.body_stress import moving_bodies
from flexfem.fem.contacts import Contacts, contacts
from flexfem.fem.elements import (
    ElementBatch,
    Plate,
    assembled,
    part_stresses,
    stress_tensor,
    von_mises,
)
from flexfem.fem.factor import Factoriser, Solve
from flexfem.fem.mesh import PlaneMesh, outer_sides
from flexfem.fem.ports import PlateModel
from flexfem.fem.structure import Structure, structure
from flexfem.mechanism.curves import CurvePoint, Line
from flexfem.refused import ComputationFailed

ITERATIONS = 25  # of one load step
# iterations after the smallest one, from which the load step is halved: no equilibrium is near
STALLED = 3
ALL_ITERATIONS = 1000  # of one load; a stage takes 4 to 6
ALL = (0, 1, 2)  # ports of a hub that is held
SMALLEST = 1 / 1024  # load step, as a share of the way from one load to the next
# of a displacement gradient, about rad, in one iteration; above it the load step is halved
LARGEST_CHANGE = 1.0
LARGEST_STRAIN = 0.3  # St. Venant-Kirchhoff material loses its stiffness under compression at 1/3
CONVERGED = 1e-11  # root of the predicted energy of the next Newton step over the stored energy
ROUNDING = 1e-6  # same for the last step, when steps no longer decrease: necks of a um and less


def green_lagrange(slopes: Array) -> Array:
    """Green-Lagrange strain (..., 2, 2, q) of displacement gradients `H_aA = d_A u_a`.

    It is `E = (H + H' + H'H) / 2`. Unlike `(F'F - 1) / 2`, this does not subtract numbers near one
    for small strains.
    """
    product = np.einsum("...caq,...cbq->...abq", slopes, slopes)
    return np.asarray((slopes + np.swapaxes(slopes, -3, -2) + product) / 2)


def tangent_blocks(
    batch: ElementBatch,
    plate: Plate,
    slopes: Array,
    stress: Array,
) -> Array:
    """Tangent (e, 6, 6, 1, 2, 2) per thickness.

    slopes, stress : (e, 2, 2, q), gradients H and second Piola-Kirchhoff stress S.

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
    # F_aA d_C phi_i: (e, i, a, A, C, q)
    products = deformation[:, None, :, :, None] * root[:, :, None, None]
    p = np.trace(products, axis1=3, axis2=4).reshape(count, 12, -1)
    flat = products.reshape(count, 12, -1)
    m, f = ((part @ part.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2) for part in (p, flat))
    k = (lame * m + mu * (m.transpose(0, 1, 4, 3, 2) + f)).transpose(0, 1, 3, 2, 4)
    k[..., range(2), range(2)] += _geometric_stiffness(batch, stress)[..., None]
    return np.asarray(k[:, :, :, None])


def _geometric_stiffness(batch: ElementBatch, stress: Array) -> Array:
    """Return `int d_A phi_i S_AB d_B phi_j dA` (e, 6, 6) of a stress S (e, 2, 2, q)."""
    weighted = stress * batch.weights[:, None, None]
    stressed = np.einsum("eABq,eiBq->eiAq", weighted, batch.gradients, optimize=True)
    gradients = batch.gradients.reshape(len(batch.triangles), 6, -1)
    return np.asarray(stressed.reshape(gradients.shape) @ gradients.transpose(0, 2, 1))


class State(NamedTuple):
    """Displacements of a structure, and the stress for its tangent.

    pose : (3,), of the hub.   field : (n, 2), mm.
    stress : second Piola-Kirchhoff stress (e, 2, 2, q), MPa, of each batch; before convergence it
        differs from that of the displacements.
    load : (k,), N and N mm.
    turn : (c,), rad, of every contact; it continues beyond half a turn.
    """

    pose: Array
    field: Array
    stress: list[Array]
    load: Array
    turn: Array


class InternalForces(NamedTuple):
    """Internal forces (2f + 3,) on the unknowns, stored energy, N mm, largest strain component."""

    forces: Array
    energy: float
    strain: float


class LargeStructure:
    """A plane structure that is loaded at contacts, or on a hub: `u = U + (R(theta) - 1) r`.

    Attributes
    ----------
    free : number of unknowns of free nodes.
    negative : number of negative pivots of the last derivative that was inverted.
    """

    def __init__(
        self, structure: Structure, contacts: Contacts | None = None, residual: float = 0.0
    ) -> None:
        """Prepare a structure.

        residual : stress, MPa, in all directions of the plane, before the plate can deform.
        """
        self.structure = structure
        self.pairs = structure.pairs
        self.factorise = Factoriser(structure.order(), structure.poses)
        self.contacts = contacts
        self.free = 2 * len(structure.free)
        self.negative = 0
        self.initial = np.zeros((2, 2, 1))
        if residual:  # of a plate of one material
            plate = structure.plate
            strain = residual * (1 - plate.poissons_ratio) / plate.youngs_modulus
            self.initial = strain * np.eye(2)[:, :, None]

    def at_rest(self) -> State:
        """Return the state without displacements."""
        return self.at(np.zeros(3), np.zeros_like(self.structure.mesh.nodes))

    def motions(self, state: State) -> Array:
        """Displacements and rotations (k,), mm and rad, of the hub or of the ports."""
        if self.contacts is None:
            return state.pose
        return self.contacts.motions(self._unknowns(state), state.turn)

    def loads(self, state: State) -> Array:
        """Loads (size, k) on the unknowns by unit loads."""
        size = self.structure.size
        if self.contacts is None:
            return np.eye(size, 3, 3 - size)
        return self.contacts.loads(self._unknowns(state))

    def turns(
        self,
        field: Array,
        near: Array,
    ) -> Array:
        """Rotations (c,) of the contacts, rad, for displacements (n, 2), nearest to given ones."""
        if self.contacts is None:
            return near
        return self.contacts.turns(field[self.structure.free].ravel(), near)

    def solver(
        self,
        state: State,
        load: Array,
    ) -> Solve:
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
        """Displacements and rotated moment arms (h, 2), mm, of the hub nodes at a pose (3,)."""
        s = np.sin(pose[2])
        c = -2.0 * np.sin(pose[2] / 2) ** 2  # c = cosine - 1
        arms = self.structure.mesh.nodes[self.structure.hub]
        change = arms @ np.array([[c, -s], [s, c]]).T
        return pose[:2] + change, arms + change

    def hub_jacobian(self, pose: Array) -> Array:
        """Derivative (2h, 3) of the displacements of the hub nodes with respect to the pose."""
        return np.reshape(self.structure.line.rigid(self.hub_motion(pose)[1]), (-1, 3))

    def at(
        self,
        pose: Array,
        field: Array,
    ) -> State:
        """Return the state of displacements (n, 2), mm, with the hub at a pose."""
        field = field.copy()
        field[self.structure.hub] = self.hub_motion(pose)[0]
        strains = [green_lagrange(slopes) for slopes in self._slopes(field)]
        ports = 3
        contacts = 0
        if self.contacts is not None:
            ports = len(self.contacts.wrenches)
            contacts = len(self.contacts.arm)
        return State(pose, field, self._stress(strains), np.zeros(ports), np.zeros(contacts))

    def _slopes(self, field: Array) -> list[Array]:
        line = self.structure.line
        return [batch.slopes(line, field[None])[0] for batch in self.structure.batches]

    def _stress(self, strains: list[Array]) -> list[Array]:
        """Stress as `stress_of`, of the strains of each batch."""
        pairs = zip(self.structure.batches, strains, strict=True)
        return [self.stress_of(batch, strain) for batch, strain in pairs]

    def stress_of(
        self,
        batch: ElementBatch,
        strain: Array,
    ) -> Array:
        """Second Piola-Kirchhoff stress (e, 2, 2, q), MPa, of strains, with the residual stress."""
        return stress_tensor(self.structure.plate.of(batch.numbers), strain + self.initial)

    def nodal(
        self,
        state: State,
        slopes: list[Array],
    ) -> Array:
        """Nodal forces (n, 2), N, that balance the stress of a state.

        slopes : displacement gradients of each batch.
        """
        forces = np.zeros((1, *state.field.shape))
        for batch, H, stress in zip(self.structure.batches, slopes, state.stress, strict=True):
            P = stress + np.einsum("eacq,ecbq->eabq", H, stress)  # first Piola-Kirchhoff stress F S
            batch.add_forces(forces, self.structure.line, P[None])
        return np.asarray(forces[0])

    def internal(self, state: State) -> InternalForces:
        """Return forces, energy and strain of the displacements of a state; not of its stress."""
        structure = self.structure
        slopes = self._slopes(state.field)
        strains = [green_lagrange(H) for H in slopes]
        stress = self._stress(strains)
        forces = self.nodal(state._replace(stress=stress), slopes)
        on_hub = forces[structure.hub].ravel() @ self.hub_jacobian(state.pose)
        on_unknowns = np.append(forces[structure.free].ravel(), on_hub[: structure.poses])
        products = [
            float(np.sum((strain + self.initial) * own * batch.weights[:, None, None]))
            for strain, own, batch in zip(strains, stress, structure.batches, strict=True)
        ]
        energy = sum(products) * structure.plate.thickness / 2
        largest = max(float(np.max(np.abs(strain))) for strain in strains)
        return InternalForces(on_unknowns, energy, largest)

    def tangent(self, state: State) -> sp.csr_array:
        """Lower triangle (2f + 3, 2f + 3) of the derivative of the internal forces.

        It uses the stress of the state.
        """
        structure = self.structure
        slopes = self._slopes(state.field)
        parts = zip(structure.batches, slopes, state.stress, strict=True)
        blocks = (tangent_blocks(batch, structure.plate, H, stress) for batch, H, stress in parts)
        free_and_hub = assembled(self.pairs, blocks, structure.line)
        K = structure.tie_hub(free_and_hub, self.hub_jacobian(state.pose))
        if structure.poses:
            hub_forces = self.nodal(state, slopes)[structure.hub]
            arms = self.hub_motion(state.pose)[1]
            K.data[-1] -= np.sum(hub_forces * arms)
        return K


class Equilibria(NamedTuple):
    """Equilibria at s loads or poses, one after the other from rest; k = 3 for a hub, or k ports.

    load : (s, k), on the hub or the ports, N and N mm.
    pose : (s, k), displacement of these, mm and rad.
    fields : (s, n, 2), mm, displacement of every node.
    energy : (s,), N mm, stored in the material.
    compliance : (s, k, k), tangent: derivative of the pose by the load, mm and rad per N and N mm.
    strain : (s,), largest magnitude of a Green-Lagrange strain component; the material law assumes
        it small.
    """

    load: Array
    pose: Array
    fields: Array
    energy: Array
    compliance: Array
    strain: Array


def equilibrium(
    mesh: PlaneMesh,
    plate: Plate,
    loads: Array,
) -> Equilibria:
    """Compute equilibria under dead loads (k, 3) or (3,) on the hub, each from the one before.

    The first is found from rest. A load is a force, N, of fixed direction at the moving platform
    centre and a moment, N mm, conjugate to theta.

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
    """Compute equilibria as `equilibrium` of a plane plate under dead loads (s, k) on its ports."""
    return _equilibria(LargeStructure(model.structure, contacts(model)), loads)


def imposed(
    mesh: PlaneMesh,
    plate: Plate,
    poses: Array,
) -> Equilibria:
    """Compute equilibria as `equilibrium` with the hub held at poses (k, 3) or (3,), mm and rad."""
    return _equilibria(LargeStructure(structure(mesh, plate)), poses, ALL)


def driven(
    model: PlateModel,
    ports: Sequence[int],
    motions: Array,
) -> Equilibria:
    """Compute equilibria as `equilibrium` of a plane plate whose ports (p,) are held at motions.

    motions : (s, p), mm and rad.

    The other ports are free of load; the loads are those that hold the ports.
    """
    return _equilibria(LargeStructure(model.structure, contacts(model)), motions, ports)


class PlateTangent(NamedTuple):
    """Tangent of a plane plate at an equilibrium.

    compliance : (k, k), of the ports.   solve : inverse of the tangent stiffness.
    field : (n, 2), mm.
    strain : largest magnitude of a component of the strain by displacements.
    """

    compliance: Array
    solve: Solve
    field: Array
    strain: float


def tangent_at(model: PlateModel, load: Array) -> PlateTangent:
    """Return the tangent at the equilibrium under a dead load (k,) and the residual stress.

    Raises ComputationFailed when Newton's method fails even with the smallest load steps.
    """
    large = LargeStructure(model.structure, contacts(model), model.layout.residual_stress)
    step, _ = _advance(large, large.at_rest(), np.zeros_like(load), load, (), 0.0)
    strain = large.internal(step.state).strain
    return PlateTangent(step.compliance, step.solve, step.state.field, strain)


class PulledElements:
    """Finite elements of a plane plate under a load on one port, at points of a curve."""

    def __init__(
        self,
        model: PlateModel,
        port: int,
    ) -> None:
        self.port = port
        self.large = LargeStructure(model.structure, contacts(model))

    def rest(self) -> CurvePoint:
        """Return the equilibrium at rest."""
        large = self.large
        state = large.at_rest()
        loads = large.loads(state)
        compliance = loads.T @ large.solver(state, state.load)(loads)
        return CurvePoint(large.motions(state), state.load, compliance, 0, 0.0, state)

    def on_line(
        self,
        near: CurvePoint,
        line: Line,
    ) -> CurvePoint | None:
        """Return the equilibrium at which motion u and load f of the port are on a line.

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
        residual = loads @ state.load - internal.forces
        moved = loads.T[self.port] @ step.solve(residual[:, None])[:, 0]
        load = state.load.copy()
        load[self.port] -= a * moved / (a * step.compliance[self.port, self.port] + b)
        state = state._replace(load=load)
        motions = large.motions(state)
        return CurvePoint(motions, load, step.compliance, large.negative, internal.strain, state)


def stress_in_parts(model: PlateModel, field: Array) -> tuple[Array, Array]:
    """Return the highest von Mises stress of hinges (h,) and moving bodies (b,), MPa.

    field : (n, 2), mm, displacements.

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


def gap_of_parts(
    model: PlateModel,
    field: Array,
    parts: tuple[int, int],
) -> float:
    """Return the distance, mm, of the edges of two parts; zero where they overlap.

    field : (n, 2), mm, displacements.
    parts : numbers of bodies, or of hinges after them, as in the mesh.
    """
    import shapely

    mesh = model.mesh
    places = mesh.nodes + field
    edges = list[Any]()
    for part in parts:
        outer = outer_sides(mesh.triangles[mesh.bodies == part])[:, [0, 2, 1]]
        lines = np.asarray(shapely.linestrings(places[outer]))
        edges.append(shapely.multilinestrings(lines))
    return float(shapely.distance(*edges))


class _Step(NamedTuple):
    """A Newton step.

    state : after it.
    size : root of its energy.
    energy : N mm, before it.
    change : largest of a displacement gradient.
    compliance : (k, k).
    solve : inverse of the tangent.
    """

    state: State
    size: float
    energy: float
    change: float
    compliance: Array
    solve: Solve


def _equilibria(
    model: LargeStructure,
    targets: Array,
    held: Sequence[int] = (),
) -> Equilibria:
    """Return the equilibria at loads (s, k) or (k,), or at motions (s, p) or (p,) of ports."""
    targets = np.atleast_2d(np.asarray(targets, dtype=float))
    state = model.at_rest()
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
    """Advance from `start` to `target`, loads or motions of held ports.

    The steps are smaller where one fails.
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
    """Return the step to equilibrium at `goal`, or None, and the number of iterations.

    scale : energy, N mm, to which the size of the step is relative if it is larger than its own.
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
    """Take a Newton step towards a goal.

    goal : a load (k,), or weighted sums (p,) of motions and loads of held ports, whose load is
        found.
    """
    internal = model.internal(state)
    loads = model.loads(state)
    solve = model.solver(state, state.load if held else goal)
    solution = solve(np.column_stack([-internal.forces, loads]))
    unit = solution[:, 1:]
    load = goal
    if held:
        moved = model.motions(state) + loads.T @ solution[:, 0]
        load = _load_of_held(goal, held, weights, moved, loads.T @ unit)
    change = solution[:, 0] + unit @ load
    size = float(np.sqrt(abs(change @ (loads @ load - internal.forces))))
    held_pose = goal if held and model.structure.poses else None
    following, largest = _following_state(model, state, change, load, held_pose)
    return _Step(following, size, internal.energy, largest, loads.T @ unit, solve)


def _following_state(
    model: LargeStructure, state: State, change: Array, load: Array, held_pose: Array | None
) -> tuple[State, float]:
    """Return the state after a change of the unknowns, with the stress to first order in it.

    load : (k,), of the new state.   held_pose : (3,), of a hub that is held there, else None.
    The second value is the largest change of a displacement gradient.
    """
    structure = model.structure
    turned = change[model.free :] if structure.poses else np.zeros(3)
    pose = state.pose + turned if held_pose is None else held_pose
    linear = np.zeros_like(state.field)
    linear[structure.free] = change[: model.free].reshape(-1, 2)
    field = state.field + linear
    field[structure.hub] = model.hub_motion(pose)[0]
    linear[structure.hub] = (model.hub_jacobian(state.pose) @ turned).reshape(-1, 2)
    stress, largest = _predicted_stress(model, state, linear)
    return State(pose, field, stress, load, model.turns(field, state.turn)), largest


def _load_of_held(
    goal: Array,
    held: Sequence[int],
    weights: tuple[float, float],
    moved: Array,
    compliance: Array,
) -> Array:
    """Return the load (k,) on held ports by which weighted sums (p,) reach a goal.

    moved : (k,), motions of the ports after the step without load.   compliance : (k, k).
    """
    ports = list(held)
    remaining = goal - weights[0] * moved[ports]
    onto = weights[0] * compliance[np.ix_(ports, ports)] + weights[1] * np.eye(len(ports))
    load = np.zeros(len(compliance))
    load[ports] = np.linalg.solve(onto, remaining)
    return load


def _predicted_stress(
    model: LargeStructure, state: State, change: Array
) -> tuple[list[Array], float]:
    """Return the stress of each batch to first order in a change of displacements (n, 2).

    The second value is the largest change of a displacement gradient.
    """
    line = model.structure.line
    stress = list[Array]()
    largest = 0.0
    for batch in model.structure.batches:
        slopes, changes = batch.slopes(line, np.stack([state.field, change]))
        largest = np.maximum(largest, np.max(np.abs(changes)))  # propagates nan
        half = changes + np.einsum("...caq,...cbq->...abq", slopes, changes)  # F' dH
        rate = (half + np.swapaxes(half, -3, -2)) / 2
        stress.append(model.stress_of(batch, green_lagrange(slopes) + rate))
    return stress, float(largest)


def _entries(
    model: LargeStructure,
    step: _Step,
    held: Sequence[int],
) -> tuple[Any, ...]:
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
    if held:
        # the residual corrects the load that holds the ports for the round-off of stiff bodies
        ports = list(held)
        loads = model.loads(state)
        residual = loads @ load - internal.forces
        moved = loads.T[ports] @ step.solve(residual[:, None])[:, 0]
        load = load.copy()
        load[ports] -= np.linalg.solve(compliance[np.ix_(ports, ports)], moved)
    return load, model.motions(state), state.field, internal.energy, compliance, internal.strain
