"""Three bridge amplifiers of Ling (2019) by beams, by the analytic network, and by finite elements.

    python benchmarks/ling_bridge.py [--kinds rhombic parallel aligned] [--resolution 6] [--layers
    3] [--sizes 2.0 1.5]

M. Ling, "A general two-port dynamic stiffness model and static/dynamic comparison for three
bridge-type flexure displacement amplifiers", Mechanical Systems and Signal Processing 119 (2019).
The dimensions and the closed forms (19), (21) and (24) are those of github.com/dankirsdot/flexure:
the paper itself was not at hand. `beams` is the model of the paper, Euler-Bernoulli beams with
distributed mass, here as finite elements of beams. With NGSolve installed, the STEP file that
flexfem writes is meshed by Netgen and solved by its quadratic tetrahedra of two sizes, mm.

Results: motion of the output per motion of one input, force per motion of one input, first
frequency in the plane. The inputs are free bodies, no stack is between them. The drawings add what
beams leave open: input blocks and output are 0.5 mm higher on both sides than the lines of the
beams, and corners are sharp."""

from __future__ import annotations

import argparse
import importlib.util
import math
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

import flexfem
from flexfem import Mechanism
from flexfem.analytic import plates as analytic
from flexfem.fem.ports import plate_modes
from flexfem.questions.plates import Responses, elements, factorised, network, parts_of

E = 71e3
NU = 0.33
DENSITY = 2.77e-9
DEPTH = 10.0  # MPa, -, tonne/mm^3, mm; Poisson's ratio is assumed
BLOCK = (5.0, 10.0)
OUTPUT = (4.0, 6.0)
EDGE = 0.5  # mm, width and height; height added at both ends of a block
ANGLE = math.radians(10)


class Limb(NamedTuple):
    """A flexure, a link and a flexure from an input to the output: vectors, mm, and heights, mm."""

    flexure: tuple[float, float]
    link: tuple[float, float]
    thin: float
    thick: float

    @property
    def span(self) -> np.ndarray:
        """From the first to the last point."""
        return 2 * np.array(self.flexure) + self.link


def _along(length: float, angle: float = ANGLE) -> tuple[float, float]:
    return length * math.cos(angle), length * math.sin(angle)


LIMBS = {
    "rhombic": Limb(_along(3), _along(9), 1.0, 1.0),
    "parallel": Limb((3, 0), (9, 9 * math.tan(ANGLE)), 0.5, 4.0),
    "aligned": Limb(_along(3), _along(9), 0.5, 4.0),
}


def closed_form(kind: str, limb: Limb) -> float:
    """Amplification by (19) and (21) for the rhombic, by (24) for the parallel amplifier."""
    if kind == "rhombic":
        L = 15.0
        slope = math.tan(ANGLE)
        return 2 * slope / (limb.thin**2 / L**2 + slope**2)  # 12 K_h / (K_l L^2) = h^2 / L^2
    if kind == "parallel":
        L = 12.0
        H = limb.link[1]
        soft = (
            limb.thin**2 / 3 * (1 + limb.thin * 9 / (limb.thick * L))
        )  # 4 K_h / K_l, and the stiffness of the link
        return 2 * L * H / (soft + H**2)
    return math.nan


