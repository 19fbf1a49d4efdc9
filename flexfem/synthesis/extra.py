"""What requirements may ask beside the columns of a study: mass and error of a formula."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import hinge_compliances
from flexfem.analytic.paper import Freedoms, freedoms_of, stage_freedoms
from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.bodies import drawn_inertia
from flexfem.mechanism.designs import Designs
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.study.loaded import LoadedStudy, stage_of
from flexfem.units import UNITS
from flexfem.verify.questions import ask_formulas


def formula_errors(designs: Designs, stiffness: Array, formula: str) -> Array:
    """Errors (n, 3), %, along x, y, theta of the force that a formula with the stage's own mobility gives.

    stiffness : (n, 3, 3), of the model that answers.
    """
    paper = ask_formulas(designs, hinge_compliances(designs, formula), stage_freedoms(designs.prismatic)).stiffness
    found, sound = np.full((len(stiffness), 3), np.nan), np.isfinite(stiffness).all(axis=(1, 2))
    percent = error_matrix(
        paper[sound], np.asarray(np.linalg.inv(stiffness[sound]), dtype=np.float64), np.ones(int(sound.sum()))
    )
    found[sound] = np.diagonal(percent, axis1=1, axis2=2)
    return found


def masses(loaded: LoadedStudy, values: Array, reason: AnyArray) -> Array:
    """Masses (n,), kg, of what is drawn; reasons why a design cannot be go to `reason` (n,)."""
    found = np.full(len(values), np.nan)
    for k in np.flatnonzero(reason == ""):
        try:
            found[k] = float(drawn_inertia(stage_of(loaded, values[k])).mass) * UNITS["kg"].factor
        except BadInput as refusal:
            reason[k] = str(refusal)
    return found


def freedoms(loaded: LoadedStudy, designs: Designs) -> Freedoms:
    """Freedoms of the hinges of designs in the model of a study."""
    mobility = loaded.study.mobility
    return stage_freedoms(designs.prismatic) if mobility is None else freedoms_of(mobility)
