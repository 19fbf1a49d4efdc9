"""Results of `flexfem verify` as files: numbers as JSON, fields beside it as .npz."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from flexfem.files.refusals import place_of
from flexfem.files.toml import kind_of, read_toml
from flexfem.files.writing import read_arrays, write_atomically
from flexfem.refused import BadInput
from flexfem.verify.result import Fields, Result, write_record


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
    try:
        return Result.model_validate_json(Path(path).read_bytes())
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{place_of(path)}: {_no_result(path, error)}") from None


def _no_result(path: str | os.PathLike[str], error: ValidationError) -> str:
    """What a file is that is no result: of another kind, of another version, or damaged."""
    first = error.errors(include_url=False)[0]
    if first["type"] == "json_invalid":
        with contextlib.suppress(BadInput):
            found = kind_of(read_toml(path).data)
            return f"this is a {found or 'TOML file'}, expected a result of flexfem verify, <case>.json"
        return "not a result of flexfem verify: no JSON"
    keys = json.loads(Path(path).read_bytes())
    if not isinstance(keys, dict) or not {"case", "curves"} <= set(keys):
        return "this is JSON, but not a result of flexfem verify, <case>.json"
    where = ".".join(map(str, first["loc"]))
    return f"not a result of this version of flexfem verify, which would make it again: {where}: {first['msg']}"


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
