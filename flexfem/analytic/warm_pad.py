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
from flexfem.stage.bodies import body_sides, necks
from flexfem.stage.cache import once
from flexfem.stage.designs import CHAIN_TURN, elastic
from flexfem.stage.outline import Pose, Segment, reverse
from flexfem.stage.schema import CHAINS, Stage

CORNER, GROWTH = 1 / 100, 0.5  # sizes of elements at the clamped corners, per link width, and per distance from them


@once
def edge_motions(stage: Stage) -> Array:
    """Motions (3 chains, 3, 3 cases) of the platform, hinges at rest, by what strains and bows the clamped edges.

    Per expansion of the frame beyond the stage's: by 1 K, 1 K/mm along x, 1 K/mm along y about the platform's centre.

    Notes
    -----
    From the middle z of the edge of a pad along e, at z + i e eta, the free fields `z`, `z^2/2`, `-i z^2/2` of x + iy
    differ from a rigid motion by a strain of 1, Re z, Im z and a bow of `-(e eta)^2/2` and `i (e eta)^2/2`.
    """
    found = {stage.hinge(chain, "base"): _of_pad(stage, chain) for chain in reversed(CHAINS)}
    motions = np.zeros((3, 3, 3))
    for k, chain in enumerate(CHAINS):
        hinge, neck = stage.hinge(chain, "base"), necks(stage, chain)[0]
        e = cmath.exp(1j * (neck.heading + k * CHAIN_TURN))
        z = neck.ahead(-hinge.radius - stage.chain.link_width).point * cmath.exp(1j * k * CHAIN_TURN)
        bow = np.array([0.0, -e, 1j * e])  # in the pad's own directions
        along, across, turn = found[hinge] @ np.stack([[1.0, z.real, z.imag], bow.real, bow.imag])
        moved = e * (along + 1j * across) - 1j * turn * z
        motions[k] = moved.real, moved.imag, turn
    return motions


def _of_pad(stage: Stage, chain: int) -> Array:
    """Motion (3, 3) of the neck behind which a pad is clamped, seen at the middle of the edge: along, across, turn.

    The edge's own displacements, eta to the left from its middle, are: eta along itself; eta^2/2 ahead; eta^2/2 along.
    """
    neck, hinge, width = necks(stage, chain)[0], stage.hinge(chain, "base"), stage.chain.link_width
    left, right = (body_sides(stage, chain, side)[0] for side in (1, -1))
    edge, end = Segment(left[0].start, right[0].start), Segment(right[-1].end, left[-1].end)
    size = element_size(stage, neck, hinge)

    def sizes(point: complex) -> float:
        away = min(abs(point - edge.start), abs(point - edge.end))
        return min(size(point), CORNER * width + GROWTH * away)

    boundary, part = joined([divided(path, sizes, TURN) for path in ([edge], right, [end], reverse(left))])
    middle, e = (edge.start + edge.end) / 2, cmath.exp(1j * neck.heading)
    outward = np.repeat(-1j * (boundary.end - boundary.start) / np.abs(boundary.end - boundary.start) / e, 3)
    nu = float(elastic(stage.model, stage.material.youngs_modulus, stage.material.poissons_ratio).poissons_ratio)
    field, traction = _fields((boundary.nodes - middle) / e, outward, nu)
    moved = e * field + displacements(boundary, -e * traction, part == 0, nu)[0]
    stress = beam_stress(Pose(neck.point, neck.heading), hinge.neck, boundary.nodes, part == 2)
    turn, along, across = ((np.conj(stress) * boundary.weights[:, None]).T @ moved).real
    return np.stack([along, across - abs(neck.point - middle) * turn, turn])


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
