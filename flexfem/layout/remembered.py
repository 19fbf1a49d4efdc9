"""What was computed of the last stage: one design is drawn several times on its way from check to mesh."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

if TYPE_CHECKING:
    from flexfem.design import Stage

Given = ParamSpec("Given")
Found = TypeVar("Found")


def of_last_stage(compute: Callable[Concatenate[Stage, Given], Found]) -> Callable[Concatenate[Stage, Given], Found]:
    """Let a function of a stage (and other arguments) remember its results for the stage it was last called with.

    The stage is known by identity, which is enough as it is frozen; callers must not change what they get.
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
            found[key] = compute(stage, *given, **named)
        return found[key]

    return remembering
