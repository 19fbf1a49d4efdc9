"""Natural frequencies and mode shapes in plane finite elements: consistent mass, rigid hub with payload, stacks.

With the unknowns q of `response.Tied` (free nodes, then the pose of the hub), `K phi = omega^2 M phi`. K is factorised
once; ARPACK iterates with its inverse, and the frequencies are Rayleigh quotients of the modes that it finds, with the
strain energy from differences of displacements within a triangle: they are exact to second order in the modes' errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.factor import Solve, factorise
from flexfem.fem.mesh import StageMesh, quadrature, shape_functions
from flexfem.fem.plane_stress import (
    QUADRATURE,
    ElementBatch,
    Plate,
    integration,
    internal_forces,
    matrices_of,
    tied_lower,
)
from flexfem.fem.response import Tied
from flexfem.refused import ComputationFailed

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

DEGREE = 6  # of products of shape functions times the Jacobian determinant of a curved triangle: exact
SETTLED = 1e-5  # difference of ARPACK's eigenvalues and the Rayleigh quotients, relative
ALIKE = 1e-6  # relative difference of squared frequencies that symmetry makes equal: far above round-off
STACK = 500  # triangles whose matrices are made at once


class Structure(NamedTuple):
    """What vibrates: stiffness as a factor, mass as a matrix, both over the unknowns (m) of `tied`.

    mass : (m, m).   carried : (3, 3), mass matrix of what moves as the pose.   areal : tonne/mm^2.
    pushes : (m, n), loads of one newton of each stack.   rates : (n,), N/mm, stiffness of stacks; zero disengaged.
    solve : (m, k) -> (m, k), by the stiffness with the stacks.
    """

    mesh: StageMesh
    plate: Plate
    areal: float
    tied: Tied
    batches: list[ElementBatch]
    mass: sp.csc_array
    carried: Array
    pushes: Array
    rates: Array
    solve: Solve


class Modes(NamedTuple):
    """Natural frequencies (k,), rad/s, and modes (m, k) of unit modal mass, mm and rad per root of a tonne mm^2.

    participation : (k, 3), of base motions in x, y and theta: their squares are the effective modal masses.
    """

    frequencies: Array
    shapes: Array
    participation: Array


def mass_matrices(batch: ElementBatch, areal: float, degree: int = DEGREE) -> Array:
    """Consistent mass matrices (e, 6, 2, 6, 2), tonne: `m[ia, jb] = delta_ab rho b int phi_i phi_j dA`."""
    N = shape_functions(quadrature(degree)[0])[0]
    m = areal * np.einsum("iq,jq,eq->eij", N, N, batch.weights, optimize=True)
    found = np.zeros((len(m), 6, 2, 6, 2))
    found[:, :, 0, :, 0] = found[:, :, 1, :, 1] = m
    return found


def mass_lower(mesh: StageMesh, areal: float, tied: Tied, degree: int = DEGREE) -> sp.coo_array:
    """Lower triangle of T' M T over the unknowns of `tied`, without what the pose carries."""
    pieces: Iterator[ElementBatch] = (p for batch in integration(mesh, degree) for p in batch.pieces(STACK))
    return tied_lower(mesh.triangles, (mass_matrices(p, areal, degree) for p in pieces), tied.number, tied.rigid)


