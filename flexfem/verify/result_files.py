"""Results of `flexfem verify` as files: numbers as JSON, fields beside it as .npz."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from flexfem.files.refusals import SHOWN, one_line, place_of
from flexfem.files.toml import kind_of, read_bytes, read_toml
from flexfem.files.writing import read_arrays, write_atomically
from flexfem.refused import BadInput
from flexfem.verify.result import Fields, Result, write_record

LARGEST = 2**26  # bytes of a stored answer


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
    return write_record(result, folder / f"{result.case}.json")


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read a stored result. Raises BadInput when it is none."""
    content = stored_json(path)
    try:
        return Result.model_validate_json(content)
    except ValidationError as error:
        raise BadInput(f"{place_of(path)}: {_no_result(path, content, error)}") from None


def stored_json(path: str | os.PathLike[str]) -> bytes:
    """Content of a stored answer. Raises BadInput for what is no regular file or too large for one."""
    return read_bytes(Path(path), LARGEST)


def stores(path: str | os.PathLike[str], *keys: str) -> bool:
    """Whether a file is plainly JSON with all these keys; what else it may be is not looked at."""
    try:
        data = json.loads(stored_json(path))
    except (BadInput, ValueError, RecursionError):
        return False  # whoever reads it says what is wrong
    return isinstance(data, dict) and {*keys} <= {*data}


def first_mistake(error: ValidationError) -> str:
    """Where stored JSON is not what it is to be, and why, in one line."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, (*first["loc"], *first.get("ctx", {}).get("at", ()))))
    return one_line(f"{where}: {first['msg']}" if where else first["msg"], 3 * SHOWN)


def _no_result(path: str | os.PathLike[str], content: bytes, error: ValidationError) -> str:
    """What a file is that is no result: of another kind, of another version, or damaged."""
    if error.errors(include_url=False)[0]["type"] == "json_invalid":
        with contextlib.suppress(BadInput):
            if data := read_toml(path).data:
                return f"this is a {kind_of(data) or 'TOML file'}, expected a result of flexfem verify, <case>.json"
        return "not a result of flexfem verify: no JSON"
    keys = json.loads(content)
    if not isinstance(keys, dict) or not {"case", "curves"} <= set(keys):
        return "this is JSON, but not a result of flexfem verify, <case>.json"
    return f"not a result of this version of flexfem verify, which would make it again: {first_mistake(error)}"


def read_fields(path: str | os.PathLike[str], result: Result) -> dict[str, Fields]:
    """Read the fields stored beside a result. Raises BadInput when they are missing or of another result."""
    beside = Path(path).with_suffix(".npz")
    arrays = read_arrays(beside, f"the fields of {path}")
    try:
        return {
            label: Fields(**{key: arrays[f"{index}.{key}"] for key in Fields.model_fields})
            for index, label in enumerate(result.curves)
        }
    except KeyError as error:
        raise BadInput(f"{beside}: expected the fields of {path}: it has no {error}") from None
