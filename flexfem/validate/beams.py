"""Straight beams: MacNeal and Harder's cantilever on regular and distorted meshes, and Timoshenko's exact one."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.grids import mapped, on_chords, size_of
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.problem import clamp, edge_force, errors, nearest_node, nodes_on, solve, traction_of, uniform
from flexfem.validate.finding import Finding, finding, order

MACNEAL_HARDER = "R. H. MacNeal, R. L. Harder, Finite Elem. Anal. Des. 1, 3-20 (1985), straight beam; beam theory"
TIMOSHENKO = (
    "S. P. Timoshenko, J. N. Goodier, Theory of Elasticity (1970) art. 21, as written out by"
    " C. E. Augarde, A. J. Deeks, Finite Elem. Anal. Des. 44, 595-601 (2008)"
)
BEAM, BEAM_HEIGHT, BEAM_LENGTH = Plate(1e7, 0.3, 0.1), 0.2, 6.0
SLANTS = {  # where the lower and the upper ends of the seven cell sides stand
    "regular": ((0, 1, 2, 3, 4, 5, 6), (0, 1, 2, 3, 4, 5, 6)),
    "trapezoidal": ((0, 0.9, 2.1, 2.9, 4.1, 4.9, 6), (0, 1.1, 1.9, 3.1, 3.9, 5.1, 6)),
    "parallelogram": ((0, 0.9, 1.9, 2.9, 3.9, 4.9, 6), (0, 1.1, 2.1, 3.1, 4.1, 5.1, 6)),
}
DEFLECTIONS = {"shear": (1, 0.1081, 5e-5), "extension": (0, 3e-5, 0.0)}  # axis, target, half its last digit
CLAMPED = {"shear": "", "extension": "; the clamped end, which cannot narrow, stiffens it by 0.06 %"}
REFINED = 6  # every cell of the 6 x 1 mesh cut into so many each way
CANTILEVER, CANTILEVER_LENGTH, CANTILEVER_HEIGHT, CANTILEVER_FORCE = Plate(3.1e3, 0.29, 1.3), 2.9, 2.3, 11.0
CANTILEVER_ROWS = (16, 20, 28)  # on coarser meshes, and on longer beams, L2 still falls with nearly h^4
ORDER_ALLOWED = 0.1


def slanted(kind: str, refined: int) -> StageMesh:
    """The cantilever's 6 x 1 cells of one kind, each cut into `refined` by `refined` and then into two triangles."""
    lower, upper = SLANTS[kind]

    def place(u: Array, v: Array) -> Array:
        x = (1 - v) * np.interp(6 * u, range(7), lower) + v * np.interp(6 * u, range(7), upper)
        return np.stack([x, BEAM_HEIGHT * (v - 0.5)], axis=-1)

    return on_chords(mapped(6 * refined, refined, place))  # the middle of a trapezium is not that of its diagonal


def tip(mesh: StageMesh, axis: int) -> float:
    """Mean displacement of the tip under a unit force along an axis, spread evenly over the end."""
    pull = np.eye(2)[axis] / (BEAM_HEIGHT * BEAM.thickness)
    force = edge_force(mesh, BEAM, mesh.edges["right"], uniform(*pull))
    field = solve(mesh, BEAM, force, clamp(nodes_on(mesh, "left"))).field
    return float(np.sum(force * field))


def macneal_harder() -> list[Finding]:
    """Tip displacements on the refined meshes; what the coarse ones give is in the notes."""
    rows = []
    for kind in SLANTS:
        for load, (axis, target, uncertainty) in DEFLECTIONS.items():
            coarse, fine = tip(slanted(kind, 1), axis), slanted(kind, REFINED)
            rows.append(
                finding(
                    "MacNeal-Harder straight beam",
                    MACNEAL_HARDER,
                    f"{load} of the tip, {kind}",
                    target,
                    tip(fine, axis),
                    0.005 * target,
                    uncertainty=uncertainty,
                    unknowns=2 * len(fine.nodes),
                    note=f"6 x 1 cells: {coarse / target:.3f} of the target" + CLAMPED[load],
                )
            )
    return rows


def cantilever_displacement(points: Array) -> Array:
    """(..., 2), mm, of the beam from x = 0 (where its middle is held and level) to the loaded end at x = L."""
    (e, nu, b), L, D = CANTILEVER, CANTILEVER_LENGTH, CANTILEVER_HEIGHT
    x, y = points[..., 0], points[..., 1]
    scale = CANTILEVER_FORCE / (6 * e * b * D**3 / 12)
    along = -y * ((6 * L - 3 * x) * x + (2 + nu) * (y**2 - D**2 / 4))
    across = 3 * nu * y**2 * (L - x) + (4 + 5 * nu) * D**2 * x / 4 + (3 * L - x) * x**2
    return np.asarray(scale * np.stack([along, across], axis=-1))


def cantilever_stress(points: Array) -> Array:
    """(..., 2, 2), MPa: bending linear, shear parabolic, nothing across."""
    inertia = CANTILEVER.thickness * CANTILEVER_HEIGHT**3 / 12
    x, y = points[..., 0], points[..., 1]
    xx = -CANTILEVER_FORCE * (CANTILEVER_LENGTH - x) * y / inertia
    xy = CANTILEVER_FORCE * (CANTILEVER_HEIGHT**2 / 4 - y**2) / (2 * inertia)
    return np.asarray(np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, 0 * xy], axis=-1)], axis=-2))


def timoshenko() -> list[Finding]:
    """The exact field under its own tractions: a cubic, which quadratic triangles reach at their full order."""
    L, D = CANTILEVER_LENGTH, CANTILEVER_HEIGHT
    found, sizes = [], []
    for rows in CANTILEVER_ROWS:
        mesh = mapped(5 * rows // 4, rows, lambda u, v: np.stack([L * u, D * (v - 0.5)], axis=-1))
        force = edge_force(mesh, CANTILEVER, mesh.edges["right"], traction_of(cantilever_stress))
        held = nodes_on(mesh, "left")
        solution = solve(mesh, CANTILEVER, force, clamp(held, cantilever_displacement(mesh.nodes[held])))
        found.append(errors(mesh, CANTILEVER, solution.field, cantilever_displacement, None, cantilever_stress))
        sizes.append(size_of(mesh))
    target = float(cantilever_displacement(np.array([L, 0.0]))[1])
    ours = float(solution.field[nearest_node(mesh, L, 0.0), 1])
    rows_found = [
        ("order of displacement in L2", 3.0, order(sizes, [e.displacement for e in found]), ORDER_ALLOWED),
        ("order of stress in L2", 2.0, order(sizes, [e.stress for e in found]), ORDER_ALLOWED),
        ("deflection of the loaded end", target, ours, 5e-7 * target),
    ]
    return [finding("Timoshenko's cantilever", TIMOSHENKO, *row, unknowns=solution.unknowns) for row in rows_found]
