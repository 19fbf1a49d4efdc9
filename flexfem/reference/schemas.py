"""JSON schemas of the formats, draft 7 without references, which editors and validators of TOML read.

Every key has its description, default, limits, examples and, if it is a number, its unit.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from operator import methodcaller
from pathlib import Path
from typing import Any

from flexfem.files.inputs import require_unread
from flexfem.files.quantities import UNIT
from flexfem.files.writing import check_folder, write_atomically
from flexfem.reference.formats import Format, format_of
from flexfem.units import unit_of

DRAFT = "http://json-schema.org/draft-07/schema#"
FILE = "flexfem-{}.schema.json"
NUMBERS = ("number", "integer")


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema of a format. Raises BadInput when there is no such format."""
    of = format_of(name)
    raw = of.model.model_json_schema(by_alias=True)
    whole = _plain(raw, raw.get("$defs", {}))
    _state_units(whole, "")
    return {"$schema": DRAFT, "title": f"flexfem: {of.title.lower()}", **_root(of, whole)}


def _root(of: Format, whole: dict[str, Any]) -> dict[str, Any]:
    if of.named is None:
        return {**whole, "description": of.about}
    return {"description": of.about, "type": "object", "additionalProperties": whole | {"description": of.entry}}


def _plain(schema: Any, known: dict[str, Any]) -> Any:
    """A schema without references, without null, which TOML has not, and with arrays of one kind of member."""
    if not isinstance(schema, dict):
        return schema
    found = {key: value for key, value in schema.items() if key not in ("title", "$defs", "$ref", "default")}
    if schema.get("default") is not None and schema["default"] != []:
        found["default"] = schema["default"]
    if "$ref" in schema:
        found = {**_plain(known[schema["$ref"].rpartition("/")[2]], known), **found}
    members = found.get("anyOf", [])
    if {"type": "null"} in members:
        (inner,) = (each for each in members if each != {"type": "null"})
        found = {**_plain(inner, known), **{key: value for key, value in found.items() if key != "anyOf"}}
    if "prefixItems" in found:
        kinds = found.pop("prefixItems")
        assert all(kind == kinds[0] for kind in kinds), "members of several kinds"
        found["items"] = kinds[0]
    if "properties" in found:
        found["properties"] = {key: _plain(value, known) for key, value in found["properties"].items()}
    for key in ("items", "additionalProperties"):
        if key in found:
            found[key] = _plain(found[key], known)
    if found.get("minimum", 0) > 0:
        found.pop("exclusiveMinimum", None)
    return found


def _state_units(schema: dict[str, Any], key: str) -> None:
    """Give every number the unit that its key ends in; a number without one says so itself."""
    if schema.get("type") in NUMBERS and UNIT not in schema:
        unit = str(unit_of(key)) or ("1" if schema["type"] == "integer" else "")
        assert unit, f"{key}: a number without a unit"
        schema[UNIT] = unit
    if isinstance(schema.get("items"), dict):
        _state_units(schema["items"], key)
    for name, inner in schema.get("properties", {}).items():
        _state_units(inner, name)


def write_schemas(names: Sequence[str], folder: Path) -> list[Path]:
    """Write the JSON schemas of formats into a folder, made when missing; returns their paths.

    A TOML file whose first line is `#:schema` and the path of one is completed and checked by editors that know TOML.
    Raises BadInput when there is no such format, or the folder takes no file.
    """
    texts = {folder / FILE.format(name): json.dumps(schema_of(name), indent=1) + "\n" for name in names}
    check_folder(folder)
    require_unread(*texts)
    for path, text in texts.items():
        write_atomically(path, methodcaller("write", text.encode()))
    return [*texts]
