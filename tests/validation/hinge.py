"""A circular hinge: its formulas where the neck grows thin, and its thickness between plane stress
and plane strain.

What is to be expected of formulas (2) and (3). A slender body of half thickness c(x) bent by a
moment M has, next to the beam's Airy function `M/4 (y^3/c^3 - 3 y/c)`, a complementary energy that
exceeds the beam's by the energy of the shear stress that the taper makes, without Poisson's ratio:
relatively `2 int int tau^2 / int int sigma^2 = 6/5 <c'^2>`, weighted by 1/c^3. At the neck `c = t/2
+ x^2/(2 R)`, so `<c'^2> = t/(3 R)` and the rotation is above (2) by 2/5 t/R, to first order.
Axially the deep ends of the notch, where it is no beam, add a length that does not depend on t to
one that grows with sqrt(R/t): the relative difference vanishes with the root of t/R."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.linalg import eigh

from flexfem.arrays import Array
from flexfem.fem.elements import SOLID_QUADRATURE, Plate, mirrored
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.response import platform_response
from flexfem.fem.structure import structure
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.outlines import Face, Segment
from flexfem.meshing.requests import Grading
from flexfem.paper.stage_mesh import grading, notch_sizes

from ..tolerances import SOLVED
from .fields import meshed
from .problem import Finding, problem

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
RADIUS = 1.0  # mm
RATIOS = (0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)  # t/R
ACROSS = 10  # triangles across the neck
BLUNT = np.deg2rad(
    85.0
)  # the arc ends here: at 90 degrees it would meet the rigid body in a cusp without area


def notch_mesh(neck: float, across: float = ACROSS) -> PlaneMesh:
    """A notch about the origin, mm, `ground` on its left and `hub` on its right, so many triangles
    across the neck.
    """
    centre = 1j * (neck / 2 + RADIUS)
    bottom = 1j * neck / 2
    edge = centre + RADIUS * complex(np.sin(BLUNT), -np.cos(BLUNT))
    corner = complex(RADIUS, edge.imag)
    upper = [
        Segment(corner.conjugate(), corner),
        Segment(corner, edge),
        Segment(edge, bottom, centre),
        Segment(bottom, -edge.conjugate(), centre),
        Segment(-edge.conjugate(), -corner.conjugate()),
    ]
    loop = upper + [
        Segment(-s.start, -s.end, None if s.centre is None else -s.centre) for s in upper
    ]
    coarse = 2 * RADIUS / across
    gap = float(RADIUS * (1 - np.sin(BLUNT)))
    sizes = [
        grading(0j, *size, coarse, across) for size in notch_sizes(neck, RADIUS, across, across)
    ]
    for at in (corner, -corner, corner.conjugate(), -corner.conjugate()):
        sizes.append(Grading((at,), 0.0, gap, gap + 0.8 * RADIUS, 2 * RADIUS))
    return meshed(Face(loop, ["hub", *["free"] * 4, "ground", *["free"] * 4]), sizes)


def differences(ratio: float) -> tuple[Array, int]:
    """Relative differences (rotation, axial) of the finite elements from (2) and (3), and the
    unknowns.
    """
    response = platform_response(notch_mesh(ratio * RADIUS), PLATE)
    beam = FORMULAS["paros-weisbord"].compliance(
        RADIUS, ratio * RADIUS, PLATE.thickness, PLATE.youngs_modulus, PLATE.poissons_ratio
    )
    ours = np.array([response.compliance[2, 2], response.compliance[0, 0]])
    return ours / np.array([beam.rotation, beam.axial]) - 1, response.unknowns


def limit_at_zero(steps: Array, values: Array) -> float:
    """Value at step zero of the polynomial through the last four values (k,)."""
    return float(np.polyfit(steps[-4:], values[-4:], 3)[-1])


@problem(
    "Circular notch",
    "hinge formulas (2) and (3) in the limit of a thin neck",
    "J. M. Paros, L. Weisbord, Machine Design 37, 151-156 (1965), (2) and (3) of the paper, t/R "
    "to 0; rates: slender-body expansion of the plane-stress Airy function, derived in "
    "tests/validation/hinge.py",
)
def circular_notch() -> list[Finding]:
    """Limits of the two ratios, the rates at which they are reached, and the first coefficient of
    the rotation.
    """
    found, unknowns = zip(*map(differences, RATIOS), strict=True)
    rotation, axial = np.array(found).T
    tau = np.array(RATIOS)
    with np.errstate(
        invalid="ignore"
    ):  # a difference that changes sign has no rate, and nan does not pass
        about, along = (np.log2(each[:-1] / each[1:]) for each in (rotation, axial))
    root = np.sqrt(tau)
    rows = [
        (
            "rotation over (2), limit",
            1.0,
            1 + limit_at_zero(tau, rotation),
            2e-5,
            _listed(100 * rotation, "%"),
        ),
        (
            "axial over (3), limit",
            1.0,
            1 + limit_at_zero(root, axial),
            5e-4,
            _listed(100 * axial, "%"),
        ),
        (
            "rate of the rotation in t/R, limit",
            1.0,
            limit_at_zero(tau[1:], about),
            0.01,
            _listed(about),
        ),
        (
            "rate of the axial in t/R, limit",
            0.5,
            limit_at_zero(root[1:], along),
            0.01,
            _listed(along),
        ),
        (
            "rotation's difference over t/R, limit",
            0.4,
            limit_at_zero(tau, rotation / tau),
            0.001,
            "",
        ),
    ]
    return [Finding(*row[:4], unknowns=unknowns[-1], note=row[4]) for row in rows]


def _listed(values: Array, unit: str = "") -> str:
    at = (
        f" {unit} at t/R = " + ", ".join(f"{ratio:g}" for ratio in RATIOS)
        if unit
        else " from pair to pair"
    )
    return ", ".join(f"{each:.2f}" for each in values) + at


E = 71.7e3
NU = 0.33  # MPa; as of aluminium
NECK = 0.3 * RADIUS
COARSE = 3  # mm; triangles across it
SAME = SOLVED  # relative: the same equations by another route, neither refined iteratively
FOIL = 0.03
DEEP = (100.0, 300.0)  # b/t
THIN = 5e-4
THICK = 1e-3  # of the mesh: w is continuous from triangle to triangle; of three layers
DEPTHS = (1.0, 10.0, 100.0)  # b/t


@cache
def notch() -> PlaneMesh:
    """A right circular hinge, rigid at the ends of its notch."""
    return notch_mesh(NECK, COARSE)


def compliance(nu: float, depth: float, layers: int, faces_held: bool = False) -> tuple[Array, int]:
    """Compliance (3, 3) times thickness of the notch, `depth` of its necks thick, and the number of
    unknowns.
    """
    b = depth * NECK
    free = mirrored(b, layers, NECK)
    through = free._replace(held=(0, 2 * layers)) if faces_held else free
    equations = structure(notch(), Plate(E, nu, b), through)
    loads = np.pad(np.eye(3), [(equations.size - 3, 0), (0, 0)])
    return b * factorise(equations.lower())(loads)[-3:], equations.size


@cache
def plane(nu: float, strain: bool = False) -> Array:
    """The same (3, 3) in plane stress or plane strain."""
    plate = Plate(E / (1 - nu**2), nu / (1 - nu), 1.0) if strain else Plate(E, nu, 1.0)
    return platform_response(notch(), plate, SOLID_QUADRATURE).compliance


@problem(
    "Limits of the thickness",
    "three dimensions where they become plane problems",
    "exact: Hooke's law without stress, or without strain, out of the plane",
)
def thickness_limits() -> list[Finding]:
    """A notch without Poisson's ratio, between held faces, as a foil, and ever thicker."""
    flat = compliance(0.0, 5.0, 1)[0]
    walled = compliance(NU, 5.0, 2, True)[0]
    foil = compliance(NU, FOIL, 1)[0]
    thick = [compliance(NU, depth, 3) for depth in DEEP]
    stress = plane(NU)
    strain = plane(NU, True)
    above = [each[2, 2] / strain[2, 2] - 1 for each, _ in thick]
    deepest = (DEEP[1] * above[1] - DEEP[0] * above[0]) / (
        DEEP[1] - DEEP[0]
    )  # the faces' share falls as 1/b
    said = "rotational compliance over that of plane {}, less one"
    listed = ", ".join(
        f"{100 * each:+.3f} % at b/t = {depth:g}" for each, depth in zip(above, DEEP, strict=True)
    )
    rows = [
        (
            "nu = 0: largest relative difference from plane stress",
            _off(flat, plane(0.0)),
            SAME,
            "b/t = 5",
        ),
        (
            "held faces: largest relative difference from plane strain",
            _off(walled, strain),
            SAME,
            "b/t = 5",
        ),
        (f"thin: {said.format('stress')}", foil[2, 2] / stress[2, 2] - 1, THIN, f"b/t = {FOIL:g}"),
        (f"thick, free faces: {said.format('strain')}, limit", deepest, THICK, listed),
    ]
    return [
        Finding(what, 0.0, float(ours), allowed, unknowns=thick[-1][1], note=note)
        for what, ours, allowed, note in rows
    ]


