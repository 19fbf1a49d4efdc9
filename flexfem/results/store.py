"""Documents of results: JSON with a digest, and its schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.files.refusals import place_of
from flexfem.files.toml import PathLike, read_bytes
from flexfem.files.writing import digest, write_atomically
from flexfem.refused import BadInput
from flexfem.results.declare import About, Arrays, Declared, Quantity

PACKAGES = ("flexfem", "numpy", "scipy", "scikit-fem", "gmsh")
FORMAT = 1  # version of the JSON documents
DRAFT = "http://json-schema.org/draft-07/schema#"
LARGEST_FILE = 2**26  # bytes, largest stored result
UNLIMITED = "unlimited"


def document(result: Declared) -> dict[str, Any]:
    """Return the JSON document: numbers in the declared units, null where there is no value."""
    about = {
        key: list(part) if isinstance(part, tuple) else part
        for key, part in result.about._asdict().items()
    }
    return {
        "result": result.kind(),
        "format": FORMAT,
        **about,
        "settings": result.settings,
        "axes": {axis: list(labels) for axis, labels in result.axes.items()},
        "quantities": {name: _stored_quantity(result, name) for name in result.values},
        "warnings": result.warnings,
        "notes": result.notes,
    }


def _stored_quantity(result: Declared, name: str) -> dict[str, Any]:
    quantity = result.quantities[name]
    found = {
        "meaning": quantity.meaning,
        "unit": np.array(quantity.unit).tolist(),
        "over": list(quantity.over),
        "values": _nested(result.values[name]),
    }
    if name in result.bands:
        found["bands"] = _nested(result.bands[name])
    return found


def stored_about(data: Mapping[str, Any]) -> About:
    """Return the subject of a document. Raises KeyError where a key is missing."""
    return About(**{key: data[key] for key in About._fields})


def stored_arrays(kind: type[Declared], data: Mapping[str, Any]) -> Arrays:
    """Return values and bands of a document of a kind of result, in internal units.

    Raises KeyError, TypeError or ValueError for a document of another format.
    """
    found = Arrays({}, {})
    for name, stored in data["quantities"].items():
        for part, arrays in zip(("values", "bands"), found, strict=True):
            if part in stored:
                array = np.array(_numbers(stored[part]), dtype=float)
                arrays[name] = array / kind.quantities[name].factors(array.shape)
    return found


def schema_of_kind(kind: type[Declared]) -> dict[str, Any]:
    """Return the JSON schema of the document of a kind of result."""
    text = {"type": "string"}
    texts = {"type": "array", "items": text}
    quantities = {name: _schema_of_quantity(one) for name, one in kind.quantities.items()}
    properties = {
        "result": {"const": kind.kind()},
        "format": {"const": FORMAT},
        **dict.fromkeys(("name", "file", "hash", "digest"), text),
        **dict.fromkeys(("assumed", "not_stated", "warnings", "notes"), texts),
        "lever": {"type": "number", "description": "mm"},
        "settings": {"type": "object"},
        "axes": {"type": "object", "additionalProperties": texts},
        "quantities": {
            "type": "object",
            "properties": quantities,
            "additionalProperties": False,
        },
        "versions": {"type": "object", "additionalProperties": text},
    }
    whole = _schema_of_table(f"flexfem: {kind.title}", properties, "digest")
    return {"$schema": DRAFT, **whole}


def _schema_of_quantity(one: Quantity) -> dict[str, Any]:
    values: dict[str, Any] = {"type": ["number", "null", "string"]}
    for _ in one.over:
        values = {"type": "array", "items": values}
    parts = {
        "meaning": {"type": "string"},
        "unit": {"const": np.array(one.unit).tolist()},
        "over": {"const": list(one.over)},
        "values": values,
        "bands": values,
    }
    return _schema_of_table(one.meaning, parts, "bands")


def _schema_of_table(
    description: str,
    properties: dict[str, Any],
    optional: str,
) -> dict[str, Any]:
    """Return the JSON schema of an object with these keys and no others."""
    return {
        "description": description,
        "type": "object",
        "properties": properties,
        "required": [key for key in properties if key != optional],
        "additionalProperties": False,
    }


def write_sealed(path: Path, content: Mapping[str, Any]) -> Path:
    """Store a document as JSON with its digest; return the path.

    Raises BadInput when it cannot be written.
    """
    data = json.loads(json.dumps(content, allow_nan=False))
    text = json.dumps(data | {"digest": digest(data)}, indent=1, allow_nan=False)
    write_atomically(path, lambda file: file.write(f"{text}\n".encode()))
    return path


def unsealed(path: PathLike) -> dict[str, Any]:
    """Return a stored document without its digest.

    Raises BadInput for other files and for changed documents.
    """
    try:
        data: dict[str, Any] = json.loads(read_bytes(path, LARGEST_FILE))
        stated = data.pop("digest")
        is_same = stated == digest(data)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise BadInput(f"{place_of(path)}: expected a result that flexfem stored as JSON") from None
    if not is_same:
        raise BadInput(f"{place_of(path)}: changed since it was stored, its digest does not match")
    return data


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of the packages that affect numbers."""
    found = dict.fromkeys(PACKAGES, "not installed as a package")
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _nested(values: Array) -> Any:
    """Return an array as nested lists: null for nan, "unlimited" for infinity."""
    found = np.array(values, dtype=object)
    found[np.isnan(values)] = None
    found[values == np.inf] = UNLIMITED
    found[values == -np.inf] = f"-{UNLIMITED}"
    return found.tolist()


def _numbers(value: Any) -> Any:
    """Return nested lists of a document with nan for null and infinity for "unlimited"."""
    if isinstance(value, list):
        return [_numbers(each) for each in value]
    return {None: np.nan, UNLIMITED: np.inf, f"-{UNLIMITED}": -np.inf}.get(value, value)
