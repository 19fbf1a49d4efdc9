"""The sections of a page on a study: what it asks, its figures with their numbers, and designs to point at."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array, Index
from flexfem.files.provenance import is_assumed
from flexfem.mechanism.bodies import Segment
from flexfem.mechanism.drawing import part_of
from flexfem.page.section import (
    POINTS,
    Cell,
    PageFigure,
    PageSection,
    facts,
    figure_html,
    file_text,
    inline_svg,
    json_data,
    markup,
    notes,
    places_on,
    table,
)
from flexfem.plot.study import Record, named, page_of, record_of
from flexfem.plot.study_figures import (
    CHART_HEIGHT,
    CHART_WIDTH,
    METHODS,
    ParetoFront,
    Quantity,
    StudyMap,
    chart_figure,
    factor,
    model_words,
    thousands,
)
from flexfem.plot.text import SPACE, round_factor, significant
from flexfem.refused import BadInput
from flexfem.study.factors import Column, columns_of
from flexfem.study.findings import Best, Cells, Extremes, Marks, Refused, Shares, Shown, round_off_in, spread
from flexfem.study.loaded import stage_of
from flexfem.units import LENGTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexfem.arrays import Array
    from flexfem.mechanism.stage import Stage
    from flexfem.plot.study import Source
    from flexfem.plot.study_figures import ParetoFront, Quantity, StudyMap
    from flexfem.study.factors import Factor
    from flexfem.study.findings import Extremes, Marks, Percentile, Shares
    from flexfem.study.loaded import LoadedStudy
    from flexfem.study.plan import Figure

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


REASONS = 20  # lines of reasons; more are counted


def asked_section(source: Source, status: dict[str, Any]) -> PageSection:
    """What was asked, and how many designs have an answer; `status` as `studies.study_status` gives it."""
    loaded = source.loaded
    html = [
        facts(_asked(loaded)),
        notes([*source.unseen, *status["warnings"]]),
        Markup("<h3>Factors</h3>"),
        table(("factor", "keys", "unit", "values", "source"), _factors(loaded), caption="Factors of the study"),
        Markup("<h3>Outputs</h3>"),
        table(("output", "column", "unit", "found by"), _outputs(source), caption="Outputs of the study"),
        _constraints(loaded),
        Markup("<h3>Designs</h3>"),
        table(("designs", "number"), _counts(source, status), sortable=False, caption="Designs by answer", numbers=1),
        _reasons(status["reasons"]),
    ]
    return PageSection("study-asked", "What the study asks", Markup("\n").join(html))


def _asked(loaded: LoadedStudy) -> Iterator[tuple[str, str]]:
    study = loaded.study
    yield "study", f"{study.name} ({loaded.path.name})"
    yield "base stage", f"{loaded.stage.name} ({study.stage})"
    yield "model", model_words(loaded)
    yield "sample", f"{METHODS[study.sampling.method]}, {thousands(loaded.count)} designs{_drawn_of_study(loaded)}"
    yield "accuracy of stresses", loaded.stress_accuracy
    for name in ("drive", "frequencies", "life", "drift"):
        asked = getattr(study, name)
        if asked is not None:
            given = asked.model_dump(exclude_unset=True)
            yield name, ", ".join(f"{key} = {value}" for key, value in given.items()) or "asked"
    yield "hash of its inputs", loaded.hash


def _drawn_of_study(loaded: LoadedStudy) -> str:
    seed, correlated = loaded.study.sampling.seed, len(loaded.study.correlation)
    said = "" if seed is None else f", seed {seed}"
    said += f", from {loaded.given.path.name}" if loaded.given is not None else ""
    return said + (f", {correlated} rank correlations" if correlated else "")


def _factors(loaded: LoadedStudy) -> Iterator[tuple[str, str, str, str, str | Markup]]:
    sources = loaded.study.sources
    columns = {column.name: column for column in loaded.columns}  # with their means filled in
    for index, given in enumerate(loaded.study.factor):
        for column in columns_of([given]):
            known = factor(columns[column.name])
            keys = ", ".join(column.keys)
            yield known.name, keys, known.unit, range_of(columns[column.name]), _sourced(sources, index, given)


def range_of(column: Column) -> str:
    """Which values a factor takes, in words, in the unit of its column."""
    asked = column.factor
    if asked.kind == "given":
        return "of the table of designs"
    if asked.values is not None:
        first = ", ".join(f"{value:g}" for value in asked.values[:8])
        return f"{first} and {len(asked.values) - 8} more" if len(asked.values) > 8 else first
    if asked.kind == "range":
        points = f", {asked.points} points" if asked.points else ""
        return f"{_ends(asked.start, asked.end)}{points}{', logarithmic' if asked.scale == 'log' else ''}"
    if asked.kind == "uniform":
        return f"uniform, {_ends(asked.lower, asked.upper)}"
    bounds = [f"{word} {end:g}" for word, end in (("from", asked.lower), ("to", asked.upper)) if end is not None]
    return ", ".join([f"normal, {asked.mean:g}{SPACE}±{SPACE}{asked.sd:g} (one standard deviation)", *bounds])


def _ends(low: float | None, high: float | None) -> str:
    return f"{low:g} to {high:g}"


def _sourced(sources: dict[str, str | None], index: int, given: Factor) -> str | Markup:
    """Where the numbers of a factor come from; what is assumed is marked."""
    above = f"factor[{index}]"
    fields = [type(given).model_fields[name].alias or name for name in given.model_fields_set]
    paths = (above, *(f"{above}.{key}" for key in fields))
    return marked("; ".join(dict.fromkeys(source for path in paths if (source := sources.get(path)))))


def marked(text: str) -> str | Markup:
    """A source as a cell, heavy where it says assumed; words for none."""
    if not text:
        return Markup("<strong>not stated</strong>")
    return Markup("<strong>{}</strong>").format(text) if is_assumed(text) else text


def _outputs(source: Source) -> Iterator[tuple[str, str, str, str]]:
    study = source.loaded.study
    for name in study.outputs:
        quantity = source.quantity(name)
        yield quantity.name, name, quantity.unit, "the model"
    for derived in study.output:
        quantity = source.quantity(derived.name)
        yield quantity.name, derived.name, quantity.unit, derived.expression


def _constraints(loaded: LoadedStudy) -> Markup:
    rows = [(one.said, one.value, one.expected) for one in loaded.study.constraint]
    if not rows:
        return Markup("<p>The study has no constraints.</p>")
    found = table(("constraint", "expression", "expected"), rows, caption="Constraints of the study")
    return Markup("<h3>Constraints</h3>\n") + found


def _counts(source: Source, status: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "asked for", thousands(status["designs"])
    yield "with an answer", thousands(status["ok"])
    if source.loaded.study.constraint:
        yield "of these, keep all constraints", thousands(int((source.table.ok & ~source.table.infeasible).sum()))
    yield "refused: cannot be made, or break a constraint on factors", thousands(status["refused"])
    yield "failed or out of time", thousands(status["failed"])
    yield "still open", thousands(status["open"])


def _reasons(reasons: dict[str, dict[str, int]]) -> Markup:
    """Why designs have no answer, the most frequent reasons of every status first."""
    rows = [(reason, state, n) for state, found in reasons.items() for reason, n in found.items()]
    if not rows:
        return Markup("")
    rows.sort(key=lambda row: -row[2])
    shown = [(reason, state, thousands(n)) for reason, state, n in rows[:REASONS]]
    if len(rows) > REASONS:
        left = sum(n for _, _, n in rows[REASONS:])
        shown.append((f"{len(rows) - REASONS} other reasons", "", thousands(left)))
    caption = "Why designs have no answer"
    return Markup("<h3>Designs without an answer</h3>\n") + table(
        ("reason", "status", "designs"), shown, caption=caption, numbers=1
    )


def number(value: float, after: str = "") -> Cell:
    """A number as a cell that sorts by its value."""
    return Cell(written(value) + after, float(value))


def heading(quantity: Quantity) -> str:
    """Name of a column of numbers with its unit."""
    return f"{quantity.name} in {quantity.unit}" if quantity.unit else quantity.name


def front_table(source: Source, figure: Figure, points: PointedDesigns) -> Markup:
    """The designs of a front that can be pointed at: both values and all factors."""
    factors = [column.name for column in source.loaded.columns]
    names = list(dict.fromkeys([figure.x or "", figure.y or "", *factors]))
    values = values_at(source, names, points.rows)
    numbers = source.table.design[points.rows].tolist()
    rows = [
        (Cell(str(design), design), *map(number, row)) for design, row in zip(numbers, values.tolist(), strict=True)
    ]
    headers = ("design", *(heading(source.quantity(name)) for name in names))
    return table(headers, rows, caption="Designs of the front", numbers=len(names))


def extremes_table(source: Source, figure: Figure, found: Extremes) -> Markup:
    """Where the value of a map is least and most."""
    names = (figure.value or "", figure.x or "", figure.y or "")
    headers = ("", *(heading(source.quantity(name)) for name in names))
    ends: Sequence[tuple[str, tuple[float, float, float]]] = (("least", found.least), ("most", found.most))
    rows: list[tuple[str | Cell, ...]] = [
        (word, *(number(float(cleared(source, name, one))) for name, one in zip(names, end, strict=True)))
        for word, end in ends
    ]
    return table(headers, rows, sortable=False, caption="Ends of the map", numbers=3)


def marks_table(source: Source, found: Marks) -> Markup:
    """Percentiles of every value with their intervals, and the base stage's value."""
    several = list(found.percentiles.values())
    percents = [f"{one.percent:g}{SPACE}%" for one in several[0]]
    rows = [
        (called.name, called.unit, *(_percentile(source, name, one) for one in marks), _nominal(source, name))
        for name, marks in found.percentiles.items()
        for called in [source.quantity(name)]
    ]
    headers = ("value", "unit", *percents, "base stage")
    return table(headers, rows, caption="Percentiles with 95 % confidence intervals", numbers=len(percents) + 1)


