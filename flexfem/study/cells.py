"""What a map shows: designs by two factors, or means over all others in cells of the two."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

if TYPE_CHECKING:
    from flexfem.study.collected import StudyTable
    from flexfem.study.plan import LoadedStudy

PER_CELL = 12  # designs, about
MOST_BINS = 25  # along one side
FEW = 3  # designs of a random sample, below which a mean says little
BROKEN = "breaks a constraint"


class Cells(NamedTuple):
    """Points (n, 2) with values (n,), nan where there is none: which have none, bool (n,), by why.

    grid : whether the points are all pairs of some values.
    averaged : columns that the values are means over, none where each value is a design's.
    scatter : median standard deviation of the designs about the means of their cells.    size : median designs in one.
    """

    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    averaged: tuple[str, ...] = ()
    scatter: float = 0.0
    size: int = 1


def cells_of(loaded: LoadedStudy, table: StudyTable, names: tuple[str, str], value: str) -> Cells:
    """The value over two factors; where other factors vary as well, its mean over them in cells of the two."""
    others = tuple(
        column.name for column in loaded.columns if column.name not in names and np.ptp(table.columns[column.name]) > 0
    )
    points = np.column_stack([table.columns[name] for name in names])
    kept = table.ok & ~table.infeasible
    grid = loaded.study.sampling.method == "grid"
    if others:
        log = [column.factor.scale == "log" for name in names for column in loaded.columns if column.name == name]
        return _means(points, table.columns[value], kept, log, grid)._replace(averaged=others)
    missing = dict(table.unanswered)
    if table.infeasible.any():
        missing[BROKEN] = table.infeasible
    return Cells(points, np.where(kept, table.columns[value], np.nan), missing, grid)


def _means(points: Array, values: Array, kept: AnyArray, log: list[bool], grid: bool) -> Cells:
    bins = len(points) if grid else int(np.clip(np.sqrt(len(points) / PER_CELL), 2, MOST_BINS))
    (xs, i), (ys, j) = (_binned(points[:, k], bins, log[k]) for k in (0, 1))
    cell = (i * len(ys) + j)[kept]
    count, found = np.bincount(cell, minlength=len(xs) * len(ys)), values[kept]
    enough = count >= (1 if grid else FEW)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(cell, found, len(count)) / count
        scatter = np.sqrt(np.bincount(cell, (found - mean[cell]) ** 2, len(count)) / (count - 1))
    pairs = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    missing = {"no design" if grid else f"fewer than {FEW} designs": ~enough} if not enough.all() else {}
    several = enough & (count > 1)
    return Cells(
        pairs,
        np.where(enough, mean, np.nan),
        missing,
        True,
        scatter=float(np.median(scatter[several])) if several.any() else 0.0,
        size=int(np.median(count[enough])) if enough.any() else 0,
    )


def _binned(column: Array, bins: int, log: bool) -> tuple[Array, Index]:
    """Centres of the bins of a factor (n,), and in which each design is; single values where they are few."""
    levels, group = np.unique(column, return_inverse=True)
    if len(levels) <= bins:
        return levels, np.asarray(group, dtype=np.int64)
    places = np.log(column) if log else column
    ends = np.linspace(places.min(), places.max(), bins + 1)
    group = np.clip(np.searchsorted(ends, places, side="right") - 1, 0, bins - 1)
    centres = (ends[1:] + ends[:-1]) / 2
    return np.asarray(np.exp(centres) if log else centres), np.asarray(group, dtype=np.int64)
