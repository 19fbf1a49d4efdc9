"""Answers as plain data, for machines and baselines."""

from __future__ import annotations

import math
from typing import Any


def plain(value: Any) -> Any:
    """Records, named tuples and arrays as plain data: the keys of the JSON are the names of fields and properties.

    A number that is not finite is None.
    """
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        said = [name for name, part in vars(type(value)).items() if isinstance(part, property)]
        value = value._asdict() | {name: getattr(value, name) for name in said}
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.tolist() if hasattr(value, "tolist") else value
