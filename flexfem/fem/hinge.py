"""One circular hinge between elastic blocks in plane-stress finite elements: its compliances about the neck's centre.

The quarter of the hinge in x, y > 0 is enough: pulling is even about both axes, bending and shearing are odd about
y = 0, and shearing is odd about x = 0 too. It is meshed as one mapped grid, whose columns run from the neck along the
arc, up the wall of the slot (where the block is higher than the notch) and along the edge of the block, so that meshes
of all refinements belong to one family and extrapolate smoothly. Nothing of it is gmsh's.

At their far ends the blocks carry the stresses of a long beam (none, linear, linear and parabolic). What the blocks
would take up as beams, from the ends of the notch on, is subtracted; the rest is the hinge's and does not depend on
their length. With the stresses given, Poisson's ratio leaves no trace in rotation and axial compliance, and in shear

    E b dy/F_y = (its value at nu = 0) + 2 (6/5) nu 2R/H.

Reason: the stress of a simply connected body under given tractions does not depend on nu (Michell), its energy is
`int [(sxx + syy)^2 - 2 (1 + nu) (sxx syy - sxy^2)] / 2E`, and `sxx syy - sxy^2` is the Hessian determinant of the Airy
function, a divergence: its integral depends on the tractions alone, so it is that of the straight beam of height H
from end to end. See A. V. Cherkaev, K. A. Lurie, G. W. Milton, Proc. R. Soc. Lond. A 438 (1992) 519 (recalled). In
plane strain rotation and axial compliance are therefore those of plane stress times 1 - nu^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import Plate, integration, internal_forces, stiffness_matrix
from flexfem.fem.mesh import StageMesh
from flexfem.fem.problem import Support, Traction, edge_force, mapped, nodes_on, solve_with

FREEDOMS = ("rotation", "axial", "shear")
LEVELS = (4, 6, 8)  # refinements, coarse to fine
LENGTH = 2.0  # of a block, per height: what reaches its end of the notch has faded to e^-8.4, and acts squared
ORDER = 4  # of the compliance in the size of quadratic triangles
ROWS, EDGE = 2, 5  # rows of the base grid, and its columns along the edge of a block
LEAST_ARC = 8  # columns of the base grid along an arc
FLUSH = 1e-6  # relative; a wall shorter than this is no wall
SHEAR_FACTOR = 1.2  # 6/5: exact for the parabolic shear stress in the blocks


class PlaneHinge(NamedTuple):
    """A hinge of radius one in a sheet of modulus and thickness one.

    ratio : t/R.   height : H/h, of the blocks over the notch, h = 2R + t.   length : of a block over its height H.
    """

    ratio: float
    height: float
    length: float = LENGTH

    @property
    def wall(self) -> float:
        """Height of the slot's wall above the arc, in radii."""
        above = (self.height - 1) * (2 + self.ratio) / 2
        return above if above > FLUSH else 0.0

    @property
    def block(self) -> tuple[float, float]:
        """Height and length of a block, in radii."""
        high = 2 + self.ratio + 2 * self.wall
        return high, self.length * high


class Extrapolation(NamedTuple):
    """What a single hinge is meshed for, at vanishing element size, in the order of `FREEDOMS` (k,).

    values : (k,).   bands : (k,), half-widths of their uncertainty.   levels : (l, k), on the meshes.
    unknowns : on the finest mesh.
    """

    values: Array
    bands: Array
    levels: Array
    unknowns: int


def hinge_mesh(hinge: PlaneHinge, refinement: int) -> StageMesh:
    """Mesh the quarter of a hinge: `left` is half the neck, `bottom` the axis, `right` the block's end, `top` free.

    Notes
    -----
    Columns stand on the axis and lean more and more towards the arc's far end, where they keep 45 degrees with it.
    Along the arc they widen as the stress does, angle = sqrt(t/R) sinh(w). The meshes of all refinements cut the
    columns of one base grid evenly, and every corner of the outline is a corner of it.
    """
    tau, wall, (high, length) = hinge.ratio, hinge.wall, hinge.block
    spread = float(np.sqrt(tau))
    end = float(np.arcsinh(np.pi / 2 / spread))
    columns = np.array([_arc_columns(tau), int(np.ceil(3 * wall / (2 + tau))), EDGE])
    first = np.concatenate([[0], np.cumsum(columns)])

    def place(u: Array, v: Array) -> Array:
        column = u * first[-1]
        on_arc, on_wall, on_edge = (
            np.clip((column - start) / max(number, 1), 0.0, 1.0) for start, number in zip(first, columns, strict=False)
        )
        angle = spread * np.sinh(end * on_arc)
        y = tau / 2 + 1 - np.cos(angle)
        foot = np.sin(angle) + y * np.tan(angle / 2) + wall * on_wall + (length - high / 2) * on_edge
        x, y = np.sin(angle) + length * on_edge, y + wall * on_wall
        return np.stack([foot + (x - foot) * v, y * v], axis=-1)

    return mapped(refinement * int(first[-1]), refinement * ROWS, place)


