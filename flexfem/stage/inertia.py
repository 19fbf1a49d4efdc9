"""Mass and inertia of the drawn bodies, from their outlines: exact for lines and arcs.

The hub is a disc of the stage's metal: it is left out of the meshed sectors because it is rigid, not because it is a
hole. Masses are in tonne, so that N, mm and s go together: `1 kg/m^3 = 1e-12 tonne/mm^3`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.stage.bodies import BODIES, draw_sector
from flexfem.stage.cache import once
from flexfem.stage.designs import CHAIN_TURN
from flexfem.stage.outline import Segment
from flexfem.stage.schema import CHAINS, Stage
from flexfem.units import DENSITY

POINTS = 16  # of Gauss on each line or arc of less than half a turn: exact to round-off


class Payload(NamedTuple):
    """What the platform carries, its centre of mass at the platform's centre and in the mid-plane.

    mass : tonne.   inertia, tilting : tonne mm^2, about the normal of the stage and about every axis in its mid-plane.
    """

    mass: float = 0.0
    inertia: float = 0.0
    tilting: float = 0.0


class Inertia(NamedTuple):
    """Mass (...), tonne; first moments (..., 2), tonne mm, and polar second moment (...), tonne mm^2, of the origin."""

    mass: Array
    first: Array
    second: Array

    @property
    def matrix(self) -> Array:
        """Mass matrix (..., 3, 3) of a rigid body whose twist x, y, theta is that of its point at the origin."""
        found = np.zeros((*np.shape(self.mass), 3, 3))
        found[..., 0, 0] = found[..., 1, 1] = self.mass
        found[..., 0, 2] = found[..., 2, 0] = -self.first[..., 1]
        found[..., 1, 2] = found[..., 2, 1] = self.first[..., 0]
        found[..., 2, 2] = self.second
        return found


def area_moments(loop: Sequence[Segment]) -> Array:
    """Area, first moments in x and y, polar second moment about the origin (4,), mm^2 to mm^4, of a closed loop.

    Notes
    -----
    By the divergence theorem with `z = x + i y` and `w = x dy - y dx` round the counter-clockwise loop: the integral
    over the area of 1, z and |z|^2 is that of `w / 2`, `z w / 3` and `|z|^2 w / 4`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    share, weights = (nodes + 1) / 2, weights / 2
    total = np.zeros(4)
    for s in loop:
        if s.centre is None:
            z, dz = s.start + share * (s.end - s.start), np.full(POINTS, s.end - s.start)
        else:
            spoke = (s.start - s.centre) * np.exp(1j * s.turn * share)
            z, dz = s.centre + spoke, 1j * s.turn * spoke
        w = weights * (np.conj(z) * dz).imag
        total += [w.sum() / 2, (z.real * w).sum() / 3, (z.imag * w).sum() / 3, (np.abs(z) ** 2 * w).sum() / 4]
    return total


@once
def body_moments(stage: Stage) -> Array:
    """Area moments (3 chains, 4 bodies, 4), mm^2 to mm^4, of pad, links and platform sector, in their places."""
    found = np.empty((len(CHAINS), len(BODIES), 4))
    for chain in CHAINS:
        for k, face in enumerate(draw_sector(stage, chain).values()):
            found[chain - 1, k] = _turned(area_moments(face.loop), (chain - 1) * CHAIN_TURN)
    return found


def _turned(moments: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    area, x, y, second = moments
    return np.array([area, c * x - s * y, s * x + c * y, second])


def hub_moments(stage: Stage) -> Array:
    """Area moments (4,), mm^2 to mm^4, of the hub's disc."""
    r = stage.platform.hub_radius
    return np.array([math.pi * r**2, 0.0, 0.0, math.pi * r**4 / 2])


def inertia_of(moments: Array, areal: Array | float) -> Inertia:
    """Of area moments (..., 4), mm^2 to mm^4, and mass per area (...), tonne/mm^2."""
    scaled = moments * np.asarray(areal)[..., None]
    return Inertia(scaled[..., 0], scaled[..., 1:3], scaled[..., 3])


def mass_per_area(stage: Stage) -> float:
    """Thickness times density, tonne/mm^2."""
    return stage.thickness * stage.material.density * DENSITY


def carried(stage: Stage, payload: Payload) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of hub and payload, which move as the pose."""
    return inertia_of(hub_moments(stage), mass_per_area(stage)).matrix + payload_matrix(payload)


def carried_out_of_plane(stage: Stage, payload: Payload) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of hub and payload for z and the rotations about x and y.

    Notes
    -----
    Of a disc of radius r and thickness b about a diameter `m (r^2 / 4 + b^2 / 12)`.
    """
    hub = inertia_of(hub_moments(stage), mass_per_area(stage))
    tilting = hub.second / 2 + hub.mass * stage.thickness**2 / 12 + payload.tilting
    return np.diag([hub.mass + payload.mass, tilting, tilting])


def payload_matrix(payload: Payload) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of a payload at the platform centre."""
    return np.diag([payload.mass, payload.mass, payload.inertia])


def drawn_inertia(stage: Stage) -> Inertia:
    """Of all that is drawn, pads and hub included, about the platform centre."""
    moments = body_moments(stage).sum(axis=(0, 1)) + hub_moments(stage)
    return inertia_of(moments, mass_per_area(stage))
