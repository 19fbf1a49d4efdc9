"""Hashes of plain data and of arrays: what an answer is of, whatever the order of keys."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from flexfem.arrays import AnyArray


def digest(content: Any) -> str:
    """SHA-256 of plain data, as JSON."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def digest_of_arrays(arrays: Mapping[str, AnyArray]) -> str:
    """SHA-256 of named arrays, with their types and shapes."""
    found = hashlib.sha256()
    for name in sorted(arrays):
        found.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        found.update(np.ascontiguousarray(arrays[name]).tobytes())
    return found.hexdigest()


def canonical(value: Any) -> Any:
    """Plain data with every number as a float, -0.0 as 0.0, and tuples as lists."""
    if isinstance(value, dict):
        return {key: canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    return float(value) + 0.0
