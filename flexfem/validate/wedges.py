"""Wedges of 18 nodes: patch test and rigid motions, and a notch whose thickness has limits that are plane problems."""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import spsolve

from flexfem.arrays import Array
from flexfem.fem.factor import factorise
from flexfem.fem.layers import layered, mirrored
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.problem import mapped
from flexfem.fem.response import Tied, platform_response, tie_hub
from flexfem.fem.solid import DEGREE, Solid, solid
from flexfem.validate.exact import IRONS, ROUND_OFF
from flexfem.validate.holes import RADIUS, notch_mesh
from flexfem.validate.records import Finding

E, NU = 71.7e3, 0.33  # MPa; as of aluminium
SLOPES = np.array([[1.1e-3, -2.3e-3, 0.7e-3], [0.5e-3, 1.7e-3, -1.3e-3], [-1.9e-3, 0.3e-3, 2.9e-3]])  # d_b u_a
BOUNDS = np.array([-0.4, -0.1, 0.3, 1.1])  # mm, of uneven layers
NECK, ACROSS = 0.3 * RADIUS, 3  # mm; triangles across it
LIMIT = "exact: Hooke's law without stress, or without strain, out of the plane"
SAME = 1e-8  # relative: the same equations by another route, neither refined iteratively
FOIL, DEEP = 0.03, (100.0, 300.0)  # b/t
THIN, THICK = 5e-4, 1e-3  # of the mesh: w is continuous from triangle to triangle; of three layers
ZETTL = (
    "B. Zettl, W. Szyszkowski, W. J. Zhang, J. Mech. Des. 127, 782-787 (2005), abstract: plane stress is the lower and "
    "plane strain the upper limit of a right circular hinge's stiffness"
)
DEPTHS = (1.0, 10.0, 100.0)  # b/t


def curved_cells() -> StageMesh:
    """Six uneven cells with bent sides, mm."""

    def place(u: Array, v: Array) -> Array:
        u, v = u + 0.15 * u * (1 - u) * (1 + v), v - 0.1 * v * (1 - v) * np.cos(2 * u)
        return np.stack([3 * u + 0.4 * np.sin(2 * v), 2 * v + 0.3 * u**2], axis=-1)

    return mapped(3, 2, place)


def unsupported(mesh: StageMesh, bounds: Array) -> tuple[Solid, sp.csr_array]:
    """A solid that nothing holds, and its whole stiffness (3nm, 3nm), unknowns as of `Solid.loads`."""
    every = np.arange(len(mesh.nodes))
    free = solid(mesh, Plate(E, NU, 1.0), layered(bounds), Tied(every, every, every[:0], np.empty((0, 3))))
    lower = free.lower().tocsr()[:-3, :-3]
    return free, (lower + sp.tril(lower, -1).T).tocsr()


def patch() -> list[Finding]:
    """A linear field imposed on the whole surface must come out inside."""
    mesh = curved_cells()
    free, K = unsupported(mesh, BOUNDS)
    n, m = len(mesh.nodes), len(free.layers.heights)
    at = np.concatenate([np.repeat(mesh.nodes, m, axis=0), np.tile(free.layers.heights, n)[:, None]], axis=1)
    exact = free.loads((at @ SLOPES.T).reshape(1, n, m, 3))[:-3, 0]
    outside = np.zeros((1, n, m, 3))
    outside[:, np.unique(np.concatenate(list(mesh.edges.values())))] = outside[:, :, [0, -1]] = 1.0
    held = free.loads(outside)[:-3, 0] > 0
    found = spsolve(K[~held][:, ~held].tocsc(), -K[~held][:, held] @ exact[held])
    worst = float(np.max(np.abs(found - exact[~held])) / np.max(np.abs(exact)))
    what, note = "largest relative error of the displacement", "36 curved wedges of 18 nodes, uneven layers"
    return [Finding("wedge patch test", IRONS, what, 0.0, worst, ROUND_OFF, unknowns=len(found), note=note)]


