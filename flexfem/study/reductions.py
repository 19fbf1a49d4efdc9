"""A table of designs reduced to what a figure shows: cells of a map, designs that no other beats in two values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy

PER_CELL = 12  # designs, about
MOST_BINS = 25  # along one side
FEW = 3  # designs of a random sample, below which a mean says little
BROKEN = "breaks a constraint"
BLOCK = 2**16  # designs whose front is found at once: bounds the memory
WIDE = 30.0  # largest over smallest value, from which on an axis or colours are logarithmic


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


class Front(NamedTuple):
    """The best designs among those that can be drawn.

    places : (m,), where they are in the sample, from the best in the first value to the best in the second.
    undrawable : (k,), places of designs that would be on the front or beyond it, but cannot be drawn.
    unchecked : how many of `places` were not tried, because the attempts were used up.
    """

    places: Index
    undrawable: Index
    unchecked: int


def non_dominated(x: Array, y: Array, x_larger: bool = True, y_larger: bool = True) -> Index:
    """Places (m,) of the designs that no other beats, from the best in x to the best in y.

    Parameters
    ----------
    x, y : (n,), finite.
    x_larger, y_larger : whether larger is better.

    Notes
    -----
    One design beats another when it is no worse in both values and better in one; equal designs stay together. Sorted
    from the best x on, a design is on the front when its y is better than all before: n log n, as H. T. Kung,
    F. Luccio, F. P. Preparata, J. ACM 22 (1975) 469.
    """
    gain_x, gain_y = x if x_larger else -x, y if y_larger else -y
    order = np.lexsort((-gain_y, -gain_x))
    sorted_x, sorted_y = gain_x[order], gain_y[order]
    best = np.maximum.accumulate(np.concatenate([[-np.inf], sorted_y]))
    opens = np.concatenate([[True], sorted_x[1:] != sorted_x[:-1]])[: len(order)]
    group = np.maximum.accumulate(np.where(opens, np.arange(len(order)), 0))  # where designs of the same x begin
    stays = (sorted_y > best[group]) & (sorted_y == sorted_y[group])
    return np.asarray(order[stays], dtype=np.int64)


def drawable_front(
    x: Array, y: Array, larger: tuple[bool, bool], drawable: Callable[[int], bool], attempts: int
) -> Front:
    """The front of the designs that can be drawn: those that cannot make room for the ones behind them.

    Parameters
    ----------
    x, y, larger : as for `non_dominated`.
    drawable : whether the design at a place can be drawn; asked at most `attempts` times.
    """
    alive = np.ones(len(x), dtype=bool)
    known: set[int] = set()
    blocks = -(-len(x) // BLOCK)
    best = [_best_of(x, y, larger, alive, block) for block in range(blocks)]
    while True:
        places = np.concatenate([np.empty(0, dtype=np.int64), *best])
        places = places[non_dominated(x[places], y[places], *larger)]
        fresh = [int(place) for place in places if int(place) not in known]
        asked = fresh[: attempts - len(known)]
        if not asked:
            return Front(places, np.flatnonzero(~alive), len(fresh))
        known.update(asked)
        lost = [place for place in asked if not drawable(place)]
        alive[lost] = False
        for block in {place // BLOCK for place in lost}:
            best[block] = _best_of(x, y, larger, alive, block)


def _best_of(x: Array, y: Array, larger: tuple[bool, bool], alive: AnyArray, block: int) -> Index:
    """Places, ascending, of the front of a block of designs; no design is on the front of all that is not on this."""
    places = block * BLOCK + np.flatnonzero(alive[block * BLOCK : (block + 1) * BLOCK])
    return np.sort(places[non_dominated(x[places], y[places], *larger)])


def wide(values: Array) -> bool:
    """Whether values (n,) are all positive and so far apart that they are best seen as logarithms."""
    return bool(0 < WIDE * values.min() < values.max())


def spread(x: Array, y: Array, count: int) -> Index:
    """Places (at most `count`,) along a front, ends included, about equally far apart along it.

    Parameters
    ----------
    x, y : (m,), the front in order. Distances are measured with both spans taken as one.
    """
    steps = np.hypot(*(np.diff(v) / (np.ptp(v) or 1.0) for v in (x, y)))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    targets = np.linspace(0.0, along[-1], count) if count > 1 else along[-1:] / 2
    nearest = np.abs(along[:, None] - targets).argmin(axis=0)
    return np.unique(nearest)
