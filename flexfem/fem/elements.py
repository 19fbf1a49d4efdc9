"""Curved quadratic triangles in the plane, and wedges: these triangles times quadratic segments through the thickness.

A wedge has 18 nodes; its displacements are products of the shape functions of the triangle, phi, and of the segment,
psi. The block of the stiffness that belongs to two nodes of the plane is therefore a sum of four matrices of the line,
each times a 3 x 3 matrix of the plane. scikit-fem 12 has wedges of six nodes only, and straight ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.mesh import NODES, StageMesh, gradients, quadrature, shape_functions

if TYPE_CHECKING:
    import skfem

QUADRATURE = 2  # three points: exact on straight triangles; on the default mesh 2e-6 from many points, mesh error 6e-5
SOLID_QUADRATURE = 4  # of products of two quadratic shape functions
MASS_QUADRATURE = 6  # of products of shape functions times the Jacobian determinant of a curved triangle: exact
LINE_POINTS = 3  # of Gauss in every layer: exact for products of two quadratic shape functions
CHUNK = 20_000  # triangles integrated at once
CACHED = 400  # triangles whose matrices are made at once: they fit a processor's cache, and memory is used again
LOWER = np.tril_indices(12)  # the 78 pairs of a triangle's degrees of freedom


class Plate(NamedTuple):
    """A homogeneous isotropic plate: Young's modulus (MPa), Poisson's ratio, thickness (mm)."""

    youngs_modulus: float
    poissons_ratio: float
    thickness: float

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants of plane stress, MPa: `lambda* = E nu / (1 - nu^2)` and `mu = E / (2 (1 + nu))`."""
        e, nu = self.youngs_modulus, self.poissons_ratio
        return e * nu / (1 - nu**2), e / (2 * (1 + nu))

    @property
    def solid_lame(self) -> tuple[float, float]:
        """Lame constants, MPa: `lambda = E nu / ((1 + nu) (1 - 2 nu))` and `mu` as in plane stress."""
        e, nu = self.youngs_modulus, self.poissons_ratio
        return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))


def skfem_mesh(mesh: StageMesh) -> skfem.MeshTri2:
    """The mesh for scikit-fem: same nodes, same order, so that node k carries the degrees of freedom 2k and 2k + 1."""
    from skfem import MeshTri2

    return MeshTri2(np.ascontiguousarray(mesh.nodes.T), np.ascontiguousarray(mesh.triangles[:, :3].T))


class ElementBatch(NamedTuple):
    """Some of the triangles with what integration over them needs.

    triangles : (e, 6) nodes.
    gradients : (e, 6 nodes, 2, q points), 1/mm, of the shape functions.
    weights : (e, q), mm^2, quadrature weights times Jacobian determinant.
    """

    triangles: Index
    gradients: Array
    weights: Array

    def where(self, chosen: AnyArray) -> ElementBatch:
        """The triangles for which `chosen` (e,) holds."""
        return ElementBatch(self.triangles[chosen], self.gradients[chosen], self.weights[chosen])

    def pieces(self, size: int) -> Iterator[ElementBatch]:
        """The batch in pieces of at most `size` triangles."""
        for start in range(0, len(self.triangles), size):
            part = slice(start, start + size)
            yield ElementBatch(self.triangles[part], self.gradients[part], self.weights[part])


def integration(mesh: StageMesh, degree: int = QUADRATURE) -> list[ElementBatch]:
    """Gradients and weights of all triangles in batches of `CHUNK`.

    Raises ValueError for a degree whose rule has weights that are not positive.
    """
    points, rule = quadrature(degree)
    batches = []
    for start in range(0, len(mesh.triangles), CHUNK):
        part = mesh.triangles[start : start + CHUNK]
        found, determinant = gradients(mesh.nodes[part], points)
        batches.append(ElementBatch(part, found, np.abs(determinant) * rule))
    return batches


def shape_values(degree: int) -> Array:
    """Shape functions (6 nodes, q points) at the quadrature points of `integration`."""
    return shape_functions(quadrature(degree)[0])[0]


