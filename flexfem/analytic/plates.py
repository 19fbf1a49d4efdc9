"""The analytic model of any plate mechanism: a `Network` of rigid or elastic bodies joined by
hinges.

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

from flexfem.analytic.network import (
    GROUND,
    Dynamics,
    InternalMotions,
    Network,
    ground_motions,
    solve,
    with_springs,
)
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.wide import wide_factors
from flexfem.mechanism.layout import ElasticBody, End, Joint, Layout, Patch, Port
from flexfem.mechanism.outlines import area_moments, inertia_of, integrals, polygon_points, polyline
from flexfem.mechanism.plate import components, cuts_of
from flexfem.mechanism.profiles import Profile
from flexfem.refused import BadInput, ComputationFailed

ACROSS = np.polynomial.legendre.leggauss(2)  # over the height of a hinge
SLIVER = 1e-12  # mm^2; what remains of coincident edges of two polygons may have no length at all


class NetworkResponse(NamedTuple):
    """Response to unit loads on k ports, of designs (...) with different hinges.

    compliance : (..., k, k), displacements of ports (rows), mm or rad per N or N mm; further
    columns are other cases.
    wrenches : (..., h, 3, k), tension N, transverse force V and moment M at the centre of each
    hinge, in its axes, on
        its end at the second body. The tension of a section is N; its moment, at x from the centre,
        is `M - x V`.
    """

    compliance: Array
    wrenches: Array


@lru_cache(4096)
def hinge_compliance_of(profile: Profile, E: float, nu: float, thickness: float) -> Array:
    """Return the compliance (3, 3) of a hinge at its centre, computed once for all hinges of one
    profile.
    """
    return profile.compliance(E, nu, thickness)


def beam_compliances(layout: Layout) -> Array:
    """Return the compliances (h, 3, 3) of all hinges at their centres by `Profile.compliance`."""
    found = list[Array]()
    for joint in layout.joints:
        E, nu, *_ = layout.material_of(joint)
        found.append(hinge_compliance_of(joint.profile, E, nu, layout.thickness))
    return np.array(found)


def hinge_compliances(layout: Layout) -> Array:
    """Return the compliances (h, 3, 3) of hinges at their centres, in three dimensions for a wide
    layout.
    """
    plane = beam_compliances(layout)
    return widened(layout, plane) if layout.wide else plane


def widened(layout: Layout, plane: Array) -> Array:
    """Return compliances (h, 3, 3) of hinges in three dimensions from those in plane stress, by
    `wide_factors`.
    """
    roots = np.sqrt(compliance_ratios(layout))
    return np.asarray(plane * roots[:, :, None] * roots[:, None])


def compliance_ratios(layout: Layout) -> Array:
    """Return the axial, transverse and rotational compliance (h, 3) of hinges to those in plane
    stress.

    They are one but for a wide layout.
    """
    if not layout.wide:
        return np.ones((len(layout.joints), 3))
    ratios = list[tuple[float, float, float]]()
    for joint in layout.joints:
        material = layout.material_of(joint)
        ratios.append(wide_factors(joint.profile, material.poissons_ratio, layout.thickness))
    return np.array(ratios)


def to_axes(place: complex, heading: float) -> Array:
    """Return the matrix (3, 3) from twists at the global origin to motions of a point in axes
    turned by `heading`.

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


