"""The analytic model at rest: n designs at once, for studies, and one stage as n = 1."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic import network
from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.network import GROUND
from flexfem.analytic.paper import (
    KINDS,
    Freedoms,
    PaperModel,
    freedoms_of,
    mechanism,
    rank_revealing,
    stiffness,
)
from flexfem.analytic.paper import mobility as mobility_of
from flexfem.arrays import Array, inverse
from flexfem.hinges import chart, formulas
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import Concentration, Wrench, neck_stress, stress_raised
from flexfem.mechanism.designs import Designs, Frames, lower, stage_frames
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.feasibility import Broken, check_closed_form
from flexfem.mechanism.stage_file import HINGE_NAMES, Plane, key_of, located
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import PLANES

if TYPE_CHECKING:
    from flexfem.mechanism.stage import Stage

DEFAULT_FORMULA, CALIBRATED = "paros-weisbord", "calibrated"
OFF_CHART = "t/R off the hinge chart"
OFF_THICKNESS = "t/R, b/t or nu off the thickness chart"
NOT_POSITIVE = "no positive compliance by its formula"
WIDER = np.outer(10.0 ** np.arange(-6, 4), (1.0, 2.0, 5.0)).ravel()  # mm, widths of necks with which a stage is tried
LINKS = tuple((1 + 2 * chain, 2 + 2 * chain) for chain in range(3))  # of every chain; the platform is body 0
JOINTS = tuple(ends for first, last in LINKS for ends in ((GROUND, first), (first, last), (last, 0)))
AT_PLATFORM = (2, 5, 8)  # of the joints: the hinges of the platform


class PlatformAtRest(NamedTuple):
    """What the platform of n designs does at rest; directions and 3 x 3 matrices in x, y, theta.

    stiffness : (n, 3, 3), N/mm, N, N mm; nan for a singular design.
    wrench : what the necks carry per displacement, (n, 3 chains, 3 hinges, 3 directions).
    stress : (n, 3, 3, 3), largest von Mises stress at each neck per displacement in each direction, the others held:
        MPa per mm, per rad.
    turning : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    """

    stiffness: Array
    wrench: Wrench
    stress: Array
    turning: Array


class AnalyticResult(NamedTuple):
    """The analytic model of one stage at rest.

    stiffness, compliance : (3, 3) of the platform in x, y, Phi: mm, N, rad.   mobility : by (1).
    freedoms, hinges : of each hinge, 3 chains by 3 hinges.   in_range : (3, 3), whether `formula` is meant for its t/R.
    links : whether pads, links and platform are elastic.   plane : how the stage is made a plane problem.
    wrench, stress : as in `PlatformAtRest`, (3 chains, 3 hinges, 3 directions).
    """

    stiffness: Array
    compliance: Array
    mobility: int
    freedoms: Freedoms
    formula: str
    hinges: Compliance
    in_range: NDArray[np.bool_]
    links: bool
    wrench: Wrench
    stress: Array
    plane: Plane

    @property
    def name(self) -> str:
        """Formula, freedoms and plane model, in words."""
        return _name(self.formula, self.links, self.mobility, self.plane)

    def neck_stress(self, stage: Stage, poses: Array) -> Array:
        """Largest von Mises stress (..., 3 chains, 3 hinges), MPa, with the platform of its stage at poses (..., 3)."""
        design = lower(stage)
        carried = Wrench(*(np.einsum("cnd,...d->...cn", part, poses)[..., None] for part in self.wrench))
        raised = Concentration(*(part[0] for part in stress_raised(design)))
        return neck_stress(carried, design.neck[0], design.thickness[0], raised)[..., 0]


def hinge_compliances(designs: Designs, formula: str) -> Compliance:
    """Compliances of all hinges, fields (n, 3 chains, 3 hinges), in the designs' plane; nan off a chart.

    Raises BadInput for an unknown formula.
    """
    b, H, nu = (each[:, None, None] for each in (designs.thickness, designs.link_width, designs.poissons_ratio))
    E, effective_nu = (each[:, None, None] for each in designs.elastic)
    found = formulas.formula(formula).compliance(designs.radius, designs.neck, b, E, effective_nu, H)
    if designs.plane != "corrected":
        return found
    factors = chart.thickness_factors(designs.radius, designs.neck, b, nu)
    return Compliance(*(one * factor for one, factor in zip(found, factors, strict=True)))


def in_range(designs: Designs, formula: str) -> NDArray[np.bool_]:
    """Whether the formula is meant for each hinge (n, 3, 3). Raises BadInput for an unknown formula."""
    return formulas.formula(formula).in_range(designs.radius, designs.neck, designs.link_width[:, None, None])


def has_answer(designs: Designs, formula: str, hinges: Compliance) -> dict[str, NDArray[np.bool_]]:
    """Whether the formula, and the chart of the thickness, have an answer for each hinge (n, 3, 3), by reason."""
    found = {}
    if formulas.formula(formula).charted:
        found[OFF_CHART] = formulas.formula(formula).in_range(designs.radius, designs.neck)
    if designs.plane == "corrected":
        b, nu = designs.thickness[:, None, None], designs.poissons_ratio[:, None, None]
        found[OFF_THICKNESS] = chart.thickness_chart().covers(designs.neck / designs.radius, b / designs.neck, nu)
    found[NOT_POSITIVE] = np.minimum(np.minimum(hinges.rotation, hinges.axial), hinges.shear) > 0
    return found


def without_answer(designs: Designs, formula: str, hinges: Compliance) -> list[Broken]:
    """What `has_answer` says no to by its reason, the table of the hinge first, and of which designs."""
    return [
        Broken(f"hinges.{name}: {reason}", ~np.all(holds[:, :, position], axis=1))
        for reason, holds in has_answer(designs, formula, hinges).items()
        for position, name in enumerate(HINGE_NAMES)
    ]


def lowered(frames: Frames, hinges: Compliance, freedoms: Freedoms, bodies: Array | None = None) -> network.Mechanism:
    """The stages as networks: the platform, the links of chain 1, 2 and 3; the joints are the nine hinges.

    bodies : (..., 9, 9), compliance of elastic bodies at the platform's hinges, as of `body_compliance`.
    """
    allowed = np.array([[[kind in hinge for kind in KINDS] for hinge in chain] for chain in freedoms])
    rotation, axial, shear = (np.asarray(each) * allowed[..., kind] for kind, each in enumerate(hinges))
    each = network.joint_compliance(frames.centres, frames.axes, rotation, axial, shear)
    return network.Mechanism(7, 0, JOINTS, each.reshape(*each.shape[:-4], len(JOINTS), 3, 3), AT_PLATFORM, bodies)


def chain_compliance(frames: Frames, hinges: Compliance, freedoms: Freedoms) -> Array:
    """Compliance (..., 3 chains, 3, 3) of the platform on each chain alone, with arguments as `lowered`."""
    return network.in_series(lowered(frames, hinges, freedoms))


def at_necks(frames: Frames, wrenches: Array) -> Wrench:
    """What the necks carry, (..., 3 chains, 3 hinges, k), of wrenches (..., 3 chains, 3 hinges, 3, k)."""
    F_x, F_y, M = (wrenches[..., row, :] for row in range(3))
    x, y = frames.centres[..., 0, None], frames.centres[..., 1, None]
    c, s = np.cos(frames.axes)[..., None], np.sin(frames.axes)[..., None]
    return Wrench(M + y * F_x - x * F_y, c * F_x + s * F_y, c * F_y - s * F_x)


def at_rest(designs: Designs, hinges: Compliance, freedoms: Freedoms, bodies: Array | None = None) -> PlatformAtRest:
    """The platform of n designs at rest, by hinges of compliances (n, 3, 3); the stiffness is that of (18).

    bodies : (n, 9, 9), of `body_compliance`; None where pads, links and platform are rigid.
    """
    found = network.stiffness(lowered(designs.frames, hinges, freedoms, bodies))
    wrench = at_necks(designs.frames, found.wrenches.reshape(-1, 3, 3, 3, 3))
    turning = np.abs(wrench.moment[:, :, 0]) * hinges.rotation[:, :, 0, None]
    stress = neck_stress(wrench, designs.neck, designs.thickness, stress_raised(designs))
    return PlatformAtRest(found.matrix, wrench, stress, np.max(turning, axis=1))


def stiffness_with_necks(
    stage: Stage, necks: Array, formula: str, freedoms: Freedoms, bodies: Array | None = None
) -> Array:
    """Stiffness (n, 3, 3) of a stage with other necks (n, 3, 3), mm, its bodies as they are; nan off a chart."""
    designs = lower(stage).repeated(len(necks))
    designs.neck[:] = necks
    with np.errstate(all="ignore"):
        return at_rest(designs, hinge_compliances(designs, formula), freedoms, bodies).stiffness


def analyse(
    stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA, links: bool = False
) -> AnalyticResult:
    """The analytic model of a stage at rest.

    Parameters
    ----------
    mobility : 3, 6, 12 or 21; None takes the prismatic hinges of the stage itself, and 21 with `links`.
    formula : a name in `formulas.FORMULAS`.
    links : pads, links and platform elastic, with all freedoms of the hinges.

    Raises
    ------
    BadInput: mobility or formula not known, a neck too thin beside the others, or as `hinge_compliance`.
    ComputationFailed: the stage is at a singular configuration.
    """
    design, hinges = lower(stage), hinge_compliance(stage, formula)
    freedoms = freedoms_of(21 if links else mobility, design.prismatic)
    bodies = body_compliance(stage)[None] if links else None
    found = at_rest(design, Compliance(*(part[None] for part in hinges)), freedoms, bodies)
    K, inside = found.stiffness[0], in_range(design, formula)[0]
    compliance = inverse(K)
    if np.isnan(compliance).any():
        _require_like_necks(stage, formula, freedoms, bodies)
        raise ComputationFailed(
            f"stage {stage.name!r} is at a singular configuration at rest: a chain has no compliance in some direction"
        )
    wrench, stress = Wrench(*(part[0] for part in found.wrench)), found.stress[0]
    of_model = (mobility_of(freedoms), freedoms, formula, hinges, inside, links)
    return AnalyticResult(K, compliance, *of_model, wrench, stress, stage.model)


class ModelChoice(NamedTuple):
    """What `analyse` takes; the `model` of the stage may differ from that of its file."""

    stage: Stage
    mobility: int | None
    formula: str
    links: bool

    @property
    def name(self) -> str:
        """Formula, freedoms and plane model, in words."""
        mobility = self.stage.mobility if self.mobility is None else self.mobility
        return _name(self.formula, self.links, mobility, self.stage.model)


def choose(stage: Stage, mobility: int | None, formula: str | None, links: bool, warnings: list[str]) -> ModelChoice:
    """The model asked for, of the plane of the stage's file, or `best_model` where nothing was. Raises BadInput."""
    if links and mobility not in (None, 21):
        raise BadInput(f"links with mobility {mobility}, expected 21 or None: elastic links go with all freedoms")
    if mobility is None and formula is None and not links:
        return best_model(stage, warnings)
    name = DEFAULT_FORMULA if formula is None else formula
    formulas.formula(name)
    freedoms_of(21 if links else mobility, lower(stage).prismatic)
    return ModelChoice(stage, mobility, name, links)


