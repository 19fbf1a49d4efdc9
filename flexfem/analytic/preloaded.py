"""Mechanisms under preloads: tangent of beams under dead loads and residual stress.

A residual stress s of the plate is a strain by which all of it would shrink if the fixed bodies let
it: hinges are then shorter at rest, and rigid bodies smaller. A hinge between two fixed bodies
keeps the stress `s (1 - nu)`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.finite import FinitePlate, grown
from flexfem.analytic.network import Dynamics, NetworkModes, with_springs
from flexfem.analytic.plates import inertia, moving_bodies
from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout, Port
from flexfem.refused import ComputationFailed

ALONG_X = (1.0, 0.0, 0.0)
SMALLEST = 2.0**-10  # step towards the preload, as a share of it


class BeamTangent(NamedTuple):
    """Tangent of beams at an equilibrium, for n unit loads on ports.

    compliance : (n, n), mm and rad per N and N mm.
    turned : (n,), rotation of the body of each port, rad.
    """

    compliance: Array
    turned: Array


def preloaded(
    layout: Layout, load: Array, hinges: Array | None = None, ports: tuple[Port, ...] | None = None
) -> BeamTangent:
    """Return the tangent at the equilibrium under a dead load (k,) and the residual stress.

    hinges : compliances (h, 3, 3) at the centres of the hinges, by default those of their profiles.
    ports : those of the tangent, by default the ports of the layout.

    Raises ComputationFailed without an equilibrium near rest, or where it is not stable: the
    mechanism buckles."""
    own = layout.ports
    plate = FinitePlate(layout, hinges, own if ports is None else (*own, *ports))
    shrinkage = -layout.residual_stress * (1 - layout.poissons_ratio) / layout.youngs_modulus
    force = np.zeros(plate.ports)
    force[: len(own)] = load
    q = _equilibrium(plate, force, shrinkage)
    at = plate.state(q, force)
    if np.linalg.eigvalsh(at.K)[0] <= 0:
        raise ComputationFailed(
            f"the mechanism buckles before its preload is reached, {_shown(layout)}"
        )
    compliance = at.P.T @ np.linalg.solve(at.K, at.P)
    turned = np.zeros(plate.ports)
    turned[plate.loaded.port] = q[plate.loaded.column + 2]
    asked = slice(0 if ports is None else len(own), None)
    return BeamTangent(compliance[asked, asked], turned[asked])


def _shown(layout: Layout) -> str:
    return "expected a smaller load" + " or residual stress" * bool(layout.residual_stress)


def _equilibrium(
    plate: FinitePlate,
    force: Array,
    shrinkage: float,
) -> Array:
    """Return the unknowns (size,) under a load (k,) and a strain at rest, which grow together."""

    def under(q: Array, share: float) -> Array | None:
        plate.strain_at_rest = share * shrinkage
        return plate.equilibrium(q, share * force)

    q, done = grown(np.zeros(plate.size), under, SMALLEST)
    if done < 1.0:
        raise ComputationFailed(f"no equilibrium beyond {100 * done:.3g} % of the preload")
    return q


def modes(
    layout: Layout,
    load: Array,
    engaged: bool = False,
    hinges: Array | None = None,
) -> NetworkModes:
    """Return the natural modes at an equilibrium under preloads, as motions of the ports of
    `inertia`.

    `plates.modes` does so at rest.

    Notes
    -----
    The mass of a body turns with it: the directions of its motions are turned in the mass matrix.
    """
    ports, M = inertia(layout)
    drives = tuple(layout.ports[k] for k in layout.drive_ports if engaged)
    at = preloaded(layout, load, hinges, (*ports, *drives))
    C = with_springs(at.compliance, layout.drive.stiffness) if drives else at.compliance
    R = np.eye(len(M))
    for place, port in enumerate(ports):
        if port.parts[0][1] == ALONG_X:  # the motion along y of the same contact follows
            c = np.cos(at.turned[place])
            s = np.sin(at.turned[place])
            R[place : place + 2, place : place + 2] = [[c, -s], [s, c]]
    return Dynamics(C, R @ M @ R.T, 3 * len(moving_bodies(layout))).modes
