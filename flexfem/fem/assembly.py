"""From element matrices to sparse equations, as lower triangles: every pair of nodes is sorted once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.plane_stress import Plate, Strip, element_matrices

FIRST, SECOND = np.tril_indices(6)  # the 21 pairs of a triangle's nodes


class Blocks(NamedTuple):
    """Lower triangle of a symmetric matrix as 2 x 2 blocks, column by column.

    rows, columns : (p,), node numbers, rows >= columns.
    values : (p, 2, 2), N/mm.
    """

    rows: Index
    columns: Index
    values: Array

    def where(self, chosen: AnyArray) -> Blocks:
        """The blocks for which `chosen` (p,) holds."""
        return Blocks(self.rows[chosen], self.columns[chosen], self.values[chosen])


class Pairing(NamedTuple):
    """Where the entries of element matrices go; found once for a mesh, whatever the matrices.

    rows, columns : (p,), as in `Blocks`.
    kept, turned : one (21, e) for every strip: pairs that are assembled, pairs to be transposed.
    order, start : the kept pairs of all strips sorted, and where each block begins among them.
    """

    rows: Index
    columns: Index
    kept: list[AnyArray]
    turned: list[AnyArray]
    order: Index
    start: Index


def blocks(strips: list[Strip], plate: Plate, number: Index) -> Blocks:
    """Sum the element matrices node pair by node pair.

    number : (n,), the number under which each node of the mesh is assembled, -1 for a node left out (held at zero).
    """
    return summed(pairing(strips, number), (element_matrices(strip, plate) for strip in strips))


def pairing(strips: list[Strip], number: Index) -> Pairing:
    """Sort the node pairs of all triangles; `number` as for `blocks`."""
    count = int(number.max()) + 1
    keys, kept, turned = [], [], []
    for strip in strips:
        one, other = number[strip.triangles[:, FIRST]].T, number[strip.triangles[:, SECOND]].T
        kept.append((one >= 0) & (other >= 0))
        turned.append(one < other)
        keys.append((np.minimum(one, other) * count + np.maximum(one, other))[kept[-1]])
    key = np.concatenate(keys)
    order = np.argsort(key)
    key = key[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    columns, rows = np.divmod(key[start], count)
    return Pairing(rows, columns, kept, turned, order, start)


def summed(pairs: Pairing, matrices: Iterable[Array]) -> Blocks:
    """Sum symmetric element matrices (e, 6, 2, 6, 2), one array for every strip, node pair by node pair."""
    parts = []
    for matrix, kept, turned in zip(matrices, pairs.kept, pairs.turned, strict=True):
        k = matrix[:, FIRST, :, SECOND, :]  # (21 pairs, e, 2, 2)
        parts.append(np.where(turned[..., None, None], k.swapaxes(-1, -2), k)[kept])
    values = np.add.reduceat(np.concatenate(parts).reshape(-1, 4)[pairs.order], pairs.start, axis=0)
    return Blocks(pairs.rows, pairs.columns, values.reshape(-1, 2, 2))


def lower_triangle(pairs: Blocks, size: int) -> sp.coo_array:
    """The blocks as the lower triangle (2 size, 2 size) of degrees of freedom x, y node by node."""
    rows = 2 * pairs.rows[:, None, None] + np.array([[0, 0], [1, 1]])
    columns = 2 * pairs.columns[:, None, None] + np.array([[0, 1], [0, 1]])
    below = rows >= columns
    return sp.coo_array((pairs.values[below], (rows[below], columns[below])), shape=(2 * size, 2 * size))


def stiffness_matrix(strips: list[Strip], plate: Plate, nodes: int) -> sp.csc_array:
    """Stiffness matrix (2n, 2n), N/mm, of all nodes, degrees of freedom x, y node by node."""
    lower = lower_triangle(blocks(strips, plate, np.arange(nodes)), nodes).tocsc()
    return (lower + sp.tril(lower, -1).T).tocsc()


def with_rigid_part(pairs: Blocks, free: int, rigid: sp.csr_array) -> sp.coo_array:
    """Lower triangle (2 free + 3, 2 free + 3) after the nodes from `free` on are tied to a pose.

    rigid : (2 tied, 3), displacement of the tied nodes per pose: with u = T q, the rows and columns of T' K T.
    """
    inside = lower_triangle(pairs.where(pairs.rows < free), free)
    across = pairs.where((pairs.rows >= free) & (pairs.columns < free))
    held = pairs.where(pairs.columns >= free)
    rows = (2 * (across.rows[:, None, None] - free) + np.array([[0, 0], [1, 1]])).ravel()
    columns = (2 * across.columns[:, None, None] + np.array([[0, 1], [0, 1]])).ravel()
    coupling = sp.coo_array((across.values.ravel(), (rows, columns)), shape=(rigid.shape[0], 2 * free))
    below = lower_triangle(Blocks(held.rows - free, held.columns - free, held.values), rigid.shape[0] // 2)
    pose = sp.tril(rigid.T @ (below + sp.tril(below, -1).T) @ rigid)
    return sp.block_array([[inside, None], [rigid.T @ coupling, pose]], format="coo")
