"""JSON schemas (draft 7) of the files that flexfem reads and writes, and tables of their keys.

The schema of an input file is made from the model that reads it. It has no references, because TOML
editors do not resolve them. The schema of a result is made from its declaration."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise
from operator import methodcaller
from pathlib import Path
from pkgutil import iter_modules
from textwrap import dedent
from typing import Any, NamedTuple

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from flexfem import paper, questions
from flexfem.design.requirements import Requirements
from flexfem.files.inputs import require_unread
from flexfem.files.quantities import UNIT
from flexfem.files.refusals import SHOWN, as_toml, checked_path, one_line
from flexfem.files.tables import Table
from flexfem.files.writing import check_folder, write_atomically
from flexfem.mechanism.materials import Entry
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.case import Case
from flexfem.paper.fixture import Fixture, Measurement
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import Override
from flexfem.questions.necks import Necks
from flexfem.refused import BadInput
from flexfem.results import DRAFT, Result
from flexfem.study.plan import Study
from flexfem.units import short, unit_of

FILE = "flexfem-{}.schema.json"
NUMBERS = ("number", "integer")
EXPRESSIONS = ["number", "string"]  # types of a number that may be an expression
WORDS = {
    "string": "text",
    "number": "number",
    "integer": "integer",
    "boolean": "true or false",
    "object": "table",
}
LISTED = 12  # values of an enumeration that are listed; of longer ones three are


class Format(NamedTuple):
    """A kind of input file: the model that reads it, its title, and its purpose.

    named : what each table describes where the user names the tables; the model is then that of one
    table."""

    model: type[BaseModel]
    title: str
    about: str
    named: str = ""


STAGES = (
    "One TOML file for each stage. `flexfem new` writes a stage file, `flexfem check` explains it."
)
CASES = (
    "One TOML file for each comparison: (18) gives the force for a commanded platform "
    "displacement, finite elements give the displacement under this force, and the difference is "
    "the error. `flexfem verify` runs it."
)
STUDIES = (
    "One TOML file for each study: many designs of one base stage, run by `flexfem study run`."
)
DESIGNS = (
    "One TOML file for each design: free keys of a base stage, requirements and objective, for "
    "`flexfem design`."
)
FIXTURES = "One TOML file for each set-up of the stiffness experiment, for `flexfem experiment`."
SLOPES = (
    "Measured slopes without the set-up, for `flexfem identify` and `flexfem experiment "
    "--measured`."
)
MATERIALS = (
    "Your own materials, one table each, in a file that a stage file names: `name` and `file` in "
    "`[material]`."
)
NECKS = (
    "The necks of a stage or mechanism as measured, for `flexfem as-built`, which also reads a "
    "CSV file."
)
MECHANISMS = (
    "One TOML file for each mechanism that is cut from one plate, of any form: bodies, hinges, "
    "copies of both, actuators and an output. `flexfem new --kind` writes examples."
)
FORMATS = {
    "stage": Format(Stage, "Stage file", STAGES),
    "case": Format(Case, "Case file", CASES),
    "study": Format(Study, "Study file", STUDIES),
    "requirements": Format(Requirements, "Requirements file", DESIGNS),
    "fixture": Format(Fixture, "Fixture file", FIXTURES),
    "measured": Format(Measurement, "Measured slopes", SLOPES),
    "material": Format(Entry, "Materials file", MATERIALS, named="material"),
    "necks": Format(Necks, "Measured necks", NECKS),
    "mechanism": Format(MechanismFile, "Mechanism file", MECHANISMS),
}


class Schema(dict[str, Any]):
    """A JSON schema that prints as a table of the keys of the file."""

    text = ""

    def __str__(self) -> str:
        return self.text


def schema(name: str | None = None, *, output: Path | None = None) -> Schema | list[Path]:
    """Give the JSON schema of a kind of file, which editors and programs use to check it, or the
    table of its keys.

    The schema lists the hinge formulas, materials and stacks that are known now, including your
    own. Editors that know TOML complete and check a file whose first line is `#:schema` and the
    path of a schema.

    Parameters
    ----------
    name : str, optional
        Kind of input file: stage, case, study, requirements, fixture, measured, material, necks or
        mechanism; or of result: stiffness, drift and others. By default all kinds are listed.
    output : path, optional
        Folder for the schema as a file; without a name, for the schemas of all input files.

    Returns
    -------
    dict or list of path
        The schema, or the files written. Raises BadInput when there is no such kind, or the folder
        cannot be written.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.schema("stage")["properties"]["thickness_mm"]["x-unit"]
    'mm'
    """
    if output is not None:
        folder = checked_path(output)
        wanted = [*FORMATS] if name is None else [name]
        texts = {
            folder / FILE.format(each): json.dumps(schema_of(each), indent=1) + "\n"
            for each in wanted
        }
        check_folder(folder)
        require_unread(*texts)
        for path, text in texts.items():
            write_atomically(path, methodcaller("write", text.encode()))
        return [*texts]
    if name is None:
        found = Schema({each: of.about for each, of in FORMATS.items()})
        found |= {each: f"Result: {one.title}." for each, one in results().items()}
        found.text = "\n".join(f"{each}: {about}" for each, about in found.items())
    else:
        found = Schema(schema_of(name))
        found.text = "\n".join(_lines(name))
    return found


def _lines(name: str) -> Iterator[str]:
    """Yield the keys of a file, or the quantities of a result, each with its meaning on the next
    line.
    """
    if name not in FORMATS:
        for quantity, meaning, unit, axes in results()[name].reference().rows:
            yield (
                f"{quantity}{f' {unit}' if unit else ''}: "
                f"{'for each ' * (axes != 'one number')}{axes}\n    {meaning}"
            )
        return
    for table in tables_of(name):
        yield f"{table.header}  {table.about}" if table.name else FORMATS[name].about
        for row in table.rows:
            unit = f" {row.unit}:" if row.unit else ":"
            default = f"; default {row.default}" if row.default else ""
            yield f"  {row.key}{' *' * row.needed}{unit} {row.value}{default}\n      {row.meaning}"


def results() -> dict[str, type[Result]]:
    """Return all kinds of results by name."""
    for room in (questions, paper):
        for module in iter_modules(room.__path__):
            import_module(f"{room.__name__}.{module.name}")
    return {
        name: one for name, one in Result.kinds.items() if one.__module__.startswith("flexfem.")
    }


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
    of = FORMATS[name]
    raw = of.model.model_json_schema(schema_generator=_Described)
    whole = _plain(
        raw, "", raw.get("$defs", {}), EXPRESSIONS if of.model is MechanismFile else "number"
    )
    if inches and "units" in whole["properties"]:
        whole = _or_inches(whole)
    if of.named:
        entry = whole | {"description": f"The numbers of one {of.named}"}
        whole = {"type": "object", "additionalProperties": entry}
    return {
        "$schema": DRAFT,
        "title": f"flexfem: {of.title.lower()}",
        **whole,
        "description": of.about,
    }


def _or_inches(of: Any) -> Any:
    """Return a schema in which every key that ends in _mm may end in _in instead; such values are
    not checked.
    """
    if not isinstance(of, dict):
        return of
    found = {name: _or_inches(part) for name, part in of.items()}
    if lengths := [key for key in of.get("properties", {}) if key.endswith("_mm")]:
        needed = [key for key in of.get("required", []) if key in lengths]
        found["patternProperties"] = {f"^({'|'.join(key[:-3] for key in lengths)})_in$": {}}
        found["required"] = [key for key in of.get("required", []) if key not in lengths]
        found["allOf"] = [
            {"anyOf": [{"required": [each]} for each in (key, key[:-2] + "in")]} for key in needed
        ]
    return {name: part for name, part in found.items() if part or name not in ("required", "allOf")}


class _Described(GenerateJsonSchema):
    """Schemas without null, with the attribute docstrings as descriptions; pydantic would parse
    them at every start.
    """

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def model_schema(self, schema: Any) -> dict[str, Any]:
        found = super().model_schema(schema)
        model = schema["cls"]
        texts = dict[str, str]()
        for each in (*getattr(model, "described_by", ()), *reversed(model.__mro__)):
            if not issubclass(each, Table) or each is Override:  # has no source code
                continue
            tree: Any = ast.parse(dedent(inspect.getsource(each))).body[0]
            for one, below in pairwise(tree.body):
                match one, below:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(
                        value=ast.Constant(value=str(text))
                    ):
                        texts[name] = inspect.cleandoc(text)
        for name, field in model.model_fields.items():
            if name in texts and (key := field.alias or name) in found["properties"]:
                found["properties"][key]["description"] = texts[name]
        return found


def _plain(
    schema: dict[str, Any], key: str, known: dict[str, Any], number: str | list[str]
) -> dict[str, Any]:
    """Return a schema without references, with one schema for all items of an array.

    A number has the type `number` and the unit that its key ends in, unless its own schema states
    one."""
    found = {
        name: value for name, value in schema.items() if name not in ("title", "$defs", "$ref")
    }
    if "$ref" in schema:
        found = {**known[schema["$ref"].rpartition("/")[2]], **found}
        return _plain(found, key, known, number)
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
    """Return the tables of an input file, outer tables first. Raises BadInput for an unknown
    format.
    """
    of = schema_of(name, False)
    named = FORMATS[name].named
    return list(
        _tables(of["additionalProperties"], f"name of the {named}", False)
        if named
        else _tables(of, "", False)
    )


def _tables(of: dict[str, Any], name: str, array: bool) -> Iterator[KeyTable]:
    inner = list[tuple[str, dict[str, Any], bool]]()
    rows = list[KeyRow]()
    for key, value in of.get("properties", {}).items():
        if "properties" in value:
            inner.append((key, value, False))
        elif "properties" in value.get("items", {}):
            inner.append((key, value["items"] | {"description": value["description"]}, True))
        else:
            number = value
            while "items" in number:
                number = number["items"]
            unit = number.get(UNIT, "")
            unit = {"1": "", "of the key": "unit of the key"}.get(unit, unit)
            default = as_toml(value["default"]) if "default" in value else ""
            needed = key in of.get("required", [])
            example = as_toml(example_of(value))
            rows.append(
                KeyRow(key, needed, unit, _in_words(value), default, example, value["description"])
            )
    yield KeyTable(name, array, of.get("description", ""), rows)
    for key, value, many in inner:
        yield from _tables(value, f"{name}.{key}" if name else key, many)


def example_of(of: dict[str, Any]) -> Any:
    """Return a valid value of a key: its example, its default, or the first value of its
    enumeration.
    """
    return (of.get("examples") or [of.get("default", of.get("enum", [True])[0])])[0]


def _in_words(of: dict[str, Any]) -> str:
    """Return the valid values of a key as text."""
    if "enum" in of:
        values = [as_toml(each) for each in of["enum"]]
        if len(values) > LISTED:
            return f"one of {len(values)}, such as {', '.join(values[:3])}"
        return " or ".join([", ".join(values[:-1]), values[-1]] if len(values) > 1 else values)
    kind = of.get("type")
    if kind == EXPRESSIONS:
        return f"{_in_words(of | {'type': 'number'})} or expression"
    if kind == "array":
        least = of.get("minItems", 0)
        most = of.get("maxItems")
        count = (
            f" {least}" if least == most else f" {least} to {most}" if most else f" {least} or more"
        )
        return f"array of{count if most or least else ''}: {_in_words(of['items'])}"
    if kind == "object":
        is_number = of["additionalProperties"]["type"] == EXPRESSIONS
        return (
            "number or expression for each name"
            if is_number
            else "text for each key path in quotes"
        )
    if kind in NUMBERS:
        return ", ".join(filter(None, [WORDS[kind], _limits(of)]))
    return "key path of a stage file" if "anyOf" in of else WORDS[of["type"]]


def _limits(of: dict[str, Any]) -> str:
    choices = of.get("anyOf", [])
    low = next((each["minimum"] for each in choices if "minimum" in each), of.get("minimum"))
    above = of.get("exclusiveMinimum") if low is None else None
    ends = (
        ("from", low),
        ("above", above),
        ("up to", of.get("maximum")),
        ("below", of.get("exclusiveMaximum")),
    )
    said = (f"{word} {short(limit)}" for word, limit in ends if limit is not None)
    return ("0, or " if {"const": 0} in choices else "") + " ".join(said)
