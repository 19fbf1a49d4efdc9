"""Mechanisms at an equilibrium under preloads of actuators, residual stress and a stated load:
tangents by both models.

Plane finite elements follow the nonlinear equilibrium. In three dimensions the stiffness changes by
the linear stress in the shape at rest; this includes motion out of the plane."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.factor import Solve
from flexfem.fem.modes import Modes, modes_of_tangent
from flexfem.fem.nonlinear import tangent_at
from flexfem.fem.ports import PlateModel
from flexfem.fem.prestress import lifted, prestress_by, stiffened
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates
from flexfem.questions.bands import SAFETY
from flexfem.questions.loads import StatedLoad
from flexfem.questions.plates import LIFTED_LAYERS, LIFTED_RESOLUTION, lifted_mesh_error

IN_THREE_DIMENSIONS = (
    "under the preload, the stiffness in three dimensions and out of the plane changes by the "
    "linear stress in the shape at rest; plane finite elements and beams follow the displacements"
)


def preload_of(mechanism: Mechanism, stated: StatedLoad | None) -> Array | None:
    """Return the dead load (k,) on the ports by the preloads of actuators and a stated load.

    None for a mechanism at rest without load and without residual stress.
    """
    load = mechanism.layout.preload
    if stated is not None:
        load = load + stated.on_ports
    return load if np.any(load) or mechanism.layout.residual_stress else None


def described(mechanism: Mechanism, load: Array) -> str:
    """Return what a mechanism is preloaded by, for the settings of a result."""
    layout = mechanism.layout
    named = zip(layout.ports, load, strict=True)
    parts = [
        f"{force:.4g} {'N mm' if port.rotation else 'N'} on {port.label}"
        for port, force in named
        if force
    ]
    if layout.residual_stress:
        parts.append(f"residual stress {layout.residual_stress:g} MPa")
    return ", ".join(parts)


def compliance_under(
    mechanism: Mechanism,
    load: Array,
    resolution: int,
    layers: int,
) -> Array:
    """Return the tangent compliance (k, k) of the ports by finite elements under a load (k,)."""
    model = plates.factorised(mechanism, resolution, layers)
    if not layers:
        return tangent_at(model, load).compliance
    solve = stiffened(prestress_by(model, load, residual=mechanism.layout.residual_stress))
    return np.asarray(model.ports.T @ solve(model.ports))


def modes_under(
    mechanism: Mechanism,
    load: Array,
    resolution: int,
    layers: int,
    lifting: bool,
    count: int,
    engaged: bool,
) -> tuple[Modes, Array]:
    """Return modes by finite elements under a load (k,), and the unit loads (size, k) on their
    unknowns.

    lifting : out of the plane, with layers.   engaged : with the stiffness of the actuators.
    """
    model = plates.factorised(mechanism, resolution, layers, lifting)
    springs = mechanism.layout.drive.stiffness * (engaged and not lifting)
    stacks = model.ports[:, model.ports.shape[1] - len(springs) :] if np.any(springs) else None
    solve = _solver(mechanism, model, load, (resolution, layers), lifting)
    return modes_of_tangent(model.mass, solve, count, stacks, springs), model.ports


def _solver(
    mechanism: Mechanism, model: PlateModel, load: Array, size: tuple[int, int], lifting: bool
) -> Solve:
    """Return the inverse of the tangent stiffness of a model under a load (k,)."""
    if not size[1]:
        return tangent_at(model, load).solve
    in_plane = plates.factorised(mechanism, *size) if lifting else model
    change = prestress_by(in_plane, load, residual=mechanism.layout.residual_stress)
    return stiffened(lifted(change, model, load) if lifting else change)


def first_out_of_plane(mechanism: Mechanism, load: Array) -> tuple[float, float]:
    """Return the first natural frequency out of the plane, rad/s, under a load (k,), and its band."""
    few, many = (_lowest_out_of_plane(mechanism, load, layers) for layers in LIFTED_LAYERS)
    return many, SAFETY * abs(many - few) + lifted_mesh_error(mechanism.layout) * many


def _lowest_out_of_plane(
    mechanism: Mechanism,
    load: Array,
    layers: int,
) -> float:
    """Return the first natural frequency out of the plane with a number of layers, rad/s."""
    modes, _ = modes_under(mechanism, load, LIFTED_RESOLUTION, layers, True, 1, False)
    return float(modes.frequencies[0])
