"""Findings of a study as records for figures, page and terminal: maps, fronts, percentiles, Sobol
indices.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

import flexfem
from flexfem.arrays import ROUND_OFF, AnyArray, Array, Index, brief, is_wide
from flexfem.files.refusals import path_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.setup import kind_of_answer
from flexfem.refused import BadInput
from flexfem.results import SPACE, thousands
from flexfem.study.columns import LABELS, LIVES, RANGES, STRESSES
from flexfem.study.factors import Column
from flexfem.study.loaded import LoadedStudy
from flexfem.study.plan import Figure, Study
from flexfem.units import DIRECTIONS, unit_of, without_unit

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable

PER_CELL = 12
MOST_CELLS = 25  # mean designs in a cell of a map; most cells along one side
FEW = 3  # least number of random designs for a mean
CONFIDENCE = 0.95
LEAST = 100  # designs for indices from a plain sample; with 60, intervals of 95 % covered 86 %
MOST_BINS = 32
FEW_LEVELS = 12  # most bins of the range of a factor; most values that are groups by themselves
FLAT = 1e-9  # relative spread up to which a value is constant but for round-off
MARKED = (2.5, 50.0, 97.5)  # percentiles
ATTEMPTS = 2000  # most designs of a front that are tested for drawing; some 10 ms each
SIZE = "envelope_mm"
TRUSTED = (5.0, 10.0)  # per cent of error, whose contours are heavier
LARGEST = 1e100  # largest drawn number, whose square and inverse square are finite
WORDS = {"youngs modulus": "Young's modulus", "poissons ratio": "Poisson's ratio"}


# names


class AxisText(NamedTuple):
    """Name of an axis, its unit or "", and whether it is logarithmic."""

    name: str
    unit: str = ""
    log: bool = False

    @property
    def label(self) -> str:
        """Name and, in brackets, unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def after(self) -> str:
        """The unit as text after a number, with spaces that do not break."""
        return SPACE + self.unit.replace(" ", SPACE) if self.unit else ""


class Caption(NamedTuple):
    """Text above a figure: title, lines on the origin of its numbers, key paths of assumed and not
    stated numbers.
    """

    title: str
    lines: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str] = ()


def axis_of(loaded: LoadedStudy, name: str) -> AxisText:
    """Return name and unit of a column of a study."""
    study = loaded.study
    if column := next((column for column in loaded.columns if column.name == name), None):
        return factor(column)
    if derived := next((derived for derived in study.output if derived.name == name), None):
        return AxisText(derived.label or name, derived.unit or "")
    return asked(name, loaded.base) if name in study.ask else output(name, study)


def output(column: str, study: Study | None = None) -> AxisText:
    """Return the name of an output column, with the known error of a stress by finite elements."""
    below = study.stress_below if study is not None and column in STRESSES else ""
    name = LABELS.get(column, column) + (f" ({below})" if below else "")
    return AxisText(name, unit_of(column).name, column == "life_cycles")


def asked(path: str, mechanism: Mechanism) -> AxisText:
    """Return the meaning and unit of a number of a result about a mechanism at a path such as
    `stiffness.free.analytic.x`.
    """
    question, name, *labels = path.replace("_", " ").split(".")
    kind = kind_of_answer(getattr(flexfem, question), mechanism)
    quantity = kind.quantities[name.replace(" ", "_")]
    if len(labels) != len(quantity.over):
        return AxisText(path)
    head, *rest = quantity.meaning.split(", ")
    for axis, label in zip(quantity.over, labels, strict=True):
        if axis == "direction":
            head += f" in {'XYθ'[DIRECTIONS.index(label)]}"
        elif axis != "model":
            rest.append(label if label.startswith(axis) else f"{axis} {label}")
    place = tuple(DIRECTIONS.index(label) if label in DIRECTIONS else 0 for label in labels)
    return AxisText(", ".join([head, *rest]), quantity.unit_at(place).name)


def factor(column: Column) -> AxisText:
    """Return the name of a factor: its label in the study, or its keys in words."""
    units = {unit_of(key).name for key in column.keys}
    name = column.factor.label or " = ".join(words(without_unit(key)) for key in column.keys)
    return AxisText(name, units.pop() if len(units) == 1 else "", column.factor.scale == "log")


