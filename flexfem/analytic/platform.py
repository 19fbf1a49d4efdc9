"""The platform as a plane elastic body with three lugs around its rigid hub, by boundary elements.

A lug is as short as it is wide and loaded over a neck alone: it is no beam. What it does to the hinge is a
difference: the compliance of the drawn platform, each lug with its half of the notch, less that of the same half notch
on a straight block, which the calibrated hinge already has; the block as a beam was never part of the hinge and is left
out. Both are cut in the neck and bear the stresses of a beam there. What these miss, and what the notch's elements
miss, is in both: the difference depends little on it.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable

import numpy as np

from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.boundary import Boundary, displacements, divided
from flexfem.arrays import AnyArray, Array
from flexfem.stage.bodies import body_sides, cut_angle, necks, notch_side
from flexfem.stage.designs import CHAIN_TURN, Elastic
from flexfem.stage.outline import Pose, Segment, polyline, reverse
from flexfem.stage.schema import CHAINS, Hinge, Stage

# Sizes of the elements. Half of them all moves the compliances of forty random stages by at most 0.013 %.
ACROSS = 0.6  # in the neck, per neck
GROWTH = 0.5  # per distance from the neck
COARSEST = 0.35  # on the lug, per link width; twice that on the disc and the hub
RING = 0.7  # on the disc and the hub, per width of the ring between them
THIN = 1 / 8  # and no less than this, per radius of the hub: a thin ring is as good as rigid
TURN = 0.4  # rad, of an arc
BLOCK = 2.0  # length of the straight block, per link width


def platform_compliance(stage: Stage, material: Elastic) -> Array:
    """Compliance (9, 9) that the platform's body adds to the three chains: x, y, theta of chain 1, 2 and 3.

    Raises BadInput when it cannot be drawn.

    Notes
    -----
    A wrench of one chain on the platform moves the lugs of the others too, the hub standing still. Where hinges differ
    from chain to chain, what two lugs do to each other is the mean of what either would do to its like.
    """
    cut_angle(stage)  # refuses lugs with no rim between them
    hinges = [stage.hinge(chain, "platform") for chain in CHAINS]
    one_of_each = dict(zip(hinges, CHAINS, strict=True))
    found = {hinge: _added(stage, material, chain) for hinge, chain in one_of_each.items()}
    alike = [_circulant(found[hinge]) for hinge in hinges]
    added = np.array([[(alike[i][i, j] + alike[j][i, j]) / 2 for j in range(3)] for i in range(3)])
    poses = [_neck(stage, chain) for chain in CHAINS]
    at, along = np.array([pose.point for pose in poses]), np.exp(1j * np.array([pose.heading for pose in poses]))
    J = motions(at, along)
    return np.asarray(np.einsum("ipa,ijab,jqb->ipjq", J, added, J).reshape(9, 9))


def motions(at: AnyArray, along: AnyArray) -> Array:
    """Motion (n, 3, 3) of the platform, x, y, theta, for rotation, axial, shear at points (n,) along directions."""
    zero = np.zeros(len(at))
    rotation = np.stack([at.imag, -at.real, zero + 1], axis=-1)  # the centre of the platform is the origin
    axial = np.stack([along.real, along.imag, zero], axis=-1)
    shear = np.stack([-along.imag, along.real, zero], axis=-1)
    return np.stack([rotation, axial, shear], axis=-1)


def _neck(stage: Stage, chain: int) -> Pose:
    """The platform hinge's neck in its place on the stage."""
    angle, neck = (chain - 1) * CHAIN_TURN, necks(stage, chain)[2]
    return Pose(neck.point * cmath.exp(1j * angle), neck.heading + angle)


def _added(stage: Stage, material: Elastic, chain: int) -> Array:
    """Compliance (3, 3, 3) beyond the hinge's own, at its neck and at the next chains', of three lugs like this one."""
    E, nu = (float(value) for value in material)
    added = _body(stage, nu, chain) / (E / (2 * (1 + nu)) * stage.thickness)
    added[0] -= _half_hinge(stage, material, stage.hinge(chain, "platform"))
    return added


def _circulant(added: Array) -> Array:
    """Compliance (3, 3, 3, 3) of chain i under the load of chain j."""
    return np.array([[added[(i - j) % 3] for j in range(3)] for i in range(3)])