def stress_tensor(plate: Plate, slopes: Array) -> Array:
    """Stress (..., d, d, q), MPa, of displacement gradients `d_b u_a` (..., d, d, q): plane for d = 2, else solid."""
    axes = range(slopes.shape[-2])
    lame, mu = plate.lame if len(axes) == 2 else plate.solid_lame
    stress = mu * (slopes + np.swapaxes(slopes, -3, -2))
    trace = lame * sum(slopes[..., a, a, :] for a in axes)
    for a in axes:
        stress[..., a, a, :] += trace
    return np.asarray(stress)


def von_mises(stress: Array, pull: float = 0.0, across: Array | float = 0.0) -> Array:
    """Von Mises stress (...) from xx, yy, xy (..., 3), MPa; zz = `pull` (xx + yy) + `across`, nu as pull in strain."""
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    zz = pull * (xx + yy) + across
    return np.asarray(np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2))


def solid_von_mises(stress: Array) -> Array:
    """Von Mises stress (...), MPa, of stresses (..., 3, 3)."""
    trace = np.trace(stress, axis1=-2, axis2=-1)
    deviator = stress - trace[..., None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1))))


# Triangles


def element_matrices(batch: ElementBatch, plate: Plate) -> Array:
    """Element stiffness matrices (e, 6, 2, 6, 2), N/mm: node, direction, node, direction.

    Notes
    -----
    With `M[ia, jb] = b int d_a phi_i d_b phi_j dA`, the weak form `b int sigma(u) : eps(v) dA` has the element matrix
    `K[ia, jb] = lambda* M[ia, jb] + mu M[ib, ja] + mu delta_ab sum_c M[ic, jc]`.
    """
    lame, mu = plate.lame
    root = batch.gradients * np.sqrt(plate.thickness * batch.weights)[:, None, None]
    flat = root.reshape(len(root), 12, -1)
    m = (flat @ flat.transpose(0, 2, 1)).reshape(-1, 6, 2, 6, 2)
    k = lame * m + mu * m.transpose(0, 1, 4, 3, 2)
    trace = mu * (m[:, :, 0, :, 0] + m[:, :, 1, :, 1])
    k[:, :, 0, :, 0] += trace
    k[:, :, 1, :, 1] += trace
    return np.asarray(k)


def matrices_of(batches: list[ElementBatch], plate: Plate) -> Iterator[Array]:
    """Element stiffness matrices (e, 6, 2, 6, 2), N/mm, some triangles at a time."""
    return (element_matrices(piece, plate) for batch in batches for piece in batch.pieces(CACHED))


def internal_forces(batches: list[ElementBatch], plate: Plate, fields: Array) -> Array:
    """Nodal forces (k, n, 2), N, that hold the displacements (k, n, 2), mm: the stiffness matrix times them.

    Notes
    -----
    Formed from differences of displacements within a triangle, so the stage's large rigid motions cancel before they
    are multiplied by Young's modulus: far more accurate than the matrix product, which is what refinement needs.
    """
    forces = np.zeros_like(fields)
    for batch in batches:
        add_nodal_forces(forces, batch, plate, stress_tensor(plate, slopes_of(batch, fields)))
    return forces


def slopes_of(batch: ElementBatch, fields: Array) -> Array:
    """Displacement gradients `d_b u_a` (k, e, 2, 2, q) of fields (k, n, 2), mm, from differences within a triangle."""
    relative = fields[:, batch.triangles] - fields[:, batch.triangles[:, :1]]
    return np.asarray(np.einsum("keia,eibq->keabq", relative, batch.gradients, optimize=True))


def add_nodal_forces(forces: Array, batch: ElementBatch, plate: Plate, stress: Array) -> None:
    """Add to forces (k, n, 2), N, those that balance stresses (k, e, 2, 2, q): `f_ia = b int s_ab d_b phi_i dA`."""
    weighted = stress * (plate.thickness * batch.weights)[:, None, None]
    nodal = np.einsum("keabq,eibq->keia", weighted, batch.gradients, optimize=True)
    for force, values in zip(forces, nodal, strict=True):
        for axis in (0, 1):
            force[:, axis] += np.bincount(batch.triangles.ravel(), values[..., axis].ravel(), minlength=len(force))


