"""Cyclic symmetry: a structure of three alike sectors by one, condensed onto its cuts and the pose of the hub.

Of harmonic 0 all sectors move alike, each in its own frame; of harmonic 1 sector c moves as `e^(2 pi i c / 3) u_0`,
whose real and imaginary parts are two motions: unit vectors in x and y together, (1, i), are of harmonic 1. With `b`
the displacements of the cuts and the pose, `i` all others of a sector, and `b = T_h q` as harmonic h lets them move,

    S = K_bb - K_bi K_ii^-1 K_ib,    A_h = T_h* S T_h.

Sectors that differ are welded and solved at once, which is faster than condensing each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import Layers, Plate
from flexfem.fem.factor import Condensed, condense, dense, factorise
from flexfem.fem.mesh import Sector, joined
from flexfem.fem.structure import Structure, structure
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

    def answer(self, loads: Array) -> Array:
        """Unknowns (m, k) under loads (m, k)."""
        return self.spread(self.solve(self.gathered(loads)))


def every_motion(of: Structure) -> Space:
    """The unknowns of a structure as they are. Raises ComputationFailed as `Structure.lower` and `factorise`."""
    return Space(of.size, float, np.asarray, np.asarray, factorise(of.lower()))


class Chains(NamedTuple):
    """A stage by its sectors: the structure that is solved, one sector of three alike or the whole.

    places : where the nodes of each chain's sector are in a whole.
    spaces : of the harmonics 0 and 1 of one sector, whose unknowns are counted inside first, then on the cut behind,
        the cut ahead, and the pose; or of the whole.
    unknowns : number of equations of the whole.
    """

    of: Structure
    places: list[Index]
    spaces: tuple[Space, ...]
    unknowns: int

    @property
    def alike(self) -> bool:
        """Whether one sector stands for three."""
        return not self.places

    def solve(self, loads: Array) -> Array:
        """Unknowns (m, k) under loads (m, k); three of a sector, turned by sectors as the vector x, y, theta."""
        if not self.alike:
            return self.spaces[0].answer(loads)
        return np.hstack([self.spaces[1].answer(loads[:, :2]), self.spaces[0].answer(loads[:, 2:])])

    def sector_fields(self, fields: Array) -> tuple[Array, ...]:
        """Fields (k, n, ...) of the sectors, each in the frame of chain 1, from those of the structure."""
        if self.alike:
            return (fields,)
        return tuple(turned_fields(fields[:, place], -chain) for chain, place in enumerate(self.places))


def by_sectors(
    sectors: tuple[Sector, ...], plate: Plate, layers: Layers | None = None, degree: int | None = None
) -> Chains:
    """Factorise a stage, by one alike sector or as a whole.

    Raises ComputationFailed as `Structure.lower`, or when a part is not held.
    """
    if len(sectors) == 3:
        mesh, places = joined(sectors)
        of = structure(mesh, plate, layers, degree)
        return Chains(of, places, (every_motion(of),), of.size)
    (sector,) = sectors
    of = structure(sector.mesh, plate, layers, degree, last=np.concatenate([sector.behind, sector.ahead]))
    cut = len(sector.ahead) * len(of.line.kept)
    condensed = condense(of.lower(), 2 * cut + 3)
    spaces = (_harmonic(of, condensed, len(sector.ahead), 0), _harmonic(of, condensed, len(sector.ahead), 1))
    return Chains(of, [], spaces, 3 * (of.size - cut) - 6)


def _harmonic(of: Structure, condensed: Condensed, nodes: int, harmonic: int) -> Space:
    """Coordinates: the unknowns inside a sector, on its cut behind, and the pose that goes with the harmonic.

    nodes : of a cut in the plane.
    """
    T = _tie(of, nodes, harmonic)
    inner, solve_edge = of.size - len(T), dense(T.conj().T @ condensed.schur @ T)

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
        inside, edge = condensed.reduced(apart(np.concatenate([b[:inner], np.zeros((len(T), b.shape[1]))])))
        moved = solve_edge(b[inner:] + T.conj().T @ together(edge))
        found = condensed.expanded(inside, apart(T @ moved))
        return np.concatenate([together(found[:inner]), moved])

    return Space(inner + T.shape[1], T.dtype.type, spread, gathered, solve)


def _tie(of: Structure, nodes: int, harmonic: int) -> AnyArray:
    """T_h (2 c + 3, c + 1) of a cut of so many nodes of the plane, from a cut and the harmonic's pose.

    The cut ahead is the cut behind of the next sector. Of three freedoms of the hub the turn leaves one as it is,
    theta or z, and turns the others as a vector, of which `(1, i)` is multiplied by `e^(-2 pi i / 3)`.
    """
    each, vectors = np.eye(len(of.line.kept)), len(of.line.heights) - len(of.line.fixed)  # with u, v
    each[: 2 * vectors, : 2 * vectors] = np.kron(np.eye(vectors), chain_rotation(1)[:2, :2])
    spin, phase = np.kron(np.eye(nodes), each), np.exp(1j * CHAIN_TURN) if harmonic else 1.0
    c = len(spin)
    T = np.zeros((2 * c + 3, c + 1), dtype=complex if harmonic else float)
    T[:c, :c], T[c : 2 * c, :c] = np.eye(c), phase * spin
    if harmonic:
        T[2 * c + of.turning[:2], -1] = 1.0, 1j
    else:
        T[2 * c + of.turning[2], -1] = 1.0
    return T


def under_loads(values: Sequence[Array]) -> list[Array]:
    """Values (3 cases, ...) of three chains, each in the frame of chain 1, from those of one or three sectors.

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
