"""What a model answers for a range of designs: a status, a reason and values for each."""

from __future__ import annotations

from typing import NamedTuple

from flexfem.arrays import AnyArray, Array


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