def words(key: str) -> str:
    """Return a key path without unit in words: `override.2.elbow.neck` is `neck, chain 2 elbow`."""
    *tables, last = path_of(key)
    leaf = last if isinstance(last, str) else f"{str(tables.pop()).removesuffix('s')} {last + 1}"
    leaf = leaf.replace("_", " ")
    leaf = WORDS.get(leaf, leaf)
    match tables:
        case ["override", chain, *part]:
            return f"{leaf}, chain {chain} {' '.join(map(str, part))}"
        case ["actuator", name]:
            return f"{leaf} of actuator {name}"
        case ["hinges", hinge]:
            return f"{leaf} of {hinge} hinges"
        case ["platform" | "frame" as body]:
            return f"{leaf} of the {body}"
    return leaf


def model_words(loaded: LoadedStudy) -> str:
    """Return a description of the model."""
    study = loaded.study
    base = loaded.base
    analytic = loaded.family.analytic_words
    meshed = f"{study.resolution} triangles across every neck"
    layers = f"{study.layers} layer{'s' * (study.layers > 1)}"
    model = {
        "analytic": f"Analytic model: {analytic}",
        "fe": f"Finite elements: {meshed}",
        "three_dimensional": f"Finite elements in three dimensions: {meshed}, {layers} in half the thickness",
        "verify": f"Finite elements ({meshed}) against the analytic model ({analytic})",
    }[study.model]
    return model if base.model == "plane_stress" else f"{model}, {base.model.replace('_', ' ')}"


def sampling_words(loaded: LoadedStudy) -> str:
    """Return a description of the sampling."""
    sampling = loaded.study.sampling
    if loaded.table is not None:
        return f"table {loaded.table.path.name}"
    seeded = f"{sampling.method.replace('_', ' ').title()}, seed {sampling.seed}"
    return sampling.method if sampling.seed is None else seeded


def counted(counts: Mapping[str, int]) -> str:
    """Return the number of designs by status as text: `9 871 ok, 129 refused`."""
    return ", ".join(f"{thousands(count)} {status}" for status, count in counts.items() if count)


def sentence(text: str) -> str:
    """Return a text with a capital and a full stop."""
    return f"{text[0].upper()}{text[1:]}."


@brief
class Source(NamedTuple):
    """Data of all figures: the study, its table, and the factors and outputs of the base stage by
    column.
    """

    loaded: LoadedStudy
    table: StudyTable
    nominal: Mapping[str, float]

    def quantity(self, name: str) -> AxisText:
        """Return name and unit of a column."""
        return axis_of(self.loaded, name)

    def column(self, name: str) -> Array:
        """Return the numbers (n,) of a column of the table, round-off as 0."""
        return self._cleared(name, self.table.columns[name])

    def base_value(self, name: str) -> float | None:
        """Return the number of the base stage in a column, round-off as 0; None where it is not
        known.
        """
        value = float(self._cleared(name, np.asarray(self.nominal.get(name, np.nan))))
        return value if np.isfinite(value) else None

    def _cleared(self, name: str, values: Array) -> Array:
        return np.where(
            np.abs(values) <= ROUND_OFF * self.table.round_off_sizes.get(name, 0.0), 0.0, values
        )

    def caption(self, figure: Figure, title: str, *lines: str) -> Caption:
        """Return the text above a figure, with the title of the study file where it has one."""
        loaded = self.loaded
        study = self.loaded.study
        table = self.table
        counts = table.counts | {"unfinished": loaded.count - len(table.design)}
        text = [
            f"Study: {study.name}. Base: {loaded.base.name}.",
            f"{model_words(loaded)}. {thousands(loaded.count)} designs "
            f"({sampling_words(loaded)}): {counted(counts)}.",
        ]
        if study.constraint:
            limits = "; ".join(
                f"{constraint.title} {constraint.expected}" for constraint in study.constraint
            )
            kept = thousands(int(table.kept.sum()))
            computed = thousands(int(table.ok.sum()))
            text.append(
                f"{kept} of {computed} designs with a result satisfy the constraints: {limits}."
            )
        text += [f"{warning}." for warning in table.warnings]
        if study.behind(name for name, _ in figure.columns.values()) & {*STRESSES, *RANGES, *LIVES}:
            text.append(sentence(loaded.stress_accuracy))
        return Caption(figure.title or sentence(title)[:-1], [*text, *lines], *loaded.assumptions)

    def base_point(self, x: str, y: str) -> tuple[float, float] | None:
        """Return two numbers of the base stage, None where they are not known."""
        base_x = self.base_value(x)
        base_y = self.base_value(y)
        return None if base_x is None or base_y is None else (base_x, base_y)

    def refusal(self, kind: str, name: str, reason: str) -> BadInput:
        """Return the error that a figure of a column cannot be drawn."""
        return BadInput(f"{self.loaded.path}: {kind} of {name}: {reason}")


