"""Designs of the stage: mass, errors of the paper's model, scatter of the necks, and warnings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import cast

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.design.kind import DesignKind, ScatteredDesigns, ScatterSolver
from flexfem.design.requirements import MASS, SCATTERED, LoadedRequirements
from flexfem.design.scatter import CouplingQuantiles, coupling_quantiles
from flexfem.hinges.strength import required_law
from flexfem.paper.batch import StageBatch, for_stages
from flexfem.paper.bodies import drawn_inertia
from flexfem.paper.commanding import commanding, push_spread
from flexfem.paper.designs import Designs
from flexfem.paper.equations import freedoms_of
from flexfem.paper.model import at_rest, best_model, hinge_compliances
from flexfem.paper.scatter import REFUSED, NeckScatter
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions.bands import error_matrix
from flexfem.study import columns as outputs_of_study
from flexfem.study.answer import with_warnings
from flexfem.study.columns import ENGAGED, ERRORS, LIFE_AMPLITUDES, STIFFNESSES
from flexfem.study.factors import Factor, columns_of
from flexfem.study.loaded import mechanism_of
from flexfem.units import UNITS, short, unit_of

# indices into the columns of stiffness of the entries of the matrix
IN_MATRIX = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
WITH_SCATTER = "analytic with scattered necks"  # name of a count


def design_kind(loaded: LoadedRequirements) -> StageDesignKind:
    """Return what the design of a stage has beyond its study."""
    return StageDesignKind(loaded)


class StageDesignKind(DesignKind):
    """What requirements on a stage can use beyond the outputs of its study."""

    @cached_property
    def scatter(self) -> NeckScatter | None:
        """Scatter of the nine necks if a coupling under tolerance is requested, else None."""
        required = self.required
        if required.tolerance is None or not required.used & {*SCATTERED}:
            return None
        return NeckScatter.drawn(required.tolerance, required.seed)

    def _designs(self, values: Array) -> Designs:
        batch = cast(StageBatch, self.loaded.family.batch)
        return batch.designs(values)

    def columns(
        self,
        values: Array,
        outputs: Mapping[str, Array],
        reason: AnyArray,
        counts: Counter[str],
    ) -> dict[str, Array]:
        """Return mass, errors of the paper's model and couplings under tolerance, as far as used."""
        used = self.required.used
        columns = dict[str, Array]()
        if used & {*MASS}:
            counts["drawn"] += int(np.sum(reason == ""))
            columns["mass_kg"] = UNITS["kg"].factor * self._masses(values, reason)
        if used & {*ERRORS}:
            K = np.array([outputs[name] for name in STIFFNESSES]).T[:, IN_MATRIX]
            errors = formula_errors(self._designs(values), K, self.required.paper_formula)
            columns |= dict(zip(ERRORS, errors.T, strict=True))
        if self.scatter is not None:
            counts[WITH_SCATTER] += len(values) * len(self.scatter.searched)
            couplings = self.scatter.quantiles(
                self._designs(values), self.required.formula, self.required.mobility
            )
            reason[(reason == "") & np.isnan(couplings).any(axis=1)] = REFUSED
            columns |= dict(zip(SCATTERED, couplings.T, strict=True))
        return columns

    def _masses(
        self,
        values: Array,
        reason: AnyArray,
    ) -> Array:
        """Return the masses (n,), tonne, nan where a stage cannot be drawn."""
        drawn = for_stages(
            lambda k: cast(Stage, mechanism_of(self.loaded, values[k])),
            reason,
            lambda stage: float(drawn_inertia(stage)[0, 0]),
        )
        return np.array([drawn.get(k, np.nan) for k in range(len(values))])

    def quantiles(
        self, values: Array, solver: ScatterSolver, counts: Counter[str]
    ) -> CouplingQuantiles | None:
        """Return the couplings of a design (d,) under tolerance, None if they are not requested."""
        required = self.required
        if self.scatter is None or required.tolerance is None:
            return None
        design = self._designs(values[None])
        couplings = self.scatter.couplings(design, required.formula, required.mobility)
        counts[WITH_SCATTER] += couplings.shape[-1]
        checked = 0 if self.loaded.solid else required.tolerance.checked
        if not checked:
            return coupling_quantiles(couplings, [])
        return coupling_quantiles(
            couplings, solver.solve_scattered(values, self.scatter.others[:checked])
        )

    def scattered(
        self,
        values: Array,
        off: Array,
    ) -> ScatteredDesigns:
        """Return the designs of deviations `off` (n, 3, 3) of the nine necks, mm, from a design."""
        stage = cast(Stage, mechanism_of(self.loaded, values))
        hinges = list(product(CHAINS, HINGE_NAMES))
        columns = columns_of(
            Factor(key=f"override.{k}.{name}.neck_mm", values=(0.5,)) for k, name in hinges
        )
        necks = [stage.hinge(*hinge).neck for hinge in hinges]
        study = replace(self.loaded, base=stage, columns=columns)
        return ScatteredDesigns(study, off.reshape(-1, 9) + necks)

    def relative_spread(self, values: Array) -> dict[str, float]:
        """Return relative changes of the engaged stiffness with the spread of actuator forces."""
        stage = cast(Stage, mechanism_of(self.loaded, values))
        driven = commanding(best_model(stage, []))
        relative = push_spread(driven) / driven.system.stiffness
        return dict(zip(ENGAGED, map(float, relative), strict=True))

    def warnings(
        self,
        values: Array,
        columns: Mapping[str, float],
        first_gap: float,
    ) -> list[str]:
        """Return warnings about a design (d,): outside the range of a model, or not checked."""
        required = self.required
        loaded = self.loaded
        row = outputs_of_study.row_of("ok", "", [columns[name] for name in loaded.outputs])
        reason = str(with_warnings(loaded, values[None], row).reason[0])
        warnings = reason.split("; ") if reason else []
        warnings += self._warnings_of_life(columns)
        tolerance = required.tolerance
        if required.used & {*SCATTERED} and tolerance is not None and not tolerance.checked:
            warnings.append(
                "coupling under tolerance is by the analytic model alone: tolerance.checked is 0"
            )
        return warnings

    def _warnings_of_life(self, columns: Mapping[str, float]) -> Iterator[str]:
        """Warn of amplitudes for a required life outside its law or beyond yield."""
        life = self.required.life
        amplitudes = [
            name for name in LIFE_AMPLITUDES if name in columns and name in self.required.used
        ]
        if life is None or not amplitudes:
            return
        low, high = required_law(self.loaded.base.material).range
        subject = f"amplitudes for {short(life.cycles)} cycles"
        if not low <= life.cycles <= high:
            outside = f"outside the {short(low)} to {short(high)} cycles of Basquin's law"
            yield f"{subject} are extrapolated, {outside}"
        name = amplitudes[0]
        moved = abs(life.amplitude[LIFE_AMPLITUDES.index(name)]) * unit_of(name).factor
        if columns["safety_factor"] * moved < columns[name]:  # mean and amplitude grow together
            yield f"{subject} are computed from elastic stress, beyond yield"


def formula_errors(
    designs: Designs,
    stiffness: Array,
    formula: str,
) -> Array:
    """Return the errors (n, 3), %, along x, y, theta of a model with a hinge formula and the
    stage's own mobility.

    stiffness : (n, 3, 3), the reference for the errors; nan without a solution.
    """
    freedoms = freedoms_of(None, designs.prismatic)
    paper = at_rest(designs, hinge_compliances(designs, formula), freedoms).stiffness
    errors = np.full((len(stiffness), 3), np.nan)
    solved = np.isfinite(stiffness).all(axis=(1, 2))
    reference = np.asarray(np.linalg.inv(stiffness[solved]))
    percent = error_matrix(paper[solved], reference, np.ones(int(solved.sum())))
    errors[solved] = np.diagonal(percent, axis1=1, axis2=2)
    return errors