def _body(stage: Stage, poissons_ratio: float, chain: int) -> Array:
    """Compliance (3, 3, 3), each neck under loads of the first: moment, force along, across; G and thickness one.

    One sector of the platform is enough, with its lug, its part of the hub and the rim up to the next lug.
    """
    neck, hinge, hub = necks(stage, chain)[2], stage.hinge(chain, "platform"), stage.platform.hub_radius
    left, right = (body_sides(stage, chain, side)[3] for side in (1, -1))
    size, spin = element_size(stage.chain.link_width, neck, hinge), cmath.exp(1j * CHAIN_TURN)
    rim, circle = Segment(right[-1].end, left[-1].end * spin, 0j), Segment(hub + 0j, hub * spin.conjugate(), 0j)
    parts = [
        divided([Segment(left[0].start, right[0].start)], size, TURN),
        divided([*right, *reverse(left)], size, TURN),
        divided([rim, circle], lambda _: _ring(stage), TURN),
    ]
    boundary, part = joined(parts)
    held = np.abs(boundary.nodes) < (hub + stage.platform.radius) / 2
    loads = beam_stress(neck, hinge.neck, boundary.nodes, part == 0)
    return _work(boundary, loads, held, poissons_ratio, len(CHAINS))


def _ring(stage: Stage) -> float:
    """Size of the elements on the disc and the hub, mm."""
    disc, hub = stage.platform.radius, stage.platform.hub_radius
    return min(max(RING * (disc - hub), THIN * hub), 2 * COARSEST * stage.chain.link_width)


def _half_hinge(stage: Stage, material: Elastic, hinge: Hinge) -> Array:
    """Compliance (3, 3) of half a hinge about its neck: on a straight block, whose own as a beam is subtracted."""
    E, nu = (float(value) for value in material)
    width, start = stage.chain.link_width, hinge.radius
    end = start + BLOCK * width
    neck = Pose(0j, 0.0)
    left, right = (notch_side(neck, hinge, width, side)[1] for side in (1, -1))
    edge, back = complex(end, -width / 2), complex(end, width / 2)
    sides = [*right, *polyline(right[-1].end, edge)], [*polyline(back, left[-1].end), *reverse(left)]
    paths = [[Segment(left[0].start, right[0].start)], sides[0], [Segment(edge, back)], sides[1]]
    boundary, part = joined([divided(path, element_size(width, neck, hinge), TURN) for path in paths])
    near = beam_stress(neck, hinge.neck, boundary.nodes, part == 0)
    moment, pull, across = beam_stress(Pose(complex(end), 0.0), width, boundary.nodes, part == 2).T
    loads = near - np.stack([moment, pull, across - end * moment], axis=-1)
    (block,) = _work(boundary, loads, np.zeros(len(part), dtype=bool), nu) * 2 * (1 + nu)
    bending = 12 / width**3 * np.array([end - start, (end**2 - start**2) / 2, (end**3 - start**3) / 3])
    beam = np.diag([bending[0], (end - start) / width, 0.0])
    beam[2, 2] = bending[2] + SHEAR_CORRECTION * 2 * (1 + nu) * (end - start) / width
    beam[0, 2] = beam[2, 0] = -bending[1]
    return np.asarray((block - beam) / (E * stage.thickness))


def element_size(width: float, pose: Pose, hinge: Hinge) -> Callable[[complex], float]:
    """Largest elements, mm, by their place, on a body as wide as the link with a neck at a pose."""

    def size(point: complex) -> float:
        away = max(0.0, abs(point - pose.point) - hinge.neck / 2)
        return min(COARSEST * width, ACROSS * hinge.neck + GROWTH * away)

    return size


def joined(parts: list[Boundary]) -> tuple[Boundary, AnyArray]:
    """One boundary, and for each of its nodes (n,) the part that it is from."""
    whole = Boundary(*(np.concatenate(ends) for ends in zip(*parts, strict=True)))
    return whole, np.repeat(np.arange(len(parts)), [len(part.nodes) for part in parts])


def beam_stress(pose: Pose, height: float, nodes: AnyArray, on: AnyArray) -> AnyArray:
    """Tractions (n, 3) of unit moment, force along, force across on the section `on` (n,): linear, even, parabolic."""
    along = cmath.exp(1j * pose.heading)
    up = ((nodes - pose.point) / along).imag
    moment = -12 * up / height**3 * along
    across = 1.5 / height * (1 - (2 * up / height) ** 2) * 1j * along
    stress = np.stack([moment, np.full(len(nodes), along / height), across], axis=-1)
    return np.where(on[:, None], stress, 0.0)


def _work(boundary: Boundary, loads: AnyArray, held: AnyArray, poissons_ratio: float, copies: int = 1) -> Array:
    """Compliance (copies, k, k) of each copy under loads on the first, shear modulus and thickness one.

    By reciprocity that of copy d is the transpose of that of copy -d; taking the mean removes what errors leave.
    """
    moved = displacements(boundary, loads, held, poissons_ratio, copies)
    work = ((np.conj(loads) * boundary.weights[:, None]).T @ moved).real
    back = np.swapaxes(work[-np.arange(copies)], -1, -2)
    return np.asarray((work + back) / 2)
