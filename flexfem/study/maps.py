"""Maps of an output over two factors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.study.names import sentence
from flexfem.study.records import Cells, FigureTable, StudyMap
from flexfem.study.source import UNKNOWN, Source
from flexfem.study.tables import Figure

PER_CELL = 12  # mean number of designs in a cell
MOST_CELLS = 25  # along one side
FEW = 3  # least number of random designs for a mean
TRUSTED = (5.0, 10.0)  # per cent of error, whose contours are heavier


def map_of(source: Source, figure: Figure) -> StudyMap:
    """Return the map of an output over two factors, averaged over other factors that vary. Raises
    BadInput.
    """
    x = figure.x or ""
    y = figure.y or ""
    value = figure.value or ""
    cells = cells_of(source, (x, y), value)
    if not np.isfinite(cells.values).any():
        raise source.refusal(
            "map", value, "no shown design satisfies all constraints, expected some"
        )
    x_axis, y_axis, value_axis = (source.quantity(name) for name in (x, y, value))
    title = sentence(f"{value_axis.name} over {x_axis.name} and {y_axis.name}")[:-1]
    marks: tuple[float, ...] = ()
    if value.startswith(("error_", "cross_")):
        marks = (*TRUSTED, *(-mark for mark in TRUSTED))
    return StudyMap(
        source.caption(figure.title or title, figure.names, *_notes(source, value, cells)),
        x_axis,
        y_axis,
        value_axis,
        cells,
        marks,
        source.base_point(x, y),
        _extremes(cells, {value: value_axis.label, x: x_axis.label, y: y_axis.label}),
    )


def _notes(
    source: Source,
    value: str,
    cells: Cells,
) -> list[str]:
    """Return lines on the mean in a cell, and on the mesh band of an error."""
    notes = list[str]()
    if cells.averaged:
        names = ", ".join(source.quantity(name).name for name in cells.averaged)
        notes.append(
            f"A cell is the mean over {names} of {cells.size} designs (median); their standard "
            f"deviation is {cells.scatter:.2g}{source.quantity(value).after} (median)."
        )
    band = source.band_of(value)
    if band.startswith("band_"):
        (bands,) = source.table.with_results(band)
        notes.append(
            f"Mesh band of the error: median {np.median(bands):.2g}, largest {bands.max():.2g} "
            "percentage points."
        )
    return notes


def _extremes(cells: Cells, labels: dict[str, str]) -> FigureTable:
    """Return the table of the least and the greatest value of a map."""
    ends = {"least": np.nanargmin(cells.values), "most": np.nanargmax(cells.values)}
    rows = [
        (word, float(cells.values[at]), *cells.points[at].tolist()) for word, at in ends.items()
    ]
    return FigureTable("Extremes of the map", {"end": "", **labels}, rows)


def cells_of(
    source: Source,
    names: tuple[str, str],
    value: str,
) -> Cells:
    """Return a column over two factors, as means in cells of these where other factors vary too."""
    table = source.table
    factors = [column.name for column in source.loaded.columns if column.name not in names]
    others = tuple(name for name in factors if np.ptp(table.columns[name]) > 0)
    if others:
        return _averaged_cells(source, names, value, others)
    points = np.column_stack([table.columns[name] for name in names])
    missing = {status: table.status == status for status in table.counts if status != "ok"}
    if table.infeasible.any():
        missing["violates a constraint"] = table.infeasible
    kept = np.where(table.kept, source.drawable(value), np.nan)
    unknown = table.kept & np.isnan(kept)
    if unknown.any():
        missing[UNKNOWN] = unknown
    return Cells(points, kept, missing, _is_grid(source))


def _is_grid(source: Source) -> bool:
    return source.loaded.study.sampling.method == "grid"


def _averaged_cells(
    source: Source, names: tuple[str, str], value: str, others: tuple[str, ...]
) -> Cells:
    """Return the means of a column in cells of two factors, over `others`."""
    table = source.table
    grid = _is_grid(source)
    rows = _bins(source, names[0])
    columns = _bins(source, names[1])
    cell = (rows.group * len(columns.centres) + columns.group)[table.kept]
    values = source.column(value)[table.kept]
    count = np.bincount(cell, minlength=len(rows.centres) * len(columns.centres))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(cell, values, len(count)) / count
        squares = np.bincount(cell, (values - mean[cell]) ** 2, len(count))
        scatter = np.sqrt(squares / (count - 1))
    enough = count >= (1 if grid else FEW)
    several = enough & (count > 1)
    missing = {"no design" if grid else f"fewer than {FEW} designs": ~enough}
    return Cells(
        np.stack(np.meshgrid(rows.centres, columns.centres, indexing="ij"), axis=-1).reshape(-1, 2),
        np.where(enough, mean, np.nan),
        {} if enough.all() else missing,
        True,
        others,
        float(np.median(scatter[several])) if several.any() else 0.0,
        int(np.median(count[enough])) if enough.any() else 0,
    )


class _Bins(NamedTuple):
    """Bins of a factor: their centres, or its values if few, and the bin of each design (n,)."""

    centres: Array
    group: Index


def _bins(source: Source, name: str) -> _Bins:
    """Return the bins of a factor in a map."""
    designs = len(source.table.design)
    most = designs
    if not _is_grid(source):
        most = int(np.clip(np.sqrt(designs / PER_CELL), 2, MOST_CELLS))
    scales = {column.name: column.factor.scale for column in source.loaded.columns}
    return _binned(source.table.columns[name], most, scales[name] == "log")


def _binned(
    column: Array,
    bins: int,
    log: bool,
) -> _Bins:
    levels, group = np.unique(column, return_inverse=True)
    if len(levels) <= bins:
        return _Bins(levels, np.asarray(group, dtype=np.int64))
    places = np.log(column) if log else column
    ends = np.linspace(places.min(), places.max(), bins + 1)
    group = np.clip(np.searchsorted(ends, places, side="right") - 1, 0, bins - 1)
    centres = (ends[1:] + ends[:-1]) / 2
    if log:
        centres = np.exp(centres)
    return _Bins(np.asarray(centres), np.asarray(group, dtype=np.int64))
