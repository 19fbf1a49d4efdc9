"""The analytic model of any mechanism for many designs at once.

The numbers are those of `questions.designs.QUANTITIES`. Closed-form conditions refuse designs: the
limits of all numbers of the file, profiles that do not exist, cuts lower than their hinge,
actuators without a direction. Overlaps and clearances of the drawing are not checked; a study with
`check = "drawing"` computes designs one after the other, and a search draws the designs that it
takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import flexfem
from flexfem.analytic.designs import alike_hinges
from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import one_line
from flexfem.hinges.fitted import SmoothFit, chebyshev_points, fitted
from flexfem.hinges.wide_many import ACCURACY, COARSEST, WideHinge
from flexfem.mechanism.keys import keys
from flexfem.mechanism.layouts import HingeDesigns, Layouts
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.outlines import SHORTEST
from flexfem.questions.designs import QUANTITIES, answers
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.batch import Batch, BatchRows
from flexfem.study.columns import LONGEST
from flexfem.study.factors import Column, Factor
from flexfem.study.plan import Study

MOST = 4096  # designs of one call: of a mechanism with 24 hinges they take 200 MB
PART = 8192
FEW = 100  # designs of a study at once below which their wide hinges are computed one by one
WIDEST = 5.0  # standard deviations of a factor between which hinges are fitted
MOST_MOVED = 10  # columns with an effect on a hinge that is fitted
HOW_CHECKED = (
    "designs are computed as arrays and refused by closed-form conditions; overlaps and clearances "
    'of the drawing are not checked, as with check = "drawing"; ratios of hinges in three '
    f"dimensions are fitted to {COARSEST:.0e} or better"
)


class _Output(NamedTuple):
    """An output: its question and quantity, its place among the flat values, and its unit per
    internal unit.
    """

    question: str
    quantity: str
    place: int
    factor: float


def batch(
    base: Mechanism,
    study: Study,
    columns: Sequence[Column],
) -> Batch | None:
    """Return the designs of a study as arrays, None where they are computed one after the other.

    These are designs that are drawn, those that differ in what has no arrays, such as a number of
    copies, and those of which other numbers are asked.
    """
    paths = [path for column in columns for path in column.keys]
    if study.draws or base.without_arrays(paths):
        return None
    questions = {path.partition(".")[0] for path in study.outputs}
    if not questions or not questions <= QUANTITIES.keys():
        return None
    known = dict[str, _Output]()
    for question in sorted(questions):
        known |= _outputs_of(base, question)
    if not known.keys() >= {*study.outputs}:
        return None
    return ArrayBatch(base, study, columns, [known[path] for path in study.outputs])


def _outputs_of(base: Mechanism, question: str) -> dict[str, _Output]:
    """Return the outputs of a question that arrays compute, by path; none of a base without a
    solution.
    """
    options: dict[str, Any] = {"no_limits": True} if question == "stiffness" else {}
    try:
        found = getattr(flexfem, question)(base, models="analytic", **options)
    except (BadInput, ComputationFailed):
        return {}
    outputs = dict[str, _Output]()
    paths = iter([entry.path for entry in found.entries()])
    for name, values in found.values.items():
        factors = found.quantities[name].factors(values.shape)
        for place, factor in enumerate(np.ravel(factors).tolist()):
            path = next(paths)
            if name in QUANTITIES[question]:
                outputs[f"{question}.{path}"] = _Output(question, name, place, factor)
    return outputs


class ArrayBatch:
    """The analytic network of a mechanism for the designs of a study, a `Batch`."""

    most = MOST
    part = PART

    def __init__(
        self,
        base: Mechanism,
        study: Study,
        columns: Sequence[Column],
        outputs: Sequence[_Output],
    ) -> None:
        self.base = base
        self.study = study
        self.columns = columns
        self._found = outputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """All outputs of the study."""
        return self.study.outputs

    def rows(
        self,
        values: Array,
        reasons: AnyArray,
    ) -> BatchRows:
        """Return the results of designs (n, columns)."""
        reasons = reasons.astype(object)
        self._refuse_limits(values, reasons)
        possible = np.flatnonzero(reasons == "")
        layouts = self._layouts(values[possible])
        for index in np.flatnonzero(layouts.refused):
            reasons[possible[index]] = one_line(layouts.reason(int(index)), LONGEST)
        found = np.full((len(values), len(self.outputs)), np.nan)
        solved = np.flatnonzero(reasons == "")
        for alike in self._with_equal_corners(values, solved):
            found[alike] = self._solved(self._layouts(values[alike]))
        left = (reasons == "") & ~np.all(np.isfinite(found), axis=1)
        return BatchRows(reasons, found, left)

    def rooms(self, values: Array) -> Array:
        """Return no rooms: the conditions are those of single numbers."""
        return np.empty((len(values), 0))

    def sizes(self, columns: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the sizes of matrix entries whose diagonals are outputs, too."""
        found = dict[str, Array]()
        for name in columns:
            *head, row, column = name.split(".")
            if head[-2:-1] and head[-2] in ("compliance", "stiffness") and row != column:
                diagonal = [".".join([*head, each, each]) for each in (row, column)]
                if all(each in columns for each in diagonal):
                    first, second = (np.abs(columns[each]) for each in diagonal)
                    found[name] = np.sqrt(first * second)
        return found

    def _layouts(self, values: Array) -> Layouts:
        given = {
            path: np.ascontiguousarray(values[:, k])
            for k, column in enumerate(self.columns)
            for path in column.keys
        }
        return self.base.layouts(given, len(values))

    def _refuse_limits(
        self,
        values: Array,
        reasons: AnyArray,
    ) -> None:
        """Refuse values outside the limits of their keys."""
        for column, numbers in zip(self.columns, values.T, strict=True):
            for path in column.keys:
                limits = keys()[path].number
                for index in np.flatnonzero(limits.refuses(numbers) & (reasons == "")):
                    value = float(numbers[index])
                    reasons[index] = f"{path} = {value:g}, expected {limits.expected(value)}"

    def _with_equal_corners(
        self,
        values: Array,
        designs: AnyArray,
    ) -> list[AnyArray]:
        """Return the designs in groups whose leaves have fillets alike, or are without them."""
        patterns = np.zeros(len(designs), dtype=np.int64)
        for hinge in self._layouts(values[designs]).hinges:
            fillet = getattr(hinge.profile, "fillet", 0.0)
            if isinstance(fillet, np.ndarray) and not np.all(fillet > SHORTEST):
                patterns = 2 * patterns + (fillet[:, 0] > SHORTEST)
                patterns = np.unique(patterns, return_inverse=True)[1]
        return [designs[patterns == pattern] for pattern in np.unique(patterns)]

    def _solved(self, layouts: Layouts) -> Array:
        """Return the outputs (n, outputs) of designs that are not refused."""
        wanted = dict[str, set[str]]()
        for each in self._found:
            wanted.setdefault(each.question, set()).add(each.quantity)
        found = answers(layouts, lambda hinge: self._ratios(layouts, hinge), wanted)
        columns = list[Array]()
        for each in self._found:
            flat = found[each.question][each.quantity].reshape(layouts.number, -1)
            columns.append(each.factor * flat[:, each.place])
        return np.column_stack(columns)

    # wide hinges

    def _ratios(
        self,
        layouts: Layouts,
        hinge: HingeDesigns,
    ) -> Array | None:
        if self.base.model != "three_dimensional":
            return None
        is_search = self.study.count == 1  # which has no number of designs
        fits = self._fits if is_search or layouts.number >= FEW else {}
        return _wide(layouts, hinge).ratios(fits.get(hinge.name))

    @property
    def error_of_fits(self) -> float:
        """Largest relative error of the fits of ratios of wide hinges."""
        return max((fit.error for fit in self._fits.values()), default=0.0)

    @cached_property
    def _fits(self) -> dict[str, SmoothFit]:
        """Fits of the ratios of wide hinges by name, of those that vary between known ends."""
        space = _Space.of([column.factor for column in self.columns])
        if space is None:
            return {}
        fits = dict[str, SmoothFit]()
        layouts = self._layouts(space.one_by_one())
        for group in alike_hinges(layouts):
            first = layouts.hinges[group[0]]
            variables = _wide(layouts, first).variables
            moved = np.flatnonzero(np.any(variables[1:] != variables[:1], axis=1))
            if variables.shape[1] and len(moved) <= MOST_MOVED:
                fit = self._fitted(group[0], _wide(layouts, first), space, moved)
                if fit is not None:
                    fits |= {layouts.hinges[number].name: fit for number in group}
        return fits

    def _fitted(
        self, number: int, wide: WideHinge, space: _Space, moved: AnyArray
    ) -> SmoothFit | None:
        """Return the fit of the hinge with a number, on which the `moved` columns have an effect."""

        def points_of(count: int) -> Array:
            layouts = self._layouts(space.points(moved, count))
            possible = ~layouts.refused
            return _wide(layouts, layouts.hinges[number]).variables[possible]

        return fitted(points_of, wide.factors_at, ACCURACY, COARSEST)


