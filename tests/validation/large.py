"""Large displacements: the elastica by elliptic integrals, and the order of what the tangent
stiffness leaves.

A cantilever is bent far beyond its length by a force that keeps its direction. Of the tangent: if
it is the derivative of the internal forces, what it leaves of them shrinks with the square of the
step."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from flexfem.arrays import Array
from flexfem.fem.elements import Plate
from flexfem.fem.nonlinear import LargeStructure, equilibrium
from flexfem.fem.structure import structure

from .problem import Finding, cantilever, order, problem

PLATE = Plate(youngs_modulus=6.83e4, poissons_ratio=0.0, thickness=1.7)
LENGTH = 400.0
HEIGHT = 1.0  # mm; a Bernoulli beam to (h/L)^2
STIFFNESS = PLATE.youngs_modulus * PLATE.thickness * HEIGHT**3 / 12  # EI, N mm^2
PRINTED = {
    1.0: (0.30172, 0.05643),
    5.0: (0.71379, 0.38763),
    10.0: (0.81061, 0.55500),
}  # v/L and u/L, as tabulated
LOADS = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])  # P L^2 / (E I)
# of the length, per load: stretch and shear of a bar that is not infinitely slender, and its mesh
ALLOWED = 2e-6


def tip(load: float) -> tuple[float, float]:
    """v/L across and u/L along the beam under a dead tip load `P L^2/(E I)`, positive.

    Notes
    -----
    With the tip's slope phi, `m = (1 + sin phi)/2` and `sin^2 a = 1/(2 m)`: `root of load = K(m) -
    F(a, m)`, `v/L = 1 - 2 (E(m) - E(a, m))/root of load`, `u/L = 1 - root of (2 sin phi/load)`."""

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


@cache
def bent() -> tuple[Array, Array, int]:
    """Displacement of the tip (loads, 2) over the length, across and along; middle lines (loads, m,
    2); unknowns.
    """
    mesh = cantilever(200, 1, LENGTH, HEIGHT)
    force = LOADS[:, None] * STIFFNESS / LENGTH**2 * np.array([0.0, 1.0, 0.0])
    found = equilibrium(mesh, PLATE, force)
    middle = np.flatnonzero(np.abs(mesh.nodes[:, 1]) < 1e-9 * HEIGHT)
    middle = middle[np.argsort(mesh.nodes[middle, 0])]
    lines = (mesh.nodes[middle] + found.fields[:, middle]) / LENGTH + [1.0, 0.0]
    return found.pose[:, [1, 0]] * [1, -1] / LENGTH, lines, 2 * len(mesh.nodes)


@problem(
    "Elastica",
    "large displacements and rotations",
    "K. E. Bisshopp, D. C. Drucker, Large deflection of cantilever beams, Quart. Appl. Math. 3, "
    "272-275 (1945), its elliptic integrals evaluated here",
)
def elastica() -> list[Finding]:
    """Both displacements of the tip at the tabulated loads, against the elliptic integrals."""
    moved, _, unknowns = bent()
    rows = []
    for load, printed in PRINTED.items():
        found = moved[list(LOADS).index(load)]
        for what, *values in zip(
            ("across the beam, v/L", "along the beam, u/L"), tip(load), found, printed, strict=True
        ):
            quantity = f"tip {what}, P L^2/EI = {load:g}"
            note = f"printed as {values[2]:.5f}"
            rows.append(
                Finding(quantity, *values[:2], ALLOWED * load, unknowns=unknowns, note=note)
            )
    return rows


def draw_elastica(path: Path) -> None:
    """Draw the load over both displacements of the tip, and shapes of the beam."""
    from matplotlib.figure import Figure

    moved, lines, unknowns = bent()
    figure = Figure((8.3, 3.8), layout="constrained")
    figure.suptitle(
        f"Elastica: elliptic integrals (curves) and finite elements (marks, {unknowns} unknowns)"
    )
    curves, shapes = figure.subplots(1, 2)
    loads = np.linspace(0.01, LOADS[-1], 200)
    exact = np.array([tip(load) for load in loads])
    for k, name in enumerate(("across the beam, v/L", "along the beam, u/L")):
        curves.plot(exact[:, k], loads, color=f"C{k}")
        curves.plot(moved[:, k], LOADS, "os"[k], color=f"C{k}", markerfacecolor="white", label=name)
    curves.set(xlabel="displacement of the tip / L", ylabel="P L² / (E I)")
    curves.legend()
    for load in (1.0, 3.0, 5.0, 10.0):
        line = lines[list(LOADS).index(load)]
        shapes.plot(*line.T, color="black")
        shapes.annotate(f"{load:g}", line[-1], (5, 3), textcoords="offset points")
    shapes.plot(1 - exact[:, 1], exact[:, 0], "--", color="C1", label="exact path of the tip")
    shapes.set(xlabel="x / L", ylabel="y / L", aspect="equal")
    shapes.legend()
    figure.savefig(path, dpi=120)


BAR = Plate(youngs_modulus=6.83e4, poissons_ratio=0.29, thickness=1.7)
BAR_LENGTH = 21.0
BAR_HEIGHT = 1.3
OFFSET = (-1.9, 0.8)  # mm; the hub's centre lies off every axis of the bar
LOAD = np.array([31.0, -17.0, 740.0])  # N, N mm: bends the bar by about 0.4 rad
STEPS = 10.0 ** np.arange(0.0, -9.01, -0.5)
SIZE = 0.05  # mm and, over the length, rad: the largest step
CLEAN = (1e-5, 1e-1)  # steps with neither round-off nor terms of higher order
SMALL = (1e-9, 1e-5)  # steps at which a wrong tangent shows its first order


class Remainders(NamedTuple):
    """Remainders (k,) of the forces after `STEPS` in a random direction, over the first-order
    change at the largest.

    ours : less the tangent stiffness.   material : less the tangent without its geometric part,
    which is a mistake."""

    ours: Array
    material: Array
    unknowns: int


def observed(remainders: Array, between: tuple[float, float] = CLEAN) -> float:
    """Observed order of remainders (k,) over the steps between two."""
    taken = (0.99 * between[0] <= STEPS) & (1.01 * between[1] >= STEPS)
    return order(STEPS[taken], remainders[taken])


@cache
def remainders() -> Remainders:
    """Take steps from the bent bar, equilibrium under `LOAD`. Raises ComputationFailed."""
    mesh = cantilever(8, 2, BAR_LENGTH, BAR_HEIGHT, OFFSET)
    of = structure(mesh, BAR)
    rest = equilibrium(mesh, BAR, LOAD)
    model = LargeStructure(of)
    state = model.at(rest.pose[0], rest.fields[0])
    way = SIZE * np.random.default_rng(29).normal(size=of.size)
    way[-1] /= BAR_LENGTH
    unstressed = state._replace(stress=[np.zeros_like(stress) for stress in state.stress])
    slopes = []
    for at in (state, unstressed):
        half = model.tangent(at)
        slopes.append(half @ way + sp.tril(half, -1).T @ way)
    forces = model.internal(state).forces
    changes = []
    for step in STEPS:
        field = state.field.copy()
        field[of.free] += step * way[:-3].reshape(-1, 2)
        changes.append(
            model.internal(model.at(state.pose + step * way[-3:], field)).forces - forces
        )
    left = [np.linalg.norm(np.array(changes) - STEPS[:, None] * slope, axis=1) for slope in slopes]
    scale = np.linalg.norm(slopes[0])
    return Remainders(left[0] / scale, left[1] / scale, len(way))


@problem(
    "Tangent stiffness",
    "that the tangent is the derivative of the internal forces",
    "Taylor's theorem: what the derivative leaves is of second order in the step",
)
def tangent_stiffness() -> list[Finding]:
    """The observed order with the tangent stiffness."""
    found = remainders()
    note = (
        f"without its geometric part {observed(found.material, SMALL):.2f} at small steps; the "
        f"smallest remainder is {found.ours.min():.0e} of the first-order change at the largest "
        "step"
    )
    return [
        Finding(
            "order of the remainder",
            2.0,
            observed(found.ours),
            0.004,
            unknowns=found.unknowns,
            note=note,
        )
    ]
