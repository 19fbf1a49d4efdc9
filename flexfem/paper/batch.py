"""Results of designs: many at once by the analytic model, one by one by finite elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.mesher import Limit, MeshTimeout
from flexfem.fem.modes import modes
from flexfem.fem.response import Response, heat_response, unit_response
from flexfem.hinges.chart import Compliance
from flexfem.mechanism.layout import Payload
from flexfem.paper import fields
from flexfem.paper.commanding import element_ranges
from flexfem.paper.designs import Designs, envelope, lower
from flexfem.paper.driven import DriveRanges
from flexfem.paper.equations import Freedoms
from flexfem.paper.model import at_rest
from flexfem.paper.responses import DriftRates, in_plane, rates_of
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import layers_of, mesh_sectors, plate_of, sheet_of
from flexfem.questions.bands import error_matrix, levels, mesh_band
from flexfem.questions.life import CyclicMotion, Lives, by_elements, by_wrenches, lives
from flexfem.questions.modes import vibrating
from flexfem.refused import ComputationFailed

LOWEST = 3  # natural frequencies: the three modes of the rigid platform on its hinges


class ErrorPercentages(NamedTuple):
    """Error percentages of n designs for commands in x, y, theta, (n, 3) each.

    along : in the commanded direction.   across : largest in another direction.   bands : of
    `along`, if requested."""

    along: Array
    across: Array
    bands: Array | None


class DesignAnswers(NamedTuple):
    """Results of n designs; directions in the order x, y, theta.

    stiffness : (n, 3, 3), of the platform: N/mm, N, N mm.
    stress : (n, 3), highest neck stress per displacement, other directions held: MPa per mm, per
    rad.
    turning : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    yield_strength : (n,), MPa.   envelope : (n,), diameter, mm.

    Other fields are None unless requested: errors of the analytic model, ranges of the drives, the
    lowest natural frequencies (n, 3) in the plane, rad/s, fatigue lives, and thermal drift."""

    stiffness: Array
    stress: Array
    turning: Array
    yield_strength: Array
    envelope: Array
    errors: ErrorPercentages | None = None
    drives: DriveRanges | None = None
    frequencies: Array | None = None
    lives: Lives | None = None
    drift: DriftRates | None = None

    @property
    def coupling(self) -> Array:
        """Coupling `K_ij / sqrt(K_ii K_jj)` (n, 3) of x and y, x and theta, y and theta."""
        size = np.sqrt(np.abs(np.diagonal(self.stiffness, axis1=1, axis2=2)))
        first, second = np.triu_indices(3, 1)
        return np.asarray(self.stiffness[:, first, second] / (size[:, first] * size[:, second]))

    @property
    def range_at_yield(self) -> Array:
        """Displacement (n, 3), mm and rad, at which the first hinge yields, with the other
        directions held.
        """
        return self.yield_strength[:, None] / self.stress

    def travel(self, rotation: float) -> Array:
        """Return the displacement (n, 3), mm and rad, at which the first base hinge reaches
        `rotation`, rad.
        """
        return rotation / self.turning


def batch_at_rest(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    bodies: Array | None = None,
    repeated: CyclicMotion | None = None,
) -> DesignAnswers:
    """Return the analytic results of n designs, and their lives if a repeated motion is given."""
    found = at_rest(designs, hinges, freedoms, bodies)
    strength = designs.yield_strength
    highest = np.max(found.stress, axis=(1, 2))
    answers = DesignAnswers(
        found.stiffness, highest, found.base_rotation, strength, envelope(designs)
    )
    if repeated is None:
        return answers
    cycles = by_wrenches(designs, found.wrench, repeated)
    return answers._replace(lives=lives(cycles, designs.fatigue, strength, repeated))


def solved_design(
    stage: Stage,
    resolution: int,
    limit: Limit,
    predicted: Array | None = None,
    bands: bool = True,
    payload: Payload | None = None,
    repeated: CyclicMotion | None = None,
    driven: bool = False,
    warm: bool = False,
    layers: int = 0,
) -> DesignAnswers:
    """Return the finite-element results of one feasible design, n = 1.

    Parameters
    ----------
    predicted : (3, 3), stiffness that predicts the loads in (18); its errors are computed.
    bands : compute the mesh bands of these errors too, from coarser meshes.
    payload : on the platform, for natural frequencies.   repeated : repeated motion, for fatigue
    lives.
    driven, warm : compute the ranges of the stage's own drive, and its thermal drift.
    layers : solve in three dimensions, without the above; rotations of base hinges are those of the
    mid-plane.

    Raises
    ------
    BadInput : the finite elements do not accept the design.
    ComputationFailed : mesh or solver failed; MeshTimeout after the time limit, in three dimensions
    that of gmsh."""
    response = elements(stage, resolution, limit, layers)
    K = np.linalg.inv(response.compliance)
    K = (K + K.T) / 2  # round-off
    turning = np.abs(K @ fields.base_rotations(stage, response)).max(axis=1)
    strength = lower(stage).yield_strength
    highest = fields.neck_stresses(stage, response, K).highest.max(axis=(1, 2))
    found = DesignAnswers(
        K[None], highest[None], turning[None], strength, np.array([fields.envelope(response)])
    )
    if payload is not None:
        structure = vibrating(stage, response.mesh, payload)
        found = found._replace(frequencies=modes(structure, LOWEST).frequencies[None])
    if repeated is not None:
        cycles = by_elements(stage, response, repeated)
        found = found._replace(lives=lives(cycles, lower(stage).fatigue, strength, repeated))
    if driven:
        found = found._replace(drives=element_ranges(stage, response.mesh))
    if warm:
        expansions = (coefficient.item() for coefficient in in_plane(lower(stage)))
        found = found._replace(
            drift=rates_of(heat_response(response.mesh, plate_of(stage), *expansions).motions[None])
        )
    if predicted is None:
        return found
    return found._replace(errors=_errors(stage, resolution, limit, predicted, response, bands))


def elements(stage: Stage, resolution: int, limit: Limit, layers: int = 0) -> Response:
    """Mesh a stage and condense it sector by sector. Raises as `solved_design`."""
    plate, through = (
        (sheet_of(stage), layers_of(stage, layers)) if layers else (plate_of(stage), None)
    )
    return unit_response(mesh_sectors(stage, resolution, limit), plate, through)


def _errors(
    stage: Stage, resolution: int, limit: Limit, predicted: Array, response: Response, bands: bool
) -> ErrorPercentages:
    """Return the errors of a predicted stiffness, with bands from coarser meshes; one that fails is
    left out.
    """
    lever = stage.chain.link_lengths[2]
    errors = error_matrix(predicted, response.compliance, lever)
    along = np.diag(errors)
    across = np.max(np.abs(errors - np.diag(along)), axis=0)
    if not bands:
        return ErrorPercentages(along[None], across[None], None)
    on_meshes = {resolution: along}
    failures = list[ComputationFailed]()
    for coarser in levels(resolution)[1::-1]:
        try:
            C = elements(stage, coarser, limit).compliance
            on_meshes = {coarser: np.diag(error_matrix(predicted, C, lever))} | on_meshes
        except MeshTimeout:
            raise
        except ComputationFailed as failure:
            failures.append(failure)
    if len(on_meshes) == 1:
        raise failures[-1]
    half_widths = [
        mesh_band(np.array(list(on_meshes)), values)
        for values in np.transpose(list(on_meshes.values()))
    ]
    return ErrorPercentages(along[None], across[None], np.array([half_widths]))