# records


class FigureTable(NamedTuple):
    """Numbers of a figure: headings by key, and rows of texts followed by numbers."""

    caption: str
    head: Mapping[str, str]
    rows: Sequence[Sequence[str | float]]

    @property
    def facts(self) -> list[dict[str, str | float | None]]:
        """The rows as plain data, None for numbers that are not finite."""
        plain = (
            [x if isinstance(x, str) or np.isfinite(x) else None for x in row] for row in self.rows
        )
        return [dict(zip(self.head, row, strict=True)) for row in plain]


NO_TABLE = FigureTable("", {}, [])


@brief
class Cells(NamedTuple):
    """Points (n, 2) of a map with values (n,), nan where there is none; `missing` marks these
    points (n,) by reason.

    grid : whether the points are all pairs of some values.   averaged : columns over which the
    values are means.
    scatter, size : median over the cells of the standard deviation in a cell, and of its number of
    designs."""

    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    averaged: tuple[str, ...] = ()
    scatter: float = 0.0
    size: int = 1


@brief
class StudyMap(NamedTuple):
    """A value over two factors; `marks` are emphasised contours, `base` is x and y of the base
    stage.
    """

    caption: Caption
    x: AxisText
    y: AxisText
    value: AxisText
    cells: Cells
    marks: tuple[float, ...] = ()
    base: tuple[float, float] | None = None
    table: FigureTable = NO_TABLE


class Percentile(NamedTuple):
    """A percentile of a sample and its confidence interval, with an infinite end where the sample
    is too small.
    """

    percent: float
    value: float
    low: float
    high: float


@brief
class Scatter(NamedTuple):
    """Scatter of one quantity (n,): percentiles from low to high, and the value of the base stage
    where known.
    """

    quantity: AxisText
    values: Array
    percentiles: Sequence[Percentile]
    nominal: float | None = None


@brief
class Distribution(NamedTuple):
    """Scatter of several quantities."""

    caption: Caption
    scatters: Sequence[Scatter]
    table: FigureTable = NO_TABLE


class Share(NamedTuple):
    """Sobol indices (k,) of one quantity by factor, and half-widths of their confidence intervals;
    total indices where the sampling gives them."""

    first: Array
    first_band: Array
    total: Array | None = None
    total_band: Array | None = None
    quantity: AxisText = AxisText("")


@brief
class Sensitivity(NamedTuple):
    """Sobol indices of several quantities, and names of the factors in the order of the indices."""

    caption: Caption
    shares: Sequence[Share]
    factors: Sequence[str]
    table: FigureTable = NO_TABLE


class Chosen(NamedTuple):
    """A drawn design of a front: its `place` among the points, its stage, and the numbers below it."""

    place: int
    stage: Mechanism
    numbers: Sequence[tuple[AxisText, float]]


@brief
class ParetoFront(NamedTuple):
    """Pareto front of two quantities.

    points : (n, 2), x and y of every feasible design.   front : (m,), places of the designs on the
    front, in order.
    undrawable : (k,), places of designs on the front or better that cannot be drawn.
    left_out : designs that are not shown, one line for each kind.   base : x and y of the base
    stage.
    power : slope of log y over log x along the front.   gain : ratio of y to that of the base
    stage, for the best design no worse in x and no larger."""

    caption: Caption
    x: AxisText
    y: AxisText
    better: tuple[str, str]
    points: Array
    front: Index
    undrawable: Index
    chosen: Sequence[Chosen]
    left_out: Sequence[str]
    base: tuple[float, float] | None = None
    power: float | None = None
    gain: float | None = None
    table: FigureTable = NO_TABLE


class Refused(NamedTuple):
    """The reason, in one line, why a figure cannot be drawn from this table."""

    reason: str


