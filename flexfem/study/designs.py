"""Designs of a study: many at once as arrays, or one as a stage; and what its expressions make of them."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, MutableMapping
from typing import Any, NamedTuple, Protocol, cast

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.keys import Key, keys
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import actuators_of, merged_changes
from flexfem.refused import BadInput
from flexfem.study.columns import Column
from flexfem.study.expression import names_in, value_of
from flexfem.study.loaded import LoadedStudy


class Varied(Protocol):
    """A stage and the columns that set numbers of it: a study that is loaded, for one."""

    @property
    def stage(self) -> Stage: ...

    @property
    def columns(self) -> tuple[Column, ...]: ...


def designs_of(loaded: Varied, values: Array) -> Designs:
    """The designs whose factors take `values` (n, columns), file units; nothing is checked here."""
    designs = lower(loaded.stage).repeated(len(values))
    for key, column in _settings(loaded):
        for field, place in key.places_in(loaded.stage):
            everywhere: tuple[slice | int, ...] = (slice(None), *place)
            getattr(designs, field)[everywhere] = key.unit * values[:, column]
    return designs


def stage_of(loaded: Varied, values: Array) -> Stage:
    """The design whose factors take `values` (columns,), file units, as a stage.

    Raises
    ------
    BadInput : a value that no stage file can give; one line that begins with its key.
    """
    changes: dict[str, Any] = {}
    for key, column in _settings(loaded):
        value = float(values[column])
        expected = key.expected(value)
        if expected is not None:
            raise BadInput(f"{key.path} = {value:g}, expected {expected}")
        _set(changes, loaded.stage, key, key.check.validate_python(value))
    held = loaded.stage.model_dump(exclude_unset=True, exclude={"provenance"})
    return Stage.from_names(merged_changes(held, changes))


def _settings(loaded: Varied) -> list[tuple[Key, int]]:
    """Every key set and the column that sets it, those of one chain after those of all three."""
    found = [(keys()[path], index) for index, column in enumerate(loaded.columns) for path in column.keys]
    return sorted(found, key=lambda setting: setting[0].table[:1] == ("override",))


def _set(changes: dict[str, Any], stage: Stage, key: Key, value: float) -> None:
    """Set a number in changes as `Stage.replace` takes them; of an array all, those not set from the stage."""
    if key.of_drive:
        _set_of_drive(changes, stage, key, value)
        return
    if key.table[:1] == ("override",):
        place = int(key.table[1]), key.table[2]
        changes.setdefault("override", {}).setdefault(place, {})[key.attribute] = value
        return
    table, held = changes, stage
    for name in key.table:
        table, held = table.setdefault(name, {}), getattr(held, name)
    if key.element is None:
        table[key.attribute] = value
    else:
        table[key.attribute] = list(table.get(key.attribute, getattr(held, key.attribute)))
        table[key.attribute][key.element] = value


def _set_of_drive(changes: dict[str, Any], stage: Stage, key: Key, value: float) -> None:
    """As `_set`, of an actuator: of all chains, or of one as its override has it."""
    name = key.table[-1]
    place = [each.name for each in stage.actuator].index(name)
    if key.table[0] == "override":
        chain = int(key.table[1])
        held = actuators_of(stage)[chain - 1][place]
        table = changes.setdefault("override", {}).setdefault((chain, "actuator", name), {})
    else:
        held = stage.actuator[place]
        table = changes.setdefault("actuator", [one.model_dump(exclude_unset=True) for one in stage.actuator])[place]
    if key.element is None:
        table[key.attribute] = value
    else:
        table[key.attribute] = list(table.get(key.attribute) or getattr(held, key.attribute))
        table[key.attribute][key.element] = value


class Judged(NamedTuple):
    """Derived outputs (n,) by name, nan where there is no finite value, and whether a design keeps all constraints."""

    derived: dict[str, Array]
    feasible: AnyArray


def judge(loaded: LoadedStudy, columns: Mapping[str, Array], ok: AnyArray) -> Judged:
    """Derived outputs and constraints of designs.

    Parameters
    ----------
    columns : factors and outputs of the model, (n,) each, by name, file units.   ok : which have an answer, bool (n,).
    """
    known = ChainMap[str, Array]({}, cast("MutableMapping[str, Array]", columns))  # which may be read one by one
    feasible = np.array(ok, dtype=bool)
    for output in loaded.study.output:
        found = evaluated(loaded, output.expression, known, len(ok))
        known[output.name] = np.where(ok & np.isfinite(found), found, np.nan)
    for constraint in loaded.study.constraint:
        feasible &= ~constraint.broken(evaluated(loaded, constraint.value, known, len(ok)))
    return Judged({output.name: known[output.name] for output in loaded.study.output}, feasible)


def refusals_of(loaded: LoadedStudy, values: Array) -> AnyArray:
    """Why designs whose factors take `values` (n, columns) are not worth an answer, text (n,), "" where they are.

    A constraint that asks for factors and keys alone is decided here, before anything is solved.
    """
    reason = np.full(len(values), "", dtype=object)
    known = {column.name: values[:, index] for index, column in enumerate(loaded.columns)}
    for output in loaded.study.output:
        if loaded.study.is_given(output.expression):
            known[output.name] = evaluated(loaded, output.expression, known, len(values))
    for constraint in loaded.study.constraint:
        if loaded.study.is_given(constraint.value):
            found = evaluated(loaded, constraint.value, known, len(values))
            for place in np.flatnonzero(constraint.broken(found) & (reason == "")):
                reason[place] = f"constraint {constraint.said} = {found[place]:.6g}, expected {constraint.expected}"
    return reason


def evaluated(loaded: LoadedStudy, expression: str, columns: Mapping[str, Array], size: int) -> Array:
    """Value (size,) of an expression of columns by name, and keys, in file units; nan where one is missing."""
    found = {name: _named(loaded, name, columns) for name in names_in(expression)}
    return np.broadcast_to(value_of(expression, found), (size,))


def _named(loaded: LoadedStudy, name: str, columns: Mapping[str, Array]) -> Array:
    if name in columns:
        return columns[name]
    return _of_key(loaded, keys()[name], columns) if name in keys() else np.full(1, np.nan)


def _of_key(loaded: LoadedStudy, key: Key, columns: Mapping[str, Array]) -> Array:
    """Values (n,) or (1,) of a key of the stage file, file units: what a factor sets, else the stage's own."""
    for column in loaded.columns:
        if key.path in column.keys:
            return columns[column.name]
    if key.table[:1] != ("override",):
        return np.full(1, key.value_in(loaded.stage), dtype=np.float64)
    designs = designs_of(loaded, np.column_stack([columns[column.name] for column in loaded.columns]))
    ((field, place),) = key.places_in(loaded.stage)
    return np.asarray(getattr(designs, field)[:, *place] / key.unit)
