"""A manufactured solution, whose errors are all known, and what any correct discretisation holds to round-off.

On curved and distorted meshes, where both are hardest.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.mesher import Cone
from flexfem.fem.plane_stress import Plate, integration, internal_forces, nodal_stress, stiffness_matrix
from flexfem.fem.problem import (
    FieldErrors,
    Solution,
    body_force,
    clamp,
    edge_force,
    errors,
    mapped,
    meshed,
    nodes_on,
    on_chords,
    size_of,
    solve,
    traction_of,
    uniform,
)
from flexfem.mechanism.bodies import Face, Segment
from flexfem.validate.records import Finding, order

MANUFACTURED = "manufactured solution"
ROACHE = "P. J. Roache, Code verification by the method of manufactured solutions, J. Fluids Eng. 124, 4-10 (2002)"
PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
MESH_SIZES = (0.2, 0.14, 0.1, 0.07, 0.05)  # mm
ORDERS = {"displacement in L2": 3.0, "its gradient in L2": 2.0, "stress in L2": 2.0}
ORDER_ALLOWED = 0.1
AMPLITUDE = 1e-3  # mm
WAVES = np.array([[5.2, 2.8], [-3.6, 4.4]])  # 1/mm, of the two components: no symmetry, and short enough that the
# field is harder to follow than the arcs: their error falls with the fourth power of h and would raise the order
NOTCH, CORNER = 0.7, 0.5  # mm, radii


class Field(NamedTuple):
    """A smooth displacement: `u_a = A (sin(k_a . x + a) + c_a x^2 y)`, its derivatives and what must hold it."""

    plate: Plate

    def displacement(self, points: Array) -> Array:
        """(..., 2), mm."""
        x, y = points[..., 0], points[..., 1]
        waves = np.sin(points @ WAVES.T + [0.0, 1.0])
        return np.asarray(AMPLITUDE * (waves + np.multiply.outer(x**2 * y, [0.15, -0.1])))

    def gradient(self, points: Array) -> Array:
        """d_b u_a (..., 2, 2)."""
        x, y = points[..., 0], points[..., 1]
        waves = np.cos(points @ WAVES.T + [0.0, 1.0])[..., None] * WAVES
        cubic = np.stack([2 * x * y, x**2], axis=-1)
        return np.asarray(AMPLITUDE * (waves + np.array([0.15, -0.1])[:, None] * cubic[..., None, :]))

    def second(self, points: Array) -> Array:
        """d_b d_c u_a (..., 2, 2, 2), 1/mm."""
        x, y = points[..., 0], points[..., 1]
        waves = -np.sin(points @ WAVES.T + [0.0, 1.0])[..., None, None] * (WAVES[:, :, None] * WAVES[:, None, :])
        cubic = np.stack([np.stack([2 * y, 2 * x], axis=-1), np.stack([2 * x, 0 * x], axis=-1)], axis=-2)
        return np.asarray(AMPLITUDE * (waves + np.array([0.15, -0.1])[:, None, None] * cubic[..., None, :, :]))

    def stress(self, points: Array) -> Array:
        """(..., 2, 2), MPa, by Hooke's law of a thin plate in Young's modulus and Poisson's ratio."""
        return hooke(self.plate, self.gradient(points))

    def body_force(self, points: Array) -> Array:
        """What holds the field, `-div sigma` (..., 2), N/mm^3."""
        slopes = np.moveaxis(self.second(points), -1, -3)  # of the gradient, along the first axis
        stress = hooke(self.plate, slopes)
        return -np.asarray(stress[..., 0, :, 0] + stress[..., 1, :, 1])


def hooke(plate: Plate, gradient: Array) -> Array:
    """Stress (..., 2, 2), MPa, of d_b u_a (..., 2, 2): `xx = E/(1-nu^2) (e_xx + nu e_yy)`, `xy = E/(1+nu) e_xy`.

    Written without Lame constants on purpose: those are what is verified.
    """
    e, nu, _ = plate
    stress = e / (1 + nu) / 2 * (gradient + np.swapaxes(gradient, -1, -2))
    xx, yy = gradient[..., 0, 0], gradient[..., 1, 1]
    stress[..., 0, 0] = e / (1 - nu**2) * (xx + nu * yy)
    stress[..., 1, 1] = e / (1 - nu**2) * (yy + nu * xx)
    return np.asarray(stress)


def outline() -> Face:
    """A plate 3 mm by 2 mm with a half-round notch in its upper side and one round corner."""
    right, bottom, left = 1.5 + NOTCH, 2.0 - NOTCH, 1.5 - NOTCH
    loop = [
        Segment(0j, 3 + 0j),
        Segment(3 + 0j, 3 + 2j),
        Segment(3 + 2j, right + 2j),
        Segment(right + 2j, 1.5 + 1j * bottom, 1.5 + 2j),
        Segment(1.5 + 1j * bottom, left + 2j, 1.5 + 2j),
        Segment(left + 2j, CORNER + 2j),
        Segment(CORNER + 2j, (2 - CORNER) * 1j, CORNER + (2 - CORNER) * 1j),
        Segment((2 - CORNER) * 1j, 0j),
    ]
    return Face(loop, ["bottom", "held", "top", "notch", "notch", "top", "corner", "left"])