def nodal_stress(mesh: StageMesh, plate: Plate, fields: Array, chosen: Index | None = None) -> Array:
    """Stress (..., c, 3), MPa, as xx, yy, xy at all or chosen nodes (c,), averaged over the triangles around each.

    fields : (..., n, 2) displacements, mm.
    """
    n, every = len(mesh.nodes), fields.reshape(-1, *mesh.nodes.shape)
    chosen = np.arange(n) if chosen is None else chosen
    triangles = mesh.triangles[np.isin(mesh.triangles, chosen).any(axis=1)]
    gradient, _ = gradients(mesh.nodes[triangles], NODES)
    relative = every[:, triangles] - every[:, triangles[:, :1]]
    slopes = relative.transpose(0, 1, 3, 2) @ gradient.reshape(1, len(triangles), 6, 12)
    stress = stress_tensor(plate, slopes.reshape(*slopes.shape[:3], 2, 6))
    around, found = np.bincount(triangles.ravel(), minlength=n)[chosen], np.empty((len(every), len(chosen), 3))
    for place, (row, column) in enumerate([(0, 0), (1, 1), (0, 1)]):
        for case, part in enumerate(stress[:, :, row, column]):
            found[case, :, place] = np.bincount(triangles.ravel(), part.ravel(), n)[chosen] / around
    return found.reshape(*fields.shape[:-2], len(chosen), 3)


def tied_lower(triangles: Index, matrices: Iterable[Array], number: Index, rigid: Array) -> sp.coo_array:
    """Lower triangle (2 free + 3, 2 free + 3), entries in one place to be added up, of T' K T.

    Parameters
    ----------
    triangles : (m, 6) nodes.   matrices : (e, 6, 2, 6, 2), symmetric, of the triangles in their order.
    number : (n,), free nodes counted first, then those tied to the pose; -1 for a node left out (held at zero).
    rigid : (2 tied, 3), displacement of the tied nodes per pose, so that u = T q. With none, the pose is left out.
    """
    free = int(number.max()) + 1 - len(rigid) // 2
    nodes = number[triangles].astype(np.int32)
    values, beside = np.empty((len(nodes), len(LOWER[0]))), np.flatnonzero(np.any(nodes >= free, axis=1))
    whole, first = np.empty((len(beside), 12, 12)), 0  # of the triangles beside a tied node
    for part in matrices:
        flat, last = part.reshape(-1, 144), first + len(part)
        np.take(flat, 12 * LOWER[0] + LOWER[1], axis=1, out=values[first:last], mode="clip")
        here = slice(*np.searchsorted(beside, [first, last]))
        whole[here], first = flat[beside[here] - first].reshape(-1, 12, 12), last
    tied = nodes[beside]
    nodes[nodes >= free] = -1
    dofs = (2 * nodes[:, :, None] + np.arange(2, dtype=np.int32)).reshape(-1, 12)
    one, other = (dofs[:, pairs].ravel() for pairs in LOWER)
    rows, columns = np.maximum(one, other), np.minimum(one, other, out=other)
    out, entries = columns < 0, values.ravel()
    entries[out] = rows[out] = columns[out] = 0
    if not len(rigid):
        return sp.coo_array((entries, (rows, columns)), shape=(2 * free, 2 * free))
    motion = np.zeros((len(beside), 6, 2, 3))
    motion[tied >= free] = rigid.reshape(-1, 2, 3)[tied[tied >= free] - free]
    moved = motion.reshape(-1, 12, 3)
    held = whole @ moved  # forces of these triangles under the motions of the pose
    pose = 2 * free + np.arange(3, dtype=np.int32)
    by, at = np.broadcast_arrays(dofs[beside][:, :, None], pose)
    kept, (row, column) = by >= 0, np.tril_indices(3)
    corner = np.einsum("eip,eiq->pq", moved, held)[row, column]
    data = np.concatenate([entries, held[kept], corner])
    rows = np.concatenate([rows, at[kept], pose[row]])
    columns = np.concatenate([columns, by[kept], pose[column]])
    return sp.coo_array((data, (rows, columns)), shape=(2 * free + 3, 2 * free + 3))


def stiffness_matrix(batches: list[ElementBatch], plate: Plate, nodes: int) -> sp.csc_array:
    """Stiffness matrix (2n, 2n), N/mm, of all nodes, degrees of freedom x, y node by node."""
    triangles = np.concatenate([batch.triangles for batch in batches])
    lower = tied_lower(triangles, matrices_of(batches, plate), np.arange(nodes), np.empty((0, 3))).tocsc()
    return (lower + sp.tril(lower, -1).T).tocsc()


