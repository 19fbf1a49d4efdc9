"""Holes in plates under tension, and a circular hinge whose neck grows thin.

Kirsch's exact field on a square cut out of the infinite plate; Howland's strips; the hinge against (2) and (3).

What is to be expected of the hinge. A slender body of half thickness c(x) bent by a moment M has, next to the beam's
Airy function `M/4 (y^3/c^3 - 3 y/c)`, a complementary energy that exceeds the beam's by the energy of the shear stress
that the taper makes, without Poisson's ratio: relatively `2 int int tau^2 / int int sigma^2 = 6/5 <c'^2>`, weighted by
1/c^3. At the neck `c = t/2 + x^2/(2 R)`, so `<c'^2> = t/(3 R)` and the rotation is above (2) by 2/5 t/R, to first
order. Axially the deep ends of the notch, where it is no beam, add a length that does not depend on t to one that grows
with sqrt(R/t): the relative difference vanishes with the root of t/R.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.mesher import Cone
from flexfem.fem.plane_stress import Plate, nodal_stress
from flexfem.fem.problem import (
    Support,
    edge_force,
    errors,
    mapped,
    meshed,
    nearest_node,
    nodes_on,
    pressure,
    size_of,
    solve,
    traction_of,
)
from flexfem.fem.response import platform_response
from flexfem.fem.sectors import cone, notch_sizes
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.bodies import Face, Segment
from flexfem.validate.records import Finding, order

KIRSCH = "E. G. Kirsch, Z. Ver. Dtsch. Ing. 42, 797-807 (1898); Timoshenko and Goodier, Theory of Elasticity, art. 35"
HOWLAND = "R. C. J. Howland, Phil. Trans. R. Soc. A 229, 49-86 (1930), long strip, gross stress"
PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
TENSION = 7.3  # MPa, along x
HOLE, SQUARE = 1.0, 3.0  # mm, radius and half the side of the square cut out of the infinite plate
CELLS = (28, 40, 56, 80)  # across and around the quarter: on coarser ones L2 still falls with nearly h^4
ORDER_ALLOWED = 0.1
HOWLAND_TABLE = {0.1: 3.03, 0.2: 3.14, 0.3: 3.36, 0.5: 4.32}  # hole diameter over width: largest over gross stress
ROUNDED = 0.005  # half the last digit of the table
STRIP_LENGTH = 2.0  # half length of a strip over its width: the hole is forgotten there
AROUND = 240.0  # triangles per full turn of the hole


def kirsch_displacement(points: Array) -> Array:
    """(..., 2), mm, for tension along x far away and a free hole; plane stress, kappa = (3 - nu)/(1 + nu)."""
    e, nu, _ = PLATE
    r, angle = np.hypot(points[..., 0], points[..., 1]) / HOLE, np.arctan2(points[..., 1], points[..., 0])
    kappa = (3 - nu) / (1 + nu)
    c, s, c3, s3 = np.cos(angle), np.sin(angle), np.cos(3 * angle), np.sin(3 * angle)
    x = r * (kappa + 1) * c + 2 / r * ((1 + kappa) * c + c3) - 2 / r**3 * c3
    y = r * (kappa - 3) * s + 2 / r * ((1 - kappa) * s + s3) - 2 / r**3 * s3
    return np.asarray(TENSION * HOLE * (1 + nu) / (4 * e) * np.stack([x, y], axis=-1))


def kirsch_stress(points: Array) -> Array:
    """(..., 2, 2), MPa."""
    r, angle = np.hypot(points[..., 0], points[..., 1]) / HOLE, np.arctan2(points[..., 1], points[..., 0])
    c2, s2, c4, s4 = np.cos(2 * angle), np.sin(2 * angle), np.cos(4 * angle), np.sin(4 * angle)
    xx = 1 - (1.5 * c2 + c4) / r**2 + 1.5 * c4 / r**4
    yy = -(0.5 * c2 - c4) / r**2 - 1.5 * c4 / r**4
    xy = -(0.5 * s2 + s4) / r**2 + 1.5 * s4 / r**4
    return np.asarray(TENSION * np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2))


def quarter_with_hole(cells: int) -> StageMesh:
    """A quarter of the square: `left` is the hole, `bottom` and `top` the axes, `right` the outer sides."""

    def place(u: Array, v: Array) -> Array:
        angle = v * np.pi / 2
        inner = HOLE * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        outer = SQUARE * np.stack([np.minimum(1.0, 2 - 2 * v), np.minimum(1.0, 2 * v)], axis=-1)
        share = ((SQUARE**u - 1) / (SQUARE - 1))[..., None]  # triangles as large as their distance from the centre
        return np.asarray((1 - share) * inner + share * outer)

    return mapped(cells, cells, place)


def kirsch() -> list[Finding]:
    """Orders of convergence under the exact tractions, and the stress at the hole."""
    found, factors, sizes = [], [], []
    for cells in CELLS:
        mesh = quarter_with_hole(cells)
        force = edge_force(mesh, PLATE, mesh.edges["right"], traction_of(kirsch_stress))
        axes = [Support(nodes_on(mesh, "top"), 0), Support(nodes_on(mesh, "bottom"), 1)]
        solution = solve(mesh, PLATE, force, axes)
        found.append(errors(mesh, PLATE, solution.field, kirsch_displacement, None, kirsch_stress))
        stress = nodal_stress(mesh, PLATE, solution.field)
        factors.append(stress[nearest_node(mesh, 0.0, HOLE), 0] / TENSION)
        sizes.append(size_of(mesh))
    rows = [
        ("order of displacement in L2", 3.0, order(sizes, [e.displacement for e in found]), ORDER_ALLOWED),
        ("order of stress in L2", 2.0, order(sizes, [e.stress for e in found]), ORDER_ALLOWED),
        ("stress at the hole over tension", 3.0, factors[-1], 4e-4),
    ]
    notes = ("", "", "mesh by mesh: " + ", ".join(f"{factor:.5f}" for factor in factors))
    return [
        Finding("Kirsch's hole", KIRSCH, *row, unknowns=solution.unknowns, note=note)
        for row, note in zip(rows, notes, strict=True)
    ]


def quarter_strip(ratio: float) -> StageMesh:
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
    size = Cone(0j, radius, finest, finest + 0.12 * STRIP_LENGTH, STRIP_LENGTH)
    return meshed(Face(loop, ["bottom", "end", "edge", "middle", "hole"]), [size])


def howland() -> list[Finding]:
    """Largest stress at the hole over the stress of the full section, of four strips."""
    rows = []
    for ratio, target in HOWLAND_TABLE.items():
        mesh = quarter_strip(ratio)
        force = edge_force(mesh, PLATE, mesh.edges["end"], pressure(TENSION))
        axes = [Support(nodes_on(mesh, "middle"), 0), Support(nodes_on(mesh, "bottom"), 1)]
        solution = solve(mesh, PLATE, force, axes)
        at = nearest_node(mesh, 0.0, ratio / 2)
        factor = float(nodal_stress(mesh, PLATE, solution.field)[at, 0]) / TENSION
        note = "refined further, ours are 0.2 to 0.6 % above the table of 1930, the more the wider the hole"
        row = (f"gross stress concentration, d/W = {ratio:g}", target, factor, 0.01 * target, ROUNDED)
        rows.append(Finding("Howland's strips", HOWLAND, *row, unknowns=solution.unknowns, note=note))
    return rows


NOTCH = "circular notch"
PAROS_WEISBORD = "J. M. Paros, L. Weisbord, Machine Design 37, 151-156 (1965), (2) and (3) of the paper, t/R to 0"
SLENDER = "slender-body expansion of the plane-stress Airy function, derived in flexfem/validate/holes.py"
RADIUS = 1.0  # mm
RATIOS = (0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)  # t/R
ACROSS = 10  # triangles across the neck
BLUNT = np.deg2rad(85.0)  # the arc ends here: at 90 degrees it would meet the rigid body in a cusp without area


def notch_outline(neck: float) -> Face:
    """The notch about the origin, `ground` on its left and `hub` on its right, mm."""
    centre, bottom = 1j * (neck / 2 + RADIUS), 1j * neck / 2
    edge = centre + RADIUS * complex(np.sin(BLUNT), -np.cos(BLUNT))
    corner = complex(RADIUS, edge.imag)
    upper = [
        Segment(corner.conjugate(), corner),
        Segment(corner, edge),
        Segment(edge, bottom, centre),
        Segment(bottom, -edge.conjugate(), centre),
        Segment(-edge.conjugate(), -corner.conjugate()),
    ]
    loop = upper + [Segment(-s.start, -s.end, None if s.centre is None else -s.centre) for s in upper]
    return Face(loop, ["hub", *["free"] * 4, "ground", *["free"] * 4])


def notch_mesh(neck: float, across: float = ACROSS) -> StageMesh:
    """Mesh `notch_outline` with so many triangles across the neck."""
    coarse, gap = 2 * RADIUS / across, float(RADIUS * (1 - np.sin(BLUNT)))
    cones = [cone(0j, *size, coarse, across) for size in notch_sizes(neck, RADIUS, across, across)]
    corner = complex(RADIUS, neck / 2 + RADIUS * (1 - np.cos(BLUNT)))
    for at in (corner, -corner, corner.conjugate(), -corner.conjugate()):
        cones.append(Cone(at, 0.0, gap, gap + 0.8 * RADIUS, 2 * RADIUS))
    return meshed(notch_outline(neck), cones)


def differences(ratio: float) -> tuple[Array, int]:
    """Relative differences (rotation, axial) of the finite elements from (2) and (3), and the unknowns."""
    response = platform_response(notch_mesh(ratio * RADIUS), PLATE)
    beam = FORMULAS["paros-weisbord"].compliance(
        RADIUS, ratio * RADIUS, PLATE.thickness, PLATE.youngs_modulus, PLATE.poissons_ratio
    )
    ours = np.array([response.compliance[2, 2], response.compliance[0, 0]])
    return ours / np.array([beam.rotation, beam.axial]) - 1, response.unknowns


def limit_at_zero(steps: Array, values: Array) -> float:
    """Value at step zero of the polynomial through the last four values (k,)."""
    return float(np.polyfit(steps[-4:], values[-4:], 3)[-1])


def notch() -> list[Finding]:
    """Limits of the two ratios, the rates at which they are reached, and the first coefficient of the rotation."""
    made = [differences(ratio) for ratio in RATIOS]
    rotation, axial = np.array([difference for difference, _ in made]).T
    tau = np.array(RATIOS)
    root, about, along = np.sqrt(tau), _rates(rotation), _rates(axial)
    rows = [
        (PAROS_WEISBORD, "rotation over (2), limit", 1.0, 1 + limit_at_zero(tau, rotation), 2e-5, _percent(rotation)),
        (PAROS_WEISBORD, "axial over (3), limit", 1.0, 1 + limit_at_zero(root, axial), 5e-4, _percent(axial)),
        (SLENDER, "rate of the rotation in t/R, limit", 1.0, limit_at_zero(tau[1:], about), 0.01, _listed(about)),
        (SLENDER, "rate of the axial in t/R, limit", 0.5, limit_at_zero(root[1:], along), 0.01, _listed(along)),
        (SLENDER, "rotation's difference over t/R, limit", 0.4, limit_at_zero(tau, rotation / tau), 0.001, ""),
    ]
    return [
        Finding(NOTCH, source, quantity, target, ours, allowed, unknowns=made[-1][1], note=note)
        for source, quantity, target, ours, allowed, note in rows
    ]


def _rates(values: Array) -> Array:
    """Observed rates (k - 1,) of values (k,) from one to the next, where t/R is halved."""
    with np.errstate(invalid="ignore"):  # a difference that changes sign has no rate, and nan does not pass
        return np.asarray(np.log2(values[:-1] / values[1:]))


def _percent(values: Array) -> str:
    listed, at = (", ".join(f"{each:{form}}" for each in row) for row, form in ((100 * values, ".2f"), (RATIOS, "g")))
    return f"differences (%): {listed} at t/R = {at}"


def _listed(rates: Array) -> str:
    return "from pair to pair: " + ", ".join(f"{rate:.2f}" for rate in rates)
