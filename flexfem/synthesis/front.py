"""What one objective costs in the other: the best designs between both ends, solved by finite elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.mapping import proof
from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.search import Say, optimum


def front(model: Model, count: int, seed: int, say: Say = lambda text: None) -> list[Array]:
    """Designs (d,) that no other beats in both objectives, from the best in the first to the best in the second.

    Notes
    -----
    The first objective is best while the second keeps one of `count` bounds, evenly between its ends (the method of
    bounded objectives: Haimes, Lasdon, Wismer, IEEE Trans. Syst. Man Cybern. 1 (1971) 296-297).
    """
    ends = [optimum(model.changed(objective=k), seed, None, say) for k in range(2)]
    if any(end.merit >= WORST for end in ends):
        return []
    second = model.changed(objective=1)
    worst, best = (float(second.wanted(model.found(end.values[None]))[0]) for end in ends)
    found = [ends[0].values]
    for bound in np.linspace(worst, best, count)[1:-1]:
        between = optimum(model.changed(bounded={1: float(bound)}), seed, found[-1], say)
        if between.merit < WORST:
            found.append(between.values)
    return best_of(model, [*found, ends[1].values])


def best_of(model: Model, designs: list[Array]) -> list[Array]:
    """Those of some designs that no other beats in both objectives, in the order of the first."""
    found = model.found(np.array(designs))
    both = np.column_stack([model.changed(objective=k).wanted(found) for k in range(2)])
    kept = [
        k
        for k, own in enumerate(both)
        if not any(np.all(other <= own) and np.any(other < own) for other in both)
        and not any(np.array_equal(own, other) for other in both[:k])
    ]
    return [designs[k] for k in sorted(kept, key=lambda k: both[k, 0])]


class OnFront(NamedTuple):
    """A design (d,) with its objectives by finite elements and as predicted, and whether every end is kept."""

    values: Array
    elements: Array
    predicted: Array
    met: bool


def proven(model: Model, elements: ProposedElements, designs: list[Array], say: Say) -> list[OnFront]:
    """Solve designs by finite elements."""
    low, high = model.changed(guard=None).ends
    found = []
    for values in designs:
        of = proof(model, elements, values, say)
        q, band = of.elements[model.objectives :], of.bands[model.objectives :]
        met = bool(np.all((q + band >= low) & (q - band <= high)))
        found.append(OnFront(values, of.elements[: model.objectives], of.predicted[: model.objectives], met))
    return found
