"""Where no design meets all requirements: by how much each of them alone would have to give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexfem.arrays import Array
from flexfem.synthesis.model import ROUND_OFF, WORST, Found, Model
from flexfem.synthesis.result import SoleRelaxation
from flexfem.synthesis.search import optimum


@dataclass
class Yielding(Model):
    """The model of requirements one of which, `yielding`, is not asked: its miss is what is to be small instead."""

    yielding: int = 0

    def wanted(self, found: Found) -> Array:
        """By how much of its size the one requirement is missed (n,)."""
        return np.maximum(0.0, -self.margins(found)[self.yielding])

    def violations(self, found: Found) -> Array:
        """As of every model, that of the one requirement left out."""
        missed = super().violations(found)
        missed[:, self.yielding] = 0.0
        return missed


def alternatives(model: Model, near: Array, seed: int) -> Iterator[SoleRelaxation]:
    """For every requirement the smallest relaxation that is enough when the others are kept, by a search each."""
    of = model.loaded.requirements.require
    for k, each in enumerate(of):
        alone = Yielding(
            model.loaded, model.corrections, model.shifts, objective=model.objective, bounded=model.bounded,
            counts=model.counts, yielding=k,
        )  # fmt: skip
        best = optimum(alone, seed, near)
        if best.merit >= WORST:
            yield SoleRelaxation(requirement=each.said, relax_to=None, percent=None)
            continue
        found = alone.found(best.values[None])
        value = float(found.quantities[0, model.objectives + k])
        missed = float(alone.wanted(found)[0])
        yield SoleRelaxation(requirement=each.said, relax_to=value, percent=100 * missed if missed > ROUND_OFF else 0.0)
