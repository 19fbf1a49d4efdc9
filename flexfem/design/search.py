"""The search: differential evolution, refinement by sequential quadratic programming, then rounding
to steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize
from scipy.stats import qmc

from flexfem.arrays import AnyArray, Array
from flexfem.design.model import MISSED, REFUSED_MERIT, Model
from flexfem.files.refusals import place_of
from flexfem.refused import BadInput

AGREED = 1e-4  # relative spread of the merits of a generation at convergence
NARROW = 0.06  # half-width, as a part of every range, of the local search
MOVES = 200  # at most, from a design to a neighbour
RESOLVED = 6  # neighbours whose continuous dimensions are optimised again
STEP = 1e-5  # of finite differences, as a part of the range of a dimension
INWARD = 2e-9  # tightening of the constraints, relative to a size, against the round-off of SLSQP


class Effort(NamedTuple):
    """Designs of the initial Sobol `sample`, sizes of populations, and generations at most.

    A population has `each` designs for each dimension, from `least` to `most`; that of the local
    search has `near`. `beam` designs are kept while the dimensions are rounded to steps. SLSQP
    stops after `iterations`, or at `accuracy`."""

    sample: int = 1024
    least: int = 24
    most: int = 96
    each: int = 12
    generations: int = 150
    near: int = 32
    local: int = 40
    beam: int = 4
    iterations: int = 60
    accuracy: float = 1e-10


FULL = Effort()
SPARING = Effort(
    256, 16, 40, 8, 30, 16, 6, 2, 12, 1e-6
)  # for mechanisms, of which each design takes 20 ms


class BestDesign(NamedTuple):
    """Result of a search: the best design (d,) on the steps, in file units, and the best one
    without steps, `relaxed`.

    `merit` is that of `values`, see `Model.merit`; `history` holds the evaluations so far, the best
    objective (None before a feasible design), and the sum of the violations."""

    values: Array
    relaxed: Array
    merit: float
    history: list[tuple[int, float | None, float]]


def optimum(model: Model, near: Array | None = None, everywhere: bool = True) -> BestDesign:
    """Return the best design, with `near` (d,) as an initial guess; without `everywhere` the search
    is local to it.

    Raises BadInput when no design has a solution.
    """
    search = _Search(model)
    start = search.global_optimum(near) if near is None or everywhere else near
    relaxed = search.local_optimum(start)
    values, merit = search.on_steps(relaxed, near)
    if merit >= REFUSED_MERIT:
        finite = np.isfinite(model.evaluate(values[None])).all()
        why = "its bodies cannot be drawn" if finite else "a quantity without a finite value"
        reason = model.columns(values[None])[1][0] or why
        raise BadInput(
            f"{place_of(model.loaded.path)}: no design of the free dimensions has a result: "
            f"{reason}"
        )
    return BestDesign(values, relaxed, merit, search.history)


class _Search:
    """State of a search: `best` merit of a design that can be drawn, and the history."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.space = model.space
        self.seed = model.required.seed
        self.best, self.noted, self.history = (
            np.inf,
            np.inf,
            list[tuple[int, float | None, float]](),
        )
        self.effort = SPARING if model.required.on_mechanism else FULL
        self.drawable = dict[bytes, bool]()
        self.evaluations_before = model.counts["analytic"]

    def merit(self, values: Array) -> Array:
        """Return the merits (n,) of designs (n, d); a new best design must be drawable."""
        merits = self.model.merit(self.model.evaluate(values))
        for k in np.argsort(merits, kind="stable"):
            if merits[k] >= min(self.best, REFUSED_MERIT):
                break
            key = values[k].tobytes()
            if key not in self.drawable:
                self.drawable[key] = self.model.drawable(values[k])
            if self.drawable[key]:
                self.best = merits[k]
                break
            merits[k] = REFUSED_MERIT
        return merits

    def note(self, merit: float) -> None:
        """Add the lesser of the best merit so far and `merit` to the history."""
        self.noted = merit = min(merit, self.noted)
        objective = (
            None if merit >= MISSED else merit * float(self.model.signs[self.model.objective])
        )
        evaluations = self.model.counts["analytic"] - self.evaluations_before
        self.history.append((evaluations, objective, float(max(merit / MISSED - 1, 0.0))))

    def _sample(self, count: int, stream: int = 0) -> Array:
        """Return a Sobol sample (count, d) in the unit cube."""
        return np.asarray(
            qmc.Sobol(self.space.size, rng=np.random.default_rng(self.seed + stream)).random(count)
        )

    def _evolved(
        self, merit: Callable[[Array], Array], population: Array, low: Array, high: Array, most: int
    ) -> Array:
        """Return the best design (d,) of differential evolution of a population (n, d) between two
        corners.
        """
        found = differential_evolution(
            lambda u: merit(self.space.from_unit(u.T)),
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
        return np.asarray(self.space.from_unit(found.x[None])[0])

    def global_optimum(self, near: Array | None) -> Array:
        """Return the best design (d,) without steps by differential evolution over the design
        space.
        """
        guesses = [self.model.loaded.base_values, *([] if near is None else [near])]
        u = np.vstack([self.space.to_unit(np.array(guesses)), self._sample(self.effort.sample)])

        def merit(values: Array) -> Array:
            merits = self.merit(values)
            self.note(float(merits.min()))
            *_, (evaluations, objective, _) = self.history
            shown = "none feasible" if objective is None else f"{objective:.6g}"
            self.model.say(f"{evaluations:,} analytic evaluations, best: {shown}")
            return merits

        order = np.argsort(merit(self.space.from_unit(u)), kind="stable")
        size = int(np.clip(self.effort.each * self.space.size, self.effort.least, self.effort.most))
        corners = np.zeros(self.space.size), np.ones(self.space.size)
        return self._evolved(merit, u[order[:size]], *corners, self.effort.generations)

    def local_optimum(self, start: Array) -> Array:
        """Return the best design (d,) without steps near `start` (d,), by SLSQP and evolution,
        which passes kinks.
        """
        start = self.polished(start)
        centre = self.space.to_unit(start[None])[0]
        low = np.clip(centre - NARROW, 0, 1)
        high = np.clip(low + 2 * NARROW, 0, 1)
        population = low + (high - low) * self._sample(self.effort.near, 2)
        population[0] = centre
        evolved = self._evolved(self.merit, population, low, high, self.effort.local)
        candidates = np.vstack([start, self.polished(evolved)])
        return np.asarray(candidates[int(np.argmin(self.merit(candidates)))])

    def on_steps(self, relaxed: Array, near: Array | None) -> tuple[Array, float]:
        """Return the best design on the steps near the one without steps, or near `near`, and its
        merit.

        A beam search rounds one dimension after the other, the coarsest first, and optimises the
        others again. A descent over neighbours follows."""
        self.best = np.inf
        space = self.space
        if space.continuous.all():
            merit = float(self.merit(relaxed[None])[0])
            self.note(merit)
            return relaxed, merit
        self.noted = np.inf
        free = ~space.listed
        beam = relaxed[None]
        value_counts = [len(allowed) or np.inf for allowed in space.allowed]
        for k in np.argsort(value_counts, kind="stable")[: np.sum(~space.continuous)]:
            free[k] = False
            rounded = {
                (*x[:k], value, *x[k + 1 :]) for x in beam for value in space.adjacent(k, x[k])
            }
            candidates = np.array(
                [self.polished(np.array(start), free) for start in sorted(rounded)]
            )
            beam = candidates[np.argsort(self.merit(candidates), kind="stable")[: self.effort.beam]]
        ends = space.snapped(np.vstack([beam] if near is None else [beam, near]))
        values, merit = min(map(self._descended, np.unique(ends, axis=0)), key=lambda end: end[1])
        if merit < REFUSED_MERIT:
            return values, merit
        sample = space.snapped(
            space.from_unit(self._sample(self.effort.sample))
        )  # no neighbour can be drawn
        self.best = np.inf
        return self._descended(sample[int(np.argmin(self.merit(sample)))])

    def _descended(self, values: Array) -> tuple[Array, float]:
        """Return the local minimum among neighbours that a descent from `values` (d,) reaches, and
        its merit.
        """
        self.best = np.inf
        continuous = self.space.continuous  # the best merit so far may be of a design without steps
        values = self.polished(values, continuous)
        merit = float(self.merit(values[None])[0])
        for _ in range(MOVES):
            neighbours = self.space.neighbours(values)
            candidates = neighbours[np.argsort(self.merit(neighbours), kind="stable")[:RESOLVED]]
            if continuous.any():
                candidates = np.array([self.polished(start, continuous) for start in candidates])
            merits = self.merit(candidates)
            least = int(np.argmin(merits))
            if not merits[least] < merit - 1e-12 * abs(merit):
                break
            values = candidates[least]
            merit = float(merits[least])
        self.note(merit)
        return values, merit

    def polished(self, start: Array, free: AnyArray | None = None) -> Array:
        """Return the design (d,) that SLSQP reaches from `start` (d,), or `start` if it is as good.

        `free` (d,) marks the variable dimensions, by default all without a list of values. All
        finite differences of an iterate are one batch. SLSQP overwrites the arrays that it
        receives, hence the copies."""
        free = ~self.space.listed if free is None else free
        if not free.any() or float(self.merit(start[None])[0]) >= REFUSED_MERIT:
            return start
        space = self.space
        model = self.model
        variable = np.flatnonzero(free)
        known = dict[bytes, tuple[Array, Array]]()
        d = len(variable)
        u0 = space.to_unit(start[None])[0]
        size = max(abs(float(model.cost(model.evaluate(start[None]))[0])), 1e-30)

        def linearised(x: Array) -> tuple[Array, Array]:
            if x.tobytes() not in known:
                u = np.tile(u0, (2 * d + 1, 1))
                steps = np.vstack([np.zeros(d), -STEP * np.eye(d), STEP * np.eye(d)])
                u[:, variable] = np.clip(np.clip(x, 0, 1) + steps, 0, 1)
                values = space.from_unit(u)
                quantities = model.evaluate(values)
                f = np.column_stack(
                    [model.cost(quantities) / size, model.constraints(values, quantities) - INWARD]
                )
                known[x.tobytes()] = _differences(f, u[:, variable])
            return known[x.tobytes()]

        found = minimize(
            lambda x: float(linearised(x)[0][0]),
            u0[variable],
            jac=lambda x: linearised(x)[1][0].copy(),
            bounds=Bounds(np.zeros(d), np.ones(d)),
            constraints={
                "type": "ineq",
                "fun": lambda x: linearised(x)[0][1:].copy(),
                "jac": lambda x: linearised(x)[1][1:].copy(),
            },
            method="SLSQP",
            options={"maxiter": self.effort.iterations, "ftol": self.effort.accuracy},
        )
        u = u0.copy()
        u[variable] = np.clip(found.x, 0, 1)
        end = np.where(free, space.from_unit(u[None])[0], start)
        merits = self.merit(np.vstack([start, end]))
        return end if merits[1] < merits[0] else start


def _differences(f: Array, u: Array) -> tuple[Array, Array]:
    """Return values (1 + c,) and slopes (1 + c, d) at a point from rows f (2 d + 1, 1 + c): there,
    below it, above it.

    A difference is one-sided where the other side has no solution. A point without one is very
    infeasible."""
    d = u.shape[1]
    solved = np.asarray(np.isfinite(f).all(axis=1))
    if not solved[0]:
        return np.concatenate([[1e3], np.full(f.shape[1] - 1, -1e3)]), np.zeros((f.shape[1], d))
    a, b = (np.where(solved[side], side, 0) for side in np.arange(1, 2 * d + 1).reshape(2, d))
    width = u[b, np.arange(d)] - u[a, np.arange(d)]
    return f[0], ((f[b] - f[a]) / np.where(width > 0, width, 1.0)[:, None]).T
