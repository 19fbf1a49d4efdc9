"""What each figure of a study shows, taken from its table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from flexfem.arrays import Array
from flexfem.design import Stage
from flexfem.errors import BadInput
from flexfem.layout.feasibility import check_feasible
from flexfem.report.stage_outline import outline_of
from flexfem.report.study_distribution import Scatter
from flexfem.report.study_labels import Caption, Quantity, caption_of, counted, factor, output
from flexfem.report.study_map import StudyMap
from flexfem.report.study_pareto import Chosen, ParetoFront
from flexfem.report.study_sensitivity import Share
from flexfem.report.units import significant
from flexfem.study.designs import stage_of
from flexfem.study.figure import Figure
from flexfem.study.pareto import Front, drawable_front, spread
from flexfem.study.percentiles import percentiles
from flexfem.study.plan import LoadedStudy
from flexfem.study.sensitivity import sensitivity
from flexfem.study.table import OK, StudyTable

MARKED = (2.5, 50.0, 97.5)  # percentiles
TRUSTED = (5.0, 10.0)  # per cent of error: contours that are drawn heavier
ATTEMPTS = 2000  # designs of a front that are drawn to see whether they can be; some 10 ms each
WIDE = 30.0  # largest over smallest value, from which on an axis is logarithmic
WRITTEN = 6  # factors below a drawing; more are left to the table


class Source(NamedTuple):
    """What all figures are drawn from: the study, its table, and the base stage's factors and outputs by column."""

    loaded: LoadedStudy
    table: StudyTable
    nominal: Mapping[str, float]

    def quantity(self, name: str) -> Quantity:
        """What a column is called."""
        return next((factor(column) for column in self.loaded.columns if column.name == name), None) or output(name)

    def axis(self, name: str) -> Quantity:
        """What a column is called, logarithmic where its values are far apart."""
        quantity, (values,) = self.quantity(name), self.table.answered(name)
        return quantity._replace(log=quantity.log or bool(0 < WIDE * values.min() < values.max()))

    def caption(self, figure: Figure, title: str, *lines: str) -> Caption:
        """What stands above a figure; its own title where it has one."""
        return caption_of(self.loaded, self.table, figure.title or title, lines)

    def base(self, x: str, y: str) -> tuple[float, float] | None:
        """Where the base stage is among the designs, None where that is not known."""
        found = tuple(self.nominal.get(name, np.nan) for name in (x, y))
        return (found[0], found[1]) if np.isfinite(found).all() else None


def map_of(source: Source, figure: Figure) -> StudyMap:
    """A value over two factors. Raises BadInput when others vary too, so that designs cover one another."""
    x, y, value = (name or "" for name in (figure.x, figure.y, figure.value))
    loaded, table = source.loaded, source.table
    points = np.column_stack([table.columns[x], table.columns[y]])
    grid = loaded.study.sampling.method == "grid"
    if grid and len(np.unique(points, axis=0)) < len(points):
        raise BadInput(f"{loaded.path}: map of {value}: other factors vary too, expected a grid of {x} and {y} alone")
    across, up, shown = (source.quantity(name) for name in (x, y, value))
    title = f"{shown.name} over {across.name} and {up.name}"
    return StudyMap(
        source.caption(figure, title[0].upper() + title[1:], *_band_line(source, value)),
        *(across, up, shown),
        points=points,
        values=table.columns[value],
        missing={why: np.asarray(table.status == why) for why in table.counts if why != OK},
        grid=grid,
        marks=(*TRUSTED, *(-mark for mark in TRUSTED)) if value.startswith(("error_", "cross_")) else (),
        base=source.base(x, y),
    )


