"""The analytic model of a mechanism: a `Network` of rigid or elastic bodies joined by hinges.

Ports are loads on bodies. The compliance of elastic bodies at their hinges is that of the network's
coupling; the motions of elastic bodies, relative to their mean motion, by loads on ports are its
internal motions."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from flexfem.analytic.network import (
    GROUND,
    Dynamics,
    InternalMotions,
    Network,
    NetworkModes,
    ground_motions,
    solve,
    with_springs,
)
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.wide import wide_factors
from flexfem.mechanism.hinge_place import cuts_of
from flexfem.mechanism.layout import ElasticBody, End, Joint, Layout, Patch, Port
from flexfem.mechanism.outlines import area_moments, inertia_of, integrals, polygon_points, polyline
from flexfem.mechanism.plate import components
from flexfem.mechanism.profile import Profile
from flexfem.refused import BadInput, ComputationFailed

ACROSS = np.polynomial.legendre.leggauss(2)  # over the height of a hinge
SLIVER = 1e-12  # mm^2; what remains of coincident edges of two polygons may have no length at all


class NetworkResponse(NamedTuple):
    """Response to unit loads on k ports, of designs (...) with different hinges.

    compliance : (..., k, k), displacements of ports (rows), mm or rad per N or N mm; further
        columns are other cases.
    wrenches : (..., h, 3, k), tension N, transverse force V and moment M at the centre of each
        hinge, in its axes, on its end at the second body. The tension of a section is N; its
        moment, at x from the centre, is `M - x V`.
    """

    compliance: Array
    wrenches: Array


@lru_cache(4096)
def hinge_compliance_of(
    profile: Profile,
    E: float,
    nu: float,
    thickness: float,
) -> Array:
    """Return the compliance (3, 3) of a hinge at its centre, computed once for each profile."""
    return profile.compliance(E, nu, thickness)


def beam_compliances(layout: Layout) -> Array:
    """Return the compliances (h, 3, 3) of all hinges at their centres by `Profile.compliance`."""
    found = list[Array]()
    for joint in layout.joints:
        E, nu, *_ = layout.material_of(joint)
        found.append(hinge_compliance_of(joint.profile, E, nu, layout.thickness))
    return np.array(found)


def hinge_compliances(layout: Layout) -> Array:
    """Return the compliances (h, 3, 3) of hinges, in three dimensions for a wide layout."""
    plane = beam_compliances(layout)
    return widened(layout, plane) if layout.wide else plane


def widened(layout: Layout, plane: Array) -> Array:
    """Return compliances (h, 3, 3) of hinges in three dimensions from those in plane stress."""
    roots = np.sqrt(compliance_ratios(layout))
    return np.asarray(plane * roots[:, :, None] * roots[:, None])


def compliance_ratios(layout: Layout) -> Array:
    """Return axial, transverse and rotational compliances (h, 3) over those in plane stress."""
    if not layout.wide:
        return np.ones((len(layout.joints), 3))
    ratios = list[tuple[float, float, float]]()
    for joint in layout.joints:
        material = layout.material_of(joint)
        ratios.append(wide_factors(joint.profile, material.poissons_ratio, layout.thickness))
    return np.array(ratios)


def to_axes(place: complex, heading: float) -> Array:
    """Return the matrix (3, 3) from twists at the global origin to motions of a point.

    The motions are in axes turned by `heading`, rad.

    Its transpose takes a wrench at the point in these axes to the global origin.
    """
    c = np.cos(heading)
    s = np.sin(heading)
    x = place.real
    y = place.imag
    return np.array([[c, s, s * x - c * y], [-s, c, c * x + s * y], [0.0, 0.0, 1.0]])


def moving_bodies(layout: Layout) -> tuple[int, ...]:
    """Return the bodies that are not ground: neither fixed nor clamped.

    Raises ComputationFailed for bodies that no chain of hinges joins to the ground.
    """
    ground = {i for i, body in enumerate(layout.bodies) if body.fixed or body.clamped}
    loose = {i for joined in components(layout) if not joined & ground for i in joined}
    if loose:
        names = ", ".join(repr(layout.bodies[i].name) for i in sorted(loose))
        raise ComputationFailed(
            f"{names} can move without load: no chain of hinges leads from there to a fixed body"
        )
    return tuple(i for i in range(len(layout.bodies)) if i not in ground)


class _HingeFrames(NamedTuple):
    """Axes of the h hinges about an origin near them, against round-off.

    origin : complex, mm.
    from_axes : (h, 3, 3), from motions at the centre of a hinge, in its axes, to twists at the
        origin.
    """

    origin: complex
    from_axes: Array

    @property
    def to_hinges(self) -> Array:
        """From wrenches at the origin to those at the centres of the hinges (h, 3, 3)."""
        return np.swapaxes(self.from_axes, 1, 2)


def _hinge_frames(joints: Sequence[Joint]) -> _HingeFrames:
    origin = complex(np.mean([joint.place for joint in joints]))
    to_all_axes = [to_axes(joint.place - origin, joint.heading) for joint in joints]
    return _HingeFrames(origin, np.asarray(np.linalg.inv(to_all_axes), dtype=np.float64))


def _contact_wrenches(
    ports: Sequence[Port],
    origin: complex,
    cases: int,
) -> dict[Patch, Array]:
    """Return the wrenches (3, cases) about the origin on every contact, of a unit load per case.

    cases : at least one for each port.
    """
    found = dict[Patch, Array]()
    for case, port in enumerate(ports):
        for patch, wrench in port.parts:
            on_contact = found.setdefault(patch, np.zeros((3, cases)))
            on_contact[:, case] += to_axes(patch.point - origin, 0.0).T @ wrench
    return found


def _loads_on_bodies(
    loads: dict[Patch, Array],
    moving: Sequence[int],
    cases: int,
) -> Array:
    """Return the sums (b, 3, cases) of the wrenches on the contacts of each moving body."""
    found = np.zeros((len(moving), 3, cases))
    for patch, wrenches in loads.items():
        if patch.body in moving:
            found[moving.index(patch.body)] += wrenches
    return found


class _Interfaces(NamedTuple):
    """Elastic interfaces of bodies with c ends of hinges, under n loads on their contacts.

    ends : hinges at the ends, c numbers.   compliance : (3 c, 3 c), as of `Network.coupling`.
    openings : (3 c, n), of the hinges.   motions : (n, n), conjugate to the loads.
    """

    ends: list[int]
    compliance: Array
    openings: Array
    motions: Array


def _interfaces(
    body: ElasticBody, loads: dict[Patch, Array], origin: complex, cases: int
) -> _Interfaces:
    """Return an elastic body about an origin, under wrenches (3, cases) on contacts."""
    ends = [end for end in body.interfaces if isinstance(end, End)]  # before the patches
    sign = np.repeat([1.0 if end.far else -1.0 for end in ends], 3)
    at_ends = slice(0, 3 * len(ends))
    to_origin = np.kron(np.eye(len(body.interfaces)), to_axes(origin, 0.0))
    compliance = to_origin @ body.compliance @ to_origin.T
    X = np.zeros((len(compliance), cases))
    for row, interface in enumerate(body.interfaces):
        if not isinstance(interface, End) and interface in loads:
            X[3 * row : 3 * row + 3] = loads[interface]
    CX = compliance @ X
    joined = sign[:, None] * compliance[at_ends, at_ends] * sign
    openings = -sign[:, None] * CX[at_ends]
    return _Interfaces([end.hinge for end in ends], joined, openings, X.T @ CX)


def _internal_motions(
    parts: Sequence[_Interfaces],
    hinges: int,
    cases: int,
) -> InternalMotions:
    """Return the sums of the motions of elastic bodies."""
    found = InternalMotions(np.zeros((hinges, 3, cases)), np.zeros((cases, cases)))
    for part in parts:
        found.openings[part.ends] += part.openings.reshape(-1, 3, cases)
        found.motions[:] += part.motions
    return found


def _network(
    layout: Layout, moving: Sequence[int], compliance: Array, parts: Sequence[_Interfaces]
) -> Network:
    """Return the network of the moving bodies.

    compliance : (..., h, 3, 3), of the hinges as of `Network`.
    """
    from scipy.linalg import block_diag  # takes a tenth of a second to import

    number = {body: i for i, body in enumerate(moving)}
    pairs = [joint.bodies for joint in layout.joints]
    joints = tuple((number.get(near, GROUND), number.get(far, GROUND)) for near, far in pairs)
    coupled = tuple(end for part in parts for end in part.ends)
    coupling = block_diag(*(part.compliance for part in parts)) if coupled else None
    return Network(len(moving), 0, joints, compliance, coupled, coupling)


def respond(
    layout: Layout,
    bodies: Sequence[ElasticBody] = (),
    ports: Sequence[Port] | None = None,
    hinges: Array | None = None,
    openings: Array | None = None,
) -> NetworkResponse:
    """Return the response of a layout to unit loads on its k ports, then to c cases of openings.

    bodies : the elastic ones; others are rigid.
    ports : by default those of the layout.
    hinges : (..., h, 3, 3), compliances at their centres in their axes, of several designs; by
        default `hinge_compliances`.
    openings : (h, 3, c), of the hinges at their centres in their axes.

    Raises ComputationFailed for bodies that can move without load or for far stiffer hinges than
    others, BadInput without hinges.
    """
    if not layout.joints:
        raise BadInput("no [[hinge]], which the analytic models need, expected models 'elements'")
    ports = layout.ports if ports is None else ports
    hinges = hinge_compliances(layout) if hinges is None else hinges
    moving = moving_bodies(layout)
    frames = _hinge_frames(layout.joints)
    opened = np.zeros((len(layout.joints), 3, len(ports)))
    if openings is not None:
        opened = np.concatenate([opened, frames.from_axes @ openings], axis=-1)
    cases = opened.shape[-1]
    loads = _contact_wrenches(ports, frames.origin, cases)
    parts = [_interfaces(body, loads, frames.origin, cases) for body in bodies]
    net = _network(layout, moving, frames.from_axes @ hinges @ frames.to_hinges, parts)
    internal = _internal_motions(parts, len(layout.joints), cases)
    found = solve(net, _loads_on_bodies(loads, moving, cases), opened, internal)
    if np.isnan(found.motions).any():
        raise ComputationFailed(
            "a hinge is so much stiffer than others that the motion has no correct digits"
        )
    return NetworkResponse(found.motions[..., : len(ports), :], frames.to_hinges @ found.wrenches)


class _Expansions(NamedTuple):
    """Expansions, 1/K, of a plate: of its bodies, its hinges, and of the ground."""

    bodies: Array
    hinges: Array
    ground: float


def _expansions(
    layout: Layout, expansion: float, ground: float, of_parts: Array | None
) -> _Expansions:
    count = len(layout.bodies)
    rates = of_parts
    if rates is None:
        rates = np.full(count + len(layout.joints), expansion)
    return _Expansions(rates[:count], rates[count:], ground)


def thermal_response(
    layout: Layout,
    expansion: float,
    ground: float,
    bodies: Sequence[ElasticBody] = (),
    hinges: Array | None = None,
    of_parts: Array | None = None,
) -> tuple[Array, Array]:
    """Return motions (k, 3) of ports and wrenches (h, 3, 3) of hinges by changes of temperature.

    The cases are 1 K, 1 K per mm along x and 1 K per mm along y, about the origin. `expansion` of
    the plate in the plane and of the `ground`, 1/K: fixed bodies move as a free plate of the
    latter, a part of the motions.
    of_parts : those of all bodies, then of all hinges, if they differ from that of the plate.

    Notes
    -----
    The free displacements z, z^2 / 2 and -i z^2 / 2 per strain, complex, have no stress. The ends
    of hinges at the ground, or the clamped edges of a body at their middle, do not follow, and
    hinges open by the difference. So they do between bodies that expand unlike them."""
    rates = _expansions(layout, expansion, ground, of_parts)
    clamps = _clamped_motions(layout, rates)
    openings = _warm_openings(layout, rates, clamps)
    found = respond(layout, bodies, hinges=hinges, openings=openings)
    motions = found.compliance[:, -3:]
    for j, port in enumerate(layout.ports):
        for patch, wrench in port.parts:
            motions[j] += np.array(wrench) @ _warm_motion(layout, patch, rates, clamps)
    return motions, found.wrenches[..., -3:]


def _clamped_motions(layout: Layout, rates: _Expansions) -> dict[int, Array]:
    """Return motions (3, 3 cases) of the origin of bodies with clamped edges, less their expansion.

    The middle of their clamped edges moves with the ground.
    """
    found = dict[int, Array]()
    for number, body in enumerate(layout.bodies):
        if body.clamped:
            middle = np.mean([body.outline[edge].at(0.5) for edge in body.clamped])
            found[number] = (rates.ground - rates.bodies[number]) * ground_motions(middle)
    return found


def _warm_openings(
    layout: Layout,
    rates: _Expansions,
    clamps: dict[int, Array],
) -> Array:
    """Return the openings (h, 3, 3 cases) of hinges whose ends do not follow their expansion."""
    moving = moving_bodies(layout)
    openings = np.zeros((len(layout.joints), 3, 3))
    for opening, joint, own in zip(openings, layout.joints, rates.hinges, strict=True):
        for body, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
            end = joint.place + sign * joint.profile.length / 2 * cmath.exp(1j * joint.heading)
            of_end = ground_motions(end)
            if body in moving:
                unlike = (rates.bodies[body] - own) * of_end
            elif body in clamps:
                unlike = (rates.bodies[body] - own) * of_end + clamps[body]
            else:
                unlike = (rates.ground - own) * of_end
            opening -= sign * to_axes(joint.place, joint.heading) @ unlike
    return openings


def _warm_motion(
    layout: Layout, patch: Patch, rates: _Expansions, clamps: dict[int, Array]
) -> Array:
    """Return the motion (3, 3 cases) of a contact by the free expansion of its body."""
    outside = patch.body < 0
    if outside or patch.radius is not None:
        mean = _free_motion(patch.point)
    else:
        mean = _mean_expansion(layout, patch)
    at_ground = outside or layout.bodies[patch.body].fixed
    mean = mean * (rates.ground if at_ground else rates.bodies[patch.body])
    if patch.body in clamps:
        mean += to_axes(patch.point, 0.0) @ clamps[patch.body]
    return mean


def _free_motion(point: complex) -> Array:
    """Return displacement and rotation (3, 3 cases) of a point of a free body per expansion."""
    z = np.array([point, point**2 / 2, -1j * point**2 / 2])
    rotation = (point * np.array([0.0, 1.0, -1.0j])).imag
    return np.stack([z.real, z.imag, rotation])


def _mean_expansion(layout: Layout, patch: Patch) -> Array:
    """Mean motion (3, 3 cases) of a whole body, at the point of its patch, per expansion."""
    area, first, polar, second, third = body_moments(layout, patch.body, hinges=False)
    c = first / area
    mean = np.array([first, second / 2, -1j * second / 2]) / area
    moment = (np.array([polar, third / 2, -1j * third / 2]) - c.conjugate() * mean * area).imag
    rotation = moment / (polar - abs(first) ** 2 / area).real
    at = mean + 1j * rotation * (patch.point - c)
    return np.stack([at.real, at.imag, rotation])


def body_moments(
    layout: Layout,
    body: int,
    hinges: bool = True,
) -> AnyArray:
    """Return the integrals (5,) over a body as in `outlines.area_moments`.

    With `hinges` the body extends to their centres, else to their ends.
    """
    outline = layout.bodies[body].outline
    holes = layout.bodies[body].holes
    total = np.sum([area_moments(loop) for loop in (outline, *holes)], axis=0)
    whole = shapely.Polygon(polygon_points(outline), [polygon_points(hole) for hole in holes])
    boxes = [shapely.Polygon(polygon_points(box)) for box in cuts_of(layout, body)]
    for part in shapely.get_parts(shapely.intersection(whole, shapely.union_all(boxes))):
        if isinstance(part, shapely.Polygon) and part.area > SLIVER:
            part = shapely.orient_polygons(part)
            for ring in (part.exterior, *part.interiors):
                total -= area_moments(polyline(*shapely.get_coordinates(ring) @ [1, 1j]))
    for joint in layout.joints if hinges else ():
        if body in joint.bodies:
            total += _half_moments(joint, joint.bodies.index(body))
    return np.asarray(total)


def _half_moments(joint: Joint, end: int) -> AnyArray:
    """Integrals (5,) over the half of a hinge at its first (0) or second body (1)."""
    x, weights = joint.profile.quadrature
    half = (x >= 0) == (end == 1)
    height = joint.profile.height(x[half])
    middle = x[half] + 1j * joint.profile.middle(x[half])
    z = joint.place + cmath.exp(1j * joint.heading) * (middle + 0.5j * np.outer(ACROSS[0], height))
    return integrals(z.ravel(), np.outer(ACROSS[1] / 2, height * weights[half]).ravel())


def hinge_inertia(layout: Layout, joint: Joint) -> Array:
    """Return the consistent mass matrix (6, 6) of a hinge, tonne and mm.

    It is that for the twists of its two bodies at the origin.

    Its sections move as in its static deflection by the motions of both bodies: of a long clamped
    leaf whose one end moves across, 13 / 35 of the mass counts, where half of it would be a quarter
    too much."""
    material = layout.material_of(joint)
    own = hinge_mass(joint.profile, material.poissons_ratio)
    to_hinge = np.kron(np.eye(2), to_axes(joint.place, joint.heading))
    areal = material.density * layout.thickness
    return np.asarray(to_hinge.T @ (areal * own) @ to_hinge)


def hinge_mass(profile: Profile, poissons_ratio: ArrayLike) -> Array:
    """Return the consistent mass matrix (..., 6, 6) of a hinge per mass of an area, mm^2 to mm^4.

    It is that for the twists of both ends at the centre of the hinge, in its axes, whose profile
    may have dimensions (..., 1).
    """
    x, weights = profile.quadrature
    height = profile.height(x)
    z = x + 1j * profile.middle(x)
    second = np.abs(z) ** 2 + height**2 / 12
    moments = np.stack([np.ones_like(z), z, second], axis=-1) * (weights * height)[..., None]
    far = profile.opened_before(poissons_ratio)
    shapes = np.concatenate([np.eye(3) - far, far], axis=-1)
    mass = inertia_of(moments, 1.0)
    return np.asarray(np.sum(np.swapaxes(shapes, -1, -2) @ mass @ shapes, axis=-3))


def body_inertia(
    layout: Layout,
    body: int,
    with_hinges: bool,
) -> Array:
    """Return the mass matrix (3, 3), tonne to tonne mm^2, of a body.

    with_hinges : whether the body extends to the centres of its hinges, else to their ends.
    """
    areal = layout.material_of(layout.bodies[body]).density * layout.thickness
    total = inertia_of(body_moments(layout, body, hinges=False)[:3], areal)
    for joint in layout.joints if with_hinges else ():
        if body in joint.bodies:
            half = _half_moments(joint, joint.bodies.index(body))[:3]
            areal = layout.material_of(joint).density * layout.thickness
            total = total + inertia_of(half, areal)
    return total


def inertia(layout: Layout, lumped: bool = False) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n) and the mass matrix (n, n) of their motions, tonne and mm.

    The first ports are the twists x, y, theta of the moving bodies at the origin, three each; then
    those of the contacts of payloads and, with half of the mass each, of actuators. Motions of zero
    mass are left out.

    lumped : whether each half of a hinge moves with the body on its side, as for weights. By
        default the mass of a hinge is that of `hinge_inertia`.
    """
    parts = _masses(layout, lumped)
    ports = list[Port]()
    M = np.zeros((3 * len(parts), 3 * len(parts)))
    for number, (contact, mass) in enumerate(parts):
        for row, unit in enumerate(np.eye(3)):
            ports.append(Port(f"mass {number} {row}", row == 2, ((contact, tuple(unit)),)))
        own = slice(3 * number, 3 * number + 3)
        M[own, own] = mass
    if not lumped:
        _add_hinges(M, layout, moving_bodies(layout))
    kept = np.flatnonzero(np.diag(M) > 0)
    return tuple(ports[i] for i in kept), M[np.ix_(kept, kept)]


