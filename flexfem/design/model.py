"""The design space, and the analytic model with finite-element corrections, evaluated for many
designs at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.design.kind import DesignKind, kind_of
from flexfem.design.requirements import Free, LoadedRequirements
from flexfem.results import Progress
from flexfem.study.answer import answer_designs, joined
from flexfem.study.columns import Rows
from flexfem.study.factors import Column
from flexfem.study.judge import evaluated

MISSED = 1e30  # least merit of a design that violates requirements
REFUSED_MERIT = 100 * MISSED  # merit of a design without a solution, or with overlapping bodies
ROUND_OFF = 1e-9  # relative to the size of a requirement: smaller violations count as none
BETWEEN = 0.45  # largest guard at each end, as a part of the distance between two ends
# least ratio of finite elements and model, either way, at which the correction is a factor, not a
# term
NEAR = 0.1
# stepped dimensions up to which all combinations of neighbours are evaluated; of more, all pairs
WHOLE = 6


def silent(text: str) -> None:
    """Ignore a progress message."""


class DesignSpace:
    """The free dimensions; designs are rows (n, d) of values in file units.

    `allowed` holds the ascending values (k,) that each dimension can take, none for a continuous
    one. `listed` marks the dimensions with a list of values instead of a range."""

    def __init__(self, columns: tuple[Column, ...]) -> None:
        factors = [column.factor for column in columns if isinstance(column.factor, Free)]
        self.size = len(columns)
        self.names = [column.name for column in columns]
        self.allowed = [factor.allowed for factor in factors]
        ends = [
            v[[0, -1]] if len(v) else (f.start, f.end)
            for f, v in zip(factors, self.allowed, strict=True)
        ]
        self.low, self.high = np.array(ends, dtype=float).T
        self.continuous = np.array([len(allowed) == 0 for allowed in self.allowed])
        self.listed = np.array([factor.values is not None for factor in factors])
        self.log = np.array([factor.scale == "log" for factor in factors]) & ~self.listed
        self.ratio = np.divide(self.high, self.low, out=np.ones(self.size), where=self.log)

    def named(self, values: Array) -> dict[str, float]:
        """Return the values of a design (d,) by the names of its dimensions."""
        return dict(zip(self.names, map(float, values), strict=True))

    def from_unit(self, u: Array) -> Array:
        """Map points (n, d) of the unit cube to designs (n, d); the values of a list have equal
        probability.
        """
        values = np.where(self.log, self.low * self.ratio**u, self.low + (self.high - self.low) * u)
        for k in map(int, np.flatnonzero(self.listed)):
            allowed = self.allowed[k]
            values[:, k] = allowed[
                np.minimum((u[:, k] * len(allowed)).astype(int), len(allowed) - 1)
            ]
        return np.asarray(values)

    def to_unit(self, values: Array) -> Array:
        """Map designs (n, d) to points (n, d) of the unit cube."""
        u = (values - self.low) / np.where(self.high > self.low, self.high - self.low, 1.0)
        u[:, self.log] = np.log(values[:, self.log] / self.low[self.log]) / np.log(
            self.ratio[self.log]
        )
        for k in map(int, np.flatnonzero(self.listed)):
            u[:, k] = (self._nearest(k, values[:, k]) + 0.5) / len(self.allowed[k])
        return np.asarray(np.clip(u, 0, 1))

    def snapped(self, values: Array) -> Array:
        """Return the nearest designs (n, d) whose dimensions have allowed values."""
        columns = [
            x if free else self.allowed[k][self._nearest(k, x)]
            for k, (x, free) in enumerate(zip(values.T, self.continuous, strict=True))
        ]
        return np.column_stack(columns)

    def adjacent(
        self,
        k: int,
        x: float,
    ) -> list[float]:
        """Return the allowed value of dimension k nearest to `x` and those next to it; `x` for a
        continuous one.
        """
        if self.continuous[k]:
            return [x]
        nearest = int(self._nearest(k, np.array([x]))[0])
        return [float(value) for value in self.allowed[k][max(nearest - 1, 0) : nearest + 2]]

    def neighbours(self, values: Array) -> Array:
        """Return the designs (n, d) within one step of `values` (d,) in all dimensions, or in pairs
        of many.
        """
        adjacent = [self.adjacent(k, float(x)) for k, x in enumerate(values)]
        moves: list[tuple[int, ...]] = [tuple(range(self.size))]
        if sum(len(options) > 1 for options in adjacent) > WHOLE:
            moves = list(combinations(range(self.size), 2))
        designs = [
            one
            for move in moves
            for one in product(*(adjacent[k] if k in move else [x] for k, x in enumerate(values)))
        ]
        return np.unique(np.array(designs), axis=0)

    def _nearest(
        self,
        k: int,
        x: Array,
    ) -> AnyArray:
        return np.asarray(np.argmin(np.abs(self.allowed[k] - x[:, None]), axis=1))


class Correction(NamedTuple):
    """Map from a column of the analytic model to that of finite elements: `factor` times the value,
    plus `term`.
    """

    factor: float = 1.0
    term: float = 0.0


def correction_of(model: float, elements: float) -> Correction:
    """Return the correction that maps an analytic quantity to its finite-element value."""
    if model != 0 and NEAR < elements / model < 1 / NEAR:
        return Correction(elements / model)
    return Correction(term=elements - model)


@dataclass
class Model:
    """The corrected analytic model of the requirements; it counts its evaluations, and searches
    report to `say`.

    `corrections` are by column. Quantities (q,) are the objectives, then the required ones; `low`
    and `high` are their ends, infinite without one, and `sizes` the larger end, zero without one.
    `guard` (q,) tightens the ends, relative to the sizes. The objective with index `objective` is
    minimised while `bounds` limit the signed values of others. The quantity with index `soft` may
    miss its ends: its violation is minimised instead of the objective."""

    loaded: LoadedRequirements
    corrections: Mapping[str, Correction] = field(default_factory=dict)
    guard: Array | float = 0.0
    objective: int = 0
    bounds: Mapping[int, float] = field(default_factory=dict)
    soft: int | None = None
    counts: Counter[str] = field(default_factory=Counter)
    say: Progress = silent
    # rows of designs that are computed alone, which take 20 ms each
    known: dict[bytes, Rows] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.required, self.space = self.loaded.requirements, DesignSpace(self.loaded.columns)
        self.signs = np.array([objective.sign for objective in self.required.objective])
        ends = [(-np.inf, np.inf)] * len(self.signs)
        for k, most in self.bounds.items():
            ends[k] = (-np.inf, most) if self.signs[k] > 0 else (-most, np.inf)
        ends += [requirement.ends for requirement in self.required.require]
        self.low, self.high = np.array(ends).T
        finite = np.where(np.isfinite(ends), np.abs(ends), 0.0).max(axis=1)
        self.sizes = np.where(np.isfinite(ends).any(axis=1), np.where(finite > 0, finite, 1.0), 0.0)
        self.room = BETWEEN * (self.high - self.low)  # infinite where there is one end

    @cached_property
    def kind(self) -> DesignKind:
        """What requirements on this kind of mechanism can use beyond the outputs of the study."""
        return kind_of(self.loaded)

    def evaluate(self, values: Array) -> Array:
        """Return the quantities (n, q) of designs (n, d) in file units, objectives first; nan
        without a solution.
        """
        columns, reason = self.columns(values)
        return np.where((reason == "")[:, None], self.quantities(self.corrected(columns)), np.nan)

    def columns(self, values: Array) -> tuple[dict[str, Array], AnyArray]:
        """Return the uncorrected columns (n,) of the model by name, and the reasons (n,) for
        designs without any.
        """
        rows = self._rows(values)
        reason = np.where(rows.status == "ok", "", rows.reason).astype(object)
        names = (*self.loaded.outputs, *self.space.names)
        columns = dict(zip(names, (*rows.values.T, *values.T), strict=True))
        with np.errstate(all="ignore"):
            columns |= self.kind.columns(values, columns, reason, self.counts)
        return columns, reason

    def _rows(self, values: Array) -> Rows:
        """Return the rows of designs (n, d) by the analytic model.

        Rows of designs that are computed one after the other are kept.
        """
        study = self.loaded
        if study.family.batch is not None:
            self.counts["analytic"] += len(values)
            return answer_designs(study, values)
        keys = [row.tobytes() for row in values]
        for key, row in zip(keys, values, strict=True):
            if key not in self.known:
                self.counts["analytic"] += 1
                self.known[key] = answer_designs(study, row[None])
        return joined(study, [self.known[key] for key in keys])

    def corrected(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Apply the corrections to columns by name."""
        by = self.corrections
        return {
            name: by[name].factor * x + by[name].term if name in by else x
            for name, x in columns.items()
        }

    def quantities(self, columns: Mapping[str, Array]) -> Array:
        """Return the quantities (n, q) of columns (n,) by name."""
        known = dict(columns)
        n = len(next(iter(columns.values())))
        return np.column_stack(
            [evaluated(self.loaded, text, known, n) for text in self.required.quantities]
        )

    def signed(self, quantities: Array) -> Array:
        """Return all objectives (n, k) of quantities (n, q), with the signs for minimisation."""
        return self.signs * quantities[:, : len(self.signs)]

    def both_margins(self, quantities: Array) -> tuple[Array, Array]:
        """Return the relative margins (n, q) to the lower and to the upper ends, guards included."""
        guard = np.minimum(self.guard * self.sizes, self.room)
        with np.errstate(all="ignore"):  # quantities without a finite value, or without an end
            return (quantities - self.low - guard) / self.sizes, (
                self.high - guard - quantities
            ) / self.sizes

    def margins(self, quantities: Array) -> Array:
        """Return the relative margin (n, q) of each quantity, the smaller one of both ends."""
        return np.minimum(*self.both_margins(quantities))

    def violations(self, quantities: Array) -> Array:
        """Return the relative violations (n, q) of requirements and bounds, zero where these hold."""
        missed = -self.margins(quantities)
        if self.soft is not None:
            missed[:, self.soft] = 0.0
        return np.where(missed > ROUND_OFF, missed, 0.0)

    def cost(self, quantities: Array) -> Array:
        """Return the minimised value (n,): the signed objective, or the violation of the soft
        requirement.
        """
        if self.soft is not None:
            return np.maximum(0.0, -self.margins(quantities)[:, self.soft])
        return np.asarray(self.signed(quantities)[:, self.objective])

    def merit(self, quantities: Array) -> Array:
        """Return the merit (n,), to be minimised: the cost of feasible designs, more than that for
        larger violations.

        Notes
        -----
        The merit follows the feasibility rules of Deb (Comput. Methods Appl. Mech. Eng. 186 (2000)
        311-338), with the sum of the relative violations."""
        missed = np.sum(self.violations(quantities), axis=1)
        merit = np.where(missed > 0, MISSED * (1 + np.minimum(missed, 90.0)), self.cost(quantities))
        return np.where(np.isfinite(quantities).all(axis=1), merit, REFUSED_MERIT)

    def drawable(self, values: Array) -> bool:
        """Return whether a design (d,) with a result can be drawn, without overlap of its bodies.

        Without arrays of designs it was drawn before it was computed.
        """
        family = self.loaded.family
        if family.batch is None:
            return True
        self.counts["drawn"] += 1
        return family.drawable(values) is not None

    def constraints(
        self,
        values: Array,
        quantities: Array,
    ) -> Array:
        """Return the inequality constraints (n, c), >= 0: margins of ends and bounds, and rooms of
        the geometric conditions.
        """
        ends = np.hstack(self.both_margins(quantities))[:, np.isfinite([*self.low, *self.high])]
        batch = self.loaded.family.batch
        return ends if batch is None else np.hstack([ends, batch.rooms(values)])
