"""What Newton's method on large displacements needs: strain, tangent matrices, a hub that turns, factorisation."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import (
    QUADRATURE,
    ElementBatch,
    Plate,
    add_nodal_forces,
    integration,
    slopes_of,
    stress_tensor,
    tied_lower,
)
from flexfem.fem.factor import Solve, to_cvxopt
from flexfem.fem.mesh import StageMesh
from flexfem.fem.structure import Tied, rigid_motion, tie_hub
from flexfem.refused import ComputationFailed


def green_lagrange(slopes: Array) -> Array:
    """Green-Lagrange strain (..., 2, 2, q) of displacement gradients `H_aA = d_A u_a` (..., 2, 2, q).

    Notes
    -----
    `E = (H + H' + H'H) / 2` and not `(F'F - 1) / 2`: small strains are not differences of numbers near one.
    """
    product = np.einsum("...caq,...cbq->...abq", slopes, slopes)
    return np.asarray((slopes + np.swapaxes(slopes, -3, -2) + product) / 2)


def strain_rate(slopes: Array, changes: Array) -> Array:
    """First change (..., 2, 2, q) of the Green-Lagrange strain: the symmetric part of `F' dH`."""
    half = changes + np.einsum("...caq,...cbq->...abq", slopes, changes)
    return np.asarray((half + np.swapaxes(half, -3, -2)) / 2)


def first_piola(slopes: Array, stress: Array) -> Array:
    """First Piola-Kirchhoff stress `P = F S` (..., 2, 2, q), MPa, of gradients H and second stress S."""
    return np.asarray(stress + np.einsum("...acq,...cbq->...abq", slopes, stress))


def tangent_matrices(batch: ElementBatch, plate: Plate, slopes: Array, stress: Array) -> Array:
    """Element tangent matrices (e, 6, 2, 6, 2), N/mm, at gradients H and second Piola-Kirchhoff stress S (e, 2, 2, q).

    Notes
    -----
    With `p_ia = F_aA d_A phi_i` and `M[ia, jb] = b int p_ia p_jb dA`, the change of `b int F S : grad v dA` is

        K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu b int (F F')_ab d_A phi_i d_A phi_j dA
                    + delta_ab b int d_A phi_i S_AB d_B phi_j dA

    whose first line is the material and whose second the geometric stiffness. At rest it is `element_matrices`.
    """
    lame, mu = plate.lame
    count = len(batch.triangles)
    weight = (plate.thickness * batch.weights)[:, None, None]
    root = batch.gradients * np.sqrt(weight)  # (e, i, A, q)
    deformation = slopes + np.eye(2)[:, :, None]
    spread = deformation[:, None, :, :, None] * root[:, :, None, None]  # F_aA d_C phi_i: (e, i, a, A, C, q)
    pushed = np.trace(spread, axis1=3, axis2=4).reshape(count, 12, -1)
    flat = spread.reshape(count, 12, -1)
    m = (pushed @ pushed.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    k = lame * m + mu * m.transpose(0, 1, 4, 3, 2) + mu * (flat @ flat.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    pulled = np.einsum("eABq,eiBq->eiAq", stress * weight, batch.gradients, optimize=True).reshape(count, 6, -1)
    geometric = pulled @ batch.gradients.reshape(count, 6, -1).transpose(0, 2, 1)
    k[:, :, 0, :, 0] += geometric
    k[:, :, 1, :, 1] += geometric
    return np.asarray(k)


class Hub(NamedTuple):
    """The rigid hub at one pose, its nodes by their arms (h, 2), mm, from the platform centre at rest.

    motion : (h, 2), mm, `u = U + (R(theta) - 1) r`.
    rates : (2h, 3), change of the motion per pose.
    curvature : (h, 2), mm, second derivative of the motion by theta, `-R r`; the other second derivatives are zero.
    """

    motion: Array
    rates: Array
    curvature: Array


def hub_at(arms: Array, pose: Array) -> Hub:
    """Where the hub's nodes go at a pose (3,), mm and rad, of any size."""
    sine, less = np.sin(pose[2]), -2.0 * np.sin(pose[2] / 2) ** 2  # cos - 1 without cancellation
    turn = np.array([[less, -sine], [sine, less]])
    swung = arms @ turn.T
    return Hub(pose[:2] + swung, rigid_motion(arms + swung), -(arms + swung))


class Undeformed(NamedTuple):
    """The stage before its displacements: arms (h, 2), mm, are the hub's nodes from the platform centre."""

    batches: list[ElementBatch]
    plate: Plate
    tied: Tied
    arms: Array


class State(NamedTuple):
    """Pose (3,), displacements (n, 2), mm, and per batch the second Piola-Kirchhoff stress (e, 2, 2, q), MPa.

    The stress is that of the tangent, and on the way to equilibrium not quite the one of the displacements.
    """

    pose: Array
    field: Array
    stress: list[Array]


class Held(NamedTuple):
    """What a state takes: forces (2f + 3,) on the unknowns of `Tied`, stored energy, N mm, largest strain component."""

    forces: Array
    energy: float
    strain: float


def model_of(mesh: StageMesh, plate: Plate, degree: int = QUADRATURE) -> Undeformed:
    """Triangles and unknowns of a mesh; `degree` is that of the quadrature."""
    batches, tied = integration(mesh, degree), tie_hub(mesh)
    return Undeformed(batches, plate, tied, mesh.nodes[tied.hub])


def rest(model: Undeformed) -> State:
    """The stage without displacement and stress."""
    stress = [np.zeros((len(batch.triangles), 2, 2, batch.weights.shape[1])) for batch in model.batches]
    return State(np.zeros(3), np.zeros((len(model.tied.number), 2)), stress)


def held_by(model: Undeformed, state: State) -> Held:
    """Forces, energy and strain of the state's displacements."""
    forces, energy, largest = np.zeros((1, *state.field.shape)), 0.0, 0.0
    for batch in model.batches:
        slopes = slopes_of(batch, state.field[None])[0]
        strain = green_lagrange(slopes)
        stress = stress_tensor(model.plate, strain)
        add_nodal_forces(forces, batch, model.plate, first_piola(slopes, stress)[None])
        energy += float(np.sum(stress * strain * batch.weights[:, None, None])) * model.plate.thickness / 2
        largest = max(largest, float(np.max(np.abs(strain))))
    on_hub = hub_at(model.arms, state.pose).rates.T @ forces[0, model.tied.hub].ravel()
    return Held(np.append(forces[0, model.tied.free].ravel(), on_hub), energy, largest)


def tangent(model: Undeformed, state: State) -> sp.coo_array:
    """Lower triangle (2f + 3, 2f + 3) of the change of the forces on the unknowns, with the state's own stress."""
    hub, forces, matrices = hub_at(model.arms, state.pose), np.zeros((1, *state.field.shape)), []
    for batch, stress in zip(model.batches, state.stress, strict=True):
        slopes = slopes_of(batch, state.field[None])[0]
        add_nodal_forces(forces, batch, model.plate, first_piola(slopes, stress)[None])
        matrices.append(tangent_matrices(batch, model.plate, slopes, stress))
    triangles = np.concatenate([batch.triangles for batch in model.batches])
    K = tied_lower(triangles, matrices, model.tied.number, hub.rates)
    swing = np.sum(forces[0, model.tied.hub] * hub.curvature)  # as the hub turns, its forces change their levers
    rows, columns = (np.append(place, K.shape[0] - 1) for place in K.coords)
    return sp.coo_array((np.append(K.data, swing), (rows, columns)), shape=K.shape)


class Factorization(NamedTuple):
    """A factorised symmetric matrix: `solve`, and whether the matrix is positive definite."""

    solve: Solve
    definite: bool


Factorise: TypeAlias = Callable[[sp.coo_array], Factorization]


def factoriser() -> Factorise:
    """A function that factorises symmetric matrices given by their lower triangles, definite or not.

    Matrices with the pattern of the one before share its ordering and symbolic factorisation (CHOLMOD). A matrix that
    is not positive definite is factorised by SuperLU with pivoting. Raises ComputationFailed for a singular one.
    A factor is good until the next one is made.
    """
    if find_spec("cvxopt") is None:
        return _by_superlu
    from cvxopt import cholmod, matrix

    cholmod.options["supernodal"] = 2
    known: list[tuple[tuple[AnyArray, ...], Any, object]] = []
    places: list[Index] = []

    def factorise(lower: sp.coo_array) -> Factorization:
        if known and all(np.array_equal(old, new) for old, new in zip(known[0][0], lower.coords, strict=True)):
            places[:] = places or [_places(lower)]
            known[0][1].V = matrix(np.bincount(places[0], lower.data))
        else:
            matrix_in, places[:] = to_cvxopt(lower), []
            known[:] = [(lower.coords, matrix_in, cholmod.symbolic(matrix_in))]
        _, matrix_in, symbolic = known[0]
        try:
            cholmod.numeric(matrix_in, symbolic)
        except ArithmeticError:
            return _pivoted(lower)

        def solve(b: Array) -> Array:
            x = matrix(np.asfortranarray(b))
            cholmod.solve(symbolic, x)
            return np.array(x)

        return Factorization(solve, True)

    return factorise


def _places(lower: sp.coo_array) -> Index:
    """Of each entry its place among all that differ, column by column, as cvxopt keeps them."""
    rows, columns = lower.coords
    return np.unique(columns.astype(np.int64) * lower.shape[0] + rows, return_inverse=True)[1]


def _by_superlu(lower: sp.coo_array) -> Factorization:
    """Without CHOLMOD: LU without pivoting has a positive diagonal of U if and only if the matrix is definite."""
    from scipy.sparse.linalg import splu

    half = lower.tocsc()
    whole = (half + sp.tril(half, -1).T).tocsc()
    try:
        factor = splu(
            whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
        )
    except RuntimeError:
        return _pivoted(lower)
    symmetric = np.array_equal(factor.perm_r, factor.perm_c)
    if not (symmetric and np.all(factor.U.diagonal() > 0)):
        return _pivoted(lower)
    return Factorization(lambda b: np.asarray(factor.solve(b)), True)


def _pivoted(lower: sp.coo_array) -> Factorization:
    from scipy.sparse.linalg import splu

    half = lower.tocsc()
    try:
        factor = splu((half + sp.tril(half, -1).T).tocsc())
    except RuntimeError:
        raise ComputationFailed(
            "tangent stiffness singular to working precision: a limit or bifurcation load"
        ) from None
    return Factorization(lambda b: np.asarray(factor.solve(b)), False)
