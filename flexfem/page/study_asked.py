"""What a study asked, on a page: its stage, model and sample, factors, outputs and constraints, and what came of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from flexfem.files.provenance import is_assumed
from flexfem.page.section import PageSection, facts, notes, table
from flexfem.plot.study_labels import METHODS, factor, model_words, thousands
from flexfem.plot.text import SPACE
from flexfem.study.factors import Column, columns_of

if TYPE_CHECKING:
    from flexfem.plot.study_records import Source
    from flexfem.study.factors import Factor
    from flexfem.study.loaded import LoadedStudy

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
    yield "sample", f"{METHODS[study.sampling.method]}, {thousands(loaded.count)} designs{_drawn(loaded)}"
    yield "accuracy of stresses", loaded.stress_accuracy
    for name in ("drive", "frequencies", "life", "drift"):
        asked = getattr(study, name)
        if asked is not None:
            given = asked.model_dump(exclude_unset=True)
            yield name, ", ".join(f"{key} = {value}" for key, value in given.items()) or "asked"
    yield "hash of its inputs", loaded.hash


def _drawn(loaded: LoadedStudy) -> str:
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
