"""The analytic model of any plate mechanism: rigid or elastic bodies joined by hinges, solved in one network.

With the twists U of the moving bodies at the global origin, the wrenches w on the far ends of the hinges, each at the
centre in the axes of its hinge, the openings e of the hinges, and loads f on ports that put F = P f on the bodies,

    G U - A w = e + B f,    G' w = F,    y = P' U + B' w + D f,

where y are the displacements conjugate to f, and G subtracts the motion of a hinge's near body from that of its far one
at its centre. A is the compliance of the hinges and of the elastic bodies between them; B and D are the motions of the
elastic bodies, relative to their mean motion, that loads on ports cause.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.layout import ElasticBody, End, Joint, Layout, Patch, Port
from flexfem.mechanism.outlines import GAUSS as ALONG
from flexfem.mechanism.outlines import Segment, polygon_points, polyline
from flexfem.mechanism.plate import components, cuts_of
from flexfem.mechanism.profiles import Profile
from flexfem.refused import BadInput, ComputationFailed

ACROSS = np.polynomial.legendre.leggauss(2)  # over the height of a hinge
SLIVER = 1e-12  # mm^2; what remains of coincident edges of two polygons may have no length at all
STILL = (
    1e-13  # relative to the largest compliance of a mode; smaller ones are round-off, of motions that are no freedom
)


class NetworkResponse(NamedTuple):
    """Response to unit loads on k ports, of designs (...) with different hinges.

    compliance : (..., k, k), displacements of ports (rows), mm or rad per N or N mm; further columns are other cases.
    wrenches : (..., h, 3, k), tension N, transverse force V and moment M at the centre of each hinge, in its axes, on
        its end at the second body. The tension of a section is N; its moment, at x from the centre, is `M - x V`.
    """

    compliance: Array
    wrenches: Array

    def engaged(self, at: Sequence[int], rates: Array) -> NetworkResponse:
        """Return the response with springs of stiffness `rates` (n,), N/mm, between the contacts of the ports `at`.

        With actuators at rest engaged, a free stroke s of actuator a displaces the ports by `compliance[:, a] rate s`.
        """
        loads = np.eye(self.compliance.shape[1])
        openings = self.compliance[np.ix_(at, at)] + np.diag(1 / rates)
        loads[list(at)] -= np.linalg.solve(openings, self.compliance[list(at)])
        return NetworkResponse(self.compliance @ loads, self.wrenches @ loads)


class PlateNetwork(NamedTuple):
    """Matrices of the network of h hinges, m moving bodies and k ports; symbols as in the module's text.

    moving : index of each of the m bodies.
    G : (3 h, 3 m).   A : (..., 3 h, 3 h).   P : (3 m, k).   B : (3 h, k).   D : (k, k).
    """

    moving: tuple[int, ...]
    G: Array
    A: Array
    P: Array
    B: Array
    D: Array

    def solve(self, F: Array, openings: Array) -> tuple[Array, Array]:
        """Return twists (..., 3 m, n), wrenches (..., 3 h, n) under loads (3 m, n) on bodies, openings (3 h, n)."""
        designs = self.A.shape[:-2]
        U, w = np.zeros((*designs, self.G.shape[1], F.shape[1])), np.zeros((*designs, len(self.G), F.shape[1]))
        by_motion = np.linalg.solve(self.A, self.G)
        for _ in range(2):  # the second removes the round-off of stiff hinges in series with compliant ones
            by_opening = np.linalg.solve(self.A, openings - self.G @ U + self.A @ w)
            more = np.linalg.solve(self.G.T @ by_motion, F - self.G.T @ (w - by_opening))
            U, w = U + more, w + by_motion @ more - by_opening
        return U, w


class PlateModes(NamedTuple):
    """Natural frequencies (n,), rad/s, ascending; shapes (n, m, 3), the twists of the m moving bodies at the global
    origin, and motions (n, k) of the ports in the modes of unit modal mass, tonne and mm."""

    frequencies: Array
    shapes: Array
    motions: Array


@lru_cache(4096)
def hinge_compliance_of(profile: Profile, E: float, nu: float, thickness: float) -> Array:
    """Return the compliance (3, 3) of a hinge at its centre, computed once for all hinges of one profile."""
    return profile.compliance(E, nu, thickness)


def to_axes(place: complex, heading: float) -> Array:
    """Return the matrix (3, 3) from twists at the global origin to motions of a point in axes turned by `heading`.

    Its transpose takes a wrench at the point in these axes to the global origin.
    """
    c, s, x, y = np.cos(heading), np.sin(heading), place.real, place.imag
    return np.array([[c, s, s * x - c * y], [-s, c, c * x + s * y], [0.0, 0.0, 1.0]])


def moving_bodies(layout: Layout) -> tuple[int, ...]:
    """Return the bodies that are not ground: neither fixed nor clamped.

    Raises ComputationFailed for bodies that no chain of hinges joins to the ground.
    """
    ground = {i for i, body in enumerate(layout.bodies) if body.fixed or body.clamped}
    loose = {i for joined in components(layout) if not joined & ground for i in joined}
    if loose:
        names = ", ".join(repr(layout.bodies[i].name) for i in sorted(loose))
        raise ComputationFailed(f"{names} can move without load: no chain of hinges leads from there to a fixed body")
    return tuple(i for i in range(len(layout.bodies)) if i not in ground)


def network_of_plate(
    layout: Layout, ports: Sequence[Port], bodies: Sequence[ElasticBody] = (), hinges: Array | None = None
) -> PlateNetwork:
    """Return the network of a layout with loads on `ports`; other than `bodies` are rigid.

    hinges : (..., h, 3, 3), compliances at their centres in their axes, of several designs for A (..., 3 h, 3 h); by
        default `Profile.compliance`.

    Raises ComputationFailed as `moving_bodies`, BadInput without hinges.
    """
    if not layout.joints:
        raise BadInput("no [[hinge]], which the analytic models need, expected models 'elements'")
    moving, k, h = moving_bodies(layout), len(ports), len(layout.joints)
    column = {body: 3 * i for i, body in enumerate(moving)}
    designs = () if hinges is None else hinges.shape[:-3]
    G, A, P = np.zeros((3 * h, 3 * len(moving))), np.zeros((*designs, 3 * h, 3 * h)), np.zeros((3 * len(moving), k))
    B, D = np.zeros((3 * h, k)), np.zeros((k, k))
    material = (layout.youngs_modulus, layout.poissons_ratio, layout.thickness)
    axes = [to_axes(joint.place, joint.heading) for joint in layout.joints]
    for row, joint in enumerate(layout.joints):
        at = slice(3 * row, 3 * row + 3)
        A[..., at, at] = hinge_compliance_of(joint.profile, *material) if hinges is None else hinges[..., row, :, :]
        for body, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
            if body in column:
                G[at, column[body] : column[body] + 3] += sign * axes[row]
    loads = dict[Patch, Array]()  # at the origin, (3, k), on every contact
    for j, port in enumerate(ports):
        for patch, wrench in port.parts:
            loads.setdefault(patch, np.zeros((3, k)))[:, j] += to_axes(patch.point, 0.0).T @ wrench
    for patch, wrenches in loads.items():
        if patch.body in column:
            P[column[patch.body] : column[patch.body] + 3] += wrenches
    for elastic in bodies:
        R, X = np.zeros((3 * h, 3 * len(elastic.interfaces))), np.zeros((3 * len(elastic.interfaces), k))
        for i, one in enumerate(elastic.interfaces):
            if isinstance(one, End):
                R[3 * one.hinge : 3 * one.hinge + 3, 3 * i : 3 * i + 3] = (1.0 if one.far else -1.0) * axes[one.hinge]
            elif one in loads:
                X[3 * i : 3 * i + 3] = loads[one]
        RC = R @ elastic.compliance
        A, B, D = A + RC @ R.T, B - RC @ X, D + X.T @ elastic.compliance @ X
    return PlateNetwork(moving, G, A, P, B, D)


def respond(
    layout: Layout, bodies: Sequence[ElasticBody] = (), ports: Sequence[Port] | None = None, hinges: Array | None = None
) -> NetworkResponse:
    """Return the response of a layout to unit loads on its ports, or on other ones; parts as of `network_of_plate`.

    Raises ComputationFailed for bodies that can move without load.
    """
    net = network_of_plate(layout, layout.ports if ports is None else ports, bodies, hinges)
    U, w = net.solve(net.P, net.B)
    wrenches = w.reshape(*w.shape[:-2], len(layout.joints), 3, -1)
    return NetworkResponse(net.P.T @ U + net.B.T @ w + net.D, wrenches)


def warmed(
    layout: Layout, expansion: float, ground: float, bodies: Sequence[ElasticBody] = (), hinges: Array | None = None
) -> tuple[Array, Array]:
    """Return motions (k, 3) of the ports and wrenches (h, 3, 3) of the hinges after a change of temperature.

    The cases are 1 K, 1 K per mm along x and 1 K per mm along y, about the origin. `expansion` of the plate and of the
    `ground`, 1/K: fixed bodies move as a free plate of the latter, a part of the motions.

    Notes
    -----
    The free displacements z, z^2 / 2 and -i z^2 / 2 per strain, complex, have no stress. The ends of hinges at the
    ground, or the clamped edges of a body at their middle, do not follow, and hinges open by the difference.
    """
    ports, turned = layout.ports, np.array([0.0, 1.0, -1.0j])
    net = network_of_plate(layout, ports, bodies, hinges)

    def free(point: complex) -> Array:
        z = np.array([point, point**2 / 2, -1j * point**2 / 2])
        return np.stack([z.real, z.imag, (point * turned).imag])

    def back(point: complex) -> Array:
        """Twist at the origin that moves a point back to where it is on the ground."""
        return np.asarray((ground - expansion) * np.linalg.solve(to_axes(point, 0.0), free(point)))

    clamps = {
        number: back(complex(np.mean([body.outline[edge].at(0.5) for edge in body.clamped])))
        for number, body in enumerate(layout.bodies)
        if body.clamped
    }
    openings = np.zeros((len(layout.joints), 3, 3))
    for opening, joint in zip(openings, layout.joints, strict=True):
        for body, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
            if body not in net.moving:
                end = joint.place + sign * joint.profile.length / 2 * cmath.exp(1j * joint.heading)
                at_origin = clamps[body] if body in clamps else back(end)
                opening -= sign * to_axes(joint.place, joint.heading) @ at_origin
    U, w = net.solve(np.zeros((net.P.shape[0], 3)), openings.reshape(-1, 3))
    motions = net.P.T @ U + net.B.T @ w
    for j, port in enumerate(ports):
        for patch, wrench in port.parts:
            outside = patch.body < 0
            mean = free(patch.point) if outside or patch.radius is not None else _mean_expansion(layout, patch)
            mean = mean * (ground if outside or layout.bodies[patch.body].fixed else expansion)
            if patch.body in clamps:
                mean += to_axes(patch.point, 0.0) @ clamps[patch.body]
            motions[j] += np.array(wrench) @ mean
    return motions, w.reshape(-1, 3, 3)


def _mean_expansion(layout: Layout, patch: Patch) -> Array:
    """Mean motion (3, 3) of a whole body, at the point of its patch, by the free displacements of `warmed`."""
    area, first, polar, second, third = body_moments(layout, patch.body, hinges=False)
    c = first / area
    mean = np.array([first, second / 2, -1j * second / 2]) / area
    moment = (np.array([polar, third / 2, -1j * third / 2]) - c.conjugate() * mean * area).imag
    rotation = moment / (polar - abs(first) ** 2 / area).real
    at = mean + 1j * rotation * (patch.point - c)
    return np.stack([at.real, at.imag, rotation])


def body_moments(layout: Layout, body: int, hinges: bool = True) -> AnyArray:
    """Return the integrals (5,) of 1, z, |z|^2, z^2 and |z|^2 z over a body, mm^2 to mm^5, complex.

    With `hinges` the body extends to their centres, else to their ends.
    """
    outline, holes = layout.bodies[body].outline, layout.bodies[body].holes
    total = np.sum([_loop_moments(loop) for loop in (outline, *holes)], axis=0)
    whole = shapely.Polygon(polygon_points(outline), [polygon_points(hole) for hole in holes])
    cut = shapely.intersection(
        whole, shapely.union_all([shapely.Polygon(polygon_points(box)) for box in cuts_of(layout, body)])
    )
    for part in shapely.get_parts(cut):
        if isinstance(part, shapely.Polygon) and part.area > SLIVER:
            part = shapely.orient_polygons(part)
            total -= sum(_loop_moments(_ring(ring.coords)) for ring in (part.exterior, *part.interiors))
    for joint in layout.joints if hinges else ():
        if body in joint.bodies:
            total += _half_moments(joint, joint.bodies.index(body))
    return np.asarray(total)


def _integrals(z: AnyArray, weights: Array) -> AnyArray:
    """Integrals (5,) as of `body_moments` from points (n,) and weights (5, n) or (n,)."""
    square = np.abs(z) ** 2
    return np.asarray(np.sum(np.stack([np.ones_like(z), z, square, z**2, square * z]) * weights, axis=1))


def _loop_moments(loop: Iterable[Segment]) -> AnyArray:
    """Integrals (5,) over a closed counter-clockwise loop, as in `outlines.area_moments`."""
    share, weights = (ALONG[0] + 1) / 2, ALONG[1] / 2
    parts = [
        (z := segment.at(share), weights * segment.length * (np.conj(z) * segment.tangent(share)).imag)
        for segment in loop
    ]
    z, w = (np.concatenate(values) for values in zip(*parts, strict=True))
    return _integrals(z, w / np.array([2, 3, 4, 4, 5])[:, None])


def _ring(points: Iterable[tuple[float, ...]]) -> list[Segment]:
    return polyline(*(complex(x, y) for x, y in points))


def _half_moments(joint: Joint, end: int) -> AnyArray:
    """Integrals (5,) over the half of a hinge at its first (0) or second body (1)."""
    x, weights = joint.profile.quadrature
    half = (x >= 0) == (end == 1)
    height = joint.profile.height(x[half])
    z = joint.place + cmath.exp(1j * joint.heading) * (x[half] + 0.5j * np.outer(ACROSS[0], height))
    return _integrals(z.ravel(), np.outer(ACROSS[1] / 2, height * weights[half]).ravel())


def inertia(layout: Layout) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n), and the mass matrix (n, n) of their motions, tonne and mm, without those of zero mass.

    The first ports are the twists x, y, theta of the moving bodies at the origin, three each; then those of the
    contacts of payloads and, with half of the mass each, of actuators.
    """
    parts = list[tuple[Patch, Array]]()
    for body in moving_bodies(layout):
        mass, first, polar = layout.density * layout.thickness * body_moments(layout, body)[:3]
        M = np.array([[mass, 0, -first.imag], [0, mass, first.real], [-first.imag, first.real, polar]]).real
        parts.append((Patch(body, 0j), M))
    parts += [(load.contact, np.diag([load.mass, load.mass, load.inertia])) for load in layout.payloads]
    parts += [(at, np.diag([one.mass / 2] * 2 + [0.0])) for one in layout.actuators for at in one.contacts]
    ports, M = list[Port](), np.zeros((3 * len(parts), 3 * len(parts)))
    for i, (contact, mass) in enumerate(parts):
        ports += [Port(f"mass {i} {row}", row == 2, ((contact, tuple(np.eye(3)[row])),)) for row in range(3)]
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mass
    kept = np.flatnonzero(np.diag(M) > 0)
    return tuple(ports[i] for i in kept), M[np.ix_(kept, kept)]