def respond(
    layout: Layout,
    bodies: Sequence[ElasticBody] = (),
    ports: Sequence[Port] | None = None,
    hinges: Array | None = None,
    openings: Array | None = None,
) -> NetworkResponse:
    """Return the response of a layout to unit loads on its k ports or on other ones, then to c
    cases of `openings`.

    bodies : the elastic ones; others are rigid.
    hinges : (..., h, 3, 3), compliances at their centres in their axes, of several designs; by
    default
        `hinge_compliances`.
    openings : (h, 3, c), of the hinges at their centres in their axes.

    Raises ComputationFailed for bodies that can move without load or for far stiffer hinges than
    others, BadInput without hinges."""
    from scipy.linalg import block_diag  # takes a tenth of a second to import

    if not layout.joints:
        raise BadInput("no [[hinge]], which the analytic models need, expected models 'elements'")
    ports = layout.ports if ports is None else ports
    h = len(layout.joints)
    moving = moving_bodies(layout)
    number = {body: i for i, body in enumerate(moving)}
    cases = np.zeros((h, 3, 0)) if openings is None else openings
    k = len(ports)
    n = k + cases.shape[-1]
    if hinges is None:
        hinges = hinge_compliances(layout)
    centre = complex(
        np.mean([joint.place for joint in layout.joints])
    )  # origin of the network, against round-off
    from_axes = np.linalg.inv(
        [to_axes(joint.place - centre, joint.heading) for joint in layout.joints]
    )
    to_hinges = from_axes.transpose(0, 2, 1)  # of wrenches
    loads = dict[Patch, Array]()  # at the centre, (3, n), on every contact
    for j, port in enumerate(ports):
        for patch, wrench in port.parts:
            loads.setdefault(patch, np.zeros((3, n)))[:, j] += (
                to_axes(patch.point - centre, 0.0).T @ wrench
            )
    F = np.zeros((len(moving), 3, n))
    internal = InternalMotions(np.zeros((h, 3, n)), np.zeros((n, n)))
    for patch, wrenches in loads.items():
        if patch.body in number:
            F[number[patch.body]] += wrenches
    coupled = list[int]()
    blocks = list[Array]()
    shift = to_axes(centre, 0.0)
    for _, places, compliance in bodies:
        ends = [end for end in places if isinstance(end, End)]  # before the patches
        sign = np.repeat([1.0 if end.far else -1.0 for end in ends], 3)
        count = 3 * len(ends)
        patches = [
            loads.get(patch, np.zeros((3, n))) for patch in places if not isinstance(patch, End)
        ]
        X = np.concatenate([np.zeros((count, n)), *patches])
        to_centre = np.kron(np.eye(len(places)), shift)
        compliance = to_centre @ compliance @ to_centre.T
        CX = compliance @ X
        joined = [end.hinge for end in ends]
        internal.openings[joined] -= (sign[:, None] * CX[:count]).reshape(-1, 3, n)
        internal.motions[:] += X.T @ CX
        coupled += joined
        blocks.append(sign[:, None] * compliance[:count, :count] * sign)
    joints = tuple(
        (number.get(one.bodies[0], GROUND), number.get(one.bodies[1], GROUND))
        for one in layout.joints
    )
    coupling = block_diag(*blocks) if coupled else None
    net = Network(len(moving), 0, joints, from_axes @ hinges @ to_hinges, tuple(coupled), coupling)
    opened = np.concatenate([np.zeros((h, 3, k)), from_axes @ cases], axis=-1)
    found = solve(net, F, opened, internal)
    if np.isnan(found.motions).any():
        raise ComputationFailed(
            "a hinge is so much stiffer than others that the motion has no correct digits"
        )
    return NetworkResponse(found.motions[..., :k, :], to_hinges @ found.wrenches)


