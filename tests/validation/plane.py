"""Plates in tension and bending: holes, membranes, straight and curved beams, all with published
targets.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import Plate, nodal_stress
from flexfem.fem.mesh import PlaneMesh, mapped, nodes_on
from flexfem.mechanism.outlines import Face, Segment
from flexfem.meshing.requests import Grading

from .fields import clamp, edge_force, meshed, nearest_node, on_chords, pressure, solve, uniform
from .problem import (
    Exact,
    Finding,
    extrapolated,
    on_axes,
    orders,
    polar,
    problem,
    quarter_ring,
    rectangle,
    symmetric,
)

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
TENSION = 7.3  # MPa, along x
HOLE = 1.0
SQUARE = 3.0  # mm, radius and half the side of the square cut out of the infinite plate
CELLS = (
    28,
    40,
    56,
    80,
)  # across and around the quarter: on coarser ones L2 still falls with nearly h^4


def kirsch_displacement(points: Array) -> Array:
    """(..., 2), mm, for tension along x far away and a free hole; plane stress, kappa = (3 - nu)/(1
    + nu).
    """
    e, nu, _ = PLATE
    r, angle = polar(points / HOLE)
    kappa = (3 - nu) / (1 + nu)
    c = np.cos(angle)
    s = np.sin(angle)
    c3 = np.cos(3 * angle)
    s3 = np.sin(3 * angle)
    x = r * (kappa + 1) * c + 2 / r * ((1 + kappa) * c + c3) - 2 / r**3 * c3
    y = r * (kappa - 3) * s + 2 / r * ((1 - kappa) * s + s3) - 2 / r**3 * s3
    return np.asarray(TENSION * HOLE * (1 + nu) / (4 * e) * np.stack([x, y], axis=-1))


def kirsch_stress(points: Array) -> Array:
    """(..., 2, 2), MPa."""
    r, angle = polar(points / HOLE)
    c2 = np.cos(2 * angle)
    s2 = np.sin(2 * angle)
    c4 = np.cos(4 * angle)
    s4 = np.sin(4 * angle)
    xx = 1 - (1.5 * c2 + c4) / r**2 + 1.5 * c4 / r**4
    yy = -(0.5 * c2 - c4) / r**2 - 1.5 * c4 / r**4
    xy = -(0.5 * s2 + s4) / r**2 + 1.5 * s4 / r**4
    return TENSION * symmetric(xx, xy, yy)


KIRSCH = Exact(PLATE, kirsch_displacement, kirsch_stress)


def quarter_with_hole(cells: int) -> PlaneMesh:
    """A quarter of the square: `left` is the hole, `bottom` and `top` the axes, `right` the outer
    sides.
    """

    def place(u: Array, v: Array) -> Array:
        angle = v * np.pi / 2
        inner = HOLE * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        outer = SQUARE * np.stack([np.minimum(1.0, 2 - 2 * v), np.minimum(1.0, 2 * v)], axis=-1)
        share = ((SQUARE**u - 1) / (SQUARE - 1))[
            ..., None
        ]  # triangles as large as their distance from the centre
        return np.asarray((1 - share) * inner + share * outer)

    return mapped(cells, cells, place)


@problem(
    "Kirsch's hole",
    "stresses at a notch and their convergence",
    "E. G. Kirsch, Z. Ver. Dtsch. Ing. 42, 797-807 (1898); Timoshenko and Goodier, Theory of "
    "Elasticity, art. 35",
)
def kirsch_hole() -> list[Finding]:
    """Orders of convergence under the exact tractions, and the stress at the hole."""
    meshes = [quarter_with_hole(cells) for cells in CELLS]
    found = [KIRSCH.solved(mesh, ["right"], on_axes(mesh)) for mesh in meshes]
    factors = [
        nodal_stress(mesh, PLATE, solution.field)[nearest_node(mesh, 0.0, HOLE), 0, 0] / TENSION
        for mesh, (solution, _) in zip(meshes, found, strict=True)
    ]
    note = "mesh by mesh: " + ", ".join(f"{factor:.5f}" for factor in factors)
    unknowns = found[-1][0].unknowns
    at_hole = Finding(
        "stress at the hole over tension", 3.0, factors[-1], 4e-4, unknowns=unknowns, note=note
    )
    return [*orders(meshes, [each for _, each in found], unknowns), at_hole]


HOWLAND_TABLE = {
    0.1: 3.03,
    0.2: 3.14,
    0.3: 3.36,
    0.5: 4.32,
}  # hole diameter over width: largest over gross stress
STRIP_LENGTH = 2.0  # half length of a strip over its width: the hole is forgotten there
AROUND = 240.0  # triangles per full turn of the hole


def quarter_strip(ratio: float) -> PlaneMesh:
    """A quarter of a strip one wide with a hole of diameter `ratio`, fine at the hole."""
    radius = ratio / 2
    corner = complex(STRIP_LENGTH, 0.5)
    loop = [
        Segment(complex(radius), complex(STRIP_LENGTH)),
        Segment(complex(STRIP_LENGTH), corner),
        Segment(corner, 0.5j),
        Segment(0.5j, 1j * radius),
        Segment(1j * radius, complex(radius), 0j),
    ]
    finest = 2 * np.pi * radius / AROUND
    size = Grading((0j,), radius, finest, finest + 0.12 * STRIP_LENGTH, STRIP_LENGTH)
    return meshed(Face(loop, ["bottom", "end", "edge", "middle", "hole"]), [size])


@problem(
    "Howland's strips",
    "stress concentration in a strip of finite width",
    "R. C. J. Howland, Phil. Trans. R. Soc. A 229, 49-86 (1930), long strip, gross stress",
)
def howland_strips() -> list[Finding]:
    """Largest stress at the hole over the stress of the full section, of four strips."""
    rows = []
    for ratio, target in HOWLAND_TABLE.items():
        mesh = quarter_strip(ratio)
        force = edge_force(mesh, PLATE, mesh.edges["end"], pressure(TENSION))
        solution = solve(mesh, PLATE, force, on_axes(mesh, "middle"))
        factor = (
            nodal_stress(mesh, PLATE, solution.field)[nearest_node(mesh, 0.0, ratio / 2), 0, 0]
            / TENSION
        )
        note = (
            "refined further, ours are 0.2 to 0.6 % above the table of 1930, the more the wider "
            "the hole"
        )
        what = f"gross stress concentration, d/W = {ratio:g}"
        rows.append(Finding(what, target, factor, 0.01 * target, 0.005, solution.unknowns, note))
    return rows


LE1_PLATE = Plate(youngs_modulus=210e3, poissons_ratio=0.3, thickness=100.0)
LE1_STRESS = 92.7
LE1_ROUNDED = 0.05  # MPa
LE1_CELLS = (11, 22, 33)  # across, twice as many around; the last gives about 18,000 unknowns
LE1_LIMIT = (16, 32, 64)  # for the extrapolation


def elliptic_membrane(cells: int) -> PlaneMesh:
    """A quarter between two ellipses, mm: `left` the inner, `right` the outer one, `bottom` and
    `top` the axes.
    """

    def place(u: Array, v: Array) -> Array:
        u = u * (1 + u) / 2
        v = v * (1 + v) / 2  # smaller triangles at D
        angle = v * np.pi / 2
        a = 2000.0 + 1250.0 * u
        b = 1000.0 + 1750.0 * u
        return np.stack([a * np.cos(angle), b * np.sin(angle)], axis=-1)

    return mapped(cells, 2 * cells, place)


def stress_at_d(cells: int) -> tuple[float, int]:
    """Stress yy at D, MPa, under a pull of 10 MPa on the outer ellipse, and the unknowns."""
    mesh = elliptic_membrane(cells)
    force = edge_force(mesh, LE1_PLATE, mesh.edges["right"], pressure(10.0))
    solution = solve(mesh, LE1_PLATE, force, on_axes(mesh))
    stress = nodal_stress(mesh, LE1_PLATE, solution.field)
    return float(stress[nearest_node(mesh, 2000.0, 0.0), 1, 1]), solution.unknowns


@problem(
    "NAFEMS LE1, elliptic membrane",
    "stress at a curved edge under an edge load",
    "NAFEMS, The Standard NAFEMS Benchmarks, TNSB rev. 3 (1990), test LE1",
)
def nafems_le1() -> list[Finding]:
    """Stress at the inner ellipse's end on the long axis."""
    rows = []
    for what, counts, allowed in (
        ("", LE1_CELLS, 0.005 * LE1_STRESS),
        (", extrapolated", LE1_LIMIT, LE1_ROUNDED),
    ):
        stress, unknowns = zip(*map(stress_at_d, counts), strict=True)
        ours = extrapolated([1 / cells for cells in counts], stress) if what else stress[-1]
        note = (
            ", ".join(f"{each:.3f}" for each in stress)
            + f" on {counts} cells across; seen elsewhere: 92.657"
        )
        quantity = f"stress yy at D (MPa){what}"
        rows.append(Finding(quantity, LE1_STRESS, ours, allowed, LE1_ROUNDED, unknowns[-1], note))
    return rows