def _with_masses(
    layout: Layout, bodies: Sequence[ElasticBody], hinges: Array | None
) -> tuple[NetworkResponse, tuple[Port, ...], Array]:
    """Response to loads on the k ports of the layout, then on those of its masses; `inertia` of the layout."""
    ports, M = inertia(layout)
    return respond(layout, bodies, (*layout.ports, *ports), hinges), ports, M


def modes(
    layout: Layout, bodies: Sequence[ElasticBody] = (), engaged: bool = False, hinges: Array | None = None
) -> PlateModes:
    """Return natural frequencies and modes; with `engaged`, the actuators act as springs of their stiffness.

    The mass of elastic bodies moves with their mean motion; that of clamped bodies is neglected.
    """
    response, _, M = _with_masses(layout, bodies, hinges)
    if engaged and layout.actuators:
        response = response.engaged(layout.drive_ports, layout.stiffness_of_actuators)
    k, L = len(layout.ports), np.linalg.cholesky(M)
    values, vectors = np.linalg.eigh(L.T @ response.compliance[k:, k:] @ L)
    values, vectors = values[::-1], vectors[:, ::-1]
    n = int(np.sum(values > STILL * values[0]))
    motions = response.compliance[:, k:] @ L @ (vectors[:, :n] / values[:n])
    moving = 3 * len(moving_bodies(layout))
    return PlateModes(1 / np.sqrt(values[:n]), motions[k : k + moving].T.reshape(n, -1, 3), motions[:k].T)


def weighed(
    layout: Layout, accelerations: Array, bodies: Sequence[ElasticBody] = (), hinges: Array | None = None
) -> tuple[Array, Array]:
    """Return motions (k, c) of the ports and wrenches (h, 3, c) of the hinges by accelerations (c, 2), mm/s^2."""
    response, ports, M = _with_masses(layout, bodies, hinges)
    k = len(layout.ports)
    forces = M @ np.array([port.parts[0][1][:2] for port in ports]) @ np.asarray(accelerations).T
    return response.compliance[:k, k:] @ forces, response.wrenches[:, :, k:] @ forces
