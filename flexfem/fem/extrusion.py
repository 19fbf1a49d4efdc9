"""Solids that are a plane section times a line, in finite elements: quadratic triangles times quadratic segments.

Displacements are products of shape functions of the section and of the line (wedges of 18 nodes), so that every
integral over the solid is one over the section times one over the line, and the stiffness a sum of Kronecker products.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.elements import ElementBatch, Plate, integration
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.problem import shape_values

DEGREE = 4  # of the quadrature: products of two quadratic shape functions
SOLVES = 2  # the second removes what the factors rounded off


class Section(NamedTuple):
    """Integrals over a plane section for all pairs of its nodes (n, n), of shape functions phi.

    gradients : [a][b], `int d_a phi_i d_b phi_j dA`.   mixed : [a], `int d_a phi_i phi_j dA`, mm.
    mass : `int phi_i phi_j dA`, mm^2.
    """

    gradients: tuple[tuple[sp.csr_array, sp.csr_array], tuple[sp.csr_array, sp.csr_array]]
    mixed: tuple[sp.csr_array, sp.csr_array]
    mass: sp.csr_array


class Line(NamedTuple):
    """Integrals over the line z for all pairs of its nodes (m, m), of shape functions psi, and of each alone.

    mass : `int psi psi dz`.   mixed : `int psi psi' dz`, the second is differentiated.   slopes : `int psi' psi' dz`.
    whole : (m,), `int psi dz`.
    """

    mass: sp.csr_array
    mixed: sp.csr_array
    slopes: sp.csr_array
    whole: Array


def section_integrals(mesh: StageMesh) -> Section:
    """Integrals over a plane section with curved quadratic triangles."""
    batches, phi = integration(mesh, DEGREE), shape_values(DEGREE)

    def matrix(term: str, *slopes: int) -> sp.csr_array:
        number = len(mesh.nodes)
        total = sp.csr_array((number, number))
        for batch in batches:
            factors = [batch.gradients[:, :, a] for a in slopes] + [phi] * (2 - len(slopes))
            total = total + _gathered(batch, np.einsum(term, *factors, batch.weights, optimize=True), number)
        return total

    xx, xy, yx, yy = (matrix("eiq,ejq,eq->eij", a, b) for a in (0, 1) for b in (0, 1))
    mixed = (matrix("eiq,jq,eq->eij", 0), matrix("eiq,jq,eq->eij", 1))
    return Section(((xx, xy), (yx, yy)), mixed, matrix("iq,jq,eq->eij"))


def _gathered(batch: ElementBatch, values: Array, number: int) -> sp.csr_array:
    rows, columns = np.repeat(batch.triangles, 6, axis=1), np.tile(batch.triangles, (1, 6))
    return sp.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(number, number)).tocsr()


def line_integrals(z: Array) -> Line:
    """Integrals over quadratic segments with ends z (k + 1,), ascending, and middles in between."""
    s, w = np.polynomial.legendre.leggauss(3)
    psi, slope = np.array([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2]), np.array([s - 0.5, -2 * s, s + 0.5])
    number = 2 * len(z) - 1
    pairs, whole = np.zeros((3, number, number)), np.zeros(number)
    for segment, half in enumerate(np.diff(z) / 2):
        at = slice(2 * segment, 2 * segment + 3)
        pairs[:, at, at] += [half * (psi * w) @ psi.T, (psi * w) @ slope.T, (slope * w) @ slope.T / half]
        whole[at] += half * psi @ w
    mass, mixed, slopes = map(sp.csr_array, pairs)
    return Line(mass, mixed, slopes, whole)


def plane_stiffness(section: Section, poissons_ratio: float) -> sp.csr_array:
    """Stiffness (2n, 2n) of a plane section in plane stress, modulus and thickness one; x of all nodes, then y."""
    return sp.block_array(_in_plane(section, *Plate(1.0, poissons_ratio, 1.0).lame), format="csr")


def solid_stiffness(section: Section, line: Line, poissons_ratio: float) -> sp.csr_array:
    """Stiffness (3nm, 3nm) of section times line, modulus one; x of all nodes, then y, z, z running fastest.

    Notes
    -----
    Of the weak form `int lambda e_kk(u) e_ll(v) + 2 mu e(u) : e(v) dV`, `lambda = E nu / ((1 + nu) (1 - 2 nu))`.
    """
    nu = poissons_ratio
    lame, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    laplace = section.gradients[0][0] + section.gradients[1][1]
    blocks = [[sp.kron(block, line.mass) for block in row] + [None] for row in _in_plane(section, lame, mu)]
    for a, mixed in enumerate(section.mixed):
        blocks[a][a] += mu * sp.kron(section.mass, line.slopes)
        blocks[a][2] = lame * sp.kron(mixed, line.mixed) + mu * sp.kron(mixed.T, line.mixed.T)
    thick = (lame + 2 * mu) * sp.kron(section.mass, line.slopes) + mu * sp.kron(laplace, line.mass)
    return sp.block_array([*blocks, [blocks[0][2].T, blocks[1][2].T, thick]], format="csr")


def _in_plane(section: Section, lame: float, mu: float) -> list[list[sp.csr_array]]:
    """Blocks `lambda d_a v d_b u + mu d_b v d_a u + mu delta_ab d_c v d_c u`, v by rows and u by columns."""
    g = section.gradients
    trace = mu * (g[0][0] + g[1][1])
    return [[lame * g[a][b] + mu * g[b][a] + (trace if a == b else 0 * trace) for b in (0, 1)] for a in (0, 1)]


def displacement(stiffness: sp.csr_array, force: Array, held: Index, rigid: Array) -> Array:
    """Displacements (n,) under forces (n,), zero where held. Raises ComputationFailed when a part is not held.

    Parameters
    ----------
    rigid : (n,), the motion without strain that is most of the result: multiplied by the stiffness it would leave
        round-off where nothing is, and is left out.
    """
    u, free = np.zeros(len(force)), np.setdiff1d(np.arange(len(force)), held)
    inverse = factorise(sp.tril(stiffness[free][:, free]).tocoo())
    for _ in range(SOLVES):
        strained = u - rigid * (rigid @ u) / (rigid @ rigid)
        u[free] += inverse((force - stiffness @ strained)[free, None])[:, 0]
    return u
