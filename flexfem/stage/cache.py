"""What was computed of the last stage: one design is drawn several times on its way from check to mesh."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

Given = ParamSpec("Given")
Found = TypeVar("Found")


def of_last_stage(compute: Callable[Concatenate[Stage, Given], Found]) -> Callable[Concatenate[Stage, Given], Found]:
    """Let a function of a stage (and other arguments) remember its results for the stage it was last called with.

    The stage is known by identity, which is enough as it is frozen. All callers get the same: arrays, alone or in a
    tuple, are made read-only, and what else there is should be frozen by itself.
    """
    memory: list[tuple[Any, dict[tuple[Any, ...], Found]]] = [(None, {})]

    @wraps(compute)
    def remembering(stage: Stage, /, *given: Given.args, **named: Given.kwargs) -> Found:
        known, found = memory[0]
        if known is not stage:
            found = {}
            memory[0] = (stage, found)  # one assignment, so that threads at worst compute twice
        key = (given, tuple(named.items()))
        if key not in found:
            found[key] = _read_only(compute(stage, *given, **named))
        return found[key]

    return remembering


def _read_only(found: Found) -> Found:
    for part in found if isinstance(found, tuple) else (found,):
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return found