Record: TypeAlias = StudyMap | Distribution | Sensitivity | ParetoFront


def findings(source: Source) -> dict[str, Record | Refused]:
    """Return the record of every figure of a study file by the name of its image; `Refused` where
    it cannot be drawn.

    Raises BadInput: no design has a result.
    """
    loaded = source.loaded
    table = source.table
    if not table.ok.any():
        raise BadInput(
            f"{loaded.path}: none of {len(table.design)} designs has a result, expected some to "
            "draw"
        )
    makers: dict[str, Callable[[Source, Figure], Record]]
    makers = {
        "map": map_of,
        "distribution": distribution_of,
        "sensitivity": sensitivity_of,
        "pareto": front_of,
    }
    records = dict[str, Record | Refused]()
    used = Counter[str]()
    for figure in loaded.study.figure:
        stem = "-".join(part for part in (loaded.stem, figure.kind, figure.value) if part)
        used[stem] += 1
        name = stem if used[stem] == 1 else f"{stem}-{used[stem]}"
        try:
            for column, _ in figure.columns.values():
                _require_drawable(source, figure.kind, column)
            records[name] = makers[figure.kind](source, figure)
        except BadInput as error:
            records[name] = Refused(str(error))
    return records


def _require_drawable(source: Source, kind: str, name: str) -> None:
    table = source.table
    sizes = np.abs(source.column(name))
    bad = np.flatnonzero(table.ok & (sizes != 0) & ~((sizes >= 1 / LARGEST) & (sizes <= LARGEST)))
    if len(bad):
        designs = (
            f"{len(bad)} of {int(table.ok.sum())} designs with a result, expected one for each"
        )
        number = f"no number that is 0 or {1 / LARGEST:g} to {LARGEST:g} in size"
        raise source.refusal(
            kind, name, f"{number} for {designs}; the first is design {table.design[bad[0]]}"
        )


# maps


def map_of(source: Source, figure: Figure) -> StudyMap:
    """Return the map of an output over two factors, averaged over other factors that vary. Raises
    BadInput.
    """
    x, y, value = (name or "" for name in (figure.x, figure.y, figure.value))
    x_axis, y_axis, value_axis = map(source.quantity, (x, y, value))
    cells = cells_of(source, (x, y), value)
    lines = list[str]()
    if not np.isfinite(cells.values).any():
        raise source.refusal(
            "map", value, "no shown design satisfies all constraints, expected some"
        )
    if cells.averaged:
        names = ", ".join(source.quantity(name).name for name in cells.averaged)
        lines.append(
            f"A cell is the mean over {names} of {cells.size} designs (median); their standard "
            f"deviation is {cells.scatter:.2g}{value_axis.after} (median)."
        )
    band = value.replace("error_", "band_")
    if band != value and band in source.table.columns:
        (bands,) = source.table.with_results(band)
        median = f"median {np.median(bands):.2g}"
        largest = f"largest {bands.max():.2g} percentage points"
        lines.append(f"Mesh band of the error: {median}, {largest}.")
    ends = {"least": np.nanargmin(cells.values), "most": np.nanargmax(cells.values)}
    rows = [
        (word, float(cells.values[at]), *cells.points[at].tolist()) for word, at in ends.items()
    ]
    head = {"end": "", value: value_axis.label, x: x_axis.label, y: y_axis.label}
    table = FigureTable("Extremes of the map", head, rows)
    marks = (
        (*TRUSTED, *(-mark for mark in TRUSTED)) if value.startswith(("error_", "cross_")) else ()
    )
    caption = source.caption(
        figure, f"{value_axis.name} over {x_axis.name} and {y_axis.name}", *lines
    )
    return StudyMap(
        caption, x_axis, y_axis, value_axis, cells, marks, source.base_point(x, y), table
    )


