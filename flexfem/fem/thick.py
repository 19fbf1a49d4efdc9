"""One circular hinge between elastic blocks in three dimensions: what its thickness does to its compliance.

The hinge is its plane section times a line, and so are its finite elements: curved quadratic triangles times quadratic
segments (wedges of 18 nodes), whose stiffness is a sum of Kronecker products of integrals over the section and over
the line. An eighth of the hinge is enough, x, y, z > 0: pulling is even about all three planes, bending is odd about
y = 0. The blocks are as high as the notch and carry the stresses of a long beam, uniform over the thickness b.

The result is the position p between plane stress and plane strain, C = C_ps (1 - nu^2 p), from the energies of the
three-dimensional and of the plane-stress solution on the same section, so that their mesh errors cancel. The blocks
are thick plates too, but need no correction: pulled or bent by such stresses, a straight bar has the compliance of
Young's modulus in either theory, whatever b, so that the blocks drop out of the difference of the two and are
subtracted from the plane-stress compliance it is divided by.

p lies in 0..1: plane stress is statically admissible, plane strain kinematically. p = 1 is in general not reached for
b -> infinity, because the hinge may contract as a whole. Then e_zz is linear over the section, and with its energy
minimised for a given length of blocks, A and I the section's area and its second moment about x,

    C_ps(hinge) nu^2 (1 - p) = nu^2/E [ L^2/A - (L - 2R)/H ]   axial,   nu^2/E [ L^2/I - 12 (L - 2R)/H^3 ]   rotation,

since `int (s_xx + s_yy) dA = F L` and `int y (s_xx + s_yy) dA = M L` hold for any stress in equilibrium. Our algebra.

The stress factor is the highest von Mises stress in the notch, over the whole thickness, over that of the plane-stress
solution on the same section under the same moment or force. In a wide neck it lies near the free faces, about t away.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Plate, layered, nodal_stress, solid_nodal_stress, solid_von_mises, von_mises
from flexfem.fem.extrusion import (
    Line,
    displacement,
    line_integrals,
    plane_stiffness,
    section_integrals,
    solid_stiffness,
)
from flexfem.fem.hinge import Extrapolation, richardson
from flexfem.fem.mesh import StageMesh
from flexfem.fem.problem import edge_force, mapped, nodes_on

FREEDOMS = ("rotation", "axial")
LEVELS = (2, 3, 4)  # refinements, coarse to fine
LENGTH = 2.0  # of a block at least, per height; and at least b, for the blocks to even out what differs over b
LEAST_ARC = 3  # columns of the base grid along an arc
EDGE = 2  # its columns along a block two heights long
LAYERS = 0.5  # its layers for every e-fold of their thickness
SURFACE = 2.0  # thickness of the outermost layers, per t: below the free surface the stress changes over about t


class ThickHinge(NamedTuple):
    """A hinge of radius one and modulus one.

    ratio : t/R.   width : b/t.   poissons_ratio : of the material.
    length : of a block, in radii; 0 for the one of the chart, which is long against height and thickness.
    """

    ratio: float
    width: float
    poissons_ratio: float
    length: float = 0.0

    @property
    def block(self) -> tuple[float, float]:
        """Height and length of a block, in radii."""
        high = 2.0 + self.ratio
        return high, self.length or max(LENGTH * high, self.width * self.ratio)


def section_mesh(hinge: ThickHinge, refinement: int) -> StageMesh:
    """Mesh the quarter of the section: `left` is half the neck, `bottom` the axis, `right` the block's end, `top` free.

    Notes
    -----
    Columns and their spacing along the arc are those of `hinge.hinge_mesh`; along the block they widen with the
    distance from the notch. The block's triangles are straight, so that a beam's displacement is exact there.
    """
    tau, (high, length) = hinge.ratio, hinge.block
    spread = float(np.sqrt(tau))
    end = float(np.arcsinh(np.pi / 2 / spread))
    arc = max(LEAST_ARC, int(np.ceil(end / tau**0.25)))
    rows = int(np.ceil(1.4 * tau**0.25))  # one is enough in a slender neck, whose stress is a beam's
    edge = int(np.ceil(EDGE * np.arcsinh(2 * length / high) / np.arcsinh(4)))

    def place(u: Array, v: Array) -> Array:
        column = u * (arc + edge)
        angle = spread * np.sinh(end * np.clip(column / arc, 0.0, 1.0))
        along = _widening(np.clip((column - arc) / edge, 0.0, 1.0), high / 2, length)
        y = tau / 2 + 1 - np.cos(angle)
        x = np.sin(angle) + along
        foot = x + y * np.tan(angle / 2) - along * high / 2 / length
        return np.stack([foot + (x - foot) * v, y * v], axis=-1)

    mesh = mapped(refinement * (arc + edge), refinement * rows, place)
    in_block = mesh.nodes.sum(axis=1) >= 1 + high / 2 - 1e-9 * length  # beyond the column at the end of the arc
    block = mesh.triangles[in_block[mesh.triangles[:, :3]].all(axis=1)]
    nodes = mesh.nodes.copy()
    nodes[block[:, 3:]] = (nodes[block[:, :3]] + nodes[block[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)


def layers(hinge: ThickHinge, refinement: int) -> Array:
    """Bounds of the layers (k + 1,), in radii, from the mid-plane z = 0 to the free surface, thinner towards it."""
    half, surface = hinge.width * hinge.ratio / 2, SURFACE * hinge.ratio
    number = refinement * int(np.ceil(LAYERS * np.arcsinh(half / surface)))
    return half - _widening(np.linspace(1.0, 0.0, number + 1), surface, half)


def _widening(s: Array, scale: float, total: float) -> Array:
    """Points 0..total for s in 0..1, evenly spaced up to about `scale` and then in a geometric progression."""
    return np.asarray(scale * np.sinh(np.arcsinh(total / scale) * s))


def factor(hinge: ThickHinge, refinement: int) -> Array:
    """Compliance (2,) in three dimensions over the one in plane stress, on one mesh, in the order of `FREEDOMS`."""
    plane, excess, _ = _compliances(hinge, refinement)
    return 1 + excess / plane


def position(hinge: ThickHinge, refinement: int) -> Array:
    """Position p (2,) between plane stress, 0, and plane strain, 1, on one mesh; Poisson's ratio must not be zero."""
    plane, excess, _ = _compliances(hinge, refinement)
    return -excess / plane / hinge.poissons_ratio**2


