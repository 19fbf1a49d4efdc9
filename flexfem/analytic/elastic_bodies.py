"""Compliances of the bodies between the hinges: pads and links as bars along the path they are drawn on, the platform
and the clamped edges of pads by plane boundary elements, with points, displacements and tractions as complex numbers.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.chart import SHEAR_CORRECTION
from flexfem.mechanism.bodies import body_sides, centrelines, cut_angle, necks, notch_side
from flexfem.mechanism.contacts import bend_stresses
from flexfem.mechanism.designs import CHAIN_TURN, Elastic, chain_rotation
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.outlines import Pose, Segment, polyline, reverse
from flexfem.mechanism.stage import CHAINS, Hinge, Stage

PLACES = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])  # of the nodes in an element from -1 to 1: Gauss's, none at a corner
SHARES = np.array([5.0, 8.0, 5.0]) / 18  # their weights, per length of the element
SHAPES = np.linalg.inv(np.vander(PLACES, increasing=True))  # from nodal values to coefficients of powers
KEPT = 64  # answers, of some 50 kB: designs that differ elsewhere have the same platform, and one stage asks repeatedly
FAR = 10.0  # unit of length in the logarithm, per size of the body: no hole then has the radius at which it is singular


class Boundary(NamedTuple):
    """Straight elements with the body to their left: start, end (m,), complex, mm."""

    start: AnyArray
    end: AnyArray

    @property
    def nodes(self) -> AnyArray:
        """Points (3m,), complex, three in every element."""
        middle, half = (self.start + self.end) / 2, (self.end - self.start) / 2
        return np.asarray((middle[:, None] + half[:, None] * PLACES).ravel())

    @property
    def weights(self) -> Array:
        """Quadrature weights (3m,) of the nodes, mm."""
        return np.asarray((np.abs(self.end - self.start)[:, None] * SHARES).ravel())


def divided(segments: Sequence[Segment], size: Callable[[complex], float], turn: float) -> Boundary:
    """Chords of lines and arcs, halved until none is longer than `size` at its middle or turns by more than `turn`."""
    pieces = [piece for segment in segments for piece in _halved(segment, size, turn)]
    return Boundary(np.array([piece.start for piece in pieces]), np.array([piece.end for piece in pieces]))


def _halved(segment: Segment, size: Callable[[complex], float], turn: float) -> list[Segment]:
    middle = complex(segment.at(0.5))
    if segment.length <= size(middle) and abs(segment.turn) <= turn:
        return [segment]
    halves = (Segment(segment.start, middle, segment.centre), Segment(middle, segment.end, segment.centre))
    return [piece for half in halves for piece in _halved(half, size, turn)]


def displacements(
    boundary: Boundary, tractions: AnyArray, held: NDArray[np.bool_], poissons_ratio: float, copies: int = 1
) -> AnyArray:
    """Displacements (copies, n, k) times shear modulus, complex, read-only, of the nodes under k loads.

    Parameters
    ----------
    boundary : one of `copies` alike, turned about the origin by equal angles, that together bound the body.
    tractions : (n, k), complex, of the nodes of the first copy; not looked at where the body is held.
    held : (n,), nodes that do not move. Where none is, of one copy, loads must balance, and the mean motion is zero.

    Notes
    -----
    A discrete Fourier transform over the copies parts the equations: with x_d in copy d, in its own frame,
    `x_d = sum_m w^(m d) (sum_e w^(m e) A_e)^-1 b / copies`, w the root of unity, A_e what copy e does to the first.
    """
    given = (np.ascontiguousarray(each, dtype=complex).tobytes() for each in (*boundary, tractions))
    return _displacements(*given, np.asarray(held, dtype=bool).tobytes(), float(poissons_ratio), copies)


@lru_cache(KEPT)
def _displacements(
    start: bytes, end: bytes, tractions: bytes, held: bytes, poissons_ratio: float, copies: int
) -> AnyArray:
    boundary, fixed = Boundary(np.frombuffer(start, complex), np.frombuffer(end, complex)), np.frombuffer(held, bool)
    single, double = _system(boundary, poissons_ratio, copies)
    clamped = np.concatenate([fixed, fixed])
    load = np.where(clamped[:, None], 0.0, _split(np.frombuffer(tractions, complex).reshape(len(fixed), -1)))
    moved = np.zeros((copies, *load.shape))
    for wave in range(copies // 2 + 1):  # the others are conjugates
        phase = np.exp(2j * np.pi * wave * np.arange(copies) / copies)
        phase = phase.real if 2 * wave in (0, copies) else phase  # real equations cost a quarter
        force, motion = (np.tensordot(phase, parts, axes=1) for parts in (single, double))
        matrix = np.where(clamped, force, motion)
        if not fixed.any():
            matrix = matrix + _pins(boundary)
        share = (1 if 2 * wave in (0, copies) else 2) / copies
        unknown = np.where(clamped[:, None], 0.0, np.linalg.solve(matrix, -force @ load))
        moved += share * np.real(phase[:, None, None] * unknown)
    found = np.asarray(moved[:, : len(fixed)] + 1j * moved[:, len(fixed) :])
    found.setflags(write=False)
    return found


def _system(boundary: Boundary, poissons_ratio: float, copies: int) -> tuple[Array, Array]:
    """Matrices (copies, 2n, 2n), real parts before imaginary ones, of tractions and of displacements.

    What they make of those of all copies, each in its frame, sums to zero at the nodes of the first.

    Notes
    -----
    Somigliana's identity, the body left of its boundary s, a star for the conjugate, `kappa = (3 - nu) / (1 + nu)`:

        U(z) = int [-2 kappa ln|z - s| t + (z - s)/(z - s)* t*] |ds| / (4 pi (1 + kappa))
             + int [u (kappa d ln(s - z) - d ln(s - z)*) + u* d((s - z)/(s - z)*)] / (2 pi i (1 + kappa))

    Kelvin's forces and dislocations from 2 U = kappa phi - z phi'* - psi* (N. I. Muskhelishvili, Some Basic Problems
    of the Mathematical Theory of Elasticity, Noordhoff 1953, sections 32 and 56). Displacements and tractions are
    quadratic in straight elements, their integrals exact.
    """
    kappa = (3 - poissons_ratio) / (1 + poissons_ratio)
    force, jump = SHAPES / (4 * np.pi * (1 + kappa)), SHAPES / (2j * np.pi * (1 + kappa))
    half, found = (boundary.end - boundary.start) / 2, []
    a, unit = np.abs(half), FAR * float(np.max(np.abs(boundary.nodes)))
    for spin in np.exp(2j * np.pi * np.arange(copies) / copies):
        along = spin * half / a
        w = (boundary.nodes[:, None] - spin * (boundary.start + boundary.end) / 2) / along
        own = np.repeat(np.eye(len(a), dtype=bool) & (spin == 1), len(PLACES), axis=0)
        w[own] = w[own].real  # each element lies on the real axis
        logs, cauchy, squares, powers = _moments(w, a, own, unit)
        aside, turn = (np.conj(w) - w)[..., None], along[:, None] ** 2
        by_force = -2 * kappa * logs @ force, turn * (powers + aside * np.conj(cauchy)) @ force
        by_jump = (kappa * cauchy - np.conj(cauchy)) @ jump, -turn * aside * np.conj(squares) @ jump
        found.append([_real(spin * straight, np.conj(spin) * mirrored) for straight, mirrored in (by_force, by_jump)])
    single, double = np.moveaxis(np.array(found), 1, 0)
    double[0] -= np.eye(double.shape[-1])
    return single, double


def _moments(w: AnyArray, a: Array, own: NDArray[np.bool_], unit: float) -> tuple[Array, AnyArray, AnyArray, Array]:
    """Integrals (n, m, 3) over s from -a to a of (s/a)^k times ln(|s - w|/unit), 1/(s - w), 1/(s - w)^2 and 1."""
    c = [np.log((w - a) / (w + a))]
    c[0][own] = c[0][own].real + 1j * np.pi  # from the body's side, the left
    c += [2 * a + w * c[0]]
    c += [w * c[1]]
    c += [2 * a**3 / 3 + w * c[2]]
    s = [-1 / (a - w) - 1 / (a + w)]
    s += [c[0] + w * s[0]]
    s += [c[1] + w * s[1]]
    ahead, behind = np.log(np.abs(a - w) / unit), np.log(np.abs(a + w) / unit)
    logs = [(a ** (k + 1) * ahead - (-a) ** (k + 1) * behind - c[k + 1].real) / (k + 1) for k in range(3)]
    scale = a[:, None] ** -np.arange(3.0)
    powers = a[:, None] * np.array([2.0, 0.0, 2 / 3])
    return np.stack(logs, -1) * scale, np.stack(c[:3], -1) * scale, np.stack(s, -1) * scale, powers


def _real(A: AnyArray, B: AnyArray) -> Array:
    """The matrix (2n, 2n) of the map u -> A u + B u*, given as (n, m, 3), on real parts before imaginary ones."""
    A, B = A.reshape(len(A), -1), B.reshape(len(B), -1)
    return np.block([[(A + B).real, (B - A).imag], [(A + B).imag, (A - B).real]])


def _split(values: AnyArray) -> Array:
    return np.concatenate([values.real, values.imag])


def _pins(boundary: Boundary) -> Array:
    """What makes the equations of a free body regular: the mean of each rigid motion, on that motion."""
    z = boundary.nodes / np.max(np.abs(boundary.nodes))
    rigid = _split(np.stack([np.ones(len(z)), 1j * np.ones(len(z)), 1j * z], axis=-1))
    weights = np.concatenate([boundary.weights, boundary.weights]) / np.sum(boundary.weights)
    return np.asarray(rigid @ (weights[:, None] * rigid).T)


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
    A lug is no beam. It adds the difference of two bodies, both cut in the neck under the stresses of a beam: the drawn
    platform, less half the notch on a straight block, which the calibrated hinge has. Where hinges differ from chain to
    chain, what two lugs do to each other is the mean of what either would do to its like.
    """
    cut_angle(stage)  # refuses lugs with no rim between them
    hinges = [stage.hinge(chain, "platform") for chain in CHAINS]
    one_of_each = dict(zip(hinges, CHAINS, strict=True))
    found = {hinge: _added(stage, material, chain) for hinge, chain in one_of_each.items()}
    alike = [found[hinge] for hinge in hinges]
    added = np.array([[(alike[i][i - j] + alike[j][i - j]) / 2 for j in range(3)] for i in range(3)])
    poses, turns = [necks(stage, chain)[2] for chain in CHAINS], np.exp(1j * CHAIN_TURN * np.arange(3))
    along = np.exp(1j * np.array([pose.heading for pose in poses])) * turns
    J = freedom_motions(np.array([pose.point for pose in poses]) * turns, along)
    return np.asarray(np.einsum("ipa,ijab,jqb->ipjq", J, added, J).reshape(9, 9))


