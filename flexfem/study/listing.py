"""The designs of a study as tables of texts: factors, and the numbers asked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flexfem.arrays import Index
from flexfem.results import TextTable, number, thousands
from flexfem.study.overview import columns_of_numbers, varied_factors
from flexfem.study.source import Source

MOST_LISTED = 50  # designs
CAPTION = "Factors and numbers of the designs"
WIDEST = 7  # columns of numbers of one table, which fit a page of paper


def tables_of_designs(source: Source) -> list[TextTable]:
    """Return the first designs of a study with their factors and the numbers asked, in several
    tables where these are many; ± is the band of a number.
    """
    listed = np.arange(min(len(source.table.design), MOST_LISTED))
    heads = {name: source.quantity(name).label for name in varied_factors(source)}
    heads |= {name: axis.label for name, axis in columns_of_numbers(source).items()}
    columns = {head: _with_bands(source, name, listed) for name, head in heads.items()}
    first = {"design": [str(design) for design in source.table.design[listed]]}
    states = _states(source, listed)
    if any(states):
        first["result"] = [state or "ok" for state in states]
    tables = list[TextTable]()
    for start in range(0, max(len(columns), 1), WIDEST):
        shown = first | dict([*columns.items()][start : start + WIDEST])
        rows = [list(row) for row in zip(*shown.values(), strict=True)]
        tables.append(TextTable([*shown], rows, len(first), "" if start else CAPTION))
    return tables


def left_out(source: Source, path: Path) -> str:
    """Return a sentence on the designs that `tables_of_designs` leaves out, and where they are, in
    the table at a path.
    """
    count = len(source.table.design)
    if count <= MOST_LISTED:
        return f"The file {path} has all columns of these designs."
    return (
        f"These are the first {MOST_LISTED} of {thousands(count)} designs; "
        f"{thousands(count - MOST_LISTED)} are left out. The file {path} has all designs with "
        "all columns."
    )


def _with_bands(source: Source, name: str, listed: Index) -> list[str]:
    """Return the numbers of designs in a column, with their bands."""
    band = source.band_of(name)
    bands = source.table.columns[band][listed] if band else np.full(len(listed), np.nan)
    values = source.column(name)[listed]
    return [number(*pair) for pair in zip(values.tolist(), bands.tolist(), strict=True)]


def _states(source: Source, listed: Index) -> Sequence[str]:
    """Return why designs have no result, or which are outside constraints; "" for the others."""
    table = source.table
    broken = table.infeasible
    states = list[str]()
    for place in listed:
        state = ""
        if broken[place]:
            state = "violates a constraint"
        elif not table.ok[place]:
            state = str(table.status[place])
        states.append(state)
    return states
