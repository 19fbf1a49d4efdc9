"""What the analytic model, corrected by finite elements, says of many designs at once; every evaluation is counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.feasibility import check_feasible, conditions
from flexfem.refused import BadInput
from flexfem.study.answer import answer_designs
from flexfem.study.columns import ERRORS, STIFFNESSES
from flexfem.study.loaded import designs_of, evaluated, stage_of
from flexfem.synthesis import extra
from flexfem.synthesis.requirements import MASS, SCATTERED, LoadedRequirements
from flexfem.synthesis.scatter import LOST
from flexfem.synthesis.space import DesignSpace

CHUNK = 2048  # designs at a time
WORST = 1e30  # merit of a design that breaks requirements is this and more, of one that is refused a hundred times this
ROUND_OFF = 1e-9  # of a size: less is not missed
BETWEEN = 0.45  # of what lies between two ends, that a value can be kept from both
NEAR = 0.1  # finite elements over the model, and the inverse: beyond it they differ by a term, not by a factor


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
    """Of n designs: quantities (n, q), objectives first, nan where there are none, and why not (n,), text, "" else."""

    quantities: Array
    reason: AnyArray


class Smooth(NamedTuple):
    """Of n designs: objective (n,), and what must not be negative (n, k): margins of requirements, gaps of bodies."""

    objective: Array
    margins: Array


@dataclass
class Model:
    """The corrected analytic model of requirements.

    corrections : by column.   shifts : by column, its value of other stages than it is searched with over its own.
    guard : (m,), by how much of its size each requirement is to be met beyond its end.
    tightened : by requirement, by how much of its size the lower end rises, or where negative the upper one falls.
    objective : which of them is to be best.   bounded : values that the others must not exceed, with their signs.
    """

    loaded: LoadedRequirements
    corrections: Mapping[str, Correction] = field(default_factory=dict)
    shifts: Mapping[str, float] = field(default_factory=dict)
    guard: Array | None = None
    tightened: Mapping[int, float] = field(default_factory=dict)
    objective: int = 0
    bounded: Mapping[int, float] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)

    @cached_property
    def space(self) -> DesignSpace:
        """The free dimensions."""
        return DesignSpace(self.loaded.columns)

    def changed(self, **changes: object) -> Model:
        """The same with other corrections, guards or objective; evaluations go on being counted together."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def found(self, values: Array) -> Found:
        """Answer designs (n, d) in file units."""
        parts = [self._found(values[k : k + CHUNK]) for k in range(0, len(values), CHUNK)]
        return Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _found(self, values: Array) -> Found:
        columns, reason = self.columns(values)
        corrected = {name: self._corrected(name, column) for name, column in columns.items()}
        quantities = np.where((reason == "")[:, None], self.quantities(corrected, len(values)), np.nan)
        reason[(reason == "") & ~np.isfinite(quantities).all(axis=1)] = "a quantity without a finite value"
        return Found(quantities, reason)

    def columns(self, values: Array) -> tuple[dict[str, Array], AnyArray]:
        """Columns (n,) of the model itself by name, not corrected, and why a design has none (n,)."""
        loaded, of = self.loaded.study, self.loaded.requirements
        self.counts["analytic"] += len(values)
        rows = answer_designs(loaded, values)
        reason = np.where(rows.status == "ok", "", rows.reason).astype(object)
        found = dict(zip(loaded.outputs, rows.values.T, strict=True))
        found |= {column.name: values[:, k] for k, column in enumerate(loaded.columns)}
        with np.errstate(all="ignore"):
            designs = designs_of(loaded, values)
            if of.asked & {*MASS}:
                self.counts["drawn"] += int(np.sum(reason == ""))
                found["mass_kg"] = extra.masses(loaded, values, reason)
            if of.asked & {*ERRORS}:
                K = np.array([found[name] for name in STIFFNESSES]).T[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
                found |= dict(zip(ERRORS, extra.formula_errors(designs, K, of.paper_formula).T, strict=True))
            if (scatter := self.loaded.scatter) is not None:
                self.counts["analytic with scattered necks"] += len(values) * len(scatter.searched)
                couplings = scatter.searched_values(loaded, designs)
                reason[(reason == "") & np.isnan(couplings).any(axis=1)] = LOST
                found |= {n: self.shifts.get(n, 1.0) * of for n, of in zip(SCATTERED, couplings.T, strict=True)}
        return found, reason

    def _corrected(self, name: str, column: Array) -> Array:
        by = self.corrections.get(name)
        return column if by is None else by.factor * column + by.term

    def quantities(self, columns: Mapping[str, Array], n: int) -> Array:
        """Quantities (n, q) of columns by name, derived outputs included."""
        of, known = self.loaded.requirements, dict(columns)
        for output in of.output:
            known[output.name] = evaluated(self.loaded.study, output.expression, known, n)
        return np.column_stack([evaluated(self.loaded.study, text, known, n) for text in of.quantities])

    @cached_property
    def scales(self) -> Array:
        """Sizes (m,) of the requirements: the end, or where that is zero one unit of the quantity."""
        ends = [(each.at_least, each.at_most) for each in self.loaded.requirements.require]
        return np.array([max(abs(low or 0.0), abs(high or 0.0)) or 1.0 for low, high in ends])

    @cached_property
    def room(self) -> Array:
        """The most (m,) by which values can be kept from both ends of a requirement; infinite where there is one."""
        of = self.loaded.requirements.require
        return np.array(
            [
                np.inf if each.at_least is None or each.at_most is None else BETWEEN * (each.at_most - each.at_least)
                for each in of
            ]
        )

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Least and greatest values (m,) that count, guards included; infinite where there is none."""
        of = self.loaded.requirements.require
        guard = np.minimum(0.0 if self.guard is None else self.guard * self.scales, self.room)
        more = np.array([self.tightened.get(k, 0.0) for k in range(len(of))]) * self.scales
        low = np.array([-np.inf if each.at_least is None else each.at_least for each in of]) + guard
        high = np.array([np.inf if each.at_most is None else each.at_most for each in of]) - guard
        return low + np.maximum(more, 0.0), high + np.minimum(more, 0.0)

    @property
    def objectives(self) -> int:
        """How many there are."""
        return len(self.loaded.requirements.objective)

    @cached_property
    def signs(self) -> Array:
        """What turns the objectives (k,) into ones that are to be small."""
        return np.array([each.sign for each in self.loaded.requirements.objective])

    def signed(self, quantities: Array) -> Array:
        """All objectives (n, k) of quantities (n, q), with their signs: to be small."""
        return self.signs * quantities[:, : self.objectives]

    def wanted(self, found: Found) -> Array:
        """The objective (n,), with its sign: to be small."""
        return self.signed(found.quantities)[:, self.objective]

    def violations(self, found: Found) -> Array:
        """By how much of its size each requirement, and each bounded objective, is missed (n, m + bounded)."""
        missed = -np.stack([np.zeros(len(found.reason)), *self.margins(found)], axis=1)[:, 1:]
        return np.where(missed > ROUND_OFF, missed, 0.0)

    def margins(self, found: Found) -> list[Array]:
        """Margins over sizes, (n,) each: the lesser of both ends of a requirement."""
        low, high = self.ends
        q = found.quantities[:, self.objectives :]
        with np.errstate(invalid="ignore"):  # quantities without a finite value
            of_ends = np.minimum(q - low, high - q) / self.scales
        signed = self.signed(found.quantities)
        more = [(most - signed[:, k]) / max(abs(most), 1e-30) for k, most in self.bounded.items()]
        return [*of_ends.T, *more]

    def merit(self, found: Found) -> Array:
        """One number (n,) to be small: designs that meet all are better than others, those by how much they miss.

        Notes
        -----
        The rules of Deb (Comput. Methods Appl. Mech. Eng. 186 (2000) 311-338) as a number; what is missed adds up in
        parts of the sizes of the requirements.
        """
        missed = np.sum(self.violations(found), axis=1)
        merit = np.where(missed > 0, WORST * (1 + np.minimum(missed, 90.0)), self.wanted(found))
        return np.where(found.reason == "", merit, 100 * WORST)

    def drawable(self, values: Array) -> str:
        """Why a design (d,) cannot be drawn, "" where it can."""
        self.counts["drawn"] += 1
        try:
            check_feasible(stage_of(self.loaded.study, values))
        except BadInput as refusal:
            return str(refusal)
        return ""

    def smooth(self, values: Array, size: float) -> Smooth:
        """As `found`, of requirements end by end and of what keeps bodies apart, the objective over its `size`."""
        found = self.found(values)
        low, high = self.ends
        q = found.quantities[:, self.objectives :]
        margins = [(q[:, k] - low[k]) / self.scales[k] for k in np.flatnonzero(np.isfinite(low))]
        margins += [(high[k] - q[:, k]) / self.scales[k] for k in np.flatnonzero(np.isfinite(high))]
        margins += self.margins(found)[len(self.scales) :]
        return Smooth(self.wanted(found) / size, np.column_stack([*margins, self.gaps(values)]))

    @property
    def soft(self) -> int:
        """How many of the margins of `smooth` are those of requirements and bounded objectives."""
        low, high = self.ends
        return int(np.isfinite(low).sum() + np.isfinite(high).sum()) + len(self.bounded)

    def gaps(self, values: Array) -> Array:
        """Gaps (n, 8) of the closed conditions over sizes of the stage: notches, platform, neighbours, hub."""
        with np.errstate(all="ignore"):
            designs = designs_of(self.loaded.study, values)
            of = conditions(designs)
            width = designs.link_width[:, None]
            notch = np.min(of.deepest - designs.radius, axis=1) / width
            own = designs.platform_radius[:, None, None] + designs.radius + designs.neck / 2
            clear = np.min(of.distance - own, axis=1) / width
            apart = np.min(of.gap - of.radii, axis=1, keepdims=True) / width
            hub = (designs.platform_radius - designs.hub_radius)[:, None] / width
        return np.hstack([notch, clear, apart, hub])
