"""Finite elements of a stage under one load, in the plane and in three dimensions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.api import solve
from flexfem.arrays import Array
from flexfem.fem.export import write_solid_vtu, write_vtu
from flexfem.fem.response import load_case
from flexfem.fem.solid import sheet_of
from flexfem.fem.solid_fields import solid_nodal_stress, solid_von_mises
from flexfem.files.refusals import checked_path
from flexfem.files.writing import check_file
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.reports.given import RESOLUTION, PathLike, meshed_solid
from flexfem.verify.answers import LoadReport, report_load
from flexfem.verify.solid import solve_solid
from flexfem.verify.solid_report import SolidReport, report_solid


def under_load(
    stage: Stage,
    force: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    resolution: int = RESOLUTION,
    vtu: PathLike | None = None,
) -> LoadReport:
    """Finite elements at rest, and under a force (3,) or held at a displacement (3,) of the platform.

    Parameters
    ----------
    force : N, N, N mm.   displacement : instead, mm, mm, rad.   Neither : no load.
    vtu : file for displacement (n, 2) and von Mises stress (n,) of all nodes.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; both force and displacement are given, or the file is not called .vtu.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.under_load(flexfem.load("geometry/mobility6.toml"), force=[1.5, 0, 0], resolution=3)
    >>> found.reaction.round(6) + 0.0
    array([-1.5,  0. ,  0. ])
    """
    target, load, held = _load_and_file(force, displacement, vtu)
    model = solve(stage, resolution)
    if held is not None:
        load = np.asarray(np.linalg.solve(model.compliance, held), dtype=np.float64)
    solved = model.solved
    case = load_case(stage, solved.mesh, solved.response, load)
    if target is not None:
        write_vtu(solved.mesh, target, {"displacement": case.field, "von_mises": case.stress})
    return report_load(stage, solved, case, resolution)


def under_load_solid(
    stage: Stage,
    force: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    vtu: PathLike | None = None,
) -> SolidReport:
    """Finite elements in three dimensions at rest, and under a force (3,) or held at a displacement (3,).

    Parameters
    ----------
    force, displacement, vtu : as of `under_load`; the file holds half of the thickness, stresses too (n, m, 3, 3).
    resolution : quadratic triangles across every neck, from 4.   layers : in half the thickness, from 3.

    Raises
    ------
    BadInput, ComputationFailed
        As `under_load`, for a stage of any model.
    """
    target, load, held = _load_and_file(force, displacement, vtu)
    finest, count = meshed_solid(resolution, layers)
    check_feasible(stage)
    response = solve_solid(stage, finest, count)
    if held is not None:
        load = np.asarray(np.linalg.solve(response.compliance, held), dtype=np.float64)
    found = report_solid(stage, response, load, finest)
    if target is not None:
        mesh, field = response.mesh, np.tensordot(load, response.fields, axes=1)
        every = np.arange(len(mesh.nodes))
        stress = solid_nodal_stress(mesh, sheet_of(stage), response.layers, field, every)
        told = {
            "displacement": field,
            "von_mises": solid_von_mises(stress),
            "stress": stress.reshape(*field.shape[:2], 9),
        }
        write_solid_vtu(mesh, response.layers.heights, target, told)
    return found


def _load_and_file(
    force: ArrayLike | None, displacement: ArrayLike | None, vtu: PathLike | None
) -> tuple[Path | None, Array, Array | None]:
    """The file to write, the load (3,), and the displacement (3,) to hold. Raises BadInput."""
    if force is not None and displacement is not None:
        raise BadInput("force and displacement, expected one of the two")
    target = None if vtu is None else checked_path(vtu)
    if target is not None and target.suffix != ".vtu":
        raise BadInput(f"{vtu}: expected a file name that ends in .vtu")
    if target is not None:
        check_file(target)
    load = np.zeros(3) if force is None else arguments.forces("force", force, 1)
    held = None if displacement is None else arguments.poses("displacement", displacement, 1)
    return target, load, held
