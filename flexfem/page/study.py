"""The sections of a page on a study: its settings, counts of its designs, and its figures with their numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem.files.provenance import is_assumed
from flexfem.page.section import PageSection, facts, folded, notes, shown_figure, table
from flexfem.plot.study import page_of
from flexfem.plot.text import significant
from flexfem.results import SPACE, TextTable, thousands
from flexfem.study.factors import Column, Factor, columns_of
from flexfem.study.findings import (
    ParetoFront,
    Record,
    Refused,
    Source,
    factor,
    model_words,
    sampling_words,
)
from flexfem.study.loaded import LoadedStudy

DIGITS = 5
TEN = 10  # designs of a front that are listed at once
ROWS = 400  # of a table; the JSON of flexfem study plot holds all
Part: TypeAlias = tuple[str, Callable[[], PageSection]]  # a name, and the function that makes the section


def study_parts(source: Source, found: dict[str, Record | Refused], status: dict[str, Any]) -> list[Part]:
    """Return the sections of a study in order as functions, since drawing the figures takes a while.

    Parameters
    ----------
    source, found : from `studies.study_findings`.   status : from `studies.study_status`.
    """
    parts = list[Part]()
    for n, shown in enumerate(found.values(), 1):
        title = source.loaded.study.figure[n - 1].title or f"Figure {n}"
        parts.append((f"figure {n}", partial(_figure_section, f"study-figure-{n}", title, shown)))
    return [*parts, ("settings of the study", partial(setup_section, source, status))]


def _figure_section(name: str, title: str, shown: Record | Refused) -> PageSection:
    if isinstance(shown, Refused):
        return PageSection(name, title, notes([f"This figure is not drawn: {shown.reason}"]))
    title, numbers = shown.caption.title, shown.table
    rows = [[cell if isinstance(cell, str) else formatted(cell) for cell in row] for row in numbers.rows[:ROWS]]
    limit = f", the first {ROWS} of {thousands(len(numbers.rows))}" if len(numbers.rows) > ROWS else ""
    names = sum(isinstance(value, str) for value in numbers.rows[0])
    head, data = [*numbers.head.values()], Markup("")
    if isinstance(shown, ParetoFront) and len(rows) > TEN:
        kept = [rows[k] for k in np.linspace(0, len(rows) - 1, TEN).round().astype(int)]
        data = table(TextTable(head, kept, names, "Ten designs of the front, from one end to the other"))
    whole = table(TextTable(head, rows, names, numbers.caption + limit))
    listed = folded("All designs of the front" if data else "Numbers of this figure", whole)
    return PageSection(name, title, shown_figure(f"{name}-chart", partial(page_of, shown), title) + data + listed)


def formatted(value: float) -> str:
    """Return a number in five digits, "none" if infinite, "" if unknown."""
    return significant(value, DIGITS) if math.isfinite(value) else "none" if math.isinf(value) else ""


def setup_section(source: Source, status: dict[str, Any]) -> PageSection:
    """Return the settings of a study and the counts of its designs; `status` is from `studies.study_status`."""
    loaded, study = source.loaded, source.loaded.study
    methods = dict.fromkeys(study.outputs, "the model") | {output.name: output.expression for output in study.output}
    quantities = {name: source.quantity(name) for name in methods}
    outputs = [[quantity.name, name, quantity.unit, methods[name]] for name, quantity in quantities.items()]
    limits = [[limit.title, limit.value, limit.expected] for limit in study.constraint]
    counts = {
        "requested": status["designs"],
        "with a result": status["ok"],
        "of these, satisfy all constraints": int(source.table.kept.sum()),
        "refused: impossible, or violate a constraint on factors": status["refused"],
        "failed or out of time": status["failed"],
        "open": status["open"],
    }
    reasons = [(text, state, n) for state, numbers in status["reasons"].items() for text, n in numbers.items()]
    reasons.sort(key=lambda row: -row[2])
    tables = [
        TextTable(["factor", "keys", "unit", "values", "source"], [*_factors(loaded)], 5, "Factors"),
        TextTable(["output", "column", "unit", "computed by"], outputs, 4, "Outputs"),
        TextTable(["constraint", "expression", "expected"], limits, 3, "Constraints"),
        TextTable(["designs", "number"], [[name, thousands(n)] for name, n in counts.items()], 1, "Designs"),
        TextTable(["reason", "status", "designs"], [[text, state, thousands(n)] for text, state, n in reasons], 2,
                  "Designs without a result"),
    ]  # fmt: skip
    html = [facts(_settings_of(loaded)), notes(status["warnings"]), *map(table, tables)]
    return PageSection("study-asked", "Settings of the study", Markup("\n").join(html))


def _settings_of(loaded: LoadedStudy) -> Iterator[tuple[str, str]]:
    study, pairs = loaded.study, len(loaded.study.correlation)
    yield "study", f"{study.name} ({loaded.path.name})"
    yield "base stage", f"{loaded.base.name} ({study.stage})"
    yield "model", model_words(loaded)
    correlated = f", {pairs} rank correlations" if pairs else ""
    yield "sample", f"{sampling_words(loaded)}, {thousands(loaded.count)} designs{correlated}"
    yield "accuracy of stresses", loaded.stress_accuracy
    for name in ("drive", "frequencies", "life", "drift"):
        section = getattr(study, name)
        if section is not None:
            settings = section.model_dump(exclude_unset=True)
            yield name, ", ".join(f"{key} = {value}" for key, value in settings.items()) or "requested"
    yield "hash of the inputs", loaded.hash


def _factors(loaded: LoadedStudy) -> Iterator[list[str]]:
    columns = {column.name: column for column in loaded.columns}  # with the means of the base stage
    for index, given in enumerate(loaded.study.factor):
        source = _source_of(loaded.study.sources, index, given)
        for column in columns_of([given]):
            quantity = factor(columns[column.name])
            yield [quantity.name, ", ".join(column.keys), quantity.unit, range_of(columns[column.name]), source]


def range_of(column: Column) -> str:
    """Return the values of a factor as text, in the unit of its column."""
    given = column.factor
    if given.kind == "given":
        return "from the table of designs"
    if given.values is not None:
        first = ", ".join(f"{value:g}" for value in given.values[:8])
        return f"{first} and {len(given.values) - 8} more" if len(given.values) > 8 else first
    if given.kind == "range":
        points = f", {given.points} points" if given.points else ""
        return f"{given.start:g} to {given.end:g}{points}{', logarithmic' if given.scale == 'log' else ''}"
    if given.kind == "uniform":
        return f"uniform, {given.lower:g} to {given.upper:g}"
    bounds = [f"{word} {end:g}" for word, end in (("from", given.lower), ("to", given.upper)) if end is not None]
    return ", ".join([f"normal, {given.mean:g}{SPACE}±{SPACE}{given.sd:g} (one standard deviation)", *bounds])


def _source_of(sources: dict[str, str | None], index: int, given: Factor) -> str:
    """Return the sources of the numbers of a factor, in bold if assumed or not stated."""
    fields = [f.alias or name for name, f in type(given).model_fields.items() if name in given.model_fields_set]
    paths = (f"factor[{index}]", *(f"factor[{index}].{key}" for key in fields))
    text = "; ".join(dict.fromkeys(source for path in paths if (source := sources.get(path))))
    bold = Markup("<strong>{}</strong>").format
    return bold("not stated") if not text else bold(text) if is_assumed(text) else text
