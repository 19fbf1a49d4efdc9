"""Designs of a study that a page draws: their outlines as compact paths, and their numbers as its table has them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array, Index
from flexfem.mechanism.bodies import Segment
from flexfem.mechanism.drawing import part_of
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.study.findings import round_off_in
from flexfem.study.loaded import stage_of

if TYPE_CHECKING:
    from flexfem.mechanism.stage import Stage
    from flexfem.plot.study_labels import Quantity
    from flexfem.plot.study_records import Source

PARTS = 100  # of a mm: coordinates of a path are whole numbers of them
DIGITS = 5
NONE = "none"  # in the place of a number that is not finite


class OutlinePaths(NamedTuple):
    """A stage as SVG paths in hundredths of a mm, y downwards, the platform's centre at the origin.

    metal : closed.   grounds : the clamped edges.   hub : radius.   reach : how far metal goes along x or y.
    """

    metal: str
    grounds: str
    hub: int
    reach: int


@dataclass(frozen=True)
class DrawnDesign:
    """A design to show beside a chart.

    number : in the study.   values : its numbers as text, in the order of the columns.   outline : None where the
    bodies cannot be drawn.
    """

    number: int
    values: tuple[str, ...]
    outline: OutlinePaths | None

    @property
    def facts(self) -> dict[str, Any]:
        """What a script needs of it, under short names: a page holds hundreds."""
        metal, grounds, hub, _ = self.outline or OutlinePaths("", "", 0, 0)
        return {"m": metal, "g": grounds, "h": hub, "v": list(self.values)}


@dataclass(frozen=True)
class ShownColumns:
    """The columns of a study that a page shows, factors first: names in the table, and what they are called."""

    names: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    factors: int


def columns_shown(source: Source) -> ShownColumns:
    """Factors, outputs of the model and derived outputs."""
    factors = [column.name for column in source.loaded.columns]
    names = (*factors, *source.loaded.study.every_output)
    return ShownColumns(names, tuple(source.quantity(name) for name in names), len(factors))


def values_at(source: Source, names: Sequence[str], rows: Index) -> Array:
    """Numbers (rows, names) of the study's table, in units of its columns, one after the other, round-off as 0."""
    found = [cleared(source, name, source.table.columns[name][rows]) for name in names]
    return np.column_stack(found) if found else np.empty((len(rows), 0))


def cleared(source: Source, name: str, values: ArrayLike) -> Array:
    """Numbers (...) of a column to be printed, round-off as 0."""
    found = np.asarray(values, dtype=np.float64)
    return np.where(np.abs(found) <= round_off_in(source.table, name), 0.0, found)


def drawn_designs(source: Source, rows: Iterable[int]) -> list[DrawnDesign]:
    """The designs in some rows of a study's table, each once, in the order of the rows."""
    wanted = np.unique(np.fromiter(rows, dtype=np.int64))
    columns = columns_shown(source)
    values = values_at(source, columns.names, wanted)
    numbers = source.table.design[wanted].tolist()
    return [
        DrawnDesign(number, tuple(map(written, row)), _drawn(source, row[: columns.factors]))
        for number, row in zip(numbers, values, strict=True)
    ]


def outline_paths(stage: Stage) -> OutlinePaths:
    """The outline of a stage. Raises BadInput when it cannot be made."""
    part = part_of(stage)
    grounds = "".join(path_of(pad[:1]) for pad in part.pads)
    ends = [z for segment in part.outer for z in (segment.start.real, segment.start.imag)]
    reach = math.ceil(PARTS * max(map(abs, ends)))
    return OutlinePaths(f"{path_of(part.outer)}Z", grounds, round(PARTS * part.hub.radius), reach)


def _drawn(source: Source, factors: Array) -> OutlinePaths | None:
    try:
        return outline_paths(stage_of(source.loaded, factors))
    except BadInput:  # closed forms answer for designs whose bodies overlap
        return None


def path_of(line: Sequence[Segment]) -> str:
    """Segments one after the other as an SVG path in hundredths of a mm, y downwards, not closed.

    Every step goes from the rounded end of the one before: rounding does not add up.
    """
    here = _rounded(line[0].start)
    steps = [f"M{here[0]} {here[1]}"]
    for segment in line:
        there = _rounded(segment.end)
        step = f"{there[0] - here[0]} {there[1] - here[1]}"
        if there == here:
            continue
        if segment.centre is None:
            steps.append(f"l{step}")
        else:
            radius = round(PARTS * abs(segment.start - segment.centre))
            steps.append(f"a{radius} {radius} 0 0 {int(segment.turn < 0)} {step}")
        here = there
    return "".join(steps)


def _rounded(z: complex) -> tuple[int, int]:
    return round(PARTS * z.real), round(-PARTS * z.imag)


def written(value: float) -> str:
    """A number of the table in five digits."""
    return significant(value, DIGITS) if math.isfinite(value) else NONE


def farthest(designs: Iterable[DrawnDesign]) -> int:
    """How far the outlines of designs go along x or y, hundredths of a mm; 1 where none is drawn."""
    return max((one.outline.reach for one in designs if one.outline is not None), default=1)
