"""Refusals in the words of the file: what pydantic found, as one line with key path, value and expectation."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails, PydanticCustomError

from flexfem.files.keypath import KeyPath, as_key, key_path
from flexfem.files.lines import MAX_DEPTH
from flexfem.refused import BadInput

SHOWN = 60  # characters of a value or key in a message


def refusal(expected: str, *at: str | int) -> PydanticCustomError:
    """Return the exception by which a validator refuses the value at `at`, a key path below the validated one."""
    return PydanticCustomError("refused", "expected {expected}", {"expected": expected, "at": at})


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return ", did you mean ...?" with the known word closest to `word`, or nothing when none is close."""
    close = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean {close[0]}?" if close else ""


def one_line(text: str, limit: int | None = None) -> str:
    """Return `text` with everything unprintable escaped, clipped to `limit` characters."""
    clipped = text if limit is None or len(text) <= limit else text[: limit - 3] + "..."
    escaped = "".join(c if c.isprintable() else repr(c)[1:-1] for c in clipped)
    return escaped if limit is None or len(escaped) <= limit else escaped[: limit - 3] + "..."


def shown(value: Any) -> str:
    """Return `value` as TOML on one line of at most `SHOWN` characters."""
    return one_line(_as_toml(value), SHOWN)


def checked_path(value: Any) -> Path:
    """The path of a file that a function was given. Raises BadInput for anything else."""
    if not isinstance(value, str | os.PathLike) or isinstance(os.fspath(value), bytes):
        raise BadInput(f"{value!r}, expected the path of a file")
    return Path(value)


def place_of(path: str | os.PathLike[str], line: int | None = None) -> str:
    """Return file and line as every message begins with them."""
    name = one_line(os.fspath(path)) or '""'
    return name if line is None else f"{name}, line {line}"


_EXPECTED = {
    "refused": "{expected}",
    "missing": "",
    "extra_forbidden": "",
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
    "too_long": "at most {max_length} values, not {actual_length}",
    "too_short": "at least {min_length} values, not {actual_length}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "an integer",
    "int_parsing_size": "an integer of at most 4300 digits",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "tuple_type": "an array",
    "literal_error": "{expected}",
    "model_type": "a table",
    "dict_type": "a table",
}


class Problem(NamedTuple):
    """One mistake: pydantic's kind of it, where, and what was expected."""

    kind: str
    path: KeyPath
    expected: str


def problem_of(details: ErrorDetails, data: dict[str, Any]) -> Problem:
    """Say in the file's terms what pydantic found."""
    kind, context = details["type"], details.get("ctx", {})
    path = _present((*details["loc"], *context.get("at", ())), data)
    if kind == "missing" and isinstance(details["loc"][-1], int):
        return Problem("short", path, f"{details['loc'][-1] + 1} values, not {len(_value_at(path, data))}")
    if kind == "missing":
        return Problem(kind, (*path, details["loc"][-1]), "")
    value = _value_at(path, data)
    if kind == "tuple_type" and isinstance(value, dict):
        return Problem(kind, path, f"an array of tables, [[{key_path(path)}]]")
    if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        return Problem(kind, path, "a number below 1e308")
    limits = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in context.items()}
    otherwise = details["msg"].removeprefix("Value error, ").replace("{", "{{").replace("}", "}}")
    return Problem(kind, path, _EXPECTED.get(kind, otherwise).format(**limits))


def _present(path: KeyPath, data: Any) -> KeyPath:
    """Return the part of `path` that is in the file: pydantic adds the names of unions and the like."""
    found: KeyPath = ()
    for part in path:
        in_table = isinstance(data, dict) and part in data
        if in_table or (isinstance(data, list) and isinstance(part, int) and part < len(data)):
            found, data = (*found, part), data[part]
    return found


def _value_at(path: KeyPath, data: Any) -> Any:
    for part in path:
        data = data[part]
    return data


def merged(problems: list[Problem]) -> list[Problem]:
    """Keep one problem a mistake.

    A short array is one, so are a misspelt key and the key then missing, and an array that pydantic takes for too short
    because it does not count its broken members.
    """
    inner = {problem.path[:length] for problem in problems for length in range(len(problem.path))}
    problems = [problem for problem in problems if problem.kind != "too_short" or problem.path not in inner]
    unknown = [problem.path for problem in problems if problem.kind == "extra_forbidden"][:MAX_DEPTH]
    kept: dict[tuple[str, KeyPath], Problem] = {}
    for problem in problems:
        siblings = [str(path[-1]) for path in unknown if path[:-1] == problem.path[:-1]]
        if problem.kind != "missing" or not suggestion(str(problem.path[-1]), siblings):
            kept[problem.kind, problem.path] = problem
    return list(kept.values())


def needed(problem: Problem, model: type[BaseModel], data: Any = None) -> list[str]:
    """The keys that a missing key stands for: itself, or all that its table needs."""
    inside = _model_at(model, problem.path)
    if inside is None:
        return [key_path(problem.path, data)]
    fields = {known.alias or name: known for name, known in inside.model_fields.items() if known.is_required()}
    keys = [key for name in fields for key in needed(Problem("missing", (*problem.path, name), ""), model, data)]
    return keys or [key_path(problem.path, data)]  # a table of which no single key is a must


def missing_sentence(keys: list[str]) -> str:
    """Say which keys are missing."""
    return f"{keys[0]} is missing" if len(keys) == 1 else f"{', '.join(keys[:-1])} and {keys[-1]} are missing"


def _model_at(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    """The model of the table at a key path, None where a value or an array belongs."""
    annotation: Any = model
    for part in path:
        if isinstance(part, int):
            continue
        table = next(_models_in(annotation), None)
        fields = {known.alias or name: known for name, known in table.model_fields.items()} if table else {}
        if part not in fields:
            return None
        annotation = fields[part].annotation
    whole = not path or isinstance(path[-1], int) or get_origin(annotation) is None
    return next(_models_in(annotation), None) if whole else None


def sentence(problem: Problem, model: type[BaseModel], data: dict[str, Any]) -> str:
    """Return what is wrong and what was expected, in the words of the file."""
    key = key_path(problem.path, data)
    if problem.kind == "extra_forbidden":
        known = sorted(_known_keys(model, problem.path[:-1]), key="provenance".__eq__)  # last, as in files
        close = suggestion(str(problem.path[-1]), known)
        return f"{key} is an unknown key{close or ', expected one of ' + ', '.join(known)}"
    if not problem.path:
        return f"expected {problem.expected}"
    return f"{key} = {shown(_value_at(problem.path, data))}, expected {problem.expected}"


def _known_keys(model: type[BaseModel], path: KeyPath) -> list[str]:
    for part in path:
        fields = {known.alias or name: known for name, known in model.model_fields.items()}
        if part in fields:
            model = next(_models_in(fields[str(part)].annotation), model)
    return [known.alias or name for name, known in model.model_fields.items()]


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if get_origin(annotation) is None and isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models_in(inner)


def _as_toml(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int) and value.bit_length() > 4 * SHOWN:
        return f"{value >> (value.bit_length() - 64)}... ({value.bit_length()} bits)"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{as_key(key)} = {_as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_as_toml, value)) + "]"
    return str(value)