def cells_of(source: Source, names: tuple[str, str], value: str) -> Cells:
    """Return a column over two factors, as means in cells of these where other factors vary too."""
    loaded = source.loaded
    table = source.table
    factors = (column.name for column in loaded.columns)
    others = tuple(
        name for name in factors if name not in names and np.ptp(table.columns[name]) > 0
    )
    points = np.column_stack([table.columns[name] for name in names])
    values = source.column(value)
    grid = loaded.study.sampling.method == "grid"
    if not others:
        missing = {status: table.status == status for status in table.counts if status != "ok"}
        missing |= {"violates a constraint": table.infeasible} if table.infeasible.any() else {}
        return Cells(points, np.where(table.kept, values, np.nan), missing, grid)
    bins = len(points) if grid else int(np.clip(np.sqrt(len(points) / PER_CELL), 2, MOST_CELLS))
    log = {column.name: column.factor.scale == "log" for column in loaded.columns}
    (xs, i), (ys, j) = (
        _binned(v, bins, log[name]) for v, name in zip(points.T, names, strict=True)
    )
    cell = (i * len(ys) + j)[table.kept]
    kept = values[table.kept]
    count = np.bincount(cell, minlength=len(xs) * len(ys))
    enough = count >= (1 if grid else FEW)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(cell, kept, len(count)) / count
        scatter = np.sqrt(np.bincount(cell, (kept - mean[cell]) ** 2, len(count)) / (count - 1))
    several = enough & (count > 1)
    return Cells(
        np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2),
        np.where(enough, mean, np.nan),
        {"no design" if grid else f"fewer than {FEW} designs": ~enough} if not enough.all() else {},
        True,
        others,
        float(np.median(scatter[several])) if several.any() else 0.0,
        int(np.median(count[enough])) if enough.any() else 0,
    )


def _binned(column: Array, bins: int, log: bool) -> tuple[Array, Index]:
    """Return the centres of the bins of a factor, or its values if few, and the bin of each design
    (n,).
    """
    levels, group = np.unique(column, return_inverse=True)
    if len(levels) <= bins:
        return levels, np.asarray(group, dtype=np.int64)
    places = np.log(column) if log else column
    ends = np.linspace(places.min(), places.max(), bins + 1)
    group = np.clip(np.searchsorted(ends, places, side="right") - 1, 0, bins - 1)
    centres = (ends[1:] + ends[:-1]) / 2
    return np.asarray(np.exp(centres) if log else centres), np.asarray(group, dtype=np.int64)


# fronts


def front_of(source: Source, figure: Figure) -> ParetoFront:
    """Return the Pareto front of two columns, with stages of some of its designs. Raises BadInput."""
    loaded = source.loaded
    table = source.table
    x = figure.x or ""
    y = figure.y or ""
    rows = np.flatnonzero(table.kept)
    if len(rows) == 0:
        raise source.refusal("pareto", y, "no design satisfies all constraints, expected some")
    axes = {
        name: source.quantity(name)
        for name in dict.fromkeys([x, y, *(column.name for column in loaded.columns)])
    }
    points = np.column_stack([source.column(name)[rows] for name in (x, y)])

    def stages_at(places: Index) -> Iterator[Mechanism | None]:
        values = np.column_stack(
            [table.columns[column.name][rows[places]] for column in loaded.columns]
        )
        return (drawable(loaded, row) for row in values)

    larger = (figure.x_better == "larger", figure.y_better == "larger")
    attempts = (
        0 if loaded.study.draws else ATTEMPTS
    )  # designs that were drawn before they were solved can be drawn
    front, undrawable, unchecked = drawable_front(points, larger, stages_at, attempts)
    best = points[front]
    power = None
    gain = None
    if best.min() > 0 and np.ptp(best[:, 0]) > 0:
        power = float(np.polyfit(np.log(best[:, 0]), np.log(best[:, 1]), 1)[0])
    base = source.base_point(x, y)
    base_size = source.base_value(SIZE)
    if SIZE in table.columns and base is not None and base_size is not None and base[1]:
        ahead = (points - base) * np.where(larger, 1.0, -1.0)  # of the base stage
        eligible = (ahead[:, 0] >= 0) & (source.column(SIZE)[rows] <= base_size)
        eligible[undrawable] = False
        places = np.flatnonzero(eligible)
        places = places[np.argsort(-ahead[places, 1], kind="stable")][:ATTEMPTS]
        drawn = (k for k, stage in zip(places, stages_at(places), strict=True) if stage is not None)
        gain = next((float(points[k, 1] / base[1]) for k in drawn), None)
    x_axis, y_axis = (
        axes[name]._replace(log=axes[name].log or is_wide(v))
        for name, v in zip((x, y), points.T, strict=True)
    )
    along = [
        np.log(v) if axes[name].log or is_wide(v) else v
        for name, v in zip((x, y), best.T, strict=True)
    ]
    numbers = {name: source.column(name)[rows[front]].tolist() for name in axes}
    selected = spread(np.column_stack(along), figure.drawn)
    chosen = [
        Chosen(int(front[k]), stage, [(axis, numbers[name][k]) for name, axis in axes.items()])
        for k, stage in zip(selected, stages_at(front[selected]), strict=True)
        if stage is not None
    ]
    excluded = {status: n for status, n in table.counts.items() if status != "ok"}
    excluded["that violate a constraint"] = int(table.infeasible.sum())
    left_out = [f"not drawn: {counted(excluded)}"] if any(excluded.values()) else []
    if attempts and unchecked:
        left_out.append(f"{unchecked} on the front were not checked by drawing")
    lines = list[str]()
    if power is not None:
        lines.append(
            f"On the front, {y_axis.name} varies as {x_axis.name} to the power {power:.3g} (least "
            "squares)."
        )
    if gain is not None:
        best_of = (
            f"The best design that is no larger and no worse in {x_axis.name} than the base stage"
        )
        lines.append(f"{best_of} has {gain:.3g} times its {y_axis.name}.")
    head = {"design": "design", **{name: axis.label for name, axis in axes.items()}}
    designs = map(str, table.design[rows[front]])
    listed = FigureTable(
        "Designs of the front", head, [*zip(designs, *numbers.values(), strict=True)]
    )
    caption = source.caption(figure, f"{y_axis.name} against {x_axis.name}", *lines)
    better = (figure.x_better, figure.y_better)
    shown = (chosen, left_out, base, power, gain, listed)
    return ParetoFront(caption, x_axis, y_axis, better, points, front, undrawable, *shown)


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
    group = np.maximum.accumulate(
        np.where(first, np.arange(len(order)), 0)
    )  # index of the first design of equal x
    return np.asarray(order[(y > best[group]) & (y == y[group])], dtype=np.int64)


