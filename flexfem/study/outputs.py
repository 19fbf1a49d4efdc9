"""What a study can be asked for: its output columns, in their order and in file units, and a row for each design."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import one_line
from flexfem.units import unit_of

if TYPE_CHECKING:
    from flexfem.verify.questions import Answers

LONGEST = 200  # characters of a reason

STIFFNESSES = ("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad", "kxy_n_per_mm", "kxt_n", "kyt_n")
COUPLINGS = ("coupling_xy", "coupling_xt", "coupling_yt")
STRESSES = ("stress_x_mpa_per_um", "stress_y_mpa_per_um", "stress_theta_mpa_per_mrad")
RANGES = ("range_x_um", "range_y_um", "range_theta_mrad")
ENVELOPE = ("envelope_mm",)
TRAVELS = ("travel_x_um", "travel_y_um", "travel_theta_mrad")
ERRORS = ("error_x_percent", "error_y_percent", "error_theta_percent")
CROSSES = ("cross_x_percent", "cross_y_percent", "cross_theta_percent")
BANDS = ("band_x_percent", "band_y_percent", "band_theta_percent")
CROSS = {  # stiffnesses between two directions, and those along them
    "kxy_n_per_mm": ("kxx_n_per_mm", "kyy_n_per_mm"),
    "kxt_n": ("kxx_n_per_mm", "ktt_n_mm_per_rad"),
    "kyt_n": ("kyy_n_per_mm", "ktt_n_mm_per_rad"),
}
COMMON = (*STIFFNESSES, *COUPLINGS, *STRESSES, *RANGES, *ENVELOPE)

_ENTRIES = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


def outputs_of(drive: bool, verify: bool, bands: bool) -> tuple[str, ...]:
    """Names of the output columns: travel with a drive, errors of a verification, their bands if wanted."""
    travel = TRAVELS if drive else ()
    errors = (*ERRORS, *CROSSES, *(BANDS if bands else ())) if verify else ()
    return (*COMMON, *travel, *errors)


def values_of(answers: Answers, rotation: float | None) -> Array:
    """Values (n, outputs) of the columns, with the travels where a base hinge may turn by `rotation`, rad."""
    asked = [answers.stiffness[:, *_ENTRIES], answers.coupling, answers.stress * _factors(STRESSES)]
    asked += [answers.range_at_yield * _factors(RANGES), answers.envelope[:, None]]
    if rotation is not None:
        asked.append(answers.travel(rotation) * _factors(TRAVELS))
    asked += [each for each in answers.errors or () if each is not None]
    return np.concatenate(asked, axis=1)


def _factors(columns: tuple[str, ...]) -> Array:
    """What turns numbers in N, mm, MPa, rad into those of the columns (k,)."""
    return np.array([unit_of(column).factor for column in columns])


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