COOK_PLATE = Plate(1.0, 1 / 3, 1.0)
COOK_DISPLACEMENT = 23.96
COOK_CELLS = (16, 32, 64)


def cooks_membrane(cells: int) -> PlaneMesh:
    """The tapered panel (0, 0), (48, 44), (48, 60), (0, 44)."""
    return mapped(
        cells,
        cells,
        lambda u, v: np.stack([48.0 * u, (1 - v) * 44.0 * u + v * (44.0 + 16.0 * u)], axis=-1),
    )


@problem(
    "Cook's membrane",
    "bending and shear of a skew body",
    "R. D. Cook, J. Struct. Div. ASCE 100 (ST9), 1851-1863 (1974), with 23.96 as it is widely "
    "quoted for the converged value (its origin not seen; P. Krysl's FinEtools has 23.97)",
)
def cook_membrane() -> list[Finding]:
    """Displacement at the middle of the free end under a unit shear force, on the finest mesh and
    extrapolated.
    """
    values = []
    for cells in COOK_CELLS:
        mesh = cooks_membrane(cells)
        force = edge_force(mesh, COOK_PLATE, mesh.edges["right"], uniform(0.0, 1.0 / 16.0))
        solution = solve(mesh, COOK_PLATE, force, clamp(nodes_on(mesh, "left")))
        values.append(float(solution.field[nearest_node(mesh, 48.0, 52.0), 1]))
    limit = extrapolated([1 / cells for cells in COOK_CELLS], values)
    note = ", ".join(f"{value:.4f}" for value in values) + f" on {COOK_CELLS} cells"
    allowed = (0.001 * COOK_DISPLACEMENT, 0.01, solution.unknowns, note)
    rows = (("displacement at (48, 52)", values[-1]), ("the same, extrapolated", limit))
    return [Finding(what, COOK_DISPLACEMENT, ours, *allowed) for what, ours in rows]


