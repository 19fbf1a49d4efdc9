"""The front of three or more objectives, by pymoo."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.stats import qmc

from flexfem.arrays import Array
from flexfem.files.refusals import place_of
from flexfem.refused import BadInput
from flexfem.synthesis.front import in_turn
from flexfem.synthesis.mapping import content
from flexfem.synthesis.model import Model
from flexfem.synthesis.requirements import LoadedRequirements
from flexfem.synthesis.search import Say, beside
from flexfem.synthesis.store import Store

PARTITIONS = {2: 60, 3: 12, 4: 7}  # of an objective, between whose ends reference directions lie: 61, 91, 120
GENERATIONS = 120


def require_pymoo(loaded: LoadedRequirements) -> None:
    """Raise BadInput where a front of more than two objectives is asked and pymoo is not installed."""
    if len(loaded.requirements.objective) > 2 and find_spec("pymoo") is None:
        count = len(loaded.requirements.objective)
        raise BadInput(f"{place_of(loaded.path)}: objective: {count} of them need pymoo, expected flexfem[fronts]")


def front_of_many(
    model: Model, first: Array, count: int, seed: int, say: Say = lambda text: None, store: Store | None = None
) -> list[Array]:
    """As `front.front`, of any number of objectives; the best in each of them, and others far from each other.

    Notes
    -----
    NSGA-III: Deb, Jain, IEEE Trans. Evol. Comput. 18 (2014) 577-601. Beside the best in each objective that
    objective is made better, and beside each design that is chosen one after the other while the others are kept.
    """
    store, asked = store or Store(None), ["evolution", content(model), seed, first.tolist()]
    values, both = store.found(asked, model.counts, lambda: _evolved(model, first, seed, say))
    if not values:
        return []
    found = list[Array]()
    for place in apart(np.array(both), count):
        found.append(in_turn(model, np.array(values[place]), seed, store))
        say(f"front: {len(found)} of {count} designs, {model.counts['analytic']:,} by the analytic model")
    return found


class _Archive:
    """Designs (n, d) that meet all, can be drawn and that no other beats, with their objectives `both` (n, k)."""

    def __init__(self, model: Model) -> None:
        self.model, self.drawn = model, dict[bytes, bool]()
        self.values, self.both = np.empty((0, model.space.size)), np.empty((0, model.objectives))

    def judged(self, places: Array) -> tuple[Array, Array]:
        """Objectives (n, k), to be small, and what is missed (n, m) at places (n, d); the best ones are kept."""
        model = self.model
        values = model.space.snapped(model.space.of_unit(places))
        found = model.found(values)
        both = model.signed(found.quantities)
        missed = np.column_stack([model.violations(found), np.where(found.reason == "", 0.0, 100.0)])
        for k in np.flatnonzero(np.all(missed <= 0, axis=1)):
            if np.any(np.all(self.both <= both[k], axis=1)):
                continue
            key = values[k].tobytes()
            if key not in self.drawn:
                self.drawn[key] = model.drawable(values[k]) == ""
            if not self.drawn[key]:
                missed[k, -1] = 1.0
                continue
            stays = ~np.all(both[k] <= self.both, axis=1)
            self.values, self.both = np.vstack([self.values[stays], values[k]]), np.vstack([self.both[stays], both[k]])
        return np.where(np.isfinite(both), both, 0.0), np.where(np.isfinite(missed), missed, 100.0)


def _evolved(model: Model, first: Array, seed: int, say: Say) -> list[Any]:
    """Designs (n, d) that no other beats, and their objectives (n, k): by NSGA-III, and beside the best in each."""
    archive = _Archive(model)
    _evolve(archive, first, seed, say)
    if len(archive.values):
        for k in range(model.objectives):
            least = archive.values[[int(np.argmin(archive.both[:, k]))]]
            archive.judged(model.space.to_unit(beside(model.changed(objective=k), least, seed).values[None]))
    return [archive.values.tolist(), archive.both.tolist()]


def _evolve(archive: _Archive, first: Array, seed: int, say: Say) -> None:
    """Fill an archive by NSGA-III from a Sobol sample and the best design in the first objective (d,)."""
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.config import Config
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize
    from pymoo.util.ref_dirs import get_reference_directions

    Config.warnings["not_compiled"] = False
    model = archive.model
    d, k = model.space.size, model.objectives
    rows = archive.judged(model.space.to_unit(first[None]))[1].shape[1]

    class Asked(Problem):  # type: ignore[misc]
        def _evaluate(self, x: Array, out: dict[str, Array], *args: Any, **kwargs: Any) -> None:
            out["F"], out["G"] = archive.judged(x)
            say(f"front: {len(archive.values)} designs, {model.counts['analytic']:,} by the analytic model")

    directions = get_reference_directions("das-dennis", k, n_partitions=PARTITIONS[k])
    sample = qmc.Sobol(d, rng=np.random.default_rng(seed)).random(1 << int(np.ceil(np.log2(len(directions)))))
    sample[0] = np.clip(model.space.to_unit(first[None])[0], 0, 1)
    problem = Asked(n_var=d, n_obj=k, n_ieq_constr=rows, xl=np.zeros(d), xu=np.ones(d))
    minimize(problem, NSGA3(directions, sampling=sample), ("n_gen", GENERATIONS), seed=seed % 2**32, verbose=False)


def apart(both: Array, count: int) -> list[int]:
    """Places (at most `count`) of the least in every objective, then each the farthest from those before it.

    Parameters
    ----------
    both : (n, k). Distances are measured with all spans taken as one.
    """
    span = np.ptp(both, axis=0)
    scaled = (both - both.min(axis=0)) / np.where(span > 0, span, 1.0)
    found = list(dict.fromkeys(int(k) for k in np.argmin(both, axis=0)))[:count]
    while len(found) < min(count, len(both)):
        far = np.min(np.linalg.norm(scaled[:, None] - scaled[found], axis=2), axis=1)
        if not far.max() > 0:
            break
        found.append(int(np.argmax(far)))
    return sorted(found, key=lambda k: float(both[k, 0]))
