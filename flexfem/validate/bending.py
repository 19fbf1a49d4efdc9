"""Large displacements: the elastica by elliptic integrals, and the order of what the tangent stiffness leaves.

A cantilever is bent far beyond its length by a force that keeps its direction. Of the tangent: if it is the derivative
of the internal forces, what it leaves of them shrinks with the square of the step.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.plane_stress import Plate, slopes_of, stress_tensor
from flexfem.fem.problem import mapped
from flexfem.fem.tangent import State, Undeformed, green_lagrange, held_by, hub_at, model_of, tangent
from flexfem.validate.records import Finding, order

ELASTICA = "elastica"
BISSHOPP_DRUCKER = (
    "K. E. Bisshopp, D. C. Drucker, Large deflection of cantilever beams, Quart. Appl. Math. 3, 272-275 (1945), its"
    " elliptic integrals evaluated here"
)
PLATE = Plate(youngs_modulus=6.83e4, poissons_ratio=0.0, thickness=1.7)
LENGTH, HEIGHT = 400.0, 1.0  # mm; a Bernoulli beam to (h/L)^2
ELASTICA_CELLS = 200
STIFFNESS = PLATE.youngs_modulus * PLATE.thickness * HEIGHT**3 / 12  # EI, N mm^2
PRINTED = {1.0: (0.30172, 0.05643), 5.0: (0.71379, 0.38763), 10.0: (0.81061, 0.55500)}  # v/L and u/L, as tabulated
LOADS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
ELASTICA_ALLOWED = (
    2e-6  # of the length, per load: stretch and shear of a bar that is not infinitely slender, and its mesh
)


class Elastica(NamedTuple):
    """Displacement of the tip over the length, across the beam (v) and along it (u), under loads P L^2/(E I).

    load : (k,).   across, along : (k,), finite elements.   shapes : (k, m, 2), their middle lines over the length, from
    the clamped end at the origin.   exact_load : (n,), exact_across, exact_along : (n,), the elliptic integrals.
    unknowns : of the mesh.
    """

    load: Array
    across: Array
    along: Array
    shapes: Array
    exact_load: Array
    exact_across: Array
    exact_along: Array
    unknowns: int


def tip(load: float) -> tuple[float, float]:
    """v/L across and u/L along the beam under a dead tip load `P L^2/(E I)`, positive.

    Notes
    -----
    With the tip's slope phi, `m = (1 + sin phi)/2` and `sin^2 a = 1/(2 m)`: `root of load = K(m) - F(a, m)`,
    `v/L = 1 - 2 (E(m) - E(a, m))/root of load`, `u/L = 1 - root of (2 sin phi/load)`.
    """

    def parts(phi: float) -> tuple[float, float]:
        m = (1 + np.sin(phi)) / 2
        return m, np.arcsin(np.sqrt(1 / (2 * m)))

    def missing(phi: float) -> float:
        m, a = parts(phi)
        return float(ellipk(m) - ellipkinc(a, m) - np.sqrt(load))

    phi = brentq(missing, 1e-9, np.pi / 2 - 1e-9, xtol=1e-14)
    m, a = parts(phi)
    across = 1 - 2 * (ellipe(m) - ellipeinc(a, m)) / np.sqrt(load)
    return float(across), float(1 - np.sqrt(2 * np.sin(phi) / load))


def cantilever(cells: int = ELASTICA_CELLS) -> StageMesh:
    """A slender bar clamped on its left, its free end at the origin."""
    mesh = mapped(cells, 1, lambda u, v: np.stack([LENGTH * (u - 1), HEIGHT * (v - 0.5)], axis=-1))
    return mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})


@cache
def cantilever_bent() -> Elastica:
    """Bend the cantilever by `LOADS`, one after the other. Raises ComputationFailed."""
    mesh, load = cantilever(), np.array(LOADS)
    across = load * STIFFNESS / LENGTH**2
    found = equilibrium(mesh, PLATE, across[:, None] * np.array([0.0, 1.0, 0.0]))
    middle = np.flatnonzero(np.abs(mesh.nodes[:, 1]) < 1e-9 * HEIGHT)
    middle = middle[np.argsort(mesh.nodes[middle, 0])]
    shapes = (mesh.nodes[middle] + found.fields[:, middle]) / LENGTH + [1.0, 0.0]
    exact_load = np.linspace(0.01, load[-1], 200)
    exact = np.array([tip(each) for each in exact_load])
    moved = found.pose / LENGTH
    unknowns = 2 * len(mesh.nodes)
    return Elastica(load, moved[:, 1], -moved[:, 0], shapes, exact_load, exact[:, 0], exact[:, 1], unknowns)


def elastica() -> list[Finding]:
    """Both displacements of the tip at the tabulated loads, against the elliptic integrals."""
    found, rows = cantilever_bent(), []
    for load, printed in PRINTED.items():
        at = LOADS.index(load)
        for what, target, ours, shown in zip(
            ("across the beam, v/L", "along the beam, u/L"),
            tip(load),
            (found.across[at], found.along[at]),
            printed,
            strict=True,
        ):
            row = (f"tip {what}, at P L^2/EI = {load:g}", target, ours, ELASTICA_ALLOWED * load)
            note = f"tabulated as {shown:.5f}"
            rows.append(Finding(ELASTICA, BISSHOPP_DRUCKER, *row, unknowns=found.unknowns, note=note))
    return rows


TANGENT = "tangent stiffness"
TAYLOR = "Taylor's theorem: what the derivative leaves is of second order in the step"
BAR = Plate(youngs_modulus=6.83e4, poissons_ratio=0.29, thickness=1.7)
BAR_LENGTH, BAR_HEIGHT, OFFSET = 21.0, 1.3, (-1.9, 0.8)  # mm; the hub's centre lies off every axis of the bar
LOAD = np.array([31.0, -17.0, 740.0])  # N, N mm: bends the bar by about 0.4 rad
STEPS = 10.0 ** np.arange(0.0, -9.01, -0.5)
SIZE = 0.05  # mm and, over the length, rad: the largest step
CLEAN = (1e-5, 1e-1)  # steps with neither round-off nor terms of higher order
SMALL = (1e-9, 1e-5)  # steps at which a wrong tangent shows its first order
ORDER_ALLOWED = 0.004
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
    mesh = mapped(8, 2, lambda u, v: np.stack([BAR_LENGTH * (u - 1), BAR_HEIGHT * (v - 0.5)], axis=-1) + OFFSET)
    return mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})


def compatible(model: Undeformed, pose: Array, field: Array) -> State:
    """The state with its hub at the pose and the stress of its displacements."""
    field = field.copy()
    field[model.tied.hub] = hub_at(model.arms, pose).motion
    strains = [green_lagrange(slopes_of(batch, field[None])[0]) for batch in model.batches]
    return State(pose, field, [stress_tensor(model.plate, strain) for strain in strains])


def moved(model: Undeformed, state: State, change: Array) -> State:
    """The state after a change (2f + 3,) of the unknowns."""
    field = state.field.copy()
    field[model.tied.free] += change[:-3].reshape(-1, 2)
    return compatible(model, state.pose + change[-3:], field)


@cache
def remainders() -> Remainders:
    """Take steps from the bent bar, equilibrium under `LOAD`. Raises ComputationFailed."""
    mesh = bar()
    model, bent = model_of(mesh, BAR), equilibrium(mesh, BAR, LOAD)
    state = compatible(model, bent.pose[0], bent.fields[0])
    way = SIZE * np.random.default_rng(SEED).normal(size=2 * len(model.tied.free) + 3)
    way[-1] /= BAR_LENGTH
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


def tangent_order() -> list[Finding]:
    """The observed order with the tangent stiffness."""
    found = remainders()
    note = (
        f"without its geometric part {found.slope(found.material, SMALL):.2f} at small steps; the smallest remainder is"
        f" {found.ours.min():.0e} of the first-order change at the largest step"
    )
    row = ("order of the remainder", 2.0, found.slope(found.ours), ORDER_ALLOWED)
    return [Finding(TANGENT, TAYLOR, *row, unknowns=found.unknowns, note=note)]