BEAM = Plate(1e7, 0.3, 0.1)
BEAM_HEIGHT = 0.2
SLANTS = {  # where the lower and the upper ends of the seven cell sides stand
    "regular": ((0, 1, 2, 3, 4, 5, 6), (0, 1, 2, 3, 4, 5, 6)),
    "trapezoidal": ((0, 0.9, 2.1, 2.9, 4.1, 4.9, 6), (0, 1.1, 1.9, 3.1, 3.9, 5.1, 6)),
    "parallelogram": ((0, 0.9, 1.9, 2.9, 3.9, 4.9, 6), (0, 1.1, 2.1, 3.1, 4.1, 5.1, 6)),
}
DEFLECTIONS = {
    "shear": (1, 0.1081, 5e-5),
    "extension": (0, 3e-5, 0.0),
}  # axis, target, half its last digit
CLAMPED = {
    "shear": "",
    "extension": "; the clamped end, which cannot narrow, stiffens it by 0.06 %",
}
REFINED = 6  # every cell of the 6 x 1 mesh cut into so many each way


def slanted(kind: str, refined: int) -> PlaneMesh:
    """The cantilever's 6 x 1 cells of one kind, each cut into `refined` by `refined` and then into
    two triangles.
    """
    lower, upper = SLANTS[kind]

    def place(u: Array, v: Array) -> Array:
        x = (1 - v) * np.interp(6 * u, range(7), lower) + v * np.interp(6 * u, range(7), upper)
        return np.stack([x, BEAM_HEIGHT * (v - 0.5)], axis=-1)

    return on_chords(
        mapped(6 * refined, refined, place)
    )  # the middle of a trapezium is not that of its diagonal


def pulled(
    mesh: PlaneMesh, plate: Plate, sides: tuple[str, str], traction: tuple[float, float]
) -> float:
    """Work, N mm, of a uniform traction, MPa, on the second of two sides while the first is
    clamped.
    """
    force = edge_force(mesh, plate, mesh.edges[sides[1]], uniform(*traction))
    return float(np.sum(force * solve(mesh, plate, force, clamp(nodes_on(mesh, sides[0]))).field))


