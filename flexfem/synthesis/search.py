"""The search for the best design: differential evolution everywhere, sequential quadratic programming, then steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from flexfem.arrays import AnyArray, Array
from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.programs import programmed

STARTS = 1024  # designs of a Sobol sample that the search begins with
LEAST, MOST, EACH = 24, 96, 12  # designs of a generation: so many a dimension, between these ends
GENERATIONS, AGREED = 150, 1e-4  # at most; the spread of a generation's merits over their mean that ends it
REFINED = 3  # designs from which it is refined
LOCAL, NARROW = 40, 0.06  # generations, and part of every range, of the search beside the best
NARROWING = (NARROW, NARROW / 6, NARROW / 36)  # of searches beside a design, one after the other
MOVES = 200
RESOLVED = 6  # neighbours whose continuous dimensions are found anew

Say = Callable[[str], object]


class BestDesign(NamedTuple):
    """What a search found.

    values : (d,), the best that can be made, in file units; relaxed : (d,), as if every step were none.
    merit, relaxed_merit : of `Model.merit`.
    history : evaluations so far, best objective (None before there is one), and what is missed in all, one by one.
    """

    values: Array
    relaxed: Array
    merit: float
    relaxed_merit: float
    history: list[tuple[int, float | None, float]]


def optimum(model: Model, seed: int, near: Array | None = None, say: Say = lambda text: None) -> BestDesign:
    """Search all designs; `near` (d,), a design to begin with besides, may be the last answer to nearly the same."""
    search = _Search(model, seed)
    relaxed = search.everywhere(near, say)
    relaxed = search.refined(relaxed)
    values, merit = search.made(relaxed if near is None else np.vstack([relaxed, near]))
    best = search.best_of(relaxed)
    return BestDesign(values, best, merit, float(search.merit(best[None])[0]), search.history)


def beside(model: Model, starts: Array, seed: int) -> BestDesign:
    """The best design beside `starts` (k, d), without a search of all."""
    search = _Search(model, seed)
    relaxed = search.refined(starts)
    best = search.best_of(relaxed)
    values, merit = search.made(best[None])
    return BestDesign(values, best, merit, float(search.merit(best[None])[0]), search.history)


def refined(model: Model, values: Array) -> tuple[Array, float]:
    """The design beside `values` (d,) that is best, and its merit: by sequential quadratic programming, and where
    that ends at bodies that cannot be drawn by evolution, nearer and nearer.
    """
    search = _Search(model, 0)
    found, merit = search.climbed(values)
    if all(search.drawn.values()):
        return found, merit
    for part in NARROWING:
        found = search.refined(found[None], part)[0]
    return found, float(search.merit(found[None])[0])


class _Search:
    """A search under way: `best` merit of a design that was drawn, and the history."""

    def __init__(self, model: Model, seed: int) -> None:
        self.model, self.space, self.seed = model, model.space, seed
        self.best, self.noted, self.history = np.inf, np.inf, list[tuple[int, float | None, float]]()
        self.drawn, self.snapping = dict[bytes, bool](), False
        self.began = model.counts["analytic"]

    def merit(self, values: Array) -> Array:
        """Merits (n,) of designs (n, d); one that would be the best is drawn first."""
        merits = self.model.merit(self.model.found(values))
        for k in np.argsort(merits, kind="stable"):
            if merits[k] >= min(self.best, 100 * WORST):
                break
            if self._drawable(values[k]):
                self.best = merits[k]
                break
            merits[k] = 100 * WORST
        return merits

    def _drawable(self, values: Array) -> bool:
        key = np.ascontiguousarray(values).tobytes()
        if key not in self.drawn:
            self.drawn[key] = self.model.drawable(values) == ""
        return self.drawn[key]

    def _decoded(self, u: Array) -> Array:
        """Designs (n, d) at places (n, d), those that can be made where the search is of these alone."""
        values = self.space.of_unit(u)
        return self.space.snapped(values) if self.snapping else values

    def note(self, merit: float) -> None:
        """Add the best so far, or `merit`, to the history."""
        self.noted = merit = min(merit, self.noted)
        missed = max(merit / WORST - 1, 0.0) if merit >= WORST else 0.0
        objective = None if merit >= WORST else float(merit) * self._sign
        self.history.append((self.model.counts["analytic"] - self.began, objective, float(missed)))

    @property
    def _sign(self) -> float:
        return float(self.model.signs[self.model.objective])

    def everywhere(self, near: Array | None, say: Say) -> Array:
        """The best designs (k, d) of differential evolution over all, from a Sobol sample."""
        d = self.space.size
        u = qmc.Sobol(d, rng=np.random.default_rng(self.seed)).random(STARTS)
        given = [self.model.loaded.own_values] if near is None else [self.model.loaded.own_values, near]
        u = np.vstack([np.clip(self.space.to_unit(np.array(given)), 0, 1), u])
        order = np.argsort(self.merit(self._decoded(u)), kind="stable")
        size = int(np.clip(EACH * d, LEAST, MOST))
        half = size // 2
        population = np.vstack([u[order[:half]], u[order[half:][: size - half]]])
        found, merits = self._evolve(population, np.zeros(d), np.ones(d), GENERATIONS, say)
        first = np.argsort(merits, kind="stable")[:REFINED]
        return self.space.of_unit(found[first])

    def _evolve(self, population: Array, low: Array, high: Array, most: int, say: Say) -> tuple[Array, Array]:
        """A population (n, d) of places and its merits after differential evolution between two ends."""
        best = [np.inf]

        def merit(u: Array) -> Array:
            found = self.merit(self._decoded(u.T))
            best[0] = min(best[0], float(found.min()))
            self.note(best[0])
            return found

        def told(intermediate_result: Any) -> None:
            say(_said(best[0] * (1.0 if best[0] >= WORST else self._sign), self.model.counts["analytic"]))

        high = np.where(high > low, high, low + 1e-9)
        found = differential_evolution(
            merit,
            list(zip(low, high, strict=True)),
            init=np.clip(population, low, high),
            maxiter=most,
            tol=AGREED,
            atol=0.0,
            vectorized=True,
            updating="deferred",
            polish=False,
            rng=np.random.default_rng(self.seed + 1),
            callback=told,
        )
        return np.asarray(found.population), np.asarray(found.population_energies)

    def refined(self, starts: Array, part: float = NARROW) -> Array:
        """Designs (k, d) beside `starts`, the best first: by quadratic programs and, around kinks, by evolution.

        part : of every range, either way, that evolution looks at.
        """
        climbed = [self.climbed(each)[0] for each in starts]
        every = np.vstack([climbed, starts])
        top = every[int(np.argmin(self.merit(every)))]
        low = np.clip(self.space.to_unit(top[None])[0] - part, 0, 1)
        high = np.clip(low + 2 * part, 0, 1)
        beside = low + (high - low) * qmc.Sobol(self.space.size, rng=np.random.default_rng(self.seed + 2)).random(32)
        beside[0] = np.clip(self.space.to_unit(top[None])[0], low, high)
        found, merits = self._evolve(beside, low, high, LOCAL, lambda text: None)
        last = self.space.of_unit(found[int(np.argmin(merits))][None])[0]
        every = np.vstack([every, last, self.climbed(last)[0]])
        return every[np.argsort(self.merit(every), kind="stable")]

    def best_of(self, values: Array) -> Array:
        """The best (d,) of designs (n, d)."""
        return np.asarray(values[int(np.argmin(self.merit(values)))])

    def climbed(self, start: Array, free: AnyArray | None = None) -> tuple[Array, float]:
        """The design that quadratic programs lead to from `start` (d,), or `start` where that is as good; its merit.

        free : (d,), which dimensions may change; by default all but lists.
        """
        may = ~self.space.listed if free is None else free
        before = float(self.merit(start[None])[0])
        if not may.any() or before >= 100 * WORST:
            return start, before
        found = programmed(self.model, start, may)
        if before >= WORST and float(self.merit(found[None])[0]) < WORST:
            found = self.better(found, programmed(self.model, found, may))  # the first ended where all were met
        merits = self.merit(np.vstack([start, found]))
        self.note(float(merits.min()))
        return (found, float(merits[1])) if merits[1] < merits[0] else (start, float(merits[0]))

    def better(self, one: Array, other: Array) -> Array:
        """The better of two designs (d,)."""
        return self.best_of(np.vstack([one, other]))

    def made(self, starts: Array) -> tuple[Array, float]:
        """The best design that can be made beside any of `starts` (k, d), and its merit: step by step downhill."""
        if not self.space.continuous.all():
            self.noted = np.inf
        values, merit = min(map(self._downhill, np.unique(self.space.snapped(starts), axis=0)), key=lambda end: end[1])
        if merit < 100 * WORST:
            return values, merit
        self.snapping, self.best, self.noted = True, np.inf, np.inf  # nothing beside them can be drawn
        return self._downhill(self.space.snapped(self.everywhere(None, lambda text: None)[:1])[0])

    def _downhill(self, values: Array) -> tuple[Array, float]:
        self.best = np.inf  # those that can be made are drawn anew: they need not be better than those that cannot
        values, merit = self.climbed(values, self.space.continuous)
        for _ in range(MOVES):
            around = self.space.neighbours(values)
            merits = self.merit(around)
            order = np.argsort(merits, kind="stable")[:RESOLVED]
            if self.space.continuous.any():
                ends = [self.climbed(around[k], self.space.continuous) for k in order]
                best, least = min(ends, key=lambda end: end[1])
            else:
                best, least = around[order[0]], float(merits[order[0]])
            if not least < merit - 1e-12 * abs(merit):
                break
            values, merit = best, least
            self.note(merit)
        return values, merit


def _said(best: float, evaluations: int) -> str:
    shown = f"{best:.6g}" if abs(best) < WORST else "none that meets all"
    return f"{evaluations:,} designs by the analytic model, best {shown}"
