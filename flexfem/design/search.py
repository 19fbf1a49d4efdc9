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
# for mechanisms, of which each design takes 20 ms
SPARING = Effort(
    sample=256,
    least=16,
    most=40,
    each=8,
    generations=30,
    near=16,
    local=6,
    beam=2,
    iterations=12,
    accuracy=1e-6,
)


def effort_of(model: Model) -> Effort:
    """Return the effort of searches by a model."""
    return SPARING if model.required.on_mechanism else FULL


def share_of_search(model: Model) -> Callable[[], float]:
    """Return a function that returns the share of a search from now on that is done, about."""
    effort = effort_of(model)
    d = model.space.size
    each = int(np.clip(effort.each * d, effort.least, effort.most))
    local = effort.near * (effort.local + 1) + 2 * effort.iterations * (2 * d + 1)
    whole = effort.sample + each * effort.generations + local
    if not model.space.continuous.all():
        whole += (2 * d + 1) * effort.iterations * effort.beam * d  # at most, of rounding
    before = model.counts["analytic"]
    return lambda: (model.counts["analytic"] - before) / whole


class BestDesign(NamedTuple):
    """Result of a search: the best design (d,) on the steps, in file units, and the best one
    without steps, `relaxed`.

    `merit` is that of `values`, see `Model.merit`; `history` holds the evaluations so far, the best
    objective (None before a feasible design), and the sum of the violations."""

    values: Array
    relaxed: Array
    merit: float
    history: list[tuple[int, float | None, float]]


def optimum(
    model: Model,
    near: Array | None = None,
    everywhere: bool = True,
) -> BestDesign:
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
        self.best = np.inf
        self.noted = np.inf
        self.history = list[tuple[int, float | None, float]]()
        self.effort = effort_of(model)
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
        self.noted = min(merit, self.noted)
        merit = self.noted
        objective = (
            None if merit >= MISSED else merit * float(self.model.signs[self.model.objective])
        )
        evaluations = self.model.counts["analytic"] - self.evaluations_before
        self.history.append((evaluations, objective, float(max(merit / MISSED - 1, 0.0))))

    def _sample(
        self,
        count: int,
        stream: int = 0,
    ) -> Array:
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

    def on_steps(
        self,
        relaxed: Array,
        near: Array | None,
    ) -> tuple[Array, float]:
        """Return the best design on the steps near the one without steps, or near `near`, and its
        merit.

        A descent over neighbours follows the rounding of all dimensions.
        """
        self.best = np.inf
        space = self.space
        if space.continuous.all():
            merit = float(self.merit(relaxed[None])[0])
            self.note(merit)
            return relaxed, merit
        self.noted = np.inf
        beam = self._rounded(relaxed)
        ends = space.snapped(np.vstack([beam] if near is None else [beam, near]))
        values, merit = min(map(self._descended, np.unique(ends, axis=0)), key=lambda end: end[1])
        if merit < REFUSED_MERIT:
            return values, merit
        # no neighbour can be drawn
        sample = space.snapped(space.from_unit(self._sample(self.effort.sample)))
        self.best = np.inf
        return self._descended(sample[int(np.argmin(self.merit(sample)))])

    def _rounded(self, relaxed: Array) -> Array:
        """Return designs (beam, d) on the steps near one without steps.

        A beam search rounds one dimension after the other, the coarsest first, and optimises the
        others again.
        """
        space = self.space
        free = ~space.listed
        beam = relaxed[None]
        value_counts = [len(allowed) or np.inf for allowed in space.allowed]
        coarsest_first = np.argsort(value_counts, kind="stable")
        for k in coarsest_first[: np.sum(~space.continuous)]:
            free[k] = False
            starts = {
                (*design[:k], value, *design[k + 1 :])
                for design in beam
                for value in space.adjacent(k, design[k])
            }
            candidates = np.array(
                [self.polished(np.array(start), free) for start in sorted(starts)]
            )
            best_first = np.argsort(self.merit(candidates), kind="stable")
            beam = candidates[best_first[: self.effort.beam]]
        return beam

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

    def polished(
        self,
        start: Array,
        free: AnyArray | None = None,
    ) -> Array:
        """Return the design (d,) that SLSQP reaches from `start` (d,), or `start` if it is as good.

        `free` (d,) marks the variable dimensions, by default all without a list of values. SLSQP
        overwrites the arrays that it receives, hence the copies.
        """
        free = ~self.space.listed if free is None else free
        if not free.any() or float(self.merit(start[None])[0]) >= REFUSED_MERIT:
            return start
        near = _Linearised(self.model, start, np.flatnonzero(free))
        dimensions = len(near.variable)
        found = minimize(
            lambda x: float(near.at(x).values[0]),
            near.start[near.variable],
            jac=lambda x: near.at(x).slopes[0].copy(),
            bounds=Bounds(np.zeros(dimensions), np.ones(dimensions)),
            constraints={
                "type": "ineq",
                "fun": lambda x: near.at(x).values[1:].copy(),
                "jac": lambda x: near.at(x).slopes[1:].copy(),
            },
            method="SLSQP",
            options={"maxiter": self.effort.iterations, "ftol": self.effort.accuracy},
        )
        end = np.where(free, near.design(np.clip(found.x, 0, 1)), start)
        merits = self.merit(np.vstack([start, end]))
        return end if merits[1] < merits[0] else start


