"""TOML text of a file's content, every number written so that it reads back bit for bit."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any


def toml_text(content: Mapping[str, Any]) -> str:
    """The text of nested tables: numbers, texts, truths, arrays of them, tables, and arrays of tables."""
    return "\n".join(_lines(content, "")).strip() + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    tables = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    arrays = {key: value for key, value in table.items() if _is_array_of_tables(value)}
    for key, value in table.items():
        if key not in tables and key not in arrays:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in tables.items():
        if not all(isinstance(inner, Mapping) for inner in value.values()) or not value:
            yield f"\n[{path}{_key(key)}]"
        yield from _lines(value, f"{path}{_key(key)}.")
    for key, values in arrays.items():
        for value in values:
            yield f"\n[[{path}{_key(key)}]]"
            yield from _lines(value, f"{path}{_key(key)}.")


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)