def _masses(layout: Layout, lumped: bool) -> list[tuple[Patch, Array]]:
    """Return the points and mass matrices (3, 3) of moving bodies, payloads and actuators."""
    found = [
        (Patch(body, 0j), body_inertia(layout, body, lumped)) for body in moving_bodies(layout)
    ]
    for load in layout.payloads:
        found.append((load.contact, np.diag([load.mass, load.mass, load.inertia])))
    for actuator in layout.actuators:
        half = np.diag([actuator.mass / 2, actuator.mass / 2, 0.0])
        found += [(contact, half) for contact in actuator.contacts]
    return found


def _add_hinges(
    M: Array,
    layout: Layout,
    moving: Sequence[int],
) -> None:
    """Add the masses of hinges to a matrix whose first rows are the twists of the moving bodies."""
    for joint in layout.joints:
        sides = [side for side in (0, 1) if joint.bodies[side] in moving]
        firsts = [3 * moving.index(joint.bodies[side]) for side in sides]
        rows = np.add.outer(firsts, range(3)).astype(int).ravel()
        of_sides = np.add.outer(3 * np.array(sides), range(3)).astype(int).ravel()
        M[np.ix_(rows, rows)] += hinge_inertia(layout, joint)[np.ix_(of_sides, of_sides)]


