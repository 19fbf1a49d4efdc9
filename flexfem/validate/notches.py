"""One circular hinge between rigid bodies: finite elements against (2) and (3) as the neck grows thin.

What is to be expected. A slender body of half thickness c(x) bent by a moment M has, next to the beam's Airy function
`M/4 (y^3/c^3 - 3 y/c)`, a complementary energy that exceeds the beam's by the energy of the shear stress that the taper
makes, without Poisson's ratio: relatively `2 int int tau^2 / int int sigma^2 = 6/5 <c'^2>`, weighted by 1/c^3. At the
neck `c = t/2 + x^2/(2 R)`, so `<c'^2> = t/(3 R)` and the rotation is above (2) by 2/5 t/R, to first order. Axially the
deep ends of the notch, where it is no beam, add a length that does not depend on t, to one that grows with sqrt(R/t):
the relative difference vanishes with the root of t/R.
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.notch import FORMULAS
from flexfem.arrays import Array
from flexfem.fem.grids import meshed
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import platform_response
from flexfem.stage.outline import Face, Segment
from flexfem.validate.finding import Finding, finding

NAME = "circular notch"
PAROS_WEISBORD = "J. M. Paros, L. Weisbord, Machine Design 37, 151-156 (1965), (2) and (3) of the paper, t/R to 0"
SLENDER = "slender-body expansion of the plane-stress Airy function, derived in flexfem/validate/notches.py"
PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
RADIUS = 1.0  # mm
RATIOS = (0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)  # t/R
ACROSS = 10  # triangles across the neck
SLOPE = 1.4  # growth of the triangles with the thickness, as in the stage's own mesh
BLUNT = np.deg2rad(85.0)  # the arc ends here: at 90 degrees it would meet the rigid body in a cusp without area


def outline(neck: float) -> Face:
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
    """Mesh `outline` with so many triangles across the neck."""
    bend = SLOPE * RADIUS / 2
    follow = f"({neck - SLOPE * bend!r}+{SLOPE!r}*Sqrt(x^2+y^2+{bend**2!r}))/{float(across)!r}"
    gap = float(RADIUS * (1 - np.sin(BLUNT)))
    high = float(neck / 2 + RADIUS * (1 - np.cos(BLUNT)))
    corners = f"{gap!r}+0.4*Sqrt((Sqrt(x^2)-{RADIUS!r})^2+(Sqrt(y^2)-{high!r})^2)"
    return meshed(outline(neck), [follow, corners], 3.0 * across)


def differences(ratio: float) -> tuple[Array, int]:
    """Relative differences (rotation, axial) of the finite elements from (2) and (3), and the unknowns."""
    response = platform_response(notch_mesh(ratio * RADIUS), PLATE)
    beam = FORMULAS["paros-weisbord"].compliance(
        RADIUS, ratio * RADIUS, PLATE.thickness, PLATE.youngs_modulus, PLATE.poissons_ratio
    )
    ours = np.array([response.compliance[2, 2], response.compliance[0, 0]])
    return ours / np.array([beam.rotation, beam.axial]) - 1, response.unknowns


def limit(steps: Array, values: Array) -> float:
    """Value at step zero of the polynomial through the last four values (k,)."""
    return float(np.polyfit(steps[-4:], values[-4:], 3)[-1])


def run() -> list[Finding]:
    """Limits of the two ratios, the rates at which they are reached, and the first coefficient of the rotation."""
    made = [differences(ratio) for ratio in RATIOS]
    found, tau = np.array([difference for difference, _ in made]), np.array(RATIOS)
    root = np.sqrt(tau)
    with np.errstate(invalid="ignore"):  # a difference that changes sign has no rate, and nan does not pass
        rates = np.log2(found[:-1] / found[1:])  # t/R is halved from one to the next
    listed = [", ".join(f"{100 * value:.2f}" for value in column) for column in found.T]
    notes = [f"differences (%): {values} at t/R = {', '.join(f'{r:g}' for r in RATIOS)}" for values in listed]
    rows = [
        (PAROS_WEISBORD, "rotation over (2), limit", 1.0, 1 + limit(tau, found[:, 0]), 2e-5, notes[0]),
        (PAROS_WEISBORD, "axial over (3), limit", 1.0, 1 + limit(root, found[:, 1]), 5e-4, notes[1]),
        (SLENDER, "rate of the rotation in t/R, limit", 1.0, limit(tau[1:], rates[:, 0]), 0.01, _list(rates[:, 0])),
        (SLENDER, "rate of the axial in t/R, limit", 0.5, limit(root[1:], rates[:, 1]), 0.01, _list(rates[:, 1])),
        (SLENDER, "rotation's difference over t/R, limit", 0.4, limit(tau, found[:, 0] / tau), 0.001, ""),
    ]
    return [
        finding(NAME, source, quantity, target, ours, allowed, unknowns=made[-1][1], note=note)
        for source, quantity, target, ours, allowed, note in rows
    ]


def _list(rates: Array) -> str:
    return "from pair to pair: " + ", ".join(f"{rate:.2f}" for rate in rates)
