"""Curves of numbers over one factor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index, is_wide
from flexfem.study.records import AxisText, CurvePanel, Curves, FactorCurve, FigureTable
from flexfem.study.source import Source

MOST_POINTS = 2000  # of a curve, more than a page can resolve


class AskedNumber(NamedTuple):
    """A number that a study asks for; `columns` are its columns by the words of their models."""

    quantity: AxisText
    columns: Mapping[str, str]


def curves_of(
    source: Source,
    factor: str,
    numbers: Sequence[AskedNumber],
    *lines: str,
) -> Curves:
    """Return the curves of numbers over a factor; `lines` are added to the caption."""
    table = source.table
    places = table.columns[factor]
    order = np.argsort(places, kind="stable")
    drawn = evenly(order, MOST_POINTS)
    masks = {status: table.status == status for status in table.counts if status != "ok"}
    if table.infeasible.any():
        masks["violates a constraint"] = table.infeasible
    x = source.quantity(factor)
    x = x._replace(log=x.log or is_wide(places))
    columns = [name for number in numbers for name in number.columns.values()]
    notes = [*lines, *_notes(source, columns, len(order) / len(drawn))]
    return Curves(
        source.caption(_title(numbers, x.name), columns, *notes),
        x,
        places[drawn],
        [_panel(source, number, drawn) for number in numbers],
        {reason: mask[drawn] for reason, mask in masks.items()},
        {reason: int(mask.sum()) for reason, mask in masks.items()},
        source.base_value(factor),
        _extremes(source, factor, numbers),
    )


def _notes(source: Source, columns: Sequence[str], step: float) -> Iterator[str]:
    """Yield lines on designs that are not drawn, and on the bands of the numbers."""
    if step > 1:
        yield f"About one in {step:.0f} designs is drawn."
    largest = [_largest_band(source, name, source.band_of(name)) for name in columns]
    if any(largest):
        yield (
            "Shaded: the numerical uncertainty ± of finite elements, at most "
            f"{max(largest):.2g} % of the number."
        )


def _largest_band(
    source: Source,
    name: str,
    band: str,
) -> float:
    """Return the largest band of a number in per cent of it, 0 without a band."""
    if not band:
        return 0.0
    values = np.abs(source.drawable(name))
    known = values > 0
    shares = 100 * source.table.columns[band][known] / values[known]
    return float(np.nanmax(shares, initial=0.0))


def _title(numbers: Sequence[AskedNumber], factor: str) -> str:
    first = numbers[0].quantity.name if len(numbers) == 1 else "numbers"
    return f"{first[:1].upper()}{first[1:]} over {factor}"


def evenly(places: Index, most: int) -> Index:
    """Return at most so many places, evenly taken, with both ends."""
    if len(places) <= most:
        return places
    chosen = np.linspace(0, len(places) - 1, most).round().astype(int)
    return np.asarray(places[chosen], dtype=np.int64)


def _panel(source: Source, number: AskedNumber, drawn: Index) -> CurvePanel:
    curves = list[FactorCurve]()
    for model, name in number.columns.items():
        values = source.drawable(name)[drawn]
        band = source.band_of(name)
        bands = source.table.columns[band][drawn] if band else np.full(len(drawn), np.nan)
        curves.append(FactorCurve(model, values, bands, source.base_value(name)))
    return CurvePanel(scaled(number.quantity, [curve.values for curve in curves]), curves)


def scaled(quantity: AxisText, values: Sequence[Array]) -> AxisText:
    """Return the axis of a quantity, logarithmic where all its numbers cover a wide range."""
    together = np.concatenate(values)
    known = together[np.isfinite(together)]
    return quantity._replace(log=len(known) > 0 and is_wide(known))


def _extremes(source: Source, factor: str, numbers: Sequence[AskedNumber]) -> FigureTable:
    """Return the table of the least and the greatest value of every number."""
    places = source.table.columns[factor]
    x = source.quantity(factor)
    rows = list[Sequence[str | float]]()
    for number in numbers:
        for model, name in number.columns.items():
            values = np.where(source.table.kept, source.drawable(name), np.nan)
            if not np.isfinite(values).any():
                continue
            least = int(np.nanargmin(values))
            most = int(np.nanargmax(values))
            texts = (number.quantity.label, model)
            ends = (values[least], places[least], values[most], places[most])
            rows.append((*texts, *map(float, ends)))
    head = {
        "quantity": "number",
        "model": "model",
        "least": "least",
        "at_least": f"at {x.label}",
        "most": "greatest",
        "at_most": f"at {x.label}",
    }
    return FigureTable("Least and greatest values of designs without objections", head, rows)