def sample(hinge: ThickHinge, levels: Sequence[int] = LEVELS) -> Extrapolation:
    """Positions of a hinge between plane stress and plane strain over three or more refinements, coarse to fine.

    Notes
    -----
    The band is what the finest mesh moves the extrapolated value by, far more than what is left after it.
    """
    made = [_compliances(hinge, refinement) for refinement in levels]
    found = np.array([-excess / plane for plane, excess, _ in made]) / hinge.poissons_ratio**2
    limits = richardson(levels, found)
    return Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]), found, made[-1][2])


def stress_factors(hinge: ThickHinge, levels: Sequence[int] = LEVELS[1:]) -> Extrapolation:
    """Highest von Mises stress over that in plane stress, under a moment and a pull (2,); of two or more refinements.

    Notes
    -----
    The value is that of the finest mesh, the band what the finest mesh moves it by.
    """
    found, unknowns = [], 0
    for refinement in levels:
        of, plate = _solved(hinge, refinement), Plate(1.0, hinge.poissons_ratio, 1.0)
        near, line = np.flatnonzero(np.hypot(*of.mesh.nodes.T) <= 1.0), layered(layers(hinge, refinement))
        thin = [von_mises(nodal_stress(of.mesh, plate, u.reshape(2, -1).T))[near].max() for u in of.plane]
        fields = [u.reshape(3, len(of.mesh.nodes), -1).transpose(1, 2, 0) for u in of.solid]
        thick = [solid_von_mises(solid_nodal_stress(of.mesh, plate, line, each, near)).max() for each in fields]
        found.append(np.divide(thick, thin))
        unknowns = len(of.solid[0])
    return Extrapolation(found[-1], np.abs(found[-1] - found[-2]), np.array(found), unknowns)