def warmed(
    layout: Layout,
    expansion: float,
    ground: float,
    bodies: Sequence[ElasticBody] = (),
    hinges: Array | None = None,
    of_parts: Array | None = None,
) -> tuple[Array, Array]:
    """Return motions (k, 3) of the ports and wrenches (h, 3, 3) of the hinges after a change of
    temperature.

    The cases are 1 K, 1 K per mm along x and 1 K per mm along y, about the origin. `expansion` of
    the plate in the plane and of the `ground`, 1/K: fixed bodies move as a free plate of the
    latter, a part of the motions.
    of_parts : those of all bodies, then of all hinges, if they differ from that of the plate.

    Notes
    -----
    The free displacements z, z^2 / 2 and -i z^2 / 2 per strain, complex, have no stress. The ends
    of hinges at the ground, or the clamped edges of a body at their middle, do not follow, and
    hinges open by the difference. So they do between bodies that expand unlike them."""
    turned = np.array([0.0, 1.0, -1.0j])
    moving = moving_bodies(layout)

    def free(point: complex) -> Array:
        z = np.array([point, point**2 / 2, -1j * point**2 / 2])
        return np.stack([z.real, z.imag, (point * turned).imag])

    count = len(layout.bodies)
    rates = np.full(count + len(layout.joints), expansion) if of_parts is None else of_parts
    clamps = dict[int, Array]()
    for number, one in enumerate(layout.bodies):
        if one.clamped:
            middle = np.mean([one.outline[edge].at(0.5) for edge in one.clamped])
            clamps[number] = (ground - rates[number]) * ground_motions(middle)
    openings = np.zeros((len(layout.joints), 3, 3))
    for opening, joint, own in zip(openings, layout.joints, rates[count:], strict=True):
        for body, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
            end = joint.place + sign * joint.profile.length / 2 * cmath.exp(1j * joint.heading)
            of_end = ground_motions(end)
            unlike = (rates[body] - own) * of_end
            if body in clamps:
                unlike = unlike + clamps[body]
            elif body not in moving:
                unlike = (ground - own) * of_end
            opening -= sign * to_axes(joint.place, joint.heading) @ unlike
    found = respond(layout, bodies, hinges=hinges, openings=openings)
    motions = found.compliance[:, -3:]
    wrenches = found.wrenches[..., -3:]
    for j, port in enumerate(layout.ports):
        for patch, wrench in port.parts:
            outside = patch.body < 0
            mean = (
                free(patch.point)
                if outside or patch.radius is not None
                else _mean_expansion(layout, patch)
            )
            mean = mean * (
                ground if outside or layout.bodies[patch.body].fixed else rates[patch.body]
            )
            if patch.body in clamps:
                mean += to_axes(patch.point, 0.0) @ clamps[patch.body]
            motions[j] += np.array(wrench) @ mean
    return motions, wrenches


def _mean_expansion(layout: Layout, patch: Patch) -> Array:
    """Mean motion (3, 3) of a whole body, at the point of its patch, by the free displacements of
    `warmed`.
    """
    area, first, polar, second, third = body_moments(layout, patch.body, hinges=False)
    c = first / area
    mean = np.array([first, second / 2, -1j * second / 2]) / area
    moment = (np.array([polar, third / 2, -1j * third / 2]) - c.conjugate() * mean * area).imag
    rotation = moment / (polar - abs(first) ** 2 / area).real
    at = mean + 1j * rotation * (patch.point - c)
    return np.stack([at.real, at.imag, rotation])


def body_moments(layout: Layout, body: int, hinges: bool = True) -> AnyArray:
    """Return the integrals (5,) over a body as in `outlines.area_moments`.

    With `hinges` the body extends to their centres, else to their ends.
    """
    outline = layout.bodies[body].outline
    holes = layout.bodies[body].holes
    total = np.sum([area_moments(loop) for loop in (outline, *holes)], axis=0)
    whole = shapely.Polygon(polygon_points(outline), [polygon_points(hole) for hole in holes])
    cut = shapely.intersection(
        whole,
        shapely.union_all([shapely.Polygon(polygon_points(box)) for box in cuts_of(layout, body)]),
    )
    for part in shapely.get_parts(cut):
        if isinstance(part, shapely.Polygon) and part.area > SLIVER:
            part = shapely.orient_polygons(part)
            total -= sum(
                area_moments(polyline(*shapely.get_coordinates(ring) @ [1, 1j]))
                for ring in (part.exterior, *part.interiors)
            )
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
    """Return the consistent mass matrix (6, 6) of a hinge for the twists of its two bodies at the
    origin, tonne and mm.

    Its sections move as in its static deflection by the motions of both bodies: of a long clamped
    leaf whose one end moves across, 13 / 35 of the mass counts, where half of it would be a quarter
    too much."""
    material = layout.material_of(joint)
    x, weights = joint.profile.quadrature
    height = joint.profile.height(x)
    z = x + 1j * joint.profile.middle(x)
    moments = (
        np.stack([np.ones_like(z), z, np.abs(z) ** 2 + height**2 / 12], axis=-1)
        * (weights * height)[:, None]
    )
    far = joint.profile.opened_before(material.poissons_ratio)
    shapes = np.concatenate([np.eye(3) - far, far], axis=-1)
    mass = inertia_of(moments, material.density * layout.thickness)
    to_hinge = np.kron(np.eye(2), to_axes(joint.place, joint.heading))
    return np.asarray(
        to_hinge.T @ np.sum(np.swapaxes(shapes, 1, 2) @ mass @ shapes, axis=0) @ to_hinge
    )


