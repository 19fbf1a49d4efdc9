"""The analytic model of many designs at once: a chunk of factor values in, rows out, no loop over designs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic import notch, thick
from flexfem.analytic.links import body_compliance
from flexfem.analytic.mobility import freedoms_of, stage_freedoms
from flexfem.analytic.model import compliances
from flexfem.analytic.notch import ChartedFormula, Compliance
from flexfem.analytic.serial import chain_compliance, chain_wrenches
from flexfem.analytic.stress import neck_wrenches, peak_stress
from flexfem.arrays import AnyArray, Array
from flexfem.refused import BadInput
from flexfem.stage.conditions import Broken, broken, conditions
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.frames import Frames, direction, frames
from flexfem.stage.keys import keys
from flexfem.stage.schema import HINGE_NAMES, Plane, out_of_plane
from flexfem.study.derived import refusals_of
from flexfem.study.designs import Designs, designs_of, stage_of
from flexfem.study.outputs import common_columns, travel_columns
from flexfem.study.plan import LoadedStudy


class Response(NamedTuple):
    """What the platform of n designs does at rest.

    stiffness : (n, 3, 3) in x, y, theta: N/mm, N, N mm.
    stress : (n, 3), largest neck stress per displacement in each direction, the others held: MPa per mm, per rad.
    turning : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    """

    stiffness: Array
    stress: Array
    turning: Array


class Answers(NamedTuple):
    """Reasons (n,) why designs are refused, "" where they are not, and values (n, outputs), nan where they are."""

    reason: AnyArray
    values: Array


def respond(designs: Designs, plane: Plane, hinges: Compliance, placed: Frames, chains: Array) -> Response:
    """Response from the chains' wrenches at the platform per displacement of it, (n, 3 chains, 3, 3).

    `hinges` : fields (n, 3, 3).
    """
    wrench = neck_wrenches(placed, chains)
    turning = np.abs(wrench.moment[:, :, 0]) * hinges.rotation[:, :, 0, None]
    pull = out_of_plane(plane, designs.poissons_ratio)
    stress = peak_stress(wrench, designs.radius, designs.neck, designs.thickness, pull)
    return Response(np.sum(chains, axis=1), stress, np.max(turning, axis=1))


def hinge_compliances(designs: Designs, formula: str, plane: Plane) -> Compliance:
    """Compliances of all hinges, fields (n, 3, 3), as `model.hinge_compliance`; nan off a chart."""
    b, H, nu = (of[:, None, None] for of in (designs.thickness, designs.link_width, designs.poissons_ratio))
    E = designs.youngs_modulus[:, None, None]
    return compliances(notch.formula(formula), plane, designs.radius, designs.neck, b, E, nu, H)


def envelope(placed: Frames, designs: Designs) -> Array:
    """Diameter (n,), mm, of the circle about the platform centre that holds platform, hinges and pads.

    Notes
    -----
    The farthest corner: each notch is a box 2R long and as wide as the link, the pad behind a base hinge is as long as
    it is wide. Only the outside of a link's bend can lie farther out, when it does not lead to a farther hinge.
    """
    along = direction(placed.axes)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1) * 0.5 * designs.link_width[:, None, None, None]
    back = designs.radius.copy()
    back[:, :, 0] += designs.link_width[:, None]
    ends = (placed.centres + designs.radius[..., None] * along, placed.centres - back[..., None] * along)
    corners = [end + side * across for end in ends for side in (1.0, -1.0)]
    farthest = np.max([np.hypot(corner[..., 0], corner[..., 1]) for corner in corners], axis=(0, 2, 3))
    return np.asarray(2.0 * np.maximum(farthest, designs.platform_radius))


def answer_designs(loaded: LoadedStudy, values: Array) -> Answers:
    """Answer the designs whose factors take `values` (n, columns), file units."""
    study = loaded.study
    with np.errstate(all="ignore"):  # an impossible design computes nonsense, and is refused
        designs = designs_of(loaded, values)
        placed = frames(designs.link_lengths, designs.joint_angles, designs.axis)
        hinges = hinge_compliances(designs, study.formula, loaded.stage.model)
        reason = _first([*_off_limits(loaded, values), *_broken(designs, placed), *_senseless(loaded, designs, hinges)])
        reason = np.where(reason == "", refusals_of(loaded, values), reason)
        freedoms = stage_freedoms(designs.prismatic) if study.mobility is None else freedoms_of(study.mobility)
        bodies = _drawn(loaded, values, reason) if study.draws or study.links else None
        chains = chain_wrenches(chain_compliance(placed, hinges, freedoms), bodies if study.links else None)
        found = respond(designs, loaded.stage.model, hinges, placed, chains)
        singular = np.isnan(found.stiffness[:, 0, 0]) & (reason == "")
        reason[singular] = "chain: singular configuration at rest"
        columns = [common_columns(found.stiffness, found.stress, designs.yield_strength, envelope(placed, designs))]
        if study.drive is not None:
            columns.append(travel_columns(found.turning, study.drive.rotation))
    answers = np.concatenate(columns, axis=1)
    answers[reason != ""] = np.nan
    return Answers(reason, answers)


def _first(refused: list[Broken]) -> AnyArray:
    """The first reason (n,) to refuse each design, "" for none."""
    first = np.zeros(refused[0].where.shape, dtype=np.int64)
    for place in reversed(range(len(refused))):
        first[refused[place].where] = place + 1
    return np.array(["", *(each.reason for each in refused)], dtype=object)[first]


def _off_limits(loaded: LoadedStudy, values: Array) -> list[Broken]:
    """Values that no stage file can give."""
    return [
        Broken(f"{path}: a number no stage file can give", keys()[path].impossible(values[:, index]))
        for index, column in enumerate(loaded.columns)
        for path in column.keys
    ]


def _broken(designs: Designs, placed: Frames) -> list[Broken]:
    lengths = (designs.link_width, designs.platform_radius, designs.hub_radius)
    return broken(conditions(placed.centres, designs.radius, designs.neck, *lengths))


def _senseless(loaded: LoadedStudy, designs: Designs, hinges: Compliance) -> list[Broken]:
    """Hinges for which the formula, or the chart of the thickness, has no answer."""
    entry, found = notch.formula(loaded.study.formula), []
    R, t, b = designs.radius, designs.neck, designs.thickness[:, None, None]
    if isinstance(entry, ChartedFormula):
        found.append(("t/R off the hinge chart", entry.in_range(R, t)))
    if loaded.stage.model == "corrected":
        on_chart = thick.covers(R, t, b, designs.poissons_ratio[:, None, None])
        found.append(("t/R, b/t or nu off the thickness chart", on_chart))
    positive = np.minimum(np.minimum(hinges.rotation, hinges.axial), hinges.shear) > 0
    found.append(("no positive compliance by its formula", positive))
    return [
        Broken(f"hinges.{name}: {what}", ~np.all(holds[:, :, position], axis=1))
        for what, holds in found
        for position, name in enumerate(HINGE_NAMES)
    ]


def _drawn(loaded: LoadedStudy, values: Array, reason: AnyArray) -> Array:
    """Draw the designs not refused so far, one by one: reasons go to `reason`, bodies' compliances (n, 9, 9) back."""
    bodies = np.zeros((len(values), 9, 9))
    for index in np.flatnonzero(reason == ""):
        try:
            stage = stage_of(loaded, values[index])
            if loaded.study.draws:
                check_feasible(stage)
            if loaded.study.links:
                bodies[index] = body_compliance(stage)
        except BadInput as refusal:
            reason[index] = str(refusal)
    return bodies