def _compliances(hinge: ThickHinge, refinement: int) -> tuple[Array, Array, int]:
    """Plane-stress compliances (2,) less the blocks', what three dimensions add to them (2,), number of unknowns."""
    of, (high, length) = _solved(hinge, refinement), hinge.block
    blocks, half = np.array([24 * length / high**3, 2 * length / high]), of.line.whole.sum()
    thin = np.array([flat @ u for flat, u in zip(of.loads, of.plane, strict=True)])
    thick = [_extruded(flat, of.line.whole) @ u / half for flat, u in zip(of.loads, of.solid, strict=True)]
    return 4 * thin - blocks, 4 * (thick - thin), len(of.solid[0])  # a quarter of the work is done on the quarter


class _Solved(NamedTuple):
    """Displacements on one mesh in plane stress, (2n,), and in three dimensions, (3nm,), under `_loads`."""

    mesh: StageMesh
    line: Line
    loads: list[Array]
    plane: list[Array]
    solid: list[Array]


def _solved(hinge: ThickHinge, refinement: int) -> _Solved:
    mesh, line, nu = section_mesh(hinge, refinement), line_integrals(layers(hinge, refinement)), hinge.poissons_ratio
    section, number = section_integrals(mesh), len(mesh.nodes)
    plane, solid = plane_stiffness(section, nu), solid_stiffness(section, line, nu)
    motion = (np.concatenate([-mesh.nodes[:, 1], mesh.nodes[:, 0]]), np.repeat([1.0, 0.0], number))
    held_solid, held_plane = _held(mesh, len(line.whole)), _held(mesh, 1)
    found = _Solved(mesh, line, _loads(mesh, hinge.block[0]), [], [])
    for k, flat in enumerate(found.loads):
        found.plane.append(displacement(plane, flat, held_plane[k][held_plane[k] < 2 * number], motion[k]))
        force, rigid = _extruded(flat, line.whole), _extruded(motion[k], np.ones(len(line.whole)))
        found.solid.append(displacement(solid, force, held_solid[k], rigid))
    return found


def _extruded(flat: Array, along: Array) -> Array:
    """Vector (3nm,) of one (2n,) in the plane times one (m,) along z, nothing in the direction of z."""
    return np.concatenate([np.kron(flat, along), np.zeros(len(flat) // 2 * len(along))])


def _loads(mesh: StageMesh, high: float) -> list[Array]:
    """Forces (2n,) of the stresses of a unit moment and a unit pull, per thickness, on the end of the block."""

    def bent(points: Array, _: Array) -> Array:
        return 12 / high**3 * points[..., ::-1] * [1.0, 0.0]

    def even(points: Array, _: Array) -> Array:
        return np.broadcast_to([1 / high, 0.0], points.shape)

    plate, end = Plate(1.0, 0.0, 1.0), mesh.edges["right"]
    return [edge_force(mesh, plate, end, stress).T.ravel() for stress in (bent, even)]


def _held(mesh: StageMesh, points: int) -> tuple[Index, Index]:
    """Degrees of freedom that symmetry holds under a moment and a pull, with so many points along z.

    Notes
    -----
    Bending leaves the motion along y free, which one point takes away. With one point, those below 2n are the plane's.
    """
    neck, axis, number = nodes_on(mesh, "left"), nodes_on(mesh, "bottom"), len(mesh.nodes)

    def held(direction: int, nodes: Index, first: int = points) -> Index:
        return np.asarray((direction * number + nodes)[:, None] * points + np.arange(first)).ravel()

    middle, across = held(2, np.arange(number), 1), held(0, neck)
    return (
        np.concatenate([middle, across, held(0, axis), held(2, axis), held(1, neck[:1], 1)]),
        np.concatenate([middle, across, held(1, axis)]),
    )
