"""One stage through the analytic model."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic import notch, thick
from flexfem.analytic.mobility import Freedoms, freedoms_of, stage_freedoms
from flexfem.analytic.mobility import mobility as mobility_of
from flexfem.analytic.notch import ChartedFormula, Compliance, Formula
from flexfem.analytic.stiffness import Mechanism, mechanism, stiffness
from flexfem.arrays import Array
from flexfem.refused import BadInput, ComputationFailed
from flexfem.stage.checks import check_closed_form
from flexfem.stage.frames import stage_frames
from flexfem.stage.origin import located
from flexfem.stage.schema import HINGE_NAMES, Plane, elastic, key_of

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

DEFAULT_FORMULA = "paros-weisbord"


class AnalyticResult(NamedTuple):
    """The analytic model of one stage at rest.

    stiffness, compliance : (3, 3) of the platform in x, y, Phi: mm, N, rad.
    mobility : by (1).   freedoms : of each hinge, 3 chains by 3 hinges.   formula : name of the hinge formula.
    hinges : Compliance of the nine hinges, fields (3, 3).
    in_range : (3, 3), whether t/R is within the range of the formula.
    """

    stiffness: Array
    compliance: Array
    mobility: int
    freedoms: Freedoms
    formula: str
    hinges: Compliance
    in_range: NDArray[np.bool_]


def hinge_compliance(stage: Stage, formula: str = DEFAULT_FORMULA) -> Compliance:
    """Compliances of the nine hinges, fields (3 chains, 3 hinges).

    Raises BadInput for a stage that cannot be made, for an unknown formula, for one that is not even positive at some
    hinge's t/R, and for a chart that some hinge is not on: the formula's, or that of the thickness when the stage's
    model is "corrected".
    """
    check_closed_form(stage)
    radius, neck, entry = stage.array("radius"), stage.array("neck"), notch.formula(formula)
    with located(stage):
        _refuse_off_chart(stage, entry)
        _refuse_off_thickness(stage)
    b, material, width = stage.thickness, stage.material, stage.chain.link_width
    found = compliances(entry, stage.model, radius, neck, b, material.youngs_modulus, material.poissons_ratio, width)
    senseless = ~(np.minimum(np.minimum(found.rotation, found.axial), found.shear) > 0)
    if np.any(senseless):
        ratio = (neck / radius)[senseless][0]
        raise BadInput(
            f"hinge formula {formula!r} has no positive compliance at t/R = {ratio:.3g}, expected another one"
        )
    return found


def compliances(
    entry: Formula,
    plane: Plane,
    radius: ArrayLike,
    neck: ArrayLike,
    thickness: ArrayLike,
    youngs_modulus: ArrayLike,
    poissons_ratio: ArrayLike,
    block_height: ArrayLike,
) -> Compliance:
    """Compliances (...) of hinges by a formula in a plane model; mm, MPa; arguments broadcast; nan off a chart."""
    constants = elastic(plane, youngs_modulus, poissons_ratio)
    found = entry.compliance(radius, neck, thickness, *constants, block_height=block_height)
    if plane != "corrected":
        return found
    factors = thick.factors(radius, neck, thickness, poissons_ratio)
    return Compliance(*(one * factor for one, factor in zip(found, factors, strict=True)))


def _refuse_off_thickness(stage: Stage) -> None:
    """Raise BadInput naming the first hinge of a corrected stage that is not on the thickness chart."""
    if stage.model != "corrected":
        return
    nu, b = stage.material.poissons_ratio, stage.thickness
    for chain, name in ((chain, name) for chain in (1, 2, 3) for name in HINGE_NAMES):
        hinge = stage.hinge(chain, name)
        if not thick.covers(hinge.radius, hinge.neck, b, nu):
            values = zip(("t/R", "b/t", "nu"), (hinge.neck / hinge.radius, b / hinge.neck, nu), strict=True)
            ends = thick.thickness_chart()[:3]
            raise BadInput(
                f"{key_of(stage, chain, name, 'neck_mm')} = {hinge.neck:g}: not on the thickness chart of model = "
                f'"corrected" with {", ".join(f"{axis} = {value:.4g}" for axis, value in values)}, expected '
                f"{', '.join(f'{low:g} to {high:g}' for low, high in ends)}"
            )


def _refuse_off_chart(stage: Stage, entry: Formula) -> None:
    """Raise BadInput naming the first hinge that is not on the chart of a charted formula, its value and the range."""
    if not isinstance(entry, ChartedFormula):
        return
    off = f"is not on the hinge chart of formula {entry.name!r}"
    for chain, name in ((chain, name) for chain in (1, 2, 3) for name in HINGE_NAMES):
        hinge = stage.hinge(chain, name)
        ratio = hinge.neck / hinge.radius
        if not entry.in_range(hinge.radius, hinge.neck):
            raise BadInput(
                f"{key_of(stage, chain, name, 'neck_mm')} = {hinge.neck:g}: t/R = {ratio:.4g} {off}, "
                f"expected {entry.valid[0]:g} to {entry.valid[1]:g}"
            )


def assemble(stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA) -> Mechanism:
    """The stage as springs and joints, for loaded and displaced configurations; arguments as for `analyse`."""
    return mechanism(stage_frames(stage), hinge_compliance(stage, formula), _freedoms(stage, mobility))


def analyse(stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA) -> AnalyticResult:
    """Platform stiffness of a stage at rest.

    Parameters
    ----------
    mobility : 3, 6, 12 or 21; None takes the prismatic hinges of the stage itself.
    formula : a name in `notch.FORMULAS`.

    Raises
    ------
    BadInput: mobility or formula not known.
    ComputationFailed: the stage is at a singular configuration.
    """
    freedoms = _freedoms(stage, mobility)
    hinges = hinge_compliance(stage, formula)
    at_rest = stiffness(mechanism(stage_frames(stage), hinges, freedoms))
    if np.isnan(at_rest.K_uu).any():
        what = "its loops do not fix the dependent joints" if np.isnan(at_rest.influence.G_u).any() else "K_uu"
        raise ComputationFailed(f"stage {stage.name!r} is at a singular configuration at rest: {what}")
    in_range = notch.formula(formula).in_range(stage.array("radius"), stage.array("neck"), stage.chain.link_width)
    return AnalyticResult(at_rest.K_uu, at_rest.C_uu, mobility_of(freedoms), freedoms, formula, hinges, in_range)


def _freedoms(stage: Stage, mobility: int | None) -> Freedoms:
    return stage_freedoms(stage.array("prismatic")) if mobility is None else freedoms_of(mobility)