def _added(stage: Stage, material: Elastic, chain: int) -> Array:
    """Compliance (3, 3, 3) beyond the hinge's own, at its neck and at the next chains', of three lugs like this one."""
    E, nu = (float(value) for value in material)
    added = _body(stage, nu, chain) / (E / (2 * (1 + nu)) * stage.thickness)
    added[0] -= _half_hinge(stage, material, stage.hinge(chain, "platform"))
    return added


def _body(stage: Stage, poissons_ratio: float, chain: int) -> Array:
    """Compliance (3, 3, 3), each neck under loads of the first: moment, force along, across; G and thickness one."""
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
    """Compliance (copies, k, k) of each copy under loads on the first, G and thickness one; made reciprocal."""
    moved = displacements(boundary, loads, held, poissons_ratio, copies)
    work = ((np.conj(loads) * boundary.weights[:, None]).T @ moved).real
    back = np.swapaxes(work[-np.arange(copies)], -1, -2)
    return np.asarray((work + back) / 2)


POINTS = 12  # Gauss points along each line or arc: their integrands are quadratics and trigonometric functions
RADII = 32  # Gauss points across a curved bar, in the logarithm of the radius


@once
def body_compliance(stage: Stage) -> Array:
    """Compliance (9, 9) that pads, links and platform add to the three chains: x, y, theta of chain 1, 2 and 3.

    Raises BadInput when they cannot be drawn.
    """
    material = stage.elastic
    bars = np.zeros((3, 3, 3, 3))
    for chain in CHAINS:
        each = [bar_density(stage, material, segment)[0] for line in centrelines(stage, chain) for segment in line]
        R = chain_rotation(chain - 1)
        bars[chain - 1, :, chain - 1] = R @ np.sum(each, axis=(0, 1)) @ R.T
    return bars.reshape(9, 9) + platform_compliance(stage, material)