def best_model(stage: Stage, warnings: list[str], formula: str | None = None) -> ModelChoice:
    """The model of every question that names none: calibrated hinges, elastic links, hinges corrected for thickness.

    A `model` that the stage file states, and a `formula`, are kept. Where a chart does not reach a hinge, the default
    formula or plane stress is taken, and a warning is added.
    """
    if formula is None:
        try:
            hinge_compliance(stage, CALIBRATED)
            formula = CALIBRATED
        except BadInput as refusal:
            warnings.append(f"{refusal.reason}; {DEFAULT_FORMULA} is taken instead")
            formula = DEFAULT_FORMULA
    if "model" not in stage.model_fields_set:
        try:
            hinge_compliance(thick(stage), formula)
            stage = thick(stage)
        except BadInput as refusal:
            warnings.append(f"{refusal.reason}; {PLANES[stage.model]} is taken instead")
    return ModelChoice(stage, None, formula, True)


@once
def thick(stage: Stage) -> Stage:
    """The same stage with its hinges corrected for their thickness."""
    found = stage.model_copy(update={"model": "corrected"})
    found.__dict__["origin"] = stage.origin
    return found


def _require_like_necks(stage: Stage, formula: str, freedoms: Freedoms, bodies: Array | None) -> None:
    """Refuse the thinnest neck of a stage that has no answer, where the stage has one with thin necks widened."""
    design = lower(stage)
    chain, position = np.unravel_index(np.argmin(design.neck[0]), (3, 3))
    least = WIDER[(np.min(design.neck) < WIDER) & (np.max(design.neck) > WIDER)]
    K = stiffness_with_necks(stage, np.maximum(design.neck, least[:, None, None]), formula, freedoms, bodies)
    answered = least[~np.isnan(inverse(K)).any(axis=(1, 2))]
    if len(answered):
        name = HINGE_NAMES[position]
        key, neck = key_of(stage, int(chain) + 1, name, "neck_mm"), stage.hinge(int(chain) + 1, name).neck
        with located(stage):
            raise BadInput(
                f"{key} = {neck:g}: this neck is so much thinner than others, of up to {np.max(design.neck):g} mm, "
                f"that the stiffness cannot be computed to working precision, expected >= {answered[0]:g}"
            )


