"""What any correct discretisation holds to round-off, on the curved and distorted meshes where it is hardest."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.assembly import stiffness_matrix
from flexfem.fem.grids import mapped
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, integration, internal_forces, nodal_stress
from flexfem.fem.problem import Solution, clamp, edge_force, nodes_on, solve, uniform
from flexfem.validate.finding import Finding, finding
from flexfem.validate.manufactured import hooke, plate_mesh

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
SLOPES = np.array([[1.3e-3, -0.4e-3], [2.1e-3, 0.7e-3]])  # d_b u_a: stretch, shear and rotation
ROUND_OFF = 5e-12  # relative; the worst of some thousand sums of terms that cancel
SIZE = 0.2  # mm, of the triangles of the plate with arcs
IRONS = "B. M. Irons, A. Razzaque, Experience with the patch test, in: A. K. Aziz (ed.), Academic Press (1972) 557-587"
BETTI = "E. Betti, Teoria della elasticita, Il Nuovo Cimento 7-8 (1872)"
CLAPEYRON = "B. P. E. Clapeyron's theorem, in: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity (1970)"


def distorted() -> StageMesh:
    """A rectangle of 24 triangles with every inner and outer node pushed aside: no side is straight."""
    regular = mapped(4, 3, lambda u, v: np.stack([4.1 * u, 3.2 * v], axis=-1))
    shift = np.random.default_rng(29).uniform(-0.08, 0.08, regular.nodes.shape)
    return regular._replace(nodes=regular.nodes + shift)


def patch() -> list[Finding]:
    """A linear field imposed along the outer sides must come out inside, with its one stress everywhere."""
    mesh = distorted()
    exact = mesh.nodes @ SLOPES.T + [0.011, -0.023]
    outer = np.unique(np.concatenate([nodes_on(mesh, side) for side in mesh.edges]))
    field = solve(mesh, PLATE, np.zeros_like(exact), clamp(outer, exact[outer])).field
    inside = np.setdiff1d(np.arange(len(exact)), outer)
    wanted = hooke(PLATE, SLOPES)[[0, 1, 0], [0, 1, 1]]
    stress = nodal_stress(mesh, PLATE, field)
    worst = {
        "displacement": np.abs(field - exact)[inside].max() / np.abs(exact).max(),
        "stress": np.abs(stress - wanted).max() / np.abs(wanted).max(),
    }
    return [
        finding(
            "patch test",
            IRONS,
            f"largest relative error of the {what}",
            0.0,
            value,
            ROUND_OFF,
            unknowns=2 * len(inside),
            note="24 triangles without one straight side",
        )
        for what, value in worst.items()
    ]


def rigid_motions() -> list[Finding]:
    """The free stiffness matrix has three motions without energy, and no fourth."""
    mesh = distorted()
    values = np.linalg.eigvalsh(stiffness_matrix(integration(mesh), PLATE, len(mesh.nodes)).toarray())
    return [
        finding(
            "rigid-body motions",
            "two translations and one rotation of the plane",
            "eigenvalues that are zero",
            3.0,
            float(np.sum(np.abs(values) < ROUND_OFF * values[-1])),
            0.0,
            unknowns=len(values),
            note=f"the fourth is {values[3] / values[-1]:.1g} of the largest",
        )
    ]


def loaded(mesh: StageMesh, label: str, traction: tuple[float, float]) -> tuple[Solution, Array]:
    """The plate with arcs held on its right side under a uniform traction, MPa, on one label; and its forces."""
    force = edge_force(mesh, PLATE, mesh.edges[label], uniform(*traction))
    return solve(mesh, PLATE, force, clamp(nodes_on(mesh, "held"))), force


def reciprocity() -> list[Finding]:
    """Work of each of two loads on the displacements of the other."""
    mesh = plate_mesh(SIZE)
    (one, first), (other, second) = loaded(mesh, "notch", (3.1, -1.7)), loaded(mesh, "left", (-0.6, 2.3))
    works = np.sum(first * other.field), np.sum(second * one.field)
    return [
        finding(
            "reciprocity",
            BETTI,
            "relative difference of the two works",
            0.0,
            (works[0] - works[1]) / np.abs(works[0]),
            ROUND_OFF,
            unknowns=one.unknowns,
        )
    ]


def balances() -> list[Finding]:
    """Strain energy against the work of the load; force and moment of the supports against the load's."""
    mesh = plate_mesh(SIZE)
    solution, force = loaded(mesh, "notch", (3.1, -1.7))
    work = np.sum(force * solution.field)
    inner = internal_forces(integration(mesh), PLATE, solution.field[None])[0]
    energy = np.sum(inner * solution.field)
    arms = np.column_stack([-mesh.nodes[:, 1], mesh.nodes[:, 0]])
    moment = np.sum(arms * (force + solution.reactions)) / np.sum(np.abs(arms * force))
    resultant = np.abs((force + solution.reactions).sum(axis=0)).max() / np.abs(force.sum(axis=0)).max()
    rows = [
        ("energy balance", CLAPEYRON, "relative difference of twice the strain energy and the work", energy / work - 1),
        ("reaction balance", "equilibrium of forces", "relative sum of loads and reactions", resultant),
        ("reaction balance", "equilibrium of moments", "relative moment of loads and reactions", moment),
    ]
    return [finding(*row[:3], 0.0, row[3], ROUND_OFF, unknowns=solution.unknowns) for row in rows]
