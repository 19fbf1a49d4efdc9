"""What was computed of a stage is kept with it: one design is drawn several times on its way from check to mesh."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

Of = TypeVar("Of")  # a stage
Given = ParamSpec("Given")
Found = TypeVar("Found")
KEPT = "kept"  # in a stage's own dictionary: no field of it, and no part of its hash, copies or pickles


def once(compute: Callable[Concatenate[Of, Given], Found]) -> Callable[Concatenate[Of, Given], Found]:
    """Let a function of a stage (and other arguments) compute once for each stage, which is frozen.

    All callers get the same: arrays, alone or in a tuple, are made read-only, and what else there is should be frozen.
    """

    @wraps(compute)
    def keeping(stage: Of, /, *given: Given.args, **named: Given.kwargs) -> Found:
        kept: dict[Any, Any] = stage.__dict__.setdefault(KEPT, {})
        key = (compute, given, tuple(named.items()))
        if key not in kept:
            kept[key] = _read_only(compute(stage, *given, **named))
        found: Found = kept[key]
        return found

    return keeping


def _read_only(found: Found) -> Found:
    for part in found if isinstance(found, tuple) else (found,):
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return found
