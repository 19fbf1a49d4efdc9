"""Pads whose clamped edges are strained along themselves and bowed, as a frame of another expansion does.

The edge is as long as the pad is wide, so one place and one direction do not tell how it is held. The neck at the end
of the pad bears nothing and goes along as a rigid body: by boundary elements on the drawn pad with half of its notch.
"""

from __future__ import annotations

import cmath

import numpy as np

from flexfem.analytic.boundary import displacements, divided
from flexfem.analytic.platform import TURN, beam_stress, element_size, joined
from flexfem.arrays import AnyArray, Array
from flexfem.stage.bodies import necks, notch_side
from flexfem.stage.cache import once
from flexfem.stage.designs import CHAIN_TURN, elastic
from flexfem.stage.outline import Pose, Segment, polyline, reverse
from flexfem.stage.schema import CHAINS, Hinge, Stage

CORNER, GROWTH = 1 / 100, 0.5  # sizes of elements at the clamped corners, per link width, and per distance from them


@once
def edge_motions(stage: Stage, wider: float = 1.0) -> Array:
    """Motions (3 chains, 3, 3 cases) of the platform, hinges at rest, by what strains and bows the clamped edges.

    Per expansion of the frame beyond the stage's: by 1 K, 1 K/mm along x, 1 K/mm along y about the platform's centre.

    Parameters
    ----------
    wider : factor on the necks of the base hinges.

    Notes
    -----
    From the middle z of the edge of a pad along e, at z + i e eta, the free fields `z`, `z^2/2`, `-i z^2/2` of x + iy
    differ from a rigid motion by a strain of 1, Re z, Im z and a bow of `-(e eta)^2/2` and `i (e eta)^2/2`.
    """
    width, metal = stage.chain.link_width, stage.material
    nu = float(elastic(stage.model, metal.youngs_modulus, metal.poissons_ratio).poissons_ratio)
    hinges = [stage.hinge(chain, "base") for chain in CHAINS]
    found = {each: _of_pad(each.model_copy(update={"neck": wider * each.neck}), width, nu) for each in set(hinges)}
    motions = np.zeros((3, 3, 3))
    for k, (chain, hinge) in enumerate(zip(CHAINS, hinges, strict=True)):
        neck = necks(stage, chain)[0]
        e = cmath.exp(1j * (neck.heading + k * CHAIN_TURN))
        z = neck.ahead(-hinge.radius - width).point * cmath.exp(1j * k * CHAIN_TURN)
        bow = np.array([0.0, -e, 1j * e])  # in the pad's own directions
        along, across, turn = found[hinge] @ np.stack([[1.0, z.real, z.imag], bow.real, bow.imag])
        moved = e * (along + 1j * across) - 1j * turn * z
        motions[k] = moved.real, moved.imag, turn
    return motions


def _of_pad(hinge: Hinge, width: float, poissons_ratio: float) -> Array:
    """Motion (3, 3) of the neck behind which a pad is clamped, seen at the middle of the edge: along, across, turn.

    The edge's own displacements, eta to the left from its middle, are: eta along itself; eta^2/2 ahead; eta^2/2 along.
    """
    neck, middle = Pose(0j, 0.0), -hinge.radius - width + 0j
    corners = middle + 0.5j * width, middle - 0.5j * width
    walls = [notch_side(neck, hinge, width, side)[0] for side in (1, -1)]
    left, right = ([*polyline(c, wall[0].start), *wall] for c, wall in zip(corners, walls, strict=True))
    edge, end = Segment(*corners), Segment(right[-1].end, left[-1].end)
    size = element_size(width, neck, hinge)

    def sizes(point: complex) -> float:
        away = min(abs(point - edge.start), abs(point - edge.end))
        return min(size(point), CORNER * width + GROWTH * away)

    boundary, part = joined([divided(path, sizes, TURN) for path in ([edge], right, [end], reverse(left))])
    outward = np.repeat(-1j * (boundary.end - boundary.start) / np.abs(boundary.end - boundary.start), 3)
    field, traction = _fields(boundary.nodes - middle, outward, poissons_ratio)
    moved = field + displacements(boundary, -traction, part == 0, poissons_ratio)[0]
    stress = beam_stress(neck, hinge.neck, boundary.nodes, part == 2)
    turn, along, across = ((np.conj(stress) * boundary.weights[:, None]).T @ moved).real
    return np.stack([along, across + middle.real * turn, turn])


def _fields(z: AnyArray, normal: AnyArray, poissons_ratio: float) -> tuple[AnyArray, AnyArray]:
    """Displacements in equilibrium that are as wanted on the edge (n, 3), and their tractions; shear modulus one.

    Notes
    -----
    Of a stress E along the edge, eta; E xi; E eta with a shear stress of -E xi, xi ahead of the edge.
    """
    nu, x, y = poissons_ratio, z.real, z.imag
    E, none = 2 * (1 + nu), np.zeros(len(z))
    u = [-nu * x + 1j * y, (nu * x**2 + y**2) / 2 - 1j * x * y, -nu * x * y + 0.5j * (y**2 - (2 + nu) * x**2)]
    across, shear = E * np.stack([none + 1, -x, y]), E * np.stack([none, none, -x])
    return np.stack(u, axis=-1), (shear * normal.imag + 1j * (shear * normal.real + across * normal.imag)).T
