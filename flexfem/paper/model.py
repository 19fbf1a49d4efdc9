"""The analytic model at rest, for n designs at once; a single stage is n = 1."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic import network
from flexfem.analytic.network import GROUND, Network
from flexfem.arrays import Array, inverse, short_repr
from flexfem.files.tables import memoized
from flexfem.hinges import chart, formulas
from flexfem.hinges.chart import Compliance
from flexfem.hinges.choice import CALIBRATED as CALIBRATED
from flexfem.hinges.choice import DEFAULT_FORMULA as DEFAULT_FORMULA
from flexfem.hinges.strength import Wrench, neck_stress, raised_in_depth, raised_in_plane
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.stress_concentration import Concentration
from flexfem.paper.designs import Designs, design_arrays, stage_frames
from flexfem.paper.equations import (
    KINDS,
    Freedoms,
    PaperModel,
    freedoms_of,
    mechanism,
    rank_revealing,
    stiffness,
)
from flexfem.paper.equations import mobility as mobility_of
from flexfem.paper.feasibility import Broken, check_closed_form
from flexfem.paper.frames import Frames
from flexfem.paper.links import body_compliance
from flexfem.paper.stage_file import HINGE_NAMES, Plane, key_of
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import PLANES

if TYPE_CHECKING:
    from flexfem.paper.stage import Stage

OFF_CHART = "t/R off the hinge chart"
OFF_THICKNESS = "t/R, b/t or nu off the thickness chart"
NOT_POSITIVE = "no positive compliance by its formula"
# mm, smallest widths to be recommended
TRIAL_NECKS = np.outer(10.0 ** np.arange(-6, 4), (1.0, 2.0, 5.0)).ravel()
LINK_BODIES = ((1, 2), (3, 4), (5, 6))  # of every chain; the platform is body 0
JOINTS = tuple(
    ends for first, last in LINK_BODIES for ends in ((GROUND, first), (first, last), (last, 0))
)
PLATFORM_HINGES = (2, 5, 8)  # in `JOINTS`


class PlatformAtRest(NamedTuple):
    """Response of the platform of n designs at rest; directions and 3 x 3 matrices in x, y, theta.

    stiffness : (n, 3, 3), N/mm, N, N mm; nan for a singular design.
    wrench : internal forces of the necks per displacement, (n, 3 chains, 3 hinges, 3 directions).
    stress : (n, 3, 3, 3), largest von Mises stress at each neck per displacement in each direction,
        the others held: MPa per mm, per rad.
    base_rotation : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    """

    stiffness: Array
    wrench: Wrench
    stress: Array
    base_rotation: Array


@short_repr
class AnalyticResult(NamedTuple):
    """The analytic model of one stage at rest.

    stiffness, compliance : (3, 3) of the platform in x, y, Phi: mm, N, rad.   mobility : by (1).
    freedoms, hinges : of each hinge, 3 chains by 3 hinges.   formula : of the hinges.
    links : whether pads, links and platform are elastic.
    plane : the reduction to a plane problem.
    wrench, stress : as in `PlatformAtRest`, (3 chains, 3 hinges, 3 directions).
    """

    stiffness: Array
    compliance: Array
    mobility: int
    freedoms: Freedoms
    formula: str
    hinges: Compliance
    links: bool
    wrench: Wrench
    stress: Array
    plane: Plane

    @property
    def name(self) -> str:
        """Formula, freedoms and plane model as text."""
        return _model_name(self.formula, self.links, self.mobility, self.plane)

    def neck_stress(
        self,
        stage: Stage,
        poses: Array,
    ) -> Array:
        """Return the largest von Mises stress (..., 3 chains, 3 hinges), MPa, at poses (..., 3)."""
        design = design_arrays(stage)
        parts = [np.einsum("cnd,...d->...cn", part, poses) for part in self.wrench]
        wrench = Wrench(*(part[..., None] for part in parts))
        raised = Concentration(*(part[0] for part in stress_raised(design)))
        return neck_stress(wrench, design.neck[0], design.thickness[0], raised)[..., 0]


def hinge_compliances(designs: Designs, formula: str) -> Compliance:
    """Return the compliances of all hinges, fields (n, 3 chains, 3 hinges), nan off a chart.

    Raises BadInput for an unknown formula.
    """
    b = designs.thickness[:, None, None]
    H = designs.link_width[:, None, None]
    E, effective_nu = (values[:, None, None] for values in designs.elastic)
    radius = designs.radius
    neck = designs.neck
    hinges = formulas.formula(formula).compliance(radius, neck, b, E, effective_nu, H)
    if designs.plane != "corrected":
        return hinges
    factors = chart.thickness_factors(radius, neck, b, designs.poissons_ratio[:, None, None])
    return Compliance(
        rotation=hinges.rotation * factors.rotation,
        axial=hinges.axial * factors.axial,
        shear=hinges.shear * factors.shear,
    )


def in_range(designs: Designs, formula: str) -> NDArray[np.bool_]:
    """Return whether the formula is valid for each hinge (n, 3, 3).

    Raises BadInput for an unknown formula.
    """
    return formulas.formula(formula).in_range(
        designs.radius, designs.neck, designs.link_width[:, None, None]
    )


def _is_valid(
    designs: Designs,
    formula: str,
    hinges: Compliance,
) -> dict[str, NDArray[np.bool_]]:
    """Return whether the formula and the thickness chart cover each hinge (n, 3, 3), by reason."""
    valid = dict[str, NDArray[np.bool_]]()
    if formulas.formula(formula).charted:
        valid[OFF_CHART] = formulas.formula(formula).in_range(designs.radius, designs.neck)
    if designs.plane == "corrected":
        tau = designs.neck / designs.radius
        depth_ratio = designs.thickness[:, None, None] / designs.neck
        nu = designs.poissons_ratio[:, None, None]
        valid[OFF_THICKNESS] = chart.thickness_chart().covers(tau, depth_ratio, nu)
    valid[NOT_POSITIVE] = np.minimum(np.minimum(hinges.rotation, hinges.axial), hinges.shear) > 0
    return valid


def invalid_hinges(
    designs: Designs,
    formula: str,
    hinges: Compliance,
) -> list[Broken]:
    """Return the designs with hinges that formula or chart does not cover, by hinge and reason."""
    found = list[Broken]()
    for reason, valid in _is_valid(designs, formula, hinges).items():
        for position, name in enumerate(HINGE_NAMES):
            is_invalid = ~np.all(valid[:, :, position], axis=1)
            found.append(Broken(f"hinges.{name}: {reason}", is_invalid))
    return found


def network_of(
    frames: Frames, hinges: Compliance, freedoms: Freedoms, bodies: Array | None = None
) -> Network:
    """Return the stages as networks of the platform and the links of chain 1, 2 and 3.

    The nine hinges join them.

    bodies : (..., 9, 9), of `body_compliance`, compliance at the platform's hinges.
    """
    # which of rotation, axial and shear each hinge allows
    allowed = [[[kind in hinge for kind in KINDS] for hinge in chain] for chain in freedoms]
    rotation, axial, shear = np.moveaxis(np.array(allowed), -1, 0)
    C = network.joint_compliance(
        frames.centres,
        frames.axes,
        rotation * hinges.rotation,
        axial * hinges.axial,
        shear * hinges.shear,
    )
    joints = C.reshape(*C.shape[:-4], len(JOINTS), 3, 3)
    return Network(7, 0, JOINTS, joints, PLATFORM_HINGES, bodies)


def at_necks(frames: Frames, wrenches: Array) -> Wrench:
    """Return the neck forces (..., 3 chains, 3 hinges, k) of wrenches at the origin.

    wrenches : (..., 3 chains, 3 hinges, 3, k).
    """
    F_x, F_y, M = (wrenches[..., row, :] for row in range(3))
    x = frames.centres[..., 0, None]
    y = frames.centres[..., 1, None]
    c = np.cos(frames.axes)[..., None]
    s = np.sin(frames.axes)[..., None]
    return Wrench(M + y * F_x - x * F_y, c * F_x + s * F_y, c * F_y - s * F_x)


def stress_raised(designs: Designs) -> Concentration:
    """Return the largest von Mises stress at the necks of n designs over that of a straight bar.

    Its fields are (n, 3 chains, 3 hinges).
    """
    ratio = designs.neck / designs.radius
    if designs.plane == "corrected":
        depth_ratio = designs.thickness[:, None, None] / designs.neck
        return raised_in_depth(ratio, depth_ratio, designs.poissons_ratio[:, None, None])
    return raised_in_plane(ratio, designs.out_of_plane[:, None, None])


def at_rest(
    designs: Designs, hinges: Compliance, freedoms: Freedoms, bodies: Array | None = None
) -> PlatformAtRest:
    """Return the response of n designs at rest, (18), with hinges of compliances (n, 3, 3).

    bodies : (n, 9, 9), of `body_compliance`; None where pads, links and platform are rigid.
    """
    K, wrenches = network.stiffness(network_of(designs.frames, hinges, freedoms, bodies))
    wrench = at_necks(designs.frames, wrenches.reshape(-1, 3, 3, 3, 3))
    base_rotation = np.abs(wrench.moment[:, :, 0]) * hinges.rotation[:, :, 0, None]
    stress = neck_stress(wrench, designs.neck, designs.thickness, stress_raised(designs))
    return PlatformAtRest(K, wrench, stress, np.max(base_rotation, axis=1))


def stiffness_with_necks(
    stage: Stage, necks: Array, formula: str, freedoms: Freedoms, bodies: Array | None = None
) -> Array:
    """Return the stiffness (n, 3, 3) of a stage with other necks (n, 3, 3), mm; nan off a chart."""
    designs = design_arrays(stage).repeated(len(necks))
    designs.neck[:] = necks
    with np.errstate(all="ignore"):
        return at_rest(designs, hinge_compliances(designs, formula), freedoms, bodies).stiffness


def analyse(
    stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA, links: bool = False
) -> AnalyticResult:
    """Return the analytic model of a stage at rest.

    Parameters
    ----------
    mobility : 3, 6, 12 or 21; None takes the prismatic hinges of the stage, and 21 with `links`.
    formula : a name in `formulas.FORMULAS`.
    links : pads, links and platform are elastic, and the hinges have all freedoms.

    Raises
    ------
    BadInput
        Mobility or formula is not known, a neck is far thinner than the others, or as for
        `hinge_compliance`.
    ComputationFailed
        The stage is at a singular configuration.
    """
    design = design_arrays(stage)
    hinges = hinge_compliance(stage, formula)
    freedoms = freedoms_of(21 if links else mobility, design.prismatic)
    bodies = body_compliance(stage)[None] if links else None
    platform = at_rest(design, Compliance(*(part[None] for part in hinges)), freedoms, bodies)
    K = platform.stiffness[0]
    compliance = inverse(K)
    if np.isnan(compliance).any():
        _refuse_thin_neck(stage, formula, freedoms, bodies)
        raise ComputationFailed(
            f"stage {stage.name!r} is at a singular configuration at rest: a chain has no "
            "compliance in some direction"
        )
    wrench = Wrench(*(part[0] for part in platform.wrench))
    stress = platform.stress[0]
    settings = (mobility_of(freedoms), freedoms, formula, hinges, links)
    return AnalyticResult(K, compliance, *settings, wrench, stress, stage.model)


class ModelChoice(NamedTuple):
    """Arguments of `analyse`; the `model` of the stage may differ from that of its file."""

    stage: Stage
    mobility: int | None
    formula: str
    links: bool

    @property
    def name(self) -> str:
        """Formula, freedoms and plane model as text."""
        mobility = self.stage.mobility if self.mobility is None else self.mobility
        return _model_name(self.formula, self.links, mobility, self.stage.model)


def choose(
    stage: Stage, mobility: int | None, formula: str | None, links: bool, warnings: list[str]
) -> ModelChoice:
    """Return the requested model in the plane of the stage's file, or `best_model` by default.

    Raises BadInput.
    """
    if links and mobility not in (None, 21):
        raise BadInput(
            f"links with mobility {mobility}, expected 21 or None: elastic links need all freedoms"
        )
    if mobility is None and formula is None and not links:
        return best_model(stage, warnings)
    name = DEFAULT_FORMULA if formula is None else formula
    formulas.formula(name)
    freedoms_of(21 if links else mobility, design_arrays(stage).prismatic)
    return ModelChoice(stage, mobility, name, links)


def best_model(stage: Stage, warnings: list[str]) -> ModelChoice:
    """Return the default model: calibrated hinges, corrected for thickness, elastic links.

    A `model` in the stage file is kept. Where a chart does not cover a hinge, the default formula
    or plane stress is used, and a warning is added.
    """
    formula = CALIBRATED
    try:
        hinge_compliance(stage, formula)
    except BadInput as refusal:
        warnings.append(f"{refusal.reason}; {DEFAULT_FORMULA} is used instead")
        formula = DEFAULT_FORMULA
    if "model" not in stage.model_fields_set:
        try:
            hinge_compliance(corrected(stage), formula)
            stage = corrected(stage)
        except BadInput as refusal:
            warnings.append(f"{refusal.reason}; {PLANES[stage.model]} is used instead")
    return ModelChoice(stage, None, formula, True)


@memoized
def corrected(stage: Stage) -> Stage:
    """Return the same stage with its hinges corrected for their thickness."""
    copy = stage.model_copy(update={"model": "corrected"})
    copy.__dict__["origin"] = stage.origin
    return copy


def _refuse_thin_neck(
    stage: Stage,
    formula: str,
    freedoms: Freedoms,
    bodies: Array | None,
) -> None:
    """Refuse the thinnest neck of a stage that has a solution only with wider thin necks."""
    necks = design_arrays(stage).neck
    chain, position = np.unravel_index(np.argmin(necks[0]), (3, 3))
    trial = TRIAL_NECKS[(np.min(necks) < TRIAL_NECKS) & (np.max(necks) > TRIAL_NECKS)]
    wider = np.maximum(necks, trial[:, None, None])
    K = stiffness_with_necks(stage, wider, formula, freedoms, bodies)
    solvable = trial[~np.isnan(inverse(K)).any(axis=(1, 2))]
    if len(solvable):
        name = HINGE_NAMES[position]
        key = key_of(stage, int(chain) + 1, name, "neck_mm")
        neck = stage.hinge(int(chain) + 1, name).neck
        with naming_place(stage):
            raise BadInput(
                f"{key} = {neck:g}: this neck is so much thinner than others, of up to "
                f"{np.max(necks):g} mm, that the stiffness cannot be computed to working "
                f"precision, expected >= {solvable[0]:g}"
            )


def assemble(
    stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA
) -> PaperModel:
    """Return the paper's model of the stage, for any load and configuration.

    Arguments are those of `analyse`. Six other joints are dependent where the independent joints of
    the paper do not determine the rest.
    """
    freedoms = freedoms_of(mobility, design_arrays(stage).prismatic)
    model = mechanism(stage_frames(stage), hinge_compliance(stage, formula), freedoms)
    if np.isnan(stiffness(model).K_uu).any():
        return model._replace(choice=rank_revealing(model.frames, model.joints, model.springs))
    return model


def hinge_compliance(stage: Stage, formula: str = DEFAULT_FORMULA) -> Compliance:
    """Return the compliances of the nine hinges of one stage, fields (3 chains, 3 hinges).

    Raises BadInput for a stage that cannot be made, an unknown formula, and a hinge that the
    formula or the thickness chart of a "corrected" model does not cover."""
    check_closed_form(stage)
    with np.errstate(all="ignore"):  # invalid values are refused below
        hinges = hinge_compliances(design_arrays(stage), formula)
    for reason, valid in _is_valid(design_arrays(stage), formula, hinges).items():
        for chain, position in np.argwhere(~valid[0]).tolist():
            with naming_place(stage):
                raise BadInput(_refusal(reason, stage, formula, chain + 1, position))
    return Compliance(*(part[0] for part in hinges))


def _model_name(
    formula: str,
    links: bool,
    mobility: int,
    plane: Plane,
) -> str:
    freedoms = "elastic links" if links else f"mobility {mobility}"
    return f"{formula}, {freedoms}, {PLANES[plane]}"


def _refusal(
    reason: str,
    stage: Stage,
    formula: str,
    chain: int,
    position: int,
) -> str:
    """Return the text that refuses a hinge: key, value and expected values."""
    hinge = stage.hinge(chain, HINGE_NAMES[position])
    b = stage.thickness
    nu = stage.material.poissons_ratio
    tau = hinge.neck / hinge.radius
    neck = f"{key_of(stage, chain, HINGE_NAMES[position], 'neck_mm')} = {hinge.neck:g}"
    if reason == OFF_CHART:
        low, high = formulas.formula(formula).valid
        return (
            f"{neck}: t/R = {tau:.4g} is not on the hinge chart of formula {formula!r}, expected "
            f"{low:g} to {high:g}"
        )
    if reason == OFF_THICKNESS:
        values = f"t/R = {tau:.4g}, b/t = {b / hinge.neck:.4g}, nu = {nu:.4g}"
        ends = ", ".join(f"{low:g} to {high:g}" for low, high in chart.thickness_chart().ends)
        chart_of = 'the thickness chart of model = "corrected"'
        return f"{neck}: not on {chart_of} with {values}, expected {ends}"
    return (
        f"hinge formula {formula!r} has no positive compliance at t/R = {tau:.3g}, expected "
        "another one"
    )
