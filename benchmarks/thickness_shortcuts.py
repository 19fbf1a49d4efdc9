"""What the chart of single hinges leaves out of the change from plane stress to three dimensions, and what counts.

    python benchmarks/thickness_shortcuts.py [--stage geometry/mobility6.toml]

The chart (`model = "corrected"`) has blocks as high as their notches, takes the shear of a hinge from its bending, and
leaves links and platform in plane stress. Here every hinge is solved in three dimensions between blocks as high as the
stage's links, and put into the analytic stage; shear and bodies are put to their bounds, plane stress and plane strain.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import CALIBRATED, analyse, at_rest, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import Array, inverse
from flexfem.fem.extrusion import displacement, line_integrals, plane_stiffness, section_integrals, solid_stiffness
from flexfem.fem.hinge import PlaneHinge, hinge_mesh
from flexfem.fem.thick import ThickHinge, _extruded, _held, _loads, layers
from flexfem.hinges.formulas import Compliance
from flexfem.mechanism.designs import lower
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.questions.bands import error_matrix
from flexfem.questions.budget import SOLID as BUDGET
from flexfem.questions.budget import change as _change

ROOT = Path(__file__).parents[1]
REFINEMENT, FINE = 2, 3


@cache
def position(ratio: float, width: float, nu: float, height: float, refinement: int) -> Array:
    """Position (2,) of rotation and axial between plane stress, 0, and plane strain, 1; blocks of `height` notches."""
    of = ThickHinge(ratio, width, nu)
    long = max(2.0, width * ratio / (2 + ratio) / height)  # of a block over its height: b at least
    hinge = PlaneHinge(ratio, height, long)
    mesh, line = hinge_mesh(hinge, refinement), line_integrals(layers(of, refinement))
    section, number, (high, length) = section_integrals(mesh), len(mesh.nodes), hinge.block
    plane, solid, points = plane_stiffness(section, nu), solid_stiffness(section, line, nu), len(line.whole)
    motion = (np.concatenate([-mesh.nodes[:, 1], mesh.nodes[:, 0]]), np.repeat([1.0, 0.0], number))
    blocks, found = (24 * length / high**3, 2 * length / high), []
    for k, flat in enumerate(_loads(mesh, high)):
        held = _held(mesh, 1)[k]
        thin = flat @ displacement(plane, flat, held[held < 2 * number], motion[k])
        force = _extruded(flat, line.whole)
        thick = force @ displacement(solid, force, _held(mesh, points)[k], _extruded(motion[k], np.ones(points)))
        found.append(-(thick / line.whole.sum() - thin) / (thin - blocks[k] / 4) / nu**2)
    return np.array(found)


def stage_compliance(stage: Stage, hinges: Compliance, plane: str) -> Array:
    """Platform compliance (3, 3) of hinges between links and platform in a plane problem."""
    bodies = body_compliance(stage, plane)
    return inverse(at_rest(lower(stage), hinges, freedoms_of(21), bodies[None]).stiffness[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stage", default=str(ROOT / "geometry" / "mobility6.toml"))
    stage = load_feasible(Path(parser.parse_args().stage))
    designs, nu, K = lower(stage), stage.material.poissons_ratio, analyse(stage).stiffness
    flat, charted = (
        hinge_compliances(replace(designs, plane=plane), CALIBRATED) for plane in ("plane_stress", "corrected")
    )
    R, t = designs.radius[0], designs.neck[0]
    notch = 2 * R + t
    height = np.maximum(stage.chain.link_width / notch, 1.0)
    lever, base = stage.chain.link_lengths[2], stage_compliance(stage, flat, "plane_stress")

    def points(C: Array) -> Array:
        """Percentage points (3,) along, from the plane stage."""
        return np.diag(error_matrix(K, C, lever) - error_matrix(K, base, lever))

    def charted_at(refinement: int, heights: Array) -> Compliance:
        p = np.array([[position(t[i, j] / R[i, j], stage.thickness / t[i, j], nu, heights[i, j], refinement)
                       for j in range(3)] for i in range(3)])  # fmt: skip
        rotation, axial = (flat[k] * (1 - nu**2 * p[None, ..., k]) for k in (0, 1))
        return Compliance(rotation, axial, charted.shear)

    def solved(refinement: int, heights: Array) -> Array:
        return points(stage_compliance(stage, charted_at(refinement, heights), "plane_stress"))

    flush = np.ones_like(height)
    own, low = solved(FINE, height), solved(FINE, flush)
    coarse = solved(REFINEMENT, height) - solved(REFINEMENT, flush)
    chart = points(stage_compliance(stage, charted, "plane_stress"))
    soft = points(stage_compliance(stage, Compliance(*charted[:2], flat.shear), "plane_stress"))
    hard = points(stage_compliance(stage, Compliance(*charted[:2], flat.shear * (1 - nu**2)), "plane_stress"))
    walls = points(stage_compliance(stage, charted, "plane_strain"))
    print("percentage points in x, y, theta")
    for name, values in (
        ("finite elements of the stage", np.diag(_change(stage, *BUDGET))),
        ("chart of single hinges", chart),
        ("the same, blocks as high as the notch, solved here", low),
        ("blocks as high as the links", own),
        ("  less those as high as the notch", own - low),
        ("  the same on a coarser mesh", coarse),
        ("shear as in plane stress, less the chart", soft - chart),
        ("shear by 1 - nu^2, less the chart", hard - chart),
        ("links and platform in plane strain, less the chart", walls - chart),
    ):
        print(f"{name}: {', '.join(f'{value:+.3f}' for value in values)}")


if __name__ == "__main__":
    main()