def assemble(stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA) -> PaperModel:
    """The stage as springs and joints, for loaded and displaced configurations; arguments as for `analyse`.

    Where the joints that the paper calls independent do not fix the others, six others are dependent.
    """
    of = mechanism(stage_frames(stage), hinge_compliance(stage, formula), freedoms_of(mobility, lower(stage).prismatic))
    if np.isnan(stiffness(of).K_uu).any():
        return of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
    return of


def hinge_compliance(stage: Stage, formula: str = DEFAULT_FORMULA) -> Compliance:
    """Compliances of the nine hinges of one stage, fields (3 chains, 3 hinges).

    Raises BadInput for a stage that cannot be made, and for a formula that is unknown, or that has, as the chart of a
    "corrected" model, no answer for some hinge.
    """
    check_closed_form(stage)
    with np.errstate(all="ignore"):  # off a chart, or where a formula has no value: refused below
        found = hinge_compliances(lower(stage), formula)
    for reason, holds in has_answer(lower(stage), formula, found).items():
        for chain, position in np.argwhere(~holds[0]).tolist():
            with located(stage):
                raise BadInput(_sentence(reason, stage, formula, chain + 1, position))
    return Compliance(*(part[0] for part in found))


def _name(formula: str, links: bool, mobility: int, plane: Plane) -> str:
    return f"{formula}, {'elastic links' if links else f'mobility {mobility}'}, {PLANES[plane]}"


def _sentence(reason: str, stage: Stage, formula: str, chain: int, position: int) -> str:
    """Why a hinge has no answer: key, value and what was expected."""
    hinge, b, nu = stage.hinge(chain, HINGE_NAMES[position]), stage.thickness, stage.material.poissons_ratio
    tau = hinge.neck / hinge.radius
    said = f"{key_of(stage, chain, HINGE_NAMES[position], 'neck_mm')} = {hinge.neck:g}"
    if reason == OFF_CHART:
        low, high = formulas.formula(formula).valid
        return f"{said}: t/R = {tau:.4g} is not on the hinge chart of formula {formula!r}, expected {low:g} to {high:g}"
    if reason == OFF_THICKNESS:
        values = f"t/R = {tau:.4g}, b/t = {b / hinge.neck:.4g}, nu = {nu:.4g}"
        ends = ", ".join(f"{low:g} to {high:g}" for low, high in chart.thickness_chart().ends)
        return f'{said}: not on the thickness chart of model = "corrected" with {values}, expected {ends}'
    return f"hinge formula {formula!r} has no positive compliance at t/R = {tau:.3g}, expected another one"
