"""Warm bodies with exact answers, free ones without stress and a hot spot in an infinite plate;
fatigue constants.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import ElementBatch, Plate, integration, stress_tensor
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.fem.response import free_displacement
from flexfem.fem.structure import NONE, structure
from flexfem.hinges.strength import fit_basquin, required_law
from flexfem.mechanism.materials import materials

from .fields import Support, on_chords, solve
from .problem import ROUND_OFF, Finding, on_axes, polar, problem, quarter_ring

PLATE = Plate(youngs_modulus=100e3, poissons_ratio=0.3, thickness=1.0)
# alpha dT of the hot spot: as of NAFEMS T1, whose target is the 50 MPa of an infinite plate
STRAIN = 1e-3
HELD = PLATE.youngs_modulus * STRAIN  # MPa
RADIUS = 4.0
INNER = 1.0
OUTER = 13.0  # mm, of the spot, and of the ring that is meshed


def thermal_response(
    mesh: PlaneMesh, plate: Plate, strains: list[Array], supports: list[Support]
) -> tuple[Array, list[Array]]:
    """Displacement (n, 2), mm, and stress by batch (e, 2, 2, q), MPa, for initial strains by batch
    (1, e, 2, 2, q).
    """
    of = structure(mesh, plate, held=NONE)
    load = np.zeros((1, *mesh.nodes.shape))
    for batch, strain in zip(of.batches, strains, strict=True):
        batch.add_forces(load, of.line, stress_tensor(plate, strain))
    field = solve(mesh, plate, load[0], supports).field
    slopes = (
        batch.slopes(of.line, field[None]) - strain
        for batch, strain in zip(of.batches, strains, strict=True)
    )
    return field, [stress_tensor(plate, each)[0] for each in slopes]


def temperature(mesh: PlaneMesh, batch: ElementBatch) -> Array:
    """1, x, y (3, e, q) at the quadrature points of a batch."""
    at = np.einsum("iq,eia->aeq", batch.phi, mesh.nodes[batch.triangles])
    return np.concatenate([np.ones((1, *at.shape[1:])), at])


@problem(
    "Warm free body",
    "that even warming and a gradient leave a free body without stress",
    "exact: a temperature linear in x and y leaves a free body of one metal without stress in "
    "plane stress",
)
def warm_free_body() -> list[Finding]:
    """A quarter of a ring under 1 K, and under a gradient, held as a rigid body is: its largest
    stress.
    """
    mesh = on_chords(quarter_ring(5, 7, 2.0, 9.0))
    corner, far = (np.array([np.argmax(mesh.nodes[:, axis])]) for axis in (0, 1))
    rows = []
    for case, name, hottest in ((0, "1 K everywhere", 1.0), (1, "1 K/mm along x", 9.0)):
        moved = STRAIN * free_displacement(mesh.nodes)[case - 1]
        supports = [
            Support(nodes, axis, moved[nodes, axis])
            for nodes, axis in ((corner, 0), (corner, 1), (far, 0))
        ]
        warm = [STRAIN * temperature(mesh, batch)[case] for batch in integration(mesh)]
        strains = [each[None, :, None, None] * np.eye(2)[..., None] for each in warm]
        stress = thermal_response(mesh, PLATE, strains, supports)[1]
        largest = max(float(np.max(np.abs(each))) for each in stress) / (HELD * hottest)
        what = f"largest stress over E alpha dT, {name}"
        rows.append(Finding(what, 0.0, largest, ROUND_OFF, unknowns=2 * len(mesh.nodes)))
    return rows


@problem(
    "Hot spot",
    "thermal stress against an exact solution",
    "exact: a disc shrunk into an infinite plate (Lame), -E alpha dT/2 all over it. Of NAFEMS, "
    "TNSB rev. 3 (1990), test T1, as the Abaqus Benchmarks Guide tells it, are E, nu, alpha dT "
    "and its target of 50 MPa; its geometry was not found",
)
def hot_spot() -> list[Finding]:
    """A spot warmer than the plate around it: a ring whose edges move as in the infinite plate."""
    mesh = quarter_ring(48, 30, INNER, OUTER)
    centres = [mesh.nodes[batch.triangles[:, :3]].mean(axis=1) for batch in integration(mesh)]
    hot = [np.hypot(*at.T) < RADIUS for at in centres]
    strains = [
        STRAIN * (h[:, None, None, None] * np.eye(2)[..., None] * np.ones(3))[None] for h in hot
    ]
    grown = 0.5 * (1 + PLATE.poissons_ratio) * STRAIN
    supports = on_axes(mesh)
    for side, rate in (("left", grown), ("right", grown * RADIUS**2 / OUTER**2)):
        nodes = nodes_on(mesh, side)
        supports += [Support(nodes, axis, rate * mesh.nodes[nodes, axis]) for axis in (0, 1)]
    means = [each.mean(axis=-1) for each in thermal_response(mesh, PLATE, strains, supports)[1]]
    at = np.concatenate(centres)
    inside = np.concatenate(hot)
    mean = np.concatenate(means)
    distance, _ = polar(at)
    normal = at / distance[:, None]
    radial = np.einsum("ea,eab,eb->e", normal, mean, normal)
    hoop = np.trace(mean, axis1=1, axis2=2) - radial
    over = (distance / RADIUS) ** 2  # stresses beside the spot times this are those right beside it
    targets = {
        "hoop stress in the spot (MPa)": (-HELD / 2, hoop[inside]),
        "radial stress in the spot (MPa)": (-HELD / 2, radial[inside]),
        "hoop stress beside it times (r/a)^2 (MPa)": (HELD / 2, (hoop * over)[~inside]),
        "radial stress beside it times (r/a)^2 (MPa)": (-HELD / 2, (radial * over)[~inside]),
    }
    rows = []
    for what, (target, values) in targets.items():
        furthest = float(values[np.argmax(np.abs(values - target))])
        rows.append(Finding(what, target, furthest, 1e-3 * HELD, unknowns=2 * len(mesh.nodes)))
    return rows


BOOK = "N. E. Dowling, Mechanical Behavior of Materials, 4th ed., Pearson (2013)"
STRESS = (948, 834, 703, 631, 579, 524)
CYCLES = (222, 992, 6004, 14130, 43860, 132150)  # MPa; Table E9.1
TABLE = {"steel-4340": 1643.0, "al-2024-t4": 839.0, "ti-6al-4v-sta": 1889.0}  # A, MPa
ROUNDED = 0.5  # MPa


@problem("Dowling's Example 9.1", "the fit of Basquin's law to points", f"{BOOK}, Example 9.1")
def dowling_fit() -> list[Finding]:
    """The constants of AISI 4340 from six S-N points."""
    found = fit_basquin(STRESS, CYCLES)
    rows = [
        ("A (MPa)", 1587.0, found.A, ROUNDED),
        ("B", -0.0945, found.B, 5e-5),
        ("sigma'_f (MPa)", 1695.0, found.coefficient, ROUNDED),
    ]
    return [Finding(*row, row[-1], unknowns=2) for row in rows]


@problem(
    "Dowling's Table 9.1", "the fatigue constants of the registered materials", f"{BOOK}, Table 9.1"
)
def dowling_table() -> list[Finding]:
    """The stress at one cycle of the table, by the coefficient and exponent that the library has
    from it.
    """
    note = "A recalled, not copied from a print: 2^b sigma'_f of the same row"
    known = {name: float(required_law(materials()[name]).amplitude(1.0)) for name in TABLE}
    return [
        Finding(f"A of {name} (MPa)", target, known[name], ROUNDED, ROUNDED, 1, note)
        for name, target in TABLE.items()
    ]
