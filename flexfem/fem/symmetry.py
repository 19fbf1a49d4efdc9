"""Cyclic symmetry: three sectors, solved by one condensed onto its cuts and the pose of the hub.

In harmonic 0 all sectors move identically, each in its own frame; in harmonic 1 sector c moves as
`e^(2 pi i c / 3) u_0`, whose real and imaginary parts are two motions: the vector (1, i) of unit
motions in x and y is of harmonic 1. With `b` the unknowns of cuts and pose, `i` all others of a
sector, and the constraint `b = T_h q` of harmonic h,

    S = K_bb - K_bi K_ii^-1 K_ib,    A_h = T_h* S T_h.

Different sectors are welded and solved as a whole, which is faster than condensing each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.factor import Condensed, condense, dense
from flexfem.fem.mesh import SECTOR_TURN, SECTORS, sector_rotation
from flexfem.fem.structure import Structure


class Space(NamedTuple):
    """A space of motions, described by `size` coordinates of a real or complex `dtype`.

    expand : coordinates (size, k) -> unknowns (m, k), or (m, 2 k) if complex: real parts, then
        imaginary parts.
    project : its transpose, from loads on the unknowns.
    solve : inverse of the stiffness of the coordinates.
    """

    size: int
    dtype: type
    expand: Callable[[AnyArray], Array]
    project: Callable[[Array], AnyArray]
    solve: Callable[[AnyArray], AnyArray]

    def solution(self, loads: Array) -> Array:
        """Unknowns (m, k) under loads (m, k)."""
        return self.expand(self.solve(self.project(loads)))


def full_space(structure: Structure) -> Space:
    """Return the space of all unknowns. Raises ComputationFailed as `Structure.factorised`."""
    return Space(structure.size, float, np.asarray, np.asarray, structure.factorised())


def harmonic_spaces(sector: Structure, nodes: int) -> tuple[Space, Space]:
    """Condense a sector and return the spaces of harmonics 0 and 1.

    Its unknowns are ordered interior, cut behind, cut ahead, pose.

    nodes : number of nodes of a cut in the plane. Raises ComputationFailed as `Structure.lower`, or
        when a part is not held.
    """
    condensed = condense(sector.lower(), 2 * nodes * sector.block + 3, sector.order(2 * nodes))
    alike = _harmonic_space(sector, condensed, nodes, 0)
    return alike, _harmonic_space(sector, condensed, nodes, 1)


def _harmonic_space(
    structure: Structure,
    condensed: Condensed,
    nodes: int,
    harmonic: int,
) -> Space:
    """Space of a harmonic.

    Its coordinates are the unknowns inside a sector and on its cut behind, then one of the pose.
    """
    T = _cut_constraint(structure, nodes, harmonic)
    inner = structure.size - len(T)
    solve_boundary = dense(T.conj().T @ condensed.schur @ T)

    def split(values: AnyArray) -> Array:
        return np.hstack([values.real, values.imag]) if harmonic else np.asarray(values)

    def merge(values: Array) -> AnyArray:
        if not harmonic:
            return values
        real, imaginary = np.split(values, 2, axis=1)
        return np.asarray(real + 1j * imaginary)

    def expand(coordinates: AnyArray) -> Array:
        return split(np.concatenate([coordinates[:inner], T @ coordinates[inner:]]))

    def project(loads: Array) -> AnyArray:
        merged = merge(loads)
        return np.concatenate([merged[:inner], T.conj().T @ merged[inner:]])

    def solve(b: AnyArray) -> AnyArray:
        no_boundary = np.zeros((len(T), b.shape[1]))
        inside, edge = condensed.reduced(split(np.concatenate([b[:inner], no_boundary])))
        boundary = solve_boundary(b[inner:] + T.conj().T @ merge(edge))
        unknowns = condensed.expanded(inside, split(T @ boundary))
        return np.concatenate([merge(unknowns[:inner]), boundary])

    return Space(inner + T.shape[1], T.dtype.type, expand, project, solve)


def _cut_constraint(
    structure: Structure,
    nodes: int,
    harmonic: int,
) -> AnyArray:
    """Return T_h (2 c + 3, c + 1), from cut behind and a pose coordinate to both cuts and the pose.

    The cut ahead is the cut behind of the next sector. A rotation by one sector leaves one freedom
    of the hub, theta or z, invariant and rotates the other two as a vector, of which `(1, i)` is
    multiplied by `e^(-2 pi i / 3)`."""
    line = structure.line
    node = np.eye(len(line.free_components))
    vectors = len(line.heights) - len(line.fixed)  # nodes with free u, v
    node[: 2 * vectors, : 2 * vectors] = np.kron(np.eye(vectors), sector_rotation(1)[:2, :2])
    rotation = np.kron(np.eye(nodes), node)
    phase = np.exp(1j * SECTOR_TURN) if harmonic else 1.0
    c = len(rotation)
    T = np.zeros((2 * c + 3, c + 1), dtype=complex if harmonic else float)
    T[:c, :c] = np.eye(c)
    T[c : 2 * c, :c] = phase * rotation
    if harmonic:
        T[2 * c + structure.vector_first[:2], -1] = 1.0, 1j
    else:
        T[2 * c + structure.vector_first[2], -1] = 1.0
    return T


def sector_values(values: Sequence[Array]) -> list[Array]:
    """Values (3 cases, ...) of three sectors, each in its own frame, from those of one or three.

    Sector s of identical ones responds to a case as the first to the case rotated back by s
    sectors.
    """
    if len(values) == SECTORS:
        return list(values)
    turns = [sector_rotation(sector) for sector in range(SECTORS)]
    return [np.tensordot(turn, values[0], axes=1) for turn in turns]


def whole_fields(
    nodes: int,
    sector_nodes: list[Index],
    parts: Sequence[Array],
) -> Array:
    """Fields (k, nodes, ...) of the whole mesh from those of its sectors, each in its own frame.

    Vectors have two or three components.
    """
    fields = np.empty((len(parts[0]), nodes, *parts[0].shape[2:]))
    for sector, (numbers, part) in enumerate(zip(sector_nodes, parts, strict=True)):
        axes = part.shape[-1]
        fields[:, numbers] = part @ sector_rotation(sector)[:axes, :axes].T
    return fields