# Wedges


class Layers(NamedTuple):
    """Quadratic segments through the thickness, and what their nodes cannot do.

    heights : (m,), mm, of the nodes above the mid-plane, ascending: ends and middles of the layers.
    values, slopes : (m, z), of the shape functions at the points of Gauss; slopes in 1/mm.
    weights : (z,), mm, of these; twice where the segments are half of the thickness.
    held : nodes with w = 0.   fixed : nodes with u = v = 0, of motion out of the plane.
    """

    heights: Array
    values: Array
    slopes: Array
    weights: Array
    held: tuple[int, ...]
    fixed: tuple[int, ...] = ()

    @property
    def antisymmetric(self) -> Layers:
        """The same layers for motion out of the plane."""
        return self._replace(held=(), fixed=(0,))

    @property
    def moving(self) -> Index:
        """Nodes with u and v unknown."""
        return np.setdiff1d(np.arange(len(self.heights)), self.fixed)

    @property
    def lifted(self) -> Index:
        """Nodes with w unknown."""
        return np.setdiff1d(np.arange(len(self.heights)), self.held)

    @property
    def kept(self) -> tuple[Index, Index]:
        """Node and direction (unknowns,) of every unknown of one node of the plane."""
        moving, lifted = self.moving, self.lifted
        directions = np.concatenate([np.tile([0, 1], len(moving)), np.full(len(lifted), 2)])
        return np.concatenate([np.repeat(moving, 2), lifted]), directions

    @property
    def number(self) -> int:
        """How many layers there are."""
        return len(self.heights) // 2

    @property
    def unknowns(self) -> int:
        """Unknowns of one node of the plane: u, v of the moving nodes, then w of the lifted ones."""
        return 2 * len(self.moving) + len(self.lifted)

    @property
    def nodal_slopes(self) -> Array:
        """Matrix (m, m), 1/mm, from values at the nodes to their slopes there, the mean of two layers'."""
        found, around = np.zeros((len(self.heights),) * 2), np.zeros(len(self.heights))
        for layer in range(self.number):
            at = np.arange(2 * layer, 2 * layer + 3)
            high = self.heights[at[2]] - self.heights[at[0]]
            found[np.ix_(at, at)] += np.array([[-3.0, 4.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -4.0, 3.0]]) / high
            around[at] += 1.0
        return np.asarray(found / around[:, None])

    def rigid_fields(self, rigid: Array) -> Array:
        """Displacements (n, m, 3, 3) at all heights per pose, from those of the nodes in the plane (2 n, 3).

        The pose is x, y, theta; out of the plane z and the rotations a, b about x and y:
        `u = b z, v = -a z, w = Z + a y - b x`.
        """
        plane = rigid.reshape(-1, 1, 2, 3)
        found = np.zeros((len(plane), len(self.heights), 3, 3))
        if not self.fixed:
            found[:, :, :2] = plane
            return found
        found[:, :, 2, 0], found[:, :, 2, 1:] = 1.0, -plane[..., 2]
        found[:, :, 0, 2], found[:, :, 1, 1] = self.heights, -self.heights
        return found


def mirrored(thickness: float, number: int, surface: float, faces_held: bool = False) -> Layers:
    """Layers of half the thickness, thinner towards the free face; the other half is alike.

    Parameters
    ----------
    surface : mm, distance from the face over which the layers grow; below it the stress of a neck that wide changes.
    faces_held : w = 0 on the faces too, as between two rigid walls without friction: plane strain.

    Notes
    -----
    Bounds are at `a sinh(s asinh(b / 2 a))` from the face, s equally spaced: more layers refine all of them alike.
    """
    spaced = np.linspace(1.0, 0.0, number + 1) * np.arcsinh(thickness / 2 / surface)
    bounds = thickness / 2 - surface * np.sinh(spaced)
    bounds[0] = 0.0
    return layered(bounds, (0, 2 * number) if faces_held else (0,), 2)


