"""Stored answers as files: records as JSON with a digest, the fields of `flexfem verify` beside it as .npz."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from flexfem.files.refusals import SHOWN, one_line, place_of
from flexfem.files.toml import kind_of, read_bytes, read_toml
from flexfem.files.writing import digest, digest_of_arrays, read_arrays, write_atomically
from flexfem.refused import BadInput
from flexfem.verify.result import DIGEST, Fields, Record, Result, write_record

LARGEST = 2**26  # bytes of a stored answer
FIELDS = "fields"  # key of a stored result: digest of its fields
Stored = TypeVar("Stored", bound=Record)


def write_result(result: Result, fields: dict[str, Fields], folder: Path) -> Path:
    """Store a result as `<case>.json`, its fields as `<case>.npz`; returns the path of the former."""
    arrays = {
        f"{index}.{key}": value
        for index, label in enumerate(result.curves)
        for key, value in fields[label].model_dump().items()
    }
    write_atomically(
        folder / f"{result.case}.npz", lambda file: np.savez_compressed(file, allow_pickle=False, **arrays)
    )
    return write_record(result, folder / f"{result.case}.json", **{FIELDS: digest_of_arrays(arrays)})


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read a stored result. Raises BadInput when it is none, or not as it was stored."""
    return read_record(path, Result, "flexfem verify", "case", "curves")


def read_record(path: str | os.PathLike[str], kind: type[Stored], command: str, *keys: str) -> Stored:
    """Read a stored record of a kind that a command stores, and that has all these keys.

    Raises BadInput when it is none, it is not what was stored, or another version stored it.
    """
    data = _sealed(path, command, keys)
    data.pop(FIELDS, None)
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


def read_fields(path: str | os.PathLike[str], result: Result) -> dict[str, Fields]:
    """Read the fields stored beside a result. Raises BadInput when they are missing or of another result."""
    beside = Path(path).with_suffix(".npz")
    arrays = read_arrays(beside, f"the fields of {path}")
    if digest_of_arrays(arrays) != _sealed(path, "flexfem verify").get(FIELDS):
        said = f"not the fields that were stored with {place_of(path)}: flexfem verify makes both again"
        raise BadInput(f"{place_of(beside)}: {said}")
    return {
        label: Fields(**{key: arrays[f"{index}.{key}"] for key in Fields.model_fields})
        for index, label in enumerate(result.curves)
    }


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
