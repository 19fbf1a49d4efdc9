"""What requirements may ask beside the columns of a study: mass, coupling under tolerance, error of a formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexfem.analytic.kinematics import Freedoms, freedoms_of, stage_freedoms
from flexfem.analytic.model import hinge_compliances
from flexfem.arrays import AnyArray, Array
from flexfem.refused import BadInput
from flexfem.stage.designs import Designs
from flexfem.stage.inertia import drawn_inertia
from flexfem.stage.schema import HINGE_NAMES
from flexfem.study.columns import Column, Factor
from flexfem.study.designs import stage_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.sampling import sample
from flexfem.study.tables import Sampling
from flexfem.synthesis.tables import Tolerance
from flexfem.units import UNITS
from flexfem.verify.errors import error_matrix
from flexfem.verify.questions import ask_formulas

LEVEL = 0.95  # of stages whose coupling is at most the one that is asked


def scattered_study(loaded: LoadedStudy, tolerance: Tolerance, stages: int, seed: int) -> LoadedStudy:
    """The study of a stage, that of `loaded`, with nine necks that scatter about its own."""
    columns = []
    for chain in (1, 2, 3):
        for name in HINGE_NAMES:
            path, neck = f"override.{chain}.{name}.neck_mm", loaded.stage.hinge(chain, name).neck
            about = {"distribution": "normal", "mean": neck, "sd": 1e-3 * tolerance.neck_um}
            columns.append(Column(path, (path,), Factor.model_validate({"key": path} | about)))
    sampling = Sampling(method="monte_carlo", designs=stages, seed=seed)
    changes = {"factor": tuple(column.factor for column in columns), "sampling": sampling, "drive": None}
    changes |= {"frequencies": None, "life": None, "drift": None}
    return replace(loaded, study=loaded.study.model_copy(update=changes), columns=tuple(columns), given=None)


def offsets(loaded: LoadedStudy, tolerance: Tolerance, seed: int, stages: int | None = None) -> Array:
    """Deviations (stages, 3, 3) of the nine necks, mm: those of `scattered_study`, whatever the stage."""
    stages = tolerance.stages if stages is None else stages
    study = scattered_study(loaded, tolerance, stages, seed)
    own = np.array([column.factor.mean for column in study.columns])
    return np.asarray((sample(study, 0, stages) - own).reshape(-1, 3, 3))


def quantiles_of(couplings: Array) -> Array:
    """Of |couplings| (..., stages, 3) the 95 % values (..., 4): of each, and of the largest of the three."""
    size = np.abs(couplings)
    every = np.concatenate([size, size.max(axis=-1, keepdims=True)], axis=-1)
    return np.asarray(np.quantile(every, LEVEL, axis=-2))


def scattered_coupling(loaded: LoadedStudy, designs: Designs, deviations: Array) -> Array:
    """The 95 % values (n, 4) of n designs whose necks deviate by `deviations` (stages, 3, 3), mm; nan off a chart."""
    n, stages = len(designs.thickness), len(deviations)
    many = designs.chosen(np.repeat(np.arange(n), stages))
    many.neck[:] += np.tile(deviations, (n, 1, 1))
    found = ask_formulas(many, hinge_compliances(many, loaded.study.formula), freedoms(loaded, many))
    return quantiles_of(found.coupling.reshape(n, stages, 3))


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