def rigid_motions() -> list[Finding]:
    """The free stiffness matrix has six motions without energy, and no seventh."""
    values = np.linalg.eigvalsh(unsupported(curved_cells(), BOUNDS[1:])[1].toarray())
    return [
        Finding(
            "wedge rigid-body motions",
            "three translations and three rotations",
            "eigenvalues that are zero",
            6.0,
            float(np.sum(np.abs(values) < ROUND_OFF * values[-1])),
            0.0,
            unknowns=len(values),
            note=f"the seventh is {values[6] / values[-1]:.1g} of the largest",
        )
    ]


@cache
def notch() -> StageMesh:
    """A right circular hinge, rigid at the ends of its notch."""
    return notch_mesh(NECK, ACROSS)


def compliance(nu: float, depth: float, layers: int, faces_held: bool = False) -> tuple[Array, int]:
    """Compliance (3, 3) times thickness of the notch, `depth` of its necks thick, and the number of unknowns."""
    b = depth * NECK
    equations = solid(notch(), Plate(E, nu, b), mirrored(b, layers, NECK, faces_held), tie_hub(notch()))
    loads = np.pad(np.eye(3), [(equations.size - 3, 0), (0, 0)])
    return b * factorise(equations.lower())(loads)[-3:], equations.size


@cache
def plane(nu: float, strain: bool = False) -> Array:
    """The same (3, 3) in plane stress or plane strain."""
    plate = Plate(E / (1 - nu**2), nu / (1 - nu), 1.0) if strain else Plate(E, nu, 1.0)
    return platform_response(notch(), plate, DEGREE).compliance


def thickness_limits() -> list[Finding]:
    """A notch without Poisson's ratio, between held faces, as a foil, and ever thicker."""
    flat, walled = compliance(0.0, 5.0, 1)[0], compliance(NU, 5.0, 2, True)[0]
    foil, thick = compliance(NU, FOIL, 1)[0], [compliance(NU, depth, 3) for depth in DEEP]
    stress, strain = plane(NU), plane(NU, True)
    above = [each[2, 2] / strain[2, 2] - 1 for each, _ in thick]
    deepest = (DEEP[1] * above[1] - DEEP[0] * above[0]) / (DEEP[1] - DEEP[0])  # the faces' share falls as 1/b
    said = "rotational compliance over that of plane {}, less one"
    rows = [
        ("nu = 0: largest relative difference from plane stress", _off(flat, plane(0.0)), SAME, "b/t = 5"),
        ("held faces: largest relative difference from plane strain", _off(walled, strain), SAME, "b/t = 5"),
        (f"thin: {said.format('stress')}", foil[2, 2] / stress[2, 2] - 1, THIN, f"b/t = {FOIL:g}"),
        (f"thick, free faces: {said.format('strain')}, limit", deepest, THICK, _listed(above)),
    ]
    return [
        Finding("thickness limits", LIMIT, what, 0.0, float(ours), allowed, unknowns=thick[-1][1], note=note)
        for what, ours, allowed, note in rows
    ]


def _off(found: Array, exact: Array) -> float:
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    return float(np.max(np.abs(found - exact) / size))


def _listed(values: list[float]) -> str:
    return ", ".join(f"{100 * each:+.3f} % at b/t = {depth:g}" for each, depth in zip(values, DEEP, strict=True))


def zettl() -> list[Finding]:
    """Where the compliance of a hinge is between plane stress, 0, and plane strain, 1, whatever the load."""
    soft, hard, rows = plane(NU), plane(NU, True), []
    for depth in DEPTHS:
        found, unknowns = compliance(NU, depth, 2)
        low, *_, high = eigh(soft - found, soft - hard, eigvals_only=True)
        rotation = [100 * (1 - found[2, 2] / soft[2, 2]), 100 * (found[2, 2] / hard[2, 2] - 1)]
        note = f"about the neck plane stress is {rotation[0]:.1f} % less stiff, plane strain {rotation[1]:.1f} % more"
        rows += [
            Finding(
                "Zettl's bounds",
                ZETTL,
                f"b/t = {depth:g}: {which} position of any load between plane stress, 0, and plane strain, 1",
                0.5,
                float(ours),
                0.5,
                unknowns=unknowns,
                note=f"{note}; the abstract says up to about 12 %, without Poisson's ratio (ours {NU:g})",
            )
            for which, ours in (("least", low), ("largest", high))
        ]
    return rows