def structure(
    mesh: StageMesh,
    plate: Plate,
    density: float,
    tied: Tied,
    carried: Array | None = None,
    pushes: Array | None = None,
    rates: Array | None = None,
    degrees: tuple[int, int] = (QUADRATURE, DEGREE),
) -> Structure:
    """Assemble and factorise.

    Parameters
    ----------
    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload; None where no pose is among the unknowns.
    pushes, rates : of engaged stacks, (m, n) and (n,), N/mm.
    degrees : of the quadratures of stiffness and mass.

    Raises ComputationFailed when the stiffness is singular: a part is not held.
    """
    areal, batches = plate.thickness * density, integration(mesh, degrees[0])
    unknowns = 2 * len(tied.free) + (3 if len(tied.hub) else 0)
    half = mass_lower(mesh, areal, tied, degrees[1]).tocsc()
    M = (half + sp.tril(half, -1).T).tocsc()
    if carried is not None:
        place = np.arange(unknowns - 3, unknowns)
        rows, columns = np.repeat(place, 3), np.tile(place, 3)
        M = (M + sp.coo_array((carried.ravel(), (rows, columns)), shape=M.shape)).tocsc()
    pushes = np.zeros((unknowns, 0)) if pushes is None else pushes
    rates = np.zeros(pushes.shape[1]) if rates is None else rates
    solve = factorise(tied_lower(mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid))
    held = np.zeros((3, 3)) if carried is None else carried
    return Structure(mesh, plate, areal, tied, batches, M, held, pushes, rates, with_stacks(solve, pushes, rates))


def with_stacks(solve: Solve, pushes: Array, rates: Array) -> Solve:
    """The inverse of `K + P k P'` by that of K (Woodbury): `K^-1 - X (1 + k P' X)^-1 k X'` with `X = K^-1 P`."""
    if not np.any(rates):
        return solve
    X = solve(pushes)
    inner = np.linalg.solve(np.eye(len(rates)) + rates[:, None] * (pushes.T @ X), rates[:, None] * X.T)
    return lambda b: np.asarray(solve(b) - X @ (inner @ b))


def modes(of: Structure, count: int) -> Modes:
    """The lowest `count` modes, by rising frequency.

    Raises ComputationFailed when ARPACK does not converge, or its eigenvalues are not those of the modes' energies.
    """
    values, shapes = lowest(of.solve, of.mass, count)
    shapes = shapes / np.sqrt(np.einsum("ik,ik->k", shapes, of.mass @ shapes))
    squares = strain_energies(of, shapes)
    check_settled(values, squares)
    order = np.argsort(squares)
    squares, shapes = squares[order], shapes[:, order]
    shapes = shapes @ aligned(squares, shapes.T @ base_loads(of))
    shapes = shapes * signs(shapes)
    return Modes(np.sqrt(squares), shapes, shapes.T @ base_loads(of))


def check_settled(values: Array, squares: Array) -> None:
    """Raise ComputationFailed when eigenvalues are not the Rayleigh quotients (k,) of their modes."""
    worst = float(np.max(np.abs(squares / values - 1)))
    if not worst <= SETTLED:
        raise ComputationFailed(
            f"modes refused: eigenvalues and strain energies differ by {worst:.2g}, expected at most {SETTLED:g}"
        )


def aligned(squares: Array, participation: Array) -> Array:
    """Rotation (k, k) among modes of one frequency, of which any is as good: the second of a pair has no motion in x.

    squares : (k,), rising.   participation : (k, 3).
    """
    Q, first = np.eye(len(squares)), 0
    for last in range(1, len(squares) + 1):
        if last == len(squares) or squares[last] > squares[last - 1] * (1 + ALIKE):
            if last - first > 1:
                Q[first:last, first:last] = np.linalg.qr(participation[first:last], mode="complete").Q
            first = last
    return Q


