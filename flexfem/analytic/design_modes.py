"""Natural frequencies of many designs of one mechanism by the analytic network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely

from flexfem.analytic.batched import to_axes, twists_under
from flexfem.analytic.designs import DesignNetwork
from flexfem.analytic.network import GROUND, Dynamics
from flexfem.analytic.plates import body_moments, hinge_mass
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.many import in_parts, varying
from flexfem.mechanism.layout import Patch
from flexfem.mechanism.layouts import Layouts, Number
from flexfem.mechanism.outlines import inertia_of
from flexfem.refused import BadInput


def frequencies(network: DesignNetwork) -> Array:
    """Return natural frequencies (n, 3 bodies), rad/s, ascending, as `analytic.plates.modes`.

    They are infinite for freedoms that the hinges do not have, and nan for a design without a
    solution, or whose bodies cannot be drawn.
    """
    layouts = network.layouts
    moving = [body for body, is_held in enumerate(layouts.held) if not is_held]
    rows = {body: slice(3 * k, 3 * k + 3) for k, body in enumerate(moving)}
    size = 3 * len(moving)
    C = _compliance(network, rows, size)
    M = _mass(network, rows, size)
    possible = np.isfinite(M).all(axis=(-2, -1))
    M[~possible] = np.eye(size)
    possible &= np.linalg.eigvalsh(M)[:, 0] > 0
    M[~possible] = np.eye(size)
    return np.where(possible[:, None], Dynamics(C, M, size).frequencies, np.nan)


def _compliance(
    network: DesignNetwork,
    rows: Mapping[int, slice],
    size: int,
) -> Array:
    """Return the twists (n, size, size) of the moving bodies under unit loads on each."""
    loads = {body: np.zeros((network.layouts.number, 3, size)) for body in rows}
    for body, load in loads.items():
        load[:, :, rows[body]] = np.eye(3)
    twists = twists_under(network.bonds, loads)
    return np.concatenate([twists[body] for body in rows], axis=-2)


def _mass(
    network: DesignNetwork,
    rows: Mapping[int, slice],
    size: int,
) -> Array:
    """Return the mass matrices (n, size, size) of the twists of the moving bodies at the centre."""
    M = np.zeros((network.layouts.number, size, size))
    moments = _moments(network.layouts, list(rows))
    for own, (body, of_body) in zip(rows.values(), moments.items(), strict=True):
        M[:, own, own] = _of_body(network, body, of_body)
    for contact, mass in _carried(network):
        body = network.node(contact.body)
        if body != GROUND:
            T = network.to_point(contact)
            M[:, rows[body], rows[body]] += np.swapaxes(T, -1, -2) @ mass @ T
    _add_hinges(M, network, rows)
    return M


def _of_body(
    network: DesignNetwork,
    body: int,
    moments: AnyArray,
) -> Array:
    """Return the mass matrices (n, 3, 3) of a body at the centre from its integrals (n, 3)."""
    layouts = network.layouts
    areal = layouts.bodies[body].density * np.asarray(layouts.thickness)
    mass = inertia_of(moments, network.for_each(areal))
    to_origin = to_axes(-network.centre, 0.0)
    return np.asarray(np.swapaxes(to_origin, -1, -2) @ mass @ to_origin)


def _moments(layouts: Layouts, bodies: Sequence[int]) -> dict[int, AnyArray]:
    """Return the integrals (n, 3) over bodies without their hinges, as `body_moments`.

    They are nan where a design cannot be drawn.
    """
    found = {body: np.full((layouts.number, 3), np.nan, dtype=complex) for body in bodies}
    for design in range(layouts.number):
        try:
            drawn = layouts.drawn(design)
            for body, values in found.items():
                values[design] = body_moments(drawn, body, hinges=False)[:3]
        except (BadInput, shapely.GEOSException):
            continue
    return found


def _carried(network: DesignNetwork) -> Iterator[tuple[Patch, Array]]:
    """Yield the contacts and mass matrices (n, 3, 3) of payloads, and of halves of actuators."""
    for load in network.layouts.payloads:
        yield load.contact, _diagonal(network, load.mass, load.inertia)
    for actuator in network.layouts.inputs:
        half = _diagonal(network, np.asarray(actuator.mass) / 2, 0.0)
        for contact in actuator.contacts:
            yield contact, half


def _diagonal(
    network: DesignNetwork,
    mass: Number,
    inertia: Number,
) -> Array:
    entries = [network.for_each(each) for each in (mass, mass, inertia)]
    return np.asarray(np.stack(entries, axis=-1)[:, None] * np.eye(3))


def _add_hinges(
    M: Array,
    network: DesignNetwork,
    rows: Mapping[int, slice],
) -> None:
    """Add the masses of hinges, which move as in their static deflection between two bodies."""
    layouts = network.layouts
    for group in network.groups:
        material = layouts.hinges[group.numbers[0]].material
        areal = network.for_each(material.density * np.asarray(layouts.thickness))
        own = areal[:, None, None] * _of_hinge(network, group.numbers[0])
        for number in group.numbers:
            bond = network.bonds[number]
            T = np.zeros((layouts.number, 6, 6))
            T[:, :3, :3] = T[:, 3:, 3:] = bond.to_axes
            mass = np.swapaxes(T, -1, -2) @ own @ T
            for one, near in enumerate(bond.bodies):
                for other, far in enumerate(bond.bodies):
                    if near != GROUND and far != GROUND:
                        part = mass[:, 3 * one : 3 * one + 3, 3 * other : 3 * other + 3]
                        M[:, rows[near], rows[far]] += part


def _of_hinge(network: DesignNetwork, number: int) -> Array:
    """Return the mass matrices (n, 6, 6), or (1, 6, 6), of a hinge as `hinge_mass`."""
    hinge = network.layouts.hinges[number]
    ratio = network.for_each(hinge.material.poissons_ratio)
    if not varying(hinge.profile) and np.ndim(hinge.material.poissons_ratio) == 0:
        return hinge_mass(hinge.profile, ratio[0])[None]
    found = np.empty((network.layouts.number, 6, 6))
    for part, profile in in_parts(hinge.profile, len(found)):
        found[part] = hinge_mass(profile, ratio[part])
    return found
