"""What the figures of a study show, found in its table before anything is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from pydantic import ValidationError

from flexfem.arrays import Array
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.study.designs import stage_of
from flexfem.study.reductions import Front, cells_of, drawable_front, spread, wide
from flexfem.study.sampling import sample
from flexfem.study.statistics import Indices, Percentile, percentiles, sensitivity
from flexfem.study.tables import Figure

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy

MARKED = (2.5, 50.0, 97.5)  # percentiles
ATTEMPTS = 2000  # designs of a front that are drawn to see whether they can be; some 10 ms each
SIZE = "envelope_mm"


class Extremes(NamedTuple):
    """Of a map: the least and the most of its value, (value, x, y) each, in file units."""

    least: tuple[float, float, float]
    most: tuple[float, float, float]


class Marks(NamedTuple):
    """Of a distribution: the percentiles `MARKED` of every value."""

    percentiles: Mapping[str, Sequence[Percentile]]


class Shares(NamedTuple):
    """Of a sensitivity: the indices of every value, in the order of the columns `factors`."""

    factors: Sequence[str]
    indices: Mapping[str, Indices]


class Best(NamedTuple):
    """Of a Pareto figure: places are among the designs that have an answer.

    front : the best designs.   unchecked : how many of them may turn out impossible to draw.
    chosen : some of them to look at, by place, in the order of the front.   values : their factors (columns,) likewise.
    power : slope of log y over log x along the front, least squares; None where it has none.
    gain : y over the base stage's y, of the best design no worse in x and no larger; None where there is none.
    """

    front: Front
    unchecked: int
    chosen: Mapping[int, Stage]
    power: float | None
    gain: float | None
    values: Mapping[int, Array]


class Refused(NamedTuple):
    """Of a figure that cannot be drawn from this table: why, in one line."""

    reason: str


Shown: TypeAlias = Extremes | Marks | Shares | Best | Refused


def findings(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float]) -> list[Shown]:
    """What every figure of a study file shows.

    Parameters
    ----------
    nominal : the base stage's values by column, where known.

    Raises BadInput when nothing has an answer; a figure that cannot be drawn for reasons of its own is `Refused`.
    """
    if not table.ok.any():
        raise BadInput(f"{loaded.path}: none of {len(table.design)} designs has an answer, expected some to draw")
    return [_tried(loaded, table, nominal, figure) for figure in loaded.study.figure]


def _tried(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> Shown:
    try:
        _require_numbers(loaded, table, figure)
        return _finding(loaded, table, nominal, figure)
    except BadInput as error:
        return Refused(str(error))


def _require_numbers(loaded: LoadedStudy, table: StudyTable, figure: Figure) -> None:
    """Raise BadInput where a derived output of a figure has no value for a design that has an answer."""
    for name, _ in figure.columns.values():
        bad = np.flatnonzero(table.ok & ~np.isfinite(table.columns[name]))
        if len(bad):
            raise BadInput(
                f"{loaded.path}: {figure.kind} of {name}: no finite number for {len(bad)} of {int(table.ok.sum())} "
                f"designs with an answer, expected one for each; the first is design {table.design[bad[0]]}"
            )


def _finding(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> Shown:
    match figure.kind:
        case "map":
            return _extremes(loaded, table, figure)
        case "distribution":
            return _marks(loaded, table, figure)
        case "sensitivity":
            factors = [column.name for column in loaded.columns]
            return Shares(factors, {name: sensitivity(loaded, table, name) for name in figure.values or ()})
        case "pareto":
            return _best(loaded, table.considered, nominal, figure)


def _extremes(loaded: LoadedStudy, table: StudyTable, figure: Figure) -> Extremes:
    cells = cells_of(loaded, table, (figure.x or "", figure.y or ""), figure.value or "")
    known = np.isfinite(cells.values)
    if not known.any():
        raise BadInput(f"{loaded.path}: map of {figure.value}: no design to show keeps all constraints, expected some")
    value, (x, y) = cells.values[known], cells.points[known].T
    least, most = ((float(value[k]), float(x[k]), float(y[k])) for k in (value.argmin(), value.argmax()))
    return Extremes(least, most)


def _marks(loaded: LoadedStudy, table: StudyTable, figure: Figure) -> Marks:
    """Percentiles with intervals for independent draws: a row of Saltelli's scheme is one with all that vary it."""
    saltelli = loaded.study.sampling.method == "saltelli"
    draws = table.design[table.ok] // (len(loaded.columns) + 2) if saltelli else None
    names = figure.values or ()
    return Marks({name: percentiles(table.answered(name)[0], MARKED, draws) for name in names})


