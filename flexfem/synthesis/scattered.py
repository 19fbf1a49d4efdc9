"""Couplings under tolerance as they are stated: of stages that no search has seen, corrected by finite elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.study.loaded import designs_of
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.requirements import SCATTERED, LoadedRequirements
from flexfem.synthesis.scatter import ElementFit, QuantileInterval, bounded, fitted
from flexfem.synthesis.search import Say


class ScatteredStages(NamedTuple):
    """The couplings of `SCATTERED` (4,) of a design, of other stages than it was searched with.

    searched : by the model, of the stages that it was searched with.   others : by the model, with their interval.
    fits : by mesh, of finite elements to the model in the stages that both solve; empty without finite elements.
    """

    searched: Array
    others: QuantileInterval
    fits: list[ElementFit]

    @property
    def shifts(self) -> dict[str, float]:
        """By name, what makes values of the stages searched with those of the others."""
        return _named(self.others.value / self.searched)

    @property
    def columns(self) -> list[dict[str, float]]:
        """By name on every mesh, coarse to fine; of the model where no finite elements are asked."""
        return [_named(self.others.value * fit.factor) for fit in self.fits] or [_named(self.others.value)]

    @property
    def half_widths(self) -> Array:
        """By how much sampling may be off (4,): half the interval of the stages, and the misfit of those checked."""
        value, low, high = self.others
        own = np.maximum(high - value, value - low)
        return own * self.fits[-1].factor + self.fits[-1].misfit if self.fits else own

    @property
    def ends(self) -> list[dict[str, float]]:
        """The last of `columns` less and more the half-widths."""
        value = np.array([*self.columns[-1].values()])
        return [_named(value + side * self.half_widths) for side in (-1.0, 1.0)]


def scattered_stages(
    loaded: LoadedRequirements, elements: ProposedElements, values: Array, say: Say
) -> ScatteredStages | None:
    """Answer a design (d,) whose nine necks scatter; None where that is not asked. Raises ComputationFailed."""
    scatter = loaded.scatter
    if scatter is None:
        return None
    designs = designs_of(loaded.study, values[None])
    model = scatter.couplings(loaded.study, designs, scatter.others)
    elements.counts["analytic with scattered necks"] += model.shape[-1]
    meshes = elements.scattered(values, say) or []
    fits = [fitted(found, model[:, : found.shape[-1]]) for found in meshes]
    return ScatteredStages(scatter.searched_values(loaded.study, designs)[0], bounded(model), fits)


def _named(values: Array) -> dict[str, float]:
    return dict(zip(SCATTERED, map(float, values), strict=True))
