"""Is the tangent stiffness the derivative of the internal forces? What it leaves shrinks with the step's square."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.grids import mapped
from flexfem.fem.mesh import StageMesh
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.plane_stress import Plate, slopes_of, stress_tensor
from flexfem.fem.tangent import Model, State, green_lagrange, held_by, hub_at, model_of, tangent
from flexfem.validate.finding import Finding, finding, order

NAME = "tangent stiffness"
TAYLOR = "Taylor's theorem: what the derivative leaves is of second order in the step"
PLATE = Plate(youngs_modulus=6.83e4, poissons_ratio=0.29, thickness=1.7)
LENGTH, HEIGHT, OFFSET = 21.0, 1.3, (-1.9, 0.8)  # mm; the hub's centre lies off every axis of the bar
LOAD = np.array([31.0, -17.0, 740.0])  # N, N mm: bends the bar by about 0.4 rad
STEPS = 10.0 ** np.arange(0.0, -9.01, -0.5)
SIZE = 0.05  # mm and, over the length, rad: the largest step
CLEAN = (1e-5, 1e-1)  # steps with neither round-off nor terms of higher order
SMALL = (1e-9, 1e-5)  # steps at which a wrong tangent shows its first order
ALLOWED = 0.004
SEED = 29


class Remainders(NamedTuple):
    """Remainders of the forces after a step in a random direction, over the first-order change at the largest step.

    step : (k,).   none : (k,), without any tangent.   ours : (k,), less the tangent stiffness.   material : (k,), less
    the tangent without its geometric part, which is a mistake.   unknowns : of the mesh.
    """

    step: Array
    none: Array
    ours: Array
    material: Array
    unknowns: int

    def slope(self, remainders: Array, between: tuple[float, float] = CLEAN) -> float:
        """Observed order of remainders (k,) over the steps between two."""
        low, high = between
        taken = (self.step >= 0.99 * low) & (self.step <= 1.01 * high)
        return order(self.step[taken], remainders[taken])


def bar() -> StageMesh:
    """A short bar clamped on its left, whose hub turns about a point outside of it."""
    mesh = mapped(8, 2, lambda u, v: np.stack([LENGTH * (u - 1), HEIGHT * (v - 0.5)], axis=-1) + OFFSET)
    return mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})


def compatible(model: Model, pose: Array, field: Array) -> State:
    """The state with its hub at the pose and the stress of its displacements."""
    field = field.copy()
    field[model.tied.hub] = hub_at(model.arms, pose).motion
    strains = [green_lagrange(slopes_of(batch, field[None])[0]) for batch in model.batches]
    return State(pose, field, [stress_tensor(model.plate, strain) for strain in strains])


def moved(model: Model, state: State, change: Array) -> State:
    """The state after a change (2f + 3,) of the unknowns."""
    field = state.field.copy()
    field[model.tied.free] += change[:-3].reshape(-1, 2)
    return compatible(model, state.pose + change[-3:], field)


@cache
def remainders() -> Remainders:
    """Take steps from the bent bar, equilibrium under `LOAD`. Raises ComputationFailed."""
    mesh = bar()
    model, bent = model_of(mesh, PLATE), equilibrium(mesh, PLATE, LOAD)
    state = compatible(model, bent.pose[0], bent.fields[0])
    way = SIZE * np.random.default_rng(SEED).normal(size=2 * len(model.tied.free) + 3)
    way[-1] /= LENGTH
    unstressed = state._replace(stress=[np.zeros_like(stress) for stress in state.stress])
    slopes = [np.zeros(len(way)), *(_times(tangent(model, at), way) for at in (state, unstressed))]
    forces, changes = held_by(model, state).forces, []
    for step in STEPS:
        changes.append(held_by(model, moved(model, state, step * way)).forces - forces)
    scale = np.linalg.norm(slopes[1])
    none, ours, material = (
        np.linalg.norm(np.array(changes) - STEPS[:, None] * slope, axis=1) / scale for slope in slopes
    )
    return Remainders(STEPS, none, ours, material, len(way))


def _times(lower: sp.coo_array, way: Array) -> Array:
    half = lower.tocsc()
    return np.asarray(half @ way + sp.tril(half, -1).T @ way)


def run() -> list[Finding]:
    """The observed order with the tangent stiffness."""
    found = remainders()
    note = (
        f"without its geometric part {found.slope(found.material, SMALL):.2f} at small steps; the smallest remainder is"
        f" {found.ours.min():.0e} of the first-order change at the largest step"
    )
    order_found = found.slope(found.ours)
    return [
        finding(NAME, TAYLOR, "order of the remainder", 2.0, order_found, ALLOWED, unknowns=found.unknowns, note=note)
    ]
