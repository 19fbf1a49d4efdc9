"""Compliances of bars along a path as Timoshenko beams: elastic bodies of a plate without finite elements.

With the start of the path held, the twist at i by a wrench at j is the integral of the beam's compliance from the start
to the nearer of both. Wrenches are then balanced by the conjugate load of the mean motion, as of any elastic body.
Contacts are sections that move rigidly, and bends as compliant as straight parts.
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import Array
from flexfem.mechanism.layout import ElasticBody, End, Layout, interfaces
from flexfem.mechanism.profiles import SHEAR_CORRECTION

PARTS = 24  # of a line or arc


def bar_bodies(layout: Layout) -> tuple[ElasticBody, ...]:
    """Return the compliances of all bars along a path, neither fixed nor clamped, at their interfaces."""
    free = [number for number, body in enumerate(layout.bodies) if body.path and not body.fixed and not body.clamped]
    return tuple(_bar(layout, number) for number in free)


def _bar(layout: Layout, number: int) -> ElasticBody:
    path, width, at = layout.bodies[number].path, float(layout.bodies[number].width or 0.0), interfaces(layout, number)
    ends = {one: layout.joints[one.hinge] for one in at if isinstance(one, End)}
    half = {one: (0.5 if one.far else -0.5) * np.exp(1j * joint.heading) for one, joint in ends.items()}
    places = np.array([
        ends[one].place + half[one] * ends[one].profile.length if isinstance(one, End) else one.point for one in at
    ])  # fmt: skip
    shares = np.array([np.clip(segment.shares(places), 0.0, 1.0) for segment in path])
    nearest = np.argmin([abs(one.at(share) - places) for one, share in zip(path, shares, strict=True)], axis=0)
    shear = SHEAR_CORRECTION * 2 * (1 + layout.poissons_ratio)
    density = np.diag([12 / width**2, 1.0, shear]) / (layout.youngs_modulus * layout.thickness * width)
    compliance, mass, marks, first = [np.zeros((1, 3, 3))], list[Array](), np.zeros(len(at), dtype=int), 0
    for k, segment in enumerate(path):
        cuts = np.unique([*np.linspace(0.0, 1.0, PARTS + 1), *shares[k, nearest == k]])
        marks[nearest == k] = first + np.searchsorted(cuts, shares[k, nearest == k])
        first += len(cuts) - 1
        middle, length = (cuts[:-1] + cuts[1:]) / 2, np.diff(cuts) * segment.length
        J, z = freedom_motions(segment.at(middle), segment.tangent(middle)), segment.at(middle)
        compliance.append(np.einsum("e,eia,ab,ejb->eij", length, J, density, J))
        M, polar = np.tile(np.eye(3), (len(z), 1, 1)), abs(z) ** 2 + width**2 / 12
        M[:, 0, 2], M[:, 1, 2], M[:, 2, 2] = -z.imag, z.real, polar
        M[:, 2, :2] = M[:, :2, 2]
        mass.append(M * length[:, None, None])
    whole, M = np.cumsum(np.concatenate(compliance), axis=0), np.concatenate(mass)
    spread = (M @ np.linalg.inv(M.sum(axis=0)))[:, :, None] / 2  # of unit wrenches, half to both ends of every part
    T = np.zeros((len(whole), 3, len(at), 3))
    T[marks, :, np.arange(len(at))] += np.eye(3)
    T[:-1] -= spread
    T[1:] -= spread
    index, flat = np.arange(len(whole)), T.reshape(3 * len(whole), -1)
    C = whole[np.minimum(index[:, None], index)].transpose(0, 2, 1, 3).reshape(3 * len(whole), -1)
    return ElasticBody(number, at, flat.T @ C @ flat)
