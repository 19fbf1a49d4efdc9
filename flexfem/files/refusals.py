"""Key paths, and errors in the terms of the file: one line with key path, value and expected value.

A key path names a key of a file, the same in errors, in `[provenance]`, in study files and in
baselines. Tables are named by their keys and members of an array by their index from 0:
`hinges.base.neck_mm`, `chain.link_lengths_mm[0]`, `factor[1].sd`. A member of an array that
identifies its subject is named by the subject: `override.2.elbow.neck_mm` is the neck of the elbow
hinge of chain 2, wherever the override stands in the file.
"""

from __future__ import annotations

import difflib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from flexfem.refused import BadInput, printed
from flexfem.units import ENDING

KeyPath: TypeAlias = tuple[str | int, ...]

ABOUT = {  # by array: the keys that identify a member
    "override": ("chain", "hinge"),
    "actuator": ("name",),
    "neck": ("chain", "hinge"),
    **dict.fromkeys(("body", "hinge", "point"), ("name",)),  # of mechanisms
}
RENAMED = {"layers": "thickness_resolution"}  # old names of keys, with their replacements
SHOWN = 60  # characters of a value or key in a message
COMPARED = 32  # unknown keys, at most, that are compared with missing ones
_BARE = re.compile(r"[A-Za-z0-9_-]+")  # bare keys of TOML
_PLAIN = re.compile(r'[^.\[\]"]{1,60}')  # needs no quotes in a key path
_PART = re.compile(
    r'\[(?P<place>\d+)\]|(?:^|\.)(?:(?P<bare>[^.\[\]"]+)|(?P<quoted>"(?:[^"\\]|\\.)*"))'
)


def key_path(path: KeyPath, data: Any = None) -> str:
    """Return the text of a path of keys and indices.

    `data`, tables or their model, identifies members of arrays.

    A key that identifies a member is itself named by index, because its value may be wrong:
    `override[0].chain`.
    """
    text = ""
    inside = data
    for index, part in enumerate(path):
        inside = _inside(inside, part)
        if isinstance(part, int):
            array = path[index - 1] if index else ""
            below = (*path[index + 1 : index + 2],)
            about = (
                ()
                if below and below[0] in ABOUT.get(str(array), ())
                else _about(str(array), inside)
            )
            text += "".join(f".{each}" for each in about) or f"[{part}]"
        else:
            is_plain = _PLAIN.fullmatch(part) and part.isprintable()
            text += f".{part if is_plain else one_line(as_key(part), SHOWN)}"
    return text.removeprefix(".")


def path_of(text: str, data: Any = None) -> KeyPath:
    """Return the path of a key path text, with indices for the members that `data` identifies.

    Raises ValueError for another text.
    """
    parts = list[str | int]()
    end = 0
    while end < len(text):
        found = _PART.match(text, end)
        if found is None:
            raise ValueError(f"{text}: no key path")
        end = found.end()
        parts.append(
            int(found["place"]) if found["place"] else found["bare"] or json.loads(found["quoted"])
        )
    inside = data
    for index, part in enumerate(parts if data is not None else ()):
        inside = _inside(inside, part)
        arrayed = str(part) in ABOUT and isinstance(inside, list | tuple)
        for place, member in enumerate(inside if arrayed else ()):
            about = _about(str(part), member)
            if about and about == tuple(parts[index + 1 : index + 1 + len(about)]):
                return (*parts[: index + 1], place, *parts[index + 1 + len(about) :])
    return tuple(parts)


def _about(array: str, member: Any) -> tuple[str, ...]:
    """Return the values that identify a member of an array, if they are plain numbers and words."""
    stated = (_inside(member, key) for key in ABOUT.get(array, ()))
    values = tuple(value for value in stated if value is not None)
    if array == "override" and len(values) == 1:
        values = (values[0], "actuator", _inside(member, "actuator"))
    plain = all(
        type(value) in (int, str) and re.fullmatch(r"\w{1,20}", str(value)) for value in values
    )
    return tuple(map(str, values)) if plain else ()


def _inside(data: Any, part: str | int) -> Any:
    if isinstance(data, Mapping):
        return data.get(part)
    if isinstance(data, list | tuple):
        return data[part] if isinstance(part, int) and part < len(data) else None
    return getattr(data, part, None) if isinstance(part, str) else None


