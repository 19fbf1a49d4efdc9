"""The stage solved by CalculiX, an industrial solver of its own lineage, on our curved triangles.

CalculiX has no plane elements. It expands a CPS6 triangle to a 15-node wedge of the sheet's
thickness b and ties the displacement u, v in the plane to be the same through the thickness; only w
= z W(x, y) is left to answer to stress. Where the strain varies in the plane so does the change of
thickness W, and true plane stress then bends straight lines through the sheet, `u = -z^2/2 dW/dx`;
with u uniform the wedge shears instead, `gamma_xz = z dW/dx`, which costs an energy that grows with
b^2. It therefore suppresses W where the strain varies over lengths below b, and that is plane
strain: in necks much narrower than the sheet is thick the compliance falls by almost nu^2. The
wedge is plane stress only

- when the sheet is very thin: at 1/50 of the necks (0.01 mm for 0.5) the thickness takes 1.3e-5. As
  W is continuous from triangle to triangle while the strains are not, another part falls with the
  mesh: 12e-5, 1.5e-5, 0.5e-5 at two, four and six triangles across the necks. Compliance in plane
  stress scales exactly with 1/b, so loads scaled by the thinness give the displacements of the real
  sheet;
- or, at any thickness, when stress in the plane does not reach W: an orthotropic sheet of the same
  E1, E2, nu12 and G12 with nu13 = nu23 = 0 (`uncoupled`). This agrees to the digits printed. It
  leaves Poisson's ratio in the plane to CalculiX and takes the thickness out, so the thin isotropic
  sheet, which needs no such argument, is compared too.

Displacements are printed with seven digits. The wedge has three integration points in the plane,
those of our quadrature of degree 2 (`INTEGRATION`)."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import Plate
from flexfem.fem.export import write_mesh
from flexfem.fem.mesh import PlaneMesh

from .problem import MissingSolverError

INTEGRATION = 2  # degree of the quadrature that has CalculiX's points
DIGITS = (
    1e-6  # of displacement and frequency; half the last of CalculiX's seven digits is up to 5e-7
)
TIME_LIMIT = 600.0  # s
LOST_E = re.compile(
    r"(\d)([+-]\d{3})(?=\s|$)"
)  # Fortran drops the E of an exponent of three digits


def solve(
    mesh: PlaneMesh, plate: Plate, thickness: float | None = None, uncoupled: bool = False
) -> tuple[Array, Array]:
    """Compliance (3, 3) and displacements (3, n, 2), mm, of the sheet under unit loads on the rigid
    hub.

    Parameters
    ----------
    thickness : mm, at which CalculiX solves, the loads scaled so that displacements remain those of
    the plate in
        plane stress; None for the plate's own.
    uncoupled : see the module.

    Raises MissingSolverError when CalculiX is not installed.
    """
    program = shutil.which("ccx")
    threads = str(min(2, os.cpu_count() or 1))
    if program is None:
        raise MissingSolverError("CalculiX is missing: apt-get install calculix-ccx")
    b = plate.thickness if thickness is None else thickness
    environment = os.environ | {"OMP_NUM_THREADS": threads, "CCX_NPROC_EQUATION_SOLVER": threads}
    with tempfile.TemporaryDirectory() as name:
        deck = Path(name, "stage.inp")
        write_mesh(mesh, plate._replace(thickness=b), deck)
        if uncoupled:
            deck.write_text(with_uncoupled_material(deck.read_text(), plate))
        subprocess.run(
            [program, "-i", "stage"],
            cwd=name,
            env=environment,
            capture_output=True,
            timeout=TIME_LIMIT,
        )
        printed = Path(name, "stage.dat").read_text(errors="replace")
    poses, fields = (printed_displacements(printed, group) for group in ("platform", "all"))
    thinner = b / plate.thickness  # so much smaller would be the loads
    return thinner * np.column_stack(
        [[*centre, theta] for centre, (theta, _) in poses]
    ), thinner * np.array(fields)


def with_uncoupled_material(deck: str, plate: Plate) -> str:
    """The deck with an orthotropic sheet of the same E1, E2, nu12 and G12 that has nu13 = nu23 = 0."""
    before, rest = deck.split("*ELASTIC\n")
    E, nu = (f"{value:.12g}" for value in plate[:2])
    G = f"{plate.youngs_modulus / (2 * (1 + plate.poissons_ratio)):.12g}"
    constants = f"*ELASTIC, TYPE=ENGINEERING CONSTANTS\n{E}, {E}, {E}, {nu}, 0, 0, {G}, {G}\n{G}\n"
    return before + constants + rest.partition("\n")[2]


def printed_displacements(printed: str, group: str) -> list[Array]:
    """Displacements (nodes, 2) in the plane, mm, of a set of nodes, in the order of their numbers,
    for each step.

    printed : text of the .dat file.
    """
    found = []
    for block in LOST_E.sub(r"\1E\2", printed).split("displacements ")[1:]:
        title, *lines = block.splitlines()
        if f"for set {group.upper()} " in title:
            rows = itertools.takewhile(
                str.strip, lines[1:]
            )  # a blank line before the rows and after them
            table = np.array([row.split() for row in rows], dtype=float)
            found.append(table[np.argsort(table[:, 0]), 1:3])
    return found
