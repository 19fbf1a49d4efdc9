"""What the necks of driven designs carry, their stress, and the limits that yield sets to commands.

At every place x along a neck, from its centre, `|6 (M K_b + V x K_s) / (b h^2)| + |N K_t / (b h)|`, h the height of
the notch there: stacks that work against each other shear necks, and beside the centre a shear force bends, with a
concentration of its own. All are taken to be those of the centre. M, N, V are linear in the commands, so that yield is
four half-spaces for every place: one for each pair of signs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.hinges.strength import stress_raised
from flexfem.mechanism.designs import Designs, Frames
from flexfem.verify.driven import DriveLimits, Driven

BESIDE, SECTIONS = 0.7, 141  # how far beside the centre, per radius of the notch, and at how many places
SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])  # of bending and of tension


class NeckForces(NamedTuple):
    """What the necks carry, (..., 3 chains, 3 hinges): moments about their centres, forces along and across, N mm, N.

    With one more axis at the end: per load, per command.
    """

    moment: Array
    normal: Array
    shear: Array


class NeckSections(NamedTuple):
    """Levers x (..., 3 chains, 3 hinges, s) of V at places along the necks, mm, and stress there: of M + V x, and of N.

    x : distance of the place from the centre, times K_s / K_b.   Stress is von Mises'.
    bending : MPa per N mm.   tension : MPa per N.
    """

    x: Array
    bending: Array
    tension: Array


def neck_forces(frames: Frames, wrenches: Array) -> NeckForces:
    """What necks carry of wrenches (..., 3 chains, 3 hinges, 3, k) at the platform centre, each (..., 3, 3, k)."""
    F_x, F_y, M = np.moveaxis(wrenches, -2, 0)
    x, y = np.moveaxis(frames.centres, -1, 0)[..., None]
    c, s = np.cos(frames.axes)[..., None], np.sin(frames.axes)[..., None]
    return NeckForces(M + y * F_x - x * F_y, c * F_x + s * F_y, c * F_y - s * F_x)


def sections_of(designs: Designs, count: int = SECTIONS) -> NeckSections:
    """The places of n designs, (n, 3, 3, s), an odd `count` of them: one is the centre alone."""
    radius, neck = designs.radius[..., None], designs.neck[..., None]
    x = radius * (np.linspace(-BESIDE, BESIDE, count) if count > 1 else np.zeros(1))
    high = neck + 2 * radius - 2 * np.sqrt(radius**2 - x**2)
    bending, tension, shear = (part[..., None] for part in stress_raised(designs))
    area = designs.thickness[:, None, None, None] * high
    return NeckSections(x * shear / bending, 6 * bending / area / high, tension / area)


def stress_along(at: NeckSections, carried: NeckForces) -> Array:
    """Stress (..., 3, 3, s), MPa, at every place, of forces (..., 3, 3)."""
    M, N, V = (each[..., None] for each in carried)
    return np.asarray(np.abs(at.bending * (M + V * at.x)) + np.abs(at.tension * N))


def per_command(of: Driven, frames: Frames, necks: Array) -> NeckForces:
    """What necks carry (..., 3, 3, m) per command, by the wrenches `necks` of `DrivenModel`."""
    pushed = (of.Y @ of.T)[..., None, None, :, :]
    return neck_forces(frames, necks[..., 3:] @ pushed)


def limits_of_necks(at: NeckSections, carried: NeckForces, at_rest: NeckForces, strength: Array) -> DriveLimits:
    """Every half-space that yield at `strength` (...), MPa, sets to the commands: 36 s of them.

    Parameters
    ----------
    carried : per command, (..., 3, 3, m).   at_rest : (..., 3, 3), of a load without commands.
    """
    rows = _signed(at, NeckForces(*(each[..., None, :] for each in carried)), at.x[..., None])
    rest = _signed(at, NeckForces(*(each[..., None, None] for each in at_rest)), at.x[..., None])
    lead, m = rows.shape[:-5], rows.shape[-1]
    offsets = -rest.reshape(*rest.shape[:-5], -1)
    sizes = np.broadcast_to(strength[..., None], offsets.shape)
    return DriveLimits(rows.reshape(*lead, -1, m), offsets, sizes)


def _signed(at: NeckSections, carried: NeckForces, x: Array) -> Array:
    """Stresses (..., 3, 3, s, 4, m) with the `SIGNS` of bending and tension, of forces (..., 3, 3, s, m)."""
    bent = at.bending[..., None] * (carried.moment + carried.shear * x)
    pulled = at.tension[..., None] * carried.normal
    return np.asarray(SIGNS[:, :1] * bent[..., None, :] + SIGNS[:, 1:] * pulled[..., None, :])
