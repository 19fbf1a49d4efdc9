"""What the model says beside a study's designs: of the base stage itself, and of factors that change nothing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.keys import keys
from flexfem.study.columns import Factor, columns_of
from flexfem.study.designs import judge
from flexfem.study.expression import names_in
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import COUPLINGS, CROSS
from flexfem.study.sampling import at_quantile, sample
from flexfem.study.tables import Sampling

if TYPE_CHECKING:
    pass

FIXED = "thickness_mm"  # every stage gives it; the one factor of a study that varies nothing
BASES, MOVED = (0.37, 0.61), (0.11, 0.89)  # quantiles of all factors, and of one that is moved
LOOKED_AT = 1000  # rows of a table of designs
ROUND_OFF = 1e-10  # of the size of an output


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Outputs of the base stage by column, and the factors it has one value of; no outputs when it has no answer."""
    from flexfem.study.answer import answer

    factors = (Factor.model_validate({"key": FIXED, "values": [keys()[FIXED].value_in(loaded.stage)]}),)
    changes = {"factor": factors, "sampling": Sampling(method="grid"), "bands": False}
    changes |= {"correlation": (), "constraint": ()}
    study = loaded.study.model_copy(update=changes)
    alone = replace(loaded, study=study, columns=columns_of(factors), given=None)
    rows = answer(alone, 0, 1)
    found = own_values(loaded)
    if rows.status[0] == "ok":
        found |= dict(zip(study.outputs, map(float, rows.values[0]), strict=True))
        found |= _derived(alone, found)
    return found


def _derived(alone: LoadedStudy, found: dict[str, float]) -> dict[str, float]:
    """Derived outputs of the base stage, those that are finite."""
    columns = {name: np.array([value]) for name, value in found.items()} | {
        FIXED: np.array([keys()[FIXED].value_in(alone.stage)])
    }
    every = judge(alone, columns, np.array([True])).derived
    return {name: float(value[0]) for name, value in every.items() if np.isfinite(value[0])}


def own_values(loaded: LoadedStudy) -> dict[str, float]:
    """The base stage's values of the factors, in file units, by column; none where its keys differ."""
    found = {}
    for column in loaded.columns:
        values = {keys()[path].value_in(loaded.stage) for path in column.keys}
        value = values.pop()
        if not values and value is not None:
            found[column.name] = value
    return found


def unseen(loaded: LoadedStudy) -> list[str]:
    """Warnings on factors that change none of the outputs that a study shows or constrains, of all where it does not.

    Notes
    -----
    Found by the model itself: designs that differ in one factor alone, compared output by output. Finite elements mesh
    what a factor changes, and are not asked.
    """
    if loaded.study.model != "analytic":
        return []
    changes, shown = _changes(loaded), _shown(loaded)
    found = []
    for name, outputs in changes.items():
        if outputs is not None and not outputs & set(shown):
            others = f"; it changes {', '.join(sorted(outputs))} alone" if outputs else ""
            found.append(f"factor {name} changes none of {', '.join(shown)} in this model{others}")
    return found


def _shown(loaded: LoadedStudy) -> list[str]:
    """Outputs of the model that figures and constraints ask for, themselves or through derived ones."""
    study = loaded.study
    asked = {name for figure in study.figure for name, _ in figure.columns.values()}
    asked |= {name for constraint in study.constraint for name in _all_names(loaded, [constraint.value])}
    asked |= set(_all_names(loaded, [output.expression for output in study.output if output.name in asked]))
    return [name for name in loaded.outputs if name in asked] or list(loaded.outputs)


def _all_names(loaded: LoadedStudy, expressions: Iterable[str]) -> set[str]:
    full = (text for expression in expressions for text in loaded.study.in_full(expression))
    return {name for text in full for name in names_in(text)}


def _changes(loaded: LoadedStudy) -> dict[str, set[str] | None]:
    """Outputs that each factor changes, by column; None where it takes one value, or no pair of designs has answers."""
    from flexfem.study.answer import answer_designs

    rows, pairs = _probes(loaded)
    free = loaded.study.model_copy(update={"check": "closed_form", "constraint": ()})
    answers = answer_designs(replace(loaded, study=free), rows).values
    size = _sizes(loaded, answers)
    found: dict[str, set[str] | None] = {}
    for index, column in enumerate(loaded.columns):
        steps = [
            np.abs(answers[moved] - answers[base]) > ROUND_OFF * size[base]
            for which, base, moved in pairs
            if which == index and np.isfinite(answers[[base, moved]]).all() and rows[base, index] != rows[moved, index]
        ]
        moved_at_all = np.any(steps, axis=0) if steps else None
        found[column.name] = (
            None if moved_at_all is None else {n for n, m in zip(loaded.outputs, moved_at_all, strict=True) if m}
        )
    return found


def _probes(loaded: LoadedStudy) -> tuple[Array, list[tuple[int, int, int]]]:
    """Designs (n, columns), and pairs of them that differ in one column: its number, and both places."""
    bases, ends = _values(loaded)
    rows, pairs = list(bases), list[tuple[int, int, int]]()
    for index in range(len(loaded.columns)):
        for base in range(len(bases)):
            for end in ends[:, index]:
                pairs.append((index, base, len(rows)))
                rows.append(np.where(np.arange(len(bases[base])) == index, end, bases[base]))
    return np.array(rows), pairs


def _values(loaded: LoadedStudy) -> tuple[Array, Array]:
    """Designs to begin from, and values to move each factor to, (., columns); few where links bend: 0.1 s a design."""
    if loaded.given is not None:
        rows = sample(loaded, 0, LOOKED_AT)
        bases, ends = rows[[0, -1]], np.array([rows.min(axis=0), rows.max(axis=0)])
    else:
        factors = [column.factor for column in loaded.columns]
        bases, ends = (
            np.stack([at_quantile(factor, np.array(u)) for factor in factors], axis=-1) for u in (BASES, MOVED)
        )
    return (bases[:1], ends[:1]) if loaded.study.links else (bases, ends)


def _sizes(loaded: LoadedStudy, answers: Array) -> Array:
    """What a change of each output is small against, (n, outputs): of what is zero by symmetry, what it couples."""
    place = {name: index for index, name in enumerate(loaded.outputs)}
    size = np.abs(answers)
    for name, (one, other) in CROSS.items():
        size[:, place[name]] = np.sqrt(np.abs(answers[:, place[one]] * answers[:, place[other]]))
    size[:, [place[name] for name in COUPLINGS]] = 1.0
    return size