def lowest(solve: Solve, mass: sp.csc_array | LinearOperator, count: int, shift: float = 0.0) -> tuple[Array, Array]:
    """Lowest eigenvalues (count,) and vectors (m, count) of `K phi = lambda M phi` by ARPACK in shift-invert mode.

    Parameters
    ----------
    mass : (m, m), symmetric, or complex Hermitian.
    solve : by `K - shift M`, positive definite: the shift is below the lowest eigenvalue.
    """
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    size = mass.shape[0]
    if count >= size:
        raise ComputationFailed(f"{count} modes of {size} unknowns, expected fewer")
    inverse = LinearOperator((size, size), matvec=lambda b: solve(b.reshape(-1, 1))[:, 0], dtype=mass.dtype)
    start = np.random.default_rng(0).standard_normal(size)  # the same every time
    try:
        values, vectors = eigsh(mass, count, M=mass, sigma=shift, OPinv=inverse, v0=start)  # A is not used
    except ArpackError as failure:
        raise ComputationFailed(f"eigenvalues: {failure}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def signs(shapes: Array) -> Array:
    """Signs (k,) that make the largest component of every mode positive."""
    largest = np.argmax(np.abs(shapes), axis=0)
    return np.where(shapes[largest, np.arange(shapes.shape[1])] < 0, -1.0, 1.0)


def strain_energies(of: Structure, shapes: Array) -> Array:
    """Twice the strain energy (k,) of shapes (m, k), with that of the stacks: `phi' K phi`."""
    fields = fields_of(of.tied, shapes)
    forces = internal_forces(of.batches, of.plate, fields)
    stacks = np.sum(of.rates[:, None] * (of.pushes.T @ shapes) ** 2, axis=0)
    return np.asarray(np.einsum("knd,knd->k", fields, forces) + stacks)


def fields_of(tied: Tied, shapes: Array) -> Array:
    """Displacements (k, n, 2) of all nodes from unknowns (m, k), with a pose or without."""
    if len(tied.hub):
        return tied.fields(shapes)
    fields = np.zeros((shapes.shape[1], len(tied.number), 2))
    fields[:, tied.free] = shapes.T.reshape(-1, len(tied.free), 2)
    return fields


def rigid_fields(nodes: Array) -> Array:
    """Rigid motions (3, n, 2) in x, y and theta about the origin."""
    x, y = nodes.T
    one, zero = np.ones(len(nodes)), np.zeros(len(nodes))
    return np.stack([np.stack(pair, axis=-1) for pair in ((one, zero), (zero, one), (-y, x))])


def base_loads(of: Structure) -> Array:
    """Loads (m, 3) of unit accelerations of the base in x, y and theta: M times the rigid motions of all nodes."""
    forces = inertia_forces(of.mesh, of.areal, rigid_fields(of.mesh.nodes))
    if not len(of.tied.hub):
        return np.asarray(forces[:, of.tied.free].reshape(3, -1).T)
    loads = of.tied.loads(forces)
    loads[-3:] += of.carried
    return loads


def total_mass(of: Structure) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm, tonne mm^2, of the whole as one rigid body: mesh, hub and payload."""
    rigid = rigid_fields(of.mesh.nodes)
    return np.asarray(np.einsum("ind,jnd->ij", rigid, inertia_forces(of.mesh, of.areal, rigid)) + of.carried)


def inertia_forces(mesh: StageMesh, areal: float, fields: Array) -> Array:
    """Nodal forces (k, n, 2) of unit accelerations (k, n, 2): the consistent mass of all nodes times them."""
    N, found = shape_functions(quadrature(DEGREE)[0])[0], np.zeros_like(fields)
    for batch in integration(mesh, DEGREE):
        at = np.einsum("keid,iq->keqd", fields[:, batch.triangles], N, optimize=True)
        nodal = areal * np.einsum("keqd,eq,iq->keid", at, batch.weights, N, optimize=True)
        for force, values in zip(found, nodal, strict=True):
            for axis in (0, 1):
                force[:, axis] += np.bincount(batch.triangles.ravel(), values[..., axis].ravel(), minlength=len(force))
    return found


def free_of(mesh: StageMesh, held: Index) -> Tied:
    """Unknowns of a mesh without a hub, the nodes `held` clamped."""
    number = np.zeros(len(mesh.nodes), dtype=np.int64)
    number[held] = -1
    free = np.flatnonzero(number == 0)
    number[free] = np.arange(len(free))
    return Tied(number, free, np.empty(0, dtype=np.int64), np.empty((0, 3)))