def _off(found: Array, exact: Array) -> float:
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    return float(np.max(np.abs(found - exact) / size))


@problem(
    "Zettl's bounds",
    "compliance between plane stress and plane strain",
    "B. Zettl, W. Szyszkowski, W. J. Zhang, J. Mech. Des. 127, 782-787 (2005), abstract: plane "
    "stress is the lower and plane strain the upper limit of a right circular hinge's stiffness",
)
def zettl_bounds() -> list[Finding]:
    """Where the compliance of a hinge is between plane stress, 0, and plane strain, 1, whatever the
    load.
    """
    soft = plane(NU)
    hard = plane(NU, True)
    rows = []
    for depth in DEPTHS:
        found, unknowns = compliance(NU, depth, 2)
        low, *_, high = eigh(soft - found, soft - hard, eigvals_only=True)
        rotation = [100 * (1 - found[2, 2] / soft[2, 2]), 100 * (found[2, 2] / hard[2, 2] - 1)]
        note = (
            f"about the neck plane stress is {rotation[0]:.1f} % less stiff, plane strain "
            f"{rotation[1]:.1f} % more; the abstract says up to about 12 %, without Poisson's "
            f"ratio (ours {NU:g})"
        )
        for which, ours in (("least", low), ("largest", high)):
            what = (
                f"b/t = {depth:g}: {which} position of any load between plane stress, 0, and "
                "plane strain, 1"
            )
            rows.append(Finding(what, 0.5, float(ours), 0.5, unknowns=unknowns, note=note))
    return rows