def layered(bounds: Array, held: tuple[int, ...] = (), copies: int = 1) -> Layers:
    """Layers with given bounds (l + 1,), mm, ascending; integrals count `copies` times."""
    s, w = np.polynomial.legendre.leggauss(LINE_POINTS)
    psi, slope = np.array([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2]), np.array([s - 0.5, -2 * s, s + 0.5])
    high, count = np.diff(bounds), len(bounds) - 1
    heights = np.concatenate([np.column_stack([bounds[:-1], bounds[:-1] + high / 2]).ravel(), bounds[-1:]])
    values, slopes = np.zeros((2, 2 * count + 1, LINE_POINTS * count))
    for layer in range(count):
        at = slice(2 * layer, 2 * layer + 3), slice(LINE_POINTS * layer, LINE_POINTS * (layer + 1))
        values[at], slopes[at] = psi, slope * 2 / high[layer]
    return Layers(heights, values, slopes, np.outer(copies * high / 2, w).ravel(), held)


def wedge_forces(batches: list[ElementBatch], phi: Array, plate: Plate, layers: Layers, fields: Array) -> Array:
    """Nodal forces (k, n, m, 3), N, that hold displacements (k, n, m, 3), mm.

    Notes
    -----
    From differences of displacements within a triangle and through the thickness, as `internal_forces`.
    """
    total = np.zeros_like(fields)
    for piece in (piece for batch in batches for piece in batch.pieces(CACHED)):
        gathered = gathering(piece.triangles, fields.shape[1])
        for field, found in zip(fields, total, strict=True):
            nodal = _held(piece, phi, plate, layers, field).reshape(piece.triangles.size, -1)
            found += (gathered @ nodal).reshape(found.shape)
    return total


def _held(piece: ElementBatch, phi: Array, plate: Plate, layers: Layers, field: Array) -> Array:
    """Nodal forces (e, 6, m, 3) of some triangles under one field (n, m, 3)."""
    values, slopes, weights = layers.values, layers.slopes, layers.weights
    at = field[piece.triangles]
    across = np.einsum("eimc,eibq,mz->ecbqz", at - at[:, :1], piece.gradients, values, optimize=True)
    lifted = np.einsum("eimc,iq,mz->ecqz", at - at[:, :, :1], phi, slopes, optimize=True)
    gradient = np.concatenate([across, lifted[:, :, None]], axis=2)
    stress = stress_tensor(plate, gradient.reshape(*gradient.shape[:3], -1)).reshape(gradient.shape)
    stress *= (piece.weights[:, :, None] * weights)[:, None, None]
    nodal = np.einsum("ecbqz,eibq,mz->eimc", stress[:, :, :2], piece.gradients, values, optimize=True)
    return np.asarray(nodal + np.einsum("ecqz,iq,mz->eimc", stress[:, :, 2], phi, slopes, optimize=True))


def gathering(triangles: Index, nodes: int) -> sp.csc_array:
    """Matrix (nodes, 6 e) that adds up values at the corners and middles of triangles (e, 6)."""
    every = np.arange(triangles.size + 1)
    return sp.csc_array((np.ones(triangles.size), triangles.ravel(), every), shape=(nodes, triangles.size))


def wedge_lower(
    batches: list[ElementBatch], phi: Array, plate: Plate, layers: Layers, number: Index, free: int
) -> Iterator[tuple[Array, AnyArray, AnyArray]]:
    """Values, rows and columns of the stiffness of the free nodes, whose `number` is below `free`: its lower triangle.

    Notes
    -----
    The unknowns of one node of the plane follow each other in the order of `Layers.kept`.
    """
    rows, columns, plane = _plane_pairs(batches, phi, plate, number, free)
    values, slopes, weights = layers.values, layers.slopes, layers.weights
    one, two = values * weights, slopes * weights
    k, j = np.nonzero((values != 0).astype(float) @ (values != 0).T)  # nodes of the line that share a layer
    line = np.array([one @ values.T, two @ slopes.T, one @ slopes.T, two @ values.T])[:, k, j]
    place = np.full((len(layers.heights), 3), -1)  # of the unknown among those of a node
    place[layers.kept] = np.arange(layers.unknowns)
    one, other = np.broadcast_arrays(place[k][:, :, None], place[j][:, None, :])
    kept = np.flatnonzero((one.ravel() >= 0) & (other.ravel() >= 0))
    one, other = one.ravel()[kept], other.ravel()[kept]
    blocks = np.einsum("pfab,fy->pyab", plane, line, optimize=True).reshape(len(rows), -1)[:, kept]
    off, each = rows != columns, layers.unknowns
    yield blocks[off].ravel(), *((each * n[off, None] + at).ravel() for n, at in ((rows, one), (columns, other)))
    half = one >= other
    same = each * rows[~off, None]
    yield blocks[~off][:, half].ravel(), (same + one[half]).ravel(), (same + other[half]).ravel()