def _wide(layouts: Layouts, hinge: HingeDesigns) -> WideHinge:
    return WideHinge(hinge.profile, hinge.material.poissons_ratio, layouts.thickness)


class _Space(NamedTuple):
    """The ends (columns,) of factors, and which of them are uniform in the logarithm."""

    low: Array
    high: Array
    logarithmic: AnyArray

    @classmethod
    def of(cls, factors: Sequence[Factor]) -> _Space | None:
        """Return the space of factors, None where one has no ends."""
        ends = [_ends(factor) for factor in factors]
        if not ends or None in ends:
            return None
        low, high = np.array(ends, dtype=float).T
        scales = [factor.scale == "log" for factor in factors]
        return cls(low, high, np.array(scales) & (low > 0))

    def at(self, shares: Array) -> Array:
        """Return factor values (n, columns) at shares (n, columns), 0 to 1, of the way."""
        even = self.low + (self.high - self.low) * shares
        with np.errstate(all="ignore"):
            scaled = self.low * (self.high / self.low) ** shares
        return np.asarray(np.where(self.logarithmic, scaled, even))

    def one_by_one(self) -> Array:
        """Return the middle, and the middle with one factor after the other moved."""
        count = len(self.low)
        shares = np.full((1 + count, count), 0.5)
        shares[1 + np.arange(count), np.arange(count)] = 0.6
        return self.at(shares)

    def points(
        self,
        moved: AnyArray,
        count: int,
    ) -> Array:
        """Return factor values (count, columns) that fill the ranges of the `moved` columns."""
        shares = np.full((count, len(self.low)), 0.5)
        shares[:, moved] = chebyshev_points(len(moved), count)
        return self.at(shares)


def _ends(factor: Factor) -> tuple[float, float] | None:
    """Return the ends of the values of a factor, None of one that a table gives."""
    if factor.values is not None:
        return min(factor.values), max(factor.values)
    if factor.kind == "range":
        return _pair(factor.start, factor.end)
    if factor.kind == "normal" and factor.mean is not None and factor.sd is not None:
        low = factor.mean - WIDEST * factor.sd
        high = factor.mean + WIDEST * factor.sd
        stated_low = low if factor.lower is None else factor.lower
        stated_high = high if factor.upper is None else factor.upper
        return max(low, stated_low), min(high, stated_high)
    return _pair(factor.lower, factor.upper)


def _pair(low: float | None, high: float | None) -> tuple[float, float] | None:
    return None if low is None or high is None else (low, high)
