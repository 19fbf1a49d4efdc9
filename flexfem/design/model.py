"""The free dimensions, and what the analytic model, corrected by finite elements, says of many designs at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import at_rest, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array
from flexfem.design.requirements import MASS, SCATTERED, Free, LoadedRequirements
from flexfem.design.scatter import REFUSED, NeckScatter
from flexfem.mechanism.bodies import drawn_inertia
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.feasibility import check_feasible, conditions
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.study.answer import answer_designs
from flexfem.study.columns import ERRORS, STIFFNESSES
from flexfem.study.factors import Column
from flexfem.study.loaded import designs_of, evaluated, stage_of
from flexfem.units import UNITS

MISSED = 1e30  # merit of a design that misses requirements, and more
REFUSED_MERIT = 100 * MISSED  # of one that has no answer, or cannot be drawn
ROUND_OFF = 1e-9  # of a size: less is not missed
BETWEEN = 0.45  # of what lies between two ends, that a value can be kept from both
NEAR = 0.1  # finite elements over the model, and the inverse: beyond it they differ by a term, not by a factor
WHOLE = 6  # dimensions up to which every combination of neighbours is looked at, beyond it pairs of them


Say = Callable[[str], object]


def silent(text: str) -> None:
    """Say nothing."""


class DesignSpace:
    """All free dimensions; designs are rows (n, d) of values in file units.

    `allowed` has the values (k,) of each dimension that can be made, rising, none where all can; those `listed` are of
    a list, not of a range with steps.
    """

    def __init__(self, columns: tuple[Column, ...]) -> None:
        factors = [column.factor for column in columns if isinstance(column.factor, Free)]
        self.size, self.names = len(columns), [column.name for column in columns]
        self.allowed = [factor.allowed for factor in factors]
        ends = [made[[0, -1]] if len(made) else (f.start, f.end) for f, made in zip(factors, self.allowed, strict=True)]
        self.low, self.high = np.array(ends, dtype=float).T
        self.continuous = np.array([len(made) == 0 for made in self.allowed])
        self.listed = np.array([factor.values is not None for factor in factors])
        self.log = np.array([factor.scale == "log" for factor in factors]) & ~self.listed
        self.ratio = np.divide(self.high, self.low, out=np.ones(self.size), where=self.log)

    def named(self, values: Array) -> dict[str, float]:
        """A design (d,) by the names of its dimensions."""
        return dict(zip(self.names, map(float, values), strict=True))

    def from_unit(self, u: Array) -> Array:
        """Designs (n, d) at places (n, d) from 0 to 1; values of a list are each as likely."""
        values = np.where(self.log, self.low * self.ratio**u, self.low + (self.high - self.low) * u)
        for k in map(int, np.flatnonzero(self.listed)):
            made = self.allowed[k]
            values[:, k] = made[np.minimum((u[:, k] * len(made)).astype(int), len(made) - 1)]
        return np.asarray(values)

    def to_unit(self, values: Array) -> Array:
        """Places (n, d), from 0 to 1, of designs (n, d)."""
        u = (values - self.low) / np.where(self.high > self.low, self.high - self.low, 1.0)
        u[:, self.log] = np.log(values[:, self.log] / self.low[self.log]) / np.log(self.ratio[self.log])
        for k in map(int, np.flatnonzero(self.listed)):
            u[:, k] = (self._nearest(k, values[:, k]) + 0.5) / len(self.allowed[k])
        return np.asarray(np.clip(u, 0, 1))

    def snapped(self, values: Array) -> Array:
        """The nearest designs (n, d) that can be made."""
        found = values.copy()
        for k in map(int, np.flatnonzero(~self.continuous)):
            found[:, k] = self.allowed[k][self._nearest(k, values[:, k])]
        return found

    def beside(self, k: int, x: float) -> list[float]:
        """The nearest value of dimension k that can be made and those next to it; of a continuous one `x` alone."""
        if self.continuous[k]:
            return [x]
        place = int(self._nearest(k, np.array([x]))[0])
        return [float(each) for each in self.allowed[k][max(place - 1, 0) : place + 2]]

    def neighbours(self, values: Array) -> Array:
        """Designs (n, d) one step away from `values` (d,) in any dimensions, in any two where there are many."""
        beside = [self.beside(k, float(x)) for k, x in enumerate(values)]
        if sum(len(each) > 1 for each in beside) <= WHOLE:
            return np.array(list(product(*beside)))
        found = [values]
        for pair in combinations(range(self.size), 2):
            for moved in product(*(beside[k] for k in pair)):
                found.append(values.copy())
                found[-1][list(pair)] = moved
        return np.unique(np.array(found), axis=0)

    def _nearest(self, k: int, x: Array) -> AnyArray:
        return np.asarray(np.argmin(np.abs(self.allowed[k] - x[:, None]), axis=1))


class Correction(NamedTuple):
    """What turns a column of the analytic model into one of finite elements: times `factor`, plus `term`."""

    factor: float = 1.0
    term: float = 0.0


def correction_of(model: float, elements: float) -> Correction:
    """That by which a number of the model becomes one of finite elements."""
    if model != 0 and NEAR < elements / model < 1 / NEAR:
        return Correction(elements / model)
    return Correction(term=elements - model)


@dataclass
class Model:
    """The corrected analytic model of requirements; every evaluation is counted, and a search may `say` how far it is.

    `corrections` are by column. `guard` (m,) says by how much of its size each requirement is to be met beyond its end;
    `objective` which one is to be best while `bounds` are values, with their signs, that others must not exceed. A
    `yielding` requirement is not asked: its miss is what is to be small instead of the objective.
    """

    loaded: LoadedRequirements
    corrections: Mapping[str, Correction] = field(default_factory=dict)
    guard: Array | float = 0.0
    objective: int = 0
    bounds: Mapping[int, float] = field(default_factory=dict)
    yielding: int | None = None
    counts: Counter[str] = field(default_factory=Counter)
    say: Say = silent

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

    @property
    def scatter(self) -> NeckScatter | None:
        """Scatter of the nine necks, where a coupling under it is asked."""
        of = self.loaded.requirements
        return NeckScatter.of(of.tolerance, of.seed) if of.tolerance and of.used & {*SCATTERED} else None

    def found(self, values: Array) -> Array:
        """Quantities (n, q) of designs (n, d) in file units, objectives first; not finite without an answer."""
        columns, reason = self.columns(values)
        return np.where((reason == "")[:, None], self.quantities(self.corrected(columns)), np.nan)

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
                couplings = self.scatter.quantiles(designs, of.formula, of.mobility)
                reason[(reason == "") & np.isnan(couplings).any(axis=1)] = REFUSED
                found |= dict(zip(SCATTERED, couplings.T, strict=True))
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
        guard = np.minimum(self.guard * self.sizes, self.room)
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

    def merit(self, quantities: Array) -> Array:
        """One number (n,) to be small: designs that meet all are better than others, those by how much they miss.

        Notes
        -----
        The rules of Deb (Comput. Methods Appl. Mech. Eng. 186 (2000) 311-338) as a number; misses are added in parts of
        the sizes of the requirements.
        """
        missed = np.sum(self.violations(quantities), axis=1)
        merit = np.where(missed > 0, MISSED * (1 + np.minimum(missed, 90.0)), self.wanted(quantities))
        return np.where(np.isfinite(quantities).all(axis=1), merit, REFUSED_MERIT)

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
        ends = [((q - low) / self.sizes)[:, np.isfinite(low)], ((high - q) / self.sizes)[:, np.isfinite(high)]]
        with np.errstate(all="ignore"):
            designs = designs_of(self.loaded.study, values)
            every = conditions(designs)
            notch, clear, apart, hub = (
                np.column_stack([each.room.min(axis=1) for each in every if word in each.wrong])
                for word in ("notch", "swallows", "closer", "hub larger")
            )
            gaps = np.hstack([notch, clear, apart.min(axis=1, keepdims=True), hub]) / designs.link_width[:, None]
        return np.hstack([*ends, self.margins(quantities)[:, len(self.sizes) :], gaps])


def formula_errors(designs: Designs, stiffness: Array, formula: str) -> Array:
    """Errors (n, 3), %, along x, y, theta, of the force by a hinge formula with the stage's own mobility.

    stiffness : (n, 3, 3), of the model that answers; nan where it has none.
    """
    paper = at_rest(designs, hinge_compliances(designs, formula), freedoms_of(None, designs.prismatic)).stiffness
    found, sound = np.full((len(stiffness), 3), np.nan), np.isfinite(stiffness).all(axis=(1, 2))
    percent = error_matrix(paper[sound], np.asarray(np.linalg.inv(stiffness[sound])), np.ones(int(sound.sum())))
    found[sound] = np.diagonal(percent, axis1=1, axis2=2)
    return found
