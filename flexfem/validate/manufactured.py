"""A field chosen beforehand on a plate with arcs: its body force and tractions are known, so is every error."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.grids import meshed, on_chords, size_of
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.problem import FieldErrors, body_force, clamp, edge_force, errors, nodes_on, solve, traction_of
from flexfem.stage.outline import Face, Segment
from flexfem.validate.finding import Finding, finding, order

NAME = "manufactured solution"
SOURCE = "P. J. Roache, Code verification by the method of manufactured solutions, J. Fluids Eng. 124, 4-10 (2002)"
PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
SIZES = (0.2, 0.14, 0.1, 0.07, 0.05)  # mm
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
    return meshed(outline(), [f"{size!r}"], 2 * np.pi * CORNER / size)


def run() -> list[Finding]:
    """Observed orders on five meshes, each made anew."""
    meshes = [plate_mesh(size) for size in SIZES]
    found = np.array([field_errors(mesh) for mesh in meshes])
    straight = np.array([field_errors(on_chords(mesh)) for mesh in meshes])
    sizes = [size_of(mesh) for mesh in meshes]
    return [
        finding(
            NAME,
            SOURCE,
            f"order of {what}",
            target,
            order(sizes, found[:, k]),
            ORDER_ALLOWED,
            unknowns=2 * len(meshes[-1].nodes),
            note=f"straight triangles on the same corners: {order(sizes, straight[:, k]):.2f}",
        )
        for k, (what, target) in enumerate(ORDERS.items())
    ]
