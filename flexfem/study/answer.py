"""A range of designs in, a row for each out: whatever the model, and whatever goes wrong."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from flexfem.arrays import Array
from flexfem.study.loaded import LoadedStudy
from flexfem.study.rows import Rows
from flexfem.study.sampling import sample

BATCH = 4096  # analytic designs at a time, whatever is asked: bounds the memory


def answer(loaded: LoadedStudy, start: int, stop: int, inside: bool = False) -> Rows:
    """Answer the designs from `start` up to `stop`.

    Parameters
    ----------
    inside : gmsh may run in this very process, one that can be killed; else meshes are made in a child process, which
        ends with the time limit.
    """
    if loaded.study.model == "analytic":
        ends = [*range(start, stop, BATCH), stop]
        batches = [_analytic(loaded, sample(loaded, *pair)) for pair in pairwise(ends)]
    else:
        batches = [_solved(loaded, values, inside) for values in sample(loaded, start, stop)]
    if not batches:
        nothing = np.array([], dtype=object)
        return Rows(nothing, nothing, np.empty((0, len(loaded.outputs))))
    return Rows(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def _analytic(loaded: LoadedStudy, values: Array) -> Rows:
    from flexfem.study.analytic import answer_designs
    from flexfem.study.warned import doubted

    reason, answers = answer_designs(loaded, values)
    status = np.where(reason == "", "ok", "refused").astype(object)
    return doubted(loaded, values, Rows(status, reason, answers))


def _solved(loaded: LoadedStudy, values: Array, inside: bool) -> Rows:
    from flexfem.study.derived import refusals_of
    from flexfem.study.solving import solved_row
    from flexfem.study.warned import doubted

    reason = refusals_of(loaded, values[None])
    if reason[0]:
        return Rows(np.array(["refused"], dtype=object), reason, np.full((1, len(loaded.outputs)), np.nan))
    return doubted(loaded, values[None], solved_row(loaded, values, inside))
