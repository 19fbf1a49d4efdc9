"""Records of the findings of a study, which figures, page and terminal show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray, Array, Index, short_repr
from flexfem.mechanism.mechanism import Mechanism
from flexfem.results import SPACE


class AxisText(NamedTuple):
    """Name of an axis, its unit or "", and whether it is logarithmic."""

    name: str
    unit: str = ""
    log: bool = False

    @property
    def label(self) -> str:
        """Name and, in brackets, unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def after(self) -> str:
        """The unit as text after a number, with spaces that do not break."""
        return SPACE + self.unit.replace(" ", SPACE) if self.unit else ""


class Caption(NamedTuple):
    """Text above a figure: title, lines on the origin of its numbers, key paths of assumed and not
    stated numbers.
    """

    title: str
    lines: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str] = ()


class FigureTable(NamedTuple):
    """Numbers of a figure: headings by key, and rows of texts followed by numbers."""

    caption: str
    head: Mapping[str, str]
    rows: Sequence[Sequence[str | float]]

    @property
    def facts(self) -> list[dict[str, str | float | None]]:
        """The rows as plain data, None for numbers that are not finite."""
        plain = (
            [x if isinstance(x, str) or np.isfinite(x) else None for x in row] for row in self.rows
        )
        return [dict(zip(self.head, row, strict=True)) for row in plain]


NO_TABLE = FigureTable("", {}, [])


@short_repr
class Cells(NamedTuple):
    """Points (n, 2) of a map with values (n,), nan where there is none; `missing` marks these
    points (n,) by reason.

    grid : whether the points are all pairs of some values.   averaged : columns over which the
    values are means.
    scatter, size : median over the cells of the standard deviation in a cell, and of its number of
    designs."""

    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    averaged: tuple[str, ...] = ()
    scatter: float = 0.0
    size: int = 1


@short_repr
class StudyMap(NamedTuple):
    """A value over two factors; `marks` are emphasised contours, `base` is x and y of the base
    stage.
    """

    caption: Caption
    x: AxisText
    y: AxisText
    value: AxisText
    cells: Cells
    marks: tuple[float, ...] = ()
    base: tuple[float, float] | None = None
    table: FigureTable = NO_TABLE


@short_repr
class StudyMaps(NamedTuple):
    """Maps of several values over the same two factors, in the panels of one page."""

    caption: Caption
    maps: Sequence[StudyMap]
    table: FigureTable = NO_TABLE


class FactorCurve(NamedTuple):
    """A number over one factor by one model.

    model : words of the model.   values : (n,), nan where there is none.   bands : (n,), their
    half-widths, nan without one.   base : value of the base, None where it is not known.
    """

    model: str
    values: Array
    bands: Array
    base: float | None = None


class CurvePanel(NamedTuple):
    """The curves of one number, one for each model."""

    quantity: AxisText
    curves: Sequence[FactorCurve]


@short_repr
class Curves(NamedTuple):
    """Numbers over one factor.

    x : the factor.   places : (n,), its values, ascending.   panels : one for each number.
    missing : marks the places (n,) without a result, or outside constraints, by reason.
    counts : number of designs by reason, of all designs.   base : the factor of the base."""

    caption: Caption
    x: AxisText
    places: Array
    panels: Sequence[CurvePanel]
    missing: Mapping[str, AnyArray]
    counts: Mapping[str, int]
    base: float | None = None
    table: FigureTable = NO_TABLE


class Trend(NamedTuple):
    """Medians (k,) of a number at values or in intervals (k,) of a factor, over all other factors;
    `low` and `high`, (k,), enclose nine of ten designs.
    """

    places: Array
    medians: Array
    low: Array
    high: Array


@short_repr
class Effects(NamedTuple):
    """Numbers over each of several factors, the others varying as well.

    trends : by number, then by factor.   points : (n, factors), factors of the drawn designs.
    values : (n, numbers), their numbers.   base : factors, then numbers, of the base; nan where
    not known."""

    caption: Caption
    factors: Sequence[AxisText]
    numbers: Sequence[AxisText]
    trends: Sequence[Sequence[Trend]]
    points: Array
    values: Array
    base: tuple[Array, Array]
    table: FigureTable = NO_TABLE


class Percentile(NamedTuple):
    """A percentile of a sample and its confidence interval, with an infinite end where the sample
    is too small.
    """

    percent: float
    value: float
    low: float
    high: float


@short_repr
class Scatter(NamedTuple):
    """Scatter of one quantity (n,): percentiles from low to high, and the value of the base stage
    where known.
    """

    quantity: AxisText
    values: Array
    percentiles: Sequence[Percentile]
    nominal: float | None = None


@short_repr
class Distribution(NamedTuple):
    """Scatter of several quantities."""

    caption: Caption
    scatters: Sequence[Scatter]
    table: FigureTable = NO_TABLE


class Share(NamedTuple):
    """Sobol indices (k,) of one quantity by factor, and half-widths of their confidence intervals;
    total indices where the sampling gives them."""

    first: Array
    first_band: Array
    total: Array | None = None
    total_band: Array | None = None
    quantity: AxisText = AxisText("")


@short_repr
class Sensitivity(NamedTuple):
    """Sobol indices of several quantities, and names of the factors in the order of the indices."""

    caption: Caption
    shares: Sequence[Share]
    factors: Sequence[str]
    table: FigureTable = NO_TABLE


class Chosen(NamedTuple):
    """A drawn design of a front: its `place` among the points, its stage, and the numbers below it."""

    place: int
    stage: Mechanism
    numbers: Sequence[tuple[AxisText, float]]


@short_repr
class ParetoFront(NamedTuple):
    """Pareto front of two quantities.

    points : (n, 2), x and y of every feasible design.   front : (m,), places of the designs on the
    front, in order.
    undrawable : (k,), places of designs on the front or better that cannot be drawn.
    left_out : designs that are not shown, one line for each kind.   base : x and y of the base
    stage.
    power : slope of log y over log x along the front.   gain : ratio of y to that of the base
    stage, for the best design no worse in x and no larger."""

    caption: Caption
    x: AxisText
    y: AxisText
    better: tuple[str, str]
    points: Array
    front: Index
    undrawable: Index
    chosen: Sequence[Chosen]
    left_out: Sequence[str]
    base: tuple[float, float] | None = None
    power: float | None = None
    gain: float | None = None
    table: FigureTable = NO_TABLE


class Refused(NamedTuple):
    """The reason, in one line, why a figure cannot be drawn from this table."""

    reason: str


Record: TypeAlias = (
    StudyMap | StudyMaps | Curves | Effects | Distribution | Sensitivity | ParetoFront
)
