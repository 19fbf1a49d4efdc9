"""The designs that no other beats in two values, and a few of them to look at."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

BLOCK = 2**16  # designs whose front is found at once: bounds the memory
WIDE = 30.0  # largest over smallest value, from which on an axis or colours are logarithmic


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
