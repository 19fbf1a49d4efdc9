"""Motions of an extruded stage with three alike chains, by one sector: the same in all chains, or turning with them.

Of harmonic 0 all chains move alike, each in its own frame; of harmonic 1 chain c moves as `u_c = e^(2 pi i c / 3) u_0`,
and the real and imaginary parts are two motions. Unit vectors in x and y together, (1, i), are of harmonic 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.fem.factor import Condensed, dense
from flexfem.fem.layers import Layers
from flexfem.fem.solid import Solid
from flexfem.mechanism.designs import CHAIN_TURN


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


def harmonic_space(equations: Solid, condensed: Condensed, spin: Array, harmonic: int) -> Space:
    """Coordinates: the unknowns inside a sector, on its cut behind, and the pose that goes with the harmonic."""
    T = _tie(equations.layers, spin, harmonic)
    inner, kind = equations.size - len(T), T.dtype.type
    solve_edge = dense(T.conj().T @ condensed.schur @ T)

    def apart(values: AnyArray) -> Array:
        return np.hstack([values.real, values.imag]) if np.iscomplexobj(T) else np.asarray(values)

    def together(values: Array) -> AnyArray:
        if not np.iscomplexobj(T):
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

    return Space(inner + T.shape[1], kind, spread, gathered, solve)


def _tie(layers: Layers, spin: Array, harmonic: int) -> AnyArray:
    """Matrix (2 c + 3, c + 1) from a cut and the harmonic's pose to both cuts (c each) and the pose of the hub.

    Notes
    -----
    The cut ahead is the cut behind of the next chain. Of three freedoms of the hub the turn leaves one as it is,
    theta or z, and turns the others as a vector, of which `(1, i)` is multiplied by `e^(-2 pi i / 3)`.
    """
    c = len(spin)
    phase = np.exp(1j * CHAIN_TURN) if harmonic else 1.0
    T = np.zeros((2 * c + 3, c + 1), dtype=complex if harmonic else float)
    T[:c, :c], T[c : 2 * c, :c] = np.eye(c), phase * spin
    constant, turning = (0, (1, 2)) if layers.fixed else (2, (0, 1))
    if harmonic:
        T[[2 * c + k for k in turning], -1] = 1.0, 1j
    else:
        T[2 * c + constant, -1] = 1.0
    return T
