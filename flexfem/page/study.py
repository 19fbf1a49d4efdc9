"""The sections of a page on a study: its settings, counts of its designs, and its figures with
their numbers.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from flexfem import studies
from flexfem.files.refusals import place_of
from flexfem.page.section import PageSection, Part, facts, folded, notes, shown_figure, table
from flexfem.page.sources import ASSUMED, NOT_STATED, sources_section
from flexfem.page.subject import Subject
from flexfem.plot.study import page_of
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.results import TextTable, thousands
from flexfem.study import names, records
from flexfem.study.factors import Factor
from flexfem.study.listing import left_out, tables_of_designs
from flexfem.study.loaded import LoadedStudy
from flexfem.study.source import Source
from flexfem.study.tables import limits_text

DIGITS = 5
TEN = 10  # designs of a front that are listed at once
ROWS = 400  # of a table; the JSON of flexfem study plot holds all


def study_subject(path: Path, folder: Path) -> Subject:
    """Return the subject of the page of a study. Raises BadInput for one that is not complete."""
    parts_on_disk = studies.parts_of(path, folder)
    status = studies.status_facts(parts_on_disk)
    if status["open"]:
        raise BadInput(
            f"{place_of(path)}: {status['open']} of {status['designs']} designs are unfinished in "
            f"{place_of(status['folder'])}. Run `flexfem study run`"
        )
    found = studies.findings_of(parts_on_disk)
    loaded = found.source.loaded
    texts = {f"stage: {key}": text for key, text in loaded.base.sources.items()}
    texts |= {f"study: {key}": text for key, text in loaded.study.sources.items()}
    rows = [[key, ASSUMED, texts.get(key) or ""] for key in status["assumed"]]
    rows += [[key, NOT_STATED, texts.get(key) or ""] for key in status["not_stated"]]
    made = study_parts(found.source, found.found, status, found.table.path)
    made.append(("sources", partial(sources_section, rows, "source")))
    return Subject(loaded.study.name, "Study", status["assumed"], status["not_stated"], made)


def study_parts(
    source: Source,
    found: dict[str, records.Record | records.Refused],
    status: dict[str, Any],
    stored: Path,
) -> list[Part]:
    """Return the sections of a study in order as functions, since drawing the figures takes a
    while.

    Parameters
    ----------
    source, found : from `studies.study_findings`.   status : from `studies.study_status`.
    stored : the file with the table of all designs.
    """
    parts = list[Part]()
    for n, shown in enumerate(found.values(), 1):
        title = f"Figure {n}"
        if n <= len(source.loaded.study.figure):
            title = source.loaded.study.figure[n - 1].title or title
        parts.append((f"figure {n}", partial(_figure_section, f"study-figure-{n}", title, shown)))
    parts.append(("designs", partial(designs_section, source, stored)))
    return [*parts, ("settings of the study", partial(setup_section, source, status))]


def _figure_section(
    name: str,
    title: str,
    shown: records.Record | records.Refused,
) -> PageSection:
    if isinstance(shown, records.Refused):
        return PageSection(name, title, notes([f"This figure is not drawn: {shown.reason}"]))
    title = shown.caption.title
    numbers = shown.table
    rows = [
        [cell if isinstance(cell, str) else formatted(cell) for cell in row]
        for row in numbers.rows[:ROWS]
    ]
    limit = (
        f", the first {ROWS} of {thousands(len(numbers.rows))}" if len(numbers.rows) > ROWS else ""
    )
    names = sum(isinstance(value, str) for value in numbers.rows[0])
    head = [*numbers.head.values()]
    data = Markup("")
    if isinstance(shown, records.ParetoFront) and len(rows) > TEN:
        kept = [rows[k] for k in np.linspace(0, len(rows) - 1, TEN).round().astype(int)]
        data = table(
            TextTable(head, kept, names, "Ten designs of the front, from one end to the other")
        )
    whole = table(TextTable(head, rows, names, numbers.caption + limit))
    listed = folded("All designs of the front" if data else "Numbers of this figure", whole)
    return PageSection(
        name, title, shown_figure(f"{name}-chart", partial(page_of, shown), title) + data + listed
    )


def designs_section(source: Source, stored: Path) -> PageSection:
    """Return the designs with the numbers asked, and where the table of all is stored."""
    tables = [table(each) for each in tables_of_designs(source)]
    note = notes([left_out(source, stored)], "note")
    return PageSection("study-designs", "Designs", Markup("").join([*tables, note]))


def formatted(value: float) -> str:
    """Return a number in five digits, "none" if infinite, "" if unknown."""
    return (
        significant(value, DIGITS) if math.isfinite(value) else "none" if math.isinf(value) else ""
    )


def setup_section(source: Source, status: dict[str, Any]) -> PageSection:
    """Return the settings of a study and the counts of its designs; `status` is from
    `studies.study_status`.
    """
    loaded = source.loaded
    study = source.loaded.study
    counts = {
        "requested": status["designs"],
        "with a result": status["ok"],
        "that satisfy all constraints": int(source.table.kept.sum()),
        "refused: impossible, or violate a constraint on factors": status["refused"],
        "failed or out of time": status["failed"],
        "unfinished": status["open"],
    }
    settings = {
        "study": f"{study.name} ({loaded.path.name})",
        f"base {loaded.base.kind.removesuffix(' file')}": f"{loaded.base.name} ({study.mechanism})",
        "model": names.model_words(loaded),
        "sample": f"{names.sampling_words(loaded)}, {thousands(loaded.count)} designs",
        "designs": names.counted(counts),
        "accuracy of stresses": loaded.stress_accuracy,
        "hash of the inputs": loaded.hash,
    }
    reasons = [
        (text, state, n)
        for state, numbers in status["reasons"].items()
        for text, n in numbers.items()
    ]
    reasons.sort(key=lambda row: -row[2])
    rows = [[text, state, thousands(n)] for text, state, n in reasons]
    file = Markup('<pre tabindex="0"><code>{}</code></pre>').format(
        loaded.path.read_text(encoding="utf-8")
    )
    html = [
        facts(settings.items()),
        notes(status["warnings"]),
        table(TextTable(["reason", "status", "designs"], rows, 2, "Designs without a result")),
        factor_table(loaded),
        output_table(loaded),
        constraint_table(source),
        folded("Study file and the sources of its numbers", file),
    ]
    return PageSection("study-asked", "Settings of the study", Markup("\n").join(html))


def factor_table(loaded: LoadedStudy) -> Markup:
    """Return the factors of a study with their values or distributions."""
    rows = list[list[str]]()
    for column in loaded.columns:
        axis = names.axis_of(loaded, column.name)
        rows.append([axis.name, ", ".join(column.keys), axis.unit, spread_words(column.factor)])
    return Markup(table(TextTable(["factor", "keys", "unit", "values"], rows, 4, "Factors")))


def spread_words(factor: Factor) -> str:
    """Return the values of a factor in words."""
    match factor.kind:
        case "given":
            return "column of the table of designs"
        case "values":
            return ", ".join(f"{value:g}" for value in factor.values or ())
        case "normal":
            limits = limits_text(factor.lower, factor.upper)
            return (
                f"normal, mean {factor.mean:g}, standard deviation "
                f"{factor.sd:g}{f', {limits}' if limits else ''}"
            )
        case "uniform":
            return f"uniform from {factor.lower:g} to {factor.upper:g}"
    points = f", {factor.points} points" if factor.points else ""
    return (
        f"from {factor.start:g} to "
        f"{factor.end:g}{points}{', logarithmic' if factor.scale == 'log' else ''}"
    )


def output_table(loaded: LoadedStudy) -> Markup:
    """Return the outputs of a study, with the expressions of derived ones."""
    derived = {output.name: output.expression for output in loaded.study.output}
    rows = list[list[str]]()
    for name in (*loaded.outputs, *derived):
        axis = names.axis_of(loaded, name)
        rows.append([axis.name, name, axis.unit, derived.get(name, "")])
    return Markup(table(TextTable(["output", "column", "unit", "expression"], rows, 4, "Outputs")))


def constraint_table(source: Source) -> Markup:
    """Return the constraints of a study; the table is empty in a study without any."""
    rows = [[each.title, each.value, each.expected] for each in source.loaded.study.constraint]
    return Markup(table(TextTable(["constraint", "expression", "limits"], rows, 3, "Constraints")))
