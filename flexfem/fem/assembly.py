"""From element matrices to the lower triangle of a sparse matrix, whose nodes may be tied to a rigid motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.plane_stress import ElementBatch, Plate, element_matrices

CACHED = 400  # triangles whose matrices are made at once: they fit a processor's cache, and memory is used again
FREE = np.tril_indices(12)  # the 78 pairs of a triangle's degrees of freedom
TIED = np.tril_indices(15)  # the 120 pairs of these and of the pose


def matrices_of(batches: list[ElementBatch], plate: Plate) -> Iterator[Array]:
    """Element stiffness matrices (e, 6, 2, 6, 2), N/mm, some triangles at a time."""
    return (element_matrices(piece, plate) for batch in batches for piece in batch.pieces(CACHED))


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
    beside = np.flatnonzero(np.any(nodes >= free, axis=1))
    all_values, plain = np.empty(78 * len(nodes) + 120 * len(beside)), 78 * len(nodes)
    values, whole, first = all_values[:plain].reshape(-1, 78), np.empty((len(beside), 6, 2, 6, 2)), 0
    for part in matrices:
        last = first + len(part)
        np.take(part.reshape(-1, 144), 12 * FREE[0] + FREE[1], axis=1, out=values[first:last], mode="clip")
        here = slice(*np.searchsorted(beside, [first, last]))
        whole[here], first = part[beside[here] - first], last
    tied = nodes[beside]
    nodes[beside] = -1
    all_values[plain:] = _tied_values(whole, tied, free, rigid)
    dofs = (2 * nodes[:, :, None] + np.arange(2, dtype=np.int32)).reshape(-1, 12)
    pose = np.broadcast_to(2 * free + np.arange(3, dtype=np.int32), (len(tied), 3))
    on_hub = np.where(tied < free, 2 * tied, -2)[:, :, None] + np.arange(2, dtype=np.int32)
    places = zip(_places(dofs, FREE), _places(np.hstack([on_hub.reshape(-1, 12), pose]), TIED), strict=True)
    rows, columns = (np.concatenate(each) for each in places)
    out = columns < 0
    all_values[out] = rows[out] = columns[out] = 0
    size = 2 * free + (3 if len(rigid) else 0)
    return sp.coo_array((all_values, (rows, columns)), shape=(size, size))


def _tied_values(matrices: Array, nodes: AnyArray, free: int, rigid: Array) -> Array:
    """Values (120 e,) of triangles (e, 6) with tied nodes, by the lower triangle of their unknowns and the pose."""
    T, tied = np.zeros((len(nodes), 6, 2, 15)), nodes >= free
    T.reshape(-1, 12, 15)[:, np.arange(12), np.arange(12)] = np.repeat(~tied, 2, axis=1)
    T[tied, :, 12:] = rigid.reshape(-1, 2, 3)[nodes[tied] - free]
    found = np.einsum("eiap,eiajb,ejbq->epq", T, matrices, T, optimize=True)
    return np.asarray(found[:, TIED[0], TIED[1]].ravel())


def _places(dofs: AnyArray, pairs: tuple[Index, Index]) -> tuple[AnyArray, AnyArray]:
    """Rows and columns of pairs of the degrees of freedom (e, d) of triangles, rows >= columns."""
    one, other = (np.take(dofs, pair, axis=1).ravel() for pair in pairs)
    return np.maximum(one, other), np.minimum(one, other, out=other)


def stiffness_matrix(batches: list[ElementBatch], plate: Plate, nodes: int) -> sp.csc_array:
    """Stiffness matrix (2n, 2n), N/mm, of all nodes, degrees of freedom x, y node by node."""
    triangles = np.concatenate([batch.triangles for batch in batches])
    lower = tied_lower(triangles, matrices_of(batches, plate), np.arange(nodes), np.empty((0, 3))).tocsc()
    return (lower + sp.tril(lower, -1).T).tocsc()
