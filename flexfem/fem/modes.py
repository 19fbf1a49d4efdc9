"""Natural frequencies and mode shapes: consistent mass, rigid bodies, springs; plane or extruded.

K is factorised once; ARPACK iterates with its inverse, and the frequencies are Rayleigh quotients
of its modes, with the strain energy from displacement differences within elements. Of three
identical sectors one is condensed onto its cuts, and the modes are those of harmonic 0 and, in
pairs of one frequency, those of harmonic 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.fem.elements import Layers, Plate
from flexfem.fem.factor import Solve
from flexfem.fem.mesh import SECTORS, PlaneMesh, Sector, joined, sector_rotation
from flexfem.fem.response import factorised_sectors
from flexfem.fem.structure import Mass, Structure, mass_of, structure
from flexfem.fem.symmetry import Space, full_space, whole_fields
from flexfem.refused import ComputationFailed

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

MISMATCH = 1e-5  # relative difference between eigenvalues of ARPACK and Rayleigh quotients
# vectors of ARPACK; with 20, plates with many leaf springs take half as many solutions more
BASIS = 30
TOLERANCE = 1e-11  # of eigenvalues, relative
# relative difference of squared frequencies equal by symmetry: far above round-off
DEGENERATE = 1e-6


class VibratingStructure(NamedTuple):
    """A structure with its mass and factorised stiffness, which includes that of stacks.

    stack_loads : (size, n), for one newton of each engaged stack.   stack_stiffness : (n,), N/mm.
    """

    mass: Mass
    space: Space
    stack_loads: Array
    stack_stiffness: Array

    @property
    def structure(self) -> Structure:
        return self.mass.structure


class Modes(NamedTuple):
    """Natural frequencies (k,), rad/s, ascending, and modes of unit modal mass.

    Modes are in mm and rad per root of a tonne mm^2.

    shapes : (size, k), unknowns of the whole.
    participation : (k, 3), factors of base motions along the pose: squares are the effective modal
        masses.
    total : (3, 3), tonne, tonne mm, tonne mm^2, mass matrix of the whole as one rigid body, with
        clamped faces.
    structure : the whole.
    """

    frequencies: Array
    shapes: Array
    participation: Array
    total: Array
    structure: Structure

    @property
    def mesh(self) -> PlaneMesh:
        return self.structure.mesh

    @property
    def layers(self) -> Layers:
        """The layers of an extruded structure."""
        assert self.structure.layers is not None
        return self.structure.layers

    def field(self, number: int) -> Array:
        """Displacements (n, 2) of all nodes in a mode, from 0; with layers (n, m, 3)."""
        return np.asarray(self.structure.fields(self.shapes[:, number : number + 1])[0])


def vibrating_structure(
    mass: Mass,
    stack_loads: Array | None = None,
    stack_stiffness: Array | None = None,
    space: Space | None = None,
) -> VibratingStructure:
    """Factorise the stiffness of a structure with engaged stacks.

    space : of motions, if the stiffness is factorised already.
    stack_loads, stack_stiffness : of engaged stacks, (size, n) and (n,), N/mm.
    Raises ComputationFailed when the stiffness is singular: a part is not held.
    """
    space = space or full_space(mass.structure)
    P = np.zeros((mass.structure.size, 0)) if stack_loads is None else stack_loads
    k = np.zeros(P.shape[1]) if stack_stiffness is None else stack_stiffness
    return VibratingStructure(mass, space._replace(solve=_with_stacks(space.solve, P, k)), P, k)


def _with_stacks(
    solve: Solve,
    P: Array,
    k: Array,
) -> Solve:
    """Return the inverse of `K + P k P'`.

    By Woodbury it is `K^-1 - X (1 + k P' X)^-1 k X'` with `X = K^-1 P`.
    """
    if not np.any(k):
        return solve
    X = solve(P)
    k = k[:, None]
    inner = np.linalg.solve(np.eye(len(k)) + k * (P.T @ X), k * X.T)
    return lambda b: np.asarray(solve(b) - X @ (inner @ b))


def modes(vibrating: VibratingStructure, count: int) -> Modes:
    """Return the lowest `count` modes, by ascending frequency.

    Raises ComputationFailed when they do not converge.
    """
    return _ordered_modes(*_ritz(vibrating.space, vibrating, count), vibrating.mass, count)


def modes_of_tangent(
    mass: Mass,
    solve: Solve,
    count: int,
    stack_loads: Array | None = None,
    stack_stiffness: Array | None = None,
) -> Modes:
    """Return the lowest `count` modes of a tangent stiffness, whose inverse is `solve`.

    stack_loads, stack_stiffness : as of `vibrating_structure`.
    Raises ComputationFailed when they do not converge, or when the equilibrium is not stable.
    """
    from scipy.sparse.linalg import LinearOperator

    if stack_loads is not None and stack_stiffness is not None:
        solve = _with_stacks(solve, stack_loads, stack_stiffness)
    size = mass.structure.size
    inertia = LinearOperator(
        (size, size), matvec=lambda u: mass.loads(u.reshape(-1, 1))[:, 0], dtype=float
    )
    squares, shapes = lowest(solve, inertia, count)
    if not squares[0] > 0:
        raise ComputationFailed(
            "the mechanism buckles before its preload is reached, expected a smaller one"
        )
    shapes = shapes / np.sqrt(np.sum(shapes * mass.loads(shapes), axis=0))
    return _ordered_modes(squares, shapes, mass, count)


def sector_modes(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None,
    density: float,
    carried: Array,
    count: int,
    degree: int | None = None,
) -> Modes:
    """Return the lowest `count` modes of a plate around a rigid hub, given by its sectors.

    They are out of the plane with antisymmetric layers.

    density : tonne/mm^3.
    carried : (3, 3), mass matrix of hub and payload for the pose of the hub.
    degree : of the quadrature of the stiffness in the plane.

    Raises ComputationFailed as `modes` and `Structure.lower`.
    """
    factorised = factorised_sectors(sectors, plate, layers, degree)
    own = carried / SECTORS if factorised.cyclic else carried
    mass = mass_of(factorised.structure, density, own)
    vibrating = vibrating_structure(mass, space=factorised.spaces[0])
    if not factorised.cyclic:
        return modes(vibrating, count)
    mesh, sector_nodes = joined(sectors)
    whole = structure(mesh, plate, layers)
    squares, parts = _modes_by_sector(factorised.spaces, vibrating, count)
    fields = [factorised.structure.fields(part) for part in parts]
    shapes = whole.loads(whole_fields(len(mesh.nodes), sector_nodes, fields))
    shapes[-3:] = parts[0][-3:]
    return _ordered_modes(squares, shapes, mass_of(whole, density, carried), count)


def _modes_by_sector(
    spaces: Sequence[Space], vibrating: VibratingStructure, count: int
) -> tuple[Array, list[Array]]:
    """Return squares of frequencies, (rad/s)^2, and the unknowns of each sector in their modes.

    spaces : of one sector, for harmonics 0 and 1; modes of harmonic 1 occur in pairs.
    """
    single, alike = _ritz(spaces[0], vibrating, count)
    double, pairs = _ritz(spaces[1], vibrating, -(-count // 2))
    return np.concatenate([single, double, double]), _motions_of_sectors(alike, pairs)


def _motions_of_sectors(alike: Array, pairs: Array) -> list[Array]:
    """Return the unknowns (m, k + 2 p) of each sector in modes of unit modal mass of the whole.

    alike : (m, k), of a sector in modes of harmonic 0.
    pairs : (m, 2 p), real, then imaginary parts of those of harmonic 1.
    """
    vector = np.split(pairs * np.sqrt(2 / SECTORS), 2, axis=1)
    single = alike / np.sqrt(SECTORS)
    turns = [sector_rotation(sector)[:2, :2] for sector in range(SECTORS)]
    return [np.hstack([single, *np.tensordot(turn, vector, axes=1)]) for turn in turns]


def _ritz(
    space: Space,
    vibrating: VibratingStructure,
    count: int,
) -> tuple[Array, Array]:
    """Squared frequencies (k,) and modes of unit modal mass (m, k), (m, 2 k) if complex."""
    from scipy.sparse.linalg import LinearOperator

    def inertia(coordinates: AnyArray) -> AnyArray:
        return space.project(vibrating.mass.loads(space.expand(coordinates.reshape(-1, 1))))[:, 0]

    M = LinearOperator((space.size, space.size), matvec=inertia, dtype=space.dtype)
    values, shapes = lowest(space.solve, M, count)
    motion = space.expand(shapes)
    fields = vibrating.structure.fields(motion)
    energy = np.sum(fields * vibrating.structure.forces(fields), axis=tuple(range(1, fields.ndim)))
    energy += vibrating.stack_stiffness @ (vibrating.stack_loads.T @ motion) ** 2
    mass = np.sum(motion * vibrating.mass.loads(motion), axis=0)
    stiffness, mass = (np.sum(part.reshape(-1, count), axis=0) for part in (energy, mass))
    squares = stiffness / mass
    worst = float(np.max(np.abs(squares / values - 1)))
    if not worst <= MISMATCH:
        raise ComputationFailed(
            f"modes refused: eigenvalues and strain energies differ by {worst:.2g}, expected at "
            f"most {MISMATCH:g}"
        )
    return squares, motion / np.sqrt(np.tile(mass, motion.shape[1] // count))


def lowest(
    solve: Solve,
    mass: LinearOperator,
    count: int,
) -> tuple[Array, Any]:
    """Lowest eigenvalues (count,) and vectors (m, count) of `K phi = lambda M phi` by ARPACK.

    solve : K^-1.
    """
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    size = mass.shape[0]
    if count >= size:
        raise ComputationFailed(f"{count} modes of {size} unknowns, expected fewer")
    inverse = LinearOperator(
        (size, size), matvec=lambda b: solve(b.reshape(-1, 1))[:, 0], dtype=mass.dtype
    )
    start = np.random.default_rng(0).standard_normal(size)  # reproducible
    try:
        vectors_kept = max(2 * count + 1, min(BASIS, 4 * count + 2))
        arnoldi = {"v0": start, "ncv": min(size, vectors_kept), "tol": TOLERANCE}
        # the first argument is not used
        values, vectors = eigsh(mass, count, M=mass, sigma=0.0, OPinv=inverse, **arnoldi)
    except ArpackError as failure:
        raise ComputationFailed(f"eigenvalues: {failure}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def _ordered_modes(
    squares: Array,
    shapes: Array,
    mass: Mass,
    count: int,
) -> Modes:
    """Return the first `count` modes by ascending frequency, with their signs normalised.

    Pairs of equal frequency are aligned with x and y.
    Alignment precedes the selection, because it needs both modes of a pair.
    """
    order = np.argsort(squares)
    whole = mass.structure
    squares = squares[order]
    shapes = shapes[:, order]
    rigid = whole.rigid_fields()
    bodies = mass.at.T @ whole.rigid
    base = mass.forces(rigid)
    moved = mass.carried @ bodies
    total = rigid.reshape(3, -1) @ base.reshape(3, -1).T + bodies.T @ moved
    participation = shapes.T @ (whole.loads(base) + mass.at @ moved)
    Q = _aligned(squares, participation[:, whole.vector_first])
    shapes = shapes @ Q
    signs = np.where(
        shapes[np.argmax(np.abs(shapes), axis=0), np.arange(shapes.shape[1])] < 0, -1.0, 1.0
    )
    participation = ((Q.T @ participation) * signs[:, None])[:count]
    return Modes(np.sqrt(squares[:count]), (shapes * signs)[:, :count], participation, total, whole)


def _aligned(squares: Array, participation: Array) -> Array:
    """Return the rotation (k, k) among modes of equal frequency that aligns pairs.

    After it, the second of a pair has no motion in x.

    squares : (k,), ascending.   participation : (k, 3).
    """
    Q = np.eye(len(squares))
    ends = np.flatnonzero(squares[1:] > squares[:-1] * (1 + DEGENERATE)) + 1
    for pair in np.split(np.arange(len(squares)), ends):
        if len(pair) > 1:
            Q[np.ix_(pair, pair)] = np.linalg.qr(participation[pair], mode="complete").Q
    return Q
