"""The analytic model of many designs at once: a chunk of factor values in, rows out, no loop over designs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.chains import travel
from flexfem.analytic.links import body_compliance
from flexfem.analytic.mobility import freedoms_of, stage_freedoms
from flexfem.analytic.model import at_rest, hinge_compliances, unanswered
from flexfem.arrays import AnyArray, Array
from flexfem.refused import BadInput
from flexfem.stage.designs import envelope
from flexfem.stage.feasibility import Broken, broken, check_feasible, conditions
from flexfem.stage.keys import keys
from flexfem.study.derived import refusals_of
from flexfem.study.designs import designs_of, stage_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import common_columns, travel_columns


class Answers(NamedTuple):
    """Reasons (n,) why designs are refused, "" where they are not, and values (n, outputs), nan where they are."""

    reason: AnyArray
    values: Array


def answer_designs(loaded: LoadedStudy, values: Array) -> Answers:
    """Answer the designs whose factors take `values` (n, columns), file units."""
    study = loaded.study
    with np.errstate(all="ignore"):  # an impossible design computes nonsense, and is refused
        designs = designs_of(loaded, values)
        hinges = hinge_compliances(designs, study.formula)
        refused = [*broken(conditions(designs)), *unanswered(designs, study.formula, hinges)]
        reason = _first([*_off_limits(loaded, values), *refused])
        reason = np.where(reason == "", refusals_of(loaded, values), reason)
        freedoms = stage_freedoms(designs.prismatic) if study.mobility is None else freedoms_of(study.mobility)
        bodies = _drawn(loaded, values, reason) if study.draws or study.links else None
        found = at_rest(designs, hinges, freedoms, bodies if study.links else None)
        reason[np.isnan(found.stiffness[:, 0, 0]) & (reason == "")] = "chain: singular configuration at rest"
        highest, size = np.max(found.stress, axis=(1, 2)), envelope(designs)
        columns = [common_columns(found.stiffness, highest, designs.yield_strength, size)]
        if study.drive is not None:
            columns.append(travel_columns(travel(found.turning, study.drive.rotation)))
    answers = np.concatenate(columns, axis=1)
    answers[reason != ""] = np.nan
    return Answers(reason, answers)


def _first(refused: list[Broken]) -> AnyArray:
    """The first reason (n,) to refuse each design, "" for none."""
    first = np.zeros(refused[0].where.shape, dtype=np.int64)
    for place in reversed(range(len(refused))):
        first[refused[place].where] = place + 1
    return np.array(["", *(each.reason for each in refused)], dtype=object)[first]


def _off_limits(loaded: LoadedStudy, values: Array) -> list[Broken]:
    """Values that no stage file can give."""
    return [
        Broken(f"{path}: a number no stage file can give", keys()[path].impossible(values[:, index]))
        for index, column in enumerate(loaded.columns)
        for path in column.keys
    ]


def _drawn(loaded: LoadedStudy, values: Array, reason: AnyArray) -> Array:
    """Draw the designs not refused so far, one by one: reasons go to `reason`, bodies' compliances (n, 9, 9) back."""
    bodies = np.zeros((len(values), 9, 9))
    for index in np.flatnonzero(reason == ""):
        try:
            stage = stage_of(loaded, values[index])
            if loaded.study.draws:
                check_feasible(stage)
            if loaded.study.links:
                bodies[index] = body_compliance(stage)
        except BadInput as refusal:
            reason[index] = str(refusal)
    return bodies
