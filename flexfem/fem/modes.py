"""Natural frequencies and mode shapes: consistent mass, rigid hub with payload, stacks; plane or extruded.

K is factorised once; ARPACK iterates with its inverse, and the frequencies are Rayleigh quotients of its modes, with
the strain energy from displacement differences within elements. Of three identical sectors one is condensed onto its
cuts, and the modes are those of harmonic 0 and, in pairs of one frequency, those of harmonic 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.elements import MASS_QUADRATURE, Layers, Plate
from flexfem.fem.factor import Solve
from flexfem.fem.mesh import Sector, StageMesh, joined
from flexfem.fem.structure import Mass, Structure, mass_of, structure
from flexfem.fem.symmetry import Space, factorise_stage, full_space, whole_fields
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.refused import ComputationFailed

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

MISMATCH = 1e-5  # relative difference between eigenvalues of ARPACK and Rayleigh quotients
DEGENERATE = 1e-6  # relative difference of squared frequencies equal by symmetry: far above round-off


class VibratingStructure(NamedTuple):
    """A structure with its mass and factorised stiffness; `space.solve` includes the stiffness of the stacks.

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
    """Natural frequencies (k,), rad/s, ascending, and modes of unit modal mass, mm and rad per root of a tonne mm^2.

    shapes : (1, size, k), unknowns of the whole; or (3, size, k), of the sector of each chain in its own frame.
    participation : (k, 3), factors of base motions along the pose: squares are the effective modal masses.
    total : (3, 3), tonne, tonne mm, tonne mm^2, mass matrix of the whole as one rigid body, with clamped faces.
    mesh, sector_nodes : the whole stage, and the indices of the sector nodes of each chain in it.
    unknowns : number of equations of the whole.
    """

    frequencies: Array
    shapes: Array
    participation: Array
    total: Array
    structure: Structure
    mesh: StageMesh
    sector_nodes: list[Index]
    unknowns: int

    @property
    def layers(self) -> Layers:
        """The layers of an extruded structure."""
        assert self.structure.layers is not None
        return self.structure.layers

    def field(self, number: int) -> Array:
        """Displacements (n, 2) of all nodes of `mesh` in a mode, numbered from 0; with layers (n, m, 3)."""
        parts = self.structure.fields(self.shapes[..., number].T)
        if len(parts) == 1:
            return np.asarray(parts[0])
        return np.asarray(whole_fields(len(self.mesh.nodes), self.sector_nodes, [part[None] for part in parts])[0])


def vibrating_structure(
    structure: Structure,
    density: float,
    carried: Array | None = None,
    stack_loads: Array | None = None,
    stack_stiffness: Array | None = None,
    degree: int = MASS_QUADRATURE,
    space: Space | None = None,
    attached: tuple[Array, Array] | None = None,
) -> VibratingStructure:
    """Assemble the mass and factorise the stiffness.

    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload.
    stack_loads, stack_stiffness : of engaged stacks, (size, n) and (n,), N/mm.
    degree : of the quadrature of the mass, by default exact.
    space : factorised space of motions; None for all.   attached : rigid masses, as in `Mass`.
    Raises ComputationFailed when the stiffness is singular: a part is not held.
    """
    space, P = space or full_space(structure), np.zeros((structure.size, 0)) if stack_loads is None else stack_loads
    k = np.zeros(P.shape[1]) if stack_stiffness is None else stack_stiffness
    mass = mass_of(structure, density, carried, degree)._replace(attached=attached)
    return VibratingStructure(mass, space._replace(solve=_with_stacks(space.solve, P, k)), P, k)


def _with_stacks(solve: Solve, P: Array, k: Array) -> Solve:
    """Return the inverse of `K + P k P'` (Woodbury): `K^-1 - X (1 + k P' X)^-1 k X'` with `X = K^-1 P`."""
    if not np.any(k):
        return solve
    X = solve(P)
    inner = np.linalg.solve(np.eye(len(k)) + k[:, None] * (P.T @ X), k[:, None] * X.T)
    return lambda b: np.asarray(solve(b) - X @ (inner @ b))


def modes(vibrating: VibratingStructure, count: int) -> Modes:
    """Return the lowest `count` modes, by ascending frequency. Raises ComputationFailed when they do not converge."""
    squares, motion = _ritz(vibrating.space, vibrating, count)
    return _ordered_modes(squares, motion[None], vibrating.structure, [], vibrating.mass, count, len(motion))


