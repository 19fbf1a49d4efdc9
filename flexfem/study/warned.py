"""What to know of the answers of a study: formulas out of their range, factors that nothing depends on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.study.expression import names_in
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import COUPLINGS, CROSS
from flexfem.study.sampling import at_quantile, sample

if TYPE_CHECKING:
    from flexfem.study.rows import Rows

BASES, MOVED = (0.37, 0.61), (0.11, 0.89)  # quantiles of all factors, and of one that is moved
LOOKED_AT = 1000  # rows of a table of designs
ROUND_OFF = 1e-10  # of the size of an output


def doubted(loaded: LoadedStudy, values: Array, rows: Rows) -> Rows:
    """The rows of designs (n, columns), with a reason where an answer is from a formula outside its range."""
    where = (rows.status == "ok") & outside(loaded, values)
    if not where.any():
        return rows
    text = f"hinge formula {loaded.study.formula} outside its range of t/R"
    return rows._replace(reason=np.where(where, text, rows.reason).astype(object))


def outside(loaded: LoadedStudy, values: Array) -> AnyArray:
    """Which designs (n,) have a hinge for which the study's formula is not meant."""
    if loaded.study.model == "fe":
        return np.zeros(len(values), dtype=bool)
    from flexfem.analytic.model import in_range
    from flexfem.study.designs import designs_of

    with np.errstate(all="ignore"):
        inside = in_range(designs_of(loaded, values), loaded.study.formula)
    return np.asarray(~inside.all(axis=(1, 2)))


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
    from flexfem.study.analytic import answer_designs

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
