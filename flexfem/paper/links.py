"""Compliances of the bodies between the hinges of a stage.

Pads and links are bars along their centrelines. The platform and the clamped edges of pads are
computed by plane boundary elements, with points, displacements and tractions as complex numbers.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import AnyArray, Array
from flexfem.files.tables import memoized
from flexfem.hinges.chart import SHEAR_CORRECTION
from flexfem.mechanism.outlines import Pose, Segment, polyline, reverse
from flexfem.paper.bodies import body_sides, centrelines, cut_angle, necks, notch_side
from flexfem.paper.contacts import bend_stresses
from flexfem.paper.designs import Elastic
from flexfem.paper.frames import CHAIN_TURN, chain_rotation
from flexfem.paper.stage import CHAINS, Hinge, Stage
from flexfem.paper.stage_file import Platform

# of an element from -1 to 1: Gauss points, none at a corner
NODES = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18  # per length of the element
# from nodal values to coefficients of powers
SHAPES = np.linalg.inv(np.vander(NODES, increasing=True))
CACHE_SIZE = 64  # bodies: many designs of a study have the same platform
Edge: TypeAlias = tuple[Segment, ...]
# of length in the logarithm, per size of the body: no hole has the radius at which it is singular
LOG_UNIT = 10.0


class Boundary(NamedTuple):
    """Straight elements with the body on their left: start, end (m,), complex, mm."""

    start: AnyArray
    end: AnyArray

    @property
    def nodes(self) -> AnyArray:
        """Nodes (3m,), complex, three in every element."""
        middle = (self.start + self.end) / 2
        half = (self.end - self.start) / 2
        return np.asarray((middle[:, None] + half[:, None] * NODES).ravel())

    @property
    def weights(self) -> Array:
        """Quadrature weights (3m,) of the nodes, mm."""
        return np.asarray((np.abs(self.end - self.start)[:, None] * WEIGHTS).ravel())


def divided(
    segments: Sequence[Segment], size: Callable[[complex], float], angle: float
) -> Boundary:
    """Return chords of curves, at most `size` at their middles, mm, and `angle`, rad, long."""
    pieces = [piece for segment in segments for piece in _halved(segment, size, angle)]
    starts = np.array([piece.start for piece in pieces])
    return Boundary(starts, np.array([piece.end for piece in pieces]))


def _halved(
    segment: Segment,
    size: Callable[[complex], float],
    angle: float,
) -> list[Segment]:
    middle = complex(segment.at(0.5))
    if segment.length <= size(middle) and abs(segment.turn) <= angle:
        return [segment]
    first = Segment(segment.start, middle, segment.centre)
    second = Segment(middle, segment.end, segment.centre)
    return [*_halved(first, size, angle), *_halved(second, size, angle)]


def displacements(
    boundary: Boundary,
    tractions: AnyArray,
    fixed: NDArray[np.bool_],
    poissons_ratio: float,
    copies: int = 1,
) -> AnyArray:
    """Return the displacements (copies, n, k) times shear modulus, complex, under k loads.

    Parameters
    ----------
    boundary : one of `copies` identical parts, rotated about the origin by equal angles, that
        together bound the body.
    tractions : (n, k), complex, of the nodes of the first copy; ignored at fixed nodes.
    fixed : (n,), nodes that do not move. A body without any must be one copy in equilibrium; its
        mean motion is zero.

    Notes
    -----
    A discrete Fourier transform over the copies decouples the equations: with x_d in copy d, in its
    own frame, `x_d = sum_m w^(m d) (sum_e w^(m e) A_e)^-1 b / copies`, w the root of unity, A_e the
    action of copy e on the first."""
    single, double = _system(boundary, poissons_ratio, copies)
    clamped = np.concatenate([fixed, fixed])
    load = np.where(clamped[:, None], 0.0, _split(tractions))
    u = np.zeros((copies, *load.shape))
    for wave in range(copies // 2 + 1):  # the other waves are conjugates
        phase = np.exp(2j * np.pi * wave * np.arange(copies) / copies)
        phase = phase.real if 2 * wave in (0, copies) else phase  # real equations cost a quarter
        force, motion = (np.tensordot(phase, parts, axes=1) for parts in (single, double))
        matrix = np.where(clamped, force, motion)
        if not fixed.any():
            matrix = matrix + _rigid_motion_terms(boundary)
        share = (1 if 2 * wave in (0, copies) else 2) / copies
        unknown = np.where(clamped[:, None], 0.0, np.linalg.solve(matrix, -force @ load))
        u += share * np.real(phase[:, None, None] * unknown)
    return np.asarray(u[:, : len(fixed)] + 1j * u[:, len(fixed) :])


class _Equations(NamedTuple):
    """Matrices (copies, 2n, 2n) of tractions and displacements, real parts first.

    Their products with the tractions and displacements of all copies, each in its own frame, sum to
    zero.
    """

    of_tractions: Array
    of_displacements: Array


def _system(
    boundary: Boundary,
    poissons_ratio: float,
    copies: int,
) -> _Equations:
    """Return the boundary integral equations at the nodes.

    Notes
    -----
    Somigliana's identity with the body left of its boundary s, a star for the conjugate, `kappa =
    (3 - nu)/(1 + nu)`:

        U(z) = int [-2 kappa ln|z - s| t + (z - s)/(z - s)* t*] |ds| / (4 pi (1 + kappa))
             + int [u (kappa d ln(s - z) - d ln(s - z)*) + u* d((s - z)/(s - z)*)] / (2 pi i (1 +
             kappa))

    It has Kelvin's forces and dislocations from 2 U = kappa phi - z phi'* - psi* (N. I.
    Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, Noordhoff 1953,
    sections 32 and 56). Displacements and tractions are quadratic in straight elements and
    integrated exactly.
    """
    kappa = (3 - poissons_ratio) / (1 + poissons_ratio)
    rotations = np.exp(2j * np.pi * np.arange(copies) / copies)
    parts = [_of_copy(boundary, kappa, rotation) for rotation in rotations]
    of_tractions = np.array([part.of_tractions for part in parts])
    of_displacements = np.array([part.of_displacements for part in parts])
    of_displacements[0] -= np.eye(of_displacements.shape[-1])
    return _Equations(of_tractions, of_displacements)


def _of_copy(
    boundary: Boundary,
    kappa: float,
    rotation: complex,
) -> _Equations:
    """Return the matrices (2n, 2n) of one copy, turned by a complex number of unit size."""
    seen = _seen_from_elements(boundary, rotation)
    unit = LOG_UNIT * float(np.max(np.abs(boundary.nodes)))
    logs, cauchy, squares, powers = _moments(seen.w, seen.a, seen.on_element, unit)
    offset = (np.conj(seen.w) - seen.w)[..., None]
    frame = seen.tangent[:, None] ** 2
    force = SHAPES / (4 * np.pi * (1 + kappa))
    jump = SHAPES / (2j * np.pi * (1 + kappa))
    by_force = -2 * kappa * logs @ force
    by_force_star = frame * (powers + offset * np.conj(cauchy)) @ force
    by_jump = (kappa * cauchy - np.conj(cauchy)) @ jump
    by_jump_star = -frame * offset * np.conj(squares) @ jump
    back = np.conj(rotation)
    return _Equations(
        _real(rotation * by_force, back * by_force_star),
        _real(rotation * by_jump, back * by_jump_star),
    )


class _Seen(NamedTuple):
    """Nodes in the frames of m elements, each of which is on the real axis about zero.

    w : (n, m), complex, mm, places of nodes.   on_element : (n, m), nodes of the element.
    a : (m,), half lengths, mm.   tangent : (m,), complex, unit directions of the elements.
    """

    w: AnyArray
    on_element: NDArray[np.bool_]
    a: Array
    tangent: AnyArray


def _seen_from_elements(boundary: Boundary, rotation: complex) -> _Seen:
    """Return the nodes of a boundary in the frames of its elements after these are turned."""
    half = (boundary.end - boundary.start) / 2
    a = np.abs(half)
    tangent = rotation * half / a
    middle = rotation * (boundary.start + boundary.end) / 2
    w = (boundary.nodes[:, None] - middle) / tangent
    on_element = np.repeat(np.eye(len(a), dtype=bool) & (rotation == 1), len(NODES), axis=0)
    w[on_element] = w[on_element].real  # without round-off
    return _Seen(w, on_element, a, tangent)


class _Moments(NamedTuple):
    """Integrals (n, m, 3) over s from -a to a of (s/a)^k, k from 0 to 2, times four functions.

    They are ln(|s - w|/unit), 1/(s - w), 1/(s - w)^2 and 1.
    """

    logs: Array
    cauchy: AnyArray
    squares: AnyArray
    powers: Array


def _moments(
    w: AnyArray,
    a: Array,
    on_element: NDArray[np.bool_],
    unit: float,
) -> _Moments:
    """Return the integrals over elements of half lengths a (m,) at points w (n, m)."""
    c = [np.log((w - a) / (w + a))]
    c[0][on_element] = c[0][on_element].real + 1j * np.pi  # limit from the body, on the left
    c.append(2 * a + w * c[0])
    c.append(w * c[1])
    c.append(2 * a**3 / 3 + w * c[2])
    s = [-1 / (a - w) - 1 / (a + w)]
    s.append(c[0] + w * s[0])
    s.append(c[1] + w * s[1])
    log_end = np.log(np.abs(a - w) / unit)
    log_start = np.log(np.abs(a + w) / unit)
    logs = [
        (a ** (k + 1) * log_end - (-a) ** (k + 1) * log_start - c[k + 1].real) / (k + 1)
        for k in range(3)
    ]
    scale = a[:, None] ** -np.arange(3.0)
    powers = a[:, None] * np.array([2.0, 0.0, 2 / 3])
    return _Moments(
        np.stack(logs, -1) * scale, np.stack(c[:3], -1) * scale, np.stack(s, -1) * scale, powers
    )


def _real(A: AnyArray, B: AnyArray) -> Array:
    """Matrix (2n, 2n) of the map u -> A u + B u*, on real parts before imaginary ones.

    A, B : (n, m, 3).
    """
    A = A.reshape(len(A), -1)
    B = B.reshape(len(B), -1)
    total = A + B
    difference = A - B
    return np.block([[total.real, -difference.imag], [total.imag, difference.real]])


def _split(values: AnyArray) -> Array:
    return np.concatenate([values.real, values.imag])


def _rigid_motion_terms(boundary: Boundary) -> Array:
    """Terms that make the equations of a free body regular.

    By them the mean of each rigid motion acts on that motion.
    """
    z = boundary.nodes / np.max(np.abs(boundary.nodes))
    one = np.ones(len(z))
    rigid = _split(np.stack([one, 1j * one, 1j * z], axis=-1))
    weights = np.concatenate([boundary.weights, boundary.weights]) / np.sum(boundary.weights)
    return np.asarray(rigid @ (weights[:, None] * rigid).T)


# Sizes of the elements. Halving all of them changes the compliances of forty random stages by at
# most 0.013 %.
ACROSS = 0.6  # in the neck, per neck
GROWTH = 0.5  # per distance from the neck
COARSEST = 0.35  # on the lug, per link width; twice that on the disc and the hub
RING = 0.7  # on the disc and the hub, per width of the ring between them
THIN = 1 / 8  # smallest on the ring, per radius of the hub: a thin ring is nearly rigid
ARC_ANGLE = 0.4  # rad, largest of an element on an arc
BLOCK = 2.0  # length of the straight block, per link width


def platform_compliance(stage: Stage, material: Elastic) -> Array:
    """Return the compliance (9, 9) that the platform adds to x, y, theta of the three chains.

    Raises BadInput when the platform cannot be drawn.

    Notes
    -----
    A lug is not a beam. It adds the difference of two bodies, both cut in the neck under the
    stresses of a beam: the drawn platform, and half the notch on a straight block, which the
    calibrated hinge includes. Where the hinges of the chains differ, the coupling of two lugs is
    the mean of that of three lugs like the first and three like the second.
    """
    cut_angle(stage)  # refuses lugs with no rim between them
    E = float(material.youngs_modulus)
    nu = float(material.poissons_ratio)
    uniform = [_uniform_lugs(stage, chain, nu) / (E * stage.thickness) for chain in CHAINS]
    coupled = np.zeros((3, 3, 3, 3))
    for i, j in np.ndindex(3, 3):
        coupled[i, j] = (uniform[i][i - j] + uniform[j][i - j]) / 2
    poses = [necks(stage, chain)[2] for chain in CHAINS]
    rotations = np.exp(1j * CHAIN_TURN * np.arange(3))
    axes = np.exp(1j * np.array([pose.heading for pose in poses])) * rotations
    J = freedom_motions(np.array([pose.point for pose in poses]) * rotations, axes)
    return np.asarray(np.einsum("ipa,ijab,jqb->ipjq", J, coupled, J).reshape(9, 9))


def _uniform_lugs(
    stage: Stage,
    chain: int,
    nu: float,
) -> Array:
    """Return the compliance of `_lug_compliance` of three lugs like that of a chain."""
    left = tuple(body_sides(stage, chain, 1)[3])
    right = tuple(body_sides(stage, chain, -1)[3])
    hinge = stage.hinge(chain, "platform")
    neck = necks(stage, chain)[2]
    return _lug_compliance(left, right, neck, hinge, stage.chain.link_width, stage.platform, nu)


@lru_cache(CACHE_SIZE)
def _lug_compliance(
    left: Edge, right: Edge, neck: Pose, hinge: Hinge, width: float, platform: Platform, nu: float
) -> Array:
    """Compliance (3, 3, 3) in excess of the hinge, at the necks of this and the next chains.

    It is that of three equal lugs, by moment, axial and transverse force on one neck, for unit
    Young's modulus and thickness.
    """
    disc = platform.radius
    hub = platform.hub_radius
    size = element_size(width, neck, hinge)
    rotation = cmath.exp(1j * CHAIN_TURN)
    rim = Segment(right[-1].end, left[-1].end * rotation, 0j)
    circle = Segment(hub + 0j, hub * rotation.conjugate(), 0j)
    ring_size = min(max(RING * (disc - hub), THIN * hub), 2 * COARSEST * width)
    parts = [
        divided([Segment(left[0].start, right[0].start)], size, ARC_ANGLE),
        divided([*right, *reverse(left)], size, ARC_ANGLE),
        divided([rim, circle], lambda _: ring_size, ARC_ANGLE),
    ]
    boundary, part = joined(parts)
    on_hub = np.abs(boundary.nodes) < (hub + disc) / 2
    loads = beam_stress(neck, hinge.neck, boundary.nodes, part == 0)
    compliance = 2 * (1 + nu) * _compliance(boundary, loads, on_hub, nu, len(CHAINS))
    compliance[0] -= _half_hinge(hinge, width, nu)
    return compliance


def _half_hinge(
    hinge: Hinge,
    width: float,
    nu: float,
) -> Array:
    """Compliance (3, 3) of half a hinge about its neck, for unit Young's modulus and thickness.

    It is that of the half on a straight block, less the block as a beam.
    """
    start = hinge.radius
    end = hinge.radius + BLOCK * width
    neck = Pose(0j, 0.0)
    boundary, part = joined(_block_with_notch(hinge, neck, width, end))
    at_neck = beam_stress(neck, hinge.neck, boundary.nodes, part == 0)
    moment, axial, shear = beam_stress(Pose(complex(end), 0.0), width, boundary.nodes, part == 2).T
    loads = at_neck - np.stack([moment, axial, shear - end * moment], axis=-1)
    nowhere = np.zeros(len(part), dtype=bool)
    (block,) = _compliance(boundary, loads, nowhere, nu) * 2 * (1 + nu)
    return np.asarray(block - _beam_compliance(start, end, width, nu))


def _block_with_notch(
    hinge: Hinge,
    neck: Pose,
    width: float,
    end: float,
) -> list[Boundary]:
    """Return the section in the neck, the right side, the end and the left side of a block."""
    left = notch_side(neck, hinge, width, 1)[1]
    right = notch_side(neck, hinge, width, -1)[1]
    edge = complex(end, -width / 2)
    back = complex(end, width / 2)
    paths: list[Sequence[Segment]] = [
        [Segment(left[0].start, right[0].start)],
        [*right, *polyline(right[-1].end, edge)],
        [Segment(edge, back)],
        [*polyline(back, left[-1].end), *reverse(left)],
    ]
    size = element_size(width, neck, hinge)
    return [divided(path, size, ARC_ANGLE) for path in paths]


def _beam_compliance(
    start: float,
    end: float,
    width: float,
    nu: float,
) -> Array:
    """Compliance (3, 3) of a beam from `start` to `end` by moment, axial and transverse force at 0.

    It is that for unit Young's modulus and thickness.
    """
    powers = [end - start, (end**2 - start**2) / 2, (end**3 - start**3) / 3]
    bending = 12 / width**3 * np.array(powers)
    beam = np.diag([bending[0], (end - start) / width, 0.0])
    beam[2, 2] = bending[2] + SHEAR_CORRECTION * 2 * (1 + nu) * (end - start) / width
    beam[0, 2] = -bending[1]
    beam[2, 0] = -bending[1]
    return beam


def element_size(
    width: float,
    pose: Pose,
    hinge: Hinge,
) -> Callable[[complex], float]:
    """Return the largest element size, mm, as a function of a point of a body with a neck."""

    def size(point: complex) -> float:
        distance = max(0.0, abs(point - pose.point) - hinge.neck / 2)
        return min(COARSEST * width, ACROSS * hinge.neck + GROWTH * distance)

    return size


def joined(parts: list[Boundary]) -> tuple[Boundary, AnyArray]:
    """Return one boundary of all parts, and the index (n,) of the part of each node."""
    whole = Boundary(*(np.concatenate(ends) for ends in zip(*parts, strict=True)))
    return whole, np.repeat(np.arange(len(parts)), [len(part.nodes) for part in parts])


def beam_stress(
    pose: Pose,
    height: float,
    nodes: AnyArray,
    on_section: AnyArray,
) -> AnyArray:
    """Return tractions (n, 3) on a section by unit moment, axial and transverse force.

    They are linear, constant and parabolic.
    """
    axis = cmath.exp(1j * pose.heading)
    y = ((nodes - pose.point) / axis).imag
    moment = -12 * y / height**3 * axis
    shear = 1.5 / height * (1 - (2 * y / height) ** 2) * 1j * axis
    stress = np.stack([moment, np.full(len(nodes), axis / height), shear], axis=-1)
    return np.where(on_section[:, None], stress, 0.0)


def _compliance(
    boundary: Boundary, loads: AnyArray, fixed: AnyArray, poissons_ratio: float, copies: int = 1
) -> Array:
    """Compliance (copies, k, k) of each copy to loads on the first, made reciprocal.

    It is that for unit shear modulus and thickness.
    """
    u = displacements(boundary, loads, fixed, poissons_ratio, copies)
    work = ((np.conj(loads) * boundary.weights[:, None]).T @ u).real
    reciprocal = np.swapaxes(work[-np.arange(copies)], -1, -2)
    return np.asarray((work + reciprocal) / 2)


POINTS = 12  # Gauss points along each line or arc, for quadratic and trigonometric integrands
RADII = 32  # Gauss points across a curved bar, in the logarithm of the radius


@memoized
def body_compliance(stage: Stage) -> Array:
    """Return the compliance (9, 9) that pads, links and platform add to x, y, theta of the chains.

    Raises BadInput when they cannot be drawn.
    """
    material = stage.elastic
    bars = np.zeros((3, 3, 3, 3))
    for chain in CHAINS:
        pieces = [
            bar_density(stage, material, segment)[0]
            for line in centrelines(stage, chain)
            for segment in line
        ]
        R = chain_rotation(chain - 1)
        bars[chain - 1, :, chain - 1] = R @ np.sum(pieces, axis=(0, 1)) @ R.T
    return bars.reshape(9, 9) + platform_compliance(stage, material)


def bar_density(
    stage: Stage, material: Elastic, segment: Segment, first: float = 0.0, last: float = 1.0
) -> tuple[Array, Array]:
    """Return compliances (q, 3, 3) at the platform of pieces of one line or arc, and their places.

    The places (q,) are fractions of its length; the pieces are from the `first` to the `last`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    fraction = first + (last - first) * (nodes + 1) / 2
    if segment.centre is None:
        places = segment.at(fraction)
        density = _straight(stage, material)
    else:
        places = np.full(POINTS, segment.centre)
        signs = np.array([float(np.sign(segment.turn)), 1.0, 1.0])
        radius = abs(segment.start - segment.centre)
        density = _curved(stage, material, radius) * np.outer(signs, signs)
    J = freedom_motions(places, segment.tangent(fraction))
    lengths = weights / 2 * segment.length * (last - first)
    return np.asarray(np.einsum("q,qia,ab,qjb->qij", lengths, J, density, J)), fraction


def _straight(stage: Stage, material: Elastic) -> Array:
    """Compliance per length (3, 3) of a straight bar to moment, axial force and shear."""
    E, nu = material
    width = stage.chain.link_width
    shear = SHEAR_CORRECTION * 2 * (1 + nu)
    return np.asarray(np.diag([12 / width**2, 1.0, shear]) / (E * stage.thickness * width))


def _curved(
    stage: Stage,
    material: Elastic,
    radius: float,
) -> Array:
    """Compliance per length (3, 3) of a curved bar to loads at its centre of curvature.

    The loads are moment, axial force and shear.

    Notes
    -----
    It uses the exact plane stresses of `bend_stresses`: a sharp bend (b/a = 9) is 44 % softer than
    Winkler's bar.
    """
    E, nu = material
    width = stage.chain.link_width
    a = radius - width / 2
    b = radius + width / 2
    r, dr = _radii(a, b)
    r_dr = r * dr
    bending, tension, shear, radial = bend_stresses(a, b, r)
    # by moment and by axial force, radial and tangential
    stress = np.array([[radial, bending], [shear, tension]])
    hooke = np.array([[1, -nu], [-nu, 1]])
    density = np.zeros((3, 3))
    density[:2, :2] = np.einsum("ian,ab,jbn,n->ij", stress, hooke, stress, r_dr)
    density[2, 2] = 2 * (1 + nu) * np.sum(shear**2 * r_dr)
    return density / (E * stage.thickness * radius)


def _radii(a: float, b: float) -> tuple[Array, Array]:
    """Return radii (q,) from a to b, mm, and their quadrature weights, mm."""
    nodes, weights = np.polynomial.legendre.leggauss(RADII)
    r = a * (b / a) ** ((nodes + 1) / 2)
    return r, weights / 2 * np.log(b / a) * r


# size of elements at the clamped corners, per link width; it grows as from the neck
CORNER = 1 / 100


@memoized
def edge_motions(stage: Stage, neck_factor: float = 1.0) -> Array:
    """Return motions (3 chains, 3, 3 cases) of the platform by strain and bow of clamped edges.

    The hinges are at rest. They are per difference of the expansions of frame and stage, for 1 K, 1
    K/mm along x and 1 K/mm along y about the platform's centre. `neck_factor` multiplies the necks
    of the base hinges.

    Notes
    -----
    From the middle z of the edge of a pad along e, at z + i e eta, the free fields `z`, `z^2/2`,
    `-i z^2/2` of x + iy differ from a rigid motion by a strain of 1, Re z, Im z and a bow of `-(e
    eta)^2/2` and `i (e eta)^2/2`. The neck at the end of the pad carries no load and moves as a
    rigid body."""
    width = stage.chain.link_width
    nu = float(stage.elastic.poissons_ratio)
    motions = np.zeros((3, 3, 3))
    for k, chain in enumerate(CHAINS):
        hinge = stage.hinge(chain, "base")
        neck = necks(stage, chain)[0]
        pad = _pad_motion(hinge.model_copy(update={"neck": neck_factor * hinge.neck}), width, nu)
        e = cmath.exp(1j * (neck.heading + k * CHAIN_TURN))
        z = neck.ahead(-hinge.radius - width).point * cmath.exp(1j * k * CHAIN_TURN)
        bow = np.array([0.0, -e, 1j * e])  # in the pad's own directions
        axial, transverse, rotation = pad @ np.stack([[1.0, z.real, z.imag], bow.real, bow.imag])
        translation = e * (axial + 1j * transverse) - 1j * rotation * z
        motions[k] = translation.real, translation.imag, rotation
    return motions


@lru_cache(CACHE_SIZE)
def _pad_motion(
    hinge: Hinge,
    width: float,
    poissons_ratio: float,
) -> Array:
    """Motion (3, 3) of the neck of a clamped pad at the middle of the edge.

    Rows are axial, transverse and rotation. The edge, eta to the left from its middle, has three
    displacements: eta along itself; eta^2/2 ahead; eta^2/2 along.
    """
    neck = Pose(0j, 0.0)
    middle = -hinge.radius - width + 0j
    boundary, part = joined(_pad(hinge, neck, width, middle))
    along = boundary.end - boundary.start
    outward = np.repeat(-1j * along / np.abs(along), len(NODES))
    field, traction = _edge_fields(boundary.nodes - middle, outward, poissons_ratio)
    u = field + displacements(boundary, -traction, part == 0, poissons_ratio)[0]
    stress = beam_stress(neck, hinge.neck, boundary.nodes, part == 2)
    rotation, axial, transverse = ((np.conj(stress) * boundary.weights[:, None]).T @ u).real
    return np.stack([axial, transverse + middle.real * rotation, rotation])


def _pad(
    hinge: Hinge,
    neck: Pose,
    width: float,
    middle: complex,
) -> list[Boundary]:
    """Return the clamped edge, right side, section in the neck and left side of a pad."""
    edge = Segment(middle + 0.5j * width, middle - 0.5j * width)
    left_wall = notch_side(neck, hinge, width, 1)[0]
    right_wall = notch_side(neck, hinge, width, -1)[0]
    left = [*polyline(edge.start, left_wall[0].start), *left_wall]
    right = [*polyline(edge.end, right_wall[0].start), *right_wall]
    end = Segment(right[-1].end, left[-1].end)
    size = element_size(width, neck, hinge)

    def graded_size(point: complex) -> float:
        distance = min(abs(point - edge.start), abs(point - edge.end))
        return min(size(point), CORNER * width + GROWTH * distance)

    paths = ([edge], right, [end], reverse(left))
    return [divided(path, graded_size, ARC_ANGLE) for path in paths]


def _edge_fields(
    z: AnyArray,
    normal: AnyArray,
    poissons_ratio: float,
) -> tuple[AnyArray, AnyArray]:
    """Displacements in equilibrium (n, 3) with three displacements of the edge, and tractions.

    They are those for unit shear modulus. Their stresses along the edge are E; -E xi; E eta with a
    shear stress of -E xi, where xi is
    ahead of the edge."""
    nu = poissons_ratio
    x = z.real
    y = z.imag
    E = 2 * (1 + nu)
    zero = np.zeros(len(z))
    u = [
        -nu * x + 1j * y,
        (nu * x**2 + y**2) / 2 - 1j * x * y,
        -nu * x * y + 0.5j * (y**2 - (2 + nu) * x**2),
    ]
    sigma_yy = E * np.stack([zero + 1, -x, y])
    tau_xy = E * np.stack([zero, zero, -x])
    along_x = tau_xy * normal.imag
    along_y = tau_xy * normal.real + sigma_yy * normal.imag
    return np.stack(u, axis=-1), (along_x + 1j * along_y).T
