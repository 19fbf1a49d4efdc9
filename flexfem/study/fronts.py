"""Pareto fronts of two columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index, is_wide
from flexfem.mechanism.mechanism import Mechanism
from flexfem.study.names import counted, sentence
from flexfem.study.records import AxisText, Chosen, FigureTable, ParetoFront
from flexfem.study.source import Source
from flexfem.study.tables import Figure

ATTEMPTS = 2000  # most designs of a front that are tested for drawing; some 10 ms each
SIZE = "envelope_mm"


def front_of(source: Source, figure: Figure) -> ParetoFront:
    """Return the Pareto front of two columns, with stages of some of its designs. Raises BadInput."""
    kept = np.flatnonzero(source.table.kept)
    x = figure.x or ""
    y = figure.y or ""
    if len(kept) == 0:
        raise source.refusal("pareto", y, "no design satisfies all constraints, expected some")
    points = np.column_stack([source.column(name)[kept] for name in (x, y)])
    larger = (figure.x_better == "larger", figure.y_better == "larger")
    designs = _FrontDesigns(source, (x, y), larger, kept, points)
    # designs that were drawn before they were solved can be drawn
    attempts = 0 if source.loaded.study.draws else ATTEMPTS
    found = drawable_front(points, larger, designs.mechanisms_at, attempts)
    power = _power(points[found.places])
    gain = designs.gain(found.undrawable)
    x_axis = designs.axes[x]
    y_axis = designs.axes[y]
    title = figure.title or sentence(f"{y_axis.name} against {x_axis.name}")[:-1]
    return ParetoFront(
        source.caption(title, figure.names, *designs.notes(power, gain)),
        designs.scaled_axis(0),
        designs.scaled_axis(1),
        (figure.x_better, figure.y_better),
        points,
        found.places,
        found.undrawable,
        designs.chosen(found.places, figure.drawn),
        _left_out(source, found.unchecked if attempts else 0),
        source.base_point(x, y),
        power,
        gain,
        designs.table(found.places),
    )


@dataclass(frozen=True, eq=False)
class _FrontDesigns:
    """The designs among which a front is found: those that keep all constraints.

    names : of the columns x and y.   larger : whether larger numbers are better, for both.
    rows : (n,), of the table.   points : (n, 2), x and y.
    """

    source: Source
    names: tuple[str, str]
    larger: tuple[bool, bool]
    rows: Index
    points: Array

    @cached_property
    def axes(self) -> dict[str, AxisText]:
        """Names and units of x, y and all factors."""
        factors = [column.name for column in self.source.loaded.columns]
        return {name: self.source.quantity(name) for name in dict.fromkeys([*self.names, *factors])}

    def scaled_axis(self, which: int) -> AxisText:
        """Return the axis of x, 0, or y, 1, logarithmic where its numbers cover a wide range."""
        axis = self.axes[self.names[which]]
        return axis._replace(log=axis.log or is_wide(self.points[:, which]))

    def mechanisms_at(self, places: Index) -> Iterator[Mechanism | None]:
        """Yield the designs at places among these, None for one that cannot be made."""
        loaded = self.source.loaded
        columns = [self.source.table.columns[column.name] for column in loaded.columns]
        values = np.column_stack([column[self.rows[places]] for column in columns])
        return (loaded.family.drawable(row) for row in values)

    def gain(self, undrawable: Index) -> float | None:
        """Return the ratio of y to that of the base, for the best design that is no worse in x and
        no larger; None where it is not known.
        """
        source = self.source
        base = source.base_point(*self.names)
        base_size = source.base_value(SIZE)
        if SIZE not in source.table.columns or base is None or base_size is None or not base[1]:
            return None
        ahead = (self.points - base) * np.where(self.larger, 1.0, -1.0)  # of the base stage
        eligible = (ahead[:, 0] >= 0) & (source.column(SIZE)[self.rows] <= base_size)
        eligible[undrawable] = False
        places = np.flatnonzero(eligible)
        places = places[np.argsort(-ahead[places, 1], kind="stable")][:ATTEMPTS]
        for place, design in zip(places, self.mechanisms_at(places), strict=True):
            if design is not None:
                return float(self.points[place, 1] / base[1])
        return None

    def notes(
        self,
        power: float | None,
        gain: float | None,
    ) -> list[str]:
        """Return lines on the slope of the front and on its best design."""
        x_axis, y_axis = (self.axes[name] for name in self.names)
        notes = list[str]()
        if power is not None:
            notes.append(
                f"On the front, {y_axis.name} varies as {x_axis.name} to the power {power:.3g} "
                "(least squares)."
            )
        if gain is not None:
            notes.append(
                f"The best design that is no larger and no worse in {x_axis.name} than the base "
                f"stage has {gain:.3g} times its {y_axis.name}."
            )
        return notes

    def numbers(self, places: Index) -> dict[str, list[float]]:
        """Return x, y and all factors of the designs at places, by column."""
        rows = self.rows[places]
        return {name: self.source.column(name)[rows].tolist() for name in self.axes}

    def chosen(
        self,
        front: Index,
        count: int,
    ) -> list[Chosen]:
        """Return at most `count` designs along a front, with the numbers below them."""
        along = []
        for name, values in zip(self.names, self.points[front].T, strict=True):
            log = self.axes[name].log or is_wide(values)
            along.append(np.log(values) if log else values)
        selected = spread(np.column_stack(along), count)
        numbers = self.numbers(front)
        return [
            Chosen(
                int(front[k]),
                design,
                [(axis, numbers[name][k]) for name, axis in self.axes.items()],
            )
            for k, design in zip(selected, self.mechanisms_at(front[selected]), strict=True)
            if design is not None
        ]

    def table(self, front: Index) -> FigureTable:
        """Return the table of all designs of a front."""
        head = {"design": "design", **{name: axis.label for name, axis in self.axes.items()}}
        designs = map(str, self.source.table.design[self.rows[front]])
        rows = [*zip(designs, *self.numbers(front).values(), strict=True)]
        return FigureTable("Designs of the front", head, rows)


def _power(front: Array) -> float | None:
    """Return the slope of log y over log x of a front (m, 2), None where there is none."""
    if front.min() <= 0 or np.ptp(front[:, 0]) <= 0:
        return None
    return float(np.polyfit(np.log(front[:, 0]), np.log(front[:, 1]), 1)[0])


def _left_out(source: Source, unchecked: int) -> list[str]:
    """Return lines on designs that are not shown, and on those of a front that were not checked."""
    table = source.table
    excluded = {status: n for status, n in table.counts.items() if status != "ok"}
    excluded["that violate a constraint"] = int(table.infeasible.sum())
    lines = [f"not drawn: {counted(excluded)}"] if any(excluded.values()) else []
    if unchecked:
        lines.append(f"{unchecked} on the front were not checked by drawing")
    return lines


def non_dominated(points: Array, larger: tuple[bool, bool] = (True, True)) -> Index:
    """Return the places (m,) of the designs, x and y (n, 2), on the Pareto front, from the best in
    x to the best in y.

    A design dominates another when it is no worse in both values and better in one; equal designs
    stay together. Sorted from the best x on, a design is on the front when its y is better than all
    before (Kung, Luccio, Preparata 1975)."""
    x, y = np.where(larger, points, -points).T
    order = np.lexsort((-y, -x))
    x = x[order]
    y = y[order]
    best = np.maximum.accumulate(np.concatenate([[-np.inf], y]))
    first = np.concatenate([[True], x[1:] != x[:-1]])[: len(order)]
    # index of the first design of equal x
    group = np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))
    return np.asarray(order[(y > best[group]) & (y == y[group])], dtype=np.int64)


class DrawableFront(NamedTuple):
    """Places of the designs of a front (m,), of designs on it or better that cannot be drawn (k,),
    and the number of designs on the front that were not tested.
    """

    places: Index
    undrawable: Index
    unchecked: int


def drawable_front(
    points: Array,
    larger: tuple[bool, bool],
    mechanisms_at: Callable[[Index], Iterable[object]],
    attempts: int,
) -> DrawableFront:
    """Return the front of the designs that can be drawn, from the best in x to the best in y.

    mechanisms_at : yields None for a design that cannot be drawn.   attempts : most designs that
    are tested.
    """
    possible = np.ones(len(points), dtype=bool)
    known = np.zeros(len(points), dtype=bool)
    while True:
        remaining = np.flatnonzero(possible)
        places = remaining[non_dominated(points[remaining], larger)]
        untested = places[~known[places]]
        tested = untested[: attempts - int(known.sum())]
        if len(tested) == 0:
            return DrawableFront(places, np.flatnonzero(~possible), len(untested))
        known[tested] = True
        possible[tested] = [design is not None for design in mechanisms_at(tested)]


def spread(points: Array, count: int) -> Index:
    """Return at most `count` places along a front (m, 2), ends included, about equidistant when
    both spans are 1.
    """
    spans = np.ptp(points, axis=0)
    along = np.concatenate(
        [[0.0], np.cumsum(np.hypot(*(np.diff(points, axis=0) / np.where(spans > 0, spans, 1.0)).T))]
    )
    targets = np.linspace(0.0, along[-1], count) if count > 1 else along[-1:] / 2
    return np.unique(np.abs(along[:, None] - targets).argmin(axis=0))
