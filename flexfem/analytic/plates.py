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
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from flexfem.arrays import Array
from flexfem.mechanism.layout import Joint, Layout, Patch, Port
from flexfem.mechanism.outlines import Segment, area_moments, polygon_points, polyline
from flexfem.mechanism.profiles import GAUSS, Profile
from flexfem.refused import ComputationFailed

STILL = (
    1e-13  # relative to the largest compliance of a mode; smaller ones are round-off, of motions that are no freedom
)


class NetworkResponse(NamedTuple):
    """Response to unit loads on k ports.

    compliance : (k, k), displacements of the ports (rows), mm or rad per N or N mm.
    wrenches : (h, 3, k), tension N, transverse force V and moment M at the centre of each hinge, in its axes, on its
        end at the second body. The tension of a section is N; its moment, at x from the centre, is `M - x V`.
    """

    compliance: Array
    wrenches: Array

    def engaged(self, at: Sequence[int], rates: Array) -> NetworkResponse:
        """Return the response with springs of stiffness `rates` (n,), N/mm, between the contacts of the ports `at`.

        With actuators at rest engaged, a free stroke s of actuator a displaces the ports by `compliance[:, a] rate s`.
        """
        loads = np.eye(len(self.compliance))
        openings = self.compliance[np.ix_(at, at)] + np.diag(1 / rates)
        loads[list(at)] -= np.linalg.solve(openings, self.compliance[list(at)])
        return NetworkResponse(self.compliance @ loads, self.wrenches @ loads)


class PlateNetwork(NamedTuple):
    """Matrices of the network of h hinges, m moving bodies and k ports; symbols as in the module's text.

    moving : index of each of the m bodies.
    G : (3 h, 3 m).   A : (3 h, 3 h).   P : (3 m, k).   B : (3 h, k).   D : (k, k).
    """

    moving: tuple[int, ...]
    G: Array
    A: Array
    P: Array
    B: Array
    D: Array

    def solve(self, F: Array, openings: Array) -> tuple[Array, Array]:
        """Return twists (3 m, n) and wrenches (3 h, n) under loads (3 m, n) on bodies and openings (3 h, n)."""
        by_motion, by_opening = np.split(np.linalg.solve(self.A, np.hstack([self.G, openings])), [self.G.shape[1]], 1)
        U = np.linalg.solve(self.G.T @ by_motion, F + self.G.T @ by_opening)
        return U, by_motion @ U - by_opening


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
    reached, grown = set(ground), True
    while grown:
        joined = {i for hinge in layout.hinges for i in hinge.bodies if reached & {*hinge.bodies}}
        grown = not joined <= reached
        reached |= joined
    if loose := [body.name for i, body in enumerate(layout.bodies) if i not in reached]:
        names = ", ".join(repr(name) for name in loose)
        raise ComputationFailed(f"{names} can move without load: no chain of hinges leads from there to a fixed body")
    return tuple(i for i in range(len(layout.bodies)) if i not in ground)


def network_of_plate(layout: Layout, ports: Sequence[Port]) -> PlateNetwork:
    """Return the network of a layout with loads on `ports`. Raises ComputationFailed as `moving_bodies`."""
    moving, k, h = moving_bodies(layout), len(ports), len(layout.hinges)
    column = {body: 3 * i for i, body in enumerate(moving)}
    G, A = np.zeros((3 * h, 3 * len(moving))), np.zeros((3 * h, 3 * h))
    P = np.zeros((3 * len(moving), k))
    material = (layout.youngs_modulus, layout.poissons_ratio, layout.thickness)
    for row, hinge in zip(range(0, 3 * h, 3), layout.hinges, strict=True):
        A[row : row + 3, row : row + 3] = hinge_compliance_of(hinge.profile, *material)
        for body, sign in zip(hinge.bodies, (-1.0, 1.0), strict=True):
            if body in column:
                G[row : row + 3, column[body] : column[body] + 3] += sign * to_axes(hinge.place, hinge.heading)
    for j, port in enumerate(ports):
        for patch, wrench in port.parts:
            if patch.body in column:
                at = column[patch.body]
                P[at : at + 3, j] += to_axes(patch.point, 0.0).T @ wrench
    return PlateNetwork(moving, G, A, P, np.zeros((3 * h, k)), np.zeros((k, k)))


