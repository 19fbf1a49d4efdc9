"""What one objective costs in the other: the best designs between both ends, solved by finite elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, wide
from flexfem.study.findings import spread
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.mapping import content, proof, searched
from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.search import Say, beside
from flexfem.synthesis.store import Store
from flexfem.synthesis.surface import sketched

KEPT = 1e-6  # part of an objective within which it is kept: room for programs at the end of a range


def front(
    model: Model, first: Array, count: int, seed: int, say: Say = lambda text: None, store: Store | None = None
) -> list[Array]:
    """Designs (d,) that no other beats in both objectives, from the best in the first to the best in the second.

    Parameters
    ----------
    first : (d,), the best in the first objective.   store : of what was found before the search was stopped.

    Notes
    -----
    The first objective is best while the second keeps a bound, `count` of them about evenly along the front (the method
    of bounded objectives: Haimes, Lasdon, Wismer, IEEE Trans. Syst. Man Cybern. 1 (1971) 296-297). Response surfaces
    say where it begins; for every bound all is searched, because bodies that overlap part what can be made.
    """
    store = store or Store(None)
    asked = ["sketch", content(model), seed]
    near = np.vstack([first, store.found(asked, model.counts, lambda: sketched(model, seed, say=say).tolist())])
    ends = [beside(model, near[:2], seed), searched(model.changed(objective=1), seed, near[-1], store, say)]
    if any(end.merit >= WORST for end in ends):
        return []
    first, last = (in_turn(model, end.values, seed, store) for end in ends)
    near = np.vstack([ends[0].relaxed, near, ends[1].relaxed])
    near = np.array(best_of(model, list(near[model.merit(model.found(near)) < WORST])))
    found, along = [first], model.signed(model.found(near).quantities)
    for k in spread(_drawn(along[:, 0]), _drawn(along[:, 1]), count)[1:-1]:
        between = searched(model.changed(bounded={1: float(along[k, 1])}), seed, near[k], store, say)
        if between.merit < WORST:
            found.append(between.values)
        say(f"front: {len(found)} of {count} designs, {model.counts['analytic']:,} by the analytic model")
    return best_of(model, [*found, last])


def in_turn(model: Model, values: Array, seed: int, store: Store) -> Array:
    """The design (d,) beside `values` that is best in one objective after the other while the others are kept."""
    asked = ["in turn", content(model), seed, values.tolist()]
    return np.array(store.found(asked, model.counts, lambda: _in_turn(model, values, seed).tolist()))


def _in_turn(model: Model, values: Array, seed: int) -> Array:
    for k in range(model.objectives):
        own = model.signed(model.found(values[None]).quantities)[0]
        kept = {j: float(x + KEPT * abs(x)) for j, x in enumerate(own) if j != k}
        bounded = model.changed(objective=k, bounded=kept)
        best = beside(bounded, values[None], seed)
        if best.merit < float(bounded.merit(bounded.found(values[None]))[0]):
            values = best.values
    return values


def _drawn(values: Array) -> Array:
    """An objective (n,), its logarithm where it is wide: as designs are far apart on a figure."""
    return np.asarray(np.log(np.abs(values)) if wide(np.abs(values)) else values)


def best_of(model: Model, designs: list[Array]) -> list[Array]:
    """Those of some designs that no other beats in all objectives, in the order of the first."""
    both = model.signed(model.found(np.array(designs)).quantities)
    kept = [
        k
        for k, own in enumerate(both)
        if not any(np.all(other <= own) and np.any(other < own) for other in both)
        and not any(np.array_equal(own, other) for other in both[:k])
    ]
    return [designs[k] for k in sorted(kept, key=lambda k: both[k, 0])]


class OnFront(NamedTuple):
    """A design (d,) with its objectives by finite elements and as predicted.

    margins : (m,), of the requirements over their sizes.   met : whether every end is kept, within its band.
    """

    values: Array
    elements: Array
    predicted: Array
    margins: Array
    met: bool


def proven(model: Model, elements: ProposedElements, designs: list[Array], say: Say) -> list[OnFront]:
    """Solve designs by finite elements."""
    low, high = model.changed(guard=None).ends
    k, found = model.objectives, []
    for values in designs:
        of = proof(model, elements, values, say)
        q, band = of.elements[k:], of.bands[k:]
        margins = np.minimum(q - low, high - q)
        met = bool(np.all(margins >= -band))
        found.append(OnFront(values, of.elements[:k], of.predicted[:k], margins / model.scales, met))
    return found
