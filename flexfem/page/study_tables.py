"""What the figures of a study show, as tables of a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.page.section import Cell, table
from flexfem.page.study_designs import cleared, values_at, written
from flexfem.plot.study_labels import Quantity, factor
from flexfem.plot.text import SPACE

if TYPE_CHECKING:
    from flexfem.arrays import Array
    from flexfem.page.study_points import PointedDesigns
    from flexfem.plot.study_records import Source
    from flexfem.study.findings import Extremes, Marks, Percentile, Shares
    from flexfem.study.plan import Figure


def number(value: float, after: str = "") -> Cell:
    """A number as a cell that sorts by its value."""
    return Cell(written(value) + after, float(value))


def heading(quantity: Quantity) -> str:
    """Name of a column of numbers with its unit."""
    return f"{quantity.name} in {quantity.unit}" if quantity.unit else quantity.name


def front_table(source: Source, figure: Figure, points: PointedDesigns) -> Markup:
    """The designs of a front that can be pointed at: both values and all factors."""
    factors = [column.name for column in source.loaded.columns]
    names = list(dict.fromkeys([figure.x or "", figure.y or "", *factors]))
    values = values_at(source, names, points.rows)
    numbers = source.table.design[points.rows].tolist()
    rows = [
        (Cell(str(design), design), *map(number, row)) for design, row in zip(numbers, values.tolist(), strict=True)
    ]
    headers = ("design", *(heading(source.quantity(name)) for name in names))
    return table(headers, rows, caption="Designs of the front", numbers=len(names))


def extremes_table(source: Source, figure: Figure, found: Extremes) -> Markup:
    """Where the value of a map is least and most."""
    names = (figure.value or "", figure.x or "", figure.y or "")
    headers = ("", *(heading(source.quantity(name)) for name in names))
    ends: Sequence[tuple[str, tuple[float, float, float]]] = (("least", found.least), ("most", found.most))
    rows: list[tuple[str | Cell, ...]] = [
        (word, *(number(float(cleared(source, name, one))) for name, one in zip(names, end, strict=True)))
        for word, end in ends
    ]
    return table(headers, rows, sortable=False, caption="Ends of the map", numbers=3)


def marks_table(source: Source, found: Marks) -> Markup:
    """Percentiles of every value with their intervals, and the base stage's value."""
    several = list(found.percentiles.values())
    percents = [f"{one.percent:g}{SPACE}%" for one in several[0]]
    rows = [
        (called.name, called.unit, *(_percentile(source, name, one) for one in marks), _nominal(source, name))
        for name, marks in found.percentiles.items()
        for called in [source.quantity(name)]
    ]
    headers = ("value", "unit", *percents, "base stage")
    return table(headers, rows, caption="Percentiles with 95 % confidence intervals", numbers=len(percents) + 1)


def _percentile(source: Source, name: str, one: Percentile) -> Cell:
    value, low, high = map(written, cleared(source, name, [one.value, one.low, one.high]).tolist())
    return Cell(f"{value} ({low} to {high})", float(one.value))


def _nominal(source: Source, name: str) -> Cell | str:
    return number(float(cleared(source, name, source.nominal[name]))) if name in source.nominal else "not known"


def shares_table(source: Source, found: Shares) -> Markup:
    """Sobol indices of every value by every factor, with half-widths of their confidence intervals."""
    total = any(indices.total is not None for indices in found.indices.values())
    headers = ("factor", "of the variance of", "first order: alone", *(("total: with its interactions",) * total))
    rows = list(_shares(source, found))
    return table(headers, rows, caption="Sobol indices with 95 % confidence", numbers=1 + total)


def _shares(source: Source, found: Shares) -> Iterator[tuple[str | Cell, ...]]:
    factors = [factor(column).name for column in source.loaded.columns]
    for name, indices in found.indices.items():
        pairs = [(indices.first, indices.first_band)]
        if indices.total is not None and indices.total_band is not None:
            pairs.append((indices.total, indices.total_band))
        for place, called in enumerate(factors):
            yield called, source.quantity(name).name, *(_share(value, band, place) for value, band in pairs)


def _share(value: Array, band: Array, place: int) -> Cell:
    return Cell(f"{value[place]:.3f}{SPACE}±{SPACE}{band[place]:.3f}", float(value[place]))