@problem(
    "MacNeal and Harder's straight beam",
    "slender bodies of distorted triangles",
    "R. H. MacNeal, R. L. Harder, Finite Elem. Anal. Des. 1, 3-20 (1985), straight beam; beam "
    "theory",
)
def macneal_harder_straight_beam() -> list[Finding]:
    """Mean tip displacements under a unit force on the refined meshes; what the coarse ones give is
    in the notes.
    """
    rows = []
    for kind in SLANTS:
        meshes = [slanted(kind, refined) for refined in (1, REFINED)]
        for load, (axis, target, uncertainty) in DEFLECTIONS.items():
            x, y = np.eye(2)[axis] / (BEAM_HEIGHT * BEAM.thickness)
            coarse, fine = (pulled(mesh, BEAM, ("left", "right"), (x, y)) for mesh in meshes)
            note = f"6 x 1 cells: {coarse / target:.3f} of the target" + CLAMPED[load]
            what = f"{load} of the tip, {kind}"
            unknowns = 2 * len(meshes[-1].nodes)
            rows.append(Finding(what, target, fine, 0.005 * target, uncertainty, unknowns, note))
    return rows


CANTILEVER = Plate(3.1e3, 0.29, 1.3)
CANTILEVER_LENGTH = 2.9
CANTILEVER_HEIGHT = 2.3
CANTILEVER_FORCE = 11.0
CANTILEVER_ROWS = (
    16,
    20,
    28,
)  # on coarser meshes, and on longer beams, L2 still falls with nearly h^4


def cantilever_displacement(points: Array) -> Array:
    """(..., 2), mm, of the beam from x = 0 (where its middle is held and level) to the loaded end
    at x = L.
    """
    e, nu, b = CANTILEVER
    L = CANTILEVER_LENGTH
    D = CANTILEVER_HEIGHT
    x = points[..., 0]
    y = points[..., 1]
    scale = CANTILEVER_FORCE / (6 * e * b * D**3 / 12)
    along = -y * ((6 * L - 3 * x) * x + (2 + nu) * (y**2 - D**2 / 4))
    across = 3 * nu * y**2 * (L - x) + (4 + 5 * nu) * D**2 * x / 4 + (3 * L - x) * x**2
    return np.asarray(scale * np.stack([along, across], axis=-1))


def cantilever_stress(points: Array) -> Array:
    """(..., 2, 2), MPa: bending linear, shear parabolic, nothing across."""
    inertia = CANTILEVER.thickness * CANTILEVER_HEIGHT**3 / 12
    x = points[..., 0]
    y = points[..., 1]
    xx = -CANTILEVER_FORCE * (CANTILEVER_LENGTH - x) * y / inertia
    xy = CANTILEVER_FORCE * (CANTILEVER_HEIGHT**2 / 4 - y**2) / (2 * inertia)
    return symmetric(xx, xy, 0 * xy)


TIMOSHENKO = Exact(CANTILEVER, cantilever_displacement, cantilever_stress)


