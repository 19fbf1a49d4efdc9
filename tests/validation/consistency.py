"""A manufactured solution, whose errors are all known, and what any correct discretisation holds to
round-off.

On curved and distorted meshes, where both are hardest; in the plane, and by wedges of 18 nodes.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import spsolve

from flexfem.arrays import Array
from flexfem.fem.elements import Layers, Plate, layered, mirrored, nodal_stress
from flexfem.fem.mesh import PlaneMesh, mapped, nodes_on
from flexfem.fem.structure import NONE, Structure, mass_of, structure
from flexfem.mechanism.outlines import Face, Segment
from flexfem.meshing.requests import Grading

from .fields import FieldErrors, Function, clamp, meshed, on_chords, size_of, solve
from .problem import ORDER_ALLOWED, ROUND_OFF, Exact, Finding, hooke, order, problem, rectangle

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
MESH_SIZES = (0.2, 0.14, 0.1, 0.07, 0.05)  # mm
AMPLITUDE = 1e-3  # mm
WAVES = np.array(
    [[5.2, 2.8], [-3.6, 4.4]]
)  # 1/mm, of the two components: no symmetry, and short enough that the
# field is harder to follow than the arcs: their error falls with the fourth power of h and would
# raise the order
CUBIC = np.array([0.15, -0.1])
NOTCH = 0.7
CORNER = 0.5  # mm, radii


def displacement(points: Array) -> Array:
    """A smooth field (..., 2), mm: `u_a = A (sin(k_a . x + a) + c_a x^2 y)`."""
    x = points[..., 0]
    y = points[..., 1]
    return np.asarray(
        AMPLITUDE * (np.sin(points @ WAVES.T + [0.0, 1.0]) + np.multiply.outer(x**2 * y, CUBIC))
    )


def gradient(points: Array) -> Array:
    """d_b u_a (..., 2, 2)."""
    x = points[..., 0]
    y = points[..., 1]
    waves = np.cos(points @ WAVES.T + [0.0, 1.0])[..., None] * WAVES
    cubic = np.stack([2 * x * y, x**2], axis=-1)
    return np.asarray(AMPLITUDE * (waves + CUBIC[:, None] * cubic[..., None, :]))


def second(points: Array) -> Array:
    """d_b d_c u_a (..., 2, 2, 2), 1/mm."""
    x = points[..., 0]
    y = points[..., 1]
    waves = -np.sin(points @ WAVES.T + [0.0, 1.0])[..., None, None] * (
        WAVES[:, :, None] * WAVES[:, None, :]
    )
    cubic = np.stack(
        [np.stack([2 * y, 2 * x], axis=-1), np.stack([2 * x, 0 * x], axis=-1)], axis=-2
    )
    return np.asarray(AMPLITUDE * (waves + CUBIC[:, None, None] * cubic[..., None, :, :]))


def holding(points: Array) -> Array:
    """What holds the field, `-div sigma` (..., 2), N/mm^3."""
    stress = hooke(
        PLATE, np.moveaxis(second(points), -1, -3)
    )  # of the gradient's slopes, along the first axis
    return -np.asarray(stress[..., 0, :, 0] + stress[..., 1, :, 1])


FIELD = Exact(PLATE, displacement, lambda points: hooke(PLATE, gradient(points)), gradient, holding)


def outline() -> Face:
    """A plate 3 mm by 2 mm with a half-round notch in its upper side and one round corner."""
    right = 1.5 + NOTCH
    bottom = 2.0 - NOTCH
    left = 1.5 - NOTCH
    loop = [
        Segment(0j, 3 + 0j),
        Segment(3 + 0j, 3 + 2j),
        Segment(3 + 2j, right + 2j),
        Segment(right + 2j, 1.5 + 1j * bottom, 1.5 + 2j),
        Segment(1.5 + 1j * bottom, left + 2j, 1.5 + 2j),
        Segment(left + 2j, CORNER + 2j),
        Segment(CORNER + 2j, (2 - CORNER) * 1j, CORNER + (2 - CORNER) * 1j),
        Segment((2 - CORNER) * 1j, 0j),
    ]
    return Face(loop, ["bottom", "held", "top", "notch", "notch", "top", "corner", "left"])


def unit(arm: Array) -> Array:
    """Vectors (..., 2) of length one."""
    return np.asarray(arm / np.linalg.norm(arm, axis=-1, keepdims=True))


def field_errors(mesh: PlaneMesh) -> FieldErrors:
    """Errors of the solution on one mesh of `outline`, held on its right side, pulled on all
    others.
    """
    held = nodes_on(mesh, "held")
    drawn: dict[str, Function] = {
        "notch": lambda at: unit([1.5, 2.0] - at),
        "corner": lambda at: unit(at - [CORNER, 2.0 - CORNER]),
    }
    sides = [side for side in mesh.edges if side != "held"]
    return FIELD.solved(mesh, sides, clamp(held, displacement(mesh.nodes[held])), drawn)[1]


def plate_mesh(size: float) -> PlaneMesh:
    """Mesh `outline` anew with triangles of one size, mm."""
    return meshed(outline(), [Grading((0j,), 4.0, size, size, 1.0)])


@problem(
    "Manufactured solution",
    "the discretisation on curved, graded triangles",
    "P. J. Roache, Code verification by the method of manufactured solutions, J. Fluids Eng. "
    "124, 4-10 (2002)",
)
def manufactured_solution() -> list[Finding]:
    """Observed orders on five meshes, each made anew."""
    meshes = [plate_mesh(size) for size in MESH_SIZES]
    found = np.array([field_errors(mesh) for mesh in meshes])
    straight = np.array([field_errors(on_chords(mesh)) for mesh in meshes])
    sizes = [size_of(mesh) for mesh in meshes]
    unknowns = 2 * len(meshes[-1].nodes)
    rows = []
    for k, (what, target) in enumerate(
        (("displacement", 3.0), ("its gradient", 2.0), ("stress", 2.0))
    ):
        note = f"straight triangles on the same corners: {order(sizes, straight[:, k]):.2f}"
        ours = order(sizes, found[:, k])
        rows.append(
            Finding(
                f"order of {what} in L2", target, ours, ORDER_ALLOWED, unknowns=unknowns, note=note
            )
        )
    return rows


SLOPES = np.array([[1.3e-3, -0.4e-3], [2.1e-3, 0.7e-3]])  # d_b u_a: strain, shear and rotation
SIZE = 0.2  # mm, of the triangles of the plate with arcs
IRONS = (
    "B. M. Irons, A. Razzaque, Experience with the patch test, in: A. K. Aziz (ed.), Academic "
    "Press (1972) 557-587"
)


def distorted() -> PlaneMesh:
    """A rectangle of 24 triangles with every inner and outer node pushed aside: no side is
    straight.
    """
    regular = rectangle(4, 3, 4.1, 3.2, y=0.0)
    shift = np.random.default_rng(29).uniform(-0.08, 0.08, regular.nodes.shape)
    return regular._replace(nodes=regular.nodes + shift)


@problem("Patch test", "consistency of curved quadratic triangles", IRONS)
def patch_test() -> list[Finding]:
    """A linear field imposed along the outer sides must come out inside, with its one stress
    everywhere.
    """
    mesh = distorted()
    exact = mesh.nodes @ SLOPES.T + [0.011, -0.023]
    outer = np.unique(np.concatenate([nodes_on(mesh, side) for side in mesh.edges]))
    field = solve(mesh, PLATE, np.zeros_like(exact), clamp(outer, exact[outer])).field
    inside = np.setdiff1d(np.arange(len(exact)), outer)
    wanted = hooke(PLATE, SLOPES)
    stress = nodal_stress(mesh, PLATE, field)
    worst = {
        "displacement": np.abs(field - exact)[inside].max() / np.abs(exact).max(),
        "stress": np.abs(stress - wanted).max() / np.abs(wanted).max(),
    }
    note = "24 triangles without one straight side"
    unknowns = 2 * len(inside)
    return [
        Finding(
            f"largest relative error of the {what}",
            0.0,
            value,
            ROUND_OFF,
            unknowns=unknowns,
            note=note,
        )
        for what, value in worst.items()
    ]


@problem(
    "Rigid-body motions",
    "that nothing but the three rigid motions is free of energy",
    "two translations and one rotation of the plane",
)
def rigid_body_motions() -> list[Finding]:
    """The free stiffness matrix has three motions without energy, and no fourth."""
    return _without_energy(unsupported(distorted(), None, PLATE)[1].toarray(), 3)


def _without_energy(K: Array, expected: int) -> list[Finding]:
    values = np.linalg.eigvalsh(K)
    zero = float(np.sum(np.abs(values) < ROUND_OFF * values[-1]))
    note = f"the next is {values[expected] / values[-1]:.1g} of the largest"
    return [
        Finding("eigenvalues that are zero", expected, zero, 0.0, unknowns=len(values), note=note)
    ]


SOLID = Plate(71.7e3, 0.33, 1.0)  # aluminium
SPATIAL = np.array(
    [[1.1e-3, -2.3e-3, 0.7e-3], [0.5e-3, 1.7e-3, -1.3e-3], [-1.9e-3, 0.3e-3, 2.9e-3]]
)  # d_b u_a
BOUNDS = np.array([-0.4, -0.1, 0.3, 1.1])  # mm, of uneven layers


def curved_cells() -> PlaneMesh:
    """Six uneven cells with bent sides, mm."""

    def place(u: Array, v: Array) -> Array:
        u, v = u + 0.15 * u * (1 - u) * (1 + v), v - 0.1 * v * (1 - v) * np.cos(2 * u)
        return np.stack([3 * u + 0.4 * np.sin(2 * v), 2 * v + 0.3 * u**2], axis=-1)

    return mapped(3, 2, place)


def unsupported(
    mesh: PlaneMesh, layers: Layers | None, plate: Plate = SOLID
) -> tuple[Structure, sp.csr_array]:
    """A body that nothing holds, and its whole stiffness, unknowns as of `Structure.loads`."""
    free = structure(mesh, plate, layers, held=NONE)
    lower = free.lower()
    return free, (lower + sp.tril(lower, -1).T).tocsr()


@problem("Patch test of wedges", "consistency of the wedges of 18 nodes", IRONS)
def wedge_patch_test() -> list[Finding]:
    """A linear field imposed on the whole surface must come out inside."""
    mesh = curved_cells()
    free, K = unsupported(mesh, layered(BOUNDS))
    heights = layered(BOUNDS).heights
    n = len(mesh.nodes)
    m = len(heights)
    at = np.concatenate([np.repeat(mesh.nodes, m, axis=0), np.tile(heights, n)[:, None]], axis=1)
    exact = free.loads((at @ SPATIAL.T).reshape(1, n, m, 3))[:, 0]
    outside = np.zeros((1, n, m, 3))
    outside[:, np.unique(np.concatenate(list(mesh.edges.values())))] = outside[:, :, [0, -1]] = 1.0
    held = free.loads(outside)[:, 0] > 0
    found = spsolve(K[~held][:, ~held].tocsc(), -K[~held][:, held] @ exact[held])
    worst = float(np.max(np.abs(found - exact[~held])) / np.max(np.abs(exact)))
    what = "largest relative error of the displacement"
    note = "36 curved wedges of 18 nodes, uneven layers"
    return [Finding(what, 0.0, worst, ROUND_OFF, unknowns=len(found), note=note)]


@problem(
    "Motions of wedges",
    "that nothing but six motions is free of energy, and vibrates at no frequency",
    "exact: nothing resists three translations and three rotations",
)
def wedge_rigid_motions() -> list[Finding]:
    """The free stiffness matrix has six motions without energy and no seventh; each half of a body
    has three.
    """
    whole = unsupported(curved_cells(), layered(BOUNDS[1:]))[1].toarray()
    rows = _without_energy(whole, 6)
    mirror = mirrored(1.1, 2, 0.4)
    for which, layers in (("in", mirror._replace(held=(0,))), ("out of", mirror.antisymmetric)):
        equations, K = unsupported(curved_cells(), layers, Plate(70e3, 0.3, 1.0))
        mass = mass_of(equations, 2700e-12).loads(np.eye(equations.size))
        squares = eigh(K.toarray(), mass, eigvals_only=True)
        zero = float(np.sum(np.abs(squares) < 1e-9 * squares[6]))
        note = f"the fourth squared frequency is {squares[3] / squares[6]:.2g} of the seventh"
        what = f"modes {which} the plane without frequency, of six"
        rows.append(Finding(what, 3.0, zero, 0.0, unknowns=len(squares), note=note))
    return rows
