"""Numbers over each of several factors, while the other factors vary as well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexfem.arrays import Array
from flexfem.study.curves import evenly, scaled
from flexfem.study.records import AxisText, Effects, FigureTable, Trend
from flexfem.study.source import Source

MOST_READ = 50_000  # designs of which trends are computed, evenly taken
MOST_DOTS = 1_000  # drawn designs of a panel
MOST_FACTORS = 5  # of one page
LEVELS = 12  # most values of a factor that are kept apart
FEW = 5  # least number of designs in an interval
INTERVALS = 10  # of a factor with more values
NINE_OF_TEN = (5.0, 50.0, 95.0)  # percentiles


def effects_of(
    source: Source,
    factors: Sequence[str],
    numbers: Sequence[str],
    *lines: str,
) -> Effects:
    """Return the effects of factors on numbers, with the factors of the strongest trends only if
    there are more than a page can show; `lines` are added to the caption.
    """
    rows = evenly(np.flatnonzero(source.table.kept), MOST_READ)
    values = np.column_stack([source.drawable(name)[rows] for name in numbers])
    columns = {name: source.table.columns[name][rows] for name in factors}
    trends = {
        name: [_trend(places, each, source.quantity(name).log) for each in values.T]
        for name, places in columns.items()
    }
    shown = strongest(trends)
    dots = evenly(np.arange(len(rows)), MOST_DOTS)
    notes = [*lines, "Line: median over the other factors; shaded: nine of ten designs."]
    if len(shown) < len(factors):
        notes.append(f"Of {len(factors)} factors, the {len(shown)} with the strongest trends.")
    return Effects(
        source.caption("Numbers over each factor", numbers, *notes),
        [source.quantity(name) for name in shown],
        _axes_of(source, numbers, values),
        [[trends[name][k] for name in shown] for k in range(len(numbers))],
        np.column_stack([columns[name][dots] for name in shown]),
        values[dots],
        (_of_base(source, shown), _of_base(source, numbers)),
        _table_of_trends(source, numbers, {name: trends[name] for name in shown}),
    )


def _axes_of(
    source: Source,
    numbers: Sequence[str],
    values: Array,
) -> list[AxisText]:
    """Return the axes of numbers with values (n, numbers)."""
    pairs = zip(numbers, values.T, strict=True)
    return [scaled(source.quantity(name), [each]) for name, each in pairs]


def _of_base(source: Source, names: Sequence[str]) -> Array:
    """Return the numbers of the base in columns, nan where they are not known."""
    found = [source.base_value(name) for name in names]
    return np.array([np.nan if value is None else value for value in found])


def _trend(
    places: Array,
    values: Array,
    log: bool,
) -> Trend:
    """Return the percentiles of values (n,) at the values of a factor (n,), or in intervals of it."""
    levels, group = np.unique(places, return_inverse=True)
    least = 1
    if len(levels) > LEVELS:
        least = FEW
        scale = np.log(places) if log else places
        ends = np.linspace(scale.min(), scale.max(), INTERVALS + 1)
        group = np.clip(np.searchsorted(ends, scale, side="right") - 1, 0, INTERVALS - 1)
        middle = (ends[1:] + ends[:-1]) / 2
        levels = np.exp(middle) if log else middle
    found = np.full((len(levels), 3), np.nan)
    for level in range(len(levels)):
        inside = values[(group == level) & np.isfinite(values)]
        if len(inside) >= least:
            found[level] = np.percentile(inside, NINE_OF_TEN)
    return Trend(levels, found[:, 1], found[:, 0], found[:, 2])


def strongest(trends: Mapping[str, Sequence[Trend]]) -> list[str]:
    """Return at most `MOST_FACTORS` factors, in their order, of the trends of numbers by factor:
    those over which the median of a number changes most, relative to the change over all factors.
    """
    names = [*trends]
    if len(names) <= MOST_FACTORS:
        return names
    spans = np.array([[_span(trend) for trend in trends[name]] for name in names])
    largest = spans.max(axis=0)
    shares = spans / np.where(largest > 0, largest, 1.0)
    first = np.argsort(-shares.max(axis=1), kind="stable")[:MOST_FACTORS]
    return [names[place] for place in sorted(first)]


def _span(trend: Trend) -> float:
    known = trend.medians[np.isfinite(trend.medians)]
    return float(np.ptp(known)) if len(known) else 0.0


def _table_of_trends(
    source: Source,
    numbers: Sequence[str],
    trends: Mapping[str, Sequence[Trend]],
) -> FigureTable:
    """Return the table of the medians at both ends of every factor."""
    rows = list[Sequence[str | float]]()
    for place, name in enumerate(numbers):
        for factor, each in trends.items():
            trend = each[place]
            texts = (source.quantity(name).label, source.quantity(factor).label)
            ends = (trend.places[0], trend.medians[0], trend.places[-1], trend.medians[-1])
            rows.append((*texts, *map(float, ends)))
    head = {
        "quantity": "number",
        "factor": "factor",
        "first": "from",
        "median_first": "median there",
        "last": "to",
        "median_last": "median there",
    }
    return FigureTable("Medians at both ends of every factor", head, rows)