def as_key(key: Any) -> str:
    """Return a key as TOML writes it."""
    key = key if isinstance(key, str) else printed(key)
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=not key.isprintable())


def refusal(expected: str, *at: str | int) -> PydanticCustomError:
    """Return the exception of a validator for the value at `at`, a key path below the validated
    one.
    """
    return PydanticCustomError("refused", "expected {expected}", {"expected": expected, "at": at})


def suggestion(
    word: str,
    known: Iterable[str],
    said: Callable[[str], str] = str,
) -> str:
    """Return ", did you mean ...?" with the known word closest to `word`, as `said`, or "" when
    none is close.
    """
    close = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean {said(close[0])}?" if close else ""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return `suggestion`, or ", one of ..." with all known words when none is close, "" when there
    are none.
    """
    names = list(known)
    return suggestion(word, names) or (f", one of {', '.join(names)}" if names else "")


def one_line(text: str, limit: int | None = None) -> str:
    """Return `text` with everything unprintable escaped, clipped to `limit` characters."""
    clipped = text if limit is None or len(text) <= limit else text[: limit - 3] + "..."
    escaped = "".join(c if c.isprintable() else repr(c)[1:-1] for c in clipped)
    return escaped if limit is None or len(escaped) <= limit else escaped[: limit - 3] + "..."


def shown(value: Any) -> str:
    """Return `value` as TOML on one line of at most `SHOWN` characters."""
    return one_line(as_toml(value), SHOWN)


def checked_path(value: Any) -> Path:
    """Return an argument that is the path of a file. Raises BadInput for anything else."""
    if not isinstance(value, str | os.PathLike) or isinstance(os.fspath(value), bytes):
        raise BadInput(f"{printed(value)}, expected the path of a file")
    return Path(value)


def place_of(path: str | os.PathLike[str], line: int | None = None) -> str:
    """Return file and line as messages begin with them."""
    name = one_line(os.fspath(path)) or '""'
    return name if line is None else f"{name}, line {line}"


_EXPECTED = {  # by kind of error in pydantic
    "refused": "{expected}",
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
    "string_pattern_mismatch": "at most 60 of A-Z, a-z, 0-9 and _, a letter first",
    "tuple_type": "an array",
    "literal_error": "{expected}",
    "model_type": "a table",
    "dict_type": "a table",
}


class Problem(NamedTuple):
    """One error: its kind in pydantic, its key path, and the expected value."""

    kind: str
    path: KeyPath
    expected: str


def problems_of(error: ValidationError, data: Any = None) -> list[Problem]:
    """Return one problem for each mistake in the terms of the file or of Python values, `data`.

    A misspelt key is also missing for pydantic, and a short array has two errors.
    """
    problems = [_problem_of(details, data) for details in error.errors(include_url=False)]
    inner = {problem.path[:length] for problem in problems for length in range(len(problem.path))}
    problems = [
        each for each in problems if each.kind != "too_short" or each.path not in inner
    ]  # broken members
    unknown = [problem.path for problem in problems if problem.kind == "extra_forbidden"][:COMPARED]
    kept: dict[tuple[str, KeyPath], Problem] = {}
    for problem in problems:
        siblings = [str(path[-1]) for path in unknown if path[:-1] == problem.path[:-1]]
        if problem.kind != "missing" or not suggestion(str(problem.path[-1]), siblings):
            kept[problem.kind, problem.path] = problem
    return list(kept.values())


def _problem_of(details: ErrorDetails, data: Any) -> Problem:
    kind = details["type"]
    context = details.get("ctx", {})
    at = context.get("at", ())
    # the same path by names of attributes
    named = tuple(ENDING.sub("", part) if isinstance(part, str) else part for part in at)
    path = max((_present((*details["loc"], *below), data) for below in (at, named)), key=len)
    if kind == "missing" and isinstance(details["loc"][-1], int):
        return Problem(
            "short",
            path,
            f"{details['loc'][-1] + 1} values, not {len(reduce(_inside, path, data))}",
        )
    if kind == "missing":
        return Problem(kind, (*path, details["loc"][-1]), "")
    value = reduce(_inside, path, data)
    if kind == "tuple_type" and isinstance(value, dict):
        return Problem(kind, path, f"an array of tables, [[{key_path(path)}]]")
    if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        return Problem(kind, path, "a number below 1e308")
    limits = {
        name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in context.items()
    }
    otherwise = details["msg"].removeprefix("Value error, ").replace("{", "{{").replace("}", "}}")
    return Problem(kind, path, _EXPECTED.get(kind, otherwise).format(**limits))


def _present(path: KeyPath, data: Any) -> KeyPath:
    """Return the part of a path that is in the file; pydantic adds names of types."""
    found: KeyPath = ()
    for part in path:
        in_table = isinstance(data, dict) and part in data
        if in_table or (isinstance(data, list) and isinstance(part, int) and part < len(data)):
            found = (*found, part)
            data = data[part]
    return found


def needed(
    path: KeyPath,
    model: type[BaseModel],
    data: Any = None,
) -> list[str]:
    """Return the keys that are missing: the key at the path itself, or the required keys of a
    missing table.
    """
    inside = _annotation_at(model, path)
    fields = (
        inside.model_fields.items()
        if isinstance(inside, type) and issubclass(inside, BaseModel)
        else ()
    )
    names = [field.alias or name for name, field in fields if field.is_required()]
    keys = [key for name in names for key in needed((*path, name), model, data)]
    return keys or [key_path(path, data)]  # a table may have no required key


def _annotation_at(model: type[BaseModel], path: KeyPath) -> Any:
    """Return the type of the value at a path of keys or names, None for an unknown path."""
    annotation: Any = model
    for part in (each for each in path if isinstance(each, str)):
        table = next(_models_in(annotation), None)
        fields = table.model_fields.items() if table else ()
        annotation = next(
            (field.annotation for name, field in fields if part in (name, field.alias)), None
        )
    return annotation


def sentence(
    problem: Problem, model: type[BaseModel], data: dict[str, Any], by_name: bool = False
) -> str:
    """Return the message of a problem in the terms of the file, or `by_name` in those of Python."""
    key = key_path(problem.path, data)
    what = "name" if by_name else "key"
    if problem.kind == "missing":
        return f"{key} is missing"
    if problem.kind == "extra_forbidden":
        known = _fields_at(model, problem.path[:-1], by_name)
        now = RENAMED.get(str(problem.path[-1]))
        if now in known:
            return f"{key}: this {what} is now {now}"
        close = suggestion(str(problem.path[-1]), known)
        return f"{key} is an unknown {what}{close or ', expected one of ' + ', '.join(known)}"
    if not problem.path:
        return f"expected {problem.expected}"
    names = [part for part in problem.path if isinstance(part, str)]
    alias = (
        _fields_at(model, problem.path[:-1], by_name).get(names[-1], "")
        if by_name and names
        else ""
    )
    has_unit = alias.endswith(("_gpa", "_deg", "_um"))  # of the expected number
    unit = f"{alias} " if has_unit else ""
    return (
        f"{key} = {shown(reduce(_inside, problem.path, data))}, expected {unit}{problem.expected}"
    )


def _fields_at(
    model: type[BaseModel],
    path: KeyPath,
    by_name: bool,
) -> dict[str, str]:
    """Return the file keys of the table at a path, by key or by name of the attribute.

    `provenance` comes last.
    """
    table = next(_models_in(_annotation_at(model, path)), model)
    keys = {name: field.alias or name for name, field in table.model_fields.items()}
    return {
        name if by_name else keys[name]: keys[name]
        for name in sorted(keys, key="provenance".__eq__)
    }


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if (
        get_origin(annotation) is None
        and isinstance(annotation, type)
        and issubclass(annotation, BaseModel)
    ):
        yield annotation
    for inner in get_args(annotation):
        yield from _models_in(inner)


def as_toml(value: Any) -> str:
    """Return a value as TOML on one line; very long integers are clipped."""
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int) and value.bit_length() > 4 * SHOWN:
        return f"{value >> (value.bit_length() - 64)}... ({value.bit_length()} bits)"
    if isinstance(value, Mapping):
        return (
            "{" + ", ".join(f"{as_key(key)} = {as_toml(item)}" for key, item in value.items()) + "}"
        )
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    return value.isoformat() if hasattr(value, "isoformat") else printed(value)
