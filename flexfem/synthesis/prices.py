"""What the requirements at an optimum cost, and how every quantity follows every dimension."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.search import refined

ACTIVE = 2e-4  # part of its size within which a requirement is kept just so, at the optimum without steps
MORE = (0.01, 0.001)  # by which a requirement is tightened: by less where no design keeps more
STEP = 1e-4  # of a dimension
END = 1e-4  # of a range within which a dimension is at its end


class Prices(NamedTuple):
    """At the optimum without steps: whether each requirement (m,) is active, and what 1 % more of it costs.

    price : (m,), by how many per cent of itself the objective gets worse; nan where it is not active, or where
        no design near the optimum keeps 0.1 % more; at the rate of what one keeps where none keeps 1 %.
    at_ends : dimensions at an end of their range.
    """

    active: list[bool]
    price: Array
    at_ends: list[str]


def prices(model: Model, relaxed: Array) -> Prices:
    """Tighten the active end of every such requirement by 1 % of its size, or by less, and solve anew without steps."""
    model = model.changed(guard=None)
    base, merit = refined(model, relaxed)
    m = len(model.scales)
    found = model.found(base[None])
    low, high = model.ends
    q = found.quantities[0, model.objectives :]
    slack = np.minimum(q - low, high - q) / model.scales
    active = [bool(abs(each) <= ACTIVE) for each in slack]
    price = np.full(m, np.nan)
    for k in np.flatnonzero(active) if merit < WORST and merit != 0 else ():
        side = 1.0 if q[k] - low[k] <= high[k] - q[k] else -1.0
        for more in (min(each, model.room[k] / model.scales[k]) for each in MORE):
            _, worse = refined(model.changed(tightened={int(k): side * more}), base)
            if worse < WORST:
                price[k] = (worse - merit) / abs(merit) / more
                break
    u = model.space.to_unit(base[None])[0]
    named = zip(model.space.dimensions, u, strict=True)
    ends = [each.name for each, place in named if not each.listed and not END < place < 1 - END]
    return Prices(active, price, ends)


def sensitivities(model: Model, values: Array) -> Array:
    """Change (d, q) of the quantities of a design in per cent for 1 % of each dimension; nan where lost.

    Central, and where one side has no answer, as at bodies that touch, by the other.
    """
    d = len(values)
    steps = np.diag(STEP * values)
    around = model.found(np.vstack([values - steps, values + steps, values[None]])).quantities
    with np.errstate(all="ignore"):
        both = (around[d : 2 * d] - around[:d]) / (2 * STEP)
        one = np.where(np.isnan(around[:d]), around[d : 2 * d] - around[-1], around[-1] - around[:d]) / STEP
        return np.asarray(np.where(np.isnan(both), one, both) / around[-1])
