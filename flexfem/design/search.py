"""The search: differential evolution, one polish by sequential quadratic programming, then steps that can be made."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize
from scipy.stats import qmc

from flexfem.arrays import AnyArray, Array
from flexfem.design.model import MISSED, REFUSED_MERIT, Model

SAMPLE = 1024  # designs of a Sobol sample that the search begins with
LEAST, MOST, EACH = 24, 96, 12  # designs of a generation: so many a dimension, between these ends
GENERATIONS, AGREED = 150, 1e-4  # at most; the spread of a generation's merits over their mean that ends it
LOCAL, NARROW = 40, 0.06  # generations, and part of every range either way, of the search beside a design
MOVES = 200  # at most, from one design that can be made to a neighbour
BEAM = 4  # designs that are kept while dimensions take their steps
RESOLVED = 6  # neighbours whose continuous dimensions are found anew
STEP = 1e-5  # of differences, of the range of a dimension
ITERATIONS = 60
INWARD = 2e-9  # of a size, by which a program keeps inside an end: its own round-off


class BestDesign(NamedTuple):
    """What a search found: the best design (d,) that can be made, in file units, and the best as if steps were none.

    `merit` is of the first, see `Model.merit`; `history` has evaluations so far, the best objective (None before there
    is one), and what is missed in all.
    """

    values: Array
    relaxed: Array
    merit: float
    history: list[tuple[int, float | None, float]]


def optimum(model: Model, near: Array | None = None, everywhere: bool = True) -> BestDesign:
    """The best design of all, `near` (d,) being one to begin with; with `everywhere` false that beside `near` alone."""
    search = _Search(model)
    start = search.everywhere(near) if near is None or everywhere else near
    relaxed = search.beside(start)
    values, merit = search.made(relaxed, near)
    return BestDesign(values, relaxed, merit, search.history)


class _Search:
    """A search under way: `best` merit of a design that was drawn, and the history."""

    def __init__(self, model: Model) -> None:
        self.model, self.space, self.seed = model, model.space, model.loaded.requirements.seed
        self.best, self.noted, self.history = np.inf, np.inf, list[tuple[int, float | None, float]]()
        self.drawn, self.began = dict[bytes, bool](), model.counts["analytic"]

    def merit(self, values: Array) -> Array:
        """Merits (n,) of designs (n, d); one that would be the best is drawn first."""
        merits = self.model.merit(self.model.found(values))
        for k in np.argsort(merits, kind="stable"):
            if merits[k] >= min(self.best, REFUSED_MERIT):
                break
            key = np.ascontiguousarray(values[k]).tobytes()
            if key not in self.drawn:
                self.drawn[key] = self.model.drawable(values[k])
            if self.drawn[key]:
                self.best = merits[k]
                break
            merits[k] = REFUSED_MERIT
        return merits

    def note(self, merit: float) -> None:
        """Add the best so far, or `merit`, to the history."""
        self.noted = merit = min(merit, self.noted)
        missed = max(merit / MISSED - 1, 0.0)
        objective = None if merit >= MISSED else merit * float(self.model.signs[self.model.objective])
        self.history.append((self.model.counts["analytic"] - self.began, objective, float(missed)))

    def everywhere(self, near: Array | None) -> Array:
        """The best design (d,), as if steps were none, of differential evolution over all from a Sobol sample."""
        d = self.space.size
        own = [self.model.loaded.base_values] if near is None else [self.model.loaded.base_values, near]
        u = np.vstack([self.space.to_unit(np.array(own)), self._sample()])

        def merit(u: Array) -> Array:
            found = self.merit(self.space.from_unit(u))
            self.note(float(found.min()))
            *_, (evaluations, objective, _) = self.history
            shown = "none that meets all" if objective is None else f"{objective:.6g}"
            self.model.say(f"{evaluations:,} designs by the analytic model, best {shown}")
            return found

        order = np.argsort(merit(u), kind="stable")
        population = u[order[: int(np.clip(EACH * d, LEAST, MOST))]]
        found = self._evolved(merit, population, np.zeros(d), np.ones(d), GENERATIONS)
        return np.asarray(self.space.from_unit(found[None])[0])

    def _sample(self) -> Array:
        """Places (SAMPLE, d) of a Sobol sample."""
        return np.asarray(qmc.Sobol(self.space.size, rng=np.random.default_rng(self.seed)).random(SAMPLE))

    def beside(self, start: Array) -> Array:
        """The best design (d,) beside one, as if steps were none: by evolution, which passes kinks, and the polish."""
        start = self.polished(start)
        place = self.space.to_unit(start[None])[0]
        low = np.clip(place - NARROW, 0, 1)
        high = np.clip(low + 2 * NARROW, 0, 1)
        sample = qmc.Sobol(self.space.size, rng=np.random.default_rng(self.seed + 2)).random(32)
        population = low + (high - low) * sample
        population[0] = np.clip(place, low, high)
        best = self._evolved(lambda u: self.merit(self.space.from_unit(u)), population, low, high, LOCAL)
        found = np.vstack([start, self.polished(self.space.from_unit(best[None])[0])])
        return np.asarray(found[int(np.argmin(self.merit(found)))])

    def _evolved(self, merit: Callable[[Array], Array], population: Array, low: Array, high: Array, most: int) -> Array:
        """The best place (d,) of differential evolution of a population (n, d) of places between two ends."""
        found = differential_evolution(
            lambda u: merit(u.T),
            list(zip(low, np.where(high > low, high, low + 1e-9), strict=True)),
            init=np.clip(population, low, high),
            maxiter=most,
            tol=AGREED,
            atol=0.0,
            vectorized=True,
            updating="deferred",
            polish=False,
            rng=np.random.default_rng(self.seed + 1),
        )
        return np.asarray(found.x)

    def polished(self, start: Array, free: AnyArray | None = None) -> Array:
        """The design (d,) that a quadratic program leads to from `start` (d,), or `start` where that is as good.

        `free` (d,) says which dimensions may change, by default all but lists.
        """
        free = ~self.space.listed if free is None else free
        if not free.any() or float(self.merit(start[None])[0]) >= REFUSED_MERIT:
            return start
        found = polished(self.model, start, free)
        merits = self.merit(np.vstack([start, found]))
        return found if merits[1] < merits[0] else start

    def made(self, relaxed: Array, near: Array | None) -> tuple[Array, float]:
        """The best design that can be made beside the one without steps, or beside `near`, and its merit.

        Dimensions take their steps one after the other, the coarsest first, while the others are found anew; the best
        few designs are kept at each. Then step by step downhill.
        """
        self.best, space = np.inf, self.space
        if space.continuous.all():
            merit = float(self.merit(relaxed[None])[0])
            self.note(merit)
            return relaxed, merit
        self.noted, free, beam = np.inf, ~space.listed, relaxed[None]
        coarseness = [len(each) or np.inf for each in space.allowed]
        for k in np.argsort(coarseness, kind="stable")[: np.sum(~space.continuous)]:
            free[k] = False
            started = {(*each[:k], value, *each[k + 1 :]) for each in beam for value in space.beside(k, each[k])}
            ends = np.array([self.polished(np.array(start), free) for start in sorted(started)])
            beam = ends[np.argsort(self.merit(ends), kind="stable")[:BEAM]]
        starts = space.snapped(np.vstack([beam] if near is None else [beam, near]))
        values, merit = min(map(self._downhill, np.unique(starts, axis=0)), key=lambda end: end[1])
        if merit < REFUSED_MERIT:
            return values, merit
        sample = space.snapped(space.from_unit(self._sample()))  # nothing beside them can be drawn
        self.best = np.inf
        return self._downhill(sample[int(np.argmin(self.merit(sample)))])

    def _downhill(self, values: Array) -> tuple[Array, float]:
        self.best, continuous = np.inf, self.space.continuous  # those that can be made are drawn anew
        values = self.polished(values, continuous)
        merit = float(self.merit(values[None])[0])
        for _ in range(MOVES if not continuous.all() else 0):
            around = self.space.neighbours(values)
            merits = self.merit(around)
            ends = around[np.argsort(merits, kind="stable")[:RESOLVED]]
            if continuous.any():
                ends = np.array([self.polished(each, continuous) for each in ends])
            merits = self.merit(ends)
            least = int(np.argmin(merits))
            if not merits[least] < merit - 1e-12 * abs(merit):
                break
            values, merit = ends[least], float(merits[least])
        self.note(merit)
        return values, merit


def polished(model: Model, start: Array, free: AnyArray) -> Array:
    """The end (d,) of sequential quadratic programming from `start` (d,); the dimensions `free` (d,) may change.

    Differences are of all dimensions in one batch for each iterate. SLSQP overwrites arrays that it is given: copies.
    """
    space, places, known = model.space, np.flatnonzero(free), dict[bytes, tuple[Array, Array]]()
    d, u0 = len(places), space.to_unit(start[None])[0]

    def rows(x: Array) -> tuple[Array, Array]:
        """Of `x` (d,): objective and constraints, (1 + c,), and their slopes (1 + c, d)."""
        if x.tobytes() not in known:
            inside = np.clip(x, 0, 1)
            u = np.tile(u0, (2 * d + 1, 1))
            u[:, places] = inside
            steps = np.vstack([np.zeros(d), -STEP * np.eye(d), STEP * np.eye(d)])
            u[:, places] = np.clip(u[:, places] + steps, 0, 1)
            values = space.from_unit(u)
            quantities = model.found(values)
            f = np.column_stack([model.wanted(quantities) / size, model.constraints(values, quantities) - INWARD])
            known[x.tobytes()] = _differences(f, u[:, places])
        return known[x.tobytes()]

    size = max(abs(float(model.wanted(model.found(start[None]))[0])), 1e-30)
    found = minimize(
        lambda x: float(rows(x)[0][0]),
        u0[places],
        jac=lambda x: rows(x)[1][0].copy(),
        bounds=Bounds(np.zeros(d), np.ones(d)),
        constraints=[{"type": "ineq", "fun": lambda x: rows(x)[0][1:].copy(), "jac": lambda x: rows(x)[1][1:].copy()}],
        method="SLSQP",
        options={"maxiter": ITERATIONS, "ftol": 1e-10},
    )
    u = u0.copy()
    u[places] = np.clip(found.x, 0, 1)
    return np.where(free, space.from_unit(u[None])[0], start)


def _differences(f: Array, u: Array) -> tuple[Array, Array]:
    """Values (k,) and slopes (k, d) of rows (2 d + 1, k) at places (2 d + 1, d): the point, below it, above it.

    One side without an answer is left out; without any, a value that no step leads to.
    """
    d = u.shape[1]
    lost = np.asarray(~np.isfinite(f).all(axis=1))
    if lost[0]:
        return np.concatenate([[1e3], np.full(f.shape[1] - 1, -1e3)]), np.zeros((f.shape[1], d))
    below, above = np.arange(1, d + 1), np.arange(d + 1, 2 * d + 1)
    a, b = np.where(lost[below], 0, below), np.where(lost[above], 0, above)
    width = u[b, np.arange(d)] - u[a, np.arange(d)]
    return np.asarray(f[0]), ((f[b] - f[a]) / np.where(width > 0, width, 1.0)[:, None]).T