def _best(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> Best:
    x, y = table.answered(figure.x or "", figure.y or "")
    if len(x) == 0:
        raise BadInput(f"{loaded.path}: pareto of {figure.y}: no design keeps all constraints, expected some")
    larger = (figure.x_better == "larger", figure.y_better == "larger")
    attempts = 0 if loaded.study.draws else ATTEMPTS  # what was drawn before it was answered can be drawn
    values_at = _values(loaded, table)
    front = drawable_front(x, y, larger, lambda place: drawable(loaded, values_at(place)) is not None, attempts)
    one, other = (_as_drawn(loaded, name, v)[front.places] for name, v in ((figure.x, x), (figure.y, y)))
    values = {int(place): values_at(int(place)) for place in front.places[spread(one, other, figure.drawn)]}
    chosen = {place: drawable(loaded, row) for place, row in values.items()}
    return Best(
        front,
        front.unchecked if attempts else 0,
        {place: stage for place, stage in chosen.items() if stage is not None},
        power_of(x[front.places], y[front.places]),
        _gain(loaded, table, nominal, figure),
        values,
    )


def _values(loaded: LoadedStudy, table: StudyTable) -> Callable[[int], Array]:
    """The factors (columns,) of the design at a place among those with an answer.

    They are drawn again by its number: all factors of all designs would be too much to hold.
    """
    before = np.cumsum(table.ok, dtype=np.int32)  # of these, up to every design

    def values_at(place: int) -> Array:
        design = int(table.design[np.searchsorted(before, place + 1)])
        return np.asarray(sample(loaded, design, design + 1)[0])

    return values_at


def _as_drawn(loaded: LoadedStudy, name: str | None, values: Array) -> Array:
    """A column as an axis shows it: as logarithms where it has them."""
    log = any(column.name == name and column.factor.scale == "log" for column in loaded.columns)
    return np.log(values) if log or wide(values) else values


def drawable(loaded: LoadedStudy, values: Array) -> Stage | None:
    """The stage of factor values (columns,), None when it cannot be made."""
    try:
        stage = stage_of(loaded, values)
        check_feasible(stage)
    except (BadInput, ValidationError):
        return None
    return stage


def power_of(x: Array, y: Array) -> float | None:
    """Slope of log y over log x (m,), by least squares; None for one x alone, or values that are not positive."""
    if np.min(x) <= 0 or np.min(y) <= 0 or np.ptp(np.log(x)) == 0:
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def _gain(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> float | None:
    """What the best drawable design gains in y over the base stage, at no cost in x and size."""
    x, y = figure.x or "", figure.y or ""
    if not {x, y, SIZE} <= nominal.keys() or nominal[y] == 0:
        return None
    reached, gained, size = table.answered(x, y, SIZE)
    sign = {"larger": 1.0, "smaller": -1.0}
    fits = np.flatnonzero((sign[figure.x_better] * (reached - nominal[x]) >= 0) & (size <= nominal[SIZE]))
    ordered = fits[np.argsort(-sign[figure.y_better] * gained[fits], kind="stable")]
    values_at = _values(loaded, table)
    found = (place for place in ordered[:ATTEMPTS].tolist() if drawable(loaded, values_at(place)) is not None)
    best = next(found, None)
    return None if best is None else float(gained[best] / nominal[y])