def respond(layout: Layout, ports: Sequence[Port] | None = None) -> NetworkResponse:
    """Return the response of a layout with rigid bodies to unit loads on its ports, or on other ones.

    Raises ComputationFailed for bodies that can move without load.
    """
    net = network_of_plate(layout, layout.ports if ports is None else ports)
    U, w = net.solve(net.P, net.B)
    return NetworkResponse(net.P.T @ U + net.B.T @ w + net.D, w.reshape(len(layout.hinges), 3, -1))


def drift(layout: Layout, expansion: float, frame: float, change: float = 1.0) -> tuple[Array, Array]:
    """Return motions (k,) of the ports and wrenches (h, 3) of the hinges after a uniform change of temperature, K.

    expansion, frame : coefficients, 1/K, of the plate, and of the frame that carries its fixed bodies. Motions are
        relative to the frame as it expands.

    Notes
    -----
    Relative to the frame, every body expands freely and evenly about the origin, except that the ends of the hinges at
    fixed bodies, or the clamped edges of a body, stay where they are: the hinges open by the difference.
    """
    ports, strain = layout.ports, (expansion - frame) * change
    net = network_of_plate(layout, ports)
    e = np.zeros((len(layout.hinges), 3, 1))
    for opening, hinge in zip(e, layout.hinges, strict=True):
        for body, sign in zip(hinge.bodies, (-1.0, 1.0), strict=True):
            if body not in net.moving:
                kept = [layout.bodies[body].outline[edge] for edge in layout.bodies[body].clamped]
                end = hinge.place + sign * hinge.profile.length / 2 * cmath.exp(1j * hinge.heading)
                held = complex(np.mean([edge.at(0.5) for edge in kept])) if kept else end
                axes = to_axes(hinge.place, hinge.heading)
                opening[:, 0] += sign * strain * (axes @ [held.real, held.imag, 0.0])
    U, w = net.solve(np.zeros((net.P.shape[0], 1)), e.reshape(-1, 1))
    free = np.zeros(len(ports))
    for j, port in enumerate(ports):
        for at, wrench in port.parts:
            if at.body in net.moving:
                free[j] += strain * (wrench[0] * at.point.real + wrench[1] * at.point.imag)
    return (net.P.T @ U + net.B.T @ w)[:, 0] + free, w.reshape(-1, 3)


def body_moments(layout: Layout, body: int) -> Array:
    """Return area, first moments in x and y, and polar second moment about the origin (4,) of a body, mm^2 to mm^4.

    Each body extends to the centres of its hinges.
    """
    outline, holes = layout.bodies[body].outline, layout.bodies[body].holes
    total = np.sum([area_moments(loop) for loop in (outline, *holes)], axis=0)
    hinges = [hinge for hinge in layout.hinges if body in hinge.bodies]
    whole = shapely.Polygon(polygon_points(outline), [polygon_points(hole) for hole in holes])
    cut = shapely.intersection(whole, shapely.union_all([_box(hinge) for hinge in hinges]))
    for part in shapely.get_parts(cut):
        if isinstance(part, shapely.Polygon):
            part = shapely.orient_polygons(part)
            total -= sum(area_moments(_ring(ring.coords)) for ring in (part.exterior, *part.interiors))
    return np.asarray(total + sum(_half_moments(hinge, hinge.bodies.index(body)) for hinge in hinges))


def _ring(points: Iterable[tuple[float, ...]]) -> list[Segment]:
    return polyline(*(complex(x, y) for x, y in points))


def _box(hinge: Joint) -> shapely.Polygon:
    """Return the box in which the hinge replaces the material of its bodies."""
    half, side, turn = hinge.profile.length / 2, 0.5j * hinge.cut, cmath.exp(1j * hinge.heading)
    corners = np.array([half + side, -half + side, -half - side, half - side]) * turn + hinge.place
    return shapely.Polygon(np.column_stack([corners.real, corners.imag]))