def _arc_columns(tau: float) -> int:
    """Columns of the base grid along the arc: long ones are good enough in a slender neck, whose stress is a beam's."""
    return max(LEAST_ARC, int(np.ceil(2 * np.arcsinh(np.pi / 2 / np.sqrt(tau)) / tau**0.25)))


def compliance(hinge: PlaneHinge, refinement: int, poissons_ratio: float = 0.0) -> Array:
    """Compliances (3,) of a hinge on one mesh: E b R^2 theta/M, E b dx/F_x, E b dy/F_y, in the order of `FREEDOMS`."""
    return compliance_on(hinge_mesh(hinge, refinement), hinge, poissons_ratio)


def compliance_on(mesh: StageMesh, hinge: PlaneHinge, poissons_ratio: float) -> Array:
    """As `compliance`, on any mesh of the quarter with the edges that `hinge_mesh` names.

    Notes
    -----
    A unit load's work on the quarter is a quarter of its work on the hinge, which is the compliance with the blocks'.
    The work is taken as `2 f'u - u'K u`, where round-off in u counts twice over only in the second order, and K u from
    strains: high blocks beside a slender neck turn far as rigid bodies, by which round-off in K would be multiplied.
    """
    plate, batches = Plate(1.0, poissons_ratio, 1.0), integration(mesh)
    K, whole = stiffness_matrix(batches, plate, len(mesh.nodes)).tocsr(), list[float]()
    for traction, supports in zip(_tractions(hinge), _supports(mesh), strict=True):
        force = edge_force(mesh, plate, mesh.edges["right"], traction)
        field = solve_with(K, force, supports).field
        held = internal_forces(batches, plate, field[None])[0]
        whole.append(4 * float(np.sum((2 * force - held) * field)))
    return np.array(whole) - block_compliance(hinge, poissons_ratio)


def block_compliance(hinge: PlaneHinge, poissons_ratio: float) -> Array:
    """Compliances (3,) of the two blocks as beams from the ends of the notch, x = R, to their own, about the centre."""
    high, length = hinge.block
    bending = 8 * ((1 + length) ** 3 - 1) / high**3  # 2 int x^2 dx/(E I)
    shear = SHEAR_FACTOR * 2 * (1 + poissons_ratio) * 2 * length / high
    return np.array([24 * length / high**3, 2 * length / high, bending + shear])


def _tractions(hinge: PlaneHinge) -> tuple[Traction, ...]:
    """Stresses on the end of the block under a unit moment, pull and sideways force through the neck's centre."""
    high, length = hinge.block
    lever = 1 + length

    def bent(points: Array, moment: float) -> Array:
        return 12 * moment * points[..., 1] / high**3

    def moment(points: Array, _: Array) -> Array:
        return np.stack([bent(points, 1.0), np.zeros(points.shape[:-1])], axis=-1)

    def pull(points: Array, _: Array) -> Array:
        return np.broadcast_to([1 / high, 0.0], points.shape)

    def force(points: Array, _: Array) -> Array:
        parabola = 1.5 / high * (1 - (2 * points[..., 1] / high) ** 2)
        return np.stack([bent(points, lever), parabola], axis=-1)

    return moment, pull, force


def _supports(mesh: StageMesh) -> tuple[list[Support], ...]:
    """What symmetry holds on the neck and on the axis, and a node against the rigid motion that it leaves."""
    neck, axis, end = (nodes_on(mesh, label) for label in ("left", "bottom", "right"))
    return (
        [Support(neck, 0), Support(axis, 0), Support(neck[:1], 1)],
        [Support(neck, 0), Support(axis, 1)],
        [Support(neck, 1), Support(axis, 0), Support(end[:1], 1)],
    )


def sample(hinge: PlaneHinge, levels: Sequence[int] = LEVELS, poissons_ratio: float = 0.0) -> Extrapolation:
    """Compliances of a hinge as of `compliance`, over three or more refinements, coarse to fine; relative bands."""
    found = np.array([compliance(hinge, refinement, poissons_ratio) for refinement in levels])
    limits = richardson(levels, found)
    unknowns = 2 * len(hinge_mesh(hinge, levels[-1]).nodes)
    return Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]) / limits[-1], found, unknowns)


def richardson(levels: Sequence[int], values: Array) -> Array:
    """Limits (k - 1, ...) of values (k, ...) from each pair of neighbouring refinements, with the order `ORDER`."""
    n = np.asarray(levels, dtype=float)
    growth = ((n[1:] / n[:-1]) ** ORDER).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[1:] + (values[1:] - values[:-1]) / (growth - 1))