def beams(limb: Limb, parts: int = 8) -> tuple[float, float, float]:
    """Amplification, N/mm and Hz of the paper's model: four limbs between two inputs, output,
    ground.
    """
    steps = [
        ((BLOCK[0] / 2, BLOCK[1] / 2), BLOCK[0]),
        (limb.flexure, limb.thin),
        (limb.link, limb.thick),
    ]
    steps.append((limb.flexure, limb.thin))
    per_limb = len(steps) * parts - 1
    free = 3  # nodes inside a limb; inputs 0, 1, output 2, ground last
    count = free + 4 * per_limb + 1
    K, M = np.zeros((2, 3 * count, 3 * count))
    for number, (x, y) in enumerate(((1, 1), (-1, 1), (1, -1), (-1, -1))):
        inner = list(range(free + number * per_limb, free + (number + 1) * per_limb))
        chain = [(1 - x) // 2, *inner, 2 if y > 0 else count - 1]
        for k, (start, end) in enumerate(pairwise(chain)):
            (dx, dy), height = steps[k // parts]
            at = np.r_[3 * start : 3 * start + 3, 3 * end : 3 * end + 3]
            for whole, part in zip(
                (K, M), _beam(x * dx / parts, y * dy / parts, height), strict=True
            ):
                whole[np.ix_(at, at)] += part
    mass = DENSITY * DEPTH * OUTPUT[0] * OUTPUT[1]
    M[6:9, 6:9] += np.diag([mass, mass, mass * (OUTPUT[0] ** 2 + OUTPUT[1] ** 2) / 12])
    K = K[:-3, :-3]
    M = M[:-3, :-3]
    load = np.zeros(len(K))
    load[[0, 3]] = -1.0, 1.0  # input 0 is on the left: both are pushed outwards
    motion = np.linalg.solve(K, load)
    lowest = eigh(K, M, eigvals_only=True, subset_by_index=(0, 0))[0]
    return -motion[7] / motion[3], 1 / motion[3], math.sqrt(lowest) / (2 * math.pi)


def _beam(dx: float, dy: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (6, 6) of an Euler-Bernoulli beam."""
    L = math.hypot(dx, dy)
    area = DEPTH * height
    axial = E * area / L
    bend = E * area * height**2 / 12 / L**3
    K = np.zeros((6, 6))
    M = np.zeros((6, 6))
    K[np.ix_([0, 3], [0, 3])] = axial * np.array([[1, -1], [-1, 1]])
    M[np.ix_([0, 3], [0, 3])] = [[140, 70], [70, 140]]
    b = [1, 2, 4, 5]
    scale = np.array([1, L, 1, L])
    K[np.ix_(b, b)] = bend * np.array(
        [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
    )
    M[np.ix_(b, b)] = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
    for each in (K, M):
        each[np.ix_(b, b)] *= np.outer(scale, scale)
    turn = np.kron(np.eye(2), [[dx / L, dy / L, 0], [-dy / L, dx / L, 0], [0, 0, 1]])
    return turn.T @ K @ turn, turn.T @ (DENSITY * area * L / 420 * M) @ turn


def places(limb: Limb) -> tuple[np.ndarray, float]:
    """Centre of the left input and y of the output, mm; the output is at x = 0."""
    corner = np.array([-OUTPUT[0] / 2 - limb.span[0], BLOCK[1] / 2])
    return np.array([corner[0] - BLOCK[0] / 2, 0.0]), corner[1] + limb.span[1]


def amplifier(kind: str) -> Mechanism:
    """Return the mechanism; its ground is a block as the output is."""
    limb = LIMBS[kind]
    (left, _), top = places(limb)
    cut = (
        2 * limb.thin
    )  # the flexures cut the blocks at right angles, so blocks are longer by `more`
    more = cut / 2 * abs(limb.flexure[1] / limb.flexure[0])

    def block(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
        return [
            (x + i * width / 2, y + j * height / 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]

    wide = BLOCK[0] + 2 * more, BLOCK[1] + 2 * EDGE
    bodies: list[dict[str, Any]] = [
        {"name": "output", "outline": block(0, top, OUTPUT[0] + 2 * more, OUTPUT[1])},
        {
            "name": "ground",
            "outline": block(0, -top, OUTPUT[0] + 2 * more, OUTPUT[1]),
            "clamped_edges": (1,),
        },
        *({"name": f"input {x}", "outline": block(-x * left, 0, *wide)} for x in (-1, 1)),
    ]
    hinges = list[dict[str, Any]]()
    for x in (-1, 1):
        for y in (-1, 1):
            flip = np.array([-x, y])
            name = f"limb {x} {y}"
            start = np.array([left + BLOCK[0] / 2, BLOCK[1] / 2])
            ends = np.cumsum([start, limb.flexure, limb.link, limb.flexure], axis=0) * flip
            longer = (ends[2] - ends[1]) * abs(
                np.cross(*np.pad([limb.flexure, limb.link], [(0, 0), (0, 1)]))[2]
            )
            longer *= limb.thick / 2 / math.hypot(*limb.link) ** 2 / math.hypot(*limb.flexure)
            path = [tuple(ends[1] - longer), tuple(ends[2] + longer)]
            bodies.append({"name": name, "path": path, "width": limb.thick})
            for k, between in (
                (0, (f"input {x}", name)),
                (2, (name, "output" if y > 0 else "ground")),
            ):
                a = ends[k]
                b = ends[k + 1]
                hinges.append(
                    {
                        "name": f"flexure {len(hinges) + 1}",
                        "between": between,
                        "at": tuple((a + b) / 2),
                        "shape": "leaf",
                        "direction": math.atan2(*(b - a)[::-1]),
                        "length": float(np.hypot(*(b - a))),
                        "neck": limb.thin,
                        "cut": max(cut, 1.5 * limb.thick),
                    }
                )
    metal = {
        "name": "aluminium",
        "youngs_modulus": E,
        "poissons_ratio": NU,
        "density": DENSITY * 1e12,
    }
    drive = {
        "between": ("input -1", "input 1"),
        "at": [(left, 0.0), (-left, 0.0)],
        "contact": 10.0,
    }  # whole blocks
    return Mechanism(
        name=f"{kind} bridge amplifier of Ling",
        thickness=DEPTH,
        material={**metal, "yield_strength": 276.0},
        body=bodies,
        hinge=hinges,
        actuator=[{"name": "drive", **drive, "stroke": 0.01, "stiffness": 1e3}],
        output={"body": "output", "at": (0.0, top)},
    )


def values_of_ports(found: Responses) -> tuple[float, float]:
    """Amplification and N/mm from the compliance between the output (x, y, theta) and the opening
    of the inputs.
    """
    C = found.compliance
    return -2 * C[1, 3] / C[3, 3], 2 / C[3, 3]


def ngsolve(kind: str, size: float) -> tuple[float, float, float]:
    """Amplification, N/mm and Hz by quadratic tetrahedra of at most `size`, mm, on half of the
    thickness.
    """
    import netgen.occ as occ
    import ngsolve as ng

    (left, _), top = places(LIMBS[kind])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "amplifier.step"
        flexfem.export(amplifier(kind), path)
        whole = occ.OCCGeometry(str(path)).shape
    low = whole.bounding_box[0][2] + DEPTH / 2

    def box(x: float, y: float, width: float, height: float) -> Any:
        """Half of a block."""
        return occ.Box(
            (x - width / 2, y - height / 2, low), (x + width / 2, y + height / 2, low + DEPTH)
        )

    wide = BLOCK[0], BLOCK[1] + 2 * EDGE
    blocks = {
        "left": box(left, 0, *wide),
        "right": box(-left, 0, *wide),
        "output": box(0, top, *OUTPUT),
    }
    half = whole * box(0, 0, 1e3, 1e3)
    parts = list[Any]()
    for name, block in blocks.items():
        parts.append(half * block)
        parts[-1].mat(name)
        half = half - block
    half.mat("limbs")
    shape = occ.Glue([half, *parts])
    shape.faces.Min(occ.Y).name = "ground"
    for face in shape.faces:
        if face.center.z < low + 1e-6:
            face.name = "middle"
    with ng.TaskManager():
        mesh = ng.Mesh(
            occ.OCCGeometry(shape).GenerateMesh(maxh=size, grading=0.3, segmentsperedge=2)
        )
        space = ng.VectorH1(mesh, order=2, dirichlet="ground", dirichletz="ground|middle")
        u, v = space.TnT()
        mu = E / (2 * (1 + NU))
        strain = ng.Sym(ng.Grad(u))
        test = ng.Sym(ng.Grad(v))
        lame = E * NU / ((1 + NU) * (1 - 2 * NU))
        K = ng.BilinearForm(
            2
            * (2 * mu * ng.InnerProduct(strain, test) + lame * ng.Trace(strain) * ng.Trace(test))
            * ng.dx
        )
        M = ng.BilinearForm(2 * DENSITY * ng.InnerProduct(u, v) * ng.dx)
        K.Assemble(), M.Assemble()
        inverse = K.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")

        def mean(name: str, field: Any, axis: int) -> float:
            here = mesh.Materials(name)
            return ng.Integrate(field[axis], mesh, definedon=here) / ng.Integrate(
                1, mesh, definedon=here
            )

        force = ng.LinearForm(space)
        for name, sign in (("left", -1), ("right", 1)):
            here = mesh.Materials(name)
            force += sign / ng.Integrate(1, mesh, definedon=here) * v[0] * ng.dx(definedon=here)
        force.Assemble()
        motion = ng.GridFunction(space)
        motion.vec.data = inverse * force.vec
        opening = mean("right", motion, 0) - mean("left", motion, 0)
        square, _ = ng.solvers.PINVIT(K.mat, M.mat, inverse, num=2, maxit=30, printrates=False)
        print(f"{'':24}{space.ndof} unknowns")
        return (
            -2 * mean("output", motion, 1) / opening,
            2 / opening,
            math.sqrt(square[0]) / (2 * math.pi),
        )


def rows(kind: str, given: argparse.Namespace) -> Iterator[tuple[str, float, float, float]]:
    """Name and results of every model."""
    mechanism = amplifier(kind)
    yield "closed form", closed_form(kind, LIMBS[kind]), math.nan, math.nan
    yield "beams", *beams(LIMBS[kind])
    parts = parts_of(mechanism)
    for name, elastic in (("flexfem analytic", False), ("flexfem elastic bodies", True)):
        more = (parts.bodies, False, parts.hinges) if elastic else ()
        frequency = analytic.modes(mechanism.layout, *more)[0]
        yield name, *values_of_ports(network(mechanism, elastic)), frequency / (2 * math.pi)
    for name, layers in (
        ("flexfem plane stress", 0),
        (f"flexfem {given.layers} layers", given.layers),
    ):
        size = (given.resolution, 0) if not layers else (4, layers)
        frequency = plate_modes(factorised(mechanism, *size), 1).frequencies[0]
        yield name, *values_of_ports(elements(mechanism, *size)), frequency / (2 * math.pi)
    if importlib.util.find_spec("ngsolve"):
        for size in given.sizes:
            yield f"NGSolve, {size:g} mm", *ngsolve(kind, size)


def main() -> None:
    """Print a table for each amplifier."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kinds", nargs="+", choices=LIMBS, default=list(LIMBS))
    parser.add_argument("--resolution", type=int, default=6)
    parser.add_argument("--layers", type=int, default=3)
    parser.add_argument("--sizes", type=float, nargs="*", default=[2.0, 1.5])
    given = parser.parse_args()
    for kind in given.kinds:
        print(f"{kind:24}{'amplification':>16}{'N/mm':>12}{'Hz':>12}")
        for name, *values in rows(kind, given):
            print(f"{name:24}{values[0]:16.4f}{values[1]:12.1f}{values[2]:12.2f}", flush=True)


if __name__ == "__main__":
    main()