def _plane_pairs(
    batches: list[ElementBatch], phi: Array, plate: Plate, number: Index, free: int
) -> tuple[Index, Index, Array]:
    """Pairs of free nodes (p,), (p,), the first not before the second, and their coefficients (p, 4, 3, 3).

    Notes
    -----
    Of the line's `int psi_k psi_l dz`, `int psi'_k psi'_l dz`, `int psi_k psi'_l dz` and `int psi'_k psi_l dz`, in
    the weak form `int lambda e_kk(u) e_ll(v) + 2 mu e(u) : e(v) dV`.
    """
    lame, mu = plate.solid_lame
    nodes = np.concatenate([number[batch.triangles] for batch in batches])
    nodes[nodes >= free] = -1
    found = []
    for batch in batches:
        g = np.einsum("eiaq,ejbq,eq->eijab", batch.gradients, batch.gradients, batch.weights, optimize=True)
        a = np.einsum("eiaq,jq,eq->eija", batch.gradients, phi, batch.weights, optimize=True)
        mass = np.einsum("iq,jq,eq->eij", phi, phi, batch.weights, optimize=True)
        laplace, back = g[..., 0, 0] + g[..., 1, 1], a.swapaxes(1, 2)
        c = np.zeros((*mass.shape, 4, 3, 3))
        c[..., 0, :2, :2] = lame * g + mu * g.swapaxes(3, 4)
        for axis in (0, 1):
            c[..., 0, axis, axis] += mu * laplace
            c[..., 1, axis, axis] = mu * mass
        c[..., 0, 2, 2], c[..., 1, 2, 2] = mu * laplace, (lame + 2 * mu) * mass
        c[..., 2, :2, 2], c[..., 2, 2, :2] = lame * a, mu * a
        c[..., 3, :2, 2], c[..., 3, 2, :2] = mu * back, lame * back
        found.append(c)
    coefficients = np.concatenate(found)
    one, other = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
    chosen = (other >= 0) & (one >= other)
    keys, pair = np.unique(one[chosen] * len(number) + other[chosen], return_inverse=True)
    gathered = sp.csr_array((np.ones(len(pair)), (pair, np.arange(len(pair)))), shape=(len(keys), len(pair)))
    rows, columns = np.divmod(keys, len(number))
    return rows, columns, (gathered @ coefficients[chosen].reshape(len(pair), 36)).reshape(-1, 4, 3, 3)


def solid_nodal_stress(mesh: StageMesh, plate: Plate, layers: Layers, field: Array, chosen: Index) -> Array:
    """Stress (c, m, 3, 3), MPa, of a field (n, m, 3), mm, at chosen nodes of the plane (c,), at all heights.

    Notes
    -----
    Averaged over the wedges around a node.
    """
    triangles = mesh.triangles[np.isin(mesh.triangles, chosen).any(axis=1)]
    slopes, total = layers.nodal_slopes, np.zeros((len(mesh.nodes), len(layers.heights) * 9))
    for start in range(0, len(triangles), CACHED):
        part = triangles[start : start + CACHED]
        at, found = field[part], gradients(mesh.nodes[part], NODES)[0]
        across = np.einsum("eimc,eibq->ecbqm", at - at[:, :1], found, optimize=True)
        lifted = np.einsum("eqmc,km->ecqk", at - at[:, :, :1], slopes, optimize=True)
        gradient = np.concatenate([across, lifted[:, :, None]], axis=2)
        stress = stress_tensor(plate, gradient.reshape(*gradient.shape[:3], -1)).reshape(gradient.shape)
        total += gathering(part, len(total)) @ stress.transpose(0, 3, 4, 1, 2).reshape(part.size, -1)
    around = np.bincount(triangles.ravel(), minlength=len(total))[chosen]
    return np.asarray(total[chosen] / around[:, None]).reshape(len(chosen), -1, 3, 3)