def drawable_front(
    points: Array,
    larger: tuple[bool, bool],
    stages_at: Callable[[Index], Iterable[object]],
    attempts: int,
) -> tuple[Index, Index, int]:
    """Return the front of the designs that can be drawn, from the best in x to the best in y.

    stages_at : yields None for a design that cannot be drawn.   attempts : most designs that are
    tested.

    Also returns the places of designs on the front or better that cannot be drawn, and the number
    of designs on the front that were not tested."""
    possible = np.ones(len(points), dtype=bool)
    known = np.zeros(len(points), dtype=bool)
    while True:
        remaining = np.flatnonzero(possible)
        places = remaining[non_dominated(points[remaining], larger)]
        untested = places[~known[places]]
        tested = untested[: attempts - int(known.sum())]
        if len(tested) == 0:
            return places, np.flatnonzero(~possible), len(untested)
        known[tested] = True
        possible[tested] = [stage is not None for stage in stages_at(tested)]


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


def drawable(loaded: LoadedStudy, values: Array) -> Mechanism | None:
    """Return the stage or mechanism of factor values (columns,), None where it cannot be made."""
    return loaded.family.drawable(values)


# percentiles


def distribution_of(source: Source, figure: Figure) -> Distribution:
    """Return the scatter of outputs, with percentiles whose confidence intervals assume independent
    draws.
    """
    loaded = source.loaded
    table = source.table
    scatters = []
    rows = list[Sequence[str | float]]()
    method = loaded.study.sampling.method
    draws = table.design[table.ok] // (
        len(loaded.columns) + 2
    )  # rows of Saltelli's scheme from one Sobol point
    for name in figure.values or ():
        values = source.column(name)[table.ok]
        axis = source.quantity(name)
        base = source.base_value(name)
        found = percentiles(values, MARKED, draws if method == "saltelli" else None)
        scatters.append(Scatter(axis, values, found, base))
        rows += [(axis.name, axis.unit, f"{p:g}{SPACE}%", *ends) for p, *ends in found]
        rows += [] if base is None else [(axis.name, axis.unit, "base stage", base, np.nan, np.nan)]
    line = "In brackets and shaded: distribution-free 95 % confidence intervals of the percentiles."
    if method == "table":
        line += " They are valid if the designs of the table are independent draws."
    elif method != "monte_carlo":
        line += (
            " They assume independent draws; for these evenly spread designs they are usually "
            "too wide."
        )
    head = {
        "quantity": "value",
        "unit": "unit",
        "percent": "percentile",
        "value": "",
        "low": "from",
        "high": "to",
    }
    listed = FigureTable("Percentiles with 95 % confidence intervals", head, rows)
    return Distribution(source.caption(figure, "Scatter of the values", line), scatters, listed)