def _percentile(source: Source, name: str, one: Percentile) -> Cell:
    value, low, high = map(written, cleared(source, name, [one.value, one.low, one.high]).tolist())
    return Cell(f"{value} ({low} to {high})", float(one.value))


def _nominal(source: Source, name: str) -> Cell | str:
    return number(float(cleared(source, name, source.nominal[name]))) if name in source.nominal else "not known"


def shares_table(source: Source, found: Shares) -> Markup:
    """Sobol indices of every value by every factor, with half-widths of their confidence intervals."""
    total = any(indices.total is not None for indices in found.indices.values())
    headers = ("factor", "of the variance of", "first order: alone", *(("total: with its interactions",) * total))
    rows = list(_shares(source, found))
    return table(headers, rows, caption="Sobol indices with 95 % confidence", numbers=1 + total)


def _shares(source: Source, found: Shares) -> Iterator[tuple[str | Cell, ...]]:
    factors = [factor(column).name for column in source.loaded.columns]
    for name, indices in found.indices.items():
        pairs = [(indices.first, indices.first_band)]
        if indices.total is not None and indices.total_band is not None:
            pairs.append((indices.total, indices.total_band))
        for place, called in enumerate(factors):
            yield called, source.quantity(name).name, *(_share(value, band, place) for value, band in pairs)


