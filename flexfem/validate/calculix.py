"""The stage solved by CalculiX, an industrial solver of its own lineage, on our curved triangles.

CalculiX has no plane elements. It expands a CPS6 triangle to a 15-node wedge of the sheet's thickness b and ties the
displacement u, v in the plane to be the same through the thickness; only w = z W(x, y) is left to answer to stress.
Where the strain varies in the plane so does the change of thickness W, and true plane stress then bends straight
lines through the sheet, `u = -z^2/2 dW/dx`; with u uniform the wedge shears instead, `gamma_xz = z dW/dx`, which
costs an energy that grows with b^2. It therefore suppresses W where the strain varies over lengths below b, and that
is plane strain: in necks much narrower than the sheet is thick the compliance falls by almost nu^2. The wedge is plane
stress only

- when the sheet is very thin: at 1/50 of the necks (0.01 mm for 0.5) the thickness takes 1.3e-5. As W is continuous
  from triangle to triangle while the strains are not, another part falls with the mesh: 12e-5, 1.5e-5, 0.5e-5 at two,
  four and six triangles across the necks. At half that thickness round-off already adds 1e-5. Compliance in plane
  stress scales exactly with 1/b, so loads scaled by the thinness give the displacements of the real sheet;
- or, at any thickness, when stress in the plane does not reach W: an orthotropic sheet of the same E1, E2, nu12 and
  G12 with nu13 = nu23 = 0 (`uncoupled`). This agrees to the digits printed. It leaves Poisson's ratio in the plane to
  CalculiX and takes the thickness out, so the thin isotropic sheet, which needs no such argument, is compared too.

Displacements are printed with seven digits, half a unit of the last of which is up to 5e-7 of a number; stresses with
six. The wedge has three integration points in the plane, those of our quadrature of degree 2 (`INTEGRATION`).
"""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.export import UNIT_LOADS, write_deck
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, integration, stress_tensor
from flexfem.refused import BadInput, ComputationFailed
from flexfem.validate.records import Answer

INTEGRATION = 2  # degree of the quadrature that has CalculiX's points
DIGITS = 1e-6  # of displacement and frequency; half the last of CalculiX's seven digits is up to 5e-7
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
        said = run([program, "-i", "stage"], folder, time_limit)
        printed, stored = (read(folder / f"stage.{kind}") for kind in ("dat", "frd"))
    try:
        fields, poses = printed_displacements(printed, "all"), printed_displacements(printed, "platform")
        stress = stored_stress(stored)
    except ValueError as error:  # asterisks, or a file that ends early
        raise ComputationFailed(f"CalculiX wrote results that are not numbers: {error}") from None
    if [part.shape for part in (*fields, *stress)] != [(len(mesh.nodes), 2)] * 3 + [(len(mesh.nodes), 3)] * 3:
        raise ComputationFailed(f"CalculiX gave no answer: {reason(said)}")
    version = re.search(r"Version\s+(\S+)", stored)
    return Answer(
        version=version[1] if version else "unknown",
        compliance=np.column_stack([[*centre, theta] for centre, (theta, _) in poses]),
        fields=np.array(fields),
        stress=np.array(stress),
        seconds=time.perf_counter() - started,
    )


def extrapolated_stress(mesh: StageMesh, plate: Plate, field: Array) -> Array:
    """Stress (n, 3) as xx, yy, xy, MPa, of displacements (n, 2), mm, found at the nodes as CalculiX does.

    Notes
    -----
    From the stress s at its three integration points, where one barycentric coordinate is 2/3 and two are 1/6, the
    linear field with these values has `(5 s_0 - s_1 - s_2) / 3` in corner 0; middles get the mean of their corners,
    and each node the mean of the triangles around it.
    """
    total = np.zeros((len(mesh.nodes), 3))
    for triangles, gradients, _ in integration(mesh, INTEGRATION):
        relative = field[triangles] - field[triangles[:, :1]]
        stress = stress_tensor(plate, np.einsum("eia,eibq->eabq", relative, gradients, optimize=True))
        corners = (2.0 * np.eye(3) - 1.0 / 3.0) @ stress.reshape(-1, 4, 3)[:, [0, 3, 1]].swapaxes(1, 2)
        nodal = np.concatenate([corners, (corners + corners[:, [1, 2, 0]]) / 2], axis=1)
        for component in range(3):
            values = nodal[..., component].ravel()
            total[:, component] += np.bincount(triangles.ravel(), values, minlength=len(total))
    return np.asarray(total / np.bincount(mesh.triangles.ravel())[:, None])


def version() -> str:
    """The version of CalculiX, as it says. Raises BadInput when it is not installed."""
    said = re.search(r"Version\s+(\S+)", run([find_program(), "-v"], Path.cwd(), TIME_LIMIT))
    return said[1] if said else "unknown"


def find_program() -> str:
    """Where CalculiX is. Raises BadInput with the way to install it."""
    program = shutil.which("ccx")
    if program is None:
        raise BadInput("CalculiX (ccx) is not on the path, expected it installed: apt-get install calculix-ccx")
    return program


def printed_displacements(printed: str, group: str) -> list[Array]:
    """Displacements (nodes, 2) in the plane, mm, of a set of nodes, in the order of their numbers, for each step.

    printed : text of the .dat file.
    """
    found = []
    for block in LOST_E.sub(r"\1E\2", printed).split("displacements ")[1:]:
        title, *lines = block.splitlines()
        if f"for set {group.upper()} " in title:
            rows = itertools.takewhile(str.strip, lines[1:])  # a blank line before the rows and after them
            table = np.array([row.split() for row in rows], dtype=float)
            found.append(table[np.argsort(table[:, 0]), 1:3])
    return found


def stored_stress(stored: str) -> list[Array]:
    """Stress (nodes, 3) at the nodes as xx, yy, xy, MPa, in the order of their numbers, for each step.

    stored : text of the .frd file: columns of 12 characters with nothing between, after the node's number.
    """
    found = []
    for block in stored.split(" -4  STRESS")[1:]:
        rows = [line for line in block.partition("\n -3")[0].splitlines() if line.startswith(" -1")]
        columns = [[row[13:25], row[25:37], row[49:61]] for row in rows]
        number = np.array([row[3:13] for row in rows], dtype=int)
        found.append(np.array(columns, dtype=float)[np.argsort(number)])
    return found


def run(command: list[str], folder: Path, time_limit: float) -> str:
    threads = str(min(THREADS, os.cpu_count() or 1))
    environment = os.environ | {"OMP_NUM_THREADS": threads, "CCX_NPROC_EQUATION_SOLVER": threads}
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=time_limit, check=False
        )
    except subprocess.TimeoutExpired:
        raise ComputationFailed(f"CalculiX was stopped: not done within {time_limit:g} s") from None
    return done.stdout + done.stderr


def read(path: Path) -> str:
    return path.read_text(errors="replace") if path.exists() else ""


def reason(said: str) -> str:
    """Its first complaint, as one line; it goes on for a paragraph, and ends with exit code 0 all the same."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if "ERROR" in line), len(lines) - 1)
    return " ".join(lines[first : first + 2]) or "it said nothing"
