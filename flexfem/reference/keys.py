"""The keys of a format table by table: unit, what it may be, default, example, meaning, from its JSON schema."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from flexfem.files.quantities import UNIT
from flexfem.reference.formats import format_of
from flexfem.reference.schemas import NUMBERS, schema_of

Schema = dict[str, Any]
WORDS = {"string": "text", "number": "number", "integer": "integer", "boolean": "true or false", "object": "table"}
LISTED = 12  # values of an enumeration; of more a few are named
UNNAMED = "unit of the key"


class KeyRow(NamedTuple):
    """One key: its value as a sentence, `default` and `example` as TOML writes them, "" where there is none."""

    key: str
    needed: bool
    unit: str
    value: str
    default: str
    example: str
    meaning: str


class KeyTable(NamedTuple):
    """A table of a file by its header, "" for the top of the file; `array`: one of as many as wanted."""

    name: str
    array: bool
    about: str
    rows: list[KeyRow]

    @property
    def header(self) -> str:
        """As TOML writes it."""
        return f"[[{self.name}]]" if self.array else f"[{self.name}]"


def tables_of(name: str) -> list[KeyTable]:
    """The tables of a format, each before those inside it. Raises BadInput when there is no such format."""
    schema, named = schema_of(name), format_of(name).named
    if named is not None:
        return list(_tables(schema["additionalProperties"], f"name of the {named}", False))
    return list(_tables(schema, "", False))


def _tables(schema: Schema, name: str, array: bool) -> Iterator[KeyTable]:
    inner: list[tuple[str, Schema, bool]] = []
    rows = []
    for key, value in schema.get("properties", {}).items():
        if "properties" in value:
            inner.append((key, value, False))
        elif "properties" in value.get("items", {}):
            inner.append((key, value["items"] | {"description": value["description"]}, True))
        else:
            rows.append(_row(key, value, key in schema.get("required", [])))
    yield KeyTable(name, array, schema.get("description", ""), rows)
    for key, value, many in inner:
        yield from _tables(value, f"{name}.{key}" if name else key, many)


def _row(key: str, of: Schema, needed: bool) -> KeyRow:
    unit = of.get(UNIT) or of.get("items", {}).get(UNIT, "")
    unit = {"1": "", "of the key": UNNAMED}.get(unit, str(unit))
    default = as_toml(of["default"]) if "default" in of else ""
    return KeyRow(key, needed, unit, _said(of), default, as_toml(example_of(of)), of["description"])


def example_of(of: Schema) -> Any:
    """A value that the key may have: its example, its default, or the first of those it may be."""
    if "examples" in of:
        return of["examples"][0]
    if "default" in of:
        return of["default"]
    return of["enum"][0] if "enum" in of else True


def as_toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {as_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def _said(of: Schema) -> str:
    """What a value may be, in words."""
    if "enum" in of:
        return listed([as_toml(each) for each in of["enum"]])
    if of.get("type") == "array":
        return _array(of)
    if of.get("type") == "object":
        return "text by quoted key path"
    kind = WORDS[of["type"]]
    if of["type"] in NUMBERS:
        limits = _limits(of)
        return f"{kind}, {limits}" if limits else kind
    return "key path of a stage file" if "anyOf" in of else kind


def listed(values: list[str]) -> str:
    """Values in words, only some where there are many."""
    if len(values) <= LISTED:
        return " or ".join([", ".join(values[:-1]), values[-1]] if len(values) > 1 else values)
    return f"one of {len(values)}, such as {', '.join(values[:3])}"


def _array(of: Schema) -> str:
    least, most = of.get("minItems"), of.get("maxItems")
    if least == most and least is not None:
        count = f"{least} of"
    else:
        count = f"{least or 0} to {most} of" if most else f"{least} or more of" if least else "array of"
    return f"{count}: {_said(of['items'])}"


def _limits(of: Schema) -> str:
    low, high = of.get("minimum"), of.get("maximum")
    above, below = of.get("exclusiveMinimum"), of.get("exclusiveMaximum")
    zero = "0, or " if {"const": 0} in of.get("anyOf", []) else ""
    low = next((each["minimum"] for each in of.get("anyOf", []) if "minimum" in each), low)
    start = f"from {_short(low)}" if low is not None else f"above {_short(above)}" if above is not None else ""
    end = f"up to {_short(high)}" if high is not None else f"below {_short(below)}" if below is not None else ""
    return zero + " ".join(part for part in (start, end) if part)


def _short(limit: float) -> str:
    return re.sub(r"e([-+])0?", lambda found: f"e{found[1].strip('+')}", f"{limit:g}")