def percentiles(
    values: Array, percent: Sequence[float], draws: Index | None = None
) -> list[Percentile]:
    """Return percentiles, between 0 and 100, of a sample (n,) with their confidence intervals.

    draws : (n,), index from 0 of the independent draw to which each value belongs; None where each
    is its own draw.

    The number of draws below the true percentile is binomial, so that it lies between two order
    statistics with a probability known for every continuous distribution (H. A. David, H. N.
    Nagaraja, Order Statistics, 3rd ed., Wiley 2003, section 7.1); both tails are equal. Where
    values share a draw, the share below the percentile scatters from draw to draw (R. S. Woodruff,
    J. Am. Stat. Assoc. 47 (1952) 635)."""
    from scipy.stats import binom, norm

    ordered = np.sort(values)
    n = len(values)
    tail = (1 - CONFIDENCE) / 2
    results = []
    for p in percent:
        middle = float(np.percentile(ordered, p))
        share = p / 100
        if draws is None:
            first = int(binom.ppf(tail, n, share))
            last = int(binom.ppf(1 - tail, n, share)) + 1
        else:
            excess = np.bincount(draws, (values <= middle) - share)
            m = int(np.sum(np.bincount(draws) > 0))
            width = norm.ppf(1 - tail) * np.sqrt(m / (m - 1) * np.sum(excess**2)) if m > 1 else n
            first = int(np.floor(n * share - width))
            last = int(np.ceil(n * share + width)) + 1
        low = -np.inf if first < 1 else float(ordered[first - 1])
        results.append(Percentile(p, middle, low, np.inf if last > n else float(ordered[last - 1])))
    return results


# Sobol indices


def sensitivity_of(source: Source, figure: Figure) -> Sensitivity:
    """Return the Sobol indices of several outputs for every factor. Raises BadInput."""
    loaded = source.loaded
    shares = [
        sensitivity(source, name)._replace(quantity=source.quantity(name))
        for name in figure.values or ()
    ]
    line = "Sobol indices; whiskers: 95 % confidence."
    parts = {"first": "first order: alone", "first_band": "±"}
    if loaded.study.sampling.method == "saltelli":
        parts |= {"total": "total: with its interactions", "total_band": "±"}
    else:
        line = (
            "First-order Sobol indices from one plain sample, by regression on each factor alone; whiskers: 95 % "
            'confidence. Total indices need method = "saltelli".'
        )
        if loaded.study.correlation or loaded.table is not None or not source.table.ok.all():
            line += (
                " Factors may be dependent, also through designs without a result: shares then "
                "overlap."
            )
    factors = [factor(column).name for column in loaded.columns]
    rows: list[Sequence[str | float]] = [
        (factor_name, share.quantity.name, *(float(getattr(share, name)[k]) for name in parts))
        for share in shares
        for k, factor_name in enumerate(factors)
    ]
    head = {"factor": "factor", "quantity": "of the variance of", **parts}
    listed = FigureTable("Sobol indices with 95 % confidence", head, rows)
    return Sensitivity(
        source.caption(figure, "Share of variance by factor", line), shares, factors, listed
    )


