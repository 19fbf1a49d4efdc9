"""The JSON schema of an input file, made from the model that reads it, or of a result.

It has no references, because TOML editors do not resolve them. The schema of a result is made from
its declaration.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Sequence
from itertools import pairwise
from textwrap import dedent
from typing import Any

from pydantic import AliasChoices
from pydantic.json_schema import GenerateJsonSchema

from flexfem.files.quantities import UNIT
from flexfem.files.refusals import SHOWN, one_line
from flexfem.files.tables import Table
from flexfem.refused import BadInput
from flexfem.results.store import DRAFT
from flexfem.schemas.formats import FORMATS, results
from flexfem.units import unit_of

NUMBERS = ("number", "integer")
EXPRESSIONS = ["number", "string"]  # types of a number that may be an expression
NOT_COPIED = ("title", "$defs", "$ref")  # keys of pydantic's schemas


def schema_of(name: str, inches: bool = True) -> dict[str, Any]:
    """Return the JSON schema of an input file or result. Raises BadInput for an unknown kind.

    inches : include keys of lengths in inches, where the file may have `units = "in"`.
    """
    if not isinstance(name, str) or (name not in FORMATS and name not in results()):
        expected = (
            f"one of: {', '.join(FORMATS)}, or a kind of result, which `flexfem schema` lists"
        )
        raise BadInput(f"format {one_line(repr(name), SHOWN)} is not known, expected {expected}")
    if name not in FORMATS:
        return results()[name].schema()
    kind = FORMATS[name]
    raw = kind.table.model_json_schema(schema_generator=_Described)
    number = EXPRESSIONS if kind.expressions else "number"
    whole = _plain(raw, "", raw.get("$defs", {}), number)
    if inches and "units" in whole["properties"]:
        whole = _or_inches(whole)
    if kind.tables:
        entry = whole | {"description": f"The numbers of one {kind.tables}"}
        whole = {"type": "object", "additionalProperties": entry}
    title = f"flexfem: {kind.title.lower()}"
    return {"$schema": DRAFT, "title": title, **whole, "description": kind.about}


def _or_inches(of: Any) -> Any:
    """Return a schema in which every key that ends in _mm may end in _in instead.

    Values of the latter are not checked.
    """
    if not isinstance(of, dict):
        return of
    found = {name: _or_inches(part) for name, part in of.items()}
    lengths = [key for key in of.get("properties", {}) if key.endswith("_mm")]
    if lengths:
        required = of.get("required", [])
        stems = "|".join(key.removesuffix("_mm") for key in lengths)
        found["patternProperties"] = {f"^({stems})_in$": {}}
        found["required"] = [key for key in required if key not in lengths]
        found["allOf"] = [_either_unit(key) for key in required if key in lengths]
    return {name: part for name, part in found.items() if part or name not in ("required", "allOf")}


def _either_unit(key: str) -> dict[str, Any]:
    """Return the schema of a table that has a length in mm or in inches."""
    inches = f"{key.removesuffix('_mm')}_in"
    return {"anyOf": [{"required": [key]}, {"required": [inches]}]}


class _Described(GenerateJsonSchema):
    """Schemas without null, with the attribute docstrings as descriptions.

    Pydantic would parse these docstrings at every start.
    """

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def model_schema(self, schema: Any) -> dict[str, Any]:
        found = super().model_schema(schema)
        model = schema["cls"]
        texts = _attribute_texts(model)
        for name, field in model.model_fields.items():
            key = field.alias or name
            if name in texts and key in found["properties"]:
                found["properties"][key]["description"] = texts[name]
            if isinstance(field.validation_alias, AliasChoices):
                _allow_each(found, [str(choice) for choice in field.validation_alias.choices])
        return found


def _allow_each(schema: dict[str, Any], keys: Sequence[str]) -> None:
    """Let the schema of a table have one of several keys for the first of them."""
    first, *others = keys
    for key in others:
        schema["properties"][key] = dict(schema["properties"][first])
    schema["required"].remove(first)
    schema.setdefault("allOf", []).append({"oneOf": [{"required": [key]} for key in keys]})


def _attribute_texts(model: Any) -> dict[str, str]:
    """Return the docstrings of the attributes of a model and of those that describe it."""
    texts = dict[str, str]()
    for table in (*getattr(model, "described_by", ()), *reversed(model.__mro__)):
        if not issubclass(table, Table):
            continue
        try:
            source = inspect.getsource(table)
        except OSError:  # a model that pydantic's `create_model` has made
            continue
        tree: Any = ast.parse(dedent(source)).body[0]
        for statement, following in pairwise(tree.body):
            match statement, following:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(
                    value=ast.Constant(value=str(text))
                ):
                    texts[name] = inspect.cleandoc(text)
    return texts


def _plain(
    schema: dict[str, Any], key: str, known: dict[str, Any], number: str | list[str]
) -> dict[str, Any]:
    """Return a schema without references, with one schema for all items of an array.

    A number has the type `number` and the unit that its key ends in, unless its own schema states
    one.
    """
    found = {name: value for name, value in schema.items() if name not in NOT_COPIED}
    if "$ref" in schema:
        referred = known[schema["$ref"].rpartition("/")[2]]
        return _plain({**referred, **found}, key, known, number)
    if found.get("default", ()) in (None, []):
        del found["default"]
    if "description" in found:
        found["description"] = " ".join(found["description"].split())
    if "prefixItems" in found:
        found["items"], *others = found.pop("prefixItems")
        assert all(kind == found["items"] for kind in others), "members of several kinds"
    if found.get("type") in NUMBERS:
        found.setdefault(UNIT, str(unit_of(key)) or "1" * (found["type"] == "integer"))
        found["type"] = number if found["type"] == "number" else "integer"
    for name in ("items", "additionalProperties"):
        if isinstance(found.get(name), dict):
            found[name] = _plain(found[name], key, known, number)
    if "properties" in found:
        inner = found["properties"].items()
        found["properties"] = {name: _plain(value, name, known, number) for name, value in inner}
    return found
