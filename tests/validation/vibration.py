"""Natural frequencies with known answers: NAFEMS FV32, bars, beams in both planes, and a plate with
a rigid disc.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq
from scipy.special import iv, ivp, jv, jvp, kv, kvp, yv, yvp

from flexfem.arrays import Array
from flexfem.fem.elements import Plate, mirrored
from flexfem.fem.mesh import PlaneMesh, Sector, by_radius, mapped, nodes_on
from flexfem.fem.modes import Modes, modes, sector_modes, vibrating_structure
from flexfem.fem.structure import mass_of, structure
from flexfem.paper.frames import CHAIN_TURN

from .problem import Finding, cantilever, extrapolated, problem, rectangle

FV32 = (44.623, 130.03, 162.70, 246.05, 379.90, 391.44)  # Hz
FV32_ROUNDED = (0.0005, 0.005, 0.005, 0.005, 0.005, 0.005)
FV32_PLATE = Plate(youngs_modulus=200e3, poissons_ratio=0.3, thickness=50.0)
FV32_DENSITY = 8000e-12  # tonne/mm^3
FV32_CELLS = (8, 16, 32)


def tapered(cells: int) -> PlaneMesh:
    """The membrane of FV32, mm: 10 m long, 5 m wide at the clamped end on the left, 1 m at the
    right.
    """
    return mapped(
        2 * cells, cells, lambda u, v: np.stack([10e3 * u, (v - 0.5) * (5e3 - 4e3 * u)], axis=-1)
    )


def clamped(mesh: PlaneMesh, plate: Plate, density: float, count: int) -> Modes:
    """Lowest modes of a mesh whose left side is clamped."""
    held = structure(mesh, plate, held=nodes_on(mesh, "left"))
    return modes(vibrating_structure(mass_of(held, density)), count)


@problem(
    "NAFEMS FV32, tapered membrane",
    "the mass matrix and natural frequencies in the plane",
    "NAFEMS, The Standard NAFEMS Benchmarks, TNSB rev. 3 (1990), test FV32; not seen itself: "
    "targets as Altair OptiStruct, verification problem OS-V:0440, and FinEtools, tutorial FV32, "
    "quote them",
)
def nafems_fv32() -> list[Finding]:
    """Six frequencies of the tapered cantilever membrane."""
    found = [
        clamped(tapered(cells), FV32_PLATE, FV32_DENSITY, 6).frequencies / (2 * math.pi)
        for cells in FV32_CELLS
    ]
    sizes = [1 / cells for cells in FV32_CELLS]
    unknowns = 2 * (2 * FV32_CELLS[-1] + 1) * 4 * FV32_CELLS[-1]
    rows = []
    for k, (target, rounded, values) in enumerate(
        zip(FV32, FV32_ROUNDED, np.array(found).T, strict=True), start=1
    ):
        note = (
            ", ".join(f"{value:.4f}" for value in values)
            + f" on {FV32_CELLS} cells across, extrapolated "
        )
        note += (
            f"{extrapolated(sizes, values):.4f}: targets are of a finite mesh themselves, and lie "
            "above"
        )
        what = f"natural frequency {k} (Hz)"
        rows.append(
            Finding(what, target, float(values[-1]), 1e-3 * target, rounded, unknowns, note)
        )
    return rows


E = 70e3
DENSITY = 2700e-12  # MPa, tonne/mm^3
BAR = (120.0, 40.0)
BEAM = (500.0, 2.0)
ROD_THICKNESS = 3.0  # mm, length and height
BEAM_ROOTS = (1.875104068711961, 4.694091132974175)  # of 1 + cos(x) cosh(x) = 0
LENGTH = 300.0
HEIGHT = 4.0
THICKNESS = 2.5  # mm, of the cantilever in three dimensions
SLENDER = 2e-4  # shear and rotary inertia of the second mode of the beam
DEEPER = 8e-4  # the same across the height: 22 (r / L)^2 (1 + E / (kappa G)) / 2
RODS = (
    "exact: fixed-free bar, c / 4 L with 8 / pi^2 of its mass; cantilever beam, 1 + cos(x) "
    "cosh(x) = 0, whose roots W. T. Thomson, Theory of Vibration with Applications, appendix "
    "D.3, gives as 1.8751 and 4.6941"
)


def bending_hertz(root: float, length: float, depth: float) -> float:
    """Frequency, Hz, of a cantilever of Bernoulli and Euler with a root of its equation."""
    return root**2 * math.sqrt(E / DENSITY / 12) * depth / (2 * math.pi * length**2)


@problem("Vibrating rods", "axial and bending modes, and the shares of mass in them", RODS)
def vibrating_rods() -> list[Finding]:
    """A bar that lengthens, with the share of its mass in the first mode; a slender beam that
    bends.
    """
    plate = Plate(E, 0.0, ROD_THICKNESS)
    bar = rectangle(6, 2, *BAR)
    beam = rectangle(120, 1, *BEAM)
    of_bar = clamped(bar, plate, DENSITY, 6)
    of_beam = clamped(beam, plate, DENSITY, 2)
    share = 100 * of_bar.participation[:, 0] ** 2 / (BAR[0] * BAR[1] * ROD_THICKNESS * DENSITY)
    axial = int(np.argmax(share))
    target = math.sqrt(E / DENSITY) / (4 * BAR[0])
    found = float(of_bar.frequencies[axial] / (2 * math.pi))
    unknowns = 2 * len(bar.nodes)
    rows = [
        Finding("fixed-free bar, frequency 1 (Hz)", target, found, 1e-5 * target, unknowns=unknowns)
    ]
    rows.append(
        Finding(
            "fixed-free bar, share of the mass (%)",
            800 / math.pi**2,
            share[axial],
            1e-3,
            unknowns=unknowns,
        )
    )
    for k, root in enumerate(BEAM_ROOTS):
        target = bending_hertz(root, *BEAM)
        ours = float(of_beam.frequencies[k] / (2 * math.pi))
        what = f"cantilever beam, frequency {k + 1} (Hz)"
        unknowns = 2 * len(beam.nodes)
        rows.append(Finding(what, target, ours, SLENDER * target, unknowns=unknowns))
    return rows


@problem("Bent beam", "bending modes in and out of the plane, in each half of the thickness", RODS)
def bent_beam() -> list[Finding]:
    """Two frequencies of bending in the plane, in the symmetric half, and two out of it, in the
    antisymmetric one.
    """
    mesh = cantilever(60, 1, LENGTH, HEIGHT)
    layers = mirrored(THICKNESS, 1, THICKNESS)
    rows = []
    for which, half, depth in (("in", layers, HEIGHT), ("out of", layers.antisymmetric, THICKNESS)):
        found = modes(
            vibrating_structure(mass_of(structure(mesh, Plate(E, 0.0, THICKNESS), half), DENSITY)),
            2,
        )
        for k, root in enumerate(BEAM_ROOTS):
            target = bending_hertz(root, LENGTH, depth)
            ours = float(found.frequencies[k] / (2 * math.pi))
            what = f"cantilever, frequency {k + 1} of bending {which} the plane (Hz)"
            rows.append(Finding(what, target, ours, DEEPER * target, unknowns=found.structure.size))
    return rows


RADIUS = 60.0
HUB = 12.0
SHEET = 1.5  # mm, of the annular plate
DISC = (
    40e-6,
    4e-3,
)  # tonne, tonne mm^2: of the disc in its middle, and its moment of inertia about a diameter
# thin-plate theory, and the mesh: +0.3 %, 0.1 % with twice as many triangles along each side
KIRCHHOFF = 5e-3


def third(columns: int, rows: int, twist: float = 0.0) -> Sector:
    """A third of an annulus, clamped around, its middle a hub; its cuts are twisted, rad, from
    inside to outside.
    """

    def place(u: Array, v: Array) -> Array:
        r = HUB + (RADIUS - HUB) * u
        angle = CHAIN_TURN * v + twist * u
        return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)

    mesh = mapped(columns, rows, place)
    names = {"left": "hub", "right": "ground", "bottom": "cut behind", "top": "cut ahead"}
    mesh = mesh._replace(edges={names[side]: edge for side, edge in mesh.edges.items()})
    ends = np.concatenate([mesh.edges["hub"], mesh.edges["ground"]])
    behind, ahead = (
        by_radius(mesh.nodes, mesh.edges[f"cut {side}"]) for side in ("behind", "ahead")
    )
    return Sector(mesh, behind[~np.isin(behind, ends)], ahead[~np.isin(ahead, ends)])


def annulus(sectors: int) -> Modes:
    """Three modes out of the plane of an annular plate with a rigid disc, of one sector turned, or
    of three.
    """
    carried = np.diag([DISC[0], DISC[1], DISC[1]])
    layers = mirrored(SHEET, 1, SHEET).antisymmetric
    return sector_modes(
        (third(14, 10),) * sectors, Plate(E, 0.3, SHEET), layers, DENSITY, carried, 3
    )


def rigid_middle(nodal: int, poissons_ratio: float = 0.3) -> float:
    """Lowest frequency, Hz, of the plate with the disc, of 0 or 1 nodal diameters, by thin-plate
    theory.

    Notes
    -----
    `w = A J_n(k r) + B Y_n(k r) + C I_n(k r) + F K_n(k r)`, `k^4 = rho b omega^2 / D`; w and its
    slope vanish outside. On the disc of radius a, mass m, moment of inertia I about a diameter: `w'
    = 0`, `m omega^2 w = 2 pi a D (L w)'`; or `w' = w / a`, `I omega^2 w / a = pi a D (a (L w)' -
    w'')`, with L the Laplacian: -k^2 on J and Y, k^2 on I and K."""
    D = E * SHEET**3 / (12 * (1 - poissons_ratio**2))
    a = HUB
    mass, inertia = DISC

    def determinant(k: float) -> float:
        square = k**4 * D / (DENSITY * SHEET)

        def at(r: float) -> tuple[Array, ...]:
            w = np.array([f(nodal, k * r) for f in (jv, yv, iv, kv)])
            slope, curve = (
                k**times * np.array([f(nodal, k * r, times) for f in (jvp, yvp, ivp, kvp)])
                for times in (1, 2)
            )
            return w, slope, curve, k**2 * np.array([-1.0, -1.0, 1.0, 1.0]) * slope

        w, slope, curve, laplace = at(a)
        outside = at(RADIUS)
        if nodal == 0:
            inner = [slope, mass * square * w - 2 * math.pi * a * D * laplace]
        else:
            inner = [
                slope - w / a,
                inertia * square * w / a - math.pi * a * D * (a * laplace - curve),
            ]
        matrix = np.array([*inner, *outside[:2]])
        matrix /= np.abs(matrix).max(axis=1, keepdims=True)
        return float(np.linalg.det(matrix / np.abs(matrix).max(axis=0)))

    steps = np.linspace(0.5, 9.0, 100) / RADIUS
    low, high = next((a, b) for a, b in pairwise(steps) if determinant(a) * determinant(b) < 0)
    return (
        float(brentq(determinant, low, high)) ** 2
        * math.sqrt(D / (DENSITY * SHEET))
        / (2 * math.pi)
    )


@problem(
    "Annular plate",
    "modes out of the plane, in one sector of three and in the whole",
    "exact: A. W. Leissa, Vibration of Plates, NASA SP-160 (1969), section 2: Bessel functions; "
    "rigid disc added",
)
def annular_plate() -> list[Finding]:
    """The disc rises, and tilts in any direction: in one sector of three, and in the whole."""
    rise, tilt = (rigid_middle(nodal) for nodal in (0, 1))
    rows = []
    for which, found in (("one sector of three", annulus(1)), ("the whole", annulus(3))):
        hertz = found.frequencies / (2 * math.pi)
        for what, target, ours in (
            ("rises", rise, hertz[0]),
            ("tilts", tilt, hertz[1]),
            ("tilts", tilt, hertz[2]),
        ):
            quantity = f"frequency at which the disc {what} (Hz), {which}"
            rows.append(
                Finding(
                    quantity, target, float(ours), KIRCHHOFF * target, unknowns=found.structure.size
                )
            )
    return rows
