"""Results as data frames: wide ones to read, and long ones to filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexfem.results.declare import Declared
from flexfem.results.render import FLOOR
from flexfem.units import Unit

ROWS = ("model", "case", "mode", "load", "position")  # axes whose labels are rows, where present


def long_frame(result: Declared) -> Any:
    """Return all numbers as a pandas DataFrame: path, value, band, unit."""
    import pandas as pd

    rows = [(each.path, each.value, each.band, each.unit.plain) for each in result.entries()]
    return pd.DataFrame(rows, columns=["path", "value", "band", "unit"])


def wide_frame(result: Declared, quantities: Sequence[str]) -> Any:
    """Return quantities as a pandas DataFrame with a row for each model, case or mode.

    A column is a quantity at labels of its other axes, with its unit: `free x (N/mm)`. The columns
    of bands follow it: `free x band (N/mm)`. Columns without any value are left out; round-off is
    zero, as in tables.

    quantities : their names; by default all.
    """
    import pandas as pd

    names = list(quantities) or list(result.values)
    for name in names:
        result.at(name)  # refuses an unknown one
    used = {axis for name in names for axis in result.quantities[name].over}
    rows = [axis for axis in ROWS if axis in used]
    places = list(result.indices(rows))
    columns = dict[str, list[float]]()
    for name in names:
        for row, (_, labels) in enumerate(places):
            _add_row(columns, result, name, dict(zip(rows, labels, strict=True)), row)
    for column in columns.values():
        column += [np.nan] * (len(places) - len(column))
    frame = pd.DataFrame(columns).dropna(axis="columns", how="all")
    for at, axis in enumerate(rows):
        frame.insert(at, axis, [labels[at] for _, labels in places])
    return frame.set_index(rows) if rows else frame


def _add_row(
    columns: dict[str, list[float]],
    result: Declared,
    name: str,
    row_labels: dict[str, str],
    row: int,
) -> None:
    """Add the numbers of a quantity in one row to the columns."""
    quantity = result.quantities[name]
    index = {
        axis: result.axes[axis].index(label)
        for axis, label in row_labels.items()
        if axis in quantity.over
    }
    others = [axis for axis in quantity.over if axis not in index]
    is_round_off = np.abs(result.values[name]) <= FLOOR * result.sizes(name)
    numbers = {"": np.where(is_round_off, 0.0, result.values[name]), " band": result.band(name)}
    for at, labels in result.indices(others):
        index |= dict(zip(others, at, strict=True))
        place = tuple(index[axis] for axis in quantity.over)
        for ending, array in numbers.items():
            heading = " ".join([name, *labels]) + ending
            _append(columns, _with_unit(heading, quantity.unit_at(place)), row, array[place])


def _with_unit(heading: str, unit: Unit) -> str:
    return f"{heading} ({unit.plain})" if unit.plain else heading


def _append(
    columns: dict[str, list[float]],
    heading: str,
    row: int,
    value: float,
) -> None:
    """Set the value of a column in a row; rows before it that have none are nan."""
    column = columns.setdefault(heading, [])
    column += [np.nan] * (row - len(column))
    column.append(float(value))
