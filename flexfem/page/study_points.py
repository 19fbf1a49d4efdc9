"""Which designs of a study's front or map can be pointed at, and where they are on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.plot.study_labels import thousands
from flexfem.study.findings import Best, Cells, spread

if TYPE_CHECKING:
    from flexfem.plot.study_records import Source
    from flexfem.study.plan import Figure

MOST = 400  # designs of one figure that can be pointed at
ALTOGETHER = 1000  # of all figures of a page: some 3 kB each


@dataclass(frozen=True)
class PointedDesigns:
    """Designs to point at.

    rows : (n,), in the study's table.   at : (n, 2), where they are, in the data of the axes.   said : which they are,
    in one sentence.
    """

    rows: Index
    at: Array
    said: str


def most_of(figures: int) -> int:
    """How many designs each of so many figures may show."""
    return min(MOST, max(ALTOGETHER // max(figures, 1), 1))


def of_front(source: Source, figure: Figure, found: Best, most: int) -> PointedDesigns:
    """Designs of a front, from left to right; of more than `most`, those spread along it."""
    rows = _counting(source)[found.front.places]
    rows = rows[np.argsort(source.table.columns[figure.x or ""][rows], kind="stable")]
    at = _at(source, figure, rows)
    if len(rows) <= most:
        return PointedDesigns(rows, at, f"All {thousands(len(rows))} designs of the front can be pointed at.")
    some = spread(at[:, 0], at[:, 1], most)
    count = f"{thousands(len(some))} of the {thousands(len(rows))} designs of the front"
    said = f"{count}, spread along it, can be pointed at."
    return PointedDesigns(rows[some], at[some], said)


def of_map(source: Source, figure: Figure, cells: Cells, most: int) -> PointedDesigns:
    """Designs of a map; of a map of means that of each cell which is nearest to its middle. Of many, some at random."""
    known = np.flatnonzero(np.isfinite(cells.values))
    if not cells.averaged:
        rows = known
        name = "designs with a value"
    else:
        rows = _nearest(source, figure, cells.points[_some(known, most)])
        name = "cells, each by the design nearest to its middle,"
    shown = _some(rows, most)
    count = thousands(len(known))
    said = (
        f"All {count} {name} can be pointed at."
        if len(known) <= most
        else f"{thousands(len(shown))} of {count} {name} can be pointed at, taken at random."
    )
    at = _at(source, figure, shown)
    order = np.lexsort(at.T[::-1])
    return PointedDesigns(shown[order], at[order], said)


def _counting(source: Source) -> Index:
    """Rows of the designs that have an answer and keep all constraints."""
    return np.flatnonzero(source.table.ok & ~source.table.infeasible)


def _at(source: Source, figure: Figure, rows: Index) -> Array:
    return np.column_stack([source.table.columns[name or ""][rows] for name in (figure.x, figure.y)])


def _some(places: Index, most: int) -> Index:
    """Places (m,), or `most` of them at random, always the same ones, in their order."""
    if len(places) <= most:
        return places
    return np.sort(np.random.default_rng(0).choice(places, most, replace=False))


def _nearest(source: Source, figure: Figure, middles: Array) -> Index:
    """Rows of the designs that count nearest to some places (n, 2) of a map, each once; as the axes show them."""
    rows = _counting(source)
    log = [source.quantity(name or "").log for name in (figure.x, figure.y)]
    designs, middles = (_scaled(each, log) for each in (_at(source, figure, rows), middles))
    span = np.ptp(designs, axis=0)
    span[span == 0] = 1.0
    found = [_closest(designs, middle, span) for middle in middles]
    return rows[np.unique(found)]


def _scaled(points: Array, log: list[bool]) -> Array:
    return np.column_stack([np.log(v) if is_log else v for v, is_log in zip(points.T, log, strict=True)])


def _closest(designs: Array, middle: AnyArray, span: Array) -> int:
    return int(np.square((designs - middle) / span).sum(axis=1).argmin())
