"""A cantilever bent far beyond its length by a force that keeps its direction: the elastica, by elliptic integrals."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from flexfem.arrays import Array
from flexfem.fem.grids import mapped
from flexfem.fem.mesh import StageMesh
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.plane_stress import Plate
from flexfem.validate.finding import Finding, finding

NAME = "elastica"
BISSHOPP_DRUCKER = (
    "K. E. Bisshopp, D. C. Drucker, Large deflection of cantilever beams, Quart. Appl. Math. 3, 272-275 (1945), its"
    " elliptic integrals evaluated here"
)
PLATE = Plate(youngs_modulus=6.83e4, poissons_ratio=0.0, thickness=1.7)
LENGTH, HEIGHT = 400.0, 1.0  # mm; a Bernoulli beam to (h/L)^2
CELLS = 200
STIFFNESS = PLATE.youngs_modulus * PLATE.thickness * HEIGHT**3 / 12  # EI, N mm^2
PRINTED = {1.0: (0.30172, 0.05643), 5.0: (0.71379, 0.38763), 10.0: (0.81061, 0.55500)}  # v/L and u/L, as tabulated
LOADS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
ALLOWED = 2e-6  # of the length, per load: stretch and shear of a bar that is not infinitely slender, and its mesh


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


def cantilever(cells: int = CELLS) -> StageMesh:
    """A slender bar clamped on its left, its free end at the origin."""
    mesh = mapped(cells, 1, lambda u, v: np.stack([LENGTH * (u - 1), HEIGHT * (v - 0.5)], axis=-1))
    return mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})


@cache
def bending() -> Elastica:
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


def run() -> list[Finding]:
    """Both displacements of the tip at the tabulated loads, against the elliptic integrals."""
    found, rows = bending(), []
    for load, printed in PRINTED.items():
        at = LOADS.index(load)
        for what, target, ours, shown in zip(
            ("across the beam, v/L", "along the beam, u/L"),
            tip(load),
            (found.across[at], found.along[at]),
            printed,
            strict=True,
        ):
            rows.append(
                finding(
                    NAME,
                    BISSHOPP_DRUCKER,
                    f"tip {what}, at P L^2/EI = {load:g}",
                    target,
                    ours,
                    ALLOWED * load,
                    unknowns=found.unknowns,
                    note=f"tabulated as {shown:.5f}",
                )
            )
    return rows
