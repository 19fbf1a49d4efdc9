"""Derived outputs and constraints of designs: arithmetic on factors, outputs and the keys of the stage."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, MutableMapping
from typing import NamedTuple, cast

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.stage.keys import Key, keys
from flexfem.study.designs import designs_of
from flexfem.study.expression import names_in, value_of
from flexfem.study.loaded import LoadedStudy


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
    ((field, (chain, hinge)),) = key.places_in(loaded.stage)
    return np.asarray(getattr(designs, field)[:, chain, hinge] / key.unit)
