"""Two membranes whose targets are agreed numbers: NAFEMS LE1 and Cook's."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, nodal_stress
from flexfem.fem.problem import (
    Solution,
    Support,
    clamp,
    edge_force,
    mapped,
    nearest_node,
    nodes_on,
    pressure,
    solve,
    uniform,
)
from flexfem.validate.records import Finding, extrapolated

NAFEMS = "NAFEMS, The Standard NAFEMS Benchmarks, TNSB rev. 3 (1990), test LE1"
COOK = (
    "R. D. Cook, J. Struct. Div. ASCE 100 (ST9), 1851-1863 (1974), with 23.96 as it is widely"
    " quoted for the converged value (its origin not seen; P. Krysl's FinEtools has 23.97)"
)
LE1_PLATE = Plate(youngs_modulus=210e3, poissons_ratio=0.3, thickness=100.0)
LE1_PRESSURE = 10.0  # MPa, outwards
LE1_STRESS, LE1_ROUNDED = 92.7, 0.05  # MPa
LE1_CELLS = (11, 22, 33)  # across, twice as many around; the last gives about 18,000 unknowns
LE1_LIMIT = (16, 32, 64)  # for the extrapolation
COOK_PLATE = Plate(youngs_modulus=1.0, poissons_ratio=1 / 3, thickness=1.0)
COOK_DISPLACEMENT, COOK_SPREAD = 23.96, 0.01
COOK_CELLS = (16, 32, 64)


def elliptic_membrane(cells: int) -> StageMesh:
    """A quarter between two ellipses, mm: `left` the inner, `right` the outer one, `bottom` and `top` the axes."""

    def place(u: Array, v: Array) -> Array:
        u, v = u * (1 + u) / 2, v * (1 + v) / 2  # smaller triangles at D
        angle = v * np.pi / 2
        a, b = 2000.0 + 1250.0 * u, 1000.0 + 1750.0 * u
        return np.stack([a * np.cos(angle), b * np.sin(angle)], axis=-1)

    return mapped(cells, 2 * cells, place)


def solve_le1(mesh: StageMesh) -> tuple[float, Solution]:
    """Stress yy at D, MPa, and the solution."""
    force = edge_force(mesh, LE1_PLATE, mesh.edges["right"], pressure(LE1_PRESSURE))
    axes = [Support(nodes_on(mesh, "top"), 0), Support(nodes_on(mesh, "bottom"), 1)]
    solution = solve(mesh, LE1_PLATE, force, axes)
    stress = nodal_stress(mesh, LE1_PLATE, solution.field)
    return float(stress[nearest_node(mesh, 2000.0, 0.0), 1]), solution


def nafems_le1() -> list[Finding]:
    """Stress at the inner ellipse's end on the long axis."""
    made = [[solve_le1(elliptic_membrane(each)) for each in cells] for cells in (LE1_CELLS, LE1_LIMIT)]
    at, fine = ([stress for stress, _ in found] for found in made)
    limit = extrapolated([1 / cells for cells in LE1_LIMIT], fine)
    listed = [", ".join(f"{stress:.3f}" for stress in stresses) for stresses in (at, fine)]
    rows = (
        ("", at[-1], 0.005 * LE1_STRESS, f"{listed[0]} on {LE1_CELLS} cells across"),
        (", extrapolated", limit, LE1_ROUNDED, f"{listed[1]} on {LE1_LIMIT} cells; seen elsewhere: 92.657"),
    )
    about = [(f"stress yy at D (MPa){what}", LE1_STRESS, ours, allowed, LE1_ROUNDED) for what, ours, allowed, _ in rows]
    return [
        Finding("NAFEMS LE1", NAFEMS, *row, unknowns=found[-1][1].unknowns, note=note)
        for row, (*_, note), found in zip(about, rows, made, strict=True)
    ]


def cooks_membrane(cells: int) -> StageMesh:
    """The tapered panel (0, 0), (48, 44), (48, 60), (0, 44)."""
    return mapped(cells, cells, lambda u, v: np.stack([48.0 * u, (1 - v) * 44.0 * u + v * (44.0 + 16.0 * u)], axis=-1))


def solve_cook(mesh: StageMesh) -> tuple[float, Solution]:
    """Displacement y at the middle of the free end under a unit shear force, and the solution."""
    force = edge_force(mesh, COOK_PLATE, mesh.edges["right"], uniform(0.0, 1.0 / 16.0))
    solution = solve(mesh, COOK_PLATE, force, clamp(nodes_on(mesh, "left")))
    return float(solution.field[nearest_node(mesh, 48.0, 52.0), 1]), solution


def cook() -> list[Finding]:
    """Displacement of Cook's membrane, on the finest mesh and extrapolated."""
    found = [solve_cook(cooks_membrane(cells)) for cells in COOK_CELLS]
    values, unknowns = [value for value, _ in found], found[-1][1].unknowns
    limit = extrapolated([1 / cells for cells in COOK_CELLS], values)
    note = ", ".join(f"{value:.4f}" for value in values) + f" on {COOK_CELLS} cells"
    rows = (("displacement at (48, 52)", values[-1]), ("the same, extrapolated", limit))
    target, allowed = COOK_DISPLACEMENT, (0.001 * COOK_DISPLACEMENT, COOK_SPREAD)
    return [Finding("Cook's membrane", COOK, what, target, ours, *allowed, unknowns, note) for what, ours in rows]