def body_inertia(layout: Layout, body: int, with_hinges: bool) -> Array:
    """Return the mass matrix (3, 3), tonne to tonne mm^2, of a body to its hinges, or to their
    centres.
    """
    areal = layout.material_of(layout.bodies[body]).density * layout.thickness
    total = inertia_of(body_moments(layout, body, hinges=False)[:3], areal)
    for joint in layout.joints if with_hinges else ():
        if body in joint.bodies:
            half = _half_moments(joint, joint.bodies.index(body))[:3]
            total = total + inertia_of(half, layout.material_of(joint).density * layout.thickness)
    return total


def inertia(layout: Layout, lumped: bool = False) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n), and the mass matrix (n, n) of their motions, tonne and mm, without those of
    zero mass.

    The first ports are the twists x, y, theta of the moving bodies at the origin, three each; then
    those of the contacts of payloads and, with half of the mass each, of actuators. The mass of a
    hinge is that of `hinge_inertia`, or with `lumped`, for weights, each half of it moves with the
    body on its side."""
    parts = list[tuple[Patch, Array]]()
    moving = moving_bodies(layout)
    for body in moving:
        parts.append((Patch(body, 0j), body_inertia(layout, body, lumped)))
    parts += [
        (load.contact, np.diag([load.mass, load.mass, load.inertia])) for load in layout.payloads
    ]
    parts += [
        (at, np.diag([one.mass / 2] * 2 + [0.0])) for one in layout.actuators for at in one.contacts
    ]
    ports = list[Port]()
    M = np.zeros((3 * len(parts), 3 * len(parts)))
    for i, (contact, mass) in enumerate(parts):
        ports += [
            Port(f"mass {i} {row}", row == 2, ((contact, tuple(np.eye(3)[row])),))
            for row in range(3)
        ]
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mass
    for joint in () if lumped else layout.joints:
        ends = [side for side in (0, 1) if joint.bodies[side] in moving]
        rows = np.ravel(
            [3 * moving.index(joint.bodies[side]) + np.arange(3) for side in ends]
        ).astype(int)
        of_ends = np.ravel([3 * side + np.arange(3) for side in ends]).astype(int)
        M[np.ix_(rows, rows)] += hinge_inertia(layout, joint)[np.ix_(of_ends, of_ends)]
    kept = np.flatnonzero(np.diag(M) > 0)
    return tuple(ports[i] for i in kept), M[np.ix_(kept, kept)]


def modes(
    layout: Layout,
    bodies: Sequence[ElasticBody] = (),
    engaged: bool = False,
    hinges: Array | None = None,
) -> Array:
    """Return natural frequencies (n,), rad/s, ascending; with `engaged`, actuators act as springs
    of their stiffness.

    The mass of elastic bodies moves with their mean motion, and that of hinges between these; that
    of clamped bodies is neglected."""
    ports, M = inertia(layout)
    drives = [layout.ports[k] for k in layout.drive_ports if engaged]
    C = respond(layout, bodies, (*ports, *drives), hinges).compliance
    C = with_springs(C, layout.drive.stiffness) if drives else C
    found = Dynamics(C, M, len(M) if bodies else 3 * len(moving_bodies(layout))).frequencies
    return found[np.isfinite(found)]


def weights(layout: Layout) -> tuple[tuple[Port, ...], Array]:
    """Return ports (n), along x and y at the centres of mass of all that moves, and the masses
    (n,), tonne, on them.
    """
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


def weighed(
    layout: Layout,
    accelerations: Array,
    bodies: Sequence[ElasticBody] = (),
    hinges: Array | None = None,
) -> tuple[Array, Array]:
    """Return motions (k, c) of the ports and wrenches (h, 3, c) of the hinges by accelerations (c,
    2), mm/s^2.
    """
    ports, M = inertia(layout, lumped=True)
    k = len(layout.ports)
    response = respond(layout, bodies, (*layout.ports, *ports), hinges)
    forces = M @ np.array([port.parts[0][1][:2] for port in ports]) @ np.asarray(accelerations).T
    return response.compliance[:k, k:] @ forces, response.wrenches[:, :, k:] @ forces
