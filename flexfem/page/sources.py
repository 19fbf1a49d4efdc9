"""The section on the sources of the numbers of a page, and what they are: assumed or not stated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from flexfem.files.provenance import counted, is_assumed
from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.section import PageSection, parts, section
from flexfem.results import TextTable

TITLE = "Sources of the numbers"
ASSUMED = "assumed"  # kinds of a key, as the table states them
NOT_STATED = "source not stated"
STATED = "stated"


class AssumedKeys(NamedTuple):
    """Keys of assumed numbers, and of those without a source."""

    assumed: list[str]
    not_stated: list[str]


def assumptions_of(records: Sequence[Any]) -> AssumedKeys:
    """Return the assumed keys of all records, and those without a source, each once."""
    assumed = [key for record in records for key in record.assumed]
    not_stated = [key for record in records for key in record.not_stated]
    return AssumedKeys(list(dict.fromkeys(assumed)), list(dict.fromkeys(not_stated)))


def rows_of_file(mechanism: Mechanism, keys: AssumedKeys) -> list[list[str]]:
    """Return rows of key, kind and source for all values of a file, those assumed first."""
    values = mechanism.values
    sources = {key: text for key, text in mechanism.sources.items() if text and key in values}
    said = [key for key, text in sources.items() if is_assumed(text)]
    assumed = list(dict.fromkeys([*keys.assumed, *said]))
    rows = [[key, ASSUMED, sources.get(key, "not a number of the file")] for key in assumed]
    rows += [[key, NOT_STATED, "no source in the file"] for key in keys.not_stated]
    doubtful = {*assumed, *keys.not_stated}
    return rows + [[key, STATED, text] for key, text in sources.items() if key not in doubtful]


def sources_section(rows: Sequence[Sequence[str]], last: str) -> PageSection:
    """Return the table of rows of a key, its kind, and its source or records.

    last : heading of the last column.
    """
    tag = Markup('<span class="tag">{}</span>')
    marked = [[key, kind if kind == STATED else tag.format(kind), text] for key, kind, text in rows]
    assumed = sum(kind == ASSUMED for _, kind, _ in rows)
    not_stated = sum(kind == NOT_STATED for _, kind, _ in rows)
    counts = (
        counted(assumed, "of these numbers is", "of these numbers are"),
        counted(not_stated, "has", "have"),
    )
    listed = TextTable(["key of the file", "kind", last], marked, 3)
    return section("provenance", TITLE, parts.sources(listed, *counts))
