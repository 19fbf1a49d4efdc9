"""The sections of a page on a study: what it asks, how many designs have an answer, its figures with their numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeAlias

from markupsafe import Markup

from flexfem.files.provenance import is_assumed
from flexfem.page.section import PageSection, facts, notes, shown_figure, table
from flexfem.plot.study import page_of
from flexfem.plot.text import significant
from flexfem.results import SPACE, TextTable, thousands
from flexfem.study.factors import Column, Factor, columns_of
from flexfem.study.findings import Record, Refused, Source, factor, model_words, sampling_words
from flexfem.study.loaded import LoadedStudy

DIGITS = 5
ROWS = 400  # of a table; more are in the JSON of flexfem study plot
Part: TypeAlias = tuple[str, Callable[[], PageSection]]  # a name, and what makes the section


def study_parts(source: Source, found: dict[str, Record | Refused], status: dict[str, Any]) -> list[Part]:
    """The sections of a study in order, each by a name and what makes it: drawing its figures takes a while.

    Parameters
    ----------
    source, found : as `studies.study_findings` gives them.   status : as `studies.study_status` does.
    """
    parts: list[Part] = [("what the study asks", partial(setup_section, source, status))]
    for n, shown in enumerate(found.values(), 1):
        title = source.loaded.study.figure[n - 1].title or f"Figure {n}"
        parts.append((f"figure {n}", partial(_figure_section, f"study-figure-{n}", title, shown)))
    return parts


def _figure_section(name: str, title: str, shown: Record | Refused) -> PageSection:
    if isinstance(shown, Refused):
        return PageSection(name, title, notes([f"It is not drawn. {shown.reason}"]))
    title, found = shown.caption.title, shown.table
    rows = [[each if isinstance(each, str) else written(each) for each in row] for row in found.rows[:ROWS]]
    more = f", the first {ROWS} of {thousands(len(found.rows))}" if len(found.rows) > ROWS else ""
    names = sum(isinstance(value, str) for value in found.rows[0])
    data = table(TextTable([*found.head.values()], rows, names, found.caption + more))
    return PageSection(name, title, shown_figure(f"{name}-chart", partial(page_of, shown), title, data))


def written(value: float) -> str:
    """A number in five digits, "" where it is not known."""
    return significant(value, DIGITS) if math.isfinite(value) else "none" if math.isinf(value) else ""


def setup_section(source: Source, status: dict[str, Any]) -> PageSection:
    """What was asked, and how many designs have an answer; `status` as `studies.study_status` gives it."""
    loaded, study = source.loaded, source.loaded.study
    found_by = dict.fromkeys(study.outputs, "the model") | {one.name: one.expression for one in study.output}
    quantities = {name: source.quantity(name) for name in found_by}
    outputs = [[of.name, name, of.unit, found_by[name]] for name, of in quantities.items()]
    limits = [[one.title, one.value, one.expected] for one in study.constraint]
    counts = {
        "asked for": status["designs"],
        "with an answer": status["ok"],
        "of these, keep all constraints": int(source.table.kept.sum()),
        "refused: cannot be made, or break a constraint on factors": status["refused"],
        "failed or out of time": status["failed"],
        "still open": status["open"],
    }
    reasons = [(text, state, n) for state, found in status["reasons"].items() for text, n in found.items()]
    reasons.sort(key=lambda row: -row[2])
    tables = [
        TextTable(["factor", "keys", "unit", "values", "source"], [*_factors(loaded)], 5, "Factors"),
        TextTable(["output", "column", "unit", "found by"], outputs, 4, "Outputs"),
        TextTable(["constraint", "expression", "expected"], limits, 3, "Constraints"),
        TextTable(["designs", "number"], [[name, thousands(n)] for name, n in counts.items()], 1, "Designs"),
        TextTable(["reason", "status", "designs"], [[text, state, thousands(n)] for text, state, n in reasons], 2,
                  "Designs without an answer"),
    ]  # fmt: skip
    html = [facts(_settings_of(loaded)), notes(status["warnings"]), *map(table, tables)]
    return PageSection("study-asked", "What the study asks", Markup("\n").join(html))


def _settings_of(loaded: LoadedStudy) -> Iterator[tuple[str, str]]:
    study, pairs = loaded.study, len(loaded.study.correlation)
    yield "study", f"{study.name} ({loaded.path.name})"
    yield "base stage", f"{loaded.stage.name} ({study.stage})"
    yield "model", model_words(loaded)
    correlated = f", {pairs} rank correlations" if pairs else ""
    yield "sample", f"{sampling_words(loaded)}, {thousands(loaded.count)} designs{correlated}"
    yield "accuracy of stresses", loaded.stress_accuracy
    for name in ("drive", "frequencies", "life", "drift"):
        asked = getattr(study, name)
        if asked is not None:
            given = asked.model_dump(exclude_unset=True)
            yield name, ", ".join(f"{key} = {value}" for key, value in given.items()) or "asked"
    yield "hash of its inputs", loaded.hash


def _factors(loaded: LoadedStudy) -> Iterator[list[str]]:
    columns = {column.name: column for column in loaded.columns}  # with their means filled in
    for index, given in enumerate(loaded.study.factor):
        source = _sourced(loaded.study.sources, index, given)
        for column in columns_of([given]):
            known = factor(columns[column.name])
            yield [known.name, ", ".join(column.keys), known.unit, range_of(columns[column.name]), source]


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
        return f"{asked.start:g} to {asked.end:g}{points}{', logarithmic' if asked.scale == 'log' else ''}"
    if asked.kind == "uniform":
        return f"uniform, {asked.lower:g} to {asked.upper:g}"
    bounds = [f"{word} {end:g}" for word, end in (("from", asked.lower), ("to", asked.upper)) if end is not None]
    return ", ".join([f"normal, {asked.mean:g}{SPACE}±{SPACE}{asked.sd:g} (one standard deviation)", *bounds])


def _sourced(sources: dict[str, str | None], index: int, given: Factor) -> str:
    """Where the numbers of a factor come from; heavy where it is assumed or not stated."""
    fields = [type(given).model_fields[name].alias or name for name in given.model_fields_set]
    paths = (f"factor[{index}]", *(f"factor[{index}].{key}" for key in fields))
    text = "; ".join(dict.fromkeys(source for path in paths if (source := sources.get(path))))
    heavy = Markup("<strong>{}</strong>").format
    return heavy("not stated") if not text else heavy(text) if is_assumed(text) else text
