"""Plane elasticity by boundary elements: straight, with quadratic displacements and tractions, integrated exactly.

Points, displacements `u + iv` and tractions are complex numbers. With Kolosov's `kappa = (3 - nu) / (1 + nu)`, shear
modulus and thickness one, the displacement at a point z of a body is

    U(z) = int [-2 kappa ln|z - s| t + (z - s)/(z - s)* t*] |ds| / (4 pi (1 + kappa))
         + int [u (kappa d ln(s - z) - d ln(s - z)*) + u* d((s - z)/(s - z)*)] / (2 pi i (1 + kappa))

over its boundary s, the body to the left, a star for the conjugate: Somigliana's identity, Kelvin's forces in the first
line and dislocations in the second, from 2 U = kappa phi - z phi'* - psi* (N. I. Muskhelishvili, Some Basic Problems of
the Mathematical Theory of Elasticity, Noordhoff 1953, sections 32 and 56). Asked at the boundary's own points, it is
the linear system that is solved here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array
from flexfem.stage.outline import Segment

PLACES = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])  # of the nodes in an element from -1 to 1: Gauss's, none at a corner
SHARES = np.array([5.0, 8.0, 5.0]) / 18  # their weights, per length of the element
SHAPES = np.linalg.inv(np.vander(PLACES, increasing=True))  # from nodal values to coefficients of powers
KEPT = 64  # answers, of some 50 kB: designs that differ elsewhere have the same platform, and one stage asks repeatedly
FAR = 10.0  # unit of length in the logarithm, per size of the body: no hole then has the radius at which it is singular


class Boundary(NamedTuple):
    """Straight elements with the body to their left: start, end (m,), complex, mm."""

    start: AnyArray
    end: AnyArray

    @property
    def nodes(self) -> AnyArray:
        """Points (3m,), complex, three in every element."""
        middle, half = (self.start + self.end) / 2, (self.end - self.start) / 2
        return np.asarray((middle[:, None] + half[:, None] * PLACES).ravel())

    @property
    def weights(self) -> Array:
        """Quadrature weights (3m,) of the nodes, mm."""
        return np.asarray((np.abs(self.end - self.start)[:, None] * SHARES).ravel())


def divided(segments: Sequence[Segment], size: Callable[[complex], float], turn: float) -> Boundary:
    """Chords of lines and arcs, halved until none is longer than `size` at its middle or turns by more than `turn`."""
    pieces = [piece for segment in segments for piece in _halved(segment, size, turn)]
    return Boundary(np.array([piece.start for piece in pieces]), np.array([piece.end for piece in pieces]))


def _halved(segment: Segment, size: Callable[[complex], float], turn: float) -> list[Segment]:
    middle = (segment.start + segment.end) / 2
    if segment.centre is not None:
        middle = segment.centre + (segment.start - segment.centre) * np.exp(0.5j * segment.turn)
    if segment.length <= size(middle) and abs(segment.turn) <= turn:
        return [segment]
    halves = (Segment(segment.start, middle, segment.centre), Segment(middle, segment.end, segment.centre))
    return [piece for half in halves for piece in _halved(half, size, turn)]


def displacements(
    boundary: Boundary, tractions: AnyArray, held: NDArray[np.bool_], poissons_ratio: float, copies: int = 1
) -> AnyArray:
    """Displacements (copies, n, k) times shear modulus, complex, read-only, of the nodes under k loads.

    Parameters
    ----------
    boundary : one of `copies` alike, turned about the origin by equal angles, that together bound the body.
    tractions : (n, k), complex, of the nodes of the first copy; not looked at where the body is held.
    held : (n,), nodes that do not move. Where none is, of one copy, loads must balance, and the mean motion is zero.

    Notes
    -----
    In each copy's own frame the equations are the same, so a discrete Fourier transform parts them: with x_d in copy d,
    `x_d = sum_m w^(m d) (sum_e w^(m e) A_e)^-1 b / copies`, w the root of unity, A_e what copy e does to the first.
    """
    given = (np.ascontiguousarray(each, dtype=complex).tobytes() for each in (*boundary, tractions))
    return _displacements(*given, np.asarray(held, dtype=bool).tobytes(), float(poissons_ratio), copies)


@lru_cache(KEPT)
def _displacements(
    start: bytes, end: bytes, tractions: bytes, held: bytes, poissons_ratio: float, copies: int
) -> AnyArray:
    """As `displacements`, which gives arrays by their bytes; read-only."""
    boundary, fixed = Boundary(np.frombuffer(start, complex), np.frombuffer(end, complex)), np.frombuffer(held, bool)
    moved = _solved(boundary, np.frombuffer(tractions, complex).reshape(len(fixed), -1), fixed, poissons_ratio, copies)
    moved.setflags(write=False)
    return moved


def _solved(
    boundary: Boundary, tractions: AnyArray, held: NDArray[np.bool_], poissons_ratio: float, copies: int
) -> AnyArray:
    single, double = _system(boundary, poissons_ratio, copies)
    clamped = np.concatenate([held, held])
    load = np.where(clamped[:, None], 0.0, _split(tractions))
    moved = np.zeros((copies, *load.shape))
    for wave in range(copies // 2 + 1):  # the others are conjugates
        phase = np.exp(2j * np.pi * wave * np.arange(copies) / copies)
        phase = phase.real if 2 * wave in (0, copies) else phase  # real equations cost a quarter
        force, motion = (np.tensordot(phase, parts, axes=1) for parts in (single, double))
        matrix = np.where(clamped, force, motion)
        if not held.any():
            matrix = matrix + _pins(boundary)
        share = (1 if 2 * wave in (0, copies) else 2) / copies
        unknown = np.where(clamped[:, None], 0.0, np.linalg.solve(matrix, -force @ load))
        moved += share * np.real(phase[:, None, None] * unknown)
    return np.asarray(moved[:, : len(held)] + 1j * moved[:, len(held) :])


def _system(boundary: Boundary, poissons_ratio: float, copies: int) -> tuple[Array, Array]:
    """Matrices (copies, 2n, 2n), real parts before imaginary ones, of tractions and of displacements.

    What they make of those of all copies, each in its frame, sums to zero at the nodes of the first.
    """
    kappa = (3 - poissons_ratio) / (1 + poissons_ratio)
    force, jump = SHAPES / (4 * np.pi * (1 + kappa)), SHAPES / (2j * np.pi * (1 + kappa))
    half, found = (boundary.end - boundary.start) / 2, []
    a, unit = np.abs(half), FAR * float(np.max(np.abs(boundary.nodes)))
    for spin in np.exp(2j * np.pi * np.arange(copies) / copies):
        along = spin * half / a
        w = (boundary.nodes[:, None] - spin * (boundary.start + boundary.end) / 2) / along
        own = np.repeat(np.eye(len(a), dtype=bool) & (spin == 1), len(PLACES), axis=0)
        w[own] = w[own].real  # each element lies on the real axis
        logs, cauchy, squares, powers = _moments(w, a, own, unit)
        aside, turn = (np.conj(w) - w)[..., None], along[:, None] ** 2
        by_force = -2 * kappa * logs @ force, turn * (powers + aside * np.conj(cauchy)) @ force
        by_jump = (kappa * cauchy - np.conj(cauchy)) @ jump, -turn * aside * np.conj(squares) @ jump
        found.append([_real(spin * straight, np.conj(spin) * mirrored) for straight, mirrored in (by_force, by_jump)])
    single, double = np.moveaxis(np.array(found), 1, 0)
    double[0] -= np.eye(double.shape[-1])
    return single, double


def _moments(w: AnyArray, a: Array, own: NDArray[np.bool_], unit: float) -> tuple[Array, AnyArray, AnyArray, Array]:
    """Integrals (n, m, 3) over s from -a to a of (s/a)^k times ln(|s - w|/unit), 1/(s - w), 1/(s - w)^2 and 1."""
    c = [np.log((w - a) / (w + a))]
    c[0][own] = c[0][own].real + 1j * np.pi  # from the body's side, the left
    c += [2 * a + w * c[0]]
    c += [w * c[1]]
    c += [2 * a**3 / 3 + w * c[2]]
    s = [-1 / (a - w) - 1 / (a + w)]
    s += [c[0] + w * s[0]]
    s += [c[1] + w * s[1]]
    ahead, behind = np.log(np.abs(a - w) / unit), np.log(np.abs(a + w) / unit)
    logs = [(a ** (k + 1) * ahead - (-a) ** (k + 1) * behind - c[k + 1].real) / (k + 1) for k in range(3)]
    scale = a[:, None] ** -np.arange(3.0)
    powers = a[:, None] * np.array([2.0, 0.0, 2 / 3])
    return np.stack(logs, -1) * scale, np.stack(c[:3], -1) * scale, np.stack(s, -1) * scale, powers


def _real(A: AnyArray, B: AnyArray) -> Array:
    """The matrix (2n, 2n) of the map u -> A u + B u*, given as (n, m, 3), on real parts before imaginary ones."""
    A, B = A.reshape(len(A), -1), B.reshape(len(B), -1)
    return np.block([[(A + B).real, (B - A).imag], [(A + B).imag, (A - B).real]])


def _split(values: AnyArray) -> Array:
    return np.concatenate([values.real, values.imag])


def _pins(boundary: Boundary) -> Array:
    """What makes the equations of a free body regular: the mean of each rigid motion, on that motion."""
    z = boundary.nodes / np.max(np.abs(boundary.nodes))
    rigid = _split(np.stack([np.ones(len(z)), 1j * np.ones(len(z)), 1j * z], axis=-1))
    weights = np.concatenate([boundary.weights, boundary.weights]) / np.sum(boundary.weights)
    return np.asarray(rigid @ (weights[:, None] * rigid).T)