class _Slopes(NamedTuple):
    """Cost and constraints (1 + c,) at a point, and their slopes (1 + c, d)."""

    values: Array
    slopes: Array


class _Linearised:
    """Cost and constraints of a model near a design, as functions of its variable dimensions.

    start : (d,), the design in the unit cube.   variable : indices of the variable dimensions. The
    cost is relative to that of the design.
    """

    def __init__(
        self,
        model: Model,
        design: Array,
        variable: AnyArray,
    ) -> None:
        self.model = model
        self.start = model.space.to_unit(design[None])[0]
        self.variable = variable
        cost = float(model.cost(model.evaluate(design[None]))[0])
        self._size = max(abs(cost), 1e-30)
        self._known = dict[bytes, _Slopes]()

    def design(self, x: Array) -> Array:
        """Return the design (d,), file units, at a point of the variable dimensions."""
        u = self.start.copy()
        u[self.variable] = x
        return np.asarray(self.model.space.from_unit(u[None])[0])

    def at(self, x: Array) -> _Slopes:
        """Return cost and constraints at a point; all finite differences are one batch."""
        key = x.tobytes()
        if key not in self._known:
            self._known[key] = self._solved(x)
        return self._known[key]

    def _solved(self, x: Array) -> _Slopes:
        model = self.model
        d = len(self.variable)
        steps = np.vstack([np.zeros(d), -STEP * np.eye(d), STEP * np.eye(d)])
        u = np.tile(self.start, (2 * d + 1, 1))
        u[:, self.variable] = np.clip(np.clip(x, 0, 1) + steps, 0, 1)
        values = model.space.from_unit(u)
        quantities = model.evaluate(values)
        cost = model.cost(quantities) / self._size
        room = model.constraints(values, quantities) - INWARD
        return _differences(np.column_stack([cost, room]), u[:, self.variable])


def _differences(f: Array, u: Array) -> _Slopes:
    """Return values and slopes at a point from rows f (2 d + 1, 1 + c): there, below it, above it.

    A difference is one-sided where the other side has no solution. A point without one is very
    infeasible.
    """
    d = u.shape[1]
    solved = np.asarray(np.isfinite(f).all(axis=1))
    if not solved[0]:
        values = np.full(f.shape[1], -1e3)
        values[0] = 1e3
        return _Slopes(values, np.zeros((f.shape[1], d)))
    below = np.arange(1, d + 1)
    above = below + d
    a = np.where(solved[below], below, 0)
    b = np.where(solved[above], above, 0)
    width = u[b, np.arange(d)] - u[a, np.arange(d)]
    slopes = (f[b] - f[a]) / np.where(width > 0, width, 1.0)[:, None]
    return _Slopes(f[0], slopes.T)