def _share(value: Array, band: Array, place: int) -> Cell:
    return Cell(f"{value[place]:.3f}{SPACE}±{SPACE}{band[place]:.3f}", float(value[place]))


DESIGNS = "study-designs"  # id of the data that all charts of a page share


class Target(NamedTuple):
    """A design on a chart: its number, its place in points from the upper left, what is told of it."""

    design: int
    x: str
    y: str
    text: str


def pointed_html(
    source: Source, figure: Figure, record: StudyMap | ParetoFront, points: PointedDesigns, reach: int, name: str
) -> Markup:
    """A chart with its designs and an empty panel, which the script fills; `name` is its id, `reach` of all designs.

    Without scripts the chart is there, and what a place tells when it is pointed at.
    """
    drawn = chart_figure(record)
    svg = inline_svg(drawn, name=f"{name}-chart")
    title = record.caption.title
    bar = round_factor(0.8 * reach / PARTS)
    return markup(
        "pointed.html",
        name=name,
        svg=svg,
        width=CHART_WIDTH * POINTS,
        height=CHART_HEIGHT * POINTS,
        label=f"Designs of: {title}",
        targets=_targets(source, figure, drawn.axes[0], points),
        caption=f"{title}. {points.said} Point at one, tap it, or go from one to the next by the arrow keys.",
        description=f"{title}. {' '.join(record.caption.lines)}",
        reach=reach,
        bar=int(PARTS * bar),
        bar_text=f"{bar:g}{SPACE}{LENGTH}, as for all designs here",
    )


def _targets(source: Source, figure: Figure, axes: Axes, points: PointedDesigns) -> list[Target]:
    names = [name for name, _ in figure.columns.values()]
    quantities = [source.quantity(name) for name in names]
    values = values_at(source, names, points.rows)
    numbers = source.table.design[points.rows].tolist()
    told = [f"Design {number}: {_told(quantities, row)}" for number, row in zip(numbers, values, strict=True)]
    places = places_on(axes, points.at).tolist()
    return [
        Target(number, f"{x:.1f}", f"{y:.1f}", text)
        for number, (x, y), text in zip(numbers, places, told, strict=True)
        if np.isfinite(x)  # inside the axes
    ]


def _told(quantities: Sequence[Quantity], row: Array) -> str:
    return ", ".join(f"{one.name} {written(value)}{one.after}" for one, value in zip(quantities, row, strict=True))


def designs_data(columns: ShownColumns, designs: Sequence[DrawnDesign]) -> Markup:
    """The designs of all charts of a page, and what their numbers are, for the script."""
    named = [{"name": one.name, "unit": one.unit} for one in columns.quantities]
    told = {str(one.number): one.facts for one in designs}
    return json_data(DESIGNS, {"columns": named, "factors": columns.factors, "designs": told})


Part: TypeAlias = tuple[str, Callable[[], PageSection]]


