"""Tables of the keys of input files, with their values in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from flexfem.files.quantities import UNIT
from flexfem.files.refusals import as_toml
from flexfem.schemas.formats import FORMATS
from flexfem.schemas.of_files import EXPRESSIONS, NUMBERS, schema_of
from flexfem.units import short

WORDS = {
    "string": "text",
    "number": "number",
    "integer": "integer",
    "boolean": "true or false",
    "object": "table",
}
LISTED = 12  # values of an enumeration that are listed; of longer ones three are
UNIT_WORDS = {"1": "", "of the key": "unit of the key"}


class KeyRow(NamedTuple):
    """One key: the values it may have as text, default and example in TOML, "" where there is none."""

    key: str
    needed: bool
    unit: str
    value: str
    default: str
    example: str
    meaning: str


class KeyTable(NamedTuple):
    """A table of a file: its name, "" for the top level, and whether it is an array of tables."""

    name: str
    array: bool
    about: str
    rows: list[KeyRow]

    @property
    def header(self) -> str:
        """The header in TOML."""
        return f"[[{self.name}]]" if self.array else f"[{self.name}]"


def tables_of(name: str) -> list[KeyTable]:
    """Return the tables of an input file, outer tables first. Raises BadInput for an unknown one."""
    of = schema_of(name, False)
    tables = FORMATS[name].tables
    if tables:
        return list(_tables(of["additionalProperties"], f"name of the {tables}", False))
    return list(_tables(of, "", False))


def _tables(
    of: dict[str, Any],
    name: str,
    array: bool,
) -> Iterator[KeyTable]:
    """Yield a table and the tables in it."""
    inner = list[tuple[str, dict[str, Any], bool]]()
    rows = list[KeyRow]()
    for key, value in of.get("properties", {}).items():
        if "properties" in value:
            inner.append((key, value, False))
        elif "properties" in value.get("items", {}):
            inner.append((key, value["items"] | {"description": value["description"]}, True))
        else:
            rows.append(_row(key, value, key in of.get("required", [])))
    yield KeyTable(name, array, of.get("description", ""), rows)
    for key, value, many in inner:
        yield from _tables(value, f"{name}.{key}" if name else key, many)


def _row(
    key: str,
    value: dict[str, Any],
    needed: bool,
) -> KeyRow:
    """Return the row of a key with a schema."""
    number = value
    while "items" in number:
        number = number["items"]
    unit = number.get(UNIT, "")
    return KeyRow(
        key=key,
        needed=needed,
        unit=UNIT_WORDS.get(unit, unit),
        value=_in_words(value),
        default=as_toml(value["default"]) if "default" in value else "",
        example=as_toml(example_of(value)),
        meaning=value["description"],
    )


def example_of(of: dict[str, Any]) -> Any:
    """Return a valid value of a key: an example, its default, or the first one of its enumeration."""
    if of.get("examples"):
        return of["examples"][0]
    return of.get("default", of.get("enum", [True])[0])


def _in_words(of: dict[str, Any]) -> str:
    """Return the valid values of a key as text."""
    kind = of.get("type")
    if "enum" in of:
        return _choices(of["enum"])
    if kind == EXPRESSIONS:
        return f"{_in_words(of | {'type': 'number'})} or expression"
    if kind == "array":
        return f"array of{_count(of)}: {_in_words(of['items'])}"
    if kind == "object":
        if of["additionalProperties"]["type"] == EXPRESSIONS:
            return "number or expression for each name"
        return "text for each key path in quotes"
    if kind in NUMBERS:
        return ", ".join(filter(None, [WORDS[kind], _limits(of)]))
    return "key path of a stage file" if "anyOf" in of else WORDS[of["type"]]


def _choices(values: list[Any]) -> str:
    texts = [as_toml(each) for each in values]
    if len(texts) > LISTED:
        return f"one of {len(texts)}, such as {', '.join(texts[:3])}"
    if len(texts) == 1:
        return texts[0]
    return f"{', '.join(texts[:-1])} or {texts[-1]}"


def _count(of: dict[str, Any]) -> str:
    """Return the number of members of an array, "" where any number is valid."""
    least = of.get("minItems", 0)
    most = of.get("maxItems")
    if most:
        return f" {least}" if least == most else f" {least} to {most}"
    return f" {least} or more" if least else ""


def _limits(of: dict[str, Any]) -> str:
    """Return the limits of a number as text."""
    choices = of.get("anyOf", [])
    low = next((each["minimum"] for each in choices if "minimum" in each), of.get("minimum"))
    above = of.get("exclusiveMinimum") if low is None else None
    ends = {
        "from": low,
        "above": above,
        "up to": of.get("maximum"),
        "below": of.get("exclusiveMaximum"),
    }
    said = [f"{word} {short(limit)}" for word, limit in ends.items() if limit is not None]
    zero = "0, or " if {"const": 0} in choices else ""
    return zero + " ".join(said)
