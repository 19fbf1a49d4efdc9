"""Curved quadratic triangles, and wedges: these times quadratic segments through the thickness.

A shape function is the product of one of the triangle, phi, and one of the line through the
thickness, psi; a plane element has psi = 1. The stiffness of two nodes of the plane is a sum of
products of a plane and a line matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.mesh import NODES, PlaneMesh, gradients, quadrature, shape_functions

# three points: exact on straight triangles; error 2e-6 on the default mesh, whose own error is 6e-5
QUADRATURE = 2
SOLID_QUADRATURE = 4  # of products of two quadratic shape functions
# of products of shape functions times the Jacobian determinant of a curved triangle: exact
MASS_QUADRATURE = 6
LINE_POINTS = 3  # of Gauss in every layer: exact for products of two quadratic shape functions
CHUNK = 20_000  # triangles integrated at once
# triangles whose matrices are computed at once: they fit the cache of a processor, and memory is
# reused
CACHED = 400
MOST_COMPONENTS = 4_000_000  # of stress, computed at once


class Plate(NamedTuple):
    """A plate of isotropic material: Young's modulus (MPa), Poisson's ratio, thickness (mm).

    The elastic constants are numbers, or arrays (m,) of the triangles of a mesh whose parts have
    different materials."""

    youngs_modulus: Any
    poissons_ratio: Any
    thickness: float

    @property
    def mixed(self) -> bool:
        """Whether triangles have different materials."""
        return bool(np.ndim(self.youngs_modulus))

    def of(self, triangles: Index | slice) -> Plate:
        """Return the plate of chosen triangles."""
        if not self.mixed:
            return self
        return self._replace(
            youngs_modulus=self.youngs_modulus[triangles],
            poissons_ratio=self.poissons_ratio[triangles],
        )

    def lame(
        self,
        axes: int,
        dimensions: int = 1,
    ) -> tuple[Any, Any]:
        """Return the Lame constants lambda and mu, MPa, for 3 axes, or for plane stress with 2.

        In plane stress `lambda* = E nu / (1 - nu^2)`, with the same mu.

        dimensions : of the arrays (m, 1, ...) of triangles with different materials.
        """
        e = self.youngs_modulus
        nu = self.poissons_ratio
        if self.mixed:
            shape = (-1, *[1] * (dimensions - 1))
            e = np.reshape(e, shape)
            nu = np.reshape(nu, shape)
        stretching = (1 - nu**2) if axes == 2 else (1 + nu) * (1 - 2 * nu)
        return e * nu / stretching, e / (2 * (1 + nu))


def segment_functions(s: Array) -> tuple[Array, Array]:
    """Values and slopes (3 nodes, z) of the quadratic shape functions on a segment from -1 to 1.

    s : (z,), points.
    """
    values = np.array([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2])
    return values, np.array([s - 0.5, -2 * s, s + 0.5])


class Layers(NamedTuple):
    """Nodes of a line through the thickness, of quadratic segments, or one node in the plane.

    heights : (m,), mm, of the nodes above the mid-plane, ascending: ends and middles of the layers.
    values, slopes : (m, z), of the shape functions at the Gauss points; slopes in 1/mm.
    weights : (z,), mm, of the Gauss points; doubled when the segments cover half of the thickness.
    held : nodes with w = 0.   fixed : nodes with u = v = 0, for motion out of the plane.
    """

    heights: Array
    values: Array
    slopes: Array
    weights: Array
    held: tuple[int, ...]
    fixed: tuple[int, ...] = ()

    @property
    def axes(self) -> int:
        """Number of components of a displacement."""
        return 2 if len(self.heights) == 1 else 3

    @property
    def antisymmetric(self) -> Layers:
        """The same layers with the constraints of motion out of the plane."""
        return self._replace(held=(), fixed=(0,))

    @property
    def free_components(self) -> Index:
        """Flat indices of the free components among (m, d): u, v of all nodes, then w."""
        index = np.arange(len(self.heights) * self.axes).reshape(-1, self.axes)
        uv = np.delete(index[:, :2], self.fixed, axis=0)
        w = np.delete(index[:, 2:], self.held, axis=0)
        return np.concatenate([uv.ravel(), w.ravel()])

    @property
    def at_nodes(self) -> Layers:
        """The layers evaluated at their nodes; a slope between two layers is the mean of both."""
        count = len(self.heights)
        slopes = np.zeros((count, count))
        adjacent = np.zeros(count)
        slopes_of_segment = 2 * segment_functions(np.array([-1.0, 0.0, 1.0]))[1]
        for first in range(0, count - 1, 2):
            at = slice(first, first + 3)
            slopes[at, at] += slopes_of_segment / np.ptp(self.heights[at])
            adjacent[at] += 1.0
        return self._replace(values=np.eye(count), slopes=slopes / np.maximum(adjacent, 1.0))

    def rigid(self, nodes: Array) -> Array:
        """Displacements (n, m, d, 3) of nodes (n, 2), mm, per unit pose of a rigid body.

        Out of the plane the pose is Z and the rotations a, b about x and y: `u = b z, v = -a z, w =
        Z + a y - b x`."""
        rigid = np.zeros((len(nodes), len(self.heights), self.axes, 3))
        x, y = nodes.T[:, :, None]
        if self.fixed:
            rigid[:, :, 0, 2] = self.heights
            rigid[:, :, 1, 1] = -self.heights
            rigid[:, :, 2, 0] = 1.0
            rigid[:, :, 2, 1] = y
            rigid[:, :, 2, 2] = -x
        else:
            rigid[:, :, 0, 0] = 1.0
            rigid[:, :, 1, 1] = 1.0
            rigid[:, :, 0, 2] = -y
            rigid[:, :, 1, 2] = x
        return rigid


def sheet(thickness: float) -> Layers:
    """Return the single node through the thickness of a plane structure."""
    return Layers(np.zeros(1), np.ones((1, 1)), np.zeros((1, 1)), np.array([thickness]), (0,))


def mirrored(
    thickness: float,
    number: int,
    surface: float,
) -> Layers:
    """Return layers of the upper half of the thickness, thinner towards the free face.

    Integrals cover both halves.

    surface : mm, depth below the face within which layers are thin, about the width of a neck:
    there its stress varies."""
    bounds = thickness / 2 - widening(np.linspace(1.0, 0.0, number + 1), surface, thickness / 2)
    bounds[0] = 0.0
    return layered(bounds, (0,), 2)


def widening(
    s: Array,
    scale: float,
    total: float,
) -> Array:
    """Map s in 0..1 to 0..total: evenly up to about `scale`, then in geometric progression."""
    return np.asarray(scale * np.sinh(np.arcsinh(total / scale) * s))


def layered(
    bounds: Array,
    held: tuple[int, ...] = (),
    copies: int = 1,
) -> Layers:
    """Return layers with bounds (l + 1,), mm, ascending; integrals are multiplied by `copies`."""
    s, w = np.polynomial.legendre.leggauss(LINE_POINTS)
    psi, slope = segment_functions(s)
    height = np.diff(bounds)
    count = len(bounds) - 1
    lower = np.column_stack([bounds[:-1], bounds[:-1] + height / 2])
    heights = np.append(lower, bounds[-1:])
    values, slopes = np.zeros((2, 2 * count + 1, LINE_POINTS * count))
    for layer in range(count):
        nodes = slice(2 * layer, 2 * layer + 3)
        points = slice(LINE_POINTS * layer, LINE_POINTS * (layer + 1))
        values[nodes, points] = psi
        slopes[nodes, points] = slope * 2 / height[layer]
    return Layers(heights, values, slopes, np.outer(copies * height / 2, w).ravel(), held)


class ElementBatch(NamedTuple):
    """A batch of triangles with shape functions, gradients and weights at the quadrature points.

    triangles : (e, 6) nodes.
    gradients : (e, 6 nodes, 2, q points), 1/mm, of the shape functions.
    weights : (e, q), mm^2, quadrature weights times Jacobian determinant.
    phi : (6, q), shape functions.
    first : number of the first of them among the triangles of the mesh.
    """

    triangles: Index
    gradients: Array
    weights: Array
    phi: Array
    first: int = 0

    @property
    def numbers(self) -> slice:
        """Numbers of the triangles in the mesh."""
        return slice(self.first, self.first + len(self.triangles))

    def pieces(self, size: int = CACHED) -> Iterator[ElementBatch]:
        """Yield the batch in pieces of at most `size` triangles."""
        for start in range(0, len(self.triangles), size):
            part = slice(start, start + size)
            first = self.first + start
            yield ElementBatch(
                self.triangles[part], self.gradients[part], self.weights[part], self.phi, first
            )

    def assembly(self, nodes: int) -> tuple[Index, sp.csc_array]:
        """Nodes (c,) of the triangles, and the matrix (c, 6 e) that sums element values.

        nodes : number of nodes of the mesh.
        """
        used = np.zeros(nodes, dtype=bool)
        used[self.triangles] = True
        own = np.flatnonzero(used)
        columns = np.arange(self.triangles.size + 1)
        rows = (np.cumsum(used) - 1)[self.triangles].ravel()
        shape = (len(own), columns[-1])
        return own, sp.csc_array((np.ones(columns[-1]), rows, columns), shape=shape)

    def slopes(
        self,
        line: Layers,
        fields: Array,
    ) -> Array:
        """Displacement gradients `d_b u_a` (k, e, d, d, q z) of fields (k, n, *shape), mm.

        Displacements relative to the first node are used, so that large rigid motions cancel
        without round-off."""
        if line.axes == 2:  # in the plane `line.values` is one
            u = fields[:, self.triangles]
            return np.asarray(
                np.einsum("keic,eibq->kecbq", u - u[:, :, :1], self.gradients, optimize=True)
            )
        u = fields.reshape(*fields.shape[:2], -1, line.axes)[:, self.triangles]
        slopes = np.einsum(
            "keimc,eibq,mz->kecbqz", u - u[:, :, :1], self.gradients, line.values, optimize=True
        )
        along_z = np.einsum(
            "keimc,iq,mz->kecqz", u - u[:, :, :, :1], self.phi, line.slopes, optimize=True
        )
        slopes = np.concatenate([slopes, along_z[:, :, :, None]], axis=3)
        return np.asarray(slopes.reshape(*slopes.shape[:4], -1))

    def add_forces(
        self,
        forces: Array,
        line: Layers,
        stress: Array,
    ) -> None:
        """Add the nodal forces of stresses (k, e, d, d, q z) to `forces` (k, n, ...), N.

        They are `f_ia = int s_ab d_b phi_i dV`.
        """
        weighted = stress.reshape(*stress.shape[:4], -1, len(line.weights))
        weighted = weighted * (self.weights[:, :, None] * line.weights)[:, None, None]
        nodal = np.einsum(
            "kecbqz,eibq,mz->eikmc",
            weighted[:, :, :, :2],
            self.gradients,
            line.values,
            optimize=True,
        )
        if line.axes == 3:
            nodal = nodal + np.einsum(
                "kecqz,iq,mz->eikmc", weighted[:, :, :, 2], self.phi, line.slopes, optimize=True
            )
        own, assembly = self.assembly(forces.shape[1])
        total = assembly @ nodal.reshape(self.triangles.size, -1)
        forces[:, own] += np.moveaxis(total.reshape(len(own), len(forces), *forces.shape[2:]), 1, 0)

    def stiffness(
        self,
        plate: Plate,
        axes: int,
    ) -> Array:
        """Coefficients (e, 6, 6, l, d, d) of the l matrices of the line in the stiffness.

        They are those between nodes of the plane.

        plate : of these triangles.

        Notes
        -----
        The weak form is `int lambda e_kk(u) e_ll(v) + 2 mu e(u) : e(v) dV`; with `g = int d_a phi_i
        d_b phi_j dA` its plane part is `lambda g_ab + mu g_ba + mu delta_ab g_cc`."""
        count = len(self.triangles)
        root = (self.gradients * np.sqrt(self.weights)[:, None, None]).reshape(count, 12, -1)
        g = (root @ root.transpose(0, 2, 1)).reshape(count, 6, 2, 6, 2)
        mu = plate.lame(axes, 3)[1]
        laplace = mu * (g[:, :, 0, :, 0] + g[:, :, 1, :, 1])
        stretched, sheared = plate.lame(axes, 5)
        plane = stretched * g + sheared * g.transpose(0, 1, 4, 3, 2)
        for axis in range(2):
            plane[:, :, axis, :, axis] += laplace
        plane = plane.transpose(0, 1, 3, 2, 4)
        if axes == 2:
            return np.asarray(plane[:, :, :, None])
        blocks = self._stiffness_along_z(plate)
        blocks[..., 0, :2, :2] = plane
        blocks[..., 0, 2, 2] = laplace
        return blocks

    def _stiffness_along_z(self, plate: Plate) -> Array:
        """The coefficients (e, 6, 6, 4, 3, 3) of `stiffness` of matrices with slopes of the line.

        Those of the first matrix are zero.
        """
        count = len(self.triangles)
        phi = self.phi
        blocks = np.zeros((count, 6, 6, 4, 3, 3))
        a = np.einsum("eiaq,jq,eq->eija", self.gradients, phi, self.weights, optimize=True)
        mass = np.einsum("iq,jq,eq->eij", phi, phi, self.weights, optimize=True)
        transposed = a.swapaxes(1, 2)
        lame, mu = plate.lame(3, 3)
        for axis, modulus in enumerate((mu, mu, lame + 2 * mu)):
            blocks[..., 1, axis, axis] = mass * modulus
        lame, mu = plate.lame(3, 4)
        blocks[..., 2, :2, 2] = lame * a
        blocks[..., 2, 2, :2] = mu * a
        blocks[..., 3, :2, 2] = mu * transposed
        blocks[..., 3, 2, :2] = lame * transposed
        return blocks


def integration(mesh: PlaneMesh, degree: int = QUADRATURE) -> list[ElementBatch]:
    """Return all triangles in batches of `CHUNK`, with a quadrature rule of the given degree."""
    points, rule = quadrature(degree)
    phi = shape_functions(points)[0]
    batches = []
    for start in range(0, len(mesh.triangles), CHUNK):
        part = mesh.triangles[start : start + CHUNK]
        slopes, determinant = gradients(mesh.nodes[part], points)
        batches.append(ElementBatch(part, slopes, np.abs(determinant) * rule, phi, start))
    return batches


def stress_tensor(plate: Plate, slopes: Array) -> Array:
    """Stress (..., d, d, q), MPa, of displacement gradients `d_b u_a` (..., d, d, q).

    It is that of plane stress for d = 2.

    The gradients are (..., e, d, d, q) of a plate whose e triangles have different materials.
    """
    axes = range(slopes.shape[-2])
    lame = plate.lame(len(axes), 2)[0]
    mu = plate.lame(len(axes), 4)[1]
    stress = mu * (slopes + np.swapaxes(slopes, -3, -2))
    trace = lame * sum(slopes[..., a, a, :] for a in axes)
    for a in axes:
        stress[..., a, a, :] += trace
    return np.asarray(stress)


def von_mises(
    stress: Array,
    ratio: float = 0.0,
    across: Array | float = 0.0,
) -> Array:
    """Von Mises stress (...), MPa, of stresses (..., 3, 3), or (..., 2, 2) in the plane.

    In the plane the stress zz is `ratio` (xx + yy) + `across`; in plane strain `ratio` is nu.
    """
    xx = stress[..., 0, 0]
    yy = stress[..., 1, 1]
    shear = stress[..., 0, 1] ** 2
    if stress.shape[-1] == 2:
        zz = ratio * (xx + yy) + across
    else:
        zz = stress[..., 2, 2]
        shear = shear + stress[..., 0, 2] ** 2 + stress[..., 1, 2] ** 2
    differences = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.asarray(np.sqrt(0.5 * differences + 3 * shear))


def highest_stress(
    stress: Array,
    loads: Array,
    ratio: float,
) -> Array:
    """Highest von Mises stress (n, m), MPa, at every height under loads (n, c) of several cases.

    stress : (c, p, 2, 2) or (c, p, m, 3, 3), MPa, of the cases at p nodes.
    ratio : as of `von_mises`.
    """
    parts = list[Array]()
    size = max(1, MOST_COMPONENTS // stress[0].size)
    for start in range(0, max(1, len(loads)), size):
        combined = np.tensordot(loads[start : start + size], stress, axes=1)
        parts.append(von_mises(combined, ratio).max(axis=1))
    highest = np.concatenate(parts)
    return highest if highest.ndim == 2 else highest[:, None]


class Pairs(NamedTuple):
    """Pairs of nodes that share a triangle, row >= column, as a sparse pattern by rows.

    columns, starts : (p,) and (n + 1,), of the pattern, columns ascending: the last of a row is its
        diagonal.
    chosen : (e, 6, 6), marks the blocks of the triangles, in the order of the batches, that belong
        to a pair.
    number : (chosen,), pair of each of these blocks.
    """

    columns: AnyArray
    starts: AnyArray
    chosen: NDArray[np.bool_]
    number: AnyArray


def assembled(
    pairs: Pairs,
    blocks: Iterable[Array],
    line: Layers,
) -> sp.csr_array:
    """Assemble the lower triangle of a symmetric matrix.

    The unknowns are `Layers.free_components` of every node.

    blocks : (e, 6, 6, l, d, d), of the triangles in their order, coefficients of the matrices (l,
        m, m) of the line: `int psi_k psi_l dz`, and for layers also those of `psi'_k psi'_l`,
        `psi_k psi'_l`, `psi'_k psi_l`.
    """
    matrices = _line_matrices(line)
    plane = _summed_blocks(pairs, blocks, len(matrices) * line.axes**2)
    # of the unknowns of a node of the plane
    node, axis = np.divmod(line.free_components, line.axes)
    on_points = (line.values != 0).astype(float)
    i, j = np.nonzero((on_points @ on_points.T)[np.ix_(node, node)])  # their nodes share a layer
    factors = np.zeros((len(matrices), line.axes, line.axes, len(i)))
    factors[:, axis[i], axis[j], np.arange(len(i))] = matrices[:, node[i], node[j]]
    values = plane.T @ factors.reshape(len(plane), -1)
    values[np.ix_(pairs.starts[1:] - 1, j > i)] = 0.0  # above the diagonal
    count = len(pairs.starts) - 1
    size = len(node)
    rows = np.repeat(size * np.arange(count, dtype=np.int32), np.diff(pairs.starts))
    places = (
        (rows[:, None] + i.astype(np.int32)).ravel(),
        (size * pairs.columns[:, None] + j.astype(np.int32)).ravel(),
    )
    lower = sp.coo_array((values.ravel(), places), shape=(size * count, size * count)).tocsr()
    lower.eliminate_zeros()
    return lower


def _line_matrices(line: Layers) -> Array:
    """Matrices (l, m, m) of the line in the order of `assembled`."""
    psi = line.values
    slope = line.slopes
    products = [(psi, psi)]
    if line.axes == 3:
        products += [(slope, slope), (psi, slope), (slope, psi)]
    return np.array([(left * line.weights) @ right.T for left, right in products])


def _summed_blocks(
    pairs: Pairs,
    blocks: Iterable[Array],
    size: int,
) -> Array:
    """Sums (size, p) over the triangles of their blocks at every pair of nodes."""
    parts = np.empty((size, len(pairs.number)))
    first = 0
    at = 0
    for block in blocks:
        chosen = pairs.chosen[first : first + len(block)]
        # indices are four times faster than a mask
        found = block.reshape(chosen.size, -1)[np.flatnonzero(chosen)]
        parts[:, at : at + len(found)] = found.T
        first += len(block)
        at += len(found)
    return np.array([np.bincount(pairs.number, part) for part in parts])


def nodal_stress(
    mesh: PlaneMesh,
    plate: Plate,
    fields: Array,
    chosen: Index | None = None,
    layers: Layers | None = None,
    strain: Callable[[Array], Array] | None = None,
    part: int | None = None,
) -> Array:
    """Stress (..., c, 2, 2), MPa, at nodes of fields (..., n, 2), mm, averaged over the elements.

    chosen : (c,), nodes, by default all.
    layers : with them the stress is (..., c, m, 3, 3), and fields are (..., n, m, 3).
    strain : function of displacement gradients, by default their symmetric part.
    part : of a plate with different materials, the body whose elements alone count, and whose nodes
        are chosen: the stress is not continuous between materials.
    """
    line = (layers or sheet(plate.thickness)).at_nodes
    count = len(mesh.nodes)
    chosen = np.arange(count) if chosen is None else chosen
    own = mesh.bodies == part if plate.mixed and part is not None else np.ones(1, dtype=np.bool_)
    near = np.zeros(count, dtype=np.bool_)
    near[chosen] = True
    numbers = np.flatnonzero(near[mesh.triangles].any(axis=1) & own)
    components = len(line.heights) * line.axes
    flat = fields.reshape(-1, count, components)
    total = _summed_stress(mesh, plate, line, flat, numbers, strain)
    adjacent = np.bincount(mesh.triangles[numbers].ravel(), minlength=count)[chosen]
    mean = (total[chosen] / adjacent[:, None]).reshape(len(chosen), len(flat), -1)
    through = () if layers is None else (len(line.heights),)
    lead = fields.shape[: -2 - len(through)]
    shape = (*lead, len(chosen), *through, line.axes, line.axes)
    return np.asarray(np.moveaxis(mean, 1, 0).reshape(shape))


def _summed_stress(
    mesh: PlaneMesh,
    plate: Plate,
    line: Layers,
    fields: Array,
    numbers: Index,
    strain: Callable[[Array], Array] | None,
) -> Array:
    """Sums (n, k m d d) over triangles of the stress at their nodes, of fields (k, n, m d).

    line : at its nodes.   numbers : of the triangles.   strain : as of `nodal_stress`.
    """
    d = line.axes
    m = len(line.heights)
    total = np.zeros((len(mesh.nodes), fields[:, 0].size * d))
    for start in range(0, len(numbers), CACHED):
        some = numbers[start : start + CACHED]
        triangles = mesh.triangles[some]
        slopes_of_phi = gradients(mesh.nodes[triangles], NODES)[0]
        unweighted = np.empty((len(triangles), 0))
        batch = ElementBatch(triangles, slopes_of_phi, unweighted, np.eye(6))
        slopes = batch.slopes(line, fields)
        strains = slopes if strain is None else strain(slopes)
        stress = stress_tensor(plate.of(some), strains).reshape(len(fields), -1, d, d, 6, m)
        own, assembly = batch.assembly(len(mesh.nodes))
        by_node = stress.transpose(1, 4, 0, 5, 2, 3).reshape(triangles.size, -1)
        total[own] += assembly @ by_node
    return total


def part_stresses(
    mesh: PlaneMesh,
    plate: Plate,
    fields: Array,
    nodes_of: Sequence[Index],
    numbers: Sequence[int],
    layers: Layers | None = None,
    strain: Callable[[Array], Array] | None = None,
) -> list[Array]:
    """Return the stress as `nodal_stress` at the nodes of each of several parts.

    numbers : of the parts, those of `bodies` of the mesh.

    Of a plate of one material all adjoining elements count, otherwise those of the part alone.
    """
    if not len(nodes_of):
        return []
    if plate.mixed:
        pairs = zip(nodes_of, numbers, strict=True)
        return [
            nodal_stress(mesh, plate, fields, nodes, layers, strain, part) for nodes, part in pairs
        ]
    used = np.unique(np.concatenate(nodes_of))
    stress = nodal_stress(mesh, plate, fields, used, layers, strain)
    after = fields.ndim - (2 if layers is None else 3)
    return [np.take(stress, np.searchsorted(used, nodes), axis=after) for nodes in nodes_of]
