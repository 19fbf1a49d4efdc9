"""Section V against the stage in three dimensions: the force that a model predicts, on the stage extruded."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.arrays import Array
from flexfem.fem.elements import solid_nodal_stress, solid_von_mises
from flexfem.fem.response import Response
from flexfem.fem.structure import sheet_of
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import (
    ROUND_OFF,
    command_errors,
    error_matrix,
    levels,
    mesh_band,
    percentages,
    pose_bounds,
    solid_levels,
    solve_solid,
)
from flexfem.questions.warnings import held_faces
from flexfem.verify.case import DIRECTIONS, Case
from flexfem.verify.errors import compare
from flexfem.verify.imposed import CurveAnswer, FullCommand
from flexfem.verify.solid import neck_stress_of


def answer_of_solid(stage: Stage, analytic: AnalyticResult, case: Case) -> CurveAnswer:
    """Finite elements in three dimensions under the force of a model for the commands of a case.

    Raises BadInput, ComputationFailed.
    """
    response, lever = solve_solid(stage, case.resolution, case.layers), stage.chain.link_lengths[2]
    bounds, K = solid_levels(stage, case.resolution, case.layers), analytic.stiffness
    many = bounds.planes + (response.compliance - bounds.planes[-1])  # the mesh errs alike with one layer and with more
    steps, of_layers = np.array(levels(case.resolution)), _of_layers(stage, analytic, case)
    bands = command_errors(steps, many, K, case.direction, lever)
    found = compare(K, response.compliance, case.direction, case.commanded, lever)
    return CurveAnswer(
        found=found,
        full=_full(stage, response, found.force[-1]),
        bands=tuple(
            each._replace(band=max(each.band, mesh_band(steps, each.values)) + of)
            for each, of in zip(bands, of_layers.tolist(), strict=True)
        ),
        compliance=response.compliance,
        mesh=response.mesh,
        unknowns=response.unknowns,
        warnings=tuple(held_faces(stage)),
        layers=case.layers,
        of_layers=of_layers,
    )


def _of_layers(stage: Stage, analytic: AnalyticResult, case: Case) -> Array:
    """Half-widths (3,), percentage points, of what the layers leave out of the error percentages of a case.

    Notes
    -----
    The bound of `errors.pose_bounds` by the change from few layers to more; none where symmetry leaves round-off.
    """
    bounds, lever = solid_levels(stage, case.resolution, case.layers), stage.chain.link_lengths[2]
    axis = DIRECTIONS.index(case.direction)
    moved = pose_bounds(bounds.of_layers, bounds.many, analytic.stiffness[:, axis], np.eye(3))
    few, many = (error_matrix(analytic.stiffness, each, lever)[:, axis] for each in (bounds.few, bounds.many))
    zero = np.maximum(np.abs(few), np.abs(many)) <= ROUND_OFF
    return np.where(zero, 0.0, percentages(moved, 1.0, case.direction, lever))


def _full(stage: Stage, response: Response, force: Array) -> FullCommand:
    """The metal under a force (3,): the displacement of the mid-plane, the highest stress through the thickness."""
    mesh, field = response.mesh, np.tensordot(force, response.fields, axes=1)
    stress = solid_nodal_stress(mesh, sheet_of(stage), response.layers, field, np.arange(len(mesh.nodes)))
    necks = neck_stress_of(stage, response, force[None]).highest[0]
    return FullCommand(response.compliance @ force, field[:, 0, :2], solid_von_mises(stress).max(axis=1), necks)
