"""Stored answers as files: records as JSON with a digest, the fields of `flexfem verify` beside it as .npz."""

from __future__ import annotations

import contextlib
import json
import os
from typing import Any, TypeVar

from pydantic import ValidationError

from flexfem.files.refusals import SHOWN, one_line, place_of
from flexfem.files.toml import kind_of, read_bytes, read_toml
from flexfem.files.writing import digest
from flexfem.refused import BadInput
from flexfem.verify.result import DIGEST, Record

LARGEST = 2**26  # bytes of a stored answer
Stored = TypeVar("Stored", bound=Record)


def read_record(path: str | os.PathLike[str], kind: type[Stored], command: str, *keys: str) -> Stored:
    """Read a stored record of a kind that a command stores, and that has all these keys.

    Raises BadInput when it is none, it is not what was stored, or another version stored it.
    """
    data = _sealed(path, command, keys)
    try:
        return kind.model_validate_json(json.dumps(data))
    except ValidationError as error:
        said = f"not what this version of {command} stores, which makes it again: {_first_mistake(error)}"
        raise BadInput(f"{place_of(path)}: {said}") from None


def stores(path: str | os.PathLike[str], *keys: str) -> bool:
    """Whether a file is plainly JSON with all these keys; what else it may be is not looked at."""
    try:
        data = json.loads(read_bytes(path, LARGEST))
    except (BadInput, ValueError, RecursionError):
        return False  # whoever reads it says what is wrong
    return isinstance(data, dict) and {*keys} <= {*data}


def _sealed(path: str | os.PathLike[str], command: str, keys: tuple[str, ...] = ()) -> dict[str, Any]:
    """What a stored answer says beside its digest, which is checked. Raises BadInput."""
    content, place = read_bytes(path, LARGEST), place_of(path)
    try:
        data = json.loads(content)
    except (ValueError, RecursionError):
        raise BadInput(f"{place}: {_no_json(path, command)}") from None
    if not isinstance(data, dict) or not {*keys} <= {*data}:
        raise BadInput(f"{place}: this is JSON, but not a result of {command}")
    told = data.pop(DIGEST, None)
    if told is None:
        raise BadInput(f"{place}: has no digest, as what earlier versions stored: {command} makes it again")
    try:
        same = told == digest(data)
    except (ValueError, RecursionError):  # such as nan
        same = False
    if not same:
        raise BadInput(
            f"{place}: changed since it was stored, its digest is of other content: {command} makes it again"
        )
    return data


def _no_json(path: str | os.PathLike[str], command: str) -> str:
    """What a file is that is no JSON."""
    with contextlib.suppress(BadInput):
        if data := read_toml(path).data:
            return f"this is a {kind_of(data) or 'TOML file'}, expected a result of {command}, <case>.json"
    return f"not a result of {command}: no JSON"


def _first_mistake(error: ValidationError) -> str:
    """Where stored JSON is not what it is to be, and why, in one line."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, (*first["loc"], *first.get("ctx", {}).get("at", ()))))
    return one_line(f"{where}: {first['msg']}" if where else first["msg"], 3 * SHOWN)
