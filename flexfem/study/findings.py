"""Findings of a study: the record of every figure of its file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from flexfem.refused import BadInput
from flexfem.results import SPACE
from flexfem.study.fronts import front_of
from flexfem.study.maps import map_of
from flexfem.study.names import factor
from flexfem.study.records import (
    Distribution,
    FigureTable,
    Record,
    Refused,
    Scatter,
    Sensitivity,
    Share,
)
from flexfem.study.source import LARGEST, Source
from flexfem.study.statistics import first_order, percentiles, sobol_indices
from flexfem.study.tables import Figure

LEAST = 100  # designs for indices from a plain sample; with 60, intervals of 95 % covered 86 %
FLAT = 1e-9  # relative spread up to which a value is constant but for round-off
MARKED = (2.5, 50.0, 97.5)  # percentiles


def findings(source: Source) -> dict[str, Record | Refused]:
    """Return the record of every figure of a study file by the name of its image; `Refused` where
    it cannot be drawn.

    Raises BadInput: no design has a result.
    """
    loaded = source.loaded
    table = source.table
    if not table.ok.any():
        raise BadInput(
            f"{loaded.path}: none of {len(table.design)} designs has a result, expected some to "
            "draw"
        )
    records = dict[str, Record | Refused]()
    used = Counter[str]()
    for figure in loaded.study.figure:
        stem = "-".join(part for part in (loaded.stem, figure.kind, figure.value) if part)
        used[stem] += 1
        name = stem if used[stem] == 1 else f"{stem}-{used[stem]}"
        try:
            for column, _ in figure.columns.values():
                _require_drawable(source, figure.kind, column)
            records[name] = MAKERS[figure.kind](source, figure)
        except BadInput as error:
            records[name] = Refused(str(error))
    return records


def _require_drawable(
    source: Source,
    kind: str,
    name: str,
) -> None:
    table = source.table
    bad = np.flatnonzero(table.ok & np.isnan(source.drawable(name)))
    if len(bad):
        designs = (
            f"{len(bad)} of {int(table.ok.sum())} designs with a result, expected one for each"
        )
        number = f"no number that is 0 or {1 / LARGEST:g} to {LARGEST:g} in size"
        raise source.refusal(
            kind, name, f"{number} for {designs}; the first is design {table.design[bad[0]]}"
        )


def distribution_of(source: Source, figure: Figure) -> Distribution:
    """Return the scatter of outputs, with percentiles whose confidence intervals assume independent
    draws.
    """
    scatters = [_scatter_of(source, name) for name in figure.values or ()]
    line = "In brackets and shaded: distribution-free 95 % confidence intervals of the percentiles."
    method = source.loaded.study.sampling.method
    if method == "table":
        line += " They are valid if the designs of the table are independent draws."
    elif method != "monte_carlo":
        line += (
            " They assume independent draws; for these evenly spread designs they are usually "
            "too wide."
        )
    caption = source.caption(figure.title or "Scatter of the values", figure.names, line)
    return Distribution(caption, scatters, _table_of_percentiles(scatters))


def _scatter_of(source: Source, name: str) -> Scatter:
    table = source.table
    values = source.column(name)[table.ok]
    draws = None
    if source.loaded.study.sampling.method == "saltelli":
        # rows of the scheme from one Sobol point
        draws = table.design[table.ok] // (len(source.loaded.columns) + 2)
    found = percentiles(values, MARKED, draws)
    return Scatter(source.quantity(name), values, found, source.base_value(name))


def _table_of_percentiles(scatters: Sequence[Scatter]) -> FigureTable:
    rows = list[Sequence[str | float]]()
    for axis, _, found, base in scatters:
        rows += [(axis.name, axis.unit, f"{p:g}{SPACE}%", *ends) for p, *ends in found]
        if base is not None:
            rows.append((axis.name, axis.unit, "base stage", base, np.nan, np.nan))
    head = {
        "quantity": "value",
        "unit": "unit",
        "percent": "percentile",
        "value": "",
        "low": "from",
        "high": "to",
    }
    return FigureTable("Percentiles with 95 % confidence intervals", head, rows)


def sensitivity_of(source: Source, figure: Figure) -> Sensitivity:
    """Return the Sobol indices of several outputs for every factor. Raises BadInput."""
    loaded = source.loaded
    shares = [
        sensitivity(source, name)._replace(quantity=source.quantity(name))
        for name in figure.values or ()
    ]
    line = "Sobol indices; whiskers: 95 % confidence."
    parts = {"first": "first order: alone", "first_band": "±"}
    if loaded.study.sampling.method == "saltelli":
        parts |= {"total": "total: with its interactions", "total_band": "±"}
    else:
        line = (
            "First-order Sobol indices from one plain sample, by regression on each factor alone; "
            'whiskers: 95 % confidence. Total indices need method = "saltelli".'
        )
        if loaded.study.correlation or loaded.table is not None or not source.table.ok.all():
            line += (
                " Factors may be dependent, also through designs without a result: shares then "
                "overlap."
            )
    factors = [factor(column).name for column in loaded.columns]
    return Sensitivity(
        source.caption(figure.title or "Share of variance by factor", figure.names, line),
        shares,
        factors,
        _table_of_shares(shares, factors, parts),
    )


def _table_of_shares(
    shares: Sequence[Share], factors: Sequence[str], parts: dict[str, str]
) -> FigureTable:
    """Return the table of indices; `parts` are the headings of the fields of a `Share`."""
    rows = list[Sequence[str | float]]()
    for share in shares:
        for k, name in enumerate(factors):
            numbers = [float(getattr(share, part)[k]) for part in parts]
            rows.append((name, share.quantity.name, *numbers))
    head = {"factor": "factor", "quantity": "of the variance of", **parts}
    return FigureTable("Sobol indices with 95 % confidence", head, rows)


def sensitivity(source: Source, value: str) -> Share:
    """Return the Sobol indices of an output column: first order, and total with Saltelli's scheme.

    Raises BadInput: a design of Saltelli's scheme has no result (none can be left out, because each
    belongs to several differences); too few designs have a result; or the value does not vary."""
    loaded = source.loaded
    table = source.table
    refusal = partial(source.refusal, "sensitivity", value)
    saltelli = loaded.study.sampling.method == "saltelli"
    missing = loaded.count - len(table.design)
    if saltelli and missing:
        raise refusal(f"{missing} of {loaded.count} designs are not computed, expected all")
    if saltelli and not table.ok.all():
        bad = np.flatnonzero(~table.ok)
        first = f"design {table.design[bad[0]]}: {table.status[bad[0]]}: {table.reason[bad[0]]}"
        raise refusal(
            f"{len(bad)} of {loaded.count} designs have no result, expected all; the first is "
            f"{first}"
        )
    (values,) = table.with_results(value)
    if len(values) < LEAST and not saltelli:
        raise refusal(f"{len(values)} designs have a result, expected at least {LEAST}")
    if np.ptp(values) <= FLAT * (table.round_off_sizes.get(value) or np.abs(values).max()):
        raise refusal("no factor changes it, expected a value that varies")
    if saltelli:
        return sobol_indices(values, len(loaded.columns))
    return first_order((table.with_results(column.name)[0] for column in loaded.columns), values)


MAKERS: dict[str, Callable[[Source, Figure], Record]] = {
    "map": map_of,
    "distribution": distribution_of,
    "sensitivity": sensitivity_of,
    "pareto": front_of,
}