@dataclass(frozen=True)
class FoundFigure:
    """A figure of a study file: its number on the page, what it shows, and the designs that can be pointed at."""

    place: int
    figure: Figure
    shown: Shown
    points: PointedDesigns | None

    @property
    def id(self) -> str:
        """Of its section; made of nothing that a file says."""
        return f"study-figure-{self.place}"


def study_parts(source: Source, found: dict[str, Shown], status: dict[str, Any]) -> list[Part]:
    """The sections of a study in order, each by a name and what makes it: drawing its figures takes a while.

    Parameters
    ----------
    source, found : as `studies.study_findings` gives them.   status : as `studies.study_status` does.
    """
    figures = _figures(source, list(found.values()))
    designs = drawn_designs(source, (row for one in figures if one.points for row in one.points.rows.tolist()))
    data, reach = designs_data(columns_shown(source), designs), farthest(designs)
    parts: list[Part] = [("what the study asks", partial(asked_section, source, status))]
    for one in figures:
        parts.append((f"figure {one.place}", partial(_figure_section, source, one, reach, data)))
        data = Markup("")  # once on a page
    return [*parts, ("sources", partial(_sources_section, source.loaded))]


def _figures(source: Source, found: list[Shown]) -> list[FoundFigure]:
    asked = [figure for _, figure in named(source.loaded)]
    most = most_of(sum(isinstance(shown, Best | Extremes) for shown in found))
    pairs = zip(asked, found, strict=True)
    return [
        FoundFigure(n, figure, shown, _points(source, figure, shown, most))
        for n, (figure, shown) in enumerate(pairs, 1)
    ]


def _points(source: Source, figure: Figure, shown: Shown, most: int) -> PointedDesigns | None:
    if isinstance(shown, Best):
        return of_front(source, figure, shown, most)
    return of_map(source, figure, shown.cells, most) if isinstance(shown, Extremes) else None


def _figure_section(source: Source, one: FoundFigure, reach: int, data: Markup) -> PageSection:
    """The section of a figure; `data` of the designs to point at, in the first of them."""
    look = {"script": file_text("study.js"), "style": file_text("study.css")}
    if isinstance(one.shown, Refused):
        title = one.figure.title or f"Figure {one.place}: {one.figure.kind}"
        html = notes([f"It is not drawn. {one.shown.reason}"])
        return PageSection(one.id, title, data + html, **look)
    record = record_of(source, one.figure, one.shown)
    said = notes(record.caption.lines if one.points is not None else (), "note")  # others have them in the figure
    parts = [data, _drawn_of_page(source, one, record, reach), said, *_numbers(source, one)]
    return PageSection(one.id, record.caption.title, Markup("\n").join(parts), **look)


def _drawn_of_page(source: Source, one: FoundFigure, record: Record, reach: int) -> Markup:
    name = f"{one.id}-chart"
    if one.points is not None and isinstance(record, StudyMap | ParetoFront):
        return pointed_html(source, one.figure, record, one.points, reach, name)
    title = record.caption.title
    drawn = PageFigure(inline_svg(page_of(record), name=f"{name}-svg"), title, " ".join(record.caption.lines))
    return figure_html(drawn, name)


def _numbers(source: Source, one: FoundFigure) -> Iterator[Markup]:
    """What a figure shows, as tables and sentences."""
    match one.shown:
        case Extremes():
            yield extremes_table(source, one.figure, one.shown)
        case Marks():
            yield marks_table(source, one.shown)
        case Shares():
            yield shares_table(source, one.shown)
        case Best(power=power, gain=gain, front=front):
            assert one.points is not None
            said = [*_said_of_front(source, one.figure, power, gain), *source.unbeaten(one.figure, front.places)]
            yield notes(said, "note")
            yield front_table(source, one.figure, one.points)


def _said_of_front(source: Source, figure: Figure, power: float | None, gain: float | None) -> Iterator[str]:
    x, y = (source.quantity(name or "").name for name in (figure.x, figure.y))
    if power is not None and np.isfinite(power):
        yield f"Along the front {y} goes as {x} to the power {significant(power, 3)} (least squares of logarithms)."
    if gain is not None:
        better = f"The best design no worse in {x} and no larger than the base stage"
        yield f"{better} has {significant(gain, 3)} times its {y}."


def _sources_section(loaded: LoadedStudy) -> PageSection:
    """Where the numbers come from that are assumed or of which no source is stated."""
    stage, study = loaded.stage.sources, loaded.study.sources
    rows = []
    for doubt in (*loaded.assumed, *loaded.not_stated):
        of, key = doubt.split(": ", 1)
        text = (stage if of == "stage" else study).get(key) or ""
        rows.append((key, of, marked(text)))
    html = (
        table(("number", "of the", "source"), rows, caption="Numbers that are assumed or without a source")
        if rows
        else Markup("<p>Every number of stage and study has a source, and none is assumed.</p>")
    )
    return PageSection("study-sources", "Where the numbers come from", html)
