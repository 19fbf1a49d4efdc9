"""One design by finite elements: meshed and condensed sector by sector, and asked for the columns of a study."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.chains import travel
from flexfem.analytic.model import analyse
from flexfem.arrays import Array
from flexfem.clock import Limit
from flexfem.fem.cyclic import CyclicResponse, cyclic_response
from flexfem.fem.cyclic_fields import base_rotations, envelope, neck_stresses
from flexfem.fem.gmsh_process import MeshTimeout
from flexfem.fem.response import plate_of
from flexfem.fem.sectors import mesh_sectors
from flexfem.refused import BadInput, ComputationFailed
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.schema import Stage
from flexfem.study.designs import stage_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import common_columns, travel_columns
from flexfem.study.rows import Rows
from flexfem.verify.comparison import error_matrix
from flexfem.verify.convergence import CAUTIOUS, ORDER, grid_convergence, levels


class _Clock(NamedTuple):
    """What is left of a design's time for gmsh, and whether gmsh runs in this process, where the limit is another's."""

    limit: Limit
    inside: bool


def solved_row(loaded: LoadedStudy, values: Array, inside: bool) -> Rows:
    """The row of the design whose factors take `values` (columns,), file units, whatever becomes of it."""
    try:
        stage = stage_of(loaded, values)
        check_feasible(stage)
        return _row("ok", "", solved_values(stage, loaded, inside))
    except BadInput as refusal:
        found = "refused", str(refusal)
    except MeshTimeout as failure:
        found = "time limit", str(failure)
    except (ComputationFailed, np.linalg.LinAlgError) as failure:
        found = "failed", str(failure)
    return _row(*found, np.full(len(loaded.outputs), np.nan))


def solved_values(stage: Stage, loaded: LoadedStudy, inside: bool) -> Array:
    """Values (outputs,) of a feasible design, for model "fe" and "verify".

    Parameters
    ----------
    inside : gmsh may run in this very process, a worker that can be killed, and in its main thread; else meshes are
        made in a child process, which is stopped after the study's time limit.

    Raises
    ------
    BadInput : the design is refused, by the finite elements or by the formula.
    ComputationFailed : by mesh or solver; MeshTimeout when the time limit is over.
    """
    study, clock = loaded.study, _Clock(Limit(loaded.study.time_limit), inside)
    analytic = analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    response = _solved(stage, study.resolution, clock)
    stiffness = np.linalg.inv(response.compliance)
    stiffness = (stiffness + stiffness.T) / 2  # round-off
    stress = neck_stresses(stage, response, stiffness).max(axis=(1, 2))  # row j: the loads of a unit displacement j
    strength, size = np.array([stage.material.yield_strength]), np.array([envelope(response)])
    found = [common_columns(stiffness[None], stress[None], strength, size)[0]]
    if study.drive is not None:
        turning = np.abs(stiffness @ base_rotations(stage, response)).max(axis=1)
        found.append(travel_columns(travel(turning[None], study.drive.rotation))[0])
    if analytic is not None:
        found.append(_errors(stage, loaded, analytic, response, clock))
    return np.concatenate(found)


def _solved(stage: Stage, resolution: int, clock: _Clock) -> CyclicResponse:
    plate = plate_of(stage)
    return cyclic_response(mesh_sectors(stage, resolution, *clock), plate)


def _errors(stage: Stage, loaded: LoadedStudy, analytic: Array, response: CyclicResponse, clock: _Clock) -> Array:
    """Error percentages of the protocol, the largest across each command, and the bands of the former if wanted.

    analytic : (3, 3), the stiffness by which (18) predicts the loads.
    """
    study, lever = loaded.study, stage.chain.link_lengths[2]
    percent = error_matrix(analytic, response.compliance, lever)
    along = np.diag(percent)
    across = np.max(np.abs(percent - np.diag(along)), axis=0)
    if not study.bands:
        return np.concatenate([along, across])
    coarser = _coarser(stage, study.resolution, clock)
    values = [np.diag(error_matrix(analytic, compliance, lever)) for compliance in coarser.values()]
    resolutions = np.array([*coarser, study.resolution])
    bands = [mesh_band(resolutions, each) for each in np.transpose([*values, along])]
    return np.concatenate([along, across, bands])


def _coarser(stage: Stage, finest: int, clock: _Clock) -> dict[int, Array]:
    """Compliances on the coarser meshes of a band, by resolution; one that folds is left out when there is another."""
    found, failures = dict[int, Array](), list[ComputationFailed]()
    for resolution in levels(finest)[:-1]:
        try:
            found[resolution] = _solved(stage, resolution, clock).compliance
        except MeshTimeout:
            raise
        except ComputationFailed as failure:
            failures.append(failure)
    if not found:
        raise failures[0]
    return found


def mesh_band(resolutions: Array, values: Array) -> float:
    """Half-width of the mesh uncertainty about the finest of two or three values, coarse to fine.

    Notes
    -----
    The larger, where there are three, of `grid_convergence` and of Roache's index for two meshes, with the theoretical
    order and the safety factor 3: on meshes as coarse as these the observed order often exceeds the theoretical one,
    and the first alone left out the extrapolated value of 6 in 36 compliances of a dozen stages at resolution 4, the
    larger of none.
    """
    e21, r21 = values[-1] - values[-2], resolutions[-1] / resolutions[-2]
    of_two = float(CAUTIOUS * abs(e21) / (r21**ORDER - 1))
    return of_two if len(values) == 2 else max(grid_convergence(resolutions, values).band, of_two)


def _row(status: str, reason: str, values: Array) -> Rows:
    return Rows(np.array([status], dtype=object), np.array([reason], dtype=object), values[None])
