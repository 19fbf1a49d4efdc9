"""Derived outputs and constraints of designs: expressions of factors, outputs and keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.files.expressions import names_in, value_of
from flexfem.study.loaded import LoadedStudy


class Judged(NamedTuple):
    """Derived outputs (n,) by name, nan where not finite, and which designs (n,) keep all
    constraints.
    """

    derived: dict[str, Array]
    feasible: AnyArray


def judge(
    loaded: LoadedStudy,
    columns: Mapping[str, Array],
    ok: AnyArray,
) -> Judged:
    """Evaluate the derived outputs and constraints of designs.

    columns : factors and outputs of the model, (n,) each, by name, file units.   ok : which have a
    result, bool (n,).
    """
    study = loaded.study
    known = dict(columns)
    feasible = np.array(ok, dtype=bool)
    derived = dict[str, Array]()
    for output in study.output:
        value = evaluated(loaded, output.expression, known, len(ok))
        derived[output.name] = np.where(ok & np.isfinite(value), value, np.nan)
        known[output.name] = derived[output.name]
    for constraint in study.constraint:
        feasible &= ~constraint.broken(evaluated(loaded, constraint.value, known, len(ok)))
    return Judged(derived, feasible)


def refusals_of(loaded: LoadedStudy, values: Array) -> AnyArray:
    """Return reasons (n,) to refuse designs with factor values (n, columns), "" where there is
    none.

    Constraints on factors and keys only are evaluated here, before designs are solved.
    """
    reason = np.full(len(values), "", dtype=object)
    names = [column.name for column in loaded.columns]
    known = dict(zip(names, values.T, strict=True))
    for constraint in loaded.study.refusing:
        value = evaluated(loaded, constraint.value, known, len(values))
        for index in np.flatnonzero(constraint.broken(value) & (reason == "")):
            reason[index] = (
                f"constraint {constraint.title} = {value[index]:.6g}, expected "
                f"{constraint.expected}"
            )
    return reason


def evaluated(
    loaded: LoadedStudy,
    expression: str,
    known: dict[str, Array],
    size: int,
) -> Array:
    """Return the value (size,) of an expression in file units; nan where a column is missing.

    known : factors and outputs, (n,) each, by name; derived outputs and keys that are used are
    added to them.
    """
    derived = {output.name: output.expression for output in loaded.study.output}
    for name in names_in(expression):
        if name in known:
            continue
        if name in derived:
            known[name] = evaluated(loaded, derived[name], known, size)
        else:
            known[name] = loaded.family.values_of_key(name, known)
    return np.broadcast_to(value_of(expression, known), (size,))
