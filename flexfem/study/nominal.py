"""The base stage itself, answered as if it were a design of the study."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexfem.stage.keys import keys
from flexfem.study.answer import answer
from flexfem.study.derived import judge
from flexfem.study.factors import Factor, columns_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.tables import Sampling

FIXED = "thickness_mm"  # every stage gives it; the one factor of a study that varies nothing


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Outputs of the base stage by column, and the factors it has one value of; no outputs when it has no answer."""
    factors = (Factor.model_validate({"key": FIXED, "values": [keys()[FIXED].value_in(loaded.stage)]}),)
    changes = {"factor": factors, "sampling": Sampling(method="grid"), "bands": False}
    changes |= {"correlation": (), "constraint": ()}
    study = loaded.study.model_copy(update=changes)
    alone = replace(loaded, study=study, columns=columns_of(factors), given=None)
    rows = answer(alone, 0, 1)
    found = own_values(loaded)
    if rows.status[0] == "ok":
        found |= dict(zip(study.outputs, map(float, rows.values[0]), strict=True))
        found |= _derived(alone, found)
    return found


def _derived(alone: LoadedStudy, found: dict[str, float]) -> dict[str, float]:
    """Derived outputs of the base stage, those that are finite."""
    columns = {name: np.array([value]) for name, value in found.items()} | {
        FIXED: np.array([keys()[FIXED].value_in(alone.stage)])
    }
    every = judge(alone, columns, np.array([True])).derived
    return {name: float(value[0]) for name, value in every.items() if np.isfinite(value[0])}


def own_values(loaded: LoadedStudy) -> dict[str, float]:
    """The base stage's values of the factors, in file units, by column; none where its keys differ."""
    found = {}
    for column in loaded.columns:
        values = {keys()[path].value_in(loaded.stage) for path in column.keys}
        value = values.pop()
        if not values and value is not None:
            found[column.name] = value
    return found