def bar_density(
    stage: Stage, material: Elastic, segment: Segment, first: float = 0.0, last: float = 1.0
) -> tuple[Array, Array]:
    """Compliances (q, 3, 3) at the platform of pieces of one line or arc, between two shares, and their shares (q,)."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    share = first + (last - first) * (nodes + 1) / 2
    along = segment.tangent(share)
    if segment.centre is None:
        at, (E, nu), width = segment.at(share), material, stage.chain.link_width
        density = np.diag([12 / width**2, 1.0, SHEAR_CORRECTION * 2 * (1 + nu)]) / (E * stage.thickness * width)
    else:
        at, side = np.full(POINTS, segment.centre), float(np.sign(segment.turn))
        density = _curved(stage, material, abs(segment.start - segment.centre)) * np.outer([side, 1, 1], [side, 1, 1])
    J = freedom_motions(at, along)
    pieces = weights / 2 * segment.length * (last - first)
    return np.asarray(np.einsum("q,qia,ab,qjb->qij", pieces, J, density, J)), share


def _curved(stage: Stage, material: Elastic, radius: float) -> Array:
    """Compliance per length (3, 3) of a curved bar, by moment, axial force and shear at the centre of curvature.

    Notes
    -----
    By the exact plane stresses of `bend_stresses`: a sharp bend (b/a = 9) is 44 % softer than Winkler's bar.
    """
    (E, nu), width = material, stage.chain.link_width
    a, b = radius - width / 2, radius + width / 2
    nodes, weights = np.polynomial.legendre.leggauss(RADII)
    r = a * (b / a) ** ((nodes + 1) / 2)
    dr = weights / 2 * np.log(b / a) * r
    bent, pulled, sheared, radial = bend_stresses(a, b, r)
    stress = np.array([[radial, bent], [sheared, pulled]])  # by moment and by pull, radial and along
    hooke = np.array([[1, -nu], [-nu, 1]])
    density = np.zeros((3, 3))
    density[:2, :2] = np.einsum("ian,ab,jbn,n->ij", stress, hooke, stress, r * dr)
    density[2, 2] = 2 * (1 + nu) * np.sum(sheared**2 * r * dr)
    return density / (E * stage.thickness * radius)


CORNER = 1 / 100  # size of elements at the clamped corners, per link width; it grows as from the neck


@once
def edge_motions(stage: Stage, wider: float = 1.0) -> Array:
    """Motions (3 chains, 3, 3 cases) of the platform, hinges at rest, by what strains and bows the clamped edges.

    Per expansion of the frame beyond the stage's: by 1 K, 1 K/mm along x, 1 K/mm along y about the platform's centre;
    `wider` is a factor on the necks of the base hinges.

    Notes
    -----
    From the middle z of the edge of a pad along e, at z + i e eta, the free fields `z`, `z^2/2`, `-i z^2/2` of x + iy
    differ from a rigid motion by a strain of 1, Re z, Im z and a bow of `-(e eta)^2/2` and `i (e eta)^2/2`. The neck at
    the end of the pad bears nothing and goes along as a rigid body.
    """
    width, nu = stage.chain.link_width, float(stage.elastic.poissons_ratio)
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
    """Displacements in equilibrium (n, 3) that are as wanted on the edge, and their tractions; shear modulus one.

    Of a stress E along the edge, eta; E xi; E eta with a shear stress of -E xi, xi ahead of the edge.
    """
    nu, x, y = poissons_ratio, z.real, z.imag
    E, none = 2 * (1 + nu), np.zeros(len(z))
    u = [-nu * x + 1j * y, (nu * x**2 + y**2) / 2 - 1j * x * y, -nu * x * y + 0.5j * (y**2 - (2 + nu) * x**2)]
    across, shear = E * np.stack([none + 1, -x, y]), E * np.stack([none, none, -x])
    return np.stack(u, axis=-1), (shear * normal.imag + 1j * (shear * normal.real + across * normal.imag)).T