def scatters_of(source: Source, figure: Figure) -> tuple[list[Scatter], Caption]:
    """How values scatter, with percentiles whose intervals hold for independent draws."""
    loaded, table = source.loaded, source.table
    method = loaded.study.sampling.method
    draws = table.design[table.ok] // (len(loaded.columns) + 2) if method == "saltelli" else None
    scatters = []
    for name in figure.values or ():
        (values,) = table.answered(name)
        found = percentiles(values, MARKED, draws)
        scatters.append(Scatter(source.quantity(name), values, found, source.nominal.get(name)))
    line = "In brackets and shaded: 95 % confidence intervals of the percentiles, whatever the distribution."
    if method != "monte_carlo":
        line += " They are those of independent draws; as a rule these designs, spread evenly, do better."
    return scatters, source.caption(figure, "How the values scatter", line)


def shares_of(source: Source, figure: Figure) -> tuple[list[Share], list[str], Caption]:
    """Sobol indices. Raises BadInput as `sensitivity` does."""
    loaded, table = source.loaded, source.table
    shares = [Share(source.quantity(name), sensitivity(loaded, table, name)) for name in figure.values or ()]
    line = "Sobol indices; whiskers: 95 % confidence by bootstrap."
    factors = [factor(column).name for column in loaded.columns]
    return shares, factors, source.caption(figure, "Which factor causes the variance", line)


def front_of(source: Source, figure: Figure) -> ParetoFront:
    """The designs that no other beats in two columns, and some of them drawn."""
    x, y = figure.x or "", figure.y or ""
    loaded, table = source.loaded, source.table
    across, up = table.answered(x, y)
    values = np.column_stack(table.answered(*(column.name for column in loaded.columns)))
    larger = (figure.x_better == "larger", figure.y_better == "larger")
    attempts = 0 if loaded.study.draws else ATTEMPTS  # what was drawn before it was answered can be drawn
    front = drawable_front(across, up, larger, lambda place: drawable(loaded, values[place]) is not None, attempts)
    quantities, points = (source.axis(x), source.axis(y)), np.column_stack([across, up])
    along = [np.log(v) if q.log else v for q, v in zip(quantities, points[front.places].T, strict=True)]
    chosen = front.places[spread(along[0], along[1], figure.drawn)]
    title = f"{quantities[1].name} against {quantities[0].name}"
    return ParetoFront(
        source.caption(figure, title[0].upper() + title[1:]),
        *quantities,
        *(figure.x_better, figure.y_better),
        points=points,
        front=front.places,
        undrawable=front.undrawable,
        chosen=[one for place in chosen if (one := _chosen(source, quantities, points, values, int(place)))],
        left_out=_left_out(table, front, attempts),
        base=source.base(x, y),
    )


def drawable(loaded: LoadedStudy, values: Array) -> Stage | None:
    """The stage of factor values (columns,), None when it cannot be made."""
    try:
        stage = stage_of(loaded, values)
        check_feasible(stage)
    except (BadInput, ValidationError):
        return None
    return stage


def _chosen(
    source: Source, quantities: tuple[Quantity, Quantity], points: Array, values: Array, place: int
) -> Chosen | None:
    """A design to draw and what to write below it; None when it turns out that it cannot be drawn."""
    stage = drawable(source.loaded, values[place])
    if stage is None:
        return None
    factors = [factor(column) for column in source.loaded.columns]
    others = [
        pair for pair in zip(factors, values[place], strict=True) if pair[0].name not in {q.name for q in quantities}
    ]
    given = [*zip(quantities, points[place], strict=True), *others[:WRITTEN]]
    lines = [f"{quantity.name}: {significant(value, 3)}{quantity.after}" for quantity, value in given]
    if len(others) > WRITTEN:
        lines.append(f"and {len(others) - WRITTEN} factors more")
    return Chosen(place, outline_of(stage), lines)


def _left_out(table: StudyTable, front: Front, attempts: int) -> list[str]:
    without = {status: count for status, count in table.counts.items() if status != OK}
    notes = [f"not drawn: {counted(without)}"] if without else []
    if front.unchecked and attempts:
        notes.append(f"{front.unchecked} on the front are not known to be drawable")
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
