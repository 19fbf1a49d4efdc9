"""What a model answers for a range of designs: a status, a reason and values for each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import one_line

LONGEST = 200  # characters of a reason


class Rows(NamedTuple):
    """What a model answers for n designs.

    Attributes
    ----------
    status : (n,) text: "ok"; "refused", the design is impossible; "failed", mesh or solver; "time limit"; "crashed".
    reason : (n,) one line why not, or where ok what to know of the answer, mostly "".
    values : (n, outputs) in the columns' units; nan where not ok.
    """

    status: AnyArray
    reason: AnyArray
    values: Array


def failed_row(outputs: int, status: str, reason: str) -> Rows:
    """The row of one design without an answer."""
    text = one_line(reason, LONGEST)
    return Rows(np.array([status], object), np.array([text], object), np.full((1, outputs), np.nan))