def stage_modes(
    sectors: tuple[Sector, ...],
    plate: Plate,
    layers: Layers | None,
    density: float,
    carried: Array,
    count: int,
    degree: int | None = None,
) -> Modes:
    """Return the lowest `count` modes of a stage given by its sectors, out of the plane with antisymmetric layers.

    density : tonne/mm^3.   carried : (3, 3), mass matrix of hub and payload for the pose of the hub.
    degree : of the quadrature of the stiffness in the plane.
    Raises ComputationFailed as `modes` and `Structure.lower`.
    """
    stage = factorise_stage(sectors, plate, layers, degree)
    share = carried / 3 if stage.cyclic else carried
    vibrating = vibrating_structure(stage.structure, density, share, space=stage.spaces[0])
    if not stage.cyclic:
        return modes(vibrating, count)
    single, motion = _ritz(stage.spaces[0], vibrating, count)
    double, pairs = _ritz(stage.spaces[1], vibrating, -(-count // 2))
    real, imaginary = np.split(pairs * np.sqrt(2 / 3), 2, axis=1)
    shapes = [
        np.concatenate([motion / np.sqrt(3), c * real - s * imaginary, s * real + c * imaginary], axis=1)
        for c, s in ((np.cos(chain * CHAIN_TURN), np.sin(chain * CHAIN_TURN)) for chain in range(3))
    ]
    squares, (mesh, sector_nodes) = np.concatenate([single, double, double]), joined(sectors)
    whole = mass_of(structure(mesh, plate, layers), density, carried)
    return _ordered_modes(squares, np.array(shapes), stage.structure, sector_nodes, whole, count, stage.unknowns)


def _ritz(space: Space, vibrating: VibratingStructure, count: int) -> tuple[Array, Array]:
    """Squared frequencies (k,) and modes (m, k), or (m, 2 k) for complex coordinates, of unit modal mass."""
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
            f"modes refused: eigenvalues and strain energies differ by {worst:.2g}, expected at most {MISMATCH:g}"
        )
    return squares, motion / np.sqrt(np.tile(mass, motion.shape[1] // count))


def lowest(solve: Solve, mass: LinearOperator, count: int) -> tuple[Array, Any]:
    """Lowest eigenvalues (count,) and vectors (m, count) of `K phi = lambda M phi` by ARPACK; `solve` is K^-1."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    size = mass.shape[0]
    if count >= size:
        raise ComputationFailed(f"{count} modes of {size} unknowns, expected fewer")
    inverse = LinearOperator((size, size), matvec=lambda b: solve(b.reshape(-1, 1))[:, 0], dtype=mass.dtype)
    start = np.random.default_rng(0).standard_normal(size)  # reproducible
    try:
        values, vectors = eigsh(mass, count, M=mass, sigma=0.0, OPinv=inverse, v0=start)  # argument 1 is not used
    except ArpackError as failure:
        raise ComputationFailed(f"eigenvalues: {failure}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def _ordered_modes(
    squares: Array, shapes: Array, structure: Structure, nodes: list[Index], mass: Mass, count: int, unknowns: int
) -> Modes:
    """Return the first `count` modes by ascending frequency, with pairs aligned with x and y and signs normalised.

    Alignment precedes the selection, because it needs both modes of a pair.
    """
    order = np.argsort(squares)
    squares, shapes = squares[order], shapes[..., order]
    rigid = mass.structure.rigid_fields()
    base = mass.forces(rigid).reshape(3, -1)
    total = rigid.reshape(3, -1) @ base.T + mass.carried
    found = Modes(np.sqrt(squares), shapes, np.empty((0, 3)), total, structure, mass.structure.mesh, nodes, unknowns)
    participation = np.array([base @ found.field(k).ravel() for k in range(len(squares))])
    if structure.poses:
        participation = participation + shapes[0, -3:].T @ mass.carried
    if mass.attached is not None:
        inertia, at = mass.attached
        moved = inertia[:, None] * (at.T @ structure.rigid_unknowns(structure.free))
        found = found._replace(total=total + moved.T @ (moved / inertia[:, None]))
        participation = participation + shapes[0].T @ at @ moved
    Q = _aligned(squares, participation[:, structure.vector_first])
    shapes = shapes @ Q
    flat = shapes.reshape(-1, shapes.shape[-1])
    signs = np.where(flat[np.argmax(np.abs(flat), axis=0), np.arange(flat.shape[1])] < 0, -1.0, 1.0)
    return found._replace(
        frequencies=found.frequencies[:count],
        shapes=(shapes * signs)[..., :count],
        participation=((Q.T @ participation) * signs[:, None])[:count],
    )


def _aligned(squares: Array, participation: Array) -> Array:
    """Return the rotation (k, k) among modes of equal frequency after which the second of a pair has no motion in x.

    squares : (k,), ascending.   participation : (k, 3).
    """
    Q, ends = np.eye(len(squares)), np.flatnonzero(squares[1:] > squares[:-1] * (1 + DEGENERATE)) + 1
    for pair in np.split(np.arange(len(squares)), ends):
        if len(pair) > 1:
            Q[np.ix_(pair, pair)] = np.linalg.qr(participation[pair], mode="complete").Q
    return Q
