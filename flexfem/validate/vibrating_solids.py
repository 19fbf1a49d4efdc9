"""Natural frequencies in three dimensions with known answers: beams that bend in both planes, a plate, a free body.

A closed form of every half: bending of a cantilever about its two axes, and an annular plate, clamped around, whose
middle is a rigid disc that rises and tilts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import iv, ivp, jv, jvp, kv, kvp, yv, yvp

from flexfem.arrays import Array
from flexfem.fem.layers import Layers, mirrored
from flexfem.fem.mesh import outwards
from flexfem.fem.plane_stress import Plate
from flexfem.fem.problem import mapped
from flexfem.fem.response import Tied
from flexfem.fem.sectors import Sector
from flexfem.fem.solid import solid
from flexfem.fem.solid_modes import SolidModes, solid_mass, solid_modes, whole_modes
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.validate.records import Finding
from flexfem.validate.vibrating import BEAM_ROOTS, RODS
from flexfem.validate.wedges import curved_cells

E, DENSITY = 70e3, 2700e-12  # MPa, tonne/mm^3
LENGTH, HEIGHT, THICKNESS = 300.0, 4.0, 2.5  # mm, of the cantilever
SLENDER = 8e-4  # shear and rotary inertia of the second mode across the height: 22 (r / L)^2 (1 + E / (kappa G)) / 2
RADIUS, HUB, SHEET = 60.0, 12.0, 1.5  # mm, of the annular plate
DISC = (40e-6, 4e-3)  # tonne, tonne mm^2: of the disc in its middle, and its moment of inertia about a diameter
KIRCHHOFF = 5e-3  # thin-plate theory, and the mesh: +0.3 %, 0.1 % with twice as many triangles along each side
PLATE = "exact: A. W. Leissa, Vibration of Plates, NASA SP-160 (1969), section 2: Bessel functions; rigid disc added"


def bent_beam() -> list[Finding]:
    """Two frequencies of bending in the plane, in the symmetric half, and two out of it, in the antisymmetric one."""
    mesh = mapped(60, 1, lambda u, v: np.stack([LENGTH * (u - 1), HEIGHT * (v - 0.5)], axis=-1))
    mesh = mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})
    layers, rows = mirrored(THICKNESS, 1, THICKNESS), []
    for which, half, depth in (("in", layers, HEIGHT), ("out of", layers.antisymmetric, THICKNESS)):
        found = whole_modes(mesh, Plate(E, 0.0, THICKNESS), half, DENSITY, np.zeros((3, 3)), 2)
        speed = math.sqrt(E / DENSITY / 12) * depth / LENGTH**2
        for k, root in enumerate(BEAM_ROOTS):
            target, ours = (each / (2 * math.pi) for each in (root**2 * speed, float(found.frequencies[k])))
            what = f"cantilever, frequency {k + 1} of bending {which} the plane (Hz)"
            rows.append(Finding("bent beam", RODS, what, target, ours, SLENDER * target, unknowns=found.unknowns))
    return rows


def annular_plate() -> list[Finding]:
    """The disc rises, and tilts in any direction: in one sector of three, and in the whole."""
    rise, tilt = (rigid_middle(nodal) / (2 * math.pi) for nodal in (0, 1))
    rows = []
    for which, found in (("one sector of three", annulus(1)), ("the whole", annulus(3))):
        hertz = found.frequencies / (2 * math.pi)
        for what, target, ours in (("rises", rise, hertz[0]), ("tilts", tilt, hertz[1]), ("tilts", tilt, hertz[2])):
            quantity = f"frequency at which the disc {what} (Hz), {which}"
            allowed = KIRCHHOFF * target
            rows.append(
                Finding("annular plate", PLATE, quantity, target, float(ours), allowed, unknowns=found.unknowns)
            )
    return rows


def annulus(sectors: int) -> SolidModes:
    """Three modes out of the plane of an annular plate with a rigid disc, of one sector turned, or of three."""
    carried, layers = np.diag([DISC[0], DISC[1], DISC[1]]), mirrored(SHEET, 1, SHEET).antisymmetric
    return solid_modes((third(14, 10),) * sectors, Plate(E, 0.3, SHEET), layers, DENSITY, carried, 3)


def third(columns: int, rows: int, twist: float = 0.0) -> Sector:
    """A third of an annulus, clamped around, its middle a hub; its cuts are twisted, rad, from inside to outside."""

    def place(u: Array, v: Array) -> Array:
        r, angle = HUB + (RADIUS - HUB) * u, CHAIN_TURN * v + twist * u
        return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)

    mesh = mapped(columns, rows, place)
    names = {"left": "hub", "right": "ground", "bottom": "cut behind", "top": "cut ahead"}
    mesh = mesh._replace(edges={names[side]: edge for side, edge in mesh.edges.items()})
    ends = np.concatenate([mesh.edges["hub"], mesh.edges["ground"]])
    behind, ahead = (outwards(mesh.nodes, mesh.edges[f"cut {side}"]) for side in ("behind", "ahead"))
    return Sector(mesh, behind[~np.isin(behind, ends)], ahead[~np.isin(ahead, ends)])


def rigid_middle(nodal: int, poissons_ratio: float = 0.3) -> float:
    """Lowest frequency, rad/s, of the plate with the disc, of 0 or 1 nodal diameters, by thin-plate theory.

    Notes
    -----
    `w = A J_n(k r) + B Y_n(k r) + C I_n(k r) + F K_n(k r)`, `k^4 = rho b omega^2 / D`; w and its slope vanish outside.
    On the disc of radius a, mass m, moment of inertia I about a diameter: `w' = 0`, `m omega^2 w = 2 pi a D (L w)'`; or
    `w' = w / a`, `I omega^2 w / a = pi a D (a (L w)' - w'')`, with L the Laplacian: -k^2 on J and Y, k^2 on I and K.
    """
    D = E * SHEET**3 / (12 * (1 - poissons_ratio**2))

    def determinant(k: float) -> float:
        square = k**4 * D / (DENSITY * SHEET)

        def row(what: Callable[[Array, Array, Array, Array], Array], r: float) -> Array:
            w = np.array([f(nodal, k * r) for f in (jv, yv, iv, kv)])
            slope = k * np.array([f(nodal, k * r) for f in (jvp, yvp, ivp, kvp)])
            curve = k**2 * np.array([f(nodal, k * r, 2) for f in (jvp, yvp, ivp, kvp)])
            return what(w, slope, curve, k**2 * np.array([-1.0, -1.0, 1.0, 1.0]) * slope)

        a, (mass, inertia) = HUB, DISC
        inner = (
            [
                row(lambda w, s, c, q: s, a),
                row(lambda w, s, c, q: mass * square * w - 2 * math.pi * a * D * q, a),
            ]
            if nodal == 0
            else [
                row(lambda w, s, c, q: s - w / a, a),
                row(lambda w, s, c, q: inertia * square * w / a - math.pi * a * D * (a * q - c), a),
            ]
        )
        matrix = np.array([*inner, row(lambda w, s, c, q: w, RADIUS), row(lambda w, s, c, q: s, RADIUS)])
        matrix /= np.abs(matrix).max(axis=1, keepdims=True)
        return float(np.linalg.det(matrix / np.abs(matrix).max(axis=0)))

    steps = np.linspace(0.5, 9.0, 100) / RADIUS
    low, high = next((a, b) for a, b in pairwise(steps) if determinant(a) * determinant(b) < 0)
    return float(brentq(determinant, low, high)) ** 2 * math.sqrt(D / (DENSITY * SHEET))


def free_halves() -> list[Finding]:
    """Squared frequencies of a body that nothing holds: three that vanish in every half."""
    layers, rows = mirrored(1.1, 2, 0.4), []
    for which, half in (("in", layers._replace(held=(0,))), ("out of", layers.antisymmetric)):
        squares = free_squares(half)
        what = f"modes {which} the plane without frequency, of six"
        zero = float(np.sum(np.abs(squares) < 1e-9 * squares[6]))
        note = f"the fourth is {squares[3] / squares[6]:.2g} of the seventh"
        source = "exact: nothing resists a rigid-body motion"
        rows.append(Finding("free solid", source, what, 3.0, zero, 0.0, unknowns=len(squares), note=note))
    return rows


def free_squares(layers: Layers) -> Array:
    """All squared frequencies, (rad/s)^2, of a small body without supports, rising."""
    mesh = curved_cells()
    every = np.arange(len(mesh.nodes))
    equations = solid(mesh, Plate(E, 0.3, 1.0), layers, Tied(every, every, every[:0], np.empty((0, 3))))
    half = equations.lower().toarray()[:-3, :-3]
    mass = solid_mass(mesh, layers, DENSITY, np.zeros((3, 3)))
    M = mass.loads(equations, np.eye(equations.size))[:-3, :-3]
    return np.asarray(eigh(half + np.tril(half, -1).T, M, eigvals_only=True))
