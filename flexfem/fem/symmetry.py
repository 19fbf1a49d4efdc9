"""Cyclic symmetry: a structure of three alike sectors by one, condensed onto its cuts and the pose of the hub.

Of harmonic 0 all sectors move alike, each in its own frame; of harmonic 1 sector c moves as `e^(2 pi i c / 3) u_0`,
whose real and imaginary parts are two motions. Unit vectors in x and y together, (1, i), are of harmonic 1. With `b`
the displacements of the cuts and the pose, `i` all others of a sector, and `b = T_h q` as harmonic h lets them move,

    S = K_bb - K_bi K_ii^-1 K_ib,    A_h = T_h* S T_h.

Sectors that differ are welded and solved at once: condensing each takes longer, because its factor must be made a
second time once the part that belongs to the boundary has been taken out of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import Layers, Plate
from flexfem.fem.factor import Condensed, Solve, condense, dense, factorise
from flexfem.fem.mesh import Sector
from flexfem.fem.structure import Structure, Tied, structure, tie_hub
from flexfem.mechanism.designs import CHAIN_TURN, chain_rotation


class Space(NamedTuple):
    """Motions among which an answer is sought, by `size` coordinates, real or, of `kind`, complex.

    spread : coordinates (size, k) -> unknowns (m, k), of complex ones (m, 2 k): real parts, then imaginary ones.
    gathered : its transpose, from loads on the unknowns.   solve : by the stiffness of the coordinates.
    """

    size: int
    kind: type
    spread: Callable[[AnyArray], Array]
    gathered: Callable[[Array], AnyArray]
    solve: Callable[[AnyArray], AnyArray]


def every_motion(of: Structure) -> Space:
    """The unknowns of a structure as they are."""
    return Space(of.size, float, np.asarray, np.asarray, factorise(of.lower()))


class Cyclic(NamedTuple):
    """A sector whose unknowns are counted inside first, then on the cut behind, the cut ahead, and the pose.

    ties : T_h (2 c + 3, c + 1) of harmonics 0 and 1, from a cut and the harmonic's pose to both cuts and the pose.
    edges : of both, solves by A_h.
    """

    sector: Structure
    condensed: Condensed
    ties: tuple[AnyArray, AnyArray]
    edges: tuple[Solve, Solve]

    @property
    def unknowns(self) -> int:
        """Number of equations of the whole."""
        return 3 * self.sector.size - 3 * int(self.ties[0].shape[1]) - 3

    def solve(self, loads: Array) -> Array:
        """Unknowns (m, 3) of the sector under its part of loads (m, 3), turned by sectors as the vector x, y, theta."""
        (T, turn), (solve, solve_turning) = self.ties, self.edges
        inside, edge = self.condensed.reduced(loads)
        pair = turn @ solve_turning(turn.conj().T @ (edge[:, :1] + 1j * edge[:, 1:2]))
        return self.condensed.expanded(inside, np.hstack([pair.real, pair.imag, T @ solve(T.T @ edge[:, 2:])]))

    def space(self, harmonic: int) -> Space:
        """Coordinates: the unknowns inside a sector, on its cut behind, and the pose that goes with the harmonic."""
        T, solve_edge = self.ties[harmonic], self.edges[harmonic]
        inner = self.sector.size - len(T)

        def apart(values: AnyArray) -> Array:
            return np.hstack([values.real, values.imag]) if harmonic else np.asarray(values)

        def together(values: Array) -> AnyArray:
            if not harmonic:
                return values
            real, imaginary = np.split(values, 2, axis=1)
            return np.asarray(real + 1j * imaginary)

        def spread(coordinates: AnyArray) -> Array:
            return apart(np.concatenate([coordinates[:inner], T @ coordinates[inner:]]))

        def gathered(loads: Array) -> AnyArray:
            found = together(loads)
            return np.concatenate([found[:inner], T.conj().T @ found[inner:]])

        def solve(b: AnyArray) -> AnyArray:
            inside, edge = self.condensed.reduced(apart(np.concatenate([b[:inner], np.zeros((len(T), b.shape[1]))])))
            moved = solve_edge(b[inner:] + T.conj().T @ together(edge))
            found = self.condensed.expanded(inside, apart(T @ moved))
            return np.concatenate([together(found[:inner]), moved])

        return Space(inner + T.shape[1], T.dtype.type, spread, gathered, solve)


def cyclic(sector: Sector, plate: Plate, layers: Layers | None = None, degree: int | None = None) -> Cyclic:
    """Condense an alike sector. Raises ComputationFailed as `Structure.lower`, or when a part is not held."""
    of = structure(sector.mesh, plate, layers, tie_sector(sector), degree)
    c = len(sector.ahead) * of.unknowns_of_node
    condensed = condense(of.lower(), 2 * c + 3)
    one, other = (_tie(of, len(sector.ahead), harmonic) for harmonic in (0, 1))
    solves = [dense(T.conj().T @ condensed.schur @ T) for T in (one, other)]
    return Cyclic(of, condensed, (one, other), (solves[0], solves[1]))


def tie_sector(sector: Sector) -> Tied:
    """Unknowns of a sector, those on its cuts and the pose last."""
    return tie_hub(sector.mesh, np.concatenate([sector.behind, sector.ahead]))


def _tie(of: Structure, nodes: int, harmonic: int) -> AnyArray:
    """T_h of a cut of so many nodes of the plane.

    Notes
    -----
    The cut ahead is the cut behind of the next sector. Of three freedoms of the hub the turn leaves one as it is,
    theta or z, and turns the others as a vector, of which `(1, i)` is multiplied by `e^(-2 pi i / 3)`.
    """
    spin = _spin(of.layers, nodes)
    c, phase = len(spin), np.exp(1j * CHAIN_TURN) if harmonic else 1.0
    T = np.zeros((2 * c + 3, c + 1), dtype=complex if harmonic else float)
    T[:c, :c], T[c : 2 * c, :c] = np.eye(c), phase * spin
    if harmonic:
        T[2 * c + of.turning[:2], -1] = 1.0, 1j
    else:
        T[2 * c + of.turning[2], -1] = 1.0
    return T


def _spin(layers: Layers | None, nodes: int) -> Array:
    """Matrix that turns the unknowns of so many nodes of the plane by 120 degrees."""
    vectors, scalars = (1, 0) if layers is None else (len(layers.moving), len(layers.lifted))
    size = 2 * vectors + scalars
    each = np.eye(size)
    each[: 2 * vectors, : 2 * vectors] = np.kron(np.eye(vectors), chain_rotation(1)[:2, :2])
    return np.asarray(np.kron(np.eye(nodes), each))


def under_loads(values: Sequence[Array]) -> list[Array]:
    """Values (3 cases, ...) of three chains, each in the frame of chain 1, from those of one or three sectors.

    Notes
    -----
    Chain c of three alike answers a case as chain 1 does the case turned back by c turns.
    """
    if len(values) == 3:
        return list(values)
    return [np.tensordot(chain_rotation(chain), values[0], axes=1) for chain in range(3)]


def turned_fields(values: Array, chain: int) -> Array:
    """Vectors (..., 2) or (..., 3) in the frame of chain 1 turned to a chain, from 0; a negative one turns back."""
    axes = values.shape[-1]
    return values @ chain_rotation(chain)[:axes, :axes].T


def whole_fields(nodes: int, places: list[Index], parts: Sequence[Array]) -> Array:
    """Fields (k, nodes, ...) of a whole mesh, by those of each chain's sector in its own frame."""
    found = np.empty((len(parts[0]), nodes, *parts[0].shape[2:]))
    for chain, (place, part) in enumerate(zip(places, parts, strict=True)):
        found[:, place] = turned_fields(part, chain)
    return found
