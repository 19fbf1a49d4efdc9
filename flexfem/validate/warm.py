"""Warm bodies with exact answers: free ones without stress, and a hot spot in an infinite plate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.heat import free_displacement
from flexfem.fem.mesh import StageMesh, quadrature, shape_functions
from flexfem.fem.plane_stress import (
    QUADRATURE,
    ElementBatch,
    Plate,
    add_nodal_forces,
    integration,
    slopes_of,
    stress_tensor,
)
from flexfem.fem.problem import Support, mapped, nodes_on, on_chords, solve
from flexfem.validate.records import Finding

PLATE = Plate(youngs_modulus=100e3, poissons_ratio=0.3, thickness=1.0)
STRAIN = 1e-3  # alpha dT of the hot spot: as of NAFEMS T1, whose target is the 50 MPa of an infinite plate
HELD = PLATE.youngs_modulus * STRAIN  # MPa
FREE = "exact: a temperature linear in x and y leaves a free body of one metal without stress in plane stress"
SPOT = (
    "exact: a disc shrunk into an infinite plate (Lame), -E alpha dT/2 all over it. Of NAFEMS, TNSB rev. 3"
    " (1990), test T1, as the Abaqus Benchmarks Guide tells it, are E, nu, alpha dT and its target of 50 MPa; its"
    " geometry was not found"
)
RADIUS, INNER, OUTER = 4.0, 1.0, 13.0  # mm, of the spot, and of the ring that is meshed
FREE_CELLS, SPOT_CELLS = (5, 7), (48, 30)


class Warmed(NamedTuple):
    """Displacement (n, 2), mm, and stress beyond the free strain by batch (e, 2, 2, q), MPa."""

    field: Array
    stress: list[Array]


def ring(columns: int, rows: int, inner: float, outer: float) -> StageMesh:
    """A quarter of a ring, radii mm: `left` the inner, `right` the outer arc, `bottom` on X and `top` on Y."""

    def place(u: Array, v: Array) -> Array:
        radius, angle = inner + (outer - inner) * u, v * np.pi / 2
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)

    return mapped(columns, rows, place)


def warmed(mesh: StageMesh, plate: Plate, strains: list[Array], supports: list[Support]) -> Warmed:
    """Solve for initial strains by batch (1, e, 2, 2, q)."""
    batches = integration(mesh)
    load = np.zeros((1, *mesh.nodes.shape))
    for batch, strain in zip(batches, strains, strict=True):
        add_nodal_forces(load, batch, plate, stress_tensor(plate, strain))
    field = solve(mesh, plate, load[0], supports).field
    slopes = (slopes_of(batch, field[None]) - strain for batch, strain in zip(batches, strains, strict=True))
    return Warmed(field, [stress_tensor(plate, each)[0] for each in slopes])


def free_bodies() -> list[Finding]:
    """A quarter of a ring under 1 K, and under a gradient, held as a rigid body is: its largest stress."""
    mesh = on_chords(ring(*FREE_CELLS, 2.0, 9.0))
    corner, far = (np.array([np.argmax(mesh.nodes[:, axis])]) for axis in (0, 1))
    found = []
    for case, name in ((0, "1 K everywhere"), (1, "1 K/mm along x")):
        moved = STRAIN * free_displacement(mesh.nodes)[case]
        supports = [Support(nodes, axis, moved[nodes, axis]) for nodes, axis in ((corner, 0), (corner, 1), (far, 0))]
        warm = [STRAIN * temperature(mesh, batch)[case] for batch in integration(mesh)]
        strains = [each[None, :, None, None] * np.eye(2)[..., None] for each in warm]
        of = warmed(mesh, PLATE, strains, supports)
        held = HELD * (1.0, 9.0)[case]
        largest = max(float(np.max(np.abs(each))) for each in of.stress) / held
        note = "limited by round-off of the solution, over the size of triangles" if case == 0 else ""
        said = f"largest stress over E alpha dT, {name}"
        found.append(Finding("warm-free-body", FREE, said, 0.0, largest, 1e-12, 0.0, 2 * len(mesh.nodes), note))
    return found


def temperature(mesh: StageMesh, batch: ElementBatch) -> Array:
    """1, x, y (3, e, q) at the quadrature points of a batch."""
    values, _ = shape_functions(quadrature(QUADRATURE)[0])
    at = np.einsum("iq,eia->aeq", values, mesh.nodes[batch.triangles])
    return np.concatenate([np.ones((1, *at.shape[1:])), at])


def hot_spot() -> list[Finding]:
    """A spot warmer than the plate around it: a ring whose edges move as in the infinite plate."""
    mesh = ring(*SPOT_CELLS, INNER, OUTER)
    batches = integration(mesh)
    centres = [mesh.nodes[batch.triangles[:, :3]].mean(axis=1) for batch in batches]
    hot = [np.hypot(*at.T) < RADIUS for at in centres]
    strains = [STRAIN * (h[:, None, None, None] * np.eye(2)[..., None] * np.ones(3))[None] for h in hot]
    grown = 0.5 * (1 + PLATE.poissons_ratio) * STRAIN
    inner, outer = nodes_on(mesh, "left"), nodes_on(mesh, "right")
    supports = [Support(nodes_on(mesh, "bottom"), 1), Support(nodes_on(mesh, "top"), 0)]
    for nodes, rate in ((inner, grown), (outer, grown * RADIUS**2 / OUTER**2)):
        supports += [Support(nodes, axis, rate * mesh.nodes[nodes, axis]) for axis in (0, 1)]
    means = [each.mean(axis=-1) for each in warmed(mesh, PLATE, strains, supports).stress]
    at, inside, mean = np.concatenate(centres), np.concatenate(hot), np.concatenate(means)
    normal = at / np.hypot(*at.T)[:, None]
    radial = np.einsum("ea,eab,eb->e", normal, mean, normal)
    hoop = np.trace(mean, axis1=1, axis2=2) - radial
    over = (np.hypot(*at.T) / RADIUS) ** 2  # stresses beside the spot times this are those right beside it
    targets = {
        "hoop stress in the spot, MPa": (-HELD / 2, hoop[inside]),
        "radial stress in the spot, MPa": (-HELD / 2, radial[inside]),
        "hoop stress beside it times (r/a)^2, MPa": (HELD / 2, (hoop * over)[~inside]),
        "radial stress beside it times (r/a)^2, MPa": (-HELD / 2, (radial * over)[~inside]),
    }
    unknowns = 2 * len(mesh.nodes)
    return [
        Finding("hot-spot", SPOT, said, target, _furthest(values, target), 1e-3 * HELD, 0.0, unknowns)
        for said, (target, values) in targets.items()
    ]


def _furthest(values: Array, target: float) -> float:
    return float(values[np.argmax(np.abs(values - target))])