def modes(
    layout: Layout,
    bodies: Sequence[ElasticBody] = (),
    engaged: bool = False,
    hinges: Array | None = None,
) -> NetworkModes:
    """Return the natural modes, as motions of the ports of `inertia`.

    engaged : whether actuators act as springs of their stiffness.

    The mass of elastic bodies moves with their mean motion, and that of hinges between these; that
    of clamped bodies is neglected."""
    ports, M = inertia(layout)
    drives = [layout.ports[k] for k in layout.drive_ports if engaged]
    C = respond(layout, bodies, (*ports, *drives), hinges).compliance
    if drives:
        C = with_springs(C, layout.drive.stiffness)
    mobility = len(M) if bodies else 3 * len(moving_bodies(layout))
    return Dynamics(C, M, mobility).modes


def weights(layout: Layout) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n) along x and y at the centres of moving masses, and these (n,), tonne."""
    ports = list[Port]()
    masses = list[float]()
    parts = [(load.contact, load.mass) for load in layout.payloads]
    parts += [(at, one.mass / 2) for one in layout.actuators for at in one.contacts]
    for body in moving_bodies(layout):
        inertial = body_inertia(layout, body, with_hinges=True)
        centre = complex(inertial[1, 2], -inertial[0, 2]) / inertial[0, 0]
        parts.append((Patch(body, centre), float(inertial[0, 0])))
    for contact, mass in parts:
        for direction in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
            ports.append(Port("weight", False, ((contact, direction),)))
            masses.append(mass)
    return tuple(ports), np.array(masses)


def weight_response(
    layout: Layout,
    accelerations: Array,
    bodies: Sequence[ElasticBody] = (),
    hinges: Array | None = None,
) -> tuple[Array, Array]:
    """Return motions (k, c) of ports and wrenches (h, 3, c) of hinges by weight.

    accelerations : (c, 2), mm/s^2.
    """
    ports, M = inertia(layout, lumped=True)
    k = len(layout.ports)
    response = respond(layout, bodies, (*layout.ports, *ports), hinges)
    forces = M @ np.array([port.parts[0][1][:2] for port in ports]) @ np.asarray(accelerations).T
    return response.compliance[:k, k:] @ forces, response.wrenches[:, :, k:] @ forces
