"""The stage solved by CalculiX, an industrial solver of its own lineage, on our curved triangles.

CalculiX has no plane elements. It expands a CPS6 triangle to a 15-node wedge of the sheet's thickness b and ties the
displacement u, v in the plane to be the same through the thickness; only w = z W(x, y) is left to answer to stress.
Where the strain varies in the plane so does the change of thickness W, and true plane stress then bends straight
lines through the sheet, `u = -z^2/2 dW/dx`; with u uniform the wedge shears instead, `gamma_xz = z dW/dx`, which
costs an energy that grows with b^2. It therefore suppresses W where the strain varies over lengths below b, and that
is plane strain: in necks much narrower than the sheet is thick the compliance falls by almost nu^2 (`thickness_effect`
shows it). The wedge is plane stress only

- when the sheet is very thin. At 0.01 mm what is left is 1.3e-5 for the thickness and, as W is made continuous from
  triangle to triangle while the strains are not, a part that falls with the mesh: 8e-5, 1.5e-5, 0.5e-5 at two, four
  and six triangles across the necks. Thinner still, round-off takes over: 1e-5 at 0.005 mm. Compliance scales exactly
  with 1/b in plane stress, so loads scaled by the thinness give the displacements of the real sheet;
- or, at any thickness, when stress in the plane does not reach W: an orthotropic sheet of the same E1, E2, nu12 and
  G12 with nu13 = nu23 = 0 (`uncoupled`). This agrees to the digits printed. It leaves Poisson's ratio in the plane to
  CalculiX and takes the thickness out, so the thin isotropic sheet, which needs no such argument, is compared too.

Displacements are printed with seven digits, half a unit of the last of which is up to 5e-7 of a number; stresses with
six. The wedge has three integration points in the plane, those of our quadrature of degree 2 (`INTEGRATION`).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from flexfem.arrays import Array
from flexfem.errors import BadInput, ComputationFailed
from flexfem.fem.deck import UNIT_LOADS, write_deck
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.peers.answer import Answer

INTEGRATION = 2  # degree of the quadrature that has CalculiX's points
THIN = 0.01  # mm
THICKNESSES = (10.0, 1.0, 0.1, THIN)  # mm
THREADS = 2
TIME_LIMIT = 600.0  # s
LOST_E = re.compile(r"(\d)([+-]\d{3})(?=\s|$)")  # Fortran drops the E of an exponent of three digits


def solve(
    mesh: StageMesh,
    plate: Plate,
    thickness: float | None = None,
    uncoupled: bool = False,
    time_limit: float = TIME_LIMIT,
) -> Answer:
    """Answer of the sheet to unit loads on the rigid hub with the ground clamped.

    Parameters
    ----------
    thickness : mm, at which CalculiX solves, the loads scaled so that displacements remain those of the plate in
        plane stress; None for the plate's own.
    uncoupled : see the module.
    time_limit : s, after which CalculiX is stopped.

    Raises BadInput when CalculiX is not installed, ComputationFailed when it fails or is not done in time.
    """
    program = find_program()
    started = time.perf_counter()
    solved_at = plate.thickness if thickness is None else thickness
    with tempfile.TemporaryDirectory(prefix="flexfem-") as name:
        folder = Path(name)
        write_deck(mesh, plate, folder / "stage.inp", UNIT_LOADS * solved_at / plate.thickness, solved_at, uncoupled)
        said = _run([program, "-i", "stage"], folder, time_limit)
        printed, stored = (_read(folder / f"stage.{kind}") for kind in ("dat", "frd"))
    displacements, poses = printed_displacements(printed, len(mesh.nodes) + 2)
    stress = stored_stress(stored, len(mesh.nodes))
    if len(displacements) != 3 or len(poses) != 3 or len(stress) != 3:
        raise ComputationFailed(f"CalculiX gave no answer: {_reason(said)}")
    version = re.search(r"Version\s+(\S+)", stored)
    return Answer(
        version=version[1] if version else "unknown",
        compliance=np.column_stack([[pose[0, 0], pose[0, 1], pose[1, 0]] for pose in poses]),
        fields=displacements[:, : len(mesh.nodes)],
        stress=stress,
        seconds=time.perf_counter() - started,
    )
