"""Natural frequencies with known answers: NAFEMS FV32, bar and beam in closed form, rigid-body motions at zero."""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import Modes, free_of, lowest, mass_lower, modes, structure
from flexfem.fem.plane_stress import Plate, integration, stiffness_matrix
from flexfem.fem.problem import mapped, nodes_on
from flexfem.validate.records import Finding, extrapolated

NAFEMS = (
    "NAFEMS, The Standard NAFEMS Benchmarks, TNSB rev. 3 (1990), test FV32; not seen itself: targets as "
    "Altair OptiStruct, verification problem OS-V:0440, and FinEtools, tutorial FV32, quote them"
)
FV32 = (44.623, 130.03, 162.70, 246.05, 379.90, 391.44)  # Hz
FV32_ROUNDED = (0.0005, 0.005, 0.005, 0.005, 0.005, 0.005)
FV32_PLATE, FV32_DENSITY = Plate(youngs_modulus=200e3, poissons_ratio=0.3, thickness=50.0), 8000e-12  # tonne/mm^3
FV32_CELLS = (8, 16, 32)
FV32_ALLOWED = 1e-3
RODS = (
    "exact: fixed-free bar, c / 4 L with 8 / pi^2 of its mass; cantilever beam, 1 + cos(x) cosh(x) = 0, whose roots "
    "W. T. Thomson, Theory of Vibration with Applications, appendix D.3, gives as 1.8751 and 4.6941"
)
ROD_PLATE, ROD_DENSITY = Plate(youngs_modulus=70e3, poissons_ratio=0.0, thickness=3.0), 2700e-12
BAR, BEAM = (120.0, 40.0), (500.0, 2.0)  # mm, length and height
BEAM_ROOTS = (1.875104068711961, 4.694091132974175)  # of 1 + cos(x) cosh(x) = 0
SLENDER = 2e-4  # shear and rotary inertia of the second mode of the beam


def tapered(cells: int) -> StageMesh:
    """The membrane of FV32, mm: 10 m long, 5 m wide at the clamped end on the left, 1 m at the right."""
    return mapped(2 * cells, cells, lambda u, v: np.stack([10e3 * u, (v - 0.5) * (5e3 - 4e3 * u)], axis=-1))


def clamped(mesh: StageMesh, plate: Plate, density: float, count: int) -> Modes:
    """Lowest modes of a mesh whose left side is clamped."""
    return modes(structure(mesh, plate, density, free_of(mesh, nodes_on(mesh, "left"))), count)


def nafems_fv32() -> list[Finding]:
    """Six frequencies of the tapered cantilever membrane."""
    found = [clamped(tapered(cells), FV32_PLATE, FV32_DENSITY, 6).frequencies / (2 * math.pi) for cells in FV32_CELLS]
    sizes, unknowns = [1 / cells for cells in FV32_CELLS], 2 * (2 * FV32_CELLS[-1] + 1) * 4 * FV32_CELLS[-1]
    rows = []
    for k, (target, rounded) in enumerate(zip(FV32, FV32_ROUNDED, strict=True)):
        values = [float(each[k]) for each in found]
        note = ", ".join(f"{value:.4f}" for value in values) + f" on {FV32_CELLS} cells across, extrapolated "
        note += f"{extrapolated(sizes, values):.4f}: targets are of a finite mesh themselves, and lie above"
        quantity = f"natural frequency {k + 1} (Hz)"
        allowed = FV32_ALLOWED * target
        rows.append(Finding("NAFEMS FV32", NAFEMS, quantity, target, values[-1], allowed, rounded, unknowns, note))
    return rows


def rods() -> list[Finding]:
    """A bar that lengthens, with the share of its mass in the first mode; a slender beam that bends."""
    speed = math.sqrt(ROD_PLATE.youngs_modulus / ROD_DENSITY)
    bar = _strip(*BAR, 6, 2)
    of_bar = clamped(bar, ROD_PLATE, ROD_DENSITY, 6)
    mass = BAR[0] * BAR[1] * ROD_PLATE.thickness * ROD_DENSITY
    share = 100 * of_bar.participation[:, 0] ** 2 / mass
    axial = int(np.argmax(share))
    beam = _strip(*BEAM, 120, 1)
    of_beam = clamped(beam, ROD_PLATE, ROD_DENSITY, 2).frequencies / (2 * math.pi)
    radius = BEAM[1] / math.sqrt(12)
    bent = [root**2 * speed * radius / (2 * math.pi * BEAM[0] ** 2) for root in BEAM_ROOTS]
    target = speed / (4 * BAR[0])
    found = of_bar.frequencies[axial] / (2 * math.pi)
    rows = [("fixed-free bar, frequency 1 (Hz)", target, found, 1e-5 * target, bar)]
    rows += [("fixed-free bar, share of the mass (%)", 800 / math.pi**2, share[axial], 1e-3, bar)]
    rows += [
        (f"cantilever beam, frequency {k} (Hz)", one, ours, SLENDER * one, beam)
        for k, (one, ours) in enumerate(zip(bent, of_beam, strict=True), start=1)
    ]
    return [
        Finding("vibrating rods", RODS, what, aim, float(ours), allowed, unknowns=2 * len(mesh.nodes))
        for what, aim, ours, allowed, mesh in rows
    ]


def free_motions() -> list[Finding]:
    """Three squared frequencies of a free body over the fourth, which bends it."""
    mesh = tapered(6)
    squares = free_squares(mesh, FV32_PLATE, FV32_DENSITY, 4)
    worst = float(np.max(np.abs(squares[:3])) / squares[3])
    what = "largest squared frequency of three rigid-body motions, over that of the first elastic mode"
    return [
        Finding(
            "free membrane",
            "exact: nothing resists a rigid-body motion",
            what,
            0.0,
            worst,
            1e-8,
            unknowns=2 * len(mesh.nodes),
        )
    ]


def free_squares(mesh: StageMesh, plate: Plate, density: float, count: int) -> Array:
    """Lowest squared frequencies (count,), (rad/s)^2, of a mesh that nothing holds, by a shift below zero."""
    tied = free_of(mesh, np.empty(0, dtype=np.int64))
    half = mass_lower(mesh, plate.thickness * density, tied).tocsc()
    M, K = (half + sp.tril(half, -1).T).tocsc(), stiffness_matrix(integration(mesh), plate, len(mesh.nodes))
    shift = -1e-4 * float(K.diagonal().mean() / M.diagonal().mean())
    return lowest(factorise(sp.tril(K - shift * M).tocoo()), M, count, shift)[0]


def _strip(length: float, height: float, columns: int, rows: int) -> StageMesh:
    return mapped(columns, rows, lambda u, v: np.stack([length * u, height * v], axis=-1))
