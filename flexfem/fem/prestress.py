"""Stiffness by the stress in a plate before it moves, and the loads at which it makes it buckle.

The stress S of a load changes the stiffness by `int d_A u_a S_AB d_B v_a dV`, which is linear in
the load and the same in the plane and out of it. Loads are dead, and act at points that turn with
the bodies, which changes the stiffness, too. J. M. T. Thompson and G. W. Hunt, A General Theory of
Elastic Stability, 1973."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from flexfem.arrays import Array
from flexfem.fem.contacts import arm_of, contacts
from flexfem.fem.elements import ElementBatch, Layers, stress_tensor
from flexfem.fem.factor import Solve, factorise
from flexfem.fem.ports import PlateModel, contact_forces, through_thickness
from flexfem.fem.structure import Structure
from flexfem.mechanism.layout import Patch, loaded_contacts
from flexfem.refused import ComputationFailed

BASIS = 30  # vectors of ARPACK
TOLERANCE = 1e-9  # of the factors, relative
SMALL_STRAIN = 0.1  # at buckling, of the most stressed parts
# least ratio of the squares of displacement gradients and of strains, where parts buckle
SLENDER = 30.0


class Prestress(NamedTuple):
    """Change of the stiffness of a structure by stress in it and by the loads that cause it.

    matrix : (n m, n m), N/mm, for every axis of the displacements of the nodes.
    level : MPa, stress of the most stressed parts, by its fourth and second powers; a singular
        corner adds little.
    at, carried : (size, r) and (r, r), loads of motions of contacts, and the change of the
        stiffness of these motions.
    """

    structure: Structure
    matrix: sp.csr_array
    at: Array
    carried: Array
    level: float = 0.0

    def loads(self, motion: Array) -> Array:
        """Product (size, k) of the change of the stiffness and unknowns (size, k)."""
        fields = self.structure.fields(motion)
        forces = np.empty_like(fields)
        for force, field in zip(forces, fields, strict=True):
            force[:] = (self.matrix @ field.reshape(self.matrix.shape[0], -1)).reshape(field.shape)
        return np.asarray(
            self.structure.loads(forces) + self.at @ (self.carried @ (self.at.T @ motion))
        )


class CriticalShapes(NamedTuple):
    """Multiples (s,) of a load at which a plate buckles, ascending, and shapes (size, s)."""

    factors: Array
    shapes: Array


def prestress_by(
    model: PlateModel, load: Array, held: tuple[int, ...] = (), residual: float = 0.0
) -> Prestress:
    """Return the change of the stiffness by the linear stress of a load (k,) in the shape at rest.

    held : ports whose displacements stay zero.
    residual : stress of the plate, MPa, in all directions of the plane before it can deform.
    """
    structure = model.structure
    axes = structure.line.axes
    load = _with_reactions(model, load, held)
    initial = residual * np.diag([1.0, 1.0, 0.0])[:axes, :axes, None]
    loads = model.ports @ load
    if residual:
        loads = loads - _loads_of_stress(structure, initial)
    field = np.zeros((len(structure.mesh.nodes), *structure.shape))
    if np.any(loads):
        field = model.response(loads[:, None]).nodal[0]

    def stress_of(batch: ElementBatch) -> Array:
        plate = structure.plate.of(batch.numbers)
        return stress_tensor(plate, batch.slopes(structure.line, field[None])[0]) + initial

    at, turned = contacts(model).change_of_loads(np.zeros(structure.size), load)
    level = _level(structure, stress_of)
    return Prestress(structure, _of_stress(structure, stress_of), at, -turned, level)


def _with_reactions(
    model: PlateModel,
    load: Array,
    held: tuple[int, ...],
) -> Array:
    """Return a load (k,) with what holds ports at zero displacement."""
    load = load.copy()
    if held:
        ports = list(held)
        unit = model.ports[:, ports]
        moved = model.spaces[0].solve(np.column_stack([model.ports @ load, unit]))
        load[ports] -= np.linalg.solve(unit.T @ moved[:, 1:], unit.T @ moved[:, 0])
    return load


def _level(structure: Structure, stress_of: Callable[[ElementBatch], Array]) -> float:
    """Return the level of a stress as of `Prestress`, MPa."""
    squares = 0.0
    fourths = 0.0
    for batch in structure.batches:
        size = np.sum(stress_of(batch) ** 2, axis=(1, 2))
        weights = (batch.weights[:, :, None] * structure.line.weights).reshape(size.shape)
        squares += float(np.sum(weights * size))
        fourths += float(np.sum(weights * size**2))
    return float(np.sqrt(fourths / squares)) if squares else 0.0


def _loads_of_stress(structure: Structure, stress: Array) -> Array:
    """Return the loads (size,) on the unknowns that balance a uniform stress (d, d, 1), MPa."""
    forces = np.zeros((1, len(structure.mesh.nodes), *structure.shape))
    for batch in structure.batches:
        points = batch.weights.shape[1] * len(structure.line.weights)
        uniform = np.broadcast_to(stress, (1, len(batch.triangles), *stress.shape[:2], points))
        batch.add_forces(forces, structure.line, uniform)
    return structure.loads(forces)[:, 0]


def stiffened(change: Prestress) -> Solve:
    """Return the inverse of the stiffness of a structure with its change by stress and loads.

    Raises ComputationFailed when it is not definite: the plate buckles before.
    """
    structure = change.structure
    on_axes = sp.kron(change.matrix, sp.eye_array(structure.line.axes), format="csr")
    lower = sp.csr_array(
        structure.lower() + sp.tril(structure.T.T @ on_axes @ structure.T, format="csr")
    )
    lower.sort_indices()
    try:
        solve = factorise(lower, structure.order(), structure.poses)
    except ComputationFailed:
        raise ComputationFailed(
            "the plate buckles before its preload is reached, expected a smaller one"
        ) from None
    if not change.at.shape[1]:
        return solve
    soft = solve(change.at)
    inner = np.eye(len(change.carried)) + change.carried @ (change.at.T @ soft)

    def solved(b: Array) -> Array:
        x = solve(b)
        return x - soft @ np.linalg.solve(inner, change.carried @ (change.at.T @ x))

    return solved


def lifted(
    change: Prestress,
    model: PlateModel,
    load: Array,
) -> Prestress:
    """Return the change of the stiffness out of the plane by a load (k,) on the ports.

    It is that of a plate with the same layers.

    Notes
    -----
    A force f at an arm r from the centroid of its contact does the work `f . (w x (w x r)) / 2` at
    rotations w of the contact out of the plane. The nodal forces of the couple by which it differs
    from a force at the centroid do such work by themselves, which the stress contains. Moments are
    couples of forces that keep their direction.
    """
    structure = model.structure
    columns = [np.zeros((structure.size, 0))]
    blocks = list[Array]()
    for patch, wrench in loaded_contacts(model.layout, load).items():
        blocks.append(_work_of_tilts(model, patch, wrench))
        tilts = contact_forces(model.layout, model.mesh, patch, lifting=True)[1:]
        columns.append(structure.loads(through_thickness(structure, tilts)))
    return change._replace(
        structure=structure,
        at=np.hstack(columns),
        carried=block_diag(*blocks),
    )


def _work_of_tilts(
    model: PlateModel,
    patch: Patch,
    wrench: Array,
) -> Array:
    """Second derivatives (2, 2) of the work of a wrench (3,) on a contact, by its tilts."""
    along_x, along_y, couple = contact_forces(model.layout, model.mesh, patch)
    arm = arm_of(along_x, along_y, couple)
    fx, fy = wrench[:2]
    of_couple = _second_order(couple.T @ model.mesh.nodes)
    own = _second_order(np.outer([fx, fy], [arm.real, arm.imag]))
    return np.asarray((arm.real * fy - arm.imag * fx) * of_couple - own)


def _second_order(virial: Array) -> Array:
    """Return the second derivatives (2, 2), by rotations about x and y, of the work of forces.

    virial : (2, 2), `sum f r'` of the forces.
    """
    both = (virial[0, 1] + virial[1, 0]) / 2
    return np.array([[-virial[1, 1], both], [both, -virial[0, 0]]])


def critical_shapes(
    model: PlateModel, change: Prestress, held: tuple[int, ...], count: int
) -> CriticalShapes:
    """Return at most `count` positive factors of a load at which a plate buckles.

    change : of the stiffness by the load.
    held : ports whose displacements stay zero.

    Notes
    -----
    `(K + a K_s) u = 0` is solved for the largest 1 / a by ARPACK, with the inverse of K on motions
    that leave the held ports at rest. Slender parts that buckle turn far more than they are
    strained, by the root of the inverse of the strain before buckling. Shapes that do not, and
    factors at which strains are not small, are left out: compression at a corner of a stretched
    leaf has them.

    Raises ComputationFailed when ARPACK does not converge.
    """
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    structure = model.structure
    solve = _held(model.spaces[0].solve, model.ports[:, list(held)])
    shape = (structure.size, structure.size)

    def stiff(motion: Array) -> Array:
        fields = structure.fields(motion.reshape(-1, 1))
        return structure.loads(structure.forces(fields))[:, 0]

    softening = LinearOperator(
        shape, matvec=lambda u: -change.loads(u.reshape(-1, 1))[:, 0], dtype=float
    )
    inverse = LinearOperator(shape, matvec=lambda b: solve(b.reshape(-1, 1))[:, 0], dtype=float)
    stiffness = LinearOperator(shape, matvec=stiff, dtype=float)
    start = inverse @ np.random.default_rng(0).standard_normal(structure.size)  # reproducible
    basis = max(BASIS, 2 * count + 1)
    try:
        values, shapes = eigsh(
            softening,
            count,
            stiffness,
            which="LA",
            Minv=inverse,
            v0=start,
            ncv=basis,
            tol=TOLERANCE,
        )
    except ArpackError as failure:
        raise ComputationFailed(f"buckling: {failure}") from None
    order = np.argsort(-values)
    slender = _slenderness(structure, shapes) > SLENDER
    small = values * SMALL_STRAIN * structure.plate.youngs_modulus > change.level
    chosen = order[slender[order] & small[order]]
    return CriticalShapes(1 / values[chosen], shapes[:, chosen])


def _slenderness(structure: Structure, shapes: Array) -> Array:
    """Return the ratios (s,) of displacement gradients to strains, in the mean of squares."""
    uniform = _of_stress(structure, partial(_unit_stress, structure))
    turning = Prestress(structure, uniform, np.zeros((structure.size, 0)), np.zeros((0, 0)))
    strained = structure.loads(structure.forces(structure.fields(shapes)))
    gradients = np.sum(shapes * turning.loads(shapes), axis=0)
    return np.asarray(
        structure.plate.youngs_modulus * gradients / np.sum(shapes * strained, axis=0)
    )


def _unit_stress(structure: Structure, batch: ElementBatch) -> Array:
    """Stress of 1 MPa in all directions at the points of a batch."""
    axes = structure.line.axes
    points = batch.weights.shape[1] * len(structure.line.weights)
    return np.broadcast_to(
        np.eye(axes)[None, :, :, None], (len(batch.triangles), axes, axes, points)
    )


def _held(solve: Solve, ports: Array) -> Solve:
    """Return the inverse of a stiffness with ports (size, p) held.

    It is `X - Z (P' Z)^-1 P' X` with `Z = K^-1 P`.
    """
    if not ports.shape[1]:
        return solve
    Z = solve(ports)
    inner = np.linalg.inv(ports.T @ Z)

    def solved(b: Array) -> Array:
        x = solve(b)
        return x - Z @ (inner @ (ports.T @ x))

    return solved


def _of_stress(structure: Structure, stress_of: Callable[[ElementBatch], Array]) -> sp.csr_array:
    """Return the matrix (n m, n m), N/mm, of stresses (e, d, d, q z), MPa, of each batch."""
    line = structure.line
    heights = np.arange(len(line.heights))
    size = len(structure.mesh.nodes) * len(heights)
    total = sp.csr_array((size, size))
    for batch in structure.batches:
        parts = list[sp.csr_array]()
        for piece in batch.pieces():
            nodes = piece.triangles[:, :, None] * len(heights) + heights
            nodes = nodes.reshape(len(nodes), -1)
            rows = np.repeat(nodes, nodes.shape[1], axis=1)
            columns = np.tile(nodes, (1, nodes.shape[1]))
            values = _of_elements(piece, line, stress_of(piece))
            entries = (rows.ravel(), columns.ravel())
            parts.append(sp.coo_array((values.ravel(), entries), shape=(size, size)).tocsr())
        total = sum(parts, total)
    return total


def _of_elements(
    piece: ElementBatch,
    line: Layers,
    stress: Array,
) -> Array:
    """Return `int d_A phi_i psi_k S_AB d_B phi_j psi_l dV` (e, 6 m, 6 m).

    stress : (e, d, d, q z), S.
    """
    count = len(piece.triangles)
    slopes = np.einsum("eiaq,mz->eimaqz", piece.gradients, line.values)
    if line.axes == 3:
        along_z = np.einsum("iq,mz->imqz", piece.phi, line.slopes)
        along_z = np.broadcast_to(
            along_z[None, :, :, None], (*slopes.shape[:3], 1, *slopes.shape[4:])
        )
        slopes = np.concatenate([slopes, along_z], axis=3)
    weights = piece.weights[:, :, None] * line.weights
    weighted = stress.reshape(*stress.shape[:3], *weights.shape[1:]) * weights[:, None, None]
    stressed = np.einsum("eabqz,eimbqz->eimaqz", weighted, slopes, optimize=True)
    left = slopes.reshape(count, slopes.shape[1] * slopes.shape[2], -1)
    return np.asarray(left @ stressed.reshape(*left.shape).transpose(0, 2, 1))