@problem(
    "Timoshenko's cantilever",
    "the full order under a cubic field",
    "S. P. Timoshenko, J. N. Goodier, Theory of Elasticity (1970) art. 21, as written out by C. "
    "E. Augarde, A. J. Deeks, Finite Elem. Anal. Des. 44, 595-601 (2008)",
)
def timoshenko_cantilever() -> list[Finding]:
    """The exact field under its own tractions: a cubic, which quadratic triangles reach at their
    full order.
    """
    L = CANTILEVER_LENGTH
    D = CANTILEVER_HEIGHT
    meshes = [rectangle(5 * rows // 4, rows, L, D) for rows in CANTILEVER_ROWS]
    found = []
    for mesh in meshes:
        held = nodes_on(mesh, "left")
        supports = clamp(held, cantilever_displacement(mesh.nodes[held]))
        solution, error = TIMOSHENKO.solved(mesh, ["right"], supports)
        found.append(error)
    target = float(cantilever_displacement(np.array([L, 0.0]))[1])
    ours = float(solution.field[nearest_node(mesh, L, 0.0), 1])
    unknowns = solution.unknowns
    end = Finding(
        "deflection of the loaded end (mm)", target, ours, 5e-7 * target, unknowns=unknowns
    )
    return [*orders(meshes, found, unknowns), end]


CURVED = Plate(1e7, 0.25, 0.1)
INNER = 4.12
OUTER = 4.32
CURVED_CELLS = (6, 48)  # across, along; the coarse mesh has 1 by 6, as the source


class StressFunction(NamedTuple):
    """Coefficients of `(A r^3 + B/r + D r ln r) sin(theta)` for a unit force that moves the end
    theta = 0 outwards.
    """

    A: float
    B: float
    D: float


def golovin() -> StressFunction:
    """Of the force per thickness 1/b."""
    a2 = INNER**2
    b2 = OUTER**2
    N = a2 - b2 + (a2 + b2) * np.log(OUTER / INNER)
    P = -1.0 / CURVED.thickness
    return StressFunction(P / (2 * N), -P * a2 * b2 / (2 * N), -P * (a2 + b2) / N)


def golovin_displacement(points: Array) -> Array:
    """Displacement (..., 2) by a unit force; the section theta = pi/2 does not turn and is held in
    its middle.
    """
    A, B, D = golovin()
    e, nu, _ = CURVED
    r, angle = polar(points)
    c = np.cos(angle)
    s = np.sin(angle)

    def profile(r: Array | float) -> Array:
        return np.asarray(
            (D * (1 - nu) * np.log(r) + A * (1 - 3 * nu) * r**2 + B * (1 + nu) / r**2) / e
        )

    K = -float(profile((INNER + OUTER) / 2))
    L = np.pi * D / e
    radial = -2 * D / e * angle * c + s * profile(r) + K * s + L * c
    inner = (A * (5 + nu) * r**2 + B * (1 + nu) / r**2 - D * (1 - nu) * np.log(r)) / e
    around = 2 * D / e * angle * s - c * inner + D * (1 + nu) / e * c + K * c - L * s
    return np.stack([radial * c - around * s, radial * s + around * c], axis=-1)


def golovin_stress(points: Array) -> Array:
    """Stress (..., 2, 2), unit force."""
    A, B, D = golovin()
    r, angle = polar(points)
    c = np.cos(angle)
    s = np.sin(angle)
    rr = 2 * A * r - 2 * B / r**3 + D / r
    tt = 6 * A * r + 2 * B / r**3 + D / r
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    return np.asarray(turn @ symmetric(rr * s, -rr * c, tt * s) @ np.swapaxes(turn, -1, -2))


GOLOVIN = Exact(CURVED, golovin_displacement, golovin_stress)


@problem(
    "MacNeal and Harder's curved beam",
    "bending of a curved body",
    "H. Golovin (1881); S. P. Timoshenko, J. N. Goodier, Theory of Elasticity (1970) art. 33: "
    "end displacement pi P (a^2 + b^2) / (E b_z ((a^2 + b^2) ln(b/a) + a^2 - b^2)) of the beam "
    "of MacNeal and Harder (1985)",
)
def macneal_harder_curved_beam() -> list[Finding]:
    """The exact field under its own tractions, and the benchmark as it is set: clamped, with an
    even load.
    """
    target = float(np.pi * golovin().D / CURVED.youngs_modulus)  # the same over the whole section
    meshes = [quarter_ring(*cells, INNER, OUTER) for cells in ((1, 6), CURVED_CELLS)]
    held = nodes_on(meshes[1], "top")
    solution, error = GOLOVIN.solved(
        meshes[1], ["bottom"], clamp(held, golovin_displacement(meshes[1].nodes[held]))
    )
    ours = float(solution.field[nodes_on(meshes[1], "bottom"), 0].mean())
    even = (1.0 / ((OUTER - INNER) * CURVED.thickness), 0.0)
    coarse, clamped = (pulled(mesh, CURVED, ("top", "bottom"), even) for mesh in meshes)
    note = (
        f"the printed 0.08734 is a beam value, {100 * (0.08734 / target - 1):.1f} % from plane "
        f"stress; 6 x 1 cells: {coarse / target:.3f} of the target"
    )
    rows = [
        (
            "end displacement, exact tractions",
            ours,
            2e-4,
            f"stress in L2 within {100 * error.stress:.2g} %",
        ),
        ("end displacement, clamped, even load", clamped, 5e-3, note),
    ]
    return [
        Finding(what, target, value, share * target, unknowns=solution.unknowns, note=remark)
        for what, value, share, remark in rows
    ]
