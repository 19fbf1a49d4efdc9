"""The figures that a study file asks for, from its table: as records for the functions that draw them, and as files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import matplotlib.figure
import numpy as np

from flexfem.arrays import Array, Index, wide
from flexfem.files.inputs import require_unread
from flexfem.plot.stage import outline_of
from flexfem.plot.study_figures import (
    Caption,
    Chosen,
    Distribution,
    ParetoFront,
    Quantity,
    Scatter,
    Sensitivity,
    Share,
    StudyMap,
    caption_of,
    counted,
    distribution_figure,
    factor,
    map_figure,
    output,
    pareto_figure,
    sensitivity_figure,
    thousands,
)
from flexfem.plot.text import significant
from flexfem.plot.write import figure_files, write_beside
from flexfem.study.columns import RANGES, STRESSES, lasting
from flexfem.study.findings import Best, Cells, Extremes, Marks, Refused, Shares, Shown
from flexfem.study.plan import Figure

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy

Record: TypeAlias = StudyMap | Distribution | Sensitivity | ParetoFront


def record_of(source: Source, figure: Figure, found: Extremes | Marks | Shares | Best) -> Record:
    """What one figure of a study file shows, from what was found for it."""
    match found:
        case Extremes():
            return map_of(source, figure, found.cells)
        case Marks():
            return distribution_of(source, figure, found)
        case Shares():
            return sensitivity_of(source, figure, found)
        case Best():
            return front_of(source, figure, found)


TRUSTED = (5.0, 10.0)  # per cent of error: contours that are drawn heavier
SAME = 1e-9  # part by which numbers of one design may differ
WRITTEN = 6  # factors below a drawing; more are left to the table


class Source(NamedTuple):
    """What all figures are drawn from: the study, its table, and the base stage's factors and outputs by column.

    `unseen` : sentences on factors that nothing shown depends on.
    """

    loaded: LoadedStudy
    table: StudyTable
    nominal: Mapping[str, float]
    unseen: Sequence[str] = ()

    def quantity(self, name: str) -> Quantity:
        """What a column is called."""
        for column in self.loaded.columns:
            if column.name == name:
                return factor(column)
        for derived in self.loaded.study.output:
            if derived.name == name:
                return Quantity(derived.label or name, derived.unit or "")
        return output(name, self.loaded.study)

    def axis(self, name: str) -> Quantity:
        """What a column is called, logarithmic where its values are far apart."""
        quantity, (values,) = self.quantity(name), self.table.answered(name)
        return quantity._replace(log=quantity.log or wide(values))

    def caption(self, figure: Figure, title: str, *lines: str) -> Caption:
        """What stands above a figure; its own title where it has one."""
        said = [*self._kept(), *self._doubts(), *self._stressed(figure), *lines]
        return caption_of(self.loaded, self.table, figure.title or title, said)

    def _kept(self) -> list[str]:
        """How many designs keep the constraints of the study."""
        if not self.loaded.study.constraint:
            return []
        limits = "; ".join(f"{one.said} {one.expected}" for one in self.loaded.study.constraint)
        kept, answers = int(np.sum(self.table.ok & ~self.table.infeasible)), int(np.sum(self.table.ok))
        return [f"{thousands(kept)} of {thousands(answers)} designs with an answer keep the constraints: {limits}."]

    def _stressed(self, figure: Figure) -> list[str]:
        """How far what it shows may be off by the neck stress, where it is found from that."""
        study, accuracy = self.loaded.study, self.loaded.stress_accuracy
        shown = {name for name, _ in figure.columns.values()}
        used = study.used_by(shown)
        of_stress = {*STRESSES, *RANGES, *(() if study.life is None else lasting(study.life.moved))}
        return [f"{accuracy[0].upper()}{accuracy[1:]}."] if used & of_stress else []

    def base(self, x: str, y: str) -> tuple[float, float] | None:
        """Where the base stage is among the designs, None where that is not known."""
        found = tuple(self.nominal.get(name, np.nan) for name in (x, y))
        return (found[0], found[1]) if np.isfinite(found).all() else None

    def unbeaten(self, figure: Figure, front: Index) -> list[str]:
        """What is to be said where the base stage lies beyond a front, (m,) places among the designs that count."""
        x, y = figure.x or "", figure.y or ""
        own, designs = self.base(x, y), np.column_stack(self.table.considered.answered(x, y))[front]
        sign = [1.0 if better == "larger" else -1.0 for better in (figure.x_better, figure.y_better)]
        if own is None or np.any(np.all(sign * (designs - own) >= -SAME * np.abs(own), axis=1)):
            return []
        kept = "no design of the study that can be drawn and keeps all constraints is as good, and it is none of them."
        return [f"The base stage lies beyond the front: {kept}"]

    def _doubts(self) -> list[str]:
        """What is to be known of some of the answers."""
        return [f"{text}." for text in self.table.warnings]


def map_of(source: Source, figure: Figure, cells: Cells) -> StudyMap:
    """A value over two factors, or its mean over the others where they vary too."""
    x, y, value = (name or "" for name in (figure.x, figure.y, figure.value))
    across, up, shown = (source.quantity(name) for name in (x, y, value))
    title = f"{shown.name} over {across.name} and {up.name}"
    return StudyMap(
        source.caption(
            figure, title[0].upper() + title[1:], *_mean_line(source, cells, shown), *_band_line(source, value)
        ),
        *(across, up, shown),
        points=cells.points,
        values=cells.values,
        missing=cells.missing,
        grid=cells.grid,
        marks=(*TRUSTED, *(-mark for mark in TRUSTED)) if value.startswith(("error_", "cross_")) else (),
        base=source.base(x, y),
    )


def _mean_line(source: Source, cells: Cells, value: Quantity) -> list[str]:
    """What a map averages over, and what that hides."""
    if not cells.averaged:
        return []
    names = [source.quantity(name).name for name in cells.averaged[:WRITTEN]]
    more = f" and {len(cells.averaged) - WRITTEN} more" if len(cells.averaged) > WRITTEN else ""
    return [
        f"A cell is the mean over {', '.join(names)}{more}: of {cells.size} designs (median), which scatter by "
        f"{significant(cells.scatter, 2)}{value.after} (standard deviation in a cell, median)."
    ]


def distribution_of(source: Source, figure: Figure, found: Marks) -> Distribution:
    """How values scatter, with percentiles whose intervals hold for independent draws."""
    scatters = [
        Scatter(source.quantity(name), partial(_answered, source, name), marks, source.nominal.get(name))
        for name, marks in found.percentiles.items()
    ]
    line = "In brackets and shaded: 95 % confidence intervals of the percentiles, whatever the distribution."
    if source.loaded.given is not None:
        line += " They hold if the designs of the table are independent draws."
    elif source.loaded.study.sampling.method != "monte_carlo":
        line += " They are those of independent draws; as a rule these designs, spread evenly, do better."
    return Distribution(scatters, source.caption(figure, "How the values scatter", line))


def _answered(source: Source, name: str) -> Array:
    return source.table.answered(name)[0]


def sensitivity_of(source: Source, figure: Figure, found: Shares) -> Sensitivity:
    """Sobol indices, and what the factors are called."""
    shares = [Share(source.quantity(name), indices) for name, indices in found.indices.items()]
    line = "Sobol indices; whiskers: 95 % confidence."
    if source.loaded.study.sampling.method != "saltelli":
        line = (
            "First-order Sobol indices from one plain sample, by regression on each factor alone; whiskers: 95 % "
            'confidence. Total indices need method = "saltelli".'
        )
        if source.loaded.study.correlation or source.loaded.given is not None or not source.table.ok.all():
            line += " Factors may depend on one another, if only by the designs without an answer: shares overlap then."
    nothing = [f"{text[0].upper()}{text[1:]}." for text in source.unseen]
    factors = [factor(column).name for column in source.loaded.columns]
    caption = source.caption(figure, "Which factor causes the variance", line, *nothing)
    return Sensitivity(shares, factors, caption)


def front_of(source: Source, figure: Figure, found: Best) -> ParetoFront:
    """The designs that no other beats in two columns, and some of them drawn."""
    x, y = figure.x or "", figure.y or ""
    table = source.table.considered
    quantities, points = (source.axis(x), source.axis(y)), np.column_stack(table.answered(x, y))
    broken = int(np.sum(source.table.infeasible))
    title = f"{quantities[1].name} against {quantities[0].name}"
    return ParetoFront(
        source.caption(figure, title[0].upper() + title[1:], *source.unbeaten(figure, found.front.places)),
        *quantities,
        *(figure.x_better, figure.y_better),
        points=points,
        front=found.front.places,
        undrawable=found.front.undrawable,
        chosen=[
            Chosen(
                place,
                outline_of(stage),
                _about(source, quantities, points[place], found.values[place]),
            )
            for place, stage in found.chosen.items()
        ],
        left_out=_left_out(table, found.unchecked, broken),
        base=source.base(x, y),
    )


def _about(source: Source, quantities: tuple[Quantity, Quantity], point: Array, values: Array) -> list[str]:
    """What to write below a drawn design: x and y, and its factors (columns,)."""
    factors = [factor(column) for column in source.loaded.columns]
    shown = {quantity.name for quantity in quantities}
    others = [pair for pair in zip(factors, values, strict=True) if pair[0].name not in shown]
    given = [*zip(quantities, point, strict=True), *others[:WRITTEN]]
    lines = [f"{quantity.name}: {significant(value, 3)}{quantity.after}" for quantity, value in given]
    if len(others) > WRITTEN:
        lines.append(f"and {len(others) - WRITTEN} factors more")
    return lines


def _left_out(table: StudyTable, unchecked: int, broken: int) -> list[str]:
    without = {status: int(np.sum(which)) for status, which in table.unanswered.items()}
    if broken:
        without["that break a constraint"] = broken
    notes = [f"not drawn: {counted(without)}"] if without else []
    if unchecked:
        notes.append(f"{unchecked} on the front are not known to be drawable")
    return notes


def _band_line(source: Source, value: str) -> list[str]:
    """How uncertain an error is by its mesh, where the study says."""
    band = value.replace("error_", "band_")
    if band == value or band not in source.table.columns:
        return []
    (found,) = source.table.answered(band)
    return [
        f"Mesh band of the error: median {significant(float(np.median(found)), 2)}, largest "
        f"{significant(float(found.max()), 2)} percentage points."
    ]


def write_study_figures(source: Source, found: Sequence[Shown], folder: Path) -> list[Path]:
    """Draw every figure of a study file as PNG and PDF, but those that are refused.

    Parameters
    ----------
    source : the study, its collected table, which may still lack designs, and its base stage.
    found : what each figure shows, as `study.findings` finds it.
    folder : where the files go, named after study, kind of figure and what a map shows; made when missing.

    Returns the paths written. Raises BadInput when the folder does not take a file.
    """
    drawn = {folder / f"{name}.png": page_of(record) for name, record in records(source, found).items()}
    require_unread(*figure_files(*drawn))
    return [path for beside, page in drawn.items() for path in write_beside(beside, page)]


def records(source: Source, found: Sequence[Shown]) -> dict[str, Record]:
    """What the figures of a study file show, by the names of their files, but for those that are refused."""
    figures = zip(named(source.loaded), found, strict=True)
    drawn = ((*known, shown) for known, shown in figures if not isinstance(shown, Refused))
    return {name: record_of(source, figure, shown) for name, figure, shown in drawn}


def page_of(record: Record) -> matplotlib.figure.Figure:
    """The page of one record."""
    match record:
        case StudyMap():
            return map_figure(record)
        case Distribution():
            return distribution_figure(record)
        case Sensitivity():
            return sensitivity_figure(record)
        case ParetoFront():
            return pareto_figure(record)


def named(loaded: LoadedStudy) -> Iterator[tuple[str, Figure]]:
    """The figures with the names of their files, which differ."""
    seen: dict[str, int] = {}
    for figure in loaded.study.figure:
        shown = figure.value if figure.kind == "map" else None
        name = "-".join(part for part in (loaded.stem, figure.kind, shown) if part)
        seen[name] = seen.get(name, 0) + 1
        yield (name if seen[name] == 1 else f"{name}-{seen[name]}"), figure
