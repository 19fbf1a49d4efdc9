"""The free dimensions, and what the analytic model, corrected by finite elements, says of many designs at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array
from flexfem.design.requirements import MASS, SCATTERED, Free, LoadedRequirements
from flexfem.design.scatter import REFUSED, NeckScatter
from flexfem.mechanism.bodies import drawn_inertia
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.feasibility import check_feasible, conditions
from flexfem.questions.bands import error_matrix
from flexfem.questions.batch import batch_at_rest
from flexfem.refused import BadInput
from flexfem.study.answer import answer_designs
from flexfem.study.columns import ERRORS, STIFFNESSES
from flexfem.study.factors import Column
from flexfem.study.loaded import designs_of, evaluated, stage_of
from flexfem.units import UNITS

CHUNK = 2048  # designs at a time
MISSED = 1e30  # merit of a design that misses requirements, and more
REFUSED_MERIT = 100 * MISSED  # of one that has no answer, or cannot be drawn
ROUND_OFF = 1e-9  # of a size: less is not missed
BETWEEN = 0.45  # of what lies between two ends, that a value can be kept from both
NEAR = 0.1  # finite elements over the model, and the inverse: beyond it they differ by a term, not by a factor
WHOLE = 6  # dimensions up to which every combination of neighbours is looked at, beyond it pairs of them


class FreeDimension(NamedTuple):
    """One free dimension in file units; `allowed` (k,) are values that can be made, rising, None where all can."""

    name: str
    low: float
    high: float
    log: bool
    allowed: Array | None
    listed: bool  # of a list, not of a range with steps

    @classmethod
    def of(cls, column: Column) -> FreeDimension:
        """The dimension of a column."""
        factor = column.factor
        assert isinstance(factor, Free)
        allowed = factor.allowed
        ends = allowed if allowed is not None else np.array([factor.start, factor.end], dtype=float)
        log = factor.scale == "log"
        return cls(column.name, float(ends[0]), float(ends[-1]), log, allowed, factor.values is not None)

    def from_unit(self, u: Array) -> Array:
        """Values (n,) at places `u` (n,) from 0 to 1, those of a list each as likely."""
        if self.listed and self.allowed is not None:
            return np.asarray(self.allowed[np.minimum((u * len(self.allowed)).astype(int), len(self.allowed) - 1)])
        if self.log:
            return np.asarray(self.low * (self.high / self.low) ** u)
        return np.asarray(self.low + (self.high - self.low) * u)

    def to_unit(self, x: Array) -> Array:
        """Places (n,) of values (n,)."""
        if self.listed and self.allowed is not None:
            return np.asarray((self._nearest(x) + 0.5) / len(self.allowed))
        if self.log:
            return np.asarray(np.log(x / self.low) / np.log(self.high / self.low))
        return np.asarray((x - self.low) / (self.high - self.low))

    def snapped(self, x: Array) -> Array:
        """The nearest values (n,) that can be made."""
        return x if self.allowed is None else np.asarray(self.allowed[self._nearest(x)])

    def beside(self, x: float) -> list[float]:
        """The nearest value that can be made and those next to it; of a continuous dimension the value alone."""
        if self.allowed is None:
            return [x]
        place = int(self._nearest(np.array([x]))[0])
        return [float(each) for each in self.allowed[max(place - 1, 0) : place + 2]]

    def _nearest(self, x: Array) -> AnyArray:
        assert self.allowed is not None
        return np.asarray(np.argmin(np.abs(self.allowed - x[:, None]), axis=1))


class DesignSpace:
    """All free dimensions; designs are rows (n, d) of values in file units."""

    def __init__(self, columns: tuple[Column, ...]) -> None:
        self.dimensions = tuple(FreeDimension.of(column) for column in columns)
        self.size = len(self.dimensions)
        self.continuous = np.array([each.allowed is None for each in self.dimensions])
        self.listed = np.array([each.listed for each in self.dimensions])

    def from_unit(self, u: Array) -> Array:
        """Designs (n, d) at places (n, d) from 0 to 1."""
        return np.column_stack([each.from_unit(u[:, k]) for k, each in enumerate(self.dimensions)])

    def to_unit(self, values: Array) -> Array:
        """Places (n, d), from 0 to 1, of designs (n, d)."""
        return np.clip(np.column_stack([each.to_unit(values[:, k]) for k, each in enumerate(self.dimensions)]), 0, 1)

    def snapped(self, values: Array) -> Array:
        """The nearest designs (n, d) that can be made."""
        return np.column_stack([each.snapped(values[:, k]) for k, each in enumerate(self.dimensions)])

    def neighbours(self, values: Array) -> Array:
        """Designs (n, d) one step away from `values` (d,) in any dimensions, in any two where there are many."""
        beside = [each.beside(float(x)) for each, x in zip(self.dimensions, values, strict=True)]
        if sum(len(each) > 1 for each in beside) <= WHOLE:
            return np.array(list(product(*beside)))
        found = [values]
        for pair in combinations(range(self.size), 2):
            for moved in product(*(beside[k] for k in pair)):
                found.append(values.copy())
                found[-1][list(pair)] = moved
        return np.unique(np.array(found), axis=0)


class Correction(NamedTuple):
    """What turns a column of the analytic model into one of finite elements: times `factor`, plus `term`."""

    factor: float = 1.0
    term: float = 0.0


def correction_of(model: float, elements: float) -> Correction:
    """That by which a number of the model becomes one of finite elements."""
    if model != 0 and NEAR < elements / model < 1 / NEAR:
        return Correction(elements / model)
    return Correction(term=elements - model)


class Found(NamedTuple):
    """Quantities (n, q) of n designs, objectives first, nan without an answer, and why there is none (n,), else ""."""

    quantities: Array
    reason: AnyArray


@dataclass
class Model:
    """The corrected analytic model of requirements; every evaluation is counted.

    `corrections` are by column; `shifts`, by column, its value of other scattered stages over that of those searched.
    `guard` (m,) says by how much of its size each requirement is to be met beyond its end; `objective` which one is to
    be best while `bounds` are values, with their signs, that others must not exceed. A `yielding` requirement is not
    asked: its miss is what is to be small instead of the objective.
    """

    loaded: LoadedRequirements
    corrections: Mapping[str, Correction] = field(default_factory=dict)
    shifts: Mapping[str, float] = field(default_factory=dict)
    guard: Array | None = None
    objective: int = 0
    bounds: Mapping[int, float] = field(default_factory=dict)
    yielding: int | None = None
    counts: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        of = self.loaded.requirements
        self.space = DesignSpace(self.loaded.columns)
        self.objectives = len(of.objective)
        self.signs = np.array([each.sign for each in of.objective])
        ends = [(each.at_least, each.at_most) for each in of.require]
        self.low = np.array([-np.inf if low is None else low for low, _ in ends])
        self.high = np.array([np.inf if high is None else high for _, high in ends])
        self.sizes = np.array([max(abs(low or 0.0), abs(high or 0.0)) or 1.0 for low, high in ends])
        self.room = BETWEEN * (self.high - self.low)  # infinite where there is one end

    def changed(self, **changes: object) -> Model:
        """The same with other corrections, guards or objective; evaluations go on being counted together."""
        return replace(self, **changes)  # type: ignore[arg-type]

    @cached_property
    def scatter(self) -> NeckScatter | None:
        """Scatter of the nine necks, where a coupling under it is asked."""
        of = self.loaded.requirements
        if of.tolerance is None or not of.used & {*SCATTERED}:
            return None
        return NeckScatter.of(of.tolerance, of.seed)

    def found(self, values: Array) -> Found:
        """Answer designs (n, d) in file units."""
        parts = [self._found(values[k : k + CHUNK]) for k in range(0, len(values), CHUNK)]
        return Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _found(self, values: Array) -> Found:
        columns, reason = self.columns(values)
        quantities = np.where((reason == "")[:, None], self.quantities(self.corrected(columns)), np.nan)
        reason[(reason == "") & ~np.isfinite(quantities).all(axis=1)] = "a quantity without a finite value"
        return Found(quantities, reason)

    def columns(self, values: Array) -> tuple[dict[str, Array], AnyArray]:
        """Columns (n,) of the model itself by name, not corrected, and why a design has none (n,)."""
        study, of = self.loaded.study, self.loaded.requirements
        self.counts["analytic"] += len(values)
        rows = answer_designs(study, values)
        reason = np.where(rows.status == "ok", "", rows.reason).astype(object)
        found = dict(zip(study.outputs, rows.values.T, strict=True))
        found |= {column.name: values[:, k] for k, column in enumerate(study.columns)}
        with np.errstate(all="ignore"):
            designs = designs_of(study, values)
            if of.used & {*MASS}:
                found["mass_kg"] = self._masses(values, reason)
            if of.used & {*ERRORS}:
                K = np.array([found[name] for name in STIFFNESSES]).T[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
                found |= dict(zip(ERRORS, formula_errors(designs, K, of.paper_formula).T, strict=True))
            if self.scatter is not None:
                self.counts["analytic with scattered necks"] += len(values) * len(self.scatter.searched)
                freedoms = freedoms_of(of.mobility, designs.prismatic)
                couplings = self.scatter.quantiles(designs, of.formula, freedoms)
                reason[(reason == "") & np.isnan(couplings).any(axis=1)] = REFUSED
                found |= {n: self.shifts.get(n, 1.0) * each for n, each in zip(SCATTERED, couplings.T, strict=True)}
        return found, reason

    def _masses(self, values: Array, reason: AnyArray) -> Array:
        """Masses (n,), kg, of what is drawn; reasons why a design cannot be go to `reason` (n,)."""
        found = np.full(len(values), np.nan)
        for k in np.flatnonzero(reason == ""):
            self.counts["drawn"] += 1
            try:
                found[k] = float(drawn_inertia(stage_of(self.loaded.study, values[k]))[0, 0]) * UNITS["kg"].factor
            except BadInput as refusal:
                reason[k] = str(refusal)
        return found

    def corrected(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Columns times their factors, plus their terms."""
        by = self.corrections
        return {name: by[name].factor * x + by[name].term if name in by else x for name, x in columns.items()}

    def quantities(self, columns: Mapping[str, Array]) -> Array:
        """Quantities (n, q) of columns (n,) by name, derived outputs included."""
        of, study, known = self.loaded.requirements, self.loaded.study, dict(columns)
        n = len(next(iter(known.values())))
        for output in of.output:
            known[output.name] = evaluated(study, output.expression, known, n)
        return np.column_stack([evaluated(study, text, known, n) for text in of.quantities])

    @property
    def ends(self) -> tuple[Array, Array]:
        """Least and greatest values (m,) that count, guards included; infinite where there is none."""
        guard = np.minimum(0.0 if self.guard is None else self.guard * self.sizes, self.room)
        return self.low + guard, self.high - guard

    def signed(self, quantities: Array) -> Array:
        """All objectives (n, k) of quantities (n, q), with their signs: to be small."""
        return self.signs * quantities[:, : self.objectives]

    def margins(self, quantities: Array) -> Array:
        """Margins (n, m + bounds) over sizes, the lesser of both ends of a requirement, then those of the bounds."""
        low, high = self.ends
        q, signed = quantities[:, self.objectives :], self.signed(quantities)
        with np.errstate(invalid="ignore"):  # quantities without a finite value
            of_ends = np.minimum(q - low, high - q) / self.sizes
        others = [(most - signed[:, k]) / max(abs(most), 1e-30) for k, most in self.bounds.items()]
        return np.column_stack([of_ends, *others])

    def violations(self, quantities: Array) -> Array:
        """By how much of its size each requirement, and each bound, is missed (n, m + bounds)."""
        missed = -self.margins(quantities)
        if self.yielding is not None:
            missed[:, self.yielding] = 0.0
        return np.where(missed > ROUND_OFF, missed, 0.0)

    def wanted(self, quantities: Array) -> Array:
        """What is to be small (n,): the objective with its sign, or the miss of the yielding requirement."""
        if self.yielding is not None:
            return np.maximum(0.0, -self.margins(quantities)[:, self.yielding])
        return np.asarray(self.signed(quantities)[:, self.objective])

    def merit(self, found: Found) -> Array:
        """One number (n,) to be small: designs that meet all are better than others, those by how much they miss.

        Notes
        -----
        The rules of Deb (Comput. Methods Appl. Mech. Eng. 186 (2000) 311-338) as a number; misses are added in parts of
        the sizes of the requirements.
        """
        missed = np.sum(self.violations(found.quantities), axis=1)
        merit = np.where(missed > 0, MISSED * (1 + np.minimum(missed, 90.0)), self.wanted(found.quantities))
        return np.where(found.reason == "", merit, REFUSED_MERIT)

    def drawable(self, values: Array) -> bool:
        """Whether a design (d,) can be drawn: no bodies of it overlap."""
        self.counts["drawn"] += 1
        try:
            check_feasible(stage_of(self.loaded.study, values))
        except BadInput:
            return False
        return True

    def constraints(self, values: Array, quantities: Array) -> Array:
        """What must not be negative (n, c): margins end by end, of bounds, and gaps of bodies over the stage's size."""
        low, high = self.ends
        q = quantities[:, self.objectives :]
        below, above = np.isfinite(low), np.isfinite(high)
        ends = [((q - low) / self.sizes)[:, below], ((high - q) / self.sizes)[:, above]]
        with np.errstate(all="ignore"):
            designs = designs_of(self.loaded.study, values)
            every, width = conditions(designs), designs.link_width[:, None]
            notch, clear, apart, hub = (
                np.column_stack([each.room.min(axis=1) for each in every if word in each.reason])
                for word in ("notch", "swallows", "closer", "hub larger")
            )
            gaps = np.hstack([notch, clear, apart.min(axis=1, keepdims=True), hub]) / width
        return np.hstack([*ends, self.margins(quantities)[:, len(self.sizes) :], gaps])


def formula_errors(designs: Designs, stiffness: Array, formula: str) -> Array:
    """Errors (n, 3), %, along x, y, theta, of the force by a hinge formula with the stage's own mobility.

    stiffness : (n, 3, 3), of the model that answers; nan where it has none.
    """
    paper = batch_at_rest(designs, hinge_compliances(designs, formula), freedoms_of(None, designs.prismatic)).stiffness
    found, sound = np.full((len(stiffness), 3), np.nan), np.isfinite(stiffness).all(axis=(1, 2))
    compliance = np.asarray(np.linalg.inv(stiffness[sound]), dtype=np.float64)
    percent = error_matrix(paper[sound], compliance, np.ones(int(sound.sum())))
    found[sound] = np.diagonal(percent, axis1=1, axis2=2)
    return found
