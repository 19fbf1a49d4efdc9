"""Named tuples as texts and tables, where a report is no `Result`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import shorten
from typing import Any

from flexfem.results.render import TextTable
from flexfem.units import in_words, short, unit_of, without_unit

LONG = 40  # characters of a list item that has a line of its own
MOST_COLUMNS = 8  # of a table of records; a wider one has a column for each record
NOT_SHOWN = ("warnings", "assumed", "not_stated")  # said below the tables


class Ends(tuple[float, float]):
    """Both ends of a range, printed as "0.1 to 2"."""

    def __str__(self) -> str:
        return " to ".join(short(end) for end in self)


def record_parts(record: Any, plain: bool = True) -> tuple[list[tuple[str, str]], list[TextTable]]:
    """Return the fields of a named tuple as texts by name, and its lists of named tuples as tables.

    Texts contain the units that the field names end in. Keys with equal texts are merged.
    Assumptions are omitted.
    """
    facts = list[tuple[str, str]]()
    tables = list[TextTable]()
    for name, value in record._asdict().items():
        title = in_words(name)
        if name in NOT_SHOWN or value in (None, "", [], {}, False):
            continue
        if hasattr(value, "_fields"):
            inner, more = record_parts(value, plain)
            for inside, text in inner:
                facts.append((f"{title} {inside}" if inside in value._fields else inside, text))
            tables += more
        elif isinstance(value, list) and hasattr(value[0], "_fields"):
            tables.append(_table_of_records(title, value, plain))
        elif name == "provenance":
            facts.append(("sources", "\n" + "\n".join(_sources(value))))
        elif isinstance(value, dict):
            facts += _facts_of_mapping(value, plain)
        elif isinstance(value, list) and any(len(str(each)) > LONG for each in value):
            facts.append((title, "\n" + "\n".join(map(str, value))))
        else:
            facts.append((title, _text(value, unit_of(name).label(plain))))
    return facts, tables


def _facts_of_mapping(mapping: Mapping[str, Any], plain: bool) -> list[tuple[str, str]]:
    """Return the texts of values by their keys; keys of equal texts are listed together."""
    keys = dict[str, list[str]]()
    for key, value in mapping.items():
        title = key if isinstance(value, str) else without_unit(key)
        keys.setdefault(_text(value, unit_of(key).label(plain)), []).append(title)
    return [(", ".join(dict.fromkeys(titles)), text) for text, titles in keys.items()]


def _sources(provenance: Mapping[str, str]) -> list[str]:
    """Return a line for each kind of source with its keys.

    The kind is the text before the first punctuation mark.
    """
    kinds = dict[str, list[str]]()
    for key, source in provenance.items():
        kind = re.split("[:;,]", source, maxsplit=1)[0].strip()
        kinds.setdefault(kind, []).append(key)
    return [
        shorten(f"{kind} ({len(keys)}): {', '.join(keys)}", 80, placeholder=" ...")
        for kind, keys in kinds.items()
    ]


def _table_of_records(
    title: str,
    records: Sequence[Any],
    plain: bool,
) -> TextTable:
    """Return a table with a row for each named tuple, or a column where it would be too wide."""
    head = list[str]()
    for name in records[0]._fields:
        unit = unit_of(name).label(plain)
        text = in_words(name)
        head.append(f"{text} ({unit})" if unit else text)
    rows = [["" if part is None else _text(part) for part in one] for one in records]
    if len(head) > MOST_COLUMNS:
        head, *rows = map(list, zip(head, *rows, strict=True))
        return TextTable(head, rows, len(head), title)
    return TextTable(head, rows, sum(isinstance(part, int | str) for part in records[0][:2]), title)


def _text(
    value: Any,
    unit: str = "",
    digits: int = 8,
) -> str:
    """Return a value as text; the numbers of a list have six digits at most."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        stated = {key: each for key, each in value.items() if each is not None}
        texts = (
            f"{in_words(key)} {_text(each, unit_of(key).plain)}" for key, each in stated.items()
        )
        return "; ".join(texts)
    if isinstance(value, list | tuple) and not isinstance(value, Ends):
        between = "; " if value and isinstance(value[0], list | tuple) else ", "
        return f"{between.join(_text(each, digits=6) for each in value)} {unit}".rstrip()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{round(value, 12) + 0.0:.{digits}g} {unit}".rstrip()
    return str(value)
