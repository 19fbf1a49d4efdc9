"""From element matrices to sparse equations, as lower triangles: every pair of nodes is sorted once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.plane_stress import ElementBatch, Plate, element_matrices

FIRST, SECOND = np.tril_indices(6)  # the 21 pairs of a triangle's nodes
ENTRIES = np.ravel_multi_index(
    (FIRST[:, None], [0, 0, 1, 1], SECOND[:, None], [0, 1, 0, 1]), (6, 2, 6, 2)
).ravel()  # of their 2 x 2 blocks in an element matrix
CACHED = 400  # triangles whose matrices are made at once: they fit a processor's cache, and memory is used again


LOWER = np.tril_indices(12)  # the 78 pairs of a triangle's degrees of freedom


def tied_lower(batches: list[ElementBatch], plate: Plate, number: Index, rigid: sp.csr_array) -> sp.csc_array:
    """Lower triangle (2 free + 3, 2 free + 3) of the stiffness matrix, N/mm, after some nodes are tied to a pose.

    number : (n,), free nodes counted first, then those tied; -1 for a node left out (held at zero).
    rigid : (2 tied, 3), displacement of the tied nodes per pose: with u = T q, the lower triangle of T' K T.
    """
    free = int(number.max()) + 1 - rigid.shape[0] // 2
    pieces = [piece for batch in batches for piece in (_beside(batch, number, free), _off(batch, number, free))]
    parts = [_entries(off, plate, number) for off in pieces[1::2]]
    parts += [_tied_entries(_entries(beside, plate, number), free, rigid) for beside in pieces[::2]]
    values, rows, columns = (np.concatenate(part) for part in zip(*parts, strict=True))
    found = sp.coo_array((values, (rows, columns)), shape=(2 * free + 3, 2 * free + 3)).tocsc()
    found.sort_indices()
    return found


def _beside(batch: ElementBatch, number: Index, free: int) -> ElementBatch:
    """The triangles that have a tied node."""
    return batch.where(np.any(number[batch.triangles] >= free, axis=1))


def _off(batch: ElementBatch, number: Index, free: int) -> ElementBatch:
    """The triangles that have none."""
    return batch.where(np.all(number[batch.triangles] < free, axis=1))


def _entries(batch: ElementBatch, plate: Plate, number: Index) -> tuple[Array, Index, Index]:
    """Entries of the lower triangle, triangle by triangle: values (78 e,), rows and columns."""
    nodes = 2 * number[batch.triangles].astype(np.int32)
    dofs = (nodes[:, :, None] + np.array([0, 1], dtype=np.int32)).reshape(-1, 12)
    one, other = dofs[:, LOWER[0]].ravel(), dofs[:, LOWER[1]].ravel()
    rows, columns = np.maximum(one, other), np.minimum(one, other)
    values, done = np.empty((len(dofs), 78)), 0
    for piece in batch.pieces(CACHED):
        matrices = element_matrices(piece, plate).reshape(-1, 144)
        values[done : done + len(matrices)] = matrices[:, 12 * LOWER[0] + LOWER[1]]
        done += len(matrices)
    held = columns < 0
    if not held.any():
        return values.ravel(), rows, columns
    return values.ravel()[~held], rows[~held], columns[~held]


def _tied_entries(entries: tuple[Array, Index, Index], free: int, rigid: sp.csr_array) -> tuple[Array, Index, Index]:
    """Entries of T' K T from those of K."""
    values, rows, columns = entries
    size = 2 * free + rigid.shape[0]
    lower = sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsr()
    T = sp.block_diag([sp.eye_array(2 * free), rigid], format="csr")
    tied = sp.tril(T.T @ (lower + sp.tril(lower, -1).T) @ T).tocoo()
    return tied.data, tied.coords[0], tied.coords[1]


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
    turned : (21 m,), pairs of the triangles, one after the other, that are to be transposed.
    order, start : the pairs sorted, and where each block begins among them; pairs left out come last, from `start[-1]`.
    """

    rows: Index
    columns: Index
    turned: AnyArray
    order: Index
    start: Index


def blocks(batches: list[ElementBatch], plate: Plate, number: Index) -> Blocks:
    """Sum the element matrices node pair by node pair.

    number : (n,), the number under which each node of the mesh is assembled, -1 for a node left out (held at zero).
    """
    pieces = (piece for batch in batches for piece in batch.pieces(CACHED))
    return summed(pairing(batches, number), (element_matrices(piece, plate) for piece in pieces))


def pairing(batches: list[ElementBatch], number: Index) -> Pairing:
    """Sort the node pairs of all triangles; `number` as for `blocks`."""
    count = int(number.max()) + 1
    nodes = number[np.concatenate([batch.triangles for batch in batches])]
    one, other = nodes[:, FIRST].ravel(), nodes[:, SECOND].ravel()
    key = np.minimum(one, other) * count + np.maximum(one, other)
    key[(one < 0) | (other < 0)] = count * count
    order = np.argsort(key)
    key = key[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    whole = key[start] < count * count
    columns, rows = np.divmod(key[start[whole]], count)
    return Pairing(rows, columns, one < other, order, start)


def summed(pairs: Pairing, matrices: Iterable[Array]) -> Blocks:
    """Sum symmetric element matrices (e, 6, 2, 6, 2), in the order of the triangles, node pair by node pair."""
    values, done = np.empty((len(pairs.order), 4)), 0
    for matrix in matrices:
        piece = values[done : done + len(matrix) * len(FIRST)].reshape(len(matrix), -1)
        np.take(matrix.reshape(len(matrix), -1), ENTRIES, axis=1, out=piece, mode="clip")  # else `out` is copied
        done += len(matrix) * len(FIRST)
    values[pairs.turned, 1:3] = values[pairs.turned, 2:0:-1]
    total = np.add.reduceat(values[pairs.order], pairs.start, axis=0)[: len(pairs.rows)]
    return Blocks(pairs.rows, pairs.columns, total.reshape(-1, 2, 2))


def lower_triangle(pairs: Blocks, size: int) -> sp.coo_array:
    """The blocks as the lower triangle (2 size, 2 size) of degrees of freedom x, y node by node."""
    below = np.ones((len(pairs.rows), 4), dtype=bool)
    below[pairs.rows == pairs.columns, 1] = False  # the entry right of the diagonal
    rows = (2 * pairs.rows[:, None] + np.array([0, 0, 1, 1]))[below]
    columns = (2 * pairs.columns[:, None] + np.array([0, 1, 0, 1]))[below]
    return sp.coo_array((pairs.values.reshape(-1, 4)[below], (rows, columns)), shape=(2 * size, 2 * size))


def stiffness_matrix(batches: list[ElementBatch], plate: Plate, nodes: int) -> sp.csc_array:
    """Stiffness matrix (2n, 2n), N/mm, of all nodes, degrees of freedom x, y node by node."""
    lower = lower_triangle(blocks(batches, plate, np.arange(nodes)), nodes).tocsc()
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
    parts = [(inside, 0, 0), ((rigid.T @ coupling).tocoo(), 2 * free, 0), (pose.tocoo(), 2 * free, 2 * free)]
    values = np.concatenate([part.data for part, _, _ in parts])
    rows = np.concatenate([part.coords[0] + down for part, down, _ in parts])
    columns = np.concatenate([part.coords[1] + right for part, _, right in parts])
    return sp.coo_array((values, (rows, columns)), shape=(2 * free + 3, 2 * free + 3))
