"""What the problems of this folder share: the table of problems, their findings, meshes and exact
fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array
from flexfem.fem.elements import Plate
from flexfem.fem.mesh import PlaneMesh, mapped, nodes_on

from .fields import (
    FieldErrors,
    Function,
    Solution,
    Support,
    body_force,
    edge_force,
    errors,
    size_of,
    solve,
    traction_of,
)

ROUND_OFF = 1e-9  # relative; 5e-12 is the worst seen, of equations of condition number up to 1e6
ORDER_ALLOWED = 0.1


class MissingSolverError(Exception):
    """Another solver is not installed."""


class Finding(NamedTuple):
    """A published or exact target beside our value.

    quantity : what is compared, with its unit.   allowed : the largest difference that passes, in
    the same unit.
    uncertainty : how well the target itself is known, in its unit; zero for exact ones.
    unknowns : equations solved for `ours`, on the finest mesh.   note : what else is worth knowing.
    band : half-width of the uncertainty that flexfem states with `ours`, in the same unit; zero
    where it states none."""

    quantity: str
    target: float
    ours: float
    allowed: float
    uncertainty: float = 0.0
    unknowns: int = 0
    note: str = ""
    band: float = 0.0

    @property
    def difference(self) -> float:
        """Ours minus target."""
        return float(self.ours) - self.target

    @property
    def passed(self) -> bool:
        """Whether they differ by at most `allowed`, and never for nan."""
        return bool(abs(self.difference) <= self.allowed)


class Problem(NamedTuple):
    """A problem with a known answer.

    title : heading in the manual.   verifies : what would be wrong if it failed.   source :
    citation of the target.
    run : solves it.   slow : whether that takes more than a few seconds, or another solver.
    mechanism : name of the mechanism file that it is about, empty for other problems.
    """

    title: str
    verifies: str
    source: str
    run: Callable[[], list[Finding]]
    slow: bool = False
    mechanism: str = ""


PROBLEMS: dict[str, Problem] = {}


def problem(
    title: str, verifies: str, source: str, slow: bool = False, mechanism: str = ""
) -> Callable[[Callable[[], list[Finding]]], Callable[[], list[Finding]]]:
    """Register a function as a problem, named as the function is with hyphens."""

    def register(run: Callable[[], list[Finding]]) -> Callable[[], list[Finding]]:
        PROBLEMS[run.__name__.replace("_", "-")] = Problem(
            title, verifies, source, run, slow, mechanism
        )
        return run

    return register


def order(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Observed order: slope of the straight line through the logarithms of errors over those of
    mesh sizes.
    """
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def extrapolated(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Limit of the last three values for size zero; sizes must shrink by one ratio (Richardson with
    observed order).

    The finest value itself when the three do not converge monotonically.
    """
    first, second, third = values[-3:]
    if not np.isclose(sizes[-3] / sizes[-2], sizes[-2] / sizes[-1], rtol=1e-6):
        raise ValueError(f"sizes {sizes} do not shrink by one ratio")
    change = (second - first) / (third - second)
    return third + (third - second) / (change - 1) if change > 1 else third


class Exact(NamedTuple):
    """An exact field of a plate: displacement (..., 2), mm, and stress (..., 2, 2), MPa, of points
    (..., 2), mm.

    gradient : `d_b u_a` (..., 2, 2).   body_force : (..., 2), N/mm^3, what holds the field, None
    for nothing."""

    plate: Plate
    displacement: Function
    stress: Function
    gradient: Function | None = None
    body_force: Function | None = None

    def solved(
        self,
        mesh: PlaneMesh,
        loaded: Sequence[str],
        supports: Sequence[Support],
        normals: Mapping[str, Function] = MappingProxyType({}),
    ) -> tuple[Solution, FieldErrors]:
        """The finite elements' answer to the exact tractions on sides of the mesh, and its errors.

        normals : outward normals (..., 2) at points (..., 2) of a side as it was drawn; those of
        the triangles would
            hide how well they follow it.
        """
        force = np.zeros_like(mesh.nodes)
        pull = traction_of(self.stress)
        if self.body_force is not None:
            force += body_force(mesh, self.plate, self.body_force)
        for side in loaded:
            drawn = normals.get(side)
            traction = pull if drawn is None else lambda at, _, drawn=drawn: pull(at, drawn(at))
            force += edge_force(mesh, self.plate, mesh.edges[side], traction)
        solution = solve(mesh, self.plate, force, supports)
        return solution, errors(
            mesh, self.plate, solution.field, self.displacement, self.gradient, self.stress
        )


def orders(
    meshes: Sequence[PlaneMesh], found: Sequence[FieldErrors], unknowns: int
) -> list[Finding]:
    """Observed orders of displacement and stress beside those of quadratic triangles."""
    sizes = [size_of(mesh) for mesh in meshes]
    return [
        Finding(
            f"order of {name} in L2", target, order(sizes, values), ORDER_ALLOWED, unknowns=unknowns
        )
        for name, target, values in (
            ("displacement", 3.0, [each.displacement for each in found]),
            ("stress", 2.0, [each.stress for each in found]),
        )
    ]


def hooke(plate: Plate, gradient: Array) -> Array:
    """Stress (..., 2, 2), MPa, of d_b u_a (..., 2, 2): `xx = E/(1-nu^2) (e_xx + nu e_yy)`, `xy =
    E/(1+nu) e_xy`.

    Written without Lame constants on purpose: those are what is verified.
    """
    e, nu, _ = plate
    stress = e / (1 + nu) / 2 * (gradient + np.swapaxes(gradient, -1, -2))
    xx = gradient[..., 0, 0]
    yy = gradient[..., 1, 1]
    stress[..., 0, 0] = e / (1 - nu**2) * (xx + nu * yy)
    stress[..., 1, 1] = e / (1 - nu**2) * (yy + nu * xx)
    return np.asarray(stress)


def symmetric(xx: Array, xy: Array, yy: Array) -> Array:
    """Tensors (..., 2, 2) of their components."""
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def polar(points: Array) -> tuple[Array, Array]:
    """Distances from the origin and angles of points (..., 2)."""
    return np.hypot(points[..., 0], points[..., 1]), np.arctan2(points[..., 1], points[..., 0])


def on_axes(mesh: PlaneMesh, y_axis: str = "top", x_axis: str = "bottom") -> list[Support]:
    """Supports of a quarter that is cut out along both axes of symmetry."""
    return [Support(nodes_on(mesh, y_axis), 0), Support(nodes_on(mesh, x_axis), 1)]


def rectangle(
    columns: int, rows: int, length: float, height: float, x: float = 0.0, y: float | None = None
) -> PlaneMesh:
    """Cells of a rectangle, mm, from `x` on; `y` is its lower side, by default half of the height
    below the x axis.
    """
    low = -height / 2 if y is None else y
    return mapped(columns, rows, lambda u, v: np.stack([x + length * u, low + height * v], axis=-1))


def cantilever(
    columns: int, rows: int, length: float, height: float, offset: ArrayLike = (0.0, 0.0)
) -> PlaneMesh:
    """A bar clamped on its left whose right end, at the origin but for an offset, is the rigid hub."""
    mesh = rectangle(columns, rows, length, height, x=-length)
    edges = {"ground": mesh.edges["left"], "hub": mesh.edges["right"]}
    return mesh._replace(nodes=mesh.nodes + np.asarray(offset), edges=edges)


def quarter_ring(across: int, around: int, inner: float, outer: float) -> PlaneMesh:
    """A quarter of a ring, radii mm: `left` the inner, `right` the outer arc, `bottom` on x and
    `top` on y.
    """

    def place(u: Array, v: Array) -> Array:
        radius = inner + (outer - inner) * u
        angle = v * np.pi / 2
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)

    return mapped(across, around, place)