def exact_normals(label: str, points: Array, normals: Array) -> Array:
    """Outward normals (..., 2) of the drawn outline: those of straight triangles would hide their error."""
    if label not in ("notch", "corner"):
        return normals
    centre, outwards = ([1.5, 2.0], -1.0) if label == "notch" else ([CORNER, 2.0 - CORNER], 1.0)
    arm = points - np.array(centre)
    return np.asarray(outwards * arm / np.linalg.norm(arm, axis=-1, keepdims=True))


def drawn_traction(exact: Field, label: str, points: Array, normals: Array) -> Array:
    """Traction (..., 2), MPa, of the exact stress on the drawn outline."""
    return traction_of(exact.stress)(points, exact_normals(label, points, normals))


def field_errors(mesh: StageMesh, plate: Plate = PLATE) -> FieldErrors:
    """Errors of the solution on one mesh of `outline`, held on its right side, pulled on all others."""
    exact = Field(plate)
    force = body_force(mesh, plate, exact.body_force)
    for label, edges in mesh.edges.items():
        if label != "held":
            pull = partial(drawn_traction, exact, label)
            force += edge_force(mesh, plate, edges, pull)
    held = nodes_on(mesh, "held")
    solution = solve(mesh, plate, force, clamp(held, exact.displacement(mesh.nodes[held])))
    return errors(mesh, plate, solution.field, exact.displacement, exact.gradient, exact.stress)


def plate_mesh(size: float) -> StageMesh:
    """Mesh `outline` anew with triangles of one size, mm."""
    return meshed(outline(), [Cone(0j, 4.0, size, size, 1.0)])


def manufactured() -> list[Finding]:
    """Observed orders on five meshes, each made anew."""
    meshes = [plate_mesh(size) for size in MESH_SIZES]
    found = np.array([field_errors(mesh) for mesh in meshes])
    straight = np.array([field_errors(on_chords(mesh)) for mesh in meshes])
    sizes, unknowns = [size_of(mesh) for mesh in meshes], 2 * len(meshes[-1].nodes)
    rows = []
    for k, (what, target) in enumerate(ORDERS.items()):
        note = f"straight triangles on the same corners: {order(sizes, straight[:, k]):.2f}"
        row = (f"order of {what}", target, order(sizes, found[:, k]), ORDER_ALLOWED)
        rows.append(Finding(MANUFACTURED, ROACHE, *row, unknowns=unknowns, note=note))
    return rows


SLOPES = np.array([[1.3e-3, -0.4e-3], [2.1e-3, 0.7e-3]])  # d_b u_a: strain, shear and rotation
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
    note = "24 triangles without one straight side"
    rows = [(f"largest relative error of the {what}", 0.0, value, ROUND_OFF) for what, value in worst.items()]
    return [Finding("patch test", IRONS, *row, unknowns=2 * len(inside), note=note) for row in rows]


def rigid_motions() -> list[Finding]:
    """The free stiffness matrix has three motions without energy, and no fourth."""
    mesh = distorted()
    values = np.linalg.eigvalsh(stiffness_matrix(integration(mesh), PLATE, len(mesh.nodes)).toarray())
    zero = float(np.sum(np.abs(values) < ROUND_OFF * values[-1]))
    row = ("two translations and one rotation of the plane", "eigenvalues that are zero", 3.0, zero, 0.0)
    note = f"the fourth is {values[3] / values[-1]:.1g} of the largest"
    return [Finding("rigid-body motions", *row, unknowns=len(values), note=note)]


def loaded(mesh: StageMesh, label: str, traction: tuple[float, float]) -> tuple[Solution, Array]:
    """The plate with arcs held on its right side under a uniform traction, MPa, on one label; and its forces."""
    force = edge_force(mesh, PLATE, mesh.edges[label], uniform(*traction))
    return solve(mesh, PLATE, force, clamp(nodes_on(mesh, "held"))), force


def reciprocity() -> list[Finding]:
    """Work of each of two loads on the displacements of the other."""
    mesh = plate_mesh(SIZE)
    (one, first), (other, second) = loaded(mesh, "notch", (3.1, -1.7)), loaded(mesh, "left", (-0.6, 2.3))
    works = np.sum(first * other.field), np.sum(second * one.field)
    row = ("relative difference of the two works", 0.0, (works[0] - works[1]) / np.abs(works[0]), ROUND_OFF)
    return [Finding("reciprocity", BETTI, *row, unknowns=one.unknowns)]


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
    return [Finding(*row[:3], 0.0, row[3], ROUND_OFF, unknowns=solution.unknowns) for row in rows]
