"""The hinge formulas and charts beside one another: what is known of each, and how far it is from finite elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.hinges.chart import thickness_chart, thickness_factors
from flexfem.hinges.formulas import FORMULAS, formula

POINTS = 121  # of a curve
HIGHEST = 1e6  # H/h that is asked for; the chart has no largest
THICKNESSES, RATIOS = (0.5, 50.0), (0.02, 0.1, 0.3, 1.0)  # b/t from and to, and t/R, of the review of the thickness


class KnownFormula(NamedTuple):
    """What is known of a hinge formula: freedoms that its source states, range of t/R, source, how sure its form is."""

    freedoms: tuple[str, ...]
    t_over_R: tuple[float, float]  # noqa: N815 as the equations call it
    source: str
    status: str


class FormulaCurve(NamedTuple):
    """A formula over finite elements of a full notch, H = h.

    name : in the registry.   valid : smallest and largest t/R it is meant for.
    rotation, axial, shear : (n,), ratios of compliances; None for a freedom that its source does not state.
    """

    name: str
    valid: tuple[float, float]
    rotation: Array | None
    axial: Array | None
    shear: Array | None


class HingeReview(NamedTuple):
    """Every formula over the finite elements of the hinge chart.

    ratio : (n,), t/R, ascending.   curves : the formulas.
    height : H/h of the higher blocks.   higher : finite elements with those over finite elements with H = h.
    poissons_ratio : for the shear compliances.   source : of the finite elements, one line.
    """

    ratio: Array
    curves: Sequence[FormulaCurve]
    height: float
    higher: FormulaCurve
    poissons_ratio: float
    source: str


class ThicknessReview(NamedTuple):
    """Three-dimensional over plane-stress compliance of the hinge, over its thickness.

    width : (n,), b/t, ascending.   ratio : (k,), t/R, one curve each.   poissons_ratio : of the material.
    rotation, axial : (k, n), compliances in three dimensions over those in plane stress.
    marked : hinges of a stage, what they are called to their t/R, b/t and factors in rotation and axially.
    source : of the factors, one line.
    """

    width: Array
    ratio: Array
    poissons_ratio: float
    rotation: Array
    axial: Array
    marked: Mapping[str, tuple[float, float, float, float]]
    source: str


def known_formulas() -> dict[str, KnownFormula]:
    """What is known of every hinge formula, by name: freedoms, range of t/R, source; the user's own are among them."""
    return {name: KnownFormula(f.freedoms, f.valid, f.source, f.status) for name, f in FORMULAS.items()}


def hinge_review(height: float = 3.0, poissons_ratio: float = 0.3) -> HingeReview:
    """Every formula over the calibrated hinge, the hinge chart: plane-stress finite elements. Raises BadInput.

    Parameters
    ----------
    height : H/h, of the blocks over the notch, from 1 to 1e6.   poissons_ratio : from 0 to 0.5, acts on shear alone.
    """
    height = arguments.between("height", height, 1.0, HIGHEST)
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, 0.0, 0.5)
    ratio = np.geomspace(*FORMULAS["calibrated"].valid, POINTS)
    full = formula("calibrated").compliance(1.0, ratio, 1.0, 1.0, poissons_ratio)  # H = h; nan off the chart

    def curve(name: str) -> FormulaCurve:
        own = FORMULAS[name].compliance(1.0, ratio, 1.0, 1.0, poissons_ratio, height * (2.0 + ratio))
        parts = zip(("rotation", "axial", "shear"), own, full, strict=True)
        values = (one / other if freedom in FORMULAS[name].freedoms else None for freedom, one, other in parts)
        return FormulaCurve(name, FORMULAS[name].valid, *values)

    published = [curve(name) for name in FORMULAS if name != "calibrated"]
    return HingeReview(ratio, published, height, curve("calibrated"), poissons_ratio, FORMULAS["calibrated"].source)


def thickness_review(poissons_ratio: float = 0.33) -> ThicknessReview:
    """Three-dimensional over plane-stress compliance of the hinge, over its thickness, for necks slender to stout.

    Parameters
    ----------
    poissons_ratio : on the thickness chart, from 0.1 to 0.45; BadInput for another.
    """
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, *thickness_chart().ends[2])
    width, ratio = np.geomspace(*THICKNESSES, POINTS), np.array(RATIOS)
    found = thickness_factors(1.0 / ratio[:, None], 1.0, width, poissons_ratio)
    source = "three-dimensional finite elements of one hinge, our own (flexfem/data/thickness_chart.json)"
    return ThicknessReview(width, ratio, poissons_ratio, found.rotation, found.axial, {}, source)
