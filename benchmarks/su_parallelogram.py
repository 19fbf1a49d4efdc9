"""A parallelogram at large displacements against published three-dimensional finite elements.

    python benchmarks/su_parallelogram.py [--resolution 4] [--layers 3]

H.-J. Su published 1,547 loads of a steel parallelogram by three-dimensional CalculiX, with a stage
24 times as stiff (github.com/haijunsu-osu/parallelogram_model_comparison). Its leaves are ten times
as wide as thick, so they are stiffer than in plane stress and softer than in plane strain.
`between` weighs the numbers of both planes by the place of the linear three-dimensional stiffness
between them. The stage of the mechanism is elastic; "rigid stage" are finite elements of the two
leaves alone, tied to a rigid body."""

from __future__ import annotations

import argparse

import numpy as np

from flexfem import Mechanism
from flexfem.analytic.finite import displaced
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.nonlinear import equilibria, equilibrium
from flexfem.fem.ports import plate_of_layout
from flexfem.questions.plates import elements, meshed, model_of, solved

LENGTH = 250.0
THICKNESS = 5.0
WIDTH = 50.0
DISTANCE = 150.0  # mm, of the leaves
E = 210e3
NU = 0.3
UNIT = E * WIDTH * THICKNESS**3 / 12 / LENGTH**2  # N, of the normalised force A = F L^2 / (E I)
SCALE = np.array([LENGTH, LENGTH, 1.0])
# A_x, A_y, moment 0: u_x / L, u_y / L at the middle of the inner face of the stage, and its
# rotation, rad
SU = {
    (0.0, 0.5): (-2.430464e-4, 0.02006232, 4.896710e-5),
    (0.0, 5.0): (-0.02284664, 0.193272, 1.255099e-3),
    (0.0, 10.0): (-0.0784276, 0.352388, 6.456614e-3),
    (0.0, 20.0): (-0.215222, 0.559876, 0.03459728),
    (5.0, 5.0): (-0.01500468, 0.157894, 7.999993e-4),
    (-5.0, 5.0): (-0.0381608, 0.2476056, 2.375229e-3),
}
FINE = np.array([-5.7723, 48.6102, 0.001277]) / SCALE  # A_y = 5, triangles of 3 mm instead of 10 mm


def parallelogram(model: str, thickness: float = THICKNESS) -> Mechanism:
    """Return the mechanism; the ground is rigid, and the stage a block of 50 mm."""
    half = DISTANCE / 2
    outer = (DISTANCE + THICKNESS) / 2
    ends = {
        "between": ("ground", "stage"),
        "direction": 0.0,
        "shape": "leaf",
        "length": LENGTH,
        "neck": thickness,
    }
    corners = [(LENGTH, -outer), (LENGTH + 50, -outer), (LENGTH + 50, outer), (LENGTH, outer)]
    return Mechanism(
        name="parallelogram of Su",
        thickness=WIDTH,
        model=model,
        material={
            "name": "steel",
            "youngs_modulus": E,
            "poissons_ratio": NU,
            "density": 7.9,
            "yield_strength": 500.0,
        },
        body=[
            {
                "name": "ground",
                "outline": [(-20, -outer), (0, -outer), (0, outer), (-20, outer)],
                "fixed": True,
            },
            {"name": "stage", "outline": corners},
        ],
        hinge=[
            {"name": "lower", "at": (LENGTH / 2, -half), **ends},
            {"name": "upper", "at": (LENGTH / 2, half), **ends},
        ],
        output={"body": "stage", "at": (LENGTH, 0.0)},
    )


def leaves(mechanism: Mechanism, resolution: int) -> PlaneMesh:
    """Mesh of the leaves alone, from the ground to a rigid body at the point of the output."""
    mesh = meshed(mechanism, resolution)
    used, numbers = np.unique(
        mesh.triangles[mesh.bodies >= len(mechanism.layout.bodies)], return_inverse=True
    )
    ends = {"ground": 0.0, "hub": LENGTH}
    edges = {
        label: np.flatnonzero(np.abs(mesh.nodes[used, 0] - x) < 1e-6)[:, None]
        for label, x in ends.items()
    }
    bodies = mesh.bodies[mesh.bodies >= len(mechanism.layout.bodies)]
    nodes = mesh.nodes[used] - [LENGTH, 0.0]
    return PlaneMesh(nodes, numbers.reshape(-1, 6), bodies, edges)


def poses(model: str, resolution: int) -> list[np.ndarray]:
    """Poses (s, 3) by beams, by finite elements with a rigid stage, and with an elastic one."""
    mechanism = parallelogram(model)
    loads = [np.array([UNIT * x, UNIT * y, 0.0]) for x, y in SU]
    mesh = leaves(mechanism, resolution)
    plate = plate_of_layout(mechanism.layout)
    beams = [displaced(mechanism.layout, load[None]).motions[0, :3] for load in loads]
    rigid = [equilibrium(mesh, plate, load).pose[0] for load in loads]
    elastic = [equilibria(model_of(mechanism, resolution), load[None]).pose[0] for load in loads]
    return [np.array(found) / SCALE for found in (beams, rigid, elastic)]


def place_between(resolution: int, layers: int) -> tuple[float, list[float]]:
    """Place of three dimensions between plane stress, 0, and plane strain, 1; compliances 24 C_yy E
    I / L^3 of all.
    """
    flat = parallelogram("plane_stress")
    found = [solved(flat, resolution), elements(flat, resolution, layers)]
    found.append(solved(parallelogram("plane_strain"), resolution))
    stress, solid, strain = (24 * UNIT * each.compliance[1, 1] / LENGTH for each in found)
    return float((stress - solid) / (stress - strain)), [stress, solid, strain]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resolution", type=int, default=4)
    parser.add_argument("--layers", type=int, default=3)
    given = parser.parse_args()
    place, linear = place_between(given.resolution, given.layers)
    print(
        "24 C_yy E I / L^3, elastic stage: plane stress {:.5f}, 3D {:.5f}, plane strain {:.5f}".format(
            *linear
        )
    )
    print(f"place of 3D between plane stress and plane strain: {place:.3f}")
    planes = {model: poses(f"plane_{model}", given.resolution) for model in ("stress", "strain")}
    between = [
        (1 - place) * stress + place * strain
        for stress, strain in zip(*planes.values(), strict=True)
    ]
    methods = ("beams", "FE, rigid stage", "FE, elastic stage")
    models = {**{f"plane {model}": found for model, found in planes.items()}, "between": between}
    table = {
        f"{method}, {model}": found[m]
        for m, method in enumerate(methods)
        for model, found in models.items()
    }
    for k, (load, published) in enumerate(SU.items()):
        print("A_x {:g}, A_y {:g}: u_x / L, u_y / L, rotation, and per cent of Su".format(*load))
        rows = [("Su, 10 mm", np.array(published))] + (
            [("Su, 3 mm", FINE)] if load == (0.0, 5.0) else []
        )
        rows += [(name, found[k]) for name, found in table.items()]
        for name, pose in rows:
            change = 100 * (pose / np.array(published) - 1)
            print(
                f"  {name:32}"
                + "".join(f"{v:12.6f}" for v in pose)
                + "".join(f"{c:+8.2f}" for c in change)
            )


if __name__ == "__main__":
    main()
