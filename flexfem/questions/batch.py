"""Answers of designs: of the analytic model many at once, of finite elements one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.analytic.model import at_rest
from flexfem.analytic.paper import Freedoms
from flexfem.analytic.responses import DriftRates, LinkParts, WarmBodies, in_plane, many, mass_matrix, rates_of
from flexfem.analytic.responses import drift as analytic_drift
from flexfem.analytic.responses import driven as driven_compliance
from flexfem.arrays import Array
from flexfem.clock import Limit
from flexfem.hinges.formulas import Compliance
from flexfem.mechanism.bodies import Payload
from flexfem.mechanism.designs import Designs, envelope, lower
from flexfem.mechanism.drives import StageDrive
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import error_matrix, levels, mesh_band
from flexfem.questions.driven import DriveRanges, drive_ranges, driven
from flexfem.questions.strained import Lives, Repeated, by_elements, by_wrenches, lives
from flexfem.refused import ComputationFailed
from flexfem.units import DENSITY

if TYPE_CHECKING:
    from flexfem.fem.response import Response

LOWEST = 3  # natural frequencies: of the platform on its hinges


class Clock(NamedTuple):
    """What is left of a design's time for gmsh, and whether gmsh runs in this process, where the limit is another's."""

    limit: Limit
    inside: bool


class ErrorPercentages(NamedTuple):
    """Of n designs, %, by commanded direction x, y, theta, (n, 3) each.

    along : in the commanded direction.   across : the largest in another.   bands : of `along`; None where not asked.
    """

    along: Array
    across: Array
    bands: Array | None


class Moments(NamedTuple):
    """Area moments, mm^2 to mm^4, of n designs: bodies (n, 3 chains, 4 bodies, 4) and hub (n, 4)."""

    bodies: Array
    hub: Array


class Answers(NamedTuple):
    """What n designs answer; directions in the order x, y, theta.

    stiffness : (n, 3, 3), of the platform: N/mm, N, N mm.
    stress : (n, 3), highest neck stress per displacement in each direction, the others held: MPa per mm, per rad.
    turning : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    yield_strength : (n,), MPa.   envelope : (n,), diameter, mm.   errors : of the analytic model, where asked.
    drives : what the stages' own drives do, where asked.
    frequencies : (n, 3), rad/s, the lowest natural ones in the plane, where asked.
    lives : fatigue lives, where asked.
    drift : with temperature, where asked.
    """

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
        """`K_ij / sqrt(K_ii K_jj)` (n, 3) of x and y, x and theta, y and theta."""
        size = np.sqrt(np.abs(np.diagonal(self.stiffness, axis1=1, axis2=2)))
        first, second = np.array([0, 0, 1]), np.array([1, 2, 2])
        return np.asarray(self.stiffness[:, first, second] / (size[:, first] * size[:, second]))

    @property
    def range_at_yield(self) -> Array:
        """Displacement (n, 3), mm and rad, at which the first hinge yields, the other directions held."""
        return self.yield_strength[:, None] / self.stress

    def travel(self, rotation: float) -> Array:
        """Displacement (n, 3), mm and rad, at which the first base hinge has turned by `rotation`, rad."""
        return rotation / self.turning


def batch_at_rest(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    bodies: Array | None = None,
    repeated: Repeated | None = None,
) -> Answers:
    """The analytic model of n designs, with arguments as `analytic.model.at_rest`; nan where it is singular.

    repeated : what is repeated, to ask for lives.
    """
    found = at_rest(designs, hinges, freedoms, bodies)
    highest = np.max(found.stress, axis=(1, 2))
    answers = Answers(found.stiffness, highest, found.turning, designs.yield_strength, envelope(designs))
    if repeated is None:
        return answers
    strained = by_wrenches(designs, found.wrench, repeated)
    return answers._replace(lives=lives(strained, designs.fatigue, designs.yield_strength, repeated))


def batch_frequencies(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    moments: Moments,
    payload: Payload,
    elastic: LinkParts | None = None,
) -> Array:
    """The three lowest natural frequencies (n, 3), rad/s, of n designs by the analytic model; nan where it has none.

    Parameters
    ----------
    moments : of what is drawn.   elastic : of `link_parts`, (n, ...) each; None where pads, links, platform are rigid.
    """
    mass = mass_matrix(moments.bodies, moments.hub, designs.thickness * designs.density * DENSITY, payload)
    of = many(designs.frames, hinges, freedoms, mass, elastic)
    return np.asarray(of.frequencies[:, :LOWEST])


def batch_drift(
    designs: Designs, hinges: Compliance, freedoms: Freedoms, bodies: WarmBodies | None = None
) -> DriftRates:
    """Drift of n designs by the analytic model, with elastic `bodies` or rigid ones; nan where it is singular."""
    return rates_of(analytic_drift(designs, hinges, freedoms, *in_plane(designs), bodies).pose)


def batch_drives(
    designs: Designs, hinges: Compliance, freedoms: Freedoms, drive: StageDrive, elastic: LinkParts | None = None
) -> DriveRanges:
    """The analytic model of n driven designs, with `elastic` links of n designs or rigid ones; nan where singular."""
    model = driven_compliance(designs.frames, hinges, freedoms, drive.stacks, elastic)
    return drive_ranges(designs, driven(model.compliance, drive), model.necks, drive)


def solved_design(
    stage: Stage,
    resolution: int,
    clock: Clock,
    predicted: Array | None = None,
    bands: bool = True,
    payload: Payload | None = None,
    repeated: Repeated | None = None,
    driven: bool = False,
    warm: bool = False,
) -> Answers:
    """Finite elements of one feasible design, n = 1.

    Parameters
    ----------
    predicted : (3, 3), the stiffness by which (18) predicts the loads, to ask for its errors.
    bands : ask for the mesh bands of these too, from coarser meshes.
    payload : on the platform, to ask for natural frequencies; None does not.   repeated : as of `batch_at_rest`.
    driven, warm : ask what the stage's own drive does, and for its drift.

    Raises
    ------
    BadInput : the finite elements refuse the design.
    ComputationFailed : by mesh or solver; MeshTimeout when the time limit is over.
    """
    from flexfem.fem.modes import modes
    from flexfem.fem.response import heat_response
    from flexfem.fem.structure import plate_of
    from flexfem.questions.drive import element_ranges
    from flexfem.questions.modes import vibrating

    response = elements(stage, resolution, clock)
    found = _at_rest(stage, response)
    if payload is not None:
        structure = vibrating(stage, response.mesh, payload)
        found = found._replace(frequencies=modes(structure, LOWEST).frequencies[None])
    if repeated is not None:
        strained = by_elements(stage, response, repeated)
        found = found._replace(lives=lives(strained, lower(stage).fatigue, found.yield_strength, repeated))
    if driven:
        found = found._replace(drives=element_ranges(stage, response.mesh))
    if warm:
        expansions = (each.item() for each in in_plane(lower(stage)))
        found = found._replace(drift=rates_of(heat_response(response.mesh, plate_of(stage), *expansions).pose[None]))
    if predicted is None:
        return found
    return found._replace(errors=_errors(stage, resolution, clock, predicted, response, bands))


def solved_solid(stage: Stage, resolution: int, layers: int, clock: Clock) -> Answers:
    """Finite elements in three dimensions of one feasible design, n = 1; base hinges turn as in the mid-plane.

    Raises as `solved_design`; the time limit is that of gmsh.
    """
    from flexfem.fem.mesh import mesh_sectors
    from flexfem.fem.response import unit_response
    from flexfem.fem.structure import layers_of, sheet_of

    response = unit_response(mesh_sectors(stage, resolution, *clock), sheet_of(stage), layers_of(stage, layers))
    return _at_rest(stage, response)


def _at_rest(stage: Stage, response: Response) -> Answers:
    """What finite elements always answer, n = 1."""
    from flexfem.fem.fields import base_rotations, neck_stresses
    from flexfem.fem.fields import envelope as meshed

    K = np.linalg.inv(response.compliance)
    K = (K + K.T) / 2  # round-off
    turning = np.abs(K @ base_rotations(stage, response)).max(axis=1)
    strength = np.array([stage.material.yield_strength])
    highest = neck_stresses(stage, response, K).highest.max(axis=(1, 2))
    return Answers(K[None], highest[None], turning[None], strength, np.array([meshed(response)]))


def elements(stage: Stage, resolution: int, clock: Clock) -> Response:
    """The stage meshed and condensed sector by sector. Raises as `solved_design`."""
    from flexfem.fem.mesh import mesh_sectors
    from flexfem.fem.response import unit_response
    from flexfem.fem.structure import plate_of

    return unit_response(mesh_sectors(stage, resolution, *clock), plate_of(stage))


def _errors(
    stage: Stage, resolution: int, clock: Clock, predicted: Array, response: Response, bands: bool
) -> ErrorPercentages:
    lever = stage.chain.link_lengths[2]
    percent = error_matrix(predicted, response.compliance, lever)
    along = np.diag(percent)
    across = np.max(np.abs(percent - np.diag(along)), axis=0)
    if not bands:
        return ErrorPercentages(along[None], across[None], None)
    coarser = _coarser(stage, resolution, clock)
    values = [np.diag(error_matrix(predicted, compliance, lever)) for compliance in coarser.values()]
    steps = np.array([*coarser, resolution])
    found = [mesh_band(steps, each) for each in np.transpose([*values, along])]
    return ErrorPercentages(along[None], across[None], np.array([found]))


def _coarser(stage: Stage, finest: int, clock: Clock) -> dict[int, Array]:
    """Compliances on the coarser meshes of a band, by resolution; one that folds is left out when there is another."""
    from flexfem.fem.mesher import MeshTimeout

    found, failures = dict[int, Array](), list[ComputationFailed]()
    for resolution in levels(finest)[:-1]:
        try:
            found[resolution] = elements(stage, resolution, clock).compliance
        except MeshTimeout:
            raise
        except ComputationFailed as failure:
            failures.append(failure)
    if not found:
        raise failures[0]
    return found
