"""Designs of a study: many at once as arrays, or one as a stage."""

from __future__ import annotations

from typing import Any

from flexfem.arrays import Array
from flexfem.refused import BadInput
from flexfem.stage.designs import Designs, lower
from flexfem.stage.keys import Key, keys
from flexfem.stage.schema import Override, Stage
from flexfem.study.loaded import LoadedStudy


def designs_of(loaded: LoadedStudy, values: Array) -> Designs:
    """The designs whose factors take `values` (n, columns), file units; nothing is checked here."""
    designs = lower(loaded.stage).repeated(len(values))
    for key, column in _settings(loaded):
        for field, place in key.places_in(loaded.stage):
            everywhere: tuple[slice | int, ...] = (slice(None), *place)
            getattr(designs, field)[everywhere] = key.unit * values[:, column]
    return designs


def stage_of(loaded: LoadedStudy, values: Array) -> Stage:
    """The design whose factors take `values` (columns,), file units, as a stage.

    Raises
    ------
    BadInput : a value that no stage file can give; one line that begins with its key.
    """
    stage = loaded.stage
    for key, column in _settings(loaded):
        value = float(values[column])
        expected = key.expected(value)
        if expected is not None:
            raise BadInput(f"{key.path} = {value:g}, expected {expected}")
        stage = _with(stage, key, key.check.validate_python(value))
    return stage


def _settings(loaded: LoadedStudy) -> list[tuple[Key, int]]:
    """Every key set and the column that sets it, single hinges after the three they all are."""
    found = [(keys()[path], index) for index, column in enumerate(loaded.columns) for path in column.keys]
    return sorted(found, key=lambda setting: setting[0].table[:1] == ("override",))


def _with(stage: Stage, key: Key, value: float) -> Stage:
    """The stage with one number replaced; both are valid, so the result is."""
    if key.table[:1] == ("override",):
        return _with_override(stage, int(key.table[1]), key.table[2], key.attribute, value)
    replaced: Stage = _replaced(stage, (*key.table, key.attribute), key.element, value)
    return replaced


def _replaced(old: Any, path: tuple[str, ...], element: int | None, value: float) -> Any:
    if path:
        return old.model_copy(update={path[0]: _replaced(getattr(old, path[0]), path[1:], element, value)})
    return value if element is None else (*old[:element], value, *old[element + 1 :])


def _with_override(stage: Stage, chain: int, hinge: str, attribute: str, value: float) -> Stage:
    overrides = list(stage.override)
    for index, override in enumerate(overrides):
        if (override.chain, override.hinge) == (chain, hinge):
            overrides[index] = override.model_copy(update={attribute: value})
            break
    else:
        overrides.append(Override.from_names({"chain": chain, "hinge": hinge, attribute: value}))
    return stage.model_copy(update={"override": tuple(overrides)})