def _half_moments(hinge: Joint, end: int) -> Array:
    """Return the moments (4,), as of `body_moments`, of the half of a hinge at its first (0) or second body (1)."""
    half = hinge.profile.length / 2
    marks = sorted({-half, 0.0, half, *hinge.profile.breaks})
    a = np.zeros(3)
    for low, high in pairwise(marks):
        if (low >= 0) == (end == 1):
            x = low + (high - low) * (GAUSS[0] + 1) / 2
            height = hinge.profile.height(x)
            powers = np.stack([height, x * height, x**2 * height + height**3 / 12])
            a += powers @ GAUSS[1] * (high - low) / 2
    turn = cmath.exp(1j * hinge.heading)
    first = hinge.place * a[0] + turn * a[1]
    polar = abs(hinge.place) ** 2 * a[0] + 2 * (hinge.place.conjugate() * turn).real * a[1] + a[2]
    return np.array([a[0], first.real, first.imag, polar])


def inertia(layout: Layout) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n), and the mass matrix (n, n) of their motions, tonne and mm, without those of zero mass.

    The first ports are the twists x, y, theta of the moving bodies at the origin, three each; then those of the
    contacts of payloads and, with half of the mass each, of actuators.
    """
    parts = list[tuple[Patch, Array]]()
    for body in moving_bodies(layout):
        area, x, y, polar = layout.density * layout.thickness * body_moments(layout, body)
        parts.append((Patch(body, 0j), np.array([[area, 0, -y], [0, area, x], [-y, x, polar]])))
    parts += [(load.contact, np.diag([load.mass, load.mass, load.inertia])) for load in layout.payloads]
    parts += [(at, np.diag([one.mass / 2] * 2 + [0.0])) for one in layout.actuators for at in one.contacts]
    ports, M = list[Port](), np.zeros((3 * len(parts), 3 * len(parts)))
    for i, (contact, mass) in enumerate(parts):
        ports += [Port(f"mass {i} {row}", row == 2, ((contact, tuple(np.eye(3)[row])),)) for row in range(3)]
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mass
    kept = np.flatnonzero(np.diag(M) > 0)
    return tuple(ports[i] for i in kept), M[np.ix_(kept, kept)]


def _with_masses(layout: Layout, engaged: bool) -> tuple[NetworkResponse, tuple[Port, ...], Array]:
    """Response to loads on the k ports of the layout, then on those of its masses; `inertia` of the layout."""
    ports, M = inertia(layout)
    k, drives = len(layout.ports), len(layout.actuators)
    response = respond(layout, (*layout.ports, *ports))
    if engaged and drives:
        response = response.engaged(range(k - drives, k), layout.stiffness_of_actuators)
    return response, ports, M


def modes(layout: Layout, engaged: bool = True) -> PlateModes:
    """Return natural frequencies and modes; with `engaged`, the actuators act as springs of their stiffness."""
    response, _, M = _with_masses(layout, engaged)
    k, L = len(layout.ports), np.linalg.cholesky(M)
    values, vectors = np.linalg.eigh(L.T @ response.compliance[k:, k:] @ L)
    values, vectors = values[::-1], vectors[:, ::-1]
    n = int(np.sum(values > STILL * values[0]))
    motions = response.compliance[:, k:] @ L @ (vectors[:, :n] / values[:n])
    moving = 3 * len(moving_bodies(layout))
    return PlateModes(1 / np.sqrt(values[:n]), motions[k : k + moving].T.reshape(n, -1, 3), motions[:k].T)


def sag(layout: Layout, gravity: tuple[float, float], engaged: bool = False) -> tuple[Array, Array]:
    """Return motions (k,) of the ports and wrenches (h, 3) of the hinges under gravity in the plane, mm/s^2."""
    response, ports, M = _with_masses(layout, engaged)
    k, force = len(layout.ports), M @ [np.dot(gravity, port.parts[0][1][:2]) for port in ports]
    return response.compliance[:k, k:] @ force, response.wrenches[:, :, k:] @ force