def sensitivity(source: Source, value: str) -> Share:
    """Return the Sobol indices of an output column: first order, and total with Saltelli's scheme.

    Raises BadInput: a design of Saltelli's scheme has no result (none can be left out, because each
    belongs to several differences); too few designs have a result; or the value does not vary."""
    loaded = source.loaded
    table = source.table
    refusal = partial(source.refusal, "sensitivity", value)
    saltelli = loaded.study.sampling.method == "saltelli"
    if saltelli and (missing := loaded.count - len(table.design)):
        raise refusal(f"{missing} of {loaded.count} designs are not computed, expected all")
    if saltelli and not table.ok.all():
        bad = np.flatnonzero(~table.ok)
        first = f"design {table.design[bad[0]]}: {table.status[bad[0]]}: {table.reason[bad[0]]}"
        raise refusal(
            f"{len(bad)} of {loaded.count} designs have no result, expected all; the first is "
            f"{first}"
        )
    (values,) = table.with_results(value)
    if len(values) < LEAST and not saltelli:
        raise refusal(f"{len(values)} designs have a result, expected at least {LEAST}")
    if np.ptp(values) <= FLAT * (table.round_off_sizes.get(value) or np.abs(values).max()):
        raise refusal("no factor changes it, expected a value that varies")
    if saltelli:
        return sobol_indices(values, len(loaded.columns))
    return first_order((table.with_results(column.name)[0] for column in loaded.columns), values)


def sobol_indices(values: Array, factors: int) -> Share:
    """Return first-order and total indices of values (base * (factors + 2),) in the order of
    Saltelli's scheme: A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2 (b) and
    (f)."""
    groups = values.reshape(-1, factors + 2)
    groups = groups - groups[:, [0, -1]].mean()
    A = groups[:, 0]
    AB = groups[:, 1:-1].T
    B = groups[:, -1]
    variance = np.var([A, B])
    first = np.mean(B * (AB - A), axis=1) / variance
    total = np.mean((A - AB) ** 2, axis=1) / (2 * variance)
    size = (A**2 + B**2) / 2
    return Share(
        first,
        _half_widths(B * (AB - A), size, first),
        total,
        _half_widths((A - AB) ** 2 / 2, size, total),
    )


def first_order(factors: Iterable[Array], values: Array) -> Share:
    """Return first-order indices from any sample of values (n,); k `factors` (n,), one in memory at
    a time.

    An index is the share of the variance that a smooth curve in the factor explains (given-data
    estimation: E. Plischke, E. Borgonovo, C. L. Smith, Eur. J. Oper. Res. 226 (2013) 536; local
    polynomials: S. Da Veiga, F. Wahl, F. Gamboa, Technometrics 51 (2009) 452). The curve is a
    straight line in each of about n^(1/3) equally filled bins, or the mean for each value of a
    list. The share is `1 - s_r^2 / s^2`, both variances by their degrees of freedom, so that noise
    has no share on average. Shares of dependent factors overlap, because they include common
    effects."""
    n = len(values)
    size = (values - values.mean()) ** 2
    indices = []
    for column in factors:
        residual, parameters = _residual(column, values)
        unexplained = residual**2 * (n / (n - parameters))
        share = np.asarray(1.0 - unexplained.mean() / (size.sum() / (n - 1)))
        indices.append((float(share), float(_half_widths(size - unexplained, size, share))))
    return Share(*np.array(indices).T)


def _half_widths(parts: Array, size: Array, index: Array) -> Array:
    """Return half-widths (k,) of confidence intervals of indices (k,): means of parts (k, n) over
    that of size (n,).

    Normal and linearised: the variance of a ratio of means (W. G. Cochran, Sampling Techniques, 3rd
    ed., Wiley 1977)."""
    from scipy.special import ndtri

    deviation = (parts - index[..., None] * size) / size.mean()
    return np.asarray(
        ndtri((1 + CONFIDENCE) / 2) * deviation.std(axis=-1, ddof=1) / np.sqrt(len(size))
    )


def _residual(column: Array, values: Array) -> tuple[Array, int]:
    """Return the residual of values (n,) about a curve in one factor (n,), and the number of its
    parameters.
    """
    levels, group = np.unique(column, return_inverse=True)
    piecewise_linear = len(levels) > FEW_LEVELS
    if piecewise_linear:
        bins = min(MOST_BINS, max(2, round(len(column) ** (1 / 3))))
        group = np.searchsorted(np.quantile(column, np.linspace(0, 1, bins + 1)[1:-1]), column)
    counts = np.maximum(np.bincount(group), 1)
    x, y = (v - (np.bincount(group, v) / counts)[group] for v in (column, values))
    if not piecewise_linear:
        return y, len(levels)
    square = np.bincount(group, x * x)
    slope = np.bincount(group, x * y) / np.where(square > 0, square, 1.0)
    return y - slope[group] * x, 2 * len(counts)
