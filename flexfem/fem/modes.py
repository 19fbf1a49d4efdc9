"""Natural frequencies and mode shapes: consistent mass, rigid hub with payload, stacks; in the plane or extruded.

K is factorised once; ARPACK iterates with its inverse, and the frequencies are Rayleigh quotients of the modes that it
finds, with the strain energy from differences of displacements within the elements. Of three alike sectors one is
condensed onto its cuts, and the modes are those of harmonic 0 and, two of one frequency, of harmonic 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import MASS_QUADRATURE, Layers, Plate
from flexfem.fem.factor import Solve
from flexfem.fem.mesh import Sector, StageMesh, joined
from flexfem.fem.structure import Mass, Structure, mass_of, structure
from flexfem.fem.symmetry import Space, by_sectors, every_motion, whole_fields
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.refused import ComputationFailed

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

SETTLED = 1e-5  # difference of ARPACK's eigenvalues and the Rayleigh quotients, relative
ALIKE = 1e-6  # relative difference of squared frequencies that symmetry makes equal: far above round-off


class VibratingStructure(NamedTuple):
    """A structure that vibrates, its stiffness as a factor: `space` is solved with that of the stacks.

    pushes : (size, n), loads of one newton of each stack.   rates : (n,), N/mm, stiffness of stacks; none disengaged.
    """

    mass: Mass
    space: Space
    pushes: Array
    rates: Array

    @property
    def structure(self) -> Structure:
        return self.mass.of


class Modes(NamedTuple):
    """Natural frequencies (k,), rad/s, rising, and modes of unit modal mass, mm and rad per root of a tonne mm^2.

    shapes : (1, size, k), unknowns of the whole; or (3, size, k), of a sector as it moves in each chain, in its frame.
    participation : (k, 3), of base motions as the pose of the hub: squares are the effective modal masses.
    total : (3, 3), tonne, tonne mm, tonne mm^2, mass matrix of the whole as one rigid body, the clamped faces too.
    mesh, places : the whole stage, and where the nodes of each chain's sector are in it.
    unknowns : number of equations of the whole.
    """

    frequencies: Array
    shapes: Array
    participation: Array
    total: Array
    structure: Structure
    mesh: StageMesh
    places: list[Index]
    unknowns: int

    @property
    def layers(self) -> Layers:
        """Of an extruded structure."""
        assert self.structure.layers is not None
        return self.structure.layers

    def field(self, number: int) -> Array:
        """Displacements (n, 2) of all nodes of `mesh` in one mode, counted from 0; with layers (n, m, 3)."""
        parts = self.structure.fields(self.shapes[..., number].T)
        if len(parts) == 1:
            return np.asarray(parts[0])
        return np.asarray(whole_fields(len(self.mesh.nodes), self.places, [part[None] for part in parts])[0])


def vibrating_structure(
    of: Structure,
    density: float,
    carried: Array | None = None,
    pushes: Array | None = None,
    rates: Array | None = None,
    degree: int = MASS_QUADRATURE,
    space: Space | None = None,
) -> VibratingStructure:
    """Assemble and factorise.

    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload.
    pushes, rates : of engaged stacks, (size, n) and (n,), N/mm.
    degree : of the quadrature of the mass, by default exact.
    space : motions whose stiffness is factorised; None for all.
    Raises ComputationFailed when the stiffness is singular: a part is not held.
    """
    space, pushes = space or every_motion(of), np.zeros((of.size, 0)) if pushes is None else pushes
    rates = np.zeros(pushes.shape[1]) if rates is None else rates
    mass = mass_of(of, density, carried, degree)
    return VibratingStructure(mass, space._replace(solve=_with_stacks(space.solve, pushes, rates)), pushes, rates)


def _with_stacks(solve: Solve, pushes: Array, rates: Array) -> Solve:
    """The inverse of `K + P k P'` by that of K (Woodbury): `K^-1 - X (1 + k P' X)^-1 k X'` with `X = K^-1 P`."""
    if not np.any(rates):
        return solve
    X = solve(pushes)
    inner = np.linalg.solve(np.eye(len(rates)) + rates[:, None] * (pushes.T @ X), rates[:, None] * X.T)
    return lambda b: np.asarray(solve(b) - X @ (inner @ b))


def modes(of: VibratingStructure, count: int) -> Modes:
    """The lowest `count` modes, by rising frequency. Raises ComputationFailed when they are not found."""
    squares, motion = _ritz(of.space, of, count)
    return _arranged(squares, motion[None], of.structure, [], of.mass, count, of.structure.size)


def stage_modes(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None,
    density: float,
    carried: Array,
    count: int,
    degree: int | None = None,
) -> Modes:
    """The lowest `count` modes of a stage by its sectors; out of the plane where the layers are antisymmetric.

    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload for the pose of the hub.
    degree : of the quadrature of the stiffness in the plane.
    Raises ComputationFailed as `modes` and `Structure.lower`.
    """
    stage = by_sectors(sectors, plate, layers, degree)
    share = carried / 3 if stage.alike else carried
    of = vibrating_structure(stage.of, density, share, space=stage.spaces[0])
    if not stage.alike:
        return modes(of, count)
    constant, motion = _ritz(stage.spaces[0], of, count)
    turning, pair = _ritz(stage.spaces[1], of, -(-count // 2))
    real, imaginary = np.split(pair * np.sqrt(2 / 3), 2, axis=1)
    shapes = [
        np.concatenate([motion / np.sqrt(3), c * real - s * imaginary, s * real + c * imaginary], axis=1)
        for c, s in ((np.cos(chain * CHAIN_TURN), np.sin(chain * CHAIN_TURN)) for chain in range(3))
    ]
    squares, (mesh, places) = np.concatenate([constant, turning, turning]), joined(sectors)
    whole = mass_of(structure(mesh, plate, layers), density, carried)
    return _arranged(squares, np.array(shapes), stage.of, places, whole, count, stage.unknowns)


def _ritz(space: Space, of: VibratingStructure, count: int) -> tuple[Array, Array]:
    """Squared frequencies (k,) and unknowns (m, k), or (m, 2 k) of complex coordinates, of unit modal mass."""
    from scipy.sparse.linalg import LinearOperator

    def inertia(coordinates: AnyArray) -> AnyArray:
        return space.gathered(of.mass.loads(space.spread(coordinates.reshape(-1, 1))))[:, 0]

    M = LinearOperator((space.size, space.size), matvec=inertia, dtype=space.kind)
    values, shapes = lowest(space.solve, M, count)
    motion = space.spread(shapes)
    fields = of.structure.fields(motion)
    energy = np.sum(fields * of.structure.forces(fields), axis=tuple(range(1, fields.ndim)))
    energy += of.rates @ (of.pushes.T @ motion) ** 2
    mass = np.sum(motion * of.mass.loads(motion), axis=0)
    stiff, massive = (np.sum(each.reshape(-1, count), axis=0) for each in (energy, mass))
    squares = stiff / massive
    worst = float(np.max(np.abs(squares / values - 1)))
    if not worst <= SETTLED:
        raise ComputationFailed(
            f"modes refused: eigenvalues and strain energies differ by {worst:.2g}, expected at most {SETTLED:g}"
        )
    return squares, motion / np.sqrt(np.tile(massive, motion.shape[1] // count))


def lowest(solve: Solve, mass: LinearOperator, count: int) -> tuple[Array, Any]:
    """Lowest eigenvalues (count,) and vectors (m, count) of `K phi = lambda M phi` by ARPACK, solving by K."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    size = mass.shape[0]
    if count >= size:
        raise ComputationFailed(f"{count} modes of {size} unknowns, expected fewer")
    inverse = LinearOperator((size, size), matvec=lambda b: solve(b.reshape(-1, 1))[:, 0], dtype=mass.dtype)
    start = np.random.default_rng(0).standard_normal(size)  # the same every time
    try:
        values, vectors = eigsh(mass, count, M=mass, sigma=0.0, OPinv=inverse, v0=start)  # A is not used
    except ArpackError as failure:
        raise ComputationFailed(f"eigenvalues: {failure}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def _arranged(
    squares: Array, shapes: Array, of: Structure, places: list[Index], mass: Mass, count: int, unknowns: int
) -> Modes:
    """The first so many, by rising frequency, pairs of one frequency turned into x and y, signs chosen.

    All are turned: of a pair the one that is left out is needed to turn the other into x.
    """
    order = np.argsort(squares)
    squares, shapes = squares[order], shapes[..., order]
    rigid = mass.of.rigid_fields()
    base = mass.forces(rigid).reshape(3, -1)
    total = rigid.reshape(3, -1) @ base.T + mass.carried
    found = Modes(np.sqrt(squares), shapes, np.empty((0, 3)), total, of, mass.of.mesh, places, unknowns)
    participation = np.array([base @ found.field(k).ravel() for k in range(len(squares))])
    if of.poses:
        participation = participation + shapes[0, -3:].T @ mass.carried
    Q = _aligned(squares, participation[:, of.turning])
    shapes = shapes @ Q
    flat = shapes.reshape(-1, shapes.shape[-1])
    signs = np.where(flat[np.argmax(np.abs(flat), axis=0), np.arange(flat.shape[1])] < 0, -1.0, 1.0)
    return found._replace(
        frequencies=found.frequencies[:count],
        shapes=(shapes * signs)[..., :count],
        participation=((Q.T @ participation) * signs[:, None])[:count],
    )


def _aligned(squares: Array, participation: Array) -> Array:
    """Rotation (k, k) among modes of one frequency, of which any is as good: the second of a pair has no motion in x.

    squares : (k,), rising.   participation : (k, 3).
    """
    Q, ends = np.eye(len(squares)), np.flatnonzero(squares[1:] > squares[:-1] * (1 + ALIKE)) + 1
    for pair in np.split(np.arange(len(squares)), ends):
        if len(pair) > 1:
            Q[np.ix_(pair, pair)] = np.linalg.qr(participation[pair], mode="complete").Q
    return Q
